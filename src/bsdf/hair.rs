//! Hair and fur: a pigmented dielectric fibre with tilted cuticle scales.

use super::{
    Appearance, BsdfEval, BsdfSample, Lobe, LocalFrame, MaterialProgram, Slots, Transmissive, fresnel,
};
use crate::color::Rgb;
use crate::math::{Vec2, Vec3, poly};
use crate::scene::{ColorSlot, FloatSlot, hair_color_scale};
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// The model of Chiang, Bitterli, Tappan, Burley 2016, "A Practical and Controllable Hair and Fur Model for Production Path Tracing":
/// lobes for reflection (R), transmission (TT), one internal reflection (TRT) and the residual, each the product of a longitudinal
/// term (d'Eon et al. 2011, "An Energy-Conserving Hair Reflectance Model", eq. 7), an azimuthal term (trimmed logistic) and an
/// attenuation. Near-field form (Pharr 2016, "The Implementation of a Hair Scattering Model"): the offset h across the fibre follows
/// from the surface normal.
///
/// Energy conserving without pigment. The BSDF represents the whole fibre, so transmitted light leaves at the point of incidence. Not
/// reciprocal for tilted scales; else reciprocal on average over h.
#[derive(Clone, Copy, Debug)]
pub struct Hair {
    /// Unit vector along the fibre, in the tangent plane.
    tangent: Vec2,
    /// Square root of the absorption coefficient, per fibre radius.
    root_absorption: Rgb,
    /// Divisor of the logarithm of a colour in its conversion to absorption (Chiang et al. 2016, eq. 9).
    color_scale: f32,
    ior: f32,
    /// Longitudinal variance of R, TT, and of TRT and the residual.
    variance: [f32; 3],
    /// Scale of the azimuthal logistic, radians.
    scale: f32,
    /// Sine and cosine of the longitudinal tilt of R, TT and TRT.
    tilt: [(f32, f32); 3],
}

/// R, TT, TRT, and the residual.
const LOBES: usize = 4;

/// Minimum roughness; narrower lobes exceed single precision.
const MIN_ROUGHNESS: f32 = 0.01;

/// Minimum colour, which limits the absorption.
const MIN_COLOR: f32 = 1e-12;

/// Variance of the longitudinal lobe: Chiang et al. 2016, eq. 7.
fn longitudinal_variance(roughness: f32) -> f32 {
    let b = roughness.clamp(MIN_ROUGHNESS, 1.0);
    let b20 = power(b, 20);
    let root = 0.726 * b + 0.812 * b * b + 3.7 * b20;
    root * root
}

/// Scale of the azimuthal logistic: Chiang et al. 2016, eq. 8, times the factor between a Gaussian's standard deviation and the scale
/// of a logistic.
fn azimuthal_scale(roughness: f32) -> f32 {
    const ROOT_PI_OVER_8: f32 = 0.626_657_1;
    let b = roughness.clamp(MIN_ROUGHNESS, 1.0);
    ROOT_PI_OVER_8 * (0.265 * b + 1.194 * b * b + 5.372 * power(b, 22))
}

fn power(x: f32, n: u32) -> f32 {
    (0..n).fold(1.0, |product, _| product * x)
}

/// e^-x I0(x) with the modified Bessel function I0, for x >= 0 (Abramowitz, Stegun 1964, 9.8.1 and 9.8.2). Relative error below 5e-7.
#[inline(always)]
fn scaled_bessel(x: f32) -> f32 {
    if x < 3.75 {
        let t = x / 3.75;
        let t = t * t;
        let sum =
            ((((4.581_3e-3 * t + 3.607_68e-2) * t + 0.265_973_2) * t + 1.206_749_2) * t + 3.089_942_4) * t;
        ((sum + 3.515_622_9) * t + 1.0) * poly::exp(-x)
    } else {
        let t = 3.75 / x;
        let sum = ((3.923_77e-3 * t - 1.647_633e-2) * t + 2.635_537e-2) * t - 2.057_706e-2;
        let sum = ((sum * t + 9.162_81e-3) * t - 1.575_65e-3) * t + 2.253_19e-3;
        ((sum * t + 1.328_592e-2) * t + 0.398_942_28) / x.sqrt()
    }
}

