//! Minor exporter errors: repaired or skipped with a warning, and everything else loads.

use super::asset::{corners, floats, load_triangle, load_with, triangle_bytes, triangle_with};
use super::materials::RED;
use crate::codes::has_code;
use crate::files::load_files;
use oscura::load::Loaded;
use oscura::math::DVec3;
use oscura::scene::Scene;
use serde_json::{Value, json};

/// The triangle with a base colour texture.
fn textured(uri: &str) -> Value {
    triangle_with(|a| {
        a["materials"][0] = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}});
        a["textures"] = json!([{"source": 0}]);
        a["images"] = json!([{"uri": uri}]);
    })
}

/// The warnings about the file, each with its code in brackets.
fn messages(loaded: &Loaded) -> String {
    loaded.warnings.iter().filter(|w| w.file.is_some()).map(|w| format!("{w} [{}]\n", w.code)).collect()
}

/// The loaded triangle, which must have lost only its texture; with the messages.
fn without_texture(asset: &Value, name: &str, bytes: &[u8]) -> String {
    let loaded =
        load_with(asset, &[("a.bin", &triangle_bytes()), (name, bytes)]).unwrap_or_else(|e| panic!("{e}"));
    let Scene { textures, meshes, .. } = &loaded.scene;
    assert!(textures.is_empty() && meshes[0].triangles.len() == 1, "{}", messages(&loaded));
    messages(&loaded)
}

#[test]
fn unsupported_image_formats_lose_only_the_texture() {
    for (bytes, what) in [
        (&b""[..], "empty"),
        (b"\0\0\0\x20ftypavif\0\0\0\0", "AVIF"),
        (b"\0\0\0\x18ftypheic\0\0\0\0", "HEIC"),
        (b"\0\0\0\x0cjP  \r\n\x87\n", "JPEG 2000"),
        (b"8BPS\0\x01", "Photoshop"),
        (b"DDS |\0\0\0", "DDS"),
        (b"<svg xmlns='http://www.w3.org/2000/svg'/>", "SVG"),
        (b"<!DOCTYPE html><title>404</title>", "web page"),
        (b"version https://git-lfs.github.com/spec/v1\n", "git lfs pull"),
        (b"no picture at all", "image"),
    ] {
        let messages = without_texture(&textured("p.png"), "p.png", bytes);
        assert!(messages.contains(what) && messages.contains("[texture-missing]"), "{what}: {messages}");
    }
}

#[test]
fn unreachable_images_lose_only_the_texture() {
    for (uri, what) in [
        ("https://example.org/p.jpg", "'https:'"),
        ("file:///C:/textures/other.png", "'file:'"),
        ("C:\\textures\\other.png", "is missing"),
        ("/textures/other.png", "outside"),
        ("../other.png", "outside"),
        ("100%.png", "is missing"),
        ("data:image/png;base64,@@", "base64"),
    ] {
        let messages = without_texture(&textured(uri), "red.png", RED);
        assert!(messages.contains(what), "{uri}: {messages}");
    }
    let beyond = triangle_with(|a| {
        a["materials"][0] = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}});
        a["textures"] = json!([{"source": 0}]);
        a["images"] = json!([{"bufferView": 2, "mimeType": "image/png"}]);
        a["bufferViews"].as_array_mut().expect("a list").push(json!({"buffer": 0, "byteLength": 999}));
    });
    assert!(without_texture(&beyond, "red.png", RED).contains("[texture-missing]"));
}

/// Paths in the notation of other systems are resolved, with a report where that is a guess.
#[test]
fn images_with_invalid_uris_are_found() {
    for uri in
        ["maps\\RED.png", "maps%5Cred.png", "maps/red.png?v=1", "maps/red.png#x", "C:\\me\\maps\\red.png"]
    {
        let files = [("a.bin", &triangle_bytes()[..]), ("maps/red.png", RED)];
        let loaded = load_with(&textured(uri), &files).unwrap_or_else(|e| panic!("{e}"));
        let is_lost = messages(&loaded).contains("/images");
        assert!(loaded.scene.textures.len() == 1 && !is_lost, "{uri}: {}", messages(&loaded));
        assert!(has_code(&loaded.notes, "uri-guessed"), "{uri}");
    }
    let gif = b"GIF89a\x01\0\x01\0\x80\0\0\xff\0\0\0\0\0,\0\0\0\0\x01\0\x01\0\0\x02\x02D\x01\0;";
    let loaded =
        load_with(&textured("p.gif"), &[("a.bin", &triangle_bytes()), ("p.gif", gif)]).expect("it loads");
    let [r, g, ..] = loaded.scene.images[0].rgba(0, 0);
    assert!(r > 0.9 && g < 0.1, "a GIF is read");
}

