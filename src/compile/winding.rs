//! How often a body goes around points, by a tree over its triangles.
//!
//! What is far away counts as one area with a normal (Barill, Dickson, Schmidt, Levin, Jacobson 2018, "Fast Winding Numbers for Soups and
//! Clouds", equation 13, its first term). Where that leaves it open whether a point is within, all triangles are asked.

use super::boxes::{Bounds, BoxTree, Boxed};
use crate::math::{DAffine3, DVec3};
use crate::scene::Mesh;
use std::f64::consts::TAU;

/// As many times its radius away, a part of a surface counts as one area.
const FAR: f64 = 3.0;

/// Farther from a half than this, the sum of such areas is trusted; it is off by a tenth of that at most, but for odd surfaces.
const DOUBT: f64 = 0.2;

/// A triangle of a body in world space.
struct Face([DVec3; 3]);

impl Boxed for Face {
    fn bounds(&self) -> Bounds {
        Bounds::of(self.0)
    }
}

/// A part of a surface, seen from afar.
#[derive(Clone, Copy, Default)]
struct Area {
    center: DVec3,
    radius: f64,
    /// Along the mean normal, twice as long as the area that shows from there.
    normal: DVec3,
}

/// The surface of a placed body.
pub(super) struct Winding {
    faces: Vec<Face>,
    tree: BoxTree,
    areas: Vec<Area>,
}

impl Winding {
    /// That of a mesh.
    pub fn of(mesh: &Mesh, world_from_object: &DAffine3) -> Winding {
        let corner =
            |i: u32| world_from_object.transform_point3(mesh.positions[i as usize].map(f64::from).into());
        let mut faces: Vec<Face> = mesh.triangles.iter().map(|t| Face(t.map(corner))).collect();
        let tree = BoxTree::sort(&mut faces);
        let areas = tree.nodes.iter().map(|node| Area::of(&faces[node.items()], node.bounds)).collect();
        Winding { faces, tree, areas }
    }

    /// Does it go around a point at least once?
    pub fn is_around(&self, p: DVec3) -> bool {
        let about = self.about(p, &mut |_| ()).abs();
        let turns = if (about - 0.5).abs() < DOUBT { self.exactly(p).abs() } else { about };
        turns > 0.5
    }

    /// How often it goes around a point, roughly; `each` is told of the parts of the surface that are looked at.
    fn about(&self, p: DVec3, each: &mut impl FnMut(usize)) -> f64 {
        let mut sum = 0.0;
        self.tree.walk(|at, node, is_leaf| {
            each(at);
            let Area { center, radius, normal } = self.areas[at];
            let away = center - p;
            let distance = away.length();
            if distance > FAR * radius {
                // Half of the solid angle, as of triangles.
                sum += away.dot(normal) / (4.0 * distance.powi(3));
                return false;
            }
            if is_leaf {
                sum += self.faces[node.items()].iter().map(|face| half_angle(face, p)).sum::<f64>();
            }
            true
        });
        sum / TAU
    }

    /// How often it goes around a point.
    fn exactly(&self, p: DVec3) -> f64 {
        self.faces.iter().map(|face| half_angle(face, p)).sum::<f64>() / TAU
    }
}

impl Area {
    fn of(faces: &[Face], bounds: Bounds) -> Area {
        let of_face = |Face([a, b, c]): &Face| (*b - *a).cross(*c - *a);
        let center = (bounds.low + bounds.high) * 0.5;
        Area { center, radius: center.distance(bounds.high), normal: faces.iter().map(of_face).sum() }
    }
}

/// Half of the solid angle of a triangle (van Oosterom, Strackee 1983, "The Solid Angle of a Plane Triangle", equation 8).
fn half_angle(Face(corners): &Face, p: DVec3) -> f64 {
    let [a, b, c] = corners.map(|corner| corner - p);
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let below = la * lb * lc + a.dot(b) * lc + a.dot(c) * lb + b.dot(c) * la;
    a.dot(b.cross(c)).atan2(below)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash::mix64;

    /// A sphere of `n` by `2 n` patches; without its top rows open at the top.
    fn sphere(n: u32, without: u32) -> Mesh {
        let at = |i: u32, j: u32| {
            let (theta, phi) =
                (f64::from(i) / f64::from(n) * TAU / 2.0, f64::from(j % (2 * n)) / f64::from(n) * TAU / 2.0);
            [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()].map(|x| x as f32)
        };
        let positions = (0..=n).flat_map(|i| (0..2 * n).map(move |j| at(i, j))).collect();
        let index = |i: u32, j: u32| i * 2 * n + j % (2 * n);
        let patch = |i: u32, j: u32| {
            let (a, b, c, d) = (index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1));
            [[a, b, c], [a, c, d]]
        };
        let triangles = (without..n).flat_map(|i| (0..2 * n).flat_map(move |j| patch(i, j))).collect();
        Mesh { positions, triangles, ..Mesh::default() }
    }

    /// A point in the box of side 3 around the origin.
    fn point(number: u64) -> DVec3 {
        let part = |k: u64| (mix64(number * 3 + k) >> 11) as f64 / (1u64 << 53) as f64 * 3.0 - 1.5;
        DVec3::new(part(0), part(1), part(2))
    }

    #[test]
    fn points_are_told_apart_as_by_all_triangles() {
        for mesh in [sphere(40, 0), sphere(40, 8), sphere(40, 20)] {
            let winding = Winding::of(&mesh, &DAffine3::IDENTITY);
            for p in (0..500).map(point) {
                let (about, exactly) = (winding.about(p, &mut |_| ()), winding.exactly(p));
                assert!((about - exactly).abs() < DOUBT / 4.0, "{about} {exactly} at {p}");
                assert_eq!(winding.is_around(p), exactly.abs() > 0.5);
            }
        }
    }

    /// Few parts of a surface are looked at for each point.
    #[test]
    fn the_cost_of_a_point_hardly_grows_with_triangles() {
        let looked = |n: u32| {
            let winding = Winding::of(&sphere(n, 0), &DAffine3::IDENTITY);
            let mut count = 0;
            for p in (0..100).map(point) {
                winding.about(p, &mut |_| count += 1);
            }
            count
        };
        // Sixteen times the triangles.
        let (few, many) = (looked(20), looked(80));
        assert!(many < 4 * few, "{few} {many}");
    }
}
