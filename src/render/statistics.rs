//! Where rendering stands and what it took.

use crate::integrator::reuse::GroupShape;

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
    /// The picture is as good as it was to be; no further pass will be taken.
    Converged,
    /// Stopped by the time limit; no further pass will be taken.
    TimedOut,
}

/// What rendering took so far.
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct Statistics {
    /// Seconds of wall-clock time, without the time between passes.
    pub render_s: f64,
    /// Seconds of processor time, all threads together; 0 where the system doesn't tell.
    pub render_cpu_s: f64,
    /// Rays traced.
    pub rays: u64,
    /// Paths traced.
    pub samples: u64,
    /// Mean number of samples per pixel.
    pub samples_per_pixel: f64,
    /// In which groups pixels share paths; `None` if they don't, or that is not decided yet.
    pub path_reuse: Option<GroupShape>,
    /// Paths that go on from the first surface of each sample.
    pub branches: u32,
    /// Do noisy pixels get more samples than others?
    pub is_adaptive: bool,
    /// How many paths from lamps stood for one sample of each pixel, if caustics were found so.
    pub lamp_paths: Option<u32>,
    /// How many places a guide of the paths knew something of, if they were guided.
    pub guide_cells: Option<u32>,
    /// Images of textures that were decoded on demand, each as often as it was.
    pub images_on_demand: u64,
    /// Tiles of textures that were found on demand.
    pub tiles_on_demand: u64,
    /// Samples that were NaN or infinite and left out.
    pub invalid_samples: u64,
    /// Stopped by a [`CancelHandle`](super::CancelHandle) before all samples were done.
    pub interrupted: bool,
    /// Stopped by the time limit before all samples were done.
    pub timed_out: bool,
    /// The estimated relative error of the whole picture, where [`RenderOptions::noise`](super::RenderOptions::noise) asks
    /// for it: see there. `None` below 32 samples a pixel.
    pub error: Option<f64>,
}
