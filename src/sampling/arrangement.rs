//! Which points of which sequences the samples of a picture are.

use super::sampler::{SAMPLES_PER_SEED, pixel_seed};

/// Largest edge of a region, in bits: 16 pixels.
pub(super) const MOST_EDGE_BITS: u32 = 4;

/// Most samples a pixel that are arranged with those of other pixels. Beyond, each pixel has a sequence of its own, whatever
/// the number: rendering may go on from any to any other.
pub const MOST_ARRANGED: u32 = 256;

/// Arranges samples over the picture: a square region of pixels shares one Sobol sequence. Its pixels, in Morton order,
/// take runs of the sequence one after the other, each as long as the next power of two of the samples that are planned.
///
/// A run that begins at a multiple of its length is as good a set of points as the sequence's first ones, so each pixel's
/// error is that of a sequence of its own. And so are the runs of 2x2, 4x4, .. pixels together, since they follow each
/// other: their samples complement each other, and the error of the mean over such a block is lower (Ahmed, Wonka 2020,
/// "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of Pixels").
///
/// Regions have 16x16 pixels, fewer where so many runs do not fit into one sequence (from 257 points a pixel on, those of
/// all paths of its samples), and each a seed of its own. They lie at fixed places of the picture, so that samples depend on nothing but their pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrangement {
    seed: u32,
    /// Of the length of a run.
    run_bits: u32,
    /// Of the edge of a region.
    edge_bits: u32,
}

impl Arrangement {
    /// For this many samples a pixel, by the user's seed, with so many paths from each.
    pub fn new(seed: u32, samples: u32, branches: u32) -> Arrangement {
        const MOST_BITS: u32 = SAMPLES_PER_SEED.trailing_zeros();
        let points = samples.saturating_mul(branches);
        let run_bits = (32 - points.saturating_sub(1).leading_zeros()).min(MOST_BITS);
        let edge_bits = ((MOST_BITS - run_bits) / 2).min(MOST_EDGE_BITS);
        let edge_bits = if samples > MOST_ARRANGED { 0 } else { edge_bits };
        Arrangement { seed, run_bits, edge_bits }
    }

    /// A pixel's seed, and the index of its first sample in the sequence of that seed; the others follow.
    #[inline(always)]
    pub fn first(&self, x: u32, y: u32) -> (u32, u32) {
        let within = (1 << self.edge_bits) - 1;
        let seed = pixel_seed(x >> self.edge_bits, y >> self.edge_bits, self.seed);
        (seed, morton(x & within, y & within) << self.run_bits)
    }
}

/// The bits of `x` and `y`, below 16 each, by turns.
#[inline(always)]
pub(super) fn morton(x: u32, y: u32) -> u32 {
    let spread = |v: u32| {
        let v = (v | (v << 2)) & 0x33;
        (v | (v << 1)) & 0x55
    };
    spread(x) | (spread(y) << 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::sampler::{Dimensions, SobolPoint};
    use std::collections::HashSet;

    /// The points of all samples of a block of pixels in the first two dimensions.
    fn points(arrangement: Arrangement, x0: u32, y0: u32, edge: u32, samples: u32) -> Vec<[f32; 2]> {
        let dimensions = Dimensions::new(3);
        let pixels = (0..edge).flat_map(|y| (0..edge).map(move |x| (x0 + x, y0 + y)));
        let of_pixel = |(x, y)| {
            let (seed, first) = arrangement.first(x, y);
            (0..samples).map(move |s| {
                let [u, v, ..] = SobolPoint::new(seed, first + s).sample_4d(&dimensions);
                [u, v]
            })
        };
        pixels.flat_map(of_pixel).collect()
    }

    /// Do points fall into different cells of every grid of as many cells as there are points?
    fn is_net(points: &[[f32; 2]]) -> bool {
        let bits = points.len().trailing_zeros();
        (0..=bits).all(|split| {
            let cell = |u: f32, bits: u32| (f64::from(u) * f64::from(1u32 << bits)) as u32;
            let cells: HashSet<_> =
                points.iter().map(|&[u, v]| (cell(u, split), cell(v, bits - split))).collect();
            cells.len() == points.len()
        })
    }

    #[test]
    fn pixels_and_blocks_of_pixels_are_stratified() {
        let arrangement = Arrangement::new(9, 16, 1);
        for edge in [1, 2, 4, 8, 16] {
            assert!(is_net(&points(arrangement, 32, 48, edge, 16)), "{edge}");
        }
        // Blocks that cross the grid are not.
        assert!(!is_net(&points(arrangement, 33, 48, 4, 16)));
        // Any first samples of a power of two are, in each pixel.
        assert!((0..5).all(|bits| is_net(&points(arrangement, 5, 7, 1, 1 << bits))));
    }

    #[test]
    fn samples_of_a_region_are_all_different() {
        for samples in [1, 3, 100, 256, 257, 1000, 20_000, 70_000, u32::MAX] {
            let arrangement = Arrangement::new(1, samples, 1);
            let mut starts = HashSet::new();
            for (x, y) in (0..16).flat_map(|y| (0..16).map(move |x| (x, y))) {
                let (seed, first) = arrangement.first(x, y);
                let run = 1 << arrangement.run_bits;
                assert!(first % run == 0 && first + run <= SAMPLES_PER_SEED, "{samples}");
                assert!(run >= samples.min(SAMPLES_PER_SEED), "{samples}");
                assert!(starts.insert((seed, first)), "{samples}");
            }
        }
        assert_eq!(Arrangement::new(1, 256, 1).edge_bits, 4);
        assert_eq!(Arrangement::new(1, 256, 2).edge_bits, 3);
        assert_eq!(Arrangement::new(1, 70_000, 1).edge_bits, 0);
        // From there on, what is planned doesn't matter.
        let [some, more] = [257, 5000].map(|samples| Arrangement::new(1, samples, 4).first(5, 6));
        assert_eq!(some, more);
    }
}
