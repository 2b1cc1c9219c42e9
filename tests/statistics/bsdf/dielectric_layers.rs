//! Dielectric layers of glTF materials: their reflectance against Fresnel's equations in double precision, and the energy left
//! for the layers below.

use super::albedo::albedo;
use super::furnace::assert_white_at;
use super::lobes::{Cases, coat, direction, film, number, pbr, resolved, resolved_with};
use oscura::bsdf::ShadingModel;
use oscura::math::DVec3;
use oscura::scene::{EnergyCompensation, FresnelModel, PbrMaterial};

/// Fresnel's equations for unpolarised light that arrives from outside, by the angles.
fn fresnel(cosine: f64, ior: f64) -> f64 {
    let outside = cosine.acos();
    let inside = (outside.sin() / ior).asin();
    if outside < 1e-6 {
        return ((ior - 1.0) / (ior + 1.0)).powi(2);
    }
    let s = (outside - inside).sin() / (outside + inside).sin();
    let p = (outside - inside).tan() / (outside + inside).tan();
    0.5 * (s * s + p * p)
}

/// Schlick's approximation.
fn schlick(cosine: f64, ior: f64) -> f64 {
    let normal = ((ior - 1.0) / (ior + 1.0)).powi(2);
    normal + (1.0 - normal) * (1.0 - cosine).powi(5)
}

/// Single-scattering reflectance of GGX at this cosine: an integral over light directions, as a sum over the half vectors'
/// slopes x = tan^2 / (tan^2 + alpha^2), on which normals are distributed uniformly, and their azimuth.
fn reflected(cosine: f64, alpha: f64, reflectance: impl Fn(f64) -> f64) -> f64 {
    let wo = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
    let excess = |v: DVec3| {
        let tangent = (1.0 - v.z * v.z) / (v.z * v.z);
        0.5 * ((1.0 + alpha * alpha * tangent).sqrt() - 1.0)
    };
    let (rows, columns) = (1000, 100);
    let mut sum = 0.0;
    for i in 0..rows {
        let x = (f64::from(i) + 0.5) / f64::from(rows);
        let tangent = alpha * (x / (1.0 - x)).sqrt();
        let z = 1.0 / (1.0 + tangent * tangent).sqrt();
        for k in 0..columns {
            let (sine, cosine) =
                (std::f64::consts::TAU * (f64::from(k) + 0.5) / f64::from(columns)).sin_cos();
            let half = DVec3::new(tangent * z * cosine, tangent * z * sine, z);
            let c = wo.dot(half);
            let wi = half * (2.0 * c) - wo;
            if c > 0.0 && wi.z > 0.0 {
                // F D G2 / (4 wo.z wi.z) wi.z, over the pdf D half.z / (4 c) of the directions.
                let masking = 1.0 / (1.0 + excess(wo) + excess(wi));
                sum += reflectance(c) * masking * c / (wo.z * z);
            }
        }
    }
    sum / f64::from(rows * columns)
}

const SINGLE: EnergyCompensation = EnergyCompensation::Off;

fn with(energy_compensation: EnergyCompensation, fresnel: FresnelModel) -> ShadingModel {
    ShadingModel { energy_compensation, fresnel, ..ShadingModel::default() }
}

/// A black base.
fn black(change: impl FnOnce(&mut PbrMaterial)) -> PbrMaterial {
    pbr(|p| {
        p.base_color.factor = [0.0; 3];
        change(p);
    })
}

/// Plastic of roughness 0.25 at 60 degrees agrees with Fresnel's equations; Schlick's approximation gives 79 % of it.
#[test]
fn plastic_at_60_degrees_agrees_with_fresnel() {
    let floor = || black(|p| p.roughness = number(0.25));
    let alpha = 0.25f64.powi(2);
    let mut found = [0.0; 2];
    for (k, model) in [FresnelModel::Exact, FresnelModel::Schlick].into_iter().enumerate() {
        let bsdf = resolved_with(floor(), with(SINGLE, model));
        found[k] = f64::from(albedo(&bsdf, direction(0.5, 0.2), 100_000).r);
        let expected = reflected(0.5, alpha, |c| match model {
            FresnelModel::Exact => fresnel(c, 1.5),
            FresnelModel::Schlick => schlick(c, 1.5),
        });
        println!("{model:?}: {} of the independent number {expected:.6}", found[k] / expected);
        assert!((found[k] / expected - 1.0).abs() < 1e-3, "{model:?}: {} {expected}", found[k]);
    }
    println!("Schlick over exact: {:.4}", found[1] / found[0]);
    assert!((0.75..0.83).contains(&(found[1] / found[0])), "{found:?}");
}

