//! Defaults: output names, sizes, standard output, and messages.

use crate::program::*;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Fast sizes.
const SMALL: [&str; 4] = ["--size", "16x12", "--spp", "2"];

fn triangle(folder: &Path, name: &str) {
    fs::create_dir_all(folder.join(name).parent().expect("a folder")).unwrap();
    fs::write(folder.join(name), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
}

fn size_of(path: &Path) -> (u32, u32) {
    let picture = image::open(path).expect("a picture");
    (picture.width(), picture.height())
}

#[test]
fn default_output_is_named_after_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    triangle(folder.path(), "models/a.obj");
    for words in [&["models/a.obj"][..], &["render", "models/a.obj"], &["--quiet", "models/a.obj"]] {
        let output = run(folder.path(), &[words, &SMALL].concat(), 0);
        assert_eq!(
            stderr(&output).contains("oscura view"),
            !words.contains(&"--quiet"),
            "{}",
            stderr(&output)
        );
        assert_eq!(names(folder.path()), ["a.png", "models"]);
        assert_eq!(size_of(&folder.path().join("a.png")), (16, 12));
    }
}

/// Quality presets set samples and denoising unless the user or the scene does.
#[test]
fn quality_presets() {
    let folder = tempfile::tempdir().unwrap();
    triangle(folder.path(), "a.obj");
    let scene = "[render]\nsamples = 3\n[materials]\ngrey = { type = \"lambert\", color = 0.5 }\n[[objects]]\nmesh = \"a.obj\"\nmaterial = \"grey\"\n[camera]\nlook_from = [0, 0, 3]\nlook_at = [0, 0, 0]\n";
    fs::write(folder.path().join("own.toml"), scene).unwrap();
    let rendered = |file: &str, more: &[&str]| {
        let small = ["-o", "a.exr", "--size", "24x16", "--json"];
        let output = run(folder.path(), &[&["render", file], &small[..], more].concat(), 0);
        let json = report(&output);
        let is_denoised = !json["denoise_s"].is_null();
        assert_eq!(stderr(&output).contains(", denoised, "), is_denoised, "{}", stderr(&output));
        (
            json["quality"].as_str().map(str::to_string),
            json["samples_per_pixel"].as_u64().unwrap(),
            is_denoised,
        )
    };
    let is = |word: &str| Some(word.to_string());
    assert_eq!(rendered("a.obj", &["--quality", "draft"]), (is("draft"), 8, true));
    let (quality, samples, is_denoised) = rendered("a.obj", &[]);
    assert!(quality == is("normal") && (16..=256).contains(&samples) && is_denoised, "{samples}");
    let (_, more, _) = rendered("a.obj", &["--quality", "high", "--max-spp", "512"]);
    assert!(samples < more && more <= 512, "{samples} {more}");
    assert_eq!(rendered("a.obj", &["--quality", "final", "--max-spp", "16"]), (is("final"), 16, false));
    let (quality, noisy, is_denoised) = rendered("a.obj", &["--no-denoise"]);
    assert!(quality == is("normal") && (samples..=256).contains(&noisy) && !is_denoised, "{samples} {noisy}");
    // Samples given by the user or the scene take precedence.
    assert_eq!(rendered("a.obj", &["--spp", "4"]), (None, 4, false));
    assert_eq!(rendered("a.obj", &["--time-limit", "1000"]), (None, 128, false));
    assert_eq!(rendered("own.toml", &[]), (None, 3, false));
    assert_eq!(rendered("own.toml", &["--quality", "draft"]), (is("draft"), 8, true));
    // Crops use the same number of samples, whatever they show.
    let part = ["render", "a.obj", "-o", "a.part", "--size", "24x16", "--sample-range", "0..8", "--json"];
    let output = oscura(folder.path(), &part);
    assert_eq!(
        (code(&output), &report(&output)["quality"]),
        (0, &serde_json::Value::Null),
        "{}",
        stderr(&output)
    );
    run(folder.path(), &["render", "a.obj", "--quality", "high", "--spp", "4"], 2);
}

#[test]
fn default_outputs_overwrite_only_their_own_kind() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    triangle(folder.path(), "a.obj");
    triangle(folder.path(), "other/a.obj");
    let run = |words: &[&str]| code(&oscura(folder.path(), &[words, &SMALL].concat()));
    assert_eq!(run(&["a.obj"]), 0);
    let first = fs::read(file("a.png")).unwrap();
    // Of another scene, and of another command.
    assert_eq!(run(&["other/a.obj"]), 2);
    let thumb = |more: &[&str]| {
        code(&oscura(folder.path(), &[&["thumb", "a.obj", "--size", "16", "--spp", "1"], more].concat()))
    };
    assert_eq!((thumb(&[]), thumb(&[])), (0, 0));
    assert_eq!(thumb(&["-o", "."]), 2);
    assert!(fs::read(file("a.png")).unwrap() == first);
    assert_eq!(names(folder.path()), ["a.obj", "a.png", "a.thumb.png", "other"]);
    // The same command again; an explicit name overwrites anything.
    assert_eq!(run(&["a.obj", "--seed", "7"]), 0);
    assert!(fs::read(file("a.png")).unwrap() != first);
    assert_eq!(run(&["other/a.obj", "-o", "a.png"]), 0);
    assert_eq!(run(&["a.obj"]), 2, "a picture of -o is not this command's");
    assert_eq!(thumb(&["-o", ".", "--force"]), 0);
    // A file that is no picture, and a texture that is missing.
    fs::write(file("b.png"), "precious").unwrap();
    triangle(folder.path(), "b.obj");
    assert_eq!((run(&["b.obj"]), fs::read_to_string(file("b.png")).unwrap()), (2, "precious".to_string()));
    fs::write(file("c.mtl"), "newmtl m\nmap_Kd c.png\n").unwrap();
    fs::write(file("c.obj"), "mtllib c.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    assert_eq!((run(&["c.obj"]), file("c.png").exists()), (2, false));
}

