//! Path guiding (Müller, Gross, Novák 2017, "Practical Path Guiding for Efficient Light-Transport Simulation") and adjoint-driven
//! Russian roulette (Vorba, Křivánek 2016, "Adjoint-Driven Russian Roulette and Splitting in Light Transport Simulation").
//!
//! Before the first pass, training paths record incident radiance at their vertices; they don't contribute to the picture. A [`Guide`]
//! stores, by cell of position and normal, the mean radiance and a histogram over the unit square, which the cosine-hemisphere map
//! takes to directions. The pdf of a direction is the cosine lobe's times the histogram's. A uniform part of each histogram keeps the
//! pdf above 0.
//!
//! Guiding applies to Lambertian vertices and to the diffuse lobe of opaque glTF materials; lobe probabilities don't change. The cell of
//! a vertex depends on position, normal and random numbers used for nothing else, and all MIS weights (against light samples and shared
//! paths) use the guided pdf: pictures are unbiased with any guide.
//!
//! The expected contribution of a path is throughput times albedo times the mean of the cell. Russian roulette compares it with that at
//! the path's first guided vertex.

use super::Integrator;
use super::cells::Grid;
use super::sampling::Block;
use super::shading_groups::{MetalRoughClass, SortedVertices, VertexClass};
use super::wave::{Vertices, WAVE, Wave, get};
use super::workspace::Workspace;
use crate::color::luminance;
use crate::math::{Frame, Vec3, select};
use crate::sampling::hash::hash32;
use crate::sampling::warp;
use crate::simd::{Kernel, Table, dispatch};
pub use guide::{CellSamples, Guide, TrainedCells, TrainingSample};
use guide::{NO_MEAN, VertexRecord};
pub(super) use scatter::{Guided, scatter, scatter_metal_rough};
use std::ops::Range;

pub(super) mod guide;
mod scatter;

impl Integrator<'_> {
    /// Finds the cells of guided vertices.
    pub(super) fn find_cells(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        let (Some(guide), range) = (self.options.guide, sorted.guided()) else { return };
        let wave = &mut *w.wave;
        dispatch(FindKeys { grid: guide.grid, wave, range: range.clone(), bounce });
        let v = &mut wave.vertices.guided;
        for i in range {
            v.cell[i] = guide.find(v.key_low[i], v.key_high[i]);
        }
    }

    /// Computes, for MIS, the factor of guiding on the BSDF-sampling pdf of the light samples' directions.
    pub(super) fn guide_light_samples(&self, sorted: &SortedVertices, w: &mut Workspace) {
        if let Some(guide) = self.options.guide {
            let densities = guide.densities();
            let vertices = &mut w.wave.vertices;
            dispatch(LambertFactors { vertices, range: sorted.lambert(), densities });
            dispatch(MetalRoughFactors { vertices, range: sorted.metal_rough(), densities });
        }
    }

    /// [`Self::guide_light_samples`] for vertex `i` only.
    pub(super) fn guide_light_sample(&self, i: usize, sorted: &SortedVertices, wave: &mut Wave) {
        let Some(guide) = self.options.guide else { return };
        let (densities, vertices) = (guide.densities(), &mut wave.vertices);
        if sorted.lambert().contains(&i) {
            dispatch(LambertFactors { vertices, range: i..i + 1, densities });
        }
        if sorted.metal_rough().contains(&i) {
            dispatch(MetalRoughFactors { vertices, range: i..i + 1, densities });
        }
    }

    /// Factor of guiding on the BSDF-sampling pdf of the light sample of vertex `i`.
    pub(super) fn light_pdf_factor(&self, v: &Vertices, i: usize) -> f32 {
        if self.options.guide.is_some() { v.guided.light_pdf_factor[i] } else { 1.0 }
    }

    /// The pdf of the sampled direction of vertex `i` without guiding; `pdf` is the guided one.
    pub(super) fn unguided(&self, pdf: f32, wave: &Wave, i: usize) -> f32 {
        if self.options.guide.is_some() { pdf / wave.vertices.guided.pdf_factor[i] } else { pdf }
    }
}

