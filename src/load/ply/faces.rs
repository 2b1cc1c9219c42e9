//! Triangulates polygons and strips, with checks of their indices.

use super::rows::Face;
use crate::error::Problem;
use crate::load::triangulate::triangulate;
use crate::scene::Mesh;
use std::collections::HashMap;

/// Interpretation of an index list.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum FaceLayout {
    Polygon,
    /// Triangle strips; -1 restarts.
    Strip,
}

/// Maximum number of problems of one kind in an error.
const MAX_LISTED: usize = 10;

/// Adds faces to a mesh and collects problems of faces that refer to missing vertices.
#[derive(Default)]
pub(super) struct Faces {
    problems: Vec<Problem>,
    /// Number of faces that refer to missing vertices.
    invalid_count: usize,
    /// Faces that precede the vertices in the file, with layout and row.
    pending: Vec<(FaceLayout, usize, Face)>,
    vertices_known: bool,
    /// Per-corner attributes, if the file has them.
    pub wedges: Option<Wedges>,
    /// Material index per triangle, if the file has them.
    pub materials: Option<Vec<i64>>,
    /// Number of faces of fewer than three corners.
    pub degenerate_count: usize,
    /// Linear RGBA per triangle, if faces have colours and vertices have none.
    pub colors: Option<Vec<[f32; 4]>>,
}

impl Faces {
    /// For files with or without per-corner attributes and material indices.
    pub fn new(has_wedges: bool, has_materials: bool) -> Faces {
        let wedges = has_wedges.then(Wedges::default);
        Faces { wedges, materials: has_materials.then(Vec::new), ..Faces::default() }
    }

    /// Also collects face colours if `has_colors`.
    pub fn with_colors(self, has_colors: bool) -> Faces {
        Faces { colors: has_colors.then(Vec::new), ..self }
    }

    /// Adds row `i` of the faces or strips.
    #[inline]
    pub fn add(&mut self, mesh: &mut Mesh, kind: FaceLayout, i: usize, face: &Face) {
        self.add_triangles(mesh, kind, i, face);
        if let Some(materials) = &mut self.materials {
            materials.resize(mesh.triangles.len(), face.material);
        }
        if let Some(colors) = &mut self.colors {
            colors.resize(mesh.triangles.len(), face.color);
        }
    }

