//! Flat lights in the plane of other surfaces, as of a ceiling: rays would hit either of them by rounding, or always the other one, so that
//! the light would not be seen. They are moved to their front by a little more than rounding.

use super::objects::part_materials;
use crate::error::{Warning, listed};
use crate::math::DVec3;
use crate::scene::{MaterialId, Model, Quad, Scene, ShapeKind, instance_extents};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Maximum number of flat lights for which other surfaces are searched.
const MAX_LIGHTS: usize = 256;

/// Distance from a plane within which points are in it, relative to coordinates around the camera.
const FLUSH: f64 = 4e-7;

/// How far lights are moved, relative to the same.
const STEP: f64 = 4e-6;

/// Shifts of quads and shapes, by index in the scene.
#[derive(Clone, Debug, Default)]
pub(super) struct Shifts {
    pub quads: BTreeMap<usize, DVec3>,
    pub shapes: BTreeMap<usize, DVec3>,
}

/// A flat light as a parallelogram around it.
struct FlatLight<'a> {
    index: usize,
    is_quad: bool,
    name: &'a str,
    corner: DVec3,
    edges: [DVec3; 2],
    normal: DVec3,
    /// Largest coordinate around the camera.
    reach: f64,
}

impl FlatLight<'_> {
    /// Does a polygon lie in its plane and, by its box along the edges, over the light?
    fn is_covered_by(&self, corners: &[DVec3]) -> bool {
        let far = corners.iter().map(|p| (*p - self.corner).dot(self.normal).abs()).fold(0.0, f64::max);
        if far > FLUSH * self.reach {
            return false;
        }
        self.edges.iter().all(|edge| {
            let along = corners.iter().map(|p| (*p - self.corner).dot(*edge) / edge.length_squared());
            let (low, high) =
                along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| (l.min(t), h.max(t)));
            low < 1.0 - 1e-6 && high > 1e-6
        })
    }

    fn corners(&self) -> [DVec3; 4] {
        let [u, v] = self.edges;
        [self.corner, self.corner + u, self.corner + v, self.corner + u + v]
    }
}

/// Finds the flat lights of a scene that lie in the plane of other surfaces; `origin` becomes that of the compiled scene.
pub(super) fn find(scene: &Scene, origin: DVec3, notes: &mut Vec<Warning>) -> Shifts {
    let lights = flat_lights(scene, origin);
    if lights.is_empty() || lights.len() > MAX_LIGHTS {
        return Shifts::default();
    }
    let mut is_flush: Vec<bool> = lights.iter().map(|light| is_on_quad(light, scene)).collect();
    mark_on_meshes(scene, &lights, &mut is_flush);
    let mut shifts = Shifts::default();
    let found = || lights.iter().zip(&is_flush).filter(|(_, flush)| **flush).map(|(light, _)| light);
    for light in found() {
        let list = if light.is_quad { &mut shifts.quads } else { &mut shifts.shapes };
        list.insert(light.index, light.normal * (STEP * light.reach));
    }
    let names: Vec<&str> = found().map(|light| light.name).collect();
    if !names.is_empty() {
        notes.push(Warning::general(format!(
            "lights in the plane of other surfaces are taken as a little before them: {}",
            listed(&names)
        )));
    }
    shifts
}

