//! Lights with a surface, and lights that are pictures.

use super::asset::{load_by, load_triangle, load_with, refusal, triangle_bytes, triangle_with};
use oscura::load::{LoadOptions, Loaded};
use oscura::math::{DVec3, Vec3};
use oscura::scene::{Environment, Quad, Shape};
use serde_json::{Value, json};
use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::io::Cursor;

/// The triangle and a light of EXT_lights_area on a node.
fn with_area(light: Value, node: Value) -> Value {
    triangle_with(|a| {
        a["extensionsUsed"] = json!(["EXT_lights_area"]);
        a["extensions"] = json!({"EXT_lights_area": {"lights": [light]}});
        a["scenes"][0]["nodes"] = json!([0, 1]);
        let mut node = node;
        node["extensions"] = json!({"EXT_lights_area": {"light": 0}});
        a["nodes"].as_array_mut().expect("a list").push(node);
    })
}

fn near(a: DVec3, b: [f64; 3]) -> bool {
    a.distance(DVec3::from(b)) < 1e-9
}

/// Width, height and position of a rectangle; the largest scale of its node applies to both sides.
#[test]
fn rectangle_lights_emit_along_minus_z() {
    let light =
        json!({"type": "rect", "size": 0.5, "rect": {"aspect": 2}, "color": [1, 0.5, 0], "intensity": 6830});
    let node = json!({"name": "panel", "translation": [1, 2, 3], "scale": [1, 2, -0.5]});
    let loaded = load_triangle(&with_area(light, node)).expect("it loads");
    let [Quad { name, corner, edge_u, edge_v, material, .. }] = &loaded.scene.quads[..] else {
        panic!("one")
    };
    assert_eq!(name, "panel");
    // The node rotates its z axis, and the light with it.
    assert!(near(edge_u.cross(*edge_v).normalize(), [0.0, 0.0, 1.0]));
    assert!((edge_u.cross(*edge_v).length() - 2.0).abs() < 1e-12);
    assert!(near(*corner + (*edge_u + *edge_v) / 2.0, [1.0, 2.0, 3.0]));
    let emitter = &loaded.scene.materials[material.index()];
    let emission = emitter.emission.expect("it emits");
    assert!(!emission.two_sided);
    for (found, expected) in emission.radiance.factor.into_iter().zip([10.0, 5.0, 0.0]) {
        assert!((found - expected).abs() < 1e-5, "{found}");
    }
    let drafts = loaded.warnings.iter().filter(|w| w.code == "extension-draft");
    assert_eq!(drafts.count(), 1, "{:?}", loaded.warnings);
    assert!(loaded.has_area_lights);
}

#[test]
fn disk_lights_and_unsupported_parts() {
    let node = json!({"rotation": [FRAC_1_SQRT_2, 0, 0, FRAC_1_SQRT_2]});
    let loaded = load_triangle(&with_area(json!({"type": "disk", "size": 3}), node)).expect("it loads");
    let [disk @ Shape { radius, .. }] = &loaded.scene.shapes[..] else { panic!("one") };
    // Turned by a right angle about x, -z is y.
    assert!((radius - 1.5).abs() < 1e-12 && near(disk.rotation * DVec3::Z, [0.0, 1.0, 0.0]));
    let emission = loaded.scene.materials[disk.material.index()].emission.expect("it emits");
    assert!((emission.radiance.factor[0] - 1000.0 / 683.0).abs() < 1e-5);
}

