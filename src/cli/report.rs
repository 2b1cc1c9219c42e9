//! Messages to the user: errors, warnings the report at the end, and a note on pictures that are
//! nearly black.

use super::picture_args::Quality;
use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};
use oscura::accel::TreeQuality;
use oscura::color::luminance;
use oscura::compile::CompileReport;
use oscura::error::{Choice, Error, Problem, Warning};
use oscura::film::Film;
use oscura::load::{Loaded, is_named_as_scene};
use oscura::render::Statistics;
use oscura::scene::{Scene, ShapeTag};
use serde::{Serialize, Serializer};
use std::collections::{HashMap, HashSet};
use std::fmt;
use std::io::Write;
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// A problem with its source location, as miette prints it.
#[derive(Debug)]
struct SourceProblem<'a> {
    problem: &'a Problem,
    source: NamedSource<String>,
}

impl fmt::Display for SourceProblem<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.problem.message)
    }
}

impl std::error::Error for SourceProblem<'_> {}

impl Diagnostic for SourceProblem<'_> {
    fn help<'b>(&'b self) -> Option<Box<dyn fmt::Display + 'b>> {
        self.problem.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        Some(&self.source)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let span = self.problem.span.clone()?;
        Some(Box::new(std::iter::once(LabeledSpan::new_with_span(None, span))))
    }
}

/// Prints an error with all its problems, and with source lines where known.
pub(crate) fn error(error: &Error) {
    let file = error.file.as_ref().map(|f| f.display().to_string());
    let count = error.problems.len();
    match &file {
        Some(file) if count > 1 => say!("error: {file}: {count} problems"),
        Some(file) => say!("error: {file}"),
        None if count == 1 => return plain(&error.problems[0], "error: ", "  "),
        None => say!("error:"),
    }
    for line in shortened(&error.problems, |problem| &problem.message) {
        let problem = match line {
            Line::One(problem) => problem,
            Line::More(count) => {
                say!("  ... and {count} more of this kind");
                continue;
            }
        };
        match (&error.source_text, &problem.span) {
            (Some(text), Some(_)) => {
                say!("{}", snippet(problem, text, file.as_deref().unwrap_or("input")))
            }
            _ => plain(problem, "  ", "    "),
        }
    }
}

/// A problem in words alone: its first line after `lead`, what helps after `indent`.
fn plain(problem: &Problem, lead: &str, indent: &str) {
    let place = if problem.place.is_empty() { String::new() } else { format!("{}: ", problem.place) };
    say!("{lead}{place}{}", problem.message);
    if let Some(help) = &problem.help {
        say!("{indent}help: {help}");
    }
}

/// A problem with its source line, or an excerpt of a very long line.
fn snippet(problem: &Problem, text: &str, file: &str) -> String {
    if let Some(excerpt) = problem.span.as_ref().and_then(|span| Excerpt::of_long_line(text, span)) {
        let Excerpt { line, column, shown, marker } = excerpt;
        let mut out = format!("  {} [{file}:{line}:{column}]\n    {shown}\n    {marker}", problem.message);
        if let Some(help) = &problem.help {
            out += &format!("\n    help: {help}");
        }
        return out;
    }
    let handler = miette::GraphicalReportHandler::new_themed(theme());
    let source = NamedSource::new(file, text.to_string());
    let mut out = String::new();
    match handler.render_report(&mut out, &SourceProblem { problem, source }) {
        Ok(()) => out,
        // Span outside of the text: print the message alone.
        Err(_) => format!("  {problem}"),
    }
}

/// Colours on a terminal only, and never against `NO_COLOR` (<https://no-color.org>).
fn theme() -> miette::GraphicalTheme {
    use std::io::IsTerminal;
    let refused = std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty());
    if !refused && std::io::stderr().is_terminal() {
        miette::GraphicalTheme::unicode()
    } else {
        miette::GraphicalTheme::unicode_nocolor()
    }
}

/// Prints a line on standard output. A closed pipe is not an error.
pub(crate) fn print_line(line: &str) {
    note_stdout(writeln!(std::io::stdout(), "{line}"));
}

/// Prints text without adding a line break.
pub(crate) fn print_text(text: &str) {
    note_stdout(std::io::stdout().write_all(text.as_bytes()));
}

