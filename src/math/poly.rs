//! Elementary functions for hot loops: branch-free, so that loops over them vectorise, and built from f32 additions, multiplications,
//! divisions and square roots only, so that results are bit-identical on every CPU (unlike the system's libm).
//! Coefficients as in Moshier's Cephes library (sinf, cosf, asinf, atanf, expf, logf).

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// 1.5 * 2^23: adding and subtracting it rounds a small f32 to an integer; the low bits of the sum are that integer.
const ROUND: f32 = 12_582_912.0;

/// Sine and cosine of `turns * 2 pi`, for |turns| < 1e5. Absolute error below 1.5e-7 for turns in 0..1.
#[inline(always)]
pub fn sin_cos_turns(turns: f32) -> (f32, f32) {
    let shifted = turns * 4.0 + ROUND;
    let quadrant = shifted.to_bits() & 3;
    let x = (turns - (shifted - ROUND) * 0.25) * TAU;
    let z = x * x;
    let s = ((-1.951_529_6e-4 * z + 8.332_161e-3) * z - 1.666_665_5e-1) * z * x + x;
    let c = ((2.443_315_7e-5 * z - 1.388_731_6e-3) * z + 4.166_664_6e-2) * z * z - 0.5 * z + 1.0;
    let (sine, cosine) = if quadrant & 1 == 0 { (s, c) } else { (c, s) };
    let flip = |v: f32, on: u32| f32::from_bits(v.to_bits() ^ (on << 31));
    (flip(sine, quadrant >> 1), flip(cosine, (quadrant ^ (quadrant >> 1)) & 1))
}

/// Sine and cosine of an angle, for |angle| below a few thousand. Absolute error below 4e-7 within +-2 pi.
#[inline(always)]
pub fn sin_cos(angle_rad: f32) -> (f32, f32) {
    sin_cos_turns(angle_rad * (1.0 / TAU))
}

/// Arc sine on 0..0.5.
#[inline(always)]
fn asin_small(x: f32) -> f32 {
    let z = x * x;
    let p =
        (((4.216_32e-2 * z + 2.418_131_1e-2) * z + 4.547_002_6e-2) * z + 7.495_300_3e-2) * z + 1.666_675_2e-1;
    p * z * x + x
}

/// Arc cosine; the argument is clamped to -1..1. Absolute error below 4e-7; near 1 also the relative error.
#[inline(always)]
pub fn acos(x: f32) -> f32 {
    let a = x.abs();
    let large = a > 0.5;
    let half = (1.0 - a) * 0.5;
    let root = if half > 0.0 { half } else { 0.0 }.sqrt();
    let s = asin_small(if large { root } else { a });
    // acos |x|, then reflection for negative arguments.
    let positive = if large { 2.0 * s } else { FRAC_PI_2 - s };
    if x < 0.0 { PI - positive } else { positive }
}

/// Arc sine; the argument is clamped to -1..1. Absolute error below 4e-7.
#[inline(always)]
pub fn asin(x: f32) -> f32 {
    let a = x.abs();
    let large = a > 0.5;
    let half = (1.0 - a) * 0.5;
    let root = if half > 0.0 { half } else { 0.0 }.sqrt();
    let s = asin_small(if large { root } else { a });
    let positive = if large { FRAC_PI_2 - 2.0 * s } else { s };
    positive.copysign(x)
}

/// Arc tangent for arguments in -1..1. Absolute error below 5e-7.
#[inline(always)]
pub fn atan_small(x: f32) -> f32 {
    let a = x.abs();
    // tan(pi/8): above it, reduce by pi/4.
    let far = a > 0.414_213_57;
    let r = if far { (a - 1.0) / (a + 1.0) } else { a };
    let z = r * r;
    let p = ((8.053_744_5e-2 * z - 1.387_768_6e-1) * z + 1.997_771_1e-1) * z - 3.333_295e-1;
    (p * z * r + r + if far { FRAC_PI_4 } else { 0.0 }).copysign(x)
}

