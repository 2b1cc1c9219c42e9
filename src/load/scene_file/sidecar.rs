//! `model.oscura.toml` next to `model.glb`: what the model's format can't carry. Its parts are those of scene files, all
//! optional, and added to the model:
//!
//! | Part | Effect |
//! |---|---|
//! | `[environment]` | the world |
//! | `[[lights]]`, `[[objects]]` | more of both, with `[materials.NAME]` and `[textures.NAME]` |
//! | `[materials.NAME]` of a material of the model | changes it: with a `type` all of it, else what the keys of type `pbr` say; `alpha` = `"opaque"`, `"mask"` or `"blend"` decides what the alpha of its base colour does; `visible_to_camera` = false hides it from the camera, and from nothing else; `visible_to` lists the rays that see it, as for objects of scene files |
//! | `[objects.NAME]` | changes what a node of the model and all nodes below it show: `hidden = true` leaves it out (lights, too), `material = "NAME"` gives it a material of the file or of the model, `light_group = "NAME"` puts its lights and what it emits into a group; `subdivide = N` subdivides its meshes, as for objects of scene files; `visible_to`, `visible_to_camera`, `holdout`, `shadow_catcher`, `light_link` and `shadow_link` as for objects of scene files; a name that begins with a slash is that of a node without a parent; among `[[objects]]`, `node = "NAME"` says which node is meant |
//! | `[camera]` with `look_from` | a camera before those of the model |
//! | `[camera]` otherwise | depth of field, `shift` and `type` with its keys (panoramas ...), as of scene files, of the model's cameras, or only of that called `name`; `shutter` and `shutter_position`; with `default = true` it comes before the others; `width`, `height` |
//! | `[[camera]]` | the same for several cameras, each by its name |
//! | `[[portals]]` | windows through which light of the environment is looked for |
//! | `[render]` | settings of rendering |

use super::fields::Problems;
use super::{TomlFile, TomlText, camera, objects, transform};
use crate::error::{Choice, Result, Warning};
use crate::load::{LoadOptions, Loaded};
use std::path::{Path, PathBuf};

/// The sidecar's path for a model: its name with `.oscura.toml` for the extension.
pub fn path_for(model: &Path) -> PathBuf {
    model.with_extension("oscura.toml")
}

/// The text of the sidecar next to a model; `None` where there is none.
///
/// # Errors
/// An input error if the file can't be read or isn't UTF-8.
pub(in crate::load) fn text_for(model: &Path, options: &LoadOptions) -> Result<Option<TomlText>> {
    let path = path_for(model);
    options.files.note(&path);
    path.is_file().then(|| TomlText::read(&path, options)).transpose()
}

/// The sidecar of a model, parsed.
pub(in crate::load) struct Sidecar<'t> {
    file: TomlFile<'t>,
}

impl<'t> Sidecar<'t> {
    /// Syntax errors are reported by [`Sidecar::apply`].
    pub fn parse(text: &'t TomlText) -> Sidecar<'t> {
        Sidecar { file: TomlFile::parse(text) }
    }

    /// The options with those settings of the sidecar that the model's reader needs: the shutter, the empty nodes at which
    /// lights are placed, and whether some mesh is subdivided. Problems of the file are reported by [`Sidecar::apply`].
    pub fn reader_options(&self, options: &LoadOptions) -> LoadOptions {
        let problems = Problems::new(self.file.text);
        let root = self.file.root(true, &problems);
        let shutter = camera::shutter_options(options.shutter, &root);
        let lit_nodes = options.lit_nodes.iter().cloned().chain(transform::nodes_of_lights(&root)).collect();
        let keeps_polygons = options.keeps_polygons || objects::is_subdivision_asked(&root);
        LoadOptions { shutter, lit_nodes, keeps_polygons, ..options.clone() }
    }

    /// Adds the sidecar's contents to its model, with a note about it.
    ///
    /// # Errors
    /// All problems of the file.
    pub fn apply(&self, options: &LoadOptions, loaded: &mut Loaded) -> Result<()> {
        *loaded = self.file.add_to(std::mem::take(loaded), options, true)?;
        loaded.notes.push(Warning::new(self.file.path, "", self.note()));
        Ok(())
    }

    fn note(&self) -> String {
        let parts = ["environment", "materials", "lights", "portals", "objects", "camera", "render"];
        let used: Vec<&str> =
            parts.into_iter().filter(|part| self.file.root.get_ref().contains_key(*part)).collect();
        let used = if used.is_empty() { "it is empty".to_string() } else { used.join(", ") };
        format!("lies beside the model and was used: {used} ({} leaves it out)", Choice::NoSidecar)
    }
}
