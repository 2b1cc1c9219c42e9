//! `model.oscura.toml` beside `model.glb`: what the model's format can't carry. Its parts are those of scene files, all
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

use super::assets::Assets;
use super::build::Build;
use super::camera;
use super::fields::{Fields, Problems};
use super::linked_sets::Linking;
use super::node_paths::NodeIndex;
use super::parts::{read_parts, read_text};
use super::{placement, shutter, subdivided};
use crate::error::{Choice, Result, Warning};
use crate::load::{LoadOptions, Loaded};
use std::path::{Path, PathBuf};
use toml::de::DeTable;

/// Where the settings of a model would be: its name with `.oscura.toml` for the extension.
pub fn path_for(model: &Path) -> PathBuf {
    model.with_extension("oscura.toml")
}

/// Adds what the file at `path` says to a model that has been loaded, with a note that says so.
///
/// # Errors
/// All problems of that file.
pub(in crate::load) fn apply(path: &Path, options: &LoadOptions, loaded: &mut Loaded) -> Result<()> {
    let text = read_text(path, options)?;
    let problems = Problems::new(&text);
    let message = add(path, &text, options, &problems, loaded);
    problems.into_result(path, &text)?;
    loaded.notes.push(Warning::new(path, "", message));
    Ok(())
}

/// With what the file beside a model says about the shutter, the nodes where its lights stand and subdivision, which is to be known
/// before the model is read. What is wrong with the file is found later.
pub(in crate::load) fn asked_first(model: &Path, options: &LoadOptions) -> LoadOptions {
    let Ok(text) = read_text(&path_for(model), options) else { return options.clone() };
    let problems = Problems::new(&text);
    let (root, _) = DeTable::parse_recoverable(&text);
    let root = Fields::new("the file", root.get_ref(), 0..0, &problems);
    let shutter = shutter::chosen(options.shutter, &root);
    let lit_nodes = options.lit_nodes.iter().cloned().chain(placement::nodes_of_lights(&root)).collect();
    let keeps_polygons = options.keeps_polygons || subdivided::is_asked(&root);
    LoadOptions { shutter, lit_nodes, keeps_polygons, ..options.clone() }
}

/// What was added, in words.
fn add(path: &Path, text: &str, options: &LoadOptions, problems: &Problems, loaded: &mut Loaded) -> String {
    let (root, errors) = DeTable::parse_recoverable(text);
    if !errors.is_empty() {
        super::tell_of_syntax(text, &errors, problems);
        return String::new();
    }
    let own = std::mem::take(&mut loaded.scene.settings);
    let root = Fields::new("the file", root.get_ref(), 0..0, problems);
    let shutter = shutter::chosen(options.shutter, &root);
    let (taken, is_beside_model) = (std::mem::take(loaded), true);
    let mut build = Build {
        file: path,
        options,
        problems,
        loaded: taken,
        shutter,
        is_beside_model,
        linking: Linking::default(),
        nodes: NodeIndex::default(),
    };
    let mut assets = Assets::default();
    read_parts(&mut build, &root, &mut assets, |build, assets| {
        for fields in root.tables("camera") {
            camera::adjust(build, &fields, assets);
        }
    });
    *loaded = build.loaded;
    loaded.scene.settings = loaded.scene.settings.or(&own);
    let parts: Vec<&str> = ["environment", "materials", "lights", "portals", "objects", "camera", "render"]
        .into_iter()
        .filter(|p| root.has(p))
        .collect();
    format!(
        "lies beside the model and was used: {} ({} leaves it out)",
        if parts.is_empty() { "it is empty".to_string() } else { parts.join(", ") },
        Choice::NoSidecar
    )
}
