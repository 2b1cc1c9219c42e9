//! Exact sums of everything that samples bring to some rows of a film.

use super::accumulator::{Accumulator, Counts, Kept, Values, reciprocal};
use super::channel::{Channel, Source};
use super::exact::{self, HalfSum};
use super::layout::Layout;
use super::tile::TileSums;

/// Sums and counts, one entry a pixel. Those of tiles are [`TileSums`].
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sums {
    /// Red, green, blue, alpha.
    pub rgba: Vec<[f64; 4]>,
    /// What the sums of red, green and blue leave out.
    pub(super) rgb_low: Vec<[f32; 3]>,
    /// Samples of each pixel.
    pub count: Vec<u32>,
    /// Those that hit something; empty where no channel asks for it.
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
            (0..3).for_each(|c| exact::add(&mut sum[c], &mut low[c], exact::on_grid(value[c])));
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
                exact::add(&mut sum[c], &mut low[c], value[c]);
                exact::add(&mut sum[c], &mut low[c], f64::from(rest[c]));
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
