//! The whole command line: which commands there are, and how they are read.

use super::args::{
    CacheArgs, CompareArgs, CompletionsArgs, ExportArgs, HelpArgs, InspectArgs, ManArgs, NewArgs, RenderArgs,
};
use super::merge_args::MergeArgs;
use super::picture_args::{ConvertArgs, DenoiseArgs, InfoArgs};
use super::thumb_args::{ThumbArgs, ThumbnailerArgs};
use super::view::{self, ViewArgs};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use std::ffi::OsString;
use std::sync::{Mutex, PoisonError};

const AFTER: &str = "Exit codes: 0 done, 1 compare found disagreement, 2 usage, 3 bad input, 4 output failed, \
130 interrupted. A setting comes from the command line, else from the scene file, else from its default. 'oscura help \
scene-file' explains scene files; NO_COLOR turns colours off.";

/// An offline path tracer: glTF, OBJ, PLY, Blender and scene files in, EXR and PNG out.
#[derive(Debug, Parser)]
#[command(name = "oscura", version, after_help = AFTER, disable_help_subcommand = true)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub command: Command,
}

/// The command line that was read last: a process may run the program several times (Python).
static WORDS: Mutex<Vec<OsString>> = Mutex::new(Vec::new());

/// The words of the command line behind the program's name.
pub(crate) fn words() -> impl Iterator<Item = OsString> {
    WORDS.lock().unwrap_or_else(PoisonError::into_inner).clone().into_iter().skip(1)
}

impl Arguments {
    /// The whole command line.
    pub fn whole() -> clap::Command {
        // What looks like a negative number is a value of the option before it, which says what is wrong with it.
        let takes_numbers = |command: clap::Command| {
            command.mut_args(|arg| {
                let has_value = !arg.is_positional() && arg.get_action().takes_values();
                arg.allow_negative_numbers(has_value)
            })
        };
        Arguments::command().mut_subcommands(takes_numbers).mut_subcommand("view", view::adapt)
    }

    /// Reads a command line, the first word of which is the program's name.
    ///
    /// # Errors
    /// What clap objects to, and questions for help.
    pub fn read(words: impl Iterator<Item = OsString>) -> Result<Arguments, clap::Error> {
        let mut command = Arguments::whole();
        let words: Vec<OsString> = words.collect();
        WORDS.lock().unwrap_or_else(PoisonError::into_inner).clone_from(&words);
        let matches = command.try_get_matches_from_mut(words)?;
        if let Some(("view", matches)) = matches.subcommand() {
            view::refuse_unused(&mut command, matches)?;
        }
        Arguments::from_arg_matches(&matches)
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Render a scene to EXR and PNG files.
    Render(Box<RenderArgs>),
    /// Put a picture together from parts.
    Merge(MergeArgs),
    /// Say what is in a scene and what would not be rendered.
    Inspect(InspectArgs),
    /// Export a Blender file as .glb with an .oscura.toml of what glTF can't carry.
    Export(ExportArgs),
    /// Measure how far a picture is from a reference.
    Compare(CompareArgs),
    /// Take the noise out of a picture.
    Denoise(DenoiseArgs),
    /// Make a picture to look at of an EXR or of one of its layers.
    Convert(ConvertArgs),
    /// Say what is in an EXR: channels, their ranges, what is not a number, the header.
    Info(InfoArgs),
    /// Show a scene in the browser while it renders, and turn it.
    View(Box<ViewArgs>),
    /// Write small pictures of many models.
    Thumb(ThumbArgs),
    /// Let file managers show small pictures of models (freedesktop.org: Linux and other free systems).
    InstallThumbnailer(ThumbnailerArgs),
    /// Write a commented scene file to start from.
    New(NewArgs),
    /// Say what is kept of Blender files for the next time, or delete it.
    Cache(CacheArgs),
    /// Explain a command, scene files (scene-file), or a part of them (materials, camera, ...).
    Help(HelpArgs),
    /// Print completions for a shell.
    Completions(CompletionsArgs),
    /// Print the manual page of the program or of a command.
    Man(ManArgs),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_command_line_is_its_own() {
        for name in ["a.obj", "b.obj"] {
            let words = ["oscura", "thumb", name].map(OsString::from);
            let arguments = Arguments::read(words.into_iter()).expect("a command");
            assert!(
                matches!(arguments.command, Command::Thumb(thumb) if thumb.models == [std::path::PathBuf::from(name)])
            );
        }
    }
}
