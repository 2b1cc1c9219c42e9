//! PLY meshes: ascii and binary of either byte order, parsed by `ply-rs` element by element into typed records.
//!
//! Read: `x y z`, `nx ny nz`, texture coordinates (`s t`, `u v`, `texture_u texture_v`; v turned to grow downwards),
//! `red green blue alpha` (integers are sRGB-encoded, floats linear), faces of any size (`vertex_index` or
//! `vertex_indices`) and `tristrips`. Everything else is skipped.

mod elements;
mod header;

use super::polygon::triangulate;
use super::shapes::drop_unusable_triangles;
use super::{LoadOptions, Loaded};
use crate::error::{Error, Problem, Result, Warning};
use crate::math::DAffine3;
use crate::scene::{Instance, Material, MaterialId, Mesh, MeshId, MeshPart};
use elements::{Face, Skipped, Vertex};
use header::Source;
use std::path::Path;

/// Reads a PLY file as one mesh with a white diffuse material.
pub(super) fn load(path: &Path, _options: &LoadOptions) -> Result<Loaded> {
    let bytes = std::fs::read(path).map_err(|e| Error::input(path, format!("can't be read: {e}")))?;
    let mut loaded = parse(path, &bytes)?;
    loaded.scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(loaded)
}

/// Reads the content of a PLY file; `path` is for messages.
fn parse(path: &Path, bytes: &[u8]) -> Result<Loaded> {
    let fail = |problem: Problem| Error::input_problems(path, vec![problem]);
    let mut source = Source::open(bytes).map_err(fail)?;
    let mut vertices: Vec<Vertex> = Vec::new();
    let mut faces: Vec<Face> = Vec::new();
    let mut strips: Vec<Face> = Vec::new();
    for (name, definition) in source.elements() {
        match name.as_str() {
            "vertex" => vertices = source.read(&definition).map_err(fail)?,
            "face" => faces = source.read(&definition).map_err(fail)?,
            "tristrips" => strips = source.read(&definition).map_err(fail)?,
            _ => drop(source.read::<Skipped>(&definition).map_err(fail)?),
        }
    }
    let mut mesh = Mesh { name: "mesh".to_string(), ..Mesh::default() };
    let defined = source.vertex_layout();
    if !defined.position {
        return Err(fail(Problem::new("header", "has no element 'vertex' with properties x, y and z")));
    }
    mesh.positions = vertices.iter().map(|v| v.position).collect();
    if defined.normal {
        mesh.normals = vertices.iter().map(|v| v.normal).collect();
    }
    if defined.uv {
        mesh.uv_sets = vec![vertices.iter().map(|v| [v.uv[0], 1.0 - v.uv[1]]).collect()];
    }
    if defined.color {
        mesh.colors = vertices.iter().map(|v| v.color).collect();
    }
    drop(vertices);
    let problems = add_faces(&mut mesh, &faces, &strips);
    if !problems.is_empty() {
        return Err(Error::input_problems(path, problems));
    }
    finish(path, mesh)
}

/// How many problems of one kind are worth listing.
const LISTED: usize = 10;

fn add_faces(mesh: &mut Mesh, faces: &[Face], strips: &[Face]) -> Vec<Problem> {
    let mut problems = Vec::new();
    let mut bad = 0usize;
    let count = mesh.positions.len();
    let mut check = |kind: &str, i: usize, face: &Face, allow_restart: bool| -> bool {
        let wrong =
            face.indices.iter().find(|&&v| !((0..count as i64).contains(&v) || allow_restart && v == -1));
        if let Some(v) = wrong {
            bad += 1;
            if bad <= LISTED {
                let message = format!("refers to vertex {v}, but there are {count}");
                problems.push(Problem::new(format!("{kind} {i}"), message));
            }
        }
        wrong.is_none()
    };
    for (i, face) in faces.iter().enumerate() {
        if check("face", i, face, false) {
            let corners: Vec<[f32; 3]> = face.indices.iter().map(|&v| mesh.positions[v as usize]).collect();
            let corner = |k: usize| face.indices[k] as u32;
            mesh.triangles.extend(triangulate(&corners).iter().map(|t| t.map(corner)));
        }
    }
    for (i, strip) in strips.iter().enumerate() {
        if check("tristrips", i, strip, true) {
            for run in strip.indices.split(|&v| v == -1) {
                let flip = |k: usize| if k.is_multiple_of(2) { [0, 1, 2] } else { [1, 0, 2] };
                let triangles = run.windows(3).enumerate().map(|(k, w)| flip(k).map(|c| w[c] as u32));
                mesh.triangles.extend(triangles);
            }
        }
    }
    if bad > LISTED {
        problems.push(Problem::new("", format!("{} more faces refer to missing vertices", bad - LISTED)));
    }
    problems
}

fn finish(path: &Path, mut mesh: Mesh) -> Result<Loaded> {
    if mesh.triangles.is_empty() {
        let message = if mesh.positions.is_empty() {
            "is empty: it has no vertices".to_string()
        } else {
            format!("is a point cloud: {} vertices and no faces", mesh.positions.len())
        };
        return Err(
            Error::input(path, message).with_help("only surfaces can be rendered; mesh the points first")
        );
    }
    let mut loaded = Loaded::default();
    let dropped = drop_unusable_triangles(&mut mesh);
    if dropped > 0 {
        let message = format!("{dropped} triangles with corners that are not finite numbers were dropped");
        loaded.warnings.push(Warning::new(path, "", message));
    }
    let triangle_count = u32::try_from(mesh.triangles.len())
        .map_err(|_| Error::input(path, "has more than 4,294,967,295 triangles"))?;
    mesh.parts = vec![MeshPart { first_triangle: 0, triangle_count, material: MaterialId(0) }];
    let mut material = Material::lambert("default", [0.8; 3]);
    if !mesh.colors.is_empty() {
        material = Material { use_vertex_colors: true, ..Material::lambert("vertex colours", [1.0; 3]) };
    }
    loaded.scene.materials.push(material);
    loaded.scene.meshes.push(mesh);
    loaded.scene.instances.push(Instance {
        name: "mesh".to_string(),
        mesh: MeshId(0),
        world_from_object: DAffine3::IDENTITY,
        material: None,
    });
    Ok(loaded)
}
