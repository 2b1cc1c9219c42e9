//! `oscura view`: the requests of its page, and the page itself in a browser where available.

use crate::program::*;
use crate::skip::skip;
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const SCENE: &str = r#"
[camera]
look_from = [0, 0, 4]
look_at = [0, 0, 0]
vfov = 40
[environment]
background = [0.5, 0.5, 0.5]
[materials.ball]
type = "emissive"
radiance = [1, 0, 0]
[[objects]]
sphere = { center = [0, 0, 0], radius = 0.5 }
material = "ball"
"#;

/// A viewer of `scene.toml` in a folder of its own.
struct View {
    folder: tempfile::TempDir,
    child: Child,
    port: u16,
    /// The path of the page, without the slash at its end.
    path: String,
}

impl View {
    fn new(more: &[&str]) -> View {
        View::start(&[&["view", "scene.toml", "--no-open", "--spp", "4"], more].concat())
    }

    fn start(arguments: &[&str]) -> View {
        View::of(&[("scene.toml", SCENE)], arguments)
    }

    fn of(files: &[(&str, &str)], arguments: &[&str]) -> View {
        let folder = tempfile::tempdir().unwrap();
        files.iter().for_each(|(name, text)| fs::write(folder.path().join(name), text).unwrap());
        let mut child = Command::new(env!("CARGO_BIN_EXE_oscura"))
            .args(arguments)
            .args(["--width", "64", "--height", "48"])
            .args(
                arguments
                    .first()
                    .filter(|first| **first == "view" && !arguments.contains(&"--denoise"))
                    .map(|_| "--no-denoise"),
            )
            .current_dir(folder.path())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
        let line = lines.find_map(|line| line.ok().filter(|l| l.contains("http://"))).expect("an address");
        // A client that isn't read could not continue.
        std::thread::spawn(move || lines.for_each(drop));
        let place = line.split("127.0.0.1:").nth(1).and_then(|rest| rest.split("/ ").next()).unwrap();
        let (port, key) = place.split_once('/').unwrap();
        View { folder, child, port: port.parse().unwrap(), path: format!("/{key}") }
    }

    /// A connection after sending something.
    fn send(&self, text: &str) -> TcpStream {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        // A client rejected early may not send everything.
        stream.write_all(text.as_bytes()).ok();
        stream
    }

    /// Status and body.
    fn ask(&self, method: &str, path: &str, body: &str, headers: &[&str]) -> (u16, Vec<u8>) {
        self.ask_outside(method, &format!("{}{path}", self.path), body, headers)
    }

    /// Status and body for a path without the page's key.
    fn ask_outside(&self, method: &str, path: &str, body: &str, headers: &[&str]) -> (u16, Vec<u8>) {
        let own = format!("Host: 127.0.0.1:{}", self.port);
        let headers = if headers.is_empty() { own } else { headers.join("\r\n") };
        let length = body.len();
        let text = format!("{method} {path} HTTP/1.0\r\n{headers}\r\nContent-Length: {length}\r\n\r\n{body}");
        answer(self.send(&text))
    }

    fn post(&self, path: &str, body: &str) {
        let (status, answer) = self.ask("POST", path, body, &[]);
        assert_eq!(status, 200, "{path} {body}: {}", String::from_utf8_lossy(&answer));
    }

    /// The state and the pixels, once the state satisfies the predicate.
    fn wait(&self, suits: impl Fn(&Value) -> bool) -> (Value, Vec<u8>) {
        let (start, mut version) = (Instant::now(), 0);
        loop {
            assert!(start.elapsed() < Duration::from_secs(60), "nothing that suits");
            let (status, body) = self.ask("GET", &format!("/frame?after={version}"), "", &[]);
            if status == 204 {
                continue;
            }
            let length = u32::from_le_bytes(body[..4].try_into().unwrap()) as usize;
            let state: Value = serde_json::from_slice(&body[4..4 + length]).unwrap();
            version = state["version"].as_u64().unwrap();
            if suits(&state) {
                return (state, body[4 + length..].to_vec());
            }
        }
    }

    /// The finished picture.
    fn finished(&self) -> (Value, Vec<u8>) {
        self.wait(|state| state["finished"] == true)
    }
}

