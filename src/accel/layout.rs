//! Memory layout of a BVH: nodes and packets of primitives in a buffer of 64-byte cache lines.
//!
//! A reference has 32 bits. Inner nodes: the line number. Leaf packets: [`LEAF`] is set, bits 29 and 30 hold the kind, the bits
//! below the line number; bit 30 is 0 for triangles and 1 for all other kinds. The packets of a leaf form a linked list, so a
//! leaf has any length and may mix kinds.

use crate::math::{DAffine3, Ray, Vec3};
use crate::shape::triangle::{LANES, TriangleRows, Weights};
use crate::shape::{CurveSegment, Packed, PreparedRay, Splat, SplatLanes};
use crate::simd::Line;
use bytemuck::{Pod, Zeroable};
use std::mem::offset_of;

/// Bit that marks references to leaf packets.
pub const LEAF: u32 = 1 << 31;
/// A packet of triangles (and halves of quads).
pub const KIND_TRIANGLES: u32 = 0;
/// A packet of analytic shapes.
pub const KIND_ANALYTIC: u32 = 2;
/// An instance of a geometry.
pub const KIND_INSTANCE: u32 = 3;
/// At the bottom of the stack: end of the ray. In packets: end of the list. (Encoded as an instance at line 0; lines 0 and 1 never
/// hold an instance record, because geometries precede the instances that use them.)
pub const DONE: u32 = LEAF | (KIND_INSTANCE << 29);
/// Stack entry below those of an instance: return to world space. (Encoded as an instance at line 1.)
pub const LEAVE_INSTANCE: u32 = DONE + 1;
/// Largest line number: the buffer may take up to 32 GiB.
pub const MAX_LINE: usize = (1 << 29) - 2;

/// Error: the buffer has reached [`MAX_LINE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BufferFull;

/// The reference to a packet of a leaf.
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

pub const NODE_LINES: usize = 4;
/// Lines of a [`TrianglePacket`].
pub const TRIANGLE_LINES: usize = 3;
/// Lines of an [`AnalyticPacket`].
pub const ANALYTIC_LINES: usize = 2;
/// Lines of a [`SplatPacket`].
pub const SPLAT_LINES: usize = 4;
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

// Part numbers of lanes of a [`TrianglePacket`].

/// A triangle of a mesh.
pub const PART_TRIANGLE: u32 = 0;
/// The half `corner, corner + u, corner + u + v` of a quad.
pub const PART_QUAD_FIRST: u32 = 1;
/// The half `corner, corner + u + v, corner + v` of a quad.
pub const PART_QUAD_SECOND: u32 = 2;

/// Converts barycentric weights on a lane's triangle to (u, v) of its primitive, which is the triangle itself or a quad.
#[inline(always)]
pub fn primitive_uv(part: u32, weights: Weights) -> (f32, f32) {
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
    /// Coordinate k of vertices 0, 1, 2 in rows 4k to 4k + 2. Row 3: primitive ids, row 7: part numbers, row 11: reference to the next
    /// packet (lane 0), all as integer bits.
    pub rows: TriangleRows,
}

impl TrianglePacket {
    /// A packet with unused lanes only, at the end of a list.
    pub fn empty() -> TrianglePacket {
        let mut packet = TrianglePacket { rows: [[f32::NAN; LANES]; 12] };
        packet.rows[3] = [f32::from_bits(u32::MAX); LANES];
        packet.rows[7] = [f32::from_bits(0); LANES];
        packet.rows[11] = [f32::from_bits(DONE); LANES];
        packet
    }

    /// A packet of up to four triangles (vertices, primitive id, part number).
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

    /// Primitive ids, as integer bits.
    #[inline(always)]
    pub fn ids(&self) -> &[f32; LANES] {
        &self.rows[3]
    }

    /// Primitive id of a lane.
    #[inline(always)]
    pub fn id(&self, lane: usize) -> u32 {
        self.rows[3][lane].to_bits()
    }

    /// Part number of a lane: [`PART_TRIANGLE`], [`PART_QUAD_FIRST`] or [`PART_QUAD_SECOND`].
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

/// `kind[0]` of an [`AnalyticPacket`] that is the header of moving triangles: `id[0]` is the number of motion keys, and one
/// [`TrianglePacket`] per key follows.
pub const MOVING_TRIANGLES: u8 = u8::MAX;

/// Four analytic shapes.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct AnalyticPacket {
    /// Parameters of each shape ([`Packed::parameters`]).
    pub parameters: [[f32; 6]; LANES],
    /// Primitive ids.
    pub id: [u32; LANES],
    /// Kinds of the shapes ([`Packed::kind`]); 0 in unused lanes.
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
        Packed { kind: self.kind[lane], parameters: self.parameters[lane] }
    }
}

