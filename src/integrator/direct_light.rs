//! Direct lighting: light samples at the vertices, MIS weights against BSDF sampling, and shadow rays.
//!
//! Each vertex selects a light, unless a vectorised loop samples the scene's only light; then lights are sampled by kind
//! ([`super::light_samples`]).
//!
//! The shadow AOV ([`Aov::Shadow`]) holds the occluded fraction of the light samples' luminance. MIS weights are divided out, since
//! BSDF sampling complements unoccluded light only, so that weighted sums would not be comparable. The occlusion of constant and
//! gradient skies without light samples is recorded by BSDF-sampled rays.

use super::Integrator;
use super::guiding::Guided;
use super::lifted_rays::{lift_shadow_rays, restore_normals, use_smooth_normals};
use super::light_samples::{
    BATCH, EnvironmentSampler, FirstVertices, RectangleSampler, SampleLight, sample_uniform,
};
use super::light_visibility::{LightSampleRecord, LightVisibility};
use super::mis::LightPdf;
use super::radiance_buffer::RadianceOrigin;
use super::sampling::{Block, Purpose};
use super::shading_geometry::{Sharp, SharpBumps, Soft, SoftBumps, Terminator, TerminatorCorrection};
use super::shading_groups::{
    Closure, GeneralClass, LambertClass, MediumClass, MetalRoughClass, SortedVertices, VertexClass,
};
use super::visibility::receiver_class;
use super::wave::{LightLanes, Vertices, WAVE, Wave, get, get_rgb, set, set_rgb};
use super::workspace::{SampleTimes, Workspace};
use crate::color::Rgb;
use crate::film::Aov;
use crate::light::{EnvironmentLight, LightSample, Lights, Receiver, UniformRectangle};
use crate::math::{Ray, Vec3, offset_along};
use crate::sampling::sampler::Dimensions;
use crate::scene::RayKinds;
use crate::simd::{Kernel, dispatch};
use std::ops::Range;

impl Integrator<'_> {
    /// Samples a light, and a point on it, for each lit vertex.
    pub(super) fn sample_lights(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        let dimensions = &self.dimensions(bounce, Purpose::Light);
        let (wave, count) = (&mut *w.wave, sorted.lit().end);
        if let Some(sampler) = RectangleSampler::of(&self.scene.lights) {
            return dispatch(SampleLight { wave, count, dimensions, sampler });
        }
        if let Some(sampler) = EnvironmentSampler::of(&self.scene.lights) {
            return dispatch(SampleLight { wave, count, dimensions, sampler });
        }
        let (lights, opaque) = (&self.scene.lights, sorted.metal_rough().end);
        let linked = self.scene.features.links;
        let visibility = self.options.light_visibility;
        dispatch(SelectLights { wave, count, opaque, lights, visibility, dimensions, linked });
        if lights.are_rectangles() {
            return sample_uniform::<UniformRectangle, _>(FirstVertices(count), lights, wave);
        }
        let others = w.vertices_by_light.sample(count, lights, wave);
        self.sample_other_lights(others, wave, &w.times);
    }

    /// Samples the selected lights of some vertices one by one.
    fn sample_other_lights(&self, list: &[u32], wave: &mut Wave, times: &SampleTimes) {
        let lights = &self.scene.lights;
        let Wave { vertices: v, paths, scratch: [u0, u1, ..] } = wave;
        for i in list.iter().map(|&i| i as usize) {
            let (index, pdf_discrete) = (v.light.index[i], v.light.pdf_discrete[i]);
            let sample = match pdf_discrete > 0.0 {
                true if lights.are_moving() => {
                    let (p, time) = (get(&v.p, i), times.of(paths.state.radiance_index[i]));
                    lights.sample_at(&self.scene.textures, index, p, [u0[i], u1[i]], time)
                }
                true => lights.sample(&self.scene.textures, index, get(&v.p, i), [u0[i], u1[i]]),
                false => LightSample::NONE,
            };
            store(v, i, &sample, pdf_discrete);
        }
    }
}

