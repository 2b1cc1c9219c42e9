//! Rendering: from a scene to a picture, at once or pass by pass; progress, stopping.
//!
//! The picture is made in passes of a few samples per pixel. In a pass, threads take tiles in any order and merge each into
//! the film when it is done; tiles share no pixels, and the tiles of a later pass wait for those of the earlier one where
//! they lie, so every pixel's sum has one order at any number of threads. Passes overlap unless the picture is needed
//! between them: by a time limit, an estimate of the noise or light paths.
//!
//! A rendering may take a part of a picture (`schedule.rs`), be written to a file and resumed (`checkpoint.rs`): its film's sums
//! are exact, and the technique that the first pass decides on is part of the file.

mod caustics;
mod checkpoint;
mod guiding;
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

pub use crate::integrator::reuse::GroupShape;
pub use checkpoint::identity;
pub use guiding::guiding_bytes;
pub use noise::RarePaths;
pub use options::{
    ALL_AOVS, BvhQuality, Caustics, Guiding, PathReuse, RenderOptions, RequestedOptions, ResolvedOptions,
    Splitting, setting_help,
};
pub use picture::{
    Labels, Picture, denoise_film, denoising_guides, film_bytes, film_warnings, sequence_guides, shows_alpha,
    splat_bytes,
};
pub use progress::{CancelHandle, Event, PassOutcome, Statistics, TaskSpan, record_tasks, recorded_tasks};
pub use renderer::{Renderer, in_pool};
pub use rendering::Rendering;
pub use schedule::SAMPLE_BLOCK;
