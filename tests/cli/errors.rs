//! Exit codes and error messages; no files are left behind.

use crate::program::*;
use std::fs;

#[test]
fn usage_errors_exit_with_2_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.gltf"), "not read at all").unwrap();
    for args in [
        &["render", "a.gltf", "-o", "a.bmp"][..],
        &["render", "a.gltf", "--orbit", "4"],
        &["render", "a.gltf", "-o", "a.exr", "--size", "64"],
        &["render", "a.gltf", "-o", "a.exr", "--size", "64x64", "--width", "8"],
        &["render", "a.gltf", "-o", "-", "--json", "--quiet"],
        &["render", "a.gltf", "-o", "-", "--frames", "1-2"],
        &["render", "a.gltf", "-o", "a.exr", "-o", "a.exr"],
        &["render", "a.gltf", "-o", "a.exr", "--spp", "0"],
        &["render", "a.gltf", "-o", "a.exr", "--spp", "-4"],
        &["render", "a.gltf", "-o", "a.exr", "--width", "0"],
        &["render", "a.gltf", "-o", "a.exr", "--time-limit", "-1"],
        &["render", "a.gltf", "-o", "a.exr", "--glass", "-1"],
        &["thumb", "a.gltf", "--background", "-1"],
        &["view", "a.gltf", "--port", "-1"],
        &["render", "a.gltf", "-o", "a.exr", "--filter", "lanczos"],
        &["render", "a.gltf", "-o", "a.exr", "--aov", "depth,colour"],
        &["render", "a.gltf", "-o", "a.exr", "--no-such-option"],
        &["render", "a.gltf", "-o", "a.png", "-o", "./a.png"],
        &["render", "a.gltf", "-o", "a.exr", "--width", "65536", "--height", "65536"],
        &["render", "a.gltf", "-o", "a.exr", "--exposure", "101"],
        &["render", "a.gltf", "-o", "a.exr", "--exposure", "NaN"],
        &["render", "a.gltf", "-o", "a.exr", "--env-strength", "-1"],
        &["render", "a.gltf", "-o", "a.exr", "--env-rotation", "inf"],
        &["compare", "a.exr", "b.exr", "--other-seed", "c.exr"],
        &["paint"],
    ] {
        let output = run(folder.path(), args, 2);
        let is_json = args.contains(&"--json");
        assert!(!output.stderr.is_empty() && output.stdout.is_empty() != is_json, "{args:?}");
        assert!(
            !stderr(&output).contains("'-- -"),
            "a negative number is no name of a file: {}",
            stderr(&output)
        );
    }
    assert_eq!(names(folder.path()), ["a.gltf"]);
}

