//! 3x3 convolutions of a tile by Winograd minimal filtering F(2x2, 3x3): 2x2 output pixels from 4x4 input pixels, with 16 instead of 36
//! multiplications per input and output channel (Winograd 1980, "Arithmetic Complexity of Computations"; Lavin, Gray 2016, "Fast
//! Algorithms for Convolutional Neural Networks"). Weights are transformed once, `G g G^T`. For each pair of output rows the input is
//! transformed, `B^T d B`, multiplied by the weights at each of the 16 elements, and transformed back, `A^T m A`.
//!
//! The memory layout lets the inner loop run over consecutive 2x2 squares of a row.

// Index loops over vectors: iterator adaptors may not be inlined and would then be compiled for the baseline CPU level.
#![allow(clippy::needless_range_loop)]

use crate::simd::{Lanes, LanesKernel};
use std::ops::Range;

/// Channels are stored in blocks of this size.
pub(super) const BLOCK: usize = 16;

/// Number of blocks for a number of channels.
pub(super) fn blocks(channels: usize) -> usize {
    channels.div_ceil(BLOCK)
}

/// Columns beyond a row's end, written by the last square.
const ROW_PADDING: usize = 2;
/// Row lengths in squares are padded to a multiple of this, a common multiple of the inner loops' steps.
const STEP: usize = 12;
/// Elements of a transformed square.
const ELEMENTS: usize = 16;

/// Sixteen channels of a pixel.
pub(super) type Channels = [f32; BLOCK];

/// Channels of a rectangle of pixels: row by row, within a row by block of channels.
#[derive(Default)]
pub(super) struct Tile {
    pub width: usize,
    pub height: usize,
    blocks: usize,
    stride: usize,
    data: Vec<Channels>,
}

impl Tile {
    /// Changes the size; the content is unspecified but finite.
    pub fn resize(&mut self, width: usize, height: usize, blocks: usize) {
        (self.width, self.height, self.blocks, self.stride) = (width, height, blocks, width + ROW_PADDING);
        let length = self.stride * height * blocks;
        if self.data.len() < length {
            self.data.resize(length, [0.0; BLOCK]);
        }
    }

    /// The pixels of a row.
    pub fn row(&self, y: usize, block: usize) -> &[Channels] {
        &self.data[(y * self.blocks + block) * self.stride..][..self.width]
    }

