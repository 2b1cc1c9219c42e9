//! Mixes of materials: each hit selects one component, with a probability proportional to the luminance that it may scatter, and the
//! path continues as if the surface were of that material, with the weight over the probability as a factor of its throughput. Direct light and
//! MIS weights are those of the selected BSDF: for each selection they estimate its reflected light without bias, so that
//! the mean over selections is the reflected light of the weighted sum.

use super::Integrator;
use super::interior::Interior;
use super::sampling::Purpose;
use super::shading_geometry::HitPoint;
use super::wave::{get_rgb, set_rgb};
use super::workspace::Workspace;
use crate::color::Rgb;
use crate::compile::share_at;
use crate::sampling::sampler::{Dimensions, SobolPoint};

impl Integrator<'_> {
    /// Replaces each mix among the materials of the hits by one of its components, and adds its emission.
    pub(super) fn select_components(&self, bounce: u32, w: &mut Workspace) {
        if !self.scene.features.alpha {
            let material = |hit| self.scene.geometries.material(hit);
            w.materials.clear();
            w.materials.extend(w.hits.iter().map(|hit| if hit.is_hit() { material(hit) } else { 0 }));
        }
        w.component_weights.clear();
        if bounce == 0 && self.first_hits.any() {
            w.component_weights.resize(w.hits.len(), Rgb::ONE);
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
        w.components.clear();
        w.components.extend(components.iter().map(|component| {
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
        if let Some(weight) = w.component_weights.get_mut(i) {
            *weight = factor;
        }
    }
}
