//! Every key of scene files has an effect: the scene with it differs from the scene with another value, and this test covers
//! every key that the parser knows.

use super::tables::{BALL, PLAIN, SHAPE, TEXTURED, Table, tables};
use super::{WRONG, known_keys};
use oscura::load::load;
use std::collections::BTreeSet;

/// A scene as text.
fn scene(text: &str) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text).expect("written");
    for (name, red) in [("one.png", 10), ("two.png", 20)] {
        let picture =
            image::RgbImage::from_fn(4, 2, |x, y| image::Rgb([red * (1 + x as u8 + y as u8), 0, 0]));
        picture.save(folder.path().join(name)).expect("a picture");
    }
    for (name, value) in [("one.vol", 1.0f32), ("two.vol", 2.0)] {
        let mut bytes = b"VOL\x03".to_vec();
        bytes.extend([1; 5].into_iter().flat_map(u32::to_le_bytes));
        bytes.extend([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, value].into_iter().flat_map(f32::to_le_bytes));
        std::fs::write(folder.path().join(name), bytes).expect("a grid");
    }
    for (name, scale) in [("one.ply", 1), ("two.ply", 2)] {
        let head = "ply\nformat ascii 1.0\nelement vertex 2\n";
        let properties =
            "property float x\nproperty float y\nproperty float z\nproperty float scale\nend_header\n";
        let places = format!("{head}{properties}0 0 0 {scale}\n5 0 0 {scale}\n");
        std::fs::write(folder.path().join(name), places).expect("places");
    }
    let grid = include_bytes!("../../../src/load/vdb/tests/blosc.vdb");
    std::fs::write(folder.path().join("smoke.vdb"), grid).expect("a grid");
    for (name, x) in [("one.curves", 1), ("two.curves", 2)] {
        std::fs::write(folder.path().join(name), format!("curves 1\n0 0 0 0.1\n{x} 0 0 0.1\n"))
            .expect("curves");
    }
    for (name, last) in [("one.ies", 1), ("two.ies", 2)] {
        let profile =
            format!("TILT=NONE\n1 1 1 2 3 1 2 0 0 0 1 1 1\n0 90\n0 90 360\n4 {last}\n5 1\n4 {last}\n");
        std::fs::write(folder.path().join(name), profile).expect("a profile");
    }
    let scene = load(&path, &Default::default()).unwrap_or_else(|e| panic!("{e}\n{text}")).scene;
    format!("{scene:?}").replace(&folder.path().display().to_string(), "")
}

#[test]
fn every_key_changes_the_scene() {
    for table in tables() {
        let usual = scene(&table.text(None, ""));
        for &(key, _, other) in &table.keys {
            // Without the volume its inside has no effect.
            let inside = ["attenuation_color", "attenuation_distance", "dispersion"];
            let other = match other {
                "" => {
                    let text = table.text(None, "").replace("volume = true\n", "");
                    let text: Vec<&str> =
                        text.lines().filter(|l| !inside.iter().any(|key| l.starts_with(key))).collect();
                    scene(&text.join("\n"))
                }
                _ => scene(&table.text(Some((key, other)), "")),
            };
            assert!(usual != other, "'{key}' of '{}' changes nothing", table.about);
        }
    }
}

#[test]
fn all_keys_are_tested() {
    let all = tables();
    let abouts: BTreeSet<&str> = all.iter().map(|t| t.about).collect();
    for about in abouts {
        let tables: Vec<&Table> = all.iter().filter(|t| t.about == about).collect();
        let tried: BTreeSet<&str> = tables.iter().flat_map(|t| &t.keys).map(|key| key.0).collect();
        let known = known_keys(&tables[0].text(None, &format!("{WRONG} = 1")));
        // `type` is in every table's header, displacement, normals and numbers are common to all materials; cameras and lights
        // from models, and motion, have separate tests.
        let elsewhere = ["type", "from", "name", "node", "displacement", "normal", "index", "bump", "motion"];
        let missing: Vec<&String> = known
            .iter()
            .filter(|k| !tried.contains(k.as_str()) && !elsewhere.contains(&k.as_str()))
            .collect();
        assert!(missing.is_empty(), "{about}: no test of {missing:?}");
    }
}

/// Keys of objects and steps of transforms, which are mutually exclusive.
#[test]
fn objects_and_their_transforms() {
    let ball = "sphere = { center = [1, 2, 3], radius = 1 }\nmaterial = \"a\"\n";
    let shown = |more: &str| scene(&format!("{SHAPE}{ball}{more}\n"));
    let plain = shown("");
    for more in [
        "name = \"other\"",
        "transform = [{ translate = [1, 0, 0] }]",
        "transform = [{ rotate = { axis = [0, 1, 0], angle = 30 } }]",
        "transform = [{ euler = [0, 30, 0] }]",
        "transform = [{ quaternion = [0, 0.6, 0, 0.8] }]",
        "transform = [{ scale = 2 }]",
        "visible_to = [\"camera\", \"shadow\"]",
        "visible_to_camera = false",
        "holdout = true",
        "shadow_catcher = true",
        "instances = \"one.ply\"",
        "instances = \"two.ply\"",
        "transform = [{ matrix = [1, 0, 0, 5,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 0, 1] }]",
    ] {
        assert!(shown(more) != plain, "{more}");
    }
    let of = |object: &str| scene(&format!("{SHAPE}{object}\n"));
    let triangle = "triangle = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n";
    assert!(of(&format!("{triangle}material = \"a\"")) != of(&format!("{triangle}material = \"b\"")));
    let cube = "box = { min = [0, 0, 0], max = [1, 1, 1] }\nmaterials = ";
    let mixed = of(&format!("{cube}[\"a\", \"a\", \"a\", \"a\", \"a\", \"b\"]"));
    assert!(mixed != of(&format!("{cube}[\"a\", \"a\", \"a\", \"a\", \"b\", \"a\"]")));
    let normal = scene(&format!("{TEXTURED}type = \"normal\"\n{BALL}"));
    assert!(normal.contains("Normal") && !scene(&format!("{PLAIN}{BALL}")).contains("Normal"));
}
