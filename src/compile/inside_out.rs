//! Closed meshes of solids whose fronts are where their backs should be: they are taken as turned around.
//!
//! Which side of a surface is inside decides what light is refracted by. A closed mesh tells it by its volume, the sum of the
//! tetrahedra between its triangles and a point (Zhang, Chen 2001, "Efficient Feature Extraction for 2D/3D Objects in Mesh
//! Representation", section 2): negative, its triangles run clockwise. But a mesh of this kind within a body of the same
//! material is a hole in it, as meant.

use super::material::CompiledMaterial;
use super::plan::part_materials;
use crate::error::Warning;
use crate::math::DVec3;
use crate::scene::{Instance, MaterialId, Mesh, Scene, is_closed};

/// By mesh: is it inside out? Empty where none is.
pub(super) fn find(scene: &Scene, materials: &[CompiledMaterial], warnings: &mut Vec<Warning>) -> Vec<bool> {
    let is_solid = |id: MaterialId| materials[id.index()].medium_index != 0;
    if !materials.iter().any(|m| m.medium_index != 0) {
        return Vec::new();
    }
    let is_whole = |i: &&Instance| part_materials(&scene.meshes[i.mesh.index()], i).all(is_solid);
    let mut uses = vec![(0, 0); scene.meshes.len()];
    for instance in &scene.instances {
        let (all, whole) = &mut uses[instance.mesh.index()];
        *all += 1;
        *whole += usize::from(is_whole(&instance));
    }
    let mut found = Vec::new();
    for (index, mesh) in scene.meshes.iter().enumerate() {
        let (all, whole) = uses[index];
        if whole == 0 || all != whole || volume(mesh) >= 0.0 || !is_closed(mesh) {
            continue;
        }
        let mut placed = scene.instances.iter().filter(|i| i.mesh.index() == index);
        if placed.any(|instance| is_hole(scene, instance)) {
            continue;
        }
        found.resize(scene.meshes.len(), false);
        found[index] = true;
        warnings.push(Warning::general(format!(
            "the normals of mesh '{}' point inwards: it is closed and lets light pass, and is taken as turned around; turn \
             its faces in the file",
            mesh.name
        )));
    }
    found
}

/// Six times the volume within a mesh; negative where its triangles run clockwise seen from outside.
fn volume(mesh: &Mesh) -> f64 {
    let corner = |i: u32| DVec3::from_array(mesh.positions[i as usize].map(f64::from));
    // From a point of the mesh: far from the origin sums cancel.
    let Some(first) = mesh.triangles.first().map(|t| corner(t[0])) else { return 0.0 };
    let of_triangle = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| corner(i) - first);
        a.dot(b.cross(c))
    };
    mesh.triangles.iter().map(of_triangle).sum()
}

/// Does an instance lie within another body that has one of its materials?
fn is_hole(scene: &Scene, instance: &Instance) -> bool {
    /// Points of it that are asked.
    const POINTS: usize = 16;
    let mesh = &scene.meshes[instance.mesh.index()];
    let step = mesh.triangles.len().div_ceil(POINTS).max(1);
    let points = mesh.triangles.iter().step_by(step).map(|t| {
        let p = mesh.positions[t[0] as usize];
        instance.world_from_object.transform_point3(p.map(f64::from).into())
    });
    let points: Vec<DVec3> = points.collect();
    let has_material = |id: MaterialId| part_materials(mesh, instance).any(|own| own == id);
    let bodies = scene
        .instances
        .iter()
        .filter(|other| !std::ptr::eq(*other, instance))
        .filter(|other| part_materials(&scene.meshes[other.mesh.index()], other).any(has_material));
    let mut shapes = scene.shapes.iter().filter(|s| has_material(s.material) && s.kind.tag().is_closed());
    let is_around = |other: &Instance| points.iter().all(|&p| winding(scene, other, p).abs() > 0.5);
    shapes.any(|s| points.iter().all(|p| p.distance(s.center) < s.radius))
        || bodies.into_iter().any(is_around)
}

/// How often a body goes around a point: the solid angle of its triangles over 4 pi (van Oosterom, Strackee 1983, "The Solid
/// Angle of a Plane Triangle", equation 8).
fn winding(scene: &Scene, body: &Instance, p: DVec3) -> f64 {
    let mesh = &scene.meshes[body.mesh.index()];
    let corner = |i: u32| {
        body.world_from_object.transform_point3(mesh.positions[i as usize].map(f64::from).into()) - p
    };
    let half_angle = |t: &[u32; 3]| {
        let [a, b, c] = t.map(corner);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let below = la * lb * lc + a.dot(b) * lc + a.dot(c) * lb + b.dot(c) * la;
        a.dot(b.cross(c)).atan2(below)
    };
    mesh.triangles.iter().map(half_angle).sum::<f64>() / std::f64::consts::TAU
}
