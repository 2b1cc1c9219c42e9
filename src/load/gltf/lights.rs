//! Cameras, lights and portals of nodes, and their ray visibility.

use super::document::{Document, index_of, name_of, number_of, numbers_of, pointer, required};
use super::nodes::Node;
use super::report::{Report, Valid};
use crate::error::Choice;
use crate::load::ies;
use crate::load::ies::LUMENS_PER_WATT;
use crate::load::options::LightUnits;
use crate::math::{DAffine3, DMat3, DQuat, DVec3};
use crate::scene::{
    Camera, EmitterTraits, GROUP_KEY, Instance, Light, LightKind, LightLinks, LightProfile, Material,
    MaterialId, Mesh, MeshId, MeshPart, ObjectTraits, Portal, Projection, Quad, RayKinds, Scene, Shape,
    ShapeKind, SpotFalloff, is_group_name, without_scale,
};
use crate::shape::mesh_of;
use gltf::json::camera::Type;
use gltf::json::validation::Checked;
use serde_json::Value;
use std::borrow::Cow;
use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
use std::sync::Arc;

/// JSON path of the lights of KHR_lights_punctual.
const PUNCTUAL_LIGHTS: &str = "extensions/KHR_lights_punctual/lights";

pub(super) fn camera(doc: &Document, node: &Node, index: usize, report: &mut Report) -> Valid<Camera> {
    let from = format!("{}/camera", node.pointer());
    let camera: gltf::json::Camera = doc.entry("cameras", index, &from, report)?;
    let raw = doc.raw("cameras", index, &from, report)?;
    let at = pointer("cameras", index);
    let Some(world_from_camera) = without_scale(&node.world_from_node) else {
        return Err(report.warn(node.pointer(), "has a singular transform: its camera is left out"));
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
    Ok(Camera { name, aspect_ratio, ..Camera::new(world_from_camera, projection) })
}

fn perspective(camera: &Value, at: &str, report: &mut Report) -> Valid<(Projection, Option<f64>)> {
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
    let aspect_ratio = number_of(perspective, "aspectRatio", &at, report)?;
    let aspect = aspect_ratio.filter(|a| *a > 0.0 && a.is_finite());
    if let (Some(aspect_ratio), None) = (aspect_ratio, aspect) {
        let message = format!("{aspect_ratio} is not above 0: the aspect ratio of the picture is used");
        report.warn(format!("{at}/aspectRatio"), message);
    }
    Ok((Projection::Perspective { vfov_rad }, aspect))
}

fn orthographic(camera: &Value, at: &str, report: &mut Report) -> Valid<(Projection, Option<f64>)> {
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

/// Divisors from the file's units (candela, lux) to W/sr for point and spot lights, and to W/m2 for directional lights.
///
/// Blender's exporter writes candela and lux in its default mode; its mode "Unitless" omits the factor 683 lm/W, and
/// "Raw" also the factor 1 / (4 pi) from power to intensity.
fn divisors(doc: &Document) -> (f64, f64) {
    match doc.options.light_units {
        LightUnits::Auto if engine(doc).is_some() => (1.0, 1.0),
        LightUnits::Auto | LightUnits::Spec => (LUMENS_PER_WATT, LUMENS_PER_WATT),
        LightUnits::Compat => (1.0, 1.0),
        LightUnits::Raw => (4.0 * PI, 1.0),
    }
}

/// Engines whose exporters write unitless intensities, where pi makes a white surface white. Substring of the file's
/// generator, and name.
const ENGINES: [(&str, &str); 7] = [
    ("THREE", "three.js"),
    ("babylon", "Babylon.js"),
    ("Unity", "Unity"),
    ("Godot", "Godot"),
    ("PlayCanvas", "PlayCanvas"),
    ("Sketchfab", "Sketchfab"),
    ("Needle", "Needle Engine"),
];

/// The engine of [`ENGINES`] that wrote the file.
fn engine(doc: &Document) -> Option<&'static str> {
    let generator = doc.json.pointer("/asset/generator").and_then(Value::as_str)?;
    ENGINES.iter().find(|(part, _)| generator.contains(part)).map(|&(_, name)| name)
}

/// Divisor from luminance (cd/m2) to radiance (W/sr/m2).
pub(super) fn lumens_per_watt(doc: &Document) -> f64 {
    divisors(doc).1
}

/// Falloff of spot lights at the edge of the cone: Blender's for its files, unless the user wants the specification's.
fn falloff(doc: &Document) -> SpotFalloff {
    if doc.is_from_blender() && doc.options.light_units != LightUnits::Spec {
        SpotFalloff::Smooth
    } else {
        SpotFalloff::Square
    }
}

/// Adds a note about the unit conversion of `lights` lights.
pub(super) fn note_units(doc: &Document, lights: usize, report: &mut Report) {
    if lights == 0 {
        return;
    }
    let message = match doc.options.light_units {
        LightUnits::Auto if engine(doc).is_some() => format!(
            "the intensities of {lights} lights are taken as W/sr and W/m2, the convention of {}, which wrote the file ({})",
            engine(doc).unwrap_or_default(),
            Choice::LightUnits
        ),
        LightUnits::Auto => {
            let origin = if doc.is_from_blender() {
                ", Blender's default for exporting watts, and spot lights have Blender's falloff"
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
        // The user's choice needs no note.
        LightUnits::Spec | LightUnits::Compat | LightUnits::Raw => return,
    };
    report.note(format!("/{PUNCTUAL_LIGHTS}"), message);
}

/// The light group named in the `extras` of an object.
pub(super) fn light_group(raw: &Value, at: &str, report: &mut Report) -> Option<String> {
    let name = raw.get("extras")?.get(GROUP_KEY)?.as_str()?;
    if is_group_name(name) {
        return Some(name.to_string());
    }
    let message =
        format!("'{name}' is not a valid light group name (1 to 64 letters, digits, _ and -); ignored");
    report.warn(format!("{at}/extras/{GROUP_KEY}"), message);
    None
}

pub(super) fn punctual_light(doc: &Document, node: &Node, index: usize, report: &mut Report) -> Valid<Light> {
    let from = format!("{}/extensions/KHR_lights_punctual/light", node.pointer());
    let raw = doc.raw(PUNCTUAL_LIGHTS, index, &from, report)?;
    let at = pointer(PUNCTUAL_LIGHTS, index);
    let color = numbers_of(raw, "color", &at, report)?.unwrap_or([1.0; 3]);
    let strength = number_of(raw, "intensity", &at, report)?.unwrap_or(1.0);
    let is_directional = raw.get("type").and_then(Value::as_str) == Some("directional");
    let (local, directional) = divisors(doc);
    let divisor = if is_directional { directional } else { local };
    let intensity = color.map(|c| (c * strength / divisor) as f32);
    if intensity.iter().any(|i| !(i.is_finite() && *i >= 0.0)) {
        return Err(report.problem(at, "has a colour or an intensity that is negative or too large"));
    }
    if raw.get("range").is_some() {
        report.warn(
            at.clone(),
            "has a range, which is not physical and is ignored: light falls off with the squared distance",
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
                falloff: falloff(doc),
            })
        }
        _ => {
            return Err(report.problem(format!("{at}/type"), "must be point, spot or directional"));
        }
    };
    let Some(kind) = kind else {
        return Err(report.warn(node.pointer(), "has a singular transform: its light is left out"));
    };
    let node_raw = doc.json.pointer(&node.pointer()).unwrap_or(&Value::Null);
    let of_node = light_group(node_raw, &node.pointer(), report);
    let group = of_node.or_else(|| light_group(raw, &at, report)).unwrap_or_default();
    let ObjectTraits { visible_to, .. } = object_traits(node_raw, &node.pointer(), report);
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
fn cone(light: &Value, at: &str, report: &mut Report) -> Valid<(f64, f64)> {
    let at = format!("{at}/spot");
    let spot = light.get("spot").unwrap_or(&Value::Null);
    let inner = number_of(spot, "innerConeAngle", &at, report)?.unwrap_or(0.0);
    let outer = number_of(spot, "outerConeAngle", &at, report)?.unwrap_or(FRAC_PI_4);
    // The specification requires inner < outer, but Blender writes equal angles for sharp edges (blend 0).
    if !(0.0 <= inner && inner <= outer && 0.0 < outer && outer <= FRAC_PI_2 + 1e-6) {
        report.warn(
            at,
            format!("the cone's angles {inner} and {outer} are not 0 <= inner <= outer <= pi/2; clamped"),
        );
    }
    let outer = outer.clamp(1e-6, FRAC_PI_2);
    Ok((inner.clamp(0.0, outer), outer))
}

// Ray visibility in the `extras` of a node (custom properties in exporters): either `visible_to`, a list of ray types or
// text with commas or spaces, or a boolean per ray type: `visible_camera`, `visible_diffuse`, `visible_glossy`,
// `visible_transmission`, `visible_volume` (or `visible_volume_scatter`), `visible_shadow`. Also `holdout` and
// `shadow_catcher`, optionally with the prefix `is_`.

/// Visibility flags of a node from its JSON object.
pub(super) fn object_traits(raw: &Value, at: &str, report: &mut Report) -> ObjectTraits {
    let Some(extras) = raw.get("extras").filter(|extras| extras.is_object()) else {
        return ObjectTraits::default();
    };
    let at = format!("{at}/extras");
    let mut visible_to = visible_to(extras, &at, report);
    for (name, kind) in RayKinds::NAMED {
        let keys = [format!("visible_{name}"), format!("visible_{name}_scatter")];
        for key in keys.iter().take(if kind == RayKinds::VOLUME { 2 } else { 1 }) {
            if let Some(is_visible) = flag(extras, key, &at, report) {
                visible_to = visible_to.set(kind, is_visible);
            }
        }
    }
    let mut is = |keys: [&str; 2]| keys.iter().any(|key| flag(extras, key, &at, report) == Some(true));
    let is_holdout = is(["holdout", "is_holdout"]);
    let is_shadow_catcher = is(["shadow_catcher", "is_shadow_catcher"]);
    ObjectTraits { visible_to, is_holdout, is_shadow_catcher, ..ObjectTraits::default() }
}

/// The ray types in `visible_to`; all by default.
fn visible_to(extras: &Value, at: &str, report: &mut Report) -> RayKinds {
    let Some(value) = extras.get("visible_to") else { return RayKinds::ALL };
    let names: Option<Vec<&str>> = match value {
        Value::String(text) => Some(text.split([',', ' ']).filter(|name| !name.is_empty()).collect()),
        Value::Array(list) => list.iter().map(Value::as_str).collect(),
        _ => None,
    };
    let kinds: Option<Vec<RayKinds>> =
        names.and_then(|names| names.into_iter().map(RayKinds::from_name).collect());
    match kinds {
        Some(kinds) => kinds.into_iter().fold(RayKinds::NONE, RayKinds::with),
        None => {
            let names = RayKinds::NAMED.map(|(name, _)| name).join(", ");
            report.warn(format!("{at}/visible_to"), format!("must contain only {names}; ignored"));
            RayKinds::ALL
        }
    }
}

/// A boolean, which custom properties may also store as 1 or 0.
fn flag(extras: &Value, key: &str, at: &str, report: &mut Report) -> Option<bool> {
    let value = extras.get(key)?;
    let found = match value.as_f64() {
        Some(1.0) => Some(true),
        Some(0.0) => Some(false),
        _ => value.as_bool(),
    };
    if found.is_none() {
        report.warn(format!("{at}/{key}"), "is neither true nor false; ignored");
    }
    found
}

// EXT_lights_area (draft): rectangles and disks of constant radiance, one-sided, facing -z.

const AREA_LIGHT: &str = "extensions/EXT_lights_area";
const AREA_LIGHTS: &str = "extensions/EXT_lights_area/lights";

/// An area light in world space.
pub(super) struct AreaLight {
    name: String,
    radiance: [f32; 3],
    group: String,
    emitter_traits: EmitterTraits,
    shape: AreaShape,
    /// From the unit square, centred at the origin with normal -z, to world space.
    world_from_unit: DAffine3,
}

/// Shape of an area light.
#[derive(Clone, Copy, PartialEq)]
enum AreaShape {
    Rectangle,
    Disk,
    /// A moving disk: light sampling supports moving disks as meshes only.
    TriangulatedDisk,
}

/// The area light of a node, if any.
pub(super) fn area_light(doc: &Document, node: &Node, moves: bool, report: &mut Report) -> Option<AreaLight> {
    let raw = node.area_light(doc)?;
    // `Err`: already reported.
    let mut light = read_area_light(doc, (node, raw), report).ok()?;
    if moves && light.shape == AreaShape::Disk {
        light.shape = AreaShape::TriangulatedDisk;
    }
    Some(light)
}

fn read_area_light(doc: &Document, (node, raw): (&Node, &Value), report: &mut Report) -> Valid<AreaLight> {
    let at = format!("{}/{AREA_LIGHT}", node.pointer());
    let index = required(index_of(raw, "light", &at, report), "light", &at, report)?;
    let light = doc.raw(AREA_LIGHTS, index, &format!("{at}/light"), report)?;
    let at = pointer(AREA_LIGHTS, index);
    report.warn("", ("extension-draft", "EXT_lights_area is a draft: its support may change"));
    let shape = match light.get("type").and_then(Value::as_str) {
        Some("rect") => AreaShape::Rectangle,
        Some("disk") => AreaShape::Disk,
        _ => return Err(report.problem(format!("{at}/type"), "is neither rect nor disk")),
    };
    let height = positive(light, "size", &at, report)?;
    let aspect = match light.get("rect").filter(|_| shape == AreaShape::Rectangle) {
        Some(rect) => positive(rect, "aspect", &format!("{at}/rect"), report)?,
        None => 1.0,
    };
    let color = numbers_of(light, "color", &at, report)?.unwrap_or([1.0; 3]);
    let luminance = number_of(light, "intensity", &at, report)?.unwrap_or(1000.0);
    let radiance = color.map(|c| (c * luminance / lumens_per_watt(doc)) as f32);
    if radiance.iter().any(|r| !(r.is_finite() && *r >= 0.0)) {
        return Err(report.problem(at, "has a colour or an intensity that is negative or too large"));
    }
    let Some(world_from_unit) = world_from_unit(&node.world_from_node, [height * aspect, height]) else {
        return Err(report.warn(node.pointer(), "has a singular transform: its light is left out"));
    };
    let node_raw = doc.json.pointer(&node.pointer()).unwrap_or(&Value::Null);
    let of_node = light_group(node_raw, &node.pointer(), report);
    let group = of_node.or_else(|| light_group(light, &at, report)).unwrap_or_default();
    let ObjectTraits { visible_to, .. } = object_traits(node_raw, &node.pointer(), report);
    let emitter_traits = EmitterTraits { visible_to, ..EmitterTraits::default() };
    let name = name_of(node_raw, "light of node", node.index);
    Ok(AreaLight { name, radiance, group, emitter_traits, shape, world_from_unit })
}

/// A positive size, 1 by default.
fn positive(object: &Value, key: &str, at: &str, report: &mut Report) -> Valid<f64> {
    let size = number_of(object, key, at, report)?.unwrap_or(1.0);
    // Areas are squares of sizes and must be finite in f32.
    if (1e-15..=1e15).contains(&size) {
        return Ok(size);
    }
    Err(report.problem(format!("{at}/{key}"), format!("{size} is not a size from 1e-15 to 1e15")))
}

/// The transform of a light: the rotation of a node (axes orthonormalised in the order z, y) and its largest scale factor
/// for both sides. `None` for singular transforms.
fn world_from_unit(world_from_node: &DAffine3, size: [f64; 2]) -> Option<DAffine3> {
    let m = world_from_node.matrix3;
    let z = m.z_axis.try_normalize()?;
    let y = (m.y_axis - z * m.y_axis.dot(z)).try_normalize()?;
    let scale = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::length).into_iter().fold(0.0, f64::max);
    let [width, height] = size.map(|s| s * scale);
    let axes = DMat3::from_cols(y.cross(z) * width, y * height, z);
    let placed = DAffine3::from_mat3_translation(axes, world_from_node.translation);
    placed.is_finite().then_some(placed)
}

impl AreaLight {
    /// Adds the light's emitter and its material to a scene.
    pub fn add_to(self, scene: &mut Scene) {
        let AreaLight { name, radiance, group, emitter_traits, shape, world_from_unit } = self;
        let mut emitter = Material::emitter(&name, radiance, false);
        (emitter.light_group, emitter.is_light) = (group, true);
        emitter.emitter_traits =
            Some(emitter_traits).filter(|emitter_traits| *emitter_traits != EmitterTraits::default());
        let material = scene.add_material(emitter);
        let (x, y, center) =
            (world_from_unit.matrix3.x_axis, world_from_unit.matrix3.y_axis, world_from_unit.translation);
        match shape {
            AreaShape::Rectangle => {
                // The front is the side of the cross product of the edges: -z.
                let quad = Quad::new(center - (x + y) / 2.0, y, x, material);
                scene.quads.push(Quad { name, ..quad });
            }
            AreaShape::Disk => {
                let disk = Shape::disk(center, -world_from_unit.matrix3.z_axis, y.length() / 2.0, material);
                scene.shapes.push(Shape { name, ..disk });
            }
            AreaShape::TriangulatedDisk => {
                let mesh = triangulated_disk(scene, &name, material);
                let half = DMat3::from_cols(y / 2.0, x / 2.0, -world_from_unit.matrix3.z_axis);
                let placed = Instance::new(mesh, DAffine3::from_mat3_translation(half, center));
                scene.instances.push(Instance { name, ..placed });
            }
        }
    }
}

fn triangulated_disk(scene: &mut Scene, name: &str, material: MaterialId) -> MeshId {
    let mut mesh = Mesh { name: format!("{name} (disk)"), ..mesh_of(ShapeKind::Disk) };
    let triangle_count = mesh.triangles.len() as u32;
    mesh.parts.push(MeshPart { first_triangle: 0, triangle_count, material });
    scene.add_mesh(mesh)
}

/// The transform from the unit square to a quad in world space.
pub(super) fn world_from_quad(quad: &Quad) -> DAffine3 {
    let axes = DMat3::from_cols(quad.edge_u, quad.edge_v, quad.edge_u.cross(quad.edge_v).normalize_or_zero());
    DAffine3::from_mat3_translation(axes, quad.corner)
}

// EXT_lights_ies: point lights with photometric profiles (IES LM-63).

const IES_LIGHT: &str = "extensions/EXT_lights_ies";
const IES_LIGHTS: &str = "extensions/EXT_lights_ies/lights";

/// IES profiles by index: normalised to a maximum of 1, and the maximum in candela.
pub(super) type Profiles = HashMap<usize, Valid<(Arc<LightProfile>, f64)>>;

/// The light with an IES profile of a node, if any.
pub(super) fn ies_light(
    doc: &Document,
    node: &Node,
    profiles: &mut Profiles,
    report: &mut Report,
) -> Option<Valid<Light>> {
    node.profiled_light(doc).map(|raw| read_ies_light(doc, (node, raw), profiles, report))
}

fn read_ies_light(
    doc: &Document,
    (node, raw): (&Node, &Value),
    profiles: &mut Profiles,
    report: &mut Report,
) -> Valid<Light> {
    let at = format!("{}/{IES_LIGHT}", node.pointer());
    let index = required(index_of(raw, "light", &at, report), "light", &at, report)?;
    let cached = match profiles.get(&index) {
        Some(cached) => cached.clone(),
        None => {
            let read = report.lasting(|report| profile(doc, index, &at, report));
            profiles.insert(index, read.clone());
            read
        }
    };
    let (profile, candela) = cached?;
    let factor = number_of(raw, "multiplier", &at, report)?.unwrap_or(1.0);
    let color = numbers_of(raw, "color", &at, report)?.unwrap_or([1.0; 3]);
    let intensity = color.map(|c| (c.clamp(0.0, 1.0) * factor * candela / LUMENS_PER_WATT) as f32);
    if intensity.iter().any(|i| !(i.is_finite() && *i >= 0.0)) {
        return Err(report.problem(at, "has a multiplier or a colour that is negative or too large"));
    }
    let Some(rotation) = rotation(&node.world_from_node.matrix3) else {
        return Err(report.warn(node.pointer(), "has a singular transform: its light is left out"));
    };
    let kind = LightKind::Profiled { position: node.world_from_node.translation, rotation, cone: None };
    let node_raw = doc.json.pointer(&node.pointer()).unwrap_or(&Value::Null);
    let group = light_group(node_raw, &node.pointer(), report).unwrap_or_default();
    let ObjectTraits { visible_to, .. } = object_traits(node_raw, &node.pointer(), report);
    let name = name_of(node_raw, "light of node", node.index);
    Ok(Light { name, group, visible_to, profile: Some(profile), ..Light::new(kind, intensity) })
}

/// The rotation of a transform: axes orthonormalised in the order z, x; `None` for singular transforms.
fn rotation(m: &DMat3) -> Option<DQuat> {
    let z: DVec3 = m.z_axis.try_normalize()?;
    let x = (m.x_axis - z * m.x_axis.dot(z)).try_normalize()?;
    Some(DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize())
}

fn profile(doc: &Document, index: usize, from: &str, report: &mut Report) -> Valid<(Arc<LightProfile>, f64)> {
    let raw = doc.raw(IES_LIGHTS, index, &format!("{from}/light"), report)?;
    let at = pointer(IES_LIGHTS, index);
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
            let (profile, candela) = ies::normalized(profile);
            Ok((Arc::new(profile), candela))
        }
        Err(message) => Err(report.problem(at, message)),
    }
}

