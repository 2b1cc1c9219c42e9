//! The work of passes: tiles are taken by all threads and merged into the film.
//!
//! Passes that nothing has to look at between them follow each other without a pause: a thread that finds no tile of a pass left goes
//! on with the next one.

use super::adaptive::ErrorMap;
use super::clock::Stopwatch;
use super::labels::Labels;
use super::options::RenderOptions;
use super::pilot::{self, Best, Errors, Tally, Trial};
use super::progress::{Listener, Progress};
use super::schedule::Pass;
use super::share::within;
use super::technique::{Choice, Technique};
use super::tiles::{Tiles, parts};
use super::timeline;
use crate::compile::{CompiledScene, View};
use crate::film::{FilmTile, FilterSampler, Layout, SharedFilm, Splat};
use crate::integrator::reuse::Tiling;
use crate::integrator::{
    Block, CausticPlan, Guide, Integrator, PathOptions, PathSample, SamplePlan, WAVE, Workspace,
};
use crate::sampling::{Allotment, Arrangement};
use rayon::prelude::*;
use std::cell::{Cell, RefCell};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

thread_local! {
    pub(super) static WORKSPACE: RefCell<Workspace> = RefCell::new(Workspace::new());
    /// A tile whose memory the next one takes.
    static SPARE: Cell<Option<FilmTile>> = const { Cell::new(None) };
}

/// Paths from lamps that are traced before their splats are added, at least: so many that no thread waits long for the last ones.
const LAMP_PATHS: u32 = 1 << 19;

/// What all threads share in a pass.
#[derive(Clone)]
pub(super) struct PassWork<'a> {
    pub scene: &'a CompiledScene,
    pub view: &'a View,
    pub options: &'a RenderOptions,
    pub labels: &'a Labels,
    pub filter: &'a FilterSampler,
    pub pass: Pass,
    /// Its number among those that the film is shared for.
    pub number: usize,
    pub layout: &'a Arc<Layout>,
    pub film: &'a SharedFilm,
    /// Which light is left to paths from lamps, if any.
    pub caustics: Option<&'a CausticPlan>,
    /// Guides the paths, if any.
    pub guide: Option<&'a Guide>,
    /// Where samples go that are left after the first pass, if that is decided.
    pub allotment: Option<&'a Allotment>,
    pub progress: &'a Progress,
    pub listener: Option<&'a Listener>,
    pub stopwatch: &'a Stopwatch,
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

/// Takes passes that follow each other, the first one with what is tried in it and with its paths from lamps, until `is_due`
/// asks to begin no more. How many were begun, and false if it was stopped.
pub(super) fn take_all(
    works: &[PassWork<'_>],
    choice: &mut Choice,
    errors: &mut Option<ErrorMap>,
    is_due: &(dyn Fn() -> bool + Sync),
) -> (usize, bool) {
    let first = &works[0];
    let take = || {
        let Some(trials) = try_techniques(first, choice, errors) else { return (1, false) };
        match errors {
            Some(errors) => (1, first.take_with_errors(choice.now, &trials, errors)),
            None => take_passes(works, choice.now, &trials, is_due),
        }
    };
    // Threads that find no path from a lamp left go on with tiles.
    let (is_lit, (begun, is_done)) = rayon::join(|| first.light_from_lamps(), take);
    (begun, is_lit && is_done)
}

/// Decides on a technique, if that is open and the pass is one that may try some. The trials whose squares need not be taken again;
/// `None` if it was stopped.
pub(super) fn try_techniques(
    work: &PassWork<'_>,
    choice: &mut Choice,
    errors: &mut Option<ErrorMap>,
) -> Option<Vec<Trial>> {
    let mut trials = pilot::trials(*choice, work.view, work.pass);
    if !trials.is_empty() {
        let best = work.try_all(&mut trials, errors);
        *choice = Choice::decided(best.unwrap_or(Technique::PLAIN));
        best?;
    }
    Some(trials)
}

/// A pass that is to be taken.
struct Planned<'a> {
    work: &'a PassWork<'a>,
    tracer: Tracer<'a>,
    blocks: Vec<Block>,
    /// Whether it is begun, once that is decided.
    begins: OnceLock<bool>,
}

