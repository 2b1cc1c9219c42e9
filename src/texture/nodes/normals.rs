//! Normals of maps and bumps, as Cycles has them.

use super::math::normalize;
use crate::math::Vec3;
use crate::scene::nodes::NormalSpace;

fn vector(v: &[f32]) -> Vec3 {
    Vec3::new(v[0], v[1], v[2])
}

fn mixed(a: Vec3, b: Vec3, share: f32) -> Vec3 {
    a + (b - a) * share
}

/// A normal from a map: of strength, colour, tangent frame with its presence, shading normal, rows of the transform from the world to the
/// object, and the side that is seen.
pub fn mapped(space: NormalSpace, v: &[f32; 30]) -> [f32; 3] {
    let (strength, color, frame, own, rows) = (v[0], &v[1..4], &v[4..14], vector(&v[14..17]), &v[17..29]);
    let side = if v[29] != 0.0 { -1.0 } else { 1.0 };
    let mut n = vector(color) * 2.0 - Vec3::ONE;
    let normal = if space == NormalSpace::Tangent {
        if frame[9] == 0.0 {
            return own.to_array();
        }
        let n = Vec3::new(n.x * strength, n.y * strength, 1.0 + (n.z - 1.0) * strength.clamp(0.0, 1.0));
        let turned = vector(&frame[0..3]) * n.x + vector(&frame[3..6]) * n.y + vector(&frame[6..9]) * n.z;
        turned.normalize_or_zero() * side
    } else {
        if matches!(space, NormalSpace::BlenderObject | NormalSpace::BlenderWorld) {
            (n.y, n.z) = (-n.y, -n.z);
        }
        if matches!(space, NormalSpace::Object | NormalSpace::BlenderObject) {
            // Normals go to the world by the transposed inverse.
            let column = |i: usize| Vec3::new(rows[i], rows[4 + i], rows[8 + i]);
            n = Vec3::new(column(0).dot(n), column(1).dot(n), column(2).dot(n));
        }
        let n = n.normalize_or_zero() * side;
        if strength == 1.0 { n } else { mixed(own, n, strength.max(0.0)).normalize_or_zero() }
    };
    if normal == Vec3::ZERO { own.to_array() } else { normal.to_array() }
}

/// A normal that leans by the slope of heights: of strength, distance, the heights here and beside both ways, the normal, and the two steps
/// (Mikkelsen 2010, "Bump Mapping Unparametrized Surfaces on the GPU").
pub fn bumped(invert: bool, filter_width: f32, v: &[f32; 14]) -> [f32; 3] {
    let (strength, distance) = (v[0].max(0.0), if invert { -v[1] } else { v[1] });
    let (here, along_a, along_b) = (v[2], v[3], v[4]);
    let (n, a, b) = (vector(&v[5..8]), vector(&v[8..11]), vector(&v[11..14]));
    let (ra, rb) = (b.cross(n), n.cross(a));
    let determinant = a.dot(ra);
    let gradient = ra * (along_a - here) + rb * (along_b - here);
    let leaning = n * (filter_width * determinant.abs()) - gradient * (distance * determinant.signum());
    let leaning = Vec3::from_array(normalize(leaning.to_array()));
    if leaning == Vec3::ZERO || !leaning.is_finite() {
        return n.to_array();
    }
    mixed(n, leaning, strength).normalize_or_zero().to_array()
}
