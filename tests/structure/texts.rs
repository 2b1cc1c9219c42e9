//! Text files of the whole repository.

use std::fs;
use std::path::{Path, PathBuf};

/// Files of text by the ends of their names.
const TEXTS: [&str; 6] = ["md", "py", "rs", "sh", "toml", "yml"];

fn collect(folder: &Path, paths: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder of the repository can be read") {
        let path = entry.expect("its entry").path();
        if path.is_dir() {
            let is_built = ["target", ".git"].iter().any(|name| path.ends_with(name));
            if !is_built {
                collect(&path, paths);
            }
        } else if path.extension().is_some_and(|e| TEXTS.iter().any(|text| e == *text)) {
            paths.push(path);
        }
    }
}

/// Conflict markers of git.
fn conflicts(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let is_mark = |line: &str| ["<<<<<<< ", ">>>>>>> "].iter().any(|mark| line.starts_with(mark));
    text.lines().enumerate().filter(move |(_, line)| is_mark(line) || *line == "=======")
}

#[test]
fn no_conflict_markers() {
    let mut paths = Vec::new();
    collect(Path::new(env!("CARGO_MANIFEST_DIR")), &mut paths);
    assert!(paths.iter().any(|path| path.ends_with("CHANGELOG.md")));
    for path in paths {
        let text = fs::read_to_string(&path).unwrap_or_default();
        if let Some((number, line)) = conflicts(&text).next() {
            panic!("{}:{}: {line}", path.display(), number + 1);
        }
    }
}

#[test]
fn conflict_markers_are_found() {
    let text = "a\n<<<<<<< ours\nb\n=======\nc\n>>>>>>> theirs\nx = \"<<<<<<< \"\n";
    let numbers: Vec<usize> = conflicts(text).map(|(number, _)| number).collect();
    assert_eq!(numbers, [1, 3, 5]);
}
