//! The shadow on first surfaces ([`Aov::Shadow`]): which share of the light that light samples would bring is blocked.
//!
//! What a light sample brings in the picture is weighted against scattering, which finds some of the light that arrives and
//! nothing of what is blocked. The shadow takes light samples alone, without that weight, for both: so the sums are the
//! luminance that the surface would scatter to the camera with nothing in the way, and what of it does not arrive.

use super::Integrator;
use super::group::Sorted;
use super::lanes::get_rgb;
use super::workspace::Workspace;
use crate::film::Aov;
use crate::scene::RayKinds;

impl Integrator<'_> {
    /// Remembers what the shadow rays would bring if nothing was in their way.
    pub(super) fn keep_unblocked(&self, w: &mut Workspace) {
        let light = &w.wave.vertices.light;
        w.unblocked.clear();
        w.unblocked.extend(w.shadow_vertices.iter().map(|&i| get_rgb(&light.contribution, i as usize)));
    }

    /// Takes down what of it was blocked, and what arrived.
    pub(super) fn note_shadows(&self, bounce: u32, sorted: &Sorted, w: &mut Workspace) {
        let Workspace { wave, bsdfs, shadow_vertices, occluded, unblocked, passed_kinds, first_hits, .. } = w;
        for (k, (&i, &unblocked)) in shadow_vertices.iter().zip(&*unblocked).enumerate() {
            let i = i as usize;
            let (mut all, mut arrived) = (unblocked, get_rgb(&wave.vertices.light.contribution, i));
            if self.parts.kinds {
                let share = |passed| self.visible_share((bounce, i), passed, sorted, wave, bsdfs);
                let passed = passed_kinds.get(k).copied().unwrap_or(RayKinds::NONE);
                (all, arrived) = (all * share(RayKinds::NONE), arrived * share(passed));
            }
            let weight = self.weight_of_sample(bounce, sorted, wave, bsdfs, i).max(f32::MIN_POSITIVE);
            let arrived = if occluded[k] { 0.0 } else { arrived.luminance() / weight };
            let blocked = (all.luminance() / weight - arrived).max(0.0);
            let sample = wave.paths.carried.sample[i] as usize;
            first_hits.add(sample, Aov::Shadow, [blocked, arrived]);
        }
    }
}
