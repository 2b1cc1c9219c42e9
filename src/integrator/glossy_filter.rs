//! The glossy filter of Cycles: what a path hits after a bounce in an unlikely direction is roughened, so that caustics off smooth
//! surfaces are blurred instead of noisy. Pictures lose their contrast, and some light.
//!
//! Facets have a GGX alpha of at least `0.5 sqrt(1 - p / f)`, where `p` is the smallest density of a direction that the path has
//! sampled so far and `f` the strength of the filter, exact mirrors and smooth solid glass as well. Panes stay smooth, unlike in Cycles: light
//! samples pass them, so that there is nothing to blur, and a sun shines through a window.

use super::Integrator;
use super::shading_groups::SortedVertices;
use super::workspace::Workspace;

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
