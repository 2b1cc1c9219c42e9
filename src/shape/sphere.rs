//! Spheres: intersected in double precision without cancellation (Haines, Guenther, Akenine-Moeller, Ray Tracing Gems 2019, chapter 7);
//! as lights sampled over the subtended cone (Pharr, Jakob, Humphreys 2023, section 6.2.4), from inside over all directions.

use super::traits::{LightPoint, Parametrization, PreparedRay, Shape, Surface, dot};
use crate::math::{Bounds3, DVec3, Frame, Mat3, Ray, Vec2, Vec3, gamma, poly};
use crate::sampling::warp::{self, UNIFORM_SPHERE_PDF_SOLID_ANGLE};
use crate::scene::{self, Mesh};
use crate::simd::map_each;
use std::collections::HashMap;
use std::f32::consts::{FRAC_1_PI, PI, SQRT_2};

/// Minimum radius relative to the centre's coordinates for which normals are computed from points. Normals of smaller spheres point to
/// the viewer.
const MIN_RADIUS: f32 = 1e-5;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre, metres.
    pub center: Vec3,
    /// Radius, metres, above 0.
    pub radius: f32,
}

/// Texture coordinates of the unit sphere: u is the azimuth around the y axis, v the polar angle from the top, as in "Ray Tracing in One
/// Weekend" with v from the top row: u = (atan2(-z, x) + pi) / 2 pi, v = acos(y) / pi.
#[inline]
pub fn sphere_coordinates(unit: Vec3) -> Vec2 {
    Vec2::new((poly::atan2(-unit.z, unit.x) + PI) * (0.5 * FRAC_1_PI), poly::acos(unit.y) * FRAC_1_PI)
}

impl Sphere {
    /// The sphere of a scene's shape, around `center`.
    pub(super) fn of_scene(shape: &scene::Shape, center: Vec3) -> Sphere {
        Sphere { center, radius: shape.radius as f32 }
    }

    #[inline(always)]
    pub(super) fn unpack(parameters: &[f32; 6]) -> Sphere {
        let [x, y, z, radius, ..] = *parameters;
        Sphere { center: Vec3::new(x, y, z), radius }
    }

    /// The unit sphere as 81,920 triangles with smooth normals.
    pub(super) fn mesh() -> Mesh {
        icosphere(6)
    }

    /// The line parameters of both intersections, in increasing order.
    #[inline(always)]
    fn roots(&self, ray: &PreparedRay) -> Option<[f64; 2]> {
        let r = f64::from(self.radius);
        let d = map_each(ray.direction, f64::from);
        let center = self.center.to_array();
        let f: [f64; 3] = std::array::from_fn(|k| f64::from(ray.origin[k]) - f64::from(center[k]));
        let a = dot(d, d);
        let b = -dot(f, d);
        // l: the line's point nearest to the centre, relative to it; discriminant of eq. 7.3: r^2 - |l|^2.
        let l: [f64; 3] = std::array::from_fn(|k| f[k] + (b / a) * d[k]);
        let discriminant = r * r - dot(l, l);
        if discriminant < 0.0 || discriminant.is_nan() {
            return None;
        }
        let c = power_of_point(self, ray, f);
        let q = b + (a * discriminant).sqrt().copysign(b);
        let (first, second) = (c / q, q / a);
        Some(if first < second { [first, second] } else { [second, first] })
    }
}

impl Shape for Sphere {
    fn center_and_radius(&self) -> (Vec3, f32) {
        (self.center, self.radius)
    }

    #[inline(always)]
    fn intersect(&self, ray: &PreparedRay, t_min: f32, t_max: f32) -> Option<f32> {
        let [near, far] = self.roots(ray)?;
        let accept = |t: f64| {
            let t = t as f32;
            (t > t_min && t <= t_max).then_some(t)
        };
        accept(near).or_else(|| accept(far))
    }

    /// Projects the point onto the sphere.
    #[inline(always)]
    fn surface(&self, p: Vec3, _: Vec3) -> Surface {
        let ng = (p - self.center).normalize();
        let offset = ng * self.radius;
        Surface {
            p: self.center + offset,
            p_error: offset.abs() * gamma(7) + self.center.abs() * gamma(2),
            ng,
            ns: ng,
            material: 0,
        }
    }

    /// [`sphere_coordinates`] in object space.
    #[inline]
    fn texture_coordinates(&self, _: Vec3, normal: Vec3, object_from_world: &Mat3) -> Vec2 {
        sphere_coordinates(*object_from_world * normal)
    }

