//! The clear sky of Hosek and Wilkie (2012, "An Analytic Model for Full Spectral Sky-Dome Radiance") with its sun
//! (2013, "Adding a Solar-Radiance Function to the Hosek-Wilkie Skylight Model"), both in W/sr/m2 of the visible
//! spectrum; 1 W/sr/m2 is 683 cd/m2.
//!
//! The sky becomes an environment image, the sun a light with an angular diameter. `tools/sky` writes the coefficients
//! `dataset.bin` from the published ones and documents their layout.

use crate::error::{Error, Result};
use crate::image::Image;
use crate::math::DVec3;
use crate::scene::{Environment, Light, LightKind, Scene};
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};

/// Width of the environment image, texels: 0.35 degrees each.
const WIDTH: usize = 1024;
/// Height of the environment image, texels.
const HEIGHT: usize = 512;
/// Quadrature steps per quadrant, in elevation and in azimuth, for the irradiance of the sky on the ground.
const STEPS: usize = 64;
/// Angular diameter of the sun in the model's data, radians.
pub const SUN_ANGLE_RAD: f64 = 0.5358 * PI / 180.0;

/// A clear sky with its sun, over a diffuse ground.
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicalSky {
    /// Elevation of the sun above the horizon, radians, 0 to pi/2.
    pub sun_elevation_rad: f64,
    /// Azimuth of the sun, radians, from -z towards x: clockwise seen from above.
    pub sun_azimuth_rad: f64,
    /// Turbidity, 1 to 10: 1 is the clearest air, 3 a clear day, 10 thick haze.
    pub turbidity: f64,
    /// Albedo of the ground, 0 to 1: it affects the sky, and is visible below the horizon.
    pub ground_albedo: [f64; 3],
    /// Angular diameter of the sun disk, radians, above 0 and below pi; the irradiance is independent of it.
    pub sun_angle_rad: f64,
    /// Add a light for the sun.
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
    /// Sets the environment image and the sun light of a scene.
    ///
    /// # Errors
    /// If a value is out of range.
    pub fn add_to(&self, scene: &mut Scene) -> Result<()> {
        self.check()?;
        let dome = Dome::new(self);
        let image = scene.add_image(dome.picture());
        scene.environment = Environment::Image { image, strength: self.strength as f32, rotation_rad: 0.0 };
        scene.environment_sun = None;
        if self.has_sun {
            let irradiance = dome.sun.map(|v| (v * self.strength) as f32);
            add_sun(scene, -dome.to_sun, self.sun_angle_rad, irradiance);
        }
        Ok(())
    }

    /// Unit vector to the sun's centre.
    pub fn to_sun(&self) -> DVec3 {
        let (sin, cos) = self.sun_elevation_rad.sin_cos();
        let (x, z) = self.sun_azimuth_rad.sin_cos();
        DVec3::new(x * cos, sin, -z * cos)
    }

    /// Irradiance of the sun on a perpendicular surface, W/m2, without the strength.
    pub fn sun_irradiance(&self) -> [f64; 3] {
        // Projected solid angle of the disk.
        let disk = PI * (0.5 * SUN_ANGLE_RAD).sin().powi(2);
        sun_radiance(self.turbidity, self.sun_elevation_rad).map(|v| v * disk)
    }

    /// Radiance of the sky without sun, W/sr/m2, in a unit direction above the horizon, without the strength.
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
        match checks.iter().find(|(is_valid, _)| !is_valid) {
            Some((_, message)) => Err(Error::usage(format!("physical sky: {message}"))),
            None => Ok(()),
        }
    }
}

/// Adds the sun of the environment: light that travels in `direction`, with an angular diameter, and an irradiance in W/m2.
pub fn add_sun(scene: &mut Scene, direction: DVec3, angle_rad: f64, irradiance: [f32; 3]) {
    let kind = LightKind::Sun { direction, angle_rad };
    let (group, visible_to) = (scene.environment_group.clone(), scene.environment_visible_to);
    scene.environment_sun = Some(scene.lights.len() as u32);
    let name = "sun of the sky".to_string();
    scene.lights.push(Light { name, group, visible_to, ..Light::new(kind, irradiance) });
}

