//! Scene files: TOML that places meshes and analytic shapes, with cameras, materials, textures and settings.
//!
//! | Part | Chapter of this reference |
//! |---|---|
//! | `[camera]`, `[[camera]]` | `camera` |
//! | `[environment]` | `environment` |
//! | `[render]` | `render` |
//! | `[textures.NAME]` | `textures` |
//! | `[materials.NAME]` | `materials`, `media` |
//! | `[[objects]]` | `objects`, `subdivision`, `transform`, `motion` |
//! | `[[curves]]` | `curves` |
//! | `[[lights]]` | `lights` |
//! | `[[portals]]` | `portals` |
//!
//! Angles are in degrees, lengths in metres, colours linear Rec. 709, and paths relative to the scene file. All
//! problems of the file are reported at once, with their lines and, for a misspelt name, the nearest one that exists.
//! Unused parts are not loaded. A `sidecar` file next to a model adds data that the model's format can't store.
//!
//! # sidecar
//!
//! `model.oscura.toml` next to `model.glb`: data that the model's format can't store. It has the parts of scene files, all
//! optional, which are added to the model:
//!
//! | Part | Effect |
//! |---|---|
//! | `[environment]` | the environment |
//! | `[[lights]]`, `[[objects]]` | additional lights and objects, with `[materials.NAME]` and `[textures.NAME]` |
//! | `[materials.NAME]` of a material of the model | with a `type` replaces it, else changes its parameters by the keys of type `pbr`; `alpha` = `"opaque"`, `"mask"` or `"blend"` sets its alpha mode; `visible_to_camera` = false hides it from camera rays only; `visible_to` lists the kinds of rays that hit it, as for objects of scene files |
//! | `[objects.NAME]` | changes a node of the model and its descendants: `hidden = true` removes them (lights, too), `material = "NAME"` assigns a material of the file or of the model, `light_group = "NAME"` puts their lights and emissive surfaces into a group; `subdivide = N` subdivides their meshes, as for objects of scene files; `visible_to`, `visible_to_camera`, `holdout`, `shadow_catcher`, `light_link` and `shadow_link` as for objects of scene files; a name with a leading slash is that of a root node; in `[[objects]]`, `node = "NAME"` names the node |
//! | `[camera]` with `look_from` or `transform` | a camera that precedes those of the model |
//! | `[camera]` otherwise | changes the model's cameras, or only that called `name`: depth of field, `shift` and `type` with its keys (panoramas ...), as in scene files; `shutter` and `shutter_position`; `default = true` puts it first; `width`, `height` |
//! | `[[camera]]` | the same for several cameras, each with its name |
//! | `[[portals]]` | portals for sampling the environment |
//! | `[render]` | render settings |

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
mod render_settings;
mod shaders;
mod textures;
mod traits;
mod transform;

use super::{LoadOptions, Loaded, files};
use crate::error::{Choice, Error, Problem, Result, Warning};
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

/// The tables of a scene file.
const TABLES: [&str; 9] =
    ["camera", "curves", "environment", "lights", "materials", "objects", "portals", "render", "textures"];

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
        // Some editors begin files with a byte order mark.
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

    /// Whether the file belongs to another program: more than two tables, and none of a scene's. Fewer may be misspelt.
    fn is_foreign(&self) -> bool {
        let names = || self.root.get_ref().iter().map(|(key, _)| key.get_ref().as_ref());
        names().count() > 2 && !names().any(|name: &str| TABLES.contains(&name))
    }

    /// Adds the contents of the file to `loaded`: an empty scene, or the model of a sidecar.
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
        if !is_sidecar && self.is_foreign() {
            let message = "is not a scene file: it has no tables of a scene";
            return Err(Error::input(self.path, message)
                .with_help("'oscura new first.toml' writes one to start from"));
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
    let read_camera = if build.is_sidecar { camera::adjust } else { camera::read };
    root.tables("camera").iter().for_each(|fields| read_camera(build, fields, &mut assets));
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

/// Whether a number such as `.5` starts at a byte offset of the text or one byte before.
fn lacks_first_digit(text: &str, offset: usize) -> bool {
    [Some(offset), offset.checked_sub(1)].into_iter().flatten().any(|start| {
        let (Some(before), Some(rest)) = (text.get(..start), text.get(start..)) else { return false };
        let is_first = !before.ends_with(|c: char| c.is_ascii_digit() || c == '.');
        is_first && rest.strip_prefix('.').is_some_and(|t| t.starts_with(|c: char| c.is_ascii_digit()))
    })
}

/// Whether a file has the required tables of a scene and is not a sidecar.
pub(super) fn is_scene(path: &Path) -> bool {
    let is_sidecar = path.to_string_lossy().ends_with(".oscura.toml");
    let Some(text) = TomlText::read(path, &LoadOptions::default()).ok().filter(|_| !is_sidecar) else {
        return false;
    };
    let file = TomlFile::parse(&text);
    ["objects", "curves"].iter().any(|name| file.root.get_ref().contains_key(*name))
}

/// Whether a scene file sets `denoise`. Problems of the file are reported when it is loaded.
pub(super) fn requests_denoising(path: &Path) -> bool {
    let Ok(text) = TomlText::read(path, &LoadOptions::default()) else { return false };
    let file = TomlFile::parse(&text);
    let render = file.root.get_ref().get("render").and_then(|table| table.get_ref().as_table());
    render.and_then(|table| table.get("denoise")?.get_ref().as_bool()) == Some(true)
}

/// The path of a model's sidecar: the extension replaced by `.oscura.toml`.
pub fn sidecar_path(model: &Path) -> PathBuf {
    model.with_extension("oscura.toml")
}

/// The text of a model's sidecar; `None` if there is none.
///
/// # Errors
/// An input error if the file can't be read or isn't UTF-8.
pub(in crate::load) fn sidecar_text(model: &Path, options: &LoadOptions) -> Result<Option<TomlText>> {
    let path = sidecar_path(model);
    options.files.note(&path);
    path.is_file().then(|| TomlText::read(&path, options)).transpose()
}

/// The parsed sidecar of a model.
pub(in crate::load) struct Sidecar<'t> {
    file: TomlFile<'t>,
}

