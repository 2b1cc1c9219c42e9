//! Gradient noise of one to four dimensions (Perlin 2002, "Improving Noise") and its fractal sums (Musgrave in Ebert et al. 2003,
//! "Texturing and Modeling", chapter 16), with the lattice hash and scales of Cycles.

use super::hash::{hash_floats, hash_words};
use crate::scene::nodes::NoiseType;
use crate::simd;

/// Coordinates beyond this repeat, since single precision has no fractions left there.
const PERIOD: f32 = 100_000.0;

#[inline(always)]
fn negate_if(x: f32, condition: bool) -> f32 {
    if condition { -x } else { x }
}

/// Dot product of the offset from a lattice point with the gradient there.
#[inline(always)]
fn gradient<const N: usize>(hash: u32, d: [f32; N]) -> f32 {
    let at = |i: usize| d[i % N];
    let (x, y, z, w) = (at(0), at(1), at(2), at(3));
    match N {
        1 => {
            let slope = (1 + (hash & 7)) as f32;
            negate_if(slope, hash & 8 != 0) * x
        }
        2 => {
            let first = hash & 4 == 0;
            let (u, v) = if first { (x, y) } else { (y, x) };
            negate_if(u, hash & 1 != 0) + negate_if(2.0 * v, hash & 2 != 0)
        }
        3 => {
            let h = hash & 15;
            let u = if h < 8 { x } else { y };
            let v = if h < 4 {
                y
            } else if h == 12 || h == 14 {
                x
            } else {
                z
            };
            negate_if(u, h & 1 != 0) + negate_if(v, h & 2 != 0)
        }
        _ => {
            let h = hash & 31;
            let u = if h < 24 { x } else { y };
            let v = if h < 16 { y } else { z };
            let s = if h < 8 { z } else { w };
            negate_if(u, h & 1 != 0) + negate_if(v, h & 2 != 0) + negate_if(s, h & 4 != 0)
        }
    }
}

/// Maximum number of corners of a cell.
const CORNERS: usize = 16;

/// Gradient noise, about -1..1.
#[inline]
pub fn signed_noise<const N: usize>(p: [f32; N]) -> f32 {
    simd::dispatch(Lattice(p))
}

/// Gradient noise at a point. Loops over the corners of the cell are free of branches, so that they vectorise.
struct Lattice<const N: usize>([f32; N]);

impl<const N: usize> simd::Kernel for Lattice<N> {
    type Output = f32;

    #[inline(always)]
    fn run(self) -> f32 {
        lattice_noise(self.0)
    }
}

#[inline(always)]
fn lattice_noise<const N: usize>(p: [f32; N]) -> f32 {
    let (mut cell, mut inside) = ([0u32; N], [0.0f32; N]);
    for i in 0..N {
        let mut x = p[i];
        let is_near = x.abs() < PERIOD;
        if !is_near {
            // Half a cell off the lattice where no coordinate has a fraction, or the noise would be 0.
            x = x % PERIOD + if x.abs() >= 1_000_000.0 { 0.5 } else { 0.0 };
        }
        let floor = x.floor();
        cell[i] = floor as i32 as u32;
        inside[i] = x - floor;
    }
    let mut corners = [0.0f32; CORNERS];
    for corner in 0..1 << N {
        let (mut words, mut offset) = ([0u32; N], [0.0; N]);
        for i in 0..N {
            let bit = (corner >> i & 1) as u32;
            words[i] = cell[i].wrapping_add(bit);
            offset[i] = inside[i] - bit as f32;
        }
        corners[corner as usize] = gradient(hash_words(words), offset);
    }
    for (i, x) in inside.iter().enumerate() {
        let t = x * x * x * (x * (x * 6.0 - 15.0) + 10.0);
        for k in 0..1 << (N - 1 - i) {
            corners[k] = (1.0 - t) * corners[2 * k] + t * corners[2 * k + 1];
        }
    }
    let scale = [0.25, 0.6616, 0.982, 0.8344][N - 1];
    let value = corners[0] * scale;
    if value.is_finite() { value } else { 0.0 }
}

/// Parameters of a fractal sum.
#[derive(Clone, Copy, Debug)]
pub struct Fractal {
    pub noise_type: NoiseType,
    pub normalize: bool,
    /// Octaves after the first; fractions fade the last one in.
    pub detail: f32,
    pub roughness: f32,
    pub lacunarity: f32,
    pub offset: f32,
    pub gain: f32,
}

impl Fractal {
    /// The sum at a point.
    #[inline]
    pub fn evaluate<const N: usize>(&self, p: [f32; N]) -> f32 {
        match self.noise_type {
            NoiseType::Fbm => self.fbm(p),
            NoiseType::Multifractal => self.multifractal(p),
            NoiseType::Ridged => self.ridged(p),
            NoiseType::Hybrid => self.hybrid(p),
            NoiseType::HeteroTerrain => self.hetero_terrain(p),
        }
    }

