//! The film: sums of all channels for every pixel, in bands of rows.
//!
//! # Shadow catchers
//! Shadow catchers are invisible; only the effects of other objects on them are visible: shadows and reflections.
//!
//! The film stores, for samples whose camera rays hit a catcher first, the radiance W with the whole scene, the radiance O with only
//! catchers and lights, both as means over all samples of the pixel, and the fraction c of these samples. Their colour becomes, channel by
//! channel,
//!
//! ```text
//! rgb = W - (1 - a) O,    alpha = a c,    with a = 1 - min(1, minimum of W / O over the channels).
//! ```
//!
//! Composited over a plate P the result is rgb + (c - alpha) P, where the plate replaces O / c. For P = O / c this is W, the radiance of
//! the catcher as an ordinary object, for any a, so the ratio of two estimates causes no bias. With this a, rgb is never negative, a
//! grey shadow is alpha only and darkens any plate by its factor, and additional light is added. The factors W / O, by which
//! the channels of a plate may be multiplied, are a separate layer, as in Cycles ("shadow catcher" pass).
//!
//! Cycles' combined picture has only alpha, a = 1 - min(1, mean of W / O over the channels), so that coloured shadows become grey and
//! additional light is lost ([`CatcherOutput::Shadows`]).

use super::aov::{Aov, AovSet};
use super::band::Band;
use super::channel::{Channel, Layout, PixelType, Reduction, Source, Values};
use super::splats::{Splat, Splats};
use super::tile::{BAND_ROWS, FilmTile, Rect};
use crate::error::{Choice, Error, Result};
use crate::image::Image;
use crate::scene::{Backdrop, CatcherOutput};
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::Arc;

/// A picture as sums of samples: channels, the first of which is colour, for every pixel, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    width: u32,
    height: u32,
    /// Position of the film's top left pixel in the whole picture.
    origin: (u32, u32),
    pub(super) layout: Arc<Layout>,
    /// Bands of [`BAND_ROWS`] rows; the last may have fewer.
    pub(super) bands: Vec<Band>,
    pub(super) invalid_samples: u64,
}

/// One component of a channel for all pixels: a channel in files.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane<'a> {
    /// Name in files: `R`, `Z`, `albedo.G`.
    pub name: &'a str,
    /// Type of the values in files.
    pub pixel_type: PixelType,
    /// The values, row by row from the top.
    pub values: Values,
}

impl Film {
    /// An empty film of `width` by `height` pixels with colour and AOVs.
    ///
    /// # Panics
    /// If memory runs out; see [`Film::try_new`].
    pub fn new(width: u32, height: u32, aovs: AovSet) -> Film {
        Film::try_new(width, height, aovs.channels()).expect("there is memory for the film")
    }

    /// An empty film of `width` by `height` pixels with colour and extra channels.
    ///
    /// # Errors
    /// If memory runs out: a usage error with the required memory.
    pub fn try_new(width: u32, height: u32, extra: impl IntoIterator<Item = Channel>) -> Result<Film> {
        Film::of_layout(width, height, Layout::new(extra))
    }

    /// An empty film with the channels of a layout.
    ///
    /// # Errors
    /// As for [`Film::try_new`].
    pub fn of_layout(width: u32, height: u32, layout: Layout) -> Result<Film> {
        let pixels = u64::from(width) * u64::from(height);
        let bands = Film::try_bands((width, height), &layout);
        let bands = bands.ok_or_else(|| {
            let gib = pixels as f64 * layout.bytes_per_pixel() as f64 / f64::from(1u32 << 30);
            Error::usage(format!(
                "a picture of {width} x {height} pixels takes {gib:.1} GiB of memory, which the system refuses"
            ))
            .with_help(format!("make it smaller, or leave out {}", Choice::Aovs))
        })?;
        Ok(Film { width, height, origin: (0, 0), layout: Arc::new(layout), bands, invalid_samples: 0 })
    }

