//! Input of an [`Accel`](super::Accel): geometries, instances, options, a memory estimate, and the conversion of geometries to
//! primitives with bounds. Invalid and degenerate primitives are dropped.

use super::layout::{ANALYTIC_LINES, CURVE_LANES, INSTANCE_LINES, MAX_LINE, SPLAT_LINES, TRIANGLE_LINES};
use crate::math::{Bounds3, DAffine3, TransformKeys, Vec3};
use crate::shape::triangle::LANES;
use crate::shape::{Analytic, CurveSegment, CurveSegments, Quad, Shape, SplatCloud, triangle};
use crate::simd::{Line, prefer_huge_pages};
use crate::work_counter::WorkCounter;
use rayon::prelude::*;
use std::fmt;
use std::fmt::{Display, Formatter};

/// Shapes in a common object space.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// Vertex positions, metres.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    pub quads: Vec<Quad>,
    /// Analytic shapes: spheres, disks and so on.
    pub analytic: Vec<Analytic>,
    pub curves: CurveSegments,
    /// Gaussian splats.
    pub splats: SplatCloud,
    /// Vertex positions at motion keys at equal intervals of the shutter; empty if static.
    pub keys: Vec<Vec<[f32; 3]>>,
}

impl Geometry {
    /// Number of primitives.
    pub fn primitives(&self) -> usize {
        self.triangles.len()
            + self.quads.len()
            + self.analytic.len()
            + self.curves.len()
            + self.splats.count()
    }
}

/// An instance that moves while the shutter is open.
#[derive(Clone, Debug)]
pub struct MovingInstance {
    /// Index of the instance.
    pub instance: usize,
    /// Object-to-world transforms at equal intervals of the shutter.
    pub keys: TransformKeys,
}

/// A geometry placed in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AccelInstance {
    /// Index of the geometry; not 0, whose shapes are in world space.
    pub geometry: u32,
    /// Object-to-world transform.
    pub world_from_object: DAffine3,
}

/// Quality of trees over many primitives. Both give the same hits bit for bit, since the nearest hit does not depend on the order of
/// visits. (Exception: rays through the border of a triangle that is edge-on, where the rounding error of `t` may exceed the
/// margin of the box test. None of eight million rays from cameras and surfaces differed; one of 40,000 aimed at vertices did.)
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TreeQuality {
    /// Fast to build, for few rays.
    Fast,
    /// Fewest traversal steps per ray.
    #[default]
    Full,
}

/// The input of a build.
#[derive(Clone, Copy, Debug)]
pub struct AccelInput<'a> {
    /// Shapes by geometry; the first is in world space.
    pub geometries: &'a [&'a Geometry],
    /// Instances: `Hit::instance` is the index plus 1.
    pub instances: &'a [AccelInstance],
    /// Index of the first moving instance. These are in a top-level BVH, which has the BVH of the world (geometry 0 and the static
    /// instances) as a child.
    pub first_moving: usize,
    /// Index of the first geometry that changes between rebuilds. Only moving instances use these; their trees follow the world's.
    pub first_changing: usize,
    /// Instances that move while the shutter is open; indices from `first_moving` on.
    pub moving: &'a [MovingInstance],
    pub quality: TreeQuality,
    /// Counts the progress of the build.
    pub counter: Option<&'a WorkCounter>,
}

impl AccelInput<'_> {
    /// For each geometry, whether it is the world's or an instance uses it: only these are built.
    pub fn used_geometries(&self) -> Vec<bool> {
        let mut used = vec![false; self.geometries.len()];
        let placed = self.instances.iter().map(|instance| instance.geometry as usize);
        for geometry in [0].into_iter().chain(placed) {
            if let Some(used) = used.get_mut(geometry) {
                *used = true;
            }
        }
        used
    }
}

