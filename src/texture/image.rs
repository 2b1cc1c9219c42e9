//! Image lookup: wrap modes; nearest, bilinear, and trilinear between the levels of a pyramid.
//!
//! Lookups of image nodes as in Cycles: unfiltered or with a linear or cubic kernel, with any extension mode, on the values as encoded
//! in the file.

use super::levels::{Level, Levels};
use super::pyramid::{Texels, WithTexels};
use crate::color::{linear_from_srgb, srgb_from_linear};
use crate::image::{Encoding, Image, Pixels};
use crate::math::Vec2;
use crate::scene::nodes::{
    AlphaMode, ColorSpace, Extension, ImageInterpolation, NodeGraph, NodeInput, NodeKind,
};
use crate::scene::{Interpolation, Wrap};
use std::cmp::Ordering;
use std::sync::Arc;

/// 2^23: f32 values of this magnitude and above are whole numbers.
const NO_FRACTION: f32 = 8_388_608.0;

/// An image with its wrap modes and filter. Texel centres lie at `(i + 0.5) / width`; v points down.
#[derive(Clone, Debug)]
pub struct ImageLookup {
    finest: Level,
    /// The coarser mip levels; empty unless interpolation is trilinear.
    coarser: Arc<[Level]>,
    wrap: [Wrap; 2],
    interpolation: Interpolation,
    /// Geometric mean of width and height, texels.
    mean_size: f32,
}

impl ImageLookup {
    /// A lookup of an image; its pixels are shared, not copied.
    pub(super) fn new(
        levels: &Levels,
        wrap_u: Wrap,
        wrap_v: Wrap,
        interpolation: Interpolation,
    ) -> ImageLookup {
        let Levels { finest, coarser } = levels.clone();
        let coarser = if interpolation == Interpolation::Trilinear { coarser } else { Arc::default() };
        let mean_size = (f64::from(finest.image.width) * f64::from(finest.image.height)).sqrt() as f32;
        ImageLookup { finest, coarser, wrap: [wrap_u, wrap_v], interpolation, mean_size }
    }

    /// Mip level 0, the image itself.
    pub(super) fn finest(&self) -> &Level {
        &self.finest
    }

    /// Is a footprint wider than a texel, so that lookups read coarser levels?
    pub(super) fn needs_coarser_levels(&self, footprint: f32) -> bool {
        self.has_pyramid() && footprint * self.mean_size > 1.0
    }

    /// Do lookups depend on the ray footprint?
    pub fn has_pyramid(&self) -> bool {
        !self.coarser.is_empty()
    }

    /// Linear RGBA at texture coordinates; texels are decoded before interpolation. NaN coordinates count as 0.
    /// `footprint` is the filter width in texture coordinates, 0 for a point; only trilinear lookups use it.
    #[inline]
    pub fn eval(&self, uv: Vec2, footprint: f32) -> [f32; 4] {
        self.eval_by(footprint, |image, _| self.taps(image, uv))
    }

    /// The filtered value; `taps` finds the texels of a mip level, given with its index.
    #[inline(always)]
    pub(super) fn eval_by(&self, footprint: f32, taps: impl Fn(&Image, usize) -> Taps) -> [f32; 4] {
        let texels = footprint * self.mean_size;
        // False for a NaN footprint, too.
        if self.interpolation != Interpolation::Trilinear
            || texels.partial_cmp(&1.0) != Some(Ordering::Greater)
        {
            return blend(&self.finest, taps(&self.finest.image, 0));
        }
        // Interpolates between the two levels whose texels are just smaller and just larger than the footprint; the
        // coarser one's weight grows linearly with the footprint.
        let bits = texels.to_bits();
        let level = (bits >> 23) as usize - 127;
        let coarse_weight = f32::from_bits((bits & 0x007f_ffff) | 0x3f80_0000) - 1.0;
        let fine = if level == 0 { Some(&self.finest) } else { self.coarser.get(level - 1) };
        let (Some(fine), Some(coarse)) = (fine, self.coarser.get(level)) else {
            let last = self.coarser.last().unwrap_or(&self.finest);
            return blend(last, taps(&last.image, self.coarser.len()));
        };
        let (a, b) = (blend(fine, taps(&fine.image, level)), blend(coarse, taps(&coarse.image, level + 1)));
        std::array::from_fn(|i| a[i] + coarse_weight * (b[i] - a[i]))
    }

