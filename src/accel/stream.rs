//! The traversal loop: up to 32 rays in flight, split into a queue of rays at nodes and a queue of rays at leaves.
//!
//! A single ray is a chain of dependent loads and unpredictable branches. Here each step handles one ray, asks for the
//! lines that this ray needs next, and goes on with another ray, so that the waiting of 32 rays overlaps; and since a
//! queue holds only one kind of work, its branches are predictable. The order in which one ray visits its own nodes
//! does not depend on the others: batches of any size give the same hits.
//!
//! A ray that leaves a triangle, quad or disk says so: that primitive counts as missed, without an exact test, which nearly every
//! such ray would ask for.

use super::layout::{
    ANALYTIC_LINES, AnalyticPacket, DONE, INSTANCE_LINES, InstanceRecord, KIND_ANALYTIC, LEAVE_INSTANCE,
    MOVING_TRIANGLES, NODE_LINES, Node, TRIANGLE_LINES, TrianglePacket, curves_at, kind_of, line_of, view,
};
use super::motion::{Clock, triangles_at};
use super::slot::{DeepSlot, ShallowSlot, Slot};
use crate::math::{Hit, NO_HIT, OriginPrimitive, Ray};
use crate::shape::{Analytic, Shape, triangle};
use crate::simd::{Line, WIDEN, Wide, WideKernel, prefetch_lines};

/// Rays in flight: two bits of a `u64` each. 32 is the knee: 16 lose a fifth on large scenes, 64 gain nothing.
pub const IN_FLIGHT: usize = 32;

/// Where results go.
pub trait Output {
    /// Stop at the first hit of any kind?
    const ANY: bool;
    /// Do hits where rays start count, of primitives behind the one there in the order of their numbers?
    const NEXT: bool = false;
    /// Stores the result of a ray.
    fn emit(&mut self, index: usize, hit: &Hit);
}

/// Nearest hits.
pub struct Closest<'a>(pub &'a mut [Hit]);
impl Output for Closest<'_> {
    const ANY: bool = false;
    #[inline(always)]
    fn emit(&mut self, index: usize, hit: &Hit) {
        self.0[index] = *hit;
    }
}

/// Whether there is a hit.
pub struct Occluded<'a>(pub &'a mut [bool]);
impl Output for Occluded<'_> {
    const ANY: bool = true;
    #[inline(always)]
    fn emit(&mut self, index: usize, hit: &Hit) {
        self.0[index] = hit.prim != NO_HIT;
    }
}

/// Any hits.
pub struct Any<'a>(pub &'a mut [Hit]);
impl Output for Any<'_> {
    const ANY: bool = true;
    #[inline(always)]
    fn emit(&mut self, index: usize, hit: &Hit) {
        self.0[index] = *hit;
    }
}

/// Hits that follow others in their order.
pub struct Next<'a>(pub &'a mut Hit);
impl Output for Next<'_> {
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

/// One batch.
pub struct Stream<'a, O, C, const N: usize> {
    /// Nodes and packets.
    pub lines: &'a [Line],
    /// Where to start.
    pub root: u32,
    /// The largest absolute coordinate of the world.
    pub reach: f32,
    /// The rays.
    pub rays: &'a [Ray],
    /// Their times.
    pub clock: C,
    /// The results.
    pub output: O,
    /// Scratch memory, whose stacks are as deep as the tree needs.
    pub slots: &'a mut Vec<Slot<N>>,
}

