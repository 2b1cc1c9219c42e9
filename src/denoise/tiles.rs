//! The way of a filter over a picture: tile by tile, each pixel becomes a weighted sum of the pixels of a window.

// Loops over lanes are written by index: adaptors of iterators may stay calls, which are not compiled for the CPU's level.
#![allow(clippy::needless_range_loop)]

use super::filter::Filter;
use super::planes::{LANES, Lanes, Planes, RADIUS, TILE, lanes};
use super::regression::{Chunk, fit};
use super::weights::weigh;
use crate::simd::{Kernel, dispatch};
use rayon::prelude::*;

impl Filter<'_> {
    /// The filtered planes. Tiles are independent of each other: the same at any number of threads.
    pub fn run(&self) -> Planes {
        let (width, height, count) = (self.data.width, self.data.height, self.data.count);
        let (columns, rows) = (width.div_ceil(TILE), height.div_ceil(TILE));
        let offsets = window();
        let scratch = || vec![0.0f32; offsets.len() * TILE * TILE];
        let tile = |weights: &mut Vec<f32>, index: usize| {
            let (x0, y0) = ((index % columns * TILE) as isize, (index / columns * TILE) as isize);
            let mut out = vec![0.0; count * TILE * TILE];
            dispatch(Tile { filter: self, offsets: &offsets, x0, y0, weights, out: &mut out });
            out
        };
        let tiles: Vec<Vec<f32>> = (0..columns * rows).into_par_iter().map_init(scratch, tile).collect();
        let mut result = Planes::new(width, height, count);
        for (index, out) in tiles.iter().enumerate() {
            let (x0, y0) = (index % columns * TILE, index / columns * TILE);
            let length = TILE.min(width - x0);
            for (plane, out) in out.chunks_exact(TILE * TILE).enumerate() {
                for (y, row) in out.chunks_exact(TILE).enumerate().take(height - y0) {
                    result.row_mut(plane, y0 + y)[x0..x0 + length].copy_from_slice(&row[..length]);
                }
            }
        }
        result.mirror();
        result
    }
}

/// Offsets of the pixels of a window, which is round.
fn window() -> Vec<(isize, isize)> {
    let r = RADIUS as isize;
    let square = (-r..=r).flat_map(|dy| (-r..=r).map(move |dx| (dx, dy)));
    square.filter(|(dx, dy)| dx * dx + dy * dy < r * (r + 1)).collect()
}

/// The work on a tile.
struct Tile<'a> {
    filter: &'a Filter<'a>,
    offsets: &'a [(isize, isize)],
    x0: isize,
    y0: isize,
    /// Row by row of the tile, for each offset the weights of its pixels.
    weights: &'a mut [f32],
    /// Plane by plane the pixels of the tile.
    out: &'a mut [f32],
}

impl Kernel for Tile<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Tile { filter, offsets, x0, y0, weights, out } = self;
        let row = offsets.len() * TILE;
        for (o, &offset) in offsets.iter().enumerate() {
            weigh(filter, [x0, y0], offset, &mut weights[o * TILE..], row);
        }
        for y in 0..TILE {
            for x in 0..TILE / LANES {
                let at = x * LANES;
                let chunk = Chunk { weights: y * row + at, x: x0 + at as isize, y: y0 + y as isize };
                fit(filter, offsets, chunk, weights);
                for plane in 0..filter.data.count {
                    let sum = weighted_sum(filter.data, plane, offsets, chunk, weights);
                    let to = (plane * TILE + y) * TILE + at;
                    out[to..to + LANES].copy_from_slice(&sum);
                }
            }
        }
    }
}

#[inline(always)]
fn weighted_sum(
    data: &Planes,
    plane: usize,
    offsets: &[(isize, isize)],
    chunk: Chunk,
    weights: &[f32],
) -> Lanes {
    let p = data.place(plane, chunk.x, chunk.y);
    let mut sum = [0.0f32; LANES];
    for (o, &(dx, dy)) in offsets.iter().enumerate() {
        let weight = lanes(weights, chunk.weights + o * TILE);
        let value = lanes(data.data(), data.moved(p, dx, dy));
        for l in 0..LANES {
            sum[l] += weight[l] * value[l];
        }
    }
    sum
}
