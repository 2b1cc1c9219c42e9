//! Sampling: the Sobol sampler, warps with their densities, tabulated distributions, and multiple importance sampling
//! weights. Samplers are tested with the chi-square test of [`chi2`].
//!
//! Conventions: `u` is uniform in `[0, 1)` per component. Densities name their measure. Samplers call no libm and
//! (apart from table searches) have no data-dependent branches, so that loops over paths vectorise.

mod cells;
#[doc(hidden)]
pub mod chi2;
pub mod distribution;
pub mod hash;
pub mod sampler;
pub mod warp;

pub use cells::CellDistribution;
pub use distribution::AliasTable;
pub use distribution::{BilinearDistribution, DistributionSample, DistributionSamples};
pub use sampler::{AdaptiveSamples, MAX_Z_ORDER_SPP, ZSobolOrder};

/// The power heuristic (Veach 1997, section 9.2) with exponent 2 for one sample of each of two strategies: the MIS weight of
/// a sample with density `pdf`, where `other` is the other strategy's density in the same measure. 0 where `pdf` is 0.
/// Computed from the ratio of the densities, so that squares neither overflow nor underflow.
#[inline(always)]
pub fn power_heuristic(pdf: f32, other: f32) -> f32 {
    let large = pdf >= other;
    let (numerator, denominator) = if large { (other, pdf) } else { (pdf, other) };
    let ratio = numerator / if denominator > 0.0 { denominator } else { 1.0 };
    let squared = ratio * ratio;
    let weight = (if large { 1.0 } else { squared }) / (1.0 + squared);
    if pdf > 0.0 { weight } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_heuristic_weights_sum_to_one() {
        for (a, b) in [(1.0, 1.0), (1e-30, 1e30), (3e38, 2e38), (1e-38, 0.0), (0.3, 0.7)] {
            let sum = power_heuristic(a, b) + power_heuristic(b, a);
            assert!((sum - 1.0).abs() < 1e-6, "{a} {b}: {sum}");
        }
        assert_eq!(power_heuristic(0.0, 0.0), 0.0);
        assert!((power_heuristic(1.0, 2.0) - 0.2).abs() < 1e-7);
    }
}