/// `kind` of a [`CurvePacket`].
pub const CURVE_SEGMENTS: u8 = u8::MAX - 1;

/// Number of curve segments in a [`CurvePacket`].
pub const CURVE_LANES: usize = 2;

/// Two curve segments. `kind` and `next` are at the same offsets as in [`AnalyticPacket`].
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct CurvePacket {
    /// End points of each segment, metres.
    ends: [[[f32; 3]; 2]; CURVE_LANES],
    /// Tangents at the end points.
    tangents: [[[f32; 3]; 2]; CURVE_LANES],
    /// Primitive ids; `u32::MAX` in an unused lane.
    pub id: [u32; CURVE_LANES],
    /// Radii at the first segment's end points, metres.
    first_radii: [f32; 2],
    /// [`CURVE_SEGMENTS`].
    kind: [u8; LANES],
    /// The next packet of the leaf, or [`DONE`].
    pub next: u32,
    /// Radii at the second segment's end points, metres.
    second_radii: [f32; 2],
}

impl CurvePacket {
    /// A packet of one or two segments with their ids.
    pub fn of(segments: impl Iterator<Item = (CurveSegment, u32)>, next: u32) -> CurvePacket {
        let mut packet = CurvePacket { id: [u32::MAX; CURVE_LANES], next, ..CurvePacket::zeroed() };
        packet.kind = [CURVE_SEGMENTS; LANES];
        for (lane, (segment, id)) in segments.take(CURVE_LANES).enumerate() {
            packet.ends[lane] = segment.ends.map(|p| p.to_array());
            packet.tangents[lane] = segment.tangents.map(|t| t.to_array());
            *(if lane == 0 { &mut packet.first_radii } else { &mut packet.second_radii }) = segment.radii;
            packet.id[lane] = id;
        }
        packet
    }

    #[inline(always)]
    pub fn segment(&self, lane: usize) -> CurveSegment {
        let [ends, tangents] = [self.ends[lane], self.tangents[lane]];
        let vectors = |[a, b]: [[f32; 3]; 2]| [Vec3::from_array(a), Vec3::from_array(b)];
        let radii = if lane == 0 { self.first_radii } else { self.second_radii };
        CurveSegment { ends: vectors(ends), radii, tangents: vectors(tangents) }
    }

    /// Number of used lanes.
    #[inline(always)]
    pub fn lanes(&self) -> usize {
        if self.id[1] == u32::MAX { 1 } else { 2 }
    }
}

/// `kind` of a [`SplatPacket`]; smaller kinds are analytic shapes.
pub const SPLATS: u8 = u8::MAX - 2;

/// Four Gaussian splats. `kind` and `next` are at the same offsets as in [`AnalyticPacket`].
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct SplatPacket {
    /// The first seven elements of the matrices ([`Splat::rows`]).
    first_rows: [[f32; LANES]; 7],
    /// [`SPLATS`].
    kind: [u8; LANES],
    /// The next packet of the leaf, or [`DONE`].
    pub next: u32,
    /// Unused.
    padding: [u32; 2],
    /// The last two elements of the matrices.
    last_rows: [[f32; LANES]; 2],
    /// Centres, metres: x, y, z.
    center: [[f32; LANES]; 3],
    /// Peak opacities, 0..1; 0 in unused lanes.
    opacity: [f32; LANES],
    /// Primitive ids; `u32::MAX` in unused lanes.
    pub id: [u32; LANES],
    /// Unused.
    more_padding: [u32; LANES],
}

