//! From faces to meshes: polygons become triangles, corners vertices, and vertices without a normal of the file get
//! that of their face or of their smoothing group.

use super::vertices::{Corner, NormalSource, Vertices};
use crate::color::linear_from_srgb;
use crate::load::polygon::triangulate;
use crate::math::DVec3;
use crate::scene::Mesh;
use std::collections::HashMap;

/// What faces refer to, in file order.
#[derive(Default)]
pub(super) struct Attributes {
    pub positions: Vec<[f32; 3]>,
    /// Colours as in the file; those of the first positions, white where there is none.
    pub colors: Vec<[f32; 3]>,
    pub uvs: Vec<[f32; 2]>,
    pub normals: Vec<[f32; 3]>,
}

/// Number of a material's name among those that the file uses; `None` before the first `usemtl`.
pub(super) type MaterialName = Option<u32>;

/// Consecutive triangles of one material.
#[derive(Clone, Copy)]
pub(super) struct Run {
    pub first_triangle: u32,
    pub material: MaterialName,
}

/// The faces of one object or group.
pub(super) struct Object {
    /// Everything but its parts and the normals of smoothing groups.
    pub mesh: Mesh,
    /// Runs of triangles, each material once.
    pub runs: Vec<Run>,
    /// Vertices whose normal comes from a smoothing group: vertex, position of the file, group.
    smooth: Vec<(u32, u32, u32)>,
}

/// Collects faces.
#[derive(Default)]
pub(super) struct Builder {
    pub attributes: Attributes,
    pub objects: Vec<Object>,
    name: String,
    vertices: Vertices,
    triangles: Vec<[u32; 3]>,
    runs: Vec<Run>,
    /// Sums of face normals by position and smoothing group: groups reach across objects.
    smooth: HashMap<(u32, u32), [f32; 3]>,
}

impl Builder {
    /// The faces from here on belong to another object.
    pub fn begin(&mut self, name: String) {
        self.close();
        self.name = name;
    }

    /// Adds a polygon, whose corners have been checked.
    #[inline]
    pub fn face(&mut self, corners: &[Corner], material: MaterialName) {
        let first_triangle = self.triangles.len() as u32;
        if self.runs.last().is_none_or(|r| r.material != material) {
            self.runs.push(Run { first_triangle, material });
        }
        if let [a, b, c] = *corners {
            return self.triangle([a, b, c]);
        }
        let points: Vec<[f32; 3]> =
            corners.iter().map(|c| self.attributes.positions[c.position as usize]).collect();
        for t in triangulate(&points) {
            self.triangle(t.map(|k| corners[k]));
        }
    }

    #[inline]
    fn triangle(&mut self, corners: [Corner; 3]) {
        self.triangles.push(corners.map(|c| self.vertices.index(c)));
        if corners.iter().any(|c| c.normal.group().is_some()) {
            self.add_to_groups(corners);
        }
    }

    /// Adds the triangle's normal, weighted by the angle at each corner (Thuermer and Wuethrich 1998, "Computing Vertex
    /// Normals from Polygonal Facets"), so that it doesn't matter how a polygon was cut.
    fn add_to_groups(&mut self, corners: [Corner; 3]) {
        let point = |c: Corner| DVec3::from(self.attributes.positions[c.position as usize].map(f64::from));
        let p = corners.map(point);
        let Some(normal) = (p[1] - p[0]).cross(p[2] - p[0]).try_normalize() else { return };
        for (i, corner) in corners.iter().enumerate() {
            let Some(group) = corner.normal.group() else { continue };
            let angle = (p[(i + 1) % 3] - p[i]).angle_between(p[(i + 2) % 3] - p[i]);
            let sum = self.smooth.entry((corner.position, group)).or_default();
            let [x, y, z] = (normal * angle).as_vec3().to_array();
            *sum = [sum[0] + x, sum[1] + y, sum[2] + z];
        }
    }