impl<'t> Sidecar<'t> {
    /// Parses the file; [`Sidecar::apply`] reports syntax errors.
    pub fn parse(text: &'t TomlText) -> Sidecar<'t> {
        Sidecar { file: TomlFile::parse(text) }
    }

    /// The options with the sidecar's settings for the model's reader: shutter, empty nodes with lights, and subdivision.
    /// [`Sidecar::apply`] reports problems.
    pub fn reader_options(&self, options: &LoadOptions) -> LoadOptions {
        let problems = Problems::new(self.file.text);
        let root = self.file.root(true, &problems);
        let shutter = camera::shutter_options(options.shutter, &root);
        let lit_nodes = options.lit_nodes.iter().cloned().chain(transform::nodes_of_lights(&root)).collect();
        let keeps_polygons = options.keeps_polygons || objects::uses_subdivision(&root);
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
        format!("the sidecar of the model was used: {used} ({} ignores it)", Choice::NoSidecar)
    }
}

// The scene file reference (`oscura help`, the guide) is the module documentation of the parsers;
// `tests/loading/scene_reference/` compares it with the keys that the parsers accept.

/// One chapter of the reference.
#[derive(Clone, Copy, Debug)]
pub struct Chapter {
    /// The table or topic, as written in a scene file.
    pub title: &'static str,
    sections: &'static [Section],
}

/// Module documentation of a source file from a heading (`//! # heading`) to the next one.
#[derive(Clone, Copy, Debug)]
struct Section {
    source: &'static str,
    /// Empty: the text before the first heading.
    heading: &'static str,
}

const fn section(source: &'static str, heading: &'static str) -> Section {
    Section { source, heading }
}

const fn chapter(title: &'static str, sections: &'static [Section]) -> Chapter {
    Chapter { title, sections }
}

/// All chapters, in the order of a scene file.
pub const CHAPTERS: &[Chapter] = &[
    chapter("scene files", &[section(include_str!("mod.rs"), "")]),
    chapter("[camera]", &[section(include_str!("camera.rs"), "")]),
    chapter("[environment]", &[section(include_str!("environment.rs"), "")]),
    chapter("media", &[section(include_str!("media.rs"), "")]),
    chapter("[render]", &[section(include_str!("render_settings.rs"), "")]),
    chapter("[textures]", &[section(include_str!("textures.rs"), "")]),
    chapter("[materials]", &[section(include_str!("materials.rs"), ""), section(include_str!("pbr.rs"), "")]),
    chapter("[[objects]]", &[section(include_str!("objects.rs"), "")]),
    chapter("subdivision", &[section(include_str!("objects.rs"), "subdivision")]),
    chapter("[[curves]]", &[section(include_str!("curves.rs"), "")]),
    chapter("transform", &[section(include_str!("transform.rs"), "")]),
    chapter("motion", &[section(include_str!("transform.rs"), "motion")]),
    chapter(
        "[[lights]]",
        &[section(include_str!("lights.rs"), ""), section(include_str!("traits.rs"), "linking")],
    ),
    chapter("[[portals]]", &[section(include_str!("environment.rs"), "portals")]),
    chapter("sidecar", &[section(include_str!("mod.rs"), "sidecar")]),
];

impl Chapter {
    /// The text in markdown.
    pub fn markdown(&self) -> String {
        self.sections.iter().map(Section::markdown).collect::<Vec<_>>().join("\n\n")
    }

    /// Finds a chapter by its title, with or without brackets.
    pub fn find(title: &str) -> Option<&'static Chapter> {
        CHAPTERS.iter().find(|c| c.name() == title || c.title == title)
    }

    /// The title without brackets.
    pub fn name(&self) -> &'static str {
        self.title.trim_matches(['[', ']'])
    }
}

impl Section {
    fn markdown(&self) -> String {
        let lines = self.source.lines().map_while(|l| l.strip_prefix("//!"));
        let lines = lines.map(|l| l.strip_prefix(' ').unwrap_or(l));
        let mut heading = "";
        let lines = lines.filter(|line| {
            let next = line.strip_prefix("# ");
            heading = next.unwrap_or(heading);
            next.is_none() && heading == self.heading
        });
        let text = lines.collect::<Vec<_>>().join("\n");
        // Links to sibling modules become their names.
        text.replace("[`super::", "`").replace("`super::", "`").replace("`]", "`").trim().to_string()
    }
}
