//! Textures ready for lookup: transforms folded, constants known, 8-bit images left as they are and decoded by table.

mod coordinates;
mod image;
mod noise;
mod pyramid;
mod reader;
mod texels;

pub use coordinates::TexturePoint;
pub use image::ImageLookup;
pub use noise::{marble, perlin, turbulence};
pub use reader::PointReader;

use crate::color::spectral::Spectrum;
use crate::image::Image;
use crate::math::Vec3;
use crate::scene::{ImageId, Interpolation, MOST_NESTED_TEXTURES, NoiseKind, Texture, TextureId};
use coordinates::TextureCoordinates;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

#[derive(Clone, Debug)]
enum Compiled {
    Constant([f32; 4]),
    /// Images that share a grid find the same texels at the same coordinates.
    Image {
        lookup: ImageLookup,
        coordinates: TextureCoordinates,
        grid: u32,
    },
    Checker {
        even: u32,
        odd: u32,
        inverse_size: f32,
        coordinates: TextureCoordinates,
    },
    Normal,
    /// By the cosine, from 0 to 1; two colours or more.
    Facing(Arc<[[f32; 3]]>),
    Spectrum(Spectrum),
    Noise {
        kind: NoiseKind,
        frequency: f32,
        octaves: u32,
        low: [f32; 3],
        high: [f32; 3],
        seed: u32,
    },
}

/// All textures of a scene, by [`TextureId`].
#[derive(Clone, Debug, Default)]
pub struct CompiledTextures {
    textures: Vec<Compiled>,
    /// Added to a world position before procedural lookups: the scene may have been moved near the camera.
    world_offset: Vec3,
}

impl CompiledTextures {
    /// Compiles textures with the images they refer to. `world_offset` is what `compile` subtracted from world
    /// positions. References that lead nowhere count as black (`Scene::validate` reports them).
    pub fn new(textures: &[Texture], images: &[Image], world_offset: Vec3) -> CompiledTextures {
        let pyramids = pyramids(textures, images);
        let mut compiled: Vec<Compiled> = textures.iter().map(|t| compile(t, images, &pyramids)).collect();
        fold_constant_checkers(&mut compiled);
        number_grids(&mut compiled);
        CompiledTextures { textures: compiled, world_offset }
    }

    /// The same textures in a world whose origin has moved otherwise.
    pub fn moved(self, world_offset: Vec3) -> CompiledTextures {
        CompiledTextures { world_offset, ..self }
    }

    /// The value everywhere, if it is the same everywhere.
    pub fn constant(&self, id: TextureId) -> Option<[f32; 4]> {
        match self.textures.get(id.index()) {
            Some(Compiled::Constant(c)) => Some(*c),
            Some(_) => None,
            None => Some([0.0, 0.0, 0.0, 1.0]),
        }
    }

    /// The same with spectra as they are, where pictures are rendered by wavelength; else they are constant colours. Those that were
    /// [added](CompiledTextures::add_spectrum) to the `count` textures of the scene are gone.
    #[must_use]
    pub fn with_spectra(mut self, textures: &[Texture], are_kept: bool) -> CompiledTextures {
        self.textures.truncate(textures.len());
        for (compiled, texture) in self.textures.iter_mut().zip(textures) {
            if let Texture::Spectrum(curve) = texture {
                let spectrum = Spectrum::Measured(curve.clone());
                *compiled = match are_kept {
                    true => Compiled::Spectrum(spectrum),
                    false => Compiled::Constant(rgba(&spectrum)),
                };
            }
        }
        self
    }

    /// Adds a spectrum.
    pub fn add_spectrum(&mut self, spectrum: Spectrum) -> TextureId {
        self.textures.push(Compiled::Spectrum(spectrum));
        TextureId(self.textures.len() as u32 - 1)
    }

    /// The spectrum that a texture is.
    pub fn spectrum(&self, id: TextureId) -> Option<&Spectrum> {
        match self.textures.get(id.index()) {
            Some(Compiled::Spectrum(spectrum)) => Some(spectrum),
            _ => None,
        }
    }

