//! From a material's description to the simplest BSDF that is equivalent to it.

use super::{Bsdf, Conductor, Dielectric, Lambert, MetalRough, ThinDielectric, Transmission, fresnel};
use crate::math::Vec3;
use crate::scene::{ColorSlot, FloatSlot, FresnelModel, Microfacet, Model, PbrMaterial};

/// Which loop shades a material; known without its textures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum BsdfClass {
    /// [`Bsdf::Black`].
    Black,
    /// [`Bsdf::Lambert`].
    Lambert,
    /// [`Bsdf::Conductor`].
    Conductor,
    /// [`Bsdf::Dielectric`].
    Dielectric,
    /// [`Bsdf::ThinDielectric`].
    ThinDielectric,
    /// [`Bsdf::MetalRough`].
    MetalRough,
}

/// Where the values of a material's slots come from at a hit.
pub trait Slots {
    /// A colour.
    fn color(&self, slot: &ColorSlot) -> Vec3;
    /// A number.
    fn number(&self, slot: &FloatSlot) -> f32;
}

/// The constant factors alone, as if every texture were white.
#[derive(Clone, Copy, Debug)]
pub struct Factors;

impl Slots for Factors {
    #[inline(always)]
    fn color(&self, slot: &ColorSlot) -> Vec3 {
        Vec3::from_array(slot.factor)
    }

    #[inline(always)]
    fn number(&self, slot: &FloatSlot) -> f32 {
        slot.factor
    }
}

/// Is the slot this number whatever its texture says? A factor of 0 needs no texture.
fn always(slot: &FloatSlot, value: f32) -> bool {
    slot.factor == value && (slot.texture.is_none() || value == 0.0)
}

/// The class of a model, the same wherever its textures are looked up.
pub fn class_of(model: &Model) -> BsdfClass {
    match model {
        Model::Black => BsdfClass::Black,
        Model::Lambert { .. } => BsdfClass::Lambert,
        Model::Metal { .. } => BsdfClass::Conductor,
        Model::Dielectric { .. } => BsdfClass::Dielectric,
        Model::Pbr(pbr) => class_of_pbr(pbr),
    }
}

fn class_of_pbr(pbr: &PbrMaterial) -> BsdfClass {
    if always(&pbr.metallic, 1.0) {
        return BsdfClass::Conductor;
    }
    let dielectric = always(&pbr.metallic, 0.0);
    let clear = always(&pbr.transmission, 1.0) && always(&pbr.roughness, 0.0);
    let plain =
        always(&pbr.specular, 1.0) && pbr.specular_color == ColorSlot::constant([1.0; 3]) && pbr.ior > 0.0;
    if dielectric && clear && plain {
        return if pbr.has_volume { BsdfClass::Dielectric } else { BsdfClass::ThinDielectric };
    }
    if dielectric && always(&pbr.transmission, 0.0) {
        // Without a reflection on top, roughness means nothing.
        if always(&pbr.specular, 0.0) {
            let black = pbr.base_color.texture.is_none() && pbr.base_color.factor == [0.0; 3];
            return if black { BsdfClass::Black } else { BsdfClass::Lambert };
        }
    }
    BsdfClass::MetalRough
}

