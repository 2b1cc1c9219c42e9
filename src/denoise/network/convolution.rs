//! 3x3 convolutions of a tile by minimal filtering: two by two pixels of the output come from four by four of the input, by 16
//! multiplications for each input and output channel in place of 36 (Lavin, Gray 2016, "Fast Algorithms for Convolutional Neural Networks",
//! F(2x2, 3x3); Winograd 1980, "Arithmetic Complexity of Computations"). The weights are transformed once, as `G g G^T`; a pair of rows at a
//! time, the input is transformed, `B^T d B`, multiplied by them at each of the 16 places, and transformed back, `A^T m A`.
//!
//! Rows lie in memory so that the inner loop runs over consecutive squares of a row.

// Loops over vectors are written by index: adaptors of iterators may stay calls, which are not compiled for the CPU's level.
#![allow(clippy::needless_range_loop)]

use crate::simd::{Lanes, LanesKernel};
use std::ops::Range;

/// Channels are stored in blocks of this size.
pub(super) const BLOCK: usize = 16;

/// Number of blocks of some channels.
pub(super) fn blocks(channels: usize) -> usize {
    channels.div_ceil(BLOCK)
}

/// Columns that are computed beyond a row's end.
const SLACK: usize = 2;
/// Squares of a row that are multiplied at a time: a multiple of all steps of the inner loop.
const STEP: usize = 12;
/// Transformed values of a square.
const PLACES: usize = 16;

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
    pub fn clear_outside(&mut self, columns: Range<usize>, rows: Range<usize>) {
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

/// A 3x3 convolution with a bias, followed by a rectifier.
pub(super) struct Convolution {
    /// Channels of each input, which are concatenated.
    inputs: Vec<usize>,
    /// Channels of the output.
    pub outputs: usize,
    /// For each block of outputs, place, block of inputs and input in the block: the transformed weights of the block's outputs.
    weights: Vec<Channels>,
    /// Biases, by block of outputs.
    bias: Vec<Channels>,
}

impl Convolution {
    /// From weights by output, input, row and column.
    pub fn new(inputs: &[usize], outputs: usize, weights: &[f32], bias: &[f32]) -> Convolution {
        let total: usize = inputs.iter().sum();
        let input_blocks: usize = inputs.iter().map(|&channels| blocks(channels)).sum();
        let mut transformed = vec![[0.0; BLOCK]; blocks(outputs) * PLACES * input_blocks * BLOCK];
        for output in 0..outputs {
            let (mut channel, mut block) = (0, 0);
            for &count in inputs {
                for i in 0..count {
                    let first = (output * total + channel + i) * 9;
                    for (place, weight) in transformed_weights(&weights[first..first + 9]).iter().enumerate()
                    {
                        let row = (output / BLOCK * PLACES + place) * input_blocks + block;
                        transformed[row * BLOCK + i][output % BLOCK] = *weight;
                    }
                }
                channel += count;
                block += blocks(count);
            }
        }
        let mut biases = vec![[0.0; BLOCK]; blocks(outputs)];
        (0..outputs).for_each(|output| biases[output / BLOCK][output % BLOCK] = bias[output]);
        Convolution { inputs: inputs.to_vec(), outputs, weights: transformed, bias: biases }
    }
}

/// `G g G^T`, by row and column.
fn transformed_weights(weights: &[f32]) -> [f32; PLACES] {
    let along = |g: [f32; 3]| [g[0], 0.5 * (g[0] + g[1] + g[2]), 0.5 * (g[0] - g[1] + g[2]), g[2]];
    let columns = [0, 1, 2].map(|x| along([weights[x], weights[3 + x], weights[6 + x]]));
    let rows = [0, 1, 2, 3].map(|y| along([columns[0][y], columns[1][y], columns[2][y]]));
    std::array::from_fn(|place| rows[place / 4][place % 4])
}

/// Memory for a pair of rows.
#[derive(Default)]
pub(super) struct Scratch {
    /// By place, block of inputs and square.
    input: Vec<Channels>,
    /// By block of outputs in a group, place and square.
    product: Vec<Channels>,
}

/// A convolution of a tile: the output is two pixels narrower and lower.
pub(super) struct Convolve<'a> {
    pub layer: &'a Convolution,
    pub from: &'a Tile,
    pub to: &'a mut Tile,
    pub scratch: &'a mut Scratch,
}

impl LanesKernel for Convolve<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Convolve { layer, from, to, scratch: Scratch { input, product } } = self;
        let count = blocks(layer.outputs);
        to.resize(from.width - 2, from.height - 2, count);
        let squares = to.width.div_ceil(2);
        let stride = squares.next_multiple_of(STEP);
        input.resize(PLACES * from.blocks * stride, [0.0; BLOCK]);
        product.resize(2 * PLACES * stride, [0.0; BLOCK]);
        for y in (0..to.height).step_by(2) {
            for block in 0..from.blocks {
                transform_input(lanes, from, y, block, squares, stride, input);
            }
            let mut block = 0;
            while block < count {
                let group = if L::HAS_MANY_REGISTERS { (count - block).min(2) } else { 1 };
                for place in 0..PLACES {
                    let product = &mut product[place * stride..];
                    if !L::HAS_MANY_REGISTERS {
                        multiply::<L, 1, 6>(lanes, layer, input, stride, place, block, product);
                    } else if group == 2 {
                        multiply::<L, 2, 12>(lanes, layer, input, stride, place, block, product);
                    } else {
                        multiply::<L, 1, 12>(lanes, layer, input, stride, place, block, product);
                    }
                }
                for o in 0..group {
                    let product = &product[o * PLACES * stride..];
                    transform_product(
                        lanes,
                        product,
                        squares,
                        stride,
                        &layer.bias[block + o],
                        to,
                        y,
                        block + o,
                    );
                }
                block += group;
            }
        }
    }
}

