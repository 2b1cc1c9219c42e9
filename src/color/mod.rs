//! Linear RGB colours, luminance, the sRGB transfer function, spectra and view transforms; colour spaces by their
//! primaries and white point, conversion matrices, and white balance.

use bytemuck::{Pod, Zeroable};
use std::fmt;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};
pub use view::{ViewTable, ViewTransform};

pub mod spectral;
mod view;

/// Converts a colour by a matrix between colour spaces, in double precision.
#[inline]
pub fn converted(matrix: &[[f64; 3]; 3], rgb: [f32; 3]) -> [f32; 3] {
    apply(matrix, rgb.map(f64::from)).map(|value| value as f32)
}

/// Relative luminance of a linear Rec. 709 colour (ITU-R BT.709-6, Y row of the RGB to XYZ matrix).
#[inline(always)]
pub fn luminance(rgb: [f32; 3]) -> f32 {
    0.212_639_01 * rgb[0] + 0.715_168_68 * rgb[1] + 0.072_192_32 * rgb[2]
}

/// Decodes one sRGB-encoded value in 0..1 to linear (IEC 61966-2-1). Exact to f32 rounding; for tables and tests, not
/// for hot loops.
pub fn linear_from_srgb(encoded: f32) -> f32 {
    let c = f64::from(encoded);
    let linear = if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    linear as f32
}

/// Encodes one linear value for sRGB (IEC 61966-2-1), clamped to 0..1; NaN becomes 0.
pub fn srgb_from_linear(linear: f32) -> f32 {
    let c = f64::from(if linear.is_nan() { 0.0 } else { linear.clamp(0.0, 1.0) });
    let encoded = if c <= 0.003_130_8 { c * 12.92 } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
    encoded as f32
}

/// The 256 linear values of 8-bit sRGB codes.
pub fn srgb_table() -> &'static [f32; 256] {
    static TABLE: std::sync::OnceLock<[f32; 256]> = std::sync::OnceLock::new();
    TABLE.get_or_init(|| std::array::from_fn(|i| linear_from_srgb(i as f32 / 255.0)))
}

/// A linear Rec. 709 colour, or any other quantity per channel (index of refraction, extinction). A type of its own, so that
/// colours and vectors cannot be mixed up.
///
/// Operations are written channel by channel, so that loops over colours vectorise.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Rgb {
    /// Red.
    pub r: f32,
    /// Green.
    pub g: f32,
    /// Blue.
    pub b: f32,
}

impl Rgb {
    /// Black.
    pub const ZERO: Rgb = Rgb::splat(0.0);
    /// White.
    pub const ONE: Rgb = Rgb::splat(1.0);

    /// From its channels.
    #[inline(always)]
    pub const fn new(r: f32, g: f32, b: f32) -> Rgb {
        Rgb { r, g, b }
    }

    /// Grey.
    #[inline(always)]
    pub const fn splat(value: f32) -> Rgb {
        Rgb { r: value, g: value, b: value }
    }

    /// From red, green and blue.
    #[inline(always)]
    pub const fn from_array([r, g, b]: [f32; 3]) -> Rgb {
        Rgb { r, g, b }
    }

    /// From the first three values.
    ///
    /// # Panics
    /// If there are fewer.
    #[inline(always)]
    pub const fn from_slice(values: &[f32]) -> Rgb {
        Rgb { r: values[0], g: values[1], b: values[2] }
    }

    /// Red, green and blue.
    #[inline(always)]
    pub const fn to_array(self) -> [f32; 3] {
        [self.r, self.g, self.b]
    }

    /// A function of each channel.
    #[inline(always)]
    pub fn map(self, f: impl Fn(f32) -> f32) -> Rgb {
        Rgb { r: f(self.r), g: f(self.g), b: f(self.b) }
    }

    /// A function of each channel of two colours.
    #[inline(always)]
    pub fn zip(self, other: Rgb, f: impl Fn(f32, f32) -> f32) -> Rgb {
        Rgb { r: f(self.r, other.r), g: f(self.g, other.g), b: f(self.b, other.b) }
    }

