//! Against single rays.

use super::super::tests::{Rng, soup};
use super::super::{AccelInstance, Geometry};
use super::*;
use crate::math::DAffine3;

/// Fans between surfaces and through space: each ray's answer is that of the ray alone, on all levels.
fn check(accel: &Accel, geometry: &Geometry, fans: usize, width: f32) -> (usize, usize, usize) {
    let mut rng = Rng::new(11);
    let (mut stopped_rays, mut all_rays, mut known_rays) = (0, 0, 0);
    for number in 0..fans {
        let on_triangle = |rng: &mut Rng| {
            let prim = rng.bits() % geometry.triangles.len() as u32;
            let [a, b, c] =
                geometry.triangles[prim as usize].map(|i| Vec3::from_array(geometry.positions[i as usize]));
            let (u, v) = (rng.unit() * 0.5, rng.unit() * 0.5);
            (a + (b - a) * u + (c - a) * v, prim)
        };
        let center = rng.vector();
        let (mut origins, mut origin_primitives) = ([[0.0; RAYS]; 3], [OriginPrimitive::NONE; RAYS]);
        let (on, prim) = on_triangle(&mut rng);
        for k in 0..RAYS {
            let near = center + rng.vector() * width;
            let start = if number.is_multiple_of(2) { on + rng.vector() * 1e-6 } else { near };
            for axis in 0..3 {
                origins[axis][k] = start[axis];
            }
            if number.is_multiple_of(4) {
                origin_primitives[k] = OriginPrimitive { prim, instance: 0 };
            }
        }
        let target = if number.is_multiple_of(3) { on_triangle(&mut rng).0 } else { rng.vector() };
        let rays = (u64::from(rng.bits()) << 32 | u64::from(rng.bits())) & (u64::MAX >> (number % 50));
        let fan = Fan {
            target,
            origins: origins.each_ref().map(|x| &x[..]),
            origin_primitives: &origin_primitives,
            rays,
        };
        let list: Vec<Ray> = Bits(rays).map(|k| fan.ray(k)).collect();
        let mut occluded = vec![false; list.len()];
        accel.occluded(&list, &mut occluded);
        let expected =
            Bits(rays).zip(&occluded).fold(0, |set, (k, occluded)| set | u64::from(*occluded) << k);
        for level in Level::ALL.into_iter().filter(|l| l.is_available()) {
            let FanHits { stopped, unknown } = accel.occluded_fan_at(level, &fan, |_| false);
            assert_eq!(stopped, expected & !unknown, "{number} {}", level.name());
            known_rays += (rays & !unknown).count_ones() as usize;
            // Without any certain primitive nothing is stopped, and what is stopped else is in doubt.
            let doubted = accel.occluded_fan_at(level, &fan, |_| true);
            assert!(doubted.stopped == 0 && expected & !doubted.unknown == 0, "{number}");
        }
        stopped_rays += expected.count_ones() as usize;
        all_rays += list.len();
    }
    let levels = Level::ALL.into_iter().filter(|l| l.is_available()).count();
    (stopped_rays, known_rays / levels, all_rays)
}

#[test]
fn fans_are_their_rays_to_the_bit() {
    for (count, size, width) in [(5, 0.8, 0.1), (60, 0.5, 0.3), (2000, 0.1, 0.02), (2000, 0.1, 1.0)] {
        let geometry = soup(count, size, count as u64);
        for analytic in [false, true] {
            let analytic = if analytic { geometry.analytic.clone() } else { Vec::new() };
            let geometry = Geometry { analytic, ..geometry.clone() };
            let accel = Accel::build(std::slice::from_ref(&geometry), &[]);
            let (stopped, known, all) = check(&accel, &geometry, 1500, width);
            assert!(stopped * 50 > all && stopped * 10 < all * 9, "{stopped} of {all} are stopped");
            assert!(count > 100 || known * 10 > all, "{known} of {all} are known");
        }
    }
}

#[test]
fn instances_are_left_to_single_rays() {
    let (world, placed) = (soup(40, 0.4, 1), soup(50, 0.3, 2));
    let world_from_object = DAffine3::from_rotation_x(0.5);
    let accel = Accel::build(&[world.clone(), placed], &[AccelInstance { geometry: 1, world_from_object }]);
    check(&accel, &world, 500, 0.2);
}

#[test]
fn fans_far_away_and_without_rays_are_answered() {
    let geometry = soup(30, 0.5, 1);
    let accel = Accel::build(&[geometry], &[]);
    let origins = [[f32::INFINITY; RAYS], [0.0; RAYS], [1e30; RAYS]];
    let origin_primitives = [OriginPrimitive::NONE; RAYS];
    for (target, rays) in [(Vec3::ZERO, u64::MAX), (Vec3::splat(f32::NAN), 3), (Vec3::ONE, 0)] {
        let fan = Fan {
            target,
            origins: origins.each_ref().map(|x| &x[..]),
            origin_primitives: &origin_primitives,
            rays,
        };
        assert_eq!(accel.occluded_fan(&fan, |_| false).stopped, 0);
    }
}
