//! Against brute force, on all CPU levels, and on what breaks structures.

use super::slot::ShallowSlot;
use super::*;
use crate::math::{DAffine3, Hit, NO_HIT, OriginPrimitive, Ray, Vec3};
use crate::shape::{Analytic, Quad, Sphere};
use crate::simd::Level;

/// A small generator of numbers for tests (PCG, O'Neill 2014).
pub struct Rng(u64);
impl Rng {
    pub fn new(seed: u64) -> Rng {
        Rng(seed.wrapping_mul(2).wrapping_add(0x9e37_79b9_7f4a_7c15))
    }
    pub fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = (((self.0 >> 18) ^ self.0) >> 27) as u32;
        x.rotate_right((self.0 >> 59) as u32)
    }
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / 16_777_216.0
    }
    pub fn vector(&mut self) -> Vec3 {
        Vec3::new(self.unit() * 2.0 - 1.0, self.unit() * 2.0 - 1.0, self.unit() * 2.0 - 1.0)
    }
}

pub fn soup(count: usize, size: f32, seed: u64) -> Geometry {
    let mut rng = Rng::new(seed);
    let mut geometry = Geometry::default();
    for _ in 0..count {
        let center = rng.vector();
        let first = geometry.positions.len() as u32;
        geometry.positions.extend((0..3).map(|_| (center + rng.vector() * size).to_array()));
        geometry.triangles.push([first, first + 1, first + 2]);
    }
    for _ in 0..count / 10 {
        let quad = Quad { corner: rng.vector(), edge_u: rng.vector() * size, edge_v: rng.vector() * size };
        geometry.quads.push(quad);
        let sphere = Sphere { center: rng.vector(), radius: rng.unit() * size };
        geometry.analytic.push(Analytic::Sphere(sphere));
    }
    geometry
}

fn random_rays(count: usize, seed: u64) -> Vec<Ray> {
    let mut rng = Rng::new(seed);
    (0..count).map(|_| Ray::new(rng.vector() * 1.5, rng.vector())).collect()
}

fn build(geometries: &[Geometry], instances: &[AccelInstance]) -> Accel {
    let accel = Accel::build(geometries, instances);
    accel.validate().expect("valid");
    accel
}

fn trace(accel: &Accel, level: Level, rays: &[Ray]) -> Vec<Hit> {
    let mut hits = vec![Hit::MISS; rays.len()];
    accel.closest_at(level, rays, &mut hits);
    hits
}

/// Each primitive in a structure of its own: no tree can go wrong there.
fn brute_force(geometry: &Geometry, rays: &[Ray]) -> Vec<Hit> {
    let mut best = vec![Hit::MISS; rays.len()];
    let (t, q) = (geometry.triangles.len(), geometry.quads.len());
    for id in 0..t + q + geometry.analytic.len() {
        let mut one = Geometry { positions: geometry.positions.clone(), ..Geometry::default() };
        if id < t {
            one.triangles.push(geometry.triangles[id]);
        } else if id < t + q {
            one.quads.push(geometry.quads[id - t]);
        } else {
            one.analytic.push(geometry.analytic[id - t - q]);
        }
        for (best, hit) in best.iter_mut().zip(trace(&build(&[one], &[]), Level::Scalar, rays)) {
            if hit.t < best.t {
                *best = Hit { prim: id as u32, ..hit };
            }
        }
    }
    best
}

#[test]
fn agrees_with_brute_force() {
    let geometry = soup(150, 0.4, 1);
    let rays = random_rays(2000, 2);
    let expected = brute_force(&geometry, &rays);
    let accel = build(&[geometry], &[]);
    assert!(expected.iter().filter(|h| h.is_hit()).count() > 500);
    for level in Level::ALL.into_iter().filter(|l| l.is_available()) {
        assert_eq!(trace(&accel, level, &rays), expected, "{}", level.name());
    }
}

