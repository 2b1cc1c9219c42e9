//! Sequences of an animated asset, from command line to pictures.

use oscura::load::gltf::GltfOptions;
use oscura::load::{LoadOptions, Loaded, load, load_times};
use oscura::math::DVec3;
use oscura::scene::{LightKind, Model, Projection};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The reed of the repository; `oscura-assets reed` writes it.
fn reed() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/reed.gltf")
}

fn load_reed(gltf: GltfOptions) -> Loaded {
    load(reed(), &LoadOptions { gltf, ..LoadOptions::default() }).unwrap_or_else(|e| panic!("{e}"))
}

fn at(time_s: f64) -> GltfOptions {
    GltfOptions { time_s: Some(time_s), ..GltfOptions::default() }
}

/// The vertex of the first mesh instance that is farthest in a direction, in world space.
fn farthest(loaded: &Loaded, direction: DVec3) -> DVec3 {
    let instance = loaded.scene.instances.iter().find(|i| i.name == "stalk").expect("the stalk");
    let place =
        |p: &[f32; 3]| instance.world_from_object.transform_point3(DVec3::from_array(p.map(f64::from)));
    let positions = loaded.scene.meshes[instance.mesh.index()].positions.iter().map(place);
    positions.max_by(|a, b| a.dot(direction).total_cmp(&b.dot(direction))).expect("corners")
}

#[test]
fn reed_contents() {
    let loaded = load_reed(GltfOptions::default());
    let scene = &loaded.scene;
    let names: Vec<&str> = scene.instances.iter().map(|i| i.name.as_str()).collect();
    let leaves: Vec<String> = (0..6).map(|i| format!("leaves/{i}")).collect();
    let expected: Vec<&str> =
        ["stalk"].into_iter().chain(leaves.iter().map(String::as_str)).chain(["ground"]).collect();
    assert_eq!(names, expected, "the hidden node is left out");
    assert_eq!((scene.meshes.len(), scene.meshes[1].triangles.len()), (3, 4));
    assert!(matches!(scene.cameras[0].projection, Projection::Perspective { .. }));
    assert!(
        matches!(scene.cameras[1].projection, Projection::Orthographic { half_height } if half_height == 1.0)
    );
    assert!(matches!(scene.lights[0].kind, LightKind::Directional { .. }));
    assert!(matches!(scene.lights[1].kind, LightKind::Spot { .. }));
    let felt = scene.materials.iter().find(|m| m.name == "felt").expect("felt");
    assert!(matches!(&felt.model, Model::Pbr(p) if p.sheen.is_some()));
    // In its rest pose it is straight.
    assert!((farthest(&loaded, DVec3::Y).y - 1.2).abs() < 1e-6);
    assert!(farthest(&loaded, DVec3::X).x < 0.0501);
}

#[test]
fn reed_skin_and_morph_targets() {
    let (start, middle, quarter) = (load_reed(at(0.0)), load_reed(at(1.0)), load_reed(at(0.5)));
    assert!((farthest(&start, DVec3::Y).y - 1.2).abs() < 1e-6);
    // The upper half rotates by 0.9 rad about its joint, 0.6 m up; the tip's rim is 0.015 m wide.
    let tip = DVec3::new(0.6 * 0.9f64.sin(), 0.6 + 0.6 * 0.9f64.cos(), 0.0);
    assert!((farthest(&middle, DVec3::X) - tip).length() < 0.03, "{}", farthest(&middle, DVec3::X));
    let half = DVec3::new(0.6 * 0.45f64.sin(), 0.6 + 0.6 * 0.45f64.cos(), 0.0);
    assert!((farthest(&quarter, DVec3::X) - half).length() < 0.03);
    // The bulge: sideways, the stalk is at least as thick as its base, up to 1.5 times by the spline.
    let thickness = |loaded: &Loaded| {
        let instance = &loaded.scene.instances[0];
        let positions = &loaded.scene.meshes[instance.mesh.index()].positions;
        // The eleventh ring, near the middle of the bulge.
        positions[10 * 8..11 * 8].iter().map(|p| p[2].abs()).fold(0.0, f32::max)
    };
    let (thin, some, thick) = (thickness(&start), thickness(&quarter), thickness(&middle));
    assert!((some - 0.5 * (thin + thick)).abs() < 1e-4 && thick > thin + 0.05, "{thin} {some} {thick}");
}

#[test]
fn variants_and_scenes_of_the_reed() {
    let autumn = load_reed(GltfOptions { variant: Some("autumn".into()), ..GltfOptions::default() });
    assert!(autumn.scene.materials.iter().any(|m| m.name == "straw"));
    assert!(autumn.scene.materials.iter().all(|m| m.name != "green"));
    let leaves = load_reed(GltfOptions { scene: Some("leaves".into()), ..GltfOptions::default() });
    assert_eq!((leaves.scene.instances.len(), leaves.scene.meshes.len()), (6, 1));
}

fn oscura(folder: &Path, args: &[&str]) -> std::process::Output {
    let reed = reed().display().to_string();
    let fixed = ["render", &reed, "--width", "16", "--spp", "1", "--reproducible"];
    Command::new(env!("CARGO_BIN_EXE_oscura"))
        .args(fixed)
        .args(args)
        .current_dir(folder)
        .output()
        .expect("the program starts")
}

