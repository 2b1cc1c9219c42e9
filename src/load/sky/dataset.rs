//! The published coefficients, and the functions that they belong to.

use std::f64::consts::{FRAC_PI_2, PI};

/// See `tools/sky/dataset.py`.
static DATASET: &[u8] = include_bytes!("dataset.bin");

/// Values of turbidity, from 1 in steps of 1.
const TURBIDITIES: usize = 10;
const CONTROL_POINTS: usize = 6;
const PARAMETERS: usize = 9;
/// Pieces of the sun's radiance by its elevation.
const SEGMENTS: usize = 45;
const POWERS: usize = 4;

const SHAPES: usize = TURBIDITIES * 2 * CONTROL_POINTS * 3 * PARAMETERS;
const MEANS: usize = TURBIDITIES * 2 * CONTROL_POINTS * 3;
const SUNS: usize = TURBIDITIES * SEGMENTS * 3 * POWERS;

/// Its number at an index. The three arrays are one behind the other.
fn at(index: usize) -> f64 {
    let mut bytes = [0; 4];
    bytes.copy_from_slice(&DATASET[4 * index..4 * index + 4]);
    f64::from(f32::from_le_bytes(bytes))
}

const _: () = assert!(SHAPES == 3240 && SHAPES + MEANS + SUNS == 9000);

/// The two values of turbidity around one from 1 to 10, with their shares.
fn turbidities(turbidity: f64) -> [(usize, f64); 2] {
    let lower = (turbidity.floor() as usize).clamp(1, TURBIDITIES) - 1;
    let share = (turbidity - 1.0 - lower as f64).clamp(0.0, 1.0);
    [(lower, 1.0 - share), ((lower + 1).min(TURBIDITIES - 1), share)]
}

/// What makes up the radiance of one colour.
pub(super) struct Channel {
    /// A to I of equation 8.
    shape: [f64; PARAMETERS],
    /// The mean that the shape is multiplied by.
    mean: f64,
}

/// The coefficients of a colour: linear in turbidity and albedo, quintic Bezier curves in the cube root of the elevation
/// (section 5.2 of the paper).
pub(super) fn sky_channel(turbidity: f64, albedo: f64, elevation_rad: f64, channel: usize) -> Channel {
    let x = (elevation_rad / FRAC_PI_2).cbrt();
    let bernstein: [f64; CONTROL_POINTS] = std::array::from_fn(|k| {
        let binomial = [1.0, 5.0, 10.0, 10.0, 5.0, 1.0][k];
        binomial * x.powi(k as i32) * (1.0 - x).powi((CONTROL_POINTS - 1 - k) as i32)
    });
    let (mut shape, mut mean) = ([0.0; PARAMETERS], 0.0);
    for (level, share) in turbidities(turbidity) {
        for (ground, of_ground) in [(0, 1.0 - albedo), (1, albedo)] {
            for (point, basis) in bernstein.iter().enumerate() {
                let weight = share * of_ground * basis;
                let index = ((level * 2 + ground) * CONTROL_POINTS + point) * 3 + channel;
                mean += weight * at(SHAPES + index);
                for (k, parameter) in shape.iter_mut().enumerate() {
                    *parameter += weight * at(index * PARAMETERS + k);
                }
            }
        }
    }
    Channel { shape, mean }
}

impl Channel {
    /// Radiance by the cosine of the angle to the zenith and of that to the sun (equations 8 and 9).
    pub fn radiance(&self, cos_zenith: f64, cos_sun: f64) -> f64 {
        // The published order has H and I swapped.
        let [a, b, c, d, e, f, g, i, h] = self.shape;
        let to_sun = cos_sun.acos();
        let aureole = (1.0 + cos_sun * cos_sun) / (1.0 + h * h - 2.0 * h * cos_sun).powf(1.5);
        let glow = c + d * (e * to_sun).exp() + f * cos_sun * cos_sun + g * aureole + i * cos_zenith.sqrt();
        ((1.0 + a * (b / (cos_zenith + 0.01)).exp()) * glow * self.mean).max(0.0)
    }
}

/// Mean radiance of the sun's disk, linear Rec. 709; what lies outside of that is cut off.
pub(super) fn sun_radiance(turbidity: f64, elevation_rad: f64) -> [f64; 3] {
    let place = (2.0 * elevation_rad / PI).cbrt() * SEGMENTS as f64;
    let segment = (place as usize).min(SEGMENTS - 1);
    let x = elevation_rad - (segment as f64 / SEGMENTS as f64).powi(3) * FRAC_PI_2;
    std::array::from_fn(|c| {
        let cubic = |level: usize| {
            let first = SHAPES + MEANS + ((level * SEGMENTS + segment) * 3 + c) * POWERS;
            (0..POWERS).rev().fold(0.0, |sum, k| sum * x + at(first + k))
        };
        turbidities(turbidity).into_iter().map(|(level, share)| share * cubic(level)).sum::<f64>().max(0.0)
    })
}
