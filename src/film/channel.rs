//! Channels of a film and their reductions from samples to pixels. `aov.rs` has the table of AOVs.

use super::cryptomatte::Coverage;
use super::exact_sum::{RgbSum, SumList};
use std::borrow::Cow;
use std::ops::Range;

/// Name prefix of layers of light groups.
pub const LIGHT_GROUP: &str = "RGBA_";

/// Type of a channel's values in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PixelType {
    /// 16-bit floats, or 32-bit ones on request.
    Half,
    /// 32-bit floats.
    Float,
    /// 32-bit unsigned integers.
    Uint,
}

/// The part of a sample that a channel stores.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Source {
    /// Radiance; every sample has it.
    Color,
    /// Properties of the first hit of the camera ray; samples without a hit have none.
    FirstHit,
    /// Part of the radiance: a light pass or light group; every sample has it.
    PartOfColor,
}

/// Reduction of the values of samples to the value of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Reduction {
    /// Mean over all samples; samples without a hit count as zero.
    Mean,
    /// Mean over samples with a hit; `empty` if there are none.
    MeanOfHits {
        /// Value of pixels without a hit.
        empty: f32,
    },
    /// Minimum; `empty` without a hit.
    Minimum {
        /// Value of pixels without a hit.
        empty: f32,
    },
    /// Value of the first sample with a hit; 0 without a hit. For ids.
    First,
    /// Variance of the mean, estimated by the sample variance over the number of samples. This assumes independent samples; for
    /// low-discrepancy samples it is an upper bound (a factor of 7 too large for the Cornell box at 20 samples). Infinite below two
    /// samples.
    VarianceOfMean,
    /// Ratio of the first of two sums to both together, such as the fraction of blocked light; 0 if both are 0.
    Share,
    /// The number of samples with a value.
    Count,
    /// Cryptomatte: pairs of an id (bits of a non-NaN float) and its fraction of all samples, sorted by decreasing fraction, as many as
    /// there are pairs of names.
    Coverage,
}

/// A channel of a film: one or more components with a common source and reduction.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name of each plane in files: `layer.component`.
    pub names: Vec<Cow<'static, str>>,
    /// Type of the values in files.
    pub pixel_type: PixelType,
    /// Source of the values.
    pub source: Source,
    /// Reduction of samples to a pixel.
    pub reduction: Reduction,
}

impl Channel {
    /// Premultiplied colour and alpha: the first channel of every film.
    pub fn color() -> Channel {
        Channel {
            names: ["R", "G", "B", "A"].map(Cow::Borrowed).to_vec(),
            pixel_type: PixelType::Half,
            source: Source::Color,
            reduction: Reduction::Mean,
        }
    }

    /// The contribution of a light group: `RGBA_key.R` and so on.
    pub fn light_group(group: &str) -> Channel {
        Channel {
            names: ["R", "G", "B"].map(|c| Cow::Owned(format!("{LIGHT_GROUP}{group}.{c}"))).to_vec(),
            pixel_type: PixelType::Half,
            source: Source::PartOfColor,
            reduction: Reduction::Mean,
        }
    }

    /// Number of values per sample.
    pub fn components(&self) -> usize {
        components(self.reduction, self.names.len())
    }

    /// Whether the channel stores only sums of parts of the radiance or of first-hit values.
    pub(super) fn is_summed(&self) -> bool {
        let is_sum =
            matches!(self.reduction, Reduction::Mean | Reduction::MeanOfHits { .. } | Reduction::Share);
        is_sum && self.source != Source::Color
    }
}

/// Number of values per sample of a channel with a number of names.
pub(super) const fn components(reduction: Reduction, names: usize) -> usize {
    match reduction {
        // An id; the counts of ids become several planes.
        Reduction::Coverage => 1,
        Reduction::Share => 2,
        _ => names,
    }
}

// Storage of a channel other than colour, by its reduction.

/// The values of a plane, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Values {
    /// Floats.
    Float(Vec<f32>),
    /// Integers.
    Uint(Vec<u32>),
}

