//! Messages to the user: errors, warnings, the final report, and a note about nearly black pictures.

use super::picture_args::Quality;
use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};
use oscura::accel::TreeQuality;
use oscura::color::luminance;
use oscura::compile::CompileReport;
use oscura::error::{Choice, Error, Problem, Warning};
use oscura::film::Film;
use oscura::load::{Loaded, is_named_as_scene};
use oscura::render::Statistics;
use oscura::scene::{Scene, ShapeKind};
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

/// Prints an error with all its problems, and their source lines if known.
pub(crate) fn error(error: &Error) {
    let file = error.file.as_ref().map(|f| f.display().to_string());
    let count = error.problems.len();
    match &file {
        Some(file) if count > 1 => say!("error: {file}: {count} problems"),
        Some(file) => say!("error: {file}"),
        None if count == 1 => return print_plain(&error.problems[0], "error: ", "  "),
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
            _ => print_plain(problem, "  ", "    "),
        }
    }
}

/// Prints a problem without source line: the message after `prefix`, the help after `indent`.
fn print_plain(problem: &Problem, prefix: &str, indent: &str) {
    let place = if problem.place.is_empty() { String::new() } else { format!("{}: ", problem.place) };
    say!("{prefix}{place}{}", problem.message);
    if let Some(help) = &problem.help {
        say!("{indent}help: {help}");
    }
}

/// Text of a problem with its source line, or an excerpt of a very long line.
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
        // The span is outside of the text.
        Err(_) => format!("  {problem}"),
    }
}

/// Colours only on terminals and without `NO_COLOR` (<https://no-color.org>).
fn theme() -> miette::GraphicalTheme {
    use std::io::IsTerminal;
    let no_color = std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty());
    if !no_color && std::io::stderr().is_terminal() {
        miette::GraphicalTheme::unicode()
    } else {
        miette::GraphicalTheme::unicode_nocolor()
    }
}

/// Prints a line on standard output. A closed pipe is not an error.
pub(crate) fn print_line(line: &str) {
    report_stdout_error(writeln!(std::io::stdout(), "{line}"));
}

/// Prints text without adding a line break.
pub(crate) fn print_text(text: &str) {
    report_stdout_error(std::io::stdout().write_all(text.as_bytes()));
}

/// Writes the bytes of a picture to standard output.
///
/// # Errors
/// An output error, also for a closed pipe.
pub(crate) fn print_bytes(bytes: &[u8]) -> oscura::error::Result<()> {
    let mut out = std::io::stdout();
    let written = out.write_all(bytes).and_then(|()| out.flush());
    written.map_err(|error| Error::output(Path::new("standard output"), format!("can't be written: {error}")))
}

/// Writing to standard output failed.
static HAS_STDOUT_FAILED: AtomicBool = AtomicBool::new(false);

/// Prints the first error of writing to standard output. A closed pipe is not an error.
pub(crate) fn report_stdout_error(result: std::io::Result<()>) {
    let Err(error) = result else { return };
    if error.kind() != std::io::ErrorKind::BrokenPipe && !HAS_STDOUT_FAILED.swap(true, Ordering::Relaxed) {
        say!("error: standard output can't be written: {error}");
    }
}

/// Flushes standard output. Returns the exit code: `code`, or that of output errors if it is 0 and standard output failed.
pub(crate) fn code_with_stdout(code: u8) -> u8 {
    report_stdout_error(std::io::stdout().flush());
    match HAS_STDOUT_FAILED.load(Ordering::Relaxed) {
        true if code == 0 => 4,
        _ => code,
    }
}

/// Messages printed so far; each is printed only once per animation.
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
            list.iter().filter(|message| self.0.insert(format!("{kind}: {message}"))).cloned().collect();
        for line in shortened(&new, |warning| &warning.message) {
            match line {
                Line::One(warning) => say!("{kind}: {warning}"),
                Line::More(count) => say!("{kind}: ... and {count} more of this kind"),
            }
        }
    }
}

