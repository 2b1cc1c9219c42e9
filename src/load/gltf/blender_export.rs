//! Detects and reports losses of Blender's own glTF exporter.

use super::document::{Document, list_of_indices};
use super::materials::ExportLosses;
use super::nodes::Hierarchy;
use super::report::Report;
use crate::error::{Choice, Warning};
use crate::image::{Image, Pixels};
use crate::load::{BlenderExport, Loaded};
use crate::math::{DAffine3, DVec3};
use crate::scene::{Extent, Scene, Texture, TextureId, instance_extents};
use serde_json::Value;
use std::collections::HashSet;
use std::path::Path;

/// Detectable losses of Blender's own exporter; `None` for other exporters. `export_losses`: one per material.
pub(super) fn blender_losses(
    doc: &Document,
    hierarchy: &Hierarchy,
    scene: &Scene,
    export_losses: &[ExportLosses],
    report: &mut Report,
) -> Option<BlenderExport> {
    if !doc.is_from_blender() {
        return None;
    }
    let lights = lights(doc, hierarchy, report);
    let materials_with = |predicate: &dyn Fn(&ExportLosses) -> bool| {
        let materials = scene.materials.iter().zip(export_losses);
        without_duplicates(
            materials.filter(|(_, export_losses)| predicate(export_losses)).map(|(m, _)| m.name.clone()),
        )
    };
    Some(BlenderExport {
        white: materials_with(&|s| s.is_white),
        rough_metal: materials_with(&|s| s.is_rough_metal),
        lost: materials_with(&|s| s.is_lost),
        unused_alpha: materials_with(&|s| {
            s.ignores_alpha_of.is_some_and(|texture| has_alpha(scene, texture))
        }),
        enclosing: enclosing(scene, export_losses, &lights),
        lights: lights.into_iter().map(|(name, _)| name).collect(),
    })
}

/// Substrings of names of lights.
const LIGHT_SUBSTRINGS: [&str; 3] = ["light", "lamp", "softbox"];
/// Whole words in names of lights.
const LIGHT_WORDS: [&str; 6] = ["area", "sun", "spot", "key", "fill", "rim"];

/// Whether a name suggests a light.
fn is_light_name(name: &str) -> bool {
    let lower = name.to_lowercase();
    let mut words = lower.split(|c: char| !c.is_alphabetic());
    LIGHT_SUBSTRINGS.iter().any(|part| lower.contains(part)) || words.any(|word| LIGHT_WORDS.contains(&word))
}

/// Empty nodes named like lights, with their world transforms; without joints of skins and nodes with children.
fn lights(doc: &Document, hierarchy: &Hierarchy, report: &mut Report) -> Vec<(String, DAffine3)> {
    let skins = doc.json.get("skins").and_then(Value::as_array).into_iter().flatten();
    let joints: HashSet<usize> =
        skins.flat_map(|skin| list_of_indices(skin, "joints", "/skins", report)).collect();
    let is_leaf = |index: usize| {
        let children = doc.json.pointer(&format!("/nodes/{index}/children")).and_then(Value::as_array);
        children.is_none_or(Vec::is_empty) && !joints.contains(&index)
    };
    let empties = hierarchy.empties(doc);
    empties
        .into_iter()
        .filter(|(index, name, _)| is_leaf(*index) && is_light_name(name))
        .map(|(_, n, m)| (n, m))
        .collect()
}

/// Whether the image of a texture has any alpha below 1.
fn has_alpha(scene: &Scene, texture: TextureId) -> bool {
    let Some(Texture::Image { image, .. }) = scene.textures.get(texture.index()) else { return false };
    let Some(image) = scene.images.get(image.index()) else { return false };
    let n = image.channels as usize;
    if n != 2 && n != 4 {
        return false;
    }
    // Damaged images are reported when the scene is compiled.
    let Ok(Image { pixels, .. }) = image.decoded(&mut Vec::new()) else { return false };
    match &*pixels {
        Pixels::U8(data) => data.chunks_exact(n).any(|p| p[n - 1] < u8::MAX),
        Pixels::U16(data) => data.chunks_exact(n).any(|p| p[n - 1] < u16::MAX),
        Pixels::F32(data) => data.chunks_exact(n).any(|p| p[n - 1] < 1.0),
        Pixels::Encoded(_) => false,
    }
}