#[test]
fn levels_and_batch_sizes_agree_to_the_bit() {
    for (count, size) in [(1, 1.0), (3, 0.5), (40, 0.5), (5000, 0.05), (20_000, 0.3)] {
        let accel = build(&[soup(count, size, 7)], &[]);
        let rays = random_rays(5000, 8);
        let scalar = trace(&accel, Level::Scalar, &rays);
        let mut single = vec![Hit::MISS; rays.len()];
        for (ray, hit) in rays.iter().zip(&mut single) {
            *hit = accel.closest_one(ray);
        }
        assert_eq!(single, scalar);
        for level in Level::ALL.into_iter().filter(|l| l.is_available()) {
            assert_eq!(trace(&accel, level, &rays), scalar, "{} {count}", level.name());
            let mut occluded = vec![false; rays.len()];
            accel.occluded_at(level, &rays, &mut occluded);
            assert!(occluded.iter().zip(&scalar).all(|(o, h)| *o == h.is_hit()), "{} {count}", level.name());
        }
        let mut any = vec![Hit::MISS; rays.len()];
        accel.any(&rays, &mut any);
        assert!(any.iter().zip(&scalar).all(|(a, h)| a.is_hit() == h.is_hit()), "{count}");
        let primitives = (count + 2 * (count / 10)) as u32;
        assert!(any.iter().filter(|a| a.is_hit()).all(|a| a.instance == 0 && a.prim < primitives));
    }
}

/// Triangles met in corners, where edge functions are zero, up to nearly the largest that are taken, and rays from so far
/// that edge functions overflow.
#[test]
fn levels_agree_in_corners_at_any_scale() {
    for scale in [1e-12, 1.0, 9e17] {
        let mut rng = Rng::new(11);
        let mut geometry = Geometry::default();
        for i in 0..30 {
            geometry.positions.extend([(); 3].map(|()| (rng.vector() * scale).to_array()));
            geometry.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
        }
        let rays = geometry.positions.iter().flat_map(|p| {
            let corner = Vec3::from_array(*p);
            // From the middle of all, and along axes, which shears nothing.
            let before = |axis: Vec3| Ray::new(corner - axis * corner.length(), axis);
            let far = Ray::new(corner * 1e20 + Vec3::Y * scale, -corner / scale);
            [Ray::new(Vec3::ZERO, corner / scale), before(Vec3::X), before(Vec3::Y), before(Vec3::Z), far]
        });
        let rays: Vec<Ray> = rays.collect();
        // Few triangles are scanned, more are in a tree.
        let mut many = geometry.clone();
        many.quads.push(Quad {
            corner: Vec3::splat(scale),
            edge_u: Vec3::X * scale,
            edge_v: Vec3::Y * scale,
        });
        many.analytic.push(Analytic::Sphere(Sphere { center: Vec3::splat(-scale), radius: 0.1 * scale }));
        for geometry in [geometry, many] {
            let accel = build(&[geometry], &[]);
            let scalar = trace(&accel, Level::Scalar, &rays);
            assert!(scalar.iter().filter(|hit| hit.is_hit()).count() > 50, "{scale}");
            for level in Level::ALL.into_iter().filter(|l| l.is_available()) {
                assert_eq!(trace(&accel, level, &rays), scalar, "{} {scale}", level.name());
            }
        }
    }
}

#[test]
fn ranges_are_exclusive() {
    let quad = Quad { corner: Vec3::new(-1.0, -1.0, 2.0), edge_u: Vec3::X * 2.0, edge_v: Vec3::Y * 2.0 };
    let accel = build(&[Geometry { quads: vec![quad], ..Geometry::default() }], &[]);
    let ray = Ray::new(Vec3::ZERO, Vec3::Z);
    let hit = accel.closest_one(&ray);
    assert_eq!((hit.t, hit.u, hit.v, hit.prim), (2.0, 0.5, 0.5, 0));
    assert!(!accel.closest_one(&Ray { t_max: 2.0, ..ray }).is_hit());
    assert!(!accel.closest_one(&Ray { t_min: 2.0, ..ray }).is_hit());
    assert!(accel.closest_one(&Ray { t_max: 2.0f32.next_up(), t_min: 2.0f32.next_down(), ..ray }).is_hit());
    let long = Ray { direction: Vec3::Z * 1e20, ..ray };
    assert!((accel.closest_one(&long).t / 2e-20 - 1.0).abs() < 1e-6);
}

#[test]
fn instances_are_hit_in_world_parameters() {
    let sphere = Geometry {
        analytic: vec![Analytic::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 })],
        ..Geometry::default()
    };
    let flat = soup(100, 0.1, 3);
    let at = |x: f64, scale: f64| AccelInstance {
        geometry: 1,
        world_from_object: DAffine3::from_scale_rotation_translation(
            crate::math::DVec3::splat(scale),
            crate::math::DQuat::IDENTITY,
            crate::math::DVec3::new(x, 0.0, 0.0),
        ),
    };
    let singular = AccelInstance { world_from_object: DAffine3::ZERO, ..at(0.0, 1.0) };
    let accel = build(&[flat, sphere], &[at(10.0, 2.0), singular, at(-10.0, 0.5)]);
    assert_eq!(accel.stats().dropped.instances, 1);
    let hit = accel.closest_one(&Ray::new(Vec3::new(2.0, 0.0, 0.0), Vec3::X * 2.0));
    assert_eq!((hit.t, hit.prim, hit.instance), (3.0, 0, 1));
    let hit = accel.closest_one(&Ray::new(Vec3::new(-2.0, 0.0, 0.0), -Vec3::X));
    assert_eq!((hit.t, hit.prim, hit.instance), (7.5, 0, 3));
    let beyond = Ray { t_max: 7.4, ..Ray::new(Vec3::new(-2.0, 0.0, 0.0), -Vec3::X) };
    assert!(!accel.closest_one(&beyond).is_hit());
}

