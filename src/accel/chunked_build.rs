//! BVHs of many primitives, built in parallel.
//!
//! [`build`] splits the primitives into chunks by the binned surface area heuristic (Wald 2007, "On fast Construction of SAH-based
//! Bounding Volume Hierarchies"), builds a tree over each chunk and joins these by a small top tree. Each thread works on one
//! chunk at a time, which fits its caches. Peak memory per primitive: 32 bytes for the boxes, 66 to 78 for the tree, and with two
//! threads 15 of temporary memory at 2 million triangles, 1.5 at 20 million. Measurements and rejected alternatives: README of
//! `tools/rays`.
//!
//! [`append`] builds trees in buffers of their own by several threads and appends these to one buffer in an order that doesn't
//! depend on the number of threads. A lock is held only while ranges of lines are assigned; relocation of references and copying
//! happen outside the lock, so that the page faults of the buffer are spread over the threads as well.

use super::binary_tree::{self, Effort, NormalizedSpace, Workspace};
use super::input::{BuildOptions, Estimate, Geometry, Primitive, PrimitiveKind, TreeQuality};
use super::layout::{
    AnalyticPacket, BufferFull, DONE, InstanceRecord, KIND_ANALYTIC, KIND_INSTANCE, LEAF, MAX_LINE, Node,
    TrianglePacket, kind_of, line_of, view_mut,
};
use super::wide_tree::{Collapse, ShapeSource, Subtree, TreeWriter, WrittenTree};
use crate::math::{Bounds3, Vec3};
use crate::shape::triangle::LANES;
use crate::simd::{Claim, Claims, Line, append_claims, reserve_on_huge_pages};
use crate::work_counter::WorkCounter;
use glam::Vec3A;
use obvhs::aabb::Aabb;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Number of bins along the longest axis.
const BINS: usize = 32;
/// Number of primitives above which several threads work on one split.
const PARALLEL: usize = 1 << 16;
/// Depth from which primitives are split in half instead of by the heuristic.
const MAX_SAH_DEPTH: u32 = 40;

/// Reorders primitives into chunks of at most `limit` and returns their ranges. `counter` counts the primitives of finished chunks.
fn split_into_chunks(
    primitives: &mut [Primitive],
    space: &NormalizedSpace,
    limit: usize,
    counter: Option<&WorkCounter>,
) -> Vec<Range<usize>> {
    let mut chunks = Vec::new();
    let mut start = 0;
    for size in chunk_sizes(primitives, space, (limit, counter), 0) {
        chunks.push(start..start + size);
        start += size;
    }
    chunks
}

/// Reorders primitives into chunks by recursive splits and returns the chunk sizes in order.
fn chunk_sizes(
    primitives: &mut [Primitive],
    space: &NormalizedSpace,
    (limit, counter): (usize, Option<&WorkCounter>),
    depth: u32,
) -> Vec<usize> {
    if primitives.len() <= limit {
        if let Some(counter) = counter {
            counter.add(primitives.len() as u64);
        }
        return vec![primitives.len()];
    }
    // Near the root there are fewer tasks than threads.
    let has_idle_threads = 1 << depth < rayon::current_num_threads();
    let middle =
        if depth < MAX_SAH_DEPTH { split(primitives, space, has_idle_threads) } else { primitives.len() / 2 };
    let (left, right) = primitives.split_at_mut(middle);
    let (mut sizes, more) = rayon::join(
        || chunk_sizes(left, space, (limit, counter), depth + 1),
        || chunk_sizes(right, space, (limit, counter), depth + 1),
    );
    sizes.extend(more);
    sizes
}

/// Centroid of a primitive's box in the unit cube.
#[inline(always)]
fn center(primitive: &Primitive, space: &NormalizedSpace) -> Vec3 {
    space.map(primitive.bounds.center())
}

/// Number and bounds of the primitives in a bin.
#[derive(Clone, Copy)]
struct Bin {
    count: usize,
    bounds: Aabb,
}

impl Bin {
    const EMPTY: Bin = Bin { count: 0, bounds: Aabb::INVALID };

