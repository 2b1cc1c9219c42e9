//! 3MF: a ZIP package (ECMA-376, part 2) with an XML model, in physical units, z up; build items place objects.
//!
//! Supported: meshes, components, several model parts (production extension), base materials, corner colours, textures. Beams,
//! slices, composite materials and layered properties cause a warning. Support structures for printing are skipped.

mod model;

use super::image::{ImageFile, OnDamage, Use, for_texture};
use super::mesh_tools::{NAMELESS, Repairs};
use super::zip::Archive;
use super::{LoadOptions, Loaded, Up, UpHint};
use crate::error::{Error, Message, Problem, Result, Warning};
use crate::image::Damage;
use crate::math::{DAffine3, DVec3};
use crate::scene::{
    ColorSlot, Instance, Interpolation, Mapping, Material, MaterialId, Mesh, MeshId, MeshPart,
    Model as Surface, Texture, Wrap,
};
use model::{Group, Model, Object, Property, Reference, TextureFile, Triangle};
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;

/// Default path of the start part.
const START: &str = "3D/3dmodel.model";
/// Suffix of the relationship type of the start part.
const START_TYPE: &str = "/3dmodel";
/// Maximum depth of nested components.
const MAX_DEPTH: usize = 64;
/// Maximum number of placed objects.
const MAX_INSTANCES: usize = 1 << 20;
/// Linear grey of triangles without a colour in a mesh where duplicates have one.
const GREY: [f32; 4] = [0.8, 0.8, 0.8, 1.0];

/// Reads a 3MF file.
///
/// # Errors
/// An input error if the file is damaged or has no visible objects.
pub(super) fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    options.files.note(path);
    let archive = Archive::open(path)?;
    options.counter.begin(archive.size() as u64);
    let mut reader = Reader::new(path, options, archive);
    let start = reader.start_part();
    let root = reader.model(&start)?;
    for item in &root.items {
        reader.place(&start, item, DAffine3::from_scale(DVec3::splat(root.metres)), 0)?;
    }
    let Reader { mut loaded, repairs, unsupported, supports, invalid_triangles, .. } = reader;
    loaded.warnings.extend(repairs.warnings(path));
    let mut warn = |message: String| loaded.warnings.push(Warning::new(path, "", message));
    if invalid_triangles > 0 {
        warn(format!("{invalid_triangles} triangles with a missing vertex: left out"));
    }
    unsupported.iter().for_each(|what| warn(format!("{what} are not supported")));
    if supports > 0 {
        loaded.left_out.push(format!("{supports} support structures for printing"));
    }
    if loaded.scene.instances.is_empty() {
        let what = if unsupported.is_empty() {
            String::new()
        } else {
            format!(": {} are not supported", unsupported.join(", "))
        };
        let help = "the file's build has no object with triangles";
        return Err(
            Error::input(path, ("no-surface", format!("has nothing to render{what}"))).with_help(help)
        );
    }
    loaded.up_hint = UpHint { writer: Some((Up::Z, "the 3MF specification")), is_mostly_y: false };
    loaded.scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(loaded)
}

/// Appearance of triangles.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum Appearance {
    Plain,
    Colors,
    /// A texture of the part.
    Texture(u32),
}

struct Reader<'a> {
    path: &'a Path,
    options: &'a LoadOptions,
    archive: Archive,
    loaded: Loaded,
    models: HashMap<String, Rc<Model>>,
    /// Meshes by part and object id; `None` for objects without triangles.
    meshes: HashMap<(String, u32), Option<MeshId>>,
    /// Materials by part and appearance.
    materials: HashMap<(String, Appearance), MaterialId>,
    repairs: Repairs,
    unsupported: Vec<String>,
    supports: usize,
    invalid_triangles: usize,
}

