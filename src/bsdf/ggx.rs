//! Isotropic GGX distribution of microfacet normals (Walter et al. 2007) with height-correlated Smith shadowing (Heitz 2014), and a table
//! of its single-scattering directional albedo. Directions have z above 0.

use crate::color::Rgb;
use crate::math::{Vec3, poly};
use std::f32::consts::PI;

/// Below this alpha a surface is treated as an exact mirror: its lobe is narrower than 0.1 degrees.
pub const MIN_ALPHA: f32 = 1e-3;

/// Minimum cosine in denominators.
pub const MIN_COS: f32 = 1e-6;

/// Mirrors a direction to the upper side (z > 0), with a z of at least [`MIN_COS`].
#[inline(always)]
pub fn to_upper_side(wo: Vec3) -> Vec3 {
    let z = wo.z.abs();
    Vec3::new(wo.x, wo.y, if z > MIN_COS { z } else { MIN_COS })
}

/// The root in Smith's masking G1 = 2 z / (z + root): sqrt(alpha^2 + (1 - alpha^2) z^2).
#[inline(always)]
pub fn smith_root(z: f32, alpha_squared: f32) -> f32 {
    (alpha_squared + (1.0 - alpha_squared) * z * z).sqrt()
}

/// Samples a visible normal by a spherical cap (Dupuy, Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps", listing 3).
/// `alpha`: along x and y.
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

/// Colour-independent terms of microfacet reflection for a pair of directions.
#[derive(Clone, Copy, Debug)]
pub struct Reflection {
    /// f |cos| for a reflectance of 1: D G2 / (4 wo.z).
    pub f_cos: f32,
    /// Solid-angle pdf of `wi` under visible-normal sampling.
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
    // D with the unnormalised half vector: sin^2 + alpha^2 cos^2 has no cancellation for small alpha.
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

/// Rows of the table: roughness r = sqrt(alpha) from [`MIN_ROUGHNESS`] to 1.
const ROWS: usize = 128;
/// Columns of the table, with s the square root of the view cosine: s for `grazing / full`; s (1 + r) / (s + r) for `full`, whose
/// features scale with cos / alpha.
const COLUMNS: usize = 96;
/// Square root of [`MIN_ALPHA`].
pub(super) const MIN_ROUGHNESS: f32 = 0.031_622_777;
const _: () = assert!((MIN_ROUGHNESS * MIN_ROUGHNESS - MIN_ALPHA).abs() < 1e-9);

/// Pairs (full, grazing / full).
static ALBEDO: [[[f32; 2]; COLUMNS]; ROWS] = table_file!(f32, "albedo.bin");

/// Single-scattering directional albedo for a view cosine and alpha. With Schlick's Fresnel term the albedo is linear in f0 and f90.
#[derive(Clone, Copy, Debug)]
pub struct DirectionalAlbedo {
    /// Albedo for a reflectance of 1.
    pub full: f32,
    /// Albedo weighted by (1 - cos)^5 of the facets.
    pub grazing: f32,
}

impl DirectionalAlbedo {
    /// Bilinear interpolation; errors are below 0.04 % of `full`, and 0.0006 in `grazing`.
    #[inline(always)]
    pub fn at(cos_o: f32, alpha: f32) -> DirectionalAlbedo {
        let locate = |x: f32, nodes: usize| {
            let x = x.clamp(0.0, 1.0) * (nodes - 1) as f32;
            let i = (x as usize).min(nodes - 2);
            (i, x - i as f32)
        };
        let (root, roughness) = (cos_o.clamp(0.0, 1.0).sqrt(), alpha.clamp(0.0, 1.0).sqrt());
        let (row, t) = locate((roughness - MIN_ROUGHNESS) * (1.0 / (1.0 - MIN_ROUGHNESS)), ROWS);
        let (low, high) = (&ALBEDO[row], &ALBEDO[row + 1]);
        let value = |k: usize, x: f32| {
            let (column, s) = locate(x, COLUMNS);
            let a = low[column][k] + s * (low[column + 1][k] - low[column][k]);
            let b = high[column][k] + s * (high[column + 1][k] - high[column][k]);
            a + t * (b - a)
        };
        let relative = root * (1.0 + roughness) / (root + roughness + 1e-9);
        let full = value(0, relative);
        DirectionalAlbedo { full, grazing: full * value(1, root) }
    }

    /// The energy compensation factor of single scattering (Turquin 2019, eq. 16).
    #[inline(always)]
    pub fn compensation(&self, f0: Rgb) -> Rgb {
        Rgb::ONE + f0 * ((1.0 - self.full) / self.full)
    }

    /// Albedo of single scattering with Schlick's Fresnel term.
    #[inline(always)]
    pub fn reflectance(&self, f0: Rgb, f90: f32) -> Rgb {
        f0 * (self.full - self.grazing) + Rgb::splat(f90 * self.grazing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::reference::reflected;
    use crate::sampling::chi2::Random;

    /// The values of a node by quadrature.
    fn node(row: usize, column: usize) -> [f64; 2] {
        let least = f64::from(MIN_ROUGHNESS);
        let r = least + (1.0 - least) * row as f64 / (ROWS - 1) as f64;
        let x = column as f64 / (COLUMNS - 1) as f64;
        let relative = x * r / (1.0 + r - x);
        let [full, grazing] = reflected(x * x, r * r, 8_000);
        [reflected(relative * relative, r * r, 8_000)[0], grazing / full]
    }

    /// Writes the data file when `OSCURA_WRITE_TABLES` is set, then compares some nodes.
    #[test]
    fn table_equals_quadrature() {
        if std::env::var_os("OSCURA_WRITE_TABLES").is_some() {
            let nodes = (0..ROWS * COLUMNS).map(|i| node(i / COLUMNS, i % COLUMNS));
            let bytes: Vec<u8> = nodes.flatten().flat_map(|v| (v as f32).to_le_bytes()).collect();
            std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/albedo.bin"), bytes).unwrap();
            return;
        }
        for i in (0..ROWS * COLUMNS).step_by(61) {
            let [row, column] = [i / COLUMNS, i % COLUMNS];
            let exact = node(row, column);
            for k in 0..2 {
                let found = f64::from(ALBEDO[row][column][k]);
                assert!((found - exact[k]).abs() < 1e-6, "{row} {column}: {found} {exact:?}");
            }
        }
    }

    #[test]
    fn interpolation_errors_are_bounded() {
        let mut random = Random::new(3);
        let (mut full, mut grazing) = (0.0f64, 0.0f64);
        for i in 0..2000 {
            let r = MIN_ROUGHNESS + (1.0 - MIN_ROUGHNESS) * random.next();
            let x = random.next();
            // Half of the cosines are concentrated near alpha.
            let s = if i % 2 == 0 { x } else { x * r / (1.0 + r - x) };
            let found = DirectionalAlbedo::at(s * s, r * r);
            let exact = reflected(f64::from(s * s), f64::from(r * r), 8_000);
            full = full.max((f64::from(found.full) / exact[0] - 1.0).abs());
            grazing = grazing.max((f64::from(found.grazing) - exact[1]).abs());
        }
        println!("largest errors: {full:.6} of full, {grazing:.6} in grazing");
        assert!(full < 4e-4 && grazing < 6e-4, "{full} {grazing}");
    }
}
