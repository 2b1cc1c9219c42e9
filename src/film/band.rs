//! The bands of a film: some rows each, to which threads add without meeting those that add to others.
//!
//! Each band of a shared film has its own lock, which is hardly ever contended: tiles that are traced at the same time lie in different bands, as
//! tiles are ordered column by column. Where passes overlap, a tile of a later pass waits in its bands until the earlier
//! one is complete there, so that each pixel gets its samples in one order.

use super::channel::{Accumulator, Channel, Counts, Kept, Layout, Reduction, Source, Values, reciprocal};
use super::exact_sum::{HalfSum, add_exact, on_grid};
use super::picture::Film;
use super::splats::{Splat, Splats};
use super::tile::{FilmTile, Rect, TileSums};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

/// Some rows of a film: all that is kept of their pixels.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Band {
    pub sums: Sums,
    /// Light from paths of lamps, once there is some.
    pub splats: Option<Splats>,
}

impl Band {
    /// Without samples; `None` if the memory isn't there.
    pub fn try_new(pixels: usize, layout: &Layout) -> Option<Band> {
        Some(Band { sums: Sums::try_new(pixels, layout)?, splats: None })
    }

    pub fn pixels(&self) -> usize {
        self.sums.count.len()
    }

    /// The sums of splats, from now on there.
    pub fn splats(&mut self, layout: &Layout) -> &mut Splats {
        self.splats.get_or_insert_with(|| Splats::new(self.sums.count.len(), layout))
    }

    /// Adds what of a tile is within the band, which stands at a place of the picture.
    pub fn add_tile(&mut self, own: Rect, tile: &FilmTile) {
        for (at, from, length) in own.rows_of(tile.place()) {
            self.sums.add_tile_row(at, &tile.sums, from, length, &tile.layout);
        }
    }

    /// Adds what of another band is within this one.
    pub fn add_band(&mut self, own: Rect, other: &Band, place: Rect, layout: &Layout) {
        for (at, from, length) in own.rows_of(place) {
            self.sums.add_row(at, &other.sums, from, length, layout);
            if let Some(theirs) = &other.splats {
                let ours = self.splats(layout);
                (0..length).for_each(|i| ours.merge(at + i, theirs, from + i));
            }
        }
    }

    /// Adds splats. Those outside the band are left out; gives the number of those that are not finite and left out, too.
    pub fn add_splats(
        &mut self,
        own: Rect,
        splats: &[Splat],
        is_of_first_half: bool,
        layout: &Layout,
    ) -> u64 {
        let (width, height) = (own.width(), own.height());
        let sums = self.splats(layout);
        let mut invalid = 0;
        for splat in splats {
            let (x, y) = (splat.x.wrapping_sub(own.x0), splat.y.wrapping_sub(own.y0));
            if x < width && y < height {
                let pixel = y as usize * width as usize + x as usize;
                invalid += u64::from(!sums.add(pixel, splat, is_of_first_half));
            }
        }
        invalid
    }

    /// Mean colour and alpha of a pixel, premultiplied; zero where there are no samples yet.
    pub fn mean(&self, pixel: usize) -> [f32; 4] {
        let of_splats = self.splats.as_ref().map_or([0.0; 3], |splats| splats.mean(pixel));
        self.sums.mean_rgba_with(pixel, of_splats)
    }

    /// The means of a pixel's halves, and of how many samples they are.
    pub fn halves(&self, pixel: usize) -> ([[f32; 3]; 2], [u32; 2]) {
        let (means, counts) = self.sums.halves(pixel);
        let splats = self.splats.as_ref().map_or([[0.0; 3]; 2], |splats| splats.halves(pixel));
        let with = |half: usize, c: usize| (f64::from(means[half][c]) + splats[half][c]) as f32;
        ([0, 1].map(|half| [0, 1, 2].map(|c| with(half, c))), counts)
    }

