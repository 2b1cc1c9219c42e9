//! Light sampling: selects a light for each vertex, and a point on it.
//!
//! In scenes with a single light that has a [`VectorSampler`], a vectorised loop samples all vertices. Else each vertex selects a light
//! first; then the vertices are grouped by the kind of their lights, and vectorised loops sample the kinds that have one
//! ([`UniformKind`], and the environment's image).

use super::Integrator;
use super::light_visibility::LightVisibility;
use super::mis::LightPdf;
use super::sampling::Purpose;
use super::shading_groups::SortedVertices;
use super::visibility::class;
use super::wave::{Lanes, Vertices, WAVE, Wave, get, set, set_rgb};
use super::workspace::{SampleTimes, Workspace};
use crate::color::Rgb;
use crate::light::{
    ImageMap, LightDirection, LightSample, Lights, Receiver, UNIFORM_NUMBERS, UniformDisk, UniformKind,
    UniformLight, UniformRectangle, UniformTriangle, solid_angle_density,
};
use crate::math::Vec3;
use crate::sampling::sampler::{Dimensions, SobolPoint};
use crate::simd::{Kernel, Table, dispatch};
use std::marker::PhantomData;

/// Vertices per batch of light samples; results beyond the last vertex are ignored.
const BATCH: usize = 16;
/// Prefetch distance for rectangle lights, vertices.
const PREFETCH_DISTANCE: usize = 2 * BATCH;

const _: () = assert!(WAVE.is_multiple_of(BATCH));

/// A light with a vectorised sampler. The steps are separate loops, since a single loop would not vectorise.
pub(super) trait VectorSampler {
    /// Is the light infinitely far away?
    const IS_INFINITE: bool;

    /// Maps the first `count` pairs of uniform random numbers to (u, v) on the light, with the pdf over (u, v).
    fn choose(&self, u: &mut Lanes, v: &mut Lanes, pdf: &mut Lanes, count: usize);

    /// Emitted radiance at (u, v).
    fn radiance(&self, uv: [f32; 2]) -> Rgb;

    /// The direction from `p` to (u, v), with its solid-angle pdf; `pdf` is that over (u, v).
    fn direction(&self, p: Vec3, uv: [f32; 2], pdf: f32) -> LightDirection;
}

/// A rectangle of constant radiance, sampled by solid angle.
pub(super) struct RectangleSampler {
    rectangle: UniformRectangle,
}

impl RectangleSampler {
    /// The sampler of a scene whose only light is such a rectangle.
    pub fn of(lights: &Lights) -> Option<Self> {
        lights.single_rectangle().map(|rectangle| RectangleSampler { rectangle })
    }
}

impl VectorSampler for RectangleSampler {
    const IS_INFINITE: bool = false;

    #[inline(always)]
    fn choose(&self, _u: &mut Lanes, _v: &mut Lanes, _pdf: &mut Lanes, _count: usize) {}

    #[inline(always)]
    fn radiance(&self, _uv: [f32; 2]) -> Rgb {
        self.rectangle.radiance()
    }

    #[inline(always)]
    fn direction(&self, p: Vec3, uv: [f32; 2], _pdf: f32) -> LightDirection {
        self.rectangle.direction(p, uv)
    }
}

/// An image environment.
pub(super) struct EnvironmentSampler<'a> {
    map: &'a ImageMap,
}

impl<'a> EnvironmentSampler<'a> {
    /// The sampler of a scene whose only light is an image environment.
    pub fn of(lights: &'a Lights) -> Option<Self> {
        lights.single_environment_image().map(|map| EnvironmentSampler { map })
    }
}

impl VectorSampler for EnvironmentSampler<'_> {
    const IS_INFINITE: bool = true;

    #[inline(always)]
    fn choose(&self, u: &mut Lanes, v: &mut Lanes, pdf: &mut Lanes, count: usize) {
        for first in (0..count).step_by(BATCH) {
            let at = first..first + BATCH;
            let mut uniform = [[0.0; BATCH]; 2];
            uniform[0].copy_from_slice(&u[at.clone()]);
            uniform[1].copy_from_slice(&v[at.clone()]);
            let chosen = self.map.sample_many_uv(uniform);
            u[at.clone()].copy_from_slice(&chosen.u);
            v[at.clone()].copy_from_slice(&chosen.v);
            pdf[at].copy_from_slice(&chosen.pdf_area);
        }
    }

    #[inline(always)]
    fn radiance(&self, uv: [f32; 2]) -> Rgb {
        self.map.lookup(uv)
    }

    #[inline(always)]
    fn direction(&self, _p: Vec3, uv: [f32; 2], pdf: f32) -> LightDirection {
        let wi = self.map.direction(uv);
        LightDirection { wi, target: Vec3::ZERO, pdf_solid_angle: pdf * solid_angle_density(wi) }
    }
}