    /// The parameters that determine the texels at given coordinates.
    pub(super) fn grid(&self) -> (u32, u32, [Wrap; 2], Interpolation) {
        (self.finest.image.width, self.finest.image.height, self.wrap, self.interpolation)
    }

    /// The texels of a level at texture coordinates.
    #[inline(always)]
    pub(super) fn taps(&self, image: &Image, uv: Vec2) -> Taps {
        let size = [image.width, image.height];
        let x = fold(uv.x, self.wrap[0]) * size[0] as f32;
        let y = fold(uv.y, self.wrap[1]) * size[1] as f32;
        let (x, y) = if self.interpolation == Interpolation::Nearest {
            (nearest(x, size[0]), nearest(y, size[1]))
        } else {
            (neighbours(x, size[0], self.wrap[0]), neighbours(y, size[1], self.wrap[1]))
        };
        let width = size[0] as usize;
        let texel = |x: u32, y: u32| y as usize * width + x as usize;
        let texels = [texel(x.0, y.0), texel(x.1, y.0), texel(x.0, y.1), texel(x.1, y.1)];
        Taps { texels, s: x.2, t: y.2 }
    }
}

/// Four texels of bilinear interpolation, row by row, with the weights `s` of the second column and `t` of the second row.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Taps {
    texels: [usize; 4],
    s: f32,
    t: f32,
}

#[inline(always)]
fn blend(level: &Level, taps: Taps) -> [f32; 4] {
    level.with_texels(Blend(taps))
}

struct Blend(Taps);

impl WithTexels for Blend {
    type Output = [f32; 4];

    #[inline(always)]
    fn run(self, texels: impl Texels) -> [f32; 4] {
        let Taps { texels: at, s, t } = self.0;
        // Written out, since `map` of arrays is not inlined here.
        let (a, b, c, d) =
            (texels.texel(at[0]), texels.texel(at[1]), texels.texel(at[2]), texels.texel(at[3]));
        let channel = |i: usize| {
            let top = a[i] + s * (b[i] - a[i]);
            let bottom = c[i] + s * (d[i] - c[i]);
            top + t * (bottom - top)
        };
        [channel(0), channel(1), channel(2), channel(3)]
    }
}

/// The fractional part; 0 for NaN, infinity and numbers with fewer than two fractional bits. Rounds by additions instead
/// of `f32::floor`, which is a call of the C library on CPUs without such an instruction.
#[inline(always)]
fn fraction(x: f32) -> f32 {
    if x.abs() < NO_FRACTION * 0.5 { x - floor(x) } else { 0.0 }
}

/// The floor of a number of magnitude below 2^22: adding 1.5 * 2^23 rounds to the nearest integer.
#[inline(always)]
fn floor(x: f32) -> f32 {
    const SHIFT: f32 = 1.5 * NO_FRACTION;
    let nearest = (x + SHIFT) - SHIFT;
    if nearest > x { nearest - 1.0 } else { nearest }
}

/// A coordinate wrapped into 0..1.
#[inline(always)]
fn fold(x: f32, wrap: Wrap) -> f32 {
    match wrap {
        Wrap::Repeat => fraction(x),
        Wrap::Mirror => {
            // A triangle wave of period 2.
            let saw = fraction(x * 0.5) * 2.0;
            if saw > 1.0 { 2.0 - saw } else { saw }
        }
        Wrap::Clamp if x > 0.0 => x.min(1.0),
        Wrap::Clamp => 0.0,
    }
}

/// The texel at a position in texels, as both neighbours.
#[inline(always)]
fn nearest(x: f32, size: u32) -> (u32, u32, f32) {
    let i = (x as u32).min(size - 1);
    (i, i, 0.0)
}

