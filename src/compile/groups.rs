//! Which group of lights each light is in.

use super::emitters::Emitters;
use super::geometry::Geometries;
use crate::scene::{Scene, group_or_default};

/// The groups of lights by number: their order is that of [`Scene::light_groups`].
#[derive(Clone, Debug, Default)]
pub struct LightGroups {
    /// By light.
    lights: Vec<u16>,
    /// By material: that of what it emits.
    materials: Vec<u16>,
}

/// Further groups count as the last.
pub(super) const MOST_GROUPS: usize = u16::MAX as usize;

impl LightGroups {
    /// Those of the lights that were found in a scene; empty where all are in one group.
    pub(super) fn of(scene: &Scene, emitters: &Emitters, geometries: &Geometries) -> LightGroups {
        let names = scene.light_groups();
        if names.len() < 2 {
            return LightGroups::default();
        }
        let number = |name: &str| {
            let found = names.binary_search_by(|own| own.as_str().cmp(group_or_default(name)));
            found.unwrap_or(0).min(MOST_GROUPS) as u16
        };
        let materials: Vec<u16> = scene.materials.iter().map(|m| number(&m.light_group)).collect();
        let mut lights = vec![0; emitters.lights.len()];
        for &(prim, light) in &emitters.light_of_primitive {
            let material = geometries.world.attributes.materials[prim as usize];
            lights[light as usize] = materials[material as usize];
        }
        lights.extend(scene.lights.iter().map(|light| number(&light.group)));
        lights.push(number(&scene.environment_group));
        LightGroups { lights, materials }
    }

    /// The group of a light.
    pub fn of_light(&self, light: u32) -> u16 {
        self.lights.get(light as usize).copied().unwrap_or(0)
    }

    /// The group of what a material emits.
    pub fn of_material(&self, material: u32) -> u16 {
        self.materials.get(material as usize).copied().unwrap_or(0)
    }
}
