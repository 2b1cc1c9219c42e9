//! Orthonormal frames around a normal.

use super::Vec3;

/// Two unit vectors that complete unit `n` to a right-handed frame, without a branch on its direction
/// (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
#[inline(always)]
pub fn orthonormal_basis(n: Vec3) -> (Vec3, Vec3) {
    let sign = 1.0f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    let s = Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x);
    let t = Vec3::new(b, sign + n.y * n.y * a, -n.y);
    (s, t)
}

/// An orthonormal frame; local z is the normal.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Local x in world space.
    pub s: Vec3,
    /// Local y in world space.
    pub t: Vec3,
    /// Local z in world space.
    pub n: Vec3,
}

impl Frame {
    /// A frame around a unit normal.
    #[inline(always)]
    pub fn from_normal(n: Vec3) -> Frame {
        let (s, t) = orthonormal_basis(n);
        Frame { s, t, n }
    }

    /// World to local.
    #[inline(always)]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// Local to world.
    #[inline(always)]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn basis_is_orthonormal_and_right_handed() {
        for n in [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Z, Vec3::Z, Vec3::new(0.6, -0.48, -0.64)] {
            let (s, t) = orthonormal_basis(n);
            assert!((s.cross(t) - n).length() < 1e-6, "{n}");
            assert!(s.dot(t).abs() < 1e-6 && (s.length() - 1.0).abs() < 1e-6);
        }
    }
}