/// Writes the bytes of a picture to standard output.
///
/// # Errors
/// An output error, also where nobody reads on: the picture is lost.
pub(crate) fn print_bytes(bytes: &[u8]) -> oscura::error::Result<()> {
    let mut out = std::io::stdout();
    let written = out.write_all(bytes).and_then(|()| out.flush());
    written.map_err(|error| Error::output(Path::new("standard output"), format!("can't be written: {error}")))
}

/// Something that was printed on standard output is lost.
static IS_STDOUT_LOST: AtomicBool = AtomicBool::new(false);

/// Says when standard output can't be written, once. Nobody listening any more is no error.
pub(crate) fn note_stdout(written: std::io::Result<()>) {
    let Err(error) = written else { return };
    if error.kind() != std::io::ErrorKind::BrokenPipe && !IS_STDOUT_LOST.swap(true, Ordering::Relaxed) {
        say!("error: standard output can't be written: {error}");
    }
}

/// The exit code of a run, whose standard output may have failed.
pub(crate) fn code_with_stdout(code: u8) -> u8 {
    // The rest of the buffer.
    note_stdout(std::io::stdout().flush());
    match IS_STDOUT_LOST.load(Ordering::Relaxed) {
        true if code == 0 => 4,
        _ => code,
    }
}

/// Messages printed so far: frames of an animation print only new ones.
#[derive(Default)]
pub(crate) struct PrintedMessages(HashSet<String>);

impl PrintedMessages {
    /// Prints warnings.
    pub fn warnings(&mut self, list: &[Warning]) {
        self.print("warning", list);
    }

    /// Prints notes.
    pub fn notes(&mut self, list: &[Warning]) {
        self.print("note", list);
    }

    fn print(&mut self, kind: &str, list: &[Warning]) {
        let new: Vec<Warning> =
            list.iter().filter(|what| self.0.insert(format!("{kind}: {what}"))).cloned().collect();
        for line in shortened(&new, |what| &what.message) {
            match line {
                Line::One(what) => say!("{kind}: {what}"),
                Line::More(count) => say!("{kind}: ... and {count} more of this kind"),
            }
        }
    }
}

/// Everything about a finished run.
pub(crate) struct Run {
    /// From the start of loading to the end of writing, seconds.
    pub total_s: f64,
    pub load_s: f64,
    pub denoise_s: Option<f64>,
    pub write_s: f64,
    /// Width and height of the picture, pixels.
    pub size: (u32, u32),
    pub seed: u32,
    pub quality: Option<Quality>,
    pub compiled: CompileReport,
    pub statistics: Statistics,
    pub peak_memory: Option<u64>,
    pub outputs: Vec<String>,
    pub notes: Vec<Warning>,
    pub warnings: Vec<Warning>,
    pub left_out: Vec<String>,
}

impl Run {
    /// The parts of memory that are at least a fiftieth of the peak, the largest first.
    fn memory_by_part(&self, peak: u64) -> String {
        let mut parts: Vec<_> =
            self.compiled.memory.iter().filter(|part| part.bytes.saturating_mul(50) >= peak).collect();
        parts.sort_by_key(|part| std::cmp::Reverse(part.bytes));
        let words: Vec<String> =
            parts.iter().map(|part| format!("{} {:.1}", part.name, mib(part.bytes))).collect();
        if words.is_empty() { String::new() } else { format!(": {}", words.join(", ")) }
    }

    /// Samples per pixel, not an integer if the render was stopped early.
    fn samples_in_words(&self) -> String {
        let samples = (self.statistics.samples_per_pixel * 100.0).round() / 100.0;
        format!("{samples} sample{} per pixel", if samples == 1.0 { "" } else { "s" })
    }

