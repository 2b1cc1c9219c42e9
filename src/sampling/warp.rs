//! Warps from the unit square to disks, spheres, hemispheres and cones. Local z is the axis.

use crate::math::{Vec2, Vec3, poly};
use std::f32::consts::{FRAC_1_PI, PI};

/// Samples the unit disk uniformly by the concentric mapping (Shirley, Chiu 1997), which preserves stratification.
#[inline(always)]
pub fn uniform_disk(u: [f32; 2]) -> Vec2 {
    let (a, b) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    let steep = a * a <= b * b;
    let (radius, other) = if steep { (b, a) } else { (a, b) };
    let octant = other / if radius == 0.0 { 1.0 } else { radius } * 0.125;
    let turns = if steep { 0.25 - octant } else { octant };
    let (sine, cosine) = poly::sin_cos_turns(turns);
    Vec2::new(radius * cosine, radius * sine)
}

/// Samples the cosine-weighted hemisphere around z (Malley's method). z is at least 1e-6, so that the density is never 0.
#[inline(always)]
pub fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let d = uniform_disk(u);
    let z_squared = 1.0 - d.x * d.x - d.y * d.y;
    Vec3::new(d.x, d.y, if z_squared > 1e-12 { z_squared } else { 1e-12 }.sqrt())
}

/// The inverse of [`cosine_hemisphere`]; unspecified for directions below the horizon.
#[inline(always)]
pub fn invert_cosine_hemisphere(w: Vec3) -> [f32; 2] {
    let steep = w.x * w.x <= w.y * w.y;
    let (major, minor) = if steep { (w.y, w.x) } else { (w.x, w.y) };
    let radius = (w.x * w.x + w.y * w.y).sqrt();
    let radius = if major < 0.0 { -radius } else { radius };
    let ratio = minor / if major == 0.0 { 1.0 } else { major };
    let other = radius * poly::atan_small(ratio) * (4.0 * FRAC_1_PI);
    let (a, b) = if steep { (other, radius) } else { (radius, other) };
    let clamped = |a: f32| {
        let u = 0.5 * a + 0.5;
        let u = if u > 0.0 { u } else { 0.0 };
        if u < 1.0 { u } else { 1.0f32.next_down() }
    };
    [clamped(a), clamped(b)]
}

/// Density of [`cosine_hemisphere`] per solid angle for a direction with this z; 0 below the horizon.
#[inline(always)]
pub fn cosine_hemisphere_pdf_solid_angle(z: f32) -> f32 {
    if z > 0.0 { z * FRAC_1_PI } else { 0.0 }
}

/// Samples the unit sphere uniformly.
#[inline(always)]
pub fn uniform_sphere(u: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * u[0];
    let radius = 2.0 * (u[0] * (1.0 - u[0])).sqrt();
    let (sine, cosine) = poly::sin_cos_turns(u[1]);
    Vec3::new(radius * cosine, radius * sine, z)
}

/// Density of [`uniform_sphere`] per solid angle.
pub const UNIFORM_SPHERE_PDF_SOLID_ANGLE: f32 = 0.25 * FRAC_1_PI;

/// 1 - cos of an angle up to 90 degrees, from its squared sine and squared cosine, without cancellation.
#[inline(always)]
pub fn one_minus_cos(sin_squared: f32, cos_squared: f32) -> f32 {
    sin_squared / (1.0 + cos_squared.sqrt())
}

/// Samples a cone around z uniformly. Its half-angle is given as 1 - cos (see [`one_minus_cos`]), which is precise for tiny
/// cones.
#[inline(always)]
pub fn uniform_cone(u: [f32; 2], one_minus_cos_max: f32) -> Vec3 {
    let h = u[0] * one_minus_cos_max;
    let sin_squared = h * (2.0 - h);
    let sine = if sin_squared > 0.0 { sin_squared } else { 0.0 }.sqrt();
    let (s, c) = poly::sin_cos_turns(u[1]);
    Vec3::new(sine * c, sine * s, 1.0 - h)
}

/// Density of [`uniform_cone`] per solid angle inside the cone.
#[inline(always)]
pub fn uniform_cone_pdf_solid_angle(one_minus_cos_max: f32) -> f32 {
    1.0 / (2.0 * PI * one_minus_cos_max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::{Chi2, SphericalDomain};

    #[test]
    fn disk_passes_chi_square() {
        Chi2::new("disk", 1).assert(
            |u| {
                let p = uniform_disk([u[0], u[1]]).as_dvec2();
                Some([p.length_squared(), p.y.atan2(p.x) / std::f64::consts::TAU + 0.5])
            },
            // Squared radius and angle: uniform.
            |_| 1.0,
        );
    }

    #[test]
    fn sphere_and_hemisphere_pass_chi_square() {
        let sphere = SphericalDomain::sphere();
        Chi2::new("sphere", 2).assert_directions(
            &sphere,
            |u| Some(uniform_sphere([u[0], u[1]])),
            |_| UNIFORM_SPHERE_PDF_SOLID_ANGLE,
        );
        Chi2::new("cosine hemisphere", 2).assert_directions(
            &sphere,
            |u| Some(cosine_hemisphere([u[0], u[1]])),
            |w| cosine_hemisphere_pdf_solid_angle(w.z),
        );
    }

    #[test]
    fn cones_of_all_sizes_pass_chi_square() {
        let sizes = [1e-12f32, 1e-6, 0.03, 0.7, 1.0];
        for omc in sizes {
            let name = format!("cone {omc}");
            // The cap of the cone itself: the density of a wider one would be discontinuous within cells.
            let cap = SphericalDomain::cap(Vec3::Z, f64::from(omc));
            Chi2::new(&name, sizes.len()).assert_directions(
                &cap,
                |u| Some(uniform_cone([u[0], u[1]], omc)),
                |_| uniform_cone_pdf_solid_angle(omc),
            );
        }
    }

    #[test]
    fn cosine_hemisphere_is_invertible() {
        let steps = (0..=64).map(|k| (k as f32 / 64.0).min(1.0f32.next_down()));
        for u in steps.clone().flat_map(|u| steps.clone().map(move |v| [u, v])) {
            let inverse = invert_cosine_hemisphere(cosine_hemisphere(u));
            let distance = (inverse[0] - u[0]).abs().max((inverse[1] - u[1]).abs());
            assert!(distance < 2e-6 && inverse.iter().all(|x| (0.0..1.0).contains(x)), "{u:?} {inverse:?}");
        }
    }

    #[test]
    fn extreme_samples_are_unit_vectors() {
        let below_one = 1.0f32.next_down();
        for u in [[0.0, 0.0], [0.5, 0.5], [below_one, below_one], [0.0, below_one], [below_one, 0.5]] {
            for w in [cosine_hemisphere(u), uniform_sphere(u), uniform_cone(u, 1.0), uniform_cone(u, 1e-20)] {
                assert!((w.length() - 1.0).abs() < 1e-6, "{u:?} {w}");
            }
            assert!(cosine_hemisphere(u).z > 0.0);
        }
    }
}
