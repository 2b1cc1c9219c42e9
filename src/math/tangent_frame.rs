//! Tangent frames and the transform of normals.

use super::{DMat3, Mat3, Vec2, Vec3};

/// A tangent frame with x along `tangent` (orthogonalised to `n`) and y = `handedness` (n x x).
pub fn frame_from_tangent(tangent: Vec3, n: Vec3, handedness: f32) -> Option<Mat3> {
    let t = (tangent - n * n.dot(tangent)).try_normalize()?;
    Some(Mat3::from_cols(t, n.cross(t) * handedness.signum(), n))
}

/// A tangent frame from the texture coordinates of a triangle: x towards increasing u, y towards decreasing v (up in the image).
pub fn uv_frame(corners: [Vec3; 3], uv: [Vec2; 3], n: Vec3) -> Option<Mat3> {
    let (e1, e2) = (corners[1] - corners[0], corners[2] - corners[0]);
    let (d1, d2) = (uv[1] - uv[0], uv[2] - uv[0]);
    let determinant = d1.x * d2.y - d1.y * d2.x;
    let tangent = (e1 * d2.y - e2 * d1.y) * determinant.signum();
    let up = (e1 * d2.x - e2 * d1.x) * determinant.signum();
    frame_from_tangent(tangent, n, if n.cross(tangent).dot(up) < 0.0 { -1.0 } else { 1.0 })
}

/// The inverse transpose, scaled so that its longest column has length 1.
pub fn normal_matrix(m: &DMat3) -> DMat3 {
    let n = m.inverse().transpose();
    let largest = n.x_axis.length().max(n.y_axis.length()).max(n.z_axis.length());
    n * (1.0 / largest)
}
