//! `oscura-stress`: stress tests of ray intersection, with a table of the results. See README.md.

mod cases;

use cases::{CASES, Row};
use std::process::ExitCode;

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let quick = match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => false,
        ["--quick"] => true,
        _ => {
            eprintln!("usage: oscura-stress [--quick]");
            return ExitCode::from(2);
        }
    };
    // The fraction of the full number of tries.
    let effort = if quick { 0.1 } else { 1.0 };
    println!("| case | tried | wrong | worst |\n|---|---|---|---|");
    let mut wrong = 0;
    for case in CASES {
        for Row { what, tried, wrong: bad, worst } in case(effort) {
            println!("| {what} | {tried} | {bad} | {worst} |");
            wrong += bad;
        }
    }
    if wrong == 0 { ExitCode::SUCCESS } else { ExitCode::from(1) }
}
