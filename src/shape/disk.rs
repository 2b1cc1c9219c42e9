//! Disks: intersected in double precision, sampled uniformly by area. (Solid-angle sampling needs elliptic integrals: Guillén, Ureña,
//! King, Fajardo, Georgiev, López-Moreno, Jarabo 2017.)

use super::sphere::icosphere;
use super::traits::{LightPoint, Parametrization, PreparedRay, Shape, Surface, dot, pdf_solid_angle_of_area};
use crate::math::{Bounds3, DVec3, Frame, Mat3, Ray, Vec2, Vec3, gamma, orthonormal_basis, select};
use crate::sampling::warp;
use crate::scene::{self, Mesh};
use crate::simd::map_each;
use std::f32::consts::PI;

/// A flat disk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disk {
    /// Centre, metres.
    pub center: Vec3,
    /// Front normal with the length of the radius, metres. (A single vector, so that all code agrees on the plane.)
    pub axis: Vec3,
}

impl Disk {
    /// The disk of a scene's shape, around `center`.
    pub(super) fn of_scene(shape: &scene::Shape, center: Vec3) -> Disk {
        Disk { center, axis: (shape.rotation * (DVec3::Z * shape.radius)).as_vec3() }
    }

    #[inline(always)]
    pub(super) fn unpack(parameters: &[f32; 6]) -> Disk {
        let [x, y, z, a, b, c] = *parameters;
        Disk { center: Vec3::new(x, y, z), axis: Vec3::new(a, b, c) }
    }

    /// The unit disk facing z, as a fan of 256 triangles, with texture coordinates: x to the right, y up.
    pub(super) fn mesh() -> Mesh {
        const SECTORS: u32 = 256;
        let mut mesh = Mesh { positions: vec![[0.0; 3]], ..Mesh::default() };
        for i in 0..SECTORS {
            let (sine, cosine) = (std::f64::consts::TAU * f64::from(i) / f64::from(SECTORS)).sin_cos();
            mesh.positions.push([cosine as f32, sine as f32, 0.0]);
            mesh.triangles.push([0, i + 1, (i + 1) % SECTORS + 1]);
        }
        let uv = |p: &[f32; 3]| [0.5 + 0.5 * p[0], 0.5 - 0.5 * p[1]];
        mesh.uv_sets = vec![mesh.positions.iter().map(uv).collect()];
        mesh
    }

    /// Radius, metres.
    #[inline(always)]
    pub fn radius(&self) -> f32 {
        self.axis.length()
    }

    /// Unit normal of the front; zero for a radius of 0.
    #[inline(always)]
    fn unit_normal(&self) -> Vec3 {
        self.axis.normalize_or_zero()
    }
}

/// The vector from a ray's origin to the centre of a disk.
#[inline(always)]
fn to_center(center: Vec3, ray: &PreparedRay) -> [f64; 3] {
    let center = center.to_array();
    std::array::from_fn(|k| f64::from(center[k]) - f64::from(ray.origin[k]))
}

/// Ray parameter of the intersection with a disk perpendicular to `axis` (of any length); `f` is the centre relative to the ray's
/// origin.
#[inline(always)]
fn intersect_plane(ray: &PreparedRay, f: [f64; 3], axis: [f64; 3], squared_radius: f64) -> Option<f32> {
    let d = map_each(ray.direction, f64::from);
    let t = dot(f, axis) / dot(d, axis);
    let from_center: [f64; 3] = std::array::from_fn(|k| t * d[k] - f[k]);
    // NaN and infinity, for rays parallel to the plane, fail this test or the range tests.
    (dot(from_center, from_center) <= squared_radius).then_some(t as f32)
}

/// The surface of a disk, with the point projected onto its plane.
#[inline(always)]
fn surface_of_disk(p: Vec3, center: Vec3, radius: f32, ng: Vec3) -> Surface {
    let offset = p - center;
    let p = center + (offset - ng * offset.dot(ng));
    let p_error = Vec3::splat(radius * gamma(8)) + center.abs() * gamma(2);
    Surface { p, p_error, ng, ns: ng, material: 0 }
}

impl Shape for Disk {
    fn center_and_radius(&self) -> (Vec3, f32) {
        (self.center, self.radius())
    }

