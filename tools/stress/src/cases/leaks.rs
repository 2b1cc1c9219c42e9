//! Watertightness: rays from inside closed meshes, aimed at vertices and edges, must all hit.

use super::Row;
use super::meshes::{Random, Shape, ball, build, closest, cube, slivers, vertices};
use oscura::math::{DVec3, Ray, Vec3};

/// Rays of the full run.
const RAYS: f64 = 1.4e8;

pub fn run(effort: f64) -> Vec<Row> {
    let shapes = [ball(5), slivers(), cube(16)];
    let mut rows = Vec::new();
    for shape in &shapes {
        let placements = placements();
        let each = (RAYS * effort / (shapes.len() * placements.len()) as f64).ceil() as usize;
        let mut row = Row {
            what: format!("leaks: {}, scales 1e-6 to 1e6, offsets to 1e3 sizes", shape.name),
            tried: 0,
            wrong: 0,
            worst: "-".into(),
        };
        for (i, (scale, offset)) in placements.into_iter().enumerate() {
            // Vertices of distant slivers coincide after rounding: that is another mesh, and not closed around a point.
            if shape.inside.min_element() < 1e-3 && offset != DVec3::ZERO {
                continue;
            }
            let wrong = leaks(shape, scale, offset, each, i as u64);
            row.tried += each as u64;
            row.wrong += wrong;
            if wrong > 0 {
                row.worst = format!("{wrong} at scale {scale:e}, offset {offset}");
            }
        }
        rows.push(row);
    }
    rows
}

/// Scales, and offsets in world units.
fn placements() -> Vec<(f64, DVec3)> {
    let mut list = Vec::new();
    for power in [-6, -3, 0, 3, 6] {
        let scale = 10f64.powi(power);
        for sizes in [0.0, 1.0, 30.0, 1000.0] {
            list.push((scale, DVec3::new(1.0, -0.7, 0.43) * sizes * scale));
        }
    }
    list
}

fn leaks(shape: &Shape, scale: f64, offset: DVec3, count: usize, seed: u64) -> u64 {
    let geometry = shape.geometry(scale, offset);
    let accel = build(&geometry);
    let mut random = Random::new(seed);
    let mut wrong = 0;
    let mut left = count;
    while left > 0 {
        let batch = left.min(1 << 18);
        left -= batch;
        let rays: Vec<Ray> = (0..batch)
            .map(|_| {
                let origin = (random.signed() * shape.inside * scale + offset).as_vec3();
                let [a, b, c] = vertices(&geometry, random.bits() % geometry.triangles.len() as u32);
                let t = random.unit() as f32;
                let target = match random.bits() % 4 {
                    0 => a,
                    1 => a + (b - a) * t,
                    2 => b + (c - b) * t,
                    _ => (a + b) * 0.5,
                };
                let direction = target - origin;
                Ray::new(origin, if direction == Vec3::ZERO { Vec3::X } else { direction })
            })
            .collect();
        wrong += closest(&accel, &rays).iter().filter(|hit| !hit.is_hit()).count() as u64;
    }
    wrong
}
