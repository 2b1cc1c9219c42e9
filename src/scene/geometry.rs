//! Meshes, their placements, and parallelograms.

use super::{MaterialId, MeshId, ObjectTraits};
use crate::math::{DAffine3, DVec3};

/// Triangles with one set of vertices. Front faces are counter-clockwise.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// For reports.
    pub name: String,
    /// Vertex positions in object space.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices of each triangle, all below `positions.len()`.
    pub triangles: Vec<[u32; 3]>,
    /// Unit shading normals, one a vertex; empty means flat shading.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinate sets, each empty or one a vertex; v grows downwards (glTF).
    pub uv_sets: Vec<Vec<[f32; 2]>>,
    /// Unit tangents with handedness, one a vertex; empty when there are none.
    pub tangents: Vec<[f32; 4]>,
    /// Linear RGBA vertex colours, one a vertex; empty when there are none.
    pub colors: Vec<[f32; 4]>,
    /// Runs of triangles with their materials, in order and covering all triangles.
    pub parts: Vec<MeshPart>,
}

/// A run of triangles with one material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshPart {
    /// First triangle.
    pub first_triangle: u32,
    /// Number of triangles.
    pub triangle_count: u32,
    /// Their material.
    pub material: MaterialId,
}

/// A mesh placed in the world.
#[derive(Clone, Debug)]
pub struct Instance {
    /// For reports: the node's path.
    pub name: String,
    /// Which mesh.
    pub mesh: MeshId,
    /// Placement; may mirror, shear and scale. A mirroring one keeps front faces in front.
    pub world_from_object: DAffine3,
    /// Replaces all materials of the mesh.
    pub material: Option<MaterialId>,
    /// What other moments of the same scene make of it.
    pub motion: Motion,
    /// What it is to rays and pictures.
    pub traits: ObjectTraits,
    /// The group of lights of what it emits, in place of those of its materials; empty for the default one.
    pub light_group: Option<String>,
}

/// How an instance differs between the moments of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Motion {
    /// It does not.
    #[default]
    Still,
    /// It stands elsewhere.
    Moves,
    /// Its mesh is another, too.
    Deforms,
    /// It moves while the picture is taken, or its mesh changes then: the number of its motion in
    /// [`SceneMotion::instances`](super::SceneMotion::instances).
    Keyed(u32),
}

/// A parallelogram in world space; its front is on the side of `edge_u x edge_v`.
#[derive(Clone, Debug)]
pub struct Quad {
    /// For reports.
    pub name: String,
    /// One corner.
    pub corner: DVec3,
    /// From the corner along u.
    pub edge_u: DVec3,
    /// From the corner along v.
    pub edge_v: DVec3,
    /// Its material.
    pub material: MaterialId,
    /// What it is to rays and pictures.
    pub traits: ObjectTraits,
}
