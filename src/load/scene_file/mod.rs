//! Scene files: TOML that places meshes and analytic shapes, with cameras, materials, textures and settings.
//!
//! | Part | Module |
//! |---|---|
//! | `[camera]` | `camera` |
//! | `[environment]` | `environment` |
//! | `[render]` | `settings` |
//! | `[textures.NAME]` | `textures`, `spectra` |
//! | `[materials.NAME]` | `materials` |
//! | `[[objects]]` | `objects`, `transform`, `motion` |
//! | `[[curves]]` | `curves` |
//! | `[[lights]]` | `lights` |
//! | `[[portals]]` | `portals` |
//!
//! Angles are in degrees, lengths in metres, colours linear Rec. 709, and paths relative to the scene file. Every
//! problem of the file is reported at once, with its line and, for a misspelt name, the nearest one that exists.
//! What nothing refers to is not loaded. A file beside a model may say what the model can't (`sidecar`).

mod adjusted;
mod assets;
mod build;
mod camera;
mod curves;
mod displaced;
mod environment;
mod fields;
mod hair;
mod light_shapes;
mod light_traits;
mod lights;
mod linked_sets;
mod linking;
mod materials;
mod media;
mod metals;
mod motion;
mod node_paths;
mod object;
mod objects;
mod overrides;
mod parts;
mod pbr;
mod placement;
mod portals;
mod profiled;
mod projection;
pub mod reference;
mod round;
mod settings;
mod shutter;
pub mod sidecar;
mod spectra;
mod subdivided;
mod textures;
mod transform;
mod visibility;

use super::{LoadOptions, Loaded};
use crate::error::Result;
use assets::Assets;
use build::Build;
use fields::{Fields, Problems};
use linked_sets::Linking;
use node_paths::NodeIndex;
use parts::{read_parts, read_text};
use std::path::Path;
use toml::de::DeTable;

/// Reads a scene file and the files that it refers to.
pub(super) fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    let text = read_text(path, options)?;
    let problems = Problems::new(&text);
    let loaded = build(path, &text, options, &problems);
    problems.into_result(path, &text)?;
    Ok(loaded)
}

fn build(path: &Path, text: &str, options: &LoadOptions, problems: &Problems) -> Loaded {
    let (root, errors) = DeTable::parse_recoverable(text);
    if !errors.is_empty() {
        tell_of_syntax(text, &errors, problems);
        return Loaded::default();
    }
    let root = Fields::new("the scene file", root.get_ref(), 0..0, problems);
    let shutter = shutter::chosen(options.shutter, &root);
    let (loaded, is_beside_model) = (Loaded::default(), false);
    let mut build = Build {
        file: path,
        options,
        problems,
        loaded,
        shutter,
        is_beside_model,
        linking: Linking::default(),
        nodes: NodeIndex::default(),
    };
    build.loaded.scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    if !root.has("curves") {
        root.require("objects", root.list("objects"));
    }
    let mut assets = Assets::default();
    read_parts(&mut build, &root, &mut assets, |build, assets| {
        // The camera comes last: it may be taken from a mesh file that the objects have loaded already.
        if let Some(fields) = root.table("camera") {
            camera::read(build, &fields, assets);
        }
    });
    build.loaded
}

/// Notes what makes a text no TOML.
fn tell_of_syntax(text: &str, errors: &[toml::de::Error], problems: &Problems) {
    for e in errors {
        let span = e.span().unwrap_or(0..0);
        match lacks_first_digit(text, span.start) {
            true => problems.push_help(span, e.message(), "numbers begin with a digit: 0.5, not .5"),
            false => problems.push(span, e.message()),
        }
    }
}

/// Is there a number such as `.5` at a place of a text, or its point just before?
fn lacks_first_digit(text: &str, place: usize) -> bool {
    [Some(place), place.checked_sub(1)].into_iter().flatten().any(|start| {
        let (Some(before), Some(rest)) = (text.get(..start), text.get(start..)) else { return false };
        let is_first = !before.ends_with(|c: char| c.is_ascii_digit() || c == '.');
        is_first && rest.strip_prefix('.').is_some_and(|t| t.starts_with(|c: char| c.is_ascii_digit()))
    })
}
