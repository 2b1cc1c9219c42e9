//! Rays that end at the same point: visibility of one point from many.
//!
//! The boxes of the tree are tested against the hull of all rays of a fan, and triangles against all rays side by side:
//! first whether a ray's two ends lie on different sides of the triangle's plane, then whether it passes its edges. Both
//! accept too much rather than too little, by margins above all roundings. Rays that pass both by as much are stopped; the few
//! in between are tested as single rays are, so that the result is that of single rays to the bit.

mod hull;
mod planes;
#[cfg(test)]
mod tests;

use super::layout::{
    ANALYTIC_LINES, AnalyticPacket, CurvePacket, DONE, INSTANCE_LINES, InstanceRecord, KIND_ANALYTIC,
    KIND_INSTANCE, LEAF, NODE_LINES, Node, TRIANGLE_LINES, TrianglePacket, curves_at, kind_of, line_of, view,
};
use super::plane::Plane;
use super::slot::starts_near;
use super::structure::Accel;
use crate::math::{NO_HIT, OriginPrimitive, Ray, Vec3};
use crate::shape::triangle::{LANES, weights_of};
use crate::shape::{Analytic, PreparedRay, Shape};
use crate::simd::{Kernel, Level, Line, best_level, dispatch_at};
use hull::Hull;
use planes::{Edges, Met, RAYS, ROUNDING, Sides, along, lane_of};

/// Rays that are tested side by side.
const RUN: usize = 16;

/// Up to 64 rays that end at the same point.
#[derive(Clone, Copy, Debug)]
pub struct Fan<'a> {
    /// Where they end.
    pub target: Vec3,
    /// Where they start: x, y, z of each.
    pub origins: [&'a [f32]; 3],
    /// The primitives that they start on.
    pub origin_primitives: &'a [OriginPrimitive],
    /// The rays that are asked for, one bit each; those beyond the lists above are not, nor is what is left of these after
    /// whole sixteens.
    pub rays: u64,
}

impl Fan<'_> {
    /// One of its rays.
    #[inline(always)]
    fn ray(&self, k: usize) -> Ray {
        let origin = self.origin(k);
        Ray { origin_primitive: self.origin_primitives[k], ..Ray::segment(origin, self.target - origin) }
    }

    #[inline(always)]
    fn origin(&self, k: usize) -> Vec3 {
        Vec3::new(self.origins[0][k], self.origins[1][k], self.origins[2][k])
    }
}

/// What is known of a fan's rays, one bit each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FanHits {
    /// Something stops these: as [`Accel::occluded`] says.
    pub stopped: u64,
    /// These must be tested one by one: what they pass is too fine for fans, or placed with a transform.
    pub unknown: u64,
}

impl Accel {
    /// Which rays of a fan something stops. Rays that only primitives stop of which `is_doubtful` holds are unknown.
    pub fn occluded_fan(&self, fan: &Fan, is_doubtful: impl Fn(u32) -> bool) -> FanHits {
        self.occluded_fan_at(best_level(), fan, is_doubtful)
    }

    /// The same on a CPU level, or on the best available one below it: for tests and measurements.
    pub fn occluded_fan_at(&self, level: Level, fan: &Fan, is_doubtful: impl Fn(u32) -> bool) -> FanHits {
        let &Accel { ref lines, root, reach, .. } = self;
        dispatch_at(level, Walk { lines, root, reach, fan, is_doubtful })
    }
}

/// Iterates over the numbers of the bits of a set.
pub struct Bits(pub u64);

impl Iterator for Bits {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        let lowest = self.0.trailing_zeros() as usize;
        self.0 &= self.0 - 1;
        Some(lowest)
    }
}

/// Walks the tree with a fan.
struct Walk<'a, F> {
    lines: &'a [Line],
    root: u32,
    reach: f32,
    fan: &'a Fan<'a>,
    is_doubtful: F,
}

