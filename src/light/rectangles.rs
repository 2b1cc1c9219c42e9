//! Rectangles that shine evenly, in a form that many vertices can sample at a time.

use super::{AreaLight, AreaShape, Beam, Edges, Radiance};
use crate::color::Rgb;
use crate::math::{Vec3, offset_ray_origin};
use crate::shape::SphericalRectangle;

/// A rectangle of the same radiance everywhere and in all directions: all that sampling it takes.
#[derive(Clone, Copy, Debug)]
pub struct EvenRectangle {
    /// Emitted radiance.
    pub radiance: Rgb,
    edges: Edges,
    normal: Vec3,
    point_error: Vec3,
    two_sided: bool,
}

/// Numbers that describe an [`EvenRectangle`].
pub const RECTANGLE_NUMBERS: usize = 19;

/// A direction towards a light.
#[derive(Clone, Copy, Debug)]
pub struct LightDirection {
    /// Unit length.
    pub wi: Vec3,
    /// Where a shadow ray ends; of no use for lights infinitely far away.
    pub target: Vec3,
    /// Density per solid angle; 0 where the light can't be reached.
    pub pdf_solid_angle: f32,
}

impl EvenRectangle {
    /// A light, if it is such a rectangle.
    pub fn of(light: &AreaLight) -> Option<EvenRectangle> {
        match (light.shape, light.radiance) {
            (AreaShape::Rectangle(edges), Radiance::Constant(radiance)) if light.beam == Beam::Even => {
                let (normal, point_error, two_sided) = (light.normal, light.point_error(), light.two_sided);
                Some(EvenRectangle { radiance, edges, normal, point_error, two_sided })
            }
            _ => None,
        }
    }

    /// The direction from `p` to a point that two numbers in 0..1 choose, uniformly in solid angle.
    #[inline(always)]
    pub fn direction(&self, p: Vec3, u: [f32; 2]) -> LightDirection {
        let Edges { corner, edge_u, edge_v } = self.edges;
        let s = SphericalRectangle::new(corner, edge_u, edge_v, p).sample(u);
        let to_light = s.point - p;
        let distance = to_light.length();
        let is_lit = (self.two_sided | (to_light.dot(self.normal) < 0.0)) & !self.is_level_with(p);
        LightDirection {
            wi: to_light / if distance > 0.0 { distance } else { 1.0 },
            target: offset_ray_origin(s.point, self.point_error, self.normal, -to_light),
            pdf_solid_angle: if is_lit & (distance > 0.0) { s.pdf_solid_angle } else { 0.0 },
        }
    }

    /// As [`AreaLight::is_level_with`].
    #[inline(always)]
    fn is_level_with(&self, p: Vec3) -> bool {
        let height = (p - self.edges.corner).dot(self.normal).abs();
        height <= 4.0 * self.point_error.dot(self.normal.abs())
    }

    /// Its numbers, for tables and arrays.
    #[inline(always)]
    pub fn pack(&self) -> [f32; RECTANGLE_NUMBERS] {
        let Edges { corner: c, edge_u: u, edge_v: v } = self.edges;
        let (n, e, [r, g, b]) = (self.normal, self.point_error, self.radiance.to_array());
        let two_sided = f32::from(u8::from(self.two_sided));
        [c.x, c.y, c.z, u.x, u.y, u.z, v.x, v.y, v.z, n.x, n.y, n.z, e.x, e.y, e.z, r, g, b, two_sided]
    }

    /// From its numbers.
    #[inline(always)]
    pub fn unpack(numbers: [f32; RECTANGLE_NUMBERS]) -> EvenRectangle {
        let [cx, cy, cz, ux, uy, uz, vx, vy, vz, nx, ny, nz, ex, ey, ez, r, g, b, two_sided] = numbers;
        EvenRectangle {
            radiance: Rgb::new(r, g, b),
            edges: Edges {
                corner: Vec3::new(cx, cy, cz),
                edge_u: Vec3::new(ux, uy, uz),
                edge_v: Vec3::new(vx, vy, vz),
            },
            normal: Vec3::new(nx, ny, nz),
            point_error: Vec3::new(ex, ey, ez),
            two_sided: two_sided != 0.0,
        }
    }
}
