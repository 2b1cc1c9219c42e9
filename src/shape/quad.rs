//! Parallelograms, which rays meet as two triangles each: boxes, and points uniform over the solid angle (see
//! [`super::SphericalRectangle`] for those with right angles).

use super::point::LightPoint;
use super::triangle::is_collapsed;
use super::triangle_light::{
    Directions, MIN_TRIANGLE_SOLID_ANGLE, clamp01, pdf_of_either, plane_coordinates,
};
use crate::math::{Bounds3, Vec3};

/// A parallelogram: the points `corner + u edge_u + v edge_v` with u and v from 0 to 1. Its corners are rounded to f32,
/// and it meets exactly what shares two of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quad {
    /// Where u and v are 0.
    pub corner: Vec3,
    /// From the corner along u.
    pub edge_u: Vec3,
    /// From the corner along v.
    pub edge_v: Vec3,
}

impl Quad {
    /// The corners in order around it. All code takes them from here, so that they agree to the bit.
    pub fn corners(&self) -> [Vec3; 4] {
        let (a, u, v) = (self.corner, self.edge_u, self.edge_v);
        [a, a + u, (a + u) + v, a + v]
    }

    /// The box around it.
    pub fn bounds(&self) -> Bounds3 {
        Bounds3::of(self.corners())
    }

    /// Has it no area that a ray could hit?
    pub fn is_collapsed(&self) -> bool {
        let [a, b, c, d] = self.corners();
        is_collapsed([a, b, c]) && is_collapsed([a, c, d])
    }
}

/// A parallelogram as seen from a reference point: two spherical triangles that share a diagonal.
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
    /// `corner + a * edge_u + b * edge_v`, a and b in 0..1, seen from `reference`.
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

    /// The solid angle, steradians, 0 to 2 pi.
    #[inline(always)]
    pub fn solid_angle(&self) -> f32 {
        self.lower.solid_angle + self.upper.solid_angle
    }

    /// A point on the parallelogram, uniform in solid angle (by area below [`MIN_TRIANGLE_SOLID_ANGLE`]).
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> LightPoint {
        let total = self.solid_angle();
        let target = u[0] * total;
        let in_lower = target < self.lower.solid_angle;
        let chosen = if in_lower { self.lower } else { self.upper };
        let offset = if in_lower { 0.0 } else { self.lower.solid_angle };
        let share = if chosen.solid_angle > 0.0 { chosen.solid_angle } else { 1.0 };
        let w = chosen.sample([clamp01((target - offset) / share), u[1]]);
        let (a, b) = plane_coordinates(self.corner - self.reference, self.edge_u, self.edge_v, w);
        let by_area = total < MIN_TRIANGLE_SOLID_ANGLE;
        let a = if by_area { u[0] } else { clamp01(a) };
        let b = if by_area { u[1] } else { clamp01(b) };
        let point = self.corner + self.edge_u * a + self.edge_v * b;
        LightPoint { point, pdf_solid_angle: self.pdf_solid_angle(point) }
    }

    /// Density per solid angle with which [`SphericalParallelogram::sample`] returns a point of the parallelogram.
    #[inline(always)]
    pub fn pdf_solid_angle(&self, point: Vec3) -> f32 {
        pdf_of_either(point - self.reference, self.unit_normal, self.area, self.solid_angle())
    }
}
