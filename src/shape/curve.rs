//! Pieces of curves: hulls of two spheres (rounded cones), which follow a curve from point to point.
//!
//! Rays meet a piece from outside only. What enters a piece therefore leaves it unseen, as the scattering of hair wants it,
//! which speaks of a fibre as a whole. A ray that starts on a piece can't meet that piece, which is convex; and of the pieces
//! next to it on the same curve it meets what is on the outside of the curve only ([`CurveSegment::intersect`]).

use super::point::Surface;
use super::ray::PreparedRay;
use crate::math::{Bounds3, Vec2, Vec3, gamma, orthonormal_basis, poly};
use crate::simd::map_each;
use std::f32::consts::TAU;

/// Many pieces, which share their ends.
#[derive(Clone, Debug, Default)]
pub struct CurveSegments {
    /// Where the curves go, with radii.
    pub points: Vec<[f32; 4]>,
    /// Unit tangents of the curves there; zero where a curve begins and ends.
    pub tangents: Vec<[f32; 3]>,
    /// By piece, its first point; the next one is its second.
    pub segments: Vec<u32>,
}

/// A piece of a curve: a rounded cone.
#[derive(Clone, Copy, Debug)]
pub struct CurveSegment {
    /// Middles of its spheres.
    pub ends: [Vec3; 2],
    /// Their radii.
    pub radii: [f32; 2],
    /// Unit tangents of the curve there; zero where it begins and ends.
    pub tangents: [Vec3; 2],
}

impl CurveSegments {
    /// None.
    pub const EMPTY: CurveSegments =
        CurveSegments { points: Vec::new(), tangents: Vec::new(), segments: Vec::new() };

    /// How many pieces there are.
    pub fn len(&self) -> usize {
        self.segments.len()
    }

    /// Is there none?
    pub fn is_empty(&self) -> bool {
        self.segments.is_empty()
    }

    /// A piece by its number.
    #[inline]
    pub fn get(&self, index: usize) -> CurveSegment {
        let first = self.segments[index] as usize;
        let [a, b] = [self.points[first], self.points[first + 1]];
        CurveSegment {
            ends: [a, b].map(|[x, y, z, _]| Vec3::new(x, y, z)),
            radii: [a[3], b[3]],
            tangents: [self.tangents[first], self.tangents[first + 1]].map(Vec3::from),
        }
    }

    /// The box around all.
    pub fn bounds(&self) -> Bounds3 {
        (0..self.len()).fold(Bounds3::EMPTY, |bounds, i| bounds.union(self.get(i).bounds()))
    }
}

/// Where a line enters a piece.
#[derive(Clone, Copy, Debug)]
pub struct CurveHit {
    /// Parameter of the line.
    pub t: f64,
    /// Which of the piece's spheres touches the point: 0 is the first, 1 the second.
    pub u: f64,
    /// The point, from the piece's first end.
    from_end: [f64; 3],
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a + b t.
#[inline(always)]
fn along(a: [f64; 3], b: [f64; 3], t: f64) -> [f64; 3] {
    [a[0] + b[0] * t, a[1] + b[1] * t, a[2] + b[2] * t]
}

impl CurveSegment {
    /// The box around it, but for rounding to nearest.
    pub fn bounds(&self) -> Bounds3 {
        let [a, b] = self.ends;
        let [r, s] = self.radii.map(Vec3::splat);
        Bounds3 { min: (a - r).min(b - s), max: (a + r).max(b + s) }
    }

