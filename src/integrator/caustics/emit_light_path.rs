//! Paths from lamps, from their start to where caustics show.

use super::connect_to_camera::Caught;
use super::plan::{CausticTally, LampPath};
use super::{MOST_PASSES, STILL, is_stretched};
use crate::bsdf::{Bsdf, BsdfClass, BsdfEval, BsdfSample};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::Role;
use crate::film::Splat;
use crate::integrator::interfaces::CoincidentHit;
use crate::integrator::interior::Interior;
use crate::integrator::shading_geometry::HitPoint;
use crate::integrator::shading_geometry::{bent_normal, scattering_normal, terminator};
use crate::integrator::wave::{get_rgb, set_rgb};
use crate::integrator::workspace::Workspace;
use crate::integrator::{Integrator, Purpose};
use crate::light::Emitted;
use crate::math::{Frame, Hit, Ray, Vec3, offset_along};
use crate::sampling::hash::hash32;
use crate::sampling::sampler::{Dimensions, SobolPoint};
use crate::sampling::warp;
use crate::shape::Surface;
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

// Light goes on: it is sent by smooth glass, mirrors and polished metal, and spread by other surfaces.

/// From so many surfaces on, paths may end.
const FIRST_ROULETTE: u32 = 8;
/// How often they go on then.
const SURVIVAL: f32 = 0.8;

/// Where light arrives at a surface that sends it on.
struct Sender {
    bsdf: Bsdf,
    /// Normals, on the front of the surface that `bsdf` is for.
    ng: Vec3,
    ns: Vec3,
    /// Towards where the light came from.
    wo: Vec3,
    /// Nothing else finds this light: nothing that is sent perfectly smoothly, or nothing at all.
    is_only_way: [bool; 2],
}

/// A sender, its surface, and the solids on the other side.
struct Crossing {
    sender: Sender,
    surface: Surface,
    beyond: Interior,
}

/// ScatterParams light goes on.
struct Sent {
    direction: Vec3,
    /// What is left of the radiance.
    weight: Rgb,
    /// What becomes of measures.
    scale: f32,
    is_specular: bool,
    is_transmission: bool,
}