    /// The pixels of a row, mutably.
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

/// A 3x3 convolution with a bias, followed by ReLU.
pub(super) struct Convolution {
    /// Channels of each input, which are concatenated.
    inputs: Vec<usize>,
    /// Channels of the output.
    pub outputs: usize,
    /// Transformed weights of the outputs of a block, by block of outputs, element, block of inputs and input within the block.
    weights: Vec<Channels>,
    /// Biases by block of outputs.
    bias: Vec<Channels>,
}

impl Convolution {
    /// Transforms weights, which are given by output, input, row and column.
    pub fn new(inputs: &[usize], outputs: usize, weights: &[f32], bias: &[f32]) -> Convolution {
        let total: usize = inputs.iter().sum();
        let input_blocks: usize = inputs.iter().map(|&channels| blocks(channels)).sum();
        let mut transformed = vec![[0.0; BLOCK]; blocks(outputs) * ELEMENTS * input_blocks * BLOCK];
        for output in 0..outputs {
            let (mut channel, mut block) = (0, 0);
            for &count in inputs {
                for i in 0..count {
                    let first = (output * total + channel + i) * 9;
                    for (element, weight) in
                        transformed_weights(&weights[first..first + 9]).iter().enumerate()
                    {
                        let row = (output / BLOCK * ELEMENTS + element) * input_blocks + block;
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
fn transformed_weights(weights: &[f32]) -> [f32; ELEMENTS] {
    let along = |g: [f32; 3]| [g[0], 0.5 * (g[0] + g[1] + g[2]), 0.5 * (g[0] - g[1] + g[2]), g[2]];
    let columns = [0, 1, 2].map(|x| along([weights[x], weights[3 + x], weights[6 + x]]));
    let rows = [0, 1, 2, 3].map(|y| along([columns[0][y], columns[1][y], columns[2][y]]));
    std::array::from_fn(|element| rows[element / 4][element % 4])
}

/// Scratch memory for a pair of rows.
#[derive(Default)]
pub(super) struct Scratch {
    /// Transformed input by element, block of inputs and square.
    input: Vec<Channels>,
    /// Products by block of outputs within a group, element and square.
    product: Vec<Channels>,
}

/// Convolution of a tile without padding: the output is two pixels smaller in width and height.
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
        input.resize(ELEMENTS * from.blocks * stride, [0.0; BLOCK]);
        product.resize(2 * ELEMENTS * stride, [0.0; BLOCK]);
        for y in (0..to.height).step_by(2) {
            for block in 0..from.blocks {
                transform_input(lanes, from, y, block, squares, stride, input);
            }
            let mut block = 0;
            while block < count {
                let group = if L::HAS_MANY_REGISTERS { (count - block).min(2) } else { 1 };
                for element in 0..ELEMENTS {
                    let product = &mut product[element * stride..];
                    if !L::HAS_MANY_REGISTERS {
                        multiply::<L, 1, 6>(lanes, layer, input, stride, element, block, product);
                    } else if group == 2 {
                        multiply::<L, 2, 12>(lanes, layer, input, stride, element, block, product);
                    } else {
                        multiply::<L, 1, 12>(lanes, layer, input, stride, element, block, product);
                    }
                }
                for o in 0..group {
                    let product = &product[o * ELEMENTS * stride..];
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

/// Computes `B^T d B` for the squares of a pair of rows.
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
        // The last pair of an odd height repeats the last row.
        let row = if y + k < from.height { y + k } else { from.height - 1 };
        rows[k] = &from.data[(row * from.blocks + block) * from.stride..][..2 * squares + 2];
    }
    let (mut first, mut second) = (transform_column(lanes, &rows, 0), transform_column(lanes, &rows, 1));
    for square in 0..squares {
        let (third, fourth) =
            (transform_column(lanes, &rows, 2 * square + 2), transform_column(lanes, &rows, 2 * square + 3));
        for k in 0..4 {
            let values = transform_values(lanes, [first[k], second[k], third[k], fourth[k]]);
            for i in 0..4 {
                lanes.store(values[i], &mut to[((4 * k + i) * from.blocks + block) * stride + square]);
            }
        }
        (first, second) = (third, fourth);
    }
}

/// Computes `B^T d` for a column of four pixels.
#[inline(always)]
fn transform_column<L: Lanes>(lanes: L, rows: &[&[Channels]; 4], x: usize) -> [L::F16; 4] {
    let mut d = [lanes.load(&rows[0][x]); 4];
    for k in 1..4 {
        d[k] = lanes.load(&rows[k][x]);
    }
    transform_values(lanes, d)
}

/// Computes `B^T d` for four values.
#[inline(always)]
fn transform_values<L: Lanes>(lanes: L, d: [L::F16; 4]) -> [L::F16; 4] {
    [lanes.sub(d[0], d[2]), lanes.add(d[1], d[2]), lanes.sub(d[2], d[1]), lanes.sub(d[1], d[3])]
}

/// Products at one element for `BLOCKS` blocks of outputs, `SQUARES` squares at a time, summed over inputs in order.
#[inline(always)]
fn multiply<L: Lanes, const BLOCKS: usize, const SQUARES: usize>(
    lanes: L,
    layer: &Convolution,
    from: &[Channels],
    stride: usize,
    element: usize,
    block: usize,
    to: &mut [Channels],
) {
    let from_blocks = from.len() / (ELEMENTS * stride);
    let length = from_blocks * BLOCK;
    let mut weights = [&layer.weights[..0]; BLOCKS];
    for o in 0..BLOCKS {
        weights[o] = &layer.weights[((block + o) * ELEMENTS + element) * length..][..length];
    }
    for x in (0..stride).step_by(SQUARES) {
        let mut sums = [[lanes.splat(0.0); SQUARES]; BLOCKS];
        let (mut input, mut left) = (0, layer.inputs[0]);
        for b in 0..from_blocks {
            let channels = if left < BLOCK { left } else { BLOCK };
            let squares = &from[(element * from_blocks + b) * stride + x..][..SQUARES];
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
            let out = &mut to[o * ELEMENTS * stride + x..][..SQUARES];
            for s in 0..SQUARES {
                lanes.store(sums[o][s], &mut out[s]);
            }
        }
    }
}

/// Computes `A^T m A` for the squares of a pair of rows, adds the bias and applies ReLU.
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