#[test]
fn rays_that_make_no_sense_hit_nothing() {
    let accel = build(&[soup(100, 2.0, 3)], &[]);
    let (o, d) = (Vec3::ZERO, Vec3::X);
    let bad = [
        Ray::new(Vec3::new(f32::NAN, 0.0, 0.0), d),
        Ray::new(Vec3::new(f32::INFINITY, 0.0, 0.0), d),
        Ray::new(o, Vec3::ZERO),
        Ray::new(o, Vec3::new(f32::NAN, 1.0, 0.0)),
        Ray { t_max: 0.0, ..Ray::new(o, d) },
        Ray { t_max: f32::NAN, ..Ray::new(o, d) },
    ];
    for level in Level::ALL {
        assert!(trace(&accel, level, &bad).iter().all(|hit| *hit == Hit::MISS));
    }
}

#[test]
fn nothing_and_degenerates_are_dropped_and_counted() {
    let accel = build(&[], &[]);
    assert!(!accel.closest_one(&Ray::new(Vec3::ZERO, Vec3::X)).is_hit());
    let mut geometry = soup(10, 0.5, 4);
    geometry.triangles.extend([[0, 0, 1], [0, 1, 999_999]]);
    geometry.positions[3] = [f32::NAN; 3];
    geometry.analytic.push(Analytic::Sphere(Sphere { center: Vec3::ZERO, radius: 0.0 }));
    let accel = build(&[geometry], &[]);
    assert_eq!(accel.stats().dropped, Dropped { not_finite: 2, degenerate: 2, instances: 0 });
    assert!(trace(&accel, Level::Scalar, &random_rays(1000, 5)).iter().any(|h| h.prim != NO_HIT));
}

/// A million equal triangles; and many around the same middle, each a little larger than the one before. Time in
/// proportion to the square of their number would be hours.
#[test]
fn equal_and_concentric_primitives_build_quickly() {
    let begin = std::time::Instant::now();
    for (count, grow) in [(300_000u32, 0.0), (100_000, 1e-6)] {
        let mut geometry = Geometry::default();
        for i in 0..count {
            let r = 1.0 + i as f32 * grow;
            geometry.positions.extend([[-r, -r, 0.0], [r, -r, 0.0], [0.0, r * 2.0, 0.0]]);
            geometry.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
        }
        let accel = build(&[geometry], &[]);
        let ray = Ray::new(Vec3::new(0.0, 0.0, 5.0), -Vec3::Z);
        for level in Level::ALL {
            let hit = trace(&accel, level, &[ray]);
            assert!((hit[0].t - 5.0).abs() < 1e-5);
            assert!(grow > 0.0 || hit[0].prim == 0, "ties go to the smallest id");
        }
    }
    assert!(begin.elapsed().as_secs() < 600);
}

/// A grid of `2 n n` triangles over a hilly surface.
fn hills(n: u32) -> Geometry {
    let mut geometry = Geometry::default();
    for (x, z) in (0..=n).flat_map(|z| (0..=n).map(move |x| (x as f32 / n as f32, z as f32 / n as f32))) {
        geometry.positions.push([x, 0.1 * (x * 20.0).sin() * (z * 17.0).cos(), z]);
    }
    for (x, z) in (0..n).flat_map(|z| (0..n).map(move |x| (x, z))) {
        let a = z * (n + 1) + x;
        geometry.triangles.extend([[a, a + n + 1, a + 1], [a + 1, a + n + 1, a + n + 2]]);
    }
    geometry
}

