//! OBJ meshes with MTL materials, parsed by `tobj`; what it can't take is mended beforehand (`text`).
//!
//! Polygons of any size, concave ones included; negative indices; normals; texture coordinates (turned so that v grows
//! downwards); vertex colours (sRGB-encoded, as exporters write them). Without normals, shading is flat. Lines and
//! points are left out.

mod materials;
mod text;

use super::polygon::triangulate;
use super::shapes::drop_unusable_triangles;
use super::{LoadOptions, Loaded};
use crate::color::linear_from_srgb;
use crate::error::{Error, Problem, Result, Warning};
use crate::math::DAffine3;
use crate::scene::{Instance, Material, MaterialId, Mesh, MeshId, MeshPart};
use std::cell::RefCell;
use std::collections::HashMap;
use std::fs::File;
use std::path::Path;
use text::Text;

/// Reads an OBJ file and its material libraries: a mesh for each object and material.
pub(super) fn load(path: &Path, _options: &LoadOptions) -> Result<Loaded> {
    let file = File::open(path).map_err(|e| Error::input(path, format!("can't be read: {e}")))?;
    let mut loaded = Loaded::default();
    loaded.scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let options =
        tobj::LoadOptions { single_index: true, triangulate: false, ignore_points: true, ignore_lines: true };
    let mut text = Text::new(file);
    let warnings = RefCell::new(Vec::new());
    let parsed = tobj::load_obj_buf(&mut text, &options, |names| {
        read_library(path, &names.to_string_lossy(), &mut warnings.borrow_mut())
    });
    loaded.warnings = warnings.into_inner();
    let (models, mtl) = parsed.map_err(|e| {
        let problem = Problem::new(format!("line {}", text.line()), format!("is not valid OBJ: {e}"));
        Error::input_problems(path, vec![problem])
    })?;
    drop(text);
    // The reader of libraries never fails.
    build(path, models, &mtl.unwrap_or_default(), &mut loaded);
    if loaded.scene.meshes.is_empty() {
        return Err(Error::input(path, "has no faces").with_help("only surfaces can be rendered"));
    }
    Ok(loaded)
}

/// The materials of the libraries that one statement names; a missing or broken library is a warning.
fn read_library(path: &Path, names: &str, warnings: &mut Vec<Warning>) -> tobj::MTLLoadResult {
    let folder = path.parent().unwrap_or(path);
    // The parser cuts at the first space, which may stand before the keyword.
    let names = names.strip_prefix("mtllib ").unwrap_or(names).trim();
    if names.is_empty() {
        let message = "a statement 'mtllib' without a file name behind a space is ignored";
        warnings.push(Warning::new(path, "", message));
    }
    // A name may hold spaces, and a line several names.
    let parts: Vec<&str> = match names {
        whole if folder.join(whole).is_file() => vec![whole],
        several => several.split_whitespace().collect(),
    };
    let mut all = String::new();
    for name in parts {
        match std::fs::read(folder.join(name.replace('\\', "/"))) {
            Ok(bytes) => {
                all.push_str(&text::clean(&bytes));
                all.push('\n');
            }
            Err(e) => {
                let message =
                    format!("material library '{name}' can't be read ({e}); its materials are grey");
                warnings.push(Warning::new(path, "", message));
            }
        }
    }
    let broken = |e| {
        let message = format!("material library '{names}' can't be read ({e}); its materials are grey");
        warnings.push(Warning::new(path, "", message));
        Ok(Default::default())
    };
    tobj::load_mtl_buf(&mut all.as_bytes()).or_else(broken)
}

/// Identifies a material of the scene: its place among the MTL materials, and whether vertex colours multiply it.
type MaterialKey = (Option<usize>, bool);

fn build(path: &Path, models: Vec<tobj::Model>, mtl: &[tobj::Material], loaded: &mut Loaded) {
    let mut ids: HashMap<MaterialKey, MaterialId> = HashMap::new();
    let mut dropped = 0;
    for model in models {
        let mut mesh = convert(&model);
        dropped += drop_unusable_triangles(&mut mesh);
        if mesh.triangles.is_empty() {
            continue;
        }
        let key = (model.mesh.material_id.filter(|&i| i < mtl.len()), !mesh.colors.is_empty());
        let material = *ids.entry(key).or_insert_with(|| {
            let mut material = match key.0 {
                Some(i) => materials::convert(&mtl[i], path, loaded),
                None => Material::lambert("default", [0.8; 3]),
            };
            material.use_vertex_colors = key.1;
            loaded.scene.materials.push(material);
            MaterialId(loaded.scene.materials.len() as u32 - 1)
        });
        let triangle_count = mesh.triangles.len() as u32;
        mesh.parts = vec![MeshPart { first_triangle: 0, triangle_count, material }];
        let scene = &mut loaded.scene;
        scene.instances.push(Instance {
            name: model.name,
            mesh: MeshId(scene.meshes.len() as u32),
            world_from_object: DAffine3::IDENTITY,
            material: None,
        });
        scene.meshes.push(mesh);
    }
    if dropped > 0 {
        let message = format!("{dropped} triangles with corners that are not finite numbers were dropped");
        loaded.warnings.push(Warning::new(path, "", message));
    }
    for (i, m) in mtl.iter().enumerate() {
        if !ids.keys().any(|k| k.0 == Some(i)) {
            loaded.left_out.push(format!("material '{}': no face uses it", m.name));
        }
    }
}

fn convert(model: &tobj::Model) -> Mesh {
    let source = &model.mesh;
    let triples = |v: &[f32]| -> Vec<[f32; 3]> { v.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect() };
    let mut mesh =
        Mesh { name: model.name.clone(), positions: triples(&source.positions), ..Mesh::default() };
    let count = mesh.positions.len();
    // Attributes that only some faces carry come out shorter than the positions; they can't be used.
    mesh.normals = Some(triples(&source.normals)).filter(|n| n.len() == count).unwrap_or_default();
    let uv: Vec<[f32; 2]> = source.texcoords.chunks_exact(2).map(|c| [c[0], 1.0 - c[1]]).collect();
    if uv.len() == count && count > 0 {
        mesh.uv_sets = vec![uv];
    }
    let color = |c: [f32; 3]| {
        let [r, g, b] = c.map(linear_from_srgb);
        [r, g, b, 1.0]
    };
    let colors: Vec<[f32; 4]> = triples(&source.vertex_color).into_iter().map(color).collect();
    mesh.colors = Some(colors).filter(|c| c.len() == count).unwrap_or_default();
    mesh.triangles.reserve_exact(source.indices.len() / 3);
    let mut first = 0;
    let faces = source.indices.len() / 3;
    let arities: &[u32] = &source.face_arities;
    for i in 0..if arities.is_empty() { faces } else { arities.len() } {
        let arity = arities.get(i).map_or(3, |a| *a as usize);
        let Some(face) = source.indices.get(first..first + arity) else { break };
        first += arity;
        if face.iter().any(|&v| v as usize >= count) {
            continue;
        }
        if let [a, b, c] = *face {
            mesh.triangles.push([a, b, c]);
            continue;
        }
        let corners: Vec<[f32; 3]> = face.iter().map(|&v| mesh.positions[v as usize]).collect();
        mesh.triangles.extend(triangulate(&corners).iter().map(|t| t.map(|k| face[k])));
    }
    mesh
}