    #[inline(always)]
    fn add(&mut self, count: usize, bounds: &Aabb) {
        self.count += count;
        self.bounds = self.bounds.union(bounds);
    }

    /// Surface area times number of primitives: the SAH cost up to a factor. (In f64: areas go up to 1e37.)
    fn cost(&self) -> f64 {
        if self.count == 0 {
            return 0.0;
        }
        let extent = Vec3::from(self.bounds.diagonal().to_array()).as_dvec3();
        (extent.x * (extent.y + extent.z) + extent.y * extent.z) * self.count as f64
    }
}

/// Maps centroids to bins along an axis.
struct Axis {
    axis: usize,
    low: f32,
    scale: f32,
}

impl Axis {
    /// The longest axis of the box around all centroids; `None` if they coincide.
    fn longest(primitives: &[Primitive], space: &NormalizedSpace) -> Option<Axis> {
        let of_slice = |slice: &[Primitive]| {
            slice.iter().fold(Aabb::INVALID, |all, p| {
                let center = Vec3A::from(center(p, space));
                Aabb { min: all.min.min(center), max: all.max.max(center) }
            })
        };
        let centers =
            primitives.par_chunks(PARALLEL).map(of_slice).reduce(|| Aabb::INVALID, |a, b| a.union(&b));
        let extent = centers.diagonal();
        let axis = extent.max_position();
        let scale = BINS as f32 / extent[axis];
        scale.is_finite().then(|| Axis { axis, low: centers.min[axis], scale })
    }

    #[inline(always)]
    fn bin(&self, center: Vec3) -> usize {
        (((center[self.axis] - self.low) * self.scale) as usize).min(BINS - 1)
    }
}

/// Splits primitives in two by the binned SAH: reorders them and returns the size of the first part.
fn split(primitives: &mut [Primitive], space: &NormalizedSpace, has_idle_threads: bool) -> usize {
    let half = primitives.len() / 2;
    let Some(axis) = Axis::longest(primitives, space) else { return half };
    let of_slice = |slice: &[Primitive]| {
        let mut bins = [Bin::EMPTY; BINS];
        for p in slice {
            let bounds = Aabb::new(p.bounds.min.into(), p.bounds.max.into());
            bins[axis.bin(center(p, space))].add(1, &bounds);
        }
        bins
    };
    let sum = |mut a: [Bin; BINS], b: [Bin; BINS]| {
        a.iter_mut().zip(&b).for_each(|(a, b)| a.add(b.count, &b.bounds));
        a
    };
    let bins = primitives.par_chunks(PARALLEL).map(of_slice).reduce(|| [Bin::EMPTY; BINS], sum);
    let first = best_split(&bins);
    let is_first = |p: &Primitive| axis.bin(center(p, space)) < first;
    let middle = if has_idle_threads {
        partition(primitives, is_first)
    } else {
        partition_sequential(primitives, is_first)
    };
    match middle {
        middle if middle > 0 && middle < primitives.len() => middle,
        _ => half,
    }
}

/// The split of minimum cost, as the first bin of its right side.
fn best_split(bins: &[Bin; BINS]) -> usize {
    let mut right = [0.0; BINS];
    let mut all = Bin::EMPTY;
    for i in (1..BINS).rev() {
        all.add(bins[i].count, &bins[i].bounds);
        right[i] = all.cost();
    }
    let (mut best, mut least) = (BINS / 2, f64::INFINITY);
    let mut left = Bin::EMPTY;
    for i in 1..BINS {
        left.add(bins[i - 1].count, &bins[i - 1].bounds);
        let cost = left.cost() + right[i];
        if cost < least {
            (best, least) = (i, cost);
        }
    }
    best
}

/// Moves primitives for which `is_first` to the front and returns their number: swaps from both ends (Hoare).
fn partition_sequential(primitives: &mut [Primitive], is_first: impl Fn(&Primitive) -> bool) -> usize {
    let (mut low, mut high) = (0, primitives.len());
    loop {
        while low < high && is_first(&primitives[low]) {
            low += 1;
        }
        while low < high && !is_first(&primitives[high - 1]) {
            high -= 1;
        }
        if low >= high {
            return low;
        }
        primitives.swap(low, high - 1);
        low += 1;
        high -= 1;
    }
}

