//! Motion blur: interpolated instance transforms and interpolated triangle vertices.
//!
//! Ray times (0..1 within the shutter interval) are a separate array, which only the traversal of moving scenes reads. Node boxes
//! bound their contents over the whole shutter interval.

use super::input::{AccelInput, Geometry, MovingInstance, vertices_of};
use super::layout::{
    ANALYTIC_LINES, AnalyticPacket, InstanceRecord, MOVING_TRIANGLES, TRIANGLE_LINES, TrianglePacket, view,
    view_mut,
};
use crate::math::{DAffine3, TransformKeys, Vec3, segment, transform_at};
use crate::shape::triangle::LANES;
use crate::simd::Line;

/// Transforms of an instance at equal intervals of the shutter; empty if static.
pub fn keys_of_instance(moving: &[MovingInstance], instance: usize) -> &[DAffine3] {
    let found = moving.binary_search_by_key(&instance, |m| m.instance);
    found.map_or(&[], |at| &moving[at].keys)
}

/// Motion of a structure's instances and vertices.
#[derive(Default)]
pub struct Motions {
    /// Motion keys by instance; `None` if static. Empty if no instance moves.
    transforms: Vec<Option<TransformKeys>>,
    has_moving_vertices: bool,
}

impl Motions {
    pub fn of(input: &AccelInput) -> Motions {
        let has_moving_vertices = input.geometries.iter().any(|g| !g.keys.is_empty());
        let mut transforms = Vec::new();
        if !input.moving.is_empty() {
            transforms.resize(input.instances.len(), None);
        }
        for moving in input.moving {
            transforms[moving.instance] = Some(moving.keys.clone());
        }
        Motions { transforms, has_moving_vertices }
    }

    /// Whether nothing moves.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.transforms.is_empty() && !self.has_moving_vertices
    }

    #[inline]
    fn record(&self, record: &InstanceRecord, time: f32) -> InstanceRecord {
        let keys = self.transforms.get((record.instance as usize).wrapping_sub(1));
        match keys {
            Some(Some(keys)) => {
                let object_from_world = transform_at(keys, time).inverse();
                InstanceRecord { object_from_world: InstanceRecord::rows(&object_from_world), ..*record }
            }
            _ => *record,
        }
    }
}

/// The times of the rays of a batch.
pub trait RayTimes: Copy {
    /// Whether anything moves.
    const MOVING: bool;

    /// The time of a ray, 0..1.
    fn time(&self, ray: usize) -> f32;

    /// The record of an instance that a ray enters.
    fn record(&self, record: &InstanceRecord, ray: usize) -> InstanceRecord;
}

/// [`RayTimes`] of static scenes.
#[derive(Clone, Copy)]
pub struct NoMotion;

impl RayTimes for NoMotion {
    const MOVING: bool = false;

    #[inline(always)]
    fn time(&self, _ray: usize) -> f32 {
        0.0
    }

    #[inline(always)]
    fn record(&self, record: &InstanceRecord, _ray: usize) -> InstanceRecord {
        *record
    }
}

/// [`RayTimes`] of moving scenes: a time per ray.
#[derive(Clone, Copy)]
pub struct TimeByRay<'a> {
    /// Times by ray, 0..1.
    pub times: &'a [f32],
    /// Motion of instances and vertices.
    pub motions: &'a Motions,
}

impl RayTimes for TimeByRay<'_> {
    const MOVING: bool = true;

    #[inline(always)]
    fn time(&self, ray: usize) -> f32 {
        self.times[ray]
    }

    #[inline(always)]
    fn record(&self, record: &InstanceRecord, ray: usize) -> InstanceRecord {
        self.motions.record(record, self.times[ray])
    }
}

/// The triangles after a header packet, interpolated at a time. Equal vertices of different triangles are interpolated to the same
/// bits, so meshes stay watertight.
#[inline(always)]
pub fn triangles_at(
    lines: &[Line],
    header: usize,
    packet: &AnalyticPacket,
    time: f32,
) -> Option<TrianglePacket> {
    let (key, fraction) = segment(packet.id[0] as usize, time);
    let at = |key: usize| {
        view::<TrianglePacket, TRIANGLE_LINES>(lines, header + ANALYTIC_LINES + key * TRIANGLE_LINES)
    };
    let (mut triangles, to) = (*at(key)?, at(key + 1)?);
    for axis in 0..3 {
        for vertex in 0..3 {
            let row = 4 * axis + vertex;
            for lane in 0..LANES {
                let from = triangles.rows[row][lane];
                triangles.rows[row][lane] = from + (to.rows[row][lane] - from) * fraction;
            }
        }
    }
    Some(triangles)
}

/// Writes the header packet of moving triangles and one packet of triangles per motion key.
pub fn write_triangles(
    region: &mut [Line],
    at: usize,
    geometry: &Geometry,
    triangles: &[([Vec3; 3], u32, u32)],
    next: u32,
) {
    let mut header = AnalyticPacket {
        parameters: [[0.0; 6]; LANES],
        id: [u32::MAX; LANES],
        kind: [0; LANES],
        next,
        padding: [0; 2],
    };
    (header.kind[0], header.id[0]) = (MOVING_TRIANGLES, geometry.keys.len() as u32);
    *view_mut(region, at) = header;
    for (key, positions) in geometry.keys.iter().enumerate() {
        let mut moved = triangles.to_vec();
        for (vertices, id, _) in &mut moved {
            let corners = geometry.triangles.get(*id as usize);
            *vertices = corners.and_then(|t| vertices_of(positions, *t)).unwrap_or(*vertices);
        }
        *view_mut(region, at + ANALYTIC_LINES + key * TRIANGLE_LINES) = TrianglePacket::of(&moved, next);
    }
}
