//! Path strategies: plain, path splitting at the first surface, or path reuse between pixels. Trials on some squares of the first pass
//! select one.

use super::options::{PathReuse, RenderOptions, Splitting};
use super::progress::Statistics;
use super::schedule::Pass;
use super::technique::{
    EDGE, Errors, LightPathCost, PassTrial, RenderedSquares, Request, Target, Technique, first_reason,
};
use crate::compile::{Medium, View};
use crate::integrator::reuse::{GroupShape, INTERVAL, Tiling};
use crate::integrator::{Block, IntegratorOptions, RayCounts, SamplePlan};
use crate::sampling::ZSobolOrder;
use crate::sampling::hash::r2_sequence;
use std::collections::HashSet;
use std::sync::{Mutex, MutexGuard, PoisonError};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PathStrategy {
    /// Independent samples, split into branches at the first surface.
    Independent {
        /// Number of branches, a power of two; 1 without splitting.
        branches: u32,
    },
    /// Path reuse in groups of pixels.
    Reuse(GroupShape),
}

impl PathStrategy {
    /// No splitting and no reuse.
    pub const PLAIN: PathStrategy = PathStrategy::Independent { branches: 1 };

    /// The groups of path reuse, if in use.
    pub fn shape(self) -> Option<GroupShape> {
        match self {
            PathStrategy::Independent { .. } => None,
            PathStrategy::Reuse(shape) => Some(shape),
        }
    }

    /// Number of branches per sample.
    pub fn branches(self) -> u32 {
        match self {
            PathStrategy::Independent { branches } => branches,
            PathStrategy::Reuse(_) => 1,
        }
    }

    pub fn configure(self, pass: Pass, options: &RenderOptions, paths: &mut IntegratorOptions<'_>) {
        paths.branches = self.branches();
        paths.reuse = self.shape().map(|shape| Tiling::new(shape, pass.first_sample));
        if let SamplePlan::Even(_) = paths.plan {
            let planned = options.samples.max(options.planned);
            paths.plan = SamplePlan::Even(ZSobolOrder::new(options.seed, planned, self.branches()));
        }
    }
}

/// Path reuse or splitting, selected by trials in the first pass.
#[derive(Debug)]
pub(super) struct StrategyTrials(Mutex<StrategyState>);

/// The current strategy, and whether trials may still replace it.
#[derive(Clone, Copy, Debug)]
struct StrategyState {
    current: PathStrategy,
    may_reuse: bool,
    may_split: bool,
}

