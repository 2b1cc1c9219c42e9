//! Quads at grazing angles, directions with zero, denormal and negative zero components, and unnormalised directions.

use super::Row;
use super::meshes::{Random, ball, build, closest};
use oscura::accel::Geometry;
use oscura::math::{DVec3, Ray, Vec3};
use oscura::shape::Quad;

/// Tries of the full run, per row.
const TRIES: f64 = 1e6;

pub fn run(effort: f64) -> Vec<Row> {
    let count = (TRIES * effort).ceil() as usize;
    vec![grazing(count, true), grazing(count, false), odd_directions(count), lengths(count)]
}

/// Rays descending by 1e-7 to 1 per unit length towards the plane y = 0, compared with f64. In a band around the edges, below
/// f32 resolution, either result is accepted.
fn grazing(count: usize, quad: bool) -> Row {
    let square = Quad { corner: Vec3::new(-1.0, 0.0, -1.0), edge_u: Vec3::X * 2.0, edge_v: Vec3::Z * 2.0 };
    let geometry = if quad {
        Geometry { quads: vec![square], ..Geometry::default() }
    } else {
        let corner = |x: f32, z: f32| [x, 0.0, z];
        Geometry {
            positions: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Geometry::default()
        }
    };
    let accel = build(&geometry);
    let mut random = Random::new(31);
    let rays: Vec<Ray> = (0..count)
        .map(|_| {
            let slope = random.power(-7.0, 0.0);
            let way = 3.0 * random.unit();
            let angle = random.unit() * std::f64::consts::TAU;
            let along = DVec3::new(angle.cos(), 0.0, angle.sin());
            let start = random.signed() * DVec3::new(1.0, 0.0, 1.0) - along * way + DVec3::Y * (slope * way);
            Ray::new(start.as_vec3(), (along - DVec3::Y * slope).as_vec3())
        })
        .collect();
    let (mut wrong, mut worst) = (0, 0.0f64);
    for (ray, hit) in rays.iter().zip(closest(&accel, &rays)) {
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let t = -o.y / d.y;
        let p = o + d * t;
        let inside = 1.0 - p.x.abs().max(p.z.abs());
        let expected = t > 0.0 && inside > 0.0;
        if hit.is_hit() != expected {
            wrong += u64::from(inside.abs() > 1e-5);
        } else if expected {
            let error = (f64::from(hit.t) - t).abs() / t;
            wrong += u64::from(error > 1e-5);
            worst = worst.max(error);
        }
    }
    let what = format!("{} at grazing angles to 1e-7", if quad { "quads" } else { "triangles" });
    Row { what, tried: count as u64, wrong, worst: format!("t off by {worst:.1e}") }
}

/// From inside a sphere, with components 0, -0, denormal: each ray must hit.
fn odd_directions(count: usize) -> Row {
    let geometry = ball(4).geometry(1.0, DVec3::ZERO);
    let accel = build(&geometry);
    let mut random = Random::new(32);
    let odd = [0.0, -0.0, f32::from_bits(1), -f32::from_bits(77), 1e-40, -1e-30, 1.0];
    let rays: Vec<Ray> = (0..count)
        .map(|_| {
            // Origins in the planes of vertices, too.
            let grid = |x: f64| (x * 8.0).round() / 16.0;
            let o = random.signed();
            let origin = DVec3::new(grid(o.x), grid(o.y), grid(o.z)).as_vec3();
            let mut direction = [0; 3].map(|_| odd[random.bits() as usize % odd.len()]);
            direction[random.bits() as usize % 3] = if random.bits().is_multiple_of(2) { 1.0 } else { -1.0 };
            Ray::new(origin, direction.into())
        })
        .collect();
    let wrong = closest(&accel, &rays).iter().filter(|hit| !hit.is_hit()).count() as u64;
    Row {
        what: "directions with 0, -0 and denormal components: leaks".into(),
        tried: count as u64,
        wrong,
        worst: "-".into(),
    }
}

/// The same ray with its direction times 2^k must hit the same at t times 2^-k, exactly.
fn lengths(count: usize) -> Row {
    let geometry = ball(4).geometry(1.0, DVec3::ZERO);
    let accel = build(&geometry);
    let mut random = Random::new(33);
    let mut scales = Vec::with_capacity(count);
    let (mut rays, mut scaled) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for _ in 0..count {
        // 2^-66 to 2^66: about 1e-20 to 1e20.
        let exponent = random.bits() % 133;
        let factor = f32::from_bits((127 - 66 + exponent) << 23);
        let ray = Ray::new((random.signed() * 1.5).as_vec3(), random.signed().as_vec3());
        scales.push(factor);
        rays.push(ray);
        scaled.push(Ray { direction: ray.direction * factor, ..ray });
    }
    let pairs = closest(&accel, &rays).into_iter().zip(closest(&accel, &scaled)).zip(&scales);
    let wrong =
        pairs.filter(|((a, b), k)| a.prim != b.prim || (a.is_hit() && a.t != b.t * **k)).count() as u64;
    Row {
        what: "directions of length 1e-20 to 1e20: same hits, t exactly in proportion".into(),
        tried: count as u64,
        wrong,
        worst: "-".into(),
    }
}
