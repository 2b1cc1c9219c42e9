//! Light paths start: a light is chosen, a point of it and a direction, or of lights at infinity a direction and a point. Rays are
//! aimed at bounding spheres of the objects that they should hit first.
//!
//! [`SmallLight`]: in which direction, or where, most of the light of a scene starts, where that is narrow.

use super::{
    AreaLight, AreaShape, EnvironmentLight, LightOrigin, LightSource, Lights, PunctualLight, PunctualSource,
};
use crate::color::Rgb;
use crate::math::{Frame, Ray, Vec3, offset_ray_origin};
use crate::sampling::{AliasTable, warp};
use crate::shape::{Analytic, Shape};
use crate::texture::CompiledTextures;
use std::f32::consts::PI;

/// From this solid angle of its targets on, steradians, a surface emits by the cosine.
const WIDE: f32 = PI;

/// Minimum probability of each light relative to a uniform choice: estimates of their power may be wrong.
const MIN_SHARE: f32 = 0.02;

/// Largest distance of a light in radii of the largest target: the rounding of directions, some 1e-7, would hit it unevenly.
const FARTHEST: f32 = 1e6;

/// Samples the rays that leave lights, the environment excepted.
#[derive(Clone, Debug)]
pub struct LightPathSampler {
    targets: TargetSpheres,
    table: AliasTable,
    /// Radius of a sphere around the scene's origin that holds everything, metres.
    reach: f32,
}

/// A ray that leaves a light.
#[derive(Clone, Copy, Debug)]
pub struct EmittedRay {
    /// The ray.
    pub ray: Ray,
    /// Radiance along it; of delta lights the intensity or irradiance.
    pub radiance: Rgb,
    /// Flux at a radiance of 1: cosine over the density of the ray.
    pub scale: f32,
    /// Index of the light.
    pub light: u32,
    /// The light is a delta light.
    pub is_delta: bool,
}

impl LightPathSampler {
    /// For a scene within `reach` of the origin; `None` without lights but the environment, without targets, or with a light too far
    /// away for directions in single precision.
    pub fn new(
        lights: &Lights,
        textures: &CompiledTextures,
        targets: TargetSpheres,
        reach: f32,
    ) -> Option<LightPathSampler> {
        let light_count = (lights.area().len() + lights.punctual().len()) as u32;
        let is_far = |light| lights.middle(light).is_some_and(|p| targets.is_farther(p, FARTHEST));
        if targets.is_empty() || (0..light_count).any(is_far) {
            return None;
        }
        let across: f32 = targets.spheres().iter().map(|sphere| PI * sphere.radius * sphere.radius).sum();
        let towards = |p| targets.solid_angle(p).min(4.0 * PI);
        let of_area = |light: &AreaLight| match light.emits_by_hit() {
            true => 0.0,
            false => light.power(textures) / PI * towards(light.middle()),
        };
        let of_punctual = |light: &PunctualLight| match light.origin() {
            // The power of spots and points is over all directions.
            LightOrigin::Point(p) => light.power(textures) / (4.0 * PI) * towards(p),
            LightOrigin::Direction(_) | LightOrigin::Cone => light.power(textures) / PI * across,
        };
        let mut weights: Vec<f32> = lights.area().iter().map(of_area).collect();
        weights.extend(lights.punctual().iter().map(of_punctual));
        let total: f32 = weights.iter().sum();
        if total.is_nan() || total <= 0.0 {
            return None;
        }
        let least = MIN_SHARE * total / weights.len() as f32;
        let is_left_out = |i: usize| lights.light_emits_by_hit(i as u32);
        weights
            .iter_mut()
            .enumerate()
            .filter(|(i, _)| !is_left_out(*i))
            .for_each(|(_, weight)| *weight += least);
        let reach = reach.max(targets.reach());
        Some(LightPathSampler { table: AliasTable::new(&weights), targets, reach })
    }

    /// A ray by numbers in 0..1: two for the point of the light, two for the direction or the point of a ray from infinity, one for the
    /// light, one for the sphere. `None` if no light leaves.
    pub fn sample(
        &self,
        lights: &Lights,
        textures: &CompiledTextures,
        of_point: [f32; 2],
        of_direction: [f32; 2],
        of_light: f32,
        of_sphere: f32,
    ) -> Option<EmittedRay> {
        let chosen = self.table.sample(of_light);
        let u = [of_direction[0], of_direction[1], of_sphere];
        let areas = lights.area().len();
        let emitted = match lights.area().get(chosen.index) {
            Some(light) => self.leave_surface(light, textures, of_point, u),
            None => self.leave_punctual(lights.punctual().get(chosen.index - areas)?, textures, of_point, u),
        }?;
        let scale = emitted.scale / chosen.pdf_discrete;
        let is_lit = emitted.radiance.max_element() > 0.0 && scale.is_finite() && scale > 0.0;
        is_lit.then_some(EmittedRay { scale, light: chosen.index as u32, ..emitted })
    }

