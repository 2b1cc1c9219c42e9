//! The whole build: each geometry that is reached gets its tree, the world's tree holds the instances too.

use super::binary::{self, Binary, Effort, Workspace};
use super::collapse::{Collapse, WIDTH};
use super::emit::{Emit, Emitted, Shapes};
use super::gather::{Kind, Primitive, gather, is_in_reach};
use super::halves;
use super::input::{AccelInput, AccelInstance, Geometry, Reuse, TreeQuality};
use super::layout::{DONE, InstanceRecord, MAX_LINE};
use super::motion::{self, Motions};
use super::normalize::Space;
use super::parts::{BuildStats, Built, Mark, NOTHING, Parts, Tree};
use super::pieces;
use super::scan::Scan;
use super::slot::DeepSlot;
use super::structure::Accel;
use crate::math::{Bounds3, DAffine3, DVec3};
use crate::simd::Line;
use std::ops::Range;
use std::time::Instant;

/// Stack entries that a ray may need in trees of this many nodes, one below the other: one below everything, all but one
/// child of each node on the way, a leaf's next packet and an instance's three, and one more, since a full stack's first
/// free entry has a number too.
const fn stack_size(depth: usize) -> usize {
    depth * (WIDTH - 1) + 1 + 1 + 3 + 1
}

/// Deeper trees are built anew, in halves: twice this, for the world and what is placed in it, fits the deepest stacks. (Three
/// trees, where something moves, may have two thirds each.)
const MAX_DEPTH: usize = 72;
const _: () = assert!(stack_size(2 * MAX_DEPTH) <= DeepSlot::STACK);

/// More primitives than these are built in pieces. (For fast trees sooner: it is faster even with one thread.)
const fn largest_whole(quality: TreeQuality) -> usize {
    match quality {
        TreeQuality::Fast => 1 << 14,
        TreeQuality::Full => 1 << 18,
    }
}

struct Builder<'a> {
    input: AccelInput<'a>,
    /// Deeper trees are built anew, in halves.
    max_depth: usize,
    lines: Vec<Line>,
    stats: BuildStats,
    parts: Parts,
}

impl Accel {
    /// Builds the structure, in parallel on the current rayon pool. `geometries[0]` stands in the world as it is
    /// (`Hit::instance` is 0 there); the others are only reached through `instances` (`Hit::instance` is the index plus
    /// 1). Whatever no ray can hit is dropped and counted: see [`BuildStats`].
    pub fn build(geometries: &[Geometry], instances: &[AccelInstance]) -> Accel {
        let geometries: Vec<&Geometry> = geometries.iter().collect();
        let (first_moving, first_changing) = (instances.len(), geometries.len());
        let quality = TreeQuality::Full;
        let moving = &[];
        build(&AccelInput {
            geometries: &geometries,
            instances,
            first_moving,
            first_changing,
            moving,
            quality,
            gauge: None,
        })
    }

    /// Builds with instances that move apart from those that don't.
    pub fn build_parts(input: &AccelInput) -> Accel {
        build(input)
    }

    /// Builds the structure anew but for what is said to be the same as in this one.
    pub fn rebuild(self, reuse: Reuse, input: &AccelInput) -> Accel {
        rebuild(self, reuse, input)
    }
}

fn build(input: &AccelInput) -> Accel {
    let begin = Instant::now();
    Builder::new(input, Vec::new()).finish(Reuse::Nothing, begin)
}

fn rebuild(previous: Accel, reuse: Reuse, input: &AccelInput) -> Accel {
    let begin = Instant::now();
    let Accel { mut lines, mut parts, .. } = previous;
    let (mark, kept) = match reuse {
        Reuse::Nothing => (Mark::default(), 0..0),
        Reuse::Shared => (parts.shared, 1..input.first_changing),
        Reuse::World => (parts.world, 0..input.first_changing),
    };
    lines.truncate(mark.lines);
    for (geometry, tree) in parts.trees.iter_mut().enumerate() {
        if !kept.contains(&geometry) {
            *tree = None;
        }
    }
    let mut builder = Builder::new(input, lines);
    builder.stats = mark.stats;
    parts.trees.resize(input.geometries.len().max(1), None);
    builder.parts = parts;
    builder.finish(reuse, begin)
}