/// [`partition_sequential`] by all threads, with the same order of the result.
fn partition(primitives: &mut [Primitive], is_first: impl Fn(&Primitive) -> bool + Sync) -> usize {
    if primitives.len() <= PARALLEL {
        return partition_sequential(primitives, is_first);
    }
    let count = |slice: &[Primitive]| slice.iter().filter(|p| is_first(p)).count();
    let middle = primitives.par_chunks(PARALLEL).map(count).sum();
    let (front, back) = primitives.split_at_mut(middle);
    let mut to_back: Vec<usize> =
        front.par_chunks(PARALLEL).map(|slice| slice.len() - count(slice)).collect();
    prefix_sums(&mut to_back);
    let mut to_front: Vec<usize> = back.par_rchunks(PARALLEL).map(count).collect();
    prefix_sums(&mut to_front);
    // Misplaced primitives of the front are swapped, in order, with those of the back from its end. For each chunk of the front: the
    // length of the suffix of the back with as many misplaced primitives as all chunks up to this one.
    let ends: Vec<usize> = to_back.par_iter().map(|&n| suffix_with(back, n, &to_front, &is_first)).collect();
    let (mut jobs, mut rest, mut taken) = (Vec::with_capacity(ends.len()), back, 0);
    for (chunk, end) in front.chunks_mut(PARALLEL).zip(ends) {
        let (before, own) = rest.split_at_mut(rest.len() - (end - taken));
        jobs.push((chunk, own));
        (rest, taken) = (before, end);
    }
    jobs.into_par_iter().for_each(|(chunk, others)| {
        let mut others = others.iter_mut().rev().filter(|p| is_first(p));
        for own in chunk.iter_mut().filter(|p| !is_first(p)) {
            if let Some(other) = others.next() {
                std::mem::swap(own, other);
            }
        }
    });
    middle
}

/// Inclusive prefix sums.
fn prefix_sums(numbers: &mut [usize]) {
    let mut sum = 0;
    for number in numbers {
        sum += *number;
        *number = sum;
    }
}

/// Length of the shortest suffix of a list with `wanted` primitives that satisfy `is_first`. `sums[i]`: number of these primitives in
/// the last i + 1 chunks.
fn suffix_with(
    list: &[Primitive],
    wanted: usize,
    sums: &[usize],
    is_first: impl Fn(&Primitive) -> bool,
) -> usize {
    let chunks = sums.partition_point(|&sum| sum < wanted);
    let before = chunks.checked_sub(1).map_or(0, |last| sums[last]);
    let skipped = (chunks * PARALLEL).min(list.len());
    let rest = list[..list.len() - skipped].iter().rev().enumerate().filter(|(_, p)| is_first(p));
    let last = if wanted > before { rest.map(|(i, _)| i + 1).nth(wanted - before - 1) } else { Some(0) };
    skipped + last.unwrap_or(0)
}

/// Minimum number of chunks, if [`MIN_CHUNK`] allows. (A thread needs about 450 bytes per primitive of its chunk.)
const MIN_CHUNKS: usize = 32;
/// Limits on the primitives of a chunk.
const MIN_CHUNK: usize = 1 << 13;
const MAX_CHUNK: usize = 1 << 15;

/// Ratio of a primitive's box area to the mean area of a chunk above which the primitive counts as large.
const LARGE_AREA: f64 = 0.25;
/// At most one in this many primitives counts as large.
const MIN_PRIMITIVES_PER_LARGE: usize = 64;

/// Estimated cache lines of the tree over these primitives.
fn estimated_lines(primitives: &[Primitive], geometry: &Geometry) -> usize {
    let mut estimate = Estimate::default();
    estimate.add_geometry(geometry);
    estimate.add_instances(primitives.len().saturating_sub(geometry.primitives()));
    estimate.lines()
}

