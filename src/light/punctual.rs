//! Lights without a surface: point, spot, and point with a measured profile (IES); at infinity directional lights and suns.

use super::traits::{LightBounds, LightOrigin, LightSample, LightSource, PunctualSource};
use crate::color::Rgb;
use crate::math::{Bounds3, DQuat, DVec3, Frame, Quat, Vec3, poly};
use crate::sampling::warp::{uniform_cone, uniform_cone_pdf_solid_angle};
use crate::scene;
use crate::scene::{LightProfile, SpotFalloff};
use crate::texture::CompiledTextures;
use std::f32::consts::PI;
use std::sync::Arc;

/// Steps of the vertical angle for the mean of a profile.
const STEPS: u32 = 32;

/// An isotropic point light.
#[derive(Clone, Debug)]
pub struct Point {
    position: Vec3,
    /// Radiant intensity, W/sr.
    intensity: Rgb,
}

impl Point {
    pub(super) fn of_scene(light: &scene::Light, world_origin: DVec3, position: DVec3) -> Point {
        Point { position: local(position, world_origin), intensity: Rgb::from_array(light.intensity) }
    }
}

/// A spot light.
#[derive(Clone, Debug)]
pub struct Spot {
    position: Vec3,
    /// Radiant intensity along the axis, W/sr.
    intensity: Rgb,
    cone: SpotCone,
}

impl Spot {
    pub(super) fn of_scene(
        light: &scene::Light,
        world_origin: DVec3,
        position: DVec3,
        direction: DVec3,
        inner_angle_rad: f64,
        outer_angle_rad: f64,
        falloff: SpotFalloff,
    ) -> Spot {
        Spot {
            position: local(position, world_origin),
            intensity: Rgb::from_array(light.intensity),
            cone: SpotCone::new(direction, inner_angle_rad, outer_angle_rad, falloff),
        }
    }
}

/// A point light with a measured profile (IES).
#[derive(Clone, Debug)]
pub struct Profiled {
    position: Vec3,
    /// Maximum radiant intensity, W/sr.
    intensity: Rgb,
    /// Mean intensity over all directions relative to the maximum.
    mean: f32,
    aim: Aim,
    profile: Option<Arc<LightProfile>>,
}

impl Profiled {
    pub(super) fn of_scene(
        light: &scene::Light,
        world_origin: DVec3,
        position: DVec3,
        rotation: DQuat,
        cone: Option<[f64; 2]>,
    ) -> Profiled {
        let profile = light.profile.clone();
        Profiled {
            position: local(position, world_origin),
            intensity: Rgb::from_array(light.intensity),
            mean: profile.as_ref().map_or(1.0, |profile| relative_mean(profile)),
            aim: Aim::new(rotation, cone),
            profile,
        }
    }
}

fn local(position: DVec3, world_origin: DVec3) -> Vec3 {
    (position - world_origin).as_vec3()
}

fn interpolated(a: Vec3, b: Vec3, t: f32) -> Vec3 {
    a + (b - a) * t
}

/// A sample of a light at a point; `attenuation` is the intensity towards `reference` relative to `intensity`.
#[inline(always)]
fn sample_point(position: Vec3, intensity: Rgb, attenuation: f32, reference: Vec3) -> LightSample {
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
        radiance: intensity * (attenuation / distance_squared),
        pdf_solid_angle: 1.0,
    }
}

/// Bounds of a point light that emits in all directions.
fn isotropic_bounds(position: Vec3, weight: f32) -> LightBounds {
    let bounds = Bounds3::of([position]);
    LightBounds { bounds, weight, axis: Vec3::Z, normals_rad: PI, emission_rad: 0.5 * PI }
}

impl LightSource for Point {
    #[inline(always)]
    fn sample(&self, _textures: &CompiledTextures, reference: Vec3, _u: [f32; 2]) -> LightSample {
        sample_point(self.position, self.intensity, 1.0, reference)
    }

