//! Reference implementations for tests, in double precision: directional albedos by quadrature, from which the tables are made, and
//! random walks among microfacets. They follow the papers, independently of the lobes.

use crate::math::DVec3;
use crate::sampling::chi2::Random;
use std::f64::consts::TAU;

/// Quadrature nodes: visible normals of GGX facets (Dupuy, Benyoub 2023, listing 3) and weights, which add up to 1.
///
/// Midpoint rule in azimuth and in the height of the cap, with nodes concentrated at grazing normals: for small roughness equal steps
/// would miss the distribution's tail. `turn` is the fraction of the circle that is covered; by symmetry a half may suffice.
fn visible_normals(
    wo: DVec3,
    alpha: [f64; 2],
    turn: f64,
    points: usize,
) -> impl Iterator<Item = (DVec3, f64)> {
    let columns = ((points as f64).sqrt() * turn.max(0.5)) as usize;
    let rows = points / columns;
    (0..columns * rows).map(move |i| {
        let rest = 1.0 - ((i % rows) as f64 + 0.5) / rows as f64;
        let weight = 3.0 * rest * rest / (columns * rows) as f64;
        let turns = ((i / rows) as f64 + 0.5) / columns as f64 * turn;
        (visible_normal(wo, alpha, rest.powi(3), turns), weight)
    })
}

/// The visible normal for a height (0..1) and an azimuth (turns) on the spherical cap; `wo` may point down.
pub fn visible_normal(wo: DVec3, [ax, ay]: [f64; 2], height: f64, turns: f64) -> DVec3 {
    let stretched = DVec3::new(wo.x * ax, wo.y * ay, wo.z).normalize();
    let z = height * (1.0 + stretched.z) - stretched.z;
    let sine = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt();
    let (s, c) = (turns * TAU).sin_cos();
    let half = DVec3::new(sine * c, sine * s, z) + stretched;
    DVec3::new(half.x * ax, half.y * ay, half.z.max(1e-300)).normalize()
}

/// The root in Smith's masking G1 = 2 z / (z + root).
fn smith_root(v: DVec3, [ax, ay]: [f64; 2]) -> f64 {
    (ax * ax * v.x * v.x + ay * ay * v.y * v.y + v.z * v.z).sqrt()
}

/// A direction in the xz plane with a cosine of at least 1e-6.
pub fn direction(cosine: f64) -> DVec3 {
    let cosine = cosine.max(1e-6);
    DVec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine)
}

/// Single-scattering directional albedo of isotropic facets for a reflectance of 1, and its part weighted by (1 - cos)^5.
pub fn reflected(cosine: f64, alpha: f64, points: usize) -> [f64; 2] {
    reflected_from(direction(cosine), [alpha; 2], 0.5, points)
}

/// As [`reflected`] for anisotropic facets; `turn` is 0.5 if facets are isotropic and `wo` is in the xz plane, else 1.
pub fn reflected_from(wo: DVec3, alpha: [f64; 2], turn: f64, points: usize) -> [f64; 2] {
    reflections(wo, alpha, turn, points)
        .fold([0.0; 2], |[full, grazing], (c, light)| [full + light, grazing + light * (1.0 - c).powi(5)])
}

/// Single reflections by facets of reflectance 1: cosines between view and facet normal, and energies.
pub fn reflections(wo: DVec3, alpha: [f64; 2], turn: f64, points: usize) -> impl Iterator<Item = (f64, f64)> {
    let root_o = smith_root(wo, alpha);
    visible_normals(wo, alpha, turn, points).filter_map(move |(normal, weight)| {
        let c = wo.dot(normal).clamp(0.0, 1.0);
        let wi = normal * (2.0 * c) - wo;
        (wi.z > 0.0).then(|| (c, weight * masked_reflection(wo, wi, root_o, alpha)))
    })
}

/// G2 / G1(wo), height-correlated (Heitz 2014, eq. 99).
fn masked_reflection(wo: DVec3, wi: DVec3, root_o: f64, alpha: [f64; 2]) -> f64 {
    wi.z * (wo.z + root_o) / (wi.z * root_o + wo.z * smith_root(wi, alpha))
}

/// Fresnel's equations for unpolarised light: reflectance and cosine of the refracted direction.
pub fn fresnel(c: f64, eta: f64) -> (f64, f64) {
    let squared = 1.0 - (1.0 - c * c) / (eta * eta);
    if squared <= 0.0 {
        return (1.0, 0.0);
    }
    let t = squared.sqrt();
    let (s, p) = ((c - eta * t) / (c + eta * t), (eta * c - t) / (eta * c + t));
    (0.5 * (s * s + p * p), t)
}

