//! Animations, skins and morph targets at a time.

use super::asset::{floats, triangle_bytes, triangle_with};
use crate::codes::has_code;
use oscura::load::gltf::GltfOptions;
use oscura::load::{LoadOptions, Loaded, ShutterOptions};
use oscura::math::{DQuat, DVec3};
use oscura::scene::{LightKind, Motion};
use serde_json::{Value, json};

/// Loads an asset over the triangle's bytes and more floats, at a time.
pub fn at(asset: &Value, more: &[f32], time_s: Option<f64>) -> Result<Loaded, oscura::error::Error> {
    let mut asset = asset.clone();
    let mut bytes = triangle_bytes();
    bytes.extend(floats(more));
    asset["buffers"][0]["byteLength"] = json!(bytes.len());
    let gltf = GltfOptions { time_s, ..GltfOptions::default() };
    super::asset::load_by(&asset, &[("a.bin", &bytes)], &LoadOptions { gltf, ..LoadOptions::default() })
}

/// The triangle with accessors 2, 3, ... over the floats that follow its bytes: type and count of each.
pub fn with_floats(accessors: &[(&str, usize)], change: impl FnOnce(&mut Value)) -> Value {
    triangle_with(|a| {
        let mut offset = 44;
        for &(kind, count) in accessors {
            let numbers = match kind {
                "SCALAR" => 1,
                "VEC2" => 2,
                "VEC3" => 3,
                "VEC4" => 4,
                _ => 16,
            };
            let length = numbers * count * 4;
            let views = a["bufferViews"].as_array_mut().expect("a list");
            views.push(json!({"buffer": 0, "byteOffset": offset, "byteLength": length}));
            let view = views.len() - 1;
            let accessor = json!({"bufferView": view, "componentType": 5126, "type": kind, "count": count});
            a["accessors"].as_array_mut().expect("a list").push(accessor);
            offset += length;
        }
        change(a);
    })
}

/// Node 0 translates by (10 t, 0, 0) for t in 0..2, rotates about z by 90 degrees in the first second, and scales in steps.
fn moving() -> (Value, Vec<f32>) {
    let s = std::f32::consts::FRAC_1_SQRT_2;
    let numbers = vec![
        0.0, 2.0, // 2: times
        0.0, 0.0, 0.0, 20.0, 0.0, 0.0, // 3: translations
        0.0, 0.0, 0.0, 1.0, 0.0, 0.0, s, s, // 4: rotations
        0.0, 1.0, // 5: times
        1.0, 1.0, 1.0, 3.0, 3.0, 3.0, // 6: scales
    ];
    let asset = with_floats(&[("SCALAR", 2), ("VEC3", 2), ("VEC4", 2), ("SCALAR", 2), ("VEC3", 2)], |a| {
        a["animations"] = json!([{
            "channels": [
                {"sampler": 0, "target": {"node": 0, "path": "translation"}},
                {"sampler": 1, "target": {"node": 0, "path": "rotation"}},
                {"sampler": 2, "target": {"node": 0, "path": "scale"}},
                {"sampler": 0, "target": {"path": "pointer", "extensions":
                    {"KHR_animation_pointer": {"pointer": "/materials/0/emissiveFactor"}}}}
            ],
            "samplers": [
                {"input": 2, "output": 3},
                {"input": 5, "output": 4, "interpolation": "LINEAR"},
                {"input": 5, "output": 6, "interpolation": "STEP"}
            ]
        }]);
        a["nodes"][0]["translation"] = json!([7, 0, 0]);
    });
    (asset, numbers)
}

#[test]
fn nodes_move_only_if_a_time_is_given() {
    let (asset, numbers) = moving();
    let rest = at(&asset, &numbers, None).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(rest.scene.instances[0].world_from_object.translation, DVec3::new(7.0, 0.0, 0.0));
    assert!(rest.left_out.iter().any(|l| l.contains("animations")), "{:?}", rest.left_out);

    let half = at(&asset, &numbers, Some(0.5)).unwrap_or_else(|e| panic!("{e}"));
    let (scale, rotation, translation) =
        half.scene.instances[0].world_from_object.to_scale_rotation_translation();
    assert!((translation - DVec3::new(5.0, 0.0, 0.0)).length() < 1e-12);
    assert!((scale - DVec3::ONE).length() < 1e-6, "a step holds until its next key");
    let eighth = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_4);
    assert!(rotation.dot(eighth).abs() > 1.0 - 1e-7);
    let glow = half.scene.materials[0].emission.expect("a pointer leads to it").radiance.factor;
    assert_eq!(glow, [5.0, 0.0, 0.0]);

    let late = at(&asset, &numbers, Some(100.0)).unwrap_or_else(|e| panic!("{e}"));
    let (scale, _, translation) = late.scene.instances[0].world_from_object.to_scale_rotation_translation();
    assert!((translation.x - 20.0).abs() < 1e-12 && (scale.y - 3.0).abs() < 1e-6);
}

