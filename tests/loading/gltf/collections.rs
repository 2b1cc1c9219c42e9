//! Third-party file collections outside the repository; without them these tests are skipped.
// Tests of optional decoders use some of this.
#![cfg_attr(not(feature = "decoders"), allow(unused_imports, dead_code))]

use super::asset::{load_with, open, triangle_bytes, triangle_with};
use crate::skip::skip;
use oscura::color::linear_from_srgb;
use oscura::error::Error;
use oscura::load::Loaded;
use oscura::math::DVec3;
use serde_json::json;
use std::path::{Path, PathBuf};

fn everything(inside: &str) -> Vec<PathBuf> {
    let shared = std::env::var_os("OSCURA_SHARED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    let folder = shared.join("data").join(inside);
    if !folder.is_dir() {
        skip("shared", &format!("{} is absent", folder.display()));
        return Vec::new();
    }
    let mut files = Vec::new();
    collect(&folder, &mut files);
    files.sort();
    files
}

/// The files of a collection with an extension.
fn files_of(inside: &str, extension: &str) -> Vec<PathBuf> {
    let mut files = everything(inside);
    files.retain(|path| path.extension().is_some_and(|e| e == extension));
    files
}

fn collection(inside: &str) -> Vec<PathBuf> {
    [files_of(inside, "gltf"), files_of(inside, "glb")].concat()
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("the folder can be read") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            collect(&path, files);
        } else {
            files.push(path);
        }
    }
}

/// Loads, or gives an error that names the file and at least one problem.
fn loads_or_explains(path: &Path) -> Result<Loaded, Error> {
    let result = open(path);
    if let Err(error) = &result {
        assert_eq!(error.file.as_deref(), Some(path));
        assert!(!error.problems.is_empty(), "{}", path.display());
        assert!(error.problems.iter().all(|p| !p.message.is_empty()), "{error}");
    }
    result
}

/// Each file of the validator has its expected report next to it.
#[test]
fn files_without_errors_load() {
    let files = collection("gltf-validator");
    let (mut loaded, mut refused, mut failures) = (0, 0, Vec::new());
    for path in &files {
        let report = std::fs::read_to_string(format!("{}.report.json", path.display())).expect("a report");
        let report: serde_json::Value = serde_json::from_str(&report).expect("a report in JSON");
        let is_valid = report.pointer("/issues/numErrors").and_then(|n| n.as_u64()) == Some(0);
        match loads_or_explains(path) {
            Ok(_) => loaded += usize::from(is_valid),
            Err(error) if is_valid => failures.push(error.to_string()),
            Err(_) => refused += 1,
        }
    }
    println!("{loaded} valid files load, {refused} others are refused");
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(files.is_empty() || loaded > 30 && refused > 10);
}

#[test]
fn damaged_files_are_refused_or_load() {
    for path in collection("broken/gltf") {
        match loads_or_explains(&path) {
            Ok(loaded) => println!("{} loads, {:?}", path.display(), loaded.warnings),
            Err(error) => println!("{error}"),
        }
    }
}

#[test]
fn real_files_load() {
    for folder in ["asset-generator", "blender", "models"] {
        for path in collection(folder) {
            let loaded = loads_or_explains(&path).unwrap_or_else(|e| panic!("{e}"));
            assert!(loaded.scene.validate().is_empty());
        }
    }
}

/// Draco, meshopt, quantised and sparse meshes: all load, and the same box has the same bounds in any encoding.
#[cfg(feature = "decoders")]
#[test]
fn compressed_files_load() {
    for path in collection("extensions") {
        let scene = loads_or_explains(&path).unwrap_or_else(|e| panic!("{e}")).scene;
        assert!(scene.meshes.iter().any(|m| !m.triangles.is_empty()), "{}", path.display());
        if path.file_name().is_some_and(|n| n.to_string_lossy().starts_with("Box")) {
            assert_eq!(scene.meshes[0].triangles.len(), 12);
            let instance = &scene.instances[0];
            for p in &scene.meshes[0].positions {
                let world = instance.world_from_object.transform_point3(DVec3::from_array(p.map(f64::from)));
                assert!((world.abs() - 0.5).abs().max_element() < 1e-3, "{}: {world}", path.display());
            }
        }
    }
}

/// White text on a uniform colour: brown as ETC1S and as UASTC, green as uncompressed pixels.
#[cfg(feature = "ktx2")]
#[test]
fn basis_universal_files_decode() {
    for path in files_of("extensions", "ktx2") {
        let asset = triangle_with(|a| {
            a["materials"][0] = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}});
            a["textures"] = json!([{"source": 0}]);
            a["images"] = json!([{"uri": "a.ktx2"}]);
        });
        let bytes = std::fs::read(&path).expect("it can be read");
        let loaded = load_with(&asset, &[("a.bin", &triangle_bytes()), ("a.ktx2", &bytes)]);
        let scene = loaded.unwrap_or_else(|e| panic!("{}: {e}", path.display())).scene;
        let image = &scene.images[0];
        assert_eq!((image.width, image.height), (40, 40));
        let ground = if path.ends_with("2d_rgba8.ktx2") { [77u8, 175, 74] } else { [184, 150, 0] };
        let ground = ground.map(|c| linear_from_srgb(f32::from(c) / 255.0));
        let is_ground = |[r, g, b, _]: [f32; 4]| {
            [r, g, b].iter().zip(ground).all(|(found, expected)| (found - expected).abs() < 0.02)
        };
        // The lower part has no text; a third of the upper part has.
        let count = |rows: std::ops::Range<u32>, what: &dyn Fn([f32; 4]) -> bool| {
            rows.flat_map(|y| (0..40).map(move |x| (x, y))).filter(|&(x, y)| what(image.rgba(x, y))).count()
        };
        assert_eq!(count(25..40, &is_ground), 15 * 40, "{}", path.display());
        let words = count(0..25, &|p| p[0] > 0.8 && p[1] > 0.8);
        assert!((50..300).contains(&words), "{}: {words}", path.display());
    }
}

/// Each byte of the Basis Universal files changed: an error or some picture, in bounded time and memory.
#[cfg(feature = "ktx2")]
#[test]
fn damaged_basis_universal_files_never_panic() {
    let asset = triangle_with(|a| {
        a["materials"][0] = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}});
        a["textures"] = json!([{"source": 0}]);
        a["images"] = json!([{"uri": "a.ktx2"}]);
    });
    for path in files_of("extensions", "ktx2").iter().filter(|p| !p.ends_with("2d_rgba8.ktx2")) {
        let whole = std::fs::read(path).expect("it can be read");
        let mut refused = 0;
        for at in 12..whole.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 0xff;
            let loaded = load_with(&asset, &[("a.bin", &triangle_bytes()), ("a.ktx2", &bytes)]);
            refused += usize::from(loaded.is_ok_and(|loaded| loaded.scene.textures.is_empty()));
        }
        println!("{}: {refused} of {} changes lose it", path.display(), whole.len());
        assert!(refused > 20);
    }
}

#[test]
fn damaged_helmet_loads() {
    for path in collection("models").iter().filter(|p| p.ends_with("DamagedHelmet.glb")) {
        let scene = open(path).expect("it loads").scene;
        assert_eq!(scene.meshes[0].triangles.len(), 15_452);
        assert_eq!(scene.meshes[0].positions.len(), 14_556);
        assert!(scene.images.iter().all(|image| (image.width, image.height) == (2048, 2048)));
        // Base colour and emission are colours; metal-rough and normals are data; occlusion is not read.
        assert_eq!(scene.images.len(), 4);
    }
}
