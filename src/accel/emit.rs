//! Writes the wide tree into cache lines, depth first. Places are given out in one pass over the wide nodes; then all
//! nodes, each with the packets of its leaves right behind it, are written in parallel.

use super::append::Full;
use super::binary::Binary;
use super::collapse::{Collapse, MAX_LANES, Piece};
use super::gather::{Kind, Primitive, triangle_vertices};
use super::input::Geometry;
use super::layout::{
    ANALYTIC_LINES, AnalyticPacket, CURVES, CurvePacket, DONE, INSTANCE_LINES, InstanceRecord, KIND_ANALYTIC,
    KIND_INSTANCE, KIND_TRIANGLES, MAX_LINE, NODE_LINES, Node, PART_QUAD_FIRST, PART_QUAD_SECOND,
    PART_TRIANGLE, TRIANGLE_LINES, TrianglePacket, leaf_ref, line_of, view_mut,
};
use super::motion;
use crate::math::{Bounds3, Vec3};
use crate::shape::triangle::LANES;
use crate::simd::{Line, reserve_lines};
use rayon::prelude::*;

/// Where primitives come from.
#[derive(Clone, Copy)]
pub struct Shapes<'a> {
    /// Vertices, quads and analytic shapes.
    pub geometry: &'a Geometry,
    /// Records of the instances, by index.
    pub records: &'a [InstanceRecord],
}

/// What is written.
pub struct Emit<'a> {
    /// The binary tree.
    pub binary: &'a Binary,
    /// Which of its nodes become wide ones.
    pub collapse: &'a Collapse,
    /// What its leaves refer to.
    pub primitives: &'a [Primitive],
    /// What these stand for.
    pub shapes: Shapes<'a>,
    /// Pieces of the tree that are written already, by index.
    pub pieces: &'a [Piece],
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

/// Makes room for lines up to `end`.
fn make_room(lines: &mut Vec<Line>, end: usize) -> Result<(), Full> {
    if end > MAX_LINE {
        return Err(Full);
    }
    reserve_lines(lines, end - lines.len());
    Ok(())
}

