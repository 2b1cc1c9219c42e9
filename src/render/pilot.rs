//! Whether a picture gains by sharing paths between its pixels: some squares of its first pass try.

use super::schedule::Pass;
use crate::compile::View;
use crate::integrator::reuse::{Connections, GroupShape, INTERVAL};
use crate::integrator::{Block, PathSample};
use crate::sampling::hash::r2_sequence;
use std::collections::HashSet;

/// Edge of a square in pixels.
const EDGE: u32 = 32;

/// One square of so many tries.
const SQUARES: u32 = 24;

/// Fewest squares for each shape of groups: one alone could be a special place.
const LEAST_SQUARES: u32 = 3;

/// Width, height and spacing of the groups that are tried. Those of the last are large, and tried only where connections
/// are few.
const CANDIDATES: [(u32, u32, u32); 3] = [(2, 2, 2), (4, 4, 4), (8, 8, 4)];

/// Sharing must be more efficient than not sharing by this factor.
const LEAST_GAIN: f64 = 1.25;

/// Time that a connection takes, as a part of the time of another ray with all that belongs to it; and what sharing takes
/// besides, as a part of the time without.
/// (Processor time of the Cornell box, of a room lit through a door and of a room with 1000 lamps with groups of 4x4 pixels
/// was 2.0, 1.2 and 1.5 times that without on an Intel Xeon with AVX-512, at 1.5, 0.1 and 1.3 connections for each other ray.)
const CONNECTION_COST: f64 = 0.85;
const FIXED_COST: f64 = 0.05;

/// The same of a connection that was tested together with the others to the same suffix. (The Cornell box: 1.4 times at 1.5
/// connections for each other ray, 2.0 times at 7.)
const FAN_CONNECTION_COST: f64 = 0.17;

/// Time of connections, as above, up to which larger groups are tried.
const MOST_COST: f64 = 0.5;

/// Largest error that a pixel may count for, relative to its value: rare bright samples would else decide alone.
const LARGEST_ERROR: f64 = 3.0;

/// The squares that try a shape of groups.
pub(super) struct Trial {
    pub shape: GroupShape,
    pub squares: Vec<Block>,
}

/// The trials of a pass, of the candidates in their order; none if it has a single sample or the picture is too small.
pub(super) fn trials(view: &View, pass: Pass) -> Vec<Trial> {
    let (columns, rows) = (view.width / EDGE, view.height / EDGE);
    let of_each = (columns * rows).div_ceil(SQUARES * CANDIDATES.len() as u32).max(LEAST_SQUARES);
    let count = of_each * CANDIDATES.len() as u32;
    // From the next change of groups on, these would lie across squares.
    if pass.samples < 2 || pass.first_sample >= INTERVAL || columns * rows < 3 * count {
        return Vec::new();
    }
    let mut taken = HashSet::new();
    let new = places(columns, rows).filter(|&place| taken.insert(place)).take(count as usize);
    let squares: Vec<Block> = new.map(|(x, y)| square(x, y, pass)).collect();
    let shapes =
        CANDIDATES.iter().filter_map(|&(width, height, spacing)| GroupShape::new(width, height, spacing));
    // In turn, so that the squares of each are spread evenly.
    let of_turn = |turn| squares.iter().skip(turn).step_by(CANDIDATES.len()).copied().collect();
    shapes.enumerate().map(|(turn, shape)| Trial { shape, squares: of_turn(turn) }).collect()
}

fn square(x: u32, y: u32, pass: Pass) -> Block {
    let Pass { first_sample, samples } = pass;
    Block { x0: x * EDGE, y0: y * EDGE, width: EDGE, height: EDGE, first_sample, samples }
}

/// Is the next candidate, which has four times as many connections as the last one, worth a trial?
pub(super) fn is_next_worth_it(results: &[(GroupShape, Errors)]) -> bool {
    let Some((_, last)) = results.last().filter(|_| results.len() == CANDIDATES.len() - 1) else {
        return true;
    };
    last.gain() >= LEAST_GAIN && last.cost_of_connections() < MOST_COST
}

/// Places that fill a grid evenly, however many are taken.
fn places(columns: u32, rows: u32) -> impl Iterator<Item = (u32, u32)> {
    let scaled = |fraction: u32, size: u32| {
        let from_the_middle = fraction.wrapping_add(1 << 31);
        ((u64::from(from_the_middle) * u64::from(size)) >> 32) as u32
    };
    (0..).map(r2_sequence).map(move |[x, y]| (scaled(x, columns), scaled(y, rows)))
}

