//! `[render]`: what the scene says about rendering; the command line overrides each.
//!
//! | Key | Meaning | Range |
//! |---|---|---|
//! | `width`, `height` | picture in pixels | 1 to 65,536 |
//! | `samples` | samples a pixel | at least 1 |
//! | `depth` | largest number of scattering events; 0 shows emission only | |
//! | `seed` | seed of all randomness | |
//! | `filter` | `box`, `gaussian`, `blackman-harris` | |
//! | `microfacet` | `multi` or `single` scattering | |
//! | `fresnel` | `exact` or `schlick`: how dielectric layers of glTF materials reflect more towards grazing incidence | |
//! | `spectral` | `true` renders by wavelength, as `--spectral` | |
//! | `aovs` | list of further channels of the EXR, as `--aov` takes them, beside those that it names | |
//! | `exposure` | exposure of the PNG in stops | -100 to 100 |

use super::fields::Fields;
use crate::scene::{EnergyCompensation, Filter, FresnelModel, Settings};

/// A list of names.
fn names(fields: &Fields, key: &'static str) -> Option<Vec<String>> {
    let value = fields.raw(key)?;
    let list = value.get_ref().as_array();
    let name = |v: &toml::Spanned<toml::de::DeValue>| v.get_ref().as_str().map(str::to_string);
    let names = list.and_then(|list| list.iter().map(name).collect::<Option<Vec<String>>>());
    if names.is_none() {
        fields.problems.push(value.span(), format!("'{key}' must be a list of names"));
    }
    names
}

pub(super) fn read(fields: &Fields) -> Settings {
    let filters =
        [("box", Filter::Box), ("gaussian", Filter::Gaussian), ("blackman-harris", Filter::BlackmanHarris)];
    let settings = Settings {
        width: fields.integer("width", 1, 65_536),
        height: fields.integer("height", 1, 65_536),
        samples: fields.integer("samples", 1, u32::MAX),
        depth: fields.integer("depth", 0, u32::MAX),
        seed: fields.integer("seed", 0, u32::MAX),
        filter: fields.choice("filter", &filters),
        energy_compensation: fields
            .choice("microfacet", &[("multi", EnergyCompensation::On), ("single", EnergyCompensation::Off)]),
        fresnel: fields
            .choice("fresnel", &[("exact", FresnelModel::Exact), ("schlick", FresnelModel::Schlick)]),
        spectral: fields.has("spectral").then(|| fields.flag("spectral", false)),
        aovs: names(fields, "aovs"),
        exposure: fields.has("exposure").then(|| fields.number_in("exposure", -100.0..100.0, 0.0) as f32),
    };
    fields.finish();
    settings
}
