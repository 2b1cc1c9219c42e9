//! What all objects of a scene file have, whatever their shape.

use super::Build;
use super::fields::Fields;
use super::{motion, transform};
use crate::math::{DAffine3, transform_at};
use crate::scene::{Instance, Mesh, MeshId, Motion, Moving, SceneMotion};

/// A table of `[[objects]]`.
pub(super) struct Object {
    /// Its name.
    pub name: String,
    /// Its transform.
    pub world_from_object: DAffine3,
    /// How it moves on from there.
    pub motion: Option<Moving<DAffine3>>,
}

impl Object {
    /// What a table says of its place.
    pub fn read(build: &mut Build, fields: &Fields, name: String) -> Object {
        let world_from_object = transform::read(fields);
        match motion::read(build, fields, &name) {
            None => Object { name, world_from_object, motion: None },
            Some(moved) => {
                let world_from_object = moved.at_moment * world_from_object;
                Object { name, world_from_object, motion: moved.onwards }
            }
        }
    }

    /// How an instance of a file moves that the object places.
    pub fn moved(&self, motion: &mut SceneMotion, instance: &Instance) -> Motion {
        let own = match instance.motion {
            Motion::Keyed(number) => motion.instances.get(number as usize).cloned(),
            _ => None,
        };
        let moving = match (&self.motion, own) {
            (None, None) => return instance.motion,
            (Some(moving), None) => {
                moving.map(|key| *key * self.world_from_object * instance.world_from_object)
            }
            (None, Some(own)) => own.map(|key| self.world_from_object * *key),
            (Some(moving), Some(own)) => both(moving, &own, &self.world_from_object),
        };
        motion.instances.push(moving);
        Motion::Keyed(motion.instances.len() as u32 - 1)
    }
}

/// An object that moves and whose file moves, too; at as many keys as either has.
fn both(moving: &Moving<DAffine3>, own: &Moving<DAffine3>, place: &DAffine3) -> Moving<DAffine3> {
    let count = moving.keys.len().max(own.keys.len());
    let at = |i: usize| {
        let time = i as f32 / count.saturating_sub(1).max(1) as f32;
        transform_at(&moving.keys, time) * *place * transform_at(&own.keys, time)
    };
    let neighbours = moving.neighbours.zip(own.neighbours);
    let neighbours = neighbours.map(|(m, o)| [m[0] * *place * o[0], m[1] * *place * o[1]]);
    Moving { keys: (0..count).map(at).collect(), neighbours }
}

/// Adds a mesh, placed.
pub(super) fn add_placed(build: &mut Build, object: &Object, mesh: Mesh, world_from_object: DAffine3) {
    let scene = &mut build.loaded.scene;
    scene.meshes.push(mesh);
    let mesh = MeshId(scene.meshes.len() as u32 - 1);
    let mut motion = Motion::Still;
    if let Some(moving) = &object.motion {
        motion = Motion::Keyed(scene.motion.instances.len() as u32);
        scene.motion.instances.push(moving.map(|key| *key * world_from_object));
    }
    let name = object.name.clone();
    scene.instances.push(Instance { name, motion, ..Instance::new(mesh, world_from_object) });
}
