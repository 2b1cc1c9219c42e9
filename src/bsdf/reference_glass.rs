//! What one facet of glass reflects and transmits, integrated over the facets a direction sees, in double precision.
//!
//! [`super::reference`] draws points over all facets; near index 1 and at grazing incidence what little light is left comes
//! from the few facets that reflect totally, and the points miss them. Here the range is cut where the integrand has
//! an edge, at total reflection and where the light leaves along the horizon, so that a few points a piece give four
//! digits of the result, however small.

use super::reference::{fresnel, smith_root};
use crate::math::DVec3;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};
use std::ops::AddAssign;

/// Nodes and weights of Gauss and Legendre on 0..1, crowded towards both ends by 3 s^2 - 2 s^3, so that integrands with
/// a square root there count as smooth.
pub struct Rule(Vec<[f64; 2]>);

impl Rule {
    /// A rule of some points.
    pub fn new(points: usize) -> Rule {
        let n = points as f64;
        let node = |i: usize| {
            let mut x = (PI * (i as f64 + 0.75) / (n + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..30 {
                let (mut before, mut value) = (1.0, x);
                for k in 2..=points {
                    let k = k as f64;
                    (before, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k);
                }
                slope = n * (x * value - before) / (x * x - 1.0);
                x -= value / slope;
            }
            let (s, weight) = (0.5 * (x + 1.0), 1.0 / ((1.0 - x * x) * slope * slope));
            [s * s * (3.0 - 2.0 * s), weight * 6.0 * s * (1.0 - s)]
        };
        Rule((0..points).map(node).collect())
    }

    /// The rule moved to an interval.
    fn on(&self, from: f64, to: f64) -> impl Iterator<Item = (f64, f64)> {
        self.0.iter().map(move |[x, weight]| (from + (to - from) * x, (to - from) * weight))
    }
}

/// Rules for azimuth and height that give about four digits; the finer ones of [`Rules::fine`] one more.
pub struct Rules {
    azimuth: Rule,
    height: Rule,
}

impl Rules {
    /// For tables.
    pub fn coarse() -> Rules {
        Rules { azimuth: Rule::new(16), height: Rule::new(10) }
    }

    /// For tests of tables.
    pub fn fine() -> Rules {
        Rules { azimuth: Rule::new(24), height: Rule::new(16) }
    }
}

/// Shares of light that a direction finds again after one facet.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shares {
    /// Of glass as Fresnel's equations say.
    pub plain: f64,
    /// Of glass that reflects nothing but what it must reflect totally.
    pub clear: f64,
    /// Of facets that reflect everything.
    pub full: f64,
}

impl AddAssign for Shares {
    fn add_assign(&mut self, other: Shares) {
        self.plain += other.plain;
        self.clear += other.clear;
        self.full += other.full;
    }
}

/// The shares for a direction `wo` above facets of two alphas; `eta` is the index of the other side over that of the
/// viewer's.
pub fn shares(wo: DVec3, alpha: [f64; 2], eta: f64, rules: &Rules) -> Shares {
    let view = View::new(wo, alpha, eta);
    // The half circle where the other half is its mirror image.
    let (turn, weight) = if wo.y == 0.0 { (PI, 2.0) } else { (TAU, 1.0) };
    let mut sum = Shares::default();
    for ends in view.azimuths(turn).windows(2) {
        for (azimuth, across) in rules.azimuth.on(ends[0], ends[1]) {
            let slice = view.slice(azimuth);
            for ends in view.heights(&slice).windows(2) {
                for (height, along) in rules.height.on(ends[0], ends[1]) {
                    sum += view.facet(&slice, height, weight * across * along);
                }
            }
        }
    }
    sum
}

/// A direction in the plane of x and z by its cosine, at least 1e-6.
pub fn direction(cosine: f64) -> DVec3 {
    let cosine = cosine.max(1e-6);
    DVec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine)
}

/// A direction and the space in which its facets are those of a hemisphere, seen along `standard`.
struct View {
    wo: DVec3,
    alpha: [f64; 2],
    eta: f64,
    root: f64,
    standard: DVec3,
    up: DVec3,
    side: DVec3,
}

