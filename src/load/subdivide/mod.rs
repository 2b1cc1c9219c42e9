//! Catmull-Clark subdivision of meshes at load time: vertices of the result lie on the limit surface and have its normals. OBJ
//! files are subdivided by their polygons, other files by their triangles.

mod refine;

pub(super) use refine::Cage;

use crate::scene::{MaterialId, Mesh, MeshId, MeshPart, Scene, VertexAttribute};
use refine::{Boundary, HalfEdges, Layer, NONE};
use std::collections::{BTreeMap, HashMap};

/// Maximum number of triangles of all subdivided meshes of a scene together.
const MAX_TRIANGLES: u64 = 16_000_000;

/// Maximum number of levels.
pub const MAX_LEVELS: u32 = 10;

/// Options of subdivision.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Subdivision {
    /// Levels, 0 (no change) to [`MAX_LEVELS`]; each splits a face into four.
    pub levels: u32,
    /// Smooth boundary vertices of only one face, as by default in Blender; else they stay fixed.
    pub has_round_corners: bool,
}

/// Error message for deforming meshes.
pub(super) const DEFORMS: &str = "meshes that deform are not subdivided";

/// The polygons of triangulated meshes of a scene, and the subdivided meshes.
#[derive(Clone, Debug, Default)]
pub struct Polygons {
    cages: BTreeMap<MeshId, Cage>,
    /// Subdivided meshes by base mesh and options.
    subdivided: HashMap<(MeshId, Subdivision), MeshId>,
    /// Number of triangles of all subdivided meshes.
    triangles: u64,
}

impl Polygons {
    /// Stores the polygons of a mesh.
    pub(super) fn insert(&mut self, id: MeshId, cage: Cage) {
        self.cages.insert(id, cage);
    }

    /// Adds a subdivided mesh to the scene; calls with the same arguments share one mesh.
    ///
    /// # Errors
    /// A message, if the mesh deforms or there would be too many triangles.
    pub(super) fn add_to(
        &mut self,
        scene: &mut Scene,
        id: MeshId,
        subdivision: Subdivision,
    ) -> Result<MeshId, String> {
        if let Some(known) = self.subdivided.get(&(id, subdivision)) {
            return Ok(*known);
        }
        let fine = match self.subdivided(scene, id, subdivision)? {
            Some(mesh) => scene.add_mesh(mesh),
            None => id,
        };
        self.subdivided.insert((id, subdivision), fine);
        Ok(fine)
    }

    /// The subdivision of the stored polygons, else of the triangles, of a mesh; `None` for 0 levels.
    ///
    /// # Errors
    /// As for [`Polygons::add_to`].
    pub(super) fn subdivided(
        &mut self,
        scene: &Scene,
        id: MeshId,
        subdivision: Subdivision,
    ) -> Result<Option<Mesh>, String> {
        if subdivision.levels == 0 {
            return Ok(None);
        }
        if scene.motion.meshes.contains_key(&id.index()) {
            return Err(DEFORMS.into());
        }
        let new_cage;
        let cage = match self.cages.get(&id) {
            Some(cage) => cage,
            None => {
                new_cage = Cage::of_triangles(&scene.meshes[id.index()]);
                &new_cage
            }
        };
        let fine = subdivided(cage, subdivision, MAX_TRIANGLES - self.triangles)?;
        self.triangles += fine.triangles.len() as u64;
        Ok(Some(fine))
    }

    /// Adds the polygons of a file; `meshes` and `materials` are added to its ids.
    pub(super) fn append(&mut self, other: Polygons, meshes: u32, materials: u32) {
        for (id, mut cage) in other.cages {
            cage.materials.iter_mut().for_each(|material: &mut MaterialId| material.0 += materials);
            self.cages.insert(MeshId(id.0 + meshes), cage);
        }
    }
}

