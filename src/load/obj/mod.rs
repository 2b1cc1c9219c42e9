//! OBJ meshes with MTL materials, read by `tobj` behind a reader that checks and cleans the lines.
//!
//! Objects and groups become instances; polygons of any size, concave ones included; negative indices; normals, or
//! smoothing groups where they are missing, else flat shading; texture coordinates (turned so that v grows downwards);
//! vertex colours (sRGB-encoded, as exporters write them). Points (`p`), and all vertices of a file that has nothing else,
//! become spheres; lines and free-form surfaces are
//! left out, with a count. Positions beyond the precision of single floats are kept around an origin of their own. Text may be UTF-8 or Latin-1, with a byte order mark, any line ends, and lines continued by `\`.
//!
//! `tobj` gets even statements without problems (`statements.rs`, `mtl.rs`), which note what it drops: lines, smoothing
//! groups, materials of several libraries, options of textures. Polygons are cut here, as `tobj` would fan them out.

mod build;
mod cloud;
mod files;
mod lines;
mod maps;
mod materials;
mod mtl;
mod numbers;
mod piece;
mod statements;

pub(in crate::load) use files::find as find_file;

use super::shapes::Repairs;
use super::words::is_utf_16;
use super::{LoadOptions, Loaded, Up, UpHint, far};
use crate::error::{Error, Result, Warning};
use crate::math::DAffine3;
use crate::scene::{Instance, Material, MaterialId, MeshId, MeshPart};
use build::Object;
use lines::{Counted, by_tobj};
use maps::Maps;
use mtl::Mtl;
use statements::{MaterialName, Statements};
use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::{Read, Seek};
use std::path::{Path, PathBuf};

/// Reads an OBJ file and its material libraries: a mesh for each object and group.
pub(super) fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    options.files.note(path);
    let (models, mut statements) = read(path, options)?;
    let points = statements.cloud();
    let origin = match models.is_empty() {
        false => far::origin(models.iter().flat_map(|m| m.mesh.positions.as_chunks().0)),
        true => far::origin(cloud::positions(path, &points)?.iter()),
    };
    let objects = build::objects(models, &statements, origin);
    let mut loaded = Loaded { up_hint: up_hint(path), ..Loaded::default() };
    loaded.scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    for (line, message) in statements.left_out() {
        loaded.warnings.push(Warning::new(path, format!("line {line}"), message));
    }
    let libraries = match options.geometry_only {
        true => Vec::new(),
        false => read_libraries(path, &statements, options, &mut loaded.warnings),
    };
    let materials = statements.materials;
    let mut palette = Palette {
        file: path,
        names: &materials,
        // Of several materials of a name, the first counts.
        libraries: libraries
            .iter()
            .rev()
            .map(|(file, mtl)| (mtl.name.as_str(), (file.as_path(), mtl)))
            .collect(),
        maps: Maps::new(options),
        ids: HashMap::new(),
    };
    let mut repairs = Repairs::default();
    loaded.warnings.extend(build::shared_points(&objects).map(|what| Warning::new(path, "", what)));
    for object in objects {
        add(object, &mut palette, &mut loaded, &mut repairs);
    }
    loaded.warnings.extend(repairs.warnings(path));
    warn_of_missing_coordinates(path, &mut loaded);
    if !points.is_empty() {
        cloud::add(path, &points, origin, options, &mut loaded)?;
    }
    far::place(path, origin, &mut loaded);
    let used: HashSet<&str> = materials.iter().map(|(name, _)| name.as_str()).collect();
    let mut defined = HashSet::new();
    for (library, m) in &libraries {
        if !defined.insert(&m.name) {
            let message = format!("material '{}' was defined before: the first counts", m.name);
            loaded.warnings.push(Warning::new(library, "", message));
            continue;
        }
        if !used.contains(m.name.as_str()) {
            loaded.left_out.push(format!("material '{}': no face uses it", m.name));
        }
    }
    Ok(loaded)
}