#[test]
fn invalid_animations_are_reported_only_when_played() {
    type Change = fn(&mut Value);
    let cases: &[(Change, &[&str])] = &[
        (|a| a["animations"][0]["channels"][0]["sampler"] = json!(9), &["/channels/0/sampler"]),
        (|a| a["animations"][0]["channels"][0]["target"]["node"] = json!(9), &["/channels/0/target/node"]),
        (|a| a["animations"][0]["samplers"][0]["output"] = json!(4), &["/accessors/4", "VEC3"]),
        (|a| a["animations"][0]["samplers"][0]["input"] = json!(3), &["/accessors/3", "SCALAR"]),
        (|a| a["accessors"][3]["count"] = json!(1), &["2 keys", "3 numbers"]),
        (|a| a["animations"][0]["samplers"][0]["interpolation"] = json!("CUBICSPLINE"), &["2 keys"]),
        (|a| a["animations"][0]["samplers"][0]["interpolation"] = json!("NONE"), &["CUBICSPLINE"]),
        // Required properties.
        (|a| without(&mut a["animations"][0], "channels"), &["/animations/0/channels: is missing"]),
        (|a| without(&mut a["animations"][0], "samplers"), &["/channels/0/sampler", "does not exist"]),
        (
            |a| without(&mut a["animations"][0]["channels"][0], "sampler"),
            &["/channels/0/sampler: is missing"],
        ),
        (|a| without(&mut a["animations"][0]["channels"][0], "target"), &["/channels/0/target: is missing"]),
        (|a| without(&mut a["animations"][0]["samplers"][0], "input"), &["/samplers/0/input: is missing"]),
        (|a| without(&mut a["animations"][0]["samplers"][0], "output"), &["/samplers/0/output: is missing"]),
    ];
    for (change, words) in cases {
        let (mut asset, numbers) = moving();
        change(&mut asset);
        at(&asset, &numbers, None).unwrap_or_else(|e| panic!("{e}"));
        let message = at(&asset, &numbers, Some(0.0)).expect_err("it is broken").to_string();
        for word in *words {
            assert!(message.contains(word), "'{word}' is not in: {message}");
        }
    }
}

fn without(object: &mut Value, key: &str) {
    object.as_object_mut().and_then(|o| o.remove(key)).expect("it was there");
}

#[test]
fn unsupported_channels_are_counted() {
    let (mut asset, numbers) = moving();
    without(&mut asset["animations"][0]["channels"][0]["target"], "node");
    let loaded = at(&asset, &numbers, Some(1.0)).unwrap_or_else(|e| panic!("{e}"));
    let messages: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    assert!(has_code(&loaded.warnings, "channels-without-node"), "{messages:?}");
}

/// A mesh with these weights of two targets, which move its first vertex by x and by 4 z; more accessors start at 4.
fn with_two_targets(weights: &Value, more: &[(&str, usize)], change: impl FnOnce(&mut Value)) -> Value {
    with_floats(&[&[("VEC3", 3), ("VEC3", 3)], more].concat(), |a| {
        a["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 2}, {"POSITION": 3}]);
        a["meshes"][0]["weights"] = weights.clone();
        change(a);
    })
}

/// The data of the accessors of [`with_two_targets`].
fn two_targets(more: &[f32]) -> Vec<f32> {
    let mut numbers = vec![0.0; 18];
    (numbers[0], numbers[11]) = (1.0, 4.0);
    numbers.extend(more);
    numbers
}

/// The target of a channel that animates a pointer.
pub(super) fn pointer_target(pointer: &str) -> Value {
    json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}})
}

