//! The U-Net that Open Image Denoise publishes for pictures of path tracers (Afra et al., "Intel Open Image Denoise",
//! <https://www.openimagedenoise.org>; after Ronneberger et al. 2015, "U-Net: Convolutional Networks for Biomedical Image
//! Segmentation"): 3x3 convolutions at five resolutions; the encoder has 2x2 max pooling, the decoder upsamples by repetition
//! and concatenates the encoder's output at the same resolution (skip connections).
//!
//! Each sum has one order, of fused multiply-adds: the same bits at any number of threads, on all CPU levels. What is stored
//! between layers has at most half the picture's resolution: the layers at full resolution run tile by tile, those before
//! them strip by strip.

mod stage;
#[cfg(test)]
mod tests;
mod transfer;
mod weights;

use rayon::prelude::*;
use stage::{Input, Picture, Stage, Tensor};
use weights::{Archive, Convolution};

/// The weights for pictures with albedo and normals, and for those without.
const WITH_GUIDES: &[u8] = include_bytes!("../../../assets/denoiser/rt_hdr_alb_nrm.tza");
const WITHOUT_GUIDES: &[u8] = include_bytes!("../../../assets/denoiser/rt_hdr.tza");

/// Number of halvings of the resolution.
const LEVELS: usize = 4;
/// Rows of the picture that the last layers work on at a time.
const STRIP: usize = 256;

/// Three planes of a picture, row by row from the top.
type Planes<'a> = [&'a [f32]; 3];

/// The network with its weights.
pub(super) struct Network {
    has_guides: bool,
    /// Encoder layers, from the highest resolution.
    down: [Vec<Convolution>; LEVELS],
    /// Layers at the lowest resolution.
    bottom: Vec<Convolution>,
    /// Decoder layers, from the highest resolution.
    up: [Vec<Convolution>; LEVELS],
}

/// Channels of the encoder at each resolution.
const DOWN: [usize; LEVELS] = [32, 48, 64, 80];
/// Channels at the lowest resolution.
const BOTTOM: usize = 96;
/// Channels of the decoder at each resolution, from the highest.
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
        let both = |level: usize, below: usize, beside: usize| {
            let (a, b) = (format!("dec_conv{level}a"), format!("dec_conv{level}b"));
            vec![layer(&a, &[below, beside]), layer(&b, &[UP[level - 1]])]
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

    /// Denoises a picture, of which each pixel is multiplied by a factor first. Radiance that is NaN or negative counts as 0.
    /// Guides, albedo and normal, are needed if the network is for them.
    pub fn run(
        &self,
        width: usize,
        height: usize,
        color: Planes,
        factors: &[f32],
        guides: Option<[Planes; 2]>,
    ) -> [Vec<f32>; 3] {
        let size = [width.next_multiple_of(1 << LEVELS), height.next_multiple_of(1 << LEVELS)];
        let exposure = transfer::exposure(width, height, color, factors);
        let picture = Picture {
            width,
            height,
            color: color.map(|plane| transfer::encoded(plane, factors, exposure)),
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
        let decode = |v: &mut f32| *v = transfer::decoded(*v, exposure);
        out.iter_mut().for_each(|plane| plane.par_iter_mut().with_min_len(4096).for_each(decode));
        out
    }

    /// Runs the layers on a picture padded to this size; calls `write` with the results, some rows after the other.
    fn layers(&self, size: [usize; 2], picture: &Picture, mut write: impl FnMut(usize, &[[f32; 3]])) {
        let sized = |level: usize| size.map(|length| length >> level);
        let mut skips: Vec<Tensor> = Vec::new();
        for (level, layers) in self.down.iter().enumerate() {
            let input = skips.last().map_or(Input::Picture(picture), Input::Same);
            skips.push(Stage { size: sized(level), inputs: &[input], layers }.pooled());
        }
        let lowest = skips.pop().expect("as many as levels");
        let stage = Stage { size: sized(LEVELS), inputs: &[Input::Same(&lowest)], layers: &self.bottom };
        let mut below = stage.output(0..size[1] >> LEVELS);
        for level in (2..LEVELS).rev() {
            let beside = skips.pop().expect("as many as levels");
            let inputs = [Input::Doubled(&below), Input::Same(&beside)];
            let stage = Stage { size: sized(level), inputs: &inputs, layers: &self.up[level] };
            below = stage.output(0..size[1] >> level);
        }
        let beside = skips.pop().expect("as many as levels");
        for y0 in (0..size[1]).step_by(STRIP) {
            let y1 = (y0 + STRIP).min(size[1]);
            let inputs = [Input::Doubled(&below), Input::Same(&beside)];
            let stage = Stage { size: sized(1), inputs: &inputs, layers: &self.up[1] };
            // The last three layers need three rows above and below.
            let half = stage.output(y0.saturating_sub(4) / 2..((y1 + 4) / 2).min(size[1] / 2));
            let inputs = [Input::Doubled(&half), Input::Picture(picture)];
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
