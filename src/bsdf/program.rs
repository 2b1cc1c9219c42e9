//! Compiled materials: flat parameters from which a hit makes its BSDF without looking at the description.

use super::Lobe;
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::math::{Vec2, Vec3};
use crate::scene::{ColorSlot, FloatSlot};

/// The parameters of one BSDF: constants, and textures with factors.
pub trait MaterialProgram {
    /// The BSDF.
    type Lobe: Lobe;

    /// The BSDF where the slots have these values.
    fn evaluate(&self, slots: &impl Slots, frame: &LocalFrame) -> Self::Lobe;
}

/// Where the values of a material's slots come from at a hit.
pub trait Slots {
    /// A colour.
    fn color(&self, slot: &ColorSlot) -> Rgb;
    /// A number.
    fn number(&self, slot: &FloatSlot) -> f32;

    /// The wavelengths that the channels of colours stand for; `None` where they are red, green and blue.
    #[inline(always)]
    fn wavelengths(&self) -> Option<&Wavelengths> {
        None
    }

    /// A colour within 0..1.
    #[inline(always)]
    fn share_by_channel(&self, slot: &ColorSlot) -> Rgb {
        self.color(slot).clamp(Rgb::ZERO, Rgb::ONE)
    }

    /// A number within 0..1.
    #[inline(always)]
    fn share(&self, slot: &FloatSlot) -> f32 {
        self.number(slot).clamp(0.0, 1.0)
    }

    /// The GGX alpha of a perceptual roughness: its square.
    #[inline(always)]
    fn alpha(&self, slot: &FloatSlot) -> f32 {
        let roughness = self.share(slot);
        roughness * roughness
    }
}

/// The constant factors alone, as if every texture were white.
#[derive(Clone, Copy, Debug)]
pub struct Factors;

impl Slots for Factors {
    #[inline(always)]
    fn color(&self, slot: &ColorSlot) -> Rgb {
        Rgb::from_array(slot.factor)
    }

    #[inline(always)]
    fn number(&self, slot: &FloatSlot) -> f32 {
        slot.factor
    }
}

/// Directions at a hit that some materials depend on, in the frame whose z is the shading normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalFrame {
    /// Where texture coordinate u grows, in the tangent plane.
    pub tangent: Vec2,
    /// The bitangent of normal maps, in the tangent plane.
    pub bitangent: Vec2,
    /// Normal of the clearcoat.
    pub coat_normal: Vec3,
}

impl LocalFrame {
    /// Tangents along x and y, the coat's normal the surface's.
    pub const STRAIGHT: LocalFrame =
        LocalFrame { tangent: Vec2::X, bitangent: Vec2::Y, coat_normal: Vec3::Z };
}

/// Is the slot this number whatever its texture says? A factor of 0 needs no texture.
pub(super) fn always(slot: &FloatSlot, value: f32) -> bool {
    slot.factor == value && (slot.texture.is_none() || value == 0.0)
}