    /// Where a line first enters it, in double precision.
    ///
    /// The cone that touches both spheres is a quadric: with a and r the first end and radius, w = b - a the way to the second end
    /// and k the difference of the radii, a point p is on it where (w^2 - k^2) (p - a)^2 = (w.(p - a))^2 - 2 k r w.(p - a) + r^2 w^2.
    /// It counts between the circles of contact; else the first of the spheres does. All is solved around the line's point
    /// nearest to the first end, so that the distance of its origin costs no precision.
    #[inline(always)]
    pub fn enter(&self, origin: [f32; 3], direction: [f32; 3]) -> Option<CurveHit> {
        let a = map_each(self.ends[0].to_array(), f64::from);
        let way = minus(map_each(self.ends[1].to_array(), f64::from), a);
        let [ra, rb] = [f64::from(self.radii[0]), f64::from(self.radii[1])];
        let d = map_each(direction, f64::from);
        let from_a = minus(map_each(origin, f64::from), a);
        let dd = dot(d, d);
        let nearest = -dot(from_a, d) / dd;
        let near = along(from_a, d, nearest);
        let (ww, wn, wd) = (dot(way, way), dot(way, near), dot(way, d));
        let (nd, nn) = (dot(near, d), dot(near, near));
        let narrows = ra - rb;
        let contact = ww - narrows * narrows;
        if contact > 0.0 {
            // quadratic t^2 + 2 half t + constant, negative inside of the cone.
            let quadratic = contact * dd - wd * wd;
            let half = contact * nd - wn * wd + wd * narrows * ra;
            let constant = contact * nn - wn * wn + 2.0 * wn * narrows * ra - ww * ra * ra;
            let h = half * half - constant * quadratic;
            // A line that is steeper than the cone's side always meets the cone.
            if h < 0.0 && quadratic > 0.0 {
                return None;
            }
            let t = (-half - (if h > 0.0 { h } else { 0.0 }).sqrt()) / quadratic;
            let at = wn - narrows * ra + t * wd;
            if at > 0.0 && at < contact {
                return Some(CurveHit { t: t + nearest, u: at / contact, from_end: along(near, d, t) });
            }
        }
        let enter = |nd: f64, nn: f64, r: f64| {
            let h = nd * nd - dd * (nn - r * r);
            if h >= 0.0 { (-nd - h.sqrt()) / dd } else { f64::INFINITY }
        };
        let from_b = minus(near, way);
        let (first, second) = (enter(nd, nn, ra), enter(dot(from_b, d), dot(from_b, from_b), rb));
        let (t, u) = if first <= second { (first, 0.0) } else { (second, 1.0) };
        // NaN fails.
        (t < f64::INFINITY).then(|| CurveHit { t: t + nearest, u, from_end: along(near, d, t) })
    }

    /// Where a ray enters it at a parameter in `t_min < t <= t_max`, and which of its spheres touches the point. For a ray
    /// that `starts_near`, on a piece of the same curve close by, only what lies between the planes across the curve at both ends
    /// counts: beyond them is the inside of the next pieces.
    #[inline(always)]
    pub fn intersect(
        &self,
        ray: &PreparedRay,
        t_min: f32,
        t_max: f32,
        starts_near: bool,
    ) -> Option<(f32, f32)> {
        let hit = self.enter(ray.origin, ray.direction)?;
        let t = hit.t as f32;
        let is_met = t > t_min && t <= t_max && (!starts_near || self.is_outside(&hit));
        is_met.then_some((t, hit.u as f32))
    }

    /// Is the point of a hit on the outside of the curve?
    #[inline(always)]
    fn is_outside(&self, hit: &CurveHit) -> bool {
        let [first, second] = self.tangents.map(|t| map_each(t.to_array(), f64::from));
        let way = map_each((self.ends[1] - self.ends[0]).to_array(), f64::from);
        dot(hit.from_end, first) >= 0.0 && dot(minus(hit.from_end, way), second) <= 0.0
    }

    /// The direction from end to end.
    #[inline(always)]
    fn chord(&self) -> Vec3 {
        (self.ends[1] - self.ends[0]).normalize_or_zero()
    }