    fn bounds(&self) -> Bounds3 {
        // The half extent along x is sqrt(y^2 + z^2) for the axis (x, y, z), and so on.
        let a = self.axis.as_dvec3();
        let across = |a: f64, b: f64| ((a * a + b * b).sqrt() as f32).next_up();
        let half = Vec3::new(across(a.y, a.z), across(a.z, a.x), across(a.x, a.y));
        Bounds3 { min: self.center - half, max: self.center + half }
    }

    #[inline(always)]
    fn normal(&self) -> Option<Vec3> {
        Some(self.unit_normal())
    }

    #[inline(always)]
    fn intersect(&self, ray: &PreparedRay, t_min: f32, t_max: f32) -> Option<f32> {
        let axis = map_each(self.axis.to_array(), f64::from);
        let f = to_center(self.center, ray);
        intersect_plane(ray, f, axis, dot(axis, axis)).filter(|t| *t > t_min && *t <= t_max)
    }

    /// Projects the point onto the plane.
    #[inline(always)]
    fn surface(&self, p: Vec3, _: Vec3) -> Surface {
        surface_of_disk(p, self.center, self.radius(), self.unit_normal())
    }

    /// Texture coordinates of the square around the disk: x of object space to the right, y up; z is the front's normal.
    #[inline]
    fn texture_coordinates(&self, point: Vec3, _: Vec3, object_from_world: &Mat3) -> Vec2 {
        let local = *object_from_world * (point - self.center) * (0.5 / self.radius());
        Vec2::new(0.5 + local.x, 0.5 - local.y)
    }

    #[inline]
    fn parametrize(&self, _: Vec3, object_from_world: &Mat3) -> Parametrization {
        Parametrization {
            tangent: object_from_world.transpose().x_axis,
            handedness: 1.0,
            uv_per_metre: 0.5 / self.radius(),
        }
    }

    fn area(&self) -> f32 {
        PI * self.axis.length_squared()
    }

    fn largest_projection(&self) -> f32 {
        self.area()
    }

    #[inline(always)]
    fn normal_at(&self, _: Vec3, _: Vec3) -> Vec3 {
        self.unit_normal()
    }

    fn point_by_area(&self, u: [f32; 2]) -> Vec3 {
        let Vec2 { x, y } = warp::uniform_disk(u) * self.radius();
        let (tangent, bitangent) = orthonormal_basis(self.unit_normal());
        self.center + tangent * x + bitangent * y
    }

    #[inline(always)]
    fn sample(&self, reference: Vec3, u: [f32; 2]) -> LightPoint {
        let point = self.point_by_area(u);
        LightPoint { point, pdf_solid_angle: self.pdf_solid_angle(reference, point) }
    }

    #[inline(always)]
    fn pdf_solid_angle(&self, reference: Vec3, point: Vec3) -> f32 {
        pdf_solid_angle_of_area(point - reference, self.unit_normal(), self.area())
    }

    fn parameters(&self) -> [f32; 6] {
        let ([x, y, z], [a, b, c]) = (self.center.to_array(), self.axis.to_array());
        [x, y, z, a, b, c]
    }
}

/// A disk whose front faces the origin of each ray: a light with soft falloff. At distance d a disk of radius r subtends a cone with a
/// half angle of tangent r / d, so its irradiance is bounded by that of a hemisphere of its radiance, and falls off with the squared
/// distance far away. (As Cycles' point and spot lights with "Soft Falloff".)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacingDisk {
    /// Centre, metres.
    pub center: Vec3,
    /// Radius, metres, above 0.
    pub radius: f32,
}

impl FacingDisk {
    /// The facing disk of a scene's shape, around `center`.
    pub(super) fn of_scene(shape: &scene::Shape, center: Vec3) -> FacingDisk {
        FacingDisk { center, radius: shape.radius as f32 }
    }

    #[inline(always)]
    pub(super) fn unpack(parameters: &[f32; 6]) -> FacingDisk {
        let [x, y, z, radius, ..] = *parameters;
        FacingDisk { center: Vec3::new(x, y, z), radius }
    }

    /// Tessellation of the bounding sphere.
    pub(super) fn mesh() -> Mesh {
        icosphere(6)
    }