    #[inline]
    fn parametrize(&self, normal: Vec3, object_from_world: &Mat3) -> Parametrization {
        let local = *object_from_world * normal;
        Parametrization {
            // u increases counter-clockwise as seen from above.
            tangent: object_from_world.transpose() * Vec3::new(local.z, 0.0, -local.x),
            handedness: 1.0,
            // The texture covers 2 pi r by pi r metres at the equator: geometric mean.
            uv_per_metre: 1.0 / (SQRT_2 * PI * self.radius),
        }
    }

    fn area(&self) -> f32 {
        4.0 * PI * self.radius * self.radius
    }

    fn largest_projection(&self) -> f32 {
        PI * self.radius * self.radius
    }

    #[inline(always)]
    fn normal_at(&self, point: Vec3, reference: Vec3) -> Vec3 {
        // Rounding of points, up to 6e-8 of their coordinates, would change these normals by more than 1 %.
        if self.radius < MIN_RADIUS * self.center.abs().max_element() && reference != point {
            return (reference - self.center).normalize_or_zero();
        }
        (point - self.center) / self.radius
    }

    fn point_by_area(&self, u: [f32; 2]) -> Vec3 {
        self.center + warp::uniform_sphere(u) * self.radius
    }

    #[inline(always)]
    fn sample(&self, reference: Vec3, u: [f32; 2]) -> LightPoint {
        SphereSampler::new(self.center, self.radius, reference).sample(u)
    }

    #[inline(always)]
    fn pdf_solid_angle(&self, reference: Vec3, _: Vec3) -> f32 {
        SphereSampler::new(self.center, self.radius, reference).pdf_solid_angle()
    }

    fn parameters(&self) -> [f32; 6] {
        let [x, y, z] = self.center.to_array();
        [x, y, z, self.radius, 0.0, 0.0]
    }
}

/// `|f|^2 - r^2` for the ray's origin relative to the centre, `f = o - c`, with about twice the precision of f64 (compensated sums: Ogita,
/// Rump, Oishi 2005, "Accurate Sum and Dot Product"), because of cancellation near the surface.
#[inline(always)]
fn power_of_point(sphere: &Sphere, ray: &PreparedRay, f: [f64; 3]) -> f64 {
    let r = f64::from(sphere.radius);
    let center = sphere.center.to_array();
    let (mut sum, mut rest) = (-(r * r), 0.0);
    for (k, f) in f.into_iter().enumerate() {
        let (o, c) = (f64::from(ray.origin[k]), -f64::from(center[k]));
        let square = f * f;
        rest += f.mul_add(f, -square) + 2.0 * f * rounding_of_sum(o, c, f);
        let next = sum + square;
        rest += rounding_of_sum(sum, square, next);
        sum = next;
    }
    sum + rest
}

/// The rounding error of `sum`, the rounded `a + b` (Knuth's two-sum).
#[inline(always)]
fn rounding_of_sum(a: f64, b: f64, sum: f64) -> f64 {
    let part = sum - a;
    (a - (sum - part)) + (b - part)
}

/// Sampling of a sphere from a reference point.
#[derive(Clone, Copy, Debug)]
pub struct SphereSampler {
    center: Vec3,
    radius: f32,
    reference: Vec3,
    /// Frame with z from the reference point to the centre.
    frame: Frame,
    /// Squared sine, and one minus the cosine, of the cone's half angle.
    sin_squared_max: f32,
    one_minus_cos_max: f32,
    inside: bool,
}

impl SphereSampler {
    /// A sphere of positive radius, seen from `reference`.
    #[inline(always)]
    pub fn new(center: Vec3, radius: f32, reference: Vec3) -> SphereSampler {
        let axis = center - reference;
        let distance = axis.length();
        let inside = distance <= radius;
        let safe = if distance > 0.0 { distance } else { 1.0 };
        let direction = if distance > 0.0 { axis / safe } else { Vec3::Z };
        let sine = radius / safe;
        let sin_squared = sine * sine;
        // (d - r)(d + r) / d^2: accurate for a point just above the surface.
        let cos_squared = ((safe - radius) / safe) * ((safe + radius) / safe);
        let omc = warp::one_minus_cos(sin_squared, if cos_squared > 0.0 { cos_squared } else { 0.0 });
        SphereSampler {
            center,
            radius,
            reference,
            frame: Frame::from_normal(direction),
            sin_squared_max: sin_squared,
            // Beyond 1e17 radii the pdf would overflow.
            one_minus_cos_max: if omc > 1e-35 { omc } else { 1e-35 },
            inside,
        }
    }

