//! 3x3 convolutions of a tile, whose rows lie in memory so that the inner loop runs over consecutive pixels.

// Loops over vectors are written by index: adaptors of iterators may stay calls, which are not compiled for the CPU's level.
#![allow(clippy::needless_range_loop)]

use super::weights::{BLOCK, Convolution, blocks};
use crate::simd::{Lanes, LanesKernel};

/// Maximum number of pixels that are computed beyond a row's end, and read beyond those.
const SLACK: usize = 12 + 2;

/// Sixteen channels of a pixel.
pub(super) type Channels = [f32; BLOCK];

/// Some channels of a rectangle of pixels: row by row, block by block of channels.
#[derive(Default)]
pub(super) struct Tile {
    pub width: usize,
    pub height: usize,
    blocks: usize,
    stride: usize,
    data: Vec<Channels>,
}

impl Tile {
    /// Another size; the content is unspecified (but finite).
    pub fn resize(&mut self, width: usize, height: usize, blocks: usize) {
        (self.width, self.height, self.blocks, self.stride) = (width, height, blocks, width + SLACK);
        let length = self.stride * height * blocks;
        if self.data.len() < length {
            self.data.resize(length, [0.0; BLOCK]);
        }
    }

    /// The pixels of a row.
    pub fn row(&self, y: usize, block: usize) -> &[Channels] {
        &self.data[(y * self.blocks + block) * self.stride..][..self.width]
    }

    /// A row to write to.
    pub fn row_mut(&mut self, y: usize, block: usize) -> &mut [Channels] {
        &mut self.data[(y * self.blocks + block) * self.stride..][..self.width]
    }

    /// Writes zeros outside of a rectangle.
    pub fn clear_outside(&mut self, columns: std::ops::Range<usize>, rows: std::ops::Range<usize>) {
        if columns == (0..self.width) && rows == (0..self.height) {
            return;
        }
        for y in 0..self.height {
            for block in 0..self.blocks {
                let row = self.row_mut(y, block);
                let inside = if rows.contains(&y) { columns.clone() } else { 0..0 };
                row[..inside.start].fill([0.0; BLOCK]);
                row[inside.end..].fill([0.0; BLOCK]);
            }
        }
    }
}

/// A convolution of a tile: the output is two pixels narrower and lower.
pub(super) struct Convolve<'a> {
    pub layer: &'a Convolution,
    pub from: &'a Tile,
    pub to: &'a mut Tile,
}

impl LanesKernel for Convolve<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Convolve { layer, from, to } = self;
        let count = blocks(layer.outputs);
        to.resize(from.width - 2, from.height - 2, count);
        for y in 0..to.height {
            let mut block = 0;
            while block < count {
                if L::HAS_MANY_REGISTERS && block + 2 <= count {
                    convolve_row::<L, 2, 12>(lanes, layer, from, to, y, block);
                    block += 2;
                } else if L::HAS_MANY_REGISTERS {
                    convolve_row::<L, 1, 12>(lanes, layer, from, to, y, block);
                    block += 1;
                } else {
                    convolve_row::<L, 1, 6>(lanes, layer, from, to, y, block);
                    block += 1;
                }
            }
        }
    }
}

/// A row of some blocks of the output, `PIXELS` at a time. Terms are added by block of inputs, row, column, input.
#[inline(always)]
fn convolve_row<L: Lanes, const BLOCKS: usize, const PIXELS: usize>(
    lanes: L,
    layer: &Convolution,
    from: &Tile,
    to: &mut Tile,
    y: usize,
    block: usize,
) {
    let length = from.blocks * 9 * BLOCK;
    let mut weights = [&layer.weights[..0]; BLOCKS];
    for o in 0..BLOCKS {
        weights[o] = &layer.weights[(block + o) * length..][..length];
    }
    for x in (0..to.width).step_by(PIXELS) {
        let mut sums = [[lanes.load(&layer.bias[block]); PIXELS]; BLOCKS];
        for o in 1..BLOCKS {
            sums[o] = [lanes.load(&layer.bias[block + o]); PIXELS];
        }
        let mut at = 0;
        let (mut input, mut left) = (0, layer.inputs[0]);
        for b in 0..from.blocks {
            let channels = if left < BLOCK { left } else { BLOCK };
            for ky in 0..3 {
                let start = ((y + ky) * from.blocks + b) * from.stride + x;
                let row = &from.data[start..start + PIXELS + 2];
                for kx in 0..3 {
                    let pixels = &row[kx..kx + PIXELS];
                    for i in 0..channels {
                        let mut weight = [lanes.load(&weights[0][at + i]); BLOCKS];
                        for o in 1..BLOCKS {
                            weight[o] = lanes.load(&weights[o][at + i]);
                        }
                        for p in 0..PIXELS {
                            let value = lanes.splat(pixels[p][i % BLOCK]);
                            for o in 0..BLOCKS {
                                sums[o][p] = lanes.mul_add(value, weight[o], sums[o][p]);
                            }
                        }
                    }
                    at += BLOCK;
                }
            }
            left -= channels;
            if left == 0 && b + 1 < from.blocks {
                input += 1;
                left = layer.inputs[input];
            }
        }
        for o in 0..BLOCKS {
            let start = (y * to.blocks + block + o) * to.stride + x;
            let out = &mut to.data[start..start + PIXELS];
            for p in 0..PIXELS {
                lanes.store_positive(sums[o][p], &mut out[p]);
            }
        }
    }
}
