//! Our readers against others: `tobj` for OBJ, `image` for images, and the official validator's reports for glTF.

use crate::files::load_files;
use crate::skip::skip;
use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, Rgb, Rgba};
use oscura::color::linear_from_srgb;
use oscura::load::{LoadOptions, Loaded, load};
use oscura::sampling::hash::SplitMix64;
use serde_json::{Value, json};
use std::fmt::Write;
use std::io::Cursor;
use std::path::{Path, PathBuf};

fn load_file(path: &Path) -> Loaded {
    load(path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

/// Files of a test data folder outside the repository, by extension; reports where it is absent.
fn shared(inside: &str, extension: &str) -> Vec<PathBuf> {
    let shared = std::env::var_os("OSCURA_SHARED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    let folder = shared.join(inside);
    let mut waiting = vec![folder.clone()];
    let mut files = Vec::new();
    while let Some(folder) = waiting.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten() {
            let path = entry.expect("an entry").path();
            match path.is_dir() {
                true => waiting.push(path),
                false if path.extension().is_some_and(|e| e == extension) => files.push(path),
                false => {}
            }
        }
    }
    if files.is_empty() {
        skip("shared", &format!("{} holds no .{extension}", folder.display()));
    }
    files.sort();
    files
}

/// A comparable vertex: position, normal and texture coordinates, where present.
type Corner = Vec<u32>;

fn corner(parts: &[&[f32]]) -> Corner {
    parts.iter().flat_map(|part| part.iter().map(|v| (v + 0.0).to_bits())).collect()
}

/// The triangles of `tobj`, each starting at its smallest vertex, sorted.
fn triangles_by_tobj(path: &Path) -> Vec<[Corner; 3]> {
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ..Default::default() };
    let (models, _) = tobj::load_obj(path, &options).expect("tobj reads it");
    let mut list = Vec::new();
    for mesh in models.iter().map(|model| &model.mesh) {
        let at = |i: u32| {
            let i = i as usize;
            let uv = mesh.texcoords.get(2 * i..2 * i + 2).map(|uv| [uv[0], 1.0 - uv[1]]);
            let uv = uv.as_ref().map_or(&[][..], |uv| uv);
            corner(&[
                &mesh.positions[3 * i..3 * i + 3],
                mesh.normals.get(3 * i..3 * i + 3).unwrap_or(&[]),
                uv,
            ])
        };
        list.extend(mesh.indices.chunks_exact(3).map(|t| turned([at(t[0]), at(t[1]), at(t[2])])));
    }
    list.sort();
    list
}

/// The same triangles of our reader.
fn triangles_of(path: &Path) -> Vec<[Corner; 3]> {
    let scene = load_file(path).scene;
    let mut list = Vec::new();
    for mesh in &scene.meshes {
        let at = |i: u32| {
            let i = i as usize;
            let normal = mesh.normals.get(i).map_or(&[][..], |n| n);
            let uv = mesh.uv_sets.first().and_then(|set| set.get(i)).map_or(&[][..], |uv| uv);
            corner(&[&mesh.positions[i], normal, uv])
        };
        list.extend(mesh.triangles.iter().map(|t| turned(t.map(at))));
    }
    list.sort();
    list
}

fn turned(mut corners: [Corner; 3]) -> [Corner; 3] {
    let first = (0..3).min_by_key(|&i| corners[i].clone()).expect("three");
    corners.rotate_left(first);
    corners
}

/// Triangles and squares of random terrain, with unit normals and texture coordinates, indices from both ends.
fn field() -> String {
    const N: i64 = 12;
    let mut random = SplitMix64::new(7);
    let mut number = move || random.next_unit();
    let mut text = String::from("# a field\no field\n");
    for (y, x) in (0..N).flat_map(|y| (0..N).map(move |x| (y, x))) {
        let (height, turn) = (number(), number());
        writeln!(text, "v {x} {height:.6} {y}\nvt {:.6} {:.6}", number(), number()).expect("written");
        writeln!(
            text,
            "vn {} {} 0",
            [0.0, 0.6, 0.8, 1.0][(turn * 4.0) as usize],
            [1.0, 0.8, 0.6, 0.0][(turn * 4.0) as usize]
        )
        .expect("written");
    }
    for (y, x) in (0..N - 1).flat_map(|y| (0..N - 1).map(move |x| (y, x))) {
        let a = y * N + x + 1;
        let [a, b, c, d] = [a, a + N, a + N + 1, a + 1].map(|i| if x % 3 == 0 { i - N * N - 1 } else { i });
        let word = |i: i64| format!("{i}/{i}/{i}");
        match (x + y) % 2 {
            0 => writeln!(text, "f {} {} {}", word(a), word(b), word(c)),
            _ => writeln!(text, "f {} {} {} {}", word(a), word(b), word(c), word(d)),
        }
        .expect("written");
    }
    text
}

/// `tobj` splits a square along its first vertex; ours may choose the other diagonal, so squares are planar triangles with the
/// same corner attributes.
#[test]
fn obj_files_match_tobj() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("triangles.obj");
    let triangles: String = field()
        .lines()
        .filter(|l| l.split(' ').count() < 5 || !l.starts_with('f'))
        .map(|l| format!("{l}\n"))
        .collect();
    std::fs::write(&path, triangles).expect("written");
    let (ours, theirs) = (triangles_of(&path), triangles_by_tobj(&path));
    assert!(theirs.len() > 50);
    assert_eq!(ours, theirs);
    // Positions only where a model has no normals: ours may compute some.
    for path in shared("data/models", "obj") {
        let positions = |list: Vec<[Corner; 3]>| {
            let mut list: Vec<[Corner; 3]> =
                list.into_iter().map(|t| turned(t.map(|c| c[..3].to_vec()))).collect();
            list.sort();
            list
        };
        let is_triangulated = std::fs::read(&path).expect("the file").split(|b| *b == b'\n').all(|line| {
            !line.starts_with(b"f ")
                || line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).count() == 4
        });
        let (ours, theirs) = (positions(triangles_of(&path)), positions(triangles_by_tobj(&path)));
        println!("{}: {} triangles", path.display(), theirs.len());
        if is_triangulated {
            assert!(ours == theirs, "{}: {} of ours, {} of tobj's", path.display(), ours.len(), theirs.len());
        }
    }
}

