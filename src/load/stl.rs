//! STL meshes: binary and ASCII, with face colours as written by VisCAM, SolidView and Materialise Magics.
//!
//! Layout: 3D Systems 1988, "StereoLithography Interface Specification". Binary files have 80 bytes of header, the number of
//! triangles (u32, little-endian), and 50 bytes per triangle: normal and corners as f32, and a 16-bit attribute, which some
//! programs use for colours of five bits per channel. Normals are face normals and are not read. Coincident corners are merged
//! to one vertex. Files have neither units nor materials; z is up by convention of 3D printing and CAD.

use super::mesh_tools::{NAMELESS, Repairs, bound_colors, color_triangles};
use super::triangulate::triangulate;
use super::words::{decimal_commas, is_nan_word};
use super::{LoadOptions, Loaded, Up, UpHint, files, mesh_tools};
use crate::color::srgb_table;
use crate::error::{Error, Problem, Result, Warning};
use crate::math::{DAffine3, DVec3};
use crate::scene::{Instance, Material, MaterialId, Mesh, MeshId, MeshPart};
use std::collections::HashMap;
use std::path::Path;

/// Size of the header with the triangle count of a binary file, bytes.
const HEADER: usize = 84;
/// Size of a triangle of a binary file, bytes.
const FACET: usize = 50;

/// The contents of a file.
#[derive(Default)]
struct Facets {
    /// Three per triangle.
    corners: Vec<[f64; 3]>,
    /// Linear RGBA per triangle; empty if the file has no colours.
    colors: Vec<[f32; 4]>,
    /// Recoverable problems.
    warnings: Vec<String>,
}

/// Reads an STL file as one mesh.
///
/// # Errors
/// An input error if the file can't be read or holds no triangles.
pub(super) fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    options.files.note(path);
    let bytes = files::read_model(path)?;
    options.counter.begin(bytes.len() as u64);
    let facets = match is_ascii(&bytes) {
        true => parse_ascii(&bytes).map_err(|problem| Error::input_problems(path, vec![problem]))?,
        false => parse_binary(path, &bytes)?,
    };
    options.counter.add(bytes.len() as u64);
    drop(bytes);
    if facets.corners.is_empty() {
        return Err(
            Error::input(path, ("no-surface", "has no triangles")).with_help("only surfaces can be rendered")
        );
    }
    let single: Vec<[f32; 3]> = facets.corners.iter().map(|c| c.map(|x| x as f32)).collect();
    let origin = mesh_tools::distant_origin(single.iter());
    drop(single);
    let mut loaded = Loaded::default();
    let warnings = facets.warnings.iter().map(|message| Warning::new(path, "", message.as_str()));
    loaded.warnings.extend(warnings);
    add_mesh(path, &facets, origin, &mut loaded)?;
    mesh_tools::place_at_origin(path, origin, &mut loaded);
    loaded.up_hint = UpHint { writer: Some((Up::Z, "convention of STL files")), is_mostly_y: false };
    loaded.scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(loaded)
}

/// Adds the mesh with its material and instance.
fn add_mesh(path: &Path, facets: &Facets, origin: DVec3, loaded: &mut Loaded) -> Result<()> {
    let mut mesh = indexed(&facets.corners, origin);
    let mut material = Material::lambert("default", [0.8; 3]);
    if !facets.colors.is_empty() {
        color_triangles(&mut mesh, &facets.colors);
        let warning = bound_colors(&mut mesh.colors, false).map(|what| Warning::new(path, "", what));
        loaded.warnings.extend(warning);
        material = Material { use_vertex_colors: true, ..Material::lambert("face colours", [1.0; 3]) };
    }
    let mut repairs = Repairs::default();
    repairs.repair(&mut mesh);
    loaded.warnings.extend(repairs.warnings(path));
    let too_many = |_| Error::input(path, "has more than 4,294,967,295 triangles or vertices");
    u32::try_from(mesh.positions.len()).map_err(too_many)?;
    let triangle_count = u32::try_from(mesh.triangles.len()).map_err(too_many)?;
    mesh.parts = vec![MeshPart { first_triangle: 0, triangle_count, material: MaterialId(0) }];
    loaded.default_materials = vec![MaterialId(0)];
    let scene = &mut loaded.scene;
    scene.materials.push(material);
    scene.meshes.push(mesh);
    scene.instances.push(Instance { name: NAMELESS.into(), ..Instance::new(MeshId(0), DAffine3::IDENTITY) });
    Ok(())
}