    /// Empty bands; `None` if memory runs out.
    fn try_bands((width, height): (u32, u32), layout: &Layout) -> Option<Vec<Band>> {
        // Test with a single large block, since systems that overcommit memory don't refuse many small ones.
        let bytes = u64::from(width).checked_mul(u64::from(height))?.checked_mul(layout.bytes_per_pixel())?;
        Vec::<u8>::new().try_reserve_exact(usize::try_from(bytes).ok()?).ok()?;
        let rect = Rect::new((0, 0), (width, height));
        let band = |number| Band::try_new(usize::try_from(rect.band(number).area()).ok()?, layout);
        (0..height.div_ceil(BAND_ROWS) as usize).map(band).collect()
    }

    /// A film without pixels, as a source of tiles of a layout.
    pub(crate) fn empty(layout: &Arc<Layout>) -> Film {
        let (layout, bands) = (layout.clone(), Vec::new());
        Film { width: 0, height: 0, origin: (0, 0), layout, bands, invalid_samples: 0 }
    }

    /// Makes the film a region of a larger picture, with its top left pixel at (`x0`, `y0`). Tiles have positions in the whole picture;
    /// their pixels outside the film are ignored.
    #[must_use]
    pub fn at(self, x0: u32, y0: u32) -> Film {
        Film { origin: (x0, y0), ..self }
    }

    /// Position of the film's top left pixel in the whole picture.
    pub fn origin(&self) -> (u32, u32) {
        self.origin
    }

    /// Width, pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height, pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The channels; colour is the first.
    pub fn channels(&self) -> &[Channel] {
        &self.layout.channels
    }

