//! Denoising: from a picture with noise and guides (albedo, normal, depth of the first surface) to one without.
//!
//! Two passes of weighted first-order regression on the guides, after Bitterli et al. 2016 ("Nonlinearly Weighted First-order
//! Regression for Denoising Monte Carlo Renderings"). The first takes its weights from patches of the noisy picture, the second
//! from those of the first one's result, where less noise hides less. Two pictures go through both
//! passes with the same weights: the picture with what its halves differ by added, and taken away. They tell how much noise there
//! is before and after the first.
//!
//! What was measured on five scenes at 4, 16 and 64 samples and left out: weights for each half from the other one, and a
//! choice of bandwidth for each pixel by the halves' estimate of the error, take two to four times as long for errors that
//! differ by a tenth either way.

mod denoiser;
mod filter;
mod outliers;
mod planes;
mod regression;
#[cfg(test)]
mod tests;
mod tiles;
mod weights;

pub use denoiser::Denoiser;
use filter::Filter;
use planes::Planes;

/// One over the squared differences from which on pixels are strangers.
const SHARPNESS_OF_ALBEDO: f32 = 4.0;
const SHARPNESS_OF_NORMAL: f32 = 1.0;
const SHARPNESS_OF_DEPTH: f32 = 4.0;

/// How many standard deviations patches may differ by in each pass.
const BANDWIDTHS: [f32; 2] = [0.7, 1.5];

/// Darker surfaces count as this one when patches are compared.
const LEAST_ALBEDO: f32 = 0.02;

/// Standard deviations below its value at which a pixel's light is taken for certain.
const CERTAIN: f32 = 3.0;

/// Radii over which the halves' squared differences are averaged before each pass: two numbers say little of a variance.
const VARIANCE_RADII: [usize; 2] = [2, 3];

/// Depths nearer than the middle one by more than this factor count as that near.
const NEAREST: f32 = 4.0;

/// Red, green and blue of all pixels, row by row from the top.
pub type Color<'a> = [&'a [f32]; 3];

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
    /// Its normal.
    pub normal: Option<Color<'a>>,
    /// Its distance.
    pub depth: Option<&'a [f32]>,
}

impl Guides<'_> {
    /// Those that are there, by name.
    pub fn names(&self) -> String {
        let given = [
            ("albedo", self.albedo.is_some()),
            ("normal", self.normal.is_some()),
            ("depth", self.depth.is_some()),
        ];
        let names: Vec<&str> =
            given.iter().filter(|(_, is_given)| *is_given).map(|(name, _)| *name).collect();
        if names.is_empty() { "none".to_string() } else { names.join(", ") }
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
    /// Parts of it, such as light passes, that are denoised with the same weights: what adds up before does so afterwards.
    pub parts: Vec<Color<'a>>,
}

/// A picture without noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Denoised {
    /// The picture; what would be negative is 0.
    pub color: [Vec<f32>; 3],
    /// Its parts.
    pub parts: Vec<[Vec<f32>; 3]>,
}

/// Three planes as [`Noisy`] takes them.
pub fn slices(planes: &[Vec<f32>; 3]) -> [&[f32]; 3] {
    planes.each_ref().map(Vec::as_slice)
}

