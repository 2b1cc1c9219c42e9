//! The trait over microfacet distributions, and its implementations: isotropic and anisotropic GGX (Heitz 2014, "Understanding the
//! Masking-Shadowing Function in Microfacet-Based BRDFs", section 5.4), and Beckmann.

use super::anisotropic_table::{MAX_ROOT_RATIO, anisotropic_albedo, anisotropic_dielectric_grazing};
use super::dielectric_table::mean_cosine;
use super::fresnel::DielectricCurve;
use super::ggx::{self, DirectionalAlbedo, MIN_ALPHA, MIN_COS, Reflection};
use super::lobe::{LocalFrame, Slots, is_always};
use crate::math::{Vec2, Vec3, poly};
use crate::scene::{Anisotropy, ColorSlot, FloatSlot};
use std::f32::consts::PI;

/// A microfacet distribution. Directions have z above 0.
pub trait Facets: Copy {
    /// Whether it is an exact mirror.
    fn is_mirror(&self) -> bool;
    /// Alphas along two orthogonal tangent axes.
    fn alpha(&self) -> [f32; 2];
    /// Single-scattering directional albedo for a reflectance of 1.
    fn directional_albedo(&self, wo: Vec3) -> DirectionalAlbedo;
    /// Single-scattering directional albedo weighted by the Fresnel curve of a dielectric instead of Schlick's weight.
    fn dielectric_grazing(&self, wo: Vec3, albedo: DirectionalAlbedo, curve: DielectricCurve) -> f32;
    fn sample_visible_normal(&self, wo: Vec3, u: [f32; 2]) -> Vec3;
    /// Evaluates a pair of directions.
    fn reflection(&self, wo: Vec3, wi: Vec3) -> Reflection;
}

/// Isotropic GGX facets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Isotropic {
    /// GGX alpha; below [`MIN_ALPHA`] an exact mirror.
    pub alpha: f32,
}

impl Facets for Isotropic {
    #[inline(always)]
    fn alpha(&self) -> [f32; 2] {
        [self.alpha; 2]
    }

    #[inline(always)]
    fn is_mirror(&self) -> bool {
        self.alpha < MIN_ALPHA
    }

    #[inline(always)]
    fn directional_albedo(&self, wo: Vec3) -> DirectionalAlbedo {
        DirectionalAlbedo::at(wo.z, self.alpha)
    }

    #[inline(always)]
    fn dielectric_grazing(&self, wo: Vec3, albedo: DirectionalAlbedo, curve: DielectricCurve) -> f32 {
        albedo.full * curve.weight(mean_cosine(wo.z, self.alpha, curve))
    }

    #[inline(always)]
    fn sample_visible_normal(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        ggx::sample_visible_normal(wo, [self.alpha; 2], u)
    }

    #[inline(always)]
    fn reflection(&self, wo: Vec3, wi: Vec3) -> Reflection {
        ggx::reflection(wo, wi, self.alpha)
    }
}

/// Isotropic Beckmann facets: normally distributed slopes with a root mean square of alpha. Visible normals are sampled by GGX of the
/// same alpha, whose albedo is also used; there is no energy compensation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeckmannFacets(pub Isotropic);

impl Facets for BeckmannFacets {
    #[inline(always)]
    fn alpha(&self) -> [f32; 2] {
        self.0.alpha()
    }

    #[inline(always)]
    fn is_mirror(&self) -> bool {
        self.0.is_mirror()
    }

    #[inline(always)]
    fn directional_albedo(&self, wo: Vec3) -> DirectionalAlbedo {
        self.0.directional_albedo(wo)
    }

    #[inline(always)]
    fn dielectric_grazing(&self, wo: Vec3, albedo: DirectionalAlbedo, curve: DielectricCurve) -> f32 {
        self.0.dielectric_grazing(wo, albedo, curve)
    }

    #[inline(always)]
    fn sample_visible_normal(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        self.0.sample_visible_normal(wo, u)
    }

    #[inline]
    fn reflection(&self, wo: Vec3, wi: Vec3) -> Reflection {
        let (ggx, alpha) = (self.0.reflection(wo, wi), self.0.alpha);
        let root = |z: f32| ggx::smith_root(z, alpha * alpha);
        let (zo, zi) = (wo.z.max(MIN_COS), wi.z.max(MIN_COS));
        let distribution =
            ggx.pdf_solid_angle * 2.0 * (zo + root(zo)) * beckmann_over_ggx(wo + wi, [alpha; 2]);
        let lambda = beckmann_lambda(zo, root(zo)) + beckmann_lambda(zi, root(zi));
        Reflection { f_cos: 0.25 * distribution / (zo * (1.0 + lambda)), ..ggx }
    }
}