/// Report of a finished run.
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
    /// Memory by part, largest first; parts below 2 % of the peak are omitted.
    fn memory_by_part(&self, peak: u64) -> String {
        let mut parts: Vec<_> =
            self.compiled.memory.iter().filter(|part| part.bytes.saturating_mul(50) >= peak).collect();
        parts.sort_by_key(|part| std::cmp::Reverse(part.bytes));
        let items: Vec<String> =
            parts.iter().map(|part| format!("{} {:.1}", part.name, mib(part.bytes))).collect();
        if items.is_empty() { String::new() } else { format!(": {}", items.join(", ")) }
    }

    /// Samples per pixel as text; not an integer if the render was stopped early.
    fn samples_text(&self) -> String {
        let samples = (self.statistics.samples_per_pixel * 100.0).round() / 100.0;
        format!("{samples} sample{} per pixel", if samples == 1.0 { "" } else { "s" })
    }

    /// Prints the final line of a picture or of a frame of a sequence.
    pub fn print_end(&self, frame: Option<&str>) {
        let s = &self.statistics;
        if s.interrupted {
            say!("stopped  by a signal: the picture has fewer samples");
        } else if s.timed_out {
            say!("stopped  by --time-limit: the picture is not reproducible");
        }
        let (denoised, of) = if self.denoise_s.is_some() { (", denoised", "error") } else { ("", "noise") };
        let error = s.error.map(|error| format!(", {of} {:.1} %", error * 100.0)).unwrap_or_default();
        let (outputs, time) = (self.outputs.join(", "), readable_time(self.total_s));
        let summary =
            format!("{}x{}, {}{denoised}{error}, {time}", self.size.0, self.size.1, self.samples_text());
        match (frame, self.outputs.is_empty()) {
            (Some(frame), true) => say!("{frame}: {summary}"),
            (Some(frame), false) => say!("{frame}: {outputs}, {summary}"),
            (None, true) => say!("rendered {summary}"),
            (None, false) => say!("wrote    {outputs}: {summary}"),
        }
    }

    /// Prints the details of `--verbose`.
    pub fn print_details(&self) {
        let (s, c) = (&self.statistics, &self.compiled);
        say!(
            "scene    {}, {}, {}{}{}{}, {:.1} MiB{}",
            counted(c.triangles, "triangle"),
            counted(c.quads, "quad"),
            ShapeCounts(c.analytic).text(),
            if c.curves > 0 { format!("{}, ", counted(c.curves, "curve segment")) } else { String::new() },
            if c.splats > 0 { format!("{}, ", counted(c.splats, "Gaussian splat")) } else { String::new() },
            counted(c.lights, "light"),
            mib(c.bytes),
            if c.bvh == TreeQuality::Fast { ", fast BVH" } else { "" }
        );
        if let Some(line) = texture_line(c, s) {
            say!("{line}");
        }
        let shared =
            s.path_reuse.map(|shape| format!(", shared by {} pixels", shape.pixels())).unwrap_or_default();
        let branches = if s.branches > 1 { format!(" of {} branches", s.branches) } else { String::new() };
        let guided = if s.guide_cells.is_some() { ", guided" } else { "" };
        let learned = if s.light_cells.is_some() { ", lights selected by visibility" } else { "" };
        let caustics = if s.light_paths.is_some() { ", caustics by light tracing" } else { "" };
        say!(
            "picture  {} x {}, {}, {}{branches}{shared}{guided}{learned}{caustics}, {}",
            self.size.0,
            self.size.1,
            self.samples_text(),
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

/// A time as text: `4.2 s`, `41 s`, `12 min 5 s`, `3 h 20 min`.
fn readable_time(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match seconds {
        ..9.95 => format!("{seconds:.1} s"),
        ..99.5 => format!("{whole} s"),
        ..3599.5 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
    }
}

/// Line about texture memory; `None` without textures.
fn texture_line(c: &CompileReport, s: &Statistics) -> Option<String> {
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

/// A count with its noun: `1 light`, `2 lights`.
pub(super) fn counted(n: u64, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}

fn mib(bytes: u64) -> f64 {
    bytes as f64 / (1024.0 * 1024.0)
}

// Shortening of lists with many similar messages.

/// Number of similar messages that are printed; the rest is counted.
const MAX_SIMILAR: usize = 5;

/// An entry of a shortened list of messages.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Line<'m, T> {
    /// A message.
    One(&'m T),
    /// Number of omitted messages similar to the one before.
    More(usize),
}

/// Shortens a list of messages to the first few of each kind, in order.
pub(crate) fn shortened<'m, T>(list: &'m [T], text: impl Fn(&T) -> &str) -> Vec<Line<'m, T>> {
    let kinds: Vec<String> = list.iter().map(|item| kind(text(item))).collect();
    let mut counts: HashMap<&str, usize> = HashMap::new();
    kinds.iter().for_each(|kind| *counts.entry(kind).or_default() += 1);
    let mut seen_by_kind: HashMap<&str, usize> = HashMap::new();
    let mut lines = Vec::new();
    for (item, kind) in list.iter().zip(&kinds) {
        let (count, seen) = (counts[kind.as_str()], seen_by_kind.entry(kind).or_default());
        *seen += 1;
        // A single omitted message would be replaced by a line of the same length.
        if *seen <= MAX_SIMILAR || count == MAX_SIMILAR + 1 {
            lines.push(Line::One(item));
        }
        if *seen == MAX_SIMILAR && count > MAX_SIMILAR + 1 {
            lines.push(Line::More(count - MAX_SIMILAR));
        }
    }
    lines
}

/// The message with quoted names and numbers replaced; equal for similar messages.
fn kind(text: &str) -> String {
    let mut out = String::new();
    let (mut rest, mut is_in_word) = (text, false);
    while let Some(first) = rest.chars().next() {
        // An apostrophe within a word doesn't start a quoted name.
        let quoted = rest.strip_prefix('\'').filter(|_| !is_in_word);
        let quoted = quoted.and_then(|inner| Some(inner.find('\'')? + 2));
        let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
        let (replacement, length) = match quoted {
            Some(length) => ('\'', length),
            None if digits > 0 => ('0', digits),
            None => (first, first.len_utf8()),
        };
        out.push(replacement);
        is_in_word = replacement.is_alphanumeric();
        rest = &rest[length..];
    }
    out
}

/// Maximum length of lines that are printed whole, bytes.
const MAX_LINE: usize = 240;
/// Characters of an excerpt on each side of the location.
const CONTEXT: usize = 40;

/// Location in a text with very long lines, such as scene files without line breaks.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Excerpt {
    /// From 1.
    pub line: usize,
    /// In characters, from 1.
    pub column: usize,
    /// Excerpt of the line, with `...` where it is cut.
    pub shown: String,
    /// Line of markers below the excerpt.
    pub marker: String,
}

