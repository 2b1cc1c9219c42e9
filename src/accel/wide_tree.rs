//! The 8-wide BVH. [`Collapse`] chooses the nodes of the binary tree that become wide nodes and leaves, at minimum SAH cost by
//! dynamic programming (Ylitie, Karras, Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs",
//! section 3.2), with leaf costs by packet. [`TreeWriter`] writes the tree to cache lines in depth-first order: one pass assigns
//! lines to nodes, then several threads write nodes, each followed by the packets of its leaves.

use super::binary_tree::BinaryTree;
use super::input::{Geometry, Primitive, PrimitiveKind, triangle_vertices};
use super::layout::{
    ANALYTIC_LINES, AnalyticPacket, BufferFull, CURVE_LANES, CurvePacket, DONE, INSTANCE_LINES,
    InstanceRecord, KIND_ANALYTIC, KIND_INSTANCE, KIND_TRIANGLES, MAX_LINE, NODE_LINES, Node,
    PART_QUAD_FIRST, PART_QUAD_SECOND, PART_TRIANGLE, SPLAT_LINES, SplatPacket, TRIANGLE_LINES,
    TrianglePacket, leaf_ref, line_of, view_mut,
};
use super::motion;
use crate::math::{Bounds3, Vec3};
use crate::shape::triangle::LANES;
use crate::simd::{Line, reserve_on_huge_pages};
use rayon::prelude::*;

/// Children of a node.
pub const WIDTH: usize = 8;

/// Measured costs in units of one node visit; packets cost per packet, instances each.
const COST_NODE: f32 = 1.0;
const COST_LEAF: f32 = 0.2;
const COST_TRIANGLES: f32 = 0.6;
const COST_ANALYTIC: f32 = 1.5;
const COST_CURVES: f32 = 1.5;
const COST_SPLATS: f32 = 1.5;
const COST_INSTANCE: f32 = 3.0;
/// Maximum number of lanes in a leaf.
pub const MAX_LANES: u32 = 16;

/// Minimum expected costs of a binary node in the wide tree, and the splits that achieve them.
#[derive(Clone, Copy, Default)]
struct CollapseCosts {
    /// Cost as one child of a wide node, and as at most 2, 3, ... 7 children.
    cost: [f32; WIDTH - 1],
    /// For 2 to 7 children: number of children for the left subtree; 0: same split as with one child less.
    left: [u8; WIDTH - 1],
    /// As a wide node: number of its 8 children for the left subtree; 0: a leaf.
    left_of_node: u8,
    /// Number of lanes of triangles, analytic shapes, curves, splats and instances in the subtree; 255 or more: 255.
    lanes: [u8; 5],
}

/// A finished subtree of a chunk.
#[derive(Clone, Copy, Debug)]
pub struct Subtree {
    /// Reference to its root.
    pub root: u32,
    /// Wide nodes on the longest path.
    pub depth: usize,
    /// Bounds in the space of the tree.
    pub bounds: Bounds3,
    /// Expected cost, in units of node visits times surface area.
    pub cost: f32,
}

/// The result of the dynamic programming for all nodes of a binary tree.
pub struct Collapse {
    costs: Vec<CollapseCosts>,
}

/// Number of nodes above which a subtree is handled by several threads.
const PARALLEL: u32 = 8192;

impl Collapse {
    /// Runs the dynamic programming over the whole tree.
    pub fn new(binary: &BinaryTree, primitives: &[Primitive], finished: &[Subtree]) -> Collapse {
        let mut costs = vec![CollapseCosts::default(); binary.size.len()];
        let (tops, subtrees) = split_top(binary, PARALLEL);
        let mut parts = Vec::with_capacity(subtrees.len());
        let mut rest = costs.as_mut_slice();
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
                part[i] = choose(binary, primitives, finished, root + i, |child| &part[child - root]);
            }
        });
        for &top in tops.iter().rev() {
            costs[top] = choose(binary, primitives, finished, top, |child| &costs[child]);
        }
        Collapse { costs }
    }

    /// Whether a node becomes a leaf if it is a single child.
    pub fn is_leaf(&self, node: usize) -> bool {
        self.costs[node].left_of_node == 0
    }

    /// The minimum expected cost of the whole tree as a single child.
    pub fn cost(&self) -> f32 {
        self.costs[0].cost[0]
    }

    /// Number of lanes of triangles, analytic shapes, curves, splats and instances in a node's subtree; 255 or more: 255.
    pub fn lanes(&self, node: usize) -> [u8; 5] {
        self.costs[node].lanes
    }

    /// The binary nodes that become the children of a wide node, and their number.
    pub fn children(&self, binary: &BinaryTree, node: usize) -> ([usize; WIDTH], usize) {
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
        split(node, usize::from(self.costs[node].left_of_node), WIDTH, &mut depth, &mut stack);
        while depth > 0 {
            depth -= 1;
            let (node, mut slots) = stack[depth];
            let costs = &self.costs[node];
            while slots > 1 && costs.left[slots - 1] == 0 {
                slots -= 1;
            }
            if slots == 1 {
                children[count] = node;
                count += 1;
            } else {
                split(node, usize::from(costs.left[slots - 1]), slots, &mut depth, &mut stack);
            }
        }
        (children, count)
    }
}

