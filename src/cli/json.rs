//! JSON output: one line, with a space after commas and colons, and numbers without exponents, which not all tools parse.
//! NaN and infinities become null.

use super::picture_args::Quality;
use super::report::{self, Run, ShapeCounts};
use oscura::accel::TreeQuality;
use oscura::error::{Error, ErrorKind};
use serde::Serialize;
use serde_json::ser::Formatter;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::io;
use std::io::Write;

/// The style of the printed line.
struct OneLine;

impl Formatter for OneLine {
    // Display of floats never uses an exponent.
    fn write_f64<W: ?Sized + Write>(&mut self, writer: &mut W, value: f64) -> io::Result<()> {
        write!(writer, "{value}")
    }

    fn begin_array_value<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        writer.write_all(if first { b"" } else { b", " })
    }

    fn begin_object_key<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        writer.write_all(if first { b"" } else { b", " })
    }

    fn begin_object_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        writer.write_all(b": ")
    }
}

/// Prints a value as one line on standard output. A closed pipe is not an error.
pub(crate) fn print(value: &impl Serialize) {
    let mut line = io::stdout().lock();
    let written = write(&mut line, value).map_err(io::Error::from);
    report::report_stdout_error(written.and_then(|()| writeln!(line)).and_then(|()| line.flush()));
}

fn write(writer: &mut impl Write, value: &impl Serialize) -> serde_json::Result<()> {
    value.serialize(&mut serde_json::Serializer::with_formatter(writer, OneLine))
}

/// The report of a render; times in seconds, sizes in bytes.
#[derive(Serialize)]
struct RunReport<'a> {
    load_s: f64,
    build_s: f64,
    render_s: f64,
    denoise_s: Option<f64>,
    write_s: f64,
    render_cpu_s: f64,
    width: u32,
    height: u32,
    seed: u32,
    samples: u64,
    samples_per_pixel: f64,
    path_reuse: Option<String>,
    branches: u32,
    quality: Option<Quality>,
    light_paths: Option<u32>,
    light_cells: Option<u32>,
    guide_cells: Option<u32>,
    estimated_error: Option<f64>,
    invalid_samples: u64,
    rays: u64,
    peak_memory_bytes: Option<u64>,
    triangles: u64,
    quads: u64,
    curve_pieces: u64,
    gaussian_splats: u64,
    #[serde(flatten)]
    shapes: ShapeCounts,
    lights: u64,
    scene_bytes: u64,
    memory: BTreeMap<&'static str, u64>,
    images_on_demand: u64,
    bvh: &'static str,
    interrupted: bool,
    timed_out: bool,
    outputs: &'a [String],
    notes: Vec<String>,
    warnings: Vec<String>,
    /// Codes of the warnings, in order; an empty string for warnings without a code.
    warning_codes: Vec<&'static str>,
    /// Messages about data that was skipped because it has no effect on the picture.
    left_out: &'a [String],
}

/// The report of a render.
pub(crate) fn of_run(run: &Run) -> impl Serialize {
    let (s, c) = (&run.statistics, &run.compiled);
    RunReport {
        load_s: run.load_s,
        build_s: c.build_s,
        render_s: s.render_s,
        denoise_s: run.denoise_s,
        write_s: run.write_s,
        render_cpu_s: s.render_cpu_s,
        width: run.size.0,
        height: run.size.1,
        seed: run.seed,
        samples: s.samples,
        samples_per_pixel: s.samples_per_pixel,
        path_reuse: s.path_reuse.map(|block| block.to_string()),
        branches: s.branches,
        quality: run.quality,
        light_paths: s.light_paths,
        light_cells: s.light_cells,
        guide_cells: s.guide_cells,
        estimated_error: s.error,
        invalid_samples: s.invalid_samples,
        rays: s.rays,
        peak_memory_bytes: run.peak_memory,
        triangles: c.triangles,
        quads: c.quads,
        curve_pieces: c.curves,
        gaussian_splats: c.splats,
        shapes: ShapeCounts(c.analytic),
        lights: c.lights,
        scene_bytes: c.bytes,
        memory: c.memory.iter().map(|part| (part.name, part.bytes)).collect(),
        images_on_demand: s.images_on_demand,
        bvh: if c.bvh == TreeQuality::Fast { "fast" } else { "full" },
        interrupted: s.interrupted,
        timed_out: s.timed_out,
        outputs: &run.outputs,
        notes: texts(&run.notes),
        warnings: texts(&run.warnings),
        warning_codes: run.warnings.iter().map(|warning| warning.code).collect(),
        left_out: &run.left_out,
    }
}

/// The JSON object of an error.
#[derive(Serialize)]
struct Failure {
    error: ErrorReport,
}

#[derive(Serialize)]
struct ErrorReport {
    kind: &'static str,
    exit_code: u8,
    file: Option<String>,
    problems: Vec<String>,
    /// Codes of the problems, in order; an empty string for problems without a code.
    codes: Vec<&'static str>,
}

/// The report of an error with its exit code.
pub(crate) fn of_error(error: &Error, exit_code: u8) -> impl Serialize {
    let kind = match error.kind {
        ErrorKind::Usage => "usage",
        ErrorKind::Input => "input",
        ErrorKind::Output => "output",
        ErrorKind::Interrupted => "interrupted",
    };
    let file = error.file.as_ref().map(|f| f.display().to_string());
    let codes = error.problems.iter().map(|problem| problem.code).collect();
    Failure { error: ErrorReport { kind, exit_code, file, problems: texts(&error.problems), codes } }
}

fn texts(list: &[impl Display]) -> Vec<String> {
    list.iter().map(ToString::to_string).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Example {
        small: f64,
        large: f64,
        none: f64,
        list: (u64, bool, Option<u8>),
        text: &'static str,
    }

    #[test]
    fn numbers_have_no_exponents_and_strings_are_escaped() {
        let value = Example {
            small: 1.5e-9,
            large: 1e21,
            none: f64::NAN,
            list: (u64::MAX, true, None),
            text: "a \"b\"\n\u{1}",
        };
        let mut line = Vec::new();
        write(&mut line, &value).unwrap();
        let expected = r#"{"small": 0.0000000015, "large": 1000000000000000000000, "none": null, "#
            .to_string()
            + r#""list": [18446744073709551615, true, null], "text": "a \"b\"\n\u0001"}"#;
        assert_eq!(String::from_utf8(line).unwrap(), expected);
    }
}
