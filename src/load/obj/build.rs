//! From the models that `tobj` returns to meshes: polygons become triangles, models of one object one mesh, and vertices
//! without a normal of the file get that of their face or of their smoothing group.

use super::piece::Piece;
use super::statements::{MaterialName, Statements};
use crate::color::linear_from_srgb;
use crate::load::polygon::triangulate;
use crate::load::subdivide::Cage;
use crate::math::DVec3;
use crate::scene::Mesh;
use std::collections::HashMap;
use std::iter::Peekable;
use std::slice::Iter;

/// Consecutive triangles of one material.
#[derive(Clone, Copy)]
pub(super) struct Run {
    pub first_triangle: u32,
    pub material: MaterialName,
}

/// The faces of one object or group.
pub(super) struct Object {
    /// Everything but its parts.
    pub mesh: Mesh,
    /// Runs of triangles, each material once.
    pub runs: Vec<Run>,
    /// Its polygons and the material of each, where they are kept; materials of the cage are not known yet.
    pub cage: Option<(Cage, Vec<MaterialName>)>,
    /// Vertices whose normal comes from a smoothing group: vertex, position of the file, group.
    smooth: Vec<(u32, u32, u32)>,
}

/// The objects of a file around an origin, from the models that `tobj` made of the pieces.
pub(super) fn objects(models: Vec<tobj::Model>, statements: &Statements, origin: DVec3) -> Vec<Object> {
    let mut builder = Builder {
        statements,
        origin,
        corners: &statements.corners,
        runs: statements.runs.iter().peekable(),
        face: 0,
        material: None,
        sums: HashMap::new(),
    };
    let mut models = models.into_iter().map(|m| m.mesh);
    let mut objects = Vec::new();
    for pieces in statements.pieces.chunk_by(|a, b| a.object == b.object) {
        objects.push(builder.object(pieces, models.by_ref().take(pieces.len()).collect()));
    }
    for object in &mut objects {
        for (vertex, position, group) in std::mem::take(&mut object.smooth) {
            if let Some(sum) = builder.sums.get(&(position, group)) {
                object.mesh.normals[vertex as usize] = *sum;
            }
        }
    }
    objects
}

/// Says which objects share points, where polygons are kept: each is subdivided for itself.
pub(super) fn shared_points(objects: &[Object]) -> Option<String> {
    let mut owners: HashMap<u32, usize> = HashMap::new();
    for (number, object) in objects.iter().enumerate() {
        let (cage, _) = object.cage.as_ref()?;
        for &point in &cage.points {
            let owner = *owners.entry(point).or_insert(number);
            if owner != number {
                let names = [owner, number].map(|i| &objects[i].mesh.name);
                return Some(format!(
                    "objects or groups share points, such as '{}' and '{}': each is subdivided for itself, with an edge where they meet",
                    names[0], names[1]
                ));
            }
        }
    }
    None
}

struct Builder<'s> {
    statements: &'s Statements,
    /// What is subtracted from positions.
    origin: DVec3,
    /// The noted positions of the corners to come.
    corners: &'s [u32],
    /// The materials to come.
    runs: Peekable<Iter<'s, (usize, MaterialName)>>,
    /// Number of the next face.
    face: usize,
    material: MaterialName,
    /// Sums of face normals by position and smoothing group: groups reach across objects.
    sums: HashMap<(u32, u32), [f32; 3]>,
}

/// What `tobj` made of a piece, and what it doesn't tell.
struct Part<'s> {
    piece: &'s Piece,
    model: tobj::Mesh,
    triangles: Vec<[u32; 3]>,
    /// Number in the file of each vertex's position, where that was noted.
    numbers: Vec<u32>,
}

