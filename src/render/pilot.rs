//! Which technique a picture gains by: some squares of its first pass try.

use super::halves::Halves;
use super::schedule::Pass;
use super::technique::{Choice, Technique};
use crate::compile::View;
use crate::integrator::reuse::{GroupShape, INTERVAL};
use crate::integrator::{Block, PathSample, RayCounts};
use crate::sampling::hash::r2_sequence;
use std::collections::HashSet;

/// Edge of a square in pixels.
const EDGE: u32 = 32;

/// One square of so many tries.
const SQUARES: u32 = 24;

/// Fewest squares for each candidate: one alone could be a special place.
const LEAST_SQUARES: u32 = 3;

/// Width, height and spacing of the groups that are tried. Those of the last are large, and tried only where connections
/// are few.
const SHAPES: [(u32, u32, u32); 3] = [(2, 2, 2), (4, 4, 4), (8, 8, 4)];

/// Paths that samples of a trial of splitting go on in; what other numbers would bring follows.
const BRANCHES: u32 = 4;

/// Most paths that samples go on in by a trial.
const MOST_BRANCHES: u32 = 8;

/// Sharing must be more efficient than not sharing by this factor.
const LEAST_GAIN: f64 = 1.25;

/// Splitting must be more efficient than not splitting by this factor: what few bright pixels hide shows later.
const LEAST_GAIN_OF_SPLITTING: f64 = 1.4;

/// Squares whose trial left so many times the squared error that the best technique leaves are taken again with that one. (Over
/// all samples of a picture, what is gained is worth what it takes from twice the error on, and earlier where samples are spread
/// so evenly that their error falls faster than their number grows.)
const WORSE: f64 = 1.5;

/// So many times as many squares as a shape of groups try splitting, and the best shape again where its gain is not clear:
/// it differs from place to place (a polished helmet under a sky gains nothing by splitting; of its squares, 4 of 256 took that
/// for a gain in every seventh try, 12 of them in every fortieth).
const MORE_SQUARES: u32 = 3;

/// A few squares try splitting first, as many as a shape of groups; the others only where it seems so efficient.
const PROMISING: f64 = 1.15;

/// Larger groups are tried only where the smallest ones are so efficient: what these can't share, larger ones can't either.
const HOPEFUL: f64 = 0.8;

/// Where sharing gains more than this, splitting is not tried: it seldom gains as much.
const CLEAR_GAIN: f64 = 3.0;

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

/// What some squares try.
#[derive(Clone, Copy, Debug)]
enum Question {
    /// Sharing in groups of a shape.
    Shape(GroupShape),
    /// The best of these again, where its gain is not clear.
    Again,
    /// Splitting; the first squares that try it, and others if these promise something.
    Splitting,
    SplittingAgain,
}

/// The squares that try something.
pub(super) struct Trial {
    question: Question,
    pub squares: Vec<Block>,
}

/// The trials of a pass, in their order; none if it has a single sample or the picture is too small.
pub(super) fn trials(choice: Choice, view: &View, pass: Pass) -> Vec<Trial> {
    let (columns, rows) = (view.width / EDGE, view.height / EDGE);
    let shapes = SHAPES.len() as u32;
    let of_each = (columns * rows).div_ceil(SQUARES * shapes).max(LEAST_SQUARES);
    // From the next change of groups on, these would lie across squares.
    let is_possible = pass.samples >= 2 && pass.first_sample < INTERVAL;
    if !is_possible || columns * rows < 3 * shapes * of_each {
        return Vec::new();
    }
    let more = (MORE_SQUARES * of_each).min(columns * rows / 10) as usize;
    let mut taken = HashSet::new();
    let new = places(columns, rows).filter(|&place| taken.insert(place));
    let count = (shapes * of_each) as usize + 2 * more;
    let squares: Vec<Block> = new.take(count).map(|(x, y)| square(x, y, pass)).collect();
    let (of_shapes, others) = squares.split_at((shapes * of_each) as usize);
    let (of_splitting, again) = others.split_at(more);
    let shape = |&(width, height, spacing): &(u32, u32, u32)| GroupShape::new(width, height, spacing);
    let mut trials = Vec::new();
    if choice.may_share {
        // In turn, so that the squares of each are spread evenly.
        let of_turn = |turn| of_shapes.iter().skip(turn).step_by(SHAPES.len()).copied().collect();
        let shared = SHAPES.iter().filter_map(shape).enumerate();
        trials.extend(shared.map(|(turn, s)| Trial { question: Question::Shape(s), squares: of_turn(turn) }));
        trials.push(Trial { question: Question::Again, squares: again.to_vec() });
    }
    if choice.may_split {
        let (first, others) = of_splitting.split_at(more.min(of_each as usize));
        trials.push(Trial { question: Question::Splitting, squares: first.to_vec() });
        trials.push(Trial { question: Question::SplittingAgain, squares: others.to_vec() });
    }
    trials
}

