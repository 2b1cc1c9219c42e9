//! Progress of long work: a worker counts, any thread may read.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Counts of what is done and of what there is to do, in units of the work itself: bytes, rows, triangles. Copies are of the same
/// counts, and any thread may look at them.
#[derive(Clone, Debug, Default)]
pub struct WorkCounter(Arc<Counts>);

#[derive(Debug, Default)]
struct Counts {
    done: AtomicU64,
    total: AtomicU64,
}

impl WorkCounter {
    /// Starts work of `total` units.
    pub fn begin(&self, total: u64) {
        self.0.done.store(0, Ordering::Relaxed);
        self.0.total.store(total, Ordering::Relaxed);
    }

    /// Counts further units as done.
    pub fn add(&self, units: u64) {
        self.0.done.fetch_add(units, Ordering::Relaxed);
    }

    /// The units that are done, and all.
    pub fn counts(&self) -> (u64, u64) {
        (self.0.done.load(Ordering::Relaxed), self.0.total.load(Ordering::Relaxed))
    }

    /// The share that is done, 0..1; `None` before [`WorkCounter::begin`].
    pub fn share(&self) -> Option<f64> {
        let (done, total) = self.counts();
        (total > 0).then(|| (done as f64 / total as f64).min(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_show_the_same_share() {
        let counter = WorkCounter::default();
        let seen = counter.clone();
        assert_eq!(seen.share(), None);
        counter.begin(8);
        assert_eq!(seen.share(), Some(0.0));
        counter.add(2);
        assert_eq!(seen.share(), Some(0.25));
        counter.add(100);
        assert_eq!(seen.share(), Some(1.0));
        counter.begin(4);
        assert_eq!(seen.share(), Some(0.0));
    }
}