impl<'a> Reader<'a> {
    fn new(path: &'a Path, options: &'a LoadOptions, archive: Archive) -> Reader<'a> {
        Reader {
            path,
            options,
            archive,
            loaded: Loaded::default(),
            models: HashMap::new(),
            meshes: HashMap::new(),
            materials: HashMap::new(),
            repairs: Repairs::default(),
            unsupported: Vec::new(),
            supports: 0,
            invalid_triangles: 0,
        }
    }

    fn fail(&self, place: &str, message: impl Into<Message>) -> Error {
        Error::input_problems(self.path, vec![Problem::new(place, message)])
    }

    /// The path of the start part, from the package relationships.
    fn start_part(&self) -> String {
        let relations = self.archive.file("_rels/.rels").unwrap_or_default();
        model::target(&String::from_utf8_lossy(&relations), START_TYPE).unwrap_or_else(|| START.to_string())
    }

    /// Reads a model part, once.
    fn model(&mut self, part: &str) -> Result<Rc<Model>> {
        if let Some(known) = self.models.get(part) {
            return Ok(known.clone());
        }
        let bytes = self.archive.file(part).map_err(|why| self.fail(part, why))?;
        self.options.counter.add(1);
        let text = std::str::from_utf8(&bytes).map_err(|_| self.fail(part, "is not UTF-8"))?;
        let model = model::parse(text.trim_start_matches('\u{feff}'));
        let model = model.map_err(|p| self.fail(&place_in(part, &p.place), p.message))?;
        for what in &model.unsupported {
            if !self.unsupported.iter().any(|known| known == what) {
                self.unsupported.push((*what).to_string());
            }
        }
        if model.transparent > 0 {
            let message = format!("{} transparent colours are rendered opaque", model.transparent);
            self.loaded.warnings.push(Warning::new(self.path, part, message));
        }
        let model = Rc::new(model);
        self.models.insert(part.to_string(), model.clone());
        Ok(model)
    }

    /// Adds instances of an object's mesh and, recursively, of its components.
    fn place(&mut self, part: &str, reference: &Reference, world: DAffine3, depth: usize) -> Result<()> {
        let part = reference.part.as_deref().unwrap_or(part);
        let model = self.model(part)?;
        let place = format!("{part}, object {}", reference.object);
        let Some(object) = model.objects.get(&reference.object) else {
            return Err(self.fail(&place, ("object-undefined", "is used, but not defined")));
        };
        if depth > MAX_DEPTH {
            return Err(self.fail(
                &place,
                ("object-cycle", "contains itself, or nests components more than 64 levels deep"),
            ));
        }
        if object.is_support {
            self.supports += 1;
            return Ok(());
        }
        let world = world * reference.transform;
        if let Some(mesh) = self.mesh(part, &model, reference.object, object)? {
            let name = if object.name.is_empty() { NAMELESS.to_string() } else { object.name.clone() };
            self.loaded.scene.instances.push(Instance { name, ..Instance::new(mesh, world) });
        }
        if self.loaded.scene.instances.len() > MAX_INSTANCES {
            return Err(self.fail(
                &place,
                ("too-many-objects", format!("more than {MAX_INSTANCES} objects are placed")),
            ));
        }
        object.components.iter().try_for_each(|component| self.place(part, component, world, depth + 1))
    }

    /// The mesh of an object, built once.
    fn mesh(&mut self, part: &str, model: &Model, id: u32, object: &Object) -> Result<Option<MeshId>> {
        if let Some(known) = self.meshes.get(&(part.to_string(), id)) {
            return Ok(*known);
        }
        self.invalid_triangles += object.invalid_triangles;
        let built = build_mesh(model, object);
        let mesh = match built.mesh.triangles.is_empty() {
            true => None,
            false => {
                let mut mesh = built.mesh;
                mesh.name = if object.name.is_empty() { format!("object {id}") } else { object.name.clone() };
                let mut first_triangle = 0;
                for (appearance, triangle_count) in built.parts {
                    let material = self.material(part, model, appearance);
                    mesh.parts.push(MeshPart { first_triangle, triangle_count, material });
                    first_triangle += triangle_count;
                }
                self.repairs.repair(&mut mesh);
                let scene = &mut self.loaded.scene;
                scene.meshes.push(mesh);
                Some(MeshId(scene.meshes.len() as u32 - 1))
            }
        };
        self.meshes.insert((part.to_string(), id), mesh);
        Ok(mesh)
    }

    fn material(&mut self, part: &str, model: &Model, appearance: Appearance) -> MaterialId {
        let key = (part.to_string(), appearance);
        if let Some(known) = self.materials.get(&key) {
            return *known;
        }
        let material = match appearance {
            Appearance::Plain => Material::lambert("default", [0.8; 3]),
            Appearance::Colors => {
                Material { use_vertex_colors: true, ..Material::lambert("colours", [1.0; 3]) }
            }
            Appearance::Texture(id) => self.textured(part, model, id),
        };
        let scene = &mut self.loaded.scene;
        scene.materials.push(material);
        let id = MaterialId(scene.materials.len() as u32 - 1);
        if appearance == Appearance::Plain {
            self.loaded.default_materials.push(id);
        }
        self.materials.insert(key, id);
        id
    }

    /// A textured material, or a grey one, with a warning, if the image can't be read.
    fn textured(&mut self, part: &str, model: &Model, id: u32) -> Material {
        let plain = Material::lambert("texture", [0.8; 3]);
        if self.options.geometry_only {
            return plain;
        }
        let place = format!("{part}, texture {id}");
        let Some(file) = model.textures.get(&id) else {
            self.loaded.warnings.push(Warning::new(self.path, place, "is used, but not defined"));
            return plain;
        };
        match self.texture(file, &place) {
            Ok(texture) => {
                let slot = ColorSlot::texture(self.loaded.scene.add_texture(texture));
                Material { model: Surface::Lambert { albedo: slot }, ..plain }
            }
            Err(why) => {
                self.loaded.warnings.push(Warning::new(self.path, place, format!("is left out: {why}")));
                plain
            }
        }
    }

    fn texture(&mut self, file: &TextureFile, place: &str) -> std::result::Result<Texture, String> {
        let bytes = self.archive.file(&file.path).map_err(|why| format!("'{}' {why}", file.path))?;
        let (path, at) = (self.path.to_path_buf(), place.to_string());
        let on_damage: OnDamage = Arc::new(move |e| {
            Damage::LeftOut(Warning::new(&path, at.as_str(), format!("is left out: {}", joined_messages(e))))
        });
        let of = ImageFile {
            bytes: bytes.into(),
            own_file: None,
            place: (self.path, &file.path),
            mime: None,
            memory_limit: self.options.memory_limit,
        };
        let image =
            for_texture(&of, Use::Color, &mut self.loaded.warnings, on_damage).map_err(joined_messages)?;
        let [wrap_u, wrap_v] = file.tiles.each_ref().map(|style| match style.as_str() {
            "mirror" => Wrap::Mirror,
            "clamp" | "none" => Wrap::Clamp,
            _ => Wrap::Repeat,
        });
        let interpolation = if file.is_nearest { Interpolation::Nearest } else { Interpolation::default() };
        let image = self.loaded.scene.add_image(image);
        Ok(Texture::Image { image, wrap_u, wrap_v, interpolation, mapping: Mapping::default() })
    }
}

