//! Bands of a film: groups of rows, each with a lock, so that threads can add to different bands concurrently (`shared.rs`).

use super::channel::{
    Accumulator, AccumulatorData, Channel, Counts, Layout, Reduction, Source, Values, reciprocal,
};
use super::exact_sum::{RgbSum, add_exact, round_to_grid};
use super::splats::{Splat, Splats};
use super::tile::{FilmTile, Rect, TileSums};

/// All sums of the rows of a band.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Band {
    pub sums: Sums,
    /// Contributions of light paths; `None` before the first.
    pub splats: Option<Splats>,
}

impl Band {
    /// A band without samples; `None` if memory runs out.
    pub fn try_new(pixels: usize, layout: &Layout) -> Option<Band> {
        Some(Band { sums: Sums::try_new(pixels, layout)?, splats: None })
    }

    pub fn pixels(&self) -> usize {
        self.sums.count.len()
    }

    /// The sums of splats, created on the first call.
    pub fn splats(&mut self, layout: &Layout) -> &mut Splats {
        self.splats.get_or_insert_with(|| Splats::new(self.sums.count.len(), layout))
    }

    /// Adds the part of a tile that overlaps the band, whose rectangle in the picture is `own`.
    pub fn add_tile(&mut self, own: Rect, tile: &FilmTile) {
        for (at, from, length) in own.common_rows(tile.rect()) {
            self.sums.add_tile_row(at, &tile.sums, from, length, &tile.layout);
        }
    }

    /// Adds the part of another band, whose rectangle in the picture is `rect`, that overlaps this one.
    pub fn add_band(&mut self, own: Rect, other: &Band, rect: Rect, layout: &Layout) {
        for (at, from, length) in own.common_rows(rect) {
            self.sums.add_row(at, &other.sums, from, length, layout);
            if let Some(theirs) = &other.splats {
                let ours = self.splats(layout);
                (0..length).for_each(|i| ours.merge(at + i, theirs, from + i));
            }
        }
    }

    /// Adds the splats within the band. Returns the number of non-finite splats, which are skipped.
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

    /// Premultiplied mean colour and alpha of a pixel; zero without samples.
    pub fn mean(&self, pixel: usize) -> [f32; 4] {
        let of_splats = self.splats.as_ref().map_or([0.0; 3], |splats| splats.mean(pixel));
        self.sums.mean_rgba_with(pixel, of_splats)
    }

    /// Mean colours of both half buffers of a pixel, and the number of samples in each.
    pub fn halves(&self, pixel: usize) -> ([[f32; 3]; 2], [u32; 2]) {
        let (means, counts) = self.sums.halves(pixel);
        let splats = self.splats.as_ref().map_or([[0.0; 3]; 2], |splats| splats.halves(pixel));
        let sum = |half: usize, c: usize| (f64::from(means[half][c]) + splats[half][c]) as f32;
        ([0, 1].map(|half| [0, 1, 2].map(|c| sum(half, c))), counts)
    }

    /// The planes of a channel other than colour; `layer` is its index among the channels of [`Source::PartOfColor`], if it is one.
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

/// Adds values to three planes.
fn add(planes: &mut [Values], values: impl Iterator<Item = [f64; 3]>) {
    for (pixel, values) in values.enumerate() {
        for (plane, value) in planes.iter_mut().zip(values) {
            if let Values::Float(plane) = plane {
                plane[pixel] = (f64::from(plane[pixel]) + value) as f32;
            }
        }
    }
}

/// Exact sums and sample counts by pixel. (Sums of tiles are [`TileSums`].)
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sums {
    /// Sums of red, green, blue, alpha.
    pub rgba: Vec<[f64; 4]>,
    /// Rounding errors of the sums of red, green and blue: see [`add_exact`].
    pub(super) rgb_low: Vec<[f32; 3]>,
    /// Number of samples of each pixel.
    pub count: Vec<u32>,
    /// Number of samples with a first hit of each pixel; empty if no channel needs it.
    pub(super) hits: Vec<u32>,
    /// Accumulators of the channels other than colour.
    pub(super) extra: Vec<Accumulator>,
    /// Sums over the first half of the samples; empty if the film has no half buffers.
    pub(super) first_half: Vec<RgbSum>,
}

impl Sums {
    /// Empty sums; `None` if memory runs out.
    pub fn try_new(pixels: usize, layout: &Layout) -> Option<Sums> {
        let counts = |pixels| bytemuck::try_zeroed_vec(pixels).ok();
        let extra = layout.extra().iter().map(|channel| Accumulator::try_new(channel, pixels, true));
        let halves = if layout.has_halves { pixels } else { 0 };
        Some(Sums {
            rgba: bytemuck::try_zeroed_vec(pixels).ok()?,
            rgb_low: bytemuck::try_zeroed_vec(pixels).ok()?,
            count: counts(pixels)?,
            hits: counts(if layout.has_first_hits { pixels } else { 0 })?,
            extra: extra.collect::<Option<_>>()?,
            first_half: bytemuck::try_zeroed_vec(halves).ok()?,
        })
    }

