//! What guiding paths brings, as some squares of the picture tell.

use crate::color::luminance;
use crate::integrator::{Block, Integrator, PathSample, Workspace};

/// The share of their pixels, the noisiest, that don't count. (Not more: what guiding finds often, others find seldom.)
const LEFT_OUT: f64 = 0.001;

/// Part of the mean luminance, squared, against which errors of dark pixels count.
const DARK: f64 = 0.1;

/// Time of a ray with all that belongs to it where paths are guided, as a part of that where they are not.
const RAY_COST: f64 = 1.3;

/// What a square of the picture shows.
#[derive(Clone, Debug, Default)]
pub(super) struct Tried {
    /// Squared differences of the luminances of the two samples of each pixel.
    squares: Vec<f64>,
    /// Sum of all luminances.
    light: f64,
    rays: u64,
}

impl Tried {
    /// `None` if `stop` said so.
    pub fn by(
        integrator: &Integrator<'_>,
        block: &Block,
        w: &mut Workspace,
        stop: &dyn Fn() -> bool,
    ) -> Option<Tried> {
        let (mut tried, mut first, before) = (Tried::default(), None, w.ray_counts.all);
        let is_done = integrator.trace(block, w, stop, |sample: &PathSample<'_>| {
            let value = f64::from(luminance(sample.rgb));
            let value = if value.is_finite() { value } else { 0.0 };
            tried.light += value;
            match first.take() {
                Some(other) => tried.squares.push((value - other) * (value - other)),
                None => first = Some(value),
            }
        });
        tried.rays = w.ray_counts.all - before;
        is_done.then_some(tried)
    }
}

/// How many times more efficient the second way is: by squared errors relative to the light of each square and to that of
/// all, without the worst ones, and by rays.
pub(super) fn gain_of(tried: &[[Tried; 2]]) -> f64 {
    let light = |pair: &[Tried; 2]| pair[0].light + pair[1].light;
    let pixels = |pair: &[Tried; 2]| pair[0].squares.len().max(1) as f64;
    let mean = tried.iter().map(light).sum::<f64>() / tried.iter().map(pixels).sum::<f64>().max(1.0);
    let error = |way: usize| {
        let of_pair = |pair: &'_ [Tried; 2]| {
            let own = light(pair) / pixels(pair);
            let scale = own * own + DARK * mean * mean;
            pair[way]
                .squares
                .iter()
                .map(move |square| square / scale.max(f64::MIN_POSITIVE))
                .collect::<Vec<_>>()
        };
        let mut errors: Vec<f64> = tried.iter().flat_map(of_pair).collect();
        errors.sort_by(f64::total_cmp);
        errors.truncate((errors.len() as f64 * (1.0 - LEFT_OUT)).ceil() as usize);
        errors.iter().sum::<f64>()
    };
    let rays = |way: usize| tried.iter().map(|pair| pair[way].rays).sum::<u64>().max(1) as f64;
    let (before, after) = (error(0) * rays(0), error(1) * rays(1) * RAY_COST);
    if after > 0.0 { before / after } else { 0.0 }
}