/// Names of objects whose materials are all lost and whose bounding box contains a camera or a light, with its name.
fn enclosing(
    scene: &Scene,
    export_losses: &[ExportLosses],
    lights: &[(String, DAffine3)],
) -> Vec<(String, String)> {
    if !export_losses.iter().any(|s| s.is_lost) {
        return Vec::new();
    }
    let is_lost = |index: usize| {
        let parts = &scene.meshes[scene.instances[index].mesh.index()].parts;
        parts.iter().all(|part| export_losses.get(part.material.index()).is_some_and(|s| s.is_lost))
    };
    let cameras =
        scene.cameras.iter().map(|c| (format!("camera '{}'", c.name), c.world_from_camera.translation));
    let listed = scene.lights.iter().filter_map(|light| {
        light.kind.position().map(|position| (format!("light '{}'", light.name), position))
    });
    let lights = lights.iter().map(|(name, place)| (format!("light '{name}'"), place.translation));
    let inside: Vec<(String, DVec3)> = cameras.chain(listed).chain(lights).collect();
    let extents = instance_extents(scene);
    let found = extents.iter().enumerate().filter_map(|(index, Extent(extent))| {
        let (low, high) = (*extent)?;
        let (what, _) = inside.iter().find(|(_, p)| p.cmpgt(low).all() && p.cmplt(high).all())?;
        is_lost(index).then(|| (scene.instances[index].name.clone(), what.clone()))
    });
    without_duplicates(found)
}

/// Removes duplicates, keeping the first.
fn without_duplicates<T: PartialEq>(all: impl Iterator<Item = T>) -> Vec<T> {
    all.fold(Vec::new(), |mut list, item| {
        if !list.contains(&item) {
            list.push(item);
        }
        list
    })
}

/// Maximum number of names in one warning.
const MAX_NAMES: usize = 8;

/// Adds warnings about the losses of Blender's exporter. Not called for models with a sidecar that restores them.
pub(in crate::load) fn warn_of_losses(path: &Path, loaded: &mut Loaded) {
    let Some(lost) = &loaded.blender else { return };
    let about = |(code, message): (&'static str, String)| Warning::new(path, "", (code, message));
    loaded.notes.push(about(("blender-exporter-limits", format!(
        "written by Blender, whose glTF files lack its world, area lights, depth of field, volumes and most shader nodes; \
         'oscura render scene.blend' keeps them, and {} adds some",
        Choice::NewSidecar
    ))));
    loaded.warnings.extend(warnings(lost).into_iter().map(about));
}

fn warnings(lost: &BlenderExport) -> Vec<(&'static str, String)> {
    let BlenderExport { lights, white, rough_metal, unused_alpha, enclosing, .. } = lost;
    let mut notes = Vec::new();
    if let Some(names) = list("node", lights) {
        notes.push((
            "lost-area-lights",
            format!("{names} without contents may have been area lights, which Blender's exporter drops"),
        ));
    }
    if let Some(names) = list("material", white) {
        notes.push(("lost-color", format!(
            "{names}: pure white without a texture; Blender also writes this for colours from nodes that it can't export"
        )));
    }
    if let Some(names) = list("material", rough_metal) {
        notes.push(("lost-roughness", format!(
            "{names}: metal of roughness 1 without a texture; Blender also writes this for roughness or metalness from \
             nodes that it can't export"
        )));
    }
    if let Some(names) = list("material", unused_alpha) {
        notes.push((
            "unused-alpha",
            format!("{names}: the image of the base colour has alpha, which the material does not use"),
        ));
    }
    for (object, inside) in enclosing {
        notes.push(("lost-volume", format!(
            "object '{object}' with a lost material encloses the {inside}: it may have been a volume, and occludes the scene"
        )));
    }
    notes
}

/// A list of quoted names for messages; `None` if empty.
fn list(kind: &str, names: &[String]) -> Option<String> {
    let quoted: Vec<String> = names.iter().take(MAX_NAMES).map(|name| format!("'{name}'")).collect();
    let more = match names.len().checked_sub(MAX_NAMES) {
        None | Some(0) => String::new(),
        Some(more) => format!(" and {more} more"),
    };
    let plural = if names.len() == 1 { "" } else { "s" };
    (!names.is_empty()).then(|| format!("{kind}{plural} {}{more}", quoted.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::is_light_name;

    #[test]
    fn lights_are_recognised_by_their_names() {
        let lights =
            ["Area", "Area.001", "key_light", "KeyLight", "Rim", "Lamp.003", "SOFTBOX left", "fill-2"];
        assert!(lights.iter().all(|name| is_light_name(name)));
        assert!(
            !["Empty", "Keyboard", "Rimini", "Sunday", "target", "arena", "spine.001"]
                .iter()
                .any(|n| is_light_name(n))
        );
    }
}