    /// All objects, with the normals of their smoothing groups.
    pub fn finish(mut self) -> Vec<Object> {
        self.close();
        self.attributes = Attributes::default();
        for object in &mut self.objects {
            for (vertex, position, group) in std::mem::take(&mut object.smooth) {
                if let Some(sum) = self.smooth.get(&(position, group)) {
                    object.mesh.normals[vertex as usize] = *sum;
                }
            }
        }
        self.objects
    }

    /// Makes a mesh of the faces since the last object began.
    fn close(&mut self) {
        if self.triangles.is_empty() {
            return;
        }
        let flat = |v: &Corner| v.normal == NormalSource::FLAT;
        let is_flat = self.vertices.corners.iter().all(flat);
        let face_normals = if !is_flat && self.vertices.corners.iter().any(flat) {
            self.separate_flat_corners()
        } else {
            Vec::new()
        };
        let corners = self.vertices.take();
        let mut mesh = Mesh { name: self.name.clone(), ..Mesh::default() };
        mesh.triangles = std::mem::take(&mut self.triangles);
        mesh.positions = corners.iter().map(|c| self.attributes.positions[c.position as usize]).collect();
        self.fill_uvs_and_colors(&mut mesh, &corners);
        let mut smooth = Vec::new();
        if !is_flat {
            let given = &self.attributes.normals;
            mesh.normals =
                corners.iter().map(|c| c.normal.index().map_or([0.0; 3], |i| given[i as usize])).collect();
            for (vertex, normal) in face_normals {
                mesh.normals[vertex as usize] = normal;
            }
            let of_groups =
                corners.iter().zip(0..).filter_map(|(c, v)| Some((v, c.position, c.normal.group()?)));
            smooth = of_groups.collect();
        }
        let runs = each_material_once(&mut mesh.triangles, std::mem::take(&mut self.runs));
        self.objects.push(Object { mesh, runs, smooth });
    }

    /// Where flat faces meet smooth ones in a mesh, gives each flat corner a vertex of its own; the normals of these.
    fn separate_flat_corners(&mut self) -> Vec<(u32, [f32; 3])> {
        let (mut normals, mut taken) = (Vec::new(), vec![false; self.vertices.corners.len()]);
        for triangle in &mut self.triangles {
            let corners = triangle.map(|v| self.vertices.corners[v as usize]);
            if corners.iter().all(|c| c.normal != NormalSource::FLAT) {
                continue;
            }
            let [a, b, c] =
                corners.map(|c| DVec3::from(self.attributes.positions[c.position as usize].map(f64::from)));
            let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3().to_array();
            for (index, corner) in triangle.iter_mut().zip(corners) {
                if corner.normal != NormalSource::FLAT {
                    continue;
                }
                // The first face keeps the vertex.
                if std::mem::replace(&mut taken[*index as usize], true) {
                    *index = self.vertices.push(corner);
                }
                normals.push((*index, normal));
            }
        }
        normals
    }

    fn fill_uvs_and_colors(&self, mesh: &mut Mesh, corners: &[Corner]) {
        let Attributes { uvs, colors, .. } = &self.attributes;
        let uv = |c: &Corner| uvs.get(c.uv as usize).copied();
        if corners.iter().any(|c| uv(c).is_some()) {
            // The file's v grows upwards.
            let turned = |c: &Corner| uv(c).map_or([0.0, 1.0], |[u, v]| [u, 1.0 - v]);
            mesh.uv_sets = vec![corners.iter().map(turned).collect()];
        }
        let color = |c: &Corner| colors.get(c.position as usize).copied();
        if corners.iter().any(|c| color(c).is_some()) {
            let linear = |c: &Corner| {
                let [r, g, b] = color(c).unwrap_or([1.0; 3]).map(linear_from_srgb);
                [r, g, b, 1.0]
            };
            mesh.colors = corners.iter().map(linear).collect();
        }
    }
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
