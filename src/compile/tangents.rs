//! Tangents for normal maps of meshes that bring none, by Mikkelsen's algorithm, which baking programs use too.

use crate::math::poly;
use crate::scene::Mesh;
use bevy_mikktspace::{Geometry, Ops, TangentSpace, generate_tangents};
use std::collections::HashMap;

/// The mesh with tangents that follow one of its sets of texture coordinates; `None` if it has tangents already, or
/// lacks normals or that set. Vertices where the triangles around them disagree (at seams and mirror lines) are split.
pub(super) fn with_tangents(mesh: &Mesh, uv_set: usize) -> Option<Mesh> {
    let uv = mesh.uv_sets.get(uv_set)?;
    if uv.is_empty() || mesh.normals.is_empty() || !mesh.tangents.is_empty() {
        return None;
    }
    let mut corners = Corners { mesh, uv, tangents: vec![[[0.0; 4]; 3]; mesh.triangles.len()] };
    // The error type has no values.
    generate_tangents(&mut corners).ok()?;
    Some(split(mesh, &corners.tangents))
}

/// The triangles as the algorithm sees them.
struct Corners<'a> {
    mesh: &'a Mesh,
    uv: &'a [[f32; 2]],
    tangents: Vec<[[f32; 4]; 3]>,
}

/// Mathematics with the same result on every machine.
struct Exact;

impl Ops for Exact {
    fn sqrt(x: f32) -> f32 {
        x.sqrt()
    }

    fn acos(x: f32) -> f32 {
        poly::acos(x)
    }
}

impl Corners<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.mesh.triangles[face][corner] as usize
    }
}

impl Geometry<Exact> for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.triangles.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.positions[self.vertex(face, corner)]
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.normals[self.vertex(face, corner)]
    }

    /// Upwards, as normal maps mean it; ours grow downwards.
    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        let [u, v] = self.uv[self.vertex(face, corner)];
        [u, -v]
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        if let Some(space) = space {
            self.tangents[face][corner] = space.tangent_encoded();
        }
    }
}

/// Gives each vertex its tangent; a vertex with several becomes several.
fn split(mesh: &Mesh, tangents: &[[[f32; 4]; 3]]) -> Mesh {
    let mut result = Mesh { tangents: vec![[0.0; 4]; mesh.positions.len()], ..mesh.clone() };
    let mut is_taken = vec![false; mesh.positions.len()];
    let mut copies: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
    for (triangle, of_corners) in result.triangles.iter_mut().zip(tangents) {
        for (index, &tangent) in triangle.iter_mut().zip(of_corners) {
            let vertex = *index as usize;
            if !is_taken[vertex] {
                is_taken[vertex] = true;
                result.tangents[vertex] = tangent;
            } else if result.tangents[vertex] != tangent {
                let next = result.positions.len() as u32;
                *index = *copies.entry((*index, tangent.map(f32::to_bits))).or_insert(next);
                if *index == next {
                    result.positions.push(result.positions[vertex]);
                    result.normals.push(result.normals[vertex]);
                    for set in result.uv_sets.iter_mut().filter(|s| !s.is_empty()) {
                        set.push(set[vertex]);
                    }
                    if !result.colors.is_empty() {
                        result.colors.push(result.colors[vertex]);
                    }
                    result.tangents.push(tangent);
                }
            }
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles of a square; the image is mirrored on the second.
    fn mirrored_halves() -> Mesh {
        Mesh {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]],
            triangles: vec![[0, 1, 2], [1, 3, 2]],
            normals: vec![[0.0, 0.0, 1.0]; 4],
            // Image upright on the first: u to the right, v downwards. Folded at the diagonal.
            uv_sets: vec![vec![[0.0, 1.0], [1.0, 1.0], [0.0, 0.0], [0.0, 1.0]]],
            colors: vec![[1.0; 4]; 4],
            ..Mesh::default()
        }
    }

    #[test]
    fn tangents_point_along_u_and_bitangents_up_the_image() {
        let mesh = with_tangents(&mirrored_halves(), 0).expect("has all it needs");
        let [a, ..] = mesh.triangles[0];
        assert_eq!(mesh.tangents[a as usize], [1.0, 0.0, 0.0, 1.0]);
        // On the second u falls to the right and v rises to the top: handedness flips, and the fold is split.
        let [_, b, _] = mesh.triangles[1];
        assert_eq!(mesh.tangents[b as usize][3], -1.0);
        assert_eq!(mesh.positions.len(), 6);
        for list in [mesh.normals.len(), mesh.uv_sets[0].len(), mesh.colors.len(), mesh.tangents.len()] {
            assert_eq!(list, 6);
        }
        let place = |m: &Mesh, t: [u32; 3]| t.map(|i| m.positions[i as usize]);
        for (old, new) in mirrored_halves().triangles.iter().zip(&mesh.triangles) {
            assert_eq!(place(&mirrored_halves(), *old), place(&mesh, *new));
        }
    }

    #[test]
    fn what_is_missing_or_there_already_changes_nothing() {
        let whole = mirrored_halves();
        assert!(with_tangents(&whole, 1).is_none());
        assert!(with_tangents(&Mesh { normals: Vec::new(), ..whole.clone() }, 0).is_none());
        let given = Mesh { tangents: vec![[1.0, 0.0, 0.0, 1.0]; 4], ..whole };
        assert!(with_tangents(&given, 0).is_none());
    }
}
