//! Samples allotted to pixels: more where the picture needs them.

use super::arrangement::{MOST_EDGE_BITS as EDGE_BITS, morton};
use super::hash::hash32;
use super::sampler::pixel_seed;

/// What separates these sequences from those of an even arrangement with the same seed.
const SEED: u32 = 0x5f3a_9c41;

/// How many samples each pixel of a picture takes, besides those that all have.
///
/// As in an [`Arrangement`](super::Arrangement), the pixels of a region of 16x16 take runs of one Sobol sequence in Morton
/// order, each as long as its samples are many; a run of points that follow each other is well spread wherever it begins.
#[derive(Clone, Debug)]
pub struct Allotment {
    seed: u32,
    width: u32,
    /// Samples that all pixels have before.
    earlier: u32,
    /// Planned samples of the average pixel.
    mean: u32,
    /// Samples of each pixel, row by row.
    counts: Vec<u32>,
    /// Where each pixel's run begins in its region's sequence.
    starts: Vec<u32>,
}

impl Allotment {
    /// Allots about so many samples to the pixels of a picture, row by row, with `mean` to the average pixel, after all have
    /// `earlier` samples. Fractions are rounded so that the sum over neighbours stays.
    pub fn new(seed: u32, width: u32, earlier: u32, mean: u32, samples: &[f32]) -> Allotment {
        let height = samples.len() as u32 / width;
        let edge = 1u32 << EDGE_BITS;
        let mut allotment = Allotment {
            seed: hash32(seed ^ SEED),
            width,
            earlier,
            mean,
            counts: vec![0; samples.len()],
            starts: vec![0; samples.len()],
        };
        let mut order: Vec<(u32, u32)> = (0..edge).flat_map(|y| (0..edge).map(move |x| (x, y))).collect();
        order.sort_by_key(|&(x, y)| morton(x, y));
        // What rounding left over so far.
        let mut rest = 0.5;
        for (y0, x0) in (0..height)
            .step_by(edge as usize)
            .flat_map(|y| (0..width).step_by(edge as usize).map(move |x| (y, x)))
        {
            let mut next = 0;
            for &(dx, dy) in &order {
                let (x, y) = (x0 + dx, y0 + dy);
                if x >= width || y >= height {
                    continue;
                }
                let at = (y * width + x) as usize;
                let wanted = f64::from(samples[at]) + rest;
                let count = wanted.floor().max(0.0);
                rest = wanted - count;
                (allotment.counts[at], allotment.starts[at]) = (count as u32, next);
                next += count as u32;
            }
        }
        allotment
    }

    /// What pixel (`x`, `y`) takes in a pass in which the average pixel takes `samples` from sample `first_sample` on: the
    /// seed of its sequence, the index of the first sample there, and how many follow.
    #[inline(always)]
    pub fn of_pixel(&self, x: u32, y: u32, first_sample: u32, samples: u32) -> (u32, u32, u32) {
        let at = y as usize * self.width as usize + x as usize;
        let from = first_sample - self.earlier;
        let until =
            |sample: u32| (u64::from(self.counts[at]) * u64::from(sample) / u64::from(self.mean)) as u32;
        let (first, end) = (until(from), until(from + samples));
        let seed = pixel_seed(x >> EDGE_BITS, y >> EDGE_BITS, self.seed);
        (seed, self.starts[at] + first, end - first)
    }
}
