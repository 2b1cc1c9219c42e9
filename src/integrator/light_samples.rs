//! Light samples: a point of a light for each vertex that light can reach.
//!
//! Where a scene has one light of a kind with a [`VectorSampler`], one loop, generic over it, samples all vertices; else
//! each vertex chooses among the lights.

use super::group::Sorted;
use super::lanes::{Lanes, WAVE, get, set, set_rgb};
use super::wave::{Vertices, Wave, Workspace};
use super::{Integrator, Purpose};
use crate::color::Rgb;
use crate::light::{
    AreaLight, AreaShape, Edges, EnvironmentLight, ImageMap, LightSample, Lights, Radiance, Receiver,
    solid_angle_density,
};
use crate::math::{Vec3, offset_ray_origin};
use crate::sampling::SphericalRectangle;
use crate::sampling::sampler::{Dimensions, SobolPoint};
use crate::simd::{Kernel, dispatch};

impl Integrator<'_> {
    /// Chooses a point of a light for each vertex that light can reach.
    pub(super) fn sample_lights(&self, bounce: u32, sorted: &Sorted, w: &mut Workspace) {
        let dimensions = &self.dimensions(bounce, Purpose::Light);
        let (wave, count) = (&mut *w.wave, sorted.lit().end);
        if let Some(sampler) = RectangleSampler::of(&self.scene.lights) {
            return dispatch(SampleLight { wave, count, dimensions, sampler });
        }
        if let Some(sampler) = EnvironmentSampler::of(&self.scene.lights) {
            return dispatch(SampleLight { wave, count, dimensions, sampler });
        }
        let (lights, opaque) = (&self.scene.lights, sorted.metal_rough().end);
        dispatch(SelectLights { wave, count, opaque, lights, dimensions });
        let Wave { vertices: v, scratch: [u0, u1, ..], .. } = wave;
        for i in 0..count {
            let (index, pdf_discrete) = (v.light.index[i], v.light.pdf_discrete[i]);
            let sample = match pdf_discrete > 0.0 {
                true => lights.sample(&self.scene.textures, index, get(&v.p, i), [u0[i], u1[i]]),
                false => LightSample::NONE,
            };
            store(v, i, &sample, pdf_discrete);
        }
    }
}

/// Has the scene a single light that is sampled without a choice?
pub(super) fn has_vector_sampler(lights: &Lights) -> bool {
    RectangleSampler::of(lights).is_some() || EnvironmentSampler::of(lights).is_some()
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
        for i in 0..count {
            let normal = if i < self.opaque { get(&v.ns, i) } else { Vec3::ZERO };
            set(&mut paths.receiver_normal, i, normal);
            let receiver = Receiver { p: get(&v.p, i), normal };
            let chosen = self.lights.select(&receiver, [choice0[i], choice1[i]]);
            (v.light.index[i], v.light.pdf_discrete[i]) = (chosen.index, chosen.pdf_discrete);
        }
    }
}

/// A direction towards a light.
pub(super) struct LightDirection {
    /// Unit length.
    pub wi: Vec3,
    /// Where a shadow ray ends; of no use for lights infinitely far away.
    pub target: Vec3,
    /// Density per solid angle; 0 where the light can't be reached.
    pub pdf_solid_angle: f32,
}

/// A light that is sampled at many vertices at a time. The steps are loops of one kind each: together they would not
/// vectorise.
pub(super) trait VectorSampler {
    /// It is infinitely far away.
    const IS_INFINITE: bool;

    /// Turns the first `count` pairs of uniform numbers into coordinates of points on the light, with densities in those
    /// coordinates.
    fn choose(&self, u: &mut Lanes, v: &mut Lanes, pdf: &mut Lanes, count: usize);

    /// Its radiance at a point.
    fn radiance(&self, uv: [f32; 2]) -> Rgb;

    /// The direction from `p` to a point chosen with a density.
    fn direction(&self, p: Vec3, uv: [f32; 2], pdf: f32) -> LightDirection;
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

/// A rectangle of constant radiance, by solid angle.
pub(super) struct RectangleSampler<'a> {
    light: &'a AreaLight,
    edges: Edges,
    radiance: Rgb,
}

impl<'a> RectangleSampler<'a> {
    /// The scene's light, if it has just one that is such a rectangle.
    pub fn of(lights: &'a Lights) -> Option<Self> {
        match lights.area() {
            [light] if lights.len() == 1 => match (light.shape, light.radiance) {
                (AreaShape::Rectangle(edges), Radiance::Constant(radiance)) => {
                    Some(RectangleSampler { light, edges, radiance })
                }
                _ => None,
            },
            _ => None,
        }
    }
}

impl VectorSampler for RectangleSampler<'_> {
    const IS_INFINITE: bool = false;

    #[inline(always)]
    fn choose(&self, _u: &mut Lanes, _v: &mut Lanes, _pdf: &mut Lanes, _count: usize) {}

    #[inline(always)]
    fn radiance(&self, _uv: [f32; 2]) -> Rgb {
        self.radiance
    }

    #[inline(always)]
    fn direction(&self, p: Vec3, uv: [f32; 2], _pdf: f32) -> LightDirection {
        let Edges { corner, edge_u, edge_v } = self.edges;
        let (normal, error) = (self.light.normal, self.light.point_error());
        let s = SphericalRectangle::new(corner, edge_u, edge_v, p).sample(uv);
        let to_light = s.point - p;
        let distance = to_light.length();
        let is_lit = (self.light.two_sided | (to_light.dot(normal) < 0.0)) & !self.light.is_level_with(p);
        LightDirection {
            wi: to_light / if distance > 0.0 { distance } else { 1.0 },
            target: offset_ray_origin(s.point, error, normal, -to_light),
            pdf_solid_angle: if is_lit & (distance > 0.0) { s.pdf_solid_angle } else { 0.0 },
        }
    }
}

/// A picture around the scene.
pub(super) struct EnvironmentSampler<'a> {
    map: &'a ImageMap,
}

impl<'a> EnvironmentSampler<'a> {
    /// The scene's light, if it is a picture around it and nothing else.
    pub fn of(lights: &'a Lights) -> Option<Self> {
        let environment = lights.environment().filter(|_| lights.len() == 1);
        environment.and_then(EnvironmentLight::image_map).map(|map| EnvironmentSampler { map })
    }
}

/// Points of an environment that are chosen together; what is beyond the last vertex counts for nothing.
const TOGETHER: usize = 16;

const _: () = assert!(WAVE.is_multiple_of(TOGETHER));

impl VectorSampler for EnvironmentSampler<'_> {
    const IS_INFINITE: bool = true;

    #[inline(always)]
    fn choose(&self, u: &mut Lanes, v: &mut Lanes, pdf: &mut Lanes, count: usize) {
        for first in (0..count).step_by(TOGETHER) {
            let at = first..first + TOGETHER;
            let mut uniform = [[0.0; TOGETHER]; 2];
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
