//! Smooth glass: solid, and as a thin sheet.

use super::{BsdfSample, fresnel};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::scene::FresnelModel;

/// The boundary of a smooth solid dielectric. z above 0 is outside.
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    /// Index of refraction of the inside over the outside.
    pub ior: f32,
    /// Factor on transmitted light at each crossing.
    pub tint: Rgb,
    /// Fresnel term.
    pub fresnel: FresnelModel,
}

impl Dielectric {
    /// See [`super::Bsdf::sample`]: reflects with the probability of the reflectance, refracts otherwise.
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let eta = if wo.z < 0.0 { 1.0 / self.ior } else { self.ior };
        let cos_o = wo.z.abs().min(1.0);
        let side = match self.fresnel {
            FresnelModel::Exact => fresnel::exact(cos_o, eta),
            FresnelModel::Schlick => fresnel::schlick_dielectric(cos_o, eta),
        };
        if u[2] < side.reflectance {
            return BsdfSample::mirror(wo, Rgb::ONE, side.reflectance);
        }
        let inverse = 1.0 / eta;
        let wi = Vec3::new(-wo.x * inverse, -wo.y * inverse, (-side.cos_transmitted).copysign(-wo.z));
        BsdfSample {
            wi: wi.normalize(),
            weight: self.tint * (inverse * inverse),
            pdf_solid_angle: 1.0 - side.reflectance,
            eta,
            is_specular: true,
            is_transmission: true,
        }
    }
}

/// A thin smooth sheet of glass: light passes straight on; the reflections between its two faces are summed.
#[derive(Clone, Copy, Debug)]
pub struct ThinDielectric {
    /// Index of refraction of the sheet.
    pub ior: f32,
    /// Factor on transmitted light.
    pub tint: Rgb,
}

impl ThinDielectric {
    /// Share reflected by the sheet: R + T^2 R / (1 - R^2) = 2 R / (1 + R) (Pharr, Jakob, Humphreys 2023, section 9.5).
    #[inline(always)]
    pub fn reflectance(&self, cos_o: f32) -> f32 {
        let r = fresnel::exact(cos_o.abs().min(1.0), self.ior).reflectance;
        2.0 * r / (1.0 + r)
    }

    /// See [`super::Bsdf::sample`].
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let reflectance = self.reflectance(wo.z);
        if u[2] < reflectance {
            return BsdfSample::mirror(wo, Rgb::ONE, reflectance);
        }
        BsdfSample {
            wi: -wo,
            weight: self.tint,
            pdf_solid_angle: 1.0 - reflectance,
            eta: 1.0,
            is_specular: true,
            is_transmission: true,
        }
    }
}
