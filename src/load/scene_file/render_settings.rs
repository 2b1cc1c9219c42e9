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
//! | `aovs` | list of further channels of the EXR, as `--aov` takes them, next to those that it names | |
//! | `exposure` | exposure of PNGs and the like in stops | -100 to 100 |
//! | `view` | how they look: `srgb`, `filmic`, `agx`, `agx-punchy`, `pbr-neutral`, `false-color`, `gamma`, or the file of a table (cinespace, `.csp`, from linear Rec. 709 to sRGB, as `ociobakelut` writes; or `.view`, as the export of Blender's scenes does) | |
//! | `white_balance` | temperature of the light that looks white in them, kelvin | 1667 to 25,000 |
//! | `noise` | relative error in percent at which the picture is done; `samples` are the most of a pixel then | above 0 to 1000 |
//! | `denoise` | `true` takes the noise out of the finished picture | |
//! | `caught` | what shadow catchers show: `all`, shadows as alpha and the light that objects bring besides; or `shadows`, alpha alone by the mean of the channels, as Cycles | |
//! | `crop` | `[x0, y0, x1, y1]`: only the pixels from column x0 and row y0 to before column x1 and row y1 | within the picture |

use super::builder::SceneFileBuilder;
use super::fields::Fields;
use crate::color::ViewTransform;
use crate::scene::{CatcherOutput, EnergyCompensation, Filter, FresnelModel, Settings};
use std::ops::Range;

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

/// A number in a range, if it is there.
fn number(fields: &Fields, key: &'static str, range: Range<f64>) -> Option<f32> {
    fields.has(key).then(|| fields.number_in(key, range.clone(), range.start) as f32)
}

/// A part of the picture.
fn crop(fields: &Fields) -> Option<[u32; 4]> {
    let found = fields.numbers::<4>("crop")?;
    let is_pixel = |v: &f64| v.fract() == 0.0 && (0.0..=65_536.0).contains(v);
    let [x0, y0, x1, y1] = found.value;
    if !found.value.iter().all(is_pixel) || x0 >= x1 || y0 >= y1 {
        let message = "'crop' must be [x0, y0, x1, y1]: whole pixels with x0 < x1 and y0 < y1";
        fields.problems.push(found.span, message);
        return None;
    }
    Some(found.value.map(|v| v as u32))
}

pub(super) fn read(build: &SceneFileBuilder, fields: &Fields) -> Settings {
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
        view: view(build, fields),
        white_balance: number(fields, "white_balance", 1667.0..25_000.0),
        noise: number(fields, "noise", 1e-3..1000.0),
        denoise: fields.has("denoise").then(|| fields.flag("denoise", false)),
        crop: crop(fields),
        exposure: number(fields, "exposure", -100.0..100.0),
        caught: fields.choice("caught", &[("all", CatcherOutput::All), ("shadows", CatcherOutput::Shadows)]),
    };
    fields.finish();
    settings
}

fn view(build: &SceneFileBuilder, fields: &Fields) -> Option<ViewTransform> {
    let given = fields.string("view")?;
    if !ViewTransform::is_file(given.value) {
        let names = ViewTransform::NAMED.map(|(_, name, _)| (name, name));
        return fields.choice("view", &names).and_then(ViewTransform::from_name);
    }
    let path = build.resolve_path(given.value);
    build.options.files.note(&path);
    let bytes = std::fs::read(&path).map_err(|error| format!("can't be read: {error}"));
    bytes
        .and_then(|bytes| ViewTransform::from_table(&bytes, &path))
        .map_err(|message| fields.problems.push(given.span, format!("{}: {message}", path.display())))
        .ok()
}
