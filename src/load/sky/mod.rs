//! The clear sky of Hosek and Wilkie (2012, "An Analytic Model for Full Spectral Sky-Dome Radiance") with the sun that belongs
//! to it (2013, "Adding a Solar-Radiance Function to the Hosek-Wilkie Skylight Model"), in one unit: W/sr/m2 of the visible
//! spectrum, of which one is 683 cd/m2.
//!
//! The sky becomes an environment picture, the sun a light with a size. `dataset.bin` holds the coefficients of
//! both; `tools/sky` writes it from the published ones, and says how it is arranged.

mod dataset;

use crate::error::{Error, Result};
use crate::image::Image;
use crate::math::DVec3;
use crate::scene::{Environment, Light, LightKind, Scene};
use dataset::{Channel, sky_channel, sun_radiance};
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};

/// Texels around the horizon: a third of a degree each.
const WIDTH: usize = 1024;
/// Texels from straight up to straight down.
const HEIGHT: usize = 512;
/// Rows and columns a quadrant by which the light of the sky on the ground is summed.
const STEPS: usize = 64;
/// Diameter of the sun seen from the earth, radians: that of the model's data.
pub const SUN_ANGLE_RAD: f64 = 0.5358 * PI / 180.0;

/// A clear sky with its sun, over ground of one colour.
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicalSky {
    /// Of the sun above the horizon, 0 to half of pi.
    pub sun_elevation_rad: f64,
    /// Of the sun, from -z towards x: clockwise seen from above.
    pub sun_azimuth_rad: f64,
    /// How hazy the air is: 1 is none, 3 a clear day, 10 thick haze.
    pub turbidity: f64,
    /// What share of light the ground reflects, 0 to 1: it colours the sky, and is what is seen below the horizon.
    pub ground_albedo: [f64; 3],
    /// Diameter of the sun's disk, above 0 and below pi: its light on a surface stays the same.
    pub sun_angle_rad: f64,
    /// Whether there is a light for the sun.
    pub has_sun: bool,
    /// Factor on the radiance of the sky and the irradiance of the sun.
    pub strength: f64,
}

impl Default for PhysicalSky {
    /// A clear afternoon.
    fn default() -> PhysicalSky {
        PhysicalSky {
            sun_elevation_rad: PI / 4.0,
            sun_azimuth_rad: 0.0,
            turbidity: 3.0,
            ground_albedo: [0.2; 3],
            sun_angle_rad: SUN_ANGLE_RAD,
            has_sun: true,
            strength: 1.0,
        }
    }
}

impl PhysicalSky {
    /// Makes it a scene's environment, with an image and a light of its own.
    ///
    /// # Errors
    /// A value that is out of its range.
    pub fn add_to(&self, scene: &mut Scene) -> Result<()> {
        self.check()?;
        let dome = Dome::new(self);
        let image = scene.add_image(dome.picture());
        scene.environment = Environment::Image { image, strength: self.strength as f32, rotation_rad: 0.0 };
        scene.environment_sun = None;
        if self.has_sun {
            let intensity = dome.sun.map(|v| (v * self.strength) as f32);
            let kind = LightKind::Sun { direction: -dome.to_sun, angle_rad: self.sun_angle_rad };
            let group = scene.environment_group.clone();
            let visible_to = scene.environment_visible_to;
            scene.environment_sun = Some(scene.lights.len() as u32);
            scene.lights.push(Light {
                name: "sun of the sky".to_string(),
                group,
                visible_to,
                ..Light::new(kind, intensity)
            });
        }
        Ok(())
    }

    /// Unit vector to the sun's middle.
    pub fn to_sun(&self) -> DVec3 {
        let (sin, cos) = self.sun_elevation_rad.sin_cos();
        let (x, z) = self.sun_azimuth_rad.sin_cos();
        DVec3::new(x * cos, sin, -z * cos)
    }

    /// Irradiance of the sun on a surface that faces it, before the strength.
    pub fn sun_irradiance(&self) -> [f64; 3] {
        // The integral of the cosine over the disk of the data.
        let disk = PI * (0.5 * SUN_ANGLE_RAD).sin().powi(2);
        sun_radiance(self.turbidity, self.sun_elevation_rad).map(|v| v * disk)
    }

