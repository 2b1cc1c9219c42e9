//! All textures at one point: what several of them share is computed once.

use super::compiled::Compiled;
use super::coordinates::{TextureCoordinates, UvMap, triplanar};
use super::fold::mixed;
use super::image::{ImageLookup, Taps};
use super::{CompiledTextures, TexturePoint, checker_is_odd, color_by_cosine, noise_value, rgba};
use crate::color::Rgb;
use crate::color::spectral::{Wavelengths, uplifted_share};
use crate::math::{Vec2, Vec3};
use crate::scene::{MOST_NESTED_TEXTURES, TextureId};
use std::cell::Cell;

/// Reads textures at a point. Materials ask for one texture several times (a channel each), and their textures mostly
/// have one size and one set of coordinates: the last value and the last texels found are kept.
#[derive(Debug)]
pub struct PointReader<'a> {
    textures: &'a CompiledTextures,
    point: TexturePoint,
    last: Cell<(u32, [f32; 4])>,
    /// By the parity of the level: a lookup takes texels of at most two levels, which follow each other.
    taps: [Cell<(u64, Taps)>; 2],
}

impl<'a> PointReader<'a> {
    /// Textures at a point.
    #[inline(always)]
    pub fn new(textures: &'a CompiledTextures, point: TexturePoint) -> PointReader<'a> {
        let nothing = (u64::MAX, Taps::default());
        let taps = [Cell::new(nothing), Cell::new(nothing)];
        PointReader { textures, point, last: Cell::new((u32::MAX, [0.0; 4])), taps }
    }

    /// Linear RGBA of a texture.
    #[inline]
    pub fn eval(&self, id: TextureId) -> [f32; 4] {
        let (last, value) = self.last.get();
        if last == id.0 {
            return value;
        }
        let value = self.look_up(id);
        self.last.set((id.0, value));
        value
    }

    /// A texture times a factor in the lanes of a path: a spectrum, or that of a colour.
    pub fn by_wavelength(&self, id: TextureId, factor: Rgb, waves: &Wavelengths) -> Rgb {
        let mut at = id;
        for _ in 0..MOST_NESTED_TEXTURES {
            match self.textures.textures.get(at.index()) {
                Some(Compiled::Checker { even, odd, inverse_size, coordinates }) => {
                    let is_odd = checker_is_odd(coordinates, *inverse_size, &self.moved());
                    at = TextureId(if is_odd { *odd } else { *even });
                }
                Some(Compiled::Spectrum(spectrum)) => {
                    return spectrum.at(waves) * uplifted_share(factor, waves);
                }
                _ => break,
            }
        }
        let [r, g, b, _] = self.eval(id);
        uplifted_share(factor * Rgb::new(r, g, b), waves)
    }

    fn look_up(&self, id: TextureId) -> [f32; 4] {
        let mut at = id.index();
        for _ in 0..MOST_NESTED_TEXTURES {
            match self.textures.textures.get(at) {
                Some(Compiled::Checker { even, odd, inverse_size, coordinates }) => {
                    let is_odd = checker_is_odd(coordinates, *inverse_size, &self.moved());
                    at = if is_odd { *odd } else { *even } as usize;
                }
                Some(Compiled::Constant(c)) => return *c,
                Some(Compiled::Image { lookup, coordinates: TextureCoordinates::Uv(map), grid }) => {
                    return self.image(lookup, map, *grid);
                }
                Some(Compiled::Image { lookup, coordinates, .. }) => {
                    return projected(lookup, coordinates, &self.moved());
                }
                Some(Compiled::Spectrum(spectrum)) => return rgba(spectrum),
                Some(Compiled::Normal) => {
                    let [r, g, b] = (0.5 + 0.5 * self.point.normal).to_array();
                    return [r, g, b, 1.0];
                }
                Some(Compiled::Mix(parts)) => return self.mix(*parts),
                Some(Compiled::Facing(colors)) => return color_by_cosine(colors, self.point.cosine),
                Some(Compiled::Noise { kind, frequency, octaves, low, high, seed }) => {
                    let value = noise_value(*kind, self.moved().world * *frequency, *octaves, *seed);
                    let [r, g, b] = std::array::from_fn(|i| low[i] + value * (high[i] - low[i]));
                    return [r, g, b, 1.0];
                }
                None => break,
            }
        }
        [0.0, 0.0, 0.0, 1.0]
    }

    #[inline(never)]
    fn mix(&self, parts: [u32; 3]) -> [f32; 4] {
        let [a, b, factor] = parts.map(|part| self.look_up(TextureId(part)));
        mixed(a, b, factor)
    }

    /// The point in the world as it was before `compile` moved it.
    #[inline(always)]
    fn moved(&self) -> TexturePoint {
        TexturePoint { world: self.point.world + self.textures.world_offset, ..self.point }
    }

    #[inline(always)]
    fn image(&self, lookup: &ImageLookup, map: &UvMap, grid: u32) -> [f32; 4] {
        lookup.eval_by(map.footprint(&self.point), |image, level| {
            let key = u64::from(grid) << 32 | level as u64;
            let (known, taps) = self.taps[level % 2].get();
            if known == key {
                return taps;
            }
            let taps = lookup.taps(image, map.apply(&self.point));
            self.taps[level % 2].set((key, taps));
            taps
        })
    }
}

impl CompiledTextures {
    /// Linear RGBA of a point of a texture with one set of texture coordinates.
    #[inline]
    pub fn eval(&self, id: TextureId, uv: Vec2, world: Vec3) -> [f32; 4] {
        self.eval_at(id, &TexturePoint { uv: [uv, uv], world, ..TexturePoint::default() })
    }

    /// Linear RGBA of a texture.
    #[inline]
    pub fn eval_at(&self, id: TextureId, point: &TexturePoint) -> [f32; 4] {
        PointReader::new(self, *point).eval(id)
    }
}

/// An image whose coordinates come from the point's place in the world.
fn projected(lookup: &ImageLookup, coordinates: &TextureCoordinates, point: &TexturePoint) -> [f32; 4] {
    match coordinates {
        TextureCoordinates::Uv(map) => lookup.eval(map.apply(point), map.footprint(point)),
        TextureCoordinates::World => lookup.eval(Vec2::new(point.world.x, point.world.z), point.width),
        TextureCoordinates::Triplanar(inverse_size) => {
            let mut sum = [0.0; 4];
            for (uv, weight) in triplanar(point, *inverse_size) {
                if weight > 0.0 {
                    let value = lookup.eval(uv, point.width * inverse_size);
                    sum = std::array::from_fn(|i| sum[i] + weight * value[i]);
                }
            }
            sum
        }
    }
}