/// Options of the builder.
#[derive(Clone, Copy)]
pub struct BuildOptions<'a> {
    pub quality: TreeQuality,
    /// Counts each primitive twice: when it is assigned to a chunk and when its tree is built.
    pub counter: Option<&'a WorkCounter>,
}

impl BuildOptions<'_> {
    /// Counts primitives as done.
    pub fn report(&self, primitives: usize) {
        if let Some(counter) = self.counter {
            counter.add(primitives as u64);
        }
    }
}

/// The trees that a rebuild keeps from the earlier structure, at the front of the buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reuse {
    Nothing,
    /// Trees of geometries 1 to `first_changing` - 1.
    Shared,
    /// Shared geometries and the world with the instances that do not move.
    World,
}

/// Numbers of primitives and the memory of their trees estimated from these numbers: an upper bound for nearly all scenes. Used to
/// reserve memory and to refuse scenes beyond the address range before building starts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Estimate {
    /// Triangles; a shared geometry counts once.
    pub triangles: u64,
    /// Quads, spheres, disks and the like.
    pub shapes: u64,
    /// Curve segments.
    pub curves: u64,
    /// Gaussian splats.
    pub splats: u64,
    pub instances: u64,
    /// Memory of the trees, bytes.
    pub bytes: u64,
}

const LINE: u64 = size_of::<Line>() as u64;

/// Estimated bytes per primitive where neighbours on a surface or strand share packets of `lines` cache lines with `per` lanes:
/// packets are two thirds full, and a node of eight children takes four lines.
const fn bytes_in_shared_packets(lines: u64, per: u64) -> u64 {
    lines * LINE * 3 / (2 * per) + LINE / 4
}

/// Estimated bytes of a scattered primitive, which has a packet of `lines` cache lines to itself. Nodes then have few children:
/// measured 1.4 lines of nodes per instance for 5,000 scattered instances.
const fn bytes_in_own_packet(lines: u64) -> u64 {
    lines * LINE + 3 * LINE / 2
}

impl Estimate {
    /// Maximum memory addressable by references, bytes.
    pub const LIMIT: u64 = MAX_LINE as u64 * LINE;

    /// Estimates a whole acceleration structure: the world and the instanced geometries.
    pub fn of(input: &AccelInput) -> Estimate {
        let mut estimate = Estimate::default();
        let used = input.used_geometries();
        for (geometry, _) in input.geometries.iter().zip(&used).filter(|(_, used)| **used) {
            estimate.add_geometry(geometry);
        }
        estimate.add_instances(input.instances.len());
        estimate
    }

    /// Adds the tree of a geometry.
    pub fn add_geometry(&mut self, geometry: &Geometry) {
        self.add_triangles(geometry.triangles.len(), geometry.keys.len());
        self.add_quads(geometry.quads.len());
        self.add_analytic(geometry.analytic.len());
        self.add_curves(geometry.curves.len());
        self.add_splats(geometry.splats.count());
        // At least one node.
        self.bytes += 8 * LINE;
    }

    /// Adds triangles with `keys` motion keys; 0: static.
    pub fn add_triangles(&mut self, count: usize, keys: usize) {
        let lines = TRIANGLE_LINES as u64;
        let lines = if keys == 0 { lines } else { ANALYTIC_LINES as u64 + keys as u64 * lines };
        self.triangles += count as u64;
        self.add(count, bytes_in_shared_packets(lines, LANES as u64));
    }

    /// Adds quads; each is stored as two triangles of a packet.
    pub fn add_quads(&mut self, count: usize) {
        self.shapes += count as u64;
        self.add(count, bytes_in_own_packet(TRIANGLE_LINES as u64));
    }

    /// Adds analytic shapes.
    pub fn add_analytic(&mut self, count: usize) {
        self.shapes += count as u64;
        self.add(count, bytes_in_own_packet(ANALYTIC_LINES as u64));
    }

