//! Stages of consecutive convolutions, evaluated band by band and tile by tile: intermediate results have the size of a tile, and
//! threads share only the input.
//!
//! Weights are stored in the format of Open Image Denoise, little-endian with a table of named tensors at the end ("Tensor Archive",
//! `.tza`, version 2; `core/tza.cpp` and `training/tza.py` there).

use super::convolution::{BLOCK, Channels, Convolution, Convolve, Scratch, Tile, blocks};
use crate::simd::dispatch_lanes;
use half::f16;
use rayon::prelude::*;
use std::ops::Range;

/// Columns of a tile. With the margins of two convolutions they are a multiple of the columns processed at a time.
const TILE_WIDTH: usize = 140;
/// Maximum number of rows of a band.
const BAND_HEIGHT: usize = 64;
/// Minimum number of bands, for load balancing.
const MIN_BANDS: usize = 8;
/// Minimum number of rows of a band, since its margin is computed in addition.
const MIN_HEIGHT: usize = 16;

/// A range of rows of a multi-channel picture: row by row, within a row by block of channels.
pub(super) struct Tensor {
    pub width: usize,
    pub channels: usize,
    /// Rows of the picture that the tensor holds.
    pub rows: Range<usize>,
    pub data: Vec<Channels>,
}

impl Tensor {
    pub fn new(width: usize, rows: Range<usize>, channels: usize) -> Tensor {
        let data = vec![[0.0; BLOCK]; width * rows.len() * blocks(channels)];
        Tensor { width, channels, rows, data }
    }

    fn row(&self, y: usize, block: usize) -> &[Channels] {
        let row = (y - self.rows.start) * blocks(self.channels) + block;
        &self.data[row * self.width..][..self.width]
    }
}

/// An input of a stage.
#[derive(Clone, Copy)]
pub(super) enum Input<'a> {
    /// A tensor of the stage's resolution.
    SameSize(&'a Tensor),
    /// A tensor of half the resolution, upsampled by repetition.
    Upsampled(&'a Tensor),
    Picture(&'a Picture<'a>),
}

/// The encoded picture with its guides; zero beyond the right and lower edges.
pub(super) struct Picture<'a> {
    pub width: usize,
    pub height: usize,
    /// Encoded radiance.
    pub color: [Vec<f32>; 3],
    /// Albedo and normal.
    pub guides: Option<[[&'a [f32]; 3]; 2]>,
}

impl Picture<'_> {
    /// Writes the input channels of a row from column `x0` on.
    fn write_row(&self, x0: usize, y: usize, to: &mut [Channels]) {
        to.fill([0.0; BLOCK]);
        if y >= self.height {
            return;
        }
        let mut write = |channel: usize, plane: &[f32], value: fn(f32) -> f32| {
            let row = &plane[y * self.width + x0.min(self.width)..(y + 1) * self.width];
            to.iter_mut().zip(row).for_each(|(to, v)| to[channel] = value(*v));
        };
        for (c, plane) in self.color.iter().enumerate() {
            write(c, plane, |v| v);
        }
        if let Some([albedo, normal]) = self.guides {
            for c in 0..3 {
                write(3 + c, albedo[c], |v| if v > 0.0 { v.min(1.0) } else { 0.0 });
                write(6 + c, normal[c], |v| if v.is_nan() { 0.5 } else { 0.5 * v.clamp(-1.0, 1.0) + 0.5 });
            }
        }
    }
}

/// Scratch memory of a thread.
#[derive(Default)]
struct Tiles {
    from: Tile,
    to: Tile,
    scratch: Scratch,
}

/// Consecutive convolutions; the channels of the inputs are concatenated.
pub(super) struct Stage<'a> {
    /// The padded picture's size at the stage's resolution.
    pub size: [usize; 2],
    pub inputs: &'a [Input<'a>],
    pub layers: &'a [Convolution],
}