/// Stores a light sample.
fn store(v: &mut Vertices, i: usize, sample: &LightSample, pdf_discrete: f32) {
    let light = &mut v.light;
    set(&mut light.wi, i, sample.wi);
    set(&mut light.target, i, sample.target);
    set_rgb(&mut light.radiance, i, sample.radiance);
    light.is_infinite[i] = f32::from(u8::from(sample.is_infinite));
    let pdf = sample.pdf_solid_angle * pdf_discrete;
    light.pdf[i] = if sample.is_delta { LightPdf::delta(pdf) } else { LightPdf::new(pdf) };
}

/// Selects a light for each vertex. Writes two random numbers for the point on the light to the first two scratch arrays.
struct SelectLights<'a> {
    wave: &'a mut Wave,
    count: usize,
    /// Number of vertices with opaque BSDFs, which come first: only there does light selection use the normal.
    opaque: usize,
    lights: &'a Lights,
    visibility: Option<&'a LightVisibility>,
    dimensions: &'a Dimensions,
    /// Is light linking in use?
    linked: bool,
}

impl Kernel for SelectLights<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v, scratch: [u0, u1, choice0, choice1, ..] } = self.wave;
        let count = self.count.min(WAVE);
        for i in 0..count {
            let point = paths.state.sobol_point(i);
            [u0[i], u1[i], choice0[i], choice1[i]] = point.sample_4d(self.dimensions);
        }
        for first in (0..count).step_by(BATCH) {
            // Loops, because `array::from_fn` is not always inlined.
            let mut receivers = [Receiver::new(Vec3::ZERO, Vec3::ZERO); BATCH];
            let mut numbers = [[0.0; 2]; BATCH];
            for lane in 0..BATCH {
                let i = first + lane;
                let normal = if i < self.opaque { get(&v.ns, i) } else { Vec3::ZERO };
                receivers[lane] = LightVisibility::receiver(self.visibility, get(&v.p, i), normal);
                numbers[lane] = [choice0[i], choice1[i]];
            }
            let lanes = BATCH.min(count - first);
            let chosen = match self.linked {
                false => self.lights.select_many(&receivers, &numbers, lanes),
                true => {
                    let class = |lane| receiver_class(first + lane, paths, true);
                    self.lights.select_by_class(class, &receivers, &numbers, lanes)
                }
            };
            for (i, lane) in (first..first + lanes).zip(0..) {
                set(&mut paths.receiver_normal, i, receivers[lane].normal);
                (v.light.index[i], v.light.pdf_discrete[i]) = (chosen[lane].index, chosen[lane].pdf_discrete);
            }
        }
    }
}

