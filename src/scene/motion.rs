//! Motion blur: keys of transforms and vertices over the shutter interval.

use crate::math::DAffine3;
use std::collections::BTreeMap;

/// Keys of a quantity that changes while the shutter is open.
#[derive(Clone, Debug, PartialEq)]
pub struct Keyframes<T> {
    /// Values at equal steps from the opening of the shutter to its closing, interpolated linearly in between. Fewer
    /// than two: it stands still then.
    pub keys: Vec<T>,
    /// Values a frame before and a frame after the picture's time; for motion vectors.
    pub neighbours: Option<[T; 2]>,
}

impl<T> Keyframes<T> {
    /// Does it change while the shutter is open, so that there is motion blur?
    pub fn blurs(&self) -> bool {
        self.keys.len() > 1
    }

    /// All that is known of other times.
    pub fn all(&self) -> impl Iterator<Item = &T> {
        self.keys.iter().chain(self.neighbours.iter().flatten())
    }

    /// Maps the value at each time.
    pub fn map<U>(&self, of: impl Fn(&T) -> U) -> Keyframes<U> {
        Keyframes {
            keys: self.keys.iter().map(&of).collect(),
            neighbours: self.neighbours.as_ref().map(|neighbours| neighbours.each_ref().map(of)),
        }
    }
}

/// The vertices of a deforming mesh at one key.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vertices {
    /// As [`Mesh::positions`](super::Mesh::positions), as many.
    pub positions: Vec<[f32; 3]>,
    /// As [`Mesh::normals`](super::Mesh::normals), as many.
    pub normals: Vec<[f32; 3]>,
}

/// Motion of objects during the exposure. For cameras and lights without a surface it has positions:
/// [`Camera::motion`](super::Camera::motion), [`Light::motion`](super::Light::motion).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneMotion {
    /// Transforms of instances, by the number in [`Motion::Keyed`](super::Motion::Keyed): `world_from_object`.
    pub instances: Vec<Keyframes<DAffine3>>,
    /// Vertices of meshes that change their shape, by index.
    pub meshes: BTreeMap<usize, Keyframes<Vertices>>,
    /// Transforms of quads, by index: from their place in the scene's list to where they are then.
    pub quads: BTreeMap<usize, Keyframes<DAffine3>>,
    /// Transforms of shapes, likewise. (Emissive spheres stay round: their centre moves, and their volume scales.)
    pub shapes: BTreeMap<usize, Keyframes<DAffine3>>,
}
