//! `oscura thumb`: small pictures of many models.

use super::outcome::{Outcome, exit_code};
use super::process::cancel_by_signals;
use super::report;
use super::scene_path;
use super::terms;
use super::thumb_args::ThumbArgs;
use oscura::error::{Error, Result};
use oscura::film::AovSet;
use oscura::load::{LoadOptions, Loaded, is_of_blender, load};
use oscura::output::{
    Format, PngOptions, ViewTransform, check_target, encode, is_same_target, make_folder, write_atomically,
};
use oscura::render::{
    CancelHandle, Caustics, Guiding, PathReuse, Renderer, Splitting, denoising_guides, in_pool,
};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Scattering events of a path: more are not seen at this size.
const DEPTH: u32 = 6;

/// What helps where a picture would replace something else.
const ELSEWHERE: &str = "give another place by -o FOLDER or --file FILE";

/// Makes all pictures; models that fail are listed, and the worst decides the exit code.
pub(super) fn run(args: &ThumbArgs) -> Result<Outcome> {
    let cancel = cancel_by_signals()?;
    let targets = targets(args)?;
    let threads = args.threads.map(usize::from);
    in_pool(threads, || all(args, &targets, &cancel))?
}

/// Where each picture goes.
fn targets(args: &ThumbArgs) -> Result<Vec<PathBuf>> {
    if let Some(file) = &args.file {
        return match args.models.len() {
            1 => Ok(vec![file.clone()]),
            many => Err(Error::usage(format!("--file is the picture of one model, not of {many}"))
                .with_help("give a folder by -o")),
        };
    }
    if let Some(folder) = &args.output {
        make_folder(folder)?;
    }
    let mut targets: Vec<PathBuf> = Vec::new();
    for model in &args.models {
        let beside = model.with_extension("png");
        let target = match &args.output {
            Some(folder) => folder.join(beside.file_name().unwrap_or_default()),
            None => beside,
        };
        if targets.contains(&target) {
            let message = format!("two models would become {}", target.display());
            return Err(Error::usage(message).with_help("give those of one name apart, or without -o"));
        }
        targets.push(target);
    }
    Ok(targets)
}

fn all(args: &ThumbArgs, targets: &[PathBuf], cancel: &CancelHandle) -> Result<Outcome> {
    let mut failures: Vec<(&Path, Error)> = Vec::new();
    for (model, target) in args.models.iter().zip(targets) {
        let start = Instant::now();
        match one(args, model, target, cancel) {
            Ok(true) if !args.quiet => {
                say!("wrote    {} in {:.1} s", target.display(), start.elapsed().as_secs_f64());
            }
            Ok(_) => {}
            Err(error) => {
                let error = terms::in_error(error);
                report::error(&error);
                failures.push((model, error));
            }
        }
        if cancel.is_cancelled() {
            return Ok(Outcome::Interrupted);
        }
    }
    let worst = failures.iter().map(|(_, error)| exit_code(error)).max();
    let Some(worst) = worst else { return Ok(Outcome::Done) };
    say!("{} of {} models failed:", failures.len(), args.models.len());
    failures.iter().for_each(|(model, _)| say!("  {}", model.display()));
    Ok(Outcome::Failed(worst))
}

/// Makes one; false if it was stopped.
fn one(args: &ThumbArgs, model: &Path, target: &Path, cancel: &CancelHandle) -> Result<bool> {
    scene_path::check(model)?;
    check_target(target)?;
    refuse_part(model, target, &[model.to_path_buf()])?;
    if args.file.is_none() && args.output.is_none() && is_of_blender(model) && target.exists() {
        // Only Blender knows which textures such a file has.
        let message = format!("{} exists, and may be a texture of {}", target.display(), model.display());
        return Err(Error::usage(message).with_help(ELSEWHERE));
    }
    let stage = args.stage.options(Some(1.0), &mut Vec::new())?;
    let options = LoadOptions {
        allow_external: args.allow_external,
        up: args.stage.up,
        smooth_rad: args.stage.smooth.map(f64::to_radians),
        subdivision: args.stage.subdivision(),
        stage,
        ..LoadOptions::default()
    };
    let loaded = load(model, &options)?;
    refuse_part(model, target, &options.files.paths())?;
    let is_stage_lit = loaded.is_stage_lit;
    let (width, height) = size(args.size, &loaded);
    // Denoising does more for a few samples than what makes each of them better, in less time.
    let mut rendering = Renderer::new(loaded)
        .size(width, height)
        .samples(args.spp)
        .max_depth(DEPTH)
        .caustics(Caustics::Off)
        .guiding(Guiding::Off)
        .path_reuse(PathReuse::Off)
        .splitting(Splitting::OFF)
        .aovs(denoising_guides())
        .halves(true)
        .cancel_by(cancel)
        .start()?;
    rendering.run();
    if cancel.is_cancelled() {
        return Ok(false);
    }
    rendering.denoise(AovSet::NONE);
    let picture = rendering.into_picture();
    let view = match is_stage_lit && args.stage.leaves_view_open() {
        true => ViewTransform::Filmic,
        false => ViewTransform::Srgb,
    };
    let mut output = picture.output_options().clone();
    output.png = PngOptions { view, ..output.png };
    // By what they hold, not by the name: that of a file manager's temporary file may end in anything.
    let encoded = encode(picture.film(), Format::Png, &output, target)?;
    write_atomically(target, &encoded.bytes)?;
    Ok(true)
}

/// The picture must not replace the model or a file that it is made of, such as a texture of its name. A texture that is missing
/// counts as well: the picture would become it.
fn refuse_part(model: &Path, target: &Path, parts: &[PathBuf]) -> Result<()> {
    if !parts.iter().any(|part| is_same_target(part, target)) {
        return Ok(());
    }
    let model = model.display();
    let message = format!("the picture would be {}, which {model} is made of", target.display());
    Err(Error::usage(message).with_help(ELSEWHERE))
}

/// Square for models that were framed; else of the shape that the scene asks for.
fn size(longer: u32, loaded: &Loaded) -> (u32, u32) {
    let settings = &loaded.scene.settings;
    let of_scene = match (settings.width, settings.height) {
        (Some(w), Some(h)) if h > 0 => Some(f64::from(w) / f64::from(h)),
        _ => loaded.scene.cameras.first().and_then(|c| c.aspect_ratio),
    };
    let aspect = of_scene.filter(|a| *a > 0.0 && a.is_finite() && loaded.turntable.is_none()).unwrap_or(1.0);
    let of = |share: f64| ((f64::from(longer) * share).round() as u32).max(1);
    (of(aspect.min(1.0)), of(1.0 / aspect.max(1.0)))
}