impl Stage<'_> {
    /// Runs the stage for a range of rows. `out` has `values_per_row_pair` values for each two rows; `write(tile, x0, out)` copies a
    /// finished tile, whose first column is `x0`, to the values of its band.
    pub fn run<T: Send>(
        &self,
        rows: Range<usize>,
        out: &mut [T],
        values_per_row_pair: usize,
        write: impl Fn(&Tile, usize, &mut [T]) + Sync,
    ) {
        let band_height = rows.len().div_ceil(MIN_BANDS).clamp(MIN_HEIGHT, BAND_HEIGHT).next_multiple_of(2);
        let bands = out.par_chunks_mut(band_height / 2 * values_per_row_pair).enumerate();
        bands.for_each_init(Tiles::default, |tiles, (band, out)| {
            let y0 = rows.start + band * band_height;
            let y1 = rows.end.min(y0 + band_height);
            for x0 in (0..self.size[0]).step_by(TILE_WIDTH) {
                let x1 = (x0 + TILE_WIDTH).min(self.size[0]);
                write(self.tile(x0..x1, y0..y1, tiles), x0, out);
            }
        });
    }

    /// The output for a rectangle.
    fn tile<'t>(&self, x: Range<usize>, y: Range<usize>, tiles: &'t mut Tiles) -> &'t Tile {
        let Tiles { from, to, scratch } = tiles;
        let margin = self.layers.len();
        self.gather(&x, &y, margin, from);
        for (k, layer) in self.layers.iter().enumerate() {
            dispatch_lanes(Convolve { layer, from, to, scratch });
            let margin = margin - k - 1;
            // Each convolution sees zeros outside of the picture.
            let inside = |range: &Range<usize>, size: usize| {
                let first = margin.saturating_sub(range.start);
                first..(size + margin - range.start).min(range.len() + 2 * margin)
            };
            to.clear_outside(inside(&x, self.size[0]), inside(&y, self.size[1]));
            std::mem::swap(from, to);
        }
        from
    }

    /// Fills a tile with the inputs of a rectangle and a margin around it.
    fn gather(&self, x: &Range<usize>, y: &Range<usize>, margin: usize, to: &mut Tile) {
        let count = |input: &Input| match input {
            Input::SameSize(tensor) | Input::Upsampled(tensor) => blocks(tensor.channels),
            Input::Picture(_) => 1,
        };
        let total = self.inputs.iter().map(count).sum();
        let (width, height) = (x.len() + 2 * margin, y.len() + 2 * margin);
        to.resize(width, height, total);
        let left = margin.saturating_sub(x.start);
        let right = (self.size[0] + margin - x.start).min(width);
        let first = (x.start + left) - margin;
        for row in 0..height {
            let from = (y.start + row).checked_sub(margin).filter(|from| *from < self.size[1]);
            let mut block = 0;
            for input in self.inputs {
                for b in 0..count(input) {
                    let line = to.row_mut(row, block);
                    block += 1;
                    line[..left].fill([0.0; BLOCK]);
                    line[right..].fill([0.0; BLOCK]);
                    let inside = &mut line[left..right];
                    match (from, input) {
                        (None, _) => inside.fill([0.0; BLOCK]),
                        (Some(from), Input::SameSize(tensor)) => {
                            inside.copy_from_slice(&tensor.row(from, b)[first..][..right - left]);
                        }
                        (Some(from), Input::Upsampled(tensor)) => {
                            let row = tensor.row(from / 2, b);
                            let pixels = inside.iter_mut().enumerate();
                            pixels.for_each(|(i, to)| *to = row[(first + i) / 2]);
                        }
                        (Some(from), Input::Picture(picture)) => picture.write_row(first, from, inside),
                    }
                }
            }
        }
    }

    pub fn output(&self, rows: Range<usize>) -> Tensor {
        let channels = self.layers.last().map_or(0, |layer| layer.outputs);
        let (width, count) = (self.size[0], blocks(channels));
        let mut tensor = Tensor::new(width, rows.clone(), channels);
        self.run(rows, &mut tensor.data, 2 * count * width, |tile, x, out| {
            for y in 0..tile.height {
                for b in 0..count {
                    let row = &mut out[(y * count + b) * width + x..][..tile.width];
                    row.copy_from_slice(tile.row(y, b));
                }
            }
        });
        tensor
    }

    /// The output after 2x2 max pooling; the stage's size must be even.
    pub fn pooled(&self) -> Tensor {
        let channels = self.layers.last().map_or(0, |layer| layer.outputs);
        let (width, count) = (self.size[0] / 2, blocks(channels));
        let mut tensor = Tensor::new(width, 0..self.size[1] / 2, channels);
        self.run(0..self.size[1], &mut tensor.data, count * width, |tile, x, out| {
            for y in 0..tile.height / 2 {
                for b in 0..count {
                    let (above, below) = (tile.row(2 * y, b), tile.row(2 * y + 1, b));
                    let row = &mut out[(y * count + b) * width + x / 2..][..tile.width / 2];
                    for (i, to) in row.iter_mut().enumerate() {
                        let four = [&above[2 * i], &above[2 * i + 1], &below[2 * i], &below[2 * i + 1]];
                        *to = std::array::from_fn(|c| {
                            four[0][c].max(four[1][c]).max(four[2][c].max(four[3][c]))
                        });
                    }
                }
            }
        });
        tensor
    }
}

