//! Where nodes stand. Transforms are taken from the JSON in full precision and composed in f64.

use super::animation::{NodePose, Pose};
use super::document::{Document, numbers_of, pointer, required};
use super::report::{Report, Sound};
use crate::math::{DAffine3, DMat3, DQuat, DVec3};
use serde_json::Value;

/// A node's own transform at the pose's moment: its matrix, or translation * rotation * scale.
pub(super) fn local(node: &Value, pose: Option<&NodePose>, at: &str, report: &mut Report) -> Sound<DAffine3> {
    let moves = pose.is_some_and(|p| p.translation.is_some() || p.rotation.is_some() || p.scale.is_some());
    let transform = if node.get("matrix").is_some() {
        if ["translation", "rotation", "scale"].iter().any(|key| node.get(key).is_some()) {
            return Err(report.problem(at, "has a matrix and also a translation, rotation or scale"));
        }
        if moves {
            report.warn(format!("{at}/matrix"), "an animated node must not have a matrix; the matrix counts");
        }
        matrix(node, at, report)?
    } else {
        let translation = vector(node, "translation", 0.0, at, report)?;
        let scale = vector(node, "scale", 1.0, at, report)?;
        let rotation = rotation(node, at, report)?;
        DAffine3::from_scale_rotation_translation(
            pose.and_then(|p| p.scale).unwrap_or(scale),
            pose.and_then(|p| p.rotation).unwrap_or(rotation),
            pose.and_then(|p| p.translation).unwrap_or(translation),
        )
    };
    if !transform.is_finite() {
        return Err(report.problem(at, "has a transform beyond the range of numbers"));
    }
    Ok(transform)
}

fn matrix(node: &Value, at: &str, report: &mut Report) -> Sound<DAffine3> {
    let m: [f64; 16] = required(numbers_of(node, "matrix", at, report), "matrix", at, report)?;
    if [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0] {
        report.warn(format!("{at}/matrix"), "is a projection; its last row is taken as 0 0 0 1");
    }
    Ok(affine(&m))
}

/// The affine part of a matrix given column by column.
pub(super) fn affine(m: &[f64; 16]) -> DAffine3 {
    let column = |i: usize| DVec3::new(m[i], m[i + 1], m[i + 2]);
    DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(4), column(8)), column(12))
}

fn vector(node: &Value, key: &str, default: f64, at: &str, report: &mut Report) -> Sound<DVec3> {
    Ok(numbers_of(node, key, at, report)?.map_or(DVec3::splat(default), DVec3::from_array))
}

fn rotation(node: &Value, at: &str, report: &mut Report) -> Sound<DQuat> {
    let Some(rotation) = numbers_of(node, "rotation", at, report)? else { return Ok(DQuat::IDENTITY) };
    let rotation = DQuat::from_array(rotation);
    let length = rotation.length();
    if !(length > 1e-6 && length.is_finite()) {
        return Err(report.problem(format!("{at}/rotation"), "is no rotation: a unit quaternion is needed"));
    }
    if (length - 1.0).abs() > 1e-3 {
        report.warn(format!("{at}/rotation"), format!("has the length {length:.4}; it was normalised"));
    }
    Ok(rotation.normalize())
}

/// The parents of all nodes, for placing nodes that the walk over the shown scene doesn't reach: joints of skins, and
/// the ancestors of a node that is shown alone.
pub(super) struct Family<'d, 'a> {
    doc: &'d Document<'a>,
    pose: &'d Pose,
    parents: Vec<Option<usize>>,
}

impl<'d, 'a> Family<'d, 'a> {
    /// Reads who is whose child. Broken lists of children are left to the walk, which names them.
    pub fn new(doc: &'d Document<'a>, pose: &'d Pose) -> Family<'d, 'a> {
        let count = doc.count("nodes");
        let mut parents = vec![None; count];
        let nodes = doc.json.get("nodes").and_then(Value::as_array);
        for (parent, node) in nodes.into_iter().flatten().enumerate() {
            let children = node.get("children").and_then(Value::as_array);
            for child in children.into_iter().flatten().filter_map(Value::as_u64) {
                if let Some(slot) = usize::try_from(child).ok().and_then(|c| parents.get_mut(c)) {
                    *slot = Some(parent);
                }
            }
        }
        Family { doc, pose, parents }
    }

    /// The parent of a node.
    pub fn parent(&self, index: usize) -> Option<usize> {
        self.parents.get(index).copied().flatten()
    }

    /// The placement of a node in the world.
    pub fn world_from_node(&self, index: usize, report: &mut Report) -> Sound<DAffine3> {
        let mut world = DAffine3::IDENTITY;
        let mut next = Some(index);
        let mut left = self.parents.len();
        while let Some(node) = next {
            if left == 0 {
                return Err(
                    report.problem(pointer("nodes", index), "is its own ancestor: nodes form a cycle")
                );
            }
            left -= 1;
            let at = pointer("nodes", node);
            let raw = self.doc.raw("nodes", node, &at, report)?;
            world = local(raw, self.pose.node(node), &at, report)? * world;
            next = self.parent(node);
        }
        if !world.is_finite() {
            return Err(report.problem(pointer("nodes", index), "stands beyond the range of numbers"));
        }
        Ok(world)
    }
}
