//! Reflectance of smooth interfaces.

use crate::color::Rgb;
use crate::scene::FresnelModel;

/// Schlick's weight of the reflectance at grazing incidence, (1 - cos)^5 (Schlick 1994).
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

/// Reflection and refraction of unpolarised light at a smooth interface.
#[derive(Clone, Copy, Debug)]
pub struct Interface {
    /// Reflectance, 0..1; 1 for total reflection.
    pub reflectance: f32,
    /// Cosine of the refracted direction; 0 for total reflection.
    pub cos_transmitted: f32,
}

/// Fresnel's equations. `eta` is the index of refraction of the far side over that of the incident side; `cos_theta` in 0..1.
#[inline(always)]
pub fn exact(cos_theta: f32, eta: f32) -> Interface {
    // Squares of smaller cosines underflow.
    let cos_theta = if cos_theta > 1e-18 { cos_theta } else { 1e-18 };
    // (eta cos_t)^2 = eta^2 - sin^2, factored to avoid cancellation for eta near 1.
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
    // |n^2 - sin^2| for the complex index n, and the real part of the root of n^2 - sin^2.
    let norm = (t * t + 4.0 * eta2 * k2).sqrt();
    let a = (0.5 * (norm + t)).max(0.0).sqrt();
    let (sum, cross) = (norm + cos_squared, 2.0 * a * cos_theta);
    let s = (sum - cross) / (sum + cross).max(1e-30);
    let (sum, cross) = (cos_squared * norm + sin_squared * sin_squared, cross * sin_squared);
    let p = s * (sum - cross) / (sum + cross).max(1e-30);
    (0.5 * (s + p)).clamp(0.0, 1.0)
}

/// Schlick's approximation with the cosine on the optically thinner side, for which it was made: reciprocal, and with total internal
/// reflection.
#[inline(always)]
pub fn schlick_dielectric(cos_theta: f32, eta: f32) -> Interface {
    let cos_transmitted = exact(cos_theta, eta).cos_transmitted;
    let f0 = f0_from_eta(eta);
    let cosine = if eta < 1.0 { cos_transmitted } else { cos_theta };
    Interface { reflectance: f0 + (1.0 - f0) * schlick_weight(cosine), cos_transmitted }
}

/// Fresnel term of a dielectric layer: the interpolation weight between F0 and F90.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LayerFresnel {
    /// Schlick's (1 - cos)^5.
    Schlick,
    /// The Fresnel curve of an index of refraction.
    Exact(DielectricCurve),
}

impl LayerFresnel {
    /// Constant reflectance at all angles.
    pub const CONSTANT: LayerFresnel = LayerFresnel::Exact(DielectricCurve { amplitude: 0.0 });

    /// The Fresnel term of a layer by a model and its index of refraction (see [`DielectricCurve::of_ior`]).
    #[inline(always)]
    pub fn new(model: FresnelModel, ior: f32) -> LayerFresnel {
        match model {
            FresnelModel::Schlick => LayerFresnel::Schlick,
            FresnelModel::Exact => LayerFresnel::Exact(DielectricCurve::of_ior(ior)),
        }
    }

    /// The interpolation weight: 0 at normal, 1 at grazing incidence.
    #[inline(always)]
    pub fn weight(self, cosine: f32) -> f32 {
        match self {
            LayerFresnel::Schlick => schlick_weight(cosine),
            LayerFresnel::Exact(curve) => curve.weight(cosine),
        }
    }

    /// Reflectance interpolated between `f0` at normal and `f90` at grazing incidence.
    #[inline(always)]
    pub fn reflectance(self, f0: Rgb, f90: Rgb, cosine: f32) -> Rgb {
        f0 + (f90 - f0) * self.weight(cosine)
    }
}

/// Normalised Fresnel curve of a dielectric, from outside: with F the reflectance of unpolarised light, the weight
/// (F(cos) - F(1)) / (1 - F(1)) replaces Schlick's (1 - cos)^5 in the interpolation between F0 and F90.
///
/// F is monotonic if F(1) is at most 1/3, that is for indices up to 2 + sqrt(3) = 3.73. For higher indices F first falls, which would
/// give negative reflectance for a small F0, so they use the curve of that index.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DielectricCurve {
    /// Reflected amplitude at normal incidence, (n - 1) / (n + 1), from 0 to 1 / sqrt(3).
    pub amplitude: f32,
}

/// Reflected amplitude at normal incidence for an index of 2 + sqrt(3): 1 / sqrt(3).
pub(super) const MAX_AMPLITUDE: f32 = 0.577_350_26;

impl DielectricCurve {
    /// The curve of a relative index of refraction; 0 stands for infinity as in KHR_materials_ior, values between 0 and 1 for their
    /// inverse.
    #[inline(always)]
    pub fn of_ior(ior: f32) -> DielectricCurve {
        DielectricCurve { amplitude: ((ior - 1.0) / (ior + 1.0)).abs().min(MAX_AMPLITUDE) }
    }

