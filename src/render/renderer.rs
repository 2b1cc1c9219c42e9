//! The renderer: takes a pass at a time, and has a picture after each.

use super::cancel::CancelHandle;
use super::clock::{Spent, Stopwatch};
use super::options::RenderOptions;
use super::progress::{Event, Listener, Progress};
use super::schedule::{Pass, Schedule};
use crate::compile::{CompiledScene, View};
use crate::error::Result;
use crate::film::{Film, FilmTile, FilterSampler, Layout};
use crate::integrator::{Block, Integrator, PathOptions, Workspace};
use rayon::prelude::*;
use std::cell::RefCell;
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// Where a renderer stands after a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PassOutcome {
    /// All pixels have the samples of the pass; there are more to take.
    Progressed,
    /// All samples are taken.
    Done,
    /// Stopped by a [`CancelHandle`]; no further pass will be taken.
    Cancelled,
    /// Stopped by the time limit; no further pass will be taken.
    TimedOut,
}

/// What rendering took so far.
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct Statistics {
    /// Seconds by the clock on the wall, between passes not included.
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

/// Renders a scene, pass by pass, on the current rayon pool (see [`in_pool`](super::in_pool)).
///
/// Between passes the film is a picture of the samples so far. With a time limit, passes are planned so that all pixels
/// have the same number of samples; where a pass takes longer than it should, and when rendering is cancelled, the film
/// has the tiles that were finished until then: pixels may differ in their number of samples by one pass. No sample is
/// chosen by its value, so such a picture has the same mean.
///
/// ```no_run
/// # fn scene() -> (oscura::compile::CompiledScene, oscura::compile::View) { unimplemented!() }
/// use oscura::render::{PassOutcome, Renderer, RenderOptions};
/// let (scene, view) = scene();
/// let mut renderer = Renderer::new(scene, view, RenderOptions::default().samples(64))?;
/// while renderer.next_pass() == PassOutcome::Progressed {
///     let centre = renderer.film().mean_rgba(640, 360);
///     println!("{:.0} samples: {centre:?}", renderer.statistics().samples_per_pixel);
/// }
/// # Ok::<(), oscura::error::Error>(())
/// ```
pub struct Renderer {
    scene: Arc<CompiledScene>,
    view: View,
    options: RenderOptions,
    filter: FilterSampler,
    film: Film,
    schedule: Schedule,
    progress: Progress,
    spent: Spent,
    outcome: PassOutcome,
    cancel: CancelHandle,
    listener: Option<Box<Listener>>,
}

thread_local! {
    static WORKSPACE: RefCell<Workspace> = RefCell::new(Workspace::new());
}

impl Renderer {
    /// A renderer that has taken no sample yet. Scenes may be shared among renderers by `Arc`.
    ///
    /// # Errors
    /// A usage error if there is no memory for the film. Once that is there, rendering can't fail.
    pub fn new(scene: impl Into<Arc<CompiledScene>>, view: View, options: RenderOptions) -> Result<Renderer> {
        let film = Film::try_new(view.width, view.height, options.aovs.channels())?;
        let stopwatch = Stopwatch::start(Spent::default());
        let pixels = u64::from(view.width) * u64::from(view.height);
        Ok(Renderer {
            scene: scene.into(),
            view,
            filter: FilterSampler::new(options.filter),
            film,
            schedule: Schedule::new(options.samples, options.time_limit),
            progress: Progress::new(pixels * u64::from(options.samples)),
            spent: stopwatch.stop(),
            outcome: PassOutcome::Progressed,
            cancel: CancelHandle::new(),
            listener: None,
            options,
        })
    }

    /// Lets an existing handle stop it, in place of one of its own.
    #[must_use]
    pub fn with_cancel_handle(self, cancel: CancelHandle) -> Renderer {
        Renderer { cancel, ..self }
    }

    /// Tells `listener` how far it is, several times a second, from any thread.
    #[must_use]
    pub fn on_event(self, listener: impl Fn(Event) + Send + Sync + 'static) -> Renderer {
        Renderer { listener: Some(Box::new(listener)), ..self }
    }

    /// A handle that stops it from any thread.
    pub fn cancel_handle(&self) -> CancelHandle {
        self.cancel.clone()
    }

    /// Takes the next samples of all pixels, at most eight. Does nothing once all are taken or it was stopped.
    pub fn next_pass(&mut self) -> PassOutcome {
        if self.outcome == PassOutcome::Progressed {
            let stopwatch = Stopwatch::start(self.spent);
            self.outcome = self.take_pass(&stopwatch);
            self.spent = stopwatch.stop();
        }
        self.outcome
    }

    /// Takes passes until all samples are taken or it is stopped.
    pub fn run(&mut self) -> PassOutcome {
        while self.next_pass() == PassOutcome::Progressed {}
        self.outcome
    }

    /// The samples so far.
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// Gives the film away.
    pub fn into_film(self) -> Film {
        self.film
    }

    /// What it took so far.
    pub fn statistics(&self) -> Statistics {
        let samples = self.progress.samples();
        let pixels = f64::from(self.film.width()) * f64::from(self.film.height());
        Statistics {
            render_s: self.spent.wall.as_secs_f64(),
            render_cpu_s: self.spent.cpu.as_secs_f64(),
            rays: self.progress.rays(),
            samples,
            samples_per_pixel: samples as f64 / pixels,
            invalid_samples: self.film.invalid_samples(),
            interrupted: self.outcome == PassOutcome::Cancelled,
            timed_out: self.outcome == PassOutcome::TimedOut,
        }
    }

    fn take_pass(&mut self, stopwatch: &Stopwatch) -> PassOutcome {
        let Some(pass) = self.schedule.next(stopwatch.wall()) else {
            return if self.schedule.is_complete() { PassOutcome::Done } else { PassOutcome::TimedOut };
        };
        let start = Instant::now();
        let paths = PathOptions {
            max_depth: self.options.max_depth,
            seed: self.options.seed,
            filter: &self.filter,
            aovs: self.options.aovs.of_first_hits(),
            soft_terminator: self.options.soft_terminator,
        };
        let layout = self.film.layout().clone();
        let work = PassWork {
            integrator: Integrator::new(&self.scene, &self.view, paths),
            layout: &layout,
            film: Mutex::new(&mut self.film),
            progress: &self.progress,
            listener: self.listener.as_deref(),
            stopwatch,
            stop: &|| self.cancel.is_cancelled() || self.schedule.is_late(stopwatch.wall()),
        };
        let is_finished = work.run(tiles(&self.view, pass));
        self.schedule.finished(pass, start.elapsed());
        match is_finished {
            true if self.schedule.is_complete() => PassOutcome::Done,
            true => PassOutcome::Progressed,
            false if self.cancel.is_cancelled() => PassOutcome::Cancelled,
            false => PassOutcome::TimedOut,
        }
    }
}

/// What all threads share in a pass.
struct PassWork<'a> {
    integrator: Integrator<'a>,
    layout: &'a Arc<Layout>,
    film: Mutex<&'a mut Film>,
    progress: &'a Progress,
    listener: Option<&'a Listener>,
    stopwatch: &'a Stopwatch,
    stop: &'a (dyn Fn() -> bool + Sync),
}

