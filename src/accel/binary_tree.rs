//! The binary BVH: obvhs clusters primitives (PLOC: Meister, Bittner 2018) and improves the tree (parallel reinsertion). This file
//! normalizes boxes before ([`NormalizedSpace`]) and puts nodes into depth-first order with exact boxes after. [`median_split`] is
//! the fallback for trees that are too deep.

use super::input::Primitive;
use crate::math::{Bounds3, DVec3, Vec3};
use crate::sampling::hash::murmur32;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, SortPrecision};
use rayon::prelude::*;

/// A binary tree in depth-first order: the left child follows its parent, the right one follows the left subtree.
pub struct BinaryTree {
    /// Bounds of each node.
    pub bounds: Vec<Bounds3>,
    /// Number of nodes in the subtree of each node; 1 for leaves.
    pub size: Vec<u32>,
    /// Primitive index of each leaf; `u32::MAX` for inner nodes.
    pub primitive: Vec<u32>,
}

impl BinaryTree {
    /// The children of an inner node.
    #[inline(always)]
    pub fn children(&self, node: usize) -> (usize, usize) {
        (node + 1, node + 1 + self.size[node + 1] as usize)
    }

    /// Whether a node is a leaf.
    #[inline(always)]
    pub fn is_leaf(&self, node: usize) -> bool {
        self.size[node] == 1
    }
}

/// Upper limit of [`expected_visits`] for reinsertion: the search for a new parent costs about as much as tracing a ray, so with
/// heavily overlapping primitives reinsertion takes too long and gains nothing.
const MAX_VISITS_FOR_REINSERTION: f64 = 3000.0;

/// Build effort: search distance of PLOC (number of neighbours on either side along the Morton curve that are candidates for
/// merging), and whether reinsertion follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Chunks of fast trees: search distance 4, no reinsertion.
    Least,
    /// Chunks of full-quality trees: search distance 14. (24 takes a quarter longer for 0.1 % of expected cost.)
    Chunk,
    /// Whole trees: search distance 24.
    Most,
}

impl Effort {
    /// The fraction of nodes that a round of reinsertion considers. All nodes (with a search distance of 32) take ten times as
    /// long for 5 to 15 % faster rays.
    fn reinsertion_ratio(self) -> f32 {
        if self == Effort::Least { 0.0 } else { 0.1 }
    }
}

/// Memory that is reused from one tree to the next.
#[derive(Default)]
pub struct Workspace {
    boxes: Vec<Aabb>,
    ploc: PlocBuilder,
    bvh: Bvh2,
    optimizer: ReinsertionOptimizer,
}

/// Builds the tree over at least one primitive.
pub fn build(
    primitives: &[Primitive],
    space: &NormalizedSpace,
    effort: Effort,
    workspace: &mut Workspace,
) -> BinaryTree {
    let Workspace { boxes, ploc, bvh, optimizer } = workspace;
    space.boxes(primitives, boxes);
    let ids = (0..primitives.len() as u32).collect();
    // Const generics: obvhs's enum of search distances would instantiate six of them.
    const PRECISION: SortPrecision = SortPrecision::U64;
    match effort {
        Effort::Least => ploc.build_ploc::<4, _>(bvh, boxes, ids, PRECISION, 0),
        Effort::Chunk => ploc.build_ploc::<14, _>(bvh, boxes, ids, PRECISION, 0),
        Effort::Most => ploc.build_ploc::<24, _>(bvh, boxes, ids, PRECISION, 0),
    }
    let ratio = effort.reinsertion_ratio();
    if ratio > 0.0 && expected_visits(bvh) <= MAX_VISITS_FOR_REINSERTION {
        optimizer.run(bvh, ratio, None);
    }
    depth_first(bvh, primitives)
}

/// Expected number of inner nodes that a random ray through the root box visits: the sum of their areas over the root's area.
fn expected_visits(bvh: &Bvh2) -> f64 {
    let Some(root) = bvh.nodes.first() else { return 0.0 };
    let sum: f64 = bvh.nodes.iter().filter(|n| !n.is_leaf()).map(|n| f64::from(n.aabb().half_area())).sum();
    sum / f64::from(root.aabb().half_area()).max(f64::MIN_POSITIVE)
}

