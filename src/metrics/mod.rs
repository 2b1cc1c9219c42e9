//! How far a picture is from a reference: errors, and a statistical test of agreement.

mod flip;
mod pixels;

pub use flip::{Flip, flip};

use crate::color::srgb_from_linear;
use crate::image::Image;
use pixels::{assert_same_size, pixels, rgb};

/// Edge of the blocks of [`z_test`], pixels.
pub const BLOCK: usize = 8;

/// Errors of a picture against a reference, over all pixels and channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Square root of the mean squared difference.
    pub rmse: f64,
    /// mean((a - r)^2 / (r^2 + 0.01)).
    pub rel_mse: f64,
    /// Mean of the picture by channel.
    pub mean: [f64; 3],
    /// Mean of the reference by channel.
    pub reference_mean: [f64; 3],
}

impl Errors {
    /// Mean of the picture over mean of the reference, by channel.
    pub fn mean_ratio(&self) -> [f64; 3] {
        std::array::from_fn(|c| self.mean[c] / self.reference_mean[c])
    }
}

/// One channel's verdict of [`z_test`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelTest {
    /// Mean of the two pictures.
    pub mean: f64,
    /// Mean of the reference.
    pub reference: f64,
    /// Standard deviation of the difference of the means.
    pub sigma: f64,
}

impl ChannelTest {
    /// Difference of the means in standard deviations; 0 where there is neither difference nor deviation.
    pub fn z(&self) -> f64 {
        in_deviations(self.mean - self.reference, self.sigma)
    }
}

/// A difference in standard deviations. Exact numbers that agree are 0 deviations apart, ones that don't infinitely many.
fn in_deviations(difference: f64, sigma: f64) -> f64 {
    if difference == 0.0 && sigma == 0.0 { 0.0 } else { difference / sigma }
}

/// The verdict of [`z_test`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZTest {
    /// By channel.
    pub channels: [ChannelTest; 3],
    /// Share of blocks that differ by more than 3 standard deviations (0.27 % by chance).
    pub beyond_3_sigma: f64,
    /// Share of blocks that differ by more than 5 standard deviations.
    pub beyond_5_sigma: f64,
}

impl ZTest {
    /// Means within 4 standard deviations and at most 2 % of the blocks beyond 3.
    pub fn agrees(&self) -> bool {
        self.channels.iter().all(|c| c.z().abs() < 4.0) && self.beyond_3_sigma <= 0.02
    }
}

/// Errors of `a` against `reference`, which has the same size.
pub fn errors(a: &Image, reference: &Image) -> Errors {
    assert_same_size(&[a, reference]);
    let (mut square, mut relative) = (0.0, 0.0);
    let (mut mean, mut reference_mean) = ([0.0; 3], [0.0; 3]);
    for (x, y) in pixels(a) {
        let (p, r) = (rgb(a, x, y), rgb(reference, x, y));
        for c in 0..3 {
            let d = (p[c] - r[c]).powi(2);
            square += d;
            relative += d / (r[c] * r[c] + 0.01);
            mean[c] += p[c];
            reference_mean[c] += r[c];
        }
    }
    let n = f64::from(a.width) * f64::from(a.height);
    Errors {
        rmse: (square / (3.0 * n)).sqrt(),
        rel_mse: relative / (3.0 * n),
        mean: mean.map(|m| m / n),
        reference_mean: reference_mean.map(|m| m / n),
    }
}

