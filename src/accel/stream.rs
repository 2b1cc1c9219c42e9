//! The traversal loop: up to 32 rays in flight, split into a queue of rays at nodes and a queue of rays at leaves.
//!
//! A single ray is a chain of dependent loads and unpredictable branches. Here each step handles one ray, asks for the
//! lines that this ray needs next, and goes on with another ray, so that the waiting of 32 rays overlaps; and since a
//! queue holds only one kind of work, its branches are predictable. The order in which one ray visits its own nodes
//! does not depend on the others: batches of any size give the same hits.

use super::layout::{
    DONE, INSTANCE_LINES, InstanceRecord, KIND_INSTANCE, KIND_SPHERES, KIND_TRIANGLES, LEAF, LEAVE_INSTANCE,
    NODE_LINES, Node, PART_QUAD_FIRST, PART_TRIANGLE, SPHERE_LINES, SpherePacket, TRIANGLE_LINES,
    TrianglePacket, kind_of, line_of, view,
};
use super::prepare::PreparedRay;
use super::{sphere, triangle};
use crate::math::{Hit, NO_HIT, Ray, Vec3};
use crate::simd::{Line, Wide, WideKernel, prefetch_lines};

/// Rays in flight. 32 is the knee: 16 lose a fifth on large scenes, 64 gain nothing.
pub const IN_FLIGHT: usize = 32;

/// Box tests accept this much more (Ize 2013, "Robust BVH Ray Traversal"): 32 roundings. Three are the box test's
/// own on either side; the shear of the triangle test moves each vertex by at most five more of the same quantities.
const WIDEN: f32 = 1.0 + 1.0 / 524_288.0;

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

/// A ray in flight.
#[derive(Clone, Copy)]
#[repr(align(128))]
struct Slot {
    ray: PreparedRay,
    /// The nearest hit so far; its `t` is in units of the scaled direction of the present space.
    best: Hit,
    /// What to visit next.
    current: u32,
    /// Number of entries on this ray's stack.
    stack_len: u32,
    /// Which ray of the batch.
    index: u32,
    /// The instance whose space the ray is in; 0 in the world.
    instance: u32,
}

impl Slot {
    const EMPTY: Slot =
        Slot { ray: PreparedRay::NONE, best: Hit::MISS, current: DONE, stack_len: 0, index: 0, instance: 0 };
}

/// Memory that a thread keeps between calls.
pub struct Workspace {
    slots: [Slot; IN_FLIGHT],
    refs: Vec<u32>,
    distances: Vec<f32>,
}

impl Workspace {
    /// Without stacks yet.
    pub const fn new() -> Workspace {
        Workspace { slots: [Slot::EMPTY; IN_FLIGHT], refs: Vec::new(), distances: Vec::new() }
    }

    fn reserve(&mut self, entries: usize) {
        if self.refs.len() < entries {
            self.refs.resize(entries, DONE);
            self.distances.resize(entries, 0.0);
        }
    }
}

/// One batch.
pub struct Stream<'a, O> {
    /// Nodes and packets.
    pub lines: &'a [Line],
    /// Where to start.
    pub root: u32,
    /// Stack entries that a ray may need, with 8 to spare.
    pub stack_size: usize,
    /// The rays.
    pub rays: &'a [Ray],
    /// The results.
    pub output: O,
    /// Scratch memory.
    pub workspace: &'a mut Workspace,
}

/// Ids of rays in flight that wait for the same kind of step.
struct Queue {
    ids: [u8; IN_FLIGHT],
    len: usize,
}

impl Queue {
    const EMPTY: Queue = Queue { ids: [0; IN_FLIGHT], len: 0 };

    /// Writes the id in any case, keeps it if asked: no branch.
    #[inline(always)]
    fn push_if(&mut self, id: u8, keep: bool) {
        self.ids[self.len & (IN_FLIGHT - 1)] = id;
        self.len += usize::from(keep);
    }
}

