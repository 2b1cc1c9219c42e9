//! The phase function of media: samples follow its pdf.

use oscura::bsdf::phase::{henyey_greenstein, sample_henyey_greenstein};
use oscura::math::Vec3;
use oscura::sampling::chi2::{Chi2, SphericalDomain};

#[test]
fn scattered_directions_follow_the_pdf() {
    let cases = [-0.9f32, -0.3, 0.0, 5e-4, 0.2, 0.7, 0.95];
    let wo = Vec3::new(0.3, -0.5, 0.8).normalize();
    for g in cases {
        Chi2::new(&format!("Henyey-Greenstein {g}"), cases.len()).samples(200_000).assert_directions(
            &SphericalDomain::sphere(),
            |u| Some(sample_henyey_greenstein(g, wo, [u[0], u[1]])),
            |wi| henyey_greenstein(g, -wo.dot(wi)),
        );
    }
}
