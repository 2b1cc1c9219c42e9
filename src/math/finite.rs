//! Lists of numbers that may hold NaN or infinity.

/// Are all numbers finite? Those that are not have the exponent of infinity. There is no branch, so that many are looked at
/// in one step.
pub fn all_finite(numbers: &[f32]) -> bool {
    const EXPONENT: u32 = f32::INFINITY.to_bits();
    let is_bad = |x: &f32| u32::from(x.to_bits() & EXPONENT == EXPONENT);
    numbers.iter().fold(0, |bad, x| bad | is_bad(x)) == 0
}

/// How many are NaN or infinite.
pub fn count_not_finite(numbers: &[f32]) -> usize {
    numbers.iter().filter(|x| !x.is_finite()).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nan_and_infinity_are_found_wherever_they_are() {
        for bad in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for at in 0..37 {
                let mut list = [f32::MAX, -f32::MAX, 1e-45, -0.0].repeat(10);
                assert!(all_finite(&list) && count_not_finite(&list) == 0);
                list[at] = bad;
                assert!(!all_finite(&list) && count_not_finite(&list) == 1, "{bad} at {at}");
            }
        }
        assert!(all_finite(&[]));
    }
}
