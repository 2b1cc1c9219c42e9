//! Directional albedo of rough glass: the share of light that single scattering reflects and transmits, from a table.

use super::ggx::MIN_ALPHA;

/// Nodes along the table's axes: index, roughness and cosine; see [`Place`].
pub const NODES: [usize; 3] = [24, 24, 56];

/// Numbers in one of the four parts.
const PART: usize = NODES[0] * NODES[1] * NODES[2];

/// Numbers of one kind of glass seen from one side, by index, roughness and cosine.
type Part = [[[u16; NODES[2]]; NODES[1]]; NODES[0]];

/// Shares over [`Place::scale`], [`LARGEST`] as 65535: plain glass, then clear, each from outside and from inside.
static GLASS: [[Part; 2]; 2] = decoded(include_bytes!("glass.bin"));

/// Little-endian numbers, the last axis first.
#[allow(long_running_const_eval, reason = "a hundred thousand numbers")]
const fn decoded(bytes: &[u8; 8 * PART]) -> [[Part; 2]; 2] {
    let mut table = [[[[[0; NODES[2]]; NODES[1]]; NODES[0]]; 2]; 2];
    let mut n = 0;
    while n < 4 * PART {
        let (part, i, j, k) =
            (n / PART, n / (NODES[1] * NODES[2]) % NODES[0], n / NODES[2] % NODES[1], n % NODES[2]);
        table[part / 2][part % 2][i][j][k] = u16::from_le_bytes([bytes[2 * n], bytes[2 * n + 1]]);
        n += 1;
    }
    table
}

/// No number of the table is larger.
const LARGEST: f32 = 1.5;

/// Alpha times (ior - 1) below which refraction spreads light by less than single precision can tell from a single
/// direction: the surface counts as smooth, and the table need not reach there.
pub const LEAST_SPREAD: f32 = 1e-4;

/// The square root of [`MIN_ALPHA`].
const LEAST_ROUGHNESS: f32 = 0.031_622_777;
const _: () = assert!((LEAST_ROUGHNESS * LEAST_ROUGHNESS - MIN_ALPHA).abs() < 1e-9);

/// No x times r is smaller where alpha (ior - 1) is at least [`LEAST_SPREAD`].
const LEAST_INDEX: f32 = 0.0069;

/// In doubt too much is taken for an albedo, so that dividing by it adds no light: by the larger errors between nodes,
/// which grow for indices beyond 10.
#[inline(always)]
fn margin(x: f32) -> f32 {
    let beyond = x - 0.9;
    1.0015 + if beyond > 0.0 { 0.6 * beyond } else { 0.0 }
}

/// What a glass reflects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reflecting {
    /// What Fresnel's equations say.
    Plain,
    /// Nothing but what it must reflect totally.
    Clear,
}

/// Where in the table a direction on a glass is, and what the table's numbers are multiples of there.
///
/// With q = (ior - 1) / (ior + 1), x its root, r the root of alpha and s that of the view cosine c, coordinates are
/// (x - x0) (2 (1 + r) / (x + r) + 1), (r - r0) / (r + 1) and s / (s + t), each scaled to 0..1. x0 and r0 are the least
/// that is not smooth. Where the index is near 1 and the view grazing, so little light is left that the facets of
/// total reflection make a difference: those whose cosine is below 2 x, to be found among the others (of which
/// only cosines up to alpha show) at view cosines near q / alpha, or alpha where that is less; hence
/// t^2 = 25 q alpha / (q + alpha^2).
///
/// The scale is what is left by shadowing alone (all that glass of index 1 does), with the cosine raised by 2 q / (alpha + x)
/// for those facets. From the inside, the facets that reflect totally stand upright when seen straight from above: where
/// 1 - c is not far above 2 q they lose a share 2 q alpha^2 more, which was found by fitting. Numbers are then
/// between 0.3 and 1.4 throughout, and smooth.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    coordinates: [f32; 3],
    scale: f32,
    margin: f32,
    /// More margin for clear glass of little roughness, where total reflection begins within less than a node.
    edge: f32,
    is_inside: bool,
}

/// Four neighbours along an axis and their weights.
type Taps = (usize, [f32; 4]);

