//! Mesh helpers of the loaders: repair, simple shapes, coordinates far from the origin.

use super::Loaded;
use crate::color::linear_from_srgb;
use crate::error::Warning;
use crate::math::{DAffine3, DMat3, DQuat, DVec3, all_finite};
use crate::scene::{Mesh, MeshId, Motion, Scene, Shape};
use std::collections::HashMap;
use std::path::Path;

/// Name of a mesh in formats without names.
pub const NAMELESS: &str = "mesh";

/// Numbers of repairs in the meshes of a file.
#[derive(Clone, Copy, Default)]
pub(super) struct Repairs {
    /// Dropped triangles.
    triangles: usize,
    /// Texture coordinates, colours and attributes set to 0.
    attributes: usize,
    /// Non-finite normals.
    normals: usize,
}

impl Repairs {
    /// Repairs a mesh: non-finite vertices are moved to the origin and their triangles removed. Non-finite texture coordinates
    /// and colours become 0. Zero and non-finite normals are replaced by face normals; if all are, normals are removed.
    pub fn repair(&mut self, mesh: &mut Mesh) {
        if !all_finite(mesh.positions.as_flattened()) {
            self.triangles += remove_non_finite_triangles(mesh);
            mesh.parts.retain(|part| part.triangle_count > 0);
        }
        if !all_finite(mesh.normals.as_flattened()) {
            self.normals += mesh.normals.iter().filter(|n| !all_finite(&n[..])).count();
        }
        normalize_normals(mesh);
        self.attributes += zero_non_finite(mesh);
    }

    /// Warnings with the numbers of repairs.
    pub fn warnings(self, path: &Path) -> impl Iterator<Item = Warning> {
        let Repairs { triangles, attributes, normals } = self;
        let dropped = format!("{triangles} triangles with corners that are not finite numbers were dropped");
        let zeroed =
            format!("{attributes} texture coordinates, colours or attributes that are not finite became 0");
        let replaced = format!("{normals} normals that are not finite were replaced by face normals");
        let counted = [
            (triangles, "corners-not-finite", dropped),
            (attributes, "attributes-not-finite", zeroed),
            (normals, "normals-not-finite", replaced),
        ]
        .into_iter()
        .filter(|(n, ..)| *n > 0);
        counted.map(|(_, code, message)| Warning::new(path, "", (code, message)))
    }
}

/// Removes triangles with non-finite vertices, which are moved to the origin; returns their number.
pub(super) fn remove_non_finite_triangles(mesh: &mut Mesh) -> usize {
    let is_bad: Vec<bool> = mesh.positions.iter().map(|p| !all_finite(p)).collect();
    let before = mesh.triangles.len();
    retain_triangles(mesh, |mesh, t| {
        !mesh.triangles[t].iter().any(|&i| is_bad.get(i as usize) == Some(&true))
    });
    for (p, _) in mesh.positions.iter_mut().zip(&is_bad).filter(|(_, is_bad)| **is_bad) {
        *p = [0.0; 3];
    }
    before - mesh.triangles.len()
}

/// Removes triangles, unless `keep` is true for a triangle's index, and updates the parts, which may become empty.
pub(super) fn retain_triangles(mesh: &mut Mesh, keep: impl Fn(&Mesh, usize) -> bool) {
    let is_kept: Vec<bool> = (0..mesh.triangles.len()).map(|t| keep(mesh, t)).collect();
    let mut first_triangle = 0;
    for part in &mut mesh.parts {
        part.triangle_count = is_kept[part.triangles()].iter().filter(|is_kept| **is_kept).count() as u32;
        part.first_triangle = first_triangle;
        first_triangle += part.triangle_count;
    }
    let mut is_kept = is_kept.into_iter();
    mesh.triangles.retain(|_| is_kept.next() == Some(true));
}

/// Sets non-finite texture coordinates, colours and attributes to 0; returns their number.
pub(super) fn zero_non_finite(mesh: &mut Mesh) -> usize {
    let mut count = 0;
    let uv_sets = mesh.uv_sets.iter_mut().map(|set| set.as_flattened_mut());
    let attributes = mesh.attributes.iter_mut().map(|attribute| &mut attribute.values[..]);
    let lists = uv_sets.chain(attributes).chain([mesh.colors.as_flattened_mut()]);
    for list in lists.filter(|list| !all_finite(list)) {
        let unusable = list.iter_mut().filter(|x| !x.is_finite());
        count += unusable.map(|x| *x = 0.0).count();
    }
    count
}

/// Integer colours up to this value aren't taken as 8-bit levels: all would be nearly black.
const MAX_NON_BYTE: f32 = 15.0;

