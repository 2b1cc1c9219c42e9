//! Whether the surfaces of some solids lie on those of others: only then is it looked for where paths meet them.

use super::geometry::Geometries;
use super::material::CompiledMaterial;
use super::overlaps::{self, Piece};
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
    surface: Surface,
}

enum Surface {
    Mesh {
        mesh: usize,
        placed: DAffine3,
    },
    /// A corner and the edges that leave it.
    Quad([DVec3; 3]),
    /// A shape of the middle and this size.
    Shape(DVec3, f64),
}

/// Do some? Asked where triangles of two lie on each other, and at the middle of each triangle that lies in the box around a shape
/// without triangles. Where things move, solids whose boxes meet are taken to touch.
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
    let others = |i: usize| {
        let [low, high] = solids[i].bounds.map(|corner| corner.x);
        let first = solids.partition_point(|s| s.bounds[0].x < low - widest - 2.0 * reach);
        let last = solids.partition_point(|s| s.bounds[0].x <= high + 2.0 * reach);
        let is_other = |&k: &usize| if k == i { solids[i].has_several } else { solids[i].meets(&solids[k]) };
        (first..last).filter(is_other).map(|k| &solids[k]).collect::<Vec<&Solid>>()
    };
    let at = Places { materials, geometries, accel, anchor };
    let mut pieces = Vec::new();
    for (i, solid) in solids.iter().enumerate() {
        let others = others(i);
        if others.is_empty() {
            continue;
        }
        let own = solid.pieces(i as u32, &others, scene);
        if accel.is_moving() || solid.is_touched(&own, &others, &at) {
            return true;
        }
        pieces.extend(own);
    }
    let may_touch = |a: u32, b: u32| a != b || solids[a as usize].has_several;
    overlaps::any(pieces, may_touch, |point, normal| at.are_two_at(point, normal))
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

    /// The triangles of its surface that reach into the boxes around others, as those of solid `number`.
    fn pieces(&self, number: u32, others: &[&Solid], scene: &Scene) -> Vec<Piece> {
        let rounding = self.rounding();
        let is_near = |[a, b, c]: [DVec3; 3]| {
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            others.iter().any(|other| {
                let reach = rounding.max(other.rounding());
                (low - reach).cmple(other.bounds[1]).all() && (other.bounds[0] - reach).cmple(high).all()
            })
        };
        let near =
            |corners: [DVec3; 3]| is_near(corners).then_some(Piece { corners, solid: number, rounding });
        match self.surface {
            Surface::Mesh { mesh, placed } => {
                let mesh = &scene.meshes[mesh];
                let corner =
                    |i: u32| placed.transform_point3(mesh.positions[i as usize].map(f64::from).into());
                mesh.triangles.par_iter().filter_map(|&t| near(t.map(corner))).collect()
            }
            Surface::Quad([a, u, v]) => {
                [[a, a + u, a + u + v], [a, a + u + v, a + v]].into_iter().filter_map(near).collect()
            }
            Surface::Shape(..) => Vec::new(),
        }
    }

    /// Does a shape without triangles lie on its surface?
    fn is_touched(&self, pieces: &[Piece], others: &[&Solid], at: &Places) -> bool {
        let shapes = others.iter().filter_map(|other| match other.surface {
            Surface::Shape(center, radius) => Some((center, radius, other)),
            _ => None,
        });
        let shapes: Vec<(DVec3, f64, &&Solid)> = shapes.collect();
        if let Surface::Shape(middle, size) = self.surface {
            let is_same = |&(center, radius, _): &(DVec3, f64, &&Solid)| {
                center.distance(middle) <= self.rounding() && (radius - size).abs() <= self.rounding()
            };
            return shapes.iter().any(is_same);
        }
        let is_around = |p: DVec3, other: &Solid| {
            let reach = self.rounding().max(other.rounding());
            (other.bounds[0] - reach).cmple(p).all() && p.cmple(other.bounds[1] + reach).all()
        };
        !shapes.is_empty()
            && pieces.par_iter().any(|piece| {
                let [a, b, c] = piece.corners;
                let middle = (a + b + c) / 3.0;
                let normal = (b - a).cross(c - a).normalize_or_zero();
                shapes.iter().any(|&(.., other)| is_around(middle, other)) && at.are_two_at(middle, normal)
            })
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
            let surface = Surface::Mesh { mesh: instance.mesh.index(), placed };
            Solid { bounds, has_several: ids.len() > 1, surface }
        })
    });
    let quads = scene.quads.iter().filter(|quad| is_solid(quad.material)).map(|quad| {
        let (low, high) = (
            quad.edge_u.min(DVec3::ZERO) + quad.edge_v.min(DVec3::ZERO),
            quad.edge_u.max(DVec3::ZERO) + quad.edge_v.max(DVec3::ZERO),
        );
        let bounds = [quad.corner + low, quad.corner + high];
        Solid { bounds, has_several: false, surface: Surface::Quad([quad.corner, quad.edge_u, quad.edge_v]) }
    });
    let shapes = scene.shapes.iter().filter(|shape| is_solid(shape.material)).map(|shape| {
        let half = DVec3::splat(shape.radius);
        Solid {
            bounds: [shape.center - half, shape.center + half],
            has_several: false,
            surface: Surface::Shape(shape.center, shape.radius),
        }
    });
    meshes.chain(quads).chain(shapes).collect()
}
