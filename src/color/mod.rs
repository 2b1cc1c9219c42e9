//! Linear RGB, luminance and the sRGB transfer function.

mod primaries;
mod rgb;
pub mod spectral;
mod view;
mod white_balance;

pub use primaries::Primaries;
pub use rgb::Rgb;
pub use view::{ViewTable, ViewTransform};
pub use white_balance::white_balance;

/// A colour by a matrix between spaces, in doubles on the way.
#[inline]
pub fn converted(matrix: &[[f64; 3]; 3], rgb: [f32; 3]) -> [f32; 3] {
    white_balance::apply(matrix, rgb.map(f64::from)).map(|value| value as f32)
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
