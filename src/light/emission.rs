//! Light leaves lamps: a lamp is chosen, a point of it and a direction, or of lights infinitely far away a direction and a
//! place. Only rays towards certain balls are wanted.

use super::targets::Chosen;
use super::{AreaLight, AreaShape, Lights, PunctualLight, Source, Targets};
use crate::color::Rgb;
use crate::math::{Frame, Ray, Vec3, offset_ray_origin};
use crate::sampling::{AliasTable, warp};
use crate::shape::{Analytic, Shape};
use crate::texture::CompiledTextures;
use std::f32::consts::PI;

/// From this solid angle of its targets on, a surface sends light by the cosine.
const WIDE: f32 = PI;

/// Every lamp is chosen at least this often, as a share of even chances: estimates of what lamps send may be wrong.
const LEAST_SHARE: f32 = 0.02;

/// From a lamp farther away than this many radii of the largest target, directions are too coarse to hit it evenly: rounding leads
/// them astray by some 1e-7 of the distance.
const FARTHEST: f32 = 1e6;

/// The choice of light that leaves lamps. The environment is none.
#[derive(Clone, Debug)]
pub struct Emission {
    targets: Targets,
    table: AliasTable,
    /// From the scene's origin: a ball around everything has this radius.
    reach: f32,
}

/// Light that leaves a lamp.
#[derive(Clone, Copy, Debug)]
pub struct Emitted {
    /// Its ray.
    pub ray: Ray,
    /// Radiance along it; of lights without a size, what they have in its place.
    pub radiance: Rgb,
    /// Flux for a radiance of 1: cosine over the density of the ray.
    pub scale: f32,
    /// The lamp.
    pub light: u32,
    /// It has no size.
    pub is_delta: bool,
}

impl Emission {
    /// Of the lamps of a scene all of which is within `reach` of the origin; `None` if there is no lamp but the environment, no
    /// target, or a lamp too far away for directions in single precision.
    pub fn new(
        lights: &Lights,
        textures: &CompiledTextures,
        targets: Targets,
        reach: f32,
    ) -> Option<Emission> {
        let lamps = (lights.area().len() + lights.punctual().len()) as u32;
        let is_far = |lamp| lights.middle(lamp).is_some_and(|p| targets.is_farther(p, FARTHEST));
        if targets.is_empty() || (0..lamps).any(is_far) {
            return None;
        }
        let across: f32 = targets.balls().iter().map(|ball| PI * ball.radius * ball.radius).sum();
        let towards = |p| targets.solid_angle(p).min(4.0 * PI);
        let of_area = |light: &AreaLight| light.power(textures) / PI * towards(light.middle());
        let of_punctual = |light: &PunctualLight| match light.source() {
            // Of spots and points the power is over all directions.
            Source::At(p) => light.power() / (4.0 * PI) * towards(p),
            Source::Far(_) | Source::Disk(_) => light.power() / PI * across,
        };
        let mut weights: Vec<f32> = lights.area().iter().map(of_area).collect();
        weights.extend(lights.punctual().iter().map(of_punctual));
        let total: f32 = weights.iter().sum();
        if total.is_nan() || total <= 0.0 {
            return None;
        }
        let least = LEAST_SHARE * total / weights.len() as f32;
        weights.iter_mut().for_each(|weight| *weight += least);
        let reach = reach.max(targets.reach());
        Some(Emission { table: AliasTable::new(&weights), targets, reach })
    }

    /// Light that leaves a lamp, by numbers in 0..1: two for the point of the lamp, two for the direction or place, one for the
    /// lamp, one for the ball. `None` where nothing leaves.
    pub fn sample(
        &self,
        lights: &Lights,
        textures: &CompiledTextures,
        of_point: [f32; 2],
        of_direction: [f32; 2],
        of_lamp: f32,
        of_ball: f32,
    ) -> Option<Emitted> {
        let chosen = self.table.sample(of_lamp);
        let u = [of_direction[0], of_direction[1], of_ball];
        let areas = lights.area().len();
        let emitted = match lights.area().get(chosen.index) {
            Some(light) => self.leave_surface(light, textures, of_point, u),
            None => self.leave_source(lights.punctual().get(chosen.index - areas)?, of_point, u),
        }?;
        let scale = emitted.scale / chosen.pdf_discrete;
        let is_lit = emitted.radiance.max_element() > 0.0 && scale.is_finite() && scale > 0.0;
        is_lit.then_some(Emitted { scale, light: chosen.index as u32, ..emitted })
    }

