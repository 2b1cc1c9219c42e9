//! Glass that is transparent in pictures: camera rays that pass smooth glass, from surface to surface, and then leave the scene
//! see what lies behind the picture. Their samples are transparent by as much as they carry (the mean of their throughput's
//! three channels: pictures have one alpha), and the environment and suns are not seen there, as where no glass is.
//!
//! Only transmission by smooth surfaces counts, which camera rays and their successors follow without a choice of directions.
//! What is reflected on the way, at either side of the glass, shows the environment: it is light on the glass. So it is in
//! Cycles ("Transparent Glass" with a roughness threshold of 0).

use super::Integrator;
use super::group::Sorted;
use super::interior::AroundCamera;
use super::lanes::{get, get_rgb};
use super::workspace::Workspace;
use crate::color::Rgb;

impl Integrator<'_> {
    /// What is special to pictures becomes transparent; other samples may do so later.
    pub(super) fn decide_alpha(&self, sorted: &Sorted, w: &mut Workspace) {
        if !w.uncovered.is_empty() {
            self.uncover(w);
        }
        if self.parts.clear {
            self.start_clear(sorted, w);
        }
    }

    /// All paths whose samples are opaque may see through glass: what catchers and holdouts are has an alpha of its own.
    fn start_clear(&self, sorted: &Sorted, w: &mut Workspace) {
        let paths = &mut w.wave.paths;
        for i in sorted.all() {
            paths.clear[i] = u32::from(w.sink.is_covered(paths.carried.sample[i]));
        }
    }

    /// What throughput says less of light that comes into the medium around the camera: there, radiance is larger by the square of
    /// its index of refraction, which is no matter of how much passes.
    fn share_of_outside(&self) -> Rgb {
        let AroundCamera::Same(interior) = self.camera_interior else { return Rgb::ONE };
        let iors = self.scene.media[usize::from(interior.medium())].iors.unwrap_or([1.0; 3]);
        Rgb::from_array(iors.map(|ior| 1.0 / (ior * ior)))
    }

    /// Takes down which paths just passed a smooth surface, and nothing else before.
    pub(super) fn keep_clear(&self, sorted: &Sorted, w: &mut Workspace) {
        let (paths, v) = (&mut w.wave.paths, &w.wave.vertices);
        let general = sorted.general();
        for i in sorted.all() {
            let (wo, wi, ng) = (get(&v.wo, i), get(&v.next_direction, i), get(&v.ng, i));
            let passes = general.contains(&i) && paths.carried.pdf[i] == 0.0 && wo.dot(ng) * wi.dot(ng) < 0.0;
            paths.clear[i] &= u32::from(passes);
        }
    }

    /// Makes the samples of clear paths that leave the scene transparent; these paths find no light then.
    pub(super) fn see_through(&self, w: &mut Workspace) {
        let Workspace { escaped, arriving, sink, .. } = w;
        let share = self.share_of_outside();
        escaped.retain(|&i| {
            let i = i as usize;
            let is_clear = arriving.clear[i] != 0;
            if is_clear {
                let left = get_rgb(&arriving.carried.throughput, i) * share;
                sink.make_transparent(arriving.carried.sample[i], (left.r + left.g + left.b) / 3.0);
            }
            !is_clear
        });
    }
}
