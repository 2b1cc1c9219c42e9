//! Mesh files of a scene file, each read only once. Unused parts are skipped: materials that every object replaces, and
//! everything but cameras in files that no object places.

use super::builder::SceneFileBuilder;
use crate::error::{Error, Result, Warning};
use crate::load::formats::{self, Format};
use crate::load::{LoadOptions, Loaded, files, smooth};
use crate::math::DVec3;
use crate::scene::{
    Camera, Environment, Instance, MaterialId, Mesh, MeshId, MeshPart, Motion, Scene, Shape, ShapeKind,
    Texture, TextureId, Vertices,
};
use std::borrow::Cow;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The contents of a mesh file.
#[derive(Clone, Default)]
pub(super) struct Asset {
    /// Instances, with ids of the scene.
    pub instances: Vec<Instance>,
    /// Spheres of a point cloud, with ids of the scene.
    pub shapes: Vec<Shape>,
    cameras: Vec<Camera>,
    /// Material ids in the scene.
    pub materials: Range<u32>,
}

/// An instance with a list of materials, indexed by the `material_index` of faces.
#[derive(Clone)]
struct ListedMaterials {
    instance: usize,
    mesh: MeshId,
    /// Material id of `material_index` 0: the first of the mesh's file.
    first: u32,
    list: Vec<MaterialId>,
}

/// The mesh files read so far; `None` for those with problems.
#[derive(Default)]
pub(super) struct Assets {
    files: HashMap<PathBuf, Option<Asset>>,
    /// Files whose own materials some object keeps.
    with_materials: HashSet<PathBuf>,
    /// Files that some object subdivides.
    with_polygons: HashSet<PathBuf>,
    /// Copies of meshes with smooth normals, by mesh and bits of the crease angle.
    smooth: HashMap<(MeshId, u64), MeshId>,
    /// Vertex attributes that materials or textures may read.
    attributes: Arc<BTreeSet<String>>,
    listed: Vec<ListedMaterials>,
    /// Labels of the `mesh_keys` of deforming meshes.
    deformed: HashMap<MeshId, String>,
}

impl Assets {
    /// No files yet; `attributes` are the vertex attributes that materials or textures may read.
    pub fn new(attributes: BTreeSet<String>) -> Assets {
        Assets { attributes: Arc::new(attributes), ..Assets::default() }
    }

    /// Registers a file whose own materials are used. Call for all files before the first is read.
    pub fn expect_materials(&mut self, build: &SceneFileBuilder, name: &str) {
        self.with_materials.insert(key(&build.resolve_path(name)));
    }

    /// Registers a file that some object subdivides. Call for all files before the first is read.
    pub fn expect_polygons(&mut self, build: &SceneFileBuilder, name: &str) {
        self.with_polygons.insert(key(&build.resolve_path(name)));
    }