/// Takes all tiles of passes that follow each other, but those of trials in the first one. Before each but the first `is_due` may ask
/// to begin no more. Says how many were begun, and whether all of their tiles were taken: else it was stopped, and some have not got
/// their samples.
fn take_passes(
    works: &[PassWork<'_>],
    technique: Technique,
    trials: &[Trial],
    is_due: &(dyn Fn() -> bool + Sync),
) -> (usize, bool) {
    let plan = |work| Planned::new(work, technique, if work.number == 0 { trials } else { &[] });
    let passes: Vec<Planned<'_>> = works.iter().map(plan).collect();
    let count = |sum: &mut usize, pass: &Planned<'_>| {
        *sum += pass.blocks.len();
        Some(*sum)
    };
    let ends: Vec<usize> = passes.iter().scan(0, count).collect();
    let (next, is_done) = (AtomicUsize::new(0), AtomicBool::new(true));
    let take_some = || {
        loop {
            let tile = next.fetch_add(1, Ordering::Relaxed);
            let pass = ends.partition_point(|end| *end <= tile);
            if pass == passes.len() || !begins(&passes[..=pass], is_due) {
                return;
            }
            let Planned { work, tracer, blocks, .. } = &passes[pass];
            let block = &blocks[tile + blocks.len() - ends[pass]];
            // All of them: stopping is a look at a clock for each tile that is left.
            let is_taken = timeline::item("tiles", work.pass.first_sample, || work.take(tracer, block, None));
            if !is_taken {
                is_done.store(false, Ordering::Relaxed);
            }
        }
    };
    rayon::scope(|scope| (0..rayon::current_num_threads()).for_each(|_| scope.spawn(|_| take_some())));
    let begun = passes.iter().filter(|pass| pass.begins.get() == Some(&true)).count();
    (begun, is_done.into_inner())
}

/// Is the last of these passes begun? It is decided once, by the thread that comes first.
fn begins(passes: &[Planned<'_>], is_due: &(dyn Fn() -> bool + Sync)) -> bool {
    let Some((last, before)) = passes.split_last() else { return true };
    *last.begins.get_or_init(|| begins(before, is_due) && !is_due())
}

impl<'a> Planned<'a> {
    fn new(work: &'a PassWork<'a>, technique: Technique, trials: &[Trial]) -> Planned<'a> {
        let tracer = work.tracer(technique, false);
        let mut blocks = work.blocks(technique, &tracer, trials);
        // Column by column, so that those which are taken at the same time lie in other bands of the film.
        blocks.sort_by_key(|block| (block.x0, block.y0));
        // The first one is begun in any case, even where trials leave it no tile.
        let begins = if work.number == 0 { OnceLock::from(true) } else { OnceLock::new() };
        Planned { work, tracer, blocks, begins }
    }
}

impl<'a> PassWork<'a> {
    /// The tiles, but for those of trials.
    fn blocks(&self, technique: Technique, tracer: &Tracer<'_>, trials: &[Trial]) -> Vec<Block> {
        let blocks = pilot::without(tracer.tiles.blocks(self.view, self.pass), trials);
        let region = self.options.pixels();
        let shares = technique.shape().is_some();
        blocks.iter().filter_map(|b| within(&region, b, shares)).collect()
    }

    /// Takes all tiles but those of trials, and takes down their errors. False if it was stopped.
    pub fn take_with_errors(&self, technique: Technique, trials: &[Trial], errors: &mut ErrorMap) -> bool {
        let tracer = self.tracer(technique, false);
        let one = |block: &Block| {
            let mut tally = Tally::new(block);
            let take = || self.take(&tracer, block, Some(&mut tally));
            let is_done = timeline::item("tiles", self.pass.first_sample, take);
            (*block, tally.of_picture(), tally.rays_per_sample(), is_done)
        };
        let taken: Vec<_> = self.blocks(technique, &tracer, trials).par_iter().map(one).collect();
        taken.iter().for_each(|(block, of_block, rays, _)| errors.set(block, of_block, *rays));
        taken.iter().all(|(.., is_done)| *is_done)
    }

    /// Takes the squares of trials, as far as each is worth it, and leaves only those in the list that need not be taken again.
    /// What gains most; `None` if it was stopped.
    pub fn try_all(&self, trials: &mut Vec<Trial>, map: &mut Option<ErrorMap>) -> Option<Technique> {
        let (mut results, mut tried) = (Vec::new(), Vec::new());
        for trial in trials.drain(..) {
            if let Some(technique) = pilot::technique_of(&trial, &results) {
                let (errors, taken) = self.try_one(technique, &trial.squares, map);
                tried.push((trial, taken));
                let Some(errors) = errors else {
                    // What there is is all that these squares will get.
                    tried.into_iter().for_each(|(_, taken)| self.keep_all(taken));
                    return None;
                };
                results.push((technique, errors));
            }
        }
        let best = pilot::best(&results);
        for ((trial, taken), (technique, errors)) in tried.into_iter().zip(&results) {
            if !best.replaces(*technique, errors) {
                self.keep_all(taken);
                trials.push(trial);
            }
        }
        let Best { technique, change, .. } = best;
        if let Some(map) = map {
            trials.iter().flat_map(|trial| &trial.squares).for_each(|square| map.change(square, change));
        }
        Some(technique)
    }

