//! Light that few paths carry: what the estimate of the noise can't know of.
//!
//! Where a path is improbable but bright, as through glass to a small lamp, a picture of few samples lacks its light or has it in single
//! pixels. The variance of such pixels is that of the paths that were found, and says nothing of those that weren't. They show by what
//! the brightest pass of a pixel adds to what its other passes and its neighbours have, the excess: its largest values follow a power law,
//! `P(excess > x) ~ x^-a`, whose variance is infinite for `a < 2`. Hill's estimate (1975, "A Simple General Approach to Inference About
//! the Tail of a Distribution") of `a` from the `k` largest is `k / sum(ln(x_i / x_k))`.

use crate::color::luminance;

/// Share of the pixels, those of the largest excess, that the tail index is estimated from; and the fewest.
const TAIL: f64 = 0.002;
const MIN: usize = 16;

/// Tail index below which paths are called rare: the variance is infinite below 2, and the estimate from few values is uncertain.
const HEAVY: f64 = 1.6;

/// Share of the picture's light above which such a tail is reported, and a single pixel whatever the tail.
const MIN_SHARE: f64 = 0.01;

/// Pixels along each side of the parts of a picture that are compared.
const PART: usize = 32;

/// Light that single paths brought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RarePaths {
    /// Its share of the light of the picture, 0 to 1.
    pub share: f64,
    /// Where most of it is: a pixel, from the upper left corner of what was rendered.
    pub pixel: [u32; 2],
    /// Estimate of the tail index of what they bring.
    pub tail_index: f64,
}

/// Looks for rare paths: `means` are the pixels, row by row, and `robust` what they are without what a single pass brought.
pub(super) fn find(means: &[[f32; 3]], robust: &[[f32; 3]], width: usize) -> Option<RarePaths> {
    let excess =
        |(mean, robust): (&[f32; 3], &[f32; 3])| f64::from(luminance(*mean) - luminance(*robust)).max(0.0);
    let all: Vec<f64> = means.iter().zip(robust).map(excess).collect();
    let light: f64 = means.iter().map(|mean| f64::from(luminance(*mean)).max(0.0)).sum();
    let count = ((all.len() as f64 * TAIL) as usize).max(MIN);
    if all.len() <= count || light <= 0.0 {
        return None;
    }
    let mut tail = all.clone();
    let (_, &mut least, larger) = tail.select_nth_unstable_by(all.len() - 1 - count, f64::total_cmp);
    // Where fewer pixels have any, it is as heavy as can be.
    let logarithms: f64 = larger.iter().map(|x| (x / least).ln()).sum();
    let tail_index = if least > 0.0 { count as f64 / logarithms } else { 0.0 };
    let share = larger.iter().sum::<f64>() / light;
    let largest = larger.iter().copied().fold(0.0, f64::max) / light;
    (tail_index < HEAVY && share >= MIN_SHARE || largest >= MIN_SHARE).then(|| {
        let at = brightest(&all, width);
        RarePaths { share, pixel: [(at % width) as u32, (at / width) as u32], tail_index }
    })
}

/// The pixel of the largest excess in the part of the picture that has most of it.
fn brightest(excess: &[f64], width: usize) -> usize {
    let columns = width.div_ceil(PART);
    let part = |at: usize| at / width / PART * columns + at % width / PART;
    let mut sums = vec![0.0; excess.len().div_ceil(width).div_ceil(PART) * columns];
    excess.iter().enumerate().for_each(|(at, x)| sums[part(at)] += x);
    let most = (0..sums.len()).max_by(|&a, &b| sums[a].total_cmp(&sums[b]));
    let inside = (0..excess.len()).filter(|&at| Some(part(at)) == most);
    inside.max_by(|&a, &b| excess[a].total_cmp(&excess[b])).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash::SplitMix64;

    const WIDTH: usize = 160;
    const HEIGHT: usize = 100;

    /// A grey picture with an excess of each pixel by a number from 0 to 1.
    fn found(seed: u64, excess: impl Fn(f64) -> f64) -> Option<RarePaths> {
        let mut random = SplitMix64::new(seed);
        let robust = vec![[0.5; 3]; WIDTH * HEIGHT];
        let mut mean = || [(0.5 + excess(random.next_unit())) as f32; 3];
        let means: Vec<[f32; 3]> = robust.iter().map(|_| mean()).collect();
        find(&means, &robust, WIDTH)
    }

    /// Power laws with their closed inverses: `x = least u^(-1 / a)`.
    #[test]
    fn heavy_tails_are_found() {
        for seed in 0..20 {
            let heavy = found(seed, |u| 0.01 * u.powf(-1.0)).expect("an infinite variance");
            assert!((0.6..1.6).contains(&heavy.tail_index) && heavy.share > 0.01, "{heavy:?}");
            assert_eq!(found(seed, |u| 0.01 * u.powf(-1.0 / 4.0)), None);
            // Exponential, as the brightest of some passes of plain noise.
            assert_eq!(found(seed, |u| -0.1 * u.ln()), None);
        }
        assert_eq!(found(1, |_| 0.0), None);
    }

    #[test]
    fn one_pixel_may_hold_too_much() {
        let robust = vec![[0.5; 3]; WIDTH * HEIGHT];
        let with = |excess: f32| {
            let mut means = robust.clone();
            means[40 * WIDTH + 30] = [0.5 + excess; 3];
            find(&means, &robust, WIDTH)
        };
        // Of 8,000 in all.
        let found = with(400.0).expect("a twentieth");
        assert!((found.share - 400.0 / 8400.0).abs() < 1e-6 && found.pixel == [30, 40], "{found:?}");
        assert_eq!(with(40.0), None);
    }

    #[test]
    fn the_place_is_where_most_of_it_is() {
        let robust = vec![[0.5; 3]; WIDTH * HEIGHT];
        let mut means = robust.clone();
        let mut random = SplitMix64::new(7);
        for (i, mean) in means.iter_mut().enumerate().filter(|(i, _)| i % 7 == 0) {
            let is_near = (i % WIDTH).abs_diff(110) < 10 && (i / WIDTH).abs_diff(70) < 10;
            let size = if is_near { 1.0 } else { 0.01 };
            *mean = [0.5 + (size * random.next_unit().powf(-1.0)) as f32; 3];
        }
        let found = find(&means, &robust, WIDTH).expect("rare paths");
        assert!(found.pixel[0].abs_diff(110) < 10 && found.pixel[1].abs_diff(70) < 10, "{found:?}");
    }

    #[test]
    fn small_and_black_pictures_have_none() {
        assert_eq!(find(&[], &[], 1), None);
        assert_eq!(find(&[[1.0; 3]; 9], &[[0.0; 3]; 9], 3), None);
        assert_eq!(find(&[[0.0; 3]; 900], &[[0.0; 3]; 900], 30), None);
    }
}
