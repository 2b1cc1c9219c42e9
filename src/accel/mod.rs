//! Ray intersection: one bounding volume hierarchy (BVH) over triangles, quads, analytic shapes, curve segments,
//! Gaussian splats and instances, and batched queries on it.
//!
//! Construction: obvhs builds a binary BVH (`binary_tree.rs`), which is collapsed to an 8-wide BVH of minimum expected cost and
//! written to cache lines (`wide_tree.rs`, `layout.rs`). More primitives than `max_unchunked_size` are split into chunks, whose trees
//! are built in parallel and joined by a top tree (`chunked_build.rs`); `build.rs` does this for each
//! geometry and for the world.
//!
//! Queries: [`Accel::closest`] and [`Accel::occluded`] traverse the BVH with up to 32 rays in flight, compiled for the CPU level
//! detected at start-up (`traversal.rs`). All CPU levels, batch sizes and tree qualities give the same hits bit for bit
//! (but see [`TreeQuality`]).
//!
//! Primitive ids within a geometry: triangles `0..T`, then quads `T..T + Q`, then `A` analytic shapes from
//! `T + Q` on, then curve segments from `T + Q + A` on, then Gaussian splats.
//!
//! A ray accepts a Gaussian splat with a probability equal to the splat's peak opacity along the ray, decided by a hash of ray and
//! splat: in expectation the nearest accepted splat has its weight in sorted alpha compositing (Sun, Georgiev, Fei, Hasan 2025,
//! "Stochastic Ray Tracing of Transparent 3D Gaussians"). The same ray at the same time always accepts the same splats.

mod binary_tree;
mod build;
mod chunked_build;
mod input;
mod inspect;
mod layout;
mod motion;
mod point_visibility;
#[cfg(test)]
mod tests;
mod traversal;
mod wide_tree;

pub use input::{
    AccelInput, AccelInstance, Dropped, Estimate, Geometry, MovingInstance, Reuse, TooLarge, TreeQuality,
    is_valid_position,
};
pub use point_visibility::{PointVisibility, PointVisibilityQuery, SetBits};

use crate::math::{Bounds3, Hit, Ray};
use crate::scene::ShapeKind;
use crate::simd::{Level, Line, best_level, dispatch_wide_at};
use input::{Primitive, PrimitiveKind};
use layout::DONE;
use motion::{Motions, NoMotion, TimeByRay};
use std::cell::RefCell;
use traversal::{AnyHit, AnyOccluder, ClosestHit, NextHit, Output, RayStream, ShallowSlot, Workspace};

/// The acceleration structure over the whole scene, immutable.
pub struct Accel {
    lines: Vec<Line>,
    root: u32,
    /// Motion of instances and vertices during the exposure.
    motions: Motions,
    /// World-space bounding box of the scene, metres.
    bounds: Bounds3,
    /// Largest absolute coordinate, metres.
    reach: f32,
    /// Number of traversal stack entries required.
    stack_size: usize,
    /// Expected contents of each tree, for [`Accel::validate`].
    expected: Vec<TreeSummary>,
    stats: BuildStats,
    /// Trees by geometry, for [`Accel::rebuild`].
    trees: BuiltTrees,
}

thread_local! {
    static WORKSPACE: RefCell<Workspace> = const { RefCell::new(Workspace::new()) };
}

impl Accel {
    /// Time, memory and dropped primitives.
    pub fn stats(&self) -> &BuildStats {
        &self.stats
    }

    /// The nearest hit of each ray with `t_min < t < t_max`; ties go to the smallest instance, then the smallest primitive id. `t` is
    /// in units of the direction's length. A ray with an infinite or NaN component or a zero direction hits nothing. Handles
    /// `min(rays.len(), hits.len())` rays; large batches are fastest.
    pub fn closest(&self, rays: &[Ray], hits: &mut [Hit]) {
        self.closest_at(best_level(), rays, hits);
    }

