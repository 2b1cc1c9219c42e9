//! Scenes of a few triangles: each ray is tested against all of them, without a tree.
//!
//! A tree over 32 triangles is a few steps deep, each of which waits for the one before it. Here the lines of a batch of
//! rays are tested against sixteen triangles at a time, without a branch; the few pairs of ray and triangle that
//! are left are listed, their distances found in one loop over the list, and only the nearest triangle of each ray is
//! tested exactly. The arithmetic is that of the tree's tests: hits are the same bit for bit.

use super::layout::{
    DONE, KIND_TRIANGLES, LEAF, NODE_LINES, Node, Plane, TRIANGLE_LINES, TrianglePacket, kind_of, line_of,
    on_primitive, view,
};
use super::traversal::Output;
use crate::math::{Hit, NO_HIT, Ray};
use crate::shape::PreparedRay;
use crate::shape::triangle::{LANES, Weights, weights_of};
use crate::simd::{BlockQuery, Line, ShearedLine, TriangleBlock, Wide, WideKernel};

/// Up to this many triangles (a quad is two) are tested without a tree.
pub const MAX_TRIANGLES: usize = 64;

/// Rays at a time.
const BATCH: usize = 32;

/// Triangles in a block.
const BLOCK: usize = 16;

/// All triangles of a scene, in the order of their primitives.
#[derive(Debug)]
pub struct Scan {
    blocks: Vec<TriangleBlock>,
    planes: Vec<Plane>,
}

/// Memory that a thread keeps between calls.
pub struct ScanWorkspace {
    rays: [ScanRay; BATCH],
    /// Pairs of a ray and a triangle that its line intersects: `ray << 16 | triangle`.
    pairs: Vec<u32>,
    /// Where the line intersects the triangle's plane.
    t: Vec<f32>,
}

#[derive(Clone, Copy)]
struct ScanRay {
    ray: PreparedRay,
    line: ShearedLine,
    t_min: f32,
    t_max: f32,
    /// The [`key`] of the nearest triangle so far, at first that of the upper bound.
    nearest: u64,
}

/// Orders a ray's triangles by distance, then by number. (Distances that are not negative are ordered as their bits are.)
#[inline(always)]
fn key(t: f32, triangle: u32) -> u64 {
    u64::from(t.to_bits()) << 32 | u64::from(triangle)
}

impl ScanWorkspace {
    /// Without memory yet.
    pub const fn new() -> ScanWorkspace {
        let line = ShearedLine::NONE;
        let ray = ScanRay { ray: PreparedRay::NONE, line, t_min: 0.0, t_max: 0.0, nearest: 0 };
        ScanWorkspace { rays: [ray; BATCH], pairs: Vec::new(), t: Vec::new() }
    }
}

impl Scan {
    /// The triangles of a tree, if it holds triangles and quads alone, and few.
    pub fn new(lines: &[Line], root: u32) -> Option<Scan> {
        let mut triangles = Vec::new();
        let mut stack = vec![root];
        while let Some(reference) = stack.pop().filter(|_| triangles.len() <= MAX_TRIANGLES) {
            if reference == DONE {
                continue;
            }
            if reference & LEAF == 0 {
                stack.extend(view::<Node, NODE_LINES>(lines, line_of(reference))?.child);
            } else if kind_of(reference) == KIND_TRIANGLES {
                let packet = view::<TrianglePacket, TRIANGLE_LINES>(lines, line_of(reference))?;
                triangles
                    .extend((0..LANES).filter(|lane| packet.id(*lane) != NO_HIT).map(|lane| (packet, lane)));
                stack.push(packet.next());
            } else {
                return None;
            }
        }
        triangles.sort_by_key(|(packet, lane)| (packet.id(*lane), packet.part(*lane)));
        let is_few = (1..=MAX_TRIANGLES).contains(&triangles.len());
        is_few.then(|| Scan {
            blocks: triangles.chunks(BLOCK).map(block).collect(),
            planes: triangles.iter().map(|(packet, lane)| Plane::new(packet, *lane)).collect(),
        })
    }
}

