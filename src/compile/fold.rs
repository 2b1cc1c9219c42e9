//! Constant textures become part of the factors that they are multiplied with.

use crate::scene::{ColorSlot, FloatSlot, Model, PbrMaterial};
use crate::texture::CompiledTextures;

/// A colour with a constant texture folded in.
pub(super) fn fold_color(slot: ColorSlot, textures: &CompiledTextures) -> ColorSlot {
    match slot.texture.and_then(|id| textures.constant(id)) {
        Some(c) => ColorSlot::constant([0, 1, 2].map(|i| slot.factor[i] * c[i])),
        None if slot.factor == [0.0; 3] => ColorSlot::constant([0.0; 3]),
        None => slot,
    }
}

/// A number with a constant texture folded in.
pub(super) fn fold_float(slot: FloatSlot, textures: &CompiledTextures) -> FloatSlot {
    match slot.texture.and_then(|(id, channel)| Some((textures.constant(id)?, channel))) {
        Some((c, channel)) => FloatSlot::constant(slot.factor * c[usize::from(channel & 3)]),
        None if slot.factor == 0.0 => FloatSlot::constant(0.0),
        None => slot,
    }
}

/// A model with constant textures folded in and without layers that do nothing.
pub(super) fn fold_model(model: &Model, textures: &CompiledTextures) -> Model {
    let color = |slot| fold_color(slot, textures);
    let number = |slot| fold_float(slot, textures);
    match model.clone() {
        Model::Black => Model::Black,
        Model::Lambert { albedo } => Model::Lambert { albedo: color(albedo) },
        Model::OrenNayar { color: c, roughness } => {
            Model::OrenNayar { color: color(c), roughness: number(roughness) }
        }
        Model::Phong { diffuse, specular, exponent } => {
            Model::Phong { diffuse: color(diffuse), specular: color(specular), exponent }
        }
        Model::SchlickMetal { color: f0, roughness } => {
            Model::SchlickMetal { color: color(f0), roughness: number(roughness) }
        }
        Model::Conductor { eta, k, roughness } => Model::Conductor { eta, k, roughness: number(roughness) },
        Model::Dielectric { ior, tint, fresnel } => Model::Dielectric { ior, tint: color(tint), fresnel },
        Model::Glass { ior, tint, roughness, is_thin } => {
            Model::Glass { ior, tint: color(tint), roughness: number(roughness), is_thin }
        }
        Model::Pbr(mut pbr) => {
            let slots = pbr.slots_mut();
            slots.colors.into_iter().for_each(|slot| *slot = color(*slot));
            slots.numbers.into_iter().for_each(|slot| *slot = number(*slot));
            drop_absent_layers(&mut pbr);
            Model::Pbr(pbr)
        }
    }
}

fn drop_absent_layers(pbr: &mut PbrMaterial) {
    let is_zero = |slot: &FloatSlot| slot.factor <= 0.0;
    pbr.clearcoat = pbr.clearcoat.filter(|c| !is_zero(&c.factor));
    pbr.sheen = pbr.sheen.filter(|s| s.color.factor != [0.0; 3]);
    pbr.anisotropy = pbr.anisotropy.filter(|a| a.strength > 0.0);
    pbr.iridescence = pbr.iridescence.filter(|i| !is_zero(&i.factor));
    pbr.diffuse_transmission = pbr.diffuse_transmission.filter(|d| !is_zero(&d.factor));
}
