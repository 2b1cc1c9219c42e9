//! Building an [`Accel`]: a tree for each instanced geometry, then the world's tree over the world's geometry and the static
//! instances, then, if instances move, a top tree over the moving instances and the world's tree.

use super::binary_tree::{self, BinaryTree, Effort, NormalizedSpace, Workspace, median_split};
use super::chunked_build::{self, Threads, TreePart, append, empty_buffer};
use super::input::{
    AccelInput, AccelInstance, BuildOptions, Estimate, Geometry, Primitive, PrimitiveKind, Reuse, TooLarge,
    TreeQuality, collect_primitives, is_valid_position,
};
use super::layout::{BufferFull, DONE, InstanceRecord};
use super::motion::{self, Motions};
use super::traversal::DeepSlot;
use super::wide_tree::{Collapse, ShapeSource, TreeWriter, WIDTH, WrittenTree};
use super::{Accel, BuildMark, BuildStats, BuiltTree, BuiltTrees, EMPTY_TREE, TreeSummary};
use crate::math::{Bounds3, DAffine3, DVec3};
use crate::simd::{Line, reserve_on_huge_pages};
use rayon::prelude::*;
use std::ops::Range;
use std::time::Instant;

/// Maximum number of stack entries for trees of this total depth: all but one child of each node on the path, the bottom entry, a
/// leaf's next packet, three for an instance, and one since the index of the first free entry must be valid.
const fn stack_size(depth: usize) -> usize {
    depth * (WIDTH - 1) + 1 + 1 + 3 + 1
}

/// Maximum depth of a tree; deeper ones are rebuilt by [`median_split`]. Two nested trees (world and instance) of this depth fit the
/// deepest stacks; with a top tree for moving instances there are three nested trees, of two thirds of this depth each.
const MAX_DEPTH: usize = 72;
const _: () = assert!(stack_size(2 * MAX_DEPTH) <= DeepSlot::STACK);

/// Number of primitives above which a geometry is built by all threads together, in chunks.
const MAX_CONCURRENT_SIZE: usize = 1 << 20;

/// Maximum number of threads that build geometries of [`MAX_CONCURRENT_SIZE`] concurrently, each with about 120 MB of temporary
/// memory; more for smaller geometries.
const THREADS_OF_LARGEST: usize = 16;

/// An instance whose transform or geometry is invalid.
#[derive(Clone, Copy)]
struct InvalidInstance;

struct Builder<'a> {
    input: AccelInput<'a>,
    tree: TreeBuilder<'a>,
    lines: Vec<Line>,
    /// Whether `lines` is the reused buffer of an earlier build.
    is_rebuilt: bool,
    stats: BuildStats,
    trees: BuiltTrees,
}

impl Accel {
    /// Builds the structure, in parallel on the current rayon pool. `geometries[0]` is in world space (`Hit::instance` is 0); the
    /// others are placed by `instances` (`Hit::instance` is the index plus 1). Invalid and degenerate primitives are dropped and
    /// counted: see [`BuildStats`].
    ///
    /// # Panics
    /// If the structure takes more than 32 GiB: see [`Accel::try_build`].
    pub fn build(geometries: &[Geometry], instances: &[AccelInstance]) -> Accel {
        let geometries: Vec<&Geometry> = geometries.iter().collect();
        let (first_moving, first_changing) = (instances.len(), geometries.len());
        let quality = TreeQuality::Full;
        let moving = &[];
        let geometries = &geometries[..];
        let input = AccelInput {
            geometries,
            instances,
            first_moving,
            first_changing,
            moving,
            quality,
            counter: None,
        };
        Accel::try_build(&input).expect("a structure that can be addressed")
    }

    /// [`Accel::build`] with all build options; moving instances go to a top tree above the world's.
    ///
    /// # Errors
    /// If the structure takes more than the addressable 32 GiB; nearly always detected before building starts.
    pub fn try_build(input: &AccelInput) -> Result<Accel, TooLarge> {
        let begin = Instant::now();
        Builder::new(input, Vec::new()).finish(Reuse::Nothing, begin)
    }

