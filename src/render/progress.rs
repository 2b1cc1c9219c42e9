//! Progress, statistics, time measurement and cancellation of a rendering, and timings of tasks.

use crate::integrator::reuse::GroupShape;
use cpu_time::ProcessTime;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

/// Events during rendering.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Event {
    /// Progress; sent from any thread, several times per second.
    #[non_exhaustive]
    Progress {
        /// Number of paths traced.
        samples_done: u64,
        /// Total number of paths; with a noise threshold, the current prediction.
        samples_total: u64,
        /// Number of rays traced.
        rays: u64,
        /// Time spent rendering.
        elapsed: Duration,
        /// Estimated relative error of the picture after the last pass, with a noise threshold.
        error: Option<f64>,
    },
}

/// Receives events, from any thread.
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
    /// No progress yet of `total` paths.
    pub fn new(total: u64) -> Progress {
        Progress {
            samples: AtomicU64::new(0),
            rays: AtomicU64::new(0),
            total: AtomicU64::new(total),
            error: AtomicU64::new(f64::NAN.to_bits()),
            next_ms: AtomicU64::new(100),
        }
    }

    /// Resumes after these numbers of paths and rays.
    pub fn resume_at(&self, paths: u64, rays: u64) {
        self.samples.store(paths, Ordering::Relaxed);
        self.rays.store(rays, Ordering::Relaxed);
    }

    /// Sets the predicted number of paths and the estimated error.
    pub fn expect(&self, total: u64, error: f64) {
        self.total.store(total, Ordering::Relaxed);
        self.error.store(error.to_bits(), Ordering::Relaxed);
    }

    /// Number of paths traced.
    pub fn samples(&self) -> u64 {
        self.samples.load(Ordering::Relaxed)
    }

    /// Number of rays traced.
    pub fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }

    /// Adds finished paths and their rays, and reports progress if due.
    pub fn add(&self, paths: u64, rays: u64, elapsed: Duration, listener: Option<&Listener>) {
        let samples_done = self.samples.fetch_add(paths, Ordering::Relaxed) + paths;
        let rays = self.rays.fetch_add(rays, Ordering::Relaxed) + rays;
        let Some(listener) = listener else { return };
        let (now, next) = (elapsed.as_millis() as u64, self.next_ms.load(Ordering::Relaxed));
        let samples_total = self.total.load(Ordering::Relaxed);
        let is_due = now >= next || samples_done == samples_total;
        // Only one thread reports.
        let order = Ordering::Relaxed;
        if is_due && self.next_ms.compare_exchange(next, now + 100, order, order).is_ok() {
            let error =
                Some(f64::from_bits(self.error.load(Ordering::Relaxed))).filter(|error| !error.is_nan());
            listener(Event::Progress { samples_done, samples_total, rays, elapsed, error });
        }
    }
}

// Outcome and statistics.

/// State of a rendering after a pass. Further passes are rendered only after `Progressed`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PassOutcome {
    /// The pass is finished, and samples remain.
    Progressed,
    /// All samples are rendered.
    Done,
    /// Stopped by a [`CancelHandle`](super::CancelHandle).
    Cancelled,
    /// The noise threshold is reached.
    Converged,
    /// Stopped by the time limit.
    TimedOut,
}

/// Time and resources of rendering so far.
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct Statistics {
    /// Wall-clock time in seconds, without the time between passes.
    pub render_s: f64,
    /// Processor time of all threads in seconds; 0 if the system doesn't report it.
    pub render_cpu_s: f64,
    /// Number of rays traced.
    pub rays: u64,
    /// Number of paths traced.
    pub samples: u64,
    /// Mean number of samples per pixel.
    pub samples_per_pixel: f64,
    /// Groups of path reuse; `None` if not in use or not decided yet.
    pub path_reuse: Option<GroupShape>,
    /// Number of branches per sample (path splitting).
    pub branches: u32,
    /// Number of light paths per sample of the whole picture, with light tracing of caustics.
    pub light_paths: Option<u32>,
    /// Number of cells with learned weights of lights, with learned light selection.
    pub light_cells: Option<u32>,
    /// Number of cells of the guide with training data, with path guiding.
    pub guide_cells: Option<u32>,
    /// Number of decodes of texture images on demand.
    pub images_on_demand: u64,
    /// Number of texture tiles read from the temporary file.
    pub tiles_on_demand: u64,
    /// Number of samples that were NaN or infinite and ignored.
    pub invalid_samples: u64,
    /// Stopped by a [`CancelHandle`](super::CancelHandle) before all samples were rendered.
    pub interrupted: bool,
    /// Stopped by the time limit before all samples were rendered.
    pub timed_out: bool,
    /// Estimated relative error of the whole picture, with a noise threshold: see [`RenderOptions::noise`](super::RenderOptions::noise).
    /// `None` below 32 samples per pixel.
    pub error: Option<f64>,
}

