use super::*;
use std::f64::consts::PI as PI_64;

fn hair(color: f32, roughness: [f32; 2], tilt: f32) -> Hair {
    Hair::new(Vec2::new(0.8, 0.6), Rgb::splat(color), roughness, 1.55, tilt, 0.0)
}

/// A direction by its angle over the plane across a fibre along (0.8, 0.6), and that around it.
fn direction(theta: f64, phi: f64) -> Vec3 {
    let (across, z) = (theta.cos() * phi.sin(), theta.cos() * phi.cos());
    let along = theta.sin();
    Vec3::new((0.8 * along - 0.6 * across) as f32, (0.6 * along + 0.8 * across) as f32, z as f32)
}

#[test]
fn the_bessel_function_is_its_series() {
    for i in 0..400 {
        let x = f64::from(i) * 0.05;
        let (mut term, mut sum) = (1.0, 1.0);
        for k in 1..200 {
            term *= (x / 2.0).powi(2) / f64::from(k * k);
            sum += term;
        }
        let expected = sum * (-x).exp();
        let error = (f64::from(scaled_bessel(x as f32)) / expected - 1.0).abs();
        assert!(error < 5e-7, "{x}: {error}");
    }
}

/// Without pigment all light continues, whatever the roughness and where on the fibre the viewer looks, and densities are one.
#[test]
fn the_white_furnace_and_the_density_are_one() {
    let (rows, columns) = (600, 300);
    for roughness in [[0.1, 0.1], [0.1, 0.9], [0.3, 0.3], [0.6, 0.15], [0.9, 0.1], [1.0, 1.0]] {
        for (theta, phi) in [(0.0, 0.0), (0.4, 0.9), (-0.9, 1.5), (1.3, -0.6)] {
            let (hair, wo) = (hair(1.0, roughness, 0.035), direction(theta, phi));
            let (mut energy, mut density) = (0.0, 0.0);
            for row in 0..rows {
                let theta = PI_64 * ((f64::from(row) + 0.5) / f64::from(rows) - 0.5);
                for column in 0..columns {
                    let phi = 2.0 * PI_64 * (f64::from(column) + 0.5) / f64::from(columns);
                    let eval = hair.eval(wo, direction(theta, phi));
                    energy += f64::from(eval.f_cos.g) * theta.cos();
                    density += f64::from(eval.pdf_solid_angle) * theta.cos();
                }
            }
            let cell = PI_64 / f64::from(rows) * 2.0 * PI_64 / f64::from(columns);
            let (energy, density) = (energy * cell, density * cell);
            assert!((energy - 1.0).abs() < 1e-3, "{roughness:?} {theta} {phi}: energy {energy}");
            assert!((density - 1.0).abs() < 1e-3, "{roughness:?} {theta} {phi}: density {density}");
        }
    }
}

/// The ray that leaves a smooth cylinder of glass along x, which it enters at the top, after so many reflections within, with its
/// way in the glass.
fn through_cylinder(wo: [f64; 3], ior: f64, reflections: u32) -> ([f64; 3], f64) {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let mix = |a: [f64; 3], s: f64, b: [f64; 3], t: f64| [0, 1, 2].map(|i| a[i] * s + b[i] * t);
    // Refracts d at a normal against it, into eta times denser.
    let refract = |d: [f64; 3], n: [f64; 3], eta: f64| {
        let cos_i = -dot(d, n);
        let cos_t = (1.0 - (1.0 - cos_i * cos_i) / (eta * eta)).sqrt();
        mix(d, 1.0 / eta, n, cos_i / eta - cos_t)
    };
    let mut p = [0.0, 0.0, 1.0];
    let mut d = refract(wo.map(|x| -x), p, ior);
    let mut way = 0.0;
    for bounce in 0.. {
        // On to the wall: |p + t d| = 1 across.
        let t = -2.0 * (p[1] * d[1] + p[2] * d[2]) / (d[1] * d[1] + d[2] * d[2]);
        way += t;
        p = mix(p, 1.0, d, t);
        let normal = [0.0, -p[1], -p[2]];
        if bounce == reflections {
            return (refract(d, normal, 1.0 / ior), way);
        }
        d = mix(d, 1.0, normal, -2.0 * dot(d, normal));
    }
    unreachable!("the loop returns")
}

/// TT and TRT lead where a smooth cylinder sends the light, and their pigment is that of the way within it.
#[test]
fn lobes_are_where_snell_sends_them() {
    for (theta, phi) in [(0.0f64, 0.0f64), (0.2, 0.5), (-0.7, 1.2), (0.9, -0.8), (0.0, -1.4)] {
        let wo = [theta.sin(), theta.cos() * phi.sin(), theta.cos() * phi.cos()];
        let hair = Hair::new(Vec2::X, Rgb::splat(0.5), [0.1, 0.1], 1.55, 0.0, 0.0);
        let clear = Hair::new(Vec2::X, Rgb::ONE, [0.1, 0.1], 1.55, 0.0, 0.0);
        let seen_of = |hair: &Hair| hair.seen(hair.around(Vec3::from(wo.map(|x| x as f32)), 1.0));
        let (seen, unpigmented) = (seen_of(&hair), seen_of(&clear));
        for p in [1, 2] {
            let (out, way) = through_cylinder(wo, 1.55, p - 1);
            let around = hair.around(Vec3::from(out.map(|x| x as f32)), 1.0);
            let off = wrapped(around.angle - seen.wo.angle - seen.middle[p as usize]);
            assert!(off.abs() < 2e-3 && (around.sine + seen.turned[p as usize].0).abs() < 1e-5, "{p}: {off}");
            let absorption = f64::from(hair.root_absorption.g).powi(2);
            let ratio = f64::from(seen.share[p as usize].g / unpigmented.share[p as usize].g);
            assert!((ratio / (-absorption * way).exp() - 1.0).abs() < 2e-5, "{p}: {ratio} {way}");
        }
    }
}

#[test]
fn colours_and_absorption_are_inverse() {
    for radial in [0.05, 0.3, 0.9] {
        for absorption in [0.0f32, 0.02, 0.4, 3.0] {
            let color = crate::scene::hair_color([absorption; 3], radial);
            let hair = Hair::new(Vec2::X, Rgb::from_array(color), [0.3, radial], 1.55, 0.0, 0.0);
            let found = hair.root_absorption.r * hair.root_absorption.r;
            assert!((found - absorption).abs() <= 1e-4 * absorption, "{radial} {absorption}: {found}");
            assert!((hair.albedo().r - color[0]).abs() < 1e-5);
        }
    }
    let tinted = hair(0.5, [0.3; 2], 0.0).tinted(Rgb::splat(0.4));
    assert!((tinted.albedo().g - 0.2).abs() < 1e-5);
}

#[test]
fn a_coat_narrows_only_what_the_surface_reflects() {
    let plain = Hair::new(Vec2::X, Rgb::ONE, [0.5, 0.3], 1.55, 0.0, 0.0);
    let coated = Hair::new(Vec2::X, Rgb::ONE, [0.5, 0.3], 1.55, 0.0, 0.8);
    assert!(coated.variance[0] < 0.1 * plain.variance[0] && coated.variance[1..] == plain.variance[1..]);
}
