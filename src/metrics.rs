//! Error metrics of a picture against a reference: RMSE, relative MSE, a z-test, and LDR-FLIP.

use crate::color::srgb_from_linear;
use crate::image::Image;
use std::f64::consts::PI;

/// Edge of the blocks of [`z_test`], pixels.
pub const BLOCK: usize = 8;

/// Error metrics over all pixels and channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Square root of the mean squared difference.
    pub rmse: f64,
    /// Mean of (a - r)^2 / (r^2 + 0.01).
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

/// The result of [`z_test`] for a channel.
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
    /// The z-score of the difference of the means.
    pub fn z(&self) -> f64 {
        z_score(self.mean - self.reference, self.sigma)
    }
}

/// A difference in standard deviations; 0 if both are 0.
fn z_score(difference: f64, sigma: f64) -> f64 {
    if difference == 0.0 && sigma == 0.0 { 0.0 } else { difference / sigma }
}

/// The result of [`z_test`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZTest {
    pub channels: [ChannelTest; 3],
    /// Fraction of blocks that differ by more than 3 standard deviations (0.27 % expected).
    pub beyond_3_sigma: f64,
    /// Fraction of blocks that differ by more than 5 standard deviations.
    pub beyond_5_sigma: f64,
}

impl ZTest {
    /// Are the means within 4 standard deviations, and at most 2 % of the blocks beyond 3?
    pub fn agrees(&self) -> bool {
        self.channels.iter().all(|c| c.z().abs() < 4.0) && self.beyond_3_sigma <= 0.02
    }
}

/// Error metrics of `a` against `reference` of the same size.
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

/// Tests whether a picture agrees with a converged reference. `a` and `b` differ in their seeds only, by which their variance
/// is estimated, and their pixels are independent (without path reuse); `variance` is that of the reference's pixels. Pixels
/// are averaged over 8x8 blocks, whose means are closer to normally distributed; partial blocks count for the overall means
/// only. All four have the same size. `None` if that is less than a block.
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
            // The variance of the mean, until the square root below.
            test.sigma += (sample.mean_variance[c] + sample.variance[c]) / n / n;
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
    let fraction = |count: u32| f64::from(count) / (3 * columns * rows) as f64;
    Some(ZTest { channels, beyond_3_sigma: fraction(beyond_3), beyond_5_sigma: fraction(beyond_5) })
}

/// The contribution of a pixel to the test, by channel.
struct Sample {
    mean: [f64; 3],
    reference: [f64; 3],
    /// (a - b)^2 / 4.
    mean_variance: [f64; 3],
    variance: [f64; 3],
}

impl Sample {
    fn at(a: &Image, b: &Image, reference: &Image, variance: &Image, x: u32, y: u32) -> Sample {
        let (p, q) = (rgb(a, x, y), rgb(b, x, y));
        Sample {
            mean: std::array::from_fn(|c| 0.5 * (p[c] + q[c])),
            reference: rgb(reference, x, y),
            mean_variance: std::array::from_fn(|c| (p[c] - q[c]).powi(2) / 4.0),
            variance: rgb(variance, x, y),
        }
    }
}

fn block_z([a, b, reference, variance]: [&Image; 4], column: usize, row: usize) -> [f64; 3] {
    let size = (BLOCK * BLOCK) as f64;
    let (mut difference, mut variance_of_mean) = ([0.0; 3], [0.0; 3]);
    for (i, j) in (0..BLOCK).flat_map(|j| (0..BLOCK).map(move |i| (i, j))) {
        let (x, y) = ((column * BLOCK + i) as u32, (row * BLOCK + j) as u32);
        let sample = Sample::at(a, b, reference, variance, x, y);
        for c in 0..3 {
            difference[c] += (sample.mean[c] - sample.reference[c]) / size;
            variance_of_mean[c] += (sample.mean_variance[c] + sample.variance[c]) / size / size;
        }
    }
    std::array::from_fn(|c| difference[c] / (variance_of_mean[c] + 1e-14).sqrt())
}

/// A diverging colour map of the signed relative difference: white where equal, red where `a` is brighter, blue where it is
/// darker, saturated from 25 % on. 8-bit RGB, rows from the top.
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

/// The picture, the reference and the FLIP error map (black for 0, then red, yellow, white) side by side, sRGB-encoded. 8-bit
/// RGB, rows from the top.
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

