//! A ray in flight: where it is, what it has hit, and the tests that decide on hits.

use super::layout::{CurvePacket, DONE, TrianglePacket, on_primitive};
use crate::math::{Hit, NO_HIT, OriginPrimitive, Ray};
use crate::shape::{PreparedRay, triangle};
use crate::simd::{BoxRay, Entry, WIDEN, Wide};

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
    /// What the ray visits next.
    pub current: u32,
    /// Which ray of the batch.
    pub index: u32,
    /// The triangle or quad of the present space that the ray starts on.
    pub origin_primitive: u32,
    /// The ray for everything else.
    pub ray: PreparedRay,
    /// The nearest hit so far; its `t` is in units of the scaled direction of the present space.
    pub best: Hit,
    /// The instance whose space the ray is in; 0 in the world.
    pub instance: u32,
    /// What the ray visits later, next last, with 8 entries to spare for a node's children.
    stack: [Entry; N],
}

/// Slots for trees of the usual depths. An odd number of cache lines, so that stacks do not compete for the same places
/// in the cache.
pub type ShallowSlot = Slot<264>;
/// Slots for all trees that are built. (Used for all trees they cost 1 to 4 % of the speed: they are spread too far.)
pub type DeepSlot = Slot<1032>;

const _: () = assert!(size_of::<ShallowSlot>() / 64 % 2 == 1 && size_of::<DeepSlot>() / 64 % 2 == 1);

/// Is a piece of a curve perhaps close by on the curve that a ray starts on? Its number is near to that of the ray's primitive
/// then. (So may be that of a piece of another curve: nothing is lost there but slivers where two of its pieces join.)
#[inline(always)]
pub fn starts_near(id: u32, origin_primitive: u32) -> bool {
    const NEAR: u32 = 256;
    id.wrapping_sub(origin_primitive).wrapping_add(NEAR) <= 2 * NEAR
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

    /// Something to visit whatever is hit before.
    #[inline(always)]
    pub fn push(&mut self, reference: u32) {
        self.stack[self.top as usize % Self::STACK] = Entry { reference, distance: f32::NEG_INFINITY };
        self.top += 1;
    }

    /// The next packet of a leaf, if there is one, without a branch.
    #[inline(always)]
    pub fn push_next(&mut self, reference: u32) {
        let top = self.top + u32::from(reference != DONE);
        self.push(reference);
        self.top = top;
    }

    /// Takes the topmost entry, of `count` more than were pushed, that can still matter: in search of any hit each one, and
    /// the bottom entry always.
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

    /// Puts what [`Slot::pop`] took last back.
    #[inline(always)]
    pub fn put_back(&mut self) {
        self.top += 1;
    }

    /// Tests the lanes of a packet exactly. Was there a nearer hit?
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
        let (u, v) = on_primitive(packet.part(lane), weights);
        self.offer(t, u, v, packet.id(lane), before);
    }

    /// Tests the pieces of curves of a packet. A ray that starts on one does not meet it again.
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

    /// Where hits of a primitive of the present space begin to count. Rays that start just before a primitive, of which they
    /// have met those up to this one (`before`), don't meet these there again.
    #[inline(always)]
    pub fn t_min_of(&self, prim: u32, before: Option<OriginPrimitive>) -> f32 {
        match before {
            Some(o) if (self.instance, prim) <= (o.instance, o.prim) => self.t_min.next_up(),
            _ => self.t_min,
        }
    }

    /// Takes a hit if it lies in the ray's range and before the nearest one, or as near with a smaller id.
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
