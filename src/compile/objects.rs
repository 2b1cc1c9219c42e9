//! Object ids, the object of each primitive, and the materials of objects.
//!
//! An object with traits (ray visibility, light links, holdout, shadow catcher) gets copies of its materials, which follow the
//! scene's materials in the list of compiled materials.

use super::material::CompiledMaterial;
use crate::math::{DVec3, Vec3};
use crate::scene::{Instance, MaterialId, Mesh, ObjectTraits, Scene};
use crate::texture::ObjectData;
use std::collections::HashMap;

/// Id of a scene's object: instances, then quads, shapes and curves, in the order of their lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ObjectId(pub u32);

/// Assigns ids to the objects of a scene.
#[derive(Clone, Copy, Debug)]
pub struct ObjectIds {
    instances: usize,
    quads: usize,
    shapes: usize,
}

impl ObjectIds {
    pub fn of(scene: &Scene) -> ObjectIds {
        ObjectIds { instances: scene.instances.len(), quads: scene.quads.len(), shapes: scene.shapes.len() }
    }

    pub fn instance(&self, index: usize) -> ObjectId {
        ObjectId(index as u32)
    }

    pub fn quad(&self, index: usize) -> ObjectId {
        ObjectId((self.instances + index) as u32)
    }

    pub fn shape(&self, index: usize) -> ObjectId {
        ObjectId((self.instances + self.quads + index) as u32)
    }

    pub fn curves(&self, index: usize) -> ObjectId {
        ObjectId((self.instances + self.quads + self.shapes + index) as u32)
    }
}

impl ObjectId {
    pub fn all(scene: &Scene) -> impl Iterator<Item = ObjectId> + use<> {
        let count = scene.instances.len() + scene.quads.len() + scene.shapes.len() + scene.curves.len();
        (0..count as u32).map(ObjectId)
    }

    /// The name of the object in its scene; `None` for ids of other scenes.
    pub fn name(self, scene: &Scene) -> Option<&str> {
        let index = self.0 as usize;
        if let Some(instance) = scene.instances.get(index) {
            return Some(&instance.name);
        }
        let index = index - scene.instances.len();
        if let Some(quad) = scene.quads.get(index) {
            return Some(&quad.name);
        }
        let index = index - scene.quads.len();
        if let Some(shape) = scene.shapes.get(index) {
            return Some(&shape.name);
        }
        scene.curves.get(index - scene.shapes.len()).map(|curves| curves.name.as_str())
    }
}

/// The object of each primitive: runs of consecutive primitives with their first primitive, sorted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Owners(Vec<(u32, ObjectId)>);

impl Owners {
    pub const EMPTY: Owners = Owners(Vec::new());

    /// Begins a run of primitives of an object; `first` must not decrease between calls.
    pub fn begin(&mut self, first: usize, object: ObjectId) {
        let first = first as u32;
        match self.0.last_mut() {
            // The previous run is empty.
            Some(last) if last.0 == first => last.1 = object,
            _ => self.0.push((first, object)),
        }
    }

    /// The object of a primitive.
    pub fn of(&self, prim: u32) -> ObjectId {
        let run = self.0.partition_point(|&(first, _)| first <= prim);
        run.checked_sub(1).map_or(ObjectId(u32::MAX), |run| self.0[run].1)
    }

    /// One past the last primitive of the run of a primitive.
    pub fn end_of_run(&self, prim: u32) -> u32 {
        let next = self.0.partition_point(|&(first, _)| first <= prim);
        self.0.get(next).map_or(u32::MAX, |&(first, _)| first)
    }
}

/// Material indices by object. A material is copied once for each combination of traits among the objects that use it.
#[derive(Clone, Debug, Default)]
pub(super) struct ObjectMaterials {
    /// Number of the scene's materials.
    originals: u32,
    /// Indices of the copies.
    copy_indices: HashMap<(MaterialId, ObjectTraits), u32>,
    /// Materials and traits of the copies, by index after the scene's materials.
    copies: Vec<(MaterialId, ObjectTraits)>,
    /// Index of the mix of each component; components follow the copies.
    components: Vec<u32>,
}

impl ObjectMaterials {
    pub fn of(scene: &Scene) -> ObjectMaterials {
        let originals = scene.materials.len() as u32;
        let mut all = ObjectMaterials { originals, ..ObjectMaterials::default() };
        for instance in &scene.instances {
            if instance.traits != ObjectTraits::default() {
                let used = part_materials(&scene.meshes[instance.mesh.index()], instance);
                used.for_each(|id| all.add(id, &instance.traits));
            }
        }
        scene.quads.iter().for_each(|quad| all.add(quad.material, &quad.traits));
        scene.shapes.iter().for_each(|shape| all.add(shape.material, &shape.traits));
        scene.curves.iter().for_each(|curves| all.add(curves.material, &curves.traits));
        all
    }

    fn add(&mut self, id: MaterialId, traits: &ObjectTraits) {
        if *traits != ObjectTraits::default() {
            self.copy_indices.entry((id, *traits)).or_insert_with(|| {
                self.copies.push((id, *traits));
                self.originals + self.copies.len() as u32 - 1
            });
        }
    }

