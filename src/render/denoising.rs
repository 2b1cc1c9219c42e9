//! Denoising of rendered pictures.

use super::rendering::Rendering;
use crate::denoise::{Guides, Noise, Noisy, denoise, slices};
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
        denoise_film(&mut self.film);
        let is_extra = |aov: &Aov| denoising_guides().contains(*aov) && !keep.contains(*aov);
        self.film.forget(Aov::ALL.iter().copied().filter(is_extra));
    }
}

/// The components of a layer.
fn floats(planes: Option<Vec<Values>>) -> Option<[Vec<f32>; 3]> {
    let lists: Vec<Vec<f32>> = planes?.into_iter().map(Values::into_floats).collect();
    lists.try_into().ok()
}

fn denoise_film(film: &mut Film) {
    let layer = |names: &[&str]| floats(names.iter().map(|name| film.plane(name)).collect());
    let Some(color) = layer(&["R", "G", "B"]) else { return };
    let (albedo, normal) = (floats(film.aov(Aov::Albedo)), floats(film.aov(Aov::Normal)));
    let depth = film.aov(Aov::Depth).map(|mut planes| planes.remove(0).into_floats());
    let deviations = film.deviations();
    let parts: Vec<(String, [Vec<f32>; 3])> = film
        .channels()
        .iter()
        .filter(|channel| channel.source == Source::PartOfColor)
        .filter_map(|channel| {
            let names: Vec<&str> = channel.names.iter().map(AsRef::as_ref).collect();
            Some((names[0].to_string(), layer(&names)?))
        })
        .collect();
    let result = denoise(&Noisy {
        width: film.width() as usize,
        height: film.height() as usize,
        color: slices(&color),
        noise: deviations.as_ref().map_or(Noise::Unknown, |planes| Noise::Deviations(slices(planes))),
        guides: Guides {
            albedo: albedo.as_ref().map(slices),
            normal: normal.as_ref().map(slices),
            depth: depth.as_deref(),
        },
        parts: parts.iter().map(|(_, part)| slices(part)).collect(),
    });
    film.set_color(slices(&result.color));
    for ((first, _), part) in parts.iter().zip(&result.parts) {
        film.set_means(first, slices(part));
    }
}
