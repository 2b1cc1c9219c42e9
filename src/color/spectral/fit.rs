//! Finds the sigmoid of a colour.

use super::sigmoid::place;
use super::wavelengths::quadrature;

/// Good enough: relative to the colour's brightest channel.
const WANTED: f64 = 1e-6;
const MOST_STEPS: usize = 60;
/// Larger ones make steps from one wavelength to the next.
const MOST_COEFFICIENT: f64 = 300.0;

/// What a sigmoid looks like in daylight, and its derivatives by the coefficients.
fn look([a, b, c]: [f64; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    let (mut rgb, mut slopes) = ([0.0; 3], [[0.0; 3]; 3]);
    for (nm, weight) in quadrature() {
        let t = place(*nm);
        let x = (a * t + b) * t + c;
        let s = (1.0 + x * x).sqrt();
        let tail = 0.5 / (s * (s + x.abs()));
        let value = if x < 0.0 { tail } else { 1.0 - tail };
        let slope = 0.5 / (s * s * s);
        for i in 0..3 {
            rgb[i] += weight[i] * value;
            let by_c = weight[i] * slope;
            slopes[i][0] += by_c * t * t;
            slopes[i][1] += by_c * t;
            slopes[i][2] += by_c;
        }
    }
    (rgb, slopes)
}

fn error(found: [f64; 3], wanted: [f64; 3], scale: f64) -> f64 {
    (0..3).map(|i| ((found[i] - wanted[i]) * scale).powi(2)).sum::<f64>().sqrt()
}

/// The coefficients of the sigmoid that looks like a colour within 0..1 in daylight, and how far it is from it relative to the brightest
/// channel: Gauss and Newton's method, damped (Levenberg, Marquardt), from a start.
pub(super) fn fit(rgb: [f64; 3], start: [f64; 3]) -> ([f64; 3], f64) {
    let scale = 1.0 / rgb.into_iter().fold(1e-9, f64::max);
    let mut best = start;
    let (mut found, mut slopes) = look(best);
    let (mut now, mut damping) = (error(found, rgb, scale), 1e-6);
    for _ in 0..MOST_STEPS {
        if now < WANTED {
            break;
        }
        let Some(step) = step(&slopes, found, rgb, damping) else { break };
        let next = [0, 1, 2].map(|i| (best[i] - step[i]).clamp(-MOST_COEFFICIENT, MOST_COEFFICIENT));
        let (found_next, slopes_next) = look(next);
        let error_next = error(found_next, rgb, scale);
        if error_next < now {
            (best, found, slopes, now) = (next, found_next, slopes_next, error_next);
            damping = f64::max(damping * 0.2, 1e-12);
        } else {
            damping *= 8.0;
            if damping > 1e6 {
                break;
            }
        }
    }
    (best, now)
}

/// Solves the damped normal equations.
fn step(slopes: &[[f64; 3]; 3], found: [f64; 3], wanted: [f64; 3], damping: f64) -> Option<[f64; 3]> {
    let mut m = [[0.0; 3]; 3];
    let mut right = [0.0; 3];
    for (i, row) in m.iter_mut().enumerate() {
        for (j, value) in row.iter_mut().enumerate() {
            *value = (0..3).map(|c| slopes[c][i] * slopes[c][j]).sum();
        }
        row[i] *= 1.0 + damping;
        right[i] = (0..3).map(|c| slopes[c][i] * (found[c] - wanted[c])).sum();
    }
    let minor = |a: usize, b: usize, c: usize, d: usize| m[a][b] * m[c][d] - m[a][d] * m[c][b];
    let inverse = [
        [minor(1, 1, 2, 2), minor(0, 2, 2, 1), minor(0, 1, 1, 2)],
        [minor(1, 2, 2, 0), minor(0, 0, 2, 2), minor(0, 2, 1, 0)],
        [minor(1, 0, 2, 1), minor(0, 1, 2, 0), minor(0, 0, 1, 1)],
    ];
    let determinant: f64 = (0..3).map(|i| m[0][i] * inverse[i][0]).sum();
    let solved = inverse.map(|row| (0..3).map(|i| row[i] * right[i]).sum::<f64>() / determinant);
    solved.iter().all(|v| v.is_finite()).then_some(solved)
}