/// Tests whether a picture agrees with a converged reference. `a` and `b` differ by seed only, which gives their own
/// variance, and their pixels are independent of each other (no paths are shared); `variance` is that of the reference's
/// pixels. Blocks of 8x8 pixels make the estimate fair; rows and columns
/// that fill no block count for the means only. All four have the same size. `None` if that is less than a block.
pub fn z_test(a: &Image, b: &Image, reference: &Image, variance: &Image) -> Option<ZTest> {
    assert_same_size(&[a, b, reference, variance]);
    let (columns, rows) = (a.width as usize / BLOCK, a.height as usize / BLOCK);
    if columns * rows == 0 {
        return None;
    }
    let n = f64::from(a.width) * f64::from(a.height);
    let mut channels = [ChannelTest { mean: 0.0, reference: 0.0, sigma: 0.0 }; 3];
    for (x, y) in pixels(a) {
        let sample = Sample::at(a, b, reference, variance, x, y);
        for (c, test) in channels.iter_mut().enumerate() {
            test.mean += sample.mean[c] / n;
            test.reference += sample.reference[c] / n;
            // The variance of the mean, summed; its root comes below.
            test.sigma += (sample.own[c] + sample.variance[c]) / n / n;
        }
    }
    for test in &mut channels {
        test.sigma = test.sigma.sqrt();
    }
    let (mut beyond_3, mut beyond_5) = (0u32, 0u32);
    for (column, row) in (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row))) {
        let z = block_z([a, b, reference, variance], column, row);
        beyond_3 += z.iter().filter(|z| z.abs() > 3.0).count() as u32;
        beyond_5 += z.iter().filter(|z| z.abs() > 5.0).count() as u32;
    }
    let share = |count: u32| f64::from(count) / (3 * columns * rows) as f64;
    Some(ZTest { channels, beyond_3_sigma: share(beyond_3), beyond_5_sigma: share(beyond_5) })
}

/// What one pixel brings to the test, by channel.
struct Sample {
    mean: [f64; 3],
    reference: [f64; 3],
    /// Variance of `mean`: (a - b)^2 / 4.
    own: [f64; 3],
    variance: [f64; 3],
}

impl Sample {
    fn at(a: &Image, b: &Image, reference: &Image, variance: &Image, x: u32, y: u32) -> Sample {
        let (p, q) = (rgb(a, x, y), rgb(b, x, y));
        Sample {
            mean: std::array::from_fn(|c| 0.5 * (p[c] + q[c])),
            reference: rgb(reference, x, y),
            own: std::array::from_fn(|c| (p[c] - q[c]).powi(2) / 4.0),
            variance: rgb(variance, x, y),
        }
    }
}

fn block_z([a, b, reference, variance]: [&Image; 4], column: usize, row: usize) -> [f64; 3] {
    let size = (BLOCK * BLOCK) as f64;
    let (mut difference, mut spread) = ([0.0; 3], [0.0; 3]);
    for (i, j) in (0..BLOCK).flat_map(|j| (0..BLOCK).map(move |i| (i, j))) {
        let (x, y) = ((column * BLOCK + i) as u32, (row * BLOCK + j) as u32);
        let sample = Sample::at(a, b, reference, variance, x, y);
        for c in 0..3 {
            difference[c] += (sample.mean[c] - sample.reference[c]) / size;
            spread[c] += (sample.own[c] + sample.variance[c]) / size / size;
        }
    }
    std::array::from_fn(|c| difference[c] / (spread[c] + 1e-14).sqrt())
}

/// A picture of the signed relative difference: white where equal, red where `a` is brighter, blue where it is darker,
/// full colour from a quarter up. 8-bit RGB, rows from the top.
pub fn difference_picture(a: &Image, reference: &Image) -> Vec<u8> {
    assert_same_size(&[a, reference]);
    let shade = |(x, y)| {
        let grey = |image| rgb(image, x, y).iter().sum::<f64>() / 3.0;
        let (p, r) = (grey(a), grey(reference));
        let d = ((p - r) / (0.5 * (p + r) + 0.02) * 4.0).clamp(-1.0, 1.0);
        [1.0 + d.min(0.0), 1.0 - d.abs(), 1.0 - d.max(0.0)].map(|v| (v * 255.0).round() as u8)
    };
    pixels(a).flat_map(shade).collect()
}

