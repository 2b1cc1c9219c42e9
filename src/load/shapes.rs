//! Triangle meshes of simple shapes, and repair of meshes from files.

use crate::error::Warning;
use crate::math::{DAffine3, DVec3, all_finite};
use crate::scene::Mesh;
use std::path::Path;

/// Counts of repairs in the meshes of a file.
#[derive(Clone, Copy, Default)]
pub(super) struct Repairs {
    /// Triangles that were dropped.
    triangles: usize,
    /// Texture coordinates and colours that were set to 0.
    attributes: usize,
}

impl Repairs {
    /// Repairs a mesh: vertices that are not finite go to the origin, and the triangles that use them are removed. Texture
    /// coordinates and colours that are not finite become 0. Normals that have no direction become those of a flat triangle:
    /// all of the mesh's normals go if none is usable.
    pub fn make(&mut self, mesh: &mut Mesh) {
        let before = mesh.triangles.len();
        if !all_finite(mesh.positions.as_flattened()) {
            let bad: Vec<bool> = mesh.positions.iter().map(|p| !all_finite(p)).collect();
            mesh.triangles.retain(|t| !t.iter().any(|&i| bad.get(i as usize).copied().unwrap_or(false)));
            for (p, _) in mesh.positions.iter_mut().zip(&bad).filter(|(_, b)| **b) {
                *p = [0.0; 3];
            }
        }
        normalize_normals(mesh);
        self.triangles += before - mesh.triangles.len();
        self.attributes += clear_unusable(mesh);
    }

    /// Warnings that count them.
    pub fn warnings(self, path: &Path) -> impl Iterator<Item = Warning> {
        let Repairs { triangles, attributes } = self;
        let dropped = format!("{triangles} triangles with corners that are not finite numbers were dropped");
        let zeroed = format!("{attributes} texture coordinates or colours that are not finite became 0");
        let counted = [(triangles, dropped), (attributes, zeroed)].into_iter().filter(|(n, _)| *n > 0);
        counted.map(|(_, message)| Warning::new(path, "", message))
    }
}

/// Sets texture coordinates and colours that are not finite to 0; returns how many.
pub(super) fn clear_unusable(mesh: &mut Mesh) -> usize {
    let mut count = 0;
    let uv_sets = mesh.uv_sets.iter_mut().map(|set| set.as_flattened_mut());
    for list in uv_sets.chain([mesh.colors.as_flattened_mut()]).filter(|list| !all_finite(list)) {
        let unusable = list.iter_mut().filter(|x| !x.is_finite());
        count += unusable.map(|x| *x = 0.0).count();
    }
    count
}

/// Gives normals unit length; a vertex whose normal has none gets the direction of one of its triangles.
pub(super) fn normalize_normals(mesh: &mut Mesh) {
    let unit = |n: [f32; 3]| DVec3::from(n.map(f64::from)).try_normalize().map(|n| n.as_vec3().to_array());
    if mesh.normals.iter().all(|&n| unit(n).is_none()) {
        mesh.normals.clear();
        return;
    }
    let mut missing = vec![false; mesh.normals.len()];
    for (n, missing) in mesh.normals.iter_mut().zip(&mut missing) {
        match unit(*n) {
            Some(u) => *n = u,
            None => {
                *n = [0.0, 1.0, 0.0];
                *missing = true;
            }
        }
    }
    for t in mesh.triangles.iter().filter(|t| t.iter().any(|&i| missing[i as usize])) {
        let [a, b, c] = t.map(|i| DVec3::from(mesh.positions[i as usize].map(f64::from)));
        if let Some(face) = (b - a).cross(c - a).try_normalize() {
            for i in t.map(|i| i as usize).into_iter().filter(|&i| missing[i]) {
                mesh.normals[i] = face.as_vec3().to_array();
            }
        }
    }
}

/// The polygon faces of a shape in object space, counter-clockwise from outside.
pub(super) struct Faces {
    /// Corners and texture coordinates of the corners.
    pub faces: Vec<Vec<(DVec3, [f32; 2])>>,
}

const SQUARE: [[f32; 2]; 4] = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];

