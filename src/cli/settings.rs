//! From arguments, scene file and defaults to settled options.

use super::args::{FilterArg, FresnelArg, MicrofacetArg, RenderArgs, TerminatorArg, ViewArg};
use oscura::error::{Error, Result, Warning};
use oscura::film::AovSet;
use oscura::output::{PngOptions, ViewTransform};
use oscura::render::RenderOptions;
use oscura::scene::{EnergyCompensation, Filter, FresnelModel, Scene};

const DEFAULT_ASPECT: f64 = 16.0 / 9.0;
/// Most pixels of a picture; a film takes 36 bytes for each.
const PIXEL_LIMIT: u64 = 1 << 28;

/// Everything about a run that is decided before it starts.
pub(crate) struct Settled {
    pub render: RenderOptions,
    pub energy_compensation: EnergyCompensation,
    pub fresnel: FresnelModel,
    pub camera: Option<usize>,
    pub png: PngOptions,
}

/// Command line over scene file over defaults. What has no effect because no output is an EXR is left out, with a
/// warning.
pub(crate) fn settle(
    args: &RenderArgs,
    scene: &Scene,
    has_exr: bool,
    warnings: &mut Vec<Warning>,
) -> Result<Settled> {
    let from_file = &scene.settings;
    let camera = args.camera.as_deref().map(|wanted| find_camera(scene, wanted)).transpose()?;
    let (width, height) = picture_size(args, scene, camera.unwrap_or(0))?;
    let filter = args.filter.map(|f| match f {
        FilterArg::Box => Filter::Box,
        FilterArg::Gaussian => Filter::Gaussian,
        FilterArg::BlackmanHarris => Filter::BlackmanHarris,
    });
    let energy_compensation = args.microfacet.map(|m| match m {
        MicrofacetArg::Multi => EnergyCompensation::On,
        MicrofacetArg::Single => EnergyCompensation::Off,
    });
    let fresnel = args.fresnel.map(|f| match f {
        FresnelArg::Exact => FresnelModel::Exact,
        FresnelArg::Schlick => FresnelModel::Schlick,
    });
    let exposure = args.exposure.or(from_file.exposure).unwrap_or(0.0);
    for (option, is_given) in [("--aov", !args.aov.is_empty()), ("--float", args.float)] {
        if is_given && !has_exr {
            warnings.push(Warning::general(format!("{option} has no effect: no output is an EXR")));
        }
    }
    let aovs: AovSet = args.aov.iter().copied().filter(|_| has_exr).collect();
    let default = RenderOptions::default();
    let render = default
        .size(width, height)
        .samples(args.spp.or(from_file.samples).unwrap_or(default.samples))
        .seed(args.seed.or(from_file.seed).unwrap_or(default.seed))
        .max_depth(args.depth.or(from_file.depth).unwrap_or(default.max_depth))
        .filter(filter.or(from_file.filter).unwrap_or(default.filter))
        .aovs(aovs)
        .soft_terminator(args.terminator == TerminatorArg::Soft)
        .time_limit(args.time_limit);
    let view = match args.view {
        ViewArg::Srgb => ViewTransform::Srgb,
        ViewArg::Filmic => ViewTransform::Filmic,
    };
    Ok(Settled {
        render,
        energy_compensation: energy_compensation.or(from_file.energy_compensation).unwrap_or_default(),
        fresnel: fresnel.or(from_file.fresnel).unwrap_or_default(),
        camera,
        png: PngOptions { view, exposure, dither: args.dither },
    })
}

fn find_camera(scene: &Scene, wanted: &str) -> Result<usize> {
    let by_name = scene.cameras.iter().position(|c| c.name == wanted);
    let by_number = || wanted.parse().ok().filter(|&i: &usize| i < scene.cameras.len());
    by_name.or_else(by_number).ok_or_else(|| {
        let names: Vec<String> =
            scene.cameras.iter().enumerate().map(|(i, c)| format!("{i} '{}'", c.name)).collect();
        Error::usage(format!("there is no camera '{wanted}'"))
            .with_help(format!("the scene has: {}", names.join(", ")))
    })
}

fn picture_size(args: &RenderArgs, scene: &Scene, camera: usize) -> Result<(u32, u32)> {
    let file = &scene.settings;
    let from_camera = scene.cameras.get(camera).and_then(|c| c.aspect_ratio);
    let aspect = match (file.width, file.height) {
        (Some(w), Some(h)) => f64::from(w) / f64::from(h),
        _ => from_camera.filter(|a| *a > 0.0 && a.is_finite()).unwrap_or(DEFAULT_ASPECT),
    };
    // One dimension on the command line makes the file's other one meaningless: the aspect ratio stays.
    let (width, height) = if (args.width, args.height) == (None, None) {
        (file.width, file.height)
    } else {
        (args.width, args.height)
    };
    let rounded = |v: f64| v.round().clamp(1.0, 65_536.0) as u32;
    let (width, height) = match (width, height) {
        (Some(w), Some(h)) => (w, h),
        (Some(w), None) => (w, rounded(f64::from(w) / aspect)),
        (None, Some(h)) => (rounded(f64::from(h) * aspect), h),
        (None, None) => {
            let width = RenderOptions::default().width;
            (width, rounded(f64::from(width) / aspect))
        }
    };
    check_pixels(width, height)?;
    Ok((width, height))
}

/// Finds pictures that are too large for any scene, before one is loaded.
///
/// # Errors
/// A usage error.
pub(crate) fn check_size(args: &RenderArgs) -> Result<()> {
    match (args.width, args.height) {
        (Some(width), Some(height)) => check_pixels(width, height),
        _ => Ok(()),
    }
}

fn check_pixels(width: u32, height: u32) -> Result<()> {
    if u64::from(width) * u64::from(height) > PIXEL_LIMIT {
        let message = format!("{width} x {height} pixels are more than the {PIXEL_LIMIT} possible");
        return Err(Error::usage(message).with_help("give a smaller --width or --height"));
    }
    Ok(())
}
