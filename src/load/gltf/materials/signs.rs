//! What tells that a material lost something on its way into the file.

use super::builder::Builder;
use crate::scene::{AlphaMode, ColorSlot, TextureId};
use serde_json::Value;

/// The signs of one material of a file by Blender.
#[derive(Clone, Copy, Default)]
pub(in crate::load::gltf) struct Signs {
    /// It says nothing about how its surface scatters.
    pub is_lost: bool,
    /// It is opaque, pure white and without a texture.
    pub is_white: bool,
    /// It is a metal of roughness 1 without a texture, and not black.
    pub is_rough_metal: bool,
    /// The texture of its base colour, where its alpha, if it has one, does nothing.
    pub ignores_alpha_of: Option<TextureId>,
}

impl Signs {
    /// Looks for them; none in files of others.
    pub(super) fn of(builder: &Builder, base: ColorSlot, alpha: AlphaMode) -> Signs {
        let extension = |name: &str| builder.raw.get("extensions").is_some_and(|e| e.get(name).is_some());
        if !builder.doc.is_from_blender() || builder.doc.is_our_export() || extension("KHR_materials_unlit") {
            return Signs::default();
        }
        let pbr = builder.raw.get("pbrMetallicRoughness");
        let has = |key: &str| pbr.and_then(|pbr| pbr.get(key)).is_some_and(|v| *v != Value::Null);
        Signs {
            is_lost: builder.says_nothing(),
            is_white: pbr.is_some()
                && !has("baseColorFactor")
                && !has("baseColorTexture")
                && !extension("KHR_materials_transmission"),
            is_rough_metal: pbr.is_some()
                && base.factor != [0.0; 3]
                && !["metallicFactor", "roughnessFactor", "metallicRoughnessTexture"].into_iter().any(has),
            ignores_alpha_of: base.texture.filter(|_| alpha == AlphaMode::Opaque),
        }
    }
}
