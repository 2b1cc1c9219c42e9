//! Collections of files by others, which lie outside the repository; without them these tests say so and pass.

use crate::asset::open;
use oscura::error::Error;
use oscura::load::Loaded;
use std::path::{Path, PathBuf};

fn collection(inside: &str) -> Vec<PathBuf> {
    let shared = std::env::var_os("OSCURA_SHARED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    let folder = shared.join("data").join(inside);
    if !folder.is_dir() {
        println!("skipped: {} is absent", folder.display());
        return Vec::new();
    }
    let mut files = Vec::new();
    collect(&folder, &mut files);
    files.sort();
    assert!(!files.is_empty());
    files
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("the folder can be read") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|e| e == "gltf" || e == "glb") {
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

/// Each file of the validator has its expected report beside it.
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

/// Compressed files are refused by the name of the extension, unless they hold plain data as well.
#[test]
fn what_is_not_supported_is_named() {
    for path in collection("extensions") {
        if let Err(error) = loads_or_explains(&path) {
            let text = error.to_string();
            assert!(text.contains("KHR_") || text.contains("EXT_"), "{text}");
        }
    }
}

#[test]
fn a_helmet_with_its_textures() {
    for path in collection("models").iter().filter(|p| p.ends_with("DamagedHelmet.glb")) {
        let scene = open(path).expect("it loads").scene;
        assert_eq!(scene.meshes[0].triangles.len(), 15_452);
        assert_eq!(scene.meshes[0].positions.len(), 14_556);
        assert!(scene.images.iter().all(|image| (image.width, image.height) == (2048, 2048)));
        // Base colour and emission are colours; metal-rough and normals are data; occlusion is not read.
        assert_eq!(scene.images.len(), 4);
    }
}