/// Two targets move the first vertex; weights come from the mesh, the node and an animation, in ascending precedence.
#[test]
fn morph_targets_add_up() {
    let numbers = two_targets(&[
        0.0, 1.0, // 4: times
        0.0, 0.0, 1.0, 1.0, // 5: weights
    ]);
    let mut asset = with_two_targets(&json!([0.5, 0]), &[("SCALAR", 2), ("SCALAR", 4)], |_| {});
    let corner = |asset: &Value, time: Option<f64>| {
        at(asset, &numbers, time).unwrap_or_else(|e| panic!("{e}")).scene.meshes[0].positions[0]
    };
    assert_eq!(corner(&asset, None), [0.5, 0.0, 0.0]);
    asset["nodes"] = json!([{"mesh": 0, "weights": [0, 0.25]}, {"mesh": 0}]);
    asset["scenes"][0]["nodes"] = json!([0, 1]);
    assert_eq!(corner(&asset, None), [0.0, 0.0, 1.0]);
    // The second node uses the mesh's own weights: another shape of the same mesh.
    let both = at(&asset, &numbers, None).expect("it loads").scene;
    assert_eq!((both.meshes.len(), both.meshes[1].positions[0]), (2, [0.5, 0.0, 0.0]));
    asset["animations"] = json!([{
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
        "samplers": [{"input": 4, "output": 5}]
    }]);
    assert_eq!(corner(&asset, Some(0.5)), [0.5, 0.0, 2.0]);
    // A target of another length is a problem, but not while its weight is 0.
    asset["accessors"][2]["count"] = json!(2);
    at(&asset, &numbers, Some(0.0)).expect_err("the second node still shows the first target");
    asset["meshes"][0]["weights"] = json!([0, 0]);
    at(&asset, &numbers, Some(0.0)).unwrap_or_else(|e| panic!("{e}"));
}

/// Weights of meshes, as arrays and single elements, animated by pointers.
#[test]
fn pointers_animate_weight_arrays_and_elements() {
    let numbers = two_targets(&[
        0.0, 1.0, // 4: times
        0.0, 1.0, // 5: a weight
        0.0, 0.5, 1.0, 1.0, // 6: both
    ]);
    let driven = |pointer: &str, output: usize| {
        with_two_targets(&json!([0.5, 0.25]), &[("SCALAR", 2), ("SCALAR", 2), ("SCALAR", 4)], |a| {
            a["animations"] = json!([{
                "channels": [{"sampler": 0, "target": pointer_target(pointer)}],
                "samplers": [{"input": 4, "output": output}]
            }]);
        })
    };
    let corner = |asset: &Value| {
        let loaded = at(asset, &numbers, Some(1.0)).unwrap_or_else(|e| panic!("{e}"));
        assert!(!has_code(&loaded.warnings, "morph-weight-count"));
        loaded.scene.meshes[0].positions[0]
    };
    assert_eq!(corner(&driven("/meshes/0/weights", 6)), [1.0, 0.0, 4.0]);
    assert_eq!(corner(&driven("/meshes/0/weights/1", 5)), [0.5, 0.0, 4.0]);
    assert_eq!(corner(&driven("/nodes/0/weights/0", 5)), [1.0, 0.0, 1.0]);
    // A node's own weights override those of its mesh.
    let mut own = driven("/meshes/0/weights", 6);
    own["nodes"][0]["weights"] = json!([0.0, 0.5]);
    assert_eq!(corner(&own), [0.0, 0.0, 2.0]);

    let surplus = at(&driven("/nodes/0/weights/7", 5), &numbers, Some(1.0)).expect("it loads");
    assert!(has_code(&surplus.warnings, "morph-weight-count"), "{:?}", surplus.warnings);
    let message = at(&driven("/meshes/9/weights", 6), &numbers, Some(1.0)).expect_err("no mesh").to_string();
    assert!(message.contains("/animations/0/channels/0"), "{message}");
    let huge = at(&driven("/nodes/0/weights/4000000000", 5), &numbers, Some(1.0)).expect("it loads");
    assert!(has_code(&huge.warnings, "animation-pointer-unknown"), "{:?}", huge.warnings);
}

