//! Every lobe: samples follow the density, weights are value over density, energy is kept, nothing is NaN.

use oscura::bsdf::{
    Bsdf, Conductor, Dielectric, Factors, Lambert, MetalRough, ThinDielectric, Transmission, resolve,
};
use oscura::math::Vec3;
use oscura::sampling::chi2::{Chi2, Random, Square};
use oscura::scene::{FloatSlot, FresnelModel, Microfacet, Model, PbrMaterial};

fn conductor(alpha: f32, microfacet: Microfacet) -> Bsdf {
    Bsdf::Conductor(Conductor { f0: Vec3::new(0.9, 0.7, 0.4), alpha, microfacet })
}

fn pbr(roughness: f32, metallic: f32, transmission: f32, has_volume: bool) -> Bsdf {
    let mut p = PbrMaterial { has_volume, ..PbrMaterial::default() };
    p.base_color.factor = [0.8, 0.5, 0.2];
    p.roughness = FloatSlot::constant(roughness);
    p.metallic = FloatSlot::constant(metallic);
    p.transmission = FloatSlot::constant(transmission);
    resolve(&Model::Pbr(Box::new(p)), &Factors, Microfacet::Multi)
}

fn direction(cosine: f32, azimuth: f32) -> Vec3 {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    Vec3::new(sine * azimuth.cos(), sine * azimuth.sin(), cosine).normalize()
}

/// Lobes with a finite width.
fn finite() -> Vec<(String, Bsdf)> {
    let mut all = vec![("lambert".to_string(), Bsdf::Lambert(Lambert { albedo: Vec3::splat(0.5) }))];
    for alpha in [0.05, 0.15, 0.4, 1.0] {
        all.push((format!("conductor {alpha}"), conductor(alpha, Microfacet::Multi)));
        all.push((format!("pbr {alpha}"), pbr(alpha.sqrt(), 0.3, 0.0, false)));
    }
    all.push(("plastic".into(), pbr(0.5, 0.0, 0.0, false)));
    all.push(("half transmissive".into(), pbr(0.6, 0.0, 0.5, true)));
    all.push(("coated diffuse".into(), pbr(0.0, 0.0, 0.0, false)));
    all
}

/// Normal to grazing, above and below.
const COSINES: [f32; 7] = [1.0, 0.8, 0.3, 0.05, 0.002, -0.6, -0.02];

#[test]
fn samples_follow_the_density() {
    let lobes = finite();
    let tests = lobes.len() * COSINES.len();
    for (name, bsdf) in &lobes {
        for cosine in COSINES {
            let wo = direction(cosine, 0.7);
            Chi2::new(&format!("{name} from {cosine}"), tests)
                .cells(32, 32)
                .samples(100_000)
                .assert_directions(
                    &Square::sphere(),
                    |u| {
                        let s = bsdf.sample(wo, u);
                        (s.pdf_solid_angle > 0.0 && !s.is_specular).then_some(s.wi)
                    },
                    |wi| bsdf.eval(wo, wi).pdf_solid_angle,
                );
        }
    }
}

/// A lobe of alpha 0.003, seen through a cap around the mirror direction.
#[test]
fn sharp_lobes_follow_the_density() {
    for cosine in [1.0f32, 0.4] {
        let wo = direction(cosine, -1.0);
        let bsdf = conductor(0.003, Microfacet::Single);
        let mirror = Vec3::new(-wo.x, -wo.y, wo.z);
        Chi2::new("sharp conductor", 2).assert_directions(
            &Square::cap(mirror, 5e-4),
            |u| Some(bsdf.sample(wo, u).wi),
            |wi| bsdf.eval(wo, wi).pdf_solid_angle,
        );
    }
}

#[test]
fn weights_are_value_over_density() {
    let mut random = Random::new(1);
    for (name, bsdf) in finite() {
        for _ in 0..20_000 {
            let wo = random.direction();
            let s = bsdf.sample(wo, [random.next(), random.next(), random.next()]);
            if s.pdf_solid_angle == 0.0 || s.is_specular {
                continue;
            }
            let e = bsdf.eval(wo, s.wi);
            assert!((e.pdf_solid_angle / s.pdf_solid_angle - 1.0).abs() < 2e-2, "{name} {wo} {s:?} {e:?}");
            let weight = e.f_cos / e.pdf_solid_angle;
            assert!(
                (weight - s.weight).length() <= 1e-3 * s.weight.length() + 1e-5,
                "{name} {wo} {s:?} {e:?}"
            );
        }
    }
}

