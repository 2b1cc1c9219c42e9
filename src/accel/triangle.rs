//! The watertight triangle test (Woop, Benthin, Wald 2013, "Watertight Ray/Triangle Intersection").
//!
//! Vertices go through the same rounded translation and shear whichever triangle they belong to. The sign of
//! `fl(fl(a b) - fl(c d))`, when it is not zero, is the sign of `a b - c d`, since rounding keeps order; when it is zero,
//! double precision decides exactly (48 of 53 bits). So every edge is classified exactly with respect to the sheared
//! vertices, neighbours agree on it, and nothing leaks between them. No operation is contracted, so all CPU levels agree.

use super::layout::TrianglePacket;
use super::prepare::PreparedRay;
use crate::simd::Wide;

/// A hit of one lane: parameter and barycentric weights of vertices 1 and 2.
#[derive(Clone, Copy, Debug)]
pub struct TriangleHit {
    /// Ray parameter.
    pub t: f32,
    /// Weight of vertex 1.
    pub u: f32,
    /// Weight of vertex 2.
    pub v: f32,
}

/// The lanes of a packet that the ray's line meets: a superset of those that [`intersect`] accepts, in which only edge
/// functions that round to zero are undecided. Where along the line is left to [`intersect`]: single precision could not
/// tell it from the ray's start on surfaces that touch.
#[inline(always)]
pub fn candidates<W: Wide>(w: W, packet: &TrianglePacket, ray: &PreparedRay) -> u32 {
    let [kx, ky, kz] = ray.axes.map(|k| usize::from(k & 3));
    let (ox, oy, oz) =
        (w.splat4(ray.origin[kx.min(2)]), w.splat4(ray.origin[ky.min(2)]), w.splat4(ray.origin[kz.min(2)]));
    let (sx, sy) = (w.splat4(ray.shear[0]), w.splat4(ray.shear[1]));
    let vertex = |k: usize| {
        let z = w.sub4(w.load4(&packet.rows[k + kz]), oz);
        let x = w.sub4(w.sub4(w.load4(&packet.rows[k + kx]), ox), w.mul4(sx, z));
        let y = w.sub4(w.sub4(w.load4(&packet.rows[k + ky]), oy), w.mul4(sy, z));
        (x, y)
    };
    let ((ax, ay), (bx, by), (cx, cy)) = (vertex(0), vertex(4), vertex(8));
    let u = w.sub4(w.mul4(cx, by), w.mul4(cy, bx));
    let v = w.sub4(w.mul4(ax, cy), w.mul4(ay, cx));
    let wt = w.sub4(w.mul4(bx, ay), w.mul4(by, ax));
    w.same_sign4(u, v, wt)
}

/// The exact test of one lane for `t_min < t <= t_max`.
#[inline(always)]
pub fn intersect(packet: &TrianglePacket, lane: usize, ray: &PreparedRay, t_max: f32) -> Option<TriangleHit> {
    let lane = lane & 3;
    let t = plane_parameter(packet, lane, ray)?;
    if !(t > ray.t_min && t <= t_max) {
        return None;
    }
    let [kx, ky, kz] = ray.axes.map(|k| usize::from(k).min(2));
    let [ox, oy, oz] = [ray.origin[kx], ray.origin[ky], ray.origin[kz]];
    let [sx, sy] = ray.shear;
    let vertex = |k: usize| {
        let z = packet.rows[k + kz][lane] - oz;
        let x = (packet.rows[k + kx][lane] - ox) - sx * z;
        let y = (packet.rows[k + ky][lane] - oy) - sy * z;
        (x, y)
    };
    let ((ax, ay), (bx, by), (cx, cy)) = (vertex(0), vertex(4), vertex(8));
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
    Some(TriangleHit { t, u: v / det, v: w / det })
}

/// Where the ray meets the triangle's plane: `n . (a - o) / n . d` in f64, in which the differences of f32 numbers of
/// similar size are exact. An origin beside the plane by the rounding of an f32 keeps its side.
#[inline(always)]
fn plane_parameter(packet: &TrianglePacket, lane: usize, ray: &PreparedRay) -> Option<f32> {
    let at = |row: usize| f64::from(packet.rows[row][lane]);
    let edge = |k: usize, axis: usize| at(4 * k + axis) - at(axis);
    let [e, f] = [1, 2].map(|k| [edge(k, 0), edge(k, 1), edge(k, 2)]);
    let n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
    let [o, d] = [ray.origin, ray.direction].map(|v| v.map(f64::from));
    let below = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
    let above = n[0] * (at(0) - o[0]) + n[1] * (at(1) - o[1]) + n[2] * (at(2) - o[2]);
    let t = (above / below) as f32;
    (below != 0.0).then_some(t)
}

/// `a b - c d`, from f64 products that are exact, rounded so that only zero becomes zero.
#[inline(always)]
fn exact_edge(a: f32, b: f32, c: f32, d: f32) -> f32 {
    let exact = f64::from(a) * f64::from(b) - f64::from(c) * f64::from(d);
    let rounded = exact as f32;
    if rounded == 0.0 && exact != 0.0 { f32::MIN_POSITIVE.copysign(exact as f32) } else { rounded }
}