/// One vertex on the first joint, one on the second, and one half on both. The mesh's node has another transform, which must be
/// ignored; the inverse bind matrix of the second joint cancels its rest position.
#[test]
fn skins_move_vertices_with_their_joints() {
    let bind_second = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., -5., 0., 0., 1.];
    let identity = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
    let mut numbers = vec![
        1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, // 2: weights
    ];
    numbers.extend(identity);
    numbers.extend(bind_second); // 3: bind matrices
    let asset = with_floats(&[("VEC4", 3), ("MAT4", 2)], |a| {
        // Joints of the three vertices as bytes, over the indices 0 1 2 of the triangle: a sparse accessor of zeros.
        a["accessors"].as_array_mut().expect("a list").push(json!({
            "componentType": 5121, "type": "VEC4", "count": 3,
            "sparse": {"count": 2, "indices": {"bufferView": 1, "byteOffset": 2, "componentType": 5123},
                       "values": {"bufferView": 4}}
        }));
        a["bufferViews"]
            .as_array_mut()
            .expect("a list")
            .push(json!({"buffer": 0, "byteOffset": 44 + 4 * (12 + 32), "byteLength": 8}));
        a["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = json!(4);
        a["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(2);
        a["nodes"] = json!([
            {"mesh": 0, "skin": 0, "translation": [1000, 0, 0], "children": [1]},
            {"translation": [-1000, 0, 100]},
            {"translation": [5, 0, 0], "children": []}
        ]);
        a["nodes"][1]["children"] = json!([2]);
        a["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": 3}]);
    });
    // Vertex 1 is on joint 1 alone; vertex 2 on joints 0 and 1.
    numbers.push(f32::from_le_bytes([1, 1, 1, 1]));
    numbers.push(f32::from_le_bytes([0, 1, 0, 0]));
    let mut asset = asset;
    // Weights of vertex 1: all on the second of its four joints, which are all joint 1.
    let loaded = at(&asset, &numbers, None).unwrap_or_else(|e| panic!("{e}"));
    let world = |loaded: &Loaded| {
        let instance = &loaded.scene.instances[0];
        let positions = &loaded.scene.meshes[instance.mesh.index()].positions;
        let place = |p: &[f32; 3]| DVec3::from_array(p.map(f64::from));
        positions.iter().map(|p| instance.world_from_object.transform_point3(place(p))).collect::<Vec<_>>()
    };
    let z = DVec3::new(0.0, 0.0, 100.0);
    assert_eq!(world(&loaded), [z, z + DVec3::X, z + DVec3::Y]);
    // The second joint rises by 2: vertex 1 follows, vertex 2 by half.
    asset["nodes"][2]["translation"] = json!([5, 2, 0]);
    let loaded = at(&asset, &numbers, None).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(world(&loaded), [z, z + DVec3::new(1.0, 2.0, 0.0), z + DVec3::new(0.0, 2.0, 0.0)]);

    let broken = |change: fn(&mut Value), word: &str| {
        let mut asset = asset.clone();
        change(&mut asset);
        let message = at(&asset, &numbers, None).expect_err("it is broken").to_string();
        assert!(message.contains(word), "{message}");
    };
    broken(|a| a["skins"][0]["joints"] = json!([1]), "the skin has 1");
    broken(|a| a["skins"][0]["joints"] = json!([1, 99]), "/nodes/99");
    broken(|a| a["skins"][0]["joints"] = json!([]), "/skins/0/joints");
    broken(|a| a["accessors"][3]["count"] = json!(1), "MAT4");
    broken(|a| a["nodes"][0]["skin"] = json!(3), "/skins/3");
}

/// The asset with the shutter open for some frames, a tenth of a second each, around half a second.
fn open(asset: &Value, more: &[f32], frames: f64, vectors: bool) -> Loaded {
    let mut asset = asset.clone();
    let mut bytes = triangle_bytes();
    bytes.extend(floats(more));
    asset["buffers"][0]["byteLength"] = json!(bytes.len());
    let gltf = GltfOptions { time_s: Some(0.5), ..GltfOptions::default() };
    let shutter = ShutterOptions { frames: Some(frames), vectors, fps: 10.0, ..ShutterOptions::default() };
    let options = LoadOptions { gltf, shutter, ..LoadOptions::default() };
    super::asset::load_by(&asset, &[("a.bin", &bytes)], &options).unwrap_or_else(|e| panic!("{e}"))
}