/// Number of pixels with a NaN or infinity in red, green or blue.
pub fn non_finite_pixels(image: &Image) -> u64 {
    pixels(image).filter(|&(x, y)| !rgb(image, x, y).iter().all(|v| v.is_finite())).count() as u64
}

fn rgb(image: &Image, x: u32, y: u32) -> [f64; 3] {
    let [r, g, b, _] = image.rgba(x, y);
    [r, g, b].map(f64::from)
}

fn pixels(image: &Image) -> impl Iterator<Item = (u32, u32)> + use<> {
    let (width, height) = (image.width, image.height);
    (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)))
}

fn assert_same_size(images: &[&Image]) {
    assert!(
        images.windows(2).all(|w| (w[0].width, w[0].height) == (w[1].width, w[1].height)),
        "pictures of different sizes can't be compared"
    );
}

// LDR-FLIP (Andersson et al. 2020, "FLIP: A Difference Evaluator for Alternating Images", HPG), with the default viewing
// distance of the reference implementation.

/// Pixels per degree of visual angle: 3840 pixels on 0.7 m, viewed from 0.7 m.
const PIXELS_A_DEGREE: f64 = 3840.0 * PI / 180.0;

/// Exponents of colour and feature differences, and the knee of the compression of large colour differences (section 4).
const COLOR_EXPONENT: f64 = 0.7;
const FEATURE_EXPONENT: f64 = 0.5;
const KNEE: f64 = 0.4;
const KNEE_VALUE: f64 = 0.95;

/// Width of the edge and point detectors, degrees.
const FEATURE_WIDTH: f64 = 0.082;

/// Contrast sensitivity functions as sums of two Gaussians (table 1), each by amplitude and width; achromatic, red-green,
/// blue-yellow.
const SENSITIVITY: [[(f64, f64); 2]; 3] =
    [[(1.0, 0.0047), (0.0, 1e-5)], [(1.0, 0.0053), (0.0, 1e-5)], [(34.1, 0.04), (13.5, 0.025)]];
const LARGEST_WIDTH: f64 = 0.04;

/// Linear sRGB to XYZ, with the digits of FLIP's reference implementation, as of its inverse.
const XYZ_FROM_RGB: [[f64; 3]; 3] = [
    [10135552.0 / 24577794.0, 8788810.0 / 24577794.0, 4435075.0 / 24577794.0],
    [2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0],
    [1425312.0 / 73733382.0, 8788810.0 / 73733382.0, 70074185.0 / 73733382.0],
];
const RGB_FROM_XYZ: [[f64; 3]; 3] = [
    [3.241003275, -1.537398934, -0.498615861],
    [-0.969224334, 1.875930071, 0.041554224],
    [0.055639423, -0.204011202, 1.057148933],
];

/// FLIP errors of two pictures, 0..1.
#[derive(Clone, Debug, PartialEq)]
pub struct Flip {
    /// Mean over all pixels.
    pub mean: f64,
    /// The error of each pixel, row by row from the top.
    pub map: Vec<f32>,
}

/// Compares a picture with a reference of the same size: linear colours, clipped to 0..1.
pub fn flip(a: &Image, reference: &Image) -> Flip {
    assert_same_size(&[a, reference]);
    let (a, reference) = (Perceived::of(a), Perceived::of(reference));
    let largest = distance(&hunt_lab([0.0, 1.0, 0.0]), &hunt_lab([0.0, 0.0, 1.0])).powf(COLOR_EXPONENT);
    let knee = KNEE * largest;
    let pixel = |i: usize| {
        let color = distance(&a.lab[i], &reference.lab[i]).powf(COLOR_EXPONENT);
        let color = match color < knee {
            true => KNEE_VALUE / knee * color,
            false => KNEE_VALUE + (color - knee) / (largest - knee) * (1.0 - KNEE_VALUE),
        };
        let feature = |k: usize| (a.features[k][i] - reference.features[k][i]).abs();
        let feature = (f64::from(feature(0).max(feature(1))) / 2f64.sqrt()).powf(FEATURE_EXPONENT);
        color.powf(1.0 - feature) as f32
    };
    let map: Vec<f32> = (0..a.lab.len()).map(pixel).collect();
    Flip { mean: map.iter().map(|&v| f64::from(v)).sum::<f64>() / map.len() as f64, map }
}

/// The perceived colours and features of a picture.
struct Perceived {
    /// L*a*b* of the filtered picture with the Hunt effect.
    lab: Vec<[f64; 3]>,
    /// Magnitudes of edges, and of points.
    features: [Vec<f32>; 2],
}

