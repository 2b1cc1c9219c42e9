//! Disks that turn to the origin of each ray: lamps with a soft falloff. From a distance d a disk of radius r is a cone whose half angle
//! has the tangent r / d, so that an irradiance never exceeds that of a half space of the lamp's radiance, and falls off by the square
//! far away. (Cycles' point and spot lights are so where "Soft Falloff" is on.)

use super::disk;
use super::icosphere::icosphere;
use super::point::{LightPoint, Surface};
use super::ray::PreparedRay;
use super::traits::{Parametrization, Shape};
use crate::math::{Bounds3, Frame, Mat3, Ray, Vec2, Vec3, orthonormal_basis};
use crate::sampling::warp;
use crate::scene::{self, Mesh};
use std::f32::consts::PI;

/// A disk whose front faces the origin of each ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacingDisk {
    /// Its middle.
    pub center: Vec3,
    /// Above 0.
    pub radius: f32,
}

impl FacingDisk {
    /// That of a scene around `center`.
    pub(super) fn of_scene(shape: &scene::Shape, center: Vec3) -> FacingDisk {
        FacingDisk { center, radius: shape.radius as f32 }
    }

    /// That of packed numbers.
    #[inline(always)]
    pub(super) fn unpack(numbers: &[f32; 6]) -> FacingDisk {
        let [x, y, z, radius, ..] = *numbers;
        FacingDisk { center: Vec3::new(x, y, z), radius }
    }

    /// The sphere around all of its places.
    pub(super) fn mesh() -> Mesh {
        icosphere(6)
    }

    /// 1 - the cosine of the half angle of the cone that it is, seen from a point at this distance.
    #[inline(always)]
    fn one_minus_cos(&self, distance: f32) -> f32 {
        // As shares of the larger, so that no square overflows.
        let larger = if distance > self.radius { distance } else { self.radius };
        let (d, r) = (distance / larger, self.radius / larger);
        let squares = d * d + r * r;
        let omc = warp::one_minus_cos(r * r / squares, d * d / squares);
        // Beyond 1e17 radii the density would overflow.
        if omc > 1e-35 { omc } else { 1e-35 }
    }
}

impl Shape for FacingDisk {
    fn center_and_radius(&self) -> (Vec3, f32) {
        (self.center, self.radius)
    }

    fn bounds(&self) -> Bounds3 {
        let half = Vec3::splat(self.radius);
        Bounds3 { min: self.center - half, max: self.center + half }
    }

    #[inline(always)]
    fn is_flat(&self) -> bool {
        true
    }

    #[inline(always)]
    fn normal(&self) -> Option<Vec3> {
        None
    }

    #[inline(always)]
    fn intersect(&self, ray: &PreparedRay, t_min: f32, t_max: f32) -> Option<f32> {
        let (f, r) = (disk::to_center(self.center, ray), f64::from(self.radius));
        disk::intersect_plane(ray, f, f, r * r).filter(|t| *t > t_min && *t <= t_max)
    }

    /// The ray's point pulled back onto the disk.
    #[inline(always)]
    fn surface(&self, p: Vec3, origin: Vec3) -> Surface {
        disk::surface(p, self.center, self.radius, self.normal_at(p, origin))
    }

    /// The middle of the picture: what turns has no place for one.
    #[inline]
    fn texture_coordinates(&self, _: Vec3, _: Vec3, _: &Mat3) -> Vec2 {
        Vec2::splat(0.5)
    }

    #[inline]
    fn parametrize(&self, normal: Vec3, _: &Mat3) -> Parametrization {
        let tangent = orthonormal_basis(normal).0;
        Parametrization { tangent, handedness: 1.0, uv_per_metre: 0.5 / self.radius }
    }

    /// That of the sphere which sends as much light far away.
    fn area(&self) -> f32 {
        4.0 * PI * self.radius * self.radius
    }

    fn largest_projection(&self) -> f32 {
        PI * self.radius * self.radius
    }

