//! Emission of light paths: samples a light, a point on it and a direction (for lights at infinity, a direction and a point of the ray).
//! Rays are aimed at bounding spheres of target objects (caustic casters).
//!
//! [`SmallLight`]: the brightest small lights of a scene.

use super::{
    AreaLight, AreaShape, EnvironmentLight, LightOrigin, LightSource, Lights, PunctualLight, PunctualSource,
};
use crate::color::Rgb;
use crate::math::{Frame, Ray, Vec3, offset_ray_origin};
use crate::sampling::{AliasTable, warp};
use crate::shape::{Analytic, Shape};
use crate::texture::CompiledTextures;
use std::f32::consts::PI;

/// If the targets subtend this solid angle or more, steradians, surfaces sample directions by the cosine instead of aiming.
const MAX_AIMED_SOLID_ANGLE: f32 = PI;

/// Minimum probability of each light relative to a uniform choice, since power estimates may be wrong.
const MIN_SHARE: f32 = 0.02;

/// Maximum distance of a light in radii of the largest target: beyond, rounding errors of directions (1e-7) make hits uneven.
const MAX_DISTANCE_RADII: f32 = 1e6;

/// Samples rays emitted by all lights except the environment.
#[derive(Clone, Debug)]
pub struct LightPathSampler {
    targets: TargetSpheres,
    table: AliasTable,
    /// Radius of a sphere around the scene's origin that contains the scene, metres.
    scene_radius: f32,
}

/// A ray emitted by a light.
#[derive(Clone, Copy, Debug)]
pub struct EmittedRay {
    pub ray: Ray,
    /// Radiance along the ray; intensity or irradiance of delta lights.
    pub radiance: Rgb,
    /// Flux for a radiance of 1: cosine over the pdf of the ray.
    pub scale: f32,
    /// Index of the light.
    pub light: u32,
    /// Is the light a delta light?
    pub is_delta: bool,
}

impl LightPathSampler {
    /// A sampler for a scene within `scene_radius` metres of the origin; `None` without targets, without lights other than the
    /// environment, or with a light too far away for directions in single precision.
    pub fn new(
        lights: &Lights,
        textures: &CompiledTextures,
        targets: TargetSpheres,
        scene_radius: f32,
    ) -> Option<LightPathSampler> {
        let light_count = (lights.area().len() + lights.punctual().len()) as u32;
        let is_far = |light| lights.center(light).is_some_and(|p| targets.is_farther(p, MAX_DISTANCE_RADII));
        if targets.is_empty() || (0..light_count).any(is_far) {
            return None;
        }
        let cross_section: f32 =
            targets.spheres().iter().map(|sphere| PI * sphere.radius * sphere.radius).sum();
        let towards = |p| targets.solid_angle(p).min(4.0 * PI);
        let area_weight = |light: &AreaLight| match light.emits_by_hit() {
            true => 0.0,
            false => light.power(textures) / PI * towards(light.center()),
        };
        let punctual_weight = |light: &PunctualLight| match light.origin() {
            // Power is emitted over all directions.
            LightOrigin::Point(p) => light.power(textures) / (4.0 * PI) * towards(p),
            LightOrigin::Direction(_) | LightOrigin::Cone => light.power(textures) / PI * cross_section,
        };
        let mut weights: Vec<f32> = lights.area().iter().map(area_weight).collect();
        weights.extend(lights.punctual().iter().map(punctual_weight));
        let total: f32 = weights.iter().sum();
        if total.is_nan() || total <= 0.0 {
            return None;
        }
        let min_weight = MIN_SHARE * total / weights.len() as f32;
        let is_excluded = |i: usize| lights.light_emits_by_hit(i as u32);
        weights
            .iter_mut()
            .enumerate()
            .filter(|(i, _)| !is_excluded(*i))
            .for_each(|(_, weight)| *weight += min_weight);
        let scene_radius = scene_radius.max(targets.bounding_radius());
        Some(LightPathSampler { table: AliasTable::new(&weights), targets, scene_radius })
    }

