//! The interface of all lights, and bounds on their light for the choice among many (Conty Estevez, Kulla 2018, "Importance
//! Sampling of Many Lights with Adaptive Tree Splitting", sections 4 and 5).

use crate::color::Rgb;
use crate::math::{Bounds3, Vec3, poly};
use crate::texture::CompiledTextures;
use std::f32::consts::PI;

/// The interface of lights: emissive surfaces ([`AreaLight`](super::AreaLight)), lights without a surface
/// ([`PunctualLight`](super::PunctualLight) and its kinds) and the environment
/// ([`EnvironmentLight`](super::EnvironmentLight)).
///
/// `to` is a point of the light or, of one at infinity, the unit direction towards it.
pub trait LightSource {
    /// A direction from `reference` towards the light, by two numbers in 0..1.
    fn sample(&self, textures: &CompiledTextures, reference: Vec3, u: [f32; 2]) -> LightSample;

    /// Density per solid angle with which [`LightSource::sample`] returns `to`; 0 for delta lights, which no other strategy finds.
    fn pdf_solid_angle(&self, _reference: Vec3, _to: Vec3) -> f32 {
        0.0
    }

    /// Emitted radiance from `to` towards `reference`; 0 for delta lights.
    fn radiance(&self, _textures: &CompiledTextures, _reference: Vec3, _to: Vec3) -> Rgb {
        Rgb::ZERO
    }

    /// Luminous power in relative units; of a light at infinity that on a disk of radius 1 m.
    fn power(&self, textures: &CompiledTextures) -> f32;

    /// Bounds on where its light comes from and goes; `None` for a light at infinity.
    fn bounds(&self, textures: &CompiledTextures) -> Option<LightBounds>;
}

/// Additional methods of lights without a surface.
pub trait PunctualSource: LightSource + Clone {
    /// Where its light starts.
    fn origin(&self) -> LightOrigin;

    /// Radiant intensity (W/sr) in a unit direction; of a light at infinity the irradiance (W/m2) of a surface that faces it.
    fn intensity(&self, direction: Vec3) -> Rgb;

    /// The light between this one and another of its kind, at a share of 0..1.
    fn interpolate(&self, other: &Self, share: f32) -> Self;
}

/// Where the light of a light without a surface starts.
#[derive(Clone, Copy, Debug)]
pub enum LightOrigin {
    /// At a point.
    Point(Vec3),
    /// At infinity, in the unit direction.
    Direction(Vec3),
    /// At infinity, in a cone of directions that [`LightSource::sample`] chooses from.
    Cone,
}

/// Light that may reach a reference point from one point or direction of a light.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Towards the light, unit length.
    pub wi: Vec3,
    /// Where a shadow ray ends: just in front of the light. Ignored for [`LightSample::is_infinite`].
    pub target: Vec3,
    /// The light is infinitely far away.
    pub is_infinite: bool,
    /// No other strategy finds this light: it has no size.
    pub is_delta: bool,
    /// Radiance towards the reference point; for delta lights the irradiance of a surface that faces the light.
    pub radiance: Rgb,
    /// Density per solid angle at the reference point, given the light; 1 for delta lights, 0 for no contribution.
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

/// Bounds on the light of one or more lights.
#[derive(Clone, Copy, Debug)]
pub struct LightBounds {
    /// Box around the lights.
    pub bounds: Bounds3,
    /// Sum of radiance times area (of intensities for lights without size), by luminance.
    pub weight: f32,
    /// Axis of the cone of normals.
    pub axis: Vec3,
    /// Largest angle between a normal and the axis, radians.
    pub normals_rad: f32,
    /// Largest angle between a normal and a direction that is lit, radians.
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

    /// Bounds of both.
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

    /// Cost of a tree node with these bounds: weight times area of the box times the measure of lit directions (their equation 1 with
    /// the regularisation for flat boxes by `longest`, the longest edge of the box that is being split).
    pub fn cost(&self, longest: f32, axis: usize) -> f32 {
        let e = self.bounds.extent();
        let area = 2.0 * (e.x * e.y + e.y * e.z + e.z * e.x);
        let regular = longest / e[axis].max(longest * 1e-3);
        self.weight * self.directions() * regular * area.max(longest * longest * 1e-6)
    }

    /// Measure of the lit directions: the integral of the cosine over the cone that widens from the normals' by the
    /// emission's.
    fn directions(&self) -> f32 {
        let (o, w) = (self.normals_rad, (self.normals_rad + self.emission_rad).min(PI));
        let (sin_o, cos_o) = poly::sin_cos(o);
        let (_, cos_2) = poly::sin_cos(o - 2.0 * w);
        2.0 * PI * (1.0 - cos_o) + 0.5 * PI * (2.0 * w * sin_o - cos_2 - 2.0 * o * sin_o + cos_o)
    }
}

/// The smallest cone around two, up to rounding: their axes and half angles.
fn union_of_cones(a: (Vec3, f32), b: (Vec3, f32)) -> (Vec3, f32) {
    let (a, b) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    // The common cases: all lights face down, or emit all around.
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
    // Turns a's axis towards b's.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::Random;
    use crate::sampling::warp;

    #[test]
    fn cones_hold_what_they_were_made_of() {
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
    fn a_flat_light_sends_half_of_what_a_point_does() {
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
