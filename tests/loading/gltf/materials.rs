//! Materials, textures, images and extensions.

use super::asset::{load_triangle, load_with, refusal, triangle_bytes, triangle_with};
use oscura::image::Encoding;
use oscura::load::Loaded;
use oscura::scene::{AlphaMode, Interpolation, Mapping, Material, Model, PbrMaterial, Texture, Wrap};
use serde_json::{Value, json};

/// A PNG of one red pixel.
pub const RED: &[u8] = &[
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00,
    0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x02, 0x00, 0x00, 0x00, 0x90, 0x77, 0x53, 0xde, 0x00,
    0x00, 0x00, 0x0c, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0xf8, 0xcf, 0xc0, 0x00, 0x00, 0x03, 0x01,
    0x01, 0x00, 0xc9, 0xfe, 0x92, 0xef, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60,
    0x82,
];

fn load_material(material: Value) -> Loaded {
    load_triangle(&triangle_with(|a| a["materials"][0] = material)).unwrap_or_else(|e| panic!("{e}"))
}

fn material(json: Value) -> Material {
    load_material(json).scene.materials.remove(0)
}

fn pbr(material: &Material) -> &PbrMaterial {
    match &material.model {
        Model::Pbr(pbr) => pbr,
        other => panic!("{other:?}"),
    }
}

#[test]
fn defaults_are_those_of_gltf() {
    let plain = material(json!({}));
    assert_eq!(*pbr(&plain), PbrMaterial::default());
    assert_eq!((plain.double_sided, plain.emission, plain.alpha_mode), (false, None, AlphaMode::Opaque));
}

#[test]
fn factors_and_extensions() {
    let m = material(json!({
        "name": "glass", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.3,
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 0.6},
        "emissiveFactor": [1, 0.5, 0],
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 8},
            "KHR_materials_ior": {"ior": 1.33},
            "KHR_materials_specular": {"specularFactor": 0.7, "specularColorFactor": [2, 1, 0]},
            "KHR_materials_transmission": {"transmissionFactor": 0.9},
            "KHR_materials_volume":
                {"attenuationColor": [0.1, 0.2, 0.3], "attenuationDistance": 2, "thicknessFactor": 0.1}
        }
    }));
    let p = pbr(&m);
    assert_eq!((m.name.as_str(), m.double_sided, m.alpha.factor), ("glass", true, 0.4));
    assert_eq!(m.alpha_mode, AlphaMode::Mask { cutoff: 0.3 });
    let emission = m.emission.expect("it emits");
    assert_eq!((emission.radiance.factor, emission.two_sided), ([8.0, 4.0, 0.0], true));
    assert_eq!((p.base_color.factor, p.metallic.factor, p.roughness.factor), ([0.1, 0.2, 0.3], 0.5, 0.6));
    assert_eq!((p.ior, p.specular.factor, p.specular_color.factor), (1.33, 0.7, [2.0, 1.0, 0.0]));
    assert_eq!((p.transmission.factor, p.has_volume), (0.9, true));
    assert_eq!((p.attenuation_color, p.attenuation_distance), ([0.1, 0.2, 0.3], 2.0));
}

#[test]
fn volume_defaults() {
    let m = material(json!({"extensions": {"KHR_materials_volume": {"thicknessFactor": 1e-3}}}));
    assert!(pbr(&m).has_volume && pbr(&m).attenuation_distance == f32::INFINITY);
    for thin in ["KHR_materials_transmission", "KHR_materials_volume"] {
        assert!(!pbr(&material(json!({"extensions": {thin: {}}}))).has_volume);
    }
}

#[test]
fn unlit_is_emissive_and_factors_are_clamped() {
    let loaded = load_material(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 2, -1, 1]},
        "extensions": {"KHR_materials_unlit": {}}
    }));
    let m = &loaded.scene.materials[0];
    assert_eq!(m.model, Model::Black);
    assert_eq!(m.emission.expect("it emits").radiance.factor, [0.5, 1.0, 0.0]);
    let warned = |words: &str| loaded.warnings.iter().filter(|w| w.message.contains(words)).count();
    assert_eq!((warned("unlit"), warned("clamped")), (1, 2));
}

