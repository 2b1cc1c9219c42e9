//! Keys of the cells of many vertices at a time.

use super::super::wave::{WAVE, Wave, get};
use super::grid::Grid;
use crate::math::Frame;
use crate::sampling::hash::hash32;
use crate::simd::Kernel;
use std::ops::Range;

/// Keeps the random numbers here apart from all others of a path.
const SEED: u32 = 0x51ed_270b;

/// Finds the halves of the keys of vertices. Points are moved along the surface, by at most half a cell either way, so that the
/// borders between cells are blurred.
pub struct FindKeys<'a> {
    pub grid: Grid,
    pub wave: &'a mut Wave,
    pub range: Range<usize>,
    pub bounce: u32,
}

impl Kernel for FindKeys<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v, .. } = self.wave;
        let salt = hash32(self.bounce ^ SEED);
        for i in self.range.start..self.range.end.min(WAVE) {
            let n = get(&v.ns, i);
            let frame = Frame::from_normal(n);
            let hash = hash32(hash32(paths.carried.seed[i] ^ salt) ^ paths.carried.shuffled[i]);
            let (s, t) = ((hash & 0xffff) as i32 as f32, (hash >> 16) as i32 as f32);
            let (s, t) = (s * (1.0 / 65_536.0) - 0.5, t * (1.0 / 65_536.0) - 0.5);
            let p = get(&v.p, i) * self.grid.scale + frame.s * s + frame.t * t;
            let [low, high] = self.grid.halves(p, n);
            (v.guided.key_low[i], v.guided.key_high[i]) = (low, high);
        }
    }
}
