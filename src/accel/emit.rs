//! Writes the wide tree into cache lines, depth first. Places are given out in one pass over the wide nodes; then all
//! nodes, each with the packets of its leaves right behind it, are written in parallel.

use super::binary::Binary;
use super::collapse::Collapse;
use super::gather::{Kind, Primitive, triangle_vertices};
use super::input::Geometry;
use super::layout::{
    AnalyticPacket, DONE, InstanceRecord, KIND_ANALYTIC, KIND_INSTANCE, KIND_TRIANGLES, LEAF, NODE_LINES,
    Node, PART_QUAD_FIRST, PART_QUAD_SECOND, PART_TRIANGLE, TrianglePacket, leaf_ref, view_mut,
};
use crate::math::{Bounds3, Vec3};
use crate::shape::triangle::LANES;
use crate::simd::{Line, reserve_lines};
use rayon::prelude::*;

/// What is written.
pub struct Emit<'a> {
    /// The binary tree.
    pub binary: &'a Binary,
    /// Which of its nodes become wide ones.
    pub collapse: &'a Collapse,
    /// What its leaves refer to.
    pub primitives: &'a [Primitive],
    /// Where vertices, quads and analytic shapes come from.
    pub geometry: &'a Geometry,
    /// Records of the instances, by index.
    pub instances: &'a [InstanceRecord],
}

/// A written tree.
#[derive(Clone, Copy, Debug)]
pub struct Emitted {
    /// Where to start.
    pub root: u32,
    /// Wide nodes on the longest path.
    pub depth: usize,
}

/// A wide node: the binary node that it stands for, and where it is written.
#[derive(Clone, Copy)]
struct Place {
    node: u32,
    line: usize,
}

/// Wide nodes that a thread writes at a time.
const CHUNK: usize = 512;

