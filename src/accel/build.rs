//! The whole build: each geometry that is reached gets its tree, the world's tree holds the instances too.

use super::binary::{self, Binary};
use super::collapse::{Collapse, WIDTH};
use super::emit::{Emit, Emitted};
use super::gather::{Dropped, Kind, Primitive, gather, is_in_reach};
use super::halves;
use super::layout::{DONE, InstanceRecord, MAX_LINE};
use super::slot::DeepSlot;
use super::{Accel, AccelInstance, BuildOptions, Geometry};
use crate::math::{Bounds3, DAffine3, DVec3};
use crate::shape::Analytic;
use crate::simd::Line;
use std::time::Instant;

/// How much time goes into the tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// For previews: about half the build time, slower rays.
    Fast,
    /// The default.
    #[default]
    Medium,
    /// About ten times the build time for rays 5 to 15 % faster.
    High,
}

/// What the build took and made.
#[derive(Clone, Copy, Debug, Default)]
pub struct BuildStats {
    /// Seconds.
    pub build_s: f64,
    /// Memory of the structure.
    pub bytes: u64,
    /// Triangles in it; shared geometries count once.
    pub triangles: u64,
    /// Quads in it.
    pub quads: u64,
    /// Analytic shapes in it, in the order of [`Analytic::NAMES`].
    pub analytic: [u64; Analytic::NAMES.len()],
    /// Instances in it.
    pub instances: u64,
    /// Geometries (other than the world's) that an instance uses: only these are built.
    pub shared_geometries: u64,
    /// What was left out.
    pub dropped: Dropped,
}

impl BuildStats {
    fn count(&mut self, geometry: &Geometry, primitives: &[Primitive]) {
        let first = geometry.triangles.len() + geometry.quads.len();
        for primitive in primitives {
            match primitive.kind {
                Kind::Triangle => self.triangles += 1,
                Kind::Quad => self.quads += 1,
                Kind::Analytic => {
                    self.analytic[geometry.analytic[primitive.id as usize - first].kind_index()] += 1;
                }
                Kind::Instance => {}
            }
        }
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

const EMPTY: Tree = Tree { root: DONE, depth: 0, primitives: 0, instances: 0 };

/// A tree and the box around it.
struct Built {
    tree: Tree,
    bounds: Bounds3,
}

impl Built {
    /// The largest absolute coordinate.
    fn reach(&self) -> f32 {
        self.bounds.min.abs().max(self.bounds.max.abs()).max_element()
    }
}

/// Stack entries that a ray may need in trees of this many nodes, one below the other: one below everything, all but one
/// child of each node on the way, a leaf's next packet and an instance's three, and one more, since a full stack's first
/// free entry has a number too.
const fn stack_size(depth: usize) -> usize {
    depth * (WIDTH - 1) + 1 + 1 + 3 + 1
}

/// Deeper trees are built anew, in halves: twice this, for the world and what is placed in it, fits the deepest stacks.
const MAX_DEPTH: usize = 72;
const _: () = assert!(stack_size(2 * MAX_DEPTH) <= DeepSlot::STACK);

struct Builder<'a> {
    geometries: &'a [Geometry],
    quality: Quality,
    lines: Vec<Line>,
    stats: BuildStats,
}

pub(super) fn build(geometries: &[Geometry], instances: &[AccelInstance], options: &BuildOptions) -> Accel {
    let begin = Instant::now();
    let mut builder =
        Builder { geometries, quality: options.quality, lines: Vec::new(), stats: BuildStats::default() };
    let mut shared: Vec<Option<Built>> = geometries.iter().map(|_| None).collect();
    let mut placed = Vec::new();
    let mut records = Vec::new();
    for (index, instance) in instances.iter().enumerate() {
        let record = builder.place(instance, index as u32 + 1, &mut shared);
        if let Some((record, bounds)) = record {
            placed.push(Primitive { kind: Kind::Instance, id: records.len() as u32, bounds });
            records.push(record);
        }
    }
    let world = builder.tree(0, placed, &records);
    let deepest_shared = shared.iter().flatten().map(|b| b.tree.depth).max().unwrap_or(0);
    let stack_size = stack_size(world.tree.depth + deepest_shared);
    let mut expected = vec![world.tree];
    expected.extend(shared.iter().flatten().map(|b| b.tree));
    let Builder { mut lines, mut stats, .. } = builder;
    lines.shrink_to_fit();
    stats.instances = records.len() as u64;
    stats.shared_geometries = expected.len() as u64 - 1;
    stats.bytes = (lines.len() * size_of::<Line>()) as u64;
    stats.build_s = begin.elapsed().as_secs_f64();
    Accel { lines, root: world.tree.root, reach: world.reach(), stack_size, expected, stats }
}

impl Builder<'_> {
    /// Builds the tree of a geometry, together with some instances.
    fn tree(&mut self, geometry: usize, placed: Vec<Primitive>, records: &[InstanceRecord]) -> Built {
        let none = Geometry::default();
        let geometry = self.geometries.get(geometry).unwrap_or(&none);
        let (mut primitives, dropped) = gather(geometry);
        self.stats.dropped.add(dropped);
        self.stats.count(geometry, &primitives);
        let counts = (primitives.len(), placed.len());
        primitives.extend(placed);
        if primitives.is_empty() {
            return Built { tree: EMPTY, bounds: Bounds3::EMPTY };
        }
        let start = self.lines.len();
        let mut binary = binary::build(&primitives, self.quality);
        let mut emitted = self.emit(&binary, &primitives, geometry, records);
        if emitted.depth > MAX_DEPTH {
            self.lines.truncate(start);
            binary = halves::build(&primitives);
            emitted = self.emit(&binary, &primitives, geometry, records);
        }
        let Emitted { root, depth } = emitted;
        assert!(self.lines.len() <= MAX_LINE, "a scene may have 32 GiB of acceleration structure");
        let tree = Tree { root, depth, primitives: counts.0, instances: counts.1 };
        Built { tree, bounds: binary.bounds[0] }
    }

