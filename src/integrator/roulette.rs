//! How paths scatter at a bounce, and Russian roulette.

use crate::color::Rgb;
use crate::sampling::sampler::Dimensions;

/// The first bounce after which a path may be ended by roulette.
pub(super) const FIRST_ROULETTE: u32 = 3;

/// How a bounce scatters at all its vertices.
#[derive(Clone, Copy)]
pub(super) struct How<'a> {
    pub dimensions: &'a Dimensions,
    /// May paths end?
    pub roulette: bool,
    /// How many paths the density of a direction counts for, for each light sample.
    pub branches: f32,
}

/// Russian roulette by the square root of the throughput (between the two extremes of never ending a path and of making
/// all survivors equally bright, and better than both): does the path go on, and the factor that makes up for those that
/// don't.
#[inline(always)]
pub(super) fn survival(throughput: Rgb, eta_squared: f32, u: f32, roulette: bool) -> (bool, f32) {
    let [r, g, b] = throughput.to_array();
    let brightest = r.max(g).max(b);
    let q = if roulette { (brightest * eta_squared).sqrt() } else { 1.0 };
    let q = if q < 1.0 { q } else { 1.0 };
    ((u < q) & (brightest > 0.0), 1.0 / if q > 0.0 { q } else { 1.0 })
}
