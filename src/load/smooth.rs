//! Smooth normals for meshes without normals: sums of the face normals around a vertex, weighted by the angles of the faces
//! (Thuermer and Wuethrich 1998, "Computing Vertex Normals from Polygonal Facets"). Edges above the crease angle stay sharp.

use crate::math::DVec3;
use crate::scene::Mesh;
use rayon::prelude::*;

/// End of a chain of copies of a vertex.
const NONE: u32 = u32::MAX;

/// Adds smooth normals to a mesh without normals, else returns false. `crease_rad` is the maximum angle between face normals
/// at a smooth edge, radians. Vertices at creases are duplicated. Vertices with equal positions count as one, regardless of
/// other attributes.
pub(super) fn smooth(mesh: &mut Mesh, crease_rad: f64) -> bool {
    if !mesh.normals.is_empty() || mesh.triangles.is_empty() {
        return false;
    }
    let faces: Vec<DVec3> = mesh.triangles.par_iter().map(|t| face_normal(mesh, t)).collect();
    let around = VertexFaces::of(mesh);
    let min_cos = crease_rad.cos() - 1e-9;
    let normals: Vec<Vec<(u32, [f32; 3])>> = (0..around.starts.len() - 1)
        .into_par_iter()
        .map(|point| point_normals(mesh, &faces, &around, point, min_cos))
        .collect();
    let mut corners = vec![[0.0f32; 3]; 3 * mesh.triangles.len()];
    for (corner, normal) in normals.into_iter().flatten() {
        corners[corner as usize] = normal;
    }
    assign_normals(mesh, &corners);
    true
}

fn position(mesh: &Mesh, vertex: u32) -> DVec3 {
    DVec3::from(cleaned(mesh.positions[vertex as usize]).map(f64::from))
}

/// Sets coordinates below the precision of the largest one to zero. Without it, rounding separates the coincident vertices at the
/// poles of spheres.
fn cleaned(p: [f32; 3]) -> [f32; 3] {
    let epsilon = p.iter().fold(0.0f32, |max, x| max.max(x.abs())) * f32::EPSILON;
    // Adding 0 turns -0 into 0.
    p.map(|x| if x.abs() < epsilon { 0.0 } else { x + 0.0 })
}

/// Unit normal of a triangle; zero for degenerate triangles.
fn face_normal(mesh: &Mesh, triangle: &[u32; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|v| position(mesh, v));
    (b - a).cross(c - a).normalize_or_zero()
}

/// Triangle corners grouped by point; vertices with the same position are one point.
struct VertexFaces {
    /// Point number of each vertex.
    points: Vec<u32>,
    /// Start of each point's corners in `corners`, and the end of the last.
    starts: Vec<u32>,
    /// Corner numbers: 3 times the triangle plus 0 to 2.
    corners: Vec<u32>,
}

impl VertexFaces {
    fn of(mesh: &Mesh) -> VertexFaces {
        let key = |v: u32| cleaned(mesh.positions[v as usize]).map(f32::to_bits);
        let mut order: Vec<u32> = (0..mesh.positions.len() as u32).collect();
        order.par_sort_unstable_by_key(|&v| (key(v), v));
        let (mut points, mut count) = (vec![0; order.len()], 0u32);
        for (i, &v) in order.iter().enumerate() {
            if i > 0 && key(v) != key(order[i - 1]) {
                count += 1;
            }
            points[v as usize] = count;
        }
        let all = mesh.triangles.as_flattened();
        let mut starts = vec![0u32; count as usize + 2];
        all.iter().for_each(|&v| starts[points[v as usize] as usize + 1] += 1);
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let (mut next, mut corners) = (starts.clone(), vec![0; all.len()]);
        for (corner, &v) in all.iter().enumerate() {
            let at = &mut next[points[v as usize] as usize];
            corners[*at as usize] = corner as u32;
            *at += 1;
        }
        VertexFaces { points, starts, corners }
    }

    fn corners_of(&self, point: usize) -> &[u32] {
        &self.corners[self.starts[point] as usize..self.starts[point + 1] as usize]
    }
}

