//! Sample indices of blocks, random numbers by purpose, and Russian roulette.

use super::wave::PathState;
use crate::color::Rgb;
use crate::sampling::hash::{hash32, unit};
use crate::sampling::sampler::Dimensions;
use crate::sampling::{AdaptiveSamples, ZSobolOrder};

/// Sample counts and random sequences of pixels.
#[derive(Clone, Copy, Debug)]
pub enum SamplePlan<'a> {
    /// The same number of samples for all pixels.
    Even(ZSobolOrder),
    /// A sample count per pixel (adaptive sampling), all in one pass.
    Uneven(&'a AdaptiveSamples),
}

impl SamplePlan<'_> {
    /// The samples of a block at pixel (`x`, `y`): seed of the sequence, index of the first sample in it, and
    /// number of samples.
    #[inline(always)]
    fn of_pixel(&self, x: u32, y: u32, block: &Block, branch_bits: u32) -> (u32, u32, u32) {
        match self {
            SamplePlan::Even(arrangement) => {
                let (seed, start) = arrangement.first(x, y);
                (seed, (start >> branch_bits) + block.first_sample, block.samples)
            }
            SamplePlan::Uneven(samples) => samples.of_pixel(x, y),
        }
    }
}

/// A sample of a block.
pub(super) struct Sample {
    /// Pixel index in the block, row-major.
    pub pixel: u32,
    /// Pixel coordinates in the picture.
    pub x: u32,
    pub y: u32,
    /// Seed of the random sequence.
    pub seed: u32,
    /// Index in the random sequence.
    pub index: u32,
}

/// Iterates over the samples of a block, pixel by pixel, across waves.
pub(super) struct CameraSamples<'a> {
    plan: SamplePlan<'a>,
    block: Block,
    branch_bits: u32,
    /// Number of pixels begun.
    begun: u32,
    /// Next sample of the current pixel.
    next: Sample,
    /// Number of samples left in the current pixel.
    left: u32,
}

impl<'a> CameraSamples<'a> {
    pub fn new(plan: SamplePlan<'a>, block: &Block, branch_bits: u32) -> CameraSamples<'a> {
        let next = Sample { pixel: 0, x: 0, y: 0, seed: 0, index: 0 };
        CameraSamples { plan, block: *block, branch_bits, begun: 0, next, left: 0 }
    }
}

impl Iterator for CameraSamples<'_> {
    type Item = Sample;

    #[inline(always)]
    fn next(&mut self) -> Option<Sample> {
        while self.left == 0 {
            let (pixel, width) = (self.begun, self.block.width);
            if pixel == width * self.block.height {
                return None;
            }
            self.begun += 1;
            let (x, y) = (self.block.x0 + pixel % width, self.block.y0 + pixel / width);
            let (seed, index, count) = self.plan.of_pixel(x, y, &self.block, self.branch_bits);
            (self.next, self.left) = (Sample { pixel, x, y, seed, index }, count);
        }
        let Sample { index, .. } = self.next;
        self.left -= 1;
        self.next.index += 1;
        Some(Sample { index, ..self.next })
    }
}

/// A rectangle of pixels and a range of their samples.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// Left column.
    pub x0: u32,
    /// Top row.
    pub y0: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// First sample of each pixel.
    pub first_sample: u32,
    /// Samples of each pixel.
    pub samples: u32,
}

/// Iterates over the samples of a block, pixel by pixel.
pub(super) struct SampleCursor {
    pub x: u32,
    pub y: u32,
    pub sample: u64,
    x0: u32,
    x1: u32,
}

impl SampleCursor {
    pub fn new(block: &Block, first: u64) -> SampleCursor {
        let samples = u64::from(block.samples);
        let (pixel, width) = (first / samples, u64::from(block.width));
        SampleCursor {
            x: block.x0 + (pixel % width) as u32,
            y: block.y0 + (pixel / width) as u32,
            sample: first % samples,
            x0: block.x0,
            x1: block.x0 + block.width,
        }
    }

    #[inline(always)]
    pub fn advance(&mut self, samples: u64) {
        self.sample += 1;
        if self.sample == samples {
            self.sample = 0;
            self.x += 1;
            if self.x == self.x1 {
                (self.x, self.y) = (self.x0, self.y + 1);
            }
        }
    }
}

/// First bounce with Russian roulette.
pub(super) const FIRST_ROULETTE: u32 = 3;

/// Parameters of scattering at a bounce.
#[derive(Clone, Copy)]
pub(super) struct ScatterParams<'a> {
    pub dimensions: &'a Dimensions,
    /// Is Russian roulette on?
    pub roulette: bool,
    /// Number of BSDF samples per light sample, for MIS.
    pub branches: f32,
}

