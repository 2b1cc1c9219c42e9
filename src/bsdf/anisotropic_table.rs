//! Directional albedo of facets with two roughnesses, from a table.

use super::albedo_table::DirectionalAlbedo;
use crate::math::Vec3;

/// Nodes along the table's axes: the square root r of the smaller alpha; how far the root of the larger one is from it
/// on the way to 1; the cosine of the azimuth to the rougher direction; and for the view cosine the coordinates
/// of [`super::albedo_table`] with the roughness along that azimuth.
pub const NODES: [usize; 4] = [14, 10, 5, 20];

/// Share of the light lost to shadowing that is taken as not lost: more than interpolation may be wrong by, so that
/// compensation does not add light.
const MARGIN: f32 = 0.2;

/// The largest value of the table's integers, 1.
const UNIT: f32 = 65535.0;

/// Pairs (full, grazing / full) by the axes of [`NODES`].
type Table = [[[[[u16; 2]; NODES[3]]; NODES[2]]; NODES[1]]; NODES[0]];

static ANISOTROPIC: Table = decoded(include_bytes!("anisotropic.bin"));

/// Little-endian numbers, the last axis first.
const fn decoded(bytes: &[u8; size_of::<Table>()]) -> Table {
    let mut table = [[[[[0; 2]; NODES[3]]; NODES[2]]; NODES[1]]; NODES[0]];
    let [_, nb, nc, nd] = NODES;
    let mut n = 0;
    while 2 * n < bytes.len() {
        let at = n / 2;
        let (a, b, c, d) = (at / (nb * nc * nd), at / (nc * nd) % nb, at / nd % nc, at % nd);
        table[a][b][c][d][n % 2] = u16::from_le_bytes([bytes[2 * n], bytes[2 * n + 1]]);
        n += 1;
    }
    table
}

/// The albedo of facets with alphas along x and y under a direction, interpolated linearly on all axes, on the
/// side of too large values.
#[inline]
pub fn anisotropic_albedo(wo: Vec3, alpha: [f32; 2]) -> DirectionalAlbedo {
    let (along, across, x, y) = match alpha[0] >= alpha[1] {
        true => (alpha[0], alpha[1], wo.x, wo.y),
        false => (alpha[1], alpha[0], wo.y, wo.x),
    };
    let [large, small] = [along, across].map(|a| a.clamp(0.0, 1.0).sqrt());
    let spread = (large - small) / (1.0 - small).max(1e-6);
    let tangent = x * x + y * y;
    let squared = if tangent > 1e-12 { x * x / tangent } else { 0.5 };
    let seen = along * along * squared + across * across * (1.0 - squared);
    let (azimuth, root, roughness) = (squared.sqrt(), wo.z.clamp(0.0, 1.0).sqrt(), seen.sqrt().sqrt());
    let relative = root * (1.0 + roughness) / (root + roughness + 1e-9);
    let full = interpolate([small, spread, azimuth, relative], 0);
    let grazing = interpolate([small, spread, azimuth, root], 1);
    let (full, grazing) = (full + MARGIN * (1.0 - full), full * grazing);
    DirectionalAlbedo { full, grazing: (grazing + 0.3 * MARGIN * (1.0 - full)).min(full) }
}

