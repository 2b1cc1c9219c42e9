//! What the loops over vertices know of a vertex: its closure, the BSDF bound to the point and the viewer. The direct and
//! the scatter loop exist once, generic over a [`VertexClass`]; they are compiled for each class.

use super::lanes::{get, get_rgb};
use super::wave::Vertices;
use crate::bsdf::{Bsdf, BsdfEval, BsdfSample};
use crate::color::Rgb;
use crate::math::{Frame, Vec3};
use crate::sampling::warp;
use std::f32::consts::FRAC_1_PI;

/// A BSDF at a vertex for its viewer. All directions are in world space.
pub trait Closure {
    /// All its lobes reflect, and the normals at its vertices are on the viewer's side.
    const OPAQUE: bool;

    /// It is a point of a medium, which has no sides.
    const IN_MEDIUM: bool = false;

    /// Evaluating costs more than a branch; otherwise it is free of branches, so that loops vectorise.
    const BRANCHES: bool;

    /// Value and density for light from `wi`; zero value where none can come from there. Specular lobes don't count.
    fn eval(&self, wi: Vec3) -> BsdfEval;

    /// Chooses a direction by three numbers in 0..1, of which the last chooses the lobe.
    fn sample(&self, u: [f32; 3]) -> BsdfSample;

    /// Is `wi` on the other side of the surface than the viewer?
    #[inline(always)]
    fn crosses(&self, _wi: Vec3) -> bool {
        false
    }

    /// The light of a light sample that goes on to the camera: value times weight times radiance. Products are rounded
    /// in the order that a class chooses.
    #[inline(always)]
    fn scattered(&self, eval: BsdfEval, weight: f32, throughput: Rgb, radiance: Rgb) -> Rgb {
        throughput * eval.f_cos * radiance * weight
    }
}

/// A class of vertices whose closures are loaded alike.
pub trait VertexClass {
    /// Their closure.
    type Closure: Closure;

    /// The closure of vertex `i`.
    fn closure(&self, v: &Vertices, i: usize) -> Self::Closure;

    /// The density with which vertex `i` might choose the direction of its light sample, over the closure's.
    #[inline(always)]
    fn light_density(&self, _v: &Vertices, _i: usize) -> f32 {
        1.0
    }
}

/// Lambertian vertices.
#[derive(Clone, Copy)]
pub struct LambertClass;

/// Ideal diffuse reflection around a normal.
pub struct LambertClosure {
    albedo: Rgb,
    ns: Vec3,
}

impl VertexClass for LambertClass {
    type Closure = LambertClosure;

    #[inline(always)]
    fn closure(&self, v: &Vertices, i: usize) -> LambertClosure {
        LambertClosure { albedo: get_rgb(&v.albedo, i), ns: get(&v.ns, i) }
    }
}

impl Closure for LambertClosure {
    const OPAQUE: bool = true;
    const BRANCHES: bool = false;

    #[inline(always)]
    fn eval(&self, wi: Vec3) -> BsdfEval {
        let cosine = wi.dot(self.ns);
        let pdf_solid_angle = if cosine > 0.0 { cosine * FRAC_1_PI } else { 0.0 };
        BsdfEval { f_cos: self.albedo * pdf_solid_angle, pdf_solid_angle }
    }

    #[inline(always)]
    fn sample(&self, u: [f32; 3]) -> BsdfSample {
        let local = warp::cosine_hemisphere([u[0], u[1]]);
        BsdfSample {
            wi: Frame::from_normal(self.ns).to_world(local),
            weight: self.albedo,
            pdf_solid_angle: local.z * FRAC_1_PI,
            ..BsdfSample::ABSORBED
        }
    }

    #[inline(always)]
    fn scattered(&self, eval: BsdfEval, weight: f32, throughput: Rgb, radiance: Rgb) -> Rgb {
        throughput * (self.albedo * (eval.pdf_solid_angle * weight)) * radiance
    }
}

/// Vertices with any BSDF.
pub struct GeneralClass<'a> {
    /// The BSDFs of these vertices, the first of which is number `first`.
    pub bsdfs: &'a [Bsdf],
    pub first: usize,
}

/// Any BSDF between a vertex's normals and its viewer.
pub struct GeneralClosure<'a> {
    bsdf: &'a Bsdf,
    wo: Vec3,
    ng: Vec3,
    ns: Vec3,
}

impl<'a> VertexClass for GeneralClass<'a> {
    type Closure = GeneralClosure<'a>;

    #[inline(always)]
    fn closure(&self, v: &Vertices, i: usize) -> GeneralClosure<'a> {
        let bsdf = &self.bsdfs[i - self.first];
        GeneralClosure { bsdf, wo: get(&v.wo, i), ng: get(&v.ng, i), ns: get(&v.ns, i) }
    }
}

impl Closure for GeneralClosure<'_> {
    const OPAQUE: bool = false;
    const BRANCHES: bool = true;

    #[inline]
    fn eval(&self, wi: Vec3) -> BsdfEval {
        let crosses = self.crosses(wi);
        // Most lobes that light sampling can reach reflect.
        let is_possible = if crosses { self.bsdf.scatters_through() } else { wi.dot(self.ng) != 0.0 };
        if !is_possible || self.bsdf.is_specular() {
            return BsdfEval::ZERO;
        }
        let frame = Frame::from_normal(self.ns);
        let (wo, wi) = (frame.to_local(self.wo), frame.to_local(wi));
        // Both normals must agree on which side the light is.
        if crosses && wo.z * wi.z >= 0.0 {
            return BsdfEval::ZERO;
        }
        self.bsdf.eval(wo, wi)
    }

    #[inline]
    fn sample(&self, u: [f32; 3]) -> BsdfSample {
        let frame = Frame::from_normal(self.ns);
        let sample = self.bsdf.sample(frame.to_local(self.wo), u);
        BsdfSample { wi: frame.to_world(sample.wi), ..sample }
    }

    #[inline]
    fn crosses(&self, wi: Vec3) -> bool {
        wi.dot(self.ng) * self.wo.dot(self.ng) < 0.0
    }
}
