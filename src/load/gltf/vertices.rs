//! Vertices of primitives: their attributes, checked, read, morphed and skinned.

use super::accessor::Accessor;
use super::document::Document;
use super::materials::Needs;
use super::morph::{self, Target};
use super::opener::{Kind, Opener};
use super::report::{Report, Sound};
use super::skin::{self, Influence, SkinPose};
use crate::math::Vec3;
use crate::scene::Mesh;
use crate::simd::prefer_huge_pages;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;

/// The accessors of a primitive's vertices, by what they are read as; primitives with the same share vertices.
#[derive(Clone, PartialEq, Eq, Hash)]
pub(super) struct Attributes {
    positions: usize,
    /// Normals; without them the primitive is flat.
    pub normals: Option<usize>,
    /// Tangents, where the material needs them.
    pub tangents: Option<usize>,
    /// Vertex colours.
    pub colors: Option<usize>,
    /// For each slot of texture coordinates, the set of the file in it and its accessor.
    pub uv_slots: [Option<(u32, usize)>; 2],
    /// Morph targets that show.
    targets: Vec<Target>,
    /// Accessors of joints and of weights; empty without a skin.
    influences: Vec<(usize, usize)>,
}

/// How a mesh is deformed.
pub(super) struct Deformation<'s> {
    /// A weight for each morph target.
    pub weights: &'s [f32],
    /// The joints that move the vertices.
    pub skin: Option<&'s SkinPose>,
}

/// Most sets of four joints a vertex; files with more are not known.
const MOST_INFLUENCE_SETS: u32 = 4;

/// What a primitive's vertices are made of, as far as its material needs it. Tangents mean nothing without normals.
///
/// The first slot of texture coordinates is always filled: a scene file may replace the material.
pub(super) fn attributes(
    primitive: &Primitive,
    needs: Needs,
    deformation: &Deformation,
    at: &str,
    report: &mut Report,
) -> Sound<Attributes> {
    let accessor =
        |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value());
    let Some(positions) = accessor(Semantic::Positions) else {
        return Err(report.warn(at, "has no positions and is skipped"));
    };
    let uv = |set: Option<u32>| Some((set?, accessor(Semantic::TexCoords(set?))?));
    let normals = accessor(Semantic::Normals);
    let mut influences = Vec::new();
    for set in deformation.skin.map_or(0..0, |_| 0..MOST_INFLUENCE_SETS + 1) {
        match (accessor(Semantic::Joints(set)), accessor(Semantic::Weights(set))) {
            (Some(joints), Some(weights)) if set < MOST_INFLUENCE_SETS => influences.push((joints, weights)),
            (None, None) => break,
            _ => {
                let message =
                    format!("JOINTS_{set} and WEIGHTS_{set} are not a pair, or beyond what is read");
                report.warn(format!("{at}/attributes"), format!("{message}: left out"));
                break;
            }
        }
    }
    Ok(Attributes {
        positions,
        normals,
        tangents: accessor(Semantic::Tangents).filter(|_| needs.tangents && normals.is_some()),
        colors: accessor(Semantic::Colors(0)),
        uv_slots: [needs.uv_slots.sets[0].or(Some(0)), needs.uv_slots.sets[1]].map(uv),
        targets: morph::shown(primitive.targets.as_ref(), deformation.weights),
        influences,
    })
}

/// Appends vertices to a mesh; gives the first and their number.
pub(super) fn add_vertices(
    doc: &Document,
    attributes: &Attributes,
    skin: Option<&SkinPose>,
    at: &str,
    mesh: &mut Mesh,
    report: &mut Report,
) -> Sound<(u32, usize)> {
    let base = mesh.positions.len();
    let mut opener = Opener::new(doc, at, "/attributes", None, report);
    let positions = opener.open(Some(attributes.positions), "POSITION", &[Type::Vec3], Kind::Signed);
    let normals = opener.open(attributes.normals, "NORMAL", &[Type::Vec3], Kind::Signed);
    let tangents = opener.open(attributes.tangents, "TANGENT", &[Type::Vec4], Kind::Signed);
    let colors = opener.open(attributes.colors, "COLOR_0", &[Type::Vec3, Type::Vec4], Kind::Unsigned);
    let uv_slots = attributes.uv_slots.map(|slot| {
        let (set, index) = slot?;
        opener.open(Some(index), &format!("TEXCOORD_{set}"), &[Type::Vec2], Kind::Coordinate)
    });
    let count = opener.finish(base, 12 + 12 + 16 + 16 + 8 * uv_slots.len() as u64)?;
    // Small integers can't hold unit vectors to more than their precision, which is no fault of the file.
    let rounded = |a: &Option<Accessor>| a.as_ref().is_some_and(|a| a.component != ComponentType::F32);
    let is_rounded = rounded(&normals) || rounded(&tangents);
    if let Some(positions) = positions {
        positions.read_floats(tail(&mut mesh.positions, base, count, [0.0; 3]));
    }
    if let Some(normals) = normals {
        normals.read_floats(tail(&mut mesh.normals, base, count, [0.0; 3]));
    }
    if let Some(tangents) = tangents {
        tangents.read_floats(tail(&mut mesh.tangents, base, count, [0.0; 4]));
    }
    if let Some(colors) = colors {
        read_colors(&colors, tail(&mut mesh.colors, base, count, [1.0; 4]));
    }
    for (slot, uv) in uv_slots.into_iter().enumerate() {
        let Some(uv) = uv else { continue };
        if mesh.uv_sets.len() <= slot {
            mesh.uv_sets.resize(slot + 1, Vec::new());
        }
        uv.read_floats(tail(&mut mesh.uv_sets[slot], base, count, [0.0; 2]));
    }
    for target in &attributes.targets {
        morph::apply(doc, target, at, mesh, base, report)?;
    }
    if let Some(skin) = skin {
        add_skin(doc, attributes, skin, at, mesh, base, report)?;
    } else if !attributes.targets.is_empty() || is_rounded {
        unit_length(mesh, base);
    }
    Ok((base as u32, count))
}

