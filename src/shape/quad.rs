//! Parallelograms, intersected as two triangles, and their sampling uniformly in solid angle: rectangles by Ureña, Fajardo, King 2013, "An
//! Area-Preserving Parametrization for Spherical Rectangles", others as two spherical triangles.

use super::traits::{LightPoint, pdf_solid_angle_of_area};
use super::triangle::{
    Directions, MIN_TRIANGLE_SOLID_ANGLE, clamp01, is_degenerate, pdf_of_either, plane_coordinates,
};
use crate::math::{Bounds3, Vec3, poly};
use crate::simd::map_each;

/// A parallelogram: the points `corner + u edge_u + v edge_v` with u and v in 0..1, metres. Corners are rounded to f32, so primitives that
/// share two of them leave no gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quad {
    /// Corner at u = v = 0.
    pub corner: Vec3,
    /// Edge from the corner along u.
    pub edge_u: Vec3,
    /// Edge from the corner along v.
    pub edge_v: Vec3,
}

impl Quad {
    /// The corners in cyclic order. All code uses this function, so that corners agree bit for bit.
    pub fn corners(&self) -> [Vec3; 4] {
        let (a, u, v) = (self.corner, self.edge_u, self.edge_v);
        [a, a + u, (a + u) + v, a + v]
    }

    /// Bounding box.
    pub fn bounds(&self) -> Bounds3 {
        Bounds3::of(self.corners())
    }

    /// Are both triangles collapsed?
    pub fn is_degenerate(&self) -> bool {
        let [a, b, c, d] = self.corners();
        is_degenerate([a, b, c]) && is_degenerate([a, c, d])
    }
}

/// A parallelogram projected onto the unit sphere around a reference point: two spherical triangles with a common diagonal.
#[derive(Clone, Copy, Debug)]
pub struct SphericalParallelogram {
    corner: Vec3,
    edge_u: Vec3,
    edge_v: Vec3,
    reference: Vec3,
    unit_normal: Vec3,
    area: f32,
    lower: Directions,
    upper: Directions,
}

impl SphericalParallelogram {
    /// The parallelogram `corner + a * edge_u + b * edge_v`, a and b in 0..1, seen from `reference`.
    #[inline(always)]
    pub fn new(corner: Vec3, edge_u: Vec3, edge_v: Vec3, reference: Vec3) -> SphericalParallelogram {
        let normal = edge_u.cross(edge_v);
        let area = normal.length();
        let p = corner - reference;
        let opposite = p + edge_u + edge_v;
        SphericalParallelogram {
            corner,
            edge_u,
            edge_v,
            reference,
            unit_normal: normal / if area > 0.0 { area } else { 1.0 },
            area,
            lower: Directions::new(p, p + edge_u, opposite, normal),
            upper: Directions::new(p, opposite, p + edge_v, normal),
        }
    }

    /// Solid angle, steradians, 0..2 pi.
    #[inline(always)]
    pub fn solid_angle(&self) -> f32 {
        self.lower.solid_angle + self.upper.solid_angle
    }

    /// Samples a point uniformly in solid angle (by area below [`MIN_TRIANGLE_SOLID_ANGLE`]).
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> LightPoint {
        let total = self.solid_angle();
        let target = u[0] * total;
        let in_lower = target < self.lower.solid_angle;
        let chosen = if in_lower { self.lower } else { self.upper };
        let offset = if in_lower { 0.0 } else { self.lower.solid_angle };
        let divisor = if chosen.solid_angle > 0.0 { chosen.solid_angle } else { 1.0 };
        let w = chosen.sample([clamp01((target - offset) / divisor), u[1]]);
        let (a, b) = plane_coordinates(self.corner - self.reference, self.edge_u, self.edge_v, w);
        let by_area = total < MIN_TRIANGLE_SOLID_ANGLE;
        let a = if by_area { u[0] } else { clamp01(a) };
        let b = if by_area { u[1] } else { clamp01(b) };
        let point = self.corner + self.edge_u * a + self.edge_v * b;
        LightPoint { point, pdf_solid_angle: self.pdf_solid_angle(point) }
    }

    /// Solid-angle pdf of [`SphericalParallelogram::sample`] for a point of the parallelogram.
    #[inline(always)]
    pub fn pdf_solid_angle(&self, point: Vec3) -> f32 {
        pdf_of_either(point - self.reference, self.unit_normal, self.area, self.solid_angle())
    }
}

/// Solid angle (steradians) below which rectangles are sampled by area: their directions hardly differ, and the map's differences of
/// angles would cancel.
pub const MIN_RECTANGLE_SOLID_ANGLE: f32 = 1e-3;