    /// The contents of a file, with smooth normals for a crease angle, radians; `None` after reporting problems.
    pub fn get(
        &mut self,
        build: &mut SceneFileBuilder,
        name: &str,
        span: Range<usize>,
        crease_rad: Option<f64>,
    ) -> Option<Cow<'_, Asset>> {
        let Some(crease_rad) = crease_rad else { return self.get_once(build, name, span).map(Cow::Borrowed) };
        let mut asset = self.get_once(build, name, span)?.clone();
        for instance in &mut asset.instances {
            let scene = &mut build.loaded.scene;
            let key = (instance.mesh, crease_rad.to_bits());
            instance.mesh = *self.smooth.entry(key).or_insert_with(|| smoothed(scene, key.0, crease_rad));
        }
        Some(Cow::Owned(asset))
    }

    fn get_once(&mut self, build: &mut SceneFileBuilder, name: &str, span: Range<usize>) -> Option<&Asset> {
        let path = build.readable_path(name, span.clone())?;
        let key = key(&path);
        if !self.files.contains_key(&key) {
            let geometry_only = !self.with_materials.contains(&key);
            if geometry_only {
                build.loaded.left_out.push(format!("materials of '{name}': every object replaces them"));
            }
            let loaded = self.read(build, &path, name, &span, geometry_only);
            let asset = loaded.map(|l| add_to_scene(build, &path, l));
            self.files.insert(key.clone(), asset);
        }
        self.files.get(&key)?.as_ref()
    }

    /// Records the material list of the next instance; `file_materials` are those of its file.
    ///
    /// # Errors
    /// A message, if faces have a `material_index` beyond the list.
    pub fn list_materials(
        &mut self,
        scene: &Scene,
        mesh: MeshId,
        file_materials: &Range<u32>,
        list: &[MaterialId],
    ) -> std::result::Result<(), String> {
        let material_index = |part: &MeshPart| part.material.0 - file_materials.start;
        let max = scene.meshes[mesh.index()].parts.iter().map(material_index).max().unwrap_or(0);
        if max as usize >= list.len() {
            let count = list.len();
            return Err(format!("'materials' has {count} names, but faces have the 'material_index' {max}"));
        }
        let (instance, list) = (scene.instances.len(), list.to_vec());
        self.listed.push(ListedMaterials { instance, mesh, first: file_materials.start, list });
        Ok(())
    }

    /// Repeats the lists of the `count` instances from `first` on for `copies` copies of them, which follow in order.
    pub fn copy_listed_materials(&mut self, first: usize, count: usize, copies: usize) {
        let originals: Vec<ListedMaterials> =
            self.listed.iter().filter(|listed| listed.instance >= first).cloned().collect();
        self.listed.truncate(self.listed.len() - originals.len());
        for copy in 0..copies {
            let entries = originals.iter().cloned();
            self.listed.extend(
                entries.map(|listed| ListedMaterials { instance: listed.instance + copy * count, ..listed }),
            );
        }
    }

    /// Assigns each instance with a material list a mesh with these materials. Call after reading all objects.
    pub fn apply_listed_materials(&mut self, scene: &mut Scene) {
        let listed = std::mem::take(&mut self.listed);
        if listed.is_empty() {
            return;
        }
        let with_list: HashSet<usize> = listed.iter().map(|entry| entry.instance).collect();
        let others = scene.instances.iter().enumerate().filter(|(i, _)| !with_list.contains(i));
        // Meshes that other instances or earlier lists use are cloned, others are changed in place.
        let mut in_use: HashSet<MeshId> = others.map(|(_, instance)| instance.mesh).collect();
        let mut original_parts: HashMap<MeshId, Vec<MeshPart>> = HashMap::new();
        let mut with_list_ids: HashMap<(MeshId, Vec<MaterialId>), MeshId> = HashMap::new();
        for ListedMaterials { instance, mesh, first, list } in listed {
            let original =
                original_parts.entry(mesh).or_insert_with(|| scene.meshes[mesh.index()].parts.clone());
            let with_material =
                |part: &MeshPart| MeshPart { material: list[(part.material.0 - first) as usize], ..*part };
            let parts: Vec<MeshPart> = original.iter().map(with_material).collect();
            let with_parts = || match in_use.insert(mesh) {
                true => {
                    scene.meshes[mesh.index()].parts = parts;
                    mesh
                }
                false => {
                    let copy = Mesh { parts, ..scene.meshes[mesh.index()].clone() };
                    let id = scene.add_mesh(copy);
                    let motion = scene.motion.meshes.get(&mesh.index()).cloned();
                    scene.motion.meshes.extend(motion.map(|keys| (id.index(), keys)));
                    id
                }
            };
            scene.instances[instance].mesh =
                *with_list_ids.entry((mesh, list.clone())).or_insert_with(with_parts);
        }
    }

    /// Whether the mesh has its `mesh_keys` already; objects share one mesh and its keys.
    ///
    /// # Errors
    /// A message, if another object has different keys for the mesh.
    pub fn has_mesh_keys(&mut self, mesh: MeshId, label: &str) -> std::result::Result<bool, String> {
        match self.deformed.get(&mesh) {
            Some(known) if known == label => Ok(true),
            Some(_) => {
                Err("another object has different 'mesh_keys' for this mesh: use a copy of the file"
                    .to_string())
            }
            None => {
                self.deformed.insert(mesh, label.to_string());
                Ok(false)
            }
        }
    }

    /// The vertices of a file with one mesh.
    pub fn vertices(&self, build: &mut SceneFileBuilder, name: &str, span: Range<usize>) -> Option<Vertices> {
        let path = build.readable_path(name, span.clone())?;
        let mut loaded = self.read(build, &path, name, &span, true)?;
        build.loaded.warnings.append(&mut loaded.warnings);
        let has_one_mesh = loaded.scene.instances.len() == 1 && loaded.offset == DVec3::ZERO;
        let Some(mesh) = loaded.scene.meshes.pop().filter(|_| has_one_mesh) else {
            let message = format!("'{name}': a file of 'mesh_keys' must contain one mesh, near its origin");
            build.problems.push(span, message);
            return None;
        };
        Some(Vertices { positions: mesh.positions, normals: mesh.normals })
    }

    /// The cameras of a file; reads nothing else if the file hasn't been loaded.
    pub fn cameras(
        &mut self,
        build: &mut SceneFileBuilder,
        name: &str,
        span: Range<usize>,
    ) -> Option<Vec<Camera>> {
        let path = build.readable_path(name, span.clone())?;
        if let Some(known) = self.files.get(&key(&path)) {
            return known.as_ref().map(|a| a.cameras.clone());
        }
        let mut loaded = self.read(build, &path, name, &span, true)?;
        build.loaded.warnings.append(&mut loaded.warnings);
        build.loaded.notes.append(&mut loaded.notes);
        build.loaded.left_out.push(format!("meshes of '{name}': only its camera is used"));
        Some(loaded.scene.cameras)
    }

    fn read(
        &self,
        build: &SceneFileBuilder,
        path: &Path,
        name: &str,
        span: &Range<usize>,
        geometry_only: bool,
    ) -> Option<Loaded> {
        let keeps_polygons = self.with_polygons.contains(&key(path));
        let attributes = Some(self.attributes.clone());
        let (shutter, options) = (build.shutter, build.options.clone());
        let options = LoadOptions { geometry_only, keeps_polygons, attributes, shutter, ..options };
        match read(path, &options) {
            Ok(loaded) => Some(loaded),
            Err(e) => {
                for problem in &e.problems {
                    build.problems.push_of_file(span.clone(), path, format!("'{name}': {problem}"));
                }
                None
            }
        }
    }
}