/// An indexed mesh relative to `origin`.
fn indexed(corners: &[[f64; 3]], origin: DVec3) -> Mesh {
    let mut mesh = Mesh { name: "mesh".to_string(), ..Mesh::default() };
    let mut known: HashMap<[u64; 3], u32> = HashMap::with_capacity(corners.len() / 4);
    mesh.triangles.reserve_exact(corners.len() / 3);
    for triangle in corners.as_chunks::<3>().0 {
        let vertex = |corner: [f64; 3]| {
            // Adding 0 merges -0 with 0.
            *known.entry(corner.map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
                mesh.positions.push((DVec3::from_array(corner) - origin).as_vec3().to_array());
                (mesh.positions.len() - 1) as u32
            })
        };
        mesh.triangles.push(triangle.map(vertex));
    }
    mesh
}

/// Whether a file is text. Binary files may also begin with `solid`; they have a size that matches their count, or zero bytes.
fn is_ascii(bytes: &[u8]) -> bool {
    let start = bytes.trim_ascii_start();
    let has_word = start.len() >= 5 && start[..5].eq_ignore_ascii_case(b"solid");
    let fits = count(bytes).is_some_and(|n| HEADER as u64 + n * FACET as u64 == bytes.len() as u64);
    has_word && !fits && !bytes.contains(&0)
}

/// Whether bytes are printable, with white space; binary headers have zero bytes or a count that isn't printable.
fn is_text(bytes: &[u8]) -> bool {
    bytes.iter().all(|byte| *byte >= b' ' && *byte != 0x7f || byte.is_ascii_whitespace())
}

/// The number of triangles in a binary header.
fn count(bytes: &[u8]) -> Option<u64> {
    let word = bytes.get(80..HEADER)?;
    Some(u64::from(u32::from_le_bytes(word.try_into().ok()?)))
}

fn parse_binary(path: &Path, bytes: &[u8]) -> Result<Facets> {
    let Some(declared) = count(bytes) else {
        let message = format!("is not an STL file: it ends after {} bytes, inside its header", bytes.len());
        return Err(Error::input(path, ("cut-short", message)));
    };
    let mut facets = Facets::default();
    let available = (bytes.len() - HEADER) / FACET;
    let expected = usize::try_from(declared).unwrap_or(usize::MAX);
    if expected > available && available == 0 {
        let message = format!("declares {declared} triangles, but ends after its header");
        return Err(Error::input(path, ("cut-short", message)).with_help("export or download the file again"));
    }
    if expected > available && is_text(&bytes[..HEADER]) {
        let message = "is not an STL file: it is text that doesn't start with 'solid'";
        return Err(Error::input(path, message).with_help("check its extension"));
    }
    if expected > available {
        let message = format!(
            "declares {declared} triangles, but holds {available}: it is truncated or its count is wrong"
        );
        facets.warnings.push(message);
    }
    let rows = bytes[HEADER..].as_chunks::<FACET>().0;
    let rows = &rows[..expected.min(available)];
    let float = |b: &[u8]| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    facets.corners.reserve_exact(rows.len() * 3);
    for row in rows {
        let numbers = row[12..48].as_chunks::<4>().0;
        facets.corners.extend(numbers.as_chunks::<3>().0.iter().map(|c| c.each_ref().map(|b| float(&b[..]))));
    }
    facets.colors = face_colors(&bytes[..80], rows);
    Ok(facets)
}