/// The first or second number of the table at a place, coordinates from 0 to 1.
#[inline]
fn interpolate(place: [f32; 4], which: usize) -> f32 {
    let at: [(usize, f32); 4] = std::array::from_fn(|axis| {
        let x = place[axis].clamp(0.0, 1.0) * (NODES[axis] - 1) as f32;
        let i = (x as usize).min(NODES[axis] - 2);
        (i, x - i as f32)
    });
    let mut sum = 0.0;
    for corner in 0..16 {
        let mut weight = 1.0;
        let index: [usize; 4] = std::array::from_fn(|axis| {
            let (i, t) = at[axis];
            let upper = corner >> axis & 1;
            weight *= if upper == 1 { t } else { 1.0 - t };
            i + upper
        });
        sum += weight * f32::from(ANISOTROPIC[index[0]][index[1]][index[2]][index[3]][which]);
    }
    sum * (1.0 / UNIT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::{Facets, Microsurface, fresnel};
    use crate::sampling::chi2::Random;

    /// The same by quadrature over visible normals on a Fibonacci lattice.
    fn integrate(wo: Vec3, alpha: [f32; 2], points: u32) -> [f64; 2] {
        let surface = Microsurface { alpha: alpha.map(|a| a.max(2e-3)), axis: [1.0, 0.0] };
        let mut sums = [0.0f64; 2];
        for i in 0..points {
            let turn = (f64::from(i) * 0.618_033_988_749_894_9).fract();
            let normal = surface.sample_visible_normal(wo, [turn as f32, (i as f32 + 0.5) / points as f32]);
            let wi = normal * (2.0 * wo.dot(normal)) - wo;
            if wi.z > 0.0 {
                let r = surface.reflection(wo, wi);
                let weight = f64::from(r.f_cos / r.pdf_solid_angle);
                sums[0] += weight;
                sums[1] += weight * f64::from(fresnel::schlick_weight(wo.dot(normal)));
            }
        }
        sums.map(|s| s / f64::from(points))
    }

    fn direction(cosine: f32, azimuth: f32) -> Vec3 {
        let cosine = cosine.max(1e-6);
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        Vec3::new(sine * azimuth, sine * (1.0 - azimuth * azimuth).sqrt(), cosine)
    }

    /// What a node holds: full, and the ratio of grazing to it.
    fn node(index: [usize; 4], points: u32) -> [f64; 2] {
        let x: [f32; 4] = std::array::from_fn(|axis| index[axis] as f32 / (NODES[axis] - 1) as f32);
        let small = x[0].max(0.045);
        let large = small + (1.0 - small) * x[1];
        let seen = (large.powi(4) * x[2] * x[2] + small.powi(4) * (1.0 - x[2] * x[2])).sqrt();
        let roughness = seen.sqrt();
        let root = x[3] * roughness / (1.0 + roughness - x[3]);
        let alpha = [large * large, small * small];
        let full = integrate(direction(root * root, x[2]), alpha, points)[0];
        let [all, grazing] = integrate(direction(x[3] * x[3], x[2]), alpha, points);
        [full, grazing / all]
    }

    fn indices() -> impl Iterator<Item = [usize; 4]> {
        let [a, b, c, d] = NODES;
        (0..a * b * c * d).map(move |n| [n / (b * c * d), n / (c * d) % b, n / d % c, n % d])
    }

    /// Writes the data file when `OSCURA_WRITE_TABLES` is set, then compares every 97th node.
    #[test]
    fn table_is_the_integral() {
        if std::env::var_os("OSCURA_WRITE_TABLES").is_some() {
            let quantised = |v: f64| ((v.clamp(0.0, 1.0) * f64::from(UNIT)).round() as u16).to_le_bytes();
            let bytes: Vec<u8> = indices().flat_map(|i| node(i, 2584)).flat_map(quantised).collect();
            std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/anisotropic.bin"), bytes).unwrap();
            return;
        }
        for index in indices().step_by(97) {
            let exact = node(index, 2584);
            let [a, b, c, d] = index;
            for k in 0..2 {
                let found = f64::from(ANISOTROPIC[a][b][c][d][k]) / 65535.0;
                assert!((found - exact[k]).abs() < 1e-4, "{index:?}: {found} {exact:?}");
            }
        }
    }

    #[test]
    fn interpolation_stays_close_between_nodes() {
        let mut random = Random::new(5);
        let (mut errors, mut beyond) = (Vec::new(), 0);
        for _ in 0..4000 {
            let large = (0.05 + 0.95 * random.next()).powi(2);
            let alpha = [large, large * (0.0625 + 0.9375 * random.next())];
            let wo = direction(random.next(), random.next());
            let exact = integrate(wo, alpha, 2584)[0];
            let found = f64::from(anisotropic_albedo(wo, alpha).full);
            errors.push((found - exact).abs());
            beyond += u32::from(exact > found + 1e-3);
        }
        errors.sort_by(f64::total_cmp);
        let (median, worst) = (errors[2000], errors[3999]);
        println!("median {median:.5}, worst {worst:.5}, {beyond} of 4000 underestimated");
        // The margin alone makes up a fifth of what is lost, at most 0.14.
        assert!(median < 0.03 && worst < 0.15 && beyond < 40, "{median} {worst} {beyond}");
    }
}
