//! Checks of meshes, curves, other objects and their motion: references, list lengths, finite numbers. Each list is checked in
//! one branch-free pass at memory bandwidth.

use super::findings::{BLOCK, Entry, Findings};
use crate::math::DAffine3;
use crate::scene::{
    Curves, Material, MaterialId, Mesh, Motion, ObjectInfo, Scene, Splats, Transmission, VertexAttribute,
};
use rayon::prelude::*;
use std::collections::HashSet;

// Requirements in messages.

const MATERIAL: &str = "one of the scene's materials";
const FINITE: &str = "finite";

// Meshes.

pub(super) fn check_meshes(scene: &Scene, findings: &mut Findings) {
    for (index, mesh) in scene.meshes.iter().enumerate() {
        let place = Entry { list: "meshes", index, name: &mesh.name };
        check_triangles(mesh, place, findings);
        check_numbers(mesh, place, findings);
        check_lengths(mesh, place, findings);
        check_attributes(mesh, place, findings);
        check_splats(mesh, place, findings);
        check_parts(mesh, scene.materials.len(), place, findings);
    }
}

fn check_triangles(mesh: &Mesh, place: Entry, findings: &mut Findings) {
    let (indices, vertices) = (mesh.triangles.as_flattened(), mesh.positions.len());
    // With more than 2^32 vertices all indices are in range.
    let Ok(vertices) = u32::try_from(vertices) else { return };
    let are_in_range = |block: &[u32]| !block.iter().fold(false, |any, &i| any | (i >= vertices));
    if !indices.par_chunks(BLOCK).all(are_in_range) {
        let largest = indices.iter().fold(0, |largest, &i| largest.max(i));
        findings.reject(place, "triangles", largest, "indices below the number of positions");
    }
}

fn check_numbers(mesh: &Mesh, place: Entry, findings: &mut Findings) {
    let mut check = |field, numbers: &[f32]| findings.require_finite(numbers, place, field);
    check("positions", mesh.positions.as_flattened());
    check("normals", mesh.normals.as_flattened());
    check("tangents", mesh.tangents.as_flattened());
    check("colors", mesh.colors.as_flattened());
    mesh.uv_sets.iter().for_each(|set| check("uv_sets", set.as_flattened()));
    mesh.attributes.iter().for_each(|attribute| check("attributes", &attribute.values));
}

fn check_attributes(mesh: &Mesh, place: Entry, findings: &mut Findings) {
    let mut names = HashSet::new();
    for attribute in &mesh.attributes {
        let is_valid = (1..=VertexAttribute::MAX_WIDTH).contains(&attribute.width);
        findings.require(is_valid, place, "width of an attribute", attribute.width, "1 to 4");
        let expected = mesh.positions.len() as u64 * u64::from(attribute.width);
        let length = attribute.values.len();
        findings.require(
            length as u64 == expected,
            place,
            "length of an attribute",
            length,
            "its width times the number of positions",
        );
        let is_unique = names.insert(&attribute.name);
        findings.require(is_unique, place, "name of an attribute", &attribute.name, "unique in the mesh");
    }
}

fn check_lengths(mesh: &Mesh, place: Entry, findings: &mut Findings) {
    let vertices = mesh.positions.len();
    let mut check = |field, length: usize| {
        let is_valid = length == 0 || length == vertices;
        findings.require(is_valid, place, field, length, "the number of positions, or 0");
    };
    check("length of normals", mesh.normals.len());
    check("length of tangents", mesh.tangents.len());
    check("length of colors", mesh.colors.len());
    mesh.uv_sets.iter().for_each(|set| check("length of a set of uv_sets", set.len()));
}

