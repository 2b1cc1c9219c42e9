//! Damaged and hostile files: a clear error or a valid scene, never a panic, and never more memory than the file justifies.

use super::asset::{glb, load_by, load_triangle, open, refusal, triangle, triangle_bytes, triangle_with};
use oscura::compile::{CompileOptions, compile};
use oscura::error::Error;
use oscura::load::gltf::GltfOptions;
use oscura::load::{LoadOptions, Loaded};
use serde_json::{Value, json};
use std::path::Path;

/// A modification of the triangle, and the expected words of the error.
type Case = (fn(&mut Value), &'static [&'static str]);

#[test]
fn problems_are_reported_with_their_location() {
    let cases: &[Case] = &[
        (|a| a["accessors"][0]["count"] = json!(4), &["/accessors/0", "reach beyond"]),
        (|a| a["accessors"][0]["count"] = json!(u64::MAX), &["/accessors/0"]),
        (|a| a["accessors"][0]["byteOffset"] = json!(u64::MAX), &["/accessors/0"]),
        (|a| a["accessors"][0]["type"] = json!("VEC2"), &["/accessors/0", "VEC2 of F32"]),
        (|a| a["accessors"][0]["componentType"] = json!(5121), &["/accessors/0", "VEC3 of U8"]),
        (|a| a["accessors"][0]["componentType"] = json!(5124), &["/accessors/0/componentType"]),
        (|a| a["accessors"][1]["componentType"] = json!(5126), &["/accessors/1"]),
        (|a| a["accessors"][1]["type"] = json!("VEC3"), &["/accessors/1"]),
        (|a| a["accessors"][1]["byteOffset"] = json!(1), &["/accessors/1", "reach beyond"]),
        (|a| a["bufferViews"][1]["byteOffset"] = json!(30), &["/accessors/1", "3 vertices"]),
        (|a| a["bufferViews"][0]["byteStride"] = json!(8), &["/accessors/0", "byteStride of 8"]),
        (|a| a["bufferViews"][0]["byteStride"] = json!(0), &["/bufferViews/0/byteStride"]),
        (|a| a["bufferViews"][0]["byteLength"] = json!(1000), &["/bufferViews/0", "has 44"]),
        (|a| a["bufferViews"][0]["byteOffset"] = json!(u64::MAX), &["/bufferViews/0"]),
        (|a| a["bufferViews"][0]["buffer"] = json!(3), &["/bufferViews/0/buffer", "/buffers/3"]),
        (|a| a["buffers"][0]["byteLength"] = json!(45), &["/buffers/0/byteLength", "45", "44"]),
        (|a| a["buffers"][0]["uri"] = json!("none.bin"), &["/buffers/0/uri", "none.bin"]),
        (|a| a["buffers"][0]["uri"] = json!("%ff.bin"), &["/buffers/0/uri", "UTF-8"]),
        (|a| a["buffers"][0]["uri"] = json!("https://example.org/b.bin"), &["/buffers/0/uri", "https"]),
        (|a| a["buffers"][0]["uri"] = json!("../b.bin"), &["/buffers/0/uri", "folder"]),
        (
            |a| a["meshes"][0]["primitives"][0]["indices"] = json!(9),
            &["/meshes/0/primitives/0/indices", "/accessors/9"],
        ),
        (|a| a["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(9), &["/attributes/POSITION"]),
        (
            |a| a["meshes"][0]["primitives"][0]["material"] = json!(9),
            &["/primitives/0/material", "/materials/9"],
        ),
        (|a| a["meshes"][0]["primitives"][0]["mode"] = json!(7), &["/primitives/0/mode"]),
        (|a| a["nodes"][0]["mesh"] = json!(9), &["/nodes/0/mesh", "/meshes/9"]),
        (|a| a["nodes"][0]["matrix"] = json!([1, 2]), &["/nodes/0/matrix"]),
        (|a| a["scenes"][0]["nodes"] = json!([0, "x"]), &["/scenes/0/nodes/1"]),
        (|a| a["scene"] = json!(-1), &["/scene"]),
        (|a| a["asset"]["version"] = json!("1.0"), &["/asset/version", "2.0"]),
        (
            |a| {
                a["accessors"][0]["sparse"] = json!({"count": 9, "indices": {"bufferView": 1, "componentType": 5121},
            "values": {"bufferView": 0}})
            },
            &["/accessors/0/sparse/count"],
        ),
    ];
    for (change, words) in cases {
        let message = refusal(&triangle_with(change));
        for word in *words {
            assert!(message.contains(word), "'{word}' is not in: {message}");
        }
    }
}

#[test]
fn all_problems_come_at_once() {
    let asset = triangle_with(|a| {
        a["nodes"] = json!([{"mesh": 0, "children": [7]}]);
        a["accessors"][0]["count"] = json!(400);
        a["meshes"][0]["primitives"]
            .as_array_mut()
            .expect("a list")
            .push(json!({"attributes": {"POSITION": 5}}));
        a["extensionsRequired"] = json!(["ACME_x"]);
    });
    let error = load_triangle(&asset).expect_err("it is broken");
    assert_eq!(error.problems.len(), 4, "{error}");
}

#[test]
fn many_problems_are_counted() {
    let asset = triangle_with(|a| {
        a["scenes"][0]["nodes"] = (1..=1000).collect();
    });
    let error = load_triangle(&asset).expect_err("it is broken");
    assert!(error.problems.len() < 50);
    assert!(error.problems.last().is_some_and(|last| last.code == "more-problems"));
}

#[test]
fn no_memory_amplification() {
    for count in [1u64 << 20, 1 << 32, 1 << 50, u64::MAX] {
        let asset = triangle_with(|a| {
            a["accessors"][0] = json!({"componentType": 5126, "type": "VEC3", "count": count});
        });
        assert!(refusal(&asset).contains("/accessors/0"));
    }
    // The same vertices repeatedly, each time with other colours.
    let asset = triangle_with(|a| {
        a["accessors"][0] = json!({"componentType": 5126, "type": "VEC3", "count": 65536});
        let other =
            |i: usize| json!({"componentType": 5126, "type": "VEC4", "count": 65536, "name": i.to_string()});
        a["accessors"].as_array_mut().expect("a list").extend((0..400).map(other));
        let primitive = |i: usize| json!({"attributes": {"POSITION": 0, "COLOR_0": i + 2}, "indices": 1});
        a["meshes"][0]["primitives"] = (0..400).map(primitive).collect();
    });
    assert!(refusal(&asset).contains("justifies"));
}

/// A GLB truncated at every length: an error each time.
#[test]
fn a_truncated_container_is_refused() {
    let mut asset = triangle();
    asset["buffers"][0].as_object_mut().expect("an object").remove("uri");
    let whole = glb(&asset, &triangle_bytes());
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.glb");
    for length in 0..whole.len() {
        std::fs::write(&path, &whole[..length]).expect("written");
        assert!(open(&path).is_err(), "{length} bytes of {}", whole.len());
    }
    // Wrong lengths inside.
    for at in [8, 12, 16] {
        for value in [0u32, 1, 11, 13, 0x7fff_ffff, u32::MAX] {
            let mut bytes = whole.clone();
            bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
            std::fs::write(&path, &bytes).expect("written");
            assert!(open(&path).is_err(), "{value} at {at}");
        }
    }
}

/// Unknown chunks are skipped (glTF 2.0, section 4.4), also in place of the binary chunk.
#[test]
fn unknown_chunks_are_skipped() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.glb");
    let embedded = triangle_in_a_uri();
    let mut bytes = glb(&embedded, b"ACMEACME");
    let kind = bytes.len() - 8 - 4;
    bytes[kind..kind + 4].copy_from_slice(b"ACME");
    std::fs::write(&path, &bytes).expect("written");
    let loaded = open(&path).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(loaded.scene.meshes[0].triangles, [[0, 1, 2]]);
    bytes[16..20].copy_from_slice(b"ACME");
    std::fs::write(&path, &bytes).expect("written");
    let message = open(&path).expect_err("no JSON").to_string();
    assert!(message.contains("'ACME'"), "{message}");
}

/// The triangle with its buffer as a data URI.
fn triangle_in_a_uri() -> Value {
    let escaped: String = triangle_bytes().iter().map(|b| format!("%{b:02x}")).collect();
    triangle_with(|a| a["buffers"][0]["uri"] = json!(format!("data:,{escaped}")))
}

/// Each value of a document with all features replaced by nonsense, and each removed: no panic, neither in loading nor in
/// compilation.
#[test]
fn invalid_values_never_panic() {
    check_invalid_values(&rich(), load_triangle);
}

/// The same with animation: the reed of the repository in the middle of its animation.
#[test]
fn invalid_values_in_animations_never_panic() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/reed.gltf");
    let text = std::fs::read_to_string(path).expect("the asset is there");
    let reed = serde_json::from_str(&text).expect("it is JSON");
    let gltf =
        GltfOptions { time_s: Some(0.7), variant: Some("autumn".to_string()), ..GltfOptions::default() };
    let options = LoadOptions { gltf, ..LoadOptions::default() };
    check_invalid_values(&reed, |asset| load_by(asset, &[], &options));
}

