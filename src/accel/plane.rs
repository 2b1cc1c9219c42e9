//! The plane of a triangle, and where a ray meets it.

use super::layout::TrianglePacket;
use crate::shape::PreparedRay;

/// The plane of a triangle, and what the triangle is.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Plane {
    normal: [f64; 3],
    vertex: [f32; 3],
    /// Id of the primitive.
    pub id: u32,
    /// Which part of it the triangle is.
    pub part: u32,
}

impl Plane {
    /// Of a lane of a packet.
    #[inline(always)]
    pub fn new(packet: &TrianglePacket, lane: usize) -> Plane {
        let at = |axis: usize, vertex: usize| f64::from(packet.rows[4 * axis + vertex][lane]);
        // Without `map`, which would be compiled for the lowest CPU level.
        let edge = |k: usize| [at(0, k) - at(0, 0), at(1, k) - at(1, 0), at(2, k) - at(2, 0)];
        let (e, f) = (edge(1), edge(2));
        let normal = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
        let vertex = [packet.rows[0][lane], packet.rows[4][lane], packet.rows[8][lane]];
        Plane { normal, vertex, id: packet.id(lane), part: packet.part(lane) }
    }

    /// Where a ray meets it, as [`crate::simd::Wide::plane_parameters`] has it; infinite or NaN where it is parallel to it.
    #[inline(always)]
    pub fn parameter(&self, ray: &PreparedRay) -> f32 {
        let (n, a) = (self.normal, widen(self.vertex));
        let (o, d) = (widen(ray.origin), widen(ray.direction));
        let below = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
        let above = n[0] * (a[0] - o[0]) + n[1] * (a[1] - o[1]) + n[2] * (a[2] - o[2]);
        (above / below) as f32
    }
}

#[inline(always)]
fn widen([x, y, z]: [f32; 3]) -> [f64; 3] {
    [f64::from(x), f64::from(y), f64::from(z)]
}