/// Moves with the node while the shutter is open: a rectangle as itself, a disk as triangles.
#[test]
fn area_lights_move_with_their_nodes() {
    for kind in ["rect", "disk"] {
        let mut asset = with_area(json!({"type": kind}), json!({"name": "lamp"}));
        let mut bytes = triangle_bytes();
        bytes.extend([0.0f32, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 24.0].map(f32::to_le_bytes).concat());
        asset["buffers"][0]["byteLength"] = json!(bytes.len());
        asset["bufferViews"].as_array_mut().expect("a list").extend([
            json!({"buffer": 0, "byteOffset": 44, "byteLength": 8}),
            json!({"buffer": 0, "byteOffset": 52, "byteLength": 24}),
        ]);
        asset["accessors"].as_array_mut().expect("a list").extend([
            json!({"bufferView": 2, "componentType": 5126, "type": "SCALAR", "count": 2, "min": [0], "max": [1]}),
            json!({"bufferView": 3, "componentType": 5126, "type": "VEC3", "count": 2}),
        ]);
        asset["animations"] = json!([{
            "samplers": [{"input": 2, "output": 3}],
            "channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}]
        }]);
        let mut options = LoadOptions::default();
        options.gltf.time_s = Some(0.5);
        (options.shutter.frames, options.shutter.fps) = (Some(0.5), 24.0);
        let loaded = load_by(&asset, &[("a.bin", &bytes)], &options).expect("it loads");
        let motion = &loaded.scene.motion;
        let shifts: Vec<f64> = match kind {
            "rect" => motion.quads[&0].keys.iter().map(|key| key.translation.z).collect(),
            _ => motion.instances[0].keys.iter().map(|key| key.translation.z - 12.0).collect(),
        };
        // Half a frame of a metre each.
        let [first, .., last] = shifts[..] else { panic!("two keys") };
        assert!((first + 0.25).abs() < 1e-6 && (last - 0.25).abs() < 1e-6, "{kind}: {shifts:?}");
    }
}

#[test]
fn invalid_area_lights() {
    let on_node = |light: Value| with_area(light, json!({}));
    for (light, place) in [
        (json!({}), "EXT_lights_area/lights/0/type"),
        (json!({"type": "sphere"}), "EXT_lights_area/lights/0/type"),
        (json!({"type": "rect", "size": 0}), "EXT_lights_area/lights/0/size"),
        (json!({"type": "disk", "size": "big"}), "EXT_lights_area/lights/0/size"),
        (json!({"type": "rect", "rect": {"aspect": -1}}), "EXT_lights_area/lights/0/rect/aspect"),
        (json!({"type": "rect", "color": [1]}), "EXT_lights_area/lights/0/color"),
        (json!({"type": "rect", "intensity": -1}), "negative"),
        (json!({"type": "rect", "intensity": 1e300}), "too large"),
        (json!("rect"), "EXT_lights_area/lights/0"),
    ] {
        let message = refusal(&on_node(light));
        assert!(message.contains(place) && !message.contains("and 1 more"), "{message}");
    }
    let mut lost = on_node(json!({"type": "rect"}));
    lost["nodes"][1]["extensions"] = json!({"EXT_lights_area": {"light": 4}});
    assert!(refusal(&lost).contains("/4"));
    lost["nodes"][1]["extensions"] = json!({"EXT_lights_area": {}});
    assert!(refusal(&lost).contains("light"));
    let flat = with_area(json!({"type": "rect"}), json!({"scale": [1, 1, 0]}));
    let flat = load_triangle(&flat).expect("it loads");
    assert!(flat.scene.quads.is_empty() && flat.warnings.iter().any(|w| w.message.contains("singular")));
}

/// A uniform PNG of 2 x 2 texels.
fn png<const N: usize>(color: [u8; N]) -> Vec<u8> {
    let texels: Vec<u8> = (0..4).flat_map(|_| color).collect();
    let kind = if N == 4 { image::ExtendedColorType::Rgba8 } else { image::ExtendedColorType::Rgb8 };
    let mut bytes = Cursor::new(Vec::new());
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    image::ImageEncoder::write_image(encoder, &texels, 2, 2, kind).expect("written");
    bytes.into_inner()
}

/// The triangle inside a cube map of six colours: red at +x, cyan at -x, and so on.
fn surrounded(change: impl FnOnce(&mut Value)) -> Result<Loaded, oscura::error::Error> {
    let colors = [[255, 0, 0], [0, 255, 255], [0, 255, 0], [255, 0, 255], [0, 0, 255], [255, 255, 0]];
    let pictures: Vec<Vec<u8>> = colors.map(png).to_vec();
    let bright = png([255, 255, 255, 51]);
    let mut asset = triangle_with(|a| {
        let uris = (0..6).map(|i| json!({"uri": format!("{i}.png")})).chain([json!({"uri": "6.png"})]);
        a["images"] = uris.collect();
        a["extensionsUsed"] = json!(["EXT_lights_image_based"]);
        a["extensions"] = json!({"EXT_lights_image_based": {"lights": [{
            "intensity": 2, "specularImageSize": 2, "specularImages": [[0, 1, 2, 3, 4, 5]],
            "irradianceCoefficients": [[1, 1, 1]]
        }]}});
        a["scenes"][0]["extensions"] = json!({"EXT_lights_image_based": {"light": 0}});
    });
    change(&mut asset);
    let bytes = triangle_bytes();
    let names: Vec<String> = (0..6).map(|i| format!("{i}.png")).collect();
    let mut files: Vec<(&str, &[u8])> = vec![("a.bin", &bytes), ("6.png", &bright)];
    files.extend(names.iter().zip(&pictures).map(|(name, bytes)| (name.as_str(), bytes.as_slice())));
    load_with(&asset, &files)
}