/// The subdivided mesh on the limit surface of a cage.
///
/// # Errors
/// A message, if it would have more than `budget` triangles.
fn subdivided(cage: &Cage, subdivision: Subdivision, budget: u64) -> Result<Mesh, String> {
    let count = cage.triangles_after(subdivision.levels);
    if count > budget {
        let fitting = (1..subdivision.levels).rev().find(|&n| cage.triangles_after(n) <= budget);
        let remedy = match fitting {
            Some(levels) => format!("use at most {levels} levels"),
            None => "don't subdivide it".to_string(),
        };
        return Err(format!(
            "'{}' would have {count} triangles after {} levels of subdivision, but all subdivided meshes together may have {MAX_TRIANGLES}: {remedy}",
            cage.mesh.name, subdivision.levels
        ));
    }
    let cage = cage.sorted();
    let edges = if subdivision.has_round_corners { Boundary::RoundCorners } else { Boundary::SharpCorners };
    let mut arities = cage.arities.clone();
    let (mut points, mut uvs) = (cage.point_layer(), cage.uv_layers());
    // Colours, if any, then attributes.
    let mut vec4_layers: Vec<Layer<4>> =
        cage.color_layer().into_iter().chain(cage.attribute_layers()).collect();
    for _ in 0..subdivision.levels {
        points = points.refined(&arities, edges);
        uvs.iter_mut().for_each(|layer| *layer = layer.refined(&arities, Boundary::Fixed));
        vec4_layers.iter_mut().for_each(|layer| *layer = layer.refined(&arities, Boundary::Fixed));
        arities = vec![4; points.corners.len() / 4];
    }
    let half_edges = HalfEdges::new(&arities, &points.corners, points.values.len());
    let limits = points.limits(&half_edges, edges);
    let normals = refine::normals(&points, &limits, &half_edges);
    points.values = limits;
    uvs.iter_mut().for_each(|layer| to_limit(layer, &arities));
    vec4_layers.iter_mut().for_each(|layer| to_limit(layer, &arities));
    let mut mesh = assembled(&points, &normals, &uvs, &vec4_layers, &cage.mesh);
    mesh.name.clone_from(&cage.mesh.name);
    mesh.parts = parts(&cage, subdivision.levels);
    Ok(mesh)
}

fn to_limit<const N: usize>(layer: &mut Layer<N>, arities: &[u32]) {
    let half_edges = HalfEdges::new(arities, &layer.corners, layer.values.len());
    layer.values = layer.limits(&half_edges, Boundary::Fixed);
}

/// Mesh parts: runs of faces of the cage with one material.
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

