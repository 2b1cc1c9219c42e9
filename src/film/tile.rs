//! The part of a film that one thread fills.

use super::channel::PixelType;
use super::sums::{Layout, Sums};
use std::sync::Arc;

/// A rectangle of a film with its own sums. Pixels are counted row by row from the tile's top left corner.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmTile {
    /// Left column in the film.
    pub x0: u32,
    /// Top row in the film.
    pub y0: u32,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    pub(super) layout: Arc<Layout>,
    pub(super) sums: Sums,
    pub(super) invalid_samples: u64,
}

impl FilmTile {
    /// An empty tile of a film with these channels.
    ///
    /// # Panics
    /// If there is no memory for it.
    pub fn new(x0: u32, y0: u32, width: u32, height: u32, layout: &Arc<Layout>) -> FilmTile {
        let sums = Sums::try_new(width as usize * height as usize, layout, false);
        let sums = sums.expect("there is memory for a tile");
        FilmTile { x0, y0, width, height, layout: layout.clone(), sums, invalid_samples: 0 }
    }

    /// Adds a sample to the pixel `pixel` of the tile: premultiplied linear colour and alpha. A sample with NaN or an
    /// infinity is left out and counted; false then. Channels beyond colour take
    /// [`add_with_first_hit`](FilmTile::add_with_first_hit).
    #[inline(always)]
    pub fn add(&mut self, pixel: u32, rgb: [f32; 3], alpha: f32) -> bool {
        let [r, g, b] = rgb;
        // One test for all four: a product with zero is zero unless a factor is NaN or infinite.
        if r * 0.0 + g * 0.0 + b * 0.0 + alpha * 0.0 != 0.0 {
            self.invalid_samples += 1;
            return false;
        }
        self.sums.add(pixel as usize, rgb, alpha);
        true
    }

    /// Adds a sample to all channels. `first_hit` has what the first surface brings to the channels that show it, their
    /// components one after another in the order of the film's channels; `None` when the sample hit nothing. What is
    /// not finite counts as having hit nothing.
    pub fn add_with_first_hit(&mut self, pixel: u32, rgb: [f32; 3], alpha: f32, first_hit: Option<&[f32]>) {
        self.add_with_parts(pixel, rgb, alpha, first_hit, &[], false);
    }

    /// The same with the parts of the colour for the channels that show them, red, green and blue of each, in the order of
    /// the film's channels. Films that keep the halves of their samples apart need to know which one it belongs to.
    pub fn add_with_parts(
        &mut self,
        pixel: u32,
        rgb: [f32; 3],
        alpha: f32,
        first_hit: Option<&[f32]>,
        parts: &[[f32; 3]],
        is_of_first_half: bool,
    ) {
        if !self.add(pixel, rgb, alpha) {
            return;
        }
        if is_of_first_half && self.layout.has_halves {
            self.sums.add_to_first_half(pixel as usize, rgb);
        }
        let first_hit = first_hit.filter(|values| self.is_finite(values));
        self.sums.add_further(pixel as usize, rgb, first_hit, parts, &self.layout);
    }

    /// Are all floats of a first hit finite? Integers travel as bits.
    fn is_finite(&self, mut values: &[f32]) -> bool {
        self.layout.first_hits().all(|channel| {
            let (own, rest) = values.split_at(channel.components());
            values = rest;
            channel.pixel_type == PixelType::Uint || own.iter().all(|v| v.is_finite())
        })
    }
}
