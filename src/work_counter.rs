//! Progress of long work, readable from any thread.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// A progress counter in units of the work, such as bytes, rows or triangles. Clones share the counts.
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

    /// Adds completed units.
    pub fn add(&self, units: u64) {
        self.0.done.fetch_add(units, Ordering::Relaxed);
    }

    /// The completed and total units.
    pub fn counts(&self) -> (u64, u64) {
        (self.0.done.load(Ordering::Relaxed), self.0.total.load(Ordering::Relaxed))
    }

    /// The completed fraction, 0..1; `None` before [`WorkCounter::begin`].
    pub fn share(&self) -> Option<f64> {
        let (done, total) = self.counts();
        (total > 0).then(|| (done as f64 / total as f64).min(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clones_share_the_counts() {
        let counter = WorkCounter::default();
        let clone = counter.clone();
        assert_eq!(clone.share(), None);
        counter.begin(8);
        assert_eq!(clone.share(), Some(0.0));
        counter.add(2);
        assert_eq!(clone.share(), Some(0.25));
        counter.add(100);
        assert_eq!(clone.share(), Some(1.0));
        counter.begin(4);
        assert_eq!(clone.share(), Some(0.0));
    }
}
