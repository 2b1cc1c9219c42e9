//! A clear dielectric layer on top of everything else (KHR_materials_clearcoat).

use super::albedo_table::DirectionalAlbedo;
use super::{BsdfEval, BsdfSample, SchlickMetal, fresnel};
use crate::color::Rgb;
use crate::math::{Frame, Vec3};
use crate::scene::EnergyCompensation;

/// Reflectance at normal incidence: an index of refraction of 1.5, as the extension fixes it.
const F0: Rgb = Rgb::splat(0.04);

/// The reflection of the layer, with a normal of its own. What it lets pass is one minus its directional albedo.
#[derive(Clone, Copy, Debug)]
pub struct Coat {
    /// Its strength 0..1; 0 for none.
    pub factor: f32,
    /// GGX alpha; below [`super::ggx::MIN_ALPHA`] an exact mirror.
    pub alpha: f32,
    /// Its unit normal in the frame of the BSDF, z above 0.
    pub normal: Vec3,
    /// Whether the energy that single scattering loses is given back.
    pub energy_compensation: EnergyCompensation,
}

impl Coat {
    /// No layer.
    pub const NONE: Coat =
        Coat { factor: 0.0, alpha: 0.0, normal: Vec3::Z, energy_compensation: EnergyCompensation::On };

    /// The reflecting lobe of a layer of full strength, in its own frame.
    #[inline(always)]
    fn lobe(&self) -> SchlickMetal {
        SchlickMetal { f0: F0, alpha: self.alpha, energy_compensation: self.energy_compensation }
    }

    /// Is its reflection a single direction?
    #[inline(always)]
    pub fn is_mirror(&self) -> bool {
        self.lobe().is_mirror()
    }

    /// Share of light from a direction that the layer reflects, its strength included.
    #[inline(always)]
    pub fn albedo(&self, wo: Vec3) -> f32 {
        let cosine = wo.dot(self.normal).abs().clamp(super::ggx::MIN_COS, 1.0);
        let full = if self.is_mirror() {
            fresnel::schlick(F0, Rgb::ONE, cosine).r
        } else {
            let table = DirectionalAlbedo::at(cosine, self.alpha);
            let gain = match self.energy_compensation {
                EnergyCompensation::On => table.compensation(F0).r,
                EnergyCompensation::Off => 1.0,
            };
            table.reflectance(F0, 1.0).r * gain
        };
        (self.factor * full).min(1.0)
    }

    /// See [`super::Bsdf::sample`], for a layer of full strength. Reflections to below the base's surface are lost.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        if self.normal == Vec3::Z {
            return self.lobe().sample(wo, u);
        }
        let frame = Frame::from_normal(self.normal);
        let mut s = self.lobe().sample(frame.to_local(wo), u);
        s.wi = frame.to_world(s.wi).normalize();
        if (s.wi.z < 0.0) == (wo.z < 0.0) { s } else { BsdfSample::ABSORBED }
    }

    /// See [`super::Bsdf::eval`], for a layer of full strength.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if (wo.z < 0.0) != (wi.z < 0.0) {
            return BsdfEval::ZERO;
        }
        if self.normal == Vec3::Z {
            return self.lobe().eval(wo, wi);
        }
        let frame = Frame::from_normal(self.normal);
        self.lobe().eval(frame.to_local(wo), frame.to_local(wi))
    }
}