impl Integrator<'_> {
    /// The path behind a surface that it met; `None` if it ends.
    pub(super) fn go_on(
        &self,
        path: &LampPath,
        at: &HitPoint<'_>,
        role: Role,
        material_index: u32,
        w: &mut Workspace,
    ) -> Option<LampPath> {
        let Crossing { sender, surface, beyond } = self.meet_sender(path, at, w);
        let (material, arriving) = (at.material, &mut *w.arriving);
        let radiance = get_rgb(&arriving.carried.throughput, 0);
        let [a, b, lobe, roulette] = path.point.sample_4d(&Dimensions::new(2 + path.bounces));
        let sent = match role {
            Role::Sends => self.scatter_light(&sender, [a, b, lobe])?,
            _ => self.spread_light(&sender, material_index, [a, b, lobe])?,
        };
        let survival = match role {
            Role::Sends if path.bounces < FIRST_ROULETTE => 1.0,
            Role::Sends => SURVIVAL,
            // So that those which go on bring as much as before.
            _ => (sent.weight.max_element() * sent.scale).min(1.0),
        };
        let ng = surface.ng;
        let is_lost = material.is_absent_from_behind && sent.direction.dot(ng) <= 0.0;
        if roulette >= survival || is_lost {
            return None;
        }
        let side = if sent.direction.dot(ng) < 0.0 { -1.0 } else { 1.0 };
        let origin = offset_along(surface.p, ng * side, ng.abs().dot(surface.p_error));
        Some(LampPath {
            ray: Ray { origin_primitive: (&at.hit).into(), ..Ray::new(origin, sent.direction) },
            radiance: radiance * sent.weight,
            scale: path.scale * sent.scale / survival,
            interior: if sent.is_transmission { beyond } else { arriving.interior[0] },
            bounces: path.bounces + 1,
            has_roles: path.has_roles && role != Role::Neither,
            is_only_way: path.is_only_way && (path.bounces > 0 || sent.is_specular),
            ..*path
        })
    }

    /// What light meets where it arrives at a surface; the lane of paths from lamps holds its state then.
    fn meet_sender(&self, path: &LampPath, at: &HitPoint<'_>, w: &mut Workspace) -> Crossing {
        let waves = path.waves();
        let waves = waves.as_ref();
        let (wo, material, arriving) = (-path.ray.direction, at.material, &mut *w.arriving);
        arriving.interior[0] = path.interior;
        set_rgb(&mut arriving.carried.throughput, 0, path.radiance);
        (arriving.carried.seed[0], arriving.carried.shuffled[0]) = path.point.to_parts();
        let is_solid = material.medium_index != 0;
        if is_solid && at.is_back {
            self.assume_inside(material, at.hit.t, 0, arriving, waves);
        }
        let (bsdf, ns) = self.read_material(at, 0.0, wo, waves);
        let is_only_way = [path.is_only_way, path.is_only_way && path.bounces > 0];
        let mut sender = Sender { bsdf, ng: at.surface.ng, ns, wo, is_only_way };
        let (mut beyond, mut surface) = (arriving.interior[0], at.surface);
        if is_solid {
            let boundary = match self.touching(&path.ray, at) {
                None => self.boundary(bsdf, material, at.is_back, (path.bounces, 0), arriving, waves),
                Some(touching) => {
                    let met = CoincidentHit { at: *at, bsdf, ns, width: 0.0 };
                    let (met, boundary) =
                        self.coincident_interface(met, touching, wo, (path.bounces, 0), arriving, waves);
                    surface = met.at.surface;
                    (sender.ng, sender.ns) = (surface.ng, met.ns);
                    boundary
                }
            };
            (sender.bsdf, beyond) = (boundary.bsdf, boundary.beyond);
            if boundary.is_inverted {
                (sender.ng, sender.ns) = (-sender.ng, -sender.ns);
            }
        }
        Crossing { sender, surface, beyond }
    }

    fn scatter_light(&self, at: &Sender, u: [f32; 3]) -> Option<Sent> {
        let Sender { bsdf, ng, ns, wo, .. } = at;
        // Both normals must agree on which side the light is.
        if wo.dot(*ng) * wo.dot(*ns) <= 0.0 {
            return None;
        }
        let frame = Frame::from_normal(*ns);
        let sample = bsdf.sample(frame.to_local(*wo), u);
        let direction = frame.to_world(sample.wi);
        let crosses = direction.dot(*ng) * wo.dot(*ng) < 0.0;
        if sample.pdf_solid_angle <= 0.0 || crosses != sample.is_transmission || direction.dot(*ng) == 0.0 {
            return None;
        }
        let is_left = || {
            let is_bent = self.scene.features.bent_normals && bent_normal(*ns, *ng, direction).1;
            is_bent || is_stretched(*ns, *ng, direction, *wo)
        };
        if !at.is_only_way[usize::from(!sample.is_specular)] && is_left() {
            return None;
        }
        match sample.is_specular {
            true => Some(Self::send_on(at, &sample, direction)),
            false => self.send_glossy(at, &sample, direction),
        }
    }

    /// By a perfectly smooth surface. What BSDFs scale radiance by at refractions differs from what they scale flux by.
    fn send_on(at: &Sender, sample: &BsdfSample, direction: Vec3) -> Sent {
        let Sender { ng, ns, wo, .. } = at;
        let scale = (wo.dot(*ns) * direction.dot(*ng)) / (wo.dot(*ng) * direction.dot(*ns));
        Sent {
            direction,
            weight: sample.weight * sample.flux,
            scale: if ns == ng { 1.0 } else { scale.abs() },
            is_specular: true,
            is_transmission: sample.is_transmission,
        }
    }

    /// By a polished one that is opaque: what it scatters to a viewer in the direction chosen.
    fn send_glossy(&self, at: &Sender, sample: &BsdfSample, direction: Vec3) -> Option<Sent> {
        let Sender { bsdf, ng, ns, wo, .. } = at;
        if sample.is_transmission {
            return None;
        }
        let ns = scattering_normal(*ns, *ng, direction);
        let frame = Frame::from_normal(ns);
        let f_cos = bsdf.eval(frame.to_local(direction), frame.to_local(*wo)).f_cos;
        let side = if direction.dot(*ng) < 0.0 { -1.0 } else { 1.0 };
        let kept = if self.softens_terminator() { terminator(ns * side, *ng * side, *wo) } else { 1.0 };
        Some(Sent {
            direction,
            weight: f_cos * (kept / sample.pdf_solid_angle),
            scale: (direction.dot(*ng) / wo.dot(*ng)).abs(),
            is_specular: false,
            is_transmission: false,
        })
    }

    /// By any other surface: what it scatters to a viewer in the direction chosen.
    fn spread_light(&self, at: &Sender, material: u32, [a, b, lobe]: [f32; 3]) -> Option<Sent> {
        let Sender { bsdf, ng, ns, wo: wi, .. } = at;
        let catcher = self.catcher(material, *bsdf, [*ns, *ng]);
        let (direction, pdf) = if catcher.is_lambert || catcher.is_opaque && ns != ng {
            // For viewers wherever they see the surface.
            let side = if wi.dot(*ng) < 0.0 { -1.0 } else { 1.0 };
            let local = warp::cosine_hemisphere([a, b]);
            let direction = Frame::from_normal(*ng * side).to_world(local);
            (direction, warp::cosine_hemisphere_pdf_solid_angle(local.z))
        } else {
            let frame = Frame::from_normal(scattering_normal(*ns, *ng, *wi));
            let sample = bsdf.sample(frame.to_local(*wi), [a, b, lobe]);
            let direction = frame.to_world(sample.wi);
            let crosses = direction.dot(*ng) * wi.dot(*ng) < 0.0;
            if crosses != sample.is_transmission {
                return None;
            }
            if sample.is_specular && sample.pdf_solid_angle > 0.0 {
                return Some(Self::send_on(at, &sample, direction));
            }
            (direction, sample.pdf_solid_angle)
        };
        let heights = [direction.dot(*ng), wi.dot(*ng)];
        if pdf <= 0.0 || heights.contains(&0.0) {
            return None;
        }
        let BsdfEval { f_cos, pdf_solid_angle } = self.scattered(&catcher.seen(direction, *wi))?;
        Some(Sent {
            direction,
            // What a path from the camera would be scattered with.
            weight: f_cos / pdf_solid_angle,
            scale: pdf_solid_angle / pdf * (heights[0] / heights[1]).abs(),
            is_specular: false,
            is_transmission: heights[0] * heights[1] < 0.0,
        })
    }
}
