//! Sheen: scattering by fibres that stand on a surface, as of velvet, cloth or dust.

use super::{BsdfEval, BsdfSample, ggx};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::sampling::warp;
use std::f32::consts::FRAC_1_PI;

/// Nodes along each axis of the table: roughness 0..1, then view cosine 0..1.
const NODES: usize = 16;

/// Triples (a, b, R) by roughness and view cosine.
static SHEEN: [[[f32; 3]; NODES]; NODES] = table_file!(f32, "sheen.bin");

/// A layer of normally oriented fibres (Zeltner, Burley, Chiang 2022, "Practical Multiple-Scattering Sheen Using Linearly
/// Transformed Cosines"): all orders of scattering in a slab of SGGX microflakes, fitted by a linearly transformed cosine
/// (Heitz et al. 2016) times the slab's reflectance R. The table was simulated and fitted by the tests of this file. Two-sided, not
/// reciprocal; the albedo is exactly colour times R:
///
/// | R, view cosine | 0 | 0.07 | 0.2 | 0.47 | 0.73 | 1 |
/// |---|---|---|---|---|---|---|
/// | roughness 0.2 | 0.69 | 0.41 | 0.09 | 0.00 | 0.00 | 0.00 |
/// | roughness 0.53 | 0.70 | 0.61 | 0.45 | 0.20 | 0.08 | 0.03 |
/// | roughness 0.8 | 0.72 | 0.67 | 0.58 | 0.40 | 0.27 | 0.18 |
/// | roughness 1 | 0.76 | 0.72 | 0.65 | 0.51 | 0.41 | 0.34 |
#[derive(Clone, Copy, Debug)]
pub struct Sheen {
    /// Factor on the reflectance, 0..1; black for no sheen.
    pub color: Rgb,
    /// Roughness, 0..1: square root of the flakes' cross section along the fibre.
    pub roughness: f32,
}

/// The linearly transformed cosine for a view direction: the matrix ((a, 0, b), (0, a, 0), (0, 0, 1)) maps the lobe to a clamped cosine.
#[derive(Clone, Copy, Debug)]
struct LtcLobe {
    a: f32,
    b: f32,
    /// Cosine and sine of the view direction's azimuth.
    azimuth: [f32; 2],
}

/// Bilinear interpolation of a, b and R.
#[inline(always)]
fn lookup(roughness: f32, cosine: f32) -> [f32; 3] {
    let locate = |x: f32| {
        let x = x.clamp(0.0, 1.0) * (NODES - 1) as f32;
        let i = (x as usize).min(NODES - 2);
        (i, x - i as f32)
    };
    let ((i, s), (j, t)) = (locate(roughness), locate(cosine));
    [0, 1, 2].map(|c| {
        let low = SHEEN[i][j][c] + t * (SHEEN[i][j + 1][c] - SHEEN[i][j][c]);
        let high = SHEEN[i + 1][j][c] + t * (SHEEN[i + 1][j + 1][c] - SHEEN[i + 1][j][c]);
        low + s * (high - low)
    })
}

impl Sheen {
    /// No sheen.
    pub const NONE: Sheen = Sheen { color: Rgb::ZERO, roughness: 0.0 };

    /// Directional albedo R of white sheen for a view cosine.
    #[inline(always)]
    pub fn albedo(&self, cosine: f32) -> f32 {
        lookup(self.roughness, cosine)[2]
    }

    #[inline(always)]
    fn lobe(&self, wo: Vec3) -> LtcLobe {
        let [a, b, _] = lookup(self.roughness, wo.z.abs());
        let length = (wo.x * wo.x + wo.y * wo.y).sqrt();
        let azimuth = if length > ggx::MIN_COS { [wo.x / length, wo.y / length] } else { [1.0, 0.0] };
        LtcLobe { a, b, azimuth }
    }