fn square(x: u32, y: u32, pass: Pass) -> Block {
    let Pass { first_sample, samples } = pass;
    Block { x0: x * EDGE, y0: y * EDGE, width: EDGE, height: EDGE, first_sample, samples }
}

/// The technique that a trial tries after what the earlier ones showed, if that is worth while.
pub(super) fn technique_of(trial: &Trial, results: &[(Technique, Errors)]) -> Option<Technique> {
    let so_far = best(results);
    let splitting = Technique::Alone { branches: BRANCHES };
    match trial.question {
        Question::Shape(shape) => {
            let is_hopeful = match results {
                [] => true,
                [(_, smallest)] => smallest.gain_of_sharing() >= HOPEFUL,
                // The last shape's groups have four times as many connections as these.
                [.., (_, last)] => {
                    last.gain_of_sharing() >= LEAST_GAIN && last.cost_of_connections() < MOST_COST
                }
            };
            is_hopeful.then_some(Technique::Shared(shape))
        }
        Question::Again => Some(so_far.technique).filter(|t| t.shape().is_some() && so_far.gain < CLEAR_GAIN),
        Question::Splitting => Some(splitting).filter(|_| so_far.gain < CLEAR_GAIN),
        Question::SplittingAgain => {
            let tried = results.last().filter(|(technique, _)| *technique == splitting);
            tried.filter(|(_, errors)| errors.gain_of_splitting() >= PROMISING).map(|_| splitting)
        }
    }
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

/// What a pixel has got, with the technique that is tried and without it.
#[derive(Clone, Copy, Default)]
struct PixelTally {
    tried: Halves,
    plain: Halves,
    count: u32,
}

/// What a block has shown.
pub(super) struct Tally {
    pixels: Vec<PixelTally>,
    /// Half the samples of a pixel.
    half: u32,
    rays: RayCounts,
}

impl Tally {
    pub fn new(block: &Block) -> Tally {
        let pixels = vec![PixelTally::default(); (block.width * block.height) as usize];
        Tally { pixels, half: block.samples / 2, rays: RayCounts::default() }
    }

    pub fn add(&mut self, sample: &PathSample<'_>) {
        let pixel = &mut self.pixels[sample.pixel as usize];
        let half = pixel.count / self.half;
        pixel.count += 1;
        pixel.tried.add(half, sample.rgb);
        pixel.plain.add(half, sample.plain);
    }

    /// Counts rays.
    pub fn count(&mut self, rays: RayCounts) {
        self.rays = self.rays.plus(rays);
    }

    /// Rays of a sample.
    pub fn rays_per_sample(&self) -> f64 {
        self.rays.all as f64 / f64::from(self.samples().max(1))
    }

    fn samples(&self) -> u32 {
        self.pixels.iter().map(|pixel| pixel.count).sum()
    }

    /// Rays of a sample without the technique that is tried.
    pub fn plain_rays_per_sample(&self) -> f64 {
        let RayCounts { all, single, in_fans, in_branches } = self.rays;
        let others = (all - single - in_fans - in_branches) as f64;
        (others + in_branches as f64 / f64::from(BRANCHES)) / f64::from(self.samples().max(1))
    }

    /// Squared errors of the pixels of the picture.
    pub fn of_picture(&self) -> Vec<f32> {
        self.pixels.iter().map(|pixel| pixel.tried.squared_error(self.half, &pixel.tried) as f32).collect()
    }

    /// The same without the technique that is tried.
    pub fn of_plain(&self) -> Vec<f32> {
        self.pixels.iter().map(|pixel| pixel.plain.squared_error(self.half, &pixel.tried) as f32).collect()
    }

    /// Sums of squared errors relative to the pixels' values, from the difference of the halves.
    pub fn finish(&self) -> Errors {
        let mut errors = Errors { rays: self.rays, ..Errors::default() };
        for pixel in &self.pixels {
            errors.tried += pixel.tried.squared_error(self.half, &pixel.tried);
            errors.plain += pixel.plain.squared_error(self.half, &pixel.tried);
        }
        errors
    }
}

/// Squared errors of some pixels, and the rays that they took.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Errors {
    pub tried: f64,
    pub plain: f64,
    pub rays: RayCounts,
}

