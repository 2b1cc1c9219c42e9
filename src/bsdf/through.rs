//! Light scattered diffusely through a surface (KHR_materials_diffuse_transmission).

use super::{BsdfEval, BsdfSample};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::sampling::warp;
use std::f32::consts::FRAC_1_PI;

/// Ideal diffuse transmission of all light, to both sides alike: f = 1 / pi.
#[derive(Clone, Copy, Debug)]
pub struct DiffuseThrough;

impl DiffuseThrough {
    /// See [`super::Bsdf::sample`].
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let up = warp::cosine_hemisphere([u[0], u[1]]);
        BsdfSample {
            wi: Vec3::new(up.x, up.y, up.z.copysign(-wo.z)),
            weight: Rgb::ONE,
            pdf_solid_angle: up.z * FRAC_1_PI,
            eta: 1.0,
            flux: 1.0,
            is_specular: false,
            is_transmission: true,
        }
    }

    /// See [`super::Bsdf::eval`].
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        let crosses = (wo.z < 0.0) != (wi.z < 0.0);
        let pdf_solid_angle = if crosses { wi.z.abs() * FRAC_1_PI } else { 0.0 };
        BsdfEval { f_cos: Rgb::splat(pdf_solid_angle), pdf_solid_angle }
    }
}
