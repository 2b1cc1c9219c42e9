//! Triangles: their boxes, the watertight test (Woop, Benthin, Wald 2013, "Watertight Ray/Triangle Intersection").
//!
//! Vertices go through the same rounded translation and shear whichever triangle they belong to. The sign of
//! `fl(fl(a b) - fl(c d))`, when it is not zero, is the sign of `a b - c d`, since rounding keeps order; when it is zero,
//! double precision decides exactly (48 of 53 bits). So every edge is classified exactly with respect to the sheared
//! vertices, neighbours agree on it, and nothing leaks between them. No operation is contracted, so all CPU levels agree.

use super::point::Surface;
use super::ray::PreparedRay;
use crate::math::{Bounds3, Vec3, gamma};
use crate::simd::{BoxRay, ShearedLine, Wide, map_each};

/// Triangles that are tested at a time.
pub const LANES: usize = 4;

/// Four triangles side by side. For axis k: vertices 0, 1, 2 in rows 4k to 4k + 2; rows 3, 7 and 11 are not looked at.
pub type TriangleRows = [[f32; LANES]; 12];

/// Where a lane's triangle is hit: the barycentric weights of vertices 1 and 2.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    /// Of vertex 1.
    pub u: f32,
    /// Of vertex 2.
    pub v: f32,
}

/// The lanes that the ray's line meets: a superset of those that [`weights`] accepts, in which only edge
/// functions that round to zero are undecided. Where along the line is left to [`plane_parameters`]: single precision
/// could not tell it from the ray's start on surfaces that touch.
#[inline(always)]
pub fn candidates<W: Wide>(w: W, rows: &TriangleRows, ray: &PreparedRay, boxes: &BoxRay) -> u32 {
    w.candidates(rows, boxes, &ray.origin, &ray.shear)
}

/// The exact test whether the ray's line meets a lane's triangle.
#[inline(always)]
pub fn weights(rows: &TriangleRows, lane: usize, ray: &PreparedRay, boxes: &BoxRay) -> Option<Weights> {
    let lane = lane & 3;
    weights_of(|axis, k| rows[4 * axis + k][lane], &boxes.line(ray.origin, ray.shear))
}

/// The exact test whether a line meets the triangle with these coordinates, by axis and vertex.
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

/// Where the ray meets the planes of the four triangles, in f64, in which the differences of f32 numbers of similar size
/// are exact. An origin beside the plane by the rounding of an f32 keeps its side. NaN where the ray is parallel to the
/// plane, and possibly where all `lanes` are behind the ray.
#[inline(always)]
pub fn plane_parameters<W: Wide>(w: W, rows: &TriangleRows, ray: &PreparedRay, lanes: u32) -> [f32; LANES] {
    w.plane_parameters(rows, &ray.origin, &ray.direction, lanes)
}

/// `a b - c d`, from f64 products that are exact, rounded so that only zero becomes zero.
#[inline(always)]
fn exact_edge(a: f32, b: f32, c: f32, d: f32) -> f32 {
    let exact = f64::from(a) * f64::from(b) - f64::from(c) * f64::from(d);
    let rounded = exact as f32;
    if rounded == 0.0 && exact != 0.0 { f32::MIN_POSITIVE.copysign(exact as f32) } else { rounded }
}

/// The box around a triangle.
#[inline]
pub fn bounds(vertices: [Vec3; 3]) -> Bounds3 {
    Bounds3::of(vertices)
}

/// Do two vertices coincide? Such a triangle has no area and its two long edges are one. Other triangles without area
/// stay: a vertex in the middle of a long edge joins the neighbours on both sides, and without it a ray could leak.
pub fn is_collapsed([a, b, c]: [Vec3; 3]) -> bool {
    a == b || b == c || c == a
}

/// The surface at the point with weights `u` and `w` of the second and third corner. It is nearer to the plane than the
/// ray's own point (Pharr, Jakob, Humphreys 2023, section 6.8.5). Weights may add up to more than 1 (quads).
#[inline(always)]
pub fn triangle_surface(v: [[f32; 3]; 3], u: f32, w: f32) -> Surface {
    let [a, b, c] = map_each(v, Vec3::from_array);
    let (pa, pb, pc) = (a * (1.0 - u - w), b * u, c * w);
    let ng = (b - a).cross(c - a).normalize();
    Surface { p: pa + pb + pc, p_error: (pa.abs() + pb.abs() + pc.abs()) * gamma(7), ng, ns: ng, material: 0 }
}

/// A quantity of the corners at the point with weights `u` and `w` of the second and third.
#[inline(always)]
pub fn interpolate(v: [[f32; 3]; 3], u: f32, w: f32) -> Vec3 {
    let [a, b, c] = map_each(v, Vec3::from_array);
    a * (1.0 - u - w) + b * u + c * w
}

/// The interpolated normal, on the side of the geometric one; that one where there is none. Free of branches.
#[inline(always)]
pub fn shading_normal(normals: [[f32; 3]; 3], u: f32, w: f32, ng: Vec3) -> Vec3 {
    let n = interpolate(normals, u, w);
    let length = n.length();
    let is_usable = length >= 1e-6;
    let side = if n.dot(ng) < 0.0 { -1.0 } else { 1.0 };
    let unit = n * (side / if is_usable { length } else { 1.0 });
    if is_usable { unit } else { ng }
}