/// Appends the tree over primitives, which are reordered.
pub fn build(
    primitives: &mut [Primitive],
    space: &NormalizedSpace,
    shapes: ShapeSource,
    (options, threads): (BuildOptions, Threads),
    lines: &mut Vec<Line>,
) -> Result<WrittenTree, BufferFull> {
    reserve_on_huge_pages(lines, estimated_lines(primitives, shapes.geometry));
    let limit = (primitives.len() / MIN_CHUNKS).clamp(MIN_CHUNK, MAX_CHUNK);
    let count = large_to_front(primitives, space, limit);
    let (large, primitives) = primitives.split_at_mut(count);
    // Without large primitives such as a ground plane, the unit cube is smaller, and small triangles have more digits in it.
    let own_space = (count > 0).then(|| NormalizedSpace::of(primitives));
    let space = own_space.as_ref().unwrap_or(space);
    let chunks = split_into_chunks(primitives, space, limit, options.counter);
    let effort = match options.quality {
        TreeQuality::Fast => Effort::Least,
        TreeQuality::Full => Effort::Chunk,
    };
    let subtrees =
        SubtreeBuilder { primitives, space, shapes, effort, options }.append(&chunks, threads, lines)?;
    options.report(2 * large.len());
    let of_subtree = |(i, subtree): (usize, &Subtree)| Primitive {
        kind: PrimitiveKind::Subtree,
        id: i as u32,
        bounds: subtree.bounds,
    };
    let tops: Vec<Primitive> =
        subtrees.iter().enumerate().map(of_subtree).chain(large.iter().copied()).collect();
    let binary =
        binary_tree::build(&tops, &NormalizedSpace::of(&tops), Effort::Most, &mut Workspace::default());
    let collapse = Collapse::new(&binary, &tops, &subtrees);
    let top =
        TreeWriter { binary: &binary, collapse: &collapse, primitives: &tops, shapes, subtrees: &subtrees };
    let WrittenTree { root, depth } = top.write(lines)?;
    let deepest = subtrees.iter().map(|subtree| subtree.depth).max().unwrap_or(0);
    Ok(WrittenTree { root, depth: depth + deepest })
}

/// Moves large primitives to the front and returns their number. A wall would make the box of its chunk as large as the room, so
/// large primitives go directly to the top tree.
fn large_to_front(primitives: &mut [Primitive], space: &NormalizedSpace, limit: usize) -> usize {
    let area = |bounds: &Bounds3| {
        let extent = bounds.extent().as_dvec3();
        extent.x * (extent.y + extent.z) + extent.y * extent.z
    };
    let chunks = primitives.len().div_ceil(limit) as f64;
    let mut least = area(&space.bounds) * LARGE_AREA / chunks;
    loop {
        let is_large = |p: &Primitive| area(&p.bounds) > least;
        let count = primitives.par_iter().with_min_len(4096).filter(|p| is_large(p)).count();
        if count <= primitives.len() / MIN_PRIMITIVES_PER_LARGE {
            return partition(primitives, is_large);
        }
        least *= 2.0;
    }
}

/// Builds the trees of chunks.
struct SubtreeBuilder<'a> {
    primitives: &'a [Primitive],
    space: &'a NormalizedSpace,
    shapes: ShapeSource<'a>,
    effort: Effort,
    options: BuildOptions<'a>,
}

impl SubtreeBuilder<'_> {
    /// Appends the trees of all chunks.
    fn append(
        &self,
        chunks: &[Range<usize>],
        threads: Threads,
        lines: &mut Vec<Line>,
    ) -> Result<Vec<Subtree>, BufferFull> {
        let built = append(chunks.len(), threads, lines, |index, workspace| {
            let chunk = &self.primitives[chunks[index].clone()];
            let subtree = self.subtree(chunk, workspace);
            self.options.report(chunk.len());
            subtree
        })?;
        Ok(built.into_iter().map(|(root, subtree)| Subtree { root, ..subtree }).collect())
    }

    /// The tree over a chunk.
    fn subtree(
        &self,
        primitives: &[Primitive],
        workspace: &mut Workspace,
    ) -> Result<TreePart<Subtree>, BufferFull> {
        let binary = &binary_tree::build(primitives, self.space, self.effort, workspace);
        let collapse = &Collapse::new(binary, primitives, &[]);
        let mut lines = empty_buffer();
        let writer = TreeWriter { binary, collapse, primitives, shapes: self.shapes, subtrees: &[] };
        let WrittenTree { root, depth } = writer.write(&mut lines)?;
        Ok(TreePart {
            root,
            lines,
            result: Subtree { root, depth, bounds: binary.bounds[0], cost: collapse.cost() },
        })
    }
}