    /// Whether each ray has a hit with `t_min < t < t_max`. Handles `min(rays.len(), occluded.len())` rays.
    pub fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.occluded_at(best_level(), rays, occluded);
    }

    /// Any hit of each ray with `t_min < t < t_max`: which one is unspecified, and only `prim` and `instance` are valid. As fast as
    /// [`Accel::occluded`].
    pub fn any(&self, rays: &[Ray], hits: &mut [Hit]) {
        let count = rays.len().min(hits.len());
        self.traverse(best_level(), &rays[..count], AnyHit(&mut hits[..count]));
    }

    /// [`Accel::closest`] on a CPU level, or on the best available one below it: for tests and measurements.
    pub fn closest_at(&self, level: Level, rays: &[Ray], hits: &mut [Hit]) {
        let count = rays.len().min(hits.len());
        self.traverse(level, &rays[..count], ClosestHit(&mut hits[..count]));
    }

    /// [`Accel::occluded`] on a CPU level, or on the best available one below it: for tests and measurements.
    pub fn occluded_at(&self, level: Level, rays: &[Ray], occluded: &mut [bool]) {
        let count = rays.len().min(occluded.len());
        self.traverse(level, &rays[..count], AnyOccluder(&mut occluded[..count]));
    }

    /// The nearest hit of a single ray; slower per ray than a batch.
    pub fn closest_one(&self, ray: &Ray) -> Hit {
        let mut hit = [Hit::MISS];
        self.closest(std::slice::from_ref(ray), &mut hit);
        hit[0]
    }

    /// Whether anything moves during the exposure. Queries without times then use the middle of the shutter interval, and miss
    /// deforming meshes.
    #[inline(always)]
    pub fn is_moving(&self) -> bool {
        !self.motions.is_empty()
    }

    /// Whether hits depend on ray times ([`Accel::closest_in_time`]): the scene moves or has splats. In static scenes the time seeds
    /// the acceptance of splats, so that rays equal to the bit accept different splats.
    #[inline(always)]
    pub fn uses_times(&self) -> bool {
        self.is_moving() || self.stats.splats > 0
    }

    /// [`Accel::closest`] with a time for each ray, 0..1 within the shutter interval.
    pub fn closest_in_time(&self, rays: &[Ray], times: &[f32], hits: &mut [Hit]) {
        let count = rays.len().min(hits.len()).min(times.len());
        self.traverse_in_time(&rays[..count], times, ClosestHit(&mut hits[..count]));
    }

    /// [`Accel::closest_one`] at a time, 0..1 within the shutter interval.
    pub fn closest_one_in_time(&self, ray: &Ray, time: f32) -> Hit {
        if !self.uses_times() {
            return self.closest_one(ray);
        }
        let mut hit = [Hit::MISS];
        self.closest_in_time(std::slice::from_ref(ray), &[time], &mut hit);
        hit[0]
    }

    /// The next hit after `hit` in the order of [`Accel::closest`], including coincident hits at the same distance. Curves have no
    /// such order: coincident curves may be missed.
    pub fn closest_after(&self, ray: &Ray, hit: &Hit, time: f32) -> Hit {
        let ray = Ray { t_min: hit.t.next_down(), origin_primitive: hit.into(), ..*ray };
        let mut next = Hit::MISS;
        self.traverse_in_time(&[ray], &[time], NextHit(&mut next));
        next
    }

    /// [`Accel::any`] with a time for each ray.
    pub fn any_in_time(&self, rays: &[Ray], times: &[f32], hits: &mut [Hit]) {
        let count = rays.len().min(hits.len()).min(times.len());
        self.traverse_in_time(&rays[..count], times, AnyHit(&mut hits[..count]));
    }

    fn traverse_in_time<O: Output>(&self, rays: &[Ray], times: &[f32], output: O) {
        let &Accel { ref lines, root, reach, ref motions, .. } = self;
        let times = TimeByRay { times, motions };
        WORKSPACE.with(|workspace| {
            // Only the deep stacks, to compile less code.
            let slots = &mut workspace.borrow_mut().deep;
            dispatch_wide_at(best_level(), RayStream { lines, root, reach, rays, times, output, slots });
        });
    }

    /// Traverses the tree with the smallest sufficient stacks.
    fn traverse<O: Output>(&self, level: Level, rays: &[Ray], output: O) {
        let (&Accel { ref lines, root, reach, .. }, times) = (self, NoMotion);
        WORKSPACE.with(|workspace| {
            let Workspace { shallow, deep } = &mut *workspace.borrow_mut();
            if self.stack_size <= ShallowSlot::STACK {
                dispatch_wide_at(
                    level,
                    RayStream { lines, root, reach, rays, times, output, slots: shallow },
                );
            } else {
                dispatch_wide_at(level, RayStream { lines, root, reach, rays, times, output, slots: deep });
            }
        });
    }
}