fn block(triangles: &[(&TrianglePacket, usize)]) -> TriangleBlock {
    let mut block = TriangleBlock::EMPTY;
    for (to, (packet, lane)) in triangles.iter().enumerate() {
        for row in 0..9 {
            block.rows[row][to] = packet.rows[4 * (row / 3) + row % 3][*lane];
        }
        block.ids[to] = packet.id(*lane);
    }
    block
}

/// One batch of rays.
pub struct ScanAll<'a, O> {
    /// The triangles.
    pub scan: &'a Scan,
    /// The rays.
    pub rays: &'a [Ray],
    /// The results.
    pub output: O,
    /// Scratch memory.
    pub workspace: &'a mut ScanWorkspace,
}

impl<O: Output> WideKernel for ScanAll<'_, O> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self, w: W) {
        let ScanAll { scan, rays, mut output, workspace } = self;
        let most = BATCH * scan.blocks.len() * BLOCK;
        workspace.pairs.resize(most.max(workspace.pairs.len()), 0);
        workspace.t.resize(most.max(workspace.t.len()), 0.0);
        for (batch, rays) in rays.chunks(BATCH).enumerate() {
            let pairs = workspace.list_pairs(w, scan, rays);
            workspace.find_nearest(scan, pairs);
            for id in 0..rays.len() {
                let hit = workspace.hit(scan, id, pairs);
                output.emit(batch * BATCH + id, &hit);
            }
        }
    }
}

impl ScanWorkspace {
    /// Lists which triangles the lines of the rays intersect, in order; returns how many pairs there are.
    #[inline(always)]
    fn list_pairs<W: Wide>(&mut self, w: W, scan: &Scan, rays: &[Ray]) -> usize {
        let mut count = 0;
        for (id, ray) in rays.iter().enumerate().take(BATCH) {
            let state = &mut self.rays[id];
            let Some(((t_min, t_max), line)) = state.ray.set_line(ray) else {
                state.nearest = key(state.t_max, 0);
                continue;
            };
            (state.t_min, state.t_max, state.line) = (t_min, t_max, line);
            state.nearest = key(t_max, 0);
            let ignored = ray.origin_primitive.prim_of(0);
            let mut first = (id as u32) << 16;
            for block in &scan.blocks {
                let Some(to) = self.pairs[count..].first_chunk_mut() else { return count };
                count += w.list_candidates(block, &BlockQuery { line: &line, ignored, first }, to);
                first += BLOCK as u32;
            }
        }
        count
    }

    /// The nearest plane of each ray's pairs that lies in its range; of equally near ones the first.
    #[inline(always)]
    fn find_nearest(&mut self, scan: &Scan, pairs: usize) {
        for (t, pair) in self.t[..pairs].iter_mut().zip(&self.pairs) {
            *t = scan.planes[(pair & 0xffff) as usize]
                .parameter(&self.rays[(pair >> 16) as usize % BATCH].ray);
        }
        for (t, pair) in self.t[..pairs].iter().zip(&self.pairs) {
            let state = &mut self.rays[(pair >> 16) as usize % BATCH];
            // As integers: what is negative or NaN comes before all bounds or after them, and nothing branches.
            let is_ahead = t.to_bits() as i32 > state.t_min.to_bits() as i32;
            let candidate = key(*t, pair & 0xffff) | u64::from(is_ahead).wrapping_sub(1);
            state.nearest = state.nearest.min(candidate);
        }
    }

    /// The hit of a ray.
    #[inline(always)]
    fn hit(&self, scan: &Scan, id: usize, pairs: usize) -> Hit {
        let state = &self.rays[id % BATCH];
        if state.nearest == key(state.t_max, 0) {
            return Hit::MISS;
        }
        let (t, triangle) = (f32::from_bits((state.nearest >> 32) as u32), state.nearest as u32 as usize);
        match scan.weights(triangle, &state.line) {
            Some(weights) => scan.hit(triangle, t * state.ray.unscale, weights),
            None => self.hit_behind(scan, id, pairs),
        }
    }

