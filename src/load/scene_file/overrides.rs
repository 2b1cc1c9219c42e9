//! What the file beside a model changes of the model's own objects.

use super::build::Build;
use super::fields::{Fields, nearest};
use super::light_traits::group;
use super::materials::Materials;
use super::node_paths::is_on_path;
use super::subdivided;
use super::textures::Textures;
use super::visibility::GivenTraits;
use crate::scene::{Instance, Scene};
use std::ops::Range;

/// Reads `[objects.NAME]`: changes of the model's own objects.
pub(super) fn objects<'a>(
    build: &mut Build,
    all: &Fields<'a>,
    materials: &mut Materials<'a>,
    textures: &mut Textures<'a>,
) {
    for (name, value) in all.entries() {
        match value.get_ref().as_table() {
            Some(table) => {
                let fields = Fields::new(format!("object '{name}'"), table, value.span(), all.problems);
                object(build, &fields, (name, value.span()), materials, textures);
            }
            None => all.problems.push(value.span(), format!("object '{name}' must be a table")),
        }
    }
}

/// Changes what a node of the model shows, and what the nodes below it show: `hidden`, another `material`,
/// the `light_group` of what they emit and what that is linked to, subdivided meshes; to which rays (see [`super::visibility`]).
pub(super) fn object<'a>(
    build: &mut Build,
    fields: &Fields<'a>,
    (name, span): (&str, Range<usize>),
    materials: &mut Materials<'a>,
    textures: &mut Textures<'a>,
) {
    let is_hidden = fields.flag("hidden", false);
    let wanted = fields.string("material");
    let material = wanted.and_then(|wanted| materials.get(build, textures, wanted.value, wanted.span));
    let given = GivenTraits::read(build, fields);
    let light_group = fields.has("light_group").then(|| group(fields, "light_group"));
    let subdivision = subdivided::read(fields);
    fields.finish();
    let scene = &mut build.loaded.scene;
    let is_meant = |path: &str| is_on_path(name, path);
    let is_there =
        scene.instances.iter().any(|i| is_meant(&i.name)) || scene.lights.iter().any(|l| l.name == name);
    if !is_there {
        let nodes = scene.instances.iter().flat_map(|i| i.name.split('/'));
        let help = match nearest(name, nodes.chain(scene.lights.iter().map(|l| l.name.as_str()))) {
            Some(near) => format!("did you mean '{near}'?"),
            None => format!("it has {} placed meshes", scene.instances.len()),
        };
        return fields.problems.push_help(span, format!("the model has no object '{name}'"), help);
    }
    if is_hidden {
        scene.instances.retain(|i| !is_meant(&i.name));
        scene.lights.retain(|l| l.name != name);
    }
    if let Some(group) = light_group {
        let lights = scene.lights.iter_mut().filter(|l| l.name == name);
        lights.for_each(|light| light.group.clone_from(&group));
        let own = scene.instances.iter_mut().filter(|i| is_meant(&i.name));
        own.for_each(|instance| instance.light_group = Some(group.clone()));
    }
    apply_traits(scene, name, &given);
    if let Some(how) = subdivision {
        let own: Vec<usize> =
            (0..scene.instances.len()).filter(|&i| is_meant(&scene.instances[i].name)).collect();
        for i in own {
            let Instance { mesh, motion, .. } = build.loaded.scene.instances[i];
            if let Some(mesh) = subdivided::mesh(build, fields, mesh, motion, how) {
                build.loaded.scene.instances[i].mesh = mesh;
            }
        }
    }
    let scene = &mut build.loaded.scene;
    if let Some(material) = material {
        let own = scene.instances.iter_mut().filter(|i| is_meant(&i.name));
        own.for_each(|instance| instance.material = Some(material));
    }
}

/// Gives the lights and objects of a name their traits, and what they are linked to.
fn apply_traits(scene: &mut Scene, name: &str, given: &GivenTraits) {
    for light in scene.lights.iter_mut().filter(|l| l.name == name) {
        light.visible_to = given.own.map_or(light.visible_to, |own| own.visible_to);
        light.links = given.links.unwrap_or(light.links);
    }
    let own = scene.instances.iter_mut().filter(|i| is_on_path(name, &i.name));
    own.for_each(|instance| given.apply(&mut instance.traits));
}
