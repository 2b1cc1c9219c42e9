//! How time and memory grow with triangles, lights, pixels, depth and threads.

use crate::measure::Setup;
use crate::scenes::{Generated, models, rooms};
use oscura::compile::{CompileOptions, choose_camera, compile};
use oscura::error::Result;
use oscura::load::{LoadOptions, load};
use oscura::render::{RenderOptions, Rendering, in_pool};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Samples a pixel of a measurement.
const SAMPLES: u32 = 8;

/// One measurement.
pub struct Row {
    /// What grows, and how large it is.
    what: &'static str,
    size: u64,
    load_s: f64,
    build_s: f64,
    /// Processor time.
    render_cpu_s: f64,
    render_s: f64,
    rays: u64,
    /// Memory of what rays walk through.
    bytes: u64,
}

/// How a measurement differs from the others.
struct Case {
    what: &'static str,
    size: u64,
    width: u32,
    depth: u32,
    threads: Option<usize>,
}

/// Measures all; `most` bounds the triangles.
///
/// # Errors
/// If the system's temporary folder takes no files.
pub fn measure(setup: &Setup, most: u64) -> Result<Vec<Row>> {
    let generated = Generated::new()?;
    let case =
        |what, size| Case { what, size, width: setup.width, depth: setup.depth, threads: setup.threads };
    let mut rows = Vec::new();
    for triangles in decades(1_000, 10_000_000).filter(|&n| n <= most) {
        let sides = ((triangles / 4) as f64).sqrt().round().max(3.0) as u32;
        let rings = (triangles / 2 / u64::from(sides)) as u32;
        generated.write("model.ply", &models::torus(rings, sides))?;
        let scene = generated.write("growing.toml", models::MODEL.as_bytes())?;
        rows.push(row(&scene, &case("triangles", 2 * u64::from(rings) * u64::from(sides)))?);
    }
    for lamps in decades(1, 100_000) {
        let scene = generated.write("growing.toml", rooms::hall(lamps as u32).as_bytes())?;
        rows.push(row(&scene, &case("lights", lamps))?);
    }
    let room = generated.write("growing.toml", rooms::slit().as_bytes())?;
    for width in [64, 128, 256, 512, 1024] {
        rows.push(row(&room, &Case { width, ..case("pixels", u64::from(width * width)) })?);
    }
    for depth in [1, 2, 4, 8, 16, 32, 64] {
        rows.push(row(&room, &Case { depth, ..case("depth", u64::from(depth)) })?);
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    for threads in (0..).map(|i| 1 << i).take_while(|&n| n <= cores) {
        rows.push(row(&room, &Case { threads: Some(threads), ..case("threads", threads as u64) })?);
    }
    Ok(rows)
}

fn decades(from: u64, to: u64) -> impl Iterator<Item = u64> {
    std::iter::successors(Some(from), |n| n.checked_mul(10)).take_while(move |&n| n <= to)
}

fn row(scene: &Path, case: &Case) -> Result<Row> {
    eprintln!("{} {}", case.what, case.size);
    in_pool(case.threads, || {
        let start = Instant::now();
        let loaded = load(scene, &LoadOptions::default())?.scene;
        let load_s = start.elapsed().as_secs_f64();
        let options = CompileOptions { shading: loaded.settings.shading(), ..CompileOptions::default() };
        let (compiled, report) = compile(&loaded, &options)?;
        let camera = choose_camera(&loaded, None)?;
        let options =
            RenderOptions::default().size(case.width, case.width).samples(SAMPLES).max_depth(case.depth);
        let mut rendering = Rendering::new(Arc::new(compiled), camera, options)?;
        rendering.run();
        let statistics = rendering.statistics();
        Ok(Row {
            what: case.what,
            size: case.size,
            load_s,
            build_s: report.build_s,
            render_cpu_s: statistics.render_cpu_s,
            render_s: statistics.render_s,
            rays: statistics.rays,
            bytes: report.bytes,
        })
    })?
}

/// One line a measurement.
pub fn csv(rows: &[Row]) -> String {
    let mut out = "what,size,load_s,build_s,render_s,render_cpu_s,rays,bytes\n".to_string();
    for r in rows {
        out += &format!(
            "{},{},{},{},{},{},{},{}\n",
            r.what, r.size, r.load_s, r.build_s, r.render_s, r.render_cpu_s, r.rays, r.bytes
        );
    }
    out
}

/// The same for reading.
pub fn markdown(rows: &[Row]) -> String {
    let mut out =
        "| what | size | load s | build s | render, wall s | render, CPU s | M rays/s of CPU | MiB |\n\
                   |---|---:|---:|---:|---:|---:|---:|---:|\n"
            .to_string();
    for r in rows {
        let speed = r.rays as f64 / r.render_cpu_s.max(1e-9) / 1e6;
        out += &format!(
            "| {} | {} | {:.3} | {:.3} | {:.3} | {:.3} | {speed:.2} | {:.1} |\n",
            r.what,
            r.size,
            r.load_s,
            r.build_s,
            r.render_s,
            r.render_cpu_s,
            r.bytes as f64 / f64::from(1 << 20)
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_powers_of_ten() {
        assert_eq!(decades(1, 1000).collect::<Vec<_>>(), [1, 10, 100, 1000]);
    }

    #[test]
    fn a_small_hall_is_measured() {
        let generated = Generated::new().unwrap_or_else(|e| panic!("{e}"));
        let scene =
            generated.write("growing.toml", rooms::hall(3).as_bytes()).unwrap_or_else(|e| panic!("{e}"));
        let case = Case { what: "lights", size: 3, width: 16, depth: 4, threads: Some(1) };
        let row = row(&scene, &case).unwrap_or_else(|e| panic!("{e}"));
        assert!(row.rays > 16 * 16 && row.bytes > 0, "{} rays, {} bytes", row.rays, row.bytes);
        assert_eq!(csv(&[row]).lines().count(), 2);
    }
}