    /// Radiance of the sky, without the sun, in a direction above the horizon, before the strength.
    pub fn radiance(&self, direction: DVec3) -> [f64; 3] {
        let channels = self.channels();
        radiance(&channels, direction, self.to_sun())
    }

    fn channels(&self) -> [Channel; 3] {
        std::array::from_fn(|c| sky_channel(self.turbidity, self.ground_albedo[c], self.sun_elevation_rad, c))
    }

    fn check(&self) -> Result<()> {
        let is_albedo = self.ground_albedo.iter().all(|a| (0.0..=1.0).contains(a));
        let checks = [
            ((0.0..=FRAC_PI_2).contains(&self.sun_elevation_rad), "sun_elevation_rad must be from 0 to pi/2"),
            (self.sun_azimuth_rad.is_finite(), "sun_azimuth_rad must be finite"),
            ((1.0..=10.0).contains(&self.turbidity), "turbidity must be from 1 to 10"),
            (is_albedo, "ground_albedo must be from 0 to 1"),
            ((1e-5..PI).contains(&self.sun_angle_rad), "sun_angle_rad must be from 1e-5 to pi"),
            ((0.0..=f64::from(f32::MAX)).contains(&self.strength), "strength must be from 0 up"),
        ];
        match checks.iter().find(|(is_met, _)| !is_met) {
            Some((_, message)) => Err(Error::usage(format!("physical sky: {message}"))),
            None => Ok(()),
        }
    }
}

/// A sky whose coefficients have been looked up.
struct Dome {
    channels: [Channel; 3],
    to_sun: DVec3,
    /// Irradiance across the sun's light.
    sun: [f64; 3],
    /// Radiance of the ground.
    ground: [f64; 3],
}

impl Dome {
    fn new(sky: &PhysicalSky) -> Dome {
        let (channels, to_sun, sun) = (sky.channels(), sky.to_sun(), sky.sun_irradiance());
        let from_sky = irradiance(&channels, to_sun);
        // Matt ground reflects its albedo times irradiance over pi.
        let ground = std::array::from_fn(|c| {
            let direct = if sky.has_sun { sun[c] * to_sun.y } else { 0.0 };
            sky.ground_albedo[c] * (from_sky[c] + direct) / PI
        });
        Dome { channels, to_sun, sun, ground }
    }

    /// The mapping of [`Environment::Image`].
    fn picture(&self) -> Image {
        let rows = (0..HEIGHT).into_par_iter().flat_map_iter(|row| {
            let (sin, y) = ((row as f64 + 0.5) / HEIGHT as f64 * PI).sin_cos();
            (0..WIDTH).flat_map(move |column| {
                let (z, x) = (((column as f64 + 0.5) / WIDTH as f64 - 0.5) * 2.0 * PI).sin_cos();
                let direction = DVec3::new(sin * x, y, sin * z);
                let rgb = match y > 0.0 {
                    true => radiance(&self.channels, direction, self.to_sun),
                    false => self.ground,
                };
                rgb.map(|v| v as f32)
            })
        });
        Image::from_linear_rgb("sky", WIDTH as u32, HEIGHT as u32, rows.collect())
    }
}

fn radiance(channels: &[Channel; 3], direction: DVec3, to_sun: DVec3) -> [f64; 3] {
    let cos_sun = direction.dot(to_sun).clamp(-1.0, 1.0);
    channels.each_ref().map(|channel| channel.radiance(direction.y.max(0.0), cos_sun))
}

/// What the whole sky brings to ground that is level, by the midpoint rule in the squared cosine and the azimuth.
fn irradiance(channels: &[Channel; 3], to_sun: DVec3) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for row in 0..STEPS {
        let y = ((row as f64 + 0.5) / STEPS as f64).sqrt();
        let sin = (1.0 - y * y).sqrt();
        for column in 0..4 * STEPS {
            let (z, x) = ((column as f64 + 0.5) / (4 * STEPS) as f64 * 2.0 * PI).sin_cos();
            let from = radiance(channels, DVec3::new(sin * x, y, sin * z), to_sun);
            (0..3).for_each(|c| sum[c] += from[c]);
        }
    }
    sum.map(|v| v * PI / (4 * STEPS * STEPS) as f64)
}

#[cfg(test)]
mod tests;
