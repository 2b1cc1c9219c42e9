//! Random materials, directions and parameters, extremes included, give finite values.

use super::lobes::{direction, number};
use oscura::bsdf::{Bsdf, BsdfProgram, Coat, Factors, LocalFrame, ShadingModel};
use oscura::math::{Vec2, Vec3};
use oscura::sampling::chi2::Random;
use oscura::scene::{
    Anisotropy, Clearcoat, ColorSlot, DiffuseTransmission, EnergyCompensation, FloatSlot, FresnelModel,
    Iridescence, Model, PbrMaterial, Sheen, SubsurfaceEntry,
};

/// In 0..1, often an end or next to it, sometimes a denormal.
fn unit(random: &mut Random) -> f32 {
    const ENDS: [f32; 7] = [0.0, 1.0, 1e-40, f32::MIN_POSITIVE, 1e-7, 1e-3, 1.0 - f32::EPSILON];
    match random.next() {
        x if x < 0.3 => ENDS[(random.next() * 7.0) as usize % 7],
        _ => random.next(),
    }
}

fn color(random: &mut Random) -> ColorSlot {
    ColorSlot::constant(match random.next() {
        x if x < 0.3 => [unit(random); 3],
        _ => [unit(random), unit(random), unit(random)],
    })
}

fn slot(random: &mut Random) -> FloatSlot {
    number(unit(random))
}

fn ior(random: &mut Random) -> f32 {
    const SPECIAL: [f32; 6] = [0.0, 1.0, 1.0 + 1e-6, 1.001, 10.0, 1e6];
    match random.next() {
        x if x < 0.2 => SPECIAL[(random.next() * 6.0) as usize % 6],
        _ => 1.0 + 2.0 * random.next(),
    }
}

fn pbr(random: &mut Random) -> PbrMaterial {
    let has = |random: &mut Random| random.next() < 0.3;
    let mut p = PbrMaterial {
        base_color: color(random),
        metallic: slot(random),
        roughness: slot(random),
        ior: ior(random),
        specular: slot(random),
        specular_color: color(random),
        transmission: slot(random),
        has_volume: has(random),
        ..PbrMaterial::default()
    };
    if has(random) {
        p.clearcoat = Some(Clearcoat { factor: slot(random), roughness: slot(random), normal_map: None });
    }
    if has(random) {
        p.sheen = Some(Sheen { color: color(random), roughness: slot(random) });
    }
    if has(random) {
        let rotation_rad = 10.0 * random.next();
        p.anisotropy = Some(Anisotropy { strength: unit(random), rotation_rad, texture: None });
    }
    if has(random) {
        p.iridescence = Some(Iridescence {
            factor: slot(random),
            ior: ior(random).max(1.0),
            thickness_min_nm: 0.0,
            thickness_max_nm: 1200.0 * unit(random),
            thickness_texture: None,
        });
    }
    if has(random) {
        let subsurface =
            has(random).then(|| SubsurfaceEntry::Refraction { ior: ior(random).clamp(1.01, 3.8) });
        p.diffuse_transmission =
            Some(DiffuseTransmission { factor: slot(random), color: color(random), subsurface });
    }
    p
}

fn model(random: &mut Random) -> Model {
    match (random.next() * 12.0) as u32 {
        0 => Model::Lambert { albedo: color(random) },
        1 => Model::OrenNayar { color: color(random), roughness: slot(random) },
        2 => {
            let exponent = if random.next() < 0.2 { 1e6 } else { 200.0 * unit(random) };
            Model::Phong { diffuse: color(random), specular: color(random), exponent }
        }
        3 => Model::SchlickMetal { color: color(random), roughness: slot(random) },
        4 => {
            let component = |random: &mut Random| [0, 1, 2].map(|_| 10.0 * unit(random));
            Model::Conductor {
                eta: component(random),
                k: component(random),
                metal: None,
                roughness: slot(random),
            }
        }
        5 => Model::Dielectric {
            ior: ior(random).max(1.0),
            tint: color(random),
            fresnel: FresnelModel::Schlick,
        },
        6 | 7 => Model::Glass {
            ior: ior(random).max(1.0),
            tint: color(random),
            roughness: slot(random),
            is_thin: random.next() < 0.5,
        },
        _ => Model::Pbr(Box::new(pbr(random))),
    }
}

