//! The primitives of a geometry that a BVH is built over, with their bounds; invalid and degenerate ones are dropped.

use super::input::Geometry;
use crate::math::{Bounds3, Vec3};
use crate::shape::{Analytic, CurveSegment, Quad, Shape, SplatCloud, triangle};
use crate::simd::prefer_huge_pages;
use rayon::prelude::*;

/// Numbers of dropped primitives, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Triangles, quads, analytic shapes, curve segments and splats with NaN, infinite or too large coordinates (beyond 1e18), or indices out of range.
    pub not_finite: u64,
    /// Triangles and quads without area, spheres, disks and curve segments without a radius, splats without opacity.
    pub degenerate: u64,
    /// Instances whose matrix is singular or not finite, or whose geometry does not exist.
    pub instances: u64,
}

impl Dropped {
    /// Were all kept?
    pub fn is_empty(&self) -> bool {
        *self == Dropped::default()
    }

    pub(super) fn add(&mut self, other: Dropped) {
        self.not_finite += other.not_finite;
        self.degenerate += other.degenerate;
        self.instances += other.instances;
    }
}

/// Largest coordinate of a primitive, metres: the areas of boxes, sums of products of two extents, must not overflow.
pub const REACH: f32 = 1e18;

/// Is a point usable as a vertex?
pub fn is_in_reach(p: Vec3) -> bool {
    // False for NaN.
    p.abs().max_element() <= REACH && p.is_finite()
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
    /// A subtree that is already written.
    Subtree,
    /// Dropped: no finite box.
    NotFinite,
    /// Dropped: no area.
    Degenerate,
}

/// One primitive: its kind, its id in the geometry (or the instance's index) and its box.
#[derive(Clone, Copy, Debug)]
pub struct Primitive {
    pub kind: PrimitiveKind,
    pub id: u32,
    pub bounds: Bounds3,
}

/// The vertices of a triangle; `None` where an index is out of range.
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
    if !vertices.into_iter().all(is_in_reach) {
        return Err(PrimitiveKind::NotFinite);
    }
    if !geometry.keys.is_empty() {
        return moving_bounds(geometry, index);
    }
    match triangle::is_collapsed(vertices) {
        true => Err(PrimitiveKind::Degenerate),
        false => Ok(triangle::bounds(vertices)),
    }
}

/// Around a triangle at all times: its vertices move along straight lines from key to key.
fn moving_bounds(geometry: &Geometry, index: usize) -> Result<Bounds3, PrimitiveKind> {
    let (mut bounds, mut is_degenerate) = (Bounds3::EMPTY, true);
    for positions in &geometry.keys {
        let vertices = vertices_of(positions, geometry.triangles[index]).ok_or(PrimitiveKind::NotFinite)?;
        if !vertices.into_iter().all(is_in_reach) {
            return Err(PrimitiveKind::NotFinite);
        }
        is_degenerate &= triangle::is_collapsed(vertices);
        bounds = bounds.union(triangle::bounds(vertices));
    }
    if is_degenerate { Err(PrimitiveKind::Degenerate) } else { Ok(widened(bounds)) }
}

/// Outwards by what the interpolation of a vertex may be rounded by.
fn widened(bounds: Bounds3) -> Bounds3 {
    let slack = bounds.min.abs().max(bounds.max.abs()) * (4.0 * f32::EPSILON);
    Bounds3 { min: bounds.min - slack, max: bounds.max + slack }
}

fn quad_bounds(quad: &Quad) -> Result<Bounds3, PrimitiveKind> {
    if !quad.corners().into_iter().all(is_in_reach) {
        return Err(PrimitiveKind::NotFinite);
    }
    if quad.is_collapsed() { Err(PrimitiveKind::Degenerate) } else { Ok(quad.bounds()) }
}

fn analytic_bounds(shape: &Analytic) -> Result<Bounds3, PrimitiveKind> {
    let (center, radius) = shape.center_and_radius();
    if !(is_in_reach(center) && radius.abs() <= REACH) {
        return Err(PrimitiveKind::NotFinite);
    }
    if radius <= 0.0 {
        return Err(PrimitiveKind::Degenerate);
    }
    Ok(rounded_outwards(shape.bounds()))
}

fn curve_bounds(segment: &CurveSegment) -> Result<Bounds3, PrimitiveKind> {
    let has_radii = segment.radii.iter().all(|r| (0.0..=REACH).contains(r));
    if !(segment.ends.into_iter().all(is_in_reach) && has_radii) {
        return Err(PrimitiveKind::NotFinite);
    }
    if segment.radii == [0.0; 2] {
        return Err(PrimitiveKind::Degenerate);
    }
    Ok(rounded_outwards(segment.bounds()))
}

fn splat_bounds(splats: &SplatCloud, index: usize) -> Result<Bounds3, PrimitiveKind> {
    let bounds = splats.bounds_of(index).ok_or(PrimitiveKind::Degenerate)?;
    if is_in_reach(bounds.min) && is_in_reach(bounds.max) {
        Ok(rounded_outwards(bounds))
    } else {
        Err(PrimitiveKind::NotFinite)
    }
}

/// Outwards by one step each, which covers the rounding of sums.
fn rounded_outwards(bounds: Bounds3) -> Bounds3 {
    let low = bounds.min.to_array().map(f32::next_down);
    let high = bounds.max.to_array().map(f32::next_up);
    Bounds3 { min: low.into(), max: high.into() }
}

/// All primitives of a geometry that a ray can hit, in the order of their ids.
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
