//! Vectorised sampling of points on lights, for scenes with a single light that has a [`VectorSampler`], and for the vertices of a wave by
//! the kind of their selected lights ([`UniformKind`], and the environment's image).

use super::mis::LightPdf;
use super::wave::{Lanes, Vertices, WAVE, Wave, get, set, set_rgb};
use crate::color::Rgb;
use crate::light::{
    ImageMap, LightDirection, Lights, PACKED_LENGTH, UniformDisk, UniformKind, UniformLight,
    UniformRectangle, UniformShape, UniformTriangle, solid_angle_density,
};
use crate::math::Vec3;
use crate::sampling::sampler::Dimensions;
use crate::simd::{Kernel, Table, dispatch};
use std::marker::PhantomData;

/// Vertices per batch of light samples; results beyond the last vertex are ignored.
pub(super) const BATCH: usize = 16;
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
    rectangle: UniformLight<UniformRectangle>,
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
        self.rectangle.radiance
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
        sample_uniform::<UniformRectangle, _>(VertexIndices(&self.rectangles), lights, wave);
        sample_uniform::<UniformTriangle, _>(VertexIndices(&self.triangles), lights, wave);
        sample_uniform::<UniformDisk, _>(VertexIndices(&self.disks), lights, wave);
        if let Some(map) = lights.sampled_image() {
            dispatch(SampleImage { wave, list: &self.image, sampler: EnvironmentSampler { map } });
        }
        &self.others
    }

    fn lists(&mut self) -> [&mut Vec<u32>; 5] {
        [&mut self.rectangles, &mut self.triangles, &mut self.disks, &mut self.image, &mut self.others]
    }
}

/// The vertices of a loop over light samples.
pub(super) trait VertexSubset: Copy {
    /// Number of vertices, rounded up to whole batches.
    fn count(self) -> usize;

    /// The vertex at a position, up to [`WAVE`].
    fn vertex(self, k: usize) -> usize;
}

/// The first vertices of the wave.
#[derive(Clone, Copy)]
pub(super) struct FirstVertices(pub usize);

impl VertexSubset for FirstVertices {
    #[inline(always)]
    fn count(self) -> usize {
        self.0.min(WAVE).next_multiple_of(BATCH)
    }

    #[inline(always)]
    fn vertex(self, k: usize) -> usize {
        k.min(WAVE)
    }
}

/// Vertices by index, in whole batches.
#[derive(Clone, Copy)]
struct VertexIndices<'a>(&'a [u32]);

impl VertexSubset for VertexIndices<'_> {
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

/// Samples points of the selected lights of vertices, all of which have the shape `S`.
pub(super) fn sample_uniform<S: UniformShape, V: VertexSubset>(subset: V, lights: &Lights, wave: &mut Wave) {
    if subset.count() > 0 {
        let numbers = Table::new(lights.uniform().packed());
        dispatch(SampleUniform::<S, V> { wave, subset, numbers, shape: PhantomData });
    }
}

struct SampleUniform<'a, S, V> {
    wave: &'a mut Wave,
    subset: V,
    numbers: Table<'a, [f32; PACKED_LENGTH]>,
    shape: PhantomData<S>,
}

impl<S: UniformShape, V: VertexSubset> Kernel for SampleUniform<'_, S, V> {
    type Output = ();

    #[inline(always)]
    #[allow(clippy::needless_range_loop)]
    fn run(self) {
        let SampleUniform { wave, subset, numbers: all, .. } = self;
        let Wave { vertices: v, scratch: [u0, u1, ..], .. } = wave;
        for first in (0..subset.count()).step_by(BATCH) {
            let (mut numbers, mut inputs) = ([[0.0; BATCH]; PACKED_LENGTH], [[0.0; BATCH]; 5]);
            for lane in 0..BATCH {
                // With many lights, most are not in cache.
                all.prefetch(v.light.index[subset.vertex(first + lane + PREFETCH_DISTANCE)]);
            }
            for lane in 0..BATCH {
                let i = subset.vertex(first + lane);
                let light = all.at(v.light.index[i]);
                for k in 0..PACKED_LENGTH {
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
                let mut of_lane = [0.0; PACKED_LENGTH];
                for k in 0..PACKED_LENGTH {
                    of_lane[k] = numbers[k][lane];
                }
                let light = UniformLight::<S>::unpack(of_lane);
                let [x, y, z, a, b] = &inputs;
                let direction = light.direction(Vec3::new(x[lane], y[lane], z[lane]), [a[lane], b[lane]]);
                let (wi, target, radiance) = (direction.wi, direction.target, light.radiance);
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
                let (i, of) = (subset.vertex(first + lane), |k: usize| outputs[k][lane]);
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
            let point = paths.state.sobol_point(i);
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