impl<'a> Builder<'a> {
    fn new(input: &AccelInput<'a>, lines: Vec<Line>) -> Builder<'a> {
        let is_apart = input.first_moving < input.instances.len();
        Builder {
            input: *input,
            // Two trees may lie one below the other, and a third where something moves.
            max_depth: if is_apart { MAX_DEPTH * 2 / 3 } else { MAX_DEPTH },
            lines,
            stats: BuildStats::default(),
            parts: Parts { trees: vec![None; input.geometries.len().max(1)], ..Parts::default() },
        }
    }

    /// Builds what is not there yet.
    fn finish(mut self, reuse: Reuse, begin: Instant) -> Accel {
        let AccelInput { instances, first_moving, first_changing, geometries, gauge, .. } = self.input;
        if let Some(gauge) = gauge {
            // Each is cut out and built.
            gauge.begin(geometries.iter().map(|g| 2 * g.triangles.len() as u64).sum());
        }
        let used = |g: usize| instances.iter().any(|i| i.geometry as usize == g);
        if reuse < Reuse::Shared {
            for geometry in (1..first_changing).filter(|g| used(*g)) {
                self.share(geometry);
            }
            self.parts.shared = self.mark();
        }
        if reuse < Reuse::World {
            let (placed, records) = self.place_all(0..first_moving);
            self.parts.trees[0] = Some(self.tree(0, placed, &records));
            self.parts.world = self.mark();
        }
        let world = self.parts.trees[0].unwrap_or(NOTHING);
        let mut top = None;
        if first_moving < instances.len() {
            for geometry in (first_changing..self.input.geometries.len()).filter(|g| used(*g)) {
                self.share(geometry);
            }
            let (placed, records) = self.place_all(first_moving..instances.len());
            top = Some(self.top(&world, placed, records));
        }
        self.into_accel(world, top, begin)
    }

    fn mark(&self) -> Mark {
        Mark { lines: self.lines.len(), stats: self.stats }
    }

    /// Builds the tree of a geometry that instances place.
    fn share(&mut self, geometry: usize) {
        let built = self.tree(geometry, Vec::new(), &[]);
        self.parts.trees[geometry] = Some(built);
        self.stats.shared_geometries += 1;
    }

    /// The records of some instances, and what is to be built over them.
    fn place_all(&mut self, range: Range<usize>) -> (Vec<Primitive>, Vec<InstanceRecord>) {
        let (mut placed, mut records) = (Vec::new(), Vec::new());
        for index in range {
            let instance = self.input.instances[index];
            let keys = motion::keys_of(self.input.moving, index);
            if let Some((record, bounds)) = self.place(&instance, keys, index as u32 + 1) {
                placed.push(Primitive { kind: Kind::Instance, id: records.len() as u32, bounds });
                records.push(record);
            }
        }
        self.stats.instances += records.len() as u64;
        (placed, records)
    }

    /// The tree over the world and what moves in it.
    fn top(&mut self, world: &Built, mut placed: Vec<Primitive>, mut records: Vec<InstanceRecord>) -> Built {
        if world.tree.root != DONE {
            let id = records.len() as u32;
            placed.push(Primitive { kind: Kind::Instance, id, bounds: world.bounds });
            records.push(InstanceRecord::world(world.tree.root, world.reach()));
        }
        self.tree_over(&Geometry::default(), placed, &records)
    }

    fn into_accel(self, world: Built, top: Option<Built>, begin: Instant) -> Accel {
        let Builder { input, mut lines, mut stats, parts, .. } = self;
        let shared = || parts.trees.iter().skip(1).flatten();
        let deepest_shared = shared().map(|b| b.tree.depth).max().unwrap_or(0);
        let depth = world.tree.depth + top.map_or(0, |top| top.tree.depth) + deepest_shared;
        let mut expected: Vec<Tree> = top.iter().chain([&world]).map(|b| b.tree).collect();
        expected.extend(shared().map(|b| b.tree));
        // What moves is built again and again: room is kept for it. And shrinking copies: little room is left as it is.
        if top.is_none() && lines.capacity() / 2 > lines.len() {
            lines.shrink_to_fit();
        }
        stats.quality = input.quality;
        stats.bytes = (lines.len() * size_of::<Line>()) as u64;
        stats.build_s = begin.elapsed().as_secs_f64();
        let (root, reach) = top.map_or((world.tree.root, world.reach()), |top| (top.tree.root, top.reach()));
        let bounds = top.map_or(world.bounds, |top| top.bounds);
        let scan = Scan::new(&lines, root);
        let motions = Motions::of(&input);
        let stack_size = stack_size(depth);
        Accel { lines, root, scan, motions, bounds, reach, stack_size, expected, stats, parts }
    }

    /// Builds the tree of a geometry, together with some instances.
    fn tree(&mut self, geometry: usize, placed: Vec<Primitive>, records: &[InstanceRecord]) -> Built {
        let none = Geometry::default();
        let geometry = self.input.geometries.get(geometry).copied().unwrap_or(&none);
        self.tree_over(geometry, placed, records)
    }

    fn tree_over(
        &mut self,
        geometry: &Geometry,
        placed: Vec<Primitive>,
        records: &[InstanceRecord],
    ) -> Built {
        let (mut primitives, dropped) = gather(geometry);
        self.stats.dropped.add(dropped);
        self.stats.count(geometry, &primitives);
        let counts = (primitives.len(), placed.len());
        primitives.extend(placed);
        if primitives.is_empty() {
            return NOTHING;
        }
        let start = self.lines.len();
        let space = Space::of(&primitives);
        let shapes = Shapes { geometry, records };
        let quality = self.input.quality;
        let mut emitted = if primitives.len() > largest_whole(quality) {
            pieces::build(&mut primitives, &space, shapes, &self.input, &mut self.lines)
        } else {
            let workspace = &mut Workspace::default();
            let binary = binary::build(&primitives, &space, Effort::Most, workspace);
            emit_whole(&binary, &primitives, shapes, &mut self.lines)
        };
        if emitted.depth > self.max_depth {
            self.lines.truncate(start);
            emitted = emit_whole(&halves::build(&primitives), &primitives, shapes, &mut self.lines);
        }
        let Emitted { root, depth } = emitted;
        assert!(self.lines.len() <= MAX_LINE, "a scene may have 32 GiB of acceleration structure");
        let tree = Tree { root, depth, primitives: counts.0, instances: counts.1 };
        Built { tree, bounds: space.bounds }
    }

    /// The record of an instance and its box in the world.
    fn place(
        &mut self,
        instance: &AccelInstance,
        keys: &[DAffine3],
        number: u32,
    ) -> Option<(InstanceRecord, Bounds3)> {
        let world_from_object = instance.world_from_object;
        let object_from_world = world_from_object.inverse();
        let geometry = instance.geometry as usize;
        let usable = geometry > 0
            && geometry < self.parts.trees.len()
            && world_from_object.is_finite()
            && object_from_world.is_finite()
            && keys.iter().all(DAffine3::is_finite);
        if !usable {
            self.stats.dropped.instances += 1;
            return None;
        }
        let built = self.parts.trees[geometry]?;
        if built.tree.root == DONE {
            return None;
        }
        let record = InstanceRecord {
            object_from_world: InstanceRecord::rows(&object_from_world),
            root: built.tree.root,
            instance: number,
            next: DONE,
            reach: built.reach(),
        };
        let around = |bounds: Bounds3, key| bounds.union(world_bounds(&built.bounds, key));
        let bounds = match keys {
            [] => world_bounds(&built.bounds, &world_from_object),
            keys => keys.iter().fold(Bounds3::EMPTY, around),
        };
        let fits = record.object_from_world.as_flattened().iter().all(|x| x.is_finite());
        if !(fits && is_in_reach(bounds.min) && is_in_reach(bounds.max)) {
            self.stats.dropped.instances += 1;
            return None;
        }
        Some((record, bounds))
    }
}

/// Appends the wide tree that a binary one becomes.
fn emit_whole(binary: &Binary, primitives: &[Primitive], shapes: Shapes, lines: &mut Vec<Line>) -> Emitted {
    let collapse = &Collapse::new(binary, primitives, &[]);
    Emit { binary, collapse, primitives, shapes, pieces: &[] }.write(lines)
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
