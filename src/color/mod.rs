//! Linear RGB colours, luminance, the sRGB transfer function, colour spaces, spectra and view transforms.

mod primaries;
pub mod spectral;
mod view;

use bytemuck::{Pod, Zeroable};
pub use primaries::{Primaries, white_balance};
use std::fmt;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};
pub use view::{ViewTable, ViewTransform};

/// A colour by a matrix between spaces, in doubles on the way.
#[inline]
pub fn converted(matrix: &[[f64; 3]; 3], rgb: [f32; 3]) -> [f32; 3] {
    primaries::apply(matrix, rgb.map(f64::from)).map(|value| value as f32)
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

/// A linear Rec. 709 colour, or any other quantity by channel (an index of refraction, an extinction). Positions and
/// directions are vectors of their own; the two do not mix.
///
/// Everything is written channel by channel, so that loops over colours vectorise.
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
    fn zip(self, other: Rgb, f: impl Fn(f32, f32) -> f32) -> Rgb {
        Rgb { r: f(self.r, other.r), g: f(self.g, other.g), b: f(self.b, other.b) }
    }

    /// One of two colours, without a branch: loops that choose vectorise.
    #[inline(always)]
    pub fn select(condition: bool, yes: Rgb, no: Rgb) -> Rgb {
        yes.zip(no, |a, b| if condition { a } else { b })
    }

    /// The lesser of each channel; `other`'s where one is NaN.
    #[inline(always)]
    pub fn min(self, other: Rgb) -> Rgb {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    /// The greater of each channel; `other`'s where one is NaN.
    #[inline(always)]
    pub fn max(self, other: Rgb) -> Rgb {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    /// Each channel between those of two colours.
    #[inline(always)]
    pub fn clamp(self, least: Rgb, most: Rgb) -> Rgb {
        self.max(least).min(most)
    }

    /// The magnitude of each channel.
    #[inline(always)]
    pub fn abs(self) -> Rgb {
        self.map(f32::abs)
    }

    /// The greatest channel.
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

    /// Is no channel NaN or infinite?
    #[inline(always)]
    pub fn is_finite(self) -> bool {
        self.r.is_finite() & self.g.is_finite() & self.b.is_finite()
    }

    /// The mean of the channels, by which lobes are chosen.
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

/// An operator by channel: of two colours, of a colour and a number, and in place.
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
}

#[cfg(test)]
mod rgb_tests {
    use super::*;

    #[test]
    fn operators_work_by_channel() {
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
