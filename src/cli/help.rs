//! `oscura help`: of commands from their arguments, of scene files from the documentation of the parser; completions
//! and manual pages.

use super::Outcome;
use super::args::{CompletionsArgs, HelpArgs, ManArgs};
use super::command_line::Arguments;
use super::markdown;
use super::report::print_text;
use clap::ValueEnum;
use oscura::error::{Error, Result};
use oscura::load::scene_file::reference::{CHAPTERS, Chapter};

/// The topic that shows all chapters.
const WHOLE: &str = "scene-file";

/// Prints the help of a command or topic.
pub(crate) fn run(args: &HelpArgs) -> Result<Outcome> {
    let mut command = Arguments::whole();
    let text = match args.topic.as_deref() {
        None => command.render_long_help().to_string() + &topics(),
        Some(WHOLE) => CHAPTERS.iter().map(shown).collect::<Vec<_>>().join("\n"),
        Some(topic) => match (Chapter::find(meant(topic)), subcommand(&command, topic)) {
            // A command and what scene files say about it.
            (Some(chapter), Some(mut found)) => format!("{}\n{}", found.render_long_help(), shown(chapter)),
            (None, Some(mut found)) => found.render_long_help().to_string(),
            (Some(chapter), None) => shown(chapter),
            (None, None) => return Err(unknown(topic, &command)),
        },
    };
    print_text(&text);
    Ok(Outcome::Done)
}

/// The topic that another word stands for.
fn meant(word: &str) -> &str {
    match word {
        "pbr" | "material" | "metal" | "metals" | "glass" | "displacement" | "priority" => "materials",
        "fog" | "subsurface" | "medium" | "volume" | "volumes" | "grid" => "media",
        "light" | "lamp" | "lamps" | "sun" => "lights",
        "object" | "mesh" | "shapes" => "objects",
        "subdivide" | "catmull-clark" => "subdivision",
        "texture" | "spectrum" | "spectra" => "textures",
        "settings" => "render",
        "sky" => "environment",
        _ => word,
    }
}

fn shown(chapter: &Chapter) -> String {
    format!("{}\n\n{}", chapter.title, markdown::to_text(&chapter.markdown()))
}

fn topics() -> String {
    let names: Vec<&str> = CHAPTERS.iter().skip(1).map(Chapter::name).collect();
    format!("\n\nTopics of 'oscura help': {WHOLE} (all of it), {}\n", names.join(", "))
}

fn unknown(topic: &str, command: &clap::Command) -> Error {
    let commands: Vec<&str> = command.get_subcommands().map(clap::Command::get_name).collect();
    let names: Vec<&str> = CHAPTERS.iter().skip(1).map(Chapter::name).collect();
    let help = format!("commands: {}; topics: {WHOLE}, {}", commands.join(", "), names.join(", "));
    Error::usage(format!("there is no help on '{topic}'")).with_help(help)
}

/// A command by name, called in usage lines as users call it.
fn subcommand(command: &clap::Command, name: &str) -> Option<clap::Command> {
    let found = command.get_subcommands().find(|c| c.get_name() == name)?.clone();
    Some(found.bin_name(format!("oscura {name}")).display_name(format!("oscura-{name}")))
}

/// Prints the completions of a shell.
pub(crate) fn completions(args: &CompletionsArgs) -> Result<Outcome> {
    let mut bytes = Vec::new();
    let name = args.shell.to_possible_value().map_or_else(String::new, |v| v.get_name().to_string());
    let shell = name.parse::<clap_complete::Shell>().map_err(Error::usage)?;
    clap_complete::generate(shell, &mut Arguments::whole(), "oscura", &mut bytes);
    print_text(&String::from_utf8_lossy(&bytes));
    Ok(Outcome::Done)
}

/// Prints a manual page: of the program or of a command.
pub(crate) fn man(args: &ManArgs) -> Result<Outcome> {
    let command = Arguments::whole();
    let page = match args.command.as_deref() {
        None => command,
        Some(name) => subcommand(&command, name).ok_or_else(|| unknown(name, &command))?,
    };
    let mut bytes = Vec::new();
    clap_mangen::Man::new(page).render(&mut bytes).map_err(|e| Error::usage(e.to_string()))?;
    print_text(&String::from_utf8_lossy(&bytes));
    Ok(Outcome::Done)
}
