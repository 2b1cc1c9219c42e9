//! Spheres as seen from a point: from outside the cone that they subtend (Pharr, Jakob, Humphreys 2023, section
//! 6.2.4), from inside their whole surface.

use super::{LightPoint, pdf_solid_angle_of_area, warp};
use crate::math::{Frame, Vec3, poly};
use std::f32::consts::PI;

/// A sphere as seen from a reference point.
#[derive(Clone, Copy, Debug)]
pub struct SphereSampler {
    center: Vec3,
    radius: f32,
    reference: Vec3,
    /// Axis from the reference point to the centre.
    frame: Frame,
    /// Squared sine of the cone's half angle, and 1 - its cosine.
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
        // (d - r)(d + r) / d^2 keeps its digits for a point just above the surface.
        let cos_squared = ((safe - radius) / safe) * ((safe + radius) / safe);
        let omc = warp::one_minus_cos(sin_squared, if cos_squared > 0.0 { cos_squared } else { 0.0 });
        SphereSampler {
            center,
            radius,
            reference,
            frame: Frame::from_normal(direction),
            sin_squared_max: sin_squared,
            // Beyond 1e17 radii the density would overflow.
            one_minus_cos_max: if omc > 1e-35 { omc } else { 1e-35 },
            inside,
        }
    }

    /// The solid angle, steradians; 4 pi from inside.
    #[inline(always)]
    pub fn solid_angle(&self) -> f32 {
        if self.inside { 4.0 * PI } else { 2.0 * PI * self.one_minus_cos_max }
    }

    /// A point on the sphere: the nearer intersection of a direction uniform in the cone; from inside uniform by area.
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> LightPoint {
        let on_cone = self.outward_normal_in_cone(u);
        let anywhere = warp::uniform_sphere(u);
        let normal = if self.inside { anywhere } else { on_cone };
        let point = self.center + normal * self.radius;
        LightPoint { point, pdf_solid_angle: self.pdf_solid_angle(point) }
    }

    /// The sphere's outward unit normal where a random direction in the cone first meets it.
    #[inline(always)]
    fn outward_normal_in_cone(&self, u: [f32; 2]) -> Vec3 {
        // theta: from the axis at the reference point; alpha: from the axis at the centre, towards the reference.
        let h = u[0] * self.one_minus_cos_max;
        let cos_theta = 1.0 - h;
        let sin_squared = h * (2.0 - h);
        let ratio = sin_squared / if self.sin_squared_max > 0.0 { self.sin_squared_max } else { 1.0 };
        let rest = if ratio < 1.0 { 1.0 - ratio } else { 0.0 };
        let (sine_max, root) = (self.sin_squared_max.sqrt(), rest.sqrt());
        let cos_alpha = sin_squared / if sine_max > 0.0 { sine_max } else { 1.0 } + cos_theta * root;
        // By the law of sines from the distance to the point; 1 - cos^2 would lose the digits of small angles.
        let ratio = if ratio < 1.0 { ratio } else { 1.0 };
        let sin_alpha = ratio.sqrt() * (cos_theta - sine_max * root);
        let (s, c) = poly::sin_cos_turns(u[1]);
        self.frame.to_world(Vec3::new(sin_alpha * c, sin_alpha * s, -cos_alpha))
    }

    /// Density per solid angle with which [`SphereSampler::sample`] returns a visible point of the sphere.
    #[inline(always)]
    pub fn pdf_solid_angle(&self, point: Vec3) -> f32 {
        let area = 4.0 * PI * self.radius * self.radius;
        let normal = (point - self.center) / self.radius;
        let of_area = pdf_solid_angle_of_area(point - self.reference, normal, area);
        if self.inside { of_area } else { warp::uniform_cone_pdf_solid_angle(self.one_minus_cos_max) }
    }
}
