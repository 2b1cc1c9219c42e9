//! First-order regression on the guides (Bitterli et al. 2016, "Nonlinearly Weighted First-order Regression for Denoising
//! Monte Carlo Renderings", eq. 4 to 6): colour as a constant and a slope along each guide, fitted to a window by weighted
//! least squares. Only its value in the middle is wanted, which is a weighted sum of the window's pixels whatever their
//! colours: the same weights serve all channels.

// Loops over lanes are written by index: adaptors of iterators may stay calls, which are not compiled for the CPU's level.
#![allow(clippy::needless_range_loop)]

use super::filter::{Filter, MOST_GUIDES};
use super::planes::{Aligned, LANES, Lanes, RADIUS, TILE, lanes};

/// Most numbers of a model: a constant, the guides, and the place in the picture.
pub(super) const TERMS: usize = MOST_GUIDES + 3;
const PRODUCTS: usize = TERMS * (TERMS + 1) / 2;

/// Guides that vary less than the root of this within a window don't count: they are noise.
const RIDGE: f32 = 1e-4;

/// A chunk of a tile's row: where it is in the tile and in the picture.
#[derive(Clone, Copy)]
pub(super) struct Chunk {
    /// Where its weights begin; those of the next offset are a row of the tile farther.
    pub weights: usize,
    pub x: isize,
    pub y: isize,
}

/// Turns the weights of a chunk's windows into those by which pixels add up to the models' values.
#[inline(always)]
pub(super) fn fit(filter: &Filter, offsets: &[(isize, isize)], chunk: Chunk, weights: &mut [f32]) {
    let guides = filter.guides;
    let p = guides.place(0, chunk.x, chunk.y);
    let mut center = Aligned([[0.0f32; LANES]; TERMS]);
    for g in 0..guides.count {
        center.0[g] = *lanes(guides.data(), p + g * guides.plane_length());
    }
    let n = guides.count + 3;
    let mut terms = Aligned([[1.0f32; LANES]; TERMS]);
    let mut moments = Aligned([[0.0f32; LANES]; PRODUCTS]);
    for (o, &offset) in offsets.iter().enumerate() {
        let weight = lanes(weights, chunk.weights + o * TILE);
        differences(filter, &center.0, p, offset, &mut terms.0);
        add_products(&terms.0, weight, n, &mut moments.0);
    }
    let row = first_row_of_inverse(&mut moments.0, n);
    for (o, &offset) in offsets.iter().enumerate() {
        differences(filter, &center.0, p, offset, &mut terms.0);
        let mut factor = [0.0f32; LANES];
        for i in 0..n {
            for l in 0..LANES {
                factor[l] += row[i][l] * terms.0[i][l];
            }
        }
        let at = chunk.weights + o * TILE;
        let weights = &mut weights[at..at + LANES];
        for l in 0..LANES {
            weights[l] *= factor[l];
        }
    }
}

/// Adds the weighted products of all pairs of terms.
#[inline(always)]
fn add_products(terms: &[Lanes; TERMS], weight: &Lanes, n: usize, moments: &mut [Lanes; PRODUCTS]) {
    if n == TERMS {
        // All loops unroll.
        add_products_of(terms, weight, TERMS, moments);
    } else {
        add_products_of(terms, weight, n, moments);
    }
}

#[inline(always)]
fn add_products_of(terms: &[Lanes; TERMS], weight: &Lanes, n: usize, moments: &mut [Lanes; PRODUCTS]) {
    let mut k = 0;
    for i in 0..n {
        let mut weighted = [0.0f32; LANES];
        for l in 0..LANES {
            weighted[l] = weight[l] * terms[i][l];
        }
        for j in i..n {
            for l in 0..LANES {
                moments[k][l] += weighted[l] * terms[j][l];
            }
            k += 1;
        }
    }
}

/// What the model is linear in, at an offset from the pixels of a chunk: 1 (left as it is), differences of the guides, the
/// offset.
#[inline(always)]
fn differences(
    filter: &Filter,
    center: &[Lanes; TERMS],
    p: usize,
    (dx, dy): (isize, isize),
    terms: &mut [Lanes; TERMS],
) {
    let guides = filter.guides;
    let q = guides.moved(p, dx, dy);
    for g in 0..guides.count {
        let there = lanes(guides.data(), q + g * guides.plane_length());
        for l in 0..LANES {
            terms[g + 1][l] = there[l] - center[g][l];
        }
    }
    terms[guides.count + 1] = [dx as f32 / RADIUS as f32; LANES];
    terms[guides.count + 2] = [dy as f32 / RADIUS as f32; LANES];
}

/// The first row of the inverse of a symmetric matrix of `n` rows, given by the rows of its upper triangle, with a ridge on
/// all of the diagonal but the first: by the decomposition into `U^T D U`.
#[inline(always)]
fn first_row_of_inverse(a: &mut [Lanes; PRODUCTS], n: usize) -> [Lanes; TERMS] {
    let mut diagonal = [0usize; TERMS];
    let mut next = 0;
    for (i, place) in diagonal.iter_mut().enumerate().take(n) {
        *place = next;
        next += n - i;
    }
    let total = a[0];
    for &place in &diagonal[1..n] {
        for l in 0..LANES {
            a[place][l] += RIDGE * total[l] + f32::MIN_POSITIVE;
        }
    }
    let mut inverse = [[0.0f32; LANES]; TERMS];
    for i in 0..n {
        for l in 0..LANES {
            let pivot = a[diagonal[i]][l];
            inverse[i][l] = if pivot > 1e-20 { 1.0 / pivot } else { 0.0 };
        }
        for j in i + 1..n {
            let mut factor = [0.0f32; LANES];
            for l in 0..LANES {
                factor[l] = a[diagonal[i] + j - i][l] * inverse[i][l];
            }
            for m in j..n {
                for l in 0..LANES {
                    a[diagonal[j] + m - j][l] -= factor[l] * a[diagonal[i] + m - i][l];
                }
            }
        }
    }
    substitute(a, &diagonal, &inverse, n)
}

/// Solves `U^T D U z = (1, 0, ...)`, where the rows of `a` are those of `D U`.
#[inline(always)]
fn substitute(
    a: &[Lanes; PRODUCTS],
    diagonal: &[usize; TERMS],
    inverse: &[Lanes; TERMS],
    n: usize,
) -> [Lanes; TERMS] {
    let mut z = [[0.0f32; LANES]; TERMS];
    z[0] = [1.0; LANES];
    for i in 1..n {
        for j in 0..i {
            for l in 0..LANES {
                let factor = a[diagonal[j] + i - j][l] * inverse[j][l];
                z[i][l] -= factor * z[j][l];
            }
        }
    }
    for i in 0..n {
        for l in 0..LANES {
            z[i][l] *= inverse[i][l];
        }
    }
    let mut i = n;
    while i > 0 {
        i -= 1;
        for j in i + 1..n {
            for l in 0..LANES {
                let factor = a[diagonal[i] + j - i][l] * inverse[i][l];
                z[i][l] -= factor * z[j][l];
            }
        }
    }
    z
}