    fn power(&self, _textures: &CompiledTextures) -> f32 {
        self.intensity.luminance() * (4.0 * PI)
    }

    fn bounds(&self, _textures: &CompiledTextures) -> Option<LightBounds> {
        Some(isotropic_bounds(self.position, self.intensity.luminance()))
    }
}

impl PunctualSource for Point {
    fn origin(&self) -> LightOrigin {
        LightOrigin::Point(self.position)
    }

    fn intensity(&self, _direction: Vec3) -> Rgb {
        self.intensity
    }

    fn interpolate(&self, other: &Point, t: f32) -> Point {
        Point { position: interpolated(self.position, other.position, t), ..*self }
    }
}

impl LightSource for Spot {
    #[inline(always)]
    fn sample(&self, _textures: &CompiledTextures, reference: Vec3, _u: [f32; 2]) -> LightSample {
        let cosine = (reference - self.position).normalize_or_zero().dot(self.cone.axis);
        sample_point(self.position, self.intensity, self.cone.attenuation(cosine), reference)
    }

    fn power(&self, _textures: &CompiledTextures) -> f32 {
        self.intensity.luminance() * self.cone.solid_angle()
    }

    fn bounds(&self, _textures: &CompiledTextures) -> Option<LightBounds> {
        let [inner, outer] = self.cone.angles_rad();
        Some(LightBounds {
            bounds: Bounds3::of([self.position]),
            weight: self.intensity.luminance(),
            axis: self.cone.axis,
            normals_rad: inner,
            // Slightly wider, for rounding.
            emission_rad: (outer - inner + 1e-3).min(0.5 * PI),
        })
    }
}

impl PunctualSource for Spot {
    fn origin(&self) -> LightOrigin {
        LightOrigin::Point(self.position)
    }

    fn intensity(&self, direction: Vec3) -> Rgb {
        self.intensity * self.cone.attenuation(direction.dot(self.cone.axis))
    }

    fn interpolate(&self, other: &Spot, t: f32) -> Spot {
        let axis = self.cone.axis;
        let axis = interpolated(axis, other.cone.axis, t).try_normalize().unwrap_or(axis);
        Spot {
            position: interpolated(self.position, other.position, t),
            cone: self.cone.about(axis),
            ..*self
        }
    }
}

impl LightSource for Profiled {
    fn sample(&self, _textures: &CompiledTextures, reference: Vec3, _u: [f32; 2]) -> LightSample {
        let direction = (reference - self.position).normalize_or_zero();
        let attenuation = self.aim.attenuation(self.profile.as_deref(), direction);
        sample_point(self.position, self.intensity, attenuation, reference)
    }

    fn power(&self, _textures: &CompiledTextures) -> f32 {
        self.intensity.luminance() * (4.0 * PI * self.mean)
    }

    fn bounds(&self, _textures: &CompiledTextures) -> Option<LightBounds> {
        Some(isotropic_bounds(self.position, self.intensity.luminance() * self.mean))
    }
}

impl PunctualSource for Profiled {
    fn origin(&self) -> LightOrigin {
        LightOrigin::Point(self.position)
    }

    fn intensity(&self, direction: Vec3) -> Rgb {
        self.intensity * self.aim.attenuation(self.profile.as_deref(), direction)
    }

    fn interpolate(&self, other: &Profiled, t: f32) -> Profiled {
        let world_from_profile = self.aim.world_from_profile.slerp(other.aim.world_from_profile, t);
        let axis = world_from_profile * Vec3::NEG_Z;
        let cone = self.aim.cone.map(|cone| cone.about(axis));
        let position = interpolated(self.position, other.position, t);
        Profiled { position, aim: Aim { world_from_profile, cone }, ..self.clone() }
    }
}

/// A cone with a soft edge: attenuation is `falloff` of scale * cos + offset, clamped to 0..1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpotCone {
    /// Unit direction of emission.
    pub axis: Vec3,
    scale: f32,
    offset: f32,
    falloff: SpotFalloff,
}

