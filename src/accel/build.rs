//! The whole build: each geometry that is reached gets its tree, the world's tree holds the instances too.

use super::append::{Full, Part, Threads, append, empty_buffer};
use super::collapse::WIDTH;
use super::estimate::{Estimate, TooLarge};
use super::gather::{Kind, Primitive, is_in_reach};
use super::input::{AccelInput, AccelInstance, BuildOptions, Geometry, Reuse, TreeQuality};
use super::layout::{DONE, InstanceRecord};
use super::motion::{self, Motions};
use super::parts::{BuildStats, Built, Mark, NOTHING, Parts, Tree};
use super::scan::Scan;
use super::slot::DeepSlot;
use super::structure::Accel;
use super::tree::{Contents, TreeBuilder, largest_whole};
use crate::math::{Bounds3, DAffine3, DVec3};
use crate::simd::{Line, reserve_lines};
use rayon::prelude::*;
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

/// Geometries of more primitives than these are built by all threads together, in pieces.
const LARGEST_BESIDE: usize = 1 << 20;

/// So many threads may build geometries of the largest size side by side, of which each takes some 120 MB for the time; of
/// smaller ones more. The others help these.
const THREADS_OF_LARGEST: usize = 16;

/// An instance that can't be placed.
#[derive(Clone, Copy)]
struct Unusable;

struct Builder<'a> {
    input: AccelInput<'a>,
    tree: TreeBuilder<'a>,
    lines: Vec<Line>,
    stats: BuildStats,
    parts: Parts,
}

impl Accel {
    /// Builds the structure, in parallel on the current rayon pool. `geometries[0]` stands in the world as it is
    /// (`Hit::instance` is 0 there); the others are only reached through `instances` (`Hit::instance` is the index plus
    /// 1). Whatever no ray can hit is dropped and counted: see [`BuildStats`].
    ///
    /// # Panics
    /// If it takes more than 32 GiB: see [`Accel::build_parts`].
    pub fn build(geometries: &[Geometry], instances: &[AccelInstance]) -> Accel {
        let geometries: Vec<&Geometry> = geometries.iter().collect();
        let (first_moving, first_changing) = (instances.len(), geometries.len());
        let quality = TreeQuality::Full;
        let moving = &[];
        let geometries = &geometries[..];
        let input =
            AccelInput { geometries, instances, first_moving, first_changing, moving, quality, gauge: None };
        Accel::build_parts(&input).expect("a structure that can be addressed")
    }

    /// Builds with instances that move apart from those that don't.
    ///
    /// # Errors
    /// If it takes more memory than can be addressed, 32 GiB; nearly always before any work.
    pub fn build_parts(input: &AccelInput) -> Result<Accel, TooLarge> {
        let begin = Instant::now();
        Builder::new(input, Vec::new()).finish(Reuse::Nothing, begin)
    }

