//! The binary tree: obvhs clusters (PLOC) and improves it (parallel reinsertion); here its order and boxes.

use super::gather::Primitive;
use super::normalize::Space;
use crate::math::Bounds3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, SortPrecision};

/// A binary tree in depth-first order: the left child follows its parent, the right one follows the left subtree.
pub struct Binary {
    /// Boxes.
    pub bounds: Vec<Bounds3>,
    /// Nodes of the subtree; 1 for leaves.
    pub size: Vec<u32>,
    /// Leaves: which primitive.
    pub primitive: Vec<u32>,
}

impl Binary {
    /// The children of an inner node.
    #[inline(always)]
    pub fn children(&self, node: usize) -> (usize, usize) {
        (node + 1, node + 1 + self.size[node + 1] as usize)
    }

    /// Is it a leaf?
    #[inline(always)]
    pub fn is_leaf(&self, node: usize) -> bool {
        self.size[node] == 1
    }
}

/// Reinsertion looks for a better place in the whole tree, which takes as long as a ray takes that visits all boxes in its
/// way. Beyond this expected number of visits (primitives in one heap) it would not end, and could not help.
const MAX_VISITS_FOR_REINSERTION: f64 = 3000.0;

/// How much is done for the tree: the search distance of the clustering (neighbours on either side, along the curve that
/// orders them, among which a cluster looks for another to join), and whether reinsertion follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// For chunks that few rays will meet: 4, and left so.
    Least,
    /// For chunks that many rays will meet: 14. (24 takes a quarter longer for 0.1 % of expected cost.)
    Chunk,
    /// For what is no chunk: 24.
    Most,
}

impl Effort {
    /// The share of all nodes that reinsertion looks at in a round. Ten times as many (with a search distance of 32) take
    /// ten times as long for rays 5 to 15 % faster.
    fn reinsertion_ratio(self) -> f32 {
        if self == Effort::Least { 0.0 } else { 0.1 }
    }
}

/// Memory that is used again from one tree to the next.
#[derive(Default)]
pub struct Workspace {
    boxes: Vec<Aabb>,
    ploc: PlocBuilder,
    bvh: Bvh2,
    optimizer: ReinsertionOptimizer,
}

/// Builds the tree over at least one primitive.
pub fn build(primitives: &[Primitive], space: &Space, effort: Effort, workspace: &mut Workspace) -> Binary {
    let Workspace { boxes, ploc, bvh, optimizer } = workspace;
    space.boxes(primitives, boxes);
    let ids = (0..primitives.len() as u32).collect();
    // By their numbers: the search distances that obvhs names bring code for six of them.
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
    order(bvh, primitives)
}

/// Inner nodes that a random ray through the root visits: the sum of areas over that of the root.
fn expected_visits(bvh: &Bvh2) -> f64 {
    let Some(root) = bvh.nodes.first() else { return 0.0 };
    let sum: f64 = bvh.nodes.iter().filter(|n| !n.is_leaf()).map(|n| f64::from(n.aabb().half_area())).sum();
    sum / f64::from(root.aabb().half_area()).max(f64::MIN_POSITIVE)
}

/// Depth-first order with the exact boxes of the primitives.
fn order(bvh: &Bvh2, primitives: &[Primitive]) -> Binary {
    let count = bvh.nodes.len();
    let mut binary = Binary {
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
