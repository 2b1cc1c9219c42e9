//! Rendering: passes over tiles on the threads of the current rayon pool, progress, stopping.
//!
//! The picture is made in passes of a few samples a pixel. In a pass, threads take tiles in any order and merge each into
//! the film when it is done; tiles share no pixels and passes follow each other, so every pixel's sum has one order at
//! any number of threads.

mod cancel;
mod clock;
mod options;
mod pool;
mod progress;
mod renderer;
mod schedule;

pub use cancel::CancelHandle;
pub use options::RenderOptions;
pub use pool::in_pool;
pub use progress::Event;
pub use renderer::{PassOutcome, Renderer, Statistics};
