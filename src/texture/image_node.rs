//! Lookups of image nodes as Cycles does them: at points, on a grid of any extension, linear or cubic, in the values of the file.

use super::image::ImageLookup;
use super::levels::Level;
use super::pyramid::{Texels, WithTexels};
use crate::color::{linear_from_srgb, srgb_from_linear};
use crate::image::{Encoding, Pixels};
use crate::math::Vec2;
use crate::scene::nodes::{
    AlphaMode, ColorSpace, Extension, ImageInterpolation, NodeGraph, NodeInput, NodeKind,
};

/// How a node reads an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageReading {
    /// Between texels.
    pub interpolation: ImageInterpolation,
    /// Outside the picture.
    pub extension: Extension,
    /// What the image's alpha does to its colours.
    pub alpha_mode: AlphaMode,
    /// The image holds data, whose channels have nothing to do with each other.
    pub is_data: bool,
    /// Something reads the alpha: colours are then not multiplied by it.
    pub reads_alpha: bool,
}

impl ImageReading {
    /// How a node of a graph reads its image; `None` of nodes without one.
    pub fn of(graph: &NodeGraph, node: usize) -> Option<ImageReading> {
        let mut inputs = graph.nodes.iter().flat_map(|node| &node.inputs).chain([&graph.result]);
        let reads_alpha = inputs.any(|input| *input == NodeInput::Link { node, output: 1 });
        let (interpolation, extension, alpha_mode, color_space) = match &graph.nodes.get(node)?.kind {
            NodeKind::ImageTexture { interpolation, extension, alpha_mode, color_space, .. } => {
                (*interpolation, *extension, *alpha_mode, *color_space)
            }
            NodeKind::EnvironmentTexture { interpolation, color_space, .. } => {
                (*interpolation, Extension::Repeat, AlphaMode::Straight, *color_space)
            }
            _ => return None,
        };
        let is_data = color_space == ColorSpace::NonColor;
        Some(ImageReading { interpolation, extension, alpha_mode, is_data, reads_alpha })
    }

    /// Linear RGBA at coordinates, v upwards; averaged over `footprint`, in the same coordinates, where it exceeds a texel.
    pub fn eval(&self, lookup: &ImageLookup, uv: [f32; 2], footprint: f32) -> [f32; 4] {
        let uv = Vec2::new(uv[0], 1.0 - uv[1]);
        if self.extension == Extension::Clip && !is_near(uv, lookup) {
            return [0.0; 4];
        }
        if self.interpolation != ImageInterpolation::Closest && lookup.covers_texels(footprint) {
            return self.with_alpha(lookup.eval(uv, footprint));
        }
        self.point(lookup.finest(), uv)
    }

    /// The value of a picture of one texel.
    pub fn constant(&self, color: [f32; 4], uv: [f32; 2]) -> [f32; 4] {
        let is_outside = uv.iter().any(|x| !(0.0..=1.0).contains(x));
        if self.extension == Extension::Clip && is_outside { [0.0; 4] } else { self.with_alpha(color) }
    }

    /// Are colours multiplied by alpha? Files of integers hold them as they are, those of floats multiplied, whatever the mode says.
    fn associates(&self) -> bool {
        !self.is_data && matches!(self.alpha_mode, AlphaMode::Straight | AlphaMode::Premul)
    }

    /// A colour that isn't multiplied by its alpha yet.
    fn with_alpha(&self, [r, g, b, alpha]: [f32; 4]) -> [f32; 4] {
        match self.alpha_mode {
            AlphaMode::None => [r, g, b, 1.0],
            _ if self.associates() && !self.reads_alpha => [r * alpha, g * alpha, b * alpha, alpha],
            _ => [r, g, b, alpha],
        }
    }

