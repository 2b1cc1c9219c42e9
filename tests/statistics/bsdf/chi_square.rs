//! Samples follow their pdf, and weights are value over pdf.

use super::lobes::{Cases, conductor, direction, finite, glass, length};
use oscura::math::Vec3;
use oscura::sampling::chi2::{Chi2, Random, SphericalDomain};
use oscura::scene::EnergyCompensation;

/// Normal to grazing, above and below.
const COSINES: [f32; 7] = [1.0, 0.8, 0.3, 0.05, 0.002, -0.6, -0.02];

#[test]
fn samples_follow_the_pdf() {
    check_samples_follow_the_pdf(&Cases::each(13));
}

#[test]
#[ignore = "6 minutes"]
fn samples_follow_the_pdf_in_all_cases() {
    check_samples_follow_the_pdf(&Cases::all());
}

fn check_samples_follow_the_pdf(cases: &Cases) {
    let lobes = finite();
    let pairs = lobes.iter().flat_map(|lobe| COSINES.map(|cosine| (lobe, cosine)));
    let pairs: Vec<_> = pairs.filter(|_| cases.takes()).collect();
    for ((name, bsdf), cosine) in &pairs {
        // The boundary of transmission crosses cells.
        let splits = if bsdf.has_scattered_transmission() { 2 } else { 0 };
        let wo = direction(*cosine, 0.7);
        Chi2::new(&format!("{name} from {cosine}"), pairs.len())
            .cells(32, 32)
            .samples(100_000)
            .min_splits(splits)
            .assert_directions(
                &SphericalDomain::sphere(),
                |u| {
                    let s = bsdf.sample(wo, u);
                    (s.pdf_solid_angle > 0.0 && !s.is_specular).then_some(s.wi)
                },
                |wi| bsdf.eval(wo, wi).pdf_solid_angle,
            );
    }
}

/// A lobe of alpha 0.003, tested in a cap around the mirror direction.
#[test]
fn sharp_lobes_follow_the_pdf() {
    for cosine in [1.0f32, 0.4] {
        let wo = direction(cosine, -1.0);
        let bsdf = conductor(0.003, EnergyCompensation::Off);
        let mirror = Vec3::new(-wo.x, -wo.y, wo.z);
        Chi2::new("sharp conductor", 2).assert_directions(
            &SphericalDomain::cap(mirror, 5e-4),
            |u| Some(bsdf.sample(wo, u).wi),
            |wi| bsdf.eval(wo, wi).pdf_solid_angle,
        );
    }
}

/// Glass of an index close to 1 spreads transmitted light by less than a thousandth of a radian.
#[test]
fn nearly_index_matched_glass_follows_the_pdf() {
    for cosine in COSINES {
        let wo = direction(cosine, 0.7);
        let bsdf = glass(1.001, 0.9, false, [1.0; 3], EnergyCompensation::On);
        // Back-facing microfacets end the lobe near its centre: not where the cells meet.
        let centre = -wo - Vec3::Z * 1e-3f32.copysign(cosine);
        Chi2::new(&format!("glass 1.001 from {cosine}"), COSINES.len()).assert_directions(
            &SphericalDomain::cap(centre, 8e-6),
            |u| {
                let s = bsdf.sample(wo, u);
                (s.pdf_solid_angle > 0.0).then_some(s.wi)
            },
            |wi| bsdf.eval(wo, wi).pdf_solid_angle,
        );
    }
}

#[test]
fn weights_are_value_over_pdf() {
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
            assert!(length(weight - s.weight) <= 1e-3 * length(s.weight) + 1e-5, "{name} {wo} {s:?} {e:?}");
        }
    }
}
