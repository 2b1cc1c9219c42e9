//! Mix materials: each hit selects one component with a probability proportional to weight times estimated reflectance, and throughput
//! is multiplied by the component's weight over that probability. Direct light and MIS weights use the selected BSDF only: unbiased for
//! each component, and so on average for the weighted sum.
//!
//! General BSDFs with mapped normals that face away from the viewer use the same mechanism. Glossy lobes are evaluated with a normal bent
//! towards the viewer, the diffuse base with the mapped normal ([`super::shading_groups::MetalRoughClass`]). Since such a vertex has one
//! normal, each path selects either the base or the other lobes if the two normals differ, and divides throughput by the selection
//! probability.

use super::Integrator;
use super::interior::Interior;
use super::sampling::Purpose;
use super::shading_geometry::{EvaluatedMaterial, HitPoint, local_viewer, scattering_normal};
use super::wave::{get_rgb, scale_rgb, set_rgb};
use super::workspace::Workspace;
use crate::bsdf::BsdfEval;
use crate::color::Rgb;
use crate::compile::color_at_wavelengths;
use crate::math::{Frame, Vec3};
use crate::sampling::sampler::Dimensions;

impl Integrator<'_> {
    /// Replaces each mix material hit by one of its components, and adds the mix's emission.
    pub(super) fn select_components(&self, bounce: u32, w: &mut Workspace) {
        if !self.scene.features.alpha {
            let material = |hit| self.scene.geometries.material(hit);
            w.materials.clear();
            w.materials.extend(w.hits.iter().map(|hit| if hit.is_hit() { material(hit) } else { 0 }));
        }
        if self.optional.component_weight {
            w.arriving.component_weight.as_flattened_mut().fill(1.0);
        }
        if self.scene.features.graphs {
            self.evaluate_graphs(bounce, w, |_, _, material| !material.components.is_empty());
        }
        let dimensions = self.dimensions(bounce, Purpose::Mix);
        for i in 0..w.hits.len() {
            let material = &self.scene.materials[w.materials[i] as usize];
            if w.hits[i].is_hit() && !material.components.is_empty() {
                self.select_component(bounce, i, &dimensions, w);
            }
        }
    }

    /// For hits from behind in a random walk: the component whose medium the path is in. A path exits through the component by which it
    /// entered, where the component's weight was applied already.
    fn component_around(&self, at: &HitPoint<'_>, interior: Interior) -> Option<u32> {
        if !at.is_back || !self.scene.features.subsurface {
            return None;
        }
        let medium = interior.medium();
        self.scene.media[usize::from(medium)]
            .scattering
            .as_ref()
            .filter(|scattering| !scattering.counts_as_bounces)?;
        let mut indices = at.material.components.iter().map(|component| component.index);
        indices.find(|&index| self.scene.materials[index as usize].medium_index == medium)
    }

    /// For hits from behind: the path's medium, if it is that of a component. Components with other media then can't be selected.
    fn exited_medium(&self, at: &HitPoint<'_>, interior: Interior) -> Option<u16> {
        if !at.is_back || !self.scene.features.subsurface {
            return None;
        }
        let medium = Some(interior.medium()).filter(|&medium| medium != 0)?;
        let mut indices = at.material.components.iter().map(|component| component.index);
        indices.any(|index| self.scene.materials[index as usize].medium_index == medium).then_some(medium)
    }

    fn select_component(&self, bounce: u32, i: usize, dimensions: &Dimensions, w: &mut Workspace) {
        let at = self.vertex_point(bounce, i, w);
        if let Some(component) = self.component_around(&at, w.arriving.interior[i]) {
            w.materials[i] = component;
            return;
        }
        if at.material.emission.is_some() {
            self.emit(bounce, i, &at, w);
        }
        let evaluated = w.graphs.at(i);
        let results = evaluated.and_then(|hit| w.graphs.results(hit, &at));
        let coordinates = evaluated.map_or_else(|| self.coordinates(&at), |hit| hit.coordinates);
        let wo = -w.rays[i].direction;
        let hit_data = self.missing_hit_data(results, &at, &coordinates, wo);
        let width = w.arriving.footprints.width[i];
        let slots = self.slots(&coordinates, &at.surface, wo, width, hit_data.as_ref()).with_results(results);
        let path = &mut w.arriving.state;
        let wavelengths = w.times.wavelengths(path.radiance_index[i]);
        let components = &at.material.components;
        let within = self.exited_medium(&at, w.arriving.interior[i]);
        w.components.clear();
        w.components.extend(components.iter().map(|component| {
            let filled = self.scene.materials[component.index as usize].medium_index;
            if within.is_some_and(|medium| filled != 0 && filled != medium) {
                return (Rgb::ZERO, 0.0);
            }
            let weight = color_at_wavelengths(&slots, &component.weight, wavelengths).max(Rgb::ZERO);
            (weight, weight.luminance() * component.reflectance)
        }));
        let total: f32 = w.components.iter().map(|(_, importance)| importance).sum();
        let [u, ..] = path.sobol_point(i).sample_4d(dimensions);
        let mut rest = u * total;
        // If no component reflects light, the first is selected, with weight 0.
        let (mut selected, mut factor) = (&components[0], Rgb::ZERO);
        for (component, &(weight, importance)) in components.iter().zip(&w.components) {
            if importance > 0.0 {
                (selected, factor) = (component, weight * (total / importance));
                if rest < importance {
                    break;
                }
                rest -= importance;
            }
        }
        w.materials[i] = selected.index;
        let throughput = get_rgb(&path.throughput, i) * factor;
        set_rgb(&mut path.throughput, i, throughput);
        if self.optional.component_weight {
            set_rgb(&mut w.arriving.component_weight, i, factor);
        }
    }
}

