//! Processor time of this process.

use cpu_time::ProcessTime;

/// Measures processor time, all threads together.
pub(super) struct CpuClock(Option<ProcessTime>);

impl CpuClock {
    pub(super) fn start() -> CpuClock {
        CpuClock(ProcessTime::try_now().ok())
    }

    /// Seconds since the start; 0 where the system doesn't tell.
    pub(super) fn seconds(&self) -> f64 {
        self.0.and_then(|start| start.try_elapsed().ok()).map_or(0.0, |d| d.as_secs_f64())
    }
}
