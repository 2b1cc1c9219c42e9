//! Directional albedo of anisotropic GGX facets: the albedo of equivalent isotropic facets, corrected by a table.

use super::dielectric_table::mean_cosine;
use super::fresnel::DielectricCurve;
use super::ggx::{DirectionalAlbedo, MIN_ALPHA, MIN_ROUGHNESS};
use crate::math::Vec3;

/// Largest ratio of the square roots of the two alphas in the table.
pub const MAX_ROOT_RATIO: f32 = 4.0;

/// Nodes along the table's axes: square root r of the smaller alpha ([`small_axis`]); root of the larger alpha, as a position between
/// r and min(4 r, 1); root of the alpha along the azimuth, as a position between these two roots; and [`cosine_axis`].
const NODES: [usize; 4] = [16, 13, 11, 28];

/// Largest value of the table, stored as 65535.
const MAX_VALUE: f32 = 6.5;

/// Added to numerator and denominator of the table's ratios, so that tiny values don't matter.
const FLOOR: f32 = 0.01;

/// Ratios of anisotropic to isotropic facets of [`equivalent_alpha`], by the axes of [`NODES`]: of the energy lost by single scattering,
/// and of the albedo weighted by (1 - cos)^5, both with [`FLOOR`] added.
type Table = [[[[[u16; 2]; NODES[3]]; NODES[2]]; NODES[1]]; NODES[0]];

static ANISOTROPIC: Table = table_file!(u16, "anisotropic.bin");

/// Root of the largest alpha in the table for the root of the smaller alpha.
#[inline(always)]
fn largest(small: f32) -> f32 {
    (small * MAX_ROOT_RATIO).min(1.0)
}

/// Table coordinate of the smaller alpha's root: piecewise linear, with a node at the kink of [`largest`].
#[inline(always)]
fn small_axis(small: f32) -> f32 {
    if small < KINK {
        (small - MIN_ROUGHNESS) * (AT_KINK / (KINK - MIN_ROUGHNESS))
    } else {
        AT_KINK + (small - KINK) * ((1.0 - AT_KINK) / (1.0 - KINK))
    }
}

/// Root of the smaller alpha at which [`largest`] becomes 1.
const KINK: f32 = 1.0 / MAX_ROOT_RATIO;

/// Table coordinate of [`KINK`], which is a node.
const AT_KINK: f32 = 0.4;
const _: () = assert!((NODES[0] - 1).is_multiple_of(5));

/// Alpha of equivalent isotropic facets: the alpha along the azimuth at grazing incidence, the quadratic mean of both at normal
/// incidence. `squared` is the squared cosine of the azimuth from the direction of `along`.
#[inline(always)]
fn equivalent_alpha(cosine: f32, squared: f32, [along, across]: [f32; 2]) -> f32 {
    let upright = cosine * cosine * (2.0 - cosine * cosine);
    let blend = squared + (0.5 - squared) * upright;
    (along * along * blend + across * across * (1.0 - blend)).sqrt()
}

/// Table coordinate of a view cosine: a blend of s (1 + r) / (s + r), with s the root of the cosine and r that of the equivalent alpha,
/// which has a fine resolution where facets are shadowed, and the cosine itself.
#[inline(always)]
fn cosine_axis(cosine: f32, equivalent: f32) -> f32 {
    let (root, roughness) = (cosine.sqrt(), equivalent.sqrt());
    0.7 * root * (1.0 + roughness) / (root + roughness) + 0.3 * cosine
}

/// The isotropic facets equivalent to anisotropic ones for a direction, and the correction by the table.
struct EquivalentFacets {
    cosine: f32,
    /// Alpha of the isotropic facets.
    equivalent: f32,
    /// Table coordinate of the larger alpha: 0 isotropic, 1 the largest ratio.
    spread: f32,
    /// Ratio of lost energy.
    lost: f32,
    /// Ratio of the albedo weighted by (1 - cos)^5.
    grazing: f32,
}

impl EquivalentFacets {
    /// Equivalent of facets with alphas along x and y.
    #[inline(always)]
    fn new(wo: Vec3, alpha: [f32; 2]) -> EquivalentFacets {
        let (along, across, x, y) = match alpha[0] >= alpha[1] {
            true => (alpha[0], alpha[1], wo.x, wo.y),
            false => (alpha[1], alpha[0], wo.y, wo.x),
        };
        let [large, small] = [along, across].map(|a| a.clamp(MIN_ALPHA, 1.0).sqrt());
        let tangent = x * x + y * y;
        let squared = if tangent > 1e-12 { x * x / tangent } else { 0.5 };
        let cosine = wo.z.clamp(0.0, 1.0);
        let equivalent = equivalent_alpha(cosine, squared, [along, across]);
        let along_azimuth =
            (equivalent_alpha(0.0, squared, [along, across]).sqrt() - small) / (large - small).max(1e-6);
        let spread = (large - small) / (largest(small) - small).max(1e-6);
        let [lost, grazing] =
            interpolate([small_axis(small), spread, along_azimuth, cosine_axis(cosine, equivalent)]);
        EquivalentFacets { cosine, equivalent, spread, lost, grazing }
    }

