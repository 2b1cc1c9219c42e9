//! One step of Catmull and Clark 1978, "Recursively Generated B-Spline Surfaces on Arbitrary Topological Meshes", and the
//! limits of its values.
//!
//! The coarse polygons that are subdivided, and each of their attributes with a connectivity of its own.

use crate::math::DVec3;
use crate::scene::{MaterialId, Mesh, VertexAttribute};
use rayon::prelude::*;
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::hash::Hash;

/// Rule for open edges and their ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Edges {
    /// They become cubic B-splines; corners of one face only stay where they are.
    SharpCorners,
    /// They become cubic B-splines, around corners, too.
    RoundCorners,
    /// They and their ends stay what they are: texture coordinates along seams.
    Fixed,
}

/// Rule for a vertex.
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

/// Values that corners of faces refer to: points, or texture coordinates, which may differ between the faces at a point.
#[derive(Clone, Debug, Default)]
pub(super) struct Layer<const N: usize> {
    pub values: Vec<[f64; N]>,
    /// The value of each corner.
    pub corners: Vec<u32>,
}

impl<const N: usize> Layer<N> {
    /// A layer of the values that `at` gives for vertices with keys; equal keys are one value.
    fn new<K: Hash + Eq>(corners: &[u32], at: impl Fn(u32) -> (K, [f32; N])) -> Layer<N> {
        let (mut known, mut layer) = (HashMap::new(), Layer::default());
        for &vertex in corners {
            let (key, value) = at(vertex);
            let next = layer.values.len() as u32;
            let number = *known.entry(key).or_insert(next);
            if number == next {
                layer.values.push(value.map(f64::from));
            }
            layer.corners.push(number);
        }
        layer
    }
}

/// Polygons of any size, as a file has them.
#[derive(Clone, Debug, Default)]
pub(in crate::load) struct Cage {
    /// Name, positions, texture coordinates, colours and attributes of vertices; nothing else.
    pub mesh: Mesh,
    /// The point that each vertex is at: faces hang together where they share points.
    pub points: Vec<u32>,
    /// The vertices of all corners.
    pub corners: Vec<u32>,
    /// Corners of each face.
    pub arities: Vec<u32>,
    /// The material of each face.
    pub materials: Vec<MaterialId>,
}

impl Cage {
    /// The triangles of a mesh as faces; they hang together where corners have the same position.
    pub fn of_triangles(mesh: &Mesh) -> Cage {
        let mut known: HashMap<[u32; 3], u32> = HashMap::new();
        let point = |p: &[f32; 3]| {
            let next = known.len() as u32;
            // Zero has two signs.
            *known.entry(p.map(|x| (x + 0.0).to_bits())).or_insert(next)
        };
        let parts = mesh.parts.iter();
        Cage {
            points: mesh.positions.iter().map(point).collect(),
            corners: mesh.triangles.as_flattened().to_vec(),
            arities: vec![3; mesh.triangles.len()],
            materials: parts
                .flat_map(|part| std::iter::repeat_n(part.material, part.triangle_count as usize))
                .collect(),
            mesh: Mesh {
                name: mesh.name.clone(),
                positions: mesh.positions.clone(),
                uv_sets: mesh.uv_sets.clone(),
                colors: mesh.colors.clone(),
                attributes: mesh.attributes.clone(),
                ..Mesh::default()
            },
        }
    }

    /// Takes its name, and whether there are colours, from the mesh of its triangles.
    pub fn finish(&mut self, mesh: &Mesh) {
        self.mesh.name.clone_from(&mesh.name);
        if mesh.colors.is_empty() {
            self.mesh.colors = Vec::new();
        }
    }

    /// How many triangles `levels` steps make of it.
    pub fn triangles_after(&self, levels: u32) -> u64 {
        2 * (self.corners.len() as u64).saturating_mul(4u64.saturating_pow(levels.saturating_sub(1)))
    }

    /// Without faces whose corners are not finite, and with those of a material together, in the order in which materials first appear.
    pub fn sorted(&self) -> Cage {
        let mut order: HashMap<MaterialId, usize> = HashMap::new();
        for material in &self.materials {
            let next = order.len();
            order.entry(*material).or_insert(next);
        }
        let mut first = 0;
        let mut faces: Vec<(usize, usize, usize)> = Vec::with_capacity(self.arities.len());
        for (face, &arity) in self.arities.iter().enumerate() {
            let corners = first..first + arity as usize;
            first = corners.end;
            let is_finite = |&v: &u32| self.mesh.positions[v as usize].iter().all(|x| x.is_finite());
            if self.corners[corners.clone()].iter().all(is_finite) {
                faces.push((order[&self.materials[face]], face, corners.start));
            }
        }
        faces.sort_unstable();
        let mut sorted = Cage { mesh: self.mesh.clone(), points: self.points.clone(), ..Cage::default() };
        for (_, face, first) in faces {
            let arity = self.arities[face];
            sorted.corners.extend_from_slice(&self.corners[first..first + arity as usize]);
            sorted.arities.push(arity);
            sorted.materials.push(self.materials[face]);
        }
        sorted
    }

    /// The points of its corners.
    pub(super) fn point_layer(&self) -> Layer<3> {
        Layer::new(&self.corners, |v| (self.points[v as usize], self.mesh.positions[v as usize]))
    }

    /// Texture coordinates of its corners, which hang together where both point and coordinates are the same.
    pub(super) fn uv_layers(&self) -> Vec<Layer<2>> {
        let sets = self.mesh.uv_sets.iter().filter(|set| !set.is_empty());
        sets.map(|set| self.varying(set)).collect()
    }

