//! Directional albedos by quadrature in double precision: what the tables are made of and tested against.
//!
//! Written from the formulas rather than from the lobes, so that a mistake in one shows in the other.

use crate::math::DVec3;
use std::f64::consts::TAU;

/// Visible normals of GGX facets (Dupuy, Benyoub 2023, listing 3) and their weights, which add up to 1.
///
/// Midpoints in azimuth, and in the height of the cap with the points crowded towards the normals that hardly show:
/// the distribution's tail is there, and equal steps would miss it for small roughness. `turn` is the part of the
/// circle that is covered: a half is enough where the other half is its mirror image.
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

/// The visible normal at a height (0 the lowest, 1 the highest) and an azimuth of the spherical cap; `wo` may point down.
pub fn visible_normal(wo: DVec3, [ax, ay]: [f64; 2], height: f64, turns: f64) -> DVec3 {
    let stretched = DVec3::new(wo.x * ax, wo.y * ay, wo.z).normalize();
    let z = height * (1.0 + stretched.z) - stretched.z;
    let sine = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt();
    let (s, c) = (turns * TAU).sin_cos();
    let half = DVec3::new(sine * c, sine * s, z) + stretched;
    DVec3::new(half.x * ax, half.y * ay, half.z.max(1e-300)).normalize()
}

/// The root in Smith's masking: G1 = 2 z / (z + root).
fn smith_root(v: DVec3, [ax, ay]: [f64; 2]) -> f64 {
    (ax * ax * v.x * v.x + ay * ay * v.y * v.y + v.z * v.z).sqrt()
}

/// A direction of this cosine (at least 1e-6) in the plane of x and z.
pub fn direction(cosine: f64) -> DVec3 {
    let cosine = cosine.max(1e-6);
    DVec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine)
}

/// What single scattering reflects with a reflectance of 1, and the share of it weighted by (1 - cos)^5. Facets of the
/// same roughness in both directions.
pub fn reflected(cosine: f64, alpha: f64, points: usize) -> [f64; 2] {
    reflected_from(direction(cosine), [alpha; 2], 0.5, points)
}

/// The same for a direction and facets of two roughnesses; `turn` is half of the circle where the direction is in the plane
/// of x and z and the roughnesses are the same, otherwise all of it.
pub fn reflected_from(wo: DVec3, alpha: [f64; 2], turn: f64, points: usize) -> [f64; 2] {
    reflections(wo, alpha, turn, points)
        .fold([0.0; 2], |[full, grazing], (c, light)| [full + light, grazing + light * (1.0 - c).powi(5)])
}

/// What facets reflect once with a reflectance of 1: cosines under which they are seen, and shares of the light.
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

/// Fresnel's equations for unpolarised light: reflectance and cosine behind the interface.
pub fn fresnel(c: f64, eta: f64) -> (f64, f64) {
    let squared = 1.0 - (1.0 - c * c) / (eta * eta);
    if squared <= 0.0 {
        return (1.0, 0.0);
    }
    let t = squared.sqrt();
    let (s, p) = ((c - eta * t) / (c + eta * t), (eta * c - t) / (eta * c + t));
    (0.5 * (s * s + p * p), t)
}

/// At alpha 1 normals are distributed evenly and the albedo has the closed form 1 - c ln((1 + c) / c).
#[test]
fn quadrature_is_exact_where_the_integral_is_known() {
    for c in [1.0, 0.6, 0.3, 0.1, 0.01f64] {
        let exact = 1.0 - c * ((1.0 + c) / c).ln();
        let found = reflected(c, 1.0, 20_000)[0];
        assert!((found - exact).abs() < 5e-5, "{c}: {found} {exact}");
    }
}
