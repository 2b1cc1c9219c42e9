//! Options of `render` that change the picture or its report.

use crate::program::*;
use oscura::film::Aov;
use std::fs;

#[test]
fn environment_option_replaces_the_stage() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    exr::prelude::write_rgb_file(folder.path().join("env.exr"), 16, 8, |_, _| (1.0f32, 1.0f32, 1.0f32))
        .unwrap();
    let shoot = |more: &[&str]| {
        let output = run(
            folder.path(),
            &[&["render", "a.obj", "-o", "a.exr", "--width", "8", "--spp", "1"], more].concat(),
            0,
        );
        stderr(&output)
    };
    assert!(shoot(&[]).contains("studio"));
    assert!(!shoot(&["--env", "env.exr"]).contains("studio"));
    assert!(!shoot(&["--env", ""]).contains("studio"));
    says(&run(folder.path(), &["render", "a.obj", "-o", "b.exr", "--env", "none.exr"], 3), "none.exr");
}

#[test]
fn z_up_models_are_rotated() {
    let folder = tempfile::tempdir().unwrap();
    // A quad in the plane of x and z, whose front faces -y. Turned upright, it faces the viewer in the plane of x and y.
    let (lying, standing, face) =
        ("v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\n", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n", "f 1 2 3 4\n");
    for (name, vertices) in [("z.obj", lying), ("y.obj", standing)] {
        fs::write(folder.path().join(name), format!("{vertices}{face}")).unwrap();
    }
    let shoot = |scene: &str, out: &str, more: &[&str]| {
        let fixed = ["render", scene, "-o", out, "--width", "24", "--spp", "2", "--quiet"];
        run(folder.path(), &[&fixed[..], more].concat(), 0);
        image::open(folder.path().join(out)).unwrap().into_rgb8()
    };
    let upright = shoot("y.obj", "y.png", &[]);
    let turned = shoot("z.obj", "z.png", &["--up", "z"]);
    let lying = shoot("z.obj", "lying.png", &["--up", "y"]);
    let apart = |a: &image::RgbImage, b: &image::RgbImage| {
        let sum: u32 = a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
        f64::from(sum) / a.as_raw().len() as f64
    };
    // Rounding in the rotated vertices changes a few edge pixels at most, by one code.
    assert!(apart(&upright, &turned) < 0.5, "{}", apart(&upright, &turned));
    assert!(apart(&lying, &turned) > 5.0, "{}", apart(&lying, &turned));
    let scene = cornell();
    let gltf =
        oscura(folder.path(), &["render", &scene, "-o", "c.png", "--width", "8", "--spp", "1", "--up", "z"]);
    assert!(stderr(&gltf).contains("warning:"), "{}", stderr(&gltf));
}

#[test]
fn env_rotation_rotates_the_environment() {
    let folder = tempfile::tempdir().unwrap();
    // One bright column in 8: the camera looks at it or not.
    exr::prelude::write_rgb_file(folder.path().join("env.exr"), 8, 4, |x, _| {
        if x == 0 { (1.0f32, 1.0f32, 1.0f32) } else { (0.0, 0.0, 0.0) }
    })
    .unwrap();
    let scene = r#"
        [camera]
        look_from = [0, 0, 0]
        look_at = [0, 0, -1]
        vfov = 5
        [materials]
        black = { type = "lambert", color = [0, 0, 0] }
        [[objects]]
        sphere = { center = [0, 0, 9], radius = 1 }
        material = "black"
    "#;
    fs::write(folder.path().join("a.toml"), scene).unwrap();
    let brightness = |degrees: u32| {
        let degrees = degrees.to_string();
        let fixed = ["render", "a.toml", "-o", "a.exr", "--width", "4", "--height", "4", "--spp", "4"];
        let more = ["--env", "env.exr", "--env-rotation", &degrees];
        run(folder.path(), &[&fixed[..], &more].concat(), 0);
        pixels(&folder.path().join("a.exr")).iter().map(|p| p[0]).sum::<f32>() / 16.0
    };
    let around: Vec<f32> = (0..8).map(|i| brightness(45 * i + 22)).collect();
    let brightest = around.iter().copied().fold(0.0, f32::max);
    // Texels are interpolated: the column is visible from one or two directions of eight.
    let seen = around.iter().filter(|v| **v > 0.25 * brightest).count();
    assert!(brightest > 0.4 && (1..=3).contains(&seen), "{around:?}");
    assert!((brightness(22) - brightness(382)).abs() < 1e-3);
}

#[test]
fn microfacet_option() {
    let folder = tempfile::tempdir().unwrap();
    let scene = r#"
        [camera]
        look_from = [0, 0, 5]
        look_at = [0, 0, 0]
        vfov = 10
        [environment]
        background = [1, 1, 1]
        [materials]
        rough = { type = "metal", color = [1, 1, 1], roughness = 1 }
        [[objects]]
        sphere = { center = [0, 0, 0], radius = 1 }
        material = "rough"
    "#;
    fs::write(folder.path().join("a.toml"), scene).unwrap();
    let mean = |model: &str| {
        run(
            folder.path(),
            &[
                "render",
                "a.toml",
                "-o",
                "a.exr",
                "--float",
                "--width",
                "16",
                "--height",
                "16",
                "--microfacet",
                model,
            ],
            0,
        );
        let pixels = pixels(&folder.path().join("a.exr"));
        pixels.iter().map(|p| f64::from(p[1])).sum::<f64>() / pixels.len() as f64
    };
    // White metal in a white furnace: energy of multiple scattering is lost or compensated.
    let (multi, single) = (mean("multi"), mean("single"));
    assert!((multi - 1.0).abs() < 0.05 && single < multi - 0.2, "{multi} {single}");
}

/// Smooth black plastic in a uniform environment, seen at 60 degrees: 8.9 % by Fresnel's equations, 7.0 % by Schlick's formula.
#[test]
fn fresnel_option() {
    let folder = tempfile::tempdir().unwrap();
    let scene = |settings: &str| {
        format!(
            r#"
        [camera]
        look_from = [4.330127, 2.5, 0]
        look_at = [0, 0, 0]
        vfov = 0.5
        {settings}
        [environment]
        background = [1, 1, 1]
        [materials]
        plastic = {{ type = "pbr", base_color = [0, 0, 0], metallic = 0, roughness = 0 }}
        [[objects]]
        quad = {{ corner = [-5, 0, 5], u = [10, 0, 0], v = [0, 0, -10] }}
        material = "plastic"
    "#
        )
    };
    fs::write(folder.path().join("a.toml"), scene("")).unwrap();
    fs::write(folder.path().join("b.toml"), scene("[render]\nfresnel = \"schlick\"")).unwrap();
    let mean = |file: &str, more: &[&str]| {
        let common = ["render", file, "-o", "a.exr", "--float", "--width", "8", "--height", "8"];
        run(folder.path(), &[&common, more].concat(), 0);
        let pixels = pixels(&folder.path().join("a.exr"));
        pixels.iter().map(|p| f64::from(p[1])).sum::<f64>() / pixels.len() as f64
    };
    let near = |value: f64, expected: f64| assert!((value - expected).abs() < 1e-3, "{value} {expected}");
    near(mean("a.toml", &[]), 0.0892);
    near(mean("a.toml", &["--fresnel", "schlick"]), 0.07);
    near(mean("b.toml", &[]), 0.07);
    near(mean("b.toml", &["--fresnel", "exact"]), 0.0892);
}

#[test]
fn reports_use_plain_decimals() {
    let folder = tempfile::tempdir().unwrap();
    let output = render(folder.path(), "a.exr", &["--json", "-o", "a.png", "--aov", "depth,normal,albedo"]);
    assert_eq!(names(folder.path()), ["a.exr", "a.png"]);
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    let value: serde_json::Value = serde_json::from_str(&text).expect("one object");
    for key in ["load_s", "build_s", "render_s", "write_s", "render_cpu_s", "rays", "samples"] {
        assert!(value[key].as_f64().expect(key) >= 0.0, "{key}: {value}");
        let number = text.split(&format!("\"{key}\": ")).nth(1).and_then(|t| t.split([',', '}']).next());
        assert!(number.expect(key).chars().all(|c| c.is_ascii_digit() || c == '.'), "{key}: {text}");
    }
    assert_eq!(value["samples"], u64::from(48u32 * value["height"].as_u64().unwrap() as u32 * 4));
    assert!(value["rays"].as_u64().unwrap() > value["samples"].as_u64().unwrap());
}

/// Each AOV that help lists adds its own channels; `all` adds the same ones.
#[test]
fn aovs_match_help() {
    let folder = tempfile::tempdir().unwrap();
    let help = stdout(&oscura(folder.path(), &["help", "render"]));
    let channels = |aov: &str| -> Vec<String> {
        render(folder.path(), "a.exr", &["--quiet", "--aov", aov]);
        let meta =
            exr::meta::MetaData::read_from_file(folder.path().join("a.exr"), false).expect("a picture");
        let list = &meta.headers[0].channels.list;
        list.iter()
            .map(|c| c.name.to_string())
            .filter(|name| !["A", "B", "G", "R"].contains(&&**name))
            .collect()
    };
    let mut expected = Vec::new();
    for aov in Aov::ALL {
        let info = aov.info();
        assert!(help.contains(&format!("- {}:", info.option)), "help doesn't list {}: {help}", info.option);
        let names = channels(info.option);
        // EXR lists channels alphabetically.
        let mut listed = info.names.to_vec();
        listed.sort_unstable();
        assert_eq!(names, listed, "{}", info.option);
        expected.extend(names);
    }
    expected.sort();
    let all: Vec<&str> = Aov::ALL.iter().map(|aov| aov.info().option).collect();
    assert_eq!(channels(&all.join(",")), expected);
}

#[test]
fn reproducible_files_do_not_depend_on_threads() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = |name: &str| fs::read(folder.path().join(name)).expect("a picture");
    let shoot = |name: &str, more: &[&str]| {
        render(folder.path(), name, &[&["--reproducible", "--quiet"], more].concat());
        bytes(name)
    };
    for format in [&[][..], &["--float", "--aov", "depth,normal,albedo"]] {
        let files =
            ["1", "2", "7"].map(|t| shoot(&format!("{t}.exr"), &[&["--threads", t], format].concat()));
        assert!(files[0] == files[1] && files[0] == files[2], "{format:?}");
        assert!(files[0] != shoot("seed.exr", &[&["--seed", "1"], format].concat()), "{format:?}");
    }
    assert!(shoot("half.exr", &[]) != shoot("float.exr", &["--float"]));
}

