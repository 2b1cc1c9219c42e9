//! The scenes of `scenes/showcase`, each with a script that builds or fetches its meshes.

use crate::program::{pixels, run};
use crate::skip::skip;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Scenes whose scripts fetch scans.
const FETCHED: [&str; 2] = ["portrait", "statue"];

fn showcase() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/showcase")
}

/// The folders of the scenes by name.
fn scenes() -> Vec<String> {
    let entries = fs::read_dir(showcase()).expect("the folder").map(|entry| entry.expect("an entry").path());
    let folders = entries.filter(|path| path.join("scene.toml").is_file());
    let mut names: Vec<String> =
        folders.map(|path| path.file_name().expect("a name").to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// A scene of a fresh clone: without generated files.
fn fresh(folder: &Path, name: &str) -> PathBuf {
    let copy = folder.join(name);
    fs::create_dir_all(&copy).expect("made");
    for file in ["scene.toml", "build.py"] {
        fs::copy(showcase().join(name).join(file), copy.join(file)).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
    fs::copy(showcase().join("shapes.py"), folder.join("shapes.py")).expect("copied");
    copy
}

#[test]
fn generated_scenes_render() {
    if Command::new("python3").arg("--version").output().is_err() {
        skip("python3", "no Python builds the scenes");
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let names = scenes();
    assert!(names.len() >= 6 && FETCHED.iter().all(|name| names.contains(&name.to_string())), "{names:?}");
    for name in names.iter().filter(|name| !FETCHED.contains(&name.as_str())) {
        let copy = fresh(folder.path(), name);
        let built = Command::new("python3").arg(copy.join("build.py")).output().expect("it starts");
        assert!(built.status.success(), "{name}: {}", String::from_utf8_lossy(&built.stderr));
        let arguments =
            ["scene.toml", "--strict", "--size", "32x20", "--spp", "8", "--no-denoise", "-o", "a.exr"];
        run(&copy, &arguments, 0);
        let pixels = pixels(&copy.join("a.exr"));
        let lit = pixels.iter().filter(|pixel| pixel.iter().any(|value| *value > 1e-3)).count();
        assert!(4 * lit > pixels.len(), "{name}: only {lit} of {} pixels are lit", pixels.len());
    }
}