/// The radiance of the environment in a direction.
fn seen(loaded: &Loaded, direction: [f64; 3]) -> Vec3 {
    let Environment::Image { image, strength, rotation_rad } = loaded.scene.environment else {
        panic!("none")
    };
    assert_eq!((strength, rotation_rad), (1.0, 0.0));
    let image = &loaded.scene.images[image.index()];
    let d = DVec3::from(direction).normalize();
    let (u, v) = (0.5 + d.z.atan2(d.x) / (2.0 * PI), d.y.acos() / PI);
    let at = |s: f64, size: u32| ((s * f64::from(size)) as u32).min(size - 1);
    let [r, g, b, _] = image.rgba(at(u, image.width), at(v, image.height));
    Vec3::new(r, g, b)
}

#[test]
fn cube_maps_become_the_environment() {
    let loaded = surrounded(|_| ()).expect("it loads");
    let of = |direction| seen(&loaded, direction);
    for (direction, color) in [
        ([1.0, 0.1, 0.2], [2.0, 0.0, 0.0]),
        ([-1.0, 0.1, 0.2], [0.0, 2.0, 2.0]),
        ([0.1, 1.0, 0.2], [0.0, 2.0, 0.0]),
        ([0.1, -1.0, 0.2], [2.0, 0.0, 2.0]),
        ([0.1, 0.2, 1.0], [0.0, 0.0, 2.0]),
        ([0.1, 0.2, -1.0], [2.0, 2.0, 0.0]),
    ] {
        assert_eq!(of(direction), Vec3::from(color), "{direction:?}");
    }
    assert!(loaded.warnings.iter().all(|w| w.file.is_none()), "{:?}", loaded.warnings);
    assert!(loaded.left_out.iter().any(|l| l.contains("1 of 7")), "{:?}", loaded.left_out);
    // A right angle about y rotates +z to +x.
    let turned = surrounded(|a| {
        let light = &mut a["extensions"]["EXT_lights_image_based"]["lights"][0];
        light["rotation"] = json!([0, FRAC_1_SQRT_2, 0, FRAC_1_SQRT_2]);
    });
    assert_eq!(seen(&turned.expect("it loads"), [1.0, 0.1, 0.2]), Vec3::new(0.0, 0.0, 2.0));
}