impl Place {
    /// The place of a ray under a view cosine, from the outside or inside of a solid of an index of refraction. Cosine and
    /// alpha are 0..1.
    #[inline]
    pub fn new(cos_o: f32, alpha: f32, ior: f32, is_inside: bool) -> Place {
        // An index below 1 is the inverse index seen from the other side.
        let (ior, is_inside) = if ior < 1.0 { (1.0 / ior, !is_inside) } else { (ior, is_inside) };
        let alpha = alpha.clamp(MIN_ALPHA, 1.0);
        let c = cos_o.clamp(0.0, 1.0);
        let (r, s) = (alpha.sqrt(), c.sqrt());
        let ior = ior.min(1e9);
        let q = (ior - 1.0) / (ior + 1.0);
        let (x, least) = (q.sqrt(), LEAST_INDEX / r);
        let t = (25.0 * q * alpha / (q + alpha * alpha)).sqrt();
        let raised = c + (1.0 - c) * (2.0 * q / (alpha + x));
        let root = (alpha * alpha + (1.0 - alpha * alpha) * raised * raised).sqrt();
        Place {
            coordinates: [
                (x - least) * (2.0 * (1.0 + r) / (x + r) + 1.0) / (3.0 * (1.0 - least)),
                (r - LEAST_ROUGHNESS) * (2.0 / (1.0 - LEAST_ROUGHNESS)) / (r + 1.0),
                s * (1.0 + t) / (s + t + 1e-20),
            ],
            scale: 2.0 * raised / (raised + root)
                * if is_inside { kept_from_above(c, alpha, q) } else { 1.0 },
            margin: margin(x),
            edge: if is_inside && alpha < 0.04 { 0.15 * (0.04 - alpha) } else { 0.0 },
            is_inside,
        }
    }

    /// What the direction finds again outside and inside after one facet, by cubic interpolation, rather too
    /// much than too little.
    #[inline]
    pub fn albedo(&self, glass: Reflecting) -> f32 {
        let margin = match glass {
            Reflecting::Plain => self.margin,
            Reflecting::Clear => self.margin + self.edge,
        };
        (self.interpolated(glass) * margin).min(1.0)
    }

    /// The table's own value.
    #[inline]
    fn interpolated(&self, glass: Reflecting) -> f32 {
        let [(i, along), (j, across), (k, weights)] =
            [0, 1, 2].map(|axis| spline(self.coordinates[axis], NODES[axis]));
        let part = &GLASS[usize::from(glass == Reflecting::Clear)][usize::from(self.is_inside)];
        let mut sum = 0.0;
        for (a, wa) in along.into_iter().enumerate() {
            for (b, wb) in across.into_iter().enumerate() {
                let line = &part[i + a][j + b];
                let values = [0, 1, 2, 3].map(|c| weights[c] * f32::from(line[k + c]));
                sum += wa * wb * (values[0] + values[1] + (values[2] + values[3]));
            }
        }
        sum * (LARGEST / 65535.0) * self.scale
    }
}

/// What facets of total reflection leave of the light seen from inside near the normal; see [`Place`].
#[inline(always)]
fn kept_from_above(c: f32, alpha: f32, q: f32) -> f32 {
    let (tilt, narrow) = (1.0 - c, 8.0 * q * q + 1e-20);
    let lost = 2.0 * q * alpha * alpha * narrow;
    1.0 - lost / ((narrow + tilt * (2.0 * q + tilt)) * (1.0 + 20.0 * q))
}

