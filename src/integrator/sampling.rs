//! Which samples a block takes, random numbers by purpose, and Russian roulette.

use crate::color::Rgb;
use crate::sampling::sampler::Dimensions;
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
pub(super) struct CameraSamples<'a> {
    plan: SamplePlan<'a>,
    block: Block,
    branch_bits: u32,
    /// Pixels that were begun.
    begun: u32,
    /// The next one of the current pixel, and how many it has left.
    next: Sample,
    left: u32,
}

impl<'a> CameraSamples<'a> {
    pub fn new(plan: SamplePlan<'a>, block: &Block, branch_bits: u32) -> CameraSamples<'a> {
        let next = Sample { pixel: 0, x: 0, y: 0, seed: 0, index: 0 };
        CameraSamples { plan, block: *block, branch_bits, begun: 0, next, left: 0 }
    }
}

impl Iterator for CameraSamples<'_> {
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

/// A rectangle of pixels and a range of their samples.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// Left column.
    pub x0: u32,
    /// Top row.
    pub y0: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// First sample of each pixel.
    pub first_sample: u32,
    /// Samples of each pixel.
    pub samples: u32,
}

/// Walks through the samples of a block, pixel by pixel.
pub(super) struct SampleCursor {
    pub x: u32,
    pub y: u32,
    pub sample: u64,
    x0: u32,
    x1: u32,
}

impl SampleCursor {
    pub fn new(block: &Block, first: u64) -> SampleCursor {
        let samples = u64::from(block.samples);
        let (pixel, width) = (first / samples, u64::from(block.width));
        SampleCursor {
            x: block.x0 + (pixel % width) as u32,
            y: block.y0 + (pixel / width) as u32,
            sample: first % samples,
            x0: block.x0,
            x1: block.x0 + block.width,
        }
    }

    #[inline(always)]
    pub fn advance(&mut self, samples: u64) {
        self.sample += 1;
        if self.sample == samples {
            self.sample = 0;
            self.x += 1;
            if self.x == self.x1 {
                (self.x, self.y) = (self.x0, self.y + 1);
            }
        }
    }
}

/// The first bounce after which a path may be ended by roulette.
pub(super) const FIRST_ROULETTE: u32 = 3;

/// How a bounce scatters at all its vertices.
#[derive(Clone, Copy)]
pub(super) struct ScatterParams<'a> {
    pub dimensions: &'a Dimensions,
    /// May paths end?
    pub roulette: bool,
    /// How many paths the density of a direction counts for, for each light sample.
    pub branches: f32,
}

/// Russian roulette by the square root of the throughput (between the two extremes of never ending a path and of making
/// all survivors equally bright, and better than both): does the path go on, and the factor that makes up for those that
/// don't.
#[inline(always)]
pub(super) fn survival(throughput: Rgb, eta_squared: f32, u: f32, roulette: bool) -> (bool, f32) {
    let [r, g, b] = throughput.to_array();
    let brightest = r.max(g).max(b);
    let q = if roulette { (brightest * eta_squared).sqrt() } else { 1.0 };
    let q = if q < 1.0 { q } else { 1.0 };
    ((u < q) & (brightest > 0.0), 1.0 / if q > 0.0 { q } else { 1.0 })
}
