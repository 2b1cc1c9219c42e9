//! Numbers of compiled materials: objects with traits have copies of their materials, behind those of the scene.

use super::emitters::Emitters;
use super::geometry::Geometries;
use super::material::CompiledMaterial;
use crate::light::Lights;
use crate::scene::{Instance, MaterialId, Mesh, ObjectTraits, RayKinds, Scene};
use std::collections::HashMap;

/// The number of each material of each object. A copy is made of a material for the traits of an object that has it, and for no
/// other traits: there are never more copies than objects with materials.
#[derive(Clone, Debug, Default)]
pub(super) struct ObjectMaterials {
    /// Materials of the scene.
    own: u32,
    /// The numbers of the copies.
    numbers: HashMap<(MaterialId, ObjectTraits), u32>,
    /// What they are copies of, in the order of their numbers.
    copies: Vec<(MaterialId, ObjectTraits)>,
}

impl ObjectMaterials {
    /// Those of a scene.
    pub fn of(scene: &Scene) -> ObjectMaterials {
        let own = scene.materials.len() as u32;
        let mut all = ObjectMaterials { own, ..ObjectMaterials::default() };
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
            self.numbers.entry((id, *traits)).or_insert_with(|| {
                self.copies.push((id, *traits));
                self.own + self.copies.len() as u32 - 1
            });
        }
    }

    /// The number that a material has on an object with such traits.
    pub fn number(&self, id: MaterialId, traits: &ObjectTraits) -> u32 {
        match self.are_own() {
            true => id.0,
            false => self.numbers.get(&(id, *traits)).copied().unwrap_or(id.0),
        }
    }

    /// Has every object the materials of the scene themselves?
    pub fn are_own(&self) -> bool {
        self.copies.is_empty()
    }

    /// Adds the copies to a scene's materials.
    pub fn extend(&self, materials: &mut Vec<CompiledMaterial>) {
        materials.reserve_exact(self.copies.len());
        for (id, traits) in &self.copies {
            let copy = materials[id.index()].with_traits(traits);
            materials.push(copy);
        }
    }

    /// The material of the scene of a number.
    pub fn original(&self, number: u32) -> u32 {
        let copy = number.checked_sub(self.own).and_then(|copy| self.copies.get(copy as usize));
        copy.map_or(number, |(id, _)| id.0)
    }

    /// By copy: which material of the scene it is of.
    pub fn originals(&self) -> Vec<MaterialId> {
        self.copies.iter().map(|&(id, _)| id).collect()
    }
}

/// The materials of the parts of a placed mesh.
pub(super) fn part_materials<'a>(
    mesh: &'a Mesh,
    instance: &'a Instance,
) -> impl Iterator<Item = MaterialId> + 'a {
    mesh.parts.iter().map(|part| instance.material.unwrap_or(part.material))
}

/// The one material of all parts of a mesh.
pub(super) fn only_material(mesh: &Mesh) -> Option<MaterialId> {
    let (first, rest) = mesh.parts.split_first()?;
    rest.iter().all(|part| part.material == first.material).then_some(first.material)
}

/// What each light lights, by number; empty where all light everything.
pub(super) fn light_kinds(
    scene: &Scene,
    lights: &Lights,
    (emitters, geometries, materials): (&Emitters, &Geometries, &[CompiledMaterial]),
) -> Vec<RayKinds> {
    let mut kinds = vec![RayKinds::ALL; lights.area().len()];
    for (light, _, material) in emitters.owners(geometries) {
        kinds[light] = materials[material as usize].visible_to();
    }
    kinds.extend(scene.lights.iter().map(|light| light.visible_to));
    if lights.environment().is_some() {
        kinds.push(scene.environment_visible_to);
    }
    if kinds.iter().all(|&kinds| lights_all(kinds)) { Vec::new() } else { kinds }
}

/// By light with a surface: is it part of an object that is left out where its effect on shadow catchers is told? Empty
/// without catchers.
pub(super) fn caught_lights(
    emitters: &Emitters,
    geometries: &Geometries,
    materials: &[CompiledMaterial],
) -> Vec<bool> {
    if !materials.iter().any(|m| m.presence.is_some_and(|p| p.is_catcher)) {
        return Vec::new();
    }
    let mut caught = vec![false; emitters.lights.len()];
    for (light, _, material) in emitters.owners(geometries) {
        caught[light] = materials[material as usize].is_of_caught_object();
    }
    caught
}

/// Do all kinds of rays that lights are sampled for see what these see?
pub(super) fn lights_all(kinds: RayKinds) -> bool {
    kinds.contains(RayKinds::ALL.without(RayKinds::CAMERA).without(RayKinds::SHADOW))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{ObjectSet, ObjectSets, Shape};

    /// Many materials and many combinations of traits: as many copies as objects have, not all combinations.
    #[test]
    fn materials_are_copied_for_the_traits_of_their_objects_only() {
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
        let numbers = ObjectMaterials::of(&scene);
        // The first has no traits; each later one appears twice.
        assert_eq!(numbers.copies.len(), 99);
        let of = |i: usize| numbers.number(MaterialId(i as u32), &traits(i));
        assert_eq!([0, 1, 2, 99].map(of), [0, 100, 101, 198]);
        // No object has this one.
        assert_eq!(numbers.number(MaterialId(5), &traits(6)), 5);
        assert_eq!(numbers.originals()[98], MaterialId(99));
    }
}
