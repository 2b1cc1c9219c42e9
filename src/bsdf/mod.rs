//! How surfaces scatter light: one file a lobe, and the closed [`Bsdf`] over them.
//!
//! Directions are unit vectors in the local frame whose z is the shading normal; both leave the surface. z of `wo` may
//! be negative: opaque lobes reflect on either side alike, dielectrics tell the inside (negative z) from the outside.
//! Weights are for paths that start at the camera: radiance transmitted into a denser medium is scaled by
//! 1 / eta^2 and back on the way out (as in pbrt and Mitsuba); [`BsdfSample::eta`] lets a roulette undo it.

pub mod albedo_table;
pub mod anisotropic_table;
mod coat;
mod conductor;
mod dielectric;
pub mod dielectric_curve;
pub mod dielectric_table;
mod facet_reflection;
pub mod fresnel;
pub mod ggx;
mod lambert;
mod layered;
mod metal_rough;
mod microsurface;
mod oren_nayar;
mod phong;
#[cfg(test)]
mod reference;
#[cfg(test)]
mod reference_walk;
mod resolve;
mod resolve_pbr;
mod rough_dielectric;
mod schlick_metal;
mod sheen;
#[allow(clippy::approx_constant, reason = "a number of the table happens to be near a sixth of pi")]
mod sheen_data;
mod solid_glass;
mod thin_film;
mod through;

pub use albedo_table::DirectionalAlbedo;
pub use coat::Coat;
pub use conductor::Conductor;
pub use dielectric::{Dielectric, ThinDielectric};
pub use dielectric_curve::{DielectricCurve, LayerFresnel};
pub use dielectric_table::mean_cosine;
pub use ggx::above;
pub use lambert::Lambert;
pub use layered::Layered;
pub use metal_rough::{MetalRough, MetalRoughClosure};
pub use microsurface::{Facets, Isotropic, Microsurface};
pub use oren_nayar::OrenNayar;
pub use phong::Phong;
pub use resolve::{BsdfClass, Factors, LocalFrame, ShadingModel, Slots, class_of, resolve};
pub use rough_dielectric::{GlassReflectance, RoughDielectric, Walls};
pub use schlick_metal::SchlickMetal;
pub use sheen::Sheen;
pub use thin_film::ThinFilm;
pub use through::DiffuseThrough;

use crate::color::Rgb;
use crate::math::Vec3;

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Where the light comes from.
    pub wi: Vec3,
    /// f |cos| / pdf; zero where the path ends.
    pub weight: Rgb,
    /// Density per solid angle; for specular samples the probability of having chosen this direction.
    pub pdf_solid_angle: f32,
    /// Index of refraction on the side of `wi` over that on the side of `wo`; 1 unless refracted.
    pub eta: f32,
    /// From a lobe that is a single direction, which [`Bsdf::eval`] does not see.
    pub is_specular: bool,
    /// To the other side of the surface.
    pub is_transmission: bool,
}

impl BsdfSample {
    /// The path ends.
    pub const ABSORBED: BsdfSample = BsdfSample {
        wi: Vec3::Z,
        weight: Rgb::ZERO,
        pdf_solid_angle: 0.0,
        eta: 1.0,
        is_specular: false,
        is_transmission: false,
    };

    /// A sampled reflected direction, weighted by value over density; the path ends where that is 0.
    #[inline(always)]
    fn reflected(wi: Vec3, eval: BsdfEval) -> BsdfSample {
        let BsdfEval { f_cos, pdf_solid_angle } = eval;
        if pdf_solid_angle <= 0.0 {
            return BsdfSample::ABSORBED;
        }
        BsdfSample { wi, weight: f_cos / pdf_solid_angle, pdf_solid_angle, ..BsdfSample::ABSORBED }
    }