/// The visible contents of a scene, without colours and names.
fn shown(loaded: &Loaded) -> (usize, usize, usize, usize, String) {
    let scene = &loaded.scene;
    let triangles = scene.instances.iter().map(|i| scene.meshes[i.mesh.index()].triangles.len()).sum();
    let corners = scene.instances.iter().flat_map(|i| scene.meshes[i.mesh.index()].positions.iter());
    let places: Vec<_> = scene.instances.iter().map(|i| i.world_from_object).collect();
    let geometry = format!("{places:?} {:?}", corners.collect::<Vec<_>>());
    (triangles, scene.lights.len(), scene.cameras.len(), scene.images.len(), geometry)
}

fn check_invalid_values(asset: &Value, load: impl Fn(&Value) -> Result<Loaded, Error>) {
    let original = load(asset).unwrap_or_else(|e| panic!("{e}"));
    let mut places = Vec::new();
    pointers(asset, String::new(), &mut places);
    let nonsense = [
        json!(null),
        json!(-1),
        json!(0),
        json!(2.5),
        json!(1e300),
        json!(u64::MAX),
        json!(u32::MAX),
        json!(""),
        json!("\u{0}x"),
        json!([]),
        json!([[]]),
        json!({}),
        json!(true),
    ];
    let options = CompileOptions::default();
    let (mut tried, mut refused) = (0, 0);
    for place in &places {
        for value in &nonsense {
            let mut broken = asset.clone();
            *broken.pointer_mut(place).expect("the place exists") = value.clone();
            tried += 1;
            match load(&broken) {
                Ok(loaded) => {
                    // A string is never accepted as a number, list or object: what is lost by one must be reported.
                    let is_same = !value.is_string() || shown(&loaded) == shown(&original);
                    let says_more = loaded.warnings.iter().any(|w| !original.warnings.contains(w));
                    assert!(is_same || says_more, "{value} at {place} changes the scene in silence");
                    drop(compile(&loaded.scene, &options));
                }
                Err(error) => refused += usize::from(!error.problems.is_empty()),
            }
        }
        let (parent, key) = place.rsplit_once('/').expect("a pointer");
        let mut broken = asset.clone();
        match broken.pointer_mut(parent).expect("the parent exists") {
            Value::Object(object) => drop(object.remove(key)),
            Value::Array(list) => drop(list.remove(key.parse::<usize>().expect("an index"))),
            _ => unreachable!("only these have children"),
        }
        tried += 1;
        refused += usize::from(load(&broken).is_err());
    }
    println!("{refused} of {tried} refused");
    assert!(tried > 1000 && refused > tried / 4);
}

