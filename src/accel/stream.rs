//! The traversal loop: up to 32 rays in flight, split into a queue of rays at nodes and a queue of rays at leaves.
//!
//! A single ray is a chain of dependent loads and unpredictable branches. Here each step handles one ray, asks for the
//! lines that this ray needs next, and goes on with another ray, so that the waiting of 32 rays overlaps; and since a
//! queue holds only one kind of work, its branches are predictable. The order in which one ray visits its own nodes
//! does not depend on the others: batches of any size give the same hits.

use super::layout::{
    DONE, INSTANCE_LINES, InstanceRecord, KIND_SPHERES, LEAVE_INSTANCE, NODE_LINES, Node, SPHERE_LINES,
    SpherePacket, TRIANGLE_LINES, TrianglePacket, kind_of, line_of, view,
};
use super::slot::Slot;
use super::{sphere, triangle};
use crate::math::{Hit, NO_HIT, Ray};
use crate::simd::{Entry, Line, WIDEN, Wide, WideKernel, prefetch_lines};

/// Rays in flight: two bits of a `u64` each. 32 is the knee: 16 lose a fifth on large scenes, 64 gain nothing.
pub const IN_FLIGHT: usize = 32;

/// Where results go.
pub trait Output {
    /// Stop at the first hit of any kind?
    const ANY: bool;
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

/// Memory that a thread keeps between calls.
pub struct Workspace {
    slots: Vec<Slot>,
    stacks: Vec<Entry>,
}

impl Workspace {
    /// Without memory yet.
    pub const fn new() -> Workspace {
        Workspace { slots: Vec::new(), stacks: Vec::new() }
    }
}

/// One batch.
pub struct Stream<'a, O> {
    /// Nodes and packets.
    pub lines: &'a [Line],
    /// Where to start.
    pub root: u32,
    /// The largest absolute coordinate of the world.
    pub reach: f32,
    /// Stack entries that a ray may need, with 8 to spare.
    pub stack_size: usize,
    /// The rays.
    pub rays: &'a [Ray],
    /// The results.
    pub output: O,
    /// Scratch memory.
    pub workspace: &'a mut Workspace,
}

impl<O: Output> WideKernel for Stream<'_, O> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self, w: W) {
        let Stream { lines, root, reach, stack_size, rays, mut output, workspace } = self;
        // An odd number of cache lines, so that the stacks do not compete for the same places in the cache.
        let stack_size = 8 * (stack_size.div_ceil(8) | 1);
        if workspace.stacks.len() < IN_FLIGHT * stack_size {
            workspace.stacks.resize(IN_FLIGHT * stack_size, Entry { reference: DONE, distance: 0.0 });
        }
        workspace.slots.resize(IN_FLIGHT, Slot::EMPTY);
        let Workspace { slots, stacks } = workspace;
        let Some(slots) = slots.first_chunk_mut() else { return };
        let mut flight = Flight {
            lines,
            root,
            reach,
            rays,
            slots,
            stacks,
            stack_size,
            next_ray: 0,
            flying: 0,
            waiting: 0,
            current: [DONE; IN_FLIGHT],
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
            let mut ids = free & !leaf;
            while ids != 0 {
                flight.node_step::<W, O>(w, take_lowest(&mut ids));
            }
            let mut ids = free & leaf & !special;
            while ids != 0 {
                flight.triangle_step::<W, O>(w, take_lowest(&mut ids));
            }
            let mut ids = exact;
            while ids != 0 {
                flight.exact_step::<W, O>(w, take_lowest(&mut ids));
            }
            let mut ids = free & special;
            while ids != 0 {
                flight.special_step(take_lowest(&mut ids), &mut output);
            }
        }
    }
}

/// The rays of a set: bit `2 id` of each.
type Rays = u64;

/// The first ray of a set, which is then taken out.
#[inline(always)]
fn take_lowest(rays: &mut Rays) -> usize {
    let id = (rays.trailing_zeros() / 2) as usize & (IN_FLIGHT - 1);
    *rays &= rays.wrapping_sub(1);
    id
}

