//! Directional albedo of rough glass: the share of light that single scattering reflects and transmits, from a table.

/// Nodes along the table's axes; see `place`.
pub const NODES: [usize; 3] = [32, 20, 64];

/// The largest value of the table's integers, an albedo of 1.
const UNIT: f32 = 65535.0;

/// Nothing is divided by less than the square of this.
const LEAST_ROOT: f32 = 1e-3;

/// The least sqrt(alpha) of the table.
const LEAST_ROUGHNESS: f32 = 0.03;

/// Square roots of albedos, outside and inside, by index, roughness and cosine. The root is nearly linear where little
/// light is left: at grazing incidence on glass hardly denser than air.
static GLASS: [[[[u16; NODES[2]]; NODES[1]]; NODES[0]]; 2] = decoded(include_bytes!("glass.bin"));

/// Little-endian numbers, the last axis first.
#[allow(long_running_const_eval, reason = "eighty thousand numbers")]
const fn decoded(
    bytes: &[u8; 4 * NODES[0] * NODES[1] * NODES[2]],
) -> [[[[u16; NODES[2]]; NODES[1]]; NODES[0]]; 2] {
    let mut table = [[[[0; NODES[2]]; NODES[1]]; NODES[0]]; 2];
    let mut n = 0;
    while 2 * n < bytes.len() {
        let (k, j, i) = (n % NODES[2], n / NODES[2] % NODES[1], n / (NODES[2] * NODES[1]));
        table[i / NODES[0]][i % NODES[0]][j][k] = u16::from_le_bytes([bytes[2 * n], bytes[2 * n + 1]]);
        n += 1;
    }
    table
}

/// Coordinates in the table, 0..1. With r = sqrt(alpha), s the square root of the view cosine and
/// x = sqrt((ior - 1) / (ior + 1)): x (1 + r) / (x + r), r, and s (1 + r) / (s + r), because what happens at small x and
/// s happens at a scale of r.
#[inline(always)]
fn place(cos_o: f32, alpha: f32, ior: f32) -> [f32; 3] {
    let (s, r) = (cos_o.clamp(0.0, 1.0).sqrt(), alpha.clamp(0.0, 1.0).sqrt());
    let x = ((ior - 1.0) / (ior + 1.0)).clamp(0.0, 1.0).sqrt();
    let relative = |v: f32| v * (1.0 + r) / (v + r + 1e-9);
    [relative(x), (r - LEAST_ROUGHNESS) * (1.0 / (1.0 - LEAST_ROUGHNESS)), relative(s)]
}

/// Four neighbours along an axis and their weights (Catmull, Rom 1974); at the ends the neighbour that is not there
/// continues the parabola through the last three.
#[inline(always)]
fn spline(x: f32, nodes: usize) -> (usize, [f32; 4]) {
    let x = x.clamp(0.0, 1.0) * (nodes - 1) as f32;
    let node = (x as usize).min(nodes - 2);
    let t = x - node as f32;
    let (before, after) = (-0.5 * t * (1.0 - t) * (1.0 - t), -0.5 * t * t * (1.0 - t));
    let lower = 1.0 - t * t * (2.5 - 1.5 * t);
    let upper = 1.0 - before - after - lower;
    match node {
        0 => (0, [lower + 3.0 * before, upper - 3.0 * before, after + before, 0.0]),
        _ if node + 2 == nodes => {
            (nodes - 4, [0.0, before + after, lower - 3.0 * after, upper + 3.0 * after])
        }
        _ => (node - 1, [before, lower, upper, after]),
    }
}

/// What a ray from outside (or inside) a solid of an index of refraction finds again outside and inside after one
/// facet, by cubic interpolation. In doubt too much, so that dividing by it adds no light: by 0.1 %, and by up to 3 %
/// where nearly nothing is left and neighbours differ most.
#[inline]
pub fn glass_albedo(cos_o: f32, alpha: f32, ior: f32, is_inside: bool) -> f32 {
    let albedo = interpolated(cos_o, alpha, ior, is_inside);
    let lost = 1.0 - albedo;
    let lost4 = (lost * lost) * (lost * lost);
    albedo * (1.001 + 0.03 * lost4 * lost4)
}