#[test]
fn quiet_is_quiet() {
    let folder = tempfile::tempdir().unwrap();
    let output = render(folder.path(), "a.exr", &["--quiet"]);
    assert!(output.stdout.is_empty() && output.stderr.is_empty(), "{}", stderr(&output));
}

#[test]
fn options_without_effect_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let output = render(folder.path(), "a.png", &["--aov", "depth", "--float"]);
    for option in ["--aov", "--float"] {
        let warning = format!("warning: {option} has no effect");
        assert!(stderr(&output).contains(&warning), "{}", stderr(&output));
    }
}

/// Every option of the table in a case with effect, and in one without.
#[test]
fn options_without_effect_are_explained() {
    let folder = tempfile::tempdir().unwrap();
    let idle = |output: &str, more: &[&str]| {
        let run = render(folder.path(), output, more);
        let messages = stderr(&run);
        messages.lines().filter(|line| line.contains("has no effect")).map(str::to_string).collect::<Vec<_>>()
    };
    let for_looking =
        ["--view", "agx", "--exposure", "1", "--white-balance", "5000", "--dither", "--deep", "--quiet"];
    assert!(idle("a.png", &for_looking[..8]).is_empty());
    let messages = idle("a.exr", &for_looking[..8]).join("\n");
    for option in ["--view", "--exposure", "--white-balance", "--dither", "--deep"] {
        assert!(messages.contains(&format!("{option} has no effect: no output is")), "{option}: {messages}");
    }
    let messages =
        idle("a.jpg", &["--deep", "--crypto-levels", "3", "--fps", "10", "--aov-space", "camera"]).join("\n");
    for option in ["--deep", "--crypto-levels", "--fps", "--aov-space"] {
        assert!(messages.contains(&format!("{option} has no effect: ")), "{option}: {messages}");
    }
    let used = ["--aov", "normal,crypto_object", "--crypto-levels", "3", "--aov-space", "camera"];
    assert_eq!(idle("a.exr", &used), [""; 0]);
    // Options valid for any scene are no mistake.
    let groups = render(folder.path(), "a.exr", &["--light-groups", "--strict"]);
    assert!(stderr(&groups).contains("--light-groups"), "{}", stderr(&groups));
}