    /// The values of a channel beyond colour, which is this one of the layers if it is one.
    pub fn planes(&self, index: usize, channel: &Channel, layer: usize) -> Vec<Values> {
        let mut planes = self.sums.planes(index, channel);
        let Some(splats) = &self.splats else { return planes };
        if channel.source == Source::PartOfColor {
            splats.means_of_layer(layer).into_iter().for_each(|means| add(&mut planes, means));
        } else if channel.reduction == Reduction::VarianceOfMean {
            splats.variances().into_iter().for_each(|variances| add(&mut planes, variances));
        }
        planes
    }
}

/// Adds values to those of planes, as many a pixel as there are planes.
fn add(planes: &mut [Values], values: impl Iterator<Item = [f64; 3]>) {
    for (pixel, values) in values.enumerate() {
        for (plane, value) in planes.iter_mut().zip(values) {
            if let Values::Float(plane) = plane {
                plane[pixel] = (f64::from(plane[pixel]) + value) as f32;
            }
        }
    }
}

// Exact sums of everything that samples bring to some rows of a film.

/// Sums and counts, one entry a pixel. Those of tiles are [`TileSums`].
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sums {
    /// Red, green, blue, alpha.
    pub rgba: Vec<[f64; 4]>,
    /// What the sums of red, green and blue leave out.
    pub(super) rgb_low: Vec<[f32; 3]>,
    /// Samples of each pixel.
    pub count: Vec<u32>,
    /// Samples that hit something, by pixel; empty where no channel asks for it.
    pub(super) hits: Vec<u32>,
    /// One for each channel beyond colour.
    pub(super) further: Vec<Accumulator>,
    /// Empty where halves are not kept apart.
    pub(super) first_half: Vec<HalfSum>,
}

impl Sums {
    /// Empty sums; `None` if the memory isn't there.
    pub fn try_new(pixels: usize, layout: &Layout) -> Option<Sums> {
        let counts = |pixels| bytemuck::try_zeroed_vec(pixels).ok();
        let further = layout.further().iter().map(|channel| Accumulator::try_new(channel, pixels, true));
        let halves = if layout.has_halves { pixels } else { 0 };
        Some(Sums {
            rgba: bytemuck::try_zeroed_vec(pixels).ok()?,
            rgb_low: bytemuck::try_zeroed_vec(pixels).ok()?,
            count: counts(pixels)?,
            hits: counts(if layout.has_first_hits { pixels } else { 0 })?,
            further: further.collect::<Option<_>>()?,
            first_half: bytemuck::try_zeroed_vec(halves).ok()?,
        })
    }

    /// Mean colour of the first and of the second half of a pixel's samples, zero where there are none; and how many each has.
    pub fn halves(&self, pixel: usize) -> ([[f32; 3]; 2], [u32; 2]) {
        let HalfSum { rgb, count, .. } = self.first_half[pixel];
        let all = &self.rgba[pixel];
        let counts = [count, self.count[pixel].saturating_sub(count)];
        let [first, second] = counts.map(reciprocal);
        let means = [
            std::array::from_fn(|c| (rgb[c] * first) as f32),
            std::array::from_fn(|c| ((all[c] - rgb[c]) * second) as f32),
        ];
        (means, counts)
    }

    /// Adds one row of a tile.
    pub fn add_tile_row(&mut self, at: usize, tile: &TileSums, from: usize, length: usize, layout: &Layout) {
        let (here, there) = (at..at + length, from..from + length);
        let mut others = tile.others.iter();
        let places = layout.further().iter().zip(&layout.offsets);
        for ((channel, &offset), into) in places.zip(&mut self.further) {
            let (before, added, sums, stride) = match channel.source {
                Source::Color => (&self.count, &tile.count, &[][..], 0),
                Source::PartOfColor => (&self.count, &tile.count, &tile.parts[..], 3 * layout.parts),
                Source::FirstHit => (&self.hits, &tile.hits, &tile.first_hits[..], layout.first_hit_width()),
            };
            if !channel.is_summed() {
                let more = &others.next().expect("a tile has an accumulator for what is not summed").1;
                into.merge(at, more, from, &before[here.clone()], &added[there.clone()]);
            } else if let Kept::Sums(list) = &mut into.kept {
                let width = channel.components();
                let rows = sums.chunks_exact(stride).skip(from).take(length);
                list.add_strided(at * width, rows.map(|numbers| &numbers[offset..offset + width]));
            }
        }
        let colors = self.rgba[here.clone()].iter_mut().zip(&mut self.rgb_low[here.clone()]);
        for ((sum, low), value) in colors.zip(&tile.rgba[there.clone()]) {
            (0..3).for_each(|c| add_exact(&mut sum[c], &mut low[c], on_grid(value[c])));
            // Alphas of samples are on a grid, and their sums exact.
            sum[3] += value[3];
        }
        add_counts(&mut self.count[here.clone()], &tile.count[there.clone()]);
        if layout.has_halves {
            let halves = self.first_half[here.clone()].iter_mut().zip(&tile.first_half[there.clone()]);
            halves.for_each(|(into, from)| into.merge(from, true));
        }
        if layout.has_first_hits {
            add_counts(&mut self.hits[here], &tile.hits[there]);
        }
    }