fn pointers(value: &Value, at: String, places: &mut Vec<String>) {
    let mut child = |key: &str, value: &Value| {
        let place = format!("{at}/{key}");
        places.push(place.clone());
        pointers(value, place, places);
    };
    match value {
        Value::Object(object) => object.iter().for_each(|(key, value)| child(key, value)),
        Value::Array(list) => list.iter().enumerate().for_each(|(i, value)| child(&i.to_string(), value)),
        _ => {}
    }
}

/// A document that uses nearly everything that is supported.
fn rich() -> Value {
    let png = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGP4z8AAAAMBAQDJ/pLvAAAAAElFTkSuQmCC";
    let transform = json!({"KHR_texture_transform": {"offset": [0.1, 0.2], "scale": [2, 2], "rotation": 1, "texCoord": 1}});
    triangle_with(|a| {
        a["nodes"] = json!([
            {"mesh": 0, "children": [1], "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]},
            {"camera": 0, "translation": [1, 2, 3], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1],
             "extensions": {"KHR_lights_punctual": {"light": 0}, "EXT_lights_area": {"light": 0}}}
        ]);
        a["scenes"][0]["extensions"] = json!({"EXT_lights_image_based": {"light": 0}});
        a["cameras"] =
            json!([{"type": "perspective", "perspective": {"yfov": 0.7, "aspectRatio": 1, "znear": 0.1}}]);
        a["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_texture_transform"]);
        a["extensionsRequired"] = json!(["KHR_lights_punctual"]);
        a["extensions"] = json!({"KHR_lights_punctual": {"lights": [
            {"type": "spot", "intensity": 683, "color": [1, 1, 1], "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.3}}]},
            "EXT_lights_area": {"lights": [
                {"type": "rect", "intensity": 683, "color": [1, 1, 1], "size": 2, "rect": {"aspect": 0.5}}]},
            "EXT_lights_image_based": {"lights": [{"intensity": 1, "rotation": [0, 0, 0, 1], "specularImageSize": 1,
                "specularImages": [[0, 0, 0, 0, 0, 0]]}]}});
        a["accessors"][0]["sparse"] = json!({"count": 1, "indices": {"bufferView": 1, "componentType": 5123},
            "values": {"bufferView": 0}});
        a["meshes"][0]["primitives"][0]["attributes"] =
            json!({"POSITION": 0, "NORMAL": 0, "TEXCOORD_0": 2, "COLOR_0": 0});
        a["meshes"][0]["primitives"][0]["mode"] = json!(4);
        a["accessors"]
            .as_array_mut()
            .expect("a list")
            .push(json!({"bufferView": 0, "componentType": 5126, "type": "VEC2", "count": 3}));
        a["images"] = json!([{"uri": png, "mimeType": "image/png"}]);
        a["samplers"] = json!([{"magFilter": 9728, "minFilter": 9729, "wrapS": 33071, "wrapT": 33648}]);
        a["textures"] = json!([{"source": 0, "sampler": 0}]);
        a["materials"][0] = json!({
            "alphaMode": "MASK", "alphaCutoff": 0.3, "doubleSided": true, "emissiveFactor": [1, 1, 1],
            "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1], "metallicFactor": 1, "roughnessFactor": 1,
                "baseColorTexture": {"index": 0, "texCoord": 0, "extensions": transform}},
            "normalTexture": {"index": 0, "scale": 1, "extensions": transform},
            "extensions": {"KHR_materials_volume": {"attenuationColor": [1, 1, 1], "attenuationDistance": 1},
                "KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_ior": {"ior": 1.5},
                "KHR_materials_specular": {"specularColorFactor": [1, 1, 1]},
                "KHR_materials_emissive_strength": {"emissiveStrength": 2},
                "KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.1,
                    "clearcoatTexture": {"index": 0}, "clearcoatNormalTexture": {"index": 0, "scale": 1}},
                "KHR_materials_sheen": {"sheenColorFactor": [1, 1, 1], "sheenRoughnessFactor": 0.5,
                    "sheenColorTexture": {"index": 0}, "sheenRoughnessTexture": {"index": 0}},
                "KHR_materials_anisotropy": {"anisotropyStrength": 0.5, "anisotropyRotation": 1,
                    "anisotropyTexture": {"index": 0}},
                "KHR_materials_iridescence": {"iridescenceFactor": 1, "iridescenceIor": 1.4,
                    "iridescenceThicknessMinimum": 100, "iridescenceThicknessMaximum": 300,
                    "iridescenceThicknessTexture": {"index": 0}},
                "KHR_materials_dispersion": {"dispersion": 0.1},
                "KHR_materials_scatter": {"scatterStrengthFactor": 0.5, "multiscatterColorFactor": [1, 1, 0.5],
                    "multiscatterColorTexture": {"index": 0}, "scatterAnisotropy": 0.1},
                "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.5,
                    "diffuseTransmissionColorFactor": [1, 1, 1], "diffuseTransmissionTexture": {"index": 0}}}
        });
    })
}

#[cfg(feature = "draco")]
#[test]
fn compressed_primitives_need_plain_copies() {
    let compressed = |plain: bool| {
        triangle_with(|a| {
            let extension =
                json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}});
            a["meshes"][0]["primitives"][0]["extensions"] = extension;
            a["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
            if !plain {
                for accessor in a["accessors"].as_array_mut().expect("a list") {
                    accessor.as_object_mut().expect("an object").remove("bufferView");
                }
            }
        })
    };
    let message = refusal(&compressed(false));
    for word in ["/meshes/0/primitives/0", "KHR_draco_mesh_compression", "without mesh compression"] {
        assert!(message.contains(word), "{message}");
    }
    let loaded = load_triangle(&compressed(true)).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(loaded.scene.meshes[0].triangles.len(), 1);
    assert!(loaded.warnings.iter().any(|w| w.place.contains("KHR_draco_mesh_compression")));
}
