//! Denoising of rendered pictures.

use super::rendering::Rendering;
use crate::denoise::{Denoiser, Guides, Noise, Noisy, slices};
use crate::error::Result;
use crate::film::{Aov, AovSet, Film, Source, Values};

/// The AOVs that a picture to be denoised needs.
pub fn denoising_guides() -> AovSet {
    AovSet::from([Aov::Albedo, Aov::Normal, Aov::Depth])
}

impl Rendering {
    /// Takes the noise out of the picture so far, its light passes and groups of lights, which add up to it afterwards as before.
    /// It should have what [`denoising_guides`] names, and the halves of its samples apart
    /// ([`Renderer::halves`](super::Renderer::halves)). Alpha stays. AOVs that are not in `keep` are left out afterwards.
    pub fn denoise(&mut self, keep: AovSet) {
        self.denoise_by(&Denoiser::Own, keep).expect("it needs nothing that could fail");
    }

    /// The same by another denoiser.
    ///
    /// # Errors
    /// As [`Denoiser::denoise`]; the picture is as it was then.
    #[doc(hidden)]
    pub fn denoise_by(&mut self, denoiser: &Denoiser, keep: AovSet) -> Result<()> {
        self.denoised = Some(denoise_film(&mut self.film, denoiser, keep)?);
        Ok(())
    }
}

/// What [`Rendering::denoise_by`] does to a film; without the halves of samples the variance tells the noise. Says what took
/// the noise out, by what.
///
/// # Errors
/// As [`Denoiser::denoise`]; the film is as it was then.
pub fn denoise_film(film: &mut Film, denoiser: &Denoiser, keep: AovSet) -> Result<String> {
    let guides = take_noise_out(film, denoiser)?;
    let is_extra = |aov: &Aov| denoising_guides().contains(*aov) && !keep.contains(*aov);
    film.forget(Aov::ALL.iter().copied().filter(is_extra));
    Ok(format!("{}; guides {guides}", denoiser.name()))
}

/// The components of a layer.
fn floats(planes: Option<Vec<Values>>) -> Option<[Vec<f32>; 3]> {
    let lists: Vec<Vec<f32>> = planes?.into_iter().map(Values::into_floats).collect();
    lists.try_into().ok()
}

/// Takes it out, and names the guides.
fn take_noise_out(film: &mut Film, denoiser: &Denoiser) -> Result<String> {
    let layer = |names: &[&str]| floats(film.components(names));
    let Some(color) = layer(&["R", "G", "B"]) else { return Ok(Guides::default().names()) };
    let (albedo, normal) = (floats(film.aov(Aov::Albedo)), floats(film.aov(Aov::Normal)));
    let depth = film.aov(Aov::Depth).map(|mut planes| planes.remove(0).into_floats());
    let deviations = film.deviations();
    let variance = floats(film.aov(Aov::Variance));
    let noise = match (&deviations, &variance) {
        (Some(planes), _) => Noise::Deviations(slices(planes)),
        (None, Some(planes)) => Noise::Variance(slices(planes)),
        (None, None) => Noise::Unknown,
    };
    let guides = Guides {
        albedo: albedo.as_ref().map(slices),
        normal: normal.as_ref().map(slices),
        depth: depth.as_deref(),
    };
    let parts: Vec<(String, [Vec<f32>; 3])> = film
        .channels()
        .iter()
        .filter(|channel| channel.source == Source::PartOfColor)
        .filter_map(|channel| {
            let names: Vec<&str> = channel.names.iter().map(AsRef::as_ref).collect();
            Some((names[0].to_string(), layer(&names)?))
        })
        .collect();
    let result = denoiser.denoise(&Noisy {
        width: film.width() as usize,
        height: film.height() as usize,
        color: slices(&color),
        noise,
        guides,
        parts: parts.iter().map(|(_, part)| slices(part)).collect(),
    })?;
    film.set_color(slices(&result.color));
    for ((first, _), part) in parts.iter().zip(&result.parts) {
        film.set_means(first, slices(part));
    }
    Ok(guides.names())
}
