//! Reflectance of smooth interfaces.

use crate::math::Vec3;

/// (1 - cos)^5, the weight of grazing reflectance (Schlick 1994).
#[inline(always)]
pub fn schlick_weight(cos_theta: f32) -> f32 {
    let m = 1.0 - cos_theta;
    let m = if m > 0.0 { m } else { 0.0 };
    let m2 = m * m;
    m2 * m2 * m
}

/// Schlick's interpolation from `f0` at normal to `f90` at grazing incidence.
#[inline(always)]
pub fn schlick(f0: Vec3, f90: Vec3, cos_theta: f32) -> Vec3 {
    f0 + (f90 - f0) * schlick_weight(cos_theta)
}

/// Reflectance at normal incidence of an interface of relative index `eta`.
#[inline(always)]
pub fn f0_from_eta(eta: f32) -> f32 {
    let r = (eta - 1.0) / (eta + 1.0);
    r * r
}

/// Reflectance of unpolarised light, and the cosine on the other side (0 for total reflection).
#[derive(Clone, Copy, Debug)]
pub struct Interface {
    /// Share reflected.
    pub reflectance: f32,
    /// Cosine of the refracted direction.
    pub cos_transmitted: f32,
}

/// Fresnel's equations. `eta` is the index of the other side over that of the incident side; `cos_theta` in 0..1.
#[inline(always)]
pub fn exact(cos_theta: f32, eta: f32) -> Interface {
    // (eta cos_t)^2 = eta^2 - sin^2, with the difference factored so that eta near 1 keeps its digits.
    let squared = (eta - 1.0) * (eta + 1.0) + cos_theta * cos_theta;
    let total = squared <= 0.0;
    let g = if total { 0.0 } else { squared }.sqrt();
    // In terms of g = eta cos_t: r_s = (c - g) / (c + g), r_p = (eta^2 c - g) / (eta^2 c + g).
    let eta2c = eta * eta * cos_theta;
    let s = (cos_theta - g) / (cos_theta + g).max(1e-30);
    let p = (eta2c - g) / (eta2c + g).max(1e-30);
    let reflectance = if total { 1.0 } else { 0.5 * (s * s + p * p) };
    Interface { reflectance, cos_transmitted: g / eta }
}

/// Schlick's approximation with the cosine on the optically thinner side, where it is meant to be used, so that both
/// directions of a path have the same reflectance and total reflection is kept.
#[inline(always)]
pub fn schlick_dielectric(cos_theta: f32, eta: f32) -> Interface {
    let cos_transmitted = exact(cos_theta, eta).cos_transmitted;
    let f0 = f0_from_eta(eta);
    let cosine = if eta < 1.0 { cos_transmitted } else { cos_theta };
    Interface { reflectance: f0 + (1.0 - f0) * schlick_weight(cosine), cos_transmitted }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_reflectances() {
        assert!((exact(1.0, 1.5).reflectance - 0.04).abs() < 1e-7);
        assert!((exact(1.0, 1.0 / 1.5).reflectance - 0.04).abs() < 1e-7);
        // Brewster's angle: only s-polarised light is reflected, ((n^2 - 1) / (n^2 + 1))^2 / 2.
        let brewster = 1.5f32.atan().cos();
        let expected = 0.5 * (1.25f32 / 3.25).powi(2);
        assert!((exact(brewster, 1.5).reflectance - expected).abs() < 1e-6);
        // Grazing, and beyond the critical angle (cos = sqrt(1 - 1 / n^2)).
        assert_eq!(exact(0.0, 1.5).reflectance, 1.0);
        let critical = (1.0f32 - 1.0 / 2.25).sqrt();
        assert_eq!(exact(critical * 0.999, 1.0 / 1.5).reflectance, 1.0);
        assert!(exact(critical * 1.001, 1.0 / 1.5).reflectance < 1.0);
        assert_eq!(schlick_dielectric(critical * 0.999, 1.0 / 1.5).reflectance, 1.0);
        // 45 degrees into glass.
        assert!((exact(0.5f32.sqrt(), 1.5).reflectance - 0.050_239_9).abs() < 1e-6);
    }

    #[test]
    fn both_sides_reflect_the_same_share() {
        // Nearer to grazing incidence the cosine behind the interface no longer holds the digits of the one before it.
        for i in 5..100 {
            let c = i as f32 / 100.0;
            for model in [exact, schlick_dielectric] {
                let there = model(c, 1.7);
                let back = model(there.cos_transmitted, 1.0 / 1.7);
                assert!((there.reflectance - back.reflectance).abs() < 1e-5, "{c}");
                assert!((back.cos_transmitted - c).abs() < 1e-5, "{c}");
            }
        }
    }
}