struct Flight<'a> {
    lines: &'a [Line],
    root: u32,
    reach: f32,
    rays: &'a [Ray],
    slots: &'a mut [Slot; IN_FLIGHT],
    /// The stacks of all rays in flight, one after the other.
    stacks: &'a mut [Entry],
    stack_size: usize,
    next_ray: usize,
    /// The rays on their way.
    flying: Rays,
    /// What each ray waits for: bits 30 and 31 of the reference that it visits next, in bits `2 id` and `2 id + 1`.
    waiting: u64,
    /// What each ray visits next.
    current: [u32; IN_FLIGHT],
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

impl Flight<'_> {
    /// Puts the next ray that can hit something into a slot; the slot stays idle when there is none.
    #[inline(always)]
    fn start<O: Output>(&mut self, id: usize, output: &mut O) {
        while let Some(ray) = self.rays.get(self.next_ray) {
            let index = self.next_ray;
            self.next_ray += 1;
            let slot = &mut self.slots[id];
            let Some(t_max) = slot.ray.set(&mut slot.boxes, ray, self.reach) else {
                output.emit(index, &Hit::MISS);
                continue;
            };
            let bottom = id * self.stack_size;
            self.stacks[bottom] = Entry { reference: DONE, distance: f32::NEG_INFINITY };
            slot.top = bottom as u32 + 1;
            slot.index = index as u32;
            slot.best = Hit { t: t_max, ..Hit::MISS };
            slot.limit = t_max * WIDEN;
            slot.instance = 0;
            self.flying |= 1 << (2 * id);
            return self.route(id, self.root);
        }
    }

    /// Sends a ray to what it visits next and asks for the lines of that.
    #[inline(always)]
    fn route(&mut self, id: usize, reference: u32) {
        prefetch_lines::<NODE_LINES>(self.lines, line_of(reference));
        self.current[id] = reference;
        self.waiting |= u64::from(reference >> 30) << (2 * id);
    }

    /// Takes the topmost entry that can still matter. The bottom entry, which ends the ray, always does.
    #[inline(always)]
    fn pop<O: Output>(&mut self, id: usize, top: usize) {
        let slot = &mut self.slots[id];
        let mut top = top - 1;
        let mut entry = self.stacks[top];
        if !O::ANY {
            while entry.distance > slot.limit {
                top -= 1;
                entry = self.stacks[top];
            }
        }
        slot.top = top as u32;
        self.route(id, entry.reference);
    }

    #[inline(always)]
    fn node_step<W: Wide, O: Output>(&mut self, w: W, id: usize) {
        let slot = &self.slots[id];
        let Some(node) = view::<Node, NODE_LINES>(self.lines, self.current[id] as usize) else {
            return;
        };
        let (mask, near) = w.boxes(&node.planes, &slot.boxes, slot.ray.t_min, slot.limit);
        let top = slot.top as usize;
        let Some(to) = self.stacks.get_mut(top..top + 8).and_then(|to| to.first_chunk_mut()) else {
            return;
        };
        if O::ANY {
            w.store_masked(mask, &node.child, to);
        } else {
            w.store_sorted(mask, near, &node.child, to);
        }
        self.pop::<O>(id, top + mask.count_ones() as usize);
    }

    /// Tests a packet. A ray whose line meets a triangle is handed to [`Self::exact_step`], without a branch, which could
    /// not be predicted.
    #[inline(always)]
    fn triangle_step<W: Wide, O: Output>(&mut self, w: W, id: usize) {
        let slot = &self.slots[id];
        let current = self.current[id];
        let Some(packet) = view::<TrianglePacket, TRIANGLE_LINES>(self.lines, line_of(current)) else {
            return;
        };
        let lanes = triangle::candidates(w, packet, &slot.ray, &slot.boxes);
        self.candidates[id] = Candidates { packet: current, lanes };
        self.exact |= u64::from(lanes != 0) << (2 * id);
        let top = self.push_next(id, packet.next());
        self.pop::<O>(id, top);
    }

    /// Tests lanes exactly. The ray has left the packet already: what it visits next is still on its stack.
    #[inline(always)]
    fn exact_step<W: Wide, O: Output>(&mut self, w: W, id: usize) {
        let Candidates { packet, lanes } = self.candidates[id];
        let Some(packet) = view::<TrianglePacket, TRIANGLE_LINES>(self.lines, line_of(packet)) else {
            return;
        };
        let slot = &mut self.slots[id];
        if slot.triangles(w, packet, lanes, O::ANY) {
            let top = slot.top as usize + 1;
            self.waiting &= !(3 << (2 * id));
            self.pop_unless_done::<O>(id, top);
        }
    }

    /// Takes the topmost entry, or ends the ray if any hit is enough and there is one.
    #[inline(always)]
    fn pop_unless_done<O: Output>(&mut self, id: usize, top: usize) {
        let slot = &mut self.slots[id];
        if O::ANY && slot.best.prim != NO_HIT {
            return self.route(id, DONE);
        }
        self.pop::<O>(id, top);
    }

    /// Puts the next packet of a leaf, if there is one, on the stack, without a branch. Returns the first free entry.
    #[inline(always)]
    fn push_next(&mut self, id: usize, next: u32) -> usize {
        let top = self.slots[id].top as usize;
        self.stacks[top] = Entry { reference: next, distance: f32::NEG_INFINITY };
        top + usize::from(next != DONE)
    }

    #[inline(always)]
    fn special_step<O: Output>(&mut self, id: usize, output: &mut O) {
        let current = self.current[id];
        if current == DONE {
            return self.finish(id, output);
        }
        let next = if kind_of(current) == KIND_SPHERES {
            self.spheres(id, current)
        } else if current == LEAVE_INSTANCE {
            self.leave_instance(id)
        } else {
            return self.enter_instance::<O>(id, current);
        };
        let top = self.push_next(id, next);
        self.pop_unless_done::<O>(id, top);
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
    fn spheres(&mut self, id: usize, current: u32) -> u32 {
        let slot = &mut self.slots[id];
        let Some(packet) = view::<SpherePacket, SPHERE_LINES>(self.lines, line_of(current)) else {
            return DONE;
        };
        for lane in 0..4 {
            if let Some(t) = sphere::intersect(packet, lane, &slot.ray, slot.best.t) {
                slot.offer(t, 0.0, 0.0, packet.id[lane]);
            }
        }
        packet.next
    }

    /// Goes on in the space of an instance; the way back waits on the stack.
    #[inline(always)]
    fn enter_instance<O: Output>(&mut self, id: usize, current: u32) {
        let slot = &mut self.slots[id];
        let Some(record) = view::<InstanceRecord, INSTANCE_LINES>(self.lines, line_of(current)) else {
            return;
        };
        let mut top = slot.top as usize;
        let mut push = |reference: u32| {
            self.stacks[top] = Entry { reference, distance: f32::NEG_INFINITY };
            top += 1;
        };
        if record.next != DONE {
            push(record.next);
        }
        let ray = record.transform(&slot.ray, slot.best.t);
        if let Some(t_max) = slot.ray.set(&mut slot.boxes, &ray, record.reach) {
            push(LEAVE_INSTANCE);
            push(record.root);
            slot.best.t = t_max;
            slot.limit = t_max * WIDEN;
            slot.instance = record.instance;
        }
        self.pop::<O>(id, top);
    }

    /// Back to the world: its ray is computed again, the nearest hit so far goes along.
    #[inline(always)]
    fn leave_instance(&mut self, id: usize) -> u32 {
        let slot = &mut self.slots[id];
        let unscale = slot.ray.unscale;
        let world = &self.rays[slot.index as usize];
        if slot.ray.set(&mut slot.boxes, world, self.reach).is_some() {
            slot.best.t *= unscale;
            slot.limit = slot.best.t * WIDEN;
            slot.instance = 0;
        }
        DONE
    }
}
