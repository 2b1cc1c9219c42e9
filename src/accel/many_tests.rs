//! Many geometries: what building them takes is in proportion, and the same whatever builds them.

use super::tests::{Rng, soup};
use super::tree_tests::sheet;
use super::{Accel, AccelInput, AccelInstance, Estimate, Geometry, TooLarge, TreeQuality};
use crate::gauge::Gauge;
use crate::math::{DAffine3, Vec3};
use crate::shape::CurveSegments;
use crate::simd::Line;

fn build(
    geometries: &[&Geometry],
    instances: &[AccelInstance],
    quality: TreeQuality,
    gauge: Option<&Gauge>,
) -> Result<Accel, TooLarge> {
    let (first_moving, first_changing) = (instances.len(), geometries.len());
    let moving = &[];
    Accel::build_parts(&AccelInput {
        geometries,
        instances,
        first_moving,
        first_changing,
        moving,
        quality,
        gauge,
    })
}

/// Twice each geometry but the first.
fn placed(geometries: usize) -> Vec<AccelInstance> {
    let place = |i: usize| AccelInstance {
        geometry: (1 + i % (geometries - 1)) as u32,
        world_from_object: DAffine3::from_translation(glam::DVec3::new(i as f64 * 2.5, 0.0, 0.0)),
    };
    (0..2 * (geometries - 1)).map(place).collect()
}

/// Geometries of all sizes, of which the second is the largest: others wait for it.
fn geometries(count: usize) -> Vec<Geometry> {
    let size = |i: usize| if i == 1 { 30_000 } else { 20 + i * 37 % 1500 };
    (0..count).map(|i| soup(size(i), 0.1, i as u64)).collect()
}

#[test]
fn threads_do_not_change_the_buffer_of_many_geometries() {
    let geometries = geometries(60);
    let (geometries, instances): (Vec<&Geometry>, _) = (geometries.iter().collect(), placed(60));
    for quality in [TreeQuality::Fast, TreeQuality::Full] {
        let lines = |threads: usize| -> Vec<Line> {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let accel = pool.install(|| build(&geometries, &instances, quality, None)).expect("small");
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

/// Room is made once for all, and not much more than is needed: nothing is moved while it is built.
#[test]
fn buffers_of_many_geometries_do_not_grow() {
    for count in [10, 100, 400] {
        let geometries: Vec<Geometry> = (0..count).map(|i| sheet(if i == 1 { 120 } else { 23 })).collect();
        let (geometries, instances): (Vec<&Geometry>, _) = (geometries.iter().collect(), placed(count));
        for quality in [TreeQuality::Fast, TreeQuality::Full] {
            let accel = build(&geometries, &instances, quality, None).expect("small");
            let (first_moving, first_changing) = (instances.len(), geometries.len());
            let (geometries, instances) = (&geometries[..], &instances[..]);
            let (moving, gauge) = (&[], None);
            let input =
                AccelInput { geometries, instances, first_moving, first_changing, moving, quality, gauge };
            let bytes = (accel.lines.capacity() * size_of::<Line>()) as u64;
            let estimate = Estimate::of(&input);
            let is_room = estimate.bytes <= bytes && bytes < estimate.bytes + 1000;
            assert!(is_room, "{count} {quality:?}: {bytes} {}", estimate.bytes);
        }
    }
}

/// Of what estimates are made of, each alone.
#[test]
fn estimates_hold() {
    let mut rng = Rng::new(3);
    // Triangles of a surface: those that are strewn about take more, for packets are emptier.
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
fn progress_counts_what_is_built_and_ends_where_all_is() {
    let all = geometries(40);
    let mut geometries: Vec<&Geometry> = all.iter().collect();
    let instances = placed(40);
    // Nothing places it: it is not built.
    let unused = soup(50_000, 0.1, 1);
    geometries.push(&unused);
    let mut broken = soup(20_000, 0.1, 2);
    broken.triangles[5] = [0, 0, 0];
    geometries[0] = &broken;
    for quality in [TreeQuality::Fast, TreeQuality::Full] {
        let gauge = Gauge::default();
        let accel = build(&geometries, &instances, quality, Some(&gauge)).expect("small");
        assert_eq!(gauge.share(), Some(1.0));
        assert_eq!(accel.stats().dropped.degenerate, 1);
        let primitives: usize = geometries[..40].iter().map(|g| g.primitives()).sum();
        assert_eq!(
            gauge.counts(),
            (2 * (primitives + instances.len()) as u64, 2 * (primitives + instances.len()) as u64)
        );
    }
}

/// Triangles at a hundred thousand keys: none of these are read.
#[test]
fn what_cannot_be_addressed_is_refused_before_work() {
    let mut large = soup(10_000, 0.1, 2);
    large.keys = vec![Vec::new(); 100_000];
    let gauge = Gauge::default();
    let error = build(&[&large], &[], TreeQuality::Full, Some(&gauge)).err().expect("too large");
    assert!(error.to_string().contains("10000 triangles"), "{error}");
    assert_eq!(gauge.share(), None);
    // Unless nothing places it.
    assert!(build(&[&Geometry::default(), &large], &[], TreeQuality::Full, None).is_ok());
}