/// The triangle mesh of quads, with one vertex for each distinct combination of corner values.
fn assembled(
    points: &Layer<3>,
    normals: &Layer<3>,
    uvs: &[Layer<2>],
    vec4_layers: &[Layer<4>],
    cage: &Mesh,
) -> Mesh {
    let attributes = cage.attributes.iter().map(|a| VertexAttribute::new(a.name.clone(), a.width)).collect();
    let mut mesh = Mesh { uv_sets: vec![Vec::new(); uvs.len()], attributes, ..Mesh::default() };
    let (colors, attribute_layers) = vec4_layers.split_at(vec4_layers.len() - cage.attributes.len());
    let is_same = |a: u32, b: u32| {
        let (a, b) = (a as usize, b as usize);
        normals.corners[a] == normals.corners[b]
            && uvs.iter().all(|layer| layer.corners[a] == layer.corners[b])
            && vec4_layers.iter().all(|layer| layer.corners[a] == layer.corners[b])
    };
    // Linked lists of the vertices of each point, and one corner of each vertex.
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
            mesh.colors.extend(colors.iter().map(|layer| layer.at(c).map(|x| x as f32)));
            for (attribute, layer) in mesh.attributes.iter_mut().zip(attribute_layers) {
                let value = layer.at(c).map(|x| x as f32);
                attribute.values.extend_from_slice(&value[..attribute.width as usize]);
            }
        }
        vertices.push(vertex);
    }
    let quads = vertices.as_chunks::<4>().0.iter();
    mesh.triangles = quads.flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;

    const SHARP: Subdivision = Subdivision { levels: 1, has_round_corners: false };

    fn cage(positions: &[[f32; 3]], faces: &[&[u32]]) -> Cage {
        Cage {
            mesh: Mesh { name: "cage".into(), positions: positions.to_vec(), ..Mesh::default() },
            points: (0..positions.len() as u32).collect(),
            corners: faces.concat(),
            arities: faces.iter().map(|face| face.len() as u32).collect(),
            materials: vec![MaterialId(0); faces.len()],
        }
    }

    /// A cube from -1 to 1 of quads that face outwards.
    fn cube() -> Cage {
        let positions: Vec<[f32; 3]> =
            (0..8).map(|i| [0, 1, 2].map(|k| (i >> k & 1) as f32 * 2.0 - 1.0)).collect();
        let quads: [&[u32]; 6] =
            [&[0, 2, 3, 1], &[4, 5, 7, 6], &[0, 1, 5, 4], &[2, 6, 7, 3], &[0, 4, 6, 2], &[1, 3, 7, 5]];
        cage(&positions, &quads)
    }

    fn fine(cage: &Cage, subdivision: Subdivision, levels: u32) -> Mesh {
        subdivided(cage, Subdivision { levels, ..subdivision }, MAX_TRIANGLES).expect("fits")
    }

    fn point(mesh: &Mesh, vertex: usize) -> DVec3 {
        DVec3::from(mesh.positions[vertex].map(f64::from))
    }

    /// The distance of the nearest vertex.
    fn distance(mesh: &Mesh, to: DVec3) -> f64 {
        (0..mesh.positions.len()).map(|v| point(mesh, v).distance(to)).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn counts_of_vertices_and_faces_satisfy_eulers_formula() {
        let mesh = fine(&cube(), SHARP, 3);
        // After n levels a closed mesh of quads has F 4^n faces and F 4^n + 2 vertices.
        assert_eq!((mesh.triangles.len(), mesh.positions.len()), (2 * 6 * 64, 6 * 64 + 2));
        // A tetrahedron has 12 corners, hence 12 quads after one level, and 4 + 6 + 4 vertices.
        let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        let tetrahedron = cage(&corners, &[&[0, 1, 2], &[0, 3, 1], &[0, 2, 3], &[1, 3, 2]]);
        let mesh = fine(&tetrahedron, SHARP, 1);
        assert_eq!((mesh.triangles.len(), mesh.positions.len()), (24, 14));
    }

    #[test]
    fn limit_points_of_a_cube_are_independent_of_the_level() {
        // Halstead, Kass, DeRose 1993 with n = 3 at corners: (9 v + 4 sum e + sum f) / 24 = v / 2. At the centre of a face after one
        // level n = 4: (16 + 4 * 3 + 20 / 9) / 36.
        let middle = (16.0 + 12.0 + 20.0 / 9.0) / 36.0;
        for levels in 1..=5 {
            let mesh = fine(&cube(), SHARP, levels);
            assert!(distance(&mesh, DVec3::splat(0.5)) < 1e-7, "{levels}");
            assert!(distance(&mesh, DVec3::Z * middle) < 1e-7, "{levels}");
            for v in 0..mesh.positions.len() {
                let normal = DVec3::from(mesh.normals[v].map(f64::from));
                assert!((normal.length() - 1.0).abs() < 1e-6);
                // By symmetry, normals at corners and face centres are radial.
                let p = point(&mesh, v);
                if p.distance(DVec3::splat(0.5)) < 1e-6 || p.distance(DVec3::Z * middle) < 1e-6 {
                    assert!(normal.distance(p.normalize()) < 1e-6, "{normal} at {p}");
                }
                assert!(normal.dot(p.normalize()) > 0.9);
            }
        }
    }

    #[test]
    fn normals_are_those_of_the_limit_surface() {
        // Reference: area-weighted facet normals at a high level.
        let (coarse, dense) = (fine(&cube(), SHARP, 2), fine(&cube(), SHARP, 6));
        let mut sums = vec![DVec3::ZERO; dense.positions.len()];
        for t in &dense.triangles {
            let [a, b, c] = t.map(|v| point(&dense, v as usize));
            t.iter().for_each(|&v| sums[v as usize] += (b - a).cross(c - a));
        }
        for v in 0..coarse.positions.len() {
            let at = point(&coarse, v);
            let same = (0..sums.len())
                .min_by(|&a, &b| point(&dense, a).distance(at).total_cmp(&point(&dense, b).distance(at)));
            let same = same.expect("has vertices");
            assert!(point(&dense, same).distance(at) < 1e-6);
            let normal = DVec3::from(coarse.normals[v].map(f64::from));
            assert!(normal.distance(sums[same].normalize()) < 2e-3, "{normal} at {at}");
        }
    }

    /// A sheet over 0..2 x 0..2 of quads and two triangles.
    fn sheet() -> Cage {
        let mut positions: Vec<[f32; 3]> = (0..9).map(|i| [(i % 3) as f32, (i / 3) as f32, 0.0]).collect();
        positions[4] = [1.2, 0.9, 0.0];
        cage(&positions, &[&[0, 1, 4, 3], &[1, 2, 5, 4], &[3, 4, 7, 6], &[4, 5, 8], &[4, 8, 7]])
    }

    fn area(mesh: &Mesh) -> f64 {
        let of = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| point(mesh, v as usize));
            (b - a).cross(c - a).z / 2.0
        };
        mesh.triangles.iter().map(of).sum()
    }

    #[test]
    fn planar_sheets_stay_planar_and_keep_sharp_corners() {
        let mesh = fine(&sheet(), SHARP, 4);
        assert!(mesh.positions.iter().all(|p| p[2] == 0.0 && p[0] >= 0.0 && p[1] >= 0.0));
        assert!(mesh.normals.iter().all(|n| (n[2] - 1.0).abs() < 1e-6));
        // The far corner belongs to two triangles and is rounded to a spline between its neighbours.
        let rounded = 4.0 - area(&mesh);
        assert!(rounded > 0.02 && rounded < 0.2, "{rounded}");
        for corner in [DVec3::ZERO, DVec3::X * 2.0, DVec3::Y * 2.0] {
            assert!(distance(&mesh, corner) < 1e-7, "{corner}");
        }
        let round = fine(&sheet(), Subdivision { has_round_corners: true, ..SHARP }, 4);
        // The limit of a cubic B-spline's vertex is (a + 4 v + b) / 6.
        assert!(
            distance(&round, DVec3::new(1.0, 1.0, 0.0) / 6.0) < 1e-7 && distance(&round, DVec3::ZERO) > 0.1
        );
    }

    #[test]
    fn open_edges_are_cubic_splines_of_their_own_vertices() {
        // A strip of quads along a polyline; its open edge depends on that polyline only.
        let line = [[0.0, 0.0], [1.0, 1.0], [2.0, -1.0], [3.0, 0.0]];
        let positions: Vec<[f32; 3]> =
            [0.0, 5.0].iter().flat_map(|z| line.map(|[x, y]| [x, y + z * x, *z])).collect();
        let strip = cage(&positions, &[&[0, 4, 5, 1], &[1, 5, 6, 2], &[2, 6, 7, 3]]);
        let mesh = fine(&strip, SHARP, 5);
        let own = |i: usize| DVec3::new(f64::from(line[i][0]), f64::from(line[i][1]), 0.0);
        assert!(distance(&mesh, (own(0) + 4.0 * own(1) + own(2)) / 6.0) < 1e-6);
        // At the middle of a span the weights are 1, 23, 23, 1 over 48.
        let middle = (own(0) + 23.0 * own(1) + 23.0 * own(2) + own(3)) / 48.0;
        assert!(distance(&mesh, middle) < 1e-6, "{}", distance(&mesh, middle));
    }

    #[test]
    fn seams_of_texture_coordinates_stay_and_interiors_are_smooth() {
        // Two adjacent quads with different coordinates at their common edge.
        let positions = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [2.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [1.0, 1.0, 0.0],
            [2.0, 1.0, 0.0],
        ];
        let mut seam = cage(&positions, &[&[0, 1, 4, 3], &[6, 2, 5, 7]]);
        seam.mesh.positions.extend([positions[1], positions[4]]);
        seam.points.extend([1, 4]);
        let uv =
            [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 1.0], [1.0, 1.0], [0.7, 0.0], [0.7, 1.0]];
        seam.mesh.uv_sets = vec![uv.to_vec()];
        let mesh = fine(&seam, SHARP, 3);
        let (mut on_seam, mut sides) = (0, [0; 2]);
        for (p, uv) in mesh.positions.iter().zip(&mesh.uv_sets[0]) {
            let is_left = uv[0] <= 0.5;
            assert!(is_left || uv[0] >= 0.7, "{uv:?} is between the islands");
            if (p[0] - 1.0).abs() < 1e-6 {
                on_seam += 1;
                sides[usize::from(is_left)] += 1;
                assert!((uv[0] - if is_left { 0.5 } else { 0.7 }).abs() < 1e-7);
            }
        }
        // Nine points with two vertices each.
        assert_eq!((on_seam, sides), (18, [9, 9]));
        // Without a seam, coordinates linear in the positions of a regular grid stay linear.
        let positions: Vec<[f32; 3]> = (0..16).map(|i| [(i % 4) as f32, (i / 4) as f32, 0.0]).collect();
        let quads: Vec<[u32; 4]> =
            (0..9).map(|i| i / 3 * 4 + i % 3).map(|a| [a, a + 1, a + 5, a + 4]).collect();
        let mut grid = cage(&positions, &quads.iter().map(|q| &q[..]).collect::<Vec<_>>());
        grid.mesh.uv_sets = vec![positions.iter().map(|p| [p[0] / 3.0, 1.0 - p[1] / 3.0]).collect()];
        let mesh = fine(&grid, SHARP, 3);
        for (p, uv) in mesh.positions.iter().zip(&mesh.uv_sets[0]) {
            // Only the interior: boundary positions move along splines, their coordinates don't.
            let error = (uv[0] - p[0] / 3.0).abs().max((uv[1] - 1.0 + p[1] / 3.0).abs());
            let is_inside = p[..2].iter().all(|x| *x > 1.0 && *x < 2.0);
            assert!(!is_inside || error < 1e-6, "{p:?} {uv:?}");
        }
    }

    #[test]
    fn non_manifold_meshes_have_finite_results() {
        // Two tetrahedra that share a vertex, an edge of three faces, a flipped face, and one that repeats a corner.
        let p = |x: f32, y: f32, z: f32| [x, y, z];
        let positions = [
            p(0.0, 0.0, 0.0),
            p(1.0, 0.0, 0.0),
            p(0.0, 1.0, 0.0),
            p(0.0, 0.0, 1.0),
            p(-1.0, 0.0, 0.0),
            p(0.0, -1.0, 0.0),
            p(0.0, 0.0, -1.0),
            p(f32::NAN, 0.0, 0.0),
        ];
        let faces: [&[u32]; 12] = [
            &[0, 2, 1],
            &[0, 1, 3],
            &[0, 3, 2],
            &[1, 2, 3],
            &[0, 5, 4],
            &[0, 4, 6],
            &[0, 6, 5],
            &[4, 5, 6],
            &[1, 2, 6],
            &[1, 2, 4],
            &[3, 1, 1, 5],
            &[1, 2, 7],
        ];
        let non_manifold = cage(&positions, &faces);
        for levels in 1..4 {
            let mesh = fine(&non_manifold, SHARP, levels);
            assert!(mesh.positions.as_flattened().iter().all(|x| x.is_finite()));
            assert!(mesh.normals.iter().all(|n| (DVec3::from(n.map(f64::from)).length() - 1.0).abs() < 1e-5));
            assert_eq!(mesh.parts[0].triangle_count as usize, mesh.triangles.len());
            // The shared vertex stays fixed.
            assert!(distance(&mesh, DVec3::ZERO) == 0.0);
        }
    }

    #[test]
    fn materials_keep_their_faces_and_too_many_triangles_are_reported() {
        let mut two_materials = cube();
        two_materials.materials = [0, 1, 0, 0, 1, 1].map(MaterialId).to_vec();
        let mesh = fine(&two_materials, SHARP, 2);
        let counts: Vec<(u32, u32, u32)> =
            mesh.parts.iter().map(|p| (p.material.0, p.first_triangle, p.triangle_count)).collect();
        assert_eq!(counts, [(0, 0, 96), (1, 96, 96)]);
        // Faces of the second material: +z, -x, +x.
        for t in &mesh.triangles[96..] {
            let middle = t.iter().map(|&v| point(&mesh, v as usize)).sum::<DVec3>() / 3.0;
            assert!(middle.z.max(middle.x.abs()) > 0.5, "{middle}");
        }
        let error =
            subdivided(&cube(), Subdivision { levels: 10, ..SHARP }, 1_000_000).expect_err("too many");
        assert!(error.contains("12582912 triangles") && error.contains("at most 8 levels"), "{error}");
    }
}
