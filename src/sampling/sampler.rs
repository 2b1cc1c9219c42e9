//! Owen-scrambled Sobol points (Burley 2020, "Practical Hash-based Owen Scrambling", JCGT 9(4)), evaluated for many paths
//! at a time.
//!
//! Dimensions come in sets of four. Every set consists of the first four Sobol dimensions, whose projections are the
//! best, with a shuffle and a scramble of its own ("padding", as Burley recommends). A set is that of the crate
//! `sobol_burley` for the set's seed, to the last bit that it gives, from its own direction vectors. What differs is the
//! shape of the computation: a fixed number of steps without a branch or a table lookup that depends on the path, so
//! that a loop over paths vectorises.

use super::hash::{hash32, unit};
use std::sync::OnceLock;

/// Samples that one seed offers; beyond them, a new seed starts over.
pub const SAMPLES_PER_SEED: u32 = 1 << 16;

/// The direction vectors of the third and fourth dimension, bits reversed: `vectors[bit][dimension]`.
type DirectionVectors = [[u32; 2]; 16];

/// The seed of a pixel: another for each (x, y, user seed).
#[inline(always)]
pub fn pixel_seed(x: u32, y: u32, seed: u32) -> u32 {
    hash32(hash32(hash32(seed).wrapping_add(x)).wrapping_add(y))
}

/// One sample of one pixel: a point of as many dimensions as are asked for.
#[derive(Clone, Copy, Debug)]
pub struct SobolPoint {
    /// Seeds shuffles and scrambles.
    seed: u32,
    /// Index in the sequence, below [`SAMPLES_PER_SEED`], bits reversed.
    index_rev: u32,
}

impl SobolPoint {
    /// Sample `index` of the sequence with this seed.
    #[inline(always)]
    pub fn new(seed: u32, index: u32) -> SobolPoint {
        SobolPoint::of_branches(seed, index, 0)
    }

    /// The same where each sample has 2^`branch_bits` branches, which have as many points of the sequence to themselves.
    #[inline(always)]
    pub fn of_branches(seed: u32, index: u32, branch_bits: u32) -> SobolPoint {
        let bits = SAMPLES_PER_SEED.trailing_zeros() - branch_bits;
        let epoch = index >> bits;
        let seed = if epoch == 0 { seed } else { hash32(seed.wrapping_add(epoch)) };
        SobolPoint { seed, index_rev: (index & ((1 << bits) - 1)).reverse_bits() }
    }

    /// The point of a branch.
    #[inline(always)]
    pub fn branch(self, branch: u32, branch_bits: u32) -> SobolPoint {
        SobolPoint { index_rev: (self.index_rev >> branch_bits) | branch.reverse_bits(), ..self }
    }

    /// The point that this one is a branch of.
    #[inline(always)]
    pub fn trunk(self, branch_bits: u32) -> SobolPoint {
        SobolPoint { index_rev: self.index_rev << branch_bits, ..self }
    }

    /// The two numbers that the point is made of, for storage.
    #[inline(always)]
    pub fn to_parts(self) -> (u32, u32) {
        (self.seed, self.index_rev)
    }

    /// The point again from its parts.
    #[inline(always)]
    pub fn from_parts(seed: u32, index_rev: u32) -> SobolPoint {
        SobolPoint { seed, index_rev }
    }

    /// Four coordinates in 0..1 of a set.
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

/// One set of four dimensions, ready to evaluate.
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

    /// Another seed for each set.
    #[inline(always)]
    fn seed_of_set(&self, seed: u32) -> u32 {
        hash32(seed ^ self.salt)
    }
}

fn direction_vectors() -> &'static DirectionVectors {
    static VECTORS: OnceLock<DirectionVectors> = OnceLock::new();
    VECTORS.get_or_init(|| {
        // The sequence is linear over bits: the point of a single index bit is its direction vector.
        let vector = |bit: u32| [2, 3].map(|d| sobol_burley::parts::sobol_rev(1 << (31 - bit), d));
        std::array::from_fn(|bit| vector(bit as u32))
    })
}

/// The second Sobol dimension of an index below 2^16, bits reversed: its matrix is Pascal's triangle modulo 2, the
/// product of four sparse ones. (The first dimension's, bits reversed, is the identity.)
#[inline(always)]
fn second_dimension_rev(mut x: u32) -> u32 {
    x ^= (x >> 1) & 0x5555;
    x ^= (x >> 2) & 0x3333;
    x ^= (x >> 4) & 0x0f0f;
    x ^ ((x >> 8) & 0x00ff)
}

/// Nested uniform scrambling of a bit-reversed number by a hash (Burley 2020; constants by Vegdahl 2021).
#[inline(always)]
fn owen_scramble_rev(mut n: u32, scramble: u32) -> u32 {
    n ^= n.wrapping_mul(0x3d20_adea);
    n = n.wrapping_add(scramble);
    n = n.wrapping_mul((scramble >> 16) | 1);
    n ^= n.wrapping_mul(0x0552_6c56);
    n ^ n.wrapping_mul(0x53a2_2864)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_library_it_replaces() {
        for set in [0u32, 1, 2, 17, 63] {
            let dimensions = Dimensions::new(set);
            for seed in [0u32, 1, 77, 0xdead_beef] {
                for index in (0..SAMPLES_PER_SEED).step_by(977) {
                    let ours = SobolPoint::new(seed, index).sample_4d(&dimensions);
                    let theirs = sobol_burley::sample_4d(index, 0, dimensions.seed_of_set(seed));
                    // The library gives 23 bits, we give 24.
                    let cut = ours.map(|v| (v * 8_388_608.0).floor() / 8_388_608.0);
                    assert_eq!(cut, theirs, "set {set} seed {seed} index {index}");
                }
            }
        }
    }

    #[test]
    fn every_pair_of_dimensions_in_a_set_is_stratified() {
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
    fn branches_are_points_that_follow_each_other() {
        for (branch_bits, index) in [(0, 5), (1, 0), (2, 77), (4, 4095)] {
            let trunk = SobolPoint::of_branches(7, index, branch_bits);
            for branch in 0..1 << branch_bits {
                let point = trunk.branch(branch, branch_bits);
                let there = SobolPoint::new(7, (index << branch_bits) + branch);
                assert_eq!(point.to_parts(), there.to_parts(), "{branch} of {branch_bits} bits");
                assert_eq!(point.trunk(branch_bits).to_parts(), trunk.to_parts());
            }
        }
    }

    #[test]
    fn sets_and_samples_beyond_one_seed_are_new() {
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
}
