//! Coincident faces: equal triangles, as of an object and its copy, and triangles of one plane that overlap and face the same way. Cycles
//! shadows each by the other, so that they are dark in its pictures; here they are lit, which a note explains. Faces of touching bodies,
//! which face each other, are hidden and don't count.

use crate::error::Warning;
use crate::load::Loaded;
use crate::math::{DVec2, DVec3};
use crate::scene::{Instance, Mesh, Motion};
use std::collections::BTreeMap;
use std::path::Path;

/// Maximum number of triangles of scenes that are searched, for which time and memory are small beside those of loading.
const MAX_TRIANGLES: usize = 4_000_000;

/// Triangles coincide if their centroids are in the same cell of a grid of this spacing, relative to the size of the scene.
const RELATIVE_CELL: f64 = 1e-6;

/// Minimum area of coincident triangles for a note, relative to the area of all triangles.
const MIN_AREA: f64 = 1e-3;

/// Spacing of the components of unit normals of one plane.
const NORMAL_CELL: f64 = 1e-4;

/// Scale of triangles about their centroids in overlap tests, so that neighbours don't overlap.
const SHRINK: f64 = 0.99;

/// Maximum number of overlap tests: more overlaps are not found.
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
        "{count} triangles coincide with others or overlap them in one plane, mainly of {objects}: Cycles shows them dark, here they are lit"
    );
    loaded.notes.push(Warning::new(path, "", ("faces-coincident", message)));
}

/// A triangle in world space.
#[derive(Clone, Copy)]
struct Face {
    corners: [DVec3; 3],
    instance: u32,
    is_found: bool,
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

/// Coincident triangles of still instances by pairs of instances, twice the same one for faces of one mesh.
fn coincident_pairs(instances: &[Instance], meshes: &[Mesh]) -> BTreeMap<[u32; 2], Coincidence> {
    let count: usize = instances.iter().map(|i| meshes[i.mesh.index()].triangles.len()).sum();
    if count > MAX_TRIANGLES {
        return BTreeMap::new();
    }
    let mut faces = faces_of(instances, meshes);
    let min = faces.iter().fold(DVec3::INFINITY, |min, face| min.min(face.centroid()));
    let max = faces.iter().fold(DVec3::NEG_INFINITY, |max, face| max.max(face.centroid()));
    let cell = (max - min).max_element() * RELATIVE_CELL;
    if !(cell > 0.0 && cell.is_finite()) {
        return BTreeMap::new();
    }
    let mut pairs = Pairs { total: faces.iter().map(Face::area).sum(), by_instances: BTreeMap::new() };
    let place = |face: &Face| ((face.centroid() - min) / cell).round().to_array().map(|x| x as i64);
    faces.sort_by_cached_key(place);
    for same in faces.chunk_by_mut(|a, b| place(a) == place(b)).filter(|same| same.len() > 1) {
        let partner = [same[0].instance, same[same.len() - 1].instance];
        for face in same {
            pairs.add(face, if face.instance == partner[0] { partner[1] } else { partner[0] });
        }
    }
    let plane = |face: &Face| {
        let normal = face.normal().normalize_or_zero();
        let [x, y, z] = (normal / NORMAL_CELL).to_array();
        [x, y, z, normal.dot(face.centroid() - min) / cell].map(|value| value.round() as i64)
    };
    faces.sort_by_cached_key(plane);
    let mut tests = MAX_TESTS;
    for same in faces.chunk_by_mut(|a, b| plane(a) == plane(b)).filter(|same| same.len() > 1) {
        add_overlaps(same, &mut pairs, &mut tests);
    }
    pairs.by_instances
}

fn faces_of(instances: &[Instance], meshes: &[Mesh]) -> Vec<Face> {
    let is_still = |instance: &Instance| matches!(instance.motion, Motion::Still);
    let mut faces = Vec::new();
    for (number, instance) in (0..).zip(instances).filter(|(_, instance)| is_still(instance)) {
        let mesh = &meshes[instance.mesh.index()];
        let corner = |i: u32| {
            let local = DVec3::from(mesh.positions[i as usize].map(f64::from));
            instance.world_from_object.transform_point3(local)
        };
        faces.extend(mesh.triangles.iter().map(|t| Face {
            corners: t.map(corner),
            instance: number,
            is_found: false,
        }));
    }
    faces
}

/// The coincident triangles found so far.
struct Pairs {
    /// Area of all triangles.
    total: f64,
    by_instances: BTreeMap<[u32; 2], Coincidence>,
}

impl Pairs {
    /// Counts a triangle, once, that coincides with one of another instance or of its own.
    fn add(&mut self, face: &mut Face, other: u32) {
        if !std::mem::replace(&mut face.is_found, true) {
            let key = [face.instance.min(other), face.instance.max(other)];
            let pair = self.by_instances.entry(key).or_default();
            pair.triangles += 1;
            pair.area += face.area() / self.total;
        }
    }
}

/// Adds the triangles of one plane that overlap; at most `tests` pairs are compared.
fn add_overlaps(faces: &mut [Face], pairs: &mut Pairs, tests: &mut usize) {
    let normal = faces[0].normal().abs();
    if normal.max_element() <= 0.0 {
        return;
    }
    // Coordinates in the plane, without the axis that is closest to its normal.
    let axis = (0..3).max_by(|&i, &j| normal[i].total_cmp(&normal[j])).unwrap_or(0);
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    let flat: Vec<[DVec2; 3]> =
        faces.iter().map(|face| shrunk(face.corners.map(|c| DVec2::new(c[u], c[v])))).collect();
    let (cells, large) = cells_of(&flat);
    let mut compare = |i: usize, j: usize| {
        *tests = tests.saturating_sub(1);
        if *tests > 0 && i != j && !(faces[i].is_found && faces[j].is_found) && overlap(&flat[i], &flat[j]) {
            let [a, b] = [faces[i].instance, faces[j].instance];
            pairs.add(&mut faces[i], b);
            pairs.add(&mut faces[j], a);
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

/// Do two triangles overlap? By the separating axis theorem.
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
