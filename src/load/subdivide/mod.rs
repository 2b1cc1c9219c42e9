//! Catmull-Clark subdivision of coarse meshes when they are loaded, by request: vertices of the result lie on the limit surface and
//! have its normals. Polygons of OBJ files count as they are; meshes of other files are subdivided by their triangles.

mod refine;

pub(super) use refine::Cage;

use crate::scene::{MaterialId, Mesh, MeshId, MeshPart, Scene, VertexAttribute};
use refine::{Edges, Fans, Layer, NONE};
use std::collections::{BTreeMap, HashMap};

/// Maximum number of triangles that all subdivided meshes of a scene may have together.
const MAX_TRIANGLES: u64 = 16_000_000;

/// Maximum number of steps.
pub const MAX_LEVELS: u32 = 10;

/// How a mesh is subdivided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Subdivision {
    /// Steps, from 0, which changes nothing, to [`MAX_LEVELS`]; each makes four faces of one.
    pub levels: u32,
    /// Corners of open sheets, which only one face has, become round, too, as Blender has it by default; else they stay where they
    /// are.
    pub has_round_corners: bool,
}

/// Why a mesh that deforms is not subdivided.
pub(super) const DEFORMS: &str = "meshes that deform are not subdivided";

/// The polygons that meshes of a scene were triangulated from, and the subdivided meshes made of them.
#[derive(Clone, Debug, Default)]
pub struct Polygons {
    cages: BTreeMap<MeshId, Cage>,
    made: HashMap<(MeshId, Subdivision), MeshId>,
    /// Triangles of all subdivided meshes.
    triangles: u64,
}

impl Polygons {
    /// Keeps the polygons of a mesh.
    pub(super) fn keep(&mut self, id: MeshId, cage: Cage) {
        self.cages.insert(id, cage);
    }

    /// Subdivides a mesh of a scene: returns another mesh, which all calls with the same arguments share.
    ///
    /// # Errors
    /// A message, if the mesh deforms or all would have too many triangles.
    pub(super) fn add_to(
        &mut self,
        scene: &mut Scene,
        id: MeshId,
        how: Subdivision,
    ) -> Result<MeshId, String> {
        if let Some(known) = self.made.get(&(id, how)) {
            return Ok(*known);
        }
        let fine = match self.subdivided(scene, id, how)? {
            Some(mesh) => scene.add_mesh(mesh),
            None => id,
        };
        self.made.insert((id, how), fine);
        Ok(fine)
    }

    /// A mesh of a scene, subdivided: its polygons if they are stored, else its triangles. `None` without levels.
    ///
    /// # Errors
    /// As for [`Polygons::add_to`].
    pub(super) fn subdivided(
        &mut self,
        scene: &Scene,
        id: MeshId,
        how: Subdivision,
    ) -> Result<Option<Mesh>, String> {
        if how.levels == 0 {
            return Ok(None);
        }
        if scene.motion.meshes.contains_key(&id.index()) {
            return Err(DEFORMS.into());
        }
        let of_triangles;
        let cage = match self.cages.get(&id) {
            Some(cage) => cage,
            None => {
                of_triangles = Cage::of_triangles(&scene.meshes[id.index()]);
                &of_triangles
            }
        };
        let fine = subdivided(cage, how, MAX_TRIANGLES - self.triangles)?;
        self.triangles += fine.triangles.len() as u64;
        Ok(Some(fine))
    }

    /// Adds the polygons of a file whose meshes and materials become part of a scene.
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
            "'{}' would have {count} triangles after {} levels of subdivision, but all subdivided meshes together may have {MAX_TRIANGLES}: {remedy}",
            cage.mesh.name, how.levels
        ));
    }
    let cage = cage.sorted();
    let edges = if how.has_round_corners { Edges::RoundCorners } else { Edges::SharpCorners };
    let mut arities = cage.arities.clone();
    let (mut points, mut uvs) = (cage.point_layer(), cage.uv_layers());
    // Colours, where there are some, before attributes.
    let mut fours: Vec<Layer<4>> = cage.color_layer().into_iter().chain(cage.attribute_layers()).collect();
    for _ in 0..how.levels {
        points = points.refined(&arities, edges);
        uvs.iter_mut().for_each(|layer| *layer = layer.refined(&arities, Edges::Fixed));
        fours.iter_mut().for_each(|layer| *layer = layer.refined(&arities, Edges::Fixed));
        arities = vec![4; points.corners.len() / 4];
    }
    let fans = Fans::new(&arities, &points.corners, points.values.len());
    let limits = points.limits(&fans, edges);
    let normals = refine::normals(&points, &limits, &fans);
    points.values = limits;
    uvs.iter_mut().for_each(|layer| to_limit(layer, &arities));
    fours.iter_mut().for_each(|layer| to_limit(layer, &arities));
    let mut mesh = assembled(&points, &normals, &uvs, &fours, &cage.mesh);
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

