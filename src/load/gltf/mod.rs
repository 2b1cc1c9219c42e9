//! glTF 2.0, as `.gltf` with files beside it or as `.glb`. Objects are taken as the types of the `gltf` crate; what they
//! point to is checked here, because the crate's own reader trusts it.
//!
//! Only what the shown scene reaches is read: buffers, meshes, materials and images that nothing visible uses may even
//! be broken.
//!
//! Read: triangles of all modes, sparse and interleaved accessors, normals, tangents, texture coordinates, vertex
//! colours; metallic-roughness materials with emission, alpha and normal maps; cameras; the extensions listed in
//! `extensions.rs`. `extras` of the scene may hold `width`, `height` and `bounces`.

mod animation;
mod buffers;
mod document;
mod draco;
mod exported;
mod image_light;
mod lights;
mod materials;
mod meshes;
mod meshopt;
mod nodes;
mod place;
mod pointers;
mod report;
mod shutter;
mod textures;
mod vertices;

pub use crate::load::options::{Glass, GltfOptions, LightUnits};

pub(super) use exported::warn_of_losses;

use super::{EmptyNode, LoadOptions, Loaded};
use crate::error::{Error, Result, Warning};
use crate::scene::Scene;
use crate::simd::prefer_huge_pages;
use animation::Pose;
use document::{Document, pointer};
use nodes::Family;

use place::{Builder, Kept, StillMesh};
use pointers::Played;
use report::Report;
use serde_json::Value;
use shutter::Moments;
use std::io::Read;
use std::ops::ControlFlow;
use std::path::Path;

/// Loads a `.gltf` or `.glb` file (told apart by content).
///
/// # Errors
/// An input error with all the problems of what the shown scene reaches.
pub(super) fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    let mut only = Loaded::default();
    load_moments(path, options, [options.gltf.time_s], &mut |loaded| {
        only = std::mem::take(loaded);
        Ok(ControlFlow::Break(()))
    })?;
    Ok(only)
}

/// Loads a file and hands its scene at each moment to `each`, until that breaks off. The file, its images, its materials
/// and the meshes that nothing deforms are read once; `each` may change what it gets, but the scene's first meshes must
/// stay what they are.
///
/// # Errors
/// An input error with all the problems of what the shown scene reaches, and the errors of `each`.
pub(super) fn load_moments(
    path: &Path,
    options: &LoadOptions,
    moments: impl IntoIterator<Item = Option<f64>>,
    each: &mut dyn FnMut(&mut Loaded) -> Result<ControlFlow<()>>,
) -> Result<()> {
    options.files.note(path);
    let bytes = read_file(path).map_err(|e| Error::input(path, format!("can't be read: {e}")))?;
    let parts = document::open(path, &bytes)?;
    let mut doc = Document::new(path, parts, bytes.len(), options);
    let (mut report, mut kept) = (Report::new(path), Kept::default());
    kept.materials.geometry_only = options.geometry_only;
    let mut played = Played::default();
    for time_s in moments {
        let mut read = |kept: &mut Kept| {
            report.begin_moment();
            doc.begin_moment();
            played.play(&mut doc, time_s, kept, &mut report);
            let moments = Moments::read(&doc, time_s, options, kept, &mut report);
            at(&doc, time_s, moments.as_ref(), kept, &mut report)
        };
        let mut moment = read(&mut kept)?;
        if kept.forget_lost_textures() {
            moment = read(&mut kept)?;
        }
        let (mut loaded, still) = moment;
        if each(&mut loaded)?.is_break() {
            break;
        }
        kept.take_back(&mut loaded.scene, still);
    }
    Ok(())
}

/// All bytes of a file.
fn read_file(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut file = std::fs::File::open(path)?;
    let mut bytes = Vec::new();
    // The length is a guess only: what the file really holds is read.
    let length = file.metadata().map_or(0, |m| m.len());
    if bytes.try_reserve_exact(usize::try_from(length).unwrap_or(0)).is_ok() {
        prefer_huge_pages(&mut bytes);
    }
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The scene at a moment, seconds; `None` is the file's rest state.
fn at(
    doc: &Document,
    time_s: Option<f64>,
    moments: Option<&Moments>,
    kept: &mut Kept,
    report: &mut Report,
) -> Result<(Loaded, Vec<StillMesh>)> {
    document::check(doc, report);
    meshes::check_variant(doc, report);
    let pose = time_s.map_or_else(Pose::default, |time_s| animation::pose(doc, time_s, report));
    let family = Family::new(doc, &pose);
    let hierarchy = nodes::walk(doc, &pose, &family, report);
    let mut builder = Builder::new(doc, &pose, &family, kept).one_of_many(moments.is_some());
    builder.add(&hierarchy, report);
    let empty = |(index, name, world_from_node)| {
        let motion = moments.and_then(|moments| moments.empty(index, &world_from_node));
        EmptyNode { name, world_from_node, motion }
    };
    let empties = hierarchy.empties(doc).into_iter().map(empty).collect();
    let left_out = left_out(doc, &builder, hierarchy.scene, &pose);
    let has_area_lights = builder.has_area_lights();
    let (mut scene, still) = builder.finish(report);
    image_light::light(doc, hierarchy.scene, (&mut scene, kept), report);
    moments.into_iter().for_each(|moments| moments.tell(&mut scene, report));
    read_scene(doc, hierarchy.scene, &mut scene, report);
    let blender = exported::signs_of_loss(doc, &hierarchy, &scene, &kept.materials.signs, report);
    document::warn_unread(doc, report);
    let problems = report.take_problems();
    if !problems.is_empty() {
        return Err(Error::input_problems(doc.path, problems));
    }
    let named = |list: Vec<Warning>| {
        list.into_iter().map(|said| Warning { place: doc.in_names(&said.place), ..said }).collect()
    };
    let (warnings, notes) = (named(report.warnings()), named(report.notes()));
    let stand_ins = materials::stand_ins(&scene.materials);
    let said = Loaded { warnings, notes, left_out, ..Loaded::default() };
    let loaded = Loaded { scene, empties, blender, has_area_lights, stand_ins, ..said };
    Ok((loaded, still))
}

/// What the scene's `extras` say about the picture.
fn read_scene(doc: &Document, index: Option<usize>, scene: &mut Scene, report: &mut Report) {
    let Some(raw) = index.and_then(|i| doc.json.pointer(&pointer("scenes", i))) else { return };
    scene.name = raw.get("name").and_then(Value::as_str).unwrap_or_default().to_string();
    let mut setting = |key: &str, least: u64| {
        let value = raw.get("extras")?.get(key)?;
        let number = value.as_u64().filter(|n| *n >= least).and_then(|n| u32::try_from(n).ok());
        if number.is_none() {
            let at = format!("{}/extras/{key}", pointer("scenes", index.unwrap_or_default()));
            report.warn(at, format!("{value} is no usable number and ignored"));
        }
        number
    };
    scene.settings.width = setting("width", 1);
    scene.settings.height = setting("height", 1);
    scene.settings.depth = setting("bounces", 0);
}

/// What was not read because nothing that is seen uses it.
fn left_out(doc: &Document, builder: &Builder, scene: Option<usize>, pose: &Pose) -> Vec<String> {
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
        unused(pose.animations, "animations", "no time is asked for; the file's rest state is shown"),
    ]
    .into_iter()
    .flatten()
    .collect()
}