/// Splits a tree into the nodes near the root and the subtrees of at most `limit` nodes below them, both in depth-first order.
fn split_top(binary: &BinaryTree, limit: u32) -> (Vec<usize>, Vec<usize>) {
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

/// The minimum costs of a node from those of its children.
fn choose<'a>(
    binary: &BinaryTree,
    primitives: &[Primitive],
    subtrees: &[Subtree],
    node: usize,
    costs_of: impl Fn(usize) -> &'a CollapseCosts,
) -> CollapseCosts {
    let extent = binary.bounds[node].extent();
    let area = extent.x * (extent.y + extent.z) + extent.y * extent.z;
    if binary.is_leaf(node) {
        let primitive = &primitives[binary.primitive[node] as usize];
        if primitive.kind == PrimitiveKind::Subtree {
            let cost = subtrees[primitive.id as usize].cost;
            return CollapseCosts {
                cost: [cost; WIDTH - 1],
                lanes: [u8::MAX; 5],
                left_of_node: 1,
                ..CollapseCosts::default()
            };
        }
        let lanes = match primitive.kind {
            PrimitiveKind::Triangle => [1, 0, 0, 0, 0],
            PrimitiveKind::Quad => [2, 0, 0, 0, 0],
            PrimitiveKind::Analytic => [0, 1, 0, 0, 0],
            PrimitiveKind::Curve => [0, 0, 1, 0, 0],
            PrimitiveKind::Splat => [0, 0, 0, 1, 0],
            _ => [0, 0, 0, 0, 1],
        };
        return CollapseCosts {
            cost: [leaf_cost(area, lanes); WIDTH - 1],
            lanes,
            ..CollapseCosts::default()
        };
    }
    let (left, right) = binary.children(node);
    let (l, r) = (costs_of(left), costs_of(right));
    let lanes = std::array::from_fn(|k| l.lanes[k].saturating_add(r.lanes[k]));
    let (least, left) = splits(&l.cost, &r.cost);
    let (below, left_of_node) = (least[WIDTH - 1], left[WIDTH - 1] as u8);
    let as_node = area * COST_NODE + below;
    let total: u32 = lanes.iter().map(|n| u32::from(*n)).sum();
    let as_leaf = if total <= MAX_LANES { leaf_cost(area, lanes) } else { f32::INFINITY };
    let mut chosen = CollapseCosts { lanes, ..CollapseCosts::default() };
    (chosen.cost[0], chosen.left_of_node) =
        if as_leaf <= as_node { (as_leaf, 0) } else { (as_node, left_of_node) };
    for slots in 2..WIDTH {
        let is_better = least[slots - 1] < chosen.cost[slots - 2];
        (chosen.cost[slots - 1], chosen.left[slots - 1]) =
            if is_better { (least[slots - 1], left[slots - 1] as u8) } else { (chosen.cost[slots - 2], 0) };
    }
    chosen
}

/// The minimum cost of two siblings as 1 (infinite), 2, ... 8 children together, and the number of children for the left one (the
/// smallest of equally good ones). Written so that the compiler vectorises over the number of children.
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

fn leaf_cost(area: f32, lanes: [u8; 5]) -> f32 {
    let packets = |n: u8| f32::from(n.div_ceil(4));
    let cost = COST_LEAF
        + COST_TRIANGLES * packets(lanes[0])
        + COST_ANALYTIC * packets(lanes[1])
        + COST_CURVES * f32::from(lanes[2].div_ceil(CURVE_LANES as u8))
        + COST_SPLATS * packets(lanes[3])
        + COST_INSTANCE * f32::from(lanes[4]);
    area * cost
}

