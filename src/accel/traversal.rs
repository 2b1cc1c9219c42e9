//! The traversal loop: up to 32 rays in flight, split into a queue of rays at nodes and a queue of rays at leaves.
//!
//! A single ray is a chain of dependent loads and unpredictable branches. Here each step handles one ray, prefetches the
//! lines that this ray needs next, and continues with another ray, so that the waiting of 32 rays overlaps; and since a
//! queue holds only one kind of work, its branches are predictable. The order in which one ray visits its own nodes
//! does not depend on the others: batches of any size give the same hits.
//!
//! A ray that leaves a triangle, quad or disk says so: that primitive counts as missed, without an exact test, which nearly every
//! such ray would ask for.

use super::layout::{
    ANALYTIC_LINES, AnalyticPacket, CurvePacket, DONE, INSTANCE_LINES, InstanceRecord, KIND_ANALYTIC,
    LEAVE_INSTANCE, MOVING_TRIANGLES, NODE_LINES, Node, SPLAT_LINES, SPLATS, SplatPacket, TRIANGLE_LINES,
    TrianglePacket, curves_at, kind_of, line_of, primitive_uv, view,
};
use super::motion::{RayTimes, triangles_at};
use crate::math::{Hit, NO_HIT, OriginPrimitive, Ray};
use crate::sampling::hash::{mix64, unit};
use crate::shape::{Analytic, LARGEST_SQUARED, PreparedRay, Shape, octahedral, triangle};
use crate::simd::{BoxRay, Entry, Line, WIDEN, Wide, WideKernel, prefetch_lines};

/// Rays in flight: two bits of a `u64` each. 32 is the knee: 16 lose a fifth on large scenes, 64 gain nothing.
pub const IN_FLIGHT: usize = 32;

/// Receives results.
pub trait Output {
    /// Does a ray end at its first hit?
    const ANY: bool;
    /// Does a ray continue the sequence of hits: do hits at its start count if their primitive follows the origin primitive in the order
    /// of ids?
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

/// Whether there is any hit.
pub struct AnyOccluder<'a>(pub &'a mut [bool]);
impl Output for AnyOccluder<'_> {
    const ANY: bool = true;
    #[inline(always)]
    fn emit(&mut self, index: usize, hit: &Hit) {
        self.0[index] = hit.prim != NO_HIT;
    }
}

/// Any hits.
pub struct AnyHit<'a>(pub &'a mut [Hit]);
impl Output for AnyHit<'_> {
    const ANY: bool = true;
    #[inline(always)]
    fn emit(&mut self, index: usize, hit: &Hit) {
        self.0[index] = *hit;
    }
}

/// The hit that follows another one: see [`Output::NEXT`].
pub struct NextHit<'a>(pub &'a mut Hit);
impl Output for NextHit<'_> {
    const ANY: bool = false;
    const NEXT: bool = true;
    #[inline(always)]
    fn emit(&mut self, _index: usize, hit: &Hit) {
        *self.0 = *hit;
    }
}

/// Memory that a thread keeps between calls.
pub struct Workspace {
    /// For trees that need stacks of at most `ShallowSlot::STACK` entries.
    pub shallow: Vec<ShallowSlot>,
    /// For the others.
    pub deep: Vec<DeepSlot>,
}

impl Workspace {
    /// Without memory yet.
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
    /// The largest absolute coordinate of the world.
    pub reach: f32,
    /// The rays.
    pub rays: &'a [Ray],
    /// Their times.
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
            waiting: 0,
            exact: 0,
            candidates: [Candidates { packet: 0, lanes: 0 }; IN_FLIGHT],
        };
        for id in 0..IN_FLIGHT.min(rays.len()) {
            in_flight.start(id, &mut output);
        }
        while in_flight.active != 0 {
            // The ray sets of all passes of a round are fixed before its first step: a loop bound that depends on the pass before
            // would be known late and mispredicted.
            let exact = std::mem::take(&mut in_flight.exact);
            let (leaf, special) = (in_flight.waiting >> 1, in_flight.waiting);
            let free = in_flight.active & !exact;
            in_flight.waiting &= 3 * exact;
            in_flight.waiting |= in_flight.pass::<W, O, false>(w, free & !leaf);
            in_flight.waiting |= in_flight.pass::<W, O, true>(w, free & leaf & !special);
            let mut ids = exact;
            while ids != 0 {
                in_flight.exact_step::<W, O>(w, take_lowest(&mut ids));
            }
            let mut ids = free & special;
            while ids != 0 {
                in_flight.special_step(w, take_lowest(&mut ids), &mut output);
            }
        }
    }
}

/// The rays of a set: bit `2 id` of each.
type Rays = u64;

