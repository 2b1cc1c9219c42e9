//! The traversal loop: up to 32 rays in flight, in separate sets of rays at nodes and rays at leaves.
//!
//! A single ray is a chain of dependent loads and unpredictable branches. Here each step handles one ray, prefetches the cache
//! lines of its next step and continues with another ray, so that the memory latencies of 32 rays overlap; and since all rays of
//! a set are at the same kind of step, branches are predictable. The order in which a ray visits nodes does not depend on the
//! other rays, so batches of any size give the same hits.
//!
//! A ray that starts on a triangle, quad or disk carries that primitive's id and skips it, which also saves the exact test that
//! nearly every such ray would need.

use super::layout::{
    ANALYTIC_LINES, AnalyticPacket, CurvePacket, DONE, INSTANCE_LINES, InstanceRecord, KIND_ANALYTIC,
    LEAVE_INSTANCE, MOVING_TRIANGLES, NODE_LINES, Node, SPLAT_LINES, SPLATS, SplatPacket, TRIANGLE_LINES,
    TrianglePacket, curves_at, kind_of, line_of, primitive_uv, view,
};
use super::motion::{RayTimes, triangles_at};
use crate::math::{Hit, NO_HIT, OriginPrimitive, Ray};
use crate::sampling::hash::{mix64, unit};
use crate::shape::{Analytic, MAX_SQUARED_RADIUS, PreparedRay, Shape, octahedral, triangle};
use crate::simd::{BoxRay, Entry, Line, WIDEN, Wide, WideKernel, prefetch_lines};

/// SlotSet in flight: two bits of a `u64` each. Measured on large scenes: 16 are a fifth slower, 64 not faster.
pub const IN_FLIGHT: usize = 32;

/// Receives results.
pub trait Output {
    /// Whether a ray ends at its first hit (any-hit query).
    const ANY: bool;
    /// Whether the query asks for the hit after the ray's origin: hits at `t_min` count if their primitive follows the origin primitive
    /// in the order of ids.
    const NEXT: bool = false;
    /// Stores the result of a ray.
    fn emit(&mut self, index: usize, hit: &Hit);
}

/// Nearest hits.
pub struct ClosestHit<'a>(pub &'a mut [Hit]);
impl Output for ClosestHit<'_> {
    const ANY: bool = false;
    #[inline(always)]
    fn emit(&mut self, index: usize, hit: &Hit) {
        self.0[index] = *hit;
    }
}

/// Whether each ray has any hit.
pub struct AnyOccluder<'a>(pub &'a mut [bool]);
impl Output for AnyOccluder<'_> {
    const ANY: bool = true;
    #[inline(always)]
    fn emit(&mut self, index: usize, hit: &Hit) {
        self.0[index] = hit.prim != NO_HIT;
    }
}

/// Any hit of each ray.
pub struct AnyHit<'a>(pub &'a mut [Hit]);
impl Output for AnyHit<'_> {
    const ANY: bool = true;
    #[inline(always)]
    fn emit(&mut self, index: usize, hit: &Hit) {
        self.0[index] = *hit;
    }
}

/// The next hit after another one: see [`Output::NEXT`].
pub struct NextHit<'a>(pub &'a mut Hit);
impl Output for NextHit<'_> {
    const ANY: bool = false;
    const NEXT: bool = true;
    #[inline(always)]
    fn emit(&mut self, _index: usize, hit: &Hit) {
        *self.0 = *hit;
    }
}

/// Buffers that a thread keeps between calls.
pub struct Workspace {
    /// Slots for trees that need at most `ShallowSlot::STACK` stack entries.
    pub shallow: Vec<ShallowSlot>,
    /// Slots for deeper trees.
    pub deep: Vec<DeepSlot>,
}

impl Workspace {
    /// Allocates nothing yet.
    pub const fn new() -> Workspace {
        Workspace { shallow: Vec::new(), deep: Vec::new() }
    }
}

