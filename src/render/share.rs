//! The share of a picture that a rendering takes: all of it, or some pixels, or some samples of each.

use super::options::{Adaptive, RenderOptions};
use crate::error::{Error, Result};
use crate::integrator::Block;
use crate::integrator::reuse::INTERVAL;
use crate::output::part::Region;
use std::ops::Range;

/// Samples go in blocks of so many.
pub const SAMPLE_BLOCK: u32 = INTERVAL;

impl RenderOptions {
    /// The pixels that are rendered.
    pub(super) fn pixels(&self) -> Region {
        self.region.unwrap_or(Region { x0: 0, y0: 0, x1: self.width, y1: self.height })
    }

    /// The samples that are taken of each. A block of [`SAMPLE_BLOCK`] belongs to the range that its first sample is in:
    /// ranges that follow each other still do.
    pub(super) fn taken(&self) -> Range<u32> {
        let (from, until) = self.sample_range.unwrap_or((0, self.samples));
        let whole = |sample: u32| sample.checked_next_multiple_of(SAMPLE_BLOCK).unwrap_or(u32::MAX);
        whole(from).min(self.samples)..whole(until).min(self.samples)
    }

    /// Is only a part of the picture rendered?
    pub(super) fn is_part(&self) -> bool {
        self.region.is_some() || self.sample_range.is_some()
    }

    /// Can there be such a part?
    pub(super) fn check_share(&self) -> Result<()> {
        let Region { x0, y0, x1, y1 } = self.pixels();
        let is_outside = x0 >= x1 || y0 >= y1 || x1 > self.width || y1 > self.height;
        if self.region.is_some() && is_outside {
            let message = format!("the region {} has no pixels in the picture", self.pixels());
            let help = format!("the picture has {} x {} pixels", self.width, self.height);
            return Err(Error::usage(message).with_help(help));
        }
        if let Some((from, until)) = self.sample_range.filter(|(a, b)| a >= b || *b > self.samples) {
            let message = format!("the range of samples {from}..{until} is none of the picture's");
            return Err(Error::usage(message).with_help(format!("it has the samples 0..{}", self.samples)));
        }
        if self.is_part() && self.adaptive == Adaptive::Auto {
            let message = "parts of pictures whose pixels get different numbers of samples can't be rendered";
            return Err(Error::usage(message).with_help("leave adaptive sampling off"));
        }
        if self.is_part() && self.time_limit.is_some() {
            return Err(Error::usage("parts of pictures have all their samples, whatever time that takes"));
        }
        if self.is_part() && self.noise.is_some() {
            return Err(Error::usage("how noisy a picture is, no part of it can tell"));
        }
        Ok(())
    }
}

/// What of a block is within a region: the block itself if its pixels can't be told apart (`is_whole`).
pub(super) fn within(region: &Region, block: &Block, is_whole: bool) -> Option<Block> {
    let (x0, y0) = (block.x0.max(region.x0), block.y0.max(region.y0));
    let (x1, y1) = ((block.x0 + block.width).min(region.x1), (block.y0 + block.height).min(region.y1));
    if x0 >= x1 || y0 >= y1 {
        return None;
    }
    Some(if is_whole { *block } else { Block { x0, y0, width: x1 - x0, height: y1 - y0, ..*block } })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the ranges that a picture is divided into, each block is in one.
    #[test]
    fn ranges_that_follow_each_other_still_do() {
        let options = RenderOptions::default().samples(100);
        let taken = |from, until| RenderOptions { sample_range: Some((from, until)), ..options }.taken();
        let cuts = [0, 3, 8, 9, 30, 33, 64, 97, 100];
        let ranges: Vec<_> = cuts.windows(2).map(|w| taken(w[0], w[1])).collect();
        assert_eq!((ranges[0].start, ranges.last().unwrap().end), (0, 100));
        assert!(ranges.windows(2).all(|w| w[0].end == w[1].start && (w[0].end % 8 == 0 || w[0].end == 100)));
        assert_eq!((taken(3, 8), taken(96, 97), options.taken()), (8..8, 96..100, 0..100));
    }
}
