//! What the user reads: errors, warnings and the report at the end.

use super::alike::{Line, shortened};
use super::excerpt::Excerpt;
use super::shapes::ShapeCounts;
use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};
use oscura::accel::TreeQuality;
use oscura::compile::CompileReport;
use oscura::error::{Error, Problem, Warning};
use oscura::render::Statistics;
use std::collections::HashSet;
use std::fmt;
use std::io::Write;

/// One problem with the line of the file that it is about.
#[derive(Debug)]
struct Shown<'a> {
    problem: &'a Problem,
    source: NamedSource<String>,
}

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.problem.message)
    }
}

impl std::error::Error for Shown<'_> {}

impl Diagnostic for Shown<'_> {
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

/// Prints an error with all its problems, lines of the file where they are known.
pub(crate) fn error(error: &Error) {
    let file = error.file.as_ref().map(|f| f.display().to_string());
    let count = error.problems.len();
    match &file {
        Some(file) if count > 1 => say!("error: {file}: {count} problems"),
        Some(file) => say!("error: {file}"),
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
            _ => plain(problem),
        }
    }
}

fn plain(problem: &Problem) {
    let place = if problem.place.is_empty() { String::new() } else { format!("{}: ", problem.place) };
    say!("  {place}{}", problem.message);
    if let Some(help) = &problem.help {
        say!("    help: {help}");
    }
}

/// The problem with the line that it is about; only the part around the place where that line is very long.
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
    match handler.render_report(&mut out, &Shown { problem, source }) {
        Ok(()) => out,
        // A span outside the text: the message matters more than the line.
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

/// Prints a line on standard output. Nobody listening any more is no error.
pub(crate) fn print_line(line: &str) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

/// Prints text that ends its own lines.
pub(crate) fn print_text(text: &str) {
    let _ = std::io::stdout().write_all(text.as_bytes());
}

/// What was printed before: each frame of a sequence says what is new.
#[derive(Default)]
pub(crate) struct Said(HashSet<String>);

impl Said {
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
    pub load_s: f64,
    pub denoise_s: Option<f64>,
    pub write_s: f64,
    pub width: u32,
    pub height: u32,
    pub seed: u32,
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

    /// The report for people.
    pub fn print(&self) {
        let (s, c) = (&self.statistics, &self.compiled);
        say!(
            "scene    {}, {}, {}{}{}, {:.1} MiB{}",
            counted(c.triangles, "triangle"),
            counted(c.quads, "quad"),
            ShapeCounts(c.analytic).words(),
            if c.curves > 0 { format!("{}, ", counted(c.curves, "curve piece")) } else { String::new() },
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
        let mean = if s.is_adaptive { " on average" } else { "" };
        let guided = if s.guide_cells.is_some() { ", guided" } else { "" };
        let lamps = if s.lamp_paths.is_some() { ", caustics from the lamp" } else { "" };
        say!(
            "picture  {} x {}, {} samples a pixel{mean}, {}{branches}{shared}{guided}{lamps}, {}",
            self.width,
            self.height,
            // Fractions only come from stopping early.
            (s.samples_per_pixel * 100.0).round() / 100.0,
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
        if let Some(error) = s.error {
            say!("noise    {:.2} % relative error, estimated", error * 100.0);
        }
        if let Some(bytes) = self.peak_memory {
            say!("memory   {:.1} MiB at most{}", mib(bytes), self.memory_by_part(bytes));
        }
        say!("warnings {}; left out {}", self.warnings.len(), self.left_out.len());
        if s.interrupted && self.outputs.is_empty() {
            say!("stopped by a signal");
        } else if s.interrupted {
            say!("stopped by a signal: the pictures hold the samples taken until then");
        } else if s.timed_out {
            say!("stopped by --time-limit: another run may stop elsewhere and give other pixels");
        }
        for output in &self.outputs {
            say!("wrote    {output}");
        }
    }
}

/// What large images of textures take.
fn textures(c: &CompileReport, s: &Statistics) -> Option<String> {
    let t = &c.textures;
    if t.decoded + t.unneeded == 0 {
        return None;
    }
    let kept = format!("textures {:.1} of {:.1} MiB in memory", mib(t.bytes), mib(t.all_bytes));
    Some(match s.tiles_on_demand {
        0 => kept,
        tiles => {
            let images = counted(s.images_on_demand, "image");
            format!("{kept}; {images} decoded on demand, {}", counted(tiles, "tile"))
        }
    })
}

/// `1 light`, `2 lights`.
pub(super) fn counted(n: u64, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

fn mib(bytes: u64) -> f64 {
    bytes as f64 / (1024.0 * 1024.0)
}
