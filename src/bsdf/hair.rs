//! Hair and fur: a dielectric fibre with tilted cuticle scales and pigment.

use super::{
    Appearance, BsdfEval, BsdfSample, Lobe, LocalFrame, MaterialProgram, Slots, Transmissive, fresnel,
};
use crate::color::Rgb;
use crate::math::{Vec2, Vec3, poly};
use crate::scene::{ColorSlot, FloatSlot, hair_color_scale};
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// The model of Chiang, Bitterli, Tappan, Burley 2016, "A Practical and Controllable Hair and Fur Model for Production Path
/// Tracing": light that is reflected by the fibre (R), that passes it (TT), that is reflected once within (TRT), and all that is
/// reflected more often, each the product of a longitudinal lobe (d'Eon et al. 2011, "An Energy-Conserving Hair Reflectance
/// Model", eq. 7), an azimuthal one (a trimmed logistic) and an attenuation. It is the near-field form (Pharr 2016, "The
/// Implementation of a Hair Scattering Model"): where across the fibre the viewer looks is known from the surface's normal.
///
/// Without pigment all light continues. It stands for the whole fibre: what passes leaves where it came in. Not reciprocal for tilted
/// scales, and elsewhere only as far as the viewer's place on the fibre is averaged.
#[derive(Clone, Copy, Debug)]
pub struct Hair {
    /// Along the fibre, in the tangent plane.
    tangent: Vec2,
    /// Root of the absorption, per radius.
    root_absorption: Rgb,
    /// Divisor of the logarithm of a colour for the absorption: eq. 9.
    color_scale: f32,
    ior: f32,
    /// Longitudinal variance of R, TT, and all others.
    variance: [f32; 3],
    /// Scale of the azimuthal logistic.
    scale: f32,
    /// Sine and cosine by which R, TT and TRT are turned along the fibre.
    tilt: [(f32, f32); 3],
}

/// R, TT, TRT, and the rest.
const LOBES: usize = 4;

/// Rougher ones are no narrower than single precision resolves.
const MIN_ROUGHNESS: f32 = 0.01;

/// Darker colours than this, or hair as black as it gets.
const MIN_COLOR: f32 = 1e-12;

/// Variance of the longitudinal lobe: Chiang et al. 2016, eq. 7.
fn longitudinal_variance(roughness: f32) -> f32 {
    let b = roughness.clamp(MIN_ROUGHNESS, 1.0);
    let b20 = power(b, 20);
    let root = 0.726 * b + 0.812 * b * b + 3.7 * b20;
    root * root
}

/// Scale of the azimuthal logistic: eq. 8, with the factor that gives it the width of a Gaussian of that deviation.
fn azimuthal_scale(roughness: f32) -> f32 {
    const ROOT_PI_OVER_8: f32 = 0.626_657_1;
    let b = roughness.clamp(MIN_ROUGHNESS, 1.0);
    ROOT_PI_OVER_8 * (0.265 * b + 1.194 * b * b + 5.372 * power(b, 22))
}

fn power(x: f32, n: u32) -> f32 {
    (0..n).fold(1.0, |product, _| product * x)
}

/// e^-x I0(x), the modified Bessel function, for x from 0 (Abramowitz, Stegun 1964, 9.8.1 and 9.8.2). Relative error below 5e-7.
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

/// A direction by its sine over the plane across the fibre, the cosine, and the angle around the fibre from the normal.
#[derive(Clone, Copy)]
struct Around {
    sine: f32,
    cosine: f32,
    angle: f32,
}

/// The closure of one view direction.
struct HairClosure {
    wo: Around,
    /// Attenuation of each lobe.
    share: [Rgb; LOBES],
    /// The probability with which each lobe is sampled.
    probability: [f32; LOBES],
    /// Sine and cosine of the viewer, turned for each lobe.
    turned: [(f32, f32); LOBES],
    /// Where each azimuthal lobe has its middle.
    middle: [f32; 3],
}

/// An angle in -pi..pi, of one less than a few turns off.
#[inline(always)]
fn wrapped(angle: f32) -> f32 {
    let turns = angle * (1.0 / TAU);
    let nearest = (turns + if turns < 0.0 { -0.5 } else { 0.5 }) as i32;
    angle - nearest as f32 * TAU
}

