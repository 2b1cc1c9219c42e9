//! Undersides on the ground: one-sided sheets that lie on it and face down. Their fronts are never seen, and they are absent
//! from behind; but light that the ground reflects would end at them, and leave a black patch in their place.

use crate::error::Warning;
use crate::load::Loaded;
use crate::math::DVec3;
use crate::scene::{Instance, Mesh, MeshId, Model, Scene, Transmission};
use std::collections::{HashMap, HashSet};

/// An edge by the bits of its ends' coordinates, in order.
type Edge = [[u32; 3]; 2];

/// Removes undersides up to a height, relative to the model's offset. Those that close a body stay: its inside would be
/// open to the ground. Meshes are not changed, as others may refer to them: instances get copies.
pub(super) fn leave_out(loaded: &mut Loaded, height: f64) {
    let scene = &mut loaded.scene;
    let (mut count, mut emptied) = (0, HashSet::new());
    for index in 0..scene.instances.len() {
        let instance = &scene.instances[index];
        let is_static = !scene.motion.meshes.contains_key(&instance.mesh.index());
        let Some(hidden) = is_static.then(|| undersides(scene, instance, loaded.offset, height)).flatten()
        else {
            continue;
        };
        count += hidden.len();
        let rest = without(&scene.meshes[instance.mesh.index()], &hidden);
        if rest.triangles.is_empty() {
            emptied.insert(index);
            continue;
        }
        scene.instances[index].mesh = MeshId(scene.meshes.len() as u32);
        scene.meshes.push(rest);
    }
    let mut number = 0..;
    scene.instances.retain(|_| !number.next().is_some_and(|index: usize| emptied.contains(&index)));
    if count > 0 {
        let message = format!("{count} one-sided faces that look down on the ground can't be seen: left out");
        loaded.notes.push(Warning::general(message));
    }
}

/// Numbers of an instance's triangles that are undersides; `None` if there are none.
fn undersides(scene: &Scene, instance: &Instance, offset: DVec3, height: f64) -> Option<HashSet<usize>> {
    let mesh = &scene.meshes[instance.mesh.index()];
    let place = &instance.world_from_object;
    let world = |i: u32| place.transform_point3(DVec3::from(mesh.positions[i as usize].map(f64::from)));
    let is_low: Vec<bool> =
        (0..mesh.positions.len() as u32).map(|i| world(i).y - offset.y <= height).collect();
    let lows = |t: &[u32; 3]| t.iter().filter(|&&i| is_low[i as usize]).count();
    let side = place.matrix3.determinant().signum();
    let mut down: Vec<usize> = Vec::new();
    for part in &mesh.parts {
        let material = &scene.materials[instance.material.unwrap_or(part.material).index()];
        let is_sheet = !material.double_sided && is_opaque(&material.model);
        let first = part.first_triangle as usize;
        let all = first..first + part.triangle_count as usize;
        down.extend(all.filter(|&t| is_sheet && lows(&mesh.triangles[t]) == 3).filter(|&t| {
            let [a, b, c] = mesh.triangles[t].map(world);
            (b - a).cross(c - a).y * side < 0.0
        }));
    }
    if down.is_empty() {
        return None;
    }
    let rising = mesh.triangles.iter().filter(|t| lows(t) == 2).flat_map(|t| edges(mesh, t)).collect();
    let hidden = unattached(mesh, &down, &rising);
    (!hidden.is_empty()).then_some(hidden)
}

/// Does no light pass the surface?
fn is_opaque(model: &Model) -> bool {
    match model.transmission() {
        Transmission::None => true,
        Transmission::Thin | Transmission::Clear(_) => false,
        Transmission::Pbr(pbr) => pbr.transmission.factor <= 0.0 && pbr.diffuse_transmission.is_none(),
    }
}

/// The edges of a triangle; corners at the same place are one.
fn edges(mesh: &Mesh, triangle: &[u32; 3]) -> [Edge; 3] {
    let corner = |i: u32| mesh.positions[i as usize].map(|x| (x + 0.0).to_bits());
    let [a, b, c] = triangle.map(corner);
    [[a, b], [b, c], [c, a]].map(|[a, b]| if a <= b { [a, b] } else { [b, a] })
}

