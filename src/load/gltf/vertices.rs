//! Vertex attributes of primitives: validation, reading, morph targets and skinning.

use super::buffers::Accessor;
use super::document::{Document, index_of, list_of_indices, pointer};
use super::materials::MaterialNeeds;
use super::nodes::{NodeParents, affine};
use super::report::{Report, Reported, Valid};
use crate::math::{DAffine3, DMat3, DVec3, Vec3};
use crate::scene::Mesh;
use crate::simd::prefer_huge_pages;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{MorphTarget, Primitive, Semantic};
use gltf::json::validation::Checked;

/// The accessors of a primitive's vertex attributes. Primitives with equal accessors share vertices.
#[derive(Clone, PartialEq, Eq, Hash)]
pub(super) struct Attributes {
    positions: usize,
    /// `None` for flat shading.
    pub normals: Option<usize>,
    /// Only if the material needs tangents.
    pub tangents: Option<usize>,
    pub colors: Option<usize>,
    /// For each UV slot, the UV set of the file and its accessor.
    pub uv_slots: [Option<(u32, usize)>; 2],
    /// Morph targets with nonzero weights.
    targets: Vec<MorphTargetData>,
    /// Pairs of accessors of joints and weights; empty without a skin.
    influences: Vec<(usize, usize)>,
}

/// Deformation of a mesh.
pub(super) struct Deformation<'s> {
    /// Morph target weights.
    pub weights: &'s [f32],
    pub skin: Option<&'s SkinPose>,
}

/// Maximum number of sets of four joints per vertex.
const MAX_INFLUENCE_SETS: u32 = 4;

/// The vertex attributes of a primitive that its material needs. Tangents are ignored without normals.
///
/// UV slot 0 is always filled: a scene file may replace the material.
pub(super) fn attributes(
    primitive: &Primitive,
    needs: MaterialNeeds,
    deformation: &Deformation,
    at: &str,
    report: &mut Report,
) -> Valid<Attributes> {
    let accessor =
        |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value());
    let Some(positions) = accessor(Semantic::Positions) else {
        return Err(report.warn(at, "has no positions and is skipped"));
    };
    let uv = |set: Option<u32>| Some((set?, accessor(Semantic::TexCoords(set?))?));
    let normals = accessor(Semantic::Normals);
    let mut influences = Vec::new();
    for set in deformation.skin.map_or(0..0, |_| 0..MAX_INFLUENCE_SETS + 1) {
        match (accessor(Semantic::Joints(set)), accessor(Semantic::Weights(set))) {
            (Some(joints), Some(weights)) if set < MAX_INFLUENCE_SETS => influences.push((joints, weights)),
            (None, None) => break,
            _ => {
                let message = format!(
                    "JOINTS_{set} and WEIGHTS_{set} are not a pair, or beyond the {MAX_INFLUENCE_SETS} supported sets"
                );
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
        targets: active_targets(primitive.targets.as_ref(), deformation.weights),
        influences,
    })
}

/// Appends vertices to a mesh; returns the index of the first and their number.
pub(super) fn add_vertices(
    doc: &Document,
    attributes: &Attributes,
    skin: Option<&SkinPose>,
    at: &str,
    mesh: &mut Mesh,
    report: &mut Report,
) -> Valid<(u32, usize)> {
    let base = mesh.positions.len();
    let mut reader = AttributeReader::new(doc, at, "/attributes", None, report);
    let positions =
        reader.open(Some(attributes.positions), "POSITION", &[Type::Vec3], AttributeFormat::Signed);
    let normals = reader.open(attributes.normals, "NORMAL", &[Type::Vec3], AttributeFormat::Signed);
    let tangents = reader.open(attributes.tangents, "TANGENT", &[Type::Vec4], AttributeFormat::Signed);
    let colors =
        reader.open(attributes.colors, "COLOR_0", &[Type::Vec3, Type::Vec4], AttributeFormat::Unsigned);
    let uv_slots = attributes.uv_slots.map(|slot| {
        let (set, index) = slot?;
        reader.open(Some(index), &format!("TEXCOORD_{set}"), &[Type::Vec2], AttributeFormat::Coordinate)
    });
    let count = reader.finish(base, 12 + 12 + 16 + 16 + 8 * uv_slots.len() as u64)?;
    // Unit vectors of quantised integers are rounded, so they are normalised without a warning.
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
        apply_morph_targets(doc, target, at, mesh, base, report)?;
    }
    if let Some(skin) = skin {
        add_skin(doc, attributes, skin, at, mesh, base, report)?;
    } else if !attributes.targets.is_empty() || is_rounded {
        normalize(mesh, base);
    }
    Ok((base as u32, count))
}