/// The geometry and instances that primitives refer to.
#[derive(Clone, Copy)]
pub struct ShapeSource<'a> {
    /// Vertices, quads and analytic shapes.
    pub geometry: &'a Geometry,
    /// Records of the instances, by index.
    pub records: &'a [InstanceRecord],
}

/// Writes a wide tree.
pub struct TreeWriter<'a> {
    /// The binary tree.
    pub binary: &'a BinaryTree,
    /// The nodes that become wide nodes and leaves.
    pub collapse: &'a Collapse,
    /// Primitives of the binary tree's leaves.
    pub primitives: &'a [Primitive],
    /// The shapes that the ids refer to.
    pub shapes: ShapeSource<'a>,
    /// Finished subtrees, by index.
    pub subtrees: &'a [Subtree],
}

#[derive(Clone, Copy, Debug)]
pub struct WrittenTree {
    /// Reference to its root.
    pub root: u32,
    /// Wide nodes on the longest path.
    pub depth: usize,
}

/// A wide node: index of its binary node, and its first line.
#[derive(Clone, Copy)]
struct NodePlacement {
    node: u32,
    line: usize,
}

/// Wide nodes per parallel task.
const CHUNK: usize = 512;

/// Reserves memory for lines up to `end`.
fn reserve_lines(lines: &mut Vec<Line>, end: usize) -> Result<(), BufferFull> {
    if end > MAX_LINE {
        return Err(BufferFull);
    }
    reserve_on_huge_pages(lines, end - lines.len());
    Ok(())
}

