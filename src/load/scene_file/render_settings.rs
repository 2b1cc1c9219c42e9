//! `[render]`: render settings. Options of the command line override them.
//!
//! | Key | Meaning | Range |
//! |---|---|---|
//! | `width`, `height` | image size in pixels | 1 to 65,536 |
//! | `samples` | samples per pixel | at least 1 |
//! | `depth` | maximum number of bounces of a path; 0 renders directly visible emission only | |
//! | `bounces` | maximum number of bounces by type: `{ diffuse = 5, glossy = 5, transmission = 13, volume = 1, transparent = 9, subsurface = 256 }`, each optional; `transparent` counts surfaces passed by alpha, `subsurface` consecutive scattering events beneath a surface; longer paths are terminated, which darkens the picture | at least 1 |
//! | `clamp` | maximum contribution of a single path, mean of the channels: `{ direct = 50, indirect = 10 }`, each optional; direct is after at most one bounce. Removes fireflies, and darkens the picture | above 0 |
//! | `filter_glossy` | glossy filter, as Cycles' Filter Glossy: increases roughness after a rough bounce, which blurs caustics; 0 is off, 1 is Cycles' default | 0 to 1000 |
//! | `skip_caustics` | caustics to skip, as without Cycles' Reflective or Refractive Caustics: `{ reflective = true, refractive = true }`: after a diffuse bounce surfaces have no glossy reflection, or no transmission | |
//! | `terminator` | shadow terminator of meshes with shading normals: `soft` (the default) fades light out towards the horizon of a triangle; `lifted` starts shadow rays at the smooth surface approximated by the triangles, as Cycles does; `off` cuts light off | |
//! | `seed` | random seed | |
//! | `filter` | reconstruction filter: `box`, `gaussian`, `blackman-harris` | |
//! | `filter_radius` | radius of the filter in pixels: half the width of `box` (0.5 by default), three standard deviations of `gaussian` (1.5), half the window of `blackman-harris` (1.5), which is Cycles' filter width | 0.005 to 16 |
//! | `microfacet` | `multi` or `single` scattering between microfacets | |
//! | `fresnel` | Fresnel term of the dielectric layers of glTF materials: `exact` or `schlick` | |
//! | `spectral` | `true` renders spectrally, as `--spectral` | |
//! | `aovs` | list of AOVs (render passes), as `--aov` takes them, in addition to those of `--aov` | |
//! | `exposure` | exposure of PNG and other display-referred output, stops | -100 to 100 |
//! | `view` | view transform of display-referred output: `srgb`, `filmic`, `agx`, `agx-punchy`, `pbr-neutral`, `false-color`, `gamma`, or a lookup table file (cinespace, `.csp`, from linear Rec. 709 to sRGB, as `ociobakelut` writes; or `.view`, as the export of Blender's scenes does) | |
//! | `white_balance` | white balance of display-referred output: colour temperature shown as white, kelvin | 1667 to 25,000 |
//! | `noise` | noise threshold: stops at this relative error, percent; `samples` is then the maximum per pixel | above 0 to 1000 |
//! | `denoise` | `true` denoises the finished image | |
//! | `caught` | output of shadow catchers: `all`, shadows as alpha, and light reflected by objects; or `shadows`, alpha only, from the mean of the channels, as in Cycles | |
//! | `crop` | `[x0, y0, x1, y1]`: render only the pixels of a rectangle, x1 and y1 exclusive | within the image |

use super::builder::SceneFileBuilder;
use super::fields::Fields;
use crate::color::ViewTransform;
use crate::load::files;
use crate::scene::{
    BounceLimits, CatcherOutput, Clamp, EnergyCompensation, Filter, FresnelModel, Settings, ShadowTerminator,
    SkippedCaustics,
};
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

/// A number in a range; `None` without the key.
fn number(fields: &Fields, key: &'static str, range: Range<f64>) -> Option<f32> {
    fields.has(key).then(|| fields.number_in(key, range.clone(), range.start) as f32)
}

/// Maximum numbers of bounces by type.
fn bounces(fields: &Fields) -> Option<BounceLimits> {
    let fields = fields.table("bounces")?;
    let found = BounceLimits::by_name(|kind| fields.unsigned(kind, 1, u32::MAX));
    fields.finish();
    Some(found)
}

/// Maximum contribution of a path.
fn clamp(fields: &Fields) -> Option<Clamp> {
    let fields = fields.table("clamp")?;
    let range = f64::from(f32::MIN_POSITIVE)..f64::from(f32::MAX);
    let found = Clamp::by_name(|kind| number(&fields, kind, range.clone()));
    fields.finish();
    Some(found)
}

fn skip_caustics(fields: &Fields) -> Option<SkippedCaustics> {
    let fields = fields.table("skip_caustics")?;
    let found = SkippedCaustics {
        reflective: fields.flag("reflective", false),
        refractive: fields.flag("refractive", false),
    };
    fields.finish();
    Some(found)
}

/// Crop rectangle, pixels: x0, y0, x1, y1, the last two exclusive.
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
    let settings = Settings {
        width: fields.unsigned("width", 1, 65_536),
        height: fields.unsigned("height", 1, 65_536),
        samples: fields.unsigned("samples", 1, u32::MAX),
        depth: fields.unsigned("depth", 0, u32::MAX),
        bounces: bounces(fields),
        clamp: clamp(fields),
        filter_glossy: number(fields, "filter_glossy", 0.0..1000.0),
        skip_caustics: skip_caustics(fields),
        terminator: fields.choice("terminator", &ShadowTerminator::NAMED),
        seed: fields.unsigned("seed", 0, u32::MAX),
        filter: fields.choice("filter", &Filter::NAMED),
        filter_radius: number(fields, "filter_radius", 0.005..16.0),
        energy_compensation: fields.choice("microfacet", &EnergyCompensation::NAMED),
        fresnel: fields.choice("fresnel", &FresnelModel::NAMED),
        spectral: fields.has("spectral").then(|| fields.flag("spectral", false)),
        aovs: names(fields, "aovs"),
        view: view(build, fields),
        white_balance: number(fields, "white_balance", 1667.0..25_000.0),
        noise: number(fields, "noise", 1e-3..1000.0),
        denoise: fields.has("denoise").then(|| fields.flag("denoise", false)),
        crop: crop(fields),
        exposure: number(fields, "exposure", -100.0..100.0),
        caught: fields.choice("caught", &CatcherOutput::NAMED),
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
    let path = build.readable_path(given.value, given.span.clone())?;
    build.options.files.note(&path);
    files::read(&path, files::MAX_TEXT)
        .and_then(|bytes| ViewTransform::from_table(&bytes, &path))
        .map_err(|message| fields.problems.push(given.span, format!("{}: {message}", path.display())))
        .ok()
}