    /// Samples an emitted ray by random numbers in 0..1: two for the point of the light (direction to a sun), two for the direction (point
    /// of a ray from infinity), one for the light, one for the target sphere. `None` if nothing is emitted.
    pub fn sample(
        &self,
        lights: &Lights,
        textures: &CompiledTextures,
        u_point: [f32; 2],
        u_direction: [f32; 2],
        u_light: f32,
        u_sphere: f32,
    ) -> Option<EmittedRay> {
        let chosen = self.table.sample(u_light);
        let u = [u_direction[0], u_direction[1], u_sphere];
        let areas = lights.area().len();
        let emitted = match lights.area().get(chosen.index) {
            Some(light) => self.emit_from_surface(light, textures, u_point, u),
            None => {
                self.emit_from_punctual(lights.punctual().get(chosen.index - areas)?, textures, u_point, u)
            }
        }?;
        let scale = emitted.scale / chosen.pdf_discrete;
        let is_lit = emitted.radiance.max_element() > 0.0 && scale.is_finite() && scale > 0.0;
        is_lit.then_some(EmittedRay { scale, light: chosen.index as u32, ..emitted })
    }

    fn emit_from_surface(
        &self,
        light: &AreaLight,
        textures: &CompiledTextures,
        u_point: [f32; 2],
        u: [f32; 3],
    ) -> Option<EmittedRay> {
        if let AreaShape::Analytic(shape) = &light.shape
            && shape.is_facing()
        {
            return self.emit_from_disk(light, shape, textures, u_point, u);
        }
        let point = light.point_by_area(u_point);
        let normal = light.normal_at(point, point);
        let (direction, pdf) = if self.targets.solid_angle(point) < MAX_AIMED_SOLID_ANGLE {
            let chosen = self.targets.sample_direction(point, 0.0, u)?;
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
        Some(EmittedRay {
            ray: Ray::new(origin, direction),
            radiance: light.beam.radiance(light.radiance_at(textures, point), normal, direction, textures),
            scale: cosine.abs() * light.area() / pdf,
            light: 0,
            is_delta: false,
        })
    }

    /// Emission from a disk that faces the receiver.
    fn emit_from_disk(
        &self,
        light: &AreaLight,
        shape: &Analytic,
        textures: &CompiledTextures,
        u_point: [f32; 2],
        u: [f32; 3],
    ) -> Option<EmittedRay> {
        let (center, radius) = shape.center_and_radius();
        let TargetSample { at: direction, pdf } = self.targets.sample_direction(center, radius, u)?;
        let on_disk = warp::uniform_disk(u_point) * radius;
        let point = center + Frame::from_normal(direction).to_world(on_disk.extend(0.0));
        Some(EmittedRay {
            ray: Ray::new(point, direction),
            radiance: light.beam.radiance(light.radiance_at(textures, point), direction, direction, textures),
            scale: shape.largest_projection() / pdf,
            light: 0,
            is_delta: false,
        })
    }

    fn emit_from_punctual(
        &self,
        light: &PunctualLight,
        textures: &CompiledTextures,
        u_point: [f32; 2],
        u: [f32; 3],
    ) -> Option<EmittedRay> {
        match light.origin() {
            LightOrigin::Point(position) => {
                let chosen = self.targets.sample_direction(position, 0.0, u)?;
                let (ray, radiance) = (Ray::new(position, chosen.at), light.intensity(chosen.at));
                Some(EmittedRay { ray, radiance, scale: 1.0 / chosen.pdf, light: 0, is_delta: true })
            }
            LightOrigin::Direction(to_light) => {
                let chosen = self.targets.sample_ray_point(to_light, u)?;
                let (ray, radiance) =
                    (self.ray_from_infinity(chosen.at, -to_light), light.intensity(-to_light));
                Some(EmittedRay { ray, radiance, scale: 1.0 / chosen.pdf, light: 0, is_delta: true })
            }
            LightOrigin::Cone => {
                let sample = light.sample(textures, Vec3::ZERO, u_point);
                let chosen = self.targets.sample_ray_point(sample.wi, u)?;
                Some(EmittedRay {
                    ray: self.ray_from_infinity(chosen.at, -sample.wi),
                    radiance: sample.radiance,
                    scale: 1.0 / (chosen.pdf * sample.pdf_solid_angle),
                    light: 0,
                    is_delta: false,
                })
            }
        }
    }

    /// A ray through a point that starts outside the scene.
    fn ray_from_infinity(&self, p: Vec3, direction: Vec3) -> Ray {
        let nearest = p - direction * p.dot(direction);
        Ray::new(nearest - direction * (self.scene_radius * 1.01), direction)
    }
}

/// A sphere at which light paths are aimed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TargetSphere {
    pub center: Vec3,
    /// Metres.
    pub radius: f32,
}