/// Motion keys of the moving node, with a frame before and after.
#[test]
fn nodes_move_while_the_shutter_is_open() {
    let (asset, numbers) = moving();
    let with = |frames: f64, vectors: bool| open(&asset, &numbers, frames, vectors);
    let scene = with(2.0, true).scene;
    assert_eq!(scene.instances[0].motion, Motion::Keyed(0));
    let motion = &scene.motion.instances[0];
    // 18 degrees: four steps of 4.5.
    assert_eq!(motion.keys.len(), 5);
    let x: Vec<f64> = motion.keys.iter().map(|key| key.translation.x).collect();
    for (found, truth) in x.iter().zip([4.0, 4.5, 5.0, 5.5, 6.0]) {
        assert!((found - truth).abs() < 1e-5, "{x:?}");
    }
    let [before, after] = motion.neighbours.expect("they were asked for").map(|m| m.translation.x);
    assert!((before - 4.0).abs() < 1e-5 && (after - 6.0).abs() < 1e-5);
    // Closed, it is the scene at that time.
    let (closed, plain) =
        (with(0.0, false), at(&asset, &numbers, Some(0.5)).unwrap_or_else(|e| panic!("{e}")));
    assert_eq!(format!("{:?}", closed.scene), format!("{:?}", plain.scene));
}

