//! glTF 2.0: `.gltf` with separate files, or `.glb`. Objects are deserialized as types of the `gltf` crate; references
//! are checked here, because the crate's own reader doesn't check them.
//!
//! Only objects used by visible nodes are read; unused buffers, meshes, materials and images may be broken.
//!
//! Supported: triangles of all modes, sparse and interleaved accessors, normals, tangents, texture coordinates, vertex
//! colours; metallic-roughness materials with emission, alpha and normal maps; cameras; the extensions listed in
//! `document.rs`. `extras` of the scene may contain `width`, `height` and `bounces`.

mod animation;
mod blender_export;
mod buffers;
mod document;
mod draco;
mod image_light;
mod lights;
mod materials;
mod meshes;
mod meshopt;
mod nodes;
mod pointers;
mod points_lines;
mod report;
mod scene_builder;
mod shutter;
mod textures;
mod vertices;

pub use crate::load::options::{Glass, GltfOptions, LightUnits};

pub(super) use blender_export::warn_of_losses;

use super::{EmptyNode, LoadOptions, Loaded, files};
use crate::error::{Error, Result, Warning};
use crate::scene::Scene;
use animation::Pose;
use document::{Document, pointer};
use nodes::NodeParents;

use pointers::PointerAnimation;
use report::Report;
use scene_builder::{SceneBuilder, SharedAssets, StaticMesh};
use serde_json::Value;
use shutter::ShutterSamples;
use std::ops::ControlFlow;
use std::path::Path;

/// Loads a `.gltf` or `.glb` file (distinguished by content).
///
/// # Errors
/// An input error with all problems of the visible objects.
pub(super) fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    let mut only = Loaded::default();
    load_times(path, options, [options.gltf.time_s], &mut |loaded| {
        only = std::mem::take(loaded);
        Ok(ControlFlow::Break(()))
    })?;
    Ok(only)
}

/// Loads a file and calls `each` with its scene at each time, until it breaks. The file, images, materials and meshes
/// without deformation are read once; `each` may change its argument except for these meshes, the first of the scene.
///
/// # Errors
/// An input error with all problems of the visible objects, and the errors of `each`.
pub(super) fn load_times(
    path: &Path,
    options: &LoadOptions,
    times: impl IntoIterator<Item = Option<f64>>,
    each: &mut dyn FnMut(&mut Loaded) -> Result<ControlFlow<()>>,
) -> Result<()> {
    options.files.note(path);
    let bytes = files::read_model(path)?;
    let parts = document::open(path, &bytes)?;
    let repaired = parts.repaired;
    let mut doc = Document::new(path, parts, bytes.len(), options);
    let (mut report, mut shared) = (Report::new(path), SharedAssets::default());
    if repaired > 0 {
        let message = format!("its JSON holds {repaired} non-finite numbers (NaN, Infinity), which became 0");
        report.lasting(|report| report.warn("", ("json-not-a-number", message)));
    }
    shared.materials.geometry_only = options.geometry_only;
    let mut pointer_animation = PointerAnimation::default();
    for time_s in times {
        let mut read = |shared: &mut SharedAssets| {
            report.begin_time();
            doc.begin_time();
            pointer_animation.play(&mut doc, time_s, shared, &mut report);
            let times = ShutterSamples::read(&doc, time_s, options, shared, &mut report);
            at(&doc, options, time_s, times.as_ref(), shared, &mut report)
        };
        let mut at_time = read(&mut shared)?;
        if shared.forget_unreadable_images() {
            at_time = read(&mut shared)?;
        }
        let (mut loaded, static_meshes) = at_time;
        if each(&mut loaded)?.is_break() {
            break;
        }
        shared.take_back(&mut loaded.scene, static_meshes);
    }
    Ok(())
}

