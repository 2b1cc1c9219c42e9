//! What a film is a list of: channels, and how samples become pixels in each. `aov.rs` has the table of those that users may
//! ask for.

use std::borrow::Cow;

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

/// What of a sample a channel is made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Source {
    /// Its red, green and blue. Every sample brings them.
    Color,
    /// The surface that its camera ray hit, if any.
    FirstHit,
    /// A part of its red, green and blue: that of a light pass or of a group of lights. Every sample brings them.
    PartOfColor,
}

/// How the values that samples bring become the value of a pixel.
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
    /// How many samples brought a value.
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
    /// What becomes of them.
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
            names: ["R", "G", "B"].map(|c| Cow::Owned(format!("RGBA_{group}.{c}"))).to_vec(),
            pixel_type: PixelType::Half,
            source: Source::PartOfColor,
            reduction: Reduction::Mean,
        }
    }

    /// How many numbers each sample brings.
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

/// How many numbers each sample brings to a channel of so many names.
pub(super) const fn components(reduction: Reduction, names: usize) -> usize {
    match reduction {
        // An id, whose counts become several planes.
        Reduction::Coverage => 1,
        Reduction::Share => 2,
        _ => names,
    }
}
