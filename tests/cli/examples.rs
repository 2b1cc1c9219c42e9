//! Every program of `examples/` runs and writes its picture.

use crate::skip::skip;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Cargo's folder of examples: next to that of test programs. `None` where only this test was built.
fn program(name: &str) -> Option<PathBuf> {
    let own = std::env::current_exe().expect("the test has a file");
    let profile = own.parent().and_then(Path::parent).expect("the folder of a profile");
    let path = profile.join("examples").join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
    if !path.is_file() {
        skip("examples", &format!("{} is not built; a plain `cargo test` builds it", path.display()));
        return None;
    }
    Some(path)
}

/// Runs an example in the README's folder; returns its output.
fn run(name: &str, args: &[&str]) -> Option<String> {
    let output = Command::new(program(name)?).args(args).current_dir(ROOT).output().expect("it starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !errors.contains("warning"), "{name}: {errors}");
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Width, height and the largest value of a PNG.
fn png(path: &Path) -> ([u32; 2], u8) {
    let image = image::open(path).expect("a picture").into_rgb8();
    (image.dimensions().into(), image.pixels().flat_map(|p| p.0).max().unwrap_or(0))
}

#[test]
fn render_writes_an_exr_with_passes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let picture = folder.path().join("a.exr");
    let args = ["assets/cornell-box.gltf", picture.to_str().expect("a plain name")];
    let Some(_) = run("render", &args) else { return };
    let image = exr::prelude::read_first_flat_layer_from_file(&picture).expect("an EXR");
    let names: Vec<String> = image.layer_data.channel_data.list.iter().map(|c| c.name.to_string()).collect();
    for name in ["R", "G", "B", "Z", "N.X"] {
        assert!(names.iter().any(|n| n == name), "{name} is not among {names:?}");
    }
}

#[test]
fn build_scene_shows_a_scene() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let picture = folder.path().join("a.png");
    let Some(_) = run("build_scene", &[picture.to_str().expect("a plain name")]) else { return };
    let (size, largest) = png(&picture);
    assert_eq!(size, [240, 160]);
    assert_eq!(largest, 255, "the lamp is in the picture");
}

#[test]
fn progressive_saves_after_each_pass() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let picture = folder.path().join("a.png");
    let Some(messages) = run("progressive", &[picture.to_str().expect("a plain name")]) else { return };
    assert!(messages.contains("has 8 samples") && messages.contains("has 40 samples"), "{messages}");
    assert_eq!(png(&picture).0, [128, 128]);
}

#[test]
fn read_pixels_finds_the_depth() {
    let Some(messages) = run("read_pixels", &[]) else { return };
    assert!(messages.contains("plane Z") && messages.contains("nearest point"), "{messages}");
}

#[test]
fn every_example_has_a_test() {
    let tests = include_str!("examples.rs");
    for entry in fs::read_dir(Path::new(ROOT).join("examples")).expect("examples") {
        let path = entry.expect("an entry").path();
        let name = path.file_stem().expect("a name").to_string_lossy();
        assert!(tests.contains(&format!("run(\"{name}\"")), "{name} is not run");
    }
}