    /// `yes` or `no`, without a branch, so that loops vectorise.
    #[inline(always)]
    pub fn select(condition: bool, yes: Rgb, no: Rgb) -> Rgb {
        yes.zip(no, |a, b| if condition { a } else { b })
    }

    /// The minimum per channel; the channel of `other` if either is NaN.
    #[inline(always)]
    pub fn min(self, other: Rgb) -> Rgb {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    /// The maximum per channel; the channel of `other` if either is NaN.
    #[inline(always)]
    pub fn max(self, other: Rgb) -> Rgb {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    /// Clamps each channel to the range between those of two colours.
    #[inline(always)]
    pub fn clamp(self, min: Rgb, max: Rgb) -> Rgb {
        self.max(min).min(max)
    }

    /// The absolute value of each channel.
    #[inline(always)]
    pub fn abs(self) -> Rgb {
        self.map(f32::abs)
    }

    /// The largest channel.
    #[inline(always)]
    pub fn max_element(self) -> f32 {
        let max = |a: f32, b: f32| if a > b { a } else { b };
        max(self.r, max(self.g, self.b))
    }

    /// The smallest channel.
    #[inline(always)]
    pub fn min_element(self) -> f32 {
        let min = |a: f32, b: f32| if a < b { a } else { b };
        min(self.r, min(self.g, self.b))
    }

    /// Are all channels finite?
    #[inline(always)]
    pub fn is_finite(self) -> bool {
        self.r.is_finite() & self.g.is_finite() & self.b.is_finite()
    }

    /// The mean of the channels, the weight for selecting lobes.
    #[inline(always)]
    pub fn mean(self) -> f32 {
        (self.r + self.g + self.b) * (1.0 / 3.0)
    }

    /// Relative luminance; see [`luminance`].
    #[inline(always)]
    pub fn luminance(self) -> f32 {
        luminance(self.to_array())
    }
}

impl From<[f32; 3]> for Rgb {
    #[inline(always)]
    fn from(rgb: [f32; 3]) -> Rgb {
        Rgb::from_array(rgb)
    }
}

impl From<Rgb> for [f32; 3] {
    #[inline(always)]
    fn from(color: Rgb) -> [f32; 3] {
        color.to_array()
    }
}

/// Implements an operator per channel for two colours, for a colour and a number, and in place.
macro_rules! by_channel {
    ($($operator:ident $function:ident, $assign:ident $in_place:ident;)*) => {$(
        impl $operator for Rgb {
            type Output = Rgb;
            #[inline(always)]
            fn $function(self, other: Rgb) -> Rgb {
                self.zip(other, |a, b| a.$function(b))
            }
        }

        impl $operator<f32> for Rgb {
            type Output = Rgb;
            #[inline(always)]
            fn $function(self, number: f32) -> Rgb {
                self.map(|a| a.$function(number))
            }
        }

        impl $assign for Rgb {
            #[inline(always)]
            fn $in_place(&mut self, other: Rgb) {
                *self = (*self).$function(other);
            }
        }

        impl $assign<f32> for Rgb {
            #[inline(always)]
            fn $in_place(&mut self, number: f32) {
                *self = (*self).$function(number);
            }
        }
    )*};
}

by_channel! {
    Add add, AddAssign add_assign;
    Sub sub, SubAssign sub_assign;
    Mul mul, MulAssign mul_assign;
    Div div, DivAssign div_assign;
}

impl Mul<Rgb> for f32 {
    type Output = Rgb;
    #[inline(always)]
    fn mul(self, color: Rgb) -> Rgb {
        color.map(|c| self * c)
    }
}

impl fmt::Display for Rgb {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{}, {}, {}]", self.r, self.g, self.b)
    }
}

impl Neg for Rgb {
    type Output = Rgb;
    #[inline(always)]
    fn neg(self) -> Rgb {
        self.map(|c| -c)
    }
}

impl Sum for Rgb {
    #[inline(always)]
    fn sum<I: Iterator<Item = Rgb>>(colors: I) -> Rgb {
        colors.fold(Rgb::ZERO, Add::add)
    }
}

#[cfg(test)]
mod rgb_tests {
    use super::*;

