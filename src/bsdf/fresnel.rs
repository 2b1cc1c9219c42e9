//! Reflectance of smooth interfaces.

use crate::color::Rgb;

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
pub fn schlick(f0: Rgb, f90: Rgb, cos_theta: f32) -> Rgb {
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
    // Smaller cosines have squares that are too small to be numbers.
    let cos_theta = if cos_theta > 1e-18 { cos_theta } else { 1e-18 };
    // (eta cos_t)^2 = eta^2 - sin^2, with the difference factored so that eta near 1 keeps its digits.
    let squared = (eta - 1.0) * (eta + 1.0) + cos_theta * cos_theta;
    let total = squared < 0.0;
    let g = if total { 0.0 } else { squared }.sqrt();
    // In terms of g = eta cos_t: r_s = (c - g) / (c + g), r_p = (eta^2 c - g) / (eta^2 c + g).
    let eta2c = eta * eta * cos_theta;
    let s = (cos_theta - g) / (cos_theta + g).max(1e-30);
    let p = (eta2c - g) / (eta2c + g).max(1e-30);
    let reflectance = if total { 1.0 } else { 0.5 * (s * s + p * p) };
    Interface { reflectance, cos_transmitted: g / eta }
}

/// Reflectance of unpolarised light on a metal of index of refraction `eta + i k`, against vacuum (Born, Wolf 1999,
/// section 14.4). `cos_theta` in 0..1.
#[inline(always)]
pub fn conductor(cos_theta: f32, eta: f32, k: f32) -> f32 {
    let cos_squared = cos_theta * cos_theta;
    let sin_squared = (1.0 - cos_squared).max(0.0);
    let (eta2, k2) = (eta * eta, k * k);
    let t = eta2 - k2 - sin_squared;
    // |n^2 - sin^2| of the complex index n, and the real part of its root.
    let norm = (t * t + 4.0 * eta2 * k2).sqrt();
    let a = (0.5 * (norm + t)).max(0.0).sqrt();
    let (sum, cross) = (norm + cos_squared, 2.0 * a * cos_theta);
    let s = (sum - cross) / (sum + cross).max(1e-30);
    let (sum, cross) = (cos_squared * norm + sin_squared * sin_squared, cross * sin_squared);
    let p = s * (sum - cross) / (sum + cross).max(1e-30);
    (0.5 * (s + p)).clamp(0.0, 1.0)
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
    fn metals_against_dielectrics_and_normal_incidence() {
        // Without extinction a metal is a dielectric.
        for cosine in [1.0, 0.7, 0.2, 0.0] {
            let (metal, glass) = (conductor(cosine, 1.5, 0.0), exact(cosine, 1.5).reflectance);
            assert!((metal - glass).abs() < 1e-5, "{cosine}: {metal} {glass}");
        }
        // ((eta - 1)^2 + k^2) / ((eta + 1)^2 + k^2).
        let expected = (0.8f32 * 0.8 + 9.0) / (1.2 * 1.2 + 9.0);
        assert!((conductor(1.0, 0.2, 3.0) - expected).abs() < 1e-6);
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