    /// Solid angle, steradians; 4 pi from inside.
    #[inline(always)]
    pub fn solid_angle(&self) -> f32 {
        if self.inside { 4.0 * PI } else { 2.0 * PI * self.one_minus_cos_max }
    }

    /// Samples a point: the nearer intersection of a direction uniform in the cone; from inside, of a direction uniform over the sphere.
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> LightPoint {
        let on_cone = self.center + self.outward_normal_in_cone(u) * self.radius;
        let from_inside = self.exit_point(warp::uniform_sphere(u));
        let point = if self.inside { from_inside } else { on_cone };
        LightPoint { point, pdf_solid_angle: self.pdf_solid_angle() }
    }

    /// Intersection of a ray from inside with a unit direction.
    #[inline(always)]
    fn exit_point(&self, direction: Vec3) -> Vec3 {
        let f = self.reference - self.center;
        let b = f.dot(direction);
        let across = f - direction * b;
        let rest = self.radius * self.radius - across.length_squared();
        self.center + across + direction * if rest > 0.0 { rest } else { 0.0 }.sqrt()
    }

    /// Outward unit normal at the first intersection of a direction sampled in the cone.
    #[inline(always)]
    fn outward_normal_in_cone(&self, u: [f32; 2]) -> Vec3 {
        // theta: angle from the axis at the reference point; alpha: angle from the reverse axis at the centre.
        let h = u[0] * self.one_minus_cos_max;
        let cos_theta = 1.0 - h;
        let sin_squared = h * (2.0 - h);
        let ratio = sin_squared / if self.sin_squared_max > 0.0 { self.sin_squared_max } else { 1.0 };
        let rest = if ratio < 1.0 { 1.0 - ratio } else { 0.0 };
        let (sine_max, root) = (self.sin_squared_max.sqrt(), rest.sqrt());
        let cos_alpha = sin_squared / if sine_max > 0.0 { sine_max } else { 1.0 } + cos_theta * root;
        // By the law of sines, since 1 - cos^2 would cancel for small angles.
        let ratio = if ratio < 1.0 { ratio } else { 1.0 };
        let sin_alpha = ratio.sqrt() * (cos_theta - sine_max * root);
        let (s, c) = poly::sin_cos_turns(u[1]);
        self.frame.to_world(Vec3::new(sin_alpha * c, sin_alpha * s, -cos_alpha))
    }

    /// Solid-angle pdf of [`SphereSampler::sample`], constant over the visible part.
    #[inline(always)]
    pub fn pdf_solid_angle(&self) -> f32 {
        let of_cone = warp::uniform_cone_pdf_solid_angle(self.one_minus_cos_max);
        if self.inside { UNIFORM_SPHERE_PDF_SOLID_ANGLE } else { of_cone }
    }
}

/// A sphere that each ray intersects once: from outside on the near side, from inside on the far side. Spherical lights that
/// don't occlude are shells: points inside receive light from all directions, and rays through a shell collect its radiance once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shell(pub Sphere);

impl Shell {
    /// The shell of a scene's shape, around `center`.
    pub(super) fn of_scene(shape: &scene::Shape, center: Vec3) -> Shell {
        Shell(Sphere::of_scene(shape, center))
    }

    /// Unpacks a sphere.
    #[inline(always)]
    pub(super) fn unpack(parameters: &[f32; 6]) -> Shell {
        Shell(Sphere::unpack(parameters))
    }

    /// Tessellation of the unit sphere.
    pub(super) fn mesh() -> Mesh {
        Sphere::mesh()
    }
}

impl Shape for Shell {
    fn center_and_radius(&self) -> (Vec3, f32) {
        self.0.center_and_radius()
    }

    fn bounds(&self) -> Bounds3 {
        self.0.bounds()
    }

    #[inline(always)]
    fn intersect(&self, ray: &PreparedRay, t_min: f32, t_max: f32) -> Option<f32> {
        let [near, far] = self.0.roots(ray)?;
        let t = if near > 0.0 { near } else { far } as f32;
        (t > t_min && t <= t_max).then_some(t)
    }

    #[inline(always)]
    fn surface(&self, p: Vec3, origin: Vec3) -> Surface {
        self.0.surface(p, origin)
    }

