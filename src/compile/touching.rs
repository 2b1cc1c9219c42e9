//! Whether the surfaces of some solids lie on those of others: only then is it looked for where paths meet them.

use super::geometry::Geometries;
use super::material::CompiledMaterial;
use super::plan::part_materials;
use crate::accel::Accel;
use crate::math::{DAffine3, DVec3, Ray, gamma};
use crate::scene::{MaterialId, Scene};
use rayon::prelude::*;

/// A body that light passes.
struct Solid {
    /// Corners of the box around it, in the world.
    bounds: [DVec3; 2],
    /// It has several materials that light passes.
    has_several: bool,
    /// Flat pieces of its surface: a point inside of each and its normal.
    pieces: Pieces,
}

enum Pieces {
    Mesh {
        mesh: usize,
        placed: DAffine3,
    },
    Quad([DVec3; 3]),
    /// A shape of the middle and this size.
    Shape(DVec3, f64),
}

/// Do some? Asked at the middle of each triangle that lies in the box around another solid. Where things move, solids whose boxes
/// meet are taken to touch.
pub(super) fn exists(
    scene: &Scene,
    materials: &[CompiledMaterial],
    (geometries, accel, anchor): (&Geometries, &Accel, DVec3),
) -> bool {
    let mut solids = solids(scene, materials);
    // By where they begin along x: those that can meet one are next to each other.
    solids.sort_by(|a, b| a.bounds[0].x.total_cmp(&b.bounds[0].x));
    let widest = solids.iter().map(|s| s.bounds[1].x - s.bounds[0].x).fold(0.0, f64::max);
    let reach = solids.iter().map(Solid::rounding).fold(0.0, f64::max);
    let at = Places { materials, geometries, accel, anchor };
    solids.iter().enumerate().any(|(i, solid)| {
        let [low, high] = solid.bounds.map(|corner| corner.x);
        let first = solids.partition_point(|s| s.bounds[0].x < low - widest - 2.0 * reach);
        let last = solids.partition_point(|s| s.bounds[0].x <= high + 2.0 * reach);
        let others =
            (first..last).filter(|&k| if k == i { solid.has_several } else { solid.meets(&solids[k]) });
        let others: Vec<&Solid> = others.map(|k| &solids[k]).collect();
        !others.is_empty() && (accel.is_moving() || solid.is_touched(&others, scene, &at))
    })
}

/// Where surfaces are looked for.
struct Places<'a> {
    materials: &'a [CompiledMaterial],
    geometries: &'a Geometries,
    accel: &'a Accel,
    anchor: DVec3,
}

impl Places<'_> {
    /// Do the surfaces of two solids lie at a point with this normal?
    fn are_two_at(&self, p: DVec3, normal: DVec3) -> bool {
        let reach = (p.abs().max_element() + (p - self.anchor).abs().max_element()) * f64::from(gamma(32));
        let origin = (p - self.anchor + normal * reach).as_vec3();
        let ray = Ray::segment(origin, (normal * (-2.0 * reach)).as_vec3());
        let first = self.accel.closest_one(&ray);
        if normal == DVec3::ZERO || !first.is_hit() {
            return false;
        }
        let second = self.accel.closest_one(&Ray { origin_primitive: (&first).into(), ..ray });
        if !second.is_hit() {
            return false;
        }
        let [a, b] = [&first, &second].map(|hit| &self.materials[self.geometries.material(hit) as usize]);
        let is_another = a.medium_index != b.medium_index
            || self.geometries.object(&first) != self.geometries.object(&second);
        is_another && is_solid(a) && is_solid(b)
    }
}

fn is_solid(material: &CompiledMaterial) -> bool {
    material.medium_index != 0 && !material.is_boundary
}

impl Solid {
    /// What coordinates may be off by.
    fn rounding(&self) -> f64 {
        self.bounds[0].abs().max(self.bounds[1].abs()).max_element() * f64::from(gamma(64))
    }

    /// Do the boxes around two meet?
    fn meets(&self, other: &Solid) -> bool {
        let reach = self.rounding().max(other.rounding());
        let ([low, high], [other_low, other_high]) = (self.bounds, other.bounds);
        (low - reach).cmple(other_high).all() && (other_low - reach).cmple(high).all()
    }

    /// Does a point lie in the box around it?
    fn is_around(&self, p: DVec3, reach: f64) -> bool {
        (self.bounds[0] - reach).cmple(p).all() && p.cmple(self.bounds[1] + reach).all()
    }

    /// Does one of the others lie on its surface?
    fn is_touched(&self, others: &[&Solid], scene: &Scene, at: &Places) -> bool {
        let is_near = |p: DVec3| others.iter().any(|b| b.is_around(p, self.rounding().max(b.rounding())));
        match self.pieces {
            Pieces::Mesh { mesh, placed } => {
                let mesh = &scene.meshes[mesh];
                let corner =
                    |i: u32| placed.transform_point3(mesh.positions[i as usize].map(f64::from).into());
                mesh.triangles.par_iter().any(|&t| {
                    let [a, b, c] = t.map(corner);
                    let middle = (a + b + c) / 3.0;
                    is_near(middle) && at.are_two_at(middle, (b - a).cross(c - a).normalize_or_zero())
                })
            }
            Pieces::Quad([middle, u, v]) => at.are_two_at(middle, u.cross(v).normalize_or_zero()),
            Pieces::Shape(middle, size) => others.iter().any(|other| match other.pieces {
                Pieces::Shape(center, radius) => {
                    center.distance(middle) <= self.rounding() && (radius - size).abs() <= self.rounding()
                }
                _ => false,
            }),
        }
    }
}

fn solids(scene: &Scene, materials: &[CompiledMaterial]) -> Vec<Solid> {
    let is_solid = |id: MaterialId| is_solid(&materials[id.index()]);
    let meshes = scene.instances.iter().filter_map(|instance| {
        let mesh = &scene.meshes[instance.mesh.index()];
        let placed = instance.world_from_object;
        let is_of_one = part_materials(mesh, instance).any(is_solid) && !mesh.positions.is_empty();
        is_of_one.then(|| {
            let points = mesh.positions.iter().map(|&p| placed.transform_point3(p.map(f64::from).into()));
            let bounds = points
                .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)]);
            let mut ids: Vec<MaterialId> =
                part_materials(mesh, instance).filter(|&id| is_solid(id)).collect();
            ids.sort_unstable();
            ids.dedup();
            let pieces = Pieces::Mesh { mesh: instance.mesh.index(), placed };
            Solid { bounds, has_several: ids.len() > 1, pieces }
        })
    });
    let quads = scene.quads.iter().filter(|quad| is_solid(quad.material)).map(|quad| {
        let (low, high) = (
            quad.edge_u.min(DVec3::ZERO) + quad.edge_v.min(DVec3::ZERO),
            quad.edge_u.max(DVec3::ZERO) + quad.edge_v.max(DVec3::ZERO),
        );
        let middle = quad.corner + 0.5 * quad.edge_u + 0.5 * quad.edge_v;
        let bounds = [quad.corner + low, quad.corner + high];
        Solid { bounds, has_several: false, pieces: Pieces::Quad([middle, quad.edge_u, quad.edge_v]) }
    });
    let shapes = scene.shapes.iter().filter(|shape| is_solid(shape.material)).map(|shape| {
        let half = DVec3::splat(shape.radius);
        Solid {
            bounds: [shape.center - half, shape.center + half],
            has_several: false,
            pieces: Pieces::Shape(shape.center, shape.radius),
        }
    });
    meshes.chain(quads).chain(shapes).collect()
}
