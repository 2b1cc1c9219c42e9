//! From a material's description to the simplest BSDF that is equivalent to it.

use super::resolve_pbr::{class_of_pbr, resolve_pbr};
use super::{
    Bsdf, Conductor, Dielectric, GlassReflectance, Lambert, Microsurface, OrenNayar, Phong, RoughDielectric,
    SchlickMetal, Walls,
};
use crate::color::Rgb;
use crate::math::{Vec2, Vec3};
use crate::scene::{ColorSlot, EnergyCompensation, FloatSlot, FresnelModel, Model};

/// Which loop shades a material; known without its textures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum BsdfClass {
    /// [`Bsdf::Black`].
    Black,
    /// [`Bsdf::Lambert`].
    Lambert,
    /// [`Bsdf::OrenNayar`].
    OrenNayar,
    /// [`Bsdf::Phong`].
    Phong,
    /// [`Bsdf::SchlickMetal`].
    SchlickMetal,
    /// [`Bsdf::Conductor`].
    Conductor,
    /// [`Bsdf::Dielectric`].
    Dielectric,
    /// [`Bsdf::ThinDielectric`].
    ThinDielectric,
    /// [`Bsdf::RoughDielectric`].
    RoughDielectric,
    /// [`Bsdf::MetalRough`].
    MetalRough,
    /// [`Bsdf::Layered`].
    Layered,
}

/// Where the values of a material's slots come from at a hit.
pub trait Slots {
    /// A colour.
    fn color(&self, slot: &ColorSlot) -> Rgb;
    /// A number.
    fn number(&self, slot: &FloatSlot) -> f32;
}

/// Choices among models of scattering that are the same for all materials of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShadingModel {
    /// Whether the energy that single scattering loses is given back.
    pub energy_compensation: EnergyCompensation,
    /// Fresnel term of the dielectric layers of glTF materials.
    pub fresnel: FresnelModel,
}

/// The constant factors alone, as if every texture were white.
#[derive(Clone, Copy, Debug)]
pub struct Factors;

impl Slots for Factors {
    #[inline(always)]
    fn color(&self, slot: &ColorSlot) -> Rgb {
        Rgb::from_array(slot.factor)
    }

    #[inline(always)]
    fn number(&self, slot: &FloatSlot) -> f32 {
        slot.factor
    }
}

/// Directions at a hit that some materials depend on, in the frame whose z is the shading normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalFrame {
    /// Where texture coordinate u grows, in the tangent plane.
    pub tangent: Vec2,
    /// The bitangent of normal maps, in the tangent plane.
    pub bitangent: Vec2,
    /// Normal of the clearcoat.
    pub coat_normal: Vec3,
}

impl LocalFrame {
    /// Tangents along x and y, the coat's normal the surface's.
    pub const STRAIGHT: LocalFrame =
        LocalFrame { tangent: Vec2::X, bitangent: Vec2::Y, coat_normal: Vec3::Z };
}

/// Is the slot this number whatever its texture says? A factor of 0 needs no texture.
pub(super) fn always(slot: &FloatSlot, value: f32) -> bool {
    slot.factor == value && (slot.texture.is_none() || value == 0.0)
}

/// The class of a model, the same wherever its textures are looked up.
pub fn class_of(model: &Model) -> BsdfClass {
    match model {
        Model::Black => BsdfClass::Black,
        Model::Lambert { .. } => BsdfClass::Lambert,
        Model::OrenNayar { roughness, .. } if always(roughness, 0.0) => BsdfClass::Lambert,
        Model::OrenNayar { .. } => BsdfClass::OrenNayar,
        Model::Phong { .. } => BsdfClass::Phong,
        Model::SchlickMetal { .. } => BsdfClass::SchlickMetal,
        Model::Conductor { .. } => BsdfClass::Conductor,
        Model::Dielectric { .. } => BsdfClass::Dielectric,
        Model::Glass { is_thin: true, roughness, .. } if always(roughness, 0.0) => BsdfClass::ThinDielectric,
        Model::Glass { .. } => BsdfClass::RoughDielectric,
        Model::Pbr(pbr) => class_of_pbr(pbr),
    }
}

/// The BSDF of a model where its slots have these values. Its class is [`class_of`] the model. Colours and numbers are
/// clamped to 0..1.
///
/// Tint: KHR_materials_transmission multiplies transmitted light by the base colour at each crossing of the surface, so
/// a closed solid shows its square; absorption inside a volume is the integrator's.
#[inline]
pub fn resolve(model: &Model, slots: &impl Slots, frame: &LocalFrame, shading: ShadingModel) -> Bsdf {
    let color = |slot| slots.color(slot).clamp(Rgb::ZERO, Rgb::ONE);
    let number = |slot| slots.number(slot).clamp(0.0, 1.0);
    let alpha = |slot| {
        let roughness = number(slot);
        roughness * roughness
    };
    let energy_compensation = shading.energy_compensation;
    match model {
        Model::Black => Bsdf::Black,
        Model::Lambert { albedo } => Bsdf::Lambert(Lambert { albedo: color(albedo) }),
        Model::OrenNayar { color: c, roughness } if always(roughness, 0.0) => {
            Bsdf::Lambert(Lambert { albedo: color(c) })
        }
        Model::OrenNayar { color: c, roughness } => {
            Bsdf::OrenNayar(OrenNayar { color: color(c), roughness: number(roughness) })
        }
        Model::Phong { diffuse, specular, exponent } => {
            Bsdf::Phong(Phong::new(color(diffuse), color(specular), *exponent))
        }
        Model::SchlickMetal { color: f0, roughness } => {
            Bsdf::SchlickMetal(SchlickMetal { f0: color(f0), alpha: alpha(roughness), energy_compensation })
        }
        Model::Conductor { eta, k, roughness } => Bsdf::Conductor(Conductor {
            eta: Rgb::from_array(*eta),
            k: Rgb::from_array(*k),
            surface: Microsurface::isotropic(alpha(roughness)),
            energy_compensation,
        }),
        Model::Dielectric { ior, tint, fresnel } => {
            Bsdf::Dielectric(Dielectric { ior: *ior, tint: color(tint), fresnel: *fresnel })
        }
        Model::Glass { ior, tint, roughness, is_thin } => {
            if class_of(model) == BsdfClass::ThinDielectric {
                return Bsdf::ThinDielectric(super::ThinDielectric { ior: *ior, tint: color(tint) });
            }
            Bsdf::RoughDielectric(RoughDielectric {
                surface: Microsurface::isotropic(alpha(roughness)),
                ior: *ior,
                walls: if *is_thin { Walls::Thin } else { Walls::Solid },
                tint: color(tint),
                reflectance: GlassReflectance::Plain,
                energy_compensation,
            })
        }
        Model::Pbr(pbr) => resolve_pbr(pbr, slots, frame, shading),
    }
}
