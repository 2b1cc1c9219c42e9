//! Counts what is done and tells about it.

use super::{Event, RenderOptions};
use crate::integrator::Block;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// Counts what is done and tells about it, at most ten times a second.
pub(super) struct Progress<'a> {
    samples: AtomicU64,
    rays: AtomicU64,
    total: u64,
    begin: Instant,
    /// When to tell again, in milliseconds from the beginning.
    next_ms: AtomicU64,
    events: &'a (dyn Fn(Event) + Sync),
}

impl<'a> Progress<'a> {
    pub fn new(options: &RenderOptions, begin: Instant, events: &'a (dyn Fn(Event) + Sync)) -> Progress<'a> {
        let total = u64::from(options.width) * u64::from(options.height) * u64::from(options.samples);
        Progress {
            samples: AtomicU64::new(0),
            rays: AtomicU64::new(0),
            total,
            begin,
            next_ms: AtomicU64::new(100),
            events,
        }
    }

    /// Paths done so far.
    pub fn samples(&self) -> u64 {
        self.samples.load(Ordering::Relaxed)
    }

    /// Rays of the paths done so far.
    pub fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }

    /// Adds a finished block.
    pub fn add(&self, block: &Block, rays: u64) {
        let paths = u64::from(block.width) * u64::from(block.height) * u64::from(block.samples);
        let samples_done = self.samples.fetch_add(paths, Ordering::Relaxed) + paths;
        let rays = self.rays.fetch_add(rays, Ordering::Relaxed) + rays;
        let elapsed = self.begin.elapsed();
        let (now, next) = (elapsed.as_millis() as u64, self.next_ms.load(Ordering::Relaxed));
        let is_due = now >= next || samples_done == self.total;
        // One thread wins; the others go on.
        let order = Ordering::Relaxed;
        if is_due && self.next_ms.compare_exchange(next, now + 100, order, order).is_ok() {
            (self.events)(Event::Progress { samples_done, samples_total: self.total, rays, elapsed });
        }
    }
}
