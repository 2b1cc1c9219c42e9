//! Denoises what pages show, beside the rendering.

use super::state::{Denoised, Frame, Shared};
use oscura::film::AovSet;
use oscura::render::{denoise_film, in_pool};

/// Denoises frames, where that is wanted, until all is over: the first of each size, then whenever the samples have doubled.
pub(super) fn denoise_frames(shared: &Shared, threads: Option<usize>) {
    let mut last: Option<Denoised> = None;
    while let Some(frame) = shared.next_frame(|frame| is_due(frame, last.as_ref())) {
        let mut film = frame.film.clone();
        let Ok(by) = in_pool(threads, || denoise_film(&mut film, AovSet::all())) else { return };
        let Frame { samples, scale, is_finished, order, .. } = *frame;
        let denoised = Denoised { film: film.into(), by: by.into(), samples, scale, is_finished, order };
        last = Some(denoised.clone());
        // One of an earlier view would take the place of a newer picture.
        if shared.lock().frame.as_ref().is_some_and(|shown| shown.order == order) {
            shared.show(|state| state.denoised = Some(denoised));
        }
    }
}

fn is_due(frame: &Frame, last: Option<&Denoised>) -> bool {
    last.is_none_or(|last| {
        (frame.order, frame.scale) != (last.order, last.scale)
            || frame.samples >= 2.0 * last.samples
            || (frame.is_finished && !last.is_finished)
    })
}