    /// Adds curve segments: neighbours on a strand share packets, while scattered strands have nodes with few children (measured: 145
    /// bytes per segment for 400 strands of 19 segments).
    pub fn add_curves(&mut self, count: usize) {
        self.curves += count as u64;
        self.add(count, bytes_in_shared_packets(ANALYTIC_LINES as u64, CURVE_LANES as u64) + LINE / 2);
    }

    /// Adds Gaussian splats.
    pub fn add_splats(&mut self, count: usize) {
        self.splats += count as u64;
        self.add(count, bytes_in_shared_packets(SPLAT_LINES as u64, LANES as u64) + LINE / 2);
    }

    pub fn add_instances(&mut self, count: usize) {
        self.instances += count as u64;
        self.add(count, bytes_in_own_packet(INSTANCE_LINES as u64));
    }

    fn add(&mut self, count: usize, bytes: u64) {
        self.bytes = self.bytes.saturating_add((count as u64).saturating_mul(bytes));
    }

    /// Cache lines of the trees.
    pub(super) fn lines(&self) -> usize {
        self.bytes.div_ceil(LINE) as usize
    }

    /// Fails if the trees exceed [`Estimate::LIMIT`].
    pub fn check(self) -> Result<(), TooLarge> {
        if self.bytes > Estimate::LIMIT { Err(TooLarge(self)) } else { Ok(()) }
    }
}

/// Error: the structure exceeds the addressable memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLarge(pub Estimate);

impl Display for TooLarge {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Estimate { triangles, shapes, curves, splats, instances, bytes } = self.0;
        let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
        let numbers = [
            (triangles, "triangles"),
            (shapes, "quads and analytic shapes"),
            (curves, "curve segments"),
            (splats, "Gaussian splats"),
            (instances, "instances"),
        ];
        let numbers = numbers.iter().filter(|(count, _)| *count > 0);
        let numbers: Vec<String> = numbers.map(|(count, what)| format!("{count} {what}")).collect();
        let limit = gib(Estimate::LIMIT);
        // If the estimate is below the limit, the build has run out of addresses, since packets were emptier than estimated.
        let size = if bytes > Estimate::LIMIT { gib(bytes) } else { limit };
        let about = if bytes > Estimate::LIMIT { "about" } else { "more than" };
        write!(
            f,
            "{} take {about} {size:.1} GiB of acceleration structure, of which {limit:.0} GiB can be addressed; use \
             instances of shared meshes instead of copies, or render parts of the scene separately",
            numbers.join(", ")
        )
    }
}

impl std::error::Error for TooLarge {}

/// Numbers of dropped primitives, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Primitives with NaN, infinite or too large coordinates (beyond `MAX_COORDINATE`) or vertex indices out of range.
    pub not_finite: u64,
    /// Triangles and quads of zero area, analytic shapes and curve segments of zero radius, splats of zero opacity.
    pub degenerate: u64,
    /// Instances with a singular or non-finite matrix or a geometry index out of range.
    pub instances: u64,
}

impl Dropped {
    /// Whether nothing was dropped.
    pub fn is_empty(&self) -> bool {
        *self == Dropped::default()
    }

    pub(super) fn add(&mut self, other: Dropped) {
        self.not_finite += other.not_finite;
        self.degenerate += other.degenerate;
        self.instances += other.instances;
    }
}

/// Largest absolute coordinate of a primitive, metres: box areas must not overflow single precision.
pub const MAX_COORDINATE: f32 = 1e18;

/// Whether a point is finite and within `MAX_COORDINATE`.
pub fn is_valid_position(p: Vec3) -> bool {
    // NaN compares false.
    p.abs().max_element() <= MAX_COORDINATE && p.is_finite()
}

/// Kind of a primitive of the builder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PrimitiveKind {
    Triangle,
    Quad,
    Analytic,
    Curve,
    Splat,
    Instance,
    /// A finished subtree of a chunk.
    Subtree,
    /// Dropped: no finite box.
    NotFinite,
    /// Dropped: zero area, radius or opacity.
    Degenerate,
}