impl Excerpt {
    /// Location of a byte span if its line or a neighbouring line is very long; `None` for short lines and invalid spans.
    pub fn of_long_line(text: &str, span: &Range<usize>) -> Option<Excerpt> {
        let (before, rest) = (text.get(..span.start)?, text.get(span.start..)?);
        let line = before.matches('\n').count();
        let neighbours = text.lines().skip(line.saturating_sub(1)).take(if line == 0 { 2 } else { 3 });
        if neighbours.map(str::len).max()? <= MAX_LINE {
            return None;
        }
        let start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let rest = rest.lines().next().unwrap_or_default();
        let column = before[start..].chars().count();
        let head: String = before[start..].chars().skip(column.saturating_sub(CONTEXT)).collect();
        let marked = text.get(span.clone()).and_then(|t| t.lines().next()).map_or(1, |t| t.chars().count());
        let marked = marked.clamp(1, CONTEXT);
        let tail: String = rest.chars().take(marked + CONTEXT).collect();
        let (left, right) = (
            if column > CONTEXT { "..." } else { "" },
            if rest.chars().count() > marked + CONTEXT { "..." } else { "" },
        );
        // Control characters would misalign the markers.
        let shown = format!("{left}{head}{tail}{right}").replace(char::is_control, " ");
        let indent = left.len() + head.chars().count();
        let marker = " ".repeat(indent) + &"^".repeat(marked);
        Some(Excerpt { line: line + 1, column: column + 1, shown, marker })
    }
}

/// Number of analytic shapes of each kind in [`ShapeKind::ALL`], printed as text or JSON.
#[derive(Clone, Copy)]
pub(crate) struct ShapeCounts(pub [u64; ShapeKind::ALL.len()]);

impl ShapeCounts {
    pub fn of(scene: &Scene) -> ShapeCounts {
        let mut counts = ShapeCounts([0; ShapeKind::ALL.len()]);
        for shape in &scene.shapes {
            counts.0[shape.kind as usize] += 1;
        }
        counts
    }

    fn iter(self) -> impl Iterator<Item = (ShapeKind, u64)> {
        ShapeKind::ALL.into_iter().zip(self.0)
    }

    /// Text such as `1 sphere, 2 disks, `, with a trailing comma unless empty.
    pub fn text(self) -> String {
        let nonzero = self.iter().filter(|(_, count)| *count > 0);
        let item = |(kind, count): (ShapeKind, u64)| {
            format!("{count} {}{}, ", kind.name(), if count == 1 { "" } else { "s" })
        };
        nonzero.map(item).collect()
    }
}

/// A map with a key for each kind.
impl Serialize for ShapeCounts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.iter().map(|(kind, count)| (kind.name().replace(' ', "_") + "s", count)))
    }
}

// Option names in the library's messages.