/// Index in [`Guide::densities`] of a direction at a vertex with shading normal `ns`.
#[inline(always)]
pub(super) fn bin_index(cell: u32, ns: Vec3, wi: Vec3) -> u32 {
    let local = Frame::from_normal(ns).to_local(wi);
    cell * guide::BINS as u32 + guide::bin(warp::invert_cosine_hemisphere(local))
}

struct LambertFactors<'a> {
    vertices: &'a mut Vertices,
    range: Range<usize>,
    densities: Table<'a, f32>,
}

impl Kernel for LambertFactors<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = self.vertices;
        for i in self.range.start..self.range.end.min(WAVE) {
            let index = bin_index(v.guided.cell[i], get(&v.ns, i), get(&v.light.wi, i));
            v.guided.light_pdf_factor[i] = self.densities.at(index);
        }
    }
}

/// Factors on the pdf over all lobes of opaque glTF materials, of which only the diffuse lobe is guided.
struct MetalRoughFactors<'a> {
    vertices: &'a mut Vertices,
    range: Range<usize>,
    densities: Table<'a, f32>,
}

impl Kernel for MetalRoughFactors<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = self.vertices;
        for i in self.range.start..self.range.end.min(WAVE) {
            let (closure, wi) = (MetalRoughClass.closure(v, i), get(&v.light.wi, i));
            let index = bin_index(v.guided.cell[i], get(&v.base_normal, i), wi);
            v.guided.light_pdf_factor[i] = closure.guided(wi, self.densities.at(index));
        }
    }
}

/// Salt of the random numbers that jitter positions.
const SEED: u32 = 0x51ed_270b;

/// Computes the two halves of the cell keys of vertices. Positions are jittered along the surface by at most half a cell, to blur cell
/// borders.
struct FindKeys<'a> {
    grid: Grid,
    wave: &'a mut Wave,
    range: Range<usize>,
    bounce: u32,
}

impl Kernel for FindKeys<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v, .. } = self.wave;
        let salt = hash32(self.bounce ^ SEED);
        for i in self.range.start..self.range.end.min(WAVE) {
            let n = get(&v.ns, i);
            let frame = Frame::from_normal(n);
            let hash = hash32(hash32(paths.state.seed[i] ^ salt) ^ paths.state.index_rev[i]);
            let (s, t) = ((hash & 0xffff) as i32 as f32, (hash >> 16) as i32 as f32);
            let (s, t) = (s * (1.0 / 65_536.0) - 0.5, t * (1.0 / 65_536.0) - 0.5);
            let p = get(&v.p, i) * self.grid.scale + frame.s * s + frame.t * t;
            let [low, high] = self.grid.halves(p, n);
            (v.guided.key_low[i], v.guided.key_high[i]) = (low, high);
        }
    }
}

/// Training samples of a block.
#[derive(Clone, Debug, Default)]
pub struct BlockSamples {
    /// In an order that depends on the block alone.
    pub training_samples: Vec<TrainingSample>,
    /// Sum of the luminances of the block's samples.
    pub luminance: f64,
    /// Number of samples.
    pub samples: u64,
    /// Sum over vertices of the squared contribution to the sample's luminance.
    pub squares: f64,
}

/// Minimum fraction of a sample's luminance that is distinguishable from rounding errors.
const MIN_FRACTION: f32 = 1e-6;

