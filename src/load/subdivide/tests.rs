//! Closed forms: numbers of Euler, limits of cubes, planes, curves of open edges, seams of texture coordinates.

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
    subdivided(cage, Subdivision { levels, ..how }, MOST_TRIANGLES).expect("fits")
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
    assert!(distance(&round, DVec3::new(1.0, 1.0, 0.0) / 6.0) < 1e-7 && distance(&round, DVec3::ZERO) > 0.1);
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
    let uv = [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 1.0], [1.0, 1.0], [0.7, 0.0], [0.7, 1.0]];
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
    let quads: Vec<[u32; 4]> = (0..9).map(|i| i / 3 * 4 + i % 3).map(|a| [a, a + 1, a + 5, a + 4]).collect();
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
fn materials_keep_their_faces_and_limits_are_told() {
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
    let error = subdivided(&cube(), Subdivision { levels: 10, ..SHARP }, 1_000_000).expect_err("too many");
    assert!(
        error.contains("12582912 triangles after 10 levels") && error.contains("at most 8 fit"),
        "{error}"
    );
}
