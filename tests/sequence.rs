//! Sequences of an animated asset, from the command line to the pictures.

use oscura::load::gltf::GltfOptions;
use oscura::load::{LoadOptions, Loaded, load};
use oscura::math::DVec3;
use oscura::scene::{LightKind, Model, Projection};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The reed that comes with the project; `oscura-assets reed` writes it.
fn reed() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/reed.gltf")
}

fn load_reed(gltf: GltfOptions) -> Loaded {
    load(&reed(), &LoadOptions { gltf, ..LoadOptions::default() }).unwrap_or_else(|e| panic!("{e}"))
}

fn at(time_s: f64) -> GltfOptions {
    GltfOptions { time_s: Some(time_s), ..GltfOptions::default() }
}

/// The corner of the first placed mesh that is farthest in a direction, in the world.
fn farthest(loaded: &Loaded, direction: DVec3) -> DVec3 {
    let instance = loaded.scene.instances.iter().find(|i| i.name == "stalk").expect("the stalk");
    let place =
        |p: &[f32; 3]| instance.world_from_object.transform_point3(DVec3::from_array(p.map(f64::from)));
    let positions = loaded.scene.meshes[instance.mesh.index()].positions.iter().map(place);
    positions.max_by(|a, b| a.dot(direction).total_cmp(&b.dot(direction))).expect("corners")
}

#[test]
fn the_reed_holds_what_it_should() {
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
    // At rest it stands straight.
    assert!((farthest(&loaded, DVec3::Y).y - 1.2).abs() < 1e-6);
    assert!(farthest(&loaded, DVec3::X).x < 0.0501);
}

#[test]
fn the_reed_bends_and_swells() {
    let (start, middle, quarter) = (load_reed(at(0.0)), load_reed(at(1.0)), load_reed(at(0.5)));
    assert!((farthest(&start, DVec3::Y).y - 1.2).abs() < 1e-6);
    // The upper half turns by 0.9 rad about its joint, 0.6 m up; the tip's rim is 0.015 m wide.
    let tip = DVec3::new(0.6 * 0.9f64.sin(), 0.6 + 0.6 * 0.9f64.cos(), 0.0);
    assert!((farthest(&middle, DVec3::X) - tip).length() < 0.03, "{}", farthest(&middle, DVec3::X));
    let half = DVec3::new(0.6 * 0.45f64.sin(), 0.6 + 0.6 * 0.45f64.cos(), 0.0);
    assert!((farthest(&quarter, DVec3::X) - half).length() < 0.03);
    // The bulge: sideways, the stalk is as thick as its foot or thicker by a spline's half.
    let thickness = |loaded: &Loaded| {
        let instance = &loaded.scene.instances[0];
        let positions = &loaded.scene.meshes[instance.mesh.index()].positions;
        // The eleventh ring, near the bulge's middle.
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
fn frames_are_numbered_and_equal_single_moments() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output =
        oscura(folder.path(), &["-o", "f.##.png", "-o", "f.exr", "--frames", "0-24x12", "--fps", "24"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
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
