//! Shadow catchers: what samples that see one find is compared with what they would find if nothing but catchers and lights
//! was there. Such samples are traced a second time, from the same random points, past all other objects; so both differ by
//! what these objects change, and hardly by noise. `film/catcher.rs` has what becomes of both.

use super::Integrator;
use super::wave::PathParts;
use super::workspace::Workspace;
use crate::math::Hit;

/// All that paths carry.
const WHOLE: PathParts = PathParts::ALL;

impl Integrator<'_> {
    /// Are there catchers, and is what they catch asked for?
    pub(super) fn catches(&self) -> bool {
        self.options.catchers && self.scene.features.catchers
    }

    /// Is the object at a hit one that is left out now?
    #[inline(always)]
    pub(super) fn is_left_out(&self, without: bool, hit: &Hit) -> bool {
        without && hit.is_hit() && self.left_out[self.scene.geometries.material(hit) as usize]
    }

    /// By material: may its surfaces be passed now?
    #[inline(always)]
    pub(super) fn doubtful(&self, without: bool) -> &[bool] {
        if without { &self.absent_or_left_out } else { &self.may_be_absent }
    }

    /// Remembers how the paths of a wave start.
    pub(super) fn keep_starts(&self, w: &mut Workspace) {
        let count = w.rays.len();
        let starts = w.starts.get_or_insert_with(bytemuck::zeroed_box);
        for i in 0..count {
            w.arriving.copy_to(i, starts, i, WHOLE);
        }
        w.start_rays.clone_from(&w.rays);
    }

    /// Finds the samples whose camera rays hit catchers.
    pub(super) fn find_caught(&self, w: &mut Workspace) {
        w.caught.clear();
        for (i, hit) in w.hits.iter().enumerate() {
            let material = &self.scene.materials[w.materials[i] as usize];
            if hit.is_hit() && material.presence.is_some_and(|p| p.is_catcher && !p.is_holdout) {
                w.caught.push(w.arriving.carried.sample[i]);
            }
        }
        w.uncovered.extend_from_slice(&w.caught);
    }

    /// Traces the samples that see catchers without other objects, and keeps both radiances. False if `stop` said so.
    pub(super) fn trace_without(&self, w: &mut Workspace, stop: &dyn Fn() -> bool) -> bool {
        if w.caught.is_empty() {
            return true;
        }
        let samples = std::mem::take(&mut w.caught);
        let count = w.pixels.len();
        w.sink.extend(2 * count);
        w.times.repeat();
        w.rays.clear();
        if let Some(starts) = &w.starts {
            for (k, &sample) in samples.iter().enumerate() {
                starts.copy_to(sample as usize, &mut w.arriving, k, WHOLE);
                w.arriving.carried.sample[k] = sample + count as u32;
                w.rays.push(w.start_rays[sample as usize]);
            }
        }
        w.without = true;
        let is_done = self.trace_paths(w, stop);
        w.without = false;
        for &sample in &samples {
            let (with, without) = (w.sink.radiance(sample), w.sink.radiance(sample + count as u32));
            w.sink.set_caught(sample, with, without);
        }
        w.caught = samples;
        is_done
    }
}