/// `B^T d B` of the squares of a pair of rows.
#[inline(always)]
fn transform_input<L: Lanes>(
    lanes: L,
    from: &Tile,
    y: usize,
    block: usize,
    squares: usize,
    stride: usize,
    to: &mut [Channels],
) {
    let mut rows = [&from.data[..0]; 4];
    for k in 0..4 {
        // The last pair may have one row.
        let row = if y + k < from.height { y + k } else { from.height - 1 };
        rows[k] = &from.data[(row * from.blocks + block) * from.stride..][..2 * squares + 2];
    }
    let (mut first, mut second) = (down(lanes, &rows, 0), down(lanes, &rows, 1));
    for square in 0..squares {
        let (third, fourth) = (down(lanes, &rows, 2 * square + 2), down(lanes, &rows, 2 * square + 3));
        for k in 0..4 {
            let values = along(lanes, [first[k], second[k], third[k], fourth[k]]);
            for i in 0..4 {
                lanes.store(values[i], &mut to[((4 * k + i) * from.blocks + block) * stride + square]);
            }
        }
        (first, second) = (third, fourth);
    }
}

/// `B^T d` of a column.
#[inline(always)]
fn down<L: Lanes>(lanes: L, rows: &[&[Channels]; 4], x: usize) -> [L::F16; 4] {
    let mut d = [lanes.load(&rows[0][x]); 4];
    for k in 1..4 {
        d[k] = lanes.load(&rows[k][x]);
    }
    along(lanes, d)
}

/// `B^T d`.
#[inline(always)]
fn along<L: Lanes>(lanes: L, d: [L::F16; 4]) -> [L::F16; 4] {
    [lanes.sub(d[0], d[2]), lanes.add(d[1], d[2]), lanes.sub(d[2], d[1]), lanes.sub(d[1], d[3])]
}

/// Products at one place of some blocks of the output, of `SQUARES` at a time. Terms are added by block of inputs and input.
#[inline(always)]
fn multiply<L: Lanes, const BLOCKS: usize, const SQUARES: usize>(
    lanes: L,
    layer: &Convolution,
    from: &[Channels],
    stride: usize,
    place: usize,
    block: usize,
    to: &mut [Channels],
) {
    let from_blocks = from.len() / (PLACES * stride);
    let length = from_blocks * BLOCK;
    let mut weights = [&layer.weights[..0]; BLOCKS];
    for o in 0..BLOCKS {
        weights[o] = &layer.weights[((block + o) * PLACES + place) * length..][..length];
    }
    for x in (0..stride).step_by(SQUARES) {
        let mut sums = [[lanes.splat(0.0); SQUARES]; BLOCKS];
        let (mut input, mut left) = (0, layer.inputs[0]);
        for b in 0..from_blocks {
            let channels = if left < BLOCK { left } else { BLOCK };
            let squares = &from[(place * from_blocks + b) * stride + x..][..SQUARES];
            for i in 0..channels {
                let mut weight = [lanes.load(&weights[0][b * BLOCK + i]); BLOCKS];
                for o in 1..BLOCKS {
                    weight[o] = lanes.load(&weights[o][b * BLOCK + i]);
                }
                for s in 0..SQUARES {
                    let value = lanes.splat(squares[s][i % BLOCK]);
                    for o in 0..BLOCKS {
                        sums[o][s] = lanes.mul_add(value, weight[o], sums[o][s]);
                    }
                }
            }
            left -= channels;
            if left == 0 && b + 1 < from_blocks {
                input += 1;
                left = layer.inputs[input];
            }
        }
        for o in 0..BLOCKS {
            let out = &mut to[o * PLACES * stride + x..][..SQUARES];
            for s in 0..SQUARES {
                lanes.store(sums[o][s], &mut out[s]);
            }
        }
    }
}

/// `A^T m A` of the squares of a pair of rows, with the bias, rectified.
#[inline(always)]
fn transform_product<L: Lanes>(
    lanes: L,
    product: &[Channels],
    squares: usize,
    stride: usize,
    bias: &Channels,
    to: &mut Tile,
    y: usize,
    block: usize,
) {
    let bias = lanes.load(bias);
    let rows = if y + 1 < to.height { 2 } else { 1 };
    for square in 0..squares {
        let mut down = [[bias; 4]; 2];
        for i in 0..4 {
            let mut m = [bias; 4];
            for k in 0..4 {
                m[k] = lanes.load(&product[(4 * k + i) * stride + square]);
            }
            down[0][i] = lanes.add(lanes.add(m[0], m[1]), m[2]);
            down[1][i] = lanes.sub(lanes.sub(m[1], m[2]), m[3]);
        }
        for k in 0..rows {
            let [a, b, c, d] = down[k];
            let row = &mut to.data[((y + k) * to.blocks + block) * to.stride + 2 * square..][..2];
            lanes.store_positive(lanes.add(lanes.add(lanes.add(a, b), c), bias), &mut row[0]);
            lanes.store_positive(lanes.add(lanes.sub(lanes.sub(b, c), d), bias), &mut row[1]);
        }
    }
}
