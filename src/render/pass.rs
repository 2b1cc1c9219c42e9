//! Passes: threads render tiles and merge them into the film.
//!
//! Passes overlap unless the film must be complete between them: a thread without a tile left in a pass continues with the next pass.

use super::picture::Labels;
use super::progress::{Listener, Progress, Stopwatch, new_task_group, parallel_task, task};
use super::schedule::{Pass, Tiles, parts, within};
use super::technique::{
    BlockSums, EDGE, Errors, PassTrial, RenderedSquares, Target, WORKSPACE, radiance_only_options,
};
use super::techniques::Techniques;
use crate::film::{FilmTile, FilterSampler, Layout, SharedFilm, Splat};
use crate::integrator::{Block, CausticPlan, Integrator, IntegratorOptions, PathSample, WAVE, Workspace};
use rayon::prelude::*;
use std::cell::{Cell, RefCell};
use std::collections::HashSet;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

thread_local! {
    /// A merged tile, whose memory the next tile reuses.
    static SPARE: Cell<Option<FilmTile>> = const { Cell::new(None) };
}

/// Minimum number of light paths between two merges of splats: enough that threads hardly wait for the last paths.
const PATHS_PER_SPLATTING: u32 = 1 << 19;

/// A pass, shared by all threads.
#[derive(Clone)]
pub(super) struct PassContext<'a> {
    pub target: Target<'a>,
    pub labels: &'a Labels,
    pub filter: &'a FilterSampler,
    pub pass: Pass,
    /// Index of the pass among the overlapping passes.
    pub number: usize,
    pub layout: &'a Arc<Layout>,
    pub film: &'a SharedFilm,
    pub techniques: &'a Techniques,
    pub progress: &'a Progress,
    pub listener: Option<&'a Listener>,
    pub stopwatch: &'a Stopwatch,
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

/// Renders consecutive passes, the first with trials and light paths; begins no further pass once `is_due` returns true. Returns the number
/// of passes begun, and false if stopped.
pub(super) fn render_all(contexts: &[PassContext<'_>], is_due: &(dyn Fn() -> bool + Sync)) -> (usize, bool) {
    let first = &contexts[0];
    let render = || {
        let Some(tried) = first.techniques.try_in_pass(first) else { return (1, false) };
        if let Some(parts) = first.split_first_pass() {
            let parts = parts.each_ref().map(|part| PlannedPass::new(part, &tried));
            return (1, render_passes(&parts, &|| false).1);
        }
        let plan = |context| PlannedPass::new(context, if context.number == 0 { &tried } else { &[] });
        render_passes(&contexts.iter().map(plan).collect::<Vec<_>>(), is_due)
    };
    // Threads that have no light paths left continue with tiles.
    let (are_light_paths_done, (begun, is_done)) = rayon::join(|| first.trace_light_paths(), render);
    (begun, are_light_paths_done && is_done)
}

/// A pass with its tiles.
struct PlannedPass<'a> {
    context: &'a PassContext<'a>,
    tracer: Tracer<'a>,
    blocks: Vec<Block>,
    /// Whether the pass is begun, once decided.
    begins: OnceLock<bool>,
}

/// Renders the tiles of consecutive passes. Begins no further pass once `is_due` returns true. Returns the number of passes begun, and
/// whether all of their tiles were rendered; else rendering was stopped.
fn render_passes(passes: &[PlannedPass<'_>], is_due: &(dyn Fn() -> bool + Sync)) -> (usize, bool) {
    let count = |sum: &mut usize, pass: &PlannedPass<'_>| {
        *sum += pass.blocks.len();
        Some(*sum)
    };
    let ends: Vec<usize> = passes.iter().scan(0, count).collect();
    let (next, is_done) = (AtomicUsize::new(0), AtomicBool::new(true));
    let render_tiles = || {
        loop {
            let tile = next.fetch_add(1, Ordering::Relaxed);
            let pass = ends.partition_point(|end| *end <= tile);
            if pass == passes.len() || !begins(&passes[..=pass], is_due) {
                return;
            }
            let PlannedPass { context, tracer, blocks, .. } = &passes[pass];
            let block = &blocks[tile + blocks.len() - ends[pass]];
            // No early exit: after a stop, each remaining tile costs one call of `stop`.
            let is_rendered =
                task("tiles", context.pass.first_sample, || context.render_tile(tracer, block, None));
            if !is_rendered {
                is_done.store(false, Ordering::Relaxed);
            }
        }
    };
    rayon::scope(|scope| (0..rayon::current_num_threads()).for_each(|_| scope.spawn(|_| render_tiles())));
    let begun = passes.iter().filter(|pass| pass.begins.get() == Some(&true)).count();
    (begun, is_done.into_inner())
}

