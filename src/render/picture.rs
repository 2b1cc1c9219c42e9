//! Pictures: film channels, names in files, denoising, saving.

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
    /// Writes an EXR or a PNG, by the extension, with [`Picture::output_options`]; [`Picture::save_with`] uses other options. Returns
    /// warnings about values that the file can't represent, such as those beyond 16-bit floats.
    ///
    /// # Errors
    /// A usage error for other extensions; an output error if the file can't be written, in which case an existing file of that name is
    /// unchanged.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<Vec<Warning>> {
        self.save_with(path, &self.output)
    }

    /// Writes the picture with these options, in the format of the extension.
    ///
    /// Start from a clone of [`Picture::output_options`], which has the metadata of the header.
    ///
    /// # Errors
    /// As for [`Picture::save`].
    pub fn save_with(&self, path: impl AsRef<Path>, options: &OutputOptions) -> Result<Vec<Warning>> {
        save(&self.film, path.as_ref(), options)
    }

    /// The options of [`Picture::save`]: 16-bit colour in EXRs, the scene's exposure, view and white balance in PNGs, and the metadata of
    /// the header.
    pub fn output_options(&self) -> &OutputOptions {
        &self.output
    }

    /// The film: [`Film::rgba`] returns the colours, [`Film::plane`] one component of an AOV by its name in files.
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// The film, without the rest.
    pub fn into_film(self) -> Film {
        self.film
    }

    /// Time, samples and rays of the rendering.
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
    let extra = options.aovs.channels_with(options.matte_levels).chain(groups).chain(caught);
    Layout::new(extra).with_halves(options.halves)
}

/// Upper bound of the memory of light paths' splats in a film, bytes.
pub fn splat_bytes(options: &RenderOptions, labels: &Labels) -> u64 {
    let region = options.pixels();
    let pixels = u64::from(region.width()) * u64::from(region.height());
    if options.caustics == Caustics::Off {
        0
    } else {
        pixels * layout(options, labels).splat_bytes_per_pixel()
    }
}

/// Memory of the film of a picture and of its error estimate, bytes.
pub fn film_bytes(options: &RenderOptions, labels: &Labels) -> u64 {
    let region = options.pixels();
    let of_noise = if options.noise.is_some() { noise::BYTES_PER_PIXEL } else { 0 };
    let per_pixel = layout(options, labels).bytes_per_pixel() + of_noise;
    u64::from(region.width()) * u64::from(region.height()) * per_pixel
}

// Names of the scene in files: light groups, and objects and materials of Cryptomattes.

/// Names and ids for the channels of a picture.
#[derive(Clone, Debug, Default)]
pub struct Labels {
    /// Names of the scene's light groups.
    pub light_groups: Vec<String>,
    /// Ids of the Cryptomattes.
    pub ids: MatteIds,
    /// Header entries of each Cryptomatte.
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

/// The names of all objects, each a part of the object's path; writes their ids.
fn object_names(scene: &Scene, ids: &mut Vec<u32>, part: fn(&str) -> &str) -> Vec<String> {
    let paths = ObjectId::all(scene).map(|object| object.name(scene).unwrap_or_default());
    let names: Vec<String> = paths.map(|path| part(path).to_string()).collect();
    *ids = names.iter().map(|name| matte_id(name)).collect();
    names
}

/// The last part of an object's path that is not a number: numbered copies share a name.
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

/// The AOVs that denoising needs.
pub fn denoising_guides() -> AovSet {
    AovSet::from([Aov::DenoisingAlbedo, Aov::DenoisingNormal])
}

/// [`Rendering::denoise`](super::Rendering::denoise) for a film; without halves of samples, the noise is estimated from the variance.
/// Returns the names of the denoiser and the guides.
pub fn denoise_film(film: &mut Film, keep: AovSet) -> String {
    denoise_film_with(film, keep, None)
}

/// [`denoise_film`] for a picture whose denoised colour may be known.
pub(super) fn denoise_film_with(film: &mut Film, keep: AovSet, color: Option<[Vec<f32>; 3]>) -> String {
    let guides = denoise_channels(film, color);
    let is_extra = |aov: &Aov| denoising_guides().contains(*aov) && !keep.contains(*aov);
    film.remove_aovs(Aov::ALL.iter().copied().filter(is_extra));
    format!("{NAME}; guides {guides}")
}

/// The components of a layer.
fn floats(planes: Option<Vec<Values>>) -> Option<[Vec<f32>; 3]> {
    let lists: Vec<Vec<f32>> = planes?.into_iter().map(Values::into_floats).collect();
    lists.try_into().ok()
}

/// Denoises the picture, its light groups and light passes; returns the names of the guides.
fn denoise_channels(film: &mut Film, color: Option<[Vec<f32>; 3]>) -> &'static str {
    let names = part_names(film);
    let Some(layers) = noisy_layers(film, film.deviations(), names) else { return Guides::default().names() };
    set_denoised_layers(film, &layers.denoised_with(color));
    layers.guides().names()
}