/// A tensor archive.
pub(super) struct Archive<'a> {
    bytes: &'a [u8],
    tensors: Vec<StoredTensor<'a>>,
}

struct StoredTensor<'a> {
    name: &'a [u8],
    dimensions: Vec<usize>,
    offset: usize,
}

/// Sequential reader.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> &'a [u8] {
        let taken = &self.bytes[self.at..self.at + count];
        self.at += count;
        taken
    }

    fn number(&mut self, bytes: usize) -> usize {
        self.take(bytes).iter().rev().fold(0, |number, &byte| number << 8 | usize::from(byte))
    }
}

impl<'a> Archive<'a> {
    /// Parses an archive embedded in the program.
    ///
    /// # Panics
    /// If it is not a valid archive of half-precision tensors.
    pub fn new(bytes: &'a [u8]) -> Archive<'a> {
        let mut header = Cursor { bytes, at: 0 };
        assert_eq!((header.number(2), header.number(1)), (0x41d7, 2), "a tensor archive of version 2");
        header.take(1);
        let mut table = Cursor { bytes, at: header.number(8) };
        let count = table.number(4);
        let tensors = (0..count).map(|_| {
            let length = table.number(2);
            let name = table.take(length);
            let rank = table.number(1);
            let dimensions = (0..rank).map(|_| table.number(4)).collect();
            table.take(rank);
            assert_eq!(table.take(1), b"h", "half precision");
            StoredTensor { name, dimensions, offset: table.number(8) }
        });
        Archive { bytes, tensors: tensors.collect() }
    }

    /// The shape and the values of a tensor.
    fn tensor(&self, name: &str) -> (&[usize], Vec<f32>) {
        let found = self.tensors.iter().find(|tensor| tensor.name == name.as_bytes());
        let tensor = found.expect("the network has the layer");
        let bytes = &self.bytes[tensor.offset..][..2 * tensor.dimensions.iter().product::<usize>()];
        let value = |two: &[u8]| f16::from_le_bytes([two[0], two[1]]).to_f32();
        (&tensor.dimensions, bytes.chunks_exact(2).map(value).collect())
    }

    /// A layer by name; `inputs` are the numbers of channels of its concatenated inputs.
    pub fn convolution(&self, name: &str, inputs: &[usize]) -> Convolution {
        let (shape, values) = self.tensor(&format!("{name}.weight"));
        let [outputs, total, 3, 3] = *shape else { panic!("{name}: a 3x3 convolution") };
        assert_eq!(total, inputs.iter().sum::<usize>(), "{name}: channels");
        let (_, bias) = self.tensor(&format!("{name}.bias"));
        Convolution::new(inputs, outputs, &values, &bias)
    }
}