impl TreeWriter<'_> {
    /// Appends the whole tree to `lines`.
    pub fn write(&self, lines: &mut Vec<Line>) -> Result<WrittenTree, BufferFull> {
        let start = lines.len();
        if self.collapse.is_leaf(0) {
            let end = start + self.shapes.packet_lines(&self.collapse.lanes(0));
            reserve_lines(lines, end)?;
            lines.resize(end, Line::ZERO);
            let (root, _) = self.write_leaf(&mut lines[start..], start, 0);
            return Ok(WrittenTree { root, depth: 1 });
        }
        let (placements, line_of_node, depth, end) = self.placements(start);
        reserve_lines(lines, end)?;
        lines.resize(end, Line::ZERO);
        let mut jobs = Vec::with_capacity(placements.len() / CHUNK + 1);
        let mut rest = &mut lines[start..];
        for chunk in 0..placements.len().div_ceil(CHUNK) {
            let own = &placements[chunk * CHUNK..placements.len().min((chunk + 1) * CHUNK)];
            let next = placements.get((chunk + 1) * CHUNK).map_or(end, |placement| placement.line);
            let (region, after) = rest.split_at_mut(next - own[0].line);
            jobs.push((own, region));
            rest = after;
        }
        jobs.into_par_iter().for_each(|(own, region)| {
            let base = own[0].line;
            for placement in own {
                self.write_node(&mut region[placement.line - base..], *placement, &line_of_node);
            }
        });
        Ok(WrittenTree { root: start as u32, depth })
    }

    /// All wide nodes in depth-first order, the line of each binary node that becomes a wide node, the tree's depth, and the end line.
    fn placements(&self, start: usize) -> (Vec<NodePlacement>, Vec<u32>, usize, usize) {
        let mut line_of_node = vec![0u32; self.binary.size.len()];
        let mut placements = Vec::new();
        let mut line = start;
        let mut deepest = 0;
        let mut stack = vec![(0usize, 1usize)];
        while let Some((node, depth)) = stack.pop() {
            deepest = deepest.max(depth + 1);
            placements.push(NodePlacement { node: node as u32, line });
            line_of_node[node] = line as u32;
            let (children, count) = self.collapse.children(self.binary, node);
            line += self.lines_of(&children[..count]);
            let is_node = |c: &&usize| !self.collapse.is_leaf(**c) && !self.binary.is_leaf(**c);
            stack.extend(children[..count].iter().rev().filter(is_node).map(|c| (*c, depth + 1)));
        }
        (placements, line_of_node, deepest, line)
    }

    /// Number of lines of a wide node and the packets of its leaf children.
    fn lines_of(&self, children: &[usize]) -> usize {
        let leaves = children.iter().filter(|c| self.collapse.is_leaf(**c));
        NODE_LINES + leaves.map(|c| self.shapes.packet_lines(&self.collapse.lanes(*c))).sum::<usize>()
    }

    fn write_node(&self, region: &mut [Line], placement: NodePlacement, line_of_node: &[u32]) {
        let mut node = Node {
            planes: std::array::from_fn(|k| [if k % 2 == 0 { f32::INFINITY } else { f32::NEG_INFINITY }; 8]),
            child: [DONE; 8],
            padding: [0; 8],
        };
        let (children, count) = self.collapse.children(self.binary, placement.node as usize);
        let mut offset = NODE_LINES;
        for (lane, child) in children[..count].iter().enumerate() {
            let Bounds3 { min, max } = self.binary.bounds[*child];
            for axis in 0..3 {
                node.planes[2 * axis][lane] = min[axis];
                node.planes[2 * axis + 1][lane] = max[axis];
            }
            node.child[lane] = if self.collapse.is_leaf(*child) {
                let (reference, lines) =
                    self.write_leaf(&mut region[offset..], placement.line + offset, *child);
                offset += lines;
                reference
            } else if self.binary.is_leaf(*child) {
                self.subtrees[self.primitives[self.binary.primitive[*child] as usize].id as usize].root
            } else {
                line_of_node[*child]
            };
        }
        *view_mut(region, 0) = node;
    }

    /// The primitives of a binary node's subtree, sorted by kind and id.
    fn leaf_primitives(&self, node: usize) -> LeafItems<&Primitive> {
        let mut prims = LeafItems::of(&self.primitives[0]);
        for i in node..node + self.binary.size[node] as usize {
            if self.binary.is_leaf(i) {
                prims.push(&self.primitives[self.binary.primitive[i] as usize]);
            }
        }
        prims.items[..prims.count].sort_unstable_by_key(|p| (p.kind as u32, p.id));
        prims
    }

    /// Writes the packets of a leaf to the start of `region`, which is line `base` of the buffer. Returns the leaf's reference and its
    /// number of lines.
    fn write_leaf(&self, region: &mut [Line], base: usize, node: usize) -> (u32, usize) {
        let mut triangles = LeafItems::of(([Vec3::ZERO; 3], 0, PART_TRIANGLE));
        let [mut analytic, mut curves, mut splats, mut instances] = [const { LeafItems::of(0) }; 4];
        for prim in self.leaf_primitives(node).as_slice() {
            match prim.kind {
                PrimitiveKind::Triangle => {
                    if let Some(vertices) = triangle_vertices(self.shapes.geometry, prim.id as usize) {
                        triangles.push((vertices, prim.id, PART_TRIANGLE));
                    }
                }
                PrimitiveKind::Quad => {
                    let geometry = self.shapes.geometry;
                    let [a, b, c, d] = geometry.quads[prim.id as usize - geometry.triangles.len()].corners();
                    triangles.push(([a, b, c], prim.id, PART_QUAD_FIRST));
                    triangles.push(([a, c, d], prim.id, PART_QUAD_SECOND));
                }
                PrimitiveKind::Analytic => analytic.push(prim.id),
                PrimitiveKind::Curve => curves.push(prim.id),
                PrimitiveKind::Splat => splats.push(prim.id),
                _ => instances.push(prim.id),
            }
        }
        let counts = [triangles.count, analytic.count, curves.count, splats.count, instances.count];
        let lanes = counts.map(|n| n as u8);
        let references = self.shapes.packet_references(&lanes, base);
        let next = |i: usize| if i + 1 < references.count { references.items[i + 1] } else { DONE };
        let at = |written: usize| line_of(references.items[written]) - base;
        let mut written = 0;
        for four in triangles.as_slice().chunks(LANES) {
            match self.shapes.geometry.keys.is_empty() {
                true => *view_mut(region, at(written)) = TrianglePacket::of(four, next(written)),
                false => {
                    motion::write_triangles(region, at(written), self.shapes.geometry, four, next(written))
                }
            }
            written += 1;
        }
        for four in analytic.as_slice().chunks(LANES) {
            *view_mut(region, at(written)) = self.analytic_packet(four, next(written));
            written += 1;
        }
        for two in curves.as_slice().chunks(CURVE_LANES) {
            *view_mut(region, at(written)) = self.curve_packet(two, next(written));
            written += 1;
        }
        for four in splats.as_slice().chunks(LANES) {
            *view_mut(region, at(written)) = self.splat_packet(four, next(written));
            written += 1;
        }
        for instance in instances.as_slice() {
            let record = self.shapes.records[*instance as usize];
            *view_mut(region, at(written)) = InstanceRecord { next: next(written), ..record };
            written += 1;
        }
        (if references.count == 0 { DONE } else { references.items[0] }, self.shapes.packet_lines(&lanes))
    }

    fn analytic_packet(&self, ids: &[u32], next: u32) -> AnalyticPacket {
        let first = self.shapes.geometry.triangles.len() + self.shapes.geometry.quads.len();
        let mut packet = AnalyticPacket {
            parameters: [[0.0; 6]; LANES],
            id: [u32::MAX; LANES],
            kind: [0; LANES],
            next,
            padding: [0; 2],
        };
        for (lane, id) in ids.iter().enumerate() {
            let packed = self.shapes.geometry.analytic[*id as usize - first].pack();
            (packet.kind[lane], packet.parameters[lane]) = (packed.kind, packed.parameters);
            packet.id[lane] = *id;
        }
        packet
    }

    fn curve_packet(&self, ids: &[u32], next: u32) -> CurvePacket {
        let geometry = self.shapes.geometry;
        let first = geometry.triangles.len() + geometry.quads.len() + geometry.analytic.len();
        let segments = ids.iter().map(|id| (geometry.curves.get(*id as usize - first), *id));
        CurvePacket::of(segments, next)
    }

    fn splat_packet(&self, ids: &[u32], next: u32) -> SplatPacket {
        let splats = &self.shapes.geometry.splats;
        let first = self.shapes.geometry.primitives() - splats.count();
        let valid = ids.iter().filter_map(|id| Some((splats.get(*id as usize - first)?, *id)));
        SplatPacket::of(valid, next)
    }
}