    #[inline]
    fn texture_coordinates(&self, point: Vec3, normal: Vec3, object_from_world: &Mat3) -> Vec2 {
        self.0.texture_coordinates(point, normal, object_from_world)
    }

    #[inline]
    fn parametrize(&self, normal: Vec3, object_from_world: &Mat3) -> Parametrization {
        self.0.parametrize(normal, object_from_world)
    }

    fn area(&self) -> f32 {
        self.0.area()
    }

    fn largest_projection(&self) -> f32 {
        self.0.largest_projection()
    }

    #[inline(always)]
    fn normal_at(&self, point: Vec3, reference: Vec3) -> Vec3 {
        self.0.normal_at(point, reference)
    }

    fn point_by_area(&self, u: [f32; 2]) -> Vec3 {
        self.0.point_by_area(u)
    }

    #[inline(always)]
    fn sample(&self, reference: Vec3, u: [f32; 2]) -> LightPoint {
        self.0.sample(reference, u)
    }

    #[inline(always)]
    fn pdf_solid_angle(&self, reference: Vec3, point: Vec3) -> f32 {
        self.0.pdf_solid_angle(reference, point)
    }

    /// Light emitted inwards only illuminates receivers inside the sphere: those outside, on the far side, see the emission of the far
    /// side, since a ray intersects a shell once.
    fn emission_offset(&self, receiver: Vec3, ray: &Ray) -> Option<f32> {
        let Sphere { center, radius } = self.0;
        let is_inward = ray.direction.dot(ray.origin - center) < 0.0;
        (!is_inward || receiver.distance(center) <= radius).then_some(0.0)
    }

    fn parameters(&self) -> [f32; 6] {
        self.0.parameters()
    }
}

/// The unit sphere as a subdivided icosahedron with smooth normals: 20 * 4^levels triangles.
pub(super) fn icosphere(levels: u32) -> Mesh {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let mut points: Vec<DVec3> = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        points.extend([DVec3::new(a, b, 0.0), DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a)]);
    }
    let mut triangles = Vec::new();
    for i in 0..12u32 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let [a, b, c] = [i, j, k].map(|v| points[v as usize]);
                // Edges of this icosahedron have length 2.
                if [(a, b), (b, c), (c, a)].iter().all(|(p, q)| (p.distance(*q) - 2.0).abs() < 1e-9) {
                    let outward = (b - a).cross(c - a).dot(a) > 0.0;
                    triangles.push(if outward { [i, j, k] } else { [i, k, j] });
                }
            }
        }
    }
    points.iter_mut().for_each(|p| *p = p.normalize());
    for _ in 0..levels {
        subdivide(&mut points, &mut triangles);
    }
    let normals: Vec<[f32; 3]> = points.iter().map(|p| p.as_vec3().to_array()).collect();
    Mesh { positions: normals.clone(), triangles, normals, ..Mesh::default() }
}

fn subdivide(points: &mut Vec<DVec3>, triangles: &mut Vec<[u32; 3]>) {
    let mut midpoints = HashMap::new();
    let mut next = Vec::with_capacity(triangles.len() * 4);
    for &[a, b, c] in triangles.iter() {
        let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
            *midpoints.entry((p.min(q), p.max(q))).or_insert_with(|| {
                points.push((points[p as usize] + points[q as usize]).normalize());
                points.len() as u32 - 1
            })
        });
        next.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    *triangles = next;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn icospheres_face_outwards_and_have_the_volume_of_a_sphere() {
        let mesh = icosphere(5);
        assert_eq!(mesh.triangles.len(), 20 * 4usize.pow(5));
        let corner = |i: u32| DVec3::from(mesh.positions[i as usize].map(f64::from));
        let volumes = mesh.triangles.iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0);
        assert!((volumes.sum::<f64>() / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 2e-3);
    }

    /// Points of a tiny sphere may round to its centre.
    #[test]
    fn normals_of_tiny_spheres_point_to_the_viewer() {
        let (center, viewer) = (Vec3::new(0.3, 2.0, 1.0), Vec3::new(0.1, 0.0, 0.2));
        for radius in [1e-6, 1e-7, 1e-9] {
            let sphere = Sphere { center, radius };
            let point = sphere.sample(viewer, [0.9, 0.3]).point;
            assert!(sphere.normal_at(point, viewer).dot(viewer - point) > 2.0, "{radius}");
        }
    }
}
