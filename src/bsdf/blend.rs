//! The weighted sum of two reflecting (diffuse or glossy) materials.

use super::lobe::MIN_ALBEDO;
use super::metal_rough::{MetalRough, MetalRoughClosure, MetalRoughProgram};
use super::{Appearance, BsdfEval, BsdfSample, Lobe, LocalFrame, MaterialProgram, Slots, ggx};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::scene::ColorSlot;
use std::f32::consts::FRAC_1_PI;

/// The weighted sum of two BSDFs: Mix Shader or Add Shader. Sampling chooses a BSDF in proportion to its weighted albedo and weights
/// the sample by the pdf of both (one-sample MIS, balance heuristic; Veach 1997, section 9.2.4).
#[derive(Clone, Copy, Debug)]
pub struct Blend {
    /// Weights of the BSDFs.
    pub weights: [Rgb; 2],
    /// The BSDFs.
    pub parts: [MetalRough; 2],
}

impl Blend {
    /// The closures for a view direction above the surface, with their selection probabilities; `None` if the albedo is zero.
    #[inline]
    fn closures(&self, above: Vec3) -> Option<[(MetalRoughClosure, f32); 2]> {
        let (first, second) = (closure(&self.parts[0], above), closure(&self.parts[1], above));
        let (a, b) = (self.weights[0].mean() * first.albedo, self.weights[1].mean() * second.albedo);
        let sum = a + b;
        (sum > MIN_ALBEDO).then(|| [(first, a / sum), (second, b / sum)])
    }

    /// Weighted value and pdf of both BSDFs for directions above the surface.
    #[inline]
    fn eval_above(&self, closures: &[(MetalRoughClosure, f32); 2], above: Vec3, wi: Vec3) -> BsdfEval {
        let mut sum = BsdfEval::ZERO;
        for (k, (closure, probability)) in closures.iter().enumerate() {
            let own = eval(closure, &self.parts[k], above, wi);
            sum.f_cos += self.weights[k] * own.f_cos;
            sum.pdf_solid_angle += probability * own.pdf_solid_angle;
        }
        sum
    }

    /// Applies a change to both BSDFs.
    pub fn modify_parts(&mut self, change: impl FnMut(&mut MetalRough)) {
        self.parts.iter_mut().for_each(change);
    }

    /// The attenuated diffuse albedo for `wo`, and the probability of sampling diffuse reflection.
    pub fn base(&self, wo: Vec3) -> (Rgb, f32) {
        let Some(closures) = self.closures(ggx::to_upper_side(wo)) else { return (Rgb::ZERO, 0.0) };
        let (mut color, mut probability_diffuse) = (Rgb::ZERO, 0.0);
        for (weight, (closure, probability)) in self.weights.into_iter().zip(closures) {
            color += weight * closure.diffuse;
            probability_diffuse += probability * closure.probability_diffuse;
        }
        (color, probability_diffuse)
    }
}

/// The closure of a part for a view direction above the surface; purely diffuse parts need no table look-ups.
#[inline]
fn closure(part: &MetalRough, above: Vec3) -> MetalRoughClosure {
    if part.layer_f90 > 0.0 || part.metallic > 0.0 {
        return part.closure(above);
    }
    let (diffuse, albedo) = (part.diffuse, part.diffuse.mean());
    let probability_diffuse = if albedo > MIN_ALBEDO { 1.0 } else { 0.0 };
    MetalRoughClosure {
        diffuse,
        layer_transmittance: 1.0,
        albedo,
        probability_diffuse,
        ..MetalRoughClosure::default()
    }
}

/// Value and pdf of a part's closure for directions above the surface.
#[inline]
fn eval(closure: &MetalRoughClosure, part: &MetalRough, above: Vec3, wi: Vec3) -> BsdfEval {
    if closure.probability_specular > 0.0 {
        return closure.eval(&part.surface, above, wi);
    }
    let cosine = wi.z.max(0.0) * FRAC_1_PI;
    BsdfEval { f_cos: closure.diffuse * cosine, pdf_solid_angle: closure.probability_diffuse * cosine }
}