impl Hair {
    /// Hair around a tangent; roughnesses 0 to 1, the tilt of scales in radians.
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
        // d'Eon et al. 2011: R has the roughness of one interface, TT of half as much, TRT of twice.
        let variance = [longitudinal_variance(longitudinal * (1.0 - coat)), 0.25 * v, 4.0 * v];
        let turn = |times: f32| poly::sin_cos(times * tilt);
        Hair {
            tangent: tangent.try_normalize().unwrap_or(Vec2::X),
            root_absorption: root_absorption(color, color_scale),
            color_scale,
            ior,
            variance,
            scale: azimuthal_scale(radial),
            // Marschner et al. 2003: R by -2, TT by 1 and TRT by 4 times the angle of the scales.
            tilt: [turn(-2.0), turn(1.0), turn(4.0)],
        }
    }

    /// A direction of the frame around the fibre; what is seen from within is as from outside.
    #[inline(always)]
    fn around(&self, w: Vec3, side: f32) -> Around {
        let t = self.tangent;
        let sine = (w.x * t.x + w.y * t.y).clamp(-1.0, 1.0);
        let across = w.y * t.x - w.x * t.y;
        let (y, z) = (across, w.z * side);
        Around { sine, cosine: (y * y + z * z).sqrt(), angle: poly::atan2(y, z) }
    }

    /// Albedo for a viewing direction.
    #[inline]
    fn seen(&self, wo: Around) -> HairClosure {
        // Sine and cosine of the angle between the normal and the viewer in the plane across.
        let (h, cos_gamma) = poly::sin_cos(wo.angle);
        let cos_gamma = cos_gamma.max(0.0);
        // The refracted ray in that plane has a greater index of refraction (Marschner et al. 2003, appendix B).
        let modified = (self.ior * self.ior - wo.sine * wo.sine).max(1e-12).sqrt();
        let sin_refracted = (h * wo.cosine / modified).clamp(-1.0, 1.0);
        let cos_refracted = (1.0 - sin_refracted * sin_refracted).sqrt();
        let gamma_refracted = poly::asin(sin_refracted);
        let sin_theta = wo.sine / self.ior;
        let cos_theta = (1.0 - sin_theta * sin_theta).max(1e-6).sqrt();
        let way = 2.0 * cos_refracted / cos_theta;
        let passed = self.root_absorption.map(|root| poly::exp(-root * root * way));
        let reflected = fresnel::exact(wo.cosine * cos_gamma, self.ior).reflectance;
        let once = passed * ((1.0 - reflected) * (1.0 - reflected));
        let twice = once * passed * reflected;
        // All that follow, as a geometric series.
        let again = passed * reflected;
        let rest = (twice * again) / (Rgb::ONE - again);
        let share = [Rgb::splat(reflected), once, twice, rest];
        let sum = share.iter().map(|s| s.mean()).sum::<f32>().max(f32::MIN_POSITIVE);
        let middle = [0.0, 1.0, 2.0]
            .map(|p: f32| 2.0 * p * gamma_refracted - 2.0 * wo.angle.clamp(-FRAC_PI_2, FRAC_PI_2) + p * PI);
        let turned = std::array::from_fn(|p| match self.tilt.get(p) {
            Some(&(s, c)) => (wo.sine * c + wo.cosine * s, (wo.cosine * c - wo.sine * s).abs()),
            None => (wo.sine, wo.cosine),
        });
        HairClosure { wo, share, probability: share.map(|s| s.mean() / sum), turned, middle }
    }

    /// The longitudinal lobe: d'Eon et al. 2011, eq. 7, with the exponents taken together, which none is too large for.
    #[inline(always)]
    fn longitudinal(&self, p: usize, seen: &HairClosure, wi: Around) -> f32 {
        let v = self.variance[p.min(2)];
        let (sine, cosine) = seen.turned[p];
        let (ds, dc) = (wi.sine + sine, wi.cosine - cosine);
        let bessel = scaled_bessel(wi.cosine * cosine / v);
        poly::exp(-(ds * ds + dc * dc) / (2.0 * v)) * bessel / (v * (1.0 - poly::exp(-2.0 / v)))
    }

    /// The azimuthal lobe.
    #[inline(always)]
    fn azimuthal(&self, p: usize, seen: &HairClosure, wi: Around) -> f32 {
        let Some(middle) = seen.middle.get(p) else { return 1.0 / TAU };
        let off = wrapped(wi.angle - seen.wo.angle - middle).abs();
        let e = poly::exp(-off / self.scale);
        let logistic = e / (self.scale * (1.0 + e) * (1.0 + e));
        logistic / (1.0 - 2.0 * self.cumulative())
    }

    /// The logistic's share below -pi.
    #[inline(always)]
    fn cumulative(&self) -> f32 {
        let e = poly::exp(-PI / self.scale);
        e / (1.0 + e)
    }

    #[inline]
    fn eval_seen(&self, seen: &HairClosure, wi: Around) -> BsdfEval {
        let mut eval = BsdfEval::ZERO;
        for p in 0..LOBES {
            let lobe = self.longitudinal(p, seen, wi) * self.azimuthal(p, seen, wi);
            eval.f_cos += seen.share[p] * lobe;
            eval.pdf_solid_angle += seen.probability[p] * lobe;
        }
        eval
    }

    /// A direction of lobe `p` by three numbers.
    #[inline]
    fn sample_lobe(&self, p: usize, seen: &HairClosure, u: [f32; 3]) -> Around {
        // d'Eon, Marschner, Hanika 2013, "Importance Sampling for Physically-Based Hair Fiber Models", eq. 6 and 7. One minus
        // the cosine is what keeps its digits where the lobe is narrow.
        let v = self.variance[p.min(2)];
        let u0 = u[0].max(1e-9);
        let below = -v * poly::ln(u0 + (1.0 - u0) * poly::exp(-2.0 / v));
        let below = below.clamp(0.0, 2.0);
        let (cosine, sine) = (1.0 - below, (below * (2.0 - below)).sqrt());
        let (_, turn) = poly::sin_cos_turns(u[2]);
        let (sin_o, cos_o) = seen.turned[p];
        let sin_i = (sine * turn * cos_o - cosine * sin_o).clamp(-1.0, 1.0);
        let off = if p < 3 {
            let low = self.cumulative();
            let y = (low + u[1] * (1.0 - 2.0 * low)).clamp(f32::MIN_POSITIVE, 1.0 - f32::EPSILON / 2.0);
            seen.middle[p] + (self.scale * poly::ln(y / (1.0 - y))).clamp(-PI, PI)
        } else {
            TAU * u[1]
        };
        let cos_i = (1.0 - sin_i * sin_i).max(0.0).sqrt();
        Around { sine: sin_i, cosine: cos_i, angle: wrapped(seen.wo.angle + off) }
    }

    #[inline(always)]
    fn color(&self) -> Rgb {
        self.root_absorption.map(|root| poly::exp(-self.color_scale * root))
    }
}