impl ShapeSource<'_> {
    /// Reference kind, lanes and lines of each type of packet.
    fn kinds(&self) -> [(u32, usize, usize); 5] {
        let triangles = match self.geometry.keys.len() {
            0 => (KIND_TRIANGLES, LANES, TRIANGLE_LINES),
            keys => (KIND_ANALYTIC, LANES, ANALYTIC_LINES + keys * TRIANGLE_LINES),
        };
        [
            triangles,
            (KIND_ANALYTIC, LANES, ANALYTIC_LINES),
            (KIND_ANALYTIC, CURVE_LANES, ANALYTIC_LINES),
            (KIND_ANALYTIC, LANES, SPLAT_LINES),
            (KIND_INSTANCE, 1, INSTANCE_LINES),
        ]
    }

    /// Number of lines for these numbers of lanes of triangles, analytic shapes, curves, splats and instances.
    fn packet_lines(&self, lanes: &[u8; 5]) -> usize {
        self.kinds()
            .iter()
            .zip(lanes)
            .map(|((_, per, lines), n)| usize::from(*n).div_ceil(*per) * lines)
            .sum()
    }

    /// References to the packets of a leaf that starts at line `base`, in order.
    fn packet_references(&self, lanes: &[u8; 5], base: usize) -> LeafItems<u32> {
        let mut line = base;
        let mut references = LeafItems::of(DONE);
        for ((kind, per, lines), n) in self.kinds().iter().zip(lanes) {
            for _ in 0..usize::from(*n).div_ceil(*per) {
                references.push(leaf_ref(*kind, line));
                line += lines;
            }
        }
        references
    }
}

/// Array of up to [`MAX_LANES`] items of a leaf.
struct LeafItems<T> {
    items: [T; MAX_LANES as usize],
    count: usize,
}

impl<T: Copy> LeafItems<T> {
    /// An empty array; `filler` fills unused entries.
    const fn of(filler: T) -> LeafItems<T> {
        LeafItems { items: [filler; MAX_LANES as usize], count: 0 }
    }

    fn push(&mut self, item: T) {
        self.items[self.count] = item;
        self.count += 1;
    }

    fn as_slice(&self) -> &[T] {
        &self.items[..self.count]
    }
}
