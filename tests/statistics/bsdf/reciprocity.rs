//! Helmholtz reciprocity, where the models promise it.

use super::lobes::{basic, conductor, glass, gold, length};
use oscura::bsdf::{Beckmann, Bsdf, Lambert, OrenNayar, Phong};
use oscura::color::Rgb;
use oscura::sampling::chi2::Random;
use oscura::scene::EnergyCompensation;

/// f in both directions, for reflection: |cos| of the other side makes them comparable.
#[test]
fn reflection_is_reciprocal() {
    let mut random = Random::new(2);
    let color = Rgb::new(0.9, 0.4, 0.1);
    let mut lobes = vec![
        Bsdf::Lambert(Lambert { albedo: Rgb::ONE }),
        Bsdf::OrenNayar(OrenNayar { color, roughness: 0.7 }),
        Bsdf::Phong(Phong::new(Rgb::splat(0.2), color * 0.5, 12.0)),
        gold([0.2, 0.7], EnergyCompensation::Off),
    ];
    lobes.extend([0.1, 0.5, 1.0].map(|alpha| conductor(alpha, EnergyCompensation::Off)));
    lobes.extend([0.1, 0.5, 1.0].map(|alpha| Bsdf::Beckmann(Beckmann { color, alpha })));
    for bsdf in lobes {
        for _ in 0..10_000 {
            let (wo, wi) = (random.direction(), random.direction());
            let there = bsdf.eval(wo, wi).f_cos * wo.z.abs();
            let back = bsdf.eval(wi, wo).f_cos * wi.z.abs();
            assert!(length(there - back) <= 1e-3 * length(there) + 1e-6, "{bsdf:?} {wo} {wi} {there} {back}");
        }
    }
}

/// Radiance is scaled by 1 / n^2 on entering a medium of index n: f(wo, wi) n_i^2 is symmetric (Veach 1997, eq. 5.14).
#[test]
fn transmission_is_reciprocal_up_to_the_index() {
    let mut random = Random::new(3);
    let bsdf = glass(1.5, 0.7, false, [0.7, 0.8, 0.9], EnergyCompensation::Off);
    let mut compared = 0;
    for _ in 0..50_000 {
        let (wo, wi) = (random.direction(), random.direction());
        if wo.z < 0.02 || wi.z > -0.02 {
            continue;
        }
        // wo outside, wi inside.
        let there = bsdf.eval(wo, wi).f_cos * wo.z.abs() * 1.5f32.powi(2);
        let back = bsdf.eval(wi, wo).f_cos * wi.z.abs();
        if there.r > 1e-4 {
            compared += 1;
            assert!(length(there - back) <= 2e-3 * length(there), "{wo} {wi} {there} {back}");
        }
    }
    assert!(compared > 1000, "{compared}");
}

/// Non-reciprocal models: the reason is in the docs of each (energy conservation first). The test fails if that changes.
#[test]
fn compensated_and_layered_materials_are_not_reciprocal() {
    let mut random = Random::new(4);
    let solid = glass(1.5, 0.8, false, [1.0; 3], EnergyCompensation::On);
    for bsdf in [conductor(0.8, EnergyCompensation::On), basic(0.8, 0.0, 0.0, false), solid] {
        let mut worst = 0.0f32;
        for _ in 0..1000 {
            let (wo, wi) = (random.direction(), random.direction());
            let there = bsdf.eval(wo, wi).f_cos * wo.z.abs();
            let back = bsdf.eval(wi, wo).f_cos * wi.z.abs();
            worst = worst.max(length(there - back) / length(there).max(1e-6));
        }
        assert!(worst > 0.01, "{bsdf:?}");
    }
}
