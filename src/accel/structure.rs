//! The structure and its queries.

use super::motion::{Motions, Running, Stopped};
use super::parts::{BuildStats, Parts, Tree};
use super::scan::{Scan, ScanAll, ScanWorkspace};
use super::slot::ShallowSlot;
use super::stream::{Any, Closest, Next, Occluded, Output, Stream, Workspace};
use crate::math::{Bounds3, Hit, Ray};
use crate::simd::{Level, Line, best_level, dispatch_wide_at};
use std::cell::RefCell;

/// Everything that a ray can hit, immutable.
pub struct Accel {
    pub(super) lines: Vec<Line>,
    pub(super) root: u32,
    /// Everything in a list, where that is little: then no ray walks the tree.
    pub(super) scan: Option<Scan>,
    /// What moves while rays are traced.
    pub(super) motions: Motions,
    /// Box around everything.
    pub(super) bounds: Bounds3,
    pub(super) reach: f32,
    pub(super) stack_size: usize,
    pub(super) expected: Vec<Tree>,
    pub(super) stats: BuildStats,
    /// What a later structure may start from.
    pub(super) parts: Parts,
}

thread_local! {
    static WORKSPACE: RefCell<Workspace> = const { RefCell::new(Workspace::new()) };
    static SCAN_WORKSPACE: RefCell<ScanWorkspace> = const { RefCell::new(ScanWorkspace::new()) };
}

impl Accel {
    /// Time, memory and what was dropped.
    pub fn stats(&self) -> &BuildStats {
        &self.stats
    }

    /// The nearest hit of each ray with `t_min < t < t_max`; of equally near ones the one with the smallest instance,
    /// then primitive. `t` is in units of the ray's direction. A ray with an infinite or NaN component or a zero
    /// direction hits nothing. Handles `min(rays.len(), hits.len())` rays, best many at a time.
    pub fn closest(&self, rays: &[Ray], hits: &mut [Hit]) {
        self.closest_at(best_level(), rays, hits);
    }

    /// Whether anything is hit with `t_min < t < t_max`. Handles `min(rays.len(), occluded.len())` rays.
    pub fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.occluded_at(best_level(), rays, occluded);
    }

    /// Some hit of each ray with `t_min < t < t_max`, not always the same one: only `prim` and `instance` are to be relied
    /// on. As fast as [`Accel::occluded`].
    pub fn any(&self, rays: &[Ray], hits: &mut [Hit]) {
        let count = rays.len().min(hits.len());
        self.trace(best_level(), &rays[..count], Any(&mut hits[..count]));
    }

    /// [`Accel::closest`] on a CPU level, or on the best available one below it: for tests and measurements.
    pub fn closest_at(&self, level: Level, rays: &[Ray], hits: &mut [Hit]) {
        let count = rays.len().min(hits.len());
        self.trace(level, &rays[..count], Closest(&mut hits[..count]));
    }

    /// [`Accel::occluded`] on a CPU level, or on the best available one below it: for tests and measurements.
    pub fn occluded_at(&self, level: Level, rays: &[Ray], occluded: &mut [bool]) {
        let count = rays.len().min(occluded.len());
        self.trace(level, &rays[..count], Occluded(&mut occluded[..count]));
    }

    /// The nearest hit of one ray: for odd jobs, batches are faster.
    pub fn closest_one(&self, ray: &Ray) -> Hit {
        let mut hit = [Hit::MISS];
        self.closest(std::slice::from_ref(ray), &mut hit);
        hit[0]
    }

    /// Does anything move while rays are traced? The queries without times then hold for the middle of the time, and shapes that
    /// are deformed are missed.
    #[inline(always)]
    pub fn is_moving(&self) -> bool {
        !self.motions.is_empty()
    }

    /// [`Accel::closest`] where things move: each ray at its own time in 0..1.
    pub fn closest_in_time(&self, rays: &[Ray], times: &[f32], hits: &mut [Hit]) {
        let count = rays.len().min(hits.len()).min(times.len());
        self.walk_in_time(&rays[..count], times, Closest(&mut hits[..count]));
    }

    /// [`Accel::closest_one`] at a time, if things move.
    pub fn closest_one_in_time(&self, ray: &Ray, time: f32) -> Hit {
        if !self.is_moving() {
            return self.closest_one(ray);
        }
        let mut hit = [Hit::MISS];
        self.closest_in_time(std::slice::from_ref(ray), &[time], &mut hit);
        hit[0]
    }

    /// The hit of a ray that follows another one in the order of [`Accel::closest`], however many lie in one place; at a time, if
    /// things move. Curves have no such order: of those in one place some are missed.
    pub fn next_one(&self, ray: &Ray, hit: &Hit, time: f32) -> Hit {
        let ray = Ray { t_min: hit.t.next_down(), origin_primitive: hit.into(), ..*ray };
        let mut next = Hit::MISS;
        self.walk_in_time(&[ray], &[time], Next(&mut next));
        next
    }

    /// [`Accel::any`] where things move.
    pub fn any_in_time(&self, rays: &[Ray], times: &[f32], hits: &mut [Hit]) {
        let count = rays.len().min(hits.len()).min(times.len());
        self.walk_in_time(&rays[..count], times, Any(&mut hits[..count]));
    }

    fn walk_in_time<O: Output>(&self, rays: &[Ray], times: &[f32], output: O) {
        let &Accel { ref lines, root, reach, ref motions, .. } = self;
        let clock = Running { times, motions };
        WORKSPACE.with(|workspace| {
            // One depth of stacks for all: less code.
            let slots = &mut workspace.borrow_mut().deep;
            dispatch_wide_at(best_level(), Stream { lines, root, reach, rays, clock, output, slots });
        });
    }

    pub(super) fn trace<O: Output>(&self, level: Level, rays: &[Ray], output: O) {
        match &self.scan {
            Some(scan) => SCAN_WORKSPACE.with(|workspace| {
                let workspace = &mut *workspace.borrow_mut();
                dispatch_wide_at(level, ScanAll { scan, rays, output, workspace });
            }),
            None => self.walk(level, rays, output),
        }
    }

    /// Walks the tree.
    pub(super) fn walk<O: Output>(&self, level: Level, rays: &[Ray], output: O) {
        let (&Accel { ref lines, root, reach, .. }, clock) = (self, Stopped);
        WORKSPACE.with(|workspace| {
            let Workspace { shallow, deep } = &mut *workspace.borrow_mut();
            if self.stack_size <= ShallowSlot::STACK {
                dispatch_wide_at(level, Stream { lines, root, reach, rays, clock, output, slots: shallow });
            } else {
                dispatch_wide_at(level, Stream { lines, root, reach, rays, clock, output, slots: deep });
            }
        });
    }
}