/// The vertices of a wave by the kind of their selected light.
#[derive(Default)]
pub struct VerticesByLight {
    rectangles: Vec<u32>,
    triangles: Vec<u32>,
    disks: Vec<u32>,
    image: Vec<u32>,
    others: Vec<u32>,
}

impl VerticesByLight {
    /// Groups the first `count` vertices.
    fn group(&mut self, count: usize, lights: &Lights, v: &Vertices) {
        let image = lights.sampled_image().map(|_| lights.len() as u32 - 1);
        for list in self.lists() {
            list.clear();
        }
        for i in 0..count as u32 {
            let light = v.light.index[i as usize];
            let list = match lights.uniform().kind(light) {
                Some(UniformKind::Rectangle) => &mut self.rectangles,
                Some(UniformKind::Triangle) => &mut self.triangles,
                Some(UniformKind::FacingDisk) => &mut self.disks,
                None if Some(light) == image => &mut self.image,
                None => &mut self.others,
            };
            list.push(i);
        }
        for list in [&mut self.rectangles, &mut self.triangles, &mut self.disks, &mut self.image] {
            // Whole batches; results beyond the vertices are ignored.
            list.resize(list.len().next_multiple_of(BATCH), WAVE as u32);
        }
    }

    /// Samples the selected lights that have vectorised loops, at the first `count` vertices, by the random numbers in the first two scratch
    /// arrays. Returns the other vertices.
    pub fn sample(&mut self, count: usize, lights: &Lights, wave: &mut Wave) -> &[u32] {
        self.group(count, lights, &wave.vertices);
        sample_uniform::<UniformRectangle, _>(Listed(&self.rectangles), lights, wave);
        sample_uniform::<UniformTriangle, _>(Listed(&self.triangles), lights, wave);
        sample_uniform::<UniformDisk, _>(Listed(&self.disks), lights, wave);
        if let Some(map) = lights.sampled_image() {
            dispatch(SampleImage { wave, list: &self.image, sampler: EnvironmentSampler { map } });
        }
        &self.others
    }

    fn lists(&mut self) -> [&mut Vec<u32>; 5] {
        [&mut self.rectangles, &mut self.triangles, &mut self.disks, &mut self.image, &mut self.others]
    }
}

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
            return sample_uniform::<UniformRectangle, _>(InOrder(count), lights, wave);
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
            let point = SobolPoint::from_parts(paths.state.seed[i], paths.state.shuffled[i]);
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
                    let class = |lane| class(first + lane, paths, true);
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

/// Which vertices a loop over light samples visits.
trait Visited: Copy {
    /// Number of vertices, rounded up to whole batches.
    fn count(self) -> usize;

    /// The vertex at a position, up to [`WAVE`].
    fn vertex(self, k: usize) -> usize;
}

/// The first vertices of the wave.
#[derive(Clone, Copy)]
struct InOrder(usize);

impl Visited for InOrder {
    #[inline(always)]
    fn count(self) -> usize {
        self.0.min(WAVE).next_multiple_of(BATCH)
    }

    #[inline(always)]
    fn vertex(self, k: usize) -> usize {
        k.min(WAVE)
    }
}

/// Listed vertices, in whole batches.
#[derive(Clone, Copy)]
struct Listed<'a>(&'a [u32]);

impl Visited for Listed<'_> {
    #[inline(always)]
    fn count(self) -> usize {
        self.0.len()
    }

    #[inline(always)]
    fn vertex(self, k: usize) -> usize {
        let vertex = self.0[k.min(self.0.len() - 1)] as usize;
        vertex.min(WAVE)
    }
}

/// Samples points of the selected lights of vertices, all of which are lights `L`.
fn sample_uniform<L: UniformLight, V: Visited>(visited: V, lights: &Lights, wave: &mut Wave) {
    if visited.count() > 0 {
        let numbers = Table::new(lights.uniform().numbers());
        dispatch(SampleUniform::<L, V> { wave, visited, numbers, light: PhantomData });
    }
}

struct SampleUniform<'a, L, V> {
    wave: &'a mut Wave,
    visited: V,
    numbers: Table<'a, [f32; UNIFORM_NUMBERS]>,
    light: PhantomData<L>,
}

