//! Flat-shaded meshes in which some parts get vertex normals and the others stay flat.

use crate::load::smooth::append_vertices;
use crate::math::Vec3;
use crate::scene::Mesh;

/// Sets vertex normals of a flat-shaded mesh. Parts that stay flat get face normals, and a vertex for each corner: always, so that all
/// keys of a deforming mesh have the same vertices.
pub(super) fn split(mesh: &mut Mesh, faces: &[Vec3], stays_flat: &[bool], vertex_normals: &mut Vec<Vec3>) {
    mesh.normals = vertex_normals.iter().map(|normal| normal.to_array()).collect();
    let mut origins = Vec::new();
    for (part, _) in mesh.parts.iter().zip(stays_flat).filter(|&(_, is_flat)| *is_flat) {
        let triangles = mesh.triangles[part.triangles()].iter_mut();
        for (triangle, &normal) in triangles.zip(&faces[part.triangles()]) {
            for vertex in triangle {
                origins.push(*vertex);
                vertex_normals.push(vertex_normals[*vertex as usize]);
                mesh.normals.push(normal.to_array());
                *vertex = (mesh.normals.len() - 1) as u32;
            }
        }
    }
    append_vertices(mesh, &origins);
}
