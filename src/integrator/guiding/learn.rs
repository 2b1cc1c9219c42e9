//! Paths that teach: what they find is taken down where they scattered.

use super::super::Integrator;
use super::super::block::Block;
use super::super::group::Sorted;
use super::super::lanes::{WAVE, get};
use super::super::wave::{Vertices, Wave};
use super::super::workspace::Workspace;
use super::histogram;
use super::lesson::{Lesson, Pending};
use crate::color::luminance;
use crate::math::Frame;
use crate::sampling::warp;
use crate::simd::{Kernel, dispatch};
use std::ops::Range;

/// What the paths of a block found.
#[derive(Clone, Debug, Default)]
pub struct Learnt {
    /// In an order that depends on the block alone.
    pub lessons: Vec<Lesson>,
    /// Sum of the luminances of the samples, and how many there are.
    pub luminance: f64,
    pub samples: u64,
}

/// Least part of what a sample has that is told from rounding.
const LEAST_SHARE: f32 = 1e-6;

impl Integrator<'_> {
    /// Traces the samples of a block to learn from them; `None` if `stop` said so.
    pub fn learn(&self, block: &Block, w: &mut Workspace, stop: &dyn Fn() -> bool) -> Option<Learnt> {
        w.lessons.clear();
        w.noted.clear();
        let (mut light, mut samples) = (0.0, 0);
        let is_done = self.trace(block, w, stop, |sample| {
            let value = f64::from(luminance(sample.rgb));
            light += if value.is_finite() { value } else { 0.0 };
            samples += 1;
        });
        let lessons = std::mem::take(&mut w.lessons);
        is_done.then_some(Learnt { lessons, luminance: light, samples })
    }

    /// Takes down the Lambertian vertices of a bounce, once they are scattered.
    pub(in super::super) fn note_vertices(&self, sorted: &Sorted, w: &mut Workspace) {
        let (Some(guide), range) = (self.options.guide, sorted.lambert()) else { return };
        let Wave { vertices, paths, .. } = &mut *w.wave;
        dispatch(FindBins { vertices, range: range.clone() });
        for i in range {
            let sample = paths.carried.sample[i];
            let lesson = Lesson {
                p: get(&vertices.p, i).to_array(),
                n: get(&vertices.ns, i).to_array(),
                bin: vertices.guided.bin[i],
                value: 0.0,
            };
            w.noted.push(Pending {
                lesson,
                sample,
                before: w.sink.radiance(sample).luminance(),
                carried: vertices.guided.carried[i],
                expected: guide.histograms[vertices.guided.cell[i] as usize].mean,
                ends: paths.carried.pdf[i] < 0.0,
            });
        }
    }

    /// Makes lessons of the vertices of a wave whose paths have ended.
    ///
    /// Of a path that came to another such vertex, of which the guide knows something already, what it found up to there counts
    /// and then what is expected from there on: that is less noisy than what it really found (Dahm, Keller 2017, "Learning Light
    /// Transport the Reinforced Way").
    pub(in super::super) fn take_lessons(&self, w: &mut Workspace) {
        if !self.options.teaches {
            return;
        }
        // From the end, so that the next vertex of each path is known.
        let mut next: Vec<Option<Pending>> = vec![None; w.pixels.len()];
        for &pending in w.noted.iter().rev() {
            let Pending { lesson, sample, before, carried, ends, .. } = pending;
            let after = match next[sample as usize].replace(pending) {
                Some(next) if next.expected >= 0.0 => next.before + next.carried * next.expected,
                _ => w.sink.radiance(sample).luminance(),
            };
            let value = (after - before) / carried;
            let counts = !ends && value.is_finite() && after - before > LEAST_SHARE * after;
            w.lessons.push(Lesson { value: if counts { value } else { 0.0 }, ..lesson });
        }
        w.noted.clear();
    }
}

/// Finds the bins of the directions in which paths go on.
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
            v.guided.bin[i] = histogram::bin(warp::square_of_cosine_hemisphere(local));
        }
    }
}
