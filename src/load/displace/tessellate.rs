//! Subdivision of displaced meshes: edges are bisected until none is longer than requested. The decision depends on the edge's
//! vertices alone, so that adjacent triangles agree and no cracks open.

use super::offsets::{Parts, warn};
use crate::error::Warning;
use crate::math::Vec3;
use crate::scene::{Mesh, MeshPart};
use std::collections::HashMap;

/// Maximum number of triangles of all subdivided meshes of a scene together.
pub const MAX_TRIANGLES: usize = 16_000_000;
/// Default edge length, as a fraction of the diagonal of the mesh's bounding box.
const DEFAULT_EDGE: f32 = 1.0 / 256.0;

/// The mesh with its parts subdivided to the maximum edge lengths of their height maps.
pub fn tessellated(base: Mesh, parts: &Parts, budget: usize, warnings: &mut Vec<Warning>) -> Mesh {
    let edge = |edge: f32| if edge > 0.0 { edge } else { DEFAULT_EDGE * diagonal(&base) };
    let edges: Vec<Option<f32>> = parts.iter().map(|part| Some(edge(part.as_ref()?.edge()?))).collect();
    if edges.iter().all(Option::is_none) {
        return base;
    }
    let edges = limit_edges(&base, edges, budget, warnings);
    let (fine, longest) = subdivided(&base, &edges, budget);
    if let Some(longest) = longest {
        let message = format!(
            "is subdivided only to edges of {longest:.3}: all displaced meshes together may have {MAX_TRIANGLES} triangles"
        );
        warn(warnings, &base.name, message);
    }
    fine
}

/// Replaces edge lengths that need far more triangles than the budget by the default length.
fn limit_edges(
    base: &Mesh,
    mut edges: Vec<Option<f32>>,
    budget: usize,
    warnings: &mut Vec<Warning>,
) -> Vec<Option<f32>> {
    /// Multiple of the budget from which on the default edge length is used.
    const MAX_EXCESS: f64 = 16.0;
    let min_count = min_triangles(base, &edges);
    if min_count <= MAX_EXCESS * budget as f64 {
        return edges;
    }
    let default = DEFAULT_EDGE * diagonal(base);
    // Bisection makes up to four times the minimum number of triangles.
    let shortest = (min_count * 4.0 / budget.max(1) as f64).sqrt();
    let requested = edges.iter().flatten().copied().fold(f32::INFINITY, f32::min);
    let message = format!(
        "is subdivided to edges of {default:.3}, the default: edges of {requested:e} would take at least {min_count:.1e} triangles, and all displaced \
         meshes together may have {MAX_TRIANGLES}; edge = {:.1e} is possible",
        f64::from(requested) * shortest
    );
    warn(warnings, &base.name, message);
    edges.iter_mut().flatten().for_each(|edge| *edge = edge.max(default));
    edges
}

/// Diagonal of a mesh's bounding box, object units.
fn diagonal(mesh: &Mesh) -> f32 {
    let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
    for p in &mesh.positions {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    (0..3).map(|k| (high[k] - low[k]).powi(2)).sum::<f32>().sqrt()
}

/// The mesh without tangents, its parts subdivided to the maximum edge lengths; and its longest edge if the subdivision
/// stopped at `most` triangles.
pub fn subdivided(mesh: &Mesh, edges: &[Option<f32>], most: usize) -> (Mesh, Option<f32>) {
    let mut fine = Mesh { tangents: Vec::new(), triangles: Vec::new(), parts: Vec::new(), ..mesh.clone() };
    let mut longest = None;
    for (part, edge) in mesh.parts.iter().zip(edges) {
        let mut triangles = mesh.triangles[part.triangles()].to_vec();
        while let Some(edge) = *edge {
            let cuts: usize =
                triangles.iter().map(|t| sides(t).filter(|&side| is_cut(&fine, side, edge)).count()).sum();
            if cuts == 0 {
                break;
            }
            if fine.triangles.len() + triangles.len() + cuts > most {
                let remaining = triangles.iter().flat_map(sides).map(|[a, b]| length(&fine, a, b));
                longest = Some(remaining.fold(longest.unwrap_or(0.0), f32::max));
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

/// A lower bound on the number of triangles after subdivision: no triangle is larger than the equilateral one.
fn min_triangles(mesh: &Mesh, edges: &[Option<f32>]) -> f64 {
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| Vec3::from_array(mesh.positions[i as usize]).as_dvec3());
        0.5 * (b - a).cross(c - a).length()
    };
    let of_part = |(part, edge): (&MeshPart, &Option<f32>)| {
        let triangles = &mesh.triangles[part.triangles()];
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
    // `abs` makes the result independent of the order of the vertices.
    (a - b).abs().length()
}

/// Whether an edge is longer than `edge`, and its midpoint distinct from its ends. Far from the origin the spacing of f32 may
/// exceed the edge length, and the midpoint rounds to an end.
fn is_cut(mesh: &Mesh, [a, b]: [u32; 2], edge: f32) -> bool {
    let full_length = length(mesh, a, b);
    if full_length <= edge {
        return false;
    }
    let [p, q] = [a, b].map(|i| mesh.positions[i as usize]);
    let middle = Vec3::from_array(mean(p, q));
    [p, q].iter().all(|&end| middle.distance(Vec3::from_array(end)) < 0.75 * full_length)
}

/// Bisects all edges longer than `edge` once.
fn cut(mesh: &mut Mesh, triangles: &[[u32; 3]], edge: f32) -> Vec<[u32; 3]> {
    let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
    let mut finer = Vec::with_capacity(2 * triangles.len());
    for triangle in triangles {
        let middle = sides(triangle).map(|[a, b]| {
            is_cut(mesh, [a, b], edge)
                .then(|| *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| add_midpoint(mesh, a, b)))
        });
        let middle: Vec<Option<u32>> = middle.collect();
        // Rotate the triangle so that cut edges come first.
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

/// Adds a vertex at the midpoint of two others.
fn add_midpoint(mesh: &mut Mesh, a: u32, b: u32) -> u32 {
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
