//! Boxes as the builder sees them: moved into the unit cube, so that areas neither overflow nor vanish, with what lies
//! far outside of most of the scene drawn nearer, and no two quite alike.

use super::gather::Primitive;
use crate::math::{Bounds3, DVec3, Vec3};
use obvhs::aabb::Aabb;
use rayon::prelude::*;

/// The way into the unit cube.
pub struct Space {
    /// The box around all, in the scene's own space.
    pub bounds: Bounds3,
    core: Core,
    low: DVec3,
    scale: f64,
    /// Does nothing lie beyond the margin?
    is_plain: bool,
}

impl Space {
    /// That of some primitives.
    pub fn of(primitives: &[Primitive]) -> Space {
        let all = primitives
            .par_iter()
            .with_min_len(4096)
            .map(|p| p.bounds)
            .reduce(|| Bounds3::EMPTY, Bounds3::union);
        let core = Core::of(primitives);
        let low = core.draw_nearer(all.min.as_dvec3());
        let extent = (core.draw_nearer(all.max.as_dvec3()) - low).max_element();
        let scale = if extent > 0.0 { 1.0 / extent } else { 1.0 };
        let is_plain = core.holds(all.min.as_dvec3()) && core.holds(all.max.as_dvec3());
        Space { bounds: all, core, low, scale, is_plain }
    }

    /// A point of the scene in the unit cube.
    #[inline(always)]
    pub fn place(&self, p: Vec3) -> Vec3 {
        let p = p.as_dvec3();
        let p = if self.is_plain { p } else { self.core.draw_nearer(p) };
        ((p - self.low) * self.scale).as_vec3()
    }

    /// Boxes for the builder alone, in the order of the primitives.
    pub fn boxes(&self, primitives: &[Primitive], boxes: &mut Vec<Aabb>) {
        let of_one = |(i, p): (usize, &Primitive)| {
            let (min, max) = (self.place(p.bounds.min), self.place(p.bounds.max));
            Aabb::new(min.into(), (max + growth(i as u32, max - min)).into())
        };
        primitives.par_iter().with_min_len(4096).enumerate().map(of_one).collect_into_vec(boxes);
    }
}

/// Boxes smaller than 64 roundings in the unit cube: what they are can't be told.
const COLLAPSED: f32 = 1.0 / 131_072.0;

/// By how much a box grows: a pseudo-random fraction below 1/4096 of itself. Clustering takes a pass over all for each
/// merge where all boxes are equal, and boxes that differ can't do that. Collapsed boxes grow enough to differ wherever
/// they are.
fn growth(index: u32, size: Vec3) -> Vec3 {
    let random = hash(index);
    let part = |shift: u32| ((random >> shift) & 1023) as f32 / 1024.0;
    let most = if size.max_element() < COLLAPSED {
        Vec3::splat(8.0 * COLLAPSED)
    } else {
        (size + Vec3::splat(1.0 / 4096.0)) / 4096.0
    };
    most * Vec3::new(part(0), part(10), part(20))
}

/// A mixing of 32 bits (the finaliser of MurmurHash3).
fn hash(x: u32) -> u32 {
    let x = (x ^ (x >> 16)).wrapping_mul(0x85eb_ca6b);
    let x = (x ^ (x >> 13)).wrapping_mul(0xc2b2_ae35);
    x ^ (x >> 16)
}

/// Where all but a few of the primitives are.
struct Core {
    low: DVec3,
    high: DVec3,
    /// How far around it the scene stays as it is; 0: all of it does.
    margin: f64,
}

/// Primitives that are looked at to find the core.
const SAMPLES: usize = 4096;
/// This part of them may lie below, and as many above, on each axis.
const OUTSIDE: f64 = 0.1;
/// The margin in sizes of the core.
const MARGIN: f64 = 64.0;

impl Core {
    fn of(primitives: &[Primitive]) -> Core {
        let step = primitives.len().div_ceil(SAMPLES).max(1);
        let middles: Vec<DVec3> = primitives
            .iter()
            .step_by(step)
            .map(|p| (p.bounds.min.as_dvec3() + p.bounds.max.as_dvec3()) * 0.5)
            .collect();
        let outside = (middles.len() as f64 * OUTSIDE) as usize;
        let range = |axis: usize| {
            let mut sorted: Vec<f64> = middles.iter().map(|m| m[axis]).collect();
            sorted.sort_unstable_by(f64::total_cmp);
            let last = sorted.len().saturating_sub(1);
            let at = |i: usize| sorted.get(i).copied().unwrap_or(0.0);
            (at(outside), at(last - outside.min(last)))
        };
        let [x, y, z] = [range(0), range(1), range(2)];
        let (low, high) = (DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1));
        Core { low, high, margin: MARGIN * (high - low).max_element() }
    }

    /// Does a point stay as it is?
    fn holds(&self, p: DVec3) -> bool {
        let outside = (p - self.high).max(self.low - p).max_element();
        self.margin <= 0.0 || outside <= self.margin
    }

    /// Beyond the margin, distance counts by its logarithm: one vertex at a great distance would leave nothing of the
    /// size of all the others in single precision. Each axis keeps its order, so boxes that overlap still do, and those
    /// that do not still do not.
    fn draw_nearer(&self, p: DVec3) -> DVec3 {
        if self.margin <= 0.0 {
            return p;
        }
        let axis = |x: f64, low: f64, high: f64| {
            if x > high {
                high + self.margin * shorten((x - high) / self.margin)
            } else if x < low {
                low - self.margin * shorten((low - x) / self.margin)
            } else {
                x
            }
        };
        DVec3::new(
            axis(p.x, self.low.x, self.high.x),
            axis(p.y, self.low.y, self.high.y),
            axis(p.z, self.low.z, self.high.z),
        )
    }
}

/// `d` up to 1; then `1 + log2(d)`, straight between the powers of two: exact, the same on all systems.
fn shorten(d: f64) -> f64 {
    if d <= 1.0 {
        return d;
    }
    let power = (d.to_bits() >> 52) as i32 - 1023;
    let below = f64::from_bits(((power + 1023) as u64) << 52);
    f64::from(power) + d / below
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shortening_keeps_order_and_joins() {
        assert_eq!(
            [0.0, 0.25, 1.0, 2.0, 3.0, 4.0, 1024.0].map(shorten),
            [0.0, 0.25, 1.0, 2.0, 2.5, 3.0, 11.0]
        );
        let mut last = 0.0;
        for i in 1..100_000 {
            let now = shorten(f64::from(i) * 0.001);
            assert!(now > last, "{i}");
            last = now;
        }
    }
}
