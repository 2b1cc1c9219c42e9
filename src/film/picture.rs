//! A film: its channels for every pixel, in bands of rows.
//!
//! # Shadow catchers
//! Objects of which only the effects of other objects are visible: their shadows and reflections.
//!
//! For samples whose camera rays hit a catcher first, the film stores as means over all samples of the pixel: their
//! radiance W with the whole scene, their radiance O with nothing but catchers and lights, and their share c. The colour of
//! these samples becomes, channel by channel,
//!
//! ```text
//! rgb = W - (1 - a) O,    alpha = a c,    with a = 1 - min(1, least of W / O over the channels).
//! ```
//!
//! Composited over a plate P, the result is rgb + (c - alpha) P, where the plate replaces O / c. For P = O / c it is W, the radiance of
//! the catcher as an ordinary object, for every a, so that the ratio of two estimates causes no bias. With this a, rgb is never
//! negative, a grey shadow has no rgb and darkens any plate by its factor, and additional light is added. The factors W / O, by which
//! each channel of a plate may be multiplied, are a layer of their own, as in Cycles ("shadow catcher" pass).
//!
//! Cycles' combined picture has alpha only, a = 1 - min(1, mean of W / O over the channels), and no rgb, so that coloured shadows are
//! grey, and additional light is lost ([`CatcherOutput::Shadows`]).

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

/// A picture being made: a list of channels, the first of which is colour, for every pixel, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    width: u32,
    height: u32,
    /// Position of its first pixel in the whole picture.
    origin: (u32, u32),
    pub(super) layout: Arc<Layout>,
    /// Rows, [`BAND_ROWS`] in each but the last.
    pub(super) bands: Vec<Band>,
    pub(super) invalid_samples: u64,
}

