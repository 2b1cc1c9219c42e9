//! A table of render times.

use crate::entries::Entry;
use crate::render::Shot;
use std::fmt::Write;

/// Statistics of a picture.
pub struct Row {
    entry: &'static Entry,
    size: [u32; 2],
    samples: u32,
    /// At the size and sample count of its scene, so that it is comparable to the thesis's.
    is_whole: bool,
    load_s: f64,
    render_s: f64,
    render_cpu_s: f64,
}

impl Row {
    /// The row of a picture.
    pub fn new(entry: &'static Entry, shot: &Shot, is_whole: bool) -> Row {
        Row {
            entry,
            size: [shot.picture.film().width(), shot.picture.film().height()],
            samples: shot.samples,
            is_whole,
            load_s: shot.load_s,
            render_s: shot.render_s,
            render_cpu_s: shot.render_cpu_s,
        }
    }
}

/// Two runs of one scene.
pub struct Threads {
    /// The scene.
    pub scene: &'static str,
    /// Threads of the second run.
    pub threads: usize,
    /// Seconds with one thread, and with all.
    pub seconds: [f64; 2],
    /// Are the pictures bitwise identical?
    pub is_equal: bool,
}

/// A markdown table, with the total time.
pub fn markdown(rows: &[Row], threads: Option<&Threads>) -> String {
    let mut text = String::from(
        "| Picture | Shows | Pixels | Samples | Load s | Render s | Core s | Thesis, one core |\n\
         |---|---|---|---:|---:|---:|---:|---:|\n",
    );
    for r in rows {
        let thesis = r.entry.thesis_s.filter(|_| r.is_whole).map_or(String::new(), |t| format!("{:.0} s", t));
        let _ = writeln!(
            text,
            "| {} | {} | {} x {} | {} | {:.2} | {:.1} | {:.1} | {thesis} |",
            r.entry.name(),
            r.entry.shows,
            r.size[0],
            r.size[1],
            r.samples,
            r.load_s,
            r.render_s,
            r.render_cpu_s,
        );
    }
    let sum = |value: fn(&Row) -> f64| rows.iter().map(value).sum::<f64>();
    let _ = writeln!(
        text,
        "| all | | | | {:.2} | {:.1} | {:.1} | |",
        sum(|r| r.load_s),
        sum(|r| r.render_s),
        sum(|r| r.render_cpu_s),
    );
    if let Some(t) = threads {
        let [one, many] = t.seconds;
        let verdict = if t.is_equal { "the same in every bit" } else { "DIFFERENT" };
        let _ = writeln!(
            text,
            "\n`scenes/{}` with 1 thread: {one:.2} s, with {}: {many:.2} s ({:.2} times the speed); the pictures are \
             {verdict}.",
            t.scene,
            t.threads,
            one / many.max(1e-9),
        );
    }
    text
}
