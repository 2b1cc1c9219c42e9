//! Progress, statistics, time and cancellation of a rendering, and timings of its tasks.

use crate::integrator::reuse::GroupShape;
use cpu_time::ProcessTime;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

/// Reports of a renderer while it works.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Event {
    /// Progress; comes from any thread, several times per second.
    #[non_exhaustive]
    Progress {
        /// Paths done.
        samples_done: u64,
        /// Paths in all. Where an error decides on their number: as many as that will take, as far as it is known by then.
        samples_total: u64,
        /// Rays so far.
        rays: u64,
        /// Time spent rendering so far.
        elapsed: Duration,
        /// The estimated relative error of the picture after the last pass, where rendering goes by it and it is known.
        error: Option<f64>,
    },
}

/// Takes events, from any thread.
pub(super) type Listener = dyn Fn(Event) + Send + Sync;

/// Counts paths and rays, and reports them at most ten times per second.
#[derive(Debug)]
pub(super) struct Progress {
    samples: AtomicU64,
    rays: AtomicU64,
    /// Predicted number of paths.
    total: AtomicU64,
    /// The bits of the estimated error; those of NaN without one.
    error: AtomicU64,
    /// Time of the next report, milliseconds.
    next_ms: AtomicU64,
}

impl Progress {
    /// For this number of paths, none of them done.
    pub fn new(total: u64) -> Progress {
        Progress {
            samples: AtomicU64::new(0),
            rays: AtomicU64::new(0),
            total: AtomicU64::new(total),
            error: AtomicU64::new(f64::NAN.to_bits()),
            next_ms: AtomicU64::new(100),
        }
    }

    /// Resumes after this many paths and rays.
    pub fn go_on_from(&self, paths: u64, rays: u64) {
        self.samples.store(paths, Ordering::Relaxed);
        self.rays.store(rays, Ordering::Relaxed);
    }

    /// Sets the predicted number of paths and the estimated error.
    pub fn expect(&self, total: u64, error: f64) {
        self.total.store(total, Ordering::Relaxed);
        self.error.store(error.to_bits(), Ordering::Relaxed);
    }

    /// Paths done so far.
    pub fn samples(&self) -> u64 {
        self.samples.load(Ordering::Relaxed)
    }

    /// Rays of the paths done so far.
    pub fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }

    /// Adds finished paths with their rays, `elapsed` after the start.
    pub fn add(&self, paths: u64, rays: u64, elapsed: Duration, listener: Option<&Listener>) {
        let samples_done = self.samples.fetch_add(paths, Ordering::Relaxed) + paths;
        let rays = self.rays.fetch_add(rays, Ordering::Relaxed) + rays;
        let Some(listener) = listener else { return };
        let (now, next) = (elapsed.as_millis() as u64, self.next_ms.load(Ordering::Relaxed));
        let samples_total = self.total.load(Ordering::Relaxed);
        let is_due = now >= next || samples_done == samples_total;
        // One thread reports.
        let order = Ordering::Relaxed;
        if is_due && self.next_ms.compare_exchange(next, now + 100, order, order).is_ok() {
            let error =
                Some(f64::from_bits(self.error.load(Ordering::Relaxed))).filter(|error| !error.is_nan());
            listener(Event::Progress { samples_done, samples_total, rays, elapsed, error });
        }
    }
}

// Outcome and statistics.

/// Where rendering stands after a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PassOutcome {
    /// All pixels have the samples of the pass; there are more to take.
    Progressed,
    /// All samples are taken.
    Done,
    /// Stopped by a [`CancelHandle`](super::CancelHandle); no further pass will be taken.
    Cancelled,
    /// The picture has the requested quality; no further pass will be taken.
    Converged,
    /// Stopped by the time limit; no further pass will be taken.
    TimedOut,
}

/// Time and resources of rendering so far.
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct Statistics {
    /// Seconds of wall-clock time, without the time between passes.
    pub render_s: f64,
    /// Seconds of processor time, all threads together; 0 where the system doesn't report it.
    pub render_cpu_s: f64,
    /// Rays traced.
    pub rays: u64,
    /// Paths traced.
    pub samples: u64,
    /// Mean number of samples per pixel.
    pub samples_per_pixel: f64,
    /// Groups in which pixels share paths; `None` if they don't, or before that is decided.
    pub path_reuse: Option<GroupShape>,
    /// Paths per sample from its first surface on.
    pub branches: u32,
    /// Number of light paths per sample of all pixels, if light tracing finds caustics.
    pub light_paths: Option<u32>,
    /// Number of cells of the guide with training data, if paths were guided.
    pub guide_cells: Option<u32>,
    /// Images of textures that were decoded on demand, each as often as it was.
    pub images_on_demand: u64,
    /// Tiles of textures that were read from the temporary file.
    pub tiles_on_demand: u64,
    /// Samples that were NaN or infinite and left out.
    pub invalid_samples: u64,
    /// Stopped by a [`CancelHandle`](super::CancelHandle) before all samples were done.
    pub interrupted: bool,
    /// Stopped by the time limit before all samples were done.
    pub timed_out: bool,
    /// The estimated relative error of the whole picture, where [`RenderOptions::noise`](super::RenderOptions::noise) asks
    /// for it: see there. `None` below 32 samples per pixel.
    pub error: Option<f64>,
}