/// One component of a channel for all pixels: a channel of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane<'a> {
    /// Its name: `R`, `Z`, `albedo.G`.
    pub name: &'a str,
    /// Type of its values in files.
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
    /// Fails with a usage error that states the memory needed where there is not enough.
    pub fn try_new(width: u32, height: u32, further: impl IntoIterator<Item = Channel>) -> Result<Film> {
        Film::of_layout(width, height, Layout::new(further))
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

    /// Its bands; `None` if memory runs out.
    fn try_bands((width, height): (u32, u32), layout: &Layout) -> Option<Vec<Band>> {
        // Systems refuse a large block that would not fit, but may promise many small ones.
        let bytes = u64::from(width).checked_mul(u64::from(height))?.checked_mul(layout.bytes_per_pixel())?;
        Vec::<u8>::new().try_reserve_exact(usize::try_from(bytes).ok()?).ok()?;
        let place = Rect::new((0, 0), (width, height));
        let band = |number| Band::try_new(usize::try_from(place.band(number).area()).ok()?, layout);
        (0..height.div_ceil(BAND_ROWS) as usize).map(band).collect()
    }

    /// A film without pixels, for tiles of this layout.
    pub(crate) fn empty(layout: &Arc<Layout>) -> Film {
        let (layout, bands) = (layout.clone(), Vec::new());
        Film { width: 0, height: 0, origin: (0, 0), layout, bands, invalid_samples: 0 }
    }

    /// This film as a part of a larger picture, whose first pixel is at (`x0`, `y0`). Tiles have positions in the whole picture; their
    /// pixels outside the film are ignored.
    #[must_use]
    pub fn at(self, x0: u32, y0: u32) -> Film {
        Film { origin: (x0, y0), ..self }
    }

    /// Position of its first pixel in the whole picture.
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

    /// Its channels; colour comes first.
    pub fn channels(&self) -> &[Channel] {
        &self.layout.channels
    }

    /// Names of [planes](Film::planes), in their order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.channels().iter().flat_map(|channel| channel.names.iter().map(AsRef::as_ref))
    }

    /// The layout of its tiles.
    pub fn layout(&self) -> &Arc<Layout> {
        &self.layout
    }

    /// Samples that were NaN or infinite and therefore left out of their pixels.
    pub fn invalid_samples(&self) -> u64 {
        self.invalid_samples
    }

    /// Pixels without a valid sample: black and transparent, because rendering stopped before or all samples were NaN.
    pub fn unsampled_pixels(&self) -> u64 {
        self.counts().filter(|&n| n == 0).count() as u64
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
        let place = self.rect();
        for number in place.overlapping_bands(tile.rect()) {
            self.bands[number].add_tile(place.band(number), &tile);
        }
        self.invalid_samples += tile.invalid_samples;
    }

    /// Adds a film of the same picture with samples of its own, as far as it is within this one. Films may be added in any
    /// order, but for channels that show first samples.
    ///
    /// # Panics
    /// If it has other channels.
    pub fn merge_film(&mut self, other: &Film) {
        assert!(other.layout == self.layout, "films have different channels");
        self.add_bands(other);
        self.invalid_samples += other.invalid_samples;
    }

    /// Counts the samples that were left out, by pixel.
    pub fn count_invalid(&mut self, samples: u32) {
        let all = u64::from(samples) * u64::from(self.width) * u64::from(self.height);
        let valid: u64 = self.counts().map(u64::from).sum();
        self.invalid_samples = all.saturating_sub(valid);
    }

    /// Adds the bands of another film, as far as they lie within this one.
    fn add_bands(&mut self, other: &Film) {
        let (place, theirs) = (self.rect(), other.rect());
        // All bands have splats, or none.
        let has_splats = other.bands.iter().any(|band| band.splats.is_some());
        for (number, band) in self.bands.iter_mut().enumerate() {
            if has_splats {
                band.splats(&self.layout);
            }
            let own = place.band(number);
            for at in theirs.overlapping_bands(own) {
                band.add_band(own, &other.bands[at], theirs.band(at), &self.layout);
            }
        }
    }

    /// Its rectangle in the picture.
    pub(super) fn rect(&self) -> Rect {
        Rect::new(self.origin, (self.width, self.height))
    }

    /// Valid samples of each pixel.
    fn counts(&self) -> impl Iterator<Item = u32> {
        self.bands.iter().flat_map(|band| &band.sums.count).copied()
    }

    /// The band of a pixel, and its index there.
    fn band_and_index(&self, pixel: usize) -> (usize, usize) {
        let of_band = BAND_ROWS as usize * self.width as usize;
        (pixel / of_band, pixel % of_band)
    }

    /// Sums of colour and alpha of a pixel, and how many samples it has.
    pub(super) fn color_of(&mut self, pixel: usize) -> (&mut [f64; 4], f64) {
        let (band, pixel) = self.band_and_index(pixel);
        let sums = &mut self.bands[band].sums;
        (&mut sums.rgba[pixel], f64::from(sums.count[pixel]))
    }

    /// A value of each pixel, row by row from the top.
    fn of_pixels<T: Send + Sync + Clone>(&self, of: impl Fn(&Band, usize) -> T + Sync) -> Vec<T> {
        let rows = |band: &Band| (0..band.pixels()).map(|pixel| of(band, pixel)).collect::<Vec<T>>();
        if self.bands.len() < 2 {
            return self.bands.first().map(rows).unwrap_or_default();
        }
        self.bands.par_iter().map(rows).collect::<Vec<_>>().concat()
    }

    /// Mean colour and alpha of all pixels, premultiplied, row by row from the top; zero where there are no samples yet.
    pub fn rgba(&self) -> Vec<[f32; 4]> {
        self.of_pixels(Band::mean)
    }

    /// Mean colour of all pixels, premultiplied.
    pub fn means(&self) -> Vec<[f32; 3]> {
        self.of_pixels(|band, pixel| {
            let [r, g, b, _] = band.mean(pixel);
            [r, g, b]
        })
    }

    /// Mean colour and alpha of a pixel, premultiplied; zero where there are no samples yet.
    pub fn mean_rgba(&self, x: u32, y: u32) -> [f32; 4] {
        let (band, pixel) = self.band_and_index(self.index(x, y));
        self.bands[band].mean(pixel)
    }

    /// Mean colour, premultiplied, of the first half of each pixel's samples and of the second one, row by row from the top;
    /// zero where a half has no sample. The halves are nearly independent: half the difference of their means estimates the
    /// error of the mean of all. `None` unless the film keeps them apart (see
    /// [`RenderOptions::halves`](crate::render::RenderOptions::halves)).
    pub fn halves(&self) -> Option<[Vec<[f32; 3]>; 2]> {
        let of = |half: usize| self.of_pixels(|band, pixel| band.halves(pixel).0[half]);
        self.layout.has_halves().then(|| [of(0), of(1)])
    }

    /// Estimated signed error of each pixel's mean colour (red, green, blue) from its halves: half the difference of their means if they
    /// have the same number of samples. NaN where a half has no samples. `None` unless the film keeps halves apart.
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
        let plane = |c| self.of_pixels(|band, pixel| of(band, pixel, c) as f32);
        self.layout.has_halves().then(|| [0, 1, 2].map(plane))
    }

    /// Valid samples that pixels have on average.
    pub fn mean_samples(&self) -> f64 {
        let pixels = u64::from(self.width) * u64::from(self.height);
        self.counts().map(f64::from).sum::<f64>() / pixels.max(1) as f64
    }

    /// Valid samples that a pixel has.
    pub fn samples(&self, x: u32, y: u32) -> u32 {
        let (band, pixel) = self.band_and_index(self.index(x, y));
        self.bands[band].sums.count[pixel]
    }

    /// All components of all channels, computed lazily.
    pub fn planes(&self) -> impl Iterator<Item = Plane<'_>> {
        self.channels().iter().enumerate().flat_map(|(index, channel)| self.planes_of_channel(index, channel))
    }

    /// All planes at once, on all threads of the current pool.
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

    /// The components of an AOV, row by row from the top. `None` if the film doesn't have it.
    pub fn aov(&self, aov: Aov) -> Option<Vec<Values>> {
        self.components(aov.info().names)
    }

    /// Several components of one channel by their names in files, each row by row from the top. `None` if the film doesn't have them.
    pub fn components(&self, names: &[&str]) -> Option<Vec<Values>> {
        let first = names.first()?;
        let mut channels = self.channels().iter().enumerate();
        let (index, channel) = channels.find(|(_, channel)| channel.names.iter().any(|own| own == first))?;
        let place = |name: &&str| channel.names.iter().position(|own| own == name);
        let places = names.iter().map(place).collect::<Option<Vec<usize>>>()?;
        let mut planes: Vec<Option<Values>> = self.planes_of(index, channel).into_iter().map(Some).collect();
        places.into_iter().map(|place| planes[place].take()).collect()
    }

    /// Composites each pixel over a colour; all pixels with samples become opaque.
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