/// Weights count as motion: also where they are 0 at some times, and for each node with its own weights of one mesh.
#[test]
fn morph_targets_move_while_the_shutter_is_open() {
    let numbers = [
        0.0, 0.5, 1.0, // 2: times
        0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, // 3: a target that moves all by 1 along z
        0.0, 1.0, 0.0, // 4: weights
        2.0, 1.0, 0.0, // 5: weights of another node, the same at half a second
        0.0, 0.0, 0.0, // 6: no change
    ];
    let accessors = [("SCALAR", 3), ("VEC3", 3), ("SCALAR", 3), ("SCALAR", 3), ("SCALAR", 3)];
    let asset = with_floats(&accessors, |a| {
        a["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 3}]);
        a["nodes"] = json!([{"mesh": 0}, {"mesh": 0}, {"mesh": 0}, {"mesh": 0}]);
        a["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
        let channel = |node: u32| json!({"sampler": node, "target": {"node": node, "path": "weights"}});
        let sampler = |node: u32| json!({"input": 2, "output": 4 + node});
        let (channels, samplers) = ([0, 1, 2].map(channel), [0, 1, 2].map(sampler));
        a["animations"] = json!([{"channels": channels, "samplers": samplers}]);
    });
    let scene = open(&asset, &numbers, 10.0, true).scene;
    let heights = |node: usize| {
        let moving = scene.motion.meshes.get(&scene.instances[node].mesh.index())?;
        Some(moving.keys.iter().map(|key| key.positions[0][2]).collect::<Vec<_>>())
    };
    // Three keys suffice for the first vertex.
    assert_eq!(heights(0), Some(vec![0.0, 1.0, 0.0]));
    assert_eq!(heights(1), Some(vec![2.0, 1.0, 0.0]));
    assert_eq!([heights(2), heights(3)], [None, None]);
    let now = |node: usize| scene.meshes[scene.instances[node].mesh.index()].positions[0][2];
    assert_eq!([0, 1, 2, 3].map(now), [1.0, 1.0, 0.0, 0.0]);
    // Mesh weights animated by a pointer: they apply to all nodes without own weights.
    let mut of_mesh = asset.clone();
    let target = pointer_target("/meshes/0/weights");
    of_mesh["animations"][0]["channels"] = json!([{"sampler": 0, "target": target}]);
    let shared = open(&of_mesh, &numbers, 10.0, true).scene;
    let mesh = shared.instances[3].mesh.index();
    let heights: Vec<f32> = shared.motion.meshes[&mesh].keys.iter().map(|key| key.positions[0][2]).collect();
    assert_eq!(heights, [0.0, 1.0, 0.0]);
    let vectors = open(&asset, &numbers, 0.0, true).scene.motion;
    let neighbours = vectors.meshes[&0].neighbours.as_ref().expect("they were asked for");
    for neighbour in neighbours {
        assert!((neighbour.positions[0][2] - 0.8).abs() < 1e-6, "{neighbour:?}");
    }
}

/// Objects and lights at the position of a moving node do not move with it.
#[test]
fn lights_and_cameras_have_their_own_motion() {
    let numbers = [
        0.0, 1.0, // 2: times
        -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, // 3: to the right
        1.0, 0.0, 0.0, -1.0, 0.0, 0.0, // 4: to the left
    ];
    let asset = with_floats(&[("SCALAR", 2), ("VEC3", 2), ("VEC3", 2)], |a| {
        let lamp = || json!({"extensions": {"KHR_lights_punctual": {"light": 0}}});
        a["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}});
        a["extensionsUsed"] = json!(["KHR_lights_punctual"]);
        a["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}]);
        a["nodes"] = json!([{"mesh": 0}, lamp(), lamp(), lamp(), {"camera": 0}, {"camera": 0}]);
        a["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4, 5]);
        let channel = |(node, sampler): (u32, u32)| json!({"sampler": sampler, "target": {"node": node, "path": "translation"}});
        let channels = [(1, 0), (2, 1), (4, 1)].map(channel);
        a["animations"] = json!([{
            "channels": channels,
            "samplers": [{"input": 2, "output": 3}, {"input": 2, "output": 4}]
        }]);
    });
    let scene = open(&asset, &numbers, 2.0, false).scene;
    let place = |kind: &LightKind| match kind {
        LightKind::Point { position } => (position.x * 10.0).round(),
        _ => f64::NAN,
    };
    let ways = scene.lights.iter().map(|light| {
        let keys = light.motion.iter().flat_map(|moving| &moving.keys);
        (place(&light.kind), keys.map(place).collect::<Vec<f64>>())
    });
    let truth = [(0.0, vec![-2.0, 2.0]), (0.0, vec![2.0, -2.0]), (0.0, vec![])];
    assert!(ways.eq(truth), "{:?}", scene.lights);
    let moves = |camera: usize| scene.cameras[camera].motion.is_some();
    assert_eq!([moves(0), moves(1)], [true, false]);
}

/// Nodes of the same name are distinct objects.
#[test]
fn visibility_is_per_node() {
    let asset = triangle_with(|a| {
        let extras = json!({"is_holdout": true, "light_group": "key"});
        a["nodes"] = json!([{"mesh": 0, "name": "Cube", "extras": extras}, {"mesh": 0, "name": "Cube"}]);
        a["scenes"][0]["nodes"] = json!([0, 1]);
    });
    let scene = at(&asset, &[], None).unwrap_or_else(|e| panic!("{e}")).scene;
    let is_holdout = |i: usize| scene.instances[i].traits.is_holdout;
    assert_eq!([is_holdout(0), is_holdout(1)], [true, false]);
    let group = |i: usize| scene.instances[i].light_group.as_deref();
    assert_eq!([group(0), group(1)], [Some("key"), None]);
}

/// Custom properties of Blender: portals for nodes, priorities for materials.
#[test]
fn extras_set_portals_and_priorities() {
    let asset = triangle_with(|a| {
        a["materials"] = json!([{"extras": {"priority": 3}}, {"extras": {"priority": 0.5}}]);
        a["meshes"][0]["primitives"][0]["material"] = json!(0);
        let second = a["meshes"][0]["primitives"][0].clone();
        a["meshes"][0]["primitives"].as_array_mut().expect("a list").push(second);
        a["meshes"][0]["primitives"][1]["material"] = json!(1);
        a["nodes"] = json!([
            {"mesh": 0},
            {"name": "Window", "extras": {"portal": [2.0, 1.0]}, "translation": [1, 2, 3], "scale": [1, 3, 1]},
            {"extras": {"portal": true}, "rotation": [0, 1, 0, 0]},
            {"extras": {"portal": false}},
            {"extras": {"portal": [1.0, 0.0]}},
        ]);
        a["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4]);
    });
    let loaded = at(&asset, &[], None).unwrap_or_else(|e| panic!("{e}"));
    let priorities: Vec<i32> = loaded.scene.materials.iter().map(|m| m.priority).collect();
    assert_eq!(priorities, [3, 0]);
    let [window, other] = &loaded.scene.portals[..] else { panic!("{:?}", loaded.scene.portals) };
    assert_eq!(window.name, "Window");
    let middle = window.corner + (window.edge_u + window.edge_v) / 2.0;
    assert!(middle.distance(DVec3::new(1.0, 2.0, 3.0)) < 1e-9, "{window:?}");
    // Light enters along -z of the node, as u x v points.
    assert!(window.edge_u.cross(window.edge_v).distance(DVec3::new(0.0, 0.0, -6.0)) < 1e-9, "{window:?}");
    assert!(other.edge_u.cross(other.edge_v).distance(DVec3::Z) < 1e-6, "{other:?}");
    let warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    let warned = |words: &str| warnings.iter().filter(|w| w.contains(words)).count();
    assert_eq!([warned("extras/priority"), warned("extras/portal")], [1, 1], "{warnings:?}");
}
