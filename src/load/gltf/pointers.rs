//! KHR_animation_pointer: channels whose targets are JSON pointers. Node transforms and morph target weights are part of
//! the pose; all other values are written into the document before a time sample is read, and restored afterwards.

use super::animation::{Element, Samplers, pose_target};
use super::document::Document;
use super::report::{Report, Valid};
use super::scene_builder::SharedAssets;
use serde_json::{Map, Value};
use std::f64::consts::PI;

const NAME: &str = "KHR_animation_pointer";

/// Supported JSON pointers and their number of components; `*` is any index. Source: mutable properties of the "glTF 2.0
/// Asset Object Model Specification" (Khronos), and of supported draft extensions.
const PROPERTIES: &[(&str, usize)] = &[
    ("/cameras/*/orthographic/xmag", 1),
    ("/cameras/*/orthographic/ymag", 1),
    ("/cameras/*/perspective/aspectRatio", 1),
    ("/cameras/*/perspective/yfov", 1),
    ("/extensions/EXT_lights_area/lights/*/color", 3),
    ("/extensions/EXT_lights_area/lights/*/intensity", 1),
    ("/extensions/EXT_lights_area/lights/*/rect/aspect", 1),
    ("/extensions/EXT_lights_area/lights/*/size", 1),
    ("/extensions/EXT_lights_image_based/lights/*/intensity", 1),
    ("/extensions/KHR_lights_punctual/lights/*/color", 3),
    ("/extensions/KHR_lights_punctual/lights/*/intensity", 1),
    ("/extensions/KHR_lights_punctual/lights/*/range", 1),
    ("/extensions/KHR_lights_punctual/lights/*/spot/innerConeAngle", 1),
    ("/extensions/KHR_lights_punctual/lights/*/spot/outerConeAngle", 1),
    ("/materials/*/alphaCutoff", 1),
    ("/materials/*/emissiveFactor", 3),
    ("/materials/*/normalTexture/scale", 1),
    ("/materials/*/occlusionTexture/strength", 1),
    ("/materials/*/pbrMetallicRoughness/baseColorFactor", 4),
    ("/materials/*/pbrMetallicRoughness/metallicFactor", 1),
    ("/materials/*/pbrMetallicRoughness/roughnessFactor", 1),
    ("/nodes/*/extensions/EXT_lights_ies/color", 3),
    ("/nodes/*/extensions/EXT_lights_ies/multiplier", 1),
];

/// The supported pointer to a unit quaternion.
const ROTATION: &str = "/extensions/EXT_lights_image_based/lights/*/rotation";

/// Animatable properties of the extensions of materials.
const MATERIAL_EXTENSIONS: &[(&str, &[(&str, usize)])] = &[
    ("KHR_materials_anisotropy", &[("anisotropyStrength", 1), ("anisotropyRotation", 1)]),
    (
        "KHR_materials_clearcoat",
        &[("clearcoatFactor", 1), ("clearcoatRoughnessFactor", 1), ("clearcoatNormalTexture/scale", 1)],
    ),
    ("KHR_materials_diffuse_roughness", &[("diffuseRoughnessFactor", 1)]),
    (
        "KHR_materials_diffuse_transmission",
        &[("diffuseTransmissionFactor", 1), ("diffuseTransmissionColorFactor", 3)],
    ),
    ("KHR_materials_dispersion", &[("dispersion", 1)]),
    ("KHR_materials_emissive_strength", &[("emissiveStrength", 1)]),
    ("KHR_materials_ior", &[("ior", 1)]),
    (
        "KHR_materials_iridescence",
        &[
            ("iridescenceFactor", 1),
            ("iridescenceIor", 1),
            ("iridescenceThicknessMinimum", 1),
            ("iridescenceThicknessMaximum", 1),
        ],
    ),
    (
        "KHR_materials_pbrSpecularGlossiness",
        &[("diffuseFactor", 4), ("specularFactor", 3), ("glossinessFactor", 1)],
    ),
    ("KHR_materials_sheen", &[("sheenColorFactor", 3), ("sheenRoughnessFactor", 1)]),
    ("KHR_materials_specular", &[("specularFactor", 1), ("specularColorFactor", 3)]),
    ("KHR_materials_transmission", &[("transmissionFactor", 1)]),
    ("KHR_materials_volume", &[("thicknessFactor", 1), ("attenuationDistance", 1), ("attenuationColor", 3)]),
    (
        "KHR_materials_scatter",
        &[("scatterStrengthFactor", 1), ("multiscatterColorFactor", 3), ("scatterAnisotropy", 1)],
    ),
    (
        "KHR_materials_volume_scatter",
        &[("multiscatterColorFactor", 3), ("multiscatterColor", 3), ("scatterAnisotropy", 1)],
    ),
];

/// Animatable properties of texture transforms.
const TEXTURE_TRANSFORM: &[(&str, usize)] = &[("offset", 2), ("rotation", 1), ("scale", 2)];

