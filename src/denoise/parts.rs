//! Parts of a picture, which add up to it.

use super::planes::Color;

/// Relative difference up to which sums are the same, of half-precision files too.
const ROUNDING: f32 = 4e-3;
/// The share of pixels in which parts must add up to the picture.
const MAX: f64 = 0.99;

/// Makes denoised parts add up to the denoised picture, if the noisy ones add up to the noisy picture: each pixel's parts
/// change by one factor; where they are black, they share what is missing alike.
pub(super) fn add_up(
    noisy: Color,
    noisy_parts: &[Color],
    denoised: &[Vec<f32>; 3],
    parts: &mut [[Vec<f32>; 3]],
) {
    let add_up_at = |c: usize, i: usize| {
        let sum: f32 = noisy_parts.iter().map(|part| part[c][i]).sum();
        (sum - noisy[c][i]).abs() <= ROUNDING * noisy[c][i].abs().max(1e-4)
    };
    let values = 3 * noisy[0].len();
    let equal: usize = (0..3).map(|c| (0..noisy[c].len()).filter(|&i| add_up_at(c, i)).count()).sum();
    if (equal as f64) < MAX * values as f64 {
        return;
    }
    for c in 0..3 {
        for (i, whole) in denoised[c].iter().enumerate() {
            let sum: f32 = parts.iter().map(|part| part[c][i]).sum();
            if sum > 1e-12 {
                let factor = whole / sum;
                parts.iter_mut().for_each(|part| part[c][i] *= factor);
            } else {
                let share = whole / parts.len() as f32;
                parts.iter_mut().for_each(|part| part[c][i] = share);
            }
        }
    }
}