/// The scene at a time, seconds; `None` for the file's rest pose.
fn at(
    doc: &Document,
    options: &LoadOptions,
    time_s: Option<f64>,
    times: Option<&ShutterSamples>,
    shared: &mut SharedAssets,
    report: &mut Report,
) -> Result<(Loaded, Vec<StaticMesh>)> {
    document::check(doc, report);
    meshes::check_variant(doc, report);
    let pose = time_s.map_or_else(Pose::default, |time_s| animation::pose(doc, time_s, report));
    let node_parents = NodeParents::new(doc, &pose);
    let hierarchy = nodes::walk(doc, &pose, &node_parents, report);
    let mut builder = SceneBuilder::new(doc, &pose, &node_parents, shared).for_shutter(times.is_some());
    builder.add(&hierarchy, report);
    let empty = |(index, name, world_from_node)| {
        let motion = times.and_then(|times| times.empty(index, &world_from_node));
        EmptyNode { name, world_from_node, motion }
    };
    let empties = hierarchy.empties(doc).into_iter().map(empty).collect();
    let left_out = left_out(doc, &builder, hierarchy.scene, &pose);
    let has_area_lights = builder.has_area_lights();
    let points_and_lines = std::mem::take(&mut builder.points_and_lines);
    let (mut scene, static_meshes) = builder.finish(report);
    image_light::light(doc, hierarchy.scene, (&mut scene, shared), report);
    times.into_iter().for_each(|times| times.apply(&mut scene, report));
    read_scene_extras(doc, hierarchy.scene, &mut scene, report);
    let blender =
        blender_export::blender_losses(doc, &hierarchy, &scene, &shared.materials.export_losses, report);
    document::warn_of_unsupported(doc, report);
    let problems = report.take_problems();
    if !problems.is_empty() {
        return Err(Error::input_problems(doc.path, problems));
    }
    let with_names = |list: Vec<Warning>| {
        list.into_iter().map(|found| Warning { place: doc.in_names(&found.place), ..found }).collect()
    };
    let (warnings, notes) = (with_names(report.warnings()), with_names(report.notes()));
    let default_materials = materials::default_materials(&scene.materials);
    let messages = Loaded { warnings, notes, left_out, ..Loaded::default() };
    let mut loaded = Loaded { scene, empties, blender, has_area_lights, default_materials, ..messages };
    points_and_lines.add(doc, options, &mut loaded)?;
    Ok((loaded, static_meshes))
}

/// Image settings in the scene's `extras`.
fn read_scene_extras(doc: &Document, index: Option<usize>, scene: &mut Scene, report: &mut Report) {
    let Some(raw) = index.and_then(|i| doc.json.pointer(&pointer("scenes", i))) else { return };
    scene.name = raw.get("name").and_then(Value::as_str).unwrap_or_default().to_string();
    let mut setting = |key: &str, min: u64| {
        let value = raw.get("extras")?.get(key)?;
        let number = value.as_u64().filter(|n| *n >= min).and_then(|n| u32::try_from(n).ok());
        if number.is_none() {
            let at = format!("{}/extras/{key}", pointer("scenes", index.unwrap_or_default()));
            report.warn(at, format!("{value} is not a valid number; ignored"));
        }
        number
    };
    scene.settings.width = setting("width", 1);
    scene.settings.height = setting("height", 1);
    scene.settings.depth = setting("bounces", 0);
}

/// Descriptions of the parts of the file that were not read because nothing visible uses them.
fn left_out(doc: &Document, builder: &SceneBuilder, scene: Option<usize>, pose: &Pose) -> Vec<String> {
    let mut images = builder.images();
    images.extend(image_light::images_of(doc, scene));
    let used_buffers = doc.buffers.iter().filter(|b| b.get().is_some()).count();
    let unused = |used: usize, kind: &str, why: &str| {
        let total = doc.count(kind);
        (used < total).then(|| format!("{} of {total} {kind}: {why}", total - used))
    };
    [
        unused(builder.used_meshes(), "meshes", "no visible node uses them"),
        unused(builder.used_materials(), "materials", "nothing visible uses them"),
        unused(images.len(), "images", "no visible material uses them; not decoded"),
        unused(used_buffers, "buffers", "nothing visible uses them; not read"),
        unused(pose.animations, "animations", "no time is set; the rest pose is shown"),
    ]
    .into_iter()
    .flatten()
    .collect()
}
