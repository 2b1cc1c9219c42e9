//! `motion` of objects in scene files, and the shutter.

use crate::files::load_files_by;
use oscura::load::{LoadOptions, Loaded, ShutterOptions, load};
use oscura::math::{DAffine3, DVec3, transform_at};
use oscura::scene::{LightKind, Motion};

const HEAD: &str = "[camera]\nlook_from = [0, 1, 5]\nlook_at = [0, 0, 0]\nshutter = 0.5\n\
    [materials]\na = { type = \"lambert\" }\n[[objects]]\nmaterial = \"a\"\n";
const BALL: &str = "sphere = { center = [1, 2, 3], radius = 1 }\n";

fn read_by(text: &str, options: &LoadOptions) -> Result<Loaded, oscura::Error> {
    load_files_by(&[("scene.toml", text)], options)
}

fn read(text: &str) -> Loaded {
    read_by(text, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn linear_motion_per_frame() {
    let loaded = read(&format!("{HEAD}{BALL}motion = {{ translate = [4, 0, 0] }}\n"));
    let moving = &loaded.scene.motion.shapes[&0];
    let places: Vec<DVec3> = moving.keys.iter().map(|key| key.translation).collect();
    assert_eq!(places, [DVec3::NEG_X, DVec3::X]);
    assert_eq!((loaded.scene.shapes[0].center, moving.neighbours), (DVec3::new(1.0, 2.0, 3.0), None));
    // A quarter turn about the centre of a cube, with as many keys as needed.
    let turn = "motion = { rotate = { axis = [0, 0, 1], angle = 180, center = [1, 1, 0] } }\n";
    let loaded = read(&format!("{HEAD}box = {{ min = [0, 0, 0], max = [2, 2, 2] }}\n{turn}"));
    let (instance, motion) = (&loaded.scene.instances[0], &loaded.scene.motion.instances[0]);
    assert_eq!((instance.motion, motion.keys.len()), (Motion::Keyed(0), 33));
    let onwards = instance.world_from_object.inverse();
    let corner =
        |time: f32| (transform_at(&motion.keys, time) * onwards).transform_point3(DVec3::new(2.0, 1.0, 0.0));
    let half = std::f64::consts::FRAC_1_SQRT_2;
    assert!(corner(0.0).distance(DVec3::new(1.0 + half, 1.0 - half, 0.0)) < 1e-9);
    assert!(corner(0.5).distance(DVec3::new(2.0, 1.0, 0.0)) < 1e-9);
}

#[test]
fn keyframes_extrapolate_as_constants() {
    let motion =
        "motion = { keys = [{ frame = 0 }, { frame = 0.125, transform = [{ translate = [2, 0, 0] }] }] }\n";
    let loaded =
        read(&format!("{HEAD}quad = {{ corner = [0, 0, 0], u = [1, 0, 0], v = [0, 1, 0] }}\n{motion}"));
    let keys = &loaded.scene.motion.quads[&0].keys;
    let at = |time: f32| transform_at(keys, time).translation.x;
    assert_eq!([at(0.0), at(0.5), at(0.625), at(0.75), at(1.0)], [0.0, 0.0, 1.0, 2.0, 2.0]);
}

/// Frame N of a sequence has moving objects at their positions of that time.
#[test]
fn sequences_advance_motion() {
    let mut options = LoadOptions::default();
    options.gltf.time_s = Some(3.0 / 24.0);
    options.shutter = ShutterOptions { vectors: true, ..ShutterOptions::default() };
    let text = format!("{HEAD}{BALL}motion = {{ translate = [4, 0, 0] }}\n");
    let scene = read_by(&text, &options).unwrap_or_else(|e| panic!("{e}")).scene;
    assert_eq!(scene.shapes[0].center.x, 13.0);
    let moving = &scene.motion.shapes[&0];
    assert_eq!(moving.keys[0].translation, DVec3::NEG_X);
    let neighbours = moving.neighbours.map(|n| n.map(|m| m.translation.x));
    assert_eq!(neighbours, Some([-4.0, 4.0]));
}

#[test]
fn closed_shutter_has_no_motion() {
    let closed = HEAD.replace("shutter = 0.5", "shutter = 0");
    let loaded = read(&format!("{closed}{BALL}motion = {{ translate = [4, 0, 0] }}\n"));
    let plain = read(&format!("{closed}{BALL}"));
    assert_eq!(format!("{:?}", loaded.scene), format!("{:?}", plain.scene));
    assert!(loaded.notes.iter().any(|n| n.message.contains("shutter")));
    assert!(plain.notes.is_empty());
}

#[test]
fn invalid_motion_is_reported() {
    for (motion, complaint) in [
        ("{}", "'translate', 'rotate' or 'keys'"),
        ("{ keys = [] }", "'keys'"),
        ("{ keys = [{ frame = 1 }, { frame = 1 }] }", "frames of 'keys'"),
        ("{ keys = [{ frame = nan }] }", "'frame'"),
        ("{ keys = [{ frame = 0, transform = [{ scale = 0 }] }] }", "singular"),
        ("{ translate = [1, 0, 0], keys = [{ frame = 0 }] }", "'translate'"),
        ("{ rotate = { axis = [0, 0, 0], angle = 3 } }", "length 0"),
        ("{ translate = [1, inf, 0] }", "finite"),
    ] {
        let error = read_by(&format!("{HEAD}{BALL}motion = {motion}\n"), &LoadOptions::default());
        let error = error.expect_err(motion).to_string();
        assert!(error.contains(complaint), "{motion}: {error}");
    }
    let negative = HEAD.replace("shutter = 0.5", "shutter = -1");
    assert!(read_by(&format!("{negative}{BALL}"), &LoadOptions::default()).is_err());
}

/// Sampling of spherical lights requires uniform scale.
#[test]
fn nonuniformly_scaled_emissive_spheres_become_meshes() {
    let glowing = HEAD.replace("\"lambert\"", "\"emissive\", radiance = [1, 1, 1]");
    let stretch = |scale: &str| {
        format!(
            "motion = {{ keys = [{{ frame = 0 }}, {{ frame = 1, transform = [{{ scale = {scale} }}] }}] }}\n"
        )
    };
    for (head, scale, becomes_mesh) in
        [(HEAD, "[1, 3, 1]", false), (&glowing, "3", false), (&glowing, "[1, 3, 1]", true)]
    {
        let loaded = read(&format!("{head}{BALL}{}", stretch(scale)));
        let scene = &loaded.scene;
        assert_eq!(
            [scene.shapes.len(), scene.instances.len()],
            [1 - usize::from(becomes_mesh), usize::from(becomes_mesh)]
        );
        let is_reported = loaded.warnings.iter().any(|w| w.code == "light-stretched");
        assert_eq!(is_reported, becomes_mesh, "{scale}: {:?}", loaded.warnings);
        if becomes_mesh {
            let keys = &scene.motion.instances[0].keys;
            let height = |key: &DAffine3| key.matrix3.y_axis.length() / key.matrix3.x_axis.length();
            let [first, last] = [&keys[0], &keys[keys.len() - 1]].map(height);
            assert!((first - 1.0).abs() < 1e-9 && (last - 1.5).abs() < 1e-9, "{first} {last}");
        }
    }
}

/// A node that moves by (8, 0, 0) in a second, which is 24 frames.
const LAMP: &str = r#"{
    "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"name": "Lamp", "translation": [7, 7, 7]}],
    "animations": [{
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
        "samplers": [{"input": 0, "output": 1}]
    }],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [1]},
        {"bufferView": 1, "componentType": 5126, "count": 2, "type": "VEC3"}
    ],
    "bufferViews": [{"buffer": 0, "byteLength": 8}, {"buffer": 0, "byteOffset": 8, "byteLength": 24}],
    "buffers": [{"byteLength": 32, "uri": "data:application/octet-stream;base64,AAAAAAAAgD8AAAAAAAAAAAAAAAAAAABBAAAAAAAAAAA="}]
}"#;

