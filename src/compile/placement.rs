//! How placed geometries get from their space to the world.

use super::geometry::{Placement, Transform};
use crate::math::{DAffine3, DMat3, Mat3, gamma};
use crate::shape::Surface;

impl Transform {
    /// That of a matrix.
    pub(super) fn of(world_from_object: &DAffine3) -> Transform {
        let DAffine3 { matrix3, translation } = world_from_object;
        Transform {
            linear: matrix3.as_mat3(),
            translation: translation.as_vec3(),
            normal_from_object: normal_matrix(matrix3).as_mat3(),
        }
    }

    /// The matrix again, as far as it is kept.
    pub(super) fn to_double(self) -> DAffine3 {
        DAffine3 { matrix3: self.linear.as_dmat3(), translation: self.translation.as_dvec3() }
    }
}

/// The inverse transpose, scaled so that its largest column has length 1.
pub(super) fn normal_matrix(m: &DMat3) -> DMat3 {
    let n = m.inverse().transpose();
    let largest = n.x_axis.length().max(n.y_axis.length()).max(n.z_axis.length());
    n * (1.0 / largest)
}

impl Placement {
    #[inline]
    pub(super) fn surface_to_world(&self, s: &Surface) -> Surface {
        let Transform { linear: m, translation, normal_from_object } = self.world_from_object;
        let p = m * s.p + translation;
        let magnitude = Mat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
        let p_error = magnitude * (s.p_error + s.p.abs() * gamma(4)) + translation.abs() * gamma(4);
        // A mirror image of the front is the front of the mirror image.
        let ng = (normal_from_object * s.ng).normalize();
        let ns = (normal_from_object * s.ns).normalize();
        Surface { p, p_error, ng, ns, material: self.material.unwrap_or(s.material) }
    }
}
