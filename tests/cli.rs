//! The program from outside: exit codes, messages, files.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn oscura(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_oscura"))
        .args(args)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .output()
        .expect("the program starts")
}

fn code(output: &Output) -> i32 {
    output.status.code().expect("the program ends by itself")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .expect("the folder can be read")
        .map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// The Cornell box that comes with the project.
fn cornell() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/cornell-box.gltf").display().to_string()
}

/// A constant EXR picture of 16 x 16 pixels.
fn picture(folder: &Path, name: &str, value: f32) -> PathBuf {
    let path = folder.join(name);
    exr::prelude::write_rgb_file(&path, 16, 16, |_, _| (value, value, value)).expect("an EXR can be written");
    path
}

#[test]
fn usage_errors_exit_with_2_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.gltf"), "not read at all").unwrap();
    for args in [
        &["render", "a.gltf"][..],
        &["render", "a.gltf", "-o", "a.jpg"],
        &["render", "a.gltf", "-o", "a.exr", "-o", "a.exr"],
        &["render", "a.gltf", "-o", "a.exr", "--spp", "0"],
        &["render", "a.gltf", "-o", "a.exr", "--width", "0"],
        &["render", "a.gltf", "-o", "a.exr", "--time-limit", "-1"],
        &["render", "a.gltf", "-o", "a.exr", "--filter", "lanczos"],
        &["render", "a.gltf", "-o", "a.exr", "--aov", "depth,colour"],
        &["render", "a.gltf", "-o", "a.exr", "--no-such-option"],
        &["render", "a.gltf", "-o", "a.png", "-o", "./a.png"],
        &["render", "a.gltf", "-o", "a.exr", "--width", "60000", "--height", "60000"],
        &["render", "a.gltf", "-o", "a.exr", "--exposure", "101"],
        &["render", "a.gltf", "-o", "a.exr", "--exposure", "NaN"],
        &["render", "a.gltf", "-o", "a.exr", "--env-strength", "-1"],
        &["render", "a.gltf", "-o", "a.exr", "--env-rotation", "inf"],
        &["compare", "a.exr", "b.exr", "--other-seed", "c.exr"],
        &["paint"],
    ] {
        let output = oscura(folder.path(), args);
        assert_eq!(code(&output), 2, "{args:?}: {}", stderr(&output));
        assert!(!output.stderr.is_empty() && output.stdout.is_empty(), "{args:?}");
    }
    assert_eq!(names(folder.path()), ["a.gltf"]);
}

/// The Cornell box with a text replaced.
fn cornell_with(from: &str, to: &str) -> Vec<u8> {
    let text = fs::read_to_string(cornell()).expect("the asset");
    assert!(text.contains(from), "{from}");
    text.replacen(from, to, 1).into_bytes()
}