/// Limits vertex colours to 0..1, so that surfaces conserve energy: integers with large values are 8-bit levels 0 to 255
/// (sRGB-encoded if `is_encoded`), all others are clamped. Returns the code and message of a warning if colours changed.
/// Non-finite values are kept.
pub(super) fn bound_colors<const N: usize>(
    colors: &mut [[f32; N]],
    is_encoded: bool,
) -> Option<(&'static str, String)> {
    let beyond = |c: &&[f32; N]| c.iter().any(|v| *v < 0.0 || *v > 1.0);
    let count = colors.iter().filter(beyond).count();
    if count == 0 {
        return None;
    }
    let levels = || colors.iter().flat_map(|c| &c[..3]).filter(|v| v.is_finite());
    let (mut whole, largest) =
        (levels().map(|v| v.fract() == 0.0 && *v >= 0.0), levels().copied().fold(0.0, f32::max));
    let total = colors.len();
    if whole.all(|is_whole| is_whole) && largest > MAX_NON_BYTE {
        let alpha_scale = if colors.iter().any(|c| c.get(3).is_some_and(|a| *a > 1.0)) { 255.0 } else { 1.0 };
        for color in colors {
            for (channel, value) in color.iter_mut().enumerate() {
                let share = (*value / if channel < 3 { 255.0 } else { alpha_scale }).clamp(0.0, 1.0);
                *value = if is_encoded && channel < 3 { linear_from_srgb(share) } else { share };
            }
        }
        return Some((
            "vertex-colors-bytes",
            format!("vertex colours are integers up to {largest}: they are taken as 8-bit levels (0 to 255)"),
        ));
    }
    colors.as_flattened_mut().iter_mut().for_each(|v| *v = v.clamp(0.0, 1.0));
    Some((
        "vertex-colors-clamped",
        format!("{count} of {total} vertex colours are outside 0 to 1 and were clamped"),
    ))
}

/// Normalises normals; zero and non-finite ones are replaced by the normal of an adjacent triangle.
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
        let [a, b, c] = mesh.corners_f64(*t);
        if let Some(face) = (b - a).cross(c - a).try_normalize() {
            for i in t.map(|i| i as usize).into_iter().filter(|&i| missing[i]) {
                mesh.normals[i] = face.as_vec3().to_array();
            }
        }
    }
}

/// Assigns a colour to the vertices of each triangle; vertices shared by triangles of other colours are split.
pub(super) fn color_triangles(mesh: &mut Mesh, colors: &[[f32; 4]]) {
    let mut vertex_colors: Vec<Option<[f32; 4]>> = vec![None; mesh.positions.len()];
    let mut others: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
    for (triangle, color) in mesh.triangles.iter_mut().zip(colors) {
        for vertex in triangle {
            let old = *vertex as usize;
            if *vertex_colors[old].get_or_insert(*color) == *color {
                continue;
            }
            *vertex = *others.entry((*vertex, color.map(f32::to_bits))).or_insert_with(|| {
                vertex_colors.push(Some(*color));
                mesh.positions.push(mesh.positions[old]);
                let normal = mesh.normals.get(old).copied();
                mesh.normals.extend(normal);
                mesh.uv_sets.iter_mut().for_each(|set| set.push(set[old]));
                mesh.attributes.iter_mut().for_each(|attribute| attribute.push_copy(old));
                // At most one vertex per corner; their number fits u32, or the mesh is rejected.
                (mesh.positions.len() - 1) as u32
            });
        }
    }
    mesh.colors = vertex_colors.into_iter().map(|color| color.unwrap_or([1.0; 4])).collect();
}

/// Replaces the meshes of instances with a singular transform (a scale of 0 along one axis) by flattened copies. Instances that
/// collapse to a line or a point are dropped with a warning.
pub(super) fn flatten_singular_instances(path: &Path, loaded: &mut Loaded) {
    let Loaded { scene, warnings, .. } = loaded;
    let Scene { meshes, instances, .. } = scene;
    instances.retain_mut(|instance| {
        let transform = &mut instance.world_from_object;
        if transform.matrix3.determinant() != 0.0 || matches!(instance.motion, Motion::Keyed(_)) {
            return true;
        }
        let flat = flattened(&meshes[instance.mesh.index()], &transform.matrix3);
        if flat.triangles.is_empty() {
            let message = "collapses its mesh to a line or a point (a scale of 0): the instance is dropped";
            warnings.push(Warning::new(path, &instance.name, ("mesh-degenerate", message)));
            return false;
        }
        instance.mesh = MeshId(meshes.len() as u32);
        *transform = DAffine3::from_translation(transform.translation);
        meshes.push(flat);
        true
    });
}

/// A mesh under a singular transform, without the triangles that become degenerate, and without normals.
fn flattened(mesh: &Mesh, transform: &DMat3) -> Mesh {
    let moved = |p: &[f32; 3]| *transform * DVec3::from(p.map(f64::from));
    let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|p| moved(p).as_vec3().to_array()).collect();
    let (normals, tangents) = (Vec::new(), Vec::new());
    let mut flat = Mesh { positions, normals, tangents, ..mesh.clone() };
    let size = flat.positions.as_flattened().iter().fold(0f32, |size, x| size.max(x.abs()));
    let min_area = f64::from(size * f32::EPSILON).powi(2);
    retain_triangles(&mut flat, |flat, t| {
        let [a, b, c] = flat.corners_f64(flat.triangles[t]);
        (b - a).cross(c - a).length() > min_area
    });
    flat.parts.retain(|part| part.triangle_count > 0);
    flat
}

