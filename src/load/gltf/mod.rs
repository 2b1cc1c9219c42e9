//! glTF 2.0, as `.gltf` with files beside it or as `.glb`. Objects are taken as the types of the `gltf` crate; what they
//! point to is checked here, because the crate's own reader trusts it.
//!
//! Only what the shown scene reaches is read: buffers, meshes, materials and images that nothing visible uses may even
//! be broken.
//!
//! Read: triangles of all modes, sparse and interleaved accessors, normals, tangents, texture coordinates, vertex
//! colours; metallic-roughness materials with emission, alpha and normal maps; cameras; the extensions listed in
//! `extensions.rs`. `extras` of the scene may hold `width`, `height` and `bounces`.

mod accessor;
mod buffers;
mod cameras;
mod container;
mod document;
mod extensions;
mod images;
mod materials;
mod meshes;
mod nodes;
mod repair;
mod textures;
mod triangles;

use super::{LoadOptions, Loaded};
use crate::error::{Error, Result};
use crate::scene::{Instance, MeshId, Scene};
use document::{Document, Report, pointer};
use materials::Materials;
use meshes::Skipped;
use nodes::Hierarchy;
use serde_json::Value;
use std::collections::HashMap;
use std::path::Path;

/// Loads a `.gltf` or `.glb` file (told apart by content).
///
/// # Errors
/// An input error with all the problems of what the shown scene reaches.
pub(super) fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    let bytes = std::fs::read(path).map_err(|e| Error::input(path, format!("can't be read: {e}")))?;
    let parts = container::open(path, &bytes)?;
    let doc = Document::new(path, parts, bytes.len(), options.allow_external);
    let mut report = Report::new(path);
    extensions::check(&doc, &mut report);
    let hierarchy = nodes::walk(&doc, &mut report);
    let mut materials = Materials::default();
    materials.geometry_only = options.geometry_only;
    let mut builder = Builder { doc: &doc, scene: Scene::default(), materials };
    let used_meshes = builder.add_meshes(&hierarchy, &mut report);
    builder.add_cameras_and_lights(&hierarchy, &mut report);
    let Builder { mut scene, materials, .. } = builder;
    let left_out = left_out(&doc, used_meshes, &materials);
    scene.images = images::read(&doc, &materials.textures.images, &mut report);
    scene.materials = materials.list;
    scene.textures = materials.textures.list;
    read_scene(&doc, hierarchy.scene, &mut scene, &mut report);
    extensions::warn_unread(&doc, &mut report);
    let problems = report.take_problems();
    if !problems.is_empty() {
        return Err(Error::input_problems(path, problems));
    }
    Ok(Loaded { scene, warnings: report.into_warnings(), left_out })
}

/// The scene being put together.
struct Builder<'b, 'a> {
    doc: &'b Document<'a>,
    scene: Scene,
    materials: Materials,
}

impl Builder<'_, '_> {
    /// Reads the meshes of all nodes, each once, and places them; gives how many of the file's meshes that were.
    fn add_meshes(&mut self, hierarchy: &Hierarchy, report: &mut Report) -> usize {
        let mut known: HashMap<usize, Vec<MeshId>> = HashMap::new();
        let mut skipped = Skipped::default();
        let mut skinned = 0usize;
        for (entry, node) in hierarchy.nodes.iter().enumerate() {
            let Some(index) = node.mesh else { continue };
            if node.world_from_node.matrix3.determinant() == 0.0 {
                report.warn(node.pointer(), "flattens its mesh to nothing (a scale of 0); it is left out");
                continue;
            }
            let meshes = known.entry(index).or_insert_with(|| {
                let from = format!("{}/mesh", node.pointer());
                let materials = &mut self.materials;
                let meshes = meshes::read(self.doc, index, &from, materials, &mut skipped, report);
                let first = self.scene.meshes.len() as u32;
                self.scene.meshes.extend(meshes);
                (first..self.scene.meshes.len() as u32).map(MeshId).collect()
            });
            skinned += usize::from(node.skinned && !meshes.is_empty());
            for &mesh in meshes.iter() {
                let name = hierarchy.path(self.doc, entry);
                let world_from_object = node.world_from_node;
                self.scene.instances.push(Instance { name, mesh, world_from_object, material: None });
            }
        }
        warn_skipped(&skipped, skinned, report);
        known.len()
    }

    fn add_cameras_and_lights(&mut self, hierarchy: &Hierarchy, report: &mut Report) {
        for node in &hierarchy.nodes {
            if let Some(index) = node.camera {
                self.scene.cameras.extend(cameras::camera(self.doc, node, index, report));
            }
            if let Some(index) = node.light {
                self.scene.lights.extend(cameras::light(self.doc, node, index, report));
            }
        }
        let count = self.scene.lights.len();
        if count > 0 {
            let blender = self.doc.json.pointer("/asset/generator").and_then(Value::as_str);
            let origin = match blender.filter(|g| g.contains("Blender I/O")) {
                Some(_) => ", Blender's default for exporting watts",
                None => "",
            };
            let units = cameras::LUMENS_PER_WATT;
            let message = format!("intensities of {count} lights were divided by {units} lm/W{origin}");
            report.warn(format!("/{}", cameras::LIGHTS), message);
        }
    }
}

fn warn_skipped(skipped: &Skipped, skinned: usize, report: &mut Report) {
    let mut warn = |count: usize, what: &str| {
        if count > 0 {
            report.warn("/meshes", format!("{count} {what}"));
        }
    };
    warn(skipped.points, "primitives are points, which have no surface, and are skipped");
    warn(skipped.lines, "primitives are lines, which have no surface, and are skipped");
    warn(skipped.morphs, "primitives have morph targets; they are shown without");
    warn(skinned, "placed meshes have skins; they are shown in the pose in which they were modelled");
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
fn left_out(doc: &Document, used_meshes: usize, materials: &Materials) -> Vec<String> {
    let mut images: Vec<usize> = materials.textures.images.iter().map(|need| need.index).collect();
    images.sort_unstable();
    images.dedup();
    let used_buffers = doc.buffers.iter().filter(|b| b.get().is_some()).count();
    let unused = |used: usize, kind: &str, why: &str| {
        let total = doc.count(kind);
        (used < total).then(|| format!("{} of {total} {kind}: {why}", total - used))
    };
    [
        unused(used_meshes, "meshes", "no visible node uses them"),
        unused(materials.used(), "materials", "nothing visible uses them"),
        unused(images.len(), "images", "no visible material uses them; not decoded"),
        unused(used_buffers, "buffers", "nothing visible uses them; not read"),
        unused(0, "animations", "the file's rest state is shown"),
    ]
    .into_iter()
    .flatten()
    .collect()
}