    /// Does the value differ with the direction from which it is seen?
    pub fn depends_on_viewer(&self, id: TextureId) -> bool {
        let mut pending = vec![id.index()];
        let mut known = vec![false; self.textures.len()];
        while let Some(at) = pending.pop() {
            match self.textures.get(at) {
                Some(Compiled::Facing(_)) => return true,
                Some(Compiled::Checker { even, odd, .. }) if !known[at] => {
                    known[at] = true;
                    pending.extend([*even as usize, *odd as usize]);
                }
                _ => {}
            }
        }
        false
    }

    /// Do lookups depend on how much of a surface a path sees?
    pub fn use_footprints(&self) -> bool {
        self.textures
            .iter()
            .any(|t| matches!(t, Compiled::Image { lookup, .. } if lookup.pyramid_bytes() > 0))
    }
}

/// One lookup for each image that has a pyramid.
fn pyramids(textures: &[Texture], images: &[Image]) -> BTreeMap<ImageId, ImageLookup> {
    let mut used: Vec<(ImageId, &Image)> = Vec::new();
    for texture in textures {
        if let Texture::Image { image: id, interpolation: Interpolation::Trilinear, .. } = texture
            && let Some(image) = images.get(id.index())
            && (image.width, image.height) != (1, 1)
            && !used.iter().any(|(known, _)| known == id)
        {
            used.push((*id, image));
        }
    }
    let build = |(id, image): (ImageId, &Image)| {
        (
            id,
            ImageLookup::new(image.clone(), Default::default(), Default::default(), Interpolation::Trilinear),
        )
    };
    used.into_par_iter().map(build).collect()
}

fn compile(texture: &Texture, images: &[Image], pyramids: &BTreeMap<ImageId, ImageLookup>) -> Compiled {
    match texture {
        Texture::Solid([r, g, b]) => Compiled::Constant([*r, *g, *b, 1.0]),
        Texture::Image { image, wrap_u, wrap_v, interpolation, mapping } => match images.get(image.index()) {
            None => Compiled::Constant([0.0, 0.0, 0.0, 1.0]),
            Some(image) if image.width == 1 && image.height == 1 => Compiled::Constant(image.rgba(0, 0)),
            Some(pixels) => {
                let lookup = match pyramids.get(image) {
                    Some(same) => same.reread(*wrap_u, *wrap_v, *interpolation),
                    None => ImageLookup::new(pixels.clone(), *wrap_u, *wrap_v, *interpolation),
                };
                Compiled::Image { lookup, coordinates: TextureCoordinates::new(mapping), grid: 0 }
            }
        },
        Texture::Checker { even, odd, cell_size, mapping } => Compiled::Checker {
            even: even.0,
            odd: odd.0,
            inverse_size: 1.0 / cell_size,
            coordinates: TextureCoordinates::new(mapping),
        },
        Texture::Normal => Compiled::Normal,
        Texture::Facing(colors) => match colors.first() {
            None => Compiled::Constant([0.0, 0.0, 0.0, 1.0]),
            Some(&[r, g, b]) if colors.iter().all(|c| c == &colors[0]) => Compiled::Constant([r, g, b, 1.0]),
            Some(_) => Compiled::Facing(colors.clone()),
        },
        Texture::Spectrum(curve) => Compiled::Constant(rgba(&Spectrum::Measured(curve.clone()))),
        Texture::Noise { kind, frequency, octaves, low, high, seed } => {
            if low == high {
                return Compiled::Constant([low[0], low[1], low[2], 1.0]);
            }
            let octaves = (*octaves).clamp(1, 16);
            Compiled::Noise {
                kind: *kind,
                frequency: *frequency,
                octaves,
                low: *low,
                high: *high,
                seed: *seed,
            }
        }
    }
}

/// What a spectrum looks like; colours beyond the gamut at its edge.
fn rgba(spectrum: &Spectrum) -> [f32; 4] {
    let [r, g, b] = spectrum.rgb().to_array().map(|c| c.max(0.0));
    [r, g, b, 1.0]
}

