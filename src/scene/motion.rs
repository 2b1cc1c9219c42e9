//! What moves while a picture is taken.

use super::LightKind;
use crate::math::DAffine3;
use std::collections::BTreeMap;

/// Something that changes while the shutter is open.
#[derive(Clone, Debug, PartialEq)]
pub struct Moving<T> {
    /// What it is at equal steps from the opening of the shutter to its closing; between two of them it changes evenly. Fewer
    /// than two: it stands still then.
    pub keys: Vec<T>,
    /// What it was a frame before the picture's moment, and what it will be a frame after it; for motion vectors.
    pub neighbours: Option<[T; 2]>,
}

impl<T> Moving<T> {
    /// Does it change while the shutter is open?
    pub fn blurs(&self) -> bool {
        self.keys.len() > 1
    }
}

/// The vertices of a mesh at a time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vertices {
    /// As [`Mesh::positions`](super::Mesh::positions), as many.
    pub positions: Vec<[f32; 3]>,
    /// As [`Mesh::normals`](super::Mesh::normals), as many.
    pub normals: Vec<[f32; 3]>,
}

/// A camera that moves.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraMotion {
    /// Where it stands at the picture's moment: what moves is the camera that stands there.
    pub world_from_camera: DAffine3,
    /// Where it stands at other times.
    pub moving: Moving<DAffine3>,
}

/// A light without a surface that moves.
#[derive(Clone, Debug, PartialEq)]
pub struct LightMotion {
    /// It at the picture's moment: what moves is the light that is like this.
    pub kind: LightKind,
    /// It at other times.
    pub moving: Moving<LightKind>,
}

/// What moves while a picture is taken, and how.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneMotion {
    /// Of instances, by the number in [`Motion::Keyed`](super::Motion::Keyed): `world_from_object`.
    pub instances: Vec<Moving<DAffine3>>,
    /// Of meshes that change their shape, by index.
    pub meshes: BTreeMap<usize, Moving<Vertices>>,
    /// Of quads, by index: from where they are in the scene's list to where they are then.
    pub quads: BTreeMap<usize, Moving<DAffine3>>,
    /// Of shapes, likewise. (Spheres and disks keep their shape: they go along with their middle and grow with the volume.)
    pub shapes: BTreeMap<usize, Moving<DAffine3>>,
    /// Of cameras.
    pub cameras: Vec<CameraMotion>,
    /// Of lights without a surface.
    pub lights: Vec<LightMotion>,
}

impl SceneMotion {
    /// Does anything but cameras change while the shutter is open?
    pub fn blurs(&self) -> bool {
        self.instances.iter().any(Moving::blurs)
            || self.meshes.values().any(Moving::blurs)
            || self.lights.iter().any(|l| l.moving.blurs())
            || [&self.quads, &self.shapes].into_iter().any(|all| all.values().any(Moving::blurs))
    }

    /// What a camera does that stands somewhere at the picture's moment.
    pub fn camera_at(&self, world_from_camera: &DAffine3) -> Option<&Moving<DAffine3>> {
        let found = self.cameras.iter().find(|c| c.world_from_camera == *world_from_camera);
        found.map(|c| &c.moving)
    }
}