/// Hemisphere normals in a plane through `standard`: cos(height) standard + sin(height) across.
struct Slice {
    across: DVec3,
    /// Of the normal stretched to a facet's: squares of both vectors' lengths, and their product.
    squares: [f64; 2],
    product: f64,
    /// Where the hemisphere ends.
    most: f64,
}

impl View {
    fn new(wo: DVec3, alpha: [f64; 2], eta: f64) -> View {
        let root = smith_root(wo, alpha);
        let standard = DVec3::new(wo.x * alpha[0], wo.y * alpha[1], wo.z) / root;
        let up = (DVec3::Z - standard * standard.z).try_normalize().unwrap_or(DVec3::X);
        View { wo, alpha, eta, root, standard, up, side: standard.cross(up) }
    }

    fn stretched(&self, v: DVec3) -> DVec3 {
        DVec3::new(v.x * self.alpha[0], v.y * self.alpha[1], v.z)
    }

    fn slice(&self, azimuth: f64) -> Slice {
        let across = self.up * azimuth.cos() + self.side * azimuth.sin();
        let (a, b) = (self.stretched(self.standard), self.stretched(across));
        let most = if across.z < 0.0 { (self.standard.z / -across.z).atan() } else { FRAC_PI_2 };
        Slice { across, squares: [a.length_squared(), b.length_squared()], product: a.dot(b), most }
    }

    /// Heights at which facets are seen under a cosine.
    fn seen_under(&self, slice: &Slice, cosine: f64) -> impl Iterator<Item = f64> {
        let within = self.root * self.root / (cosine * cosine);
        slice.roots(slice.squares[1], slice.product, slice.squares[0] - within)
    }

    /// Cosine of total reflection, or how fast reflectance rises from the outside.
    fn critical(&self) -> f64 {
        ((self.eta - 1.0) * (self.eta + 1.0)).abs().sqrt()
    }

    /// Azimuths between which the integral over heights is smooth: where facets of total reflection come into view.
    fn azimuths(&self, turn: f64) -> Vec<f64> {
        let mut ends: Vec<f64> =
            (0..5).map(|i| f64::from(i) * FRAC_PI_2).filter(|&x| x <= turn + 0.1).collect();
        if self.eta < 1.0 {
            let edges = |azimuth: f64| self.seen_under(&self.slice(azimuth), self.critical()).count();
            let step = FRAC_PI_4 / 12.0;
            for i in 0..(turn / step).round() as usize - 1 {
                let (mut low, mut high) = ((i as f64 + 0.5) * step, (i as f64 + 1.5) * step);
                let before = edges(low);
                if before == edges(high) {
                    continue;
                }
                for _ in 0..45 {
                    let middle = 0.5 * (low + high);
                    if edges(middle) == before { low = middle } else { high = middle }
                }
                ends.push(low);
            }
        }
        ends.sort_by(f64::total_cmp);
        ends
    }

    /// Heights between which the integrand is smooth: total reflection and some multiples of its cosine, and where
    /// reflected or refracted light leaves along the horizon.
    fn heights(&self, slice: &Slice) -> Vec<f64> {
        let mut ends = vec![0.0, slice.most];
        let mut cosine = self.critical();
        for _ in 0..7 {
            if cosine < 1.0 {
                ends.extend(self.seen_under(slice, cosine));
            }
            cosine *= 4.0;
        }
        let (z, rise) = (self.standard.z, slice.across.z);
        let [along, across] = slice.squares;
        ends.extend(slice.roots(z * across, z * slice.product - rise, z * along - 2.0 * z));
        let (k, n) = (self.wo.z * self.wo.z, (self.eta - 1.0) * (self.eta + 1.0));
        let both = self.root * self.root * z * rise;
        ends.extend(slice.roots(
            k * across - n * rise * rise,
            k * slice.product - both - n * z * rise,
            k * along - 2.0 * k - n * z * z,
        ));
        ends.sort_by(f64::total_cmp);
        ends
    }

