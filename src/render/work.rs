//! The work of a pass: tiles are taken by all threads and merged into the film.

use super::clock::Stopwatch;
use super::pilot::{self, Errors, Tally, Trial};
use super::progress::{Listener, Progress};
use super::schedule::Pass;
use super::tiles::{Tiles, parts};
use crate::compile::{CompiledScene, View};
use crate::film::{Film, FilmTile, Layout};
use crate::integrator::reuse::{GroupShape, Tiling};
use crate::integrator::{Block, Integrator, PathOptions, PathSample, Workspace};
use rayon::prelude::*;
use std::cell::RefCell;
use std::sync::{Arc, Mutex};

thread_local! {
    static WORKSPACE: RefCell<Workspace> = RefCell::new(Workspace::new());
}

/// What all threads share in a pass.
pub(super) struct PassWork<'a> {
    pub scene: &'a CompiledScene,
    pub view: &'a View,
    pub paths: PathOptions<'a>,
    pub pass: Pass,
    pub layout: &'a Arc<Layout>,
    pub film: Mutex<&'a mut Film>,
    pub progress: &'a Progress,
    pub listener: Option<&'a Listener>,
    pub stopwatch: &'a Stopwatch,
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

impl PassWork<'_> {
    /// Takes all tiles but those of trials, with paths shared in groups of a shape or not at all. False if it was stopped:
    /// then some have not got their samples.
    pub fn run(&self, shape: Option<GroupShape>, trials: &[Trial]) -> bool {
        let tracer = self.tracer(shape, false);
        let blocks = pilot::without(tracer.tiles.blocks(self.view, self.pass), trials);
        let one = |block: &Block| self.take(&tracer, block, None);
        // All of them: stopping is a look at a clock for each tile that is left.
        blocks.par_iter().map(one).reduce(|| true, |a, b| a & b)
    }

    /// Takes the squares of trials, as far as each is worth it, and leaves the others out of the list. The shape of groups that
    /// gains most, if any does; `None` if it was stopped.
    pub fn try_all(&self, trials: &mut Vec<Trial>) -> Option<Option<GroupShape>> {
        let mut results = Vec::new();
        for trial in &*trials {
            if !pilot::is_next_worth_it(&results) {
                break;
            }
            results.push((trial.shape, self.try_one(trial)?));
        }
        trials.truncate(results.len());
        Some(pilot::best(&results))
    }

    fn try_one(&self, trial: &Trial) -> Option<Errors> {
        let tracer = self.tracer(Some(trial.shape), true);
        let blocks: Vec<Block> = trial.squares.iter().flat_map(|s| tracer.tiles.divide(*s)).collect();
        let try_block = |block: &Block| {
            let mut tally = Tally::new(block);
            self.take(&tracer, block, Some(&mut tally)).then(|| tally.finish())
        };
        let errors: Vec<Option<Errors>> = blocks.par_iter().map(try_block).collect();
        // In their order, so that the sum does not depend on threads.
        errors.into_iter().try_fold(Errors::default(), |sum, errors| Some(sum.plus(errors?)))
    }

    fn tracer(&self, shape: Option<GroupShape>, keeps_unshared: bool) -> Tracer<'_> {
        let reuse = shape.map(|shape| Tiling::new(shape, self.pass.first_sample));
        let tiles = Tiles::of(self.pass, reuse.as_ref());
        let paths = PathOptions { reuse, keeps_unshared, ..self.paths.clone() };
        Tracer { integrator: Integrator::new(self.scene, self.view, paths), tiles }
    }

    /// Takes a tile. False if it was stopped.
    fn take(&self, tracer: &Tracer<'_>, block: &Block, tally: Option<&mut Tally>) -> bool {
        if (self.stop)() {
            return false;
        }
        let Some((filled, rays)) = self.fill(tracer, block, tally) else { return false };
        self.film.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).merge(filled);
        let paths = u64::from(block.width) * u64::from(block.height) * u64::from(block.samples);
        self.progress.add(paths, rays, self.stopwatch.wall(), self.listener);
        true
    }

    /// Traces a block into a tile of its own; returns it with the number of rays, or `None` if it was stopped.
    fn fill(
        &self,
        tracer: &Tracer<'_>,
        block: &Block,
        mut tally: Option<&mut Tally>,
    ) -> Option<(FilmTile, u64)> {
        let mut tile = FilmTile::new(block.x0, block.y0, block.width, block.height, self.layout);
        let has_more = self.layout.has_more_than_color();
        WORKSPACE.with(|workspace| {
            let workspace = &mut *workspace.borrow_mut();
            let (rays, connections) = (workspace.ray_count, workspace.connections);
            let mut sink = |sample: &PathSample<'_>| {
                if has_more {
                    add_all(&mut tile, sample);
                } else {
                    tile.add(sample.pixel, sample.rgb, sample.alpha);
                }
                if let Some(tally) = &mut tally {
                    tally.add(sample);
                }
            };
            let is_done = parts(block, tracer.tiles.samples())
                .all(|part| tracer.integrator.trace(&part, workspace, &self.stop, &mut sink));
            let rays = workspace.ray_count - rays;
            if let Some(tally) = tally {
                tally.count(rays, workspace.connections.since(connections));
            }
            is_done.then_some((tile, rays))
        })
    }
}

/// Adds a sample to all channels.
#[inline(never)]
fn add_all(tile: &mut FilmTile, sample: &PathSample<'_>) {
    let PathSample { pixel, rgb, alpha, first_hit, parts, .. } = *sample;
    tile.add_with_parts(pixel, rgb, alpha, first_hit, parts);
}

/// What takes tiles.
struct Tracer<'a> {
    integrator: Integrator<'a>,
    tiles: Tiles,
}
