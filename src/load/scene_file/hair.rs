//! `type = "hair"` (Chiang et al. 2016) is a fibre of glass with pigment, for `[[curves]]`. On other shapes fibres lie where texture
//! coordinate u grows.
//!
//! | Key | Value |
//! |---|---|
//! | `color` | what much of it looks like (0.8), or one of the next two in its place |
//! | `melanin` | how much pigment, 0 (white) to 1 (black); `melanin_redness`, 0 (brown) to 1 (red), is 0.5 by default |
//! | `absorption` | by channel, per radius: three numbers from 0 up, or one |
//! | `roughness` | along the fibre, 0 to 1 (0.3) |
//! | `radial_roughness` | around the fibre, 0 to 1 (0.3) |
//! | `ior` | 1 to 3 (1.55) |
//! | `tilt` | of the scales towards the root, degrees, -45 to 45 (2) |
//! | `coat` | 0 to 1 (0): makes what the surface reflects less rough, as wet or cared-for hair is |

use super::fields::Fields;
use crate::scene::{ColorSlot, FloatSlot, Model, hair_color};

pub(super) fn read(fields: &Fields, mut slot: impl FnMut(&'static str, f32) -> ColorSlot) -> Model {
    let share = |key, otherwise| fields.number_in(key, 0.0..1.0, otherwise) as f32;
    let radial = share("radial_roughness", 0.3);
    let ways = ["color", "melanin", "absorption"];
    if ways.into_iter().filter(|key| fields.has(key)).count() > 1 {
        let message = "'color', 'melanin' and 'absorption' say the same: keep one";
        fields.problems.push(fields.span(), message);
    }
    if fields.has("melanin_redness") && !fields.has("melanin") {
        fields.problems.push(fields.span(), "'melanin_redness' needs 'melanin'");
    }
    let color = if fields.has("melanin") {
        let absorption = absorption_of_melanin(share("melanin", 0.5), share("melanin_redness", 0.5));
        ColorSlot::constant(hair_color(absorption, radial))
    } else if let Some(absorption) = fields.color("absorption") {
        ColorSlot::constant(hair_color(absorption.value, radial))
    } else {
        slot("color", 0.8)
    };
    Model::Hair {
        color,
        roughness: FloatSlot::constant(share("roughness", 0.3)),
        radial_roughness: FloatSlot::constant(radial),
        ior: fields.number_in("ior", 1.0..3.0, 1.55) as f32,
        tilt_rad: fields.number_in("tilt", -45.0..45.0, 2.0).to_radians() as f32,
        coat: FloatSlot::constant(share("coat", 0.0)),
    }
}

/// Absorption per radius of eumelanin (brown) and pheomelanin (red), by the concentrations that Cycles gives these numbers.
fn absorption_of_melanin(melanin: f32, redness: f32) -> [f32; 3] {
    let amount = -(1.0 - melanin).max(1e-4).ln();
    let (brown, red) = (amount * (1.0 - redness), amount * redness);
    let of = |brown_unit: f32, red_unit: f32| brown * brown_unit + red * red_unit;
    [of(0.506, 0.343), of(0.841, 0.733), of(1.653, 1.924)]
}
