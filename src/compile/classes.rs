//! Objects that are special to rays: they have the materials of others, but their own copies of them.

use super::material::CompiledMaterial;
use crate::light::Lights;
use crate::scene::{MaterialId, ObjectTraits, RayKinds, Scene};
use std::collections::HashMap;

use super::emitters::Emitters;
use super::geometry::Geometries;

/// What is added to the number of a material for the copy that objects of a class have; 0 for most objects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Class(pub u32);

impl Class {
    /// The number of a material of objects of the class.
    pub fn material(self, id: MaterialId) -> u32 {
        id.0 + self.0
    }
}

/// Objects by their traits. Each class has its copy of all materials, behind those of the scene.
#[derive(Clone, Debug, Default)]
pub(super) struct Classes {
    of_traits: HashMap<ObjectTraits, Class>,
    /// In the order of their copies.
    traits: Vec<ObjectTraits>,
}

impl Classes {
    /// Those of a scene.
    pub fn of(scene: &Scene) -> Classes {
        let mut classes = Classes::default();
        for traits in scene.object_traits().filter(|t| **t != ObjectTraits::default()) {
            classes.of_traits.entry(*traits).or_insert_with(|| {
                classes.traits.push(*traits);
                Class((classes.traits.len() * scene.materials.len()) as u32)
            });
        }
        classes
    }

    /// The class of the objects with such traits.
    pub fn of_object(&self, traits: &ObjectTraits) -> Class {
        match self.traits.is_empty() {
            true => Class::default(),
            false => self.of_traits.get(traits).copied().unwrap_or_default(),
        }
    }

    /// Adds the copies to a scene's materials.
    pub fn extend(&self, materials: &mut Vec<CompiledMaterial>) {
        let own = materials.len();
        for traits in &self.traits {
            for i in 0..own {
                let copy = materials[i].with_traits(traits);
                materials.push(copy);
            }
        }
    }
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
    use crate::scene::Shape;

    #[test]
    fn objects_with_the_same_traits_share_copies() {
        let mut scene = Scene::default();
        for name in ["a", "b"] {
            scene.add_material(crate::scene::Material::lambert(name, [0.5; 3]));
        }
        let unseen =
            ObjectTraits { visible_to: RayKinds::ALL.without(RayKinds::CAMERA), ..ObjectTraits::default() };
        let cut = ObjectTraits { is_holdout: true, ..unseen };
        let all = [unseen, cut, unseen, ObjectTraits::default()];
        for traits in all {
            let sphere = Shape::sphere([0.0; 3], 1.0, MaterialId(1));
            scene.shapes.push(Shape { traits, ..sphere });
        }
        let classes = Classes::of(&scene);
        assert_eq!(all.map(|traits| classes.of_object(&traits).material(MaterialId(1))), [3, 5, 3, 1]);
    }
}