impl<O: Output, C: Clock, const N: usize> WideKernel for Stream<'_, O, C, N> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self, w: W) {
        let Stream { lines, root, reach, rays, clock, mut output, slots } = self;
        slots.resize(IN_FLIGHT, Slot::EMPTY);
        let Some(slots) = slots.first_chunk_mut() else { return };
        let mut flight = Flight {
            lines,
            root,
            reach,
            rays,
            clock,
            slots,
            next_ray: 0,
            flying: 0,
            waiting: 0,
            exact: 0,
            candidates: [Candidates { packet: 0, lanes: 0 }; IN_FLIGHT],
        };
        for id in 0..IN_FLIGHT.min(rays.len()) {
            flight.start(id, &mut output);
        }
        while flight.flying != 0 {
            // All passes of a round are fixed before its first step. If a pass took up what the one before it has left,
            // the end of its loop would be known late, and the CPU, which guesses it wrong, would stand still until then.
            let exact = std::mem::take(&mut flight.exact);
            let (leaf, special) = (flight.waiting >> 1, flight.waiting);
            let free = flight.flying & !exact;
            flight.waiting &= 3 * exact;
            flight.waiting |= flight.pass::<W, O, false>(w, free & !leaf);
            flight.waiting |= flight.pass::<W, O, true>(w, free & leaf & !special);
            let mut ids = exact;
            while ids != 0 {
                flight.exact_step::<W, O>(w, take_lowest(&mut ids));
            }
            let mut ids = free & special;
            while ids != 0 {
                flight.special_step(w, take_lowest(&mut ids), &mut output);
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

struct Flight<'a, C, const N: usize> {
    lines: &'a [Line],
    root: u32,
    reach: f32,
    rays: &'a [Ray],
    clock: C,
    slots: &'a mut [Slot<N>; IN_FLIGHT],
    next_ray: usize,
    /// The rays on their way.
    flying: Rays,
    /// What each ray waits for: bits 30 and 31 of the reference that it visits next, in bits `2 id` and `2 id + 1`.
    waiting: u64,
    /// The rays whose line meets a triangle of the packet that they have just left.
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

impl<C: Clock, const N: usize> Flight<'_, C, N> {
    /// Puts the next ray that can hit something into a slot; the slot stays idle when there is none.
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
            self.flying |= 1 << (2 * id);
            return self.route(id, self.root);
        }
    }

    /// Sends a ray to what it visits next.
    #[inline(always)]
    fn route(&mut self, id: usize, reference: u32) {
        self.slots[id].current = reference;
        self.waiting |= self.ask(reference) << (2 * id);
    }

    /// Asks for the lines of what a ray visits next. Returns what it waits for.
    #[inline(always)]
    fn ask(&self, reference: u32) -> u64 {
        prefetch_lines::<NODE_LINES>(self.lines, line_of(reference));
        u64::from(reference >> 30)
    }

    /// Sends a ray to the topmost entry of its stack that can still matter.
    #[inline(always)]
    fn pop<O: Output>(&mut self, id: usize) {
        let reference = self.slots[id].pop(0, O::ANY);
        self.waiting |= self.ask(reference) << (2 * id);
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

    /// The first ray of a set and what it visits; some ray if the set is empty.
    #[inline(always)]
    fn first(&self, rays: Rays) -> (usize, u32) {
        let id = lowest(rays);
        (id, self.slots[id].current)
    }

    #[inline(always)]
    fn node_step<W: Wide, O: Output>(&mut self, w: W, id: usize, current: u32) -> u64 {
        let slot = &mut self.slots[id];
        let Some(node) = view::<Node, NODE_LINES>(self.lines, current as usize) else {
            return self.lost(id);
        };
        let (mask, near) = w.boxes(&node.planes, &slot.boxes, slot.t_min, slot.limit);
        if O::ANY {
            w.store_masked(mask, &node.child, slot.room());
        } else {
            w.store_sorted(mask, near, &node.child, slot.room());
        }
        let reference = slot.pop(mask.count_ones(), O::ANY);
        self.ask(reference)
    }

    /// Tests a packet. A ray whose line meets a triangle is handed to [`Self::exact_step`], without a branch, which could
    /// not be predicted.
    #[inline(always)]
    fn triangle_step<W: Wide, O: Output>(&mut self, w: W, id: usize, current: u32) -> u64 {
        let slot = &mut self.slots[id];
        let Some(packet) = view::<TrianglePacket, TRIANGLE_LINES>(self.lines, line_of(current)) else {
            return self.lost(id);
        };
        let left = w.equal(packet.ids(), slot.origin_primitive);
        let lanes = triangle::candidates(w, &packet.rows, &slot.ray, &slot.boxes) & !left;
        self.candidates[id] = Candidates { packet: current, lanes };
        self.exact |= u64::from(lanes != 0) << (2 * id);
        slot.push_next(packet.next());
        let reference = slot.pop(0, O::ANY);
        self.ask(reference)
    }

    /// Ends a ray that was sent out of the buffer, which no tree does.
    #[cold]
    fn lost(&mut self, id: usize) -> u64 {
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

    /// Gives out the result of a ray and takes the next one.
    #[inline(always)]
    fn finish<O: Output>(&mut self, id: usize, output: &mut O) {
        let slot = &self.slots[id];
        let mut hit = slot.best;
        hit.t = if hit.prim == NO_HIT { f32::INFINITY } else { hit.t * slot.ray.unscale };
        output.emit(slot.index as usize, &hit);
        self.flying &= !(1 << (2 * id));
        self.start(id, output);
    }

    #[inline(always)]
    fn analytic<W: Wide, O: Output>(&mut self, w: W, id: usize, current: u32) -> u32 {
        let slot = &mut self.slots[id];
        let Some(packet) = view::<AnalyticPacket, ANALYTIC_LINES>(self.lines, line_of(current)) else {
            return DONE;
        };
        if C::MOVING && packet.kind[0] == MOVING_TRIANGLES {
            let time = self.clock.time(slot.index as usize);
            if let Some(triangles) = triangles_at(self.lines, line_of(current), packet, time) {
                let left = w.equal(triangles.ids(), slot.origin_primitive);
                let lanes = triangle::candidates(w, &triangles.rows, &slot.ray, &slot.boxes) & !left;
                slot.triangles(w, &triangles, lanes, O::ANY, first_of::<O>(self.rays, slot.index));
            }
            return packet.next;
        }
        if let Some(curves) = curves_at(self.lines, line_of(current), packet) {
            slot.curves(curves);
            return packet.next;
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

    /// Goes on in the space of an instance, to which the way back waits on the stack, or in the part of the world that
    /// stands still.
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
            let record = self.clock.record(record, slot.index as usize);
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

    /// Back to the world: its ray is computed again, the nearest hit so far goes along.
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
