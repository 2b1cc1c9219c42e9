//! The tree of many primitives, built in pieces: the primitives are cut into chunks that lie apart, a tree is built over each
//! chunk and written at once, and a small tree over these joins them. Threads work on chunks side by side, what they need stays
//! in their caches, and beyond a few chunks nothing but the primitives' boxes and what is written is ever held: 32 bytes a
//! primitive and 66 to 78 of the tree, with 15 more for what two threads work on where there are 2 million triangles, and 1.5 where
//! there are 20. The README of `tools/rays` has the figures, and what was tried and lost.

use super::binary::{self, Effort, Workspace};
use super::chunks;
use super::collapse::{Collapse, Piece};
use super::emit::{Emit, Emitted, Shapes};
use super::gather::{Kind, Primitive};
use super::input::{AccelInput, TreeQuality};
use super::normalize::Space;
use super::relocate::move_references;
use crate::gauge::Gauge;
use crate::math::Bounds3;
use crate::simd::{Line, reserve_lines};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// There are at least so many chunks, where they may be no smaller than the smallest. (A thread needs some 450 bytes a
/// primitive of the chunk that it works on.)
const CHUNKS: usize = 32;
/// Primitives of the smallest and the largest chunk.
const SMALLEST: usize = 1 << 13;
const LARGEST: usize = 1 << 15;

/// A primitive is large whose box has more than this part of a chunk's share of the area of all.
const LARGE: f64 = 0.25;
/// At most one primitive of so many counts as large.
const FEW: usize = 64;

/// Lines that triangles take, at most, but for few scenes: room for them is asked for at once, since a buffer that grows is
/// there twice for a moment. (What is not written to takes no memory.)
fn room(primitives: &[Primitive]) -> usize {
    let lanes: usize = primitives.iter().map(|p| if p.kind == Kind::Triangle { 1 } else { 2 }).sum();
    lanes * 11 / 8
}

/// A piece is written behind so many lines of its own, since the first of all hold no instance (see [`DONE`]).
///
/// [`DONE`]: super::layout::DONE
const UNUSED: usize = 2;

/// Appends the tree over some primitives, and reorders these.
pub fn build(
    primitives: &mut [Primitive],
    space: &Space,
    shapes: Shapes,
    input: &AccelInput,
    lines: &mut Vec<Line>,
) -> Emitted {
    let limit = (primitives.len() / CHUNKS).clamp(SMALLEST, LARGEST);
    let count = large_to_front(primitives, space, limit);
    let (large, primitives) = primitives.split_at_mut(count);
    // In the space of a ground, the triangles of a scan that stands on it may be too small to be told apart.
    let own_space = (count > 0).then(|| Space::of(primitives));
    let space = own_space.as_ref().unwrap_or(space);
    let chunks = chunks::cut(primitives, space, limit, input.gauge);
    let effort = match input.quality {
        TreeQuality::Fast => Effort::Least,
        TreeQuality::Full => Effort::Chunk,
    };
    let pieces = Pieces { primitives, space, shapes, effort, gauge: input.gauge }.build(&chunks, lines);
    let of_piece =
        |(i, piece): (usize, &Piece)| Primitive { kind: Kind::Piece, id: i as u32, bounds: piece.bounds };
    let tops: Vec<Primitive> = pieces.iter().enumerate().map(of_piece).chain(large.iter().copied()).collect();
    let binary = binary::build(&tops, &Space::of(&tops), Effort::Most, &mut Workspace::default());
    let collapse = Collapse::new(&binary, &tops, &pieces);
    let top = Emit { binary: &binary, collapse: &collapse, primitives: &tops, shapes, pieces: &pieces };
    let Emitted { root, depth } = top.write(lines);
    let deepest = pieces.iter().map(|piece| piece.depth).max().unwrap_or(0);
    Emitted { root, depth: depth + deepest }
}

/// Moves large primitives to the front, and returns their number. In a chunk a wall would make a box as large as the room, and
/// each ray would look into it: large ones belong beside the chunks.
fn large_to_front(primitives: &mut [Primitive], space: &Space, limit: usize) -> usize {
    let area = |bounds: &Bounds3| {
        let extent = bounds.extent().as_dvec3();
        extent.x * (extent.y + extent.z) + extent.y * extent.z
    };
    let chunks = primitives.len().div_ceil(limit) as f64;
    let mut least = area(&space.bounds) * LARGE / chunks;
    loop {
        let is_large = |p: &Primitive| area(&p.bounds) > least;
        let count = primitives.par_iter().with_min_len(4096).filter(|p| is_large(p)).count();
        if count <= primitives.len() / FEW {
            return chunks::partition(primitives, is_large);
        }
        least *= 2.0;
    }
}

/// What pieces are made of.
struct Pieces<'a> {
    primitives: &'a [Primitive],
    space: &'a Space,
    shapes: Shapes<'a>,
    effort: Effort,
    /// Is told how many primitives are done.
    gauge: Option<&'a Gauge>,
}

/// Where pieces go: one behind the other in the order of their chunks, however many threads there are.
struct Output<'a> {
    lines: &'a mut Vec<Line>,
    pieces: Vec<Piece>,
    /// What was built before its turn.
    waiting: Vec<Option<(Piece, Vec<Line>)>>,
}

impl Output<'_> {
    fn put(&mut self, index: usize, piece: Piece, lines: Vec<Line>) {
        self.waiting[index] = Some((piece, lines));
        while let Some((piece, mut lines)) = self.waiting.get_mut(self.pieces.len()).and_then(Option::take) {
            let by = (self.lines.len() as u32).wrapping_sub(UNUSED as u32);
            move_references(&mut lines, piece.root, by);
            self.lines.extend_from_slice(&lines[UNUSED..]);
            self.pieces.push(Piece { root: piece.root.wrapping_add(by), ..piece });
        }
    }
}

impl Pieces<'_> {
    /// Appends the trees of the chunks.
    fn build(&self, chunks: &[Range<usize>], lines: &mut Vec<Line>) -> Vec<Piece> {
        reserve_lines(lines, room(self.primitives));
        let waiting = vec![None; chunks.len()];
        let output = Mutex::new(Output { lines, pieces: Vec::with_capacity(chunks.len()), waiting });
        let next = AtomicUsize::new(0);
        // Not a parallel loop over chunks: a thread that waits within one would begin another meanwhile.
        rayon::broadcast(|_| {
            let mut workspace = Workspace::default();
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                let Some(chunk) = chunks.get(index) else { break };
                let (piece, lines) = self.piece(&self.primitives[chunk.clone()], &mut workspace);
                output.lock().expect("no thread fails").put(index, piece, lines);
                if let Some(gauge) = self.gauge {
                    gauge.add(chunk.len() as u64);
                }
            }
        });
        output.into_inner().expect("no thread fails").pieces
    }

    /// The tree over a chunk.
    fn piece(&self, primitives: &[Primitive], workspace: &mut Workspace) -> (Piece, Vec<Line>) {
        let binary = &binary::build(primitives, self.space, self.effort, workspace);
        let collapse = &Collapse::new(binary, primitives, &[]);
        let mut lines = vec![Line::ZERO; UNUSED];
        let emit = Emit { binary, collapse, primitives, shapes: self.shapes, pieces: &[] };
        let Emitted { root, depth } = emit.write(&mut lines);
        (Piece { root, depth, bounds: binary.bounds[0], cost: collapse.cost() }, lines)
    }
}
