//! EXT_lights_area (a draft): rectangles and disks that shine evenly from the side that faces -z.

use super::cameras;
use super::document::{Document, index_of, name_of, number_of, numbers_of, pointer, required};
use super::nodes::Node;
use super::report::{Report, Sound};
use super::traits;
use crate::math::{DAffine3, DMat3, DVec3};
use crate::scene::{
    Instance, Lamp, Material, MaterialId, Mesh, MeshId, MeshPart, ObjectTraits, Quad, Scene, Shape, ShapeKind,
};
use crate::shape::mesh_of;
use serde_json::Value;

const PLACE: &str = "extensions/EXT_lights_area";
const LIGHTS: &str = "extensions/EXT_lights_area/lights";

/// A light with a surface, placed in the world.
pub(super) struct AreaLight {
    name: String,
    radiance: [f32; 3],
    group: String,
    lamp: Lamp,
    form: Form,
    /// The axes across, along and against the light, of the length of width, height and 1, and the middle.
    world_from_unit: DAffine3,
}

/// The form of a light.
#[derive(Clone, Copy, PartialEq)]
enum Form {
    Rectangle,
    Disk,
    /// A disk that may move: rays to lights know none as such.
    DiskOfTriangles,
}

/// The light of a node, if it has one of these.
pub(super) fn light(doc: &Document, node: &Node, moves: bool, report: &mut Report) -> Option<AreaLight> {
    let raw = node.area_light(doc)?;
    // What is wrong with one was noted.
    let mut light = read(doc, (node, raw), report).ok()?;
    if moves && light.form == Form::Disk {
        light.form = Form::DiskOfTriangles;
    }
    Some(light)
}

fn read(doc: &Document, (node, raw): (&Node, &Value), report: &mut Report) -> Sound<AreaLight> {
    let at = format!("{}/{PLACE}", node.pointer());
    let index = required(index_of(raw, "light", &at, report), "light", &at, report)?;
    let light = doc.raw(LIGHTS, index, &format!("{at}/light"), report)?;
    let at = pointer(LIGHTS, index);
    report.warn("", "EXT_lights_area is a draft: what is made of it may change");
    let form = match light.get("type").and_then(Value::as_str) {
        Some("rect") => Form::Rectangle,
        Some("disk") => Form::Disk,
        _ => return Err(report.problem(format!("{at}/type"), "is neither rect nor disk")),
    };
    let height = positive(light, "size", &at, report)?;
    let aspect = match light.get("rect").filter(|_| form == Form::Rectangle) {
        Some(rect) => positive(rect, "aspect", &format!("{at}/rect"), report)?,
        None => 1.0,
    };
    let color = numbers_of(light, "color", &at, report)?.unwrap_or([1.0; 3]);
    let luminance = number_of(light, "intensity", &at, report)?.unwrap_or(1000.0);
    let radiance = color.map(|c| (c * luminance / cameras::lumens_per_watt(doc)) as f32);
    if radiance.iter().any(|r| !(r.is_finite() && *r >= 0.0)) {
        return Err(report
            .problem(at, "has a colour or an intensity that is negative or beyond the range of numbers"));
    }
    let Some(world_from_unit) = placed(&node.world_from_node, [height * aspect, height]) else {
        return Err(report.warn(node.pointer(), "flattens its light, which is left out"));
    };
    let node_raw = doc.json.pointer(&node.pointer()).unwrap_or(&Value::Null);
    let of_node = cameras::light_group(node_raw, &node.pointer(), report);
    let group = of_node.or_else(|| cameras::light_group(light, &at, report)).unwrap_or_default();
    let ObjectTraits { visible_to, .. } = traits::of_node(node_raw, &node.pointer(), report);
    let lamp = Lamp { visible_to, ..Lamp::default() };
    let name = name_of(node_raw, "light of node", node.index);
    Ok(AreaLight { name, radiance, group, lamp, form, world_from_unit })
}

/// A size above 0, which is 1 where nothing is said.
fn positive(object: &Value, key: &str, at: &str, report: &mut Report) -> Sound<f64> {
    let size = number_of(object, key, at, report)?.unwrap_or(1.0);
    // Squares of sizes are areas in single precision.
    if (1e-15..=1e15).contains(&size) {
        return Ok(size);
    }
    Err(report.problem(format!("{at}/{key}"), format!("{size} is no size above 0 (1e-15 to 1e15)")))
}

/// The place of a light: the rotation of a transform, axes z and y made orthonormal in this order, and the largest of its scales for
/// both sides. `None` for a transform that flattens.
fn placed(world_from_node: &DAffine3, size: [f64; 2]) -> Option<DAffine3> {
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
    /// Puts the light into a scene that has its other materials already.
    pub fn add_to(self, scene: &mut Scene) {
        let AreaLight { name, radiance, group, lamp, form, world_from_unit } = self;
        let mut emitter = Material::emitter(&name, radiance, false);
        emitter.light_group = group;
        emitter.lamp = Some(lamp).filter(|lamp| *lamp != Lamp::default());
        let material = scene.add_material(emitter);
        let (x, y, center) =
            (world_from_unit.matrix3.x_axis, world_from_unit.matrix3.y_axis, world_from_unit.translation);
        match form {
            Form::Rectangle => {
                // The front is on the side of the cross product: -z.
                let quad = Quad::new(center - (x + y) / 2.0, y, x, material);
                scene.quads.push(Quad { name, ..quad });
            }
            Form::Disk => {
                let disk = Shape::disk(center, -world_from_unit.matrix3.z_axis, y.length() / 2.0, material);
                scene.shapes.push(Shape { name, ..disk });
            }
            Form::DiskOfTriangles => {
                let mesh = disk_of_triangles(scene, &name, material);
                let half = DMat3::from_cols(y / 2.0, x / 2.0, -world_from_unit.matrix3.z_axis);
                let placed = Instance::new(mesh, DAffine3::from_mat3_translation(half, center));
                scene.instances.push(Instance { name, ..placed });
            }
        }
    }
}

fn disk_of_triangles(scene: &mut Scene, name: &str, material: MaterialId) -> MeshId {
    let mut mesh = Mesh { name: format!("{name} (disk)"), ..mesh_of(ShapeKind::Disk) };
    let triangle_count = mesh.triangles.len() as u32;
    mesh.parts.push(MeshPart { first_triangle: 0, triangle_count, material });
    scene.add_mesh(mesh)
}

/// From a rectangle of unit sides to where a quad is.
pub(super) fn world_from_quad(quad: &Quad) -> DAffine3 {
    let axes = DMat3::from_cols(quad.edge_u, quad.edge_v, quad.edge_u.cross(quad.edge_v).normalize_or_zero());
    DAffine3::from_mat3_translation(axes, quad.corner)
}
