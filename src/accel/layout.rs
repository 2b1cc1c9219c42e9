//! What the buffer of cache lines holds, and how its parts refer to each other.
//!
//! A reference is 32 bits: an inner node is its line number; anything else has [`LEAF`] set, its kind in bits 29 and 30
//! and its line number below. Bit 30 is clear for triangles alone. Packets name the next packet of their leaf, so a leaf has any length and mixes kinds.

use crate::math::Vec3;
use crate::shape::triangle::{LANES, TriangleRows, Weights};
use crate::shape::{CurveSegment, Packed};
use crate::simd::Line;
use bytemuck::{Pod, Zeroable};
use std::mem::offset_of;

/// Set in references to anything but inner nodes.
pub const LEAF: u32 = 1 << 31;
/// A packet of triangles (and halves of quads).
pub const KIND_TRIANGLES: u32 = 0;
/// A packet of analytic shapes.
pub const KIND_ANALYTIC: u32 = 2;
/// A placed geometry.
pub const KIND_INSTANCE: u32 = 3;
/// On the stack below everything: the ray is done. In packets: no further packet. (An instance by its kind, but lines 0
/// and 1 hold no record: what instances place comes first.)
pub const DONE: u32 = LEAF | (KIND_INSTANCE << 29);
/// On the stack below an instance's entries: back to the world.
pub const LEAVE_INSTANCE: u32 = DONE + 1;
/// Largest line number: 32 GiB.
pub const MAX_LINE: usize = (1 << 29) - 2;

/// The reference to a leaf part.
pub fn leaf_ref(kind: u32, line: usize) -> u32 {
    LEAF | (kind << 29) | line as u32
}

/// The kind of a leaf reference.
#[inline(always)]
pub fn kind_of(reference: u32) -> u32 {
    (reference >> 29) & 3
}

/// The line number of a reference.
#[inline(always)]
pub fn line_of(reference: u32) -> usize {
    (reference & 0x1fff_ffff) as usize
}

/// Lines of a [`Node`].
pub const NODE_LINES: usize = 4;
/// Lines of a [`TrianglePacket`].
pub const TRIANGLE_LINES: usize = 3;
/// Lines of an [`AnalyticPacket`].
pub const ANALYTIC_LINES: usize = 2;
/// Lines of an [`InstanceRecord`].
pub const INSTANCE_LINES: usize = 1;

/// An inner node: eight children's boxes and references. Unused children have an inverted, infinite box.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Node {
    /// min x, max x, min y, max y, min z, max z of each child.
    pub planes: [[f32; 8]; 6],
    /// References; [`DONE`] where unused.
    pub child: [u32; 8],
    /// Unused.
    pub padding: [u32; 8],
}

/// What a lane of a [`TrianglePacket`] is.
pub const PART_TRIANGLE: u32 = 0;
/// The half `corner, corner + u, corner + u + v` of a quad.
pub const PART_QUAD_FIRST: u32 = 1;
/// The half `corner, corner + u + v, corner + v` of a quad.
pub const PART_QUAD_SECOND: u32 = 2;

/// The parameters of a triangle's hit on the triangle or quad that it is a part of.
#[inline(always)]
pub fn on_primitive(part: u32, weights: Weights) -> (f32, f32) {
    let Weights { u, v } = weights;
    match part {
        PART_TRIANGLE => (u, v),
        PART_QUAD_FIRST => ((u + v).min(1.0), v),
        _ => (u, (u + v).min(1.0)),
    }
}

/// Four triangles. Unused lanes are NaN, which no ray hits.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct TrianglePacket {
    /// For axis k: vertices 0, 1, 2 in rows 4k to 4k + 2. Row 3: ids, row 7: parts, row 11: the next packet (first
    /// lane), all as bits.
    pub rows: TriangleRows,
}

impl TrianglePacket {
    /// A packet without triangles and without successor.
    pub fn empty() -> TrianglePacket {
        let mut packet = TrianglePacket { rows: [[f32::NAN; LANES]; 12] };
        packet.rows[3] = [f32::from_bits(u32::MAX); LANES];
        packet.rows[7] = [f32::from_bits(0); LANES];
        packet.rows[11] = [f32::from_bits(DONE); LANES];
        packet
    }

    /// Four triangles or fewer, with their ids and what they are.
    pub fn of(triangles: &[([Vec3; 3], u32, u32)], next: u32) -> TrianglePacket {
        let mut packet = TrianglePacket::empty();
        packet.rows[11] = [f32::from_bits(next); LANES];
        for (lane, (vertices, id, part)) in triangles.iter().enumerate() {
            for (k, vertex) in vertices.iter().enumerate() {
                for axis in 0..3 {
                    packet.rows[4 * axis + k][lane] = vertex[axis];
                }
            }
            packet.rows[3][lane] = f32::from_bits(*id);
            packet.rows[7][lane] = f32::from_bits(*part);
        }
        packet
    }

    /// Primitive ids, as bits.
    #[inline(always)]
    pub fn ids(&self) -> &[f32; LANES] {
        &self.rows[3]
    }

    /// Primitive id of a lane.
    #[inline(always)]
    pub fn id(&self, lane: usize) -> u32 {
        self.rows[3][lane].to_bits()
    }

    /// What a lane is.
    #[inline(always)]
    pub fn part(&self, lane: usize) -> u32 {
        self.rows[7][lane].to_bits()
    }

    /// The next packet of the leaf, or [`DONE`].
    #[inline(always)]
    pub fn next(&self) -> u32 {
        self.rows[11][0].to_bits()
    }
}

/// In place of an analytic shape's kind, in the first lane: four triangles follow whose vertices move, once for each key of their
/// geometry, as [`TrianglePacket`]s. Their number is in place of the first lane's id.
pub const MOVING_TRIANGLES: u8 = u8::MAX;