#[test]
fn a_thousand_instances_take_the_memory_of_one() {
    let mesh = hills(224);
    assert!(mesh.triangles.len() > 100_000);
    let place = |i: u32| AccelInstance {
        geometry: 1,
        world_from_object: DAffine3::from_translation(crate::math::DVec3::new(
            f64::from(i % 32) * 1.5,
            0.0,
            f64::from(i / 32) * 1.5,
        )),
    };
    let geometries = [Geometry::default(), mesh];
    let one = build(&geometries, &[place(0)]);
    let instances: Vec<AccelInstance> = (0..1000).map(place).collect();
    let thousand = build(&geometries, &instances);
    let stats = thousand.stats();
    assert_eq!((stats.instances, stats.shared_geometries, stats.triangles), (1000, 1, 2 * 224 * 224));
    let more = stats.bytes - one.stats().bytes;
    assert!(more < 1 << 20, "999 more instances take {more} bytes");
    assert!(one.stats().bytes < 85 * one.stats().triangles, "{} bytes", one.stats().bytes);
    // The last one is where it should be.
    let down = Ray::new(Vec3::new(7.0 * 1.5 + 0.4, 1.0, 31.0 * 1.5 + 0.3), -Vec3::Y);
    assert_eq!(thousand.closest_one(&down).instance, 1000);
}

/// One vertex far below or above all others, and a second mesh a million times as large: before distance counted by its
/// logarithm, the first took 23 seconds to build and left all rays hundreds of times slower.
#[test]
fn one_distant_vertex_leaves_the_rest_quick() {
    let plain = hills(132);
    let rays: Vec<Ray> = (0..20_000)
        .map(|i| Ray::new(Vec3::new((i % 141) as f32 / 141.0, 1.0, (i / 141) as f32 / 142.0), -Vec3::Y))
        .collect();
    let trace = |accel: &Accel| {
        let mut hits = vec![Hit::MISS; rays.len()];
        accel.closest(&rays, &mut hits);
        hits
    };
    let expected = trace(&build(std::slice::from_ref(&plain), &[]));
    for far in [1e9f32, -1e9, 1e17] {
        let mut mesh = plain.clone();
        mesh.positions[0] = [far, 0.5 * far, 0.3 * far];
        let begin = std::time::Instant::now();
        let accel = build(std::slice::from_ref(&mesh), &[]);
        let hits = trace(&accel);
        assert!(begin.elapsed().as_secs() < 10, "{far}: {:?}", begin.elapsed());
        // Only the triangles at that vertex changed.
        let touched = |hit: &Hit| hit.is_hit() && mesh.triangles[hit.prim as usize].contains(&0);
        let same = hits.iter().zip(&expected).all(|(a, b)| touched(a) || touched(b) || a == b);
        assert!(same, "{far}");
    }
}

/// Triangles in one corner, each a little larger than the one before.
fn one_inside_the_next(count: usize, growth: f32, seed: u64) -> Geometry {
    let mut rng = Rng::new(seed);
    let mut geometry = Geometry::default();
    for k in 0..count {
        let size = growth.powi(k as i32);
        let first = geometry.positions.len() as u32;
        let height = size * (0.5 + rng.unit());
        geometry.positions.extend([[0.0; 3], [size, 0.0, height], [0.0, size, height]]);
        geometry.triangles.push([first, first + 1, first + 2]);
    }
    geometry
}

#[test]
fn what_a_ray_leaves_is_not_met_again_unless_it_is_round() {
    let mut soup = soup(400, 0.5, 5);
    let (triangles, quads) = (soup.triangles.len() as u32, soup.quads.len() as u32);
    soup.analytic.truncate(20);
    let at = DAffine3::from_translation(Vec3::X.as_dvec3() * 3.0);
    let accel = build(
        &[soup.clone(), soup],
        &[
            AccelInstance { geometry: 1, world_from_object: at },
            AccelInstance { geometry: 1, world_from_object: at },
        ],
    );
    let rays: Vec<Ray> = random_rays(3000, 6)
        .into_iter()
        .flat_map(|ray| [ray, Ray { origin: ray.origin + Vec3::X * 3.0, ..ray }])
        .collect();
    let first = trace(&accel, Level::Scalar, &rays);
    // Start again behind what was met: from there it would be met again by those that are sent back.
    let back = |(ray, hit): (&Ray, &Hit), origin_primitive| Ray {
        origin_primitive,
        ..Ray::new(ray.at(hit.t * 1.001), -ray.direction)
    };
    let met: Vec<(&Ray, &Hit)> = rays.iter().zip(&first).filter(|(_, hit)| hit.is_hit()).collect();
    assert!(met.len() > 1000 && met.iter().any(|(_, h)| h.instance != 0));
    let free: Vec<Ray> = met.iter().map(|&m| back(m, OriginPrimitive::NONE)).collect();
    let leaving: Vec<Ray> = met.iter().map(|&m| back(m, m.1.into())).collect();
    let elsewhere = |h: &Hit| OriginPrimitive { prim: h.prim, instance: h.instance + 7 };
    let others: Vec<Ray> = met.iter().map(|&m| back(m, elsewhere(m.1))).collect();
    let expected = trace(&accel, Level::Scalar, &free);
    for level in Level::ALL.into_iter().filter(|l| l.is_available()) {
        assert_eq!(trace(&accel, level, &others), expected, "{}", level.name());
        let hits = trace(&accel, level, &leaving);
        let (mut again, mut round) = (0, 0);
        for ((hit, free), (_, left)) in hits.iter().zip(&expected).zip(&met) {
            let is_same = |h: &Hit| (h.prim, h.instance) == (left.prim, left.instance);
            if is_same(free) && left.prim < triangles + quads {
                assert!(!is_same(hit), "{}: {left:?}", level.name());
                again += 1;
            } else {
                assert_eq!(hit, free, "{}", level.name());
                round += u32::from(is_same(free));
            }
        }
        assert!(again > 500 && round > 20, "{again} {round}");
    }
}