impl Values {
    /// An empty plane of a channel.
    pub(super) fn empty(channel: &Channel) -> Values {
        match channel.pixel_type {
            PixelType::Uint => Values::Uint(Vec::new()),
            PixelType::Half | PixelType::Float => Values::Float(Vec::new()),
        }
    }

    /// Appends the values of further pixels, which must have the same type.
    pub(super) fn append(&mut self, more: Values) {
        match (self, more) {
            (Values::Float(values), Values::Float(more)) => values.extend(more),
            (Values::Uint(values), Values::Uint(more)) => values.extend(more),
            _ => debug_assert!(false, "values of another type"),
        }
    }

    /// Converts to floats; integers above 2^24 are rounded.
    pub fn into_floats(self) -> Vec<f32> {
        match self {
            Values::Float(values) => values,
            Values::Uint(values) => values.into_iter().map(|v| v as f32).collect(),
        }
    }
}

/// Number of samples by pixel: all, and those with a value of the channel's source.
#[derive(Clone, Copy)]
pub(super) struct Counts<'a> {
    pub samples: &'a [u32],
    pub with_value: &'a [u32],
}

/// Storage of one channel.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Accumulator {
    /// Number of values per sample.
    width: usize,
    pub(super) data: AccumulatorData,
}

/// Accumulated values, pixel by pixel with interleaved components; initially zero.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum AccumulatorData {
    /// Sums of values.
    Sums(SumList),
    /// Sums of values and of squares.
    Moments { sums: SumList, squares: SumList },
    /// Minima.
    Minimum(Vec<f32>),
    /// Values of the first samples with a hit.
    First(Vec<f32>),
    /// Ids with counts.
    Coverage(Coverage),
    /// Nothing: the channel shows sample counts, which the film stores.
    Counts,
}

impl Accumulator {
    /// An empty accumulator of a film (with exact sums) or of a tile; `None` if memory runs out.
    pub fn try_new(channel: &Channel, pixels: usize, is_of_film: bool) -> Option<Accumulator> {
        fn zeros<T: bytemuck::Zeroable>(count: usize) -> Option<Vec<T>> {
            bytemuck::try_zeroed_vec(count).ok()
        }
        let width = channel.components();
        let numbers = pixels.checked_mul(width)?;
        let sums = || SumList::try_new(numbers, is_of_film);
        let data = match channel.reduction {
            Reduction::Mean | Reduction::MeanOfHits { .. } | Reduction::Share => {
                AccumulatorData::Sums(sums()?)
            }
            Reduction::VarianceOfMean => AccumulatorData::Moments { sums: sums()?, squares: sums()? },
            Reduction::Minimum { .. } => AccumulatorData::Minimum(zeros(numbers)?),
            Reduction::First => AccumulatorData::First(zeros(numbers)?),
            Reduction::Coverage => AccumulatorData::Coverage(Coverage::try_new(pixels)?),
            Reduction::Count => AccumulatorData::Counts,
        };
        Some(Accumulator { width, data })
    }

    /// Memory per pixel, bytes; lists of ids grow beyond it.
    pub fn bytes_per_pixel(channel: &Channel) -> usize {
        const SUM: usize = size_of::<f64>() + size_of::<f32>();
        let number = match channel.reduction {
            Reduction::Mean | Reduction::MeanOfHits { .. } | Reduction::Share => SUM,
            Reduction::VarianceOfMean => 2 * SUM,
            Reduction::Minimum { .. } | Reduction::First | Reduction::Coverage => size_of::<f32>(),
            Reduction::Count => 0,
        };
        number * channel.components()
    }

