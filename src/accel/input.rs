//! What a structure is built over, and how.

use crate::gauge::Gauge;
use crate::math::{DAffine3, TransformKeys};
use crate::shape::{Analytic, CurveSegments, Quad};

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
    /// Pieces of curves.
    pub curves: CurveSegments,
    /// Where vertices are at equal steps of time; none where they don't move.
    pub keys: Vec<Vec<[f32; 3]>>,
}

impl Geometry {
    /// How many primitives there are.
    pub fn primitives(&self) -> usize {
        self.triangles.len() + self.quads.len() + self.analytic.len() + self.curves.len()
    }
}

/// An instance that moves while rays are traced.
#[derive(Clone, Debug)]
pub struct MovingInstance {
    /// Its index.
    pub instance: usize,
    /// Where it stands at equal steps of time.
    pub keys: TransformKeys,
}

/// A geometry placed in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AccelInstance {
    /// Which geometry; not 0, which is the world's own.
    pub geometry: u32,
    /// Where it stands.
    pub world_from_object: DAffine3,
}

/// How good the trees of many primitives are. Rays meet the same primitives at the same distances either way, to the bit: of
/// nearest hits the order in which boxes are visited decides nothing. (The exception are rays through the very border of a
/// triangle that they see edge-on: its distance is then less certain than its box, before which it may seem to lie. None of
/// eight million rays from cameras and surfaces differed, one of 40,000 that were aimed at vertices from all sides did.)
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TreeQuality {
    /// Built soon: where few rays follow.
    Fast,
    /// The fewest steps a ray.
    #[default]
    Full,
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
    /// Those that move while rays are traced; among the moving ones.
    pub moving: &'a [MovingInstance],
    /// How good trees are.
    pub quality: TreeQuality,
    /// Is told how far building is.
    pub gauge: Option<&'a Gauge>,
}

impl AccelInput<'_> {
    /// By geometry: is it the world's, or does an instance use it? Only these are built.
    pub fn used_geometries(&self) -> Vec<bool> {
        let mut used = vec![false; self.geometries.len()];
        let placed = self.instances.iter().map(|instance| instance.geometry as usize);
        for geometry in [0].into_iter().chain(placed) {
            if let Some(used) = used.get_mut(geometry) {
                *used = true;
            }
        }
        used
    }
}

/// How trees are built, and who is told.
#[derive(Clone, Copy)]
pub struct BuildOptions<'a> {
    /// How good they are.
    pub quality: TreeQuality,
    /// Is told how many primitives are done, each twice: where it is cut out and where it is built.
    pub gauge: Option<&'a Gauge>,
}

impl BuildOptions<'_> {
    /// Counts primitives as done.
    pub fn tell(&self, primitives: usize) {
        if let Some(gauge) = self.gauge {
            gauge.add(primitives as u64);
        }
    }
}

/// How much of an earlier structure a new one keeps. What is kept stays in its place in the buffer: the rest is cut off
/// and built behind it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reuse {
    /// Nothing.
    Nothing,
    /// The trees of the geometries before the first changing one, but for the world's.
    Shared,
    /// These and the world with the instances that stand still.
    World,
}
