//! Where rays hit surfaces.

use crate::compile::CompiledMaterial;
use crate::math::Hit;
use crate::shape::Surface;

/// Where a ray hit a surface.
#[derive(Clone, Copy)]
pub(super) struct HitPoint<'a> {
    pub surface: Surface,
    pub hit: Hit,
    pub material: &'a CompiledMaterial,
    /// The ray came from behind.
    pub is_back: bool,
    /// When, where something moves.
    pub time: f32,
}