impl Perceived {
    fn of(image: &Image) -> Perceived {
        let width = image.width as usize;
        let opponent: Vec<[f64; 3]> = pixels(image)
            .map(|(x, y)| opponent_from_rgb(rgb(image, x, y).map(|v| v.clamp(0.0, 1.0))))
            .collect();
        let plane = |c: usize| opponent.iter().map(|v| v[c] as f32).collect::<Vec<f32>>();
        let planes: Vec<Vec<f32>> = (0..3).map(|c| filtered(&plane(c), width, &SENSITIVITY[c])).collect();
        let lab = |i: usize| {
            let rgb = rgb_from_opponent([0, 1, 2].map(|c| f64::from(planes[c][i])));
            hunt_lab(rgb.map(|v| v.clamp(0.0, 1.0)))
        };
        let lightness: Vec<f32> = opponent.iter().map(|v| ((v[0] + 16.0) / 116.0) as f32).collect();
        Perceived { lab: (0..opponent.len()).map(lab).collect(), features: features(&lightness, width) }
    }
}

/// Filters by a contrast sensitivity function.
fn filtered(plane: &[f32], width: usize, gaussians: &[(f64, f64); 2]) -> Vec<f32> {
    let radius = (3.0 * (LARGEST_WIDTH / (2.0 * PI * PI)).sqrt() * PIXELS_A_DEGREE).ceil() as isize;
    let mut sum = vec![0.0f32; plane.len()];
    let mut parts = Vec::new();
    for &(factor, b) in gaussians.iter().filter(|(factor, _)| *factor > 0.0) {
        let value = |x: isize| (-PI * PI * (x as f64 / PIXELS_A_DEGREE).powi(2) / b).exp();
        let kernel: Vec<f64> = (-radius..=radius).map(value).collect();
        let total: f64 = kernel.iter().sum();
        let kernel: Vec<f64> = kernel.iter().map(|v| v / total).collect();
        parts.push((factor * (PI / b).sqrt() * total * total, convolved(plane, width, &kernel, &kernel)));
    }
    let total: f64 = parts.iter().map(|(weight, _)| weight).sum();
    for (weight, part) in &parts {
        sum.iter_mut().zip(part).for_each(|(sum, v)| *sum += (weight / total) as f32 * v);
    }
    sum
}

/// Magnitudes of edges and of points of a plane of values in 0..1.
fn features(plane: &[f32], width: usize) -> [Vec<f32>; 2] {
    let deviation = 0.5 * FEATURE_WIDTH * PIXELS_A_DEGREE;
    let radius = (3.0 * deviation).ceil() as isize;
    let gaussian = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
    let kernel = |f: &dyn Fn(f64) -> f64| -> Vec<f64> {
        let values: Vec<f64> = (-radius..=radius).map(|x| f(x as f64)).collect();
        let sum = |positive: bool| values.iter().filter(|v| (**v > 0.0) == positive).sum::<f64>().abs();
        let (above, below) = (sum(true), sum(false));
        values.iter().map(|v| v / if *v > 0.0 { above } else { below.max(f64::MIN_POSITIVE) }).collect()
    };
    let smooth = kernel(&gaussian);
    let edge = kernel(&|x| -x * gaussian(x));
    let point = kernel(&|x| (x * x / (deviation * deviation) - 1.0) * gaussian(x));
    [edge, point].map(|across| {
        let x = convolved(plane, width, &across, &smooth);
        let y = convolved(plane, width, &smooth, &across);
        x.iter().zip(&y).map(|(x, y)| x.hypot(*y)).collect()
    })
}

/// Separable convolution, rows with one kernel and columns with another, clamped at the boundaries.
fn convolved(plane: &[f32], width: usize, along: &[f64], down: &[f64]) -> Vec<f32> {
    let (height, radius) = (plane.len() / width, along.len() / 2);
    let clamped = |at: usize, k: usize, size: usize| (at + k).saturating_sub(radius).min(size - 1);
    let mut rows = vec![0.0f32; plane.len()];
    for (row, to) in plane.chunks(width).zip(rows.chunks_mut(width)) {
        for (x, to) in to.iter_mut().enumerate() {
            let sum = along.iter().enumerate().map(|(k, w)| w * f64::from(row[clamped(x, k, width)]));
            *to = sum.sum::<f64>() as f32;
        }
    }
    let mut result = vec![0.0f32; plane.len()];
    for (y, to) in result.chunks_mut(width).enumerate() {
        for (k, weight) in down.iter().enumerate() {
            let from = clamped(y, k, height) * width;
            to.iter_mut().zip(&rows[from..from + width]).for_each(|(to, v)| *to += *weight as f32 * v);
        }
    }
    result
}

