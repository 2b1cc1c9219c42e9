//! KHR_animation_pointer: materials, textures, lights, cameras and nodes animated by JSON pointers.

use super::animation::{at, pointer_target, with_floats};
use super::asset::{floats, triangle_bytes};
use super::materials::RED;
use crate::files::folder_of;
use oscura::load::{LoadOptions, Loaded, load_times};
use oscura::math::DVec3;
use oscura::scene::{LightKind, Mapping, Model, PbrMaterial, Projection, Quad, Texture};
use serde_json::{Value, json};
use std::ops::ControlFlow;

/// Adds a channel over accessors 2 (times) and `output` that animates a pointer.
fn drive(a: &mut Value, pointer: &str, output: usize, interpolation: &str) {
    if a["animations"].is_null() {
        a["animations"] = json!([{"channels": [], "samplers": []}]);
    }
    let samplers = a["animations"][0]["samplers"].as_array_mut().expect("a list");
    samplers.push(json!({"input": 2, "output": output, "interpolation": interpolation}));
    let sampler = samplers.len() - 1;
    let channel = json!({"sampler": sampler, "target": pointer_target(pointer)});
    a["animations"][0]["channels"].as_array_mut().expect("a list").push(channel);
}

/// Times 0 and 2; then values of 1 to 4 components, and for one a cubic spline.
const NUMBERS: [f32; 28] = [
    0.0, 2.0, // 2
    0.5, 1.0, // 3: SCALAR
    0.0, 0.0, 1.0, 0.5, // 4: VEC2
    0.0, 0.0, 0.0, 1.0, 0.5, 0.25, // 5: VEC3
    0.0, 0.0, 0.0, 1.0, 1.0, 0.5, 0.25, 0.5, // 6: VEC4
    0.0, 0.0, 0.0, 12.0, 8.0, 12.0, // 7: SCALAR, the cubic t^3
];

fn driven(change: impl FnOnce(&mut Value)) -> Value {
    let accessors = [("SCALAR", 2), ("SCALAR", 2), ("VEC2", 2), ("VEC3", 2), ("VEC4", 2), ("SCALAR", 6)];
    with_floats(&accessors, change)
}

fn show(asset: &Value, time_s: f64) -> Loaded {
    at(asset, &NUMBERS, Some(time_s)).unwrap_or_else(|e| panic!("{e}"))
}

fn pbr(loaded: &Loaded) -> &PbrMaterial {
    match &loaded.scene.materials[0].model {
        Model::Pbr(pbr) => pbr,
        other => panic!("{other:?}"),
    }
}

fn messages(loaded: &Loaded, words: &str) -> bool {
    loaded.warnings.iter().any(|w| w.to_string().contains(words))
}

#[test]
fn materials_are_animated() {
    let asset = driven(|a| {
        a["materials"][0]["emissiveFactor"] = json!([1, 1, 1]);
        a["materials"][0]["extensions"] = json!({"KHR_materials_ior": {"ior": 1.1}});
        drive(a, "/materials/0/pbrMetallicRoughness/baseColorFactor", 6, "LINEAR");
        drive(a, "/materials/0/pbrMetallicRoughness/roughnessFactor", 3, "STEP");
        drive(
            a,
            "/materials/0/extensions/KHR_materials_emissive_strength/emissiveStrength",
            7,
            "CUBICSPLINE",
        );
        drive(a, "/materials/0/extensions/KHR_materials_ior/ior", 7, "CUBICSPLINE");
    });
    let half = show(&asset, 1.5);
    let near = |found: &[f32], wanted: &[f32]| {
        assert!(found.iter().zip(wanted).all(|(f, w)| (f - w).abs() < 1e-5), "{found:?} {wanted:?}");
    };
    near(&pbr(&half).base_color.factor, &[0.75, 0.375, 0.1875]);
    near(&[pbr(&half).roughness.factor, pbr(&half).ior], &[0.5, 3.375]);
    let glow = half.scene.materials[0].emission.expect("it emits").radiance.factor;
    near(&glow, &[3.375; 3]);
    near(&[pbr(&show(&asset, 2.0)).roughness.factor], &[1.0]);
    // At rest no motion.
    let rest = at(&asset, &NUMBERS, None).unwrap_or_else(|e| panic!("{e}"));
    near(&pbr(&rest).base_color.factor, &[1.0; 3]);
    near(&[pbr(&rest).ior, pbr(&rest).roughness.factor], &[1.1, 1.0]);
    assert!(!messages(&half, "is not supported") && !messages(&half, "is ignored"), "{:?}", half.warnings);
}

