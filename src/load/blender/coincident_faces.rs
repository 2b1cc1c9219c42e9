//! Coincident faces: equal triangles (an object and its copy), and coplanar overlapping triangles that face the same way. In Cycles they
//! shadow each other and look dark; here they are lit, and a note says so. Faces of touching bodies face each other, are hidden, and
//! don't count.

use crate::error::Warning;
use crate::load::Loaded;
use crate::math::{DVec2, DVec3};
use crate::sampling::hash::mix64;
use crate::scene::{Instance, Mesh, Motion};
use std::collections::BTreeMap;
use std::path::Path;

/// Maximum number of triangles of a scene to search, so that time and memory are small compared with those of loading.
const MAX_TRIANGLES: usize = 4_000_000;

/// Triangles coincide if their centroids are in the same cell of a grid of this spacing, relative to the size of the scene.
const RELATIVE_CELL: f64 = 1e-6;

/// Minimum area of coincident triangles for a note, relative to the area of all triangles.
const MIN_AREA: f64 = 1e-3;

/// Spacing of the components of unit normals of one plane.
const NORMAL_CELL: f64 = 1e-4;

/// Scale of triangles about their centroids in overlap tests, so that adjacent triangles don't overlap.
const SHRINK: f64 = 0.99;

/// Maximum number of overlap tests; further overlaps are not found.
const MAX_TESTS: usize = 20_000_000;

/// Triangles that cover more cells of the search grid than this are compared with all others of their plane.
const MAX_CELLS: usize = 64;

/// Coincident triangles of two instances, or of one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Coincidence {
    triangles: usize,
    /// Relative to the area of all triangles.
    area: f64,
}

/// Adds a note that names the objects with the largest area of coincident triangles.
pub(super) fn add_note(path: &Path, loaded: &mut Loaded) {
    let instances = &loaded.scene.instances;
    let pairs = coincident_pairs(instances, &loaded.scene.meshes);
    let Some((&[a, b], _)) = pairs.iter().max_by(|a, b| a.1.area.total_cmp(&b.1.area)) else { return };
    if pairs.values().map(|pair| pair.area).sum::<f64>() < MIN_AREA {
        return;
    }
    let count: usize = pairs.values().map(|pair| pair.triangles).sum();
    let name = |i: u32| format!("'{}'", instances[i as usize].name);
    let objects = if a == b { name(a) } else { format!("{} and {}", name(a), name(b)) };
    let message = format!(
        "{count} triangles coincide with or overlap coplanar ones, mainly in {objects}: they are dark in Cycles, but lit here"
    );
    loaded.notes.push(Warning::new(path, "", ("faces-coincident", message)));
}

/// A triangle in world space.
struct Face {
    corners: [DVec3; 3],
    instance: u32,
}

impl Face {
    fn centroid(&self) -> DVec3 {
        (self.corners[0] + self.corners[1] + self.corners[2]) / 3.0
    }

    /// Normal with the length of twice the area.
    fn normal(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a)
    }

    fn area(&self) -> f64 {
        0.5 * self.normal().length()
    }
}

/// The triangles of static instances, numbered consecutively. Transformed on each access: storing them would take more memory than the
/// scene.
struct Faces<'a> {
    /// Number of the first triangle, instance index, instance and mesh.
    instances: Vec<(u32, u32, &'a Instance, &'a Mesh)>,
    count: u32,
}

impl<'a> Faces<'a> {
    /// `None` for too many triangles.
    fn of(instances: &'a [Instance], meshes: &'a [Mesh]) -> Option<Faces<'a>> {
        let mut faces = Faces { instances: Vec::new(), count: 0 };
        let mut count = 0;
        for (number, instance) in (0..).zip(instances).filter(|(_, i)| matches!(i.motion, Motion::Still)) {
            let mesh = &meshes[instance.mesh.index()];
            faces.instances.push((count as u32, number, instance, mesh));
            count += mesh.triangles.len();
            if count > MAX_TRIANGLES {
                return None;
            }
        }
        Some(Faces { count: count as u32, ..faces })
    }

    fn get(&self, number: u32) -> Face {
        let after = self.instances.partition_point(|&(first, ..)| first <= number);
        let (first, instance, placed, mesh) = self.instances[after - 1];
        let corners = mesh.triangles[(number - first) as usize].map(|i| {
            let local = DVec3::from(mesh.positions[i as usize].map(f64::from));
            placed.world_from_object.transform_point3(local)
        });
        Face { corners, instance }
    }

    fn iter(&self) -> impl Iterator<Item = Face> + '_ {
        (0..self.count).map(|number| self.get(number))
    }
}

