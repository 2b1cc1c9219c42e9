//! Visibility between one point and up to 64 others: shadow rays that share an end point.
//!
//! Node boxes are tested against the convex hull of all segments, triangles against 16 segments at a time: the origin and the
//! target must lie on different sides of the triangle's plane, and the origin within the three planes through the target and the
//! triangle's edges. Both tests have margins above the rounding error: a segment that passes both by more than the margin is
//! occluded, a segment within a margin gets the exact test of single rays. Results equal those of single rays bit for bit.

use super::Accel;
use super::layout::{
    ANALYTIC_LINES, AnalyticPacket, CurvePacket, DONE, INSTANCE_LINES, InstanceRecord, KIND_ANALYTIC,
    KIND_INSTANCE, LEAF, NODE_LINES, Node, Plane, TRIANGLE_LINES, TrianglePacket, curves_at, kind_of,
    line_of, view,
};
use super::traversal::starts_near;
use crate::math::{MACHINE_EPSILON, NO_HIT, OriginPrimitive, Ray, Vec3};
use crate::shape::triangle::{LANES, weights_of};
use crate::shape::{Analytic, PreparedRay, Shape};
use crate::simd::{Kernel, Level, Line, best_level, dispatch_at};

/// Segments that are tested together.
const LANES_PER_RUN: usize = 16;

/// Up to 64 segments that end at the same point.
#[derive(Clone, Copy, Debug)]
pub struct PointVisibilityQuery<'a> {
    /// The common end point, world space, metres.
    pub target: Vec3,
    /// Origins of the segments as arrays of x, y, z, world space, metres.
    pub origins: [&'a [f32]; 3],
    /// The primitives that the segments start on.
    pub origin_primitives: &'a [OriginPrimitive],
    /// The segments to test, one bit each. Bits beyond the last complete run of 16 entries of the arrays above are ignored.
    pub rays: u64,
}

impl PointVisibilityQuery<'_> {
    /// Segment `k` as a ray.
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

/// Result of a [`PointVisibilityQuery`], one bit for each segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PointVisibility {
    /// Segments that are occluded, as by [`Accel::occluded`].
    pub occluded_rays: u64,
    /// Undecided segments, to be tested as single rays: they enter instances or too many nodes.
    pub unknown: u64,
}

impl Accel {
    /// Tests the segments of a query for occlusion. Segments that only intersect primitives for which `is_uncertain` holds (such as
    /// transparent ones) are unknown.
    pub fn point_visibility(
        &self,
        query: &PointVisibilityQuery,
        is_uncertain: impl Fn(u32) -> bool,
    ) -> PointVisibility {
        self.point_visibility_at(best_level(), query, is_uncertain)
    }

    /// [`Accel::point_visibility`] on a CPU level, or on the best available one below it: for tests and measurements.
    pub fn point_visibility_at(
        &self,
        level: Level,
        query: &PointVisibilityQuery,
        is_uncertain: impl Fn(u32) -> bool,
    ) -> PointVisibility {
        let &Accel { ref lines, root, reach, .. } = self;
        dispatch_at(level, PointVisibilityKernel { lines, root, reach, query, is_uncertain })
    }
}

/// Iterates over the indices of the set bits.
pub struct SetBits(pub u64);

impl Iterator for SetBits {
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

/// The traversal for a query.
struct PointVisibilityKernel<'a, F> {
    lines: &'a [Line],
    root: u32,
    reach: f32,
    query: &'a PointVisibilityQuery<'a>,
    is_uncertain: F,
}

impl<F: Fn(u32) -> bool> Kernel for PointVisibilityKernel<'_, F> {
    type Output = PointVisibility;

    #[inline(always)]
    fn run(self) -> PointVisibility {
        let PointVisibilityKernel { lines, root, reach, query, is_uncertain } = self;
        let mut state = QueryState::new(query, reach);
        state.push(root);
        while let Some(reference) = state.pop() {
            if reference & LEAF != 0 {
                state.leaf(lines, reference, &is_uncertain);
            } else if let Some(node) = view::<Node, NODE_LINES>(lines, line_of(reference)) {
                for child in SetBits(u64::from(state.hull.boxes(&node.planes))) {
                    state.push(node.child[child % 8]);
                }
            }
        }
        let undecided = if state.gave_up { u64::MAX } else { state.uncertain };
        PointVisibility { occluded_rays: state.occluded_rays, unknown: undecided & state.rays }
    }
}