impl PassWork<'_> {
    /// Takes all tiles. False if it was stopped: then some have not got their samples.
    fn run(&self, tiles: Vec<Block>) -> bool {
        let one = |block: &Block| {
            if (self.stop)() {
                return false;
            }
            let Some((filled, rays)) = self.fill(block) else { return false };
            self.film.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).merge(filled);
            let paths = u64::from(block.width) * u64::from(block.height) * u64::from(block.samples);
            self.progress.add(paths, rays, self.stopwatch.wall(), self.listener);
            true
        };
        // All of them: stopping is a look at a clock for each tile that is left.
        tiles.par_iter().map(one).reduce(|| true, |a, b| a & b)
    }

    /// Traces a block into a tile of its own; returns it with the number of rays, or `None` if it was stopped.
    fn fill(&self, block: &Block) -> Option<(FilmTile, u64)> {
        let mut tile = FilmTile::new(block.x0, block.y0, block.width, block.height, self.layout);
        let has_more = self.layout.has_more_than_color();
        WORKSPACE.with(|workspace| {
            let workspace = &mut *workspace.borrow_mut();
            let before = workspace.ray_count;
            let is_done = self.integrator.trace(block, workspace, &self.stop, |sample| {
                if has_more {
                    tile.add_with_first_hit(sample.pixel, sample.rgb, sample.alpha, sample.first_hit);
                } else {
                    tile.add(sample.pixel, sample.rgb, sample.alpha);
                }
            });
            is_done.then_some((tile, workspace.ray_count - before))
        })
    }
}

/// The tiles of a pass, row by row.
fn tiles(view: &View, pass: Pass) -> Vec<Block> {
    let (width, height) = pass.tile();
    let starts = |size: u32, step: u32| (0..size).step_by(step as usize);
    let row = |y0| {
        starts(view.width, width).map(move |x0| Block {
            x0,
            y0,
            width: width.min(view.width - x0),
            height: height.min(view.height - y0),
            first_sample: pass.first_sample,
            samples: pass.samples,
        })
    };
    starts(view.height, height).flat_map(row).collect()
}
