//! Mixes of materials: each hit selects one component, with a probability proportional to the luminance that it may scatter, and the
//! path continues as if the surface were of that material, with the weight over the probability as a factor of its throughput. Direct light and
//! MIS weights are those of the selected BSDF: for each selection they estimate its reflected light without bias, so that
//! the mean over selections is the reflected light of the weighted sum.
//!
//! Mapped normals that face away from the viewer are such a selection, too. Facets are evaluated around a normal that is bent
//! towards the viewer ([`super::shading_geometry::bent_normal`]). The diffuse base beneath doesn't depend on the viewer and keeps the normal that the map gives, as in Cycles 5.0. A vertex has one normal:
//! where both differ, each path selects the base or all else, as at a mix of materials, and its throughput is divided
//! by the probability.

use super::Integrator;
use super::interior::Interior;
use super::sampling::Purpose;
use super::shading_geometry::{
    EvaluatedMaterial, HitPoint, UNMAPPED, WHOLE_LIGHT, local_viewer, scattering_normal,
};
use super::wave::{Lanes3, Vertices, get, get_rgb, set, set_rgb};
use super::workspace::Workspace;
use crate::bsdf::BsdfEval;
use crate::color::Rgb;
use crate::compile::share_at;
use crate::math::{Frame, Vec3};
use crate::sampling::sampler::{Dimensions, SobolPoint};
use std::ops::Range;

