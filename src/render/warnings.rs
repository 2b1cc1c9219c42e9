//! What has to be said about the samples of a picture.

use crate::error::Warning;
use crate::film::Film;

/// What has to be said about the samples of a finished film.
pub fn film_warnings(film: &Film) -> Vec<Warning> {
    of_film(film, true)
}

/// The same; pixels without a sample are none of its while rendering goes on.
pub(super) fn of_film(film: &Film, has_stopped: bool) -> Vec<Warning> {
    let invalid = film.invalid_samples();
    let unsampled = if has_stopped { film.unsampled_pixels() } else { 0 };
    let all = u64::from(film.width()) * u64::from(film.height());
    let messages = [
        (invalid, format!("{invalid} samples were NaN or infinite and were left out")),
        (unsampled, format!("{unsampled} of {all} pixels have no sample and are black and transparent")),
    ];
    messages.into_iter().filter(|(count, _)| *count > 0).map(|(_, text)| Warning::general(text)).collect()
}