/// A primitive: kind, id within its geometry (or the instance's index) and bounding box.
#[derive(Clone, Copy, Debug)]
pub struct Primitive {
    pub kind: PrimitiveKind,
    pub id: u32,
    pub bounds: Bounds3,
}

/// The vertices of a triangle; `None` if an index is out of range.
pub fn triangle_vertices(geometry: &Geometry, index: usize) -> Option<[Vec3; 3]> {
    vertices_of(&geometry.positions, *geometry.triangles.get(index)?)
}

/// The vertices of a triangle from a list of positions.
pub fn vertices_of(positions: &[[f32; 3]], [a, b, c]: [u32; 3]) -> Option<[Vec3; 3]> {
    let at = |i: u32| positions.get(i as usize).copied().map(Vec3::from);
    Some([at(a)?, at(b)?, at(c)?])
}

fn triangle_bounds(geometry: &Geometry, index: usize) -> Result<Bounds3, PrimitiveKind> {
    let vertices = triangle_vertices(geometry, index).ok_or(PrimitiveKind::NotFinite)?;
    if !vertices.into_iter().all(is_valid_position) {
        return Err(PrimitiveKind::NotFinite);
    }
    if !geometry.keys.is_empty() {
        return moving_bounds(geometry, index);
    }
    match triangle::is_degenerate(vertices) {
        true => Err(PrimitiveKind::Degenerate),
        false => Ok(Bounds3::of(vertices)),
    }
}

/// The bounds of a triangle over the whole shutter interval: vertices are interpolated linearly between keys.
fn moving_bounds(geometry: &Geometry, index: usize) -> Result<Bounds3, PrimitiveKind> {
    let (mut bounds, mut is_degenerate) = (Bounds3::EMPTY, true);
    for positions in &geometry.keys {
        let vertices = vertices_of(positions, geometry.triangles[index]).ok_or(PrimitiveKind::NotFinite)?;
        if !vertices.into_iter().all(is_valid_position) {
            return Err(PrimitiveKind::NotFinite);
        }
        is_degenerate &= triangle::is_degenerate(vertices);
        bounds = bounds.union(Bounds3::of(vertices));
    }
    if is_degenerate { Err(PrimitiveKind::Degenerate) } else { Ok(widened(bounds)) }
}

/// Expands a box by the rounding error of interpolated vertices.
fn widened(bounds: Bounds3) -> Bounds3 {
    let slack = bounds.min.abs().max(bounds.max.abs()) * (4.0 * f32::EPSILON);
    Bounds3 { min: bounds.min - slack, max: bounds.max + slack }
}

fn quad_bounds(quad: &Quad) -> Result<Bounds3, PrimitiveKind> {
    if !quad.corners().into_iter().all(is_valid_position) {
        return Err(PrimitiveKind::NotFinite);
    }
    if quad.is_degenerate() { Err(PrimitiveKind::Degenerate) } else { Ok(quad.bounds()) }
}

fn analytic_bounds(shape: &Analytic) -> Result<Bounds3, PrimitiveKind> {
    let (center, radius) = shape.center_and_radius();
    if !(is_valid_position(center) && radius.abs() <= MAX_COORDINATE) {
        return Err(PrimitiveKind::NotFinite);
    }
    if radius <= 0.0 {
        return Err(PrimitiveKind::Degenerate);
    }
    Ok(rounded_outwards(shape.bounds()))
}

fn curve_bounds(segment: &CurveSegment) -> Result<Bounds3, PrimitiveKind> {
    let has_radii = segment.radii.iter().all(|r| (0.0..=MAX_COORDINATE).contains(r));
    if !(segment.ends.into_iter().all(is_valid_position) && has_radii) {
        return Err(PrimitiveKind::NotFinite);
    }
    if segment.radii == [0.0; 2] {
        return Err(PrimitiveKind::Degenerate);
    }
    Ok(rounded_outwards(segment.bounds()))
}

