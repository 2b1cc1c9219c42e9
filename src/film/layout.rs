//! What a film holds, and where the numbers that a sample brings belong.

use super::accumulator::Accumulator;
use super::channel::{Channel, PixelType, Reduction, Source};
use super::exact::HalfSum;

/// What a film is a list of. The first channel is colour.
#[derive(Debug, PartialEq)]
pub struct Layout {
    pub(super) channels: Vec<Channel>,
    /// Whether any channel shows first hits.
    pub(super) has_first_hits: bool,
    /// Whether the colour of the first half of each pixel's samples is kept apart.
    pub(super) has_halves: bool,
    /// Of each channel beyond colour the place of its first number among those that a sample brings to its source.
    pub(super) offsets: Vec<usize>,
    /// How many channels show parts of the colour.
    pub(super) parts: usize,
    /// Of each number of a first hit the bits that are all set where it is not finite; 0 for integers.
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

    /// Numbers that a sample brings of its first hit.
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