/// The tiles that no trial has covered.
pub(super) fn without(mut tiles: Vec<Block>, trials: &[Trial]) -> Vec<Block> {
    let squares = trials.iter().flat_map(|trial| &trial.squares);
    let covered: HashSet<_> = squares.map(|s| (s.x0 / EDGE, s.y0 / EDGE)).collect();
    let is_in_one = |t: &Block| t.x0 % EDGE + t.width <= EDGE && t.y0 % EDGE + t.height <= EDGE;
    debug_assert!(covered.is_empty() || tiles.iter().all(is_in_one), "tiles lie within squares or without");
    tiles.retain(|tile| !covered.contains(&(tile.x0 / EDGE, tile.y0 / EDGE)));
    tiles
}

/// The two halves of a pixel's samples, with paths shared and without.
#[derive(Clone, Copy, Default)]
struct Halves {
    shared: [[f64; 3]; 2],
    unshared: [[f64; 3]; 2],
    count: u32,
}

/// What a square has shown.
pub(super) struct Tally {
    pixels: Vec<Halves>,
    /// Half the samples of a pixel.
    half: u32,
    rays: u64,
    connections: Connections,
}

impl Tally {
    pub fn new(block: &Block) -> Tally {
        let pixels = vec![Halves::default(); (block.width * block.height) as usize];
        Tally { pixels, half: block.samples / 2, rays: 0, connections: Connections::default() }
    }

    pub fn add(&mut self, sample: &PathSample<'_>) {
        let pixel = &mut self.pixels[sample.pixel as usize];
        let half = pixel.count / self.half;
        pixel.count += 1;
        let add = |sums: &mut [[f64; 3]; 2], rgb: [f32; 3]| {
            if let Some(sum) = sums.get_mut(half as usize) {
                sum.iter_mut().zip(rgb).for_each(|(sum, v)| *sum += f64::from(v));
            }
        };
        add(&mut pixel.shared, sample.rgb);
        add(&mut pixel.unshared, sample.unshared);
    }

    /// Counts rays, and those of them that connected paths.
    pub fn count(&mut self, rays: u64, connections: Connections) {
        (self.rays, self.connections) = (self.rays + rays, self.connections.plus(connections));
    }

    /// Sums of squared errors relative to the pixels' values, from the difference of the halves.
    pub fn finish(&self) -> Errors {
        let mut errors = Errors { rays: self.rays, connections: self.connections, ..Errors::default() };
        for pixel in &self.pixels {
            for c in 0..3 {
                let scale = 1.0 / f64::from(self.half);
                let mean = 0.5 * scale * (pixel.shared[0][c] + pixel.shared[1][c]);
                let error = |sums: &[[f64; 3]; 2]| {
                    let difference = (sums[0][c] - sums[1][c]) * scale;
                    let squared = difference * difference / (mean * mean + 0.01);
                    // NaN counts as nothing.
                    if squared > 0.0 { squared.min(LARGEST_ERROR * LARGEST_ERROR) } else { 0.0 }
                };
                errors.shared += error(&pixel.shared);
                errors.unshared += error(&pixel.unshared);
            }
        }
        errors
    }
}

/// Squared errors of some pixels, and the rays that they took.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Errors {
    pub shared: f64,
    pub unshared: f64,
    /// All, and those that connected paths.
    pub rays: u64,
    pub connections: Connections,
}

impl Errors {
    pub fn plus(self, other: Errors) -> Errors {
        Errors {
            shared: self.shared + other.shared,
            unshared: self.unshared + other.unshared,
            rays: self.rays + other.rays,
            connections: self.connections.plus(other.connections),
        }
    }

    /// Time that connections take, as a part of the time of all else.
    fn cost_of_connections(&self) -> f64 {
        let Connections { single, in_fans } = self.connections;
        let others = (self.rays - single - in_fans).max(1) as f64;
        (CONNECTION_COST * single as f64 + FAN_CONNECTION_COST * in_fans as f64) / others
    }

    /// How many times more efficient sharing is.
    fn gain(&self) -> f64 {
        if self.shared <= 0.0 {
            return 0.0;
        }
        let cost = 1.0 + FIXED_COST + self.cost_of_connections();
        self.unshared / self.shared / cost
    }
}

/// The shape of groups that gains most; `None` if none gains enough.
pub(super) fn best(results: &[(GroupShape, Errors)]) -> Option<GroupShape> {
    let gains = results.iter().map(|(shape, errors)| (*shape, errors.gain()));
    let best = gains.max_by(|a, b| a.1.total_cmp(&b.1));
    best.filter(|(_, gain)| *gain >= LEAST_GAIN).map(|(shape, _)| shape)
}
