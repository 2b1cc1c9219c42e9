//! Normals of limit surfaces.

use super::cage::Layer;
use super::fans::{Fans, NONE};
use crate::math::DVec3;
use std::f64::consts::TAU;

/// Unit normals at the limits of the points of quads: in the middle of rings by the tangents of Halstead, Kass, DeRose 1993 (appendix
/// A); at open and sharp edges means of the facets on each side, weighted by their areas.
pub(super) fn normals(points: &Layer<3>, limits: &[[f64; 3]], fans: &Fans) -> Layer<3> {
    let mut normals = Layer { values: Vec::new(), corners: vec![NONE; points.corners.len()] };
    for corner in 0..points.corners.len() as u32 {
        if normals.corners[corner as usize] != NONE {
            continue;
        }
        let number = normals.values.len() as u32;
        let value = points.corners[corner as usize] as usize;
        let start = leftmost_start(fans, corner);
        let faceted = || facets(points, limits, fans, start);
        let normal = match fans.is_inner(value) {
            true => smooth(points, fans, start).unwrap_or_else(faceted),
            false => faceted(),
        };
        for c in fans.around(start) {
            normals.corners[c as usize] = number;
        }
        normals.values.push(normal.to_array());
    }
    normals
}

/// The corner from which going left reaches all of its fan.
fn leftmost_start(fans: &Fans, corner: u32) -> u32 {
    let mut start = corner;
    loop {
        match fans.right(start) {
            NONE => return start,
            // A ring is closed.
            right if right == corner => return corner,
            right => start = right,
        }
    }
}

fn smooth(points: &Layer<3>, fans: &Fans, start: u32) -> Option<DVec3> {
    let ring: Vec<(DVec3, DVec3)> = fans
        .around(start)
        .map(|c| {
            let next = fans.next[c as usize];
            (DVec3::from(points.at(next)), DVec3::from(points.at(fans.next[next as usize])))
        })
        .collect();
    let step = TAU / ring.len() as f64;
    let edge_weight = 1.0 + step.cos() + (step / 2.0).cos() * (2.0 * (9.0 + step.cos())).sqrt();
    let (mut u, mut v) = (DVec3::ZERO, DVec3::ZERO);
    for (k, (edge, across)) in ring.into_iter().enumerate() {
        let (sin, cos) = (k as f64 * step).sin_cos();
        let (next_sin, next_cos) = ((k + 1) as f64 * step).sin_cos();
        u += edge_weight * cos * edge + (cos + next_cos) * across;
        v += edge_weight * sin * edge + (sin + next_sin) * across;
    }
    u.cross(v).try_normalize()
}

fn facets(points: &Layer<3>, limits: &[[f64; 3]], fans: &Fans, start: u32) -> DVec3 {
    let limit = |c: u32| DVec3::from(limits[points.corners[c as usize] as usize]);
    let facet = |c: u32| {
        let at = limit(c);
        (limit(fans.next[c as usize]) - at).cross(limit(fans.before[c as usize]) - at)
    };
    fans.around(start).map(facet).sum::<DVec3>().normalize_or(DVec3::Y)
}
