//! Closed meshes of solids whose fronts are where their backs should be: they are taken as turned around.
//!
//! Which side of a surface is inside decides what light is refracted by. A closed mesh tells it by its volume, the sum of the
//! tetrahedra between its triangles and a point (Zhang, Chen 2001, "Efficient Feature Extraction for 2D/3D Objects in Mesh
//! Representation", section 2): negative, its triangles run clockwise. But a mesh of this kind within a body of the same
//! material is a hole in it, as meant.

use super::boxes::{Bounds, BoxTree, NumberedBox};
use super::material::CompiledMaterial;
use super::object_materials::part_materials;
use super::winding::Winding;
use crate::error::{Warning, listed};
use crate::math::DVec3;
use crate::scene::{Instance, MaterialId, Mesh, Scene, Shape, instance_extents, is_closed};
use rayon::prelude::*;
use std::sync::OnceLock;

/// By mesh: is it inside out? Empty where none is.
pub(super) fn find(scene: &Scene, materials: &[CompiledMaterial], warnings: &mut Vec<Warning>) -> Vec<bool> {
    let is_solid = |id: MaterialId| materials[id.index()].medium_index != 0;
    if !materials.iter().any(|m| m.medium_index != 0) {
        return Vec::new();
    }
    let mut placed: Vec<Vec<usize>> = vec![Vec::new(); scene.meshes.len()];
    for (number, instance) in scene.instances.iter().enumerate() {
        placed[instance.mesh.index()].push(number);
    }
    let is_whole = |&i: &usize| part_materials_of(scene, &scene.instances[i]).all(is_solid);
    let is_suspect = |&index: &usize| {
        let mesh = &scene.meshes[index];
        let is_used = !placed[index].is_empty() && placed[index].iter().all(is_whole);
        is_used && volume(mesh) < 0.0 && is_closed(mesh)
    };
    let suspects: Vec<usize> = (0..scene.meshes.len()).into_par_iter().filter(is_suspect).collect();
    if suspects.is_empty() {
        return Vec::new();
    }
    let bodies = Bodies::of(scene);
    let is_inside_out = |&index: &usize| !placed[index].iter().any(|&i| bodies.have_hole(i));
    let found: Vec<usize> = suspects.into_par_iter().filter(is_inside_out).collect();
    let names: Vec<&str> = found.iter().map(|&index| scene.meshes[index].name.as_str()).collect();
    warnings.extend(warning(&names));
    let mut by_mesh = vec![false; if found.is_empty() { 0 } else { scene.meshes.len() }];
    found.into_iter().for_each(|index| by_mesh[index] = true);
    by_mesh
}

fn warning(names: &[&str]) -> Option<Warning> {
    let message = match names {
        [] => return None,
        [name] => format!(
            "the normals of mesh '{name}' point inwards: it is closed and lets light pass, and is taken as turned around; turn \
             its faces in the file"
        ),
        _ => format!(
            "the normals of {} meshes point inwards ({}): they are closed and let light pass, and are taken as turned around; turn \
             their faces in the file",
            names.len(),
            listed(names)
        ),
    };
    Some(Warning::general(message))
}

fn part_materials_of<'a>(scene: &'a Scene, instance: &'a Instance) -> impl Iterator<Item = MaterialId> + 'a {
    part_materials(&scene.meshes[instance.mesh.index()], instance)
}

/// Six times the volume within a mesh; negative where its triangles run clockwise seen from outside.
fn volume(mesh: &Mesh) -> f64 {
    let corner = |i: u32| DVec3::from_array(mesh.positions[i as usize].map(f64::from));
    // From a point of the mesh: far from the origin sums cancel.
    let Some(first) = mesh.triangles.first().map(|t| corner(t[0])) else { return 0.0 };
    let of_triangle = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| corner(i) - first);
        a.dot(b.cross(c))
    };
    mesh.triangles.iter().map(of_triangle).sum()
}

/// The bodies that others may be holes in: instances, then closed shapes.
struct Bodies<'a> {
    scene: &'a Scene,
    boxes: Vec<NumberedBox>,
    tree: BoxTree,
    /// Of instances that something was asked about.
    windings: Vec<OnceLock<Winding>>,
}

