//! Ray intersection: one structure over triangles, quads, analytic shapes and placed geometries, and batched queries on
//! it.
//!
//! obvhs builds a binary tree, which is collapsed to eight children a node at least expected cost and packed into cache
//! lines; [`Accel::closest`] and [`Accel::occluded`] walk it with up to 32 rays in flight, in a loop compiled for
//! the CPU level found at start-up. All levels give the same hits bit for bit, and so do batches of any size.
//!
//! Primitive ids within a geometry: triangles `0..T`, then quads `T..T + Q`, then analytic shapes from
//! `T + Q` on.

mod binary;
mod build;
mod collapse;
mod emit;
mod gather;
mod halves;
mod layout;
mod nearest;
mod normalize;
mod prepare;
mod slot;
mod stream;
#[cfg(test)]
mod tests;
mod validate;

pub use build::{BuildStats, Quality, Reuse};
pub use gather::Dropped;

use crate::math::{DAffine3, Hit, Ray};
use crate::shape::{Analytic, Quad};
use crate::simd::{Level, Line, best_level, dispatch_wide_at};
use slot::ShallowSlot;
use std::cell::RefCell;
use stream::{Any, Closest, Occluded, Output, Stream, Workspace};

/// Shapes in one space.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// Vertices.
    pub positions: Vec<[f32; 3]>,
    /// Triangles by their vertices' indices.
    pub triangles: Vec<[u32; 3]>,
    /// Quads.
    pub quads: Vec<Quad>,
    /// Spheres, disks and what else is no triangle.
    pub analytic: Vec<Analytic>,
}

/// A geometry placed in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AccelInstance {
    /// Which geometry; not 0, which is the world's own.
    pub geometry: u32,
    /// Where it stands.
    pub world_from_object: DAffine3,
}

/// What a structure is built over.
#[derive(Clone, Copy, Debug)]
pub struct AccelInput<'a> {
    /// Shapes by geometry; the first stands in the world as it is.
    pub geometries: &'a [&'a Geometry],
    /// Placed geometries: `Hit::instance` is the index plus 1.
    pub instances: &'a [AccelInstance],
    /// The first of the instances that move: they and the rest are built apart from the world, on top of it.
    pub first_moving: usize,
    /// The first of the geometries that change: they belong to moving instances, and are built after the world.
    pub first_changing: usize,
}

/// How to build.
#[derive(Clone, Copy, Debug, Default)]
pub struct BuildOptions {
    /// Time spent on the tree.
    pub quality: Quality,
}

/// Everything that a ray can hit, immutable.
pub struct Accel {
    lines: Vec<Line>,
    root: u32,
    reach: f32,
    stack_size: usize,
    expected: Vec<build::Tree>,
    stats: BuildStats,
    /// What a later structure may start from.
    parts: build::Parts,
}

thread_local! {
    static WORKSPACE: RefCell<Workspace> = const { RefCell::new(Workspace::new()) };
}

impl Accel {
    /// Builds the structure, in parallel on the current rayon pool. `geometries[0]` stands in the world as it is
    /// (`Hit::instance` is 0 there); the others are only reached through `instances` (`Hit::instance` is the index plus
    /// 1). Whatever no ray can hit is dropped and counted: see [`BuildStats`].
    pub fn build(geometries: &[Geometry], instances: &[AccelInstance], options: &BuildOptions) -> Accel {
        let geometries: Vec<&Geometry> = geometries.iter().collect();
        let (first_moving, first_changing) = (instances.len(), geometries.len());
        let input = AccelInput { geometries: &geometries, instances, first_moving, first_changing };
        build::build(&input, options)
    }

    /// Builds with instances that move apart from those that don't.
    pub fn build_parts(input: &AccelInput, options: &BuildOptions) -> Accel {
        build::build(input, options)
    }

    /// Builds the structure anew but for what is said to be the same as in this one.
    pub fn rebuild(self, reuse: Reuse, input: &AccelInput, options: &BuildOptions) -> Accel {
        build::rebuild(self, reuse, input, options)
    }

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

    fn trace<O: Output>(&self, level: Level, rays: &[Ray], output: O) {
        let &Accel { ref lines, root, reach, .. } = self;
        WORKSPACE.with(|workspace| {
            let Workspace { shallow, deep } = &mut *workspace.borrow_mut();
            if self.stack_size <= ShallowSlot::STACK {
                dispatch_wide_at(level, Stream { lines, root, reach, rays, output, slots: shallow });
            } else {
                dispatch_wide_at(level, Stream { lines, root, reach, rays, output, slots: deep });
            }
        });
    }
}
