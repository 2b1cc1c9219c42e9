//! The watertight triangle test (Woop, Benthin, Wald 2013, "Watertight Ray/Triangle Intersection").
//!
//! Vertices go through the same rounded translation and shear whichever triangle they belong to. The sign of
//! `fl(fl(a b) - fl(c d))`, when it is not zero, is the sign of `a b - c d`, since rounding keeps order; when it is zero,
//! double precision decides exactly (48 of 53 bits). So every edge is classified exactly with respect to the sheared
//! vertices, neighbours agree on it, and nothing leaks between them. No operation is contracted, so all CPU levels agree.

use super::layout::{LANES, TrianglePacket};
use super::prepare::PreparedRay;
use crate::simd::{BoxRay, Wide};

/// Where a lane's triangle is hit: the barycentric weights of vertices 1 and 2.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    /// Of vertex 1.
    pub u: f32,
    /// Of vertex 2.
    pub v: f32,
}

/// The lanes of a packet that the ray's line meets: a superset of those that [`weights`] accepts, in which only edge
/// functions that round to zero are undecided. Where along the line is left to [`plane_parameters`]: single precision
/// could not tell it from the ray's start on surfaces that touch.
#[inline(always)]
pub fn candidates<W: Wide>(w: W, packet: &TrianglePacket, ray: &PreparedRay, boxes: &BoxRay) -> u32 {
    w.candidates(&packet.rows, boxes, &ray.origin, &ray.shear)
}

/// The exact test whether the ray's line meets a lane's triangle.
#[inline(always)]
pub fn weights(packet: &TrianglePacket, lane: usize, ray: &PreparedRay, boxes: &BoxRay) -> Option<Weights> {
    let lane = lane & 3;
    let [kx, ky, kz] = boxes.axes();
    let [ox, oy, oz] = boxes.permute(ray.origin);
    let [sx, sy] = ray.shear;
    let vertex = |k: usize| {
        let z = packet.rows[4 * kz + k][lane] - oz;
        let x = (packet.rows[4 * kx + k][lane] - ox) - sx * z;
        let y = (packet.rows[4 * ky + k][lane] - oy) - sy * z;
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
pub fn plane_parameters<W: Wide>(
    w: W,
    packet: &TrianglePacket,
    ray: &PreparedRay,
    lanes: u32,
) -> [f32; LANES] {
    w.plane_parameters(&packet.rows, &ray.origin, &ray.direction, lanes)
}

/// `a b - c d`, from f64 products that are exact, rounded so that only zero becomes zero.
#[inline(always)]
fn exact_edge(a: f32, b: f32, c: f32, d: f32) -> f32 {
    let exact = f64::from(a) * f64::from(b) - f64::from(c) * f64::from(d);
    let rounded = exact as f32;
    if rounded == 0.0 && exact != 0.0 { f32::MIN_POSITIVE.copysign(exact as f32) } else { rounded }
}
