//! Procedural pattern nodes as in Cycles: waves, magic, gradients, checkers, bricks.

use super::noise::{Fractal, NoisePoints};
use crate::math::poly;
use crate::scene::nodes::{BandsDirection, GradientType, NoiseType, RingsDirection, WaveProfile, WaveType};
use std::f32::consts::{FRAC_PI_2, TAU};

/// Moves a coordinate off the borders of cells, where rounding would decide the cell.
fn nudged(x: f32) -> f32 {
    (x + 0.000_001) * 0.999_999
}

/// Settings of the wave texture.
#[derive(Clone, Copy, Debug)]
pub struct Wave {
    pub wave_type: WaveType,
    pub bands: BandsDirection,
    pub rings: RingsDirection,
    pub profile: WaveProfile,
}

/// Noise that distorts a wave texture.
#[derive(Clone, Copy, Debug)]
pub struct WaveNoise {
    /// Factor on the noise; none at 0.
    pub distortion: f32,
    pub detail: f32,
    /// Scale of the noise, relative to the wave's coordinates.
    pub detail_scale: f32,
    pub roughness: f32,
}

impl Wave {
    /// The wave at a scaled point, 0..1; `phase` in radians.
    pub fn evaluate(&self, p: [f32; 3], noise: &WaveNoise, phase: f32, points: &mut NoisePoints) -> f32 {
        let [x, y, z] = p.map(nudged);
        let length = |x: f32, y: f32, z: f32| (x * x + y * y + z * z).sqrt() * 20.0;
        let mut n = match (self.wave_type, self.bands, self.rings) {
            (WaveType::Bands, BandsDirection::X, _) => x * 20.0,
            (WaveType::Bands, BandsDirection::Y, _) => y * 20.0,
            (WaveType::Bands, BandsDirection::Z, _) => z * 20.0,
            (WaveType::Bands, BandsDirection::Diagonal, _) => (x + y + z) * 10.0,
            (WaveType::Rings, _, RingsDirection::X) => length(0.0, y, z),
            (WaveType::Rings, _, RingsDirection::Y) => length(x, 0.0, z),
            (WaveType::Rings, _, RingsDirection::Z) => length(x, y, 0.0),
            (WaveType::Rings, _, RingsDirection::Spherical) => length(x, y, z),
        } + phase;
        if noise.distortion != 0.0 {
            let fractal = Fractal {
                noise_type: NoiseType::Fbm,
                normalize: true,
                detail: noise.detail,
                roughness: noise.roughness,
                lacunarity: 2.0,
                offset: 0.0,
                gain: 0.0,
            };
            let value = fractal.evaluate([x, y, z].map(|c| c * noise.detail_scale), points);
            n += noise.distortion * (value * 2.0 - 1.0);
        }
        match self.profile {
            WaveProfile::Sine => 0.5 + 0.5 * poly::sin_cos(n - FRAC_PI_2).0,
            WaveProfile::Saw => {
                let turns = n / TAU;
                turns - turns.floor()
            }
            WaveProfile::Triangle => {
                let turns = n / TAU;
                (turns - (turns + 0.5).floor()).abs() * 2.0
            }
        }
    }
}

/// The magic texture at an unscaled point.
pub fn magic(p: [f32; 3], scale: f32, depth: u32, distortion: f32) -> [f32; 3] {
    let [a, b, c] = p.map(|x| (x * scale) % TAU);
    let (sin, cos) = (|x: f32| poly::sin_cos(x).0, |x: f32| poly::sin_cos(x).1);
    let mut x = sin((a + b + c) * 5.0);
    let mut y = cos((-a + b - c) * 5.0);
    let mut z = -cos((-a - b + c) * 5.0);
    for step in 0..depth.min(10) {
        if step == 0 {
            (x, y, z) = (x * distortion, y * distortion, z * distortion);
        }
        match step {
            0 => y = -cos(x - y + z) * distortion,
            1 => x = cos(x - y - z) * distortion,
            2 => z = sin(-x - y - z) * distortion,
            3 => x = -cos(-x + y - z) * distortion,
            4 => y = -sin(-x + y + z) * distortion,
            5 => y = -cos(-x + y + z) * distortion,
            6 => x = cos(x + y + z) * distortion,
            7 => z = sin(x + y - z) * distortion,
            8 => x = -cos(-x - y + z) * distortion,
            _ => y = -sin(x - y + z) * distortion,
        }
    }
    let divisor = if distortion == 0.0 { 1.0 } else { distortion * 2.0 };
    [x, y, z].map(|v| 0.5 - v / divisor)
}

