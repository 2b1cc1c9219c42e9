//! How different two pictures look when one is flipped into the place of the other: LDR-FLIP of Andersson et al. 2020
//! ("FLIP: A Difference Evaluator for Alternating Images", HPG), with the viewing distance of its authors' program.

use super::pixels::{assert_same_size, pixels, rgb};
use crate::image::Image;
use std::f64::consts::PI;

/// Pixels a degree of the field of view: 3840 pixels on 0.7 m, seen from 0.7 m.
const PIXELS_A_DEGREE: f64 = 3840.0 * PI / 180.0;

/// Exponents of differences of colours and of features, and where large differences of colours are compressed (section 4).
const COLOR_EXPONENT: f64 = 0.7;
const FEATURE_EXPONENT: f64 = 0.5;
const KNEE: f64 = 0.4;
const KNEE_VALUE: f64 = 0.95;

/// Width of the detector of edges and points, degrees.
const FEATURE_WIDTH: f64 = 0.082;

/// Contrast sensitivity as sums of two Gaussians (table 1): factor and width each; achromatic, red-green, blue-yellow.
const SENSITIVITY: [[(f64, f64); 2]; 3] =
    [[(1.0, 0.0047), (0.0, 1e-5)], [(1.0, 0.0053), (0.0, 1e-5)], [(34.1, 0.04), (13.5, 0.025)]];
const LARGEST_WIDTH: f64 = 0.04;

/// Linear sRGB to XYZ.
const XYZ_FROM_RGB: [[f64; 3]; 3] = [
    [10135552.0 / 24577794.0, 8788810.0 / 24577794.0, 4435075.0 / 24577794.0],
    [2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0],
    [1425312.0 / 73733382.0, 8788810.0 / 73733382.0, 70074185.0 / 73733382.0],
];
/// The inverse.
const RGB_FROM_XYZ: [[f64; 3]; 3] = [
    [3.241003275, -1.537398934, -0.498615861],
    [-0.969224334, 1.875930071, 0.041554224],
    [0.055639423, -0.204011202, 1.057148933],
];

/// Differences of two pictures as they look: 0 for none, 1 for the largest.
#[derive(Clone, Debug, PartialEq)]
pub struct Flip {
    /// Mean over all pixels.
    pub mean: f64,
    /// That of each pixel, row by row from the top.
    pub map: Vec<f32>,
}

/// Compares a picture with a reference of the same size: linear colours, clipped to 0..1.
pub fn flip(a: &Image, reference: &Image) -> Flip {
    assert_same_size(&[a, reference]);
    let (a, reference) = (Seen::of(a), Seen::of(reference));
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

/// A picture as the eye has it.
struct Seen {
    /// L*, a*, b* of what remains visible, a* and b* weakened in the dark (Hunt's effect).
    lab: Vec<[f64; 3]>,
    /// Strength of edges, and of points.
    features: [Vec<f32>; 2],
}

impl Seen {
    fn of(image: &Image) -> Seen {
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
        Seen { lab: (0..opponent.len()).map(lab).collect(), features: features(&lightness, width) }
    }
}

/// Takes out what is too fine to be seen.
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

/// Strength of edges and of points of a plane of values in 0..1.
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

/// Convolves rows with one kernel and columns with another; beyond the edges stand the edges' pixels.
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

/// City blocks in lightness, straight in colour.
fn distance(p: &[f64; 3], q: &[f64; 3]) -> f64 {
    (p[0] - q[0]).abs() + (p[1] - q[1]).hypot(p[2] - q[2])
}

#[cfg(test)]
mod tests {
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
        let places = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
        let values = places.flat_map(|(x, y)| [0, 1, 2].map(|c| value(x, y, c))).collect();
        Image::from_linear_rgb("test", WIDTH, HEIGHT, values)
    }

    /// Figures of the authors' program (`flip-evaluator` 1.7) for the same pictures.
    #[test]
    fn agrees_with_the_authors_program() {
        let reference = image(|x, y, c| ((x * 7 + y * 3 + c * 29) % 101) as f32 / 100.0);
        let other = image(|x, y, c| {
            let own = ((x * 7 + y * 3 + c * 29) % 101) as f32 / 100.0;
            if x < 24 { 0.8 * own } else { ((x * 5 + y * y + c * 13) % 97) as f32 / 96.0 }
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
