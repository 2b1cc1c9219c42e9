//! Multiple importance sampling weights (Veach 1997, section 9.2).

/// The power heuristic with exponent 2 for one sample of each of two strategies: the weight of a sample drawn with
/// density `pdf` where the other strategy would have had density `other`, both in one measure. 0 where `pdf` is 0.
/// Written with the ratio of the densities, so that squares neither overflow nor vanish.
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
    fn weights_of_both_strategies_add_up_to_one() {
        for (a, b) in [(1.0, 1.0), (1e-30, 1e30), (3e38, 2e38), (1e-38, 0.0), (0.3, 0.7)] {
            let sum = power_heuristic(a, b) + power_heuristic(b, a);
            assert!((sum - 1.0).abs() < 1e-6, "{a} {b}: {sum}");
        }
        assert_eq!(power_heuristic(0.0, 0.0), 0.0);
        assert!((power_heuristic(1.0, 2.0) - 0.2).abs() < 1e-7);
    }
}