    /// Takes the squares of a trial, for the picture or for nothing but what they show, which is `None` if it was stopped.
    fn try_one(
        &self,
        technique: Technique,
        squares: &[Block],
        map: &mut Option<ErrorMap>,
    ) -> (Option<Errors>, Vec<Taken>) {
        let tracer = self.tracer(technique, true);
        let blocks: Vec<Block> = squares.iter().flat_map(|s| tracer.tiles.divide(*s)).collect();
        let group = timeline::group();
        let try_block = |block: &Block| {
            let mut tally = Tally::new(block);
            let taken = timeline::item("trials", group, || self.fill(&tracer, block, Some(&mut tally)))?;
            self.progress.add(0, taken.rays, self.stopwatch.wall(), self.listener);
            Some((tally, Taken { rays: 0, ..taken }))
        };
        let blocks: Vec<Option<(Tally, Taken)>> = blocks.par_iter().map(try_block).collect();
        if let Some(map) = map {
            for (tally, Taken { block, .. }) in blocks.iter().flatten() {
                map.set(block, &tally.of_plain(), tally.plain_rays_per_sample());
            }
        }
        // In their order, so that the sum does not depend on threads.
        let sum = |sum: Errors, block: &Option<(Tally, Taken)>| Some(sum.plus(block.as_ref()?.0.finish()));
        let errors = blocks.iter().try_fold(Errors::default(), sum);
        (errors, blocks.into_iter().flatten().map(|(_, taken)| taken).collect())
    }

    /// Traces the paths from lamps that belong to the pass, if there are some. False if it was stopped: the samples whose paths
    /// were not all traced have got none.
    pub fn light_from_lamps(&self) -> bool {
        let Some(plan) = self.caustics else { return true };
        let tracer = self.tracer(Technique::PLAIN, false);
        let starts: Vec<u32> = (0..plan.paths()).step_by(WAVE).collect();
        let Pass { first_sample, samples } = self.pass;
        let at_once = (LAMP_PATHS / plan.paths()).clamp(1, samples);
        let mut traced: Option<(u32, Vec<Vec<Splat>>)> = None;
        for first in (first_sample..first_sample + samples).step_by(at_once as usize) {
            let of_samples = first..(first + at_once).min(first_sample + samples);
            let waves: Vec<(u32, u32)> =
                of_samples.flat_map(|sample| starts.iter().map(move |start| (sample, *start))).collect();
            let trace = || -> Option<Vec<Vec<Splat>>> {
                waves
                    .par_iter()
                    .map(|&(sample, start)| self.trace_wave(&tracer, plan, sample, start))
                    .collect()
            };
            // What was traced before is added while threads go on.
            let last = traced.take();
            let (splats, ()) = rayon::join(trace, || self.add_splats(last, starts.len()));
            let Some(splats) = splats else { return false };
            traced = Some((first, splats));
        }
        self.add_splats(traced, starts.len());
        true
    }

    /// Traces a wave of the paths from lamps of a sample; `None` if it was stopped.
    fn trace_wave(
        &self,
        tracer: &Tracer<'_>,
        plan: &CausticPlan,
        sample: u32,
        start: u32,
    ) -> Option<Vec<Splat>> {
        if (self.stop)() {
            return None;
        }
        timeline::item("paths from lamps", sample, || {
            let paths = start..plan.paths().min(start.saturating_add(WAVE as u32));
            let mut splats = Vec::new();
            let trace = |w: &RefCell<Workspace>| {
                tracer.integrator.trace_from_lamps(sample, paths, &mut w.borrow_mut(), &mut splats)
            };
            let tally = WORKSPACE.with(trace);
            self.progress.add(0, tally.rays, self.stopwatch.wall(), self.listener);
            SharedFilm::sort(&mut splats);
            Some(splats)
        })
    }

    /// Adds all splats of some samples, the first of which is given, by waves, so many of which are a sample.
    fn add_splats(&self, traced: Option<(u32, Vec<Vec<Splat>>)>, waves: usize) {
        let Some((first, splats)) = traced else { return };
        timeline::parallel("splats", || {
            for (sample, of_sample) in (first..).zip(splats.chunks(waves.max(1))) {
                self.film.add_splats(of_sample, self.is_of_first_half(sample));
            }
        });
    }

    fn is_of_first_half(&self, sample: u32) -> bool {
        let pixel = Block { x0: 0, y0: 0, width: 1, height: 1, first_sample: sample, samples: 1 };
        self.of_first_half(&pixel) > 0
    }

