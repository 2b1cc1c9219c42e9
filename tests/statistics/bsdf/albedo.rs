//! The directional albedo of materials.

use super::lobes::{Cases, direction};
use oscura::bsdf::Bsdf;
use oscura::color::Rgb;
use oscura::math::Vec3;

pub const COSINES: [f32; 8] = [1.0, 0.9, 0.7, 0.5, 0.3, 0.1, -0.9, -0.3];
pub const ROUGHNESSES: [f32; 6] = [0.0, 0.1, 0.3, 0.5, 0.75, 1.0];

/// Mean weight: the directional albedo.
pub fn albedo(bsdf: &Bsdf, wo: Vec3, n: u32) -> Rgb {
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
    Rgb::from_array(sum.map(|x| (x / f64::from(n)) as f32))
}

/// Asserts an albedo of at most 1 + 1e-3. Values near it are measured again with more samples, whose own error is below 1e-4.
pub fn assert_no_gain(all: &[(String, Bsdf)], cosines: &[f32], cases: &Cases) {
    let mut worst = (0.0, String::new());
    for (name, bsdf) in all {
        for &cosine in cosines {
            for azimuth in [0.3, 1.4].into_iter().filter(|_| cases.takes()) {
                let wo = direction(cosine, azimuth);
                let mut a = albedo(bsdf, wo, 10_000).max_element();
                for (near, samples) in [(5e-4, 80_000), (8e-4, 600_000)] {
                    if a > 1.0 + near {
                        a = albedo(bsdf, wo, samples).max_element();
                    }
                }
                if a > worst.0 {
                    worst = (a, format!("{name}, cos {cosine}, azimuth {azimuth}"));
                }
            }
        }
    }
    println!("largest albedo: {worst:?}");
    assert!(worst.0 < 1.0 + 1e-3, "{worst:?}");
}