    /// The line at the end: of a frame of a sequence, or of a single picture.
    pub fn print_end(&self, frame: Option<&str>) {
        let s = &self.statistics;
        if s.interrupted {
            say!("stopped  by a signal: the picture has the samples taken until then");
        } else if s.timed_out {
            say!("stopped  by --time-limit: another run may stop elsewhere and give other pixels");
        }
        let noise = s.error.map(|error| format!(", noise {:.1} %", error * 100.0)).unwrap_or_default();
        let (outputs, time) = (self.outputs.join(", "), readable_time(self.total_s));
        let denoised = if self.denoise_s.is_some() { ", denoised" } else { "" };
        let facts =
            format!("{}x{}, {}{noise}{denoised}, {time}", self.size.0, self.size.1, self.samples_in_words());
        match (frame, self.outputs.is_empty()) {
            (Some(frame), true) => say!("{frame}: {facts}"),
            (Some(frame), false) => say!("{frame}: {outputs}, {facts}"),
            (None, true) => say!("rendered {facts}"),
            (None, false) => say!("wrote    {outputs}: {facts}"),
        }
    }

    /// The details for people, before the last line.
    pub fn print_details(&self) {
        let (s, c) = (&self.statistics, &self.compiled);
        say!(
            "scene    {}, {}, {}{}{}{}, {:.1} MiB{}",
            counted(c.triangles, "triangle"),
            counted(c.quads, "quad"),
            ShapeCounts(c.analytic).words(),
            if c.curves > 0 { format!("{}, ", counted(c.curves, "curve piece")) } else { String::new() },
            if c.splats > 0 { format!("{}, ", counted(c.splats, "Gaussian splat")) } else { String::new() },
            counted(c.lights, "light"),
            mib(c.bytes),
            if c.tree == TreeQuality::Fast { ", fast tree" } else { "" }
        );
        if let Some(line) = textures(c, s) {
            say!("{line}");
        }
        let shared =
            s.path_reuse.map(|shape| format!(", shared by {} pixels", shape.pixels())).unwrap_or_default();
        let branches = if s.branches > 1 { format!(" of {} branches", s.branches) } else { String::new() };
        let guided = if s.guide_cells.is_some() { ", guided" } else { "" };
        let caustics = if s.light_paths.is_some() { ", caustics by light tracing" } else { "" };
        say!(
            "picture  {} x {}, {}, {}{branches}{shared}{guided}{caustics}, {}",
            self.size.0,
            self.size.1,
            self.samples_in_words(),
            counted(s.samples, "path"),
            counted(s.rays, "ray")
        );
        say!(
            "time     load {:.3} s, build {:.3} s, render {:.3} s ({:.3} s of CPU, {:.1} M rays/s), {}write {:.3} s",
            self.load_s,
            c.build_s,
            s.render_s,
            s.render_cpu_s,
            s.rays as f64 / s.render_s.max(1e-9) / 1e6,
            self.denoise_s.map(|s| format!("denoise {s:.3} s, ")).unwrap_or_default(),
            self.write_s
        );
        if let Some(bytes) = self.peak_memory {
            say!("memory   {:.1} MiB at most{}", mib(bytes), self.memory_by_part(bytes));
        }
        say!("warnings {}; left out {}", self.warnings.len(), self.left_out.len());
    }
}

/// `4.2 s`, `41 s`, `12 min 5 s`, `3 h 20 min`.
fn readable_time(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match seconds {
        ..9.95 => format!("{seconds:.1} s"),
        ..99.5 => format!("{whole} s"),
        ..3599.5 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
    }
}

/// Memory of textures.
fn textures(c: &CompileReport, s: &Statistics) -> Option<String> {
    let t = &c.textures;
    if t.decoded + t.unneeded == 0 {
        return None;
    }
    let mut line = format!("textures {:.1} of {:.1} MiB in memory", mib(t.bytes), mib(t.all_bytes));
    if t.paged > 0 {
        line += &format!("; {} compressed", counted(t.paged, "image"));
    }
    if t.file_bytes > 0 {
        let tiles = counted(s.tiles_on_demand, "tile");
        line += &format!(", {:.1} MiB in a temporary file, {tiles} read", mib(t.file_bytes));
    }
    if s.images_on_demand > 0 {
        line += &format!("; {} decoded on demand", counted(s.images_on_demand, "image"));
    }
    Some(line)
}

