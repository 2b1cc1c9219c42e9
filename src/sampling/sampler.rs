//! Owen-scrambled Sobol points (Burley 2020, "Practical Hash-based Owen Scrambling", JCGT 9(4)).
//!
//! Dimensions are padded in sets of four: every set consists of the first four Sobol dimensions, whose projections have the
//! lowest discrepancy, independently shuffled and scrambled. A set is bit-identical to the crate `sobol_burley` for the
//! set's seed (to that crate's 23 bits), whose direction vectors it uses, but branch-free and without data-dependent table
//! lookups, so that loops over paths vectorise.

use super::hash::{hash32, unit};
use std::sync::OnceLock;

/// Length of a seed's sequence; further samples use another seed.
pub const SAMPLES_PER_SEED: u32 = 1 << 16;

/// The bit-reversed direction vectors of the third and fourth dimensions: `vectors[bit][dimension]`.
type DirectionVectors = [[u32; 2]; 16];

/// The seed of a pixel: a hash of (x, y, user seed).
#[inline(always)]
pub fn pixel_seed(x: u32, y: u32, seed: u32) -> u32 {
    hash32(hash32(hash32(seed).wrapping_add(x)).wrapping_add(y))
}

/// A sample's point of the Sobol sequence, whose dimensions are evaluated on demand.
#[derive(Clone, Copy, Debug)]
pub struct SobolPoint {
    /// Seed of the shuffles and scrambles.
    seed: u32,
    /// Bit-reversed index in the sequence, below [`SAMPLES_PER_SEED`].
    index_rev: u32,
}

impl SobolPoint {
    /// Sample `index` of the sequence with this seed.
    #[inline(always)]
    pub fn new(seed: u32, index: u32) -> SobolPoint {
        SobolPoint::of_branches(seed, index, 0)
    }

    /// The point of a sample that is split into 2^`branch_bits` branches, which are consecutive points of the sequence.
    #[inline(always)]
    pub fn of_branches(seed: u32, index: u32, branch_bits: u32) -> SobolPoint {
        let bits = SAMPLES_PER_SEED.trailing_zeros() - branch_bits;
        let epoch = index >> bits;
        let seed = if epoch == 0 { seed } else { hash32(seed.wrapping_add(epoch)) };
        SobolPoint { seed, index_rev: (index & ((1 << bits) - 1)).reverse_bits() }
    }

    #[inline(always)]
    pub fn branch(self, branch: u32, branch_bits: u32) -> SobolPoint {
        SobolPoint { index_rev: (self.index_rev >> branch_bits) | branch.reverse_bits(), ..self }
    }

    /// The point of the sample that this branch belongs to.
    #[inline(always)]
    pub fn parent(self, branch_bits: u32) -> SobolPoint {
        SobolPoint { index_rev: self.index_rev << branch_bits, ..self }
    }

    /// The seed and the bit-reversed index, for storage.
    #[inline(always)]
    pub fn to_parts(self) -> (u32, u32) {
        (self.seed, self.index_rev)
    }

    /// The point of [`SobolPoint::to_parts`].
    #[inline(always)]
    pub fn from_parts(seed: u32, index_rev: u32) -> SobolPoint {
        SobolPoint { seed, index_rev }
    }

    /// The coordinates in 0..1 of a set of four dimensions.
    #[inline(always)]
    pub fn sample_4d(self, dimensions: &Dimensions) -> [f32; 4] {
        let seed = dimensions.seed_of_set(self.seed);
        let bits = owen_scramble_rev(self.index_rev, hash32(seed ^ 0x79c6_8e4a));
        let index = bits.reverse_bits() & 0xffff;
        let mut sobol = [index, second_dimension_rev(index), 0, 0];
        for (bit, vector) in dimensions.vectors.iter().enumerate() {
            let on = ((bits << bit) as i32 >> 31) as u32;
            sobol[2] ^= on & vector[0];
            sobol[3] ^= on & vector[1];
        }
        let base = seed.wrapping_mul(0x9c8f_2d3b);
        let salts = [0x912f_69bau32, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8];
        let mut out = [0.0f32; 4];
        for d in 0..4 {
            out[d] = unit(owen_scramble_rev(sobol[d], hash32(base ^ salts[d])).reverse_bits());
        }
        out
    }
}