fn product(matrix: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn white() -> [f64; 3] {
    product(&XYZ_FROM_RGB, [1.0; 3])
}

/// Achromatic, red-green and blue-yellow: YCxCz, which is L*a*b* without its cube roots.
fn opponent_from_rgb(rgb: [f64; 3]) -> [f64; 3] {
    let (xyz, white) = (product(&XYZ_FROM_RGB, rgb), white());
    let [x, y, z] = [0, 1, 2].map(|c| xyz[c] / white[c]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn rgb_from_opponent([l, a, b]: [f64; 3]) -> [f64; 3] {
    let (y, white) = ((l + 16.0) / 116.0, white());
    product(&RGB_FROM_XYZ, [(y + a / 500.0) * white[0], y * white[1], (y - b / 200.0) * white[2]])
}

fn hunt_lab(rgb: [f64; 3]) -> [f64; 3] {
    const DELTA: f64 = 6.0 / 29.0;
    let (xyz, white) = (product(&XYZ_FROM_RGB, rgb), white());
    let [x, y, z] = [0, 1, 2].map(|c| {
        let t = xyz[c] / white[c];
        if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    });
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// HyAB: city-block distance in lightness, Euclidean in a* and b*.
fn distance(p: &[f64; 3], q: &[f64; 3]) -> f64 {
    (p[0] - q[0]).abs() + (p[1] - q[1]).hypot(p[2] - q[2])
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
    fn errors_match_hand_computed_values() {
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
        // One per cent is about 9 standard deviations.
        let far = z_test(&noisy(1, 1.01, 0.1), &noisy(2, 1.01, 0.1), &reference, &variance);
        assert!(!far.expect("64 blocks").agrees());
    }

    #[test]
    fn pictures_without_variance_agree_only_if_equal() {
        let flat = |value: f32| Image::from_linear_rgb("flat", 9, 8, vec![value; 9 * 8 * 3]);
        let test = |value| z_test(&flat(value), &flat(value), &flat(0.5), &flat(0.0)).expect("one block");
        assert!(test(0.5).agrees() && test(0.5).channels[0].z() == 0.0, "{:?}", test(0.5));
        assert!(!test(0.25).agrees() && test(0.25).channels[0].z() == f64::NEG_INFINITY, "{:?}", test(0.25));
    }

    #[test]
    fn pictures_smaller_than_a_block_have_no_result() {
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

#[cfg(test)]
mod flip_tests {
    use super::*;

    const WIDTH: u32 = 48;
    const HEIGHT: u32 = 36;

    const MEAN: f64 = 0.5392649;
    const PIXELS: [(u32, u32, f64); 6] = [
        (0, 0, 0.337795),
        (10, 10, 0.349499),
        (23, 17, 0.421837),
        (30, 20, 0.651865),
        (47, 35, 0.764070),
        (40, 3, 0.788139),
    ];

    fn image(value: impl Fn(u32, u32, u32) -> f32) -> Image {
        let coordinates = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
        let values = coordinates.flat_map(|(x, y)| [0, 1, 2].map(|c| value(x, y, c))).collect();
        Image::from_linear_rgb("test", WIDTH, HEIGHT, values)
    }

    /// Values of the reference implementation (`flip-evaluator` 1.7).
    #[test]
    fn flip_matches_the_reference_implementation() {
        let reference = image(|x, y, c| ((x * 7 + y * 3 + c * 29) % 101) as f32 / 100.0);
        let other = image(|x, y, c| {
            let value = ((x * 7 + y * 3 + c * 29) % 101) as f32 / 100.0;
            if x < 24 { 0.8 * value } else { ((x * 5 + y * y + c * 13) % 97) as f32 / 96.0 }
        });
        let found = flip(&other, &reference);
        let at = |x: u32, y: u32| f64::from(found.map[(y * WIDTH + x) as usize]);
        let close = |a: f64, b: f64| assert!((a - b).abs() < 2e-4, "{a} {b}");
        close(found.mean, MEAN);
        for (x, y, expected) in PIXELS {
            close(at(x, y), expected);
        }
        assert_eq!(flip(&reference, &reference).mean, 0.0);
    }
}
