//! Empirical reflection models: modified Phong, the toon shading of Cycles, and Ashikhmin's velvet of older Blender files.

use super::{Appearance, BsdfEval, BsdfSample, Lobe, LocalFrame, MaterialProgram, Slots};
use crate::color::Rgb;
use crate::math::{Frame, Vec3, poly};
use crate::sampling::warp;
use crate::scene::{ColorSlot, FloatSlot};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, PI, TAU};

/// Diffuse reflection and a cosine lobe around the mirror direction (Lafortune, Willems 1994, "Using the modified Phong
/// reflectance model for physically based rendering"): f = kd / pi + ks (n + 2) / (2 pi) cos^n.
///
/// Two-sided and reciprocal. The albedo is kd + ks at normal incidence; elsewhere the specular albedo falls with about the view cosine,
/// and the part of the lobe below the surface is lost:
///
/// | Albedo for ks = 1, view cosine | 1 | 0.7 | 0.5 | 0.3 | 0.1 | 0.02 |
/// |---|---|---|---|---|---|---|
/// | n = 1 | 1 | 0.75 | 0.61 | 0.48 | 0.37 | 0.33 |
/// | n = 10 | 1 | 0.70 | 0.51 | 0.33 | 0.18 | 0.13 |
/// | n = 100 | 1 | 0.70 | 0.50 | 0.30 | 0.11 | 0.05 |
/// | n = 1000 | 1 | 0.70 | 0.50 | 0.30 | 0.10 | 0.03 |
///
/// Because of this loss `Ns` of MTL files is converted to the roughness of microfacets instead; this model is only used for
/// `type = "phong"` in scene files.
#[derive(Clone, Copy, Debug)]
pub struct Phong {
    /// Diffuse albedo kd, 0..1.
    pub diffuse: Rgb,
    /// Specular albedo ks, 0..1; kd + ks is at most 1.
    pub specular: Rgb,
    /// Exponent n >= 0.
    pub exponent: f32,
}

/// x^exponent for x in 0..1; 0 for subnormal x.
#[inline(always)]
fn power(x: f32, exponent: f32) -> f32 {
    if x >= f32::MIN_POSITIVE { poly::exp(exponent * poly::ln(x)) } else { 0.0 }
}

impl Phong {
    /// Scales both albedos down if their sum exceeds 1.
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
            Frame::from_normal(mirror).to_world(Vec3::new(sine * c, sine * s, cosine)).normalize()
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
    fn tinted(self, color: Rgb) -> Self {
        Phong { diffuse: self.diffuse * color, ..self }
    }

    #[inline(always)]
    fn albedo(&self) -> Rgb {
        self.diffuse + self.specular
    }

    /// The alpha of microfacets with about the same lobe width is sqrt(2 / (n + 2)) (Walter et al. 2007, section 5.2).
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
    pub diffuse: ColorSlot,
    pub specular: ColorSlot,
    pub exponent: f32,
}

impl MaterialProgram for PhongProgram {
    type Lobe = Phong;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> Phong {
        let [diffuse, specular] = [&self.diffuse, &self.specular].map(|slot| slots.clamped_color(slot));
        Phong::new(diffuse, specular, self.exponent)
    }
}

/// Toon shading: constant f |cos| within an angle of an axis (the normal or the mirror direction), with a linear falloff beyond. The
/// albedo is at most `color`. Two-sided, not reciprocal.
#[derive(Clone, Copy, Debug)]
pub struct Toon {
    /// Upper bound of the albedo, 0..1.
    pub color: Rgb,
    /// Angle of full intensity, radians.
    pub angle_rad: f32,
    /// Angle at which the intensity reaches 0, radians.
    pub end_rad: f32,
    /// Whether the axis is the mirror direction (glossy toon).
    pub is_glossy: bool,
}

/// Minimum `size`, as a fraction of a right angle.
const MIN_SIZE: f32 = 1e-5;

impl Toon {
    /// `size` and `smooth` are fractions of a right angle.
    pub fn new(color: Rgb, [size, smooth]: [f32; 2], is_glossy: bool) -> Toon {
        let angle_rad = size.max(MIN_SIZE) * FRAC_PI_2;
        Toon { color, angle_rad, end_rad: angle_rad + smooth * FRAC_PI_2, is_glossy }
    }

