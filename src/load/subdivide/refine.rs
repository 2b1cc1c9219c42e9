//! One level of subdivision (Catmull and Clark 1978, "Recursively Generated B-Spline Surfaces on Arbitrary Topological
//! Meshes"), and limit points and normals. Each attribute of the polygons is a layer with its own connectivity.

use crate::math::DVec3;
use crate::scene::{MaterialId, Mesh, VertexAttribute};
use rayon::prelude::*;
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::hash::Hash;

/// Boundary rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Boundary {
    /// Cubic B-splines; vertices of only one face stay fixed.
    SharpCorners,
    /// Cubic B-splines, also at vertices of only one face.
    RoundCorners,
    /// Linear, with fixed vertices: for seams of texture coordinates.
    Fixed,
}

enum VertexRule {
    /// Interior vertex of this valence.
    Interior(f64),
    /// On a boundary curve between two neighbours.
    Curve([u32; 2]),
    Fixed,
}

fn vertex_rule(half_edges: &HalfEdges, value: usize, boundary: Boundary) -> VertexRule {
    if half_edges.is_interior(value) {
        return VertexRule::Interior(f64::from(half_edges.valence[value]));
    }
    let sharp = half_edges.sharp[value];
    let is_fixed = match boundary {
        Boundary::SharpCorners => half_edges.valence[value] == 1,
        Boundary::RoundCorners => false,
        Boundary::Fixed => true,
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

    /// The layer after one level: each corner becomes a quad of vertex point, edge point, face point and previous edge point.
    pub fn refined(&self, arities: &[u32], boundary: Boundary) -> Layer<N> {
        let half_edges = HalfEdges::new(arities, &self.corners, self.values.len());
        let (face_points, count) = (self.face_values(arities), self.values.len());
        let (first_edge, first_face) = (count, count + half_edges.edge_count);
        let mut corner_faces = Vec::with_capacity(self.corners.len());
        for (face, &arity) in arities.iter().enumerate() {
            corner_faces.extend(std::iter::repeat_n(face as u32, arity as usize));
        }
        let (middles, edge_values) = self.edge_values(&half_edges, &face_points, &corner_faces);
        let mut values = self.vertex_values(&half_edges, boundary, &face_points, &corner_faces, &middles);
        values.extend(edge_values);
        values.extend(face_points);
        let mut corners = Vec::with_capacity(4 * self.corners.len());
        for (c, (&vertex, &face)) in self.corners.iter().zip(&corner_faces).enumerate() {
            let edge = |corner: usize| first_edge as u32 + half_edges.edges[corner];
            corners.extend([vertex, edge(c), first_face as u32 + face, edge(half_edges.prev[c] as usize)]);
        }
        Layer { values, corners }
    }

    /// Face points: means of the corners.
    fn face_values(&self, arities: &[u32]) -> Vec<[f64; N]> {
        let mut first = 0;
        let mean = |&arity: &u32| {
            let corners = first..first + arity;
            first += arity;
            scaled(corners.fold([0.0; N], |all, c| sum(all, self.at(c))), 1.0 / f64::from(arity))
        };
        arities.iter().map(mean).collect()
    }

    /// Midpoints of edges, and edge points.
    fn edge_values(
        &self,
        half_edges: &HalfEdges,
        face_points: &[[f64; N]],
        corner_faces: &[u32],
    ) -> (Vec<[f64; N]>, Vec<[f64; N]>) {
        let mut middles = vec![[0.0; N]; half_edges.edge_count];
        let mut values = middles.clone();
        for c in 0..self.corners.len() {
            let edge = half_edges.edges[c] as usize;
            let middle = scaled(sum(self.at(c as u32), self.at(half_edges.next[c])), 0.5);
            let face_point = |c: usize| face_points[corner_faces[c] as usize];
            middles[edge] = middle;
            values[edge] = match half_edges.twins[c] {
                NONE => middle,
                // The order of summation is the same from both sides.
                opposite => {
                    let (a, b) = (c.min(opposite as usize), c.max(opposite as usize));
                    sum(scaled(middle, 0.5), scaled(sum(face_point(a), face_point(b)), 0.25))
                }
            };
        }
        (middles, values)
    }

    fn vertex_values(
        &self,
        half_edges: &HalfEdges,
        boundary: Boundary,
        face_points: &[[f64; N]],
        corner_faces: &[u32],
        middles: &[[f64; N]],
    ) -> Vec<[f64; N]> {
        let moved = |value: usize| {
            let own = self.values[value];
            match vertex_rule(half_edges, value, boundary) {
                VertexRule::Interior(n) => {
                    let mut around = [0.0; N];
                    for c in half_edges.around(half_edges.first[value]) {
                        let middle = middles[half_edges.edges[c as usize] as usize];
                        around = sum(
                            around,
                            sum(face_points[corner_faces[c as usize] as usize], scaled(middle, 2.0)),
                        );
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

    /// Limit points of a layer of quads (Halstead, Kass, DeRose 1993, "Efficient, Fair Interpolation using Catmull-Clark
    /// Surfaces", section 3).
    pub fn limits(&self, half_edges: &HalfEdges, boundary: Boundary) -> Vec<[f64; N]> {
        let limit = |value: usize| {
            let own = self.values[value];
            match vertex_rule(half_edges, value, boundary) {
                VertexRule::Interior(n) => {
                    let mut around = [0.0; N];
                    for c in half_edges.around(half_edges.first[value]) {
                        let next = half_edges.next[c as usize];
                        let across = self.at(half_edges.next[next as usize]);
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

/// Unit normals of the limit surface: at interior vertices from the tangents of Halstead, Kass, DeRose 1993 (appendix A), at
/// boundary vertices area-weighted means of the adjacent facets' normals.
pub(super) fn normals(points: &Layer<3>, limits: &[[f64; 3]], half_edges: &HalfEdges) -> Layer<3> {
    let mut normals = Layer { values: Vec::new(), corners: vec![NONE; points.corners.len()] };
    for corner in 0..points.corners.len() as u32 {
        if normals.corners[corner as usize] != NONE {
            continue;
        }
        let number = normals.values.len() as u32;
        let value = points.corners[corner as usize] as usize;
        let start = rightmost_corner(half_edges, corner);
        let facet_mean = || facet_normal(points, limits, half_edges, start);
        let normal = match half_edges.is_interior(value) {
            true => limit_normal(points, half_edges, start).unwrap_or_else(facet_mean),
            false => facet_mean(),
        };
        for c in half_edges.around(start) {
            normals.corners[c as usize] = number;
        }
        normals.values.push(normal.to_array());
    }
    normals
}

/// The rightmost corner of the fan of faces around a vertex: iteration to the left from it visits the whole fan.
fn rightmost_corner(half_edges: &HalfEdges, corner: u32) -> u32 {
    let mut start = corner;
    loop {
        match half_edges.right(start) {
            NONE => return start,
            // The fan is closed.
            right if right == corner => return corner,
            right => start = right,
        }
    }
}

/// Normal from the limit tangents; `None` if they are parallel.
fn limit_normal(points: &Layer<3>, half_edges: &HalfEdges, start: u32) -> Option<DVec3> {
    let ring: Vec<(DVec3, DVec3)> = half_edges
        .around(start)
        .map(|c| {
            let next = half_edges.next[c as usize];
            (DVec3::from(points.at(next)), DVec3::from(points.at(half_edges.next[next as usize])))
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

fn facet_normal(points: &Layer<3>, limits: &[[f64; 3]], half_edges: &HalfEdges, start: u32) -> DVec3 {
    let limit = |c: u32| DVec3::from(limits[points.corners[c as usize] as usize]);
    let facet = |c: u32| {
        let at = limit(c);
        (limit(half_edges.next[c as usize]) - at).cross(limit(half_edges.prev[c as usize]) - at)
    };
    half_edges.around(start).map(facet).sum::<DVec3>().normalize_or(DVec3::Y)
}

/// Values of one attribute with the connectivity of the faces; texture coordinates may have seams where points have none.
#[derive(Clone, Debug, Default)]
pub(super) struct Layer<const N: usize> {
    pub values: Vec<[f64; N]>,
    /// Value index of each corner.
    pub corners: Vec<u32>,
}

impl<const N: usize> Layer<N> {
    /// A layer from `at`, which returns key and value of a vertex; vertices with equal keys share a value.
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

/// The polygons of a mesh before subdivision.
#[derive(Clone, Debug, Default)]
pub(in crate::load) struct Cage {
    /// Name, positions, texture coordinates, colours and attributes of vertices; nothing else.
    pub mesh: Mesh,
    /// Point index of each vertex; faces are connected by shared points.
    pub points: Vec<u32>,
    /// Vertex index of each corner.
    pub corners: Vec<u32>,
    /// Number of corners of each face.
    pub arities: Vec<u32>,
    /// Material of each face.
    pub materials: Vec<MaterialId>,
}

impl Cage {
    /// The triangles of a mesh as faces, connected where corners have the same position.
    pub fn of_triangles(mesh: &Mesh) -> Cage {
        let mut known: HashMap<[u32; 3], u32> = HashMap::new();
        let point = |p: &[f32; 3]| {
            let next = known.len() as u32;
            // Adding 0 turns -0 into 0.
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

    /// Copies the name from the triangulated mesh, and drops the colours if that has none.
    pub fn finish(&mut self, mesh: &Mesh) {
        self.mesh.name.clone_from(&mesh.name);
        if mesh.colors.is_empty() {
            self.mesh.colors = Vec::new();
        }
    }

    /// Number of triangles after `levels` levels.
    pub fn triangles_after(&self, levels: u32) -> u64 {
        2 * (self.corners.len() as u64).saturating_mul(4u64.saturating_pow(levels.saturating_sub(1)))
    }

    /// The faces with finite corners, sorted by material in order of first appearance.
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

    /// Positions of the corners.
    pub(super) fn point_layer(&self) -> Layer<3> {
        Layer::new(&self.corners, |v| (self.points[v as usize], self.mesh.positions[v as usize]))
    }

    /// Texture coordinates of the corners, connected where both point and coordinates are the same.
    pub(super) fn uv_layers(&self) -> Vec<Layer<2>> {
        let sets = self.mesh.uv_sets.iter().filter(|set| !set.is_empty());
        sets.map(|set| self.varying(set)).collect()
    }

    /// Colours, likewise.
    pub(super) fn color_layer(&self) -> Option<Layer<4>> {
        (!self.mesh.colors.is_empty()).then(|| self.varying(&self.mesh.colors))
    }

    /// Attributes, likewise, padded with zeros.
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

/// No corner, edge or vertex.
pub(super) const NONE: u32 = u32::MAX;

/// The connectivity of one layer, as half-edges: the edge of a corner leads to the next corner of its face.
pub(super) struct HalfEdges {
    /// Edge index of each corner.
    pub edges: Vec<u32>,
    /// The opposite half-edge of each corner; `NONE` at sharp edges: those of one face, of more than two, or of two with
    /// opposite orientations.
    pub twins: Vec<u32>,
    /// The next corner of the face.
    pub next: Vec<u32>,
    /// The previous corner of the face.
    pub prev: Vec<u32>,
    /// One corner of each value; `NONE` for unused values.
    pub first: Vec<u32>,
    /// Number of corners of each value.
    pub valence: Vec<u32>,
    /// Sharp edges at each value.
    pub sharp: Vec<Sharp>,
    pub edge_count: usize,
}

/// The sharp edges at a value: their number, and the other ends of the first two.
#[derive(Clone, Copy, Default)]
pub(super) struct Sharp {
    pub count: u32,
    pub ends: [u32; 2],
}

impl HalfEdges {
    /// The connectivity of faces with these numbers of corners; `corners` are indices of `count` values.
    pub fn new(arities: &[u32], corners: &[u32], count: usize) -> HalfEdges {
        let (next, prev) = rings(arities);
        let mut uses: Vec<(u32, u32, u32)> = (0..corners.len() as u32)
            .into_par_iter()
            .map(|c| {
                let (a, b) = (corners[c as usize], corners[next[c as usize] as usize]);
                (a.min(b), a.max(b), c)
            })
            .collect();
        uses.par_sort_unstable();
        let mut half_edges = HalfEdges {
            edges: vec![0; corners.len()],
            twins: vec![NONE; corners.len()],
            first: vec![NONE; count],
            valence: vec![0; count],
            sharp: vec![Sharp::default(); count],
            edge_count: 0,
            next,
            prev,
        };
        for edge in uses.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            for use_ in edge {
                half_edges.edges[use_.2 as usize] = half_edges.edge_count as u32;
            }
            half_edges.edge_count += 1;
            match edge {
                [(a, b, x), (_, _, y)] if corners[*x as usize] != corners[*y as usize] && a != b => {
                    (half_edges.twins[*x as usize], half_edges.twins[*y as usize]) = (*y, *x);
                }
                _ => {
                    let (a, b) = (edge[0].0, edge[0].1);
                    half_edges.sharp[a as usize].add(b);
                    half_edges.sharp[b as usize].add(a);
                }
            }
        }
        for (c, &value) in corners.iter().enumerate() {
            half_edges.first[value as usize] = c as u32;
            half_edges.valence[value as usize] += 1;
        }
        half_edges
    }

    /// The corner at the same value in the left neighbour face; `NONE` at a sharp edge.
    pub fn left(&self, corner: u32) -> u32 {
        self.twins[self.prev[corner as usize] as usize]
    }

    /// The corner at the same value in the right neighbour face; `NONE` at a sharp edge.
    pub fn right(&self, corner: u32) -> u32 {
        match self.twins[corner as usize] {
            NONE => NONE,
            opposite => self.next[opposite as usize],
        }
    }

    /// The corners around a value from `start` to the left, until a sharp edge or once around.
    pub fn around(&self, start: u32) -> impl Iterator<Item = u32> + '_ {
        std::iter::successors(Some(start), move |&c| Some(self.left(c)).filter(|&c| c != NONE && c != start))
    }

    /// Whether the faces at a value form one closed fan.
    pub fn is_interior(&self, value: usize) -> bool {
        self.sharp[value].count == 0
            && self.first[value] != NONE
            && self.around(self.first[value]).count() == self.valence[value] as usize
    }
}

impl Sharp {
    fn add(&mut self, end: u32) {
        if let Some(slot) = self.ends.get_mut(self.count as usize) {
            *slot = end;
        }
        self.count += 1;
    }
}

/// The next and the previous corner of each corner.
fn rings(arities: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let (mut next, mut prev, mut first) = (Vec::new(), Vec::new(), 0);
    for &arity in arities {
        next.extend((1..arity).map(|k| first + k).chain([first]));
        prev.extend([first + arity - 1].into_iter().chain((0..arity - 1).map(|k| first + k)));
        first += arity;
    }
    (next, prev)
}