/// Sidecar lights move with their nodes.
#[test]
fn lights_move_with_their_nodes() {
    let with = |light: &str, frames: f64| {
        let mut options = LoadOptions::default();
        options.gltf.time_s = Some(0.5);
        options.shutter = ShutterOptions { frames: Some(frames), ..ShutterOptions::default() };
        let sidecar = format!("[[lights]]\n{light}\n");
        let files = [("a.gltf", LAMP), ("a.oscura.toml", &sidecar)];
        load_files_by(&files, &options).unwrap_or_else(|e| panic!("{light}: {e}")).scene
    };
    let ways = |keys: &[DAffine3]| keys.iter().map(|key| key.translation.x).collect::<Vec<_>>();
    let scene = with("area = { node = \"Lamp\", size = [1, 2], power = 1 }", 12.0);
    assert_eq!(ways(&scene.motion.quads[&0].keys), [-2.0, 2.0]);
    let scene = with("area = { node = \"Lamp\", size = [1, 1], shape = \"ellipse\", power = 1 }", 12.0);
    assert_eq!(ways(&scene.motion.instances[0].keys), [2.0, 6.0]);
    let scene = with("point = { node = \"Lamp\", radius = 0.1, power = 1 }", 12.0);
    assert_eq!(ways(&scene.motion.shapes[&0].keys), [-2.0, 2.0]);
    let scene = with("spot = { node = \"Lamp\", power = 1 }", 12.0);
    let keys = scene.lights[0].motion.as_ref().map(|moving| moving.keys.iter());
    let place = |kind: &LightKind| match kind {
        LightKind::Spot { position, .. } => position.x,
        _ => f64::NAN,
    };
    assert!(keys.expect("it moves").map(place).eq([2.0, 6.0]));
    assert!(with("spot = { node = \"Lamp\", power = 1 }", 0.0).lights[0].motion.is_none());
}

