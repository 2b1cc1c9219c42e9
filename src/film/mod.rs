//! The film: where samples become pixels. Threads fill [`FilmTile`]s; the renderer merges them in a fixed order.
//!
//! Every sample belongs to one pixel (filters are importance-sampled, see [`FilterSampler`]), so a pixel is a sum and a
//! count. Sums of a tile are f64: adding f32 values to them loses nothing that a picture could show, however many samples.
//! Sums of a film are exact (`exact.rs`): tiles and films may be added in any order.

mod accumulator;
mod aov;
mod aov_set;
mod arrivals;
mod backdrop;
mod bytes;
mod catcher;
mod channel;
mod coverage;
mod edit;
mod exact;
mod filter;
mod matte;
mod splats;
mod sums;
mod tile;

pub use accumulator::Values;
pub use aov::{Aov, AovInfo, AovSpace, BACKGROUND_DEPTH, MATTE_LEVELS};
pub use aov_set::AovSet;
pub use catcher::CATCHER_PARTS;
pub use channel::{Channel, PixelType, Reduction, Source};
pub use filter::FilterSampler;
pub use matte::{MatteIds, matte_id, matte_key};
pub use splats::{Splat, SplatPart};
pub use sums::Layout;
pub use tile::FilmTile;

use crate::error::{Choice, Error, Result};
use rayon::prelude::*;
use splats::Splats;
use std::sync::Arc;
use sums::Sums;

/// A picture being made: a list of channels, the first of which is colour, for every pixel, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    width: u32,
    height: u32,
    /// Where its first pixel stands in the picture that it is a part of.
    origin: (u32, u32),
    layout: Arc<Layout>,
    sums: Sums,
    /// Light from paths of lamps, once there is some.
    splats: Option<Splats>,
    invalid_samples: u64,
}

/// One component of a channel for all pixels: what a file holds under one name.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane<'a> {
    /// Its name: `R`, `Z`, `albedo.G`.
    pub name: &'a str,
    /// How files store it.
    pub pixel_type: PixelType,
    /// The values, row by row from the top.
    pub values: Values,
}

impl Film {
    /// An empty film of `width` by `height` pixels with colour and these AOVs.
    ///
    /// # Panics
    /// If there is no memory for it; see [`Film::try_new`].
    pub fn new(width: u32, height: u32, aovs: AovSet) -> Film {
        Film::try_new(width, height, aovs.channels()).expect("there is memory for the film")
    }

    /// An empty film of `width` by `height` pixels with colour and further channels.
    ///
    /// # Errors
    /// A usage error that tells how much memory it takes, if that isn't there.
    pub fn try_new(width: u32, height: u32, further: impl IntoIterator<Item = Channel>) -> Result<Film> {
        Film::of_layout(width, height, Layout::new(further))
    }

    /// An empty film that holds what the layout says.
    ///
    /// # Errors
    /// As for [`Film::try_new`].
    pub fn of_layout(width: u32, height: u32, layout: Layout) -> Result<Film> {
        let pixels = u64::from(width) * u64::from(height);
        let sums = usize::try_from(pixels).ok().and_then(|pixels| Sums::try_new(pixels, &layout, true));
        let sums = sums.ok_or_else(|| {
            let gib = pixels as f64 * layout.bytes_per_pixel() as f64 / f64::from(1u32 << 30);
            Error::usage(format!(
                "a picture of {width} x {height} pixels takes {gib:.1} GiB of memory, which the system refuses"
            ))
            .with_help(format!("make it smaller, or leave out {}", Choice::Aovs))
        })?;
        Ok(Film {
            width,
            height,
            origin: (0, 0),
            layout: Arc::new(layout),
            sums,
            splats: None,
            invalid_samples: 0,
        })
    }

    /// A film without pixels, for tiles of this layout.
    pub(crate) fn nowhere(layout: &Arc<Layout>) -> Film {
        let sums = Sums::try_new(0, layout, true).expect("nothing takes no memory");
        Film {
            width: 0,
            height: 0,
            origin: (0, 0),
            layout: layout.clone(),
            sums,
            splats: None,
            invalid_samples: 0,
        }
    }

    /// The same as a part of a larger picture, in which its first pixel stands at (`x0`, `y0`): tiles have their places in
    /// that picture, and only what is within the part is taken.
    #[must_use]
    pub fn at(self, x0: u32, y0: u32) -> Film {
        Film { origin: (x0, y0), ..self }
    }

    /// Where its first pixel stands in the picture that it is a part of.
    pub fn origin(&self) -> (u32, u32) {
        self.origin
    }

    /// Pixels in a row.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// What it holds; colour comes first.
    pub fn channels(&self) -> &[Channel] {
        &self.layout.channels
    }