#[test]
fn writes_to_standard_output() {
    let folder = tempfile::tempdir().unwrap();
    triangle(folder.path(), "a.obj");
    for (target, start) in
        [("-", &b"\x89PNG"[..]), ("exr:-", b"\x76\x2f\x31\x01"), ("jpg:-", b"\xff\xd8\xff")]
    {
        let output = run(folder.path(), &[&["a.obj", "-o", target], &SMALL[..]].concat(), 0);
        assert!(output.stdout.starts_with(start), "{target}");
    }
    assert_eq!(names(folder.path()), ["a.obj"]);
}

#[test]
fn environment_none() {
    let folder = tempfile::tempdir().unwrap();
    let shoot = |env: &str| {
        let scene = cornell();
        let words = ["render", &scene, "-o", "a.png", "--env", env, "--size", "16x16", "--spp", "2"];
        run(folder.path(), &words, 0);
        fs::read(folder.path().join("a.png")).unwrap()
    };
    assert!(shoot("none") == shoot(""));
}

/// One line at the end, details with `-v`, nothing with `-q`.
#[test]
fn verbosity_levels() {
    let folder = tempfile::tempdir().unwrap();
    let lines = |more: &[&str]| {
        let output = render(folder.path(), "a.exr", more);
        stderr(&output).lines().map(str::to_string).collect::<Vec<_>>()
    };
    let usual = lines(&[]);
    assert_eq!(usual.len(), 1, "{usual:?}");
    assert!(usual[0].contains("a.exr") && usual[0].contains("48x"), "{usual:?}");
    let details = lines(&["-v"]);
    assert!(details.len() >= 4 && details.iter().any(|line| line.contains("triangles")), "{details:?}");
    assert!(lines(&["-q"]).is_empty());
    // One line per frame.
    let words = ["render", &cornell(), "-o", "f.png", "--frames", "1-3", "--size", "16x16", "--spp", "1"];
    let output = oscura(folder.path(), &words);
    let messages = stderr(&output);
    let frames: Vec<&str> = messages.lines().filter(|line| line.starts_with("frame ")).collect();
    assert!(
        frames.len() == 3 && frames[2].contains("f.0003.png") && messages.lines().count() <= 4,
        "{messages}"
    );
}

/// Scans without lights and cameras are valid, with and without an environment.
#[test]
fn a_scan_with_an_environment_passes_strict() {
    let folder = tempfile::tempdir().unwrap();
    triangle(folder.path(), "a.obj");
    let rgb = |_, _| (1.0f32, 1.0f32, 1.0f32);
    exr::prelude::write_rgb_file(folder.path().join("env.exr"), 8, 4, rgb).unwrap();
    for more in [&[][..], &["--env", "env.exr"], &["--env", "none"]] {
        says(
            &run(folder.path(), &[&["a.obj", "-o", "a.png", "--strict"], &SMALL[..], more].concat(), 0),
            "note: no camera",
        );
    }
}

#[test]
fn help_finds_plurals_options_and_typos() {
    let folder = tempfile::tempdir().unwrap();
    for (topic, word) in [
        ("lenses", "look_from"),
        ("noise", "--noise"),
        ("denoising", "--denoise"),
        ("AOVs", "--aov"),
        ("--env", "--env"),
        ("resolution", "--size"),
        ("matirials", "lambert"),
        ("caustics", "--caustics"),
    ] {
        let output = run(folder.path(), &["help", topic], 0);
        assert!(stdout(&output).contains(word), "{topic}: {}", stdout(&output));
    }
    run(folder.path(), &["help", "xyzzy"], 2);
}

/// Every scene of the project renders from the files that are in the repository.
#[test]
fn scenes_render_in_a_fresh_clone() {
    let (root, folder) = (Path::new(env!("CARGO_MANIFEST_DIR")), tempfile::tempdir().unwrap());
    let listed = Command::new("git").args(["ls-files", "-z", "scenes"]).current_dir(root).output();
    let Some(listed) = listed.ok().filter(|output| output.status.success() && !output.stdout.is_empty())
    else {
        return crate::skip::skip("git", "there is no git, or this is not a clone");
    };
    let files = String::from_utf8(listed.stdout).expect("UTF-8");
    let files: Vec<&str> = files.split('\0').filter(|file| !file.is_empty()).collect();
    for file in &files {
        let target = folder.path().join(file);
        fs::create_dir_all(target.parent().expect("a folder")).unwrap();
        fs::copy(root.join(file), target).unwrap();
    }
    // Showcase scenes need their scripts, and have their own test.
    let is_scene = |file: &&&str| file.ends_with(".toml") && !file.starts_with("scenes/showcase/");
    let scenes: Vec<&&str> = files.iter().filter(is_scene).collect();
    assert!(scenes.len() >= 40, "{}", scenes.len());
    for scene in scenes {
        let words =
            ["render", scene, "-o", "a.png", "--size", "16x16", "--spp", "1", "--depth", "4", "--strict"];
        run(folder.path(), &words, 0);
    }
}