/// Face colours of binary files. Magics has a default colour in the header (`COLOR=`), for faces with bit 15 set, and red in the
/// lowest bits; other programs set bit 15 for faces with a colour, and have blue in the lowest bits.
fn face_colors(header: &[u8], rows: &[[u8; FACET]]) -> Vec<[f32; 4]> {
    let attribute = |row: &[u8; FACET]| u16::from_le_bytes([row[48], row[49]]);
    let table = srgb_table();
    let level = |value: u16| table[usize::from((value & 31) * 255 / 31)];
    let magics_default =
        header.windows(6).position(|w| w == b"COLOR=").and_then(|at| header.get(at + 6..at + 9));
    let Some(default) = magics_default else {
        let has_color = |row: &[u8; FACET]| attribute(row) & 0x8000 != 0;
        // Attributes may have other meanings.
        if !rows.iter().any(has_color) {
            return Vec::new();
        }
        let color = |row: &[u8; FACET]| match (has_color(row), attribute(row)) {
            (true, bits) => [level(bits >> 10), level(bits >> 5), level(bits), 1.0],
            (false, _) => [UNCOLORED, UNCOLORED, UNCOLORED, 1.0],
        };
        return rows.iter().map(color).collect();
    };
    let [r, g, b] = [default[0], default[1], default[2]].map(|byte| table[usize::from(byte)]);
    let color = |row: &[u8; FACET]| match attribute(row) {
        bits if bits & 0x8000 == 0 => [level(bits), level(bits >> 5), level(bits >> 10), 1.0],
        _ => [r, g, b, 1.0],
    };
    rows.iter().map(color).collect()
}

/// Linear grey of faces without a colour, in files with face colours.
const UNCOLORED: f32 = 0.8;

/// Reads text: `vertex x y z` up to `endloop` for each face; normals and names are ignored.
fn parse_ascii(bytes: &[u8]) -> std::result::Result<Facets, Problem> {
    let (mut facets, mut polygon) = (Facets::default(), Vec::<[f64; 3]>::new());
    let mut degenerate = 0usize;
    for (number, line) in bytes.split(|&b| b == b'\n' || b == b'\r').enumerate() {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let Some(keyword) = words.next() else { continue };
        if keyword.eq_ignore_ascii_case(b"vertex") {
            polygon.push(corner(words).ok_or_else(|| {
                let message = format!("'vertex' needs three numbers{}", decimal_commas(line));
                Problem::new(format!("line {}", number + 1), message)
            })?);
        } else if keyword.eq_ignore_ascii_case(b"endloop") || keyword.eq_ignore_ascii_case(b"endfacet") {
            degenerate += usize::from(matches!(polygon.len(), 1 | 2));
            let corners: Vec<[f32; 3]> = polygon.iter().map(|c| c.map(|x| x as f32)).collect();
            facets.corners.extend(triangulate(&corners).into_iter().flatten().map(|k| polygon[k]));
            polygon.clear();
        }
    }
    if !polygon.is_empty() {
        facets.warnings.push("ends inside a face, which is left out: the file is truncated".into());
    }
    if degenerate > 0 {
        facets.warnings.push(format!("{degenerate} faces of fewer than three corners: left out"));
    }
    Ok(facets)
}