    fn tracer(&self, technique: Technique, keeps_plain: bool) -> Tracer<'a> {
        let branches = technique.branches();
        let even = || {
            let RenderOptions { seed, samples, planned, .. } = *self.options;
            Arrangement::new(seed, samples.max(planned), branches)
        };
        let reuse = technique.shape().map(|shape| Tiling::new(shape, self.pass.first_sample));
        let tiles = Tiles::of(self.pass, reuse.as_ref(), self.allotment.is_some());
        let paths = PathOptions {
            max_depth: self.options.max_depth,
            plan: self.allotment.map_or_else(|| SamplePlan::Even(even()), SamplePlan::Allotted),
            filter: self.filter,
            aovs: self.options.aovs,
            aov_space: self.options.aov_space,
            mattes: &self.labels.ids,
            light_groups: self.labels.light_groups.len(),
            catchers: self.options.catchers,
            transparent_glass: self.options.transparent_glass,
            soft_terminator: self.options.soft_terminator,
            reuse,
            branches,
            keeps_plain,
            caustics: self.caustics,
            guide: self.guide,
            records_training: false,
        };
        Tracer { integrator: Integrator::new(self.scene, self.view, paths), tiles }
    }

    /// Takes a tile. False if it was stopped.
    fn take(&self, tracer: &Tracer<'_>, block: &Block, tally: Option<&mut Tally>) -> bool {
        self.fill(tracer, block, tally).map(|taken| self.keep(taken)).is_some()
    }

    /// Adds tiles to the picture.
    fn keep_all(&self, taken: Vec<Taken>) {
        taken.into_par_iter().for_each(|taken| self.keep(taken));
    }

    /// Adds a tile to the picture.
    fn keep(&self, Taken { tile, block, paths, rays }: Taken) {
        SPARE.set(self.film.merge(self.number, tile));
        let pixels = self.film.pixels_within(block.x0, block.y0, block.width, block.height);
        // Samples of a trial that lie beside the picture are none of it.
        let paths = paths * pixels / (u64::from(block.width) * u64::from(block.height)).max(1);
        self.progress.add(paths, rays, self.stopwatch.wall(), self.listener);
    }

    /// How many of the samples of a block's pixels belong to the first half: they come first.
    fn of_first_half(&self, block: &Block) -> u64 {
        let rule = self.options.halving(self.allotment.is_some());
        u64::from(rule.of_first_half(block.first_sample, block.samples))
    }

    /// Traces a block into a tile of its own; `None` if it was stopped.
    fn fill(&self, tracer: &Tracer<'_>, block: &Block, mut tally: Option<&mut Tally>) -> Option<Taken> {
        if (self.stop)() {
            return None;
        }
        let Block { x0, y0, width, height, .. } = *block;
        let mut tile = match SPARE.take() {
            Some(spare) => spare.restarted(x0, y0, width, height, self.layout),
            None => FilmTile::new(x0, y0, width, height, self.layout),
        };
        let has_more = self.layout.has_more_than_color();
        WORKSPACE.with(|workspace| {
            let workspace = &mut *workspace.borrow_mut();
            let mut paths = 0;
            let before = workspace.ray_counts;
            let is_done = parts(block, tracer.tiles.samples()).all(|part| {
                let of_first_half = self.of_first_half(&part);
                let before = paths;
                let sink = |sample: &PathSample<'_>| {
                    if has_more {
                        // Pixel by pixel, all have as many samples.
                        let is_of_first_half = (paths - before) % u64::from(part.samples) < of_first_half;
                        add_all(&mut tile, sample, is_of_first_half);
                    } else {
                        tile.add(sample.pixel, sample.rgb, sample.alpha);
                    }
                    paths += 1;
                    if let Some(tally) = &mut tally {
                        tally.add(sample);
                    }
                };
                tracer.integrator.trace(&part, workspace, &self.stop, sink)
            });
            let rays = workspace.ray_counts.since(before);
            if let Some(tally) = tally {
                tally.count(rays);
            }
            is_done.then_some(Taken { tile, block: *block, paths, rays: rays.all })
        })
    }
}

/// Adds a sample to all channels.
#[inline(never)]
fn add_all(tile: &mut FilmTile, sample: &PathSample<'_>, is_of_first_half: bool) {
    let PathSample { pixel, rgb, alpha, first_hit, parts, .. } = *sample;
    tile.add_with_parts(pixel, rgb, alpha, first_hit, parts, is_of_first_half);
}

/// A tile with its samples, and what it took.
struct Taken {
    tile: FilmTile,
    block: Block,
    paths: u64,
    rays: u64,
}

/// What takes tiles.
struct Tracer<'a> {
    integrator: Integrator<'a>,
    tiles: Tiles,
}