    #[test]
    fn operators_apply_per_channel() {
        let (a, b) = (Rgb::new(1.0, 2.0, 4.0), Rgb::new(2.0, 8.0, 0.5));
        assert_eq!((a + b, a - b), (Rgb::new(3.0, 10.0, 4.5), Rgb::new(-1.0, -6.0, 3.5)));
        assert_eq!((a * b, b / a), (Rgb::new(2.0, 16.0, 2.0), Rgb::new(2.0, 4.0, 0.125)));
        assert_eq!((a * 2.0, 2.0 * a, -a), (Rgb::new(2.0, 4.0, 8.0), a + a, Rgb::ZERO - a));
        let mut c = a;
        c += b;
        c -= a;
        c *= 2.0;
        c /= 2.0;
        assert_eq!(c, b);
        assert_eq!([a, b].into_iter().sum::<Rgb>(), a + b);
    }

    #[test]
    fn elements_bounds_and_means() {
        let a = Rgb::new(0.25, -2.0, 4.25);
        assert_eq!((a.min_element(), a.max_element(), a.abs().min_element()), (-2.0, 4.25, 0.25));
        assert_eq!(a.clamp(Rgb::ZERO, Rgb::ONE), Rgb::new(0.25, 0.0, 1.0));
        assert!((a.mean() - 2.5 / 3.0).abs() < 1e-6);
        assert!(a.is_finite() && !(a / 0.0).is_finite() && !Rgb::splat(f32::NAN).is_finite());
        assert_eq!((Rgb::select(true, a, Rgb::ONE), Rgb::select(false, a, Rgb::ONE)), (a, Rgb::ONE));
        assert!((Rgb::ONE.luminance() - 1.0).abs() < 1e-6);
        assert_eq!(Rgb::from_slice(&[1.0, 2.0, 3.0, 9.0]), Rgb::from([1.0, 2.0, 3.0]));
    }
}

/// CIE 1931 chromaticities (x, y) of a colour space's primaries and white point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Primaries {
    pub red: [f64; 2],
    pub green: [f64; 2],
    pub blue: [f64; 2],
    /// White point.
    pub white: [f64; 2],
}

impl Primaries {
    /// Rec. 709 and sRGB (ITU-R BT.709-6, table 1).
    pub const REC709: Primaries =
        Primaries { red: [0.64, 0.33], green: [0.30, 0.60], blue: [0.15, 0.06], white: [0.3127, 0.3290] };
    /// ACEScg: AP1 (Academy S-2014-004, table 1), with the white point of ACES (about D60).
    pub const AP1: Primaries = Primaries {
        red: [0.713, 0.293],
        green: [0.165, 0.830],
        blue: [0.128, 0.044],
        white: [0.32168, 0.33767],
    };

    /// The matrix to linear Rec. 709; `None` for Rec. 709 itself and for degenerate primaries.
    pub fn to_rec709(&self) -> Option<[[f64; 3]; 3]> {
        // File headers store primaries in single precision, hence the tolerance.
        let is_identity = |m: &[[f64; 3]; 3]| {
            (0..3).all(|row| (0..3).all(|c| (m[row][c] - f64::from(u8::from(row == c))).abs() < 1e-4))
        };
        self.to(&Primaries::REC709).filter(|matrix| !is_identity(matrix))
    }

    /// The matrix from linear RGB to XYZ, with a luminance of 1 for white (SMPTE RP 177-1993).
    fn xyz_from_rgb(&self) -> Option<Matrix> {
        let columns = [self.red, self.green, self.blue].map(xyz);
        let rows = transposed(&columns);
        let amounts = apply(&inverse(&rows)?, xyz(self.white));
        Some(rows.map(|row| [0, 1, 2].map(|c| row[c] * amounts[c])))
    }

    /// The matrix from XYZ to linear RGB, without chromatic adaptation.
    fn rgb_from_xyz(&self) -> Option<Matrix> {
        inverse(&self.xyz_from_rgb()?)
    }