/// Cameras and lights of scene files use the same `motion` key.
#[test]
fn cameras_and_lights_move() {
    let motion = "motion = { translate = [0, 4, 0], rotate = { axis = [0, 1, 0], angle = 20 } }\n";
    let camera = HEAD.replace("shutter = 0.5\n", &format!("shutter = 0.5\n{motion}"));
    let camera = read(&format!("{camera}{BALL}")).scene.cameras.remove(0);
    let keys = &camera.motion.as_ref().expect("it moves").keys;
    assert!(keys.len() > 1);
    let expected = |frames: f64| {
        let turn = DAffine3::from_rotation_y((20.0 * frames).to_radians());
        DAffine3::from_translation(DVec3::Y * 4.0 * frames) * turn * camera.world_from_camera
    };
    assert!(transform_at(keys, 0.0).abs_diff_eq(expected(-0.25), 1e-9));
    assert!(transform_at(keys, 1.0).abs_diff_eq(expected(0.25), 1e-9));
    for light in [
        "area = { center = [3, 0, 0], target = [0, 0, 0], size = [1, 2], power = 5 }",
        "point = { position = [3, 0, 0], power = 5 }",
        "point = { position = [3, 0, 0], power = 5, radius = 0.5 }",
        "spot = { position = [3, 0, 0], target = [0, 0, 0], power = 5 }",
        "sun = { direction = [-1, 0, 0], irradiance = 1 }",
    ] {
        let scene = read(&format!("{HEAD}{BALL}[[lights]]\n{light}\n{motion}")).scene;
        let half = (10.0f64 / 2.0).to_radians();
        let place = |time: f64| DVec3::new(3.0 * (half * time).cos(), time, -3.0 * (half * time).sin());
        match scene.lights.first().map(|l| (l.kind, l.motion.as_ref().map(|m| m.keys.clone()))) {
            None => {
                let motion = [&scene.motion.quads, &scene.motion.shapes].map(|m| m.values().next());
                let keys = &motion.into_iter().flatten().next().expect("it moves").keys;
                let middle = scene.quads.first().map(|q| q.corner + (q.edge_u + q.edge_v) / 2.0);
                let middle = middle.unwrap_or(DVec3::new(3.0, 0.0, 0.0));
                assert!(middle.distance(place(0.0)) < 1e-9, "{light}");
                let last = keys.last().expect("one").transform_point3(middle);
                assert!(last.distance(place(1.0)) < 1e-9, "{light}: {last}");
            }
            Some((now, keys)) => {
                let last = *keys.expect("it moves").last().expect("one");
                assert_ne!(now, last, "{light}");
                let (at, along) = match last {
                    LightKind::Point { position } => (position, None),
                    LightKind::Spot { position, direction, .. } => (position, Some(direction)),
                    LightKind::Directional { direction } => (place(1.0), Some(direction)),
                    other => panic!("{other:?}"),
                };
                assert!(at.distance(place(1.0)) < 1e-9, "{light}");
                let inwards = -(place(1.0) - DVec3::Y) / 3.0;
                assert!(along.is_none_or(|way| way.distance(inwards) < 1e-9), "{light}");
            }
        }
    }
}

#[test]
fn invalid_motion_of_cameras_and_lights() {
    let grows = "motion = { keys = [{ frame = 0 }, { frame = 1, transform = [{ scale = 2 }] }] }\n";
    let camera = HEAD.replace("shutter = 0.5\n", &format!("shutter = 0.5\n{grows}"));
    let light = format!("{HEAD}{BALL}[[lights]]\npoint = {{ position = [0, 0, 0], power = 1 }}\n{grows}");
    for text in [format!("{camera}{BALL}"), light] {
        let error = read_by(&text, &LoadOptions::default()).expect_err("it scales").to_string();
        assert!(error.contains("'motion'") && error.matches("error").count() <= 1, "{error}");
    }
}

