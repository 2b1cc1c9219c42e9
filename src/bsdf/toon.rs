//! Toon shading of Cycles: light has steps instead of gradients.

use super::{Appearance, BsdfEval, BsdfSample, Lobe, LocalFrame, MaterialProgram, Slots};
use crate::color::Rgb;
use crate::math::{Frame, Vec3, poly};
use crate::sampling::warp;
use crate::scene::{ColorSlot, FloatSlot};
use std::f32::consts::FRAC_PI_2;

/// Light from within an angle of an axis counts alike, without a cosine; beyond, it fades out linearly with the angle. The axis is the normal,
/// or the mirror direction. Returns at most `color` of the light. Both sides alike, not reciprocal.
#[derive(Clone, Copy, Debug)]
pub struct Toon {
    /// Factor on the scattered light.
    pub color: Rgb,
    /// The angle within which light is whole, radians.
    pub angle_rad: f32,
    /// Where it is dark.
    pub end_rad: f32,
    /// The axis is the mirror direction: a highlight.
    pub is_glossy: bool,
}

/// Angles of highlights are at least this share of a right angle.
const MIN_SIZE: f32 = 1e-5;

impl Toon {
    /// By shares of a right angle.
    pub fn new(color: Rgb, [size, smooth]: [f32; 2], is_glossy: bool) -> Toon {
        let angle_rad = size.max(MIN_SIZE) * FRAC_PI_2;
        Toon { color, angle_rad, end_rad: angle_rad + smooth * FRAC_PI_2, is_glossy }
    }

    /// What is left of light at an angle.
    fn intensity(&self, angle: f32) -> f32 {
        if angle < self.angle_rad {
            return 1.0;
        }
        let width = self.end_rad - self.angle_rad;
        if angle < self.end_rad && width > 0.0 { 1.0 - (angle - self.angle_rad) / width } else { 0.0 }
    }

    /// The cone of directions that are sampled: the angle, and one minus its cosine.
    fn cone(&self) -> (f32, f32) {
        let angle = self.end_rad.min(FRAC_PI_2);
        let (sine, cosine) = poly::sin_cos(angle);
        (angle, warp::one_minus_cos(sine * sine, cosine * cosine))
    }

    /// The axis as a direction above the surface.
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

    fn is_specular(&self) -> bool {
        false
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
    /// See [`Toon::color`].
    pub color: ColorSlot,
    /// The angle within which light is whole, over a right angle.
    pub size: FloatSlot,
    /// The angle over which it fades out, over a right angle.
    pub smooth: FloatSlot,
    /// See [`Toon::is_glossy`].
    pub is_glossy: bool,
}

impl MaterialProgram for ToonProgram {
    type Lobe = Toon;

    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> Toon {
        let angles = [slots.share(&self.size), slots.share(&self.smooth)];
        Toon::new(slots.share_by_channel(&self.color), angles, self.is_glossy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A diffuse one without a fade returns its colour; light beyond its angle is lost.
    #[test]
    fn light_within_the_angle_counts_alike() {
        let toon = Toon::new(Rgb::splat(0.6), [0.5, 0.0], false);
        let at = |degrees: f32| {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            toon.eval(Vec3::Z, Vec3::new(sine, 0.0, cosine)).f_cos.r
        };
        let cone = std::f32::consts::TAU * (1.0 - std::f32::consts::FRAC_1_SQRT_2);
        assert!((at(0.0) * cone - 0.6).abs() < 1e-4 && (at(44.0) * cone - 0.6).abs() < 1e-4);
        assert_eq!(at(46.0), 0.0);
        let soft = Toon::new(Rgb::ONE, [0.25, 0.5], true);
        let mirror = Vec3::new(-0.6, 0.0, 0.8);
        let full = soft.eval(Vec3::new(0.6, 0.0, 0.8), mirror).f_cos.r;
        // 45 degrees from the mirror direction two fifths of the fade are over.
        let (sine, cosine) = (0.6f32.asin() - 45.0f32.to_radians()).sin_cos();
        let faded = soft.eval(Vec3::new(0.6, 0.0, 0.8), Vec3::new(-sine, 0.0, cosine)).f_cos.r;
        assert!((faded / full - 0.5).abs() < 1e-3, "{faded} {full}");
    }
}