/// The spheres at which light paths are aimed.
#[derive(Clone, Debug, Default)]
pub struct TargetSpheres {
    spheres: Vec<TargetSphere>,
}

/// The cone of directions from a point to a sphere.
struct DirectionCone {
    axis: Vec3,
    /// 1 - cosine of the half angle; 2 for all directions.
    one_minus_cos: f32,
}

/// A sampled direction to the targets, or a point of a ray that hits them.
#[derive(Clone, Copy, Debug)]
pub struct TargetSample {
    /// The direction, or the point.
    pub at: Vec3,
    /// Pdf per solid angle, or per area perpendicular to the ray.
    pub pdf: f32,
}

impl TargetSphere {
    /// The cone of directions to the sphere from points within distance `around` of `p`.
    fn cone_from(&self, p: Vec3, around: f32) -> DirectionCone {
        let (offset, radius) = (self.center - p, self.radius + around);
        let (squared, r2) = (offset.length_squared(), radius * radius);
        if squared <= r2 {
            return DirectionCone { axis: Vec3::Z, one_minus_cos: 2.0 };
        }
        let sin2 = r2 / squared;
        DirectionCone { axis: offset / squared.sqrt(), one_minus_cos: warp::one_minus_cos(sin2, 1.0 - sin2) }
    }
}

impl DirectionCone {
    fn contains(&self, direction: Vec3) -> bool {
        // The squared length of a chord is 2 (1 - cos); slightly wider, for rounding.
        self.one_minus_cos >= 2.0
            || (direction - self.axis).length_squared() <= 2.0 * self.one_minus_cos * (1.0 + 1e-5)
    }

    fn sample(&self, u: [f32; 2]) -> Vec3 {
        if self.one_minus_cos >= 2.0 {
            return warp::uniform_sphere(u);
        }
        Frame::from_normal(self.axis).to_world(warp::uniform_cone(u, self.one_minus_cos))
    }
}

impl TargetSpheres {
    /// The target spheres with a radius above 0.
    pub fn new(spheres: impl IntoIterator<Item = TargetSphere>) -> TargetSpheres {
        let is_usable = |sphere: &TargetSphere| {
            sphere.radius > 0.0 && sphere.radius.is_finite() && sphere.center.is_finite()
        };
        TargetSpheres { spheres: spheres.into_iter().filter(is_usable).collect() }
    }

    /// Are there no spheres?
    pub fn is_empty(&self) -> bool {
        self.spheres.is_empty()
    }

    pub fn spheres(&self) -> &[TargetSphere] {
        &self.spheres
    }

    /// Is the largest sphere more than this multiple of its radius away from a point?
    pub fn is_farther(&self, p: Vec3, radii: f32) -> bool {
        let largest = self.spheres.iter().max_by(|a, b| a.radius.total_cmp(&b.radius));
        largest.is_some_and(|sphere| (sphere.center - p).length() > radii * sphere.radius)
    }