/// A box in the order -x, +x, -y, +y, -z, +z.
pub(super) fn box_faces(min: DVec3, max: DVec3) -> Faces {
    let corner = |bits: usize| {
        DVec3::new(
            if bits & 1 == 0 { min.x } else { max.x },
            if bits & 2 == 0 { min.y } else { max.y },
            if bits & 4 == 0 { min.z } else { max.z },
        )
    };
    let faces = [[0, 4, 6, 2], [5, 1, 3, 7], [0, 1, 5, 4], [6, 7, 3, 2], [1, 0, 2, 3], [4, 5, 7, 6]];
    let face = |f: [usize; 4]| f.into_iter().map(corner).zip(SQUARE).collect();
    Faces { faces: faces.into_iter().map(face).collect() }
}

/// A pyramid over a rectangle in the x-z plane around `base`: the base first, then the sides towards +z, +x, -z, -x.
pub(super) fn pyramid_faces(base: DVec3, size: [f64; 2], height: f64) -> Faces {
    let (x, z) = (DVec3::X * (size[0] / 2.0), DVec3::Z * (size[1] / 2.0));
    let ring = [base - x + z, base + x + z, base + x - z, base - x - z];
    let apex = base + DVec3::Y * height;
    let mut faces = vec![[3, 2, 1, 0].map(|i| ring[i]).into_iter().zip(SQUARE).collect::<Vec<_>>()];
    for i in 0..4 {
        faces.push(vec![(ring[i], SQUARE[0]), (ring[(i + 1) % 4], SQUARE[1]), (apex, [0.5, 0.0])]);
    }
    Faces { faces }
}

/// One triangle.
pub(super) fn triangle_faces(corners: [DVec3; 3]) -> Faces {
    let uv = [[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]];
    Faces { faces: vec![corners.into_iter().zip(uv).collect()] }
}

impl Faces {
    /// A flat mesh without parts, and the number of triangles of each face. Vertices are relative to `origin`, so that
    /// f32 keeps their precision far from the world's origin.
    pub fn to_mesh(&self, name: &str, origin: DVec3) -> (Mesh, Vec<u32>) {
        let mut mesh = Mesh { name: name.to_string(), uv_sets: vec![Vec::new()], ..Mesh::default() };
        let mut counts = Vec::new();
        for face in &self.faces {
            let first = mesh.positions.len() as u32;
            for (p, uv) in face {
                mesh.positions.push((*p - origin).as_vec3().to_array());
                mesh.uv_sets[0].push(*uv);
            }
            let count = face.len() as u32 - 2;
            mesh.triangles.extend((1..=count).map(|i| [first, first + i, first + i + 1]));
            counts.push(count);
        }
        (mesh, counts)
    }
}

/// The uniform scale of a transform that only rotates, moves and scales evenly; `None` for any other.
pub(super) fn uniform_scale(transform: &DAffine3) -> Option<f64> {
    let m = transform.matrix3;
    let lengths = [m.x_axis.length(), m.y_axis.length(), m.z_axis.length()];
    let scale = lengths[0];
    let even = lengths.iter().all(|l| (l - scale).abs() <= 1e-9 * scale);
    let square = [m.x_axis.dot(m.y_axis), m.y_axis.dot(m.z_axis), m.z_axis.dot(m.x_axis)]
        .iter()
        .all(|d| d.abs() <= 1e-9 * scale * scale);
    (scale > 0.0 && scale.is_finite() && even && square && m.determinant() > 0.0).then_some(scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(mesh: &Mesh) -> f64 {
        let corner = |i: u32| DVec3::from(mesh.positions[i as usize].map(f64::from));
        mesh.triangles.iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0).sum()
    }

    #[test]
    fn closed_shapes_face_outwards_and_hold_their_volume() {
        let (b, counts) =
            box_faces(DVec3::new(-1.0, 0.0, 2.0), DVec3::new(1.0, 3.0, 6.0)).to_mesh("b", DVec3::ZERO);
        assert!((volume(&b) - 24.0).abs() < 1e-5);
        assert_eq!(counts, [2; 6]);
        let (p, counts) = pyramid_faces(DVec3::Y, [2.0, 3.0], 5.0).to_mesh("p", DVec3::ZERO);
        assert!((volume(&p) - 10.0).abs() < 1e-5);
        assert_eq!(counts, [2, 1, 1, 1, 1]);
    }
}