/// Converts to depth-first order with the exact boxes of the primitives.
fn depth_first(bvh: &Bvh2, primitives: &[Primitive]) -> BinaryTree {
    let count = bvh.nodes.len();
    let mut binary = BinaryTree {
        bounds: vec![Bounds3::EMPTY; count],
        size: vec![1; count],
        primitive: vec![u32::MAX; count],
    };
    let mut stack = vec![0u32];
    let mut next = 0;
    while let Some(index) = stack.pop() {
        let node = &bvh.nodes[index as usize];
        if node.is_leaf() {
            let primitive = bvh.primitive_indices[node.first_index as usize];
            binary.primitive[next] = primitive;
            binary.bounds[next] = primitives[primitive as usize].bounds;
        } else {
            stack.push(node.first_index + 1);
            stack.push(node.first_index);
        }
        next += 1;
    }
    for i in (0..count).rev().filter(|i| binary.primitive[*i] == u32::MAX) {
        let left = i + 1;
        let right = left + binary.size[left] as usize;
        binary.size[i] = 1 + binary.size[left] + binary.size[right];
        binary.bounds[i] = binary.bounds[left].union(binary.bounds[right]);
    }
    binary
}

/// Mapping of boxes to the unit cube for the builder, so that areas neither overflow nor underflow: logarithmic for primitives far
/// outside of the core of the scene. Boxes are perturbed so that no two are equal.
pub struct NormalizedSpace {
    /// Bounds of all primitives, in scene space.
    pub bounds: Bounds3,
    core: Core,
    low: DVec3,
    scale: f64,
    /// Whether all primitives are within the margin of the core, where the map is linear.
    is_linear: bool,
}

impl NormalizedSpace {
    /// The map for a list of primitives.
    pub fn of(primitives: &[Primitive]) -> NormalizedSpace {
        let all = primitives
            .par_iter()
            .with_min_len(4096)
            .map(|p| p.bounds)
            .reduce(|| Bounds3::EMPTY, Bounds3::union);
        let core = Core::of(primitives);
        let low = core.compress(all.min.as_dvec3());
        let extent = (core.compress(all.max.as_dvec3()) - low).max_element();
        let scale = if extent > 0.0 { 1.0 / extent } else { 1.0 };
        let is_linear = core.is_linear_at(all.min.as_dvec3()) && core.is_linear_at(all.max.as_dvec3());
        NormalizedSpace { bounds: all, core, low, scale, is_linear }
    }

    /// Maps a point of the scene to the unit cube.
    #[inline(always)]
    pub fn map(&self, p: Vec3) -> Vec3 {
        let p = p.as_dvec3();
        let p = if self.is_linear { p } else { self.core.compress(p) };
        ((p - self.low) * self.scale).as_vec3()
    }

    /// Writes the boxes of primitives in the unit cube to `boxes`, in the same order.
    pub fn boxes(&self, primitives: &[Primitive], boxes: &mut Vec<Aabb>) {
        let of_one = |(i, p): (usize, &Primitive)| {
            let (min, max) = (self.map(p.bounds.min), self.map(p.bounds.max));
            Aabb::new(min.into(), (max + growth(i as u32, max - min)).into())
        };
        primitives.par_iter().with_min_len(4096).enumerate().map(of_one).collect_into_vec(boxes);
    }
}

/// Extent in the unit cube (64 ulps) below which a box counts as collapsed.
const COLLAPSED: f32 = 1.0 / 131_072.0;

/// Growth of a box: a pseudo-random fraction below 1/4096 of its size, because clustering degrades to one merge per pass where all
/// boxes are equal. Collapsed boxes grow by more, so that rounding can't make them equal again.
fn growth(index: u32, size: Vec3) -> Vec3 {
    let random = murmur32(index);
    let fraction = |shift: u32| ((random >> shift) & 1023) as f32 / 1024.0;
    let most = if size.max_element() < COLLAPSED {
        Vec3::splat(8.0 * COLLAPSED)
    } else {
        (size + Vec3::splat(1.0 / 4096.0)) / 4096.0
    };
    most * Vec3::new(fraction(0), fraction(10), fraction(20))
}

/// The core of the scene: a box around the centroids of most primitives.
struct Core {
    low: DVec3,
    high: DVec3,
    /// Distance from the box up to which the map is linear, metres; 0: linear everywhere.
    margin: f64,
}

/// Number of primitives sampled to find the core.
const SAMPLES: usize = 4096;
/// Fraction of the samples outside of the core at either end of each axis.
const OUTSIDE: f64 = 0.1;
/// Margin of the core in multiples of its longest extent.
const MARGIN: f64 = 64.0;