/// Coincident triangles of static instances by pair of instances; both are the same for triangles of one instance.
fn coincident_pairs(instances: &[Instance], meshes: &[Mesh]) -> BTreeMap<[u32; 2], Coincidence> {
    let Some(faces) = Faces::of(instances, meshes) else { return BTreeMap::new() };
    let (mut min, mut max, mut total) = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0.0);
    for face in faces.iter() {
        (min, max, total) = (min.min(face.centroid()), max.max(face.centroid()), total + face.area());
    }
    let cell = (max - min).max_element() * RELATIVE_CELL;
    if !(cell > 0.0 && cell.is_finite()) {
        return BTreeMap::new();
    }
    let (mut places, mut planes) = (Vec::new(), Vec::new());
    for (number, face) in (0..).zip(faces.iter()) {
        let centroid = face.centroid() - min;
        let normal = face.normal().normalize_or_zero();
        let [x, y, z] = (normal / NORMAL_CELL).to_array();
        places.push((hash_of((centroid / cell).to_array()), number));
        planes.push((hash_of([x, y, z, normal.dot(centroid) / cell]), number));
    }
    let mut pairs =
        Pairs { total, is_found: vec![false; faces.count as usize], by_instances: BTreeMap::new() };
    for same in equal_hashes(&mut places) {
        let [first, last] = [same[0].1, same[same.len() - 1].1].map(|number| faces.get(number).instance);
        for &(_, number) in same {
            let face = faces.get(number);
            pairs.add(number, &face, if face.instance == first { last } else { first });
        }
    }
    let mut tests = MAX_TESTS;
    for same in equal_hashes(&mut planes) {
        let group: Vec<(u32, Face)> = same.iter().map(|&(_, number)| (number, faces.get(number))).collect();
        add_overlaps(&group, &mut pairs, &mut tests);
    }
    pairs.by_instances
}

/// Hash of the grid cell with these coordinates; collisions are negligible.
fn hash_of<const N: usize>(coordinates: [f64; N]) -> u64 {
    coordinates.into_iter().fold(1, |hash, x| mix64(hash ^ x.round() as i64 as u64))
}

/// The groups of at least two triangles with the same hash, in ascending order of their numbers.
fn equal_hashes(keys: &mut [(u64, u32)]) -> impl Iterator<Item = &[(u64, u32)]> {
    keys.sort_unstable();
    keys.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 1)
}

/// The coincident triangles found so far.
struct Pairs {
    /// Area of all triangles.
    total: f64,
    /// By triangle.
    is_found: Vec<bool>,
    by_instances: BTreeMap<[u32; 2], Coincidence>,
}

impl Pairs {
    /// Counts a triangle that coincides with one of the instance `other`; once per triangle.
    fn add(&mut self, number: u32, face: &Face, other: u32) {
        if !std::mem::replace(&mut self.is_found[number as usize], true) {
            let key = [face.instance.min(other), face.instance.max(other)];
            let pair = self.by_instances.entry(key).or_default();
            pair.triangles += 1;
            pair.area += face.area() / self.total;
        }
    }
}

/// Adds the triangles of a plane that overlap; at most `tests` pairs are compared.
fn add_overlaps(faces: &[(u32, Face)], pairs: &mut Pairs, tests: &mut usize) {
    let normal = faces[0].1.normal().abs();
    if normal.max_element() <= 0.0 {
        return;
    }
    // Coordinates in the plane, without the axis that is closest to its normal.
    let axis = (0..3).max_by(|&i, &j| normal[i].total_cmp(&normal[j])).unwrap_or(0);
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    let flat: Vec<[DVec2; 3]> =
        faces.iter().map(|(_, face)| shrunk(face.corners.map(|c| DVec2::new(c[u], c[v])))).collect();
    let (cells, large) = cells_of(&flat);
    let mut compare = |i: usize, j: usize| {
        *tests = tests.saturating_sub(1);
        let [(a, face_a), (b, face_b)] = [&faces[i], &faces[j]];
        let is_known = pairs.is_found[*a as usize] && pairs.is_found[*b as usize];
        if *tests > 0 && i != j && !is_known && overlap(&flat[i], &flat[j]) {
            pairs.add(*a, face_a, face_b.instance);
            pairs.add(*b, face_b, face_a.instance);
        }
    };
    for same in cells.chunk_by(|a, b| a.0 == b.0) {
        for (k, (_, i)) in same.iter().enumerate() {
            same[..k].iter().for_each(|(_, j)| compare(*i as usize, *j as usize));
        }
    }
    for &i in &large {
        (0..flat.len()).for_each(|j| compare(i as usize, j));
    }
}

