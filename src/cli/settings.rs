//! What the command line says about a picture.

use super::args::{FilterArg, FresnelArg, MicrofacetArg, RenderArgs, TerminatorArg, TreeArg};
use oscura::error::{Error, Result};
use oscura::film::AovSet;
use oscura::output::{PngOptions, ViewTransform};
use oscura::render::{Choices, TreeChoice};
use oscura::scene::{EnergyCompensation, Environment, Filter, FresnelModel, RayKinds, Scene, Settings};

/// Samples a pixel at most where the noise decides on their number.
const MOST_SAMPLES: u32 = 1 << 16;

/// The choices that the arguments make.
pub(crate) fn choices(args: &RenderArgs) -> Choices {
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
    let tree = match args.tree {
        TreeArg::Auto => TreeChoice::Auto,
        TreeArg::Fast => TreeChoice::Fast,
        TreeArg::Full => TreeChoice::Full,
    };
    Choices {
        settings: Settings {
            width: args.width,
            height: args.height,
            // The noise decides then, unless a number is given.
            samples: args.spp.or(args.long.noise.map(|_| args.long.max_spp.unwrap_or(MOST_SAMPLES))),
            depth: args.depth,
            seed: args.seed,
            filter,
            energy_compensation,
            fresnel,
            spectral: args.spectral.then_some(true),
            exposure: args.exposure,
            ..Settings::default()
        },
        camera: args.camera.clone(),
        aovs: args.aov.iter().fold(AovSet::NONE, |all, aovs| all.union(*aovs)),
        aov_space: args.aov_space,
        matte_levels: args.crypto_levels,
        light_groups: args.light_groups,
        planned: args.long.plan.unwrap_or(0),
        sample_range: args.long.sample_range,
        region: args.long.region.or(args.exr.crop),
        transparent_glass: args.transparent_glass,
        halves: false,
        soft_terminator: args.terminator == TerminatorArg::Soft,
        path_reuse: args.path_reuse,
        splitting: args.splitting,
        caustics: args.picture.caustics,
        guiding: args.guiding.guiding,
        adaptive: args.adaptive,
        tree,
        least_samples: args.long.min_spp.unwrap_or(0),
        most_samples: args.long.max_spp.unwrap_or(u32::MAX),
        noise: args.long.noise.map(|percent| percent / 100.0),
        time_limit: args.long.time_limit,
    }
}

/// Leaves out what has no effect because no output is an EXR.
pub(crate) fn without_exr(choices: Choices) -> Choices {
    Choices { aovs: AovSet::NONE, light_groups: false, ..choices }
}

/// Is there anything that transparent glass could let through?
///
/// # Errors
/// A usage error where the camera sees the environment.
pub(crate) fn check_glass(args: &RenderArgs, scene: &Scene) -> Result<()> {
    let sees_environment = scene.environment_visible_to.contains(RayKinds::CAMERA);
    if args.transparent_glass && sees_environment && scene.environment != Environment::Black {
        let message = "--transparent-glass has no effect where the camera sees the environment";
        return Err(Error::usage(message).with_help("add --transparent, or a --background"));
    }
    Ok(())
}

/// How PNGs and the like look.
pub(crate) fn png(args: &RenderArgs, exposure: f32, is_stage_lit: bool, opaque: bool) -> PngOptions {
    let view = match &args.view {
        Some(view) => view.clone(),
        None if is_stage_lit && args.stage.leaves_view_open() => ViewTransform::Filmic,
        None => ViewTransform::Srgb,
    };
    PngOptions {
        view,
        exposure,
        white_balance: args.picture.white_balance,
        dither: args.dither,
        deep: args.picture.deep,
        opaque,
    }
}
