//! Directional albedo of rough glass: the share of light that single scattering reflects and transmits, from a table.

use super::glass_data::GLASS;

/// Nodes along the table's axes: sqrt((ior - 1) / (ior + 1)), sqrt(alpha), and for the view cosine the coordinate of
/// [`super::albedo_table`].
pub const NODES: [usize; 3] = [20, 20, 32];

/// The largest value of the table's integers, an albedo of 1.
const UNIT: f32 = 65535.0;

/// What a ray from outside (or inside) a solid of an index of refraction finds again outside and inside after one
/// facet, interpolated trilinearly. Errors are below 0.006 for indices from 1.2 on, below 0.014 for smaller ones.
#[inline]
pub fn glass_albedo(cos_o: f32, alpha: f32, ior: f32, is_inside: bool) -> f32 {
    let (root, roughness) = (cos_o.clamp(0.0, 1.0).sqrt(), alpha.clamp(0.0, 1.0).sqrt());
    // An index below 1 is the inverse index seen from the other side.
    let (ior, is_inside) = if ior < 1.0 { (1.0 / ior, !is_inside) } else { (ior, is_inside) };
    let density = ((ior - 1.0) / (ior + 1.0)).clamp(0.0, 1.0).sqrt();
    let relative = root * (1.0 + roughness) / (root + roughness + 1e-9);
    let locate = |x: f32, nodes: usize| {
        let x = x * (nodes - 1) as f32;
        let i = (x as usize).min(nodes - 2);
        (i, x - i as f32)
    };
    let (i, s) = locate(density, NODES[0]);
    let (j, t) = locate(roughness, NODES[1]);
    let (k, w) = locate(relative.min(1.0), NODES[2]);
    let table = &GLASS[usize::from(is_inside)];
    let line = |i: usize, j: usize| {
        let (a, b) = (f32::from(table[i][j][k]), f32::from(table[i][j][k + 1]));
        a + w * (b - a)
    };
    let plane = |i: usize| {
        let (a, b) = (line(i, j), line(i, j + 1));
        a + t * (b - a)
    };
    let (a, b) = (plane(i), plane(i + 1));
    (a + s * (b - a)) * (1.0 / UNIT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::fresnel;
    use crate::bsdf::ggx::{self, smith_root};
    use crate::math::Vec3;

    /// The same by quadrature over visible normals on a Fibonacci lattice.
    fn integrate(cos_o: f32, alpha: f32, ior: f32, is_inside: bool, points: u32) -> f64 {
        let (cos_o, alpha) = (cos_o.max(1e-6), alpha.max(1e-4));
        let eta = if is_inside { 1.0 / ior } else { ior };
        let wo = Vec3::new((1.0 - cos_o * cos_o).max(0.0).sqrt(), 0.0, cos_o);
        let a2 = alpha * alpha;
        let mut sum = 0.0f64;
        for i in 0..points {
            let turn = (f64::from(i) * 0.618_033_988_749_894_9).fract();
            let normal =
                ggx::sample_visible_normal(wo, [alpha; 2], [turn as f32, (i as f32 + 0.5) / points as f32]);
            let c = wo.dot(normal).clamp(0.0, 1.0);
            let interface = fresnel::exact(c, eta);
            let up = normal * (2.0 * c) - wo;
            if up.z > 0.0 {
                let r = ggx::reflection(wo, up, alpha);
                sum += f64::from(interface.reflectance * r.f_cos / r.pdf_solid_angle);
            }
            let down = normal * (c / eta - interface.cos_transmitted) - wo / eta;
            let z = -down.z / down.length().max(1e-20);
            if z > 0.0 {
                let masked = 2.0 * z / (z + smith_root(z, a2));
                sum += f64::from((1.0 - interface.reflectance) * masked);
            }
        }
        sum / f64::from(points)
    }

    /// Index of refraction at a place of the first axis.
    fn ior_at(x: f32) -> f32 {
        let q = (x * x).min(0.999);
        (1.0 + q) / (1.0 - q)
    }

    fn node(inside: bool, [i, j, k]: [usize; 3], points: u32) -> f64 {
        let [x, r, c] = [0, 1, 2].map(|a| [i, j, k][a] as f32 / (NODES[a] - 1) as f32);
        let r = r.max(0.02);
        let root = c * r / (1.0 + r - c);
        integrate(root * root, r * r, ior_at(x), inside, points)
    }

    /// Writes the data file when `OSCURA_WRITE_TABLES` is set, then compares every 61st node.
    #[test]
    fn table_is_the_integral() {
        if std::env::var_os("OSCURA_WRITE_TABLES").is_some() {
            let mut text = String::from(
                "//! Data of `glass_table`: outside and inside, by index of refraction, roughness and cosine; 65535 is 1. Written by\n//! its test `table_is_the_integral`.\n\n#[rustfmt::skip]\npub static GLASS: [[[[u16; 32]; 20]; 20]; 2] = [\n",
            );
            for inside in [false, true] {
                text += "    [\n";
                for i in 0..NODES[0] {
                    text += "    [\n";
                    for j in 0..NODES[1] {
                        let row = (0..NODES[2]).map(|k| {
                            let e = node(inside, [i, j, k], 6765).clamp(0.0, 1.0);
                            ((e * 65535.0).round() as u16).to_string()
                        });
                        text += &format!("    [{}],\n", row.collect::<Vec<_>>().join(", "));
                    }
                    text += "    ],\n";
                }
                text += "    ],\n";
            }
            let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/glass_data.rs");
            std::fs::write(path, text + "];\n").unwrap();
            return;
        }
        let [ni, nj, nk] = NODES;
        for n in (0..2 * ni * nj * nk).step_by(61) {
            let (side, n) = (n / (ni * nj * nk), n % (ni * nj * nk));
            let at = [n / (nj * nk), n / nk % nj, n % nk];
            let exact = node(side == 1, at, 6765);
            let found = f64::from(GLASS[side][at[0]][at[1]][at[2]]) / 65535.0;
            assert!((found - exact).abs() < 1e-4, "{side} {at:?}: {found} {exact}");
        }
    }

    #[test]
    fn interpolation_stays_close_between_nodes() {
        for inside in [false, true] {
            for ior in [1.05f32, 1.1, 1.2, 1.33, 1.5, 1.7, 2.0, 2.4, 3.5] {
                for j in 1..NODES[1] - 1 {
                    for k in 0..NODES[2] - 1 {
                        let centre = |i: usize, n: usize| (i as f32 + 0.5) / (n - 1) as f32;
                        let r = centre(j, NODES[1]);
                        let x = centre(k, NODES[2]);
                        let (alpha, c) = (r * r, (x * r / (1.0 + r - x)).powi(2));
                        let exact = integrate(c, alpha, ior, inside, 2584);
                        let found = f64::from(glass_albedo(c, alpha, ior, inside));
                        let limit = if ior < 1.2 { 0.014 } else { 6e-3 };
                        let what = || format!("{inside} {ior} {alpha} {c}: {found} {exact}");
                        assert!((found - exact).abs() < limit, "{}", what());
                    }
                }
            }
        }
    }
}