/// The table's own value.
#[inline]
fn interpolated(cos_o: f32, alpha: f32, ior: f32, is_inside: bool) -> f32 {
    // An index below 1 is the inverse index seen from the other side.
    let (ior, is_inside) = if ior < 1.0 { (1.0 / ior, !is_inside) } else { (ior, is_inside) };
    let place = place(cos_o, alpha, ior);
    let [(i, along), (j, across), (k, weights)] = [0, 1, 2].map(|axis| spline(place[axis], NODES[axis]));
    let table = &GLASS[usize::from(is_inside)];
    let mut root = 0.0;
    for (a, wa) in along.into_iter().enumerate() {
        for (b, wb) in across.into_iter().enumerate() {
            let line = &table[i + a][j + b];
            let values = [0, 1, 2, 3].map(|c| weights[c] * f32::from(line[k + c]));
            root += wa * wb * (values[0] + values[1] + (values[2] + values[3]));
        }
    }
    let root = (root * (1.0 / UNIT)).clamp(LEAST_ROOT, 1.0);
    root * root
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::reference::split;
    use crate::sampling::chi2::Random;

    fn exact(cosine: f64, alpha: f64, ior: f64, is_inside: bool) -> f64 {
        // Total reflection has an edge that costs points.
        let (eta, points) = if is_inside { (1.0 / ior, 30_000) } else { (ior, 10_000) };
        split(cosine, alpha, eta, points)
    }

    /// Index of refraction at a place x of the first axis, r known.
    fn ior_at(x: f64) -> f64 {
        let q = (x * x).min(0.9999);
        (1.0 + q) / (1.0 - q)
    }

    fn node(is_inside: bool, index: [usize; 3]) -> f64 {
        let p: [f64; 3] = std::array::from_fn(|a| index[a] as f64 / (NODES[a] - 1) as f64);
        let least = f64::from(LEAST_ROUGHNESS);
        let r = least + (1.0 - least) * p[1];
        let absolute = |v: f64| v * r / (1.0 + r - v);
        exact(absolute(p[2]).powi(2), r * r, ior_at(absolute(p[0])), is_inside).sqrt()
    }

    fn nodes() -> impl Iterator<Item = (bool, [usize; 3])> {
        let [ni, nj, nk] = NODES;
        (0..2 * ni * nj * nk)
            .map(move |n| (n / (ni * nj * nk) == 1, [n / (nj * nk) % ni, n / nk % nj, n % nk]))
    }

    /// Writes the data file when `OSCURA_WRITE_TABLES` is set (minutes, optimised), then compares every 1009th node.
    #[test]
    fn table_is_the_integral() {
        let quantised = |e: f64| (e.clamp(0.0, 1.0) * f64::from(UNIT)).round() as u16;
        if std::env::var_os("OSCURA_WRITE_TABLES").is_some() {
            let bytes: Vec<u8> =
                nodes().flat_map(|(side, at)| quantised(node(side, at)).to_le_bytes()).collect();
            std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/glass.bin"), bytes).unwrap();
            return;
        }
        for (side, at) in nodes().step_by(1009) {
            let found = GLASS[usize::from(side)][at[0]][at[1]][at[2]];
            assert!(found.abs_diff(quantised(node(side, at))) <= 1, "{side} {at:?}");
        }
    }

    #[test]
    fn interpolation_stays_close_between_nodes() {
        let mut random = Random::new(8);
        for is_inside in [false, true] {
            // What is said too little would add light; what is said too much takes some away where the cosine is tiny.
            for (low, high, most) in [(1.001, 1.02, 0.12), (1.02, 1.1, 0.03), (1.1, 3.0f64, 6e-3)] {
                let mut errors: Vec<(f64, String)> = (0..300)
                    .map(|i| {
                        let [x, y, z] = [0, 1, 2].map(|_| f64::from(random.next()));
                        let (ior, r) = (low + (high - low) * x, 0.0317 + 0.9683 * y);
                        let s = if i % 2 == 0 { z } else { z * r / (1.0 + r - z) };
                        let (c, alpha) = ((s * s).max(1e-6), r * r);
                        let found = glass_albedo(c as f32, alpha as f32, ior as f32, is_inside);
                        let error = f64::from(found) / exact(c, alpha, ior, is_inside) - 1.0;
                        (error, format!("ior {ior:.4} alpha {alpha:.3} cos {c:.5}"))
                    })
                    .collect();
                errors.sort_by(|a, b| a.0.total_cmp(&b.0));
                println!("inside {is_inside}, {low}..{high}: {:?} to {:?}", errors[0], errors[299]);
                assert!(errors[0].0 > -1e-3, "{:?}", errors[0]);
                assert!(errors[299].0 < most && errors[150].0 < 2e-3, "{:?}", errors[299]);
            }
        }
    }
}