/// The Cornell box as a `.glb` that claims more bytes than follow.
fn truncated_glb() -> Vec<u8> {
    let json = fs::read(cornell()).expect("the asset");
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((20 + json.len() as u32).to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(&json[..json.len() / 2]);
    bytes
}

/// Names of broken inputs, their content, and words that the error must have besides the name.
fn broken_inputs() -> Vec<(&'static str, Vec<u8>, &'static [&'static str])> {
    let half = fs::read(cornell()).map(|b| b[..b.len() / 2].to_vec()).expect("the asset");
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
               element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    vec![
        ("text.gltf", b"this is no glTF".to_vec(), &["JSON"]),
        ("empty.gltf", Vec::new(), &[]),
        ("truncated.gltf", half, &["line"]),
        ("truncated.glb", truncated_glb(), &[]),
        ("broken.glb", b"glTF\x02\0\0\0\xff\xff\xff\xff".to_vec(), &[]),
        ("accessor.gltf", cornell_with("\"count\": 12", "\"count\": 99999"), &["/accessors/0", "99999"]),
        ("type.gltf", cornell_with("\"VEC3\"", "\"VEC2\""), &["/accessors/0", "VEC2"]),
        ("header.ply", b"ply\nformat ascii 1.0\nelement vertex 9\n".to_vec(), &[]),
        ("short.ply", format!("{ply}0 0 0\n1 0 0\n").into_bytes(), &[]),
        ("index.ply", format!("{ply}0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n").into_bytes(), &["7"]),
        ("index.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n".to_vec(), &[]),
        ("words.obj", b"v 0 zero 0\nf 1 1 1\n".to_vec(), &["1"]),
        (
            "key.toml",
            b"no_such_key = 1\n[camera]\nlook_form = [0, 0, 1]\n".to_vec(),
            &["no_such_key", "look_form"],
        ),
        ("syntax.toml", b"[camera\n".to_vec(), &["1"]),
        ("scene.xyz", b"?".to_vec(), &[".gltf"]),
        ("folder.glb", Vec::new(), &[]),
    ]
}

#[test]
fn broken_inputs_exit_with_3_and_leave_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut inputs = broken_inputs();
    for (name, content, _) in &inputs {
        match *name {
            "folder.glb" => fs::create_dir(folder.path().join(name)).unwrap(),
            _ => fs::write(folder.path().join(name), content).unwrap(),
        }
    }
    let before = names(folder.path());
    inputs.push(("missing.gltf", Vec::new(), &[]));
    for (name, _, words) in &inputs {
        let output = oscura(folder.path(), &["render", name, "-o", "out.exr", "-o", "out.png"]);
        let text = stderr(&output);
        println!("{text}");
        assert_eq!(code(&output), 3, "{name}: {text}");
        for word in std::iter::once(name).chain(*words) {
            assert!(text.contains(word), "{name}: '{word}' isn't in: {text}");
        }
        assert_eq!(text.matches("error:").count(), 1, "{text}");
        assert!(!text.contains("panicked") && !text.contains("warning:"), "{text}");
        assert_eq!(names(folder.path()), before, "{name} left a file");
    }
}

#[test]
fn an_environment_of_the_caller_replaces_the_default_sky() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    exr::prelude::write_rgb_file(folder.path().join("env.exr"), 16, 8, |_, _| (1.0f32, 1.0f32, 1.0f32))
        .unwrap();
    let shoot = |more: &[&str]| {
        let output = oscura(
            folder.path(),
            &[&["render", "a.obj", "-o", "a.exr", "--width", "8", "--spp", "1"], more].concat(),
        );
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        stderr(&output)
    };
    assert!(shoot(&[]).contains("default sky"));
    assert!(!shoot(&["--env", "env.exr"]).contains("default sky"));
    assert!(!shoot(&["--env", ""]).contains("default sky"));
    let missing = oscura(folder.path(), &["render", "a.obj", "-o", "b.exr", "--env", "none.exr"]);
    assert_eq!(code(&missing), 3);
    assert!(stderr(&missing).contains("none.exr"), "{}", stderr(&missing));
}

#[test]
fn files_outside_the_folder_need_permission() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("scene")).unwrap();
    let asset: serde_json::Value = serde_json::json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "scene": 0,
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "../a.bin"}]
    });
    fs::write(folder.path().join("scene/s.gltf"), asset.to_string()).unwrap();
    let corners = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    fs::write(folder.path().join("a.bin"), corners.map(f32::to_le_bytes).concat()).unwrap();
    for command in
        [&["inspect", "scene/s.gltf"][..], &["render", "scene/s.gltf", "-o", "a.png", "--width", "8"]]
    {
        let refused = oscura(folder.path(), command);
        assert_eq!(code(&refused), 3, "{}", stderr(&refused));
        assert!(stderr(&refused).contains("--allow-external"), "{}", stderr(&refused));
        let allowed = oscura(folder.path(), &[command, &["--allow-external"]].concat());
        assert_eq!(code(&allowed), 0, "{}", stderr(&allowed));
    }
}

#[test]
fn targets_that_cannot_be_written_exit_with_4_before_the_scene_is_read() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("folder.png")).unwrap();
    for target in ["no/such/folder/a.exr", "folder.png"] {
        let output = oscura(folder.path(), &["render", "missing.gltf", "-o", target]);
        assert_eq!(code(&output), 4, "{}", stderr(&output));
        assert!(stderr(&output).contains(target), "{}", stderr(&output));
    }
    assert_eq!(names(folder.path()), ["folder.png"]);
}

#[test]
fn errors_are_json_too() {
    let folder = tempfile::tempdir().unwrap();
    let output = oscura(folder.path(), &["render", "missing.gltf", "-o", "a.exr", "--json"]);
    let value: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
    assert_eq!(value["error"]["exit_code"], 3);
    assert_eq!(value["error"]["file"], "missing.gltf");
}