#[test]
fn strict_makes_warnings_errors_before_rendering() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let shoot = |more: &[&str]| {
        oscura(
            folder.path(),
            &[&["render", "a.obj", "-o", "a.exr", "--width", "8", "--spp", "1"], more].concat(),
        )
    };
    // A model without camera is no reason for a warning; a camera without light is.
    let refused = shoot(&["--stage", "none", "--strict"]);
    assert_eq!(code(&refused), 3, "{}", stderr(&refused));
    assert!(stderr(&refused).contains("--strict"));
    assert_eq!(names(folder.path()), ["a.obj"]);
    assert_eq!(code(&shoot(&["--stage", "none"])), 0);
    assert_eq!(code(&shoot(&["--strict"])), 0);
    let scene = cornell();
    run(folder.path(), &["render", &scene, "-o", "b.exr", "--width", "8", "--spp", "1", "--strict"], 0);
}

#[test]
fn explain_lists_what_was_culled() {
    let folder = tempfile::tempdir().unwrap();
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl used\nf 1 2 3\n";
    fs::write(folder.path().join("a.obj"), obj).unwrap();
    fs::write(folder.path().join("a.mtl"), "newmtl used\nKd 1 1 1\nnewmtl aside\nKd 1 0 0\n").unwrap();
    let shoot = |more: &[&str]| {
        let fixed = ["render", "a.obj", "-o", "a.exr", "--width", "8", "--spp", "1"];
        let output = run(folder.path(), &[&fixed, more].concat(), 0);
        stderr(&output)
    };
    assert!(shoot(&["--explain"]).contains("left out: material 'aside'"));
    assert!(!shoot(&[]).contains("left out: "));
}