/// A rectangle projected onto the unit sphere around a reference point.
///
/// The paper's formulas are rearranged for f32. The interior angles of the spherical rectangle (eq. 6) are stored as differences from pi/2,
/// 0 or pi, whichever is small, to keep precision for small and grazing rectangles; the solid angle is computed by the arc
/// tangent of Van Oosterom, Strackee 1983, for both triangles together.
#[derive(Clone, Copy, Debug)]
pub struct SphericalRectangle {
    corner: Vec3,
    reference: Vec3,
    /// Unit vectors along the edges, and the normal.
    axis_u: Vec3,
    axis_v: Vec3,
    normal: Vec3,
    /// Position of the corner along the axes relative to the reference point, lengths of the edges, and distance of the plane from
    /// the reference point, all in metres.
    u0: f32,
    v0: f32,
    length_u: f32,
    length_v: f32,
    distance: f32,
    /// z of the unit normals of the planes through the reference point and the edges v = v0 and v = v1.
    b0: f32,
    b1: f32,
    /// 1 - b0^2.
    b0_complement: f32,
    /// Excess over pi of the sum of both interior angles at the edge u = u0: `excess` if `fold` is 1, `excess` plus or minus pi if `fold`
    /// is -1.
    excess: f32,
    fold: f32,
    solid_angle: f32,
}

impl SphericalRectangle {
    /// The rectangle `corner + a * edge_u + b * edge_v`, a and b in 0..1, seen from `reference`. Edges must be perpendicular and of positive
    /// length (for others see [`super::SphericalParallelogram`]).
    #[inline(always)]
    pub fn new(corner: Vec3, edge_u: Vec3, edge_v: Vec3, reference: Vec3) -> SphericalRectangle {
        let (length_u, length_v) = (edge_u.length(), edge_v.length());
        let (axis_u, axis_v) = (edge_u / length_u, edge_v / length_v);
        let normal = axis_u.cross(axis_v);
        let to_corner = corner - reference;
        let (u0, v0) = (to_corner.dot(axis_u), to_corner.dot(axis_v));
        let (u1, v1) = (u0 + length_u, v0 + length_v);
        let distance = to_corner.dot(normal).abs();
        let d2 = distance * distance;
        // The tiny term keeps results finite if the reference point is in the rectangle's plane.
        let inverse_root = |x: f32| 1.0 / (x * x + d2 + 1e-37).sqrt();
        let (inverse_v0, inverse_v1, inverse_u0) = (inverse_root(v0), inverse_root(v1), inverse_root(u0));
        let complement = |inverse: f32| (distance * inverse) * (distance * inverse);
        let (b0_complement, b1_complement) = (complement(inverse_v0), complement(inverse_v1));
        let a0_complement = complement(inverse_u0);
        let (b0, b1, a0) = (-v0 * inverse_v0, v1 * inverse_v1, -u0 * inverse_u0);
        let (excess, fold) = sum_of_arc_sines(
            [b1 * a0, a0 * b0],
            [
                b1_complement + a0_complement - b1_complement * a0_complement,
                b0_complement + a0_complement - b0_complement * a0_complement,
            ],
        );
        SphericalRectangle {
            corner,
            reference,
            axis_u,
            axis_v,
            normal,
            u0,
            v0,
            length_u,
            length_v,
            distance,
            b0,
            b1,
            b0_complement,
            excess,
            fold,
            solid_angle: solid_angle([u0, u1], [v0, v1], [length_u, length_v], distance),
        }
    }

    /// Solid angle, steradians, 0..2 pi.
    #[inline(always)]
    pub fn solid_angle(&self) -> f32 {
        self.solid_angle
    }

    /// Is it sampled by area?
    #[inline(always)]
    fn by_area(&self) -> bool {
        self.solid_angle < MIN_RECTANGLE_SOLID_ANGLE
    }

    /// Samples a point uniformly in solid angle (by area below [`MIN_RECTANGLE_SOLID_ANGLE`]).
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> LightPoint {
        let (x, y) = self.sample_local(u);
        let by_area = self.by_area();
        let x = if by_area { u[0] * self.length_u } else { x };
        let y = if by_area { u[1] * self.length_v } else { y };
        let point = self.corner + self.axis_u * x + self.axis_v * y;
        LightPoint { point, pdf_solid_angle: self.pdf_solid_angle(point) }
    }

