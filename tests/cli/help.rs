//! `new`, `help`, completions and manual pages.

use crate::program::*;
use std::fs;

#[test]
fn new_scenes_render_without_warnings_and_overwrite_nothing() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &["new", "mine.toml"], 0);
    let text = fs::read_to_string(folder.path().join("mine.toml")).unwrap();
    assert!(text.contains("oscura render mine.toml"), "{text}");
    let args = ["render", "mine.toml", "-o", "mine.png", "--width", "48", "--spp", "2", "--strict"];
    run(folder.path(), &args, 0);

    fs::write(folder.path().join("mine.toml"), "precious").unwrap();
    says(&run(folder.path(), &["new", "mine.toml"], 2), "--force");
    assert_eq!(fs::read_to_string(folder.path().join("mine.toml")).unwrap(), "precious");
    run(folder.path(), &["new", "mine.toml", "--force", "--quiet"], 0);
    assert!(fs::read_to_string(folder.path().join("mine.toml")).unwrap().contains("[camera]"));
    run(folder.path(), &["new", "mine.json"], 2);
}

#[test]
fn help_explains_commands_and_scene_files() {
    let folder = tempfile::tempdir().unwrap();
    for (topic, words) in [
        (&[][..], &["render", "scene-file", "materials"][..]),
        (&["render"], &["--spp", "--time-limit"]),
        (&["scene-file"], &["look_from", "dielectric", "quaternion", "samples"]),
        (&["materials"], &["lambert", "fuzz"]),
        (&["camera"], &["defocus_angle"]),
    ] {
        let output = run(folder.path(), &[&["help"], topic].concat(), 0);
        for word in words {
            assert!(stdout(&output).contains(word), "{topic:?}: '{word}' isn't in: {}", stdout(&output));
        }
        assert!(!stdout(&output).contains('\u{1b}'), "{topic:?} has colours");
    }
    says(&run(folder.path(), &["help", "nonsense"], 2), "materials");
}

#[test]
fn completions_and_man_pages_list_the_options() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let output = run(folder.path(), &["completions", shell], 0);
        assert!(stdout(&output).contains("time-limit"), "{shell}");
    }
    for (args, word) in [(&["man"][..], "render"), (&["man", "render"], "time\\-limit")] {
        let output = run(folder.path(), args, 0);
        assert!(stdout(&output).contains(".TH") && stdout(&output).contains(word), "{args:?}");
    }
    run(folder.path(), &["man", "paint"], 2);
    run(folder.path(), &["completions", "cmd"], 2);
}