    /// Albedo weighted by the rise of a Fresnel term, from its value for isotropic facets. An error bound is added, so that the layer
    /// below does not receive too much light.
    #[inline(always)]
    fn rise(&self, isotropic: f32, error: f32) -> f32 {
        (isotropic + FLOOR) * self.grazing - FLOOR + error * self.spread
    }
}

/// Directional albedo of facets with alphas along x and y.
#[inline]
pub fn anisotropic_albedo(wo: Vec3, alpha: [f32; 2]) -> DirectionalAlbedo {
    let facets = EquivalentFacets::new(wo, alpha);
    let isotropic = DirectionalAlbedo::at(facets.cosine, facets.equivalent);
    let lost = (1.0 - isotropic.full + FLOOR) * facets.lost - FLOOR;
    // Plus a bound of the interpolation error, so that compensation never adds energy.
    let full = (1.0 - lost + facets.spread * (0.002 + 0.001 * (lost - facets.cosine))).clamp(1e-3, 1.0);
    DirectionalAlbedo { full, grazing: facets.rise(isotropic.grazing, 0.002).clamp(0.0, full) }
}

/// Directional albedo weighted by the Fresnel curve of a dielectric. The anisotropic-to-isotropic ratio is approximated by that of
/// Schlick's weight: for alphas of 0.001 to 1 and indices of 1.02 to 3.5 the exact value is at most 0.0026 larger, and more than
/// 0.0036 smaller in one of a hundred cases.
#[inline]
pub fn anisotropic_dielectric_grazing(wo: Vec3, alpha: [f32; 2], curve: DielectricCurve) -> f32 {
    let facets = EquivalentFacets::new(wo, alpha);
    let full = DirectionalAlbedo::at(facets.cosine, facets.equivalent).full;
    let isotropic = full * curve.weight(mean_cosine(facets.cosine, facets.equivalent, curve));
    // Error bound; smaller for indices near 1.
    let error = 0.001 + 0.005 * curve.amplitude;
    facets.rise(isotropic, error).clamp(0.0, 1.0)
}