    /// Colours, likewise.
    pub(super) fn color_layer(&self) -> Option<Layer<4>> {
        (!self.mesh.colors.is_empty()).then(|| self.varying(&self.mesh.colors))
    }

    /// Attributes, likewise, each filled up with zeros.
    pub(super) fn attribute_layers(&self) -> Vec<Layer<4>> {
        let of = |attribute: &VertexAttribute| {
            self.varying_by(|v| {
                let own = attribute.of(v as usize);
                std::array::from_fn(|k| own.get(k).copied().unwrap_or(0.0))
            })
        };
        self.mesh.attributes.iter().map(of).collect()
    }

    fn varying<const N: usize>(&self, values: &[[f32; N]]) -> Layer<N> {
        self.varying_by(|v| values[v as usize])
    }

    fn varying_by<const N: usize>(&self, of: impl Fn(u32) -> [f32; N]) -> Layer<N> {
        Layer::new(&self.corners, |v| {
            let value = of(v).map(|x| if x.is_finite() { x } else { 0.0 });
            ((self.points[v as usize], value.map(f32::to_bits)), value)
        })
    }
}

// Adjacency of faces at edges and vertices.

/// No corner, edge.
pub(super) const NONE: u32 = u32::MAX;

/// The connectivity of one layer. The edge of a corner goes from it to the next corner of its face.
pub(super) struct Fans {
    /// The edge of each corner.
    pub edges: Vec<u32>,
    /// The corner on the other side of each corner's edge; `NONE` at sharp edges: those of one face, of more than two, and of two
    /// that run against each other.
    pub twins: Vec<u32>,
    /// The next corner of its face, and the one before.
    pub next: Vec<u32>,
    pub before: Vec<u32>,
    /// Some corner of each value; `NONE` without.
    pub first: Vec<u32>,
    /// Corners at each value.
    pub faces: Vec<u32>,
    /// Edges that are sharp at each value, and the sum of their other ends' numbers, of which up to two are kept.
    pub sharp: Vec<Sharp>,
    pub edge_count: usize,
}

/// The sharp edges at a value.
#[derive(Clone, Copy, Default)]
pub(super) struct Sharp {
    pub count: u32,
    pub ends: [u32; 2],
}

impl Fans {
    /// The fans of faces with these numbers of corners, whose corners refer to `count` values.
    pub fn new(arities: &[u32], corners: &[u32], count: usize) -> Fans {
        let (next, before) = rings(arities);
        let mut uses: Vec<(u32, u32, u32)> = (0..corners.len() as u32)
            .into_par_iter()
            .map(|c| {
                let (a, b) = (corners[c as usize], corners[next[c as usize] as usize]);
                (a.min(b), a.max(b), c)
            })
            .collect();
        uses.par_sort_unstable();
        let mut fans = Fans {
            edges: vec![0; corners.len()],
            twins: vec![NONE; corners.len()],
            first: vec![NONE; count],
            faces: vec![0; count],
            sharp: vec![Sharp::default(); count],
            edge_count: 0,
            next,
            before,
        };
        for edge in uses.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            for use_ in edge {
                fans.edges[use_.2 as usize] = fans.edge_count as u32;
            }
            fans.edge_count += 1;
            match edge {
                [(a, b, x), (_, _, y)] if corners[*x as usize] != corners[*y as usize] && a != b => {
                    (fans.twins[*x as usize], fans.twins[*y as usize]) = (*y, *x);
                }
                _ => {
                    let (a, b) = (edge[0].0, edge[0].1);
                    fans.sharp[a as usize].add(b);
                    fans.sharp[b as usize].add(a);
                }
            }
        }
        for (c, &value) in corners.iter().enumerate() {
            fans.first[value as usize] = c as u32;
            fans.faces[value as usize] += 1;
        }
        fans
    }

    /// The corner at the same value in the face on the left; `NONE` behind a sharp edge.
    pub fn left(&self, corner: u32) -> u32 {
        self.twins[self.before[corner as usize] as usize]
    }

    /// The corner at the same value in the face on the right; `NONE` behind a sharp edge.
    pub fn right(&self, corner: u32) -> u32 {
        match self.twins[corner as usize] {
            NONE => NONE,
            twin => self.next[twin as usize],
        }
    }

    /// The corners around a value from one on, to the left, until a sharp edge or once around.
    pub fn around(&self, start: u32) -> impl Iterator<Item = u32> + '_ {
        std::iter::successors(Some(start), move |&c| Some(self.left(c)).filter(|&c| c != NONE && c != start))
    }

    /// Is a value the middle of one closed ring of faces?
    pub fn is_inner(&self, value: usize) -> bool {
        self.sharp[value].count == 0
            && self.first[value] != NONE
            && self.around(self.first[value]).count() == self.faces[value] as usize
    }
}

impl Sharp {
    fn add(&mut self, end: u32) {
        if let Some(place) = self.ends.get_mut(self.count as usize) {
            *place = end;
        }
        self.count += 1;
    }
}

/// The next corner and the one before in each face.
fn rings(arities: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let (mut next, mut before, mut first) = (Vec::new(), Vec::new(), 0);
    for &arity in arities {
        next.extend((1..arity).map(|k| first + k).chain([first]));
        before.extend([first + arity - 1].into_iter().chain((0..arity - 1).map(|k| first + k)));
        first += arity;
    }
    (next, before)
}