// Changes of finished films: denoised values replace rendered ones, and single pixels are extracted.

impl Film {
    /// One pixel as a film of its own.
    ///
    /// # Errors
    /// As for [`Film::try_new`].
    ///
    /// # Panics
    /// If it is outside the film.
    pub fn pixel(&self, x: u32, y: u32) -> Result<Film> {
        self.index(x, y);
        let layout = Layout::new(self.channels().iter().skip(1).cloned()).with_halves(self.layout.has_halves);
        let mut film = Film::of_layout(1, 1, layout)?;
        film = film.at(self.origin.0 + x, self.origin.1 + y);
        film.add_bands(self);
        Ok(film)
    }

    /// Replaces the mean colours, rows from the top. Alpha and numbers of samples are unchanged.
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

    /// Replaces the values of a channel of means over all samples, given by the name of its first component. Does nothing without such
    /// a channel.
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

    /// Removes AOVs that only denoising needed.
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
    /// Adds splats, in any order. Those outside the film are left out; those that are not finite, too, and counted as invalid
    /// samples. [`Film::count_splats`] adds the number of samples that they belong to.
    ///
    /// # Panics
    /// If there is no memory for them.
    pub fn add_splats(&mut self, splats: &[Splat], is_of_first_half: bool) {
        let place = self.rect();
        for splat in splats {
            for number in place.overlapping_bands(Rect::new((splat.x, splat.y), (1, 1))) {
                let one = std::slice::from_ref(splat);
                let band = &mut self.bands[number];
                self.invalid_samples +=
                    band.add_splats(place.band(number), one, is_of_first_half, &self.layout);
            }
        }
    }

    /// Counts samples of each pixel all splats of which were added.
    pub fn count_splats(&mut self, samples: u32, is_of_first_half: bool) {
        for band in &mut self.bands {
            band.splats(&self.layout).count(samples, is_of_first_half);
        }
    }

    /// The index of a channel among those whose source is a part of colour.
    fn layer_of(&self, index: usize) -> usize {
        self.channels()[..index].iter().filter(|channel| channel.source == Source::PartOfColor).count()
    }
}

// Backgrounds behind transparent pixels.

