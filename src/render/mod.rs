//! Rendering: passes over tiles on all cores, progress, stopping.
//!
//! The picture is made in passes of a few samples a pixel. In a pass, threads take tiles in any order; tiles share no
//! pixels and passes follow each other, so every pixel's sum has one order at any number of threads.

mod clock;

use crate::compile::CompiledScene;
use crate::film::{AovSet, Film, FilmTile, FilterSampler};
use crate::integrator::{Block, Integrator, PathOptions, WAVE, Workspace};
use crate::scene::Filter;
use clock::CpuClock;
use rayon::prelude::*;
use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Edge of a tile in pixels.
const TILE: u32 = 16;

/// How to render.
#[derive(Clone, Copy, Debug)]
pub struct RenderOptions {
    /// Picture width in pixels.
    pub width: u32,
    /// Picture height in pixels.
    pub height: u32,
    /// Samples a pixel.
    pub samples: u32,
    /// Seed of all randomness.
    pub seed: u32,
    /// Largest number of scattering events; 0 shows emission only.
    pub max_depth: u32,
    /// Threads; all cores by default.
    pub threads: Option<usize>,
    /// Reconstruction filter.
    pub filter: Filter,
    /// What to record besides colour.
    pub aovs: AovSet,
    /// Soften the edges of self-shadowing on shapes with shading normals, which otherwise follow the triangles.
    pub soft_terminator: bool,
    /// No pass starts after this time. The number of samples then depends on the machine.
    pub time_limit: Option<Duration>,
}

/// What the renderer tells while it works.
#[derive(Clone, Copy, Debug)]
pub enum Event {
    /// How far it is; comes from any thread, several times a second.
    Progress {
        /// Paths done.
        samples_done: u64,
        /// Paths in all.
        samples_total: u64,
        /// Rays so far.
        rays: u64,
        /// Time so far.
        elapsed: Duration,
    },
}

/// What rendering took.
#[derive(Clone, Copy, Debug, Default)]
pub struct Statistics {
    /// Seconds by the clock on the wall.
    pub render_s: f64,
    /// Seconds of processor time, all threads together; 0 where the system doesn't tell.
    pub render_cpu_s: f64,
    /// Rays traced.
    pub rays: u64,
    /// Paths traced.
    pub samples: u64,
    /// Mean number of samples a pixel.
    pub samples_per_pixel: f64,
    /// Samples that were NaN or infinite and left out.
    pub invalid_samples: u64,
    /// Stopped by the user: the picture is made of the samples that were done.
    pub interrupted: bool,
    /// Stopped by the time limit.
    pub timed_out: bool,
}

thread_local! {
    static WORKSPACE: RefCell<Workspace> = RefCell::new(Workspace::new());
}

/// Renders until all samples are done, `cancel` is set or the time limit is over. A stopped picture has all the tiles
/// that were finished; its pixels may differ in their number of samples by one pass.
pub fn render(
    scene: &CompiledScene,
    options: &RenderOptions,
    cancel: &AtomicBool,
    events: &(dyn Fn(Event) + Sync),
) -> (Film, Statistics) {
    let pool =
        options.threads.and_then(|n| rayon::ThreadPoolBuilder::new().num_threads(n.max(1)).build().ok());
    match pool {
        Some(pool) => pool.install(|| run(scene, options, cancel, events)),
        None => run(scene, options, cancel, events),
    }
}