/// Entries of the traversal stack; a query that needs more is left undecided.
const STACK: usize = 128;

/// Number of nodes and packets after which a query is left undecided, plus one per [`RAYS_PER_EXTRA_VISIT`] segments: among many
/// small primitives single rays visit fewer nodes.
const BUDGET: u32 = 8;
const RAYS_PER_EXTRA_VISIT: u32 = 4;

/// Coordinates below this, metres, have triple products that fit in f32.
const MAX_COORDINATE: f32 = (1u64 << 40) as f32;

struct QueryState<'a> {
    query: &'a PointVisibilityQuery<'a>,
    hull: SegmentHull,
    /// Offsets from the target to the origins, metres.
    offsets: [[f32; RAYS]; 3],
    /// Number of runs of [`LANES_PER_RUN`] segments.
    runs: usize,
    /// Minimum and maximum offset by axis, metres.
    offset_bounds: [[f32; 3]; 2],
    /// Upper bound of the offsets' lengths, metres.
    length: f32,
    /// Origin primitive of each segment in the world's geometry.
    ignored: [u32; RAYS],
    /// Segments that are not occluded so far.
    rays: u64,
    occluded_rays: u64,
    /// Segments that may be occluded by uncertain primitives.
    uncertain: u64,
    /// Whether the traversal ended early: remaining segments are left to single rays.
    gave_up: bool,
    /// Number of nodes and packets that may still be visited.
    budget: u32,
    stack: [u32; STACK],
    top: usize,
}