    /// Mean colours of both half buffers of a pixel, zero without samples, and the number of samples in each.
    pub fn halves(&self, pixel: usize) -> ([[f32; 3]; 2], [u32; 2]) {
        let RgbSum { rgb, count, .. } = self.first_half[pixel];
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
        let channels = layout.extra().iter().zip(&layout.offsets);
        for ((channel, &offset), into) in channels.zip(&mut self.extra) {
            let (before, added, sums, stride) = match channel.source {
                Source::Color => (&self.count, &tile.count, &[][..], 0),
                Source::PartOfColor => (&self.count, &tile.count, &tile.parts[..], 3 * layout.parts),
                Source::FirstHit => (&self.hits, &tile.hits, &tile.first_hits[..], layout.first_hit_width()),
            };
            if !channel.is_summed() {
                let more = &others.next().expect("a tile has an accumulator for what is not summed").1;
                into.merge(at, more, from, &before[here.clone()], &added[there.clone()]);
            } else if let AccumulatorData::Sums(list) = &mut into.data {
                let width = channel.components();
                let rows = sums.chunks_exact(stride).skip(from).take(length);
                list.add_strided(at * width, rows.map(|numbers| &numbers[offset..offset + width]));
            }
        }
        let colors = self.rgba[here.clone()].iter_mut().zip(&mut self.rgb_low[here.clone()]);
        for ((sum, low), value) in colors.zip(&tile.rgba[there.clone()]) {
            (0..3).for_each(|c| add_exact(&mut sum[c], &mut low[c], round_to_grid(value[c])));
            // Alphas of samples are multiples of a coarse step, so that their sums are exact.
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
        for ((channel, into), more) in layout.extra().iter().zip(&mut self.extra).zip(&other.extra) {
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

    /// Sets the mean colours of all pixels, from three planes, which may be longer.
    pub fn set_color(&mut self, color: [&[f32]; 3]) {
        for (pixel, sum) in self.rgba.iter_mut().enumerate() {
            let count = f64::from(self.count[pixel]);
            (0..3).for_each(|c| sum[c] = f64::from(color[c][pixel]) * count);
        }
        self.rgb_low.fill([0.0; 3]);
    }

    /// Sets the means of a channel other than colour, by its index in [`Layout::extra`].
    pub fn set_means(&mut self, extra: usize, values: [&[f32]; 3]) {
        self.extra[extra].set_means(values, &self.count);
    }

    /// Removes a channel other than colour, by its index in [`Layout::extra`].
    pub fn remove(&mut self, extra: usize) {
        self.extra.remove(extra);
    }

    /// Removes the counts of first hits.
    pub fn remove_hit_counts(&mut self) {
        self.hits = Vec::new();
    }

    /// Mean colour and alpha of a pixel plus the mean of its splats.
    pub fn mean_rgba_with(&self, pixel: usize, [r, g, b]: [f64; 3]) -> [f32; 4] {
        let scale = reciprocal(self.count[pixel]);
        let sum = self.rgba[pixel];
        [sum[0] * scale + r, sum[1] * scale + g, sum[2] * scale + b, sum[3] * scale].map(|mean| mean as f32)
    }

    /// The planes of a channel other than colour.
    pub fn planes(&self, index: usize, channel: &Channel) -> Vec<Values> {
        let extra = index - 1;
        let with_value = match channel.source {
            Source::Color | Source::PartOfColor => &self.count,
            Source::FirstHit => &self.hits,
        };
        self.extra[extra].planes(channel, Counts { samples: &self.count, with_value })
    }
}

fn add_counts(into: &mut [u32], from: &[u32]) {
    into.iter_mut().zip(from).for_each(|(sum, value)| *sum = sum.saturating_add(*value));
}