/// For various indices, roughnesses and angles.
#[test]
fn layers_agree_with_fresnel() {
    for ior in [1.05, 1.33, 1.5, 2.4, 3.0] {
        for roughness in [0.1, 0.4, 0.8] {
            for cosine in [0.95, 0.6, 0.25] {
                let bsdf = resolved_with(
                    black(|p| (p.ior, p.roughness) = (ior, number(roughness))),
                    with(SINGLE, FresnelModel::Exact),
                );
                let found = f64::from(albedo(&bsdf, direction(cosine, 0.2), 20_000).r);
                let expected =
                    reflected(cosine.into(), f64::from(roughness).powi(2), |c| fresnel(c, ior.into()));
                let error = (found - expected).abs();
                assert!(error < 2e-3 * expected + 2e-5, "{ior} {roughness} {cosine}: {found} {expected}");
            }
        }
    }
}

/// KHR_materials_specular: F0 is scaled by the colour, F90 by the factor; the curve interpolates.
#[test]
fn specular_scales_f0_and_f90() {
    let (factor, colors, ior) = (0.6f32, [2.0f32, 0.5, 0.0], 1.5f64);
    let material = black(|p| {
        (p.specular, p.roughness) = (number(factor), number(0.0));
        p.specular_color.factor = colors;
    });
    let bsdf = resolved(material);
    let normal = fresnel(1.0, ior);
    for cosine in [1.0f32, 0.8, 0.5, 0.2, 0.05] {
        let weight = (fresnel(cosine.into(), ior) - normal) / (1.0 - normal);
        let found = albedo(&bsdf, direction(cosine, 0.2), 16).to_array();
        for (channel, color) in found.into_iter().zip(colors) {
            let f0 = f64::from(color) * normal;
            let expected = f64::from(factor) * (f0 + (1.0 - f0) * weight);
            assert!((f64::from(channel) - expected).abs() < 1e-5, "{cosine}: {channel} {expected}");
        }
    }
}

/// An index of 0 reflects all light, 1 nothing.
#[test]
fn extreme_indices() {
    for cosine in [1.0, 0.5, 0.1] {
        let at = |ior: f32| {
            albedo(
                &resolved(black(|p| (p.ior, p.roughness) = (ior, number(0.0)))),
                direction(cosine, 0.2),
                16,
            )
            .r
        };
        assert!((at(0.0) - 1.0).abs() < 1e-6 && at(1.0) == 0.0, "{cosine}: {} {}", at(0.0), at(1.0));
    }
}

/// A white base below any layer reflects all light.
#[test]
fn white_furnace_of_plastic_is_one() {
    check_white_furnace_of_plastic(&Cases::each(13));
}

#[test]
#[ignore = "5 seconds"]
fn white_furnace_of_plastic_is_one_in_all_cases() {
    check_white_furnace_of_plastic(&Cases::all());
}

fn check_white_furnace_of_plastic(cases: &Cases) {
    for ior in [0.0, 1.0, 1.02, 1.1, 1.33, 1.5, 2.0, 2.6, 3.0, 4.0, 10.0] {
        for roughness in [0.0, 0.1, 0.25, 0.4, 0.6, 0.8, 1.0] {
            let bsdf = resolved(pbr(|p| (p.ior, p.roughness) = (ior, number(roughness))));
            let name = format!("ior {ior}, roughness {roughness}");
            assert_white_at(&[1.0, 0.8, 0.5, 0.3, 0.1, 0.03], 40_000, &name, &bsdf, cases);
        }
    }
}

/// Without compensation it loses only the energy of multiple scattering: the same fraction of the reflected light that metal
/// with these microfacets would lose.
#[test]
fn furnace_of_single_scattering() {
    check_single_scattering(&Cases::each(7));
}

#[test]
#[ignore = "7 seconds"]
fn furnace_of_single_scattering_in_all_cases() {
    check_single_scattering(&Cases::all());
}