impl<'a> QueryState<'a> {
    #[inline(always)]
    fn new(query: &'a PointVisibilityQuery<'a>, reach: f32) -> QueryState<'a> {
        let target = query.target.to_array();
        let (mut min, mut max) =
            ([[f32::INFINITY; LANES_PER_RUN]; 3], [[f32::NEG_INFINITY; LANES_PER_RUN]; 3]);
        let mut offsets = [[0.0; RAYS]; 3];
        let mut ignored = [NO_HIT; RAYS];
        let [xs, ys, zs] = query.origins;
        let primitives = query.origin_primitives.as_chunks().0;
        let [xs, ys, zs] = [xs.as_chunks().0, ys.as_chunks().0, zs.as_chunks().0];
        let runs = xs.len().min(ys.len()).min(zs.len()).min(primitives.len()).min(RAYS / LANES_PER_RUN);
        let in_arrays =
            if runs == RAYS / LANES_PER_RUN { u64::MAX } else { (1 << (runs * LANES_PER_RUN)) - 1 };
        let rays = query.rays & in_arrays;
        for run in 0..runs {
            let requested = (rays >> (run * LANES_PER_RUN)) as u32;
            let own: &[OriginPrimitive; LANES_PER_RUN] = &primitives[run];
            for k in 0..LANES_PER_RUN {
                ignored[run * LANES_PER_RUN + k] = own[k].prim_of(0);
            }
            let lanes: [&[f32; LANES_PER_RUN]; 3] = [&xs[run], &ys[run], &zs[run]];
            for axis in 0..3 {
                let (mut low, mut high) = (min[axis], max[axis]);
                for k in 0..LANES_PER_RUN {
                    let x = lanes[axis][k];
                    let is_requested = requested >> k & 1 == 1;
                    offsets[axis][run * LANES_PER_RUN + k] =
                        if is_requested { x - target[axis] } else { 0.0 };
                    low[k] = if is_requested & (x < low[k]) { x } else { low[k] };
                    high[k] = if is_requested & (x > high[k]) { x } else { high[k] };
                }
                (min[axis], max[axis]) = (low, high);
            }
        }
        let (min, max) = (reduce_lanes(&min, f32::min), reduce_lanes(&max, f32::max));
        let (mut low, mut high, mut longest, mut farthest) = ([0.0; 3], [0.0; 3], [0.0; 3], reach);
        for k in 0..3 {
            (low[k], high[k]) = (min[k] - target[k], max[k] - target[k]);
            longest[k] = f32::abs(low[k]).max(f32::abs(high[k]));
            farthest = farthest.max(target[k].abs()).max(min[k].abs()).max(max[k].abs());
        }
        QueryState {
            query,
            hull: SegmentHull::new(target, min, max, 64.0 * MACHINE_EPSILON * farthest),
            offsets,
            runs,
            offset_bounds: [low, high],
            length: Vec3::from_array(longest).length(),
            ignored,
            rays,
            occluded_rays: 0,
            uncertain: 0,
            // Triple products would overflow.
            gave_up: farthest >= MAX_COORDINATE,
            budget: BUDGET + rays.count_ones() / RAYS_PER_EXTRA_VISIT,
            stack: [DONE; STACK],
            top: 0,
        }
    }

    #[inline(always)]
    fn push(&mut self, reference: u32) {
        if self.top == STACK {
            self.gave_up = true;
            return;
        }
        self.stack[self.top] = reference;
        self.top += 1;
    }

    /// The next reference; `None` if all segments are decided or the traversal gave up.
    #[inline(always)]
    fn pop(&mut self) -> Option<u32> {
        if self.top == 0 || self.rays == 0 || self.gave_up {
            return None;
        }
        self.spend_budget();
        self.top -= 1;
        Some(self.stack[self.top % STACK])
    }

    /// Tests the primitives of a leaf.
    #[inline(always)]
    fn leaf(&mut self, lines: &[Line], first: u32, is_uncertain: &impl Fn(u32) -> bool) {
        let mut reference = first;
        while reference != DONE && !self.gave_up {
            let line = line_of(reference);
            reference = match kind_of(reference) {
                KIND_INSTANCE => {
                    let Some(record) = view::<InstanceRecord, INSTANCE_LINES>(lines, line) else { return };
                    self.push(record.root);
                    // The instance's geometry is in another space.
                    self.gave_up |= record.instance != 0;
                    record.next
                }
                KIND_ANALYTIC => {
                    let Some(packet) = view::<AnalyticPacket, ANALYTIC_LINES>(lines, line) else { return };
                    match curves_at(lines, line, packet) {
                        Some(curves) => self.curves(curves, is_uncertain),
                        // Splats only occur in instances, which are not entered.
                        None => self.analytic(packet, is_uncertain),
                    }
                    packet.next
                }
                _ => {
                    let Some(packet) = view::<TrianglePacket, TRIANGLE_LINES>(lines, line) else { return };
                    self.triangles(packet, is_uncertain);
                    self.budget = self.budget.saturating_sub(u32::from(packet.next() != DONE));
                    packet.next()
                }
            };
        }
    }

    #[inline(always)]
    fn spend_budget(&mut self) {
        self.gave_up |= self.budget == 0;
        self.budget = self.budget.saturating_sub(1);
    }

    #[inline(always)]
    fn mark_occluded(&mut self, k: usize) {
        self.rays &= !(1 << k);
        self.occluded_rays |= 1 << k;
    }

    #[inline(always)]
    fn triangles(&mut self, packet: &TrianglePacket, is_uncertain: &impl Fn(u32) -> bool) {
        let target = self.query.target.to_array();
        let sides = PlaneSides::new(packet, target, &self.offset_bounds);
        if sides.missed_by_all == [true; LANES] {
            return;
        }
        let edges = EdgePlanes::new(packet, target, self.length);
        for lane in 0..LANES {
            if sides.missed_by_all[lane] || packet.id(lane) == NO_HIT {
                continue;
            }
            for run in 0..self.runs.min(RAYS / LANES_PER_RUN) {
                let requested = (self.rays >> (run * LANES_PER_RUN)) as u32 & 0xffff;
                if requested != 0 {
                    let masks = self.classify(&sides, &edges, packet.id(lane), lane, run);
                    if (masks.possible & requested != 0) & is_uncertain(packet.id(lane)) {
                        self.uncertain |= u64::from(masks.possible & requested) << (run * LANES_PER_RUN);
                    } else {
                        self.resolve(packet, lane, run, masks, requested);
                    }
                }
            }
        }
    }

    /// Marks the segments of a run that are occluded by a triangle; segments within the margins get the exact test.
    #[inline(always)]
    fn resolve(&mut self, packet: &TrianglePacket, lane: usize, run: usize, masks: RayMasks, requested: u32) {
        let certain = u64::from(masks.certain & requested) << (run * LANES_PER_RUN);
        self.rays &= !certain;
        self.occluded_rays |= certain;
        for k in SetBits(u64::from(masks.possible & !masks.certain & requested) << (run * LANES_PER_RUN)) {
            if occludes(packet, lane, &self.query.ray(k)) {
                self.mark_occluded(k);
            }
        }
    }

    /// The segments of a run that possibly and that certainly intersect a triangle.
    #[inline(always)]
    fn classify(&self, sides: &PlaneSides, edges: &EdgePlanes, id: u32, lane: usize, run: usize) -> RayMasks {
        let normal = lane_of(&sides.normal, lane);
        let (side, side_margin, certain_margin) =
            (sides.side[lane], sides.margin[lane], sides.certain_margin[lane]);
        let [ab, bc, ca] = &edges.normals;
        let (ab, bc, ca) = (lane_of(ab, lane), lane_of(bc, lane), lane_of(ca, lane));
        let edge_margin = edges.margin[lane];
        let mut masks = RayMasks { possible: 0, certain: 0 };
        for k in 0..LANES_PER_RUN {
            let ray = run * LANES_PER_RUN + k;
            let start = side + along(normal, &self.offsets, ray);
            let (u, v) = (along(ab, &self.offsets, ray), along(bc, &self.offsets, ray));
            let w = along(ca, &self.offsets, ray);
            let least = if u < v { u } else { v };
            let least = if least < w { least } else { w };
            let most = if u > v { u } else { v };
            let most = if most > w { most } else { w };
            let is_outside = (least < -edge_margin) & (most > edge_margin);
            let is_in_front = start > side_margin;
            let is_inside = (least > edge_margin) | (most < -edge_margin);
            let is_new = self.ignored[ray] != id;
            masks.possible |= u32::from(!is_in_front & !is_outside & is_new) << k;
            masks.certain |= u32::from((start < certain_margin) & is_inside & is_new) << k;
        }
        masks
    }

    /// Tests curve segments, one ray at a time.
    #[inline(never)]
    fn curves(&mut self, packet: &CurvePacket, is_uncertain: &impl Fn(u32) -> bool) {
        for lane in 0..packet.lanes() {
            let (segment, id) = (packet.segment(lane), packet.id[lane]);
            for k in SetBits(self.rays) {
                let ignored = self.ignored[k];
                let mut prepared = PreparedRay::NONE;
                let Some(((t_min, t_max), _)) = prepared.set_line(&self.query.ray(k)) else { continue };
                let hit = segment.intersect(&prepared, t_min, t_max, starts_near(id, ignored));
                if hit.is_some_and(|(t, _)| t < t_max) && id != ignored {
                    if is_uncertain(id) {
                        self.uncertain |= 1 << k;
                    } else {
                        self.mark_occluded(k);
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn analytic(&mut self, packet: &AnalyticPacket, is_uncertain: &impl Fn(u32) -> bool) {
        for lane in 0..LANES {
            let Some(shape) = Analytic::unpack(&packet.packed(lane)) else { break };
            for k in SetBits(self.rays) {
                let mut prepared = PreparedRay::NONE;
                let Some(((t_min, t_max), _)) = prepared.set_line(&self.query.ray(k)) else { continue };
                let is_origin = shape.is_flat() && packet.id[lane] == self.ignored[k];
                if let Some(t) = shape.intersect(&prepared, t_min, t_max)
                    && t > t_min
                    && t < t_max
                    && !is_origin
                {
                    if is_uncertain(packet.id[lane]) {
                        self.uncertain |= 1 << k;
                    } else {
                        self.mark_occluded(k);
                    }
                }
            }
        }
    }
}

/// Reduces the lanes of each axis by a binary operation (minimum or maximum).
#[inline(always)]
fn reduce_lanes(lanes: &[[f32; LANES_PER_RUN]; 3], better: impl Fn(f32, f32) -> f32 + Copy) -> [f32; 3] {
    let mut all = [lanes[0][0], lanes[1][0], lanes[2][0]];
    for axis in 0..3 {
        for &lane in &lanes[axis] {
            all[axis] = better(all[axis], lane);
        }
    }
    all
}

/// The exact test of a single ray against a triangle.
#[inline(always)]
fn occludes(packet: &TrianglePacket, lane: usize, ray: &Ray) -> bool {
    let mut prepared = PreparedRay::NONE;
    let Some(((t_min, t_max), line)) = prepared.set_line(ray) else { return false };
    let t = Plane::new(packet, lane).parameter(&prepared);
    t > t_min && t < t_max && weights_of(|axis, k| packet.rows[4 * axis + k][lane], &line).is_some()
}

/// Minimum absolute component of a direction, metres, to keep its reciprocal finite.
const SMALLEST: f32 = 1.0 / (1u64 << 60) as f32;

/// Factor on the exit parameter that covers the rounding error of slab tests.
const SLACK: f32 = 1.0 + 32.0 * MACHINE_EPSILON;

/// The convex hull of all segments from a point to a box, for slab tests: bounds on the parameter (0 at the point, 1 at the box) at
/// which segments cross each plane of a node box.
pub struct SegmentHull {
    /// For each plane of a box: reciprocal of the extreme direction's component.
    inverse: [f32; 6],
    /// Offset of the entry parameter; negative infinity if the plane bounds the exit.
    near_offset: [f32; 6],
    /// Offset of the exit parameter; infinite if the plane bounds the entry.
    far_offset: [f32; 6],
}

impl SegmentHull {
    /// The hull of the segments from `from` to the box `min..max`; `margin` bounds their rounding error, metres.
    #[inline(always)]
    pub fn new(from: [f32; 3], min: [f32; 3], max: [f32; 3], margin: f32) -> SegmentHull {
        let mut hull = SegmentHull { inverse: [0.0; 6], near_offset: [0.0; 6], far_offset: [0.0; 6] };
        for axis in 0..3 {
            // The lower plane of a box needs the maximum of the direction's component, the upper plane the minimum.
            let extents = [max[axis] - from[axis] + margin, min[axis] - from[axis] - margin];
            for (upper, &extent) in extents.iter().enumerate() {
                let plane = 2 * axis + upper;
                let is_tiny = extent.abs() < SMALLEST;
                let inverse = 1.0 / if is_tiny { SMALLEST.copysign(extent) } else { extent };
                let side = if upper == 0 { -margin } else { margin };
                let offset = -(from[axis] - side) * inverse;
                // Segments enter through this plane if they point from it into the box, else they leave through it.
                let begins = (extent > 0.0) == (upper == 0);
                hull.inverse[plane] = inverse;
                hull.near_offset[plane] = if begins { offset } else { f32::NEG_INFINITY };
                hull.far_offset[plane] = if begins { f32::INFINITY } else { offset };
            }
        }
        hull
    }

    /// Bit mask of the boxes that the hull may intersect.
    #[inline(always)]
    pub fn boxes(&self, planes: &[[f32; 8]; 6]) -> u32 {
        let (mut near, mut far) = ([0.0f32; 8], [1.0f32; 8]);
        for (plane, boxes) in planes.iter().enumerate() {
            let (inverse, begin, end) =
                (self.inverse[plane], self.near_offset[plane], self.far_offset[plane]);
            for k in 0..8 {
                let t = boxes[k] * inverse;
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

/// Maximum number of segments of a query.
pub const RAYS: usize = 64;

/// One lane of a vector in structure-of-arrays layout.
#[inline(always)]
pub fn lane_of(v: &[[f32; LANES]; 3], lane: usize) -> [f32; 3] {
    [v[0][lane], v[1][lane], v[2][lane]]
}

/// The dot product of a vector and the offset of a segment.
#[inline(always)]
pub fn along(m: [f32; 3], offsets: &[[f32; RAYS]; 3], ray: usize) -> f32 {
    m[0] * offsets[0][ray] + m[1] * offsets[1][ray] + m[2] * offsets[2][ray]
}

/// Segments of a run that possibly and that certainly intersect a triangle, one bit each.
pub struct RayMasks {
    pub possible: u32,
    pub certain: u32,
}

/// The planes of four triangles, oriented towards the target.
pub struct PlaneSides {
    /// Normals of unit L1 length on the side of the target.
    pub normal: [[f32; LANES]; 3],
    /// Distance of the target from the planes, metres times the normal's length.
    pub side: [f32; LANES],
    /// Signed distance of an origin, positive on the side of the target, above which the segment doesn't cross the plane; same unit.
    pub margin: [f32; LANES],
    /// Negative signed distance of an origin below which the segment certainly crosses the plane; same unit.
    pub certain_margin: [f32; LANES],
    /// Whether no segment crosses the plane.
    pub missed_by_all: [bool; LANES],
}

impl PlaneSides {
    /// Computes in double precision, since rays start and end close to surfaces.
    #[inline(always)]
    pub fn new(packet: &TrianglePacket, target: [f32; 3], [low, high]: &[[f32; 3]; 2]) -> PlaneSides {
        let mut sides = PlaneSides {
            normal: [[0.0; LANES]; 3],
            side: [0.0; LANES],
            margin: [0.0; LANES],
            certain_margin: [0.0; LANES],
            missed_by_all: [false; LANES],
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
            // Scale of the end point's displacement by rounding of a ray's direction.
            let moved = |k: usize| n[k].abs() * f64::from(low[k].abs().max(high[k].abs()));
            let moved = moved(0) + moved(1) + moved(2);
            // Rounding error of the exact test, relevant if the triangle is much larger than the rays are long.
            let far = |k: usize| (f64::from(target[k]) - at(k, 0)).abs();
            let exact = (far(0) + far(1) + far(2) + moved) * (1.0 / (1u64 << 49) as f64);
            let is_off_plane = height.abs() > moved * f64::from(1.25 * MACHINE_EPSILON) + exact;
            let is_certainly_off_plane = height.abs() > moved * f64::from(4.0 * MACHINE_EPSILON) + exact;
            let sign = if height > 0.0 { 1.0 } else { -1.0 };
            let (side, mut least) = (height.abs() as f32, height.abs() as f32);
            for k in 0..3 {
                let normal = (n[k] * sign) as f32;
                let (a, b) = (normal * low[k], normal * high[k]);
                least += if a < b { a } else { b };
                sides.normal[k][lane] = normal;
            }
            let margin = 8.0 * MACHINE_EPSILON * (moved + height.abs()) as f32 + exact as f32;
            sides.side[lane] = side;
            sides.margin[lane] = if is_off_plane { margin } else { f32::INFINITY };
            sides.certain_margin[lane] = if is_certainly_off_plane { -margin } else { f32::NEG_INFINITY };
            // NaN in unused lanes and for triangles of zero area, which no ray hits.
            sides.missed_by_all[lane] = (is_off_plane & (least > margin)) | height.is_nan();
        }
        sides
    }
}

/// The planes through the target of a query and the edges of four triangles.
pub struct EdgePlanes {
    /// Unnormalised plane normals by edge, axis and lane.
    pub normals: [[[f32; LANES]; 3]; 3],
    /// Margin of the dot product of normal and offset beyond which an origin certainly lies on one side.
    pub margin: [f32; LANES],
}

impl EdgePlanes {
    #[inline(always)]
    pub fn new(packet: &TrianglePacket, target: [f32; 3], length: f32) -> EdgePlanes {
        let mut edges = EdgePlanes { normals: [[[0.0; LANES]; 3]; 3], margin: [0.0; LANES] };
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
            edges.margin[lane] = 32.0 * MACHINE_EPSILON * length * reach * reach + f32::MIN_POSITIVE;
        }
        edges
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::tests::{Rng, soup};
    use crate::accel::{AccelInstance, Geometry};
    use crate::math::DAffine3;

    /// Compares queries between surfaces and through empty space with single rays on all CPU levels. Returns the numbers of occluded,
    /// decided and all rays.
    fn check(accel: &Accel, geometry: &Geometry, queries: usize, width: f32) -> (usize, usize, usize) {
        let mut rng = Rng::new(11);
        let (mut occluded_count, mut all_rays, mut known_rays) = (0, 0, 0);
        for number in 0..queries {
            let on_triangle = |rng: &mut Rng| {
                let prim = rng.bits() % geometry.triangles.len() as u32;
                let [a, b, c] = geometry.triangles[prim as usize]
                    .map(|i| Vec3::from_array(geometry.positions[i as usize]));
                let (u, v) = (rng.unit() * 0.5, rng.unit() * 0.5);
                (a + (b - a) * u + (c - a) * v, prim)
            };
            let center = rng.vector();
            let (mut origins, mut origin_primitives) = ([[0.0; RAYS]; 3], [OriginPrimitive::NONE; RAYS]);
            let (on_surface, prim) = on_triangle(&mut rng);
            for k in 0..RAYS {
                let near = center + rng.vector() * width;
                let start = if number.is_multiple_of(2) { on_surface + rng.vector() * 1e-6 } else { near };
                for axis in 0..3 {
                    origins[axis][k] = start[axis];
                }
                if number.is_multiple_of(4) {
                    origin_primitives[k] = OriginPrimitive { prim, instance: 0 };
                }
            }
            let target = if number.is_multiple_of(3) { on_triangle(&mut rng).0 } else { rng.vector() };
            let rays = (u64::from(rng.bits()) << 32 | u64::from(rng.bits())) & (u64::MAX >> (number % 50));
            let query = PointVisibilityQuery {
                target,
                origins: origins.each_ref().map(|x| &x[..]),
                origin_primitives: &origin_primitives,
                rays,
            };
            let list: Vec<Ray> = SetBits(rays).map(|k| query.ray(k)).collect();
            let mut occluded = vec![false; list.len()];
            accel.occluded(&list, &mut occluded);
            let expected =
                SetBits(rays).zip(&occluded).fold(0, |set, (k, occluded)| set | u64::from(*occluded) << k);
            for level in Level::ALL.into_iter().filter(|l| l.is_available()) {
                let PointVisibility { occluded_rays, unknown } =
                    accel.point_visibility_at(level, &query, |_| false);
                assert_eq!(occluded_rays, expected & !unknown, "{number} {}", level.name());
                known_rays += (rays & !unknown).count_ones() as usize;
                // If all primitives are uncertain, no ray is decided as occluded.
                let uncertain = accel.point_visibility_at(level, &query, |_| true);
                assert!(uncertain.occluded_rays == 0 && expected & !uncertain.unknown == 0, "{number}");
            }
            occluded_count += expected.count_ones() as usize;
            all_rays += list.len();
        }
        let levels = Level::ALL.into_iter().filter(|l| l.is_available()).count();
        (occluded_count, known_rays / levels, all_rays)
    }

    #[test]
    fn queries_equal_single_rays_bit_for_bit() {
        for (count, size, width) in [(5, 0.8, 0.1), (60, 0.5, 0.3), (2000, 0.1, 0.02), (2000, 0.1, 1.0)] {
            let geometry = soup(count, size, count as u64);
            for analytic in [false, true] {
                let analytic = if analytic { geometry.analytic.clone() } else { Vec::new() };
                let geometry = Geometry { analytic, ..geometry.clone() };
                let accel = Accel::build(std::slice::from_ref(&geometry), &[]);
                let (occluded_rays, known, all) = check(&accel, &geometry, 1500, width);
                assert!(
                    occluded_rays * 50 > all && occluded_rays * 10 < all * 9,
                    "{occluded_rays} of {all} are occluded"
                );
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
    fn queries_with_non_finite_points_or_without_rays_find_no_occlusion() {
        let geometry = soup(30, 0.5, 1);
        let accel = Accel::build(&[geometry], &[]);
        let origins = [[f32::INFINITY; RAYS], [0.0; RAYS], [1e30; RAYS]];
        let origin_primitives = [OriginPrimitive::NONE; RAYS];
        for (target, rays) in [(Vec3::ZERO, u64::MAX), (Vec3::splat(f32::NAN), 3), (Vec3::ONE, 0)] {
            let query = PointVisibilityQuery {
                target,
                origins: origins.each_ref().map(|x| &x[..]),
                origin_primitives: &origin_primitives,
                rays,
            };
            assert_eq!(accel.point_visibility(&query, |_| false).occluded_rays, 0);
        }
    }
}
