//! A disk infinitely far away.

use super::LightSample;
use crate::color::Rgb;
use crate::math::{DVec3, Frame, Vec3};
use crate::sampling::warp::{uniform_cone, uniform_cone_pdf_solid_angle};
use std::f64::consts::PI;

/// A sun: the same radiance from all directions in a cone.
#[derive(Clone, Copy, Debug)]
pub struct Sun {
    /// About the way to its middle.
    frame: Frame,
    /// 1 - cos of half its angle: half the squared length of the chord from its middle to its edge on the unit sphere.
    one_minus_cos: f32,
    /// Radiance.
    pub radiance: Rgb,
}

impl Sun {
    /// A sun whose light travels along `direction` and brings an irradiance to what faces it; its diameter is an angle
    /// above 0 and at most pi.
    pub fn new(direction: DVec3, angle_rad: f64, irradiance: Rgb) -> Sun {
        let half = 0.5 * angle_rad;
        Sun {
            frame: Frame::from_normal(-direction.normalize().as_vec3()),
            one_minus_cos: (2.0 * (0.5 * half).sin().powi(2)) as f32,
            // The integral of the cosine over the cone.
            radiance: irradiance * (1.0 / (PI * half.sin().powi(2))) as f32,
        }
    }

    /// Density of its directions per solid angle.
    #[inline(always)]
    pub fn pdf_solid_angle(&self) -> f32 {
        uniform_cone_pdf_solid_angle(self.one_minus_cos)
    }

    /// Does a unit vector point at it?
    #[inline(always)]
    pub fn contains(&self, direction: Vec3) -> bool {
        (direction - self.frame.n).length_squared() <= 2.0 * self.one_minus_cos
    }

    /// A direction towards it.
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> LightSample {
        LightSample {
            wi: self.frame.to_world(uniform_cone(u, self.one_minus_cos)),
            target: Vec3::ZERO,
            is_infinite: true,
            is_delta: false,
            radiance: self.radiance,
            pdf_solid_angle: self.pdf_solid_angle(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_lie_on_it_and_bring_its_irradiance() {
        for angle_rad in [1e-3, 0.0092, 0.5, 3.0] {
            let sun = Sun::new(DVec3::new(0.3, -1.0, 0.2), angle_rad, Rgb::new(2.0, 2.0, 2.0));
            let n = 64;
            let mut irradiance = 0.0;
            for i in 0..n * n {
                let u = [(i / n) as f32 + 0.5, (i % n) as f32 + 0.5].map(|x| x / n as f32);
                let sample = sun.sample(u);
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
