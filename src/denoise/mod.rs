//! Denoising of a picture, optionally with guides (albedo and normal of the first surface).
//!
//! A network trained on path-traced pictures predicts a noise-free picture (`network`). Where the residual (noisy picture minus
//! prediction) significantly exceeds the noise, it is added back, scale by scale (`residual`). So brightness is conserved, and
//! the error converges to zero with the number of samples.

mod network;
mod residual;
pub mod temporal;

use crate::color::luminance;
use crate::film::LIGHT_GROUP;
use crate::sampling::hash::hash32;
use network::Network;
use rayon::prelude::*;
pub use residual::{Color, slices};
use std::borrow::Cow;

/// Estimate of a picture's noise.
#[derive(Clone, Copy, Debug)]
pub enum Noise<'a> {
    /// Half the signed difference of two independent pictures (half buffers) whose mean is the picture: an error estimate that is
    /// independent between pixels. Non-finite values are unknown.
    Deviations(Color<'a>),
    /// Variance of each value, converted to deviations of random sign. Non-finite values are unknown.
    Variance(Color<'a>),
    /// No estimate: differences from neighbouring pixels count as noise, so that sharp details of lighting are lost.
    Unknown,
}

/// Feature buffers of the first surface.
#[derive(Clone, Copy, Debug, Default)]
pub struct Guides<'a> {
    /// Albedo, 0..1.
    pub albedo: Option<Color<'a>>,
    /// Normal, -1..1; only used together with the albedo.
    pub normal: Option<Color<'a>>,
}

impl Guides<'_> {
    /// Names of the guides in use, for reports.
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
    /// Noise estimate.
    pub noise: Noise<'a>,
    pub guides: Guides<'a>,
    /// Sets of parts of the picture, such as light passes or light groups: sets that add up to the picture before denoising also do
    /// afterwards.
    pub parts: Vec<Vec<Color<'a>>>,
}

/// Three planes, borrowed or owned.
pub type Planes<'a> = [Cow<'a, [f32]>; 3];

/// The layers of a film or a file that are used by denoising.
#[derive(Clone, Debug)]
pub struct NoisyLayers<'a> {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// The picture.
    pub color: Planes<'a>,
    /// See [`Noise::Deviations`]; preferred to the variance.
    pub deviations: Option<Planes<'a>>,
    /// See [`Noise::Variance`].
    pub variance: Option<Planes<'a>>,
    /// See [`Guides`].
    pub albedo: Option<Planes<'a>>,
    /// See [`Guides`].
    pub normal: Option<Planes<'a>>,
    /// Light groups and light passes, sorted by layer name (channel name without the final `R`); each of the two sets sums to the
    /// picture.
    pub parts: [Vec<(String, Planes<'a>)>; 2],
}

impl<'a> NoisyLayers<'a> {
    /// Reads layers with the function `layer`, from the names of three channels to their planes; `parts` are layer names without the
    /// final `R`. `None` without colour.
    pub fn read(
        size: [usize; 2],
        deviations: Option<Planes<'a>>,
        parts: Vec<String>,
        layer: impl Fn([&str; 3]) -> Option<Planes<'a>>,
    ) -> Option<NoisyLayers<'a>> {
        let part = |name: String| {
            let [r, g, b] = ["R", "G", "B"].map(|letter| format!("{name}{letter}"));
            layer([&r, &g, &b]).map(|planes| (name, planes))
        };
        let parts = ordered(parts).map(|set| set.into_iter().filter_map(part).collect());
        Some(NoisyLayers {
            size,
            color: layer(["R", "G", "B"])?,
            deviations,
            variance: layer(["variance.R", "variance.G", "variance.B"]),
            albedo: layer(["denoising_albedo.R", "denoising_albedo.G", "denoising_albedo.B"])
                .or_else(|| layer(["albedo.R", "albedo.G", "albedo.B"])),
            normal: layer(["denoising_normal.X", "denoising_normal.Y", "denoising_normal.Z"])
                .or_else(|| layer(["N.X", "N.Y", "N.Z"])),
            parts,
        })
    }

    /// The noise estimate.
    pub fn noise(&self) -> Noise<'_> {
        match (&self.deviations, &self.variance) {
            (Some(deviations), _) => Noise::Deviations(slices(deviations)),
            (None, Some(variance)) => Noise::Variance(slices(variance)),
            (None, None) => Noise::Unknown,
        }
    }

    pub fn guides(&self) -> Guides<'_> {
        Guides { albedo: self.albedo.as_ref().map(slices), normal: self.normal.as_ref().map(slices) }
    }

    /// Denoises all layers.
    pub fn denoised(&self) -> Denoised {
        self.denoised_with(None)
    }

    /// Denoises the parts, and the picture unless its denoised colour is known.
    pub(crate) fn denoised_with(&self, color: Option<[Vec<f32>; 3]>) -> Denoised {
        let [width, height] = self.size;
        let noisy = Noisy {
            width,
            height,
            color: slices(&self.color),
            noise: self.noise(),
            guides: self.guides(),
            parts: self
                .parts
                .each_ref()
                .map(|set| set.iter().map(|(_, planes)| slices(planes)).collect())
                .into(),
        };
        denoise_with(&noisy, color)
    }

    /// Layer names of the parts.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.parts.iter().flatten().map(|(name, _)| name.as_str())
    }
}