impl Integrator<'_> {
    /// A receiver of light, with the learned weights of groups of lights.
    #[inline]
    pub(super) fn light_receiver(&self, p: Vec3, normal: Vec3) -> Receiver<'_> {
        LightVisibility::receiver(self.options.light_visibility, p, normal)
    }

    /// Traces a block of camera paths and returns their light samples; `None` if `stop` interrupted it.
    pub fn trace_light_samples(
        &self,
        block: &Block,
        w: &mut Workspace,
        stop: &dyn Fn() -> bool,
    ) -> Option<Vec<LightSampleRecord>> {
        w.light_sample_records.clear();
        let is_done = self.trace(block, w, stop, |_| {});
        let probes = std::mem::take(&mut w.light_sample_records);
        is_done.then_some(probes)
    }

    /// Records which light samples are occluded.
    fn record_light_samples(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let Workspace { wave, shadow_vertices, occluded, light_sample_records, .. } = w;
        let mut rays = shadow_vertices.iter().zip(&*occluded).peekable();
        for i in sorted.lit() {
            let is_visible =
                rays.next_if(|&(&vertex, _)| vertex as usize == i).is_some_and(|(_, occluded)| !occluded);
            light_sample_records.push(LightSampleRecord {
                p: get(&wave.vertices.p, i).to_array(),
                n: get(&wave.paths.receiver_normal, i).to_array(),
                group: self.scene.lights.group_of(wave.vertices.light.index[i]),
                is_visible,
            });
        }
    }

    /// Samples lights at the vertices and adds the unoccluded contributions.
    pub(super) fn add_direct_light(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        let count = self.light_samples(bounce);
        for number in 0..count {
            Self::set_light_sample_points(&mut w.wave.paths.state, sorted, number, count);
            self.sample_lights(bounce, sorted, w);
            if self.scene.lights.emits_by_hit() {
                self.evaluate_emission_at_hits(sorted, w);
            }
            if self.is_spectral() {
                self.uplift_light_samples(sorted, w);
            }
            if !self.scene.lights.volumes().is_empty() {
                self.evaluate_volume_lights(sorted, w);
            }
            self.exclude_caustic_light_samples(bounce, sorted, w);
            self.direct_light(bounce, sorted, w);
        }
        Self::restore_sobol_points(&mut w.wave.paths.state, sorted, count);
    }

    /// Weights one light sample per vertex, traces the shadow rays, and adds the unoccluded contributions.
    pub(super) fn direct_light(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        let guided = self.options.guide.is_some();
        if self.lifts_shadow_rays() {
            use_smooth_normals(sorted, &mut w.wave.vertices);
        }
        self.guide_light_samples(sorted, w);
        let (branches, inverse_light_samples) =
            (self.bsdf_samples_per_light_sample(bounce), 1.0 / self.light_samples(bounce) as f32);
        let params = DirectParams { branches, inverse_light_samples };
        match self.terminator() {
            Terminator::Sharp => direct(Sharp, params, guided, sorted, w),
            Terminator::Soft => direct(Soft, params, guided, sorted, w),
            Terminator::SoftBumps => direct(SoftBumps, params, guided, sorted, w),
            Terminator::SharpBumps => direct(SharpBumps, params, guided, sorted, w),
        }
        if self.lifts_shadow_rays() {
            lift_shadow_rays(sorted, &mut w.wave.vertices);
        }
        let features = &self.scene.features;
        if (features.absorption || features.scattering) && !features.boundaries {
            self.absorb_light_samples(sorted, &mut w.wave, &w.times);
        }
        self.trace_shadow_rays((bounce, branches), sorted, w);
        if self.lifts_shadow_rays() {
            restore_normals(sorted, &mut w.wave.vertices);
        }
    }

    /// Traces a shadow ray for each contribution and adds the unoccluded ones.
    fn trace_shadow_rays(&self, (bounce, branches): (u32, f32), sorted: &SortedVertices, w: &mut Workspace) {
        w.shadow_rays.clear();
        w.shadow_vertices.clear();
        let (v, light) = (&w.wave.vertices, &w.wave.vertices.light);
        let all_light = !w.excludes_casters && !self.scene.features.links;
        for i in sorted.lit() {
            let [r, g, b] = &light.contribution;
            if (all_light || self.is_linked_to_light(i, w)) && r[i].max(g[i]).max(b[i]) > 0.0 {
                let t_max = self.shadow_ray_end(i, light);
                let ray = Ray::new(get(&light.origin, i), get(&light.direction, i));
                w.shadow_rays.push(Ray { t_max, origin_primitive: v.origin_primitives[i], ..ray });
                w.shadow_vertices.push(i as u32);
            }
        }
        if self.scene.features.boundaries {
            self.start_shadow_segments(sorted, w);
        }
        if self.scene.features.panes {
            self.start_shadow_crossings(sorted, w);
        }
        let shows_shadow = bounce == 0 && self.first_hits.contains(Aov::Shadow) && !w.excludes_casters;
        if shows_shadow {
            self.save_unoccluded(w);
        }
        self.test_shadow_rays(bounce, w);
        if self.scene.features.panes {
            self.refract_light_samples(branches, sorted, w);
        }
        if self.scene.features.boundaries {
            self.end_shadow_segments(w);
        }
        if self.options.records_light_samples {
            self.record_light_samples(sorted, w);
        }
        if shows_shadow {
            self.record_shadows(bounce, sorted, w);
        }
        let Workspace { wave, bsdfs, radiance_buffer, shadow_vertices, occluded, passed_kinds, .. } = w;
        let Wave { paths, vertices: v, .. } = &**wave;
        for (k, (&i, &occluded)) in shadow_vertices.iter().zip(&*occluded).enumerate() {
            if !occluded {
                let i = i as usize;
                let mut value = get_rgb(&v.light.contribution, i);
                if self.optional.visibility {
                    let passed = passed_kinds.get(k).copied().unwrap_or(RayKinds::NONE);
                    value *= self.visible_fraction((bounce, i), passed, sorted, wave, bsdfs);
                }
                radiance_buffer.contribute(paths.state.radiance_index[i], bounce + 1, value, || {
                    let light = self.only_light.unwrap_or(v.light.index[i]);
                    let class = self.class_of_light_sample(bounce, sorted, wave, bsdfs, i);
                    RadianceOrigin { class, group: self.scene.light_groups.of_light(light) }
                });
            }
        }
    }

    /// `t_max` of the shadow ray of vertex `i`: 0 if the sampled light casts no shadows at all, media included.
    #[inline(always)]
    pub(super) fn shadow_ray_end(&self, i: usize, light: &LightLanes) -> f32 {
        let links = &self.scene.links;
        if self.scene.features.links && links.is_unblocked(self.only_light.unwrap_or(light.index[i])) {
            return 0.0;
        }
        if light.is_infinite[i] > 0.0 { f32::INFINITY } else { 1.0 }
    }

    /// Tests which shadow rays are occluded.
    pub(super) fn test_shadow_rays(&self, bounce: u32, w: &mut Workspace) {
        w.occluded.clear();
        w.occluded.resize(w.shadow_rays.len(), false);
        w.passed_kinds.clear();
        if self.optional.visibility {
            w.passed_kinds.resize(w.shadow_rays.len(), RayKinds::NONE);
        }
        if self.scene.features.alpha {
            self.test_shadow_rays_with_alpha(bounce, w);
        } else {
            self.occluded(w);
            w.ray_counts.all += w.shadow_rays.len() as u64;
        }
    }
}

