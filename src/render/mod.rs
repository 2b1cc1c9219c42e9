//! Rendering: from a scene to a picture, at once or pass by pass; progress and cancellation.
//!
//! A picture is rendered in passes of a few samples per pixel. In a pass, threads render tiles in any order and merge each into the film;
//! tiles don't overlap, and a tile of a later pass is merged after the earlier pass's tiles at its pixels, so that the order of every
//! pixel's sum is independent of threads. Passes overlap unless the film must be complete between them: for a time limit, a noise
//! threshold or light tracing.
//!
//! A rendering may cover a part of a picture (`schedule.rs`), and be saved and resumed (`checkpoint.rs`): the film's sums are exact, and
//! the technique chosen in the first pass is stored in the file.

mod caustics;
mod checkpoint;
mod error_estimate;
mod guiding;
mod light_selection;
mod noise;
mod options;
mod pass;
mod path_strategy;
mod picture;
mod progress;
mod renderer;
mod rendering;
mod schedule;
mod technique;
mod techniques;
mod validation;

pub use crate::integrator::reuse::GroupShape;
pub use checkpoint::identity;
pub use guiding::guiding_bytes;
pub use noise::RarePaths;
pub use options::{
    ALL_AOVS, BvhQuality, Caustics, Guiding, LightSelection, PathReuse, RenderOptions, RequestedOptions,
    ResolvedOptions, Splitting, setting_help,
};
pub use picture::{
    Labels, Picture, denoise_film, denoising_guides, film_bytes, film_warnings, has_visible_alpha,
    sequence_guides, splat_bytes,
};
pub use progress::{CancelHandle, Event, PassOutcome, Statistics, TaskSpan, record_tasks, recorded_tasks};
pub use renderer::{Renderer, in_pool};
pub use rendering::Rendering;
pub use schedule::SAMPLE_BLOCK;
