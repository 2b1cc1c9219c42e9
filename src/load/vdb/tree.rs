//! The tree of a grid: a root with nodes of 32^3, each with nodes of 16^3, each with leaves of 8^3 voxels (the layout 5_4_3). A file
//! has the nodes first and then, in the same order, the voxels of all leaves.

use super::bytes::{Bytes, Mask};
use super::values::Values;
use std::collections::HashSet;

/// Bits of a coordinate within the nodes of a level and all below it; and the level's own.
const UPPER: (u32, u32) = (12, 5);
const LOWER: (u32, u32) = (7, 4);
const LEAF: u32 = 3;
const LEAF_VOXELS: usize = 1 << (3 * LEAF);

/// Cubes of voxels along a coordinate that have one value, or the values of a leaf.
pub(super) struct Cube {
    /// Coordinates of its first voxel.
    pub origin: [i32; 3],
    /// Voxels along an edge.
    pub edge: u32,
    pub voxels: Voxels,
}

/// What is in a cube.
pub(super) enum Voxels {
    /// One value throughout.
    Same(f32),
    /// Each voxel's, that along z fastest; 512.
    Each(Vec<f32>),
}

/// Reads all cubes of a tree in which values are active.
pub(super) fn read(from: &mut Bytes, values: &mut Values) -> Result<Vec<Cube>, String> {
    if from.i32()? != 1 {
        return Err("has a tree of several buffers, which is not read".into());
    }
    values.background = values.single(from)?;
    let (tiles, children) = (from.u32()?, from.u32()?);
    let mut cubes = Vec::new();
    let mut taken = HashSet::new();
    for _ in 0..tiles {
        let (origin, value) = (from.coordinates()?, values.single(from)? as f32);
        check_origin(origin, &mut taken)?;
        if from.u8()? != 0 {
            cubes.push(Cube { origin, edge: 1 << UPPER.0, voxels: Voxels::Same(value) });
        }
    }
    let mut leaves = Vec::new();
    for _ in 0..children {
        let origin = from.coordinates()?;
        check_origin(origin, &mut taken)?;
        for upper in node(from, values, (origin, UPPER), &mut cubes)? {
            for leaf in node(from, values, (upper, LOWER), &mut cubes)? {
                Mask::read(from, LEAF_VOXELS)?;
                leaves.push(leaf);
            }
        }
    }
    for origin in leaves {
        let active = Mask::read(from, LEAF_VOXELS)?;
        let mut each = values.read(from, &active)?;
        for (index, value) in each.iter_mut().enumerate() {
            // What is not active is outside, whatever is stored for it.
            if !active.is_on(index) {
                *value = 0.0;
            }
        }
        cubes.push(Cube { origin, edge: 1 << LEAF, voxels: Voxels::Each(each) });
    }
    Ok(cubes)
}

/// What hangs off the root lies on a lattice, each in a place of its own: voxels are there once.
fn check_origin(origin: [i32; 3], taken: &mut HashSet<[i32; 3]>) -> Result<(), String> {
    let is_aligned = origin.iter().all(|c| c.trailing_zeros() >= UPPER.0);
    match is_aligned && taken.insert(origin) {
        true => Ok(()),
        false => Err(format!("has a tree whose nodes overlap, at the voxel {origin:?}")),
    }
}

/// Reads a node with its tiles; the origins of its children, which follow it.
///
/// A file has the children of a child before its next sibling, so the upper level can't be read at once.
fn node(
    from: &mut Bytes,
    values: &Values,
    (origin, (bits, own)): ([i32; 3], (u32, u32)),
    cubes: &mut Vec<Cube>,
) -> Result<Vec<[i32; 3]>, String> {
    let count = 1 << (3 * own);
    let children = Mask::read(from, count)?;
    let active = Mask::read(from, count)?;
    let tiles = values.read(from, &active)?;
    let below = bits - own;
    let place = |index: usize| {
        let index = index as i32;
        let within = [index >> (2 * own), index >> own, index].map(|i| i & ((1 << own) - 1));
        [0, 1, 2].map(|k| origin[k].wrapping_add(within[k] << below))
    };
    for index in active.on().filter(|&index| !children.is_on(index)) {
        cubes.push(Cube { origin: place(index), edge: 1 << below, voxels: Voxels::Same(tiles[index]) });
    }
    Ok(children.on().map(place).collect())
}