impl Builder<'_> {
    fn object(&mut self, pieces: &[Piece], models: Vec<tobj::Mesh>) -> Object {
        let mut mesh = Mesh { name: self.statements.objects[pieces[0].object].clone(), ..Mesh::default() };
        mesh.positions.reserve_exact(models.iter().map(|m| m.positions.len() / 3).sum());
        mesh.triangles.reserve_exact(models.iter().map(|m| m.indices.len() / 3).sum());
        if pieces.iter().any(|p| p.has_uvs) {
            mesh.uv_sets.push(Vec::with_capacity(mesh.positions.capacity()));
        }
        let is_flat = pieces.iter().all(Piece::is_flat);
        let cage = self.statements.keeps_polygons.then(Default::default);
        let mut object = Object { mesh, runs: Vec::new(), cage, smooth: Vec::new() };
        let mut is_colored = false;
        for (piece, mut model) in pieces.iter().zip(models) {
            let numbers = self.numbers(piece, &model);
            self.subtract_origin(&mut model, &numbers);
            let triangles = self.triangles(&model, &mut object);
            is_colored |= numbers.iter().any(|&n| (n as usize) < self.statements.colors.len());
            let part = Part { piece, model, triangles, numbers };
            self.add_to_group(&part);
            object.add_polygons(&part, &self.statements.colors);
            object.add(&part, is_flat, &self.statements.colors);
        }
        if !is_colored {
            object.mesh.colors = Vec::new();
        }
        if let Some((cage, _)) = &mut object.cage {
            cage.finish(&object.mesh);
        }
        object.runs = each_material_once(&mut object.mesh.triangles, object.runs);
        object
    }

    /// Makes the positions of vertices relative to the origin, from those of these numbers in double precision.
    fn subtract_origin(&self, model: &mut tobj::Mesh, numbers: &[u32]) {
        for axis in (0..3).filter(|&axis| self.origin[axis] != 0.0) {
            let positions = model.positions.as_chunks_mut::<3>().0;
            for (position, &number) in positions.iter_mut().zip(numbers) {
                let precise = self.statements.precise.get(number as usize).map_or(f64::NAN, |p| p[axis]);
                let precise = if precise.is_nan() { f64::from(position[axis]) } else { precise };
                position[axis] = (precise - self.origin[axis]) as f32;
            }
        }
    }

    /// The triangles of a model's polygons; notes where materials change.
    fn triangles(&mut self, model: &tobj::Mesh, object: &mut Object) -> Vec<[u32; 3]> {
        let positions = model.positions.as_chunks::<3>().0;
        let first = object.mesh.triangles.len();
        let mut triangles = Vec::with_capacity(model.indices.len() / 3);
        let mut arities = model.face_arities.iter();
        let mut rest = &model.indices[..];
        while !rest.is_empty() {
            // Models of triangles alone say nothing about arities.
            let (corners, behind) = rest.split_at(arities.next().map_or(3, |&n| n as usize));
            rest = behind;
            self.begin_face((first + triangles.len()) as u32, &mut object.runs);
            if let Some((_, materials)) = &mut object.cage {
                materials.push(self.material);
            }
            if let [a, b, c] = *corners {
                triangles.push([a, b, c]);
                continue;
            }
            let points: Vec<[f32; 3]> = corners.iter().map(|&i| positions[i as usize]).collect();
            triangles.extend(triangulate(&points).into_iter().map(|t| t.map(|k| corners[k])));
        }
        triangles
    }

    fn begin_face(&mut self, first_triangle: u32, runs: &mut Vec<Run>) {
        let change = self.runs.next_if(|run| run.0 == self.face);
        if let Some(&(_, material)) = change {
            self.material = material;
        }
        if runs.last().is_none_or(|r| r.material != self.material) {
            runs.push(Run { first_triangle, material: self.material });
        }
        self.face += 1;
    }

    /// The numbers of a model's vertices, if they were noted.
    fn numbers(&mut self, piece: &Piece, model: &tobj::Mesh) -> Vec<u32> {
        if !self.statements.notes_corners(piece.group) {
            return Vec::new();
        }
        let (noted, rest) = self.corners.split_at(model.indices.len());
        self.corners = rest;
        let mut numbers = vec![0; model.positions.len() / 3];
        for (&vertex, &number) in model.indices.iter().zip(noted) {
            numbers[vertex as usize] = number;
        }
        numbers
    }

    /// Adds the normal of each triangle of a smoothing group to its corners, weighted by the angle there (Thuermer and
    /// Wuethrich 1998, "Computing Vertex Normals from Polygonal Facets"), so that it doesn't matter how a polygon was cut.
    fn add_to_group(&mut self, part: &Part) {
        let Some(group) = part.piece.group else { return };
        for triangle in &part.triangles {
            let p = part.corners(triangle);
            // Without an area it has no normal, and weighs nothing.
            let Some(normal) = (p[1] - p[0]).cross(p[2] - p[0]).try_normalize() else { continue };
            for (i, &vertex) in triangle.iter().enumerate() {
                let angle = (p[(i + 1) % 3] - p[i]).angle_between(p[(i + 2) % 3] - p[i]);
                let sum = self.sums.entry((part.numbers[vertex as usize], group)).or_default();
                let [x, y, z] = (normal * angle).as_vec3().to_array();
                *sum = [sum[0] + x, sum[1] + y, sum[2] + z];
            }
        }
    }
}

impl Part<'_> {
    fn corners(&self, triangle: &[u32; 3]) -> [DVec3; 3] {
        let positions = self.model.positions.as_chunks::<3>().0;
        triangle.map(|i| DVec3::from(positions[i as usize].map(f64::from)))
    }
}

