//! The planes of a film as EXRs have them.

use super::exr_colors::{FACTORS, WorkingSpace, is_color};
use super::exr_options::{ExrOptions, layer_of};
use crate::color::Primaries;
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
    let [Values::Float(red), Values::Float(green), Values::Float(blue)] =
        [0, 1, 2].map(|c| std::mem::replace(&mut planes[c].values, Values::Float(Vec::new())))
    else {
        return;
    };
    for (plane, row) in planes.iter_mut().zip(matrix) {
        let of = |((r, g), b): ((&f32, &f32), &f32)| {
            (row[0] * f64::from(*r) + row[1] * f64::from(*g) + row[2] * f64::from(*b)) as f32
        };
        plane.values = Values::Float(red.iter().zip(&green).zip(&blue).map(of).collect());
    }
}
