//! Scenes, nodes, transforms, cameras and lights.

use super::asset::{load_triangle, refusal, scene, triangle_bytes, triangle_with};
use oscura::math::DVec3;
use oscura::scene::{LightKind, Projection};
use serde_json::json;

#[test]
fn transforms_keep_full_precision() {
    // Neither number is an f32, nor is the product of the matrices.
    let asset = triangle_with(|a| {
        a["nodes"] = json!([
            {"translation": [1000000.0000001, 0.1, 0], "children": [1]},
            {"matrix": [1.000000000001, 0, 0, 0,  0, 1, 0, 0,  0, 0, 1, 0,  0.2, 0, 0, 1], "mesh": 0}
        ]);
    });
    let world = scene(&asset, &triangle_bytes()).instances[0].world_from_object;
    assert_eq!(world.translation, DVec3::new(1000000.0000001 + 0.2, 0.1, 0.0));
    assert_eq!(world.matrix3.x_axis.x, 1.000000000001);
}

#[test]
fn transforms_compose_with_parents() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let asset = triangle_with(|a| {
        a["nodes"] = json!([
            {"name": "turned", "rotation": [0, 0, half, half], "children": [1]},
            {"name": "moved", "translation": [1, 0, 0], "scale": [2, -3, 4], "mesh": 0}
        ]);
    });
    let instance = scene(&asset, &triangle_bytes()).instances[0].clone();
    assert_eq!(instance.name, "turned/moved");
    let moved = instance.world_from_object.transform_point3(DVec3::new(1.0, 1.0, 1.0));
    assert!((moved - DVec3::new(3.0, 3.0, 4.0)).length() < 1e-14, "{moved}");
}

#[test]
fn hierarchy_of_a_hundred_thousand_levels() {
    let count = 100_000;
    let asset = triangle_with(|a| {
        let node = |i: usize| if i + 1 < count { json!({"children": [i + 1]}) } else { json!({"mesh": 0}) };
        a["nodes"] = (0..count).map(node).collect();
    });
    assert_eq!(scene(&asset, &triangle_bytes()).instances.len(), 1);
}

#[test]
fn cycles_and_shared_children_are_refused() {
    for nodes in [
        json!([{"children": [1]}, {"children": [0]}]),
        json!([{"children": [0]}]),
        json!([{"children": [1, 2]}, {"children": [2]}, {"mesh": 0}]),
        json!([{"children": [1, 1]}, {"mesh": 0}]),
    ] {
        let message = refusal(&triangle_with(|a| a["nodes"] = nodes));
        assert!(message.contains("[node-cycle]"), "{message}");
    }
}

#[test]
fn selected_scene() {
    let nodes = json!([{"name": "a", "mesh": 0}, {"name": "b", "mesh": 0}, {"name": "c", "children": [1]}]);
    let shown = |change: fn(&mut serde_json::Value)| {
        let asset = triangle_with(|a| {
            a["nodes"] = nodes.clone();
            a["scenes"] = json!([{"nodes": [0]}, {"nodes": [1]}]);
            change(a);
        });
        let loaded = load_triangle(&asset).expect("it loads");
        loaded.scene.instances.iter().map(|i| i.name.clone()).collect::<Vec<_>>()
    };
    assert_eq!(shown(|a| a["scene"] = json!(1)), ["b"]);
    assert_eq!(shown(|a| drop(a.as_object_mut().expect("an object").remove("scene"))), ["a"]);
    let no_scenes = |a: &mut serde_json::Value| {
        let object = a.as_object_mut().expect("an object");
        object.remove("scene");
        object.remove("scenes");
    };
    assert_eq!(shown(no_scenes), ["a", "c/b"]);
}

