//! Light paths: from their start at a light over casters and receivers.

use super::connect_to_camera::CameraConnection;
use super::plan::{CausticTally, LightPath};
use super::{MAX_PASSES, STILL, is_stretched};
use crate::bsdf::{BsdfClass, BsdfEval, BsdfSample};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::CausticRole;
use crate::film::Splat;
use crate::integrator::interfaces::CoincidentHit;
use crate::integrator::interior::Interior;
use crate::integrator::shading_geometry::HitPoint;
use crate::integrator::shading_geometry::{EvaluatedMaterial, bent_normal, scattering_normal};
use crate::integrator::wave::{get_rgb, set_rgb};
use crate::integrator::workspace::Workspace;
use crate::integrator::{Integrator, Purpose};
use crate::light::EmittedRay;
use crate::math::{Frame, Hit, Ray, Vec3, offset_along};
use crate::sampling::hash::hash32;
use crate::sampling::sampler::{Dimensions, SobolPoint};
use crate::sampling::warp;
use crate::shape::Surface;
use std::ops::Range;

/// Minimum cosine between the directions of a path before and behind panes that it passed straight on.
const STRAIGHT: f32 = 1.0 - 4e-6;

/// Separates the seeds of light paths from those of pixels.
const LIGHT_PATH_SEED: u32 = 0x3c6e_f372;

impl Integrator<'_> {
    /// Traces some of the light paths for sample `sample` of each pixel, and adds their contributions to `splats`.
    pub fn trace_light_paths(
        &self,
        sample: u32,
        paths: Range<u32>,
        w: &mut Workspace,
        splats: &mut Vec<Splat>,
    ) -> CausticTally {
        let before = w.ray_counts.all;
        let mut paths = self.start_light_paths(sample, paths);
        let mut connections = Vec::new();
        // The bound guards against endless stacks of absent surfaces.
        for pass in 0..MAX_PASSES {
            if paths.is_empty() {
                break;
            }
            w.rays.clear();
            w.rays.extend(paths.iter().map(|path| path.ray));
            w.intersect_still(&self.scene.accel);
            let hits = std::mem::take(&mut w.hits);
            let mut next = Vec::new();
            for (path, hit) in paths.iter().zip(&hits).filter(|(_, hit)| hit.is_hit()) {
                self.handle_hit(path, hit, pass, w, &mut next, &mut connections);
            }
            w.hits = hits;
            paths = next;
        }
        let tally = self.splat(&connections, w, splats);
        CausticTally { rays: w.ray_counts.all - before, ..tally }
    }

    fn start_light_paths(&self, sample: u32, paths: Range<u32>) -> Vec<LightPath> {
        let Some(plan) = self.options.caustics else { return Vec::new() };
        let seed = hash32(hash32(plan.seed ^ LIGHT_PATH_SEED).wrapping_add(sample));
        let (first, second) = (Dimensions::new(0), Dimensions::new(1));
        let wavelength = self.dimensions(0, Purpose::Wavelength);
        let (lights, textures) = (&self.scene.lights, &self.scene.textures);
        let start = |index: u32| {
            let point = SobolPoint::new(seed, index);
            let [a, b, c, d] = point.sample_4d(&first);
            let [of_light, of_ball, x, y] = point.sample_4d(&second);
            let emitted = plan.emission.sample(lights, textures, [a, b], [c, d], of_light, of_ball)?;
            let EmittedRay { ray, radiance, scale, light, is_delta } = emitted;
            let hero = self.is_spectral().then(|| point.sample_4d(&wavelength)[0]);
            let wavelengths = hero.map(Wavelengths::draw);
            Some(LightPath {
                ray,
                start: ray.direction,
                radiance: self.uplift_light(radiance, Some(light), wavelengths.as_ref()),
                hero,
                scale,
                interior: Interior::AIR,
                point,
                lens: [x, y],
                bounces: 0,
                has_roles: true,
                is_straight: true,
                light,
                is_only_way: is_delta,
            })
        };
        paths.filter_map(start).collect()
    }

    /// Connects a path that hit something to the camera, and continues it.
    fn handle_hit(
        &self,
        path: &LightPath,
        hit: &Hit,
        pass: u32,
        w: &mut Workspace,
        next: &mut Vec<LightPath>,
        connections: &mut Vec<CameraConnection>,
    ) {
        let (seed, index) = path.point.to_parts();
        let salt = hash32(seed ^ hash32(index)).wrapping_add(pass);
        let passage = self.passage(&path.ray, hit, salt, false);
        if passage.passes {
            next.push(LightPath { ray: self.past(&path.ray, hit), ..*path });
        }
        let Some(plan) = self.options.caustics.filter(|_| passage.hits) else { return };
        if path.bounces == 0 && !self.is_lit_along(path, hit, salt, w) {
            return;
        }
        let material = self.scene.geometries.material(hit);
        let role = plan.role(material);
        let Step { connects, continues } = self.step(path, role);
        let is_black = self.scene.materials[material as usize].class == BsdfClass::Black;
        if is_black || !(connects || continues) {
            return;
        }
        let at = self.point_of(&path.ray, *hit, material, STILL);
        let medium = &self.scene.media[usize::from(path.interior.medium())];
        let left = if self.scene.features.absorption {
            medium.transmittance_at(hit.t, path.wavelengths().as_ref())
        } else {
            Rgb::ONE
        };
        let path = LightPath { radiance: path.radiance * left, ..*path };
        if connects {
            connections.extend(self.connect_to_camera(&path, &at, material));
        }
        if continues {
            next.extend(self.continue_path(&path, &at, role, material, w));
        }
    }

    /// Does a path that comes straight from its light bring light to where it hit? Its ray may start a little too near.
    fn is_lit_along(&self, path: &LightPath, hit: &Hit, salt: u32, w: &mut Workspace) -> bool {
        let Some(emitter) = self.scene.lights.area().get(path.light as usize) else { return true };
        let Some(behind) = emitter.starts_behind(path.ray.at(hit.t), &path.ray) else { return false };
        let start = Ray::segment(path.ray.origin, path.ray.direction * -behind);
        behind == 0.0 || !self.blocked(&[start], &[salt], false, w)[0]
    }

    /// What a path does at a surface with this role.
    fn step(&self, path: &LightPath, role: CausticRole) -> Step {
        let (bounces, max_depth) = (path.bounces, self.options.max_depth);
        // What it would bring to a surface that scatters is found there by light samples through panes.
        if path.is_straight && bounces > 0 && role != CausticRole::Caster {
            return Step { connects: false, continues: false };
        }
        // The first surface must be a caster.
        let is_taken = path.has_roles
            && match role {
                CausticRole::Caster => true,
                CausticRole::Receiver | CausticRole::DiffuseReceiver => bounces > 0,
                CausticRole::Neither => false,
            };
        let is_free = path.is_only_way && bounces > 0;
        Step {
            connects: (is_free || is_taken && role != CausticRole::Caster) && max_depth > bounces,
            // The connection to the camera needs one more bounce.
            continues: (is_free || is_taken) && max_depth > bounces.saturating_add(1),
        }
    }
}