/// Textures on faces without texture coordinates have the colour of one texel everywhere.
fn warn_of_missing_coordinates(path: &Path, loaded: &mut Loaded) {
    let scene = &loaded.scene;
    let bare = scene.meshes.iter().filter(|mesh| mesh.uv_sets.is_empty()).flat_map(|mesh| &mesh.parts);
    let mut ids: Vec<MaterialId> = bare.map(|part| part.material).collect();
    ids.sort_unstable();
    ids.dedup();
    for material in ids.into_iter().map(|id| &scene.materials[id.0 as usize]) {
        if material.textures().next().is_some() {
            let message = format!(
                "material '{}' has textures, but faces that it covers have no texture coordinates ('vt')",
                material.name
            );
            loaded.warnings.push(Warning::new(path, "", message));
        }
    }
}

/// What the comments at a file's head tell about who wrote it.
fn up_hint(path: &Path) -> UpHint {
    let mut head = Vec::new();
    // What can't be read has been an error before.
    let _ = File::open(path).and_then(|file| file.take(1 << 10).read_to_end(&mut head));
    let head = String::from_utf8_lossy(&head);
    let is_of_blender = head.lines().any(|l| l.starts_with('#') && l.contains("Blender"));
    UpHint { writer: is_of_blender.then_some((Up::Y, "Blender, which wrote it")), is_mostly_y: true }
}

/// What `tobj` makes of the faces of a file, and what else its statements say.
///
/// # Errors
/// An input error with all problems of the file.
fn read(path: &Path, options: &LoadOptions) -> Result<(Vec<tobj::Model>, Statements)> {
    match read_in(path, false, options) {
        Ok((_, statements)) if statements.needs_two_passes => read_in(path, true, options),
        read => read,
    }
}

/// In one pass or two. Where one doesn't do, the statements say so, and nothing else counts.
fn read_in(
    path: &Path,
    has_two_passes: bool,
    options: &LoadOptions,
) -> Result<(Vec<tobj::Model>, Statements)> {
    let unreadable = |e| Error::input(path, format!("can't be read: {e}"));
    let mut file = File::open(path).map_err(unreadable)?;
    let mut start = Vec::new();
    file.by_ref().take(16).read_to_end(&mut start).and_then(|_| file.rewind()).map_err(unreadable)?;
    if is_utf_16(&start) {
        return Err(Error::input(path, "is UTF-16 text").with_help("save the file as UTF-8"));
    }
    // Corners with the same indices become one vertex; polygons stay what they are.
    let even = tobj::LoadOptions { single_index: true, ..tobj::LoadOptions::default() };
    let cleaner = Statements::new(has_two_passes, options.keeps_polygons);
    let no_library = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, statements) = by_tobj(Counted::new(file, &options.gauge), cleaner, |reader| {
        tobj::load_obj_buf(reader, &even, no_library).map(|(models, _)| models)
    })
    .map_err(|message| Error::input(path, message))?;
    if statements.needs_two_passes {
        return Ok((Vec::new(), statements));
    }
    let problems = statements.problems();
    match (problems.is_empty(), models) {
        (false, _) => Err(Error::input_problems(path, problems)),
        // `tobj` refuses a file without faces.
        (true, Err(_)) if statements.pieces.is_empty() => Ok((Vec::new(), statements)),
        (true, Err(e)) => Err(Error::input(path, format!("can't be understood: {e}"))),
        (true, Ok(models)) => Ok((models, statements)),
    }
}

