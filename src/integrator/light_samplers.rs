//! Lights that are sampled at many vertices at a time.

use super::lanes::{Lanes, WAVE};
use crate::color::Rgb;
use crate::light::{EnvironmentLight, EvenRectangle, ImageMap, LightDirection, Lights, solid_angle_density};
use crate::math::Vec3;

/// Has the scene a single light that is sampled without a choice?
pub(super) fn has_vector_sampler(lights: &Lights) -> bool {
    RectangleSampler::of(lights).is_some() || EnvironmentSampler::of(lights).is_some()
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

/// A rectangle of constant radiance, by solid angle.
pub(super) struct RectangleSampler {
    rectangle: EvenRectangle,
}

impl RectangleSampler {
    /// The scene's light, if it has just one that is such a rectangle.
    pub fn of(lights: &Lights) -> Option<Self> {
        match lights.rectangles()? {
            [numbers] => Some(RectangleSampler { rectangle: EvenRectangle::unpack(*numbers) }),
            _ => None,
        }
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

/// A picture around the scene.
pub(super) struct EnvironmentSampler<'a> {
    map: &'a ImageMap,
}

impl<'a> EnvironmentSampler<'a> {
    /// The scene's light, if it is a picture around it and nothing else.
    pub fn of(lights: &'a Lights) -> Option<Self> {
        let environment =
            lights.environment().filter(|e| lights.len() == 1 && e.is_sampled() && !e.has_portals());
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