#[test]
fn single_scattering_and_diffuse_are_reciprocal() {
    let mut random = Random::new(2);
    for alpha in [0.1, 0.5, 1.0] {
        let lobes = [conductor(alpha, Microfacet::Single), Bsdf::Lambert(Lambert { albedo: Vec3::ONE })];
        for bsdf in lobes {
            for _ in 0..10_000 {
                let (wo, wi) = (random.direction(), random.direction());
                let there = bsdf.eval(wo, wi).f_cos * wo.z.abs();
                let back = bsdf.eval(wi, wo).f_cos * wi.z.abs();
                assert!((there - back).length() <= 1e-4 * there.length() + 1e-9, "{wo} {wi} {there} {back}");
            }
        }
    }
}

/// Mean weight: the share of light returned.
fn albedo(bsdf: &Bsdf, wo: Vec3, n: u32) -> Vec3 {
    let mut sum = [0.0f64; 3];
    for i in 0..n {
        // A lattice of rank 1 in three dimensions (Roberts 2018).
        let u = [0.819_172_513_396_164_5, 0.671_043_606_703_789_2, 0.549_700_477_901_97f64]
            .map(|a| ((f64::from(i) + 0.5) * a).fract() as f32);
        let s = bsdf.sample(wo, u.map(|x| x.min(1.0f32.next_down())));
        let undo = s.eta * s.eta;
        for (total, w) in sum.iter_mut().zip((s.weight * undo).to_array()) {
            *total += f64::from(w);
        }
    }
    Vec3::from_array(sum.map(|x| (x / f64::from(n)) as f32))
}

#[test]
fn white_furnace_of_metal_is_one() {
    for roughness in [0.0f32, 0.05, 0.2, 0.37, 0.5, 0.63, 0.8, 0.95, 1.0] {
        for cosine in [1.0f32, 0.93, 0.71, 0.5, 0.33, 0.2, 0.1, 0.05] {
            let bsdf = Bsdf::Conductor(Conductor {
                f0: Vec3::ONE,
                alpha: roughness * roughness,
                microfacet: Microfacet::Multi,
            });
            let a = albedo(&bsdf, direction(cosine, 0.2), 40_000);
            assert!((a.x - 1.0).abs() < 5e-3, "roughness {roughness}, cos {cosine}: {a}");
        }
    }
}