impl<O: Output> WideKernel for Stream<'_, O> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self, w: W) {
        let Stream { lines, root, stack_size, rays, mut output, workspace } = self;
        let in_flight = IN_FLIGHT.min(rays.len());
        workspace.reserve(in_flight * stack_size);
        let Workspace { slots, refs, distances } = workspace;
        let stacks = Stacks { refs, distances, size: stack_size };
        let mut flight = Flight {
            lines,
            root,
            rays,
            slots,
            stacks,
            next_ray: 0,
            nodes: Queue::EMPTY,
            leaves: Queue::EMPTY,
            finished: Queue::EMPTY,
        };
        for id in 0..in_flight {
            flight.start(id as u8, &mut output);
        }
        while flight.nodes.len + flight.leaves.len + flight.finished.len > 0 {
            let ids = flight.nodes.ids;
            let count = std::mem::take(&mut flight.nodes.len);
            for id in &ids[..count.min(IN_FLIGHT)] {
                flight.node_step::<W, O>(w, *id);
            }
            let ids = flight.leaves.ids;
            let count = std::mem::take(&mut flight.leaves.len);
            for id in &ids[..count.min(IN_FLIGHT)] {
                flight.leaf_step(w, *id, &mut output);
            }
            let ids = flight.finished.ids;
            let count = std::mem::take(&mut flight.finished.len);
            for id in &ids[..count.min(IN_FLIGHT)] {
                flight.finish(*id, &mut output);
            }
        }
    }
}

/// The stacks of all rays in flight, one after the other.
struct Stacks<'a> {
    refs: &'a mut [u32],
    distances: &'a mut [f32],
    size: usize,
}

struct Flight<'a> {
    lines: &'a [Line],
    root: u32,
    rays: &'a [Ray],
    slots: &'a mut [Slot; IN_FLIGHT],
    stacks: Stacks<'a>,
    next_ray: usize,
    nodes: Queue,
    leaves: Queue,
    finished: Queue,
}

