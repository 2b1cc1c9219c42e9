//! Times `load` of the same mesh as PLY, OBJ and GLB against the parser alone and against copying the file into memory. Every
//! measurement runs in a process of its own, to measure its peak memory; the minimum over all rounds counts.
//!
//! `--stages` prints the stages from a single file to its first ray.
//!
//! ```text
//! oscura-loading FOLDER [ROUNDS]     FOLDER holds mesh.ply, mesh.obj and mesh.glb (oscura-assets mesh); 5 rounds
//! oscura-loading --stages FILE       load, validate, compile: seconds and bytes per triangle
//! ```

mod parsers;
mod stages;

use oscura::load::{LoadOptions, load};
use std::path::Path;
use std::process::{Command, ExitCode};
use std::time::Instant;

/// A way to read a file.
const READINGS: [(&str, &str); 8] = [
    ("mesh.ply", "copy"),
    ("mesh.ply", "ply-rs"),
    ("mesh.ply", "oscura"),
    ("mesh.obj", "copy"),
    ("mesh.obj", "tobj"),
    ("mesh.obj", "oscura"),
    ("mesh.glb", "copy"),
    ("mesh.glb", "oscura"),
];

/// A measurement.
struct Measured {
    seconds: f64,
    /// Peak resident size, in bytes.
    peak: u64,
    /// Size of the result in memory, in bytes.
    result: u64,
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match words[..] {
        ["--one", reader, file] => one(reader, Path::new(file)),
        ["--stages", file] => stages::table(Path::new(file)),
        [folder] => table(Path::new(folder), 5),
        [folder, rounds] => match rounds.parse() {
            Ok(n @ 1..=1000) => table(Path::new(folder), n),
            _ => Err(format!("'{rounds}' is no number of rounds")),
        },
        _ => Err("usage: oscura-loading FOLDER [ROUNDS] | --stages FILE".to_string()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

/// Reads one file in this process and prints seconds, peak and result size.
fn one(reader: &str, file: &Path) -> Result<(), String> {
    let start = Instant::now();
    let result = match reader {
        "copy" => std::fs::read(file).map_err(|e| e.to_string())?.len() as u64,
        "ply-rs" => parsers::ply(file)?,
        "tobj" => parsers::obj(file)?,
        _ => {
            let scene = load(file, &LoadOptions::default()).map_err(|e| e.to_string())?.scene;
            let seconds = start.elapsed().as_secs_f64();
            let size = |m: &oscura::scene::Mesh| m.positions.len() + m.normals.len() + m.triangles.len();
            let result = scene.meshes.iter().map(|m| size(m) as u64 * 12).sum();
            return report(&Measured { seconds, peak: peak()?, result });
        }
    };
    report(&Measured { seconds: start.elapsed().as_secs_f64(), peak: peak()?, result })
}

fn report(m: &Measured) -> Result<(), String> {
    println!("{} {} {}", m.seconds, m.peak, m.result);
    Ok(())
}

/// Peak resident size of this process so far, in bytes (Linux).
fn peak() -> Result<u64, String> {
    status("VmHWM:")
}

/// Resident size of this process, in bytes (Linux).
fn resident() -> Result<u64, String> {
    status("VmRSS:")
}

fn status(key: &str) -> Result<u64, String> {
    let status =
        std::fs::read_to_string("/proc/self/status").map_err(|e| format!("/proc/self/status: {e}"))?;
    let line = status.lines().find_map(|l| l.strip_prefix(key));
    let kib = line.and_then(|l| l.trim().trim_end_matches(" kB").parse::<u64>().ok());
    kib.map(|k| k * 1024).ok_or_else(|| format!("/proc/self/status has no {key}"))
}

/// Runs all measurements `rounds` times and prints the fastest of each.
fn table(folder: &Path, rounds: usize) -> Result<(), String> {
    let mut best: Vec<Option<Measured>> = READINGS.iter().map(|_| None).collect();
    for _ in 0..rounds {
        for (slot, (file, reader)) in best.iter_mut().zip(READINGS) {
            let measured = in_own_process(reader, &folder.join(file))?;
            if slot.as_ref().is_none_or(|b| measured.seconds < b.seconds) {
                *slot = Some(measured);
            }
        }
    }
    println!("| File | Read by | s | peak MB | peak / mesh |\n|---|---|---|---|---|");
    // The final result of `oscura` is the mesh.
    let mesh = best.iter().zip(READINGS).find(|(_, r)| r.1 == "oscura").and_then(|(b, _)| b.as_ref());
    let mesh = mesh.map_or(1, |m| m.result) as f64;
    for (measured, (file, reader)) in best.iter().zip(READINGS) {
        let Some(m) = measured else { continue };
        let (megabytes, ratio) = (m.peak as f64 / 1e6, m.peak as f64 / mesh);
        println!("| {file} | {reader} | {:.3} | {megabytes:.0} | {ratio:.1} |", m.seconds);
    }
    Ok(())
}

fn in_own_process(reader: &str, file: &Path) -> Result<Measured, String> {
    let program = std::env::current_exe().map_err(|e| format!("this program: {e}"))?;
    let output = Command::new(program).args(["--one", reader]).arg(file).output();
    let output = output.map_err(|e| format!("this program: {e}"))?;
    if !output.status.success() {
        return Err(format!("{}: {}", file.display(), String::from_utf8_lossy(&output.stderr)));
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let words: Vec<&str> = text.split_whitespace().collect();
    let [seconds, peak, result] = words[..] else { return Err(format!("unexpected output: {text}")) };
    let parsed = (seconds.parse(), peak.parse(), result.parse());
    let (Ok(seconds), Ok(peak), Ok(result)) = parsed else {
        return Err(format!("unexpected output: {text}"));
    };
    Ok(Measured { seconds, peak, result })
}
