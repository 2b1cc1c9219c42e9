//! No material gains energy.

use super::albedo::{COSINES, ROUGHNESSES, assert_no_gain};
use super::lobes::{Cases, anisotropy, coat, film, finite, layers, number, pbr, resolved, sheen, through};
use oscura::bsdf::Bsdf;
use oscura::sampling::chi2::Random;

#[test]
fn no_material_gains_energy() {
    check_no_energy_gain(&Cases::each(7));
}

#[test]
#[ignore = "50 seconds"]
fn no_material_gains_energy_in_all_cases() {
    check_no_energy_gain(&Cases::all());
}

/// No material that a file can describe has an albedo above 1.
fn check_no_energy_gain(cases: &Cases) {
    let mut all: Vec<(String, Bsdf)> = finite();
    all.extend(layers().into_iter().map(|(name, p)| (name.to_string(), resolved(p))));
    for roughness in ROUGHNESSES {
        for strength in [0.3, 0.7, 1.0] {
            for metallic in [0.0, 1.0] {
                let stretched = pbr(|p| {
                    (p.anisotropy, p.roughness, p.metallic) =
                        (anisotropy(strength), number(roughness), number(metallic));
                });
                all.push((format!("anisotropic {roughness} {strength} {metallic}"), resolved(stretched)));
            }
        }
        for thickness in [100.0, 400.0, 1000.0] {
            for metallic in [0.0, 1.0] {
                let filmed = pbr(|p| {
                    (p.iridescence, p.roughness, p.metallic) =
                        (film(1.8, thickness), number(roughness), number(metallic));
                });
                all.push((format!("film {roughness} {thickness} {metallic}"), resolved(filmed)));
            }
        }
    }
    assert_no_gain(&all, &COSINES, cases);
}

#[test]
fn no_random_material_gains_energy() {
    check_no_energy_gain_of_random_materials(&Cases::each(29));
}

#[test]
#[ignore = "4 minutes"]
fn no_random_material_gains_energy_in_all_cases() {
    check_no_energy_gain_of_random_materials(&Cases::all());
}

/// White glTF materials of all kinds: random parameters, random layers, down to grazing incidence.
fn check_no_energy_gain_of_random_materials(cases: &Cases) {
    let mut random = Random::new(11);
    let mut all = Vec::new();
    for i in 0..300 {
        let mut unit = || random.next();
        let material = pbr(|p| {
            (p.roughness, p.ior) =
                (number(unit()), if unit() < 0.5 { 1.0 + 0.2 * unit() } else { 1.0 + 2.0 * unit() });
            p.metallic = number([0.0, 1.0, unit()][(unit() * 3.0) as usize]);
            p.transmission = number([0.0, 1.0, unit()][(unit() * 3.0) as usize]);
            p.has_volume = unit() < 0.7;
            p.specular = number(if unit() < 0.6 { 1.0 } else { unit() });
            p.clearcoat = if unit() < 0.25 { coat(unit(), unit()) } else { None };
            p.sheen = if unit() < 0.25 { sheen([1.0; 3], unit()) } else { None };
            p.anisotropy = if unit() < 0.25 { anisotropy(unit()) } else { None };
            p.iridescence = if unit() < 0.25 { film(1.0 + unit(), 1000.0 * unit()) } else { None };
            p.diffuse_transmission = if unit() < 0.25 { through(unit(), [1.0; 3]) } else { None };
        });
        all.push((format!("material {i}: {material:?}"), resolved(material)));
    }
    assert_no_gain(
        &all,
        &[1.0, 0.8, 0.5, 0.25, 0.1, 0.03, 0.01, 1e-3, -0.9, -0.4, -0.1, -0.02, -1e-3],
        cases,
    );
}