impl Lobe for Blend {
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let above = ggx::to_upper_side(wo);
        let Some(closures) = self.closures(above) else { return BsdfSample::ABSORBED };
        let first = closures[0].1;
        let k = usize::from(u[2] >= first);
        let (closure, probability) = &closures[k];
        // The random number rescaled after the choice, uniform in 0..1 again.
        let rest = if k == 0 { u[2] / first } else { (u[2] - first) / (1.0 - first) };
        let own = closure.sample(
            &self.parts[k].surface,
            wo,
            above,
            [u[0], u[1], rest.clamp(0.0, 1.0f32.next_down())],
        );
        if own.is_specular {
            let weight = self.weights[k] * own.weight / *probability;
            return BsdfSample { weight, pdf_solid_angle: own.pdf_solid_angle * probability, ..own };
        }
        let both = self.eval_above(&closures, above, Vec3::new(own.wi.x, own.wi.y, own.wi.z.abs()));
        if own.pdf_solid_angle <= 0.0 || both.pdf_solid_angle <= 0.0 {
            return BsdfSample::ABSORBED;
        }
        let weight = both.f_cos / both.pdf_solid_angle;
        BsdfSample { weight, pdf_solid_angle: both.pdf_solid_angle, ..own }
    }

    #[inline]
    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if (wo.z < 0.0) != (wi.z < 0.0) {
            return BsdfEval::ZERO;
        }
        let above = ggx::to_upper_side(wo);
        let closures = self.closures(above);
        let wi = Vec3::new(wi.x, wi.y, wi.z.abs());
        closures.map_or(BsdfEval::ZERO, |closures| self.eval_above(&closures, above, wi))
    }

    fn is_specular(&self) -> bool {
        self.parts.iter().all(Lobe::is_specular)
    }

    fn tinted(self, color: Rgb) -> Self {
        Blend { parts: self.parts.map(|part| part.tinted(color)), ..self }
    }

    fn albedo(&self) -> Rgb {
        let [a, b] = [0, 1].map(|k| self.weights[k] * self.parts[k].albedo());
        (a + b).min(Rgb::ONE)
    }

    /// The roughness is that of the BSDF with the brighter glossy reflection.
    fn appearance(&self) -> Appearance {
        let [a, b] = self.parts.map(|part| part.appearance());
        let [weight_a, weight_b] = self.weights;
        let (glossy_a, glossy_b) = (weight_a * a.glossy, weight_b * b.glossy);
        Appearance {
            diffuse: weight_a * a.diffuse + weight_b * b.diffuse,
            glossy: (glossy_a + glossy_b).min(Rgb::ONE),
            roughness: if glossy_a.luminance() >= glossy_b.luminance() { a.roughness } else { b.roughness },
            ..Appearance::BLACK
        }
    }

    fn diffuse_part(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let (mut diffuse, above) = (Rgb::ZERO, ggx::to_upper_side(wo));
        for (&weight, part) in self.weights.iter().zip(&self.parts) {
            if part.diffuse != Rgb::ZERO {
                diffuse += weight * closure(part, above).diffuse;
            }
        }
        let is_reflected = (wo.z < 0.0) == (wi.z < 0.0);
        diffuse * if is_reflected { FRAC_1_PI * wi.z.abs() } else { 0.0 }
    }
}

/// The parameters of a [`Blend`].
#[derive(Clone, Copy, Debug)]
pub struct BlendProgram {
    pub weights: [ColorSlot; 2],
    /// Programs of [`Blend::parts`].
    pub parts: [MetalRoughProgram; 2],
}

impl MaterialProgram for BlendProgram {
    type Lobe = Blend;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, frame: &LocalFrame) -> Blend {
        Blend {
            weights: self.weights.map(|weight| slots.color(&weight).max(Rgb::ZERO)),
            parts: self.parts.map(|part| part.evaluate(slots, frame)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::{Bsdf, Isotropic, LayerFresnel};
    use crate::sampling::chi2::Random;
    use crate::scene::EnergyCompensation;

    fn diffuse(albedo: f32) -> MetalRough {
        MetalRough { diffuse: Rgb::splat(albedo), ..MetalRough::BLACK }
    }

    fn glossy(alpha: f32) -> MetalRough {
        MetalRough {
            layer_f0: Rgb::splat(0.8),
            layer_f90: 0.8,
            layer_fresnel: LayerFresnel::Schlick,
            surface: Isotropic { alpha },
            energy_compensation: EnergyCompensation::Off,
            ..MetalRough::BLACK
        }
    }

    fn viewers() -> impl Iterator<Item = Vec3> {
        [0.05f32, 0.4, 1.0, 1.5].into_iter().map(|theta| Vec3::new(theta.sin(), 0.0, theta.cos()))
    }

    #[test]
    fn values_are_weighted_sums() {
        let blend =
            Blend { weights: [Rgb::splat(0.3), Rgb::new(0.7, 0.2, 0.5)], parts: [diffuse(0.9), glossy(0.2)] };
        let mut random = Random::new(4);
        for wo in viewers() {
            let wi = crate::sampling::warp::cosine_hemisphere([random.next(), random.next()]);
            let sum = blend.parts[0].eval(wo, wi).f_cos * blend.weights[0]
                + blend.parts[1].eval(wo, wi).f_cos * blend.weights[1];
            let found = blend.eval(wo, wi).f_cos;
            assert!(
                (found - sum).max_element().abs() <= 1e-6 * (1.0 + sum.max_element()),
                "{found:?} {sum:?}"
            );
        }
    }

    /// The mean sample weight is the weighted sum of those of the two parts, and pdfs of samples equal those of `eval`.
    #[test]
    fn samples_agree_with_values() {
        for alpha in [0.0, 0.1, 0.6] {
            let blend =
                Blend { weights: [Rgb::splat(0.6), Rgb::splat(0.4)], parts: [diffuse(0.7), glossy(alpha)] };
            for wo in viewers() {
                let mut random = Random::new(9);
                let (mut blended, mut separate) = (0.0f64, 0.0f64);
                const COUNT: u32 = 200_000;
                for _ in 0..COUNT {
                    let u = [random.next(), random.next(), random.next()];
                    let sample = Bsdf::Blend(blend).sample(wo, u);
                    blended += f64::from(sample.weight.g);
                    for (weight, part) in blend.weights.iter().zip(&blend.parts) {
                        separate += f64::from(weight.g * part.sample(wo, u).weight.g);
                    }
                    if sample.pdf_solid_angle > 0.0 && !sample.is_specular {
                        let value = blend.eval(wo, sample.wi);
                        assert!((value.pdf_solid_angle / sample.pdf_solid_angle - 1.0).abs() < 1e-4);
                    }
                }
                assert!((blended / separate - 1.0).abs() < 0.01, "{alpha} {wo}: {blended} {separate}");
            }
        }
    }
}