/// A material with five textures over images `red.png`, in `a.gltf`.
fn textured() -> Value {
    triangle_with(|a| {
        a["materials"][0] = json!({
            "pbrMetallicRoughness": {
                "baseColorTexture": {"index": 0},
                "metallicRoughnessTexture": {"index": 0, "texCoord": 1}
            },
            "alphaMode": "BLEND",
            "normalTexture": {"index": 1, "scale": 0.5, "extensions": {"KHR_texture_transform": {"rotation": 1}}},
            "emissiveFactor": [1, 1, 1],
            "emissiveTexture": {"index": 1, "extensions": {"KHR_texture_transform":
                {"offset": [0.1, 0.2], "scale": [3, 4], "rotation": 0.5, "texCoord": 1}}}
        });
        a["textures"] = json!([{"source": 0, "sampler": 0}, {"source": 0}]);
        a["samplers"] = json!([{"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}]);
        a["images"] = json!([{"uri": "red.png"}]);
    })
}

#[test]
fn textures_of_each_slot() {
    let files: &[(&str, &[u8])] = &[("a.bin", &triangle_bytes()), ("red.png", RED)];
    let scene = load_with(&textured(), files).unwrap_or_else(|e| panic!("{e}")).scene;
    let m = &scene.materials[0];
    let p = pbr(m);
    let base = p.base_color.texture.expect("a texture");
    assert_eq!(m.alpha.texture, Some((base, 3)));
    assert_eq!((p.metallic.texture.expect("blue").1, p.roughness.texture.expect("green").1), (2, 1));
    assert_eq!(p.metallic.texture.map(|t| t.0), p.roughness.texture.map(|t| t.0));
    // Decoded once, used as colour and as data; the pixels are shared.
    assert_eq!(scene.images.len(), 2);
    assert!(std::sync::Arc::ptr_eq(&scene.images[0].pixels, &scene.images[1].pixels));
    let encoding = |id: oscura::scene::TextureId| match scene.textures[id.index()] {
        Texture::Image { image, .. } => scene.images[image.index()].encoding,
        _ => panic!("no image"),
    };
    assert_eq!(encoding(base), Encoding::Srgb);
    assert_eq!(encoding(m.normal_map.expect("a normal map").texture), Encoding::Linear);
    let Texture::Image { wrap_u, wrap_v, interpolation, .. } = scene.textures[base.index()] else { panic!() };
    assert_eq!((wrap_u, wrap_v, interpolation), (Wrap::Clamp, Wrap::Mirror, Interpolation::Nearest));
    let emission = m.emission.and_then(|e| e.radiance.texture).expect("a texture");
    let Texture::Image { mapping: Mapping::Uv { set, transform }, .. } = scene.textures[emission.index()]
    else {
        panic!()
    };
    assert_eq!((set, transform.offset.x, transform.scale.y, transform.rotation_rad), (1, 0.1, 4.0, 0.5));
}

#[test]
fn missing_texture_coordinates_are_named() {
    let files: &[(&str, &[u8])] = &[("a.bin", &triangle_bytes()), ("red.png", RED)];
    let loaded = load_with(&textured(), files).unwrap_or_else(|e| panic!("{e}"));
    for set in ["TEXCOORD_0", "TEXCOORD_1"] {
        assert!(loaded.warnings.iter().any(|w| w.message.contains(set)), "{set}");
    }
    let mut asset = textured();
    asset["materials"][0]["normalTexture"]["texCoord"] = json!(2);
    let loaded = load_with(&asset, files).unwrap_or_else(|e| panic!("{e}"));
    assert!(loaded.scene.materials[0].normal_map.is_none());
    assert!(loaded.warnings.iter().any(|w| w.place == "/materials/0/normalTexture"));
}

#[test]
fn missing_and_damaged_images_are_reported_by_name() {
    let loaded = load_triangle(&textured()).unwrap_or_else(|e| panic!("{e}"));
    assert!(loaded.scene.textures.is_empty() && loaded.scene.images.is_empty());
    assert!(loaded.warnings.iter().any(|w| w.place == "/images/0" && w.message.contains("red.png")));
    let files: &[(&str, &[u8])] = &[("a.bin", &triangle_bytes()), ("red.png", &RED[..50])];
    let loaded = load_with(&textured(), files).unwrap_or_else(|e| panic!("{e}"));
    assert!(loaded.scene.textures.is_empty(), "the image is cut off");
    let messages: Vec<_> = loaded.warnings.iter().filter(|w| w.place == "/images/0").collect();
    assert!(messages.len() == 1 && messages[0].message.contains("factors"), "{:?}", loaded.warnings);
}

#[test]
fn only_referenced_data_is_read() {
    // All but image 0 are missing or invalid, and so are the second buffer and mesh.
    let asset = triangle_with(|a| {
        a["materials"] = json!([
            {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
            {"emissiveTexture": {"index": 1}}
        ]);
        a["textures"] = json!([{"source": 0}, {"source": 1}, {"source": 77}]);
        a["images"] = (0..50).map(|i| json!({"uri": if i == 0 { "red.png" } else { "a.bin" }})).collect();
        a["buffers"]
            .as_array_mut()
            .expect("a list")
            .push(json!({"byteLength": 1u64 << 40, "uri": "none.bin"}));
        a["meshes"].as_array_mut().expect("a list").push(json!({"primitives": "broken"}));
        a["nodes"].as_array_mut().expect("a list").push(json!({"mesh": 1}));
    });
    let files: &[(&str, &[u8])] = &[("a.bin", &triangle_bytes()), ("red.png", RED)];
    let loaded = load_with(&asset, files).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((loaded.scene.images.len(), loaded.scene.materials.len()), (1, 1));
    for line in ["49 of 50 images", "1 of 2 buffers", "1 of 2 meshes", "1 of 2 materials"] {
        assert!(loaded.left_out.iter().any(|l| l.starts_with(line)), "{line}: {:?}", loaded.left_out);
    }
}

#[test]
fn unknown_extensions_are_reported() {
    let asset = triangle_with(|a| {
        a["extensionsUsed"] = json!(["ACME_a", "ACME_b"]);
        a["extensionsRequired"] = json!(["KHR_lights_punctual", "ACME_a"]);
    });
    let message = refusal(&asset);
    assert!(message.contains("/extensionsRequired/1") && message.contains("ACME_a"), "{message}");
    let asset = triangle_with(|a| {
        a["extensionsRequired"] = json!(["KHR_materials_variants"]);
        a["nodes"][0]["extensions"] = json!({"ACME_b": {}});
        a["materials"][0]["extensions"] = json!({"ACME_b": {}, "KHR_materials_ior": {}});
    });
    let loaded = load_triangle(&asset).expect("it loads");
    let unread: Vec<_> = loaded.warnings.iter().filter(|w| w.message.contains("ACME")).collect();
    assert_eq!(unread.len(), 1, "{unread:?}");
    assert!(unread[0].message.contains("ACME_b") && unread[0].message.contains('2'), "{unread:?}");
}

/// Extensions for interaction don't affect rendering; other losses are reported.
#[test]
fn known_unsupported_extensions() {
    let asset = triangle_with(|a| {
        a["extensionsRequired"] = json!(["KHR_interactivity", "KHR_node_selectability"]);
        a["extensions"] = json!({"KHR_interactivity": {"graphs": []}});
        a["materials"][0]["extensions"] = json!({"KHR_materials_coat": {}, "KHR_materials_fuzz": {}});
        a["nodes"][0]["extensions"] = json!({"KHR_node_hoverability": {"hoverable": false}});
    });
    let loaded = load_triangle(&asset).expect("it loads");
    let messages: Vec<String> = loaded.warnings.iter().map(|w| w.message.clone()).collect();
    let has = |words: &str| messages.iter().any(|w| w.contains(words));
    assert!(
        has("KHR_materials_coat is not supported") && has("KHR_materials_fuzz is not supported"),
        "{messages:?}"
    );
    assert!(!has("interactivity") && !has("ability"), "{messages:?}");
}

/// A draft extension: read, with a warning. The colour gives the fraction of extinction that is scattering.
#[test]
fn volume_scattering() {
    let json = |thickness: f32| {
        json!({
            "extensions": {
                "KHR_materials_volume":
                    {"attenuationColor": [0.1, 0.5, 0.5], "attenuationDistance": 2, "thicknessFactor": thickness},
                "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 1},
                "KHR_materials_volume_scatter": {"multiscatterColor": [0.8, 0.5, 0], "scatterAnisotropy": 0.25}
            }
        })
    };
    let loaded = load_material(json(0.1));
    let reported = |loaded: &Loaded, words: &str| loaded.warnings.iter().any(|w| w.message.contains(words));
    assert!(reported(&loaded, "KHR_materials_volume_scatter is a draft"), "{:?}", loaded.warnings);
    let medium = loaded.scene.materials[0].medium.expect("a medium");
    let sigma = |c: f32| -c.ln() / 2.0;
    for (found, c) in medium.extinction.into_iter().zip([0.1, 0.5, 0.5]) {
        assert!((found - sigma(c)).abs() < 1e-5);
    }
    let [r, g, b] = medium.albedo;
    assert!(r > 0.9 && r < 1.0 && g > 0.7 && g < r && b.abs() < 1e-3, "{:?}", medium.albedo);
    assert_eq!(medium.anisotropy, 0.25);
    assert!(!pbr(&loaded.scene.materials[0]).attenuation_distance.is_finite());
    let flat = load_material(json(0.0));
    assert!(flat.scene.materials[0].medium.is_none() && reported(&flat, "scatters nothing"));
}

/// The draft that replaces it: in solids the strength scales the colour, in thin sheets it is the fraction scattered.
#[test]
fn material_scattering() {
    let json = |transmission: f32, strength: f32, anisotropy: f32, volume: Option<f32>| {
        let mut json = json!({
            "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.6, 1], "metallicFactor": 0},
            "extensions": {
                "KHR_materials_transmission": {"transmissionFactor": transmission},
                "KHR_materials_scatter": {
                    "scatterStrengthFactor": strength, "scatterAnisotropy": anisotropy,
                    "multiscatterColorFactor": [0.9, 0.5, 0.3]
                }
            }
        });
        if let Some(thickness) = volume {
            json["extensions"]["KHR_materials_volume"] = json!({"attenuationColor": [0.5, 0.5, 0.5], "attenuationDistance": 1, "thicknessFactor": thickness});
        }
        load_material(json)
    };
    let reported = |loaded: &Loaded, words: &str| loaded.warnings.iter().any(|w| w.message.contains(words));
    let solid = json(1.0, 0.5, 0.25, Some(1.0));
    assert!(reported(&solid, "KHR_materials_scatter is a draft"), "{:?}", solid.warnings);
    let medium = solid.scene.materials[0].medium.expect("a medium");
    let color = medium.color();
    assert!((color[0] - 0.45).abs() < 1e-3 && (color[2] - 0.15).abs() < 1e-3, "{color:?}");
    assert!((medium.extinction[0] - 2.0f32.ln()).abs() < 1e-5 && medium.anisotropy == 0.25);
    // All transmitted light is scattered, half of it backwards.
    let paper = json(1.0, 1.0, 0.0, None);
    let model = pbr(&paper.scene.materials[0]);
    let through = model.diffuse_transmission.expect("transmitted");
    assert_eq!((model.transmission.factor, model.has_volume, through.factor.factor), (0.0, false, 0.5));
    assert_eq!((model.base_color.factor, through.color.factor), ([0.9, 0.5, 0.3], [0.9, 0.5, 0.3]));
    assert!(!reported(&paper, "mixed"));
    // A quarter is transmitted unscattered, a quarter scattered forwards; of the backscatter, half is the base's.
    let mixed = json(0.5, 0.5, 1.0, Some(0.0));
    let model = pbr(&mixed.scene.materials[0]);
    assert_eq!(model.transmission.factor, 0.25);
    assert!((model.diffuse_transmission.expect("some").factor.factor - 0.25 / 0.75).abs() < 1e-6);
    let back = json(0.5, 1.0, -1.0, None);
    let model = pbr(&back.scene.materials[0]);
    assert!(model.diffuse_transmission.is_none() && (model.base_color.factor[0] - 0.55).abs() < 1e-6);
    let clear = json(1.0, 0.0, 0.0, None);
    assert!(
        clear.scene.materials[0].medium.is_none()
            && pbr(&clear.scene.materials[0]).transmission.factor == 1.0
    );
    assert!(reported(&json(0.0, 1.0, 0.0, None), "scatters nothing"));
    let broken = triangle_with(|a| {
        a["materials"][0]["extensions"] =
            json!({"KHR_materials_scatter": {"multiscatterColorFactor": "white"}});
    });
    assert!(refusal(&broken).contains("KHR_materials_scatter/multiscatterColorFactor"));
}