/// The polygon faces of a shape in object space, counter-clockwise from outside.
pub(super) struct Faces {
    /// Positions and texture coordinates of each face's corners.
    pub faces: Vec<Vec<(DVec3, [f32; 2])>>,
}

const SQUARE: [[f32; 2]; 4] = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];

/// A box; faces in the order -x, +x, -y, +y, -z, +z.
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

/// A pyramid over a rectangle in the x-z plane centred at `base`; faces: the base, then the sides towards +z, +x, -z, -x.
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
    /// A flat-shaded mesh without parts, and the number of triangles of each face. Vertices are relative to `origin`, to
    /// preserve the precision of f32 far from the world's origin.
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

/// The scale of a similarity transform without reflection; `None` for any other transform.
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

/// A shape under a similarity transform; `None` for any other transform.
pub(super) fn placed_shape(m: &DAffine3, shape: Shape) -> Option<Shape> {
    let scale = uniform_scale(m)?;
    let turn = DMat3::from_cols(m.matrix3.x_axis / scale, m.matrix3.y_axis / scale, m.matrix3.z_axis / scale);
    Some(Shape {
        center: m.transform_point3(shape.center),
        radius: shape.radius * scale,
        rotation: DQuat::from_mat3(&turn) * shape.rotation,
        ..shape
    })
}

// Coordinates far from the origin (maps, surveys) exceed the precision of f32. Such meshes are stored relative to a local
// origin, which is added to the instance's transform in f64.

/// Maximum distance of a model from the origin, in multiples of its size: f32 then resolves at least 2^-18 of the size.
const MAX_DISTANCE: f64 = 32.0;

/// The local origin for meshes with these positions: whole metres along axes with distant coordinates, 0 along others.
pub(super) fn distant_origin<'a>(positions: impl Iterator<Item = &'a [f32; 3]>) -> DVec3 {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for p in positions {
        let p = DVec3::from(p.map(f64::from));
        if p.is_finite() {
            (min, max) = (min.min(p), max.max(p));
        }
    }
    if !(min.is_finite() && max.is_finite()) {
        return DVec3::ZERO;
    }
    let (size, middle) = ((max - min).length(), ((min + max) * 0.5).round());
    let is_far = |axis: usize| {
        min[axis].abs().max(max[axis].abs()) > MAX_DISTANCE * size && middle[axis].abs() >= 256.0
    };
    DVec3::from_array([0, 1, 2].map(|axis| if is_far(axis) { middle[axis] } else { 0.0 }))
}

/// Adds a local origin to the transforms of all instances, with a note.
pub(super) fn place_at_origin(path: &Path, origin: DVec3, loaded: &mut Loaded) {
    if origin == DVec3::ZERO {
        return;
    }
    for instance in &mut loaded.scene.instances {
        instance.world_from_object.translation += origin;
    }
    loaded.offset = origin;
    let [x, y, z] = origin.to_array();
    let message = format!(
        "the coordinates exceed single precision: they are stored relative to ({x}, {y}, {z}); cameras use the file's \
        coordinates"
    );
    loaded.notes.push(Warning::new(path, "", message));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(mesh: &Mesh) -> f64 {
        let corner = |i: u32| DVec3::from(mesh.positions[i as usize].map(f64::from));
        mesh.triangles.iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0).sum()
    }

    #[test]
    fn faces_of_two_colors_share_no_vertices() {
        let mut mesh = Mesh { positions: vec![[0.0; 3], [1.0; 3], [2.0; 3], [3.0; 3]], ..Mesh::default() };
        mesh.triangles = vec![[0, 1, 2], [1, 2, 3], [0, 2, 3]];
        let (red, blue) = ([1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]);
        color_triangles(&mut mesh, &[red, blue, red]);
        assert_eq!(mesh.triangles, [[0, 1, 2], [4, 5, 3], [0, 2, 6]]);
        assert_eq!(mesh.colors, [red, red, red, blue, blue, blue, red]);
        assert_eq!(mesh.positions[4..], [[1.0; 3], [2.0; 3], [3.0; 3]]);
    }

    #[test]
    fn closed_shapes_face_outwards_and_have_their_volume() {
        let (b, counts) =
            box_faces(DVec3::new(-1.0, 0.0, 2.0), DVec3::new(1.0, 3.0, 6.0)).to_mesh("b", DVec3::ZERO);
        assert!((volume(&b) - 24.0).abs() < 1e-5);
        assert_eq!(counts, [2; 6]);
        let (p, counts) = pyramid_faces(DVec3::Y, [2.0, 3.0], 5.0).to_mesh("p", DVec3::ZERO);
        assert!((volume(&p) - 10.0).abs() < 1e-5);
        assert_eq!(counts, [2, 1, 1, 1, 1]);
    }
}