/// A direction in fibre coordinates.
#[derive(Clone, Copy)]
struct FibreDirection {
    /// Sine of the longitudinal angle theta, the inclination from the normal plane.
    sine: f32,
    /// Cosine of theta.
    cosine: f32,
    /// Azimuth phi around the fibre from the surface normal, radians.
    angle: f32,
}

/// The closure for one view direction.
struct HairClosure {
    wo: FibreDirection,
    /// Attenuation of each lobe.
    attenuation: [Rgb; LOBES],
    /// Sampling probability of each lobe.
    probability: [f32; LOBES],
    /// Sine and cosine of the viewer's theta after the tilt of each lobe.
    tilted: [(f32, f32); LOBES],
    /// Centre of each azimuthal lobe relative to the viewer's azimuth, radians.
    center: [f32; 3],
}

/// Wraps an angle of at most a few turns to -pi..pi, radians.
#[inline(always)]
fn wrapped(angle: f32) -> f32 {
    let turns = angle * (1.0 / TAU);
    let nearest = (turns + if turns < 0.0 { -0.5 } else { 0.5 }) as i32;
    angle - nearest as f32 * TAU
}

impl Hair {
    /// Hair along a tangent. Roughness and coat are in 0..1, the tilt of the scales in radians.
    pub fn new(
        tangent: Vec2,
        color: Rgb,
        [longitudinal, radial]: [f32; 2],
        ior: f32,
        tilt: f32,
        coat: f32,
    ) -> Hair {
        let color_scale = hair_color_scale(radial);
        let v = longitudinal_variance(longitudinal);
        // d'Eon et al. 2011: TT has half the standard deviation, TRT twice.
        let variance = [longitudinal_variance(longitudinal * (1.0 - coat)), 0.25 * v, 4.0 * v];
        let multiple = |times: f32| poly::sin_cos(times * tilt);
        Hair {
            tangent: tangent.try_normalize().unwrap_or(Vec2::X),
            root_absorption: root_absorption(color, color_scale),
            color_scale,
            ior,
            variance,
            scale: azimuthal_scale(radial),
            // Marschner et al. 2003: R is tilted by -2, TT by 1 and TRT by 4 times the angle of the scales.
            tilt: [multiple(-2.0), multiple(1.0), multiple(4.0)],
        }
    }

    /// Converts a direction from the local frame to fibre coordinates. `side` is the sign of `wo.z`: from inside the fibre looks the
    /// same as from outside.
    #[inline(always)]
    fn fibre_direction(&self, w: Vec3, side: f32) -> FibreDirection {
        let t = self.tangent;
        let sine = (w.x * t.x + w.y * t.y).clamp(-1.0, 1.0);
        let across = w.y * t.x - w.x * t.y;
        let (y, z) = (across, w.z * side);
        FibreDirection { sine, cosine: (y * y + z * z).sqrt(), angle: poly::atan2(y, z) }
    }

