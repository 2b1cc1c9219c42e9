//! Limits of paths: maximum numbers of bounces, in all and by kind; disabled caustics; and the glossy filter.
//!
//! A path that has reached a limit ends at the next vertex, which adds emission but samples no light. So both light sampling and BSDF
//! sampling estimate the direct light of the last bounce, as the MIS weights assume.
//!
//! The glossy filter of Cycles: after a bounce in a direction of low pdf, BSDFs are roughened, which blurs noisy caustics and loses some
//! of their energy.
//!
//! The GGX alpha, also of mirrors and smooth solid glass, is at least `0.5 sqrt(1 - p / f)`, with `p` the smallest pdf (1/sr) of a
//! direction sampled by the path so far and `f` the strength of the filter. Panes stay smooth, unlike in Cycles: shadow rays pass
//! them, so that they cause no caustics, and the sun shines through windows.

use super::Integrator;
use super::shading_groups::{ShadingGroup, ShadingGroupCounts, SortedVertices};
use super::wave::{Paths, set_rgb};
use super::workspace::Workspace;
use crate::color::Rgb;
use crate::compile::Scattering;
use crate::scene::{BounceLimits, RayKinds};

impl Integrator<'_> {
    /// Ends paths that have reached a limit, and recounts the hits of each shading group.
    pub(super) fn end_deep_paths(&self, w: &mut Workspace) -> ShadingGroupCounts {
        let mut counts = ShadingGroupCounts::new();
        for (i, group) in w.groups.iter_mut().enumerate() {
            let is_deep = self.optional.depth && w.arriving.depth[i] >= self.options.max_depth;
            let limits = &self.options.bounces;
            let is_at_limit = self.optional.bounce_counts && w.arriving.bounce_counts[i].reach(limits);
            let has_passed_all =
                self.optional.transparent_count && w.arriving.transparent_count[i] >= limits.transparent;
            if is_deep || is_at_limit || has_passed_all {
                *group = ShadingGroup::None;
            }
            counts.add(*group);
        }
        counts
    }

    /// Counts a bounce at all sorted vertices except scattering events of random walks within solids.
    pub(super) fn count_bounces(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let in_media = sorted.medium();
        for i in sorted.all() {
            let is_walk = in_media.contains(&i) && self.is_in_walk(i, &w.wave.paths);
            w.wave.paths.depth[i] += u32::from(!is_walk);
        }
    }

    /// Counts the scattered rays of all sorted vertices by kind, except those of random walks within solids.
    pub(super) fn count_bounces_by_kind(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let paths = &mut w.wave.paths;
        for i in sorted.all() {
            if !self.is_in_walk(i, paths) {
                paths.bounce_counts[i].count(paths.visibility[i].kind());
            }
        }
    }

    /// Is path `i` on a random walk within a solid, whose scattering events aren't counted?
    fn is_in_walk(&self, i: usize, paths: &Paths) -> bool {
        if !self.optional.interior {
            return false;
        }
        let medium = &self.scene.media[usize::from(paths.interior[i].medium())];
        medium.scattering.as_ref().is_some_and(|s| !s.counts_as_bounces && !self.limits_scattering_in(s))
    }

    /// Does the limit of scattering in media apply to the medium of a solid with a surface? Not to subsurface scattering.
    pub(super) fn limits_scattering_in(&self, scattering: &Scattering) -> bool {
        !scattering.is_subsurface && self.options.bounces.volume != BounceLimits::NONE.volume
    }

    /// Counts a scattering event of a random walk of path `i`; false if the path has reached a limit before.
    pub(super) fn counts_step(&self, scattering: &Scattering, i: usize, paths: &mut Paths) -> bool {
        if !self.limits_scattering_in(scattering) {
            return true;
        }
        if self.optional.depth {
            paths.depth[i] += 1;
        }
        let counts = &mut paths.bounce_counts[i];
        let is_at_limit = counts.reach(&self.options.bounces);
        counts.count(RayKinds::VOLUME);
        !is_at_limit
    }
}

// Disabled caustics, as Cycles without Reflective or Refractive Caustics: BSDFs hit by diffusely scattered rays lose their glossy
// reflection, or their transmission. The layers below receive the light that a removed layer would have reflected.

impl Integrator<'_> {
    /// Removes the lobes of disabled caustics from the BSDFs of the sorted vertices.
    #[cold]
    #[inline(never)]
    pub(super) fn remove_caustic_lobes(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let skipped = self.options.skip_caustics;
        let Workspace { wave, bsdfs, .. } = w;
        let (visibility, materials) = (&wave.paths.visibility, &mut wave.vertices.metal_rough);
        let is_diffuse = |i: usize| visibility[i].kind() == RayKinds::DIFFUSE;
        for i in sorted.metal_rough().filter(|&i| skipped.reflective && is_diffuse(i)) {
            set_rgb(&mut materials.layer_f0, i, Rgb::ZERO);
            set_rgb(&mut materials.metal_f0, i, Rgb::ZERO);
            (materials.layer_f90[i], materials.metallic[i]) = (0.0, 0.0);
        }
        let general = sorted.general();
        for i in general.clone().filter(|&i| is_diffuse(i)) {
            bsdfs[i - general.start].remove_lobes(skipped);
        }
    }

    /// Applies the glossy filter to the BSDFs of the sorted vertices.
    pub(super) fn filter_glossy(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let Workspace { wave, bsdfs, .. } = w;
        let least = |i: usize| {
            let fraction = 1.0 - wave.paths.min_pdf[i] / self.options.filter_glossy;
            if fraction > 0.0 { 0.5 * fraction.sqrt() } else { 0.0 }
        };
        for i in sorted.metal_rough() {
            // Lobe weights don't change.
            let alpha = &mut wave.vertices.metal_rough.alpha[i];
            *alpha = alpha.max(least(i));
        }
        let first = sorted.general().start;
        let has_panes = self.scene.features.panes;
        let origins = &wave.vertices.origin_primitives;
        let is_pane = |i: usize| {
            self.scene.materials[self.scene.geometries.material_of(origins[i]) as usize].pane_thickness > 0.0
        };
        for i in sorted.rough().filter(|&i| !(has_panes && is_pane(i))) {
            bsdfs[i - first].roughen(least(i));
        }
    }

    /// Updates each path's smallest pdf of a sampled direction, for the glossy filter.
    pub(super) fn record_densities(&self, sorted: &SortedVertices, bounce: u32, w: &mut Workspace) {
        let branches = self.bsdf_samples_per_light_sample(bounce);
        for i in sorted.all() {
            let pdf = w.wave.paths.state.pdf[i];
            if pdf.is_alive() && !pdf.is_specular() {
                let is_guided = sorted.guided().contains(&i);
                let density = pdf.value() / branches;
                let density = if is_guided { self.unguided(density, &w.wave, i) } else { density };
                let least = &mut w.wave.paths.min_pdf[i];
                *least = least.min(density);
            }
        }
    }
}