    /// The mirror image of `wo`, chosen with a probability.
    #[inline(always)]
    fn mirror(wo: Vec3, weight: Rgb, probability: f32) -> BsdfSample {
        BsdfSample {
            wi: Vec3::new(-wo.x, -wo.y, wo.z),
            weight,
            pdf_solid_angle: probability,
            eta: 1.0,
            is_specular: true,
            is_transmission: false,
        }
    }
}

/// The value of a BSDF for two directions.
#[derive(Clone, Copy, Debug)]
pub struct BsdfEval {
    /// f times |cos| of `wi`; without specular lobes.
    pub f_cos: Rgb,
    /// Density per solid angle with which sampling finds `wi`.
    pub pdf_solid_angle: f32,
}

impl BsdfEval {
    /// No light that way.
    pub const ZERO: BsdfEval = BsdfEval { f_cos: Rgb::ZERO, pdf_solid_angle: 0.0 };
}

/// Surfaces that return less light than this are black: nothing is divided by it.
const LEAST_ALBEDO: f32 = 1e-30;

/// With a z of -0 turned to 0, so that its sign says the same as a comparison.
#[inline(always)]
fn with_side(v: Vec3) -> Vec3 {
    Vec3::new(v.x, v.y, v.z + 0.0)
}

/// Every way in which a surface may scatter.
#[derive(Clone, Copy, Debug)]
pub enum Bsdf {
    /// Absorbs everything.
    Black,
    /// Ideal diffuse reflection.
    Lambert(Lambert),
    /// Rough diffuse reflection.
    OrenNayar(OrenNayar),
    /// The modified Phong model.
    Phong(Phong),
    /// A metal of a colour, with Schlick's Fresnel term.
    SchlickMetal(SchlickMetal),
    /// A metal of a complex index of refraction.
    Conductor(Conductor),
    /// Smooth solid glass.
    Dielectric(Dielectric),
    /// A smooth thin sheet of glass.
    ThinDielectric(ThinDielectric),
    /// Glass of any roughness, solid or thin.
    RoughDielectric(RoughDielectric),
    /// The opaque glTF material.
    MetalRough(MetalRough),
    /// The glTF material with all layers.
    Layered(Layered),
}