/// At alpha 1 normals are uniformly distributed and the albedo is 1 - c ln((1 + c) / c).
#[test]
fn quadrature_agrees_with_the_closed_form_at_alpha_1() {
    for c in [1.0, 0.6, 0.3, 0.1, 0.01f64] {
        let exact = 1.0 - c * ((1.0 + c) / c).ln();
        let found = reflected(c, 1.0, 20_000)[0];
        assert!((found - exact).abs() < 5e-5, "{c}: {found} {exact}");
    }
}

// Reference of rough solid glass: the random walk among microfacets of Heitz, Hanika, d'Eon, Dachsbacher 2016, "Multiple-Scattering
// Microfacet BSDFs with the Smith Model", with dielectric facets and uniformly distributed heights (whose distribution does not
// affect the result).

/// A rough interface; z above 0 is outside.
pub struct RoughInterface {
    /// GGX alphas along x and y.
    pub alpha: [f64; 2],
    /// Relative index of refraction: inside over outside.
    pub ior: f64,
}

impl RoughInterface {
    /// Samples a walk: the direction of incident light for `wo`, and the number of facets hit.
    pub fn walk(&self, wo: DVec3, random: &mut Random) -> (DVec3, u32) {
        let mut unit = || f64::from(random.next());
        let (mut direction, mut is_outside, mut facets) = (-wo, wo.z > 0.0, 0);
        // Heights of the surface are in -1..1.
        let mut height = 1.0;
        loop {
            let up = if is_outside { direction } else { -direction };
            let Some(next) = self.next_height(up, height, unit()) else {
                return (direction, facets);
            };
            facets += 1;
            let normal = visible_normal(-up, self.alpha, 1.0 - unit(), unit());
            let c = (-up).dot(normal).clamp(0.0, 1.0);
            let eta = if is_outside { self.ior } else { 1.0 / self.ior };
            let (reflectance, cos_t) = fresnel(c, eta);
            let is_reflected = unit() < reflectance;
            let scattered =
                if is_reflected { normal * (2.0 * c) + up } else { normal * (c / eta - cos_t) + up / eta };
            direction = if is_outside { scattered } else { -scattered }.normalize();
            (is_outside, height) = if is_reflected { (is_outside, next) } else { (!is_outside, -next) };
        }
    }

    /// Smith's Lambda for a direction, which may point down.
    fn lambda(&self, v: DVec3) -> f64 {
        let [ax, ay] = self.alpha;
        let slope = ((ax * v.x).powi(2) + (ay * v.y).powi(2)) / (v.z * v.z).max(1e-300);
        0.5 * (v.z.signum() * (1.0 + slope).sqrt() - 1.0)
    }

    /// Samples the height of the next facet along `v`; `None` if the ray leaves the surface (section 4.3 of the paper).
    fn next_height(&self, v: DVec3, height: f64, u: f64) -> Option<f64> {
        let below = (0.5 * (height + 1.0)).clamp(1e-12, 1.0);
        let lambda = self.lambda(v);
        if v.z > 0.0 && u > 1.0 - below.powf(lambda) {
            return None;
        }
        if lambda.abs() < 1e-9 {
            return Some(height);
        }
        Some((2.0 * below / (1.0 - u).powf(1.0 / lambda) - 1.0).clamp(-1.0, 1.0))
    }
}

/// Walks of one facet have the energy of single scattering: compared with the closed form at alpha 1, at an index so high that nearly
/// all light is reflected.
#[test]
fn walks_of_one_facet_equal_single_scattering() {
    let mut random = Random::new(12);
    let interface = RoughInterface { alpha: [1.0, 1.0], ior: 1e6 };
    for c in [1.0, 0.6, 0.3f64] {
        let wo = DVec3::new((1.0 - c * c).sqrt(), 0.0, c);
        let n = 40_000;
        let once = (0..n).filter(|_| interface.walk(wo, &mut random).1 == 1).count();
        let exact = 1.0 - c * ((1.0 + c) / c).ln();
        let found = once as f64 / f64::from(n);
        assert!((found - exact).abs() < 0.01, "{c}: {found} {exact}");
    }
}