/// The denoised colour of a film.
pub(super) fn denoised_color(film: &Film) -> [Vec<f32>; 3] {
    let layers = noisy_layers(film, film.deviations(), Vec::new());
    layers.map_or_else(Default::default, |layers| layers.denoised().color)
}

/// The channels of a film that denoising reads, with these parts.
fn noisy_layers(
    film: &Film,
    deviations: Option<[Vec<f32>; 3]>,
    parts: Vec<String>,
) -> Option<NoisyLayers<'static>> {
    let size = [film.width() as usize, film.height() as usize];
    let owned = |planes: [Vec<f32>; 3]| planes.map(Cow::Owned);
    let layer = |names: [&str; 3]| floats(film.components(&names)).map(owned);
    NoisyLayers::read(size, deviations.map(owned), parts, layer)
}

/// Names of the light groups and light passes.
fn part_names(film: &Film) -> Vec<String> {
    let parts = film.channels().iter().filter(|channel| channel.source == Source::PartOfColor);
    parts.filter_map(|channel| Some(channel.names[0].strip_suffix('R')?.to_string())).collect()
}

/// Replaces the picture, its light groups and light passes by the denoised ones.
fn set_denoised_layers(film: &mut Film, result: &Denoised) {
    let names = ordered(part_names(film));
    for (name, planes) in result.named(names.iter().flatten().map(String::as_str)) {
        match name {
            "" => film.set_color(slices(planes)),
            part => film.set_means(&format!("{part}R"), slices(planes)),
        }
    }
}

// Frames of sequences.

/// The AOVs that temporal denoising of sequences needs, in addition to [`denoising_guides`].
pub fn sequence_guides() -> AovSet {
    AovSet::from([Aov::Variance, Aov::Motion])
}

impl Picture {
    /// The picture as a frame of a sequence, denoised without its neighbours as by `oscura denoise`.
    ///
    /// # Errors
    /// Without motion vectors, one of [`sequence_guides`].
    pub fn frame(&self) -> Result<Frame> {
        let vectors: Option<[Vec<f32>; 4]> = self.film.aov(Aov::Motion).and_then(|planes| {
            planes.into_iter().map(Values::into_floats).collect::<Vec<_>>().try_into().ok()
        });
        let layers = noisy_layers(&self.film, None, part_names(&self.film)).zip(vectors);
        let (layers, vectors) = layers.ok_or_else(|| Error::usage("the picture has no motion vectors"))?;
        Ok(layers.frame(vectors))
    }

    /// Replaces the picture by the temporally denoised one, an average over the frames of these numbers. Removes guide AOVs that are not in
    /// `keep`.
    pub fn set_denoised(&mut self, result: &Denoised, frames: &RangeInclusive<u32>, keep: AovSet) {
        set_denoised_layers(&mut self.film, result);
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
    sample_warnings(film, true)
}

/// [`film_warnings`]; unsampled pixels are reported only once rendering has stopped.
pub(super) fn sample_warnings(film: &Film, has_stopped: bool) -> Vec<Warning> {
    let invalid = film.invalid_samples();
    let unsampled = if has_stopped { film.unsampled_pixels() } else { 0 };
    let all = u64::from(film.width()) * u64::from(film.height());
    let messages = [
        (invalid, ("samples-invalid", format!("{invalid} samples were NaN or infinite and were ignored"))),
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

/// Do display-referred pictures have alpha? Only with an environment invisible to cameras, transparent glass, holdouts or shadow catchers;
/// others are composited over black. EXRs always have alpha.
pub fn has_visible_alpha(scene: &CompiledScene, options: &RenderOptions) -> bool {
    let features = &scene.features;
    let is_hidden = !features.environment_visible_to.contains(RayKinds::CAMERA);
    is_hidden || features.catchers || features.holdouts || options.transparent_glass
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn object_and_asset_names_are_parts_of_the_path() {
        assert_eq!((object_name("car/wheel/tyre"), asset_name("car/wheel/tyre")), ("tyre", "car"));
        assert_eq!((object_name("field/tree/12"), asset_name("field/tree/12")), ("tree", "field"));
        assert_eq!((object_name("7"), asset_name("lamp")), ("7", "lamp"));
    }
}