/// Corner numbers and normals at a point: sums over groups of faces connected by smooth edges.
fn point_normals(
    mesh: &Mesh,
    faces: &[DVec3],
    around: &VertexFaces,
    point: usize,
    min_cos: f64,
) -> Vec<(u32, [f32; 3])> {
    let corners = around.corners_of(point);
    let face = |corner: u32| faces[corner as usize / 3];
    let vertex =
        |corner: u32, step: u32| mesh.triangles[corner as usize / 3][((corner % 3 + step) % 3) as usize];
    // Edges of the point: the other end, and the index of the corner.
    let end = |corner: u32, step: u32| around.points[vertex(corner, step) as usize];
    // Degenerate triangles, as at poles, are skipped.
    let with_area = corners.iter().enumerate().filter(|(_, c)| face(**c) != DVec3::ZERO);
    let mut edges: Vec<(u32, usize)> =
        with_area.flat_map(|(i, &c)| [1, 2].map(|step| (end(c, step), i))).collect();
    edges.sort_unstable();
    let mut groups = Groups::new(corners.len());
    for pair in edges.windows(2) {
        let ((a, i), (b, j)) = (pair[0], pair[1]);
        if a == b && face(corners[i]).dot(face(corners[j])) >= min_cos {
            groups.join(i, j);
        }
    }
    let mut sums = vec![DVec3::ZERO; corners.len()];
    for (i, &corner) in corners.iter().enumerate() {
        let at = position(mesh, vertex(corner, 0));
        let [u, v] = [1, 2].map(|step| position(mesh, vertex(corner, step)) - at);
        let angle = u.cross(v).length().atan2(u.dot(v));
        sums[groups.root(i)] += face(corner) * angle;
    }
    let normal = |i: usize, corner: u32| sums[groups.root(i)].normalize_or(face(corner)).as_vec3().to_array();
    corners.iter().enumerate().map(|(i, &corner)| (corner, normal(i, corner))).collect()
}

/// Disjoint sets (union-find); the smallest member of a set is its root.
struct Groups(Vec<usize>);

impl Groups {
    fn new(count: usize) -> Groups {
        Groups((0..count).collect())
    }

    fn root(&self, mut i: usize) -> usize {
        while self.0[i] != i {
            i = self.0[i];
        }
        i
    }

    fn join(&mut self, i: usize, j: usize) {
        let (a, b) = (self.root(i), self.root(j));
        let (low, high) = (a.min(b), a.max(b));
        self.0[high] = low;
        // Path compression.
        (self.0[i], self.0[j]) = (low, low);
    }
}

/// Assigns corner normals to vertices. Vertices with different corner normals are duplicated; corners of degenerate triangles
/// keep the first copy.
fn assign_normals(mesh: &mut Mesh, corners: &[[f32; 3]]) {
    let count = mesh.positions.len();
    let (mut normals, mut is_used) = (vec![[0.0, 0.0, 1.0]; count], vec![false; count]);
    // The next copy of each vertex, and the original of each copy.
    let (mut next, mut origins) = (vec![NONE; count], (0..count as u32).collect::<Vec<_>>());
    for (vertex, &normal) in mesh.triangles.as_flattened_mut().iter_mut().zip(corners) {
        if normal == [0.0; 3] {
            continue;
        }
        let mut at = *vertex as usize;
        while is_used[at] && normals[at] != normal && next[at] != NONE {
            at = next[at] as usize;
        }
        if is_used[at] && normals[at] != normal {
            next[at] = normals.len() as u32;
            at = normals.len();
            normals.push(normal);
            is_used.push(true);
            next.push(NONE);
            origins.push(*vertex);
        }
        (normals[at], is_used[at], *vertex) = (normal, true, at as u32);
    }
    append_vertices(mesh, &origins[count..]);
    mesh.normals = normals;
}

/// Appends copies of the vertices `origins`, without normals.
pub(super) fn append_vertices(mesh: &mut Mesh, origins: &[u32]) {
    append_copies(&mut mesh.positions, origins);
    mesh.uv_sets.iter_mut().for_each(|set| append_copies(set, origins));
    append_copies(&mut mesh.tangents, origins);
    append_copies(&mut mesh.colors, origins);
    for attribute in &mut mesh.attributes {
        origins.iter().for_each(|&origin| attribute.push_copy(origin as usize));
    }
}

