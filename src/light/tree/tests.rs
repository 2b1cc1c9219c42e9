use super::*;
use crate::math::{Bounds3, Vec3};
use crate::sampling::chi2::Random;
use crate::sampling::warp;
use std::f32::consts::{FRAC_PI_2, PI};

fn lamps(count: usize, random: &mut Random) -> Vec<LightBounds> {
    let mut light = |_| {
        let corner = Vec3::new(random.next(), random.next(), random.next()) * 10.0;
        let edges = Vec3::new(random.next(), random.next(), random.next()) * 0.2;
        let axis = warp::uniform_sphere([random.next(), random.next()]);
        LightBounds {
            bounds: Bounds3::of([corner, corner + edges]),
            weight: random.next().powi(4) + 1e-3,
            axis,
            normals_rad: if random.next() < 0.2 { PI } else { 0.0 },
            emission_rad: FRAC_PI_2,
        }
    };
    (0..count).map(&mut light).collect()
}

fn receivers(random: &mut Random) -> Vec<Receiver> {
    let receiver = |i: usize| {
        let p = Vec3::new(random.next(), random.next(), random.next()) * 14.0 - 2.0;
        let normal = warp::uniform_sphere([random.next(), random.next()]);
        Receiver { p, normal: if i.is_multiple_of(4) { Vec3::ZERO } else { normal } }
    };
    (0..40).map(receiver).collect()
}

#[test]
fn chances_add_up_to_one_and_are_those_of_sampling() {
    const SAMPLES: u32 = 1000;
    let mut random = Random::new(4);
    for count in [1, 2, 7, 8, 9, 100, 3000] {
        let lights = lamps(count, &mut random);
        let tree = LightTree::new(&lights);
        for receiver in receivers(&mut random) {
            let probabilities: f64 =
                (0..count).map(|i| f64::from(tree.pdf_discrete(&receiver, i as u32))).sum();
            assert!(probabilities < 1.0 + 1e-4, "{count}: {probabilities}");
            // Less than 1 where bounds promised light that none of the lights in them gives.
            let mut lost = 0;
            for k in 0..SAMPLES {
                let u = (f64::from(k) + f64::from(random.next())) / f64::from(SAMPLES);
                let Some((light, pdf)) = tree.sample(&receiver, u) else {
                    assert!(probabilities < 1.0 - 1e-4);
                    lost += 1;
                    continue;
                };
                let again = tree.pdf_discrete(&receiver, light);
                assert!(pdf > 0.0 && (pdf - again).abs() <= 1e-5 * pdf, "{count}: {pdf} {again}");
            }
            let sum = probabilities + f64::from(lost) / f64::from(SAMPLES);
            assert!(
                (sum - 1.0).abs() < 0.03,
                "{count}: {probabilities} and {lost} of {SAMPLES} without a light"
            );
        }
    }
}

#[test]
fn lights_that_reach_a_point_can_be_chosen() {
    let mut random = Random::new(8);
    let lights = lamps(500, &mut random);
    let tree = LightTree::new(&lights);
    for receiver in receivers(&mut random) {
        for (i, light) in lights.iter().enumerate() {
            let point = light.bounds.min
                + light.bounds.extent() * Vec3::new(random.next(), random.next(), random.next());
            let to_light = (point - receiver.p).normalize();
            let faces = light.normals_rad > 0.0 || to_light.dot(light.axis) < 0.0;
            let lit = receiver.normal == Vec3::ZERO || to_light.dot(receiver.normal) > 0.0;
            if faces && lit {
                assert!(tree.pdf_discrete(&receiver, i as u32) > 0.0, "{receiver:?} {light:?}");
            }
        }
    }
}

#[test]
fn lights_in_one_place_and_dark_ones() {
    let one = LightBounds {
        bounds: Bounds3::of([Vec3::ONE]),
        weight: 1.0,
        axis: Vec3::Y,
        normals_rad: PI,
        emission_rad: FRAC_PI_2,
    };
    let mut lights = vec![one; 10_000];
    lights[17].weight = 0.0;
    let tree = LightTree::new(&lights);
    let receiver = Receiver { p: Vec3::ONE, normal: Vec3::ZERO };
    assert_eq!(tree.pdf_discrete(&receiver, 17), 0.0);
    let sum: f64 = (0..10_000).map(|i| f64::from(tree.pdf_discrete(&receiver, i))).sum();
    assert!((sum - 1.0).abs() < 1e-3, "{sum}");
    assert!(tree.bytes() < 128 * lights.len(), "{}", tree.bytes());
    assert!(LightTree::new(&[]).sample(&receiver, 0.5).is_none());
}