/// `1 light`, `2 lights`.
pub(super) fn counted(n: u64, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

fn mib(bytes: u64) -> f64 {
    bytes as f64 / (1024.0 * 1024.0)
}

// Similar messages: the first few are printed, the others counted.

/// Number of similar messages that are printed.
const FIRST: usize = 5;

/// An entry of a shortened list of messages.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Line<'m, T> {
    /// A message.
    One(&'m T),
    /// Number of further messages similar to the one before.
    More(usize),
}

/// Shortens a list of messages to the first few of each kind, in order.
pub(crate) fn shortened<'m, T>(list: &'m [T], text: impl Fn(&T) -> &str) -> Vec<Line<'m, T>> {
    let kinds: Vec<String> = list.iter().map(|item| kind(text(item))).collect();
    let mut counts: HashMap<&str, usize> = HashMap::new();
    kinds.iter().for_each(|kind| *counts.entry(kind).or_default() += 1);
    let mut shown: HashMap<&str, usize> = HashMap::new();
    let mut lines = Vec::new();
    for (item, kind) in list.iter().zip(&kinds) {
        let (count, at) = (counts[kind.as_str()], shown.entry(kind).or_default());
        *at += 1;
        // Printing the one message takes no more space than counting it.
        if *at <= FIRST || count == FIRST + 1 {
            lines.push(Line::One(item));
        }
        if *at == FIRST && count > FIRST + 1 {
            lines.push(Line::More(count - FIRST));
        }
    }
    lines
}

/// The message with quoted names and numbers replaced: similar messages have the same.
fn kind(text: &str) -> String {
    let mut out = String::new();
    let (mut rest, mut is_in_word) = (text, false);
    while let Some(first) = rest.chars().next() {
        // An apostrophe within a word doesn't start a quoted name.
        let quoted = rest.strip_prefix('\'').filter(|_| !is_in_word);
        let quoted = quoted.and_then(|inner| Some(inner.find('\'')? + 2));
        let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
        let (mark, length) = match quoted {
            Some(length) => ('\'', length),
            None if digits > 0 => ('0', digits),
            None => (first, first.len_utf8()),
        };
        out.push(mark);
        is_in_word = mark.is_alphanumeric();
        rest = &rest[length..];
    }
    out
}

// Excerpts of very long lines, as in scene files without line breaks.

/// Lines up to this many characters are printed whole.
const LONGEST: usize = 240;
/// Characters printed on each side of the location.
const AROUND: usize = 40;

/// Location in a text, with an excerpt.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Excerpt {
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// Excerpt of the line, with dots where it is cut.
    pub shown: String,
    /// Markers below the excerpt.
    pub marker: String,
}

impl Excerpt {
    /// The place of a span of bytes in a line that is too long to show, or whose neighbours are; `None` where lines are
    /// short, and for a span that doesn't fit the text.
    pub fn of_long_line(text: &str, span: &Range<usize>) -> Option<Excerpt> {
        let (before, rest) = (text.get(..span.start)?, text.get(span.start..)?);
        let line = before.matches('\n').count();
        let neighbours = text.lines().skip(line.saturating_sub(1)).take(if line == 0 { 2 } else { 3 });
        if neighbours.map(str::len).max()? <= LONGEST {
            return None;
        }
        let start = before.rfind('\n').map_or(0, |at| at + 1);
        let rest = rest.lines().next().unwrap_or_default();
        let column = before[start..].chars().count();
        let head: String = before[start..].chars().skip(column.saturating_sub(AROUND)).collect();
        let marked = text.get(span.clone()).and_then(|t| t.lines().next()).map_or(1, |t| t.chars().count());
        let marked = marked.clamp(1, AROUND);
        let tail: String = rest.chars().take(marked + AROUND).collect();
        let (left, right) = (
            if column > AROUND { "..." } else { "" },
            if rest.chars().count() > marked + AROUND { "..." } else { "" },
        );
        // Control characters would misalign the markers.
        let shown = format!("{left}{head}{tail}{right}").replace(char::is_control, " ");
        let indent = left.len() + head.chars().count();
        let marker = " ".repeat(indent) + &"^".repeat(marked);
        Some(Excerpt { line: line + 1, column: column + 1, shown, marker })
    }
}

// Counts of analytic shapes, as text and JSON.

/// A count for each of [`ShapeTag::ALL`].
#[derive(Clone, Copy)]
pub(crate) struct ShapeCounts(pub [u64; ShapeTag::ALL.len()]);

