//! Denoising of merged parts and of files.

use crate::program::*;
use std::path::Path;

const SMALL: &str = "--width 48 --spp 16 --quiet --reproducible";

/// Merged parts of a denoised render match it bit by bit; others are denoised on demand.
#[test]
fn merged_parts_are_denoised() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, scene) = (folder.path(), cornell());
    let fixed =
        format!("render {scene} {SMALL} --aov normal,diffuse_direct --path-reuse off --splitting off");
    run_line(folder, &format!("{fixed} --denoise -o whole.exr"));
    for (range, part) in [("0..8", "a"), ("8..16", "b")] {
        run_line(folder, &format!("{fixed} --denoise --sample-range {range} -o {part}.part"));
        run_line(folder, &format!("{fixed} --sample-range {range} -o plain-{part}.part"));
    }
    run_line(folder, "merge b.part a.part -o merged.exr --quiet");
    let at = |name: &str| folder.join(name);
    assert_eq!(planes(&at("merged.exr")), planes(&at("whole.exr")));
    let says = attribute(&at("merged.exr"), "denoised");
    let expected = format!("oscura {}; guides albedo, normal", env!("CARGO_PKG_VERSION"));
    assert_eq!((&says, &attribute(&at("whole.exr"), "denoised")), (&text(&expected), &says));

    run_line(folder, "merge a.part b.part -o plain.exr --quiet --no-denoise");
    run_line(folder, &format!("{fixed} -o noisy.exr"));
    assert_eq!(planes(&at("plain.exr"))["G"], planes(&at("noisy.exr"))["G"]);
    run_line(folder, "merge plain-a.part plain-b.part -o noisy.exr --quiet");
    run_line(folder, "merge plain-a.part plain-b.part -o clean.exr --denoise --quiet");
    let (noisy, clean) = (planes(&at("noisy.exr")), planes(&at("clean.exr")));
    assert!(noisy["N.X"] == clean["N.X"] && noisy["A"] == clean["A"]);
    assert!(noisy["G"] != clean["G"] && noisy["DiffDir.G"] != clean["DiffDir.G"]);
    let says = attribute(&at("clean.exr"), "denoised");
    assert_eq!(says, text(&expected.replace("albedo, normal", "none")));
    assert_eq!(attribute(&at("noisy.exr"), "denoised"), None);
}

#[test]
fn metadata_names_the_denoiser() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, scene) = (folder.path(), cornell());
    run_line(folder, &format!("render {scene} {SMALL} -o a.exr --exr-layout multipart --aov albedo"));
    run_line(folder, "denoise a.exr -o b.exr --quiet");
    let info = report(&oscura(folder, &["info", "b.exr", "--json"]));
    let parts = info["parts"].as_array().expect("parts");
    assert_eq!(parts.len(), 2);
    for part in parts {
        let says = part["header"]["denoised"].as_str().expect("the attribute");
        assert!(says.contains("guides albedo;"), "{says}");
    }
}

/// Deprecated options of a library are accepted.
#[test]
fn deprecated_library_options_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, scene) = (folder.path(), cornell());
    let small = SMALL.replace("--quiet", "");
    run_line(folder, &format!("render {scene} {small} --denoise -o a.exr"));
    let messages = run_line(
        folder,
        &format!("render {scene} {small} --denoise --denoiser oidn --oidn-library none.so -o b.exr"),
    );
    assert!(messages.contains("--denoiser"), "{messages}");
    assert_eq!(planes(&folder.join("a.exr")), planes(&folder.join("b.exr")));
    let messages = run_line(folder, "denoise a.exr -o c.exr --denoiser oidn");
    assert!(messages.contains("--denoiser"), "{messages}");
}

/// A sphere seen by a moving camera.
fn moving_scene(folder: &Path) {
    std::fs::write(
        folder.join("scene.toml"),
        "[camera]\nlook_from = [0, 1, 4]\nlook_at = [0, 0, 0]\nvfov = 40\nmotion = { translate = [0.01, 0, 0] }\n\
         [environment]\nsky = { nadir = 0.2, zenith = [0.5, 0.7, 1] }\n\
         [materials]\nclay = { type = \"lambert\", color = [0.7, 0.4, 0.3] }\n\
         [[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"clay\"\n",
    )
    .unwrap();
}