/// Is the last of these passes begun? Decided by the first thread that calls this.
fn begins(passes: &[PlannedPass<'_>], is_due: &(dyn Fn() -> bool + Sync)) -> bool {
    let Some((last, before)) = passes.split_last() else { return true };
    *last.begins.get_or_init(|| begins(before, is_due) && !is_due())
}

impl<'a> PlannedPass<'a> {
    fn new(context: &'a PassContext<'a>, tried: &[Block]) -> PlannedPass<'a> {
        let mut paths = context.paths();
        context.techniques.configure_pass(context.pass, context.target.options, &mut paths);
        let tracer = context.tracer(paths);
        let mut blocks = context.blocks(&tracer, tried);
        // Column by column, so that concurrent tiles are in different bands of the film.
        blocks.sort_by_key(|block| (block.x0, block.y0));
        // The first pass is always begun, even if trials have rendered all tiles.
        let begins = if context.number == 0 { OnceLock::from(true) } else { OnceLock::new() };
        PlannedPass { context, tracer, blocks, begins }
    }
}

/// Samples per pixel of the first part of a picture's first pass: the fewest whose tiles fill squares of trials.
const FIRST_SAMPLES: u32 = 2;

impl<'a> PassContext<'a> {
    /// A picture's first pass in two parts, so that soon every pixel has a sample and a rendering that is stopped leaves a picture. `None`
    /// for other passes, short ones, and with path reuse, whose groups have the samples of a whole pass.
    fn split_first_pass(&self) -> Option<[PassContext<'a>; 2]> {
        let Pass { first_sample, samples } = self.pass;
        if first_sample > 0
            || samples < 2 * FIRST_SAMPLES
            || self.techniques.strategy.current().shape().is_some()
        {
            return None;
        }
        let part = |number, first_sample, samples| PassContext {
            pass: Pass { first_sample, samples },
            number,
            ..self.clone()
        };
        Some([part(0, 0, FIRST_SAMPLES), part(1, FIRST_SAMPLES, samples - FIRST_SAMPLES)])
    }

    /// The tiles of the pass outside the squares `tried`.
    fn blocks(&self, tracer: &Tracer<'_>, tried: &[Block]) -> Vec<Block> {
        let blocks = without(tracer.tiles.blocks(self.target.view, self.pass), tried);
        let region = self.target.options.pixels();
        blocks.iter().filter_map(|b| within(&region, b, tracer.reuses_paths)).collect()
    }

    /// Traces the light paths of the pass, if any. False if stopped: splats are merged for whole groups of samples only.
    pub fn trace_light_paths(&self) -> bool {
        let Some(plan) = self.techniques.caustics() else { return true };
        let tracer = self.tracer(self.paths());
        let starts: Vec<u32> = (0..plan.paths()).step_by(WAVE).collect();
        let Pass { first_sample, samples } = self.pass;
        let at_once = (PATHS_PER_SPLATTING / plan.paths()).clamp(1, samples);
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
            // Merges the previous splats while other threads trace.
            let last = traced.take();
            let (splats, ()) = rayon::join(trace, || self.add_splats(last, starts.len()));
            let Some(splats) = splats else { return false };
            traced = Some((first, splats));
        }
        self.add_splats(traced, starts.len());
        true
    }

    /// Traces a wave of light paths of a sample; `None` if stopped.
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
        task("light paths", sample, || {
            let paths = start..plan.paths().min(start.saturating_add(WAVE as u32));
            let mut splats = Vec::new();
            let trace = |w: &RefCell<Workspace>| {
                tracer.integrator.trace_light_paths(sample, paths, &mut w.borrow_mut(), &mut splats)
            };
            let stats = WORKSPACE.with(trace);
            self.progress.add(0, stats.rays, self.stopwatch.wall(), self.listener);
            SharedFilm::sort(&mut splats);
            Some(splats)
        })
    }

    /// Adds splats to the film: the first sample, and the splats of consecutive samples by wave, `waves` per sample.
    fn add_splats(&self, traced: Option<(u32, Vec<Vec<Splat>>)>, waves: usize) {
        let Some((first, splats)) = traced else { return };
        parallel_task("splats", || {
            for (sample, of_sample) in (first..).zip(splats.chunks(waves.max(1))) {
                self.film.add_splats(of_sample, self.is_of_first_half(sample));
            }
        });
    }

    fn is_of_first_half(&self, sample: u32) -> bool {
        let pixel = Block { x0: 0, y0: 0, width: 1, height: 1, first_sample: sample, samples: 1 };
        self.of_first_half(&pixel) > 0
    }

    /// Integrator options of the picture, configured by the techniques.
    fn paths(&self) -> IntegratorOptions<'a> {
        let options = self.target.options;
        let mut paths = IntegratorOptions {
            aovs: options.aovs,
            aov_space: options.aov_space,
            light_groups: self.labels.light_groups.len(),
            catchers: options.catchers,
            transparent_glass: options.transparent_glass,
            ..radiance_only_options(options, self.filter, &self.labels.ids)
        };
        self.techniques.configure(&mut paths);
        paths
    }

    fn tracer(&self, paths: IntegratorOptions<'a>) -> Tracer<'a> {
        let Target { scene, view, .. } = self.target;
        let tiles = Tiles::of(self.pass, paths.reuse.as_ref());
        let reuses_paths = paths.reuse.is_some();
        Tracer { integrator: Integrator::new(scene, view, paths), tiles, reuses_paths }
    }

    /// Renders a tile into the film. False if stopped.
    fn render_tile(&self, tracer: &Tracer<'_>, block: &Block, sums: Option<&mut BlockSums>) -> bool {
        self.trace_tile(tracer, block, sums).map(|tile| self.merge(tile)).is_some()
    }

    /// Merges a tile into the film.
    fn merge(&self, RenderedTile { tile, block, paths, rays }: RenderedTile) {
        SPARE.set(self.film.merge(self.number, tile));
        let pixels = self.film.pixels_within(block.x0, block.y0, block.width, block.height);
        // Excludes samples of trials outside the region.
        let paths = paths * pixels / (u64::from(block.width) * u64::from(block.height)).max(1);
        self.progress.add(paths, rays, self.stopwatch.wall(), self.listener);
    }

    /// Number of samples per pixel of a block that belong to the first half. They come first.
    fn of_first_half(&self, block: &Block) -> u64 {
        let rule = self.target.options.halving();
        u64::from(rule.of_first_half(block.first_sample, block.samples))
    }

    /// Traces a block into a separate tile; `None` if stopped.
    fn trace_tile(
        &self,
        tracer: &Tracer<'_>,
        block: &Block,
        mut sums: Option<&mut BlockSums>,
    ) -> Option<RenderedTile> {
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
                        // All pixels have the same number of samples.
                        let is_of_first_half = (paths - before) % u64::from(part.samples) < of_first_half;
                        add_all(&mut tile, sample, is_of_first_half);
                    } else {
                        tile.add(sample.pixel, sample.rgb, sample.alpha);
                    }
                    paths += 1;
                    if let Some(sums) = &mut sums {
                        sums.add(sample);
                    }
                };
                tracer.integrator.trace(&part, workspace, &self.stop, sink)
            });
            let rays = workspace.ray_counts.since(before);
            if let Some(sums) = sums {
                sums.count(rays);
            }
            is_done.then_some(RenderedTile { tile, block: *block, paths, rays: rays.all })
        })
    }
}

