//! Sums of everything that samples bring, of a film or of a tile.

use super::accumulator::{Accumulator, Counts, Values, reciprocal};
use super::channel::{Channel, Reduction, Source};
use super::exact::{self, HalfSum};

/// What a film is a list of. The first channel is colour.
#[derive(Debug, PartialEq)]
pub struct Layout {
    pub(super) channels: Vec<Channel>,
    /// Whether any channel shows first hits.
    pub(super) has_first_hits: bool,
    /// Whether the colour of the first half of each pixel's samples is kept apart.
    pub(super) has_halves: bool,
}

impl Layout {
    /// Colour and further channels.
    pub fn new(further: impl IntoIterator<Item = Channel>) -> Layout {
        let mut channels = vec![Channel::color()];
        channels.extend(further);
        let has_first_hits = channels.iter().any(|channel| channel.source == Source::FirstHit);
        Layout { channels, has_first_hits, has_halves: false }
    }

    /// The same, with the colour of the first half of each pixel's samples kept apart if `has_halves`.
    pub fn with_halves(self, has_halves: bool) -> Layout {
        Layout { has_halves, ..self }
    }

    /// All channels but colour.
    pub(super) fn further(&self) -> &[Channel] {
        &self.channels[1..]
    }

    /// Those that show first hits.
    pub(super) fn first_hits(&self) -> impl Iterator<Item = &Channel> {
        self.further().iter().filter(|channel| channel.source == Source::FirstHit)
    }

    /// Are there more than colour?
    pub fn has_more_than_color(&self) -> bool {
        self.channels.len() > 1 || self.has_halves
    }

    /// Is the first half of each pixel's samples kept apart?
    pub fn has_halves(&self) -> bool {
        self.has_halves
    }

    /// Bytes that light from lamps takes for one pixel, at most.
    pub fn splat_bytes_per_pixel(&self) -> u64 {
        let further = self.further().iter().filter(|channel| {
            channel.source == Source::PartOfColor || channel.reduction == Reduction::VarianceOfMean
        });
        let lists = further.count() * 3 * (size_of::<f64>() + size_of::<f32>());
        (size_of::<HalfSum>() * (1 + usize::from(self.has_halves)) + lists) as u64
    }

    /// Bytes for one pixel.
    pub fn bytes_per_pixel(&self) -> u64 {
        let counts = size_of::<u32>() * (1 + usize::from(self.has_first_hits));
        let further: usize = self.further().iter().map(Accumulator::bytes_per_pixel).sum();
        let halves = if self.has_halves { size_of::<HalfSum>() } else { 0 };
        (size_of::<[f64; 4]>() + size_of::<[f32; 3]>() + counts + further + halves) as u64
    }
}

