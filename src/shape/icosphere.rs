//! Spheres as triangles.

use crate::math::DVec3;
use crate::scene::Mesh;
use std::collections::HashMap;

/// A sphere as a subdivided icosahedron with smooth normals: 20 * 4^levels triangles, unit radius.
pub(super) fn icosphere(levels: u32) -> Mesh {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let mut points: Vec<DVec3> = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        points.extend([DVec3::new(a, b, 0.0), DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a)]);
    }
    let mut triangles = Vec::new();
    for i in 0..12u32 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let [a, b, c] = [i, j, k].map(|v| points[v as usize]);
                // Edges of this icosahedron have length 2.
                if [(a, b), (b, c), (c, a)].iter().all(|(p, q)| (p.distance(*q) - 2.0).abs() < 1e-9) {
                    let outward = (b - a).cross(c - a).dot(a) > 0.0;
                    triangles.push(if outward { [i, j, k] } else { [i, k, j] });
                }
            }
        }
    }
    points.iter_mut().for_each(|p| *p = p.normalize());
    for _ in 0..levels {
        subdivide(&mut points, &mut triangles);
    }
    let normals: Vec<[f32; 3]> = points.iter().map(|p| p.as_vec3().to_array()).collect();
    Mesh { positions: normals.clone(), triangles, normals, ..Mesh::default() }
}

fn subdivide(points: &mut Vec<DVec3>, triangles: &mut Vec<[u32; 3]>) {
    let mut middles = HashMap::new();
    let mut next = Vec::with_capacity(triangles.len() * 4);
    for &[a, b, c] in triangles.iter() {
        let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
            *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                points.push((points[p as usize] + points[q as usize]).normalize());
                points.len() as u32 - 1
            })
        });
        next.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    *triangles = next;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_faces_outwards_and_holds_its_volume() {
        let mesh = icosphere(5);
        assert_eq!(mesh.triangles.len(), 20 * 4usize.pow(5));
        let corner = |i: u32| DVec3::from(mesh.positions[i as usize].map(f64::from));
        let parts = mesh.triangles.iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0);
        assert!((parts.sum::<f64>() / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 2e-3);
    }
}