/// Pointers without effect on pictures: clip planes, which aren't supported, and interaction.
const WITHOUT_EFFECT: &[&str] = &[
    "/cameras/*/orthographic/zfar",
    "/cameras/*/orthographic/znear",
    "/cameras/*/perspective/zfar",
    "/cameras/*/perspective/znear",
    "/nodes/*/extensions/KHR_node_hoverability/hoverable",
    "/nodes/*/extensions/KHR_node_selectability/selectable",
];

/// JSON objects that may be missing in the file: defaults are inserted.
const OPTIONAL_OBJECTS: &[&str] = &[
    "KHR_materials_emissive_strength",
    "KHR_node_visibility",
    "KHR_texture_transform",
    "extensions",
    "pbrMetallicRoughness",
    "spot",
];

/// Pointers to light properties. All but rotations are clamped to 0, since splines may overshoot.
const LIGHTS: [&str; 4] = [
    "/extensions/KHR_lights_punctual/lights/",
    "/extensions/EXT_lights_area/lights/",
    "/extensions/EXT_lights_ies/",
    IMAGE_LIGHTS,
];

const IMAGE_LIGHTS: &str = "/extensions/EXT_lights_image_based/lights/";

/// The pointer to the field of view of a camera, which must be between 0 and pi.
const FIELD_OF_VIEW: &str = "/cameras/*/perspective/yfov";

/// A JSON pointer and the new value there.
type Change = (String, Value);

/// Values that animations write into a document for a time sample.
#[derive(Default)]
pub(super) struct PointerAnimation {
    /// The original values of changed list entries.
    originals: Vec<Change>,
    /// The changes in the cached materials.
    material_changes: Vec<Change>,
    /// The changes in the cached environment.
    environment_changes: Vec<Change>,
}

impl PointerAnimation {
    /// Writes the values at a time, seconds; `None` restores the rest pose.
    pub fn play(
        &mut self,
        doc: &mut Document,
        time_s: Option<f64>,
        shared: &mut SharedAssets,
        report: &mut Report,
    ) {
        for (entry, value) in self.originals.drain(..) {
            if let Some(place) = doc.json.pointer_mut(&entry) {
                *place = value;
            }
        }
        // Warnings apply to all time samples.
        let changes = time_s.map_or_else(Vec::new, |t| report.lasting(|report| changes(doc, t, report)));
        for (pointer, value) in &changes {
            let entry = entry_of(pointer);
            if !self.originals.iter().any(|(known, _)| known == entry)
                && let Some(original) = doc.json.pointer(entry)
            {
                self.originals.push((entry.to_string(), original.clone()));
            }
            write(&mut doc.json, pointer, value.clone());
        }
        let changes_below = |list: &str| -> Vec<Change> {
            changes.iter().filter(|(pointer, _)| pointer.starts_with(list)).cloned().collect()
        };
        let (material_changes, environment_changes) =
            (changes_below("/materials/"), changes_below(IMAGE_LIGHTS));
        if environment_changes != self.environment_changes {
            shared.environment_image = None;
            self.environment_changes = environment_changes;
        }
        if material_changes != self.material_changes {
            shared.forget_materials();
            self.material_changes = material_changes;
        }
    }
}

/// The values of all pointers at a time, without the pose. Of several channels with one target, the first is used.
fn changes(doc: &Document, time_s: f64, report: &mut Report) -> Vec<Change> {
    let mut samplers = Samplers::new(doc, time_s);
    let mut changes: Vec<Change> = Vec::new();
    let animations = doc.json.get("animations").and_then(Value::as_array);
    for (a, animation) in animations.into_iter().flatten().enumerate() {
        let channels = animation.get("channels").and_then(Value::as_array);
        for (c, channel) in channels.into_iter().flatten().enumerate() {
            let is_pointer = channel.pointer("/target/path").and_then(Value::as_str) == Some("pointer");
            if !is_pointer || pose_target(&channel["target"]).is_some() {
                continue;
            }
            let at = format!("/animations/{a}/channels/{c}");
            let Ok(Some((pointer, element))) = target(doc, channel, &at, report) else { continue };
            if changes.iter().any(|(known, _)| known == pointer) {
                report.warn(at, format!("animates {pointer}, like an earlier channel; the first is used"));
                continue;
            }
            if let Ok(mut numbers) = samplers.value(animation, channel, element, &at, report) {
                if matches_pattern(FIELD_OF_VIEW, pointer) {
                    clamp_field_of_view(pointer, &mut numbers, &at, report);
                }
                let is_of_light = LIGHTS.iter().any(|list| pointer.contains(list));
                if is_of_light && element != Element::Rotation && numbers.iter().any(|n| *n < 0.0) {
                    numbers.iter_mut().for_each(|n| *n = n.max(0.0));
                    report.warn(at, format!("interpolates {pointer} to values below 0, which were clamped"));
                }
                changes.push((pointer.to_string(), value_of(element, &numbers)));
            }
        }
    }
    changes
}

