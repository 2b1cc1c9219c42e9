//! Surfaces that are partly absent, by the alpha of their material.

use super::fold::fold_float;
use crate::bsdf::Slots;
use crate::scene::{AlphaMode, FloatSlot, Material};
use crate::texture::{CompiledTextures, PointReader};

/// Partial presence.
#[derive(Clone, Copy, Debug)]
pub struct Alpha {
    pub(super) slot: FloatSlot,
    cutoff: Option<f32>,
    /// It differs with the direction of the ray.
    pub depends_on_viewer: bool,
}

impl Alpha {
    /// Zero alpha stays zero whatever vertices and textures multiply it with.
    pub(super) fn is_never_present(&self) -> bool {
        self.slot.factor == 0.0 && self.cutoff.is_none_or(|cutoff| cutoff > 0.0)
    }

    /// The probability that the surface is present at a point.
    #[inline]
    pub fn presence(&self, slots: &PointReader<'_>, vertex_alpha: f32) -> f32 {
        let alpha = slots.number(&self.slot) * vertex_alpha;
        match self.cutoff {
            Some(cutoff) => f32::from(u8::from(alpha >= cutoff)),
            None => alpha.clamp(0.0, 1.0),
        }
    }
}

/// The partial presence of a material; `None` where it is there everywhere.
pub(super) fn alpha_of(material: &Material, textures: &CompiledTextures) -> Option<Alpha> {
    let slot = fold_float(material.alpha, textures);
    let depends_on_viewer = slot.texture.is_some_and(|(id, _)| textures.depends_on_viewer(id));
    let alpha = match material.alpha_mode {
        AlphaMode::Opaque => return None,
        AlphaMode::Mask { cutoff } => Alpha { slot, cutoff: Some(cutoff), depends_on_viewer },
        AlphaMode::Blend => Alpha { slot, cutoff: None, depends_on_viewer },
    };
    // Present everywhere: nothing to do.
    let present = |a: f32| alpha.cutoff.map_or(a >= 1.0, |cutoff| a >= cutoff);
    let constant = slot.texture.is_none() && !material.use_vertex_colors;
    (!(constant && present(slot.factor))).then_some(alpha)
}
