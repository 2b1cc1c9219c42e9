//! Triangles cut in halves until no edge is longer than wanted. Whether an edge is cut depends on its ends alone, so that triangles
//! on both sides of it agree and no cracks open.

use crate::math::Vec3;
use crate::scene::{Mesh, MeshPart};
use std::collections::HashMap;

/// The mesh, without tangents, its parts cut to the lengths that are given; and the longest edge that is left where it would have
/// more triangles than allowed.
pub(super) fn subdivided(mesh: &Mesh, edges: &[Option<f32>], most: usize) -> (Mesh, Option<f32>) {
    let mut fine = Mesh { tangents: Vec::new(), triangles: Vec::new(), parts: Vec::new(), ..mesh.clone() };
    let mut longest = None;
    for (part, edge) in mesh.parts.iter().zip(edges) {
        let first = part.first_triangle as usize;
        let mut triangles = mesh.triangles[first..first + part.triangle_count as usize].to_vec();
        while let Some(edge) = *edge {
            let cuts: usize =
                triangles.iter().map(|t| sides(t).filter(|&side| is_cut(&fine, side, edge)).count()).sum();
            if cuts == 0 {
                break;
            }
            if fine.triangles.len() + triangles.len() + cuts > most {
                let left = triangles.iter().flat_map(sides).map(|[a, b]| length(&fine, a, b));
                longest = Some(left.fold(longest.unwrap_or(0.0), f32::max));
                break;
            }
            triangles = cut(&mut fine, &triangles, edge);
        }
        fine.parts.push(MeshPart {
            first_triangle: fine.triangles.len() as u32,
            triangle_count: triangles.len() as u32,
            material: part.material,
        });
        fine.triangles.append(&mut triangles);
    }
    (fine, longest)
}

/// A lower bound on the number of triangles: those whose edges all have the maximum length have the largest area.
pub(super) fn min_triangles(mesh: &Mesh, edges: &[Option<f32>]) -> f64 {
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| Vec3::from_array(mesh.positions[i as usize]).as_dvec3());
        0.5 * (b - a).cross(c - a).length()
    };
    let of_part = |(part, edge): (&MeshPart, &Option<f32>)| {
        let first = part.first_triangle as usize;
        let triangles = &mesh.triangles[first..first + part.triangle_count as usize];
        let edge = f64::from((*edge)?);
        let largest = 3f64.sqrt() / 4.0 * edge * edge;
        Some(triangles.iter().map(|t| (area(t) / largest).max(1.0)).sum::<f64>())
    };
    mesh.parts.iter().zip(edges).filter_map(of_part).sum()
}

fn sides(triangle: &[u32; 3]) -> impl Iterator<Item = [u32; 2]> + use<> {
    let [a, b, c] = *triangle;
    [[a, b], [b, c], [c, a]].into_iter()
}

fn length(mesh: &Mesh, a: u32, b: u32) -> f32 {
    let [a, b] = [a, b].map(|i| Vec3::from_array(mesh.positions[i as usize]));
    // The same from both ends.
    (a - b).abs().length()
}

/// Is an edge longer than wanted, and are its halves shorter? Far from the origin neighbouring numbers may be farther apart
/// than edges are to be, and the middle rounds to an end.
fn is_cut(mesh: &Mesh, [a, b]: [u32; 2], edge: f32) -> bool {
    let whole = length(mesh, a, b);
    if whole <= edge {
        return false;
    }
    let [p, q] = [a, b].map(|i| mesh.positions[i as usize]);
    let middle = Vec3::from_array(mean(p, q));
    [p, q].iter().all(|&end| middle.distance(Vec3::from_array(end)) < 0.75 * whole)
}

/// Cuts all edges longer than `edge` once.
fn cut(mesh: &mut Mesh, triangles: &[[u32; 3]], edge: f32) -> Vec<[u32; 3]> {
    let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
    let mut finer = Vec::with_capacity(2 * triangles.len());
    for triangle in triangles {
        let middle = sides(triangle).map(|[a, b]| {
            is_cut(mesh, [a, b], edge)
                .then(|| *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| add_middle(mesh, a, b)))
        });
        let middle: Vec<Option<u32>> = middle.collect();
        // Turned so that cut sides come first.
        let turn = match [middle[0].is_some(), middle[1].is_some(), middle[2].is_some()] {
            [false, true, _] => 1,
            [_, false, true] => 2,
            _ => 0,
        };
        let [a, b, c] = [0, 1, 2].map(|k| triangle[(k + turn) % 3]);
        let [ab, bc, ca] = [0, 1, 2].map(|k| middle[(k + turn) % 3]);
        match (ab, bc, ca) {
            (Some(ab), Some(bc), Some(ca)) => {
                finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
            }
            (Some(ab), Some(bc), None) => finer.extend([[ab, b, bc], [a, ab, bc], [a, bc, c]]),
            (Some(ab), None, _) => finer.extend([[a, ab, c], [ab, b, c]]),
            _ => finer.push(*triangle),
        }
    }
    finer
}

/// A vertex half way between two.
fn add_middle(mesh: &mut Mesh, a: u32, b: u32) -> u32 {
    let (a, b) = (a as usize, b as usize);
    let index = mesh.positions.len() as u32;
    mesh.positions.push(mean(mesh.positions[a], mesh.positions[b]));
    if !mesh.normals.is_empty() {
        let sum = mean(mesh.normals[a], mesh.normals[b]);
        let unit = Vec3::from_array(sum).try_normalize().map_or(mesh.normals[a], |n| n.to_array());
        mesh.normals.push(unit);
    }
    for set in mesh.uv_sets.iter_mut().filter(|set| !set.is_empty()) {
        set.push(mean(set[a], set[b]));
    }
    if !mesh.colors.is_empty() {
        mesh.colors.push(mean(mesh.colors[a], mesh.colors[b]));
    }
    mesh.attributes.iter_mut().for_each(|attribute| attribute.push_mean(a, b));
    index
}

fn mean<const N: usize>(a: [f32; N], b: [f32; N]) -> [f32; N] {
    std::array::from_fn(|k| 0.5 * a[k] + 0.5 * b[k])
}