/// Adds a sample to all channels.
#[inline(never)]
fn add_all(tile: &mut FilmTile, sample: &PathSample<'_>, is_of_first_half: bool) {
    let PathSample { pixel, rgb, alpha, first_hit, layers, .. } = *sample;
    tile.add_with_parts(pixel, rgb, alpha, first_hit, layers, is_of_first_half);
}

/// A rendered tile, with the numbers of its paths and rays.
struct RenderedTile {
    tile: FilmTile,
    block: Block,
    paths: u64,
    rays: u64,
}

/// Renders tiles.
struct Tracer<'a> {
    integrator: Integrator<'a>,
    tiles: Tiles,
    /// Is path reuse in use?
    reuses_paths: bool,
}

impl PassTrial for PassContext<'_> {
    fn target(&self) -> Target<'_> {
        self.target
    }

    fn pass(&self) -> Pass {
        self.pass
    }

    fn render(
        &self,
        squares: &[Block],
        configure: &dyn Fn(&mut IntegratorOptions<'_>),
    ) -> RenderedSquares<'_> {
        let mut paths = IntegratorOptions { records_baseline: true, ..self.paths() };
        configure(&mut paths);
        let tracer = self.tracer(paths);
        let blocks: Vec<Block> = squares.iter().flat_map(|s| tracer.tiles.divide(*s)).collect();
        let group = new_task_group();
        let try_block = |block: &Block| {
            let mut sums = BlockSums::new(block);
            let tile = task("trials", group, || self.trace_tile(&tracer, block, Some(&mut sums)))?;
            self.progress.add(0, tile.rays, self.stopwatch.wall(), self.listener);
            Some((sums, RenderedTile { rays: 0, ..tile }))
        };
        let blocks: Vec<Option<(BlockSums, RenderedTile)>> = blocks.par_iter().map(try_block).collect();
        // Summed in order, independently of threads.
        let sum = |sum: Errors, block: &Option<(BlockSums, RenderedTile)>| {
            Some(sum.plus(block.as_ref()?.0.errors()))
        };
        let start = Errors { light_paths: self.techniques.light_path_cost(), ..Errors::default() };
        let errors = blocks.iter().try_fold(start, sum);
        let tiles: Vec<RenderedTile> = blocks.into_iter().flatten().map(|(_, tile)| tile).collect();
        let add_to_film = move || tiles.into_par_iter().for_each(|tile| self.merge(tile));
        RenderedSquares { errors, add_to_film: Box::new(add_to_film) }
    }
}

/// The tiles outside `squares`.
fn without(mut tiles: Vec<Block>, squares: &[Block]) -> Vec<Block> {
    let covered: HashSet<_> = squares.iter().map(|s| (s.x0 / EDGE, s.y0 / EDGE)).collect();
    let is_in_square = |t: &Block| t.x0 % EDGE + t.width <= EDGE && t.y0 % EDGE + t.height <= EDGE;
    debug_assert!(covered.is_empty() || tiles.iter().all(is_in_square), "tiles don't cross squares");
    tiles.retain(|tile| !covered.contains(&(tile.x0 / EDGE, tile.y0 / EDGE)));
    tiles
}
