//! Pictures in which nothing can be seen, and the option that helps.

use oscura::color::luminance;
use oscura::error::{Choice, Warning};
use oscura::film::Film;
use oscura::load::is_named_as_scene;
use oscura::scene::Scene;
use std::path::Path;

/// Mean luminance below which a picture is nearly black: a hundredth of middle grey.
const DARK: f64 = 0.18 / 100.0;
/// Share of pixels as bright as middle grey that makes a dark picture one of a small bright thing.
const SEEN: f64 = 1e-3;
/// Maximum number of pixels that are looked at.
const LOOKED_AT: u64 = 1 << 18;

/// A note for a picture that is nearly black at this exposure (stops).
pub(super) fn note(film: &Film, exposure: f32, scene: &Scene, file: &Path) -> Option<Warning> {
    let all = u64::from(film.width()) * u64::from(film.height());
    let step = all.div_ceil(LOOKED_AT).max(1);
    let width = u64::from(film.width());
    let (mut sum, mut bright, mut covered, mut count) = (0.0, 0u64, 0.0, 0u64);
    for at in (0..all).step_by(usize::try_from(step).unwrap_or(1)) {
        let [r, g, b, alpha] = film.mean_rgba((at % width) as u32, (at / width) as u32);
        let value = f64::from(luminance([r, g, b])) * f64::from(exposure).exp2();
        sum += value.max(0.0);
        bright += u64::from(value > 0.18);
        covered += f64::from(alpha);
        count += 1;
    }
    let mean = sum / count.max(1) as f64;
    // Nothing in the picture is something else, which is reported elsewhere.
    if !(mean < DARK && covered > 0.0) || bright as f64 > SEEN * count as f64 {
        return None;
    }
    let stops = (0.18 / mean.max(1e-30)).log2();
    let brighter = match mean > 1e-12 {
        true => format!("--exposure {} shows it", (f64::from(exposure) + stops).round()),
        false => "no light reaches what the camera sees".to_string(),
    };
    let of_units = match is_of_gltf(file) && scene.lights.iter().any(|light| light.profile.is_none()) {
        true => format!("; its lights may be meant in other units: {} compat", Choice::LightUnits),
        false => String::new(),
    };
    let of_dark = if scene.lights.is_empty() { "; --env FILE or --stage light it" } else { "" };
    Some(Warning::general(format!(
        "the picture is nearly black (mean luminance {mean:.1e}): {brighter}{of_units}{of_dark}"
    )))
}

fn is_of_gltf(file: &Path) -> bool {
    let extension = file.extension().unwrap_or_default().to_ascii_lowercase();
    is_named_as_scene(file) && ["gltf", "glb", "vrm", "zip"].iter().any(|gltf| extension == *gltf)
}