/// The triangles among `down` whose connected sheets share no edge with a triangle that rises.
fn unattached(mesh: &Mesh, down: &[usize], rising: &HashSet<Edge>) -> HashSet<usize> {
    let mut neighbours: HashMap<Edge, Vec<usize>> = HashMap::new();
    for &t in down {
        edges(mesh, &mesh.triangles[t])
            .into_iter()
            .for_each(|edge| neighbours.entry(edge).or_default().push(t));
    }
    let mut attached: HashSet<usize> = HashSet::new();
    let touches = |t: &&usize| edges(mesh, &mesh.triangles[**t]).iter().any(|edge| rising.contains(edge));
    let mut stack: Vec<usize> = down.iter().filter(touches).copied().collect();
    while let Some(t) = stack.pop() {
        if attached.insert(t) {
            let near = edges(mesh, &mesh.triangles[t]);
            stack.extend(
                near.iter().flat_map(|edge| &neighbours[edge]).filter(|other| !attached.contains(other)),
            );
        }
    }
    down.iter().copied().filter(|t| !attached.contains(t)).collect()
}

/// A mesh without some of its triangles.
fn without(mesh: &Mesh, hidden: &HashSet<usize>) -> Mesh {
    let mut rest = Mesh { triangles: Vec::new(), ..mesh.clone() };
    for part in &mut rest.parts {
        let first = part.first_triangle as usize;
        let all = first..first + part.triangle_count as usize;
        part.first_triangle = rest.triangles.len() as u32;
        rest.triangles.extend(all.filter(|t| !hidden.contains(t)).map(|t| mesh.triangles[t]));
        part.triangle_count = rest.triangles.len() as u32 - part.first_triangle;
    }
    rest.parts.retain(|part| part.triangle_count > 0);
    rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::mesh_tools::box_faces;
    use crate::math::DAffine3;
    use crate::scene::{Material, MaterialId, MeshPart};

    /// A scene of one-sided triangles.
    fn loaded(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Loaded {
        let mut loaded = Loaded::default();
        let scene = &mut loaded.scene;
        let model = crate::scene::PbrMaterial::default();
        scene.materials.push(Material { double_sided: false, ..Material::gltf("a", model) });
        let triangle_count = triangles.len() as u32;
        let parts = vec![MeshPart { first_triangle: 0, triangle_count, material: MaterialId(0) }];
        scene.meshes.push(Mesh { positions, triangles, parts, ..Mesh::default() });
        scene.instances.push(Instance::new(MeshId(0), DAffine3::IDENTITY));
        loaded
    }

    #[test]
    fn sheets_that_look_down_go_and_bottoms_of_boxes_stay() {
        let square = || vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0]];
        let (down, up) = ([[0, 1, 2], [0, 2, 3]], [[2, 1, 0], [3, 2, 0]]);
        let mut alone = loaded(square(), down.to_vec());
        leave_out(&mut alone, 1e-4);
        assert!(alone.scene.instances.is_empty() && alone.notes[0].message.starts_with("2 one-sided"));
        // Back to back with one that looks up, which stays.
        let mut sheet = loaded(square(), [down, up].concat());
        leave_out(&mut sheet, 1e-4);
        let shown = &sheet.scene.instances[0].mesh;
        assert_eq!(sheet.scene.meshes[shown.index()].triangles, up);
        assert_eq!(sheet.scene.meshes[0].triangles.len(), 4, "known elsewhere");
        let (mesh, _) = box_faces(DVec3::ZERO, DVec3::ONE).to_mesh("box", DVec3::ZERO);
        let mut closed = loaded(mesh.positions, mesh.triangles);
        leave_out(&mut closed, 1e-4);
        assert_eq!((closed.scene.meshes.len(), closed.notes.len()), (1, 0));
        // High above the ground.
        let mut high = loaded(square(), down.to_vec());
        leave_out(&mut high, -0.5);
        assert_eq!(high.scene.instances.len(), 1);
    }
}
