//! PLY meshes: ascii and binary of either byte order. `ply-rs` parses the header; rows are decoded here into typed records.
//!
//! Supported vertex properties: `x y z`, `nx ny nz`, texture coordinates (`s t`, `u v`, `texture_u texture_v`; v is flipped
//! to grow downwards) and colours (`red green blue alpha`, `diffuse_red` and so on; integers are sRGB-encoded, floats
//! linear). A header line `comment oscura attribute INDEX COUNT NAME` makes the first COUNT of the properties `aINDEX_0` to
//! `aINDEX_3` an attribute that node graphs read by name (integers are normalized to 0..1); four floats named `tangent` are
//! tangents with handedness.
//!
//! Supported face properties: polygons (`vertex_index` or `vertex_indices`), colours if vertices have none, per-corner
//! texture coordinates (`texcoord`, as MeshLab writes them), texture index (`texnumber`) and material index
//! (`material_index`); also `tristrips`. Unsupported elements and visible face properties cause a warning; other
//! properties are skipped.
//!
//! With texture coordinates, texture files of comments (`TextureFile`, as MeshLab writes them) give the base colour: the
//! first file, or that of `texnumber`. Vertices without faces are a point cloud and become spheres. Positions beyond the
//! precision of f32 are stored relative to an origin. Files of Gaussian splats are recognised by their properties
//! (`splats.rs`).

mod faces;
mod header;
pub(super) mod point_instances;
mod rows;
mod splats;

use super::files::find;
use super::image::Use;
use super::mesh_tools::{NAMELESS, Repairs};
use super::points::Cloud;
use super::{LoadOptions, Loaded, UpHint, files, image, mesh_tools};
use crate::error::{Error, Problem, Result, Warning};
use crate::image::Damage;
use crate::math::{DAffine3, DVec3};
use crate::scene::{
    ColorSlot, Instance, Interpolation, Mapping, Material, MaterialId, Mesh, MeshId, MeshPart, Model,
    Texture, VertexAttribute, Wrap,
};
use faces::{FaceLayout, Faces, Run, Wedges};
use header::{Source, UnreadData};
use rows::{Face, SkippedElement, Vertex};
use std::path::Path;
use std::sync::Arc;

/// Reads a PLY file as one mesh with a white diffuse material.
pub(super) fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    options.files.note(path);
    let bytes = files::read_model(path)?;
    let header = Source::open(&bytes, &options.counter);
    if header.map_err(|problem| Error::input_problems(path, vec![problem]))?.holds_splats() {
        return splats::load(path, &bytes, options);
    }
    let mut origin = DVec3::ZERO;
    let (mut mesh, mut faces, mut left_out) = parse(path, &bytes, origin, options)?;
    if left_out.has_exact_positions {
        origin = mesh_tools::distant_origin(mesh.positions.iter());
    }
    if origin != DVec3::ZERO {
        (mesh, faces, left_out) = parse(path, &bytes, origin, options)?;
    }
    drop(bytes);
    if let Some(wedges) = &faces.wedges {
        wedges.split(&mut mesh);
    }
    let by_texture = |wedges: &Wedges| wedges.runs(&mesh.triangles, left_out.texture_files.len());
    let (runs, textures) = match &faces.materials {
        Some(materials) => {
            let runs = faces::runs(&mesh.triangles, materials.iter().copied());
            (Some(Runs { runs, are_materials: true }), texture_numbers(None, &left_out.texture_files))
        }
        None => {
            let runs = faces.wedges.as_ref().map(by_texture);
            let textures = texture_numbers(runs.as_deref(), &left_out.texture_files);
            (runs.map(|runs| Runs { runs, are_materials: false }), textures)
        }
    };
    let mut loaded = finish(path, mesh, runs, origin, options)?;
    loaded.up_hint = UpHint { writer: left_out.writer_up, ..UpHint::default() };
    add_textures(path, &left_out.texture_files, &textures, options, &mut loaded);
    let warning = |what| Warning::new(path, "", format!("{what}: left out"));
    loaded.warnings.extend(left_out.visible.into_iter().map(warning));
    loaded
        .left_out
        .extend(left_out.irrelevant.into_iter().map(|what| format!("{what}: has no effect on pictures")));
    loaded.scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(loaded)
}