    /// The matrix from linear colours of this space to those of another, with chromatic adaptation of the white point. `None` for
    /// degenerate primaries.
    pub fn to(&self, other: &Primaries) -> Option<[[f64; 3]; 3]> {
        let xyz = product(&adaptation(self.white, other.white)?, &self.xyz_from_rgb()?);
        let matrix = product(&other.rgb_from_xyz()?, &xyz);
        matrix.as_flattened().iter().all(|v| v.is_finite()).then_some(matrix)
    }
}

/// Chromatic adaptation of XYZ from one white point to another (Bradford, Lam 1985).
fn adaptation(from: [f64; 2], to: [f64; 2]) -> Option<Matrix> {
    let [from, to] = [from, to].map(|white| apply(&CONES_FROM_XYZ, xyz(white)));
    let scaled = [0, 1, 2].map(|cone| CONES_FROM_XYZ[cone].map(|v| v * to[cone] / from[cone]));
    Some(product(&inverse(&CONES_FROM_XYZ)?, &scaled))
}

/// XYZ of a chromaticity at luminance 1.
fn xyz([x, y]: [f64; 2]) -> [f64; 3] {
    [x / y, 1.0, (1.0 - x - y) / y]
}

fn transposed(m: &Matrix) -> Matrix {
    [0, 1, 2].map(|row| [0, 1, 2].map(|column| m[column][row]))
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let columns = transposed(b).map(|column| apply(a, column));
    transposed(&columns)
}

/// The inverse, by cofactors; `None` for singular matrices.
fn inverse(m: &Matrix) -> Option<Matrix> {
    let minor = |row: usize, column: usize| {
        let [r0, r1] = [(row + 1) % 3, (row + 2) % 3];
        let [c0, c1] = [(column + 1) % 3, (column + 2) % 3];
        m[r0][c0] * m[r1][c1] - m[r0][c1] * m[r1][c0]
    };
    let determinant: f64 = (0..3).map(|column| m[0][column] * minor(0, column)).sum();
    let is_regular = determinant.is_finite() && determinant != 0.0;
    is_regular.then(|| [0, 1, 2].map(|row| [0, 1, 2].map(|column| minor(column, row) / determinant)))
}

// White balance: chromatic adaptation from a colour temperature to D65.

/// Bradford cone responses from XYZ (Lam 1985).
const CONES_FROM_XYZ: Matrix =
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];

type Matrix = [[f64; 3]; 3];

/// The chromatic adaptation matrix, for linear Rec. 709, from the white of a colour temperature, 1667 to 25000 kelvin, to D65.
pub fn white_balance(kelvin: f64) -> [[f32; 3]; 3] {
    let (space, white) = (Primaries::REC709, chromaticity(kelvin));
    let matrices = [adaptation(white, space.white), space.xyz_from_rgb(), space.rgb_from_xyz()];
    // Rec. 709 and colour temperatures aren't degenerate.
    let [adaptation, xyz_from_rgb, rgb_from_xyz] = matrices.map(Option::unwrap_or_default);
    product(&rgb_from_xyz, &product(&adaptation, &xyz_from_rgb)).map(|row| row.map(|v| v as f32))
}

/// Chromaticity of a colour temperature: daylight (CIE 15:2004, equations 3.3 and 3.4) above 4500 K, black bodies (Kang et al.
/// 2002) below 3500 K, blended in between.
fn chromaticity(kelvin: f64) -> [f64; 2] {
    let t = kelvin.clamp(1667.0, 25_000.0);
    let weight = ((t - 3500.0) / 1000.0).clamp(0.0, 1.0);
    let (day, body) = (daylight(t.max(4000.0)), black_body(t));
    [0, 1].map(|k| body[k] + weight * (day[k] - body[k]))
}

fn daylight(t: f64) -> [f64; 2] {
    let x = match t <= 7000.0 {
        true => -4.6070e9 / t.powi(3) + 2.9678e6 / t.powi(2) + 0.09911e3 / t + 0.244063,
        false => -2.0064e9 / t.powi(3) + 1.9018e6 / t.powi(2) + 0.24748e3 / t + 0.237040,
    };
    [x, -3.0 * x * x + 2.870 * x - 0.275]
}