impl Core {
    fn of(primitives: &[Primitive]) -> Core {
        let step = primitives.len().div_ceil(SAMPLES).max(1);
        let centers: Vec<DVec3> = primitives
            .iter()
            .step_by(step)
            .map(|p| (p.bounds.min.as_dvec3() + p.bounds.max.as_dvec3()) * 0.5)
            .collect();
        let outside = (centers.len() as f64 * OUTSIDE) as usize;
        let range = |axis: usize| {
            let mut sorted: Vec<f64> = centers.iter().map(|m| m[axis]).collect();
            sorted.sort_unstable_by(f64::total_cmp);
            let last = sorted.len().saturating_sub(1);
            let at = |i: usize| sorted.get(i).copied().unwrap_or(0.0);
            (at(outside), at(last - outside.min(last)))
        };
        let [x, y, z] = [range(0), range(1), range(2)];
        let (low, high) = (DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1));
        Core { low, high, margin: MARGIN * (high - low).max_element() }
    }

    /// Whether the map is linear at a point.
    fn is_linear_at(&self, p: DVec3) -> bool {
        let outside = (p - self.high).max(self.low - p).max_element();
        self.margin <= 0.0 || outside <= self.margin
    }

    /// Maps a point: logarithmic beyond the margin, since otherwise one distant vertex would leave no single-precision digits for
    /// all others. The map is monotonic on each axis, so it preserves which boxes overlap.
    fn compress(&self, p: DVec3) -> DVec3 {
        if self.margin <= 0.0 {
            return p;
        }
        let axis = |x: f64, low: f64, high: f64| {
            if x > high {
                high + self.margin * logarithmic((x - high) / self.margin)
            } else if x < low {
                low - self.margin * logarithmic((low - x) / self.margin)
            } else {
                x
            }
        };
        DVec3::new(
            axis(p.x, self.low.x, self.high.x),
            axis(p.y, self.low.y, self.high.y),
            axis(p.z, self.low.z, self.high.z),
        )
    }
}

/// `d` up to 1; then `1 + log2(d)`, interpolated linearly between powers of two, which gives the same bits on all systems.
fn logarithmic(d: f64) -> f64 {
    if d <= 1.0 {
        return d;
    }
    let power = (d.to_bits() >> 52) as i32 - 1023;
    let below = f64::from_bits(((power + 1023) as u64) << 52);
    f64::from(power) + d / below
}

/// A tree of minimum depth: splits primitives at the median of their centroids along the longest axis. Fallback for scenes whose
/// tree is too deep for the traversal stacks, such as thousands of nested shapes.
pub fn median_split(primitives: &[Primitive]) -> BinaryTree {
    let count = 2 * primitives.len() - 1;
    let mut binary = BinaryTree {
        bounds: Vec::with_capacity(count),
        size: Vec::with_capacity(count),
        primitive: Vec::with_capacity(count),
    };
    let mut ids: Vec<u32> = (0..primitives.len() as u32).collect();
    split_at_median(&mut binary, primitives, &mut ids);
    binary
}

/// Appends the tree over a non-empty list of primitives.
fn split_at_median(binary: &mut BinaryTree, primitives: &[Primitive], ids: &mut [u32]) {
    let bounds = |id: u32| primitives[id as usize].bounds;
    let center = |id: u32| 0.5 * bounds(id).min + 0.5 * bounds(id).max;
    let node = binary.size.len();
    binary.bounds.push(ids.iter().fold(Bounds3::EMPTY, |all, id| all.union(bounds(*id))));
    binary.size.push(2 * ids.len() as u32 - 1);
    binary.primitive.push(if let [id] = ids { *id } else { u32::MAX });
    if ids.len() > 1 {
        let (low, high) = ids.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), id| {
            (low.min(center(*id)), high.max(center(*id)))
        });
        let axis = (high - low).max_position();
        let half = ids.len() / 2;
        ids.select_nth_unstable_by(half, |a, b| center(*a)[axis].total_cmp(&center(*b)[axis]).then(a.cmp(b)));
        let (left, right) = ids.split_at_mut(half);
        split_at_median(binary, primitives, left);
        split_at_median(binary, primitives, right);
    }
    debug_assert_eq!(binary.size.len(), node + binary.size[node] as usize);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithmic_scale_is_monotonic_and_continuous() {
        assert_eq!(
            [0.0, 0.25, 1.0, 2.0, 3.0, 4.0, 1024.0].map(logarithmic),
            [0.0, 0.25, 1.0, 2.0, 2.5, 3.0, 11.0]
        );
        let mut last = 0.0;
        for i in 1..100_000 {
            let now = logarithmic(f64::from(i) * 0.001);
            assert!(now > last, "{i}");
            last = now;
        }
    }
}