/// Traversal of a batch of rays.
pub struct RayStream<'a, O, C, const N: usize> {
    /// Nodes and packets.
    pub lines: &'a [Line],
    /// Reference to the root.
    pub root: u32,
    /// Largest absolute coordinate of the world, metres.
    pub reach: f32,
    pub rays: &'a [Ray],
    /// Ray times.
    pub times: C,
    /// The results.
    pub output: O,
    /// Scratch memory with stacks as deep as the tree needs.
    pub slots: &'a mut Vec<Slot<N>>,
}

impl<O: Output, C: RayTimes, const N: usize> WideKernel for RayStream<'_, O, C, N> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self, w: W) {
        let RayStream { lines, root, reach, rays, times, mut output, slots } = self;
        slots.resize(IN_FLIGHT, Slot::EMPTY);
        let Some(slots) = slots.first_chunk_mut() else { return };
        let mut in_flight = RaysInFlight {
            lines,
            root,
            reach,
            rays,
            times,
            slots,
            next_ray: 0,
            active: 0,
            next_kinds: 0,
            pending: 0,
            candidates: [Candidates { packet: 0, lanes: 0 }; IN_FLIGHT],
        };
        for id in 0..IN_FLIGHT.min(rays.len()) {
            in_flight.start(id, &mut output);
        }
        while in_flight.active != 0 {
            // All ray sets of a round are fixed before its first step: a loop bound that depends on the previous pass would be known
            // late and mispredicted.
            let pending = std::mem::take(&mut in_flight.pending);
            let (leaf, special) = (in_flight.next_kinds >> 1, in_flight.next_kinds);
            let free = in_flight.active & !pending;
            in_flight.next_kinds &= 3 * pending;
            in_flight.next_kinds |= in_flight.pass::<W, O, false>(w, free & !leaf);
            in_flight.next_kinds |= in_flight.pass::<W, O, true>(w, free & leaf & !special);
            let mut ids = pending;
            while ids != 0 {
                in_flight.exact_step::<W, O>(w, take_first(&mut ids));
            }
            let mut ids = free & special;
            while ids != 0 {
                in_flight.special_step(w, take_first(&mut ids), &mut output);
            }
        }
    }
}

/// A set of slots: bit `2 id` for slot `id`.
type SlotSet = u64;

/// The first slot of a set; unspecified if the set is empty.
#[inline(always)]
fn first_slot(rays: SlotSet) -> usize {
    (rays.trailing_zeros() / 2) as usize & (IN_FLIGHT - 1)
}

/// Removes and returns the first slot of a set.
#[inline(always)]
fn take_first(rays: &mut SlotSet) -> usize {
    let id = first_slot(*rays);
    *rays &= rays.wrapping_sub(1);
    id
}

/// The origin primitive of a ray for [`Output::NEXT`] queries, else `None`.
#[inline(always)]
fn previous_primitive<O: Output>(rays: &[Ray], index: u32) -> Option<OriginPrimitive> {
    if O::NEXT { Some(rays[index as usize].origin_primitive) } else { None }
}

struct RaysInFlight<'a, C, const N: usize> {
    lines: &'a [Line],
    root: u32,
    reach: f32,
    rays: &'a [Ray],
    times: C,
    slots: &'a mut [Slot<N>; IN_FLIGHT],
    next_ray: usize,
    /// Slots with a ray.
    active: SlotSet,
    /// Kind of the next step of each slot: bits 30 and 31 of the reference to visit, in bits `2 id` and `2 id + 1`.
    next_kinds: u64,
    /// SlotSet whose line intersects a triangle of their last packet: the exact test is pending.
    pending: SlotSet,
    /// Lanes to test, for the rays in `pending`.
    candidates: [Candidates; IN_FLIGHT],
}

/// The lanes of a packet to be tested exactly.
#[derive(Clone, Copy)]
struct Candidates {
    packet: u32,
    lanes: u32,
}