    /// The Fresnel reflectance of unpolarised light. `cosine` in 0..1.
    ///
    /// With k = n^2 and g = n cos_t, so that g^2 = k - 1 + c^2, the amplitudes (c - g) / (c + g) and (k c - g) / (k c + g)
    /// have the mean square ((k - 1) / d)^2 (sin^4 + c^2 g^2) with d = k c^2 + (k + 1) c g + g^2: one root, one division, and no
    /// cancellation as n goes to 1. Here d and g are scaled by powers of p = 1 - q, with q the amplitude at normal incidence and
    /// n = (1 + q) / (1 - q).
    #[inline(always)]
    pub fn reflectance(self, cosine: f32) -> f32 {
        let q = self.amplitude;
        let (p, m) = (1.0 - q, 1.0 + q);
        let (pp, mm, cc) = (p * p, m * m, cosine * cosine);
        let sin_squared = 1.0 - cc;
        let gg = 4.0 * q + pp * cc;
        let d = p * (mm * cc + gg) + (mm + pp) * (cosine * gg.sqrt());
        let ratio = 4.0 * q / if d > 1e-30 { d } else { 1e-30 };
        ratio * ratio * (pp * (sin_squared * sin_squared) + cc * gg)
    }

    /// The interpolation weight: 0 at normal, 1 at grazing incidence. `cosine` may exceed 1 by rounding.
    #[inline(always)]
    pub fn weight(self, cosine: f32) -> f32 {
        let cosine = if cosine < 1.0 { cosine } else { 1.0 };
        let f0 = self.amplitude * self.amplitude;
        let weight = (self.reflectance(cosine) - f0) / (1.0 - f0);
        let weight = if weight > 0.0 { weight } else { 0.0 };
        if weight < 1.0 { weight } else { 1.0 }
    }
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
    fn reflectance_is_reciprocal() {
        // Not closer to grazing incidence, where the refracted cosine has too few digits to recover the incident one.
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

#[cfg(test)]
mod dielectric_curve_tests {
    use super::*;
    use crate::bsdf::reference::fresnel;

    fn curve_in_f64(cosine: f64, ior: f64) -> f64 {
        let f0 = fresnel(1.0, ior).0;
        (fresnel(cosine, ior).0 - f0) / (1.0 - f0)
    }

    #[test]
    fn curves_equal_fresnels_equations() {
        let mut largest = [0.0f64; 2];
        for i in 0..=400 {
            let ior = 1.0 + 2.732 * (f64::from(i) / 400.0).powi(3);
            let curve = DielectricCurve::of_ior(ior as f32);
            // The index after rounding to single precision.
            let amplitude = f64::from(curve.amplitude);
            let rounded = (1.0 + amplitude) / (1.0 - amplitude);
            for k in 0..=1000 {
                let cosine = (k as f32 / 1000.0).powi(2);
                let c = f64::from(cosine);
                // An index of 1 in single precision reflects nothing.
                if rounded == 1.0 {
                    assert_eq!(curve.weight(cosine), 0.0);
                    continue;
                }
                let reflectance = (f64::from(curve.reflectance(cosine)) - fresnel(c, rounded).0).abs();
                let weight = (f64::from(curve.weight(cosine)) - curve_in_f64(c, rounded)).abs();
                largest = [largest[0].max(reflectance), largest[1].max(weight)];
            }
        }
        println!("largest errors: {largest:?}");
        assert!(largest.iter().all(|e| *e < 1e-6), "{largest:?}");
    }

    #[test]
    fn curves_rise_from_0_to_1() {
        for ior in [0.0, 1.0 + 1e-6, 1.001, 1.05, 1.33, 1.5, 2.4, 3.0, 3.7, 4.0, 10.0, 1e6, f32::MAX] {
            let curve = DielectricCurve::of_ior(ior);
            assert_eq!(curve.weight(1.0 + 1e-6), curve.weight(1.0), "{ior}");
            assert!((curve.weight(0.0) - 1.0).abs() < 1e-6, "{ior}: {}", curve.weight(0.0));
            assert!(curve.weight(1.0) < 1e-6, "{ior}");
            let mut before = 1.0f32;
            for i in 0..=1000 {
                let weight = curve.weight(i as f32 / 1000.0);
                assert!((0.0..=before + 1e-6).contains(&weight), "{ior} {i}: {weight} after {before}");
                before = weight;
            }
        }
    }

    /// Glass of index 1.5 reflects 8.9 % at 60 degrees; Schlick's approximation gives 7.0 %.
    #[test]
    fn glass_at_60_degrees() {
        // cos_t = sqrt(1 - 3/4 / 9/4) = sqrt(2/3); both amplitudes by hand.
        let t = (2.0f64 / 3.0).sqrt();
        let (s, p) = ((0.5 - 1.5 * t) / (0.5 + 1.5 * t), (0.75 - t) / (0.75 + t));
        let exact = 0.5 * (s * s + p * p);
        let found = f64::from(DielectricCurve::of_ior(1.5).reflectance(0.5));
        assert!((found - exact).abs() < 1e-7 && (exact - 0.0892).abs() < 1e-4, "{found} {exact}");
        let schlick = schlick_weight(0.5) * 0.96 + 0.04;
        assert!((schlick - 0.07).abs() < 1e-6);
    }
}
