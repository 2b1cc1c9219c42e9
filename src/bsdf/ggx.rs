//! The GGX distribution of microfacet normals (Walter et al. 2007) with Smith's height-correlated shadowing (Heitz
//! 2014), isotropic. Directions have z above 0.

use crate::math::{Vec3, poly};
use std::f32::consts::PI;

/// Below this alpha a surface is treated as an exact mirror: its lobe is narrower than 0.1 degrees.
pub const MIN_ALPHA: f32 = 1e-3;

/// Smallest cosine that formulas divide by.
pub const MIN_COS: f32 = 1e-6;

/// A direction turned to the upper side, where formulas hold, and kept off the horizon.
#[inline(always)]
pub fn above(wo: Vec3) -> Vec3 {
    let z = wo.z.abs();
    Vec3::new(wo.x, wo.y, if z > MIN_COS { z } else { MIN_COS })
}

/// sqrt(alpha^2 + (1 - alpha^2) z^2), the root in Smith's masking: G1 = 2 z / (z + root).
#[inline(always)]
pub fn smith_root(z: f32, alpha_squared: f32) -> f32 {
    (alpha_squared + (1.0 - alpha_squared) * z * z).sqrt()
}

/// A visible normal: reflects `wo` to a direction drawn from a spherical cap (Dupuy, Benyoub 2023, listing 3). `alpha` is
/// the roughness along x and along y.
#[inline(always)]
pub fn sample_visible_normal(wo: Vec3, alpha: [f32; 2], u: [f32; 2]) -> Vec3 {
    let [ax, ay] = alpha;
    let stretched = Vec3::new(wo.x * ax, wo.y * ay, wo.z).normalize();
    let z = (1.0 - u[1]) * (1.0 + stretched.z) - stretched.z;
    let sin_squared = (1.0 - z) * (1.0 + z);
    let sine = if sin_squared > 0.0 { sin_squared } else { 0.0 }.sqrt();
    let (s, c) = poly::sin_cos_turns(u[0]);
    let half = Vec3::new(sine * c, sine * s, z) + stretched;
    let z = if half.z > 1e-12 { half.z } else { 1e-12 };
    Vec3::new(half.x * ax, half.y * ay, z).normalize()
}

/// Everything about a pair of directions that does not depend on the colour.
#[derive(Clone, Copy, Debug)]
pub struct Reflection {
    /// D G2 / (4 wo.z), that is f |cos| for a reflectance of 1.
    pub f_cos: f32,
    /// Density per solid angle of `wi` by visible normals.
    pub pdf_solid_angle: f32,
    /// Cosine between a direction and the half vector.
    pub cos_half: f32,
}

/// Evaluates a pair of directions with z above 0.
#[inline(always)]
pub fn reflection(wo: Vec3, wi: Vec3, alpha: f32) -> Reflection {
    let alpha_squared = alpha * alpha;
    let half = wo + wi;
    let length_squared = half.length_squared();
    let (zo, zi) = (wo.z.max(MIN_COS), wi.z.max(MIN_COS));
    // D with the unnormalised half vector: sin^2 + alpha^2 cos^2 does not cancel for small alpha.
    let spread = half.x * half.x + half.y * half.y + alpha_squared * half.z * half.z;
    let ratio = length_squared / spread.max(1e-30);
    let d = alpha_squared * ratio * ratio * (1.0 / PI);
    let (root_o, root_i) = (smith_root(zo, alpha_squared), smith_root(zi, alpha_squared));
    Reflection {
        f_cos: d * 0.5 * zi / (zi * root_o + zo * root_i),
        pdf_solid_angle: d * 0.5 / (zo + root_o),
        cos_half: 0.5 * length_squared.sqrt(),
    }
}