/// Under uniform illumination the transmitted flux in both directions is equal up to the squared index.
#[test]
fn walks_are_reciprocal() {
    let mut random = Random::new(14);
    for (alpha, ior) in [([1.0, 0.3], 1.5), ([0.5, 0.5], 2.4)] {
        let interface = RoughInterface { alpha, ior };
        let n = 40_000;
        let mut transmittance = |side: f64| {
            let is_transmitted = |_: &u32| {
                let c = f64::from(random.next()).sqrt();
                let (y, x) = (f64::from(random.next()) * TAU).sin_cos();
                let sine = (1.0 - c * c).sqrt();
                let wo = DVec3::new(sine * x, sine * y, c * side);
                interface.walk(wo, &mut random).0.z * side < 0.0
            };
            (0..n).filter(is_transmitted).count() as f64 / f64::from(n)
        };
        let (inwards, outwards) = (transmittance(1.0), transmittance(-1.0) * ior * ior);
        assert!((inwards - outwards).abs() < 0.02, "{alpha:?} {ior}: {inwards} {outwards}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::{Bsdf, GlassReflectance, Microsurface, Refraction, RoughDielectric, Walls};
    use crate::color::Rgb;
    use crate::math::Vec3;
    use crate::scene::EnergyCompensation;
    use std::f64::consts::PI;

    const SAMPLES: u32 = 20_000;

    fn glass(alpha: [f64; 2], ior: f64, energy_compensation: EnergyCompensation) -> Bsdf {
        Bsdf::RoughDielectric(RoughDielectric {
            surface: Microsurface::new(alpha.map(|a| a as f32), [1.0, 0.0]),
            ior: ior as f32,
            walls: Walls::Solid,
            refraction: Refraction::Scales,
            tint: Rgb::ONE,
            reflectance: GlassReflectance::Plain,
            energy_compensation,
            is_beckmann: false,
        })
    }

    /// The reflected fraction of all scattered energy.
    fn reflected(bsdf: &Bsdf, wo: DVec3, random: &mut Random) -> f64 {
        let (mut reflected, mut all) = (0.0, 0.0);
        for _ in 0..SAMPLES {
            let s = bsdf.sample(wo.as_vec3(), [random.next(), random.next(), random.next()]);
            let weight = f64::from(s.weight.r * s.eta * s.eta);
            all += weight;
            reflected += if s.is_transmission { 0.0 } else { weight };
        }
        reflected / all
    }

    /// The reflected fraction of solid glass agrees with random walks, several times better than normalised single scattering.
    #[test]
    fn reflected_fraction_of_glass_agrees_with_walks() {
        let mut random = Random::new(9);
        let (mut errors, mut scaled) = (Vec::new(), Vec::new());
        for alpha in [[0.1, 0.1], [0.3, 0.3], [0.5, 0.5], [0.5, 0.125], [1.0, 1.0], [1.0, 0.2]] {
            for ior in [1.05, 1.33, 1.5, 2.4] {
                for cosine in [0.9, 0.5, 0.2, -0.9, -0.5, -0.2f64] {
                    let sine = (1.0 - cosine * cosine).sqrt();
                    let wo = DVec3::new(0.8 * sine, 0.6 * sine, cosine);
                    let interface = RoughInterface { alpha, ior };
                    let same =
                        (0..SAMPLES).filter(|_| interface.walk(wo, &mut random).0.z * cosine > 0.0).count();
                    let exact = same as f64 / f64::from(SAMPLES);
                    let [multi, single] = [EnergyCompensation::On, EnergyCompensation::Off]
                        .map(|m| (reflected(&glass(alpha, ior, m), wo, &mut random) - exact).abs());
                    errors.push((multi, cosine, format!("alpha {alpha:?}, ior {ior}: {exact}")));
                    scaled.push(single);
                }
            }
        }
        let mean = errors.iter().map(|(e, ..)| e).sum::<f64>() / errors.len() as f64;
        let mean_scaled = scaled.iter().sum::<f64>() / scaled.len() as f64;
        println!("mean {mean:.4}, scaled {mean_scaled:.4}");
        assert!(mean < 0.015 && mean_scaled > 3.5 * mean, "{mean} {mean_scaled}");
        errors.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (range, bound) in [(0.0..=1.0, 0.02), (-1.0..=-0.4, 0.07), (-0.4..=0.0, 0.25)] {
            let largest = errors.iter().rfind(|(_, cosine, _)| range.contains(cosine)).unwrap();
            println!("{largest:?}");
            assert!(largest.0 < bound, "{largest:?}");
        }
    }

    /// Under uniform illumination in equilibrium (radiance proportional to the squared index on each side), reciprocal scattering leaves
    /// the same radiance in every direction. Glass deviates by less than a factor of two.
    #[test]
    fn uniform_illumination_is_nearly_preserved() {
        let mut random = Random::new(13);
        let n = 200_000u32;
        let mut ends = [1.0f64; 2];
        for alpha in [0.1, 0.3, 0.5, 1.0] {
            for ior in [1.33, 1.5, 2.0] {
                let bsdf = glass([alpha; 2], ior, EnergyCompensation::On);
                let outside = 1.0 / (1.0 + ior * ior);
                let mut bands = [0.0f64; 20];
                for _ in 0..n {
                    let cosine = f64::from(random.next()).sqrt();
                    let is_outside = f64::from(random.next()) < outside;
                    let wo = Vec3::new(
                        (1.0 - cosine * cosine).sqrt() as f32,
                        0.0,
                        if is_outside { cosine } else { -cosine } as f32,
                    );
                    let s = bsdf.sample(wo, [random.next(), random.next(), random.next()]);
                    let band = ((s.wi.z.abs() * 10.0) as usize).min(9) + if s.wi.z > 0.0 { 0 } else { 10 };
                    bands[band] += f64::from(s.weight.r * s.eta * s.eta) / f64::from(n);
                }
                for (i, found) in bands.into_iter().enumerate() {
                    let (band, side) = (i % 10, if i < 10 { outside } else { 1.0 - outside });
                    let even = side * f64::from(2 * band as u32 + 1) / 100.0;
                    ends = [ends[0].min(found / even), ends[1].max(found / even)];
                }
            }
        }
        println!("from {:.2} to {:.2} times", ends[0], ends[1]);
        assert!(ends[0] > 0.5 && ends[1] < 2.0, "{ends:?}");
    }

    /// Distribution over directions (8 bands of z, 4 sectors each) of the incident light of a camera path along +z that hits a unit
    /// ball of glass at an offset from its axis.
    fn light_through_a_ball(offset: f64, mut scatter: impl FnMut(DVec3) -> (DVec3, f64)) -> Vec<f64> {
        let mut energies = vec![0.0; 32];
        for _ in 0..2 * SAMPLES {
            let mut point = DVec3::new(offset, 0.0, -(1.0 - offset * offset).sqrt());
            let (mut direction, mut weight) = (DVec3::Z, 1.0 / f64::from(2 * SAMPLES));
            for _ in 0..100 {
                let (x, y) = point.any_orthonormal_pair();
                let wo = -direction;
                let (wi, w) = scatter(DVec3::new(wo.dot(x), wo.dot(y), wo.dot(point)));
                direction = (x * wi.x + y * wi.y + point * wi.z).normalize();
                weight *= w;
                if wi.z > 0.0 {
                    let band = (4.0 * (direction.z + 1.0)) as usize;
                    let sector = (2.0 / PI * (direction.y.atan2(direction.x) + PI)) as usize;
                    energies[band.min(7) * 4 + sector.min(3)] += weight;
                    break;
                }
                point = (point - direction * (2.0 * point.dot(direction))).normalize();
            }
        }
        energies
    }

    /// The distribution of light through a frosted ball agrees with random walks, but for a few percent of the energy.
    #[test]
    fn light_through_frosted_balls_agrees_with_walks() {
        let mut random = Random::new(10);
        let mut differences = Vec::new();
        for alpha in [[0.1, 0.1], [0.3, 0.3], [0.5, 0.5], [0.5, 0.125], [1.0, 1.0]] {
            for ior in [1.05, 1.33, 1.5, 2.0] {
                for offset in [0.2, 0.7, 0.95] {
                    let interface = RoughInterface { alpha, ior };
                    let exact = light_through_a_ball(offset, |wo| (interface.walk(wo, &mut random).0, 1.0));
                    let bsdf = glass(alpha, ior, EnergyCompensation::On);
                    let found = light_through_a_ball(offset, |wo| {
                        let s = bsdf.sample(wo.as_vec3(), [random.next(), random.next(), random.next()]);
                        (s.wi.as_dvec3(), f64::from(s.weight.r * s.eta * s.eta))
                    });
                    let sum: f64 = exact.iter().zip(&found).map(|(a, b)| (a - b).abs()).sum();
                    differences.push((sum, format!("alpha {alpha:?}, ior {ior}, offset {offset}")));
                }
            }
        }
        let mean = differences.iter().map(|(d, _)| d).sum::<f64>() / differences.len() as f64;
        differences.sort_by(|a, b| a.0.total_cmp(&b.0));
        println!("mean {mean:.4}, largest {:?}", &differences[differences.len() - 4..]);
        assert!(mean < 0.08, "{mean}");
    }
}