/// The angle of the point (x, y), -pi..pi; 0 for (0, 0). Absolute error below 5e-7.
#[inline(always)]
pub fn atan2(y: f32, x: f32) -> f32 {
    let (ay, ax) = (y.abs(), x.abs());
    let (small, large) = if ay > ax { (ax, ay) } else { (ay, ax) };
    let safe = if large > 0.0 { large } else { 1.0 };
    let octant = atan_small(small / safe);
    let quadrant = if ay > ax { FRAC_PI_2 - octant } else { octant };
    let half = if x < 0.0 { PI - quadrant } else { quadrant };
    half.copysign(y)
}

/// e to the power x, clamped to the range where the result is a normal number. Relative error below 2e-7.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    let x = if x > 88.0 { 88.0 } else { x };
    let x = if x < -87.0 { -87.0 } else { x };
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    // ln 2 as a sum of two: the first has few bits, so that the product with n is exact.
    let r = x - n * 0.693_359_4 + n * 2.121_944_4e-4;
    let p = ((((1.987_569_1e-4 * r + 1.398_199_9e-3) * r + 8.333_452e-3) * r + 4.166_579_6e-2) * r
        + 1.666_666_5e-1)
        * r
        + 0.5;
    let e = p * r * r + r + 1.0;
    let power = f32::from_bits((shifted.to_bits() << 23).wrapping_add(1.0f32.to_bits()));
    e * power
}

/// Natural logarithm of a positive normal number. Absolute error below 2e-7 times (1 + |ln x|).
#[inline(always)]
pub fn ln(x: f32) -> f32 {
    let bits = x.to_bits();
    // Mantissa in sqrt(1/2)..sqrt(2).
    let e = (bits as i32).wrapping_sub(0x3f35_04f3) >> 23;
    let m = f32::from_bits((bits as i32).wrapping_sub(e << 23) as u32) - 1.0;
    let z = m * m;
    let p = (((((((7.037_683_6e-2 * m - 1.151_461e-1) * m + 1.167_699_9e-1) * m - 1.242_014_1e-1) * m
        + 1.424_932_3e-1)
        * m
        - 1.666_805_8e-1)
        * m
        + 2.000_071_5e-1)
        * m
        - 2.499_999_4e-1)
        * m
        + 3.333_333e-1;
    let e = e as f32;
    (p * m * z - e * 2.121_944_4e-4 - 0.5 * z + m) + e * 0.693_359_4
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(lo: f64, hi: f64) -> impl Iterator<Item = f32> {
        (0..=200_000).map(move |i| (lo + (hi - lo) * f64::from(i) / 200_000.0) as f32)
    }

    fn worst(values: impl Iterator<Item = f64>) -> f64 {
        values.fold(0.0, f64::max)
    }

    #[test]
    fn sine_and_cosine() {
        let e = worst(grid(-1.0, 1.0).map(|t| {
            let (s, c) = sin_cos_turns(t);
            let a = f64::from(t) * std::f64::consts::TAU;
            (f64::from(s) - a.sin()).abs().max((f64::from(c) - a.cos()).abs())
        }));
        assert!(e < 1.5e-7, "{e}");
    }

    #[test]
    fn arcs() {
        let e = worst(grid(-1.0, 1.0).map(|x| {
            let a = f64::from(x);
            (f64::from(acos(x)) - a.acos()).abs().max((f64::from(asin(x)) - a.asin()).abs())
        }));
        assert!(e < 4e-7, "{e}");
        let e = worst(grid(-10.0, 10.0).map(|t| {
            let (s, c) = (f64::from(t) * 1.7).sin_cos();
            let (y, x) = (s as f32, (c * 3.0) as f32);
            (f64::from(atan2(y, x)) - f64::from(y).atan2(f64::from(x))).abs()
        }));
        assert!(e < 5e-7, "{e}");
        assert_eq!(atan2(0.0, 0.0), 0.0);
        assert_eq!(acos(2.0), 0.0);
    }

    #[test]
    fn exponential_and_logarithm() {
        let e = worst(grid(-80.0, 80.0).map(|x| (f64::from(exp(x)) / f64::from(x).exp() - 1.0).abs()));
        assert!(e < 2e-7, "{e}");
        let e = worst(grid(1e-6, 50.0).map(|x| {
            let l = f64::from(x).ln();
            (f64::from(ln(x)) - l).abs() / (1.0 + l.abs())
        }));
        assert!(e < 2e-7, "{e}");
    }
}
