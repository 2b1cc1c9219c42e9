//! Points of surfaces: met by rays, or chosen as light sources.

use crate::math::Vec3;

/// A point of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// The point.
    pub p: Vec3,
    /// The true point lies within this box around it.
    pub p_error: Vec3,
    /// Unit geometric normal on the front.
    pub ng: Vec3,
    /// Unit shading normal, on the same side as `ng`.
    pub ns: Vec3,
    /// Its material.
    pub material: u32,
}

/// A point on a light, chosen as seen from a reference point.
#[derive(Clone, Copy, Debug)]
pub struct LightPoint {
    /// Where it is, in the space of the light's corners.
    pub point: Vec3,
    /// Density per solid angle at the reference point; 0 where the light can't be seen (edge on): such a sample counts
    /// as no contribution.
    pub pdf_solid_angle: f32,
}

/// Density per solid angle of a uniform point on a flat light of area `area`.
/// `to_point` leads from the reference point to the light, `unit_normal` is the light's (either side).
/// 0 where the light is seen exactly edge on.
#[inline(always)]
pub fn pdf_solid_angle_of_area(to_point: Vec3, unit_normal: Vec3, area: f32) -> f32 {
    let distance_squared = to_point.length_squared();
    // cos / distance * area, all over distance^2.
    let projected = to_point.dot(unit_normal).abs() * area;
    let pdf = distance_squared * distance_squared.sqrt() / if projected > 0.0 { projected } else { 1.0 };
    let visible = projected > 0.0 && pdf < f32::MAX;
    if visible { pdf } else { 0.0 }
}
