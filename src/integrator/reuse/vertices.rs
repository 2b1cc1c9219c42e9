//! Where paths are cut: ends of prefixes and starts of suffixes, by place.

use super::super::lanes::{Lanes, Lanes3, RgbLanes, Words};
use super::super::wave::{MetalRoughMaterials, Vertices};
use bytemuck::Zeroable;

/// No vertex.
pub const NONE: u32 = 0;
/// A Lambertian vertex.
pub const LAMBERT: u32 = 1;
/// A vertex of an opaque glTF material.
pub const METAL_ROUGH: u32 = 2;

/// Ends of prefixes.
#[derive(Zeroable)]
pub struct Prefixes {
    /// The surfaces. `next_origin` is where rays start there; only what closures are made of is there besides.
    pub vertices: Vertices,
    /// Throughput from the camera up to the surface.
    pub throughput: RgbLanes,
    /// Which class of vertices: [`NONE`], [`LAMBERT`] or [`METAL_ROUGH`].
    pub class: Words,
    /// How many times the path scattered before.
    pub bounce: Words,
}

/// Starts of suffixes.
#[derive(Zeroable)]
pub struct Suffixes {
    /// Which class of vertices.
    pub class: Words,
    pub p: Lanes3,
    /// Geometric normal, on the side where the path arrived.
    pub ng: Lanes3,
    /// Shading normal.
    pub ns: Lanes3,
    /// Towards the end of the prefix.
    pub wo: Lanes3,
    /// Where shadow rays to the surface end.
    pub target: Lanes3,
    /// Throughput of the path there, and the density per solid angle with which its direction was chosen.
    pub throughput: RgbLanes,
    pub pdf: Lanes,
    /// Of glTF materials.
    pub material: MetalRoughMaterials,
    /// Of glTF materials: the diffuse share of the radiance from the light sample, and from where the path goes on, before
    /// what the layer takes.
    pub direct_share: RgbLanes,
    pub scattered_share: RgbLanes,
    /// Radiance that leaves towards everybody; of glTF materials, before what the layer takes.
    pub radiance: RgbLanes,
}