#[test]
fn unsupported_inputs_are_reported_with_a_hint() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["b.max", "c.PNG", "d.png", "room.glb"] {
        fs::write(folder.path().join(name), "not read at all").unwrap();
    }
    for (args, expected, words) in [
        (&["render", "rom.glb", "-o", "x.png"][..], 3, &["rom.glb", "no such file", "room.glb"][..]),
        (&["render", "rooms/a.glb", "-o", "x.png"], 3, &["rooms/a.glb", "the folder rooms does not exist"]),
        (&["render", ".", "-o", "x.png"], 3, &["is a folder", "room.glb"]),
        (&["render", "b.max", "-o", "x.png"], 3, &["'.max'", "glTF"]),
        (&["render", "c.PNG", "-o", "x.png"], 3, &["'.png'", "picture", "scene.glb"]),
        (&["d.png"], 3, &["'.png'", "picture", "scene.glb"]),
        (&["room.glb", "--shard", "1/4"], 2, &["tip: --sample-range A..B"]),
        (&["rom.glb"], 3, &["rom.glb", "no such file", "room.glb"]),
        (&["-"], 3, &["standard input"]),
        // No error about the output of a scene that doesn't exist.
        (&["c.glb"], 3, &["c.glb", "no such file"]),
        (&["https://example.com/a.glb"], 3, &["download the file"]),
        (&["room"], 2, &["neither a command nor a file", "scenes of that name: room.glb"]),
        (&["rendr"], 2, &["neither a command nor a file", "'render'"]),
        (&["room.glb", "--watch"], 2, &["'--watch' is an option of 'oscura view'"]),
        (&["room.glb", "--view"], 2, &["'oscura view SCENE'"]),
        (&["room.glb", "--hdri", "sky.exr"], 2, &["tip: --env FILE"]),
        (&["room.glb", "--frame", "3"], 2, &["tip: --frames A-B"]),
        (&["--versoin"], 2, &["'oscura --version'"]),
        (&["room.glb", "-o", "./"], 2, &["./ is a folder", "'FOLDER/{stem}.png'"]),
        (&["room.glb", "--spp", "many"], 2, &["must be a whole number, 1 or more"]),
        (&["room.glb", "--width", "0"], 2, &["must be a whole number from 1 to 65536"]),
        (&["room.glb", "--clamp", "3"], 2, &["direct=5,indirect=5"]),
        (
            &["room.glb", "--env", "sky.exr", "-o", "x.png"],
            3,
            &["sky.exr can't be read: there is no such file"],
        ),
        (&["merge", "a.part", "a.part", "-o", "x.exr"], 3, &["a.part is given twice"]),
        (&["--spp", "4", "rom.glb"], 3, &["rom.glb", "no such file", "room.glb"]),
    ] {
        let output = run(folder.path(), args, expected);
        let messages = stderr(&output).split_whitespace().collect::<Vec<_>>().join(" ");
        for word in words {
            assert!(messages.contains(word), "{args:?}: {word}: {messages}");
        }
    }
    assert_eq!(names(folder.path()), ["b.max", "c.PNG", "d.png", "room.glb"]);
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

/// Names of broken inputs, their content, and words required in the error besides the name.
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
        ("scene.abcd", b"?".to_vec(), &[".gltf", ".blend"]),
        ("scene.xyz", b"0 0 0\n".to_vec(), &["CloudCompare", ".ply"]),
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
        says(&run(folder.path(), command, 3), "--allow-external");
        run(folder.path(), &[command, &["--allow-external"]].concat(), 0);
    }
}

#[test]
fn unwritable_outputs_exit_with_4_before_the_scene_is_read() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("folder.png")).unwrap();
    for target in ["no/such/folder/a.exr", "folder.png"] {
        says(&run(folder.path(), &["render", "missing.gltf", "-o", target], 4), target);
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
    // Also for invalid arguments.
    let output = oscura(folder.path(), &["render", "a.gltf", "-o", "a.exr", "--json", "--spp", "0"]);
    let value: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
    assert_eq!((&value["error"]["exit_code"], code(&output)), (&2.into(), 2));
    assert!(value.to_string().contains("--spp"), "{value}");
}

#[test]
fn long_lines_are_cut_in_errors() {
    let folder = tempfile::tempdir().unwrap();
    let long = format!("no_such_key = [{}]\n", "0, ".repeat(100_000));
    fs::write(folder.path().join("a.toml"), long).unwrap();
    let output = run(folder.path(), &["render", "a.toml", "-o", "a.exr"], 3);
    let text = stderr(&output);
    assert!(
        text.contains("no_such_key") && text.contains("a.toml:1:") && text.len() < 2000,
        "{} bytes",
        text.len()
    );
}

