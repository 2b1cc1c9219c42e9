//! Lights without a surface (KHR_lights_punctual).

use super::cone::Cone;
use super::profiled::Profiled;
use super::{LightBounds, LightSample, Sun};
use crate::color::Rgb;
use crate::math::{Bounds3, DVec3, Vec3};
use crate::scene;
use std::f32::consts::PI;

/// A light without a surface, ready for rendering.
#[derive(Clone, Debug)]
pub struct PunctualLight {
    intensity: Rgb,
    kind: Kind,
}

/// Where light without a surface starts.
#[derive(Clone, Copy, Debug)]
pub enum Source<'a> {
    /// At a point.
    At(Vec3),
    /// Infinitely far away in a direction.
    Far(Vec3),
    /// Infinitely far away in the directions of a disk.
    Disk(&'a Sun),
}

#[derive(Clone, Debug)]
enum Kind {
    Point(Vec3),
    Spot { position: Vec3, cone: Cone },
    Profiled(Box<Profiled>),
    Directional { to_light: Vec3 },
    Sun(Sun),
}

impl PunctualLight {
    /// Prepares a light; the world's origin moves to `world_origin`.
    pub fn new(light: &scene::Light, world_origin: DVec3) -> PunctualLight {
        let local = |p: DVec3| (p - world_origin).as_vec3();
        let kind = match light.kind {
            scene::LightKind::Point { position } => Kind::Point(local(position)),
            scene::LightKind::Spot { position, direction, inner_angle_rad, outer_angle_rad, fade } => {
                let cone = Cone::new(direction, inner_angle_rad, outer_angle_rad, fade);
                Kind::Spot { position: local(position), cone }
            }
            scene::LightKind::Profiled { position, rotation, cone } => {
                Kind::Profiled(Box::new(Profiled::new(light, local(position), rotation, cone)))
            }
            scene::LightKind::Directional { direction } => {
                Kind::Directional { to_light: -direction.normalize().as_vec3() }
            }
            scene::LightKind::Sun { direction, angle_rad } => {
                Kind::Sun(Sun::new(direction, angle_rad, Rgb::from_array(light.intensity)))
            }
        };
        PunctualLight { intensity: Rgb::from_array(light.intensity), kind }
    }

    /// It on its way to another light of the same kind: places go along straight lines, directions turn evenly. (Suns, which are
    /// met by chance as well, stay.)
    pub fn towards(&self, other: &PunctualLight, share: f32) -> PunctualLight {
        let place = |a: Vec3, b: Vec3| a + (b - a) * share;
        let way = |a: Vec3, b: Vec3| place(a, b).try_normalize().unwrap_or(a);
        let kind = match (&self.kind, &other.kind) {
            (Kind::Point(a), Kind::Point(b)) => Kind::Point(place(*a, *b)),
            (Kind::Profiled(a), Kind::Profiled(b)) => Kind::Profiled(Box::new(a.towards(b, share))),
            (Kind::Spot { position: a, cone }, Kind::Spot { position: b, cone: turned }) => {
                let axis = way(cone.axis, turned.axis);
                Kind::Spot { position: place(*a, *b), cone: cone.about(axis) }
            }
            (Kind::Directional { to_light: a }, Kind::Directional { to_light: b }) => {
                Kind::Directional { to_light: way(*a, *b) }
            }
            (own, _) => own.clone(),
        };
        PunctualLight { intensity: self.intensity, kind }
    }

    /// It as a sun, which paths may meet, too.
    pub fn sun(&self) -> Option<&Sun> {
        if let Kind::Sun(sun) = &self.kind { Some(sun) } else { None }
    }