    /// The unit tangent of the curve where sphere `u` is.
    #[inline(always)]
    pub fn tangent(&self, u: f32) -> Vec3 {
        let chord = self.chord();
        let [first, second] = self.tangents.map(|t| if t == Vec3::ZERO { chord } else { t });
        (first * (1.0 - u) + second * u).try_normalize().unwrap_or(if chord == Vec3::ZERO {
            Vec3::X
        } else {
            chord
        })
    }

    /// The radius where sphere `u` is.
    #[inline(always)]
    pub fn radius(&self, u: f32) -> f32 {
        self.radii[0] + (self.radii[1] - self.radii[0]) * u
    }

    /// The surface where a ray enters it. The shading normal is that of the curve that it is a piece of: the cone's own, turned as
    /// the curve's tangent is from the cone's axis, and on the side of the ray's origin.
    pub fn surface(&self, origin: Vec3, direction: Vec3) -> Surface {
        let hit = self.enter(origin.to_array(), direction.to_array());
        // A hit is found again, but for rounding of what is tangent to the surface.
        let hit = hit.unwrap_or_else(|| self.graze(origin, direction));
        let way = map_each((self.ends[1] - self.ends[0]).to_array(), f64::from);
        let a = map_each(self.ends[0].to_array(), f64::from);
        let outwards = minus(hit.from_end, map_each(way, |w| w * hit.u));
        let p = Vec3::from(map_each([0, 1, 2], |k: usize| (a[k] + hit.from_end[k]) as f32));
        let own = Vec3::from(map_each(outwards, |x| x as f32)).normalize_or_zero();
        let turned = turn(own, self.chord(), self.tangent(hit.u as f32));
        let wo = -direction.normalize_or_zero();
        let ns = facing(if turned.dot(own) > 0.0 { turned } else { own }, wo);
        // Half an ulp of the sum, and what double precision loses between the ray's origin and the point.
        let far = (origin - p).abs().max_element() * 1e-14;
        let p_error = p.abs() * gamma(2) + Vec3::splat(self.radius(hit.u as f32) * gamma(4) + far);
        Surface { p, p_error, ng: own, ns, material: 0 }
    }

    /// The point of a line next to the piece's first end.
    #[cold]
    fn graze(&self, origin: Vec3, direction: Vec3) -> CurveHit {
        let d = map_each(direction.to_array(), f64::from);
        let from_a = map_each((origin - self.ends[0]).to_array(), f64::from);
        let t = -dot(from_a, d) / dot(d, d);
        CurveHit { t, u: 0.0, from_end: along(from_a, d, t) }
    }

    /// How far a normal is around the curve, in turns from 0 to 1.
    pub fn around(&self, u: f32, normal: Vec3) -> f32 {
        let (x, y) = orthonormal_basis(self.tangent(u));
        let turns = poly::atan2(normal.dot(y), normal.dot(x)) / TAU;
        if turns < 0.0 { turns + 1.0 } else { turns }
    }

    /// Texture coordinates where sphere `u` touches a point with a normal: along the curve, where its ends are at `along`, and
    /// around it.
    pub fn texture_coordinates(&self, along: [f32; 2], u: f32, normal: Vec3) -> Vec2 {
        Vec2::new(along[0] + (along[1] - along[0]) * u, self.around(u, normal))
    }
}

/// A vector turned the way that leads from one unit vector to another.
fn turn(v: Vec3, from: Vec3, to: Vec3) -> Vec3 {
    let cosine = from.dot(to);
    if cosine < -0.9 {
        return v;
    }
    let axis = from.cross(to);
    let across = axis.cross(v);
    (v + across + axis.cross(across) / (1.0 + cosine)).normalize_or_zero()
}

/// A normal on the side of a viewer: where it leads away, bent until it doesn't.
fn facing(n: Vec3, wo: Vec3) -> Vec3 {
    const LEAST: f32 = 1e-4;
    let cosine = n.dot(wo);
    if cosine >= LEAST { n } else { (n + wo * (LEAST - cosine)).try_normalize().unwrap_or(wo) }
}

#[cfg(test)]
mod tests;
