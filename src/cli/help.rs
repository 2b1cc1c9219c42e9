//! `oscura help`: commands and options from their declarations, topics from the headings of options, scene files from the
//! parser's documentation; shell completions and manual pages.

use super::args::{CompletionsArgs, HelpArgs, ManArgs};
use super::command_line::Arguments;
use super::option_groups::GROUPS;
use super::process::Outcome;
use super::report::print_text;
use clap::{Arg, ValueEnum};
use oscura::error::{Error, Result};
use oscura::film::Aov;
use oscura::load::scene_file::{CHAPTERS, Chapter};
use std::fmt::Write;
use strsim::levenshtein;
use textwrap::{Options, WordSplitter, fill, wrap};

/// The topic with all chapters of the scene file reference.
const ALL_CHAPTERS: &str = "scene-file";

/// Prints the help of a command or topic.
pub(crate) fn run(args: &HelpArgs) -> Result<Outcome> {
    let mut command = Arguments::full_command();
    let topic = args.topic.join(" ");
    let text = match Some(topic.as_str()).filter(|topic| !topic.is_empty()) {
        None => command.render_long_help().to_string() + &topics(),
        Some(topic) => match help_on(topic, &command) {
            Some(text) => text,
            None => {
                let near = nearest(topic, &command).ok_or_else(|| unknown(topic, &command))?;
                let text = help_on(&near, &command).ok_or_else(|| unknown(topic, &command))?;
                format!("There is no help on '{topic}'; this is on '{near}':\n\n{text}")
            }
        },
    };
    print_text(&text);
    Ok(Outcome::Done)
}

/// Help on a word: a command, a chapter of scene files, a heading of options, an AOV, an option, or options with the word in
/// their help.
fn help_on(word: &str, command: &clap::Command) -> Option<String> {
    let word = word.trim_start_matches('-').to_lowercase().replace(['_', ' '], "-");
    if spellings(&word).iter().any(|word| word == ALL_CHAPTERS || word == "toml") {
        return Some(CHAPTERS.iter().map(chapter_text).collect::<Vec<_>>().join("\n"));
    }
    let spellings = spellings(&word);
    let named = spellings.iter().find_map(|word| subcommand(command, command_synonym(word)));
    let chapter = spellings.iter().find_map(|word| Chapter::find(chapter_synonym(word)));
    let heading = spellings.iter().find_map(|word| heading(word));
    let heading_help =
        heading.and_then(|heading| options(command, |arg| arg.get_help_heading() == Some(heading)));
    let plain = spellings.iter().find_map(|word| general_topic(word));
    let command_help = named.map(|mut found| found.render_long_help().to_string());
    let parts = [plain.map(wrapped), command_help, chapter.map(chapter_text), heading_help];
    if parts.iter().any(Option::is_some) {
        return Some(parts.into_iter().flatten().collect::<Vec<_>>().join("\n"));
    }
    let has_name =
        |arg: &Arg| arg.get_long_and_visible_aliases().is_some_and(|names| names.contains(&&*word));
    let pass = spellings.iter().find_map(|word| Aov::from_option(&word.replace('-', "_"))).map(pass_help);
    if let Some(pass) = pass {
        return Some(pass + &options(command, has_name).unwrap_or_default());
    }
    options(command, has_name).or_else(|| {
        let is_about = |arg: &Arg| {
            let help = arg.get_long_help().or_else(|| arg.get_help());
            help.is_some_and(|help| help.to_string().to_lowercase().replace(' ', "-").contains(&word))
        };
        options(command, is_about).filter(|_| word.len() > 2)
    })
}

/// The word, its singular and its plural.
fn spellings(word: &str) -> Vec<String> {
    let ends = ["s", "es"].iter().filter_map(|end| word.strip_suffix(end));
    let spellings = std::iter::once(word).chain(ends).map(str::to_string);
    spellings.chain([format!("{word}s")]).collect()
}

