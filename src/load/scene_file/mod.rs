//! Scene files: TOML that places meshes and analytic shapes, with cameras, materials, textures and settings.
//!
//! | Part | Chapter of this reference |
//! |---|---|
//! | `[camera]` | `camera` |
//! | `[environment]` | `environment` |
//! | `[render]` | `render` |
//! | `[textures.NAME]` | `textures` |
//! | `[materials.NAME]` | `materials`, `media` |
//! | `[[objects]]` | `objects`, `subdivision`, `transform`, `motion` |
//! | `[[curves]]` | `curves` |
//! | `[[lights]]` | `lights` |
//! | `[[portals]]` | `portals` |
//!
//! Angles are in degrees, lengths in metres, colours linear Rec. 709, and paths relative to the scene file. Every
//! problem of the file is reported at once, with its line and, for a misspelt name, the nearest one that exists.
//! What nothing refers to is not loaded. A file next to a model may add what the model's format can't store (`sidecar`).

mod assets;
mod builder;
mod camera;
mod curves;
mod environment;
mod fields;
mod instances;
mod lights;
mod materials;
mod media;
mod nodes;
mod objects;
mod pbr;
pub mod reference;
mod render_settings;
mod shaders;
pub mod sidecar;
mod textures;
mod traits;
mod transform;

use super::{LoadOptions, Loaded, files};
use crate::error::{Error, Problem, Result};
use assets::Assets;
use builder::SceneFileBuilder;
use fields::{Fields, Problems};
use materials::Materials;
use std::path::{Path, PathBuf};
use textures::Textures;
use toml::Spanned;
use toml::de::DeTable;

/// Reads a scene file and the files that it refers to.
pub(super) fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    let mut loaded = Loaded::default();
    loaded.scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let text = TomlText::read(path, options)?;
    TomlFile::parse(&text).add_to(loaded, options, false)
}

/// The text of a scene file or a sidecar.
pub(in crate::load) struct TomlText {
    path: PathBuf,
    text: String,
}

impl TomlText {
    /// Reads a file.
    ///
    /// # Errors
    /// An input error if it can't be read or isn't UTF-8.
    fn read(path: &Path, options: &LoadOptions) -> Result<TomlText> {
        options.files.note(path);
        let bytes = files::read(path, files::MAX_TEXT).map_err(|message| Error::input(path, message))?;
        let text = String::from_utf8(bytes).map_err(|e| {
            let before = &e.as_bytes()[..e.utf8_error().valid_up_to()];
            let line = before.iter().filter(|&&b| b == b'\n').count() + 1;
            let problem =
                Problem::new(format!("line {line}"), "is not UTF-8 text").with_help("save the file as UTF-8");
            Error::input_problems(path, vec![problem])
        })?;
        // Editors of some systems begin a file with a byte order mark.
        let text = text.strip_prefix('\u{feff}').map(str::to_string).unwrap_or(text);
        Ok(TomlText { path: path.to_path_buf(), text })
    }
}

/// A scene file or a sidecar, parsed.
struct TomlFile<'t> {
    path: &'t Path,
    text: &'t str,
    root: Spanned<DeTable<'t>>,
    /// Syntax errors; `root` holds the tables that could be parsed.
    errors: Vec<toml::de::Error>,
}

impl TomlFile<'_> {
    fn parse(TomlText { path, text }: &TomlText) -> TomlFile<'_> {
        let (root, errors) = DeTable::parse_recoverable(text);
        TomlFile { path, text, root, errors }
    }

    /// The root table.
    fn root<'a>(&'a self, is_sidecar: bool, problems: &'a Problems<'a>) -> Fields<'a> {
        let what = if is_sidecar { "the file" } else { "the scene file" };
        Fields::new(what, self.root.get_ref(), 0..0, problems)
    }

    /// Adds the contents of the file to a scene: an empty one, or that of the model which a sidecar belongs to.
    ///
    /// # Errors
    /// All problems of the file.
    fn add_to(&self, mut loaded: Loaded, options: &LoadOptions, is_sidecar: bool) -> Result<Loaded> {
        let problems = Problems::new(self.text);
        if !self.errors.is_empty() {
            push_syntax_errors(self.text, &self.errors, &problems);
            problems.into_result(self.path, self.text)?;
            return Ok(loaded);
        }
        let root = self.root(is_sidecar, &problems);
        let model_settings = std::mem::take(&mut loaded.scene.settings);
        let shutter = camera::shutter_options(options.shutter, &root);
        let mut build = SceneFileBuilder::new(self.path, options, &problems, shutter, is_sidecar, loaded);
        read_parts(&mut build, &root);
        let mut loaded = build.loaded;
        loaded.scene.settings = loaded.scene.settings.or(&model_settings);
        problems.into_result(self.path, self.text)?;
        Ok(loaded)
    }
}

/// Reads all tables of a file. The order matters: lights may be removed by overrides of objects before the environment
/// stores the index of its sun, and cameras may come from mesh files that objects have loaded.
fn read_parts<'a>(build: &mut SceneFileBuilder, root: &Fields<'a>) {
    if !build.is_sidecar && !root.has("curves") {
        root.require("objects", root.list("objects"));
    }
    if let Some(fields) = root.table("render") {
        build.loaded.scene.settings = render_settings::read(build, &fields);
    }
    let mut assets = Assets::new(nodes::attribute_names(root));
    let mut textures = Textures::new(root.table("textures"));
    let mut materials = Materials::new(root.table("materials"));
    materials.override_model(build, &mut textures);
    objects::read(build, root, &mut materials, &mut textures, &mut assets);
    curves::read(build, root, &mut materials, &mut textures);
    lights::read(build, root);
    environment::read_portals(build, root);
    if let Some(fields) = root.table("environment") {
        environment::read(build, &fields, &mut textures);
    }
    nodes::warn_of_missing_attributes(build);
    traits::resolve_links(build);
    match build.is_sidecar {
        true => root.tables("camera").iter().for_each(|fields| camera::adjust(build, fields, &mut assets)),
        false => root.table("camera").iter().for_each(|fields| camera::read(build, fields, &mut assets)),
    }
    root.finish();
    materials.check_unused(build, &mut textures);
    textures.check_unused(build);
}

/// Reports TOML syntax errors.
fn push_syntax_errors(text: &str, errors: &[toml::de::Error], problems: &Problems) {
    for e in errors {
        let span = e.span().unwrap_or(0..0);
        match lacks_first_digit(text, span.start) {
            true => problems.push_help(span, e.message(), "numbers begin with a digit: 0.5, not .5"),
            false => problems.push(span, e.message()),
        }
    }
}

/// Is there a number such as `.5` at an offset of the text or one byte before?
fn lacks_first_digit(text: &str, offset: usize) -> bool {
    [Some(offset), offset.checked_sub(1)].into_iter().flatten().any(|start| {
        let (Some(before), Some(rest)) = (text.get(..start), text.get(start..)) else { return false };
        let is_first = !before.ends_with(|c: char| c.is_ascii_digit() || c == '.');
        is_first && rest.strip_prefix('.').is_some_and(|t| t.starts_with(|c: char| c.is_ascii_digit()))
    })
}
