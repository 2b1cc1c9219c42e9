//! Channels of a film, and how samples become pixels in each. `aov.rs` has the table of those that users may
//! ask for.

use super::cryptomatte::Coverage;
use super::exact_sum::{HalfSum, SumList};
use std::borrow::Cow;
use std::ops::Range;

/// Prefix of the layers of light groups.
pub const LIGHT_GROUP: &str = "RGBA_";

/// How files store the values of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PixelType {
    /// 16-bit floats, unless 32 are asked for.
    Half,
    /// 32-bit floats.
    Float,
    /// 32-bit integers.
    Uint,
}

/// The part of a sample from which a channel is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Source {
    /// Its red, green and blue. Every sample has them.
    Color,
    /// The surface that its camera ray hit, if any.
    FirstHit,
    /// A part of its red, green and blue: that of a light pass or of a group of lights. Every sample has them.
    PartOfColor,
}

/// How the values of samples become the value of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Reduction {
    /// Mean over all samples; those that hit nothing count as zero.
    Mean,
    /// Mean over those that hit something; `empty` where none did.
    MeanOfHits {
        /// The value where nothing was hit.
        empty: f32,
    },
    /// The smallest value; `empty` where nothing was hit.
    Minimum {
        /// The value where nothing was hit.
        empty: f32,
    },
    /// The value of the first sample that hit something; 0 where none did. For numbers that have no mean.
    First,
    /// Variance of the mean over all samples: their sample variance divided by their number, which is the variance of
    /// independent samples. Ours are better spread than such, so that the mean varies less (by a factor of 7 over the
    /// Cornell box at 20 samples). Infinite below two samples, which say nothing about it.
    VarianceOfMean,
    /// The first of two sums over the sum of both, such as the share of light that is blocked; 0 where both are 0.
    Share,
    /// The number of samples with a value.
    Count,
    /// Which ids (the bits of a float, and never those of a NaN) cover the pixel: pairs of an id and its share of all
    /// samples, the largest share first, as many as there are pairs of names.
    Coverage,
}

/// One entry of a film's list: values that have one source and one reduction.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name of each component in files: `layer.component`.
    pub names: Vec<Cow<'static, str>>,
    /// How files store it.
    pub pixel_type: PixelType,
    /// Where its values come from.
    pub source: Source,
    /// How samples become a pixel.
    pub reduction: Reduction,
}

impl Channel {
    /// The picture itself: premultiplied colour and alpha. The first of every film.
    pub fn color() -> Channel {
        Channel {
            names: ["R", "G", "B", "A"].map(Cow::Borrowed).to_vec(),
            pixel_type: PixelType::Half,
            source: Source::Color,
            reduction: Reduction::Mean,
        }
    }

    /// The part of the picture that a group of lights contributes: `RGBA_key.R` and so on.
    pub fn light_group(group: &str) -> Channel {
        Channel {
            names: ["R", "G", "B"].map(|c| Cow::Owned(format!("{LIGHT_GROUP}{group}.{c}"))).to_vec(),
            pixel_type: PixelType::Half,
            source: Source::PartOfColor,
            reduction: Reduction::Mean,
        }
    }

    /// How many numbers each sample has.
    pub fn components(&self) -> usize {
        components(self.reduction, self.names.len())
    }

    /// Are sums of these numbers all that is kept?
    pub(super) fn is_summed(&self) -> bool {
        let is_sum =
            matches!(self.reduction, Reduction::Mean | Reduction::MeanOfHits { .. } | Reduction::Share);
        is_sum && self.source != Source::Color
    }
}

/// Number of values that each sample adds to a channel with this number of names.
pub(super) const fn components(reduction: Reduction, names: usize) -> usize {
    match reduction {
        // An id, whose counts become several planes.
        Reduction::Coverage => 1,
        Reduction::Share => 2,
        _ => names,
    }
}

// Storage of one channel beyond colour, by the channel's reduction.

/// Values of one component of a channel, one a pixel, rows from the top.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Values {
    /// Floats.
    Float(Vec<f32>),
    /// Integers.
    Uint(Vec<u32>),
}

impl Values {
    /// None of a channel.
    pub(super) fn empty(channel: &Channel) -> Values {
        match channel.pixel_type {
            PixelType::Uint => Values::Uint(Vec::new()),
            PixelType::Half | PixelType::Float => Values::Float(Vec::new()),
        }
    }

