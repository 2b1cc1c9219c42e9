//! Gabor noise (Lagae et al. 2009, "Procedural Noise using Sparse Gabor Convolution"), with as many impulses in each cell as in all others
//! and phases (Tricard et al. 2019, "Procedural Phasor Noise"), as Cycles has it.

use super::hash::{hash_floats, hash_to_vector};
use super::math::normalize;
use crate::math::{Vec3, poly};
use std::f32::consts::{PI, SQRT_2};

/// Impulses in each cell.
const IMPULSES: u32 = 8;

/// Standard deviations of the noise by which it is divided.
const SPREAD: f32 = 6.0;

/// Value and phase, 0..1, and intensity in two dimensions, of a frequency in cycles per cell, in a direction of `angle_rad`, and any where
/// `isotropy` is 1.
pub fn two_dimensional(p: [f32; 2], frequency: f32, isotropy: f32, angle_rad: f32) -> [f32; 3] {
    let cell = p.map(f32::floor);
    let mut sum = [0.0; 2];
    for (i, j) in (0..9).map(|k| (k % 3 - 1, k / 3 - 1)) {
        let [x, y] = [cell[0] + i as f32, cell[1] + j as f32];
        for impulse in (0..IMPULSES).map(|n| 3.0 * n as f32) {
            let turned = (hash_floats([x, y, impulse]) - 0.5) * PI * isotropy;
            let seed = impulse + 1.0;
            let place = [p[0] - x - hash_floats([x, y, seed]), p[1] - y - hash_floats([seed, x, y])];
            let squared = place[0] * place[0] + place[1] * place[1];
            if squared < 1.0 {
                let (sine, cosine) = poly::sin_cos(angle_rad + turned);
                let cycles = frequency * (place[0] * cosine + place[1] * sine);
                add(&mut sum, squared, cycles, hash_floats([x, y, impulse + 2.0]));
            }
        }
    }
    outputs(sum, 0.25)
}

/// Gabor noise in three dimensions, along a direction.
pub fn three_dimensional(p: [f32; 3], frequency: f32, isotropy: f32, direction: [f32; 3]) -> [f32; 3] {
    let cell = p.map(f32::floor);
    let direction = Vec3::from_array(normalize(direction));
    let mut sum = [0.0; 2];
    for k in 0..27 {
        let [x, y, z] =
            [cell[0] + (k % 3 - 1) as f32, cell[1] + (k / 3 % 3 - 1) as f32, cell[2] + (k / 9 - 1) as f32];
        for impulse in (0..IMPULSES).map(|n| 3.0 * n as f32) {
            let place = Vec3::from_array(p)
                - Vec3::new(x, y, z)
                - Vec3::from_array(hash_to_vector(&[x, y, z, impulse + 1.0]));
            let squared = place.length_squared();
            if squared < 1.0 {
                let along = turned(direction, isotropy, [x, y, z, impulse]);
                add(&mut sum, squared, frequency * place.dot(along), hash_floats([x, y, z, impulse + 2.0]));
            }
        }
    }
    outputs(sum, 0.25 / SQRT_2)
}

/// Adds an impulse of either sign at a squared distance, with a phase in cycles.
fn add(sum: &mut [f32; 2], squared: f32, cycles: f32, random: f32) {
    let window = 0.5 + 0.5 * poly::sin_cos(PI * squared).1;
    let weight = poly::exp(-PI * squared) * window * if random < 0.5 { -1.0 } else { 1.0 };
    let (sine, cosine) = poly::sin_cos_turns(cycles);
    sum[0] += weight * cosine;
    sum[1] += weight * sine;
}

/// A direction turned at random.
fn turned(direction: Vec3, isotropy: f32, seed: [f32; 4]) -> Vec3 {
    if isotropy == 0.0 {
        return direction;
    }
    let level = (direction.x * direction.x + direction.y * direction.y).sqrt();
    let side = if direction.y < 0.0 { -1.0 } else { 1.0 };
    let azimuth = if level > 0.0 { side * poly::acos((direction.x / level).clamp(-1.0, 1.0)) } else { 0.0 };
    let [first, second, _] = hash_to_vector(&seed);
    let (sine, cosine) = poly::sin_cos(poly::acos(direction.z.clamp(-1.0, 1.0)) + first * PI * isotropy);
    let (y, x) = poly::sin_cos(azimuth + second * PI * isotropy);
    Vec3::new(sine * x, sine * y, cosine)
}

/// Value, phase and intensity; `integral` is that of the squared kernel.
fn outputs([x, y]: [f32; 2], integral: f32) -> [f32; 3] {
    let scale = 1.0 / (SPREAD * (IMPULSES as f32 * 0.5 * integral).sqrt());
    [0.5 * y * scale + 0.5, (poly::atan2(y, x) + PI) / (2.0 * PI), (x * x + y * y).sqrt() * scale]
}
