//! What the file beside a model changes of the model's own materials.

use super::build::Build;
use super::displaced;
use super::fields::{Fields, nearest};
use super::media;
use super::pbr::{self, Slots};
use super::textures::Textures;
use super::visibility::visible_to;
use crate::error::Warning;
use crate::scene::{AlphaMode, Lamp, Material, Model};
use std::ops::Range;

/// The material of a model, with what the keys say; `None` if it has no parameters to change.
pub(super) fn adjusted<'a>(
    build: &mut Build,
    textures: &mut Textures<'a>,
    fields: &Fields<'a>,
    index: usize,
) -> Option<Material> {
    let mut material = build.loaded.scene.materials[index].clone();
    let Model::Pbr(mut model) = material.model.clone() else {
        let message = format!("material '{}' of the model is unlit and has no parameters", material.name);
        fields.problems.push_help(fields.span(), message, "give it a 'type'");
        return None;
    };
    let medium = media::table(build, fields, "medium");
    let slots = &mut Slots { build, textures, fields, of_model: true };
    pbr::adjust((&mut material, &mut model), medium, slots);
    let modes = [
        ("opaque", AlphaMode::Opaque),
        ("mask", AlphaMode::Mask { cutoff: 0.5 }),
        ("blend", AlphaMode::Blend),
    ];
    if let Some(mode) = fields.choice("alpha", &modes) {
        if material.alpha_mode == AlphaMode::Opaque {
            material.alpha = pbr::alpha_of(&material, &model);
        }
        material.alpha_mode = mode;
    }
    if fields.has("visible_to") || fields.has("visible_to_camera") {
        let lamp = material.lamp.unwrap_or_default();
        material.lamp = Some(Lamp { visible_to: visible_to(fields, lamp.visible_to), ..lamp });
    }
    material.displacement = displaced::read(build, fields, false).or(material.displacement);
    material.normal_map = displaced::normals(build, fields, false).or(material.normal_map);
    material.priority = media::priority(fields).unwrap_or(material.priority);
    fields.finish();
    Some(Material { model: Model::Pbr(model), ..material })
}

/// Notes a problem if a material of the model may be meant by a name that none of them has; did it?
pub(super) fn push_unknown(build: &Build, name: &str, span: Range<usize>) -> bool {
    let near = nearest(name, build.loaded.scene.materials.iter().map(|m| m.name.as_str()));
    if let Some(near) = near {
        let message = format!("there is no material '{name}'");
        build.problems.push_help(span, message, format!("did you mean '{near}' of the model?"));
    }
    near.is_some()
}

/// Warns of a table that is named as no material of the model and that no object refers to.
pub(super) fn warn_of_unknown(build: &mut Build, name: &str) {
    let names = build.loaded.scene.materials.iter().map(|m| m.name.as_str());
    let help = nearest(name, names).map_or_else(String::new, |near| format!(" (did you mean '{near}'?)"));
    let message = format!("the model has no material '{name}' and no object asks for it{help}");
    build.loaded.warnings.push(Warning::new(build.file, "", message));
}
