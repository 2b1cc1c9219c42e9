//! The work of a pass: tiles are taken by all threads and merged into the film.

use super::adaptive::ErrorMap;
use super::clock::Stopwatch;
use super::labels::Labels;
use super::options::RenderOptions;
use super::pilot::{self, Best, Errors, Tally, Trial};
use super::progress::{Listener, Progress};
use super::schedule::Pass;
use super::share::within;
use super::technique::Technique;
use super::tiles::{Tiles, parts};
use crate::compile::{CompiledScene, View};
use crate::film::{Film, FilmTile, FilterSampler, Layout, Splat};
use crate::integrator::reuse::Tiling;
use crate::integrator::{
    Block, CausticPlan, Guide, Integrator, PathOptions, PathSample, SamplePlan, WAVE, Workspace,
};
use crate::sampling::{Allotment, Arrangement};
use rayon::prelude::*;
use std::cell::RefCell;
use std::sync::{Arc, Mutex, MutexGuard};

thread_local! {
    pub(super) static WORKSPACE: RefCell<Workspace> = RefCell::new(Workspace::new());
}

/// What all threads share in a pass.
pub(super) struct PassWork<'a> {
    pub scene: &'a CompiledScene,
    pub view: &'a View,
    pub options: &'a RenderOptions,
    pub labels: &'a Labels,
    pub filter: &'a FilterSampler,
    pub pass: Pass,
    pub layout: &'a Arc<Layout>,
    pub film: Mutex<&'a mut Film>,
    /// Which light is left to paths from lamps, if any.
    pub caustics: Option<&'a CausticPlan>,
    /// Guides the paths, if any.
    pub guide: Option<&'a Guide>,
    /// Where samples go that are left after the first pass, if that is decided.
    pub allotment: Option<&'a Allotment>,
    /// Takes down the errors of the pass, if that is asked for.
    pub errors: Option<Mutex<ErrorMap>>,
    pub progress: &'a Progress,
    pub listener: Option<&'a Listener>,
    pub stopwatch: &'a Stopwatch,
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