/// Smallest ratio of the two alphas.
const MIN_RATIO: f32 = 1.0 / (MAX_ROOT_RATIO * MAX_ROOT_RATIO);

/// Anisotropic GGX facets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Microsurface {
    /// GGX alphas along the axis and across it, both 0 or at least [`MIN_ALPHA`].
    pub(super) alpha: [f32; 2],
    /// Unit vector in the tangent plane, the direction of the first alpha.
    pub(super) axis: [f32; 2],
}

impl Microsurface {
    /// Raises both alphas to a minimum.
    pub(super) fn roughen(&mut self, min_alpha: f32) {
        self.alpha = self.alpha.map(|alpha| alpha.max(min_alpha));
    }

    /// Facets with alphas along an axis (a unit vector in the tangent plane) and across it. The smaller alpha is raised to at least a
    /// sixteenth of the larger one, the range of the albedo table.
    #[inline]
    pub fn new(alpha: [f32; 2], axis: [f32; 2]) -> Microsurface {
        let is_mirror = alpha[0].max(alpha[1]) < MIN_ALPHA;
        let least = (alpha[0].max(alpha[1]) * MIN_RATIO).max(MIN_ALPHA);
        let alpha = alpha.map(|a| if is_mirror { 0.0 } else { a.clamp(least, 1.0) });
        Microsurface { alpha, axis }
    }

    /// Isotropic facets.
    #[inline]
    pub fn isotropic(alpha: f32) -> Microsurface {
        Microsurface::new([alpha; 2], [1.0, 0.0])
    }

    /// The alpha, if isotropic.
    #[inline(always)]
    pub fn isotropic_alpha(&self) -> Option<f32> {
        (self.alpha[0] == self.alpha[1]).then_some(self.alpha[0])
    }

    /// Rotates a vector to the frame of the axis.
    #[inline(always)]
    pub fn to_axis(&self, v: Vec3) -> Vec3 {
        let [c, s] = self.axis;
        Vec3::new(v.x * c + v.y * s, v.y * c - v.x * s, v.z)
    }

    /// Rotates a vector back from the frame of the axis.
    #[inline(always)]
    pub fn from_axis(&self, v: Vec3) -> Vec3 {
        let [c, s] = self.axis;
        Vec3::new(v.x * c - v.y * s, v.x * s + v.y * c, v.z)
    }

    /// The root in Smith's masking for a unit vector in the frame of the axis: G1 = 2 z / (z + root).
    #[inline(always)]
    pub fn smith_root(&self, v: Vec3) -> f32 {
        let [ax, ay] = self.alpha;
        (ax * ax * v.x * v.x + ay * ay * v.y * v.y + v.z * v.z).sqrt()
    }

    /// Density of normals D along a vector of any non-zero length, in the frame of the axis (Heitz 2014, eq. 85). Arranged to avoid
    /// cancellation for small alphas.
    #[inline(always)]
    pub fn distribution(&self, half: Vec3) -> f32 {
        let [ax, ay] = self.alpha;
        let spread = half.x * half.x * (ay / ax) + half.y * half.y * (ax / ay) + half.z * half.z * (ax * ay);
        let ratio = half.length_squared() / spread.max(1e-30);
        ax * ay * ratio * ratio * (1.0 / PI)
    }

    /// The unit normal of the facets that refract `wo` to `wi` (Walter et al. 2007, eq. 16), and the density of `wi` where
    /// the visible normals of `wo` are sampled, 1/sr; `None` where no visible facet does. All are in the frame of the axis,
    /// `wo` with its [`Microsurface::smith_root`]; `eta` is the index of refraction of the other side over that of `wo`.
    #[inline(always)]
    pub fn refraction(&self, (wo, root): (Vec3, f32), wi: Vec3, eta: f32) -> Option<(Vec3, f32)> {
        // wo + eta wi, turned to the side of wo, so that the digits stay for eta near 1.
        let half = ((wo + wi) + wi * (eta - 1.0)) * if eta > 1.0 { -1.0 } else { 1.0 };
        let length = half.length();
        if half.z <= 0.0 {
            return None;
        }
        let (cos_o, cos_i) = (wo.dot(half) / length, wi.dot(half) / length);
        if cos_o <= 0.0 || cos_i >= 0.0 {
            return None;
        }
        // D G1(wo) |wo.h| / wo.z times dh / dwi = eta^2 |wi.h| / |wo + eta wi|^2.
        let stretch = cos_o * -cos_i * (eta / length) * (eta / length);
        let density = self.distribution(half) * 2.0 / (wo.z + root) * stretch;
        Some((half / length, density))
    }
}