impl<C: RayTimes, const N: usize> RaysInFlight<'_, C, N> {
    /// Assigns the next ray that can hit something to a slot; the slot stays idle if there is none.
    #[inline(always)]
    fn start<O: Output>(&mut self, id: usize, output: &mut O) {
        while let Some(ray) = self.rays.get(self.next_ray) {
            let index = self.next_ray;
            self.next_ray += 1;
            let slot = &mut self.slots[id];
            slot.best = Hit::MISS;
            if !slot.set(ray, self.reach) {
                output.emit(index, &Hit::MISS);
                continue;
            }
            slot.clear_stack();
            slot.index = index as u32;
            slot.instance = 0;
            slot.origin_primitive = ray.origin_primitive.prim_of(0);
            self.active |= 1 << (2 * id);
            return self.route(id, self.root);
        }
    }

    /// Sets the next reference of a ray.
    #[inline(always)]
    fn route(&mut self, id: usize, reference: u32) {
        self.slots[id].current = reference;
        self.next_kinds |= self.prefetch(reference) << (2 * id);
    }

    /// Prefetches the lines of a reference. Returns the kind of step it needs.
    #[inline(always)]
    fn prefetch(&self, reference: u32) -> u64 {
        prefetch_lines::<NODE_LINES>(self.lines, line_of(reference));
        u64::from(reference >> 30)
    }

    /// Pops the topmost stack entry that is not farther than the ray's nearest hit, and prefetches it.
    #[inline(always)]
    fn pop<O: Output>(&mut self, id: usize) {
        let reference = self.slots[id].pop(0, O::ANY);
        self.next_kinds |= self.prefetch(reference) << (2 * id);
    }

    /// A step of each ray of a set, at nodes or, if `LEAVES`, at triangle packets. Returns the kinds of their next steps for
    /// [`Self::next_kinds`]. (Accumulated in a register, since a field would be stored after each step. The next reference is read one
    /// step ahead, so that each step starts with the load of its node.)
    #[inline(always)]
    fn pass<W: Wide, O: Output, const LEAVES: bool>(&mut self, w: W, mut rays: SlotSet) -> u64 {
        let mut next_kinds = 0;
        let mut next = self.first(rays);
        while rays != 0 {
            let (id, current) = next;
            rays &= rays.wrapping_sub(1);
            next = self.first(rays);
            let next_kind = if LEAVES {
                self.triangle_step::<W, O>(w, id, current)
            } else {
                self.node_step::<W, O>(w, id, current)
            };
            next_kinds |= next_kind << (2 * id);
        }
        next_kinds
    }

    /// The first slot of a set and its current reference; any slot if the set is empty.
    #[inline(always)]
    fn first(&self, rays: SlotSet) -> (usize, u32) {
        let id = first_slot(rays);
        (id, self.slots[id].current)
    }

    #[inline(always)]
    fn node_step<W: Wide, O: Output>(&mut self, w: W, id: usize, current: u32) -> u64 {
        let slot = &mut self.slots[id];
        let Some(node) = view::<Node, NODE_LINES>(self.lines, current as usize) else {
            return self.invalid_reference(id);
        };
        let (mask, near) = w.boxes(&node.planes, &slot.boxes, slot.t_min, slot.limit);
        if O::ANY {
            w.store_masked(mask, &node.child, slot.stack_top());
        } else {
            w.store_sorted(mask, near, &node.child, slot.stack_top());
        }
        let reference = slot.pop(mask.count_ones(), O::ANY);
        self.prefetch(reference)
    }

    /// Tests the ray's line against a triangle packet. Candidates are deferred to [`Self::exact_step`] without a branch, which would
    /// be unpredictable.
    #[inline(always)]
    fn triangle_step<W: Wide, O: Output>(&mut self, w: W, id: usize, current: u32) -> u64 {
        let slot = &mut self.slots[id];
        let Some(packet) = view::<TrianglePacket, TRIANGLE_LINES>(self.lines, line_of(current)) else {
            return self.invalid_reference(id);
        };
        let origin = w.equal(packet.ids(), slot.origin_primitive);
        let lanes = triangle::candidates(w, &packet.rows, &slot.ray, &slot.boxes) & !origin;
        self.candidates[id] = Candidates { packet: current, lanes };
        self.pending |= u64::from(lanes != 0) << (2 * id);
        slot.push_next(packet.next());
        let reference = slot.pop(0, O::ANY);
        self.prefetch(reference)
    }

    /// Ends a ray whose reference lies outside of the buffer, which never happens in a valid tree.
    #[cold]
    fn invalid_reference(&mut self, id: usize) -> u64 {
        self.slots[id].current = DONE;
        u64::from(DONE >> 30)
    }

    /// Tests candidate lanes exactly. The ray has already popped its next reference; after a nearer hit that pop is redone.
    #[inline(always)]
    fn exact_step<W: Wide, O: Output>(&mut self, w: W, id: usize) {
        let Candidates { packet, lanes } = self.candidates[id];
        let Some(packet) = view::<TrianglePacket, TRIANGLE_LINES>(self.lines, line_of(packet)) else {
            return;
        };
        let slot = &mut self.slots[id];
        let previous = previous_primitive::<O>(self.rays, slot.index);
        if slot.triangles(w, packet, lanes, O::ANY, previous) {
            slot.undo_pop();
            self.next_kinds &= !(3 << (2 * id));
            self.pop_unless_done::<O>(id);
        }
    }

    /// Pops the next entry, or ends the ray if it is an any-hit query with a hit.
    #[inline(always)]
    fn pop_unless_done<O: Output>(&mut self, id: usize) {
        let slot = &mut self.slots[id];
        if O::ANY && slot.best.prim != NO_HIT {
            return self.route(id, DONE);
        }
        self.pop::<O>(id);
    }

    /// A step at anything but a node or triangles: the end of the ray, other primitives, entering or leaving an instance.
    #[inline(always)]
    fn special_step<W: Wide, O: Output>(&mut self, w: W, id: usize, output: &mut O) {
        let current = self.slots[id].current;
        if current == DONE {
            return self.finish(id, output);
        }
        let next = if kind_of(current) == KIND_ANALYTIC {
            self.analytic::<W, O>(w, id, current)
        } else if current == LEAVE_INSTANCE {
            self.leave_instance(id)
        } else {
            return self.enter_instance::<O>(id, current);
        };
        self.slots[id].push_next(next);
        self.pop_unless_done::<O>(id);
    }

    /// Emits the result of a ray and starts the next one.
    #[inline(always)]
    fn finish<O: Output>(&mut self, id: usize, output: &mut O) {
        let slot = &self.slots[id];
        let mut hit = slot.best;
        hit.t = if hit.prim == NO_HIT { f32::INFINITY } else { hit.t * slot.ray.unscale };
        output.emit(slot.index as usize, &hit);
        self.active &= !(1 << (2 * id));
        self.start(id, output);
    }

    #[inline(always)]
    fn analytic<W: Wide, O: Output>(&mut self, w: W, id: usize, current: u32) -> u32 {
        let slot = &mut self.slots[id];
        let Some(packet) = view::<AnalyticPacket, ANALYTIC_LINES>(self.lines, line_of(current)) else {
            return DONE;
        };
        if C::MOVING && packet.kind[0] == MOVING_TRIANGLES {
            let time = self.times.time(slot.index as usize);
            if let Some(triangles) = triangles_at(self.lines, line_of(current), packet, time) {
                let origin = w.equal(triangles.ids(), slot.origin_primitive);
                let lanes = triangle::candidates(w, &triangles.rows, &slot.ray, &slot.boxes) & !origin;
                slot.triangles(w, &triangles, lanes, O::ANY, previous_primitive::<O>(self.rays, slot.index));
            }
            return packet.next;
        }
        if packet.kind[0] >= SPLATS {
            return self.curves_or_splats(id, current, packet);
        }
        let previous = previous_primitive::<O>(self.rays, slot.index);
        for lane in 0..4 {
            let Some(shape) = Analytic::unpack(&packet.packed(lane)) else { break };
            let is_origin = shape.is_flat() && packet.id[lane] == slot.origin_primitive;
            let t_min = slot.t_min_of(packet.id[lane], previous);
            let hit = shape.intersect(&slot.ray, t_min, slot.best.t).filter(|_| !is_origin);
            if let Some(t) = hit {
                slot.record_hit(t, 0.0, 0.0, packet.id[lane], previous);
            }
        }
        packet.next
    }

    /// Tests the curve segments or the splats of a packet.
    #[inline(never)]
    fn curves_or_splats(&mut self, id: usize, current: u32, packet: &AnalyticPacket) -> u32 {
        let (slot, line) = (&mut self.slots[id], line_of(current));
        let ray = slot.index as usize;
        if let Some(curves) = curves_at(self.lines, line, packet) {
            slot.curves(curves);
        } else if packet.kind[0] == SPLATS
            && let Some(splats) = view::<SplatPacket, SPLAT_LINES>(self.lines, line)
        {
            slot.splats(splats, &self.rays[ray], self.times.time(ray));
        }
        packet.next
    }

    /// Enters an instance: pushes the return to world space and transforms the ray. The world's tree below a top tree needs neither.
    #[inline(always)]
    fn enter_instance<O: Output>(&mut self, id: usize, current: u32) {
        let slot = &mut self.slots[id];
        let Some(record) = view::<InstanceRecord, INSTANCE_LINES>(self.lines, line_of(current)) else {
            return;
        };
        slot.push_next(record.next);
        if record.instance == 0 {
            slot.push(record.root);
            return self.pop::<O>(id);
        }
        let ray = if C::MOVING {
            let record = self.times.record(record, slot.index as usize);
            record.transform(&slot.ray, slot.t_min, slot.best.t)
        } else {
            record.transform(&slot.ray, slot.t_min, slot.best.t)
        };
        if slot.set(&ray, record.reach) {
            slot.push(LEAVE_INSTANCE);
            slot.push(record.root);
            slot.instance = record.instance;
            slot.origin_primitive = self.rays[slot.index as usize].origin_primitive.prim_of(record.instance);
        }
        self.pop::<O>(id);
    }

    /// Returns to world space: restores the world-space ray and keeps the nearest hit.
    #[inline(always)]
    fn leave_instance(&mut self, id: usize) -> u32 {
        let slot = &mut self.slots[id];
        let t = slot.best.t * slot.ray.unscale;
        let world = &self.rays[slot.index as usize];
        if slot.set(world, self.reach) {
            slot.best.t = t;
            slot.limit = t * WIDEN;
            slot.instance = 0;
            slot.origin_primitive = world.origin_primitive.prim_of(0);
        }
        DONE
    }
}

