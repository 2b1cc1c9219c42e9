//! Polygons and strips to triangles, with their indices checked.

use super::elements::Face;
use super::wedges::Wedges;
use crate::error::Problem;
use crate::load::polygon::triangulate;
use crate::scene::Mesh;

/// How a list of indices is meant.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Polygon,
    /// Triangles that share edges; -1 begins anew.
    Strip,
}

/// How many problems of one kind are worth listing.
const LISTED: usize = 10;

/// Adds faces to a mesh and notes those that refer to missing vertices.
#[derive(Default)]
pub(super) struct Faces {
    problems: Vec<Problem>,
    bad: usize,
    /// Faces that stand before the vertices in the file.
    waiting: Vec<(Kind, usize, Face)>,
    vertices_known: bool,
    /// What corners have of their own, where the file has that.
    pub wedges: Option<Wedges>,
    /// Faces of fewer than three corners.
    pub short: usize,
}

impl Faces {
    /// Of a file whose corners have something of their own, or not.
    pub fn with_wedges(has_wedges: bool) -> Faces {
        Faces { wedges: has_wedges.then(Wedges::default), ..Faces::default() }
    }

    /// Adds row `i` of the faces or strips.
    #[inline]
    pub fn add(&mut self, mesh: &mut Mesh, kind: Kind, i: usize, face: &Face) {
        if !self.vertices_known {
            return self.waiting.push((kind, i, face.clone()));
        }
        let indices = &face.indices[..];
        let count = mesh.positions.len() as i64;
        let inside = |v: i64| (0..count).contains(&v);
        if let ([a, b, c], Kind::Polygon) = (indices, kind)
            && inside(*a)
            && inside(*b)
            && inside(*c)
        {
            if let Some(wedges) = &mut self.wedges {
                wedges.add(face, &[[0, 1, 2]]);
            }
            return mesh.triangles.push([*a, *b, *c].map(|v| v as u32));
        }
        match indices.iter().find(|&&v| !(inside(v) || kind == Kind::Strip && v == -1)) {
            Some(&v) => self.complain(kind, i, v, count),
            None if indices.len() < 3 => self.short += 1,
            None if kind == Kind::Polygon => {
                let cut = cut_polygon(mesh, indices);
                if let Some(wedges) = &mut self.wedges {
                    wedges.add(face, &cut);
                }
            }
            None => {
                add_strip(mesh, indices);
                if let Some(wedges) = &mut self.wedges {
                    wedges.pad(mesh.triangles.len());
                }
            }
        }
    }

    /// Call when the vertices have been read: adds the faces that came before them.
    pub fn catch_up(&mut self, mesh: &mut Mesh) {
        self.vertices_known = true;
        for (kind, i, face) in std::mem::take(&mut self.waiting) {
            self.add(mesh, kind, i, &face);
        }
    }

    /// Everything that was wrong.
    pub fn problems(&mut self) -> Vec<Problem> {
        if self.bad > LISTED {
            let message = format!("{} more faces refer to missing vertices", self.bad - LISTED);
            self.problems.push(Problem::new("", message));
        }
        std::mem::take(&mut self.problems)
    }

    #[cold]
    fn complain(&mut self, kind: Kind, i: usize, vertex: i64, count: i64) {
        self.bad += 1;
        if self.bad <= LISTED {
            let name = if kind == Kind::Polygon { "face" } else { "tristrips" };
            let message = format!("refers to vertex {vertex}, but there are {count}");
            self.problems.push(Problem::new(format!("{name} {i}"), message));
        }
    }
}

/// Adds a polygon; gives the corners of its triangles.
fn cut_polygon(mesh: &mut Mesh, indices: &[i64]) -> Vec<[usize; 3]> {
    let corners: Vec<[f32; 3]> = indices.iter().map(|&v| mesh.positions[v as usize]).collect();
    let cut = triangulate(&corners);
    mesh.triangles.extend(cut.iter().map(|t| t.map(|k| indices[k] as u32)));
    cut
}

fn add_strip(mesh: &mut Mesh, indices: &[i64]) {
    for run in indices.split(|&v| v == -1) {
        let flip = |k: usize| if k.is_multiple_of(2) { [0, 1, 2] } else { [1, 0, 2] };
        mesh.triangles.extend(run.windows(3).enumerate().map(|(k, w)| flip(k).map(|c| w[c] as u32)));
    }
}