/// Takes the noise out of a picture, on all threads of the current pool; the result is the same at any number of them. Values
/// that are NaN or infinite count as 0.
///
/// # Panics
/// If there are no pixels, or a list has another number of them.
pub fn denoise(noisy: &Noisy) -> Denoised {
    let (width, height) = (noisy.width, noisy.height);
    let planes = |lists: &[&[f32]]| Planes::of(width, height, lists);
    let (guides, sharpness) = guides(noisy);
    let [mut first, mut second] = halves(noisy);
    let (of_first, of_second) = match noisy.noise {
        Noise::Deviations(_) => {
            (outliers::factors(&first, Some(&second)), outliers::factors(&second, Some(&first)))
        }
        Noise::Variance(_) => {
            // What stands out by more than its own noise is there.
            let middle = first.zip(&second, |a, b| 0.5 * (a + b));
            let least = middle.zip(&first, |c, a| c - CERTAIN * (a - c).abs());
            let of_both = outliers::factors(&middle, Some(&least));
            (of_both.clone(), of_both)
        }
        Noise::Unknown => {
            let of_both = outliers::factors(&planes(&noisy.color), None);
            (of_both.clone(), of_both)
        }
    };
    let before = first.zip(&second, |a, b| a + b);
    outliers::apply(&mut first, &of_first);
    outliers::apply(&mut second, &of_second);
    let after = first.zip(&second, |a, b| a + b);
    let remaining = after.zip(&before, |after, before| if before == 0.0 { 1.0 } else { after / before });

    let lightness = reflectance(noisy);
    let mut data = first;
    data.append(&second);
    for part in &noisy.parts {
        data.append(&planes(part).zip(&remaining, |part, factor| part * factor));
    }
    for (&bandwidth, radius) in BANDWIDTHS.iter().zip(VARIANCE_RADII) {
        let (first, second) = (data.part(0..3), data.part(3..6));
        // Patches are compared as they would be on white surfaces: textures are what guides explain.
        let (first, second) = (first.zip(&lightness, |v, r| v / r), second.zip(&lightness, |v, r| v / r));
        let color = first.zip(&second, |a, b| 0.5 * (a + b));
        let variance = first.zip(&second, |a, b| 0.25 * (a - b) * (a - b)).smoothed(radius);
        let filter = Filter {
            color: &color,
            variance: &variance,
            bandwidth,
            guides: &guides,
            sharpness: &sharpness,
            data: &data,
        };
        data = filter.run();
    }
    let color = data.part(0..3).zip(&data.part(3..6), |a, b| (0.5 * (a + b)).max(0.0));
    let part = |k: usize| [0, 1, 2].map(|c| data.list(6 + 3 * k + c));
    Denoised { color: [0, 1, 2].map(|c| color.list(c)), parts: (0..noisy.parts.len()).map(part).collect() }
}

/// The albedo, or white, not too dark to divide by.
fn reflectance(noisy: &Noisy) -> Planes {
    let white = vec![1.0; noisy.width * noisy.height];
    let albedo = noisy.guides.albedo.unwrap_or([&white; 3]);
    let albedo = Planes::of(noisy.width, noisy.height, &albedo);
    albedo.zip(&albedo, |v, _| v.max(LEAST_ALBEDO))
}

/// Two pictures whose mean is the picture and whose difference is its noise.
fn halves(noisy: &Noisy) -> [Planes; 2] {
    let planes = |color: &Color| Planes::of(noisy.width, noisy.height, color);
    let color = planes(&noisy.color);
    let guessed = || {
        // The mean of nine has a ninth of a pixel itself.
        let deviation = color.zip(&color.smoothed(1), |own, mean| (own - mean) * (9.0f32 / 8.0).sqrt());
        deviation.with_random_signs()
    };
    let known = |given: &Color, deviation: Planes| match given.iter().any(|list| has_gaps(list)) {
        true => deviation.with_gaps_from(given, &guessed()),
        false => deviation,
    };
    let signed = match &noisy.noise {
        Noise::Deviations(given) => known(given, planes(given)),
        Noise::Variance(given) => {
            known(given, planes(given).zip(&color, |v, _| v.max(0.0).sqrt()).with_random_signs())
        }
        Noise::Unknown => guessed(),
    };
    [color.zip(&signed, |c, d| c + d), color.zip(&signed, |c, d| c - d)]
}

fn has_gaps(list: &[f32]) -> bool {
    list.iter().any(|v| !v.is_finite())
}

/// The guides as planes of comparable ranges, and the sharpness of each.
fn guides(noisy: &Noisy) -> (Planes, Vec<f32>) {
    let Guides { albedo, normal, depth } = noisy.guides;
    let depth = depth.map(nearness);
    let mut lists: Vec<&[f32]> = Vec::new();
    let mut sharpness = Vec::new();
    let given = [(albedo, SHARPNESS_OF_ALBEDO), (normal, SHARPNESS_OF_NORMAL)];
    for (guide, sharp) in given.iter().filter_map(|(guide, sharp)| Some((guide.as_ref()?, *sharp))) {
        lists.extend(guide);
        sharpness.extend([sharp; 3]);
    }
    if let Some(depth) = &depth {
        lists.push(depth);
        sharpness.push(SHARPNESS_OF_DEPTH);
    }
    (Planes::of(noisy.width, noisy.height, &lists), sharpness)
}

/// One over the depth, which is linear in the picture where surfaces are flat; 1 for the middle one.
fn nearness(depth: &[f32]) -> Vec<f32> {
    let is_surface = |z: &f32| *z > 0.0 && *z < 1e9;
    let mut sorted: Vec<f32> = depth.iter().copied().filter(is_surface).collect();
    sorted.sort_by(f32::total_cmp);
    let middle = sorted.get(sorted.len() / 2).copied().unwrap_or(1.0);
    depth.iter().map(|z| if is_surface(z) { (middle / z).min(NEAREST) } else { 0.0 }).collect()
}
