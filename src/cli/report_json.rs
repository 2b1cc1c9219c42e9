//! What `--json` says about a run, or about the error that ended it.

use super::report::Run;
use super::shapes::ShapeCounts;
use oscura::accel::TreeQuality;
use oscura::error::{Error, ErrorKind};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Display;

/// A finished run; times in seconds, sizes in bytes.
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
    adaptive: bool,
    lamp_paths: Option<u32>,
    guide_cells: Option<u32>,
    estimated_error: Option<f64>,
    invalid_samples: u64,
    rays: u64,
    peak_memory_bytes: Option<u64>,
    triangles: u64,
    quads: u64,
    curve_pieces: u64,
    #[serde(flatten)]
    shapes: ShapeCounts,
    lights: u64,
    scene_bytes: u64,
    memory: BTreeMap<&'static str, u64>,
    texture_bytes: u64,
    images_on_demand: u64,
    tree: &'static str,
    interrupted: bool,
    timed_out: bool,
    outputs: &'a [String],
    notes: Vec<String>,
    warnings: Vec<String>,
    left_out: &'a [String],
}

/// The object about a finished run.
pub(crate) fn of_run(run: &Run) -> impl Serialize {
    let (s, c) = (&run.statistics, &run.compiled);
    RunReport {
        load_s: run.load_s,
        build_s: c.build_s,
        render_s: s.render_s,
        denoise_s: run.denoise_s,
        write_s: run.write_s,
        render_cpu_s: s.render_cpu_s,
        width: run.width,
        height: run.height,
        seed: run.seed,
        samples: s.samples,
        samples_per_pixel: s.samples_per_pixel,
        path_reuse: s.path_reuse.map(|shape| shape.to_string()),
        branches: s.branches,
        adaptive: s.is_adaptive,
        lamp_paths: s.lamp_paths,
        guide_cells: s.guide_cells,
        estimated_error: s.error,
        invalid_samples: s.invalid_samples,
        rays: s.rays,
        peak_memory_bytes: run.peak_memory,
        triangles: c.triangles,
        quads: c.quads,
        curve_pieces: c.curves,
        shapes: ShapeCounts(c.analytic),
        lights: c.lights,
        scene_bytes: c.bytes,
        memory: c.memory.iter().map(|part| (part.name, part.bytes)).collect(),
        texture_bytes: c.textures.bytes,
        images_on_demand: s.images_on_demand,
        tree: if c.tree == TreeQuality::Fast { "fast" } else { "full" },
        interrupted: s.interrupted,
        timed_out: s.timed_out,
        outputs: &run.outputs,
        notes: texts(&run.notes),
        warnings: texts(&run.warnings),
        left_out: &run.left_out,
    }
}

/// An error as the only entry of an object.
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
}

/// The object about an error that ends the program with this code.
pub(crate) fn of_error(error: &Error, exit_code: u8) -> impl Serialize {
    let kind = match error.kind {
        ErrorKind::Usage => "usage",
        ErrorKind::Input => "input",
        ErrorKind::Output => "output",
        ErrorKind::Interrupted => "interrupted",
    };
    let file = error.file.as_ref().map(|f| f.display().to_string());
    Failure { error: ErrorReport { kind, exit_code, file, problems: texts(&error.problems) } }
}

fn texts(list: &[impl Display]) -> Vec<String> {
    list.iter().map(ToString::to_string).collect()
}
