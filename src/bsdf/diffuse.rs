//! Diffuse reflection (Lambert, Oren-Nayar) and diffuse transmission.

use super::{Appearance, BsdfEval, BsdfSample, Lobe, LocalFrame, MaterialProgram, Slots};
use crate::color::Rgb;
use crate::math::{Vec3, poly};
use crate::sampling::warp;
use crate::scene::{ColorSlot, FloatSlot};
use std::f32::consts::{FRAC_1_PI, PI};

/// Ideal diffuse reflection on both sides (Lambert 1760): f = albedo / pi.
#[derive(Clone, Copy, Debug)]
pub struct Lambert {
    /// Albedo, 0..1.
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
            ..BsdfSample::ABSORBED
        }
    }

    #[inline(always)]
    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        let same_side = (wo.z < 0.0) == (wi.z < 0.0);
        let pdf_solid_angle = if same_side { wi.z.abs() * FRAC_1_PI } else { 0.0 };
        BsdfEval { f_cos: self.albedo * pdf_solid_angle, pdf_solid_angle }
    }

    #[inline(always)]
    fn is_diffuse_base(&self) -> bool {
        true
    }

    #[inline(always)]
    fn tinted(self, color: Rgb) -> Self {
        Lambert { albedo: self.albedo * color }
    }

    #[inline(always)]
    fn albedo(&self) -> Rgb {
        self.albedo
    }

    fn appearance(&self) -> Appearance {
        Appearance { diffuse: self.albedo, ..Appearance::BLACK }
    }

    fn diffuse_part(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.eval(wo, wi).f_cos
    }
}

/// The parameters of a [`Lambert`].
#[derive(Clone, Copy, Debug)]
pub struct LambertProgram {
    pub albedo: ColorSlot,
}

impl MaterialProgram for LambertProgram {
    type Lobe = Lambert;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> Lambert {
        Lambert { albedo: slots.reflectance(&self.albedo) }
    }
}

/// Fujii's form of the Oren-Nayar model with multiple scattering between facets (Portsmouth, Kutz, Hill 2024, "EON: A Practical
/// Energy-Preserving Rough Diffuse BRDF"). Two-sided and reciprocal; a white surface reflects all light; roughness 0 is Lambertian.
#[derive(Clone, Copy, Debug)]
pub struct OrenNayar {
    /// Albedo of a facet, 0..1; above 1 multiple scattering is that of white facets, since it would grow without bound.
    pub color: Rgb,
    /// Roughness, 0..1.
    pub roughness: f32,
}

/// Constant of the normalisation, 1/2 - 2 / (3 pi) (eq. 15).
const C1: f32 = 0.5 - 2.0 / (3.0 * PI);
/// Constant of the mean albedo, 2/3 - 28 / (15 pi) (eq. 16).
const C2: f32 = 2.0 / 3.0 - 28.0 / (15.0 * PI);

impl OrenNayar {
    #[inline(always)]
    fn normalisation(&self) -> f32 {
        1.0 / (1.0 + C1 * self.roughness)
    }

    /// Single-scattering directional albedo of a white surface by the paper's polynomial (listing 1), within 0.001.
    #[inline(always)]
    fn single_albedo(&self, cosine: f32) -> f32 {
        let m = 1.0 - cosine;
        let g = m * (0.057_108_53 + m * (0.491_881_87 + m * (-0.332_181_44 + m * 0.071_442_995)));
        (1.0 + self.roughness * g) * self.normalisation()
    }

    /// Probability of uniform instead of cosine-weighted hemisphere sampling: at grazing incidence much of the reflected light comes
    /// from grazing directions.
    #[inline(always)]
    fn probability_uniform(&self, zo: f32) -> f32 {
        0.5 * self.roughness * (1.0 - zo) * (1.0 - zo)
    }
}

impl Lobe for OrenNayar {
    #[inline]
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
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

    #[inline]
    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if (wo.z < 0.0) != (wi.z < 0.0) {
            return BsdfEval::ZERO;
        }
        let (zo, zi) = (wo.z.abs().min(1.0), wi.z.abs().min(1.0));
        // s of eq. 10; rounding may give values below -1.
        let s = (wo.dot(wi) - zo * zi).max(-1.0);
        let s_over_t = if s > 0.0 { s / zo.max(zi).max(1e-6) } else { s };
        let single = self.color * (self.normalisation() * (1.0 + self.roughness * s_over_t));
        let mean = self.normalisation() * (1.0 + C2 * self.roughness);
        let lost = |cosine| (1.0 - self.single_albedo(cosine)).max(0.0);
        let color = self.color.min(Rgb::ONE);
        let multiple_color = self.color * color * mean / (Rgb::ONE - color * (1.0 - mean));
        let multiple = multiple_color * (lost(zo) * lost(zi) / (1.0 - mean).max(1e-7));
        let probability_uniform = self.probability_uniform(zo);
        let cosine = zi * FRAC_1_PI;
        let pdf_solid_angle = probability_uniform * (0.5 * FRAC_1_PI) + (1.0 - probability_uniform) * cosine;
        BsdfEval { f_cos: (single + multiple) * cosine, pdf_solid_angle }
    }

    #[inline(always)]
    fn is_diffuse_base(&self) -> bool {
        true
    }

    #[inline(always)]
    fn tinted(self, color: Rgb) -> Self {
        OrenNayar { color: self.color * color, ..self }
    }

    #[inline(always)]
    fn albedo(&self) -> Rgb {
        self.color
    }

    fn appearance(&self) -> Appearance {
        Appearance { diffuse: self.color, ..Appearance::BLACK }
    }

    fn diffuse_part(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.eval(wo, wi).f_cos
    }
}

/// The parameters of an [`OrenNayar`].
#[derive(Clone, Copy, Debug)]
pub struct OrenNayarProgram {
    pub color: ColorSlot,
    pub roughness: FloatSlot,
}

impl MaterialProgram for OrenNayarProgram {
    type Lobe = OrenNayar;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> OrenNayar {
        OrenNayar { color: slots.reflectance(&self.color), roughness: slots.clamped_number(&self.roughness) }
    }
}

/// Ideal diffuse transmission with albedo 1, two-sided: f = 1 / pi (KHR_materials_diffuse_transmission).
#[derive(Clone, Copy, Debug)]
pub struct LambertTransmission;

impl LambertTransmission {
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let up = warp::cosine_hemisphere([u[0], u[1]]);
        BsdfSample {
            wi: Vec3::new(up.x, up.y, up.z.copysign(-wo.z)),
            weight: Rgb::ONE,
            pdf_solid_angle: up.z * FRAC_1_PI,
            is_transmission: true,
            ..BsdfSample::ABSORBED
        }
    }

    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        let is_transmission = (wo.z < 0.0) != (wi.z < 0.0);
        let pdf_solid_angle = if is_transmission { wi.z.abs() * FRAC_1_PI } else { 0.0 };
        BsdfEval { f_cos: Rgb::splat(pdf_solid_angle), pdf_solid_angle }
    }
}