#[test]
fn invalid_transforms_are_repaired() {
    let zero = triangle_with(|a| a["nodes"][0]["rotation"] = json!([0, 0, 0, 0]));
    let loaded = load_triangle(&zero).unwrap_or_else(|e| panic!("{e}"));
    assert!(
        messages(&loaded).contains("/nodes/0/rotation: ") && messages(&loaded).contains("[rotation-invalid]"),
        "{}",
        messages(&loaded)
    );
    let both = triangle_with(|a| {
        a["nodes"][0]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 0, 0, 1]);
        a["nodes"][0]["translation"] = json!([3, 3, 3]);
    });
    let loaded = load_triangle(&both).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(loaded.scene.instances[0].world_from_object.translation, DVec3::new(7.0, 0.0, 0.0));
    assert!(messages(&loaded).contains("[matrix-overrides]"), "{}", messages(&loaded));
}

/// A scale of 0 on one axis leaves a planar mesh, on two a line, which is dropped.
#[test]
fn a_scale_of_zero_flattens() {
    let scaled = |scale: Value| {
        load_triangle(&triangle_with(|a| {
            a["nodes"][0]["scale"] = scale;
            a["nodes"][0]["translation"] = json!([0, 5, 0]);
        }))
        .unwrap_or_else(|e| panic!("{e}"))
    };
    let flat = scaled(json!([2, 3, 0]));
    let instance = &flat.scene.instances[0];
    let mesh = &flat.scene.meshes[instance.mesh.index()];
    assert_eq!(mesh.positions, [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0]]);
    assert_eq!(instance.world_from_object.translation, DVec3::new(0.0, 5.0, 0.0));
    assert!(messages(&flat).is_empty(), "{}", messages(&flat));
    let line = scaled(json!([2, 0, 0]));
    assert!(
        line.scene.instances.is_empty() && messages(&line).contains("[mesh-degenerate]"),
        "{}",
        messages(&line)
    );
}

#[test]
fn invalid_index_drops_only_its_triangle() {
    let mut bytes = triangle_bytes();
    bytes.truncate(36);
    bytes.extend([0, 0, 1, 0, 2, 0, 0, 0, 1, 0, 9, 0].iter());
    let asset = triangle_with(|a| {
        a["accessors"][1]["count"] = json!(6);
        a["bufferViews"][1]["byteLength"] = json!(12);
        a["buffers"][0]["byteLength"] = json!(48);
    });
    let loaded = load_with(&asset, &[("a.bin", &bytes)]).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(loaded.scene.meshes[0].triangles, [[0, 1, 2]]);
    assert!(messages(&loaded).contains("index 9"), "{}", messages(&loaded));
}

#[test]
fn nan_in_json_becomes_zero() {
    let text = triangle_with(|a| {
        a["nodes"][0]["name"] = json!("a \"NaN\", b");
        a["nodes"][0]["translation"] = json!([7777, 1, 8888]);
        a["accessors"][0]["max"] = json!([9999, 0, 0]);
    });
    let text =
        text.to_string().replace("7777", "NaN").replace("8888", "-nan(ind)").replace("9999", "1.#QNAN");
    let files = [("a.gltf", text.as_bytes()), ("a.bin", &triangle_bytes())];
    let loaded = load_files(&files).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(loaded.scene.instances[0].world_from_object.translation, DVec3::Y);
    assert_eq!(loaded.scene.instances[0].name, "a \"NaN\", b");
    assert!(messages(&loaded).contains("[json-not-a-number]"), "{}", messages(&loaded));
}

