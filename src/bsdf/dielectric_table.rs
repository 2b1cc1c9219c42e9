//! Table for the directional albedo of GGX facets with the exact Fresnel curve of a dielectric.

use super::fresnel::DielectricCurve;
use super::ggx::MIN_ROUGHNESS;

/// Nodes along the table's axes: roughness r = sqrt(alpha) from [`MIN_ROUGHNESS`] to 1; index of refraction ([`index_axis`]); view
/// cosine, as s (1 + r) / (s + r) with s its square root.
const NODES: [usize; 3] = [32, 16, 40];

/// Smallest value of the table; values are stored as 16-bit fractions of the range `MIN..MIN + 1`.
const MIN: f32 = -0.1;

/// The albedo weighted by a Fresnel curve is the directional albedo times the curve's mean over all facets. The table has the cosine at
/// which the curve equals this mean, the mean cosine of the facets: it varies slowly with the index of refraction, and is the view
/// cosine for smooth surfaces. Stored is the [`scaled`] mean cosine minus the [`scaled`] view cosine.
type Table = [[[u16; NODES[2]]; NODES[1]]; NODES[0]];

static MEAN_COSINE: Table = table_file!(u16, "mean_cosine.bin");

/// Table coordinate of an index of refraction n: the fourth root of n^2 - 1 = 4 q / (1 - q)^2, with q the reflected amplitude at normal
/// incidence, scaled to 0..1. Near n = 1 mean cosines are about linear in it.
#[inline(always)]
fn index_axis(curve: DielectricCurve) -> f32 {
    // At q = 1 / sqrt(3).
    const MAX_VALUE: f32 = 1.896_201_7;
    (2.0 * curve.amplitude.sqrt() / (1.0 - curve.amplitude)).sqrt() * (1.0 / MAX_VALUE)
}

/// Stretches the range of small cosines, at which facets of this roughness are shadowed, for a finer resolution there. Keeps 0 and 1.
#[inline(always)]
fn scaled(cosine: f32, roughness: f32) -> f32 {
    cosine * (1.0 + roughness) / (cosine + roughness)
}

