//! All CPU levels give the bits of the scalar version.

use super::Row;
use super::meshes::Random;
use oscura::accel::{Accel, Geometry};
use oscura::math::{Hit, Ray};
use oscura::shape::{Analytic, Quad, Sphere};
use oscura::simd::{Level, best_level};
use rayon::prelude::*;

/// Rays of the full run.
const RAYS: f64 = 1e7;

pub fn run(effort: f64) -> Vec<Row> {
    let soups = [(1, 1.0), (20, 0.7), (1000, 0.1), (100_000, 0.02)];
    let each = (RAYS * effort / soups.len() as f64).ceil() as usize;
    let levels: Vec<Level> = Level::ALL.into_iter().filter(|level| level.is_available()).collect();
    // A supported level that did not run is a failure.
    let mut wrong = u64::from(levels.last() != Some(&best_level()));
    for (count, size) in soups {
        let accel = Accel::build(&[soup(count, size)], &[]);
        let mut random = Random::new(count as u64);
        let rays: Vec<Ray> = (0..each)
            .map(|_| Ray::new((random.signed() * 1.5).as_vec3(), random.signed().as_vec3()))
            .collect();
        let trace = |level: Level| {
            let mut hits = vec![Hit::MISS; rays.len()];
            let pairs = rays.par_chunks(4096).zip(hits.par_chunks_mut(4096));
            pairs.for_each(|(rays, hits)| accel.closest_at(level, rays, hits));
            hits
        };
        let scalar = trace(Level::Scalar);
        for level in &levels {
            let differ = |(a, b): &(&Hit, &Hit)| {
                let bits = |h: &Hit| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.prim, h.instance];
                bits(a) != bits(b)
            };
            wrong += trace(*level).iter().zip(&scalar).filter(differ).count() as u64;
        }
    }
    let names: Vec<&str> = levels.iter().map(|level| level.name()).collect();
    let what = format!("levels equal to scalar, bit for bit: {}", names.join(", "));
    vec![Row { what, tried: (each * soups.len()) as u64, wrong, worst: "-".into() }]
}

fn soup(count: usize, size: f64) -> Geometry {
    let mut random = Random::new(size.to_bits());
    let mut geometry = Geometry::default();
    for _ in 0..count {
        let center = random.signed();
        let first = geometry.positions.len() as u32;
        let vertices = (0..3).map(|_| (center + random.signed() * size).as_vec3().to_array());
        geometry.positions.extend(vertices);
        geometry.triangles.push([first, first + 1, first + 2]);
        if count > 10 && random.bits().is_multiple_of(8) {
            let corner = random.signed().as_vec3();
            let (edge_u, edge_v) = ((random.signed() * size).as_vec3(), (random.signed() * size).as_vec3());
            geometry.quads.push(Quad { corner, edge_u, edge_v });
            let radius = (random.unit() * size) as f32;
            let sphere = Sphere { center: random.signed().as_vec3(), radius };
            geometry.analytic.push(Analytic::Sphere(sphere));
        }
    }
    geometry
}
