//! Results as CSV, markdown and SVG.

use crate::measure::Point;
use std::fmt::Write;

const COLORS: [&str; 6] = ["#1b6ca8", "#c0392b", "#2e8b57", "#8e44ad", "#b9770e", "#34495e"];
const SIZE: (f64, f64) = (720.0, 480.0);
const MARGIN: f64 = 60.0;

/// One line per measurement.
pub fn csv(points: &[Point]) -> String {
    let mut out = "scene,samples,render_s,render_cpu_s,rays,relmse,reference_relmse\n".to_string();
    for p in points {
        // Quotes double inside quotes.
        let scene = p.scene.replace('"', "\"\"");
        out += &format!(
            "\"{scene}\",{},{},{},{},{},{}\n",
            p.samples, p.render_s, p.render_cpu_s, p.rays, p.rel_mse, p.reference_rel_mse
        );
    }
    out
}

/// A markdown table.
pub fn markdown(points: &[Point]) -> String {
    let mut out =
        "| scene | samples | wall s | CPU s | M rays/s of CPU | relMSE |\n|---|---:|---:|---:|---:|---:|\n"
            .to_string();
    for p in points {
        let speed = p.rays as f64 / p.render_cpu_s.max(1e-9) / 1e6;
        out += &format!(
            "| {} | {} | {:.3} | {:.3} | {speed:.2} | {:.6} |\n",
            p.scene, p.samples, p.render_s, p.render_cpu_s, p.rel_mse
        );
    }
    out
}

/// A log-log plot of error over CPU time, which other load changes little, one line per scene. Points without a logarithm are
/// omitted.
pub fn svg(points: &[Point]) -> String {
    let shown: Vec<&Point> = points.iter().filter(|p| p.render_cpu_s > 0.0 && p.rel_mse > 0.0).collect();
    let (x0, x1) = decades(shown.iter().map(|p| p.render_cpu_s));
    let (y0, y1) = decades(shown.iter().map(|p| p.rel_mse));
    let x = |v: f64| MARGIN + (v.log10() - x0) / (x1 - x0) * (SIZE.0 - 2.0 * MARGIN);
    let y = |v: f64| SIZE.1 - MARGIN - (v.log10() - y0) / (y1 - y0) * (SIZE.1 - 2.0 * MARGIN);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        SIZE.0, SIZE.1
    );
    let mut line = |x1: f64, y1: f64, x2: f64, y2: f64, label: String, at: (f64, f64)| {
        let _ = writeln!(
            out,
            "<path d=\"M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}\" stroke=\"#ccc\"/><text x=\"{:.1}\" y=\"{:.1}\">{label}</text>",
            at.0, at.1
        );
    };
    for d in x0 as i32..=x1 as i32 {
        let at = x(10f64.powi(d));
        line(
            at,
            MARGIN,
            at,
            SIZE.1 - MARGIN,
            format!("{} s", 10f64.powi(d)),
            (at - 12.0, SIZE.1 - MARGIN + 16.0),
        );
    }
    for d in y0 as i32..=y1 as i32 {
        let at = y(10f64.powi(d));
        line(MARGIN, at, SIZE.0 - MARGIN, at, format!("{}", 10f64.powi(d)), (4.0, at + 4.0));
    }
    out += &format!(
        "<text x=\"{MARGIN}\" y=\"20\">relMSE over seconds of processor time for rendering</text>\n"
    );
    let mut names: Vec<&str> = shown.iter().map(|p| p.scene.as_str()).collect();
    names.dedup();
    for (i, name) in names.iter().enumerate() {
        let color = COLORS[i % COLORS.len()];
        let path: Vec<String> = shown
            .iter()
            .filter(|p| p.scene == *name)
            .map(|p| format!("{:.1} {:.1}", x(p.render_cpu_s), y(p.rel_mse)))
            .collect();
        out += &format!(
            "<path d=\"M{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/>\n",
            path.join("L")
        );
        let escaped = name.replace('&', "&amp;").replace('<', "&lt;");
        let row = MARGIN + 16.0 * (i + 1) as f64;
        out += &format!("<text x=\"{}\" y=\"{row}\" fill=\"{color}\">{escaped}</text>\n", SIZE.0 - 220.0);
    }
    out + "</svg>\n"
}

/// The powers of ten around all values.
fn decades(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for v in values {
        low = low.min(v.log10().floor());
        high = high.max(v.log10().ceil());
    }
    if low > high { (0.0, 1.0) } else { (low, high.max(low + 1.0)) }
}