/// A set of four dimensions.
#[derive(Clone, Copy, Debug)]
pub struct Dimensions {
    vectors: DirectionVectors,
    salt: u32,
}

impl Dimensions {
    /// The set of dimensions `4 * set .. 4 * set + 4`.
    pub fn new(set: u32) -> Dimensions {
        Dimensions { vectors: *direction_vectors(), salt: hash32(set ^ 0x51ab_c0de) }
    }

    /// Decorrelates the sets.
    #[inline(always)]
    fn seed_of_set(&self, seed: u32) -> u32 {
        hash32(seed ^ self.salt)
    }
}

fn direction_vectors() -> &'static DirectionVectors {
    static VECTORS: OnceLock<DirectionVectors> = OnceLock::new();
    VECTORS.get_or_init(|| {
        // The sequence is linear over GF(2): the point of a single index bit is its direction vector.
        let vector = |bit: u32| [2, 3].map(|d| sobol_burley::parts::sobol_rev(1 << (31 - bit), d));
        std::array::from_fn(|bit| vector(bit as u32))
    })
}

/// The second Sobol dimension of an index below 2^16, bit-reversed: its generator matrix is Pascal's triangle modulo 2, the
/// product of four sparse matrices. (The first dimension's, bit-reversed, is the identity.)
#[inline(always)]
fn second_dimension_rev(mut x: u32) -> u32 {
    x ^= (x >> 1) & 0x5555;
    x ^= (x >> 2) & 0x3333;
    x ^= (x >> 4) & 0x0f0f;
    x ^ ((x >> 8) & 0x00ff)
}

/// Hash-based Owen scrambling of a bit-reversed number (Burley 2020; constants by Vegdahl 2021).
#[inline(always)]
fn owen_scramble_rev(mut n: u32, scramble: u32) -> u32 {
    n ^= n.wrapping_mul(0x3d20_adea);
    n = n.wrapping_add(scramble);
    n = n.wrapping_mul((scramble >> 16) | 1);
    n ^= n.wrapping_mul(0x0552_6c56);
    n ^ n.wrapping_mul(0x53a2_2864)
}

/// Base-2 logarithm of the largest edge of a region: 16 pixels.
pub(super) const MAX_EDGE_BITS: u32 = 4;

/// Maximum number of samples per pixel in Z order. Above, each pixel has a sequence of its own, so that rendering can be
/// resumed with another number of samples.
pub const MAX_Z_ORDER_SPP: u32 = 256;

/// Distributes Sobol points over the picture with blue-noise error: the pixels of a square region, in Morton (Z) order, use
/// consecutive runs of one sequence, each of the planned number of samples rounded up to a power of two (Ahmed, Wonka 2020,
/// "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of Pixels"; `ZSobolSampler`
/// of pbrt-v4).
///
/// A run aligned to its length is as well distributed as the start of the sequence, so each pixel's error is that of a
/// sequence of its own. So are the consecutive runs of 2x2, 4x4, .. pixels together, which lowers the error of the mean of
/// such a block.
///
/// Regions have 16x16 pixels, fewer where their runs exceed one sequence (from 257 points per pixel on, all branches
/// included), and each has its own seed. They are aligned to the picture, so that samples depend on their pixel only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ZSobolOrder {
    seed: u32,
    /// Base-2 logarithm of the length of a run.
    run_bits: u32,
    /// Base-2 logarithm of the edge of a region, pixels.
    edge_bits: u32,
}

impl ZSobolOrder {
    /// For `samples` per pixel, each split into `branches` paths, by the user's seed.
    pub fn new(seed: u32, samples: u32, branches: u32) -> ZSobolOrder {
        const MAX_BITS: u32 = SAMPLES_PER_SEED.trailing_zeros();
        let points = samples.saturating_mul(branches);
        let run_bits = (32 - points.saturating_sub(1).leading_zeros()).min(MAX_BITS);
        let edge_bits = ((MAX_BITS - run_bits) / 2).min(MAX_EDGE_BITS);
        let edge_bits = if samples > MAX_Z_ORDER_SPP { 0 } else { edge_bits };
        ZSobolOrder { seed, run_bits, edge_bits }
    }