/// Reads the mesh relative to `origin` (metres), and lists unread data; `path` is for messages.
fn parse(
    path: &Path,
    bytes: &[u8],
    origin: DVec3,
    options: &LoadOptions,
) -> Result<(Mesh, Faces, UnreadData)> {
    let fail = |problem: Problem| Error::input_problems(path, vec![problem]);
    let mut source = Source::open(bytes, &options.counter).map_err(fail)?;
    let defined = source.vertex_layout();
    defined.check().map_err(fail)?;
    let mut mesh = Mesh { name: "mesh".to_string(), ..Mesh::default() };
    let (mut uv, mut faces) = (Vec::new(), Faces::new(source.has_wedges(), source.has_materials()));
    faces = faces.with_colors(defined.face_color);
    let mut left_out = source.unsupported(&defined);
    let mut attributes = Attributes::of(&source, options, &mut left_out);
    for (name, definition) in source.elements() {
        match name.as_str() {
            "vertex" => {
                // The header check has compared the counts with the file's size.
                mesh.positions.reserve_exact(definition.count);
                mesh.normals.reserve_exact(if defined.normal { definition.count } else { 0 });
                let add = |_, v: &Vertex| {
                    mesh.positions.push((DVec3::from_array(v.position) - origin).as_vec3().to_array());
                    if defined.normal {
                        mesh.normals.push(v.normal);
                    }
                    if defined.uv {
                        uv.push([v.uv[0], 1.0 - v.uv[1]]);
                    }
                    if defined.color {
                        mesh.colors.push(v.color);
                    }
                    attributes.push(v);
                };
                source.read(&definition, add).map_err(fail)?;
                faces.add_pending(&mut mesh);
            }
            "face" | "tristrips" => {
                let kind = if name == "face" { FaceLayout::Polygon } else { FaceLayout::Strip };
                mesh.triangles.reserve_exact(if kind == FaceLayout::Polygon { definition.count } else { 0 });
                let add = |i, face: &Face| faces.add(&mut mesh, kind, i, face);
                source.read(&definition, add).map_err(fail)?;
            }
            _ => {
                source.read(&definition, |_, _: &SkippedElement| {}).map_err(fail)?;
                let message = format!("{} rows of the unsupported element '{name}'", definition.count);
                left_out.visible.extend((definition.count > 0).then_some(message));
            }
        }
    }
    if defined.uv {
        mesh.uv_sets = vec![uv];
    }
    left_out.visible.extend(faces.left_out());
    left_out.visible.extend(unused_alpha(&mesh));
    mesh.attributes = attributes.lists;
    take_tangents(&mut mesh);
    faces.colors.take().into_iter().for_each(|colors| mesh_tools::color_triangles(&mut mesh, &colors));
    let problems = problems(&mesh, &mut faces);
    if problems.is_empty() { Ok((mesh, faces, left_out)) } else { Err(Error::input_problems(path, problems)) }
}

/// The attribute that holds tangents.
pub(super) const TANGENT: &str = "tangent";

/// Moves the four-component attribute `tangent` to the mesh's tangents: unit vectors with handedness; zero vectors stand for
/// tangents from the texture coordinates.
fn take_tangents(mesh: &mut Mesh) {
    let is_tangent = |a: &VertexAttribute| a.name == TANGENT && a.width == 4;
    let Some(at) = mesh.attributes.iter().position(is_tangent) else { return };
    let values = mesh.attributes.remove(at).values;
    if !mesh.normals.is_empty() && values.iter().all(|x| x.is_finite()) {
        mesh.tangents = values.as_chunks::<4>().0.to_vec();
    }
}

