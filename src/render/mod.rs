//! Renders a compiled scene.

use crate::compile::CompiledScene;
use crate::film::{AovSet, Film};
use crate::scene::Filter;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// How to render.
#[derive(Clone, Copy, Debug)]
pub struct RenderOptions {
    /// Picture width.
    pub width: u32,
    /// Picture height.
    pub height: u32,
    /// Samples a pixel.
    pub samples: u32,
    /// Seed.
    pub seed: u32,
    /// Scattering events.
    pub max_depth: u32,
    /// Threads.
    pub threads: Option<usize>,
    /// Filter.
    pub filter: Filter,
    /// AOVs.
    pub aovs: AovSet,
    /// Time limit.
    pub time_limit: Option<Duration>,
}

/// What the renderer tells.
#[derive(Clone, Copy, Debug)]
pub enum Event {
    /// Progress.
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
    /// Wall time.
    pub render_s: f64,
    /// CPU time.
    pub render_cpu_s: f64,
    /// Rays.
    pub rays: u64,
    /// Paths.
    pub samples: u64,
    /// Samples a pixel.
    pub samples_per_pixel: f64,
    /// Dropped.
    pub invalid_samples: u64,
    /// Stopped by the user.
    pub interrupted: bool,
    /// Stopped by the time limit.
    pub timed_out: bool,
}

/// Renders.
pub fn render(
    _scene: &CompiledScene,
    options: &RenderOptions,
    _cancel: &AtomicBool,
    _events: &(dyn Fn(Event) + Sync),
) -> (Film, Statistics) {
    (Film::new(options.width, options.height, options.aovs), Statistics::default())
}