impl Emit<'_> {
    /// Appends the whole tree to `lines`.
    pub fn write(&self, lines: &mut Vec<Line>) -> Result<Emitted, Full> {
        let start = lines.len();
        if self.collapse.is_leaf(0) {
            let end = start + self.shapes.packet_lines(&self.collapse.lanes(0));
            make_room(lines, end)?;
            lines.resize(end, Line::ZERO);
            let (root, _) = self.write_leaf(&mut lines[start..], start, 0);
            return Ok(Emitted { root, depth: 1 });
        }
        let (places, line_of_node, depth, end) = self.places(start);
        make_room(lines, end)?;
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
        Ok(Emitted { root: start as u32, depth })
    }

    /// All wide nodes in depth-first order, the line of each binary node that became one, the tree's depth, and the line
    /// after it.
    fn places(&self, start: usize) -> (Vec<Place>, Vec<u32>, usize, usize) {
        let mut line_of_node = vec![0u32; self.binary.size.len()];
        let mut places = Vec::new();
        let mut line = start;
        let mut deepest = 0;
        let mut stack = vec![(0usize, 1usize)];
        while let Some((node, depth)) = stack.pop() {
            deepest = deepest.max(depth + 1);
            places.push(Place { node: node as u32, line });
            line_of_node[node] = line as u32;
            let (children, count) = self.collapse.children(self.binary, node);
            line += self.lines_of(&children[..count]);
            let is_node = |c: &&usize| !self.collapse.is_leaf(**c) && !self.binary.is_leaf(**c);
            stack.extend(children[..count].iter().rev().filter(is_node).map(|c| (*c, depth + 1)));
        }
        (places, line_of_node, deepest, line)
    }

    /// Lines of a wide node with these children and of the packets of its leaves.
    fn lines_of(&self, children: &[usize]) -> usize {
        let leaves = children.iter().filter(|c| self.collapse.is_leaf(**c));
        NODE_LINES + leaves.map(|c| self.shapes.packet_lines(&self.collapse.lanes(*c))).sum::<usize>()
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
                let (reference, lines) = self.write_leaf(&mut region[offset..], place.line + offset, *child);
                offset += lines;
                reference
            } else if self.binary.is_leaf(*child) {
                self.pieces[self.primitives[self.binary.primitive[*child] as usize].id as usize].root
            } else {
                line_of_node[*child]
            };
        }
        *view_mut(region, 0) = node;
    }

    /// The primitives below a binary node, by kind and id.
    fn leaf_primitives(&self, node: usize) -> Few<&Primitive> {
        let mut prims = Few::of(&self.primitives[0]);
        for i in node..node + self.binary.size[node] as usize {
            if self.binary.is_leaf(i) {
                prims.push(&self.primitives[self.binary.primitive[i] as usize]);
            }
        }
        prims.items[..prims.count].sort_unstable_by_key(|p| (p.kind as u32, p.id));
        prims
    }

    /// Writes the packets of a leaf to the start of `region`, which is line `base` of the buffer, and returns its reference
    /// and their lines.
    fn write_leaf(&self, region: &mut [Line], base: usize, node: usize) -> (u32, usize) {
        let mut triangles = Few::of(([Vec3::ZERO; 3], 0, PART_TRIANGLE));
        let (mut analytic, mut curves, mut instances) = (Few::of(0), Few::of(0), Few::of(0));
        for prim in self.leaf_primitives(node).as_slice() {
            match prim.kind {
                Kind::Triangle => {
                    if let Some(vertices) = triangle_vertices(self.shapes.geometry, prim.id as usize) {
                        triangles.push((vertices, prim.id, PART_TRIANGLE));
                    }
                }
                Kind::Quad => {
                    let geometry = self.shapes.geometry;
                    let [a, b, c, d] = geometry.quads[prim.id as usize - geometry.triangles.len()].corners();
                    triangles.push(([a, b, c], prim.id, PART_QUAD_FIRST));
                    triangles.push(([a, c, d], prim.id, PART_QUAD_SECOND));
                }
                Kind::Analytic => analytic.push(prim.id),
                Kind::Curve => curves.push(prim.id),
                _ => instances.push(prim.id),
            }
        }
        let lanes = [triangles.count, analytic.count, curves.count, instances.count].map(|n| n as u8);
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
        for two in curves.as_slice().chunks(CURVES) {
            *view_mut(region, at(written)) = self.curve_packet(two, next(written));
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
            numbers: [[0.0; 6]; LANES],
            id: [u32::MAX; LANES],
            kind: [0; LANES],
            next,
            padding: [0; 2],
        };
        for (lane, id) in ids.iter().enumerate() {
            let packed = self.shapes.geometry.analytic[*id as usize - first].pack();
            (packet.kind[lane], packet.numbers[lane]) = (packed.kind, packed.numbers);
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
}

impl Shapes<'_> {
    /// Lines of each kind of packet, and their kinds.
    fn kinds(&self) -> [(u32, usize, usize); 4] {
        let triangles = match self.geometry.keys.len() {
            0 => (KIND_TRIANGLES, LANES, TRIANGLE_LINES),
            keys => (KIND_ANALYTIC, LANES, ANALYTIC_LINES + keys * TRIANGLE_LINES),
        };
        [
            triangles,
            (KIND_ANALYTIC, LANES, ANALYTIC_LINES),
            (KIND_ANALYTIC, CURVES, ANALYTIC_LINES),
            (KIND_INSTANCE, 1, INSTANCE_LINES),
        ]
    }

    /// Lines of the packets for so many lanes of triangles, analytic shapes, curves and instances.
    fn packet_lines(&self, lanes: &[u8; 4]) -> usize {
        self.kinds()
            .iter()
            .zip(lanes)
            .map(|((_, per, lines), n)| usize::from(*n).div_ceil(*per) * lines)
            .sum()
    }

    /// References to the packets of a leaf that starts at line `base`, in order.
    fn packet_references(&self, lanes: &[u8; 4], base: usize) -> Few<u32> {
        let mut line = base;
        let mut references = Few::of(DONE);
        for ((kind, per, lines), n) in self.kinds().iter().zip(lanes) {
            for _ in 0..usize::from(*n).div_ceil(*per) {
                references.push(leaf_ref(*kind, line));
                line += lines;
            }
        }
        references
    }
}

/// What belongs to one leaf: as many as a leaf may have lanes.
struct Few<T> {
    items: [T; MAX_LANES as usize],
    count: usize,
}

impl<T: Copy> Few<T> {
    /// None yet; `filler` fills unused places.
    fn of(filler: T) -> Few<T> {
        Few { items: [filler; MAX_LANES as usize], count: 0 }
    }

    fn push(&mut self, item: T) {
        self.items[self.count] = item;
        self.count += 1;
    }

    fn as_slice(&self) -> &[T] {
        &self.items[..self.count]
    }
}