    /// The seed of a pixel's sequence, and the index of its first sample there; the others follow.
    #[inline(always)]
    pub fn first(&self, x: u32, y: u32) -> (u32, u32) {
        let within = (1 << self.edge_bits) - 1;
        let seed = pixel_seed(x >> self.edge_bits, y >> self.edge_bits, self.seed);
        (seed, morton(x & within, y & within) << self.run_bits)
    }
}

/// The Morton code of `x` and `y`, below 16 each.
#[inline(always)]
pub(super) fn morton(x: u32, y: u32) -> u32 {
    let spread = |v: u32| {
        let v = (v | (v << 2)) & 0x33;
        (v | (v << 1)) & 0x55
    };
    spread(x) | (spread(y) << 1)
}

/// Decorrelates these sequences from those of [`ZSobolOrder`] with the same seed.
const SEED: u32 = 0x5f3a_9c41;

/// A sample count for each pixel (adaptive sampling).
///
/// As in [`ZSobolOrder`], the pixels of a 16x16 region use consecutive runs of one Sobol sequence in Morton order, each as
/// long as the pixel's sample count; any run of consecutive points is well distributed.
#[derive(Clone, Debug)]
pub struct AdaptiveSamples {
    seed: u32,
    width: u32,
    /// Sample count of each pixel, row by row.
    counts: Vec<u32>,
    /// Start of each pixel's run in its region's sequence.
    starts: Vec<u32>,
}