fn place_in(part: &str, place: &str) -> String {
    if place.is_empty() { part.to_string() } else { format!("{part}, {place}") }
}

fn joined_messages(error: Error) -> String {
    error.problems.into_iter().map(|p| p.message).collect::<Vec<_>>().join("; ")
}

/// A mesh with triangles sorted by appearance, and the number of triangles of each appearance.
struct BuiltMesh {
    mesh: Mesh,
    parts: Vec<(Appearance, u32)>,
}

/// Colour and texture coordinates of a corner.
#[derive(Clone, Copy, PartialEq)]
struct Corner {
    color: [f32; 4],
    uv: [f32; 2],
}

/// Builds the mesh of an object; vertices with several colours or texture coordinates are duplicated.
fn build_mesh(model: &Model, object: &Object) -> BuiltMesh {
    let appearances: Vec<(Appearance, [Corner; 3])> =
        object.triangles.iter().map(|t| appearance_of(model, object, t)).collect();
    let has_colors = appearances.iter().any(|(appearance, _)| *appearance == Appearance::Colors);
    let has_uv = appearances.iter().any(|(appearance, _)| matches!(appearance, Appearance::Texture(_)));
    // In meshes with colours, triangles without a colour get vertex colours, too.
    let resolved = |appearance: Appearance| {
        if has_colors && appearance == Appearance::Plain { Appearance::Colors } else { appearance }
    };
    let mut sorted: BTreeMap<Appearance, Vec<usize>> = BTreeMap::new();
    appearances
        .iter()
        .enumerate()
        .for_each(|(i, (appearance, _))| sorted.entry(resolved(*appearance)).or_default().push(i));
    let mut mesh = Mesh { positions: object.vertices.clone(), ..Mesh::default() };
    if !has_colors && !has_uv {
        mesh.triangles = object.triangles.iter().map(|t| t.corners).collect();
        let count = mesh.triangles.len() as u32;
        return BuiltMesh { mesh, parts: vec![(Appearance::Plain, count)] };
    }
    let mut corners: Vec<Option<Corner>> = vec![None; mesh.positions.len()];
    let mut duplicates: HashMap<(u32, [u32; 6]), u32> = HashMap::new();
    let mut parts = Vec::new();
    for (appearance, list) in sorted {
        parts.push((appearance, list.len() as u32));
        for i in list {
            let of = object.triangles[i].corners;
            let triangle: [u32; 3] = std::array::from_fn(|k| {
                let (old, corner) = (of[k] as usize, appearances[i].1[k]);
                if *corners[old].get_or_insert(corner) == corner {
                    return of[k];
                }
                *duplicates.entry((of[k], corner.bits())).or_insert_with(|| {
                    corners.push(Some(corner));
                    mesh.positions.push(mesh.positions[old]);
                    (mesh.positions.len() - 1) as u32
                })
            });
            mesh.triangles.push(triangle);
        }
    }
    let corner = |of: &Option<Corner>| of.unwrap_or(Corner { color: GREY, uv: [0.0; 2] });
    if has_colors {
        mesh.colors = corners.iter().map(|of| corner(of).color).collect();
    }
    if has_uv {
        mesh.uv_sets = vec![corners.iter().map(|of| corner(of).uv).collect()];
    }
    BuiltMesh { mesh, parts }
}