/// A scene whose only texture is an image file.
fn texels(name: &str, bytes: &[u8]) -> oscura::image::Image {
    let scene = format!(
        "camera = {{ look_from = [0, 0, 5], look_at = [0, 0, 0] }}\nenvironment.background = 1\n\
         textures.t = {{ type = \"image\", file = \"{name}\" }}\nmaterials.m = {{ type = \"lambert\", color = \"t\" }}\n\
         [[objects]]\nsphere = {{ center = [0, 0, 0], radius = 1 }}\nmaterial = \"m\"\n"
    );
    let loaded = load_files(&[("a.toml", scene.as_bytes()), (name, bytes)]);
    loaded.unwrap_or_else(|e| panic!("{e}")).scene.images.remove(0)
}

/// Noise in every format and bit depth that can be written here, read by `image` and by us.
#[test]
fn images_match_the_image_crate() {
    let mut random = SplitMix64::new(3);
    let mut byte = move || (random.next_bits() >> 56) as u8;
    let (w, h) = (13, 7);
    let wide = |a: u8, b: u8| u16::from_le_bytes([a, b]);
    let grey = DynamicImage::ImageLuma8(ImageBuffer::from_fn(w, h, |_, _| Luma([byte()])));
    let rgb = DynamicImage::ImageRgb8(ImageBuffer::from_fn(w, h, |_, _| Rgb([byte(), byte(), byte()])));
    let rgba =
        DynamicImage::ImageRgba8(ImageBuffer::from_fn(w, h, |_, _| Rgba([byte(), byte(), byte(), byte()])));
    let deep =
        DynamicImage::ImageRgb16(ImageBuffer::from_fn(
            w,
            h,
            |_, _| Rgb([0; 3].map(|_| wide(byte(), byte()))),
        ));
    let float = DynamicImage::ImageRgb32F(ImageBuffer::from_fn(w, h, |_, _| {
        Rgb([0; 3].map(|_| f32::from(byte()) / 16.0))
    }));
    let cases = [
        ("a.png", ImageFormat::Png, vec![&grey, &rgb, &rgba, &deep]),
        ("a.jpg", ImageFormat::Jpeg, vec![&grey, &rgb]),
        ("a.webp", ImageFormat::WebP, vec![&rgb, &rgba]),
        ("a.bmp", ImageFormat::Bmp, vec![&rgb]),
        ("a.tga", ImageFormat::Tga, vec![&grey, &rgb, &rgba]),
        ("a.tiff", ImageFormat::Tiff, vec![&rgb, &rgba, &deep]),
        ("a.hdr", ImageFormat::Hdr, vec![&float]),
    ];
    // Builds may lack a decoder.
    for (name, format, pictures) in cases.into_iter().filter(|case| case.1.reading_enabled()) {
        for picture in pictures {
            let mut file = Cursor::new(Vec::new());
            picture.write_to(&mut file, format).expect("encoded");
            let theirs = image::load_from_memory_with_format(file.get_ref(), format).expect("image reads it");
            let (ours, linear) = (texels(name, file.get_ref()), format == ImageFormat::Hdr);
            assert_eq!((ours.width, ours.height), (theirs.width(), theirs.height()), "{name}");
            for (x, y, pixel) in theirs.to_rgba32f().enumerate_pixels() {
                let Rgba([r, g, b, a]) = *pixel;
                let expected = [r, g, b].map(|v| if linear { v } else { linear_from_srgb(v) });
                let found = ours.rgba(x, y);
                let worst =
                    (0..3).map(|c| (found[c] - expected[c]).abs() / (0.01 + expected[c])).fold(0.0, f32::max);
                assert!(worst < 1e-4, "{name} {:?} at {x} {y}: {found:?} for {expected:?}", theirs.color());
                assert!(
                    (found[3] - a).abs() < 1e-6,
                    "{name} {:?} at {x} {y}: {found:?} for {a}",
                    theirs.color()
                );
            }
        }
    }
}