/// The reason that prevents path reuse, if any.
fn reuse_prevented_by(target: &Target<'_>) -> Option<&'static str> {
    let Target { scene, options, .. } = target;
    let features = &scene.features;
    first_reason(&[
        // Suffixes have radiance at other wavelengths.
        (scene.shading.spectral, "they carry wavelengths of their own"),
        // Connections would have to estimate transmittance. Other media are enclosed by surfaces, which occlude connections.
        (scene.media.first().is_some_and(Medium::has_effect), "a medium fills the scene"),
        (!scene.lights.volumes().is_empty(), "the scene has emissive media"),
        (options.catchers, "the scene has shadow catchers"),
        // The ray kind of a connection differs from that of the path it replaces.
        (features.links, "lights of the scene are linked to some objects only"),
        (features.ray_kinds, "objects or lights of the scene are visible to some ray kinds only"),
        // Each path has its own time, and its own stochastic opacity of splats.
        (scene.accel.uses_times(), "something moves in the scene, or it has Gaussian splats"),
        (options.max_depth < 2, "there is no indirect light with so few bounces"),
    ])
}

impl StrategyTrials {
    /// The strategies allowed by the options.
    pub fn new(target: &Target<'_>) -> StrategyTrials {
        let options = target.options;
        let can_reuse = reuse_prevented_by(target).is_none();
        let can_split = options.max_depth >= 1 && !options.catchers && options.clamp.direct == f32::INFINITY;
        if let PathReuse::Groups(shape) = options.path_reuse
            && can_reuse
        {
            return StrategyTrials::decided(PathStrategy::Reuse(shape));
        }
        let branches = match options.splitting {
            Splitting::Into(branches) if can_split => branches,
            _ => 1,
        };
        StrategyTrials(Mutex::new(StrategyState {
            current: PathStrategy::Independent { branches },
            may_reuse: can_reuse
                && options.path_reuse == PathReuse::Auto
                && matches!(options.splitting, Splitting::Auto | Splitting::OFF),
            may_split: can_split && options.splitting == Splitting::Auto,
        }))
    }

    /// A fixed strategy, without trials.
    pub fn decided(current: PathStrategy) -> StrategyTrials {
        StrategyTrials(Mutex::new(StrategyState { current, may_reuse: false, may_split: false }))
    }

    /// The current strategy.
    pub fn current(&self) -> PathStrategy {
        self.state().current
    }

    fn state(&self) -> MutexGuard<'_, StrategyState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Technique for StrategyTrials {
    fn request(&self, options: &RenderOptions) -> Request {
        match options.path_reuse {
            PathReuse::Groups(_) => Request::On,
            PathReuse::Auto => Request::Auto,
            PathReuse::Off if options.splitting == Splitting::OFF => Request::Off,
            PathReuse::Off => Request::Auto,
        }
    }

    fn unused_warning(&self) -> &'static str {
        "paths are not reused between pixels"
    }

    fn prevented_by(&self, target: &Target<'_>) -> Option<&'static str> {
        reuse_prevented_by(target)
    }

    fn has_pending_trial(&self) -> bool {
        let state = *self.state();
        state.may_reuse || state.may_split
    }

    fn try_in_pass(&self, pass: &dyn PassTrial) -> Option<Vec<Block>> {
        let trials = trials(*self.state(), pass.target().view, pass.pass());
        if trials.is_empty() {
            return Some(Vec::new());
        }
        let tried = try_all(trials, pass);
        let current = tried.as_ref().map_or(PathStrategy::PLAIN, |(best, _)| *best);
        *self.state() = StrategyState { current, may_reuse: false, may_split: false };
        tried.map(|(_, squares)| squares)
    }

    fn configure_pass(&self, pass: Pass, options: &RenderOptions, paths: &mut IntegratorOptions<'_>) {
        self.current().configure(pass, options, paths);
    }

    fn report(&self, statistics: &mut Statistics) {
        statistics.path_reuse = self.current().shape();
        statistics.branches = self.current().branches();
    }
}

/// Reciprocal of the fraction of squares in trials.
const SQUARES_PER_TRIAL: u32 = 24;

/// Minimum number of squares per candidate.
const MIN_SQUARES: u32 = 3;

/// Width, height and spacing of the groups that are tried, pixels. The last are large and tried only if connections are cheap.
const SHAPES: [(u32, u32, u32); 3] = [(2, 2, 2), (4, 4, 4), (8, 8, 4)];

/// Number of branches in a trial of splitting; the gain for other numbers is extrapolated.
const BRANCHES: u32 = 4;

/// Maximum number of branches selected by trials.
const MAX_BRANCHES: u32 = 8;

/// Minimum ratio of the efficiency with path reuse to that without.
const MIN_GAIN: f64 = 1.25;

/// Minimum ratio of the efficiency with splitting to that without. Larger, since a few bright pixels may hide errors of others.
const MIN_GAIN_OF_SPLITTING: f64 = 1.4;

/// Squares whose squared error in the trial exceeds that of the best strategy by this factor are rendered again with that strategy. (Over
/// all samples of a picture this is worthwhile from a factor of two on, and earlier if the error falls faster than one over the number of
/// samples.)
const REPLACED_ERROR: f64 = 1.5;

/// Ratio of the number of squares that try splitting, or repeat the best shape if its gain is unclear, to the number that try a shape:
/// the gain varies over the picture. (For a polished helmet under a sky, which gains nothing by splitting, a trial on 4 of 256 squares
/// showed a gain in one of seven runs, a trial on 12 in one of forty.)
const MORE_SQUARES: u32 = 3;

/// Minimum gain of splitting on the first squares, for trying it on the other squares.
const MIN_GAIN_FOR_MORE_SPLITTING: f64 = 1.15;

/// Minimum gain of the smallest groups, for trying larger ones.
const MIN_GAIN_FOR_LARGER_GROUPS: f64 = 0.8;

/// Gain of reuse above which splitting is not tried, since it rarely gains as much.
const CLEAR_GAIN: f64 = 3.0;

/// Time of a connection, relative to another ray with its shading. (Processor time of the Cornell box, a room lit through a door and a
/// room with 1000 lights with groups of 4x4 pixels, relative to that without reuse, on an Intel Xeon with AVX-512: 2.0, 1.2 and 1.5 at
/// 1.5, 0.1 and 1.3 connections per other ray.)
const CONNECTION_COST: f64 = 0.85;
/// Fixed time of reuse, relative to the time without reuse.
const FIXED_COST: f64 = 0.05;

/// Time of a connection tested together with others to the same suffix. (The Cornell box: 1.4 times the processor time at 1.5 connections
/// per other ray, 2.0 times at 7.)
const POINT_VISIBILITY_COST: f64 = 0.17;

/// Maximum time of all connections, relative to the other rays, for trying larger groups.
const MAX_COST: f64 = 0.5;

/// The subject of a trial.
#[derive(Clone, Copy, Debug)]
enum Tried {
    /// Reuse in groups of a shape.
    Shape(GroupShape),
    /// The best shape again, if its gain is unclear.
    BestShape,
    /// Splitting on a few squares.
    Splitting,
    /// Splitting on more squares, if the first ones gained.
    MoreSplitting,
}

struct SquareTrial {
    tried: Tried,
    squares: Vec<Block>,
}

/// The trials of a pass in order; none if the pass has a single sample or the picture is too small.
fn trials(state: StrategyState, view: &View, pass: Pass) -> Vec<SquareTrial> {
    let (columns, rows) = (view.width / EDGE, view.height / EDGE);
    let shapes = SHAPES.len() as u32;
    let of_each = (columns * rows).div_ceil(SQUARES_PER_TRIAL * shapes).max(MIN_SQUARES);
    // The groups of later passes cross borders of squares.
    let is_possible = pass.samples >= 2 && pass.first_sample < INTERVAL;
    if !is_possible || columns * rows < 3 * shapes * of_each {
        return Vec::new();
    }
    let more = (MORE_SQUARES * of_each).min(columns * rows / 10) as usize;
    let mut seen = HashSet::new();
    let new = square_positions(columns, rows).filter(|&position| seen.insert(position));
    let count = (shapes * of_each) as usize + 2 * more;
    let squares: Vec<Block> = new.take(count).map(|(x, y)| square(x, y, pass)).collect();
    let (of_shapes, others) = squares.split_at((shapes * of_each) as usize);
    let (of_splitting, again) = others.split_at(more);
    let shape = |&(width, height, spacing): &(u32, u32, u32)| GroupShape::new(width, height, spacing);
    let mut trials = Vec::new();
    if state.may_reuse {
        // Interleaved, so that the squares of each shape are spread evenly.
        let squares_of = |k| of_shapes.iter().skip(k).step_by(SHAPES.len()).copied().collect();
        let shared = SHAPES.iter().filter_map(shape).enumerate();
        trials.extend(shared.map(|(k, s)| SquareTrial { tried: Tried::Shape(s), squares: squares_of(k) }));
        trials.push(SquareTrial { tried: Tried::BestShape, squares: again.to_vec() });
    }
    if state.may_split {
        let (first, others) = of_splitting.split_at(more.min(of_each as usize));
        trials.push(SquareTrial { tried: Tried::Splitting, squares: first.to_vec() });
        trials.push(SquareTrial { tried: Tried::MoreSplitting, squares: others.to_vec() });
    }
    trials
}

fn square(x: u32, y: u32, pass: Pass) -> Block {
    let Pass { first_sample, samples } = pass;
    Block { x0: x * EDGE, y0: y * EDGE, width: EDGE, height: EDGE, first_sample, samples }
}

/// Runs the trials that are worthwhile after the earlier ones. Returns the best strategy and the squares that need not be rendered again;
/// `None` if stopped.
fn try_all(trials: Vec<SquareTrial>, pass: &dyn PassTrial) -> Option<(PathStrategy, Vec<Block>)> {
    let (mut results, mut tried) = (Vec::new(), Vec::new());
    for trial in trials {
        let Some(strategy) = strategy_of(&trial, &results) else { continue };
        let configure = |paths: &mut IntegratorOptions<'_>| {
            strategy.configure(pass.pass(), pass.target().options, paths);
        };
        let RenderedSquares { errors, add_to_film } = pass.render(&trial.squares, &configure);
        tried.push((trial, add_to_film));
        let Some(errors) = errors else {
            // After a stop, the picture keeps the trials' samples.
            tried.into_iter().for_each(|(_, add_to_film)| add_to_film());
            return None;
        };
        results.push((strategy, errors));
    }
    let best = best(&results);
    let mut done = Vec::new();
    for ((trial, add_to_film), (strategy, errors)) in tried.into_iter().zip(&results) {
        if !best.replaces(*strategy, errors) {
            add_to_film();
            done.extend(trial.squares);
        }
    }
    Some((best.strategy, done))
}

