//! Cuts many primitives into chunks that lie apart: where the surface area heuristic, looked at in bins (Wald 2007, "On fast
//! Construction of SAH-based Bounding Volume Hierarchies"), says that a tree would part them.

use super::gather::Primitive;
use super::normalize::Space;
use crate::gauge::Gauge;
use crate::math::Vec3;
use glam::Vec3A;
use obvhs::aabb::Aabb;
use rayon::prelude::*;
use std::ops::Range;

/// Bins along the longest axis.
const BINS: usize = 32;
/// More primitives than these are looked at by several threads.
const PARALLEL: usize = 1 << 16;
/// After so many cuts on the way to a chunk the rest is halved.
const MAX_CUTS: u32 = 40;

/// Reorders primitives into chunks of at most `limit`, and gives the places of these; the gauge counts the primitives of finished
/// chunks.
pub fn cut(
    primitives: &mut [Primitive],
    space: &Space,
    limit: usize,
    gauge: Option<&Gauge>,
) -> Vec<Range<usize>> {
    let mut chunks = Vec::new();
    let mut rest = 0;
    for size in sizes(primitives, space, (limit, gauge), 0) {
        chunks.push(rest..rest + size);
        rest += size;
    }
    chunks
}

fn sizes(
    primitives: &mut [Primitive],
    space: &Space,
    (limit, gauge): (usize, Option<&Gauge>),
    cuts: u32,
) -> Vec<usize> {
    if primitives.len() <= limit {
        if let Some(gauge) = gauge {
            gauge.add(primitives.len() as u64);
        }
        return vec![primitives.len()];
    }
    // Near the root there are fewer parts than threads.
    let are_idle = 1 << cuts < rayon::current_num_threads();
    let middle = if cuts < MAX_CUTS { part(primitives, space, are_idle) } else { primitives.len() / 2 };
    let (left, right) = primitives.split_at_mut(middle);
    let (mut sizes, more) = rayon::join(
        || sizes(left, space, (limit, gauge), cuts + 1),
        || sizes(right, space, (limit, gauge), cuts + 1),
    );
    sizes.extend(more);
    sizes
}

/// The middle of a primitive's box in the unit cube.
#[inline(always)]
fn center(primitive: &Primitive, space: &Space) -> Vec3 {
    space.place(primitive.bounds.center())
}

/// What lies in a bin.
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

    /// What it costs to visit all in it, times the chance to: by area and number. (In f64: areas go up to 1e37.)
    fn cost(&self) -> f64 {
        if self.count == 0 {
            return 0.0;
        }
        let extent = Vec3::from(self.bounds.diagonal().to_array()).as_dvec3();
        (extent.x * (extent.y + extent.z) + extent.y * extent.z) * self.count as f64
    }
}

/// The bins of primitives by their centres along an axis.
struct Axis {
    axis: usize,
    low: f32,
    scale: f32,
}

