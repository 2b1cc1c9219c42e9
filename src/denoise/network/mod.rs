//! The U-Net of Open Image Denoise for path-traced pictures (Afra et al., "Intel Open Image Denoise",
//! <https://www.openimagedenoise.org>; after Ronneberger et al. 2015, "U-Net: Convolutional Networks for Biomedical Image
//! Segmentation"): 3x3 convolutions at five resolutions; the encoder has 2x2 max pooling, the decoder upsamples by repetition
//! and concatenates the encoder's output at the same resolution (skip connections).
//!
//! Sums have a fixed order of fused multiply-adds, so that the bits don't depend on threads or CPU level. Stored tensors have at most
//! half the picture's resolution: layers at full resolution run tile by tile, those before them strip by strip.
//!
//! The input is scaled by an automatic exposure and encoded by a perceptually uniform transfer function, and the output is decoded, as
//! in Open Image Denoise 2 (`core/color.h`, `core/autoexposure`), with which the network was trained.

use crate::color::luminance;
use convolution::Convolution;
use rayon::prelude::*;
use stage::{Archive, Input, Picture, Stage, Tensor};

mod convolution;
mod stage;

/// The weights for pictures with albedo and normals, and for those without.
const WITH_GUIDES: &[u8] = include_bytes!("../../../assets/denoiser/rt_hdr_alb_nrm.tza");
const WITHOUT_GUIDES: &[u8] = include_bytes!("../../../assets/denoiser/rt_hdr.tza");

/// Number of halvings of the resolution.
const LEVELS: usize = 4;
/// Height of the strips processed by the last layers, pixels.
const STRIP: usize = 128;

/// Three planes of a picture, row by row from the top.
type Planes<'a> = [&'a [f32]; 3];

/// The network with its weights.
pub(super) struct Network {
    has_guides: bool,
    /// Encoder layers, from the highest resolution on.
    down: [Vec<Convolution>; LEVELS],
    /// Layers at the lowest resolution.
    bottom: Vec<Convolution>,
    /// Decoder layers, from the highest resolution on.
    up: [Vec<Convolution>; LEVELS],
}

/// Channels of the encoder, from the highest resolution on.
const DOWN: [usize; LEVELS] = [32, 48, 64, 80];
/// Channels at the lowest resolution.
const BOTTOM: usize = 96;
/// Channels of the decoder, from the highest resolution on.
const UP: [usize; LEVELS] = [64, 64, 96, 112];

impl Network {
    /// The network for pictures with albedo and normals, or without.
    pub fn new(has_guides: bool) -> Network {
        let archive = Archive::new(if has_guides { WITH_GUIDES } else { WITHOUT_GUIDES });
        let first = if has_guides { 9 } else { 3 };
        let layer = |name: &str, inputs: &[usize]| archive.convolution(name, inputs);
        let down = [
            vec![layer("enc_conv0", &[first]), layer("enc_conv1", &[32])],
            vec![layer("enc_conv2", &[DOWN[0]])],
            vec![layer("enc_conv3", &[DOWN[1]])],
            vec![layer("enc_conv4", &[DOWN[2]])],
        ];
        let bottom = vec![layer("enc_conv5a", &[DOWN[3]]), layer("enc_conv5b", &[BOTTOM])];
        let both = |level: usize, below: usize, skip: usize| {
            let (a, b) = (format!("dec_conv{level}a"), format!("dec_conv{level}b"));
            vec![layer(&a, &[below, skip]), layer(&b, &[UP[level - 1]])]
        };
        let mut up = [
            both(1, UP[1], first),
            both(2, UP[2], DOWN[0]),
            both(3, UP[3], DOWN[1]),
            both(4, BOTTOM, DOWN[2]),
        ];
        up[0].push(layer("dec_conv0", &[32]));
        Network { has_guides, down, bottom, up }
    }

    /// Denoises a picture after multiplying each pixel by a factor. NaN or negative radiance counts as 0. The guides are albedo and
    /// normal, required if the network was created with guides.
    pub fn run(
        &self,
        width: usize,
        height: usize,
        color: Planes,
        factors: &[f32],
        guides: Option<[Planes; 2]>,
    ) -> [Vec<f32>; 3] {
        let size = [width.next_multiple_of(1 << LEVELS), height.next_multiple_of(1 << LEVELS)];
        let exposure = exposure(width, height, color, factors);
        let picture = Picture {
            width,
            height,
            color: color.map(|plane| encoded(plane, factors, exposure)),
            guides: guides.filter(|_| self.has_guides),
        };
        let mut out = [0, 1, 2].map(|_| vec![0.0f32; width * height]);
        self.layers(size, &picture, |y0, rows| {
            for (y, row) in rows.chunks_exact(size[0]).enumerate().take(height.saturating_sub(y0)) {
                for (c, plane) in out.iter_mut().enumerate() {
                    let to = &mut plane[(y0 + y) * width..][..width];
                    to.iter_mut().zip(row).for_each(|(to, v)| *to = v[c]);
                }
            }
        });
        let decode = |v: &mut f32| *v = decoded(*v, exposure);
        out.iter_mut().for_each(|plane| plane.par_iter_mut().with_min_len(4096).for_each(decode));
        out
    }