impl ShapeCounts {
    /// The shapes of a scene.
    pub fn of(scene: &Scene) -> ShapeCounts {
        let mut counts = ShapeCounts([0; ShapeTag::ALL.len()]);
        for shape in &scene.shapes {
            counts.0[shape.kind.tag() as usize] += 1;
        }
        counts
    }

    fn iter(self) -> impl Iterator<Item = (ShapeTag, u64)> {
        ShapeTag::ALL.iter().copied().zip(self.0)
    }

    /// `1 sphere, 2 disks, `: the kinds that are there, each with a comma.
    pub fn words(self) -> String {
        let there = self.iter().filter(|(_, count)| *count > 0);
        let one = |(tag, count): (ShapeTag, u64)| {
            format!("{count} {}, ", if count == 1 { tag.name() } else { tag.plural() })
        };
        there.map(one).collect()
    }
}

/// A key for each kind.
impl Serialize for ShapeCounts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.iter().map(|(tag, count)| (tag.plural().replace(' ', "_"), count)))
    }
}

// Replaces placeholders for caller choices in the library's messages by option names.

/// Command-line option of a choice.
fn option(choice: Choice) -> &'static str {
    match choice {
        Choice::AllowExternal => "--allow-external",
        Choice::Aovs => "--aov",
        Choice::Background => "--background",
        Choice::NewSidecar => "the file that 'oscura new --beside FILE' writes",
        Choice::Blender => "--blender PATH",
        Choice::Environment => "--env none",
        Choice::Float => "--float",
        Choice::Force => "--force",
        Choice::Glass => "--glass",
        Choice::Ground => "--ground",
        Choice::LightUnits => "--light-units",
        Choice::MemoryLimit => "--memory-limit",
        Choice::NoSidecar => "--no-sidecar",
        Choice::PointRadius => "--point-radius METRES",
        Choice::Smooth => "--smooth",
        Choice::Subdivide => "--subdivide",
        Choice::Stage => "--stage",
        Choice::Up => "--up AXIS",
        Choice::ViewFrom => "--view-from",
        Choice::Zoom => "--zoom",
    }
}

fn replace(text: &mut String) {
    for choice in Choice::ALL {
        let term = choice.to_string();
        if text.contains(&term) {
            *text = text.replace(&term, option(choice));
        }
    }
}

/// Names options in an error.
pub(crate) fn name_options_in_error(mut error: Error) -> Error {
    for problem in &mut error.problems {
        replace(&mut problem.message);
        if let Some(help) = &mut problem.help {
            replace(help);
        }
    }
    error
}

/// Names options in warnings or notes.
pub(crate) fn name_options_in_warnings(warnings: &mut [Warning]) {
    warnings.iter_mut().for_each(|warning| replace(&mut warning.message));
}

/// Names options in the notes and warnings of loading.
pub(crate) fn name_options_in_loaded(loaded: &mut Loaded) {
    name_options_in_warnings(&mut loaded.warnings);
    name_options_in_warnings(&mut loaded.notes);
}

#[cfg(test)]
mod excerpt_tests {
    use super::*;

    #[test]
    fn only_long_lines_are_cut() {
        assert_eq!(Excerpt::of_long_line("a = 1\nb = 2\n", &(6..7)), None);
        let long = format!("a = 1\nb = [{} \u{e4}\u{1f600}X, 9 ]", "0, ".repeat(1000));
        let at = long.find('X').expect("the mark");
        let excerpt = Excerpt::of_long_line(&long, &(at..at + 1)).expect("a long line");
        assert_eq!((excerpt.line, excerpt.column), (2, 3009));
        assert!(excerpt.shown.starts_with("...") && excerpt.shown.ends_with("X, 9 ]"), "{excerpt:?}");
        assert!(excerpt.shown.len() < 120, "{excerpt:?}");
        assert_eq!(excerpt.shown.chars().nth(excerpt.marker.find('^').expect("a mark")), Some('X'));
        // A neighbour would be shown too.
        assert!(Excerpt::of_long_line(&long, &(0..1)).is_some());
    }

    #[test]
    fn spans_at_and_beyond_the_end() {
        let long = "x".repeat(1000);
        assert_eq!(Excerpt::of_long_line(&long, &(1000..1000)).map(|e| e.column), Some(1001));
        assert_eq!(Excerpt::of_long_line(&long, &(2000..2001)), None);
        assert!(Excerpt::of_long_line(&long, &(0..1000)).is_some_and(|e| e.marker.len() <= 40));
    }
}