fn check_single_scattering(cases: &Cases) {
    for ior in [1.02f32, 1.1, 1.33, 1.5, 2.0, 3.0] {
        for roughness in [0.1f32, 0.25, 0.4, 0.6, 0.8, 1.0] {
            let alpha = f64::from(roughness).powi(2);
            for coated in [false, true] {
                if coated && ior != 1.5 {
                    continue;
                }
                let material = pbr(|p| match coated {
                    true => (p.specular, p.clearcoat) = (number(0.0), coat(1.0, roughness)),
                    false => (p.ior, p.roughness) = (ior, number(roughness)),
                });
                let bsdf = resolved_with(material, with(SINGLE, FresnelModel::Exact));
                for cosine in [1.0f32, 0.8, 0.5, 0.3, 0.1].into_iter().filter(|_| cases.takes()) {
                    let [layer, metal] = [Some(f64::from(ior)), None]
                        .map(|n| reflected(cosine.into(), alpha, |c| n.map_or(1.0, |n| fresnel(c, n))));
                    let expected = 1.0 - layer * (1.0 / metal - 1.0);
                    let found = f64::from(albedo(&bsdf, direction(cosine, 0.2), 40_000).r);
                    assert!(
                        (found - expected).abs() < 5e-3,
                        "{ior} {roughness} {cosine} {coated}: {found} {expected}"
                    );
                }
            }
        }
    }
}

/// With Schlick's approximation selected, smooth reflection follows its formula.
#[test]
fn schlick_option_agrees_with_schlick() {
    let model = with(EnergyCompensation::On, FresnelModel::Schlick);
    for ior in [1.0f32, 1.33, 1.5, 2.4] {
        for cosine in [1.0f32, 0.7, 0.5, 0.2, 0.05] {
            let expected = schlick(cosine.into(), ior.into());
            let layer = black(|p| (p.ior, p.roughness) = (ior, number(0.0)));
            let coated = black(|p| (p.specular, p.clearcoat) = (number(0.0), coat(1.0, 0.0)));
            let layer = albedo(&resolved_with(layer, model), direction(cosine, 0.2), 16).r;
            let coated = albedo(&resolved_with(coated, model), direction(cosine, 0.2), 16).r;
            assert!((f64::from(layer) - expected).abs() < 1e-6, "{ior} {cosine}: {layer} {expected}");
            let expected = schlick(cosine.into(), 1.5);
            assert!((f64::from(coated) - expected).abs() < 1e-6, "{cosine}: {coated} {expected}");
        }
    }
}

/// A clearcoat has an index of 1.5, independent of the base; rough ones agree with the microfacet integral.
#[test]
fn clearcoat_at_60_degrees() {
    for (roughness, tolerance) in [(0.0f32, 1e-6), (0.25, 1e-4), (0.7, 1e-4)] {
        let material = black(|p| {
            (p.specular, p.ior) = (number(0.0), 2.0);
            p.clearcoat = coat(1.0, roughness);
        });
        let bsdf = resolved_with(material, with(SINGLE, FresnelModel::Exact));
        let found = f64::from(albedo(&bsdf, direction(0.5, 0.2), 40_000).r);
        let expected = match roughness > 0.0 {
            true => reflected(0.5, f64::from(roughness).powi(2), |c| fresnel(c, 1.5)),
            false => fresnel(0.5, 1.5),
        };
        assert!((found - expected).abs() < tolerance, "{roughness}: {found} {expected}");
    }
}

/// A film of zero thickness shows the plastic below, one far beyond the coherence length the incoherent sum of all inter-
/// reflections.
#[test]
fn iridescence_at_60_degrees() {
    let film_ior = 1.33f64;
    // Into the film, then onto the plastic at the refracted angle.
    let inside = (1.0 - 0.75 / film_ior.powi(2)).sqrt();
    let (top, bottom) = (fresnel(0.5, film_ior), fresnel(inside, 1.5 / film_ior));
    let thick = top + (1.0 - top).powi(2) * bottom / (1.0 - top * bottom);
    for (thickness, expected) in [(0.0, fresnel(0.5, 1.5)), (100_000.0, thick)] {
        let filmed =
            black(|p| (p.roughness, p.iridescence) = (number(0.0), film(film_ior as f32, thickness)));
        let found = albedo(&resolved(filmed), direction(0.5, 0.2), 16);
        for channel in found.to_array() {
            let error = (f64::from(channel) - expected).abs();
            assert!(error < 2e-4, "{thickness} nm: {found:?} {expected}");
        }
    }
}
