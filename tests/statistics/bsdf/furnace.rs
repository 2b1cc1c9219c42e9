//! White furnace tests: energy conservation of white materials.

use super::albedo::{COSINES, ROUGHNESSES, albedo, assert_no_gain};
use super::lobes::{
    Cases, anisotropy, coat, colored, direction, glass, length, number, pbr, resolved, resolved_with, sheen,
    through,
};
use oscura::bsdf::{Bsdf, Dielectric, Lobe, OrenNayar, Phong, Refraction, SchlickMetal, ThinDielectric};
use oscura::color::Rgb;
use oscura::math::Vec3;
use oscura::sampling::chi2::Random;
use oscura::scene::{
    ColorSlot, EnergyCompensation, FresnelModel, GlassReflection, PbrMaterial, ShadingModel,
};

#[test]
fn white_furnace_of_metal_is_one() {
    for roughness in [0.0f32, 0.05, 0.2, 0.37, 0.5, 0.63, 0.8, 0.95, 1.0] {
        for cosine in [1.0f32, 0.93, 0.71, 0.5, 0.33, 0.2, 0.1, 0.05] {
            let bsdf = Bsdf::SchlickMetal(SchlickMetal {
                f0: Rgb::ONE,
                alpha: roughness * roughness,
                energy_compensation: EnergyCompensation::On,
            });
            let a = albedo(&bsdf, direction(cosine, 0.2), 40_000);
            assert!((a.r - 1.0).abs() < 5e-3, "roughness {roughness}, cos {cosine}: {a}");
        }
    }
}

/// At alpha 1 the distribution of normals is constant and the albedo has the closed form 1 - c ln((1 + c) / c) for the view
/// cosine c: single scattering loses up to 69 %.
#[test]
fn single_scattering_loses_energy_with_roughness() {
    let at = |alpha: f32, cosine: f32| {
        let bsdf = Bsdf::SchlickMetal(SchlickMetal {
            f0: Rgb::ONE,
            alpha,
            energy_compensation: EnergyCompensation::Off,
        });
        albedo(&bsdf, direction(cosine, 0.0), 40_000).r
    };
    for cosine in [1.0f32, 0.6, 0.3, 0.1] {
        let exact = 1.0 - cosine * ((1.0 + cosine) / cosine).ln();
        let found = at(1.0, cosine);
        assert!((found - exact).abs() < 2e-3, "{cosine}: {found} {exact}");
    }
    assert!(at(0.01, 0.8) > 0.999);
    assert!(at(0.25, 0.7) > at(0.5, 0.7) && at(0.5, 0.7) > at(1.0, 0.7));
}

#[test]
fn albedos_are_at_most_one() {
    let white = |roughness: f32, metallic: f32, transmission: f32, volume: bool| {
        resolved(pbr(|p| {
            (p.roughness, p.metallic) = (number(roughness), number(metallic));
            (p.transmission, p.has_volume) = (number(transmission), volume);
        }))
    };
    for roughness in [0.0, 0.1, 0.5, 1.0] {
        for metallic in [0.0, 0.5, 1.0] {
            for (transmission, volume) in [(0.0, false), (0.7, false), (0.7, true), (1.0, true)] {
                for cosine in [1.0, 0.5, 0.1, -0.3] {
                    let bsdf = white(roughness, metallic, transmission, volume);
                    let a = albedo(&bsdf, direction(cosine, 1.0), 40_000);
                    let what = format!("{roughness} {metallic} {transmission} {volume} {cosine}: {a}");
                    assert!((a.r - 1.0).abs() < 5e-3, "{what}");
                }
            }
        }
    }
}