/// Numbers the grids of images, equal ones alike.
fn number_grids(textures: &mut [Compiled]) {
    let mut known = HashMap::new();
    for (i, texture) in textures.iter_mut().enumerate() {
        if let Compiled::Image { lookup, coordinates: TextureCoordinates::Uv(map), grid } = texture {
            *grid = *known.entry((map.bits(), lookup.grid())).or_insert(i as u32);
        }
    }
}

/// A checker of two equal constants is a constant.
fn fold_constant_checkers(textures: &mut [Compiled]) {
    for _ in 0..MOST_NESTED_TEXTURES {
        for i in 0..textures.len() {
            let Compiled::Checker { even, odd, .. } = textures[i] else { continue };
            let value = |at: u32| match textures.get(at as usize) {
                Some(Compiled::Constant(c)) => Some(*c),
                _ => None,
            };
            if let (Some(a), Some(b)) = (value(even), value(odd))
                && a == b
            {
                textures[i] = Compiled::Constant(a);
            }
        }
    }
}

#[inline(always)]
fn checker_is_odd(coordinates: &TextureCoordinates, inverse_size: f32, point: &TexturePoint) -> bool {
    // Far from the origin f32 has no odd numbers any more; the sum in f64 stays exact.
    let cell = |x: f32| f64::from((x * inverse_size).floor());
    let sum = match coordinates {
        TextureCoordinates::Uv(map) => {
            let uv = map.apply(point);
            cell(uv.x) + cell(uv.y)
        }
        TextureCoordinates::World | TextureCoordinates::Triplanar(_) => {
            cell(point.world.x) + cell(point.world.y) + cell(point.world.z)
        }
    };
    let half = sum * 0.5;
    half != half.floor()
}

/// The colour for a cosine, linear between those of a table.
#[inline]
fn color_by_cosine(colors: &[[f32; 3]], cosine: f32) -> [f32; 4] {
    let last = colors.len() - 1;
    let at = cosine.clamp(0.0, 1.0) * last as f32;
    let first = (at as usize).min(last - 1);
    let (a, b, share) = (colors[first], colors[first + 1], at - first as f32);
    let [r, g, b] = std::array::from_fn(|i| a[i] + share * (b[i] - a[i]));
    [r, g, b, 1.0]
}

