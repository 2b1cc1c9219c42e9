//! A ray in flight: where it is, what it has hit, and the tests that decide on hits.

use super::layout::{PART_QUAD_FIRST, PART_TRIANGLE, TrianglePacket};
use super::prepare::PreparedRay;
use super::triangle;
use crate::math::{Hit, NO_HIT};
use crate::simd::{BoxRay, WIDEN, Wide};

/// A ray in flight. What a step at a node needs comes first.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub struct Slot {
    /// The ray for box tests.
    pub boxes: BoxRay,
    /// Boxes that begin behind this hold nothing nearer.
    pub limit: f32,
    /// The first free entry of this ray's stack.
    pub top: u32,
    /// Which ray of the batch.
    pub index: u32,
    /// The ray for everything else.
    pub ray: PreparedRay,
    /// The nearest hit so far; its `t` is in units of the scaled direction of the present space.
    pub best: Hit,
    /// The instance whose space the ray is in; 0 in the world.
    pub instance: u32,
}

impl Slot {
    /// Fills unused slots.
    pub const EMPTY: Slot = Slot {
        boxes: BoxRay::NONE,
        limit: 0.0,
        top: 0,
        index: 0,
        ray: PreparedRay::NONE,
        best: Hit::MISS,
        instance: 0,
    };

    /// Tests the lanes of a packet exactly. Was there a nearer hit?
    #[inline(always)]
    pub fn triangles<W: Wide>(
        &mut self,
        w: W,
        packet: &TrianglePacket,
        mut lanes: u32,
        any_hit: bool,
    ) -> bool {
        let before = self.limit;
        // Not waiting for the division where all is behind the ray pays for shadow rays, whose packets hold more than
        // the surface that they leave; for others it is one more branch that cannot be predicted.
        let asked = if any_hit { lanes } else { u32::MAX };
        let t = triangle::plane_parameters(w, packet, &self.ray, asked);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize & 3;
            lanes &= lanes - 1;
            if t[lane] > self.ray.t_min && t[lane] <= self.best.t {
                self.triangle(packet, lane, t[lane]);
            }
        }
        self.limit < before
    }

    #[inline(always)]
    fn triangle(&mut self, packet: &TrianglePacket, lane: usize, t: f32) {
        let Some(triangle::Weights { u, v }) = triangle::weights(packet, lane, &self.ray, &self.boxes) else {
            return;
        };
        let (u, v) = match packet.part(lane) {
            PART_TRIANGLE => (u, v),
            PART_QUAD_FIRST => ((u + v).min(1.0), v),
            _ => (u, (u + v).min(1.0)),
        };
        self.offer(t, u, v, packet.id(lane));
    }

    /// Takes a hit if it lies in the ray's range and before the nearest one, or as near with a smaller id.
    #[inline(always)]
    pub fn offer(&mut self, t: f32, u: f32, v: f32, prim: u32) {
        let nearer = t < self.best.t;
        let tie = t == self.best.t
            && self.best.prim != NO_HIT
            && (self.instance, prim) < (self.best.instance, self.best.prim);
        if t > self.ray.t_min && (nearer || tie) {
            self.best = Hit { t, u, v, prim, instance: self.instance };
            self.limit = t * WIDEN;
        }
    }
}