impl<F: Fn(u32) -> bool> Kernel for Walk<'_, F> {
    type Output = FanHits;

    #[inline(always)]
    fn run(self) -> FanHits {
        let Walk { lines, root, reach, fan, is_doubtful } = self;
        let mut state = State::new(fan, reach);
        state.push(root);
        while let Some(reference) = state.pop() {
            if reference & LEAF != 0 {
                state.leaf(lines, reference, &is_doubtful);
            } else if let Some(node) = view::<Node, NODE_LINES>(lines, line_of(reference)) {
                for child in Bits(u64::from(state.hull.boxes(&node.planes))) {
                    state.push(node.child[child % 8]);
                }
            }
        }
        let left = if state.is_lost { u64::MAX } else { state.unsure };
        FanHits { stopped: state.stopped, unknown: left & state.rays }
    }
}

/// Entries of the stack; what needs more is left to single rays.
const STACK: usize = 128;

/// A fan is given up after this many nodes and packets, and one more for some of its rays: where there are many small things,
/// single rays pass fewer.
const PATIENCE: u32 = 8;
const RAYS_FOR_PATIENCE: u32 = 4;

/// Coordinates up to this have products of three within an f32.
const GREATEST: f32 = (1u64 << 40) as f32;

struct State<'a> {
    fan: &'a Fan<'a>,
    hull: Hull,
    /// From the target to where the rays start.
    ways: [[f32; RAYS]; 3],
    /// How many runs of rays there are.
    runs: usize,
    /// At least and at most this by axis.
    ways_between: [[f32; 3]; 2],
    /// At most this long.
    length: f32,
    /// The primitives that the rays start on, in the space of the world.
    ignored: [u32; RAYS],
    /// Rays that nothing has stopped yet.
    rays: u64,
    stopped: u64,
    /// Rays that what may be absent may stop.
    unsure: u64,
    /// Does the rest need single rays?
    is_lost: bool,
    /// Nodes and packets that may still be visited.
    patience: u32,
    stack: [u32; STACK],
    top: usize,
}

