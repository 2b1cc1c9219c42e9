//! `subdivide = 2`, or `subdivide = { levels = 2 }`, subdivides the meshes of an object when they are loaded, by Catmull and Clark: quads of OBJ
//! files become smooth surfaces, as modellers mean them. Vertices lie on the limit surface and have its normals. Meshes of other files
//! are subdivided by their triangles.
//!
//! | Subdivision | Default | Meaning |
//! |---|---|---|
//! | `levels` | required | steps, 0 to 10; each makes four faces of one. All subdivided meshes together may have 16 million triangles |
//! | `scheme` | `catmull-clark` | there is no other |
//! | `corners` | `sharp` | corners of open sheets, which one face only has, stay where they are; `round`: they become round, as by default in Blender |
//!
//! Open edges, and those of more than two faces, become smooth curves. Seams of texture coordinates stay where they are.

use super::build::Build;
use super::fields::{Fields, number};
use crate::load::subdivide::{MOST_LEVELS, Subdivision};
use crate::load::subdivided::{CHANGES_FORM, in_scene};
use crate::scene::{MeshId, Motion};
use toml::de::DeValue;

/// Does some object ask for it, of whatever kind of file?
pub(super) fn is_asked(root: &Fields) -> bool {
    let asks = |value: &DeValue| value.as_table().is_some_and(|table| table.contains_key("subdivide"));
    match root.raw("objects").map(|objects| objects.get_ref()) {
        Some(DeValue::Array(list)) => list.iter().any(|value| asks(value.get_ref())),
        Some(DeValue::Table(all)) => all.values().any(|value| asks(value.get_ref())),
        _ => false,
    }
}

/// What an object asks for.
pub(super) fn read(fields: &Fields) -> Option<Subdivision> {
    let given = fields.raw("subdivide")?;
    if number(given.get_ref()).is_some() {
        let levels = fields.integer("subdivide", 0, MOST_LEVELS)?;
        return Some(Subdivision { levels, has_round_corners: false });
    }
    let Some(table) = given.get_ref().as_table() else {
        let message = format!("'subdivide' of {} must be a number of levels or a table", fields.what());
        fields.problems.push_help(given.span(), message, "write subdivide = 2");
        return None;
    };
    let table = Fields::new("'subdivide'", table, given.span(), fields.problems);
    let levels = table.require("levels", table.integer("levels", 0, MOST_LEVELS));
    table.choice("scheme", &[("catmull-clark", ())]);
    let corners = table.choice("corners", &[("sharp", false), ("round", true)]);
    table.finish();
    Some(Subdivision { levels: levels?, has_round_corners: corners.unwrap_or(false) })
}

/// A mesh of the scene as it is asked for; `None` where it can't be, which is a problem of the key.
pub(super) fn mesh(
    build: &mut Build,
    fields: &Fields,
    id: MeshId,
    motion: Motion,
    how: Subdivision,
) -> Option<MeshId> {
    let fine = match motion {
        Motion::Deforms => Err(CHANGES_FORM.to_string()),
        _ => in_scene(&mut build.loaded, id, how),
    };
    let span = fields.raw("subdivide").map_or(fields.span(), |value| value.span());
    fine.map_err(|message| fields.problems.push(span, message)).ok()
}
