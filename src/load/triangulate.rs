//! Triangulation of polygons, including concave ones.

use crate::math::{DVec3, Vec2};

/// Maximum number of point-in-ear tests per polygon, against hostile files with a million corners. Sufficient for real
/// polygons of some ten thousand corners.
const MAX_TESTS: u64 = 1 << 27;

/// Splits a polygon into triangles of indices into `corners`, keeping its orientation.
///
/// Ear clipping (Meisters 1975, "Polygons Have Ears") in the plane of the polygon's area vector (Newell's method). Only
/// reflex corners can lie in an ear, so the cost is usually O(n r) for r reflex corners; it is always bounded. If rounding or
/// self-intersection leaves no ear, or the bound is reached, the rest becomes a fan. Empty for fewer than three corners.
///
/// Tried: the crate `earcut` 0.4 takes seconds for 16,000 corners of random self-intersecting polygons, more than quadratic
/// without a bound, and returns too few triangles (9,333 of 15,998). The tessellator of `lyon` adds corners at
/// intersections, which have no texture coordinates.
pub(super) fn triangulate(corners: &[[f32; 3]]) -> Vec<[usize; 3]> {
    match corners.len() {
        0..=2 => return Vec::new(),
        3 => return vec![[0, 1, 2]],
        _ => {}
    }
    let mut triangles = Vec::with_capacity(corners.len() - 2);
    let rest = Ring::new(project(corners)).clip(&mut triangles);
    for k in 1..rest.len() - 1 {
        triangles.push([rest[0], rest[k], rest[k + 1]]);
    }
    triangles
}

/// The remaining corners, as a doubly linked ring.
struct Ring {
    flat: Vec<Vec2>,
    next: Vec<usize>,
    before: Vec<usize>,
    /// Reflex corners, unordered.
    reflex: Vec<usize>,
    /// Index of each corner in `reflex`, or `usize::MAX`.
    place: Vec<usize>,
    /// Number of remaining corners.
    remaining: usize,
}

impl Ring {
    fn new(flat: Vec<Vec2>) -> Ring {
        let n = flat.len();
        let next = (1..n).chain([0]).collect();
        let before = [n - 1].into_iter().chain(0..n - 1).collect();
        let mut ring =
            Ring { flat, next, before, reflex: Vec::new(), place: vec![usize::MAX; n], remaining: n };
        for i in 0..n {
            if !ring.is_convex(i) {
                ring.place[i] = ring.reflex.len();
                ring.reflex.push(i);
            }
        }
        ring
    }

    fn corners(&self, i: usize) -> [Vec2; 3] {
        [self.before[i], i, self.next[i]].map(|k| self.flat[k])
    }

    fn is_convex(&self, i: usize) -> bool {
        let [a, b, c] = self.corners(i);
        cross(a, b, c) > 0.0
    }

    /// Whether the corner is convex, with no other corner inside its triangle.
    fn is_ear(&self, i: usize) -> bool {
        if !self.is_convex(i) {
            return false;
        }
        let [a, b, c] = self.corners(i);
        self.reflex.iter().all(|&k| {
            let p = self.flat[k];
            let inside = cross(a, b, p) >= 0.0 && cross(b, c, p) >= 0.0 && cross(c, a, p) >= 0.0;
            !inside || p == a || p == b || p == c
        })
    }

    /// Clips ears until three corners or no ears remain, or the bound on tests is reached; returns the remaining corners.
    fn clip(mut self, triangles: &mut Vec<[usize; 3]>) -> Vec<usize> {
        let (mut at, mut misses, mut tests) = (0, 0, 0u64);
        while self.remaining > 3 && misses < self.remaining && tests < MAX_TESTS {
            tests += self.reflex.len() as u64 + 1;
            if !self.is_ear(at) {
                misses += 1;
                at = self.next[at];
                continue;
            }
            let (before, next) = (self.before[at], self.next[at]);
            triangles.push([before, at, next]);
            self.next[before] = next;
            self.before[next] = before;
            self.remaining -= 1;
            misses = 0;
            self.update_reflex(at, true);
            self.update_reflex(before, self.is_convex(before));
            self.update_reflex(next, self.is_convex(next));
            // Skipping a corner avoids thin triangles that all share one corner.
            at = self.next[next];
        }
        let start = at;
        let mut rest = vec![start];
        let mut i = self.next[start];
        while i != start {
            rest.push(i);
            i = self.next[i];
        }
        rest
    }