/// The first ray of a set; some number if it is empty.
#[inline(always)]
fn lowest(rays: Rays) -> usize {
    (rays.trailing_zeros() / 2) as usize & (IN_FLIGHT - 1)
}

/// The first ray of a set, which is then taken out.
#[inline(always)]
fn take_lowest(rays: &mut Rays) -> usize {
    let id = lowest(*rays);
    *rays &= rays.wrapping_sub(1);
    id
}

/// The primitive on which a ray starts, where hits there are in order.
#[inline(always)]
fn first_of<O: Output>(rays: &[Ray], index: u32) -> Option<OriginPrimitive> {
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
    /// Rays in flight.
    active: Rays,
    /// The next step of each ray: bits 30 and 31 of the reference that it visits next, in bits `2 id` and `2 id + 1`.
    waiting: u64,
    /// Rays that intersect the line test of a triangle in the packet that they have just left.
    exact: Rays,
    /// For the rays in `exact`.
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

    /// Sets the reference that a ray visits next.
    #[inline(always)]
    fn route(&mut self, id: usize, reference: u32) {
        self.slots[id].current = reference;
        self.waiting |= self.prefetch(reference) << (2 * id);
    }

    /// Prefetches the lines that a ray visits next. Returns the kind of its next step.
    #[inline(always)]
    fn prefetch(&self, reference: u32) -> u64 {
        prefetch_lines::<NODE_LINES>(self.lines, line_of(reference));
        u64::from(reference >> 30)
    }

    /// Pops the topmost stack entry that is not farther than the ray's nearest hit.
    #[inline(always)]
    fn pop<O: Output>(&mut self, id: usize) {
        let reference = self.slots[id].pop(0, O::ANY);
        self.waiting |= self.prefetch(reference) << (2 * id);
    }

    /// A step of each ray of a set, which are at nodes or, if `LEAVES`, at packets of triangles. Returns what they wait for
    /// after it. (As a result, since what is in memory is written there after each step. What a ray visits is read one step
    /// ahead, so that its step can begin with asking for a node.)
    #[inline(always)]
    fn pass<W: Wide, O: Output, const LEAVES: bool>(&mut self, w: W, mut rays: Rays) -> u64 {
        let mut waiting = 0;
        let mut next = self.first(rays);
        while rays != 0 {
            let (id, current) = next;
            rays &= rays.wrapping_sub(1);
            next = self.first(rays);
            let waits_for = if LEAVES {
                self.triangle_step::<W, O>(w, id, current)
            } else {
                self.node_step::<W, O>(w, id, current)
            };
            waiting |= waits_for << (2 * id);
        }
        waiting
    }

    /// The first ray of a set and the reference that it visits; any ray if the set is empty.
    #[inline(always)]
    fn first(&self, rays: Rays) -> (usize, u32) {
        let id = lowest(rays);
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
            w.store_masked(mask, &node.child, slot.room());
        } else {
            w.store_sorted(mask, near, &node.child, slot.room());
        }
        let reference = slot.pop(mask.count_ones(), O::ANY);
        self.prefetch(reference)
    }

    /// Tests a packet. A ray whose line intersects a triangle is handed to [`Self::exact_step`], without a branch, which could
    /// not be predicted.
    #[inline(always)]
    fn triangle_step<W: Wide, O: Output>(&mut self, w: W, id: usize, current: u32) -> u64 {
        let slot = &mut self.slots[id];
        let Some(packet) = view::<TrianglePacket, TRIANGLE_LINES>(self.lines, line_of(current)) else {
            return self.invalid_reference(id);
        };
        let left = w.equal(packet.ids(), slot.origin_primitive);
        let lanes = triangle::candidates(w, &packet.rows, &slot.ray, &slot.boxes) & !left;
        self.candidates[id] = Candidates { packet: current, lanes };
        self.exact |= u64::from(lanes != 0) << (2 * id);
        slot.push_next(packet.next());
        let reference = slot.pop(0, O::ANY);
        self.prefetch(reference)
    }

    /// Ends a ray whose reference lies outside of the buffer: never in a valid tree.
    #[cold]
    fn invalid_reference(&mut self, id: usize) -> u64 {
        self.slots[id].current = DONE;
        u64::from(DONE >> 30)
    }

    /// Tests lanes exactly. The ray has left the packet already: what it visits next is still on its stack.
    #[inline(always)]
    fn exact_step<W: Wide, O: Output>(&mut self, w: W, id: usize) {
        let Candidates { packet, lanes } = self.candidates[id];
        let Some(packet) = view::<TrianglePacket, TRIANGLE_LINES>(self.lines, line_of(packet)) else {
            return;
        };
        let slot = &mut self.slots[id];
        let before = first_of::<O>(self.rays, slot.index);
        if slot.triangles(w, packet, lanes, O::ANY, before) {
            slot.put_back();
            self.waiting &= !(3 << (2 * id));
            self.pop_unless_done::<O>(id);
        }
    }

    /// Takes the topmost entry, or ends the ray if any hit is enough and there is one.
    #[inline(always)]
    fn pop_unless_done<O: Output>(&mut self, id: usize) {
        let slot = &mut self.slots[id];
        if O::ANY && slot.best.prim != NO_HIT {
            return self.route(id, DONE);
        }
        self.pop::<O>(id);
    }

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
                let left = w.equal(triangles.ids(), slot.origin_primitive);
                let lanes = triangle::candidates(w, &triangles.rows, &slot.ray, &slot.boxes) & !left;
                slot.triangles(w, &triangles, lanes, O::ANY, first_of::<O>(self.rays, slot.index));
            }
            return packet.next;
        }
        if packet.kind[0] >= SPLATS {
            return self.curves_or_splats(id, current, packet);
        }
        let before = first_of::<O>(self.rays, slot.index);
        for lane in 0..4 {
            let Some(shape) = Analytic::unpack(&packet.packed(lane)) else { break };
            let leaves = shape.is_flat() && packet.id[lane] == slot.origin_primitive;
            let t_min = slot.t_min_of(packet.id[lane], before);
            let met = shape.intersect(&slot.ray, t_min, slot.best.t).filter(|_| !leaves);
            if let Some(t) = met {
                slot.offer(t, 0.0, 0.0, packet.id[lane], before);
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

    /// Enters an instance: pushes the return to world space and transforms the ray. The static part of the world needs no transform.
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

    /// Returns to world space: prepares the world ray again and keeps the nearest hit.
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

/// A ray in flight with a stack of `N - 8` entries, a power of two. What a step at a node needs comes first, in one cache
/// line.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub struct Slot<const N: usize> {
    /// The ray for box tests.
    pub boxes: BoxRay,
    /// Boxes that begin behind this hold nothing nearer.
    pub limit: f32,
    /// Lower bound of the parameter.
    pub t_min: f32,
    /// The first free entry of the stack.
    top: u32,
    /// The reference to visit next.
    pub current: u32,
    /// Index of the ray in the batch.
    pub index: u32,
    /// The triangle or quad of the present space that the ray starts on.
    pub origin_primitive: u32,
    /// The ray for everything else.
    pub ray: PreparedRay,
    /// The nearest hit so far; its `t` is in units of the scaled direction of the present space.
    pub best: Hit,
    /// The instance whose space the ray is in; 0 in the world.
    pub instance: u32,
    /// The stack, with 8 spare entries for a node's children.
    stack: [Entry; N],
}

/// Slots for trees of the usual depths. An odd number of cache lines, so that stacks do not compete for the same places
/// in the cache.
pub type ShallowSlot = Slot<264>;
/// Slots for the deepest trees. (Used for all trees they cost 1 to 4 % of the speed: they are spread too far in memory.)
pub type DeepSlot = Slot<1032>;

const _: () = assert!(size_of::<ShallowSlot>() / 64 % 2 == 1 && size_of::<DeepSlot>() / 64 % 2 == 1);

/// May a curve segment be adjacent to the one that a ray starts on? True if their ids are close. (For segments of another curve with
/// close ids this only loses slivers at joints.)
#[inline(always)]
pub fn starts_near(id: u32, origin_primitive: u32) -> bool {
    const NEAR: u32 = 256;
    id.wrapping_sub(origin_primitive).wrapping_add(NEAR) <= 2 * NEAR
}

/// A hash of a ray and its time.
#[inline(always)]
fn key_of(ray: &Ray, time: f32) -> u64 {
    let pair = |a: f32, b: f32| u64::from(a.to_bits()) << 32 | u64::from(b.to_bits());
    let (o, d) = (ray.origin, ray.direction);
    let sum = mix64(mix64(mix64(pair(d.x, d.y)) ^ pair(d.z, o.x)) ^ pair(o.y, o.z));
    mix64(sum ^ u64::from(time.to_bits()))
}

impl<const N: usize> Slot<N> {
    /// Entries that a stack may hold. (Places are taken modulo this, so that they need no check.)
    pub const STACK: usize = N - 8;

    /// Fills unused slots.
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

    /// Prepares a ray for a space; `false`, and nothing is changed, where it can hit nothing there.
    #[inline(always)]
    pub fn set(&mut self, ray: &Ray, reach: f32) -> bool {
        let Some((t_min, t_max)) = self.ray.set(&mut self.boxes, ray, reach) else { return false };
        self.t_min = t_min;
        self.best.t = t_max;
        self.limit = t_max * WIDEN;
        true
    }

    /// Empties the stack but for the entry that ends the ray.
    #[inline(always)]
    pub fn clear_stack(&mut self) {
        self.top = 0;
        self.push(DONE);
    }

    /// Room for a node's children at the top of the stack.
    #[inline(always)]
    pub fn room(&mut self) -> &mut [Entry; 8] {
        const { assert!(Self::STACK.is_power_of_two()) };
        self.stack[self.top as usize % Self::STACK..].first_chunk_mut().expect("eight entries are to spare")
    }

    /// Pushes a reference that is visited whatever is hit before.
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

    /// Pops the topmost entry, counting `count` entries written after the top, that begins before the nearest hit (for any-hit
    /// queries: the topmost one).
    #[inline(always)]
    pub fn pop(&mut self, count: u32, any_hit: bool) -> u32 {
        let below = |top: usize| top.wrapping_sub(1) % Self::STACK;
        let mut top = below((self.top + count) as usize);
        if !any_hit {
            // As integers, which are compared sooner: neither is NaN, and only the bottom entry's is negative.
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
    pub fn put_back(&mut self) {
        self.top += 1;
    }

    /// Tests lanes of a packet exactly; returns whether there was a nearer hit.
    #[inline(always)]
    pub fn triangles<W: Wide>(
        &mut self,
        w: W,
        packet: &TrianglePacket,
        mut lanes: u32,
        any_hit: bool,
        before: Option<OriginPrimitive>,
    ) -> bool {
        let limit = self.limit;
        // Not waiting for the division where all is behind the ray pays for shadow rays, whose packets hold more than
        // the surface that they leave; for others it is one more branch that cannot be predicted.
        let asked = if any_hit { lanes } else { u32::MAX };
        let t = triangle::plane_parameters(w, &packet.rows, &self.ray, asked);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize & 3;
            lanes &= lanes - 1;
            if t[lane] > self.t_min && t[lane] <= self.best.t {
                self.triangle(packet, lane, t[lane], before);
            }
        }
        self.limit < limit
    }

    #[inline(always)]
    fn triangle(&mut self, packet: &TrianglePacket, lane: usize, t: f32, before: Option<OriginPrimitive>) {
        let Some(weights) = triangle::weights(&packet.rows, lane, &self.ray, &self.boxes) else { return };
        let (u, v) = primitive_uv(packet.part(lane), weights);
        self.offer(t, u, v, packet.id(lane), before);
    }

    /// Tests the curve segments of a packet. A ray that starts on one does not intersect it again.
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
                self.offer(t, u, 0.0, id, None);
            }
        }
    }

    /// Tests the splats of a packet for a ray, which is `world` in world space, at a time. Each is accepted with the probability of its largest
    /// opacity along the ray, by a hash of the ray and the splat. A hit's parameters are the ray's direction in object space.
    #[inline(always)]
    pub fn splats(&mut self, packet: &SplatPacket, world: &Ray, time: f32) {
        let lanes = packet.lanes();
        let (t, squared) = lanes.peaks(&self.ray);
        for lane in 0..4 {
            // NaN fails. Most splats of a packet are missed.
            let is_near = squared[lane] < LARGEST_SQUARED && t[lane] > self.t_min && t[lane] <= self.best.t;
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
        let random = mix64(key_of(world, time) ^ mix64(splat + 1));
        // Random numbers are in [0, 1), so an opacity of 0 accepts nothing and 1 all.
        if unit((random >> 32) as u32) < opacity {
            let [u, v] = octahedral(self.ray.direction);
            self.offer(t, u, v, id, None);
        }
    }

    /// Where hits of a primitive of the present space begin to count. Rays that start just before a primitive, of which they
    /// have intersected those up to this one (`before`), don't intersect these there again.
    #[inline(always)]
    pub fn t_min_of(&self, prim: u32, before: Option<OriginPrimitive>) -> f32 {
        match before {
            Some(o) if (self.instance, prim) <= (o.instance, o.prim) => self.t_min.next_up(),
            _ => self.t_min,
        }
    }

    /// Accepts a hit in the ray's range that is nearer than the nearest one, or as near with a smaller id.
    #[inline(always)]
    pub fn offer(&mut self, t: f32, u: f32, v: f32, prim: u32, before: Option<OriginPrimitive>) {
        let nearer = t < self.best.t;
        let tie = t == self.best.t
            && self.best.prim != NO_HIT
            && (self.instance, prim) < (self.best.instance, self.best.prim);
        if t > self.t_min_of(prim, before) && (nearer || tie) {
            self.best = Hit { t, u, v, prim, instance: self.instance };
            self.limit = t * WIDEN;
        }
    }
}
