//! Catmull-Clark subdivision of coarse meshes when they are loaded, by request: vertices of the result lie on the limit surface and
//! have its normals. Polygons of OBJ files count as they are; meshes of other files are subdivided by their triangles.

mod cage;
mod fans;
mod normals;
mod refine;
#[cfg(test)]
mod tests;

pub(super) use cage::Cage;

use crate::scene::{MaterialId, Mesh, MeshId, MeshPart};
use cage::Layer;
use fans::{Fans, NONE};
use refine::Edges;
use std::collections::{BTreeMap, HashMap};

/// Most triangles that all subdivided meshes of a scene may have together.
const MOST_TRIANGLES: u64 = 16_000_000;

/// Most steps.
pub const MOST_LEVELS: u32 = 10;

/// How a mesh is subdivided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Subdivision {
    /// Steps, from 0, which changes nothing, to [`MOST_LEVELS`]; each makes four faces of one.
    pub levels: u32,
    /// Corners of open sheets, which only one face has, become round, too, as Blender has it by default; else they stay where they
    /// are.
    pub has_round_corners: bool,
}

/// The polygons that meshes of a scene were cut from, and what was made of them.
#[derive(Clone, Debug, Default)]
pub struct Polygons {
    cages: BTreeMap<MeshId, Cage>,
    made: HashMap<(MeshId, Subdivision), MeshId>,
    /// Triangles of all that was made.
    triangles: u64,
}

impl Polygons {
    /// Keeps those of a mesh.
    pub(super) fn keep(&mut self, id: MeshId, cage: Cage) {
        self.cages.insert(id, cage);
    }

    /// What a mesh has been subdivided to, if it has.
    pub(super) fn known(&self, id: MeshId, how: Subdivision) -> Option<MeshId> {
        self.made.get(&(id, how)).copied()
    }

    /// Remembers that.
    pub(super) fn remember(&mut self, id: MeshId, how: Subdivision, fine: MeshId) {
        self.made.insert((id, how), fine);
    }

    /// A mesh, by its polygons if they are kept, else by its triangles.
    ///
    /// # Errors
    /// A message, if all would have too many triangles.
    pub(super) fn subdivided(&mut self, id: MeshId, mesh: &Mesh, how: Subdivision) -> Result<Mesh, String> {
        let of_triangles;
        let cage = match self.cages.get(&id) {
            Some(cage) => cage,
            None => {
                of_triangles = Cage::of_triangles(mesh);
                &of_triangles
            }
        };
        let fine = subdivided(cage, how, MOST_TRIANGLES - self.triangles)?;
        self.triangles += fine.triangles.len() as u64;
        Ok(fine)
    }

    /// Takes those of a file whose meshes and materials become part of a scene.
    pub(super) fn absorb(&mut self, other: Polygons, meshes: u32, materials: u32) {
        for (id, mut cage) in other.cages {
            cage.materials.iter_mut().for_each(|material: &mut MaterialId| material.0 += materials);
            self.cages.insert(MeshId(id.0 + meshes), cage);
        }
    }
}