    /// Adds those of further pixels, which are of the same kind.
    pub(super) fn append(&mut self, more: Values) {
        match (self, more) {
            (Values::Float(values), Values::Float(more)) => values.extend(more),
            (Values::Uint(values), Values::Uint(more)) => values.extend(more),
            _ => debug_assert!(false, "values of another kind"),
        }
    }

    /// As floats; integers above 2^24 lose their last digits.
    pub fn into_floats(self) -> Vec<f32> {
        match self {
            Values::Float(values) => values,
            Values::Uint(values) => values.into_iter().map(|v| v as f32).collect(),
        }
    }
}

/// How many samples of each pixel there are: in all, and of the channel's source.
#[derive(Clone, Copy)]
pub(super) struct Counts<'a> {
    pub samples: &'a [u32],
    pub with_value: &'a [u32],
}

/// Storage of one channel.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Accumulator {
    /// Numbers of a sample.
    width: usize,
    pub(super) data: AccumulatorData,
}

/// Sums and the like. Lists hold a channel's components pixel by pixel; all start at zero.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum AccumulatorData {
    /// Sums of values.
    Sums(SumList),
    /// Sums of values, and of their squares.
    Moments { sums: SumList, squares: SumList },
    /// Smallest values.
    Minimum(Vec<f32>),
    /// Values of the first samples.
    First(Vec<f32>),
    /// Lists of ids.
    Coverage(Coverage),
    /// The film's counts say it all.
    Counts,
}

impl Accumulator {
    /// Empty, of a film or of a tile; `None` if there is no memory for it.
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

    /// Bytes for one pixel; lists of ids grow beyond it.
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

    /// Adds the values of a sample to a pixel, one a component; `is_first` for its first sample.
    pub fn add(&mut self, pixel: usize, values: &[f32], is_first: bool) {
        let places = places(pixel..pixel + 1, self.width);
        match &mut self.data {
            AccumulatorData::Moments { sums, squares } => {
                let (sums, squares) = (&mut sums.high[places.clone()], &mut squares.high[places]);
                for ((sum, square), v) in sums.iter_mut().zip(squares).zip(values) {
                    let v = f64::from(*v);
                    *sum += v;
                    *square += v * v;
                }
            }
            AccumulatorData::Minimum(least) => {
                for (least, &v) in least[places].iter_mut().zip(values) {
                    *least = if is_first { v } else { least.min(v) };
                }
            }
            AccumulatorData::First(first) if is_first => first[places].copy_from_slice(values),
            AccumulatorData::Coverage(lists) => lists.add(pixel, values[0].to_bits(), 1),
            // Tiles sum by themselves.
            AccumulatorData::First(_) | AccumulatorData::Counts | AccumulatorData::Sums(_) => {}
        }
    }