/// Transforms place and move cameras and lights as positions and directions do, and scale area lights.
#[test]
fn transforms_place_cameras_and_lights() {
    let motion =
        "motion = { keys = [{ frame = 0 }, { frame = 1, transform = [{ translate = [0, 4, 0] }] }] }\n";
    // Towards -x, with y up.
    let turned = "transform = [{ scale = [2, 3, 1] }, { euler = [0, 90, 0] }, { translate = [3, 0, 0] }]\n";
    let lit = |light: &str, place: &str| {
        let scene = read(&format!("{HEAD}{BALL}[[lights]]\nname = \"l\"\n{light}\n{place}{motion}")).scene;
        format!("{:?} {:?} {:?} {:?}", scene.lights, scene.quads, scene.shapes, scene.motion)
    };
    // Up to rounding of a quarter turn.
    let rounded = |text: String| text.replace("2.220446049250313e-16", "0.0").replace("-0.0", "0.0");
    for (shape, own, transformed) in [
        ("point", "position = [3, 0, 0], power = 5", "power = 5"),
        ("point", "position = [3, 0, 0], power = 5, radius = 0.5", "power = 5, radius = 0.5"),
        ("sun", "direction = [-1, 0, 0], irradiance = 1", "irradiance = 1"),
    ] {
        let (by_place, by_transform) =
            (format!("{shape} = {{ {own} }}"), format!("{shape} = {{ {transformed} }}"));
        assert_eq!(rounded(lit(&by_place, "")), rounded(lit(&by_transform, turned)), "{shape}");
    }
    let area = |light: &str, place: &str| {
        let scene = read(&format!("{HEAD}{BALL}[[lights]]\n{light}\n{place}")).scene;
        let middle = scene.quads[0].corner + (scene.quads[0].edge_u + scene.quads[0].edge_v) / 2.0;
        (middle, scene.quads[0].edge_u, scene.quads[0].edge_v, scene.motion.quads.get(&0).cloned())
    };
    let (at, u, v, _) =
        area("area = { center = [3, 0, 0], direction = [-1, 0, 0], size = [4, 3], power = 5 }", "");
    let scaled = area("area = { size = [2, 1], power = 5 }", turned);
    assert!(at.distance(scaled.0) < 1e-9 && u.distance(scaled.1) < 1e-9 && v.distance(scaled.2) < 1e-9);
    let grows = "motion = { keys = [{ frame = -0.25 }, { frame = 0.25, transform = [{ scale = 3 }] }] }\n";
    let keys = area("area = { size = [1, 1], power = 5 }", &format!("transform = []\n{grows}"))
        .3
        .expect("it moves")
        .keys;
    // Halfway it is twice as large.
    let widths: Vec<f64> = keys.iter().map(|key| 2.0 * key.matrix3.x_axis.length()).collect();
    assert!((widths[0] - 1.0).abs() < 1e-9 && (widths[widths.len() - 1] - 3.0).abs() < 1e-9, "{widths:?}");

    let look = "look_from = [0, 1, 5]\nlook_at = [0, 0, 0]\n";
    let angle = (0.2f64).atan().to_degrees();
    let placed = format!(
        "transform = [{{ scale = 2 }}, {{ euler = [-{angle}, 0, 0] }}, {{ translate = [0, 1, 5] }}]\n"
    );
    let camera = |text: &str| read(&format!("{text}{BALL}")).scene.cameras;
    let (by_place, head) =
        (HEAD.replace(look, &format!("{look}{motion}")), HEAD.replace(look, &format!("{placed}{motion}")));
    let (expected, found) = (camera(&by_place).remove(0), camera(&head).remove(0));
    assert!(expected.world_from_camera.abs_diff_eq(found.world_from_camera, 1e-9));
    let keys = |motion: Option<oscura::scene::Keyframes<DAffine3>>| motion.expect("it moves").keys;
    let (expected, found) = (keys(expected.motion), keys(found.motion));
    assert!(expected.len() == found.len());
    assert!(expected.iter().zip(&found).all(|(a, b)| a.abs_diff_eq(*b, 1e-9)), "{expected:?} {found:?}");

    let two = HEAD.replace("[camera]\n", "[[camera]]\nname = \"front\"\n");
    let two = two.replace("[materials]", &format!("[[camera]]\nname = \"back\"\n{placed}[materials]"));
    let names: Vec<String> = camera(&two).into_iter().map(|camera| camera.name).collect();
    assert_eq!(names, ["front", "back"]);
    for (text, complaint) in [
        (HEAD.replace(look, &format!("{look}{placed}")), "'transform' and 'look_from' exclude each other"),
        (HEAD.replace(look, "transform = [{ scale = 0 }]\n"), "singular"),
    ] {
        let error =
            read_by(&format!("{text}{BALL}"), &LoadOptions::default()).expect_err(complaint).to_string();
        assert!(error.contains(complaint), "{error}");
    }
}