fn check_splats(mesh: &Mesh, place: Entry, findings: &mut Findings) {
    let Some(splats) = &mesh.splats else { return };
    let Splats { scales, rotations, opacities, degree, coefficients, is_linear: _ } = &**splats;
    let is_valid = *degree <= Splats::MAX_DEGREE;
    findings.require(is_valid, place, "degree of splats", degree, "0 to 3");
    let vertices = mesh.positions.len();
    let per_splat = Splats::coefficients_of((*degree).min(Splats::MAX_DEGREE));
    let lengths = [
        ("length of the scales of splats", scales.len(), vertices),
        ("length of the rotations of splats", rotations.len(), vertices),
        ("length of the opacities of splats", opacities.len(), vertices),
        ("length of the coefficients of splats", coefficients.len(), vertices.saturating_mul(per_splat)),
    ];
    for (field, length, expected) in lengths {
        findings.require(length == expected, place, field, length, "as many as the positions require");
    }
    findings.require_finite(scales.as_flattened(), place, "scales of splats");
    findings.require_finite(rotations.as_flattened(), place, "rotations of splats");
    findings.require_finite(opacities, place, "opacities of splats");
    let invalid = scales.as_flattened().iter().find(|scale| **scale <= 0.0);
    findings.require(invalid.is_none(), place, "scales of splats", invalid, "above 0");
    let invalid = opacities.iter().find(|opacity| !(0.0..=1.0).contains(*opacity));
    findings.require(invalid.is_none(), place, "opacities of splats", invalid, "0 to 1");
    let is_unit = |q: &&[f32; 4]| (q.iter().map(|x| x * x).sum::<f32>() - 1.0).abs() < 1e-3;
    let invalid = rotations.iter().find(|q| !is_unit(q));
    findings.require(invalid.is_none(), place, "rotations of splats", invalid, "of unit length");
    let invalid = coefficients.as_flattened().iter().find(|c| !c.is_finite());
    findings.require(invalid.is_none(), place, "coefficients of splats", invalid, FINITE);
    let is_valid = mesh.triangles.is_empty() && !mesh.parts.is_empty();
    findings.require(is_valid, place, "splats", mesh.triangles.len(), "without triangles, with one part");
}

fn check_parts(mesh: &Mesh, materials: usize, place: Entry, findings: &mut Findings) {
    const IN_ORDER: &str = "in order without gaps, and cover all triangles";
    let mut next = 0u64;
    for part in &mesh.parts {
        let is_valid = part.material.index() < materials;
        findings.require(is_valid, place, "material of a part", part.material, MATERIAL);
        if u64::from(part.first_triangle) != next {
            return findings.reject(place, "parts", part, IN_ORDER);
        }
        next += u64::from(part.triangle_count);
    }
    findings.require(next == mesh.triangles.len() as u64, place, "parts", mesh.parts.last(), IN_ORDER);
}

// Curves.

pub(super) fn check_curves(scene: &Scene, findings: &mut Findings) {
    for (index, curves) in scene.curves.iter().enumerate() {
        let place = Entry { list: "curves", index, name: &curves.name };
        check_info(&curves.info, place, findings);
        check_curve_lists(curves, place, findings);
        match scene.materials.get(curves.material.index()) {
            None => findings.reject(place, "material", curves.material, MATERIAL),
            Some(material) => check_curve_material(material, place, findings),
        }
    }
}

fn check_curve_lists(curves: &Curves, place: Entry, findings: &mut Findings) {
    let sum: u64 = curves.strands.iter().map(|n| u64::from(*n)).sum();
    let points = curves.points.len();
    findings.require(sum == points as u64, place, "strands", sum, "the number of points in total");
    let invalid = curves.strands.iter().find(|n| !curves.basis.accepts(**n as usize));
    findings.require(invalid.is_none(), place, "strands", invalid, curves.basis.requirement());
    findings.require(curves.radii.len() == points, place, "radii", curves.radii.len(), "one per point");
    let is_valid = [0, points].contains(&curves.colors.len());
    findings.require(is_valid, place, "colors", curves.colors.len(), "one per point, or none");
    findings.require_finite(curves.points.as_flattened(), place, "points");
    findings.require_finite(&curves.radii, place, "radii");
    findings.require_finite(curves.colors.as_flattened(), place, "colors");
    let negative = curves.radii.iter().find(|r| **r < 0.0);
    findings.require(negative.is_none(), place, "radii", negative, "from 0 up");
    let is_finite = curves.world_from_object.is_finite();
    findings.require(is_finite, place, "world_from_object", curves.world_from_object, FINITE);
}

/// Whether the material encloses a solid or medium.
fn is_solid(material: &Material) -> bool {
    let of_model = match material.model.transmission() {
        Transmission::Clear(_) => true,
        Transmission::Pbr(pbr) => pbr.has_volume || pbr.keeps_radiance,
        Transmission::None | Transmission::Thin => false,
    };
    of_model || material.medium.is_some()
}

/// Checks that the material is supported for curves, which have no interior and can't be lights.
fn check_curve_material(material: &Material, place: Entry, findings: &mut Findings) {
    let name = &material.name;
    let not_solid =
        "neither solid glass nor filled with a medium: curves support opaque and thin materials and 'hair'";
    findings.require(!is_solid(material), place, "material", name, not_solid);
    let not_emissive = "without emission: curves can't be lights";
    findings.require(material.emission.is_none(), place, "material", name, not_emissive);
}

