//! Tests with requirements that this machine lacks: each reports it in one line, and fails where it is required.

use std::fs::OpenOptions;
use std::io::Write;
use std::path::Path;

/// Reports that the calling test is skipped because `need` is missing; `reason` is a sentence about it.
///
/// The line goes to standard error past the test harness, which hides the output of tests that pass, and is added to
/// `skipped.txt` in the folder of temporary files of Cargo's target directory, which `.ci/run` shows at its end.
///
/// # Panics
/// If the environment variable `OSCURA_REQUIRE`, a list with commas, has `need` or `all`.
#[track_caller]
pub fn skip(need: &str, reason: &str) {
    let required = std::env::var("OSCURA_REQUIRE").unwrap_or_default();
    let is_required = required.split(',').map(str::trim).any(|name| name == need || name == "all");
    assert!(!is_required, "OSCURA_REQUIRE={required}, but {reason}");
    let test = std::thread::current().name().unwrap_or("a test").to_string();
    let line = format!("skipped ({need}): {}::{test}: {reason}\n", env!("CARGO_CRATE_NAME"));
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("skipped.txt");
    let list = OpenOptions::new().create(true).append(true).open(file);
    // One call each, so that lines of parallel tests stay intact. Errors of writing the report are ignored.
    let _ = std::io::stderr().write_all(line.as_bytes());
    let _ = list.and_then(|mut list| list.write_all(line.as_bytes()));
}
