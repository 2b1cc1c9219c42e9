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
    let middle = if cuts < MAX_CUTS { part(primitives, space) } else { primitives.len() / 2 };
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
fn part(primitives: &mut [Primitive], space: &Space) -> usize {
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
    match partition(primitives, |p| axis.bin(center(p, space)) < first) {
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

/// Moves those for which `is_first` to the front; returns their number.
pub fn partition(primitives: &mut [Primitive], is_first: impl Fn(&Primitive) -> bool) -> usize {
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