    /// The area-preserving map (section 3 of the paper); returns positions along the edges, metres.
    #[inline(always)]
    fn sample_local(&self, u: [f32; 2]) -> (f32, f32) {
        // With au = pi - b the paper's fu is n / sin b, n = -b0 cos b - b1, and 1 / cu^2 - 1 is
        // (n^2 - (1 - b0^2) sin^2 b) / sin^2 b. Here b is `delta`, or differs from it by pi.
        let delta = self.excess - u[0] * self.solid_angle;
        let (half_sine, half_cosine) = poly::sin_cos(0.5 * delta);
        let sine = self.fold * 2.0 * half_sine * half_cosine;
        let folded_b0 = self.fold * self.b0;
        let n = 2.0 * folded_b0 * half_sine * half_sine - (folded_b0 + self.b1);
        let radicand = n * n - self.b0_complement * sine * sine;
        let root = if radicand > 1e-30 { radicand } else { 1e-30 }.sqrt();
        let x = self.distance * sine / root;
        let along_u = clamp((if n < 0.0 { -x } else { x }) - self.u0, self.length_u);
        let x = self.u0 + along_u;

        let d2 = x * x + self.distance * self.distance;
        let v1 = self.v0 + self.length_v;
        let h0 = self.v0 / (d2 + self.v0 * self.v0 + 1e-37).sqrt();
        let h1 = v1 / (d2 + v1 * v1 + 1e-37).sqrt();
        let h = h0 + u[1] * (h1 - h0);
        let rest = (1.0 - h) * (1.0 + h);
        let y = h * (d2 / if rest > 1e-12 { rest } else { 1e-12 }).sqrt();
        (along_u, clamp(y - self.v0, self.length_v))
    }

    /// Solid-angle pdf of [`SphericalRectangle::sample`] for a point of the rectangle.
    #[inline(always)]
    pub fn pdf_solid_angle(&self, point: Vec3) -> f32 {
        let area = self.length_u * self.length_v;
        let of_area = pdf_solid_angle_of_area(point - self.reference, self.normal, area);
        if self.by_area() { of_area } else { 1.0 / self.solid_angle }
    }
}

#[inline(always)]
fn clamp(x: f32, high: f32) -> f32 {
    let x = if x < high { x } else { high };
    if x > 0.0 { x } else { 0.0 }
}

/// asin(p) + asin(q) as (sum, 1), or as (small difference from pi, -1) if both are near a right angle of the same sign. `complements` are
/// 1 - p^2 and 1 - q^2, computed without cancellation.
#[inline(always)]
fn sum_of_arc_sines(values: [f32; 2], complements: [f32; 2]) -> (f32, f32) {
    let magnitudes = map_each(values, f32::abs);
    let roots = map_each(complements, f32::sqrt);
    let near_right_angle = magnitudes[0] > roots[0] && magnitudes[1] > roots[1];
    // The arc sine, or its complement to pi/2.
    let arc = |i: usize| {
        let (y, x) = if near_right_angle { (roots[i], magnitudes[i]) } else { (magnitudes[i], roots[i]) };
        poly::atan2(y, x).copysign(values[i])
    };
    let sum = arc(0) + arc(1);
    let folded = near_right_angle && (values[0] < 0.0) == (values[1] < 0.0);
    (if near_right_angle { -sum } else { sum }, if folded { -1.0 } else { 1.0 })
}

/// Solid angle of a rectangle: tan(solid angle / 2) of both triangles (Van Oosterom, Strackee 1983), multiplied as complex numbers, so that
/// a single arc tangent gives the sum.
#[inline(always)]
fn solid_angle([u0, u1]: [f32; 2], [v0, v1]: [f32; 2], lengths: [f32; 2], distance: f32) -> f32 {
    let d2 = distance * distance;
    let inverse_length = |x: f32, y: f32| 1.0 / (x * x + y * y + d2 + 1e-37).sqrt();
    let (i00, i10) = (inverse_length(u0, v0), inverse_length(u1, v0));
    let (i01, i11) = (inverse_length(u0, v1), inverse_length(u1, v1));
    let c_u0 = (u0 * u1 + v0 * v0 + d2) * i00 * i10;
    let c_1v = (u1 * u1 + v0 * v1 + d2) * i10 * i11;
    let c_u1 = (u0 * u1 + v1 * v1 + d2) * i01 * i11;
    let c_0v = (u0 * u0 + v0 * v1 + d2) * i00 * i01;
    let diagonal = (u0 * u1 + v0 * v1 + d2) * i00 * i11;
    // The triple product of the corners is distance * 2 * area of the triangle.
    let volume = (distance * i00) * (lengths[0] * i11) * lengths[1];
    let (y1, x1) = (volume * i10, 1.0 + c_u0 + c_1v + diagonal);
    let (y2, x2) = (volume * i01, 1.0 + c_u1 + c_0v + diagonal);
    2.0 * poly::atan2(y1 * x2 + x1 * y2, x1 * x2 - y1 * y2)
}