/// The BSDF of a model where its slots have these values. Its class is [`class_of`] the model. Colours and numbers are
/// clamped to 0..1.
///
/// Tint: KHR_materials_transmission multiplies transmitted light by the base colour at each crossing of the surface, so
/// a closed solid shows its square; absorption inside a volume is the integrator's.
#[inline]
pub fn resolve(model: &Model, slots: &impl Slots, microfacet: Microfacet) -> Bsdf {
    let color = |slot| slots.color(slot).clamp(Vec3::ZERO, Vec3::ONE);
    let number = |slot| slots.number(slot).clamp(0.0, 1.0);
    let conductor =
        |f0, roughness: f32| Bsdf::Conductor(Conductor { f0, alpha: roughness * roughness, microfacet });
    match model {
        Model::Black => Bsdf::Black,
        Model::Lambert { albedo } => Bsdf::Lambert(Lambert { albedo: color(albedo) }),
        Model::Metal { color: f0, roughness } => conductor(color(f0), number(roughness)),
        Model::Dielectric { ior, tint, fresnel } => {
            Bsdf::Dielectric(Dielectric { ior: *ior, tint: color(tint), fresnel: *fresnel })
        }
        Model::Pbr(pbr) => {
            let base = color(&pbr.base_color);
            match class_of_pbr(pbr) {
                BsdfClass::Black => Bsdf::Black,
                BsdfClass::Lambert => Bsdf::Lambert(Lambert { albedo: base }),
                BsdfClass::Conductor => conductor(base, number(&pbr.roughness)),
                BsdfClass::Dielectric => {
                    Bsdf::Dielectric(Dielectric { ior: pbr.ior, tint: base, fresnel: FresnelModel::Exact })
                }
                BsdfClass::ThinDielectric => {
                    Bsdf::ThinDielectric(ThinDielectric { ior: pbr.ior, tint: base })
                }
                BsdfClass::MetalRough => Bsdf::MetalRough(metal_rough(pbr, base, slots, microfacet)),
            }
        }
    }
}

#[inline]
fn metal_rough(pbr: &PbrMaterial, base: Vec3, slots: &impl Slots, microfacet: Microfacet) -> MetalRough {
    let number = |slot| slots.number(slot).clamp(0.0, 1.0);
    let (metallic, specular, transmission) =
        (number(&pbr.metallic), number(&pbr.specular), number(&pbr.transmission));
    let roughness = number(&pbr.roughness);
    // KHR_materials_ior: 0 means that all light is reflected. KHR_materials_specular: f0 is clamped before the factor.
    let normal = if pbr.ior == 0.0 { 1.0 } else { fresnel::f0_from_eta(pbr.ior) };
    let tint = slots.color(&pbr.specular_color).max(Vec3::ZERO);
    let layer = (tint * normal).min(Vec3::ONE) * specular;
    let below = base * (1.0 - metallic);
    MetalRough {
        diffuse: below * (1.0 - transmission),
        transmitted: below * transmission,
        layer_f0: layer,
        layer_f90: specular,
        metal_f0: base,
        metallic,
        alpha: roughness * roughness,
        transmission: if pbr.has_volume && pbr.ior > 0.0 {
            Transmission::Solid(pbr.ior)
        } else {
            Transmission::Thin
        },
        microfacet,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pbr(change: impl FnOnce(&mut PbrMaterial)) -> Model {
        let mut p = PbrMaterial { metallic: FloatSlot::constant(0.0), ..PbrMaterial::default() };
        change(&mut p);
        Model::Pbr(Box::new(p))
    }

    #[test]
    fn materials_find_their_simplest_class() {
        let number = FloatSlot::constant;
        let cases = [
            (pbr(|p| p.specular = number(0.0)), BsdfClass::Lambert),
            (pbr(|_| ()), BsdfClass::MetalRough),
            (pbr(|p| p.metallic = number(1.0)), BsdfClass::Conductor),
            (pbr(|p| p.transmission = number(1.0)), BsdfClass::MetalRough),
            (pbr(|p| (p.transmission, p.roughness) = (number(1.0), number(0.0))), BsdfClass::ThinDielectric),
            (
                pbr(|p| (p.transmission, p.roughness, p.has_volume) = (number(1.0), number(0.0), true)),
                BsdfClass::Dielectric,
            ),
        ];
        for (model, class) in cases {
            assert_eq!(class_of(&model), class);
            let same = match resolve(&model, &Factors, Microfacet::Multi) {
                Bsdf::Black => BsdfClass::Black,
                Bsdf::Lambert(_) => BsdfClass::Lambert,
                Bsdf::Conductor(_) => BsdfClass::Conductor,
                Bsdf::Dielectric(_) => BsdfClass::Dielectric,
                Bsdf::ThinDielectric(_) => BsdfClass::ThinDielectric,
                Bsdf::MetalRough(_) => BsdfClass::MetalRough,
            };
            assert_eq!(same, class);
        }
    }
}