impl Errors {
    pub fn plus(self, other: Errors) -> Errors {
        Errors {
            tried: self.tried + other.tried,
            plain: self.plain + other.plain,
            rays: self.rays.plus(other.rays),
        }
    }

    /// Time that connections take, as a part of the time of all else.
    fn cost_of_connections(&self) -> f64 {
        let RayCounts { all, single, in_fans, .. } = self.rays;
        let others = (all - single - in_fans).max(1) as f64;
        (CONNECTION_COST * single as f64 + FAN_CONNECTION_COST * in_fans as f64) / others
    }

    /// The part of the squared error that what was tried leaves.
    fn left(&self) -> f64 {
        if self.plain > 0.0 { self.tried / self.plain } else { 1.0 }
    }

    /// How many times more efficient sharing is.
    fn gain_of_sharing(&self) -> f64 {
        if self.tried <= 0.0 {
            return 0.0;
        }
        let cost = 1.0 + FIXED_COST + self.cost_of_connections();
        self.plain / self.tried / cost
    }

    /// How many times more efficient splitting is, into as many paths as suits best.
    fn gain_of_splitting(&self) -> f64 {
        numbers_of_branches().map(|branches| self.splitting_into(branches).gain).fold(0.0, f64::max)
    }

    /// What splitting into so many paths brings: the part of the error that comes from them falls with their number, and
    /// their rays grow with it.
    fn splitting_into(&self, branches: u32) -> Best {
        let (tried, number) = (f64::from(BRANCHES), f64::from(branches));
        let suffixes = (1.0 - self.tried / self.plain.max(1e-30)) / (1.0 - 1.0 / tried);
        let suffixes = suffixes.clamp(0.0, 1.0);
        let suffix_rays = self.rays.in_branches as f64 / tried;
        let prefix_rays = (self.rays.all - self.rays.in_branches) as f64;
        let change = Change {
            error: 1.0 - suffixes + suffixes / number,
            cost: (prefix_rays + number * suffix_rays) / (prefix_rays + suffix_rays).max(1.0),
        };
        let (technique, gain) = (Technique::Alone { branches }, 1.0 / (change.error * change.cost));
        Best { technique, change, left: change.error, gain }
    }
}

/// Factors by which a technique changes the squared error and the rays of a sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct Change {
    pub error: f64,
    pub cost: f64,
}

impl Change {
    pub const NONE: Change = Change { error: 1.0, cost: 1.0 };
}

/// A technique, and what it brings.
#[derive(Clone, Copy, Debug)]
pub(super) struct Best {
    pub technique: Technique,
    /// What splitting changes.
    pub change: Change,
    /// The part of the squared error of the plain technique that it leaves.
    left: f64,
    /// How many times more efficient it is than the plain one.
    gain: f64,
}

impl Best {
    /// Are squares with what was tried in them so much noisier than by this that they are worth being taken again? Pictures
    /// that gain by nothing pay nothing.
    pub fn replaces(&self, tried: Technique, errors: &Errors) -> bool {
        let is_other = tried != self.technique && self.technique != Technique::PLAIN;
        is_other && errors.left() > WORSE * self.left
    }
}

/// How many paths samples may go on in.
fn numbers_of_branches() -> impl Iterator<Item = u32> {
    (1..=MOST_BRANCHES.trailing_zeros()).map(|bits| 1 << bits)
}

/// The technique that gains most, or the plain one if none gains enough.
pub(super) fn best(results: &[(Technique, Errors)]) -> Best {
    // All squares that tried the same together.
    let of = |technique: Technique| {
        let same = results.iter().filter(|(other, _)| *other == technique);
        same.fold(Errors::default(), |sum, (_, errors)| sum.plus(*errors))
    };
    let candidates = results.iter().map(|(technique, _)| *technique).flat_map(|technique| match technique {
        Technique::Shared(_) => {
            let gain = of(technique).gain_of_sharing();
            let best = Best { technique, change: Change::NONE, left: of(technique).left(), gain };
            if gain >= LEAST_GAIN { vec![best] } else { Vec::new() }
        }
        Technique::Alone { .. } => {
            let ways = numbers_of_branches().map(|branches| of(technique).splitting_into(branches));
            ways.filter(|way| way.gain >= LEAST_GAIN_OF_SPLITTING).collect()
        }
    });
    let plain = Best { technique: Technique::PLAIN, change: Change::NONE, left: 1.0, gain: 1.0 };
    candidates.fold(plain, |best, next| if next.gain > best.gain { next } else { best })
}