    /// Runs the layers on a picture padded to `size`; calls `write` with the first row and the pixels of each finished strip.
    fn layers(&self, size: [usize; 2], picture: &Picture, mut write: impl FnMut(usize, &[[f32; 3]])) {
        let sized = |level: usize| size.map(|length| length >> level);
        let mut skips: Vec<Tensor> = Vec::new();
        for (level, layers) in self.down.iter().enumerate() {
            let input = skips.last().map_or(Input::Picture(picture), Input::SameSize);
            skips.push(Stage { size: sized(level), inputs: &[input], layers }.pooled());
        }
        let lowest = skips.pop().expect("as many as levels");
        let stage = Stage { size: sized(LEVELS), inputs: &[Input::SameSize(&lowest)], layers: &self.bottom };
        let mut below = stage.output(0..size[1] >> LEVELS);
        for level in (2..LEVELS).rev() {
            let skip = skips.pop().expect("as many as levels");
            let inputs = [Input::Upsampled(&below), Input::SameSize(&skip)];
            let stage = Stage { size: sized(level), inputs: &inputs, layers: &self.up[level] };
            below = stage.output(0..size[1] >> level);
        }
        let skip = skips.pop().expect("as many as levels");
        for y0 in (0..size[1]).step_by(STRIP) {
            let y1 = (y0 + STRIP).min(size[1]);
            let inputs = [Input::Upsampled(&below), Input::SameSize(&skip)];
            let stage = Stage { size: sized(1), inputs: &inputs, layers: &self.up[1] };
            // The last three layers need a margin of three rows.
            let half = stage.output(y0.saturating_sub(4) / 2..((y1 + 4) / 2).min(size[1] / 2));
            let inputs = [Input::Upsampled(&half), Input::Picture(picture)];
            let stage = Stage { size, inputs: &inputs, layers: &self.up[0] };
            let mut strip = vec![[0.0f32; 3]; (y1 - y0) * size[0]];
            stage.run(y0..y1, &mut strip, 2 * size[0], |tile, x, out| {
                for y in 0..tile.height {
                    let row = &mut out[y * size[0] + x..][..tile.width];
                    row.iter_mut().zip(tile.row(y, 0)).for_each(|(to, v)| *to = [v[0], v[1], v[2]]);
                }
            });
            write(y0, &strip);
        }
    }
}

/// Edge length of the bins averaged for the exposure, pixels.
const BIN: usize = 16;
/// Geometric mean of the luminance after exposure.
const KEY: f32 = 0.18;
/// Luminance below which bins are ignored.
const MIN_LUMINANCE: f32 = 1e-8;
/// Luminance that is encoded as 1.
const MAX_LUMINANCE: f32 = 65504.0;

/// The exposure factor that scales the geometric mean of the luminance to [`KEY`] (Reinhard et al. 2002, "Photographic Tone Reproduction
/// for Digital Images", eq. 1 and 2, on means of 16x16 pixels); 1 for a black picture.
fn exposure(width: usize, height: usize, color: [&[f32]; 3], factors: &[f32]) -> f32 {
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
        for mean in (0..columns).map(|column| mean(column, row)).filter(|mean| *mean > MIN_LUMINANCE) {
            sum += f64::from(mean.log2());
            count += 1;
        }
    }
    if count == 0 { 1.0 } else { KEY / (sum / f64::from(count)).exp2() as f32 }
}

/// Constants of the transfer function of Open Image Denoise, a fit of linear, power and logarithmic segments to the perceptually uniform
/// encoding of Aydin et al. 2008 ("Extending Quality Metrics to Full Luminance Range Images").
const A: f32 = 1.41283765e+03;
const B: f32 = 1.64593172e+00;
const C: f32 = 4.31384981e-01;
const D: f32 = -2.94139609e-03;
const E: f32 = 1.92653254e-01;
const F: f32 = 6.26026094e-03;
const G: f32 = 9.98620152e-01;
/// Boundaries of the segments: luminances, and their encodings.
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

/// Encodes a plane of radiance times factors and exposure, to 0..1 (up to [`MAX_LUMINANCE`]).
fn encoded(plane: &[f32], factors: &[f32], exposure: f32) -> Vec<f32> {
    let largest = encode(MAX_LUMINANCE);
    let of = |(v, factor): (&f32, &f32)| {
        let v = v * factor * exposure;
        if v > 0.0 { encode(v.min(f32::MAX)) / largest } else { 0.0 }
    };
    plane.par_iter().zip(factors).with_min_len(4096).map(of).collect()
}