    /// Sum of the spheres' solid angles from a point; overlaps count several times.
    pub fn solid_angle(&self, p: Vec3) -> f32 {
        self.solid_angle_around(p, 0.0)
    }

    fn solid_angle_around(&self, p: Vec3, around: f32) -> f32 {
        self.spheres.iter().map(|sphere| 2.0 * PI * sphere.cone_from(p, around).one_minus_cos).sum()
    }

    /// Samples a direction from a point, or from any point within distance `around`, to one of the spheres: the sphere (by `u[2]`) in
    /// proportion to solid angle, and the direction uniformly. The pdf is proportional to the number of spheres in that direction.
    pub fn sample_direction(&self, p: Vec3, around: f32, u: [f32; 3]) -> Option<TargetSample> {
        let total = self.solid_angle_around(p, around);
        let mut rest = u[2] * total;
        let mut chosen = None;
        for sphere in &self.spheres {
            let cone = sphere.cone_from(p, around);
            rest -= 2.0 * PI * cone.one_minus_cos;
            chosen = Some(cone);
            if rest < 0.0 {
                break;
            }
        }
        let at = chosen?.sample([u[0], u[1]]);
        let count = self.spheres.iter().filter(|sphere| sphere.cone_from(p, around).contains(at)).count();
        Some(TargetSample { at, pdf: count.max(1) as f32 / total })
    }

    /// Samples a point of a ray of this direction that intersects one of the spheres: the sphere (by `u[2]`) in proportion to its
    /// cross-section, and the point uniformly.
    pub fn sample_ray_point(&self, direction: Vec3, u: [f32; 3]) -> Option<TargetSample> {
        let total: f32 = self.spheres.iter().map(|sphere| sphere.radius * sphere.radius).sum();
        let mut rest = u[2] * total;
        let mut chosen = None;
        for sphere in &self.spheres {
            rest -= sphere.radius * sphere.radius;
            chosen = Some(sphere);
            if rest < 0.0 {
                break;
            }
        }
        let sphere = chosen?;
        let disk = warp::uniform_disk([u[0], u[1]]) * sphere.radius;
        let at = sphere.center + Frame::from_normal(direction).to_world(Vec3::new(disk.x, disk.y, 0.0));
        let distance_squared = |sphere: &TargetSphere| {
            let offset = at - sphere.center;
            offset.length_squared() - offset.dot(direction).powi(2)
        };
        let is_hit =
            |sphere: &&TargetSphere| distance_squared(sphere) <= sphere.radius * sphere.radius * (1.0 + 1e-5);
        let count = self.spheres.iter().filter(is_hit).count();
        Some(TargetSample { at, pdf: count.max(1) as f32 / (PI * total) })
    }

    /// Radius of a sphere around the origin that contains all spheres, metres.
    pub fn bounding_radius(&self) -> f32 {
        self.spheres.iter().map(|sphere| sphere.center.length() + sphere.radius).fold(0.0, f32::max)
    }
}

/// Maximum number of small lights at infinity, and at a position.
const MAX_LIGHTS: usize = 4;

/// Samples along each axis for finding the brightest spot of an environment.
const GRID: usize = 16;

/// Minimum cosine between directions in the same spot: 2 degrees.
const SPOT_COSINE: f32 = 0.9994;

/// Minimum fraction of an environment's light in a spot.
const MIN_SMALL_LIGHT_SHARE: f32 = 0.1;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightPosition {
    /// At infinity, in a unit direction.
    Far(Vec3),
    /// Around a point.
    Near(Vec3),
}

#[derive(Clone, Copy, Debug)]
pub struct SmallLight {
    pub position: LightPosition,
    /// Radius, metres; of lights at infinity the angular radius, radians.
    pub size: f32,
    /// Estimated luminance of the irradiance at normal incidence: at a distance of 1 metre, or of lights at infinity anywhere.
    pub irradiance: f32,
}

