//! Metals by name, in `type = "metal"`: `name = "gold"` in place of a colour.
//!
//! Known are aluminium, beryllium, chromium, copper, gold, iridium, molybdenum, niobium, rhodium, silver, tantalum,
//! titanium-nitride and tungsten.

use super::fields::Fields;
use crate::color::spectral::Metal;

/// Complex index of refraction eta + i k by channel of linear Rec.709.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeasuredMetal {
    pub eta: [f32; 3],
    pub k: [f32; 3],
    /// The same by wavelength.
    pub metal: Option<Metal>,
}

const fn metal(eta: [f32; 3], k: [f32; 3]) -> MeasuredMetal {
    MeasuredMetal { eta, k, metal: None }
}

/// Measured spectra (Palik 1998, "Handbook of Optical Constants of Solids"), weighted with the CIE 1931 matching functions
/// and converted to linear Rec.709.
const METALS: [(&str, MeasuredMetal); 13] = [
    ("aluminium", metal([1.6575, 0.880_405, 0.521_244], [9.223_81, 6.2695, 4.837])),
    ("beryllium", metal([4.185_01, 3.185_03, 2.784_06], [3.835_47, 3.010_12, 2.868_99])),
    ("chromium", metal([4.369_67, 2.916_51, 1.6549], [5.206_55, 4.231_31, 3.7547])),
    ("copper", metal([0.201_005, 0.923_75, 1.102_22], [3.913_26, 2.453_05, 2.142_09])),
    ("gold", metal([0.143_036, 0.375_307, 1.442_05], [3.983, 2.385_56, 1.603_36])),
    ("iridium", metal([3.0863, 2.082_19, 1.617_91], [5.592_15, 4.067_09, 3.267_31])),
    ("molybdenum", metal([4.483_97, 3.525_13, 2.776_31], [4.111_44, 3.420_83, 3.150_61])),
    ("niobium", metal([3.420_07, 2.790_09, 2.395_63], [3.441_39, 2.737_67, 2.579_75])),
    ("rhodium", metal([2.585_79, 1.860_22, 1.554_26], [6.782_26, 4.702_99, 3.976_07])),
    ("silver", metal([0.155_276, 0.116_728, 0.138_388], [4.828_35, 3.122_22, 2.1469])),
    ("tantalum", metal([2.062_72, 2.392_94, 2.627_93], [2.408_36, 1.741_49, 1.947_03])),
    ("titanium-nitride", metal([1.648_45, 1.150_52, 1.379_82], [3.368_33, 1.9435, 1.102_07])),
    ("tungsten", metal([4.370_82, 3.300_25, 2.998_41], [3.500_64, 2.604_87, 2.273_23])),
];

/// The metal that `name` asks for, if it does.
pub(super) fn named(fields: &Fields) -> Option<MeasuredMetal> {
    let found = fields.choice("name", &METALS);
    let name = fields.string("name").map_or("", |name| name.value);
    let found = found.map(|found| MeasuredMetal { metal: Metal::named(name), ..found });
    if found.is_some() && fields.has("color") {
        fields.problems.push(fields.span(), "'name' gives the metal its colour: leave 'color' out");
    }
    found
}