/// Deforming meshes: the files of `mesh_keys` are their shapes at frames.
#[test]
fn mesh_keys_deform_meshes() {
    let folder = tempfile::tempdir().expect("a folder");
    let ply = |name: &str, x: f64, corners: usize| {
        let mut text = format!("ply\nformat ascii 1.0\nelement vertex {corners}\n");
        for key in ["x", "y", "z", "nx", "ny", "nz"] {
            text += &format!("property float {key}\n");
        }
        text += "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
        let places = [[0.0, 0.0], [1.0, 0.0], [x, 1.0], [2.0, 2.0]];
        places[..corners].iter().for_each(|[x, y]| text += &format!("{x} {y} 0 0 0 1\n"));
        std::fs::write(folder.path().join(name), text + "3 0 1 2\n").expect("written");
    };
    ply("now.ply", 3.0, 3);
    ply("before.ply", 1.0, 3);
    ply("after.ply", 5.0, 3);
    ply("other.ply", 5.0, 4);
    let read = |keys: &str, options: &LoadOptions| {
        let path = folder.path().join("scene.toml");
        let two = format!("mesh = \"now.ply\"\nmesh_keys = [{keys}]\n");
        std::fs::write(&path, format!("{HEAD}{two}[[objects]]\nmaterial = \"a\"\n{two}")).expect("written");
        load(&path, options)
    };
    let keys = "{ frame = -1, mesh = \"before.ply\" }, { frame = 0, mesh = \"now.ply\" }, { frame = 1, mesh = \"after.ply\" }";
    let mut options = LoadOptions::default();
    options.shutter.vectors = true;
    let scene = read(keys, &options).unwrap_or_else(|e| panic!("{e}")).scene;
    assert_eq!((scene.motion.meshes.len(), scene.instances.len()), (1, 2));
    let moving = scene.motion.meshes.values().next().expect("it deforms");
    let tip = |key: &oscura::scene::Vertices| key.positions[2][0];
    assert_eq!(moving.keys.iter().map(tip).collect::<Vec<_>>(), [2.5, 3.0, 3.5]);
    assert_eq!(moving.neighbours.as_ref().map(|n| n.each_ref().map(tip)), Some([1.0, 5.0]));
    assert!(scene.instances.iter().all(|instance| matches!(instance.motion, Motion::Keyed(_))));
    // Half a frame later.
    options.gltf.time_s = Some(0.5 / 24.0);
    let scene = read(keys, &options).unwrap_or_else(|e| panic!("{e}")).scene;
    assert_eq!(scene.meshes[scene.instances[0].mesh.index()].positions[2][0], 4.0);
    let odd = keys.replace("after", "other");
    let error = read(&odd, &options).expect_err("more vertices").to_string();
    assert!(error.contains("'mesh_keys'") && error.contains('4'), "{error}");
    let error = read(&keys.replace("-1", "0.5"), &options).expect_err("the order").to_string();
    assert!(error.contains("'mesh_keys'"), "{error}");
}

/// Sheared keyframes are interpolated sheared, and exact at the keys.
#[test]
fn keys_that_shear_are_kept() {
    let sheared = "matrix = [1, 0.5, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]";
    let keys = format!("[{{ frame = -1 }}, {{ frame = 1, transform = [{{ {sheared} }}] }}]");
    let text = format!("{HEAD}box = {{ min = [0, 0, 0], max = [1, 1, 1] }}\nmotion = {{ keys = {keys} }}\n");
    let scene = read(&text.replace("shutter = 0.5", "shutter = 2")).scene;
    let up = |key: &DAffine3| key.matrix3.y_axis.x;
    let keys: Vec<f64> = scene.motion.instances[0].keys.iter().map(up).collect();
    assert_eq!(keys, [0.0, 0.5]);
    assert_eq!(up(&scene.instances[0].world_from_object), 0.25);
}