    /// Cycles blends the values of the file, sRGB codes among them, multiplied by alpha.
    fn point(&self, level: &Level, uv: Vec2) -> [f32; 4] {
        let image = &level.image;
        let is_float = matches!(*image.pixels, Pixels::F32(_));
        let (columns, rows) = (self.taps(uv.x, image.width), self.taps(uv.y, image.height));
        let sum = Blend {
            columns,
            rows,
            width: image.width as usize,
            is_srgb: image.encoding == Encoding::Srgb,
            multiplies: self.associates() && !is_float,
        };
        let [mut color @ .., alpha] = level.with_texels(sum);
        if self.reads_alpha && self.associates() && alpha != 0.0 && alpha != 1.0 {
            color = color.map(|c| c / alpha);
        }
        if image.encoding == Encoding::Srgb {
            color = color.map(linear_from_srgb);
        }
        let [r, g, b] = color;
        [r, g, b, if self.alpha_mode == AlphaMode::None { 1.0 } else { alpha }]
    }

    /// The texels around a coordinate along an axis of `size` texels, by their weights.
    fn taps(&self, x: f32, size: u32) -> [Tap; 4] {
        // Cycles limits coordinates likewise, so that they have a fraction.
        let x = if x.is_finite() { x.clamp(-1e6, 1e6) } else { 0.0 };
        let (at, weights) = match self.interpolation {
            ImageInterpolation::Closest => ((x * size as f32).floor(), [0.0, 1.0, 0.0, 0.0]),
            ImageInterpolation::Linear => {
                let shifted = x * size as f32 - 0.5;
                let t = shifted - shifted.floor();
                (shifted.floor(), [0.0, 1.0 - t, t, 0.0])
            }
            ImageInterpolation::Cubic | ImageInterpolation::Smart => {
                let shifted = x * size as f32 - 0.5;
                (shifted.floor(), cubic_weights(shifted - shifted.floor()))
            }
        };
        let first = at as i64 - 1;
        std::array::from_fn(|i| Tap {
            texel: self.texel(first + i as i64, i64::from(size)),
            weight: weights[i],
        })
    }

    /// The texel of an index along an axis; `None` outside.
    fn texel(&self, i: i64, size: i64) -> Option<usize> {
        let inside = match self.extension {
            Extension::Repeat => i.rem_euclid(size),
            Extension::Extend => i.clamp(0, size - 1),
            Extension::Mirror => {
                let folded = i.rem_euclid(2 * size);
                folded.min(2 * size - 1 - folded)
            }
            Extension::Clip if (0..size).contains(&i) => i,
            Extension::Clip => return None,
        };
        Some(inside as usize)
    }
}

/// Is a point within a texel of the picture?
fn is_near(uv: Vec2, lookup: &ImageLookup) -> bool {
    let image = &lookup.finest().image;
    let near = |x: f32, size: u32| (-2.0..=size as f32 + 2.0).contains(&(x * size as f32));
    near(uv.x, image.width) && near(uv.y, image.height)
}

/// Weights of a uniform cubic B-spline.
fn cubic_weights(t: f32) -> [f32; 4] {
    [
        ((-t / 6.0 + 0.5) * t - 0.5) * t + 1.0 / 6.0,
        (0.5 * t - 1.0) * t * t + 2.0 / 3.0,
        ((-0.5 * t + 0.5) * t + 0.5) * t + 1.0 / 6.0,
        t * t * t / 6.0,
    ]
}

#[derive(Clone, Copy)]
struct Tap {
    texel: Option<usize>,
    weight: f32,
}

/// A sum of texels by their weights.
struct Blend {
    columns: [Tap; 4],
    rows: [Tap; 4],
    width: usize,
    is_srgb: bool,
    multiplies: bool,
}

impl WithTexels for Blend {
    type Output = [f32; 4];

    fn run(self, texels: impl Texels) -> [f32; 4] {
        let mut sum = [0.0; 4];
        let used = |taps: [Tap; 4]| {
            taps.into_iter().filter(|tap| tap.weight != 0.0).filter_map(|tap| Some((tap.texel?, tap.weight)))
        };
        for (row, of_row) in used(self.rows) {
            for (column, of_column) in used(self.columns) {
                let [r, g, b, alpha] = texels.texel(row * self.width + column);
                let factor = if self.multiplies { alpha } else { 1.0 };
                let color = [r, g, b].map(|c| if self.is_srgb { srgb_from_linear(c) } else { c } * factor);
                let weight = of_row * of_column;
                for (sum, value) in sum.iter_mut().zip([color[0], color[1], color[2], alpha]) {
                    *sum += weight * value;
                }
            }
        }
        sum
    }
}
