//! The threads that everything parallel runs on.

use crate::error::{Error, Result};

/// Stack of each thread, bytes: what a main thread usually has.
const STACK: usize = 8 << 20;

/// Runs `work` on a pool of its own with this many threads (`None`: one per core): loading and rendering inside it use
/// these threads only.
///
/// # Errors
/// A usage error if the system refuses the threads.
pub fn in_pool<R: Send>(threads: Option<usize>, work: impl FnOnce() -> R + Send) -> Result<R> {
    let builder = rayon::ThreadPoolBuilder::new().stack_size(STACK).num_threads(threads.unwrap_or(0));
    let pool = builder.build().map_err(|e| {
        let count = threads.map_or("the".to_string(), |n| n.to_string());
        Error::usage(format!("can't start {count} threads: {e}")).with_help("ask for fewer")
    })?;
    Ok(pool.install(work))
}
