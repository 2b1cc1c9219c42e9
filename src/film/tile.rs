//! Tiles: parts of a film, each filled by one thread.

use super::channel::{Accumulator, Layout, Source};
use super::exact_sum::RgbSum;
use std::ops::Range;
use std::sync::Arc;

/// A rectangle of the picture with sums of its own. Pixels are indexed row by row from the top left corner.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmTile {
    /// Left column in the picture.
    pub x0: u32,
    /// Top row in the picture.
    pub y0: u32,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    pub(super) layout: Arc<Layout>,
    pub(super) sums: TileSums,
    pub(super) invalid_samples: u64,
}

/// Plain f64 sums of the samples of a tile. A pixel's values of one source are contiguous, so that a sample is added in one loop.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct TileSums {
    /// Sums of red, green, blue, alpha.
    pub rgba: Vec<[f64; 4]>,
    /// Number of samples of each pixel.
    pub count: Vec<u32>,
    /// Number of samples with a first hit of each pixel; empty if no channel needs it.
    pub hits: Vec<u32>,
    /// Sums over the first half of the samples; empty if the film has no half buffers.
    pub first_half: Vec<RgbSum>,
    /// Sums of first-hit values of all channels, pixel by pixel; those of channels that are not summed are unused.
    pub first_hits: Vec<f64>,
    /// Sums of parts of the radiance (light groups, light passes), RGB each, pixel by pixel.
    pub parts: Vec<f64>,
    /// Accumulators of channels other than colour that are not plain sums, with their indices in [`Layout::extra`].
    pub others: Vec<(usize, Accumulator)>,
}

impl TileSums {
    /// Resets the sums for `pixels` pixels, reusing memory; `false` if memory runs out.
    fn restart(&mut self, pixels: usize, layout: &Layout) -> bool {
        fn zeros<T: bytemuck::Zeroable + Clone>(list: &mut Vec<T>, count: usize) -> bool {
            list.clear();
            let is_allocated = list.try_reserve_exact(count).is_ok();
            if is_allocated {
                list.resize(count, T::zeroed());
            }
            is_allocated
        }
        let extra = layout.extra().iter().enumerate().filter(|(_, channel)| !channel.is_summed());
        let others = extra.map(|(k, c)| Some((k, Accumulator::try_new(c, pixels, false)?)));
        let Some(others) = others.collect() else { return false };
        self.others = others;
        zeros(&mut self.rgba, pixels)
            && zeros(&mut self.count, pixels)
            && zeros(&mut self.hits, if layout.has_first_hits { pixels } else { 0 })
            && zeros(&mut self.first_half, if layout.has_halves { pixels } else { 0 })
            && zeros(&mut self.first_hits, pixels * layout.first_hit_width())
            && zeros(&mut self.parts, pixels * 3 * layout.parts)
    }

    /// Adds a sample to the channels other than colour, after its colour.
    fn add_extra(
        &mut self,
        pixel: usize,
        rgb: [f32; 3],
        first_hit: Option<&[f32]>,
        parts: &[[f32; 3]],
        layout: &Layout,
    ) {
        let is_first = self.count[pixel] == 1;
        for (index, accumulator) in &mut self.others {
            let offset = layout.offsets[*index];
            let channel = &layout.extra()[*index];
            match channel.source {
                Source::Color => accumulator.add(pixel, &rgb, is_first),
                Source::PartOfColor => {
                    if let Some(part) = parts.get(offset / 3) {
                        accumulator.add(pixel, part, is_first);
                    }
                }
                Source::FirstHit => {
                    if let Some(values) = first_hit {
                        let values = &values[offset..offset + channel.components()];
                        accumulator.add(pixel, values, self.hits[pixel] == 0);
                    }
                }
            }
        }
        let of_pixel = &mut self.parts[3 * layout.parts * pixel..][..3 * layout.parts];
        add(of_pixel, parts.as_flattened());
        if let Some(values) = first_hit.filter(|_| layout.has_first_hits) {
            let width = layout.first_hit_width();
            add(&mut self.first_hits[width * pixel..][..width], values);
            self.hits[pixel] += 1;
        }
    }
}

fn add(sums: &mut [f64], values: &[f32]) {
    sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += f64::from(*value));
}

impl FilmTile {
    /// An empty tile of a film with a layout.
    ///
    /// # Panics
    /// If memory runs out.
    pub fn new(x0: u32, y0: u32, width: u32, height: u32, layout: &Arc<Layout>) -> FilmTile {
        let sums = TileSums::default();
        let empty = FilmTile { x0, y0, width, height, layout: layout.clone(), sums, invalid_samples: 0 };
        empty.restarted(x0, y0, width, height, layout)
    }