/// The strategy of a trial, given the results of earlier trials; `None` to skip the trial.
fn strategy_of(trial: &SquareTrial, results: &[(PathStrategy, Errors)]) -> Option<PathStrategy> {
    let so_far = best(results);
    let splitting = PathStrategy::Independent { branches: BRANCHES };
    match trial.tried {
        Tried::Shape(shape) => {
            let is_worthwhile = match results {
                [] => true,
                [(_, smallest)] => smallest.gain_of_reuse() >= MIN_GAIN_FOR_LARGER_GROUPS,
                // The next shape's groups have four times as many connections.
                [.., (_, last)] => last.gain_of_reuse() >= MIN_GAIN && last.cost_of_connections() < MAX_COST,
            };
            is_worthwhile.then_some(PathStrategy::Reuse(shape))
        }
        Tried::BestShape => Some(so_far.strategy).filter(|t| t.shape().is_some() && so_far.gain < CLEAR_GAIN),
        Tried::Splitting => Some(splitting).filter(|_| so_far.gain < CLEAR_GAIN),
        Tried::MoreSplitting => {
            let tried = results.last().filter(|(strategy, _)| *strategy == splitting);
            tried
                .filter(|(_, errors)| errors.gain_of_splitting() >= MIN_GAIN_FOR_MORE_SPLITTING)
                .map(|_| splitting)
        }
    }
}