/// The two texels around a position (in texels from the border) and the weight of the second one. Beyond a mirrored or
/// clamped border, the border texel is repeated.
#[inline(always)]
fn neighbours(x: f32, size: u32, wrap: Wrap) -> (u32, u32, f32) {
    let last = size as i32 - 1;
    let shifted = x - 0.5;
    let low = floor(shifted);
    let second_weight = shifted - low;
    let low = low as i32;
    let texel = |i: i32| match wrap {
        Wrap::Repeat if i < 0 => last,
        Wrap::Repeat if i > last => 0,
        _ => i.clamp(0, last),
    };
    (texel(low) as u32, texel(low + 1) as u32, second_weight)
}

/// How an image node samples its image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageSampling {
    /// Interpolation between texels.
    pub interpolation: ImageInterpolation,
    /// Extension outside the image.
    pub extension: Extension,
    /// How the image's alpha is used.
    pub alpha_mode: AlphaMode,
    /// The image holds non-colour data: alpha and the other channels are independent.
    pub is_data: bool,
    /// The graph uses the alpha output: colours are then not premultiplied.
    pub reads_alpha: bool,
}

impl ImageSampling {
    /// The sampling of an image node; `None` for nodes without an image.
    pub fn of(graph: &NodeGraph, node: usize) -> Option<ImageSampling> {
        let mut inputs = graph.nodes.iter().flat_map(|node| &node.inputs).chain([&graph.result]);
        let is_linked = inputs.any(|input| *input == NodeInput::Link { node, output: 1 });
        let reads_alpha = is_linked || graph.nodes.get(node)?.reads_alpha;
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
        Some(ImageSampling { interpolation, extension, alpha_mode, is_data, reads_alpha })
    }

    /// Linear RGBA at texture coordinates, v upwards; averaged over `footprint`, in the same units, where it is wider than a texel.
    pub fn eval(&self, lookup: &ImageLookup, uv: [f32; 2], footprint: f32) -> [f32; 4] {
        let uv = Vec2::new(uv[0], 1.0 - uv[1]);
        if self.extension == Extension::Clip && !is_near_image(uv, lookup) {
            return [0.0; 4];
        }
        if self.interpolation != ImageInterpolation::Closest && lookup.needs_coarser_levels(footprint) {
            return self.with_alpha(lookup.eval(uv, footprint));
        }
        self.point(lookup.finest(), uv)
    }

    /// The value of an image of one texel. At clipped borders it is blended with transparent black, in sRGB-encoded values unless it is
    /// data.
    pub fn constant(&self, color: [f32; 4], uv: [f32; 2]) -> [f32; 4] {
        if self.extension != Extension::Clip {
            return self.with_alpha(color);
        }
        let coverage_along = |x: f32| -> f32 {
            self.taps(x, 1).iter().filter(|tap| tap.texel.is_some()).map(|tap| tap.weight).sum()
        };
        let coverage = coverage_along(uv[0]) * coverage_along(1.0 - uv[1]);
        // If alpha is used, colours are divided by it, which cancels the coverage.
        let is_divided = self.reads_alpha && self.premultiplies() && coverage > 0.0;
        let blended = |c: f32| match (is_divided, self.is_data) {
            (true, _) => c,
            (false, true) => c * coverage,
            (false, false) => linear_from_srgb(srgb_from_linear(c) * coverage),
        };
        let [r, g, b, alpha] = self.with_alpha(color);
        let alpha = if self.alpha_mode == AlphaMode::None { 1.0 } else { alpha * coverage };
        [blended(r), blended(g), blended(b), alpha]
    }

    /// Are colours premultiplied by alpha before interpolation? Whatever the mode says, integer files store straight alpha, and float
    /// files premultiplied alpha.
    fn premultiplies(&self) -> bool {
        !self.is_data && matches!(self.alpha_mode, AlphaMode::Straight | AlphaMode::Premul)
    }

    /// Applies the alpha mode to a colour with straight alpha.
    fn with_alpha(&self, [r, g, b, alpha]: [f32; 4]) -> [f32; 4] {
        match self.alpha_mode {
            AlphaMode::None => [r, g, b, 1.0],
            _ if self.premultiplies() && !self.reads_alpha => [r * alpha, g * alpha, b * alpha, alpha],
            _ => [r, g, b, alpha],
        }
    }

