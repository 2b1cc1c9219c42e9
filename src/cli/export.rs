//! `oscura export`: a Blender file as a folder of files that other programs read, too.

use super::args::{CacheArgs, ExportArgs};
use super::process::Outcome;
use super::report::{PrintedMessages, print_line};
use super::scene_args::check_scene_path;
use oscura::error::{Error, ErrorKind, Problem, Result};
use oscura::load::blender::{BlenderOptions, default_cache, export};
use oscura::load::blender::{clear, kept};
use oscura::load::gltf::GltfOptions;
use oscura::load::{LoadOptions, is_of_blender};
use oscura::output::{check_folder, move_folder};
use std::path::Path;

pub(crate) fn run(args: &ExportArgs) -> Result<Outcome> {
    if !is_of_blender(&args.scene) {
        let message = format!("{} is not a .blend file, and only those are exported", args.scene.display());
        return Err(Error::usage(message));
    }
    check_scene_path(&args.scene)?;
    check_folder(&args.output, args.force).map_err(|error| match error.kind {
        ErrorKind::Usage => error.with_help("choose another name, or replace its files by --force"),
        _ => error,
    })?;
    let options = LoadOptions {
        blender: BlenderOptions { frame: args.frame, ..args.blender.options() },
        gltf: GltfOptions { scene: args.scene_name.clone(), ..GltfOptions::default() },
        ..LoadOptions::default()
    };
    // On the disk of the folder, so that the export appears there as a whole.
    let parent = args.output.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let exported = export(&args.scene, &options, parent)?;
    if !args.quiet {
        let mut printed = PrintedMessages::default();
        printed.notes(&exported.notes);
        printed.warnings(&exported.warnings);
    }
    if args.strict && !exported.warnings.is_empty() {
        let problems = exported.warnings.iter().map(|w| Problem::new("", w.to_string())).collect();
        let file = Some(args.scene.clone());
        let error = Error { kind: ErrorKind::Input, file, problems, source_text: None };
        return Err(error.with_help("--strict makes warnings errors"));
    }
    let names = move_folder(&exported.folder, &args.output)?;
    if !args.quiet {
        for name in names {
            say!("wrote    {}", args.output.join(name).display());
        }
    }
    Ok(Outcome::Done)
}

// `oscura cache`: what is kept of Blender files for the next time.

pub(crate) fn run_cache(args: &CacheArgs) -> Result<Outcome> {
    let Some(folder) = args.folder.clone().or_else(default_cache) else {
        let error = Error::usage("this system names no folder for caches: nothing is kept");
        return Err(error.with_help("name a folder by --cache"));
    };
    let (found, verb) = match args.clear {
        true => (clear(&folder)?, "deleted"),
        false => (kept(&folder)?, "kept"),
    };
    let mib = found.bytes as f64 / f64::from(1 << 20);
    print_line(&format!("{}: {} files of {mib:.1} MiB {verb}", folder.display(), found.files));
    Ok(Outcome::Done)
}
