//! Splitting (Arvo, Kirk 1990, "Particle transport and image synthesis"): several paths go on from the first surface that
//! a camera ray hit. Where a picture's noise comes from what follows, they lower it for less than further camera rays
//! with their surfaces, textures and light samples would.
//!
//! The paths of a sample carry its throughput divided by their number, take consecutive points of the pixel's sequence,
//! and add to the same sample. Where they are many, what is left of the noise is that of the single light sample of the first
//! surface: it takes several, too, which also take consecutive points and carry their shares.

use super::group::Sorted;
use super::lanes::{PerPath, repeat};
use super::wave::{Carried, Vertices, Wave};
use super::workspace::Workspace;
use super::{Integrator, WAVE};
use crate::bsdf::Bsdf;
use crate::sampling::sampler::SobolPoint;

/// Paths that go on from a first surface for each of its light samples. (Rough metal on a floor under pictures with a sun, 8 paths: with
/// two light samples in place of one 1.04 to 1.6 times as efficient; a polished helmet, 4 paths: with two .97 times.)
const PATHS_PER_LIGHT_SAMPLE: u32 = 4;

impl Integrator<'_> {
    /// Into how many paths each goes on at a bounce.
    pub(super) fn branches(&self, bounce: u32) -> u32 {
        if bounce == 0 { self.options.branches } else { 1 }
    }

    /// How many light samples each vertex takes at a bounce: a power of two. An even sky is found as well by scattering.
    pub(super) fn light_samples(&self, bounce: u32) -> u32 {
        let branches = self.branches(bounce);
        if branches <= PATHS_PER_LIGHT_SAMPLE || self.scene.lights.are_an_even_sky() {
            return 1;
        }
        branches / PATHS_PER_LIGHT_SAMPLE
    }

    /// How many paths go on at a bounce for each light sample: what the density of scattering counts against that of light
    /// sampling.
    pub(super) fn paths_per_light_sample(&self, bounce: u32) -> f32 {
        (self.branches(bounce) / self.light_samples(bounce)) as f32
    }

    /// Camera rays of a wave, so that their paths find room in it.
    pub(super) fn samples_per_wave(&self) -> usize {
        WAVE / self.options.branches as usize
    }

    /// Makes each vertex several, one after the other, and returns where the groups lie then.
    pub(super) fn split(&self, sorted: &Sorted, w: &mut Workspace) -> Sorted {
        let branches = self.options.branches as usize;
        w.rays_before_split = Some(w.ray_counts.all);
        let (count, general) = (sorted.all().end, sorted.general());
        let Wave { paths, vertices, .. } = &mut *w.wave;
        paths.repeat(count, branches, self.parts);
        divide(&mut paths.carried, count, self.options.branches);
        if self.parts.interiors {
            vertices.beyond.repeat(count, branches);
        }
        repeat_vertices(vertices, sorted, branches, self.options.guide.is_some());
        if self.options.keeps_plain {
            number_branches(&mut paths.carried, count, self.options.branches);
            w.sink.extend_with_passes(WAVE + WAVE);
        }
        let old = general.len();
        w.bsdfs.resize(w.bsdfs.len().max(old * branches), Bsdf::Black);
        repeat(&mut w.bsdfs, old, branches);
        sorted.times(branches)
    }

    /// Adds what the branches of each sample found to it, where that was kept apart; and what one of them alone would have
    /// brought to what it has without splitting.
    pub(super) fn join_branches(&self, w: &mut Workspace) {
        let Some(before) = w.rays_before_split else { return w.sink.keep_plain() };
        w.ray_counts.in_branches += w.ray_counts.all - before;
        let branches = self.options.branches;
        w.sink.keep_plain();
        for sample in 0..w.pixels.len() as u32 {
            let first = first_part(sample, branches);
            w.sink.add_plain(sample, w.sink.radiance(first) * branches as f32);
            for part in first..first + branches {
                w.sink.join(sample, part);
            }
        }
    }

    /// Gives the vertices the points of one of their `count` light samples, after those of the one before.
    pub(super) fn number_light_samples(path: &mut Carried, sorted: &Sorted, number: u32, count: u32) {
        if count == 1 {
            return;
        }
        let bits = count.trailing_zeros();
        for i in sorted.all() {
            let point = SobolPoint::from_parts(path.seed[i], path.shuffled[i]);
            let point = if number == 0 { point } else { point.trunk(bits) };
            (path.seed[i], path.shuffled[i]) = point.branch(number, bits).to_parts();
        }
    }

    /// Gives the vertices their own points again, after those of their last light sample.
    pub(super) fn end_light_samples(path: &mut Carried, sorted: &Sorted, count: u32) {
        if count == 1 {
            return;
        }
        for i in sorted.all() {
            let point = SobolPoint::from_parts(path.seed[i], path.shuffled[i]).trunk(count.trailing_zeros());
            (path.seed[i], path.shuffled[i]) = point.to_parts();
        }
    }
}

/// Where the radiance of the branches of a sample arrives, if it is to be known for each.
fn first_part(sample: u32, branches: u32) -> u32 {
    WAVE as u32 + sample * branches
}

/// Gives the paths of a sample indices of their own for the radiance that they find.
fn number_branches(path: &mut Carried, count: usize, branches: u32) {
    for i in 0..count * branches as usize {
        path.sample[i] = first_part(path.sample[i], branches) + i as u32 % branches;
    }
}

/// Gives the paths of a sample their shares of it and their own points.
fn divide(path: &mut Carried, count: usize, branches: u32) {
    let (bits, share) = (branches.trailing_zeros(), 1.0 / branches as f32);
    for i in 0..count * branches as usize {
        for channel in &mut path.throughput {
            channel[i] *= share;
        }
        path.eta_squared[i] *= branches as f32;
        let point = SobolPoint::from_parts(path.seed[i], path.shuffled[i]).branch(i as u32 % branches, bits);
        (path.seed[i], path.shuffled[i]) = point.to_parts();
    }
}

/// What scattering needs of vertices.
fn repeat_vertices(v: &mut Vertices, sorted: &Sorted, times: usize, is_guided: bool) {
    let count = sorted.all().end;
    v.p.repeat(count, times);
    v.ng.repeat(count, times);
    v.ns.repeat(count, times);
    v.offset.repeat(count, times);
    v.wo.repeat(count, times);
    v.origin_primitives.repeat(count, times);
    v.anisotropy.repeat(sorted.medium().end, times);
    v.albedo.repeat(sorted.lambert().end, times);
    if is_guided {
        v.guided.cell.repeat(sorted.guided().end, times);
    }
    if !sorted.metal_rough().is_empty() {
        let count = sorted.metal_rough().end;
        v.metal_rough.alpha.repeat(count, times);
        v.metal_rough.curve.repeat(count, times);
        v.metal_rough_closures.repeat(count, times);
    }
}