impl AdaptiveSamples {
    /// From sample counts by pixel, row by row. Fractions are rounded by error diffusion in Morton order.
    pub fn new(seed: u32, width: u32, samples: &[f32]) -> AdaptiveSamples {
        let height = samples.len() as u32 / width;
        let edge = 1u32 << MAX_EDGE_BITS;
        let mut map = AdaptiveSamples {
            seed: hash32(seed ^ SEED),
            width,
            counts: vec![0; samples.len()],
            starts: vec![0; samples.len()],
        };
        let mut order: Vec<(u32, u32)> = (0..edge).flat_map(|y| (0..edge).map(move |x| (x, y))).collect();
        order.sort_by_key(|&(x, y)| morton(x, y));
        let mut rounding_error = 0.5;
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
                let target = f64::from(samples[at]) + rounding_error;
                let count = target.floor().max(0.0);
                rounding_error = target - count;
                (map.counts[at], map.starts[at]) = (count as u32, next);
                next += count as u32;
            }
        }
        map
    }

    /// The seed of a pixel's sequence, the index of its first sample there, and its sample count.
    #[inline(always)]
    pub fn of_pixel(&self, x: u32, y: u32) -> (u32, u32, u32) {
        let at = y as usize * self.width as usize + x as usize;
        let seed = pixel_seed(x >> MAX_EDGE_BITS, y >> MAX_EDGE_BITS, self.seed);
        (seed, self.starts[at], self.counts[at])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn matches_sobol_burley() {
        for set in [0u32, 1, 2, 17, 63] {
            let dimensions = Dimensions::new(set);
            for seed in [0u32, 1, 77, 0xdead_beef] {
                for index in (0..SAMPLES_PER_SEED).step_by(977) {
                    let point = SobolPoint::new(seed, index).sample_4d(&dimensions);
                    let expected = sobol_burley::sample_4d(index, 0, dimensions.seed_of_set(seed));
                    // `sobol_burley` returns 23 bits, `sample_4d` 24.
                    let truncated = point.map(|v| (v * 8_388_608.0).floor() / 8_388_608.0);
                    assert_eq!(truncated, expected, "set {set} seed {seed} index {index}");
                }
            }
        }
    }

    #[test]
    fn first_two_dimensions_of_a_set_are_stratified() {
        // The first 4^k points of an Owen-scrambled Sobol sequence in its first two dimensions form a (0, 2k, 2)-net.
        let dimensions = Dimensions::new(0);
        let mut cells = [0u32; 256];
        for index in 0..256 {
            let [u, v, ..] = SobolPoint::new(42, index).sample_4d(&dimensions);
            cells[(u * 16.0) as usize * 16 + (v * 16.0) as usize] += 1;
        }
        assert!(cells.iter().all(|&n| n == 1));
    }

    #[test]
    fn branches_are_consecutive_points() {
        for (branch_bits, index) in [(0, 5), (1, 0), (2, 77), (4, 4095)] {
            let parent = SobolPoint::of_branches(7, index, branch_bits);
            for branch in 0..1 << branch_bits {
                let point = parent.branch(branch, branch_bits);
                let expected = SobolPoint::new(7, (index << branch_bits) + branch);
                assert_eq!(point.to_parts(), expected.to_parts(), "{branch} of {branch_bits} bits");
                assert_eq!(point.parent(branch_bits).to_parts(), parent.to_parts());
            }
        }
    }

    #[test]
    fn sets_and_seeds_are_decorrelated() {
        let first = Dimensions::new(0);
        let padded = Dimensions::new(1);
        let (mut same, mut mean) = (0, 0.0);
        for index in 0..4096 {
            let a = SobolPoint::new(3, index).sample_4d(&first);
            let b = SobolPoint::new(3, index).sample_4d(&padded);
            let c = SobolPoint::new(3, index + SAMPLES_PER_SEED).sample_4d(&first);
            same += u32::from(a[0] == b[0]) + u32::from(a[0] == c[0]);
            mean += f64::from(b[2]) / 4096.0;
        }
        assert!(same < 3, "{same} coincidences");
        assert!((mean - 0.5).abs() < 1e-3, "{mean}");
    }

    /// The points of all samples of a block of pixels in two dimensions.
    fn points(order: ZSobolOrder, x0: u32, y0: u32, edge: u32, samples: u32) -> Vec<[f32; 2]> {
        let dimensions = Dimensions::new(3);
        let pixels = (0..edge).flat_map(|y| (0..edge).map(move |x| (x0 + x, y0 + y)));
        let of_pixel = |(x, y)| {
            let (seed, first) = order.first(x, y);
            (0..samples).map(move |s| {
                let [u, v, ..] = SobolPoint::new(seed, first + s).sample_4d(&dimensions);
                [u, v]
            })
        };
        pixels.flat_map(of_pixel).collect()
    }

    /// Do points form a (0, m, 2)-net, with one point in each elementary interval?
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
        let order = ZSobolOrder::new(9, 16, 1);
        for edge in [1, 2, 4, 8, 16] {
            assert!(is_net(&points(order, 32, 48, edge, 16)), "{edge}");
        }
        // Unaligned blocks are not.
        assert!(!is_net(&points(order, 33, 48, 4, 16)));
        // The first 2^k samples of each pixel are.
        assert!((0..5).all(|bits| is_net(&points(order, 5, 7, 1, 1 << bits))));
    }

    #[test]
    fn pixels_of_a_region_use_disjoint_runs() {
        for samples in [1, 3, 100, 256, 257, 1000, 20_000, 70_000, u32::MAX] {
            let order = ZSobolOrder::new(1, samples, 1);
            let mut starts = HashSet::new();
            for (x, y) in (0..16).flat_map(|y| (0..16).map(move |x| (x, y))) {
                let (seed, first) = order.first(x, y);
                let run = 1 << order.run_bits;
                assert!(first % run == 0 && first + run <= SAMPLES_PER_SEED, "{samples}");
                assert!(run >= samples.min(SAMPLES_PER_SEED), "{samples}");
                assert!(starts.insert((seed, first)), "{samples}");
            }
        }
        assert_eq!(ZSobolOrder::new(1, 256, 1).edge_bits, 4);
        assert_eq!(ZSobolOrder::new(1, 256, 2).edge_bits, 3);
        assert_eq!(ZSobolOrder::new(1, 70_000, 1).edge_bits, 0);
        // Above the limit the planned number of samples has no effect.
        let [few, many] = [257, 5000].map(|samples| ZSobolOrder::new(1, samples, 4).first(5, 6));
        assert_eq!(few, many);
    }
}