/// At alpha 1 the distribution of normals is constant and the albedo has the closed form 1 - c ln((1 + c) / c) for the
/// view cosine c: single scattering loses up to 69 %.
#[test]
fn single_scattering_loses_energy_with_roughness() {
    let at = |alpha: f32, cosine: f32| {
        let bsdf = Bsdf::Conductor(Conductor { f0: Vec3::ONE, alpha, microfacet: Microfacet::Single });
        albedo(&bsdf, direction(cosine, 0.0), 40_000).x
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
fn nothing_returns_more_than_arrives() {
    let white = |roughness: f32, metallic: f32, transmission: f32, volume: bool| {
        let p = PbrMaterial {
            roughness: FloatSlot::constant(roughness),
            metallic: FloatSlot::constant(metallic),
            transmission: FloatSlot::constant(transmission),
            has_volume: volume,
            ..PbrMaterial::default()
        };
        resolve(&Model::Pbr(Box::new(p)), &Factors, Microfacet::Multi)
    };
    for roughness in [0.0, 0.1, 0.5, 1.0] {
        for metallic in [0.0, 0.5, 1.0] {
            for (transmission, volume) in [(0.0, false), (0.7, false), (0.7, true), (1.0, true)] {
                for cosine in [1.0, 0.5, 0.1, -0.3] {
                    let bsdf = white(roughness, metallic, transmission, volume);
                    let a = albedo(&bsdf, direction(cosine, 1.0), 40_000);
                    let what = format!("{roughness} {metallic} {transmission} {volume} {cosine}: {a}");
                    assert!(a.x < 1.005, "{what}");
                    // White and energy-keeping: hardly less, either.
                    assert!(a.x > 0.99, "{what}");
                }
            }
        }
    }
}

#[test]
fn glass_splits_light_as_fresnel_says_and_keeps_all_of_it() {
    for fresnel in [FresnelModel::Exact, FresnelModel::Schlick] {
        let glass = Bsdf::Dielectric(Dielectric { ior: 1.5, tint: Vec3::ONE, fresnel });
        for cosine in [1.0f32, 0.6, 0.1, -0.9, -0.5, -0.05] {
            let wo = direction(cosine, 0.4);
            assert!((albedo(&glass, wo, 10_000).x - 1.0).abs() < 1e-4);
        }
    }
    let glass = Dielectric { ior: 1.5, tint: Vec3::ONE, fresnel: FresnelModel::Exact };
    let straight = glass.sample(Vec3::Z, [0.5, 0.5, 0.039]);
    assert!(!straight.is_transmission && (straight.pdf_solid_angle - 0.04).abs() < 1e-6);
    // Snell: sin 0.6 becomes 0.4 inside; radiance shrinks by 1 / eta^2, and the way back undoes it.
    let wo = Vec3::new(0.6, 0.0, 0.8);
    let inward = glass.sample(wo, [0.5, 0.5, 0.9]);
    assert!((inward.wi.x + 0.4).abs() < 1e-6 && inward.wi.z < 0.0 && inward.is_transmission);
    assert!((inward.weight.x - 1.0 / 2.25).abs() < 1e-6 && inward.eta == 1.5);
    let outward = glass.sample(inward.wi, [0.5, 0.5, 0.9]);
    assert!((outward.wi - wo).length() < 1e-5, "{outward:?}");
    assert!((inward.weight.x * outward.weight.x - 1.0).abs() < 1e-5);
    // Beyond the critical angle everything is reflected.
    let total = glass.sample(direction(-0.3, 0.0), [0.5, 0.5, 0.999]);
    assert!(!total.is_transmission && total.pdf_solid_angle == 1.0);
    // A sheet of glass at normal incidence: 2 R / (1 + R).
    let sheet = ThinDielectric { ior: 1.5, tint: Vec3::ONE };
    assert!((sheet.reflectance(1.0) - 0.08 / 1.04).abs() < 1e-6);
    assert_eq!(sheet.sample(wo, [0.5, 0.5, 0.9]).wi, -wo);
}

#[test]
fn a_million_draws_with_extremes_give_numbers() {
    let mut lobes = finite();
    for alpha in [0.0, 9.9e-4, 1e-3, 1.01e-3] {
        lobes.push((format!("conductor {alpha}"), conductor(alpha, Microfacet::Multi)));
    }
    lobes.push(("thin".into(), pbr(0.0, 0.0, 1.0, false)));
    lobes.push(("glass".into(), pbr(0.0, 0.0, 1.0, true)));
    lobes.push(("rough glass".into(), pbr(0.4, 0.0, 1.0, true)));
    let black = MetalRough {
        diffuse: Vec3::ZERO,
        transmitted: Vec3::ZERO,
        layer_f0: Vec3::ZERO,
        layer_f90: 0.0,
        metal_f0: Vec3::ZERO,
        metallic: 0.0,
        alpha: 0.2,
        transmission: Transmission::Thin,
        microfacet: Microfacet::Multi,
    };
    lobes.push(("nothing".into(), Bsdf::MetalRough(black)));
    let mut random = Random::new(3);
    let below_one = 1.0f32.next_down();
    let number = |random: &mut Random| match random.next() {
        x if x < 0.1 => 0.0,
        x if x < 0.2 => below_one,
        _ => random.next(),
    };
    for i in 0..1_000_000 {
        let (name, bsdf) = &lobes[i % lobes.len()];
        let grazing = [1e-3, 1e-5, 1e-7, 0.0, -1e-6][i / 7 % 5];
        let wo = match i % 3 {
            0 => random.direction(),
            1 => direction(grazing, random.next() * 6.0),
            _ => Vec3::new(0.0, 0.0, if i % 2 == 0 { 1.0 } else { -1.0 }),
        };
        let u = [number(&mut random), number(&mut random), number(&mut random)];
        let s = bsdf.sample(wo, u);
        assert!(s.weight.is_finite() && s.weight.min_element() >= 0.0, "{name} {wo} {u:?} {s:?}");
        assert!(s.pdf_solid_angle.is_finite() && s.pdf_solid_angle >= 0.0, "{name} {wo} {u:?} {s:?}");
        assert!((s.wi.length() - 1.0).abs() < 1e-4, "{name} {wo} {u:?} {s:?}");
        assert!(s.weight.max_element() < 20.0, "{name} {wo} {u:?} {s:?}");
        let e = bsdf.eval(wo, random.direction());
        assert!(e.f_cos.is_finite() && e.f_cos.min_element() >= 0.0, "{name} {wo} {e:?}");
        assert!(e.pdf_solid_angle.is_finite() && e.pdf_solid_angle >= 0.0, "{name} {wo} {e:?}");
    }
}