/// A ray in flight with a stack of `N - 8` entries, a power of two. The fields of node steps come first, in one cache line.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub struct Slot<const N: usize> {
    /// The ray prepared for box tests.
    pub boxes: BoxRay,
    /// Entry distance beyond which boxes are skipped: parameter of the nearest hit, widened by the rounding error.
    pub limit: f32,
    /// Lower bound of the ray parameter.
    pub t_min: f32,
    /// Index of the first free stack entry.
    top: u32,
    /// The reference to visit next.
    pub current: u32,
    /// Index of the ray in the batch.
    pub index: u32,
    /// The primitive that the ray starts on, if it belongs to the current instance; else `NO_HIT`.
    pub origin_primitive: u32,
    /// The ray prepared for primitive tests.
    pub ray: PreparedRay,
    /// The nearest hit so far; `t` is in units of the scaled direction in the current space.
    pub best: Hit,
    /// The current instance; 0 in world space.
    pub instance: u32,
    /// The stack, with 8 spare entries for a node's children.
    stack: [Entry; N],
}

/// Slots for trees of usual depth. An odd number of cache lines, so that slots map to different cache sets.
pub type ShallowSlot = Slot<264>;
/// Slots for the deepest trees. (For all trees they would cost 1 to 4 % of the speed by cache misses.)
pub type DeepSlot = Slot<1032>;

