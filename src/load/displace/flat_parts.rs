//! Parts of flat meshes that stay flat where other parts get the normals of their vertices.

use crate::math::Vec3;
use crate::scene::Mesh;

/// Gives a flat mesh normals: those of vertices, and in some parts those of faces, with own vertices for each corner, so that all keys
/// of a deforming mesh have the same vertices.
pub(super) fn split(mesh: &mut Mesh, faces: &[Vec3], stays_flat: &[bool], vertex_normals: &mut Vec<Vec3>) {
    mesh.normals = vertex_normals.iter().map(|normal| normal.to_array()).collect();
    for (part, _) in mesh.parts.clone().iter().zip(stays_flat).filter(|&(_, is_flat)| *is_flat) {
        let first = part.first_triangle as usize;
        for (triangle, normal) in (first..).zip(&faces[first..first + part.triangle_count as usize]) {
            for corner in 0..3 {
                let vertex = mesh.triangles[triangle][corner] as usize;
                vertex_normals.push(vertex_normals[vertex]);
                mesh.triangles[triangle][corner] = copy(mesh, vertex, normal.to_array());
            }
        }
    }
}

/// Adds a copy of a vertex with another normal; gives its index.
fn copy(mesh: &mut Mesh, vertex: usize, normal: [f32; 3]) -> u32 {
    mesh.positions.push(mesh.positions[vertex]);
    mesh.normals.push(normal);
    for set in mesh.uv_sets.iter_mut().filter(|set| !set.is_empty()) {
        set.push(set[vertex]);
    }
    let tangent = mesh.tangents.get(vertex).copied();
    mesh.tangents.extend(tangent);
    let color = mesh.colors.get(vertex).copied();
    mesh.colors.extend(color);
    mesh.attributes.iter_mut().for_each(|attribute| attribute.push_copy(vertex));
    (mesh.positions.len() - 1) as u32
}
