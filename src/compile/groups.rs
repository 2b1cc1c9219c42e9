//! Which group of lights each light is in.

use super::emitters::Emitters;
use super::geometry::Geometries;
use super::object_materials::ObjectMaterials;
use super::objects::ObjectId;
use crate::scene::{Instance, Scene, group_or_default};

/// The groups of lights by number: their order is that of [`Scene::light_groups`].
#[derive(Clone, Debug, Default)]
pub struct LightGroups {
    /// By light.
    lights: Vec<u16>,
    /// By material: that of what it emits.
    materials: Vec<u16>,
    /// By object, [`NONE`] where its materials decide; those of instances, or none where materials always do.
    objects: Vec<u16>,
}

/// No group.
const NONE: u16 = u16::MAX;

/// Further groups count as the last.
const MOST_GROUPS: usize = NONE as usize - 1;

impl LightGroups {
    /// Those of the lights that were found in a scene; empty where all are in one group.
    pub(super) fn of(
        (scene, numbers): (&Scene, &ObjectMaterials),
        emitters: &Emitters,
        geometries: &Geometries,
    ) -> LightGroups {
        let names = scene.light_groups();
        if names.len() < 2 {
            return LightGroups::default();
        }
        let number = |name: &str| {
            let found = names.binary_search_by(|own| own.as_str().cmp(group_or_default(name)));
            found.unwrap_or(0).min(MOST_GROUPS) as u16
        };
        let materials: Vec<u16> = scene.materials.iter().map(|m| number(&m.light_group)).collect();
        let own = |instance: &Instance| instance.light_group.as_deref().map_or(NONE, number);
        let has_own = scene.instances.iter().any(|instance| instance.light_group.is_some());
        let objects = scene.instances.iter().filter(|_| has_own).map(own);
        let mut groups = LightGroups { lights: Vec::new(), materials, objects: objects.collect() };
        let mut lights = vec![0; emitters.lights.len()];
        for (light, object, material) in emitters.owners(geometries) {
            lights[light] = groups.of_surface(object, numbers.original(material));
        }
        lights.extend(scene.lights.iter().map(|light| number(&light.group)));
        lights.push(number(&scene.environment_group));
        groups.lights = lights;
        groups
    }

    /// The group of a light.
    pub fn of_light(&self, light: u32) -> u16 {
        self.lights.get(light as usize).copied().unwrap_or(0)
    }

    /// The group of what a surface emits.
    pub fn of_surface(&self, object: ObjectId, material: u32) -> u16 {
        let own = self.objects.get(object.0 as usize).copied().filter(|&group| group != NONE);
        own.or_else(|| self.materials.get(material as usize).copied()).unwrap_or(0)
    }
}
