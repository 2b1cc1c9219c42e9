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