/// Gives morphed or rounded normals and tangents the length 1 again.
fn unit_length(mesh: &mut Mesh, base: usize) {
    for normal in mesh.normals.iter_mut().skip(base) {
        *normal = Vec3::from_array(*normal).normalize_or_zero().to_array();
    }
    for tangent in mesh.tangents.iter_mut().skip(base) {
        let [x, y, z] = Vec3::new(tangent[0], tangent[1], tangent[2]).normalize_or_zero().to_array();
        *tangent = [x, y, z, tangent[3]];
    }
}

/// Moves the vertices from `base` on by a skin.
fn add_skin(
    doc: &Document,
    attributes: &Attributes,
    skin: &SkinPose,
    at: &str,
    mesh: &mut Mesh,
    base: usize,
    report: &mut Report,
) -> Sound<()> {
    let count = mesh.positions.len() - base;
    let mut influences = Vec::new();
    for (set, &(joints, weights)) in attributes.influences.iter().enumerate() {
        let mut opener = Opener::new(doc, at, "/attributes", Some(count), report);
        let joints = opener.open(Some(joints), &format!("JOINTS_{set}"), &[Type::Vec4], Kind::Joints);
        let weights = opener.open(Some(weights), &format!("WEIGHTS_{set}"), &[Type::Vec4], Kind::Unsigned);
        opener.finish(0, 32)?;
        let mut influence = Influence { joints: vec![[0.0; 4]; count], weights: vec![[0.0; 4]; count] };
        let (Some(joints), Some(weights)) = (joints, weights) else { continue };
        joints.read_floats(&mut influence.joints);
        weights.read_floats(&mut influence.weights);
        let used = influence.joints.iter().zip(&influence.weights);
        let largest = used.flat_map(|(j, w)| j.iter().zip(w)).filter(|(_, w)| **w > 0.0).map(|(j, _)| *j);
        let largest = largest.fold(-1.0, f32::max);
        if largest >= skin.joint_count() as f32 {
            let message = format!("holds the joint {largest}, but the skin has {}", skin.joint_count());
            return Err(report.problem(joints.pointer, message));
        }
        influences.push(influence);
    }
    if influences.is_empty() {
        report.warn(at, "hangs on a skin, but has no JOINTS_0 and WEIGHTS_0; it is shown unskinned");
    }
    let uneven = skin::apply(skin, &influences, mesh, base);
    if uneven > 0 && !influences.is_empty() {
        let message = format!("{uneven} vertices have weights of joints that do not add up to 1; normalised");
        report.warn(at, message);
    }
    Ok(())
}

fn read_colors(accessor: &Accessor, out: &mut [[f32; 4]]) {
    if accessor.kind == Type::Vec4 {
        accessor.read_floats(out);
        return;
    }
    let mut rgb = vec![[0.0; 3]; accessor.count];
    accessor.read_floats(&mut rgb);
    for (out, [r, g, b]) in out.iter_mut().zip(rgb) {
        *out = [r, g, b, 1.0];
    }
}

/// Makes `list` end with `count` entries from `base` on and gives those.
fn tail<T: Copy>(list: &mut Vec<T>, base: usize, count: usize, default: T) -> &mut [T] {
    if base == 0 {
        // Fresh zeros come from the system without being written.
        *list = vec![default; count];
        prefer_huge_pages(list);
    } else {
        list.resize(base, default);
        list.resize(base + count, default);
    }
    &mut list[base..]
}
