//! PLY meshes: ascii and binary of either byte order. `ply-rs` parses the header; the rows fill typed records here,
//! which become the mesh one by one.
//!
//! Read: `x y z`, `nx ny nz`, texture coordinates (`s t`, `u v`, `texture_u texture_v`; v turned to grow downwards),
//! `red green blue alpha` or `diffuse_red` and so on (integers are sRGB-encoded, floats linear), faces of any size
//! (`vertex_index` or `vertex_indices`) and `tristrips`. Other elements, and properties of faces that a picture would show,
//! are left out with a warning, and any other property without. Where a comment names a picture (`TextureFile`, as MeshLab
//! writes it) and vertices have texture coordinates, it is the colour. Vertices without faces are a point
//! cloud, which becomes spheres. Positions beyond the precision of single floats are kept around an origin of their own.
//! Gaussian splats are refused by their name.

mod ascii;
mod binary;
mod elements;
mod faces;
mod header;
mod lines;
mod texture;

use super::points::Cloud;
use super::shapes::Repairs;
use super::{LoadOptions, Loaded, UpHint, far};
use crate::error::{Error, Problem, Result, Warning};
use crate::math::{DAffine3, DVec3};
use crate::scene::{Instance, Material, MaterialId, Mesh, MeshId, MeshPart};
use elements::{Face, Skipped, Vertex};
use faces::{Faces, Kind};
use header::{Source, Unread};
use std::path::Path;

/// Reads a PLY file as one mesh with a white diffuse material.
pub(super) fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    options.files.note(path);
    let bytes = std::fs::read(path).map_err(|e| Error::input(path, format!("can't be read: {e}")))?;
    let mut origin = DVec3::ZERO;
    let (mut mesh, mut left_out) = parse(path, &bytes, origin)?;
    if left_out.has_exact_positions {
        origin = far::origin(mesh.positions.iter());
    }
    if origin != DVec3::ZERO {
        (mesh, left_out) = parse(path, &bytes, origin)?;
    }
    drop(bytes);
    let mut loaded = finish(path, mesh, origin, options)?;
    loaded.up_hint = UpHint { writer: left_out.writer_up, is_mostly_y: false };
    texture::add(path, &left_out.texture_files, options, &mut loaded);
    let warning = |what| Warning::new(path, "", format!("{what}: left out"));
    loaded.warnings.extend(left_out.shown.into_iter().map(warning));
    loaded.left_out.extend(left_out.rest.into_iter().map(|what| format!("{what}: no picture shows it")));
    loaded.scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(loaded)
}

/// Reads the content of a PLY file around an origin, and what it leaves out; `path` is for messages.
fn parse(path: &Path, bytes: &[u8], origin: DVec3) -> Result<(Mesh, Unread)> {
    let fail = |problem: Problem| Error::input_problems(path, vec![problem]);
    let mut source = Source::open(bytes).map_err(fail)?;
    let defined = source.vertex_layout();
    defined.check().map_err(fail)?;
    let mut mesh = Mesh { name: "mesh".to_string(), ..Mesh::default() };
    let (mut uv, mut faces) = (Vec::new(), Faces::default());
    let mut left_out = source.unread(&defined);
    for (name, definition) in source.elements() {
        match name.as_str() {
            "vertex" => {
                // The counts have been compared with the bytes that the file holds.
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
                };
                source.read(&definition, add).map_err(fail)?;
                faces.catch_up(&mut mesh);
            }
            "face" | "tristrips" => {
                let kind = if name == "face" { Kind::Polygon } else { Kind::Strip };
                mesh.triangles.reserve_exact(if kind == Kind::Polygon { definition.count } else { 0 });
                let add = |i, face: &Face| faces.add(&mut mesh, kind, i, &face.indices);
                source.read(&definition, add).map_err(fail)?;
            }
            _ => {
                source.read(&definition, |_, _: &Skipped| {}).map_err(fail)?;
                if definition.count > 0 {
                    let count = definition.count;
                    left_out.shown.push(format!("{count} of the element '{name}', which is no surface"));
                }
            }
        }
    }
    if defined.uv {
        mesh.uv_sets = vec![uv];
    }
    if faces.short > 0 {
        left_out.shown.push(format!("{} faces of fewer than three corners", faces.short));
    }
    left_out.shown.extend(unused_alpha(&mesh));
    let problems = faces.problems();
    if !problems.is_empty() {
        return Err(Error::input_problems(path, problems));
    }
    Ok((mesh, left_out))
}

/// Says how many vertices would let light through.
fn unused_alpha(mesh: &Mesh) -> Option<String> {
    let count = mesh.colors.iter().filter(|c| c[3] < 1.0).count();
    (count > 0).then(|| format!("the alpha of {count} vertex colours, which are taken as opaque"))
}

/// The scene of a mesh around an origin.
fn finish(path: &Path, mut mesh: Mesh, origin: DVec3, options: &LoadOptions) -> Result<Loaded> {
    if mesh.positions.is_empty() {
        return Err(Error::input(path, "is empty: it has no vertices"));
    }
    if mesh.triangles.is_empty() {
        let cloud = Cloud { positions: &mesh.positions, colors: &mesh.colors, origin };
        let mut loaded = Loaded::default();
        cloud.add(path, options, &mut loaded)?;
        far::place(path, origin, &mut loaded);
        return Ok(loaded);
    }
    let mut loaded = Loaded::default();
    let mut repairs = Repairs::default();
    repairs.make(&mut mesh);
    loaded.warnings.extend(repairs.warnings(path));
    let triangle_count = u32::try_from(mesh.triangles.len())
        .map_err(|_| Error::input(path, "has more than 4,294,967,295 triangles"))?;
    mesh.parts = vec![MeshPart { first_triangle: 0, triangle_count, material: MaterialId(0) }];
    let mut material = Material::lambert("default", [0.8; 3]);
    if !mesh.colors.is_empty() {
        material = Material { use_vertex_colors: true, ..Material::lambert("vertex colours", [1.0; 3]) };
    }
    loaded.scene.materials.push(material);
    loaded.stand_ins.push(MaterialId(0));
    loaded.scene.meshes.push(mesh);
    loaded
        .scene
        .instances
        .push(Instance { name: "mesh".to_string(), ..Instance::new(MeshId(0), DAffine3::IDENTITY) });
    far::place(path, origin, &mut loaded);
    Ok(loaded)
}