    /// One minus the cosine of the half angle of the cone subtended at a distance.
    #[inline(always)]
    fn one_minus_cos(&self, distance: f32) -> f32 {
        // Relative to the larger of both, to avoid overflow of squares.
        let larger = if distance > self.radius { distance } else { self.radius };
        let (d, r) = (distance / larger, self.radius / larger);
        let squares = d * d + r * r;
        let omc = warp::one_minus_cos(r * r / squares, d * d / squares);
        // Beyond 1e17 radii the pdf would overflow.
        if omc > 1e-35 { omc } else { 1e-35 }
    }
}

impl Shape for FacingDisk {
    fn center_and_radius(&self) -> (Vec3, f32) {
        (self.center, self.radius)
    }

    #[inline(always)]
    fn is_flat(&self) -> bool {
        true
    }

    #[inline(always)]
    fn intersect(&self, ray: &PreparedRay, t_min: f32, t_max: f32) -> Option<f32> {
        let (f, r) = (to_center(self.center, ray), f64::from(self.radius));
        intersect_plane(ray, f, f, r * r).filter(|t| *t > t_min && *t <= t_max)
    }

    /// Projects the point onto the disk.
    #[inline(always)]
    fn surface(&self, p: Vec3, origin: Vec3) -> Surface {
        surface_of_disk(p, self.center, self.radius, self.normal_at(p, origin))
    }

    /// The centre of the texture, since facing disks have no parametrization.
    #[inline]
    fn texture_coordinates(&self, _: Vec3, _: Vec3, _: &Mat3) -> Vec2 {
        Vec2::splat(0.5)
    }

    #[inline]
    fn parametrize(&self, normal: Vec3, _: &Mat3) -> Parametrization {
        let tangent = orthonormal_basis(normal).0;
        Parametrization { tangent, handedness: 1.0, uv_per_metre: 0.5 / self.radius }
    }

    /// Area of the bounding sphere, which has the same far field.
    fn area(&self) -> f32 {
        4.0 * PI * self.radius * self.radius
    }

    fn largest_projection(&self) -> f32 {
        PI * self.radius * self.radius
    }

    #[inline(always)]
    fn normal_at(&self, _: Vec3, reference: Vec3) -> Vec3 {
        let to_reference = reference - self.center;
        let scale = to_reference.length_recip();
        select(scale.is_finite() & (scale > 0.0), to_reference * scale, Vec3::Z)
    }

    /// A point of the bounding sphere.
    fn point_by_area(&self, u: [f32; 2]) -> Vec3 {
        self.center + warp::uniform_sphere(u) * self.radius
    }

    #[inline(always)]
    fn sample(&self, reference: Vec3, u: [f32; 2]) -> LightPoint {
        let axis = self.center - reference;
        let distance = axis.length();
        let omc = self.one_minus_cos(distance);
        let local = warp::uniform_cone(u, omc);
        let frame = Frame::from_normal(if distance > 0.0 { axis / distance } else { Vec3::Z });
        // Computed relative to the centre, so that distant disks lose no precision.
        let along = distance / if local.z > 1e-9 { local.z } else { 1e-9 };
        let point = self.center + (frame.s * local.x + frame.t * local.y) * along;
        LightPoint { point, pdf_solid_angle: warp::uniform_cone_pdf_solid_angle(omc) }
    }

    #[inline(always)]
    fn pdf_solid_angle(&self, reference: Vec3, _: Vec3) -> f32 {
        let distance = (self.center - reference).length();
        warp::uniform_cone_pdf_solid_angle(self.one_minus_cos(distance))
    }

    fn is_facing(&self) -> bool {
        true
    }

    /// Emitted rays start at their point nearest to the centre. The disk facing the receiver intersects them slightly behind it.
    fn emission_offset(&self, receiver: Vec3, ray: &Ray) -> Option<f32> {
        let to_center_of_disk = (self.center - receiver).as_dvec3();
        let along = -to_center_of_disk.dot(ray.direction.as_dvec3());
        let (squared, r) = (to_center_of_disk.length_squared(), f64::from(self.radius));
        let across = squared - along * along;
        // The tangent of the angle to the centre must be at most r / d.
        let is_on_disk = along > 0.0 && across * squared <= r * r * along * along;
        is_on_disk.then(|| (across.max(0.0) / along) as f32)
    }

