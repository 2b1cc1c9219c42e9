//! EXT_mesh_gpu_instancing: one node shows its mesh many times.

use super::accessor::Accessor;
use super::document::{Document, index_of};
use super::report::{Report, Sound};
use crate::math::{DAffine3, DQuat, DVec3};
use gltf::json::accessor::{ComponentType, Type};
use serde_json::Value;

/// Bytes that one more instance takes in the scene, roughly, with its name.
const BYTES_PER_INSTANCE: u64 = 256;

/// Where the instances of a node stand in its space; `None` if it has no instancing.
pub(super) fn placements(
    doc: &Document,
    node: &Value,
    at: &str,
    report: &mut Report,
) -> Sound<Option<Vec<DAffine3>>> {
    let Some(extension) = node.pointer("/extensions/EXT_mesh_gpu_instancing") else { return Ok(None) };
    let at = format!("{at}/extensions/EXT_mesh_gpu_instancing/attributes");
    let Some(attributes) = extension.get("attributes").filter(|a| a.is_object()) else {
        return Err(report.problem(at, "is missing, or no object"));
    };
    let mut count = None;
    let mut open = |name: &str, kind: Type, report: &mut Report| -> Sound<Option<Accessor<'_>>> {
        let Some(index) = index_of(attributes, name, &at, report)? else { return Ok(None) };
        let accessor = Accessor::open(doc, index, &format!("{at}/{name}"), report)?;
        let small = accessor.normalized && accessor.component != ComponentType::U32;
        if accessor.kind != kind || !(accessor.component == ComponentType::F32 || small) {
            let wanted = format!("{kind:?}").to_uppercase();
            let message = format!("holds {}; this attribute needs {wanted} of F32", accessor.contents());
            return Err(report.problem(accessor.pointer.clone(), message));
        }
        let expected = *count.get_or_insert(accessor.count);
        if accessor.count != expected {
            let message = format!("has {} elements for {expected} instances", accessor.count);
            return Err(report.problem(accessor.pointer.clone(), message));
        }
        Ok(Some(accessor))
    };
    let translations = open("TRANSLATION", Type::Vec3, report);
    let rotations = open("ROTATION", Type::Vec4, report);
    let scales = open("SCALE", Type::Vec3, report);
    let (translations, rotations, scales) = (translations?, rotations?, scales?);
    // Instances without a transform (only custom attributes) all stand where the node does: one is enough to see.
    let count = count.unwrap_or(1);
    if !doc.may_decode(BYTES_PER_INSTANCE.saturating_mul(count as u64)) {
        return Err(
            report.problem(at, format!("{count} instances are more than the size of the file justifies"))
        );
    }
    let translations = read(translations.as_ref(), count, [0.0; 3]);
    let rotations = read(rotations.as_ref(), count, [0.0, 0.0, 0.0, 1.0]);
    let scales = read(scales.as_ref(), count, [1.0; 3]);
    let mut unusable = 0usize;
    let mut list = Vec::with_capacity(count);
    for ((t, r), s) in translations.into_iter().zip(rotations).zip(scales) {
        let rotation = DQuat::from_array(r.map(f64::from)).normalize();
        let [translation, scale] = [t, s].map(|v| DVec3::from_array(v.map(f64::from)));
        let placement = DAffine3::from_scale_rotation_translation(scale, rotation, translation);
        if placement.is_finite() && placement.matrix3.determinant() != 0.0 {
            list.push(placement);
        } else {
            unusable += 1;
        }
    }
    if unusable > 0 {
        report.warn(at, format!("{unusable} instances are flattened or not finite, and left out"));
    }
    Ok(Some(list))
}

fn read<const N: usize>(accessor: Option<&Accessor>, count: usize, default: [f32; N]) -> Vec<[f32; N]> {
    let mut values = vec![default; count];
    if let Some(accessor) = accessor {
        values.fill([0.0; N]);
        accessor.read_floats(&mut values);
    }
    values
}