/// Appends copies of the entries `origins`, unless the list is empty.
fn append_copies<T: Copy>(list: &mut Vec<T>, origins: &[u32]) {
    if !list.is_empty() {
        list.reserve(origins.len());
        origins.iter().for_each(|&origin| list.push(list[origin as usize]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::MaterialId;

    /// A UV sphere; if not `is_shared`, each triangle has its own vertices.
    fn sphere(slices: u32, rings: u32, is_shared: bool) -> Mesh {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for j in 0..=rings {
            let (r, y) = (f64::from(j) / f64::from(rings) * std::f64::consts::PI).sin_cos();
            for i in 0..slices {
                let (s, c) = (f64::from(i) / f64::from(slices) * std::f64::consts::TAU).sin_cos();
                positions.push([(r * c) as f32, y as f32, (r * s) as f32]);
            }
        }
        for (j, i) in (0..rings).flat_map(|j| (0..slices).map(move |i| (j, i))) {
            let (a, b) = (j * slices + i, j * slices + (i + 1) % slices);
            triangles.extend([[a, b, b + slices], [a, b + slices, a + slices]]);
        }
        if !is_shared {
            positions = triangles.as_flattened().iter().map(|&v| positions[v as usize]).collect();
            triangles = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        }
        Mesh::new("ball", positions, triangles, MaterialId(0))
    }

    fn cube() -> Mesh {
        let positions = (0..8).map(|i| [0, 1, 2].map(|k| (i >> k & 1) as f32)).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let uv = (0..8).map(|i| [i as f32, 0.0]).collect();
        Mesh { uv_sets: vec![uv], ..Mesh::new("cube", positions, triangles, MaterialId(0)) }
    }

    #[test]
    fn a_sphere_gets_radial_normals_with_shared_and_separate_vertices() {
        for is_shared in [true, false] {
            let mut mesh = sphere(32, 17, is_shared);
            let count = mesh.positions.len();
            assert!(smooth(&mut mesh, 30f64.to_radians()));
            assert_eq!((mesh.positions.len(), mesh.normals.len()), (count, count));
            let flat = |t: &&[u32; 3]| face_normal(&mesh, t) == DVec3::ZERO;
            let poles = mesh.triangles.iter().filter(flat).count();
            for triangle in mesh.triangles.iter().filter(|t| !flat(t)) {
                for &v in triangle {
                    let (p, n) = (position(&mesh, v), DVec3::from(mesh.normals[v as usize].map(f64::from)));
                    // Signs depend on the order of corners.
                    assert!(p.normalize().dot(n).abs() > 0.995, "{p} {n}, {poles} at poles");
                }
            }
            assert!(!smooth(&mut mesh, 1.0), "it has normals");
        }
    }

    #[test]
    fn creases_stay_sharp_and_their_vertices_are_duplicated() {
        let mut sharp = cube();
        smooth(&mut sharp, 30f64.to_radians());
        assert_eq!((sharp.positions.len(), sharp.uv_sets[0].len()), (24, 24));
        for t in &sharp.triangles {
            let normal = face_normal(&sharp, t).as_vec3().to_array();
            assert!(t.iter().all(|&v| sharp.normals[v as usize] == normal));
            assert!(t.iter().all(|&v| {
                let [x, y, z] = sharp.positions[v as usize];
                sharp.uv_sets[0][v as usize][0] == x + 2.0 * y + 4.0 * z
            }));
        }
        let mut round = cube();
        smooth(&mut round, 91f64.to_radians());
        assert_eq!(round.positions.len(), 8);
        for (p, n) in round.positions.iter().zip(&round.normals) {
            // Angle weights make the result independent of the triangulation.
            let outwards = (DVec3::from(p.map(f64::from)) - 0.5).normalize();
            assert!(outwards.distance(DVec3::from(n.map(f64::from))) < 1e-6, "{p:?} {n:?}");
        }
    }
}