/// Minimum probability of selecting the base or the other lobes, if there are both: less variance of light samples of narrow highlights.
const MIN_PROBABILITY: f32 = 0.25;

/// The probability of selecting the base; `fraction` is the base's fraction of the directional albedo.
#[inline]
fn probability(fraction: f32) -> f32 {
    if fraction <= 0.0 || fraction >= 1.0 {
        return fraction.clamp(0.0, 1.0);
    }
    fraction.clamp(MIN_PROBABILITY, 1.0 - MIN_PROBABILITY)
}

/// BSDF value and pdf of a normal-mapped surface, with base and other lobes around their own normals; and the value of the base.
pub(super) fn eval_lobes(evaluated: &EvaluatedMaterial, ng: Vec3, [wo, wi]: [Vec3; 2]) -> (BsdfEval, Rgb) {
    let bent = Frame::from_normal(scattering_normal(evaluated.ns, ng, wo));
    let mapped = Frame::from_normal(evaluated.ns);
    let wo_bent = bent.to_local(wo);
    let (base, glossy, fraction) = evaluated.bsdf.split_layers(wo_bent);
    let (a, b) = (
        base.eval(local_viewer(&mapped, wo, ng), mapped.to_local(wi)),
        glossy.eval(wo_bent, bent.to_local(wi)),
    );
    let p = probability(fraction);
    let eval = BsdfEval {
        f_cos: a.f_cos + b.f_cos,
        pdf_solid_angle: p * a.pdf_solid_angle + (1.0 - p) * b.pdf_solid_angle,
    };
    (eval, a.f_cos)
}

impl Integrator<'_> {
    /// The material of arriving path `i` with the bent normal; if the mapped normal differs, the base or the other lobes, selected at
    /// random.
    pub(super) fn select_lobe(
        &self,
        bounce: u32,
        i: usize,
        evaluated: EvaluatedMaterial,
        [ng, wo]: [Vec3; 2],
        w: &mut Workspace,
    ) -> EvaluatedMaterial {
        let bent = scattering_normal(evaluated.ns, ng, wo);
        if !evaluated.mapping.is_mapped || bent == evaluated.ns {
            return EvaluatedMaterial { ns: bent, ..evaluated };
        }
        let (base, above, fraction) = evaluated.bsdf.split_layers(Frame::from_normal(bent).to_local(wo));
        let p = probability(fraction);
        let path = &mut w.arriving.state;
        let dimensions = self.dimensions(bounce, Purpose::Mix);
        let [_, u, ..] = path.sobol_point(i).sample_4d(&dimensions);
        let is_diffuse_base = u < p;
        scale_rgb(&mut path.throughput, i, 1.0 / if is_diffuse_base { p } else { 1.0 - p });
        let (bsdf, ns) = if is_diffuse_base { (base, evaluated.ns) } else { (above, bent) };
        EvaluatedMaterial { bsdf, ns, ..evaluated }
    }
}
