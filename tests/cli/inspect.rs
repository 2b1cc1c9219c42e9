//! `oscura inspect`: a report of every part of a scene, as text and JSON.

use std::path::Path;
use std::process::Command;

fn inspect(folder: &Path, arguments: &[&str]) -> String {
    let mut program = Command::new(env!("CARGO_BIN_EXE_oscura"));
    let output = program.arg("inspect").args(arguments).current_dir(folder).output().expect("it runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

const SCENE: &str = r#"
environment.background = [0, 0, 1]
camera = { look_from = [0, 0, 4], look_at = [0, 0, 0], vfov = 60, defocus_angle = 1 }
render = { samples = 3 }
[materials.clay]
type = "lambert"
color = [0.5, 0.25, 0]
[materials.lamp]
type = "emissive"
radiance = 7
[[objects]]
name = "ball"
sphere = { center = [0, 2, 0], radius = 0.5 }
material = "clay"
[[objects]]
name = "house"
mesh = "house.obj"
[[lights]]
name = "bulb"
point = { position = [1, 2, 3], intensity = 4 }
[[lights]]
name = "panel"
area = { center = [0, 5, 0], target = [0, 0, 0], size = [1, 2], radiance = 3 }
"#;

const HOUSE: &str = "mtllib h.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl brick\no wall\ng north\nf 1 2 3\ng south\nf 1 3 2\nl 1 2\n";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, content) in [("s.toml", SCENE), ("house.obj", HOUSE), ("h.mtl", "newmtl brick\nKd 1 0 0\n")] {
        std::fs::write(folder.path().join(name), content).expect("written");
    }
    folder
}

#[test]
fn text_is_a_tree_with_units_and_positions() {
    let folder = folder();
    let shown = inspect(folder.path(), &["s.toml"]);
    for part in [
        "2 meshes of 6 vertices, placed 2 times (2 triangles), 1 sphere, 1 quad",
        "extent     (-0.5, 0, -1) to (1, 5, 1) m",
        "\n    house\n      wall\n        north: mesh 'wall/north', 1 triangle, 'brick'\n        south: ",
        "\n    ball: sphere of radius 0.5, 'clay'\n",
        "\n    panel: quad of 1.0000 x 2.0000 m, 'panel'\n",
        "'clay': lambert, colour (0.5, 0.25, 0)\n",
        "'panel': black; emits (3, 3, 3) W/sr/m2 from its front\n",
        "'bulb': point, (4, 4, 4) W/sr, at (1, 2, 3)\n",
        "environment constant, (0, 0, 1) W/sr/m2\n",
        "0 'camera': perspective, 60 degrees high, at (0, 0, 4) towards (0, 0, -1), lens radius 34.9075 mm",
        "settings   samples 3\n",
        "house.obj: line 11: 1 lines, which have no surface",
        "material 'lamp': nothing refers to it",
    ] {
        assert!(shown.contains(part), "'{part}' is not in:\n{shown}");
    }
}

#[test]
fn json_has_the_same_content() {
    let folder = folder();
    let json: serde_json::Value =
        serde_json::from_str(&inspect(folder.path(), &["s.toml", "--json"])).expect("JSON");
    assert_eq!((json["triangles"].as_u64(), json["spheres"].as_u64()), (Some(2), Some(1)));
    let names: Vec<&str> =
        json["objects"].as_array().expect("a list").iter().filter_map(|o| o["name"].as_str()).collect();
    assert_eq!(names, ["house/wall/north", "house/wall/south", "ball", "panel"]);
    assert_eq!(json["objects"][0]["materials"][0], "brick");
    assert_eq!(json["objects"][0]["extent"][1][1], 1);
    assert_eq!((&json["lights"][0]["unit"], &json["lights"][0]["intensity"][0]), (&"W/sr".into(), &4.into()));
    assert_eq!(json["cameras"][0]["lens"]["focus_distance"], 4);
    let warning = &json["warnings"][0];
    assert_eq!(warning["place"], "line 11");
    assert!(warning["file"].as_str().is_some_and(|f| f.ends_with("house.obj")), "{warning}");
    assert_eq!(json["left_out"].as_array().map(Vec::len), Some(1));
}

/// Lights that `render` would add are reported, and not as contents of the file.
#[test]
fn default_lights_are_reported() {
    let folder = folder();
    let shown = inspect(folder.path(), &["house.obj"]);
    for part in ["environment none\n", "images     0\n", "no camera and no light: shown from", "studio light"]
    {
        assert!(shown.contains(part), "'{part}' is not in:\n{shown}");
    }
    assert!(!shown.contains("soft default sky") && !shown.contains("ground'"), "{shown}");
}

#[test]
fn cornell_box_is_reported_by_its_nodes() {
    let shown = inspect(Path::new(env!("CARGO_MANIFEST_DIR")), &["assets/cornell-box.gltf"]);
    assert!(shown.contains("(17, 12, 4) W/sr/m2"), "{shown}");
    assert!(shown.contains("warnings   0\n"), "{shown}");
}
