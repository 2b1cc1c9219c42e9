//! Outputs are never lost: existing files, checkpoints, failing outputs, and uneven sample counts in denoising.

use crate::program::*;
use std::fs;
use std::path::Path;

fn mean(path: &Path, channel: &str) -> f64 {
    let plane = planes(path).remove(channel).expect("a channel");
    plane.iter().map(|v| f64::from(*v)).sum::<f64>() / plane.len() as f64
}

/// Denoising keeps the mean at any number of samples, and of the light passes, which add up.
#[test]
fn denoising_keeps_the_mean_of_uneven_half_buffers() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let parts = ["--aov", "emission,diffuse_direct,diffuse_indirect", "--float"];
    let cases: [(&str, &[&str]); 3] = [
        ("three.exr", &["--spp", "3"]),
        ("noise.exr", &["--noise", "1", "--spp", "8"]),
        ("odd.exr", &["--noise", "1", "--spp", "13"]),
    ];
    for (name, more) in cases {
        let plain = format!("plain-{name}");
        let (shared, scene) = (["--width", "48", "--path-reuse", "off", "--quiet"], cornell());
        for (file, denoise) in [(plain.as_str(), &[][..]), (name, &["--denoise"][..])] {
            let args = [&["render", &scene, "-o", file][..], &shared, &parts, more, denoise].concat();
            run(folder.path(), &args, 0);
        }
        for channel in ["R", "G", "B"] {
            let (before, after) = (mean(&at(&plain), channel), mean(&at(name), channel));
            assert!((after / before - 1.0).abs() < 0.03, "{name} {channel}: {before} -> {after}");
        }
        let planes = planes(&at(name));
        for (i, beauty) in planes["R"].iter().enumerate() {
            let sum: f32 = ["DiffDir.R", "DiffInd.R", "Emit.R"].iter().map(|name| planes[*name][i]).sum();
            assert!((sum.max(0.0) - beauty).abs() <= 1e-3 * beauty.max(0.1), "{name}: {sum} {beauty}");
        }
    }
}

#[test]
fn denoised_renders_resume_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let shoot = |more: &[&str]| {
        let fixed = ["render", &scene, "--width", "16", "--float", "--reproducible", "--denoise"];
        run(folder.path(), &[&fixed[..], more].concat(), 0);
    };
    shoot(&["--spp", "528", "-o", "whole.exr"]);
    shoot(&["--spp", "264", "-o", "a.exr", "--checkpoint", "c.part"]);
    shoot(&["--spp", "528", "-o", "a.exr", "--checkpoint", "c.part", "--resume"]);
    let file = |name: &str| fs::read(folder.path().join(name)).expect("a file");
    assert!(file("a.exr") == file("whole.exr"));
}

#[test]
fn checkpoints_overwrite_only_checkpoints() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    endless_scene(folder);
    let scene = fs::read(folder.join("endless.toml")).unwrap();
    fs::write(folder.join("notes.txt"), "notes").unwrap();
    let small = ["--width", "8", "--spp", "2", "--depth", "2", "--quiet"];
    let render = |more: &[&str]| {
        let output = oscura(folder, &[&["render", "endless.toml", "-o", "a.exr"], &small[..], more].concat());
        (code(&output), stderr(&output))
    };
    for (file, why) in [("endless.toml", "scene"), ("a.exr", "output"), ("notes.txt", "not a checkpoint")] {
        let (code, messages) = render(&["--checkpoint", file]);
        assert!(code == 2 && messages.contains(why), "{file}: {messages}");
    }
    assert!(fs::read(folder.join("endless.toml")).unwrap() == scene);
    assert_eq!(fs::read_to_string(folder.join("notes.txt")).unwrap(), "notes");
    assert_eq!(names(folder), ["endless.toml", "notes.txt"]);
    assert_eq!(render(&["--checkpoint", "c.part"]).0, 0);
    let (code, messages) = render(&["--checkpoint", "c.part"]);
    assert!(code == 2 && messages.contains("--resume"), "{messages}");
    assert_eq!(render(&["--checkpoint", "c.part", "--resume"]).0, 0);
}

/// Merging a finished checkpoint gives the picture of its run, with its background.
#[test]
fn merged_checkpoints_have_their_background() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    fs::write(folder.join("a.obj"), triangle).unwrap();
    let args =
        ["render", "a.obj", "--width", "16", "--spp", "8", "--background", "#ff0000", "--reproducible"];
    run(folder, &[&args[..], &["-o", "a.png", "--checkpoint", "a.part"]].concat(), 0);
    run(folder, &["merge", "a.part", "-o", "b.png"], 0);
    assert!(fs::read(folder.join("a.png")).unwrap() == fs::read(folder.join("b.png")).unwrap());
    // Another view transform of the same samples.
    let look = ["--view", "agx", "--exposure", "-1.5"];
    run(folder, &[&args[..], &look, &["-o", "c.png"]].concat(), 0);
    run(folder, &[&["merge", "a.part", "-o", "d.png"][..], &look].concat(), 0);
    assert!(fs::read(folder.join("c.png")).unwrap() == fs::read(folder.join("d.png")).unwrap());
    assert!(fs::read(folder.join("a.png")).unwrap() != fs::read(folder.join("d.png")).unwrap());
}

