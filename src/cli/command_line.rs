//! The whole command line: which commands there are, and how they are read.

use super::args::{
    CacheArgs, CompareArgs, CompletionsArgs, ExportArgs, HelpArgs, InspectArgs, ManArgs, NewArgs, RenderArgs,
};
use super::merge::MergeArgs;
use super::outcome::Outcome;
use super::picture_args::{ConvertArgs, DenoiseArgs, InfoArgs};
use super::process::remember_words;
use super::report::print_text;
use super::thumbnail::{ThumbArgs, ThumbnailerArgs};
use super::view;
use super::view::ViewArgs;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use oscura::error::{Error, Result};
use oscura::load::scene_file::reference::{CHAPTERS, Chapter};
use std::ffi::OsString;
use std::fmt::Write;
use textwrap::{Options, WordSplitter, fill, wrap};

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
    pub fn read(words: impl Iterator<Item = OsString>) -> std::result::Result<Arguments, clap::Error> {
        let mut command = Arguments::whole();
        let words: Vec<OsString> = words.collect();
        remember_words(&words);
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
    /// Merge partial renders (.part files) into one image.
    Merge(MergeArgs),
    /// List a scene's contents, and what would not be rendered.
    Inspect(InspectArgs),
    /// Export a Blender file as .glb, with an .oscura.toml for what glTF cannot represent.
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
    /// Help on a command, on scene files (scene-file), or on a section of them (materials, camera, ...).
    Help(HelpArgs),
    /// Print a shell completion script.
    Completions(CompletionsArgs),
    /// Print the manual page of the program or of a command.
    Man(ManArgs),
}

// `oscura help`: of commands from their arguments, of scene files from the documentation of the parser; completions
// and manual pages.

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
    format!("{}\n\n{}", chapter.title, markdown_to_text(&chapter.markdown()))
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

// Markdown for terminals: tables become aligned columns, marks of code go, links keep their text.

/// Columns of a terminal.
const WIDTH: usize = 100;
/// Narrowest column of a table.
const LEAST: usize = 12;
const GAP: usize = 2;

/// Plain text for a terminal.
pub(crate) fn markdown_to_text(markdown: &str) -> String {
    let mut text = String::new();
    let lines: Vec<&str> = markdown.lines().collect();
    let mut i = 0;
    while i < lines.len() {
        let rest = &lines[i..];
        if rest[0].starts_with('|') {
            let count = rest.iter().take_while(|l| l.starts_with('|')).count();
            table(&mut text, &rest[..count]);
            i += count;
        } else if rest[0].trim().is_empty() {
            text.push('\n');
            i += 1;
        } else if let Some(title) = rest[0].strip_prefix('#') {
            let _ = writeln!(text, "{}", plain(title.trim_start_matches('#').trim()));
            i += 1;
        } else {
            let is_more =
                |l: &&&str| !l.trim().is_empty() && !l.starts_with(['|', '#']) && !l.starts_with("- ");
            let count = 1 + rest[1..].iter().take_while(is_more).count();
            let paragraph = rest[..count].iter().map(|l| l.trim()).collect::<Vec<_>>().join(" ");
            let indent = if paragraph.starts_with("- ") { "  " } else { "" };
            let _ = writeln!(text, "{}", fill(&plain(&paragraph), lines_of(WIDTH).subsequent_indent(indent)));
            i += count;
        }
    }
    text
}

/// Without marks of code and links.
fn plain(text: &str) -> String {
    let mut text = text.replace("\\|", "|").replace('`', "");
    while let Some(start) = text.find("](")
        && let Some(length) = text[start..].find(')')
    {
        text.replace_range(start..=start + length, "");
        if let Some(open) = text[..start].rfind('[') {
            text.remove(open);
        }
    }
    text
}

/// Lines of at most so many columns; a longer word has a line of its own.
fn lines_of(columns: usize) -> Options<'static> {
    Options::new(columns).break_words(false).word_splitter(WordSplitter::NoHyphenation)
}

fn cells(line: &str) -> Vec<String> {
    let inside = line.trim().trim_start_matches('|').trim_end_matches('|');
    inside.split(" | ").map(|c| plain(c.trim())).collect()
}

fn table(text: &mut String, lines: &[&str]) {
    let is_rule = |l: &&&str| l.chars().all(|c| matches!(c, '|' | '-' | ':' | ' '));
    let rows: Vec<Vec<String>> = lines.iter().filter(|l| !is_rule(l)).map(|l| cells(l)).collect();
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let longest = |c: usize| rows.iter().filter_map(|r| r.get(c)).map(|s| s.chars().count()).max();
    let mut widths: Vec<usize> = (0..columns).map(|c| longest(c).unwrap_or(0)).collect();
    // The widest columns give way.
    while widths.iter().sum::<usize>() + GAP * columns > WIDTH {
        let Some(widest) = (0..columns).max_by_key(|&c| widths[c]).filter(|&c| widths[c] > LEAST) else {
            break;
        };
        widths[widest] -= 1;
    }
    for row in &rows {
        let wrapped: Vec<_> = row.iter().zip(&widths).map(|(cell, w)| wrap(cell, lines_of(*w))).collect();
        for i in 0..wrapped.iter().map(Vec::len).max().unwrap_or(0) {
            let mut line = String::new();
            for (cell, width) in wrapped.iter().zip(&widths) {
                let part = cell.get(i).map_or("", |line| line.as_ref());
                let _ = write!(line, "{part:<width$}  ");
            }
            let _ = writeln!(text, "  {}", line.trim_end());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_argument_has_a_help_text() {
        let whole = Arguments::whole();
        for command in whole.get_subcommands() {
            for argument in command.get_arguments().filter(|argument| !argument.is_hide_set()) {
                let help = argument.get_help().map(ToString::to_string).unwrap_or_default();
                assert!(!help.is_empty(), "{} {}", command.get_name(), argument.get_id());
            }
        }
    }

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

#[cfg(test)]
mod markdown_tests {
    use super::*;

    #[test]
    fn tables_align_and_wrap() {
        let long = "word ".repeat(40);
        let text = markdown_to_text(&format!(
            "| Key | Meaning |\n|---|---|\n| `a`, `b` | {long} |\n| `key` | short |"
        ));
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "  Key   Meaning");
        assert!(lines[1].starts_with("  a, b  word word") && lines[2].starts_with("        word"), "{text}");
        assert_eq!(lines.last(), Some(&"  key   short"));
        assert!(lines.iter().all(|l| l.len() <= WIDTH), "{text}");
    }

    #[test]
    fn paragraphs_flow_and_marks_go() {
        let text = markdown_to_text("One\ntwo `three` [four](five).\n\n## Six\n- seven\n- eight");
        assert_eq!(text, "One two three four.\n\nSix\n- seven\n- eight\n");
        let long = markdown_to_text(&format!("- {}", "word ".repeat(30)));
        assert_eq!(long.lines().map(str::len).collect::<Vec<_>>(), [96, 56], "{long}");
    }
}