    /// Adds pixels of another accumulator of the same channel, which start at `from`, to those that start at `at`.
    /// `before` and `added` are the numbers of samples of this one and of the other, one a pixel.
    pub fn merge(&mut self, at: usize, other: &Accumulator, from: usize, before: &[u32], added: &[u32]) {
        let (length, width) = (added.len(), self.width);
        let (here, there) = (places(at..at + length, width), places(from..from + length, width));
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

    /// Sets three components to means of `count` samples; does nothing where the film doesn't store sums.
    pub fn set_means(&mut self, values: [&[f32]; 3], samples: &[u32]) {
        let AccumulatorData::Sums(sums) = &mut self.data else { return };
        sums.low.fill(0.0);
        for (pixel, (sums, &count)) in sums.high.chunks_exact_mut(self.width).zip(samples).enumerate() {
            for (sum, values) in sums.iter_mut().zip(values) {
                *sum = f64::from(values[pixel]) * f64::from(count);
            }
        }
    }

    /// The values of all pixels, one list a name of the channel.
    pub fn planes(&self, channel: &Channel, counts: Counts) -> Vec<Values> {
        let Counts { samples, with_value } = counts;
        match (&self.data, channel.reduction) {
            (AccumulatorData::Coverage(lists), _) => coverage_planes(lists, channel.names.len(), samples),
            (AccumulatorData::Sums(sums), Reduction::Share) => {
                vec![Values::Float(sums.high.chunks_exact(2).map(|pair| share(pair[0], pair[1])).collect())]
            }
            (AccumulatorData::Sums(sums), Reduction::MeanOfHits { empty }) => {
                means(&sums.high, self.width, with_value, empty)
            }
            (AccumulatorData::Sums(sums), _) => means(&sums.high, self.width, samples, 0.0),
            _ => (0..channel.names.len()).map(|component| self.plane(component, channel, counts)).collect(),
        }
    }

    /// The values of one component.
    fn plane(&self, component: usize, channel: &Channel, counts: Counts) -> Values {
        let Counts { samples, with_value } = counts;
        let floats = match (&self.data, channel.reduction) {
            // Sums and lists make all components at once.
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

/// Takes the values of another list where this one is a pixel's first, else what `choose` says.
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

/// One component of a list that has `width` for each pixel.
fn component_of<T: Copy>(list: &[T], width: usize, component: usize) -> impl Iterator<Item = T> {
    list.iter().copied().skip(component).step_by(width)
}

/// One over a count, or zero.
pub(super) fn reciprocal(count: u32) -> f64 {
    if count == 0 { 0.0 } else { 1.0 / f64::from(count) }
}

/// The means of all components over so many values per pixel; `empty` where there are none. Most of what writing a picture takes
/// but for its compression is here.
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

/// Which share of both the first of two sums is; 0 of nothing.
fn share(first: f64, second: f64) -> f32 {
    let both = first + second;
    if both > 0.0 { (first / both).clamp(0.0, 1.0) as f32 } else { 0.0 }
}

/// The variance of a mean of `count` values with these sums: `(squares - sums^2 / n) / (n - 1) / n`.
fn variance_of_mean(sum: f64, squares: f64, count: u32) -> f32 {
    if count < 2 {
        return f32::INFINITY;
    }
    let n = f64::from(count);
    // Rounding may take the difference below zero where all values are the same.
    ((squares - sum * sum / n).max(0.0) / ((n - 1.0) * n)) as f32
}

/// Ids as the bits of floats, and the shares of the samples that show them, in turn.
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

/// Where the numbers of pixels stand in a list with `width` for each.
fn places(pixels: Range<usize>, width: usize) -> Range<usize> {
    pixels.start * width..pixels.end * width
}

// The layout of a film, and where the numbers of a sample belong.

/// The channels of a film. The first one is colour.
#[derive(Debug, PartialEq)]
pub struct Layout {
    pub(super) channels: Vec<Channel>,
    /// Whether any channel shows first hits.
    pub(super) has_first_hits: bool,
    /// Whether the colour of the first half of each pixel's samples is kept apart.
    pub(super) has_halves: bool,
    /// By channel beyond colour: the index of its first number among those of a sample for its source.
    pub(super) offsets: Vec<usize>,
    /// How many channels show parts of the colour.
    pub(super) parts: usize,
    /// By number of a first hit: the bits that are all set where it is not finite; 0 for integers.
    pub(super) exponents: Vec<u32>,
}

/// The bits of a float's exponent.
const EXPONENT: u32 = 0x7f80_0000;

impl Layout {
    /// Colour and further channels.
    pub fn new(further: impl IntoIterator<Item = Channel>) -> Layout {
        let mut layout = Layout {
            channels: vec![Channel::color()],
            has_first_hits: false,
            has_halves: false,
            offsets: Vec::new(),
            parts: 0,
            exponents: Vec::new(),
        };
        for channel in further {
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

    /// Numbers of a sample's first hit.
    pub(super) fn first_hit_width(&self) -> usize {
        self.exponents.len()
    }

    /// Are all floats of a first hit finite? Integers travel as bits.
    pub(super) fn is_finite(&self, first_hit: &[f32]) -> bool {
        let numbers = self.exponents.iter().zip(first_hit);
        numbers.map(|(&exponent, value)| u32::from(value.to_bits() & exponent == EXPONENT)).sum::<u32>() == 0
    }

    /// The same, with the colour of the first half of each pixel's samples kept apart if `has_halves`.
    pub fn with_halves(self, has_halves: bool) -> Layout {
        Layout { has_halves, ..self }
    }

    /// All channels but colour.
    pub(super) fn further(&self) -> &[Channel] {
        &self.channels[1..]
    }

    /// Are there more than colour?
    pub fn has_more_than_color(&self) -> bool {
        self.channels.len() > 1 || self.has_halves
    }

    /// Is the first half of each pixel's samples kept apart?
    pub fn has_halves(&self) -> bool {
        self.has_halves
    }

    /// Bytes that the light of paths from lights takes for one pixel, at most.
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