/// Four analytic shapes.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct AnalyticPacket {
    /// What each follows from.
    pub numbers: [[f32; 6]; LANES],
    /// Primitive ids.
    pub id: [u32; LANES],
    /// Which shapes they are; 0 in unused lanes.
    pub kind: [u8; LANES],
    /// The next packet of the leaf, or [`DONE`].
    pub next: u32,
    /// Unused.
    pub padding: [u32; 2],
}

impl AnalyticPacket {
    /// The shape of a lane.
    #[inline(always)]
    pub fn packed(&self, lane: usize) -> Packed {
        Packed { kind: self.kind[lane], numbers: self.numbers[lane] }
    }
}

/// In place of an analytic shape's kind, in the first lane: the packet is a [`CurvePacket`].
pub const CURVE_SEGMENTS: u8 = u8::MAX - 1;

/// Pieces of curves in a packet.
pub const CURVES: usize = 2;

/// Two pieces of curves. What is at `kind` and `next` is where [`AnalyticPacket`] has it.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct CurvePacket {
    /// Both ends of each.
    ends: [[[f32; 3]; 2]; CURVES],
    /// Tangents there.
    tangents: [[[f32; 3]; 2]; CURVES],
    /// Primitive ids; `u32::MAX` in an unused lane.
    pub id: [u32; CURVES],
    /// Radii of the first piece's ends.
    first_radii: [f32; 2],
    /// [`CURVE_SEGMENTS`].
    kind: [u8; LANES],
    /// The next packet of the leaf, or [`DONE`].
    pub next: u32,
    /// Radii of the second piece's ends.
    second_radii: [f32; 2],
}

impl CurvePacket {
    /// Two pieces, or one, with their ids.
    pub fn of(segments: impl Iterator<Item = (CurveSegment, u32)>, next: u32) -> CurvePacket {
        let mut packet = CurvePacket { id: [u32::MAX; CURVES], next, ..CurvePacket::zeroed() };
        packet.kind = [CURVE_SEGMENTS; LANES];
        for (lane, (segment, id)) in segments.take(CURVES).enumerate() {
            packet.ends[lane] = segment.ends.map(|p| p.to_array());
            packet.tangents[lane] = segment.tangents.map(|t| t.to_array());
            *(if lane == 0 { &mut packet.first_radii } else { &mut packet.second_radii }) = segment.radii;
            packet.id[lane] = id;
        }
        packet
    }

    /// The piece of a lane.
    #[inline(always)]
    pub fn segment(&self, lane: usize) -> CurveSegment {
        let [ends, tangents] = [self.ends[lane], self.tangents[lane]];
        let vectors = |[a, b]: [[f32; 3]; 2]| [Vec3::from_array(a), Vec3::from_array(b)];
        let radii = if lane == 0 { self.first_radii } else { self.second_radii };
        CurveSegment { ends: vectors(ends), radii, tangents: vectors(tangents) }
    }

    /// The lanes in use.
    #[inline(always)]
    pub fn lanes(&self) -> usize {
        if self.id[1] == u32::MAX { 1 } else { 2 }
    }
}

/// Views the packet at a line as one of curves, if it is.
#[inline(always)]
pub fn curves_at<'a>(lines: &'a [Line], line: usize, packet: &AnalyticPacket) -> Option<&'a CurvePacket> {
    if packet.kind[0] != CURVE_SEGMENTS {
        return None;
    }
    view::<CurvePacket, ANALYTIC_LINES>(lines, line)
}

/// A placed geometry.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct InstanceRecord {
    /// Rows of the 3 x 4 matrix from world to object space.
    pub object_from_world: [[f32; 4]; 3],
    /// Where the geometry's BVH starts.
    pub root: u32,
    /// The instance's number in hits.
    pub instance: u32,
    /// The next packet of the leaf, or [`DONE`].
    pub next: u32,
    /// The largest absolute coordinate of the geometry.
    pub reach: f32,
}

impl InstanceRecord {
    /// The part of the world that stands still, below the tree of what moves in it: no other space, so no matrix.
    pub fn world(root: u32, reach: f32) -> InstanceRecord {
        InstanceRecord { object_from_world: [[0.0; 4]; 3], root, instance: 0, next: DONE, reach }
    }
}

const _: () = assert!(size_of::<Node>() == NODE_LINES * 64);
const _: () = assert!(size_of::<TrianglePacket>() == TRIANGLE_LINES * 64);
const _: () = assert!(size_of::<AnalyticPacket>() == ANALYTIC_LINES * 64);
const _: () = assert!(size_of::<CurvePacket>() == ANALYTIC_LINES * 64);
const _: () = assert!(offset_of!(CurvePacket, kind) == offset_of!(AnalyticPacket, kind));
const _: () = assert!(offset_of!(CurvePacket, next) == offset_of!(AnalyticPacket, next));
const _: () = assert!(size_of::<InstanceRecord>() == INSTANCE_LINES * 64);

/// Views `N` lines as one of the records above; `None` where the buffer ends earlier.
#[inline(always)]
pub fn view<T: Pod, const N: usize>(lines: &[Line], line: usize) -> Option<&T> {
    const { assert!(size_of::<T>() == N * 64 && align_of::<T>() == 64) };
    bytemuck::cast_slice(lines.get(line..line + N)?).first()
}

/// Views the lines from `line` on as one of the records above, to write it.
pub fn view_mut<T: Pod>(lines: &mut [Line], line: usize) -> &mut T {
    let count = size_of::<T>() / size_of::<Line>();
    bytemuck::from_bytes_mut(bytemuck::cast_slice_mut::<Line, u8>(&mut lines[line..line + count]))
}
