//! EXT_lights_ies: lights with the profiles of luminaires.

use super::cameras;
use super::document::{Document, index_of, name_of, number_of, numbers_of, pointer, required};
use super::nodes::Node;
use super::report::{Report, Sound};
use super::traits;
use crate::load::ies;
use crate::math::{DMat3, DQuat, DVec3};
use crate::scene::{Light, LightKind, LightProfile, ObjectTraits};
use serde_json::Value;
use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

const PLACE: &str = "extensions/EXT_lights_ies";
const LIGHTS: &str = "extensions/EXT_lights_ies/lights";

/// The profiles of a file by index, with the largest value 1, and what that is in candela.
pub(super) type Profiles = HashMap<usize, Sound<(Arc<LightProfile>, f64)>>;

/// The light of a node, if it has one of these.
pub(super) fn light(
    doc: &Document,
    node: &Node,
    profiles: &mut Profiles,
    report: &mut Report,
) -> Option<Sound<Light>> {
    node.profiled_light(doc).map(|raw| read(doc, (node, raw), profiles, report))
}

fn read(
    doc: &Document,
    (node, raw): (&Node, &Value),
    profiles: &mut Profiles,
    report: &mut Report,
) -> Sound<Light> {
    let at = format!("{}/{PLACE}", node.pointer());
    let index = required(index_of(raw, "light", &at, report), "light", &at, report)?;
    let known = match profiles.get(&index) {
        Some(known) => known.clone(),
        None => {
            let read = report.lasting(|report| profile(doc, index, &at, report));
            profiles.insert(index, read.clone());
            read
        }
    };
    let (profile, candela) = known?;
    let factor = number_of(raw, "multiplier", &at, report)?.unwrap_or(1.0);
    let color = numbers_of(raw, "color", &at, report)?.unwrap_or([1.0; 3]);
    let intensity = color.map(|c| (c.clamp(0.0, 1.0) * factor * candela / ies::LUMENS_PER_WATT) as f32);
    if intensity.iter().any(|i| !(i.is_finite() && *i >= 0.0)) {
        return Err(report
            .problem(at, "has a multiplier or a colour that is negative or beyond the range of numbers"));
    }
    let Some(rotation) = rotation(&node.world_from_node.matrix3) else {
        return Err(report.warn(node.pointer(), "flattens its light, which is left out"));
    };
    let kind = LightKind::Profiled { position: node.world_from_node.translation, rotation, cone: None };
    let node_raw = doc.json.pointer(&node.pointer()).unwrap_or(&Value::Null);
    let group = cameras::light_group(node_raw, &node.pointer(), report).unwrap_or_default();
    let ObjectTraits { visible_to, .. } = traits::of_node(node_raw, &node.pointer(), report);
    let name = name_of(node_raw, "light of node", node.index);
    Ok(Light { name, group, visible_to, profile: Some(profile), ..Light::new(kind, intensity) })
}

/// The axes z, then x, made orthonormal; `None` for a transform that flattens.
fn rotation(m: &DMat3) -> Option<DQuat> {
    let z: DVec3 = m.z_axis.try_normalize()?;
    let x = (m.x_axis - z * m.x_axis.dot(z)).try_normalize()?;
    Some(DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize())
}

fn profile(doc: &Document, index: usize, from: &str, report: &mut Report) -> Sound<(Arc<LightProfile>, f64)> {
    let raw = doc.raw(LIGHTS, index, &format!("{from}/light"), report)?;
    let at = pointer(LIGHTS, index);
    let bytes: Cow<[u8]> = match raw.get("uri").and_then(Value::as_str) {
        Some(uri) => doc.fetch(uri, &format!("{at}/uri"), report)?.bytes,
        None => {
            let view = index_of(raw, "bufferView", &at, report)?;
            let Some(view) = view else {
                return Err(report.problem(at, "has neither a uri nor a bufferView"));
            };
            Cow::Borrowed(doc.view(view, &format!("{at}/bufferView"), report)?.bytes)
        }
    };
    match ies::parse(&bytes) {
        Ok(profile) => {
            let (profile, candela) = ies::relative(profile);
            Ok((Arc::new(profile), candela))
        }
        Err(message) => Err(report.problem(at, message)),
    }
}