impl Flight<'_> {
    /// Puts the next ray that can hit something into a slot; the slot stays idle when there is none.
    #[inline(always)]
    fn start<O: Output>(&mut self, id: u8, output: &mut O) {
        while let Some(ray) = self.rays.get(self.next_ray) {
            let index = self.next_ray;
            self.next_ray += 1;
            let Some((prepared, t_max)) = PreparedRay::new(ray) else {
                output.emit(index, &Hit::MISS);
                continue;
            };
            let bottom = usize::from(id) * self.stacks.size;
            self.stacks.refs[bottom] = DONE;
            self.stacks.distances[bottom] = f32::NEG_INFINITY;
            let slot = &mut self.slots[usize::from(id) & (IN_FLIGHT - 1)];
            *slot = Slot {
                ray: prepared,
                best: Hit { t: t_max, ..Hit::MISS },
                current: DONE,
                stack_len: 1,
                index: index as u32,
                instance: 0,
            };
            self.route(id, self.root, 1);
            return;
        }
    }

    /// Sends a ray to what it visits next and asks for the lines of that.
    #[inline(always)]
    fn route(&mut self, id: u8, reference: u32, stack_len: usize) {
        let slot = &mut self.slots[usize::from(id) & (IN_FLIGHT - 1)];
        slot.current = reference;
        slot.stack_len = stack_len as u32;
        prefetch_lines::<NODE_LINES>(self.lines, line_of(reference));
        let is_leaf = reference & LEAF != 0;
        let is_done = reference == DONE;
        self.nodes.push_if(id, !is_leaf);
        self.leaves.push_if(id, is_leaf & !is_done);
        self.finished.push_if(id, is_done);
    }

    /// Takes the topmost entry that can still matter. The bottom entry, which ends the ray, always does.
    #[inline(always)]
    fn pop<O: Output>(&self, id: u8, mut stack_len: usize, best_t: f32) -> (u32, usize) {
        let bottom = usize::from(id) * self.stacks.size;
        if !O::ANY {
            let limit = best_t * WIDEN;
            while stack_len > 1 && self.stacks.distances[bottom + stack_len - 1] > limit {
                stack_len -= 1;
            }
        }
        (self.stacks.refs[bottom + stack_len - 1], stack_len - 1)
    }

    #[inline(always)]
    fn node_step<W: Wide, O: Output>(&mut self, w: W, id: u8) {
        let slot = &self.slots[usize::from(id) & (IN_FLIGHT - 1)];
        let Some(node) = view::<Node, NODE_LINES>(self.lines, line_of(slot.current)) else {
            return;
        };
        let ray = &slot.ray;
        let best_t = slot.best.t;
        let mut near = w.splat8(ray.t_min);
        let mut far = w.splat8(best_t);
        for axis in 0..3 {
            let negative = usize::from(ray.negative[axis] & 1);
            let (o, inverse) = (w.splat8(ray.origin[axis]), w.splat8(ray.inverse[axis]));
            let near_plane = w.load8(&node.planes[2 * axis + negative]);
            let far_plane = w.load8(&node.planes[2 * axis + (negative ^ 1)]);
            // 0 * inf = NaN, a ray in the plane of a face, is dropped: min8 and max8 then give their second operand.
            near = w.max8(w.mul8(w.sub8(near_plane, o), inverse), near);
            far = w.min8(w.mul8(w.sub8(far_plane, o), inverse), far);
        }
        let mask = w.le8(near, w.mul8(far, w.splat8(WIDEN)));
        let stack_len = slot.stack_len as usize;
        let top = usize::from(id) * self.stacks.size + stack_len;
        let Some(refs) = self.stacks.refs.get_mut(top..top + 8).and_then(|r| r.try_into().ok()) else {
            return;
        };
        if O::ANY {
            w.store_masked(mask, &node.child, refs);
        } else {
            let Some(distances) = self.stacks.distances.get_mut(top..top + 8).and_then(|d| d.try_into().ok())
            else {
                return;
            };
            w.store_sorted(mask, near, &node.child, refs, distances);
        }
        let (reference, stack_len) = self.pop::<O>(id, stack_len + mask.count_ones() as usize, best_t);
        self.route(id, reference, stack_len);
    }

    #[inline(always)]
    fn leaf_step<W: Wide, O: Output>(&mut self, w: W, id: u8, output: &mut O) {
        let current = self.slots[usize::from(id) & (IN_FLIGHT - 1)].current;
        let next = match kind_of(current) {
            KIND_TRIANGLES => self.triangles(w, id, current),
            KIND_SPHERES => self.spheres(id, current),
            KIND_INSTANCE => return self.enter_instance::<O>(id, current),
            _ => self.leave_instance(id),
        };
        let slot = &self.slots[usize::from(id) & (IN_FLIGHT - 1)];
        if O::ANY && slot.best.prim != NO_HIT {
            output.emit(slot.index as usize, &slot.best);
            return self.start(id, output);
        }
        // The next packet, if any, goes on the stack without a branch.
        let stack_len = slot.stack_len as usize;
        let top = usize::from(id) * self.stacks.size + stack_len;
        self.stacks.refs[top] = next;
        self.stacks.distances[top] = f32::NEG_INFINITY;
        let best_t = slot.best.t;
        let (reference, stack_len) = self.pop::<O>(id, stack_len + usize::from(next != DONE), best_t);
        self.route(id, reference, stack_len);
    }

    /// Gives out the result of a ray and takes the next one.
    #[inline(always)]
    fn finish<O: Output>(&mut self, id: u8, output: &mut O) {
        let slot = &self.slots[usize::from(id) & (IN_FLIGHT - 1)];
        let mut hit = slot.best;
        hit.t = if hit.prim == NO_HIT { f32::INFINITY } else { hit.t * slot.ray.unscale };
        output.emit(slot.index as usize, &hit);
        self.start(id, output);
    }

    #[inline(always)]
    fn triangles<W: Wide>(&mut self, w: W, id: u8, current: u32) -> u32 {
        let slot = &mut self.slots[usize::from(id) & (IN_FLIGHT - 1)];
        let Some(packet) = view::<TrianglePacket, TRIANGLE_LINES>(self.lines, line_of(current)) else {
            return DONE;
        };
        let mut lanes = triangle::candidates(w, packet, &slot.ray);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize & 3;
            lanes &= lanes - 1;
            if let Some(hit) = triangle::intersect(packet, lane, &slot.ray, slot.best.t) {
                let (u, v) = match packet.part(lane) {
                    PART_TRIANGLE => (hit.u, hit.v),
                    PART_QUAD_FIRST => ((hit.u + hit.v).min(1.0), hit.v),
                    _ => (hit.u, (hit.u + hit.v).min(1.0)),
                };
                slot.offer(hit.t, u, v, packet.id(lane));
            }
        }
        packet.next()
    }

    #[inline(always)]
    fn spheres(&mut self, id: u8, current: u32) -> u32 {
        let slot = &mut self.slots[usize::from(id) & (IN_FLIGHT - 1)];
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
    fn enter_instance<O: Output>(&mut self, id: u8, current: u32) {
        let slot = &mut self.slots[usize::from(id) & (IN_FLIGHT - 1)];
        let Some(record) = view::<InstanceRecord, INSTANCE_LINES>(self.lines, line_of(current)) else {
            return;
        };
        let (mut top, mut stack_len) =
            (usize::from(id) * self.stacks.size + slot.stack_len as usize, slot.stack_len as usize);
        let mut push = |reference: u32| {
            self.stacks.refs[top] = reference;
            self.stacks.distances[top] = f32::NEG_INFINITY;
            top += 1;
            stack_len += 1;
        };
        if record.next != DONE {
            push(record.next);
        }
        let slot_best = slot.best.t;
        let ray = record.transform(&slot.ray, slot.best.t);
        let Some((prepared, t_max)) = PreparedRay::new(&ray) else {
            let (reference, stack_len) = self.pop::<O>(id, stack_len, slot_best);
            return self.route(id, reference, stack_len);
        };
        push(LEAVE_INSTANCE);
        slot.ray = prepared;
        slot.best.t = t_max;
        slot.instance = record.instance;
        self.route(id, record.root, stack_len);
    }

    /// Back to the world: its ray is computed again, the nearest hit so far goes along.
    #[inline(always)]
    fn leave_instance(&mut self, id: u8) -> u32 {
        let slot = &mut self.slots[usize::from(id) & (IN_FLIGHT - 1)];
        if let Some((prepared, _)) = PreparedRay::new(&self.rays[slot.index as usize]) {
            slot.best.t *= slot.ray.unscale;
            slot.ray = prepared;
            slot.instance = 0;
        }
        DONE
    }
}

