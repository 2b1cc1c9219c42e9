//! How much the pixels of a window tell about its middle, by the likeness of what surrounds them: non-local means as
//! Rousselle, Knaus, Zwicker 2012 ("Adaptive Rendering with Non-Local Means Filtering", eq. 3 to 7) have it for renderings,
//! with variances of each pixel. Channels share one fraction here, and a polynomial that reaches zero is in place of the
//! exponential.

// Loops over lanes are written by index: adaptors of iterators may stay calls, which are not compiled for the CPU's level.
#![allow(clippy::needless_range_loop)]

use super::filter::Filter;
use super::planes::{LANES, PATCH, TILE, wide};

const SIDE: usize = 2 * PATCH + 1;
/// Rows of a tile with what its patches reach; columns are whole vectors.
const ROWS: usize = TILE + 2 * PATCH;
pub(super) const WIDE: usize = TILE + LANES;

/// Variances below are taken for this: exact pixels would be compared by rounding errors else.
const LEAST_VARIANCE: f32 = 1e-12;

/// Weights in 0..1 of the pixels at an offset, for all pixels of the tile at (`x0`, `y0`); each row of them begins `row`
/// after the one before.
#[inline(always)]
pub(super) fn weigh(
    filter: &Filter,
    [x0, y0]: [isize; 2],
    offset: (isize, isize),
    to: &mut [f32],
    row: usize,
) {
    let mut sums = [[0.0f32; TILE]; ROWS];
    for (row, sums) in sums.iter_mut().enumerate() {
        let differences = differences(filter, x0, y0 + row as isize, offset);
        for j in 0..SIDE {
            for i in 0..TILE {
                sums[i] += differences[i + j];
            }
        }
    }
    // Four: where the polynomial falls as the exponential does at 0.
    let scale = 1.0 / ((SIDE * SIDE) as f32 * 4.0 * filter.bandwidth * filter.bandwidth);
    for y in 0..TILE {
        let mut distance = [0.0f32; TILE];
        for sums in &sums[y..y + SIDE] {
            for i in 0..TILE {
                distance[i] += sums[i];
            }
        }
        let apart = guide_distances(filter, x0, y0 + y as isize, offset);
        let to = &mut to[y * row..y * row + TILE];
        for i in 0..TILE {
            let far = distance[i] * scale;
            let near = 1.0 - if far > 0.0 { far } else { 0.0 };
            let near = if near > 0.0 { near } else { 0.0 };
            let alike = 1.0 - apart[i];
            let alike = if alike > 0.0 { alike } else { 0.0 };
            let squared = near * near * alike;
            to[i] = squared * squared;
        }
    }
}

/// Squared differences of pixels in a row of patches beyond what their variances explain, in units of the variances.
#[inline(always)]
fn differences(filter: &Filter, x0: isize, y: isize, (dx, dy): (isize, isize)) -> [f32; WIDE] {
    let (color, variance, margin) = (filter.color, filter.variance, PATCH as isize);
    let (p, q) = (color.place(0, x0 - margin, y - margin), color.place(0, x0 - margin + dx, y - margin + dy));
    let mut above = [0.0f32; WIDE];
    let mut below = [LEAST_VARIANCE; WIDE];
    for c in 0..3 {
        let plane = c * color.plane_length();
        let (a, b) = (wide(color.data(), p + plane), wide(color.data(), q + plane));
        let (v, w) = (wide(variance.data(), p + plane), wide(variance.data(), q + plane));
        for i in 0..WIDE {
            let difference = a[i] - b[i];
            let least = if v[i] < w[i] { v[i] } else { w[i] };
            above[i] += difference * difference - (v[i] + least);
            below[i] += v[i] + w[i];
        }
    }
    for i in 0..WIDE {
        above[i] /= below[i];
    }
    above
}

/// Squared differences of the guides, weighted.
#[inline(always)]
fn guide_distances(filter: &Filter, x0: isize, y: isize, (dx, dy): (isize, isize)) -> [f32; TILE] {
    let guides = filter.guides;
    let mut apart = [0.0f32; TILE];
    for (g, &sharpness) in filter.sharpness.iter().enumerate() {
        let (p, q) = (guides.place(g, x0, y), guides.place(g, x0 + dx, y + dy));
        let (a, b) = (wide(guides.data(), p), wide(guides.data(), q));
        for i in 0..TILE {
            let difference = a[i] - b[i];
            apart[i] += sharpness * difference * difference;
        }
    }
    apart
}