/// Synonyms of chapters. Words such as "meshe" are plurals without their s (see [`spellings`]).
fn chapter_synonym(word: &str) -> &str {
    match word {
        "pbr" | "material" | "metal" | "glass" | "displacement" | "priority" | "bsdf" | "shader" => {
            "materials"
        }
        "fog" | "subsurface" | "sss" | "skin" | "medium" | "volume" | "volumetric" | "grid" | "smoke"
        | "cloud" => "media",
        "light" | "lamp" | "sun" | "spot" => "lights",
        "object" | "mesh" | "meshe" | "shape" | "instance" | "sphere" => "objects",
        "subdivide" | "catmull-clark" => "subdivision",
        "texture" | "spectrum" | "spectra" | "image-texture" => "textures",
        "setting" => "render",
        "sky" | "hdri" | "world" | "background" => "environment",
        "lens" | "dof" | "depth-of-field" | "bokeh" | "panorama" => "camera",
        "hair" | "fur" | "strand" | "curve" => "curves",
        "transformation" | "rotate" | "scale" => "transform",
        _ => word,
    }
}

/// The option heading for a word or its synonyms.
fn heading(word: &str) -> Option<&'static str> {
    let word = match word {
        "size" | "resolution" | "exposure" | "tone-mapping" | "tonemap" | "color" | "colour" | "alpha" => {
            "image"
        }
        "video" | "gif" | "turntable" | "sequence" | "motion-blur" | "frame" => "animation",
        "hdri" | "environment" | "stage" => "light",
        "gltf" | "glb" | "obj" | "ply" | "stl" | "3mf" | "scan" | "asset" => "model",
        "blender" | "blend" | "bpy" => "blender files",
        "noise" | "sampling" | "quality" | "sample" | "firefly" | "fireflie" => "sampling and quality",
        "aov" | "pass" | "layer" | "channel" | "cryptomatte" | "nuke" | "natron" | "fusion"
        | "compositing" | "comp" => "passes",
        "denoiser" | "oidn" | "denoise" => "denoising",
        "checkpoint" | "farm" | "time" | "interruption" | "part" | "tile" => "long renders",
        "exr" | "png" | "format" | "file" => "output",
        other => other,
    };
    GROUPS.iter().map(|(heading, _)| *heading).find(|heading| as_topic(heading) == as_topic(word))
}

/// A heading as a topic name: lower case, with hyphens.
fn as_topic(heading: &str) -> String {
    heading.to_lowercase().replace(' ', "-")
}

fn command_synonym(word: &str) -> &str {
    match word {
        "watch" | "live" | "page" | "viewer" | "browser" => "view",
        "thumbnail" => "thumb",
        "part" => "merge",
        _ => word,
    }
}

/// General topics: names and text.
const GENERAL: [(&[&str], &str); 5] = [
    (
        &["exit-codes", "exit", "code", "error", "status"],
        "Exit codes: 0 done, 1 compare found disagreement, 2 usage (invalid options), 3 bad input (nothing is \
         written), 4 output failed, 130 interrupted by a signal. For several scenes in one command, the highest. With --json \
         errors are also printed as a JSON object on standard output.",
    ),
    (
        &["signals", "ctrl-c", "interrupt", "sigterm", "stop", "kill"],
        "Ctrl-C (SIGINT), SIGTERM and SIGHUP stop rendering; the picture with the samples so far is written, and the exit \
         code is 130. While some pixels have no sample yet, an existing file is kept; in a new one they are black. Signals \
         within a second of the first are ignored; a later one ends the program at once. --checkpoint FILE with \
         --resume continues later, with the same result, bit for bit.",
    ),
    (
        &["standard-output", "stdout", "pipe", "stdin", "standard-input"],
        "-o - writes a PNG to standard output, -o exr:- an EXR (also jpg:-, tif:-, webp:-, hdr:-). Progress, notes, warnings and \
         the report go to standard error; -q prints errors only. Scenes can't be read from standard input, since their \
         images lie next to the file.",
    ),
    (
        &["library", "python", "numpy", "rust", "crate", "api"],
        "oscura is also a library: for Rust the crate of the same name (Renderer::new(oscura::load(\"scene.glb\")?); cargo doc \
         --open), for Python a module that renders to numpy arrays (oscura.render(oscura.load(\"scene.glb\")); pip install \
         ./tools/python in the sources).",
    ),
    (
        &["gpu", "cuda", "optix", "cpu"],
        "oscura renders on the CPU with all cores (--threads N); it doesn't use the GPU.",
    ),
];