impl SpotCone {
    /// The cone with another unit axis.
    fn about(self, axis: Vec3) -> SpotCone {
        SpotCone { axis, ..self }
    }

    /// A cone around an axis that fades out between two half angles, radians.
    pub fn new(
        direction: DVec3,
        inner_angle_rad: f64,
        outer_angle_rad: f64,
        falloff: SpotFalloff,
    ) -> SpotCone {
        let range = match falloff {
            // KHR_lights_punctual, "Inner and Outer Cone Angles".
            SpotFalloff::Square => inner_angle_rad.cos() - outer_angle_rad.cos(),
            SpotFalloff::Smooth => (1.0 - outer_angle_rad.cos()) * (1.0 - inner_angle_rad / outer_angle_rad),
        };
        let scale = 1.0 / range.max(1e-3);
        SpotCone {
            axis: direction.normalize().as_vec3(),
            scale: scale as f32,
            offset: (-outer_angle_rad.cos() * scale) as f32,
            falloff,
        }
    }

    /// Attenuation at an angle of this cosine to the axis, 0..1.
    #[inline(always)]
    pub fn attenuation(&self, cosine: f32) -> f32 {
        let a = (cosine * self.scale + self.offset).clamp(0.0, 1.0);
        match self.falloff {
            SpotFalloff::Square => a * a,
            SpotFalloff::Smooth => a * a * (3.0 - 2.0 * a),
        }
    }

    /// Effective solid angle of the cone, steradians: up to the angle where scale * cos + offset is 1/2.
    pub fn solid_angle(&self) -> f32 {
        2.0 * PI * (1.0 - (0.5 - self.offset) / self.scale).clamp(1e-4, 2.0)
    }

    /// The half angles between which the cone fades out, radians.
    pub fn angles_rad(&self) -> [f32; 2] {
        let angle = |cosine: f32| poly::acos(cosine.clamp(-1.0, 1.0));
        [angle((1.0 - self.offset) / self.scale), angle(-self.offset / self.scale)]
    }
}

/// Orientation of a profile, and an optional cone that limits it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    world_from_profile: Quat,
    cone: Option<SpotCone>,
}

impl Aim {
    /// `cone`: inner and outer half angle, radians.
    pub fn new(rotation: DQuat, cone: Option<[f64; 2]>) -> Aim {
        let axis = rotation * DVec3::NEG_Z;
        let cone = cone.map(|[inner, outer]| SpotCone::new(axis, inner, outer, SpotFalloff::Smooth));
        Aim { world_from_profile: rotation.as_quat(), cone }
    }

    /// Axis and outer half angle (radians) of the cone.
    pub fn cone(&self) -> Option<(Vec3, f32)> {
        self.cone.map(|cone| (cone.axis, cone.angles_rad()[1]))
    }

    /// Intensity in a unit direction relative to the maximum of the profile.
    pub fn attenuation(&self, profile: Option<&LightProfile>, direction: Vec3) -> f32 {
        let of_cone = self.cone.map_or(1.0, |cone| cone.attenuation(direction.dot(cone.axis)));
        let Some(profile) = profile else { return of_cone };
        let local = self.world_from_profile.inverse() * direction;
        let vertical_deg = poly::acos((-local.z).clamp(-1.0, 1.0)).to_degrees();
        let horizontal_deg = poly::atan2(local.y, local.x).to_degrees().rem_euclid(360.0);
        of_cone * profile.at(vertical_deg, horizontal_deg)
    }
}

/// Mean of a profile over all directions relative to the maximum, for light selection.
pub fn relative_mean(profile: &LightProfile) -> f32 {
    // The sampled angles may miss a narrow beam.
    profile.mean(STEPS).max(1e-4 * profile.peak())
}

/// A directional light.
#[derive(Clone, Debug)]
pub struct Directional {
    /// Unit direction to the light.
    to_light: Vec3,
    /// Irradiance on a surface that faces the light, W/m^2.
    irradiance: Rgb,
}

