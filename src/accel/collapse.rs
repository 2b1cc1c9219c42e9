//! Which nodes of the binary tree become nodes and leaves of the 8-wide one: the choice of least expected cost, by
//! dynamic programming (Ylitie, Karras, Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
//! BVHs", section 3.2), with leaves that cost by the packet.

use super::binary::Binary;
use super::gather::{Kind, Primitive};
use super::layout::CURVES;
use crate::math::Bounds3;
use rayon::prelude::*;

/// Children of a node.
pub const WIDTH: usize = 8;

/// Costs in units of one node visit, as measured.
const COST_NODE: f32 = 1.0;
const COST_LEAF: f32 = 0.2;
const COST_TRIANGLES: f32 = 0.6;
const COST_SPHERES: f32 = 1.5;
const COST_CURVES: f32 = 1.5;
const COST_INSTANCE: f32 = 3.0;
/// Lanes of the longest leaf that is chosen.
pub const MAX_LANES: u32 = 16;

/// The choice for one binary node.
#[derive(Clone, Copy, Default)]
struct Choice {
    /// Least cost as one child of a wide node, and as at most 2, 3, ... 7 children.
    cost: [f32; WIDTH - 1],
    /// For 2 to 7 children: how many go to the left; 0: as with one child less.
    left: [u8; WIDTH - 1],
    /// For a wide node of its own: how many of its 8 children go to the left; 0: it is a leaf.
    left_of_node: u8,
    /// Lanes of triangles, analytic shapes, curves and instances below, up to 255.
    lanes: [u8; 4],
}

/// A tree that is written.
#[derive(Clone, Copy, Debug)]
pub struct Piece {
    /// Where it starts.
    pub root: u32,
    /// Wide nodes on the longest path.
    pub depth: usize,
    /// The box around it.
    pub bounds: Bounds3,
    /// Its expected cost.
    pub cost: f32,
}

/// All choices.
pub struct Collapse {
    choices: Vec<Choice>,
}

/// Subtrees above this size are handled by several threads.
const PARALLEL: u32 = 8192;

impl Collapse {
    /// Chooses for the whole tree.
    pub fn new(binary: &Binary, primitives: &[Primitive], pieces: &[Piece]) -> Collapse {
        let mut choices = vec![Choice::default(); binary.size.len()];
        let (tops, subtrees) = cut(binary, PARALLEL);
        let mut parts = Vec::with_capacity(subtrees.len());
        let mut rest = choices.as_mut_slice();
        let mut at = 0;
        for &root in &subtrees {
            let size = binary.size[root] as usize;
            let (part, after) = rest.split_at_mut(root - at).1.split_at_mut(size);
            parts.push((root, part));
            rest = after;
            at = root + size;
        }
        parts.into_par_iter().for_each(|(root, part)| {
            for i in (0..part.len()).rev() {
                part[i] = choose(binary, primitives, pieces, root + i, |child| &part[child - root]);
            }
        });
        for &top in tops.iter().rev() {
            choices[top] = choose(binary, primitives, pieces, top, |child| &choices[child]);
        }
        Collapse { choices }
    }

    /// Does the node become a leaf where it is one child?
    pub fn is_leaf(&self, node: usize) -> bool {
        self.choices[node].left_of_node == 0
    }

    /// The least expected cost of the whole tree as one child.
    pub fn cost(&self) -> f32 {
        self.choices[0].cost[0]
    }

    /// Lanes of triangles, analytic shapes, curves and instances below a node (up to 255).
    pub fn lanes(&self, node: usize) -> [u8; 4] {
        self.choices[node].lanes
    }

    /// The binary nodes that become the children of a wide node.
    pub fn children(&self, binary: &Binary, node: usize) -> ([usize; WIDTH], usize) {
        let mut children = [0; WIDTH];
        let mut count = 0;
        let mut stack = [(0usize, 0usize); WIDTH + 1];
        let mut depth = 0;
        let split =
            |node: usize, left: usize, all: usize, depth: &mut usize, stack: &mut [(usize, usize)]| {
                let (l, r) = binary.children(node);
                stack[*depth] = (r, all - left);
                stack[*depth + 1] = (l, left);
                *depth += 2;
            };
        split(node, usize::from(self.choices[node].left_of_node), WIDTH, &mut depth, &mut stack);
        while depth > 0 {
            depth -= 1;
            let (node, mut slots) = stack[depth];
            let choice = &self.choices[node];
            while slots > 1 && choice.left[slots - 1] == 0 {
                slots -= 1;
            }
            if slots == 1 {
                children[count] = node;
                count += 1;
            } else {
                split(node, usize::from(choice.left[slots - 1]), slots, &mut depth, &mut stack);
            }
        }
        (children, count)
    }
}

