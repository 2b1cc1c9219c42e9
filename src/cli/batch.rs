//! `oscura render` of one scene or of several, one after another.

use super::args::RenderArgs;
use super::outcome::{Outcome, exit_code};
use super::pictures::Targets;
use super::process::cancel_by_signals;
use super::{json, render, report, report_json, show, terms};
use oscura::error::{Error, Result};
use oscura::output::is_same_target;
use oscura::render::CancelHandle;
use std::path::{Path, PathBuf};

/// What stands for a scene's name in names of files.
const STEMS: [&str; 2] = ["{stem}", "{name}"];

/// Renders all scenes. Those that fail are told at the end, and the worst decides the exit code.
pub(crate) fn run(args: &RenderArgs) -> Result<Outcome> {
    let shots: Vec<RenderArgs> = args.scenes.iter().map(|scene| of_scene(args, scene)).collect();
    check(&shots)?;
    show::check(args)?;
    let cancel = cancel_by_signals()?;
    match &shots[..] {
        [only] => render::run(only, &cancel),
        _ => all(args, &shots, &cancel),
    }
}

/// The arguments about one of the scenes.
fn of_scene(args: &RenderArgs, scene: &Path) -> RenderArgs {
    let stem = scene.file_stem().unwrap_or_default().to_string_lossy();
    let has_stem = |path: &PathBuf| STEMS.iter().any(|mark| path.to_string_lossy().contains(mark));
    let named = |path: &PathBuf| match has_stem(path) {
        true => PathBuf::from(
            STEMS.iter().fold(path.to_string_lossy().into_owned(), |name, mark| name.replace(mark, &stem)),
        ),
        false => path.clone(),
    };
    let mut own = args.clone();
    own.scene = scene.to_path_buf();
    own.output = args.output.iter().map(named).collect();
    own.long.checkpoint = args.long.checkpoint.as_ref().map(named);
    own
}

/// Can all files be written, and do several scenes write different ones?
fn check(shots: &[RenderArgs]) -> Result<()> {
    for shot in shots.iter().filter(|shot| shot.frames.is_none() && shot.orbit.is_none()) {
        Targets::check(&shot.output)?;
    }
    for (at, shot) in shots.iter().enumerate() {
        for earlier in &shots[..at] {
            let files = |args: &RenderArgs| -> Vec<PathBuf> {
                args.output.iter().chain(&args.long.checkpoint).cloned().collect()
            };
            let theirs = files(earlier);
            let same =
                files(shot).into_iter().find(|own| theirs.iter().any(|file| is_same_target(own, file)));
            if let Some(file) = same {
                let (a, b) = (earlier.scene.display(), shot.scene.display());
                let message = format!("{a} and {b} would both write {}", file.display());
                return Err(Error::usage(message)
                    .with_help("put {stem} into the names of files, such as -o '{stem}.exr'"));
            }
        }
    }
    Ok(())
}

fn all(args: &RenderArgs, shots: &[RenderArgs], cancel: &CancelHandle) -> Result<Outcome> {
    let mut failures: Vec<(&Path, u8)> = Vec::new();
    for shot in shots {
        if !args.quiet {
            say!("scene    {}", shot.scene.display());
        }
        match render::run(shot, cancel) {
            Ok(Outcome::Interrupted) => return Ok(Outcome::Interrupted),
            Ok(Outcome::Failed(code)) => failures.push((&shot.scene, code)),
            Ok(_) => {}
            Err(error) => {
                let error = terms::in_error(error);
                let code = exit_code(&error);
                report::error(&error);
                if args.json {
                    json::print(&report_json::of_error(&error, code));
                }
                failures.push((&shot.scene, code));
            }
        }
        if cancel.is_cancelled() {
            return Ok(Outcome::Interrupted);
        }
    }
    let Some(worst) = failures.iter().map(|(_, code)| *code).max() else { return Ok(Outcome::Done) };
    say!("{} of {} scenes failed:", failures.len(), shots.len());
    failures.iter().for_each(|(scene, code)| say!("  {} (exit code {code})", scene.display()));
    Ok(Outcome::Failed(worst))
}
