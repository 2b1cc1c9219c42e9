//! The trees that a structure is made of, and what building them took.

use super::gather::{Dropped, Kind, Primitive};
use super::input::{Geometry, TreeQuality};
use super::layout::DONE;
use crate::math::Bounds3;
use crate::scene::ShapeTag;

/// What the build took and made.
#[derive(Clone, Copy, Debug, Default)]
pub struct BuildStats {
    /// Seconds.
    pub build_s: f64,
    /// How good the trees are.
    pub quality: TreeQuality,
    /// Memory of the structure.
    pub bytes: u64,
    /// Triangles in it; shared geometries count once.
    pub triangles: u64,
    /// Quads in it.
    pub quads: u64,
    /// Analytic shapes in it, in the order of [`ShapeTag::ALL`].
    pub analytic: [u64; ShapeTag::ALL.len()],
    /// Pieces of curves in it.
    pub curves: u64,
    /// Instances in it.
    pub instances: u64,
    /// Geometries (other than the world's) that an instance uses: only these are built.
    pub shared_geometries: u64,
    /// What was left out.
    pub dropped: Dropped,
}

impl BuildStats {
    /// Adds what is in a tree.
    pub(super) fn add(&mut self, tree: &BuildStats) {
        self.triangles += tree.triangles;
        self.quads += tree.quads;
        self.analytic.iter_mut().zip(tree.analytic).for_each(|(sum, n)| *sum += n);
        self.curves += tree.curves;
        self.dropped.add(tree.dropped);
    }

    /// Counts the primitives of a geometry, which are in the order of their ids.
    pub(super) fn count(&mut self, geometry: &Geometry, primitives: &[Primitive]) {
        let first_of = |kinds: &[Kind]| primitives.partition_point(|p| kinds.contains(&p.kind));
        let triangles = first_of(&[Kind::Triangle]);
        let flat = first_of(&[Kind::Triangle, Kind::Quad]);
        let analytic = first_of(&[Kind::Triangle, Kind::Quad, Kind::Analytic]);
        self.triangles += triangles as u64;
        self.quads += (flat - triangles) as u64;
        let first = geometry.triangles.len() + geometry.quads.len();
        for primitive in &primitives[flat..analytic] {
            self.analytic[geometry.analytic[primitive.id as usize - first].tag() as usize] += 1;
        }
        self.curves += (primitives.len() - analytic) as u64;
    }
}

/// What a tree must hold, kept for [`Accel::validate`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Tree {
    pub root: u32,
    pub depth: usize,
    pub primitives: usize,
    pub instances: usize,
}

/// A tree and the box around it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Built {
    pub tree: Tree,
    pub bounds: Bounds3,
}

/// The tree over nothing.
pub(super) const NOTHING: Built =
    Built { tree: Tree { root: DONE, depth: 0, primitives: 0, instances: 0 }, bounds: Bounds3::EMPTY };

impl Built {
    /// The largest absolute coordinate.
    pub fn reach(&self) -> f32 {
        self.bounds.min.abs().max(self.bounds.max.abs()).max_element()
    }
}

/// The trees that were built, and how far the buffer went after some of them.
#[derive(Clone, Debug, Default)]
pub(super) struct Parts {
    /// By geometry; none for those that nothing places.
    pub trees: Vec<Option<Built>>,
    /// After the lasting shared geometries.
    pub shared: Mark,
    /// After the world.
    pub world: Mark,
}

/// How far the building of a structure went.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Mark {
    pub lines: usize,
    pub stats: BuildStats,
}
