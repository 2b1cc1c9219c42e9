//! The book: all pages of the guide are in it, links are valid, and mdbook builds it where installed.

#[path = "../../../tests/common/skip.rs"]
mod skip;

use skip::skip;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

fn write(name: &str, more: &[&str]) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    let output = Command::new(env!("CARGO_BIN_EXE_oscura-site")).arg(&folder).args(more).output();
    let output = output.expect("the program starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    folder
}

/// All pages, by path in the book.
fn pages(source: &Path) -> Vec<(PathBuf, String)> {
    let folders = [source.to_path_buf(), source.join("reference")];
    let files =
        folders.iter().flat_map(|f| fs::read_dir(f).expect("a folder")).map(|e| e.expect("a file").path());
    let pages = files.filter(|p| p.extension().is_some_and(|e| e == "md"));
    pages.map(|p| (p.clone(), fs::read_to_string(p).expect("a page"))).collect()
}

#[test]
fn all_pages_exist_and_links_are_valid() {
    let source = write("book", &[]).join("src");
    let summary = fs::read_to_string(source.join("SUMMARY.md")).expect("a table of contents");
    for entry in fs::read_dir(Path::new(ROOT).join("src/guide")).expect("the guide") {
        let name = entry.expect("a file").file_name().into_string().expect("a plain name");
        assert!(name == "mod.rs" || summary.contains(&format!("]({name})")), "{name} is no page");
    }
    let mut links = 0;
    for (path, text) in pages(&source) {
        let outside: String = text.split("```").step_by(2).collect();
        for (at, _) in outside.match_indices("](") {
            let target = outside[at + 2..].split(')').next().unwrap_or("");
            if !target.contains("://") {
                let file = path.parent().expect("a folder").join(target.split('#').next().unwrap_or(""));
                assert!(file.is_file(), "{} links to {target}", path.display());
                links += 1;
            }
        }
    }
    assert!(links > 60, "only {links} links");
}

#[test]
fn reference_matches_the_program() {
    let source = write("reference", &[]).join("src/reference");
    let names: BTreeSet<_> =
        fs::read_dir(&source).expect("pages").map(|e| e.expect("a page").file_name()).collect();
    assert!(names.len() >= 13, "{names:?}");
    let camera = fs::read_to_string(source.join("camera.md")).expect("a page");
    assert!(camera.contains("| `look_from`, `look_at` |"), "{camera}");
}

#[test]
fn files_outside_of_the_book_are_named_or_linked() {
    let read = |name: &str, more: &[&str]| {
        fs::read_to_string(write(name, more).join("src/README.md")).expect("a page")
    };
    assert!(read("named", &[]).contains("(`examples/render.rs`)"));
    assert!(
        read("linked", &["--repository", "https://a.example/b/"])
            .contains("](https://a.example/b/examples/render.rs)")
    );
}

#[test]
fn mdbook_builds_it() {
    if Command::new("mdbook").arg("--version").output().is_err() {
        return skip("mdbook", "mdbook is not installed");
    }
    let folder = write("built", &[]);
    let output = Command::new("mdbook").arg("build").arg(&folder).output().expect("mdbook starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for page in ["index.html", "first_picture.html", "reference/camera.html", "pictures/wave.svg"] {
        assert!(folder.join("book").join(page).is_file(), "{page}");
    }
}