/// Clamps a field of view to 0..pi with a warning: splines may overshoot.
fn clamp_field_of_view(pointer: &str, numbers: &mut [f64], at: &str, report: &mut Report) {
    const MIN: f64 = 1e-3;
    for number in numbers.iter_mut().filter(|n| !(MIN..=PI - MIN).contains(*n)) {
        *number = number.clamp(MIN, PI - MIN);
        report.warn(at, format!("interpolates {pointer} to values outside 0 to pi, which were clamped"));
    }
}

/// The pointer of a channel and its value type; `None` for pointers without effect on pictures.
fn target<'v>(
    doc: &Document,
    channel: &'v Value,
    at: &str,
    report: &mut Report,
) -> Valid<Option<(&'v str, Element)>> {
    let place = format!("{at}/target/extensions/{NAME}/pointer");
    let pointer = channel.pointer(&format!("/target/extensions/{NAME}/pointer"));
    let Some(pointer) = pointer.and_then(Value::as_str) else {
        return Err(report.problem(place, "is missing or not a JSON pointer"));
    };
    if WITHOUT_EFFECT.iter().any(|pattern| matches_pattern(pattern, pointer)) {
        return Ok(None);
    }
    let Some(element) = element_of(pointer) else {
        let message = format!("'{pointer}' is not an animatable property; the channel is ignored");
        return Err(report.warn(place, ("animation-pointer-unknown", message)));
    };
    if !exists(&doc.json, pointer) {
        let message = format!("'{pointer}' does not exist in the file; the channel is ignored");
        return Err(report.warn(place, ("animation-pointer-unknown", message)));
    }
    Ok(Some((pointer, element)))
}

/// The value type of a pointer; `None` if not supported.
fn element_of(pointer: &str) -> Option<Element> {
    if matches_pattern("/nodes/*/extensions/KHR_node_visibility/visible", pointer) {
        return Some(Element::Flag);
    }
    if matches_pattern(ROTATION, pointer) {
        return Some(Element::Rotation);
    }
    let listed =
        || PROPERTIES.iter().find(|(pattern, _)| matches_pattern(pattern, pointer)).map(|(_, count)| *count);
    listed().or_else(|| of_material(pointer)).map(Element::Numbers)
}

/// Number of components of a property of a material extension or a texture transform.
fn of_material(pointer: &str) -> Option<usize> {
    let (index, inside) = pointer.strip_prefix("/materials/")?.split_once('/')?;
    index.parse::<usize>().ok()?;
    let count = |list: &[(&str, usize)], key: &str| list.iter().find(|(k, _)| *k == key).map(|(_, n)| *n);
    if let Some((texture, key)) = inside.split_once("/extensions/KHR_texture_transform/") {
        return count(TEXTURE_TRANSFORM, key).filter(|_| texture.ends_with("Texture"));
    }
    let (extension, key) = inside.strip_prefix("extensions/")?.split_once('/')?;
    let (_, properties) = MATERIAL_EXTENSIONS.iter().find(|(name, _)| *name == extension)?;
    count(properties, key)
}

/// Whether a pointer matches a pattern.
fn matches_pattern(pattern: &str, pointer: &str) -> bool {
    let step_matches = |(p, s): (&str, &str)| p == s || p == "*" && s.parse::<usize>().is_ok();
    pattern.split('/').count() == pointer.split('/').count()
        && pattern.split('/').zip(pointer.split('/')).all(step_matches)
}

/// Whether the parent object of a pointer exists or has a default.
fn exists(json: &Value, pointer: &str) -> bool {
    let mut steps: Vec<&str> = pointer.split('/').skip(1).collect();
    steps.pop();
    let mut at = Some(json);
    for step in steps {
        at = match at {
            Some(Value::Object(object)) if object.contains_key(step) => object.get(step),
            Some(Value::Object(_)) | None if OPTIONAL_OBJECTS.contains(&step) => None,
            Some(Value::Array(list)) => match step.parse::<usize>().ok().and_then(|i| list.get(i)) {
                Some(entry) => Some(entry),
                None => return false,
            },
            _ => return false,
        };
    }
    at.is_none_or(Value::is_object)
}

/// The part of a pointer up to the entry of a list, such as `/materials/0`.
fn entry_of(pointer: &str) -> &str {
    let steps = if pointer.starts_with("/extensions/") { 5 } else { 3 };
    pointer.match_indices('/').nth(steps - 1).map_or(pointer, |(end, _)| &pointer[..end])
}

fn value_of(element: Element, numbers: &[f64]) -> Value {
    match (element, numbers) {
        (Element::Flag, [number]) => Value::Bool(*number != 0.0),
        (Element::Numbers(1), [number]) => Value::from(*number),
        _ => Value::from(numbers.to_vec()),
    }
}

/// Writes a value at a pointer that [`exists`].
fn write(json: &mut Value, pointer: &str, value: Value) {
    let mut at = json;
    for step in pointer.split('/').skip(1) {
        let next = match at {
            Value::Object(object) => Some(object.entry(step).or_insert_with(|| Value::Object(Map::new()))),
            Value::Array(list) => step.parse::<usize>().ok().and_then(|index| list.get_mut(index)),
            _ => None,
        };
        let Some(next) = next else { return };
        at = next;
    }
    *at = value;
}