/// Temporal denoising of sequences; the range of frames that a command denoises changes none of them.
#[test]
fn sequences_are_denoised_temporally() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    moving_scene(folder);
    let layers = "--aov denoising_albedo,denoising_normal,variance,motion";
    let render = |name: &str, more: &str| {
        run_line(
            folder,
            &format!(
                "render scene.toml -o {name}.##.exr --frames 1-4 --width 40 --spp 4 --quiet --reproducible {more}"
            ),
        );
    };
    render("noisy", &format!("--animate-seed {layers}"));
    render("same", layers);
    let at = |name: &str| folder.join(name);
    assert_eq!(attribute(&at("noisy.01.exr"), "worldToNDC"), attribute(&at("same.01.exr"), "worldToNDC"));
    assert_ne!(planes(&at("noisy.01.exr"))["R"], planes(&at("same.01.exr"))["R"]);
    run_line(folder, "denoise noisy.##.exr -o clean.##.exr --quiet");
    run_line(folder, "denoise noisy.##.exr -o part.##.exr --frames 3 --quiet");
    run_line(folder, "denoise noisy.03.exr -o alone.exr --quiet");
    assert!(at("clean.01.exr").exists() && at("clean.04.exr").exists() && !at("part.02.exr").exists());
    let (clean, part, alone) =
        (planes(&at("clean.03.exr")), planes(&at("part.03.exr")), planes(&at("alone.exr")));
    assert_eq!(clean, part);
    assert!(clean["R"] != alone["R"] && clean["A"] == alone["A"] && clean["Vector.X"] == alone["Vector.X"]);

    run_line(folder, "convert clean.##.exr -o shown.##.png --quiet");
    run_line(folder, "convert clean.##.exr -o shown.apng --fps 12 --quiet");
    run_line(folder, "convert clean.03.exr -o alone.png --quiet");
    let bytes = |name: &str| std::fs::read(at(name)).unwrap();
    assert_eq!(bytes("shown.03.png"), bytes("alone.png"));
    assert!(bytes("shown.apng").windows(4).filter(|word| word == b"fcTL").count() == 4);

    render("plain", "");
    let output = oscura(folder, &["denoise", "plain.##.exr", "-o", "x.##.exr"]);
    assert!(code(&output) == 3 && stderr(&output).contains("--aov"), "{}", stderr(&output));
    for (line, expected) in [
        ("denoise noisy.##.exr -o one.exr", "####"),
        ("denoise noisy.##.exr -o noisy.##.exr", "another name"),
        ("denoise noisy.01.exr -o one.exr --frames 1-2", "one picture"),
        ("denoise gone.##.exr -o x.##.exr", "no such frames"),
        ("convert clean.##.exr -o one.png", "####"),
        ("convert clean.01.exr -o one.gif", "####"),
    ] {
        let output = oscura(folder, &line.split(' ').collect::<Vec<_>>());
        assert!(code(&output) != 0 && stderr(&output).contains(expected), "{line}: {}", stderr(&output));
    }
}

/// Renders denoise temporally as `oscura denoise` does files; existing frames don't change missing ones.
#[test]
fn rendered_frames_are_denoised_temporally() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    moving_scene(folder);
    let fixed = "render scene.toml --frames 1-6 --width 40 --spp 4 --quiet --reproducible --animate-seed --float \
                 --exr-float DiffDir,DiffInd";
    let guides = "denoising_albedo,denoising_normal,variance,motion,diffuse_direct,diffuse_indirect";
    run_line(folder, &format!("{fixed} -o noisy.##.exr --path-reuse off --aov {guides}"));
    run_line(folder, "denoise noisy.##.exr -o files.##.exr --quiet");
    let direct = format!("{fixed} --denoise --aov diffuse_direct,diffuse_indirect");
    run_line(folder, &format!("{direct} -o direct.##.exr"));
    let at = |name: &str| folder.join(name);
    let shown = |name: &str| {
        let mut planes = planes(&at(name));
        planes.retain(|channel, _| {
            !["Vector", "variance", "denoising"].iter().any(|of| channel.starts_with(of))
        });
        planes
    };
    for number in 1..=6 {
        let (file, render) =
            (shown(&format!("files.0{number}.exr")), shown(&format!("direct.0{number}.exr")));
        assert_eq!(render, planes(&at(&format!("direct.0{number}.exr"))), "nothing but what was asked for");
        assert!(file == render, "frame {number}");
    }
    let says = attribute(&at("direct.03.exr"), "denoised").expect("the attribute");
    let says = format!("{says:?}");
    assert!(says.contains("frames 1-5"), "{says}");
    // One is rendered again, with existing neighbours.
    let before = std::fs::read(at("direct.03.exr")).unwrap();
    let other = std::fs::metadata(at("direct.02.exr")).unwrap().modified().unwrap();
    std::fs::remove_file(at("direct.03.exr")).unwrap();
    run_line(folder, &format!("{direct} -o direct.##.exr --resume"));
    assert!(std::fs::read(at("direct.03.exr")).unwrap() == before);
    assert_eq!(std::fs::metadata(at("direct.02.exr")).unwrap().modified().unwrap(), other);
    // Each frame alone equals a render of that frame alone.
    run_line(folder, &format!("{direct} --denoise-alone -o alone.##.exr"));
    run_line(folder, &format!("{direct} -o one.##.exr").replace("1-6", "3-3"));
    assert!(planes(&at("alone.03.exr")) == planes(&at("one.03.exr")));
    assert!(planes(&at("alone.03.exr"))["R"] != planes(&at("direct.03.exr"))["R"]);
}

/// Turntables are denoised temporally as well, and videos consist of denoised frames.
#[test]
fn videos_are_denoised() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    moving_scene(folder);
    let fixed = "render scene.toml --orbit 4 --width 40 --spp 2 --quiet --reproducible --animate-seed";
    run_line(folder, &format!("{fixed} --denoise -o clean.apng -o clean.#.png"));
    run_line(folder, &format!("{fixed} --denoise -o only.apng"));
    run_line(folder, &format!("{fixed} -o noisy.apng"));
    let bytes = |name: &str| std::fs::read(folder.join(name)).unwrap();
    assert!(bytes("clean.apng") == bytes("only.apng") && bytes("only.apng") != bytes("noisy.apng"));
    run_line(folder, &format!("{fixed} --denoise --denoise-alone -o alone.#.png"));
    assert!(bytes("clean.1.png") != bytes("alone.1.png"));
    // Denoising in the scene file is equivalent to the option.
    let scene = std::fs::read_to_string(folder.join("scene.toml")).unwrap();
    std::fs::write(folder.join("scene.toml"), format!("[render]\ndenoise = true\n{scene}")).unwrap();
    run_line(folder, &format!("{fixed} -o asked.#.png"));
    assert!(bytes("asked.1.png") == bytes("clean.1.png"));
}