const _: () = assert!(size_of::<ShallowSlot>() / 64 % 2 == 1 && size_of::<DeepSlot>() / 64 % 2 == 1);

/// Whether a curve segment may be adjacent to the segment that a ray starts on: their ids are close. (False positives on other
/// curves only lose slivers at joints.)
#[inline(always)]
pub fn starts_near(id: u32, origin_primitive: u32) -> bool {
    const NEAR: u32 = 256;
    id.wrapping_sub(origin_primitive).wrapping_add(NEAR) <= 2 * NEAR
}

#[inline(always)]
fn ray_hash(ray: &Ray, time: f32) -> u64 {
    let pair = |a: f32, b: f32| u64::from(a.to_bits()) << 32 | u64::from(b.to_bits());
    let (o, d) = (ray.origin, ray.direction);
    let sum = mix64(mix64(mix64(pair(d.x, d.y)) ^ pair(d.z, o.x)) ^ pair(o.y, o.z));
    mix64(sum ^ u64::from(time.to_bits()))
}

impl<const N: usize> Slot<N> {
    /// Capacity of the stack. (Indices are taken modulo this, which replaces bounds checks.)
    pub const STACK: usize = N - 8;

    /// An unused slot.
    pub const EMPTY: Slot<N> = Slot {
        boxes: BoxRay::NONE,
        limit: 0.0,
        t_min: 0.0,
        top: 0,
        current: DONE,
        index: 0,
        origin_primitive: NO_HIT,
        ray: PreparedRay::NONE,
        best: Hit::MISS,
        instance: 0,
        stack: [Entry { reference: DONE, distance: f32::NEG_INFINITY }; N],
    };