impl Directional {
    pub(super) fn of_scene(light: &scene::Light, _world_origin: DVec3, direction: DVec3) -> Directional {
        Directional {
            to_light: -direction.normalize().as_vec3(),
            irradiance: Rgb::from_array(light.intensity),
        }
    }
}

impl LightSource for Directional {
    #[inline(always)]
    fn sample(&self, _textures: &CompiledTextures, _reference: Vec3, _u: [f32; 2]) -> LightSample {
        LightSample {
            wi: self.to_light,
            target: Vec3::ZERO,
            is_infinite: true,
            is_delta: true,
            radiance: self.irradiance,
            pdf_solid_angle: 1.0,
        }
    }

    fn power(&self, _textures: &CompiledTextures) -> f32 {
        self.irradiance.luminance() * PI
    }

    fn bounds(&self, _textures: &CompiledTextures) -> Option<LightBounds> {
        None
    }
}

impl PunctualSource for Directional {
    fn origin(&self) -> LightOrigin {
        LightOrigin::Direction(self.to_light)
    }

    fn intensity(&self, _direction: Vec3) -> Rgb {
        self.irradiance
    }

    fn interpolate(&self, other: &Directional, t: f32) -> Directional {
        let mixed = self.to_light + (other.to_light - self.to_light) * t;
        Directional { to_light: mixed.try_normalize().unwrap_or(self.to_light), ..*self }
    }
}

/// A sun: constant radiance from a cone of directions.
#[derive(Clone, Copy, Debug)]
pub struct Sun {
    /// Frame around the direction to the center.
    frame: Frame,
    /// 1 - cos of the angular radius: half the squared chord from center to edge on the unit sphere.
    one_minus_cos: f32,
    /// Radiance, W/(sr m^2).
    pub radiance: Rgb,
    /// Irradiance on a surface that faces the center, W/m^2.
    irradiance: Rgb,
}

impl Sun {
    /// A sun that emits along `direction`, with an angular diameter above 0 and at most pi, radians.
    pub fn new(direction: DVec3, angle_rad: f64, irradiance: Rgb) -> Sun {
        let half = 0.5 * angle_rad;
        Sun {
            frame: Frame::from_normal(-direction.normalize().as_vec3()),
            one_minus_cos: (2.0 * (0.5 * half).sin().powi(2)) as f32,
            irradiance,
            // The integral of the cosine over the cone is pi sin^2.
            radiance: irradiance * (1.0 / (std::f64::consts::PI * half.sin().powi(2))) as f32,
        }
    }

    /// Pdf per solid angle of sampled directions.
    #[inline(always)]
    pub fn pdf_inside(&self) -> f32 {
        uniform_cone_pdf_solid_angle(self.one_minus_cos)
    }

    /// Unit direction to the center.
    pub fn center(&self) -> Vec3 {
        self.frame.n
    }

    /// Angular radius, radians, in small-angle approximation.
    pub fn half_angle(&self) -> f32 {
        (2.0 * self.one_minus_cos).sqrt()
    }

    /// Is a unit direction inside the sun's disk?
    #[inline(always)]
    pub fn contains(&self, direction: Vec3) -> bool {
        (direction - self.frame.n).length_squared() <= 2.0 * self.one_minus_cos
    }

    pub(super) fn of_scene(
        light: &scene::Light,
        _world_origin: DVec3,
        direction: DVec3,
        angle_rad: f64,
    ) -> Sun {
        Sun::new(direction, angle_rad, Rgb::from_array(light.intensity))
    }
}

impl LightSource for Sun {
    #[inline(always)]
    fn sample(&self, _textures: &CompiledTextures, _reference: Vec3, u: [f32; 2]) -> LightSample {
        LightSample {
            wi: self.frame.to_world(uniform_cone(u, self.one_minus_cos)),
            target: Vec3::ZERO,
            is_infinite: true,
            is_delta: false,
            radiance: self.radiance,
            pdf_solid_angle: self.pdf_inside(),
        }
    }