// Wall-clock and processor time.

/// Time spent rendering.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spent {
    pub wall: Duration,
    /// Of all threads; zero if the system doesn't measure it.
    pub cpu: Duration,
}

/// Measures time, continuing from the time spent before.
pub(super) struct Stopwatch {
    before: Spent,
    wall: Instant,
    cpu: Option<ProcessTime>,
}

impl Stopwatch {
    /// Starts measuring.
    pub fn start(before: Spent) -> Stopwatch {
        Stopwatch { before, wall: Instant::now(), cpu: ProcessTime::try_now().ok() }
    }

    /// Wall-clock time so far.
    pub fn wall(&self) -> Duration {
        self.before.wall + self.wall.elapsed()
    }

    /// Wall-clock and processor time so far.
    pub fn stop(&self) -> Spent {
        let cpu = self.cpu.and_then(|start| start.try_elapsed().ok()).unwrap_or_default();
        Spent { wall: self.wall(), cpu: self.before.cpu + cpu }
    }
}

// Cancellation.

/// Cancels renderings from any thread; clones share one flag.
#[derive(Clone, Debug, Default)]
pub struct CancelHandle(Arc<AtomicBool>);

impl CancelHandle {
    /// A handle that is not cancelled.
    pub fn new() -> CancelHandle {
        CancelHandle::default()
    }

    /// Requests cancellation. Returns whether it was requested before.
    pub fn cancel(&self) -> bool {
        self.0.swap(true, Ordering::SeqCst)
    }

    /// Was cancellation requested?
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

// Timings of tasks, recorded on request: a benchmark simulates other numbers of threads from them.

/// A timed task.
#[derive(Clone, Debug)]
pub struct TaskSpan {
    /// Stage of rendering.
    pub stage: &'static str,
    /// Tasks of the same group may run concurrently, those of different groups may not. The group of a pass's tiles is the first sample.
    /// `None` for work divided evenly between threads.
    pub group: Option<u32>,
    /// Start, relative to the start of the recording.
    pub start: Duration,
    /// Duration.
    pub took: Duration,
}

static IS_RECORDING: AtomicBool = AtomicBool::new(false);
static GROUPS: AtomicU32 = AtomicU32::new(0);
static SPANS: Mutex<Option<(Instant, Vec<TaskSpan>)>> = Mutex::new(None);

/// Starts recording the tasks of the whole process; for use with one thread, which runs tasks one after another.
#[doc(hidden)]
pub fn record_tasks() {
    *spans() = Some((Instant::now(), Vec::new()));
    IS_RECORDING.store(true, Ordering::Relaxed);
}

/// Ends the recording; returns its duration and the tasks in order.
#[doc(hidden)]
pub fn recorded_tasks() -> (Duration, Vec<TaskSpan>) {
    IS_RECORDING.store(false, Ordering::Relaxed);
    spans().take().map(|(start, spans)| (start.elapsed(), spans)).unwrap_or_default()
}

/// The number of a new group.
pub(super) fn new_task_group() -> u32 {
    GROUPS.fetch_add(1, Ordering::Relaxed)
}

/// Runs a task of a group.
pub(super) fn task<T>(stage: &'static str, group: u32, work: impl FnOnce() -> T) -> T {
    if IS_RECORDING.load(Ordering::Relaxed) { measured(stage, Some(group), work) } else { work() }
}

/// Runs work that is divided evenly between threads.
pub(super) fn parallel_task<T>(stage: &'static str, work: impl FnOnce() -> T) -> T {
    if IS_RECORDING.load(Ordering::Relaxed) { measured(stage, None, work) } else { work() }
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