    /// Prepares a ray in a space with coordinates up to `reach`; returns `false` without a change if the ray can't hit anything.
    #[inline(always)]
    pub fn set(&mut self, ray: &Ray, reach: f32) -> bool {
        let Some((t_min, t_max)) = self.ray.set(&mut self.boxes, ray, reach) else { return false };
        self.t_min = t_min;
        self.best.t = t_max;
        self.limit = t_max * WIDEN;
        true
    }

    /// Empties the stack down to the bottom entry.
    #[inline(always)]
    pub fn clear_stack(&mut self) {
        self.top = 0;
        self.push(DONE);
    }

    /// Memory for a node's children at the top of the stack.
    #[inline(always)]
    pub fn stack_top(&mut self) -> &mut [Entry; 8] {
        const { assert!(Self::STACK.is_power_of_two()) };
        self.stack[self.top as usize % Self::STACK..].first_chunk_mut().expect("eight entries are to spare")
    }

    /// Pushes a reference that is visited unconditionally.
    #[inline(always)]
    pub fn push(&mut self, reference: u32) {
        self.stack[self.top as usize % Self::STACK] = Entry { reference, distance: f32::NEG_INFINITY };
        self.top += 1;
    }

    /// Pushes the next packet of a leaf, if there is one, without a branch.
    #[inline(always)]
    pub fn push_next(&mut self, reference: u32) {
        let top = self.top + u32::from(reference != DONE);
        self.push(reference);
        self.top = top;
    }

    /// Adds `count` entries written above the top, then pops the topmost entry that is nearer than the nearest hit (any-hit queries:
    /// the topmost entry).
    #[inline(always)]
    pub fn pop(&mut self, count: u32, any_hit: bool) -> u32 {
        let below = |top: usize| top.wrapping_sub(1) % Self::STACK;
        let mut top = below((self.top + count) as usize);
        if !any_hit {
            // Integer comparison has less latency: neither is NaN, and the only negative value is negative infinity.
            while self.stack[top].distance.to_bits() as i32 > self.limit.to_bits() as i32 {
                top = below(top);
            }
        }
        self.top = top as u32;
        self.current = self.stack[top].reference;
        self.current
    }

    /// Undoes the last [`Slot::pop`].
    #[inline(always)]
    pub fn undo_pop(&mut self) {
        self.top += 1;
    }