    /// What [planes](Film::planes) are called, in their order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.channels().iter().flat_map(|channel| channel.names.iter().map(AsRef::as_ref))
    }

    /// What tiles of it hold.
    pub fn layout(&self) -> &Arc<Layout> {
        &self.layout
    }

    /// Samples that were NaN or infinite and therefore left out of their pixels.
    pub fn invalid_samples(&self) -> u64 {
        self.invalid_samples
    }

    /// Pixels without a valid sample: black and transparent, because rendering stopped before or all samples were NaN.
    pub fn unsampled_pixels(&self) -> u64 {
        self.sums.count.iter().filter(|&&n| n == 0).count() as u64
    }

    /// An empty tile for the rectangle that starts at (`x0`, `y0`), cut off at the film's edges.
    pub fn tile(&self, x0: u32, y0: u32, width: u32, height: u32) -> FilmTile {
        let (x0, y0) = (x0.min(self.width), y0.min(self.height));
        FilmTile::new(x0, y0, width.min(self.width - x0), height.min(self.height - y0), &self.layout)
    }

    /// Adds a tile, as far as it is within the film, in any order but for channels that show first samples.
    ///
    /// # Panics
    /// If the tile has other channels.
    pub fn merge(&mut self, tile: FilmTile) {
        let is_ours = Arc::ptr_eq(&tile.layout, &self.layout) || tile.layout == self.layout;
        assert!(is_ours, "a tile has other channels than the film");
        self.add_sums(&tile.sums, (tile.x0, tile.y0), (tile.width, tile.height));
        self.invalid_samples += tile.invalid_samples;
    }

    /// How many pixels of a rectangle of the picture are within the film.
    pub fn pixels_within(&self, x0: u32, y0: u32, width: u32, height: u32) -> u64 {
        let length = |from: u32, size: u32, own: u32, own_size: u32| {
            (from + size).min(own + own_size).saturating_sub(from.max(own))
        };
        u64::from(length(x0, width, self.origin.0, self.width))
            * u64::from(length(y0, height, self.origin.1, self.height))
    }

    /// Adds a film of the same picture with samples of its own, as far as it is within this one. Films may be added in any
    /// order, but for channels that show first samples.
    ///
    /// # Panics
    /// If it has other channels.
    pub fn merge_film(&mut self, other: &Film) {
        assert!(other.layout == self.layout, "films have different channels");
        self.add_sums(&other.sums, other.origin, (other.width, other.height));
        self.merge_splats(other);
        self.invalid_samples += other.invalid_samples;
    }

    /// Counts the samples that were left out, where each pixel was brought so many.
    pub fn count_invalid(&mut self, brought: u32) {
        let brought = u64::from(brought) * self.sums.count.len() as u64;
        let valid: u64 = self.sums.count.iter().map(|&n| u64::from(n)).sum();
        self.invalid_samples = brought.saturating_sub(valid);
    }

    /// Adds what is within the film of sums that stand at a place of the picture and are so large.
    fn add_sums(&mut self, sums: &Sums, (x0, y0): (u32, u32), (width, height): (u32, u32)) {
        let (left, top) = (x0.max(self.origin.0), y0.max(self.origin.1));
        let right = (x0 + width).min(self.origin.0 + self.width);
        let bottom = (y0 + height).min(self.origin.1 + self.height);
        if left >= right {
            return;
        }
        for y in top..bottom {
            let at = self.index(left - self.origin.0, y - self.origin.1);
            let from = (y - y0) as usize * width as usize + (left - x0) as usize;
            self.sums.add_row(at, sums, from, (right - left) as usize, &self.layout);
        }
    }

    /// Mean colour and alpha of all pixels, premultiplied, row by row from the top; zero where there are no samples yet.
    pub fn rgba(&self) -> Vec<[f32; 4]> {
        (0..self.sums.count.len()).map(|pixel| self.mean_of(pixel)).collect()
    }

    /// Mean colour and alpha of a pixel, premultiplied; zero where there are no samples yet.
    pub fn mean_rgba(&self, x: u32, y: u32) -> [f32; 4] {
        self.mean_of(self.index(x, y))
    }

    /// Mean colour and alpha of a pixel by its place in the film.
    fn mean_of(&self, pixel: usize) -> [f32; 4] {
        self.sums.mean_rgba_with(pixel, self.splat(pixel))
    }

    /// Mean colour, premultiplied, of the first half of each pixel's samples and of the second one, row by row from the top;
    /// zero where a half has no sample. The halves are nearly independent: half the difference of their means estimates the
    /// error of the mean of all. `None` unless the film keeps them apart (see
    /// [`RenderOptions::halves`](crate::render::RenderOptions::halves)).
    pub fn halves(&self) -> Option<[Vec<[f32; 3]>; 2]> {
        let of = |half: usize| {
            (0..self.sums.count.len()).map(move |pixel| self.halves_of(pixel).0[half]).collect()
        };
        self.layout.has_halves().then(|| [of(0), of(1)])
    }

    /// The means of a pixel's halves, and of how many samples they are.
    fn halves_of(&self, pixel: usize) -> ([[f32; 3]; 2], [u32; 2]) {
        let (means, counts) = self.sums.halves(pixel);
        let splats = self.splats.as_ref().map_or([[0.0; 3]; 2], |splats| splats.halves(pixel));
        let with = |half: usize, c: usize| (f64::from(means[half][c]) + splats[half][c]) as f32;
        ([0, 1].map(|half| [0, 1, 2].map(|c| with(half, c))), counts)
    }

    /// How far each pixel's mean colour may be off, by its halves: half the difference of their means where they have as many
    /// samples, signed; red, green and blue. NaN where a half has no samples. `None` unless the film keeps halves apart.
    pub fn deviations(&self) -> Option<[Vec<f32>; 3]> {
        let of = |pixel: usize, c: usize| {
            let ([first, second], counts) = self.halves_of(pixel);
            let [n, m] = counts.map(f64::from);
            match n > 0.0 && m > 0.0 {
                // The mean of all is `(n a + m b) / (n + m)`, whose variance is `n m / (n + m)^2` times that of `a - b`.
                true => f64::from(first[c] - second[c]) * (n * m).sqrt() / (n + m),
                false => f64::NAN,
            }
        };
        let plane = |c| (0..self.sums.count.len()).map(|pixel| of(pixel, c) as f32).collect();
        self.layout.has_halves().then(|| [0, 1, 2].map(plane))
    }

    /// Valid samples that pixels have on average.
    pub fn mean_samples(&self) -> f64 {
        let counts = &self.sums.count;
        counts.iter().map(|&count| f64::from(count)).sum::<f64>() / counts.len().max(1) as f64
    }

    /// Valid samples that a pixel has.
    pub fn samples(&self, x: u32, y: u32) -> u32 {
        self.sums.count[self.index(x, y)]
    }

    /// All components of all channels, each computed when its turn comes.
    pub fn planes(&self) -> impl Iterator<Item = Plane<'_>> {
        self.channels().iter().enumerate().flat_map(|(index, channel)| self.planes_of_channel(index, channel))
    }

    /// The same all at once, on all threads of the current pool.
    pub fn all_planes(&self) -> Vec<Plane<'_>> {
        let of = |(index, channel)| self.planes_of_channel(index, channel);
        self.channels().par_iter().enumerate().flat_map_iter(of).collect()
    }

    /// The components of a channel.
    fn planes_of_channel<'a>(
        &self,
        index: usize,
        channel: &'a Channel,
    ) -> impl Iterator<Item = Plane<'a>> + use<'a> {
        let named = channel.names.iter().zip(self.planes_of(index, channel));
        named.map(move |(name, values)| Plane { name, pixel_type: channel.pixel_type, values })
    }

    /// One component by its name in files, such as `R` or `albedo.G`, row by row from the top. `None` if the film doesn't
    /// have it.
    pub fn plane(&self, name: &str) -> Option<Values> {
        let has = |channel: &Channel| channel.names.iter().position(|own| own == name);
        let mut places = self.channels().iter().enumerate().filter_map(|(i, c)| Some((i, c, has(c)?)));
        let (index, channel, component) = places.next()?;
        self.planes_of(index, channel).into_iter().nth(component)
    }

    /// The values of a channel, one list a name.
    fn planes_of(&self, index: usize, channel: &Channel) -> Vec<Values> {
        if index > 0 {
            let mut planes = self.sums.planes(index, channel);
            self.add_splats_to(index, &mut planes);
            return planes;
        }
        let mut planes = [(); 4].map(|()| Vec::with_capacity(self.sums.count.len()));
        for pixel in 0..self.sums.count.len() {
            planes.iter_mut().zip(self.mean_of(pixel)).for_each(|(plane, value)| plane.push(value));
        }
        planes.map(Values::Float).into()
    }

    /// The components of an AOV, row by row from the top. `None` if the film doesn't have it.
    pub fn aov(&self, aov: Aov) -> Option<Vec<Values>> {
        aov.info().names.iter().map(|name| self.plane(name)).collect()
    }

    /// Lays a colour behind each pixel where it is transparent; all pixels with samples become opaque.
    pub fn put_behind(&mut self, color: impl Fn(u32, u32) -> [f32; 3]) {
        for y in 0..self.height {
            for x in 0..self.width {
                let pixel = self.index(x, y);
                let (sum, count) = (&mut self.sums.rgba[pixel], f64::from(self.sums.count[pixel]));
                let behind = color(x, y);
                for c in 0..3 {
                    sum[c] += (count - sum[3]) * f64::from(behind[c]);
                }
                sum[3] = count;
            }
        }
    }

    fn index(&self, x: u32, y: u32) -> usize {
        assert!(x < self.width && y < self.height, "pixel ({x}, {y}) is outside the film");
        y as usize * self.width as usize + x as usize
    }
}

#[cfg(test)]
mod tests;