    /// Adds the values of a sample to a pixel; `is_first`: the pixel's first sample.
    pub fn add(&mut self, pixel: usize, values: &[f32], is_first: bool) {
        let component_range = component_range(pixel..pixel + 1, self.width);
        match &mut self.data {
            AccumulatorData::Moments { sums, squares } => {
                let (sums, squares) =
                    (&mut sums.high[component_range.clone()], &mut squares.high[component_range]);
                for ((sum, square), v) in sums.iter_mut().zip(squares).zip(values) {
                    let v = f64::from(*v);
                    *sum += v;
                    *square += v * v;
                }
            }
            AccumulatorData::Minimum(least) => {
                for (least, &v) in least[component_range].iter_mut().zip(values) {
                    *least = if is_first { v } else { least.min(v) };
                }
            }
            AccumulatorData::First(first) if is_first => first[component_range].copy_from_slice(values),
            AccumulatorData::Coverage(lists) => lists.add(pixel, values[0].to_bits(), 1),
            // Sums of tiles are in `TileSums`.
            AccumulatorData::First(_) | AccumulatorData::Counts | AccumulatorData::Sums(_) => {}
        }
    }

    /// Adds the pixels of another accumulator of the same channel from pixel `from` on to the pixels from `at` on. `before` and `added`
    /// are the numbers of samples by pixel of this and of the other accumulator.
    pub fn merge(&mut self, at: usize, other: &Accumulator, from: usize, before: &[u32], added: &[u32]) {
        let (length, width) = (added.len(), self.width);
        let (here, there) =
            (component_range(at..at + length, width), component_range(from..from + length, width));
        match (&mut self.data, &other.data) {
            (AccumulatorData::Sums(a), AccumulatorData::Sums(b)) => {
                a.merge(here.start, b, there.start, here.len())
            }
            (
                AccumulatorData::Moments { sums, squares },
                AccumulatorData::Moments { sums: b, squares: b2 },
            ) => {
                sums.merge(here.start, b, there.start, here.len());
                squares.merge(here.start, b2, there.start, here.len());
            }
            (AccumulatorData::Minimum(a), AccumulatorData::Minimum(b)) => {
                let less = |is_first: bool, a: f32, b: f32| if is_first { b } else { a.min(b) };
                combine(&mut a[here], &b[there], width, before, added, less);
            }
            (AccumulatorData::First(a), AccumulatorData::First(b)) => {
                let first = |is_first: bool, a: f32, b: f32| if is_first { b } else { a };
                combine(&mut a[here], &b[there], width, before, added, first);
            }
            (AccumulatorData::Coverage(a), AccumulatorData::Coverage(b)) => {
                (0..length).for_each(|i| a.merge(at + i, b, from + i));
            }
            (data, _) => {
                debug_assert!(matches!(data, AccumulatorData::Counts), "accumulators of other channels")
            }
        }
    }

    /// Sets three components to given means; does nothing if the channel doesn't store sums.
    pub fn set_means(&mut self, values: [&[f32]; 3], samples: &[u32]) {
        let AccumulatorData::Sums(sums) = &mut self.data else { return };
        sums.low.fill(0.0);
        for (pixel, (sums, &count)) in sums.high.chunks_exact_mut(self.width).zip(samples).enumerate() {
            for (sum, values) in sums.iter_mut().zip(values) {
                *sum = f64::from(values[pixel]) * f64::from(count);
            }
        }
    }

    /// The planes of the channel, one per name.
    pub fn planes(&self, channel: &Channel, counts: Counts) -> Vec<Values> {
        let Counts { samples, with_value } = counts;
        match (&self.data, channel.reduction) {
            (AccumulatorData::Coverage(lists), _) => coverage_planes(lists, channel.names.len(), samples),
            (AccumulatorData::Sums(sums), Reduction::Share) => {
                vec![Values::Float(
                    sums.high.chunks_exact(2).map(|pair| fraction(pair[0], pair[1])).collect(),
                )]
            }
            (AccumulatorData::Sums(sums), Reduction::MeanOfHits { empty }) => {
                means(&sums.high, self.width, with_value, empty)
            }
            (AccumulatorData::Sums(sums), _) => means(&sums.high, self.width, samples, 0.0),
            _ => (0..channel.names.len()).map(|component| self.plane(component, channel, counts)).collect(),
        }
    }

