//! `oscura inspect`: what is in a scene, and what would not be rendered.

mod scene_json;
mod text;

use super::args::InspectArgs;
use super::json;
use super::outcome::Outcome;
use super::report::{name_options_in_loaded, print_line};
use super::scene_args::check_scene_path;
use oscura::error::Result;
use oscura::image::Damage;
use oscura::load::stage::StageOptions;
use oscura::load::{LoadOptions, Loaded, load};
use std::collections::HashSet;
use std::sync::Arc;

pub(crate) fn run(args: &InspectArgs) -> Result<Outcome> {
    check_scene_path(&args.scene)?;
    let options = LoadOptions {
        allow_external: args.allow_external,
        point_radius: args.point_radius,
        no_sidecar: args.no_sidecar,
        blender: args.blender.options(),
        gltf: args.asset.options(),
        // What 'render' adds is listed, but is not in the file.
        stage: StageOptions { is_foretold: true, ..StageOptions::studio() },
        ..LoadOptions::default()
    };
    let mut loaded = load(&args.scene, &options)?;
    decode_images(&mut loaded)?;
    name_options_in_loaded(&mut loaded);
    if args.json {
        json::print(&scene_json::of(&args.scene, &loaded));
    } else {
        text::lines(&args.scene, &loaded).iter().for_each(|l| print_line(l));
    }
    Ok(Outcome::Done)
}

/// Decodes the images that are still encoded, one after the other, to report damaged ones as rendering would.
fn decode_images(loaded: &mut Loaded) -> Result<()> {
    let mut seen = HashSet::new();
    for image in &loaded.scene.images {
        if !image.is_encoded() || !seen.insert(Arc::as_ptr(&image.pixels)) {
            continue;
        }
        match image.decoded(&mut loaded.warnings) {
            Ok(_) => {}
            Err(Damage::LeftOut(warning)) => loaded.warnings.push(warning),
            Err(Damage::Fatal(error)) => return Err(error),
        }
    }
    Ok(())
}
