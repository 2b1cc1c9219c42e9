//! Moves a tree that is written to another place in the buffer.

use super::layout::{
    AnalyticPacket, DONE, InstanceRecord, KIND_ANALYTIC, KIND_INSTANCE, LEAF, Node, TrianglePacket, kind_of,
    line_of, view_mut,
};
use crate::shape::triangle::LANES;
use crate::simd::Line;

/// Makes a tree in a buffer of its own one that starts `by` lines (modulo 2^32) further behind.
pub fn move_references(lines: &mut [Line], root: u32, by: u32) {
    let mut stack = vec![root];
    while let Some(reference) = stack.pop() {
        if reference & LEAF != 0 {
            move_leaf(lines, reference, by);
            continue;
        }
        let node = view_mut::<Node>(lines, line_of(reference));
        for child in node.child.iter_mut().filter(|child| **child != DONE) {
            stack.push(*child);
            *child = child.wrapping_add(by);
        }
    }
}

/// The packets of a leaf.
fn move_leaf(lines: &mut [Line], first: u32, by: u32) {
    let moved = |next: u32| if next == DONE { DONE } else { next.wrapping_add(by) };
    let mut reference = first;
    while reference != DONE {
        let line = line_of(reference);
        reference = match kind_of(reference) {
            KIND_INSTANCE => {
                let record = view_mut::<InstanceRecord>(lines, line);
                let next = record.next;
                record.next = moved(next);
                next
            }
            KIND_ANALYTIC => {
                let packet = view_mut::<AnalyticPacket>(lines, line);
                let next = packet.next;
                packet.next = moved(next);
                next
            }
            _ => {
                let packet = view_mut::<TrianglePacket>(lines, line);
                let next = packet.next();
                packet.rows[11] = [f32::from_bits(moved(next)); LANES];
                next
            }
        };
    }
}
