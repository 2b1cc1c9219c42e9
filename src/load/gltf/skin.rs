//! Skins: joints that move the vertices of a mesh (glTF 2.0, section 3.7.3.3). A skinned mesh stands where its joints
//! are, whatever the transform of its node.

use super::accessor::Accessor;
use super::document::{Document, index_of, list_of_indices, pointer};
use super::report::{Report, Sound};
use super::transform::{Family, affine};
use crate::math::{DAffine3, DMat3, DVec3};
use crate::scene::Mesh;
use gltf::json::accessor::{ComponentType, Type};

/// Four joints and their weights for each vertex.
pub(super) struct Influence {
    /// Indices into the skin's joints.
    pub joints: Vec<[f32; 4]>,
    /// How far each moves the vertex.
    pub weights: Vec<[f32; 4]>,
}

/// A skin at a moment.
pub(super) struct SkinPose {
    /// From the space in which the mesh was modelled to the pose, for each joint; relative to `origin`, so that f32
    /// coordinates keep their precision wherever the skeleton stands.
    joints: Vec<DAffine3>,
    /// Where vertices go that no joint moves: the node's own transform, relative to `origin`.
    rest: DAffine3,
    /// Where the first joint stands in the world.
    pub origin: DVec3,
}

impl SkinPose {
    /// How many joints there are.
    pub fn joint_count(&self) -> usize {
        self.joints.len()
    }
}

/// The pose of a skin whose mesh hangs on a node that stands at `world_from_node`.
pub(super) fn pose(
    doc: &Document,
    index: usize,
    from: &str,
    world_from_node: DAffine3,
    family: &Family,
    report: &mut Report,
) -> Sound<SkinPose> {
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
    let placed: Vec<_> = joints.iter().map(|&joint| family.world_from_node(joint, report)).collect();
    let placed: Vec<DAffine3> = placed.into_iter().collect::<Sound<_>>()?;
    let origin = placed[0].translation;
    let back = DAffine3::from_translation(-origin);
    let joints = placed.iter().zip(bind).map(|(world, bind)| back * *world * bind).collect();
    Ok(SkinPose { joints, rest: back * world_from_node, origin })
}

/// Where the joints of a skin stand in the world. What is wrong with it is noted where it is used.
pub(super) fn places(doc: &Document, index: usize, family: &Family, report: &mut Report) -> Vec<DAffine3> {
    let Ok(raw) = doc.raw("skins", index, "/skins", report) else { return Vec::new() };
    let joints = list_of_indices(raw, "joints", &pointer("skins", index), report);
    let place = |joint: usize| family.world_from_node(joint, report).unwrap_or_default();
    joints.into_iter().map(place).collect()
}

fn inverse_binds(
    doc: &Document,
    accessor: &Accessor,
    joints: usize,
    report: &mut Report,
) -> Sound<Vec<DAffine3>> {
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
    let binds: Vec<DAffine3> = matrices.iter().map(|m| affine(&m.map(f64::from))).collect();
    if binds.iter().any(|m| !m.is_finite()) {
        return Err(report.problem(accessor.pointer.clone(), "holds numbers that are not finite"));
    }
    Ok(binds)
}

/// Moves the vertices of a mesh from `base` on; gives how many had weights that do not add up to 1.
///
/// Each vertex goes by the mean of its joints' transforms, weighted; normals by the inverse transpose of the same,
/// which the cofactors give up to length. Lengths other than 1 are left to the repair of meshes.
pub(super) fn apply(pose: &SkinPose, influences: &[Influence], mesh: &mut Mesh, base: usize) -> usize {
    let mut uneven = 0;
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
        uneven += usize::from((sum - 1.0).abs() > 0.02);
        let transform = if sum > 0.0 {
            DAffine3::from_mat3_translation(blended * (1.0 / sum), moved / sum)
        } else {
            pose.rest
        };
        move_vertex(&transform, mesh, i);
    }
    uneven
}

fn move_vertex(transform: &DAffine3, mesh: &mut Mesh, i: usize) {
    let vector = |v: &[f32]| DVec3::new(v[0].into(), v[1].into(), v[2].into());
    mesh.positions[i] = transform.transform_point3(vector(&mesh.positions[i])).as_vec3().to_array();
    let m = transform.matrix3;
    if let Some(normal) = mesh.normals.get_mut(i) {
        let cofactors =
            DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
        // A mirroring transform turns the cofactors' normals inside.
        let turned = cofactors * vector(normal) * m.determinant().signum();
        *normal = turned.normalize_or_zero().as_vec3().to_array();
    }
    if let Some(tangent) = mesh.tangents.get_mut(i) {
        let [x, y, z] = (m * vector(tangent)).normalize_or_zero().as_vec3().to_array();
        *tangent = [x, y, z, tangent[3]];
    }
}
