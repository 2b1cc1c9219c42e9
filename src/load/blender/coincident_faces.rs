//! Faces that lie in the same place as others, as of an object and its copy: Cycles shadows each by the other, so that they are dark
//! in its pictures. Here they are lit, which a note explains.

use crate::error::Warning;
use crate::load::Loaded;
use crate::math::DVec3;
use crate::scene::{Instance, Mesh, Motion};
use std::collections::BTreeMap;
use std::path::Path;

/// Scenes of more triangles aren't searched: a fifth of a second for this many.
const MAX_TRIANGLES: usize = 4_000_000;

/// Triangles whose centroids are this near, relative to the size of the scene, are in the same place.
const RELATIVE_CELL: f64 = 1e-6;

/// Fewer triangles aren't worth a note.
const MIN_TRIANGLES: usize = 8;

/// Adds a note about the objects that share most triangles.
pub(super) fn tell(path: &Path, loaded: &mut Loaded) {
    let instances = &loaded.scene.instances;
    let pairs = coincident_pairs(instances, &loaded.scene.meshes);
    let Some((&[a, b], &count)) = pairs.iter().max_by_key(|(_, count)| **count) else { return };
    if count < MIN_TRIANGLES {
        return;
    }
    let total: usize = pairs.values().sum();
    let named = |i: u32| format!("'{}'", instances[i as usize].name);
    let place = match a == b {
        true => format!("on top of each other, most of them of {}", named(a)),
        false => format!("in the same place as others, most of them of {} and {}", named(a), named(b)),
    };
    let message = format!("{total} triangles are {place}: Cycles shows them dark, here they are lit");
    loaded.notes.push(Warning::new(path, "", ("faces-coincident", message)));
}

/// The number of pairs of triangles in the same place by their instances, which are the same for doubled faces of one mesh.
fn coincident_pairs(instances: &[Instance], meshes: &[Mesh]) -> BTreeMap<[u32; 2], usize> {
    let mut pairs = BTreeMap::new();
    let mesh_of = |instance: &Instance| &meshes[instance.mesh.index()];
    let is_still = |instance: &Instance| matches!(instance.motion, Motion::Still);
    let count: usize = instances.iter().map(|i| mesh_of(i).triangles.len()).sum();
    if count > MAX_TRIANGLES {
        return pairs;
    }
    let mut centroids: Vec<(DVec3, u32)> = Vec::with_capacity(count);
    for (number, instance) in instances.iter().enumerate().filter(|(_, instance)| is_still(instance)) {
        let mesh = mesh_of(instance);
        let corner = |i: u32| DVec3::from(mesh.positions[i as usize].map(f64::from));
        let centroid = |[a, b, c]: [u32; 3]| (corner(a) + corner(b) + corner(c)) / 3.0;
        let placed = |t: &[u32; 3]| instance.world_from_object.transform_point3(centroid(*t));
        centroids.extend(mesh.triangles.iter().map(|t| (placed(t), number as u32)));
    }
    let min = centroids.iter().fold(DVec3::INFINITY, |min, (p, _)| min.min(*p));
    let max = centroids.iter().fold(DVec3::NEG_INFINITY, |max, (p, _)| max.max(*p));
    let cell = (max - min).max_element() * RELATIVE_CELL;
    if !(cell > 0.0 && cell.is_finite()) {
        return pairs;
    }
    let key = |p: &DVec3| ((*p - min) / cell).round().to_array().map(|x| x as u32);
    let mut cells: Vec<([u32; 3], u32)> = centroids.iter().map(|(p, instance)| (key(p), *instance)).collect();
    cells.sort_unstable();
    for same in cells.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 1) {
        *pairs.entry([same[0].1, same[same.len() - 1].1]).or_default() += same.len();
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
    fn copies_in_the_same_place_are_found() {
        let pairs = coincident_pairs(&[placed("a", 0.0), placed("far", 9.0), placed("b", 1e-9)], &[grid()]);
        assert_eq!(pairs, BTreeMap::from([([0, 2], 64)]));
    }

    #[test]
    fn doubled_faces_are_found() {
        let mut mesh = grid();
        mesh.triangles.extend_from_within(..10);
        assert_eq!(coincident_pairs(&[placed("a", 0.0)], &[mesh]), BTreeMap::from([([0, 0], 20)]));
    }

    #[test]
    fn neighbours_are_not_coincident() {
        assert!(coincident_pairs(&[placed("a", 0.0), placed("b", 1e-4)], &[grid()]).is_empty());
    }
}
