//! Paths that train a guide: what they find is recorded where they scattered.

use super::guide;
use super::guide::{NO_MEAN, TrainingSample, VertexRecord};
use crate::color::luminance;
use crate::integrator::Integrator;
use crate::integrator::sampling::Block;
use crate::integrator::shading_groups::SortedVertices;
use crate::integrator::wave::{Vertices, Wave};
use crate::integrator::wave::{WAVE, get};
use crate::integrator::workspace::Workspace;
use crate::math::Frame;
use crate::sampling::warp;
use crate::simd::{Kernel, dispatch};
use std::ops::Range;

/// What the paths of a block found.
#[derive(Clone, Debug, Default)]
pub struct BlockSamples {
    /// In an order that depends on the block alone.
    pub training_samples: Vec<TrainingSample>,
    /// Sum of the luminances of the samples, and how many there are.
    pub luminance: f64,
    pub samples: u64,
    /// Sum over the vertices of the squared luminance that each brought to its sample.
    pub squares: f64,
}

/// Minimum share of a sample's light that is distinguished from rounding.
const MIN_SHARE: f32 = 1e-6;

impl Integrator<'_> {
    /// Traces the samples of a block to learn from them; `None` if `stop` said so.
    pub fn learn(&self, block: &Block, w: &mut Workspace, stop: &dyn Fn() -> bool) -> Option<BlockSamples> {
        w.training_samples.clear();
        w.vertex_records.clear();
        w.brought_squares = 0.0;
        let (mut light, mut samples) = (0.0, 0);
        let is_done = self.trace(block, w, stop, |sample| {
            let value = f64::from(luminance(sample.rgb));
            light += if value.is_finite() { value } else { 0.0 };
            samples += 1;
        });
        let training_samples = std::mem::take(&mut w.training_samples);
        let squares = w.brought_squares;
        is_done.then_some(BlockSamples { training_samples, luminance: light, samples, squares })
    }

    /// Takes down the vertices of a bounce that are guided, once they are scattered.
    pub(in super::super) fn record_vertices(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let (Some(guide), range) = (self.options.guide, sorted.guided()) else { return };
        let Wave { vertices, paths, .. } = &mut *w.wave;
        dispatch(FindBins { vertices, range: range.clone() });
        for i in range {
            let is_lambert = sorted.lambert().contains(&i);
            // Mirrors and metals have no use for a guide.
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
                carried: vertices.guided.carried[i],
                // Facets bring more than what is expected of the cell.
                expected: if is_lambert {
                    guide.histograms[vertices.guided.cell[i] as usize].mean
                } else {
                    NO_MEAN
                },
                ends: paths.state.pdf[i].has_ended(),
            });
        }
    }

    /// Makes training samples of the vertices of a wave whose paths have ended.
    ///
    /// Of a path that came to another such vertex, of which the guide knows something already, what it found up to there counts
    /// and then what is expected from there on: that is less noisy than what it really found (Dahm, Keller 2017, "Learning Light
    /// Transport the Reinforced Way").
    pub(in super::super) fn make_training_samples(&self, w: &mut Workspace) {
        if !self.options.records_training {
            return;
        }
        // From the end, so that the next vertex of each path is known.
        let mut next: Vec<Option<VertexRecord>> = vec![None; w.pixels.len()];
        for &record in w.vertex_records.iter().rev() {
            let VertexRecord { training_sample, sample, before, carried, ends, .. } = record;
            let after = match next[sample as usize].replace(record) {
                Some(next) if next.expected >= 0.0 => next.before + next.carried * next.expected,
                _ => w.radiance_buffer.radiance(sample).luminance(),
            };
            let value = (after - before) / carried;
            let counts = !ends && value.is_finite() && after - before > MIN_SHARE * after;
            if counts {
                w.brought_squares += f64::from(after - before).powi(2);
            }
            w.training_samples
                .push(TrainingSample { value: if counts { value } else { 0.0 }, ..training_sample });
        }
        w.vertex_records.clear();
    }
}

/// Finds the bins of the directions in which paths continue.
struct FindBins<'a> {
    vertices: &'a mut Vertices,
    range: Range<usize>,
}

impl Kernel for FindBins<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = self.vertices;
        for i in self.range.start..self.range.end.min(WAVE) {
            let local = Frame::from_normal(get(&v.ns, i)).to_local(get(&v.next_direction, i));
            v.guided.bin[i] = guide::bin(warp::square_of_cosine_hemisphere(local));
        }
    }
}
