//! Metal: GGX microfacets with Schlick's Fresnel term.

use super::facet_reflection::FacetReflection;
use super::{BsdfEval, BsdfSample, fresnel};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::scene::EnergyCompensation;

/// A metal; both sides alike.
///
/// With [`EnergyCompensation::On`] the light that single scattering loses is given back by a factor 1 + f0 (1 - E) / E,
/// with E the directional albedo for a reflectance of 1 (Turquin 2019, "Practical multiple scattering compensation for
/// microfacet models", eq. 16). For f0 = 1 it keeps all energy, up to the 0.04 % by which the table of E may be wrong; it
/// is not reciprocal.
#[derive(Clone, Copy, Debug)]
pub struct SchlickMetal {
    /// Reflectance at normal incidence; it rises to 1 at grazing incidence.
    pub f0: Rgb,
    /// GGX alpha 0..1; below [`super::ggx::MIN_ALPHA`] an exact mirror.
    pub alpha: f32,
    /// Whether the energy that single scattering loses is given back.
    pub energy_compensation: EnergyCompensation,
}

impl SchlickMetal {
    #[inline(always)]
    fn lobe(&self) -> FacetReflection<impl Fn(f32) -> Rgb> {
        let SchlickMetal { f0, alpha, energy_compensation } = *self;
        let reflectance = move |cosine| fresnel::schlick(f0, Rgb::ONE, cosine);
        FacetReflection { alpha, f0, reflectance, energy_compensation }
    }

    /// Is it an exact mirror?
    #[inline(always)]
    pub fn is_mirror(&self) -> bool {
        self.lobe().is_mirror()
    }

    /// See [`super::Bsdf::sample`].
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        self.lobe().sample(wo, u)
    }

    /// See [`super::Bsdf::eval`].
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        self.lobe().eval(wo, wi)
    }
}
