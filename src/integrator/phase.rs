//! Points of media as a class of vertices: the closure is the phase function.

use super::closure::{Closure, VertexClass};
use super::lanes::get;
use super::wave::Vertices;
use crate::bsdf::phase::{henyey_greenstein, sample_henyey_greenstein};
use crate::bsdf::{BsdfEval, BsdfSample};
use crate::color::Rgb;
use crate::math::Vec3;

/// Points of media.
#[derive(Clone, Copy, Debug)]
pub struct MediumClass;

/// The phase function of Henyey and Greenstein. What the medium scatters of what arrives is part of the path's
/// throughput.
pub struct PhaseClosure {
    wo: Vec3,
    anisotropy: f32,
}

impl VertexClass for MediumClass {
    type Closure = PhaseClosure;

    #[inline(always)]
    fn closure(&self, v: &Vertices, i: usize) -> PhaseClosure {
        PhaseClosure { wo: get(&v.wo, i), anisotropy: v.anisotropy[i] }
    }
}

impl Closure for PhaseClosure {
    const OPAQUE: bool = false;
    const BRANCHES: bool = false;
    const IN_MEDIUM: bool = true;

    #[inline(always)]
    fn eval(&self, wi: Vec3) -> BsdfEval {
        let pdf_solid_angle = henyey_greenstein(self.anisotropy, -self.wo.dot(wi));
        BsdfEval { f_cos: Rgb::ONE * pdf_solid_angle, pdf_solid_angle }
    }

    #[inline(always)]
    fn sample(&self, u: [f32; 3]) -> BsdfSample {
        let wi = sample_henyey_greenstein(self.anisotropy, self.wo, [u[0], u[1]]);
        BsdfSample {
            wi,
            weight: Rgb::ONE,
            pdf_solid_angle: henyey_greenstein(self.anisotropy, -self.wo.dot(wi)),
            ..BsdfSample::ABSORBED
        }
    }
}
