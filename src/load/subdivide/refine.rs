//! One step of Catmull and Clark 1978, "Recursively Generated B-Spline Surfaces on Arbitrary Topological Meshes", and the
//! limits of its values.

use super::cage::{Fans, Layer, NONE};
use crate::math::DVec3;
use std::f64::consts::TAU;

/// What becomes of open edges and their ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Edges {
    /// They become cubic B-splines; corners of one face only stay where they are.
    SharpCorners,
    /// They become cubic B-splines, around corners, too.
    RoundCorners,
    /// They and their ends stay what they are: texture coordinates along seams.
    Fixed,
}

/// What a value is.
enum VertexRule {
    /// The middle of a ring of this many faces.
    Inner(f64),
    /// On a curve between two neighbours.
    Curve([u32; 2]),
    Fixed,
}

fn place(fans: &Fans, value: usize, edges: Edges) -> VertexRule {
    if fans.is_inner(value) {
        return VertexRule::Inner(f64::from(fans.faces[value]));
    }
    let sharp = fans.sharp[value];
    let is_fixed = match edges {
        Edges::SharpCorners => fans.faces[value] == 1,
        Edges::RoundCorners => false,
        Edges::Fixed => true,
    };
    if sharp.count == 2 && !is_fixed { VertexRule::Curve(sharp.ends) } else { VertexRule::Fixed }
}

fn sum<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    std::array::from_fn(|k| a[k] + b[k])
}

fn scaled<const N: usize>(a: [f64; N], factor: f64) -> [f64; N] {
    a.map(|x| x * factor)
}

impl<const N: usize> Layer<N> {
    /// The value of a corner.
    pub fn at(&self, corner: u32) -> [f64; N] {
        self.values[self.corners[corner as usize] as usize]
    }

    /// After one step: each corner has become a quad of the vertex's value, that of its edge, its face and the edge before.
    pub fn refined(&self, arities: &[u32], edges: Edges) -> Layer<N> {
        let fans = Fans::new(arities, &self.corners, self.values.len());
        let (points, count) = (self.face_values(arities), self.values.len());
        let (first_edge, first_face) = (count, count + fans.edge_count);
        let mut of_corner = Vec::with_capacity(self.corners.len());
        for (face, &arity) in arities.iter().enumerate() {
            of_corner.extend(std::iter::repeat_n(face as u32, arity as usize));
        }
        let (middles, edge_values) = self.edge_values(&fans, &points, &of_corner);
        let mut values = self.vertex_values(&fans, edges, &points, &of_corner, &middles);
        values.extend(edge_values);
        values.extend(points);
        let mut corners = Vec::with_capacity(4 * self.corners.len());
        for (c, (&vertex, &face)) in self.corners.iter().zip(&of_corner).enumerate() {
            let edge = |corner: usize| first_edge as u32 + fans.edges[corner];
            corners.extend([vertex, edge(c), first_face as u32 + face, edge(fans.before[c] as usize)]);
        }
        Layer { values, corners }
    }

    /// The means of faces.
    fn face_values(&self, arities: &[u32]) -> Vec<[f64; N]> {
        let mut first = 0;
        let mean = |&arity: &u32| {
            let corners = first..first + arity;
            first += arity;
            scaled(corners.fold([0.0; N], |all, c| sum(all, self.at(c))), 1.0 / f64::from(arity))
        };
        arities.iter().map(mean).collect()
    }

    /// The middles of edges, and what edges become.
    fn edge_values(
        &self,
        fans: &Fans,
        points: &[[f64; N]],
        of_corner: &[u32],
    ) -> (Vec<[f64; N]>, Vec<[f64; N]>) {
        let mut middles = vec![[0.0; N]; fans.edge_count];
        let mut values = middles.clone();
        for c in 0..self.corners.len() {
            let edge = fans.edges[c] as usize;
            let middle = scaled(sum(self.at(c as u32), self.at(fans.next[c])), 0.5);
            let point = |c: usize| points[of_corner[c] as usize];
            middles[edge] = middle;
            values[edge] = match fans.twins[c] {
                NONE => middle,
                // One order for both sides, as sums depend on it.
                twin => {
                    let (a, b) = (c.min(twin as usize), c.max(twin as usize));
                    sum(scaled(middle, 0.5), scaled(sum(point(a), point(b)), 0.25))
                }
            };
        }
        (middles, values)
    }

    fn vertex_values(
        &self,
        fans: &Fans,
        edges: Edges,
        points: &[[f64; N]],
        of_corner: &[u32],
        middles: &[[f64; N]],
    ) -> Vec<[f64; N]> {
        let moved = |value: usize| {
            let own = self.values[value];
            match place(fans, value, edges) {
                VertexRule::Inner(n) => {
                    let mut around = [0.0; N];
                    for c in fans.around(fans.first[value]) {
                        let middle = middles[fans.edges[c as usize] as usize];
                        around =
                            sum(around, sum(points[of_corner[c as usize] as usize], scaled(middle, 2.0)));
                    }
                    scaled(sum(scaled(around, 1.0 / n), scaled(own, n - 3.0)), 1.0 / n)
                }
                VertexRule::Curve([a, b]) => {
                    let ends = sum(self.values[a as usize], self.values[b as usize]);
                    sum(scaled(own, 0.75), scaled(ends, 0.125))
                }
                VertexRule::Fixed => own,
            }
        };
        (0..self.values.len()).map(moved).collect()
    }

    /// Where the values of quads end up after steps without end (Halstead, Kass, DeRose 1993, "Efficient, Fair Interpolation using
    /// Catmull-Clark Surfaces", section 3).
    pub fn limits(&self, fans: &Fans, edges: Edges) -> Vec<[f64; N]> {
        let limit = |value: usize| {
            let own = self.values[value];
            match place(fans, value, edges) {
                VertexRule::Inner(n) => {
                    let mut around = [0.0; N];
                    for c in fans.around(fans.first[value]) {
                        let next = fans.next[c as usize];
                        let across = self.at(fans.next[next as usize]);
                        around = sum(around, sum(scaled(self.at(next), 4.0), across));
                    }
                    scaled(sum(scaled(own, n * n), around), 1.0 / (n * (n + 5.0)))
                }
                VertexRule::Curve([a, b]) => {
                    let ends = sum(self.values[a as usize], self.values[b as usize]);
                    scaled(sum(scaled(own, 4.0), ends), 1.0 / 6.0)
                }
                VertexRule::Fixed => own,
            }
        };
        (0..self.values.len()).map(limit).collect()
    }
}

// Normals of limit surfaces.

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