impl InstanceRecord {
    /// A world ray in object space. The direction keeps its parametrisation.
    #[inline(always)]
    fn transform(&self, ray: &PreparedRay, t_max: f32) -> Ray {
        let [o, d] = [ray.origin, ray.direction];
        let row = |k: usize| {
            let m = &self.object_from_world[k];
            ((m[0] * o[0] + m[1] * o[1]) + (m[2] * o[2] + m[3]), m[0] * d[0] + m[1] * d[1] + m[2] * d[2])
        };
        let [x, y, z] = [row(0), row(1), row(2)];
        Ray { origin: Vec3::new(x.0, y.0, z.0), t_min: ray.t_min, direction: Vec3::new(x.1, y.1, z.1), t_max }
    }
}

impl Slot {
    /// Takes a hit if it lies in the ray's range and before the nearest one, or as near with a smaller id.
    #[inline(always)]
    fn offer(&mut self, t: f32, u: f32, v: f32, prim: u32) {
        let nearer = t < self.best.t;
        let tie = t == self.best.t
            && self.best.prim != NO_HIT
            && (self.instance, prim) < (self.best.instance, self.best.prim);
        if t > self.ray.t_min && (nearer || tie) {
            self.best = Hit { t, u, v, prim, instance: self.instance };
        }
    }
}