    /// Intensity (0..1) at an angle from the axis, radians.
    fn intensity(&self, angle: f32) -> f32 {
        if angle < self.angle_rad {
            return 1.0;
        }
        let width = self.end_rad - self.angle_rad;
        if angle < self.end_rad && width > 0.0 { 1.0 - (angle - self.angle_rad) / width } else { 0.0 }
    }

    /// The cone of sampled directions: half angle in radians, and one minus its cosine.
    fn cone(&self) -> (f32, f32) {
        let angle = self.end_rad.min(FRAC_PI_2);
        let (sine, cosine) = poly::sin_cos(angle);
        (angle, warp::one_minus_cos(sine * sine, cosine * cosine))
    }

    /// The axis, with z above 0.
    fn axis(&self, wo: Vec3) -> Vec3 {
        if self.is_glossy { Vec3::new(-wo.x, -wo.y, wo.z.abs()) } else { Vec3::Z }
    }
}

impl Lobe for Toon {
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let local = warp::uniform_cone([u[0], u[1]], self.cone().1);
        let up = Frame::from_normal(self.axis(wo)).to_world(local);
        if up.z <= 0.0 {
            return BsdfSample::ABSORBED;
        }
        let wi = Vec3::new(up.x, up.y, up.z.copysign(wo.z));
        BsdfSample::reflected(wi, self.eval(wo, wi))
    }

    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if (wo.z < 0.0) != (wi.z < 0.0) {
            return BsdfEval::ZERO;
        }
        let (end, one_minus_cos) = self.cone();
        let angle = poly::acos(self.axis(wo).dot(Vec3::new(wi.x, wi.y, wi.z.abs())).clamp(0.0, 1.0));
        if angle >= end {
            return BsdfEval::ZERO;
        }
        let pdf_solid_angle = warp::uniform_cone_pdf_solid_angle(one_minus_cos);
        BsdfEval { f_cos: self.color * (self.intensity(angle) * pdf_solid_angle), pdf_solid_angle }
    }

    fn tinted(self, color: Rgb) -> Self {
        Toon { color: self.color * color, ..self }
    }

    fn albedo(&self) -> Rgb {
        self.color
    }

    fn appearance(&self) -> Appearance {
        let (diffuse, glossy) =
            if self.is_glossy { (Rgb::ZERO, self.color) } else { (self.color, Rgb::ZERO) };
        Appearance { diffuse, glossy, ..Appearance::BLACK }
    }

    fn diffuse_part(&self, wo: Vec3, wi: Vec3) -> Rgb {
        if self.is_glossy { Rgb::ZERO } else { self.eval(wo, wi).f_cos }
    }
}

/// The parameters of a [`Toon`].
#[derive(Clone, Copy, Debug)]
pub struct ToonProgram {
    pub color: ColorSlot,
    /// Angle of full intensity, as a fraction of a right angle.
    pub size: FloatSlot,
    /// Width of the falloff, as a fraction of a right angle.
    pub smooth: FloatSlot,
    pub is_glossy: bool,
}

impl MaterialProgram for ToonProgram {
    type Lobe = Toon;

    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> Toon {
        let angles = [slots.clamped_number(&self.size), slots.clamped_number(&self.smooth)];
        Toon::new(slots.reflectance(&self.color), angles, self.is_glossy)
    }
}

/// Velvet (Ashikhmin, Premoze, Shirley 2000, "A Microfacet-based BRDF Generator", section 4.4): facets with normals mostly along the
/// surface, of density exp(-cot^2 / sigma^2) / (pi sigma^2 sin^4), with the masking of V grooves (Cook, Torrance 1982, eq. 9). The
/// density isn't normalised: most energy is lost, at grazing incidence some is gained. Two-sided. [`super::Sheen`] is more realistic.
#[derive(Clone, Copy, Debug)]
pub struct Velvet {
    /// Factor on the reflected light, 0..1.
    pub color: Rgb,
    /// Parameter sigma of the density, 0.01..1.
    pub deviation: f32,
}

/// Minimum sigma.
const MIN_DEVIATION: f32 = 0.01;

/// Minimum cosine in denominators.
const MIN_COSINE: f32 = 1e-5;

/// Solid-angle pdf of uniform hemisphere sampling.
const UNIFORM_PDF: f32 = 0.5 * FRAC_1_PI;

