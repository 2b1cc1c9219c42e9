//! The commands of the program, and parsing of the command line.

use super::args::{
    CacheArgs, CompareArgs, CompletionsArgs, ExportArgs, HelpArgs, InspectArgs, ManArgs, NewArgs, RenderArgs,
};
use super::merge::MergeArgs;
use super::option_groups::group;
use super::other_names::tip_for;
use super::picture_args::{ConvertArgs, DenoiseArgs, InfoArgs};
use super::process::store_command_line;
use super::scene_args::scenes_named;
use super::thumbnail::{ThumbArgs, ThumbnailerArgs};
use super::view;
use super::view::ViewArgs;
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use std::ffi::OsString;
use std::path::Path;
use strsim::levenshtein;

const EXAMPLES: &str = "Examples:
  oscura scan.ply                renders scan.png
  oscura room.glb -o room.exr    linear radiance for compositing; --aov LIST adds passes
  oscura view room.glb           the live page, in the browser
  oscura new first.toml          a scene file to start from

Exit codes: 0 done, 1 compare found disagreement, 2 usage, 3 bad input, 4 output failed, \
130 interrupted. A setting comes from the command line, else from the scene file, else from its default. 'oscura help \
scene-file' explains scene files; NO_COLOR turns colours off.";

const USAGE: &str = "oscura SCENE... [OPTIONS]   renders SCENE.png, with the options of 'oscura render'
       oscura COMMAND [OPTIONS]";

/// An offline path tracer: glTF, OBJ, PLY, Blender and scene files in, EXR and PNG out.
#[derive(Debug, Parser)]
#[command(name = "oscura", version, after_help = EXAMPLES, override_usage = USAGE, disable_help_subcommand = true)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub command: Command,
}

impl Arguments {
    /// The clap command with all subcommands.
    pub fn full_command() -> clap::Command {
        Arguments::command().mut_subcommands(finish)
    }

    /// Parses a command line; the first word is the program's name.
    ///
    /// # Errors
    /// Errors of clap, and requests for help.
    pub fn read(words: impl Iterator<Item = OsString>) -> Result<Arguments, clap::Error> {
        let command = Arguments::command();
        let words = with_command(words.collect(), &command);
        // Finishing all subcommands takes a millisecond: only the used one is.
        let name = words.get(1).and_then(|word| word.to_str()).and_then(|word| command.find_subcommand(word));
        let mut command = match name.map(|command| command.get_name().to_string()) {
            Some(name) => command.mut_subcommand(name, finish),
            None => command,
        };
        store_command_line(&words);
        let matches =
            command.try_get_matches_from_mut(words).map_err(|error| with_tips(error, &mut command))?;
        if let Some(("view", matches)) = matches.subcommand() {
            view::refuse_unused(&mut command, matches)?;
        }
        let mut arguments = Arguments::from_arg_matches(&matches)?;
        match &mut arguments.command {
            Command::Render(args) => args.resolve_size(),
            Command::View(args) => args.render.resolve_size(),
            _ => {}
        }
        Ok(arguments)
    }
}

/// Adds help headings, `-q` for `--quiet`, and negative numbers as values of all options: the option's own parser reports
/// invalid ones.
fn finish(command: clap::Command) -> clap::Command {
    let command = if command.get_name() == "view" { view::adapt(command) } else { command };
    group(command.mut_args(|arg| {
        let has_value = !arg.is_positional() && arg.get_action().takes_values();
        let arg = arg.allow_negative_numbers(has_value);
        if arg.get_id() == "quiet" { arg.short('q') } else { arg }
    }))
}

/// Inserts the command `render` if the first argument is a file or an option of `render`.
fn with_command(mut words: Vec<OsString>, command: &clap::Command) -> Vec<OsString> {
    const TOP_LEVEL: [&str; 4] = ["-h", "--help", "-V", "--version"];
    let Some(first) = words.get(1) else { return words };
    let text = first.to_string_lossy();
    let is_command = command.get_subcommands().any(|c| c.get_name() == text);
    let is_file = text.contains(['.', '/', '\\']) || Path::new(first).exists();
    let is_option = text.starts_with('-') && !TOP_LEVEL.contains(&&*text);
    if !is_command && (is_file || is_option) {
        words.insert(1, "render".into());
    }
    words
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Render a scene to EXR, PNG and other files; the default command.
    Render(Box<RenderArgs>),
    /// Merge partial renders (.part files) into one image.
    Merge(MergeArgs),
    /// List a scene's contents, and what would not be rendered.
    Inspect(InspectArgs),
    /// Export a Blender file as a scene file (.toml) with its meshes and images.
    Export(ExportArgs),
    /// Compare an image with a reference: error metrics, FLIP, statistical tests.
    Compare(CompareArgs),
    /// Denoise an image.
    Denoise(DenoiseArgs),
    /// Convert an EXR or one of its layers to PNG, JPEG, TIFF, WebP or HDR.
    Convert(ConvertArgs),
    /// Print an EXR's channels, value ranges, NaN counts and header.
    Info(InfoArgs),
    /// Interactive viewer: render a scene in the browser and move its camera.
    View(Box<ViewArgs>),
    /// Render thumbnails of models.
    Thumb(ThumbArgs),
    /// Install a thumbnailer for file managers (freedesktop.org: Linux and BSD).
    InstallThumbnailer(ThumbnailerArgs),
    /// Write a commented scene file to start from.
    New(NewArgs),
    /// Show or clear the cache of exported Blender files.
    Cache(CacheArgs),
    /// Help on a command, an option, a topic such as denoising, scene files (scene-file), or a section of them.
    Help(HelpArgs),
    /// Print a shell completion script.
    Completions(CompletionsArgs),
    /// Print the manual page of the program or of a command.
    Man(ManArgs),
}

