//! A fur ball, as a `.hair` file.

use crate::random::Random;
use std::f64::consts::TAU;
use std::path::Path;

type Vector = [f64; 3];

/// Points per strand.
const POINTS: usize = 5;
/// Length of strands, relative to a unit sphere.
const LENGTH: f64 = 0.42;
/// Radius at the root.
const RADIUS: f64 = 0.0045;
/// Number of tufts that strands clump to.
const TUFTS: usize = 700;

fn plus(a: Vector, b: Vector, t: f64) -> Vector {
    [0, 1, 2].map(|i| a[i] + b[i] * t)
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn unit(a: Vector) -> Vector {
    a.map(|x| x / dot(a, a).sqrt())
}

/// Points distributed uniformly over the sphere, on a spiral (Vogel 1979).
fn spiral(i: usize, count: usize) -> Vector {
    let y = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
    let (sine, cosine) = (TAU * (i as f64 * 0.618_033_988_75).fract()).sin_cos();
    let across = (1.0 - y * y).sqrt();
    [across * cosine, y, across * sine]
}

/// The points of a strand: outwards, combed sideways and downwards, and clumped to its tuft.
fn strand(root: Vector, tufts: &[(Vector, f64)], random: &mut Random) -> Vec<Vector> {
    let nearest = tufts.iter().max_by(|a, b| dot(a.0, root).total_cmp(&dot(b.0, root)));
    let &(tuft, turn) = nearest.expect("there are tufts");
    let comb = [0.55 * root[2] + turn, -0.9, -0.55 * root[0] - turn];
    let tip = plus(unit(plus(root, comb, 0.75)), tuft, 0.25);
    let length = LENGTH * random.between(0.75, 1.1);
    let curl = [0, 1, 2].map(|_| random.between(-0.07, 0.07));
    let draw = plus(tuft, root, -1.0);
    (0..POINTS)
        .map(|i| {
            let t = i as f64 / (POINTS - 1) as f64;
            let out = unit(plus(root.map(|x| x * (1.0 - t)), unit(tip), t));
            let p = plus(root, out, t * length);
            let p = plus(p, draw, 0.7 * t * t);
            plus(p, curl, t * t)
        })
        .collect()
}

/// Writes a file with a number of strands.
pub fn write(path: &Path, strands: usize) -> Result<(), String> {
    let mut random = Random::new(11);
    let tufts: Vec<(Vector, f64)> =
        (0..TUFTS).map(|i| (spiral(i, TUFTS), random.between(-0.2, 0.2))).collect();
    let mut bytes = b"HAIR".to_vec();
    let counts = [strands, strands * POINTS, 2 | 4, POINTS - 1].map(|n| n as u32);
    bytes.extend(counts.into_iter().flat_map(u32::to_le_bytes));
    bytes.extend([0.0f32, 0.0, 1.0, 1.0, 1.0].into_iter().flat_map(f32::to_le_bytes));
    bytes.resize(128, 0);
    for i in 0..strands {
        let points = strand(spiral(i, strands), &tufts, &mut random);
        bytes.extend(points.as_flattened().iter().flat_map(|x| (*x as f32).to_le_bytes()));
    }
    let thickness = |i: usize| 2.0 * RADIUS * (1.0 - (i as f64 / (POINTS - 1) as f64).powi(2));
    let of_strand: Vec<u8> = (0..POINTS).flat_map(|i| (thickness(i) as f32).to_le_bytes()).collect();
    (0..strands).for_each(|_| bytes.extend(&of_strand));
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    }
    std::fs::write(path, bytes).map_err(|e| format!("{}: {e}", path.display()))
}