/// The first triangle's tree would be deeper than any stack, the second one's is deeper than most.
#[test]
fn deep_trees_are_walked_to_their_end() {
    let (world, placed) = (one_inside_the_next(4500, 1.006, 1), one_inside_the_next(700, 1.04, 2));
    let rays: Vec<Ray> = random_rays(600, 3).iter().map(|r| Ray { origin: r.origin.abs(), ..*r }).collect();
    let expected = brute_force(&world, &rays);
    let nearer = |a: &Hit, b: &Hit| if b.t < a.t { Hit { instance: 1, ..*b } } else { *a };
    let of_both: Vec<Hit> =
        expected.iter().zip(&brute_force(&placed, &rays)).map(|(a, b)| nearer(a, b)).collect();
    assert!(expected.iter().filter(|h| h.is_hit()).count() > 100);
    assert!(of_both.iter().filter(|h| h.instance == 1).count() > 10);
    let here = AccelInstance { geometry: 1, world_from_object: DAffine3::IDENTITY };
    let shallow = build(std::slice::from_ref(&world), &[]);
    let deep = build(&[world, placed], &[here]);
    assert!(shallow.stack_size <= ShallowSlot::STACK && deep.stack_size > ShallowSlot::STACK);
    for level in Level::ALL.into_iter().filter(|l| l.is_available()) {
        assert_eq!(trace(&shallow, level, &rays), expected, "{}", level.name());
        assert_eq!(trace(&deep, level, &rays), of_both, "{}", level.name());
    }
}

/// Three of each primitive in the same place, and instances of them there: all are met, one after another in the order of their
/// numbers, where of one of each all are met by rays that start behind the last hit.
#[test]
fn many_primitives_in_one_place_follow_each_other() {
    const MOST: usize = 200;
    let single = soup(300, 0.6, 8);
    let times = |count: usize| Geometry {
        positions: single.positions.clone(),
        triangles: single.triangles.repeat(count),
        quads: single.quads.repeat(count),
        analytic: single.analytic.repeat(count),
        ..Geometry::default()
    };
    let here = AccelInstance { geometry: 1, world_from_object: DAffine3::IDENTITY };
    let one = build(&[times(1)], &[]);
    let many = build(&[times(3), times(2)], &[here, here]);
    let (mut total, mut round) = (0, 0);
    for ray in random_rays(600, 9) {
        let mut expected = Vec::new();
        let mut hit = one.closest_one(&ray);
        while hit.is_hit() {
            expected.push(hit.t);
            hit = one.closest_one(&Ray { t_min: hit.t, ..ray });
        }
        let mut found = Vec::new();
        let mut hit = many.closest_one(&ray);
        while hit.is_hit() && found.len() < MOST * 7 {
            found.push((hit.t, hit.instance, hit.prim));
            hit = many.next_one(&ray, &hit, 0.0);
        }
        assert!(found.is_sorted_by(|a, b| a < b), "{found:?}");
        assert_eq!(found.len(), 7 * expected.len());
        for (k, &(t, instance, prim)) in found.iter().enumerate() {
            assert_eq!(t, expected[k / 7]);
            assert_eq!(instance, [0, 0, 0, 1, 1, 2, 2][k % 7]);
            let first_round = [900 + 90, 600 + 60][usize::from(instance > 0)];
            round += u32::from(prim >= first_round);
        }
        total += found.len();
    }
    assert!(total > 10_000 && round > 500, "{total} {round}");
}