    /// The plane of one component.
    fn plane(&self, component: usize, channel: &Channel, counts: Counts) -> Values {
        let Counts { samples, with_value } = counts;
        let floats = match (&self.data, channel.reduction) {
            // Of sums and lists of ids `planes` makes all components at once.
            (AccumulatorData::Counts | AccumulatorData::Sums(_) | AccumulatorData::Coverage(_), _) => {
                return Values::Uint(with_value.to_vec());
            }
            (AccumulatorData::Moments { sums, squares }, _) => {
                let [sums, squares] =
                    [sums, squares].map(|list| component_of(&list.high, self.width, component));
                let pixels = sums.zip(squares).zip(samples);
                pixels.map(|((sum, square), &n)| variance_of_mean(sum, square, n)).collect()
            }
            (AccumulatorData::Minimum(list) | AccumulatorData::First(list), reduction) => {
                let empty = if let Reduction::Minimum { empty } = reduction { empty } else { 0.0 };
                let values = component_of(list, self.width, component).zip(with_value);
                values.map(|(value, &hits)| if hits == 0 { empty } else { value }).collect::<Vec<f32>>()
            }
        };
        match channel.pixel_type {
            PixelType::Uint => Values::Uint(floats.into_iter().map(f32::to_bits).collect()),
            PixelType::Half | PixelType::Float => Values::Float(floats),
        }
    }
}

/// Combines two lists by `choose`, whose first argument is whether the left pixel has no sample yet.
fn combine(
    into: &mut [f32],
    from: &[f32],
    width: usize,
    before: &[u32],
    added: &[u32],
    choose: impl Fn(bool, f32, f32) -> f32,
) {
    let pixels = into.chunks_exact_mut(width).zip(from.chunks_exact(width)).zip(before.iter().zip(added));
    for ((into, from), (before, _)) in pixels.filter(|(_, (_, added))| **added > 0) {
        into.iter_mut().zip(from).for_each(|(a, b)| *a = choose(*before == 0, *a, *b));
    }
}

/// One component of a list with `width` interleaved components.
fn component_of<T: Copy>(list: &[T], width: usize, component: usize) -> impl Iterator<Item = T> {
    list.iter().copied().skip(component).step_by(width)
}

/// 1 / count; 0 for a count of 0.
pub(super) fn reciprocal(count: u32) -> f64 {
    if count == 0 { 0.0 } else { 1.0 / f64::from(count) }
}

/// Planes of means over a number of values by pixel; `empty` for a count of 0. After compression this takes most of the time of writing a
/// picture.
fn means(sums: &[f64], width: usize, counts: &[u32], empty: f32) -> Vec<Values> {
    let mut planes = vec![vec![empty; counts.len()]; width];
    for (component, plane) in planes.iter_mut().enumerate() {
        for ((mean, pixel), &count) in plane.iter_mut().zip(sums.chunks_exact(width)).zip(counts) {
            if count > 0 {
                *mean = (pixel[component] * (1.0 / f64::from(count))) as f32;
            }
        }
    }
    planes.into_iter().map(Values::Float).collect()
}

/// Ratio of the first of two sums to both together; 0 if both are 0.
fn fraction(first: f64, second: f64) -> f32 {
    let both = first + second;
    if both > 0.0 { (first / both).clamp(0.0, 1.0) as f32 } else { 0.0 }
}

/// The variance of a mean of `count` values with these sums: `(squares - sums^2 / n) / (n - 1) / n`.
fn variance_of_mean(sum: f64, squares: f64, count: u32) -> f32 {
    if count < 2 {
        return f32::INFINITY;
    }
    let n = f64::from(count);
    // Rounding may make the difference of equal values negative.
    ((squares - sum * sum / n).max(0.0) / ((n - 1.0) * n)) as f32
}

/// Planes of ids (as bits of floats) and of their fractions of the samples, alternating.
fn coverage_planes(lists: &Coverage, names: usize, samples: &[u32]) -> Vec<Values> {
    let mut planes = vec![vec![0.0f32; samples.len()]; names];
    for (pixel, &count) in samples.iter().enumerate() {
        for (pair, (id, of_id)) in planes.chunks_exact_mut(2).zip(lists.ranked(pixel)) {
            pair[0][pixel] = f32::from_bits(id);
            pair[1][pixel] = (f64::from(of_id) * reciprocal(count)) as f32;
        }
    }
    planes.into_iter().map(Values::Float).collect()
}