/// Points load as spheres and lines as cylinders, with their colours; an invalid index drops its primitive only.
#[test]
fn points_and_lines_become_spheres_and_cylinders() {
    let mut bytes = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    bytes.extend(floats(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]));
    bytes.extend([0, 1, 1, 2, 7, 0]);
    let mut asset = corners(3, 78);
    asset["nodes"][0]["scale"] = json!([2, 2, 2]);
    asset["bufferViews"][1] = json!({"buffer": 0, "byteOffset": 36, "byteLength": 36});
    let of_bytes = json!({"buffer": 0, "byteOffset": 72, "byteLength": 6});
    asset["bufferViews"].as_array_mut().expect("a list").push(of_bytes);
    asset["accessors"][1] = json!({"bufferView": 1, "componentType": 5126, "type": "VEC3", "count": 3});
    for count in [4, 6] {
        let indices = json!({"bufferView": 2, "componentType": 5121, "type": "SCALAR", "count": count});
        asset["accessors"].as_array_mut().expect("a list").push(indices);
    }
    let colored = json!({"POSITION": 0, "COLOR_0": 1});
    asset["meshes"][0]["primitives"] = json!([
        {"mode": 0, "attributes": colored},
        {"mode": 1, "attributes": {"POSITION": 0}, "indices": 2},
        {"mode": 2, "attributes": colored},
        {"mode": 3, "attributes": {"POSITION": 0}},
        {"mode": 1, "attributes": {"POSITION": 0}, "indices": 3},
    ]);
    let loaded = load_with(&asset, &[("a.bin", &bytes)]).unwrap_or_else(|e| panic!("{e}"));
    let Scene { shapes, curves, materials, .. } = &loaded.scene;
    assert_eq!(
        shapes.iter().map(|s| s.center).collect::<Vec<_>>(),
        [DVec3::ZERO, 2.0 * DVec3::X, 2.0 * DVec3::Y]
    );
    let model = &materials[shapes[1].material.index()].model;
    assert!(
        matches!(model, oscura::scene::Model::Lambert { albedo } if albedo.factor == [0.0, 1.0, 0.0]),
        "{model:?}"
    );
    let strands: Vec<&[u32]> = curves.iter().map(|c| &c.strands[..]).collect();
    assert_eq!(strands, [&[2, 2][..], &[4], &[3]]);
    assert_eq!(curves[1].colors[3], [1.0, 0.0, 0.0], "a loop ends where it began");
    assert!(curves[0].radii.iter().all(|r| (f64::from(*r) * curves[0].radius_scale() - 2.8e-3).abs() < 1e-3));
    assert!(messages(&loaded).contains("/primitives/4: "), "{}", messages(&loaded));
}

/// Unlit models emit their vertex colours.
#[test]
fn unlit_vertex_colors_are_kept() {
    let mut bytes = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    bytes.extend(floats(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]));
    let mut asset = corners(3, 72);
    asset["bufferViews"][1] = json!({"buffer": 0, "byteOffset": 36, "byteLength": 36});
    asset["accessors"][1] = json!({"bufferView": 1, "componentType": 5126, "type": "VEC3", "count": 3});
    asset["meshes"][0]["primitives"][0] = json!({"attributes": {"POSITION": 0, "COLOR_0": 1}, "material": 0});
    asset["materials"][0] = json!({"extensions": {"KHR_materials_unlit": {}}, "doubleSided": true});
    asset["extensionsUsed"] = json!(["KHR_materials_unlit"]);
    asset["cameras"] = json!([{"type": "orthographic", "orthographic": {"xmag": 0.5, "ymag": 0.5, "znear": 0.1, "zfar": 9}}]);
    asset["nodes"].as_array_mut().expect("a list").push(json!({"camera": 0, "translation": [0.25, 0.25, 5]}));
    asset["scenes"][0]["nodes"] = json!([0, 1]);
    let loaded = load_with(&asset, &[("a.bin", &bytes)]).unwrap_or_else(|e| panic!("{e}"));
    assert!(loaded.scene.materials[0].use_vertex_colors);
    let mut rendering =
        oscura::render::Renderer::new(loaded).size(3, 3).samples(64).start().expect("it starts");
    rendering.run();
    let film = rendering.into_picture();
    let [r, g, b, _] = film.film().mean_rgba(1, 1);
    // The centre of the picture is (0.25, 0.25): half of the first vertex colour and a quarter of the others.
    assert!((r - 0.5).abs() < 0.05 && (g - 0.25).abs() < 0.05 && (b - 0.25).abs() < 0.05, "{r} {g} {b}");
}

/// Albedos are clamped to 1.
#[test]
fn vertex_colors_above_one_are_clamped() {
    let colored = |values: [f32; 9]| {
        let mut bytes = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        bytes.extend(floats(&values));
        let mut asset = corners(3, 72);
        asset["bufferViews"][1] = json!({"buffer": 0, "byteOffset": 36, "byteLength": 36});
        asset["accessors"][1] = json!({"bufferView": 1, "componentType": 5126, "type": "VEC3", "count": 3});
        asset["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(1);
        let loaded = load_with(&asset, &[("a.bin", &bytes)]).unwrap_or_else(|e| panic!("{e}"));
        (loaded.scene.meshes[0].colors[0], messages(&loaded))
    };
    let (color, messages) = colored([255.0, 51.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    assert!(
        (color[1] - 0.2).abs() < 1e-6 && color[0] == 1.0 && messages.contains("[vertex-colors-bytes]"),
        "{color:?}, {messages}"
    );
    let (color, messages) = colored([5.0, 0.5, -1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    assert_eq!(color, [1.0, 0.5, 0.0, 1.0]);
    assert!(messages.contains("[vertex-colors-clamped]"), "{messages}");
    let (color, messages) = colored([1.0, 0.5, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    assert!(color == [1.0, 0.5, 0.0, 1.0] && messages.is_empty(), "{messages}");
}