    fn parameters(&self) -> [f32; 6] {
        let [x, y, z] = self.center.to_array();
        [x, y, z, self.radius, 0.0, 0.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::{Accel, Geometry};
    use crate::math::{Hit, Ray, offset_ray_origin};
    use crate::sampling::chi2::Random;
    use crate::shape::Analytic;

    fn disk() -> Disk {
        Disk { center: Vec3::new(10.0, -3.0, 0.5), axis: Vec3::new(0.3, -1.2, 0.9) }
    }

    #[test]
    fn bounding_boxes_are_tight() {
        let disk = disk();
        let (x, y) = orthonormal_basis(disk.unit_normal());
        let rim = (0..100_000).map(|i| {
            let (sin, cos) = (i as f32 * (2.0 * PI / 100_000.0)).sin_cos();
            disk.center + (x * cos + y * sin) * disk.radius()
        });
        let (found, expected) = (disk.bounds(), Bounds3::of(rim));
        assert!((found.min - expected.min).abs().max_element() < 2e-6, "{found:?} {expected:?}");
        assert!((found.max - expected.max).abs().max_element() < 2e-6, "{found:?} {expected:?}");
    }

    #[test]
    fn texture_coordinates_cover_the_unit_square() {
        let disk = Disk { center: Vec3::new(1.0, 2.0, 3.0), axis: Vec3::Z * 0.5 };
        let at = |x: f32, y: f32| {
            let point = disk.center + Vec3::new(x, y, 0.0) * 0.5;
            disk.texture_coordinates(point, Vec3::Z, &Mat3::IDENTITY)
        };
        assert_eq!(at(0.0, 0.0), Vec2::splat(0.5));
        assert_eq!([at(-1.0, 0.0), at(1.0, 0.0)], [Vec2::new(0.0, 0.5), Vec2::new(1.0, 0.5)]);
        assert_eq!([at(0.0, 1.0), at(0.0, -1.0)], [Vec2::new(0.5, 0.0), Vec2::new(0.5, 1.0)]);
        let parametrization = disk.parametrize(Vec3::Z, &Mat3::IDENTITY);
        assert_eq!(
            (parametrization.tangent, parametrization.handedness, parametrization.uv_per_metre),
            (Vec3::X, 1.0, 1.0)
        );
    }

    /// Rays that continue from a hit, on either side, don't intersect the disk again; rays aimed outside of the rim miss it.
    #[test]
    fn rays_hit_a_disk_once() {
        let disk = disk();
        let geometry = Geometry { analytic: vec![Analytic::Disk(disk)], ..Geometry::default() };
        let accel = Accel::build(&[geometry], &[]);
        let mut random = Random::new(3);
        let (mut hits, mut missed) = (0, 0);
        for _ in 0..20_000 {
            let origin = disk.center + random.direction() * (4.0 * random.next() + 0.1);
            let aim = disk.point_by_area([random.next(), random.next()]);
            let aim = disk.center + (aim - disk.center) * (2.0 * random.next());
            let ray = Ray::new(origin, (aim - origin).normalize());
            let hit = accel.closest_one(&ray);
            let inside = (aim - disk.center).length() / disk.radius();
            if (inside - 1.0).abs() > 1e-4 && (origin - disk.center).dot(disk.unit_normal()).abs() > 1e-3 {
                assert_eq!(hit.is_hit(), inside < 1.0, "{ray:?}");
            }
            if hit.is_hit() {
                hits += 1;
                let surface = disk.surface(ray.at(hit.t), origin);
                let direction = random.direction();
                let origin = offset_ray_origin(surface.p, surface.p_error, surface.ng, direction);
                assert_eq!(accel.closest_one(&Ray::new(origin, direction)), Hit::MISS);
            } else {
                missed += 1;
            }
        }
        assert!(hits > 5_000 && missed > 5_000, "{hits} {missed}");
    }
}

#[cfg(test)]
mod facing_disk_tests {
    use super::*;
    use crate::accel::{Accel, Geometry};
    use crate::sampling::chi2::{Chi2, Random, SphericalDomain};
    use crate::shape::Analytic;

    fn disk() -> FacingDisk {
        FacingDisk { center: Vec3::new(10.0, -3.0, 0.5), radius: 1.2 }
    }

    /// Rays to sampled points hit the disk, and the fraction of random rays that hit it agrees with the pdf, at various distances, also
    /// within the bounding sphere.
    #[test]
    fn rays_hit_sampled_points() {
        let disk = disk();
        let geometry = Geometry { analytic: vec![Analytic::FacingDisk(disk)], ..Geometry::default() };
        let accel = Accel::build(&[geometry], &[]);
        let mut random = Random::new(5);
        for distance in [0.01, 0.3, 1.0, 1.3, 4.0, 300.0] {
            let origin = disk.center + random.direction() * distance;
            let mut hits = 0u32;
            let n = 20_000;
            for _ in 0..n {
                let sample = disk.sample(origin, [random.next(), random.next()]);
                let toward = (sample.point - origin).normalize();
                let hit = accel.closest_one(&Ray::new(origin, toward));
                let inside = sample.point.distance(disk.center) / disk.radius;
                assert!(hit.is_hit() || inside > 0.9999, "{distance} {inside}");
                assert!(inside < 1.0001, "{distance} {inside}");
                if hit.is_hit() {
                    let at = Ray::new(origin, toward).at(hit.t);
                    let surface = disk.surface(at, origin);
                    assert!(surface.ng.dot(toward) < 0.0);
                    assert!((surface.p - at).length() < 1e-4 * distance.max(1.0));
                }
                // Uniform over twice the solid angle of the cone.
                let omc = 2.0 * disk.one_minus_cos(distance);
                let local = warp::uniform_cone([random.next(), random.next()], omc);
                let axis = (disk.center - origin).normalize();
                let ray = Ray::new(origin, Frame::from_normal(axis).to_world(local));
                hits += u32::from(accel.closest_one(&ray).is_hit());
            }
            let fraction = f64::from(hits) / f64::from(n);
            assert!((fraction - 0.5).abs() < 4.5 * (0.25 / f64::from(n)).sqrt(), "{distance}: {fraction}");
        }
    }

    #[test]
    fn sampled_directions_follow_their_pdf() {
        let disk = disk();
        let references = [[0.0f32, 0.5, 0.0], [1.0, 0.3, -0.7], [3.0, 4.0, 12.0]];
        for from in references {
            let origin = disk.center + Vec3::from_array(from);
            let pdf = disk.pdf_solid_angle(origin, disk.center);
            let axis = (disk.center - origin).normalize();
            let edge = 1.0 - disk.one_minus_cos(origin.distance(disk.center));
            Chi2::new("facing disk", references.len()).assert_directions(
                &SphericalDomain::sphere(),
                |u| Some((disk.sample(origin, [u[0], u[1]]).point - origin).normalize()),
                |w| if w.dot(axis) > edge { pdf } else { 0.0 },
            );
        }
    }

    /// An emitted ray reaches a receiver exactly if the reverse ray from the receiver hits the disk.
    #[test]
    fn emission_agrees_with_intersection() {
        let disk = disk();
        let mut random = Random::new(9);
        let (mut sent, mut lost) = (0, 0);
        for _ in 0..20_000 {
            let direction = random.direction();
            let offset = warp::uniform_disk([random.next(), random.next()]) * disk.radius;
            let origin = disk.center + Frame::from_normal(direction).to_world(offset.extend(0.0));
            let ray = Ray::new(origin, direction);
            let receiver = ray.at(0.05 + 3.0 * random.next());
            let mut back = PreparedRay::NONE;
            let range = back.set_line(&Ray::new(receiver, -direction)).expect("a line").0;
            let visible = disk.intersect(&back, range.0, range.1).map(|t| t * back.unscale);
            let behind = disk.emission_offset(receiver, &ray);
            if let (Some(visible), Some(behind)) = (visible, behind) {
                let t = receiver.distance(origin) + behind;
                assert!((t - visible).abs() < 1e-5 * t.max(1.0), "{visible} {t}");
                sent += 1;
            } else if visible.is_none() && behind.is_none() {
                lost += 1;
            } else {
                let rim = (receiver - disk.center).length() * offset.length() / disk.radius;
                let along = (receiver - origin).length();
                assert!((rim / along - 1.0).abs() < 1e-4, "{rim} {along}");
            }
        }
        assert!(sent > 5_000 && lost > 1_000, "{sent} {lost}");
    }
}
