//! Facets whose slopes are normally distributed (Beckmann and Spizzichino 1963), beside those of GGX with the same alphas, by which they
//! are sampled. Their shadowing is Smith's, by the rational fit of Walter et al. 2007.

use crate::math::{Vec3, poly};

/// Density of normals along a vector over that of GGX: `(1 + t)^2 exp(-t)` for the squared slope `t` over the squared alpha, at most 4 / e.
#[inline]
pub fn over_ggx(half: Vec3, [ax, ay]: [f32; 2]) -> f32 {
    let (x, y) = (half.x / (half.z * ax), half.y / (half.z * ay));
    let t = x * x + y * y;
    if t < 80.0 { (1.0 + t) * (1.0 + t) * poly::exp(-t) } else { 0.0 }
}

/// Smith's lambda: facets that hide others over facets seen, from the cosine of a direction and the root of
/// [`smith_root`](super::ggx::smith_root).
#[inline]
pub fn hidden(cosine: f32, root: f32) -> f32 {
    // The root is that of the squared cosine and the squared alpha times the squared sine.
    let spread = (root * root - cosine * cosine).max(0.0).sqrt();
    let a = cosine / spread.max(1e-12);
    if a < 1.6 { (1.0 - 1.259 * a + 0.396 * a * a) / (3.535 * a + 2.181 * a * a) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::Microsurface;
    use crate::sampling::chi2::Random;
    use std::f64::consts::PI;

    /// Projected onto the surface, facets cover it once.
    #[test]
    fn facets_cover_the_surface() {
        for alpha in [[0.1, 0.1], [0.5, 0.5], [0.3, 0.8]] {
            let facets = Microsurface::new(alpha, [1.0, 0.0]);
            let mut random = Random::new(3);
            let samples = 400_000;
            let sum: f64 = (0..samples)
                .map(|_| {
                    let v = random.direction();
                    let v = Vec3::new(v.x, v.y, v.z.abs().max(1e-4));
                    f64::from(facets.distribution(v) * over_ggx(v, alpha) * v.z)
                })
                .sum();
            let covered = sum * 2.0 * PI / f64::from(samples);
            assert!((covered - 1.0).abs() < 0.03, "{alpha:?}: {covered}");
        }
    }

    /// What is seen of the facets along a direction fills its cosine: the mean of `G1 (v . h)` over facets (Heitz 2014, eq. 11).
    #[test]
    fn visible_facets_fill_the_cosine() {
        let (alpha, cosine) = ([0.6f32, 0.6], 0.35f32);
        let facets = Microsurface::new(alpha, [1.0, 0.0]);
        let v = Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        let seen = 1.0 / (1.0 + hidden(cosine, facets.smith_root(v)));
        let mut random = Random::new(5);
        let samples = 400_000;
        let sum: f64 = (0..samples)
            .map(|_| {
                let h = random.direction();
                let h = Vec3::new(h.x, h.y, h.z.abs().max(1e-4));
                f64::from(facets.distribution(h) * over_ggx(h, alpha) * seen * v.dot(h).max(0.0))
            })
            .sum();
        let filled = sum * 2.0 * PI / f64::from(samples);
        assert!((filled / f64::from(cosine) - 1.0).abs() < 0.03, "{filled} for {cosine}");
    }
}
