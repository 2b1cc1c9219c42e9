//! What all objects of a scene file have, whatever their shape.

use super::Build;
use crate::math::DAffine3;
use crate::scene::{Instance, Mesh, MeshId, Motion};

/// A table of `[[objects]]`.
pub(super) struct Object {
    /// Its name.
    pub name: String,
    /// Its transform.
    pub world_from_object: DAffine3,
}

/// Adds a mesh, placed.
pub(super) fn add_placed(build: &mut Build, object: &Object, mesh: Mesh, world_from_object: DAffine3) {
    let scene = &mut build.loaded.scene;
    scene.meshes.push(mesh);
    let mesh = MeshId(scene.meshes.len() as u32 - 1);
    scene.instances.push(Instance {
        name: object.name.clone(),
        mesh,
        world_from_object,
        material: None,
        motion: Motion::Still,
    });
}
