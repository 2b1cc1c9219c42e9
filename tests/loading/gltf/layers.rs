//! Extensions of materials that add layers.

use super::asset::{load_with, triangle_bytes, triangle_with};
use super::materials::RED;
use oscura::load::Loaded;
use oscura::scene::{Anisotropy, Model, PbrMaterial, TextureId};
use serde_json::{Value, json};

fn load(extensions: Value) -> Loaded {
    let asset = triangle_with(|a| {
        a["materials"][0] = json!({"extensions": extensions});
        a["textures"] = json!([{"source": 0}]);
        a["images"] = json!([{"uri": "red.png"}]);
    });
    load_with(&asset, &[("a.bin", &triangle_bytes()), ("red.png", RED)]).unwrap_or_else(|e| panic!("{e}"))
}

fn material(extensions: Value) -> PbrMaterial {
    match load(extensions).scene.materials.remove(0).model {
        Model::Pbr(pbr) => *pbr,
        other => panic!("{other:?}"),
    }
}

#[test]
fn layers_of_strength_zero_are_none() {
    let off = material(json!({
        "KHR_materials_clearcoat": {"clearcoatTexture": {"index": 0}, "clearcoatRoughnessFactor": 1},
        "KHR_materials_sheen": {"sheenRoughnessFactor": 1},
        "KHR_materials_anisotropy": {"anisotropyRotation": 1, "anisotropyTexture": {"index": 0}},
        "KHR_materials_iridescence": {"iridescenceIor": 2},
        "KHR_materials_dispersion": {},
        "KHR_materials_diffuse_transmission": {"diffuseTransmissionTexture": {"index": 0}}
    }));
    assert_eq!(off, PbrMaterial::default());
}

#[test]
fn factors_and_defaults() {
    let p = material(json!({
        "KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.25},
        "KHR_materials_sheen": {"sheenColorFactor": [0.1, 0.2, 0.3], "sheenRoughnessFactor": 0.4},
        "KHR_materials_anisotropy": {"anisotropyStrength": 0.6, "anisotropyRotation": 7},
        "KHR_materials_iridescence": {"iridescenceFactor": 1},
        "KHR_materials_dispersion": {"dispersion": 0.33},
        "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.7}
    }));
    let coat = p.clearcoat.expect("a coat");
    assert_eq!((coat.factor.factor, coat.roughness.factor, coat.normal_map), (0.5, 0.25, None));
    let sheen = p.sheen.expect("fibres");
    assert_eq!((sheen.color.factor, sheen.roughness.factor), ([0.1, 0.2, 0.3], 0.4));
    assert_eq!(p.anisotropy, Some(Anisotropy { strength: 0.6, rotation_rad: 7.0, texture: None }));
    let film = p.iridescence.expect("a film");
    assert_eq!((film.ior, film.thickness_min_nm, film.thickness_max_nm), (1.3, 100.0, 400.0));
    assert_eq!(p.dispersion, 0.33);
    let through = p.diffuse_transmission.expect("light passes");
    assert_eq!((through.factor.factor, through.color.factor), (0.7, [1.0; 3]));
}

