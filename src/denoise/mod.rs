//! Denoising: from a picture with noise and guides (albedo and normal of the first surface) to one without.
//!
//! A network that was trained on pictures of path tracers proposes a picture (`network`). What it gets wrong shows in the
//! residual, the noisy picture minus the proposal, where that is larger than the noise: it is added back, scale by scale
//! (`residual`). So brightness is conserved, and the error falls with the number of samples.

mod network;
mod planes;
mod residual;
pub mod temporal;
#[cfg(test)]
mod tests;

use crate::color::luminance;
use crate::sampling::hash::hash32;
use network::Network;
pub use planes::{Color, slices};
use rayon::prelude::*;
use std::borrow::Cow;

/// What is known about a picture's noise.
#[derive(Clone, Copy, Debug)]
pub enum Noise<'a> {
    /// Half of what two pictures differ by whose mean is the picture, signed: an estimate of its error that has nothing to do
    /// with the errors of other pixels. What is not finite is not known.
    Deviations(Color<'a>),
    /// The variance of each value, from which such differences are made up. What is not finite is not known.
    Variance(Color<'a>),
    /// Nothing: what differs from the neighbouring pixels is taken for noise, so that sharp details of light are lost.
    Unknown,
}

/// What the first surface shows, where it is known.
#[derive(Clone, Copy, Debug, Default)]
pub struct Guides<'a> {
    /// Its reflectance.
    pub albedo: Option<Color<'a>>,
    /// Its normal; of use with the albedo only.
    pub normal: Option<Color<'a>>,
}

impl Guides<'_> {
    /// Names of the guides in use.
    pub fn names(&self) -> &'static str {
        match (self.albedo, self.normal) {
            (Some(_), Some(_)) => "albedo, normal",
            (Some(_), None) => "albedo",
            (None, _) => "none",
        }
    }
}

/// A picture to be denoised.
#[derive(Clone, Debug)]
pub struct Noisy<'a> {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The picture.
    pub color: Color<'a>,
    /// Its noise.
    pub noise: Noise<'a>,
    /// Its guides.
    pub guides: Guides<'a>,
    /// Parts of it, in sets such as the light passes and the groups of lights: what adds up to the picture before does so
    /// afterwards.
    pub parts: Vec<Vec<Color<'a>>>,
}

/// A picture without noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Denoised {
    /// The picture; what would be negative is 0.
    pub color: [Vec<f32>; 3],
    /// Its parts.
    pub parts: Vec<Vec<[Vec<f32>; 3]>>,
}

/// The denoiser with its version, for headers.
pub const NAME: &str = concat!("oscura ", env!("CARGO_PKG_VERSION"));

/// Denoises a picture, on all threads of the current pool; the result is the same at any number of them. Values that are NaN
/// or infinite count as 0.
///
/// # Panics
/// If there are no pixels, or a list has another number of them.
pub fn denoise(noisy: &Noisy) -> Denoised {
    let (width, height) = (noisy.width, noisy.height);
    let network = Network::new(noisy.guides.albedo.is_some());
    let none = noisy.guides.normal.is_none().then(|| vec![0.0; width * height]);
    let guides = noisy.guides.albedo.map(|albedo| {
        let normal = noisy.guides.normal.or(none.as_ref().map(|none| [none.as_slice(); 3]));
        [albedo, normal.expect("one of them is there")]
    });
    let color = noisy.color.map(finite);
    let color = color.each_ref().map(|plane| &**plane);
    let deviations = deviations(noisy, color);
    let deviations = deviations.each_ref().map(|plane| &**plane);
    let known = (!matches!(noisy.noise, Noise::Unknown)).then_some(deviations);
    let factors = factors(width, height, color, known);
    let run = |color: Color, deviations: Color| {
        let proposed = network.run(width, height, color, &factors, guides);
        residual::restored(width, height, color, deviations, proposed)
    };
    let result = run(color, deviations);
    let parts = noisy.parts.iter().map(|set| {
        let of = |part: &Color| {
            let part = part.map(finite);
            let part = part.each_ref().map(|plane| &**plane);
            run(part, slices(&deviations_of_part(color, deviations, part)))
        };
        let mut parts: Vec<_> = set.iter().map(of).collect();
        add_up(color, set, &result, &mut parts);
        parts
    });
    let parts = parts.collect();
    Denoised { color: result, parts }
}

/// The share of deviations that a part has of the light of each pixel.
fn deviations_of_part(color: Color, deviations: Color, part: Color) -> [Vec<f32>; 3] {
    let share = |part: f32, whole: f32| if whole > 0.0 { (part / whole).clamp(0.0, 1.0) } else { 0.0 };
    [0, 1, 2].map(|c| {
        let pixels = color[c].iter().zip(part[c]).zip(deviations[c]);
        pixels.map(|((whole, part), deviation)| deviation * share(*part, *whole)).collect()
    })
}

/// A plane without what is not finite.
fn finite(plane: &[f32]) -> Cow<'_, [f32]> {
    match plane.iter().all(|v| v.is_finite()) {
        true => Cow::Borrowed(plane),
        false => plane.iter().map(|v| if v.is_finite() { *v } else { 0.0 }).collect(),
    }
}

