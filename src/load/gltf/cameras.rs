//! Cameras and lights of nodes.

use super::document::{Document, name_of, number_of, numbers_of, pointer, required};
use super::nodes::Node;
use super::options::LightUnits;
use super::report::{Report, Sound};
use super::traits;
use crate::error::Choice;
use crate::load::ies::LUMENS_PER_WATT;
use crate::math::{DAffine3, DMat3};
use crate::scene::{
    Camera, GROUP_KEY, Light, LightKind, LightLinks, ObjectTraits, Projection, SpotFade, is_group_name,
};
use gltf::json::camera::Type;
use gltf::json::validation::Checked;
use serde_json::Value;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// The list of KHR_lights_punctual.
const LIGHTS: &str = "extensions/KHR_lights_punctual/lights";

/// The camera of a node, unless it shows nothing.
pub(super) fn camera(doc: &Document, node: &Node, index: usize, report: &mut Report) -> Sound<Camera> {
    let from = format!("{}/camera", node.pointer());
    let camera: gltf::json::Camera = doc.entry("cameras", index, &from, report)?;
    let raw = doc.raw("cameras", index, &from, report)?;
    let at = pointer("cameras", index);
    let Some(world_from_camera) = without_scale(&node.world_from_node) else {
        return Err(report.warn(node.pointer(), "flattens its camera, which is left out"));
    };
    let (projection, aspect_ratio) = match camera.type_ {
        Checked::Valid(Type::Perspective) => perspective(raw, &at, report)?,
        Checked::Valid(Type::Orthographic) => orthographic(raw, &at, report)?,
        Checked::Invalid => {
            return Err(report.problem(format!("{at}/type"), "is neither perspective nor orthographic"));
        }
    };
    let node_raw = doc.json.pointer(&node.pointer()).unwrap_or(&Value::Null);
    let name = match raw.get("name") {
        Some(_) => name_of(raw, "camera", index),
        None => name_of(node_raw, "camera of node", node.index),
    };
    let (lens, shift, motion) = (None, [0.0; 2], None);
    Ok(Camera {
        name,
        world_from_camera,
        projection,
        aspect_ratio,
        pixel_aspect: 1.0,
        lens,
        shift,
        clip: None,
        motion,
    })
}

fn perspective(camera: &Value, at: &str, report: &mut Report) -> Sound<(Projection, Option<f64>)> {
    let at = format!("{at}/perspective");
    let Some(perspective) = camera.get("perspective") else {
        return Err(report.problem(at, "is missing"));
    };
    let vfov_rad = required(number_of(perspective, "yfov", &at, report), "yfov", &at, report)?;
    if !(vfov_rad > 0.0 && vfov_rad < PI) {
        return Err(report.warn(
            format!("{at}/yfov"),
            format!("{vfov_rad} is not between 0 and pi: the camera is left out"),
        ));
    }
    let given = number_of(perspective, "aspectRatio", &at, report)?;
    let aspect = given.filter(|a| *a > 0.0 && a.is_finite());
    if let (Some(given), None) = (given, aspect) {
        let message = format!("{given} is not above 0: the picture's own is taken");
        report.warn(format!("{at}/aspectRatio"), message);
    }
    Ok((Projection::Perspective { vfov_rad }, aspect))
}

fn orthographic(camera: &Value, at: &str, report: &mut Report) -> Sound<(Projection, Option<f64>)> {
    let at = format!("{at}/orthographic");
    let Some(orthographic) = camera.get("orthographic") else {
        return Err(report.problem(at, "is missing"));
    };
    let mut size = |key: &str| match number_of(orthographic, key, &at, report)? {
        Some(size) if size != 0.0 && size.is_finite() => Ok(size.abs()),
        _ => Err(report.warn(format!("{at}/{key}"), "is missing or 0: the camera is left out")),
    };
    let (half_width, half_height) = (size("xmag")?, size("ymag")?);
    let aspect = Some(half_width / half_height).filter(|a| *a > 0.0 && a.is_finite());
    Ok((Projection::Orthographic { half_height }, aspect))
}

/// The rotation and translation of a transform: axes z, y and x made orthonormal in this order, right-handed. `None` for
/// a transform that flattens.
fn without_scale(transform: &DAffine3) -> Option<DAffine3> {
    let m = transform.matrix3;
    let z = m.z_axis.try_normalize()?;
    let y = (m.y_axis - z * m.y_axis.dot(z)).try_normalize()?;
    let rotation = DMat3::from_cols(y.cross(z), y, z);
    let placed = DAffine3::from_mat3_translation(rotation, transform.translation);
    placed.is_finite().then_some(placed)
}

/// What the intensities of lights, in candela and lux in the file, are divided by to be W/sr and W/m2: of point and spot lights, and of directional ones.
///
/// Blender's exporter writes candela and lux in its default mode; its mode "Unitless" leaves the factor of 683 out,
/// and its mode "Raw" also that of 4 pi between the watts of a lamp and its intensity.
fn divisors(units: LightUnits) -> (f64, f64) {
    match units {
        LightUnits::Auto | LightUnits::Spec => (LUMENS_PER_WATT, LUMENS_PER_WATT),
        LightUnits::Compat => (1.0, 1.0),
        LightUnits::Raw => (4.0 * PI, 1.0),
    }
}

