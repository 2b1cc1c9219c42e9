//! Paths from lamps, from their start to where caustics show.

use super::super::interior::Interior;
use super::super::workspace::Workspace;
use super::super::{Integrator, Purpose};
use super::catch::Caught;
use super::passage::{MOST_PASSES, STILL};
use super::path::{CausticTally, LampPath};
use crate::bsdf::BsdfClass;
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::Role;
use crate::film::Splat;
use crate::light::Emitted;
use crate::math::{Hit, Ray};
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
        let wavelength = self.dimensions(0, Purpose::Wavelength);
        let (lights, textures) = (&self.scene.lights, &self.scene.textures);
        let start = |index: u32| {
            let point = SobolPoint::new(seed, index);
            let [a, b, c, d] = point.sample_4d(&first);
            let [of_lamp, of_ball, x, y] = point.sample_4d(&second);
            let emitted = plan.emission.sample(lights, textures, [a, b], [c, d], of_lamp, of_ball)?;
            let Emitted { ray, radiance, scale, light, is_delta } = emitted;
            let hero = if self.is_spectral() { point.sample_4d(&wavelength)[0] } else { f32::NAN };
            let waves = (!hero.is_nan()).then(|| Wavelengths::draw(hero));
            Some(LampPath {
                ray,
                radiance: self.uplift_light(radiance, Some(light), waves.as_ref()),
                hero,
                scale,
                interior: Interior::AIR,
                point,
                lens: [x, y],
                bounces: 0,
                has_roles: true,
                light,
                is_only_way: is_delta,
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
        let salt = hash32(seed ^ hash32(index)).wrapping_add(pass);
        let passage = self.passage(&path.ray, hit, salt, false);
        if passage.passes {
            next.push(LampPath { ray: self.past(&path.ray, hit), ..*path });
        }
        let Some(plan) = self.options.caustics.filter(|_| passage.meets) else { return };
        if path.bounces == 0 && !self.is_lit_along(path, hit, salt, w) {
            return;
        }
        let material = self.scene.geometries.material(hit);
        let role = plan.role(material);
        let Step { shows, goes_on } = self.step(path, role);
        let is_black = self.scene.materials[material as usize].class == BsdfClass::Black;
        if is_black || !(shows || goes_on) {
            return;
        }
        let at = self.point_of(&path.ray, *hit, material, STILL);
        let medium = &self.scene.media[usize::from(path.interior.medium())];
        let left = if self.scene.features.absorption {
            medium.transmittance_at(hit.t, path.waves().as_ref())
        } else {
            Rgb::ONE
        };
        let path = LampPath { radiance: path.radiance * left, ..*path };
        if shows {
            caught.extend(self.catch(&path, &at, material));
        }
        if goes_on {
            next.extend(self.go_on(&path, &at, role, material, w));
        }
    }

    /// Does a path that comes straight from its lamp bring light to where it hit? Its ray may start a little too near.
    fn is_lit_along(&self, path: &LampPath, hit: &Hit, salt: u32, w: &mut Workspace) -> bool {
        let Some(lamp) = self.scene.lights.area().get(path.light as usize) else { return true };
        let Some(behind) = lamp.starts_behind(path.ray.at(hit.t), &path.ray) else { return false };
        let start = Ray::segment(path.ray.origin, path.ray.direction * -behind);
        behind == 0.0 || !self.blocked(&[start], &[salt], false, w)[0]
    }

    /// What a path does where it met a surface of a role.
    fn step(&self, path: &LampPath, role: Role) -> Step {
        let (bounces, max_depth) = (path.bounces, self.options.max_depth);
        // Light is sent on first.
        let is_taken = path.has_roles
            && match role {
                Role::Sends => true,
                Role::Catches => bounces > 0,
                Role::Neither => false,
            };
        let is_free = path.is_only_way && bounces > 0;
        Step {
            shows: (is_free || is_taken && role == Role::Catches) && max_depth > bounces,
            // One scattering is left for where the light shows.
            goes_on: (is_free || is_taken) && max_depth > bounces.saturating_add(1),
        }
    }
}

/// What a path does where it met a surface.
struct Step {
    /// Its light is scattered to the camera.
    shows: bool,
    /// It goes on.
    goes_on: bool,
}
