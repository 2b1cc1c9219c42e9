//! Enumerations given as strings.

use super::errors::usage;
use oscura::load::Up;
use oscura::load::gltf::{Glass, LightUnits};
use oscura::load::stage::{Ground, StageLight, ViewFrom};
use oscura::load::subdivide::{MAX_LEVELS, Subdivision};
use oscura::output::{ViewTransform, read_view};
use pyo3::PyResult;
use std::path::Path;
use std::str::FromStr;

/// The program's limit.
const MAX_THREADS: usize = 1024;

/// Looks up a string in a list of choices.
fn choose<T: Clone>(argument: &str, word: &str, choices: &[(&str, T)]) -> PyResult<T> {
    let found = choices.iter().find(|(name, _)| *name == word).map(|(_, value)| value.clone());
    found.ok_or_else(|| {
        let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
        usage(format!("{argument}='{word}' is not possible (one of {})", names.join(", ")))
    })
}

/// Which axis points up.
pub fn up(word: &str) -> PyResult<Up> {
    let choices: Vec<(&str, Up)> = Up::ALL.iter().map(|up| (up.name(), *up)).collect();
    choose("up", word, &choices)
}

/// What transparent materials without a volume are.
pub fn glass(word: &str) -> PyResult<Glass> {
    let choices =
        [("auto", Glass::Auto), ("solid", Glass::Solid), ("thin", Glass::Thin), ("panes", Glass::Panes)];
    choose("glass", word, &choices)
}

/// Units of light intensities.
pub fn light_units(word: &str) -> PyResult<LightUnits> {
    let choices = [
        ("auto", LightUnits::Auto),
        ("spec", LightUnits::Spec),
        ("compat", LightUnits::Compat),
        ("raw", LightUnits::Raw),
    ];
    choose("light_units", word, &choices)
}

/// Default lighting for scenes without light.
pub fn stage(word: &str) -> PyResult<StageLight> {
    let choices = [
        ("studio", StageLight::Studio),
        ("sky", StageLight::Sky),
        ("sunset", StageLight::Sunset),
        ("white", StageLight::White),
        ("soft", StageLight::Soft),
        ("none", StageLight::None),
    ];
    choose("stage", word, &choices)
}

/// Ground of bare models.
pub fn ground(word: &str) -> PyResult<Ground> {
    choose("ground", word, &[("none", Ground::None), ("shadow", Ground::Shadow), ("floor", Ground::Floor)])
}

/// The crease angle in radians, from degrees.
pub fn crease(degrees: Option<f64>) -> PyResult<Option<f64>> {
    match degrees {
        Some(angle) if !(0.0..=180.0).contains(&angle) => Err(usage("smooth must be 0 to 180 degrees")),
        angle => Ok(angle.map(f64::to_radians)),
    }
}

/// Catmull-Clark subdivision levels.
pub fn subdivision(levels: Option<u32>) -> PyResult<Option<Subdivision>> {
    match levels {
        Some(levels) if levels > MAX_LEVELS => Err(usage(format!("subdivide must be 0 to {MAX_LEVELS}"))),
        levels => Ok(levels.map(|levels| Subdivision { levels, has_round_corners: false })),
    }
}

/// Default view direction for bare models.
pub fn view_from(word: &str) -> PyResult<ViewFrom> {
    ViewFrom::from_str(word).map_err(|message| usage(format!("view_from='{word}' {message}")))
}

/// View transform.
pub fn view(word: &str) -> PyResult<ViewTransform> {
    if ViewTransform::is_file(word) {
        return read_view(Path::new(word)).map_err(|message| usage(format!("{word}: {message}")));
    }
    let choices = ViewTransform::NAMED.map(|(view, name, _)| (name, view));
    choose("view", word, &choices)
}

/// Parses a string.
pub fn parsed<T: FromStr>(argument: &str, word: &str) -> PyResult<T>
where
    T::Err: std::fmt::Display,
{
    word.parse().map_err(|error| usage(format!("{argument}='{word}': {error}")))
}

/// Validates a number of threads.
pub fn checked_threads(count: Option<usize>) -> PyResult<Option<usize>> {
    match count.is_none_or(|count| (1..=MAX_THREADS).contains(&count)) {
        true => Ok(count),
        false => Err(usage(format!("threads must be 1 to {MAX_THREADS}"))),
    }
}