    /// The closure for a view direction.
    #[inline]
    fn closure(&self, wo: FibreDirection) -> HairClosure {
        // Offset h across the fibre: sine of the angle gamma between normal and viewer in the normal plane.
        let (h, cos_gamma) = poly::sin_cos(wo.angle);
        let cos_gamma = cos_gamma.max(0.0);
        // The modified index of refraction in the normal plane (Marschner et al. 2003, appendix B).
        let modified = (self.ior * self.ior - wo.sine * wo.sine).max(1e-12).sqrt();
        let sin_refracted = (h * wo.cosine / modified).clamp(-1.0, 1.0);
        let cos_refracted = (1.0 - sin_refracted * sin_refracted).sqrt();
        let gamma_refracted = poly::asin(sin_refracted);
        let sin_theta = wo.sine / self.ior;
        let cos_theta = (1.0 - sin_theta * sin_theta).max(1e-6).sqrt();
        // Transmittance of one chord through the fibre.
        let length = 2.0 * cos_refracted / cos_theta;
        let transmittance = self.root_absorption.map(|root| poly::exp(-root * root * length));
        let reflected = fresnel::exact(wo.cosine * cos_gamma, self.ior).reflectance;
        let tt = transmittance * ((1.0 - reflected) * (1.0 - reflected));
        let trt = tt * transmittance * reflected;
        // The residual: a geometric series.
        let ratio = transmittance * reflected;
        let residual = (trt * ratio) / (Rgb::ONE - ratio);
        let attenuation = [Rgb::splat(reflected), tt, trt, residual];
        let sum = attenuation.iter().map(|s| s.mean()).sum::<f32>().max(f32::MIN_POSITIVE);
        let center = [0.0, 1.0, 2.0]
            .map(|p: f32| 2.0 * p * gamma_refracted - 2.0 * wo.angle.clamp(-FRAC_PI_2, FRAC_PI_2) + p * PI);
        let tilted = std::array::from_fn(|p| match self.tilt.get(p) {
            Some(&(s, c)) => (wo.sine * c + wo.cosine * s, (wo.cosine * c - wo.sine * s).abs()),
            None => (wo.sine, wo.cosine),
        });
        HairClosure { wo, attenuation, probability: attenuation.map(|s| s.mean() / sum), tilted, center }
    }

    /// The longitudinal term: d'Eon et al. 2011, eq. 7, with the exponents combined to avoid overflow.
    #[inline(always)]
    fn longitudinal(&self, p: usize, closure: &HairClosure, wi: FibreDirection) -> f32 {
        let v = self.variance[p.min(2)];
        let (sine, cosine) = closure.tilted[p];
        let (ds, dc) = (wi.sine + sine, wi.cosine - cosine);
        let bessel = scaled_bessel(wi.cosine * cosine / v);
        poly::exp(-(ds * ds + dc * dc) / (2.0 * v)) * bessel / (v * (1.0 - poly::exp(-2.0 / v)))
    }

    /// The azimuthal term: a logistic trimmed to -pi..pi, constant for the residual.
    #[inline(always)]
    fn azimuthal(&self, p: usize, closure: &HairClosure, wi: FibreDirection) -> f32 {
        let Some(center) = closure.center.get(p) else { return 1.0 / TAU };
        let off = wrapped(wi.angle - closure.wo.angle - center).abs();
        let e = poly::exp(-off / self.scale);
        let logistic = e / (self.scale * (1.0 + e) * (1.0 + e));
        logistic / (1.0 - 2.0 * self.logistic_tail())
    }

    /// Cumulative distribution of the untrimmed logistic at -pi.
    #[inline(always)]
    fn logistic_tail(&self) -> f32 {
        let e = poly::exp(-PI / self.scale);
        e / (1.0 + e)
    }

    #[inline]
    fn eval_closure(&self, closure: &HairClosure, wi: FibreDirection) -> BsdfEval {
        let mut eval = BsdfEval::ZERO;
        for p in 0..LOBES {
            let lobe = self.longitudinal(p, closure, wi) * self.azimuthal(p, closure, wi);
            eval.f_cos += closure.attenuation[p] * lobe;
            eval.pdf_solid_angle += closure.probability[p] * lobe;
        }
        eval
    }

