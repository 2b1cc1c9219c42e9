//! Ideal diffuse reflection.

use super::{BsdfEval, BsdfSample, Lobe, LocalFrame, MaterialProgram, Slots};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::sampling::warp;
use crate::scene::ColorSlot;
use std::f32::consts::FRAC_1_PI;

/// Ideal diffuse reflection on both sides (Lambert 1760): f = albedo / pi.
#[derive(Clone, Copy, Debug)]
pub struct Lambert {
    /// Share of light reflected, 0..1.
    pub albedo: Rgb,
}

impl Lobe for Lambert {
    #[inline(always)]
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let up = warp::cosine_hemisphere([u[0], u[1]]);
        BsdfSample {
            wi: Vec3::new(up.x, up.y, up.z.copysign(wo.z)),
            weight: self.albedo,
            pdf_solid_angle: up.z * FRAC_1_PI,
            eta: 1.0,
            flux: 1.0,
            is_specular: false,
            is_transmission: false,
        }
    }

    #[inline(always)]
    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        let same_side = (wo.z < 0.0) == (wi.z < 0.0);
        let pdf_solid_angle = if same_side { wi.z.abs() * FRAC_1_PI } else { 0.0 };
        BsdfEval { f_cos: self.albedo * pdf_solid_angle, pdf_solid_angle }
    }

    #[inline(always)]
    fn is_specular(&self) -> bool {
        false
    }

    #[inline(always)]
    fn tinted(self, color: Rgb) -> Self {
        Lambert { albedo: self.albedo * color }
    }

    #[inline(always)]
    fn albedo(&self) -> Rgb {
        self.albedo
    }
}

/// The parameters of a [`Lambert`].
#[derive(Clone, Copy, Debug)]
pub struct LambertProgram {
    /// See [`Lambert::albedo`].
    pub albedo: ColorSlot,
}

impl MaterialProgram for LambertProgram {
    type Lobe = Lambert;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> Lambert {
        Lambert { albedo: slots.share_by_channel(&self.albedo) }
    }
}
