//! The text of a file, and the parts that scene files and files of settings have in common.

use super::assets::Assets;
use super::build::Build;
use super::fields::Fields;
use super::materials::Materials;
use super::textures::Textures;
use super::{curves, environment, lights, linking, objects, portals, settings};
use crate::error::{Error, Problem, Result};
use crate::load::LoadOptions;
use std::path::Path;

/// The file's text.
///
/// # Errors
/// An input error if it can't be read or isn't UTF-8.
pub(super) fn read_text(path: &Path, options: &LoadOptions) -> Result<String> {
    options.files.note(path);
    let bytes = std::fs::read(path).map_err(|e| Error::input(path, format!("can't be read: {e}")))?;
    let text = String::from_utf8(bytes).map_err(|e| {
        let before = &e.as_bytes()[..e.utf8_error().valid_up_to()];
        let line = before.iter().filter(|&&b| b == b'\n').count() + 1;
        let problem =
            Problem::new(format!("line {line}"), "is not UTF-8 text").with_help("save the file as UTF-8");
        Error::input_problems(path, vec![problem])
    })?;
    // Editors of some systems begin a file with a byte order mark.
    Ok(text.strip_prefix('\u{feff}').map(str::to_string).unwrap_or(text))
}

/// Reads all parts of a file; `camera` reads that table, which means different things.
pub(super) fn read_parts<'a>(
    build: &mut Build,
    root: &Fields<'a>,
    assets: &mut Assets,
    camera: impl FnOnce(&mut Build, &mut Assets),
) {
    if let Some(fields) = root.table("render") {
        build.loaded.scene.settings = settings::read(build, &fields);
    }
    let mut textures = Textures::new(root.table("textures"));
    let mut materials = Materials::new(root.table("materials"));
    materials.override_model(build, &mut textures);
    objects::read(build, root, &mut materials, &mut textures, assets);
    curves::read(build, root, &mut materials, &mut textures);
    lights::read(build, root);
    portals::read(build, root);
    // After what may leave lights out: it may add one that it remembers by its place.
    if let Some(fields) = root.table("environment") {
        environment::read(build, &fields);
    }
    linking::resolve(build);
    camera(build, assets);
    root.finish();
    materials.check_unused(build, &mut textures);
    textures.check_unused(build);
}
