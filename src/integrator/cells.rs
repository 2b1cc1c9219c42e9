//! Cells by position and normal, in which paths learn before the first pass; and their keys.

use crate::math::Vec3;
use crate::sampling::hash::mix64;

/// Maximum number of training samples from which the cell size is determined.
const MAX_SIZING_SAMPLES: usize = 1 << 15;

/// Offset of coordinates, in cells: makes them positive, and keeps cell borders away from planes through the origin, where walls often
/// are.
const SHIFT: f32 = 32_768.37;

/// Bit set in all keys, so that none is 0.
const IS_KEY: u64 = 1 << 63;

/// Bit set in keys of parents.
const IS_PARENT: u64 = 1 << 62;

/// Base-2 logarithm of the ratio of a parent cell's edge to a cell's edge.
const PARENT_BITS: u32 = 2;

/// Approximate number of cells that a surface crosses in a parent cell.
pub const CELLS_PER_PARENT: f32 = (1 << (2 * PARENT_BITS)) as f32;

/// A uniform grid of cubes, subdivided by the direction of normals. Coordinates wrap after 65,536 cells.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// Cells per metre.
    pub scale: f32,
}

impl Grid {
    /// A grid of cubes of edge length `edge`, metres.
    pub fn new(edge: f32) -> Grid {
        Grid { scale: 1.0 / edge }
    }

    /// The key of the cell of a point, metres, and a normal.
    pub fn key(self, p: Vec3, n: Vec3) -> u64 {
        let [low, high] = self.halves(p * self.scale, n);
        key_of(low, high)
    }

    /// The grid with the smallest cells such that, extrapolated from these positions and normals to `total` samples, at least half of the
    /// samples are in cells with `wanted` samples or more; `None` without samples.
    pub fn suited_to(places: &[[Vec3; 2]], total: f64, wanted: f64) -> Option<Grid> {
        let step = places.len().div_ceil(MAX_SIZING_SAMPLES).max(1);
        let subset: Vec<&[Vec3; 2]> = places.iter().step_by(step).collect();
        // The 90 % quantile, so that a few distant samples have no effect.
        let mut distances: Vec<f32> = subset
            .iter()
            .map(|[p, _]| p.to_array().iter().fold(0.0f32, |most, x| most.max(x.abs())))
            .collect();
        distances.sort_unstable_by(f32::total_cmp);
        let farthest = *distances.get(distances.len() * 9 / 10)?;
        if farthest <= 0.0 || !farthest.is_finite() {
            return None;
        }
        // Minimum number of samples of the subset in a cell.
        let least = (wanted * subset.len() as f64 / total).max(4.0) as usize;
        let mut edge = farthest / 8192.0;
        loop {
            let grid = Grid::new(edge);
            let mut keys: Vec<u64> = subset.iter().map(|&&[p, n]| grid.key(p, n)).collect();
            keys.sort_unstable();
            let full: usize = keys.chunk_by(|a, b| a == b).map(<[u64]>::len).filter(|n| *n >= least).sum();
            if 2 * full >= subset.len() || edge > farthest {
                return Some(grid);
            }
            edge *= std::f32::consts::SQRT_2;
        }
    }

    /// The low and high half of the key of a point, in cells, and a normal.
    #[inline(always)]
    pub fn halves(self, p: Vec3, n: Vec3) -> [u32; 2] {
        // Truncation rounds down, since the numbers are positive.
        let cell = |x: f32| (x + SHIFT) as i32 as u32 & 0xffff;
        let quantized = |x: f32| (x * 2.0 + 2.5) as i32 as u32;
        let normal = quantized(n.x) | (quantized(n.y) << 3) | (quantized(n.z) << 6);
        [cell(p.x) | (cell(p.y) << 16), cell(p.z) | (normal << 16)]
    }
}

/// The key with these halves.
#[inline(always)]
pub fn key_of(low: u32, high: u32) -> u64 {
    IS_KEY | u64::from(low) | (u64::from(high) << 32)
}

/// The key of a cell's parent.
pub fn parent(key: u64) -> u64 {
    let cell = |shift: u32| (((key >> shift) & 0xffff) >> PARENT_BITS) << shift;
    (key & !0xffff_ffff_ffff) | IS_PARENT | cell(0) | cell(16) | cell(32)
}

/// Open-addressing hash map from keys to indices in order of insertion.
#[derive(Clone, Debug, Default)]
pub struct KeyIndices {
    /// Key and index; key 0 marks a free slot. The length is a power of two.
    slots: Vec<(u64, u32)>,
    count: u32,
}

impl KeyIndices {
    /// The index of a key; `None` if absent.
    #[inline]
    pub fn get(&self, key: u64) -> Option<u32> {
        if self.slots.is_empty() {
            return None;
        }
        let (found, index) = self.slots[self.slot(key)];
        (found == key).then_some(index)
    }

    /// The index of a key, inserted if absent.
    pub fn insert(&mut self, key: u64) -> u32 {
        if let Some(index) = self.get(key) {
            return index;
        }
        if 2 * (self.count as usize + 1) > self.slots.len() {
            let larger = (2 * self.slots.len()).max(64);
            let old = std::mem::replace(&mut self.slots, vec![(0, 0); larger]);
            for (key, index) in old.into_iter().filter(|(key, _)| *key != 0) {
                let slot = self.slot(key);
                self.slots[slot] = (key, index);
            }
        }
        let (slot, index) = (self.slot(key), self.count);
        self.slots[slot] = (key, index);
        self.count += 1;
        index
    }

    /// The slot of a key, or the free slot for it.
    #[inline]
    fn slot(&self, key: u64) -> usize {
        let mask = self.slots.len() - 1;
        let mut at = mix64(key) as usize & mask;
        while self.slots[at].0 != key && self.slots[at].0 != 0 {
            at = (at + 1) & mask;
        }
        at
    }
}
