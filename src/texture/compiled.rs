//! A texture ready for lookup.

use super::coordinates::TextureCoordinates;
use super::image::ImageLookup;
use crate::color::spectral::Spectrum;
use crate::scene::NoiseKind;
use std::sync::Arc;

/// A texture; others by their numbers.
#[derive(Clone, Debug)]
pub(super) enum Compiled {
    Constant([f32; 4]),
    /// Images that share a grid find the same texels at the same coordinates.
    Image {
        lookup: ImageLookup,
        coordinates: TextureCoordinates,
        grid: u32,
    },
    Checker {
        even: u32,
        odd: u32,
        inverse_size: f32,
        coordinates: TextureCoordinates,
    },
    /// Two textures by a third.
    Mix([u32; 3]),
    Normal,
    /// By the cosine, from 0 to 1; two colours or more.
    Facing(Arc<[[f32; 3]]>),
    Spectrum(Spectrum),
    Noise {
        kind: NoiseKind,
        frequency: f32,
        octaves: u32,
        low: [f32; 3],
        high: [f32; 3],
        seed: u32,
    },
}