#[test]
fn textures_use_the_channels_of_their_extensions() {
    let texture = json!({"index": 0});
    let loaded = load(json!({
        "KHR_materials_clearcoat": {
            "clearcoatFactor": 1, "clearcoatTexture": texture, "clearcoatRoughnessFactor": 1,
            "clearcoatRoughnessTexture": texture, "clearcoatNormalTexture": {"index": 0, "scale": 0.5}
        },
        "KHR_materials_sheen": {
            "sheenColorFactor": [1, 1, 1], "sheenColorTexture": texture, "sheenRoughnessFactor": 1,
            "sheenRoughnessTexture": texture
        },
        "KHR_materials_anisotropy": {"anisotropyStrength": 1, "anisotropyTexture": texture},
        "KHR_materials_iridescence": {
            "iridescenceFactor": 1, "iridescenceTexture": texture, "iridescenceThicknessTexture": texture
        },
        "KHR_materials_diffuse_transmission": {
            "diffuseTransmissionFactor": 1, "diffuseTransmissionTexture": texture,
            "diffuseTransmissionColorTexture": texture
        }
    }));
    let Model::Pbr(p) = &loaded.scene.materials[0].model else { panic!("no glTF material") };
    let channel = |slot: Option<(TextureId, u8)>| slot.expect("a texture").1;
    let coat = p.clearcoat.expect("a coat");
    assert_eq!((channel(coat.factor.texture), channel(coat.roughness.texture)), (0, 1));
    assert_eq!(coat.normal_map.expect("a normal map").scale, 0.5);
    assert_eq!(channel(p.sheen.expect("fibres").roughness.texture), 3);
    let film = p.iridescence.expect("a film");
    assert_eq!((channel(film.factor.texture), channel(film.thickness_texture)), (0, 1));
    let through = p.diffuse_transmission.expect("light passes");
    assert_eq!(channel(through.factor.texture), 3);
    assert!(p.anisotropy.expect("a direction").texture.is_some());
    // Two textures in all: one image as colour and as data. Every reference is checked.
    assert_eq!(loaded.scene.textures.len(), 2);
    let colors = [p.sheen.expect("fibres").color.texture, through.color.texture];
    assert!(colors.iter().all(|c| c.is_some() && *c != coat.factor.texture.map(|t| t.0)));
    assert_eq!(loaded.scene.materials[0].textures().count(), 10);
}

/// A draft: read with a warning by name. Red of its texture multiplies the factor.
#[test]
fn the_diffuse_part_may_be_rough() {
    let texture = json!({"index": 0});
    let rough = |factor: Value| {
        load(json!({"KHR_materials_diffuse_roughness":
            {"diffuseRoughnessFactor": factor, "diffuseRoughnessTexture": texture}}))
    };
    let of = |loaded: &Loaded| match &loaded.scene.materials[0].model {
        Model::Pbr(p) => p.diffuse_roughness,
        other => panic!("{other:?}"),
    };
    let loaded = rough(json!(0.25));
    assert_eq!((of(&loaded).factor, of(&loaded).texture.map(|t| t.1)), (0.25, Some(0)));
    let reported =
        |loaded: &Loaded, words: &str| loaded.warnings.iter().any(|w| w.to_string().contains(words));
    assert!(reported(&loaded, "KHR_materials_diffuse_roughness is a draft"), "{:?}", loaded.warnings);
    assert_eq!(material(json!({"KHR_materials_diffuse_roughness": {}})), PbrMaterial::default());
    let excessive = rough(json!(7));
    assert_eq!(of(&excessive).factor, 1.0);
    assert!(reported(&excessive, "diffuseRoughnessFactor") && reported(&excessive, "clamped"));
    let asset = triangle_with(|a| {
        let nonsense = json!({"KHR_materials_diffuse_roughness": {"diffuseRoughnessFactor": [1]}});
        a["materials"][0] = json!({"extensions": nonsense});
    });
    let message = super::asset::refusal(&asset);
    assert!(message.contains("diffuseRoughnessFactor"), "{message}");
}

#[test]
fn nonsense_is_clamped_or_named() {
    let loaded = load(json!({"KHR_materials_clearcoat": {"clearcoatFactor": 3},
                             "KHR_materials_iridescence": {"iridescenceFactor": 1, "iridescenceIor": 0}}));
    for place in ["clearcoatFactor", "iridescenceIor"] {
        assert!(loaded.warnings.iter().any(|w| w.place.ends_with(place) && w.message.contains("clamped")));
    }
    let asset = triangle_with(|a| {
        a["materials"][0] = json!({"extensions": {"KHR_materials_sheen": {"sheenColorFactor": "red"},
            "KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatTexture": {}}}});
    });
    let message = super::asset::refusal(&asset);
    for place in ["sheenColorFactor", "clearcoatTexture"] {
        assert!(message.contains(place), "{message}");
    }
}
