//! From scene-referred light to what a display shows.

use crate::color::srgb_from_linear;

/// How linear values become 8-bit ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ViewTransform {
    /// The sRGB transfer function; what is above 1 is clipped.
    #[default]
    Srgb,
    /// A filmic curve that rolls highlights off: Narkowicz 2016, "ACES Filmic Tone Mapping Curve", with the 0.6
    /// exposure that its author gives for the original's brightness; then sRGB.
    Filmic,
}

impl ViewTransform {
    /// One display value in 0..1 for a linear value.
    pub fn encode(self, linear: f32) -> f32 {
        match self {
            ViewTransform::Srgb => srgb_from_linear(linear),
            ViewTransform::Filmic => {
                // The curve's limit for bright values is 2.51 / 2.43 > 1, and infinity / infinity no number.
                let x = if linear > 0.0 { 0.6 * linear.min(1e6) } else { 0.0 };
                srgb_from_linear(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14))
            }
        }
    }
}
