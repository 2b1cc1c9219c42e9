//! Paths from lamps, from their start to where caustics show.

use super::super::Integrator;
use super::super::interior::Interior;
use super::super::workspace::Workspace;
use super::catch::Caught;
use super::passage::{MOST_PASSES, STILL};
use super::path::{CausticTally, LampPath};
use crate::bsdf::BsdfClass;
use crate::color::Rgb;
use crate::compile::Role;
use crate::film::Splat;
use crate::light::Emitted;
use crate::math::Hit;
use crate::sampling::hash::hash32;
use crate::sampling::sampler::{Dimensions, SobolPoint};
use std::ops::Range;

/// Keeps the seeds of paths from lamps apart from those of pixels.
const LAMPS: u32 = 0x3c6e_f372;

impl Integrator<'_> {
    /// Traces some of the paths from lamps that stand for sample `sample` of each pixel, and adds what they bring to `splats`.
    pub fn trace_from_lamps(
        &self,
        sample: u32,
        paths: Range<u32>,
        w: &mut Workspace,
        splats: &mut Vec<Splat>,
    ) -> CausticTally {
        let before = w.ray_counts.all;
        let mut paths = self.start_at_lamps(sample, paths);
        let mut caught = Vec::new();
        // A guard against endless stacks of surfaces that let light pass.
        for pass in 0..MOST_PASSES {
            if paths.is_empty() {
                break;
            }
            w.rays.clear();
            w.rays.extend(paths.iter().map(|path| path.ray));
            w.intersect_still(&self.scene.accel);
            let hits = std::mem::take(&mut w.hits);
            let mut next = Vec::new();
            for (path, hit) in paths.iter().zip(&hits).filter(|(_, hit)| hit.is_hit()) {
                self.arrive(path, hit, pass, w, &mut next, &mut caught);
            }
            w.hits = hits;
            paths = next;
        }
        let tally = self.show(&caught, w, splats);
        CausticTally { rays: w.ray_counts.all - before, ..tally }
    }

    fn start_at_lamps(&self, sample: u32, paths: Range<u32>) -> Vec<LampPath> {
        let Some(plan) = self.options.caustics else { return Vec::new() };
        let seed = hash32(hash32(plan.seed ^ LAMPS).wrapping_add(sample));
        let (first, second) = (Dimensions::new(0), Dimensions::new(1));
        let (lights, textures) = (&self.scene.lights, &self.scene.textures);
        let start = |index: u32| {
            let point = SobolPoint::new(seed, index);
            let [a, b, c, d] = point.sample_4d(&first);
            let [of_lamp, of_ball, x, y] = point.sample_4d(&second);
            let emitted = plan.emission.sample(lights, textures, [a, b], [c, d], of_lamp, of_ball)?;
            let Emitted { ray, radiance, scale, light, is_delta } = emitted;
            Some(LampPath {
                ray,
                radiance,
                scale,
                interior: Interior::AIR,
                point,
                lens: [x, y],
                bounces: 0,
                is_specular: true,
                light,
                is_delta,
            })
        };
        paths.filter_map(start).collect()
    }

    /// What becomes of a path that hit something.
    fn arrive(
        &self,
        path: &LampPath,
        hit: &Hit,
        pass: u32,
        w: &mut Workspace,
        next: &mut Vec<LampPath>,
        caught: &mut Vec<Caught>,
    ) {
        let (seed, index) = path.point.to_parts();
        let passage = self.passage(&path.ray, hit, hash32(seed ^ hash32(index)).wrapping_add(pass), false);
        if passage.passes {
            next.push(LampPath { ray: self.past(&path.ray, hit), ..*path });
        }
        let Some(plan) = self.options.caustics.filter(|_| passage.meets) else { return };
        let material = self.scene.geometries.material(hit);
        let role = plan.role(material);
        let is_shown = path.bounces > 0 && self.options.max_depth > path.bounces;
        let shows = is_shown
            && match role {
                Role::Catches => true,
                Role::Sends => false,
                Role::Neither => path.is_delta && path.is_specular,
            };
        let is_black = self.scene.materials[material as usize].class == BsdfClass::Black;
        if is_black || !(shows || role == Role::Sends) {
            return;
        }
        let at = self.point_of(&path.ray, *hit, material, STILL);
        let medium = &self.scene.media[usize::from(path.interior.medium())];
        let left = if self.scene.features.absorption { medium.transmittance(hit.t) } else { Rgb::ONE };
        let path = LampPath { radiance: path.radiance * left, ..*path };
        match role {
            Role::Sends => next.extend(self.send(&path, &at, w)),
            _ => caught.extend(self.catch(&path, &at, material)),
        }
    }
}