/// Validator errors that a renderer may ignore, with the reason.
const NOT_OURS: &[(&str, &str)] = &[
    ("MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_UNSIGNED_INT", "of an attribute that is not read"),
    ("MESH_PRIMITIVE_INVALID_ATTRIBUTE", "of an attribute that is not read"),
    ("MESH_PRIMITIVE_MORPH_TARGET_INVALID_ATTRIBUTE_COUNT", "of a morph target that doesn't show"),
    ("MESH_PRIMITIVE_MORPH_TARGET_NO_BASE_ACCESSOR", "of a morph target that doesn't show"),
    ("MESH_PRIMITIVES_UNEQUAL_TARGETS_COUNT", "of morph targets that don't show"),
    ("UNRESOLVED_REFERENCE", "by a morph target that doesn't show"),
    ("MESH_PRIMITIVE_POSITION_ACCESSOR_WITHOUT_BOUNDS", "bounds are measured, not read"),
    ("MESH_PRIMITIVE_JOINTS_WEIGHTS_MISMATCH", "of a mesh without a skin"),
    ("ACCESSOR_INDEX_PRIMITIVE_RESTART", "the index is that of a vertex, which is there"),
];

/// The validator's own files that violate a mesh rule show nothing; with all their meshes in a scene, each is refused or gives a
/// warning, except for the errors listed above.
#[test]
fn validator_errors_are_detected() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut refused, mut warned, mut silent) = (0, 0, Vec::new());
    let files = shared("data/gltf-validator", "gltf");
    for path in &files {
        let report = std::fs::read_to_string(format!("{}.report.json", path.display())).expect("a report");
        let report: Value = serde_json::from_str(&report).expect("a report in JSON");
        let Some(Value::Array(messages)) = report.pointer("/issues/messages") else { continue };
        let errors: Vec<&str> =
            messages.iter().filter(|m| m["severity"] == 0).filter_map(|m| m["code"].as_str()).collect();
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let Ok(mut asset) = serde_json::from_str::<Value>(&text) else { continue };
        let meshes = asset["meshes"].as_array().map_or(0, Vec::len);
        if errors.is_empty() || meshes == 0 || !asset["nodes"].is_null() || !asset["scenes"].is_null() {
            continue;
        }
        asset["nodes"] = (0..meshes).map(|mesh| json!({"mesh": mesh})).collect();
        asset["scenes"] = json!([{"nodes": (0..meshes).collect::<Vec<_>>()}]);
        asset["scene"] = json!(0);
        for beside in std::fs::read_dir(path.parent().expect("a folder")).expect("its files") {
            let beside = beside.expect("an entry").path();
            if beside.is_file() {
                std::fs::copy(&beside, folder.path().join(beside.file_name().expect("a name")))
                    .expect("copied");
            }
        }
        let shown = folder.path().join("shown.gltf");
        std::fs::write(&shown, asset.to_string()).expect("written");
        match load(&shown, &LoadOptions::default()) {
            Err(_) => refused += 1,
            // Messages about the whole picture have no location.
            Ok(loaded) if loaded.warnings.iter().any(|w| w.file.is_some()) => warned += 1,
            Ok(_) => silent.push((path.file_name().expect("a name").to_owned(), errors[0].to_string())),
        }
    }
    println!("{refused} refused, {warned} warned about, {} passed over", silent.len());
    let wrong: Vec<_> =
        silent.iter().filter(|(_, code)| !NOT_OURS.iter().any(|(known, _)| known == code)).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
    let stale: Vec<_> =
        NOT_OURS.iter().filter(|(known, _)| !silent.iter().any(|(_, code)| code == known)).collect();
    assert!(files.is_empty() || stale.is_empty(), "noticed now, and to be taken off the list: {stale:#?}");
    assert!(files.is_empty() || refused + warned >= 12, "{refused} {warned}");
}