#[test]
fn glass_agrees_with_fresnel_and_conserves_energy() {
    for fresnel in [FresnelModel::Exact, FresnelModel::Schlick] {
        let glass = Bsdf::Dielectric(Dielectric {
            ior: 1.5,
            refraction: Refraction::Scales,
            tint: Rgb::ONE,
            fresnel,
            is_beckmann: false,
        });
        for cosine in [1.0f32, 0.6, 0.1, -0.9, -0.5, -0.05] {
            let wo = direction(cosine, 0.4);
            assert!((albedo(&glass, wo, 10_000).r - 1.0).abs() < 1e-4);
        }
    }
    let of = |refraction| Dielectric {
        ior: 1.5,
        refraction,
        tint: Rgb::ONE,
        fresnel: FresnelModel::Exact,
        is_beckmann: false,
    };
    let glass = of(Refraction::Scales);
    let straight = glass.sample(Vec3::Z, [0.5, 0.5, 0.039]);
    assert!(!straight.is_transmission && (straight.pdf_solid_angle - 0.04).abs() < 1e-6);
    // Snell: sin 0.6 becomes 0.4 inside; radiance is scaled by 1 / eta^2, which the exit undoes.
    let wo = Vec3::new(0.6, 0.0, 0.8);
    let inward = glass.sample(wo, [0.5, 0.5, 0.9]);
    assert!((inward.wi.x + 0.4).abs() < 1e-6 && inward.wi.z < 0.0 && inward.is_transmission);
    assert!((inward.weight.r - 1.0 / 2.25).abs() < 1e-6 && inward.eta == 1.5);
    let outward = glass.sample(inward.wi, [0.5, 0.5, 0.9]);
    assert!((outward.wi - wo).length() < 1e-5, "{outward:?}");
    assert!((inward.weight.r * outward.weight.r - 1.0).abs() < 1e-5);
    // Glass that keeps radiance scales flux.
    let kept = of(Refraction::KeepsRadiance).sample(wo, [0.5, 0.5, 0.9]);
    assert_eq!((kept.wi, kept.weight, kept.eta), (inward.wi, Rgb::ONE, 1.0));
    assert!((inward.weight.r * inward.flux - 1.0).abs() < 1e-6 && (kept.flux - 1.0 / 2.25).abs() < 1e-6);
    // Total internal reflection beyond the critical angle.
    let total = glass.sample(direction(-0.3, 0.0), [0.5, 0.5, 0.999]);
    assert!(!total.is_transmission && total.pdf_solid_angle == 1.0);
    // Thin glass at normal incidence: 2 R / (1 + R).
    let sheet = ThinDielectric { ior: 1.5, tint: Rgb::ONE };
    assert!((sheet.reflectance(1.0) - 0.08 / 1.04).abs() < 1e-6);
    assert_eq!(sheet.sample(wo, [0.5, 0.5, 0.9]).wi, -wo);
}

/// Asserts an albedo of 1 within 0.5 % (the lattice's own error is below 0.1 %).
fn assert_white(name: &str, bsdf: &Bsdf) {
    assert_white_at(&COSINES, 40_000, name, bsdf, &Cases::all());
}

pub fn assert_white_at(cosines: &[f32], samples: u32, name: &str, bsdf: &Bsdf, cases: &Cases) {
    for &cosine in cosines.iter().filter(|_| cases.takes()) {
        let a = albedo(bsdf, direction(cosine, 0.6), samples);
        assert!((a.r - 1.0).abs() < 5e-3, "{name}, cos {cosine}: {a}");
    }
}

#[test]
fn white_furnace_of_thin_glass_is_one() {
    for ior in [1.0, 1.001, 1.1, 1.33, 1.5, 2.4, 3.0] {
        for roughness in ROUGHNESSES {
            let bsdf = glass(ior, roughness, true, [1.0; 3], EnergyCompensation::On);
            assert_white(&format!("thin glass {ior} {roughness}"), &bsdf);
        }
    }
}

/// Solids of any index with isotropic or anisotropic roughness: each sample has weight 1, up to rounding.
#[test]
fn white_furnace_of_solid_glass_is_one() {
    let mut random = Random::new(7);
    for ior in [0.2, 0.75, 0.999, 1.0, 1.001, 1.01, 1.05, 1.1, 1.2, 1.33, 1.5, 2.4, 3.0, 9.0, 100.0] {
        for roughness in ROUGHNESSES {
            for strength in [0.0, 0.5, 1.0] {
                let bsdf = resolved(pbr(|p| {
                    (p.roughness, p.anisotropy, p.ior) = (number(roughness), anisotropy(strength), ior);
                    (p.transmission, p.has_volume) = (number(1.0), true);
                }));
                let name = format!("glass {ior} {roughness}, anisotropy {strength}");
                let mut absorbed = 0;
                for cosine in [1.0, 0.7, 0.3, 0.1, 1e-3, -0.98, -0.9, -0.5, -0.05, -1e-3] {
                    for _ in 0..500 {
                        let u = [random.next(), random.next(), random.next()];
                        let s = bsdf.sample(direction(cosine, 0.6), u);
                        let weight = s.weight * (s.eta * s.eta);
                        absorbed += u32::from(s.pdf_solid_angle == 0.0);
                        let is_one = length(weight - Rgb::ONE) < 2e-3;
                        assert!(is_one || s.pdf_solid_angle == 0.0, "{name}, cos {cosine}: {u:?} {s:?}");
                    }
                }
                // Close to index 1 rounding may lose a facet that faces up.
                assert!(absorbed <= u32::from((ior - 1.0).abs() < 0.01), "{name}: {absorbed} absorbed");
            }
        }
    }
}