/// A denoised picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Denoised {
    /// The picture, clamped to non-negative values.
    pub color: [Vec<f32>; 3],
    /// Its parts, as in [`Noisy::parts`].
    pub parts: Vec<Vec<[Vec<f32>; 3]>>,
}

impl Denoised {
    /// The picture with an empty name, then the parts with their names.
    pub fn named<'a>(
        &'a self,
        names: impl Iterator<Item = &'a str>,
    ) -> impl Iterator<Item = (&'a str, &'a [Vec<f32>; 3])> {
        let planes = std::iter::once(&self.color).chain(self.parts.iter().flatten());
        std::iter::once("").chain(names).zip(planes)
    }
}

/// Sorts names of parts into light groups and light passes, the order in which they are denoised.
pub fn ordered(mut names: Vec<String>) -> [Vec<String>; 2] {
    names.sort();
    let (groups, passes) = names.into_iter().partition(|name| name.starts_with(LIGHT_GROUP));
    [groups, passes]
}

/// Name and version of the denoiser, for file headers.
pub const NAME: &str = concat!("oscura ", env!("CARGO_PKG_VERSION"));

/// Denoises a picture on all threads of the current pool; the result does not depend on their number. Non-finite values count as 0.
///
/// # Panics
/// If there are no pixels, or planes differ in size.
pub fn denoise(noisy: &Noisy) -> Denoised {
    denoise_with(noisy, None)
}

/// [`denoise`] for a picture whose denoised colour may be known.
fn denoise_with(noisy: &Noisy, known: Option<[Vec<f32>; 3]>) -> Denoised {
    let (width, height) = (noisy.width, noisy.height);
    let network = Network::new(noisy.guides.albedo.is_some());
    let zeros = noisy.guides.normal.is_none().then(|| vec![0.0; width * height]);
    let guides = noisy.guides.albedo.map(|albedo| {
        let normal = noisy.guides.normal.or(zeros.as_ref().map(|zeros| [zeros.as_slice(); 3]));
        [albedo, normal.expect("zeros replace a missing normal")]
    });
    let color = noisy.color.map(finite);
    let color = slices(&color);
    let factors = {
        let known = (!matches!(noisy.noise, Noise::Unknown)).then(|| deviations(noisy, color));
        firefly_factors(width, height, color, known.as_ref().map(slices))
    };
    // Deviations are recomputed for each use, to save memory while the network runs.
    let run = |color: Color, deviations: &dyn Fn() -> [Vec<f32>; 3]| {
        let proposed = network.run(width, height, color, &factors, guides);
        residual::corrected(width, height, color, deviations(), proposed)
    };
    let of_picture = || run(color, &|| deviations(noisy, color).map(Cow::into_owned));
    let result = known.unwrap_or_else(of_picture);
    let parts = noisy.parts.iter().map(|set| {
        let of = |part: &Color| {
            let part = part.map(finite);
            let part = slices(&part);
            run(part, &|| deviations_of_part(color, slices(&deviations(noisy, color)), part))
        };
        let mut parts: Vec<_> = set.iter().map(of).collect();
        add_up(color, set, &result, &mut parts);
        parts
    });
    let parts = parts.collect();
    Denoised { color: result, parts }
}