impl Axis {
    /// The longest one; `None` where all centres are in one place.
    fn longest(primitives: &[Primitive], space: &Space) -> Option<Axis> {
        let of_some = |some: &[Primitive]| {
            some.iter().fold(Aabb::INVALID, |all, p| {
                let center = Vec3A::from(center(p, space));
                Aabb { min: all.min.min(center), max: all.max.max(center) }
            })
        };
        let centers =
            primitives.par_chunks(PARALLEL).map(of_some).reduce(|| Aabb::INVALID, |a, b| a.union(&b));
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

/// Reorders primitives so that some of them, whose number it returns, lie apart from the others.
fn part(primitives: &mut [Primitive], space: &Space, are_idle: bool) -> usize {
    let halves = primitives.len() / 2;
    let Some(axis) = Axis::longest(primitives, space) else { return halves };
    let of_some = |some: &[Primitive]| {
        let mut bins = [Bin::EMPTY; BINS];
        for p in some {
            let bounds = Aabb::new(p.bounds.min.into(), p.bounds.max.into());
            bins[axis.bin(center(p, space))].add(1, &bounds);
        }
        bins
    };
    let sum = |mut a: [Bin; BINS], b: [Bin; BINS]| {
        a.iter_mut().zip(&b).for_each(|(a, b)| a.add(b.count, &b.bounds));
        a
    };
    let bins = primitives.par_chunks(PARALLEL).map(of_some).reduce(|| [Bin::EMPTY; BINS], sum);
    let first = best_cut(&bins);
    let is_first = |p: &Primitive| axis.bin(center(p, space)) < first;
    let middle =
        if are_idle { partition(primitives, is_first) } else { partition_alone(primitives, is_first) };
    match middle {
        middle if middle > 0 && middle < primitives.len() => middle,
        _ => halves,
    }
}

/// The first bin of the second part.
fn best_cut(bins: &[Bin; BINS]) -> usize {
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

/// Moves those for which `is_first` to the front; returns their number. The first one that is to go to the back changes places with
/// the last one that is to go to the front, the second one with the last but one, and so on.
fn partition_alone(primitives: &mut [Primitive], is_first: impl Fn(&Primitive) -> bool) -> usize {
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

/// The same by all threads.
pub fn partition(primitives: &mut [Primitive], is_first: impl Fn(&Primitive) -> bool + Sync) -> usize {
    if primitives.len() <= PARALLEL {
        return partition_alone(primitives, is_first);
    }
    let count = |some: &[Primitive]| some.iter().filter(|p| is_first(p)).count();
    let middle = primitives.par_chunks(PARALLEL).map(count).sum();
    let (front, back) = primitives.split_at_mut(middle);
    let mut to_back: Vec<usize> = front.par_chunks(PARALLEL).map(|some| some.len() - count(some)).collect();
    sum_up(&mut to_back);
    let mut to_front: Vec<usize> = back.par_rchunks(PARALLEL).map(count).collect();
    sum_up(&mut to_front);
    // How much of the back's end holds what changes places with the front up to the end of each of its chunks.
    let ends: Vec<usize> = to_back.par_iter().map(|&n| end_with(back, n, &to_front, &is_first)).collect();
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

/// Makes each number the sum of all up to it.
fn sum_up(numbers: &mut [usize]) {
    let mut sum = 0;
    for number in numbers {
        sum += *number;
        *number = sum;
    }
}

/// How many primitives at the end of a list hold `wanted` ones for which `is_first`; `sums` says how many are in the last chunk,
/// the last two and so on.
fn end_with(
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

#[cfg(test)]
mod tests {
    use super::super::gather::Kind;
    use super::*;
    use crate::math::Bounds3;

    #[test]
    fn threads_part_primitives_as_one_does() {
        let list = |count: usize| -> Vec<Primitive> {
            let id = |i: usize| (i as u32).wrapping_mul(0x9e37_79b9) ^ (i as u32).wrapping_mul(i as u32) << 7;
            let one = |i| Primitive { kind: Kind::Triangle, id: id(i), bounds: Bounds3::EMPTY };
            (0..count).map(one).collect()
        };
        let ids = |list: &[Primitive]| list.iter().map(|p| p.id).collect::<Vec<u32>>();
        for (count, share) in [(10, 0.5), (200_000, 0.5), (400_001, 0.9), (300_000, 0.0), (PARALLEL * 3, 1.0)]
        {
            let limit = (share * f64::from(u32::MAX)) as u32;
            let is_first = |p: &Primitive| p.id < limit || limit == u32::MAX;
            let (mut one, mut two) = (list(count), Vec::new());
            two.extend_from_slice(&one);
            let middle = partition_alone(&mut one, is_first);
            assert_eq!(middle, two.iter().filter(|p| is_first(p)).count());
            assert_eq!(partition(&mut two, is_first), middle);
            assert!(ids(&one) == ids(&two), "{count} {share}");
        }
        // All of one kind come first.
        let mut sorted = list(300_000);
        sorted.sort_unstable_by_key(|p| std::cmp::Reverse(p.id));
        let mut other = sorted.clone();
        let is_first = |p: &Primitive| p.id < 1 << 30;
        assert_eq!(partition_alone(&mut sorted, is_first), partition(&mut other, is_first));
        assert!(ids(&sorted) == ids(&other));
    }
}
