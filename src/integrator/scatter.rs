//! Paths go on: scattering, Russian roulette, the next rays.

use super::closure::{Closure, GeneralClass, LambertClass, VertexClass};
use super::closure_metal_rough::MetalRoughClass;
use super::group::Sorted;
use super::guiding;
use super::lanes::{WAVE, get, get_rgb, set, set_rgb};
use super::normals::terminator;
use super::phase::MediumClass;
use super::roulette::{FIRST_ROULETTE, How, survival};
use super::wave::Wave;
use super::workspace::Workspace;
use super::{Integrator, Purpose};
use crate::math::{Ray, Vec3, offset_along};
use crate::sampling::sampler::SobolPoint;
use crate::simd::{Kernel, dispatch};
use std::ops::Range;

impl Integrator<'_> {
    /// Scatters each path at its vertex and ends some by roulette.
    pub(super) fn scatter(&self, bounce: u32, sorted: &Sorted, w: &mut Workspace) {
        let dimensions = &self.dimensions(bounce, Purpose::Scatter);
        let branches = self.paths_per_light_sample(bounce);
        let how = How { dimensions, roulette: bounce >= FIRST_ROULETTE, branches };
        if self.softens_terminator() {
            self.scatter_all::<true>(bounce, how, sorted, w);
        } else {
            self.scatter_all::<false>(bounce, how, sorted, w);
        }
        if self.parts.receiver_normals {
            // No light was chosen at specular vertices.
            for i in sorted.lit().end..sorted.all().end {
                set(&mut w.wave.paths.receiver_normal, i, Vec3::ZERO);
            }
        }
    }

    /// Scatters at all classes of vertices; with softened shadow terminators or without.
    fn scatter_all<const SOFT: bool>(&self, bounce: u32, how: How<'_>, sorted: &Sorted, w: &mut Workspace) {
        let Workspace { wave, bsdfs, .. } = w;
        if let Some(guide) = self.options.guide {
            let uses_adjoint_roulette = self.uses_adjoint_roulette(bounce);
            guiding::scatter::<SOFT>(how, uses_adjoint_roulette, guide, sorted.lambert(), wave);
            guiding::scatter_metal_rough::<SOFT>(
                how,
                uses_adjoint_roulette,
                guide,
                sorted.metal_rough(),
                wave,
            );
        } else {
            dispatch(Scatter::<_, SOFT> { wave, class: LambertClass, range: sorted.lambert(), how });
            dispatch(Scatter::<_, SOFT> { wave, class: MetalRoughClass, range: sorted.metal_rough(), how });
        }
        if !sorted.medium().is_empty() {
            dispatch(Scatter::<_, SOFT> { wave, class: MediumClass, range: sorted.medium(), how });
        }
        let range = sorted.general();
        // Its loop has no use for a higher CPU level.
        Scatter::<_, SOFT> { wave, class: GeneralClass { bsdfs, first: range.start }, range, how }.run();
    }

    /// Makes the paths that go on the arriving ones of the next bounce, with their rays.
    pub(super) fn next_rays(&self, sorted: &Sorted, w: &mut Workspace) {
        w.rays.clear();
        let Wave { paths, vertices: v, .. } = &*w.wave;
        for i in sorted.all() {
            let pdf = paths.carried.pdf[i];
            if pdf >= 0.0 {
                let k = w.rays.len();
                paths.copy_to(i, &mut w.arriving, k, self.parts);
                if self.parts.footprints {
                    let is_guided = sorted.guided().contains(&i);
                    let pdf = if is_guided { self.unguided(pdf, &w.wave, i) } else { pdf };
                    widen(&mut w.arriving.footprints.spread[k], pdf);
                }
                let ray = Ray::new(get(&v.next_origin, i), get(&v.next_direction, i));
                w.rays.push(Ray { origin_primitive: v.origin_primitives[i], ..ray });
            }
        }
    }
}

/// A scattered ray stands for a share of the directions that it might have taken: as if this many others filled the
/// rest. After a diffuse bounce it covers a width of a fifth of the distance; after a mirror, what it covered before.
const RAYS_OF_A_LOBE: f32 = 64.0;

#[inline(always)]
fn widen(spread: &mut f32, pdf_solid_angle: f32) {
    if pdf_solid_angle > 0.0 {
        let own = 1.0 / (RAYS_OF_A_LOBE * pdf_solid_angle).sqrt();
        *spread = if own > *spread { own } else { *spread };
    }
}

/// Scatters at the vertices of a class.
pub(super) struct Scatter<'a, C, const SOFT: bool> {
    pub wave: &'a mut Wave,
    pub class: C,
    pub range: Range<usize>,
    pub how: How<'a>,
}

impl<C: VertexClass, const SOFT: bool> Kernel for Scatter<'_, C, SOFT> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v, .. } = self.wave;
        let path = &mut paths.carried;
        for i in self.range.start..self.range.end.min(WAVE) {
            let point = SobolPoint::from_parts(path.seed[i], path.shuffled[i]);
            let [a, b, lobe, roulette] = point.sample_4d(self.how.dimensions);
            let closure = self.class.closure(v, i);
            let s = closure.sample([a, b, lobe]);
            let (wi, ng, ns) = (s.wi, get(&v.ng, i), get(&v.ns, i));
            let height = wi.dot(ng);
            let side = if !C::Closure::OPAQUE && height < 0.0 { -1.0 } else { 1.0 };
            let mut throughput = get_rgb(&path.throughput, i) * s.weight;
            if SOFT {
                let is_smooth = s.is_specular | s.is_transmission | C::Closure::IN_MEDIUM;
                throughput *= if is_smooth { 1.0 } else { terminator(ns * side, ng * side, wi) };
            }
            if !C::Closure::OPAQUE {
                path.eta_squared[i] *= s.eta * s.eta;
                if s.is_transmission {
                    paths.interior[i] = v.beyond[i];
                }
            }
            let (survives, scale) = survival(throughput, path.eta_squared[i], roulette, self.how.roulette);
            set_rgb(&mut path.throughput, i, throughput * scale);
            set(&mut v.next_origin, i, offset_along(get(&v.p, i), ng * side, v.offset[i]));
            set(&mut v.next_direction, i, wi);
            // A direction that shading normals lead to the wrong side of the surface carries nothing.
            let is_right = if C::Closure::IN_MEDIUM {
                true
            } else if C::Closure::OPAQUE {
                height > 0.0
            } else {
                (closure.crosses(wi) == s.is_transmission) & (height != 0.0)
            };
            let goes_on = survives & (s.pdf_solid_angle > 0.0) & is_right;
            let pdf = if s.is_specular { 0.0 } else { s.pdf_solid_angle * self.how.branches };
            path.pdf[i] = if goes_on { pdf } else { -1.0 };
        }
    }
}