    /// The compiled material's index for a material on an object with traits.
    pub fn index_of(&self, id: MaterialId, traits: &ObjectTraits) -> u32 {
        match self.has_no_copies() {
            true => id.0,
            false => self.copy_indices.get(&(id, *traits)).copied().unwrap_or(id.0),
        }
    }

    pub fn has_no_copies(&self) -> bool {
        self.copies.is_empty()
    }

    /// Appends the copies to a scene's compiled materials, then the components of mixes.
    pub fn extend(&mut self, materials: &mut Vec<CompiledMaterial>) {
        materials.reserve_exact(self.copies.len());
        for (id, traits) in &self.copies {
            let copy = materials[id.index()].with_traits(traits);
            materials.push(copy);
        }
        for mix in 0..materials.len() {
            let first = materials.len();
            let components = materials[mix].take_components(first);
            self.components.extend(std::iter::repeat_n(mix as u32, components.len()));
            materials.extend(components);
        }
    }

    /// The scene's material of a copy; others unchanged.
    pub fn original(&self, index: u32) -> u32 {
        let copy = index.checked_sub(self.originals).and_then(|copy| self.copies.get(copy as usize));
        copy.map_or(index, |(id, _)| id.0)
    }

    /// For each material after those of the scene: the material that it is a copy or component of.
    pub fn sources(&self) -> Vec<MaterialId> {
        let components = self.components.iter().map(|&mix| MaterialId(self.original(mix)));
        self.copies.iter().map(|&(id, _)| id).chain(components).collect()
    }
}

/// The materials of an instance's parts.
pub(super) fn part_materials<'a>(
    mesh: &'a Mesh,
    instance: &'a Instance,
) -> impl Iterator<Item = MaterialId> + Clone + 'a {
    mesh.parts.iter().map(|part| instance.material.unwrap_or(part.material))
}

/// The material of a mesh, if all parts have the same.
pub(super) fn only_material(mesh: &Mesh) -> Option<MaterialId> {
    let (first, rest) = mesh.parts.split_first()?;
    rest.iter().all(|part| part.material == first.material).then_some(first.material)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_found_by_any_of_their_primitives() {
        let mut owners = Owners::default();
        for (first, object) in [(0, 5), (10, 6), (10, 7), (12, 2)] {
            owners.begin(first, ObjectId(object));
        }
        let found = [0, 9, 10, 11, 12, 1_000_000].map(|prim| owners.of(prim).0);
        assert_eq!(found, [5, 5, 7, 7, 2, 2]);
        assert_eq!([0, 9, 10, 12].map(|prim| owners.end_of_run(prim)), [10, 10, 12, u32::MAX]);
        assert_eq!(Owners::default().of(3), ObjectId(u32::MAX));
    }
}

#[cfg(test)]
mod object_materials_tests {
    use super::*;
    use crate::scene::{ObjectSet, ObjectSets, Shape};

    /// Copies exist only for combinations of material and traits that objects have.
    #[test]
    fn materials_are_copied_for_used_traits_only() {
        let mut scene = Scene::default();
        for name in 0..100 {
            scene.add_material(crate::scene::Material::lambert(name.to_string(), [0.5; 3]));
        }
        let traits = |number: usize| {
            let sets = (0..7).filter(|bit| number >> bit & 1 != 0).filter_map(ObjectSet::new);
            ObjectTraits { sets: sets.fold(ObjectSets::NONE, ObjectSets::with), ..ObjectTraits::default() }
        };
        for i in 0..200 {
            let sphere = Shape::sphere([0.0; 3], 1.0, MaterialId(i % 100));
            scene.shapes.push(Shape { traits: traits(i as usize % 100), ..sphere });
        }
        let object_materials = ObjectMaterials::of(&scene);
        // The first has no traits; all others occur twice.
        assert_eq!(object_materials.copies.len(), 99);
        let copy_of = |i: usize| object_materials.index_of(MaterialId(i as u32), &traits(i));
        assert_eq!([0, 1, 2, 99].map(copy_of), [0, 100, 101, 198]);
        // No object has this one.
        assert_eq!(object_materials.index_of(MaterialId(5), &traits(6)), 5);
        assert_eq!(object_materials.sources()[98], MaterialId(99));
    }
}

/// Data of all objects for node graphs, by id, relative to the anchor; empty if no node graph reads them.
pub(super) fn of(scene: &Scene, materials: &[CompiledMaterial], anchor: DVec3) -> Vec<ObjectData> {
    if !materials.iter().any(|material| material.reads_hit) {
        return Vec::new();
    }
    let boxes: Vec<[Vec3; 2]> = scene.meshes.iter().map(ObjectData::bounds_of_mesh).collect();
    let of_instance =
        |instance: &Instance| ObjectData::of_instance(instance, boxes[instance.mesh.index()], anchor);
    let instances = scene.instances.iter().map(of_instance);
    let quads = scene.quads.iter().map(|quad| ObjectData::of_quad(quad, anchor));
    let shapes = scene.shapes.iter().map(|shape| ObjectData::of_shape(shape, anchor));
    let curves = scene.curves.iter().map(|curves| ObjectData::of_curves(curves, anchor));
    instances.chain(quads).chain(shapes).chain(curves).collect()
}