impl Film {
    /// Composites the picture over a scene's backdrop.
    pub fn composite_over(&mut self, backdrop: &Backdrop) {
        match backdrop {
            Backdrop::Color(color) => self.composite_over_color(|_, _| *color),
            Backdrop::Picture(image) => {
                let (width, height) = (self.width(), self.height());
                let scale = (f64::from(image.width) / f64::from(width))
                    .min(f64::from(image.height) / f64::from(height));
                self.composite_over_color(|x, y| {
                    let place = |p: u32, own: u32, of: u32| {
                        let from_middle = f64::from(p) + 0.5 - f64::from(own) / 2.0;
                        f64::from(of) / 2.0 + scale * from_middle
                    };
                    bilinear(image, place(x, width, image.width), place(y, height, image.height))
                });
            }
        }
    }
}

/// Bilinear lookup of an image at a position in pixels from its corner.
fn bilinear(image: &Image, x: f64, y: f64) -> [f32; 3] {
    let low = |v: f64, size: u32| (v - 0.5).clamp(0.0, f64::from(size - 1));
    let (x, y) = (low(x, image.width), low(y, image.height));
    let (x0, y0) = (x as u32, y as u32);
    let (x1, y1) = ((x0 + 1).min(image.width - 1), (y0 + 1).min(image.height - 1));
    let (u, v) = (x.fract() as f32, y.fract() as f32);
    let [a, b, c, d] = [(x0, y0), (x1, y0), (x0, y1), (x1, y1)].map(|(x, y)| image.rgba(x, y));
    std::array::from_fn(|k| (a[k] * (1.0 - u) + b[k] * u) * (1.0 - v) + (c[k] * (1.0 - u) + d[k] * u) * v)
}

/// Names of the layer of factors, and of the channels that [`Film::resolve_catchers`] removes.
const LAYER: [&str; 3] = ["ShadowCatcher.R", "ShadowCatcher.G", "ShadowCatcher.B"];
const WITHOUT: [&str; 3] = ["catcher_without.R", "catcher_without.G", "catcher_without.B"];
const SHARE: [&str; 1] = ["catcher_share.V"];

/// Number of parts of a sample for shadow catchers: radiance with the scene, radiance without it, and whether it hit a catcher.
pub const CATCHER_PARTS: usize = 3;

/// Radiance below this counts as zero: a ratio to it is undefined.
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
    /// Converts the radiance on shadow catchers into colour and alpha, and into the layer of factors. Does nothing without
    /// catchers, and the second time.
    pub fn resolve_catchers(&mut self, caught: CatcherOutput) {
        let plane = |name: &str| self.plane(name).map(Values::into_floats);
        let Some(share) = plane(SHARE[0]) else { return };
        let of = |names: [&str; 3]| names.map(|name| plane(name).unwrap_or_default());
        let (with, without) = (of(LAYER), of(WITHOUT));
        let mut factors = [(); 3].map(|()| Vec::with_capacity(share.len()));
        for (pixel, &share) in share.iter().enumerate() {
            let (with, without) = ([0, 1, 2].map(|c| with[c][pixel]), [0, 1, 2].map(|c| without[c][pixel]));
            let ratio = |c: usize| if without[c] > DARK { with[c] / without[c] } else { 1.0 };
            let least = match caught {
                CatcherOutput::All => (0..3).map(ratio).fold(1.0, f32::min).max(0.0),
                CatcherOutput::Shadows => ((0..3).map(ratio).sum::<f32>() / 3.0).clamp(0.0, 1.0),
            };
            let (sum, count) = self.color_of(pixel);
            for c in 0..3 {
                let subtracted = match caught {
                    CatcherOutput::All => least * without[c],
                    CatcherOutput::Shadows => with[c],
                };
                let left = sum[c] / count.max(1.0) - f64::from(subtracted);
                // Zero up to rounding.
                let is_zero = left.abs() <= f64::from(1e-6 * subtracted.max(without[c]));
                sum[c] = if is_zero { 0.0 } else { left * count };
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

    /// Two pixels of two samples each: the first sees a catcher by one of them.
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
    fn laid_over_the_plate_it_shows_what_the_catcher_would() {
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
    fn grey_shadows_are_alpha_alone() {
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

    /// Half of the pixel is the catcher; the rest of it stays.
    #[test]
    fn shadows_alone_are_the_mean_of_the_channels() {
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