    /// Linear RGBA at a point. As in Cycles, premultiplied values are interpolated as encoded in the file, sRGB included.
    fn point(&self, level: &Level, uv: Vec2) -> [f32; 4] {
        let image = &level.image;
        let is_float = matches!(*image.pixels, Pixels::F32(_));
        let (columns, rows) = (self.taps(uv.x, image.width), self.taps(uv.y, image.height));
        let sum = ColorBlend {
            columns,
            rows,
            width: image.width as usize,
            is_srgb: image.encoding == Encoding::Srgb,
            premultiplies: self.premultiplies() && !is_float,
        };
        let [mut color @ .., alpha] = level.with_texels(sum);
        if self.reads_alpha && self.premultiplies() && alpha != 0.0 && alpha != 1.0 {
            color = color.map(|c| c / alpha);
        }
        if image.encoding == Encoding::Srgb {
            color = color.map(linear_from_srgb);
        }
        let [r, g, b] = color;
        [r, g, b, if self.alpha_mode == AlphaMode::None { 1.0 } else { alpha }]
    }

    /// The texels around a coordinate along an axis of `size` texels, with their weights.
    fn taps(&self, x: f32, size: u32) -> [Tap; 4] {
        // Clamped as in Cycles, so that coordinates keep a fractional part.
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

    /// The texel at an index along an axis after extension; `None` outside a clipped image.
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

/// Is a point within two texels of the image?
fn is_near_image(uv: Vec2, lookup: &ImageLookup) -> bool {
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

/// A weighted sum of texels.
struct ColorBlend {
    columns: [Tap; 4],
    rows: [Tap; 4],
    width: usize,
    is_srgb: bool,
    premultiplies: bool,
}

impl WithTexels for ColorBlend {
    type Output = [f32; 4];

    fn run(self, texels: impl Texels) -> [f32; 4] {
        let mut sum = [0.0; 4];
        let used = |taps: [Tap; 4]| {
            taps.into_iter().filter(|tap| tap.weight != 0.0).filter_map(|tap| Some((tap.texel?, tap.weight)))
        };
        for (row, of_row) in used(self.rows) {
            for (column, of_column) in used(self.columns) {
                let [r, g, b, alpha] = texels.texel(row * self.width + column);
                let factor = if self.premultiplies { alpha } else { 1.0 };
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Encoding, Pixels};
    use std::sync::Arc;

    /// Red counts the columns 0..3, green the rows.
    fn ramp() -> Image {
        let rgb = (0..12).flat_map(|i| [(i % 4) as f32, (i / 4) as f32, 0.0]).collect();
        Image::from_linear_rgb("ramp", 4, 3, rgb)
    }

    /// A lookup of an image with all levels in memory.
    fn lookup(image: Image, wrap: Wrap, interpolation: Interpolation) -> ImageLookup {
        let levels = Levels::resident(image, interpolation == Interpolation::Trilinear);
        ImageLookup::new(&levels, wrap, wrap, interpolation)
    }

    fn red(wrap: Wrap, interpolation: Interpolation, u: f32) -> f32 {
        lookup(ramp(), wrap, interpolation).eval(Vec2::new(u, 0.5), 0.0)[0]
    }

    /// An image of one texel fades towards its clipped borders, as larger images do within their border texels.
    #[test]
    fn one_clipped_texel_fades_at_the_borders() {
        let sampling = |interpolation, extension| ImageSampling {
            interpolation,
            extension,
            alpha_mode: AlphaMode::Straight,
            is_data: false,
            reads_alpha: false,
        };
        let red = |sampling: ImageSampling, uv| sampling.constant([1.0, 0.0, 1.0, 1.0], uv)[0];
        let clipped = sampling(ImageInterpolation::Linear, Extension::Clip);
        for (u, code) in [(0.5, 1.0), (0.75, 0.75), (1.0, 0.5), (1.25, 0.25), (1.5, 0.0), (-3.0, 0.0)] {
            assert!((red(clipped, [u, 0.5]) - linear_from_srgb(code)).abs() < 1e-5, "{u}");
        }
        // If alpha is used, it fades instead of the colour.
        let divided = ImageSampling { reads_alpha: true, ..clipped };
        let [color, _, _, alpha] = divided.constant([1.0, 0.0, 1.0, 1.0], [0.75, 0.5]);
        assert_eq!((color, alpha), (1.0, 0.75));
        assert_eq!(divided.constant([1.0; 4], [-3.0, 0.5]), [0.0; 4]);
        let cubic = sampling(ImageInterpolation::Smart, Extension::Clip);
        assert!((red(cubic, [0.5, 0.5]) - linear_from_srgb(4.0 / 9.0)).abs() < 1e-5);
        let closest = sampling(ImageInterpolation::Closest, Extension::Clip);
        assert_eq!([0.01, 0.99, 1.01].map(|v| red(closest, [0.5, v])), [1.0, 1.0, 0.0]);
        assert_eq!(red(sampling(ImageInterpolation::Linear, Extension::Repeat), [1.25, 0.5]), 1.0);
    }

    #[test]
    fn bilinear_reproduces_a_ramp_and_wraps_at_the_border() {
        for (wrap, border) in [(Wrap::Repeat, 1.5), (Wrap::Mirror, 3.0), (Wrap::Clamp, 3.0)] {
            for u in [0.125f32, 0.3, 0.5, 0.874] {
                assert!((red(wrap, Interpolation::Bilinear, u) - (u * 4.0 - 0.5)).abs() < 1e-5);
            }
            assert!((red(wrap, Interpolation::Bilinear, 0.999_999) - border).abs() < 1e-4, "{wrap:?}");
        }
    }

    #[test]
    fn wrap_modes_apply_outside_the_image() {
        let nearest = |wrap, u| red(wrap, Interpolation::Nearest, u);
        assert_eq!([nearest(Wrap::Repeat, 1.3), nearest(Wrap::Repeat, -0.1)], [1.0, 3.0]);
        assert_eq!([nearest(Wrap::Mirror, 1.3), nearest(Wrap::Mirror, -0.1)], [2.0, 0.0]);
        assert_eq!([nearest(Wrap::Clamp, 1.3), nearest(Wrap::Clamp, -0.1)], [3.0, 0.0]);
        for u in [f32::NAN, f32::INFINITY, -1e30, 3e38, -1e-30] {
            for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                for interpolation in [Interpolation::Nearest, Interpolation::Bilinear] {
                    assert!((0.0..=3.0).contains(&red(wrap, interpolation, u)), "{u} {wrap:?}");
                }
            }
        }
    }

    #[test]
    fn eight_bit_srgb_is_decoded_before_interpolation() {
        let image = Image {
            name: "two".into(),
            width: 2,
            height: 1,
            channels: 1,
            encoding: Encoding::Srgb,
            pixels: Arc::new(Pixels::U8(vec![0, 255])),
        };
        let lookup = lookup(image, Wrap::Clamp, Interpolation::Bilinear);
        assert!((lookup.eval(Vec2::new(0.5, 0.5), 0.0)[1] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn footprints_blend_levels() {
        let rgb = (0..64).flat_map(|i| [((i % 8) / 4) as f32, (i % 2) as f32, 1.0]).collect();
        let image = Image::from_linear_rgb("stripes", 8, 8, rgb);
        let wrap = Wrap::Repeat;
        let sharp = lookup(image.clone(), wrap, Interpolation::Bilinear);
        let lookup = lookup(image, wrap, Interpolation::Trilinear);
        let at = |footprint: f32| lookup.eval(Vec2::new(2.5 / 8.0, 0.5), footprint / 8.0);
        let green = |footprint: f32| at(footprint)[1];
        // At a texel centre of level 0; stripes of one texel are grey from level 1 on.
        assert_eq!(at(0.0), sharp.eval(Vec2::new(2.5 / 8.0, 0.5), 1.0));
        assert_eq!([green(0.5), green(1.0), green(1.5), green(2.0), green(4.0)], [0.0, 0.0, 0.25, 0.5, 0.5]);
        // Wider than the image: its mean.
        for footprint in [8.0, 100.0, 1e30, f32::INFINITY] {
            assert_eq!(at(footprint), [0.5, 0.5, 1.0, 1.0], "{footprint}");
        }
        assert_eq!(at(f32::NAN), at(0.0));
        assert_eq!(lookup.coarser.iter().map(Level::bytes).sum::<usize>(), (16 + 4 + 1) * 12);
    }
}