/// An estimate of the error of each value, with its sign.
fn deviations<'a>(noisy: &Noisy<'a>, color: Color) -> [Cow<'a, [f32]>; 3] {
    let (width, height) = (noisy.width, noisy.height);
    let signed = |i: usize, v: f32| if hash32(i as u32) >> 31 == 0 { v } else { -v };
    let is_known = |plane: &[f32]| plane.iter().all(|v| v.is_finite());
    let guessed = |c: usize| {
        let smooth = planes::smoothed(width, height, color[c], 1);
        // The mean of nine has a ninth of a pixel itself.
        let factor = (9.0f32 / 8.0).sqrt();
        let of = |(i, (v, mean)): (usize, (&f32, &f32))| signed(i, factor * (v - mean));
        color[c].iter().zip(&smooth).enumerate().map(of).collect::<Vec<f32>>()
    };
    let known = |c: usize, given: &[f32], value: &dyn Fn(usize, f32) -> f32| {
        let guess = if is_known(given) { Vec::new() } else { guessed(c) };
        let of = |(i, v): (usize, &f32)| if v.is_finite() { value(i, *v) } else { guess[i] };
        given.iter().enumerate().map(of).collect()
    };
    [0, 1, 2].map(|c| match noisy.noise {
        Noise::Deviations(given) if is_known(given[c]) => Cow::Borrowed(given[c]),
        Noise::Deviations(given) => known(c, given[c], &|_, v| v),
        Noise::Variance(given) => known(c, given[c], &|i, v| signed(i, v.max(0.0).sqrt())),
        Noise::Unknown => Cow::Owned(guessed(c)),
    })
}

// Fireflies: pixels that a rare path made far brighter than all around them.

/// Radius of the neighbourhood that pixels are compared with.
const RADIUS: usize = 2;
/// As many neighbours that are as bright make a pixel part of what it shows.
const RANK: usize = 3;
/// How many times as bright as the neighbour of that rank, and as the darker of the halves, a pixel may be.
const LIMIT: f32 = 10.0;

/// Factors in 0..1 that take the fireflies out. The deviations show what is in both halves of the samples, which is really
/// there.
pub(super) fn factors(width: usize, height: usize, color: Color, deviations: Option<Color>) -> Vec<f32> {
    let at = |planes: Color, i: usize| luminance([planes[0][i], planes[1][i], planes[2][i]]);
    let brightness: Vec<f32> = (0..width * height).map(|i| at(color, i)).collect();
    let factor = |x: usize, y: usize| {
        let own = brightness[y * width + x];
        let mut largest = [0.0f32; RANK];
        for v in y.saturating_sub(RADIUS)..(y + RADIUS + 1).min(height) {
            for u in x.saturating_sub(RADIUS)..(x + RADIUS + 1).min(width) {
                let mut value = if (u, v) == (x, y) { 0.0 } else { brightness[v * width + u] };
                for kept in &mut largest {
                    (*kept, value) = (kept.max(value), kept.min(value));
                }
            }
        }
        let darker = deviations.map_or(0.0, |d| own - at(d, y * width + x).abs());
        let limit = LIMIT * largest[RANK - 1].max(darker);
        if own > limit { limit / own } else { 1.0 }
    };
    let mut factors = vec![1.0; width * height];
    let rows = factors.par_chunks_mut(width).enumerate();
    rows.for_each(|(y, row)| row.iter_mut().enumerate().for_each(|(x, to)| *to = factor(x, y)));
    factors
}

// Parts of a picture, which add up to it.

/// Relative difference up to which sums are the same, of half-precision files too.
const ROUNDING: f32 = 4e-3;
/// The share of pixels in which parts must add up to the picture.
const MAX: f64 = 0.99;

/// Makes denoised parts add up to the denoised picture, if the noisy ones add up to the noisy picture: each pixel's parts
/// change by one factor; where they are black, they share what is missing alike.
pub(super) fn add_up(
    noisy: Color,
    noisy_parts: &[Color],
    denoised: &[Vec<f32>; 3],
    parts: &mut [[Vec<f32>; 3]],
) {
    let add_up_at = |c: usize, i: usize| {
        let sum: f32 = noisy_parts.iter().map(|part| part[c][i]).sum();
        (sum - noisy[c][i]).abs() <= ROUNDING * noisy[c][i].abs().max(1e-4)
    };
    let values = 3 * noisy[0].len();
    let equal: usize = (0..3).map(|c| (0..noisy[c].len()).filter(|&i| add_up_at(c, i)).count()).sum();
    if (equal as f64) < MAX * values as f64 {
        return;
    }
    for c in 0..3 {
        for (i, whole) in denoised[c].iter().enumerate() {
            let sum: f32 = parts.iter().map(|part| part[c][i]).sum();
            if sum > 1e-12 {
                let factor = whole / sum;
                parts.iter_mut().for_each(|part| part[c][i] *= factor);
            } else {
                let share = whole / parts.len() as f32;
                parts.iter_mut().for_each(|part| part[c][i] = share);
            }
        }
    }
}