fn bsdf(random: &mut Random) -> Bsdf {
    let energy_compensation =
        if random.next() < 0.5 { EnergyCompensation::On } else { EnergyCompensation::Off };
    let fresnel = if random.next() < 0.75 { FresnelModel::Exact } else { FresnelModel::Schlick };
    let angle = 7.0 * random.next();
    let tangent = Vec2::new(angle.cos(), angle.sin());
    let frame = LocalFrame { tangent, bitangent: tangent.perp(), ..LocalFrame::DEFAULT };
    let shading = ShadingModel { energy_compensation, fresnel, ..ShadingModel::default() };
    let mut bsdf = BsdfProgram::of(&model(random), shading).evaluate(&Factors, &frame);
    if random.next() < 0.1 {
        // Solids inside denser ones.
        bsdf = bsdf.with_ior(1.0 / ior(random).max(1.0));
    }
    match bsdf {
        Bsdf::Layered(mut l) if random.next() < 0.5 => {
            let normal = random.direction();
            l.coat =
                Coat { normal: Vec3::new(normal.x, normal.y, normal.z.abs() + 0.01).normalize(), ..l.coat };
            Bsdf::Layered(l)
        }
        other => other,
    }
}

fn view(random: &mut Random) -> Vec3 {
    const GRAZING: [f32; 7] = [1e-3, 1e-5, 1e-7, 1e-30, 0.0, -1e-6, -0.0];
    match random.next() {
        x if x < 0.4 => random.direction(),
        x if x < 0.6 => direction(GRAZING[(random.next() * 7.0) as usize % 7], random.next() * 6.0),
        x if x < 0.7 => {
            if random.next() < 0.5 {
                Vec3::Z
            } else {
                Vec3::NEG_Z
            }
        }
        _ => direction(random.next(), random.next() * 6.0),
    }
}

/// Samples; returns the first failure. No sample weight may exceed `most_weight`.
fn draws(seed: u64, count: u32, most_weight: f32) -> Result<f32, String> {
    let mut random = Random::new(seed);
    let below_one = 1.0f32.next_down();
    let mut largest = 0.0f32;
    let mut material = bsdf(&mut random);
    for i in 0..count {
        if i % 8 == 0 {
            material = bsdf(&mut random);
        }
        let wo = view(&mut random);
        let u = [0, 1, 2].map(|_| unit(&mut random).min(below_one));
        let s = material.sample(wo, u);
        let fail = |what: &str| Err(format!("{what}: {material:?}\n{wo:?} {u:?}\n{s:?}"));
        if !(s.weight.is_finite() && s.weight.min_element() >= 0.0) {
            return fail("weight");
        }
        if !(s.pdf_solid_angle.is_finite() && s.pdf_solid_angle >= 0.0 && s.eta.is_finite()) {
            return fail("density");
        }
        if (s.wi.length() - 1.0).abs() >= 1e-3 {
            return fail("direction");
        }
        if s.is_transmission != ((s.wi.z < 0.0) != (wo.z < 0.0))
            && s.pdf_solid_angle > 0.0
            && wo.z != 0.0
            && s.wi.z != 0.0
        {
            return fail("side");
        }
        // Radiance that leaves a dense medium is scaled by the squared index.
        let weight = s.weight.max_element() * s.eta.min(1.0).powi(2);
        if weight > most_weight {
            return fail("large weight");
        }
        largest = largest.max(weight);
        for wi in [random.direction(), view(&mut random), s.wi] {
            let e = material.eval(wo, wi);
            let valid = e.f_cos.is_finite() && e.f_cos.min_element() >= 0.0;
            if !(valid && e.pdf_solid_angle.is_finite() && e.pdf_solid_angle >= 0.0) {
                return Err(format!("value: {material:?}\n{wo:?} {wi:?}\n{e:?}"));
            }
        }
    }
    Ok(largest)
}

#[test]
fn a_million_random_samples_are_finite() {
    let largest = draws(3, 1_000_000, 1e3).unwrap_or_else(|e| panic!("{e}"));
    println!("largest weight {largest}");
}

/// `cargo test --release --test statistics -- --ignored`: two minutes.
#[test]
#[ignore = "two minutes"]
fn a_hundred_million_random_samples_are_finite() {
    // A hundred times as many samples include rarer, larger weights.
    let largest = (0..100).map(|seed| draws(100 + seed, 1_000_000, 1e5).unwrap_or_else(|e| panic!("{e}")));
    println!("largest weight {}", largest.fold(0.0, f32::max));
}
