//! Metal: GGX microfacets with Schlick's Fresnel term.

use super::facet_reflection::FacetReflection;
use super::{BsdfEval, BsdfSample, Lobe, LocalFrame, MaterialProgram, Slots, fresnel};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::scene::{ColorSlot, EnergyCompensation, FloatSlot};

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
}

impl Lobe for SchlickMetal {
    #[inline(always)]
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        self.lobe().sample(wo, u)
    }

    #[inline(always)]
    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        self.lobe().eval(wo, wi)
    }

    #[inline(always)]
    fn is_specular(&self) -> bool {
        self.is_mirror()
    }

    #[inline(always)]
    fn tinted(self, color: Rgb) -> Self {
        SchlickMetal { f0: self.f0 * color, ..self }
    }

    #[inline(always)]
    fn albedo(&self) -> Rgb {
        self.f0
    }
}

/// The parameters of a [`SchlickMetal`].
#[derive(Clone, Copy, Debug)]
pub struct SchlickMetalProgram {
    /// See [`SchlickMetal::f0`].
    pub color: ColorSlot,
    /// Perceptual roughness.
    pub roughness: FloatSlot,
    /// See [`SchlickMetal::energy_compensation`].
    pub energy_compensation: EnergyCompensation,
}

impl MaterialProgram for SchlickMetalProgram {
    type Lobe = SchlickMetal;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> SchlickMetal {
        SchlickMetal {
            f0: slots.share_by_channel(&self.color),
            alpha: slots.alpha(&self.roughness),
            energy_compensation: self.energy_compensation,
        }
    }
}
