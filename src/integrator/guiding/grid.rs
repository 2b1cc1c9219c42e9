//! Cells of space and of normals, and their numbers.

use crate::math::Vec3;
use crate::sampling::hash::mix64;

/// What is added to coordinates in cells, so that they are positive, and that no plane through the origin, where walls often
/// are, divides cells.
const SHIFT: f32 = 32_768.37;

/// Marks a key: none is 0.
const IS_KEY: u64 = 1 << 63;

/// Marks the key of a larger cell.
const IS_PARENT: u64 = 1 << 62;

/// How many times longer the edges of a larger cell are, in bits.
const PARENT_BITS: u32 = 2;

/// Cells of a larger one's surface, about.
pub const CELLS_OF_PARENT: f32 = (1 << (2 * PARENT_BITS)) as f32;

/// Space in cubes, each divided by the direction of normals. Cubes far beyond the others (32,768 edges away) share their cells.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// Cells along a metre.
    pub scale: f32,
}

impl Grid {
    /// Of cubes with edges of this many metres.
    pub fn new(edge: f32) -> Grid {
        Grid { scale: 1.0 / edge }
    }

    /// The key of the cell at a point with a normal.
    pub fn key(self, p: Vec3, n: Vec3) -> u64 {
        let [low, high] = self.halves(p * self.scale, n);
        key_of(low, high)
    }

    /// The halves of the key at a point, in cells.
    #[inline(always)]
    pub fn halves(self, p: Vec3, n: Vec3) -> [u32; 2] {
        // Positive numbers, cut off.
        let place = |x: f32| (x + SHIFT) as i32 as u32 & 0xffff;
        let side = |x: f32| (x * 2.0 + 2.5) as i32 as u32;
        let sides = side(n.x) | (side(n.y) << 3) | (side(n.z) << 6);
        [place(p.x) | (place(p.y) << 16), place(p.z) | (sides << 16)]
    }
}

/// The key of its halves.
#[inline(always)]
pub fn key_of(low: u32, high: u32) -> u64 {
    IS_KEY | u64::from(low) | (u64::from(high) << 32)
}

/// The key of the larger cell that a cell is in.
pub fn parent(key: u64) -> u64 {
    let place = |shift: u32| (((key >> shift) & 0xffff) >> PARENT_BITS) << shift;
    (key & !0xffff_ffff_ffff) | IS_PARENT | place(0) | place(16) | place(32)
}

/// Numbers of keys, in the order in which they came.
#[derive(Clone, Debug, Default)]
pub struct Numbers {
    /// Keys, 0 where there is none, with their numbers; a power of two.
    slots: Vec<(u64, u32)>,
    count: u32,
}

impl Numbers {
    /// The number of a key, if it has one.
    #[inline]
    pub fn get(&self, key: u64) -> Option<u32> {
        if self.slots.is_empty() {
            return None;
        }
        let (found, number) = self.slots[self.slot(key)];
        (found == key).then_some(number)
    }

    /// The number of a key: that of those before, if it is new.
    pub fn insert(&mut self, key: u64) -> u32 {
        if let Some(number) = self.get(key) {
            return number;
        }
        if 2 * (self.count as usize + 1) > self.slots.len() {
            let larger = (2 * self.slots.len()).max(64);
            let old = std::mem::replace(&mut self.slots, vec![(0, 0); larger]);
            for (key, number) in old.into_iter().filter(|(key, _)| *key != 0) {
                let slot = self.slot(key);
                self.slots[slot] = (key, number);
            }
        }
        let (slot, number) = (self.slot(key), self.count);
        self.slots[slot] = (key, number);
        self.count += 1;
        number
    }

    /// The slot of a key, or the free one where it belongs.
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
