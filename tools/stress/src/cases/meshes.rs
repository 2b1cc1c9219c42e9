//! Convex closed meshes around the origin, and random numbers.

use oscura::accel::{Accel, Geometry};
use oscura::math::{DVec3, Hit, Ray, Vec3};
use rayon::prelude::*;

/// A small random number generator (PCG, O'Neill 2014).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Random {
        Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }
    pub fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = (((self.0 >> 18) ^ self.0) >> 27) as u32;
        x.rotate_right((self.0 >> 59) as u32)
    }
    pub fn unit(&mut self) -> f64 {
        f64::from(self.bits()) / 4_294_967_296.0
    }
    pub fn signed(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }
    /// Uniform between two powers of ten.
    pub fn power(&mut self, low: f64, high: f64) -> f64 {
        10f64.powf(low + (high - low) * self.unit())
    }
}

/// A mesh in f64, for moving and scaling before it is rounded.
pub struct Shape {
    pub name: &'static str,
    pub points: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
    /// Points within this fraction of each axis' extent are inside.
    pub inside: DVec3,
}

impl Shape {
    /// Scaled, moved and rounded to f32.
    pub fn geometry(&self, scale: f64, offset: DVec3) -> Geometry {
        Geometry {
            positions: self.points.iter().map(|p| (*p * scale + offset).as_vec3().to_array()).collect(),
            triangles: self.triangles.clone(),
            ..Geometry::default()
        }
    }
}

/// A sphere from an octahedron whose triangles are subdivided `levels` times.
pub fn ball(levels: u32) -> Shape {
    let mut shape = cube_like(1 << levels);
    shape.name = "ball";
    shape.points.iter_mut().for_each(|p| *p = p.normalize());
    shape.inside = DVec3::splat(0.5);
    shape
}

/// A cube whose faces are grids.
pub fn cube(cells: u32) -> Shape {
    cube_like(cells)
}

/// A box a million times longer than thick, of sliver triangles.
pub fn slivers() -> Shape {
    let mut shape = cube_like(4);
    shape.name = "slivers (aspect 10^6)";
    let size = DVec3::new(1.0, 1e-6, 1e-6);
    shape.points.iter_mut().for_each(|p| *p *= size);
    shape.inside = size * 0.5;
    shape
}

fn cube_like(cells: u32) -> Shape {
    let mut shape =
        Shape { name: "cube", points: Vec::new(), triangles: Vec::new(), inside: DVec3::splat(0.7) };
    let mut index = std::collections::HashMap::new();
    for axis in 0..3 {
        for side in [0, cells] {
            let mut vertex = |u: u32, v: u32| {
                let mut grid = [0; 3];
                grid[axis] = side;
                grid[(axis + 1) % 3] = u;
                grid[(axis + 2) % 3] = v;
                *index.entry(grid).or_insert_with(|| {
                    let at = |k: usize| f64::from(grid[k]) / f64::from(cells) * 2.0 - 1.0;
                    shape.points.push(DVec3::new(at(0), at(1), at(2)));
                    shape.points.len() as u32 - 1
                })
            };
            for (u, v) in (0..cells).flat_map(|u| (0..cells).map(move |v| (u, v))) {
                let [a, b, c, d] = [vertex(u, v), vertex(u + 1, v), vertex(u + 1, v + 1), vertex(u, v + 1)];
                shape.triangles.extend(if side == 0 {
                    [[a, c, b], [a, d, c]]
                } else {
                    [[a, b, c], [a, c, d]]
                });
            }
        }
    }
    shape
}

/// Builds the BVH over one geometry.
pub fn build(geometry: &Geometry) -> Accel {
    Accel::build(std::slice::from_ref(geometry), &[])
}

/// Closest hits, on all threads.
pub fn closest(accel: &Accel, rays: &[Ray]) -> Vec<Hit> {
    let mut hits = vec![Hit::MISS; rays.len()];
    rays.par_chunks(4096).zip(hits.par_chunks_mut(4096)).for_each(|(rays, hits)| accel.closest(rays, hits));
    hits
}

/// The vertices of a triangle.
pub fn vertices(geometry: &Geometry, triangle: u32) -> [Vec3; 3] {
    geometry.triangles[triangle as usize].map(|i| Vec3::from(geometry.positions[i as usize]))
}