/// Normalises morphed or rounded normals and tangents.
fn normalize(mesh: &mut Mesh, base: usize) {
    for normal in mesh.normals.iter_mut().skip(base) {
        *normal = Vec3::from_array(*normal).normalize_or_zero().to_array();
    }
    for tangent in mesh.tangents.iter_mut().skip(base) {
        let [x, y, z] = Vec3::new(tangent[0], tangent[1], tangent[2]).normalize_or_zero().to_array();
        *tangent = [x, y, z, tangent[3]];
    }
}

/// Skins the vertices from `base` on.
fn add_skin(
    doc: &Document,
    attributes: &Attributes,
    skin: &SkinPose,
    at: &str,
    mesh: &mut Mesh,
    base: usize,
    report: &mut Report,
) -> Valid<()> {
    let count = mesh.positions.len() - base;
    let mut influences = Vec::new();
    for (set, &(joints, weights)) in attributes.influences.iter().enumerate() {
        let mut reader = AttributeReader::new(doc, at, "/attributes", Some(count), report);
        let joints =
            reader.open(Some(joints), &format!("JOINTS_{set}"), &[Type::Vec4], AttributeFormat::Joints);
        let weights =
            reader.open(Some(weights), &format!("WEIGHTS_{set}"), &[Type::Vec4], AttributeFormat::Unsigned);
        reader.finish(0, 32)?;
        let mut influence = JointWeights { joints: vec![[0.0; 4]; count], weights: vec![[0.0; 4]; count] };
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
        report.warn(at, "has a skin, but no JOINTS_0 and WEIGHTS_0; it is not deformed");
    }
    let unnormalized = apply_skin(skin, &influences, mesh, base);
    if unnormalized > 0 && !influences.is_empty() {
        let message = format!("{unnormalized} vertices have joint weights that do not sum to 1; normalised");
        report.warn(at, message);
    }
    Ok(())
}

pub(super) fn read_colors(accessor: &Accessor, out: &mut [[f32; 4]]) {
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

/// Resizes `list` to `count` entries after `base` and returns these.
fn tail<T: Copy>(list: &mut Vec<T>, base: usize, count: usize, default: T) -> &mut [T] {
    if base == 0 {
        // The system provides zeroed pages without writing them.
        *list = vec![default; count];
        prefer_huge_pages(list);
    } else {
        list.resize(base, default);
        list.resize(base + count, default);
    }
    &mut list[base..]
}

// Validation of the accessors of a primitive's attributes.

/// Permitted component types of an attribute.
#[derive(Clone, Copy)]
pub(super) enum AttributeFormat {
    /// Floats; signed or unsigned small integers with KHR_mesh_quantization.
    Signed,
    /// Floats and normalised unsigned integers.
    Unsigned,
    /// Floats and normalised unsigned integers; any small integers with KHR_mesh_quantization.
    Coordinate,
    /// Small unsigned integers, not normalised.
    Joints,
    /// Floats and small integers.
    Any,
}

/// Opens the accessors of one primitive's attributes; reports the problems of all of them.
pub(super) struct AttributeReader<'d, 'a, 'r> {
    doc: &'d Document<'a>,
    at: &'r str,
    /// JSON pointer between the primitive and the attribute's name.
    inside: &'r str,
    report: &'r mut Report,
    quantized: bool,
    /// Number of vertices, known after the first attribute.
    count: Option<usize>,
    /// Whether all attributes so far are valid.
    validity: Valid<()>,
}