/// The gradient texture, 0..1.
pub fn gradient(kind: GradientType, [x, y, z]: [f32; 3]) -> f32 {
    let sphere = || (0.999_999 - (x * x + y * y + z * z).sqrt()).max(0.0);
    let value = match kind {
        GradientType::Linear => x,
        GradientType::Quadratic => x.max(0.0) * x.max(0.0),
        GradientType::Easing => {
            let t = x.clamp(0.0, 1.0);
            3.0 * t * t - 2.0 * t * t * t
        }
        GradientType::Diagonal => (x + y) * 0.5,
        GradientType::Radial => poly::atan2(y, x) / TAU + 0.5,
        GradientType::Spherical => sphere(),
        GradientType::QuadraticSphere => sphere() * sphere(),
    };
    value.clamp(0.0, 1.0)
}

/// The checker texture at a scaled point: 1 in cells of the first colour, 0 in the others.
pub fn checker(p: [f32; 3]) -> f32 {
    let [x, y, z] = p.map(|c| (nudged(c).floor() as i32) & 1);
    if (x == y) == (z == 1) { 1.0 } else { 0.0 }
}

/// Settings of the brick texture; lengths are in scaled units.
#[derive(Clone, Copy, Debug)]
pub struct BrickPattern {
    pub offset: f32,
    pub offset_frequency: u32,
    pub squash: f32,
    pub squash_frequency: u32,
    pub mortar_size: f32,
    pub mortar_smooth: f32,
    pub bias: f32,
    pub brick_width: f32,
    pub row_height: f32,
}

/// A random number in 0..1 for a brick.
fn brick_tint(n: u32) -> f32 {
    let n = n.wrapping_add(1013) & 0x7fff_ffff;
    let n = (n >> 13) ^ n;
    let mixed = n
        .wrapping_mul(n.wrapping_mul(n).wrapping_mul(60493).wrapping_add(19_990_303))
        .wrapping_add(1_376_312_589);
    0.5 * ((mixed & 0x7fff_ffff) as f32 / 1_073_741_824.0)
}

impl BrickPattern {
    /// The tint of the brick at a scaled point, and the weight of the mortar, 0..1 each.
    pub fn evaluate(&self, x: f32, y: f32) -> (f32, f32) {
        let row = (y / self.row_height).floor() as i32;
        let every = |frequency: u32| row % frequency as i32 == 0;
        let (mut width, mut offset) = (self.brick_width, 0.0);
        if self.offset_frequency > 0 && self.squash_frequency > 0 {
            width *= if every(self.squash_frequency) { self.squash } else { 1.0 };
            offset = if every(self.offset_frequency) { width * self.offset } else { 0.0 };
        }
        let brick = ((x + offset) / width).floor() as i32;
        let (in_x, in_y) = (x + offset - width * brick as f32, y - self.row_height * row as f32);
        let tint = brick_tint((row << 16).wrapping_add(brick & 0xffff) as u32) + self.bias;
        let nearest = in_x.min(in_y).min((width - in_x).min(self.row_height - in_y));
        let mortar = if nearest >= self.mortar_size {
            0.0
        } else if self.mortar_smooth == 0.0 {
            1.0
        } else {
            let t = ((1.0 - nearest / self.mortar_size) / self.mortar_smooth).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        };
        (tint.clamp(0.0, 1.0), mortar)
    }
}