/// Noise in 0..1.
#[inline]
fn noise_value(kind: NoiseKind, p: Vec3, octaves: u32, seed: u32) -> f32 {
    let value = match kind {
        NoiseKind::Perlin => 0.5 + 0.5 * perlin(p, seed),
        NoiseKind::Turbulence => turbulence(p, octaves, seed),
        NoiseKind::Marble => marble(p, octaves, seed),
    };
    value.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec2;
    use crate::scene::Mapping;

    fn checker(mapping: Mapping, odd: [f32; 3]) -> CompiledTextures {
        let textures = [
            Texture::Checker { even: TextureId(1), odd: TextureId(2), cell_size: 0.5, mapping },
            Texture::Solid([1.0; 3]),
            Texture::Solid(odd),
        ];
        CompiledTextures::new(&textures, &[], Vec3::ZERO)
    }

    #[test]
    fn checkers_alternate_across_zero() {
        let uv = checker(Mapping::default(), [0.0; 3]);
        let world = checker(Mapping::World, [0.0; 3]);
        let at = |x: f32, y: f32| uv.eval(TextureId(0), Vec2::new(x, y), Vec3::ZERO)[0];
        assert_eq!([at(0.1, 0.1), at(0.6, 0.1), at(-0.1, 0.1), at(-0.1, -0.1)], [1.0, 0.0, 0.0, 1.0]);
        let at = |x, y, z| world.eval(TextureId(0), Vec2::ZERO, Vec3::new(x, y, z))[0];
        assert_eq!([at(0.1, 0.1, 0.1), at(0.6, 0.1, 0.1), at(0.6, -0.1, 0.1)], [1.0, 0.0, 1.0]);
    }

    #[test]
    fn constants_fold_and_circles_are_black() {
        assert_eq!(checker(Mapping::World, [1.0; 3]).constant(TextureId(0)), Some([1.0; 4]));
        assert_eq!(checker(Mapping::World, [0.5; 3]).constant(TextureId(0)), None);
        let circle = Texture::Checker {
            even: TextureId(0),
            odd: TextureId(9),
            cell_size: 1.0,
            mapping: Mapping::World,
        };
        let t = CompiledTextures::new(&[circle], &[], Vec3::ZERO);
        assert_eq!(t.eval(TextureId(0), Vec2::ZERO, Vec3::ZERO), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(t.eval(TextureId(7), Vec2::ZERO, Vec3::ZERO), [0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn tables_by_the_cosine_are_linear() {
        let table = |colors: &[[f32; 3]]| Texture::Facing(colors.into());
        let textures = [
            table(&[[0.0; 3], [1.0, 0.5, 0.25], [0.0, 1.0, 0.0]]),
            table(&[[0.5; 3], [0.5; 3]]),
            table(&[]),
            Texture::Checker {
                even: TextureId(0),
                odd: TextureId(1),
                cell_size: 1.0,
                mapping: Mapping::World,
            },
        ];
        let t = CompiledTextures::new(&textures, &[], Vec3::ZERO);
        let at = |cosine| t.eval_at(TextureId(0), &TexturePoint { cosine, ..TexturePoint::default() });
        assert_eq!(at(0.0), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(at(0.25), [0.5, 0.25, 0.125, 1.0]);
        assert_eq!(at(0.75), [0.5, 0.75, 0.125, 1.0]);
        // Rounding may lead a little beyond.
        assert_eq!([at(1.0), at(1.000_001)], [[0.0, 1.0, 0.0, 1.0]; 2]);
        assert_eq!(t.constant(TextureId(1)), Some([0.5, 0.5, 0.5, 1.0]));
        assert_eq!(t.constant(TextureId(2)), Some([0.0, 0.0, 0.0, 1.0]));
        assert_eq!(
            [0, 1, 2, 3, 9].map(|i| t.depends_on_viewer(TextureId(i))),
            [true, false, false, true, false]
        );
    }

    #[test]
    fn world_offset_moves_patterns_back() {
        let noise = Texture::Noise {
            kind: NoiseKind::Marble,
            frequency: 2.0,
            octaves: 4,
            low: [0.0; 3],
            high: [1.0, 2.0, 3.0],
            seed: 5,
        };
        let here = CompiledTextures::new(std::slice::from_ref(&noise), &[], Vec3::ZERO);
        let moved = CompiledTextures::new(&[noise], &[], Vec3::splat(8.0));
        let p = Vec3::new(0.25, 0.5, 0.125);
        let value = moved.eval(TextureId(0), Vec2::ZERO, p);
        assert_eq!(value, here.eval(TextureId(0), Vec2::ZERO, p + 8.0));
        assert!((value[1] - 2.0 * value[0]).abs() < 1e-6);
    }

    #[test]
    fn normals_become_colours() {
        let t = CompiledTextures::new(&[Texture::Normal], &[], Vec3::ZERO);
        assert_eq!(t.constant(TextureId(0)), None);
        let point = TexturePoint { normal: Vec3::new(0.6, 0.0, -0.8), ..TexturePoint::default() };
        let value = t.eval_at(TextureId(0), &point);
        for (found, expected) in value.into_iter().zip([0.8, 0.5, 0.1, 1.0]) {
            assert!((found - expected).abs() < 1e-6, "{value:?}");
        }
    }

    #[test]
    fn one_pixel_images_are_constants() {
        let image = Image::from_linear_rgb("dot", 1, 1, vec![0.1, 0.2, 0.3]);
        let texture = Texture::Image {
            image: ImageId(0),
            wrap_u: Default::default(),
            wrap_v: Default::default(),
            interpolation: Default::default(),
            mapping: Mapping::default(),
        };
        let t = CompiledTextures::new(&[texture], &[image], Vec3::ZERO);
        assert_eq!(t.constant(TextureId(0)), Some([0.1, 0.2, 0.3, 1.0]));
    }
}