/// Mean luminance below which a picture is nearly black: a hundredth of middle grey.
const DARK: f64 = 0.18 / 100.0;
/// Share of pixels as bright as middle grey that makes a dark picture one of a small bright thing.
const SEEN: f64 = 1e-3;
/// Maximum number of pixels that are looked at.
const LOOKED_AT: u64 = 1 << 18;

/// A note for a picture that is nearly black at this exposure (stops).
pub(super) fn darkness_note(film: &Film, exposure: f32, scene: &Scene, file: &Path) -> Option<Warning> {
    let all = u64::from(film.width()) * u64::from(film.height());
    let step = all.div_ceil(LOOKED_AT).max(1);
    let width = u64::from(film.width());
    let (count, scale) = (all.div_ceil(step), f64::from(exposure).exp2());
    let (mut sum, mut bright, mut covered) = (0.0, 0u64, 0.0);
    for at in (0..all).step_by(usize::try_from(step).unwrap_or(1)) {
        let [r, g, b, alpha] = film.mean_rgba((at % width) as u32, (at / width) as u32);
        let value = f64::from(luminance([r, g, b])) * scale;
        sum += value.max(0.0);
        bright += u64::from(value > 0.18);
        covered += f64::from(alpha);
        // Most pictures are seen to be bright after few pixels.
        if bright as f64 > SEEN * count as f64 {
            return None;
        }
    }
    let mean = sum / count.max(1) as f64;
    // Nothing in the picture is something else, which is reported elsewhere.
    if !(mean < DARK && covered > 0.0) {
        return None;
    }
    let stops = (0.18 / mean.max(1e-30)).log2();
    let brighter = match mean > 1e-12 {
        true => format!("--exposure {} shows it", (f64::from(exposure) + stops).round()),
        false => "no light reaches what the camera sees".to_string(),
    };
    let of_units = match is_of_gltf(file) && scene.lights.iter().any(|light| light.profile.is_none()) {
        true => format!("; its lights may be meant in other units: {} compat", Choice::LightUnits),
        false => String::new(),
    };
    let how_dark = match mean > 1e-12 {
        true => format!("nearly black (mean luminance {mean:.1e})"),
        false => "black".to_string(),
    };
    let of_dark = if scene.lights.is_empty() { "; --env FILE or --stage light it" } else { "" };
    Some(Warning::general(format!("the picture is {how_dark}: {brighter}{of_units}{of_dark}")))
}

fn is_of_gltf(file: &Path) -> bool {
    let extension = file.extension().unwrap_or_default().to_ascii_lowercase();
    is_named_as_scene(file) && ["gltf", "glb", "vrm", "zip"].iter().any(|gltf| extension == *gltf)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_short() {
        let times = [0.04, 9.96, 99.0, 725.0, 12_000.0].map(readable_time);
        assert_eq!(times, ["0.0 s", "10 s", "99 s", "12 min 5 s", "3 h 20 min"]);
    }

    #[test]
    fn names_and_numbers_make_no_kinds() {
        assert_eq!(kind("there is no material 'm7' in 12 files"), "there is no material ' in 0 files");
        assert_eq!(kind("it's the ä 'x"), "it's the ä 'x");
        assert_ne!(kind("2 triangles"), kind("2 quads"));
    }

    #[test]
    fn the_first_of_each_kind_are_shown() {
        let list: Vec<String> =
            (0..20).flat_map(|i| [format!("no '{i}'"), format!("other {i}")]).take(27).collect();
        let lines = shortened(&list, |text| text);
        let count = |line: &Line<String>| match line {
            Line::One(_) => 1,
            Line::More(n) => *n,
        };
        assert_eq!(lines.iter().map(count).sum::<usize>(), 27);
        assert_eq!(lines.len(), 12);
        assert_eq!((&lines[9], &lines[11]), (&Line::More(9), &Line::More(8)));
        // Six are shown: no line is saved by counting one.
        assert_eq!(shortened(&list[..12], |text| text).len(), 12);
    }
}