/// Computes the weighted contributions of the light samples in all shading groups.
fn direct<T: TerminatorCorrection>(
    correction: T,
    params: DirectParams,
    guided: bool,
    sorted: &SortedVertices,
    w: &mut Workspace,
) {
    let Workspace { wave, bsdfs, .. } = w;
    if guided {
        dispatch(Direct { correction, wave, class: Guided(LambertClass), range: sorted.lambert(), params });
        let class = Guided(MetalRoughClass);
        dispatch(Direct { correction, wave, class, range: sorted.metal_rough(), params });
    } else {
        dispatch(Direct { correction, wave, class: LambertClass, range: sorted.lambert(), params });
        dispatch(Direct { correction, wave, class: MetalRoughClass, range: sorted.metal_rough(), params });
    }
    if !sorted.medium().is_empty() {
        dispatch(Direct { correction, wave, class: MediumClass, range: sorted.medium(), params });
    }
    let range = sorted.rough();
    // Not vectorised, so a higher CPU level has no benefit.
    Direct { correction, wave, class: GeneralClass { bsdfs, first: range.start }, range, params }.run();
}

/// Computes the weighted contributions of the light samples in a shading group.
pub(super) struct Direct<'a, C, T> {
    pub correction: T,
    pub wave: &'a mut Wave,
    pub class: C,
    pub range: Range<usize>,
    pub params: DirectParams,
}

/// Numbers of BSDF and light samples per vertex.
#[derive(Clone, Copy)]
pub(super) struct DirectParams {
    /// Number of BSDF samples per light sample, for MIS.
    pub branches: f32,
    /// 1 / number of light samples.
    pub inverse_light_samples: f32,
}

