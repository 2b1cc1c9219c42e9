//! A binary tree of least depth: for scenes whose better tree is too deep for the stacks of traversal, which takes
//! thousands of shapes each inside the next.

use super::binary::Binary;
use super::gather::Primitive;
use crate::math::{Bounds3, Vec3};

/// Halves the primitives by their centres along the longest axis until one is left.
pub fn build(primitives: &[Primitive]) -> Binary {
    let count = 2 * primitives.len() - 1;
    let mut binary = Binary {
        bounds: Vec::with_capacity(count),
        size: Vec::with_capacity(count),
        primitive: Vec::with_capacity(count),
    };
    let mut ids: Vec<u32> = (0..primitives.len() as u32).collect();
    subtree(&mut binary, primitives, &mut ids);
    binary
}

/// Appends the tree over some primitives, of which there is at least one.
fn subtree(binary: &mut Binary, primitives: &[Primitive], ids: &mut [u32]) {
    let bounds = |id: u32| primitives[id as usize].bounds;
    let center = |id: u32| 0.5 * bounds(id).min + 0.5 * bounds(id).max;
    let node = binary.size.len();
    binary.bounds.push(ids.iter().fold(Bounds3::EMPTY, |all, id| all.union(bounds(*id))));
    binary.size.push(2 * ids.len() as u32 - 1);
    binary.primitive.push(if let [id] = ids { *id } else { u32::MAX });
    if ids.len() > 1 {
        let (low, high) = ids.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), id| {
            (low.min(center(*id)), high.max(center(*id)))
        });
        let axis = (high - low).max_position();
        let half = ids.len() / 2;
        ids.select_nth_unstable_by(half, |a, b| center(*a)[axis].total_cmp(&center(*b)[axis]).then(a.cmp(b)));
        let (left, right) = ids.split_at_mut(half);
        subtree(binary, primitives, left);
        subtree(binary, primitives, right);
    }
    debug_assert_eq!(binary.size.len(), node + binary.size[node] as usize);
}