    /// Adds one row of other sums.
    pub fn add_row(&mut self, at: usize, other: &Sums, from: usize, length: usize, layout: &Layout) {
        let (here, there) = (at..at + length, from..from + length);
        for ((channel, into), more) in layout.further().iter().zip(&mut self.further).zip(&other.further) {
            let (before, added) = match channel.source {
                Source::Color | Source::PartOfColor => (&self.count, &other.count),
                Source::FirstHit => (&self.hits, &other.hits),
            };
            into.merge(at, more, from, &before[here.clone()], &added[there.clone()]);
        }
        let colors = self.rgba[here.clone()].iter_mut().zip(&mut self.rgb_low[here.clone()]);
        let others = other.rgba[there.clone()].iter().zip(&other.rgb_low[there.clone()]);
        for ((sum, low), (value, rest)) in colors.zip(others) {
            for c in 0..3 {
                add_exact(&mut sum[c], &mut low[c], value[c]);
                add_exact(&mut sum[c], &mut low[c], f64::from(rest[c]));
            }
            sum[3] += value[3];
        }
        add_counts(&mut self.count[here.clone()], &other.count[there.clone()]);
        if layout.has_halves {
            let halves = self.first_half[here.clone()].iter_mut().zip(&other.first_half[there.clone()]);
            halves.for_each(|(into, from)| into.merge(from, false));
        }
        if layout.has_first_hits {
            add_counts(&mut self.hits[here], &other.hits[there]);
        }
    }

    /// Sets the means of colour over all samples, by lists of at least as many.
    pub fn set_color(&mut self, color: [&[f32]; 3]) {
        for (pixel, sum) in self.rgba.iter_mut().enumerate() {
            let count = f64::from(self.count[pixel]);
            (0..3).for_each(|c| sum[c] = f64::from(color[c][pixel]) * count);
        }
        self.rgb_low.fill([0.0; 3]);
    }

    /// Sets the means over all samples of a channel beyond colour.
    pub fn set_means(&mut self, further: usize, values: [&[f32]; 3]) {
        self.further[further].set_means(values, &self.count);
    }

    /// Takes a channel beyond colour away.
    pub fn remove(&mut self, further: usize) {
        self.further.remove(further);
    }

    /// Takes the counts of first hits away.
    pub fn forget_hits(&mut self) {
        self.hits = Vec::new();
    }

    /// Mean colour and alpha of a pixel, with colour from elsewhere.
    pub fn mean_rgba_with(&self, pixel: usize, [r, g, b]: [f64; 3]) -> [f32; 4] {
        let scale = reciprocal(self.count[pixel]);
        let sum = self.rgba[pixel];
        [sum[0] * scale + r, sum[1] * scale + g, sum[2] * scale + b, sum[3] * scale].map(|mean| mean as f32)
    }

    /// The values of a channel beyond colour, one list a name.
    pub fn planes(&self, index: usize, channel: &Channel) -> Vec<Values> {
        let further = index - 1;
        let brought = match channel.source {
            Source::Color | Source::PartOfColor => &self.count,
            Source::FirstHit => &self.hits,
        };
        self.further[further].planes(channel, Counts { samples: &self.count, brought })
    }
}

