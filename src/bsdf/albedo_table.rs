//! Directional albedo of the GGX lobe, from a table: how much of the light from a direction single scattering returns.

use super::albedo_data::ALBEDO;
use crate::math::Vec3;

/// Nodes along each axis of the table: roughness r = sqrt(alpha), and for `full` s (1 + r) / (s + r) with s the square
/// root of the view cosine (its features move with cos / alpha), for the ratio
/// of `grazing` to it s itself.
pub const NODES: usize = 32;

/// Directional albedo at one view cosine and alpha. With Schlick's Fresnel term the albedo is linear in f0 and f90.
#[derive(Clone, Copy, Debug)]
pub struct DirectionalAlbedo {
    /// For a reflectance of 1.
    pub full: f32,
    /// The share weighted by (1 - cos)^5.
    pub grazing: f32,
}

impl DirectionalAlbedo {
    /// Interpolated bilinearly; errors are below 0.003 of `full` and 0.01 of `grazing`.
    #[inline(always)]
    pub fn at(cos_o: f32, alpha: f32) -> DirectionalAlbedo {
        let locate = |x: f32| {
            let x = x.clamp(0.0, 1.0) * (NODES - 1) as f32;
            let i = (x as usize).min(NODES - 2);
            (i, x - i as f32)
        };
        let (root, roughness) = (cos_o.clamp(0.0, 1.0).sqrt(), alpha.clamp(0.0, 1.0).sqrt());
        let (row, t) = locate(roughness);
        let (low, high) = (&ALBEDO[row], &ALBEDO[row + 1]);
        let value = |k: usize, x: f32| {
            let (column, s) = locate(x);
            let a = low[column][k] + s * (low[column + 1][k] - low[column][k]);
            let b = high[column][k] + s * (high[column + 1][k] - high[column][k]);
            a + t * (b - a)
        };
        let relative = root * (1.0 + roughness) / (root + roughness + 1e-9);
        let full = value(0, relative);
        DirectionalAlbedo { full, grazing: full * value(1, root) }
    }

    /// The factor that gives back what single scattering loses (Turquin 2019, eq. 16).
    #[inline(always)]
    pub fn compensation(&self, f0: Vec3) -> Vec3 {
        Vec3::ONE + f0 * ((1.0 - self.full) / self.full)
    }

    /// Albedo of single scattering with Schlick's Fresnel term.
    #[inline(always)]
    pub fn reflectance(&self, f0: Vec3, f90: f32) -> Vec3 {
        f0 * (self.full - self.grazing) + Vec3::splat(f90 * self.grazing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::{fresnel, ggx};

    /// The same by quadrature over visible normals, on a Fibonacci lattice.
    fn integrate(cos_o: f32, alpha: f32, points: u32) -> [f64; 2] {
        let cos_o = cos_o.max(1e-6);
        let wo = Vec3::new((1.0 - cos_o * cos_o).max(0.0).sqrt(), 0.0, cos_o);
        let alpha = alpha.max(1e-4);
        let mut sums = [0.0f64; 2];
        for i in 0..points {
            let turn = (f64::from(i) * 0.618_033_988_749_894_9).fract();
            let u = [turn as f32, (i as f32 + 0.5) / points as f32];
            let normal = ggx::sample_visible_normal(wo, [alpha; 2], u);
            let wi = normal * (2.0 * wo.dot(normal)) - wo;
            if wi.z > 0.0 {
                let r = ggx::reflection(wo, wi, alpha);
                let weight = f64::from(r.f_cos / r.pdf_solid_angle);
                sums[0] += weight;
                sums[1] += weight * f64::from(fresnel::schlick_weight(wo.dot(normal)));
            }
        }
        sums.map(|s| s / f64::from(points))
    }

    /// What a node of the table holds. The first row stands for a tiny roughness.
    fn node(row: usize, column: usize, points: u32) -> [f64; 2] {
        let [r, x] = [row, column].map(|i| i as f32 / (NODES - 1) as f32);
        let r = r.max(0.01);
        let relative = x * r / (1.0 + r - x);
        let [full, grazing] = integrate(x * x, r * r, points);
        [integrate(relative * relative, r * r, points)[0], grazing / full]
    }

    /// Writes the data file when `OSCURA_WRITE_TABLES` is set, then compares every seventh node.
    #[test]
    fn table_is_the_integral() {
        if std::env::var_os("OSCURA_WRITE_TABLES").is_some() {
            let mut text = String::from(
                "//! Data of `albedo_table`: rows by roughness, columns by sqrt(cos), pairs (full, grazing). Written by its\n//! test `table_is_the_integral`.\n\n#[rustfmt::skip]\npub static ALBEDO: [[[f32; 2]; 32]; 32] = [\n",
            );
            for row in 0..NODES {
                text += "    [\n";
                for group in 0..NODES / 4 {
                    text += "       ";
                    for column in group * 4..group * 4 + 4 {
                        let [full, grazing] = node(row, column, 46368);
                        text += &format!(" [{full:.5}, {grazing:.5}],");
                    }
                    text += "\n";
                }
                text += "    ],\n";
            }
            let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/albedo_data.rs");
            std::fs::write(path, text + "];\n").unwrap();
            return;
        }
        for i in (0..NODES * NODES).step_by(7) {
            let [row, column] = [i / NODES, i % NODES];
            let exact = node(row, column, 17711);
            for k in 0..2 {
                let found = f64::from(ALBEDO[row][column][k]);
                assert!((found - exact[k]).abs() < 2e-3, "{row} {column}: {found} {exact:?}");
            }
        }
    }

    #[test]
    fn interpolation_stays_close_between_nodes() {
        let (mut full, mut grazing) = (0.0f64, 0.0f64);
        // From just above the mirror limit on.
        for row in 1..NODES - 1 {
            for column in 0..NODES - 1 {
                let centre = |i: usize| ((i as f32 + 0.5) / (NODES - 1) as f32).powi(2);
                let (c, a) = (centre(column), centre(row));
                let found = DirectionalAlbedo::at(c, a);
                let exact = integrate(c, a, 6765);
                full = full.max((f64::from(found.full) - exact[0]).abs());
                grazing = grazing.max((f64::from(found.grazing) - exact[1]).abs());
            }
        }
        assert!(full < 3e-3 && grazing < 0.01, "{full} {grazing}");
    }
}
