//! Gradient noise (Perlin 2002, "Improving Noise") on a lattice without a short period: gradients are selected by an
//! integer hash of the cell's coordinates instead of a permutation table of 256 entries.

use crate::math::{Vec3, poly};
use crate::sampling::hash::murmur32;

/// Scales the noise to -1..1: with the twelve edge gradients its largest magnitude is just above 1.
const SCALE: f32 = 0.96;

/// Hash of lattice coordinates and a seed, combined one by one.
#[inline(always)]
fn hash(x: i32, y: i32, z: i32, seed: u32) -> u32 {
    let step = |h: u32, v: i32| murmur32(h.wrapping_mul(0x9e37_79b1).wrapping_add(v as u32));
    step(step(step(seed ^ 0x5bd1_e995, x), y), z)
}

/// Dot product of the offset with one of the twelve vectors from the centre to the edge midpoints of a cube.
#[inline(always)]
fn gradient(hash: u32, d: Vec3) -> f32 {
    // Maps the hash to 0..12 uniformly by its high bits.
    let k = ((u64::from(hash) * 12) >> 32) as u32;
    let (a, b) = match k >> 2 {
        0 => (d.x, d.y),
        1 => (d.y, d.z),
        _ => (d.z, d.x),
    };
    let flip = |v: f32, on: u32| if on == 0 { v } else { -v };
    flip(a, k & 1) + flip(b, k & 2)
}

/// The lattice cell of a coordinate and the position in it, 0..1. Cells wrap around at 2^31, where f32 has no fractional
/// part.
#[inline(always)]
fn cell(x: f32) -> (i32, f32) {
    let floor = x.floor();
    let inside = x - floor;
    (floor as i64 as i32, if inside.is_finite() { inside } else { 0.0 })
}

/// Gradient noise, -1..1, 0 at lattice points, with continuous second derivatives.
#[inline]
pub fn perlin(p: Vec3, seed: u32) -> f32 {
    let ((x, fx), (y, fy), (z, fz)) = (cell(p.x), cell(p.y), cell(p.z));
    let fade = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let corner = |i: i32, j: i32, k: i32| {
        let h = hash(x.wrapping_add(i), y.wrapping_add(j), z.wrapping_add(k), seed);
        gradient(h, Vec3::new(fx - i as f32, fy - j as f32, fz - k as f32))
    };
    let lerp = |a: f32, b: f32, t: f32| a + t * (b - a);
    let (u, v, w) = (fade(fx), fade(fy), fade(fz));
    let edge = |j, k| lerp(corner(0, j, k), corner(1, j, k), u);
    let face = |k| lerp(edge(0, k), edge(1, k), v);
    SCALE * lerp(face(0), face(1), w)
}

/// Sum of |noise| over octaves, each of half the scale and amplitude of the last. Lattices are shifted by octave, so that
/// their zeros don't coincide.
#[inline]
pub fn turbulence(p: Vec3, octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut weight, mut scale) = (0.0, 1.0, 1.0);
    for octave in 0..octaves {
        let shift = Vec3::new(0.37, 0.61, 0.83) * octave as f32;
        sum += weight * perlin(p * scale + shift, seed.wrapping_add(octave)).abs();
        weight *= 0.5;
        scale *= 2.0;
    }
    sum
}

/// A sine wave along z, 0..1, with a wavelength of 2 pi cells, whose phase is shifted by ten radians times the turbulence
/// (Perlin 1985, "An Image Synthesizer").
#[inline]
pub fn marble(p: Vec3, octaves: u32, seed: u32) -> f32 {
    let turns = (p.z + 10.0 * turbulence(p, octaves, seed)) * std::f32::consts::FRAC_1_PI * 0.5;
    let turns = turns - turns.floor();
    0.5 + 0.5 * poly::sin_cos_turns(if turns.is_finite() { turns } else { 0.0 }).0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::Random;

    fn points(n: usize) -> impl Iterator<Item = Vec3> {
        let mut random = Random::new(21);
        (0..n).map(move |_| Vec3::new(random.next(), random.next(), random.next()) * 200.0 - 100.0)
    }

    #[test]
    fn noise_is_zero_on_the_lattice_and_stays_in_range() {
        for i in -50..50 {
            assert_eq!(perlin(Vec3::new(i as f32, (i * 7) as f32, -i as f32), 3), 0.0);
        }
        let (mut low, mut high, mut sum) = (0.0f32, 0.0f32, 0.0f64);
        for p in points(300_000) {
            let v = perlin(p, 1);
            (low, high, sum) = (low.min(v), high.max(v), sum + f64::from(v));
        }
        assert!(low >= -1.0 && high <= 1.0 && low < -0.8 && high > 0.8, "{low} {high}");
        assert!((sum / 3e5).abs() < 3e-3, "{sum}");
    }

    #[test]
    fn noise_is_continuous_across_cells() {
        for p in points(20_000) {
            let on = Vec3::new(p.x.floor(), p.y, p.z);
            let e = Vec3::X * 1e-4;
            assert!((perlin(on + e, 2) - perlin(on - e, 2)).abs() < 1e-3, "{on}");
        }
    }

    #[test]
    fn noise_has_no_period_of_256_and_depends_on_the_seed() {
        let different =
            |f: &dyn Fn(Vec3) -> f32| points(1000).filter(|&p| (perlin(p, 4) - f(p)).abs() > 1e-3).count();
        assert!(different(&|p| perlin(p + Vec3::X * 256.0, 4)) > 950);
        assert!(different(&|p| perlin(p, 5)) > 950);
        for p in [Vec3::splat(1e9), Vec3::splat(-3e38), Vec3::new(1e5, -1e5, 0.5)] {
            assert!(perlin(p, 0).abs() <= 1.0 && turbulence(p, 4, 0).is_finite() && marble(p, 4, 0) <= 1.0);
        }
    }

    #[test]
    fn one_octave_of_turbulence_is_the_absolute_noise() {
        for p in points(100) {
            assert_eq!(turbulence(p, 1, 9), perlin(p, 9).abs());
            assert!((0.0..=1.0).contains(&marble(p, 7, 9)));
        }
    }
}