/// A mistake repeated in every object is reported for the first ones, and counted; other mistakes are reported next to it.
#[test]
fn repeated_mistakes_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let ball = |i: u32| {
        format!("[[objects]]\nsphere = {{ center = [{i}, 0, 0], radius = 1 }}\nmaterial = \"missing{i}\"\n")
    };
    let balls: String = (0..200).map(ball).collect();
    let scene = format!(
        "camera = {{ look_from = [0, 0, 4], look_at = [0, 0, 0] }}\n{balls}[[objects]]\nsphere = {{ radius = 1 }}\n"
    );
    fs::write(folder.path().join("a.toml"), scene).unwrap();
    let output = run(folder.path(), &["render", "a.toml", "-o", "a.exr"], 3);
    let messages = stderr(&output);
    assert!(messages.contains("195") && messages.contains("center"), "{messages}");
    assert!(messages.contains("missing4") && !messages.contains("missing5"), "{messages}");
    assert!(messages.contains("a.toml:4:"), "{messages}");
    // JSON lists them all.
    let output = oscura(folder.path(), &["render", "a.toml", "-o", "a.exr", "--json"]);
    assert!(stdout(&output).contains("missing199"), "{}", stdout(&output));
}

/// A missing file is one problem, however many references it has.
#[test]
fn missing_files_are_reported_once_with_a_hint() {
    let folder = tempfile::tempdir().unwrap();
    let uses = |table: &str, key: &str, file: &str| {
        format!("[[{table}]]\n{key} = \"{file}\"\nmaterial = \"m\"\n").repeat(3)
    };
    let head =
        "camera = { look_from = [0, 0, 4], look_at = [0, 0, 0] }\nmaterials.m = { type = \"lambert\" }\n";
    for (table, key, file) in [("curves", "file", "no.hair"), ("objects", "mesh", "no.obj")] {
        fs::write(folder.path().join("a.toml"), format!("{head}{}", uses(table, key, file))).unwrap();
        let output = run(folder.path(), &["render", "a.toml", "-o", "a.exr", "--json"], 3);
        assert_eq!(
            report(&output)["error"]["problems"].as_array().map(Vec::len),
            Some(1),
            "{}",
            stdout(&output)
        );
        assert!(stderr(&output).contains(file) && stderr(&output).contains("help:"), "{}", stderr(&output));
    }
}

#[test]
fn closed_pipes_are_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_oscura"))
        .args(["render", &cornell(), "-o", "a.png", "--width", "16", "--spp", "1", "--json", "--explain"])
        .current_dir(folder.path())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("the program starts");
    drop((child.stdout.take(), child.stderr.take()));
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert!(folder.path().join("a.png").exists());
}

/// Failing to write to standard output is an error.
#[cfg(target_os = "linux")]
#[test]
fn failing_standard_output_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let small = ["render", &scene, "-o", "a.png", "--width", "8", "--height", "8", "--spp", "1", "--json"];
    for args in [&small[..], &["inspect", &scene, "--json"]] {
        let full = fs::File::options().write(true).open("/dev/full").expect("Linux has it");
        let mut program = std::process::Command::new(env!("CARGO_BIN_EXE_oscura"));
        let output = program.args(args).current_dir(folder.path()).stdout(full).output().expect("it starts");
        assert_eq!(code(&output), 4, "{args:?}: {}", stderr(&output));
        assert!(!stderr(&output).is_empty(), "{args:?}");
    }
}

/// A nearly black picture is reported, with an exposure that shows it.
#[test]
fn nearly_black_pictures_are_reported_with_an_exposure() {
    let folder = tempfile::tempdir().unwrap();
    let bright = render(folder.path(), "a.png", &[]);
    assert!(!stderr(&bright).contains("--exposure"), "{}", stderr(&bright));
    let dark = render(folder.path(), "b.png", &["--exposure", "-12"]);
    assert!(stderr(&dark).contains("--exposure"), "{}", stderr(&dark));
    let messages = stderr(&dark);
    let stops = messages.split("--exposure ").nth(1).and_then(|rest| rest.split([';', '\n']).next());
    let stops: f64 = stops.and_then(|stops| stops.parse().ok()).expect("a number of stops");
    assert!((-4.0..=4.0).contains(&stops), "{messages}");
}