/// Index range of pixels in a list with `width` interleaved components.
fn component_range(pixels: Range<usize>, width: usize) -> Range<usize> {
    pixels.start * width..pixels.end * width
}

/// The channels of a film, the first of which is colour, and the offsets of their values in samples.
#[derive(Debug, PartialEq)]
pub struct Layout {
    pub(super) channels: Vec<Channel>,
    /// Whether any channel has the source [`Source::FirstHit`].
    pub(super) has_first_hits: bool,
    /// Whether the film has half buffers: sums of colour over the first half of each pixel's samples.
    pub(super) has_halves: bool,
    /// For each channel other than colour, the index of its first value among a sample's values of its source.
    pub(super) offsets: Vec<usize>,
    /// Number of channels with the source [`Source::PartOfColor`].
    pub(super) parts: usize,
    /// For each value of a first hit, the bit mask of a float's exponent; 0 for integers.
    pub(super) exponents: Vec<u32>,
}

/// Bit mask of a float's exponent; all set for NaN and infinity.
const EXPONENT: u32 = 0x7f80_0000;

impl Layout {
    /// A layout with colour and extra channels.
    pub fn new(extra: impl IntoIterator<Item = Channel>) -> Layout {
        let mut layout = Layout {
            channels: vec![Channel::color()],
            has_first_hits: false,
            has_halves: false,
            offsets: Vec::new(),
            parts: 0,
            exponents: Vec::new(),
        };
        for channel in extra {
            layout.offsets.push(match channel.source {
                Source::Color => 0,
                Source::PartOfColor => 3 * layout.parts,
                Source::FirstHit => layout.exponents.len(),
            });
            layout.parts += usize::from(channel.source == Source::PartOfColor);
            if channel.source == Source::FirstHit {
                layout.has_first_hits = true;
                let bits = if channel.pixel_type == PixelType::Uint { 0 } else { EXPONENT };
                layout.exponents.extend(std::iter::repeat_n(bits, channel.components()));
            }
            layout.channels.push(channel);
        }
        layout
    }

    /// Number of first-hit values per sample.
    pub(super) fn first_hit_width(&self) -> usize {
        self.exponents.len()
    }

    /// Whether all floats of a first hit are finite. (Integers are stored as bits of floats.)
    pub(super) fn is_finite(&self, first_hit: &[f32]) -> bool {
        let numbers = self.exponents.iter().zip(first_hit);
        numbers.map(|(&exponent, value)| u32::from(value.to_bits() & exponent == EXPONENT)).sum::<u32>() == 0
    }

    /// The same layout with or without half buffers.
    pub fn with_halves(self, has_halves: bool) -> Layout {
        Layout { has_halves, ..self }
    }

    /// The channels other than colour.
    pub(super) fn extra(&self) -> &[Channel] {
        &self.channels[1..]
    }

    /// Whether there are extra channels or half buffers.
    pub fn has_more_than_color(&self) -> bool {
        self.channels.len() > 1 || self.has_halves
    }

    /// Whether the film has half buffers.
    pub fn has_halves(&self) -> bool {
        self.has_halves
    }

    /// Maximum memory of splats per pixel, bytes.
    pub fn splat_bytes_per_pixel(&self) -> u64 {
        let extra = self.extra().iter().filter(|channel| {
            channel.source == Source::PartOfColor || channel.reduction == Reduction::VarianceOfMean
        });
        let lists = extra.count() * 3 * (size_of::<f64>() + size_of::<f32>());
        (size_of::<RgbSum>() * (1 + usize::from(self.has_halves)) + lists) as u64
    }

    /// Memory per pixel without splats, bytes.
    pub fn bytes_per_pixel(&self) -> u64 {
        let counts = size_of::<u32>() * (1 + usize::from(self.has_first_hits));
        let extra: usize = self.extra().iter().map(Accumulator::bytes_per_pixel).sum();
        let halves = if self.has_halves { size_of::<RgbSum>() } else { 0 };
        (size_of::<[f64; 4]>() + size_of::<[f32; 3]>() + counts + extra + halves) as u64
    }
}