impl Integrator<'_> {
    /// Replaces each mix among the materials of the hits by one of its components, and adds its emission.
    pub(super) fn select_components(&self, bounce: u32, w: &mut Workspace) {
        if !self.scene.features.alpha {
            let material = |hit| self.scene.geometries.material(hit);
            w.materials.clear();
            w.materials.extend(w.hits.iter().map(|hit| if hit.is_hit() { material(hit) } else { 0 }));
        }
        if self.optional.component_weight {
            w.arriving.component_weight.as_flattened_mut().fill(1.0);
        }
        let dimensions = self.dimensions(bounce, Purpose::Mix);
        for i in 0..w.hits.len() {
            let material = &self.scene.materials[w.materials[i] as usize];
            if w.hits[i].is_hit() && !material.components.is_empty() {
                self.select_component(bounce, i, &dimensions, w);
            }
        }
    }

    /// The component whose interior the path arrives from, from behind: light leaves a solid through the component that it entered by,
    /// and the component's weight was applied there.
    fn component_around(&self, at: &HitPoint<'_>, interior: Interior) -> Option<u32> {
        if !at.is_back || !self.scene.features.subsurface {
            return None;
        }
        let medium = interior.medium();
        self.scene.media[usize::from(medium)].scattering.as_ref().filter(|scattering| !scattering.counts)?;
        let mut indices = at.material.components.iter().map(|component| component.index);
        indices.find(|&index| self.scene.materials[index as usize].medium_index == medium)
    }

    /// The medium of one of its components whose interior the path arrives from, from behind. What fills solids with others doesn't
    /// take part there.
    fn medium_left(&self, at: &HitPoint<'_>, interior: Interior) -> Option<u16> {
        if !at.is_back || !self.scene.features.subsurface {
            return None;
        }
        let medium = Some(interior.medium()).filter(|&medium| medium != 0)?;
        let mut indices = at.material.components.iter().map(|component| component.index);
        indices.any(|index| self.scene.materials[index as usize].medium_index == medium).then_some(medium)
    }

    fn select_component(&self, bounce: u32, i: usize, dimensions: &Dimensions, w: &mut Workspace) {
        let at = self.hit_point(bounce, i, w);
        if let Some(component) = self.component_around(&at, w.arriving.interior[i]) {
            w.materials[i] = component;
            return;
        }
        if at.material.emission.is_some() {
            self.emit(bounce, i, &at, w);
        }
        let footprints = self.scene.features.footprints;
        let coordinates = self.scene.geometries.coordinates(&at.surface, &at.hit, footprints, at.time);
        let wo = -w.rays[i].direction;
        let hit_data = self.hit_data(&at, &coordinates, wo);
        let width = w.arriving.footprints.width[i];
        let slots = self.slots(&coordinates, &at.surface, wo, width, hit_data.as_ref());
        let path = &mut w.arriving.state;
        let wavelengths = w.times.wavelengths(path.radiance_index[i]);
        let components = &at.material.components;
        let within = self.medium_left(&at, w.arriving.interior[i]);
        w.components.clear();
        w.components.extend(components.iter().map(|component| {
            let filled = self.scene.materials[component.index as usize].medium_index;
            if within.is_some_and(|medium| filled != 0 && filled != medium) {
                return (Rgb::ZERO, 0.0);
            }
            let weight = share_at(&slots, &component.weight, wavelengths).max(Rgb::ZERO);
            (weight, weight.luminance() * component.reflectance)
        }));
        let total: f32 = w.components.iter().map(|(_, importance)| importance).sum();
        let [u, ..] = SobolPoint::from_parts(path.seed[i], path.shuffled[i]).sample_4d(dimensions);
        let mut left = u * total;
        // Where no component scatters light, the first one absorbs it.
        let (mut selected, mut factor) = (&components[0], Rgb::ZERO);
        for (component, &(weight, importance)) in components.iter().zip(&w.components) {
            if importance > 0.0 {
                (selected, factor) = (component, weight * (total / importance));
                if left < importance {
                    break;
                }
                left -= importance;
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

/// Probability of either part at least, where there are both: light samples of narrow highlights vary less by that.
const MIN_PROBABILITY: f32 = 0.25;

/// The probability of selecting the base, for its fraction of the directional albedo.
#[inline]
fn probability(share: f32) -> f32 {
    if share <= 0.0 || share >= 1.0 {
        return share.clamp(0.0, 1.0);
    }
    share.clamp(MIN_PROBABILITY, 1.0 - MIN_PROBABILITY)
}

/// Value and density of a mapped surface for a viewer, with each part around its own normal; and the value of its base.
pub(super) fn eval_lobes(evaluated: &EvaluatedMaterial, ng: Vec3, [wo, wi]: [Vec3; 2]) -> (BsdfEval, Rgb) {
    let facets = Frame::from_normal(scattering_normal(evaluated.ns, ng, wo));
    let base = Frame::from_normal(evaluated.ns);
    let wo_facets = facets.to_local(wo);
    let (of_base, of_facets, share) = evaluated.bsdf.split_base(wo_facets);
    let (a, b) = (
        of_base.eval(local_viewer(&base, wo, ng), base.to_local(wi)),
        of_facets.eval(wo_facets, facets.to_local(wi)),
    );
    let p = probability(share);
    let eval = BsdfEval {
        f_cos: a.f_cos + b.f_cos,
        pdf_solid_angle: p * a.pdf_solid_angle + (1.0 - p) * b.pdf_solid_angle,
    };
    (eval, a.f_cos)
}

impl Integrator<'_> {
    /// Keeps the shading normals of vertices of opaque glTF materials from before they are bent.
    pub(super) fn keep_unbent_normals(&self, range: Range<usize>, v: &mut Vertices) {
        if self.scene.features.mapped_normals {
            for c in 0..3 {
                let (from, to): (&Lanes3, &mut Lanes3) = (&v.ns, &mut v.unbent);
                to[c][range.clone()].copy_from_slice(&from[c][range.clone()]);
            }
        }
    }

    /// Selects parts of opaque glTF materials whose mapped normals were bent.
    pub(super) fn select_lobes(&self, bounce: u32, range: Range<usize>, w: &mut Workspace) {
        if !self.scene.features.mapped_normals {
            return;
        }
        let dimensions = self.dimensions(bounce, Purpose::Mix);
        let (path, v) = (&mut w.wave.paths.state, &mut w.wave.vertices);
        for i in range {
            if v.relief[i] == UNMAPPED {
                continue;
            }
            let closures = &mut v.metal_rough_closures;
            let share = closures.probability_diffuse[i];
            if share <= 0.0 {
                v.relief[i] = WHOLE_LIGHT;
            }
            if v.is_bent[i] == 0.0 {
                continue;
            }
            let p = probability(share);
            let [_, u, ..] = SobolPoint::from_parts(path.seed[i], path.shuffled[i]).sample_4d(&dimensions);
            let is_base = u < p;
            if is_base {
                for part in [&mut closures.f0, &mut closures.schlick_rise, &mut closures.exact_rise] {
                    set_rgb(part, i, Rgb::ZERO);
                }
                let unbent = get(&v.unbent, i);
                set(&mut v.ns, i, unbent);
            } else {
                set_rgb(&mut closures.diffuse, i, Rgb::ZERO);
                v.relief[i] = WHOLE_LIGHT;
            }
            closures.probability_diffuse[i] = if is_base { 1.0 } else { 0.0 };
            closures.probability_specular[i] = if is_base { 0.0 } else { 1.0 };
            let throughput = get_rgb(&path.throughput, i);
            set_rgb(&mut path.throughput, i, throughput * (1.0 / if is_base { p } else { 1.0 - p }));
        }
    }

    /// The material at the vertex of arriving path `i`, with the normal that its BSDF is evaluated around; one of its parts where they need two.
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
        let (base, above, share) = evaluated.bsdf.split_base(Frame::from_normal(bent).to_local(wo));
        let p = probability(share);
        let path = &mut w.arriving.state;
        let dimensions = self.dimensions(bounce, Purpose::Mix);
        let [_, u, ..] = SobolPoint::from_parts(path.seed[i], path.shuffled[i]).sample_4d(&dimensions);
        let is_base = u < p;
        let throughput = get_rgb(&path.throughput, i);
        set_rgb(&mut path.throughput, i, throughput * (1.0 / if is_base { p } else { 1.0 - p }));
        let (bsdf, ns) = if is_base { (base, evaluated.ns) } else { (above, bent) };
        EvaluatedMaterial { bsdf, ns, ..evaluated }
    }
}
