//! What is seen: instances, shapes and quads.

use super::findings::{Findings, Place};
use crate::scene::{MaterialId, Scene};

const MATERIAL: &str = "one of the scene's materials";
const FINITE: &str = "finite";

pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let exists = |id: MaterialId| id.index() < scene.materials.len();
    for (index, instance) in scene.instances.iter().enumerate() {
        let place = Place { list: "instances", index, name: &instance.name };
        let has_mesh = instance.mesh.index() < scene.meshes.len();
        findings.require(has_mesh, place, "mesh", instance.mesh, "one of the scene's meshes");
        findings.require(
            instance.material.is_none_or(exists),
            place,
            "material",
            instance.material,
            MATERIAL,
        );
    }
    for (index, shape) in scene.shapes.iter().enumerate() {
        let place = Place { list: "shapes", index, name: &shape.name };
        findings.require(exists(shape.material), place, "material", shape.material, MATERIAL);
        findings.require(shape.center.is_finite(), place, "center", shape.center, FINITE);
        findings.require_length(shape.radius, place, "radius", shape.radius);
        for number in shape.kind.numbers() {
            findings.require(number.is_finite(), place, "kind", number, FINITE);
        }
        findings.require(shape.rotation.is_normalized(), place, "rotation", shape.rotation, "of unit length");
    }
    for (index, quad) in scene.quads.iter().enumerate() {
        let place = Place { list: "quads", index, name: &quad.name };
        findings.require(exists(quad.material), place, "material", quad.material, MATERIAL);
        findings.require(quad.corner.is_finite(), place, "corner", quad.corner, FINITE);
        findings.require(quad.edge_u.is_finite(), place, "edge_u", quad.edge_u, FINITE);
        findings.require(quad.edge_v.is_finite(), place, "edge_v", quad.edge_v, FINITE);
    }
}