impl SmallLight {
    /// Estimated luminance of the unoccluded irradiance at a point, at normal incidence.
    pub fn irradiance_at(&self, p: Vec3) -> f32 {
        match self.position {
            LightPosition::Far(_) => self.irradiance,
            LightPosition::Near(middle) => self.irradiance / (middle - p).length_squared().max(1e-12),
        }
    }
}

impl Lights {
    /// The brightest small lights at infinity, then those at a position.
    pub fn small_lights(&self, textures: &CompiledTextures) -> Vec<SmallLight> {
        let (mut far, mut near) = (Vec::new(), Vec::new());
        for light in self.punctual() {
            let (to, size) = match (light.origin(), light.sun()) {
                (LightOrigin::Point(position), _) => {
                    let irradiance = light.bounds(textures).map_or(0.0, |bounds| bounds.weight);
                    near.push(SmallLight { position: LightPosition::Near(position), size: 0.0, irradiance });
                    continue;
                }
                (LightOrigin::Direction(to), _) => (to, 0.0),
                (LightOrigin::Cone, Some(sun)) => (sun.center(), sun.half_angle()),
                (LightOrigin::Cone, None) => continue,
            };
            let irradiance = light.irradiance().unwrap_or(0.0);
            far.push(SmallLight { position: LightPosition::Far(to), size, irradiance });
        }
        for light in self.area() {
            let irradiance = light.bounds(textures).map_or(0.0, |bounds| bounds.weight);
            let position = LightPosition::Near(light.center());
            near.push(SmallLight { position, size: radius(light), irradiance });
        }
        far.extend(self.environment().and_then(brightest_spot));
        let brightest = |mut list: Vec<SmallLight>| {
            list.retain(|light| light.irradiance > 0.0);
            list.sort_by(|a, b| b.irradiance.total_cmp(&a.irradiance));
            list.truncate(MAX_LIGHTS);
            list
        };
        [brightest(far), brightest(near)].concat()
    }
}

/// Radius of a disk (a sphere for analytic shapes) of the same area.
fn radius(light: &AreaLight) -> f32 {
    let sides = if matches!(light.shape, AreaShape::Analytic(_)) { 4.0 } else { 1.0 };
    (light.area() / (sides * PI)).sqrt()
}