impl Integrator<'_> {
    /// Traces the training paths of a block; `None` if `stop` interrupted it.
    pub fn learn(&self, block: &Block, w: &mut Workspace, stop: &dyn Fn() -> bool) -> Option<BlockSamples> {
        w.training_samples.clear();
        w.vertex_records.clear();
        w.contribution_squares = 0.0;
        let (mut light, mut samples) = (0.0, 0);
        let is_done = self.trace(block, w, stop, |sample| {
            let value = f64::from(luminance(sample.rgb));
            light += if value.is_finite() { value } else { 0.0 };
            samples += 1;
        });
        let training_samples = std::mem::take(&mut w.training_samples);
        let squares = w.contribution_squares;
        is_done.then_some(BlockSamples { training_samples, luminance: light, samples, squares })
    }

    /// Records the guided vertices of a bounce after scattering.
    pub(super) fn record_vertices(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let (Some(guide), range) = (self.options.guide, sorted.guided()) else { return };
        let Wave { vertices, paths, .. } = &mut *w.wave;
        let metal_rough = sorted.metal_rough().start;
        dispatch(FindBins { vertices, range: range.clone(), metal_rough });
        for i in range {
            let is_lambert = sorted.lambert().contains(&i);
            // Without a diffuse lobe nothing is guided.
            let is_diffuse = vertices.metal_rough_closures.probability_diffuse[i] > 0.0;
            if !is_lambert && (paths.state.pdf[i].is_specular() || !is_diffuse) {
                continue;
            }
            let sample = paths.state.radiance_index[i];
            let training_sample = TrainingSample {
                p: get(&vertices.p, i).to_array(),
                n: get(&vertices.ns, i).to_array(),
                bin: vertices.guided.bin[i],
                value: 0.0,
            };
            w.vertex_records.push(VertexRecord {
                training_sample,
                sample,
                before: w.radiance_buffer.radiance(sample).luminance(),
                throughput_luminance: vertices.guided.throughput_luminance[i],
                // Glossy lobes contribute more than the mean of the cell.
                expected: if is_lambert {
                    guide.histograms[vertices.guided.cell[i] as usize].mean
                } else {
                    NO_MEAN
                },
                ends: paths.state.pdf[i].has_ended(),
            });
        }
    }

    /// Converts the recorded vertices of a finished wave to training samples.
    ///
    /// If the path's next recorded vertex is in a cell with a known mean, the incident luminance there is replaced by that mean, which
    /// is less noisy than the path's own estimate (Dahm, Keller 2017, "Learning Light Transport the Reinforced Way").
    pub(super) fn make_training_samples(&self, w: &mut Workspace) {
        if !self.options.records_training {
            return;
        }
        // Backwards, so that the next vertex of each path is known.
        let mut next: Vec<Option<VertexRecord>> = vec![None; w.pixels.len()];
        for &record in w.vertex_records.iter().rev() {
            let VertexRecord { training_sample, sample, before, throughput_luminance, ends, .. } = record;
            let after = match next[sample as usize].replace(record) {
                Some(next) if next.expected >= 0.0 => next.before + next.throughput_luminance * next.expected,
                _ => w.radiance_buffer.radiance(sample).luminance(),
            };
            let value = (after - before) / throughput_luminance;
            let counts = !ends && value.is_finite() && after - before > MIN_FRACTION * after;
            if counts {
                w.contribution_squares += f64::from(after - before).powi(2);
            }
            w.training_samples
                .push(TrainingSample { value: if counts { value } else { 0.0 }, ..training_sample });
        }
        w.vertex_records.clear();
    }
}

/// Finds the bins of the sampled directions.
struct FindBins<'a> {
    vertices: &'a mut Vertices,
    range: Range<usize>,
    /// The first vertex of an opaque glTF material.
    metal_rough: usize,
}

impl Kernel for FindBins<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = self.vertices;
        for i in self.range.start..self.range.end.min(WAVE) {
            let normal = select(i >= self.metal_rough, get(&v.base_normal, i), get(&v.ns, i));
            let local = Frame::from_normal(normal).to_local(get(&v.next_direction, i));
            v.guided.bin[i] = guide::bin(warp::invert_cosine_hemisphere(local));
        }
    }
}