impl Object {
    /// Appends the polygons of a part to the cage.
    fn add_polygons(&mut self, part: &Part, colors: &[[f32; 3]]) {
        let Some((cage, _)) = &mut self.cage else { return };
        let Part { model, numbers, .. } = part;
        let base = cage.mesh.positions.len() as u32;
        cage.mesh.positions.extend_from_slice(model.positions.as_chunks::<3>().0);
        cage.points.extend_from_slice(numbers);
        if !self.mesh.uv_sets.is_empty() {
            cage.mesh.uv_sets.resize_with(1, Vec::new);
            cage.mesh.uv_sets[0].extend((0..numbers.len()).map(|v| texture_coordinates(model, v)));
        }
        if !colors.is_empty() {
            cage.mesh.colors.extend(numbers.iter().map(|&number| vertex_color(colors, number)));
        }
        cage.corners.extend(model.indices.iter().map(|v| base + v));
        match model.face_arities.is_empty() {
            true => cage.arities.extend(vec![3; model.indices.len() / 3]),
            false => cage.arities.extend_from_slice(&model.face_arities),
        }
    }

    /// Appends a part. Where flat faces meet smooth ones in a mesh, each corner of the flat ones gets a vertex of its own.
    fn add(&mut self, part: &Part, is_flat: bool, colors: &[[f32; 3]]) {
        let Part { piece, model, triangles, numbers } = part;
        let (base, mesh) = (self.mesh.positions.len() as u32, &mut self.mesh);
        let vertices: Vec<u32> = if piece.is_flat() && !is_flat {
            let corners = triangles.iter().map(|t| part.corners(t));
            let normals =
                corners.map(|[a, b, c]| (b - a).cross(c - a).normalize_or_zero().as_vec3().to_array());
            mesh.normals.extend(normals.flat_map(|n| [n; 3]));
            mesh.triangles.extend((0..triangles.len() as u32).map(|t| [0, 1, 2].map(|k| base + 3 * t + k)));
            triangles.as_flattened().to_vec()
        } else {
            mesh.triangles.extend(triangles.iter().map(|t| t.map(|i| base + i)));
            (0..model.positions.len() as u32 / 3).collect()
        };
        let of_vertices = vertices.iter().map(|&v| v as usize);
        mesh.positions.extend(of_vertices.clone().map(|v| model.positions.as_chunks::<3>().0[v]));
        if piece.has_normals {
            mesh.normals.extend_from_slice(model.normals.as_chunks::<3>().0);
        } else if let Some(group) = piece.group {
            mesh.normals.resize(mesh.positions.len(), [0.0; 3]);
            self.smooth.extend(numbers.iter().zip(base..).map(|(&number, v)| (v, number, group)));
        }
        if let Some(set) = mesh.uv_sets.first_mut() {
            set.extend(of_vertices.clone().map(|v| texture_coordinates(model, v)));
        }
        if !colors.is_empty() {
            mesh.colors.extend(of_vertices.map(|v| vertex_color(colors, numbers[v])));
        }
    }
}

/// Of a vertex, 0 where the file has none. The file's v grows upwards.
fn texture_coordinates(model: &tobj::Mesh, vertex: usize) -> [f32; 2] {
    model.texcoords.as_chunks::<2>().0.get(vertex).map_or([0.0, 1.0], |[u, v]| [*u, 1.0 - v])
}

/// The linear colour of a position of the file, white where it has none.
fn vertex_color(colors: &[[f32; 3]], number: u32) -> [f32; 4] {
    let [r, g, b] = colors.get(number as usize).copied().unwrap_or([1.0; 3]).map(linear_from_srgb);
    [r, g, b, 1.0]
}

/// Sorts triangles so that each material has one run, in the order in which materials first appear.
fn each_material_once(triangles: &mut Vec<[u32; 3]>, runs: Vec<Run>) -> Vec<Run> {
    let mut order: HashMap<MaterialName, usize> = HashMap::new();
    for run in &runs {
        let next = order.len();
        order.entry(run.material).or_insert(next);
    }
    if order.len() == runs.len() {
        return runs;
    }
    let mut sorted: Vec<Vec<[u32; 3]>> = vec![Vec::new(); order.len()];
    let mut names = vec![None; order.len()];
    for (i, run) in runs.iter().enumerate() {
        let end = runs.get(i + 1).map_or(triangles.len(), |r| r.first_triangle as usize);
        let place = order[&run.material];
        names[place] = run.material;
        sorted[place].extend_from_slice(&triangles[run.first_triangle as usize..end]);
    }
    triangles.clear();
    let mut merged = Vec::new();
    for (part, material) in sorted.iter().zip(names) {
        merged.push(Run { first_triangle: triangles.len() as u32, material });
        triangles.extend_from_slice(part);
    }
    merged
}