impl Drop for View {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

/// Status and body of a complete response.
fn answer(mut stream: TcpStream) -> (u16, Vec<u8>) {
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let end = answer.windows(4).position(|w| w == b"\r\n\r\n").expect("a header");
    let status = String::from_utf8_lossy(&answer[..end]).split(' ').nth(1).unwrap().parse().unwrap();
    (status, answer[end + 4..].to_vec())
}

fn pixel(pixels: &[u8], x: usize, y: usize) -> [u8; 4] {
    pixels[(y * 64 + x) * 4..][..4].try_into().unwrap()
}

#[test]
fn progressive_refinement_orbit_and_probe() {
    let view = View::new(&[]);
    let (state, pixels) = view.finished();
    assert_eq!((&state["width"], &state["height"], &state["samples"]), (&64.into(), &48.into(), &4.0.into()));
    assert_eq!(pixel(&pixels, 32, 24), [255, 0, 0, 255]);
    assert_eq!(pixel(&pixels, 1, 1), [188, 188, 188, 255]);
    let (status, body) = view.ask("GET", "/probe?x=0.5&y=0.5", "", &[]);
    let probe: Value = serde_json::from_slice(&body).unwrap();
    assert_eq!((status, &probe["values"]["R"]), (200, &1.0.into()));
    assert!((probe["values"]["Z"].as_f64().unwrap() - 3.5).abs() < 0.02, "{probe}");
    assert_eq!(view.ask("GET", "/probe?x=2&y=0.5", "", &[]).0, 404);

    // Panning by half a picture moves the sphere to the edge; no other page needs to ask for it.
    view.post("/move", r#"{"pan": [0.5, 0]}"#);
    let (state, moved) = view.finished();
    assert_eq!(pixel(&moved, 32, 24), [188, 188, 188, 255]);
    let command = state["command"].as_str().unwrap();
    assert!(command.contains("--eye ") && command.contains("--target "), "{command}");
    view.post("/camera", "0");
    assert_eq!(view.finished().1, pixels);
    view.post("/set", r#"{"exposure": -1}"#);
    let (_, darker) = view.wait(|state| state["exposure"] == -1.0 && state["finished"] == true);
    assert!(pixel(&darker, 1, 1)[0] < 150);
    view.post("/set", r#"{"pass": "normal"}"#);
    let (_, normals) = view.wait(|state| state["pass"] == "normal" && state["finished"] == true);
    assert!(pixel(&normals, 32, 24)[2] > 250, "the ball faces the camera");
    for nonsense in [r#"{"exposure": 1e9}"#, r#"{"pass": "none"}"#, r#"{"size": [1, 1]}"#, "{", r#"{"a": 1}"#]
    {
        assert_eq!(view.ask("POST", "/set", nonsense, &[]).0, 400, "{nonsense}");
    }
}

/// Runs the command that a page shows; it must give the page's picture.
fn assert_command_renders(view: &View, (state, shown): (Value, Vec<u8>)) {
    let command = state["command"].as_str().unwrap();
    let words: Vec<&str> = command.split(' ').skip(1).collect();
    let output = oscura(view.folder.path(), &words);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let rendered = image::open(view.folder.path().join("picture.png")).unwrap().into_rgba8();
    // The camera position is rounded to seven digits.
    let differ = rendered.as_raw().iter().zip(&shown).filter(|(a, b)| a.abs_diff(**b) > 2).count();
    assert!(differ <= shown.len() / 200, "{differ} of {} bytes differ: {command}", shown.len());
}

#[test]
fn command_reproduces_the_view() {
    let view = View::new(&[]);
    view.finished();
    view.post("/move", r#"{"orbit": [0.5, 0.25], "pan": [0.1, 0.05]}"#);
    assert_command_renders(&view, view.finished());
}

#[test]
fn command_contains_the_arguments() {
    let scene = SCENE.replace("[camera]", "[render]\nexposure = 2\nview = \"agx\"\nsamples = 1\n[camera]");
    let arguments = "view scene.toml --no-open --eye 1,2,3 --target 0.2,0,0 --defocus 8 --fov 50";
    let arguments: Vec<&str> = arguments.split(' ').collect();
    let view = View::of(&[("scene.toml", &scene)], &arguments);
    let (state, _) = view.wait(|state| state["samples"].as_f64().is_some_and(|n| n >= 1.0));
    assert_eq!(state["view"], "agx", "the scene's");
    view.post("/set", r#"{"view": "srgb"}"#);
    let (_, pixels) = view.wait(|state| state["view"] == "srgb");
    assert_eq!(pixel(&pixels, 1, 1), [255, 255, 255, 255], "by the scene's exposure");
    view.post("/set", r#"{"exposure": 0}"#);
    let (state, shown) = view.wait(|state| state["exposure"] == 0.0 && state["finished"] == true);
    assert_command_renders(&view, (state, shown));
}

#[test]
fn intermediate_pictures_can_be_saved() {
    let view = View::new(&[]);
    view.finished();
    let (status, exr) = view.ask("GET", "/picture.exr", "", &[]);
    assert_eq!((status, &exr[..4]), (200, &[0x76, 0x2f, 0x31, 0x01][..]));
    assert_eq!(&view.ask("GET", "/picture.png", "", &[]).1[1..4], b"PNG");
    for page in ["/", "/page.css", "/page.js", "/gestures.js", "/materials.js", "/picture.js", "/icon.svg"] {
        assert_eq!(view.ask("GET", page, "", &[]).0, 200, "{page}");
    }
    assert_eq!(view.ask("GET", "/../Cargo.toml", "", &[]).0, 404);
}

/// A grey sphere under a sky, with noisy pixels.
fn noisy_scene() -> String {
    let scene =
        SCENE.replace("background = [0.5, 0.5, 0.5]", "sky = { nadir = [0, 0, 0], zenith = [1, 2, 4] }");
    scene.replace("type = \"emissive\"\nradiance = [1, 0, 0]", "type = \"lambert\"\ncolor = [0.8, 0.8, 0.8]")
}

/// Mean difference of neighbours within the sphere.
fn roughness(pixels: &[u8]) -> f64 {
    let places = || (18..30).flat_map(|y| (26..38).map(move |x| (x, y)));
    let step = |(x, y)| f64::from(pixel(pixels, x, y)[1].abs_diff(pixel(pixels, x + 1, y)[1]));
    places().map(step).sum::<f64>() / places().count() as f64
}

#[test]
fn denoising_can_be_switched_on() {
    let view = View::of(
        &[("scene.toml", &noisy_scene())],
        &["view", "scene.toml", "--no-open", "--spp", "4", "--denoise"],
    );
    let is_denoised = |state: &Value| state["finished"] == true && state["denoised"] == 4.0;
    let (state, smooth) = view.wait(is_denoised);
    assert!(state["command"].as_str().unwrap().contains(" --denoise "), "{state}");
    let (_, exr) = view.ask("GET", "/picture.exr", "", &[]);
    let file = view.folder.path().join("saved.exr");
    fs::write(&file, exr).unwrap();
    assert!(format!("{:?}", attribute(&file, "denoised")).contains("guides"), "the file tells");
    view.post("/set", r#"{"split": 0.5}"#);
    let (_, halved) = view.wait(|state| state["split"] == 0.5);
    view.post("/set", r#"{"denoise": false}"#);
    let (state, noisy) = view.wait(|state| state["denoise"] == false);
    assert!(
        state["denoised"].is_null() && state["command"].as_str().unwrap().contains(" --no-denoise "),
        "{state}"
    );
    assert!(roughness(&smooth) < 0.6 * roughness(&noisy), "{} {}", roughness(&smooth), roughness(&noisy));
    for (x, of) in [(31, &noisy), (32, &smooth)] {
        assert!((0..48).all(|y| pixel(&halved, x, y) == pixel(of, x, y)), "column {x}");
    }
    assert_eq!(view.ask("POST", "/set", r#"{"split": 2}"#, &[]).0, 400);
}

#[test]
fn objects_have_outlines_and_names() {
    let scene = SCENE.replace("[[objects]]", "[[objects]]\nname = \"red ball\"");
    let view = View::of(&[("scene.toml", &scene)], &["view", "scene.toml", "--no-open", "--spp", "1"]);
    view.finished();
    let (status, body) = view.ask("GET", "/outline?x=0.5&y=0.5", "", &[]);
    let outline: Value = serde_json::from_slice(&body).expect("an outline");
    assert_eq!(
        (status, &outline["name"], &outline["width"]),
        (200, &"red ball".into(), &64.into()),
        "{outline}"
    );
    assert!(outline["path"].as_str().unwrap().starts_with('M'), "{outline}");
    for nowhere in ["x=0.01&y=0.01", "x=2&y=0", "x=0.5", ""] {
        assert_eq!(view.ask("GET", &format!("/outline?{nowhere}"), "", &[]).0, 404, "{nowhere}");
    }
}

/// A tetrahedron in front of the camera with two materials, one in a library next to it.
const PAINTED: &str = "mtllib m.mtl\nusemtl red paint\nv -1 -1 0\nv 1 -1 0\nv 0 1 0\nv 0 0 1\nf 1 2 4\nf 2 3 4\nf 3 1 4\nf 2 1 3\n";

#[test]
fn material_edits_undo_and_save_to_a_sidecar() {
    let files = [
        ("model.obj", PAINTED),
        ("m.mtl", "newmtl red paint\nKd 0.8 0.05 0.05\nKs 0.5 0.5 0.5\nNs 50\nillum 2\n"),
        ("model.oscura.toml", "# Mine.\n[render]\nexposure = 0.5\n"),
    ];
    let view = View::of(
        &files,
        &["view", "model.obj", "--no-open", "--spp", "2", "--up", "y", "--view-from", "front"],
    );
    let (state, red) = view.finished();
    assert_eq!((&state["undo"], &state["toml"]), (&0.into(), &"".into()), "{state}");
    assert_eq!(state["scene_info"]["sidecar"], "model.oscura.toml");
    let (status, body) = view.ask("GET", "/material?x=0.5&y=0.5", "", &[]);
    let found: Value = serde_json::from_slice(&body).expect("a material");
    assert_eq!(
        (status, &found["name"], &found["is_editable"]),
        (200, &"red paint".into(), &true.into()),
        "{found}"
    );
    assert_eq!(view.ask("GET", "/material?x=0.5&y=0.01", "", &[]).0, 404, "the background");

    let is_shown = |undo: u64| move |state: &Value| state["undo"] == undo && state["finished"] == true;
    view.post("/set", r#"{"material": ["red paint", {"base_color": [0.05, 0.05, 0.8]}]}"#);
    view.post("/set", r#"{"material": ["red paint", {"base_color": [0.02, 0.02, 0.9]}], "is_same": true}"#);
    let (state, blue) = view.wait(is_shown(1));
    let middle = |pixels: &[u8]| pixel(pixels, 32, 24);
    assert!(
        middle(&red)[0] > middle(&red)[2] && middle(&blue)[2] > middle(&blue)[0],
        "{:?} {:?}",
        middle(&red),
        middle(&blue)
    );
    assert_eq!(state["toml"], "[materials.\"red paint\"]\nbase_color = [0.02, 0.02, 0.9]\n");
    view.post("/set", r#"{"material": ["red paint", {"roughness": 0.2, "emission": 3}]}"#);
    view.wait(is_shown(2));
    view.post("/undo", "");
    let (_, again) = view.wait(is_shown(1));
    assert_eq!(again, blue, "as before");

    // Once saved, a render shows the same, and the file keeps its contents.
    view.post("/save", "");
    let text = fs::read_to_string(view.folder.path().join("model.oscura.toml")).unwrap();
    assert_eq!(
        text,
        "# Mine.\n[render]\nexposure = 0.5\n\n[materials.\"red paint\"]\nbase_color = [0.02, 0.02, 0.9]\n"
    );
    assert_command_renders(&view, view.wait(is_shown(0)));
    assert_eq!(view.ask("POST", "/undo", "", &[]).0, 400);
    for nonsense in [
        r#"{"material": ["red paint", {"roughness": 2}]}"#,
        r#"{"material": ["red paint", {"ior": 2}]}"#,
        r#"{"strength": 0}"#,
    ] {
        assert_eq!(view.ask("POST", "/set", nonsense, &[]).0, 400, "{nonsense}");
    }
    fs::write(view.folder.path().join("model.oscura.toml"), "materials.\"red paint\" = { ior = 1.4 }\n")
        .unwrap();
    assert_eq!(view.ask("POST", "/save", "", &[]).0, 400, "the same table in another form");
}

#[test]
fn scene_file_lines_and_environment_strength() {
    let view = View::new(&[]);
    let (state, before) = view.finished();
    assert!(state["scene_info"]["sidecar"].is_null() && state["strength"] == 1.0, "{state}");
    view.post("/set", r#"{"material": ["ball", {"emission": 0.25}], "strength": 0.5}"#);
    let (state, after) = view.wait(|state| state["undo"] == 1 && state["finished"] == true);
    assert_eq!(state["toml"], "[materials.ball]\ntype = \"emissive\"\nradiance = [0.25, 0.0, 0.0]\n");
    assert!(pixel(&after, 1, 1)[0] < 145 && pixel(&after, 32, 24)[0] < 145, "both are darker");
    assert!(state["command"].as_str().unwrap().contains("--env-strength 0.5"), "{state}");
    assert_eq!(view.ask("POST", "/save", "", &[]).0, 400, "the scene's own file is the user's");
    view.post("/undo", "");
    assert_eq!(view.wait(|state| state["undo"] == 0 && state["finished"] == true).1, before);
    view.post("/set", r#"{"strength": 0.5}"#);
    assert_command_renders(&view, view.wait(|state| state["strength"] == 0.5 && state["finished"] == true));
}

/// A wall in front of the camera and a green light in front of it.
const LIT: &str = r#"{
    "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1, 2]}],
    "extensionsUsed": ["KHR_lights_punctual"],
    "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 1000, "color": [0, 1, 0]}]}},
    "nodes": [{"mesh": 0, "scale": [9, 9, 1], "translation": [-3, -3, 0]}, {"camera": 0, "translation": [0, 0, 5]},
        {"name": "bulb", "translation": [0, 0, 2], "extensions": {"KHR_lights_punctual": {"light": 0}}}],
    "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]
}"#;

#[test]
fn light_edits_are_saved_to_a_sidecar() {
    let sidecar = "[[lights]]\nname = \"key\"\narea = { center = [3, 3, 4], target = [0, 0, 0], size = [1, 1], power = 1 }\n";
    let files = [("room.gltf", LIT), ("room.oscura.toml", sidecar)];
    let view = View::of(&files, &["view", "room.gltf", "--no-open", "--spp", "4"]);
    let (state, before) = view.finished();
    let lights: Vec<_> =
        state["lights"].as_array().unwrap().iter().map(|l| (&l["name"], &l["unit"])).collect();
    assert_eq!(lights, [(&"bulb".into(), &"W/sr".into()), (&"key".into(), &"W/sr/m²".into())], "{state}");
    let strength = state["lights"][0]["strength"].as_f64().unwrap();

    let is_shown = |undo: u64| move |state: &Value| state["undo"] == undo && state["finished"] == true;
    view.post("/set", r#"{"light": ["bulb", {"strength": 0}]}"#);
    let (_, off) = view.wait(is_shown(1));
    let green = |pixels: &[u8]| pixel(pixels, 32, 24)[1];
    assert!(green(&off) < green(&before), "{} {}", green(&off), green(&before));
    let half = 0.5 * strength;
    view.post("/set", &format!(r#"{{"light": ["bulb", {{"strength": {half}, "color": [1, 0, 0]}}]}}"#));
    view.post("/set", r#"{"light": ["key", {"strength": 0}]}"#);
    let (state, red) = view.wait(is_shown(3));
    let [r, g, b, _] = pixel(&red, 32, 24);
    assert!(r > 30 && g == 0 && b == 0, "red alone: {r} {g} {b}");
    assert_eq!(state["lights"][0]["color"], serde_json::json!([1.0, 0.0, 0.0]));

    // Once saved, a render shows the same; after undo everything is as before.
    view.post("/save", "");
    let text = fs::read_to_string(view.folder.path().join("room.oscura.toml")).unwrap();
    let added = text.strip_prefix(sidecar).expect("the light is as it was");
    assert!(added.contains("[[lights]]\nname = \"key\"\nradiance = 0.0\n"), "{added}");
    assert!(added.contains("name = \"bulb\"\nintensity = ") && added.contains("color = [1.0, 0.0, 0.0]"));
    assert_command_renders(&view, view.wait(is_shown(0)));
    for nonsense in
        [r#"{"light": ["bulb", {"strength": -1}]}"#, r#"{"light": ["bulb", {"color": [2, 0, 0]}]}"#]
    {
        assert_eq!(view.ask("POST", "/set", nonsense, &[]).0, 400, "{nonsense}");
    }
}

#[test]
fn passes_have_thumbnails() {
    let view = View::new(&[]);
    view.finished();
    for (pass, shown) in [("", [255, 0, 0, 255]), ("normal", [128, 128, 255, 255])] {
        let (status, body) = view.ask("GET", &format!("/thumbnail?pass={pass}"), "", &[]);
        assert_eq!(status, 200, "{pass}");
        let length = u32::from_le_bytes(body[..4].try_into().unwrap()) as usize;
        let reported: Value = serde_json::from_slice(&body[4..4 + length]).unwrap();
        assert_eq!((&reported["width"], &reported["height"]), (&64.into(), &48.into()));
        let middle = pixel(&body[4 + length..], 32, 24);
        assert!(middle.iter().zip(shown).all(|(a, b)| a.abs_diff(b) < 8), "{pass}: {middle:?}");
    }
    for none in ["roughness", "nonsense"] {
        assert_eq!(view.ask("GET", &format!("/thumbnail?pass={none}"), "", &[]).0, 404, "{none}");
    }
    // Recorded passes are shown without rendering again.
    let (state, _) = view.finished();
    view.post("/set", r#"{"pass": "albedo"}"#);
    let (after, _) = view.wait(|state| state["pass"] == "albedo");
    assert_eq!((&after["request_number"], &after["finished"]), (&state["request_number"], &true.into()));
}

#[test]
fn stage_and_up_axis_can_be_changed() {
    let mesh = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv 0 0 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n";
    let view =
        View::of(&[("model.obj", mesh)], &["view", "model.obj", "--no-open", "--spp", "1", "--up", "y"]);
    let (state, studio) = view.finished();
    assert_eq!((&state["stage"], &state["up"]), (&"studio".into(), &"y".into()), "{state}");
    view.post("/set", r#"{"stage": "sunset"}"#);
    let (state, sunset) = view.wait(|state| state["stage"] == "sunset" && state["finished"] == true);
    let warmth = |pixels: &[u8]| i32::from(pixel(pixels, 2, 2)[0]) - i32::from(pixel(pixels, 2, 2)[2]);
    assert!(warmth(&sunset) > warmth(&studio) + 10, "{} {}", warmth(&sunset), warmth(&studio));
    assert_eq!(state["command"].as_str().unwrap().matches("--stage sunset").count(), 1, "{state}");
    view.post("/set", r#"{"up": "z"}"#);
    let (state, _) = view.wait(|state| state["up"] == "z" && state["finished"] == true);
    let command = state["command"].as_str().unwrap();
    assert!(command.contains("--up=z") && command.matches("--up").count() == 1, "{command}");
    for nonsense in [r#"{"up": "w"}"#, r#"{"stage": "moon"}"#] {
        assert_eq!(view.ask("POST", "/set", nonsense, &[]).0, 400, "{nonsense}");
    }
    let toml = View::new(&[]);
    let (state, _) = toml.finished();
    assert!(state["stage"].is_null() && state["up"].is_null(), "nothing to choose: {state}");
}

#[test]
fn malformed_slow_and_idle_clients() {
    let view = View::new(&["--threads", "2"]);
    let head = format!("POST {}/set HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n", view.path, view.port);
    let slow = view.send(&head);
    let lie = "Content-Length: 100000000000000\r\n\r\n";
    assert_eq!(answer(view.send(&format!("{head}{lie}"))).0, 413);
    assert_eq!(answer(view.send(&format!("POST /set HTTP/1.1\r\nHost: evil\r\n{lie}"))).0, 413);
    assert_eq!(answer(view.send(&format!("{head}Content-Length: -1\r\n\r\n"))).0, 400);
    assert_eq!(answer(view.send(&format!("{head}A: {}\r\n\r\n", "a".repeat(100_000)))).0, 431);
    assert_eq!(answer(view.send("GET / HTTP/1.1\r\nno header\r\n\r\n")).0, 400);

    // Requests without their bodies, and idle connections.
    let start = Instant::now();
    let waiting: Vec<TcpStream> = (0..150)
        .map(|i| {
            view.send(&if i % 2 == 0 { format!("{head}Content-Length: 5000\r\n\r\n") } else { String::new() })
        })
        .collect();
    assert_eq!(view.ask("GET", "/", "", &[]).0, 200);
    view.post("/set", r#"{"exposure": 0}"#);
    assert!(start.elapsed() < Duration::from_secs(4), "others don't wait for them: {:?}", start.elapsed());
    // On Linux: the threads of dropped connections end.
    let threads = || {
        let status = fs::read_to_string(format!("/proc/{}/status", view.child.id())).ok()?;
        status.lines().find_map(|line| line.strip_prefix("Threads:"))?.trim().parse::<u32>().ok()
    };
    while threads().is_some_and(|n| n > 100) {
        assert!(start.elapsed() < Duration::from_secs(4), "{:?} threads", threads());
    }
    drop(waiting);
    // The first of them was closed when others came, or after a timeout.
    let mut nothing = Vec::new();
    (&slow).read_to_end(&mut nothing).ok();
    assert!(nothing.is_empty());
    let alone = view.send(&head);
    let start = Instant::now();
    (&alone).read_to_end(&mut nothing).ok();
    assert!(nothing.is_empty() && start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
}

#[test]
fn requests_without_the_key_are_refused() {
    let view = View::new(&[]);
    let other = format!("/{}/", "0".repeat(32));
    for path in ["/", "/frame?after=0", "/open/", &other] {
        assert_eq!(view.ask_outside("GET", path, "", &[]).0, 403, "{path}");
    }
    assert_eq!(view.ask_outside("POST", "/set", r#"{"exposure": 1}"#, &[]).0, 403);
    assert_eq!(view.ask_outside("GET", &view.path, "", &[]).0, 303);
    assert_eq!(view.ask("GET", "/", "", &[]).0, 200);
}

#[test]
fn other_hosts_and_origins_are_refused() {
    let view = View::new(&[]);
    let own = format!("Host: localhost:{}", view.port);
    assert_eq!(view.ask("GET", "/", "", &[&own]).0, 200);
    for headers in [
        &["Host: evil.example"][..],
        &[&own, "Origin: http://evil.example"],
        &[&own, "Sec-Fetch-Site: cross-site"],
        &["Accept: */*"],
    ] {
        assert_eq!(view.ask("GET", "/frame?after=0", "", headers).0, 403, "{headers:?}");
        assert_eq!(view.ask("POST", "/reload", "", headers).0, 403, "{headers:?}");
    }
}

#[test]
fn changed_scenes_are_reloaded_and_errors_reported() {
    let view = View::new(&["--watch"]);
    let file = view.folder.path().join("scene.toml");
    view.finished();
    fs::write(&file, "[camera").unwrap();
    let is_told = |state: &Value| state["error_message"].as_str().is_some_and(|t| t.contains("scene.toml"));
    let (_, pixels) = view.wait(|state| is_told(state) && state["finished"] == true);
    assert_eq!(pixel(&pixels, 32, 24), [255, 0, 0, 255], "the old picture stays, and goes on");
    view.post("/move", r#"{"pan": [0.5, 0]}"#);
    let (state, _) = view.finished();
    assert!(is_told(&state), "the scene is still broken: {state}");
    view.post("/camera", "0");
    fs::write(&file, SCENE.replace("[1, 0, 0]", "[0, 1, 0]")).unwrap();
    let (state, pixels) = view.wait(|state| state["error_message"] == "" && state["finished"] == true);
    assert_eq!(pixel(&pixels, 32, 24), [0, 255, 0, 255], "{state}");
}

#[test]
fn unrelated_files_trigger_no_reload() {
    let view = View::new(&["--watch"]);
    let (state, _) = view.finished();
    for name in ["picture.png", "picture.exr", "other.toml"] {
        fs::write(view.folder.path().join(name), "no part of the scene").unwrap();
    }
    std::thread::sleep(Duration::from_millis(1300));
    assert_eq!(view.wait(|_| true).0["version"], state["version"]);
}

#[test]
fn uv_pass_of_meshes_without_textures() {
    let mesh = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";
    let scene = SCENE.replace("sphere = { center = [0, 0, 0], radius = 0.5 }", "mesh = \"quad.obj\"");
    let files = [("scene.toml", scene.as_str()), ("quad.obj", mesh)];
    let view = View::of(&files, &["view", "scene.toml", "--no-open", "--spp", "4"]);
    view.finished();
    view.post("/set", r#"{"pass": "uv"}"#);
    let (_, pixels) = view.wait(|state| state["pass"] == "uv" && state["finished"] == true);
    let (left, right) = (pixel(&pixels, 20, 24), pixel(&pixels, 44, 24));
    assert!(left[0] + 100 < right[0], "u grows to the right: {left:?} {right:?}");
}

#[test]
fn oversized_scenes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    // A sparse file.
    let file = fs::File::create(folder.path().join("scene.glb")).unwrap();
    if file.set_len(1 << 43).is_err() {
        return skip("large-files", "this disk holds no files of 8 TiB");
    }
    let output = oscura(folder.path(), &["view", "scene.glb", "--no-open"]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("memory"), "{}", stderr(&output));
}

#[test]
fn signals_end_the_viewer_cleanly() {
    let mut view = View::new(&[]);
    let status = Command::new("kill").args(["-INT", &view.child.id().to_string()]).status();
    assert!(status.expect("kill runs").success());
    assert_eq!(view.child.wait().unwrap().code(), Some(0));
}

#[test]
fn running_renders_can_be_viewed() {
    let mut view =
        View::start(&["render", "scene.toml", "-o", "a.exr", "--spp", "100000000", "--preview=address"]);
    let (state, pixels) = view.wait(|state| state["samples"].as_f64().is_some_and(|n| n >= 8.0));
    assert_eq!(pixel(&pixels, 32, 24), [255, 0, 0, 255]);
    assert_eq!(state["scene_info"]["is_live"], false);
    for (path, body) in [("/move", r#"{"orbit": [1, 0]}"#), ("/reload", ""), ("/camera", "0")] {
        assert_eq!(view.ask("POST", path, body, &[]).0, 403, "{path}");
    }
    assert_eq!(view.ask("POST", "/set", r#"{"size": [64, 48]}"#, &[]).0, 400);
    view.post("/set", r#"{"exposure": -1}"#);
    let (_, darker) = view.wait(|state| state["exposure"] == -1.0);
    assert!(pixel(&darker, 1, 1)[0] < 150);
    let status = Command::new("kill").args(["-INT", &view.child.id().to_string()]).status();
    assert!(status.expect("kill runs").success());
    assert_eq!(view.child.wait().unwrap().code(), Some(130));
    assert_eq!(attribute(&view.folder.path().join("a.exr"), "stoppedBy"), text("signal"));
}

#[test]
fn invalid_options_and_used_ports_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    for unused in [&["-o", "a.png"][..], &["--frames", "1-2"], &["--json"], &["--orbit", "8"]] {
        let arguments = [&["view", "scene.toml", "--no-open"][..], unused].concat();
        let output = oscura(folder.path(), &arguments);
        assert_eq!(output.status.code(), Some(2), "{unused:?}");
        assert!(stderr(&output).contains("'oscura render'"), "{}", stderr(&output));
    }
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let output = oscura(folder.path(), &["view", "scene.toml", "--no-open", "--port", &port]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains(&port), "{}", stderr(&output));
    let output = oscura(folder.path(), &["view", "missing.toml", "--no-open"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
}

/// A Python with playwright and a browser.
fn python_with_browser() -> Result<PathBuf, &'static str> {
    let chromium = std::env::var_os("CHROMIUM").map_or("/usr/bin/chromium".into(), PathBuf::from);
    if !chromium.exists() {
        return Err("there is no Chromium at /usr/bin/chromium or where CHROMIUM says");
    }
    let named = std::env::var_os("OSCURA_PYTHON").map(PathBuf::from);
    let has_it = |python: &PathBuf| {
        let output = Command::new(python).args(["-c", "import playwright.sync_api"]).output();
        output.is_ok_and(|o| o.status.success())
    };
    let mut candidates = named.into_iter().chain(["python3".into(), "python".into()]);
    candidates.find(has_it).ok_or("neither OSCURA_PYTHON nor python3 has the module playwright")
}

#[test]
fn page_in_a_browser() {
    let python = match python_with_browser() {
        Ok(python) => python,
        Err(reason) => return skip("playwright", reason),
    };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/view_page.py");
    let output = Command::new(python).arg(script).arg(env!("CARGO_BIN_EXE_oscura")).output().unwrap();
    assert!(output.status.success(), "{}{}", String::from_utf8_lossy(&output.stdout), stderr(&output));
}
