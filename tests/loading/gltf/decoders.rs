//! Builds without a decoder treat its extension as unsupported, and give a hint.
#![cfg(not(all(feature = "draco", feature = "ktx2", feature = "webp")))]

use super::asset::{load_by, refusal, triangle_bytes, triangle_with};
use oscura::load::{LoadOptions, Loaded, gltf::GltfOptions};
use serde_json::{Value, json};

fn load(asset: &Value, force: bool) -> Loaded {
    let options =
        LoadOptions { gltf: GltfOptions { force, ..GltfOptions::default() }, ..LoadOptions::default() };
    let files: [(&str, &[u8]); 2] = [("a.bin", &triangle_bytes()), ("red.png", super::materials::RED)];
    load_by(asset, &files, &options).unwrap_or_else(|e| panic!("{e}"))
}

fn warns(loaded: &Loaded, words: &[&str]) {
    let has = |w: &oscura::error::Warning| words.iter().all(|word| w.to_string().contains(word));
    assert!(loaded.warnings.iter().any(has), "{words:?} are not in {:?}", loaded.warnings);
}

#[cfg(not(feature = "draco"))]
#[test]
fn draco_meshes_need_their_decoder() {
    const DRACO: &str = "KHR_draco_mesh_compression";
    let compressed = |list: &str, plain: bool| {
        triangle_with(|a| {
            a["meshes"][0]["primitives"][0]["extensions"] =
                json!({DRACO: {"bufferView": 0, "attributes": {"POSITION": 0}}});
            a[list] = json!([DRACO]);
            if !plain {
                for accessor in a["accessors"].as_array_mut().expect("a list") {
                    accessor.as_object_mut().expect("an object").remove("bufferView");
                }
            }
        })
    };
    for list in ["extensionsRequired", "extensionsUsed"] {
        let message = refusal(&compressed(list, false));
        for word in
            ["a.gltf", DRACO, "this build of oscura doesn't support Draco meshes", "`--features draco`"]
        {
            assert!(message.contains(word), "'{word}' is not in: {message}");
        }
        assert_eq!(message.matches("doesn't support Draco").count(), 1, "{message}");
    }
    let optional = load(&compressed("extensionsUsed", true), false);
    assert_eq!(optional.scene.meshes[0].triangles.len(), 1);
    warns(&optional, &[DRACO, "is not supported", "`--features draco`"]);
    let forced = load(&compressed("extensionsRequired", false), true);
    assert!(forced.scene.meshes.is_empty());
    warns(&forced, &["the file requires", DRACO, "ignored by `GltfOptions::force`"]);
    warns(&forced, &["/meshes/0/primitives/0", "left out"]);
}

/// The triangle with a texture whose image is given by an extension, with or without a plain fallback.
#[cfg(not(all(feature = "ktx2", feature = "webp")))]
fn textured(extension: &str, list: &str, plain: bool) -> Value {
    triangle_with(|a| {
        a["materials"][0] = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}});
        a["textures"] = json!([{"extensions": {extension: {"source": 0}}}]);
        if plain {
            a["textures"][0]["source"] = json!(1);
        }
        a["images"] = json!([{"uri": "special"}, {"uri": "red.png"}]);
        a[list] = json!([extension]);
    })
}

#[cfg(not(all(feature = "ktx2", feature = "webp")))]
fn textures_need(extension: &str, feature: &str) {
    let remedy = format!("`--features {feature}`");
    let message = refusal(&textured(extension, "extensionsRequired", true));
    assert!([extension, "a.gltf", &remedy].iter().all(|word| message.contains(word)), "{message}");
    let optional = load(&textured(extension, "extensionsUsed", true), false);
    assert_eq!(optional.scene.images.len(), 1);
    warns(&optional, &[extension, "is not supported", &remedy]);
    let alone = load(&textured(extension, "extensionsRequired", false), true);
    assert!(alone.scene.images.is_empty());
    warns(&alone, &["/textures/0", "has no readable image"]);
}

#[cfg(not(feature = "ktx2"))]
#[test]
fn basis_universal_textures_need_their_decoder() {
    textures_need("KHR_texture_basisu", "ktx2");
}

#[cfg(not(feature = "webp"))]
#[test]
fn webp_textures_need_their_decoder() {
    textures_need("EXT_texture_webp", "webp");
}
