//! A picture: the channels of its film, the names in its files, denoising, saving.

use super::noise;
use super::options::{Caustics, RenderOptions};
use super::progress::Statistics;
use crate::compile::{CompiledScene, ObjectId};
use crate::denoise::temporal::Frame;
use crate::denoise::{Denoised, Guides, NAME, NoisyLayers, ordered, slices};
use crate::error::{Error, Result, Warning};
use crate::film::{Aov, AovSet, Channel, Film, Layout, MatteIds, Source, Values, matte_id};
use crate::output::{Format, Matte, OutputOptions, encode, write_atomically};
use crate::scene::{RayKinds, Scene};
use std::borrow::Cow;
use std::ops::RangeInclusive;
use std::path::Path;

/// A rendered picture with its warnings and statistics.
#[derive(Clone, Debug)]
pub struct Picture {
    pub(super) film: Film,
    pub(super) statistics: Statistics,
    pub(super) warnings: Vec<Warning>,
    pub(super) output: OutputOptions,
}

impl Picture {
    /// Writes an EXR or a PNG, by the extension: see [`Picture::output_options`] for what is written, and
    /// [`Picture::save_with`] for other choices. Returns warnings about values that the file can't hold, such as those
    /// beyond 16-bit floats.
    ///
    /// # Errors
    /// A usage error for other extensions; an output error if the file can't be written, in which case an existing file
    /// of that name stays as it was.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<Vec<Warning>> {
        self.save_with(path, &self.output)
    }

    /// Writes it with these options, in the format of the extension.
    ///
    /// Begin with a clone of [`Picture::output_options`]: it holds what the header says about the picture.
    ///
    /// # Errors
    /// As for [`Picture::save`].
    pub fn save_with(&self, path: impl AsRef<Path>, options: &OutputOptions) -> Result<Vec<Warning>> {
        save(&self.film, path.as_ref(), options)
    }

    /// How [`Picture::save`] writes: 16-bit colour in EXRs, the scene's exposure, view and white balance in PNGs, and in the header how the
    /// picture was made.
    pub fn output_options(&self) -> &OutputOptions {
        &self.output
    }

    /// The pixels: [`Film::rgba`] has their colours, [`Film::plane`] one component of an AOV by its name in files.
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// The film, without the rest.
    pub fn into_film(self) -> Film {
        self.film
    }

    /// Time, samples and rays that rendering took.
    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// Parts of the scene that were ignored, approximated or repaired.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }
}

/// Writes a film.
pub(super) fn save(film: &Film, path: &Path, options: &OutputOptions) -> Result<Vec<Warning>> {
    let encoded = encode(film, Format::of(path)?, options, path)?;
    write_atomically(path, &encoded.bytes)?;
    let named = |warning| Warning { file: Some(path.to_path_buf()), ..warning };
    Ok(encoded.warnings.into_iter().map(named).collect())
}

// The channels of the film.

/// The channels of the film of a picture.
pub(super) fn layout(options: &RenderOptions, labels: &Labels) -> Layout {
    let groups = labels.light_groups.iter().map(|name| Channel::light_group(name));
    let caught = options.catchers.then(Channel::of_catchers).into_iter().flatten();
    let further = options.aovs.channels_with(options.matte_levels).chain(groups).chain(caught);
    Layout::new(further).with_halves(options.halves)
}

/// Maximum number of bytes of the splats of light paths in a film.
pub fn splat_bytes(options: &RenderOptions, labels: &Labels) -> u64 {
    let region = options.pixels();
    let pixels = u64::from(region.width()) * u64::from(region.height());
    if options.caustics == Caustics::Off {
        0
    } else {
        pixels * layout(options, labels).splat_bytes_per_pixel()
    }
}

/// Bytes of the film of a picture and of the state of its error estimate.
pub fn film_bytes(options: &RenderOptions, labels: &Labels) -> u64 {
    let region = options.pixels();
    let of_noise = if options.noise.is_some() { noise::BYTES_PER_PIXEL } else { 0 };
    let a_pixel = layout(options, labels).bytes_per_pixel() + of_noise;
    u64::from(region.width()) * u64::from(region.height()) * a_pixel
}

