//! Rays that end at the same point: visibility of one point from many.
//!
//! The boxes of the tree are tested against the hull of all rays of a fan, and triangles against all rays side by side:
//! first whether a ray's two ends lie on different sides of the triangle's plane, then whether it passes its edges. Both
//! accept too much rather than too little, by margins above all roundings. What is left are nearly only rays
//! that the triangle stops; the tests that decide on other rays' hits decide on these as well, so that the result is that of
//! single rays to the bit.

use super::layout::{
    ANALYTIC_LINES, AnalyticPacket, DONE, INSTANCE_LINES, InstanceRecord, KIND_ANALYTIC, KIND_INSTANCE, LEAF,
    NODE_LINES, Node, TRIANGLE_LINES, TrianglePacket, kind_of, line_of, view,
};
use super::plane::Plane;
use super::structure::Accel;
use crate::math::{NO_HIT, OriginPrimitive, Ray, Vec3};
use crate::shape::triangle::{LANES, weights_of};
use crate::shape::{Analytic, PreparedRay, Shape};
use crate::simd::{Kernel, Level, Line, best_level, dispatch_at};

/// Rays that are tested side by side.
const RUN: usize = 16;

/// At most as many rays are in a fan.
const RAYS: usize = 64;

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
    /// Which rays of a fan something stops.
    pub fn occluded_fan(&self, fan: &Fan) -> FanHits {
        self.occluded_fan_at(best_level(), fan)
    }

    /// The same on a CPU level, or on the best available one below it: for tests and measurements.
    pub fn occluded_fan_at(&self, level: Level, fan: &Fan) -> FanHits {
        dispatch_at(level, Walk { lines: &self.lines, root: self.root, reach: self.reach, fan })
    }
}

/// The numbers of the bits of a set.
#[inline(always)]
fn bits(set: u64) -> Bits {
    Bits(set)
}

/// Iterates over the numbers of the bits of a set.
struct Bits(u64);

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

/// How far a unit in the last place may be off, relative to a number.
const ROUNDING: f32 = f32::EPSILON / 2.0;

/// Walks the tree with a fan.
struct Walk<'a> {
    lines: &'a [Line],
    root: u32,
    reach: f32,
    fan: &'a Fan<'a>,
}

impl Kernel for Walk<'_> {
    type Output = FanHits;

    #[inline(always)]
    fn run(self) -> FanHits {
        let Walk { lines, root, reach, fan } = self;
        let mut state = State::new(fan, reach);
        state.push(root);
        while let Some(reference) = state.pop() {
            if reference & LEAF != 0 {
                state.leaf(lines, reference);
            } else if let Some(node) = view::<Node, NODE_LINES>(lines, line_of(reference)) {
                for child in bits(u64::from(state.hull.boxes(&node.planes))) {
                    state.push(node.child[child % 8]);
                }
            }
        }
        FanHits { stopped: state.stopped, unknown: if state.is_lost { state.rays } else { 0 } }
    }
}

/// Entries of the stack; what needs more is left to single rays.
const STACK: usize = 128;

/// A fan is given up after this many nodes and packets, and one more for some of its rays: where there are many small things,
/// single rays pass fewer.
const PATIENCE: u32 = 8;
const RAYS_FOR_PATIENCE: u32 = 4;

/// The hull of a fan, against boxes: the parameter at which each plane of a box is passed at the latest or at the soonest.
struct Hull {
    /// For each plane of a box: one over the component of the extreme direction, and the offset.
    inverse: [f32; 6],
    near_offset: [f32; 6],
    far_offset: [f32; 6],
}

impl Hull {
    /// All segments from a point to a box; `margin` is how far they may be off.
    #[inline(always)]
    fn new(from: [f32; 3], min: [f32; 3], max: [f32; 3], margin: f32) -> Hull {
        let mut hull = Hull { inverse: [0.0; 6], near_offset: [0.0; 6], far_offset: [0.0; 6] };
        for axis in 0..3 {
            // Against the lower plane of a box counts how far the segments go up, and the other way round.
            let ways = [max[axis] - from[axis] + margin, min[axis] - from[axis] - margin];
            for upper in 0..2 {
                let way = ways[upper];
                let plane = 2 * axis + upper;
                let is_tiny = way.abs() < SMALLEST;
                let inverse = 1.0 / if is_tiny { SMALLEST.copysign(way) } else { way };
                let side = if upper == 0 { -margin } else { margin };
                let offset = -(from[axis] - side) * inverse;
                // Segments that go towards the box from this plane begin behind it; others end there.
                let begins = (way > 0.0) == (upper == 0);
                hull.inverse[plane] = inverse;
                hull.near_offset[plane] = if begins { offset } else { f32::NEG_INFINITY };
                hull.far_offset[plane] = if begins { f32::INFINITY } else { offset };
            }
        }
        hull
    }