/// Rotated and scaled by an animation; each frame starts from the original.
#[test]
fn environment_is_animated_by_pointers() {
    let numbers = [0.0f32, 2.0, 1.0, 3.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0];
    let bytes: Vec<u8> =
        triangle_bytes().into_iter().chain(numbers.iter().flat_map(|x| x.to_le_bytes())).collect();
    let pictures: Vec<(String, Vec<u8>)> =
        (0..7).map(|i| (format!("{i}.png"), png(if i == 4 { [0, 0, 255] } else { [0; 3] }))).collect();
    let asset = triangle_with(|a| {
        a["images"] = (0..6).map(|i| json!({"uri": format!("{i}.png")})).collect();
        a["extensionsUsed"] = json!(["EXT_lights_image_based", "KHR_animation_pointer"]);
        a["extensions"] = json!({"EXT_lights_image_based": {"lights": [{
            "specularImageSize": 2, "specularImages": [[0, 1, 2, 3, 4, 5]], "irradianceCoefficients": [[1, 1, 1]]
        }]}});
        a["scenes"][0]["extensions"] = json!({"EXT_lights_image_based": {"light": 0}});
        a["buffers"][0]["byteLength"] = json!(bytes.len());
        for (offset, count, kind) in [(44, 2, "SCALAR"), (52, 2, "SCALAR"), (60, 2, "VEC4")] {
            let size = if kind == "VEC4" { 32 } else { 8 };
            let view = a["bufferViews"].as_array().map_or(0, Vec::len);
            let json_of = json!({"buffer": 0, "byteOffset": offset, "byteLength": size});
            a["bufferViews"].as_array_mut().expect("a list").push(json_of);
            let accessor = json!({"bufferView": view, "componentType": 5126, "type": kind, "count": count});
            a["accessors"].as_array_mut().expect("a list").push(accessor);
        }
        let light = "/extensions/EXT_lights_image_based/lights/0";
        let channel = |sampler: usize, key: &str| json!({"sampler": sampler, "target": super::animation::pointer_target(&format!("{light}/{key}"))});
        a["animations"] = json!([{
            "samplers": [{"input": 2, "output": 3}, {"input": 2, "output": 4}],
            "channels": [channel(0, "intensity"), channel(1, "rotation")]
        }]);
    });
    let folder = tempfile::tempdir().expect("a folder");
    let write =
        |name: &str, content: &[u8]| std::fs::write(folder.path().join(name), content).expect("written");
    pictures.iter().for_each(|(name, content)| write(name, content));
    write("a.bin", &bytes);
    write("a.gltf", asset.to_string().as_bytes());
    let mut blues = Vec::new();
    let path = folder.path().join("a.gltf");
    oscura::load::load_times(&path, &LoadOptions::default(), [0.0, 2.0, 0.0], &mut |loaded| {
        blues.push([[0.1, 0.2, 1.0], [1.0, 0.1, 0.2]].map(|way| seen(loaded, way).z));
        Ok(std::ops::ControlFlow::Continue(()))
    })
    .unwrap_or_else(|e| panic!("{e}"));
    // Three times as bright, and a right angle about y rotates +z to +x.
    assert_eq!(blues, [[1.0, 0.0], [0.0, 3.0], [1.0, 0.0]]);
}

/// PNGs with alpha are RGBD: white over 51 / 255.
#[test]
fn rgbd_environments() {
    let bright = surrounded(|a| {
        let light = &mut a["extensions"]["EXT_lights_image_based"]["lights"][0];
        light["specularImages"] = json!([[6, 6, 6, 6, 6, 6], [0, 0, 0, 0, 0, 0]]);
    });
    let found = seen(&bright.expect("it loads"), [1.0, 0.3, 0.2]);
    assert!((found - Vec3::splat(10.0)).abs().max_element() < 1e-4, "{found}");
}

#[test]
fn damaged_environment_images() {
    let refused = |key: &str, value: Value| {
        let change = |a: &mut Value| a["extensions"]["EXT_lights_image_based"]["lights"][0][key] = value;
        surrounded(change).map(|_| ()).expect_err("it must not load").to_string()
    };
    for (key, value, messages) in [
        ("specularImages", json!([[0, 1, 2]]), "six images"),
        ("specularImages", json!([]), "six images"),
        ("specularImages", json!("none"), "six images"),
        ("specularImages", json!([[0, 1, 2, 3, 4, -5]]), "six images"),
        ("specularImages", json!([[0, 1, 2, 3, 4, 77]]), "there are 7"),
        ("intensity", json!(-1), "lights/0/intensity"),
        ("intensity", json!("bright"), "lights/0/intensity"),
        ("rotation", json!([0, 0, 0, 0]), "lights/0/rotation"),
        ("rotation", json!([0, 1]), "lights/0/rotation"),
    ] {
        let message = refused(key, value.clone());
        assert!(message.contains(messages), "{key} = {value}: {message}");
    }
    let lost = surrounded(|a| a["scenes"][0]["extensions"]["EXT_lights_image_based"]["light"] = json!(3));
    assert!(lost.expect_err("it must not load").to_string().contains("/3"));
    // Unreferenced lights are not read.
    let unused = surrounded(|a| {
        a["extensions"]["EXT_lights_image_based"]["lights"][0]["specularImages"] = json!(7);
        a["scenes"][0].as_object_mut().expect("an object").remove("extensions");
    });
    let environment = unused.expect("it loads").scene.environment;
    assert!(!matches!(environment, Environment::Image { .. }), "{environment:?}");
}