// Names of the scene in files: groups of lights, and objects and materials in mattes.

/// Names and ids for the channels of a picture.
#[derive(Clone, Debug, Default)]
pub struct Labels {
    /// The scene's groups of lights.
    pub light_groups: Vec<String>,
    /// The ids that mattes show.
    pub ids: MatteIds,
    /// Header entries of each matte.
    pub mattes: Vec<Matte>,
}

impl Labels {
    /// The labels of a scene that a picture with these options needs.
    pub fn of(scene: &Scene, options: &RenderOptions) -> Labels {
        let mut labels = Labels::default();
        if options.light_groups {
            labels.light_groups = scene.light_groups();
        }
        for (aov, kind) in options.aovs.mattes() {
            let names = match aov {
                Aov::CryptoObject => object_names(scene, &mut labels.ids.objects, object_name),
                Aov::CryptoAsset => object_names(scene, &mut labels.ids.assets, asset_name),
                _ => {
                    labels.ids.materials = scene.materials.iter().map(|m| matte_id(&m.name)).collect();
                    scene.materials.iter().map(|m| m.name.clone()).collect()
                }
            };
            labels.mattes.push(Matte::new(kind, names));
        }
        labels
    }
}

/// The names of all objects, as one part of the path there says; and their ids.
fn object_names(scene: &Scene, ids: &mut Vec<u32>, part: fn(&str) -> &str) -> Vec<String> {
    let paths = ObjectId::all(scene).map(|object| object.name(scene).unwrap_or_default());
    let names: Vec<String> = paths.map(|path| part(path).to_string()).collect();
    *ids = names.iter().map(|name| matte_id(name)).collect();
    names
}

/// An object without those above it. What a sequence of copies is called by number keeps the name that they have in common.
fn object_name(path: &str) -> &str {
    let parts = || path.rsplit('/');
    let is_number = |part: &str| part.bytes().all(|b| b.is_ascii_digit());
    parts().find(|part| !is_number(part)).unwrap_or(path)
}

/// The first part of an object's path: the topmost parent.
fn asset_name(path: &str) -> &str {
    path.split('/').next().unwrap_or(path)
}

// Denoising.

/// The AOVs that a picture to be denoised needs.
pub fn denoising_guides() -> AovSet {
    AovSet::from([Aov::DenoisingAlbedo, Aov::DenoisingNormal])
}

/// [`Rendering::denoise`](super::Rendering::denoise) for a film; without the halves of samples the noise is estimated by the
/// variance. Returns the denoiser and the guides in words.
pub fn denoise_film(film: &mut Film, keep: AovSet) -> String {
    let guides = denoise_channels(film);
    let is_extra = |aov: &Aov| denoising_guides().contains(*aov) && !keep.contains(*aov);
    film.remove_aovs(Aov::ALL.iter().copied().filter(is_extra));
    format!("{NAME}; guides {guides}")
}

/// The components of a layer.
fn floats(planes: Option<Vec<Values>>) -> Option<[Vec<f32>; 3]> {
    let lists: Vec<Vec<f32>> = planes?.into_iter().map(Values::into_floats).collect();
    lists.try_into().ok()
}

/// Denoises the picture and its parts, and names the guides.
fn denoise_channels(film: &mut Film) -> &'static str {
    let Some(layers) = noisy_layers(film, film.deviations()) else { return Guides::default().names() };
    put(film, &layers.denoised());
    layers.guides().names()
}

/// The channels of a film that denoising reads.
fn noisy_layers(film: &Film, deviations: Option<[Vec<f32>; 3]>) -> Option<NoisyLayers<'static>> {
    let size = [film.width() as usize, film.height() as usize];
    let owned = |planes: [Vec<f32>; 3]| planes.map(Cow::Owned);
    let layer = |names: [&str; 3]| floats(film.components(&names)).map(owned);
    NoisyLayers::read(size, deviations.map(owned), part_names(film), layer)
}