/// Eq. 9: the absorption of hair that has a colour where there is much of it.
#[inline(always)]
fn root_absorption(color: Rgb, scale: f32) -> Rgb {
    color.map(|c| -poly::ln(c.clamp(MIN_COLOR, 1.0)).min(0.0) / scale)
}

impl Lobe for Hair {
    #[inline]
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let side = if wo.z < 0.0 { -1.0 } else { 1.0 };
        let seen = self.seen(self.around(wo, side));
        let (mut p, mut rest) = (0, u[2]);
        while p + 1 < LOBES && rest >= seen.probability[p] {
            rest -= seen.probability[p];
            p += 1;
        }
        let within = rest / seen.probability[p].max(f32::MIN_POSITIVE);
        let wi = self.sample_lobe(p, &seen, [u[0], u[1], within.clamp(0.0, 1.0)]);
        let BsdfEval { f_cos, pdf_solid_angle } = self.eval_seen(&seen, wi);
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
        self.eval_seen(&self.seen(self.around(wo, side)), self.around(wi, side))
    }

    #[inline]
    fn tinted(self, color: Rgb) -> Self {
        let more = root_absorption(color, self.color_scale);
        Hair { root_absorption: self.root_absorption + more, ..self }
    }

    #[inline]
    fn albedo(&self) -> Rgb {
        self.color()
    }

    /// As Cycles, which counts all that hair scatters as gloss.
    fn appearance(&self) -> Appearance {
        Appearance { glossy: self.albedo(), ..Appearance::BLACK }
    }
}

impl Transmissive for Hair {
    const SCATTERS_THROUGH: bool = true;
    const REFRACTS: bool = false;
    const TURNS_OVER: bool = false;

    fn with_ior(self, _ior: f32) -> Self {
        self
    }

    fn crossing_tint(&self) -> Rgb {
        Rgb::ONE
    }
}

/// The parameters of [`Hair`].
#[derive(Clone, Copy, Debug)]
pub struct HairProgram {
    /// Colour of much hair.
    pub color: ColorSlot,
    /// Longitudinal roughness.
    pub roughness: FloatSlot,
    /// Azimuthal roughness.
    pub radial_roughness: FloatSlot,
    /// Index of refraction.
    pub ior: f32,
    /// Angle of the scales, radians.
    pub tilt_rad: f32,
    /// How much less rough R is.
    pub coat: FloatSlot,
}

