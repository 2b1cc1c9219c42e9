//! Time and memory of a large mesh before its first ray, by stage.

use crate::{peak, resident};
use cpu_time::ProcessTime;
use oscura::compile::{BvhPolicy, CompileOptions, compile};
use oscura::load::{LoadOptions, load};
use std::path::Path;
use std::time::Instant;

/// State at the start of a stage.
struct Begin {
    wall: Instant,
    cpu: ProcessTime,
    resident: u64,
}

impl Begin {
    fn now() -> Result<Begin, String> {
        // Resets the peak resident size (Linux, `man 5 proc`).
        std::fs::write("/proc/self/clear_refs", "5").map_err(|e| format!("/proc/self/clear_refs: {e}"))?;
        Ok(Begin { wall: Instant::now(), cpu: ProcessTime::now(), resident: resident()? })
    }

    /// A row of the table: time, and bytes per triangle relative to the start, at the peak and at the end.
    fn end(self, name: &str, triangles: u64) -> Result<(), String> {
        let (wall, cpu) = (self.wall.elapsed().as_secs_f64(), self.cpu.elapsed().as_secs_f64());
        let each = |bytes: u64| (bytes as f64 - self.resident as f64) / triangles.max(1) as f64;
        println!("| {name} | {wall:.3} | {cpu:.3} | {:.0} | {:.0} |", each(peak()?), each(resident()?));
        Ok(())
    }
}

/// Loads and compiles a file twice, for a fast and a high-quality BVH, and prints a table.
pub fn table(file: &Path) -> Result<(), String> {
    println!("| stage | s | s of processor | bytes per triangle at the peak | left |\n|---|---|---|---|---|");
    let begin = Begin::now()?;
    let scene = load(file, &LoadOptions::default()).map_err(|e| e.to_string())?.scene;
    let triangles: u64 = scene.meshes.iter().map(|m| m.triangles.len() as u64).sum();
    begin.end("load", triangles)?;
    let begin = Begin::now()?;
    let problems = scene.validate();
    begin.end(&format!("validate once more, {} problems", problems.len()), triangles)?;
    for (name, tree) in [("fast", BvhPolicy::Fast), ("full", BvhPolicy::Full)] {
        let options = CompileOptions { bvh: tree, ..CompileOptions::default() };
        let begin = Begin::now()?;
        let (compiled, report) = compile(&scene, &options).map_err(|e| e.to_string())?;
        let stats = compiled.accel.stats();
        let rest = report.build_s - stats.build_s;
        let bytes = stats.bytes as f64 / triangles.max(1) as f64;
        let what = format!(
            "compile: {name} tree {:.3} s, {bytes:.0} bytes per triangle; else {rest:.3} s",
            stats.build_s
        );
        begin.end(&what, triangles)?;
    }
    println!("\n{triangles} triangles");
    Ok(())
}
