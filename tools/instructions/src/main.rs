//! A performance regression test that is independent of machine load: counts the instructions of small renders with callgrind,
//! and compares them with recorded numbers.
//!
//! ```text
//! oscura-instructions [PROGRAM] [--bound RATIO]     exit code 1 if a scene takes more than RATIO (1.01) of its number
//! oscura-instructions [PROGRAM] --record            writes the numbers to counts.txt
//! ```
//!
//! Without PROGRAM it is target/release/oscura. The numbers hold for one compiler, one valgrind and the instruction sets of
//! callgrind's virtual CPU (AVX2, on any machine); the file records these, and a difference is reported without failing.
//! Loading, building and rendering are counted, on one thread. See README.md.

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

/// Options of all renders.
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

const USAGE: &str = "usage: oscura-instructions [PROGRAM] [--bound RATIO | --record]";

/// Command-line arguments.
#[derive(Debug, PartialEq)]
struct Arguments {
    /// The program to count.
    program: PathBuf,
    task: Task,
}

#[derive(Debug, PartialEq)]
enum Task {
    /// Record the numbers.
    Record,
    /// Maximum ratio to the recorded numbers.
    Compare(f64),
}

impl Arguments {
    fn parse(words: &[&str]) -> Result<Arguments> {
        let (program, options) = match words {
            [first, rest @ ..] if !first.starts_with("--") => (PathBuf::from(first), rest),
            all => (root().join("target/release/oscura"), all),
        };
        let task = match options {
            [] => Task::Compare(1.01),
            ["--record"] => Task::Record,
            ["--bound", bound] => {
                let ratio = bound.parse().ok().filter(|ratio: &f64| ratio.is_finite() && *ratio > 0.0);
                Task::Compare(ratio.ok_or_else(|| format!("'{bound}' is no ratio above 0"))?)
            }
            _ => return Err(USAGE.into()),
        };
        Ok(Arguments { program, task })
    }
}

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    run(&words).unwrap_or_else(|error| {
        eprintln!("{error}");
        ExitCode::from(2)
    })
}

fn run(words: &[&str]) -> Result<ExitCode> {
    let Arguments { program, task } = Arguments::parse(words)?;
    let program = program.canonicalize().map_err(|e| {
        format!("{}: {e}; `cargo build --release --bin oscura` makes the program", program.display())
    })?;
    match task {
        Task::Record => record(&program),
        Task::Compare(bound) => compare(&program, bound),
    }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn recorded() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("counts.txt")
}

/// Counts all scenes and records the numbers.
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

/// Counts all scenes and compares with the recorded numbers. Differences of other tool versions are shown without failing.
fn compare(program: &Path, bound: f64) -> Result<ExitCode> {
    let path = recorded();
    let text = std::fs::read_to_string(&path)
        .map_err(|e| format!("{}: {e}; `oscura-instructions --record` writes the numbers", path.display()))?;
    let record = Record::parse(&text)?;
    let now = made_with()?;
    let is_same = now == record.made_with;
    if !is_same {
        println!(
            "recorded with {}\nrun with      {now}: ratios tell less, and fail nothing",
            record.made_with
        );
    }
    println!("{:<28} {:>13} {:>13} ratio", "scene", "recorded", "now");
    let mut more = 0;
    for scene in SCENES {
        let before =
            record.count(scene).ok_or_else(|| format!("{scene} is not recorded; run with --record"))?;
        let count = count(program, scene)?;
        let ratio = count as f64 / before as f64;
        let verdict = if ratio > bound { format!("  more than {bound}") } else { String::new() };
        println!("{scene:<28} {before:>13} {count:>13} {ratio:.4}{verdict}");
        more += u32::from(ratio > bound);
    }
    Ok(ExitCode::from(u8::from(is_same && more > 0)))
}

/// Instructions of a render.
fn count(program: &Path, scene: &str) -> Result<u64> {
    let folder = tempfile::tempdir()?;
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(program)
        .args(["render", scene])
        .args(COMMON)
        .arg("-o")
        .arg(folder.path().join("a.exr"))
        .current_dir(root())
        .stdout(Stdio::null())
        .output()
        .map_err(|e| format!("valgrind: {e}"))?;
    let log = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() {
        return Err(format!("{scene}: {log}").into());
    }
    let number = log.lines().find_map(|line| line.split("Collected : ").nth(1));
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

#[test]
fn arguments_are_parsed() {
    let built = root().join("target/release/oscura");
    let parsed = |words: &[&str]| Arguments::parse(words).ok();
    assert_eq!(parsed(&[]), Some(Arguments { program: built.clone(), task: Task::Compare(1.01) }));
    assert_eq!(parsed(&["--record"]), Some(Arguments { program: built, task: Task::Record }));
    let other = Arguments { program: "a".into(), task: Task::Compare(1.0) };
    assert_eq!(parsed(&["a", "--bound", "1"]), Some(other));
    for wrong in [&["--bound"][..], &["--bound", "nan"], &["a", "b"], &["--record", "--bound", "1"]] {
        assert_eq!(parsed(wrong), None, "{wrong:?}");
    }
}
