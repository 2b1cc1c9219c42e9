//! Rays leaving a surface must not hit it again, and must hit closely adjacent geometry.

use super::Row;
use super::meshes::{Random, ball, build, closest, cube, vertices};
use oscura::accel::Geometry;
use oscura::math::{DVec3, Ray, Vec3, gamma, offset_ray_origin};
use oscura::shape::Quad;

/// Tries of the full run, per transform.
const TRIES: f64 = 4e5;

pub fn run(effort: f64) -> Vec<Row> {
    let count = (TRIES * effort).ceil() as usize;
    let (mut own, mut plates) = (row("self-hits: leaving convex meshes"), row("contacts: plates 1e-5 apart"));
    for power in [-6, -3, 0, 3, 6] {
        let scale = 10f64.powi(power);
        for sizes in [0.0, 1.0, 100.0, 1000.0] {
            let offset = DVec3::new(0.9, 0.5, -0.7) * sizes * scale;
            for shape in [ball(4), cube(8)] {
                own.wrong += self_hits(&shape.geometry(scale, offset), count);
                own.tried += count as u64;
            }
        }
        plates.wrong += missed_contacts(scale as f32, count);
        plates.tried += count as u64;
    }
    vec![own, plates]
}

fn row(what: &str) -> Row {
    Row { what: what.into(), tried: 0, wrong: 0, worst: "-".into() }
}

/// Random directions to the outer side from random points of a convex mesh: these hit nothing, except neighbours turned front-
/// facing by rounding, which are identified by their distance.
fn self_hits(geometry: &Geometry, count: usize) -> u64 {
    let accel = build(geometry);
    let mut random = Random::new(count as u64);
    let mut ids = Vec::with_capacity(count);
    let rays: Vec<Ray> = (0..count)
        .map(|_| {
            let id = random.bits() % geometry.triangles.len() as u32;
            ids.push(id);
            let [a, b, c] = vertices(geometry, id);
            let (mut u, mut v) = (random.unit() as f32, random.unit() as f32);
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let w = 1.0 - u - v;
            let p = a * w + b * u + c * v;
            let error = ((a * w).abs() + (b * u).abs() + (c * v).abs()) * gamma(7);
            let n = (b - a).cross(c - a).normalize_or_zero();
            let d = random.signed().as_vec3();
            let d = if d.dot(n) < 0.0 { -d } else { d };
            Ray::new(offset_ray_origin(p, error, n, d), d)
        })
        .collect();
    let hits = closest(&accel, &rays);
    hits.iter().zip(&ids).filter(|(hit, id)| hit.is_hit() && hit.prim == **id).count() as u64
}

/// Rays from one plate through another one right above it.
fn missed_contacts(scale: f32, count: usize) -> u64 {
    let plate = |y: f32| Quad {
        corner: Vec3::new(-1.0, y, -1.0) * scale,
        edge_u: Vec3::X * 2.0 * scale,
        edge_v: Vec3::Z * 2.0 * scale,
    };
    let gap = 1e-5;
    let accel = build(&Geometry { quads: vec![plate(0.0), plate(gap)], ..Geometry::default() });
    let mut random = Random::new(3);
    let rays: Vec<Ray> = (0..count)
        .map(|_| {
            let p = random.signed() * 0.5;
            let p = Vec3::new(p.x as f32, 0.0, p.z as f32) * scale;
            let mut d = random.signed().as_vec3();
            d.y = d.y.abs() + 0.01;
            Ray::new(offset_ray_origin(p, p.abs() * gamma(7), Vec3::Y, d), d)
        })
        .collect();
    closest(&accel, &rays).iter().filter(|hit| hit.prim != 1).count() as u64
}