    /// Where its light starts.
    pub fn source(&self) -> Source<'_> {
        match &self.kind {
            Kind::Point(position) | Kind::Spot { position, .. } => Source::At(*position),
            Kind::Profiled(profiled) => Source::At(profiled.position),
            Kind::Directional { to_light } => Source::Far(*to_light),
            Kind::Sun(sun) => Source::Disk(sun),
        }
    }

    /// What it sends in a direction of unit length: radiant intensity, of one infinitely far away the irradiance of what faces it.
    pub fn intensity(&self, direction: Vec3) -> Rgb {
        match &self.kind {
            Kind::Spot { cone, .. } => self.intensity * cone.attenuation(direction.dot(cone.axis)),
            Kind::Profiled(profiled) => self.intensity * profiled.share(direction),
            _ => self.intensity,
        }
    }

    /// Luminous power in relative units; a directional light's is what falls on a disk of radius 1.
    pub fn power(&self) -> f32 {
        let solid_angle = match &self.kind {
            Kind::Point(_) => 4.0 * PI,
            Kind::Spot { cone, .. } => cone.solid_angle(),
            Kind::Profiled(profiled) => 4.0 * PI * profiled.mean,
            Kind::Directional { .. } | Kind::Sun(_) => PI,
        };
        self.intensity.luminance() * solid_angle
    }

    /// Luminance of the irradiance of a surface that faces it, if it is infinitely far away.
    pub fn irradiance(&self) -> Option<f32> {
        let is_far = matches!(self.kind, Kind::Directional { .. } | Kind::Sun(_));
        is_far.then(|| self.intensity.luminance())
    }

    /// Where it is; `None` for one infinitely far away.
    pub fn position(&self) -> Option<Vec3> {
        match &self.kind {
            Kind::Point(position) | Kind::Spot { position, .. } => Some(*position),
            Kind::Profiled(profiled) => Some(profiled.position),
            Kind::Directional { .. } | Kind::Sun(_) => None,
        }
    }

    /// Where its light comes from and goes; `None` for one infinitely far away.
    pub fn bounds(&self) -> Option<LightBounds> {
        let (position, axis, normals_rad, emission_rad) = match &self.kind {
            Kind::Directional { .. } | Kind::Sun(_) => return None,
            Kind::Profiled(profiled) => (profiled.position, Vec3::Z, PI, 0.5 * PI),
            Kind::Point(position) => (*position, Vec3::Z, PI, 0.5 * PI),
            Kind::Spot { position, cone } => {
                let [inner, outer] = cone.angles_rad();
                // A little wider, for rounding.
                (*position, cone.axis, inner, (outer - inner + 1e-3).min(0.5 * PI))
            }
        };
        let mean = if let Kind::Profiled(profiled) = &self.kind { profiled.mean } else { 1.0 };
        let weight = self.intensity.luminance() * mean;
        Some(LightBounds { bounds: Bounds3::of([position]), weight, axis, normals_rad, emission_rad })
    }

    /// What arrives at `reference`; two numbers in 0..1 choose the direction of lights that have a size.
    #[inline]
    pub fn sample(&self, reference: Vec3, u: [f32; 2]) -> LightSample {
        let (position, attenuation) = match &self.kind {
            Kind::Directional { to_light } => {
                return LightSample {
                    wi: *to_light,
                    target: Vec3::ZERO,
                    is_infinite: true,
                    is_delta: true,
                    radiance: self.intensity,
                    pdf_solid_angle: 1.0,
                };
            }
            Kind::Sun(sun) => return sun.sample(u),
            Kind::Point(position) => (*position, 1.0),
            Kind::Profiled(profiled) => {
                (profiled.position, profiled.share((reference - profiled.position).normalize_or_zero()))
            }
            Kind::Spot { position, cone } => {
                let cosine = (reference - *position).normalize_or_zero().dot(cone.axis);
                (*position, cone.attenuation(cosine))
            }
        };
        let to_light = position - reference;
        let distance_squared = to_light.length_squared();
        if attenuation <= 0.0 || distance_squared <= 0.0 {
            return LightSample::NONE;
        }
        LightSample {
            wi: to_light / distance_squared.sqrt(),
            target: position,
            is_infinite: false,
            is_delta: true,
            radiance: self.intensity * (attenuation / distance_squared),
            pdf_solid_angle: 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Light, LightKind, SpotFade};

    /// What a spot light of intensity 1 that looks down -z sends to a point at an angle, one metre away.
    fn spot(fade: SpotFade, angle: f64) -> f32 {
        let kind = LightKind::Spot {
            position: DVec3::ZERO,
            direction: DVec3::NEG_Z,
            inner_angle_rad: 0.3,
            outer_angle_rad: 0.6,
            fade,
        };
        let light = PunctualLight::new(&Light::new(kind, [1.0; 3]), DVec3::ZERO);
        light.sample(DVec3::new(angle.sin(), 0.0, -angle.cos()).as_vec3(), [0.5; 2]).radiance.r
    }

    #[test]
    fn cones_fade_between_their_angles() {
        for fade in [SpotFade::Square, SpotFade::Smooth] {
            assert!((spot(fade, 0.0) - 1.0).abs() < 1e-5);
            assert!(spot(fade, 0.61) == 0.0 && spot(fade, 0.59) > 0.0);
        }
        assert!((spot(SpotFade::Square, 0.29) - 1.0).abs() < 1e-5);
        // Halfway in the cosine: a quarter, and of the smooth step a half.
        let middle = (0.5 * (0.3f64.cos() + 0.6f64.cos())).acos();
        assert!((spot(SpotFade::Square, middle) - 0.25).abs() < 1e-5);
        let middle = (0.6f64.cos() + 0.25 * (1.0 - 0.6f64.cos())).acos();
        assert!((spot(SpotFade::Smooth, middle) - 0.5).abs() < 1e-5);
    }
}