/// Sums and counts, one entry a pixel.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sums {
    /// Red, green, blue, alpha.
    pub rgba: Vec<[f64; 4]>,
    /// What the sums of red, green and blue leave out; empty in tiles.
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
    /// Empty sums of a film or of a tile; `None` if the memory isn't there.
    pub fn try_new(pixels: usize, layout: &Layout, is_of_film: bool) -> Option<Sums> {
        let counts = |pixels| bytemuck::try_zeroed_vec(pixels).ok();
        let further =
            layout.further().iter().map(|channel| Accumulator::try_new(channel, pixels, is_of_film));
        let halves = if layout.has_halves { pixels } else { 0 };
        Some(Sums {
            rgba: bytemuck::try_zeroed_vec(pixels).ok()?,
            rgb_low: bytemuck::try_zeroed_vec(if is_of_film { pixels } else { 0 }).ok()?,
            count: counts(pixels)?,
            hits: counts(if layout.has_first_hits { pixels } else { 0 })?,
            further: further.collect::<Option<_>>()?,
            first_half: bytemuck::try_zeroed_vec(halves).ok()?,
        })
    }

    /// Adds colour and alpha.
    #[inline(always)]
    pub fn add(&mut self, pixel: usize, rgb: [f32; 3], alpha: f32) {
        let sum = &mut self.rgba[pixel];
        sum[0] += f64::from(rgb[0]);
        sum[1] += f64::from(rgb[1]);
        sum[2] += f64::from(rgb[2]);
        sum[3] += f64::from(alpha);
        self.count[pixel] += 1;
    }

    /// Adds a sample of the first half, whose colour was added.
    pub fn add_to_first_half(&mut self, pixel: usize, rgb: [f32; 3]) {
        self.first_half[pixel].add(rgb);
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

    /// Adds what the channels beyond colour take from a sample whose colour was added.
    pub fn add_further(
        &mut self,
        pixel: usize,
        rgb: [f32; 3],
        first_hit: Option<&[f32]>,
        parts: &[[f32; 3]],
        layout: &Layout,
    ) {
        let (mut rest, mut parts) = (first_hit, parts.iter());
        for (channel, accumulator) in layout.further().iter().zip(&mut self.further) {
            match channel.source {
                Source::Color => accumulator.add(pixel, &rgb, self.count[pixel] == 1),
                Source::PartOfColor => {
                    if let Some(part) = parts.next() {
                        accumulator.add(pixel, part, self.count[pixel] == 1);
                    }
                }
                Source::FirstHit => {
                    let Some((values, others)) = rest.map(|all| all.split_at(channel.components())) else {
                        continue;
                    };
                    accumulator.add(pixel, values, self.hits[pixel] == 0);
                    rest = Some(others);
                }
            }
        }
        if first_hit.is_some() && layout.has_first_hits {
            self.hits[pixel] += 1;
        }
    }

    /// Adds one row of other sums.
    pub fn add_row(&mut self, at: usize, other: &Sums, from: usize, length: usize, layout: &Layout) {
        fn count(into: &mut [u32], from: &[u32]) {
            into.iter_mut().zip(from).for_each(|(sum, value)| *sum = sum.saturating_add(*value));
        }
        let (here, there) = (at..at + length, from..from + length);
        for ((channel, into), more) in layout.further().iter().zip(&mut self.further).zip(&other.further) {
            let (before, added) = match channel.source {
                Source::Color | Source::PartOfColor => (&self.count, &other.count),
                Source::FirstHit => (&self.hits, &other.hits),
            };
            into.merge(at, more, from, &before[here.clone()], &added[there.clone()]);
        }
        self.add_colors(at, other, from, length);
        count(&mut self.count[here.clone()], &other.count[there.clone()]);
        if layout.has_halves {
            let halves = self.first_half[here.clone()].iter_mut().zip(&other.first_half[there.clone()]);
            halves.for_each(|(into, from)| into.merge(from, other.is_of_tile()));
        }
        if layout.has_first_hits {
            count(&mut self.hits[here], &other.hits[there]);
        }
    }

    /// Are these the sums of a tile, and not of a film?
    fn is_of_tile(&self) -> bool {
        self.rgb_low.is_empty()
    }

    /// Adds the colours of one row of other sums.
    fn add_colors(&mut self, at: usize, other: &Sums, from: usize, length: usize) {
        let here = self.rgba[at..at + length].iter_mut().zip(&mut self.rgb_low[at..at + length]);
        let there = &other.rgba[from..from + length];
        for ((sum, low), value) in here.zip(there) {
            for c in 0..3 {
                let value = if other.rgb_low.is_empty() { exact::on_grid(value[c]) } else { value[c] };
                exact::add(&mut sum[c], &mut low[c], value);
            }
            // Alphas of samples are on a grid, and their sums exact.
            sum[3] += value[3];
        }
        if let Some(lows) = other.rgb_low.get(from..from + length) {
            let here = self.rgba[at..at + length].iter_mut().zip(&mut self.rgb_low[at..at + length]);
            for ((sum, low), rest) in here.zip(lows) {
                (0..3).for_each(|c| exact::add(&mut sum[c], &mut low[c], f64::from(rest[c])));
            }
        }
    }

    /// Sets the means of colour over all samples.
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