fn general_topic(word: &str) -> Option<&'static str> {
    GENERAL.iter().find(|(names, _)| names.contains(&word)).map(|(_, text)| *text)
}

fn wrapped(text: &str) -> String {
    fill(text, lines_of(WIDTH)) + "\n"
}

/// Help on an AOV: option, description and EXR channels.
fn pass_help(aov: Aov) -> String {
    let info = aov.info();
    wrapped(&format!("--aov {}: {}; EXR channels {}.", info.option, info.about, info.names.join(", "))) + "\n"
}

/// The help of the selected options of `render`; `None` if there are none.
fn options(command: &clap::Command, is_selected: impl Fn(&Arg) -> bool) -> Option<String> {
    let render = subcommand(command, "render")?;
    let is_shown = |arg: &Arg| !arg.is_positional() && !arg.is_hide_set() && is_selected(arg);
    render.get_arguments().find(|arg| is_shown(arg))?;
    let only = render.mut_args(|arg| {
        let is_hidden = !is_shown(&arg);
        arg.hide(is_hidden)
    });
    let text = only.help_template("{all-args}").after_help("").after_long_help("").render_long_help();
    Some(format!("Options of 'oscura render'\n\n{text}\n"))
}

fn chapter_text(chapter: &Chapter) -> String {
    format!("{}\n\n{}", chapter.title, markdown_to_text(&chapter.markdown()))
}

/// Names of all topics other than commands.
fn topic_names() -> Vec<String> {
    let chapters = CHAPTERS.iter().skip(1).map(|chapter| chapter.name().to_string());
    let headings = GROUPS.iter().map(|(heading, _)| as_topic(heading)).filter(|h| h != "help");
    let headings = headings.chain(GENERAL.iter().map(|(names, _)| names[0].to_string()));
    let mut names: Vec<String> = chapters.collect();
    for heading in headings {
        if !names.contains(&heading) {
            names.push(heading);
        }
    }
    names
}

fn topics() -> String {
    format!("\n\nTopics of 'oscura help': {ALL_CHAPTERS} (all of it), {}\n", topic_names().join(", "))
}

fn unknown(topic: &str, command: &clap::Command) -> Error {
    let commands: Vec<&str> = command.get_subcommands().map(clap::Command::get_name).collect();
    let help =
        format!("commands: {}; topics: {ALL_CHAPTERS}, {}", commands.join(", "), topic_names().join(", "));
    Error::usage(format!("there is no help on '{topic}'")).with_help(help)
}

/// The nearest command, topic or option by edit distance, at most 2.
fn nearest(word: &str, command: &clap::Command) -> Option<String> {
    const MAX: usize = 2;
    let word = word.trim_start_matches('-').to_lowercase();
    let mut names: Vec<String> = command.get_subcommands().map(|c| c.get_name().to_string()).collect();
    names.extend(topic_names());
    let render = subcommand(command, "render")?;
    names.extend(render.get_arguments().filter_map(|arg| arg.get_long().map(str::to_string)));
    let distance = |name: &String| levenshtein(&word, name);
    names.into_iter().filter(|name| distance(name) <= MAX.min(word.len() / 3)).min_by_key(distance)
}

