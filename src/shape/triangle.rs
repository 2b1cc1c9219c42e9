//! Triangles: the watertight test (Woop, Benthin, Wald 2013, "Watertight Ray/Triangle Intersection"), and sampling uniformly
//! in solid angle (Arvo 1995, "Stratified Sampling of Spherical Triangles", with the trigonometry of Peters 2021, "BRDF Importance
//! Sampling for Polygonal Lights", section 2).
//!
//! Translation and shear of a vertex don't depend on its triangle. A non-zero `fl(fl(a b) - fl(c d))` has the sign of `a b - c d`, since
//! rounding is monotonic; if it is zero, double precision is exact (48 of 53 bits). So edge functions of the sheared vertices have
//! exact signs, adjacent triangles agree, and no ray leaks between them. Operations are not contracted, so all CPU levels agree.

use super::traits::{LightPoint, PreparedRay, Surface, pdf_solid_angle_of_area};
use crate::math::{Vec3, gamma, poly};
use crate::simd::{BoxRay, ShearedLine, Wide, map_each};

/// Number of triangles tested at a time.
pub const LANES: usize = 4;

/// Four triangles: coordinate k of vertices 0, 1, 2 in rows 4k to 4k + 2; rows 3, 7 and 11 are ignored.
pub type TriangleRows = [[f32; LANES]; 12];

/// Barycentric coordinates of a hit.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    /// Barycentric coordinate of vertex 1.
    pub u: f32,
    /// Barycentric coordinate of vertex 2.
    pub v: f32,
}

/// Bit mask of lanes whose triangle may be intersected by the ray's line: a superset of those accepted by [`weights`], with edge
/// functions that round to zero undecided. The ray parameter is left to [`plane_parameters`], since single precision can't separate
/// adjacent surfaces from the ray's origin.
#[inline(always)]
pub fn candidates<W: Wide>(w: W, rows: &TriangleRows, ray: &PreparedRay, boxes: &BoxRay) -> u32 {
    w.candidates(rows, boxes, &ray.origin, &ray.shear)
}

/// The exact test of the ray's line against a lane's triangle.
#[inline(always)]
pub fn weights(rows: &TriangleRows, lane: usize, ray: &PreparedRay, boxes: &BoxRay) -> Option<Weights> {
    let lane = lane & 3;
    weights_of(|axis, k| rows[4 * axis + k][lane], &boxes.line(ray.origin, ray.shear))
}

/// The exact test of a line against the triangle with coordinates `at(axis, vertex)`.
#[inline(always)]
pub fn weights_of(at: impl Fn(usize, usize) -> f32, line: &ShearedLine) -> Option<Weights> {
    let [kx, ky, kz] = line.axes();
    let ([ox, oy, oz], [sx, sy]) = (line.origin, line.shear);
    let vertex = |k: usize| {
        let z = at(kz, k) - oz;
        let x = (at(kx, k) - ox) - sx * z;
        let y = (at(ky, k) - oy) - sy * z;
        (x, y)
    };
    let ((ax, ay), (bx, by), (cx, cy)) = (vertex(0), vertex(1), vertex(2));
    let mut u = cx * by - cy * bx;
    let mut v = ax * cy - ay * cx;
    let mut w = bx * ay - by * ax;
    if u == 0.0 || v == 0.0 || w == 0.0 {
        u = exact_edge(cx, by, cy, bx);
        v = exact_edge(ax, cy, ay, cx);
        w = exact_edge(bx, ay, by, ax);
    }
    let positive = u >= 0.0 && v >= 0.0 && w >= 0.0;
    let negative = u <= 0.0 && v <= 0.0 && w <= 0.0;
    let det = (u + v) + w;
    if !(positive || negative) || det == 0.0 {
        return None;
    }
    Some(Weights { u: v / det, v: w / det })
}

/// Ray parameters of the intersections with the planes of four triangles, in f64, where differences of f32 numbers of similar magnitude
/// are exact: an origin one f32 rounding error off the plane keeps its side. NaN if the ray is parallel to the plane, and
/// possibly if all `lanes` are behind the ray.
#[inline(always)]
pub fn plane_parameters<W: Wide>(w: W, rows: &TriangleRows, ray: &PreparedRay, lanes: u32) -> [f32; LANES] {
    w.plane_parameters(rows, &ray.origin, &ray.direction, lanes)
}

/// `a b - c d` from exact f64 products, rounded such that only zero becomes zero.
#[inline(always)]
fn exact_edge(a: f32, b: f32, c: f32, d: f32) -> f32 {
    let exact = f64::from(a) * f64::from(b) - f64::from(c) * f64::from(d);
    let rounded = exact as f32;
    if rounded == 0.0 && exact != 0.0 { f32::MIN_POSITIVE.copysign(exact as f32) } else { rounded }
}