    fn leave_surface(
        &self,
        light: &AreaLight,
        textures: &CompiledTextures,
        of_point: [f32; 2],
        u: [f32; 3],
    ) -> Option<EmittedRay> {
        if let AreaShape::Analytic(shape) = &light.shape
            && shape.is_facing()
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
        Some(EmittedRay {
            ray: Ray::new(origin, direction),
            radiance: light.beam.of(light.radiance_at(textures, point), normal, direction, textures),
            scale: cosine.abs() * light.area() / pdf,
            light: 0,
            is_delta: false,
        })
    }

    /// From a disk that faces the direction.
    fn leave_disk(
        &self,
        light: &AreaLight,
        shape: &Analytic,
        textures: &CompiledTextures,
        of_point: [f32; 2],
        u: [f32; 3],
    ) -> Option<EmittedRay> {
        let (center, radius) = shape.center_and_radius();
        let TargetSample { at: direction, pdf } = self.targets.direction(center, radius, u)?;
        let on_disk = warp::uniform_disk(of_point) * radius;
        let point = center + Frame::from_normal(direction).to_world(on_disk.extend(0.0));
        Some(EmittedRay {
            ray: Ray::new(point, direction),
            radiance: light.beam.of(light.radiance_at(textures, point), direction, direction, textures),
            scale: shape.largest_projection() / pdf,
            light: 0,
            is_delta: false,
        })
    }