/// AOVs in a scene file are checked, also for formats that can't store them.
#[test]
fn unknown_aovs_are_refused_for_any_format() {
    let folder = tempfile::tempdir().unwrap();
    let scene = |aov: &str| {
        format!(
            "camera = {{ look_from = [0, 0, 4], look_at = [0, 0, 0] }}\nenvironment.background = [1, 1, 1]\n\
             render.aovs = [\"{aov}\"]\n[[objects]]\nsphere = {{ center = [0, 0, 0], radius = 1 }}\nmaterial = \"m\"\n\
             [materials.m]\ntype = \"lambert\"\ncolor = [0.5, 0.5, 0.5]\n"
        )
    };
    let args = ["render", "a.toml", "-o", "a.png", "--width", "8", "--spp", "1"];
    fs::write(folder.path().join("a.toml"), scene("dephts")).unwrap();
    let refused = oscura(folder.path(), &args);
    assert!(code(&refused) != 0 && stderr(&refused).contains("dephts"), "{}", stderr(&refused));
    fs::write(folder.path().join("a.toml"), scene("depth")).unwrap();
    let taken = oscura(folder.path(), &args);
    assert!(code(&taken) == 0 && !stderr(&taken).contains("warning:"), "{}", stderr(&taken));
}

#[test]
fn unsupported_formats_are_refused_before_rendering() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let wide = ["render", &scene, "--width", "16400", "--height", "1", "-o", "w.exr", "-o", "w.webp"];
    let output = oscura(folder.path(), &wide);
    let (code, messages) = (code(&output), stderr(&output));
    assert!(code == 2 && messages.contains("16383") && messages.contains("w.webp"), "{messages}");
    assert!(names(folder.path()).is_empty());
}

/// One output whose folder vanishes during the render doesn't affect the others.
#[cfg(target_os = "linux")]
#[test]
fn failing_outputs_do_not_affect_others() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("gone")).unwrap();
    let scene = cornell();
    let args = ["render", &scene, "--width", "64", "-o", "gone/a.exr", "-o", "gone/b.png", "-o", "c.png"];
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_oscura"))
        .args(args)
        .args(["--time-limit", "2", "--spp", "100000"])
        .current_dir(folder.path())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("it starts");
    // Outputs are checked first; then there are two seconds.
    std::thread::sleep(std::time::Duration::from_millis(1000));
    fs::remove_dir(folder.path().join("gone")).expect("it is empty");
    let status = child.wait().expect("it ends");
    let mut messages = String::new();
    std::io::Read::read_to_string(&mut child.stderr.take().expect("piped"), &mut messages).unwrap();
    assert_eq!(status.code(), Some(4), "{messages}");
    assert!(messages.contains("a.exr") && messages.contains("b.png"), "{messages}");
    assert_eq!(names(folder.path()), ["c.png"]);
}

#[test]
fn unreached_noise_thresholds_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    for (spp, part) in [("64", "0.1 %"), ("8", "16")] {
        let args =
            ["render", &scene, "-o", "a.exr", "--width", "48", "--noise", "0.1", "--spp", spp, "--json"];
        let output = oscura(folder.path(), &args);
        let codes = &report(&output)["warning_codes"];
        assert!(codes.as_array().is_some_and(|codes| codes.contains(&"noise-not-reached".into())), "{codes}");
        assert!(stderr(&output).contains(part), "{spp}: {}", stderr(&output));
    }
}

/// A small light over a glass sphere in a closed room: without light tracing few paths find the caustic.
#[test]
fn undersampled_caustics_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let quad = |corner: &str, u: &str, v: &str| {
        format!("[[objects]]\nquad = {{ corner = {corner}, u = {u}, v = {v} }}\nmaterial = \"w\"\n")
    };
    let walls = [
        quad("[-2, 0, 3]", "[4, 0, 0]", "[0, 0, -5]"),
        quad("[-2, 2.5, -2]", "[4, 0, 0]", "[0, 0, 5]"),
        quad("[-2, 0, -2]", "[4, 0, 0]", "[0, 2.5, 0]"),
        quad("[-2, 0, 3]", "[0, 0, -5]", "[0, 2.5, 0]"),
        quad("[2, 0, 3]", "[0, 2.5, 0]", "[0, 0, -5]"),
        quad("[-2, 0, 3]", "[0, 2.5, 0]", "[4, 0, 0]"),
    ];
    let scene = "[camera]\nlook_from = [0, 1.2, 2.6]\nlook_at = [0, 1, 0]\nvfov = 60\n[materials]\n\
        w = { type = \"lambert\", color = 0.7 }\ng = { type = \"dielectric\" }\n\
        [[objects]]\nsphere = { center = [0, 0.6, 0], radius = 0.4 }\nmaterial = \"g\"\n\
        [[lights]]\npoint = { position = [-1, 2.2, 0.3], radius = 0.02, power = 60 }\n";
    fs::write(folder.path().join("room.toml"), walls.concat() + scene).unwrap();
    let codes = |more: &[&str]| {
        let common =
            ["render", "room.toml", "-o", "a.exr", "--size", "192x128", "--noise", "1", "--max-spp", "32"];
        let output = run(folder.path(), &[&common[..], &["--json"], more].concat(), 0);
        report(&output)["warning_codes"].to_string()
    };
    assert!(codes(&["--caustics", "off"]).contains("rare-paths"));
    assert!(!codes(&["--caustics", "on"]).contains("rare-paths"));
}

#[test]
fn luminance_is_converted_and_not_alpha() {
    use exr::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let size = (4, 2);
    let channel =
        |name: &str, value: f32| AnyChannel::new(name, FlatSamples::F32(vec![value; size.0 * size.1]));
    let channels = AnyChannels::sort([channel("A", 1.0), channel("Y", 0.1)].into_iter().collect());
    let file = folder.path().join("grey.exr");
    Image::from_channels(size, channels).write().to_file(&file).expect("written");
    run(folder.path(), &["convert", "grey.exr", "-o", "grey.hdr"], 0);
    let all = pixels(&folder.path().join("grey.hdr"));
    assert!(all.iter().flatten().all(|v| (v - 0.1).abs() < 0.01), "{all:?}");
}