/// A tree in a buffer of its own, with a result of its build.
pub struct TreePart<T> {
    /// Reference to its root.
    pub root: u32,
    /// The buffer, from [`empty_buffer`].
    pub lines: Vec<Line>,
    pub result: T,
}

/// Unused lines at the start of a [`TreePart`] buffer, since lines 0 and 1 must not hold an instance (see [`DONE`]).
const UNUSED: usize = 2;

/// The buffer for a [`TreePart`].
pub fn empty_buffer() -> Vec<Line> {
    vec![Line::ZERO; UNUSED]
}

/// Threads of a build.
pub enum Threads<'a> {
    /// At most this many threads of the pool build trees; the others help with parallel loops within a tree.
    Pool(usize),
    /// The calling thread.
    This(&'a mut Workspace),
}

/// Builds `count` trees and appends them in order; returns their relocated roots and results.
pub fn append<T: Send>(
    count: usize,
    threads: Threads,
    lines: &mut Vec<Line>,
    build: impl Fn(usize, &mut Workspace) -> Result<TreePart<T>, BufferFull> + Sync,
) -> Result<Vec<(u32, T)>, BufferFull> {
    let start = lines.len();
    // A claim is a range of the spare capacity that one thread fills.
    let (parts, overflow) = append_claims(lines, |claims| {
        let mut waiting = Vec::new();
        waiting.resize_with(count, || None);
        let output = LineAllocator { claims, next: start, parts: Vec::with_capacity(count), waiting };
        let queue = Queue {
            count,
            next: AtomicUsize::new(0),
            failed: AtomicBool::new(false),
            output: Mutex::new(output),
        };
        queue.run(threads, &build)
    })?;
    reserve_on_huge_pages(lines, overflow.iter().map(|part| part.lines.len() - UNUSED).sum());
    for mut part in overflow {
        part.relocate();
        lines.extend_from_slice(&part.lines[UNUSED..]);
    }
    Ok(parts)
}

/// The trees to be built.
struct Queue<'a, T> {
    count: usize,
    next: AtomicUsize,
    failed: AtomicBool,
    output: Mutex<LineAllocator<'a, T>>,
}

impl<T: Send> Queue<'_, T> {
    #[allow(clippy::type_complexity)]
    fn run(
        self,
        threads: Threads,
        build: &(impl Fn(usize, &mut Workspace) -> Result<TreePart<T>, BufferFull> + Sync),
    ) -> Result<(Vec<(u32, T)>, Vec<Relocation>), BufferFull> {
        match threads {
            Threads::This(workspace) => vec![self.work(workspace, build)],
            // Not a parallel loop, where a thread that waits within one tree would start another and need more memory.
            Threads::Pool(most) => rayon::broadcast(|context| match context.index() < most.max(1) {
                true => self.work(&mut Workspace::default(), build),
                false => Ok(Vec::new()),
            }),
        }
        .into_iter()
        .collect::<Result<Vec<_>, _>>()
        .map(|overflow| {
            let mut overflow: Vec<Relocation> = overflow.into_iter().flatten().collect();
            overflow.sort_unstable_by_key(|part| part.start);
            (self.output.into_inner().expect("no thread fails").parts, overflow)
        })
    }

    /// Builds and writes trees until the queue is empty; returns those that did not fit in the reserved buffer.
    fn work(
        &self,
        workspace: &mut Workspace,
        build: &impl Fn(usize, &mut Workspace) -> Result<TreePart<T>, BufferFull>,
    ) -> Result<Vec<Relocation>, BufferFull> {
        let mut overflow = Vec::new();
        while !self.failed.load(Ordering::Relaxed) {
            let index = self.next.fetch_add(1, Ordering::Relaxed);
            if index >= self.count {
                break;
            }
            let part = build(index, workspace).inspect_err(|_| self.failed.store(true, Ordering::Relaxed))?;
            let placed = self.output.lock().expect("no thread fails").put(index, part);
            for (mut part, claim) in placed {
                if part.start + part.lines.len() > MAX_LINE {
                    self.failed.store(true, Ordering::Relaxed);
                    return Err(BufferFull);
                }
                match claim {
                    Some(claim) => {
                        part.relocate();
                        claim.fill(&part.lines[UNUSED..]);
                    }
                    None => overflow.push(part),
                }
            }
        }
        Ok(overflow)
    }
}