impl Facets for Microsurface {
    #[inline(always)]
    fn alpha(&self) -> [f32; 2] {
        self.alpha
    }

    #[inline(always)]
    fn is_mirror(&self) -> bool {
        self.alpha[0] < MIN_ALPHA
    }

    #[inline(always)]
    fn directional_albedo(&self, wo: Vec3) -> DirectionalAlbedo {
        match self.isotropic_alpha() {
            Some(alpha) => DirectionalAlbedo::at(wo.z, alpha),
            None => anisotropic_albedo(self.to_axis(wo), self.alpha),
        }
    }

    #[inline(always)]
    fn dielectric_grazing(&self, wo: Vec3, albedo: DirectionalAlbedo, curve: DielectricCurve) -> f32 {
        match self.isotropic_alpha() {
            Some(alpha) => Isotropic { alpha }.dielectric_grazing(wo, albedo, curve),
            None => anisotropic_dielectric_grazing(self.to_axis(wo), self.alpha, curve).min(albedo.full),
        }
    }

    #[inline(always)]
    fn sample_visible_normal(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        self.from_axis(ggx::sample_visible_normal(self.to_axis(wo), self.alpha, u))
    }

    #[inline(always)]
    fn reflection(&self, wo: Vec3, wi: Vec3) -> Reflection {
        let (wo, wi) = (self.to_axis(wo), self.to_axis(wi));
        let half = wo + wi;
        let (zo, zi) = (wo.z.max(MIN_COS), wi.z.max(MIN_COS));
        let d = self.distribution(half);
        let (root_o, root_i) = (self.smith_root(wo), self.smith_root(wi));
        Reflection {
            f_cos: d * 0.5 * zi / (zi * root_o + zo * root_i),
            pdf_solid_angle: d * 0.5 / (zo + root_o),
            cos_half: 0.5 * half.length(),
        }
    }
}

/// The parameters of a [`Microsurface`].
#[derive(Clone, Copy, Debug)]
pub struct MicrosurfaceProgram {
    /// Perceptual roughness.
    pub roughness: FloatSlot,
    /// KHR_materials_anisotropy; `None` if isotropic.
    pub anisotropy: Option<Anisotropy>,
}

impl MicrosurfaceProgram {
    /// Whether the facets are smooth for all values of the textures.
    pub fn is_always_smooth(&self) -> bool {
        is_always(&self.roughness, 0.0) && self.anisotropy.is_none()
    }

    /// Evaluates the parameters at a hit.
    pub fn evaluate(&self, slots: &impl Slots, frame: &LocalFrame) -> Microsurface {
        let alpha = slots.alpha(&self.roughness);
        let Some(anisotropy) = self.anisotropy else { return Microsurface::isotropic(alpha) };
        let (mut strength, mut direction) = (anisotropy.strength, Vec2::X);
        if let Some(id) = anisotropy.texture {
            let t = slots.color(&ColorSlot::texture(id));
            direction = Vec2::new(2.0 * t.r - 1.0, 2.0 * t.g - 1.0).try_normalize().unwrap_or(Vec2::X);
            strength *= t.b;
        }
        let (sine, cosine) = poly::sin_cos(anisotropy.rotation_rad);
        let rotated =
            Vec2::new(direction.x * cosine - direction.y * sine, direction.x * sine + direction.y * cosine);
        let axis =
            (frame.tangent * rotated.x + frame.bitangent * rotated.y).try_normalize().unwrap_or(Vec2::X);
        let strength = strength.clamp(0.0, 1.0);
        let along = alpha + (1.0 - alpha) * strength * strength;
        Microsurface::new([along, alpha], axis.to_array())
    }
}

// Beckmann facets (Beckmann, Spizzichino 1963), sampled by GGX of the same alphas, with Smith shadowing by the rational fit of Walter
// et al. 2007.

/// Ratio of the Beckmann to the GGX density of normals along a vector: `(1 + t)^2 exp(-t)`, with `t` the squared slope over the squared
/// alpha; at most 4 / e.
#[inline]
pub fn beckmann_over_ggx(half: Vec3, [ax, ay]: [f32; 2]) -> f32 {
    let (x, y) = (half.x / (half.z * ax), half.y / (half.z * ay));
    let t = x * x + y * y;
    if t < 80.0 { (1.0 + t) * (1.0 + t) * poly::exp(-t) } else { 0.0 }
}