/// Command-line option of a placeholder.
fn option_name(choice: Choice) -> &'static str {
    match choice {
        Choice::AllowExternal => "--allow-external",
        Choice::Aovs => "--aov",
        Choice::Background => "--background",
        Choice::NewSidecar => "the file that 'oscura new --sidecar FILE' writes",
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

fn replace_choices(text: &mut String) {
    for choice in Choice::ALL {
        let term = choice.to_string();
        if text.contains(&term) {
            *text = text.replace(&term, option_name(choice));
        }
    }
}

/// Replaces option placeholders in an error.
pub(crate) fn name_options_in_error(mut error: Error) -> Error {
    for problem in &mut error.problems {
        replace_choices(&mut problem.message);
        if let Some(help) = &mut problem.help {
            replace_choices(help);
        }
    }
    error
}

/// Replaces option placeholders in warnings or notes.
pub(crate) fn name_options_in_warnings(warnings: &mut [Warning]) {
    warnings.iter_mut().for_each(|warning| replace_choices(&mut warning.message));
}

/// Replaces option placeholders in the notes and warnings of loading.
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
        // The next line, which miette would print as well, is long.
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

/// Mean luminance below which a picture is nearly black: 1 % of middle grey.
const MAX_DARK_MEAN: f64 = 0.18 / 100.0;
/// Fraction of pixels brighter than middle grey above which a picture is not nearly black, whatever its mean.
const MIN_BRIGHT_FRACTION: f64 = 1e-3;
/// Maximum number of pixels tested.
const MAX_TESTED: u64 = 1 << 18;

/// A note if the picture is nearly black at this exposure (stops).
pub(super) fn darkness_note(film: &Film, exposure: f32, scene: &Scene, file: &Path) -> Option<Warning> {
    let all = u64::from(film.width()) * u64::from(film.height());
    let step = all.div_ceil(MAX_TESTED).max(1);
    let width = u64::from(film.width());
    let (count, scale) = (all.div_ceil(step), f64::from(exposure).exp2());
    let (mut sum, mut bright, mut covered) = (0.0, 0u64, 0.0);
    for index in (0..all).step_by(usize::try_from(step).unwrap_or(1)) {
        let [r, g, b, alpha] = film.mean_rgba((index % width) as u32, (index / width) as u32);
        let value = f64::from(luminance([r, g, b])) * scale;
        sum += value.max(0.0);
        bright += u64::from(value > 0.18);
        covered += f64::from(alpha);
        // Most pictures are decided after few pixels.
        if bright as f64 > MIN_BRIGHT_FRACTION * count as f64 {
            return None;
        }
    }
    let mean = sum / count.max(1) as f64;
    // Empty pictures are reported elsewhere.
    if !(mean < MAX_DARK_MEAN && covered > 0.0) {
        return None;
    }
    let stops = (0.18 / mean.max(1e-30)).log2();
    let hint = match mean > 1e-12 {
        true => format!("try --exposure {}", (f64::from(exposure) + stops).round()),
        false => "no light reaches the visible surfaces".to_string(),
    };
    let units_hint = match is_gltf(file) && scene.lights.iter().any(|light| light.profile.is_none()) {
        true => format!("; its lights may have other units: try {} compat", Choice::LightUnits),
        false => String::new(),
    };
    let darkness = match mean > 1e-12 {
        true => format!("nearly black (mean luminance {mean:.1e})"),
        false => "black".to_string(),
    };
    let light_hint = if scene.lights.is_empty() { "; add light with --env FILE or --stage" } else { "" };
    Some(Warning::general(format!("the picture is {darkness}: {hint}{units_hint}{light_hint}")))
}

fn is_gltf(file: &Path) -> bool {
    let extension = file.extension().unwrap_or_default().to_ascii_lowercase();
    is_named_as_scene(file) && ["gltf", "glb", "vrm", "zip"].iter().any(|gltf| extension == *gltf)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_readable() {
        let times = [0.04, 9.96, 99.0, 725.0, 12_000.0].map(readable_time);
        assert_eq!(times, ["0.0 s", "10 s", "99 s", "12 min 5 s", "3 h 20 min"]);
    }

    #[test]
    fn kinds_ignore_names_and_numbers() {
        assert_eq!(kind("there is no material 'm7' in 12 files"), "there is no material ' in 0 files");
        assert_eq!(kind("it's the ä 'x"), "it's the ä 'x");
        assert_ne!(kind("2 triangles"), kind("2 quads"));
    }

    #[test]
    fn only_the_first_of_each_kind_are_shown() {
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
        // Omitting one of six would not save a line.
        assert_eq!(shortened(&list[..12], |text| text).len(), 12);
    }
}
