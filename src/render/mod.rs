//! Rendering: passes over tiles on the threads of the current rayon pool, progress, stopping.
//!
//! The picture is made in passes of a few samples a pixel. In a pass, threads take tiles in any order and merge each into
//! the film when it is done; tiles share no pixels and passes follow each other, so every pixel's sum has one order at
//! any number of threads.

mod clock;
mod pool;
mod progress;
mod schedule;

pub use pool::in_pool;

use crate::compile::{CompiledScene, View};
use crate::error::Result;
use crate::film::{AovSet, Film, FilmTile, FilterSampler};
use crate::integrator::{Block, Integrator, PathOptions, Workspace};
use crate::scene::Filter;
use clock::CpuClock;
use progress::Progress;
use rayon::prelude::*;
use schedule::{Pass, Schedule};
use std::cell::RefCell;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

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
    /// Reconstruction filter.
    pub filter: Filter,
    /// What to record besides colour.
    pub aovs: AovSet,
    /// Soften the edges of self-shadowing on shapes with shading normals, which otherwise follow the triangles.
    pub soft_terminator: bool,
    /// Stop after this time. The number of samples then depends on the machine.
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
    /// Stopped by the user before all samples were done.
    pub interrupted: bool,
    /// Stopped by the time limit before all samples were done.
    pub timed_out: bool,
}

thread_local! {
    static WORKSPACE: RefCell<Workspace> = RefCell::new(Workspace::new());
}

/// Renders a view, whose size counts, until all samples are done, `cancel` is set or the time limit is over, on the current rayon pool.
///
/// With a time limit, passes are planned so that all pixels have the same number of samples; where a pass takes longer
/// than it should, and where `cancel` is set, the picture has the tiles that were finished until then: pixels may differ
/// in their number of samples by one pass. No sample is chosen by its value, so such a picture has the same mean.
///
/// # Errors
/// A usage error if there is no memory for the film. Once that is there, rendering can't fail.
pub fn render(
    scene: &CompiledScene,
    view: &View,
    options: &RenderOptions,
    cancel: &AtomicBool,
    events: &(dyn Fn(Event) + Sync),
) -> Result<(Film, Statistics)> {
    let options = &RenderOptions { width: view.width, height: view.height, ..*options };
    let film = Film::try_new(options.width, options.height, options.aovs)?;
    let (begin, cpu) = (Instant::now(), CpuClock::start());
    let filter = FilterSampler::new(options.filter);
    let paths = PathOptions {
        max_depth: options.max_depth,
        seed: options.seed,
        filter: &filter,
        aovs: options.aovs.any(),
        soft_terminator: options.soft_terminator,
    };
    let run = Run {
        integrator: Integrator::new(scene, view, paths),
        film: Mutex::new(film),
        progress: Progress::new(options, begin, events),
        cancel,
    };
    let mut schedule = Schedule::new(options, begin);
    let mut cut_short = false;
    while let Some(pass) = schedule.next(begin.elapsed()) {
        let start = Instant::now();
        cut_short = !run.pass(options, pass, &schedule);
        if cut_short {
            break;
        }
        schedule.finished(pass, start.elapsed());
    }
    let is_complete = schedule.is_complete() && !cut_short;
    let Run { film, progress, .. } = run;
    let film = film.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
    let samples = progress.samples();
    let interrupted = !is_complete && cancel.load(Ordering::Relaxed);
    let statistics = Statistics {
        render_s: begin.elapsed().as_secs_f64(),
        render_cpu_s: cpu.seconds(),
        rays: progress.rays(),
        samples,
        samples_per_pixel: samples as f64 / (f64::from(options.width) * f64::from(options.height)),
        invalid_samples: film.invalid_samples(),
        interrupted,
        timed_out: !is_complete && !interrupted,
    };
    Ok((film, statistics))
}

/// What all threads share.
struct Run<'a> {
    integrator: Integrator<'a>,
    film: Mutex<Film>,
    progress: Progress<'a>,
    cancel: &'a AtomicBool,
}

impl Run<'_> {
    /// Takes a pass over all tiles. False if it was stopped: then some tiles have not got its samples.
    fn pass(&self, options: &RenderOptions, pass: Pass, schedule: &Schedule) -> bool {
        let stop = || self.cancel.load(Ordering::Relaxed) || schedule.is_late();
        let one = |tile: &Block| {
            if stop() {
                return false;
            }
            let block = Block { first_sample: pass.first_sample, samples: pass.samples, ..*tile };
            let Some((filled, rays)) = self.fill(options.aovs, &block, &stop) else { return false };
            self.film.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).merge(filled);
            self.progress.add(&block, rays);
            true
        };
        // All of them: stopping is a look at a clock for each tile that is left.
        tiles(options, pass.tile()).par_iter().map(one).reduce(|| true, |a, b| a & b)
    }

    /// Traces a block into a tile of its own; returns it with the number of rays, or `None` if it was stopped.
    fn fill(&self, aovs: AovSet, block: &Block, stop: &dyn Fn() -> bool) -> Option<(FilmTile, u64)> {
        let mut tile = FilmTile::new(block.x0, block.y0, block.width, block.height, aovs);
        WORKSPACE.with(|workspace| {
            let workspace = &mut *workspace.borrow_mut();
            let before = workspace.ray_count;
            let is_done = self.integrator.trace(block, workspace, stop, |sample| {
                tile.add(sample.pixel, sample.rgb, sample.alpha);
                if aovs.any() {
                    tile.add_aovs(sample.pixel, sample.aov);
                }
            });
            is_done.then_some((tile, workspace.ray_count - before))
        })
    }
}

/// All tiles of a size, row by row, with no samples yet.
fn tiles(options: &RenderOptions, (width, height): (u32, u32)) -> Vec<Block> {
    let starts = |size: u32, step: u32| (0..size).step_by(step as usize);
    let row = |y0| {
        starts(options.width, width).map(move |x0| Block {
            x0,
            y0,
            width: width.min(options.width - x0),
            height: height.min(options.height - y0),
            first_sample: 0,
            samples: 0,
        })
    };
    starts(options.height, height).flat_map(row).collect()
}