/// A mesh of quads with a vertex for each combination of values that corners have; colours and attributes are those of the cage.
fn assembled(
    points: &Layer<3>,
    normals: &Layer<3>,
    uvs: &[Layer<2>],
    fours: &[Layer<4>],
    cage: &Mesh,
) -> Mesh {
    let attributes = cage.attributes.iter().map(|a| VertexAttribute::new(a.name.clone(), a.width)).collect();
    let mut mesh = Mesh { uv_sets: vec![Vec::new(); uvs.len()], attributes, ..Mesh::default() };
    let (colors, of_attributes) = fours.split_at(fours.len() - cage.attributes.len());
    let is_same = |a: u32, b: u32| {
        let (a, b) = (a as usize, b as usize);
        normals.corners[a] == normals.corners[b]
            && uvs.iter().all(|layer| layer.corners[a] == layer.corners[b])
            && fours.iter().all(|layer| layer.corners[a] == layer.corners[b])
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
            mesh.colors.extend(colors.iter().map(|layer| layer.at(c).map(|x| x as f32)));
            for (attribute, layer) in mesh.attributes.iter_mut().zip(of_attributes) {
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

/// Closed forms: numbers of Euler, limits of cubes, planes, curves of open edges, seams of texture coordinates.
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

    /// From -1 to 1; quads that face outwards.
    fn cube() -> Cage {
        let positions: Vec<[f32; 3]> =
            (0..8).map(|i| [0, 1, 2].map(|k| (i >> k & 1) as f32 * 2.0 - 1.0)).collect();
        let quads: [&[u32]; 6] =
            [&[0, 2, 3, 1], &[4, 5, 7, 6], &[0, 1, 5, 4], &[2, 6, 7, 3], &[0, 4, 6, 2], &[1, 3, 7, 5]];
        cage(&positions, &quads)
    }

    fn fine(cage: &Cage, how: Subdivision, levels: u32) -> Mesh {
        subdivided(cage, Subdivision { levels, ..how }, MAX_TRIANGLES).expect("fits")
    }

    fn point(mesh: &Mesh, vertex: usize) -> DVec3 {
        DVec3::from(mesh.positions[vertex].map(f64::from))
    }

    /// The distance of the nearest vertex.
    fn distance(mesh: &Mesh, to: DVec3) -> f64 {
        (0..mesh.positions.len()).map(|v| point(mesh, v).distance(to)).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn numbers_of_vertices_edges_and_faces_are_those_of_euler() {
        let mesh = fine(&cube(), SHARP, 3);
        // After n steps a closed mesh of quads has F 4^n faces and F 4^n + 2 vertices.
        assert_eq!((mesh.triangles.len(), mesh.positions.len()), (2 * 6 * 64, 6 * 64 + 2));
        // A tetrahedron has 12 corners, and so many quads after one step; 4 + 6 + 4 vertices.
        let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        let tetrahedron = cage(&corners, &[&[0, 1, 2], &[0, 3, 1], &[0, 2, 3], &[1, 3, 2]]);
        let mesh = fine(&tetrahedron, SHARP, 1);
        assert_eq!((mesh.triangles.len(), mesh.positions.len()), (24, 14));
    }

    #[test]
    fn a_cube_ends_up_at_its_known_limits_after_any_number_of_steps() {
        // Halstead, Kass, DeRose 1993 with n = 3 at corners: (9 v + 4 sum e + sum f) / 24 = v / 2. In the middle of a face after one step
        // n = 4: (16 + 4 * 3 + 20 / 9) / 36.
        let middle = (16.0 + 12.0 + 20.0 / 9.0) / 36.0;
        for levels in 1..=5 {
            let mesh = fine(&cube(), SHARP, levels);
            assert!(distance(&mesh, DVec3::splat(0.5)) < 1e-7, "{levels}");
            assert!(distance(&mesh, DVec3::Z * middle) < 1e-7, "{levels}");
            for v in 0..mesh.positions.len() {
                let normal = DVec3::from(mesh.normals[v].map(f64::from));
                assert!((normal.length() - 1.0).abs() < 1e-6);
                // By symmetry, normals at corners and in the middle of faces point outwards.
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
        // Where the facets of many more steps lead.
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

    /// A sheet of quads over 0..2 x 0..2, with triangles among them.
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
    fn a_plane_stays_a_plane_with_its_outline() {
        let mesh = fine(&sheet(), SHARP, 4);
        assert!(mesh.positions.iter().all(|p| p[2] == 0.0 && p[0] >= 0.0 && p[1] >= 0.0));
        assert!(mesh.normals.iter().all(|n| (n[2] - 1.0).abs() < 1e-6));
        // The far corner belongs to two triangles, and is rounded: between its neighbours, a spline.
        let rounded = 4.0 - area(&mesh);
        assert!(rounded > 0.02 && rounded < 0.2, "{rounded}");
        for corner in [DVec3::ZERO, DVec3::X * 2.0, DVec3::Y * 2.0] {
            assert!(distance(&mesh, corner) < 1e-7, "{corner}");
        }
        let round = fine(&sheet(), Subdivision { has_round_corners: true, ..SHARP }, 4);
        // A vertex of a cubic B-spline ends at (a + 4 v + b) / 6.
        assert!(
            distance(&round, DVec3::new(1.0, 1.0, 0.0) / 6.0) < 1e-7 && distance(&round, DVec3::ZERO) > 0.1
        );
    }

    #[test]
    fn open_edges_are_cubic_splines_whatever_lies_beside_them() {
        // A strip of quads along a bent line; its open edge depends on that line alone.
        let line = [[0.0, 0.0], [1.0, 1.0], [2.0, -1.0], [3.0, 0.0]];
        let positions: Vec<[f32; 3]> =
            [0.0, 5.0].iter().flat_map(|z| line.map(|[x, y]| [x, y + z * x, *z])).collect();
        let strip = cage(&positions, &[&[0, 4, 5, 1], &[1, 5, 6, 2], &[2, 6, 7, 3]]);
        let mesh = fine(&strip, SHARP, 5);
        let own = |i: usize| DVec3::new(f64::from(line[i][0]), f64::from(line[i][1]), 0.0);
        assert!(distance(&mesh, (own(0) + 4.0 * own(1) + own(2)) / 6.0) < 1e-6);
        // In the middle of a span, weights 1, 23, 23, 1 of 48.
        let middle = (own(0) + 23.0 * own(1) + 23.0 * own(2) + own(3)) / 48.0;
        assert!(distance(&mesh, middle) < 1e-6, "{}", distance(&mesh, middle));
    }

    #[test]
    fn seams_of_texture_coordinates_stay_and_their_insides_are_smooth() {
        // Two quads side by side whose coordinates differ at the edge between them.
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
        // Nine points, and each twice.
        assert_eq!((on_seam, sides), (18, [9, 9]));
        // Without a seam, coordinates that are a linear function of a regular grid's positions stay that.
        let positions: Vec<[f32; 3]> = (0..16).map(|i| [(i % 4) as f32, (i / 4) as f32, 0.0]).collect();
        let quads: Vec<[u32; 4]> =
            (0..9).map(|i| i / 3 * 4 + i % 3).map(|a| [a, a + 1, a + 5, a + 4]).collect();
        let mut grid = cage(&positions, &quads.iter().map(|q| &q[..]).collect::<Vec<_>>());
        grid.mesh.uv_sets = vec![positions.iter().map(|p| [p[0] / 3.0, 1.0 - p[1] / 3.0]).collect()];
        let mesh = fine(&grid, SHARP, 3);
        for (p, uv) in mesh.positions.iter().zip(&mesh.uv_sets[0]) {
            // Edges move as splines, their coordinates not: corners of one face apart, both are the same here.
            let error = (uv[0] - p[0] / 3.0).abs().max((uv[1] - 1.0 + p[1] / 3.0).abs());
            let is_inside = p[..2].iter().all(|x| *x > 1.0 && *x < 2.0);
            assert!(!is_inside || error < 1e-6, "{p:?} {uv:?}");
        }
    }

    #[test]
    fn vertices_of_several_sheets_and_odd_faces_do_no_harm() {
        // Two tetrahedra that share a point, three sheets at one edge, a face turned the other way, and one that repeats a corner.
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
        let odd = cage(&positions, &faces);
        for levels in 1..4 {
            let mesh = fine(&odd, SHARP, levels);
            assert!(mesh.positions.as_flattened().iter().all(|x| x.is_finite()));
            assert!(mesh.normals.iter().all(|n| (DVec3::from(n.map(f64::from)).length() - 1.0).abs() < 1e-5));
            assert_eq!(mesh.parts[0].triangle_count as usize, mesh.triangles.len());
            // The point that both share stays.
            assert!(distance(&mesh, DVec3::ZERO) == 0.0);
        }
    }

    #[test]
    fn materials_keep_their_faces_and_limits_are_reported() {
        let mut of_two = cube();
        of_two.materials = [0, 1, 0, 0, 1, 1].map(MaterialId).to_vec();
        let mesh = fine(&of_two, SHARP, 2);
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
        assert!(error.contains("12582912 triangles") && error.contains("at most 8"), "{error}");
    }
}
