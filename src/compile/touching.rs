//! Whether the surfaces of some solids lie on those of others: only then is it looked for where paths meet them.

use super::geometry::Geometries;
use super::material::CompiledMaterial;
use super::plan::part_materials;
use crate::accel::Accel;
use crate::math::{DAffine3, DVec3, Hit, Ray, gamma};
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
    geometries: &Geometries,
    accel: &Accel,
    anchor: DVec3,
) -> bool {
    let solids = solids(scene, materials);
    let rounding = |s: &Solid| s.bounds[0].abs().max(s.bounds[1].abs()).max_element() * f64::from(gamma(64));
    let near = |a: &Solid, b: &Solid| {
        let reach = rounding(a).max(rounding(b));
        (a.bounds[0] - reach).cmple(b.bounds[1]).all() && (b.bounds[0] - reach).cmple(a.bounds[1]).all()
    };
    let medium = |hit: &Hit| materials[geometries.material(hit) as usize].medium_index;
    let is_solid = |hit: &Hit| {
        let material = &materials[geometries.material(hit) as usize];
        material.medium_index != 0 && !material.is_boundary
    };
    let is_touched = |(middle, normal): (DVec3, DVec3)| {
        let reach =
            (middle.abs().max_element() + (middle - anchor).abs().max_element()) * f64::from(gamma(32));
        let origin = (middle - anchor + normal * reach).as_vec3();
        let ray = Ray::segment(origin, (normal * (-2.0 * reach)).as_vec3());
        let first = accel.closest_one(&ray);
        if !first.is_hit() {
            return false;
        }
        let second = accel.closest_one(&Ray { origin_primitive: (&first).into(), ..ray });
        second.is_hit()
            && [&first, &second].into_iter().all(is_solid)
            && (geometries.object(&first) != geometries.object(&second) || medium(&first) != medium(&second))
    };
    let is_moving = accel.is_moving();
    solids.iter().enumerate().any(|(i, a)| {
        let others =
            solids.iter().enumerate().filter(|&(k, b)| if k == i { a.has_several } else { near(a, b) });
        let others: Vec<&Solid> = others.map(|(_, b)| b).collect();
        let is_in_other = |p: DVec3| {
            others.iter().any(|b| {
                let reach = rounding(a).max(rounding(b));
                (b.bounds[0] - reach).cmple(p).all() && p.cmple(b.bounds[1] + reach).all()
            })
        };
        match &a.pieces {
            _ if others.is_empty() => false,
            _ if is_moving => true,
            Pieces::Mesh { mesh, placed } => {
                let mesh = &scene.meshes[*mesh];
                let corner =
                    |i: u32| placed.transform_point3(mesh.positions[i as usize].map(f64::from).into());
                mesh.triangles.par_iter().any(|&t| {
                    let [a, b, c] = t.map(corner);
                    let middle = (a + b + c) / 3.0;
                    let normal = (b - a).cross(c - a).normalize_or_zero();
                    is_in_other(middle) && normal != DVec3::ZERO && is_touched((middle, normal))
                })
            }
            Pieces::Quad([middle, u, v]) => {
                let normal = u.cross(*v).normalize_or_zero();
                normal != DVec3::ZERO && is_touched((*middle, normal))
            }
            Pieces::Shape(middle, size) => others.iter().any(|b| match b.pieces {
                Pieces::Shape(other, other_size) => {
                    other.distance(*middle) <= rounding(a) && (other_size - size).abs() <= rounding(a)
                }
                _ => false,
            }),
        }
    })
}

fn solids(scene: &Scene, materials: &[CompiledMaterial]) -> Vec<Solid> {
    let is_solid = |id: MaterialId| {
        let material = &materials[id.index()];
        material.medium_index != 0 && !material.is_boundary
    };
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