/// Light transmitted by black glass is black, for any microfacets.
#[test]
fn black_glass_transmits_nothing() {
    let mut random = Random::new(8);
    for energy_compensation in [EnergyCompensation::Off, EnergyCompensation::On] {
        for (ior, roughness) in [(1.5, 0.6), (1.33, 1.0), (2.4, 0.9)] {
            let bsdf = glass(ior, roughness, false, [0.0, 0.0, 1.0], energy_compensation);
            for _ in 0..20_000 {
                let (wo, wi) = (random.direction(), random.direction());
                let f = bsdf.eval(wo, wi).f_cos;
                let crosses = wo.z * wi.z < 0.0;
                assert!(!crosses || (f.r == 0.0 && f.g == 0.0), "{ior} {roughness}: {wo} {wi} {f}");
            }
        }
    }
}

/// A reflection tint doesn't change the pdf: all light is that of white glass, times the tint. Without reflection all light is
/// refracted, where white glass has no total internal reflection.
#[test]
fn reflection_tints_keep_the_pdf() {
    let shading = ShadingModel { energy_compensation: EnergyCompensation::Off, ..ShadingModel::default() };
    let of = |reflection, roughness, volume, color| {
        let material = colored(reflection, roughness, volume);
        resolved_with(PbrMaterial { base_color: ColorSlot::constant(color), ..material }, shading)
    };
    let color = Rgb::new(0.9, 0.5, 0.1);
    let mut random = Random::new(9);
    for (roughness, volume) in [(0.0, true), (0.0, false), (0.5, true), (0.5, false)] {
        let white = of(GlassReflection::White, roughness, volume, [1.0; 3]);
        let tinted = of(GlassReflection::Tinted, roughness, volume, color.to_array());
        let grey = of(GlassReflection::Tinted, roughness, volume, [0.5; 3]);
        let clear = of(GlassReflection::None, roughness, volume, color.to_array());
        for _ in 0..5000 {
            let (wo, wi) = (random.direction(), random.direction());
            let what = format!("{roughness} {volume}: {wo} {wi}");
            let f = white.eval(wo, wi).f_cos;
            assert!(length(tinted.eval(wo, wi).f_cos - f * color) < 1e-5 * (1.0 + length(f)), "{what}");
            let alone = clear.eval(wo, wi);
            let mirrors = (wo.z < 0.0) == (wi.z < 0.0);
            assert!(!mirrors || (alone.f_cos == Rgb::ZERO && alone.pdf_solid_angle == 0.0), "{what}");
            let least = f * color * if mirrors { 0.0 } else { 1.0 };
            assert!(alone.f_cos.r >= least.r * 0.999 && alone.f_cos.b >= least.b * 0.999, "{what}");
            let u = [random.next(), random.next(), random.next()];
            let (a, b) = (white.sample(wo, u), grey.sample(wo, u));
            assert!((a.wi - b.wi).length() < 1e-4, "{what}: {a:?} {b:?}");
            assert!(length(a.weight * 0.5 - b.weight) < 1e-4, "{what}: {a:?} {b:?}");
            let s = clear.sample(wo, u);
            let total = volume && 1.0 - wo.z * wo.z > 1.0 / 2.25 && wo.z < 0.0;
            if roughness == 0.0 {
                assert_eq!(s.pdf_solid_angle, if total { 0.0 } else { 1.0 }, "{what}");
                let weight = s.weight * (s.eta * s.eta);
                assert!(total || length(weight - color) < 1e-5 && s.is_transmission, "{what}: {s:?}");
            }
        }
    }
}

#[test]
fn white_furnace_of_glass_with_changed_reflectance_is_one() {
    check_white_furnace_of_glass_with_changed_reflectance(&Cases::each(7));
}

#[test]
#[ignore = "11 seconds"]
fn white_furnace_of_glass_with_changed_reflectance_is_one_in_all_cases() {
    check_white_furnace_of_glass_with_changed_reflectance(&Cases::all());
}

