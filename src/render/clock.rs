//! Time spent rendering: by the clock on the wall, and of processors.

use cpu_time::ProcessTime;
use std::time::{Duration, Instant};

/// Time spent between starts and stops.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spent {
    pub wall: Duration,
    /// All threads together; zero where the system doesn't tell.
    pub cpu: Duration,
}

/// Measures until it is stopped, on top of what was spent before.
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

    /// Time by the wall's clock so far.
    pub fn wall(&self) -> Duration {
        self.before.wall + self.wall.elapsed()
    }

    /// Everything so far.
    pub fn stop(&self) -> Spent {
        let cpu = self.cpu.and_then(|start| start.try_elapsed().ok()).unwrap_or_default();
        Spent { wall: self.wall(), cpu: self.before.cpu + cpu }
    }
}