    #[inline(always)]
    fn normal_at(&self, _: Vec3, reference: Vec3) -> Vec3 {
        (reference - self.center).normalize_or(Vec3::Z)
    }

    /// A point of the sphere that holds it.
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
        // From the middle, so that points far away keep their places.
        let along = distance / if local.z > 1e-9 { local.z } else { 1e-9 };
        let point = self.center + (frame.s * local.x + frame.t * local.y) * along;
        LightPoint { point, pdf_solid_angle: warp::uniform_cone_pdf_solid_angle(omc) }
    }

    #[inline(always)]
    fn pdf_solid_angle(&self, reference: Vec3, _: Vec3) -> f32 {
        let distance = (self.center - reference).length();
        warp::uniform_cone_pdf_solid_angle(self.one_minus_cos(distance))
    }

    fn turns(&self) -> bool {
        true
    }

    /// Rays of light start where they are nearest to the middle. The disk that faces the receiver is a little further back, except
    /// in its middle.
    fn starts_behind(&self, receiver: Vec3, ray: &Ray) -> Option<f32> {
        let to_middle = (self.center - receiver).as_dvec3();
        let along = -to_middle.dot(ray.direction.as_dvec3());
        let (squared, r) = (to_middle.length_squared(), f64::from(self.radius));
        let across = squared - along * along;
        // The tangent of the angle to the middle is at most r / d.
        let is_on_disk = along > 0.0 && across * squared <= r * r * along * along;
        is_on_disk.then(|| (across.max(0.0) / along) as f32)
    }

    fn numbers(&self) -> [f32; 6] {
        let [x, y, z] = self.center.to_array();
        [x, y, z, self.radius, 0.0, 0.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::{Accel, Geometry};
    use crate::sampling::chi2::{Chi2, Random, Square};
    use crate::shape::Analytic;

    fn disk() -> FacingDisk {
        FacingDisk { center: Vec3::new(10.0, -3.0, 0.5), radius: 1.2 }
    }

    /// From near, far, and within the sphere around it: rays hit it where its points are, as often as their density says.
    #[test]
    fn rays_meet_what_is_sampled() {
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
                // Even over twice the cone.
                let omc = 2.0 * disk.one_minus_cos(distance);
                let local = warp::uniform_cone([random.next(), random.next()], omc);
                let axis = (disk.center - origin).normalize();
                let ray = Ray::new(origin, Frame::from_normal(axis).to_world(local));
                hits += u32::from(accel.closest_one(&ray).is_hit());
            }
            let share = f64::from(hits) / f64::from(n);
            assert!((share - 0.5).abs() < 4.5 * (0.25 / f64::from(n)).sqrt(), "{distance}: {share}");
        }
    }

    #[test]
    fn directions_have_their_density() {
        let disk = disk();
        let references = [[0.0f32, 0.5, 0.0], [1.0, 0.3, -0.7], [3.0, 4.0, 12.0]];
        for from in references {
            let origin = disk.center + Vec3::from_array(from);
            let pdf = disk.pdf_solid_angle(origin, disk.center);
            let axis = (disk.center - origin).normalize();
            let edge = 1.0 - disk.one_minus_cos(origin.distance(disk.center));
            Chi2::new("facing disk", references.len()).assert_directions(
                &Square::sphere(),
                |u| Some((disk.sample(origin, [u[0], u[1]]).point - origin).normalize()),
                |w| if w.dot(axis) > edge { pdf } else { 0.0 },
            );
        }
    }

    /// What lines leave it in some direction bring light to a receiver just where rays from there hit it.
    #[test]
    fn light_arrives_where_it_is_seen() {
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
            let seen = disk.intersect(&back, range.0, range.1).map(|t| t * back.unscale);
            let behind = disk.starts_behind(receiver, &ray);
            if let (Some(seen), Some(behind)) = (seen, behind) {
                let t = receiver.distance(origin) + behind;
                assert!((t - seen).abs() < 1e-5 * t.max(1.0), "{seen} {t}");
                sent += 1;
            } else if seen.is_none() && behind.is_none() {
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