    fn leave_punctual(
        &self,
        light: &PunctualLight,
        textures: &CompiledTextures,
        of_point: [f32; 2],
        u: [f32; 3],
    ) -> Option<EmittedRay> {
        match light.origin() {
            LightOrigin::Point(position) => {
                let chosen = self.targets.direction(position, 0.0, u)?;
                let (ray, radiance) = (Ray::new(position, chosen.at), light.intensity(chosen.at));
                Some(EmittedRay { ray, radiance, scale: 1.0 / chosen.pdf, light: 0, is_delta: true })
            }
            LightOrigin::Direction(to_light) => {
                let chosen = self.targets.place(to_light, u)?;
                let (ray, radiance) =
                    (self.ray_from_infinity(chosen.at, -to_light), light.intensity(-to_light));
                Some(EmittedRay { ray, radiance, scale: 1.0 / chosen.pdf, light: 0, is_delta: true })
            }
            LightOrigin::Cone => {
                let sample = light.sample(textures, Vec3::ZERO, of_point);
                let chosen = self.targets.place(sample.wi, u)?;
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

    /// A ray through a point that starts beyond everything.
    fn ray_from_infinity(&self, p: Vec3, direction: Vec3) -> Ray {
        // The point nearest to the origin, and from there beyond the sphere.
        let nearest = p - direction * p.dot(direction);
        Ray::new(nearest - direction * (self.reach * 1.01), direction)
    }
}

/// A sphere that light paths are aimed at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TargetSphere {
    /// Its center.
    pub center: Vec3,
    /// Its radius.
    pub radius: f32,
}

/// The spheres that light paths are aimed at.
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

/// A sampled direction, or point of a ray.
#[derive(Clone, Copy, Debug)]
pub struct TargetSample {
    /// The direction, or a point of the ray.
    pub at: Vec3,
    /// Its density: per solid angle, or per area across the ray.
    pub pdf: f32,
}

impl TargetSphere {
    /// The cone of directions to it from points around `p`, up to `around` away.
    fn cone_from(&self, p: Vec3, around: f32) -> DirectionCone {
        let (way, radius) = (self.center - p, self.radius + around);
        let (squared, r2) = (way.length_squared(), radius * radius);
        if squared <= r2 {
            return DirectionCone { axis: Vec3::Z, one_minus_cos: 2.0 };
        }
        let sin2 = r2 / squared;
        DirectionCone { axis: way / squared.sqrt(), one_minus_cos: warp::one_minus_cos(sin2, 1.0 - sin2) }
    }
}

impl DirectionCone {
    fn contains(&self, direction: Vec3) -> bool {
        // A chord's squared length is twice that; a little wider, for rounding.
        self.one_minus_cos >= 2.0
            || (direction - self.axis).length_squared() <= 2.0 * self.one_minus_cos * (1.0 + 1e-5)
    }

    fn sample(&self, u: [f32; 2]) -> Vec3 {
        if self.one_minus_cos >= 2.0 {
            return warp::uniform_sphere(u);
        }
        // Nearly in the middle of its edge, so that rounding can't lead outside.
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

    /// Is there none?
    pub fn is_empty(&self) -> bool {
        self.spheres.is_empty()
    }

    /// The spheres.
    pub fn spheres(&self) -> &[TargetSphere] {
        &self.spheres
    }

    /// Is the largest sphere more than this multiple of its radius away from a point?
    pub fn is_farther(&self, p: Vec3, radii: f32) -> bool {
        let largest = self.spheres.iter().max_by(|a, b| a.radius.total_cmp(&b.radius));
        largest.is_some_and(|sphere| (sphere.center - p).length() > radii * sphere.radius)
    }

    /// Solid angle of all spheres from a point, each for itself.
    pub fn solid_angle(&self, p: Vec3) -> f32 {
        self.solid_angle_around(p, 0.0)
    }

    fn solid_angle_around(&self, p: Vec3, around: f32) -> f32 {
        self.spheres.iter().map(|sphere| 2.0 * PI * sphere.cone_from(p, around).one_minus_cos).sum()
    }

    /// A direction from a point, or from any point as near to it as `around`, to one of the spheres: each by its solid angle, and there
    /// evenly, so that the density counts the spheres in a direction. `u[2]` chooses the sphere.
    pub fn direction(&self, p: Vec3, around: f32, u: [f32; 3]) -> Option<TargetSample> {
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

    /// A point of a ray of this direction that intersects one of the spheres: each by its area across, and there evenly.
    pub fn place(&self, direction: Vec3, u: [f32; 3]) -> Option<TargetSample> {
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
        let beside = |sphere: &TargetSphere| {
            let way = at - sphere.center;
            way.length_squared() - way.dot(direction).powi(2)
        };
        let is_met = |sphere: &&TargetSphere| beside(sphere) <= sphere.radius * sphere.radius * (1.0 + 1e-5);
        let count = self.spheres.iter().filter(is_met).count();
        Some(TargetSample { at, pdf: count.max(1) as f32 / (PI * total) })
    }

    /// How far from the origin the spheres reach.
    pub fn reach(&self) -> f32 {
        self.spheres.iter().map(|sphere| sphere.center.length() + sphere.radius).fold(0.0, f32::max)
    }
}

/// Maximum number of lights of either kind.
const MAX_LIGHTS: usize = 4;

/// Samples along each axis by which the brightest spot of an environment is found.
const GRID: usize = 16;

/// Largest angle between directions of the same spot, as a cosine: 2 degrees.
const SPOT_COSINE: f32 = 0.9994;

/// Minimum share of an environment's light in a spot.
const MIN_SMALL_LIGHT_SHARE: f32 = 0.1;

/// Where a light is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightPlace {
    /// At infinity, in a unit direction.
    Far(Vec3),
    /// Around a point.
    Near(Vec3),
}

/// A light that is small.
#[derive(Clone, Copy, Debug)]
pub struct SmallLight {
    /// Where it is.
    pub place: LightPlace,
    /// Radius, metres; at infinity half its angle, radians.
    pub size: f32,
}

impl Lights {
    /// The brightest small lights.
    pub fn small_lights(&self, textures: &CompiledTextures) -> Vec<SmallLight> {
        let mut far: Vec<(f32, SmallLight)> = Vec::new();
        let mut near: Vec<(f32, SmallLight)> = Vec::new();
        for light in self.punctual() {
            let place = match (light.origin(), light.sun()) {
                (LightOrigin::Point(position), _) => {
                    let power = light.bounds(textures).map_or(0.0, |bounds| bounds.weight);
                    near.push((power, SmallLight { place: LightPlace::Near(position), size: 0.0 }));
                    continue;
                }
                (LightOrigin::Direction(to), _) => (to, 0.0),
                (LightOrigin::Cone, Some(sun)) => (sun.center(), sun.half_angle()),
                (LightOrigin::Cone, None) => continue,
            };
            let small = SmallLight { place: LightPlace::Far(place.0), size: place.1 };
            far.push((light.irradiance().unwrap_or(0.0), small));
        }
        for light in self.area() {
            let power = light.bounds(textures).map_or(0.0, |bounds| bounds.weight);
            near.push((power, SmallLight { place: LightPlace::Near(light.middle()), size: radius(light) }));
        }
        if let Some((share, spot)) = self.environment().and_then(spot_of) {
            far.push((share, spot));
        }
        let brightest = |mut list: Vec<(f32, SmallLight)>| {
            list.retain(|(power, _)| *power > 0.0);
            list.sort_by(|(a, _), (b, _)| b.total_cmp(a));
            list.into_iter().take(MAX_LIGHTS).map(|(_, light)| light)
        };
        brightest(far).chain(brightest(near)).collect()
    }
}

/// Radius of a disk of the same size.
fn radius(light: &AreaLight) -> f32 {
    let sides = if matches!(light.shape, AreaShape::Analytic(_)) { 4.0 } else { 1.0 };
    (light.area() / (sides * PI)).sqrt()
}

/// The brightest spot of an environment, and the luminance of the irradiance that it gives.
fn spot_of(environment: &EnvironmentLight) -> Option<(f32, SmallLight)> {
    environment.image_map()?;
    let at = |k: usize| (k as f32 + 0.5) / GRID as f32;
    let directions: Vec<Vec3> =
        (0..GRID * GRID).map(|k| environment.sample([at(k % GRID), at(k / GRID)]).direction).collect();
    let near = |middle: Vec3| directions.iter().filter(move |d| d.dot(middle) >= SPOT_COSINE);
    let densest = *directions.iter().max_by_key(|middle| near(**middle).count())?;
    let mean: Vec3 = near(densest).sum();
    let (middle, count) = (mean.try_normalize()?, near(densest).count() as f32);
    let share = count / directions.len() as f32;
    let spread = near(densest).map(|d| (*d - middle).length_squared()).sum::<f32>() / count;
    // A uniform disk is wider than its root mean square by the root of two.
    let light = SmallLight { place: LightPlace::Far(middle), size: (2.0 * spread).sqrt() };
    (share >= MIN_SMALL_LIGHT_SHARE).then_some((share * environment.mean_luminance() * 4.0 * PI, light))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::{Chi2, Square};

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
    fn the_largest_sphere_decides_what_is_far() {
        let targets = targets();
        assert!(!targets.is_farther(Vec3::ZERO, 3.1));
        assert!(targets.is_farther(Vec3::ZERO, 2.9));
        assert!(!TargetSpheres::default().is_farther(Vec3::ZERO, 1.0));
    }

    #[test]
    fn directions_have_their_density() {
        let targets = targets();
        assert_eq!(targets.spheres().len(), 3);
        let places = [Vec3::ZERO, Vec3::new(-1.0, 0.3, 2.0), Vec3::new(0.1, 0.0, 2.9)];
        for (p, around) in places.into_iter().flat_map(|p| [(p, 0.0), (p, 0.6)]) {
            let total = targets.solid_angle_around(p, around);
            let mut sums = [0.0f64; 2];
            let n = 40_000u32;
            for i in 0..n {
                let u =
                    [i.wrapping_mul(0xd1b5_4a33), i.wrapping_mul(0xab98_3a35), i.wrapping_mul(0x8f9d_1c75)];
                let chosen =
                    targets.direction(p, around, u.map(crate::sampling::hash::unit)).expect("spheres");
                // The measure of the union of the cones, against an even count over all directions.
                sums[0] += 1.0 / f64::from(chosen.pdf) / f64::from(n);
                let [a, b, _] = u.map(crate::sampling::hash::unit);
                let even = warp::uniform_sphere([a, b]);
                let is_in_one =
                    targets.spheres().iter().any(|sphere| sphere.cone_from(p, around).contains(even));
                sums[1] += f64::from(u8::from(is_in_one)) * 4.0 * std::f64::consts::PI / f64::from(n);
            }
            assert!((sums[0] / sums[1] - 1.0).abs() < 0.02, "{p} {around}: {sums:?} of {total}");
        }
    }

    #[test]
    fn a_single_sphere_is_hit_uniformly() {
        let targets = TargetSpheres::new([TargetSphere { center: Vec3::new(0.0, 2.0, 0.0), radius: 1.0 }]);
        Chi2::new("targets", 1).assert_directions(
            &Square::sphere(),
            |u| targets.direction(Vec3::ZERO, 0.0, [u[0], u[1], 0.5]).map(|chosen| chosen.at),
            |w| if w.y > 0.75f32.sqrt() { 1.0 / targets.solid_angle(Vec3::ZERO) } else { 0.0 },
        );
    }

    #[test]
    fn places_have_their_density() {
        let targets = targets();
        let n = 40_000u32;
        let mut area = 0.0;
        for i in 0..n {
            let u = [i.wrapping_mul(0xd1b5_4a33), i.wrapping_mul(0xab98_3a35), i.wrapping_mul(0x8f9d_1c75)];
            let chosen = targets.place(Vec3::Z, u.map(crate::sampling::hash::unit)).expect("spheres");
            area += 1.0 / f64::from(chosen.pdf) / f64::from(n);
        }
        // Two circles that overlap, and one beside.
        let (r, s, d) = (1.0f64, 0.9f64, (0.7f64 * 0.7 + 0.04).sqrt());
        let a = r * r * ((d * d + r * r - s * s) / (2.0 * d * r)).acos();
        let b = s * s * ((d * d + s * s - r * r) / (2.0 * d * s)).acos();
        let c = 0.5 * ((-d + r + s) * (d + r - s) * (d - r + s) * (d + r + s)).sqrt();
        let expected = std::f64::consts::PI * (r * r + s * s + 0.25) - (a + b - c);
        assert!((area / expected - 1.0).abs() < 0.01, "{area} {expected}");
    }
}