/// Names of the light groups and light passes.
fn part_names(film: &Film) -> Vec<String> {
    let parts = film.channels().iter().filter(|channel| channel.source == Source::PartOfColor);
    parts.filter_map(|channel| Some(channel.names[0].strip_suffix('R')?.to_string())).collect()
}

/// Replaces the picture and its parts by the denoised ones.
fn put(film: &mut Film, result: &Denoised) {
    let names = ordered(part_names(film));
    for (name, planes) in result.named(names.iter().flatten().map(String::as_str)) {
        match name {
            "" => film.set_color(slices(planes)),
            part => film.set_means(&format!("{part}R"), slices(planes)),
        }
    }
}

// Frames of sequences.

/// The AOVs that frames of a sequence need to be denoised with their neighbours, besides those of [`denoising_guides`].
pub fn sequence_guides() -> AovSet {
    AovSet::from([Aov::Variance, Aov::Motion])
}

impl Picture {
    /// The picture as a frame of a sequence, denoised by itself as `oscura denoise` does.
    ///
    /// # Errors
    /// Without motion vectors, one of [`sequence_guides`].
    pub fn frame(&self) -> Result<Frame> {
        let vectors: Option<[Vec<f32>; 4]> = self.film.aov(Aov::Motion).and_then(|planes| {
            planes.into_iter().map(Values::into_floats).collect::<Vec<_>>().try_into().ok()
        });
        let layers = noisy_layers(&self.film, None).zip(vectors);
        let (layers, vectors) = layers.ok_or_else(|| Error::usage("the picture has no motion vectors"))?;
        Ok(layers.frame(vectors))
    }

    /// Puts the average with the neighbouring frames, of these numbers, in place of the picture. AOVs that are not in `keep` are
    /// left out.
    pub fn set_denoised(&mut self, result: &Denoised, frames: &RangeInclusive<u32>, keep: AovSet) {
        put(&mut self.film, result);
        let needed = denoising_guides().union(sequence_guides());
        let is_extra = |aov: &Aov| needed.contains(*aov) && !keep.contains(*aov);
        self.film.remove_aovs(Aov::ALL.iter().copied().filter(is_extra));
        let (first, last) = (frames.start(), frames.end());
        let by = format!("{NAME}; guides albedo, normal; noise from the variance; frames {first}-{last}");
        self.output.metadata.denoised = Some(by);
    }
}

// Warnings about samples, and alpha in files.

/// Warnings about the samples of a finished film.
pub fn film_warnings(film: &Film) -> Vec<Warning> {
    of_film(film, true)
}

/// The same; pixels without a sample count once rendering has stopped.
pub(super) fn of_film(film: &Film, has_stopped: bool) -> Vec<Warning> {
    let invalid = film.invalid_samples();
    let unsampled = if has_stopped { film.unsampled_pixels() } else { 0 };
    let all = u64::from(film.width()) * u64::from(film.height());
    let messages = [
        (invalid, ("samples-invalid", format!("{invalid} samples were NaN or infinite and were left out"))),
        (
            unsampled,
            (
                "pixels-unsampled",
                format!("{unsampled} of {all} pixels have no sample and are black and transparent"),
            ),
        ),
    ];
    messages.into_iter().filter(|(count, _)| *count > 0).map(|(_, text)| Warning::general(text)).collect()
}

/// Are pictures for looking at to be transparent where nothing is? Only where that is asked for: by an environment that
/// cameras don't see, by transparent glass, holdouts or shadow catchers. Others stand before black; EXRs have alpha always.
pub fn shows_alpha(scene: &CompiledScene, options: &RenderOptions) -> bool {
    let features = &scene.features;
    let is_hidden = !features.environment_visible_to.contains(RayKinds::CAMERA);
    is_hidden || features.catchers || features.holdouts || options.transparent_glass
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_have_objects_and_assets() {
        assert_eq!((object_name("car/wheel/tyre"), asset_name("car/wheel/tyre")), ("tyre", "car"));
        assert_eq!((object_name("field/tree/12"), asset_name("field/tree/12")), ("tree", "field"));
        assert_eq!((object_name("7"), asset_name("lamp")), ("7", "lamp"));
    }
}