impl Velvet {
    /// f cos of white velvet for directions above the surface.
    #[inline]
    fn value(&self, wo: Vec3, wi: Vec3) -> f32 {
        let half = (wo + wi).normalize();
        let (cosine, of_half) = (half.z, wo.dot(half).abs());
        if cosine >= 1.0 - MIN_COSINE || of_half <= MIN_COSINE || wo.z <= MIN_COSINE {
            return 0.0;
        }
        let (squared, inverse) = (1.0 - cosine * cosine, 1.0 / (self.deviation * self.deviation));
        let density = poly::exp(-cosine * cosine / squared * inverse) * inverse / (PI * squared * squared);
        let masked = (2.0 * (cosine / of_half).max(MIN_COSINE) * wo.z.min(wi.z)).min(1.0);
        0.25 * density * masked / wo.z
    }
}

impl Lobe for Velvet {
    #[inline]
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let up = warp::uniform_cone([u[0], u[1]], 1.0);
        let wi = Vec3::new(up.x, up.y, up.z.copysign(wo.z));
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
        let above = |v: Vec3| Vec3::new(v.x, v.y, v.z.abs());
        BsdfEval { f_cos: self.color * self.value(above(wo), above(wi)), pdf_solid_angle: UNIFORM_PDF }
    }

    #[inline(always)]
    fn tinted(self, color: Rgb) -> Self {
        Velvet { color: self.color * color, ..self }
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

/// The parameters of a [`Velvet`].
#[derive(Clone, Copy, Debug)]
pub struct VelvetProgram {
    pub color: ColorSlot,
    pub deviation: FloatSlot,
}

impl MaterialProgram for VelvetProgram {
    type Lobe = Velvet;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> Velvet {
        let deviation = slots.clamped_number(&self.deviation).max(MIN_DEVIATION);
        Velvet { color: slots.reflectance(&self.color), deviation }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The albedo of diffuse toon shading is its colour, with constant intensity within the angle; the falloff is linear.
    #[test]
    fn toon_intensity_is_constant_within_the_angle() {
        let toon = Toon::new(Rgb::splat(0.6), [0.5, 0.0], false);
        let at = |degrees: f32| {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            toon.eval(Vec3::Z, Vec3::new(sine, 0.0, cosine)).f_cos.r
        };
        let cone = TAU * (1.0 - std::f32::consts::FRAC_1_SQRT_2);
        assert!((at(0.0) * cone - 0.6).abs() < 1e-4 && (at(44.0) * cone - 0.6).abs() < 1e-4);
        assert_eq!(at(46.0), 0.0);
        let soft = Toon::new(Rgb::ONE, [0.25, 0.5], true);
        let mirror = Vec3::new(-0.6, 0.0, 0.8);
        let full = soft.eval(Vec3::new(0.6, 0.0, 0.8), mirror).f_cos.r;
        // 45 degrees from the mirror direction is the middle of the falloff (22.5 to 67.5 degrees).
        let (sine, cosine) = (0.6f32.asin() - 45.0f32.to_radians()).sin_cos();
        let faded = soft.eval(Vec3::new(0.6, 0.0, 0.8), Vec3::new(-sine, 0.0, cosine)).f_cos.r;
        assert!((faded / full - 0.5).abs() < 1e-3, "{faded} {full}");
    }

    /// Hand-computed values: at sigma 1 the density at 45 degrees is exp(-1) / (pi / 4), without masking.
    #[test]
    fn velvet_values_equal_the_formula() {
        let velvet = Velvet { color: Rgb::ONE, deviation: 1.0 };
        let root = std::f32::consts::FRAC_1_SQRT_2;
        let wo = Vec3::new(root, 0.0, root);
        let found = velvet.eval(wo, wo).f_cos.r;
        let exact = 0.25 * (-1.0f32).exp() * 4.0 * FRAC_1_PI / root;
        assert!((found / exact - 1.0).abs() < 1e-4, "{found} {exact}");
        // Near the mirror direction light is masked by 2 cos(half) cos / (wo . half).
        let mirrored = velvet.eval(Vec3::new(0.8, 0.0, 0.6), Vec3::new(-0.6, 0.0, 0.8)).f_cos.r;
        let half = Vec3::new(0.2, 0.0, 1.4).normalize();
        let (c, s) = (half.z * half.z, half.x * half.x);
        let masked = (2.0 * half.z / half.dot(Vec3::new(0.8, 0.0, 0.6)) * 0.6f32).min(1.0);
        let exact = 0.25 * (-c / s).exp() / (PI * s * s) * masked / 0.6;
        assert!((mirrored / exact - 1.0).abs() < 1e-3, "{mirrored} {exact}");
    }
}
