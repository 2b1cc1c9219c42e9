//! Spheres and disks of `super::objects`.

use super::Build;
use super::fields::Fields;
use super::object::{Object, add_placed};
use crate::error::Warning;
use crate::load::shapes::{disk_mesh, icosphere, uniform_scale};
use crate::math::{DAffine3, DMat3, DQuat, DVec3};
use crate::scene::{MaterialId, Mesh, MeshPart, Shape, ShapeKind};

/// Adds the sphere of an object.
pub(super) fn add_sphere(build: &mut Build, object_fields: &Fields, object: &Object, material: MaterialId) {
    let Some(fields) = object_fields.table("sphere") else { return };
    let (center, radius) = center_and_radius(&fields, "sphere");
    fields.finish();
    let (Some(center), Some(radius)) = (center, radius) else { return };
    let (kind, rotation, name) = (ShapeKind::Sphere, DQuat::IDENTITY, object.name.clone());
    add(build, object, Shape { name, kind, center, radius, rotation, material });
}

/// Adds the disk of an object.
pub(super) fn add_disk(build: &mut Build, object_fields: &Fields, object: &Object, material: MaterialId) {
    let Some(fields) = object_fields.table("disk") else { return };
    let (center, radius) = center_and_radius(&fields, "disk");
    let normal = fields.vector("normal");
    fields.finish();
    let normal = match normal {
        None => DVec3::Y,
        Some(given) => match given.value.try_normalize() {
            Some(unit) => unit,
            None => return fields.problems.push(given.span, "'normal' of a disk has length 0"),
        },
    };
    let (Some(center), Some(radius)) = (center, radius) else { return };
    let (kind, rotation, name) = (ShapeKind::Disk, facing(normal), object.name.clone());
    add(build, object, Shape { name, kind, center, radius, rotation, material });
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

/// Adds a shape under the transform of its object; as a mesh, with a warning, where that bends it.
fn add(build: &mut Build, object: &Object, shape: Shape) {
    if let Some(placed) = placed(object, shape.clone()) {
        return build.loaded.scene.shapes.push(placed);
    }
    let mut mesh: Mesh = match shape.kind {
        ShapeKind::Sphere => icosphere(&shape.name, 6),
        ShapeKind::Disk => disk_mesh(&shape.name),
    };
    let triangle_count = mesh.triangles.len() as u32;
    mesh.parts.push(MeshPart { first_triangle: 0, triangle_count, material: shape.material });
    let message = format!(
        "{}: its transform bends the {}, which becomes a mesh of {} triangles",
        shape.name,
        shape.kind.name(),
        if triangle_count == 81_920 { "81,920".to_string() } else { triangle_count.to_string() }
    );
    build.loaded.warnings.push(Warning::new(build.file, "", message));
    let scale = DVec3::splat(shape.radius);
    let unit = DAffine3::from_scale_rotation_translation(scale, shape.rotation, shape.center);
    add_placed(build, object, mesh, object.world_from_object * unit);
}