/// A copy of a mesh with smooth normals; the mesh itself if it has normals or deforms.
fn smoothed(scene: &mut Scene, id: MeshId, crease_rad: f64) -> MeshId {
    let mesh = &scene.meshes[id.index()];
    if !mesh.normals.is_empty() || scene.motion.meshes.contains_key(&id.index()) {
        return id;
    }
    let mut mesh = mesh.clone();
    smooth::smooth(&mut mesh, crease_rad);
    scene.add_mesh(mesh)
}

/// The canonical path, so that different spellings of a path share one entry.
fn key(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_path_buf())
}

fn read(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    // Only files named on the command line may be pipes; pipes named in a scene file could block.
    files::open(path).map_err(|message| Error::input(path, message))?;
    match formats::of(path) {
        Format::Model(model) => (model.load)(path, options),
        Format::SceneFile | Format::Blender | Format::Other => {
            let help = format!("use one of {}", formats::models_in_words());
            Err(Error::input(path, "is not a mesh file").with_help(help))
        }
    }
}

/// Adds a file's meshes, materials, textures and images to the scene; lights are dropped with a note.
fn add_to_scene(build: &mut SceneFileBuilder, path: &Path, mut loaded: Loaded) -> Asset {
    build.loaded.warnings.append(&mut loaded.warnings);
    build.loaded.notes.append(&mut loaded.notes);
    build.loaded.left_out.append(&mut loaded.left_out);
    let Scene { meshes, instances, mut shapes, materials, textures, images, cameras, motion, .. } =
        loaded.scene;
    let shape_count = shapes.len();
    // Other shapes of models are lights.
    shapes.retain(|shape| shape.kind == ShapeKind::Sphere);
    let lights = loaded.scene.lights.len() + loaded.scene.quads.len() + shape_count - shapes.len();
    if lights > 0 {
        let message =
            ("lights-left-out", format!("its {lights} lights are left out: a scene file lists its own"));
        build.loaded.notes.push(Warning::new(path, "", message));
    }
    if loaded.scene.environment != Environment::Black {
        let message = "its environment is left out: a scene file has its own [environment]";
        build.loaded.notes.push(Warning::new(path, "", message));
    }
    if !loaded.scene.curves.is_empty() {
        let message = "its lines are left out: add them as [[curves]] to the scene file";
        build.loaded.warnings.push(Warning::new(path, "", message));
    }
    let scene = &mut build.loaded.scene;
    let offset = IdOffsets {
        mesh: scene.meshes.len() as u32,
        material: scene.materials.len() as u32,
        texture: scene.textures.len() as u32,
        image: scene.images.len() as u32,
        motion: scene.motion.instances.len() as u32,
    };
    scene.images.extend(images);
    scene.textures.extend(textures.into_iter().map(|t| offset.texture(t)));
    for mut material in materials {
        material.parameters_mut(&mut |_, parameter| {
            if let Some(id) = parameter.texture() {
                id.0 += offset.texture;
            }
        });
        scene.materials.push(material);
    }
    build.loaded.polygons.append(loaded.polygons, offset.mesh, offset.material);
    let scene = &mut build.loaded.scene;
    for mut mesh in meshes {
        mesh.parts.iter_mut().for_each(|p| p.material.0 += offset.material);
        scene.meshes.push(mesh);
    }
    scene.motion.instances.extend(motion.instances);
    let deformed = motion.meshes.into_iter().map(|(i, keys)| (i + offset.mesh as usize, keys));
    scene.motion.meshes.extend(deformed);
    let materials = offset.material..scene.materials.len() as u32;
    let instances = instances.into_iter().map(|i| Instance {
        motion: offset.motion(i.motion),
        mesh: MeshId(i.mesh.0 + offset.mesh),
        material: i.material.map(|m| MaterialId(m.0 + offset.material)),
        ..i
    });
    let shapes =
        shapes.into_iter().map(|s| Shape { material: MaterialId(s.material.0 + offset.material), ..s });
    Asset { instances: instances.collect(), shapes: shapes.collect(), cameras, materials }
}

/// Offsets added to the ids of a loaded file.
struct IdOffsets {
    mesh: u32,
    material: u32,
    texture: u32,
    image: u32,
    motion: u32,
}

impl IdOffsets {
    fn motion(&self, motion: Motion) -> Motion {
        if let Motion::Keyed(number) = motion { Motion::Keyed(number + self.motion) } else { motion }
    }

    fn texture(&self, mut texture: Texture) -> Texture {
        match &mut texture {
            Texture::Image { image, .. } => image.0 += self.image,
            other => other.map_parts(|part| TextureId(part.0 + self.texture)),
        }
        texture
    }
}
