//! Tests of BVHs: against brute force on all CPU levels, degenerate input, and the build.

use super::traversal::ShallowSlot;
use super::*;
use crate::math::{DAffine3, DQuat, DVec3, NO_HIT, OriginPrimitive, Vec3};
use crate::sampling::hash::SplitMix64;
use crate::shape::{Analytic, CurveSegments, Quad, Sphere};
use crate::work_counter::WorkCounter;

pub struct Rng(SplitMix64);
impl Rng {
    pub fn new(seed: u64) -> Rng {
        Rng(SplitMix64::new(seed))
    }
    pub fn bits(&mut self) -> u32 {
        self.0.next_bits() as u32
    }
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / 16_777_216.0
    }
    pub fn vector(&mut self) -> Vec3 {
        Vec3::new(self.unit() * 2.0 - 1.0, self.unit() * 2.0 - 1.0, self.unit() * 2.0 - 1.0)
    }
}

/// `count` random triangles of extent `size` in a cube of side 2, with a tenth as many quads and spheres.
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

/// The nearest hits by a structure of its own for each primitive.
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

/// Rays through vertices, where edge functions are zero; scales up to nearly [`is_valid_position`]'s limit; ray origins so far away
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
            // From the origin, and along axes, where the shear is zero.
            let along = |axis: Vec3| Ray::new(corner - axis * corner.length(), axis);
            let far = Ray::new(corner * 1e20 + Vec3::Y * scale, -corner / scale);
            [Ray::new(Vec3::ZERO, corner / scale), along(Vec3::X), along(Vec3::Y), along(Vec3::Z), far]
        });
        let rays: Vec<Ray> = rays.collect();
        // Triangles alone, and with other shapes.
        let mut mixed = geometry.clone();
        mixed.quads.push(Quad {
            corner: Vec3::splat(scale),
            edge_u: Vec3::X * scale,
            edge_v: Vec3::Y * scale,
        });
        mixed.analytic.push(Analytic::Sphere(Sphere { center: Vec3::splat(-scale), radius: 0.1 * scale }));
        for geometry in [geometry, mixed] {
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
fn ray_parameters_of_instance_hits_are_in_world_space() {
    let sphere = Geometry {
        analytic: vec![Analytic::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 })],
        ..Geometry::default()
    };
    let flat = soup(100, 0.1, 3);
    let at = |x: f64, scale: f64| AccelInstance {
        geometry: 1,
        world_from_object: DAffine3::from_scale_rotation_translation(
            DVec3::splat(scale),
            DQuat::IDENTITY,
            DVec3::new(x, 0.0, 0.0),
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
fn invalid_rays_hit_nothing() {
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
fn empty_scenes_are_built_and_invalid_primitives_dropped_and_counted() {
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

/// Hundreds of thousands of equal triangles, and concentric triangles of increasing size: quadratic build time would be hours.
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
        world_from_object: DAffine3::from_translation(DVec3::new(
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
    // The last instance is at its place.
    let down = Ray::new(Vec3::new(7.0 * 1.5 + 0.4, 1.0, 31.0 * 1.5 + 0.3), -Vec3::Y);
    assert_eq!(thousand.closest_one(&down).instance, 1000);
}

/// One vertex far from all others. Without the logarithmic map such a mesh took 23 seconds to build and rays were hundreds of times
/// slower.
#[test]
fn one_distant_vertex_does_not_slow_down_the_rest() {
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
        // Only hits of the triangles at that vertex may differ.
        let touched = |hit: &Hit| hit.is_hit() && mesh.triangles[hit.prim as usize].contains(&0);
        let same = hits.iter().zip(&expected).all(|(a, b)| touched(a) || touched(b) || a == b);
        assert!(same, "{far}");
    }
}

/// Nested triangles with a common vertex at the origin; each is larger than the one before by a factor `growth`.
fn nested_triangles(count: usize, growth: f32, seed: u64) -> Geometry {
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
fn rays_skip_their_origin_primitive_unless_it_is_curved() {
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
    // Rays that start just behind a hit and go back would hit its primitive skipped.
    let back = |(ray, hit): (&Ray, &Hit), origin_primitive| Ray {
        origin_primitive,
        ..Ray::new(ray.at(hit.t * 1.001), -ray.direction)
    };
    let hit_rays: Vec<(&Ray, &Hit)> = rays.iter().zip(&first).filter(|(_, hit)| hit.is_hit()).collect();
    assert!(hit_rays.len() > 1000 && hit_rays.iter().any(|(_, h)| h.instance != 0));
    let free: Vec<Ray> = hit_rays.iter().map(|&m| back(m, OriginPrimitive::NONE)).collect();
    let leaving: Vec<Ray> = hit_rays.iter().map(|&m| back(m, m.1.into())).collect();
    let elsewhere = |h: &Hit| OriginPrimitive { prim: h.prim, instance: h.instance + 7 };
    let others: Vec<Ray> = hit_rays.iter().map(|&m| back(m, elsewhere(m.1))).collect();
    let expected = trace(&accel, Level::Scalar, &free);
    for level in Level::ALL.into_iter().filter(|l| l.is_available()) {
        assert_eq!(trace(&accel, level, &others), expected, "{}", level.name());
        let hits = trace(&accel, level, &leaving);
        let (mut skipped, mut round) = (0, 0);
        for ((hit, free), (_, left)) in hits.iter().zip(&expected).zip(&hit_rays) {
            let is_same = |h: &Hit| (h.prim, h.instance) == (left.prim, left.instance);
            if is_same(free) && left.prim < triangles + quads {
                assert!(!is_same(hit), "{}: {left:?}", level.name());
                skipped += 1;
            } else {
                assert_eq!(hit, free, "{}", level.name());
                round += u32::from(is_same(free));
            }
        }
        assert!(skipped > 500 && round > 20, "{skipped} {round}");
    }
}

/// The tree of the first geometry would be too deep for any stack; that of the second is too deep for [`ShallowSlot`].
#[test]
fn deep_trees_are_traversed_completely() {
    let (world, placed) = (nested_triangles(4500, 1.006, 1), nested_triangles(700, 1.04, 2));
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

/// Three copies of each primitive and two instances with two copies each, all coincident: [`Accel::closest_after`] enumerates all seven
/// copies of each hit in the order of instances and ids.
#[test]
fn next_one_enumerates_coincident_primitives_in_order() {
    const MAX: usize = 200;
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
        while hit.is_hit() && found.len() < MAX * 7 {
            found.push((hit.t, hit.instance, hit.prim));
            hit = many.closest_after(&ray, &hit, 0.0);
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

// Tree qualities, chunked builds and numbers of threads.

const BOTH: [TreeQuality; 2] = [TreeQuality::Fast, TreeQuality::Full];

fn build_quality(geometries: &[&Geometry], instances: &[AccelInstance], quality: TreeQuality) -> Accel {
    let accel = try_build(geometries, instances, quality, None).expect("it can be addressed");
    accel.validate().expect("valid");
    assert_eq!(accel.stats().quality, quality);
    accel
}

fn trace_both(accel: &Accel, rays: &[Ray]) -> (Vec<Hit>, Vec<bool>) {
    let (mut hits, mut occluded) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
    accel.closest_at(best_level(), rays, &mut hits);
    accel.occluded_at(best_level(), rays, &mut occluded);
    (hits, occluded)
}

/// A curved sheet of `2 n n` triangles.
pub fn sheet(n: u32) -> Geometry {
    let mut sheet = Geometry::default();
    for (x, y) in (0..=n).flat_map(|y| (0..=n).map(move |x| (x as f32 / n as f32, y as f32 / n as f32))) {
        sheet.positions.push([x - 0.5, y - 0.5, 0.02 * (9.0 * x).sin() * (7.0 * y).cos()]);
    }
    for (x, y) in (0..n).flat_map(|y| (0..n).map(move |x| (x, y))) {
        let a = y * (n + 1) + x;
        sheet.triangles.extend([[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]);
    }
    sheet
}

/// The small soup is built in chunks only at fast quality, the large one at both.
#[test]
fn qualities_give_the_same_hits() {
    let (small, large) = (soup(15_000, 0.05, 11), soup(225_000, 0.02, 12));
    let rays = random_rays(20_000, 13);
    for (geometry, sizes) in [(&small, 17_000..20_000), (&large, 265_000..275_000)] {
        let [fast, full] = BOTH.map(|quality| build_quality(&[geometry], &[], quality));
        let stats = full.stats();
        let all = stats.triangles + stats.quads + stats.analytic.iter().sum::<u64>();
        assert!(sizes.contains(&all), "{all}");
        let hits = trace_both(&fast, &rays);
        assert!(hits.0.iter().filter(|hit| hit.is_hit()).count() > 3_000);
        assert!(hits == trace_both(&full, &rays));
    }
}

/// Rays through vertices and edges, where several triangles are hit at the same distance. (Not edge-on: see [`TreeQuality`].)
#[test]
fn ties_do_not_depend_on_the_tree() {
    let sheet = sheet(300);
    let mut rng = Rng::new(5);
    let through_edges: Vec<Ray> = (0..20_000)
        .map(|_| {
            let [a, b, _] = sheet.triangles[(rng.unit() * sheet.triangles.len() as f32) as usize];
            let [a, b] = [a, b].map(|i| Vec3::from_array(sheet.positions[i as usize]));
            let at = if rng.unit() < 0.5 { a } else { a * 0.5 + b * 0.5 };
            let aside = if rng.unit() < 0.5 { Vec3::ZERO } else { rng.vector() * 0.5 };
            let from = at + Vec3::Z + aside;
            Ray::new(from, at - from)
        })
        .collect();
    let mut twice = sheet.clone();
    twice.triangles.extend_from_slice(&sheet.triangles);
    for geometry in [&sheet, &twice] {
        let [fast, full] =
            BOTH.map(|quality| trace_both(&build_quality(&[geometry], &[], quality), &through_edges));
        assert!(fast == full);
        // Of two equal triangles the first is hit.
        assert!(full.0.iter().all(|hit| !hit.is_hit() || (hit.prim as usize) < sheet.triangles.len()));
    }
}

/// A ground triangle thousands of times larger than the mesh on it.
#[test]
fn a_large_ground_does_not_degrade_the_tree() {
    let alone = sheet(400);
    let mut grounded = alone.clone();
    let first = grounded.positions.len() as u32;
    let far = 2000.0f32;
    grounded.positions.extend([[-far, -far, -1.0], [far, -far, -1.0], [0.0, far, -1.0]]);
    grounded.triangles.push([first, first + 1, first + 2]);
    for quality in BOTH {
        let bytes = [&alone, &grounded].map(|g| build_quality(&[g], &[], quality).stats().bytes as f64);
        assert!(bytes[1] < 1.02 * bytes[0], "{quality:?}: {bytes:?}");
    }
}

#[test]
fn trees_over_many_instances_are_built_in_chunks() {
    let (world, object) = (soup(100, 0.1, 3), soup(20_000, 0.05, 4));
    let mut rng = Rng::new(6);
    let mut place = || AccelInstance {
        geometry: 1,
        world_from_object: DAffine3::from_scale(DVec3::splat(0.02))
            * DAffine3::from_translation(rng.vector().as_dvec3() * 40.0),
    };
    let instances: Vec<AccelInstance> = (0..17_000).map(|_| place()).collect();
    let rays = random_rays(5_000, 9);
    let [fast, full] = BOTH.map(|quality| {
        let accel = build_quality(&[&world, &object], &instances, quality);
        assert_eq!(accel.stats().instances, 17_000);
        trace_both(&accel, &rays)
    });
    assert!(fast.0.iter().filter(|hit| hit.instance > 0).count() > 1000);
    assert!(fast == full);
}

#[test]
fn threads_do_not_change_the_buffer() {
    let geometry = soup(225_000, 0.02, 21);
    for quality in BOTH {
        let lines = |threads: usize| -> Vec<Line> {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| build_quality(&[&geometry], &[], quality)).lines
        };
        let one = lines(1);
        for threads in [2, 5] {
            let many = lines(threads);
            assert!(bytemuck::cast_slice::<Line, u8>(&one) == bytemuck::cast_slice::<Line, u8>(&many));
        }
    }
}

/// Cases where splits by centroid fail: coincident, coincident but for one, on a line, nested, exponentially spaced.
#[test]
fn primitives_with_degenerate_centroids_are_built() {
    let triangle =
        |at: Vec3, size: f32| [at, at + Vec3::X * size, at + Vec3::Y * size].map(|p: Vec3| p.to_array());
    let of = |count: usize, place: &dyn Fn(usize) -> [[f32; 3]; 3]| {
        let mut geometry = Geometry::default();
        for i in 0..count {
            geometry.positions.extend(place(i));
            geometry.triangles.push([0, 1, 2].map(|k| 3 * i as u32 + k));
        }
        geometry
    };
    let far = |i: usize| if i == 77 { 1e12 } else { 0.5 };
    let cases = [
        of(270_000, &|_| triangle(Vec3::ZERO, 1.0)),
        of(270_000, &|i| triangle(Vec3::new(far(i), 0.0, 0.0), 1.0)),
        of(270_000, &|i| triangle(Vec3::X * i as f32, 0.5)),
        of(270_000, &|i| triangle(Vec3::splat(-0.5 - i as f32 * 1e-5), 1.0 + i as f32 * 3e-5)),
        of(17_000, &|i| triangle(Vec3::X * 1.004f32.powi(i as i32 % 8_000), 0.5)),
    ];
    for geometry in &cases {
        let t = geometry.triangles[geometry.triangles.len() - 1].map(|i| geometry.positions[i as usize]);
        let [a, b, c] = t.map(Vec3::from_array);
        let inside = a * 0.6 + b * 0.2 + c * 0.2;
        let ray = Ray::new(inside + Vec3::Z, -Vec3::Z);
        let [fast, full] = BOTH.map(|quality| trace_both(&build_quality(&[geometry], &[], quality), &[ray]));
        assert!(fast.0[0].is_hit() && fast == full, "{:?} {:?}", fast.0, full.0);
    }
}

#[test]
fn fast_trees_of_one_or_no_primitive_are_built() {
    let ray = Ray::new(Vec3::new(0.1, 0.1, 1.0), -Vec3::Z);
    let one = Geometry {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        triangles: vec![[0, 1, 2]],
        ..Geometry::default()
    };
    assert!(build_quality(&[&one], &[], TreeQuality::Fast).closest_one(&ray).is_hit());
    assert!(!build_quality(&[&Geometry::default()], &[], TreeQuality::Fast).closest_one(&ray).is_hit());
}

// Many geometries: time, memory and results of the build.

fn try_build(
    geometries: &[&Geometry],
    instances: &[AccelInstance],
    quality: TreeQuality,
    counter: Option<&WorkCounter>,
) -> Result<Accel, TooLarge> {
    let (first_moving, first_changing) = (instances.len(), geometries.len());
    let moving = &[];
    Accel::try_build(&AccelInput {
        geometries,
        instances,
        first_moving,
        first_changing,
        moving,
        quality,
        counter,
    })
}

/// Two instances of each geometry but the first.
fn two_of_each(geometries: usize) -> Vec<AccelInstance> {
    let place = |i: usize| AccelInstance {
        geometry: (1 + i % (geometries - 1)) as u32,
        world_from_object: DAffine3::from_translation(DVec3::new(i as f64 * 2.5, 0.0, 0.0)),
    };
    (0..2 * (geometries - 1)).map(place).collect()
}

/// Geometries of various sizes; the second is by far the largest, so it delays appending the others.
fn geometries(count: usize) -> Vec<Geometry> {
    let size = |i: usize| if i == 1 { 30_000 } else { 20 + i * 37 % 1500 };
    (0..count).map(|i| soup(size(i), 0.1, i as u64)).collect()
}

#[test]
fn threads_do_not_change_the_buffer_of_many_geometries() {
    let geometries = geometries(60);
    let (geometries, instances): (Vec<&Geometry>, _) = (geometries.iter().collect(), two_of_each(60));
    for quality in [TreeQuality::Fast, TreeQuality::Full] {
        let lines = |threads: usize| -> Vec<Line> {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let accel = pool.install(|| try_build(&geometries, &instances, quality, None)).expect("small");
            accel.validate().expect("valid");
            accel.lines
        };
        let one = lines(1);
        for threads in [2, 5] {
            let many = lines(threads);
            assert!(bytemuck::cast_slice::<Line, u8>(&one) == bytemuck::cast_slice::<Line, u8>(&many));
        }
    }
}

/// Memory is reserved once and close to the estimate, so the buffer is never reallocated.
#[test]
fn buffers_of_many_geometries_do_not_grow() {
    for count in [10, 100, 400] {
        let geometries: Vec<Geometry> = (0..count).map(|i| sheet(if i == 1 { 120 } else { 23 })).collect();
        let (geometries, instances): (Vec<&Geometry>, _) = (geometries.iter().collect(), two_of_each(count));
        for quality in [TreeQuality::Fast, TreeQuality::Full] {
            let accel = try_build(&geometries, &instances, quality, None).expect("small");
            let (first_moving, first_changing) = (instances.len(), geometries.len());
            let (geometries, instances) = (&geometries[..], &instances[..]);
            let (moving, counter) = (&[], None);
            let input =
                AccelInput { geometries, instances, first_moving, first_changing, moving, quality, counter };
            let bytes = (accel.lines.capacity() * size_of::<Line>()) as u64;
            let estimate = Estimate::of(&input);
            let is_room = estimate.bytes <= bytes && bytes < estimate.bytes + 1000;
            assert!(is_room, "{count} {quality:?}: {bytes} {}", estimate.bytes);
        }
    }
}

/// Memory estimates per type of primitive bound the actual memory.
#[test]
fn memory_estimates_are_near_upper_bounds() {
    let mut rng = Rng::new(3);
    // Triangles of a connected surface; scattered ones take more memory because packets are emptier.
    let (all, surface) = (soup(20_000, 0.03, 5), sheet(100));
    let mut strands = CurveSegments::EMPTY;
    for strand in 0..400u32 {
        let (root, way) = (rng.vector(), rng.vector() * 0.01);
        for i in 0..20u32 {
            let p: Vec3 = root + way * i as f32 + rng.vector() * 0.002;
            strands.points.push([p.x, p.y, p.z, 0.002]);
            strands.tangents.push([0.0; 3]);
            strands.segments.extend((i < 19).then_some(strand * 20 + i));
        }
    }
    let moved = |by: f32| surface.positions.iter().map(|p| p.map(|x| x + by)).collect();
    let kinds = [
        surface.clone(),
        Geometry { quads: all.quads.clone(), ..Geometry::default() },
        Geometry { analytic: all.analytic.clone(), ..Geometry::default() },
        Geometry { curves: strands, ..Geometry::default() },
        Geometry { keys: vec![moved(0.0), moved(0.01), moved(0.0)], ..surface.clone() },
    ];
    for (i, geometry) in kinds.iter().enumerate() {
        let mut estimate = Estimate::default();
        estimate.add_geometry(geometry);
        let bytes = Accel::build(std::slice::from_ref(geometry), &[]).stats().bytes;
        let is_near = (estimate.bytes / 3..=estimate.bytes * 11 / 10).contains(&bytes);
        assert!(is_near, "{i}: {bytes} {}", estimate.bytes);
    }
    let one = Geometry { analytic: all.analytic[..1].to_vec(), ..Geometry::default() };
    let place = |_| AccelInstance {
        geometry: 1,
        world_from_object: DAffine3::from_translation(rng.vector().as_dvec3() * 20.0),
    };
    let instances: Vec<AccelInstance> = (0..5000).map(place).collect();
    let bytes = Accel::build(&[Geometry::default(), one], &instances).stats().bytes;
    let mut estimate = Estimate::default();
    estimate.add_instances(instances.len());
    assert!((estimate.bytes / 3..=estimate.bytes).contains(&bytes), "{bytes} {}", estimate.bytes);
}

#[test]
fn progress_counts_built_primitives_and_ends_at_one() {
    let all = geometries(40);
    let mut geometries: Vec<&Geometry> = all.iter().collect();
    let instances = two_of_each(40);
    // Without an instance, so not built.
    let unused = soup(50_000, 0.1, 1);
    geometries.push(&unused);
    let mut broken = soup(20_000, 0.1, 2);
    broken.triangles[5] = [0, 0, 0];
    geometries[0] = &broken;
    for quality in [TreeQuality::Fast, TreeQuality::Full] {
        let counter = WorkCounter::default();
        let accel = try_build(&geometries, &instances, quality, Some(&counter)).expect("small");
        assert_eq!(counter.share(), Some(1.0));
        assert_eq!(accel.stats().dropped.degenerate, 1);
        let primitives: usize = geometries[..40].iter().map(|g| g.primitives()).sum();
        assert_eq!(
            counter.counts(),
            (2 * (primitives + instances.len()) as u64, 2 * (primitives + instances.len()) as u64)
        );
    }
}

/// Triangles with a hundred thousand empty motion keys, which are never read.
#[test]
fn scenes_beyond_the_address_range_are_refused_before_building() {
    let mut large = soup(10_000, 0.1, 2);
    large.keys = vec![Vec::new(); 100_000];
    let counter = WorkCounter::default();
    let error = try_build(&[&large], &[], TreeQuality::Full, Some(&counter)).err().expect("too large");
    assert!(error.to_string().contains("10000 triangles"), "{error}");
    assert_eq!(counter.share(), None);
    // Geometry without an instance does not count.
    assert!(try_build(&[&Geometry::default(), &large], &[], TreeQuality::Full, None).is_ok());
}
