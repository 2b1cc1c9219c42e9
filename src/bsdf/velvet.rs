//! The velvet of Ashikhmin, as older files of Blender have it.

use super::{Appearance, BsdfEval, BsdfSample, Lobe, LocalFrame, MaterialProgram, Slots};
use crate::color::Rgb;
use crate::math::{Vec3, poly};
use crate::sampling::warp;
use crate::scene::{ColorSlot, FloatSlot};
use std::f32::consts::{FRAC_1_PI, PI};

/// Facets whose normals lie along the surface (Ashikhmin, Premoze, Shirley 2000, "A Microfacet-based BRDF Generator", section 4.4), with
/// the density of normals exp(-cot^2 / sigma^2) / (pi sigma^2 sin^4) and the masking of V grooves (Cook, Torrance 1982, eq. 9). The density
/// isn't normalised: most light is lost, at grazing incidence some is gained. Both sides alike. Models with more truth to them are those of
/// [`super::Sheen`].
#[derive(Clone, Copy, Debug)]
pub struct Velvet {
    /// Factor on the scattered light.
    pub color: Rgb,
    /// The standard deviation sigma of the density, from 0.01 to 1.
    pub deviation: f32,
}

/// Deviations are at least this.
const MIN_DEVIATION: f32 = 0.01;

/// Cosines are at least this where they divide.
const MIN_COSINE: f32 = 1e-5;

/// Density of directions that are uniform over the hemisphere.
const UNIFORM: f32 = 0.5 * FRAC_1_PI;

impl Velvet {
    /// Value of white velvet for directions above the surface.
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
        BsdfEval { f_cos: self.color * self.value(above(wo), above(wi)), pdf_solid_angle: UNIFORM }
    }

    #[inline(always)]
    fn is_specular(&self) -> bool {
        false
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
    /// See [`Velvet::color`].
    pub color: ColorSlot,
    /// See [`Velvet::deviation`].
    pub deviation: FloatSlot,
}

impl MaterialProgram for VelvetProgram {
    type Lobe = Velvet;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> Velvet {
        let deviation = slots.share(&self.deviation).max(MIN_DEVIATION);
        Velvet { color: slots.share_by_channel(&self.color), deviation }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values by hand: at deviation 1 the density at 45 degrees is exp(-1) / (pi / 4), and grooves don't mask.
    #[test]
    fn values_are_those_of_the_formula() {
        let velvet = Velvet { color: Rgb::ONE, deviation: 1.0 };
        let root = std::f32::consts::FRAC_1_SQRT_2;
        let wo = Vec3::new(root, 0.0, root);
        let found = velvet.eval(wo, wo).f_cos.r;
        let exact = 0.25 * (-1.0f32).exp() * 4.0 * FRAC_1_PI / root;
        assert!((found / exact - 1.0).abs() < 1e-4, "{found} {exact}");
        // Light from the other side is masked by 2 cos(half) cos / (wo . half) = 2 * 0.5.
        let mirrored = velvet.eval(Vec3::new(0.8, 0.0, 0.6), Vec3::new(-0.6, 0.0, 0.8)).f_cos.r;
        let half = Vec3::new(0.2, 0.0, 1.4).normalize();
        let (c, s) = (half.z * half.z, half.x * half.x);
        let masked = (2.0 * half.z / half.dot(Vec3::new(0.8, 0.0, 0.6)) * 0.6f32).min(1.0);
        let exact = 0.25 * (-c / s).exp() / (PI * s * s) * masked / 0.6;
        assert!((mirrored / exact - 1.0).abs() < 1e-3, "{mirrored} {exact}");
    }
}
