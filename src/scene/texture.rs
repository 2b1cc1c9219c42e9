//! Textures: images, procedural patterns and their mappings.

use super::nodes::NodeGraph;
use super::{ImageId, TextureId};
use crate::color::spectral::Curve;
use crate::math::Vec2;
use std::collections::{BTreeSet, HashSet};
use std::sync::Arc;

/// Maximum nesting depth of textures.
pub const MAX_TEXTURE_NESTING: u32 = 64;

/// Wrapping of texture coordinates outside 0..1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// Repeats the image.
    #[default]
    Repeat,
    /// Repeats the image, every second copy mirrored.
    Mirror,
    /// Extends the border texels.
    Clamp,
}

/// Texel interpolation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Interpolation {
    /// Bilinear, and linear between the mip levels of the ray footprint.
    #[default]
    Trilinear,
    /// Bilinear, always at full resolution.
    Bilinear,
    /// The nearest texel.
    Nearest,
}

/// An affine map of texture coordinates: `uv' = offset + rotation * (scale * uv)` (KHR_texture_transform).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureTransform {
    /// Offset, applied last.
    pub offset: Vec2,
    /// Counter-clockwise rotation, radians.
    pub rotation_rad: f32,
    /// Scale, applied first.
    pub scale: Vec2,
}

impl Default for TextureTransform {
    fn default() -> TextureTransform {
        TextureTransform { offset: Vec2::ZERO, rotation_rad: 0.0, scale: Vec2::ONE }
    }
}

/// Source of a texture's coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Mapping {
    /// Surface parameterisation: a UV set of a mesh, longitude and latitude of a sphere, or the edge parameters of a quad.
    Uv {
        /// Index of the UV set.
        set: u32,
        /// Transform of the coordinates.
        transform: TextureTransform,
    },
    /// Hit point in world space (procedural textures).
    World,
    /// Triplanar mapping in world space, weighted by the fourth power of the normal's components: for meshes without UVs.
    Triplanar {
        /// Edge length of the image, metres.
        size: f32,
    },
}

impl Default for Mapping {
    fn default() -> Mapping {
        Mapping::Uv { set: 0, transform: TextureTransform::default() }
    }
}

/// Kinds of noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoiseKind {
    /// Gradient noise, mapped to 0..1.
    #[default]
    Perlin,
    /// Sum of |noise| over octaves.
    Turbulence,
    /// A sine wave along z with its phase shifted by turbulence.
    Marble,
}

/// A texture.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Texture {
    /// One colour.
    Solid([f32; 3]),
    /// An image.
    Image {
        /// The image.
        image: ImageId,
        /// Wrapping along u.
        wrap_u: Wrap,
        /// Wrapping along v.
        wrap_v: Wrap,
        /// Texel interpolation.
        interpolation: Interpolation,
        /// Texture coordinates.
        mapping: Mapping,
    },
    /// Checkerboard of two textures: cubes in world space, or rectangles in texture space.
    Checker {
        /// Texture of the cells with an even sum of indices.
        even: TextureId,
        /// Texture of the other cells.
        odd: TextureId,
        /// Edge length of a cell, in metres or texture coordinates.
        cell_size: f32,
        /// Texture coordinates.
        mapping: Mapping,
    },
    /// Linear interpolation `a + factor (b - a)` per channel; alpha by the mean of the factor's RGB. With a
    /// [view-angle table](Texture::Facing) as factor or input, varies over both direction and position.
    Mix {
        /// Texture at a factor of 0.
        a: TextureId,
        /// Texture at a factor of 1.
        b: TextureId,
        /// Interpolation factor.
        factor: TextureId,
    },
    /// Unit geometric normal n of the front in world space as the colour (n + 1) / 2.
    Normal,
    /// View-dependent colour: a linearly interpolated table, evenly spaced over the absolute cosine (0..1) between the incoming path
    /// and the interpolated vertex normal (before normal maps). At least one entry.
    ///
    /// Such BSDFs are not reciprocal, as in Cycles.
    Facing(Arc<[[f32; 3]]>),
    /// A node graph; negative values are clamped to 0. Alpha is 1.
    Nodes(Arc<NodeGraph>),
    /// A constant measured spectrum; in RGB rendering its colour under daylight (reflectance) or as emission.
    Spectrum(Arc<Curve>),
    /// Noise in world space.
    Noise {
        /// Noise kind.
        kind: NoiseKind,
        /// Lattice cells per metre.
        frequency: f32,
        /// Octaves of turbulence, 1 to 16.
        octaves: u32,
        /// Colour of value 0.
        low: [f32; 3],
        /// Colour of value 1.
        high: [f32; 3],
        /// Random seed of the lattice.
        seed: u32,
    },
}

impl Texture {
    /// Distinct image textures that a texture refers to, directly or not, including itself.
    pub fn images_of(textures: &[Texture], id: TextureId) -> Vec<TextureId> {
        let (mut images, mut visited, mut pending) = (Vec::new(), HashSet::new(), vec![id]);
        while let Some(id) = pending.pop() {
            let Some(texture) = textures.get(id.index()).filter(|_| visited.insert(id)) else { continue };
            if let Texture::Image { .. } = texture {
                images.push(id);
            }
            pending.extend(texture.parts());
        }
        images
    }

    /// Images that a texture refers to, directly or not.
    pub fn image_ids(textures: &[Texture], id: TextureId) -> BTreeSet<ImageId> {
        let image_of = |id: TextureId| match textures.get(id.index()) {
            Some(Texture::Image { image, .. }) => Some(*image),
            _ => None,
        };
        Texture::images_of(textures, id).into_iter().filter_map(image_of).collect()
    }

    /// Textures that it refers to directly.
    pub fn parts(&self) -> Vec<TextureId> {
        match self {
            Texture::Checker { even, odd, .. } => vec![*even, *odd],
            Texture::Mix { a, b, factor } => vec![*a, *b, *factor],
            Texture::Nodes(graph) => graph.textures().collect(),
            _ => Vec::new(),
        }
    }

    /// Replaces the ids of the textures that it refers to directly.
    pub fn map_parts(&mut self, rename: impl Fn(TextureId) -> TextureId) {
        match self {
            Texture::Checker { even, odd, .. } => [even, odd].into_iter().for_each(|id| *id = rename(*id)),
            Texture::Mix { a, b, factor } => [a, b, factor].into_iter().for_each(|id| *id = rename(*id)),
            Texture::Nodes(graph) => Arc::make_mut(graph).map_textures(rename),
            _ => {}
        }
    }
}
