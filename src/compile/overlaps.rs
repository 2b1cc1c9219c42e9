//! Triangles that lie on each other: in one plane, with a common area.
//!
//! They are found by a tree of boxes, so that each triangle meets few others.

use super::boxes::{Bounds, BoxTree, Boxed};
use crate::math::DVec3;
use rayon::prelude::*;

/// Cosine between the normals of triangles that lie on each other.
const PARALLEL: f64 = 0.9999;

/// A triangle of a solid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub corners: [DVec3; 3],
    /// Number of the solid.
    pub solid: u32,
    /// What its coordinates may be off by.
    pub rounding: f64,
}

impl Boxed for Piece {
    fn bounds(&self) -> Bounds {
        Bounds::of(self.corners).widened(self.rounding)
    }

    fn middle(&self, axis: usize) -> f64 {
        self.corners.iter().map(|corner| corner[axis]).sum()
    }
}

impl Piece {
    /// Its normal, as long as twice its area.
    fn normal(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a)
    }

    /// A point of the common area of two triangles, and the normal there, if they lie on each other.
    pub fn overlap(&self, other: &Piece) -> Option<(DVec3, DVec3)> {
        let normal = self.normal().try_normalize()?;
        let is_parallel = other.normal().try_normalize()?.dot(normal).abs() >= PARALLEL;
        let reach = self.rounding + other.rounding;
        let height = |p: DVec3| (p - self.corners[0]).dot(normal);
        let heights = other.corners.map(height);
        let is_apart = heights.iter().all(|h| *h > reach) || heights.iter().all(|h| *h < -reach);
        if !is_parallel || is_apart {
            return None;
        }
        let common = self.clipped(normal, &other.corners);
        let (first, rest) = common.split_first()?;
        let area: DVec3 = rest.windows(2).map(|w| (w[0] - first).cross(w[1] - first)).sum();
        let longest = rest.iter().map(|p| p.distance(*first)).fold(0.0, f64::max);
        // What is as narrow as numbers are precise is an edge.
        if area.length() <= 4.0 * reach * longest {
            return None;
        }
        let middle = common.iter().sum::<DVec3>() / common.len() as f64;
        (height(middle).abs() <= reach).then(|| (middle - normal * height(middle), normal))
    }

    /// The part of a polygon over it, seen along its normal (Sutherland, Hodgman 1974).
    fn clipped(&self, normal: DVec3, polygon: &[DVec3]) -> Vec<DVec3> {
        let mut left = polygon.to_vec();
        for k in 0..3 {
            let (start, end) = (self.corners[k], self.corners[(k + 1) % 3]);
            let inwards = normal.cross(end - start);
            let depth = |p: DVec3| (p - start).dot(inwards);
            let mut within = Vec::with_capacity(left.len() + 1);
            for (i, &p) in left.iter().enumerate() {
                let q = left[(i + 1) % left.len()];
                let (at_p, at_q) = (depth(p), depth(q));
                if at_p >= 0.0 {
                    within.push(p);
                }
                if (at_p >= 0.0) != (at_q >= 0.0) {
                    within.push(p + (q - p) * (at_p / (at_p - at_q)));
                }
            }
            left = within;
        }
        left
    }
}

