//! Tables indexed by light: light groups, light links, ray visibility and spectra. Lights are numbered as in [`Lights`]: area lights,
//! lights without a surface, emissive media, the environment.

use super::emitters::Emitters;
use super::geometry::Geometries;
use super::material::CompiledMaterial;
use super::objects::{ObjectId, ObjectMaterials};
use crate::color::Rgb;
use crate::color::spectral::Spectrum;
use crate::error::Problem;
use crate::light::Lights;
use crate::scene::{
    Environment, Instance, LightLinks, ObjectSets, RayKinds, Scene, ShadingModel, group_or_default,
};
use std::collections::HashMap;
use std::sync::Arc;

/// All tables indexed by light.
pub(super) struct LightTables {
    pub groups: LightGroups,
    pub links: Links,
    /// Spectra in spectral rendering, else empty; `None` for white and textured lights.
    pub spectra: Vec<Option<Arc<Spectrum>>>,
    /// Empty if every light is visible to all kinds of rays.
    pub ray_kinds: Vec<RayKinds>,
    /// By area light: does its object cast shadows on catchers? Empty without catchers.
    pub caster_lights: Vec<bool>,
}

impl LightTables {
    /// The tables of a scene's lights.
    pub fn new(
        (scene, object_materials, shading): (&Scene, &ObjectMaterials, ShadingModel),
        lights: &Lights,
        surfaces: (&Emitters, &Geometries, &[CompiledMaterial]),
    ) -> LightTables {
        let (emitters, geometries, materials) = surfaces;
        LightTables {
            groups: LightGroups::of((scene, object_materials), lights, (emitters, geometries)),
            links: Links::of(scene, lights, surfaces),
            spectra: spectra((scene, shading), lights, surfaces),
            ray_kinds: ray_kinds(scene, lights, surfaces),
            caster_lights: caster_lights(emitters, geometries, materials),
        }
    }
}

/// Light groups, as indices into [`Scene::light_groups`].
#[derive(Clone, Debug, Default)]
pub struct LightGroups {
    lights: Vec<u16>,
    /// By material: the light group of its emission.
    materials: Vec<u16>,
    /// By instance, [`NONE`] if its materials decide; empty if materials always do.
    objects: Vec<u16>,
}

/// Marks objects without a light group.
const NONE: u16 = u16::MAX;

/// The light group of the emission of media.
const MEDIA: u16 = 0;

/// Maximum index of a group; further groups are merged into it.
const MAX_GROUPS: usize = NONE as usize - 1;

impl LightGroups {
    /// The groups of a scene's lights; empty if there is only one group.
    pub(super) fn of(
        (scene, object_materials): (&Scene, &ObjectMaterials),
        all: &Lights,
        (emitters, geometries): (&Emitters, &Geometries),
    ) -> LightGroups {
        let names = scene.light_groups();
        if names.len() < 2 {
            return LightGroups::default();
        }
        let number = |name: &str| {
            let found = names.binary_search_by(|group| group.as_str().cmp(group_or_default(name)));
            found.unwrap_or(0).min(MAX_GROUPS) as u16
        };
        let materials: Vec<u16> = scene.materials.iter().map(|m| number(&m.light_group)).collect();
        let group_of = |instance: &Instance| instance.light_group.as_deref().map_or(NONE, number);
        let has_own = scene.instances.iter().any(|instance| instance.light_group.is_some());
        let objects = scene.instances.iter().filter(|_| has_own).map(group_of);
        let mut groups = LightGroups { lights: Vec::new(), materials, objects: objects.collect() };
        let mut lights = vec![0; emitters.lights.len()];
        for (light, object, material) in emitters.owners(geometries) {
            lights[light] = groups.of_surface(object, object_materials.original(material));
        }
        lights.extend(scene.lights.iter().map(|light| number(&light.group)));
        lights.extend(all.volumes().iter().map(|_| MEDIA));
        lights.push(number(&scene.environment_group));
        groups.lights = lights;
        groups
    }

    /// The group of a light.
    pub fn of_light(&self, light: u32) -> u16 {
        self.lights.get(light as usize).copied().unwrap_or(0)
    }

    /// The light group of the emission of a surface.
    pub fn of_surface(&self, object: ObjectId, material: u32) -> u16 {
        let own_group = self.objects.get(object.0 as usize).copied().filter(|&group| group != NONE);
        own_group.or_else(|| self.materials.get(material as usize).copied()).unwrap_or(0)
    }
}

/// Maximum number of classes of receivers.
pub const MAX_RECEIVER_CLASSES: usize = 1 << 15;

/// Light linking and shadow linking by light; empty if every light is linked to every object.
#[derive(Clone, Debug, Default)]
pub struct Links {
    of_lights: Vec<LightLinks>,
    /// Classes of receivers: the combinations of object sets. The first class is that of media and of objects in no set.
    classes: Vec<ObjectSets>,
    /// By compiled material, including copies for single objects.
    class_of_material: Vec<u32>,
}