    /// Rebuilds the structure but for the trees that `reuse` keeps.
    ///
    /// # Errors
    /// As for [`Accel::try_build`].
    pub fn rebuild(self, reuse: Reuse, input: &AccelInput) -> Result<Accel, TooLarge> {
        let begin = Instant::now();
        let Accel { mut lines, mut trees, .. } = self;
        let (mark, kept) = match reuse {
            Reuse::Nothing => (BuildMark::default(), 0..0),
            Reuse::Shared => (trees.shared, 1..input.first_changing),
            Reuse::World => (trees.world, 0..input.first_changing),
        };
        lines.truncate(mark.lines);
        for (geometry, tree) in trees.by_geometry.iter_mut().enumerate() {
            if !kept.contains(&geometry) {
                *tree = None;
            }
        }
        let mut builder = Builder::new(input, lines);
        builder.stats = mark.stats;
        trees.by_geometry.resize(input.geometries.len().max(1), None);
        builder.trees = trees;
        builder.finish(reuse, begin)
    }
}

impl<'a> Builder<'a> {
    fn new(input: &AccelInput<'a>, lines: Vec<Line>) -> Builder<'a> {
        let has_top = input.first_moving < input.instances.len();
        Builder {
            input: *input,
            tree: TreeBuilder {
                options: BuildOptions { quality: input.quality, counter: input.counter },
                // See `MAX_DEPTH`.
                max_depth: if has_top { MAX_DEPTH * 2 / 3 } else { MAX_DEPTH },
            },
            is_rebuilt: lines.capacity() > 0,
            lines,
            stats: BuildStats::default(),
            trees: BuiltTrees {
                by_geometry: vec![None; input.geometries.len().max(1)],
                ..BuiltTrees::default()
            },
        }
    }

    /// Builds all trees that are missing.
    fn finish(self, reuse: Reuse, begin: Instant) -> Result<Accel, TooLarge> {
        let estimate = Estimate::of(&self.input);
        estimate.check()?;
        self.build(reuse, begin).map_err(|BufferFull| TooLarge(estimate))
    }

    fn build(mut self, reuse: Reuse, begin: Instant) -> Result<Accel, BufferFull> {
        let AccelInput { instances, first_moving, first_changing, geometries, .. } = self.input;
        let used = self.input.used_geometries();
        let of = |range: Range<usize>| range.filter(|&g| used[g]).collect::<Vec<usize>>();
        let shared = if reuse < Reuse::Shared { of(1..first_changing) } else { Vec::new() };
        let has_top = first_moving < instances.len();
        let changing = if has_top { of(first_changing..geometries.len()) } else { Vec::new() };
        self.reserve(&shared, &changing, reuse);
        if reuse < Reuse::Shared {
            self.build_shared(&shared)?;
            self.trees.shared = self.mark();
        }
        if reuse < Reuse::World {
            let (placed, records) = self.instance_records(0..first_moving);
            let none = Geometry::default();
            let geometry = geometries.first().copied().unwrap_or(&none);
            self.trees.by_geometry[0] =
                Some(self.append(TreeContents { geometry, placed, records: &records })?);
            self.trees.world = self.mark();
        }
        let world = self.trees.by_geometry[0].unwrap_or(EMPTY_TREE);
        let mut top = None;
        if has_top {
            self.build_shared(&changing)?;
            let (placed, records) = self.instance_records(first_moving..instances.len());
            top = Some(self.top_tree(&world, placed, records)?);
        }
        Ok(self.into_accel(world, top, begin))
    }

    /// Starts the progress counter and reserves the estimated memory, since a growing buffer would be copied. (Pages that are never
    /// written take no memory.)
    fn reserve(&mut self, shared: &[usize], changing: &[usize], reuse: Reuse) {
        let AccelInput { geometries, instances, first_moving, counter, .. } = self.input;
        let world = if reuse < Reuse::World { geometries.get(..1).unwrap_or(&[]) } else { &[] };
        let placed = instances.len() - if reuse < Reuse::World { 0 } else { first_moving };
        let built = || world.iter().chain(shared.iter().chain(changing).map(|&g| &geometries[g]));
        if let Some(counter) = counter {
            let primitives: usize = built().map(|geometry| geometry.primitives()).sum();
            counter.begin(2 * (primitives + placed) as u64);
        }
        let mut estimate = Estimate::default();
        built().for_each(|geometry| estimate.add_geometry(geometry));
        // Plus one for the world's tree in the top tree.
        estimate.add_instances(placed + 1);
        reserve_on_huge_pages(&mut self.lines, estimate.lines());
    }

    fn mark(&self) -> BuildMark {
        BuildMark { lines: self.lines.len(), stats: self.stats }
    }

    /// Builds the trees of instanced geometries: large ones one after another by all threads, runs of small ones concurrently, one
    /// thread each.
    fn build_shared(&mut self, wanted: &[usize]) -> Result<(), BufferFull> {
        let geometries = self.input.geometries;
        let size = |g: &usize| geometries[*g].primitives();
        let total: usize = wanted.iter().map(size).sum();
        // The limit keeps the load balanced; it doesn't change the trees.
        let min_chunked = max_unchunked_size(self.input.quality);
        let largest = (total / (4 * rayon::current_num_threads()))
            .clamp(min_chunked, MAX_CONCURRENT_SIZE.max(min_chunked));
        for run in wanted.chunk_by(|a, b| size(a).max(size(b)) <= largest) {
            let built = match run {
                [one] => vec![self.append_counted(TreeContents::of(geometries[*one]))?],
                run => self.append_concurrently(run)?,
            };
            for (geometry, (built, stats)) in run.iter().zip(built) {
                self.stats.add(&stats);
                self.trees.by_geometry[*geometry] = Some(built);
            }
        }
        self.stats.shared_geometries += wanted.len() as u64;
        Ok(())
    }

    /// Appends the trees of geometries, each built by one thread.
    fn append_concurrently(&mut self, run: &[usize]) -> Result<Vec<(BuiltTree, BuildStats)>, BufferFull> {
        let (geometries, tree) = (self.input.geometries, self.tree);
        let largest = run.iter().map(|g| geometries[*g].primitives()).max().unwrap_or(0);
        let threads = Threads::Pool(THREADS_OF_LARGEST * MAX_CONCURRENT_SIZE / largest.max(1));
        let built = append(run.len(), threads, &mut self.lines, |index, workspace| {
            let mut lines = empty_buffer();
            let contents = TreeContents::of(geometries[run[index]]);
            let result = tree.append(contents, Threads::This(workspace), &mut lines)?;
            Ok(TreePart { root: result.0.tree.root, lines, result })
        })?;
        let moved = |(root, (built, stats)): (u32, (BuiltTree, BuildStats))| {
            (BuiltTree { tree: TreeSummary { root, ..built.tree }, ..built }, stats)
        };
        Ok(built.into_iter().map(moved).collect())
    }

    /// Appends a tree, built by all threads; returns it with the counts of its primitives.
    fn append_counted(&mut self, contents: TreeContents) -> Result<(BuiltTree, BuildStats), BufferFull> {
        self.tree.append(contents, Threads::Pool(usize::MAX), &mut self.lines)
    }

    /// [`Builder::append_counted`], adding the counts to the statistics.
    fn append(&mut self, contents: TreeContents) -> Result<BuiltTree, BufferFull> {
        let (built, stats) = self.append_counted(contents)?;
        self.stats.add(&stats);
        Ok(built)
    }

    /// The records of a range of instances, and their world-space boxes as primitives.
    fn instance_records(&mut self, range: Range<usize>) -> (Vec<Primitive>, Vec<InstanceRecord>) {
        let AccelInput { instances, moving, .. } = self.input;
        let first = range.start;
        let one = |(index, instance): (usize, &AccelInstance)| {
            let keys = motion::keys_of_instance(moving, first + index);
            self.instance_record(instance, keys, (first + index) as u32 + 1)
        };
        let all: Vec<_> = instances[range].par_iter().with_min_len(1024).enumerate().map(one).collect();
        let (mut placed, mut records) = (Vec::new(), Vec::new());
        for (record, bounds) in all.iter().filter_map(|one| one.ok().flatten()) {
            placed.push(Primitive { kind: PrimitiveKind::Instance, id: records.len() as u32, bounds });
            records.push(record);
        }
        self.stats.instances += records.len() as u64;
        self.stats.dropped.instances += all.iter().filter(|one| one.is_err()).count() as u64;
        (placed, records)
    }

    /// The top tree over the world's tree and the moving instances.
    fn top_tree(
        &mut self,
        world: &BuiltTree,
        mut placed: Vec<Primitive>,
        mut records: Vec<InstanceRecord>,
    ) -> Result<BuiltTree, BufferFull> {
        if world.tree.root != DONE {
            let id = records.len() as u32;
            placed.push(Primitive { kind: PrimitiveKind::Instance, id, bounds: world.bounds });
            records.push(InstanceRecord::world(world.tree.root, world.reach()));
        }
        self.append(TreeContents { geometry: &Geometry::default(), placed, records: &records })
    }

    fn into_accel(self, world: BuiltTree, top: Option<BuiltTree>, begin: Instant) -> Accel {
        let Builder { input, mut lines, is_rebuilt, mut stats, trees, .. } = self;
        let shared = || trees.by_geometry.iter().skip(1).flatten();
        let deepest_shared = shared().map(|b| b.tree.depth).max().unwrap_or(0);
        let depth = world.tree.depth + top.map_or(0, |top| top.tree.depth) + deepest_shared;
        let mut expected: Vec<TreeSummary> = top.iter().chain([&world]).map(|b| b.tree).collect();
        expected.extend(shared().map(|b| b.tree));
        // After a first build unused capacity was never written, so it takes no memory, while shrinking would copy. Animated scenes
        // are rebuilt for every frame and keep their capacity.
        if is_rebuilt && top.is_none() && lines.capacity() / 2 > lines.len() {
            lines.shrink_to_fit();
        }
        stats.quality = input.quality;
        stats.bytes = (lines.len() * size_of::<Line>()) as u64;
        stats.build_s = begin.elapsed().as_secs_f64();
        let (root, reach) = top.map_or((world.tree.root, world.reach()), |top| (top.tree.root, top.reach()));
        let bounds = top.map_or(world.bounds, |top| top.bounds);
        let motions = Motions::of(&input);
        let stack_size = stack_size(depth);
        Accel { lines, root, motions, bounds, reach, stack_size, expected, stats, trees }
    }

    /// The record of an instance and its box in world space; `None` if its geometry is empty.
    fn instance_record(
        &self,
        instance: &AccelInstance,
        keys: &[DAffine3],
        number: u32,
    ) -> Result<Option<(InstanceRecord, Bounds3)>, InvalidInstance> {
        let world_from_object = instance.world_from_object;
        let object_from_world = world_from_object.inverse();
        let geometry = instance.geometry as usize;
        let usable = geometry > 0
            && geometry < self.trees.by_geometry.len()
            && world_from_object.is_finite()
            && object_from_world.is_finite()
            && keys.iter().all(DAffine3::is_finite);
        if !usable {
            return Err(InvalidInstance);
        }
        let Some(built) = self.trees.by_geometry[geometry].filter(|built| built.tree.root != DONE) else {
            return Ok(None);
        };
        let record = InstanceRecord {
            object_from_world: InstanceRecord::rows(&object_from_world),
            root: built.tree.root,
            instance: number,
            next: DONE,
            reach: built.reach(),
        };
        let union_at = |bounds: Bounds3, key| bounds.union(world_bounds(&built.bounds, key));
        let bounds = match keys {
            [] => world_bounds(&built.bounds, &world_from_object),
            keys => keys.iter().fold(Bounds3::EMPTY, union_at),
        };
        let fits = record.object_from_world.as_flattened().iter().all(|x| x.is_finite());
        if !(fits && is_valid_position(bounds.min) && is_valid_position(bounds.max)) {
            return Err(InvalidInstance);
        }
        Ok(Some((record, bounds)))
    }
}

/// The world-space bounds of a transformed box, widened by the rounding error of transforming a ray to object space in f32.
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

/// Maximum number of primitives of a tree that is built in one piece rather than in chunks. (Lower for fast trees, whose chunked
/// build is faster even with one thread.)
pub const fn max_unchunked_size(quality: TreeQuality) -> usize {
    match quality {
        TreeQuality::Fast => 1 << 14,
        TreeQuality::Full => 1 << 18,
    }
}

/// The contents of a tree: a geometry and the instances in its space.
pub struct TreeContents<'a> {
    /// Shapes.
    pub geometry: &'a Geometry,
    /// Boxes of the instances; their ids are indices of `records`.
    pub placed: Vec<Primitive>,
    pub records: &'a [InstanceRecord],
}