    /// A facet's shares of the light, times a weight.
    fn facet(&self, slice: &Slice, height: f64, weight: f64) -> Shares {
        let (sine, cosine) = height.sin_cos();
        // Hemisphere normals are seen in proportion to their cosine.
        let weight = weight * cosine * sine * 2.0 / (PI * (1.0 + self.standard.z));
        let stretched = self.stretched(self.standard * cosine + slice.across * sine);
        let length = stretched.length();
        let normal = stretched / length;
        let c = (cosine * self.root / length).min(1.0);
        let (reflectance, cos_t) = fresnel(c, self.eta);
        let mut shares = Shares::default();
        let up = normal * (2.0 * c) - self.wo;
        if up.z > 0.0 {
            let masked =
                up.z * (self.wo.z + self.root) / (up.z * self.root + self.wo.z * smith_root(up, self.alpha));
            shares.full = weight * masked;
            shares.plain = reflectance * shares.full;
            shares.clear = if cos_t > 0.0 { 0.0 } else { shares.full };
        }
        let down = normal * (c / self.eta - cos_t) - self.wo / self.eta;
        if cos_t > 0.0 && down.z < 0.0 {
            let masked = weight * -2.0 * down.z / (smith_root(down, self.alpha) - down.z);
            shares.plain += (1.0 - reflectance) * masked;
            shares.clear += masked;
        }
        shares
    }
}

impl Slice {
    /// Heights whose tangents t solve a t^2 + 2 b t + c = 0, as far as the hemisphere reaches.
    fn roots(&self, a: f64, b: f64, c: f64) -> impl Iterator<Item = f64> {
        let most = self.most;
        let sum = -(b + (b * b - a * c).sqrt().copysign(b));
        // NaN and infinity, from no solution or one, are no heights.
        [sum / a, c / sum]
            .into_iter()
            .filter(|t| *t > 0.0)
            .map(f64::atan)
            .filter(move |height| *height < most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::reference::{reflected, split};

    #[test]
    fn agrees_with_points_over_all_facets() {
        let rules = Rules::coarse();
        for alpha in [0.05, 0.3, 1.0] {
            for cosine in [0.9, 0.3, 0.05f64] {
                for eta in [1.05, 1.5, 1.0 / 1.05, 1.0 / 1.5] {
                    let found = shares(direction(cosine), [alpha; 2], eta, &rules);
                    let [plain, full] =
                        [split(cosine, alpha, eta, 400_000), reflected(cosine, alpha, 400_000)[0]];
                    let what = format!("{alpha} {cosine} {eta}: {found:?}, {plain} {full}");
                    assert!((found.plain / plain - 1.0).abs() < 3e-4, "{what}");
                    assert!((found.full / full - 1.0).abs() < 3e-4, "{what}");
                }
            }
        }
    }

    /// Glass of index 1 is not there: light goes straight on, masked once more; facets of two roughnesses too.
    #[test]
    fn glass_like_air_masks_twice() {
        let wo = DVec3::new(0.3, 0.4, 0.75f64.sqrt());
        let alpha = [0.7, 0.2];
        let exact = 2.0 * wo.z / (wo.z + smith_root(wo, alpha));
        let found = shares(wo, alpha, 1.0 + 1e-9, &Rules::coarse());
        assert!((found.plain / exact - 1.0).abs() < 1e-4 && (found.clear / exact - 1.0).abs() < 1e-4);
    }

    /// What little is left near index 1 at grazing incidence does not depend on the number of points.
    #[test]
    fn small_shares_keep_their_digits() {
        for alpha in [[0.65, 0.65], [0.95, 0.1]] {
            for eta in [1.0003, 1.0 / 1.0003, 1.0 / 1.02] {
                for (cosine, y) in [(1e-5, 0.0), (3e-3, 0.4f64)] {
                    let wo = direction(cosine);
                    let wo = DVec3::new(wo.x * (1.0 - y * y).sqrt(), wo.x * y, wo.z);
                    let [coarse, fine] =
                        [Rules::coarse(), Rules::fine()].map(|rules| shares(wo, alpha, eta, &rules));
                    let what = format!("{alpha:?} {eta} {wo}: {coarse:?} {fine:?}");
                    assert!((coarse.plain / fine.plain - 1.0).abs() < 5e-4, "{what}");
                    assert!((coarse.clear / fine.clear - 1.0).abs() < 5e-4, "{what}");
                }
            }
        }
    }
}
