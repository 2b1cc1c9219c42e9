//! Textures: images and procedural patterns, and how they map to surfaces.

use super::nodes::NodeGraph;
use super::{ImageId, TextureId};
use crate::color::spectral::Curve;
use crate::math::Vec2;
use std::collections::{BTreeSet, HashSet};
use std::sync::Arc;

/// How many textures may lie one in the other: checkers and mixes, and what is in the cells of the innermost.
pub const MAX_TEXTURE_NESTING: u32 = 64;

/// Wrapping of coordinates outside 0..1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// Starts over.
    #[default]
    Repeat,
    /// Starts over, every second time mirrored.
    Mirror,
    /// The border continues.
    Clamp,
}

/// How values between texel centres come about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Interpolation {
    /// Linear between the four nearest texels, and between mip levels where a pixel's footprint covers many texels.
    #[default]
    Trilinear,
    /// Linear between the four nearest texels, at any distance.
    Bilinear,
    /// The nearest texel.
    Nearest,
}

/// An affine map of texture coordinates: `uv' = offset + rotation * (scale * uv)` (KHR_texture_transform).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureTransform {
    /// Added last.
    pub offset: Vec2,
    /// Counter-clockwise rotation, radians.
    pub rotation_rad: f32,
    /// Applied first.
    pub scale: Vec2,
}

impl Default for TextureTransform {
    fn default() -> TextureTransform {
        TextureTransform { offset: Vec2::ZERO, rotation_rad: 0.0, scale: Vec2::ONE }
    }
}

/// Where a texture takes its coordinates from.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Mapping {
    /// Texture coordinates of the surface: the mesh's set of that number; a sphere's longitude and latitude; a quad's
    /// edge parameters.
    Uv {
        /// Which set.
        set: u32,
        /// Applied to the coordinates.
        transform: TextureTransform,
    },
    /// The point in world space (procedural textures).
    World,
    /// Three projections along the world's axes, blended by the fourth power of the normal: for meshes without texture
    /// coordinates.
    Triplanar {
        /// Edge of the square that the image covers, metres.
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
    /// A sine wave along z whose phase turbulence shifts.
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
        /// Which image.
        image: ImageId,
        /// Outside 0..1 along u.
        wrap_u: Wrap,
        /// Outside 0..1 along v.
        wrap_v: Wrap,
        /// Between texels.
        interpolation: Interpolation,
        /// Coordinates.
        mapping: Mapping,
    },
    /// Alternating cells of two textures: cubes of world space, or rectangles of texture coordinates.
    Checker {
        /// Cells whose indices add up to an even number.
        even: TextureId,
        /// The others.
        odd: TextureId,
        /// Edge of a cell: metres, or a share of the texture's width.
        cell_size: f32,
        /// Coordinates.
        mapping: Mapping,
    },
    /// Two textures, mixed by a third: `a + factor (b - a)`, each channel by its own; alpha by the mean of the factor's colours. By a
    /// [table over the angle of view](Texture::Facing), that is what differs with the direction and from place to place.
    Mix {
        /// Where the factor is 0.
        a: TextureId,
        /// Where it is 1.
        b: TextureId,
        /// Which share of the second.
        factor: TextureId,
    },
    /// The surface's unit geometric normal n in world space as a colour, (n + 1) / 2: its front's, whichever side is seen.
    Normal,
    /// Colours by the direction from which a surface is seen: evenly spaced over the cosine between the direction of the path that
    /// arrives and the shading normal (that of the vertices, before normal maps), from 0, where it is seen at grazing angles, to
    /// 1, head on; both sides are alike, and values between are linear. At least one.
    ///
    /// Surfaces whose reflection differs with the viewer reflect light not alike in both directions of a path, as in Cycles.
    Facing(Arc<[[f32; 3]]>),
    /// A function of the point, made of nodes; negative values count as 0. Alpha is 1.
    Nodes(Arc<NodeGraph>),
    /// A measured spectrum, the same everywhere: what it looks like in daylight, or as light, where pictures are not rendered by
    /// wavelength.
    Spectrum(Arc<Curve>),
    /// Noise in world space.
    Noise {
        /// Which noise.
        kind: NoiseKind,
        /// Lattice cells per metre.
        frequency: f32,
        /// Octaves of turbulence, 1 to 16.
        octaves: u32,
        /// Colour where the noise is 0.
        low: [f32; 3],
        /// Colour where it is 1.
        high: [f32; 3],
        /// Chooses another lattice.
        seed: u32,
    },
}

impl Texture {
    /// The image textures that a texture of a scene is made of, itself included, each once.
    pub fn images_of(textures: &[Texture], id: TextureId) -> Vec<TextureId> {
        let (mut images, mut known, mut pending) = (Vec::new(), HashSet::new(), vec![id]);
        while let Some(id) = pending.pop() {
            let Some(texture) = textures.get(id.index()).filter(|_| known.insert(id)) else { continue };
            if let Texture::Image { .. } = texture {
                images.push(id);
            }
            pending.extend(texture.parts());
        }
        images
    }

    /// The images that a texture of a scene looks into.
    pub fn image_ids(textures: &[Texture], id: TextureId) -> BTreeSet<ImageId> {
        let image_of = |id: TextureId| match textures.get(id.index()) {
            Some(Texture::Image { image, .. }) => Some(*image),
            _ => None,
        };
        Texture::images_of(textures, id).into_iter().filter_map(image_of).collect()
    }

    /// Textures that it is made of, directly.
    pub fn parts(&self) -> Vec<TextureId> {
        match self {
            Texture::Checker { even, odd, .. } => vec![*even, *odd],
            Texture::Mix { a, b, factor } => vec![*a, *b, *factor],
            Texture::Nodes(graph) => graph.textures().collect(),
            _ => Vec::new(),
        }
    }

    /// Renames the textures that it is made of.
    pub fn map_parts(&mut self, rename: impl Fn(TextureId) -> TextureId) {
        match self {
            Texture::Checker { even, odd, .. } => [even, odd].into_iter().for_each(|id| *id = rename(*id)),
            Texture::Mix { a, b, factor } => [a, b, factor].into_iter().for_each(|id| *id = rename(*id)),
            Texture::Nodes(graph) => Arc::make_mut(graph).map_textures(rename),
            _ => {}
        }
    }
}