fn add_counts(into: &mut [u32], from: &[u32]) {
    into.iter_mut().zip(from).for_each(|(sum, value)| *sum = sum.saturating_add(*value));
}

/// A film in parts that threads add to.
pub struct SharedFilm {
    /// All but the bands.
    film: Film,
    place: Rect,
    bands: Vec<Mutex<SharedBand>>,
    /// Samples that were left out meanwhile.
    invalid: AtomicU64,
}

struct SharedBand {
    band: Band,
    place: Rect,
    /// The pass that is being added, and the number of its pixels that are missing.
    pass: usize,
    left: u64,
    /// Tiles of later passes.
    waiting: Vec<(usize, Arc<FilmTile>)>,
}

impl Film {
    /// The film in parts that threads add to, until [`SharedFilm::into_film`].
    pub fn into_shared(mut self) -> SharedFilm {
        let place = self.place();
        let share = |(number, band): (usize, _)| {
            let place = place.band(number);
            Mutex::new(SharedBand { band, place, pass: 0, left: place.area(), waiting: Vec::new() })
        };
        let bands = std::mem::take(&mut self.bands).into_iter().enumerate().map(share).collect();
        SharedFilm { film: self, place, bands, invalid: AtomicU64::new(0) }
    }
}

impl SharedFilm {
    /// Adds a tile of a pass, counted from 0, as far as it is within the film. The tiles of each pass cover every pixel once.
    /// Returns the tile if it is no longer needed.
    ///
    /// # Panics
    /// If the tile has other channels.
    pub fn merge(&self, pass: usize, tile: FilmTile) -> Option<FilmTile> {
        let is_ours = Arc::ptr_eq(&tile.layout, &self.film.layout) || tile.layout == self.film.layout;
        assert!(is_ours, "a tile has other channels than the film");
        self.invalid.fetch_add(tile.invalid_samples, Ordering::Relaxed);
        let tile = Arc::new(tile);
        for band in &self.bands[self.place.bands_over(tile.place())] {
            lock(band).take(pass, &tile);
        }
        Arc::into_inner(tile)
    }

    /// How many pixels of a rectangle of the picture are within the film.
    pub fn pixels_within(&self, x0: u32, y0: u32, width: u32, height: u32) -> u64 {
        self.place.and(Rect::new((x0, y0), (width, height))).area()
    }

    /// Adds all splats of a sample, lists of which each is sorted by [`SharedFilm::sort`].
    pub fn add_splats(&self, lists: &[Vec<Splat>], is_of_first_half: bool) {
        self.bands.par_iter().for_each(|band| {
            let SharedBand { band, place, .. } = &mut *lock(band);
            let mut invalid = 0;
            for splats in lists {
                let from = splats.partition_point(|splat| splat.y < place.y0);
                let until = from + splats[from..].partition_point(|splat| splat.y < place.y1);
                invalid += band.add_splats(*place, &splats[from..until], is_of_first_half, &self.film.layout);
            }
            band.splats(&self.film.layout).count(1, is_of_first_half);
            self.invalid.fetch_add(invalid, Ordering::Relaxed);
        });
    }

    /// Sorts splats by rows; those of a row stay in their order.
    pub fn sort(splats: &mut [Splat]) {
        splats.sort_by_key(|splat| splat.y);
    }

    /// Joins the bands to a film. Where rendering was stopped, tiles that still wait are added, pass by pass.
    pub fn into_film(self) -> Film {
        let SharedFilm { mut film, bands, invalid, .. } = self;
        film.invalid_samples += invalid.into_inner();
        film.bands = bands.into_par_iter().map(SharedBand::finish).collect();
        film
    }
}

impl SharedBand {
    fn finish(band: Mutex<SharedBand>) -> Band {
        let band = band.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
        let SharedBand { mut band, place, mut waiting, .. } = band;
        waiting.sort_by_key(|(pass, tile)| (*pass, tile.y0, tile.x0));
        waiting.iter().for_each(|(_, tile)| band.add_tile(place, tile));
        band
    }

