//! The tree over one geometry and what is placed in its space.

use super::append::{Full, Threads};
use super::binary::{self, Binary, Effort, Workspace};
use super::collapse::Collapse;
use super::emit::{Emit, Emitted, Shapes};
use super::gather::{Primitive, gather};
use super::halves;
use super::input::{BuildOptions, Geometry, TreeQuality};
use super::layout::InstanceRecord;
use super::normalize::Space;
use super::parts::{BuildStats, Built, NOTHING, Tree};
use super::pieces;
use crate::simd::Line;

/// More primitives than these are built in pieces. (For fast trees sooner: it is faster even with one thread.)
pub const fn largest_whole(quality: TreeQuality) -> usize {
    match quality {
        TreeQuality::Fast => 1 << 14,
        TreeQuality::Full => 1 << 18,
    }
}

/// What a tree is built over.
pub struct Contents<'a> {
    /// Shapes.
    pub geometry: &'a Geometry,
    /// Instances: their ids are those of records.
    pub placed: Vec<Primitive>,
    /// The records of these.
    pub records: &'a [InstanceRecord],
}

impl<'a> Contents<'a> {
    /// A geometry alone.
    pub fn of(geometry: &'a Geometry) -> Contents<'a> {
        Contents { geometry, placed: Vec::new(), records: &[] }
    }
}

/// Builds trees.
#[derive(Clone, Copy)]
pub struct TreeBuilder<'a> {
    /// How.
    pub options: BuildOptions<'a>,
    /// Deeper trees are built anew, in halves.
    pub max_depth: usize,
}

impl TreeBuilder<'_> {
    /// Appends a tree, and counts what is in it.
    pub fn append(
        &self,
        contents: Contents,
        threads: Threads,
        lines: &mut Vec<Line>,
    ) -> Result<(Built, BuildStats), Full> {
        let Contents { geometry, placed, records } = contents;
        let all = geometry.primitives() + placed.len();
        let (mut primitives, dropped) = gather(geometry);
        let mut stats = BuildStats { dropped, ..BuildStats::default() };
        stats.count(geometry, &primitives);
        let counts = (primitives.len(), placed.len());
        primitives.extend(placed);
        self.options.tell(2 * (all - primitives.len()));
        if primitives.is_empty() {
            return Ok((NOTHING, stats));
        }
        let start = lines.len();
        let space = Space::of(&primitives);
        let shapes = Shapes { geometry, records };
        let mut emitted = if primitives.len() > largest_whole(self.options.quality) {
            pieces::build(&mut primitives, &space, shapes, (self.options, threads), lines)?
        } else {
            let own = &mut Workspace::default();
            let workspace = if let Threads::This(workspace) = threads { workspace } else { own };
            let binary = binary::build(&primitives, &space, Effort::Most, workspace);
            let emitted = emit_whole(&binary, &primitives, shapes, lines)?;
            self.options.tell(2 * primitives.len());
            emitted
        };
        if emitted.depth > self.max_depth {
            lines.truncate(start);
            emitted = emit_whole(&halves::build(&primitives), &primitives, shapes, lines)?;
        }
        let Emitted { root, depth } = emitted;
        let tree = Tree { root, depth, primitives: counts.0, instances: counts.1 };
        Ok((Built { tree, bounds: space.bounds }, stats))
    }
}

/// Appends the wide tree that a binary one becomes.
fn emit_whole(
    binary: &Binary,
    primitives: &[Primitive],
    shapes: Shapes,
    lines: &mut Vec<Line>,
) -> Result<Emitted, Full> {
    let collapse = &Collapse::new(binary, primitives, &[]);
    Emit { binary, collapse, primitives, shapes, pieces: &[] }.write(lines)
}
