//! Textures of `type = "spectrum"`: measured spectra. Pictures by wavelength (`spectral` in `[render]`, or `--spectral`) are made
//! with them, others with the colour that they look like.
//!
//! | Key | Meaning |
//! |---|---|
//! | `values` | a list of pairs of a wavelength (nm, rising) and a value; or of values alone |
//! | `from`, `to` | wavelengths of the first and the last of values alone, with even steps between (nm) |
//! | `light` | `true`: the power of a light by wavelength in any unit, for `radiance` and `emission`; else shares of light, 0 to 1 (`false`) |
//! | `black_body` | in place of `values`: the light of a black body of so many kelvins, 100 to 100,000 |
//! | `luminance` | of a light: the luminance of its radiance, where white of radiance 1 has 1 (1) |
//!
//! Between values a spectrum is straight, beyond the first and the last it is constant; 380 to 780 nm count, in steps of 1 nm.

use super::fields::{Fields, number, numbers};
use crate::color::spectral::Curve;

/// Wavelengths that may be given, nanometres.
const RANGE_NM: std::ops::Range<f64> = 1.0..1e6;

/// Largest luminance, and largest value.
const MOST: f64 = 1e9;

pub(super) fn read(fields: &Fields) -> Option<Curve> {
    let is_light = fields.flag("light", false);
    let luminance = fields.has("luminance").then(|| fields.number_in("luminance", 0.0..MOST, 1.0));
    let kelvin = fields.has("black_body").then(|| fields.number_in("black_body", 100.0..100_000.0, 5000.0));
    if let Some(kelvin) = kelvin {
        if fields.has("values") {
            fields.problems.push(fields.span(), "'black_body' has its values: leave 'values' out");
        }
        return Some(Curve::black_body(kelvin, luminance.unwrap_or(1.0)));
    }
    let values = values(fields)?;
    if is_light {
        return Some(Curve::light(&values, luminance.unwrap_or(1.0)));
    }
    if luminance.is_some() {
        fields.problems.push(fields.span(), "only lights have a 'luminance': add light = true");
    }
    if values.iter().any(|(_, value)| *value > 1.0) {
        let help = "divide by the largest, or add light = true";
        fields.problems.push_help(fields.span(), "shares of light are at most 1", help);
    }
    Some(Curve::share(&values))
}

/// Pairs of a wavelength and a value.
fn values(fields: &Fields) -> Option<Vec<(f64, f64)>> {
    let list = fields.require("values", fields.list("values"))?;
    let ends = ["from", "to"].map(|key| fields.has(key).then(|| fields.number_in(key, RANGE_NM, 0.0)));
    let pairs: Option<Vec<(f64, f64)>> = match ends {
        [Some(from), Some(to)] => {
            let step = (to - from) / (list.len().max(2) - 1) as f64;
            let at = |i: usize| from + step * i as f64;
            list.iter().enumerate().map(|(i, v)| Some((at(i), number(v.get_ref())?))).collect()
        }
        _ => list.iter().map(|v| numbers::<2>(v.get_ref()).map(|[nm, value]| (nm, value))).collect(),
    };
    let Some(pairs) = pairs.filter(|pairs| !pairs.is_empty()) else {
        let message =
            "'values' must be a list of pairs of a wavelength and a value, or of values with 'from' and 'to'";
        fields.problems.push(fields.span(), message);
        return None;
    };
    let rises = pairs.windows(2).all(|pair| pair[0].0 < pair[1].0);
    if !rises || pairs.iter().any(|(nm, _)| !RANGE_NM.contains(nm)) {
        fields.problems.push(fields.span(), "wavelengths must rise, in nanometres from 1 on");
        return None;
    }
    if pairs.iter().any(|(_, value)| !(0.0..=MOST).contains(value)) {
        fields.problems.push(fields.span(), format!("values of spectra must be from 0 to {MOST}"));
        return None;
    }
    Some(pairs)
}