    /// Samples a direction of lobe `p` by three random numbers in 0..1.
    #[inline]
    fn sample_lobe(&self, p: usize, closure: &HairClosure, u: [f32; 3]) -> FibreDirection {
        // d'Eon, Marschner, Hanika 2013, "Importance Sampling for Physically-Based Hair Fiber Models", eq. 6 and 7, in terms of one
        // minus the cosine, which keeps its digits for narrow lobes.
        let v = self.variance[p.min(2)];
        let u0 = u[0].max(1e-9);
        let one_minus_cos = -v * poly::ln(u0 + (1.0 - u0) * poly::exp(-2.0 / v));
        let one_minus_cos = one_minus_cos.clamp(0.0, 2.0);
        let (cosine, sine) = (1.0 - one_minus_cos, (one_minus_cos * (2.0 - one_minus_cos)).sqrt());
        let (_, cos_turn) = poly::sin_cos_turns(u[2]);
        let (sin_o, cos_o) = closure.tilted[p];
        let sin_i = (sine * cos_turn * cos_o - cosine * sin_o).clamp(-1.0, 1.0);
        let off = if p < 3 {
            let low = self.logistic_tail();
            let y = (low + u[1] * (1.0 - 2.0 * low)).clamp(f32::MIN_POSITIVE, 1.0 - f32::EPSILON / 2.0);
            closure.center[p] + (self.scale * poly::ln(y / (1.0 - y))).clamp(-PI, PI)
        } else {
            TAU * u[1]
        };
        let cos_i = (1.0 - sin_i * sin_i).max(0.0).sqrt();
        FibreDirection { sine: sin_i, cosine: cos_i, angle: wrapped(closure.wo.angle + off) }
    }

    #[inline(always)]
    fn color(&self) -> Rgb {
        self.root_absorption.map(|root| poly::exp(-self.color_scale * root))
    }
}

/// Square root of the absorption coefficient of hair with a multiple-scattering albedo `color` (Chiang et al. 2016, eq. 9).
#[inline(always)]
fn root_absorption(color: Rgb, scale: f32) -> Rgb {
    color.map(|c| -poly::ln(c.clamp(MIN_COLOR, 1.0)).min(0.0) / scale)
}

impl Lobe for Hair {
    #[inline]
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let side = if wo.z < 0.0 { -1.0 } else { 1.0 };
        let closure = self.closure(self.fibre_direction(wo, side));
        let (mut p, mut rest) = (0, u[2]);
        while p + 1 < LOBES && rest >= closure.probability[p] {
            rest -= closure.probability[p];
            p += 1;
        }
        let within = rest / closure.probability[p].max(f32::MIN_POSITIVE);
        let wi = self.sample_lobe(p, &closure, [u[0], u[1], within.clamp(0.0, 1.0)]);
        let BsdfEval { f_cos, pdf_solid_angle } = self.eval_closure(&closure, wi);
        let (s, c) = poly::sin_cos(wi.angle);
        let (across, z) = (wi.cosine * s, wi.cosine * c * side);
        let t = self.tangent;
        let direction = Vec3::new(t.x * wi.sine - t.y * across, t.y * wi.sine + t.x * across, z);
        if pdf_solid_angle <= 0.0 || z == 0.0 {
            return BsdfSample::ABSORBED;
        }
        let is_transmission = (z < 0.0) != (wo.z < 0.0);
        let weight = f_cos / pdf_solid_angle;
        BsdfSample { wi: direction, weight, pdf_solid_angle, is_transmission, ..BsdfSample::ABSORBED }
    }

    #[inline]
    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        let side = if wo.z < 0.0 { -1.0 } else { 1.0 };
        self.eval_closure(&self.closure(self.fibre_direction(wo, side)), self.fibre_direction(wi, side))
    }

    #[inline]
    fn tinted(self, color: Rgb) -> Self {
        let tint = root_absorption(color, self.color_scale);
        Hair { root_absorption: self.root_absorption + tint, ..self }
    }

    #[inline]
    fn albedo(&self) -> Rgb {
        self.color()
    }

    /// As in Cycles, all hair scattering counts as glossy.
    fn appearance(&self) -> Appearance {
        Appearance { glossy: self.albedo(), ..Appearance::BLACK }
    }
}

impl Transmissive for Hair {
    const HAS_SCATTERED_TRANSMISSION: bool = true;
    const REFRACTS: bool = false;
    const SIDES_MAY_SWAP: bool = false;

    fn with_ior(self, _ior: f32) -> Self {
        self
    }

    fn transmission_tint(&self) -> Rgb {
        Rgb::ONE
    }
}

/// The parameters of [`Hair`].
#[derive(Clone, Copy, Debug)]
pub struct HairProgram {
    /// Multiple-scattering albedo.
    pub color: ColorSlot,
    /// Longitudinal roughness.
    pub roughness: FloatSlot,
    /// Azimuthal roughness.
    pub radial_roughness: FloatSlot,
    /// Index of refraction.
    pub ior: f32,
    /// Angle of the scales, radians.
    pub tilt_rad: f32,
    /// Reduction of the longitudinal roughness of R, 0..1.
    pub coat: FloatSlot,
}