fn corner<'w>(mut words: impl Iterator<Item = &'w [u8]>) -> Option<[f64; 3]> {
    let mut corner = [0.0; 3];
    for value in &mut corner {
        let word = words.next()?;
        let number = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
        *value = number.or_else(|| is_nan_word(word).then_some(f64::NAN))?;
    }
    Some(corner)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f32; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    /// A binary file of faces: indices into `CORNERS`, and attribute.
    fn file(header: &[u8], faces: &[([usize; 3], u16)]) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(80, 0);
        bytes.extend((faces.len() as u32).to_le_bytes());
        for (corners, attribute) in faces {
            bytes.extend([0; 12]);
            let numbers = corners.iter().flat_map(|&k| CORNERS[k]);
            bytes.extend(numbers.flat_map(f32::to_le_bytes));
            bytes.extend(attribute.to_le_bytes());
        }
        bytes
    }

    fn read(bytes: &[u8]) -> Result<Loaded> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.stl");
        std::fs::write(&path, bytes).expect("written");
        load(&path, &LoadOptions::default())
    }

    #[test]
    fn corners_are_merged_for_any_binary_header() {
        for header in [&b""[..], b"solid by some program"] {
            let loaded =
                read(&file(header, &[([0, 1, 2], 0), ([0, 2, 3], 0)])).unwrap_or_else(|e| panic!("{e}"));
            let mesh = &loaded.scene.meshes[0];
            assert_eq!((mesh.positions.len(), &mesh.triangles[..]), (4, &[[0, 1, 2], [0, 2, 3]][..]));
            assert!(mesh.colors.is_empty() && loaded.warnings.is_empty());
        }
    }

    #[test]
    fn truncated_binary_files_are_not_read_as_text() {
        let whole = file(b"solid by some program", &[([0, 1, 2], 0), ([0, 2, 3], 0)]);
        let loaded = read(&whole[..whole.len() - 20]).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(loaded.scene.meshes[0].triangles, [[0, 1, 2]]);
        assert!(loaded.warnings[0].to_string().contains("declares 2 triangles, but holds 1"));
    }

    #[test]
    fn both_color_conventions_are_read() {
        let red = [1.0, 0.0, 0.0, 1.0];
        let of = |bytes: &[u8]| read(bytes).expect("it loads").scene.meshes.remove(0);
        let mesh = of(&file(b"", &[([0, 1, 2], 0x8000 | 31 << 10), ([0, 2, 3], 0)]));
        assert_eq!((mesh.colors[0], mesh.colors[3], mesh.positions.len()), (red, [0.8, 0.8, 0.8, 1.0], 6));
        let mesh = of(&file(b"COLOR=\xff\0\0\xff", &[([0, 1, 2], 31), ([0, 2, 3], 0x8000)]));
        assert_eq!((&mesh.colors[..], mesh.positions.len()), (&[red; 4][..], 4));
    }

    #[test]
    fn text_is_read_in_any_spelling() {
        let text = "SOLID a\n FACET normal 0 0 1\n outer loop\r\n vertex 0 0 0\n VERTEX 1e0 0 0\n vertex 1 1 0\n \
                    vertex 0 1 0\n endloop\nendfacet\nfacet normal 0 0 0\nouter loop\nvertex 0 0 1\nvertex 1.#QNAN 0 1\n\
                    vertex 0 1 1\nendloop\nendfacet\nendsolid";
        let loaded = read(text.as_bytes()).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(loaded.scene.meshes[0].triangles.len(), 2);
        assert!(loaded.warnings[0].message.contains("1 triangles"), "{:?}", loaded.warnings);
    }

    #[test]
    fn damaged_files_are_reported() {
        let whole = file(b"", &[([0, 1, 2], 0), ([0, 2, 3], 0)]);
        let cut = read(&whole[..whole.len() - 9]).expect("one triangle is left");
        assert_eq!(cut.scene.meshes[0].triangles.len(), 1);
        assert!(cut.warnings[0].message.contains("2 triangles"));
        let refusal = |bytes: &[u8]| read(bytes).expect_err("it is refused");
        assert_eq!(refusal(&whole[..90]).problems[0].code, "cut-short");
        assert_eq!(refusal(b"abc").problems[0].code, "cut-short");
        assert_eq!(refusal(b"solid a\nendsolid a\n").problems[0].code, "no-surface");
        let other = refusal("v 0.25 0.5 1\n".repeat(30).as_bytes()).to_string();
        assert!(other.contains("text that doesn't start with 'solid'"), "{other}");
        let commas = refusal(b"solid a\nfacet\nouter loop\nvertex 1,5 0,0 2,0\n").to_string();
        assert!(commas.contains("line 4") && commas.contains("LC_NUMERIC"), "{commas}");
    }
}