/// Deviations of a part: those of the picture times the part's fraction of each value.
fn deviations_of_part(color: Color, deviations: Color, part: Color) -> [Vec<f32>; 3] {
    let fraction = |part: f32, whole: f32| if whole > 0.0 { (part / whole).clamp(0.0, 1.0) } else { 0.0 };
    [0, 1, 2].map(|c| {
        let pixels = color[c].iter().zip(part[c]).zip(deviations[c]);
        pixels.map(|((whole, part), deviation)| deviation * fraction(*part, *whole)).collect()
    })
}

/// Replaces non-finite values of a plane by 0.
fn finite(plane: &[f32]) -> Cow<'_, [f32]> {
    match plane.iter().all(|v| v.is_finite()) {
        true => Cow::Borrowed(plane),
        false => plane.iter().map(|v| if v.is_finite() { *v } else { 0.0 }).collect(),
    }
}

/// Signed error estimate of each value.
fn deviations<'a>(noisy: &Noisy<'a>, color: Color) -> [Cow<'a, [f32]>; 3] {
    let (width, height) = (noisy.width, noisy.height);
    let signed = |i: usize, v: f32| if hash32(i as u32) >> 31 == 0 { v } else { -v };
    let is_known = |plane: &[f32]| plane.iter().all(|v| v.is_finite());
    let guessed = |c: usize| {
        let smooth = residual::smoothed(width, height, color[c], 1);
        // The mean of 3x3 pixels includes the pixel itself, which reduces the variance of the difference to 8/9.
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

// Fireflies: pixels made far brighter than their neighbourhood by a rare path.

/// Radius of the neighbourhood, pixels.
const RADIUS: usize = 2;
/// Rank of the neighbour that a pixel is compared with: the third brightest.
const RANK: usize = 3;
/// Maximum ratio of a pixel's luminance to that of the neighbour of this rank, or of the pixel in the darker half buffer.
const MAX_RATIO: f32 = 10.0;

/// Factors in 0..1 that clamp fireflies. Light that is present in both half buffers, by the deviations, is kept.
pub(super) fn firefly_factors(
    width: usize,
    height: usize,
    color: Color,
    deviations: Option<Color>,
) -> Vec<f32> {
    let at = |planes: Color, i: usize| luminance([planes[0][i], planes[1][i], planes[2][i]]);
    let luminances: Vec<f32> =
        (0..width * height).into_par_iter().with_min_len(4096).map(|i| at(color, i)).collect();
    let factor = |x: usize, y: usize| {
        let own = luminances[y * width + x];
        let mut largest = [0.0f32; RANK];
        for v in y.saturating_sub(RADIUS)..(y + RADIUS + 1).min(height) {
            for u in x.saturating_sub(RADIUS)..(x + RADIUS + 1).min(width) {
                let mut value = if (u, v) == (x, y) { 0.0 } else { luminances[v * width + u] };
                for ranked in &mut largest {
                    (*ranked, value) = (ranked.max(value), ranked.min(value));
                }
            }
        }
        let darker = deviations.map_or(0.0, |d| own - at(d, y * width + x).abs());
        let limit = MAX_RATIO * largest[RANK - 1].max(darker);
        if own > limit { limit / own } else { 1.0 }
    };
    let mut factors = vec![1.0; width * height];
    let rows = factors.par_chunks_mut(width).enumerate();
    rows.for_each(|(y, row)| row.iter_mut().enumerate().for_each(|(x, to)| *to = factor(x, y)));
    factors
}

// Parts that add up to the picture.

/// Relative difference up to which sums count as equal, with half-precision files in mind.
const ROUNDING: f32 = 4e-3;
/// Minimum fraction of values in which the parts must add up to the picture.
const MIN_EQUAL: f64 = 0.99;

/// Makes denoised parts add up to the denoised picture, if the noisy parts add up to the noisy picture: a pixel's parts are multiplied
/// by a common factor; if all are black, the difference is divided equally.
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
    if (equal as f64) < MIN_EQUAL * values as f64 {
        return;
    }
    for c in 0..3 {
        for (i, whole) in denoised[c].iter().enumerate() {
            let sum: f32 = parts.iter().map(|part| part[c][i]).sum();
            if sum > 1e-12 {
                let factor = whole / sum;
                parts.iter_mut().for_each(|part| part[c][i] *= factor);
            } else {
                let equal = whole / parts.len() as f32;
                parts.iter_mut().for_each(|part| part[c][i] = equal);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash::SplitMix64;

    const WIDTH: usize = 96;
    const HEIGHT: usize = 64;

    /// Two half buffers of a checkerboard under light that falls off to the right.
    struct Checkerboard {
        albedo: Vec<f32>,
        normal: Vec<f32>,
        truth: Vec<f32>,
        halves: [[Vec<f32>; 3]; 2],
    }

    impl Checkerboard {
        /// Half buffers with a relative standard deviation of `noise`; above 1, light comes from rare bright samples.
        fn new(noise: f64) -> Checkerboard {
            let pixels = || (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
            let albedo: Vec<f32> =
                pixels().map(|(x, y)| if (x / 6 + y / 6) % 2 == 0 { 0.8 } else { 0.2 }).collect();
            let light = |(x, _): (usize, usize)| 2.0 * (-(x as f32) / 40.0).exp();
            let truth: Vec<f32> = pixels().zip(&albedo).map(|(p, albedo)| albedo * light(p)).collect();
            // Binomially distributed hits with the required variance.
            let (probability, tries) =
                if noise > 1.0 { (0.1, 9.0 / noise / noise) } else { (0.5, 1.0 / noise / noise) };
            let tries = (tries.round() as usize).max(1);
            let mut random = SplitMix64::new(5);
            let halves = [0, 1].map(|_| {
                [0, 1, 2].map(|_| {
                    let mut hits = || (0..tries).filter(|_| random.next_unit() < probability).count() as f64;
                    truth
                        .iter()
                        .map(|t| (f64::from(*t) * hits() / (probability * tries as f64)) as f32)
                        .collect()
                })
            });
            Checkerboard { albedo, normal: vec![0.577; WIDTH * HEIGHT], truth, halves }
        }

        fn combined(&self, sign: f32) -> [Vec<f32>; 3] {
            let [a, b] = &self.halves;
            [0, 1, 2].map(|c| a[c].iter().zip(&b[c]).map(|(a, b)| 0.5 * (a + sign * b)).collect())
        }

        fn mean(&self) -> [Vec<f32>; 3] {
            self.combined(1.0)
        }

        fn deviations(&self) -> [Vec<f32>; 3] {
            self.combined(-1.0)
        }

        /// Mean squared error relative to the truth.
        fn error(&self, color: &[Vec<f32>; 3]) -> f64 {
            let squares = color.iter().flat_map(|plane| {
                plane.iter().zip(&self.truth).map(|(v, t)| f64::from((v - t) * (v - t) / (t * t)))
            });
            squares.sum::<f64>() / (3 * WIDTH * HEIGHT) as f64
        }

        fn denoised(&self, color: &[Vec<f32>; 3], noise: Noise, parts: Vec<Vec<Color>>) -> Denoised {
            let guides = Guides { albedo: Some([&self.albedo; 3]), normal: Some([&self.normal; 3]) };
            denoise(&Noisy { width: WIDTH, height: HEIGHT, color: slices(color), noise, guides, parts })
        }

        /// The noisy and the denoised picture.
        fn both(&self) -> ([Vec<f32>; 3], [Vec<f32>; 3]) {
            let (mean, deviations) = (self.mean(), self.deviations());
            let denoised = self.denoised(&mean, Noise::Deviations(slices(&deviations)), vec![]);
            (mean, denoised.color)
        }
    }

    #[test]
    fn denoising_removes_noise_and_preserves_texture() {
        let checkerboard = Checkerboard::new(1.0);
        let (mean, deviations) = (checkerboard.mean(), checkerboard.deviations());
        let before = checkerboard.error(&mean);
        let variance: Vec<f32> = checkerboard.truth.iter().map(|t| 0.5 * t * t).collect();
        let cases = [
            (Noise::Deviations(slices(&deviations)), 5.0),
            (Noise::Variance([&variance; 3]), 5.0),
            (Noise::Unknown, 5.0),
        ];
        for (noise, factor) in cases {
            let after = checkerboard.error(&checkerboard.denoised(&mean, noise, vec![]).color);
            println!("{before} -> {after}");
            assert!(after * factor < before, "{before} -> {after}");
        }
    }

    /// The error falls with the noise and never exceeds that of the noisy picture.
    #[test]
    fn denoised_pictures_converge() {
        let mut last = f64::INFINITY;
        for noise in [3.0, 1.0, 0.3, 0.1, 0.03, 0.01] {
            let checkerboard = Checkerboard::new(noise);
            let (noisy, denoised) = checkerboard.both();
            let (before, after) = (checkerboard.error(&noisy), checkerboard.error(&denoised));
            println!("{noise}: {before} -> {after}");
            assert!(after < 1.1 * before, "{before} -> {after}");
            assert!(after < last, "{last} -> {after}");
            last = after;
        }
    }

    /// Noise only at the edges of squares, with half the deviation that half buffers estimate, as with well-stratified samples.
    #[test]
    fn edges_with_little_noise_are_preserved() {
        let checkerboard = Checkerboard::new(0.3);
        let mut random = SplitMix64::new(9);
        for noise in [0.02, 0.004] {
            let mut planes = [0, 1].map(|_| vec![0.0; WIDTH * HEIGHT]);
            for (i, truth) in checkerboard.truth.iter().enumerate() {
                let is_edge = (i % WIDTH).is_multiple_of(6) || (i / WIDTH).is_multiple_of(6);
                let mut error = |scale: f64| match is_edge {
                    true => truth * (scale * noise * (random.next_unit() - 0.5)) as f32,
                    false => 0.0,
                };
                (planes[0][i], planes[1][i]) = (truth + error(1.0), error(2.0));
            }
            let [mean, deviations] = planes.map(|plane| [plane.clone(), plane.clone(), plane]);
            let denoised = checkerboard.denoised(&mean, Noise::Deviations(slices(&deviations)), vec![]);
            let (before, after) = (checkerboard.error(&mean), checkerboard.error(&denoised.color));
            println!("{noise}: {before} -> {after}");
            assert!(after < 1.1 * before, "{noise}: {before} -> {after}");
        }
    }

    /// Block means equal those of the noisy picture within their noise; the picture's mean within 2 %.
    #[test]
    fn brightness_is_conserved() {
        for noise in [3.0, 1.0, 0.3, 0.1] {
            let checkerboard = Checkerboard::new(noise);
            let deviations = checkerboard.deviations();
            let (noisy, denoised) = checkerboard.both();
            let sum = |plane: &[f32]| plane.iter().map(|v| f64::from(*v)).sum::<f64>();
            for c in 0..3 {
                let ratio = sum(&denoised[c]) / sum(&noisy[c]);
                assert!((ratio - 1.0).abs() < 2e-2, "{noise}: {ratio}");
                for (x0, y0) in (0..HEIGHT / 32).flat_map(|y| (0..WIDTH / 32).map(move |x| (32 * x, 32 * y)))
                {
                    let of = |value: &dyn Fn(usize) -> f32| {
                        let places = (y0..y0 + 32).flat_map(|y| (x0..x0 + 32).map(move |x| y * WIDTH + x));
                        places.map(|i| f64::from(value(i))).sum::<f64>()
                    };
                    let difference = of(&|i| denoised[c][i] - noisy[c][i]);
                    let deviation = of(&|i| deviations[c][i] * deviations[c][i]).sqrt();
                    assert!(difference.abs() < 3.5 * deviation, "{noise}: {difference} +- {deviation}");
                }
            }
        }
    }

    #[test]
    fn results_do_not_depend_on_the_number_of_threads() {
        let checkerboard = Checkerboard::new(1.0);
        let at = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| checkerboard.both().1)
        };
        assert!(at(1) == at(3));
    }

    #[test]
    fn parts_add_up_to_the_picture() {
        let checkerboard = Checkerboard::new(1.0);
        let (mean, deviations) = (checkerboard.mean(), checkerboard.deviations());
        let scaled = |left: f32, right: f32| {
            mean.each_ref().map(|plane| {
                let factor = |i: usize| if i % WIDTH < WIDTH / 2 { left } else { right };
                plane.iter().enumerate().map(|(i, v)| v * factor(i)).collect::<Vec<f32>>()
            })
        };
        let (a, b, other) = (scaled(0.7, 0.2), scaled(0.3, 0.8), scaled(0.5, 0.5));
        let noise = Noise::Deviations(slices(&deviations));
        let sets = vec![vec![slices(&a), slices(&b)], vec![slices(&other)]];
        let result = checkerboard.denoised(&mean, noise, sets);
        for c in 0..3 {
            for i in 0..WIDTH * HEIGHT {
                let sum = result.parts[0][0][c][i] + result.parts[0][1][c][i];
                assert!((sum - result.color[c][i]).abs() <= 1e-6 * sum, "{sum} {}", result.color[c][i]);
            }
        }
        // A part that is half of the picture stays half of it.
        let total = |part: &[Vec<f32>; 3]| part.iter().flatten().map(|v| f64::from(*v)).sum::<f64>();
        let ratio = total(&result.parts[1][0]) / total(&result.color);
        assert!((ratio - 0.5).abs() < 0.01, "{ratio}");
    }

    #[test]
    fn fireflies_are_removed_and_small_lights_preserved() {
        let mut checkerboard = Checkerboard::new(0.3);
        let (firefly, light) = (20 * WIDTH + 30, 30 * WIDTH + 40);
        for c in 0..3 {
            checkerboard.halves[0][c][firefly] = 1e4;
            checkerboard.halves.iter_mut().for_each(|half| half[c][light] = 50.0);
        }
        let (_, denoised) = checkerboard.both();
        let around = |at: usize| [at - 1, at, at + 1, at - WIDTH, at + WIDTH].map(|at| denoised[1][at]);
        println!("{:?} {:?}", around(firefly), around(light));
        assert!(around(firefly).iter().all(|&v| v < 2.5), "{:?}", around(firefly));
        assert!(denoised[1][light] > 25.0, "{:?}", around(light));
    }

    #[test]
    fn non_finite_values_do_not_spread() {
        let checkerboard = Checkerboard::new(0.3);
        let mut mean = checkerboard.mean();
        mean[0][5 * WIDTH + 5] = f32::NAN;
        mean[1][9 * WIDTH + 9] = f32::INFINITY;
        let result = checkerboard.denoised(&mean, Noise::Unknown, vec![]);
        assert!(result.color.iter().flatten().all(|v| v.is_finite()));
        assert!(checkerboard.error(&result.color) < 0.02, "{}", checkerboard.error(&result.color));
    }

    /// The noise of pixels without an estimate (such as with an empty half buffer) is guessed; brightness is conserved.
    #[test]
    fn pixels_of_unknown_noise_keep_their_brightness() {
        let checkerboard = Checkerboard::new(1.0);
        let (mean, mut deviations) = (checkerboard.mean(), checkerboard.deviations());
        deviations.iter_mut().for_each(|plane| plane.iter_mut().step_by(3).for_each(|v| *v = f32::NAN));
        let result = checkerboard.denoised(&mean, Noise::Deviations(slices(&deviations)), vec![]);
        let sum = |plane: &[f32]| plane.iter().map(|v| f64::from(*v)).sum::<f64>();
        assert!((sum(&result.color[0]) / sum(&mean[0]) - 1.0).abs() < 0.01);
        assert!(checkerboard.error(&result.color) * 5.0 < checkerboard.error(&mean));
        let infinite = vec![f32::INFINITY; WIDTH * HEIGHT];
        let guessed = checkerboard.denoised(&mean, Noise::Variance([&infinite; 3]), vec![]);
        assert!(checkerboard.error(&guessed.color) * 5.0 < checkerboard.error(&mean));
    }

    /// A single bright pixel of zero variance is no firefly.
    #[test]
    fn a_light_of_one_pixel_is_preserved() {
        let mut plane = vec![0.0; WIDTH * HEIGHT];
        plane[20 * WIDTH + 30] = 5.0;
        let (color, none) = ([plane.clone(), plane.clone(), plane], vec![0.0; WIDTH * HEIGHT]);
        let result = Checkerboard::new(1.0).denoised(&color, Noise::Variance([&none; 3]), vec![]);
        assert!(result.color[0][20 * WIDTH + 30] > 4.0, "{}", result.color[0][20 * WIDTH + 30]);
    }
}