impl MaterialProgram for HairProgram {
    type Lobe = Hair;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, frame: &LocalFrame) -> Hair {
        let roughness = [slots.clamped_number(&self.roughness), slots.clamped_number(&self.radial_roughness)];
        let color = slots.clamped_color(&self.color);
        Hair::new(frame.tangent, color, roughness, self.ior, self.tilt_rad, slots.clamped_number(&self.coat))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI as PI_64;

    fn hair(color: f32, roughness: [f32; 2], tilt: f32) -> Hair {
        Hair::new(Vec2::new(0.8, 0.6), Rgb::splat(color), roughness, 1.55, tilt, 0.0)
    }

    /// A direction by longitudinal angle and azimuth, for a fibre along (0.8, 0.6).
    fn direction(theta: f64, phi: f64) -> Vec3 {
        let (across, z) = (theta.cos() * phi.sin(), theta.cos() * phi.cos());
        let along = theta.sin();
        Vec3::new((0.8 * along - 0.6 * across) as f32, (0.6 * along + 0.8 * across) as f32, z as f32)
    }

    #[test]
    fn bessel_function_equals_its_series() {
        for i in 0..400 {
            let x = f64::from(i) * 0.05;
            let (mut term, mut sum) = (1.0, 1.0);
            for k in 1..200 {
                term *= (x / 2.0).powi(2) / f64::from(k * k);
                sum += term;
            }
            let expected = sum * (-x).exp();
            let error = (f64::from(scaled_bessel(x as f32)) / expected - 1.0).abs();
            assert!(error < 5e-7, "{x}: {error}");
        }
    }

    /// Without pigment albedo and integral of the pdf are 1 for all roughnesses and offsets.
    #[test]
    fn white_furnace_and_pdf_integrate_to_one() {
        let (rows, columns) = (600, 300);
        for roughness in [[0.1, 0.1], [0.1, 0.9], [0.3, 0.3], [0.6, 0.15], [0.9, 0.1], [1.0, 1.0]] {
            for (theta, phi) in [(0.0, 0.0), (0.4, 0.9), (-0.9, 1.5), (1.3, -0.6)] {
                let (hair, wo) = (hair(1.0, roughness, 0.035), direction(theta, phi));
                let (mut energy, mut density) = (0.0, 0.0);
                for row in 0..rows {
                    let theta = PI_64 * ((f64::from(row) + 0.5) / f64::from(rows) - 0.5);
                    for column in 0..columns {
                        let phi = 2.0 * PI_64 * (f64::from(column) + 0.5) / f64::from(columns);
                        let eval = hair.eval(wo, direction(theta, phi));
                        energy += f64::from(eval.f_cos.g) * theta.cos();
                        density += f64::from(eval.pdf_solid_angle) * theta.cos();
                    }
                }
                let cell = PI_64 / f64::from(rows) * 2.0 * PI_64 / f64::from(columns);
                let (energy, density) = (energy * cell, density * cell);
                assert!((energy - 1.0).abs() < 1e-3, "{roughness:?} {theta} {phi}: energy {energy}");
                assert!((density - 1.0).abs() < 1e-3, "{roughness:?} {theta} {phi}: density {density}");
            }
        }
    }

    /// Traces a ray through a smooth glass cylinder along x, entering at z = 1. Returns the direction after a number of internal
    /// reflections, and the length within the glass, radii.
    fn through_cylinder(wo: [f64; 3], ior: f64, reflections: u32) -> ([f64; 3], f64) {
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let mix = |a: [f64; 3], s: f64, b: [f64; 3], t: f64| [0, 1, 2].map(|i| a[i] * s + b[i] * t);
        // Refracts d at an interface with normal n (against d) and relative index eta.
        let refract = |d: [f64; 3], n: [f64; 3], eta: f64| {
            let cos_i = -dot(d, n);
            let cos_t = (1.0 - (1.0 - cos_i * cos_i) / (eta * eta)).sqrt();
            mix(d, 1.0 / eta, n, cos_i / eta - cos_t)
        };
        let mut p = [0.0, 0.0, 1.0];
        let mut d = refract(wo.map(|x| -x), p, ior);
        let mut length = 0.0;
        for bounce in 0.. {
            // To the wall: |p + t d| = 1 in the normal plane.
            let t = -2.0 * (p[1] * d[1] + p[2] * d[2]) / (d[1] * d[1] + d[2] * d[2]);
            length += t;
            p = mix(p, 1.0, d, t);
            let normal = [0.0, -p[1], -p[2]];
            if bounce == reflections {
                return (refract(d, normal, 1.0 / ior), length);
            }
            d = mix(d, 1.0, normal, -2.0 * dot(d, normal));
        }
        unreachable!("the loop returns")
    }

    /// TT and TRT lobes are centred on the directions refracted by a smooth cylinder, with the absorption of the path within.
    #[test]
    fn lobe_centers_follow_snells_law() {
        for (theta, phi) in [(0.0f64, 0.0f64), (0.2, 0.5), (-0.7, 1.2), (0.9, -0.8), (0.0, -1.4)] {
            let wo = [theta.sin(), theta.cos() * phi.sin(), theta.cos() * phi.cos()];
            let hair = Hair::new(Vec2::X, Rgb::splat(0.5), [0.1, 0.1], 1.55, 0.0, 0.0);
            let clear = Hair::new(Vec2::X, Rgb::ONE, [0.1, 0.1], 1.55, 0.0, 0.0);
            let closure_of =
                |hair: &Hair| hair.closure(hair.fibre_direction(Vec3::from(wo.map(|x| x as f32)), 1.0));
            let (closure, unpigmented) = (closure_of(&hair), closure_of(&clear));
            for p in [1, 2] {
                let (out, length) = through_cylinder(wo, 1.55, p - 1);
                let around = hair.fibre_direction(Vec3::from(out.map(|x| x as f32)), 1.0);
                let off = wrapped(around.angle - closure.wo.angle - closure.center[p as usize]);
                assert!(
                    off.abs() < 2e-3 && (around.sine + closure.tilted[p as usize].0).abs() < 1e-5,
                    "{p}: {off}"
                );
                let absorption = f64::from(hair.root_absorption.g).powi(2);
                let ratio =
                    f64::from(closure.attenuation[p as usize].g / unpigmented.attenuation[p as usize].g);
                assert!((ratio / (-absorption * length).exp() - 1.0).abs() < 2e-5, "{p}: {ratio} {length}");
            }
        }
    }

    #[test]
    fn colour_and_absorption_conversions_are_inverse() {
        for radial in [0.05, 0.3, 0.9] {
            for absorption in [0.0f32, 0.02, 0.4, 3.0] {
                let color = crate::scene::hair_color([absorption; 3], radial);
                let hair = Hair::new(Vec2::X, Rgb::from_array(color), [0.3, radial], 1.55, 0.0, 0.0);
                let found = hair.root_absorption.r * hair.root_absorption.r;
                assert!((found - absorption).abs() <= 1e-4 * absorption, "{radial} {absorption}: {found}");
                assert!((hair.albedo().r - color[0]).abs() < 1e-5);
            }
        }
        let tinted = hair(0.5, [0.3; 2], 0.0).tinted(Rgb::splat(0.4));
        assert!((tinted.albedo().g - 0.2).abs() < 1e-5);
    }

    #[test]
    fn coat_narrows_only_the_r_lobe() {
        let plain = Hair::new(Vec2::X, Rgb::ONE, [0.5, 0.3], 1.55, 0.0, 0.0);
        let coated = Hair::new(Vec2::X, Rgb::ONE, [0.5, 0.3], 1.55, 0.0, 0.8);
        assert!(coated.variance[0] < 0.1 * plain.variance[0] && coated.variance[1..] == plain.variance[1..]);
    }
}