// Portals: the custom property `portal` in the `extras` of a node is the width and height of a rectangle centred at the
// node, through which environment light enters along -z.

/// The portal of a node, if it is one.
pub(super) fn portal(doc: &Document, node: &Node, report: &mut Report) -> Option<Portal> {
    let raw = doc.json.pointer(&node.pointer())?;
    let value = raw.get("extras")?.get("portal")?;
    let at = format!("{}/extras/portal", node.pointer());
    let size = match value {
        Value::Bool(false) => return None,
        Value::Bool(true) => Some([1.0, 1.0]),
        Value::Array(list) => match list[..] {
            [ref width, ref height] => width.as_f64().zip(height.as_f64()).map(|(w, h)| [w, h]),
            _ => None,
        },
        _ => None,
    };
    let Some([width, height]) = size.filter(|size| size.iter().all(|s| *s > 0.0 && s.is_finite())) else {
        report.warn(at, "is neither true nor a width and a height above 0; ignored");
        return None;
    };
    let matrix = node.world_from_node;
    let [x, y] = [matrix.matrix3.x_axis * width, matrix.matrix3.y_axis * height];
    let (across, along) = (x.try_normalize(), y.try_normalize());
    let Some((across, along)) = across.zip(along).filter(|(a, b)| a.dot(*b).abs() < 1e-3) else {
        report.warn(at, "is flattened or sheared by the transform of its node; ignored");
        return None;
    };
    // Light enters along -z also for mirroring transforms.
    let inwards = -matrix.matrix3.z_axis;
    let (edge_u, edge_v): (DVec3, DVec3) =
        if across.cross(along).dot(inwards) > 0.0 { (x, y) } else { (y, x) };
    let name = raw.get("name").and_then(Value::as_str).unwrap_or("portal").to_string();
    Some(Portal { name, corner: matrix.translation - (x + y) / 2.0, edge_u, edge_v })
}
