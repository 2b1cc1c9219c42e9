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
    /// Index of refraction on the side of `wi` over that on the side of `wo`, by whose square the weight is divided; 1 unless
    /// refracted, and where radiance keeps its value.
    pub eta: f32,
    /// What the weight is multiplied by for flux that goes the other way.
    pub flux: f32,
    /// From a lobe that is a single direction, which [`super::Bsdf::eval`] does not see.
    pub is_specular: bool,
    /// To the other side of the surface.
    pub is_transmission: bool,
}

/// What becomes of radiance where light is refracted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refraction {
    /// It is divided by the square of the index of the side where the light comes from over that of the viewer's.
    Scales,
    /// Nothing, as in Cycles: it is flux then that changes, by the square of the index of the side where it comes from over that
    /// of the side where it goes.
    KeepsRadiance,
}

/// What a refraction multiplies weights by.
#[derive(Clone, Copy, Debug)]
pub struct Refracted {
    /// That of radiance.
    pub weight: f32,
    /// See [`BsdfSample::eta`].
    pub eta: f32,
    /// See [`BsdfSample::flux`].
    pub flux: f32,
}

impl Refraction {
    /// At an index of refraction on the side of the light over that on the viewer's side.
    #[inline(always)]
    pub fn at(self, eta: f32) -> Refracted {
        let inverse = 1.0 / eta;
        match self {
            Refraction::Scales => Refracted { weight: inverse * inverse, eta, flux: eta * eta },
            Refraction::KeepsRadiance => Refracted { weight: 1.0, eta: 1.0, flux: inverse * inverse },
        }
    }
}

impl BsdfSample {
    /// The path ends.
    pub const ABSORBED: BsdfSample = BsdfSample {
        wi: Vec3::Z,
        weight: Rgb::ZERO,
        pdf_solid_angle: 0.0,
        eta: 1.0,
        flux: 1.0,
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
            flux: 1.0,
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