    /// The hit of a ray whose nearest triangle, whose edge its line touches, was a miss.
    #[cold]
    fn hit_behind(&self, scan: &Scan, id: usize, pairs: usize) -> Hit {
        let state = &self.rays[id % BATCH];
        let (mut nearest, mut hit) = (state.t_max, Hit::MISS);
        let listed = self.pairs[..pairs].iter().zip(&self.t);
        for (pair, t) in listed.filter(|(pair, _)| (**pair >> 16) as usize == id) {
            let triangle = (pair & 0xffff) as usize;
            if *t > state.t_min
                && *t < nearest
                && let Some(weights) = scan.weights(triangle, &state.line)
            {
                nearest = *t;
                hit = scan.hit(triangle, t * state.ray.unscale, weights);
            }
        }
        hit
    }
}

impl Scan {
    #[inline(always)]
    fn weights(&self, triangle: usize, line: &ShearedLine) -> Option<Weights> {
        let rows = &self.blocks[triangle / BLOCK].rows;
        weights_of(|axis, k| rows[3 * axis + k][triangle % BLOCK], line)
    }

    #[inline(always)]
    fn hit(&self, triangle: usize, t: f32, weights: Weights) -> Hit {
        let plane = &self.planes[triangle];
        let (u, v) = on_primitive(plane.part, weights);
        Hit { t, u, v, prim: plane.id, instance: 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Rng, soup};
    use super::super::traversal::{AnyHit, AnyOccluder, ClosestHit};
    use super::super::{Accel, Geometry};
    use super::*;
    use crate::math::{OriginPrimitive, Vec3};
    use crate::simd::Level;

    /// Triangles and quads alone.
    fn flat(count: usize, size: f32, seed: u64) -> Geometry {
        Geometry { analytic: Vec::new(), ..soup(count, size, seed) }
    }

    /// Rays of all kinds, half of them through corners, where edge functions are zero.
    fn rays(geometry: &Geometry, count: usize) -> Vec<Ray> {
        let mut rng = Rng::new(3);
        let mut one = |k: usize| {
            let origin = rng.vector() * 1.5;
            let corner = geometry.positions[rng.bits() as usize % geometry.positions.len()];
            let corner = Vec3::from_array(corner);
            let direction = if k.is_multiple_of(2) { corner - origin } else { rng.vector() };
            let prim = if k.is_multiple_of(5) { rng.bits() % 40 } else { NO_HIT };
            let t_max = if k.is_multiple_of(3) { rng.unit() * 2.0 } else { f32::INFINITY };
            Ray {
                t_min: if k.is_multiple_of(7) { 0.3 } else { 0.0 },
                t_max,
                origin_primitive: OriginPrimitive { prim, instance: 0 },
                ..Ray::new(origin, direction)
            }
        };
        (0..count).map(&mut one).collect()
    }

    #[test]
    fn hits_are_those_of_the_tree_to_the_bit() {
        for (count, size) in [(1, 1.0), (5, 0.7), (20, 0.5), (50, 0.4)] {
            let geometry = flat(count, size, count as u64);
            let rays = rays(&geometry, 3000);
            let accel = Accel::build(&[geometry], &[]);
            assert!(accel.scan.is_some(), "{count}");
            for level in Level::ALL.into_iter().filter(|l| l.is_available()) {
                let mut hits = [vec![Hit::MISS; rays.len()], vec![Hit::MISS; rays.len()]];
                accel.trace(level, &rays, ClosestHit(&mut hits[0]));
                accel.traverse(level, &rays, ClosestHit(&mut hits[1]));
                assert_eq!(hits[0], hits[1], "{count} {}", level.name());
                let mut occluded = vec![false; rays.len()];
                accel.trace(level, &rays, AnyOccluder(&mut occluded));
                assert!(occluded.iter().zip(&hits[1]).all(|(o, h)| *o == h.is_hit()), "{count}");
                let mut any = vec![Hit::MISS; rays.len()];
                accel.trace(level, &rays, AnyHit(&mut any));
                assert!(any.iter().zip(&hits[1]).all(|(a, h)| a.is_hit() == h.is_hit()), "{count}");
            }
        }
    }

    #[test]
    fn only_a_few_triangles_and_nothing_else_are_scanned() {
        let scans = |geometry: Geometry| Accel::build(&[geometry], &[]).scan.is_some();
        assert!(!scans(flat(200, 0.1, 1)));
        assert!(!scans(soup(20, 0.1, 1)), "it has spheres");
        assert!(!scans(Geometry::default()));
    }
}
