//! `new`, `help`, completions and manual pages.

use crate::program::*;
use std::fs;

#[test]
fn a_new_scene_renders_without_a_warning_and_nothing_is_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let made = oscura(folder.path(), &["new", "mine.toml"]);
    assert_eq!(code(&made), 0, "{}", stderr(&made));
    let text = fs::read_to_string(folder.path().join("mine.toml")).unwrap();
    assert!(text.contains("oscura render mine.toml"), "{text}");
    let args = ["render", "mine.toml", "-o", "mine.png", "--width", "48", "--spp", "2", "--strict"];
    let output = oscura(folder.path(), &args);
    assert_eq!(code(&output), 0, "{}", stderr(&output));

    fs::write(folder.path().join("mine.toml"), "precious").unwrap();
    let refused = oscura(folder.path(), &["new", "mine.toml"]);
    assert_eq!(code(&refused), 2);
    assert!(stderr(&refused).contains("--force"), "{}", stderr(&refused));
    assert_eq!(fs::read_to_string(folder.path().join("mine.toml")).unwrap(), "precious");
    assert_eq!(code(&oscura(folder.path(), &["new", "mine.toml", "--force", "--quiet"])), 0);
    assert!(fs::read_to_string(folder.path().join("mine.toml")).unwrap().contains("[camera]"));
    assert_eq!(code(&oscura(folder.path(), &["new", "mine.json"])), 2);
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
        let output = oscura(folder.path(), &[&["help"], topic].concat());
        assert_eq!(code(&output), 0, "{topic:?}: {}", stderr(&output));
        for word in words {
            assert!(stdout(&output).contains(word), "{topic:?}: '{word}' isn't in: {}", stdout(&output));
        }
        assert!(!stdout(&output).contains('\u{1b}'), "{topic:?} has colours");
    }
    let unknown = oscura(folder.path(), &["help", "nonsense"]);
    assert_eq!(code(&unknown), 2);
    assert!(stderr(&unknown).contains("materials"), "{}", stderr(&unknown));
}

#[test]
fn completions_and_manual_pages_name_the_options() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let output = oscura(folder.path(), &["completions", shell]);
        assert_eq!(code(&output), 0, "{shell}: {}", stderr(&output));
        assert!(stdout(&output).contains("time-limit"), "{shell}");
    }
    for (args, word) in [(&["man"][..], "render"), (&["man", "render"], "time\\-limit")] {
        let output = oscura(folder.path(), args);
        assert_eq!(code(&output), 0, "{args:?}: {}", stderr(&output));
        assert!(stdout(&output).contains(".TH") && stdout(&output).contains(word), "{args:?}");
    }
    assert_eq!(code(&oscura(folder.path(), &["man", "paint"])), 2);
    assert_eq!(code(&oscura(folder.path(), &["completions", "cmd"])), 2);
}