    fn emit(
        &mut self,
        binary: &Binary,
        primitives: &[Primitive],
        geometry: &Geometry,
        instances: &[InstanceRecord],
    ) -> Emitted {
        let collapse = &Collapse::new(binary, primitives);
        Emit { binary, collapse, primitives, geometry, instances }.write(&mut self.lines)
    }

    /// The record of an instance and its box in the world; builds its geometry if it is the first to use it.
    fn place(
        &mut self,
        instance: &AccelInstance,
        number: u32,
        shared: &mut [Option<Built>],
    ) -> Option<(InstanceRecord, Bounds3)> {
        let world_from_object = instance.world_from_object;
        let object_from_world = world_from_object.inverse();
        let geometry = instance.geometry as usize;
        let usable = geometry > 0
            && geometry < shared.len()
            && world_from_object.is_finite()
            && object_from_world.is_finite();
        if !usable {
            self.stats.dropped.instances += 1;
            return None;
        }
        if shared[geometry].is_none() {
            shared[geometry] = Some(self.tree(geometry, Vec::new(), &[]));
        }
        let built = shared[geometry].as_ref()?;
        if built.tree.root == DONE {
            return None;
        }
        let m = object_from_world;
        let row = |k: usize| {
            [m.matrix3.x_axis[k], m.matrix3.y_axis[k], m.matrix3.z_axis[k], m.translation[k]]
                .map(|x| x as f32)
        };
        let record = InstanceRecord {
            object_from_world: [row(0), row(1), row(2)],
            root: built.tree.root,
            instance: number,
            next: DONE,
            reach: built.reach(),
        };
        let bounds = world_bounds(&built.bounds, &world_from_object);
        let fits = record.object_from_world.as_flattened().iter().all(|x| x.is_finite());
        if !(fits && is_in_reach(bounds.min) && is_in_reach(bounds.max)) {
            self.stats.dropped.instances += 1;
            return None;
        }
        Some((record, bounds))
    }
}

/// A box around a transformed one, widened by what transforming a ray to object space in f32 may move it: a few roundings
/// of the coordinates involved.
fn world_bounds(bounds: &Bounds3, world_from_object: &DAffine3) -> Bounds3 {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for corner in bounds.corners() {
        let p = world_from_object.transform_point3(corner.as_dvec3());
        min = min.min(p);
        max = max.max(p);
    }
    let largest = min.abs().max(max.abs()).max_element();
    let slack = DVec3::splat(largest / f64::from(1u32 << 20));
    Bounds3 { min: (min - slack).as_vec3(), max: (max + slack).as_vec3() }
}