    /// Samples the lobe normalised to albedo 1; see [`super::Bsdf::sample`].
    #[inline]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let LtcLobe { a, b, azimuth: [c, s] } = self.lobe(wo);
        let w = warp::cosine_hemisphere([u[0], u[1]]);
        let (x, y) = ((w.x - b * w.z) / a, w.y / a);
        let up = Vec3::new(x * c - y * s, x * s + y * c, w.z).normalize();
        let wi = Vec3::new(up.x, up.y, up.z.copysign(wo.z));
        let pdf_solid_angle = self.eval(wo, wi).pdf_solid_angle;
        BsdfSample { wi, weight: Rgb::ONE, pdf_solid_angle, ..BsdfSample::ABSORBED }
    }

    /// Value and pdf of the lobe normalised to albedo 1; see [`super::Bsdf::eval`].
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if (wo.z < 0.0) != (wi.z < 0.0) {
            return BsdfEval::ZERO;
        }
        let LtcLobe { a, b, azimuth: [c, s] } = self.lobe(wo);
        let z = wi.z.abs();
        let (x, y) = (wi.x * c + wi.y * s, wi.y * c - wi.x * s);
        let (tx, ty) = (a * x + b * z, a * y);
        let length_squared = tx * tx + ty * ty + z * z;
        // Clamped cosine z / (pi l) times the Jacobian a^2 / l^3.
        let pdf_solid_angle = a * a * z * FRAC_1_PI / (length_squared * length_squared).max(1e-30);
        BsdfEval { f_cos: Rgb::splat(pdf_solid_angle), pdf_solid_angle }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;
    use crate::sampling::chi2::Random;

    /// Random walk through the slab (unit thickness, unit density, white flakes with the SGGX matrix diag(1, 1, s^2), Heitz et al. 2015);
    /// the exit direction if it leaves at the top.
    fn walk(random: &mut Random, mut direction: DVec3, s: f64) -> Option<DVec3> {
        let mut depth = 0.0;
        loop {
            let stretched = DVec3::new(direction.x, direction.y, direction.z * s);
            let extinction = stretched.length();
            depth -= direction.z * -(1.0 - f64::from(random.next())).ln() / extinction;
            if !(0.0..1.0).contains(&depth) {
                return (depth < 0.0).then_some(direction);
            }
            // Sample a visible flake normal: the ellipsoid of normals is a sphere scaled by diag(1, 1, s).
            let local = warp::cosine_hemisphere([random.next(), random.next()]).as_dvec3();
            let axis = -stretched / extinction;
            let (t, b) = axis.any_orthonormal_pair();
            let on_sphere = t * local.x + b * local.y + axis * local.z;
            let flake = DVec3::new(on_sphere.x, on_sphere.y, on_sphere.z * s).normalize();
            direction = (direction - flake * (2.0 * direction.dot(flake))).normalize();
        }
    }

    /// Reflectance and exit directions by simulation, with at most `most` walks until `wanted` have returned.
    fn simulate(cosine: f64, roughness: f64, most: usize, wanted: usize) -> (f64, Vec<DVec3>) {
        let cosine = cosine.max(0.01);
        let mut random = Random::new(7);
        let into = DVec3::new(-(1.0 - cosine * cosine).sqrt(), 0.0, -cosine);
        let (mut up, mut walks) = (Vec::new(), 0);
        while walks < most && up.len() < wanted {
            walks += 1;
            up.extend(walk(&mut random, into, roughness.max(0.02).powi(2)));
        }
        (up.len() as f64 / walks as f64, up)
    }

    /// Maximum likelihood fit of a and b: maximises 2 ln a - 4 <ln l> by pattern search.
    fn fit(up: &[DVec3], start: [f64; 2]) -> [f64; 2] {
        let n = up.len() as f64;
        let likelihood = |[a, b]: [f64; 2]| {
            let ln_l = |w: &DVec3| ((a * w.x + b * w.z).powi(2) + (a * w.y).powi(2) + w.z * w.z).ln();
            2.0 * a.ln() - 2.0 * up.iter().map(ln_l).sum::<f64>() / n
        };
        let mut at = start;
        let mut step = 0.5;
        let mut best = likelihood(at);
        while step > 1e-4 {
            let tries = [[step, 0.0], [-step, 0.0], [0.0, step], [0.0, -step]];
            let next = tries
                .map(|[da, db]| [(at[0] * (1.0 + da)).max(1e-3), at[1] + db])
                .map(|p| (likelihood(p), p))
                .into_iter()
                .max_by(|x, y| x.0.total_cmp(&y.0));
            match next {
                Some((value, p)) if value > best => (best, at) = (value, p),
                _ => step *= 0.5,
            }
        }
        at
    }

    /// Writes the data file when `OSCURA_WRITE_TABLES` is set, then compares some reflectances with new simulations.
    #[test]
    fn table_agrees_with_simulation() {
        if std::env::var_os("OSCURA_WRITE_TABLES").is_some() {
            let mut bytes = Vec::new();
            for i in 0..NODES {
                let mut last = [1.0, 0.0];
                for j in 0..NODES {
                    let [r, c] = [i, j].map(|k| k as f64 / (NODES - 1) as f64);
                    let (reflectance, up) = simulate(c, r, 1_000_000, 30_000);
                    if up.len() >= 2_000 {
                        last = fit(&up, last);
                    }
                    let b = if j + 1 == NODES { 0.0 } else { last[1] };
                    // Five decimals are within the noise of the simulation.
                    let rounded = [last[0], b, reflectance].map(|x| ((x * 1e5).round() * 1e-5) as f32);
                    bytes.extend(rounded.into_iter().flat_map(f32::to_le_bytes));
                }
            }
            std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/sheen.bin"), bytes).unwrap();
            return;
        }
        for (i, j) in [(3, 2), (7, 5), (12, 9), (15, 15), (15, 1), (5, 12)] {
            let [r, c] = [i, j].map(|k| k as f64 / (NODES - 1) as f64);
            let (exact, _) = simulate(c, r, 40_000, usize::MAX);
            let found = f64::from(SHEEN[i][j][2]);
            // Four standard errors of both simulations.
            let error = 4.0 * (exact * (1.0 - exact) / 40_000.0 + found * found / 30_000.0).sqrt();
            assert!((found - exact).abs() < error + 1e-5, "{i} {j}: {found} {exact}");
        }
    }

    #[test]
    fn mean_direction_of_the_fitted_lobe_agrees_with_simulation() {
        for (roughness, cosine) in [(0.4, 0.4f64), (0.8, 0.2), (1.0, 0.8)] {
            let (_, up) = simulate(cosine, roughness, 200_000, 20_000);
            let mean = up.iter().sum::<DVec3>() / up.len() as f64;
            let sheen = Sheen { color: Rgb::ONE, roughness: roughness as f32 };
            let wo = Vec3::new((1.0 - cosine * cosine).sqrt() as f32, 0.0, cosine as f32);
            let mut random = Random::new(9);
            let n = 20_000;
            let fitted = (0..n)
                .map(|_| sheen.sample(wo, [random.next(), random.next(), 0.0]).wi.as_dvec3())
                .sum::<DVec3>()
                / f64::from(n);
            assert!((mean - fitted).length() < 0.1, "{roughness} {cosine}: {mean} {fitted}");
        }
    }
}