    fn leave_surface(
        &self,
        light: &AreaLight,
        textures: &CompiledTextures,
        of_point: [f32; 2],
        u: [f32; 3],
    ) -> Option<Emitted> {
        if let AreaShape::Analytic(shape) = &light.shape
            && shape.turns()
        {
            return self.leave_disk(light, shape, textures, of_point, u);
        }
        let point = light.point_by_area(of_point);
        let normal = light.normal_at(point, point);
        let (direction, pdf) = if self.targets.solid_angle(point) < WIDE {
            let chosen = self.targets.direction(point, 0.0, u)?;
            (chosen.at, chosen.pdf)
        } else {
            let sides = if light.two_sided { 2.0 } else { 1.0 };
            let side = if light.two_sided && u[2] < 0.5 { -1.0 } else { 1.0 };
            let local = warp::cosine_hemisphere([u[0], u[1]]);
            let pdf = warp::cosine_hemisphere_pdf_solid_angle(local.z) / sides;
            (Frame::from_normal(normal * side).to_world(local), pdf)
        };
        let cosine = direction.dot(normal);
        if cosine <= 0.0 && !light.two_sided {
            return None;
        }
        let origin = offset_ray_origin(point, light.point_error(), normal, direction);
        Some(Emitted {
            ray: Ray::new(origin, direction),
            radiance: light.beam.of(light.radiance_at(textures, point), normal, direction, textures),
            scale: cosine.abs() * light.area() / pdf,
            light: 0,
            is_delta: false,
        })
    }

    /// From a disk that turns to the direction.
    fn leave_disk(
        &self,
        light: &AreaLight,
        shape: &Analytic,
        textures: &CompiledTextures,
        of_point: [f32; 2],
        u: [f32; 3],
    ) -> Option<Emitted> {
        let (center, radius) = shape.center_and_radius();
        let Chosen { at: direction, pdf } = self.targets.direction(center, radius, u)?;
        let on_disk = warp::uniform_disk(of_point) * radius;
        let point = center + Frame::from_normal(direction).to_world(on_disk.extend(0.0));
        Some(Emitted {
            ray: Ray::new(point, direction),
            radiance: light.beam.of(light.radiance_at(textures, point), direction, direction, textures),
            scale: shape.largest_projection() / pdf,
            light: 0,
            is_delta: false,
        })
    }

    fn leave_source(&self, light: &PunctualLight, of_point: [f32; 2], u: [f32; 3]) -> Option<Emitted> {
        match light.source() {
            Source::At(position) => {
                let chosen = self.targets.direction(position, 0.0, u)?;
                let (ray, radiance) = (Ray::new(position, chosen.at), light.intensity(chosen.at));
                Some(Emitted { ray, radiance, scale: 1.0 / chosen.pdf, light: 0, is_delta: true })
            }
            Source::Far(to_light) => {
                let chosen = self.targets.place(to_light, u)?;
                let (ray, radiance) = (self.ray_from_afar(chosen.at, -to_light), light.intensity(-to_light));
                Some(Emitted { ray, radiance, scale: 1.0 / chosen.pdf, light: 0, is_delta: true })
            }
            Source::Disk(sun) => {
                let sample = sun.sample(of_point);
                let chosen = self.targets.place(sample.wi, u)?;
                Some(Emitted {
                    ray: self.ray_from_afar(chosen.at, -sample.wi),
                    radiance: sample.radiance,
                    scale: 1.0 / (chosen.pdf * sample.pdf_solid_angle),
                    light: 0,
                    is_delta: false,
                })
            }
        }
    }

    /// A ray through a point that starts beyond everything.
    fn ray_from_afar(&self, p: Vec3, direction: Vec3) -> Ray {
        // The point nearest to the origin, and from there beyond the ball.
        let nearest = p - direction * p.dot(direction);
        Ray::new(nearest - direction * (self.reach * 1.01), direction)
    }
}
