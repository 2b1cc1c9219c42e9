//! The modified Phong model of older files.

use super::{Appearance, BsdfEval, BsdfSample, Lobe, LocalFrame, MaterialProgram, Slots};
use crate::color::Rgb;
use crate::math::{Vec3, poly};
use crate::sampling::warp;
use crate::scene::ColorSlot;
use std::f32::consts::{FRAC_1_PI, TAU};

/// Diffuse reflection and a cosine lobe around the mirror direction (Lafortune, Willems 1994, "Using the modified Phong
/// reflectance model for physically based rendering"): f = kd / pi + ks (n + 2) / (2 pi) cos^n.
///
/// Both sides alike. Reciprocal; returns at most kd + ks of the light, and that only from straight above. Elsewhere the
/// specular share is darker by about the view cosine, and what of the lobe is below the surface is lost:
///
/// | Albedo for ks = 1, view cosine | 1 | 0.7 | 0.5 | 0.3 | 0.1 | 0.02 |
/// |---|---|---|---|---|---|---|
/// | n = 1 | 1 | 0.75 | 0.61 | 0.48 | 0.37 | 0.33 |
/// | n = 10 | 1 | 0.70 | 0.51 | 0.33 | 0.18 | 0.13 |
/// | n = 100 | 1 | 0.70 | 0.50 | 0.30 | 0.11 | 0.05 |
/// | n = 1000 | 1 | 0.70 | 0.50 | 0.30 | 0.10 | 0.03 |
///
/// For that loss `Ns` of MTL files becomes the roughness of facets, which reflect more towards grazing incidence as
/// real surfaces do; this model is there for who asks for it, with `type = "phong"` in a scene file.
#[derive(Clone, Copy, Debug)]
pub struct Phong {
    /// Diffuse share kd.
    pub diffuse: Rgb,
    /// Specular share ks; kd + ks is at most 1.
    pub specular: Rgb,
    /// The exponent n, from 0.
    pub exponent: f32,
}

/// x to a power, for x in 0..1. 0 below the smallest normal number.
#[inline(always)]
fn power(x: f32, exponent: f32) -> f32 {
    if x >= f32::MIN_POSITIVE { poly::exp(exponent * poly::ln(x)) } else { 0.0 }
}

impl Phong {
    /// Scales both shares down where they would reflect more light than arrives.
    pub fn new(diffuse: Rgb, specular: Rgb, exponent: f32) -> Phong {
        let scale = 1.0 / (diffuse + specular).max_element().max(1.0);
        Phong { diffuse: diffuse * scale, specular: specular * scale, exponent }
    }

    #[inline(always)]
    fn probability_specular(&self) -> f32 {
        let (s, d) = (self.specular.mean(), self.diffuse.mean());
        s / if s + d > 0.0 { s + d } else { 1.0 }
    }
}

impl Lobe for Phong {
    #[inline]
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let wi = if u[2] < self.probability_specular() {
            // cos = u^(1 / (n + 1)).
            let cosine = power(1.0 - u[0], 1.0 / (self.exponent + 1.0));
            let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
            let (s, c) = poly::sin_cos_turns(u[1]);
            let mirror = Vec3::new(-wo.x, -wo.y, wo.z);
            crate::math::Frame::from_normal(mirror)
                .to_world(Vec3::new(sine * c, sine * s, cosine))
                .normalize()
        } else {
            let up = warp::cosine_hemisphere([u[0], u[1]]);
            Vec3::new(up.x, up.y, up.z.copysign(wo.z))
        };
        if wi.z == 0.0 {
            return BsdfSample::ABSORBED;
        }
        BsdfSample::reflected(wi, self.eval(wo, wi))
    }

    #[inline]
    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if (wo.z < 0.0) != (wi.z < 0.0) {
            return BsdfEval::ZERO;
        }
        let lobe = power((wo.z * wi.z - wo.x * wi.x - wo.y * wi.y).min(1.0), self.exponent);
        let cosine = wi.z.abs();
        let p = self.probability_specular();
        let f = self.diffuse * FRAC_1_PI + self.specular * (lobe * (self.exponent + 2.0) / TAU);
        BsdfEval {
            f_cos: f * cosine,
            pdf_solid_angle: (1.0 - p) * cosine * FRAC_1_PI + p * lobe * (self.exponent + 1.0) / TAU,
        }
    }

    #[inline(always)]
    fn is_specular(&self) -> bool {
        false
    }

    #[inline(always)]
    fn tinted(self, color: Rgb) -> Self {
        Phong { diffuse: self.diffuse * color, ..self }
    }

    #[inline(always)]
    fn albedo(&self) -> Rgb {
        self.diffuse + self.specular
    }

    /// Its lobe is about as wide as that of facets of this alpha (Walter et al. 2007, section 5.2).
    fn appearance(&self) -> Appearance {
        let alpha = (2.0 / (self.exponent + 2.0)).sqrt();
        Appearance {
            diffuse: self.diffuse,
            glossy: self.specular,
            roughness: Appearance::roughness([alpha; 2]),
            ..Appearance::BLACK
        }
    }

    fn diffuse_part(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let is_reflected = (wo.z < 0.0) == (wi.z < 0.0);
        self.diffuse * if is_reflected { FRAC_1_PI * wi.z.abs() } else { 0.0 }
    }
}

/// The parameters of a [`Phong`].
#[derive(Clone, Copy, Debug)]
pub struct PhongProgram {
    /// See [`Phong::diffuse`].
    pub diffuse: ColorSlot,
    /// See [`Phong::specular`].
    pub specular: ColorSlot,
    /// See [`Phong::exponent`].
    pub exponent: f32,
}

impl MaterialProgram for PhongProgram {
    type Lobe = Phong;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> Phong {
        let [diffuse, specular] = [&self.diffuse, &self.specular].map(|slot| slots.share_by_channel(slot));
        Phong::new(diffuse, specular, self.exponent)
    }
}
