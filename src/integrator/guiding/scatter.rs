//! Lambertian vertices scatter by a guide, and paths end by what is expected of them.

use super::super::Integrator;
use super::super::closure::{LambertClass, LambertClosure, VertexClass};
use super::super::lanes::{WAVE, get, get_rgb, set, set_rgb};
use super::super::normals::terminator;
use super::super::roulette::{FIRST_ROULETTE, How, survival};
use super::super::wave::{Vertices, Wave};
use super::guide::Guide;
use crate::math::{Frame, offset_along};
use crate::sampling::sampler::SobolPoint;
use crate::sampling::warp;
use crate::simd::{Kernel, dispatch};
use std::f32::consts::FRAC_1_PI;
use std::ops::Range;

/// The first bounce after which a path may be ended by what is expected of it.
const FIRST_JUDGED: u32 = 1;

/// Least probability with which a path goes on.
const LEAST: f32 = 0.05;

/// A path that is expected to bring this share of what it might have brought from its first vertex goes on for certain.
const WHOLE_SHARE: f32 = 0.5;

/// Lambertian vertices that are guided.
#[derive(Clone, Copy)]
pub(in super::super) struct GuidedLambert;

impl VertexClass for GuidedLambert {
    type Closure = LambertClosure;

    #[inline(always)]
    fn closure(&self, v: &Vertices, i: usize) -> LambertClosure {
        LambertClass.closure(v, i)
    }

    #[inline(always)]
    fn light_density(&self, v: &Vertices, i: usize) -> f32 {
        v.guided.light_density[i]
    }
}

impl Integrator<'_> {
    /// May paths end at a bounce by what is expected of them? Where they are shared, not before their prefixes end.
    pub(in super::super) fn uses_adjoint_roulette(&self, bounce: u32) -> bool {
        let first = if self.options.reuse.is_some() { FIRST_ROULETTE } else { FIRST_JUDGED };
        bounce >= first
    }
}

/// Scatters at Lambertian vertices.
pub(in super::super) fn scatter<const SOFT: bool>(
    how: How<'_>,
    uses_adjoint_roulette: bool,
    guide: &Guide,
    range: Range<usize>,
    wave: &mut Wave,
) {
    dispatch(Choose { how, guide, range: range.clone(), wave });
    dispatch(GoOn::<SOFT> { how, floor: guide.floor, uses_adjoint_roulette, range, wave });
}

/// Chooses points of the square of directions, and gets roulette's number and the mean of the cell: into the first four lanes of the
/// scratch memory.
struct Choose<'a> {
    how: How<'a>,
    guide: &'a Guide,
    range: Range<usize>,
    wave: &'a mut Wave,
}

impl Kernel for Choose<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v, scratch: [us, vs, chances, means, ..] } = self.wave;
        let range = self.range.start..self.range.end.min(WAVE);
        for i in range.clone() {
            let point = SobolPoint::from_parts(paths.carried.seed[i], paths.carried.shuffled[i]);
            [us[i], vs[i], _, chances[i]] = point.sample_4d(self.how.dimensions);
        }
        for i in range {
            let histogram = &self.guide.histograms[v.guided.cell[i] as usize];
            ([us[i], vs[i]], v.guided.density[i]) = histogram.sample([us[i], vs[i]]);
            means[i] = histogram.mean;
        }
    }
}

/// Makes directions of the chosen points, and plays roulette.
struct GoOn<'a, const SOFT: bool> {
    how: How<'a>,
    floor: f32,
    /// May paths end by what is expected of them?
    uses_adjoint_roulette: bool,
    range: Range<usize>,
    wave: &'a mut Wave,
}

impl<const SOFT: bool> Kernel for GoOn<'_, SOFT> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v, scratch: [us, vs, chances, means, ..] } = self.wave;
        let path = &mut paths.carried;
        for i in self.range.start..self.range.end.min(WAVE) {
            let (ng, ns) = (get(&v.ng, i), get(&v.ns, i));
            let local = warp::cosine_hemisphere([us[i], vs[i]]);
            let wi = Frame::from_normal(ns).to_world(local);
            let before = get_rgb(&path.throughput, i) * get_rgb(&v.albedo, i);
            let carried = before.luminance();
            v.guided.carried[i] = carried;
            let density = v.guided.density[i];
            let mut throughput = before * (1.0 / density);
            if SOFT {
                throughput *= terminator(ns, ng, wi);
            }
            let eta_squared = path.eta_squared[i];
            // Both kinds of roulette, and then the choice.
            let (survives, scale) = survival(throughput, eta_squared, chances[i], self.how.roulette);
            let expected = carried * eta_squared * means[i];
            let is_known = means[i] >= 0.0;
            let reference = paths.reference[i];
            let is_first = reference == 0.0;
            let reference = if is_first & is_known { expected + self.floor } else { reference };
            paths.reference[i] = reference;
            let judged = is_known & (reference > 0.0);
            let share = expected / if judged { reference * WHOLE_SHARE } else { 1.0 };
            let q = (if share < 1.0 { share } else { 1.0 }).sqrt();
            let q = if q > LEAST { q } else { LEAST };
            let q = if self.uses_adjoint_roulette { q } else { 1.0 };
            let survives = if judged { (chances[i] < q) & (carried > 0.0) } else { survives };
            let scale = if judged { 1.0 / q } else { scale };
            set_rgb(&mut path.throughput, i, throughput * scale);
            set(&mut v.next_origin, i, offset_along(get(&v.p, i), ng, v.offset[i]));
            set(&mut v.next_direction, i, wi);
            let goes_on = survives & (wi.dot(ng) > 0.0);
            let pdf = local.z * FRAC_1_PI * density * self.how.branches;
            path.pdf[i] = if goes_on { pdf } else { -1.0 };
        }
    }
}
