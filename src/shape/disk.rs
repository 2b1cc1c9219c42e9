//! Flat disks: rays meet the plane in double precision; points of light are uniform by area. (Sampling by solid angle
//! takes elliptic integrals: Guillén, Ureña, King, Fajardo, Georgiev, López-Moreno, Jarabo 2017.)

use super::point::{LightPoint, Surface, pdf_solid_angle_of_area};
use super::ray::PreparedRay;
use super::traits::{Parametrization, Shape};
use crate::math::{Bounds3, DVec3, Mat3, Vec2, Vec3, gamma, orthonormal_basis};
use crate::sampling::warp;
use crate::scene::{self, Mesh};
use crate::simd::map_each;
use std::f32::consts::PI;

/// A flat disk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disk {
    /// Its middle.
    pub center: Vec3,
    /// Away from its front, as long as its radius. (One vector for both, so that all code sees the same plane.)
    pub axis: Vec3,
}

impl Disk {
    /// The disk of a scene around `center`.
    pub(super) fn of_scene(shape: &scene::Shape, center: Vec3) -> Disk {
        Disk { center, axis: (shape.rotation * (DVec3::Z * shape.radius)).as_vec3() }
    }

    /// The disk of packed numbers.
    #[inline(always)]
    pub(super) fn unpack(numbers: &[f32; 6]) -> Disk {
        let [x, y, z, a, b, c] = *numbers;
        Disk { center: Vec3::new(x, y, z), axis: Vec3::new(a, b, c) }
    }

    /// The unit disk that faces z, as 256 triangles around its middle, with texture coordinates: x to the right, y up.
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

    /// Its radius.
    #[inline(always)]
    pub fn radius(&self) -> f32 {
        self.axis.length()
    }

    /// The front's unit normal; zero for a disk without a radius.
    #[inline(always)]
    fn unit_normal(&self) -> Vec3 {
        self.axis.normalize_or_zero()
    }
}

#[inline(always)]
pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// From a ray's origin to the middle of a disk.
#[inline(always)]
pub(super) fn to_center(center: Vec3, ray: &PreparedRay) -> [f64; 3] {
    let center = center.to_array();
    std::array::from_fn(|k| f64::from(center[k]) - f64::from(ray.origin[k]))
}

/// Where a ray intersects a disk across `axis`, of any length, with its middle at `f` from the ray's origin.
#[inline(always)]
pub(super) fn intersect_plane(
    ray: &PreparedRay,
    f: [f64; 3],
    axis: [f64; 3],
    squared_radius: f64,
) -> Option<f32> {
    let d = map_each(ray.direction, f64::from);
    let t = dot(f, axis) / dot(d, axis);
    let from_center: [f64; 3] = std::array::from_fn(|k| t * d[k] - f[k]);
    // NaN and infinity, where the ray is parallel to the plane, fail this test or those of a range.
    (dot(from_center, from_center) <= squared_radius).then_some(t as f32)
}

/// The surface of a disk, with a point pulled back onto its plane.
#[inline(always)]
pub(super) fn surface(p: Vec3, center: Vec3, radius: f32, ng: Vec3) -> Surface {
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
        // Along x it reaches as far as its axis does across x: r^2 - x^2 = y^2 + z^2.
        let a = self.axis.as_dvec3();
        let across = |a: f64, b: f64| ((a * a + b * b).sqrt() as f32).next_up();
        let half = Vec3::new(across(a.y, a.z), across(a.z, a.x), across(a.x, a.y));
        Bounds3 { min: self.center - half, max: self.center + half }
    }

    #[inline(always)]
    fn is_flat(&self) -> bool {
        true
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

    /// The ray's point pulled back onto the plane.
    #[inline(always)]
    fn surface(&self, p: Vec3, _: Vec3) -> Surface {
        surface(p, self.center, self.radius(), self.unit_normal())
    }

    /// The square around the disk, x of object space to the right and y up; z is the front's normal.
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

    fn numbers(&self) -> [f32; 6] {
        let ([x, y, z], [a, b, c]) = (self.center.to_array(), self.axis.to_array());
        [x, y, z, a, b, c]
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
    fn the_box_holds_the_rim_and_touches_it() {
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
    fn textures_touch_the_edge() {
        let disk = Disk { center: Vec3::new(1.0, 2.0, 3.0), axis: Vec3::Z * 0.5 };
        let at = |x: f32, y: f32| {
            let point = disk.center + Vec3::new(x, y, 0.0) * 0.5;
            disk.texture_coordinates(point, Vec3::Z, &Mat3::IDENTITY)
        };
        assert_eq!(at(0.0, 0.0), Vec2::splat(0.5));
        assert_eq!([at(-1.0, 0.0), at(1.0, 0.0)], [Vec2::new(0.0, 0.5), Vec2::new(1.0, 0.5)]);
        assert_eq!([at(0.0, 1.0), at(0.0, -1.0)], [Vec2::new(0.5, 0.0), Vec2::new(0.5, 1.0)]);
        let lies = disk.parametrize(Vec3::Z, &Mat3::IDENTITY);
        assert_eq!((lies.tangent, lies.handedness, lies.uv_per_metre), (Vec3::X, 1.0, 1.0));
    }

    /// Rays that go on from a hit, on either side, don't meet the disk again; nor do those that miss its edge.
    #[test]
    fn rays_meet_it_once() {
        let disk = disk();
        let geometry = Geometry { analytic: vec![Analytic::Disk(disk)], ..Geometry::default() };
        let accel = Accel::build(&[geometry], &[]);
        let mut random = Random::new(3);
        let (mut met, mut missed) = (0, 0);
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
                met += 1;
                let surface = disk.surface(ray.at(hit.t), origin);
                let direction = random.direction();
                let origin = offset_ray_origin(surface.p, surface.p_error, surface.ng, direction);
                assert_eq!(accel.closest_one(&Ray::new(origin, direction)), Hit::MISS);
            } else {
                missed += 1;
            }
        }
        assert!(met > 5_000 && missed > 5_000, "{met} {missed}");
    }
}