/// A subcommand by name, with `oscura NAME` in usage lines.
fn subcommand(command: &clap::Command, name: &str) -> Option<clap::Command> {
    let found = command.get_subcommands().find(|c| c.get_name() == name)?.clone();
    Some(found.bin_name(format!("oscura {name}")).display_name(format!("oscura-{name}")))
}

/// Prints the completions of a shell.
pub(crate) fn completions(args: &CompletionsArgs) -> Result<Outcome> {
    let mut bytes = Vec::new();
    let name = args.shell.to_possible_value().map_or_else(String::new, |v| v.get_name().to_string());
    let shell = name.parse::<clap_complete::Shell>().map_err(Error::usage)?;
    clap_complete::generate(shell, &mut Arguments::full_command(), "oscura", &mut bytes);
    print_text(&String::from_utf8_lossy(&bytes));
    Ok(Outcome::Done)
}

/// Prints a manual page: of the program or of a command.
pub(crate) fn man(args: &ManArgs) -> Result<Outcome> {
    let command = Arguments::full_command();
    let page = match args.command.as_deref() {
        None => command,
        Some(name) => subcommand(&command, name).ok_or_else(|| unknown(name, &command))?,
    };
    let mut bytes = Vec::new();
    clap_mangen::Man::new(page).render(&mut bytes).map_err(|e| Error::usage(e.to_string()))?;
    print_text(&String::from_utf8_lossy(&bytes));
    Ok(Outcome::Done)
}

/// Line width of help texts, characters.
const WIDTH: usize = 100;
/// Minimum width of a table column, characters.
const MIN_COLUMN_WIDTH: usize = 12;
/// Gap between table columns, characters.
const GAP: usize = 2;

/// Markdown as plain text for terminals: aligned table columns, no code marks, links as their text.
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

/// Removes code marks and link targets.
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

/// Wrapping options for lines of at most `columns` characters; longer words are not broken.
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
    // Shrink the widest columns.
    while widths.iter().sum::<usize>() + GAP * columns > WIDTH {
        let Some(widest) = (0..columns).max_by_key(|&c| widths[c]).filter(|&c| widths[c] > MIN_COLUMN_WIDTH)
        else {
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
    fn plurals_synonyms_and_misspellings_are_found() {
        let command = Arguments::full_command();
        for word in [
            "Cameras",
            "lenses",
            "lamps",
            "medium",
            "textures",
            "noise",
            "denoising",
            "aovs",
            "passes",
            "gltf",
            "--spp",
            "ENV",
            "resolution",
            "exr",
            "blender",
            "turntables",
            "glasses",
            "meshes",
            "firefly",
            "long renders",
            "long-renders",
            "scene-files",
            "sampling and quality",
            "Exit codes",
            "exit",
            "signals",
            "pipes",
            "gpu",
            "live",
            "thumbnails",
            "sss",
            "parts",
        ] {
            assert!(help_on(word, &command).is_some(), "{word}");
        }
        assert!(help_on("xyzzy", &command).is_none());
        let depth = help_on("depth", &command).expect("a pass and an option");
        assert!(depth.contains("--aov depth") && depth.contains("bounces of a path"), "{depth}");
        for name in topic_names() {
            assert!(help_on(&name, &command).is_some(), "{name}");
        }
        assert_eq!(nearest("matirials", &command).as_deref(), Some("materials"));
        assert_eq!(nearest("denoze", &command).as_deref(), Some("denoise"));
        assert_eq!(nearest("xyzzy", &command), None);
        assert_eq!([levenshtein("kitten", "sitting"), levenshtein("", "ab")], [3, 2]);
    }

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
    fn paragraphs_are_filled_and_marks_removed() {
        let text = markdown_to_text("One\ntwo `three` [four](five).\n\n## Six\n- seven\n- eight");
        assert_eq!(text, "One two three four.\n\nSix\n- seven\n- eight\n");
        let long = markdown_to_text(&format!("- {}", "word ".repeat(30)));
        assert_eq!(long.lines().map(str::len).collect::<Vec<_>>(), [96, 56], "{long}");
    }
}
