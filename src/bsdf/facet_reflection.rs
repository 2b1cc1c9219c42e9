//! Reflection by GGX facets of one roughness: the lobe of metals of a colour and of clearcoats.

use super::albedo_table::DirectionalAlbedo;
use super::ggx::{self, MIN_ALPHA};
use super::{BsdfEval, BsdfSample};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::scene::EnergyCompensation;

/// Facets and what they reflect; both sides alike.
pub(super) struct FacetReflection<R: Fn(f32) -> Rgb> {
    /// GGX alpha 0..1; below [`MIN_ALPHA`] an exact mirror.
    pub alpha: f32,
    /// Reflectance at normal incidence, by which lost energy is given back (Turquin 2019, eq. 16).
    pub f0: Rgb,
    /// Reflectance under a cosine.
    pub reflectance: R,
    /// Whether the energy that single scattering loses is given back.
    pub energy_compensation: EnergyCompensation,
}

impl<R: Fn(f32) -> Rgb> FacetReflection<R> {
    /// Is it an exact mirror?
    #[inline(always)]
    pub fn is_mirror(&self) -> bool {
        self.alpha < MIN_ALPHA
    }

    /// The compensation for a view cosine.
    #[inline(always)]
    fn compensation(&self, cos_o: f32) -> Rgb {
        match self.energy_compensation {
            EnergyCompensation::On => DirectionalAlbedo::at(cos_o, self.alpha).compensation(self.f0),
            EnergyCompensation::Off => Rgb::ONE,
        }
    }

    /// See [`super::Bsdf::sample`].
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let above = ggx::above(wo);
        if self.is_mirror() {
            return BsdfSample::mirror(wo, (self.reflectance)(above.z), 1.0);
        }
        let normal = ggx::sample_visible_normal(above, [self.alpha; 2], [u[0], u[1]]);
        let wi = normal * (2.0 * above.dot(normal)) - above;
        let lost = wi.z <= 0.0;
        let r = ggx::reflection(above, wi, self.alpha);
        let factor = (self.reflectance)(r.cos_half) * self.compensation(above.z);
        let weight = factor * (r.f_cos / r.pdf_solid_angle.max(f32::MIN_POSITIVE));
        BsdfSample {
            wi: Vec3::new(wi.x, wi.y, wi.z.copysign(wo.z)),
            weight: if lost { Rgb::ZERO } else { weight },
            pdf_solid_angle: if lost { 0.0 } else { r.pdf_solid_angle },
            eta: 1.0,
            flux: 1.0,
            is_specular: false,
            is_transmission: false,
        }
    }

    /// See [`super::Bsdf::eval`].
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if self.is_mirror() || (wo.z < 0.0) != (wi.z < 0.0) || wi.z == 0.0 {
            return BsdfEval::ZERO;
        }
        let above = ggx::above(wo);
        let r = ggx::reflection(above, Vec3::new(wi.x, wi.y, wi.z.abs()), self.alpha);
        let factor = (self.reflectance)(r.cos_half) * self.compensation(above.z);
        BsdfEval { f_cos: factor * r.f_cos, pdf_solid_angle: r.pdf_solid_angle }
    }
}