#[test]
fn compare_measures_and_draws() {
    let folder = tempfile::tempdir().unwrap();
    picture(folder.path(), "a.exr", 1.1);
    picture(folder.path(), "r.exr", 1.0);
    let output = oscura(folder.path(), &["compare", "a.exr", "r.exr", "--json", "-o", "d.png"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let value: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
    // The pictures are 32-bit floats.
    let near = |v: &serde_json::Value, expected: f64| (v.as_f64().expect("a number") - expected).abs() < 1e-6;
    assert!(near(&value["rmse"], 0.1) && near(&value["rel_mse"], 0.01 / 1.01), "{value}");
    assert!(near(&value["mean_ratio"][0], 1.1) && value["z_test"].is_null(), "{value}");
    let drawn = image::open(folder.path().join("d.png")).expect("a PNG").to_rgb8();
    assert_eq!((drawn.dimensions(), drawn.get_pixel(0, 0)[0]), ((16, 16), 255));
}

#[test]
fn compare_exits_with_1_on_disagreement_and_3_on_unlike_pictures() {
    let folder = tempfile::tempdir().unwrap();
    for (name, value) in [("a.exr", 1.01), ("b.exr", 0.99), ("far.exr", 2.0), ("r.exr", 1.0), ("v.exr", 1e-4)]
    {
        picture(folder.path(), name, value);
    }
    let test = |a, b| oscura(folder.path(), &["compare", a, "r.exr", "--other-seed", b, "--var", "v.exr"]);
    assert_eq!(code(&test("a.exr", "b.exr")), 0);
    assert_eq!(code(&test("far.exr", "far.exr")), 1);
    exr::prelude::write_rgb_file(folder.path().join("small.exr"), 8, 8, |_, _| (1.0f32, 1.0f32, 1.0f32))
        .unwrap();
    let unlike = oscura(folder.path(), &["compare", "small.exr", "r.exr"]);
    assert_eq!(code(&unlike), 3);
    assert!(stderr(&unlike).contains("8 x 8"), "{}", stderr(&unlike));
}

fn render(folder: &Path, name: &str, more: &[&str]) -> Output {
    let scene = cornell();
    let mut args = vec!["render", &scene, "-o", name, "--width", "48", "--spp", "4"];
    args.extend(more);
    let output = oscura(folder, &args);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    output
}

#[test]
fn a_render_reports_in_plain_decimals() {
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

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

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

/// The text attribute of an EXR's header.
fn attribute(path: &Path, name: &str) -> Option<exr::prelude::AttributeValue> {
    let meta = exr::meta::MetaData::read_from_file(path, true).expect("our own file is valid");
    meta.headers[0].own_attributes.other.get(&exr::prelude::Text::from(name)).cloned()
}

fn text(value: &str) -> Option<exr::prelude::AttributeValue> {
    Some(exr::prelude::AttributeValue::Text(exr::prelude::Text::from(value)))
}

/// A closed ball that loses nothing: no path in it ends before its depth.
fn endless_scene(folder: &Path) {
    let scene = r#"
        [camera]
        look_from = [0, 0, 0]
        look_at = [0, 0, 1]
        [environment]
        background = [1, 1, 1]
        [materials]
        white = { type = "lambert", color = [1, 1, 1] }
        [[objects]]
        sphere = { center = [0, 0, 0], radius = 2 }
        material = "white"
    "#;
    fs::write(folder.join("endless.toml"), scene).unwrap();
}

/// What `--json` says about a run.
fn report(output: &Output) -> serde_json::Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", stderr(output)))
}

#[test]
fn a_time_limit_holds_for_large_pictures_and_endless_paths() {
    let folder = tempfile::tempdir().unwrap();
    endless_scene(folder.path());
    let cornell = cornell();
    // One sample of each pixel of the first would take seconds, one path of the second for ever.
    for (scene, more) in [
        (cornell.as_str(), &["--width", "4000", "--height", "4000"][..]),
        ("endless.toml", &["--depth", "4294967295", "--width", "64"]),
    ] {
        let fixed = ["render", scene, "-o", "a.exr", "--time-limit", "0.3", "--threads", "1", "--json"];
        let output = oscura(folder.path(), &[&fixed, more].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let value = report(&output);
        assert_eq!((&value["timed_out"], &value["interrupted"]), (&true.into(), &false.into()), "{value}");
        // A tile or 64 bounces of one are what it may take longer; the rest is for a busy machine.
        let render_s = value["render_s"].as_f64().expect("a number");
        assert!(render_s < 3.0, "{scene}: {render_s} s");
        assert!(stderr(&output).contains("pixels have no sample"), "{}", stderr(&output));
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

#[test]
fn clamped_values_stand_in_the_header() {
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
    let output = oscura(
        folder.path(),
        &["render", "bright.toml", "-o", "a.exr", "--width", "8", "--height", "8", "--spp", "1"],
    );
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    match attribute(&folder.path().join("a.exr"), "warnings") {
        Some(exr::prelude::AttributeValue::Text(t)) => {
            assert!(t.to_string().contains("64 values above"), "{t}")
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn options_without_effect_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let output = render(folder.path(), "a.png", &["--aov", "depth", "--float"]);
    for option in ["--aov", "--float"] {
        let warning = format!("warning: {option} has no effect");
        assert!(stderr(&output).contains(&warning), "{}", stderr(&output));
    }
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
    let refused = shoot(&["--strict"]);
    assert_eq!(code(&refused), 3, "{}", stderr(&refused));
    assert!(stderr(&refused).contains("default sky") && stderr(&refused).contains("--strict"));
    assert_eq!(names(folder.path()), ["a.obj"]);
    assert_eq!(code(&shoot(&[])), 0);
    let scene = cornell();
    let clean =
        oscura(folder.path(), &["render", &scene, "-o", "b.exr", "--width", "8", "--spp", "1", "--strict"]);
    assert_eq!(code(&clean), 0, "{}", stderr(&clean));
}

#[test]
fn explain_says_what_was_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl used\nf 1 2 3\n";
    fs::write(folder.path().join("a.obj"), obj).unwrap();
    fs::write(folder.path().join("a.mtl"), "newmtl used\nKd 1 1 1\nnewmtl aside\nKd 1 0 0\n").unwrap();
    let shoot = |more: &[&str]| {
        let fixed = ["render", "a.obj", "-o", "a.exr", "--width", "8", "--spp", "1"];
        let output = oscura(folder.path(), &[&fixed, more].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        stderr(&output)
    };
    assert!(shoot(&["--explain"]).contains("left out: material 'aside'"));
    assert!(!shoot(&[]).contains("left out: "));
}

/// A picture as a list.
fn pixels(path: &Path) -> Vec<[f32; 3]> {
    let image = oscura::load::image::load_linear_rgb(path).expect("a picture");
    let all = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
    all.map(|(x, y)| image.rgba(x, y)).map(|[r, g, b, _]| [r, g, b]).collect()
}

#[test]
fn microfacet_chooses_the_model() {
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
        let output = oscura(
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
        );
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let pixels = pixels(&folder.path().join("a.exr"));
        pixels.iter().map(|p| f64::from(p[1])).sum::<f64>() / pixels.len() as f64
    };
    // White metal in a white furnace: light that bounces more than once between facets is lost or not.
    let (multi, single) = (mean("multi"), mean("single"));
    assert!((multi - 1.0).abs() < 0.05 && single < multi - 0.2, "{multi} {single}");
}

#[test]
fn env_rotation_turns_the_surroundings() {
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
        let output = oscura(folder.path(), &[&fixed[..], &more].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        pixels(&folder.path().join("a.exr")).iter().map(|p| p[0]).sum::<f32>() / 16.0
    };
    let around: Vec<f32> = (0..8).map(|i| brightness(45 * i + 22)).collect();
    let brightest = around.iter().copied().fold(0.0, f32::max);
    // Texels are interpolated: the column is seen from one or two directions of eight, and not from the others.
    let seen = around.iter().filter(|v| **v > 0.25 * brightest).count();
    assert!(brightest > 0.4 && (1..=3).contains(&seen), "{around:?}");
    assert!((brightness(22) - brightness(382)).abs() < 1e-3);
}

#[test]
fn long_lines_are_cut_in_errors() {
    let folder = tempfile::tempdir().unwrap();
    let long = format!("no_such_key = [{}]\n", "0, ".repeat(100_000));
    fs::write(folder.path().join("a.toml"), long).unwrap();
    let output = oscura(folder.path(), &["render", "a.toml", "-o", "a.exr"]);
    assert_eq!(code(&output), 3);
    let text = stderr(&output);
    assert!(
        text.contains("no_such_key") && text.contains("a.toml:1:") && text.len() < 2000,
        "{} bytes",
        text.len()
    );
}

#[cfg(target_os = "linux")]
mod linux {
    use super::*;
    use std::process::{Child, Stdio};
    use std::time::{Duration, Instant};

    /// Starts a render that would go on for ever, and waits until its threads are at work.
    fn endless(folder: &Path, more: &[&str]) -> Child {
        endless_scene(folder);
        let fixed = ["render", "endless.toml", "-o", "a.exr", "--depth", "4294967295", "--width", "64"];
        let child = Command::new(env!("CARGO_BIN_EXE_oscura"))
            .args(fixed.iter().chain(more))
            .current_dir(folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let begin = Instant::now();
        while cpu_ticks(child.id()) < 10 {
            assert!(begin.elapsed() < Duration::from_secs(60), "it does nothing");
            std::thread::sleep(Duration::from_millis(10));
        }
        child
    }

    /// Processor time of a process, hundredths of a second.
    fn cpu_ticks(id: u32) -> u64 {
        let stat = fs::read_to_string(format!("/proc/{id}/stat")).expect("the process runs");
        let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
        fields[11].parse::<u64>().expect("a number") + fields[12].parse::<u64>().expect("a number")
    }

    fn send(child: &Child, signal: &str) {
        let status = Command::new("kill").args([signal, &child.id().to_string()]).status();
        assert!(status.expect("kill runs").success());
    }

    #[test]
    fn the_first_signal_ends_even_endless_paths_and_writes_what_is_there() {
        for signal in ["-INT", "-TERM"] {
            let folder = tempfile::tempdir().unwrap();
            let child = endless(folder.path(), &["--strict", "--json"]);
            send(&child, signal);
            let output = child.wait_with_output().expect("it ends");
            assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
            assert_eq!(report(&output)["interrupted"], true);
            assert_eq!(attribute(&folder.path().join("a.exr"), "stoppedBy"), text("signal"));
            assert_eq!(names(folder.path()), ["a.exr", "endless.toml"]);
        }
    }

    #[test]
    fn a_second_signal_ends_the_program_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let mut child = endless(folder.path(), &[]);
        // Stopped, it gets both when it goes on.
        send(&child, "-STOP");
        send(&child, "-INT");
        send(&child, "-TERM");
        send(&child, "-CONT");
        let status = child.wait().expect("it ends");
        assert_eq!(status.code(), Some(130));
        let picture = folder.path().join("a.exr");
        // Signals of both kinds may also arrive too late for the second to matter; then the picture is whole.
        assert!(!picture.exists() || attribute(&picture, "stoppedBy") == text("signal"));
    }

    #[test]
    fn one_thread_is_all_that_works() {
        let folder = tempfile::tempdir().unwrap();
        let mut child = endless(folder.path(), &["--threads", "1"]);
        let status = fs::read_to_string(format!("/proc/{}/status", child.id())).expect("it runs");
        child.kill().expect("it can be ended");
        child.wait().expect("it ends");
        let threads = status.lines().find_map(|l| l.strip_prefix("Threads:")).expect("a count");
        // The main thread, the one that waits for signals, the one that works.
        assert_eq!(threads.trim(), "3");
    }

    #[test]
    fn memory_that_is_not_there_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let run = |more: &str| {
            let program = env!("CARGO_BIN_EXE_oscura");
            let line = format!("ulimit -v 3000000; exec {program} render {} -o a.png {more}", cornell());
            let output = Command::new("sh").args(["-c", &line]).current_dir(folder.path()).output();
            let output = output.expect("the shell runs");
            assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
            stderr(&output)
        };
        assert!(run("--width 16384 --height 16384").contains("9.0 GiB"));
        assert!(run("--threads 1000").contains("threads"));
        assert!(names(folder.path()).is_empty());
    }
}