fn black_body(t: f64) -> [f64; 2] {
    let x = match t <= 4000.0 {
        true => -0.2661239e9 / t.powi(3) - 0.2343589e6 / t.powi(2) + 0.8776956e3 / t + 0.179910,
        false => -3.0258469e9 / t.powi(3) + 2.1070379e6 / t.powi(2) + 0.2226347e3 / t + 0.240390,
    };
    let y = match t {
        t if t <= 2222.0 => ((-1.1063814 * x - 1.34811020) * x + 2.18555832) * x - 0.20219683,
        t if t <= 4000.0 => ((-0.9549476 * x - 1.37418593) * x + 2.09137015) * x - 0.16748867,
        _ => ((3.0817580 * x - 5.87338670) * x + 3.75112997) * x - 0.37001483,
    };
    [x, y]
}

fn apply(matrix: &Matrix, v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

#[cfg(test)]
mod white_balance_tests {
    use super::*;

    #[test]
    fn white_balance_keeps_d65_and_whitens_illuminant_a() {
        let balanced = |kelvin, rgb: [f32; 3]| {
            white_balance(kelvin).map(|row| row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2])
        };
        assert!(balanced(6504.0, [1.0; 3]).iter().all(|v| (v - 1.0).abs() < 2e-3));
        // CIE illuminant A: 2856 K, x 0.44758, y 0.40745.
        let [x, y] = [0.44758, 0.40745];
        let lamp =
            apply(&Primaries::REC709.rgb_from_xyz().expect("not degenerate"), xyz([x, y])).map(|v| v as f32);
        let white = balanced(2856.0, lamp);
        assert!(white.iter().all(|v| (v - 1.0).abs() < 0.01), "{lamp:?} {white:?}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_round_trips_every_code() {
        for code in 0..=255u8 {
            let linear = srgb_table()[code as usize];
            assert_eq!((srgb_from_linear(linear) * 255.0).round() as u8, code);
        }
    }

    #[test]
    fn luminance_of_white_is_one() {
        assert!((luminance([1.0; 3]) - 1.0).abs() < 1e-6);
    }

    fn assert_near(matrix: &Matrix, published: &Matrix, within: f64) {
        for (own, theirs) in matrix.as_flattened().iter().zip(published.as_flattened()) {
            assert!((own - theirs).abs() < within, "{matrix:?}, not {published:?}");
        }
    }

    /// Inverse of OpenColorIO's built-in transform `ACEScg_to_LINEAR-REC709_BFD`.
    #[test]
    fn acescg_matrix_matches_opencolorio() {
        let matrix = Primaries::REC709.to(&Primaries::AP1).expect("not degenerate");
        let published = [
            [0.613_097_402_4, 0.339_523_146_2, 0.047_379_451_4],
            [0.070_193_722_5, 0.916_353_879_1, 0.013_452_398_5],
            [0.020_615_592_9, 0.109_569_772_9, 0.869_814_634_2],
        ];
        assert_near(&matrix, &published, 1e-6);
        let back = Primaries::AP1.to(&Primaries::REC709).expect("not degenerate");
        let identity = product(&matrix, &back);
        assert_near(&identity, &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], 1e-12);
        assert_near(&Primaries::AP1.to(&Primaries::AP1).expect("not degenerate"), &identity, 1e-12);
    }

    /// IEC 61966-2-1, and Academy S-2014-004 for AP1.
    #[test]
    fn luminance_weights_match_the_standards() {
        let of = |space: Primaries| space.xyz_from_rgb().expect("not degenerate")[1];
        for (own, published) in [
            (of(Primaries::REC709), [0.212_639, 0.715_169, 0.072_192]),
            (of(Primaries::AP1), [0.272_228_72, 0.674_081_77, 0.053_689_52]),
        ] {
            assert!(own.iter().zip(published).all(|(a, b)| (a - b).abs() < 1e-6), "{own:?}");
        }
    }

    #[test]
    fn degenerate_primaries_have_no_matrix() {
        let line = Primaries { blue: [0.64, 0.33], ..Primaries::REC709 };
        assert_eq!(Primaries::REC709.to(&line), None);
        assert_eq!(Primaries { white: [0.3, 0.0], ..Primaries::AP1 }.to(&Primaries::REC709), None);
    }
}