/// Weights of neighbours (Catmull, Rom 1974); at the ends the neighbour that is not there continues the parabola through
/// the last three.
#[inline(always)]
fn spline(x: f32, nodes: usize) -> Taps {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::reference_glass::{Rules, direction, shares};
    use crate::sampling::chi2::Random;

    /// Plain and clear.
    fn exact(cosine: f64, alpha: f64, ior: f64, is_inside: bool, rules: &Rules) -> [f64; 2] {
        let eta = if is_inside { 1.0 / ior } else { ior };
        let shares = shares(direction(cosine), [alpha; 2], eta, rules);
        [shares.plain, shares.clear]
    }

    /// Cosine, alpha and index at a node: the inverse of [`Place::new`].
    fn at_node(index: [usize; 3]) -> [f64; 3] {
        let p: [f64; 3] = std::array::from_fn(|a| index[a] as f64 / (NODES[a] - 1) as f64);
        let least = f64::from(LEAST_ROUGHNESS);
        let y = 0.5 * p[1] * (1.0 - least);
        let r = (least + y) / (1.0 - y);
        let (alpha, least) = (r * r, f64::from(LEAST_INDEX) / r);
        let y = 3.0 * p[0] * (1.0 - least);
        let (half, rest) = (0.5 * (3.0 * r + 2.0 - least - y), least * (3.0 * r + 2.0) + y * r);
        let q = ((half * half + rest).sqrt() - half).powi(2).min(0.9999);
        let t = (25.0 * q * alpha / (q + alpha * alpha)).sqrt();
        let y = p[2] / (1.0 + t);
        [(y * t / (1.0 - y)).powi(2).clamp(1e-6, 1.0), alpha, (1.0 + q) / (1.0 - q)]
    }

    /// The table's numbers at a node, plain and clear.
    fn node(is_inside: bool, index: [usize; 3], rules: &Rules) -> [u16; 2] {
        let [cosine, alpha, ior] = at_node(index);
        let scale = Place::new(cosine as f32, alpha as f32, ior as f32, is_inside).scale;
        exact(cosine, alpha, ior, is_inside, rules)
            .map(|share| (share / f64::from(scale * LARGEST) * 65535.0).round() as u16)
    }

    fn nodes() -> impl Iterator<Item = (bool, [usize; 3])> {
        let [_, nj, nk] = NODES;
        (0..2 * PART).map(move |n| (n >= PART, [n % PART / (nj * nk), n / nk % nj, n % nk]))
    }

    /// Writes the data file when `OSCURA_WRITE_TABLES` is set (seconds, optimised), then compares every 503rd node.
    #[test]
    fn table_is_the_integral() {
        let rules = Rules::coarse();
        if std::env::var_os("OSCURA_WRITE_TABLES").is_some() {
            let all: Vec<[u16; 2]> = nodes().map(|(side, at)| node(side, at, &rules)).collect();
            let bytes: Vec<u8> =
                (0..2).flat_map(|k| all.iter().flat_map(move |n| n[k].to_le_bytes())).collect();
            std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/glass.bin"), bytes).unwrap();
            return;
        }
        for (side, at) in nodes().step_by(503) {
            for (k, exact) in node(side, at, &rules).into_iter().enumerate() {
                let found = GLASS[k][usize::from(side)][at[0]][at[1]][at[2]];
                assert!(found.abs_diff(exact) <= 1, "{side} {at:?} {k}: {found} {exact}");
            }
        }
    }

    #[test]
    fn places_are_where_nodes_are() {
        for (side, at) in nodes().step_by(331) {
            let [cosine, alpha, ior] = at_node(at);
            let place = Place::new(cosine as f32, alpha as f32, ior as f32, side);
            for axis in 0..3 {
                let there = place.coordinates[axis] * (NODES[axis] - 1) as f32;
                // The ends are cut: an infinite index, and cosines below 1e-6.
                let is_end = at[axis] == 0 || at[axis] == NODES[axis] - 1;
                let near = if is_end { 0.6 } else { 0.01 };
                assert!((there - at[axis] as f32).abs() < near, "{at:?} {axis}: {there}");
            }
        }
    }

    /// Errors between nodes, in the mean and at most, of what light is divided by: too little would add light.
    #[test]
    fn interpolation_stays_close_between_nodes() {
        let mut random = Random::new(8);
        let rules = Rules::coarse();
        for is_inside in [false, true] {
            for (low, high, most) in
                [(1e-4f64, 1e-2, 5e-3), (1e-2, 2.0, 3e-3), (2.0, 9.0, 7e-3), (9.0, 1e4, 0.07)]
            {
                let mut errors = [Vec::new(), Vec::new()];
                while errors[0].len() < 400 {
                    let [x, y, z] = [0, 1, 2].map(|_| f64::from(random.next()));
                    let (ior, r) = (1.0 + low * (high / low).powf(x), 0.0317 + 0.9683 * y);
                    // Half of the places crowd where the cosine is near alpha.
                    let s = if errors[0].len() % 2 == 0 { z } else { z * r / (1.0 + r - z) };
                    let (c, alpha) = ((s * s).max(1e-6), r * r);
                    if alpha * (ior - 1.0) < f64::from(LEAST_SPREAD) {
                        continue;
                    }
                    let place = Place::new(c as f32, alpha as f32, ior as f32, is_inside);
                    let exact = exact(c, alpha, ior, is_inside, &rules);
                    for (k, glass) in [Reflecting::Plain, Reflecting::Clear].into_iter().enumerate() {
                        let error = f64::from(place.albedo(glass)) / exact[k] - 1.0;
                        errors[k].push((error, format!("ior {ior:.4} alpha {alpha:.4} cos {c:.5}")));
                    }
                }
                for (list, (glass, most)) in errors.iter_mut().zip([("plain", most), ("clear", most + 7e-3)])
                {
                    list.sort_by(|a, b| a.0.total_cmp(&b.0));
                    let [least, middle, largest] = [0, 200, 399].map(|i| &list[i]);
                    println!(
                        "{glass}, inside {is_inside}, 1 + {low}..{high}: {least:?}, {middle:?}, {largest:?}"
                    );
                    assert!(least.0 > -5e-4, "{least:?}");
                    assert!(largest.0 < most && (middle.0 < 2e-3 || high > 9.0), "{middle:?} {largest:?}");
                }
            }
        }
    }
}
