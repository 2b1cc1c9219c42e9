//! Fireflies: pixels that a rare path made far brighter than all around them.

use super::planes::Color;
use crate::color::luminance;
use rayon::prelude::*;

/// Radius of the neighbourhood that pixels are compared with.
const RADIUS: usize = 2;
/// As many neighbours that are as bright make a pixel part of what it shows.
const RANK: usize = 3;
/// How many times as bright as the neighbour of that rank, and as the darker of the halves, a pixel may be.
const LIMIT: f32 = 10.0;

/// Factors in 0..1 that take the fireflies out. The deviations show what is in both halves of the samples, which is really
/// there.
pub(super) fn factors(width: usize, height: usize, color: Color, deviations: Option<Color>) -> Vec<f32> {
    let at = |planes: Color, i: usize| luminance([planes[0][i], planes[1][i], planes[2][i]]);
    let brightness: Vec<f32> = (0..width * height).map(|i| at(color, i)).collect();
    let factor = |x: usize, y: usize| {
        let own = brightness[y * width + x];
        let mut largest = [0.0f32; RANK];
        for v in y.saturating_sub(RADIUS)..(y + RADIUS + 1).min(height) {
            for u in x.saturating_sub(RADIUS)..(x + RADIUS + 1).min(width) {
                let mut value = if (u, v) == (x, y) { 0.0 } else { brightness[v * width + u] };
                for kept in &mut largest {
                    (*kept, value) = (kept.max(value), kept.min(value));
                }
            }
        }
        let darker = deviations.map_or(0.0, |d| own - at(d, y * width + x).abs());
        let limit = LIMIT * largest[RANK - 1].max(darker);
        if own > limit { limit / own } else { 1.0 }
    };
    let mut factors = vec![1.0; width * height];
    let rows = factors.par_chunks_mut(width).enumerate();
    rows.for_each(|(y, row)| row.iter_mut().enumerate().for_each(|(x, to)| *to = factor(x, y)));
    factors
}
