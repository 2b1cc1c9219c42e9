//! Counts what is done and tells about it.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// What a renderer reports while it works.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Event {
    /// Progress; comes from any thread, several times a second.
    #[non_exhaustive]
    Progress {
        /// Paths done.
        samples_done: u64,
        /// Paths in all. Where an error decides on their number: as many as that will take, as far as it is known by then.
        samples_total: u64,
        /// Rays so far.
        rays: u64,
        /// Time spent rendering so far.
        elapsed: Duration,
        /// The estimated relative error of the picture after the last pass, where rendering goes by it and it is known.
        error: Option<f64>,
    },
}

/// Takes events, from any thread.
pub(super) type Listener = dyn Fn(Event) + Send + Sync;

/// Counts what is done and tells about it, at most ten times a second.
#[derive(Debug)]
pub(super) struct Progress {
    samples: AtomicU64,
    rays: AtomicU64,
    /// Paths in all, as far as is known.
    total: AtomicU64,
    /// The bits of the estimated error; of NaN, where there is none.
    error: AtomicU64,
    /// When to tell again, in milliseconds of rendering.
    next_ms: AtomicU64,
}

impl Progress {
    /// Nothing of so many paths is done.
    pub fn new(total: u64) -> Progress {
        Progress {
            samples: AtomicU64::new(0),
            rays: AtomicU64::new(0),
            total: AtomicU64::new(total),
            error: AtomicU64::new(f64::NAN.to_bits()),
            next_ms: AtomicU64::new(100),
        }
    }

    /// Goes on from so many paths and rays.
    pub fn go_on_from(&self, paths: u64, rays: u64) {
        self.samples.store(paths, Ordering::Relaxed);
        self.rays.store(rays, Ordering::Relaxed);
    }

    /// Expects so many paths in all by an estimated error.
    pub fn expect(&self, total: u64, error: f64) {
        self.total.store(total, Ordering::Relaxed);
        self.error.store(error.to_bits(), Ordering::Relaxed);
    }

    /// Paths done so far.
    pub fn samples(&self) -> u64 {
        self.samples.load(Ordering::Relaxed)
    }

    /// Rays of the paths done so far.
    pub fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }

    /// Adds finished paths with their rays, after so much time.
    pub fn add(&self, paths: u64, rays: u64, elapsed: Duration, listener: Option<&Listener>) {
        let samples_done = self.samples.fetch_add(paths, Ordering::Relaxed) + paths;
        let rays = self.rays.fetch_add(rays, Ordering::Relaxed) + rays;
        let Some(listener) = listener else { return };
        let (now, next) = (elapsed.as_millis() as u64, self.next_ms.load(Ordering::Relaxed));
        let samples_total = self.total.load(Ordering::Relaxed);
        let is_due = now >= next || samples_done == samples_total;
        // One thread wins; the others go on.
        let order = Ordering::Relaxed;
        if is_due && self.next_ms.compare_exchange(next, now + 100, order, order).is_ok() {
            let error =
                Some(f64::from_bits(self.error.load(Ordering::Relaxed))).filter(|error| !error.is_nan());
            listener(Event::Progress { samples_done, samples_total, rays, elapsed, error });
        }
    }
}