/// A low-discrepancy sequence of grid cells.
fn square_positions(columns: u32, rows: u32) -> impl Iterator<Item = (u32, u32)> {
    let scaled = |fraction: u32, size: u32| {
        let from_middle = fraction.wrapping_add(1 << 31);
        ((u64::from(from_middle) * u64::from(size)) >> 32) as u32
    };
    (0..).map(r2_sequence).map(move |[x, y]| (scaled(x, columns), scaled(y, rows)))
}

impl Errors {
    /// Time of the connections, relative to all other rays.
    fn cost_of_connections(&self) -> f64 {
        let RayCounts { all, single, point_visibility, .. } = self.rays;
        let others = (all - single - point_visibility).max(1) as f64;
        (CONNECTION_COST * single as f64 + POINT_VISIBILITY_COST * point_visibility as f64) / others
    }

    /// Ratio of the squared error with the tried strategy to that without.
    fn error_ratio(&self) -> f64 {
        if self.baseline > 0.0 { self.tried / self.baseline } else { 1.0 }
    }

    /// Ratio of the efficiency with reuse to that without.
    fn gain_of_reuse(&self) -> f64 {
        if self.tried <= 0.0 {
            return 0.0;
        }
        let cost = 1.0 + FIXED_COST + self.cost_of_connections();
        self.baseline / self.tried / cost
    }

