//! The arguments of `oscura view`: those of `render`, but for what concerns files that are written.

use crate::cli::args::RenderArgs;
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, value_parser};
use std::path::PathBuf;

/// Arguments of `render` that have no meaning here: they are about files, sequences and reports.
const UNUSED: [&str; 38] = [
    "output",
    "frames",
    "fps",
    "resume",
    "orbit",
    "preview",
    "show",
    "time_limit",
    "save_every",
    "noise",
    "checkpoint",
    "checkpoint_interval",
    "plan",
    "sample_range",
    "region",
    "progress",
    "memory_limit",
    "denoise",
    "denoiser",
    "oidn_library",
    "deep",
    "float",
    "exr_layout",
    "exr_compression",
    "exr_tiles",
    "working_space",
    "exr_half",
    "exr_float",
    "crop",
    "overscan",
    "aov",
    "aov_space",
    "light_groups",
    "crypto_levels",
    "strict",
    "explain",
    "reproducible",
    "json",
];

#[derive(Args, Clone, Debug)]
pub(crate) struct ViewArgs {
    #[command(flatten)]
    pub picture: RenderArgs,
    /// Port of the page, on this machine only [default: a free one].
    #[arg(long, value_name = "N", default_value = "0", hide_default_value = true)]
    pub port: u16,
    /// Don't open a browser: print the page's address only.
    #[arg(long)]
    pub no_open: bool,
    /// Load the scene again when a file of it was saved.
    #[arg(long)]
    pub watch: bool,
}

/// Takes the unused arguments out of the command's help.
pub(crate) fn adapt(command: Command) -> Command {
    let command = command
        .mut_arg("scenes", |arg| arg.num_args(1).help("The scene: .gltf, .glb, .obj, .ply, .toml or .blend"));
    // What `render` requires in the place of something else is required by nothing here.
    let output = Arg::new("output").short('o').long("output").action(ArgAction::Append);
    let command = command.mut_arg("output", |_| output.value_parser(value_parser!(PathBuf)));
    UNUSED.iter().fold(command, |command, id| command.mut_arg(id, |arg| arg.hide(true)))
}

/// Refuses unused arguments that were given.
///
/// # Errors
/// As clap reports unknown arguments.
pub(crate) fn refuse_unused(command: &mut Command, matches: &ArgMatches) -> Result<(), clap::Error> {
    let is_given = |id: &&&str| matches.value_source(id) == Some(ValueSource::CommandLine);
    let Some(id) = UNUSED.iter().find(is_given) else { return Ok(()) };
    let argument = match *id {
        "output" => "-o".to_string(),
        id => format!("--{}", id.replace('_', "-")),
    };
    let message = format!("{argument} has no meaning for what is shown in a browser; 'oscura render' has it");
    Err(command.error(ErrorKind::UnknownArgument, message))
}