#[test]
fn frames_are_numbered_and_match_single_renders() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output =
        oscura(folder.path(), &["-o", "f.##.png", "-o", "f.exr", "--frames", "0-24x12", "--fps", "24"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    // Reports common to all frames appear once, those of a frame each time.
    let messages = String::from_utf8_lossy(&output.stderr);
    assert_eq!(messages.matches("intensities of 2 lights").count(), 1, "{messages}");
    assert!(
        messages.contains("frame    12, 0.500 s") && messages.contains("frame    24, 1.000 s"),
        "{messages}"
    );
    let [first, second, third] = ["f.00.png", "f.12.png", "f.24.png"].map(read);
    assert!(first != second && second != third);
    for name in ["f.0000.exr", "f.0012.exr", "f.0024.exr"] {
        read(name);
    }
    let output = oscura(folder.path(), &["-o", "one.png", "--time", "0.5"]);
    assert!(output.status.success());
    assert_eq!(read("one.png"), second);
    let both = oscura(folder.path(), &["-o", "a.png", "--time", "0", "--frames", "1"]);
    assert_eq!(both.status.code(), Some(2));
}

/// The reed with a texture on one material, a missing one on another, and its buffers in a file.
fn reed_with_files(folder: &Path) -> PathBuf {
    let text = std::fs::read_to_string(reed()).expect("the asset");
    let mut asset: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    asset["images"] = serde_json::json!([{"uri": "red.png"}, {"uri": "missing.png"}]);
    asset["textures"] = serde_json::json!([{"source": 0}, {"source": 1}]);
    for (material, texture) in [(0, 0), (2, 1)] {
        asset["materials"][material]["pbrMetallicRoughness"]["baseColorTexture"] =
            serde_json::json!({"index": texture});
    }
    image::RgbImage::from_pixel(2, 2, image::Rgb([255, 0, 0])).save(folder.join("red.png")).expect("a PNG");
    let path = folder.join("reed.gltf");
    std::fs::write(&path, asset.to_string()).expect("written");
    path
}

/// The loaded scene as text; warnings in any order.
fn whole(loaded: &Loaded) -> Vec<String> {
    let mut messages: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    messages.sort();
    messages.extend([format!("{:?} {:?}", loaded.notes, loaded.left_out), format!("{:?}", loaded.scene)]);
    messages
}

/// Every frame of a sequence equals a load at that time, and files are read once.
#[test]
fn sequences_read_files_once() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = reed_with_files(folder.path());
    let times = [0.0, 0.5, 1.0, 0.0];
    let expected = times.map(|time| {
        let options = LoadOptions { gltf: at(time), ..LoadOptions::default() };
        load(&path, &options).unwrap_or_else(|e| panic!("{e}"))
    });
    assert!(
        expected[0].warnings.iter().any(|w| w.message.contains("missing.png")),
        "{:?}",
        expected[0].warnings
    );
    assert!(
        expected[0].warnings.iter().any(|w| w.message.contains("TEXCOORD_0")),
        "{:?}",
        expected[0].warnings
    );
    assert_eq!(expected[0].scene.images.len(), 1);
    assert!(whole(&expected[0]) != whole(&expected[1]));
    let mut seen = Vec::new();
    load_times(&path, &LoadOptions::default(), times, &mut |loaded| {
        seen.push(whole(loaded));
        // Changes of one frame's scene by the caller don't affect the next.
        loaded.scene.images.clear();
        loaded.scene.materials.clear();
        for file in ["reed.gltf", "red.png"] {
            let _ = std::fs::remove_file(folder.path().join(file));
        }
        Ok(ControlFlow::Continue(()))
    })
    .unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(seen.len(), times.len());
    for (i, (seen, expected)) in seen.iter().zip(&expected).enumerate() {
        for (seen, expected) in seen.iter().zip(&whole(expected)) {
            assert_eq!(seen, expected, "moment {i}");
        }
        assert_eq!(seen.len(), whole(expected).len(), "moment {i}");
    }
}

#[test]
fn sequences_can_be_interrupted() {
    let mut count = 0;
    let ended = load_times(reed(), &LoadOptions::default(), [0.0, 1.0, 2.0], &mut |_| {
        count += 1;
        Ok(if count == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    });
    assert!(ended.is_ok() && count == 2);
    let refused =
        load_times(Path::new("missing.glb"), &LoadOptions::default(), [0.0], &mut |_| panic!("no file"));
    assert!(refused.is_err());
}

#[test]
fn sequences_resume() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let run = |more: &[&str]| {
        let fixed = ["-o", "f.##.png", "-o", "f.##.exr", "--frames", "1-3"];
        oscura(folder.path(), &[&fixed[..], more].concat())
    };
    assert!(run(&[]).status.success());
    let path = |name: &str| folder.path().join(name);
    let whole = std::fs::read(path("f.02.png")).expect("a picture");
    // A frame is complete only with all its pictures.
    std::fs::remove_file(path("f.02.png")).expect("removed");
    std::fs::write(path("f.01.png"), "kept as it is").expect("written");
    let output = run(&["--resume"]);
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{messages}");
    assert!(messages.contains("frame    2,") && !messages.contains("frame    1,"), "{messages}");
    assert_eq!(std::fs::read(path("f.02.png")).expect("a picture"), whole);
    assert_eq!(std::fs::read(path("f.01.png")).expect("text"), b"kept as it is");
    assert!(run(&["--resume"]).status.success());
    assert_eq!(oscura(folder.path(), &["-o", "a.png", "--resume"]).status.code(), Some(2));
}
