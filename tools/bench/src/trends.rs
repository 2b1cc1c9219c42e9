//! Trends of the ladders: convergence rates, and speed-ups over another build at equal error.

use crate::measure::Point;
use oscura::error::{Error, Result};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// CPU times and errors of each scene, by ascending samples.
pub type Ladders = BTreeMap<String, Vec<[f64; 2]>>;

/// Reads the `time-to-error.csv` of another build.
///
/// # Errors
/// An input error if it is something else.
pub fn read(path: &PathBuf) -> Result<Ladders> {
    let text = std::fs::read_to_string(path)
        .map_err(|e| Error::usage(format!("{}: can't be read: {e}", path.display())))?;
    let mut ladders = Ladders::new();
    for (i, line) in text.lines().enumerate().skip(1) {
        let point = parse(line).ok_or_else(|| {
            Error::usage(format!("{}: line {} is not of a time-to-error.csv", path.display(), i + 1))
        })?;
        ladders.entry(point.0).or_default().push(point.1);
    }
    Ok(ladders)
}

/// A line of such a file: the scene, its CPU time and error.
fn parse(line: &str) -> Option<(String, [f64; 2])> {
    let (scene, numbers) = line.strip_prefix('"')?.rsplit_once("\",")?;
    let numbers: Vec<f64> = numbers.split(',').map(|n| n.parse().ok()).collect::<Option<_>>()?;
    let [_samples, _wall, cpu_s, _rays, rel_mse, ..] = numbers[..] else { return None };
    Some((scene.replace("\"\"", "\""), [cpu_s, rel_mse]))
}

/// One line per scene.
pub fn markdown(points: &[Point], earlier: Option<&Ladders>) -> String {
    let mut out = "| scene | slope of the error over samples |".to_string();
    out +=
        if earlier.is_some() { " as soon as the other build |\n|---|---:|---:|\n" } else { "\n|---|---:|\n" };
    for of_scene in points.chunk_by(|a, b| a.scene == b.scene) {
        let scene = &of_scene[0].scene;
        let errors: Vec<[f64; 2]> = of_scene.iter().map(|p| [f64::from(p.samples), p.rel_mse]).collect();
        let times: Vec<[f64; 2]> = of_scene.iter().map(|p| [p.render_cpu_s, p.rel_mse]).collect();
        out += &format!("| {scene} | {} |", shown(slope(&errors)));
        if let Some(earlier) = earlier {
            out += &format!(" {} |", shown(earlier.get(scene).and_then(|before| gain(before, &times))));
        }
        out += "\n";
    }
    out
}

fn shown(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_string(), |value| format!("{value:.2}"))
}

/// Logarithms of the points with positive values.
fn logarithms(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let positive = points.iter().filter(|[x, y]| *x > 0.0 && *y > 0.0);
    positive.map(|[x, y]| [x.ln(), y.ln()]).collect()
}

/// The convergence rate: the exponent of the power law through the points, by least squares of the logarithms: -1 for
/// independent samples.
fn slope(points: &[[f64; 2]]) -> Option<f64> {
    let points = logarithms(points);
    let n = points.len() as f64;
    let [mx, my] = [0, 1].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / n);
    let covariance: f64 = points.iter().map(|[x, y]| (x - mx) * (y - my)).sum();
    let variance: f64 = points.iter().map(|[x, _]| (x - mx) * (x - mx)).sum();
    (points.len() >= 2 && variance > 0.0).then(|| covariance / variance)
}

/// The speed-up at equal error: the geometric mean over the earlier points whose errors lie between the present ones.
fn gain(before: &[[f64; 2]], now: &[[f64; 2]]) -> Option<f64> {
    let now = logarithms(now);
    let gains: Vec<f64> = (logarithms(before).iter())
        .filter_map(|[time, error]| {
            let step = now.windows(2).find(|step| step[0][1] >= *error && *error >= step[1][1])?;
            let [[t0, e0], [t1, e1]] = [step[0], step[1]];
            let part = if e0 > e1 { (e0 - error) / (e0 - e1) } else { 0.0 };
            Some(time - (t0 + part * (t1 - t0)))
        })
        .collect();
    (!gains.is_empty()).then(|| (gains.iter().sum::<f64>() / gains.len() as f64).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_laws_have_their_exponent() {
        let points: Vec<[f64; 2]> = (0..5).map(|i| 4f64.powi(i)).map(|n| [n, 3.0 * n.powf(-1.5)]).collect();
        assert!((slope(&points).unwrap() + 1.5).abs() < 1e-12);
        assert_eq!(slope(&points[..1]), None);
        assert_eq!(slope(&[[1.0, 0.0], [2.0, -1.0]]), None);
    }

    #[test]
    fn half_the_error_at_the_same_time_is_twice_as_soon() {
        let law = |scale: f64| (0..5).map(|i| 4f64.powi(i)).map(|t| [t, scale / t]).collect::<Vec<_>>();
        assert!((gain(&law(1.0), &law(0.5)).unwrap() - 2.0).abs() < 1e-9);
        assert_eq!(gain(&law(1.0), &law(1e-6)), None);
    }

    #[test]
    fn written_lines_are_read() {
        let line = "\"a \"\"b\"\", c\",4,0.5,0.25,100,0.125,0.001";
        assert_eq!(parse(line), Some(("a \"b\", c".to_string(), [0.25, 0.125])));
        assert_eq!(parse("scene,samples"), None);
        assert_eq!(parse("\"a\",1,2"), None);
    }
}