/// The mean cosine of facets for a view cosine, an alpha and a dielectric's Fresnel curve. The weighted albedo computed with it is at
/// most 0.0006 too small and 0.003 too large (0.005 and 0.02 for indices below 1.05 at view cosines below 0.01), with a root mean
/// square error of 0.0004.
#[inline(always)]
pub fn mean_cosine(cos_o: f32, alpha: f32, curve: DielectricCurve) -> f32 {
    let cosine = cos_o.clamp(0.0, 1.0);
    let (root, roughness) = (cosine.sqrt(), alpha.clamp(0.0, 1.0).sqrt().max(MIN_ROUGHNESS));
    let coordinates = [
        (roughness - MIN_ROUGHNESS) * (1.0 / (1.0 - MIN_ROUGHNESS)),
        index_axis(curve),
        root * (1.0 + roughness) / (root + roughness),
    ];
    let at: [(usize, f32); 3] = std::array::from_fn(|axis| {
        let x = coordinates[axis].clamp(0.0, 1.0) * (NODES[axis] - 1) as f32;
        let i = (x as usize).min(NODES[axis] - 2);
        (i, x - i as f32)
    });
    let [(a, ta), (b, tb), (c, tc)] = at;
    let along = |row: &[u16; NODES[2]]| {
        let (low, high) = (f32::from(row[c]), f32::from(row[c + 1]));
        low + tc * (high - low)
    };
    let across = |plane: &[[u16; NODES[2]]; NODES[1]]| {
        let (low, high) = (along(&plane[b]), along(&plane[b + 1]));
        low + tb * (high - low)
    };
    let (low, high) = (across(&MEAN_COSINE[a]), across(&MEAN_COSINE[a + 1]));
    let shift = (low + ta * (high - low)) * (1.0 / 65535.0) + MIN;
    let z = (scaled(cosine, roughness) + shift).clamp(0.0, 1.0);
    z * roughness / (1.0 + roughness - z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::DirectionalAlbedo;
    use crate::bsdf::fresnel::MAX_AMPLITUDE;
    use crate::bsdf::reference::{direction, fresnel, reflections};
    use crate::sampling::chi2::Random;

    const POINTS: usize = 8_000;

    /// [`DielectricCurve::weight`] in double precision.
    fn weight(cosine: f64, ior: f64) -> f64 {
        let normal = fresnel(1.0, ior).0;
        ((fresnel(cosine, ior).0 - normal) / (1.0 - normal)).max(0.0)
    }

    /// Inverse of [`weight`] by bisection.
    fn cosine_of(value: f64, ior: f64) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if weight(middle, ior) > value { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    /// The nodes of all indices of refraction for a roughness and a view cosine, by quadrature.
    fn nodes(row: usize, column: usize) -> [f64; NODES[1]] {
        let least = f64::from(MIN_ROUGHNESS);
        let r = least + (1.0 - least) * row as f64 / (NODES[0] - 1) as f64;
        let x = column as f64 / (NODES[2] - 1) as f64;
        let cosine = (x * r / (1.0 + r - x)).powi(2).min(1.0);
        let reflected: Vec<(f64, f64)> = reflections(direction(cosine), [r * r; 2], 0.5, POINTS).collect();
        let total: f64 = reflected.iter().map(|(_, light)| light).sum();
        let mean =
            |f: &dyn Fn(f64) -> f64| reflected.iter().map(|(c, light)| light * f(*c)).sum::<f64>() / total;
        let scaled = |c: f64| c * (1.0 + r) / (c + r);
        std::array::from_fn(|index| {
            // The first node represents the limit for indices near 1.
            let coordinate = (index as f64 / (NODES[1] - 1) as f64).max(0.02);
            let ior = ior_at(coordinate);
            let value = mean(&|c| weight(c, ior));
            // If all facets are near normal incidence, weights are proportional to (1 - cos)^2.
            let tiny = (1e-8 * fresnel(1.0, ior).0).max(1e-13);
            let found = match value > tiny {
                true => cosine_of(value, ior),
                false => 1.0 - mean(&|c| (1.0 - c) * (1.0 - c)).sqrt(),
            };
            scaled(found) - scaled(cosine)
        })
    }

    /// Inverse of [`index_axis`].
    fn ior_at(coordinate: f64) -> f64 {
        let q = f64::from(MAX_AMPLITUDE);
        let largest = ((1.0 + q) / (1.0 - q)).powi(2) - 1.0;
        (1.0 + largest * coordinate.powi(4)).sqrt()
    }

    /// Writes the data file when `OSCURA_WRITE_TABLES` is set, then compares some nodes.
    #[test]
    fn table_equals_quadrature() {
        let quantized = |v: f64| (v - f64::from(MIN)) * 65535.0;
        if std::env::var_os("OSCURA_WRITE_TABLES").is_some() {
            let mut bytes = Vec::new();
            for row in 0..NODES[0] {
                let columns: Vec<_> = (0..NODES[2]).map(|column| nodes(row, column)).collect();
                for index in 0..NODES[1] {
                    for column in &columns {
                        let value = quantized(column[index]).round();
                        assert!((0.0..=65535.0).contains(&value), "{row} {index}: {value}");
                        bytes.extend((value as u16).to_le_bytes());
                    }
                }
            }
            std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/mean_cosine.bin"), bytes).unwrap();
            return;
        }
        for i in (0..NODES[0] * NODES[2]).step_by(61) {
            let (row, column) = (i / NODES[2], i % NODES[2]);
            for (index, value) in nodes(row, column).into_iter().enumerate() {
                let found = f64::from(MEAN_COSINE[row][index][column]);
                assert!((found - quantized(value)).abs() < 0.6, "{row} {index} {column}: {found} {value}");
            }
        }
    }

    #[test]
    fn index_axis_covers_1_to_the_largest_index() {
        assert_eq!(index_axis(DielectricCurve::of_ior(1.0)), 0.0);
        assert!((index_axis(DielectricCurve::of_ior(9.0)) - 1.0).abs() < 1e-6);
        for coordinate in [0.1, 0.5, 0.9] {
            let found = index_axis(DielectricCurve::of_ior(ior_at(coordinate) as f32));
            assert!((f64::from(found) - coordinate).abs() < 1e-4, "{coordinate}: {found}");
        }
    }

    /// Interpolation errors of the weighted albedo. Values that are too small would add energy.
    #[test]
    fn interpolation_errors_are_bounded() {
        let mut random = Random::new(3);
        let (mut lists, mut squares) = ([Vec::new(), Vec::new()], 0.0);
        for i in 0..2000 {
            let r = MIN_ROUGHNESS + (1.0 - MIN_ROUGHNESS) * random.next();
            let x = random.next();
            let s = if i % 2 == 0 { x } else { x * r / (1.0 + r - x) };
            let cosine = (s * s).max(1e-6);
            let ior = if i % 3 == 0 { 1.0 + 0.2 * random.next() } else { 1.0 + 2.7 * random.next() };
            let curve = DielectricCurve::of_ior(ior);
            let light = reflections(direction(cosine.into()), [f64::from(r * r); 2], 0.5, POINTS);
            let exact: f64 = light.map(|(c, light)| light * weight(c, ior.into())).sum();
            let mean = mean_cosine(cosine, r * r, curve);
            let found = DirectionalAlbedo::at(cosine, r * r).full * curve.weight(mean);
            let error = f64::from(found) - exact;
            squares += error * error;
            lists[usize::from(ior < 1.05 && cosine < 0.01)].push((error, r, cosine, ior));
        }
        for (list, [least, largest]) in lists.iter_mut().zip([[-6e-4, 3e-3], [-5e-3, 0.02]]) {
            list.sort_by(|a, b| a.0.total_cmp(&b.0));
            let [first, last] = [list[0], list[list.len() - 1]];
            println!("{} cases: {first:?} to {last:?}", list.len());
            assert!(first.0 > least && last.0 < largest, "{first:?} {last:?}");
        }
        let mean = (squares / 2000.0).sqrt();
        println!("mean {mean:.6}");
        assert!(mean < 6e-4);
    }
}
