//! Pre- and postprocessing of the network: the exposure, and a transfer function that makes radiance of any range
//! perceptually uniform, as in Open Image Denoise 2 (`core/color.h`, `core/autoexposure`): the network was trained with both.

use crate::color::luminance;
use rayon::prelude::*;

/// Edge of the squares whose mean luminance is a sample of the exposure, pixels.
const BIN: usize = 16;
/// The average luminance after exposure.
const KEY: f32 = 0.18;
/// Darker bins are ignored.
const DARKEST: f32 = 1e-8;
/// The largest value that the transfer function maps to 1.
const LARGEST: f32 = 65504.0;

/// The factor that brings the geometric mean of the luminance to the key of 0.18 (Reinhard et al. 2002, "Photographic Tone
/// Reproduction for Digital Images", eq. 1 and 2, on means of 16x16 pixels); 1 for a black picture.
pub(super) fn exposure(width: usize, height: usize, color: [&[f32]; 3], factors: &[f32]) -> f32 {
    let (columns, rows) = (width.div_ceil(BIN), height.div_ceil(BIN));
    let mean = |column: usize, row: usize| {
        let (x0, x1) = (column * width / columns, (column + 1) * width / columns);
        let (y0, y1) = (row * height / rows, (row + 1) * height / rows);
        let mut sum = 0.0f32;
        for y in y0..y1 {
            for at in y * width + x0..y * width + x1 {
                sum += luminance(color.map(|plane| (plane[at] * factors[at]).clamp(0.0, f32::MAX)));
            }
        }
        sum / ((x1 - x0) * (y1 - y0)) as f32
    };
    let (mut sum, mut count) = (0.0f64, 0u32);
    for row in 0..rows {
        for mean in (0..columns).map(|column| mean(column, row)).filter(|mean| *mean > DARKEST) {
            sum += f64::from(mean.log2());
            count += 1;
        }
    }
    if count == 0 { 1.0 } else { KEY / (sum / f64::from(count)).exp2() as f32 }
}

/// A fit to the perceptually uniform encoding of Aydin et al. 2008 ("Extending Quality Metrics to Full Luminance Range
/// Images"): linear, a power, a logarithm, with the constants of Open Image Denoise.
const A: f32 = 1.41283765e+03;
const B: f32 = 1.64593172e+00;
const C: f32 = 4.31384981e-01;
const D: f32 = -2.94139609e-03;
const E: f32 = 1.92653254e-01;
const F: f32 = 6.26026094e-03;
const G: f32 = 9.98620152e-01;
/// Where the pieces meet: luminances, and their encodings.
const Y0: f32 = 1.57945760e-06;
const Y1: f32 = 3.22087631e-02;
const X0: f32 = 2.23151711e-03;
const X1: f32 = 3.70974749e-01;

fn encode(y: f32) -> f32 {
    if y <= Y0 {
        A * y
    } else if y <= Y1 {
        B * y.powf(C) + D
    } else {
        E * (y + F).ln() + G
    }
}

fn decode(x: f32) -> f32 {
    if x <= X0 {
        x / A
    } else if x <= X1 {
        ((x - D) / B).powf(1.0 / C)
    } else {
        ((x - G) / E).exp() - F
    }
}

/// The encodings, in 0..1, of a plane of radiance times factors and the exposure.
pub(super) fn encoded(plane: &[f32], factors: &[f32], exposure: f32) -> Vec<f32> {
    let largest = encode(LARGEST);
    let of = |(v, factor): (&f32, &f32)| {
        let v = v * factor * exposure;
        if v > 0.0 { encode(v.min(f32::MAX)) / largest } else { 0.0 }
    };
    plane.par_iter().zip(factors).with_min_len(4096).map(of).collect()
}

/// The radiance of an encoding.
pub(super) fn decoded(encoding: f32, exposure: f32) -> f32 {
    decode(encoding * encode(LARGEST)) / exposure
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decoding_undoes_encoding() {
        for i in 0..200 {
            let y = 1e-8 * 10f32.powf(i as f32 * 0.065);
            let back = decoded(encoded(&[y], &[1.0], 3.0)[0], 3.0);
            assert!((back / y - 1.0).abs() < 1e-3, "{y} {back}");
        }
    }

    #[test]
    fn exposure_is_relative() {
        let plane: Vec<f32> = (0..40 * 30).map(|i| 0.1 + i as f32).collect();
        let bright: Vec<f32> = plane.iter().map(|v| 8.0 * v).collect();
        let ones = vec![1.0; 40 * 30];
        let of = |plane: &[f32]| exposure(40, 30, [plane; 3], &ones);
        let (a, b) = (of(&plane), of(&bright));
        assert!((a / b - 8.0).abs() < 1e-4);
        assert_eq!(of(&vec![0.0; 1200]), 1.0);
    }
}