impl MaterialProgram for HairProgram {
    type Lobe = Hair;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, frame: &LocalFrame) -> Hair {
        let roughness = [slots.share(&self.roughness), slots.share(&self.radial_roughness)];
        let color = slots.share_by_channel(&self.color);
        Hair::new(frame.tangent, color, roughness, self.ior, self.tilt_rad, slots.share(&self.coat))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI as PI_64;

    fn hair(color: f32, roughness: [f32; 2], tilt: f32) -> Hair {
        Hair::new(Vec2::new(0.8, 0.6), Rgb::splat(color), roughness, 1.55, tilt, 0.0)
    }

    /// A direction by its angle over the plane across a fibre along (0.8, 0.6), and that around it.
    fn direction(theta: f64, phi: f64) -> Vec3 {
        let (across, z) = (theta.cos() * phi.sin(), theta.cos() * phi.cos());
        let along = theta.sin();
        Vec3::new((0.8 * along - 0.6 * across) as f32, (0.6 * along + 0.8 * across) as f32, z as f32)
    }

    #[test]
    fn the_bessel_function_is_its_series() {
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

    /// Without pigment all light continues, whatever the roughness and where on the fibre the viewer looks, and densities are one.
    #[test]
    fn the_white_furnace_and_the_density_are_one() {
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

    /// The ray that leaves a smooth cylinder of glass along x, which it enters at the top, after so many reflections within, with its
    /// way in the glass.
    fn through_cylinder(wo: [f64; 3], ior: f64, reflections: u32) -> ([f64; 3], f64) {
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let mix = |a: [f64; 3], s: f64, b: [f64; 3], t: f64| [0, 1, 2].map(|i| a[i] * s + b[i] * t);
        // Refracts d at a normal against it, into eta times denser.
        let refract = |d: [f64; 3], n: [f64; 3], eta: f64| {
            let cos_i = -dot(d, n);
            let cos_t = (1.0 - (1.0 - cos_i * cos_i) / (eta * eta)).sqrt();
            mix(d, 1.0 / eta, n, cos_i / eta - cos_t)
        };
        let mut p = [0.0, 0.0, 1.0];
        let mut d = refract(wo.map(|x| -x), p, ior);
        let mut way = 0.0;
        for bounce in 0.. {
            // On to the wall: |p + t d| = 1 across.
            let t = -2.0 * (p[1] * d[1] + p[2] * d[2]) / (d[1] * d[1] + d[2] * d[2]);
            way += t;
            p = mix(p, 1.0, d, t);
            let normal = [0.0, -p[1], -p[2]];
            if bounce == reflections {
                return (refract(d, normal, 1.0 / ior), way);
            }
            d = mix(d, 1.0, normal, -2.0 * dot(d, normal));
        }
        unreachable!("the loop returns")
    }

    /// TT and TRT lead where a smooth cylinder sends the light, and their pigment is that of the way within it.
    #[test]
    fn lobes_are_where_snell_sends_them() {
        for (theta, phi) in [(0.0f64, 0.0f64), (0.2, 0.5), (-0.7, 1.2), (0.9, -0.8), (0.0, -1.4)] {
            let wo = [theta.sin(), theta.cos() * phi.sin(), theta.cos() * phi.cos()];
            let hair = Hair::new(Vec2::X, Rgb::splat(0.5), [0.1, 0.1], 1.55, 0.0, 0.0);
            let clear = Hair::new(Vec2::X, Rgb::ONE, [0.1, 0.1], 1.55, 0.0, 0.0);
            let seen_of = |hair: &Hair| hair.seen(hair.around(Vec3::from(wo.map(|x| x as f32)), 1.0));
            let (seen, unpigmented) = (seen_of(&hair), seen_of(&clear));
            for p in [1, 2] {
                let (out, way) = through_cylinder(wo, 1.55, p - 1);
                let around = hair.around(Vec3::from(out.map(|x| x as f32)), 1.0);
                let off = wrapped(around.angle - seen.wo.angle - seen.middle[p as usize]);
                assert!(
                    off.abs() < 2e-3 && (around.sine + seen.turned[p as usize].0).abs() < 1e-5,
                    "{p}: {off}"
                );
                let absorption = f64::from(hair.root_absorption.g).powi(2);
                let ratio = f64::from(seen.share[p as usize].g / unpigmented.share[p as usize].g);
                assert!((ratio / (-absorption * way).exp() - 1.0).abs() < 2e-5, "{p}: {ratio} {way}");
            }
        }
    }

    #[test]
    fn colours_and_absorption_are_inverse() {
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
    fn a_coat_narrows_only_what_the_surface_reflects() {
        let plain = Hair::new(Vec2::X, Rgb::ONE, [0.5, 0.3], 1.55, 0.0, 0.0);
        let coated = Hair::new(Vec2::X, Rgb::ONE, [0.5, 0.3], 1.55, 0.0, 0.8);
        assert!(coated.variance[0] < 0.1 * plain.variance[0] && coated.variance[1..] == plain.variance[1..]);
    }
}