fn splat_bounds(splats: &SplatCloud, index: usize) -> Result<Bounds3, PrimitiveKind> {
    let bounds = splats.bounds_of(index).ok_or(PrimitiveKind::Degenerate)?;
    if is_valid_position(bounds.min) && is_valid_position(bounds.max) {
        Ok(rounded_outwards(bounds))
    } else {
        Err(PrimitiveKind::NotFinite)
    }
}

/// Expands a box by one ulp, which covers the rounding of its sums.
fn rounded_outwards(bounds: Bounds3) -> Bounds3 {
    let low = bounds.min.to_array().map(f32::next_down);
    let high = bounds.max.to_array().map(f32::next_up);
    Bounds3 { min: low.into(), max: high.into() }
}

/// The valid primitives of a geometry in the order of their ids, and the numbers of dropped ones.
pub fn collect_primitives(geometry: &Geometry) -> (Vec<Primitive>, Dropped) {
    let (triangles, quads) = (geometry.triangles.len(), geometry.quads.len());
    let analytic = geometry.analytic.len();
    let curves = geometry.curves.len();
    let total = geometry.primitives();
    let one = |id: usize| {
        let (kind, bounds) = if id < triangles {
            (PrimitiveKind::Triangle, triangle_bounds(geometry, id))
        } else if id < triangles + quads {
            (PrimitiveKind::Quad, quad_bounds(&geometry.quads[id - triangles]))
        } else if id < triangles + quads + analytic {
            (PrimitiveKind::Analytic, analytic_bounds(&geometry.analytic[id - triangles - quads]))
        } else if id < triangles + quads + analytic + curves {
            (PrimitiveKind::Curve, curve_bounds(&geometry.curves.get(id - triangles - quads - analytic)))
        } else {
            let index = id - triangles - quads - analytic - curves;
            (PrimitiveKind::Splat, splat_bounds(&geometry.splats, index))
        };
        let id = id as u32;
        bounds.map_or_else(
            |reason| Primitive { kind: reason, id, bounds: Bounds3::EMPTY },
            |bounds| Primitive { kind, id, bounds },
        )
    };
    let mut all: Vec<Primitive> = Vec::new();
    all.reserve_exact(total);
    prefer_huge_pages(&mut all);
    all.par_extend((0..total).into_par_iter().with_min_len(4096).map(one));
    let count =
        |kind: PrimitiveKind| all.par_iter().with_min_len(4096).filter(|p| p.kind == kind).count() as u64;
    let (not_finite, degenerate) = (count(PrimitiveKind::NotFinite), count(PrimitiveKind::Degenerate));
    if not_finite + degenerate > 0 {
        all.retain(|p| !matches!(p.kind, PrimitiveKind::NotFinite | PrimitiveKind::Degenerate));
    }
    (all, Dropped { not_finite, degenerate, instances: 0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exceeding_the_addressable_memory_is_an_error_with_counts() {
        let mut estimate = Estimate::default();
        estimate.add_triangles(380_000_000, 0);
        assert_eq!(estimate.check(), Ok(()));
        // Four motion keys take four times the memory.
        let mut moving = Estimate::default();
        moving.add_triangles(380_000_000, 4);
        let message = moving.check().expect_err("too large").to_string();
        assert!(message.starts_with("380000000 triangles take about 124.6 GiB of acc"), "{message}");
        assert!(message.contains("32 GiB can be addressed"), "{message}");
        estimate.add_curves(100_000_000);
        estimate.add_instances(5);
        let message = estimate.check().expect_err("too large").to_string();
        assert!(message.contains("380000000 triangles, 100000000 curve segments, 5 instances"), "{message}");
        assert!(TooLarge(Estimate::default()).to_string().contains("more than 32.0 GiB"));
    }
}