    /// Names of the [planes](Film::planes), in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.channels().iter().flat_map(|channel| channel.names.iter().map(AsRef::as_ref))
    }

    /// The channel layout.
    pub fn layout(&self) -> &Arc<Layout> {
        &self.layout
    }

    /// Number of non-finite samples, which were discarded.
    pub fn invalid_samples(&self) -> u64 {
        self.invalid_samples
    }

    /// Number of pixels without a valid sample, because rendering was stopped or all samples were non-finite: black and transparent.
    pub fn unsampled_pixels(&self) -> u64 {
        self.counts().filter(|&n| n == 0).count() as u64
    }

    /// An empty tile for the rectangle at (`x0`, `y0`), clipped to the film.
    pub fn tile(&self, x0: u32, y0: u32, width: u32, height: u32) -> FilmTile {
        let (x0, y0) = (x0.min(self.width), y0.min(self.height));
        FilmTile::new(x0, y0, width.min(self.width - x0), height.min(self.height - y0), &self.layout)
    }

    /// Adds the part of a tile within the film. The order of tiles only matters for [`Reduction::First`].
    ///
    /// # Panics
    /// If the tile has other channels.
    pub fn merge(&mut self, tile: FilmTile) {
        let is_ours = Arc::ptr_eq(&tile.layout, &self.layout) || tile.layout == self.layout;
        assert!(is_ours, "a tile has other channels than the film");
        let rect = self.rect();
        for number in rect.overlapping_bands(tile.rect()) {
            self.bands[number].add_tile(rect.band(number), &tile);
        }
        self.invalid_samples += tile.invalid_samples;
    }

    /// Adds the part of a film of other samples of the same picture within this film. The order of films only matters for
    /// [`Reduction::First`].
    ///
    /// # Panics
    /// If the film has other channels.
    pub fn merge_film(&mut self, other: &Film) {
        assert!(other.layout == self.layout, "films have different channels");
        self.add_bands(other);
        self.invalid_samples += other.invalid_samples;
    }

    /// Sets the number of invalid samples, from `samples` per pixel and the number of valid ones.
    pub fn count_invalid(&mut self, samples: u32) {
        let all = u64::from(samples) * u64::from(self.width) * u64::from(self.height);
        let valid: u64 = self.counts().map(u64::from).sum();
        self.invalid_samples = all.saturating_sub(valid);
    }

    /// Adds the parts of another film's bands within this film.
    fn add_bands(&mut self, other: &Film) {
        let (ours, theirs) = (self.rect(), other.rect());
        // All bands have splats, or none.
        let has_splats = other.bands.iter().any(|band| band.splats.is_some());
        for (number, band) in self.bands.iter_mut().enumerate() {
            if has_splats {
                band.splats(&self.layout);
            }
            let own = ours.band(number);
            for at in theirs.overlapping_bands(own) {
                band.add_band(own, &other.bands[at], theirs.band(at), &self.layout);
            }
        }
    }

    /// The film's rectangle in the whole picture.
    pub(super) fn rect(&self) -> Rect {
        Rect::new(self.origin, (self.width, self.height))
    }

    /// Numbers of valid samples of all pixels.
    fn counts(&self) -> impl Iterator<Item = u32> {
        self.bands.iter().flat_map(|band| &band.sums.count).copied()
    }

    /// The band of a pixel, and the pixel's index within the band.
    fn band_and_index(&self, pixel: usize) -> (usize, usize) {
        let of_band = BAND_ROWS as usize * self.width as usize;
        (pixel / of_band, pixel % of_band)
    }

    /// Sums of colour and alpha of a pixel, and its number of samples.
    pub(super) fn color_of(&mut self, pixel: usize) -> (&mut [f64; 4], f64) {
        let (band, pixel) = self.band_and_index(pixel);
        let sums = &mut self.bands[band].sums;
        (&mut sums.rgba[pixel], f64::from(sums.count[pixel]))
    }

    /// Maps all pixels to values, row by row from the top.
    fn map_pixels<T: Send + Sync + Clone>(&self, of: impl Fn(&Band, usize) -> T + Sync) -> Vec<T> {
        let rows = |band: &Band| (0..band.pixels()).map(|pixel| of(band, pixel)).collect::<Vec<T>>();
        if self.bands.len() < 2 {
            return self.bands.first().map(rows).unwrap_or_default();
        }
        self.bands.par_iter().map(rows).collect::<Vec<_>>().concat()
    }

    /// Premultiplied mean colour and alpha of all pixels, row by row from the top; zero without samples.
    pub fn rgba(&self) -> Vec<[f32; 4]> {
        self.map_pixels(Band::mean)
    }

    /// Premultiplied mean colour of all pixels, row by row from the top.
    pub fn means(&self) -> Vec<[f32; 3]> {
        self.map_pixels(|band, pixel| {
            let [r, g, b, _] = band.mean(pixel);
            [r, g, b]
        })
    }

    /// Premultiplied mean colour and alpha of a pixel; zero without samples.
    pub fn mean_rgba(&self, x: u32, y: u32) -> [f32; 4] {
        let (band, pixel) = self.band_and_index(self.index(x, y));
        self.bands[band].mean(pixel)
    }

    /// Half buffers: premultiplied mean colours over the first and the second half of each pixel's samples, row by row from the top; zero
    /// without samples. They are nearly independent: half their difference estimates the error of the mean of all samples. `None`
    /// if the film has no half buffers (see [`RenderOptions::halves`](crate::render::RenderOptions::halves)).
    pub fn halves(&self) -> Option<[Vec<[f32; 3]>; 2]> {
        let of = |half: usize| self.map_pixels(|band, pixel| band.halves(pixel).0[half]);
        self.layout.has_halves().then(|| [of(0), of(1)])
    }

    /// Planes of the estimated signed error of the mean colour (red, green, blue) from the half buffers: half their difference if both
    /// have the same number of samples; NaN where one has no samples. `None` if the film has no half buffers.
    pub fn deviations(&self) -> Option<[Vec<f32>; 3]> {
        let of = |band: &Band, pixel: usize, c: usize| {
            let ([first, second], counts) = band.halves(pixel);
            let [n, m] = counts.map(f64::from);
            match n > 0.0 && m > 0.0 {
                // The mean of all is `(n a + m b) / (n + m)`, whose variance is `n m / (n + m)^2` times that of `a - b`.
                true => f64::from(first[c] - second[c]) * (n * m).sqrt() / (n + m),
                false => f64::NAN,
            }
        };
        let plane = |c| self.map_pixels(|band, pixel| of(band, pixel, c) as f32);
        self.layout.has_halves().then(|| [0, 1, 2].map(plane))
    }

    /// Mean number of valid samples per pixel.
    pub fn mean_samples(&self) -> f64 {
        let pixels = u64::from(self.width) * u64::from(self.height);
        self.counts().map(f64::from).sum::<f64>() / pixels.max(1) as f64
    }

    /// Number of valid samples of a pixel.
    pub fn samples(&self, x: u32, y: u32) -> u32 {
        let (band, pixel) = self.band_and_index(self.index(x, y));
        self.bands[band].sums.count[pixel]
    }

    /// The planes of all channels, computed lazily.
    pub fn planes(&self) -> impl Iterator<Item = Plane<'_>> {
        self.channels().iter().enumerate().flat_map(|(index, channel)| self.planes_of_channel(index, channel))
    }

    /// The planes of all channels, computed by all threads of the current pool.
    pub fn all_planes(&self) -> Vec<Plane<'_>> {
        let of = |(index, channel)| self.planes_of_channel(index, channel);
        self.channels().par_iter().enumerate().flat_map_iter(of).collect()
    }

    fn planes_of_channel<'a>(
        &self,
        index: usize,
        channel: &'a Channel,
    ) -> impl Iterator<Item = Plane<'a>> + use<'a> {
        let named = channel.names.iter().zip(self.planes_of(index, channel));
        named.map(move |(name, values)| Plane { name, pixel_type: channel.pixel_type, values })
    }

    /// The values of a plane by its name in files, such as `R` or `albedo.G`; `None` if there is none of that name.
    pub fn plane(&self, name: &str) -> Option<Values> {
        let has = |channel: &Channel| channel.names.iter().position(|own| own == name);
        let mut matches = self.channels().iter().enumerate().filter_map(|(i, c)| Some((i, c, has(c)?)));
        let (index, channel, component) = matches.next()?;
        self.planes_of(index, channel).into_iter().nth(component)
    }

    fn planes_of(&self, index: usize, channel: &Channel) -> Vec<Values> {
        if index == 0 {
            let rgba = self.rgba();
            return [0, 1, 2, 3].map(|c| Values::Float(rgba.iter().map(|pixel| pixel[c]).collect())).into();
        }
        let layer = self.layer_of(index);
        let mut bands = self.bands.iter().map(|band| band.planes(index, channel, layer));
        let mut planes = bands.next().unwrap_or_else(|| vec![Values::empty(channel); channel.names.len()]);
        for more in bands {
            planes.iter_mut().zip(more).for_each(|(plane, values)| plane.append(values));
        }
        planes
    }

    /// The values of the planes of an AOV; `None` if the film doesn't have it.
    pub fn aov(&self, aov: Aov) -> Option<Vec<Values>> {
        self.components(aov.info().names)
    }

    /// The values of several planes of one channel by their names in files; `None` if the film doesn't have them.
    pub fn components(&self, names: &[&str]) -> Option<Vec<Values>> {
        let first = names.first()?;
        let mut channels = self.channels().iter().enumerate();
        let (index, channel) = channels.find(|(_, channel)| channel.names.iter().any(|own| own == first))?;
        let position = |name: &&str| channel.names.iter().position(|own| own == name);
        let positions = names.iter().map(position).collect::<Option<Vec<usize>>>()?;
        let mut planes: Vec<Option<Values>> = self.planes_of(index, channel).into_iter().map(Some).collect();
        positions.into_iter().map(|position| planes[position].take()).collect()
    }

    /// Composites each pixel over a colour by pixel position; all pixels with samples become opaque.
    pub fn composite_over_color(&mut self, color: impl Fn(u32, u32) -> [f32; 3]) {
        for y in 0..self.height {
            for x in 0..self.width {
                let pixel = self.index(x, y);
                let (sum, count) = self.color_of(pixel);
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

// Changes of finished films.

impl Film {
    /// Extracts a pixel as a film of one pixel.
    ///
    /// # Errors
    /// As for [`Film::try_new`].
    ///
    /// # Panics
    /// If the pixel is outside the film.
    pub fn pixel(&self, x: u32, y: u32) -> Result<Film> {
        self.index(x, y);
        let layout = Layout::new(self.channels().iter().skip(1).cloned()).with_halves(self.layout.has_halves);
        let mut film = Film::of_layout(1, 1, layout)?;
        film = film.at(self.origin.0 + x, self.origin.1 + y);
        film.add_bands(self);
        Ok(film)
    }

    /// Replaces the mean colours, given as planes. Alpha and numbers of samples are unchanged.
    ///
    /// # Panics
    /// If there are fewer values than pixels.
    pub fn set_color(&mut self, color: [&[f32]; 3]) {
        let mut from = 0;
        for band in &mut self.bands {
            band.sums.set_color(color.map(|values| &values[from..]));
            band.splats.iter_mut().for_each(Splats::clear_color);
            from += band.pixels();
        }
    }

    /// Replaces the values of a channel with [`Reduction::Mean`], given by the name of its first component. Does nothing if there is none.
    ///
    /// # Panics
    /// If there are fewer values than pixels.
    pub fn set_means(&mut self, first: &str, values: [&[f32]; 3]) {
        let index =
            self.channels().iter().position(|c| c.names[0] == first && c.reduction == Reduction::Mean);
        let Some(index) = index.filter(|index| *index > 0) else { return };
        let (layer, mut from) = (self.layer_of(index), 0);
        for band in &mut self.bands {
            let pixels = band.pixels();
            band.sums.set_means(index - 1, values.map(|values| &values[from..]));
            if let Some(of_layer) = band.splats.as_mut().and_then(|splats| splats.layers.get_mut(layer)) {
                *of_layer = Splats::list(pixels);
            }
            from += pixels;
        }
    }

    /// Removes AOVs, such as those that only denoising needed.
    pub fn remove_aovs(&mut self, aovs: impl IntoIterator<Item = Aov>) {
        self.remove_channels(aovs.into_iter().map(|aov| aov.info().names[0]));
    }

    /// Removes channels by the names of their first components.
    pub(super) fn remove_channels<'a>(&mut self, first_names: impl IntoIterator<Item = &'a str>) {
        for name in first_names {
            let Some(index) = self.channels().iter().position(|c| c.names[0] == name) else { continue };
            let layer = self.layer_of(index);
            let removed = &self.layout.channels[index];
            let (is_layer, is_variance) =
                (removed.source == Source::PartOfColor, removed.reduction == Reduction::VarianceOfMean);
            let mut channels = self.channels().to_vec();
            channels.remove(index);
            let has_halves = self.layout.has_halves;
            self.layout = Arc::new(Layout::new(channels.into_iter().skip(1)).with_halves(has_halves));
            for band in &mut self.bands {
                match &mut band.splats {
                    Some(splats) if is_layer => drop(splats.layers.remove(layer)),
                    Some(splats) if is_variance => splats.squares = None,
                    _ => {}
                }
                band.sums.remove(index - 1);
                if !self.layout.has_first_hits {
                    band.sums.remove_hit_counts();
                }
            }
        }
    }
}

// Splats.

impl Film {
    /// Adds splats, in any order. Splats outside the film are skipped, non-finite ones as well, which count as invalid samples.
    /// [`Film::count_splats`] adds the number of their samples.
    ///
    /// # Panics
    /// If memory runs out.
    pub fn add_splats(&mut self, splats: &[Splat], is_of_first_half: bool) {
        let rect = self.rect();
        for splat in splats {
            for number in rect.overlapping_bands(Rect::new((splat.x, splat.y), (1, 1))) {
                let one = std::slice::from_ref(splat);
                let band = &mut self.bands[number];
                self.invalid_samples +=
                    band.add_splats(rect.band(number), one, is_of_first_half, &self.layout);
            }
        }
    }

    /// Adds to the number of samples per pixel over which splats are averaged.
    pub fn count_splats(&mut self, samples: u32, is_of_first_half: bool) {
        for band in &mut self.bands {
            band.splats(&self.layout).count(samples, is_of_first_half);
        }
    }

    /// The index of a channel among those with the source [`Source::PartOfColor`].
    fn layer_of(&self, index: usize) -> usize {
        self.channels()[..index].iter().filter(|channel| channel.source == Source::PartOfColor).count()
    }
}

// Backdrops.

impl Film {
    /// Composites the picture over a scene's backdrop; images are centred and scaled to cover the picture.
    pub fn composite_over(&mut self, backdrop: &Backdrop) {
        match backdrop {
            Backdrop::Color(color) => self.composite_over_color(|_, _| *color),
            Backdrop::Picture(image) => {
                let (width, height) = (self.width(), self.height());
                let scale = (f64::from(image.width) / f64::from(width))
                    .min(f64::from(image.height) / f64::from(height));
                self.composite_over_color(|x, y| {
                    let position = |pixel: u32, size: u32, image_size: u32| {
                        let from_center = f64::from(pixel) + 0.5 - f64::from(size) / 2.0;
                        f64::from(image_size) / 2.0 + scale * from_center
                    };
                    bilinear(image, position(x, width, image.width), position(y, height, image.height))
                });
            }
        }
    }
}

/// Bilinear lookup of an image at a position in pixels from the top left corner, clamped to the border.
fn bilinear(image: &Image, x: f64, y: f64) -> [f32; 3] {
    let low = |v: f64, size: u32| (v - 0.5).clamp(0.0, f64::from(size - 1));
    let (x, y) = (low(x, image.width), low(y, image.height));
    let (x0, y0) = (x as u32, y as u32);
    let (x1, y1) = ((x0 + 1).min(image.width - 1), (y0 + 1).min(image.height - 1));
    let (u, v) = (x.fract() as f32, y.fract() as f32);
    let [a, b, c, d] = [(x0, y0), (x1, y0), (x0, y1), (x1, y1)].map(|(x, y)| image.rgba(x, y));
    std::array::from_fn(|k| (a[k] * (1.0 - u) + b[k] * u) * (1.0 - v) + (c[k] * (1.0 - u) + d[k] * u) * v)
}

/// Channels of shadow catchers: W, which becomes the layer of factors W / O, then O and c, which [`Film::resolve_catchers`] removes.
const LAYER: [&str; 3] = ["ShadowCatcher.R", "ShadowCatcher.G", "ShadowCatcher.B"];
const WITHOUT: [&str; 3] = ["catcher_without.R", "catcher_without.G", "catcher_without.B"];
const SHARE: [&str; 1] = ["catcher_share.V"];

/// Number of parts of a sample for shadow catchers: radiance with the scene, radiance without, and whether a catcher was hit.
pub const CATCHER_PARTS: usize = 3;

/// Radiance below which ratios count as undefined.
const DARK: f32 = 1e-12;

impl Channel {
    /// The additional channels of scenes with shadow catchers.
    pub fn of_catchers() -> [Channel; CATCHER_PARTS] {
        [&LAYER[..], &WITHOUT, &SHARE].map(|names| Channel {
            names: names.iter().map(|&name| Cow::Borrowed(name)).collect(),
            pixel_type: PixelType::Half,
            source: Source::PartOfColor,
            reduction: Reduction::Mean,
        })
    }
}

impl Film {
    /// Converts the radiance of shadow catchers to colour and alpha, and to the layer of factors. Does nothing without catchers or if
    /// done before.
    pub fn resolve_catchers(&mut self, output: CatcherOutput) {
        let plane = |name: &str| self.plane(name).map(Values::into_floats);
        let Some(share) = plane(SHARE[0]) else { return };
        let of = |names: [&str; 3]| names.map(|name| plane(name).unwrap_or_default());
        let (with, without) = (of(LAYER), of(WITHOUT));
        let mut factors = [(); 3].map(|()| Vec::with_capacity(share.len()));
        for (pixel, &share) in share.iter().enumerate() {
            let (with, without) = ([0, 1, 2].map(|c| with[c][pixel]), [0, 1, 2].map(|c| without[c][pixel]));
            let ratio = |c: usize| if without[c] > DARK { with[c] / without[c] } else { 1.0 };
            let least = match output {
                CatcherOutput::All => (0..3).map(ratio).fold(1.0, f32::min).max(0.0),
                CatcherOutput::Shadows => ((0..3).map(ratio).sum::<f32>() / 3.0).clamp(0.0, 1.0),
            };
            let (sum, count) = self.color_of(pixel);
            for c in 0..3 {
                let subtracted = match output {
                    CatcherOutput::All => least * without[c],
                    CatcherOutput::Shadows => with[c],
                };
                let rest = sum[c] / count.max(1.0) - f64::from(subtracted);
                // Zero up to rounding.
                let is_zero = rest.abs() <= f64::from(1e-6 * subtracted.max(without[c]));
                sum[c] = if is_zero { 0.0 } else { rest * count };
                factors[c].push(1.0 + share * (ratio(c) - 1.0));
            }
            sum[3] += f64::from((1.0 - least) * share) * count;
        }
        self.set_means(LAYER[0], [&factors[0], &factors[1], &factors[2]]);
        self.remove_channels([WITHOUT[0], SHARE[0]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::FilmTile;

    /// Two pixels of two samples each; one sample of the first pixel hits a catcher.
    fn film(with: [f32; 3], without: [f32; 3]) -> Film {
        let mut film = Film::try_new(2, 1, Channel::of_catchers()).expect("there is memory");
        let mut tile: FilmTile = film.tile(0, 0, 2, 1);
        let none = [[0.0; 3]; 3];
        tile.add_with_parts(0, with, 0.0, None, &[with, without, [1.0; 3]], false);
        for (pixel, rgb) in [(0, [0.5; 3]), (1, [0.25; 3]), (1, [0.25; 3])] {
            tile.add_with_parts(pixel, rgb, 1.0, None, &none, false);
        }
        film.merge(tile);
        film
    }

    #[test]
    fn compositing_over_the_plate_equals_an_ordinary_object() {
        for (with, without) in [
            ([0.2, 0.2, 0.2], [0.4, 0.4, 0.4]),
            ([0.2, 0.5, 0.3], [0.4, 0.4, 0.4]),
            ([0.5, 0.5, 0.6], [0.4, 0.4, 0.4]),
            ([0.4, 0.4, 0.4], [0.4, 0.4, 0.4]),
            ([0.0, 0.0, 0.0], [0.4, 0.4, 0.4]),
            ([0.1, 0.2, 0.3], [0.0, 0.0, 0.0]),
        ] {
            let mut film = film(with, without);
            film.resolve_catchers(CatcherOutput::All);
            let [r, g, b, alpha] = film.mean_rgba(0, 0);
            for c in 0..3 {
                let whole = [r, g, b][c] + (1.0 - alpha) * without[c];
                let truth = 0.5 * with[c] + 0.5 * 0.5;
                assert!((whole - truth).abs() < 1e-6, "{with:?} of {without:?}: {whole}, not {truth}");
                assert!([r, g, b][c] >= 0.25 - 1e-6, "{with:?} of {without:?}: {r} {g} {b} {alpha}");
            }
            assert_eq!(film.mean_rgba(1, 0), [0.25, 0.25, 0.25, 1.0]);
            assert_eq!(film.channels().len(), 2);
        }
    }

    #[test]
    fn grey_shadows_have_only_alpha() {
        let mut film = film([0.1; 3], [0.4; 3]);
        film.resolve_catchers(CatcherOutput::All);
        let [r, g, b, alpha] = film.mean_rgba(0, 0);
        assert!([r, g, b].iter().all(|v| (v - 0.25).abs() < 1e-6) && (alpha - 0.5 - 0.375).abs() < 1e-6);
        let factor = film.plane("ShadowCatcher.R").expect("the layer").into_floats();
        assert!((factor[0] - (0.5 + 0.5 * 0.25)).abs() < 1e-6 && factor[1] == 1.0);
        let before = film.rgba();
        film.resolve_catchers(CatcherOutput::All);
        assert_eq!(film.rgba(), before);
    }

    /// The catcher covers half of the pixel; the other half is unchanged.
    #[test]
    fn alpha_of_shadow_output_is_the_mean_of_the_channels() {
        for (with, without, alpha) in [
            ([0.1, 0.2, 0.3], [0.4, 0.4, 0.4], 0.5),
            ([0.4, 0.2, 0.9], [0.4, 0.4, 0.4], 0.0),
            ([0.0, 0.2, 0.5], [0.4, 0.4, 0.5], 0.5),
            ([0.1, 0.1, 0.1], [0.2, 0.1, 0.0], 1.0 / 6.0),
        ] {
            let mut film = film(with, without);
            film.resolve_catchers(CatcherOutput::Shadows);
            let [r, g, b, a] = film.mean_rgba(0, 0);
            let is_rest = [r, g, b].iter().all(|v| (v - 0.25).abs() < 1e-6);
            assert!(
                is_rest && (a - 0.5 - 0.5 * alpha).abs() < 1e-6,
                "{with:?} of {without:?}: {r} {g} {b} {a}"
            );
        }
    }
}