/// Splits a tree into the nodes near the root, in order, and the subtrees of at most `limit` nodes below, in order.
pub fn cut(binary: &Binary, limit: u32) -> (Vec<usize>, Vec<usize>) {
    let (mut tops, mut subtrees) = (Vec::new(), Vec::new());
    let mut stack = vec![0];
    while let Some(node) = stack.pop() {
        if binary.size[node] <= limit {
            subtrees.push(node);
        } else {
            tops.push(node);
            let (left, right) = binary.children(node);
            stack.push(right);
            stack.push(left);
        }
    }
    (tops, subtrees)
}

fn choose<'a>(
    binary: &Binary,
    primitives: &[Primitive],
    pieces: &[Piece],
    node: usize,
    choice: impl Fn(usize) -> &'a Choice,
) -> Choice {
    let extent = binary.bounds[node].extent();
    let area = extent.x * (extent.y + extent.z) + extent.y * extent.z;
    if binary.is_leaf(node) {
        let primitive = &primitives[binary.primitive[node] as usize];
        if primitive.kind == Kind::Piece {
            let cost = pieces[primitive.id as usize].cost;
            return Choice {
                cost: [cost; WIDTH - 1],
                lanes: [u8::MAX; 4],
                left_of_node: 1,
                ..Choice::default()
            };
        }
        let lanes = match primitive.kind {
            Kind::Triangle => [1, 0, 0, 0],
            Kind::Quad => [2, 0, 0, 0],
            Kind::Analytic => [0, 1, 0, 0],
            Kind::Curve => [0, 0, 1, 0],
            _ => [0, 0, 0, 1],
        };
        return Choice { cost: [leaf_cost(area, lanes); WIDTH - 1], lanes, ..Choice::default() };
    }
    let (left, right) = binary.children(node);
    let (l, r) = (choice(left), choice(right));
    let lanes = std::array::from_fn(|k| l.lanes[k].saturating_add(r.lanes[k]));
    let (least, left) = splits(&l.cost, &r.cost);
    let (below, left_of_node) = (least[WIDTH - 1], left[WIDTH - 1] as u8);
    let as_node = area * COST_NODE + below;
    let total: u32 = lanes.iter().map(|n| u32::from(*n)).sum();
    let as_leaf = if total <= MAX_LANES { leaf_cost(area, lanes) } else { f32::INFINITY };
    let mut chosen = Choice { lanes, ..Choice::default() };
    (chosen.cost[0], chosen.left_of_node) =
        if as_leaf <= as_node { (as_leaf, 0) } else { (as_node, left_of_node) };
    for slots in 2..WIDTH {
        let is_better = least[slots - 1] < chosen.cost[slots - 2];
        (chosen.cost[slots - 1], chosen.left[slots - 1]) =
            if is_better { (least[slots - 1], left[slots - 1] as u8) } else { (chosen.cost[slots - 2], 0) };
    }
    chosen
}

/// The least cost of two nodes as 1 (infinite), 2, ... 8 children together, and how many of these are the left one's: of
/// equal ones the fewest. (All numbers of children at once, which the compiler makes vectors of.)
#[inline(always)]
fn splits(left: &[f32; WIDTH - 1], right: &[f32; WIDTH - 1]) -> ([f32; WIDTH], [u32; WIDTH]) {
    let mut shifted = [f32::INFINITY; 2 * WIDTH];
    shifted[WIDTH..2 * WIDTH - 1].copy_from_slice(right);
    let (mut least, mut of_left) = ([f32::INFINITY; WIDTH], [1; WIDTH]);
    for k in 1..WIDTH {
        let right: [f32; WIDTH] = std::array::from_fn(|i| shifted[WIDTH - k + i]);
        for i in 0..WIDTH {
            let cost = left[k - 1] + right[i];
            let is_better = cost < least[i];
            least[i] = if is_better { cost } else { least[i] };
            of_left[i] = if is_better { k as u32 } else { of_left[i] };
        }
    }
    (least, of_left)
}

fn leaf_cost(area: f32, lanes: [u8; 4]) -> f32 {
    let packets = |n: u8| f32::from(n.div_ceil(4));
    let cost = COST_LEAF
        + COST_TRIANGLES * packets(lanes[0])
        + COST_SPHERES * packets(lanes[1])
        + COST_CURVES * f32::from(lanes[2].div_ceil(CURVES as u8))
        + COST_INSTANCE * f32::from(lanes[3]);
    area * cost
}