    fn pdf_solid_angle(&self, _reference: Vec3, to: Vec3) -> f32 {
        if self.contains(to) { self.pdf_inside() } else { 0.0 }
    }

    fn radiance(&self, _textures: &CompiledTextures, _reference: Vec3, to: Vec3) -> Rgb {
        if self.contains(to) { self.radiance } else { Rgb::ZERO }
    }

    fn power(&self, _textures: &CompiledTextures) -> f32 {
        self.irradiance.luminance() * PI
    }

    fn bounds(&self, _textures: &CompiledTextures) -> Option<LightBounds> {
        None
    }
}

impl PunctualSource for Sun {
    fn origin(&self) -> LightOrigin {
        LightOrigin::Cone
    }

    fn intensity(&self, _direction: Vec3) -> Rgb {
        self.irradiance
    }

    /// Suns are static: BSDF sampling evaluates them without a time.
    fn interpolate(&self, _other: &Sun, _t: f32) -> Sun {
        *self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::PunctualLight;
    use crate::scene::{Light, LightKind};

    /// Irradiance of a spot light of intensity 1 along -z, at a distance of one metre and an angle to the axis.
    fn spot(falloff: SpotFalloff, angle: f64) -> f32 {
        let kind = LightKind::Spot {
            position: DVec3::ZERO,
            direction: DVec3::NEG_Z,
            inner_angle_rad: 0.3,
            outer_angle_rad: 0.6,
            falloff,
        };
        let textures = CompiledTextures::resident(&[], &[], Vec3::ZERO);
        let light = PunctualLight::new(&Light::new(kind, [1.0; 3]), DVec3::ZERO);
        light.sample(&textures, DVec3::new(angle.sin(), 0.0, -angle.cos()).as_vec3(), [0.5; 2]).radiance.r
    }

    #[test]
    fn spot_cones_fade_between_their_angles() {
        for falloff in [SpotFalloff::Square, SpotFalloff::Smooth] {
            assert!((spot(falloff, 0.0) - 1.0).abs() < 1e-5);
            assert!(spot(falloff, 0.61) == 0.0 && spot(falloff, 0.59) > 0.0);
        }
        assert!((spot(SpotFalloff::Square, 0.29) - 1.0).abs() < 1e-5);
        // Halfway between the cosines: a quarter (square), a half (smooth step).
        let middle = (0.5 * (0.3f64.cos() + 0.6f64.cos())).acos();
        assert!((spot(SpotFalloff::Square, middle) - 0.25).abs() < 1e-5);
        let middle = (0.6f64.cos() + 0.25 * (1.0 - 0.6f64.cos())).acos();
        assert!((spot(SpotFalloff::Smooth, middle) - 0.5).abs() < 1e-5);
    }

    #[test]
    fn sun_samples_are_inside_the_disk_and_yield_the_irradiance() {
        let textures = CompiledTextures::resident(&[], &[], Vec3::ZERO);
        for angle_rad in [1e-3, 0.0092, 0.5, 3.0] {
            let sun = Sun::new(DVec3::new(0.3, -1.0, 0.2), angle_rad, Rgb::new(2.0, 2.0, 2.0));
            let n = 64;
            let mut irradiance = 0.0;
            for i in 0..n * n {
                let u = [(i / n) as f32 + 0.5, (i % n) as f32 + 0.5].map(|x| x / n as f32);
                let sample = sun.sample(&textures, Vec3::ZERO, u);
                assert!(sun.contains(sample.wi), "{angle_rad}: {u:?}");
                irradiance += sample.radiance.r * sample.wi.dot(sun.frame.n) / sample.pdf_solid_angle;
            }
            let mean = irradiance / (n * n) as f32;
            assert!((mean - 2.0).abs() < 2e-3, "{angle_rad}: {mean}");
            let outside = sun.frame.to_world(uniform_cone([1.0, 0.3], sun.one_minus_cos * 1.01));
            assert!(!sun.contains(outside));
        }
    }
}