/// The table's values at coordinates in 0..1, interpolated linearly on all axes.
#[inline]
fn interpolate(coordinates: [f32; 4]) -> [f32; 2] {
    let at: [(usize, f32); 4] = std::array::from_fn(|axis| {
        let x = coordinates[axis].clamp(0.0, 1.0) * (NODES[axis] - 1) as f32;
        let i = (x as usize).min(NODES[axis] - 2);
        (i, x - i as f32)
    });
    let mut sums = [0.0; 2];
    for corner in 0..16 {
        let mut weight = 1.0;
        let index: [usize; 4] = std::array::from_fn(|axis| {
            let (i, t) = at[axis];
            let upper = corner >> axis & 1;
            weight *= if upper == 1 { t } else { 1.0 - t };
            i + upper
        });
        let values = ANISOTROPIC[index[0]][index[1]][index[2]][index[3]];
        for (sum, value) in sums.iter_mut().zip(values) {
            *sum += weight * f32::from(value);
        }
    }
    sums.map(|sum| sum * (MAX_VALUE / 65535.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::reference::{reflected, reflected_from};
    use crate::math::DVec3;
    use crate::sampling::chi2::Random;

    const POINTS: usize = 16_000;

    fn direction(cosine: f64, azimuth: f64) -> DVec3 {
        let cosine = cosine.max(1e-6);
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        DVec3::new(sine * azimuth, sine * (1.0 - azimuth * azimuth).sqrt(), cosine)
    }

    /// Inverse of [`cosine_axis`], by bisection.
    fn cosine_at(x: f32, squared: f32, alpha: [f32; 2]) -> f32 {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..40 {
            let root: f32 = 0.5 * (low + high);
            let cosine = root * root;
            let there = cosine_axis(cosine, equivalent_alpha(cosine, squared, alpha));
            if there < x { low = root } else { high = root }
        }
        high * high
    }

    /// The values of a node by quadrature.
    fn node(index: [usize; 4]) -> [f64; 2] {
        let x: [f32; 4] = std::array::from_fn(|axis| index[axis] as f32 / (NODES[axis] - 1) as f32);
        let small = match x[0] < AT_KINK {
            true => MIN_ROUGHNESS + (KINK - MIN_ROUGHNESS) * (x[0] / AT_KINK),
            false => KINK + (1.0 - KINK) * ((x[0] - AT_KINK) / (1.0 - AT_KINK)),
        };
        let large = small + (largest(small) - small) * x[1];
        let alpha = [large * large, small * small];
        let [a, b] = alpha.map(|a| f64::from(a).powi(2));
        let seen = f64::from(small + (large - small) * x[2]).powi(4);
        let squared = if a > b { ((seen - b) / (a - b)).clamp(0.0, 1.0) } else { f64::from(x[2]) };
        let cosine = cosine_at(x[3], squared as f32, alpha);
        let equivalent = f64::from(equivalent_alpha(cosine, squared as f32, alpha));
        let cosine = f64::from(cosine);
        let one = reflected(cosine, equivalent, POINTS);
        let two = reflected_from(direction(cosine, squared.sqrt()), alpha.map(f64::from), 1.0, POINTS);
        let floor = f64::from(FLOOR);
        [(1.0 - two[0] + floor) / (1.0 - one[0] + floor), (two[1] + floor) / (one[1] + floor)]
    }

    fn indices() -> impl Iterator<Item = [usize; 4]> {
        let [a, b, c, d] = NODES;
        (0..a * b * c * d).map(move |n| [n / (b * c * d), n / (c * d) % b, n / d % c, n % d])
    }

    /// Writes the data file when `OSCURA_WRITE_TABLES` is set, then compares every 97th node.
    #[test]
    fn table_equals_quadrature() {
        if std::env::var_os("OSCURA_WRITE_TABLES").is_some() {
            let nodes: Vec<f64> = indices().flat_map(node).collect();
            let largest = nodes.iter().copied().fold(0.0, f64::max);
            assert!(largest <= f64::from(MAX_VALUE), "{largest}");
            let unit = 65535.0 / f64::from(MAX_VALUE);
            let bytes: Vec<u8> =
                nodes.iter().flat_map(|v| ((v * unit).round() as u16).to_le_bytes()).collect();
            std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/anisotropic.bin"), bytes).unwrap();
            return;
        }
        for index in indices().step_by(97) {
            let exact = node(index);
            let [a, b, c, d] = index;
            for k in 0..2 {
                let found = f64::from(ANISOTROPIC[a][b][c][d][k]) / 65535.0 * f64::from(MAX_VALUE);
                assert!((found - exact[k]).abs() < 1e-4, "{index:?}: {found} {exact:?}");
            }
        }
    }

    /// Interpolation errors. Values that are too small would add energy: for metals by the relative error of `full`, for plastic by the
    /// error of `grazing`.
    #[test]
    fn interpolation_errors_are_bounded() {
        let mut random = Random::new(5);
        let mut errors = [Vec::new(), Vec::new()];
        for i in 0..4000 {
            let [x, ratio, cosine, azimuth] = [0; 4].map(|_| random.next());
            // Half of the cases have low roughness, half are at grazing incidence.
            let root = if i % 2 == 0 { 0.0317 + 0.9683 * x } else { 0.0317 * 31.6f32.powf(x) };
            let large = root * root;
            let alpha = [large, (large * (0.0625 + 0.9375 * ratio)).max(1e-3)];
            let wo = direction(if i % 4 < 2 { cosine } else { cosine * cosine }.into(), azimuth.into());
            let exact = reflected_from(wo, alpha.map(f64::from), 1.0, POINTS);
            let found = anisotropic_albedo(wo.as_vec3(), alpha);
            let case = format!("{alpha:?} {wo}: {exact:?} {found:?}");
            errors[0].push((f64::from(found.full) / exact[0] - 1.0, case.clone()));
            errors[1].push((f64::from(found.grazing) - exact[1], case));
        }
        for list in &mut errors {
            list.sort_by(|a, b| a.0.total_cmp(&b.0));
            let [least, hundredth, middle, last_hundredth, largest] =
                [0, 40, 2000, 3960, 3999].map(|i| &list[i]);
            println!("{least:?}\n{hundredth:?}\n{middle:?}\n{last_hundredth:?}\n{largest:?}");
            assert!(least.0 > -1e-3 && hundredth.0 > -2e-4, "{least:?} {hundredth:?}");
            assert!(middle.0 < 1e-3 && last_hundredth.0 < 4e-3 && largest.0 < 8e-3, "{largest:?}");
        }
    }
}