impl Bodies<'_> {
    fn of(scene: &Scene) -> Bodies<'_> {
        let extents = instance_extents(scene).into_iter().map(|extent| extent.0);
        let of_instances = extents.map(|extent| extent.map(|(low, high)| Bounds { low, high }));
        let of_shape = |shape: &Shape| {
            let point = Bounds { low: shape.center, high: shape.center };
            shape.kind.tag().is_closed().then(|| point.widened(shape.radius))
        };
        let all = of_instances.chain(scene.shapes.iter().map(of_shape));
        let numbered = |(number, bounds): (usize, Option<Bounds>)| {
            Some(NumberedBox { bounds: bounds?, number: number as u32 })
        };
        let mut boxes: Vec<NumberedBox> = all.enumerate().filter_map(numbered).collect();
        let tree = BoxTree::sort(&mut boxes);
        let windings = scene.instances.iter().map(|_| OnceLock::new()).collect();
        Bodies { scene, boxes, tree, windings }
    }

    /// Does an instance lie within another body that has one of its materials?
    fn have_hole(&self, number: usize) -> bool {
        /// Points of it that are asked.
        const POINTS: usize = 16;
        let instance = &self.scene.instances[number];
        let mesh = &self.scene.meshes[instance.mesh.index()];
        let step = mesh.triangles.len().div_ceil(POINTS).max(1);
        let points = mesh.triangles.iter().step_by(step).map(|t| {
            let p = mesh.positions[t[0] as usize];
            instance.world_from_object.transform_point3(p.map(f64::from).into())
        });
        let points: Vec<DVec3> = points.collect();
        let mut own: Vec<MaterialId> = part_materials(mesh, instance).collect();
        own.sort_unstable();
        let around = Bounds::of(points.iter().copied());
        self.tree.any(&around, |place| {
            let body = &self.boxes[place];
            body.number as usize != number
                && body.bounds.holds(&around)
                && self.is_around(body.number as usize, &points, &own)
        })
    }

    /// Does a body with one of some materials, in order, lie around points?
    fn is_around(&self, number: usize, points: &[DVec3], own: &[MaterialId]) -> bool {
        let has_material = |id: MaterialId| own.binary_search(&id).is_ok();
        let Some(body) = self.scene.instances.get(number) else {
            let shape = &self.scene.shapes[number - self.scene.instances.len()];
            return has_material(shape.material)
                && points.iter().all(|p| p.distance(shape.center) < shape.radius);
        };
        if !part_materials_of(self.scene, body).any(has_material) {
            return false;
        }
        let mesh = &self.scene.meshes[body.mesh.index()];
        let winding = self.windings[number].get_or_init(|| Winding::of(mesh, &body.world_from_object));
        points.iter().all(|&p| winding.is_around(p))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DAffine3;
    use crate::scene::{Material, MeshId, MeshPart};

    /// A tetrahedron of a size whose faces point inwards.
    fn inverted(name: usize, size: f32) -> Mesh {
        let part = MeshPart { first_triangle: 0, triangle_count: 4, material: MaterialId(0) };
        Mesh {
            name: name.to_string(),
            positions: [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
                .map(|p| p.map(|x| x * size))
                .to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]],
            parts: vec![part],
            ..Mesh::default()
        }
    }

    fn scene(places: &[([f64; 3], f32)]) -> Scene {
        let mut scene = Scene::default();
        scene.add_material(Material::lambert("glass", [0.5; 3]));
        for (k, (place, size)) in places.iter().enumerate() {
            scene.meshes.push(inverted(k, *size));
            let at = DAffine3::from_translation(DVec3::from(*place));
            scene.instances.push(Instance::new(MeshId(k as u32), at));
        }
        scene
    }

    /// The triangles of no body are looked at where none lies in another's box.
    #[test]
    fn bodies_apart_are_told_by_their_boxes() {
        let places: Vec<([f64; 3], f32)> = (0..1000).map(|k| ([f64::from(k) * 2.0, 0.0, 0.0], 1.0)).collect();
        let scene = scene(&places);
        let bodies = Bodies::of(&scene);
        assert!((0..1000).all(|i| !bodies.have_hole(i)));
        assert!(bodies.windings.iter().all(|winding| winding.get().is_none()));
        assert!(volume(&scene.meshes[0]) < 0.0 && is_closed(&scene.meshes[0]));
    }

    #[test]
    fn holes_lie_in_bodies_of_their_material() {
        let places = [([0.0; 3], 10.0), ([1.0; 3], 0.5), ([1.0, 5.0, 5.0], 0.5), ([-1.0; 3], 0.5)];
        let mut scene = scene(&places);
        let holes = |scene: &Scene| [0, 1, 2, 3].map(|i| Bodies::of(scene).have_hole(i));
        // The third lies in the box of the first, not within it.
        assert_eq!(holes(&scene), [false, true, false, false]);
        scene.instances[1].material = Some(MaterialId(1));
        assert_eq!(holes(&scene), [false; 4]);
        scene.shapes.push(Shape::sphere([-1.0; 3], 2.0, MaterialId(0)));
        assert_eq!(holes(&scene), [false, false, false, true]);
    }

    #[test]
    fn many_meshes_are_one_warning() {
        assert!(warning(&[]).is_none());
        let said = |names: &[&str]| warning(names).expect("one").message;
        assert!(said(&["a"]).starts_with("the normals of mesh 'a' point inwards: it is closed"));
        let many = said(&["a", "b", "c", "d", "e"]);
        assert!(
            many.starts_with("the normals of 5 meshes point inwards ('a', 'b', 'c' and 2 more): they"),
            "{many}"
        );
    }
}