/// What luminances in the file, cd/m2, are divided by to be radiances.
pub(super) fn lumens_per_watt(doc: &Document) -> f64 {
    divisors(doc.options.light_units).1
}

/// How spot lights fade: Blender's own way in its files, which KHR_lights_punctual has no words for, unless the user
/// wants the specification's.
fn fade(doc: &Document) -> SpotFade {
    if doc.is_from_blender() && doc.options.light_units != LightUnits::Spec {
        SpotFade::Smooth
    } else {
        SpotFade::Square
    }
}

/// Says what was done to the numbers of so many lights.
pub(super) fn note_units(doc: &Document, lights: usize, report: &mut Report) {
    if lights == 0 {
        return;
    }
    let message = match doc.options.light_units {
        LightUnits::Auto => {
            let origin = if doc.is_from_blender() {
                ", Blender's default for exporting watts, and spot lights fade as in Blender"
            } else {
                ""
            };
            let units = LUMENS_PER_WATT;
            let intensities = match lights {
                1 => "the intensity of 1 light was".to_string(),
                n => format!("the intensities of {n} lights were"),
            };
            format!("{intensities} divided by {units} lm/W{origin} ({})", Choice::LightUnits)
        }
        // The user knows.
        LightUnits::Spec | LightUnits::Compat | LightUnits::Raw => return,
    };
    report.note(format!("/{LIGHTS}"), message);
}

/// The group of lights that the `extras` of something name.
pub(super) fn light_group(raw: &Value, at: &str, report: &mut Report) -> Option<String> {
    let name = raw.get("extras")?.get(GROUP_KEY)?.as_str()?;
    if is_group_name(name) {
        return Some(name.to_string());
    }
    let message = format!(
        "'{name}' can't be the name of a group of lights (1 to 64 letters, digits, _ and -); ignored"
    );
    report.warn(format!("{at}/extras/{GROUP_KEY}"), message);
    None
}

/// The light of a node.
pub(super) fn light(doc: &Document, node: &Node, index: usize, report: &mut Report) -> Sound<Light> {
    let from = format!("{}/extensions/KHR_lights_punctual/light", node.pointer());
    let raw = doc.raw(LIGHTS, index, &from, report)?;
    let at = pointer(LIGHTS, index);
    let color = numbers_of(raw, "color", &at, report)?.unwrap_or([1.0; 3]);
    let strength = number_of(raw, "intensity", &at, report)?.unwrap_or(1.0);
    let is_directional = raw.get("type").and_then(Value::as_str) == Some("directional");
    let (local, directional) = divisors(doc.options.light_units);
    let divisor = if is_directional { directional } else { local };
    let intensity = color.map(|c| (c * strength / divisor) as f32);
    if intensity.iter().any(|i| !(i.is_finite() && *i >= 0.0)) {
        return Err(report
            .problem(at, "has a colour or an intensity that is negative or beyond the range of numbers"));
    }
    if raw.get("range").is_some() {
        report.warn(
            at.clone(),
            "has a range, which is not physical and ignored: light fades by distance alone",
        );
    }
    let position = node.world_from_node.translation;
    let direction = (-node.world_from_node.matrix3.z_axis).try_normalize();
    let kind = match raw.get("type").and_then(Value::as_str) {
        Some("point") => Some(LightKind::Point { position }),
        Some("directional") => direction.map(|direction| LightKind::Directional { direction }),
        Some("spot") => {
            let (inner_angle_rad, outer_angle_rad) = cone(raw, &at, report)?;
            direction.map(|direction| LightKind::Spot {
                position,
                direction,
                inner_angle_rad,
                outer_angle_rad,
                fade: fade(doc),
            })
        }
        _ => {
            return Err(report.problem(format!("{at}/type"), "is none of point, spot and directional"));
        }
    };
    let Some(kind) = kind else {
        return Err(report.warn(node.pointer(), "flattens its light, which is left out"));
    };
    let node_raw = doc.json.pointer(&node.pointer()).unwrap_or(&Value::Null);
    let of_node = light_group(node_raw, &node.pointer(), report);
    let group = of_node.or_else(|| light_group(raw, &at, report)).unwrap_or_default();
    let ObjectTraits { visible_to, .. } = traits::of_node(node_raw, &node.pointer(), report);
    let name = name_of(node_raw, "light of node", node.index);
    Ok(Light {
        name,
        kind,
        intensity,
        profile: None,
        group,
        visible_to,
        links: LightLinks::ALL,
        motion: None,
    })
}

/// Inner and outer half angle of a spot light, in order.
fn cone(light: &Value, at: &str, report: &mut Report) -> Sound<(f64, f64)> {
    let at = format!("{at}/spot");
    let spot = light.get("spot").unwrap_or(&Value::Null);
    let inner = number_of(spot, "innerConeAngle", &at, report)?.unwrap_or(0.0);
    let outer = number_of(spot, "outerConeAngle", &at, report)?.unwrap_or(FRAC_PI_4);
    // The specification wants a slope; Blender writes none where a cone ends at once (blend 0).
    if !(0.0 <= inner && inner <= outer && 0.0 < outer && outer <= FRAC_PI_2 + 1e-6) {
        report.warn(
            at,
            format!("the cone's angles {inner} and {outer} are not 0 <= inner <= outer <= pi/2; clamped"),
        );
    }
    let outer = outer.clamp(1e-6, FRAC_PI_2);
    Ok((inner.clamp(0.0, outer), outer))
}
