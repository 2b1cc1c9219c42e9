//! Says what Blender's own exporter leaves out of glTF files.

use super::loaded::{BlenderExport, Loaded};
use crate::error::{Choice, Warning};
use std::path::Path;

/// Most names in one warning.
const LISTED: usize = 8;

/// Says what a file lost on its way from Blender. Where a file beside the model says what the model can't, its writer
/// knows.
pub(super) fn say(path: &Path, loaded: &mut Loaded) {
    let Some(lost) = &loaded.blender else { return };
    let about = |message: String| Warning::new(path, "", message);
    loaded.notes.push(about(format!(
        "Blender's glTF files never hold the world, area lights, portals, sizes of lamps, angles of suns, nodes of lamps, \
         links of lights and lamps without shadows; depth of field, shift, panoramas, motion blur, the picture's size, \
         transparency of the film, exposure and view; volumes, subsurface scattering, displacement, bumps and other nodes \
         beside Principled BSDF; visibility by kinds of rays, holdouts and shadow catchers, instances of particles and \
         geometry nodes. The file of Blender itself keeps them ('oscura render scene.blend'); {} makes up for some",
        Choice::Beside
    )));
    loaded.warnings.extend(warnings(lost).into_iter().map(about));
}

fn warnings(lost: &BlenderExport) -> Vec<String> {
    let BlenderExport { lamps, white, rough_metal, unused_alpha, enclosing, .. } = lost;
    let mut said = Vec::new();
    if let Some(names) = list("node", lamps) {
        said.push(format!(
            "{names} without contents may have been area lights, which Blender does not export"
        ));
    }
    if let Some(names) = list("material", white) {
        said.push(format!(
            "{names}: pure white without a texture; Blender writes that, too, where nodes that it can't export give the \
             colour"
        ));
    }
    if let Some(names) = list("material", rough_metal) {
        said.push(format!(
            "{names}: metal of roughness 1 without a texture; Blender writes that, too, where nodes that it can't export \
             give the roughness or the metalness"
        ));
    }
    if let Some(names) = list("material", unused_alpha) {
        said.push(format!(
            "{names}: the image of the base colour has alpha, which the material does not use"
        ));
    }
    for (object, inside) in enclosing {
        said.push(format!(
            "object '{object}' with a lost material encloses the {inside}: it may have been a volume, and hides all else"
        ));
    }
    said
}

/// Names of things of a kind, if there are any.
fn list(kind: &str, names: &[String]) -> Option<String> {
    let quoted: Vec<String> = names.iter().take(LISTED).map(|name| format!("'{name}'")).collect();
    let more = match names.len().checked_sub(LISTED) {
        None | Some(0) => String::new(),
        Some(more) => format!(" and {more} more"),
    };
    let plural = if names.len() == 1 { "" } else { "s" };
    (!names.is_empty()).then(|| format!("{kind}{plural} {}{more}", quoted.join(", ")))
}
