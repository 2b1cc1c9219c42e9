//! Polygons with more than three corners to triangles, concave ones included.

use crate::math::{DVec3, Vec2};

/// Splits a polygon into triangles of indices into `corners`, keeping its orientation.
///
/// Ears are clipped in the plane of the polygon's area vector (Newell's method); where rounding or self-intersection
/// leaves no ear, the rest becomes a fan. Fewer than three corners give nothing.
pub(super) fn triangulate(corners: &[[f32; 3]]) -> Vec<[usize; 3]> {
    match corners.len() {
        0..=2 => return Vec::new(),
        3 => return vec![[0, 1, 2]],
        _ => {}
    }
    let flat = project(corners);
    let mut rest: Vec<usize> = (0..corners.len()).collect();
    let mut triangles = Vec::with_capacity(corners.len() - 2);
    // Ears are looked for from where the last one was, which keeps convex polygons linear.
    let mut at = 0;
    while rest.len() > 3 {
        let n = rest.len();
        let ear = (0..n).map(|k| (at + k) % n).find(|&i| is_ear(&flat, &rest, i));
        let Some(i) = ear else { break };
        triangles.push([rest[(i + n - 1) % n], rest[i], rest[(i + 1) % n]]);
        rest.remove(i);
        at = i % rest.len();
    }
    for k in 1..rest.len() - 1 {
        triangles.push([rest[0], rest[k], rest[k + 1]]);
    }
    triangles
}

/// The corners in two dimensions, counter-clockwise.
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

/// Is corner `i` of `rest` convex, with no other corner inside its triangle?
fn is_ear(flat: &[Vec2], rest: &[usize], i: usize) -> bool {
    let n = rest.len();
    let (before, after) = ((i + n - 1) % n, (i + 1) % n);
    let (a, b, c) = (flat[rest[before]], flat[rest[i]], flat[rest[after]]);
    if cross(a, b, c) <= 0.0 {
        return false;
    }
    let corners = [before, i, after];
    (0..n).filter(|k| !corners.contains(k)).all(|k| {
        let p = flat[rest[k]];
        let inside = cross(a, b, p) >= 0.0 && cross(b, c, p) >= 0.0 && cross(c, a, p) >= 0.0;
        !inside || p == a || p == b || p == c
    })
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
    fn degenerate_polygons_give_triangles_and_no_panic() {
        assert!(triangulate(&[[0.0; 3]; 2]).is_empty());
        assert_eq!(triangulate(&[[1.0; 3]; 6]).len(), 4);
        assert_eq!(triangulate(&[[f32::NAN; 3]; 5]).len(), 3);
    }
}