impl SplatPacket {
    /// A packet of up to four splats with their ids.
    pub fn of(splats: impl Iterator<Item = (Splat, u32)>, next: u32) -> SplatPacket {
        let kind = [SPLATS; LANES];
        let mut packet = SplatPacket { kind, next, id: [u32::MAX; LANES], ..SplatPacket::zeroed() };
        // The identity matrix in unused lanes keeps the ray test finite.
        packet.first_rows[0] = [1.0; LANES];
        packet.first_rows[4] = [1.0; LANES];
        packet.last_rows[1] = [1.0; LANES];
        for (lane, (splat, id)) in splats.take(LANES).enumerate() {
            for (i, number) in splat.rows.as_flattened().iter().enumerate() {
                let row = if i < 7 { &mut packet.first_rows[i] } else { &mut packet.last_rows[i - 7] };
                row[lane] = *number;
            }
            (0..3).for_each(|axis| packet.center[axis][lane] = splat.center[axis]);
            packet.opacity[lane] = splat.opacity;
            packet.id[lane] = id;
        }
        packet
    }

    /// The lanes as a structure of arrays.
    #[inline(always)]
    pub fn lanes(&self) -> SplatLanes<'_> {
        let [a, b, c, d, e, f, g] = &self.first_rows;
        let [h, i] = &self.last_rows;
        let [x, y, z] = &self.center;
        SplatLanes { center: [x, y, z], rows: [a, b, c, d, e, f, g, h, i], opacity: &self.opacity }
    }

    /// The centre of a lane's splat.
    pub fn center(&self, lane: usize) -> Vec3 {
        Vec3::new(self.center[0][lane], self.center[1][lane], self.center[2][lane])
    }
}

/// A packet of a leaf, by type.
pub enum LeafPacket<'a> {
    /// Triangles and halves of quads.
    Triangles(&'a TrianglePacket),
    /// Moving triangles: line of the header and number of motion keys.
    MovingTriangles(usize, usize),
    /// Analytic shapes.
    Analytic(&'a AnalyticPacket),
    /// Curve segments.
    Curves(&'a CurvePacket),
    /// Gaussian splats.
    Splats(&'a SplatPacket),
    Instance(&'a InstanceRecord),
}

/// The packets of a leaf in order, for use outside of rendering. An invalid reference yields an error and ends the iteration.
pub fn leaf_packets(lines: &[Line], first: u32) -> impl Iterator<Item = Result<LeafPacket<'_>, u32>> {
    let mut reference = first;
    std::iter::from_fn(move || {
        let current = std::mem::replace(&mut reference, DONE);
        if current == DONE {
            return None;
        }
        let Some((packet, next)) = packet_at(lines, current) else { return Some(Err(current)) };
        reference = next;
        Some(Ok(packet))
    })
}

/// The packet at a reference, and the reference to the next packet of its leaf.
fn packet_at(lines: &[Line], reference: u32) -> Option<(LeafPacket<'_>, u32)> {
    let line = line_of(reference);
    match kind_of(reference) {
        KIND_TRIANGLES => {
            let packet = view::<TrianglePacket, TRIANGLE_LINES>(lines, line)?;
            Some((LeafPacket::Triangles(packet), packet.next()))
        }
        KIND_ANALYTIC => {
            let packet = view::<AnalyticPacket, ANALYTIC_LINES>(lines, line)?;
            let of_kind = match packet.kind[0] {
                MOVING_TRIANGLES => LeafPacket::MovingTriangles(line, packet.id[0] as usize),
                CURVE_SEGMENTS => LeafPacket::Curves(view::<CurvePacket, ANALYTIC_LINES>(lines, line)?),
                SPLATS => LeafPacket::Splats(view::<SplatPacket, SPLAT_LINES>(lines, line)?),
                _ => LeafPacket::Analytic(packet),
            };
            Some((of_kind, packet.next))
        }
        KIND_INSTANCE if reference != LEAVE_INSTANCE => {
            let record = view::<InstanceRecord, INSTANCE_LINES>(lines, line)?;
            Some((LeafPacket::Instance(record), record.next))
        }
        _ => None,
    }
}

/// The packet at a line as a [`CurvePacket`], if its kind is [`CURVE_SEGMENTS`].
#[inline(always)]
pub fn curves_at<'a>(lines: &'a [Line], line: usize, packet: &AnalyticPacket) -> Option<&'a CurvePacket> {
    if packet.kind[0] != CURVE_SEGMENTS {
        return None;
    }
    view::<CurvePacket, ANALYTIC_LINES>(lines, line)
}

/// An instance of a geometry.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct InstanceRecord {
    /// Rows of the 3 x 4 world-to-object matrix.
    pub object_from_world: [[f32; 4]; 3],
    /// Reference to the root of the geometry's BVH.
    pub root: u32,
    /// [`crate::math::Hit::instance`] of hits on the instance.
    pub instance: u32,
    /// The next packet of the leaf, or [`DONE`].
    pub next: u32,
    /// Largest absolute coordinate of the geometry, object space.
    pub reach: f32,
}