    /// Removes a corner from the reflex corners if it is convex or was clipped. Convex corners remain convex when an adjacent
    /// ear is clipped, so corners are never added, even if rounding suggests it.
    fn update_reflex(&mut self, i: usize, convex: bool) {
        let place = self.place[i];
        if convex && place != usize::MAX {
            self.reflex.swap_remove(place);
            self.place[i] = usize::MAX;
            if let Some(&moved) = self.reflex.get(place) {
                self.place[moved] = place;
            }
        }
    }
}

/// The corners projected to the polygon's plane, counter-clockwise.
fn project(corners: &[[f32; 3]]) -> Vec<Vec2> {
    let point = |i: usize| DVec3::from(corners[i % corners.len()].map(f64::from));
    let origin = point(0);
    let area: DVec3 = (0..corners.len()).map(|i| (point(i) - origin).cross(point(i + 1) - origin)).sum();
    let (x, y) = area.try_normalize().unwrap_or(DVec3::Z).any_orthonormal_pair();
    let scale = (0..corners.len()).map(|i| (point(i) - origin).length()).fold(1e-300, f64::max);
    (0..corners.len())
        .map(|i| {
            let d = (point(i) - origin) / scale;
            Vec2::new(d.dot(x) as f32, d.dot(y) as f32)
        })
        .collect()
}

fn cross(a: Vec2, b: Vec2, c: Vec2) -> f32 {
    (b - a).perp_dot(c - a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(p: &[[f32; 3]], triangles: &[[usize; 3]]) -> f32 {
        let flat = |i: usize| Vec2::new(p[i][0], p[i][1]);
        triangles.iter().map(|t| 0.5 * cross(flat(t[0]), flat(t[1]), flat(t[2])).max(0.0)).sum()
    }

    #[test]
    fn a_concave_arrow_keeps_its_area_and_orientation() {
        let arrow = [[0.0, 0.0, 0.0], [2.0, 2.0, 0.0], [0.0, 1.0, 0.0], [-2.0, 2.0, 0.0]];
        for turn in 0..4 {
            let mut p = arrow;
            p.rotate_left(turn);
            let triangles = triangulate(&p);
            assert_eq!(triangles.len(), 2);
            assert!((area(&p, &triangles) - 2.0).abs() < 1e-5, "start {turn}");
        }
    }

    #[test]
    fn a_long_comb_is_triangulated_without_overlap() {
        // Teeth up and down: half of the corners are reflex.
        let teeth = 3000;
        let mut p: Vec<[f32; 3]> = vec![[teeth as f32, -1.0, 0.0]];
        p.extend((0..=2 * teeth).rev().map(|i| [i as f32 * 0.5, (i % 2) as f32, 0.0]));
        p.push([0.0, -1.0, 0.0]);
        let triangles = triangulate(&p);
        assert_eq!(triangles.len(), p.len() - 2);
        let truth = teeth as f32 * 1.5;
        assert!((area(&p, &triangles) / truth - 1.0).abs() < 1e-4, "{}", area(&p, &triangles));
    }

    #[test]
    fn the_cost_of_hostile_polygons_is_bounded() {
        // A star with overlapping arms: nearly no ears.
        let n = 200_000;
        let corner = |i: i32| {
            let (angle, radius) = (f64::from(i) * 0.618, if i % 2 == 0 { 1.0 } else { 0.9 });
            [(angle.cos() * radius) as f32, (angle.sin() * radius) as f32, 0.0]
        };
        let p: Vec<[f32; 3]> = (0..n).map(corner).collect();
        assert_eq!(triangulate(&p).len(), p.len() - 2);
    }

    #[test]
    fn degenerate_polygons_never_panic() {
        assert!(triangulate(&[[0.0; 3]; 2]).is_empty());
        assert_eq!(triangulate(&[[1.0; 3]; 6]).len(), 4);
        assert_eq!(triangulate(&[[f32::NAN; 3]; 5]).len(), 3);
    }
}
