//! Moves the vertices of a fine mesh by heights, and finds its normals anew.

use super::heights::Parts;
use crate::math::Vec3;
use crate::scene::Mesh;
use std::collections::HashMap;

/// A point by its bits, with both zeros alike.
type Key = [u32; 3];

fn key(p: [f32; 3]) -> Key {
    p.map(|x| (x + 0.0).to_bits())
}

/// What vertices in one place have in common: at seams of texture coordinates and at hard edges they are several, and move as one.
#[derive(Clone, Copy, Default)]
struct Place {
    direction: Vec3,
    /// Sum of the lengths of what `direction` is the sum of.
    length: f32,
    heights: f32,
    count: f32,
}

impl Place {
    /// The way of a vertex whose own direction is given. The sides of a card cancel each other: each goes its own way.
    fn direction_of(&self, own: Vec3) -> Vec3 {
        let is_shared = self.direction.length() > SHARED * self.length;
        if is_shared { self.direction.normalize_or_zero() } else { own.normalize_or_zero() }
    }
}

/// How long the sum of the directions of a place must be, as a share of all their lengths, for its vertices to move as one.
const SHARED: f32 = 0.1;

/// The mesh with the vertices of its displaced parts moved along their normals.
pub(super) fn lifted(mut mesh: Mesh, parts: &Parts) -> Mesh {
    let over = vertices_over(&mesh, parts);
    let own = directions(&mesh);
    let mut places: HashMap<Key, Place> = HashMap::new();
    for (vertex, part) in over.iter().enumerate() {
        let Some((displacement, heights)) = part.and_then(|part| parts[part]) else { continue };
        let place = places.entry(key(mesh.positions[vertex])).or_default();
        place.heights +=
            displacement.scale * (heights.at(mesh.uv_sets[heights.set()][vertex]) - displacement.midlevel);
        place.count += 1.0;
    }
    for (vertex, direction) in own.iter().enumerate() {
        if let Some(place) = places.get_mut(&key(mesh.positions[vertex])) {
            place.direction += *direction;
            place.length += direction.length();
        }
    }
    // Normals are smooth where they were: where vertices of one place had the same. Flat meshes become smooth.
    let smooth: Vec<(Key, Key)> = (0..mesh.positions.len())
        .map(|v| (key(mesh.positions[v]), mesh.normals.get(v).map_or([0; 3], |n| key(*n))))
        .collect();
    for vertex in (0..over.len()).filter(|&vertex| over[vertex].is_some()) {
        let Some(place) = places.get(&smooth[vertex].0) else { continue };
        let moved = place.direction_of(own[vertex]) * (place.heights / place.count);
        let p = Vec3::from_array(mesh.positions[vertex]) + moved;
        if p.is_finite() {
            mesh.positions[vertex] = p.to_array();
        }
    }
    set_normals(&mut mesh, &over, &smooth);
    mesh
}

/// The displaced part that each vertex belongs to: the first that uses it.
fn vertices_over(mesh: &Mesh, parts: &Parts) -> Vec<Option<usize>> {
    let mut over = vec![None; mesh.positions.len()];
    for (index, part) in mesh.parts.iter().enumerate().filter(|(index, _)| parts[*index].is_some()) {
        let first = part.first_triangle as usize;
        for vertex in mesh.triangles[first..first + part.triangle_count as usize].as_flattened() {
            over[*vertex as usize].get_or_insert(index);
        }
    }
    over
}

/// Normals of vertices, or where there are none those of the triangles around, weighted by their areas.
fn directions(mesh: &Mesh) -> Vec<Vec3> {
    if !mesh.normals.is_empty() {
        return mesh.normals.iter().map(|n| Vec3::from_array(*n)).collect();
    }
    let mut sums = vec![Vec3::ZERO; mesh.positions.len()];
    for (triangle, normal) in mesh.triangles.iter().zip(face_normals(mesh)) {
        triangle.iter().for_each(|&vertex| sums[vertex as usize] += normal);
    }
    sums
}

/// Normals of triangles, twice their areas long.
fn face_normals(mesh: &Mesh) -> impl Iterator<Item = Vec3> + '_ {
    mesh.triangles.iter().map(|triangle| {
        let [a, b, c] = triangle.map(|v| Vec3::from_array(mesh.positions[v as usize]));
        (b - a).cross(c - a)
    })
}

/// Means of the normals of the triangles around, weighted by their areas.
fn set_normals(mesh: &mut Mesh, over: &[Option<usize>], smooth: &[(Key, Key)]) {
    let mut sums: HashMap<(Key, Key), Vec3> = HashMap::new();
    for (triangle, normal) in mesh.triangles.iter().zip(face_normals(mesh)) {
        for vertex in triangle {
            *sums.entry(smooth[*vertex as usize]).or_default() += normal;
        }
    }
    let had_normals = !mesh.normals.is_empty();
    let normals = (0..mesh.positions.len()).map(|vertex| {
        let sum = sums.get(&smooth[vertex]).and_then(|sum| sum.try_normalize());
        let kept = mesh.normals.get(vertex).copied();
        match (over[vertex].is_some() || !had_normals, sum) {
            (true, Some(sum)) => sum.to_array(),
            _ => kept.unwrap_or([0.0, 1.0, 0.0]),
        }
    });
    mesh.normals = normals.collect();
}