impl<'a> TreeContents<'a> {
    /// A geometry alone.
    pub fn of(geometry: &'a Geometry) -> TreeContents<'a> {
        TreeContents { geometry, placed: Vec::new(), records: &[] }
    }
}

/// Builds trees.
#[derive(Clone, Copy)]
pub struct TreeBuilder<'a> {
    /// Quality and progress counter.
    pub options: BuildOptions<'a>,
    /// Maximum depth; deeper trees are rebuilt by [`median_split`].
    pub max_depth: usize,
}

impl TreeBuilder<'_> {
    /// Appends a tree to `lines`; returns it and the counts of its primitives.
    pub fn append(
        &self,
        contents: TreeContents,
        threads: Threads,
        lines: &mut Vec<Line>,
    ) -> Result<(BuiltTree, BuildStats), BufferFull> {
        let TreeContents { geometry, placed, records } = contents;
        let all = geometry.primitives() + placed.len();
        let (mut primitives, dropped) = collect_primitives(geometry);
        let mut stats = BuildStats { dropped, ..BuildStats::default() };
        stats.count(geometry, &primitives);
        let counts = (primitives.len(), placed.len());
        primitives.extend(placed);
        self.options.report(2 * (all - primitives.len()));
        if primitives.is_empty() {
            return Ok((EMPTY_TREE, stats));
        }
        let start = lines.len();
        let space = NormalizedSpace::of(&primitives);
        let shapes = ShapeSource { geometry, records };
        let mut written = if primitives.len() > max_unchunked_size(self.options.quality) {
            chunked_build::build(&mut primitives, &space, shapes, (self.options, threads), lines)?
        } else {
            let own = &mut Workspace::default();
            let workspace = if let Threads::This(workspace) = threads { workspace } else { own };
            let binary = binary_tree::build(&primitives, &space, Effort::Most, workspace);
            let written = write_collapsed(&binary, &primitives, shapes, lines)?;
            self.options.report(2 * primitives.len());
            written
        };
        if written.depth > self.max_depth {
            lines.truncate(start);
            written = write_collapsed(&median_split(&primitives), &primitives, shapes, lines)?;
        }
        let WrittenTree { root, depth } = written;
        let tree = TreeSummary { root, depth, primitives: counts.0, instances: counts.1 };
        Ok((BuiltTree { tree, bounds: space.bounds }, stats))
    }
}

/// Collapses a binary tree and appends the wide one.
fn write_collapsed(
    binary: &BinaryTree,
    primitives: &[Primitive],
    shapes: ShapeSource,
    lines: &mut Vec<Line>,
) -> Result<WrittenTree, BufferFull> {
    let collapse = &Collapse::new(binary, primitives, &[]);
    TreeWriter { binary, collapse, primitives, shapes, subtrees: &[] }.write(lines)
}
