//! How long parts of the work take: written down where a measurement asks for it, so that it can be replayed on any number of threads.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// A part of the work.
#[derive(Clone, Debug)]
pub struct Span {
    /// What it belongs to.
    pub stage: &'static str,
    /// All of a group may be done at the same time, and nothing else: such as the tiles of a pass, by its first sample. `None` where
    /// threads divide the part evenly.
    pub group: Option<u32>,
    /// Since when measuring began.
    pub start: Duration,
    /// How long it took.
    pub took: Duration,
}

static IS_ON: AtomicBool = AtomicBool::new(false);
static GROUPS: AtomicU32 = AtomicU32::new(0);
static SPANS: Mutex<Option<(Instant, Vec<Span>)>> = Mutex::new(None);

/// Begins to write down what is done, in the whole process; meant for one thread, on which parts follow each other.
#[doc(hidden)]
pub fn record() {
    *spans() = Some((Instant::now(), Vec::new()));
    IS_ON.store(true, Ordering::Relaxed);
}

/// Ends it. Returns its length and the parts in order.
#[doc(hidden)]
pub fn recorded() -> (Duration, Vec<Span>) {
    IS_ON.store(false, Ordering::Relaxed);
    spans().take().map(|(start, spans)| (start.elapsed(), spans)).unwrap_or_default()
}

/// A number for a group of its own.
pub(super) fn group() -> u32 {
    GROUPS.fetch_add(1, Ordering::Relaxed)
}

/// Does one of a group of parts.
pub(super) fn item<T>(stage: &'static str, group: u32, work: impl FnOnce() -> T) -> T {
    if IS_ON.load(Ordering::Relaxed) { measured(stage, Some(group), work) } else { work() }
}

/// Does what threads divide evenly.
pub(super) fn parallel<T>(stage: &'static str, work: impl FnOnce() -> T) -> T {
    if IS_ON.load(Ordering::Relaxed) { measured(stage, None, work) } else { work() }
}

fn measured<T>(stage: &'static str, group: Option<u32>, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    let took = start.elapsed();
    if let Some((begin, spans)) = &mut *spans() {
        spans.push(Span { stage, group, start: start.saturating_duration_since(*begin), took });
    }
    result
}

fn spans() -> std::sync::MutexGuard<'static, Option<(Instant, Vec<Span>)>> {
    SPANS.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}