/// Decodes to radiance.
fn decoded(encoding: f32, exposure: f32) -> f32 {
    decode(encoding * encode(MAX_LUMINANCE)) / exposure
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash::SplitMix64;
    use crate::simd::{Level, best_level, limit_level};
    use half::f16;

    const WIDTH: usize = 75;
    const HEIGHT: usize = 41;

    /// RGB pixels of [`Scene::new`] denoised by the filter `RT` of Open Image Denoise: `hdr` with albedo and normal, then without guides;
    /// half precision.
    const LIBRARY: &[u8] = include_bytes!("library.bin");

    struct Scene {
        width: usize,
        height: usize,
        /// Colour, albedo, normal.
        planes: [[Vec<f32>; 3]; 3],
    }

    impl Scene {
        /// Squares of eight by eight pixels with random albedo under noisy light that falls off to the right.
        fn new(width: usize, height: usize) -> Scene {
            let unit = |seed: u64, count: usize| -> Vec<f64> {
                let mut random = SplitMix64::new(seed);
                (0..count).map(|_| random.next_unit()).collect()
            };
            let (squares, noise) = (unit(1, 9 * 64 * 3), unit(2, width * height * 3));
            let mut planes = [0, 1, 2].map(|_| [0, 1, 2].map(|_| vec![0.0f32; width * height]));
            for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
                let (at, square) = (y * width + x, y / 8 % 8 * 8 + x / 8 % 8);
                let normal = [(x % 16) as f32 / 16.0 - 0.5, (y % 16) as f32 / 16.0 - 0.5, 0.7];
                let light = 4.0 * (-((x / 4) as f64) / 2.0).exp2();
                for c in 0..3 {
                    let (albedo, noise) = (squares[3 * square + c], 2.0 * noise[3 * at + c]);
                    planes[0][c][at] = (albedo * light * noise * noise) as f32;
                    planes[1][c][at] = albedo as f32;
                    planes[2][c][at] = normal[c];
                }
            }
            Scene { width, height, planes }
        }

        fn denoised(&self, has_guides: bool) -> [Vec<f32>; 3] {
            let [color, albedo, normal] = self.planes.each_ref().map(|p| p.each_ref().map(Vec::as_slice));
            let guides = has_guides.then_some([albedo, normal]);
            let ones = vec![1.0; self.width * self.height];
            Network::new(has_guides).run(self.width, self.height, color, &ones, guides)
        }
    }

    #[test]
    fn network_equals_open_image_denoise() {
        let scene = Scene::new(WIDTH, HEIGHT);
        let expected: Vec<f32> =
            LIBRARY.chunks_exact(2).map(|two| f16::from_le_bytes([two[0], two[1]]).to_f32()).collect();
        for (has_guides, expected) in [true, false].into_iter().zip(expected.chunks_exact(WIDTH * HEIGHT * 3))
        {
            let found = scene.denoised(has_guides);
            for (at, expected) in expected.chunks_exact(3).enumerate() {
                for c in 0..3 {
                    let (a, b) = (found[c][at], expected[c]);
                    // Half precision has eleven bits, fewer below 6e-5.
                    assert!((a - b).abs() <= 6e-4 * b + 1e-6, "pixel {at}, {c}: {a}, library {b}");
                }
            }
        }
    }

    #[test]
    fn results_do_not_depend_on_threads_with_several_strips_and_tiles() {
        // More than one strip, more than one tile, uneven edges.
        let scene = Scene::new(141, STRIP + 27);
        let at = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| scene.denoised(true))
        };
        let whole = at(1);
        assert!(whole == at(3));
        assert!(whole.iter().flatten().all(|v| v.is_finite()));
    }

    #[test]
    fn all_cpu_levels_give_the_same_bits() {
        let scene = Scene::new(33, 20);
        let best = best_level();
        let of = |level| {
            limit_level(level);
            scene.denoised(true)
        };
        let results: Vec<_> = Level::ALL.into_iter().map(of).collect();
        limit_level(best);
        assert!(results.iter().all(|result| *result == results[0]));
    }

    #[test]
    fn decoding_inverts_encoding() {
        for i in 0..200 {
            let y = 1e-8 * 10f32.powf(i as f32 * 0.065);
            let back = decoded(encoded(&[y], &[1.0], 3.0)[0], 3.0);
            assert!((back / y - 1.0).abs() < 1e-3, "{y} {back}");
        }
    }

    #[test]
    fn exposure_is_inversely_proportional_to_luminance() {
        let plane: Vec<f32> = (0..40 * 30).map(|i| 0.1 + i as f32).collect();
        let bright: Vec<f32> = plane.iter().map(|v| 8.0 * v).collect();
        let ones = vec![1.0; 40 * 30];
        let of = |plane: &[f32]| exposure(40, 30, [plane; 3], &ones);
        let (a, b) = (of(&plane), of(&bright));
        assert!((a / b - 8.0).abs() < 1e-4);
        assert_eq!(of(&vec![0.0; 1200]), 1.0);
    }
}