fn run(
    scene: &CompiledScene,
    options: &RenderOptions,
    cancel: &AtomicBool,
    events: &(dyn Fn(Event) + Sync),
) -> (Film, Statistics) {
    let (begin, cpu) = (Instant::now(), CpuClock::start());
    let filter = FilterSampler::new(options.filter);
    let paths = PathOptions {
        max_depth: options.max_depth,
        seed: options.seed,
        filter: &filter,
        aovs: options.aovs.any(),
        soft_terminator: options.soft_terminator,
    };
    let integrator = Integrator::new(scene, paths);
    let mut film = Film::new(options.width, options.height, options.aovs);
    let progress = Progress::new(options, begin, events);
    let tiles = tiles(options);
    let mut statistics = Statistics::default();
    let mut first_sample = 0;
    while first_sample < options.samples {
        let samples = samples_of_pass().min(options.samples - first_sample);
        let done: Vec<Option<FilmTile>> = tiles
            .par_iter()
            .map(|tile| {
                if cancel.load(Ordering::Relaxed) {
                    return None;
                }
                let block = Block { first_sample, samples, ..*tile };
                let (filled, rays) = fill(&integrator, &film, &block);
                progress.add(&block, rays);
                Some(filled)
            })
            .collect();
        done.into_iter().flatten().for_each(|tile| film.merge(tile));
        first_sample += samples;
        statistics.interrupted = cancel.load(Ordering::Relaxed);
        statistics.timed_out = first_sample < options.samples
            && options.time_limit.is_some_and(|limit| begin.elapsed() >= limit);
        if statistics.interrupted || statistics.timed_out {
            break;
        }
    }
    let pixels = f64::from(options.width) * f64::from(options.height);
    statistics.samples = progress.samples.load(Ordering::Relaxed);
    statistics.samples_per_pixel = statistics.samples as f64 / pixels;
    statistics.rays = progress.rays.load(Ordering::Relaxed);
    statistics.invalid_samples = film.invalid_samples();
    statistics.render_s = begin.elapsed().as_secs_f64();
    statistics.render_cpu_s = cpu.seconds();
    (film, statistics)
}

/// A wave's worth for each tile: full vectors, and passes short enough to stop at.
fn samples_of_pass() -> u32 {
    WAVE as u32 / (TILE * TILE)
}

/// All tiles, row by row, with no samples yet.
fn tiles(options: &RenderOptions) -> Vec<Block> {
    let starts = |size: u32| (0..size).step_by(TILE as usize);
    let row = |y0| {
        starts(options.width).map(move |x0| Block {
            x0,
            y0,
            width: TILE.min(options.width - x0),
            height: TILE.min(options.height - y0),
            first_sample: 0,
            samples: 0,
        })
    };
    starts(options.height).flat_map(row).collect()
}

/// Traces a block into a tile of its own; returns it with the number of rays.
fn fill(integrator: &Integrator<'_>, film: &Film, block: &Block) -> (FilmTile, u64) {
    let mut tile = film.tile(block.x0, block.y0, block.width, block.height);
    let aovs = film.aovs().any();
    WORKSPACE.with(|workspace| {
        let workspace = &mut *workspace.borrow_mut();
        let before = workspace.ray_count;
        integrator.trace(block, workspace, |sample| {
            tile.add(sample.pixel, sample.rgb, sample.alpha);
            if aovs {
                tile.add_aovs(sample.pixel, sample.aov);
            }
        });
        (tile, workspace.ray_count - before)
    })
}

/// Counts what is done and tells about it, at most ten times a second.
struct Progress<'a> {
    samples: AtomicU64,
    rays: AtomicU64,
    total: u64,
    begin: Instant,
    /// When to tell again, in milliseconds from the beginning.
    next_ms: AtomicU64,
    events: &'a (dyn Fn(Event) + Sync),
}

impl<'a> Progress<'a> {
    fn new(options: &RenderOptions, begin: Instant, events: &'a (dyn Fn(Event) + Sync)) -> Progress<'a> {
        let total = u64::from(options.width) * u64::from(options.height) * u64::from(options.samples);
        Progress {
            samples: AtomicU64::new(0),
            rays: AtomicU64::new(0),
            total,
            begin,
            next_ms: AtomicU64::new(100),
            events,
        }
    }

    fn add(&self, block: &Block, rays: u64) {
        let paths = u64::from(block.width) * u64::from(block.height) * u64::from(block.samples);
        let samples_done = self.samples.fetch_add(paths, Ordering::Relaxed) + paths;
        let rays = self.rays.fetch_add(rays, Ordering::Relaxed) + rays;
        let elapsed = self.begin.elapsed();
        let (now, next) = (elapsed.as_millis() as u64, self.next_ms.load(Ordering::Relaxed));
        let is_due = now >= next || samples_done == self.total;
        // One thread wins; the others go on.
        let order = Ordering::Relaxed;
        if is_due && self.next_ms.compare_exchange(next, now + 100, order, order).is_ok() {
            (self.events)(Event::Progress { samples_done, samples_total: self.total, rays, elapsed });
        }
    }
}