#[test]
fn clamped_values_are_counted_in_the_header() {
    let folder = tempfile::tempdir().unwrap();
    let scene = r#"
        [camera]
        look_from = [0, 0, 0]
        look_at = [0, 0, 1]
        [environment]
        background = [1e6, 1, 1]
        [materials]
        black = { type = "lambert", color = [0, 0, 0] }
        [[objects]]
        sphere = { center = [0, 0, -9], radius = 1 }
        material = "black"
    "#;
    fs::write(folder.path().join("bright.toml"), scene).unwrap();
    run(
        folder.path(),
        &["render", "bright.toml", "-o", "a.exr", "--width", "8", "--height", "8", "--spp", "1"],
        0,
    );
    match attribute(&folder.path().join("a.exr"), "warnings") {
        Some(exr::prelude::AttributeValue::Text(t)) => {
            assert!(t.to_string().contains("64 values"), "{t}")
        }
        other => panic!("{other:?}"),
    }
}

/// A sidecar is a note, not a warning.
#[test]
fn sidecars_are_noted_and_pass_strict() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let settings =
        "environment.background = [1, 1, 1]\ncamera = { look_from = [0, 0, 3], look_at = [0, 0, 0] }\n";
    fs::write(folder.path().join("a.oscura.toml"), settings).unwrap();
    let args = ["render", "a.obj", "-o", "a.png", "--width", "8", "--spp", "1", "--strict", "--json"];
    let output = run(folder.path(), &args, 0);
    assert!(stderr(&output).contains("note: a.oscura.toml"), "{}", stderr(&output));
    let report = report(&output);
    assert_eq!(report["warnings"].as_array().map(Vec::len), Some(0), "{report}");
    assert!(report["notes"][0].as_str().is_some_and(|n| n.contains("a.oscura.toml")), "{report}");
    let shown = stdout(&oscura(folder.path(), &["inspect", "a.obj"]));
    assert!(shown.contains("  notes      1\n    a.oscura.toml: "), "{shown}");
}
