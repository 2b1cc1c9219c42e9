//! The objects of a scene as graphs of nodes see them.

use super::material::CompiledMaterial;
use crate::math::{DAffine3, DVec3, Vec3};
use crate::sampling::hash::mix64;
use crate::scene::{Mesh, ObjectInfo, Scene};
use crate::texture::ObjectData;

/// All objects in the order of their numbers, in the world of the compiled scene; none where no graph asks.
pub(super) fn of(scene: &Scene, materials: &[CompiledMaterial], anchor: DVec3) -> Vec<ObjectData> {
    if !materials.iter().any(|material| material.reads_hit) {
        return Vec::new();
    }
    let boxes: Vec<[Vec3; 2]> = scene.meshes.iter().map(of_mesh).collect();
    let instances = scene.instances.iter().map(|instance| {
        object(
            (&instance.name, &instance.info),
            instance.world_from_object,
            boxes[instance.mesh.index()],
            anchor,
        )
    });
    let quads = scene.quads.iter().map(|quad| {
        let size = (quad.edge_u + quad.edge_v).as_vec3();
        object(
            (&quad.name, &quad.info),
            DAffine3::from_translation(quad.corner),
            [size.min(Vec3::ZERO), size.max(Vec3::ZERO)],
            anchor,
        )
    });
    let shapes = scene.shapes.iter().map(|shape| {
        let half = Vec3::splat(shape.radius as f32);
        let place = DAffine3::from_rotation_translation(shape.rotation, shape.center);
        object((&shape.name, &shape.info), place, [-half, half], anchor)
    });
    let curves = scene.curves.iter().map(|curves| {
        let points = curves.points.iter().map(|&p| Vec3::from_array(p));
        object((&curves.name, &curves.info), curves.world_from_object, bounds(points), anchor)
    });
    instances.chain(quads).chain(shapes).chain(curves).collect()
}

fn of_mesh(mesh: &Mesh) -> [Vec3; 2] {
    bounds(mesh.positions.iter().map(|&p| Vec3::from_array(p)))
}

fn bounds(points: impl Iterator<Item = Vec3>) -> [Vec3; 2] {
    let nothing = [Vec3::INFINITY, Vec3::NEG_INFINITY];
    let [low, high] = points.fold(nothing, |[low, high], p| [low.min(p), high.max(p)]);
    if low.cmple(high).all() { [low, high] } else { [Vec3::ZERO; 2] }
}

fn object(
    (name, info): (&str, &ObjectInfo),
    place: DAffine3,
    [low, high]: [Vec3; 2],
    anchor: DVec3,
) -> ObjectData {
    let world_from_object = DAffine3 { translation: place.translation - anchor, ..place };
    let is_flat = place.matrix3.determinant() == 0.0;
    ObjectData {
        world_from_object,
        object_from_world: if is_flat { DAffine3::IDENTITY } else { world_from_object.inverse() },
        location: place.translation.as_vec3(),
        generated: ObjectData::generated(low, high),
        color: info.color,
        index: info.index,
        random: info.random.unwrap_or_else(|| random(name)),
    }
}

/// A number in 0..1 for a name.
fn random(name: &str) -> f32 {
    let hash = name.bytes().fold(name.len() as u64, |hash, byte| mix64(hash ^ u64::from(byte)));
    (hash >> 40) as f32 / (1u64 << 24) as f32
}