/// The brightest spot of an environment image.
fn brightest_spot(environment: &EnvironmentLight) -> Option<SmallLight> {
    environment.image_map()?;
    let at = |k: usize| (k as f32 + 0.5) / GRID as f32;
    let directions: Vec<Vec3> =
        (0..GRID * GRID).map(|k| environment.sample([at(k % GRID), at(k / GRID)]).direction).collect();
    let near = |axis: Vec3| directions.iter().filter(move |d| d.dot(axis) >= SPOT_COSINE);
    let densest = *directions.iter().max_by_key(|axis| near(**axis).count())?;
    let mean: Vec3 = near(densest).sum();
    let (axis, count) = (mean.try_normalize()?, near(densest).count() as f32);
    let fraction = count / directions.len() as f32;
    let spread = near(densest).map(|d| (*d - axis).length_squared()).sum::<f32>() / count;
    // The radius of a uniform disk is sqrt(2) times the root mean square distance.
    let (position, size) = (LightPosition::Far(axis), (2.0 * spread).sqrt());
    let irradiance = fraction * environment.mean_luminance() * 4.0 * PI;
    (fraction >= MIN_SMALL_LIGHT_SHARE).then_some(SmallLight { position, size, irradiance })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::{Chi2, SphericalDomain};

    fn targets() -> TargetSpheres {
        let sphere = |x: f32, y: f32, radius| TargetSphere { center: Vec3::new(x, y, 3.0), radius };
        TargetSpheres::new([
            sphere(0.0, 0.0, 1.0),
            sphere(0.7, 0.2, 0.9),
            sphere(-3.0, 1.0, 0.5),
            sphere(0.0, 0.0, 0.0),
        ])
    }

    #[test]
    fn distances_are_relative_to_the_largest_sphere() {
        let targets = targets();
        assert!(!targets.is_farther(Vec3::ZERO, 3.1));
        assert!(targets.is_farther(Vec3::ZERO, 2.9));
        assert!(!TargetSpheres::default().is_farther(Vec3::ZERO, 1.0));
    }

    #[test]
    fn sampled_directions_match_their_pdf() {
        let targets = targets();
        assert_eq!(targets.spheres().len(), 3);
        let points = [Vec3::ZERO, Vec3::new(-1.0, 0.3, 2.0), Vec3::new(0.1, 0.0, 2.9)];
        for (p, around) in points.into_iter().flat_map(|p| [(p, 0.0), (p, 0.6)]) {
            let total = targets.solid_angle_around(p, around);
            let mut sums = [0.0f64; 2];
            let n = 40_000u32;
            for i in 0..n {
                let u =
                    [i.wrapping_mul(0xd1b5_4a33), i.wrapping_mul(0xab98_3a35), i.wrapping_mul(0x8f9d_1c75)];
                let chosen =
                    targets.sample_direction(p, around, u.map(crate::sampling::hash::unit)).expect("spheres");
                // Solid angle of the union of the cones, against uniform sampling of the sphere.
                sums[0] += 1.0 / f64::from(chosen.pdf) / f64::from(n);
                let [a, b, _] = u.map(crate::sampling::hash::unit);
                let uniform = warp::uniform_sphere([a, b]);
                let is_in_one =
                    targets.spheres().iter().any(|sphere| sphere.cone_from(p, around).contains(uniform));
                sums[1] += f64::from(u8::from(is_in_one)) * 4.0 * std::f64::consts::PI / f64::from(n);
            }
            assert!((sums[0] / sums[1] - 1.0).abs() < 0.02, "{p} {around}: {sums:?} of {total}");
        }
    }

    #[test]
    fn directions_to_one_sphere_are_uniform() {
        let targets = TargetSpheres::new([TargetSphere { center: Vec3::new(0.0, 2.0, 0.0), radius: 1.0 }]);
        Chi2::new("targets", 1).assert_directions(
            &SphericalDomain::sphere(),
            |u| targets.sample_direction(Vec3::ZERO, 0.0, [u[0], u[1], 0.5]).map(|chosen| chosen.at),
            |w| if w.y > 0.75f32.sqrt() { 1.0 / targets.solid_angle(Vec3::ZERO) } else { 0.0 },
        );
    }

    #[test]
    fn sampled_ray_points_match_their_pdf() {
        let targets = targets();
        let n = 40_000u32;
        let mut area = 0.0;
        for i in 0..n {
            let u = [i.wrapping_mul(0xd1b5_4a33), i.wrapping_mul(0xab98_3a35), i.wrapping_mul(0x8f9d_1c75)];
            let chosen =
                targets.sample_ray_point(Vec3::Z, u.map(crate::sampling::hash::unit)).expect("spheres");
            area += 1.0 / f64::from(chosen.pdf) / f64::from(n);
        }
        // Area of the union of two overlapping circles and a separate one.
        let (r, s, d) = (1.0f64, 0.9f64, (0.7f64 * 0.7 + 0.04).sqrt());
        let a = r * r * ((d * d + r * r - s * s) / (2.0 * d * r)).acos();
        let b = s * s * ((d * d + s * s - r * r) / (2.0 * d * s)).acos();
        let c = 0.5 * ((-d + r + s) * (d + r - s) * (d - r + s) * (d + r + s)).sqrt();
        let expected = std::f64::consts::PI * (r * r + s * s + 0.25) - (a + b - c);
        assert!((area / expected - 1.0).abs() < 0.01, "{area} {expected}");
    }
}