/// The fine mesh on the limit surface of a cage.
///
/// # Errors
/// A message, if it would have too many triangles.
fn subdivided(cage: &Cage, how: Subdivision, budget: u64) -> Result<Mesh, String> {
    let count = cage.triangles_after(how.levels);
    if count > budget {
        let fitting = (1..how.levels).rev().find(|&n| cage.triangles_after(n) <= budget);
        let remedy = match fitting {
            Some(levels) => format!("of this mesh, at most {levels} fit"),
            None => "leave it as it is".to_string(),
        };
        return Err(format!(
            "'{}' would have {count} triangles after {} levels of subdivision, but all subdivided meshes together may have {MOST_TRIANGLES}: {remedy}",
            cage.mesh.name, how.levels
        ));
    }
    let cage = cage.sorted();
    let edges = if how.has_round_corners { Edges::RoundCorners } else { Edges::SharpCorners };
    let mut arities = cage.arities.clone();
    let (mut points, mut uvs, mut colors) = (cage.point_layer(), cage.uv_layers(), cage.color_layer());
    for _ in 0..how.levels {
        points = points.refined(&arities, edges);
        uvs.iter_mut().for_each(|layer| *layer = layer.refined(&arities, Edges::Fixed));
        colors = colors.map(|layer| layer.refined(&arities, Edges::Fixed));
        arities = vec![4; points.corners.len() / 4];
    }
    let fans = Fans::new(&arities, &points.corners, points.values.len());
    let limits = points.limits(&fans, edges);
    let normals = normals::normals(&points, &limits, &fans);
    points.values = limits;
    uvs.iter_mut().for_each(|layer| to_limit(layer, &arities));
    if let Some(layer) = &mut colors {
        to_limit(layer, &arities);
    }
    let mut mesh = assembled(&points, &normals, &uvs, colors.as_ref());
    mesh.name.clone_from(&cage.mesh.name);
    mesh.parts = parts(&cage, how.levels);
    Ok(mesh)
}

fn to_limit<const N: usize>(layer: &mut Layer<N>, arities: &[u32]) {
    let fans = Fans::new(arities, &layer.corners, layer.values.len());
    layer.values = layer.limits(&fans, Edges::Fixed);
}

/// The runs of triangles of the cage's materials.
fn parts(cage: &Cage, levels: u32) -> Vec<MeshPart> {
    let (mut parts, mut first_triangle) = (Vec::new(), 0);
    let mut arities = cage.arities.iter();
    for run in cage.materials.chunk_by(|a, b| a == b) {
        let corners: u32 = arities.by_ref().take(run.len()).sum();
        let triangle_count = 2 * corners * 4u32.pow(levels - 1);
        parts.push(MeshPart { first_triangle, triangle_count, material: run[0] });
        first_triangle += triangle_count;
    }
    parts
}

/// A mesh of quads with a vertex for each combination of values that corners have.
fn assembled(points: &Layer<3>, normals: &Layer<3>, uvs: &[Layer<2>], colors: Option<&Layer<4>>) -> Mesh {
    let mut mesh = Mesh { uv_sets: vec![Vec::new(); uvs.len()], ..Mesh::default() };
    let is_same = |a: u32, b: u32| {
        let (a, b) = (a as usize, b as usize);
        normals.corners[a] == normals.corners[b]
            && uvs.iter().all(|layer| layer.corners[a] == layer.corners[b])
            && colors.is_none_or(|layer| layer.corners[a] == layer.corners[b])
    };
    // The vertices of each point, in a chain, and a corner of each.
    let (mut heads, mut chain, mut corner_of) = (vec![NONE; points.values.len()], Vec::new(), Vec::new());
    let mut vertices = Vec::with_capacity(points.corners.len());
    for c in 0..points.corners.len() as u32 {
        let head = &mut heads[points.corners[c as usize] as usize];
        let mut vertex = *head;
        while vertex != NONE && !is_same(corner_of[vertex as usize], c) {
            vertex = chain[vertex as usize];
        }
        if vertex == NONE {
            vertex = corner_of.len() as u32;
            corner_of.push(c);
            chain.push(std::mem::replace(head, vertex));
            mesh.positions.push(points.at(c).map(|x| x as f32));
            mesh.normals.push(normals.at(c).map(|x| x as f32));
            for (set, layer) in mesh.uv_sets.iter_mut().zip(uvs) {
                set.push(layer.at(c).map(|x| x as f32));
            }
            mesh.colors.extend(colors.map(|layer| layer.at(c).map(|x| x as f32)));
        }
        vertices.push(vertex);
    }
    let quads = vertices.as_chunks::<4>().0.iter();
    mesh.triangles = quads.flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    mesh
}