/// Adds tips to clap's errors: scenes without extension, options of other commands or programs.
fn with_tips(error: clap::Error, command: &mut clap::Command) -> clap::Error {
    match error.kind() {
        ErrorKind::InvalidSubcommand => with_command_tip(error, command),
        ErrorKind::UnknownArgument => with_option_tip(error, command),
        ErrorKind::InvalidValue => with_view_tip(error),
        _ => error,
    }
}

fn context(error: &clap::Error, kind: ContextKind) -> Option<String> {
    match error.get(kind)? {
        ContextValue::String(text) => Some(text.clone()),
        ContextValue::Strings(texts) => texts.first().cloned(),
        _ => None,
    }
}

/// Tip for a word that is neither a command nor a file: scenes of that name with an extension, or the nearest command.
fn with_command_tip(error: clap::Error, command: &mut clap::Command) -> clap::Error {
    let Some(word) = context(&error, ContextKind::InvalidSubcommand) else { return error };
    let files = scenes_named(&word);
    let near = context(&error, ContextKind::SuggestedSubcommand);
    let tip = match (files.first(), near) {
        (Some(_), _) => format!("\n\n  tip: scenes of that name: {}", files.join(", ")),
        (None, Some(near)) => format!("\n\n  tip: a similar command exists: '{near}'"),
        (None, None) => String::new(),
    };
    command.error(ErrorKind::InvalidSubcommand, format!("'{word}' is neither a command nor a file{tip}"))
}

/// Tip for an unknown option: the equivalent of another renderer's option, `--version` or `--help`, or the commands that have
/// the option. Replaces clap's tip about file names that start with a dash.
fn with_option_tip(mut error: clap::Error, command: &clap::Command) -> clap::Error {
    let Some(option) = context(&error, ContextKind::InvalidArg) else { return error };
    let name = option.trim_start_matches('-');
    error.remove(ContextKind::Suggested);
    let tip = |mut error: clap::Error, text: String| {
        // Clap's usage line shows its own suggestion.
        error.remove(ContextKind::Usage);
        error.remove(ContextKind::SuggestedArg);
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![StyledStr::from(text)]));
        error
    };
    if let Some(known) = tip_for(name) {
        return tip(error, known.to_string());
    }
    if ["version", "help"].iter().any(|own| levenshtein(name, own) <= own.len() / 3) {
        return tip(
            error,
            "'oscura --version' and 'oscura --help' are the program's own options".to_string(),
        );
    }
    let has_option = |command: &&clap::Command| {
        let mut arguments = command.get_arguments().filter(|arg| !arg.is_hide_set());
        arguments.any(|arg| arg.get_long_and_visible_aliases().is_some_and(|names| names.contains(&name)))
    };
    let others: Vec<String> = command
        .get_subcommands()
        .filter(has_option)
        .map(|command| format!("'oscura {}'", command.get_name()))
        .collect();
    if !others.is_empty() {
        return tip(error, format!("'{option}' is an option of {}", others.join(", ")));
    }
    error
}

/// Tip for `--view VALUE` used instead of the command `view`.
fn with_view_tip(mut error: clap::Error) -> clap::Error {
    if context(&error, ContextKind::InvalidArg).is_some_and(|arg| arg.starts_with("--view ")) {
        let tip = StyledStr::from("'oscura view SCENE' shows a scene live in the browser");
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip]));
    }
    error
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_argument_has_a_help_text() {
        let command = Arguments::full_command();
        for command in command.get_subcommands() {
            for argument in command.get_arguments().filter(|argument| !argument.is_hide_set()) {
                let help = argument.get_help().map(ToString::to_string).unwrap_or_default();
                assert!(!help.is_empty(), "{} {}", command.get_name(), argument.get_id());
            }
        }
    }

    #[test]
    fn parsing_has_no_state() {
        for name in ["a.obj", "b.obj"] {
            let words = ["oscura", "thumb", name].map(OsString::from);
            let arguments = Arguments::read(words.into_iter()).expect("a command");
            assert!(
                matches!(arguments.command, Command::Thumb(thumb) if thumb.models == [std::path::PathBuf::from(name)])
            );
        }
    }
}
