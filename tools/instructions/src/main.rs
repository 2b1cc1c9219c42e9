//! A gate for speed that a busy machine doesn't fool: counts the instructions that small pictures take, by callgrind, and
//! compares them with recorded numbers.
//!
//! ```text
//! oscura-instructions PROGRAM [--bound RATIO]     exit code 1 if a scene takes more than RATIO (1.01) of its number
//! oscura-instructions PROGRAM --record            writes the numbers
//! ```
//!
//! The numbers hold for one toolchain and for what callgrind's processor can do (AVX2, whatever the machine has); the file
//! says which. Reading, building and rendering count, on one thread.

mod record;

use record::Record;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Scenes of the repository: diffuse light, glass and metal, textures, plastics, many lights, all of glTF, sky.
const SCENES: &[&str] = &[
    "assets/cornell-box.gltf",
    "assets/reed.gltf",
    "scenes/cornell-spheres.toml",
    "scenes/many-lights.toml",
    "scenes/materials.toml",
    "scenes/plastics.toml",
    "scenes/sky.toml",
    "scenes/triplanar.toml",
];

/// What every picture is rendered with.
const COMMON: &[&str] = &[
    "--width",
    "48",
    "--height",
    "48",
    "--spp",
    "16",
    "--filter",
    "box",
    "--float",
    "--quiet",
    "--threads",
    "1",
];

const USAGE: &str = "usage: oscura-instructions PROGRAM [--bound RATIO | --record]";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match words[..] {
        [program] => compare(Path::new(program), 1.01),
        [program, "--bound", bound] => match bound.parse() {
            Ok(bound) => compare(Path::new(program), bound),
            Err(_) => Err(format!("'{bound}' is no number").into()),
        },
        [program, "--record"] => record(Path::new(program)),
        _ => {
            eprintln!("{USAGE}");
            return ExitCode::from(2);
        }
    };
    result.unwrap_or_else(|error| {
        eprintln!("{error}");
        ExitCode::from(2)
    })
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn recorded() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("counts.txt")
}

/// Counts all scenes and writes the numbers.
fn record(program: &Path) -> Result<ExitCode> {
    let mut record = Record { made_with: made_with()?, counts: Vec::new() };
    for scene in SCENES {
        let count = count(program, scene)?;
        println!("{scene} {count}");
        record.counts.push((scene.to_string(), count));
    }
    std::fs::write(recorded(), record.to_text())?;
    Ok(ExitCode::SUCCESS)
}

/// Counts all scenes and prints how they stand to the recorded numbers.
fn compare(program: &Path, bound: f64) -> Result<ExitCode> {
    let record = Record::parse(&std::fs::read_to_string(recorded())?)?;
    let now = made_with()?;
    if now != record.made_with {
        println!("recorded with {}\nrun with      {now}: ratios mean less", record.made_with);
    }
    let mut slower = 0;
    for scene in SCENES {
        let before =
            record.count(scene).ok_or_else(|| format!("{scene} is not recorded; run with --record"))?;
        let count = count(program, scene)?;
        let ratio = count as f64 / before as f64;
        let verdict = if ratio > bound { "  MORE THAN ALLOWED" } else { "" };
        println!("{scene:<28} {before:>13} {count:>13} {ratio:.4}{verdict}");
        slower += u32::from(ratio > bound);
    }
    Ok(ExitCode::from(u8::from(slower > 0)))
}

/// Instructions that a picture takes.
fn count(program: &Path, scene: &str) -> Result<u64> {
    let folder = tempfile::tempdir()?;
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(program.canonicalize()?)
        .args(["render", scene])
        .args(COMMON)
        .arg("-o")
        .arg(folder.path().join("a.exr"))
        .current_dir(root())
        .stdout(Stdio::null())
        .output()
        .map_err(|e| format!("valgrind: {e}"))?;
    let said = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() {
        return Err(format!("{scene}: {said}").into());
    }
    let number = said.lines().find_map(|line| line.split("Collected : ").nth(1));
    Ok(number.ok_or("callgrind tells no number")?.trim().parse()?)
}

/// Versions of the compiler and of valgrind.
fn made_with() -> Result<String> {
    let version = |program: &str| -> Result<String> {
        let output =
            Command::new(program).arg("--version").output().map_err(|e| format!("{program}: {e}"))?;
        Ok(String::from_utf8(output.stdout)?.trim().to_string())
    };
    Ok(format!("{}, {}", version("rustc")?, version("valgrind")?))
}
