//! Shapes with a middle and a radius:
//!
//! | Shape | Value |
//! |---|---|
//! | `sphere` | `{ center, radius }` |
//! | `disk` | `{ center, normal, radius }`; flat, its front where `normal` points (default y, up) |
//!
//! They stay what they are under rotation, translation and even scaling, and become meshes, with a warning, under any other
//! transform (a sphere one of 81,920 triangles), and so do spheres that shine where their motion bends them. A texture on a disk touches its edge; its top points up (of a level disk
//! to -z) and turns with it.

use super::Build;
use super::fields::Fields;
use super::object::{Object, add_placed};
use crate::error::Warning;
use crate::load::shapes::uniform_scale;
use crate::math::{DAffine3, DMat3, DQuat, DVec3};
use crate::scene::{MaterialId, Mesh, MeshPart, Moving, Shape, ShapeKind};
use crate::shape::mesh_of;

/// Reads the keys of a kind of shapes that not all have: the kind with its numbers, and how it is turned. `None` where
/// there is a problem, which has been noted.
type ReadKind = fn(&Fields) -> Option<(ShapeKind, DQuat)>;

/// The kinds of shapes by their key.
const KINDS: &[(&str, ReadKind)] = &[
    ("sphere", |_| Some((ShapeKind::Sphere, DQuat::IDENTITY))),
    ("disk", |fields| Some((ShapeKind::Disk, facing_normal(fields)?))),
];

/// Their keys.
pub(super) fn keys() -> impl Iterator<Item = &'static str> {
    KINDS.iter().map(|(key, _)| *key)
}

/// Adds the shape of an object by its key; nothing for other keys.
pub(super) fn add(
    build: &mut Build,
    object_fields: &Fields,
    object: &Object,
    key: &'static str,
    material: MaterialId,
) {
    let Some((_, read_kind)) = KINDS.iter().find(|(known, _)| *known == key) else { return };
    let Some(fields) = object_fields.table(key) else { return };
    let (center, radius) = center_and_radius(&fields, key);
    let kind = read_kind(&fields);
    fields.finish();
    let (Some(center), Some(radius), Some((kind, rotation))) = (center, radius, kind) else { return };
    let shape =
        Shape { name: object.name.clone(), kind, rotation, ..Shape::sphere(center, radius, material) };
    add_shape(build, object, shape);
}

fn center_and_radius(fields: &Fields, shape: &str) -> (Option<DVec3>, Option<f64>) {
    let center = fields.require("center", fields.vector("center"));
    let radius = fields.require("radius", fields.number("radius"));
    let radius = radius.and_then(|r| match r.value > 0.0 {
        true => Some(r.value),
        false => {
            fields.problems.push(r.span, format!("'radius' of a {shape} must be above 0"));
            None
        }
    });
    (center.map(|c| c.value), radius)
}

/// The rotation that takes z to the key `normal`: y without it.
fn facing_normal(fields: &Fields) -> Option<DQuat> {
    let Some(normal) = fields.vector("normal") else { return Some(facing(DVec3::Y)) };
    let unit = normal.value.try_normalize();
    if unit.is_none() {
        fields.problems.push(normal.span, "'normal' has length 0");
    }
    unit.map(facing)
}

/// The rotation that takes z to a unit normal and y as nearly up as may be: to -z where the normal is upright.
fn facing(normal: DVec3) -> DQuat {
    let is_upright = normal.y.abs() > 1.0 - 1e-9;
    let up = if is_upright { DVec3::NEG_Z } else { DVec3::Y };
    let right = up.cross(normal).normalize();
    DQuat::from_mat3(&DMat3::from_cols(right, normal.cross(right), normal)).normalize()
}

/// A shape under the transform of its object; `None` where that bends it.
pub(super) fn placed(object: &Object, shape: Shape) -> Option<Shape> {
    let m = object.world_from_object;
    let scale = uniform_scale(&m)?;
    let turn = DMat3::from_cols(m.matrix3.x_axis / scale, m.matrix3.y_axis / scale, m.matrix3.z_axis / scale);
    Some(Shape {
        center: m.transform_point3(shape.center),
        radius: shape.radius * scale,
        rotation: DQuat::from_mat3(&turn) * shape.rotation,
        ..shape
    })
}

/// Is it a sphere that shines, and that its motion stretches more along one axis than along another? What samples the light of
/// spheres asks for round ones.
fn is_stretched_light(build: &Build, object: &Object, shape: &Shape) -> bool {
    let material = build.loaded.scene.materials.get(shape.material.index());
    let shines = material.is_some_and(|material| material.emission.is_some());
    let stretches = |moving: &Moving<DAffine3>| moving.all().any(|key| uniform_scale(key).is_none());
    shines && shape.kind == ShapeKind::Sphere && object.motion.as_ref().is_some_and(stretches)
}

/// Adds a shape under the transform of its object; as a mesh, with a warning, where that bends it.
fn add_shape(build: &mut Build, object: &Object, shape: Shape) {
    let (is_stretched, kind) = (is_stretched_light(build, object, &shape), shape.kind.tag().name());
    let reason = if is_stretched { "motion stretches the shining" } else { "transform bends the" };
    if let Some(placed) = placed(object, shape.clone()).filter(|_| !is_stretched) {
        let scene = &mut build.loaded.scene;
        scene.motion.shapes.extend(object.motion.clone().map(|moving| (scene.shapes.len(), moving)));
        return scene.shapes.push(placed);
    }
    let mut mesh = Mesh { name: shape.name.clone(), ..mesh_of(shape.kind) };
    let triangle_count = mesh.triangles.len() as u32;
    mesh.parts.push(MeshPart { first_triangle: 0, triangle_count, material: shape.material });
    let message =
        format!("{}: its {reason} {kind}, which becomes a mesh of {triangle_count} triangles", shape.name);
    build.loaded.warnings.push(Warning::new(build.file, "", message));
    let scale = DVec3::splat(shape.radius);
    let unit = DAffine3::from_scale_rotation_translation(scale, shape.rotation, shape.center);
    add_placed(build, object, mesh, object.world_from_object * unit);
}