impl Emit<'_> {
    /// Appends the whole tree to `lines`.
    pub fn write(&self, lines: &mut Vec<Line>) -> Emitted {
        let start = lines.len();
        if self.collapse.is_leaf(0) {
            let prims = self.leaf_primitives(0);
            lines.resize(start + packet_lines(&self.count(&prims)), Line::ZERO);
            let root = self.write_leaf(&mut lines[start..], start, &prims);
            return Emitted { root, depth: 1 };
        }
        let (places, line_of_node, depth) = self.places(start);
        let end = places.last().map_or(start, |last| last.line + self.lines_of(last.node as usize));
        reserve_lines(lines, end - start);
        lines.resize(end, Line::ZERO);
        let mut jobs = Vec::with_capacity(places.len() / CHUNK + 1);
        let mut rest = &mut lines[start..];
        for chunk in 0..places.len().div_ceil(CHUNK) {
            let own = &places[chunk * CHUNK..places.len().min((chunk + 1) * CHUNK)];
            let next = places.get((chunk + 1) * CHUNK).map_or(end, |place| place.line);
            let (region, after) = rest.split_at_mut(next - own[0].line);
            jobs.push((own, region));
            rest = after;
        }
        jobs.into_par_iter().for_each(|(own, region)| {
            let base = own[0].line;
            for place in own {
                self.write_node(&mut region[place.line - base..], *place, &line_of_node);
            }
        });
        Emitted { root: start as u32, depth }
    }

    /// All wide nodes in depth-first order, the line of each binary node that became one, and the tree's depth.
    fn places(&self, start: usize) -> (Vec<Place>, Vec<u32>, usize) {
        let mut line_of_node = vec![0u32; self.binary.size.len()];
        let mut places = Vec::new();
        let mut line = start;
        let mut deepest = 0;
        let mut stack = vec![(0usize, 1usize)];
        while let Some((node, depth)) = stack.pop() {
            deepest = deepest.max(depth + 1);
            places.push(Place { node: node as u32, line });
            line_of_node[node] = line as u32;
            line += self.lines_of(node);
            let (children, count) = self.collapse.children(self.binary, node);
            stack.extend(
                children[..count]
                    .iter()
                    .rev()
                    .filter(|c| !self.collapse.is_leaf(**c))
                    .map(|c| (*c, depth + 1)),
            );
        }
        (places, line_of_node, deepest)
    }

    /// Lines of a wide node and of the packets of its leaves.
    fn lines_of(&self, node: usize) -> usize {
        let (children, count) = self.collapse.children(self.binary, node);
        let leaves = children[..count].iter().filter(|c| self.collapse.is_leaf(**c));
        NODE_LINES + leaves.map(|c| packet_lines(&self.collapse.lanes(*c))).sum::<usize>()
    }

    fn write_node(&self, region: &mut [Line], place: Place, line_of_node: &[u32]) {
        let mut node = Node {
            planes: std::array::from_fn(|k| [if k % 2 == 0 { f32::INFINITY } else { f32::NEG_INFINITY }; 8]),
            child: [DONE; 8],
            padding: [0; 8],
        };
        let (children, count) = self.collapse.children(self.binary, place.node as usize);
        let mut offset = NODE_LINES;
        for (lane, child) in children[..count].iter().enumerate() {
            let Bounds3 { min, max } = self.binary.bounds[*child];
            for axis in 0..3 {
                node.planes[2 * axis][lane] = min[axis];
                node.planes[2 * axis + 1][lane] = max[axis];
            }
            node.child[lane] = if self.collapse.is_leaf(*child) {
                let prims = self.leaf_primitives(*child);
                let reference = self.write_leaf(&mut region[offset..], place.line + offset, &prims);
                offset += packet_lines(&self.count(&prims));
                reference
            } else {
                line_of_node[*child]
            };
        }
        *view_mut(region, 0) = node;
    }

    /// The primitives below a binary node, by kind and id.
    fn leaf_primitives(&self, node: usize) -> Vec<&Primitive> {
        let range = node..node + self.binary.size[node] as usize;
        let mut prims: Vec<&Primitive> = range
            .filter(|i| self.binary.is_leaf(*i))
            .map(|i| &self.primitives[self.binary.primitive[i] as usize])
            .collect();
        prims.sort_unstable_by_key(|p| (p.kind as u32, p.id));
        prims
    }

    /// Lanes of triangles, analytic shapes and instances.
    fn count(&self, prims: &[&Primitive]) -> [u8; 3] {
        let mut lanes = [0; 3];
        for prim in prims {
            match prim.kind {
                Kind::Triangle => lanes[0] += 1,
                Kind::Quad => lanes[0] += 2,
                Kind::Analytic => lanes[1] += 1,
                Kind::Instance => lanes[2] += 1,
            }
        }
        lanes
    }

    /// Writes the packets of a leaf to the start of `region`, which is line `base` of the buffer.
    fn write_leaf(&self, region: &mut [Line], base: usize, prims: &[&Primitive]) -> u32 {
        let mut triangles: Vec<([Vec3; 3], u32, u32)> = Vec::new();
        let mut analytic: Vec<u32> = Vec::new();
        let mut instances: Vec<u32> = Vec::new();
        for prim in prims {
            match prim.kind {
                Kind::Triangle => {
                    let vertices = triangle_vertices(self.geometry, prim.id as usize);
                    triangles.extend(vertices.map(|v| (v, prim.id, PART_TRIANGLE)));
                }
                Kind::Quad => {
                    let quad = &self.geometry.quads[prim.id as usize - self.geometry.triangles.len()];
                    let [a, b, c, d] = quad.corners();
                    triangles.push(([a, b, c], prim.id, PART_QUAD_FIRST));
                    triangles.push(([a, c, d], prim.id, PART_QUAD_SECOND));
                }
                Kind::Analytic => analytic.push(prim.id),
                Kind::Instance => instances.push(prim.id),
            }
        }
        let lanes = [triangles.len(), analytic.len(), instances.len()].map(|n| n as u8);
        let references = packet_references(&lanes, base);
        let next = |i: usize| references.get(i + 1).copied().unwrap_or(DONE);
        let mut written = 0;
        let at = |written: usize| (references[written] & !LEAF & 0x1fff_ffff) as usize - base;
        for four in triangles.chunks(LANES) {
            *view_mut(region, at(written)) = triangle_packet(four, next(written));
            written += 1;
        }
        for four in analytic.chunks(LANES) {
            *view_mut(region, at(written)) = self.analytic_packet(four, next(written));
            written += 1;
        }
        for instance in instances {
            let record = self.instances[instance as usize];
            *view_mut(region, at(written)) = InstanceRecord { next: next(written), ..record };
            written += 1;
        }
        references.first().copied().unwrap_or(DONE)
    }

    fn analytic_packet(&self, ids: &[u32], next: u32) -> AnalyticPacket {
        let first = self.geometry.triangles.len() + self.geometry.quads.len();
        let mut packet = AnalyticPacket {
            numbers: [[0.0; 6]; LANES],
            id: [u32::MAX; LANES],
            kind: [0; LANES],
            next,
            padding: [0; 2],
        };
        for (lane, id) in ids.iter().enumerate() {
            let packed = self.geometry.analytic[*id as usize - first].pack();
            (packet.kind[lane], packet.numbers[lane]) = (packed.kind, packed.numbers);
            packet.id[lane] = *id;
        }
        packet
    }
}

fn triangle_packet(triangles: &[([Vec3; 3], u32, u32)], next: u32) -> TrianglePacket {
    let mut packet = TrianglePacket::empty();
    packet.rows[11] = [f32::from_bits(next); LANES];
    for (lane, (vertices, id, part)) in triangles.iter().enumerate() {
        for (k, vertex) in vertices.iter().enumerate() {
            for axis in 0..3 {
                packet.rows[4 * axis + k][lane] = vertex[axis];
            }
        }
        packet.rows[3][lane] = f32::from_bits(*id);
        packet.rows[7][lane] = f32::from_bits(*part);
    }
    packet
}

/// Lines of each kind of packet, and their kinds.
const KINDS: [(u32, usize, usize); 3] =
    [(KIND_TRIANGLES, LANES, 3), (KIND_ANALYTIC, LANES, 2), (KIND_INSTANCE, 1, 1)];

/// Lines of the packets for so many lanes of triangles, analytic shapes and instances.
fn packet_lines(lanes: &[u8; 3]) -> usize {
    KINDS.iter().zip(lanes).map(|((_, per, lines), n)| usize::from(*n).div_ceil(*per) * lines).sum()
}

/// References to the packets of a leaf that starts at line `base`, in order.
fn packet_references(lanes: &[u8; 3], base: usize) -> Vec<u32> {
    let mut line = base;
    let mut references = Vec::new();
    for ((kind, per, lines), n) in KINDS.iter().zip(lanes) {
        for _ in 0..usize::from(*n).div_ceil(*per) {
            references.push(leaf_ref(*kind, line));
            line += lines;
        }
    }
    references
}
