//! Lights at infinity: parallel light and suns.

use super::point::delta_light;
use super::traits::{LightBounds, LightOrigin, LightSample, LightSource, PunctualSource};
use crate::color::Rgb;
use crate::math::{DVec3, Frame, Vec3};
use crate::sampling::warp::{uniform_cone, uniform_cone_pdf_solid_angle};
use crate::scene;
use crate::texture::CompiledTextures;
use std::f64::consts::PI;

/// Parallel light.
#[derive(Clone, Debug)]
pub struct Directional {
    /// Unit vector towards it.
    to_light: Vec3,
    /// Irradiance of a surface that faces it, W/m2.
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

    delta_light!();

    fn power(&self, _textures: &CompiledTextures) -> f32 {
        self.irradiance.luminance() * std::f32::consts::PI
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

    fn interpolate(&self, other: &Directional, share: f32) -> Directional {
        let mixed = self.to_light + (other.to_light - self.to_light) * share;
        Directional { to_light: mixed.try_normalize().unwrap_or(self.to_light), ..*self }
    }
}

/// A sun: the same radiance from all directions in a cone.
#[derive(Clone, Copy, Debug)]
pub struct Sun {
    /// Around the direction to its center.
    frame: Frame,
    /// 1 - cos of half its angle: half the squared chord from its center to its edge on the unit sphere.
    one_minus_cos: f32,
    /// Radiance.
    pub radiance: Rgb,
    /// Irradiance of a surface that faces its center, W/m2.
    irradiance: Rgb,
}

impl Sun {
    /// A sun whose light travels along `direction`, with an angular diameter above 0 and at most pi, radians.
    pub fn new(direction: DVec3, angle_rad: f64, irradiance: Rgb) -> Sun {
        let half = 0.5 * angle_rad;
        Sun {
            frame: Frame::from_normal(-direction.normalize().as_vec3()),
            one_minus_cos: (2.0 * (0.5 * half).sin().powi(2)) as f32,
            irradiance,
            // The integral of the cosine over the cone.
            radiance: irradiance * (1.0 / (PI * half.sin().powi(2))) as f32,
        }
    }

    /// Density per solid angle of sampled directions.
    #[inline(always)]
    pub fn pdf_inside(&self) -> f32 {
        uniform_cone_pdf_solid_angle(self.one_minus_cos)
    }

    /// The unit direction to its center.
    pub fn center(&self) -> Vec3 {
        self.frame.n
    }

    /// Half its angle, radians, as long as it is small.
    pub fn half_angle(&self) -> f32 {
        (2.0 * self.one_minus_cos).sqrt()
    }

    /// Does a unit vector point at it?
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
        self.irradiance.luminance() * std::f32::consts::PI
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

    /// Suns do not move: BSDF samples find them without a time.
    fn interpolate(&self, _other: &Sun, _share: f32) -> Sun {
        *self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_lie_on_it_and_bring_its_irradiance() {
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
            let beside = sun.frame.to_world(uniform_cone([1.0, 0.3], sun.one_minus_cos * 1.01));
            assert!(!sun.contains(beside));
        }
    }
}
