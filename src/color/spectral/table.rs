//! Sigmoids of all colours of Rec. 709, between which those of textures are found.

use super::fit::fit;
use super::sigmoid::Sigmoid;
use rayon::prelude::*;
use std::sync::OnceLock;

/// Nodes along each axis.
const NODES: usize = 32;

/// Sigmoids by the brightest channel, its value, and the ratios of the others to it (Jakob, Hanika 2019, section 4).
pub(super) struct Table {
    /// Values of the brightest channel, denser towards 0 and 1, where sigmoids change most.
    levels: [f32; NODES],
    /// Ratios, denser towards 0 and 1, too: saturated colours.
    ratios: [f32; NODES],
    sigmoids: Vec<Sigmoid>,
}

fn smooth(x: f64) -> f64 {
    x * x * (3.0 - 2.0 * x)
}

fn levels() -> [f64; NODES] {
    std::array::from_fn(|i| smooth(smooth(i as f64 / (NODES - 1) as f64)))
}

fn ratios() -> [f64; NODES] {
    std::array::from_fn(|i| smooth(i as f64 / (NODES - 1) as f64))
}

/// The table, made when it is first asked for: in some tenths of a second.
pub(super) fn table() -> &'static Table {
    static TABLE: OnceLock<Table> = OnceLock::new();
    TABLE.get_or_init(|| {
        let (levels, ratios) = (levels(), ratios());
        let rows: Vec<(usize, usize)> = (0..3).flat_map(|m| (0..NODES).map(move |y| (m, y))).collect();
        let columns: Vec<Vec<Sigmoid>> = rows
            .into_par_iter()
            .flat_map_iter(|(m, y)| (0..NODES).map(move |x| column(&levels, m, ratios[y], ratios[x])))
            .collect();
        // From columns to planes of one level.
        let at = |i: usize| {
            let (m, level, rest) = (i / NODES.pow(3), i / NODES.pow(2) % NODES, i % NODES.pow(2));
            columns[m * NODES.pow(2) + rest][level]
        };
        let sigmoids = (0..3 * NODES.pow(3)).map(at).collect();
        let single = |nodes: [f64; NODES]| nodes.map(|node| node as f32);
        Table { levels: single(levels), ratios: single(ratios), sigmoids }
    })
}

/// The sigmoids of one chromaticity at all levels: each starts from its neighbour, the first in the middle.
fn column(levels: &[f64; NODES], brightest: usize, y: f64, x: f64) -> Vec<Sigmoid> {
    let solve = |level: f64, start: [f64; 3]| {
        let mut rgb = [0.0; 3];
        rgb[brightest] = level;
        rgb[(brightest + 1) % 3] = level * x;
        rgb[(brightest + 2) % 3] = level * y;
        fit(rgb, start).0
    };
    let mut found = vec![Sigmoid::default(); NODES];
    let single = |c: [f64; 3]| Sigmoid(c.map(|v| v as f32));
    let middle = NODES / 2;
    let first = solve(levels[middle], [0.0; 3]);
    let mut last = first;
    for i in middle..NODES {
        last = solve(levels[i], last);
        found[i] = single(last);
    }
    last = first;
    for i in (1..middle).rev() {
        last = solve(levels[i], last);
        found[i] = single(last);
    }
    // Nothing is darker than the second level: see `Table::of`.
    found[0] = found[1];
    found
}

impl Table {
    /// The sigmoid of a colour within 0..1 that is not black, and what it must be taken times: 1 for all but the darkest.
    #[inline]
    pub fn of(&self, rgb: [f32; 3]) -> (Sigmoid, f32) {
        let [r, g, b] = rgb;
        let m = if r >= g && r >= b { 0 } else { 1 + usize::from(b > g) };
        let most = rgb[m];
        // The node before a value, and the share of the next one.
        let split = |nodes: &[f32; NODES], value: f32| {
            let i = nodes.partition_point(|&node| node <= value).clamp(1, NODES - 1) - 1;
            (i, (value - nodes[i]) / (nodes[i + 1] - nodes[i]))
        };
        let (x, u) = split(&self.ratios, rgb[(m + 1) % 3] / most);
        let (y, v) = split(&self.ratios, rgb[(m + 2) % 3] / most);
        let level = most.clamp(self.levels[1], 1.0);
        let (z, w) = split(&self.levels, level);
        let mut sum = [0.0; 3];
        for (k, of_level) in [(z, 1.0 - w), (z + 1, w)] {
            for (j, of_row) in [(y, 1.0 - v), (y + 1, v)] {
                let first = ((m * NODES + k) * NODES + j) * NODES + x;
                for (i, of_column) in [(first, 1.0 - u), (first + 1, u)] {
                    let weight = of_level * of_row * of_column;
                    let Sigmoid(c) = &self.sigmoids[i];
                    (0..3).for_each(|n| sum[n] += weight * c[n]);
                }
            }
        }
        (Sigmoid(sum), most / level)
    }
}
