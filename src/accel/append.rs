//! Trees that threads build side by side, each in a buffer of its own, and append to one: in the order of their numbers,
//! however many threads there are.
//!
//! A lock is held only while places are given out. References are moved and lines are copied outside of it, so that threads
//! also share the first touch of the memory.

use super::binary::Workspace;
use super::layout::{DONE, MAX_LINE};
use super::relocate::move_references;
use crate::simd::{Claim, Claims, Line, append_claims, reserve_lines};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// The buffer holds as much as can be addressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Full;

/// A tree in a buffer of its own, with what else is known of it.
pub struct Part<T> {
    /// Where it starts.
    pub root: u32,
    /// The buffer, from [`empty_buffer`].
    pub lines: Vec<Line>,
    /// What else is known.
    pub what: T,
}

/// A buffer of its own starts with so many lines that belong to no tree, since the first of all hold no instance (see
/// [`DONE`]).
const UNUSED: usize = 2;

/// The buffer for a part.
pub fn empty_buffer() -> Vec<Line> {
    vec![Line::ZERO; UNUSED]
}

/// Who builds.
pub enum Threads<'a> {
    /// So many of the pool at most; the others help these.
    Pool(usize),
    /// The one that asks.
    This(&'a mut Workspace),
}

/// Builds so many parts and appends them; gives the moved roots, and what else is known of the parts, in order.
pub fn append<T: Send>(
    count: usize,
    threads: Threads,
    lines: &mut Vec<Line>,
    build: impl Fn(usize, &mut Workspace) -> Result<Part<T>, Full> + Sync,
) -> Result<Vec<(u32, T)>, Full> {
    let start = lines.len();
    let (parts, overflow) = append_claims(lines, |claims| {
        let mut waiting = Vec::new();
        waiting.resize_with(count, || None);
        let output = Output { claims, next: start, parts: Vec::with_capacity(count), waiting };
        let queue = Queue {
            count,
            next: AtomicUsize::new(0),
            failed: AtomicBool::new(false),
            output: Mutex::new(output),
        };
        queue.run(threads, &build)
    })?;
    reserve_lines(lines, overflow.iter().map(|part| part.lines.len() - UNUSED).sum());
    for mut part in overflow {
        part.relocate();
        lines.extend_from_slice(&part.lines[UNUSED..]);
    }
    Ok(parts)
}

/// The parts that are to be built.
struct Queue<'a, T> {
    count: usize,
    next: AtomicUsize,
    failed: AtomicBool,
    output: Mutex<Output<'a, T>>,
}

impl<T: Send> Queue<'_, T> {
    #[allow(clippy::type_complexity)]
    fn run(
        self,
        threads: Threads,
        build: &(impl Fn(usize, &mut Workspace) -> Result<Part<T>, Full> + Sync),
    ) -> Result<(Vec<(u32, T)>, Vec<Moved>), Full> {
        match threads {
            Threads::This(workspace) => vec![self.work(workspace, build)],
            // Not a parallel loop: a thread that waits within a part would begin another meanwhile.
            Threads::Pool(most) => rayon::broadcast(|context| match context.index() < most.max(1) {
                true => self.work(&mut Workspace::default(), build),
                false => Ok(Vec::new()),
            }),
        }
        .into_iter()
        .collect::<Result<Vec<_>, _>>()
        .map(|overflow| {
            let mut overflow: Vec<Moved> = overflow.into_iter().flatten().collect();
            overflow.sort_unstable_by_key(|part| part.start);
            (self.output.into_inner().expect("no thread fails").parts, overflow)
        })
    }

    /// Builds and writes parts as long as there are any; gives those for which there was no room.
    fn work(
        &self,
        workspace: &mut Workspace,
        build: &impl Fn(usize, &mut Workspace) -> Result<Part<T>, Full>,
    ) -> Result<Vec<Moved>, Full> {
        let mut overflow = Vec::new();
        while !self.failed.load(Ordering::Relaxed) {
            let index = self.next.fetch_add(1, Ordering::Relaxed);
            if index >= self.count {
                break;
            }
            let part = build(index, workspace).inspect_err(|_| self.failed.store(true, Ordering::Relaxed))?;
            let placed = self.output.lock().expect("no thread fails").put(index, part);
            for (mut part, claim) in placed {
                if part.start + part.lines.len() > MAX_LINE {
                    self.failed.store(true, Ordering::Relaxed);
                    return Err(Full);
                }
                match claim {
                    Some(claim) => {
                        part.relocate();
                        claim.fill(&part.lines[UNUSED..]);
                    }
                    None => overflow.push(part),
                }
            }
        }
        Ok(overflow)
    }
}