impl<C: VertexClass, T: TerminatorCorrection> Kernel for Direct<'_, C, T> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v, .. } = self.wave;
        for i in self.range.start..self.range.end.min(WAVE) {
            let light_pdf = v.light.pdf[i];
            if C::Closure::BRANCHES && light_pdf.is_none() {
                set_rgb(&mut v.light.contribution, i, Rgb::ZERO);
                continue;
            }
            let closure = self.class.closure(v, i);
            let (wi, ng, ns) = (get(&v.light.wi, i), get(&v.ng, i), get(&v.ns, i));
            let eval = closure.eval(wi);
            let cosine = wi.dot(ng);
            let side = if !C::Closure::OPAQUE && cosine < 0.0 { -1.0 } else { 1.0 };
            let pdf = eval.pdf_solid_angle * self.params.branches * self.class.light_pdf_factor(v, i);
            let mut weight = light_pdf.mis_weight_over_pdf(pdf) * self.params.inverse_light_samples;
            let mut eval = eval;
            if T::SOFTENS && !C::Closure::IN_MEDIUM && !closure.crosses(wi) {
                weight *= self.correction.light_factor(v, i, [ns * side, ng * side], side, wi);
                let bump_factor;
                (eval, bump_factor) =
                    closure.apply_bump_terminator(self.correction, (v, i), (ns * side, side), (wi, eval));
                weight *= bump_factor;
            }
            let is_lit = !light_pdf.is_none() & (!C::Closure::OPAQUE | (cosine > 0.0));
            let weight = if is_lit { weight } else { 0.0 };
            let (throughput, radiance) = (get_rgb(&paths.state.throughput, i), get_rgb(&v.light.radiance, i));
            let contribution = closure.scattered(eval, weight, throughput, radiance);
            set_rgb(&mut v.light.contribution, i, contribution);
            let origin = offset_along(get(&v.p, i), ng * side, v.offset[i]);
            set(&mut v.light.origin, i, origin);
            let to_light = get(&v.light.target, i) - origin;
            set(&mut v.light.direction, i, if v.light.is_infinite[i] > 0.0 { wi } else { to_light });
        }
    }
}

impl Integrator<'_> {
    /// Saves the contributions before the visibility test, for the shadow AOV.
    pub(super) fn save_unoccluded(&self, w: &mut Workspace) {
        let light = &w.wave.vertices.light;
        w.unoccluded.clear();
        w.unoccluded.extend(w.shadow_vertices.iter().map(|&i| get_rgb(&light.contribution, i as usize)));
    }

    /// Adds the occluded and the unoccluded luminance of the light samples to the shadow AOV.
    pub(super) fn record_shadows(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        let Workspace {
            wave, bsdfs, shadow_vertices, occluded, unoccluded, passed_kinds, first_hits, ..
        } = w;
        for (k, (&i, &unoccluded)) in shadow_vertices.iter().zip(&*unoccluded).enumerate() {
            let i = i as usize;
            let (mut all, mut arrived) = (unoccluded, get_rgb(&wave.vertices.light.contribution, i));
            if self.optional.visibility {
                let fraction = |passed| self.visible_fraction((bounce, i), passed, sorted, wave, bsdfs);
                let passed = passed_kinds.get(k).copied().unwrap_or(RayKinds::NONE);
                (all, arrived) = (all * fraction(RayKinds::NONE), arrived * fraction(passed));
            }
            let weight = self.light_sample_mis_weight(bounce, sorted, wave, bsdfs, i).max(f32::MIN_POSITIVE);
            let arrived = if occluded[k] { 0.0 } else { arrived.luminance() / weight };
            let blocked = (all.luminance() / weight - arrived).max(0.0);
            let sample = wave.paths.state.radiance_index[i] as usize;
            first_hits.add(sample, Aov::Shadow, [blocked, arrived]);
        }
    }

    /// Is the shadow AOV requested, with a constant or gradient sky that is not light-sampled?
    pub(super) fn records_sky_shadows(&self) -> bool {
        let is_bsdf_sampled = |sky: &EnvironmentLight| sky.is_constant_or_linear() && !sky.is_sampled();
        self.first_hits.contains(Aov::Shadow) && self.scene.lights.environment().is_some_and(is_bsdf_sampled)
    }

    /// Adds the luminance of such a sky along the rays scattered at first hits to the shadow AOV.
    pub(super) fn record_sky_shadows(&self, bounce: u32, w: &mut Workspace) {
        let Some(environment) = self.scene.lights.environment() else { return };
        if bounce != 1 || w.excludes_casters {
            return;
        }
        let path = &w.arriving.state;
        for (i, ray) in w.rays.iter().enumerate().filter(|(i, _)| path.pdf[*i].competes()) {
            let light = (get_rgb(&path.throughput, i) * environment.radiance(ray.direction)).luminance();
            let shadow = if w.hits[i].is_hit() { [light, 0.0] } else { [0.0, light] };
            w.first_hits.add(path.radiance_index[i] as usize, Aov::Shadow, shadow);
        }
    }
}
