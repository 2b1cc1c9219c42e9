//! Directional albedo of the GGX lobe, from a table: how much of the light from a direction single scattering returns.

use super::ggx::MIN_ALPHA;
use crate::color::Rgb;

/// Rows by roughness r = sqrt(alpha) from the least to 1.
const ROWS: usize = 128;
/// Columns: for `full` by s (1 + r) / (s + r) with s the square root of the view cosine (its features move with
/// cos / alpha), for the ratio of `grazing` to it by s itself.
const COLUMNS: usize = 96;
/// The square root of [`MIN_ALPHA`]: smoother facets are a mirror.
pub(super) const MIN_ROUGHNESS: f32 = 0.031_622_777;
const _: () = assert!((MIN_ROUGHNESS * MIN_ROUGHNESS - MIN_ALPHA).abs() < 1e-9);

/// Pairs (full, grazing / full).
static ALBEDO: [[[f32; 2]; COLUMNS]; ROWS] = decoded(include_bytes!("albedo.bin"));

/// Little-endian numbers, row after row.
const fn decoded(bytes: &[u8; 8 * COLUMNS * ROWS]) -> [[[f32; 2]; COLUMNS]; ROWS] {
    let mut table = [[[0.0; 2]; COLUMNS]; ROWS];
    let mut i = 0;
    while i < 2 * COLUMNS * ROWS {
        let b = [bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2], bytes[4 * i + 3]];
        table[i / 2 / COLUMNS][i / 2 % COLUMNS][i % 2] = f32::from_le_bytes(b);
        i += 1;
    }
    table
}

/// Directional albedo at one view cosine and alpha. With Schlick's Fresnel term the albedo is linear in f0 and f90.
#[derive(Clone, Copy, Debug)]
pub struct DirectionalAlbedo {
    /// For a reflectance of 1.
    pub full: f32,
    /// The share weighted by (1 - cos)^5.
    pub grazing: f32,
}

impl DirectionalAlbedo {
    /// Interpolated bilinearly; errors are below 0.0004 of `full` and 0.0006 in `grazing`.
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

    /// The factor that gives back what single scattering loses (Turquin 2019, eq. 16).
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

    /// What a node of the table holds.
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
    fn table_is_the_integral() {
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
    fn interpolation_stays_close_between_nodes() {
        let mut random = Random::new(3);
        let (mut full, mut grazing) = (0.0f64, 0.0f64);
        for i in 0..2000 {
            let r = MIN_ROUGHNESS + (1.0 - MIN_ROUGHNESS) * random.next();
            let x = random.next();
            // Half of the places crowd where the cosine is near alpha.
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