/// Do two vertices coincide? Other triangles of zero area are kept: they close T-junctions, where otherwise a ray could leak.
pub fn is_degenerate([a, b, c]: [Vec3; 3]) -> bool {
    a == b || b == c || c == a
}

/// The surface at barycentric coordinates `u` and `w` of the second and third vertex, which may add up to more than 1 (quads). Its position
/// is more accurate than that of the ray parameter (Pharr, Jakob, Humphreys 2023, section 6.8.5).
#[inline(always)]
pub fn triangle_surface(v: [[f32; 3]; 3], u: f32, w: f32) -> Surface {
    let [a, b, c] = map_each(v, Vec3::from_array);
    let (pa, pb, pc) = (a * (1.0 - u - w), b * u, c * w);
    let ng = (b - a).cross(c - a).normalize();
    Surface { p: pa + pb + pc, p_error: (pa.abs() + pb.abs() + pc.abs()) * gamma(7), ng, ns: ng, material: 0 }
}

/// Interpolates a vertex attribute at barycentric coordinates `u` and `w` of the second and third vertex.
#[inline(always)]
pub fn interpolate(v: [[f32; 3]; 3], u: f32, w: f32) -> Vec3 {
    let [a, b, c] = map_each(v, Vec3::from_array);
    a * (1.0 - u - w) + b * u + c * w
}

/// The interpolated unit normal, on the side of the geometric normal, which is the fallback for a zero length. Branchless.
#[inline(always)]
pub fn shading_normal(normals: [[f32; 3]; 3], u: f32, w: f32, ng: Vec3) -> Vec3 {
    let n = interpolate(normals, u, w);
    let length = n.length();
    let is_usable = length >= 1e-6;
    let side = if n.dot(ng) < 0.0 { -1.0 } else { 1.0 };
    let unit = n * (side / if is_usable { length } else { 1.0 });
    if is_usable { unit } else { ng }
}

/// Solid angle (steradians) below which triangles and parallelograms are sampled by area.
pub const MIN_TRIANGLE_SOLID_ANGLE: f32 = 1e-4;

/// A spherical triangle on the unit sphere around a reference point, prepared for sampling.
#[derive(Clone, Copy, Debug)]
pub(super) struct Directions {
    a: Vec3,
    b: Vec3,
    c: Vec3,
    /// Absolute triple product a . (b x c).
    volume: f32,
    ab: f32,
    bc: f32,
    ca: f32,
    pub solid_angle: f32,
}

impl Directions {
    /// Vertices are relative to the reference point; `normal` is the cross product of the edges at the first vertex.
    #[inline(always)]
    pub fn new(pa: Vec3, pb: Vec3, pc: Vec3, normal: Vec3) -> Directions {
        let inverse = |p: Vec3| 1.0 / (p.length_squared() + 1e-37).sqrt();
        let (ia, ib, ic) = (inverse(pa), inverse(pb), inverse(pc));
        let (a, b, c) = (pa * ia, pb * ib, pc * ic);
        // By the distance to the plane times twice the area, without cancellation for nearly equal directions.
        let volume = (a.dot(normal) * ib * ic).abs();
        let (ab, bc, ca) = (a.dot(b), b.dot(c), c.dot(a));
        // 1 + ab + bc + ca as (x + y) . (x + z), with x the vertex farthest from the others: accurate for needles that extend around
        // the reference point, where the terms cancel.
        let (x, y, z) = if ab + ca <= bc + ab.min(ca) {
            (a, b, c)
        } else if ab < ca {
            (b, c, a)
        } else {
            (c, a, b)
        };
        let solid_angle = 2.0 * poly::atan2(volume, (x + y).dot(x + z));
        Directions { a, b, c, volume, ab, bc, ca, solid_angle }
    }

    /// Samples a unit vector uniformly over the spherical triangle.
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> Vec3 {
        // x on the arc from a to c such that triangle (a, b, x) has the fraction u[0] of the solid angle. By the tangent formula x lies
        // on a plane that also contains -a, so x is the reflection of a about `axis`.
        let (s, c) = poly::sin_cos(0.5 * self.solid_angle * u[0]);
        let axis = self.a * (c * self.volume - s * (self.ca + self.bc)) + self.c * (s * (1.0 + self.ab));
        let axis_squared = axis.length_squared();
        let scale = 2.0 * self.a.dot(axis) / if axis_squared > 1e-37 { axis_squared } else { 1e-37 };
        let x = axis * scale - self.a;
        // Between b and x, with 1 - cos of the angle from b uniform; h = 1 - b . x without cancellation.
        let step = x - self.b;
        let h = 0.5 * step.length_squared();
        let vh = u[1] * h;
        let rest = 2.0 - h;
        let along = (u[1] * (2.0 - vh) / if rest > 1e-6 { rest } else { 1e-6 }).sqrt();
        self.b * (1.0 - vh) + (step + self.b * h) * along
    }
}