/// The cells of a grid that each triangle's bounding box overlaps, sorted by cell; and triangles that overlap too many of them.
fn cells_of(flat: &[[DVec2; 3]]) -> (Vec<([i32; 2], u32)>, Vec<u32>) {
    let bounds = |[a, b, c]: [DVec2; 3]| [a.min(b).min(c), a.max(b).max(c)];
    let sizes = flat.iter().map(|&t| bounds(t)).map(|[low, high]| (high - low).max_element());
    let cell = (sizes.sum::<f64>() / flat.len() as f64).max(f64::MIN_POSITIVE);
    let (mut cells, mut large) = (Vec::new(), Vec::new());
    for (i, &triangle) in (0..).zip(flat) {
        let [low, high] = bounds(triangle).map(|p| (p / cell).floor().as_ivec2());
        let count = (i64::from(high.x) - i64::from(low.x) + 1) * (i64::from(high.y) - i64::from(low.y) + 1);
        if count > MAX_CELLS as i64 {
            large.push(i);
            continue;
        }
        cells.extend((low.y..=high.y).flat_map(|y| (low.x..=high.x).map(move |x| ([x, y], i))));
    }
    cells.sort_unstable();
    (cells, large)
}

/// A triangle scaled by [`SHRINK`] about its centroid.
fn shrunk(corners: [DVec2; 3]) -> [DVec2; 3] {
    let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
    corners.map(|corner| middle + (corner - middle) * SHRINK)
}

/// Whether two triangles overlap, by the separating axis theorem.
fn overlap(a: &[DVec2; 3], b: &[DVec2; 3]) -> bool {
    let separates = |axis: DVec2| {
        let range = |t: &[DVec2; 3]| {
            let [x, y, z] = t.map(|p| p.dot(axis));
            [x.min(y).min(z), x.max(y).max(z)]
        };
        let ([a0, a1], [b0, b1]) = (range(a), range(b));
        a1 <= b0 || b1 <= a0
    };
    let edges = |t: &[DVec2; 3]| [(t[1] - t[0]).perp(), (t[2] - t[1]).perp(), (t[0] - t[2]).perp()];
    !edges(a).into_iter().chain(edges(b)).any(separates)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DAffine3;
    use crate::scene::MeshId;

    fn grid() -> Mesh {
        let positions = (0..25).map(|i| [(i % 5) as f32, (i / 5) as f32, 0.3 * (i % 3) as f32]).collect();
        let quads = (0..16u32).map(|q| q / 4 * 5 + q % 4);
        let triangles = quads.flat_map(|i| [[i, i + 1, i + 5], [i + 1, i + 6, i + 5]]).collect();
        Mesh { positions, triangles, ..Mesh::default() }
    }

    fn placed(name: &str, x: f64) -> Instance {
        let place = DAffine3::from_translation(DVec3::new(x, 0.0, 0.0));
        Instance { name: name.into(), ..Instance::new(MeshId(0), place) }
    }

    #[test]
    fn finds_coincident_instances() {
        let pairs = coincident_pairs(&[placed("a", 0.0), placed("far", 9.0), placed("b", 1e-9)], &[grid()]);
        let pair = pairs[&[0, 2]];
        assert!(
            pairs.len() == 1 && pair.triangles == 64 && (pair.area - 2.0 / 3.0).abs() < 1e-9,
            "{pairs:?}"
        );
    }

    #[test]
    fn finds_duplicate_faces() {
        let mut mesh = grid();
        mesh.triangles.extend_from_within(..10);
        let pairs = coincident_pairs(&[placed("a", 0.0)], &[mesh]);
        assert!(pairs.len() == 1 && pairs[&[0, 0]].triangles == 20, "{pairs:?}");
    }

    /// A quad of two triangles, in the plane of the others or not.
    fn quad(x: f32, z: f32) -> Mesh {
        let positions = vec![[x, 0.3, z], [x + 1.0, 0.3, z], [x + 1.0, 0.9, z], [x, 0.9, z]];
        Mesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() }
    }

    #[test]
    fn finds_overlaps_in_a_plane() {
        let instances: Vec<Instance> = (0..4).map(|i| Instance::new(MeshId(i), DAffine3::IDENTITY)).collect();
        let meshes = [quad(0.0, 0.0), quad(0.5, 0.0), quad(3.0, 0.0), quad(0.0, 1e-3)];
        let pairs = coincident_pairs(&instances, &meshes);
        assert!(pairs.len() == 1 && pairs[&[0, 1]].triangles >= 3, "{pairs:?}");
        // Bodies that touch.
        let mut below = quad(0.5, 0.0);
        below.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        let meshes = [quad(0.0, 0.0), below, quad(1.0, 0.0), quad(0.0, 1e-3)];
        assert!(coincident_pairs(&instances, &meshes).is_empty());
    }

    #[test]
    fn ignores_neighbours() {
        assert!(coincident_pairs(&[placed("a", 0.0), placed("b", 1e-4)], &[grid()]).is_empty());
    }
}