    /// Adds a tile when its pass is the one that is added now, and then all that waited for that.
    fn take(&mut self, pass: usize, tile: &Arc<FilmTile>) {
        if pass != self.pass {
            self.waiting.push((pass, tile.clone()));
            return;
        }
        self.add(tile);
        while self.left == 0 {
            (self.pass, self.left) = (self.pass + 1, self.place.area());
            let pass = self.pass;
            for (_, tile) in self.waiting.extract_if(.., |(of, _)| *of == pass).collect::<Vec<_>>() {
                self.add(&tile);
            }
        }
    }

    fn add(&mut self, tile: &FilmTile) {
        self.band.add_tile(self.place, tile);
        self.left = self.left.saturating_sub(self.place.and(tile.place()).area());
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Aov, AovSet};

    /// The tile of a pass at a place: the colour and the material id of each sample encode its pass.
    fn tile(film: &SharedFilm, pass: usize, (x0, y0): (u32, u32)) -> FilmTile {
        let mut tile = FilmTile::new(x0, y0, 16, 16, film.film.layout());
        for pixel in 0..256 {
            let id = f32::from_bits(1 + pass as u32);
            // So large that sums depend on their order.
            let value = [1e9, 0.1, 1e17][pass % 3];
            tile.add_with_first_hit(pixel, [value; 3], 1.0, Some(&[id]));
        }
        tile
    }

    fn film() -> Film {
        Film::new(50, 70, AovSet::from([Aov::MaterialId])).at(3, 5)
    }

    fn places() -> Vec<(u32, u32)> {
        (0..6).flat_map(|y| (0..4).map(move |x| (16 * x, 16 * y))).collect()
    }

    #[test]
    fn pixels_get_passes_in_their_order_whatever_the_order_of_tiles() {
        let mut one_by_one = film();
        let shared = film().into_shared();
        let order: Vec<(usize, (u32, u32))> =
            (0..4).flat_map(|pass| places().into_iter().map(move |place| (pass, place))).collect();
        order.iter().for_each(|(pass, place)| one_by_one.merge(tile(&shared, *pass, *place)));
        // Each number once, in another order.
        let mixed = (0..order.len()).map(|i| order[(i * 41 + 17) % order.len()]);
        mixed.for_each(|(pass, place)| drop(shared.merge(pass, tile(&shared, pass, place))));
        let waits = |band: &Mutex<SharedBand>| !lock(band).waiting.is_empty();
        assert!(!shared.bands.iter().any(waits));
        assert_eq!(shared.into_film(), one_by_one);
    }

    /// Where a pass is not finished, later ones are added in the end.
    #[test]
    fn what_waits_is_not_lost() {
        let shared = film().into_shared();
        let mut one_by_one = film();
        for (pass, place) in [(2, (16, 16)), (1, (32, 16)), (0, (16, 16)), (1, (16, 16))] {
            shared.merge(pass, tile(&shared, pass, place));
        }
        for (pass, place) in [(0, (16, 16)), (1, (16, 16)), (2, (16, 16)), (1, (32, 16))] {
            one_by_one.merge(tile(&shared, pass, place));
        }
        assert_eq!(shared.into_film(), one_by_one);
    }

    /// No lock is common to all: tiles of other bands come in while a band is held.
    #[test]
    fn bands_do_not_wait_for_each_other() {
        let shared = Film::new(64, 64, AovSet::NONE).into_shared();
        let held = lock(&shared.bands[1]);
        let layout = shared.film.layout();
        for y0 in [0, 32, 48] {
            assert!(shared.merge(0, FilmTile::new(0, y0, 64, 16, layout)).is_some());
        }
        drop(held);
        let locks = |y0, height| shared.place.bands_over(Rect::new((0, y0), (16, height))).len();
        assert_eq!(
            [locks(0, 16), locks(48, 16), locks(8, 16), locks(32, 32), locks(64, 16)],
            [1, 1, 2, 2, 0]
        );
    }
}