/// The picture, the reference and their FLIP differences (black for none, then red, yellow, white) beside each other, colours
/// as sRGB shows them. 8-bit RGB, rows from the top, three times as wide as each.
pub fn side_by_side(a: &Image, reference: &Image, flip: &Flip) -> Vec<u8> {
    assert_same_size(&[a, reference]);
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
    let shown = |image: &Image, x, y| rgb(image, x, y).map(|v| byte(srgb_from_linear(v as f32)));
    let heat = |v: f32| [3.0 * v, 3.0 * v - 1.0, 3.0 * v - 2.0].map(byte);
    let row = |y: u32| {
        let columns = || 0..a.width;
        let differences = columns().map(move |x| heat(flip.map[(y * a.width + x) as usize]));
        columns()
            .map(move |x| shown(a, x, y))
            .chain(columns().map(move |x| shown(reference, x, y)))
            .chain(differences)
    };
    (0..a.height).flat_map(row).flatten().collect()
}

/// How many pixels hold NaN or an infinity in red, green or blue.
pub fn non_finite_pixels(image: &Image) -> u64 {
    pixels(image).filter(|&(x, y)| !rgb(image, x, y).iter().all(|v| v.is_finite())).count() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash::SplitMix64;

    /// A picture of mean `base` with independent uniform noise of the given standard deviation.
    fn noisy(seed: u64, base: f64, sigma: f64) -> Image {
        let mut random = SplitMix64::new(seed);
        let data =
            (0..64 * 64 * 3).map(|_| (base + sigma * 12f64.sqrt() * (random.next_unit() - 0.5)) as f32);
        Image::from_linear_rgb("noise", 64, 64, data.collect())
    }

    #[test]
    fn errors_follow_their_formulas() {
        let a = Image::from_linear_rgb("a", 1, 2, vec![1.0, 2.0, 3.0, 1.0, 0.0, 0.0]);
        let r = Image::from_linear_rgb("r", 1, 2, vec![1.0, 1.0, 1.0, 1.0, 1.0, 0.0]);
        let e = errors(&a, &r);
        assert!((e.rmse - 1.0).abs() < 1e-12);
        assert!((e.rel_mse - 6.0 / 1.01 / 6.0).abs() < 1e-12);
        assert_eq!(e.mean_ratio(), [1.0, 1.0, 3.0]);
    }

    #[test]
    fn equal_distributions_agree_and_shifted_ones_do_not() {
        let (reference, variance) = (noisy(3, 1.0, 0.01), noisy(4, 1e-4, 0.0));
        let test =
            z_test(&noisy(1, 1.0, 0.1), &noisy(2, 1.0, 0.1), &reference, &variance).expect("64 blocks");
        assert!(test.agrees(), "{test:?}");
        assert!((test.channels[0].sigma - (0.005f64 + 1e-4).sqrt() / 64.0).abs() < 1e-4);
        // Half a per cent is about 4.4 standard deviations here; one per cent is far outside.
        let far = z_test(&noisy(1, 1.01, 0.1), &noisy(2, 1.01, 0.1), &reference, &variance);
        assert!(!far.expect("64 blocks").agrees());
    }

    #[test]
    fn exact_pictures_agree_only_where_they_are_equal() {
        let flat = |value: f32| Image::from_linear_rgb("flat", 9, 8, vec![value; 9 * 8 * 3]);
        let test = |value| z_test(&flat(value), &flat(value), &flat(0.5), &flat(0.0)).expect("one block");
        assert!(test(0.5).agrees() && test(0.5).channels[0].z() == 0.0, "{:?}", test(0.5));
        assert!(!test(0.25).agrees() && test(0.25).channels[0].z() == f64::NEG_INFINITY, "{:?}", test(0.25));
    }

    #[test]
    fn pictures_without_a_block_have_no_verdict() {
        let small = Image::from_linear_rgb("small", 64, 7, vec![1.0; 64 * 7 * 3]);
        assert_eq!(z_test(&small, &small, &small, &small), None);
    }

    #[test]
    fn differences_are_red_and_blue() {
        let a = Image::from_linear_rgb("a", 3, 1, vec![1.0, 1.0, 1.0, 9.0, 9.0, 9.0, 0.0, 0.0, 0.0]);
        let r = Image::from_linear_rgb("r", 3, 1, vec![1.0; 9]);
        assert_eq!(difference_picture(&a, &r), [255, 255, 255, 255, 0, 0, 0, 0, 255]);
    }
}