    #[inline]
    fn add_triangles(&mut self, mesh: &mut Mesh, kind: FaceLayout, i: usize, face: &Face) {
        if !self.vertices_known {
            return self.pending.push((kind, i, face.clone()));
        }
        let indices = &face.indices[..];
        let count = mesh.positions.len() as i64;
        let inside = |v: i64| (0..count).contains(&v);
        if let ([a, b, c], FaceLayout::Polygon) = (indices, kind)
            && inside(*a)
            && inside(*b)
            && inside(*c)
        {
            if let Some(wedges) = &mut self.wedges {
                wedges.add(face, &[[0, 1, 2]]);
            }
            return mesh.triangles.push([*a, *b, *c].map(|v| v as u32));
        }
        match indices.iter().find(|&&v| !(inside(v) || kind == FaceLayout::Strip && v == -1)) {
            Some(&v) => self.add_problem(kind, i, v, count),
            None if indices.len() < 3 => self.degenerate_count += 1,
            None if kind == FaceLayout::Polygon => {
                let triangles = add_polygon(mesh, indices);
                if let Some(wedges) = &mut self.wedges {
                    wedges.add(face, &triangles);
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

    /// Adds the faces that precede the vertices in the file; call after reading the vertices.
    pub fn add_pending(&mut self, mesh: &mut Mesh) {
        self.vertices_known = true;
        for (kind, i, face) in std::mem::take(&mut self.pending) {
            self.add(mesh, kind, i, &face);
        }
    }

    /// Descriptions of the faces left out, for warnings.
    pub fn left_out(&self) -> Vec<String> {
        let mut list = Vec::new();
        if let Some(first) = self.problems.first() {
            let (place, message) = (&first.place, &first.message);
            list.push(format!("{} faces with missing vertices ({place}: {message})", self.invalid_count));
        }
        if self.degenerate_count > 0 {
            list.push(format!("{} faces of fewer than three corners", self.degenerate_count));
        }
        let mismatched = self.wedges.as_ref().map_or(0, |wedges| wedges.mismatched_count);
        if mismatched > 0 {
            list.push(format!(
                "texture coordinates of {mismatched} faces, whose length is not two numbers per corner"
            ));
        }
        list
    }

    /// Takes the problems; the last one counts those beyond the maximum.
    pub fn problems(&mut self) -> Vec<Problem> {
        if self.invalid_count > MAX_LISTED {
            let message = format!("{} more faces refer to missing vertices", self.invalid_count - MAX_LISTED);
            self.problems.push(Problem::new("", message));
        }
        std::mem::take(&mut self.problems)
    }

    #[cold]
    fn add_problem(&mut self, kind: FaceLayout, i: usize, vertex: i64, count: i64) {
        self.invalid_count += 1;
        if self.invalid_count <= MAX_LISTED {
            let name = if kind == FaceLayout::Polygon { "face" } else { "tristrips" };
            let message = format!("refers to vertex {vertex}, but there are {count}");
            self.problems.push(Problem::new(format!("{name} {i}"), message));
        }
    }
}

/// Triangulates a polygon; returns triangles as corner numbers of the polygon.
fn add_polygon(mesh: &mut Mesh, indices: &[i64]) -> Vec<[usize; 3]> {
    let corners: Vec<[f32; 3]> = indices.iter().map(|&v| mesh.positions[v as usize]).collect();
    let triangles = triangulate(&corners);
    mesh.triangles.extend(triangles.iter().map(|t| t.map(|k| indices[k] as u32)));
    triangles
}

fn add_strip(mesh: &mut Mesh, indices: &[i64]) {
    for run in indices.split(|&v| v == -1) {
        let flip = |k: usize| if k.is_multiple_of(2) { [0, 1, 2] } else { [1, 0, 2] };
        mesh.triangles.extend(run.windows(3).enumerate().map(|(k, w)| flip(k).map(|c| w[c] as u32)));
    }
}

/// Per-corner attributes of triangles ("wedges" in MeshLab): texture coordinates, which differ between faces at seams, and
/// the texture index of the face.
#[derive(Default)]
pub(super) struct Wedges {
    /// Texture coordinates of each triangle's corners; v grows downwards.
    corners: Vec<[[f32; 2]; 3]>,
    /// Texture index of each triangle; -1 for none.
    textures: Vec<i64>,
    /// Number of faces whose coordinate list isn't two numbers per corner.
    pub mismatched_count: usize,
}

/// Triangles with the same texture or material index, `number`.
pub(super) struct Run {
    pub number: i64,
    pub triangles: Vec<[u32; 3]>,
}

impl Wedges {
    /// Adds the attributes of a face's triangles, given as corner numbers. Missing coordinates are 0.
    #[inline]
    pub fn add(&mut self, face: &Face, triangles: &[[usize; 3]]) {
        let is_complete = face.wedges.len() == 2 * face.indices.len();
        // An empty list is a face without coordinates.
        self.mismatched_count += usize::from(!is_complete && !face.wedges.is_empty());
        let uv = |k: usize| match (is_complete, face.wedges.get(2 * k..2 * k + 2)) {
            (true, Some(&[u, v])) => [u, 1.0 - v],
            _ => [0.0; 2],
        };
        self.corners.extend(triangles.iter().map(|t| t.map(uv)));
        self.textures.resize(self.corners.len(), if face.wedges.is_empty() { -1 } else { face.texture });
    }

    /// Pads up to `triangles` triangles with default attributes, for strips.
    pub fn pad(&mut self, triangles: usize) {
        self.corners.resize(triangles, [[0.0; 2]; 3]);
        self.textures.resize(triangles, -1);
    }

    /// Duplicates vertices on texture seams, one for each texture coordinate.
    pub fn split(&self, mesh: &mut Mesh) {
        let count = mesh.positions.len();
        let mut first: Vec<Option<[u32; 2]>> = vec![None; count];
        let mut others: HashMap<(u32, [u32; 2]), u32> = HashMap::new();
        let mut uvs = vec![[0.0; 2]; count];
        for (triangle, corners) in mesh.triangles.iter_mut().zip(&self.corners) {
            for (vertex, uv) in triangle.iter_mut().zip(corners) {
                let (old, key) = (*vertex as usize, uv.map(f32::to_bits));
                if *first[old].get_or_insert(key) == key {
                    uvs[old] = *uv;
                    continue;
                }
                *vertex = *others.entry((*vertex, key)).or_insert_with(|| {
                    uvs.push(*uv);
                    mesh.positions.push(mesh.positions[old]);
                    let (normal, color) = (mesh.normals.get(old).copied(), mesh.colors.get(old).copied());
                    mesh.normals.extend(normal);
                    mesh.colors.extend(color);
                    mesh.attributes.iter_mut().for_each(|attribute| attribute.push_copy(old));
                    // At most one vertex per corner; meshes with too many are refused later.
                    (mesh.positions.len() - 1) as u32
                });
            }
        }
        mesh.uv_sets = vec![uvs];
    }

    /// Triangles grouped by texture index, ascending; indices not in `0..textures` count as -1.
    pub fn runs(&self, triangles: &[[u32; 3]], textures: usize) -> Vec<Run> {
        let is_valid = |texture: i64| usize::try_from(texture).is_ok_and(|texture| texture < textures);
        runs(triangles, self.textures.iter().map(|&texture| if is_valid(texture) { texture } else { -1 }))
    }
}

/// Groups triangles by `numbers`, ascending.
pub(super) fn runs(triangles: &[[u32; 3]], numbers: impl Iterator<Item = i64>) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    let mut place: HashMap<i64, usize> = HashMap::new();
    for (triangle, number) in triangles.iter().zip(numbers) {
        let at = *place.entry(number).or_insert_with(|| {
            runs.push(Run { number, triangles: Vec::new() });
            runs.len() - 1
        });
        runs[at].triangles.push(*triangle);
    }
    runs.sort_by_key(|run| run.number);
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    fn face(indices: &[i64], wedges: &[f32], texture: i64) -> Face {
        Face { indices: indices.to_vec(), wedges: wedges.to_vec(), texture, material: 0, color: [1.0; 4] }
    }

    #[test]
    fn vertices_on_seams_are_split_and_others_shared() {
        let mut mesh = Mesh { positions: vec![[0.0; 3], [1.0; 3], [2.0; 3], [3.0; 3]], ..Mesh::default() };
        mesh.colors = (0..4).map(|i| [i as f32; 4]).collect();
        mesh.triangles = vec![[0, 1, 2], [1, 2, 3], [2, 3, 0]];
        let mut wedges = Wedges::default();
        wedges.add(&face(&[0, 1, 2], &[0.0, 0.0, 0.5, 0.0, 0.25, 1.0], 0), &[[0, 1, 2]]);
        wedges.add(&face(&[1, 2, 3], &[0.5, 0.0, 0.75, 1.0, 0.0, 0.0], 1), &[[0, 1, 2]]);
        wedges.add(&face(&[2, 3, 0], &[0.0; 4], 7), &[[0, 1, 2]]);
        assert_eq!(wedges.mismatched_count, 1);
        wedges.split(&mut mesh);
        // Vertex 2 has three texture coordinates, vertices 0 and 3 two.
        assert_eq!(mesh.triangles, [[0, 1, 2], [1, 4, 3], [5, 6, 7]]);
        assert_eq!(mesh.uv_sets[0][2], [0.25, 0.0]);
        assert_eq!(mesh.uv_sets[0][4], [0.75, 0.0]);
        assert_eq!((mesh.positions[4], mesh.colors[6]), ([2.0; 3], [3.0; 4]));
        let runs = wedges.runs(&mesh.triangles, 2);
        assert_eq!(
            runs.iter().map(|r| (r.number, r.triangles.len())).collect::<Vec<_>>(),
            [(-1, 1), (0, 1), (1, 1)]
        );
    }
}
