//! What of EXRs is colour, and the space that it is written in.

use crate::color::Primaries;
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

    pub(super) fn primaries(self) -> Primaries {
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
pub(super) const FACTORS: &str = "ShadowCatcher";

/// Are the channels of a part, or of a layer without its number, colours?
pub fn is_color(part: &str) -> bool {
    !COLORLESS.contains(&part)
}