    fn whole_octaves(&self) -> (u32, f32) {
        let whole = self.detail.floor();
        (whole as u32, self.detail - whole)
    }

    fn fbm<const N: usize>(&self, p: [f32; N]) -> f32 {
        let (octaves, rest) = self.whole_octaves();
        let (mut scale, mut amplitude, mut most, mut sum) = (1.0, 1.0, 0.0, 0.0);
        for _ in 0..=octaves {
            sum += signed_noise(p.map(|x| x * scale)) * amplitude;
            most += amplitude;
            amplitude *= self.roughness;
            scale *= self.lacunarity;
        }
        let normalized = |sum: f32, most: f32| if self.normalize { 0.5 * sum / most + 0.5 } else { sum };
        if rest == 0.0 {
            return normalized(sum, most);
        }
        let more = sum + signed_noise(p.map(|x| x * scale)) * amplitude;
        let (low, high) = (normalized(sum, most), normalized(more, most + amplitude));
        (1.0 - rest) * low + rest * high
    }

    fn multifractal<const N: usize>(&self, mut p: [f32; N]) -> f32 {
        let (octaves, rest) = self.whole_octaves();
        let (mut value, mut power) = (1.0, 1.0);
        for _ in 0..=octaves {
            value *= power * signed_noise(p) + 1.0;
            power *= self.roughness;
            p = p.map(|x| x * self.lacunarity);
        }
        if rest != 0.0 { value * (rest * power * signed_noise(p) + 1.0) } else { value }
    }

    fn hetero_terrain<const N: usize>(&self, mut p: [f32; N]) -> f32 {
        let (octaves, rest) = self.whole_octaves();
        let mut power = self.roughness;
        let mut value = self.offset + signed_noise(p);
        p = p.map(|x| x * self.lacunarity);
        for _ in 1..=octaves {
            value += (signed_noise(p) + self.offset) * power * value;
            power *= self.roughness;
            p = p.map(|x| x * self.lacunarity);
        }
        if rest != 0.0 { value + rest * (signed_noise(p) + self.offset) * power * value } else { value }
    }

    fn hybrid<const N: usize>(&self, mut p: [f32; N]) -> f32 {
        const MIN_WEIGHT: f32 = 0.001;
        let (octaves, rest) = self.whole_octaves();
        let (mut power, mut value, mut weight) = (1.0, 0.0, 1.0f32);
        for _ in 0..=octaves {
            if weight <= MIN_WEIGHT {
                break;
            }
            weight = weight.min(1.0);
            let signal = (signed_noise(p) + self.offset) * power;
            power *= self.roughness;
            value += weight * signal;
            weight *= self.gain * signal;
            p = p.map(|x| x * self.lacunarity);
        }
        if rest != 0.0 && weight > MIN_WEIGHT {
            value += rest * weight.min(1.0) * (signed_noise(p) + self.offset) * power;
        }
        value
    }

    fn ridged<const N: usize>(&self, mut p: [f32; N]) -> f32 {
        let (octaves, _) = self.whole_octaves();
        let ridge = |p: [f32; N]| {
            let signal = self.offset - signed_noise(p).abs();
            signal * signal
        };
        let mut signal = ridge(p);
        let (mut value, mut power) = (signal, self.roughness);
        for _ in 1..=octaves {
            p = p.map(|x| x * self.lacunarity);
            let weight = (signal * self.gain).clamp(0.0, 1.0);
            signal = ridge(p) * weight;
            value += signal * power;
            power *= self.roughness;
        }
        value
    }
}

/// An offset in each dimension that makes another noise of the same one.
#[inline(always)]
fn offset<const N: usize>(seed: f32) -> [f32; N] {
    let mut offset = [0.0; N];
    for (i, x) in offset.iter_mut().enumerate() {
        *x = 100.0 + 100.0 * if N == 1 { hash_floats([seed]) } else { hash_floats([seed, i as f32]) };
    }
    offset
}

fn add<const N: usize>(a: [f32; N], b: [f32; N]) -> [f32; N] {
    std::array::from_fn(|i| a[i] + b[i])
}

/// The noise texture: value and colour at a scaled point.
pub fn noise_texture<const N: usize>(
    mut p: [f32; N],
    distortion: f32,
    fractal: &Fractal,
    has_color: bool,
) -> [f32; 4] {
    if distortion != 0.0 {
        let shift: [f32; N] = std::array::from_fn(|i| signed_noise(add(p, offset(i as f32))) * distortion);
        p = add(p, shift);
    }
    let value = fractal.evaluate(p);
    if !has_color {
        return [value; 4];
    }
    let second = fractal.evaluate(add(p, offset(N as f32)));
    let third = fractal.evaluate(add(p, offset(N as f32 + 1.0)));
    [value, value, second, third]
}