/// A part's lines and where they go.
struct Moved {
    lines: Vec<Line>,
    root: u32,
    start: usize,
}

impl Moved {
    fn by(&self) -> u32 {
        (self.start as u32).wrapping_sub(UNUSED as u32)
    }

    fn relocate(&mut self) {
        let by = self.by();
        move_references(&mut self.lines, self.root, by);
    }
}

/// Gives out places one behind the other in the order of parts.
struct Output<'a, T> {
    claims: Claims<'a>,
    next: usize,
    parts: Vec<(u32, T)>,
    /// What was built before its turn.
    waiting: Vec<Option<Part<T>>>,
}

impl<'a, T> Output<'a, T> {
    /// Takes a part, and gives all parts whose places are known now, with the memory there.
    fn put(&mut self, index: usize, part: Part<T>) -> Vec<(Moved, Option<Claim<'a>>)> {
        self.waiting[index] = Some(part);
        let mut placed = Vec::new();
        while let Some(part) = self.waiting.get_mut(self.parts.len()).and_then(Option::take) {
            let Part { root, lines, what } = part;
            let moved = Moved { lines, root, start: self.next };
            let count = moved.lines.len() - UNUSED;
            self.next += count;
            self.parts.push((if root == DONE { DONE } else { root.wrapping_add(moved.by()) }, what));
            placed.push((moved, self.claims.claim(count)));
        }
        placed
    }
}

#[cfg(test)]
mod tests {
    use super::super::layout::{KIND_TRIANGLES, TrianglePacket, leaf_ref, line_of, view_mut};
    use super::*;

    /// A packet of triangles that leads to another.
    fn part(index: usize) -> Part<usize> {
        let mut lines = empty_buffer();
        lines.resize(UNUSED + 6 + index % 3, Line::ZERO);
        *view_mut(&mut lines, UNUSED) = TrianglePacket::of(&[], leaf_ref(KIND_TRIANGLES, UNUSED + 3));
        *view_mut(&mut lines, UNUSED + 3) = TrianglePacket::of(&[], DONE);
        Part { root: leaf_ref(KIND_TRIANGLES, UNUSED), lines, what: index }
    }

    #[test]
    fn parts_are_the_same_whatever_the_room_and_the_threads() {
        let built = |room: usize, threads: usize| {
            let mut lines = vec![Line::ZERO; 5];
            lines.reserve_exact(room);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let all = Threads::Pool(usize::MAX);
            let roots = pool.install(|| append(100, all, &mut lines, |index, _| Ok(part(index))));
            (roots.expect("room"), lines)
        };
        let (roots, lines) = built(1000, 1);
        assert_eq!(lines.len(), 5 + 6 * 100 + 99);
        for (i, (root, what)) in roots.iter().enumerate() {
            assert_eq!((line_of(*root), *what), (5 + 6 * i + (0..i).map(|k| k % 3).sum::<usize>(), i));
            let mut own = lines[line_of(*root)..][..6].to_vec();
            let next = view_mut::<TrianglePacket>(&mut own, 0).next();
            assert_eq!(next, leaf_ref(KIND_TRIANGLES, line_of(*root) + 3));
        }
        for (room, threads) in [(0, 1), (300, 1), (0, 4), (300, 4), (1000, 4)] {
            let (same_roots, same) = built(room, threads);
            let [same, lines] = [&same, &lines].map(|list| bytemuck::cast_slice::<Line, u8>(list));
            assert!(same_roots == roots && same == lines, "{room} {threads}");
        }
        let mut lines = Vec::new();
        let workspace = &mut Workspace::default();
        let failed = append(3, Threads::This(workspace), &mut lines, |index, _| {
            if index == 1 { Err(Full) } else { Ok(part(index)) }
        });
        assert!(failed == Err(Full) && lines.is_empty());
    }
}
