//! Time and memory limits.

use crate::program::*;
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::Write;

#[test]
fn time_limit_holds_for_large_pictures_and_endless_paths() {
    let folder = tempfile::tempdir().unwrap();
    endless_scene(folder.path());
    let cornell = cornell();
    // One sample per pixel of the first takes seconds, one path of the second never ends.
    for (scene, more) in [
        (cornell.as_str(), &["--width", "4000", "--height", "4000"][..]),
        ("endless.toml", &["--depth", "4294967295", "--width", "64"]),
    ] {
        let fixed = ["render", scene, "-o", "a.exr", "--time-limit", "0.3", "--threads", "1", "--json"];
        let output = run(folder.path(), &[&fixed, more].concat(), 0);
        let value = report(&output);
        assert_eq!((&value["timed_out"], &value["interrupted"]), (&true.into(), &false.into()), "{value}");
        // One tile, or 64 bounces of one, may exceed it; the rest is for a busy machine.
        let render_s = value["render_s"].as_f64().expect("a number");
        assert!(render_s < 3.0, "{scene}: {render_s} s");
        let codes = value["warning_codes"].as_array().expect("codes");
        assert!(codes.contains(&"pixels-unsampled".into()), "{codes:?}");
        let path = folder.path().join("a.exr");
        assert_eq!(attribute(&path, "stoppedBy"), text("time limit"));
        let samples = value["samples_per_pixel"].as_f64().expect("a number");
        let written = match attribute(&path, "samples") {
            Some(exr::prelude::AttributeValue::F32(v)) => f64::from(v),
            Some(exr::prelude::AttributeValue::I32(v)) => f64::from(v),
            other => panic!("{other:?}"),
        };
        assert!(samples < 1.0 && (written - samples).abs() < 1e-6, "{written} {samples}");
    }
}

#[test]
fn a_generous_time_limit_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let output = render(folder.path(), "a.exr", &["--time-limit", "1000", "--json"]);
    let value = report(&output);
    assert_eq!((&value["timed_out"], &value["samples_per_pixel"]), (&false.into(), &4.into()), "{value}");
    assert_eq!(attribute(&folder.path().join("a.exr"), "stoppedBy"), None);
}

/// Crops support time limits; sample ranges, which must be complete, refuse them.
#[test]
fn crops_have_time_limits() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let fixed = ["render", &scene, "--width", "64", "--spp", "1000000", "--time-limit", "0.3", "--json"];
    let run = |more: &[&str]| oscura(folder.path(), &[&fixed[..], more].concat());
    for crop in ["--crop", "--region"] {
        let output = run(&["-o", "a.exr", crop, "8,8,40,24"]);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let report = report(&output);
        let samples = report["samples_per_pixel"].as_f64().expect("a number");
        assert!(report["timed_out"] == true && samples > 0.0 && samples < 1e6, "{report}");
    }
    let output = run(&["-o", "a.part", "--region", "8,8,40,24"]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
    assert!(stderr(&output).contains("--time-limit"), "{}", stderr(&output));
}

/// Guiding takes a small part of the time, and a picture is written.
#[test]
fn a_time_limit_leaves_time_for_guided_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let size = ["render", &scene, "-o", "a.exr", "--width", "640", "--spp", "4096", "--json"];
    let output = run(folder.path(), &[&size[..], &["--guiding", "on", "--time-limit", "1"]].concat(), 0);
    let report = report(&output);
    let of = |key: &str| report[key].as_f64().expect(key);
    assert!(of("samples_per_pixel") > 0.0, "{report}");
    assert!(of("render_s") < 3.0, "{report}");
}

/// By their headers: the files contain no pixels.
#[test]
fn a_memory_limit_refuses_images_before_they_are_decoded() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, content: &[u8]| std::fs::write(folder.path().join(name), content).unwrap();
    write("large.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2000 +X 4000\n");
    write(
        "a.toml",
        b"[camera]\nlook_from = [0, 0, 5]\nlook_at = [0, 0, 0]\n[environment]\nimage = \"large.hdr\"\n",
    );
    write("a.obj", b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
    write("a.mtl", b"newmtl a\nmap_Kd large.hdr\n");
    let common = ["-o", "a.png", "--size", "16x16", "--spp", "1", "--memory-limit", "64M"];
    let of = |scene: &str, more: &[&str]| {
        let output = oscura(folder.path(), &[&["render", scene][..], &common, more].concat());
        (code(&output), stderr(&output))
    };
    let large = "4000 x 2000 pixels, which take 92 MiB of memory; at most 64 MiB are allowed";
    for (scene, more) in
        [("a.toml", &[][..]), ("a.obj", &["--env", "large.hdr"]), ("a.obj", &["--background", "large.hdr"])]
    {
        let (code, messages) = of(scene, more);
        assert!(
            code == 3 && messages.contains(large) && messages.contains("--memory-limit"),
            "{scene} {code}: {messages}"
        );
    }
    // A model only loses its texture.
    let (code, messages) = of("a.obj", &[]);
    assert!(code == 0 && messages.contains("warning:") && messages.contains(large), "{code}: {messages}");
}

/// The size of compressed files is unknown in advance: the limit is checked during decompression.
#[test]
fn a_memory_limit_is_watched_while_scenes_and_frames_are_loaded() {
    let folder = tempfile::tempdir().unwrap();
    let count = 20_000_000;
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {count}\nproperty float x\nproperty float y\n\
         property float z\nend_header\n"
    );
    let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
    packed.write_all(header.as_bytes()).unwrap();
    let zeros = vec![0; 12 << 16];
    (0..=count >> 16).for_each(|_| packed.write_all(&zeros).unwrap());
    std::fs::write(folder.path().join("a.ply.gz"), packed.finish().unwrap()).unwrap();
    for output in [&["-o", "a.png"][..], &["-o", "a##.png", "--frames", "0-1"]] {
        let common = ["render", "a.ply.gz", "--size", "16x16", "--spp", "1", "--memory-limit", "64M"];
        let run = oscura(folder.path(), &[&common[..], output].concat());
        let messages = stderr(&run);
        assert!(code(&run) == 2 && messages.contains("--memory-limit"), "{}: {messages}", code(&run));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