/// Coordinates in terms of the edges `e1`, `e2` at which a ray from the reference point in direction `w` intersects the plane of a
/// triangle with vertex `p0` (relative to the reference point).
#[inline(always)]
pub(super) fn plane_coordinates(p0: Vec3, e1: Vec3, e2: Vec3, w: Vec3) -> (f32, f32) {
    let h = w.cross(e2);
    let determinant = e1.dot(h);
    let inverse = 1.0 / if determinant == 0.0 { 1.0 } else { determinant };
    let q = p0.cross(e1);
    (-p0.dot(h) * inverse, -w.dot(q) * inverse)
}

#[inline(always)]
pub(super) fn clamp01(x: f32) -> f32 {
    let x = if x < 1.0 { x } else { 1.0 };
    if x > 0.0 { x } else { 0.0 }
}

/// Barycentric coordinates of the second and third vertex, uniform by area (Heitz 2019, "A Low-Distortion Map Between Triangle and Square").
#[inline(always)]
pub fn uniform_triangle(u: [f32; 2]) -> [f32; 2] {
    let below = u[0] < u[1];
    let small = 0.5 * if below { u[0] } else { u[1] };
    if below { [small, u[1] - small] } else { [u[0] - small, small] }
}

/// A triangle projected onto the unit sphere around a reference point.
#[derive(Clone, Copy, Debug)]
pub struct SphericalTriangle {
    vertex: Vec3,
    edge_1: Vec3,
    edge_2: Vec3,
    reference: Vec3,
    unit_normal: Vec3,
    area: f32,
    directions: Directions,
}

impl SphericalTriangle {
    /// The triangle seen from `reference`; degenerate triangles have solid angle 0 and pdf 0.
    #[inline(always)]
    pub fn new(p0: Vec3, p1: Vec3, p2: Vec3, reference: Vec3) -> SphericalTriangle {
        let (edge_1, edge_2) = (p1 - p0, p2 - p0);
        let normal = edge_1.cross(edge_2);
        let length = normal.length();
        SphericalTriangle {
            vertex: p0,
            edge_1,
            edge_2,
            reference,
            unit_normal: normal / if length > 0.0 { length } else { 1.0 },
            area: 0.5 * length,
            directions: Directions::new(p0 - reference, p1 - reference, p2 - reference, normal),
        }
    }

    /// Solid angle, steradians, 0..2 pi.
    #[inline(always)]
    pub fn solid_angle(&self) -> f32 {
        self.directions.solid_angle
    }

    /// Samples barycentric coordinates of the second and third vertex, uniformly in solid angle (by area below
    /// [`MIN_TRIANGLE_SOLID_ANGLE`]).
    #[inline(always)]
    pub fn sample_weights(&self, u: [f32; 2]) -> [f32; 2] {
        let w = self.directions.sample(u);
        let (w1, w2) = plane_coordinates(self.vertex - self.reference, self.edge_1, self.edge_2, w);
        let w1 = clamp01(w1);
        let rest = 1.0 - w1;
        let w2 = clamp01(if w2 < rest { w2 } else { rest });
        let [a1, a2] = uniform_triangle(u);
        let by_area = self.solid_angle() < MIN_TRIANGLE_SOLID_ANGLE;
        [if by_area { a1 } else { w1 }, if by_area { a2 } else { w2 }]
    }

    /// Samples a point as [`SphericalTriangle::sample_weights`] does.
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> LightPoint {
        let [w1, w2] = self.sample_weights(u);
        let point = self.vertex + self.edge_1 * w1 + self.edge_2 * w2;
        LightPoint { point, pdf_solid_angle: self.pdf_solid_angle(point) }
    }

    /// Solid-angle pdf of [`SphericalTriangle::sample`] for a point of the triangle.
    #[inline(always)]
    pub fn pdf_solid_angle(&self, point: Vec3) -> f32 {
        pdf_of_either(point - self.reference, self.unit_normal, self.area, self.solid_angle())
    }
}

/// Solid-angle pdf of a point on a flat light sampled by solid angle or, below [`MIN_TRIANGLE_SOLID_ANGLE`], by area; parameters as for
/// [`pdf_solid_angle_of_area`].
#[inline(always)]
pub(super) fn pdf_of_either(to_point: Vec3, unit_normal: Vec3, area: f32, solid_angle: f32) -> f32 {
    let of_area = pdf_solid_angle_of_area(to_point, unit_normal, area);
    if solid_angle < MIN_TRIANGLE_SOLID_ANGLE { of_area } else { 1.0 / solid_angle }
}