#[test]
fn lights_cameras_and_nodes_are_animated() {
    let asset = driven(|a| {
        a["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "intensity": 683}]}});
        a["cameras"] = json!([
            {"type": "perspective", "perspective": {"yfov": 0.1, "znear": 0.1}},
            {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0, "zfar": 9}}
        ]);
        a["nodes"] = json!([
            {"mesh": 0},
            {"camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"camera": 1}
        ]);
        a["scenes"][0]["nodes"] = json!([0, 1, 2]);
        drive(a, "/extensions/KHR_lights_punctual/lights/0/color", 5, "LINEAR");
        drive(a, "/extensions/KHR_lights_punctual/lights/0/spot/outerConeAngle", 3, "LINEAR");
        drive(a, "/cameras/0/perspective/yfov", 3, "LINEAR");
        drive(a, "/cameras/0/perspective/znear", 3, "LINEAR");
        drive(a, "/cameras/1/orthographic/ymag", 3, "LINEAR");
        drive(a, "/nodes/0/translation", 5, "LINEAR");
        drive(a, "/nodes/0/rotation", 6, "LINEAR");
    });
    let half = show(&asset, 1.0);
    let light = &half.scene.lights[0];
    assert!((light.intensity[0] - 0.5).abs() < 1e-6 && (light.intensity[2] - 0.125).abs() < 1e-6);
    let LightKind::Spot { outer_angle_rad, .. } = light.kind else { panic!("{light:?}") };
    assert!((outer_angle_rad - 0.75).abs() < 1e-9);
    let projections: Vec<Projection> = half.scene.cameras.iter().map(|c| c.projection).collect();
    let [Projection::Perspective { vfov_rad }, Projection::Orthographic { half_height }] = projections[..]
    else {
        panic!("{projections:?}")
    };
    assert!((vfov_rad - 0.75).abs() < 1e-9 && (half_height - 0.75).abs() < 1e-9);
    let place = half.scene.instances[0].world_from_object.translation;
    assert!((place - DVec3::new(0.5, 0.25, 0.125)).length() < 1e-9, "{place}");
    assert!(!messages(&half, "is ignored"), "{:?}", half.warnings);
}

/// The texture transform, which the file need not contain; and visibility, by bytes 0 and 1.
#[test]
fn texture_transforms_and_visibility_are_animated() {
    let mut asset = driven(|a| {
        a["materials"][0]["pbrMetallicRoughness"] = json!({"baseColorTexture": {"index": 0}});
        a["textures"] = json!([{"source": 0}]);
        a["images"] = json!([{"uri": "red.png"}]);
        let transform = "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform";
        drive(a, &format!("{transform}/offset"), 4, "LINEAR");
        drive(a, &format!("{transform}/rotation"), 7, "CUBICSPLINE");
    });
    let mut bytes = triangle_bytes();
    bytes.extend(floats(&NUMBERS));
    let start = bytes.len();
    bytes.extend([1, 0, 0, 0]);
    let views = asset["bufferViews"].as_array_mut().expect("a list");
    views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": 2}));
    let view = views.len() - 1;
    let flags = json!({"bufferView": view, "componentType": 5121, "type": "SCALAR", "count": 2});
    asset["accessors"].as_array_mut().expect("a list").push(flags);
    asset["buffers"][0]["byteLength"] = json!(bytes.len());
    drive(&mut asset, "/nodes/0/extensions/KHR_node_visibility/visible", 8, "STEP");
    let text = asset.to_string();
    let folder = folder_of(&[("a.bin", bytes.as_slice()), ("red.png", RED), ("a.gltf", text.as_bytes())]);
    let path = folder.path().join("a.gltf");
    let mut seen = Vec::new();
    load_times(&path, &LoadOptions::default(), [0.0, 1.0, 3.0, 1.0], &mut |loaded| {
        let transform = match loaded.scene.textures.first() {
            Some(Texture::Image { mapping: Mapping::Uv { transform, .. }, .. }) => Some(*transform),
            _ => None,
        };
        let moved = transform.map(|t| [t.offset.x, t.offset.y, t.rotation_rad]);
        seen.push((
            loaded.scene.instances.len(),
            loaded.scene.textures.len(),
            loaded.scene.images.len(),
            moved,
        ));
        Ok(ControlFlow::Continue(()))
    })
    .unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(seen[0], (1, 1, 1, Some([0.0; 3])));
    assert_eq!(seen[1], (1, 1, 1, Some([0.5, 0.25, 1.0])));
    assert_eq!((seen[2].0, seen[2].1), (0, 0), "hidden, and so without its material");
    assert_eq!(seen[3], seen[1], "what a moment changed is put back");
}

/// Area lights, environments and profiles; pointers of interaction extensions are ignored silently.
#[test]
fn extension_lights_are_animated() {
    let asset = driven(|a| {
        a["extensions"]["EXT_lights_area"] =
            json!({"lights": [{"type": "rect", "size": 2, "intensity": 5, "rect": {"aspect": 1}}]});
        a["nodes"][0]["extensions"] = json!({"EXT_lights_area": {"light": 0}});
        drive(a, "/extensions/EXT_lights_area/lights/0/size", 3, "LINEAR");
        drive(a, "/extensions/EXT_lights_area/lights/0/rect/aspect", 3, "LINEAR");
        drive(a, "/nodes/0/extensions/KHR_node_selectability/selectable", 3, "STEP");
        drive(a, "/nodes/0/extensions/KHR_node_hoverability/hoverable", 3, "STEP");
    });
    let area = |time_s| {
        let loaded = show(&asset, time_s);
        assert!(!messages(&loaded, "is ignored"), "{:?}", loaded.warnings);
        // Half the height and half the aspect, then full both.
        let [Quad { edge_u, edge_v, .. }] = &loaded.scene.quads[..] else { panic!("no rectangle") };
        edge_u.cross(*edge_v).length()
    };
    assert!((area(2.0) / area(0.0) - 8.0).abs() < 1e-5, "{} {}", area(2.0), area(0.0));
    assert!(area(1.0) > area(0.0) && area(2.0) > area(1.0));
}

#[test]
fn invalid_pointers_are_reported() {
    let pointers = [
        "/materials/0/name",
        "/materials/7/alphaCutoff",
        "/materials/0/extensions/KHR_materials_sheen/sheenColorFactor",
        "/materials/0/normalTexture/scale",
        "/nodes/x/translation",
        "/materials/0",
        "",
        "emissiveFactor",
        "/extensions/KHR_lights_punctual/lights/0/color",
    ];
    for pointer in pointers {
        let loaded = show(&driven(|a| drive(a, pointer, 3, "LINEAR")), 1.0);
        let place = "/channels/0/target/extensions/KHR_animation_pointer/pointer";
        assert!(
            messages(&loaded, place) && messages(&loaded, &format!("'{pointer}'")),
            "{:?}",
            loaded.warnings
        );
        assert_eq!(pbr(&loaded), &PbrMaterial::default(), "{pointer}");
    }
    let twice = driven(|a| {
        drive(a, "/materials/0/alphaCutoff", 3, "LINEAR");
        drive(a, "/materials/0/alphaCutoff", 7, "CUBICSPLINE");
    });
    assert!(messages(&show(&twice, 1.0), "the first is used"));
}

#[test]
fn wrong_types_and_lengths_are_problems() {
    let cases: [(&str, usize, &str, &[&str]); 5] = [
        ("/materials/0/emissiveFactor", 3, "LINEAR", &["/accessors/3", "VEC3 of F32"]),
        ("/materials/0/alphaCutoff", 5, "LINEAR", &["/accessors/5", "SCALAR of F32"]),
        ("/materials/0/alphaCutoff", 7, "LINEAR", &["/animations/0/channels/0", "2 keys", "6 numbers"]),
        ("/materials/0/alphaCutoff", 3, "CUBICSPLINE", &["2 keys"]),
        ("/nodes/0/extensions/KHR_node_visibility/visible", 3, "STEP", &["/accessors/3", "SCALAR of U8"]),
    ];
    for (pointer, output, interpolation, words) in cases {
        let asset = driven(|a| drive(a, pointer, output, interpolation));
        let message = at(&asset, &NUMBERS, Some(0.5)).expect_err("it is broken").to_string();
        for word in words {
            assert!(message.contains(word), "'{word}' is not in: {message}");
        }
    }
    let mut asset = driven(|a| drive(a, "/materials/0/alphaCutoff", 3, "LINEAR"));
    asset["animations"][0]["channels"][0]["target"]["extensions"] = json!({});
    let message = at(&asset, &NUMBERS, Some(0.5)).expect_err("it is broken").to_string();
    assert!(message.contains("KHR_animation_pointer/pointer: is missing"), "{message}");
}

/// Splines overshoot between keys: a sequence continues with the light off.
#[test]
fn negative_light_intensities_are_zero() {
    let mut numbers = NUMBERS;
    numbers[2..4].copy_from_slice(&[1.0, -1.0]);
    let asset = driven(|a| {
        a["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 5}]}});
        a["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
        drive(a, "/extensions/KHR_lights_punctual/lights/0/intensity", 3, "LINEAR");
    });
    let lit = |time_s| at(&asset, &numbers, Some(time_s)).unwrap_or_else(|e| panic!("{e}"));
    assert!(lit(0.0).scene.lights[0].intensity[0] > 0.0);
    let dark = lit(2.0);
    assert_eq!(dark.scene.lights[0].intensity, [0.0; 3]);
    assert!(messages(&dark, "below 0"), "{:?}", dark.warnings);
}

/// A field of view that a spline leads out of (0, pi) is clamped.
#[test]
fn fields_of_view_are_clamped() {
    let mut numbers = NUMBERS;
    numbers[2..4].copy_from_slice(&[1.0, -1.0]);
    let asset = driven(|a| {
        a["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]);
        a["nodes"][0]["camera"] = json!(0);
        drive(a, "/cameras/0/perspective/yfov", 3, "LINEAR");
    });
    let seen = |time_s| at(&asset, &numbers, Some(time_s)).unwrap_or_else(|e| panic!("{e}"));
    let narrow = seen(2.0);
    let Projection::Perspective { vfov_rad } = narrow.scene.cameras[0].projection else { panic!("flat") };
    assert_eq!(vfov_rad, 1e-3);
    assert!(messages(&narrow, "outside 0 to pi") && !messages(&narrow, "left out"), "{:?}", narrow.warnings);
    assert!(!messages(&seen(0.0), "outside 0 to pi"));
}