/// Smith's Lambda of Beckmann facets, from the cosine of a direction and its [`smith_root`](super::ggx::smith_root).
#[inline]
pub fn beckmann_lambda(cosine: f32, root: f32) -> f32 {
    // root^2 = cos^2 + alpha^2 sin^2.
    let spread = (root * root - cosine * cosine).max(0.0).sqrt();
    let a = cosine / spread.max(1e-12);
    if a < 1.6 { (1.0 - 1.259 * a + 0.396 * a * a) / (3.535 * a + 2.181 * a * a) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::poly;

    #[test]
    fn equal_alphas_are_isotropic() {
        let (wo, wi) = (Vec3::new(0.48, 0.36, 0.8), Vec3::new(-0.6, 0.0, 0.8));
        for alpha in [0.002, 0.1, 1.0] {
            let two = Microsurface::new([alpha; 2], [0.6, 0.8]);
            let (a, b) = (two.reflection(wo, wi), Isotropic { alpha }.reflection(wo, wi));
            assert!((a.f_cos / b.f_cos - 1.0).abs() < 1e-4, "{a:?} {b:?}");
            assert!((a.pdf_solid_angle / b.pdf_solid_angle - 1.0).abs() < 1e-4, "{a:?} {b:?}");
        }
    }

    /// The integral of D cos is 1.
    #[test]
    fn ggx_distribution_is_normalized() {
        for alpha in [[0.3, 0.3], [0.1, 0.6], [1.0, 0.2]] {
            let surface = Microsurface::new(alpha, [1.0, 0.0]);
            let n = 1000;
            let mut sum = 0.0f64;
            for i in 0..n * n {
                // Uniform in azimuth and in squared sine: the measure is cos / pi.
                let turns = (i % n) as f32 / n as f32;
                let sin_squared = ((i / n) as f32 + 0.5) / n as f32;
                let (s, c) = poly::sin_cos_turns(turns);
                let r = sin_squared.sqrt();
                let h = Vec3::new(r * c, r * s, (1.0 - sin_squared).sqrt());
                sum += f64::from(surface.distribution(h) * PI);
            }
            let mean = sum / f64::from(n * n);
            assert!((mean - 1.0).abs() < 2e-3, "{alpha:?}: {mean}");
        }
    }
}

#[cfg(test)]
mod beckmann_tests {
    use super::*;
    use crate::sampling::chi2::Random;
    use std::f64::consts::PI;

    /// The integral of D cos is 1.
    #[test]
    fn beckmann_distribution_is_normalized() {
        for alpha in [[0.1, 0.1], [0.5, 0.5], [0.3, 0.8]] {
            let facets = Microsurface::new(alpha, [1.0, 0.0]);
            let mut random = Random::new(3);
            let samples = 400_000;
            let sum: f64 = (0..samples)
                .map(|_| {
                    let v = random.direction();
                    let v = Vec3::new(v.x, v.y, v.z.abs().max(1e-4));
                    f64::from(facets.distribution(v) * beckmann_over_ggx(v, alpha) * v.z)
                })
                .sum();
            let integral = sum * 2.0 * PI / f64::from(samples);
            assert!((integral - 1.0).abs() < 0.03, "{alpha:?}: {integral}");
        }
    }

    /// The projected area of the visible facets equals the cosine of the direction: the integral of D G1 (v . h) (Heitz 2014, eq. 11).
    #[test]
    fn visible_projected_area_equals_the_cosine() {
        let (alpha, cosine) = ([0.6f32, 0.6], 0.35f32);
        let facets = Microsurface::new(alpha, [1.0, 0.0]);
        let v = Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        let g1 = 1.0 / (1.0 + beckmann_lambda(cosine, facets.smith_root(v)));
        let mut random = Random::new(5);
        let samples = 400_000;
        let sum: f64 = (0..samples)
            .map(|_| {
                let h = random.direction();
                let h = Vec3::new(h.x, h.y, h.z.abs().max(1e-4));
                f64::from(facets.distribution(h) * beckmann_over_ggx(h, alpha) * g1 * v.dot(h).max(0.0))
            })
            .sum();
        let projected_area = sum * 2.0 * PI / f64::from(samples);
        assert!((projected_area / f64::from(cosine) - 1.0).abs() < 0.03, "{projected_area} for {cosine}");
    }
}
