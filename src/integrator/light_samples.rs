//! Light samples: a point of a light for each vertex that light can reach.
//!
//! Where a scene has one light of a kind with a [`VectorSampler`], one loop, generic over it, samples all vertices; else
//! each vertex chooses among the lights.

use super::group::Sorted;
use super::lanes::{WAVE, get, set, set_rgb};
use super::light_samplers::{EnvironmentSampler, RectangleSampler, VectorSampler};
use super::linking::class;
use super::wave::{Vertices, Wave};
use super::workspace::Workspace;
use super::{Integrator, Purpose};
use crate::light::{EvenRectangle, LightSample, Lights, RECTANGLE_NUMBERS, Receiver};
use crate::math::Vec3;
use crate::sampling::sampler::{Dimensions, SobolPoint};
use crate::simd::{Kernel, Table, dispatch};

impl Integrator<'_> {
    /// Chooses a point of a light for each vertex that light can reach.
    pub(super) fn sample_lights(&self, bounce: u32, sorted: &Sorted, w: &mut Workspace) {
        let dimensions = &self.dimensions(bounce, Purpose::Light);
        let (wave, times, count) = (&mut *w.wave, &w.times, sorted.lit().end);
        if let Some(sampler) = RectangleSampler::of(&self.scene.lights) {
            return dispatch(SampleLight { wave, count, dimensions, sampler });
        }
        if let Some(sampler) = EnvironmentSampler::of(&self.scene.lights) {
            return dispatch(SampleLight { wave, count, dimensions, sampler });
        }
        let (lights, opaque) = (&self.scene.lights, sorted.metal_rough().end);
        let linked = self.scene.features.links;
        dispatch(SelectLights { wave, count, opaque, lights, dimensions, linked });
        if let Some(rectangles) = lights.rectangles() {
            return dispatch(SampleRectangles { wave, count, rectangles: Table::new(rectangles) });
        }
        let Wave { vertices: v, paths, scratch: [u0, u1, ..] } = wave;
        for i in 0..count {
            let (index, pdf_discrete) = (v.light.index[i], v.light.pdf_discrete[i]);
            let sample = match pdf_discrete > 0.0 {
                true if lights.are_moving() => {
                    let (p, time) = (get(&v.p, i), times.of(paths.carried.sample[i]));
                    lights.sample_at(&self.scene.textures, index, p, [u0[i], u1[i]], time)
                }
                true => lights.sample(&self.scene.textures, index, get(&v.p, i), [u0[i], u1[i]]),
                false => LightSample::NONE,
            };
            store(v, i, &sample, pdf_discrete);
        }
    }
}

/// Keeps a light sample. Lights without size have a negative density.
fn store(v: &mut Vertices, i: usize, sample: &LightSample, pdf_discrete: f32) {
    let light = &mut v.light;
    set(&mut light.wi, i, sample.wi);
    set(&mut light.target, i, sample.target);
    set_rgb(&mut light.radiance, i, sample.radiance);
    light.is_infinite[i] = f32::from(u8::from(sample.is_infinite));
    let pdf = sample.pdf_solid_angle * pdf_discrete;
    light.pdf[i] = if sample.is_delta { -pdf } else { pdf };
}

/// Chooses a light for each vertex. Two random numbers for a point on it go to the first lanes of the scratch memory.
struct SelectLights<'a> {
    wave: &'a mut Wave,
    count: usize,
    /// So many opaque vertices come first: light from behind does nothing there.
    opaque: usize,
    lights: &'a Lights,
    dimensions: &'a Dimensions,
    /// Lights are linked to some objects only.
    linked: bool,
}

impl Kernel for SelectLights<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v, scratch: [u0, u1, choice0, choice1, ..] } = self.wave;
        let count = self.count.min(WAVE);
        for i in 0..count {
            let point = SobolPoint::from_parts(paths.carried.seed[i], paths.carried.shuffled[i]);
            [u0[i], u1[i], choice0[i], choice1[i]] = point.sample_4d(self.dimensions);
        }
        for first in (0..count).step_by(TOGETHER) {
            // Loops, since `array::from_fn` is not always inlined, and slow then.
            let mut receivers = [Receiver { p: Vec3::ZERO, normal: Vec3::ZERO }; TOGETHER];
            let mut numbers = [[0.0; 2]; TOGETHER];
            for lane in 0..TOGETHER {
                let i = first + lane;
                let normal = if i < self.opaque { get(&v.ns, i) } else { Vec3::ZERO };
                receivers[lane] = Receiver { p: get(&v.p, i), normal };
                numbers[lane] = [choice0[i], choice1[i]];
            }
            let lanes = TOGETHER.min(count - first);
            let chosen = match self.linked {
                false => self.lights.select_together(&receivers, &numbers, lanes),
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

/// Vertices for which lights are chosen and fetched together; what is beyond the last vertex counts for nothing.
const TOGETHER: usize = 16;
/// So many vertices ahead rectangles are asked for.
const AHEAD: usize = 2 * TOGETHER;

const _: () = assert!(WAVE.is_multiple_of(TOGETHER));

/// Points of the lights that were selected, which are all rectangles.
pub(super) struct SampleRectangles<'a> {
    pub wave: &'a mut Wave,
    pub count: usize,
    pub rectangles: Table<'a, [f32; RECTANGLE_NUMBERS]>,
}

impl Kernel for SampleRectangles<'_> {
    type Output = ();

    #[inline(always)]
    #[allow(clippy::needless_range_loop)]
    fn run(self) {
        let Wave { vertices: v, scratch: [u0, u1, ..], .. } = self.wave;
        let light = &mut v.light;
        for first in (0..self.count.min(WAVE)).step_by(TOGETHER) {
            let mut numbers = [[0.0; TOGETHER]; RECTANGLE_NUMBERS];
            for lane in 0..TOGETHER {
                // Of many lamps, most are not in the caches.
                self.rectangles.prefetch(light.index[(first + lane + AHEAD).min(WAVE)]);
            }
            for lane in 0..TOGETHER {
                let rectangle = self.rectangles.at(light.index[first + lane]);
                for k in 0..RECTANGLE_NUMBERS {
                    numbers[k][lane] = rectangle[k];
                }
            }
            for lane in 0..TOGETHER {
                let i = first + lane;
                let mut of_lane = [0.0; RECTANGLE_NUMBERS];
                for k in 0..RECTANGLE_NUMBERS {
                    of_lane[k] = numbers[k][lane];
                }
                let rectangle = EvenRectangle::unpack(of_lane);
                let direction = rectangle.direction(get(&v.p, i), [u0[i], u1[i]]);
                let pdf_discrete = light.pdf_discrete[i];
                let pdf = direction.pdf_solid_angle * pdf_discrete;
                set_rgb(&mut light.radiance, i, rectangle.radiance);
                set(&mut light.wi, i, direction.wi);
                set(&mut light.target, i, direction.target);
                light.pdf[i] = if pdf_discrete > 0.0 { pdf } else { 0.0 };
                light.is_infinite[i] = 0.0;
            }
        }
    }
}

/// Light samples of a scene with one light.
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
            let point = SobolPoint::from_parts(paths.carried.seed[i], paths.carried.shuffled[i]);
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
            light.pdf[i] = direction.pdf_solid_angle;
            light.is_infinite[i] = if S::IS_INFINITE { 1.0 } else { 0.0 };
        }
    }
}