impl Corner {
    fn bits(self) -> [u32; 6] {
        let [r, g, b, a] = self.color;
        let [u, v] = self.uv;
        [r, g, b, a, u, v].map(f32::to_bits)
    }
}

/// Appearance of a triangle, from its own property or that of its object.
fn appearance_of(model: &Model, object: &Object, triangle: &Triangle) -> (Appearance, [Corner; 3]) {
    let plain = Corner { color: GREY, uv: [0.0; 2] };
    let Property { group, index } = object.property;
    let has_own = triangle.indices[0] != model::NONE;
    let number = if triangle.group == model::NONE { group } else { triangle.group };
    let indices = if has_own { triangle.indices } else { [index; 3] };
    let colored = |of: [Option<&[f32; 4]>; 3]| {
        (Appearance::Colors, of.map(|color| Corner { color: opaque(color), ..plain }))
    };
    match model.groups.get(&number) {
        Some(Group::Materials(list)) => colored([list.get(indices[0] as usize); 3]),
        Some(Group::Colors(list)) => colored(indices.map(|i| list.get(i as usize))),
        Some(Group::TextureCoordinates { texture, list }) => {
            // Rows of images grow downwards.
            let uv = |i: u32| list.get(i as usize).map_or([0.0; 2], |[u, v]| [*u, 1.0 - v]);
            (Appearance::Texture(*texture), indices.map(|i| Corner { uv: uv(i), color: [1.0; 4] }))
        }
        None => (Appearance::Plain, [plain; 3]),
    }
}

fn opaque(color: Option<&[f32; 4]>) -> [f32; 4] {
    color.map_or(GREY, |[r, g, b, _]| [*r, *g, *b, 1.0])
}
