//! Textures ready for lookup: transforms folded, constants known, 8-bit images left as they are and decoded by table. Images are in
//! memory as far as a picture needs them; the rest is decoded on demand.

mod compiled;
mod coordinates;
mod fold;
mod image;
mod level;
mod noise;
mod paged;
mod pyramid;
mod reader;
mod resident;
mod store;
mod texels;
mod tile;

pub use coordinates::TexturePoint;
pub use image::ImageLookup;
pub use noise::{marble, perlin, turbulence};
pub use reader::PointReader;
pub use resident::{TextureNeeds, TextureReport};
pub use store::TexturesOnDemand;

use crate::color::spectral::Spectrum;
use crate::error::Error;
use crate::image::Image;
use crate::math::Vec3;
use crate::scene::{ImageId, LightProfile, NoiseKind, Texture, TextureId};
use compiled::Compiled;
use coordinates::TextureCoordinates;
use fold::{cut_endless_mixes, fold_constants};
use resident::{Images, Levels};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

/// All textures of a scene, by [`TextureId`].
#[derive(Clone, Debug, Default)]
pub struct CompiledTextures {
    textures: Vec<Compiled>,
    /// Added to a world position before procedural lookups: the scene may have been moved near the camera.
    world_offset: Vec3,
    /// How lamps shine, by [`ProfileId`](crate::scene::ProfileId).
    profiles: Vec<Arc<LightProfile>>,
    /// Textures whose images are damaged.
    lost: HashSet<TextureId>,
    /// The images that they look into.
    images: Images,
}

impl CompiledTextures {
    /// Compiles textures with the images they refer to. `world_offset` is what `compile` subtracted from world
    /// positions. References that lead nowhere count as black (`Scene::validate` reports them).
    ///
    /// # Errors
    /// That of a damaged image without which the scene can't be rendered. Other damaged images are white, and in the report.
    pub fn new(
        textures: &[Texture],
        images: &[Image],
        world_offset: Vec3,
        needs: TextureNeeds,
    ) -> Result<(CompiledTextures, TextureReport), Error> {
        CompiledTextures::after(None, textures, images, world_offset, needs)
    }

    /// The same with images of an earlier picture of the same textures and images, as far as they suffice.
    ///
    /// # Errors
    /// As for [`CompiledTextures::new`].
    pub fn after(
        earlier: Option<CompiledTextures>,
        textures: &[Texture],
        images: &[Image],
        world_offset: Vec3,
        needs: TextureNeeds,
    ) -> Result<(CompiledTextures, TextureReport), Error> {
        let mut report = TextureReport::default();
        let earlier = earlier.map(|textures| textures.images);
        let made = resident::of(earlier, (textures, images), needs, &mut report)?;
        let levels = &made.levels;
        let mut compiled: Vec<Compiled> = textures.iter().map(|t| compile(t, images, levels)).collect();
        fold_constants(&mut compiled);
        cut_endless_mixes(&mut compiled);
        number_grids(&mut compiled);
        let is_lost = |texture: &Texture| match texture {
            Texture::Image { image, .. } => matches!(levels.get(image), Some(None)),
            _ => false,
        };
        let lost = (0..).map(TextureId).zip(textures).filter(|(_, t)| is_lost(t)).map(|(id, _)| id).collect();
        let profiles = Vec::new();
        Ok((CompiledTextures { textures: compiled, world_offset, profiles, lost, images: made }, report))
    }

    /// Textures all of which are in memory, of images without damage.
    #[cfg(test)]
    pub(crate) fn resident(textures: &[Texture], images: &[Image], world_offset: Vec3) -> CompiledTextures {
        let made = CompiledTextures::new(textures, images, world_offset, TextureNeeds::default());
        made.expect("no image is damaged").0
    }

    /// Bytes of images that stay in memory.
    pub fn bytes(&self) -> usize {
        self.images.bytes() as usize
    }

    /// Is the image of a texture damaged, so that materials do without it?
    pub fn is_lost(&self, id: TextureId) -> bool {
        self.lost.contains(&id)
    }

    /// Are they made for what another picture needs as well?
    pub fn suit(&self, needs: &TextureNeeds) -> bool {
        self.images.needs.limit == needs.limit && self.images.needs.cover(needs)
    }

    /// What was decoded on demand since they were made.
    pub fn on_demand(&self) -> TexturesOnDemand {
        self.images.on_demand()
    }

    /// The same textures in a world whose origin has moved otherwise.
    pub fn moved(self, world_offset: Vec3) -> CompiledTextures {
        CompiledTextures { world_offset, ..self }
    }

    /// The same beside the profiles of a scene's lamps.
    #[must_use]
    pub fn with_profiles(self, profiles: &[Arc<LightProfile>]) -> CompiledTextures {
        CompiledTextures { profiles: profiles.to_vec(), ..self }
    }

    /// The profiles of lamps.
    pub fn profiles(&self) -> &[Arc<LightProfile>] {
        &self.profiles
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
                Some(Compiled::Mix(parts)) if !known[at] => {
                    known[at] = true;
                    pending.extend(parts.map(|part| part as usize));
                }
                _ => {}
            }
        }
        false
    }

    /// Do lookups depend on how much of a surface a path sees?
    pub fn use_footprints(&self) -> bool {
        self.textures.iter().any(|t| matches!(t, Compiled::Image { lookup, .. } if lookup.has_pyramid()))
    }
}

fn compile(texture: &Texture, images: &[Image], levels: &BTreeMap<ImageId, Option<Levels>>) -> Compiled {
    match texture {
        Texture::Solid([r, g, b]) => Compiled::Constant([*r, *g, *b, 1.0]),
        Texture::Image { image, wrap_u, wrap_v, interpolation, mapping } => match images.get(image.index()) {
            None => Compiled::Constant([0.0, 0.0, 0.0, 1.0]),
            Some(pixels) => match levels.get(image) {
                // A single pixel.
                None => Compiled::Constant(pixels.rgba(0, 0)),
                // Factors of materials count alone.
                Some(None) => Compiled::Constant([1.0; 4]),
                Some(Some(levels)) => {
                    let lookup = ImageLookup::new(levels, *wrap_u, *wrap_v, *interpolation);
                    Compiled::Image { lookup, coordinates: TextureCoordinates::new(mapping), grid: 0 }
                }
            },
        },
        Texture::Checker { even, odd, cell_size, mapping } => Compiled::Checker {
            even: even.0,
            odd: odd.0,
            inverse_size: 1.0 / cell_size,
            coordinates: TextureCoordinates::new(mapping),
        },
        Texture::Mix { a, b, factor } => Compiled::Mix([a.0, b.0, factor.0]),
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
mod demand_tests;
#[cfg(test)]
mod tests;