/// Adds an object to the scene; the number of triangles that had to be dropped.
fn add(object: Object, palette: &mut Palette, loaded: &mut Loaded, repairs: &mut Repairs) {
    let Object { mut mesh, runs, cage, .. } = object;
    let total = mesh.triangles.len() as u32;
    let ends: Vec<u32> = runs.iter().skip(1).map(|r| r.first_triangle).chain([total]).collect();
    let kept = |from: u32, to: u32| {
        let finite = |&i: &u32| mesh.positions[i as usize].iter().all(|x| x.is_finite());
        mesh.triangles[from as usize..to as usize].iter().filter(|t| t.iter().all(finite)).count() as u32
    };
    let counts: Vec<u32> = runs.iter().zip(&ends).map(|(r, &end)| kept(r.first_triangle, end)).collect();
    repairs.make(&mut mesh);
    if mesh.triangles.is_empty() {
        return;
    }
    let (mut first_triangle, has_colors) = (0, !mesh.colors.is_empty());
    for (run, triangle_count) in runs.iter().zip(counts).filter(|(_, n)| *n > 0) {
        let material = palette.id(run.material, has_colors, loaded);
        mesh.parts.push(MeshPart { first_triangle, triangle_count, material });
        first_triangle += triangle_count;
    }
    if let Some((mut cage, names)) = cage {
        cage.materials = names.into_iter().map(|name| palette.id(name, has_colors, loaded)).collect();
        loaded.polygons.keep(MeshId(loaded.scene.meshes.len() as u32), cage);
    }
    let scene = &mut loaded.scene;
    if mesh.name.is_empty() {
        mesh.name = "mesh".to_string();
    }
    scene.instances.push(Instance {
        name: mesh.name.clone(),
        ..Instance::new(MeshId(scene.meshes.len() as u32), DAffine3::IDENTITY)
    });
    scene.meshes.push(mesh);
}

/// The materials of a file's libraries, each converted when a face first needs it.
struct Palette<'a> {
    file: &'a Path,
    /// The names that the file uses, with their lines.
    names: &'a [(String, usize)],
    /// All materials by name, with their library's file.
    libraries: HashMap<&'a str, (&'a Path, &'a Mtl)>,
    maps: Maps<'a>,
    /// By name and by whether vertex colours multiply it.
    ids: HashMap<(MaterialName, bool), MaterialId>,
}

impl Palette<'_> {
    fn id(&mut self, name: MaterialName, has_colors: bool, loaded: &mut Loaded) -> MaterialId {
        if let Some(&id) = self.ids.get(&(name, has_colors)) {
            return id;
        }
        let used = name.and_then(|n| self.names.get(n as usize)).filter(|_| !self.maps.options.geometry_only);
        let found = used.and_then(|(name, _)| self.libraries.get(name.as_str()).copied());
        let mut material = match (found, used) {
            (Some((library, mtl)), _) => materials::convert(mtl, library, &mut self.maps, loaded),
            (None, Some((name, line))) => {
                let message = format!("there is no material '{name}'; what it should cover is grey");
                loaded.warnings.push(Warning::new(self.file, format!("line {line}"), message));
                Material::lambert(name, [0.8; 3])
            }
            // Vertex colours alone are the whole colour.
            (None, None) => Material::lambert("default", [if has_colors { 1.0 } else { 0.8 }; 3]),
        };
        material.use_vertex_colors = has_colors;
        loaded.scene.materials.push(material);
        let id = MaterialId(loaded.scene.materials.len() as u32 - 1);
        if found.is_none() {
            loaded.stand_ins.push(id);
        }
        self.ids.insert((name, has_colors), id);
        id
    }
}

/// All materials of the libraries that the file names; a missing library is a warning.
fn read_libraries(
    path: &Path,
    statements: &Statements,
    options: &LoadOptions,
    warnings: &mut Vec<Warning>,
) -> Vec<(PathBuf, Mtl)> {
    let (mut all, mut seen) = (Vec::new(), Vec::new());
    for (statement, line) in &statements.libraries {
        let place = format!("line {line}");
        if statement.is_empty() {
            warnings.push(Warning::new(path, &place, "'mtllib' without a file name is ignored"));
        }
        // A name may hold blanks, and a statement several names.
        let names = match files::find(path, statement, options) {
            Ok(_) => vec![statement.as_str()],
            Err(_) => statement.split_whitespace().collect(),
        };
        for name in names {
            let file = match files::find(path, name, options) {
                Ok(file) if seen.contains(&file) => continue,
                Ok(file) => file,
                Err(message) => {
                    let message = format!("material library {message}; its materials are grey");
                    warnings.push(Warning::new(path, &place, message));
                    continue;
                }
            };
            match mtl::read(&file, warnings) {
                Ok(materials) => all.extend(materials.into_iter().map(|m| (file.clone(), m))),
                Err(message) => {
                    let message = format!("material library '{name}' {message}; its materials are grey");
                    warnings.push(Warning::new(path, &place, message));
                }
            }
            seen.push(file);
        }
    }
    all
}
