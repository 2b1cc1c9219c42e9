//! Meshes: indices, lengths of lists, runs of materials, and that every number is finite. One pass over each list, without
//! branches, so that it takes as long as reading it.

use super::findings::{BLOCK, Findings, Place};
use crate::scene::{Mesh, Scene};
use rayon::prelude::*;

pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    for (index, mesh) in scene.meshes.iter().enumerate() {
        let place = Place { list: "meshes", index, name: &mesh.name };
        check_triangles(mesh, place, findings);
        check_numbers(mesh, place, findings);
        check_lengths(mesh, place, findings);
        check_parts(mesh, scene.materials.len(), place, findings);
    }
}

fn check_triangles(mesh: &Mesh, place: Place, findings: &mut Findings) {
    let (indices, vertices) = (mesh.triangles.as_flattened(), mesh.positions.len());
    // More vertices than indices can tell apart: all are in range.
    let Ok(vertices) = u32::try_from(vertices) else { return };
    let are_in_range = |block: &[u32]| !block.iter().fold(false, |bad, &i| bad | (i >= vertices));
    if !indices.par_chunks(BLOCK).all(are_in_range) {
        let largest = indices.iter().fold(0, |largest, &i| largest.max(i));
        findings.reject(place, "triangles", largest, "indices below the number of positions");
    }
}

fn check_numbers(mesh: &Mesh, place: Place, findings: &mut Findings) {
    let mut check = |field, numbers: &[f32]| findings.require_finite(numbers, place, field);
    check("positions", mesh.positions.as_flattened());
    check("normals", mesh.normals.as_flattened());
    check("tangents", mesh.tangents.as_flattened());
    check("colors", mesh.colors.as_flattened());
    mesh.uv_sets.iter().for_each(|set| check("uv_sets", set.as_flattened()));
}

fn check_lengths(mesh: &Mesh, place: Place, findings: &mut Findings) {
    let vertices = mesh.positions.len();
    let mut check = |field, length: usize| {
        let is_met = length == 0 || length == vertices;
        findings.require(is_met, place, field, length, "as many as the positions, or empty");
    };
    check("length of normals", mesh.normals.len());
    check("length of tangents", mesh.tangents.len());
    check("length of colors", mesh.colors.len());
    mesh.uv_sets.iter().for_each(|set| check("length of a set of uv_sets", set.len()));
}

fn check_parts(mesh: &Mesh, materials: usize, place: Place, findings: &mut Findings) {
    const IN_ORDER: &str = "in order, without gaps, and cover all triangles";
    let mut next = 0u64;
    for part in &mesh.parts {
        let is_met = part.material.index() < materials;
        findings.require(is_met, place, "material of a part", part.material, "one of the scene's materials");
        if u64::from(part.first_triangle) != next {
            return findings.reject(place, "parts", part, IN_ORDER);
        }
        next += u64::from(part.triangle_count);
    }
    findings.require(next == mesh.triangles.len() as u64, place, "parts", mesh.parts.last(), IN_ORDER);
}
