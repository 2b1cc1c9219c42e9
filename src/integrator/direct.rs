//! Direct light: what the light samples bring to the vertices, weighted against scattering, and their shadow rays.

use super::Integrator;
use super::closure::{Closure, GeneralClass, LambertClass, VertexClass};
use super::closure_metal_rough::MetalRoughClass;
use super::group::Sorted;
use super::guiding::Guided;
use super::lanes::{WAVE, get, get_rgb, set, set_rgb};
use super::layers::Origin;
use super::normals::terminator;
use super::phase::MediumClass;
use super::wave::Wave;
use super::workspace::Workspace;
use crate::color::Rgb;
use crate::film::Aov;
use crate::math::{Ray, offset_along};
use crate::sampling::power_heuristic;
use crate::scene::RayKinds;
use crate::simd::{Kernel, dispatch};
use std::ops::Range;

impl Integrator<'_> {
    /// Adds the light that reaches the vertices from their light samples.
    pub(super) fn direct_light(&self, bounce: u32, sorted: &Sorted, w: &mut Workspace) {
        let guided = self.options.guide.is_some();
        self.weigh_light_samples(sorted, w);
        let (branches, share) =
            (self.paths_per_light_sample(bounce), 1.0 / self.light_samples(bounce) as f32);
        let counts = Counts { branches, share };
        if self.softens_terminator() {
            direct::<true>(counts, guided, sorted, w);
        } else {
            direct::<false>(counts, guided, sorted, w);
        }
        let features = &self.scene.features;
        if (features.absorption || features.scattering) && !features.boundaries {
            self.absorb_light(sorted, &mut w.wave, &w.times);
        }
        self.trace_shadow_rays(bounce, sorted, w);
    }

    /// Traces a shadow ray for each contribution and adds those that arrive.
    fn trace_shadow_rays(&self, bounce: u32, sorted: &Sorted, w: &mut Workspace) {
        w.shadow_rays.clear();
        w.shadow_vertices.clear();
        let (v, light) = (&w.wave.vertices, &w.wave.vertices.light);
        let all_light = !w.without && !self.scene.features.links;
        for i in sorted.lit() {
            let [r, g, b] = &light.contribution;
            if (all_light || self.is_lit_by(i, w)) && r[i].max(g[i]).max(b[i]) > 0.0 {
                let t_max = if light.is_infinite[i] > 0.0 { f32::INFINITY } else { 1.0 };
                let ray = Ray::new(get(&light.origin, i), get(&light.direction, i));
                w.shadow_rays.push(Ray { t_max, origin_primitive: v.origin_primitives[i], ..ray });
                w.shadow_vertices.push(i as u32);
            }
        }
        if self.scene.features.boundaries {
            self.start_shadow_ways(sorted, w);
        }
        let shows_shadow = bounce == 0 && self.first_hits.contains(Aov::Shadow) && !w.without;
        if shows_shadow {
            self.keep_unblocked(w);
        }
        self.test_shadow_rays(bounce, w);
        if self.scene.features.boundaries {
            self.end_shadow_ways(w);
        }
        if shows_shadow {
            self.note_shadows(bounce, sorted, w);
        }
        let Workspace { wave, bsdfs, sink, shadow_vertices, occluded, passed_kinds, .. } = w;
        let (Wave { paths, vertices: v, .. }, divides) = (&**wave, sink.divides());
        for (k, (&i, &occluded)) in shadow_vertices.iter().zip(&*occluded).enumerate() {
            if !occluded {
                let i = i as usize;
                let mut value = get_rgb(&v.light.contribution, i);
                if self.parts.kinds {
                    let passed = passed_kinds.get(k).copied().unwrap_or(RayKinds::NONE);
                    value *= self.visible_share((bounce, i), passed, sorted, wave, bsdfs);
                }
                sink.add(paths.carried.sample[i], value);
                if divides {
                    sink.divide(paths.carried.sample[i], value, || {
                        let light = self.only_light.unwrap_or(v.light.index[i]);
                        let way = self.way_of_sample(bounce, sorted, wave, bsdfs, i);
                        Origin { way, group: self.scene.light_groups.of_light(light) }
                    });
                }
            }
        }
    }

    /// Finds which of the shadow rays are occluded.
    pub(super) fn test_shadow_rays(&self, bounce: u32, w: &mut Workspace) {
        w.occluded.clear();
        w.occluded.resize(w.shadow_rays.len(), false);
        w.passed_kinds.clear();
        if self.parts.kinds {
            w.passed_kinds.resize(w.shadow_rays.len(), RayKinds::NONE);
        }
        if self.scene.features.alpha {
            self.occluded_by_present_surfaces(bounce, w);
        } else {
            self.occluded(w);
            w.ray_counts.all += w.shadow_rays.len() as u64;
        }
    }
}