impl PassWork<'_> {
    /// Takes all tiles but those of trials. False if it was stopped: then some have not got their samples.
    pub fn run(&self, technique: Technique, trials: &[Trial]) -> bool {
        let tracer = self.tracer(technique, false);
        let blocks = pilot::without(tracer.tiles.blocks(self.view, self.pass), trials);
        let region = self.options.pixels();
        let shares = technique.shape().is_some();
        let blocks: Vec<Block> = blocks.iter().filter_map(|b| within(&region, b, shares)).collect();
        let one = |block: &Block| {
            let Some(errors) = &self.errors else { return self.take(&tracer, block, None) };
            let mut tally = Tally::new(block);
            let is_done = self.take(&tracer, block, Some(&mut tally));
            lock(errors).set(block, &tally.of_picture(), tally.rays_per_sample());
            is_done
        };
        // All of them: stopping is a look at a clock for each tile that is left.
        blocks.par_iter().map(one).reduce(|| true, |a, b| a & b)
    }

    /// Takes the squares of trials, as far as each is worth it, and leaves only those in the list that need not be taken again.
    /// What gains most; `None` if it was stopped.
    pub fn try_all(&self, trials: &mut Vec<Trial>) -> Option<Technique> {
        let (mut results, mut tried) = (Vec::new(), Vec::new());
        for trial in trials.drain(..) {
            if let Some(technique) = pilot::technique_of(&trial, &results) {
                let (errors, taken) = self.try_one(technique, &trial.squares);
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
        if let Some(errors) = &self.errors {
            trials
                .iter()
                .flat_map(|trial| &trial.squares)
                .for_each(|square| lock(errors).change(square, change));
        }
        Some(technique)
    }

    /// Takes the squares of a trial, for the picture or for nothing but what they show, which is `None` if it was stopped.
    fn try_one(&self, technique: Technique, squares: &[Block]) -> (Option<Errors>, Vec<Taken>) {
        let tracer = self.tracer(technique, true);
        let blocks: Vec<Block> = squares.iter().flat_map(|s| tracer.tiles.divide(*s)).collect();
        let try_block = |block: &Block| {
            let mut tally = Tally::new(block);
            let taken = self.fill(&tracer, block, Some(&mut tally))?;
            self.progress.add(0, taken.rays, self.stopwatch.wall(), self.listener);
            if let Some(errors) = &self.errors {
                lock(errors).set(block, &tally.of_plain(), tally.plain_rays_per_sample());
            }
            Some((tally.finish(), Taken { rays: 0, ..taken }))
        };
        let blocks: Vec<Option<(Errors, Taken)>> = blocks.par_iter().map(try_block).collect();
        // In their order, so that the sum does not depend on threads.
        let sum = |sum: Errors, block: &Option<(Errors, Taken)>| Some(sum.plus(block.as_ref()?.0));
        let errors = blocks.iter().try_fold(Errors::default(), sum);
        (errors, blocks.into_iter().flatten().map(|(_, taken)| taken).collect())
    }

    /// Traces the paths from lamps that belong to the pass, if there are some. False if it was stopped: the samples whose paths
    /// were not all traced have got none.
    pub fn light_from_lamps(&self) -> bool {
        let Some(plan) = self.caustics else { return true };
        let tracer = self.tracer(Technique::PLAIN, false);
        let starts: Vec<u32> = (0..plan.paths()).step_by(WAVE).collect();
        let one = |sample: u32, &start: &u32| {
            if (self.stop)() {
                return None;
            }
            let paths = start..plan.paths().min(start.saturating_add(WAVE as u32));
            let mut splats = Vec::new();
            let trace = |w: &RefCell<Workspace>| {
                tracer.integrator.trace_from_lamps(sample, paths, &mut w.borrow_mut(), &mut splats)
            };
            let tally = WORKSPACE.with(trace);
            self.progress.add(0, tally.rays, self.stopwatch.wall(), self.listener);
            Some(splats)
        };
        let trace = |sample: u32| -> Option<Vec<Vec<Splat>>> {
            starts.par_iter().map(|start| one(sample, start)).collect()
        };
        let Pass { first_sample, samples } = self.pass;
        let mut traced: Option<(u32, Vec<Vec<Splat>>)> = None;
        for sample in first_sample..first_sample + samples {
            // One thread adds what the others have traced while they go on.
            let last = traced.take();
            let (splats, ()) = rayon::join(|| trace(sample), || self.add_splats(last));
            let Some(splats) = splats else { return false };
            traced = Some((sample, splats));
        }
        self.add_splats(traced);
        true
    }

    /// Adds all splats of a sample.
    fn add_splats(&self, traced: Option<(u32, Vec<Vec<Splat>>)>) {
        let Some((sample, splats)) = traced else { return };
        let is_of_first_half = self.is_of_first_half(sample);
        let mut film = lock(&self.film);
        splats.iter().for_each(|splats| film.add_splats(splats, is_of_first_half));
        film.count_splats(1, is_of_first_half);
    }

    fn is_of_first_half(&self, sample: u32) -> bool {
        let pixel = Block { x0: 0, y0: 0, width: 1, height: 1, first_sample: sample, samples: 1 };
        self.of_first_half(&pixel) > 0
    }

    fn tracer(&self, technique: Technique, keeps_plain: bool) -> Tracer<'_> {
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
        taken.into_iter().for_each(|taken| self.keep(taken));
    }

    /// Adds a tile to the picture.
    fn keep(&self, Taken { tile, block, paths, rays }: Taken) {
        let pixels = {
            let mut film = lock(&self.film);
            film.merge(tile);
            film.pixels_within(block.x0, block.y0, block.width, block.height)
        };
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
        let mut tile = FilmTile::new(block.x0, block.y0, block.width, block.height, self.layout);
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

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
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
