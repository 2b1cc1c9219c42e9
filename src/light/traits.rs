//! The interface of all lights, and their bounds for light selection (Conty Estevez, Kulla 2018, "Importance Sampling of Many Lights with
//! Adaptive Tree Splitting", sections 4 and 5).

use crate::color::Rgb;
use crate::math::{Bounds3, Vec3, offset_ray_origin, poly};
use crate::texture::CompiledTextures;
use std::f32::consts::PI;

/// The interface of lights: emissive surfaces ([`AreaLight`](super::AreaLight)), lights without a surface
/// ([`PunctualLight`](super::PunctualLight) and its kinds), emissive media ([`VolumeLight`](super::VolumeLight)) and the environment
/// ([`EnvironmentLight`](super::EnvironmentLight)).
///
/// `to` is a point on the light; for lights at infinity, the unit direction to the light.
pub trait LightSource {
    /// Samples a direction from `reference` to the light by two random numbers in 0..1.
    fn sample(&self, textures: &CompiledTextures, reference: Vec3, u: [f32; 2]) -> LightSample;

    /// Pdf per solid angle of [`LightSource::sample`] for `to`; 0 for delta lights, which no other strategy can sample.
    fn pdf_solid_angle(&self, _reference: Vec3, _to: Vec3) -> f32 {
        0.0
    }

    /// Emitted radiance from `to` towards `reference`; 0 for delta lights.
    fn radiance(&self, _textures: &CompiledTextures, _reference: Vec3, _to: Vec3) -> Rgb {
        Rgb::ZERO
    }

    /// Luminance of the power in relative units; for lights at infinity, on a disk of radius 1 m.
    fn power(&self, textures: &CompiledTextures) -> f32;

    /// Spatial and directional bounds; `None` for lights at infinity.
    fn bounds(&self, textures: &CompiledTextures) -> Option<LightBounds>;
}

/// Additional methods of lights without a surface.
pub trait PunctualSource: LightSource + Clone {
    /// Origin of the emission.
    fn origin(&self) -> LightOrigin;

    /// Radiant intensity (W/sr) in a unit direction; for lights at infinity, irradiance (W/m^2) on a surface that faces the light.
    fn intensity(&self, direction: Vec3) -> Rgb;

    /// Interpolates to another light of the same kind, with weight `t` in 0..1.
    fn interpolate(&self, other: &Self, t: f32) -> Self;
}

/// Origin of the emission of a light without a surface.
#[derive(Clone, Copy, Debug)]
pub enum LightOrigin {
    Point(Vec3),
    /// Infinity, in a unit direction.
    Direction(Vec3),
    /// Infinity, in a cone of directions sampled by [`LightSource::sample`].
    Cone,
}

/// A light sample: a direction from a reference point to a light.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Direction to the light, unit length.
    pub wi: Vec3,
    /// End of the shadow ray, just in front of the light. Ignored for [`LightSample::is_infinite`].
    pub target: Vec3,
    /// Is the light infinitely far away?
    pub is_infinite: bool,
    /// Is it a delta light, which no other strategy can sample?
    pub is_delta: bool,
    /// Radiance towards the reference point; for delta lights, irradiance on a surface that faces the light.
    pub radiance: Rgb,
    /// Pdf per solid angle at the reference point, given the light; 1 for delta lights, 0 for no contribution.
    pub pdf_solid_angle: f32,
}

impl LightSample {
    /// No light.
    pub const NONE: LightSample = LightSample {
        wi: Vec3::Z,
        target: Vec3::ZERO,
        is_infinite: false,
        is_delta: false,
        radiance: Rgb::ZERO,
        pdf_solid_angle: 0.0,
    };
}

/// Spatial and directional bounds of one or more lights.
#[derive(Clone, Copy, Debug)]
pub struct LightBounds {
    /// Bounding box of the lights.
    pub bounds: Bounds3,
    /// Sum of the luminances of radiance times area, or of intensity for lights at a point.
    pub weight: f32,
    /// Axis of the normal cone.
    pub axis: Vec3,
    /// Half angle of the normal cone, radians.
    pub normals_rad: f32,
    /// Largest angle between a normal and a direction of emission, radians.
    pub emission_rad: f32,
}

impl LightBounds {
    /// No light.
    pub const DARK: LightBounds = LightBounds {
        bounds: Bounds3 { min: Vec3::ZERO, max: Vec3::ZERO },
        weight: 0.0,
        axis: Vec3::Z,
        normals_rad: 0.0,
        emission_rad: 0.0,
    };

    pub fn union(&self, other: &LightBounds) -> LightBounds {
        let (axis, normals_rad) =
            union_of_cones((self.axis, self.normals_rad), (other.axis, other.normals_rad));
        LightBounds {
            bounds: self.bounds.union(other.bounds),
            weight: self.weight + other.weight,
            axis,
            normals_rad,
            emission_rad: self.emission_rad.max(other.emission_rad),
        }
    }