#[test]
fn scene_settings() {
    let asset =
        triangle_with(|a| a["scenes"][0]["extras"] = json!({"width": 640, "height": -1, "bounces": 7}));
    let loaded = load_triangle(&asset).expect("it loads");
    let settings = &loaded.scene.settings;
    assert_eq!((settings.width, settings.height, settings.depth), (Some(640), None, Some(7)));
    assert!(loaded.warnings.iter().any(|w| w.place == "/scenes/0/extras/height"));
}

#[test]
fn camera_scale_is_ignored() {
    let asset = triangle_with(|a| {
        a["nodes"] = json!([{"mesh": 0, "camera": 0, "scale": [2, 3, -4], "children": [1]}, {"camera": 1}]);
        a["cameras"] = json!([
            {"type": "perspective", "perspective": {"yfov": 0.7, "aspectRatio": 1.5, "znear": 0.1}},
            {"type": "orthographic", "name": "flat", "orthographic": {"xmag": 4, "ymag": 2, "zfar": 9, "znear": 0}}
        ]);
    });
    let cameras = scene(&asset, &triangle_bytes()).cameras;
    let rotation = cameras[0].world_from_camera.matrix3;
    assert!((rotation.determinant() - 1.0).abs() < 1e-14);
    // It still looks along its -z axis.
    assert_eq!(rotation.z_axis, DVec3::NEG_Z);
    assert_eq!(cameras[0].projection, Projection::Perspective { vfov_rad: 0.7 });
    assert_eq!(cameras[0].aspect_ratio, Some(1.5));
    assert_eq!(cameras[1].projection, Projection::Orthographic { half_height: 2.0 });
    assert_eq!((cameras[1].aspect_ratio, cameras[1].name.as_str()), (Some(2.0), "flat"));
}

#[test]
fn light_units_are_converted_to_watts() {
    let light = |index: usize| json!({"KHR_lights_punctual": {"light": index}});
    let asset = triangle_with(|a| {
        a["extensionsRequired"] = json!(["KHR_lights_punctual"]);
        a["extensions"] = json!({"KHR_lights_punctual": {"lights": [
            {"type": "point", "intensity": 1366, "color": [1, 0.5, 0]},
            {"type": "directional", "intensity": 683},
            {"type": "spot", "intensity": 683, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.3}}
        ]}});
        a["nodes"] = json!([
            {"mesh": 0, "children": [1, 2, 3]},
            {"translation": [1, 2, 3], "scale": [5, 5, 5], "extensions": light(0)},
            {"extensions": light(1)},
            {"rotation": [1, 0, 0, 0], "extensions": light(2)}
        ]);
    });
    let loaded = load_triangle(&asset).expect("it loads");
    let lights = &loaded.scene.lights;
    assert_eq!(lights[0].intensity, [2.0, 1.0, 0.0]);
    assert!(matches!(lights[0].kind, LightKind::Point { position } if position == DVec3::new(1.0, 2.0, 3.0)));
    assert!(matches!(lights[1].kind, LightKind::Directional { direction } if direction == DVec3::NEG_Z));
    let LightKind::Spot { direction, inner_angle_rad, outer_angle_rad, .. } = lights[2].kind else {
        panic!("{:?}", lights[2]);
    };
    assert!((direction - DVec3::Z).length() < 1e-14);
    assert_eq!((inner_angle_rad, outer_angle_rad), (0.2, 0.3));
    assert!(loaded.notes.iter().any(|w| w.message.contains("683")));
}

#[test]
fn flat_and_invisible_nodes_are_culled() {
    let flat = triangle_with(|a| a["nodes"][0]["scale"] = json!([1, 0, 1]));
    let loaded = load_triangle(&flat).expect("it loads");
    assert!(loaded.scene.instances.is_empty());
    assert!(loaded.warnings.iter().any(|w| w.code == "mesh-degenerate"));
    let hidden = triangle_with(|a| {
        a["nodes"][0]["extensions"] = json!({"KHR_node_visibility": {"visible": false}});
    });
    assert!(load_triangle(&hidden).expect("it loads").scene.instances.is_empty());
}
