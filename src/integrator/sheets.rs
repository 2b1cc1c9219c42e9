//! Smooth thin sheets of glass, which light passes straight on.
//!
//! Light samples reach through them, with what the sheets let pass. So that no light counts twice, a scattered ray that
//! competes with light sampling (its density is above 0) does not scatter at a sheet either, but passes with a
//! probability and stays the ray that it was, with its origin and its density: lights that it meets behind the sheet are
//! weighted as any others. Else it scatters by what is left without the light that goes straight on. Rays that don't
//! compete (from the camera, from mirrors) scatter at sheets as at all surfaces.

use super::Integrator;
use super::lanes::{get_rgb, set_rgb};
use super::normals::scattering_normal;
use super::wave::{Carried, LightLanes};
use super::workspace::Workspace;
use crate::bsdf::Bsdf;
use crate::color::Rgb;
use crate::math::{Frame, Hit, Ray};
use crate::sampling::hash::{hash32, unit};

/// Keeps the choice whether to pass a sheet apart from others with the same salt.
const SHEET: u32 = 0x5bd1_e995;

impl Integrator<'_> {
    /// Does the ray of arriving path `i` pass the sheet that it hit, if it is one? The path then carries what is left.
    pub(super) fn passes_sheet(
        &self,
        i: usize,
        ray: &Ray,
        hit: &Hit,
        time: f32,
        salt: u32,
        path: &mut Carried,
    ) -> bool {
        if path.pdf[i] <= 0.0 {
            return false;
        }
        let passing = self.straight(ray, hit, time);
        let probability = passing.max_element().min(1.0);
        let passes = unit(hash32(salt ^ SHEET)) < probability;
        if passes {
            let throughput = get_rgb(&path.throughput, i);
            set_rgb(&mut path.throughput, i, throughput * passing / probability);
        }
        passes
    }

    /// What arriving path `i`, which did not pass a sheet though it might have, finds there.
    pub(super) fn stop_at_sheet(&self, bsdf: Bsdf, i: usize, w: &mut Workspace) -> Bsdf {
        let time = w.times.of(w.arriving.carried.sample[i]);
        let stops = 1.0 - self.straight(&w.rays[i], &w.hits[i], time).max_element();
        let throughput = &mut w.arriving.carried.throughput;
        let value = get_rgb(throughput, i);
        set_rgb(throughput, i, if stops > 0.0 { value / stops } else { Rgb::ZERO });
        bsdf.without_straight()
    }

    /// Does the light of the sample of vertex `i` pass the sheet that its shadow ray hit, if it is one? The contribution
    /// becomes what is left.
    pub(super) fn light_passes_sheet(
        &self,
        i: usize,
        ray: &Ray,
        hit: &Hit,
        time: f32,
        light: &mut LightLanes,
    ) -> bool {
        let contribution = get_rgb(&light.contribution, i) * self.straight(ray, hit, time);
        let passes = contribution.max_element() > 0.0;
        if passes {
            set_rgb(&mut light.contribution, i, contribution);
        }
        passes
    }

    /// Share of light that passes straight on where a ray hit; zero at all but smooth thin sheets.
    fn straight(&self, ray: &Ray, hit: &Hit, time: f32) -> Rgb {
        if !hit.is_hit() {
            return Rgb::ZERO;
        }
        let index = self.scene.geometries.material(hit);
        if !self.scene.materials[index as usize].passes_straight {
            return Rgb::ZERO;
        }
        let wo = -ray.direction.normalize();
        let at = self.point_of(ray, *hit, index, time);
        // A point, as all that competes with light sampling.
        let (bsdf, ns) = self.read_material(&at, 0.0, wo, None);
        let ns = scattering_normal(ns, at.surface.ng, wo);
        bsdf.straight(Frame::from_normal(ns).to_local(wo))
    }
}