    /// An empty tile that reuses the memory of this one.
    ///
    /// # Panics
    /// If memory runs out.
    #[must_use]
    pub fn restarted(mut self, x0: u32, y0: u32, width: u32, height: u32, layout: &Arc<Layout>) -> FilmTile {
        let is_allocated = self.sums.restart(width as usize * height as usize, layout);
        assert!(is_allocated, "there is no memory for a tile");
        FilmTile { x0, y0, width, height, layout: layout.clone(), invalid_samples: 0, ..self }
    }

    /// The tile's rectangle in the picture.
    pub(super) fn rect(&self) -> Rect {
        Rect::new((self.x0, self.y0), (self.width, self.height))
    }

    /// Adds a sample, premultiplied linear colour and alpha, to a pixel by its index in the tile. Non-finite samples are discarded and
    /// counted; then `false`. For extra channels see [`add_with_first_hit`](FilmTile::add_with_first_hit).
    #[inline(always)]
    pub fn add(&mut self, pixel: u32, rgb: [f32; 3], alpha: f32) -> bool {
        let [r, g, b] = rgb;
        // A product with zero is zero unless the other factor is NaN or infinite.
        if r * 0.0 + g * 0.0 + b * 0.0 + alpha * 0.0 != 0.0 {
            self.invalid_samples += 1;
            return false;
        }
        let sum = &mut self.sums.rgba[pixel as usize];
        sum[0] += f64::from(r);
        sum[1] += f64::from(g);
        sum[2] += f64::from(b);
        sum[3] += f64::from(alpha);
        self.sums.count[pixel as usize] += 1;
        true
    }

    /// Adds a sample to all channels. `first_hit`: values of the first hit for the channels with the source [`Source::FirstHit`],
    /// concatenated in the order of the film's channels; `None` without a hit. Non-finite values count as no hit.
    pub fn add_with_first_hit(&mut self, pixel: u32, rgb: [f32; 3], alpha: f32, first_hit: Option<&[f32]>) {
        self.add_with_parts(pixel, rgb, alpha, first_hit, &[], false);
    }

    /// Adds a sample with the parts of its radiance for the channels with the source [`Source::PartOfColor`], RGB each, in the order of
    /// the film's channels. `is_of_first_half` only matters for films with half buffers.
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
            self.sums.first_half[pixel as usize].add(rgb);
        }
        let first_hit = first_hit.filter(|values| self.layout.is_finite(values));
        self.sums.add_extra(pixel as usize, rgb, first_hit, parts, &self.layout);
    }
}

// Rectangles of a picture and their division into bands.

/// Number of rows of a band.
pub(super) const BAND_ROWS: u32 = 16;

/// A rectangle of the picture, pixels: left, top, right, bottom; right and bottom exclusive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub x0: u32,
    pub y0: u32,
    pub x1: u32,
    pub y1: u32,
}

impl Rect {
    /// A rectangle by its top left corner and size.
    pub fn new((x0, y0): (u32, u32), (width, height): (u32, u32)) -> Rect {
        Rect { x0, y0, x1: x0.saturating_add(width), y1: y0.saturating_add(height) }
    }

    pub fn width(self) -> u32 {
        self.x1.saturating_sub(self.x0)
    }

    pub fn height(self) -> u32 {
        self.y1.saturating_sub(self.y0)
    }

    pub fn area(self) -> u64 {
        u64::from(self.width()) * u64::from(self.height())
    }

    /// The intersection of two rectangles.
    #[must_use]
    pub fn intersection(self, other: Rect) -> Rect {
        Rect {
            x0: self.x0.max(other.x0),
            y0: self.y0.max(other.y0),
            x1: self.x1.min(other.x1),
            y1: self.y1.min(other.y1),
        }
    }

    /// The rectangle of a band by its index from the top.
    #[must_use]
    pub fn band(self, number: usize) -> Rect {
        let y0 = self.y0 + number as u32 * BAND_ROWS;
        Rect { y0, y1: y0.saturating_add(BAND_ROWS).min(self.y1), ..self }
    }

    /// Indices of the bands that overlap another rectangle.
    pub fn overlapping_bands(self, other: Rect) -> Range<usize> {
        let both = self.intersection(other);
        if both.area() == 0 {
            return 0..0;
        }
        let number = |y: u32| ((y - self.y0) / BAND_ROWS) as usize;
        number(both.y0)..number(both.y1 - 1) + 1
    }

    /// The rows of the intersection: index of the first pixel in both rectangles, and length.
    pub fn common_rows(self, other: Rect) -> impl Iterator<Item = (usize, usize, usize)> {
        let both = self.intersection(other);
        let rows = if both.x0 < both.x1 { both.y0..both.y1 } else { 0..0 };
        let index =
            move |of: Rect, y: u32| (y - of.y0) as usize * of.width() as usize + (both.x0 - of.x0) as usize;
        rows.map(move |y| (index(self, y), index(other, y), both.width() as usize))
    }
}