/// Do two triangles that `may_touch`, by the numbers of their solids, lie on each other at a point and a normal that
/// `is_touched` agrees to?
pub(super) fn any(
    mut pieces: Vec<Piece>,
    may_touch: impl Fn(u32, u32) -> bool + Sync,
    is_touched: impl Fn(DVec3, DVec3) -> bool + Sync,
) -> bool {
    let tree = BoxTree::sort(&mut pieces);
    pieces.par_iter().enumerate().any(|(number, piece)| {
        tree.any(&piece.bounds(), |k| {
            let other = &pieces[k];
            k > number
                && may_touch(piece.solid, other.solid)
                && piece.overlap(other).is_some_and(|(point, normal)| is_touched(point, normal))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn piece(solid: u32, corners: [[f64; 3]; 3]) -> Piece {
        Piece { corners: corners.map(DVec3::from), solid, rounding: 1e-6 }
    }

    /// The two triangles of a square of side 2 around a point.
    fn square(solid: u32, [x, y, z]: [f64; 3]) -> Vec<Piece> {
        let at = |dx: f64, dy: f64| [x + dx, y + dy, z];
        let (a, b, c, d) = (at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0));
        vec![piece(solid, [a, b, c]), piece(solid, [a, c, d])]
    }

    /// A disk of `count` triangles around its middle, facing down.
    fn fan(solid: u32, count: u32, radius: f64, z: f64) -> Vec<Piece> {
        let rim = |i: u32| {
            let angle = TAU * f64::from(i) / f64::from(count);
            [radius * angle.cos(), radius * angle.sin(), z]
        };
        (0..count).map(|i| piece(solid, [[0.0, 0.0, z], rim(i + 1), rim(i)])).collect()
    }

    fn touch(pieces: &[Vec<Piece>]) -> bool {
        any(pieces.concat(), |a, b| a != b, |_, _| true)
    }

    #[test]
    fn triangles_that_share_an_area_are_found() {
        for (first, second, expected) in [
            (square(0, [0.0; 3]), fan(1, 64, 0.3, 0.0), true),
            (fan(0, 64, 5.0, 0.0), square(1, [0.0; 3]), true),
            // No triangle's middle lies on the other square.
            (square(0, [0.0; 3]), square(1, [1.9, 1.9, 0.0]), true),
            (square(0, [0.0; 3]), square(1, [1.95, 0.3, 0.0]), true),
            // Edge to edge, corner to corner, beside each other.
            (square(0, [0.0; 3]), square(1, [2.0, 0.3, 0.0]), false),
            (square(0, [0.0; 3]), square(1, [2.0, 2.0, 0.0]), false),
            (square(0, [0.0; 3]), square(1, [2.1, 0.0, 0.0]), false),
            // Above each other.
            (square(0, [0.0; 3]), fan(1, 64, 0.3, 1e-4), false),
            // As far as numbers are precise.
            (square(0, [0.0; 3]), fan(1, 64, 0.3, 1e-6), true),
        ] {
            assert_eq!(touch(&[first.clone(), second.clone()]), expected);
            assert_eq!(touch(&[second, first]), expected);
        }
        // One solid is not asked about itself, and triangles that cross share no area.
        assert!(!touch(&[square(0, [0.0; 3]), square(0, [0.5, 0.5, 0.0])]));
        let upright = vec![piece(1, [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 0.0, 1.0]])];
        assert!(!touch(&[square(0, [0.0; 3]), upright]));
    }

    /// The points that are asked about lie in both, and what they are told counts.
    #[test]
    fn the_caller_has_the_last_word() {
        let both = [square(0, [0.0; 3]), square(1, [1.5, 1.5, 0.0])].concat();
        let asked = std::sync::Mutex::new(Vec::new());
        let found = any(
            both.clone(),
            |a, b| a != b,
            |point, normal| {
                asked.lock().expect("no panic").push((point, normal));
                false
            },
        );
        let asked = asked.into_inner().expect("no panic");
        assert!(!found && !asked.is_empty());
        for (point, normal) in asked {
            assert!((0.5..=1.0).contains(&point.x) && (0.5..=1.0).contains(&point.y), "{point}");
            assert!(point.z == 0.0 && normal.z.abs() == 1.0);
        }
    }

    /// Of two fine grids a little apart each triangle meets a few others only.
    #[test]
    fn few_boxes_are_looked_into() {
        let n = 60;
        let grid = |solid: u32, z: f64| -> Vec<Piece> {
            let at = |i: i32, j: i32| [f64::from(i), f64::from(j), z];
            (0..n * n)
                .flat_map(|k| {
                    let (i, j) = (k % n, k / n);
                    let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                    [piece(solid, [a, b, c]), piece(solid, [a, c, d])]
                })
                .collect()
        };
        let mut pieces = [grid(0, 0.0), grid(1, 0.0)].concat();
        let count = pieces.len();
        let tree = BoxTree::sort(&mut pieces);
        let mut looked = 0;
        for piece in &pieces {
            tree.any(&piece.bounds(), |_| {
                looked += 1;
                false
            });
        }
        assert!(looked < 120 * count, "{looked} of {count}");
    }
}