impl<L: UniformLight, V: Visited> Kernel for SampleUniform<'_, L, V> {
    type Output = ();

    #[inline(always)]
    #[allow(clippy::needless_range_loop)]
    fn run(self) {
        let SampleUniform { wave, visited, numbers: all, .. } = self;
        let Wave { vertices: v, scratch: [u0, u1, ..], .. } = wave;
        for first in (0..visited.count()).step_by(BATCH) {
            let (mut numbers, mut inputs) = ([[0.0; BATCH]; UNIFORM_NUMBERS], [[0.0; BATCH]; 5]);
            for lane in 0..BATCH {
                // With many lights, most are not in cache.
                all.prefetch(v.light.index[visited.vertex(first + lane + PREFETCH_DISTANCE)]);
            }
            for lane in 0..BATCH {
                let i = visited.vertex(first + lane);
                let light = all.at(v.light.index[i]);
                for k in 0..UNIFORM_NUMBERS {
                    numbers[k][lane] = light[k];
                }
                let p = get(&v.p, i);
                let of_lane = [p.x, p.y, p.z, u0[i], u1[i]];
                for k in 0..5 {
                    inputs[k][lane] = of_lane[k];
                }
            }
            let mut outputs = [[0.0; BATCH]; 10];
            for lane in 0..BATCH {
                let mut of_lane = [0.0; UNIFORM_NUMBERS];
                for k in 0..UNIFORM_NUMBERS {
                    of_lane[k] = numbers[k][lane];
                }
                let light = L::unpack(of_lane);
                let [x, y, z, a, b] = &inputs;
                let direction = light.direction(Vec3::new(x[lane], y[lane], z[lane]), [a[lane], b[lane]]);
                let (wi, target, radiance) = (direction.wi, direction.target, light.radiance());
                let results = [
                    wi.x,
                    wi.y,
                    wi.z,
                    target.x,
                    target.y,
                    target.z,
                    radiance.r,
                    radiance.g,
                    radiance.b,
                    direction.pdf_solid_angle,
                ];
                for k in 0..10 {
                    outputs[k][lane] = results[k];
                }
            }
            for lane in 0..BATCH {
                let (i, of) = (visited.vertex(first + lane), |k: usize| outputs[k][lane]);
                let light = &mut v.light;
                set(&mut light.wi, i, Vec3::new(of(0), of(1), of(2)));
                set(&mut light.target, i, Vec3::new(of(3), of(4), of(5)));
                set_rgb(&mut light.radiance, i, Rgb::new(of(6), of(7), of(8)));
                let pdf_discrete = light.pdf_discrete[i];
                let pdf = of(9) * pdf_discrete;
                light.pdf[i] = LightPdf::new(if pdf_discrete > 0.0 { pdf } else { 0.0 });
                light.is_infinite[i] = 0.0;
            }
        }
    }
}

/// Samples the environment's image for vertices that selected it. Fifth to seventh scratch arrays: position in the image and its pdf.
struct SampleImage<'a> {
    wave: &'a mut Wave,
    list: &'a [u32],
    sampler: EnvironmentSampler<'a>,
}

impl Kernel for SampleImage<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let SampleImage { wave, list, sampler } = self;
        let Wave { vertices, scratch: [u0, u1, _, _, u, v, pdf, ..], .. } = wave;
        let light = &mut vertices.light;
        for (k, &i) in list.iter().enumerate() {
            (u[k], v[k]) = (u0[i as usize], u1[i as usize]);
        }
        sampler.choose(u, v, pdf, list.len());
        for (k, &i) in list.iter().enumerate() {
            set_rgb(&mut light.radiance, i as usize, sampler.radiance([u[k], v[k]]));
        }
        for (k, &i) in list.iter().enumerate() {
            let i = i as usize;
            let direction = sampler.direction(Vec3::ZERO, [u[k], v[k]], pdf[k]);
            set(&mut light.wi, i, direction.wi);
            light.pdf[i] = LightPdf::new(direction.pdf_solid_angle * light.pdf_discrete[i]);
            light.is_infinite[i] = 1.0;
        }
    }
}

/// Samples the light of a scene with a single light.
pub(super) struct SampleLight<'a, S> {
    pub wave: &'a mut Wave,
    pub count: usize,
    pub dimensions: &'a Dimensions,
    pub sampler: S,
}

impl<S: VectorSampler> Kernel for SampleLight<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices, scratch: [u, v, pdf, ..] } = self.wave;
        let (light, count, sampler) = (&mut vertices.light, self.count.min(WAVE), self.sampler);
        for i in 0..count {
            let point = SobolPoint::from_parts(paths.state.seed[i], paths.state.shuffled[i]);
            [u[i], v[i], ..] = point.sample_4d(self.dimensions);
        }
        sampler.choose(u, v, pdf, count);
        for i in 0..count {
            set_rgb(&mut light.radiance, i, sampler.radiance([u[i], v[i]]));
        }
        for i in 0..count {
            let direction = sampler.direction(get(&vertices.p, i), [u[i], v[i]], pdf[i]);
            set(&mut light.wi, i, direction.wi);
            if !S::IS_INFINITE {
                set(&mut light.target, i, direction.target);
            }
            light.pdf[i] = LightPdf::new(direction.pdf_solid_angle);
            light.is_infinite[i] = if S::IS_INFINITE { 1.0 } else { 0.0 };
        }
    }
}