/// The lines of a tree and its destination in the buffer.
struct Relocation {
    lines: Vec<Line>,
    root: u32,
    start: usize,
}

impl Relocation {
    /// Offset added to references, lines (modulo 2^32).
    fn offset(&self) -> u32 {
        (self.start as u32).wrapping_sub(UNUSED as u32)
    }

    fn relocate(&mut self) {
        let offset = self.offset();
        relocate_references(&mut self.lines, self.root, offset);
    }
}

/// Assigns ranges of lines in the order of the trees.
struct LineAllocator<'a, T> {
    claims: Claims<'a>,
    next: usize,
    parts: Vec<(u32, T)>,
    /// Trees that were finished before earlier ones.
    waiting: Vec<Option<TreePart<T>>>,
}

impl<'a, T> LineAllocator<'a, T> {
    /// Stores a finished tree; returns all trees to which a range of lines can be assigned now, with the memory of that range.
    fn put(&mut self, index: usize, part: TreePart<T>) -> Vec<(Relocation, Option<Claim<'a>>)> {
        self.waiting[index] = Some(part);
        let mut placed = Vec::new();
        while let Some(part) = self.waiting.get_mut(self.parts.len()).and_then(Option::take) {
            let TreePart { root, lines, result } = part;
            let moved = Relocation { lines, root, start: self.next };
            let count = moved.lines.len() - UNUSED;
            self.next += count;
            self.parts.push((if root == DONE { DONE } else { root.wrapping_add(moved.offset()) }, result));
            placed.push((moved, self.claims.claim(count)));
        }
        placed
    }
}

/// Adds `offset` lines (modulo 2^32) to all references of a tree.
fn relocate_references(lines: &mut [Line], root: u32, offset: u32) {
    let mut stack = vec![root];
    while let Some(reference) = stack.pop() {
        if reference & LEAF != 0 {
            relocate_leaf(lines, reference, offset);
            continue;
        }
        let node = view_mut::<Node>(lines, line_of(reference));
        for child in node.child.iter_mut().filter(|child| **child != DONE) {
            stack.push(*child);
            *child = child.wrapping_add(offset);
        }
    }
}