/// What a path does at a surface.
struct Step {
    /// It is connected to the camera.
    connects: bool,
    /// It continues.
    continues: bool,
}

// Scattering of light paths at casters and receivers.

/// Number of bounces from which on Russian roulette applies at casters.
const FIRST_ROULETTE: u32 = 8;
/// Probability of survival there.
const SURVIVAL: f32 = 0.8;

/// A hit of a light path at a surface that scatters it.
struct CasterPoint {
    /// Its material; normals are on the side that its BSDF is for.
    evaluated: EvaluatedMaterial,
    ng: Vec3,
    /// Direction back along the path.
    wo: Vec3,
    /// No path from the camera finds this light: if it is scattered specularly here, or in any way.
    is_only_way: [bool; 2],
}

/// A hit of a caster with its surface and the solids on the other side.
struct CasterHit {
    caster: CasterPoint,
    surface: Surface,
    beyond: Interior,
}

/// A light path's next direction.
struct Redirected {
    direction: Vec3,
    /// Factor of the radiance.
    weight: Rgb,
    /// Factor of the flux for a radiance of 1.
    scale: f32,
    is_specular: bool,
    is_transmission: bool,
}

impl Integrator<'_> {
    /// The path behind a hit; `None` if it ends.
    pub(super) fn continue_path(
        &self,
        path: &LightPath,
        at: &HitPoint<'_>,
        role: CausticRole,
        material_index: u32,
        w: &mut Workspace,
    ) -> Option<LightPath> {
        let CasterHit { caster, surface, beyond } = self.caster_at(path, at, w);
        let (material, arriving) = (at.material, &mut *w.arriving);
        let radiance = get_rgb(&arriving.state.throughput, 0);
        let [a, b, lobe, roulette] = path.point.sample_4d(&Dimensions::new(2 + path.bounces));
        let scattered = match role {
            CausticRole::Caster => self.scatter_at_caster(&caster, [a, b, lobe])?,
            _ => self.scatter_at_receiver(path, &caster, material_index, [a, b, lobe])?,
        };
        let survival = match role {
            CausticRole::Caster if path.bounces < FIRST_ROULETTE => 1.0,
            CausticRole::Caster => SURVIVAL,
            // The flux of surviving paths stays the same.
            _ => (scattered.weight.max_element() * scattered.scale).min(1.0),
        };
        let ng = surface.ng;
        let is_lost = material.is_absent_from_behind && scattered.direction.dot(ng) <= 0.0;
        if roulette >= survival || is_lost {
            return None;
        }
        let side = if scattered.direction.dot(ng) < 0.0 { -1.0 } else { 1.0 };
        let origin = offset_along(surface.p, ng * side, ng.abs().dot(surface.p_error));
        Some(LightPath {
            ray: Ray { origin_primitive: (&at.hit).into(), ..Ray::new(origin, scattered.direction) },
            radiance: radiance * scattered.weight,
            scale: path.scale * scattered.scale / survival,
            interior: if scattered.is_transmission { beyond } else { arriving.interior[0] },
            bounces: path.bounces + 1,
            is_straight: path.is_straight && self.goes_straight_on(path, at, &scattered),
            has_roles: path.has_roles && role != CausticRole::Neither,
            is_only_way: path.is_only_way && (path.bounces > 0 || scattered.is_specular),
            ..*path
        })
    }

    /// Does a path that hit only panes enter one, continue within, or leave it in its first direction?
    fn goes_straight_on(&self, path: &LightPath, at: &HitPoint<'_>, scattered: &Redirected) -> bool {
        if at.material.pane_thickness <= 0.0 {
            return false;
        }
        match (at.is_back, scattered.is_transmission) {
            // Reflected within.
            (true, false) => true,
            (true, true) => scattered.direction.dot(path.start) > STRAIGHT,
            (false, true) => {
                self.enters_pane((&path.ray, &at.hit, STILL), path.interior, path.wavelengths().as_ref())
            }
            (false, false) => false,
        }
    }

    /// The caster at a hit. Lane 0 of the arriving paths holds the state of the light path afterwards.
    fn caster_at(&self, path: &LightPath, at: &HitPoint<'_>, w: &mut Workspace) -> CasterHit {
        let wavelengths = path.wavelengths();
        let wavelengths = wavelengths.as_ref();
        let (wo, material, arriving) = (-path.ray.direction, at.material, &mut *w.arriving);
        arriving.interior[0] = path.interior;
        set_rgb(&mut arriving.state.throughput, 0, path.radiance);
        (arriving.state.seed[0], arriving.state.shuffled[0]) = path.point.to_parts();
        let is_solid = material.medium_index != 0;
        if is_solid && at.is_back {
            self.assume_inside(material, at.hit.t, 0, arriving, wavelengths);
        }
        let evaluated = self.read_material(at, 0.0, wo, wavelengths);
        let is_only_way = [path.is_only_way, path.is_only_way && path.bounces > 0];
        let mut caster = CasterPoint { evaluated, ng: at.surface.ng, wo, is_only_way };
        let (mut beyond, mut surface) = (arriving.interior[0], at.surface);
        if is_solid {
            let boundary = match self.coincident_surfaces(&path.ray, at) {
                None => self.boundary(
                    evaluated.bsdf,
                    material,
                    at.is_back,
                    (path.bounces, 0),
                    arriving,
                    wavelengths,
                ),
                Some(touching) => {
                    let first = CoincidentHit { at: *at, evaluated, width: 0.0 };
                    let (refracting, boundary) = self.coincident_interface(
                        first,
                        touching,
                        wo,
                        (path.bounces, 0),
                        arriving,
                        wavelengths,
                    );
                    surface = refracting.at.surface;
                    (caster.ng, caster.evaluated) = (surface.ng, refracting.evaluated);
                    boundary
                }
            };
            (caster.evaluated.bsdf, beyond) = (boundary.bsdf, boundary.beyond);
            if boundary.is_inverted {
                (caster.ng, caster.evaluated.ns) = (-caster.ng, -caster.evaluated.ns);
                caster.evaluated.mapping = caster.evaluated.mapping.on_side(-1.0);
            }
        }
        CasterHit { caster, surface, beyond }
    }

    fn scatter_at_caster(&self, at: &CasterPoint, u: [f32; 3]) -> Option<Redirected> {
        let CasterPoint { evaluated: EvaluatedMaterial { bsdf, ns, .. }, ng, wo, .. } = at;
        // Both normals must agree on the side.
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
            true => Some(Self::scatter_specular(at, &sample, direction)),
            false => self.scatter_glossy(at, &sample, direction),
        }
    }

    /// Specular scattering. Refraction scales flux and radiance differently: `sample.flux` is the ratio.
    fn scatter_specular(at: &CasterPoint, sample: &BsdfSample, direction: Vec3) -> Redirected {
        let CasterPoint { evaluated: EvaluatedMaterial { ns, .. }, ng, wo, .. } = at;
        let scale = (wo.dot(*ns) * direction.dot(*ng)) / (wo.dot(*ng) * direction.dot(*ns));
        Redirected {
            direction,
            weight: sample.weight * sample.flux,
            scale: if ns == ng { 1.0 } else { scale.abs() },
            is_specular: true,
            is_transmission: sample.is_transmission,
        }
    }

    /// Scattering by an opaque polished surface: the BSDF for a path from the camera that arrives from the sampled direction.
    fn scatter_glossy(&self, at: &CasterPoint, sample: &BsdfSample, direction: Vec3) -> Option<Redirected> {
        let CasterPoint { evaluated, ng, wo, .. } = at;
        let EvaluatedMaterial { bsdf, ns, .. } = evaluated;
        if sample.is_transmission {
            return None;
        }
        let ns = scattering_normal(*ns, *ng, direction);
        let frame = Frame::from_normal(ns);
        let (viewer, light) = (frame.to_local(direction), frame.to_local(*wo));
        let f_cos = bsdf.eval(viewer, light).f_cos;
        let side = if direction.dot(*ng) < 0.0 { -1.0 } else { 1.0 };
        let normals = [ns * side, evaluated.mapping.smooth * side, *ng * side];
        let diffuse = bsdf.diffuse_part(viewer, light);
        let (f_cos, kept) =
            self.terminator().left((f_cos, diffuse), evaluated.relief(), (normals[0], normals), *wo);
        Some(Redirected {
            direction,
            weight: f_cos * (kept / sample.pdf_solid_angle),
            scale: (direction.dot(*ng) / wo.dot(*ng)).abs(),
            is_specular: false,
            is_transmission: false,
        })
    }

    /// Scattering by any other surface: the BSDF for a path from the camera that arrives from the sampled direction.
    fn scatter_at_receiver(
        &self,
        path: &LightPath,
        at: &CasterPoint,
        material: u32,
        [a, b, lobe]: [f32; 3],
    ) -> Option<Redirected> {
        let CasterPoint { evaluated, ng, wo: wi, .. } = at;
        let EvaluatedMaterial { bsdf, ns, .. } = evaluated;
        let receiver = self.receiver(path, material, *evaluated, *ng);
        let (direction, pdf) = if receiver.is_lambert || receiver.is_opaque && ns != ng {
            // The whole hemisphere of the geometric normal.
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
                return Some(Self::scatter_specular(at, &sample, direction));
            }
            (direction, sample.pdf_solid_angle)
        };
        let heights = [direction.dot(*ng), wi.dot(*ng)];
        if pdf <= 0.0 || heights.contains(&0.0) {
            return None;
        }
        let BsdfEval { f_cos, pdf_solid_angle } = self.scattered(&receiver.seen(direction, *wi))?;
        Some(Redirected {
            direction,
            // The weight of a path from the camera.
            weight: f_cos / pdf_solid_angle,
            scale: pdf_solid_angle / pdf * (heights[0] / heights[1]).abs(),
            is_specular: false,
            is_transmission: heights[0] * heights[1] < 0.0,
        })
    }
}
