//! The command-line program. Only this module prints: messages to standard error, results (`--json`, `compare`, `inspect`) to
//! standard output.

use command_line::{Arguments, Command};
use oscura::error::Error;
use process::{Outcome, exit_code};
use std::ffi::OsString;

/// Prints a line on standard error; ignores a closed pipe.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}

mod args;
mod camera_args;
mod checkpoint;
mod command_line;
mod compare;
mod convert;
mod denoise;
mod help;
mod info;
mod inspect;
mod json;
mod merge;
mod new_scene;
mod option_groups;
mod other_names;
mod page;
mod parsers;
mod picture_args;
mod pictures;
mod pixels;
mod preview;
mod process;
mod progress;
mod render;
mod rendered_picture;
mod report;
mod scene_args;
mod settings;
mod show;
mod thumbnail;
mod toml_names;
mod view;

/// Runs the program; the first argument is its name. Returns the exit code: 0 done, 1 pictures disagree, 2 usage, 3 bad
/// input, 4 output failed, 130 interrupted.
pub fn main(arguments: impl Iterator<Item = OsString>) -> u8 {
    let words: Vec<OsString> = arguments.collect();
    let wants_json = words.iter().take_while(|word| *word != "--").any(|word| word == "--json");
    let arguments = match Arguments::read(words.into_iter()) {
        Ok(arguments) => arguments,
        Err(error) => return print_clap_error(error, wants_json),
    };
    report::code_with_stdout(run(arguments))
}

/// Runs a command and returns the exit code.
fn run(arguments: Arguments) -> u8 {
    let (json, result) = match arguments.command {
        Command::Render(a) => (a.json, render::run(&a)),
        Command::Merge(a) => (a.json, merge::run(&a)),
        Command::Inspect(a) => (a.json, inspect::run(&a)),
        Command::Export(a) => (false, new_scene::export_blender_file(&a)),
        Command::Compare(a) => (a.json, compare::run(&a)),
        Command::View(a) => (false, view::run(&a)),
        Command::Denoise(a) => (false, denoise::run(&a)),
        Command::Convert(a) => (false, convert::run(&a)),
        Command::Info(a) => (a.json, info::run(&a)),
        Command::Thumb(a) => (false, thumbnail::run(&a)),
        Command::InstallThumbnailer(a) => (false, thumbnail::install(&a)),
        Command::New(a) => (false, new_scene::run(&a)),
        Command::Cache(a) => (false, new_scene::run_cache(&a)),
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
            let error = report::name_options_in_error(error);
            report::error(&error);
            let code = exit_code(&error);
            if json {
                json::print(&json::of_error(&error, code));
            }
            code
        }
    }
}

/// Prints clap's error, help or version. Returns the exit code.
fn print_clap_error(error: clap::Error, wants_json: bool) -> u8 {
    if let Some(table) = parsers::aov_table_requested(&error) {
        report::print_text(table);
        return 0;
    }
    // A closed pipe doesn't change the exit code.
    let _ = error.print();
    let code = u8::try_from(error.exit_code()).unwrap_or(2);
    if wants_json && error.use_stderr() {
        // The other lines are tips and usage.
        let text = error.to_string();
        let message = text.lines().next().unwrap_or_default();
        let error = Error::usage(message.strip_prefix("error: ").unwrap_or(message));
        json::print(&json::of_error(&error, code));
    }
    code
}