/// Errors of the faces. Missing vertices are an error only if no triangle remains.
fn problems(mesh: &Mesh, faces: &mut Faces) -> Vec<Problem> {
    let mut problems = faces.problems();
    if !mesh.triangles.is_empty() {
        problems.clear();
    }
    problems.extend(faces.materials.as_deref().and_then(invalid_material));
    problems
}

/// Maximum material index of a face.
const LAST_MATERIAL: i64 = 65_535;

fn invalid_material(materials: &[i64]) -> Option<Problem> {
    let invalid = materials.iter().find(|material| !(0..=LAST_MATERIAL).contains(*material))?;
    let message = format!("a face has the 'material_index' {invalid}, but it must be 0 to {LAST_MATERIAL}");
    Some(Problem::new("", message))
}

/// Named vertex attributes that node graphs read.
struct Attributes {
    /// INDEX of each attribute in the header.
    numbers: Vec<u8>,
    lists: Vec<VertexAttribute>,
}

impl Attributes {
    fn of(source: &Source, options: &LoadOptions, left_out: &mut UnreadData) -> Attributes {
        let mut attributes = Attributes { numbers: Vec::new(), lists: Vec::new() };
        for named in source.attributes() {
            if options.attributes.as_ref().is_some_and(|names| !names.contains(&named.name)) {
                left_out.irrelevant.push(format!("the attribute '{}', which no node reads", named.name));
            } else if attributes.lists.iter().any(|known| known.name == named.name) {
                left_out.visible.push(format!("a second attribute '{}'", named.name));
            } else {
                attributes.numbers.push(named.index);
                attributes.lists.push(VertexAttribute::new(named.name.clone(), named.count.into()));
            }
        }
        attributes
    }

    /// Appends the attributes of a vertex.
    #[inline]
    fn push(&mut self, vertex: &Vertex) {
        for (&number, list) in self.numbers.iter().zip(&mut self.lists) {
            let value = vertex.attributes.get(usize::from(number)).copied().unwrap_or_default();
            list.values.extend_from_slice(&value[..list.width as usize]);
        }
    }
}

/// Runs of triangles with one material each. Their numbers are material indices if `are_materials`, else texture indices.
struct Runs {
    runs: Vec<Run>,
    are_materials: bool,
}

/// Warns of vertices with alpha below 1.
fn unused_alpha(mesh: &Mesh) -> Option<String> {
    let count = mesh.colors.iter().filter(|c| c[3] < 1.0).count();
    (count > 0).then(|| format!("the alpha of {count} vertex colours, which are taken as opaque"))
}

/// The scene of a mesh relative to `origin`, with one part for each run of triangles.
fn finish(
    path: &Path,
    mut mesh: Mesh,
    runs: Option<Runs>,
    origin: DVec3,
    options: &LoadOptions,
) -> Result<Loaded> {
    if mesh.positions.is_empty() {
        return Err(Error::input(path, "is empty: it has no vertices"));
    }
    let mut loaded = Loaded::default();
    let warning = mesh_tools::bound_colors(&mut mesh.colors, true).map(|what| Warning::new(path, "", what));
    loaded.warnings.extend(warning);
    if mesh.triangles.is_empty() {
        let cloud = Cloud { positions: &mesh.positions, colors: &mesh.colors, origin };
        cloud.add(path, options, &mut loaded)?;
        mesh_tools::place_at_origin(path, origin, &mut loaded);
        return Ok(loaded);
    }
    let materials = runs.map_or(1, |runs| sort_by_run(&mut mesh, runs));
    let mut repairs = Repairs::default();
    repairs.repair(&mut mesh);
    loaded.warnings.extend(repairs.warnings(path));
    let too_many = || Error::input(path, "has more than 4,294,967,295 triangles or vertices");
    u32::try_from(mesh.positions.len()).map_err(|_| too_many())?;
    let triangle_count = u32::try_from(mesh.triangles.len()).map_err(|_| too_many())?;
    if mesh.parts.is_empty() {
        mesh.parts.push(MeshPart { first_triangle: 0, triangle_count, material: MaterialId(0) });
    }
    for i in 0..materials {
        let mut material = Material::lambert("default", [0.8; 3]);
        if !mesh.colors.is_empty() {
            material = Material { use_vertex_colors: true, ..Material::lambert("vertex colours", [1.0; 3]) };
        }
        loaded.scene.materials.push(material);
        loaded.default_materials.push(MaterialId(i));
    }
    loaded.scene.meshes.push(mesh);
    loaded
        .scene
        .instances
        .push(Instance { name: NAMELESS.to_string(), ..Instance::new(MeshId(0), DAffine3::IDENTITY) });
    mesh_tools::place_at_origin(path, origin, &mut loaded);
    Ok(loaded)
}

