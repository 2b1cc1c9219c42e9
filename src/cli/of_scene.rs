//! What a scene says about the making of its pictures, where the command line says nothing.

use super::args::RenderArgs;
use oscura::output::part::Region;
use oscura::render::Adaptive;
use oscura::scene::Settings;

/// The arguments with what the scene says.
pub(super) fn completed(args: &RenderArgs, settings: &Settings) -> RenderArgs {
    let mut args = args.clone();
    args.view = args.view.or_else(|| settings.view.clone());
    args.picture.white_balance = args.picture.white_balance.or(settings.white_balance);
    args.picture.denoise |= settings.denoise == Some(true) && !args.picture.no_denoise;
    if args.long.region.is_none() {
        let region = |[x0, y0, x1, y1]: [u32; 4]| Region { x0, y0, x1, y1 };
        args.exr.crop = args.exr.crop.or(settings.crop.map(region));
    }
    // Numbers of samples that are asked for are just those.
    let is_part = args.long.sample_range.is_some() || args.long.region.is_some();
    let is_counted = args.spp.is_some() || is_part || args.long.plan.is_some();
    let has_own_noise = args.long.noise.is_some() || args.adaptive == Adaptive::Auto;
    if !is_counted && !has_own_noise && settings.noise.is_some() {
        args.long.noise = settings.noise;
        args.long.max_spp = args.long.max_spp.or(settings.samples);
    }
    args
}
