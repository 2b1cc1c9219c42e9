//! Which lights light which objects, and which objects cast shadows in their light.

use super::emitters::Emitters;
use super::geometry::Geometries;
use super::material::CompiledMaterial;
use crate::error::Problem;
use crate::light::Lights;
use crate::scene::{LightLinks, ObjectSets, Scene};
use std::collections::HashMap;

/// So many classes of receivers can be told apart.
pub const MOST_CLASSES: usize = 1 << 15;

/// What lights are linked to; nothing is kept where all are linked to all.
#[derive(Clone, Debug, Default)]
pub struct Links {
    /// By light.
    of_lights: Vec<LightLinks>,
    /// Classes of receivers, by the sets that they are in; that of media, and of objects in no set, is the first.
    classes: Vec<ObjectSets>,
    /// By material, with the copies that objects have for themselves.
    class_of_material: Vec<u32>,
}

impl Links {
    /// Those of a scene.
    pub(super) fn of(
        scene: &Scene,
        lights: &Lights,
        (emitters, geometries, materials): (&Emitters, &Geometries, &[CompiledMaterial]),
    ) -> Links {
        let mut of_lights = vec![LightLinks::ALL; lights.area().len()];
        if materials.iter().any(|m| m.links() != LightLinks::ALL) {
            for (light, _, material) in emitters.owners(geometries) {
                of_lights[light] = materials[material as usize].links();
            }
        }
        of_lights.extend(scene.lights.iter().map(|light| light.links));
        of_lights.extend(lights.environment().map(|_| LightLinks::ALL));
        // Emission that light samples do not know is linked, too.
        let is_linked = |links: &LightLinks| *links != LightLinks::ALL;
        if !of_lights.iter().any(is_linked) && !materials.iter().any(|m| is_linked(&m.links())) {
            return Links::default();
        }
        let mut classes = vec![ObjectSets::NONE];
        let mut known = HashMap::from([(ObjectSets::NONE, 0)]);
        let mut class_of = |sets: ObjectSets| {
            *known.entry(sets).or_insert_with(|| {
                classes.push(sets);
                classes.len() as u32 - 1
            })
        };
        let class_of_material = materials.iter().map(|material| class_of(material.sets())).collect();
        Links { of_lights, classes, class_of_material }
    }

    /// More classes than can be told apart.
    pub(super) fn problems(&self) -> Vec<Problem> {
        let count = self.classes.len();
        let message =
            format!("objects are in {count} combinations of sets of links, of {MOST_CLASSES} possible");
        if count > MOST_CLASSES { vec![Problem::new("", message)] } else { Vec::new() }
    }

    /// Is any light linked to some objects only?
    pub fn are_used(&self) -> bool {
        !self.classes.is_empty()
    }

    /// How many classes of receivers there are.
    pub fn classes(&self) -> usize {
        self.classes.len()
    }

    /// The class of the objects that have a material.
    #[inline]
    pub fn class_of(&self, material: u32) -> u32 {
        self.class_of_material.get(material as usize).copied().unwrap_or(0)
    }

    /// The links of a light.
    #[inline]
    pub fn of_light(&self, index: u32) -> LightLinks {
        self.of_lights.get(index as usize).copied().unwrap_or_default()
    }

    /// Do such links let light reach receivers of a class?
    #[inline]
    pub fn reach(&self, links: LightLinks, class: u32) -> bool {
        links.receivers.is_all() || links.receivers.holds(self.classes[class as usize])
    }

    /// Do objects with a material cast shadows in the light of such links?
    #[inline]
    pub fn block(&self, links: LightLinks, material: u32) -> bool {
        links.blockers.is_all() || links.blockers.holds(self.classes[self.class_of(material) as usize])
    }
}
