//! From geometry to the primitives that a BVH is built over: bounds, and the dropping of what no ray can hit.

use super::input::Geometry;
use crate::math::{Bounds3, Vec3};
use crate::shape::{Analytic, Quad, Shape, triangle};
use rayon::prelude::*;

/// Primitives that were left out, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Triangles, quads and analytic shapes with NaN, infinite or too large coordinates (beyond 1e18), or indices out of range.
    pub not_finite: u64,
    /// Triangles and quads without area, spheres and disks without a radius.
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

/// Can a point be a corner?
pub fn is_in_reach(p: Vec3) -> bool {
    // False for NaN.
    p.abs().max_element() <= REACH && p.is_finite()
}

/// What a primitive is for the builder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Triangle,
    Quad,
    Analytic,
    Instance,
}

/// One primitive: its kind, its id in the geometry (or the instance's index) and its box.
#[derive(Clone, Copy, Debug)]
pub struct Primitive {
    pub kind: Kind,
    pub id: u32,
    pub bounds: Bounds3,
}

/// Why a primitive is not kept.
enum Reason {
    NotFinite,
    Degenerate,
}

/// The vertices of a triangle; `None` where an index is out of range.
pub fn triangle_vertices(geometry: &Geometry, index: usize) -> Option<[Vec3; 3]> {
    let [a, b, c] = *geometry.triangles.get(index)?;
    let at = |i: u32| geometry.positions.get(i as usize).copied().map(Vec3::from);
    Some([at(a)?, at(b)?, at(c)?])
}

fn triangle_bounds(geometry: &Geometry, index: usize) -> Result<Bounds3, Reason> {
    let vertices = triangle_vertices(geometry, index).ok_or(Reason::NotFinite)?;
    if !vertices.into_iter().all(is_in_reach) {
        return Err(Reason::NotFinite);
    }
    match triangle::is_collapsed(vertices) {
        true => Err(Reason::Degenerate),
        false => Ok(triangle::bounds(vertices)),
    }
}

fn quad_bounds(quad: &Quad) -> Result<Bounds3, Reason> {
    if !quad.corners().into_iter().all(is_in_reach) {
        return Err(Reason::NotFinite);
    }
    if quad.is_collapsed() { Err(Reason::Degenerate) } else { Ok(quad.bounds()) }
}

fn analytic_bounds(shape: &Analytic) -> Result<Bounds3, Reason> {
    let (center, radius) = shape.center_and_radius();
    if !(is_in_reach(center) && radius.abs() <= REACH) {
        return Err(Reason::NotFinite);
    }
    if radius <= 0.0 {
        return Err(Reason::Degenerate);
    }
    // Outwards by one step each, which covers the rounding of the sums.
    let bounds = shape.bounds();
    let low = bounds.min.to_array().map(f32::next_down);
    let high = bounds.max.to_array().map(f32::next_up);
    Ok(Bounds3 { min: low.into(), max: high.into() })
}

/// All primitives of a geometry that a ray can hit, in the order of their ids.
pub fn gather(geometry: &Geometry) -> (Vec<Primitive>, Dropped) {
    let (triangles, quads) = (geometry.triangles.len(), geometry.quads.len());
    let total = triangles + quads + geometry.analytic.len();
    let one = |id: usize| {
        let (kind, bounds) = if id < triangles {
            (Kind::Triangle, triangle_bounds(geometry, id))
        } else if id < triangles + quads {
            (Kind::Quad, quad_bounds(&geometry.quads[id - triangles]))
        } else {
            (Kind::Analytic, analytic_bounds(&geometry.analytic[id - triangles - quads]))
        };
        bounds.map(|bounds| Primitive { kind, id: id as u32, bounds })
    };
    let mut dropped = Dropped::default();
    let all: Vec<Result<Primitive, Reason>> =
        (0..total).into_par_iter().with_min_len(4096).map(one).collect();
    let mut kept = Vec::with_capacity(total);
    for primitive in all {
        match primitive {
            Ok(primitive) => kept.push(primitive),
            Err(Reason::NotFinite) => dropped.not_finite += 1,
            Err(Reason::Degenerate) => dropped.degenerate += 1,
        }
    }
    (kept, dropped)
}