/// A sky with interpolated coefficients.
struct Dome {
    channels: [Channel; 3],
    to_sun: DVec3,
    /// Irradiance of the sun on a perpendicular surface, W/m2.
    sun: [f64; 3],
    /// Radiance of the ground, W/sr/m2.
    ground: [f64; 3],
}

impl Dome {
    fn new(sky: &PhysicalSky) -> Dome {
        let (channels, to_sun, sun) = (sky.channels(), sky.to_sun(), sky.sun_irradiance());
        let from_sky = irradiance(&channels, to_sun);
        // Radiance of diffuse ground: albedo times irradiance over pi.
        let ground = std::array::from_fn(|c| {
            let direct = if sky.has_sun { sun[c] * to_sun.y } else { 0.0 };
            sky.ground_albedo[c] * (from_sky[c] + direct) / PI
        });
        Dome { channels, to_sun, sun, ground }
    }

    /// The equirectangular image, in the convention of [`Environment::Image`].
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

/// Irradiance of the sky on a horizontal surface, W/m2, by the midpoint rule in the squared cosine and the azimuth.
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

/// The published coefficients; layout: `tools/sky/dataset.py`.
static DATASET: &[u8] = include_bytes!("dataset.bin");

/// Number of tabulated turbidities, from 1 in steps of 1.
const TURBIDITIES: usize = 10;
const CONTROL_POINTS: usize = 6;
const PARAMETERS: usize = 9;
/// Number of elevation intervals; the sun's radiance is a cubic in each.
const SEGMENTS: usize = 45;
const POWERS: usize = 4;

const SHAPES: usize = TURBIDITIES * 2 * CONTROL_POINTS * 3 * PARAMETERS;
const MEANS: usize = TURBIDITIES * 2 * CONTROL_POINTS * 3;
const SUNS: usize = TURBIDITIES * SEGMENTS * 3 * POWERS;

/// A number of the data set, which consists of three arrays: shapes, means, suns.
fn coefficient(index: usize) -> f64 {
    let mut bytes = [0; 4];
    bytes.copy_from_slice(&DATASET[4 * index..4 * index + 4]);
    f64::from(f32::from_le_bytes(bytes))
}

const _: () = assert!(SHAPES == 3240 && SHAPES + MEANS + SUNS == 9000);

/// The two tabulated turbidities around a value of 1 to 10: indices and interpolation weights.
fn turbidities(turbidity: f64) -> [(usize, f64); 2] {
    let lower = (turbidity.floor() as usize).clamp(1, TURBIDITIES) - 1;
    let t = (turbidity - 1.0 - lower as f64).clamp(0.0, 1.0);
    [(lower, 1.0 - t), ((lower + 1).min(TURBIDITIES - 1), t)]
}

/// The model's parameters of one colour channel.
struct Channel {
    /// A to I of equation 8.
    shape: [f64; PARAMETERS],
    /// Mean radiance, W/sr/m2; the factor on the shape.
    mean: f64,
}

/// Interpolates the coefficients of a channel: linear in turbidity and albedo, quintic Bezier curves in the cube root of the
/// elevation (section 5.2 of the paper).
fn sky_channel(turbidity: f64, albedo: f64, elevation_rad: f64, channel: usize) -> Channel {
    let x = (elevation_rad / FRAC_PI_2).cbrt();
    let bernstein: [f64; CONTROL_POINTS] = std::array::from_fn(|k| {
        let binomial = [1.0, 5.0, 10.0, 10.0, 5.0, 1.0][k];
        binomial * x.powi(k as i32) * (1.0 - x).powi((CONTROL_POINTS - 1 - k) as i32)
    });
    let (mut shape, mut mean) = ([0.0; PARAMETERS], 0.0);
    for (level, turbidity_weight) in turbidities(turbidity) {
        for (ground, ground_weight) in [(0, 1.0 - albedo), (1, albedo)] {
            for (point, basis) in bernstein.iter().enumerate() {
                let weight = turbidity_weight * ground_weight * basis;
                let index = ((level * 2 + ground) * CONTROL_POINTS + point) * 3 + channel;
                mean += weight * coefficient(SHAPES + index);
                for (k, parameter) in shape.iter_mut().enumerate() {
                    *parameter += weight * coefficient(index * PARAMETERS + k);
                }
            }
        }
    }
    Channel { shape, mean }
}

impl Channel {
    /// Radiance, W/sr/m2, from the cosines of the angles to the zenith and to the sun (equations 8 and 9).
    pub fn radiance(&self, cos_zenith: f64, cos_sun: f64) -> f64 {
        // The published order has H and I swapped.
        let [a, b, c, d, e, f, g, i, h] = self.shape;
        let to_sun = cos_sun.acos();
        let aureole = (1.0 + cos_sun * cos_sun) / (1.0 + h * h - 2.0 * h * cos_sun).powf(1.5);
        let glow = c + d * (e * to_sun).exp() + f * cos_sun * cos_sun + g * aureole + i * cos_zenith.sqrt();
        ((1.0 + a * (b / (cos_zenith + 0.01)).exp()) * glow * self.mean).max(0.0)
    }
}

/// Mean radiance of the sun disk, W/sr/m2 in linear Rec. 709; out-of-gamut values are clipped.
fn sun_radiance(turbidity: f64, elevation_rad: f64) -> [f64; 3] {
    let place = (2.0 * elevation_rad / PI).cbrt() * SEGMENTS as f64;
    let segment = (place as usize).min(SEGMENTS - 1);
    let x = elevation_rad - (segment as f64 / SEGMENTS as f64).powi(3) * FRAC_PI_2;
    std::array::from_fn(|c| {
        let cubic = |level: usize| {
            let first = SHAPES + MEANS + ((level * SEGMENTS + segment) * 3 + c) * POWERS;
            (0..POWERS).rev().fold(0.0, |sum, k| sum * x + coefficient(first + k))
        };
        turbidities(turbidity).into_iter().map(|(level, weight)| weight * cubic(level)).sum::<f64>().max(0.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Radiances of Mitsuba 3.7's `sunsky` (the same coefficients in double precision) for a sun at azimuth 0: turbidity, albedo,
/// elevation, zenith angle, azimuth (degrees), RGB radiance.
#[rustfmt::skip]
const SKIES: &[[f64; 8]] = &[
    [1.0, 0.0, 10.0, 0.0, 0.0, 0.7366, 1.5935, 2.8955],
    [1.0, 0.0, 10.0, 60.0, 0.0, 3.4118, 5.5761, 7.7758],
    [1.0, 0.0, 10.0, 80.0, 120.0, 6.0428, 8.5497, 9.1982],
    [3.0, 0.2, 45.0, 0.0, 0.0, 2.4143, 4.1849, 8.4824],
    [3.0, 0.2, 45.0, 60.0, 0.0, 16.6471, 20.4766, 25.7536],
    [2.5, 0.3, 45.0, 80.0, 120.0, 8.8691, 14.5642, 22.6139],
    [6.3, 0.8, 70.0, 0.0, 0.0, 18.8134, 20.9997, 26.4632],
    [6.3, 0.8, 70.0, 30.0, 200.0, 6.4053, 9.7559, 16.9940],
    [10.0, 0.1, 2.0, 60.0, 0.0, 4.6427, 3.0769, 2.0113],
    [10.0, 0.1, 2.0, 80.0, 120.0, 1.4403, 1.3485, 1.0799],
];

    /// Turbidity, elevation (degrees), and irradiance perpendicular to the sun, W/m2, integrated in Python from the published
    /// spectral coefficients over the sun disk and the CIE observer.
    const SUNS: &[(f64, f64, [f64; 3])] = &[
        (1.0, 90.0, [158.58489, 131.65459, 103.15235]),
        (2.0, 60.0, [155.30755, 127.37388, 97.25716]),
        (3.0, 10.0, [101.23522, 60.40515, 21.96447]),
        (5.0, 30.0, [127.08154, 96.81322, 64.55828]),
        (10.0, 3.0, [0.02515, 0.00432, 0.00013]),
    ];

    fn sky(turbidity: f64, elevation: f64, albedo: f64) -> PhysicalSky {
        let sun_elevation_rad = elevation.to_radians();
        PhysicalSky { turbidity, sun_elevation_rad, ground_albedo: [albedo; 3], ..PhysicalSky::default() }
    }

    #[test]
    fn the_sky_has_the_published_radiance() {
        for &[turbidity, albedo, elevation, zenith, azimuth, red, green, blue] in SKIES {
            let expected = [red, green, blue];
            let sky = sky(turbidity, elevation, albedo);
            let (sin, y) = f64::to_radians(zenith).sin_cos();
            let (x, z) = f64::to_radians(azimuth).sin_cos();
            let found = sky.radiance(DVec3::new(sin * x, y, -sin * z));
            for c in 0..3 {
                let error = (found[c] / expected[c] - 1.0).abs();
                assert!(error < 2e-4, "{sky:?} {zenith} {azimuth}: {found:?} {expected:?}");
            }
        }
    }

    #[test]
    fn the_sun_has_the_published_irradiance() {
        for &(turbidity, elevation, expected) in SUNS {
            let found = sky(turbidity, elevation, 0.2).sun_irradiance();
            for c in 0..3 {
                let error = (found[c] - expected[c]).abs();
                assert!(error < 1e-4 * expected[c] + 1e-5, "{turbidity} {elevation}: {found:?} {expected:?}");
            }
        }
    }

    /// Measured daylight on horizontal ground under a high sun is 100 to 130 klx, a tenth to a fifth of it from the sky.
    #[test]
    fn sun_and_sky_have_the_illuminance_of_daylight() {
        let dome = Dome::new(&sky(2.5, 70.0, 0.2));
        let luminance = |c: [f64; 3]| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
        let from_sky = 0.683 * luminance(irradiance(&dome.channels, dome.to_sun));
        let from_sun = 0.683 * luminance(dome.sun) * dome.to_sun.y;
        assert!((95.0..130.0).contains(&(from_sky + from_sun)), "{from_sky} {from_sun} klx");
        assert!((0.1..0.25).contains(&(from_sky / from_sun)), "{from_sky} {from_sun} klx");
    }

    #[test]
    fn texels_of_the_image_have_the_radiance_of_their_directions() {
        let sky = PhysicalSky { sun_azimuth_rad: 1.0, ..sky(2.0, 35.0, 0.4) };
        let picture = Dome::new(&sky).picture();
        for (column, row) in [(0, 0), (100, 200), (700, 255), (1023, 130)] {
            let azimuth = ((f64::from(column) + 0.5) / 1024.0 - 0.5) * 2.0 * PI;
            let (sin, y) = ((f64::from(row) + 0.5) / 512.0 * PI).sin_cos();
            let expected = sky.radiance(DVec3::new(sin * azimuth.cos(), y, sin * azimuth.sin()));
            let found = picture.rgba(column, row);
            (0..3).for_each(|c| assert!((f64::from(found[c]) / expected[c] - 1.0).abs() < 1e-5));
        }
        let ground = picture.rgba(3, 256);
        assert!((0..1024).all(|x| (256..512).all(|y| picture.rgba(x, y) == ground)));
    }

    #[test]
    fn values_out_of_range_are_refused() {
        let changes: [fn(&mut PhysicalSky); 6] = [
            |s| s.turbidity = 0.9,
            |s| s.turbidity = f64::NAN,
            |s| s.sun_elevation_rad = -0.1,
            |s| s.ground_albedo[1] = 1.5,
            |s| s.sun_angle_rad = 0.0,
            |s| s.strength = -1.0,
        ];
        for change in changes {
            let mut sky = PhysicalSky::default();
            change(&mut sky);
            assert!(sky.add_to(&mut Scene::default()).is_err(), "{sky:?}");
        }
    }
}
