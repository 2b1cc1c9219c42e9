//! Images of MTL materials as textures; each file is decoded once for each use.

use super::files::find;
use super::mtl::Map;
use crate::error::{Error, Warning};
use crate::image::Damage;
use crate::load::heights::{BUMP_HEIGHT, holds_normals, normals_of_heights};
use crate::load::image::{self, Use};
use crate::load::{LoadOptions, Loaded};
use crate::math::Vec2;
use crate::scene::{
    ImageId, Interpolation, Mapping, NormalMap, Scene, Texture, TextureId, TextureTransform, Wrap,
};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The images read so far; `None` for those that can't be.
pub(super) struct Maps<'a> {
    pub options: &'a LoadOptions,
    images: HashMap<(PathBuf, Use), Option<ImageId>>,
    /// Normal maps made of height maps, by file and height; `None` where files that are said to hold heights hold normals.
    bumps: HashMap<(PathBuf, u32), Option<ImageId>>,
}

impl<'a> Maps<'a> {
    /// Nothing read yet.
    pub fn new(options: &'a LoadOptions) -> Maps<'a> {
        Maps { options, images: HashMap::new(), bumps: HashMap::new() }
    }

    /// The texture of a statement in the library `library`; a missing or broken file is a warning and gives none.
    pub fn texture(
        &mut self,
        map: &Map,
        library: &Path,
        purpose: Use,
        loaded: &mut Loaded,
    ) -> Option<TextureId> {
        let (_, image) = self.image(map, library, purpose, loaded)?;
        Some(push_texture(&mut loaded.scene, map, image))
    }

    /// A texture of numbers and the channel to take: that of `-imfchan`, else alpha where `alpha_first` and the image has
    /// one, else red.
    pub fn number(
        &mut self,
        map: &Map,
        library: &Path,
        alpha_first: bool,
        loaded: &mut Loaded,
    ) -> Option<(TextureId, u8)> {
        let (_, image) = self.image(map, library, Use::Data, loaded)?;
        let channels = loaded.scene.images[image.index()].channels;
        let has_alpha = channels == 2 || channels == 4;
        let channel = map.channel.unwrap_or(if alpha_first && has_alpha { 3 } else { 0 });
        Some((push_texture(&mut loaded.scene, map, image), channel))
    }

    /// A normal map: `is_height` says that the statement promises heights, which many files that hold normals do, too.
    pub fn normal(
        &mut self,
        map: &Map,
        library: &Path,
        is_height: bool,
        loaded: &mut Loaded,
    ) -> Option<NormalMap> {
        let (path, image) = self.image(map, library, Use::Data, loaded)?;
        let as_it_is =
            |scene: &mut Scene| NormalMap { texture: push_texture(scene, map, image), scale: map.bump };
        if !is_height {
            return Some(as_it_is(&mut loaded.scene));
        }
        let key = (path, map.bump.to_bits());
        let id = match self.bumps.get(&key) {
            Some(known) => *known,
            None => {
                let made = match loaded.scene.images[image.index()].decoded() {
                    Ok(heights) if holds_normals(&heights) => None,
                    Ok(heights) => Some(normals_of_heights(&heights, map.bump * BUMP_HEIGHT)),
                    Err(Damage::LeftOut(warning)) => {
                        loaded.warnings.push(warning);
                        return None;
                    }
                    // Damage of these files leaves nothing but textures out.
                    Err(Damage::Fatal(_)) => return None,
                };
                let id = made.map(|normals| loaded.scene.add_image(normals));
                *self.bumps.entry(key).or_insert(id)
            }
        };
        Some(match id {
            Some(id) => NormalMap { texture: push_texture(&mut loaded.scene, map, id), scale: 1.0 },
            None => as_it_is(&mut loaded.scene),
        })
    }

    fn image(
        &mut self,
        map: &Map,
        library: &Path,
        purpose: Use,
        loaded: &mut Loaded,
    ) -> Option<(PathBuf, ImageId)> {
        let mut complain = |message: String| {
            let place = format!("line {}", map.line);
            loaded.warnings.push(Warning::new(library, place, format!("texture left out: {message}")));
        };
        let path = match find(library, &map.file, self.options) {
            Ok(path) => path,
            Err(message) => {
                complain(message);
                return None;
            }
        };
        let known = self.images.get(&(path.clone(), purpose)).copied();
        let id = known.unwrap_or_else(|| {
            let (library, place) = (library.to_path_buf(), format!("line {}", map.line));
            let without =
                move |e: Error| Warning::new(&library, place.as_str(), format!("texture left out: {e}"));
            let later = without.clone();
            let on_damage = Arc::new(move |e| Damage::LeftOut(later(e)));
            match image::read_for_texture(&path, purpose, &mut loaded.warnings, on_damage) {
                Ok(image) => Some(loaded.scene.add_image(image)),
                Err(e) => {
                    loaded.warnings.push(without(e));
                    None
                }
            }
        });
        self.images.insert((path.clone(), purpose), id);
        Some((path, id?))
    }
}

/// Adds a texture with the options of the statement. With v turned to grow downwards, `v s + o` becomes
/// `v s + 1 - s - o`.
fn push_texture(scene: &mut Scene, map: &Map, image: ImageId) -> TextureId {
    let ([u, v], [ou, ov]) = (map.scale, map.offset);
    let transform = TextureTransform {
        offset: Vec2::new(ou, 1.0 - v - ov),
        scale: Vec2::new(u, v),
        ..TextureTransform::default()
    };
    let wrap = if map.clamp { Wrap::Clamp } else { Wrap::Repeat };
    scene.textures.push(Texture::Image {
        image,
        wrap_u: wrap,
        wrap_v: wrap,
        interpolation: Interpolation::Bilinear,
        mapping: Mapping::Uv { set: 0, transform },
    });
    TextureId(scene.textures.len() as u32 - 1)
}