impl Bsdf {
    /// Chooses a direction. `u[2]` chooses the lobe, the others the direction in it.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let wo = with_side(wo);
        match self {
            Bsdf::Black => BsdfSample::ABSORBED,
            Bsdf::Lambert(b) => b.sample(wo, u),
            Bsdf::OrenNayar(b) => b.sample(wo, u),
            Bsdf::Phong(b) => b.sample(wo, u),
            Bsdf::SchlickMetal(b) => b.sample(wo, u),
            Bsdf::Conductor(b) => b.sample(wo, u),
            Bsdf::Dielectric(b) => b.sample(wo, u),
            Bsdf::ThinDielectric(b) => b.sample(wo, u),
            Bsdf::RoughDielectric(b) => b.sample(wo, u),
            Bsdf::MetalRough(b) => b.sample(wo, u),
            Bsdf::Layered(b) => b.sample(wo, u),
        }
    }

    /// Value and density for two directions; specular lobes count as zero.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        let (wo, wi) = (with_side(wo), with_side(wi));
        match self {
            Bsdf::Lambert(b) => b.eval(wo, wi),
            Bsdf::OrenNayar(b) => b.eval(wo, wi),
            Bsdf::Phong(b) => b.eval(wo, wi),
            Bsdf::SchlickMetal(b) => b.eval(wo, wi),
            Bsdf::Conductor(b) => b.eval(wo, wi),
            Bsdf::RoughDielectric(b) => b.eval(wo, wi),
            Bsdf::MetalRough(b) => b.eval(wo, wi),
            Bsdf::Layered(b) => b.eval(wo, wi),
            Bsdf::Black | Bsdf::Dielectric(_) | Bsdf::ThinDielectric(_) => BsdfEval::ZERO,
        }
    }

    /// Are all its samples specular, so that light sampling is in vain?
    #[inline]
    pub fn is_specular(&self) -> bool {
        match self {
            Bsdf::Black | Bsdf::Dielectric(_) | Bsdf::ThinDielectric(_) => true,
            Bsdf::Lambert(_) | Bsdf::OrenNayar(_) | Bsdf::Phong(_) => false,
            Bsdf::SchlickMetal(b) => b.is_mirror(),
            Bsdf::Conductor(b) => b.surface.is_mirror(),
            Bsdf::RoughDielectric(b) => b.is_smooth(),
            Bsdf::MetalRough(b) => b.is_specular(),
            Bsdf::Layered(b) => b.is_specular(),
        }
    }

    /// May light from the other side of the surface reach the viewer by a lobe of finite width?
    #[inline(always)]
    pub fn scatters_through(&self) -> bool {
        matches!(self, Bsdf::RoughDielectric(_) | Bsdf::Layered(_))
    }

    /// With its base colour multiplied (by the colour of vertices).
    #[inline]
    pub fn tinted(self, color: Rgb) -> Bsdf {
        match self {
            Bsdf::Black => Bsdf::Black,
            Bsdf::Lambert(b) => Bsdf::Lambert(Lambert { albedo: b.albedo * color }),
            Bsdf::OrenNayar(b) => Bsdf::OrenNayar(OrenNayar { color: b.color * color, ..b }),
            Bsdf::Phong(b) => Bsdf::Phong(Phong { diffuse: b.diffuse * color, ..b }),
            Bsdf::SchlickMetal(b) => Bsdf::SchlickMetal(SchlickMetal { f0: b.f0 * color, ..b }),
            // The colour of a measured metal is its own.
            Bsdf::Conductor(b) => Bsdf::Conductor(b),
            Bsdf::Dielectric(b) => Bsdf::Dielectric(Dielectric { tint: b.tint * color, ..b }),
            Bsdf::ThinDielectric(b) => Bsdf::ThinDielectric(ThinDielectric { tint: b.tint * color, ..b }),
            Bsdf::RoughDielectric(b) => Bsdf::RoughDielectric(RoughDielectric { tint: b.tint * color, ..b }),
            Bsdf::MetalRough(b) => {
                Bsdf::MetalRough(MetalRough { diffuse: b.diffuse * color, metal_f0: b.metal_f0 * color, ..b })
            }
            Bsdf::Layered(b) => Bsdf::Layered(b.tinted(color)),
        }
    }

    /// With another index of refraction of its glass, for one wavelength of a dispersive material.
    #[inline]
    pub fn with_ior(self, ior: f32) -> Bsdf {
        match self {
            Bsdf::Dielectric(b) => Bsdf::Dielectric(Dielectric { ior, ..b }),
            Bsdf::RoughDielectric(b) => Bsdf::RoughDielectric(RoughDielectric { ior, ..b }),
            Bsdf::Layered(mut b) => {
                b.glass.ior = ior;
                Bsdf::Layered(b)
            }
            other => other,
        }
    }

    /// A plain colour for the albedo output: reflectance at normal incidence, white for clear glass.
    #[inline]
    pub fn albedo(&self) -> Rgb {
        match self {
            Bsdf::Black => Rgb::ZERO,
            Bsdf::Lambert(b) => b.albedo,
            Bsdf::OrenNayar(b) => b.color,
            Bsdf::Phong(b) => b.diffuse + b.specular,
            Bsdf::SchlickMetal(b) => b.f0,
            Bsdf::Conductor(b) => b.reflectance(1.0),
            Bsdf::Dielectric(b) => b.tint,
            Bsdf::ThinDielectric(b) => b.tint,
            Bsdf::RoughDielectric(b) => b.tint,
            Bsdf::MetalRough(b) => b.albedo(),
            Bsdf::Layered(b) => b.albedo(),
        }
    }
}
