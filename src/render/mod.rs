//! Rendering: from a scene to a picture, at once or pass by pass; progress, stopping.
//!
//! The picture is made in passes of a few samples a pixel. In a pass, threads take tiles in any order and merge each into
//! the film when it is done; tiles share no pixels, and the tiles of a later pass wait for those of the earlier one where
//! they lie, so every pixel's sum has one order at any number of threads. Passes overlap where nothing has to look at the
//! picture between them: a time limit, an estimate of the noise and paths from lamps do.
//!
//! A rendering may take a share of a picture (`share.rs`), be written to a file and gone on from (`resume.rs`): its film's sums
//! are exact, and the technique that the first pass decides on is part of what is written.

mod adaptive;
mod cancel;
mod caustics;
mod clock;
mod denoising;
mod guiding;
mod halves;
mod halving;
mod identity;
mod labels;
mod layout;
mod metadata;
mod noise;
mod options;
mod passes;
mod picture;
mod pilot;
mod pool;
mod progress;
mod renderer;
mod rendering;
mod resume;
mod schedule;
mod settle;
mod share;
mod statistics;
mod technique;
mod tiles;
#[doc(hidden)]
pub mod timeline;
mod warnings;
mod work;

pub use crate::integrator::reuse::GroupShape;
pub use cancel::CancelHandle;
pub use denoising::{denoise_film, denoising_guides};
pub use guiding::guiding_bytes;
pub use identity::identity;
pub use labels::Labels;
pub use layout::{film_bytes, splat_bytes};
pub use metadata::shows_alpha;
pub use options::{Adaptive, Caustics, Guiding, PathReuse, RenderOptions, Splitting, TreeChoice};
pub use picture::Picture;
pub use pool::in_pool;
pub use progress::Event;
pub use renderer::Renderer;
pub use rendering::Rendering;
pub use settle::{ALL_AOVS, Choices, Settled};
pub use share::SAMPLE_BLOCK;
pub use statistics::{PassOutcome, Statistics};
pub use warnings::film_warnings;