/// Statistics of a build.
#[derive(Clone, Copy, Debug, Default)]
pub struct BuildStats {
    /// Time of the build, seconds.
    pub build_s: f64,
    pub quality: TreeQuality,
    /// Memory of the structure, bytes.
    pub bytes: u64,
    /// Triangles; shared geometries count once.
    pub triangles: u64,
    pub quads: u64,
    /// Analytic shapes, in the order of [`ShapeKind::ALL`].
    pub analytic: [u64; ShapeKind::ALL.len()],
    /// Curve segments.
    pub curves: u64,
    /// Gaussian splats.
    pub splats: u64,
    pub instances: u64,
    /// Instanced geometries (without the world's); others are not built.
    pub shared_geometries: u64,
    /// Dropped primitives and instances.
    pub dropped: Dropped,
}

impl BuildStats {
    /// Adds the contents of a tree.
    fn add(&mut self, tree: &BuildStats) {
        self.triangles += tree.triangles;
        self.quads += tree.quads;
        self.analytic.iter_mut().zip(tree.analytic).for_each(|(sum, n)| *sum += n);
        self.curves += tree.curves;
        self.splats += tree.splats;
        self.dropped.add(tree.dropped);
    }

    /// Counts the primitives of a geometry, which are in the order of their ids.
    fn count(&mut self, geometry: &Geometry, primitives: &[Primitive]) {
        let first_of = |kinds: &[PrimitiveKind]| primitives.partition_point(|p| kinds.contains(&p.kind));
        let triangles = first_of(&[PrimitiveKind::Triangle]);
        let flat = first_of(&[PrimitiveKind::Triangle, PrimitiveKind::Quad]);
        let analytic = first_of(&[PrimitiveKind::Triangle, PrimitiveKind::Quad, PrimitiveKind::Analytic]);
        self.triangles += triangles as u64;
        self.quads += (flat - triangles) as u64;
        let first = geometry.triangles.len() + geometry.quads.len();
        for primitive in &primitives[flat..analytic] {
            self.analytic[geometry.analytic[primitive.id as usize - first].kind() as usize] += 1;
        }
        let curves = analytic + primitives[analytic..].partition_point(|p| p.kind == PrimitiveKind::Curve);
        self.curves += (curves - analytic) as u64;
        self.splats += (primitives.len() - curves) as u64;
    }
}

/// Expected contents of a tree, for [`Accel::validate`].
#[derive(Clone, Copy, Debug)]
struct TreeSummary {
    pub root: u32,
    pub depth: usize,
    pub primitives: usize,
    pub instances: usize,
}

/// A tree and its bounds.
#[derive(Clone, Copy, Debug)]
struct BuiltTree {
    pub tree: TreeSummary,
    pub bounds: Bounds3,
}

/// The tree without primitives.
const EMPTY_TREE: BuiltTree = BuiltTree {
    tree: TreeSummary { root: DONE, depth: 0, primitives: 0, instances: 0 },
    bounds: Bounds3::EMPTY,
};

impl BuiltTree {
    /// Largest absolute coordinate, metres.
    pub fn reach(&self) -> f32 {
        self.bounds.min.abs().max(self.bounds.max.abs()).max_element()
    }
}

/// The trees of a structure, and the state of the build at the points where a rebuild may resume.
#[derive(Clone, Debug, Default)]
struct BuiltTrees {
    /// Trees by geometry; `None` for geometries without an instance.
    pub by_geometry: Vec<Option<BuiltTree>>,
    /// After the shared geometries that do not change.
    pub shared: BuildMark,
    /// After the world.
    pub world: BuildMark,
}

/// The length of the buffer and the statistics at a point of the build.
#[derive(Clone, Copy, Debug, Default)]
struct BuildMark {
    pub lines: usize,
    pub stats: BuildStats,
}
