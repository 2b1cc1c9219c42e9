//! The planes of a film as EXRs have them.

use super::exr_colors::{FACTORS, WorkingSpace, is_color};
use super::exr_options::{ExrOptions, layer_of};
use crate::color::{Primaries, converted};
use crate::film::{Film, Plane, Values};

/// The planes of a film, colours in the space that is chosen.
pub(super) fn planes<'a>(film: &'a Film, options: &ExrOptions) -> Vec<Plane<'a>> {
    let mut planes = film.all_planes();
    let space = options.space;
    if space == WorkingSpace::Rec709 {
        return planes;
    }
    let matrix = Primaries::REC709.to(&space.primaries()).expect("both are spaces of colours");
    for at in 0..planes.len().saturating_sub(2) {
        let layer = layer_of(planes[at].name).trim_end_matches(|c: char| c.is_ascii_digit());
        let is_red = planes[at].name.rsplit('.').next() == Some("R");
        if is_red && is_color(layer) && layer != FACTORS {
            convert(&mut planes[at..at + 3], &matrix);
        }
    }
    planes
}

/// Applies a matrix to red, green and blue.
fn convert(planes: &mut [Plane], matrix: &[[f64; 3]; 3]) {
    let [red, green, blue] = planes else { return };
    let (Values::Float(red), Values::Float(green), Values::Float(blue)) =
        (&mut red.values, &mut green.values, &mut blue.values)
    else {
        return;
    };
    for ((r, g), b) in red.iter_mut().zip(green).zip(blue) {
        [*r, *g, *b] = converted(matrix, [*r, *g, *b]);
    }
}
