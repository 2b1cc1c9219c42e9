//! Ideal diffuse reflection.

use super::{BsdfEval, BsdfSample};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::sampling::warp;
use std::f32::consts::FRAC_1_PI;

/// Ideal diffuse reflection on both sides (Lambert 1760): f = albedo / pi.
#[derive(Clone, Copy, Debug)]
pub struct Lambert {
    /// Share of light reflected, 0..1.
    pub albedo: Rgb,
}

impl Lambert {
    /// See [`super::Bsdf::sample`].
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let up = warp::cosine_hemisphere([u[0], u[1]]);
        BsdfSample {
            wi: Vec3::new(up.x, up.y, up.z.copysign(wo.z)),
            weight: self.albedo,
            pdf_solid_angle: up.z * FRAC_1_PI,
            eta: 1.0,
            is_specular: false,
            is_transmission: false,
        }
    }

    /// See [`super::Bsdf::eval`].
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        let same_side = (wo.z < 0.0) == (wi.z < 0.0);
        let pdf_solid_angle = if same_side { wi.z.abs() * FRAC_1_PI } else { 0.0 };
        BsdfEval { f_cos: self.albedo * pdf_solid_angle, pdf_solid_angle }
    }
}