impl InstanceRecord {
    /// Record by which a top-level BVH over moving instances refers to the BVH of the world, which is in world space: the matrix is
    /// unused.
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
const _: () = assert!(size_of::<SplatPacket>() == SPLAT_LINES * 64);
const _: () = assert!(offset_of!(SplatPacket, kind) == offset_of!(AnalyticPacket, kind));
const _: () = assert!(offset_of!(SplatPacket, next) == offset_of!(AnalyticPacket, next));
const _: () = assert!(size_of::<InstanceRecord>() == INSTANCE_LINES * 64);

/// Views `N` lines as one of the records above; `None` where the buffer ends earlier.
#[inline(always)]
pub fn view<T: Pod, const N: usize>(lines: &[Line], line: usize) -> Option<&T> {
    const { assert!(size_of::<T>() == N * 64 && align_of::<T>() == 64) };
    bytemuck::cast_slice(lines.get(line..line + N)?).first()
}

/// Views the lines from `line` on as one of the records above, mutably.
pub fn view_mut<T: Pod>(lines: &mut [Line], line: usize) -> &mut T {
    let count = size_of::<T>() / size_of::<Line>();
    bytemuck::from_bytes_mut(bytemuck::cast_slice_mut::<Line, u8>(&mut lines[line..line + count]))
}

impl InstanceRecord {
    /// Converts an affine transform to [`InstanceRecord::object_from_world`].
    pub fn rows(object_from_world: &DAffine3) -> [[f32; 4]; 3] {
        let m = object_from_world;
        let row = |k: usize| {
            [m.matrix3.x_axis[k], m.matrix3.y_axis[k], m.matrix3.z_axis[k], m.translation[k]]
                .map(|x| x as f32)
        };
        [row(0), row(1), row(2)]
    }

    /// Transforms a world-space ray to object space. The direction is not normalised, so ray parameters are the same in both spaces.
    #[inline(always)]
    pub fn transform(&self, ray: &PreparedRay, t_min: f32, t_max: f32) -> Ray {
        let [o, d] = [ray.origin, ray.direction];
        let row = |k: usize| {
            let m = &self.object_from_world[k];
            ((m[0] * o[0] + m[1] * o[1]) + (m[2] * o[2] + m[3]), m[0] * d[0] + m[1] * d[1] + m[2] * d[2])
        };
        let [x, y, z] = [row(0), row(1), row(2)];
        let (origin, direction) = (Vec3::new(x.0, y.0, z.0), Vec3::new(x.1, y.1, z.1));
        Ray { t_min, t_max, ..Ray::new(origin, direction) }
    }
}

/// The plane of a triangle.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    normal: [f64; 3],
    vertex: [f32; 3],
}

impl Plane {
    #[inline(always)]
    pub fn new(packet: &TrianglePacket, lane: usize) -> Plane {
        let at = |axis: usize, vertex: usize| f64::from(packet.rows[4 * axis + vertex][lane]);
        // Not `map`, which is not inlined and would be compiled for the baseline CPU level.
        let edge = |k: usize| [at(0, k) - at(0, 0), at(1, k) - at(1, 0), at(2, k) - at(2, 0)];
        let (e, f) = (edge(1), edge(2));
        let normal = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
        let vertex = [packet.rows[0][lane], packet.rows[4][lane], packet.rows[8][lane]];
        Plane { normal, vertex }
    }

    /// The ray parameter of the intersection, rounded as in [`crate::simd::Wide::plane_parameters`]; infinite or NaN for parallel rays.
    #[inline(always)]
    pub fn parameter(&self, ray: &PreparedRay) -> f32 {
        let (n, a) = (self.normal, widen(self.vertex));
        let (o, d) = (widen(ray.origin), widen(ray.direction));
        let denominator = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
        let numerator = n[0] * (a[0] - o[0]) + n[1] * (a[1] - o[1]) + n[2] * (a[2] - o[2]);
        (numerator / denominator) as f32
    }
}

#[inline(always)]
fn widen([x, y, z]: [f32; 3]) -> [f64; 3] {
    [f64::from(x), f64::from(y), f64::from(z)]
}