/// Whatever fraction a facet reflects, it transmits the rest: grey factors conserve energy, coloured ones that of the brightest
/// channel.
fn check_white_furnace_of_glass_with_changed_reflectance(cases: &Cases) {
    let mut all = Vec::new();
    for ior in [1.05, 1.5, 2.6] {
        for roughness in [0.1, 0.4, 1.0] {
            for (specular, color) in
                [(0.0, [1.0; 3]), (0.5, [1.0; 3]), (1.0, [4.0; 3]), (1.0, [1.0, 0.5, 0.0]), (0.7, [0.0; 3])]
            {
                let bsdf = resolved(pbr(|p| {
                    (p.roughness, p.ior, p.specular) = (number(roughness), ior, number(specular));
                    (p.transmission, p.has_volume) = (number(1.0), true);
                    p.specular_color.factor = color;
                }));
                let name = format!("glass {ior} {roughness}, specular {specular} {color:?}");
                for cosine in [1.0, 0.5, 0.1, -0.9, -0.3].into_iter().filter(|_| cases.takes()) {
                    let a = albedo(&bsdf, direction(cosine, 0.6), 40_000);
                    assert!((a.r - 1.0).abs() < 1e-3, "{name}, cos {cosine}: {a}");
                    assert!(a.g <= a.r && a.b <= a.g, "{name}, cos {cosine}: {a}");
                }
                all.push((name, bsdf));
            }
        }
    }
    assert_no_gain(&all, &[0.7, 0.03, -0.1, -0.7], cases);
}

#[test]
fn white_furnace_of_rough_diffuse_is_one() {
    for roughness in ROUGHNESSES {
        let bsdf = Bsdf::OrenNayar(OrenNayar { color: Rgb::ONE, roughness });
        assert_white(&format!("oren-nayar {roughness}"), &bsdf);
    }
}

/// Rough diffuse reflection below an interface and layers conserves energy; without an interface it is the Oren-Nayar model,
/// also with all lobes of a foliage material without transmission.
#[test]
fn rough_diffuse_bases_conserve_energy_and_agree_with_the_model() {
    for roughness in [0.1, 0.5, 1.0] {
        for (specular, facets) in [(1.0, 0.0), (1.0, 0.3), (1.0, 1.0), (0.0, 0.5)] {
            let base = pbr(|p| {
                (p.diffuse_roughness, p.roughness) = (number(roughness), number(facets));
                p.specular = number(specular);
            });
            assert_white(&format!("rough {roughness}, specular {specular} {facets}"), &resolved(base));
            let fibres = pbr(|p| {
                (p.diffuse_roughness, p.roughness) = (number(roughness), number(facets));
                (p.sheen, p.clearcoat) = (sheen([0.5; 3], 0.4), coat(0.5, 0.2));
            });
            assert_white(&format!("layers on rough {roughness}, {facets}"), &resolved(fibres));
        }
        let color = Rgb::new(0.8, 0.5, 0.1);
        let own = Bsdf::OrenNayar(OrenNayar { color, roughness });
        let bare = |p: &mut PbrMaterial| {
            p.base_color.factor = color.to_array();
            (p.diffuse_roughness, p.specular) = (number(roughness), number(0.0));
        };
        let plain = resolved(pbr(bare));
        assert!(matches!(plain, Bsdf::OrenNayar(_)), "{plain:?}");
        let layered = resolved(pbr(|p| {
            bare(p);
            p.sheen = sheen([1e-9; 3], 0.5);
        }));
        assert!(matches!(layered, Bsdf::Layered(_)), "{layered:?}");
        let mut random = Random::new(11);
        for _ in 0..2000 {
            let (wo, wi) = (random.direction(), random.direction());
            let (a, b) = (own.eval(wo, wi), layered.eval(wo, wi));
            assert!(length(a.f_cos - b.f_cos) < 1e-5, "{roughness}: {wo} {wi} {a:?} {b:?}");
            assert!((a.pdf_solid_angle - b.pdf_solid_angle).abs() < 1e-5, "{roughness}: {wo} {wi}");
            assert!(length(layered.diffuse_part(wo, wi) - b.f_cos) < 1e-5);
        }
    }
}

#[test]
fn white_furnace_of_anisotropic_facets_is_one() {
    check_white_furnace_of_anisotropic_facets(&Cases::each(11));
}

#[test]
#[ignore = "20 seconds"]
fn white_furnace_of_anisotropic_facets_is_one_in_all_cases() {
    check_white_furnace_of_anisotropic_facets(&Cases::all());
}

