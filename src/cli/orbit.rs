//! `oscura render --orbit N`: the camera goes once around the model.

use super::Outcome;
use super::args::RenderArgs;
use super::environment::EnvironmentOverride;
use super::frames::Frames;
use super::moving::{MovingPictures, still};
use super::pictures::Targets;
use super::scene_path;
use super::settings::choices;
use super::shot::{Kept, load_options, load_scene, run_one};
use oscura::compile::Compiler;
use oscura::error::{Error, Result};
use oscura::load::Loaded;
use oscura::load::stage::{Turntable, middle};
use oscura::render::CancelHandle;
use std::f64::consts::TAU;
use std::time::Instant;

/// Renders all pictures, from the camera's own place on, counter-clockwise seen from above.
pub(super) fn run(args: &RenderArgs, count: u32, cancel: &CancelHandle) -> Result<Outcome> {
    let still = still(&args.output);
    let files = |k: u32| still.iter().map(|path| Frames::file(path, k)).collect::<Vec<_>>();
    (0..count).try_for_each(|k| Targets::check(&files(k)).map(drop))?;
    let moving = Some(MovingPictures::new(args)?);
    let mut start = Instant::now();
    scene_path::check(&args.scene)?;
    let environment = EnvironmentOverride::load(args)?;
    let mut options = load_options(args)?;
    options.stage.is_orbit = true;
    let mut loaded = load_scene(args, cancel, &options)?;
    let warnings = environment.apply(args, &mut loaded.scene);
    loaded.warnings.extend(warnings);
    let number = choices(args).settle(&loaded.scene)?.camera.unwrap_or(0);
    let first = loaded.scene.cameras.get(number).cloned();
    let first = first.ok_or_else(|| Error::input(&args.scene, "has no camera"))?;
    let table = turntable(&loaded);
    let mut kept = Kept { moving, ..Kept::new(args, Compiler::sequence())? };
    for k in 0..count {
        if !args.quiet {
            say!("frame    {k} of {count}");
        }
        let angle = f64::from(k) / f64::from(count) * TAU;
        loaded.scene.cameras[number] = table.camera(&first, angle);
        table.light(&mut loaded.scene, angle);
        let targets = Targets::check(&files(k))?;
        let outcome = run_one(args, cancel, &targets, None, &mut loaded, start, &mut kept);
        if !matches!(outcome, Ok(Outcome::Done)) {
            kept.moving.iter().for_each(|moving| moving.say_unfinished(args));
            return outcome;
        }
        start = Instant::now();
    }
    kept.moving.map_or(Ok(()), |moving| moving.finish(args))?;
    Ok(Outcome::Done)
}

/// About the model that loading framed, else about the middle of the scene.
fn turntable(loaded: &Loaded) -> Turntable {
    loaded.turntable.unwrap_or_else(|| Turntable::new(middle(loaded), false))
}