// Instances, shapes and quads.

fn check_info(info: &ObjectInfo, place: Entry, findings: &mut Findings) {
    let numbers = [&info.color[..], &[info.index], &[info.random.unwrap_or(0.0)]].concat();
    findings.require_finite(&numbers, place, "info");
}

pub(super) fn check_objects(scene: &Scene, findings: &mut Findings) {
    let exists = |id: MaterialId| id.index() < scene.materials.len();
    for (index, instance) in scene.instances.iter().enumerate() {
        let place = Entry { list: "instances", index, name: &instance.name };
        let has_mesh = instance.mesh.index() < scene.meshes.len();
        check_info(&instance.info, place, findings);
        findings.require(has_mesh, place, "mesh", instance.mesh, "one of the scene's meshes");
        findings.require(
            instance.material.is_none_or(exists),
            place,
            "material",
            instance.material,
            MATERIAL,
        );
        let mesh = scene.meshes.get(instance.mesh.index()).filter(|mesh| mesh.splats.is_some());
        let of_mesh = mesh.and_then(|mesh| mesh.parts.first()).map(|part| part.material);
        let used = of_mesh.map(|of_mesh| instance.material.unwrap_or(of_mesh));
        if let Some(material) = used.and_then(|id| scene.materials.get(id.index())) {
            let not_solid =
                "neither solid glass nor filled with a medium: splats support opaque and thin materials";
            findings.require(!is_solid(material), place, "material", &material.name, not_solid);
        }
    }
    for (index, shape) in scene.shapes.iter().enumerate() {
        let place = Entry { list: "shapes", index, name: &shape.name };
        check_info(&shape.info, place, findings);
        findings.require(exists(shape.material), place, "material", shape.material, MATERIAL);
        findings.require(shape.center.is_finite(), place, "center", shape.center, FINITE);
        findings.require_length(shape.radius, place, "radius", shape.radius);
        findings.require(shape.rotation.is_normalized(), place, "rotation", shape.rotation, "of unit length");
    }
    for (index, quad) in scene.quads.iter().enumerate() {
        let place = Entry { list: "quads", index, name: &quad.name };
        check_info(&quad.info, place, findings);
        findings.require(exists(quad.material), place, "material", quad.material, MATERIAL);
        findings.require(quad.corner.is_finite(), place, "corner", quad.corner, FINITE);
        findings.require(quad.edge_u.is_finite(), place, "edge_u", quad.edge_u, FINITE);
        findings.require(quad.edge_v.is_finite(), place, "edge_v", quad.edge_v, FINITE);
    }
}

// Motion of objects. (That of cameras and lights is checked with them.)

pub(super) fn check_motion(scene: &Scene, findings: &mut Findings) {
    let motion = &scene.motion;
    for (index, instance) in scene.instances.iter().enumerate() {
        if let Motion::Keyed(number) = instance.motion {
            let place = Entry { list: "instances", index, name: &instance.name };
            let exists = (number as usize) < motion.instances.len();
            findings.require(exists, place, "motion", number, "the number of one of the scene's motions");
        }
    }
    let maps = [("motion.quads", &motion.quads), ("motion.shapes", &motion.shapes)];
    let keyed = maps.iter().flat_map(|(list, all)| all.iter().map(move |(i, moving)| (*list, *i, moving)));
    let instances = motion.instances.iter().enumerate().map(|(i, moving)| ("motion.instances", i, moving));
    for (list, index, moving) in keyed.chain(instances) {
        let place = Entry { list, index, name: "" };
        findings.require(
            moving.all().all(DAffine3::is_finite),
            place,
            "keys",
            moving.keys.len(),
            "finite transforms",
        );
    }
    for (&index, moving) in &motion.meshes {
        let mesh = scene.meshes.get(index);
        let place = Entry { list: "motion.meshes", index, name: mesh.map_or("", |m| &m.name) };
        findings.require(mesh.is_some(), place, "mesh", index, "one of the scene's meshes");
        let Some(mesh) = mesh else { continue };
        let counts = (mesh.positions.len(), mesh.normals.len());
        let fits = moving.all().all(|key| (key.positions.len(), key.normals.len()) == counts);
        findings.require(
            fits,
            place,
            "keys",
            moving.keys.len(),
            "as many positions and normals as the mesh has",
        );
    }
}
