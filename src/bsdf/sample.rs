//! What sampling and evaluating a BSDF give.

use crate::color::Rgb;
use crate::math::Vec3;

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Where the light comes from.
    pub wi: Vec3,
    /// f |cos| / pdf; zero where the path ends.
    pub weight: Rgb,
    /// Density per solid angle; for specular samples the probability of having chosen this direction.
    pub pdf_solid_angle: f32,
    /// Index of refraction on the side of `wi` over that on the side of `wo`; 1 unless refracted.
    pub eta: f32,
    /// From a lobe that is a single direction, which [`super::Bsdf::eval`] does not see.
    pub is_specular: bool,
    /// To the other side of the surface.
    pub is_transmission: bool,
}

impl BsdfSample {
    /// The path ends.
    pub const ABSORBED: BsdfSample = BsdfSample {
        wi: Vec3::Z,
        weight: Rgb::ZERO,
        pdf_solid_angle: 0.0,
        eta: 1.0,
        is_specular: false,
        is_transmission: false,
    };

    /// A sampled reflected direction, weighted by value over density; the path ends where that is 0.
    #[inline(always)]
    pub(super) fn reflected(wi: Vec3, eval: BsdfEval) -> BsdfSample {
        let BsdfEval { f_cos, pdf_solid_angle } = eval;
        if pdf_solid_angle <= 0.0 {
            return BsdfSample::ABSORBED;
        }
        BsdfSample { wi, weight: f_cos / pdf_solid_angle, pdf_solid_angle, ..BsdfSample::ABSORBED }
    }

    /// The mirror image of `wo`, chosen with a probability.
    #[inline(always)]
    pub(super) fn mirror(wo: Vec3, weight: Rgb, probability: f32) -> BsdfSample {
        BsdfSample {
            wi: Vec3::new(-wo.x, -wo.y, wo.z),
            weight,
            pdf_solid_angle: probability,
            eta: 1.0,
            is_specular: true,
            is_transmission: false,
        }
    }
}

/// The value of a BSDF for two directions.
#[derive(Clone, Copy, Debug)]
pub struct BsdfEval {
    /// f times |cos| of `wi`; without specular lobes.
    pub f_cos: Rgb,
    /// Density per solid angle with which sampling finds `wi`.
    pub pdf_solid_angle: f32,
}

impl BsdfEval {
    /// No light that way.
    pub const ZERO: BsdfEval = BsdfEval { f_cos: Rgb::ZERO, pdf_solid_angle: 0.0 };
}

/// Surfaces that return less light than this are black: nothing is divided by it.
pub(super) const LEAST_ALBEDO: f32 = 1e-30;

/// With a z of -0 turned to 0, so that its sign says the same as a comparison.
#[inline(always)]
pub(super) fn with_side(v: Vec3) -> Vec3 {
    Vec3::new(v.x, v.y, v.z + 0.0)
}