impl<'d, 'a, 'r> AttributeReader<'d, 'a, 'r> {
    /// A reader of attributes at the JSON pointer `at` + `inside`, of `count` elements each, if known.
    pub fn new(
        doc: &'d Document<'a>,
        at: &'r str,
        inside: &'r str,
        count: Option<usize>,
        report: &'r mut Report,
    ) -> AttributeReader<'d, 'a, 'r> {
        let quantized = doc.extension_used("KHR_mesh_quantization");
        AttributeReader { doc, at, inside, report, quantized, count, validity: Ok(()) }
    }

    /// The accessor of an attribute; `None` if it is missing, or invalid (which `finish` reports).
    pub fn open(
        &mut self,
        index: Option<usize>,
        name: &str,
        types: &[Type],
        kind: AttributeFormat,
    ) -> Option<Accessor<'d>> {
        let from = format!("{}{}/{name}", self.at, self.inside);
        let opened = Accessor::open(self.doc, index?, &from, self.report);
        let usable = opened.and_then(|accessor| self.check(accessor, types, kind));
        usable.map_err(|reported: Reported| self.validity = Err(reported)).ok()
    }

    fn check(
        &mut self,
        mut accessor: Accessor<'d>,
        types: &[Type],
        kind: AttributeFormat,
    ) -> Valid<Accessor<'d>> {
        let expected = *self.count.get_or_insert(accessor.count);
        check_type(&mut accessor, types, kind, self.quantized, self.report)?;
        if accessor.count != expected {
            let message = format!("has {} elements for {expected} vertices", accessor.count);
            return Err(self.report.problem(accessor.pointer.clone(), message));
        }
        Ok(accessor)
    }

    /// The number of vertices, if all attributes are valid and, after `base` other vertices, within the limits of indices and
    /// of the decoding budget.
    pub fn finish(self, base: usize, bytes_per_vertex: u64) -> Valid<usize> {
        self.validity?;
        let Some(count) = self.count else { return Err(self.report.problem(self.at, "has no attributes")) };
        let fits = base.checked_add(count).is_some_and(|n| u32::try_from(n).is_ok());
        if fits && self.doc.may_decode(bytes_per_vertex.saturating_mul(count as u64)) {
            return Ok(count);
        }
        let message = format!("{count} vertices are more than the size of the file justifies");
        Err(self.report.problem(self.at, message))
    }
}

/// Whether an accessor has the type that its attribute needs (glTF 2.0, section 3.7.2.1, and KHR_mesh_quantization).
fn check_type(
    accessor: &mut Accessor,
    types: &[Type],
    kind: AttributeFormat,
    quantized: bool,
    report: &mut Report,
) -> Valid<()> {
    let is_unsigned = matches!(accessor.component, ComponentType::U8 | ComponentType::U16);
    if matches!(kind, AttributeFormat::Unsigned) && is_unsigned && !accessor.normalized {
        accessor.normalized = true;
        report
            .warn(&*accessor.pointer, "holds integers that are not normalised; they are taken as normalised");
    }
    let small = matches!(
        accessor.component,
        ComponentType::I8 | ComponentType::U8 | ComponentType::I16 | ComponentType::U16
    );
    let unsigned = is_unsigned && accessor.normalized;
    let component = match kind {
        AttributeFormat::Signed => small && quantized,
        AttributeFormat::Any => small,
        AttributeFormat::Unsigned => unsigned,
        AttributeFormat::Coordinate => unsigned || small && quantized,
        // Normalised joint indices are ambiguous, so they are rejected.
        AttributeFormat::Joints => {
            matches!(accessor.component, ComponentType::U8 | ComponentType::U16) && !accessor.normalized
        }
    };
    let is_float = accessor.component == ComponentType::F32 && !matches!(kind, AttributeFormat::Joints);
    let fits = types.contains(&accessor.kind) && (component || is_float);
    if !fits {
        let named: Vec<String> = types.iter().map(|t| format!("{t:?}").to_uppercase()).collect();
        let component = if matches!(kind, AttributeFormat::Joints) { "U8 or U16" } else { "F32" };
        let (held, named) = (accessor.contents(), named.join(" or "));
        let message = format!("holds {held}; this attribute needs {named} of {component}");
        return Err(report.problem(accessor.pointer.clone(), message));
    }
    Ok(())
}

