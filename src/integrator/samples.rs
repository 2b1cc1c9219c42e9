//! The samples of a block, one after another.

use super::block::Block;
use crate::sampling::{Allotment, Arrangement};

/// How many samples pixels take, and which random points.
#[derive(Clone, Copy, Debug)]
pub enum SamplePlan<'a> {
    /// All alike.
    Even(Arrangement),
    /// More where the picture needs them.
    Allotted(&'a Allotment),
}

impl SamplePlan<'_> {
    /// Which samples pixel (`x`, `y`) takes of a block's: the seed of its sequence, the index of the first one there, and
    /// how many follow.
    #[inline(always)]
    fn of_pixel(&self, x: u32, y: u32, block: &Block, branch_bits: u32) -> (u32, u32, u32) {
        match self {
            SamplePlan::Even(arrangement) => {
                let (seed, start) = arrangement.first(x, y);
                (seed, (start >> branch_bits) + block.first_sample, block.samples)
            }
            SamplePlan::Allotted(allotment) => allotment.of_pixel(x, y, block.first_sample, block.samples),
        }
    }
}

/// A sample of a block.
pub(super) struct Sample {
    /// Pixel of the block, row by row.
    pub pixel: u32,
    /// Pixel of the picture.
    pub x: u32,
    pub y: u32,
    /// Seed of its sequence, and its index there.
    pub seed: u32,
    pub index: u32,
}

/// Walks through the samples of a block, pixel by pixel, whatever the waves.
pub(super) struct Samples<'a> {
    plan: SamplePlan<'a>,
    block: Block,
    branch_bits: u32,
    /// Pixels that were begun.
    begun: u32,
    /// The next one of the current pixel, and how many it has left.
    next: Sample,
    left: u32,
}

impl<'a> Samples<'a> {
    pub fn new(plan: SamplePlan<'a>, block: &Block, branch_bits: u32) -> Samples<'a> {
        let next = Sample { pixel: 0, x: 0, y: 0, seed: 0, index: 0 };
        Samples { plan, block: *block, branch_bits, begun: 0, next, left: 0 }
    }
}

impl Iterator for Samples<'_> {
    type Item = Sample;

    #[inline(always)]
    fn next(&mut self) -> Option<Sample> {
        while self.left == 0 {
            let (pixel, width) = (self.begun, self.block.width);
            if pixel == width * self.block.height {
                return None;
            }
            self.begun += 1;
            let (x, y) = (self.block.x0 + pixel % width, self.block.y0 + pixel / width);
            let (seed, index, count) = self.plan.of_pixel(x, y, &self.block, self.branch_bits);
            (self.next, self.left) = (Sample { pixel, x, y, seed, index }, count);
        }
        let Sample { index, .. } = self.next;
        self.left -= 1;
        self.next.index += 1;
        Some(Sample { index, ..self.next })
    }
}
