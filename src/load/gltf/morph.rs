//! Morph targets: displacements of positions, normals and tangents, each times its weight.

use super::document::Document;
use super::opener::{Kind, Opener};
use super::report::{Report, Sound};
use crate::scene::Mesh;
use gltf::json::accessor::Type;
use gltf::json::mesh::MorphTarget;

/// A target with a weight other than 0: its accessors.
#[derive(Clone, PartialEq, Eq, Hash)]
pub(super) struct Target {
    /// Its place in the primitive's list.
    number: usize,
    weight: u32,
    positions: Option<usize>,
    normals: Option<usize>,
    tangents: Option<usize>,
}

/// The targets of a primitive that show.
pub(super) fn shown(targets: Option<&Vec<MorphTarget>>, weights: &[f32]) -> Vec<Target> {
    let targets = targets.into_iter().flatten().zip(weights).enumerate();
    let shown = targets.filter(|(_, (_, weight))| **weight != 0.0);
    let target = |(number, (json, weight)): (usize, (&MorphTarget, &f32))| Target {
        number,
        weight: weight.to_bits(),
        positions: json.positions.map(|i| i.value()),
        normals: json.normals.map(|i| i.value()),
        tangents: json.tangents.map(|i| i.value()),
    };
    shown.map(target).collect()
}

/// Adds the displacements of a target to the vertices of a mesh from `base` on. Normals and tangents are left with
/// other lengths than 1.
pub(super) fn apply(
    doc: &Document,
    target: &Target,
    at: &str,
    mesh: &mut Mesh,
    base: usize,
    report: &mut Report,
) -> Sound<()> {
    let count = mesh.positions.len() - base;
    let at = format!("{at}/targets/{}", target.number);
    let mut opener = Opener::new(doc, &at, "", Some(count), report);
    let vector = &[Type::Vec3];
    let positions = opener.open(target.positions, "POSITION", vector, Kind::Signed);
    let normals = opener.open(target.normals, "NORMAL", vector, Kind::Signed);
    let tangents = opener.open(target.tangents, "TANGENT", vector, Kind::Signed);
    opener.finish(0, 3 * 12)?;
    let weight = f32::from_bits(target.weight);
    let mut offsets = vec![[0.0; 3]; count];
    if let Some(accessor) = positions {
        accessor.read_floats(&mut offsets);
        add(&mut mesh.positions[base..], &offsets, weight);
    }
    if let Some(accessor) = normals.filter(|_| !mesh.normals.is_empty()) {
        offsets.fill([0.0; 3]);
        accessor.read_floats(&mut offsets);
        add(&mut mesh.normals[base..], &offsets, weight);
    }
    if let Some(accessor) = tangents.filter(|_| !mesh.tangents.is_empty()) {
        offsets.fill([0.0; 3]);
        accessor.read_floats(&mut offsets);
        add(&mut mesh.tangents[base..], &offsets, weight);
    }
    Ok(())
}

fn add<const N: usize>(values: &mut [[f32; N]], offsets: &[[f32; 3]], weight: f32) {
    for (value, offset) in values.iter_mut().zip(offsets) {
        value.iter_mut().zip(offset).for_each(|(v, o)| *v += o * weight);
    }
}
