//! What the file beside a model changes of the model's own objects.

use super::build::Build;
use super::fields::{Fields, nearest};
use super::light_traits::group;
use super::materials::Materials;
use super::subdivided;
use super::textures::Textures;
use super::visibility::GivenTraits;
use crate::scene::Instance;
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
    build.nodes.update(scene);
    let (instances, lights) = (build.nodes.instances(name, scene), build.nodes.lights(name));
    if instances.is_empty() && lights.is_empty() {
        let nodes = scene.instances.iter().flat_map(|i| i.name.split('/'));
        let help = match nearest(name, nodes.chain(scene.lights.iter().map(|l| l.name.as_str()))) {
            Some(near) => format!("did you mean '{near}'?"),
            None => format!("it has {} placed meshes", scene.instances.len()),
        };
        return fields.problems.push_help(span, format!("the model has no object '{name}'"), help);
    }
    if is_hidden {
        return build.nodes.hide(&instances, &lights);
    }
    for i in lights {
        let light = &mut scene.lights[i];
        light.group = light_group.clone().unwrap_or(std::mem::take(&mut light.group));
        light.visible_to = given.own.map_or(light.visible_to, |own| own.visible_to);
        light.links = given.links.unwrap_or(light.links);
    }
    for &i in &instances {
        let instance = &mut scene.instances[i];
        instance.light_group = light_group.clone().or(instance.light_group.take());
        given.apply(&mut instance.traits);
        instance.material = material.or(instance.material);
    }
    for i in instances.into_iter().filter(|_| subdivision.is_some()) {
        let Instance { mesh, motion, .. } = build.loaded.scene.instances[i];
        if let Some(mesh) = subdivision.and_then(|how| subdivided::mesh(build, fields, mesh, motion, how)) {
            build.loaded.scene.instances[i].mesh = mesh;
        }
    }
}
