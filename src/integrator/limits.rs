//! Limits of paths: the number of their bounces, in all and by kind; caustics that are left out; and the glossy filter.
//!
//! A path that has reached a limit ends at the next vertex, which adds emission but samples no light: so the light of its last
//! scattering event is still found in both ways, by light samples and by the ray that hits it, and MIS weights hold.
//!
//! The glossy filter of Cycles: what a path hits after a bounce in an unlikely direction is roughened, so that caustics off smooth
//! surfaces are blurred instead of noisy. Pictures lose their contrast, and some light.
//!
//! Facets have a GGX alpha of at least `0.5 sqrt(1 - p / f)`, where `p` is the smallest density of a direction that the path has
//! sampled so far and `f` the strength of the filter, exact mirrors and smooth solid glass as well. Panes stay smooth, unlike in Cycles: light
//! samples pass them, so that there is nothing to blur, and a sun shines through a window.

use super::Integrator;
use super::shading_groups::{ShadingGroup, ShadingGroupCounts, SortedVertices};
use super::wave::{Paths, set_rgb};
use super::workspace::Workspace;
use crate::color::Rgb;
use crate::scene::RayKinds;

impl Integrator<'_> {
    /// Ends paths that have reached a limit, and counts the hits of each shading group again.
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

    /// Counts the scattered rays of all sorted vertices by kind, except those within solids that scatter light.
    pub(super) fn count_bounces_by_kind(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let paths = &mut w.wave.paths;
        for i in sorted.all() {
            if !self.is_in_walk(i, paths) {
                paths.bounce_counts[i].count(paths.visibility[i].kind());
            }
        }
    }

    /// Is path `i` on a random walk within a solid?
    fn is_in_walk(&self, i: usize, paths: &Paths) -> bool {
        if !self.optional.interior {
            return false;
        }
        let medium = &self.scene.media[usize::from(paths.interior[i].medium())];
        medium.scattering.as_ref().is_some_and(|s| !s.counts)
    }
}

// Caustics that are left out, as in Cycles where its Reflective or Refractive Caustics are off: a surface that a diffusely scattered
// ray hits has no glossy reflection, or no transmission. What is under a layer that is gone gets the light that the layer
// would have reflected.

impl Integrator<'_> {
    /// Takes the lobes of caustics from the BSDFs of the sorted vertices.
    #[cold]
    #[inline(never)]
    pub(super) fn leave_out_caustics(&self, sorted: &SortedVertices, w: &mut Workspace) {
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
            bsdfs[i - general.start].leave_out(skipped);
        }
    }
}

impl Integrator<'_> {
    /// Roughens the BSDFs of the sorted vertices.
    pub(super) fn filter_glossy(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let Workspace { wave, bsdfs, .. } = w;
        let least = |i: usize| {
            let share = 1.0 - wave.paths.least_pdf[i] / self.options.filter_glossy;
            if share > 0.0 { 0.5 * share.sqrt() } else { 0.0 }
        };
        for i in sorted.metal_rough() {
            // The closure keeps its weights.
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

    /// Records the densities of the scattered directions.
    pub(super) fn record_densities(&self, sorted: &SortedVertices, bounce: u32, w: &mut Workspace) {
        let branches = self.bsdf_samples_per_light_sample(bounce);
        for i in sorted.all() {
            let pdf = w.wave.paths.state.pdf[i];
            if pdf.is_alive() && !pdf.is_specular() {
                let is_guided = sorted.guided().contains(&i);
                let density = pdf.value() / branches;
                let density = if is_guided { self.unguided(density, &w.wave, i) } else { density };
                let least = &mut w.wave.paths.least_pdf[i];
                *least = least.min(density);
            }
        }
    }
}