/// What the light samples bring to all classes of vertices; with softened shadow terminators or without.
fn direct<const SOFT: bool>(counts: Counts, guided: bool, sorted: &Sorted, w: &mut Workspace) {
    let Workspace { wave, bsdfs, .. } = w;
    if guided {
        dispatch(Direct::<_, SOFT> { wave, class: Guided(LambertClass), range: sorted.lambert(), counts });
        let class = Guided(MetalRoughClass);
        dispatch(Direct::<_, SOFT> { wave, class, range: sorted.metal_rough(), counts });
    } else {
        dispatch(Direct::<_, SOFT> { wave, class: LambertClass, range: sorted.lambert(), counts });
        dispatch(Direct::<_, SOFT> { wave, class: MetalRoughClass, range: sorted.metal_rough(), counts });
    }
    if !sorted.medium().is_empty() {
        dispatch(Direct::<_, SOFT> { wave, class: MediumClass, range: sorted.medium(), counts });
    }
    let range = sorted.rough();
    // Its loop has no use for a higher CPU level.
    Direct::<_, SOFT> { wave, class: GeneralClass { bsdfs, first: range.start }, range, counts }.run();
}

/// What the light samples bring to the vertices of a class.
pub(super) struct Direct<'a, C, const SOFT: bool> {
    pub wave: &'a mut Wave,
    pub class: C,
    pub range: Range<usize>,
    pub counts: Counts,
}

/// How many paths and light samples each vertex has.
#[derive(Clone, Copy)]
pub(super) struct Counts {
    /// Paths that the density of scattering counts for.
    pub branches: f32,
    /// The share of each light sample.
    pub share: f32,
}

impl<C: VertexClass, const SOFT: bool> Kernel for Direct<'_, C, SOFT> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v, .. } = self.wave;
        for i in self.range.start..self.range.end.min(WAVE) {
            let light_pdf = v.light.pdf[i];
            if C::Closure::BRANCHES && light_pdf == 0.0 {
                set_rgb(&mut v.light.contribution, i, Rgb::ZERO);
                continue;
            }
            let closure = self.class.closure(v, i);
            let (wi, ng, ns) = (get(&v.light.wi, i), get(&v.ng, i), get(&v.ns, i));
            let eval = closure.eval(wi);
            let height = wi.dot(ng);
            let side = if !C::Closure::OPAQUE && height < 0.0 { -1.0 } else { 1.0 };
            let pdf = eval.pdf_solid_angle * self.counts.branches * self.class.light_density(v, i);
            let mut weight = light_weight(light_pdf, pdf) * self.counts.share;
            if SOFT && !C::Closure::IN_MEDIUM && !closure.crosses(wi) {
                weight *= terminator(ns * side, ng * side, wi);
            }
            let is_lit = (light_pdf != 0.0) & (!C::Closure::OPAQUE | (height > 0.0));
            let weight = if is_lit { weight } else { 0.0 };
            let (throughput, radiance) =
                (get_rgb(&paths.carried.throughput, i), get_rgb(&v.light.radiance, i));
            let contribution = closure.scattered(eval, weight, throughput, radiance);
            set_rgb(&mut v.light.contribution, i, contribution);
            let origin = offset_along(get(&v.p, i), ng * side, v.offset[i]);
            set(&mut v.light.origin, i, origin);
            let to_light = get(&v.light.target, i) - origin;
            set(&mut v.light.direction, i, if v.light.is_infinite[i] > 0.0 { wi } else { to_light });
        }
    }
}

/// Weight over density of a light sample; lights without size (negative density) have no competitor.
#[inline(always)]
fn light_weight(light_pdf: f32, bsdf_pdf: f32) -> f32 {
    let is_delta = light_pdf < 0.0;
    let pdf = light_pdf.abs();
    let weight = power_heuristic(pdf, if is_delta { 0.0 } else { bsdf_pdf });
    weight / if pdf > 0.0 { pdf } else { 1.0 }
}
