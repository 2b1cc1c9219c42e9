//! Trees of either quality, whole and in pieces: the same hits, whatever they are built over and by how many threads.

use super::tests::{Rng, soup};
use super::{Accel, AccelInput, AccelInstance, Geometry, TreeQuality};
use crate::math::{DAffine3, DVec3, Hit, Ray, Vec3};
use crate::simd::{Line, best_level};

const BOTH: [TreeQuality; 2] = [TreeQuality::Fast, TreeQuality::Full];

fn build(geometries: &[&Geometry], instances: &[AccelInstance], quality: TreeQuality) -> Accel {
    let (first_moving, first_changing) = (instances.len(), geometries.len());
    let accel = Accel::build_parts(&AccelInput {
        geometries,
        instances,
        first_moving,
        first_changing,
        moving: &[],
        quality,
        gauge: None,
    })
    .expect("it can be addressed");
    accel.validate().expect("valid");
    assert_eq!(accel.stats().quality, quality);
    accel
}

fn rays(count: usize, seed: u64) -> Vec<Ray> {
    let mut rng = Rng::new(seed);
    (0..count).map(|_| Ray::new(rng.vector() * 1.5, rng.vector())).collect()
}

fn trace(accel: &Accel, rays: &[Ray]) -> (Vec<Hit>, Vec<bool>) {
    let (mut hits, mut occluded) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
    accel.closest_at(best_level(), rays, &mut hits);
    accel.occluded_at(best_level(), rays, &mut occluded);
    (hits, occluded)
}

/// A sheet of `2 n n` triangles with bends.
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

/// Small soups are built whole at full quality and in pieces at fast; large ones in pieces at both.
#[test]
fn qualities_give_the_same_hits() {
    let (small, large) = (soup(15_000, 0.05, 11), soup(225_000, 0.02, 12));
    let rays = rays(20_000, 13);
    for (geometry, sizes) in [(&small, 17_000..20_000), (&large, 265_000..275_000)] {
        let [fast, full] = BOTH.map(|quality| build(&[geometry], &[], quality));
        let stats = full.stats();
        let all = stats.triangles + stats.quads + stats.analytic.iter().sum::<u64>();
        assert!(sizes.contains(&all), "{all}");
        let hits = trace(&fast, &rays);
        assert!(hits.0.iter().filter(|hit| hit.is_hit()).count() > 3_000);
        assert!(hits == trace(&full, &rays));
    }
}

/// Rays through vertices and edges, where several triangles are equally near. (None of them edge-on: what is met at such a
/// triangle's border may lie before its box by more than the roundings that the search allows for, so that it counts if the
/// box comes first, and else not.)
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
        let [fast, full] = BOTH.map(|quality| trace(&build(&[geometry], &[], quality), &through_edges));
        assert!(fast == full);
        // The first of two equal triangles.
        assert!(full.0.iter().all(|hit| !hit.is_hit() || (hit.prim as usize) < sheet.triangles.len()));
    }
}

/// A ground thousands of times as large as what stands on it, whose triangles are then next to nothing.
#[test]
fn a_large_ground_does_not_spoil_the_tree() {
    let alone = sheet(400);
    let mut grounded = alone.clone();
    let first = grounded.positions.len() as u32;
    let far = 2000.0f32;
    grounded.positions.extend([[-far, -far, -1.0], [far, -far, -1.0], [0.0, far, -1.0]]);
    grounded.triangles.push([first, first + 1, first + 2]);
    for quality in BOTH {
        let bytes = [&alone, &grounded].map(|g| build(&[g], &[], quality).stats().bytes as f64);
        assert!(bytes[1] < 1.02 * bytes[0], "{quality:?}: {bytes:?}");
    }
}

#[test]
fn placements_are_built_in_pieces_too() {
    let (world, object) = (soup(100, 0.1, 3), soup(20_000, 0.05, 4));
    let mut rng = Rng::new(6);
    let mut place = || AccelInstance {
        geometry: 1,
        world_from_object: DAffine3::from_scale(DVec3::splat(0.02))
            * DAffine3::from_translation(rng.vector().as_dvec3() * 40.0),
    };
    let instances: Vec<AccelInstance> = (0..17_000).map(|_| place()).collect();
    let rays = rays(5_000, 9);
    let [fast, full] = BOTH.map(|quality| {
        let accel = build(&[&world, &object], &instances, quality);
        assert_eq!(accel.stats().instances, 17_000);
        trace(&accel, &rays)
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
            pool.install(|| build(&[&geometry], &[], quality)).lines
        };
        let one = lines(1);
        for threads in [2, 5] {
            let many = lines(threads);
            assert!(bytemuck::cast_slice::<Line, u8>(&one) == bytemuck::cast_slice::<Line, u8>(&many));
        }
    }
}

/// Where cutting by position fails: all in one place, all but one, on a line, each within the next, each twice as far.
#[test]
fn what_cannot_be_cut_is_built_all_the_same() {
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
        let [fast, full] = BOTH.map(|quality| trace(&build(&[geometry], &[], quality), &[ray]));
        assert!(fast.0[0].is_hit() && fast == full, "{:?} {:?}", fast.0, full.0);
    }
}

#[test]
fn few_or_no_primitives_have_fast_trees() {
    let ray = Ray::new(Vec3::new(0.1, 0.1, 1.0), -Vec3::Z);
    let one = Geometry {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        triangles: vec![[0, 1, 2]],
        ..Geometry::default()
    };
    assert!(build(&[&one], &[], TreeQuality::Fast).closest_one(&ray).is_hit());
    assert!(!build(&[&Geometry::default()], &[], TreeQuality::Fast).closest_one(&ray).is_hit());
}
