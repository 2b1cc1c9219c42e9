//! Subdivision of the meshes of a loaded scene.

use super::subdivide::Subdivision;
use super::{LoadOptions, Loaded};
use crate::error::{Choice, Error, Warning};
use crate::scene::{Mesh, MeshId};
use std::path::Path;

/// Why a mesh that moves by its vertices isn't subdivided.
pub(super) const CHANGES_FORM: &str = "meshes that change their form are not subdivided";

/// Subdivides all meshes of an OBJ or PLY file, where the caller asks for it.
///
/// # Errors
/// If they would have too many triangles.
pub(super) fn all(
    path: &Path,
    options: &LoadOptions,
    is_of_meshes: bool,
    loaded: &mut Loaded,
) -> crate::error::Result<()> {
    let Some(how) = options.subdivision else { return Ok(()) };
    if !is_of_meshes || loaded.scene.meshes.is_empty() {
        let why = match is_of_meshes {
            true => "there are no meshes",
            false => {
                "it is for OBJ and PLY files; objects of scene files, and beside models, have the key 'subdivide'"
            }
        };
        let message = ("unused-option", format!("{} has no effect: {why}", Choice::Subdivide));
        loaded.warnings.push(Warning::new(path, "", message));
        return Ok(());
    }
    for id in (0..loaded.scene.meshes.len() as u32).map(MeshId) {
        if let Some(mesh) = made(loaded, id, how).map_err(|message| Error::input(path, message))? {
            loaded.scene.meshes[id.index()] = mesh;
        }
    }
    Ok(())
}

/// A mesh of the scene, subdivided: another mesh, made once.
///
/// # Errors
/// A message, where that can't be.
pub(super) fn in_scene(loaded: &mut Loaded, id: MeshId, how: Subdivision) -> Result<MeshId, String> {
    if let Some(known) = loaded.polygons.known(id, how) {
        return Ok(known);
    }
    let fine = match made(loaded, id, how)? {
        Some(mesh) => loaded.scene.add_mesh(mesh),
        None => id,
    };
    loaded.polygons.remember(id, how, fine);
    Ok(fine)
}

/// A mesh, subdivided; `None` without levels.
fn made(loaded: &mut Loaded, id: MeshId, how: Subdivision) -> Result<Option<Mesh>, String> {
    if how.levels == 0 {
        return Ok(None);
    }
    if loaded.scene.motion.meshes.contains_key(&id.index()) {
        return Err(CHANGES_FORM.into());
    }
    let mesh = loaded.polygons.subdivided(id, &loaded.scene.meshes[id.index()], how)?;
    Ok(Some(mesh))
}
