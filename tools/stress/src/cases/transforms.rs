//! Instances under non-uniform scales, mirroring and shear, far from the origin and re-based in f64.

use super::Row;
use super::meshes::{Random, Shape, ball, closest};
use oscura::accel::{Accel, AccelInstance, Geometry};
use oscura::math::{DAffine3, DMat3, DQuat, DVec3, Ray, Vec3};

/// Rays of the full run.
const RAYS: f64 = 2e6;
/// Rays per transform.
const EACH: usize = 1000;

pub fn run(effort: f64) -> Vec<Row> {
    let shape = ball(4);
    let geometries = [Geometry::default(), shape.geometry(1.0, DVec3::ZERO)];
    let transforms = (RAYS * effort / EACH as f64).ceil() as usize;
    let mut random = Random::new(11);
    let (mut wrong, mut worst) = (0, 0.0f64);
    for i in 0..transforms {
        let world_from_object = transform(&mut random, i);
        let instance = AccelInstance { geometry: 1, world_from_object };
        let accel = Accel::build(&geometries, &[instance]);
        // From inside, in object space, transformed to world space: each ray must hit.
        for _ in 0..EACH {
            let from = world_from_object.transform_point3(random.signed() * 0.3);
            let to = shape.points[random.bits() as usize % shape.points.len()];
            let to = world_from_object.transform_point3(to);
            let ray = Ray::new(from.as_vec3(), (to - from).as_vec3());
            let hit = accel.closest_one(&ray);
            // The true distance is 1, since rays aim at vertices.
            let error = (f64::from(hit.t) - 1.0).abs();
            worst = worst.max(error);
            wrong +=
                u64::from(!hit.is_hit() || hit.instance != 1 || hit.prim as usize >= shape.triangles.len());
        }
    }
    let uneven = uneven(effort, &shape, &geometries);
    let singular =
        AccelInstance { geometry: 1, world_from_object: DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)) };
    let accel = Accel::build(&geometries, &[singular]);
    let dropped = accel.stats().dropped.instances == 1;
    vec![
        Row {
            what: "transforms: scales 1e-4 to 1e4 an axis, mirrored, sheared, re-based from 1e9: leaks"
                .into(),
            tried: (transforms * EACH) as u64,
            wrong,
            worst: format!("t off by {worst:.1e} of 1"),
        },
        uneven,
        Row {
            what: "transforms: singular, dropped and counted".into(),
            tried: 1,
            wrong: u64::from(!dropped),
            worst: "-".into(),
        },
    ]
}

/// Axes scaled by 1e-4 to 1e4 independently: rays from the centre, which rounds to itself, must hit.
fn uneven(effort: f64, shape: &Shape, geometries: &[Geometry; 2]) -> Row {
    let transforms = (RAYS * effort / EACH as f64).ceil() as usize;
    let mut random = Random::new(12);
    let mut wrong = 0;
    for _ in 0..transforms {
        let mut scale = || {
            let sign = if random.bits().is_multiple_of(2) { 1.0 } else { -1.0 };
            sign * random.power(-4.0, 4.0)
        };
        let scale = DVec3::new(scale(), scale(), scale());
        let rotation = DQuat::from_axis_angle(random.signed().normalize(), random.unit() * 6.0);
        let world_from_object = DAffine3::from_scale_rotation_translation(scale, rotation, DVec3::ZERO);
        let accel = Accel::build(geometries, &[AccelInstance { geometry: 1, world_from_object }]);
        let rays: Vec<Ray> = (0..EACH)
            .map(|_| {
                let to = shape.points[random.bits() as usize % shape.points.len()];
                Ray::new(Vec3::ZERO, world_from_object.transform_point3(to).as_vec3())
            })
            .collect();
        wrong += closest(&accel, &rays).iter().filter(|hit| !hit.is_hit()).count() as u64;
    }
    Row {
        what: "transforms: scales 1e-4 to 1e4, each axis its own, from the middle: leaks".into(),
        tried: (transforms * EACH) as u64,
        wrong,
        worst: "-".into(),
    }
}

/// A random transform; every second one is 1e9 away, together with the re-based origin.
fn transform(random: &mut Random, index: usize) -> DAffine3 {
    let common = random.power(-3.0, 3.0);
    let mut scale = || {
        let sign = if random.bits().is_multiple_of(2) { 1.0 } else { -1.0 };
        sign * common * random.power(-1.0, 1.0)
    };
    let scale = DVec3::new(scale(), scale(), scale());
    let axis = random.signed().normalize();
    let rotation = DMat3::from_quat(DQuat::from_axis_angle(axis, random.unit() * 6.0));
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(random.unit(), 1.0, 0.0), DVec3::Z);
    let matrix = rotation * shear * DMat3::from_diagonal(scale);
    let far =
        DAffine3::from_translation(if index.is_multiple_of(2) { DVec3::ZERO } else { DVec3::splat(1e9) });
    let near = DAffine3 { matrix3: matrix, translation: random.signed() * scale.abs().min_element() };
    far.inverse() * (far * near)
}
