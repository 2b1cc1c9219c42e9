//! Rough diffuse reflection that keeps its energy.

use super::{BsdfEval, BsdfSample};
use crate::color::Rgb;
use crate::math::{Vec3, poly};
use crate::sampling::warp;
use std::f32::consts::{FRAC_1_PI, PI};

/// Fujii's form of the Oren-Nayar model with the light that bounces between its facets (Portsmouth, Kutz, Hill 2024,
/// "EON: A Practical Energy-Preserving Rough Diffuse BRDF"). Both sides alike; reciprocal; white
/// returns all light, and roughness 0 is Lambert's law.
#[derive(Clone, Copy, Debug)]
pub struct OrenNayar {
    /// Share of light reflected by each facet, 0..1.
    pub color: Rgb,
    /// 0..1.
    pub roughness: f32,
}

/// 1/2 - 2 / (3 pi), in the normalisation (eq. 15).
const C1: f32 = 0.5 - 2.0 / (3.0 * PI);
/// 2/3 - 28 / (15 pi), in the mean albedo (eq. 16).
const C2: f32 = 2.0 / 3.0 - 28.0 / (15.0 * PI);

impl OrenNayar {
    #[inline(always)]
    fn normalisation(&self) -> f32 {
        1.0 / (1.0 + C1 * self.roughness)
    }

    /// Directional albedo of single scattering for white, by the polynomial of the paper (listing 1), within 0.001.
    #[inline(always)]
    fn single_albedo(&self, cosine: f32) -> f32 {
        let m = 1.0 - cosine;
        let g = m * (0.057_108_53 + m * (0.491_881_87 + m * (-0.332_181_44 + m * 0.071_442_995)));
        (1.0 + self.roughness * g) * self.normalisation()
    }

    /// Probability of sampling the hemisphere uniformly instead of by the cosine: what returns to a viewer at grazing
    /// incidence comes from grazing directions.
    #[inline(always)]
    fn probability_uniform(&self, zo: f32) -> f32 {
        0.5 * self.roughness * (1.0 - zo) * (1.0 - zo)
    }

    /// See [`super::Bsdf::sample`].
    #[inline]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let up = if u[2] < self.probability_uniform(wo.z.abs()) {
            let (s, c) = poly::sin_cos_turns(u[1]);
            let sine = (1.0 - u[0] * u[0]).max(0.0).sqrt();
            Vec3::new(sine * c, sine * s, u[0])
        } else {
            warp::cosine_hemisphere([u[0], u[1]])
        };
        let wi = Vec3::new(up.x, up.y, up.z.copysign(wo.z));
        BsdfSample::reflected(wi, self.eval(wo, wi))
    }

    /// See [`super::Bsdf::eval`].
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if (wo.z < 0.0) != (wi.z < 0.0) {
            return BsdfEval::ZERO;
        }
        let (zo, zi) = (wo.z.abs().min(1.0), wi.z.abs().min(1.0));
        // The cosine between the projections, scaled: eq. 10. Rounding may take it below -1.
        let s = (wo.dot(wi) - zo * zi).max(-1.0);
        let s_over_t = if s > 0.0 { s / zo.max(zi).max(1e-6) } else { s };
        let single = self.color * (self.normalisation() * (1.0 + self.roughness * s_over_t));
        let mean = self.normalisation() * (1.0 + C2 * self.roughness);
        let lost = |cosine| (1.0 - self.single_albedo(cosine)).max(0.0);
        let between = self.color * self.color * mean / (Rgb::ONE - self.color * (1.0 - mean));
        let multiple = between * (lost(zo) * lost(zi) / (1.0 - mean).max(1e-7));
        let probability_uniform = self.probability_uniform(zo);
        let cosine = zi * FRAC_1_PI;
        let pdf_solid_angle = probability_uniform * (0.5 * FRAC_1_PI) + (1.0 - probability_uniform) * cosine;
        BsdfEval { f_cos: (single + multiple) * cosine, pdf_solid_angle }
    }
}
