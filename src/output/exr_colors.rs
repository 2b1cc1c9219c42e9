//! What of EXRs is colour, and the space that it is written in.

use super::exr_options::{ExrOptions, layer_of};
use crate::color::Primaries;
use crate::film::{Film, Plane, Values};
use exr::meta::attribute::Chromaticities;
use exr::prelude::Vec2;

/// The space of the colours in EXRs. Pictures are rendered in linear Rec. 709.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WorkingSpace {
    /// Linear Rec. 709.
    #[default]
    Rec709,
    /// ACEScg: what was rendered is converted.
    AcesCg,
}

impl WorkingSpace {
    /// All of them.
    pub const ALL: [WorkingSpace; 2] = [WorkingSpace::Rec709, WorkingSpace::AcesCg];

    /// What users call it.
    pub fn name(self) -> &'static str {
        match self {
            WorkingSpace::Rec709 => "rec709",
            WorkingSpace::AcesCg => "acescg",
        }
    }

    /// What it is, for lists of them.
    pub fn about(self) -> &'static str {
        match self {
            WorkingSpace::Rec709 => "Linear Rec. 709, in which pictures are rendered",
            WorkingSpace::AcesCg => "ACEScg, converted from it",
        }
    }

    /// Its name in the Color Interop Forum's list.
    pub(super) fn interop_id(self) -> &'static str {
        match self {
            WorkingSpace::Rec709 => "lin_rec709_scene",
            WorkingSpace::AcesCg => "lin_ap1_scene",
        }
    }

    fn primaries(self) -> Primaries {
        match self {
            WorkingSpace::Rec709 => Primaries::REC709,
            WorkingSpace::AcesCg => Primaries::AP1,
        }
    }

    /// For the header.
    pub(super) fn chromaticities(self) -> Chromaticities {
        let Primaries { red, green, blue, white } = self.primaries();
        let [red, green, blue, white] = [red, green, blue, white].map(|[x, y]| Vec2(x as f32, y as f32));
        Chromaticities { red, green, blue, white }
    }
}

/// Parts whose channels are no colours.
const COLORLESS: [&str; 17] = [
    "depth",
    "nearest",
    "P",
    "N",
    "Ng",
    "facing",
    "shadow",
    "UV",
    "roughness",
    "object",
    "material",
    "samples",
    "variance",
    "motion",
    "CryptoObject",
    "CryptoMaterial",
    "CryptoAsset",
];

/// Factors on colours, whatever their space.
const FACTORS: &str = "ShadowCatcher";

/// Are the channels of a part, or of a layer without its number, colours?
pub fn is_color(part: &str) -> bool {
    !COLORLESS.contains(&part)
}

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