impl Links {
    /// The light links of a scene.
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
        of_lights.extend(lights.volumes().iter().map(|_| LightLinks::ALL));
        of_lights.extend(lights.environment().map(|_| LightLinks::ALL));
        // Materials are tested too: emission without light sampling may be linked.
        let is_linked = |links: &LightLinks| *links != LightLinks::ALL;
        if !of_lights.iter().any(is_linked) && !materials.iter().any(|m| is_linked(&m.links())) {
            return Links::default();
        }
        let mut classes = vec![ObjectSets::NONE];
        let mut class_of_sets = HashMap::from([(ObjectSets::NONE, 0)]);
        let mut class_of = |sets: ObjectSets| {
            *class_of_sets.entry(sets).or_insert_with(|| {
                classes.push(sets);
                classes.len() as u32 - 1
            })
        };
        let class_of_material = materials.iter().map(|material| class_of(material.sets())).collect();
        Links { of_lights, classes, class_of_material }
    }

    /// The problem of too many classes.
    pub(super) fn problems(&self) -> Vec<Problem> {
        let count = self.classes.len();
        let message = format!(
            "objects have {count} combinations of light link sets; at most {MAX_RECEIVER_CLASSES} are possible"
        );
        if count > MAX_RECEIVER_CLASSES { vec![Problem::new("", message)] } else { Vec::new() }
    }

    /// Is any light linked to some objects only?
    pub fn are_used(&self) -> bool {
        !self.classes.is_empty()
    }

    /// Number of classes of receivers.
    pub fn classes(&self) -> usize {
        self.classes.len()
    }

    /// The class of the objects with a compiled material.
    #[inline]
    pub fn class_of(&self, material: u32) -> u32 {
        self.class_of_material.get(material as usize).copied().unwrap_or(0)
    }

    #[inline]
    pub fn of_light(&self, index: u32) -> LightLinks {
        self.of_lights.get(index as usize).copied().unwrap_or_default()
    }

    /// Do all objects let the rays of a light pass, so that it casts no shadows?
    #[inline]
    pub fn is_unblocked(&self, index: u32) -> bool {
        let blockers = self.of_light(index).blockers;
        !blockers.is_all() && !self.classes.iter().any(|&class| blockers.includes(class))
    }

    /// Does a light with these links illuminate receivers of a class?
    #[inline]
    pub fn reach(&self, links: LightLinks, class: u32) -> bool {
        links.receivers.is_all() || links.receivers.includes(self.classes[class as usize])
    }

    /// Do objects with a material cast shadows for a light with these links?
    #[inline]
    pub fn block(&self, links: LightLinks, material: u32) -> bool {
        links.blockers.is_all() || links.blockers.includes(self.classes[self.class_of(material) as usize])
    }
}

/// The spectra of uniform coloured lights, by light; empty unless the renderer is spectral.
fn spectra(
    (scene, shading): (&Scene, ShadingModel),
    lights: &Lights,
    (emitters, geometries, materials): (&Emitters, &Geometries, &[CompiledMaterial]),
) -> Vec<Option<Arc<Spectrum>>> {
    if !shading.spectral {
        return Vec::new();
    }
    let of_color = |rgb: [f32; 3]| match Spectrum::of_light(Rgb::from_array(rgb)) {
        Spectrum::Grey(_) => None,
        spectrum => Some(Arc::new(spectrum)),
    };
    let mut spectra = vec![None; emitters.lights.len()];
    for (light, _, material) in emitters.owners(geometries) {
        spectra[light].clone_from(&materials[material as usize].light_spectrum);
    }
    spectra.extend(scene.lights.iter().map(|light| of_color(light.intensity)));
    spectra.extend(lights.volumes().iter().map(|_| None));
    // The environment is the last light.
    spectra.extend(match scene.environment {
        Environment::Constant(rgb) => Some(of_color(rgb)),
        _ => None,
    });
    spectra
}

/// Ray visibility by light; empty if every light is visible to all kinds of rays that light sampling concerns.
fn ray_kinds(
    scene: &Scene,
    lights: &Lights,
    (emitters, geometries, materials): (&Emitters, &Geometries, &[CompiledMaterial]),
) -> Vec<RayKinds> {
    let mut kinds = vec![RayKinds::ALL; lights.area().len()];
    for (light, _, material) in emitters.owners(geometries) {
        kinds[light] = materials[material as usize].visible_to();
    }
    kinds.extend(scene.lights.iter().map(|light| light.visible_to));
    kinds.extend(lights.volumes().iter().map(|_| RayKinds::ALL));
    if lights.environment().is_some() {
        kinds.push(scene.environment_visible_to);
    }
    if kinds.iter().all(|&kinds| has_all_sampled_kinds(kinds)) { Vec::new() } else { kinds }
}

/// By area light: does its object cast shadows on catchers? Empty without catchers.
fn caster_lights(emitters: &Emitters, geometries: &Geometries, materials: &[CompiledMaterial]) -> Vec<bool> {
    if !materials.iter().any(|m| m.surface_visibility.is_some_and(|p| p.is_catcher)) {
        return Vec::new();
    }
    let mut caster_lights = vec![false; emitters.lights.len()];
    for (light, _, material) in emitters.owners(geometries) {
        caster_lights[light] = materials[material as usize].casts_on_catchers();
    }
    caster_lights
}

/// Does a set of ray kinds contain every kind that light sampling concerns?
fn has_all_sampled_kinds(kinds: RayKinds) -> bool {
    kinds.contains(RayKinds::ALL.without(RayKinds::CAMERA).without(RayKinds::SHADOW))
}