    /// Builds the structure anew but for what is said to be the same as in this one.
    ///
    /// # Errors
    /// As for [`Accel::build_parts`].
    pub fn rebuild(self, reuse: Reuse, input: &AccelInput) -> Result<Accel, TooLarge> {
        let begin = Instant::now();
        let Accel { mut lines, mut parts, .. } = self;
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
}

impl<'a> Builder<'a> {
    fn new(input: &AccelInput<'a>, lines: Vec<Line>) -> Builder<'a> {
        let is_apart = input.first_moving < input.instances.len();
        Builder {
            input: *input,
            tree: TreeBuilder {
                options: BuildOptions { quality: input.quality, gauge: input.gauge },
                // Two trees may lie one below the other, and a third where something moves.
                max_depth: if is_apart { MAX_DEPTH * 2 / 3 } else { MAX_DEPTH },
            },
            lines,
            stats: BuildStats::default(),
            parts: Parts { trees: vec![None; input.geometries.len().max(1)], ..Parts::default() },
        }
    }

    /// Builds what is not there yet.
    fn finish(self, reuse: Reuse, begin: Instant) -> Result<Accel, TooLarge> {
        let estimate = Estimate::of(&self.input);
        estimate.check()?;
        self.build(reuse, begin).map_err(|Full| TooLarge(estimate))
    }

    fn build(mut self, reuse: Reuse, begin: Instant) -> Result<Accel, Full> {
        let AccelInput { instances, first_moving, first_changing, geometries, .. } = self.input;
        let used = self.input.used_geometries();
        let of = |range: Range<usize>| range.filter(|&g| used[g]).collect::<Vec<usize>>();
        let shared = if reuse < Reuse::Shared { of(1..first_changing) } else { Vec::new() };
        let has_top = first_moving < instances.len();
        let changing = if has_top { of(first_changing..geometries.len()) } else { Vec::new() };
        self.expect(&shared, &changing, reuse);
        if reuse < Reuse::Shared {
            self.share(&shared)?;
            self.parts.shared = self.mark();
        }
        if reuse < Reuse::World {
            let (placed, records) = self.place_all(0..first_moving);
            let none = Geometry::default();
            let geometry = geometries.first().copied().unwrap_or(&none);
            self.parts.trees[0] = Some(self.append(Contents { geometry, placed, records: &records })?);
            self.parts.world = self.mark();
        }
        let world = self.parts.trees[0].unwrap_or(NOTHING);
        let mut top = None;
        if has_top {
            self.share(&changing)?;
            let (placed, records) = self.place_all(first_moving..instances.len());
            top = Some(self.top(&world, placed, records)?);
        }
        Ok(self.into_accel(world, top, begin))
    }

    /// Says how much there is to do, and makes room for it: a buffer that grows is there twice for a moment. (What is not
    /// written to takes no memory.)
    fn expect(&mut self, shared: &[usize], changing: &[usize], reuse: Reuse) {
        let AccelInput { geometries, instances, first_moving, gauge, .. } = self.input;
        let world = if reuse < Reuse::World { geometries.get(..1).unwrap_or(&[]) } else { &[] };
        let placed = instances.len() - if reuse < Reuse::World { 0 } else { first_moving };
        let built = || world.iter().chain(shared.iter().chain(changing).map(|&g| &geometries[g]));
        if let Some(gauge) = gauge {
            let primitives: usize = built().map(|geometry| geometry.primitives()).sum();
            gauge.begin(2 * (primitives + placed) as u64);
        }
        let mut estimate = Estimate::default();
        built().for_each(|geometry| estimate.add_geometry(geometry));
        // With that of the world, where something moves.
        estimate.add_instances(placed + 1);
        reserve_lines(&mut self.lines, estimate.lines());
    }

    fn mark(&self) -> Mark {
        Mark { lines: self.lines.len(), stats: self.stats }
    }

    /// Builds the trees of geometries that instances place: those that are large with all threads, one after another, those
    /// between them side by side.
    fn share(&mut self, wanted: &[usize]) -> Result<(), Full> {
        let geometries = self.input.geometries;
        let size = |g: &usize| geometries[*g].primitives();
        let total: usize = wanted.iter().map(size).sum();
        // One of many threads should not be the last for long. (Trees are the same either way.)
        let whole = largest_whole(self.input.quality);
        let largest = (total / (4 * rayon::current_num_threads())).clamp(whole, LARGEST_BESIDE.max(whole));
        for run in wanted.chunk_by(|a, b| size(a).max(size(b)) <= largest) {
            let built = match run {
                [one] => vec![self.append_counted(Contents::of(geometries[*one]))?],
                run => self.append_beside(run)?,
            };
            for (geometry, (built, stats)) in run.iter().zip(built) {
                self.stats.add(&stats);
                self.parts.trees[*geometry] = Some(built);
            }
        }
        self.stats.shared_geometries += wanted.len() as u64;
        Ok(())
    }

    /// Appends the trees of some geometries, each built by one thread.
    fn append_beside(&mut self, run: &[usize]) -> Result<Vec<(Built, BuildStats)>, Full> {
        let (geometries, tree) = (self.input.geometries, self.tree);
        let largest = run.iter().map(|g| geometries[*g].primitives()).max().unwrap_or(0);
        let threads = Threads::Pool(THREADS_OF_LARGEST * LARGEST_BESIDE / largest.max(1));
        let built = append(run.len(), threads, &mut self.lines, |index, workspace| {
            let mut lines = empty_buffer();
            let contents = Contents::of(geometries[run[index]]);
            let what = tree.append(contents, Threads::This(workspace), &mut lines)?;
            Ok(Part { root: what.0.tree.root, lines, what })
        })?;
        let moved = |(root, (built, stats)): (u32, (Built, BuildStats))| {
            (Built { tree: Tree { root, ..built.tree }, ..built }, stats)
        };
        Ok(built.into_iter().map(moved).collect())
    }

    /// Appends a tree, built by all threads.
    fn append_counted(&mut self, contents: Contents) -> Result<(Built, BuildStats), Full> {
        self.tree.append(contents, Threads::Pool(usize::MAX), &mut self.lines)
    }

    /// The same, and counts what is in it.
    fn append(&mut self, contents: Contents) -> Result<Built, Full> {
        let (built, stats) = self.append_counted(contents)?;
        self.stats.add(&stats);
        Ok(built)
    }

    /// The records of some instances, and what is to be built over them.
    fn place_all(&mut self, range: Range<usize>) -> (Vec<Primitive>, Vec<InstanceRecord>) {
        let AccelInput { instances, moving, .. } = self.input;
        let first = range.start;
        let one = |(index, instance): (usize, &AccelInstance)| {
            let keys = motion::keys_of(moving, first + index);
            self.place(instance, keys, (first + index) as u32 + 1)
        };
        let all: Vec<_> = instances[range].par_iter().with_min_len(1024).enumerate().map(one).collect();
        let (mut placed, mut records) = (Vec::new(), Vec::new());
        for (record, bounds) in all.iter().filter_map(|one| one.ok().flatten()) {
            placed.push(Primitive { kind: Kind::Instance, id: records.len() as u32, bounds });
            records.push(record);
        }
        self.stats.instances += records.len() as u64;
        self.stats.dropped.instances += all.iter().filter(|one| one.is_err()).count() as u64;
        (placed, records)
    }

    /// The tree over the world and what moves in it.
    fn top(
        &mut self,
        world: &Built,
        mut placed: Vec<Primitive>,
        mut records: Vec<InstanceRecord>,
    ) -> Result<Built, Full> {
        if world.tree.root != DONE {
            let id = records.len() as u32;
            placed.push(Primitive { kind: Kind::Instance, id, bounds: world.bounds });
            records.push(InstanceRecord::world(world.tree.root, world.reach()));
        }
        self.append(Contents { geometry: &Geometry::default(), placed, records: &records })
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

    /// The record of an instance and its box in the world; nothing where there is nothing to hit in it.
    fn place(
        &self,
        instance: &AccelInstance,
        keys: &[DAffine3],
        number: u32,
    ) -> Result<Option<(InstanceRecord, Bounds3)>, Unusable> {
        let world_from_object = instance.world_from_object;
        let object_from_world = world_from_object.inverse();
        let geometry = instance.geometry as usize;
        let usable = geometry > 0
            && geometry < self.parts.trees.len()
            && world_from_object.is_finite()
            && object_from_world.is_finite()
            && keys.iter().all(DAffine3::is_finite);
        if !usable {
            return Err(Unusable);
        }
        let Some(built) = self.parts.trees[geometry].filter(|built| built.tree.root != DONE) else {
            return Ok(None);
        };
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
            return Err(Unusable);
        }
        Ok(Some((record, bounds)))
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