fn flat_lights(scene: &Scene, origin: DVec3) -> Vec<FlatLight<'_>> {
    let shines = |id: MaterialId| scene.materials.get(id.index()).is_some_and(|m| m.emission.is_some());
    let new = |index: usize, is_quad, name, corner: DVec3, edges: [DVec3; 2]| {
        let normal = edges[0].cross(edges[1]).try_normalize()?;
        let far = |p: DVec3| (p - origin).abs().max_element();
        let mut light = FlatLight { index, is_quad, name, corner, edges, normal, reach: 0.0 };
        light.reach = light.corners().map(far).into_iter().fold(0.0, f64::max);
        Some(light)
    };
    let quads = scene.quads.iter().enumerate().filter(|(_, quad)| shines(quad.material));
    let quads = quads.filter_map(|(i, q)| new(i, true, q.name.as_str(), q.corner, [q.edge_u, q.edge_v]));
    let disks = scene.shapes.iter().enumerate();
    let disks = disks.filter(|(_, s)| matches!(s.kind, ShapeKind::Disk) && shines(s.material));
    let disks = disks.filter_map(|(i, s)| {
        // The front of a disk faces the z of its own space.
        let [x, y] = [DVec3::X, DVec3::Y].map(|axis| s.rotation * axis * s.radius);
        new(i, false, s.name.as_str(), s.center - x - y, [x * 2.0, y * 2.0])
    });
    quads.chain(disks).collect()
}

/// May a surface of a material hide a light behind it? The boundary of a medium has no surface.
fn hides(scene: &Scene, id: MaterialId) -> bool {
    let material = &scene.materials[id.index()];
    material.emission.is_none() && !matches!(material.model, Model::Boundary {})
}

/// Does another quad that does not emit light lie in the plane of a light?
fn is_on_quad(light: &FlatLight<'_>, scene: &Scene) -> bool {
    let is_other = |quad: &&Quad| hides(scene, quad.material);
    scene.quads.iter().filter(is_other).any(|quad| {
        let opposite = quad.corner + quad.edge_u + quad.edge_v;
        light.is_covered_by(&[quad.corner, quad.corner + quad.edge_u, opposite, quad.corner + quad.edge_v])
    })
}

/// Marks the lights in the plane of triangles of meshes.
fn mark_on_meshes(scene: &Scene, lights: &[FlatLight<'_>], is_flush: &mut [bool]) {
    let passes = |id: MaterialId| !hides(scene, id);
    for (instance, extent) in scene.instances.iter().zip(instance_extents(scene)) {
        let mesh = &scene.meshes[instance.mesh.index()];
        let Some((low, high)) = extent.0.filter(|_| !part_materials(mesh, instance).all(passes)) else {
            continue;
        };
        for (light, flush) in lights.iter().zip(&mut *is_flush).filter(|(_, flush)| !**flush) {
            let margin = DVec3::splat(FLUSH * light.reach);
            let (from, to) = light
                .corners()
                .into_iter()
                .fold((light.corner, light.corner), |(l, h), p| (l.min(p), h.max(p)));
            if (from - margin).cmpgt(high).any() || (to + margin).cmplt(low).any() {
                continue;
            }
            *flush = mesh.triangles.par_iter().with_min_len(4096).any(|t| {
                let place = |p| instance.world_from_object.transform_point3(p);
                light.is_covered_by(&mesh.corners_f64(*t).map(place))
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Material;

    /// The shift of a square lamp of a metre that faces down, at a height under a ceiling at 2.5 m.
    fn shift_at(height: f64) -> Option<DVec3> {
        let mut scene = Scene::default();
        let wall = scene.add_material(Material::lambert("wall", [0.7; 3]));
        let lamp = scene.add_material(Material::emitter("lamp", [5.0; 3], false));
        scene.quads.push(Quad::new([-2.0, 2.5, -2.0], [4.0, 0.0, 0.0], [0.0, 0.0, 4.0], wall));
        scene.quads.push(Quad::new([-0.5, height, -0.5], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], lamp));
        let mut notes = Vec::new();
        let shifts = find(&scene, DVec3::new(0.0, 1.0, 2.0), &mut notes);
        assert_eq!(notes.len(), shifts.quads.len());
        shifts.quads.get(&1).copied()
    }

    #[test]
    fn lights_in_the_plane_of_a_ceiling_are_moved_to_their_front() {
        let shift = shift_at(2.5).expect("it is in its plane");
        assert!(shift.y < -1e-6 && shift.y > -1e-4 && shift.x == 0.0 && shift.z == 0.0, "{shift}");
        assert_eq!(shift_at(2.499), None);
    }
}
