//! The layer of glTF materials above their diffuse part: for every viewer it leaves another share of that.

use super::super::shading_groups::load_material;
use super::super::wave::MetalRoughMaterials;
use crate::bsdf::{ShadingModel, above};
use crate::math::{Frame, Vec3};

/// Least share that a layer must leave for a viewer: below, few directions are sampled for the diffuse part, and what they
/// bring would be scaled up for others.
pub const LEAST_REST: f32 = 0.1;

/// The share that the layer of material `k` leaves towards a viewer.
pub fn layer_rest(m: &MetalRoughMaterials, k: usize, ns: Vec3, wo: Vec3, shading: ShadingModel) -> f32 {
    let material = load_material(m, k, shading);
    material.closure(above(Frame::from_normal(ns).to_local(wo))).rest
}
