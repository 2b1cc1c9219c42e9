//! The program several times in one process, as the Python package runs it.

use crate::program::*;
use std::ffi::OsString;

#[test]
fn a_second_command_line_is_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let render = |name: &str| {
        let file = folder.path().join(name).display().to_string();
        let scene = cornell();
        let words = [
            "oscura", "render", &scene, "-o", &file, "--width", "8", "--height", "8", "--spp", "1", "--quiet",
        ];
        oscura::cli::main(words.iter().map(OsString::from))
    };
    assert_eq!((render("a.png"), render("b.png")), (0, 0));
    assert_eq!(names(folder.path()), ["a.png", "b.png"]);
    assert_eq!(oscura::cli::main(["oscura", "render"].iter().map(OsString::from)), 2);
}