/// Metal, and a white base below an interface, with anisotropic roughness.
fn check_white_furnace_of_anisotropic_facets(cases: &Cases) {
    for roughness in [0.05, 0.1, 0.3, 0.5, 0.75, 1.0] {
        for strength in [0.05, 0.2, 0.5, 1.0] {
            for (metallic, ior) in [(1.0, 1.5), (0.0, 1.5), (0.0, 1.05), (0.0, 3.0)] {
                let bsdf = resolved(pbr(|p| {
                    (p.roughness, p.anisotropy, p.ior) = (number(roughness), anisotropy(strength), ior);
                    p.metallic = number(metallic);
                }));
                let name = format!("roughness {roughness}, anisotropy {strength}, {metallic} {ior}");
                assert_white_at(&[1.0, 0.9, 0.7, 0.5, 0.3, 0.1, 0.03], 40_000, &name, &bsdf, cases);
            }
        }
    }
}

#[test]
fn white_furnace_of_layers_is_one() {
    check_white_furnace_of_layers(&Cases::each(11));
}

#[test]
#[ignore = "5 seconds"]
fn white_furnace_of_layers_is_one_in_all_cases() {
    check_white_furnace_of_layers(&Cases::all());
}

fn check_white_furnace_of_layers(cases: &Cases) {
    for roughness in ROUGHNESSES {
        for base in ROUGHNESSES {
            let coated = pbr(|p| (p.clearcoat, p.roughness) = (coat(1.0, roughness), number(base)));
            assert_white_at(
                &COSINES,
                40_000,
                &format!("coat {roughness} over {base}"),
                &resolved(coated),
                cases,
            );
        }
        let fibres = pbr(|p| (p.sheen, p.roughness) = (sheen([1.0; 3], roughness), number(0.5)));
        assert_white_at(&COSINES, 40_000, &format!("white sheen {roughness}"), &resolved(fibres), cases);
        let metal = pbr(|p| {
            (p.clearcoat, p.metallic, p.roughness) = (coat(0.5, roughness), number(1.0), number(0.4));
        });
        assert_white_at(&COSINES, 40_000, &format!("coat {roughness} over metal"), &resolved(metal), cases);
        let leaf =
            pbr(|p| (p.diffuse_transmission, p.roughness) = (through(0.4, [1.0; 3]), number(roughness)));
        assert_white_at(&COSINES, 40_000, &format!("leaf {roughness}"), &resolved(leaf), cases);
    }
}

/// Phong: at normal incidence all but the part of the lobe below the horizon; no energy gain at any angle.
#[test]
fn phong_gains_no_energy() {
    for exponent in [0.0, 1.0, 10.0, 100.0, 1000.0] {
        let bsdf = Bsdf::Phong(Phong::new(Rgb::ZERO, Rgb::ONE, exponent));
        for cosine in COSINES {
            let a = albedo(&bsdf, direction(cosine, 0.0), 40_000);
            assert!(a.r < 1.0 + 1e-3, "{exponent} {cosine}: {a}");
        }
        // (n + 2) / (n + 2) for the mirror direction along the normal.
        let top = albedo(&bsdf, direction(1.0, 0.0), 40_000).r;
        assert!((top - 1.0).abs() < 2e-3, "{exponent}: {top}");
    }
}

/// Sheen on a black base reflects its colour times the albedo table, which increases towards grazing incidence.
#[test]
fn sheen_on_black_is_its_albedo() {
    for roughness in [0.2, 0.5, 1.0] {
        let material = pbr(|p| {
            (p.sheen, p.specular) = (sheen([1.0; 3], roughness), number(0.0));
            p.base_color.factor = [0.0; 3];
        });
        let bsdf = resolved(material);
        let at = |cosine: f32| albedo(&bsdf, direction(cosine, 0.3), 40_000).r;
        let table = oscura::bsdf::Sheen { color: Rgb::ONE, roughness };
        for cosine in COSINES {
            assert!((at(cosine) - table.albedo(cosine.abs())).abs() < 2e-3, "{roughness} {cosine}");
        }
        assert!(at(0.1) > at(0.9) && at(0.1) < 1.0);
    }
}

/// From inside a solid the layers outside have no effect: glass alone, without energy loss.
#[test]
fn layers_do_not_affect_the_inside_of_solids() {
    let material = pbr(|p| {
        (p.clearcoat, p.sheen) = (coat(1.0, 0.3), sheen([1.0; 3], 0.5));
        (p.transmission, p.roughness, p.has_volume) = (number(1.0), number(0.4), true);
    });
    assert_white("coated glass", &resolved(material));
}
