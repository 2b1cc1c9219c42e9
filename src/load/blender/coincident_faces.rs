//! Coincident faces, as of an object and its copy. Cycles shadows each by the other, so that they are dark in its pictures; here they
//! are lit, which a note explains.

use crate::error::Warning;
use crate::load::Loaded;
use crate::math::DVec3;
use crate::scene::{Instance, Mesh, Motion};
use std::collections::BTreeMap;
use std::path::Path;

/// Maximum number of triangles of scenes that are searched, for which time and memory are small beside those of loading.
const MAX_TRIANGLES: usize = 4_000_000;

/// Triangles coincide if their centroids are in the same cell of a grid of this spacing, relative to the size of the scene.
const RELATIVE_CELL: f64 = 1e-6;

/// Minimum area of coincident triangles for a note, relative to the area of all triangles.
const MIN_AREA: f64 = 1e-3;

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
        "{count} triangles coincide with others, mainly of {objects}: Cycles shows them dark, here they are lit"
    );
    loaded.notes.push(Warning::new(path, "", ("faces-coincident", message)));
}

/// Coincident triangles of still instances by pairs of instances, twice the same one for duplicate faces of a mesh.
fn coincident_pairs(instances: &[Instance], meshes: &[Mesh]) -> BTreeMap<[u32; 2], Coincidence> {
    let mut pairs: BTreeMap<[u32; 2], Coincidence> = BTreeMap::new();
    let mesh_of = |instance: &Instance| &meshes[instance.mesh.index()];
    let is_still = |instance: &Instance| matches!(instance.motion, Motion::Still);
    let count: usize = instances.iter().map(|i| mesh_of(i).triangles.len()).sum();
    if count > MAX_TRIANGLES {
        return pairs;
    }
    let mut triangles: Vec<(DVec3, f64, u32)> = Vec::with_capacity(count);
    for (number, instance) in instances.iter().enumerate().filter(|(_, instance)| is_still(instance)) {
        let mesh = mesh_of(instance);
        let corner = |i: u32| {
            let local = DVec3::from(mesh.positions[i as usize].map(f64::from));
            instance.world_from_object.transform_point3(local)
        };
        triangles.extend(mesh.triangles.iter().map(|t| {
            let [a, b, c] = t.map(corner);
            ((a + b + c) / 3.0, 0.5 * (b - a).cross(c - a).length(), number as u32)
        }));
    }
    let min = triangles.iter().fold(DVec3::INFINITY, |min, t| min.min(t.0));
    let max = triangles.iter().fold(DVec3::NEG_INFINITY, |max, t| max.max(t.0));
    let cell = (max - min).max_element() * RELATIVE_CELL;
    if !(cell > 0.0 && cell.is_finite()) {
        return pairs;
    }
    let total: f64 = triangles.iter().map(|t| t.1).sum();
    let key = |p: &DVec3| ((*p - min) / cell).round().to_array().map(|x| x as u32);
    let mut cells: Vec<([u32; 3], u32, f64)> =
        triangles.iter().map(|(p, area, i)| (key(p), *i, *area)).collect();
    cells.sort_unstable_by_key(|cell| (cell.0, cell.1));
    for same in cells.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 1) {
        let pair = pairs.entry([same[0].1, same[same.len() - 1].1]).or_default();
        pair.triangles += same.len();
        pair.area += same.iter().map(|cell| cell.2).sum::<f64>() / total;
    }
    pairs
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

    #[test]
    fn ignores_neighbours() {
        assert!(coincident_pairs(&[placed("a", 0.0), placed("b", 1e-4)], &[grid()]).is_empty());
    }
}
