//! What files get wrong in the numbers of meshes: each repair is counted in a warning. Sound meshes cost one look.

use super::report::Report;
use crate::load::shapes::{clear_unusable, normalize_normals};
use crate::math::all_finite;
use crate::scene::Mesh;

/// Largest difference of a normal's squared length from 1 that is left alone.
const UNIT_TOLERANCE: f32 = 1e-4;

/// Drops triangles with corners that are not finite, and mends normals, tangents, colours and coordinates.
pub(super) fn repair(mesh: &mut Mesh, at: &str, report: &mut Report) {
    if !all_finite(mesh.positions.as_flattened()) {
        let dropped = drop_triangles(mesh);
        report.warn(at, format!("{dropped} triangles with corners that are not finite numbers were dropped"));
    }
    // Without a branch inside, so that many are looked at in one step; NaN is no unit length.
    let is_unit = |[x, y, z]: [f32; 3]| (x * x + y * y + z * z - 1.0).abs() <= UNIT_TOLERANCE;
    if !mesh.normals.iter().fold(true, |all, &n| all & is_unit(n)) {
        normalize_normals(mesh);
        report.warn(at, "has normals that are not of unit length; they were normalised");
    }
    let zeroed = clear_unusable(mesh);
    if zeroed > 0 {
        report.warn(at, format!("{zeroed} texture coordinates or colours that are not finite became 0"));
    }
    if !all_finite(mesh.tangents.as_flattened()) {
        mesh.tangents.clear();
        report.warn(at, "has tangents that are not finite; they are made from its texture coordinates");
    }
    for tangent in &mut mesh.tangents {
        tangent[3] = 1f32.copysign(tangent[3]);
    }
}

/// Removes triangles that use vertices which are not finite (these become the origin); returns how many.
fn drop_triangles(mesh: &mut Mesh) -> usize {
    let usable: Vec<bool> = mesh.positions.iter().map(|p| all_finite(p)).collect();
    let before = mesh.triangles.len();
    let mut kept = Vec::with_capacity(before);
    for part in &mut mesh.parts {
        let first = part.first_triangle as usize;
        let old = &mesh.triangles[first..first + part.triangle_count as usize];
        part.first_triangle = kept.len() as u32;
        kept.extend(old.iter().filter(|t| t.iter().all(|&i| usable[i as usize])));
        part.triangle_count = kept.len() as u32 - part.first_triangle;
    }
    mesh.triangles = kept;
    for (p, _) in mesh.positions.iter_mut().zip(&usable).filter(|(_, usable)| !**usable) {
        *p = [0.0; 3];
    }
    before - mesh.triangles.len()
}