// Morph targets: weighted sums of displacements of positions, normals and tangents.

/// The accessors of a morph target with a nonzero weight.
#[derive(Clone, PartialEq, Eq, Hash)]
pub(super) struct MorphTargetData {
    /// Index in the primitive's list.
    number: usize,
    /// Bits of the weight.
    weight: u32,
    positions: Option<usize>,
    normals: Option<usize>,
    tangents: Option<usize>,
}

/// The morph targets of a primitive with nonzero weights.
pub(super) fn active_targets(targets: Option<&Vec<MorphTarget>>, weights: &[f32]) -> Vec<MorphTargetData> {
    let targets = targets.into_iter().flatten().zip(weights).enumerate();
    let active = targets.filter(|(_, (_, weight))| **weight != 0.0);
    let target = |(number, (json, weight)): (usize, (&MorphTarget, &f32))| MorphTargetData {
        number,
        weight: weight.to_bits(),
        positions: json.positions.map(|i| i.value()),
        normals: json.normals.map(|i| i.value()),
        tangents: json.tangents.map(|i| i.value()),
    };
    active.map(target).collect()
}

/// Adds the displacements of a morph target to the vertices from `base` on. Does not normalise normals and tangents.
pub(super) fn apply_morph_targets(
    doc: &Document,
    target: &MorphTargetData,
    at: &str,
    mesh: &mut Mesh,
    base: usize,
    report: &mut Report,
) -> Valid<()> {
    let count = mesh.positions.len() - base;
    let at = format!("{at}/targets/{}", target.number);
    let mut reader = AttributeReader::new(doc, &at, "", Some(count), report);
    let vector = &[Type::Vec3];
    let positions = reader.open(target.positions, "POSITION", vector, AttributeFormat::Signed);
    let normals = reader.open(target.normals, "NORMAL", vector, AttributeFormat::Signed);
    let tangents = reader.open(target.tangents, "TANGENT", vector, AttributeFormat::Signed);
    reader.finish(0, 3 * 12)?;
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

// Skins (glTF 2.0, section 3.7.3.3): linear blend skinning. The node's transform doesn't apply to a skinned mesh.

/// Four joints and their weights for each vertex.
pub(super) struct JointWeights {
    /// Indices into the skin's joints.
    pub joints: Vec<[f32; 4]>,
    /// Weights of the joints.
    pub weights: Vec<[f32; 4]>,
}

/// The joint matrices of a skin at a time.
pub(super) struct SkinPose {
    /// Transforms of the joints from bind space to world space, relative to `origin` to preserve the precision of f32
    /// coordinates far from the world's origin.
    joints: Vec<DAffine3>,
    /// The transform of vertices without joint weights: the node's own, relative to `origin`.
    rest: DAffine3,
    /// World position of the first joint.
    pub origin: DVec3,
}

impl SkinPose {
    /// Number of joints.
    pub fn joint_count(&self) -> usize {
        self.joints.len()
    }
}

/// The joint matrices of a skin whose mesh belongs to a node at `world_from_node`.
pub(super) fn skin_pose(
    doc: &Document,
    index: usize,
    from: &str,
    world_from_node: DAffine3,
    node_parents: &NodeParents,
    report: &mut Report,
) -> Valid<SkinPose> {
    let raw = doc.raw("skins", index, from, report)?;
    let at = pointer("skins", index);
    let joints = list_of_indices(raw, "joints", &at, report);
    if joints.is_empty() {
        return Err(report.problem(format!("{at}/joints"), "is empty or missing"));
    }
    let mut bind = vec![DAffine3::IDENTITY; joints.len()];
    if let Some(accessor) = index_of(raw, "inverseBindMatrices", &at, report)? {
        let accessor = Accessor::open(doc, accessor, &format!("{at}/inverseBindMatrices"), report)?;
        bind = inverse_binds(doc, &accessor, joints.len(), report)?;
    }
    let placed: Vec<_> = joints.iter().map(|&joint| node_parents.world_from_node(joint, report)).collect();
    let placed: Vec<DAffine3> = placed.into_iter().collect::<Valid<_>>()?;
    let origin = placed[0].translation;
    let back = DAffine3::from_translation(-origin);
    let joints = placed.iter().zip(bind).map(|(world, bind)| back * *world * bind).collect();
    Ok(SkinPose { joints, rest: back * world_from_node, origin })
}

/// World transforms of the joints of a skin. Problems are reported where the skin is used.
pub(super) fn joint_transforms(
    doc: &Document,
    index: usize,
    node_parents: &NodeParents,
    report: &mut Report,
) -> Vec<DAffine3> {
    let Ok(raw) = doc.raw("skins", index, "/skins", report) else { return Vec::new() };
    let joints = list_of_indices(raw, "joints", &pointer("skins", index), report);
    let place = |joint: usize| node_parents.world_from_node(joint, report).unwrap_or_default();
    joints.into_iter().map(place).collect()
}

fn inverse_binds(
    doc: &Document,
    accessor: &Accessor,
    joints: usize,
    report: &mut Report,
) -> Valid<Vec<DAffine3>> {
    if accessor.kind != Type::Mat4 || accessor.component != ComponentType::F32 || accessor.count < joints {
        let message = format!(
            "holds {} of {}; a skin of {joints} joints needs as many MAT4 of F32",
            accessor.count,
            accessor.contents()
        );
        return Err(report.problem(accessor.pointer.clone(), message));
    }
    if !doc.may_decode((accessor.count as u64).saturating_mul(160)) {
        return Err(report
            .problem(accessor.pointer.clone(), "holds more matrices than the size of the file justifies"));
    }
    let mut matrices = vec![[0.0f32; 16]; accessor.count];
    accessor.read_floats(&mut matrices);
    let bind_matrices: Vec<DAffine3> = matrices.iter().map(|m| affine(&m.map(f64::from))).collect();
    if bind_matrices.iter().any(|m| !m.is_finite()) {
        return Err(report.problem(accessor.pointer.clone(), "holds numbers that are not finite"));
    }
    Ok(bind_matrices)
}

/// Skins the vertices of a mesh from `base` on; returns the number of vertices with weights that don't sum to 1.
///
/// Vertices are transformed by the weighted mean of their joint matrices, normals by its cofactor matrix, which is the
/// inverse transpose up to scale.
pub(super) fn apply_skin(
    pose: &SkinPose,
    influences: &[JointWeights],
    mesh: &mut Mesh,
    base: usize,
) -> usize {
    let mut unnormalized = 0;
    for i in base..mesh.positions.len() {
        let mut blended = DMat3::ZERO;
        let mut moved = DVec3::ZERO;
        let mut sum = 0.0;
        for influence in influences {
            for (joint, weight) in influence.joints[i - base].iter().zip(influence.weights[i - base]) {
                let Some(joint) = pose.joints.get(*joint as usize).filter(|_| weight > 0.0) else { continue };
                let weight = f64::from(weight);
                blended += joint.matrix3 * weight;
                moved += joint.translation * weight;
                sum += weight;
            }
        }
        unnormalized += usize::from((sum - 1.0).abs() > 0.02);
        let transform = if sum > 0.0 {
            DAffine3::from_mat3_translation(blended * (1.0 / sum), moved / sum)
        } else {
            pose.rest
        };
        transform_vertex(&transform, mesh, i);
    }
    unnormalized
}

fn transform_vertex(transform: &DAffine3, mesh: &mut Mesh, i: usize) {
    let vector = |v: &[f32]| DVec3::new(v[0].into(), v[1].into(), v[2].into());
    mesh.positions[i] = transform.transform_point3(vector(&mesh.positions[i])).as_vec3().to_array();
    let m = transform.matrix3;
    if let Some(normal) = mesh.normals.get_mut(i) {
        let cofactors =
            DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
        // The sign keeps normals outward under mirroring transforms.
        let outward = cofactors * vector(normal) * m.determinant().signum();
        *normal = outward.normalize_or_zero().as_vec3().to_array();
    }
    if let Some(tangent) = mesh.tangents.get_mut(i) {
        let [x, y, z] = (m * vector(tangent)).normalize_or_zero().as_vec3().to_array();
        *tangent = [x, y, z, tangent[3]];
    }
}
