//! The tree of many primitives, built in pieces: the primitives are cut into chunks that lie apart, a tree is built over each
//! chunk and written at once, and a small tree over these joins them. Threads work on chunks side by side, what they need stays
//! in their caches, and beyond a few chunks nothing but the primitives' boxes and what is written is ever held: 32 bytes a
//! primitive and 66 to 78 of the tree, with 15 more for what two threads work on where there are 2 million triangles, and 1.5 where
//! there are 20. The README of `tools/rays` has the figures, and what was tried and lost.

use super::append::{Full, Part, Threads, append, empty_buffer};
use super::binary::{self, Effort, Workspace};
use super::chunks;
use super::collapse::{Collapse, Piece};
use super::emit::{Emit, Emitted, Shapes};
use super::estimate::Estimate;
use super::gather::{Kind, Primitive};
use super::input::{BuildOptions, Geometry, TreeQuality};
use super::normalize::Space;
use crate::math::Bounds3;
use crate::simd::{Line, reserve_lines};
use rayon::prelude::*;
use std::ops::Range;

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

/// Lines that these primitives take, at most, but for few scenes.
fn room(primitives: &[Primitive], geometry: &Geometry) -> usize {
    let mut estimate = Estimate::default();
    estimate.add_geometry(geometry);
    estimate.add_instances(primitives.len().saturating_sub(geometry.primitives()));
    estimate.lines()
}

/// Appends the tree over some primitives, and reorders these.
pub fn build(
    primitives: &mut [Primitive],
    space: &Space,
    shapes: Shapes,
    (options, threads): (BuildOptions, Threads),
    lines: &mut Vec<Line>,
) -> Result<Emitted, Full> {
    reserve_lines(lines, room(primitives, shapes.geometry));
    let limit = (primitives.len() / CHUNKS).clamp(SMALLEST, LARGEST);
    let count = large_to_front(primitives, space, limit);
    let (large, primitives) = primitives.split_at_mut(count);
    // In the space of a ground, the triangles of a scan that stands on it may be too small to be told apart.
    let own_space = (count > 0).then(|| Space::of(primitives));
    let space = own_space.as_ref().unwrap_or(space);
    let chunks = chunks::cut(primitives, space, limit, options.gauge);
    let effort = match options.quality {
        TreeQuality::Fast => Effort::Least,
        TreeQuality::Full => Effort::Chunk,
    };
    let pieces = Pieces { primitives, space, shapes, effort, options }.append(&chunks, threads, lines)?;
    options.tell(2 * large.len());
    let of_piece =
        |(i, piece): (usize, &Piece)| Primitive { kind: Kind::Piece, id: i as u32, bounds: piece.bounds };
    let tops: Vec<Primitive> = pieces.iter().enumerate().map(of_piece).chain(large.iter().copied()).collect();
    let binary = binary::build(&tops, &Space::of(&tops), Effort::Most, &mut Workspace::default());
    let collapse = Collapse::new(&binary, &tops, &pieces);
    let top = Emit { binary: &binary, collapse: &collapse, primitives: &tops, shapes, pieces: &pieces };
    let Emitted { root, depth } = top.write(lines)?;
    let deepest = pieces.iter().map(|piece| piece.depth).max().unwrap_or(0);
    Ok(Emitted { root, depth: depth + deepest })
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
    options: BuildOptions<'a>,
}

impl Pieces<'_> {
    /// Appends the trees of the chunks.
    fn append(
        &self,
        chunks: &[Range<usize>],
        threads: Threads,
        lines: &mut Vec<Line>,
    ) -> Result<Vec<Piece>, Full> {
        let built = append(chunks.len(), threads, lines, |index, workspace| {
            let chunk = &self.primitives[chunks[index].clone()];
            let piece = self.piece(chunk, workspace);
            self.options.tell(chunk.len());
            piece
        })?;
        Ok(built.into_iter().map(|(root, piece)| Piece { root, ..piece }).collect())
    }

    /// The tree over a chunk.
    fn piece(&self, primitives: &[Primitive], workspace: &mut Workspace) -> Result<Part<Piece>, Full> {
        let binary = &binary::build(primitives, self.space, self.effort, workspace);
        let collapse = &Collapse::new(binary, primitives, &[]);
        let mut lines = empty_buffer();
        let emit = Emit { binary, collapse, primitives, shapes: self.shapes, pieces: &[] };
        let Emitted { root, depth } = emit.write(&mut lines)?;
        Ok(Part { root, lines, what: Piece { root, depth, bounds: binary.bounds[0], cost: collapse.cost() } })
    }
}