    /// Cost of a tree node with these bounds: weight times surface area of the box times the measure of lit directions (Conty Estevez,
    /// Kulla 2018, equation 1), regularised for flat boxes by `longest`, the longest edge of the parent box.
    pub fn cost(&self, longest: f32, axis: usize) -> f32 {
        let e = self.bounds.extent();
        let area = 2.0 * (e.x * e.y + e.y * e.z + e.z * e.x);
        let regular = longest / e[axis].max(longest * 1e-3);
        self.weight * self.directions() * regular * area.max(longest * longest * 1e-6)
    }

    /// Measure of the lit directions: the integral of the cosine of the angle to the normal cone.
    fn directions(&self) -> f32 {
        let (o, w) = (self.normals_rad, (self.normals_rad + self.emission_rad).min(PI));
        let (sin_o, cos_o) = poly::sin_cos(o);
        let (_, cos_2) = poly::sin_cos(o - 2.0 * w);
        2.0 * PI * (1.0 - cos_o) + 0.5 * PI * (2.0 * w * sin_o - cos_2 - 2.0 * o * sin_o + cos_o)
    }
}

/// The smallest cone (axis, half angle) that contains two cones, up to rounding.
fn union_of_cones(a: (Vec3, f32), b: (Vec3, f32)) -> (Vec3, f32) {
    let (a, b) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    // The common cases: equal axes, or all directions.
    if a.1 >= PI || a.0 == b.0 {
        return a;
    }
    let between = angle(a.0, b.0);
    if (between + b.1).min(PI) <= a.1 {
        return a;
    }
    let half = 0.5 * (a.1 + between + b.1);
    if half >= PI {
        return (a.0, PI);
    }
    // Rotates the axis of `a` towards that of `b`.
    let across = a.0.cross(b.0).cross(a.0).normalize_or_zero();
    if across == Vec3::ZERO {
        return (a.0, PI);
    }
    let (s, c) = poly::sin_cos(half - a.1);
    ((a.0 * c + across * s).normalize(), half)
}

fn angle(a: Vec3, b: Vec3) -> f32 {
    poly::atan2(a.cross(b).length(), a.dot(b))
}

/// Is a point in a plane, within the rounding error of the plane's points?
#[inline(always)]
pub(super) fn is_in_plane(p: Vec3, on_plane: Vec3, normal: Vec3, point_error: Vec3) -> bool {
    let distance = (p - on_plane).dot(normal).abs();
    distance <= 4.0 * point_error.dot(normal.abs())
}

/// The direction from `p` to a sampled point of an emissive surface (normal, rounding error of points, two-sided).
#[inline(always)]
pub(super) fn direction_to_point(
    p: Vec3,
    point: Vec3,
    pdf_solid_angle: f32,
    (normal, point_error, two_sided): (Vec3, Vec3, bool),
) -> LightDirection {
    let to_light = point - p;
    let distance = to_light.length();
    let is_lit = two_sided | (to_light.dot(normal) < 0.0);
    LightDirection {
        wi: to_light / if distance > 0.0 { distance } else { 1.0 },
        target: offset_ray_origin(point, point_error, normal, -to_light),
        pdf_solid_angle: if is_lit & (distance > 0.0) { pdf_solid_angle } else { 0.0 },
    }
}

/// A direction towards a light.
#[derive(Clone, Copy, Debug)]
pub struct LightDirection {
    /// Unit length.
    pub wi: Vec3,
    /// End of a shadow ray; unused for lights at infinity.
    pub target: Vec3,
    /// Pdf per solid angle; 0 if no light arrives.
    pub pdf_solid_angle: f32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::Random;
    use crate::sampling::warp;

    #[test]
    fn union_of_cones_contains_both() {
        let mut random = Random::new(11);
        for _ in 0..20_000 {
            let mut cone = || {
                let axis = warp::uniform_sphere([random.next(), random.next()]);
                (axis, random.next().powi(2) * PI)
            };
            let (a, b) = (cone(), cone());
            let (axis, half) = union_of_cones(a, b);
            for (inner, half_inner) in [a, b] {
                let reach = (angle(axis, inner) + half_inner).min(PI);
                assert!(reach <= half + 1e-4, "{a:?} {b:?}: {axis} {half}");
            }
        }
    }

    #[test]
    fn measure_of_lit_directions_is_exact() {
        let light = |normals_rad, emission_rad| LightBounds {
            bounds: Bounds3::of([Vec3::ZERO]),
            weight: 1.0,
            axis: Vec3::Z,
            normals_rad,
            emission_rad,
        };
        // The integral of the cosine over a hemisphere is pi; over all directions, each with its own normal, 4 pi.
        assert!((light(0.0, 0.5 * PI).directions() - PI).abs() < 1e-5);
        assert!((light(PI, 0.5 * PI).directions() - 4.0 * PI).abs() < 1e-5);
    }
}