/// Sorts a mesh's triangles into one part for each run; returns the number of materials.
fn sort_by_run(mesh: &mut Mesh, Runs { runs, are_materials }: Runs) -> u32 {
    mesh.triangles.clear();
    for (i, run) in runs.into_iter().enumerate() {
        let material = MaterialId(if are_materials { run.number as u32 } else { i as u32 });
        let (first_triangle, triangle_count) = (mesh.triangles.len() as u32, run.triangles.len() as u32);
        mesh.triangles.extend(run.triangles);
        mesh.parts.push(MeshPart { first_triangle, triangle_count, material });
    }
    mesh.parts.last().map_or(1, |part| part.material.0 + 1)
}

/// Index of the texture file of each material, if any.
fn texture_numbers(runs: Option<&[Run]>, files: &[String]) -> Vec<Option<usize>> {
    match runs {
        None => vec![(!files.is_empty()).then_some(0)],
        Some(runs) => runs.iter().map(|run| usize::try_from(run.number).ok()).collect(),
    }
}

/// Assigns the texture files to the mesh's materials, or warns if it has no texture coordinates.
fn add_textures(
    path: &Path,
    files: &[String],
    numbers: &[Option<usize>],
    options: &LoadOptions,
    loaded: &mut Loaded,
) {
    if options.geometry_only {
        return;
    }
    for (number, name) in files.iter().enumerate() {
        let outcome = match numbers.iter().position(|n| *n == Some(number)) {
            // A mesh without triangles has no material.
            Some(material) => {
                add_texture(path, name, material, options, loaded).map_err(|why| format!(", {why}"))
            }
            None => Err(String::new()),
        };
        if let Err(why) = outcome {
            loaded.warnings.push(Warning::new(path, "", left_out(name, &why)));
        }
    }
}

/// The warning about a texture that is left out.
fn left_out(name: &str, why: &str) -> String {
    format!("the texture '{name}' of a comment: left out{why}")
}

/// The error of an image as a clause of the warning.
fn reason(error: Error) -> String {
    let messages: Vec<String> = error.problems.into_iter().map(|p| p.message).collect();
    format!("since it {}", messages.join("; "))
}

fn add_texture(
    path: &Path,
    name: &str,
    material: usize,
    options: &LoadOptions,
    loaded: &mut Loaded,
) -> std::result::Result<(), String> {
    if loaded.scene.meshes.first().is_none_or(|mesh| mesh.uv_sets.is_empty()) {
        return Err("since the vertices have no texture coordinates".into());
    }
    let file = find(path, name, options)?;
    let (path, name) = (path.to_path_buf(), name.to_string());
    let on_damage = move |error| {
        Damage::LeftOut(Warning::new(&path, "", left_out(&name, &format!(", {}", reason(error)))))
    };
    let image = image::read_for_texture(
        &file,
        Use::Color,
        options.memory_limit,
        &mut loaded.warnings,
        Arc::new(on_damage),
    );
    let image = image.map_err(reason)?;
    let image = loaded.scene.add_image(image);
    let texture = loaded.scene.add_texture(Texture::Image {
        image,
        wrap_u: Wrap::default(),
        wrap_v: Wrap::default(),
        interpolation: Interpolation::default(),
        mapping: Mapping::default(),
    });
    if let Some(material) = loaded.scene.materials.get_mut(material) {
        material.model = Model::Lambert { albedo: ColorSlot::texture(texture) };
    }
    Ok(())
}