    /// The boxes that it may meet.
    #[inline(always)]
    fn boxes(&self, planes: &[[f32; 8]; 6]) -> u32 {
        let (mut near, mut far) = ([0.0f32; 8], [1.0f32; 8]);
        for plane in 0..6 {
            let (inverse, begin, end) =
                (self.inverse[plane], self.near_offset[plane], self.far_offset[plane]);
            for k in 0..8 {
                let t = planes[plane][k] * inverse;
                let (entry, exit) = (t + begin, t + end);
                near[k] = if entry > near[k] { entry } else { near[k] };
                far[k] = if exit < far[k] { exit } else { far[k] };
            }
        }
        let mut mask = 0;
        for k in 0..8 {
            mask |= u32::from(near[k] <= far[k] * SLACK) << k;
        }
        mask
    }
}

/// Coordinates up to this have products of three within an f32.
const GREATEST: f32 = (1u64 << 40) as f32;

/// Directions below this count as this much.
const SMALLEST: f32 = 1.0 / (1u64 << 60) as f32;

/// Roundings of a plane's parameter.
const SLACK: f32 = 1.0 + 32.0 * ROUNDING;

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
            // What overflows is left to others.
            is_lost: !(farthest < GREATEST),
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
    fn leaf(&mut self, lines: &[Line], first: u32) {
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
                    self.analytic(packet);
                    packet.next
                }
                _ => {
                    let Some(packet) = view::<TrianglePacket, TRIANGLE_LINES>(lines, line) else { return };
                    self.triangles(packet);
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
    fn triangles(&mut self, packet: &TrianglePacket) {
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
                    self.take(packet, lane, run, met, asked);
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
        for k in bits(u64::from(met.possible & !met.certain & asked) << (run * RUN)) {
            if stops(packet, lane, &self.fan.ray(k)) {
                self.rays &= !(1 << k);
                self.stopped |= 1 << k;
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
            let is_inside = (least > edge_margin) | (most < -edge_margin);
            let is_new = self.ignored[ray] != id;
            met.possible |= u32::from(!(start > side_margin) & !is_outside & is_new) << k;
            met.certain |= u32::from((start < sure) & is_inside & is_new) << k;
        }
        met
    }

    #[inline(always)]
    fn analytic(&mut self, packet: &AnalyticPacket) {
        for lane in 0..LANES {
            let Some(shape) = Analytic::unpack(&packet.packed(lane)) else { break };
            for k in bits(self.rays) {
                let mut prepared = PreparedRay::NONE;
                let Some(((t_min, t_max), _)) = prepared.set_line(&self.fan.ray(k)) else { continue };
                let leaves = shape.is_flat() && packet.id[lane] == self.ignored[k];
                if let Some(t) = shape.intersect(&prepared, t_min, t_max) {
                    if t > t_min && t < t_max && !leaves {
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
        for k in 1..RUN {
            all[axis] = better(all[axis], lanes[axis][k]);
        }
    }
    all
}

/// A lane of a vector.
#[inline(always)]
fn lane_of(v: &[[f32; LANES]; 3], lane: usize) -> [f32; 3] {
    [v[0][lane], v[1][lane], v[2][lane]]
}

/// Does a triangle stop a ray? Exactly as single rays are tested.
#[inline(always)]
fn stops(packet: &TrianglePacket, lane: usize, ray: &Ray) -> bool {
    let mut prepared = PreparedRay::NONE;
    let Some(((t_min, t_max), line)) = prepared.set_line(ray) else { return false };
    let t = Plane::new(packet, lane).parameter(&prepared);
    t > t_min && t < t_max && weights_of(|axis, k| packet.rows[4 * axis + k][lane], &line).is_some()
}

/// A component of a ray's way from the target.
#[inline(always)]
fn along(m: [f32; 3], ways: &[[f32; RAYS]; 3], ray: usize) -> f32 {
    m[0] * ways[0][ray] + m[1] * ways[1][ray] + m[2] * ways[2][ray]
}

/// Rays of a run, one bit each.
struct Met {
    possible: u32,
    certain: u32,
}

/// On which side of the planes of four triangles the target of a fan is.
struct Sides {
    /// Of the planes, of length about 1, on the side of the target.
    normal: [[f32; LANES]; 3],
    /// How far the target is from the planes.
    side: [f32; LANES],
    /// Rays whose start is farther from the plane than this, on the side of the target, don't cross it.
    margin: [f32; LANES],
    /// Those whose start is below this, which is negative, cross it for certain.
    certain_margin: [f32; LANES],
    /// No ray crosses it.
    beside: [bool; LANES],
}

impl Sides {
    /// In double precision, since rays start and end next to surfaces.
    #[inline(always)]
    fn new(packet: &TrianglePacket, target: [f32; 3], [low, high]: &[[f32; 3]; 2]) -> Sides {
        let mut sides = Sides {
            normal: [[0.0; LANES]; 3],
            side: [0.0; LANES],
            margin: [0.0; LANES],
            certain_margin: [0.0; LANES],
            beside: [false; LANES],
        };
        for lane in 0..LANES {
            let at = |axis: usize, vertex: usize| f64::from(packet.rows[4 * axis + vertex][lane]);
            let edge = |k: usize| [at(0, k) - at(0, 0), at(1, k) - at(1, 0), at(2, k) - at(2, 0)];
            let (e, f) = (edge(1), edge(2));
            let n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
            let scale = 1.0 / (n[0].abs() + n[1].abs() + n[2].abs());
            let n = [n[0] * scale, n[1] * scale, n[2] * scale];
            let height = |k: usize| n[k] * (f64::from(target[k]) - at(k, 0));
            let height = height(0) + height(1) + height(2);
            // How far the roundings of a ray's direction move its end.
            let moved = |k: usize| n[k].abs() * f64::from(low[k].abs().max(high[k].abs()));
            let moved = moved(0) + moved(1) + moved(2);
            let is_off = height.abs() > moved * f64::from(1.25 * ROUNDING);
            let is_well_off = height.abs() > moved * f64::from(4.0 * ROUNDING);
            let sign = if height > 0.0 { 1.0 } else { -1.0 };
            let (side, mut least) = (height.abs() as f32, height.abs() as f32);
            for k in 0..3 {
                let normal = (n[k] * sign) as f32;
                let (a, b) = (normal * low[k], normal * high[k]);
                least += if a < b { a } else { b };
                sides.normal[k][lane] = normal;
            }
            let margin = 8.0 * ROUNDING * (moved + height.abs()) as f32;
            sides.side[lane] = side;
            sides.margin[lane] = if is_off { margin } else { f32::INFINITY };
            sides.certain_margin[lane] = if is_well_off { -margin } else { f32::NEG_INFINITY };
            // Unused lanes are NaN, and so are triangles without area, which no ray hits.
            sides.beside[lane] = (is_off & (least > margin)) | height.is_nan();
        }
        sides
    }
}

/// The planes through the target of a fan and the edges of four triangles.
struct Edges {
    normals: [[[f32; LANES]; 3]; 3],
    /// Starts of rays that are farther from these planes than this are on a side of them.
    margin: [f32; LANES],
}

impl Edges {
    #[inline(always)]
    fn new(packet: &TrianglePacket, target: [f32; 3], length: f32) -> Edges {
        let mut edges = Edges { normals: [[[0.0; LANES]; 3]; 3], margin: [0.0; LANES] };
        for lane in 0..LANES {
            let at = |k: usize, vertex: usize| packet.rows[4 * k + vertex][lane] - target[k];
            let from = |vertex: usize| [at(0, vertex), at(1, vertex), at(2, vertex)];
            let corners = [from(0), from(1), from(2)];
            let mut greatest = 0.0;
            for e in 0..3 {
                let (a, b) = (corners[e], corners[(e + 1) % 3]);
                for k in 0..3 {
                    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                    edges.normals[e][k][lane] = a[i] * b[j] - a[j] * b[i];
                }
                let squared = a[0] * a[0] + a[1] * a[1] + a[2] * a[2];
                greatest = if squared > greatest { squared } else { greatest };
            }
            let reach = greatest.sqrt() + length;
            edges.margin[lane] = 32.0 * ROUNDING * length * reach * reach + f32::MIN_POSITIVE;
        }
        edges
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Rng, soup};
    use super::super::{AccelInstance, Geometry};
    use super::*;
    use crate::math::DAffine3;

    /// Fans between surfaces and through space: each ray's answer is that of the ray alone, on all levels.
    fn check(accel: &Accel, geometry: &Geometry, fans: usize, width: f32) -> (usize, usize, usize) {
        let mut rng = Rng::new(11);
        let (mut stopped_rays, mut all_rays, mut known_rays) = (0, 0, 0);
        for number in 0..fans {
            let on_triangle = |rng: &mut Rng| {
                let prim = rng.bits() % geometry.triangles.len() as u32;
                let [a, b, c] = geometry.triangles[prim as usize]
                    .map(|i| Vec3::from_array(geometry.positions[i as usize]));
                let (u, v) = (rng.unit() * 0.5, rng.unit() * 0.5);
                (a + (b - a) * u + (c - a) * v, prim)
            };
            let center = rng.vector();
            let (mut origins, mut origin_primitives) = ([[0.0; RAYS]; 3], [OriginPrimitive::NONE; RAYS]);
            let (on, prim) = on_triangle(&mut rng);
            for k in 0..RAYS {
                let near = center + rng.vector() * width;
                let start = if number.is_multiple_of(2) { on + rng.vector() * 1e-6 } else { near };
                for axis in 0..3 {
                    origins[axis][k] = start[axis];
                }
                if number.is_multiple_of(4) {
                    origin_primitives[k] = OriginPrimitive { prim, instance: 0 };
                }
            }
            let target = if number.is_multiple_of(3) { on_triangle(&mut rng).0 } else { rng.vector() };
            let rays = (u64::from(rng.bits()) << 32 | u64::from(rng.bits())) & (u64::MAX >> (number % 50));
            let fan = Fan {
                target,
                origins: origins.each_ref().map(|x| &x[..]),
                origin_primitives: &origin_primitives,
                rays,
            };
            let list: Vec<Ray> = bits(rays).map(|k| fan.ray(k)).collect();
            let mut occluded = vec![false; list.len()];
            accel.occluded(&list, &mut occluded);
            let expected =
                bits(rays).zip(&occluded).fold(0, |set, (k, occluded)| set | u64::from(*occluded) << k);
            for level in Level::ALL.into_iter().filter(|l| l.is_available()) {
                let FanHits { stopped, unknown } = accel.occluded_fan_at(level, &fan);
                assert_eq!(stopped, expected & !unknown, "{number} {}", level.name());
                known_rays += (rays & !unknown).count_ones() as usize;
            }
            stopped_rays += expected.count_ones() as usize;
            all_rays += list.len();
        }
        let levels = Level::ALL.into_iter().filter(|l| l.is_available()).count();
        (stopped_rays, known_rays / levels, all_rays)
    }

    #[test]
    fn fans_are_their_rays_to_the_bit() {
        for (count, size, width) in [(5, 0.8, 0.1), (60, 0.5, 0.3), (2000, 0.1, 0.02), (2000, 0.1, 1.0)] {
            let geometry = soup(count, size, count as u64);
            for analytic in [false, true] {
                let analytic = if analytic { geometry.analytic.clone() } else { Vec::new() };
                let geometry = Geometry { analytic, ..geometry.clone() };
                let accel = Accel::build(std::slice::from_ref(&geometry), &[]);
                let (stopped, known, all) = check(&accel, &geometry, 1500, width);
                assert!(stopped * 50 > all && stopped * 10 < all * 9, "{stopped} of {all} are stopped");
                assert!(count > 100 || known * 10 > all, "{known} of {all} are known");
            }
        }
    }

    #[test]
    fn instances_are_left_to_single_rays() {
        let (world, placed) = (soup(40, 0.4, 1), soup(50, 0.3, 2));
        let world_from_object = DAffine3::from_rotation_x(0.5);
        let accel =
            Accel::build(&[world.clone(), placed], &[AccelInstance { geometry: 1, world_from_object }]);
        check(&accel, &world, 500, 0.2);
    }

    #[test]
    fn fans_far_away_and_without_rays_are_answered() {
        let geometry = soup(30, 0.5, 1);
        let accel = Accel::build(&[geometry], &[]);
        let origins = [[f32::INFINITY; RAYS], [0.0; RAYS], [1e30; RAYS]];
        let origin_primitives = [OriginPrimitive::NONE; RAYS];
        for (target, rays) in [(Vec3::ZERO, u64::MAX), (Vec3::splat(f32::NAN), 3), (Vec3::ONE, 0)] {
            let fan = Fan {
                target,
                origins: origins.each_ref().map(|x| &x[..]),
                origin_primitives: &origin_primitives,
                rays,
            };
            assert_eq!(accel.occluded_fan(&fan).stopped, 0);
        }
    }
}