    /// Tests lanes of a packet exactly; returns whether a nearer hit was found.
    #[inline(always)]
    pub fn triangles<W: Wide>(
        &mut self,
        w: W,
        packet: &TrianglePacket,
        mut lanes: u32,
        any_hit: bool,
        previous: Option<OriginPrimitive>,
    ) -> bool {
        let limit = self.limit;
        // Skipping the division if all lanes are behind the ray pays for shadow rays, many of whose candidates are; for other rays it
        // is only one more unpredictable branch.
        let required = if any_hit { lanes } else { u32::MAX };
        let t = triangle::plane_parameters(w, &packet.rows, &self.ray, required);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize & 3;
            lanes &= lanes - 1;
            if t[lane] > self.t_min && t[lane] <= self.best.t {
                self.triangle(packet, lane, t[lane], previous);
            }
        }
        self.limit < limit
    }

    #[inline(always)]
    fn triangle(&mut self, packet: &TrianglePacket, lane: usize, t: f32, previous: Option<OriginPrimitive>) {
        let Some(weights) = triangle::weights(&packet.rows, lane, &self.ray, &self.boxes) else { return };
        let (u, v) = primitive_uv(packet.part(lane), weights);
        self.record_hit(t, u, v, packet.id(lane), previous);
    }

    /// Tests the curve segments of a packet, except the one that the ray starts on.
    #[inline(never)]
    pub fn curves(&mut self, packet: &CurvePacket) {
        for lane in 0..packet.lanes() {
            let id = packet.id[lane];
            if id == self.origin_primitive {
                continue;
            }
            let starts_near = starts_near(id, self.origin_primitive);
            let segment = packet.segment(lane);
            if let Some((t, u)) = segment.intersect(&self.ray, self.t_min, self.best.t, starts_near) {
                self.record_hit(t, u, 0.0, id, None);
            }
        }
    }

    /// Tests the splats of a packet; `world` is the ray in world space. Each splat is accepted with a probability equal to its peak
    /// opacity along the ray, by a hash of ray, time and splat. (u, v) of the hit encode the ray's direction in object space.
    #[inline(always)]
    pub fn splats(&mut self, packet: &SplatPacket, world: &Ray, time: f32) {
        let lanes = packet.lanes();
        let (t, squared) = lanes.peaks(&self.ray);
        for lane in 0..4 {
            // NaN compares false.
            let is_near =
                squared[lane] < MAX_SQUARED_RADIUS && t[lane] > self.t_min && t[lane] <= self.best.t;
            if is_near && packet.id[lane] != self.origin_primitive {
                let opacity = lanes.opacity_at(lane, squared[lane]);
                self.accept(t[lane], opacity, packet.id[lane], (world, time));
            }
        }
    }

    /// Accepts a splat with the probability of its opacity.
    #[inline(always)]
    fn accept(&mut self, t: f32, opacity: f32, id: u32, (world, time): (&Ray, f32)) {
        let splat = u64::from(self.instance) << 32 | u64::from(id);
        let random = mix64(ray_hash(world, time) ^ mix64(splat + 1));
        // Random numbers are in [0, 1): an opacity of 0 is never accepted and an opacity of 1 always.
        if unit((random >> 32) as u32) < opacity {
            let [u, v] = octahedral(self.ray.direction);
            self.record_hit(t, u, v, id, None);
        }
    }

    /// The exclusive lower bound of `t` for a primitive of the current instance. Next-hit queries start just before their previous hit
    /// and exclude primitives up to `previous` at that distance.
    #[inline(always)]
    pub fn t_min_of(&self, prim: u32, previous: Option<OriginPrimitive>) -> f32 {
        match previous {
            Some(o) if (self.instance, prim) <= (o.instance, o.prim) => self.t_min.next_up(),
            _ => self.t_min,
        }
    }

    /// Stores a hit beyond the lower bound if it is nearer than the nearest so far, or at the same distance with a smaller id.
    #[inline(always)]
    pub fn record_hit(&mut self, t: f32, u: f32, v: f32, prim: u32, previous: Option<OriginPrimitive>) {
        let is_nearer = t < self.best.t;
        let wins_tie = t == self.best.t
            && self.best.prim != NO_HIT
            && (self.instance, prim) < (self.best.instance, self.best.prim);
        if t > self.t_min_of(prim, previous) && (is_nearer || wins_tie) {
            self.best = Hit { t, u, v, prim, instance: self.instance };
            self.limit = t * WIDEN;
        }
    }
}