/// Adds `offset` to the references between the packets of a leaf.
fn relocate_leaf(lines: &mut [Line], first: u32, offset: u32) {
    let relocated = |next: u32| if next == DONE { DONE } else { next.wrapping_add(offset) };
    let mut reference = first;
    while reference != DONE {
        let line = line_of(reference);
        reference = match kind_of(reference) {
            KIND_INSTANCE => {
                let record = view_mut::<InstanceRecord>(lines, line);
                let next = record.next;
                record.next = relocated(next);
                next
            }
            KIND_ANALYTIC => {
                let packet = view_mut::<AnalyticPacket>(lines, line);
                let next = packet.next;
                packet.next = relocated(next);
                next
            }
            _ => {
                let packet = view_mut::<TrianglePacket>(lines, line);
                let next = packet.next();
                packet.rows[11] = [f32::from_bits(relocated(next)); LANES];
                next
            }
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::layout::{KIND_TRIANGLES, leaf_ref};

    #[test]
    fn parallel_partition_equals_the_sequential_one() {
        let list = |count: usize| -> Vec<Primitive> {
            let id = |i: usize| (i as u32).wrapping_mul(0x9e37_79b9) ^ (i as u32).wrapping_mul(i as u32) << 7;
            let one = |i| Primitive { kind: PrimitiveKind::Triangle, id: id(i), bounds: Bounds3::EMPTY };
            (0..count).map(one).collect()
        };
        let ids = |list: &[Primitive]| list.iter().map(|p| p.id).collect::<Vec<u32>>();
        for (count, share) in [(10, 0.5), (200_000, 0.5), (400_001, 0.9), (300_000, 0.0), (PARALLEL * 3, 1.0)]
        {
            let limit = (share * f64::from(u32::MAX)) as u32;
            let is_first = |p: &Primitive| p.id < limit || limit == u32::MAX;
            let (mut one, mut two) = (list(count), Vec::new());
            two.extend_from_slice(&one);
            let middle = partition_sequential(&mut one, is_first);
            assert_eq!(middle, two.iter().filter(|p| is_first(p)).count());
            assert_eq!(partition(&mut two, is_first), middle);
            assert!(ids(&one) == ids(&two), "{count} {share}");
        }
        // Sorted input: all elements of the first part are already in front.
        let mut sorted = list(300_000);
        sorted.sort_unstable_by_key(|p| std::cmp::Reverse(p.id));
        let mut other = sorted.clone();
        let is_first = |p: &Primitive| p.id < 1 << 30;
        assert_eq!(partition_sequential(&mut sorted, is_first), partition(&mut other, is_first));
        assert!(ids(&sorted) == ids(&other));
    }

    /// A tree of one leaf with two triangle packets.
    fn part(index: usize) -> TreePart<usize> {
        let mut lines = empty_buffer();
        lines.resize(UNUSED + 6 + index % 3, Line::ZERO);
        *view_mut(&mut lines, UNUSED) = TrianglePacket::of(&[], leaf_ref(KIND_TRIANGLES, UNUSED + 3));
        *view_mut(&mut lines, UNUSED + 3) = TrianglePacket::of(&[], DONE);
        TreePart { root: leaf_ref(KIND_TRIANGLES, UNUSED), lines, result: index }
    }

    #[test]
    fn appended_trees_depend_on_neither_capacity_nor_threads() {
        let built = |capacity: usize, threads: usize| {
            let mut lines = vec![Line::ZERO; 5];
            lines.reserve_exact(capacity);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let all = Threads::Pool(usize::MAX);
            let roots = pool.install(|| append(100, all, &mut lines, |index, _| Ok(part(index))));
            (roots.expect("the buffer is large enough"), lines)
        };
        let (roots, lines) = built(1000, 1);
        assert_eq!(lines.len(), 5 + 6 * 100 + 99);
        for (i, (root, index)) in roots.iter().enumerate() {
            assert_eq!((line_of(*root), *index), (5 + 6 * i + (0..i).map(|k| k % 3).sum::<usize>(), i));
            let mut own = lines[line_of(*root)..][..6].to_vec();
            let next = view_mut::<TrianglePacket>(&mut own, 0).next();
            assert_eq!(next, leaf_ref(KIND_TRIANGLES, line_of(*root) + 3));
        }
        for (capacity, threads) in [(0, 1), (300, 1), (0, 4), (300, 4), (1000, 4)] {
            let (same_roots, same) = built(capacity, threads);
            let [same, lines] = [&same, &lines].map(|list| bytemuck::cast_slice::<Line, u8>(list));
            assert!(same_roots == roots && same == lines, "{capacity} {threads}");
        }
        let mut lines = Vec::new();
        let workspace = &mut Workspace::default();
        let failed = append(3, Threads::This(workspace), &mut lines, |index, _| {
            if index == 1 { Err(BufferFull) } else { Ok(part(index)) }
        });
        assert!(failed == Err(BufferFull) && lines.is_empty());
    }
}