    /// Ratio of the efficiency with splitting into the best number of branches to that without.
    fn gain_of_splitting(&self) -> f64 {
        numbers_of_branches().map(|branches| self.splitting_into(branches).gain).fold(0.0, f64::max)
    }

    /// The prediction for splitting into `branches`: the branches' part of the squared error falls as one over their number, and their
    /// number of rays is proportional to it.
    fn splitting_into(&self, branches: u32) -> Candidate {
        let (tried, number) = (f64::from(BRANCHES), f64::from(branches));
        let suffixes = (1.0 - self.tried / self.baseline.max(1e-30)) / (1.0 - 1.0 / tried);
        let suffixes = suffixes.clamp(0.0, 1.0);
        let suffix_rays = self.rays.in_branches as f64 / tried;
        let prefix_rays = (self.rays.all - self.rays.in_branches) as f64;
        let error = 1.0 - suffixes + suffixes / number;
        let cost = (prefix_rays + number * suffix_rays) / (prefix_rays + suffix_rays).max(1.0);
        let LightPathCost { error: other_error, time: other_time } = self.light_paths;
        let gain = (1.0 + other_error) * (1.0 + other_time) / ((error + other_error) * (cost + other_time));
        Candidate { strategy: PathStrategy::Independent { branches }, error, gain }
    }
}

/// A strategy and its predicted gain.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    strategy: PathStrategy,
    /// Squared error relative to the plain strategy.
    error: f64,
    /// Efficiency relative to the plain strategy.
    gain: f64,
}

impl Candidate {
    /// Are squares rendered with the strategy `tried` so noisy that rendering them again with this one is worthwhile? Never for the plain
    /// strategy.
    fn replaces(&self, tried: PathStrategy, errors: &Errors) -> bool {
        let is_other = tried != self.strategy && self.strategy != PathStrategy::PLAIN;
        is_other && errors.error_ratio() > REPLACED_ERROR * self.error
    }
}

/// Candidates for the number of branches.
fn numbers_of_branches() -> impl Iterator<Item = u32> {
    (1..=MAX_BRANCHES.trailing_zeros()).map(|bits| 1 << bits)
}

/// The strategy with the largest gain, or the plain one if no gain is sufficient.
fn best(results: &[(PathStrategy, Errors)]) -> Candidate {
    // Sums over all trials of a strategy.
    let of = |strategy: PathStrategy| {
        let same = results.iter().filter(|(other, _)| *other == strategy);
        same.map(|(_, errors)| *errors).reduce(Errors::plus).unwrap_or_default()
    };
    let candidates = results.iter().map(|(strategy, _)| *strategy).flat_map(|strategy| match strategy {
        PathStrategy::Reuse(_) => {
            let gain = of(strategy).gain_of_reuse();
            let best = Candidate { strategy, error: of(strategy).error_ratio(), gain };
            if gain >= MIN_GAIN { vec![best] } else { Vec::new() }
        }
        PathStrategy::Independent { .. } => {
            let splittings = numbers_of_branches().map(|branches| of(strategy).splitting_into(branches));
            splittings.filter(|s| s.gain >= MIN_GAIN_OF_SPLITTING).collect()
        }
    });
    let plain = Candidate { strategy: PathStrategy::PLAIN, error: 1.0, gain: 1.0 };
    candidates.fold(plain, |best, next| if next.gain > best.gain { next } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If light paths have most of the error and the time, splitting changes little.
    #[test]
    fn light_paths_bound_the_gain() {
        let rays = RayCounts { all: 120, in_branches: 80, ..RayCounts::default() };
        let alone = Errors { tried: 0.25, baseline: 1.0, rays, light_paths: LightPathCost::default() };
        let both = Errors { light_paths: LightPathCost { error: 100.0, time: 100.0 }, ..alone };
        assert!(alone.gain_of_splitting() > MIN_GAIN_OF_SPLITTING, "{}", alone.gain_of_splitting());
        assert!((both.gain_of_splitting() - 1.0).abs() < 0.02, "{}", both.gain_of_splitting());
    }
}
