//! The command line: arguments become options, options run. The only place that prints. Reports go to standard error;
//! standard output is for what `--json` and `compare` and `inspect` answer.

/// Prints a line on standard error. Nobody listening any more is no reason to stop.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}

mod alike;
mod aov_arg;
mod args;
mod asset_args;
mod batch;
mod beside;
mod blender_args;
mod cache;
mod camera_args;
mod checkpoint;
mod command_line;
mod compare;
mod convert;
mod denoise;
mod denoiser_args;
mod denoising;
mod environment;
mod excerpt;
mod export;
mod exr_args;
mod frames;
mod glyphs;
mod guiding_args;
mod help;
mod idle;
mod info;
mod inspect;
mod json;
mod limits;
mod long_args;
mod markdown;
mod merge;
mod merge_args;
mod moving;
mod named;
mod new;
mod numbers;
mod of_scene;
mod orbit;
mod outcome;
mod page;
mod picture_args;
mod pictures;
mod prepared;
mod preview;
mod preview_arg;
mod process;
mod progress;
mod rec709;
mod render;
mod report;
mod report_json;
mod scene_path;
mod settings;
mod shapes;
mod sheet;
mod shot;
mod show;
mod show_arg;
mod shutter_args;
mod stage_args;
mod terms;
mod tev;
mod thumb;
mod thumb_args;
mod thumbnailer;
mod view;
mod waiting;

use command_line::{Arguments, Command};
use oscura::error::Error;
use outcome::{Outcome, exit_code};
use std::ffi::OsString;

/// Runs the program with these arguments, the first of which is its own name. Returns the exit code: 0 done, 1 pictures
/// disagree, 2 usage, 3 bad input, 4 output failed, 130 interrupted.
pub fn main(arguments: impl Iterator<Item = OsString>) -> u8 {
    let words: Vec<OsString> = arguments.collect();
    let wants_json = words.iter().take_while(|word| *word != "--").any(|word| word == "--json");
    let arguments = match Arguments::read(words.into_iter()) {
        Ok(arguments) => arguments,
        Err(error) => return refuse(error, wants_json),
    };
    let (json, result) = match arguments.command {
        Command::Render(a) => (a.json, batch::run(&a)),
        Command::Merge(a) => (a.json, merge::run(&a)),
        Command::Inspect(a) => (a.json, inspect::run(&a)),
        Command::Export(a) => (false, export::run(&a)),
        Command::Compare(a) => (a.json, compare::run(&a)),
        Command::View(a) => (false, view::run(&a)),
        Command::Denoise(a) => (false, denoise::run(&a)),
        Command::Convert(a) => (false, convert::run(&a)),
        Command::Info(a) => (a.json, info::run(&a)),
        Command::Thumb(a) => (false, thumb::run(&a)),
        Command::InstallThumbnailer(a) => (false, thumbnailer::run(&a)),
        Command::New(a) => (false, new::run(&a)),
        Command::Cache(a) => (false, cache::run(&a)),
        Command::Help(a) => (false, help::run(&a)),
        Command::Completions(a) => (false, help::completions(&a)),
        Command::Man(a) => (false, help::man(&a)),
    };
    match result {
        Ok(Outcome::Done) => 0,
        Ok(Outcome::Disagreement) => 1,
        Ok(Outcome::Interrupted) => 130,
        Ok(Outcome::Failed(code)) => code,
        Err(error) => {
            let error = terms::in_error(error);
            report::error(&error);
            let code = exit_code(&error);
            if json {
                json::print(&report_json::of_error(&error, code));
            }
            code
        }
    }
}

/// Says what is wrong with the arguments, or what they ask about the program. Returns the exit code.
fn refuse(error: clap::Error, wants_json: bool) -> u8 {
    if let Some(table) = aov_arg::asked_for(&error) {
        report::print_text(table);
        return 0;
    }
    let error = scene_path::explain(error);
    // Nobody listening is no reason to end otherwise.
    let _ = error.print();
    let code = u8::try_from(error.exit_code()).unwrap_or(2);
    if wants_json && error.use_stderr() {
        // The lines after the first one are about usage.
        let text = error.to_string();
        let message = text.lines().next().unwrap_or_default();
        let error = Error::usage(message.strip_prefix("error: ").unwrap_or(message));
        json::print(&report_json::of_error(&error, code));
    }
    code
}