impl<'a> State<'a> {
    #[inline(always)]
    fn new(fan: &'a Fan<'a>, reach: f32) -> State<'a> {
        let target = fan.target.to_array();
        let (mut min, mut max) = ([[f32::INFINITY; RUN]; 3], [[f32::NEG_INFINITY; RUN]; 3]);
        let mut ways = [[0.0; RAYS]; 3];
        let mut ignored = [NO_HIT; RAYS];
        let [xs, ys, zs] = fan.origins;
        let primitives = fan.origin_primitives.as_chunks().0;
        let [xs, ys, zs] = [xs.as_chunks().0, ys.as_chunks().0, zs.as_chunks().0];
        let runs = xs.len().min(ys.len()).min(zs.len()).min(primitives.len()).min(RAYS / RUN);
        let listed = if runs == RAYS / RUN { u64::MAX } else { (1 << (runs * RUN)) - 1 };
        let rays = fan.rays & listed;
        for run in 0..runs {
            let asked = (rays >> (run * RUN)) as u32;
            let own: &[OriginPrimitive; RUN] = &primitives[run];
            for k in 0..RUN {
                ignored[run * RUN + k] = own[k].prim_of(0);
            }
            let lanes: [&[f32; RUN]; 3] = [&xs[run], &ys[run], &zs[run]];
            for axis in 0..3 {
                let (mut low, mut high) = (min[axis], max[axis]);
                for k in 0..RUN {
                    let x = lanes[axis][k];
                    let is_asked = asked >> k & 1 == 1;
                    ways[axis][run * RUN + k] = if is_asked { x - target[axis] } else { 0.0 };
                    low[k] = if is_asked & (x < low[k]) { x } else { low[k] };
                    high[k] = if is_asked & (x > high[k]) { x } else { high[k] };
                }
                (min[axis], max[axis]) = (low, high);
            }
        }
        let (min, max) = (all_of(&min, f32::min), all_of(&max, f32::max));
        let (mut low, mut high, mut longest, mut farthest) = ([0.0; 3], [0.0; 3], [0.0; 3], reach);
        for k in 0..3 {
            (low[k], high[k]) = (min[k] - target[k], max[k] - target[k]);
            longest[k] = f32::abs(low[k]).max(f32::abs(high[k]));
            farthest = farthest.max(target[k].abs()).max(min[k].abs()).max(max[k].abs());
        }
        State {
            fan,
            hull: Hull::new(target, min, max, 64.0 * ROUNDING * farthest),
            ways,
            runs,
            ways_between: [low, high],
            length: Vec3::from_array(longest).length(),
            ignored,
            rays,
            stopped: 0,
            unsure: 0,
            // What overflows is left to others.
            is_lost: farthest >= GREATEST,
            patience: PATIENCE + rays.count_ones() / RAYS_FOR_PATIENCE,
            stack: [DONE; STACK],
            top: 0,
        }
    }

    #[inline(always)]
    fn push(&mut self, reference: u32) {
        if self.top == STACK {
            self.is_lost = true;
            return;
        }
        self.stack[self.top] = reference;
        self.top += 1;
    }

    /// What is visited next; nothing where all is known or the rest needs single rays.
    #[inline(always)]
    fn pop(&mut self) -> Option<u32> {
        if self.top == 0 || self.rays == 0 || self.is_lost {
            return None;
        }
        self.spend();
        self.top -= 1;
        Some(self.stack[self.top % STACK])
    }

    /// Tests what a leaf holds.
    #[inline(always)]
    fn leaf(&mut self, lines: &[Line], first: u32, is_doubtful: &impl Fn(u32) -> bool) {
        let mut reference = first;
        while reference != DONE && !self.is_lost {
            let line = line_of(reference);
            reference = match kind_of(reference) {
                KIND_INSTANCE => {
                    let Some(record) = view::<InstanceRecord, INSTANCE_LINES>(lines, line) else { return };
                    self.push(record.root);
                    // Its space is another one.
                    self.is_lost |= record.instance != 0;
                    record.next
                }
                KIND_ANALYTIC => {
                    let Some(packet) = view::<AnalyticPacket, ANALYTIC_LINES>(lines, line) else { return };
                    match curves_at(lines, line, packet) {
                        Some(curves) => self.curves(curves, is_doubtful),
                        None => self.analytic(packet, is_doubtful),
                    }
                    packet.next
                }
                _ => {
                    let Some(packet) = view::<TrianglePacket, TRIANGLE_LINES>(lines, line) else { return };
                    self.triangles(packet, is_doubtful);
                    self.patience = self.patience.saturating_sub(u32::from(packet.next() != DONE));
                    packet.next()
                }
            };
        }
    }

    #[inline(always)]
    fn spend(&mut self) {
        self.is_lost |= self.patience == 0;
        self.patience = self.patience.saturating_sub(1);
    }

    #[inline(always)]
    fn stop(&mut self, k: usize) {
        self.rays &= !(1 << k);
        self.stopped |= 1 << k;
    }

    #[inline(always)]
    fn triangles(&mut self, packet: &TrianglePacket, is_doubtful: &impl Fn(u32) -> bool) {
        let target = self.fan.target.to_array();
        let sides = Sides::new(packet, target, &self.ways_between);
        if sides.beside == [true; LANES] {
            return;
        }
        let edges = Edges::new(packet, target, self.length);
        for lane in 0..LANES {
            if sides.beside[lane] || packet.id(lane) == NO_HIT {
                continue;
            }
            for run in 0..self.runs.min(RAYS / RUN) {
                let asked = (self.rays >> (run * RUN)) as u32 & 0xffff;
                if asked != 0 {
                    let met = self.meets(&sides, &edges, packet.id(lane), lane, run);
                    if (met.possible & asked != 0) & is_doubtful(packet.id(lane)) {
                        self.unsure |= u64::from(met.possible & asked) << (run * RUN);
                    } else {
                        self.take(packet, lane, run, met, asked);
                    }
                }
            }
        }
    }

    /// Takes what a triangle may stop and what it does stop of a run.
    #[inline(always)]
    fn take(&mut self, packet: &TrianglePacket, lane: usize, run: usize, met: Met, asked: u32) {
        let certain = u64::from(met.certain & asked) << (run * RUN);
        self.rays &= !certain;
        self.stopped |= certain;
        for k in Bits(u64::from(met.possible & !met.certain & asked) << (run * RUN)) {
            if stops(packet, lane, &self.fan.ray(k)) {
                self.stop(k);
            }
        }
    }

    /// The rays of a run that a triangle may stop, and those that it stops for certain: which cross its plane and pass
    /// between its edges.
    #[inline(always)]
    fn meets(&self, sides: &Sides, edges: &Edges, id: u32, lane: usize, run: usize) -> Met {
        let normal = lane_of(&sides.normal, lane);
        let (side, side_margin, sure) = (sides.side[lane], sides.margin[lane], sides.certain_margin[lane]);
        let [ab, bc, ca] = &edges.normals;
        let (ab, bc, ca) = (lane_of(ab, lane), lane_of(bc, lane), lane_of(ca, lane));
        let edge_margin = edges.margin[lane];
        let mut met = Met { possible: 0, certain: 0 };
        for k in 0..RUN {
            let ray = run * RUN + k;
            let start = side + along(normal, &self.ways, ray);
            let (u, v) = (along(ab, &self.ways, ray), along(bc, &self.ways, ray));
            let w = along(ca, &self.ways, ray);
            let least = if u < v { u } else { v };
            let least = if least < w { least } else { w };
            let most = if u > v { u } else { v };
            let most = if most > w { most } else { w };
            let is_outside = (least < -edge_margin) & (most > edge_margin);
            let is_beside = start > side_margin;
            let is_inside = (least > edge_margin) | (most < -edge_margin);
            let is_new = self.ignored[ray] != id;
            met.possible |= u32::from(!is_beside & !is_outside & is_new) << k;
            met.certain |= u32::from((start < sure) & is_inside & is_new) << k;
        }
        met
    }

    /// Pieces of curves, for each ray as alone.
    #[inline(never)]
    fn curves(&mut self, packet: &CurvePacket, is_doubtful: &impl Fn(u32) -> bool) {
        for lane in 0..packet.lanes() {
            let (segment, id) = (packet.segment(lane), packet.id[lane]);
            for k in Bits(self.rays) {
                let ignored = self.ignored[k];
                let mut prepared = PreparedRay::NONE;
                let Some(((t_min, t_max), _)) = prepared.set_line(&self.fan.ray(k)) else { continue };
                let hit = segment.intersect(&prepared, t_min, t_max, starts_near(id, ignored));
                if hit.is_some_and(|(t, _)| t < t_max) && id != ignored {
                    if is_doubtful(id) {
                        self.unsure |= 1 << k;
                    } else {
                        self.stop(k);
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn analytic(&mut self, packet: &AnalyticPacket, is_doubtful: &impl Fn(u32) -> bool) {
        for lane in 0..LANES {
            let Some(shape) = Analytic::unpack(&packet.packed(lane)) else { break };
            for k in Bits(self.rays) {
                let mut prepared = PreparedRay::NONE;
                let Some(((t_min, t_max), _)) = prepared.set_line(&self.fan.ray(k)) else { continue };
                let leaves = shape.is_flat() && packet.id[lane] == self.ignored[k];
                if let Some(t) = shape.intersect(&prepared, t_min, t_max)
                    && t > t_min
                    && t < t_max
                    && !leaves
                {
                    if is_doubtful(packet.id[lane]) {
                        self.unsure |= 1 << k;
                    } else {
                        self.stop(k);
                    }
                }
            }
        }
    }
}

/// The least or greatest of each axis.
#[inline(always)]
fn all_of(lanes: &[[f32; RUN]; 3], better: impl Fn(f32, f32) -> f32 + Copy) -> [f32; 3] {
    let mut all = [lanes[0][0], lanes[1][0], lanes[2][0]];
    for axis in 0..3 {
        for &lane in &lanes[axis] {
            all[axis] = better(all[axis], lane);
        }
    }
    all
}

/// Does a triangle stop a ray? Exactly as single rays are tested.
#[inline(always)]
fn stops(packet: &TrianglePacket, lane: usize, ray: &Ray) -> bool {
    let mut prepared = PreparedRay::NONE;
    let Some(((t_min, t_max), line)) = prepared.set_line(ray) else { return false };
    let t = Plane::new(packet, lane).parameter(&prepared);
    t > t_min && t < t_max && weights_of(|axis, k| packet.rows[4 * axis + k][lane], &line).is_some()
}