/// Russian roulette with the square root of throughput as survival probability (measured better than both no roulette and a probability
/// proportional to throughput). Returns whether the path survives, and 1 / probability.
#[inline(always)]
pub(super) fn survival(throughput: Rgb, roulette_scale: f32, u: f32, roulette: bool) -> (bool, f32) {
    let [r, g, b] = throughput.to_array();
    let brightest = r.max(g).max(b);
    let q = if roulette { (brightest * roulette_scale).sqrt() } else { 1.0 };
    let q = if q < 1.0 { q } else { 1.0 };
    ((u < q) & (brightest > 0.0), 1.0 / if q > 0.0 { q } else { 1.0 })
}

/// Purposes of Sobol samples, each with a set of four dimensions. [`RandomChoice`] lists the purposes of hashed random numbers.
#[derive(Clone, Copy)]
pub(super) enum Purpose {
    /// Film x and y, lens x and y.
    Camera,
    /// Point on the light (2), selection of the light (2).
    Light,
    /// Direction (2), lobe, Russian roulette.
    Scatter,
    /// Distance in a medium, strategy of distance sampling, light for equiangular sampling (2).
    Medium,
    /// Time within the shutter interval (1).
    Time,
    /// Hero wavelength (1).
    Wavelength,
    /// Selection of a mix component (1), selection of the base of a normal-mapped material (1), alpha of the first two surfaces on the
    /// path's ray (2).
    Mix,
    /// Directions of the rays of ambient occlusion nodes (2).
    AmbientOcclusion,
    /// Positions of the rays of bevel nodes (2).
    Bevel,
}

impl Purpose {
    /// Index of the set of Sobol dimensions at a bounce. Frequent purposes have low indices, for which tables are prepared.
    pub fn dimension_set(self, bounce: u32) -> u32 {
        match self {
            Purpose::Camera => 0,
            Purpose::Light => 1 + 2 * bounce,
            Purpose::Scatter => 2 + 2 * bounce,
            Purpose::Medium => u32::MAX - bounce,
            Purpose::Time => 1 << 31,
            Purpose::Wavelength => (1 << 31) - 1,
            Purpose::Mix => (1 << 30) + bounce,
            Purpose::AmbientOcclusion => (1 << 29) + bounce,
            Purpose::Bevel => (1 << 28) + bounce,
        }
    }
}

/// Purposes of random numbers hashed from the path's Sobol point and the bounce: rare ones, and those of unbounded number per bounce,
/// with `surface` the number of surfaces that the ray has passed.
#[derive(Clone, Copy)]
pub(super) enum RandomChoice {
    /// Alpha of a further surface on a path's ray.
    Alpha { surface: u32 },
    /// Alpha of a surface on a shadow ray.
    ShadowAlpha { surface: u32 },
    /// Transmission or scattering at thin glass.
    ThinGlass { surface: u32 },
    /// Distance in the medium behind a boundary of media.
    MediumBoundary { surface: u32 },
    /// Point of emission along a ray through a medium.
    MediumEmission,
    /// Emission in one of several overlapping media.
    OverlappingEmission { medium: u32 },
    /// Directions, distances and Russian roulette of a random walk.
    RandomWalk,
    /// Kind of the next ray at a surface with several lobes.
    RayKind,
    /// Channel with which a path continues at a dispersive interface.
    DispersionChannel,
    /// Lobe towards a refracted light or BSDF.
    LightLobe,
}

impl RandomChoice {
    #[inline(always)]
    pub fn hash(self, path: &PathState, i: usize, bounce: u32) -> u32 {
        let (seed, index_rev) = (path.seed[i], path.index_rev[i]);
        let common = hash32(seed ^ hash32(index_rev) ^ (bounce << 16));
        match self {
            RandomChoice::Alpha { surface } => common.wrapping_add(surface),
            RandomChoice::ShadowAlpha { surface } => {
                hash32(seed ^ hash32(!index_rev) ^ (bounce << 16)).wrapping_add(surface)
            }
            RandomChoice::ThinGlass { surface } => common.wrapping_add(surface) ^ 0x5bd1_e995,
            RandomChoice::MediumBoundary { surface } => common.wrapping_add(surface) ^ 0x1f83_d9ab,
            RandomChoice::MediumEmission => common ^ 0x3c6e_f372,
            RandomChoice::OverlappingEmission { medium } => common ^ medium,
            RandomChoice::RandomWalk => common ^ 0x9b05_688c,
            RandomChoice::RayKind => common ^ 0x27d4_eb2f,
            RandomChoice::LightLobe => common ^ 0x165667b1,
            RandomChoice::DispersionChannel => {
                hash32(seed ^ hash32(index_rev).rotate_left(7) ^ (bounce << 20))
            }
        }
    }

    /// A uniform random number in 0..1 for path `i` at a bounce.
    #[inline(always)]
    pub fn uniform(self, path: &PathState, i: usize, bounce: u32) -> f32 {
        unit(hash32(self.hash(path, i, bounce)))
    }
}