// Wall-clock and processor time.

/// Time spent rendering.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spent {
    pub wall: Duration,
    /// All threads together; zero where the system doesn't measure it.
    pub cpu: Duration,
}

/// Measures time in addition to that spent before.
pub(super) struct Stopwatch {
    before: Spent,
    wall: Instant,
    cpu: Option<ProcessTime>,
}

impl Stopwatch {
    /// Starts.
    pub fn start(before: Spent) -> Stopwatch {
        Stopwatch { before, wall: Instant::now(), cpu: ProcessTime::try_now().ok() }
    }

    /// Wall-clock time so far.
    pub fn wall(&self) -> Duration {
        self.before.wall + self.wall.elapsed()
    }

    /// Everything so far.
    pub fn stop(&self) -> Spent {
        let cpu = self.cpu.and_then(|start| start.try_elapsed().ok()).unwrap_or_default();
        Spent { wall: self.wall(), cpu: self.before.cpu + cpu }
    }
}

// Cancellation.

/// Stops renderers, from any thread: clones are one switch.
#[derive(Clone, Debug, Default)]
pub struct CancelHandle(Arc<AtomicBool>);

impl CancelHandle {
    /// A switch that nobody has used.
    pub fn new() -> CancelHandle {
        CancelHandle::default()
    }

    /// Asks to stop soon. Returns whether that was asked before.
    pub fn cancel(&self) -> bool {
        self.0.swap(true, Ordering::SeqCst)
    }

    /// Was it asked to stop?
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

// Timings of tasks, recorded on request: a benchmark replays them for other numbers of threads.

/// A timed task.
#[derive(Clone, Debug)]
pub struct TaskSpan {
    /// Its stage.
    pub stage: &'static str,
    /// Tasks of one group may run at the same time, those of different groups may not: the tiles of a pass, by its first sample. `None`
    /// for work that threads divide evenly.
    pub group: Option<u32>,
    /// Start, since the recording began.
    pub start: Duration,
    /// Duration.
    pub took: Duration,
}

static IS_ON: AtomicBool = AtomicBool::new(false);
static GROUPS: AtomicU32 = AtomicU32::new(0);
static SPANS: Mutex<Option<(Instant, Vec<TaskSpan>)>> = Mutex::new(None);

/// Starts to record the tasks of the whole process; meant for one thread, on which tasks follow each other.
#[doc(hidden)]
pub fn record_tasks() {
    *spans() = Some((Instant::now(), Vec::new()));
    IS_ON.store(true, Ordering::Relaxed);
}

/// Ends the recording. Returns its duration and the tasks in order.
#[doc(hidden)]
pub fn recorded_tasks() -> (Duration, Vec<TaskSpan>) {
    IS_ON.store(false, Ordering::Relaxed);
    spans().take().map(|(start, spans)| (start.elapsed(), spans)).unwrap_or_default()
}

/// The number of a new group.
pub(super) fn new_task_group() -> u32 {
    GROUPS.fetch_add(1, Ordering::Relaxed)
}

/// Runs a task of a group.
pub(super) fn task<T>(stage: &'static str, group: u32, work: impl FnOnce() -> T) -> T {
    if IS_ON.load(Ordering::Relaxed) { measured(stage, Some(group), work) } else { work() }
}

/// Runs work that threads divide evenly.
pub(super) fn divided<T>(stage: &'static str, work: impl FnOnce() -> T) -> T {
    if IS_ON.load(Ordering::Relaxed) { measured(stage, None, work) } else { work() }
}

fn measured<T>(stage: &'static str, group: Option<u32>, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    let took = start.elapsed();
    if let Some((begin, spans)) = &mut *spans() {
        spans.push(TaskSpan { stage, group, start: start.saturating_duration_since(*begin), took });
    }
    result
}

fn spans() -> MutexGuard<'static, Option<(Instant, Vec<TaskSpan>)>> {
    SPANS.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}
