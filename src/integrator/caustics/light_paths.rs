//! Light tracing: emission of light paths, scattering at casters and receivers, connections to the camera, and splatting.

use super::plan::{CausticStats, LightPath};
use super::{MAX_PASSES, STATIC_TIME, has_large_correction};
use crate::bsdf::{Bsdf, BsdfClass, BsdfEval, BsdfSample};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::CausticRole;
use crate::film::{Splat, SplatPart};
use crate::integrator::interfaces::CoincidentHit;
use crate::integrator::interior::{CameraInterior, Interior};
use crate::integrator::mixes::eval_lobes;
use crate::integrator::radiance_buffer::PathClass;
use crate::integrator::shading_geometry::{
    EvaluatedMaterial, HitPoint, Mapping, Terminator, bent_normal, scattering_normal,
};
use crate::integrator::shading_groups::ShadingGroup;
use crate::integrator::wave::{FirstBounce, get_rgb, set_rgb};
use crate::integrator::workspace::Workspace;
use crate::integrator::{Integrator, Purpose};
use crate::light::EmittedRay;
use crate::math::{Frame, Hit, Ray, Vec3, offset_along};
use crate::sampling::hash::{hash32, unit};
use crate::sampling::sampler::{Dimensions, SobolPoint};
use crate::sampling::warp;
use crate::scene::RayKinds;
use crate::shape::Surface;
use std::f32::consts::FRAC_1_PI;
use std::ops::Range;

/// Minimum cosine between a path's directions before and after transmission through panes without deviation.
const STRAIGHT: f32 = 1.0 - 4e-6;

/// Decorrelates light paths from camera paths.
const LIGHT_PATH_SEED: u32 = 0x3c6e_f372;

/// Decorrelates the pixels of connections from their opacity tests.
const SPLAT_SEED: u32 = 0x5be0_cd19;

impl Integrator<'_> {
    /// Traces a range of the light paths of sample index `sample`, and appends their contributions to `splats`.
    pub fn trace_light_paths(
        &self,
        sample: u32,
        paths: Range<u32>,
        w: &mut Workspace,
        splats: &mut Vec<Splat>,
    ) -> CausticStats {
        let before = w.ray_counts.all;
        let mut paths = self.start_light_paths(sample, paths);
        let mut connections = Vec::new();
        // The bound ends endless stacks of transparent surfaces.
        for pass in 0..MAX_PASSES {
            if paths.is_empty() {
                break;
            }
            w.rays.clear();
            w.rays.extend(paths.iter().map(|path| path.ray));
            w.intersect_static(&self.scene.accel);
            let hits = std::mem::take(&mut w.hits);
            let mut next = Vec::new();
            for (path, hit) in paths.iter().zip(&hits).filter(|(_, hit)| hit.is_hit()) {
                self.handle_hit(path, hit, pass, w, &mut next, &mut connections);
            }
            w.hits = hits;
            paths = next;
        }
        let stats = self.splat(&connections, w, splats);
        CausticStats { rays: w.ray_counts.all - before, ..stats }
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
            let [u_light, u_target, x, y] = point.sample_4d(&second);
            let emitted = plan.emission.sample(lights, textures, [a, b], [c, d], u_light, u_target)?;
            let EmittedRay { ray, radiance, scale, light, is_delta } = emitted;
            let hero = self.is_spectral().then(|| point.sample_4d(&wavelength)[0]);
            let wavelengths = hero.map(Wavelengths::sample);
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
                has_only_caustic_roles: true,
                is_straight: true,
                light,
                has_no_camera_path: is_delta,
            })
        };
        paths.filter_map(start).collect()
    }

    /// Connects a path to the camera at a hit, and continues the path.
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
        if path.bounces == 0 && !self.is_unoccluded_from_emitter(path, hit, salt, w) {
            return;
        }
        let material = self.scene.geometries.material(hit);
        let role = plan.role(material);
        let Step { connects, continues } = self.step(path, role);
        let is_black = self.scene.materials[material as usize].class == BsdfClass::Black;
        if is_black || !(connects || continues) {
            return;
        }
        let at = self.ray_hit_point(&path.ray, *hit, material, STATIC_TIME);
        let medium = &self.scene.media[usize::from(path.interior.medium())];
        let transmittance = if self.scene.features.absorption {
            medium.transmittance_at(hit.t, path.wavelengths().as_ref())
        } else {
            Rgb::ONE
        };
        let path = LightPath { radiance: path.radiance * transmittance, ..*path };
        if connects {
            connections.extend(self.connect_to_camera(&path, &at, material));
        }
        if continues {
            next.extend(self.continue_path(&path, &at, role, material, w));
        }
    }

    /// Does a path's first ray reach the hit unoccluded from the emitter? The ray may start in front of the emitter's surface, so the
    /// part behind its origin is tested too.
    fn is_unoccluded_from_emitter(&self, path: &LightPath, hit: &Hit, salt: u32, w: &mut Workspace) -> bool {
        let Some(emitter) = self.scene.lights.area().get(path.light as usize) else { return true };
        let Some(offset) = emitter.emission_offset(path.ray.at(hit.t), &path.ray) else { return false };
        let start = Ray::segment(path.ray.origin, path.ray.direction * -offset);
        offset == 0.0 || !self.blocked(&[start], &[salt], false, w)[0]
    }

    /// Whether a path connects and continues at a surface with this caustic role.
    fn step(&self, path: &LightPath, role: CausticRole) -> Step {
        let (bounces, max_depth) = (path.bounces, self.options.max_depth);
        // Light that passed panes without deviation is sampled by shadow rays through panes.
        if path.is_straight && bounces > 0 && role != CausticRole::Caster {
            return Step { connects: false, continues: false };
        }
        // The first surface must be a caster.
        let is_caustic = path.has_only_caustic_roles
            && match role {
                CausticRole::Caster => true,
                CausticRole::Receiver | CausticRole::DiffuseReceiver => bounces > 0,
                CausticRole::Neither => false,
            };
        let has_no_camera_path = path.has_no_camera_path && bounces > 0;
        Step {
            connects: (has_no_camera_path || is_caustic && role != CausticRole::Caster)
                && max_depth > bounces,
            // The connection to the camera needs one more bounce.
            continues: (has_no_camera_path || is_caustic) && max_depth > bounces.saturating_add(1),
        }
    }
}

/// Whether a light path connects to the camera and continues at a surface.
struct Step {
    connects: bool,
    continues: bool,
}

// Scattering of light paths at casters and receivers.

/// First bounce with Russian roulette at casters.
const FIRST_ROULETTE: u32 = 8;
/// Survival probability of Russian roulette at casters.
const SURVIVAL: f32 = 0.8;

/// A scattering vertex of a light path.
struct CasterPoint {
    /// The material; normals are on the side of the BSDF.
    evaluated: EvaluatedMaterial,
    ng: Vec3,
    /// Direction back along the path.
    wo: Vec3,
    /// Whether no camera path finds the path: after specular scattering here, and after any scattering.
    has_no_camera_path: [bool; 2],
}

/// A scattering vertex of a light path, with its surface and the interior on the other side.
struct CasterHit {
    caster: CasterPoint,
    surface: Surface,
    far_interior: Interior,
}

/// A sampled direction in which a light path continues.
struct ScatteredLight {
    direction: Vec3,
    /// Factor on [`LightPath::radiance`].
    weight: Rgb,
    /// Factor on [`LightPath::scale`].
    scale: f32,
    is_specular: bool,
    is_transmission: bool,
}

impl Integrator<'_> {
    /// The path after scattering at a hit; `None` if the path ends.
    fn continue_path(
        &self,
        path: &LightPath,
        at: &HitPoint<'_>,
        role: CausticRole,
        material_index: u32,
        w: &mut Workspace,
    ) -> Option<LightPath> {
        let CasterHit { caster, surface, far_interior } = self.caster_at(path, at, w);
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
            // Surviving paths keep their flux.
            _ => (scattered.weight.max_element() * scattered.scale).min(1.0),
        };
        let ng = surface.ng;
        let is_lost = material.is_single_sided && scattered.direction.dot(ng) <= 0.0;
        if roulette >= survival || is_lost {
            return None;
        }
        let side = if scattered.direction.dot(ng) < 0.0 { -1.0 } else { 1.0 };
        let origin = offset_along(surface.p, ng * side, ng.abs().dot(surface.p_error));
        Some(LightPath {
            ray: Ray { origin_primitive: (&at.hit).into(), ..Ray::new(origin, scattered.direction) },
            radiance: radiance * scattered.weight,
            scale: path.scale * scattered.scale / survival,
            interior: if scattered.is_transmission { far_interior } else { arriving.interior[0] },
            bounces: path.bounces + 1,
            is_straight: path.is_straight && self.stays_straight(path, at, &scattered),
            has_only_caustic_roles: path.has_only_caustic_roles && role != CausticRole::Neither,
            has_no_camera_path: path.has_no_camera_path && (path.bounces > 0 || scattered.is_specular),
            ..*path
        })
    }

    /// Does a path that hit only panes so far enter a pane, reflect within it, or leave it in the path's initial direction?
    fn stays_straight(&self, path: &LightPath, at: &HitPoint<'_>, scattered: &ScatteredLight) -> bool {
        if at.material.pane_thickness <= 0.0 {
            return false;
        }
        match (at.is_back, scattered.is_transmission) {
            // Reflection within the pane.
            (true, false) => true,
            (true, true) => scattered.direction.dot(path.start) > STRAIGHT,
            (false, true) => self.enters_pane(
                (&path.ray, &at.hit, STATIC_TIME),
                path.interior,
                path.wavelengths().as_ref(),
            ),
            (false, false) => false,
        }
    }

    /// Evaluates the material at a hit. Also writes the light path's state to lane 0 of the arriving paths.
    fn caster_at(&self, path: &LightPath, at: &HitPoint<'_>, w: &mut Workspace) -> CasterHit {
        let wavelengths = path.wavelengths();
        let wavelengths = wavelengths.as_ref();
        let (wo, material, arriving) = (-path.ray.direction, at.material, &mut *w.arriving);
        arriving.interior[0] = path.interior;
        set_rgb(&mut arriving.state.throughput, 0, path.radiance);
        arriving.state.set_sobol_point(0, path.point);
        let is_solid = material.medium_index != 0;
        if is_solid && at.is_back {
            self.assume_inside(material, at.hit.t, 0, arriving, wavelengths);
        }
        let evaluated = self.read_material(at, 0.0, wo, wavelengths);
        let has_no_camera_path = [path.has_no_camera_path, path.has_no_camera_path && path.bounces > 0];
        let mut caster = CasterPoint { evaluated, ng: at.surface.ng, wo, has_no_camera_path };
        let (mut far_interior, mut surface) = (arriving.interior[0], at.surface);
        if is_solid {
            let boundary = match self.coincident_surfaces(&path.ray, at) {
                None => self.interface_hit(
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
            (caster.evaluated.bsdf, far_interior) = (boundary.bsdf, boundary.far_interior);
            if boundary.is_inverted {
                (caster.ng, caster.evaluated.ns) = (-caster.ng, -caster.evaluated.ns);
                caster.evaluated.mapping = caster.evaluated.mapping.on_side(-1.0);
            }
        }
        CasterHit { caster, surface, far_interior }
    }

    fn scatter_at_caster(&self, at: &CasterPoint, u: [f32; 3]) -> Option<ScatteredLight> {
        let CasterPoint { evaluated: EvaluatedMaterial { bsdf, ns, .. }, ng, wo, .. } = at;
        // `wo` must be on the same side of both normals.
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
        let is_left_to_camera_paths = || {
            let is_bent = self.scene.features.bent_normals && bent_normal(*ns, *ng, direction).1;
            is_bent || has_large_correction(*ns, *ng, direction, *wo)
        };
        if !at.has_no_camera_path[usize::from(!sample.is_specular)] && is_left_to_camera_paths() {
            return None;
        }
        match sample.is_specular {
            true => Some(Self::scatter_specular(at, &sample, direction)),
            false => self.scatter_glossy(at, &sample, direction),
        }
    }

    /// Specular scattering. `sample.flux` is the ratio of the factors on flux and radiance, 1 except for refraction.
    fn scatter_specular(at: &CasterPoint, sample: &BsdfSample, direction: Vec3) -> ScatteredLight {
        let CasterPoint { evaluated: EvaluatedMaterial { ns, .. }, ng, wo, .. } = at;
        let scale = (wo.dot(*ns) * direction.dot(*ng)) / (wo.dot(*ng) * direction.dot(*ns));
        ScatteredLight {
            direction,
            weight: sample.weight * sample.flux,
            scale: if ns == ng { 1.0 } else { scale.abs() },
            is_specular: true,
            is_transmission: sample.is_transmission,
        }
    }

    /// Reflection by a glossy opaque surface: the BSDF with the sampled direction as `wo`, as for a camera path.
    fn scatter_glossy(
        &self,
        at: &CasterPoint,
        sample: &BsdfSample,
        direction: Vec3,
    ) -> Option<ScatteredLight> {
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
        let normals = [ns * side, evaluated.mapping.smooth_normal * side, *ng * side];
        let diffuse = bsdf.diffuse_part(viewer, light);
        let (f_cos, kept) =
            self.terminator().apply((f_cos, diffuse), evaluated.bump_mode(), (normals[0], normals), *wo);
        Some(ScatteredLight {
            direction,
            weight: f_cos * (kept / sample.pdf_solid_angle),
            scale: (direction.dot(*ng) / wo.dot(*ng)).abs(),
            is_specular: false,
            is_transmission: false,
        })
    }

    /// Scattering by a receiver: the BSDF with the sampled direction as `wo`, as for a camera path.
    fn scatter_at_receiver(
        &self,
        path: &LightPath,
        at: &CasterPoint,
        material: u32,
        [a, b, lobe]: [f32; 3],
    ) -> Option<ScatteredLight> {
        let CasterPoint { evaluated, ng, wo: wi, .. } = at;
        let EvaluatedMaterial { bsdf, ns, .. } = evaluated;
        let receiver = self.receiver(path, material, *evaluated, *ng);
        let (direction, pdf) = if receiver.is_lambert || receiver.is_opaque && ns != ng {
            // Cosine-weighted over the hemisphere of the geometric normal.
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
        let cosines = [direction.dot(*ng), wi.dot(*ng)];
        if pdf <= 0.0 || cosines.contains(&0.0) {
            return None;
        }
        let BsdfEval { f_cos, pdf_solid_angle } =
            self.eval_receiver(&receiver.with_directions(direction, *wi))?;
        Some(ScatteredLight {
            direction,
            // The weight of a BSDF sample of a camera path.
            weight: f_cos / pdf_solid_angle,
            scale: pdf_solid_angle / pdf * (cosines[0] / cosines[1]).abs(),
            is_specular: false,
            is_transmission: cosines[0] * cosines[1] < 0.0,
        })
    }
}

/// A connection of a light path to the camera.
struct CameraConnection {
    /// Shadow ray from the surface to the lens, or to the near clip distance.
    segment: Ray,
    /// Film point, pixels.
    film: [f32; 2],
    /// Contribution to a pixel for a filter weight of 1, by channel or wavelength.
    value: Rgb,
    /// `None` in RGB rendering.
    wavelengths: Option<Wavelengths>,
    /// Fractions of `value` for layers: two light passes and the light group.
    parts: Option<[(Option<usize>, Rgb); 3]>,
    /// Luminance that a camera path with the same vertices would contribute; infinite if there is none.
    value_from_camera: f32,
    salt: u32,
}

impl CameraConnection {
    /// Converts a value by channel or wavelength to linear Rec. 709.
    #[inline]
    fn rgb(&self, value: Rgb) -> [f32; 3] {
        let value = value.to_array();
        self.wavelengths.as_ref().map_or(value, |wavelengths| wavelengths.rgb(value))
    }
}

/// The BSDF and directions at a vertex that a light path connects to the camera.
#[derive(Clone, Copy)]
struct Receiver {
    bsdf: Bsdf,
    is_lambert: bool,
    /// The BSDF reflects only.
    is_opaque: bool,
    /// Only the diffuse lobes are evaluated.
    is_diffuse: bool,
    ng: Vec3,
    ns: Vec3,
    mapping: Mapping,
    /// Direction to the camera.
    wo: Vec3,
    /// Direction back along the light path.
    wi: Vec3,
}

impl Receiver {
    /// Sets the directions; normals of opaque surfaces are flipped to the side of `wo`.
    fn with_directions(self, wo: Vec3, wi: Vec3) -> Receiver {
        let side = if self.is_opaque && wo.dot(self.ng) < 0.0 { -1.0 } else { 1.0 };
        Receiver {
            ng: self.ng * side,
            ns: self.ns * side,
            mapping: self.mapping.on_side(side),
            wo,
            wi,
            ..self
        }
    }
}

impl Integrator<'_> {
    /// The connection of a hit to the camera, before the visibility test.
    fn connect_to_camera(
        &self,
        path: &LightPath,
        at: &HitPoint<'_>,
        material: u32,
    ) -> Option<CameraConnection> {
        let connection = self.view.camera.connect(at.surface.p, path.lens)?;
        let margin = self.options.filter.radius();
        let is_within = |at: f32, size: u32| at > -margin && at < size as f32 + margin;
        let is_on_film = |[x, y]: [f32; 2]| is_within(x, self.view.width) && is_within(y, self.view.height);
        if !self.view.camera.equivalent_film_points(connection.film).any(is_on_film) {
            return None;
        }
        let is_back = connection.direction.dot(at.surface.ng) <= 0.0;
        let is_hidden =
            at.material.surface_visibility.is_some_and(|p| !p.visible_to.contains(RayKinds::CAMERA));
        if is_hidden || at.material.is_single_sided && is_back {
            return None;
        }
        let wavelengths = path.wavelengths();
        // Texture footprint of a ray from the camera.
        let (width, spread) = self.view.camera.pixel_cone();
        let (wo, wi) = (connection.direction, -path.ray.direction);
        let evaluated =
            self.read_material(at, width + spread * connection.distance, wo, wavelengths.as_ref());
        let receiver = self.receiver(path, material, evaluated, at.surface.ng).with_directions(wo, wi);
        let BsdfEval { f_cos, pdf_solid_angle } = self.eval_receiver(&receiver)?;
        let Receiver { ng, wo, wi, .. } = receiver;
        let area = connection.pixels_per_area * (wo.dot(ng) / wi.dot(ng)).abs();
        let plan = self.options.caustics?;
        // The segment ends at the near clip distance; absorption is that of the medium around its end.
        let [near, _] = self.view.camera.range(-connection.direction);
        let start = if near > 0.0 { connection.lens - connection.direction * near } else { connection.lens };
        let around = match self.camera_interior {
            CameraInterior::Constant(interior) => interior,
            CameraInterior::PerRay => Interior::around(self.scene, start, STATIC_TIME),
        };
        let medium = &self.scene.media[usize::from(around.medium())];
        let transmittance = if self.scene.features.absorption {
            medium.transmittance_at(connection.distance - near, wavelengths.as_ref())
        } else {
            Rgb::ONE
        };
        let value = path.radiance * f_cos * transmittance * (path.scale * area / plan.paths as f32);
        let value_from_camera = (path.radiance * f_cos).luminance() / pdf_solid_angle;
        let side = if wo.dot(ng) < 0.0 { -1.0 } else { 1.0 };
        let origin = offset_along(at.surface.p, ng * side, ng.abs().dot(at.surface.p_error));
        let segment = Ray::segment(origin, start - origin);
        let (seed, index) = path.point.to_parts();
        (value.max_element() > 0.0).then(|| CameraConnection {
            segment: Ray { origin_primitive: (&at.hit).into(), ..segment },
            film: connection.film,
            value,
            parts: self.parts_of(&receiver, path.light),
            wavelengths,
            value_from_camera: if path.has_no_camera_path { f32::INFINITY } else { value_from_camera },
            salt: hash32(seed ^ hash32(index ^ path.bounces)),
        })
    }

    /// A receiver whose directions are not set yet.
    fn receiver(
        &self,
        path: &LightPath,
        material: u32,
        EvaluatedMaterial { bsdf, ns, mapping }: EvaluatedMaterial,
        ng: Vec3,
    ) -> Receiver {
        let is_of_diffuse =
            self.options.caustics.is_some_and(|p| p.role(material) == CausticRole::DiffuseReceiver);
        let group = self.groups[material as usize];
        let is_lambert = matches!(group, ShadingGroup::FlatLambert | ShadingGroup::Lambert);
        let is_opaque = is_lambert
            || matches!(
                group,
                ShadingGroup::FlatMetalRough | ShadingGroup::Textured | ShadingGroup::MetalRough
            );
        // If no camera path finds the light, all lobes scatter it here.
        let is_diffuse = is_of_diffuse && !path.has_no_camera_path;
        Receiver { bsdf, is_lambert, is_opaque, is_diffuse, ng, ns, mapping, wo: ng, wi: ng }
    }

    /// BSDF times cosine, and the solid-angle pdf of sampling `wi` from `wo`, as a camera path would.
    fn eval_receiver(&self, at: &Receiver) -> Option<BsdfEval> {
        let Receiver { bsdf, is_lambert, is_opaque, is_diffuse, ng, ns, mapping, wo, wi } = at;
        let cosine = wi.dot(*ng);
        let crosses = cosine * wo.dot(*ng) < 0.0;
        if cosine == 0.0
            || bsdf.is_specular()
            || crosses && (*is_opaque || !bsdf.has_scattered_transmission())
        {
            return None;
        }
        let evaluated = EvaluatedMaterial { bsdf: *bsdf, ns: *ns, mapping: *mapping };
        let n = if *is_lambert { *ns } else { scattering_normal(*ns, *ng, *wo) };
        let (eval, diffuse) = if *is_lambert {
            let pdf_solid_angle = wi.dot(n).max(0.0) * FRAC_1_PI;
            let f_cos = bsdf.albedo() * pdf_solid_angle;
            (BsdfEval { f_cos, pdf_solid_angle }, f_cos)
        } else {
            let frame = Frame::from_normal(n);
            let (viewer, light) = (*wo, *wi);
            let (wo, wi) = (frame.to_local(viewer), frame.to_local(light));
            if crosses && wo.z * wi.z >= 0.0 {
                return None;
            }
            let is_split = mapping.is_mapped && n != *ns;
            let (eval, diffuse) = match is_split {
                true => eval_lobes(&evaluated, *ng, [viewer, light]),
                false => (bsdf.eval(wo, wi), bsdf.diffuse_part(wo, wi)),
            };
            let f_cos = if *is_diffuse { bsdf.diffuse_part(wo, wi).min(eval.f_cos) } else { eval.f_cos };
            (BsdfEval { f_cos, ..eval }, diffuse)
        };
        let side = if cosine < 0.0 { -1.0 } else { 1.0 };
        let terminator = if crosses { Terminator::Sharp } else { self.terminator() };
        let normals = [n * side, mapping.smooth_normal * side, *ng * side];
        let (f_cos, kept) =
            terminator.apply((eval.f_cos, diffuse), evaluated.bump_mode(), (*ns * side, normals), *wi);
        let f_cos = f_cos * kept;
        (eval.pdf_solid_angle > 0.0).then_some(BsdfEval { f_cos, ..eval })
    }

    /// The layers (light passes and light group) of a connection, with fractions of the contribution.
    fn parts_of(&self, at: &Receiver, light: u32) -> Option<[(Option<usize>, Rgb); 3]> {
        if self.layers.count() == 0 {
            return None;
        }
        let Receiver { bsdf, is_lambert, is_diffuse, ng, ns, wo, wi, .. } = at;
        let first = match *is_lambert || *is_diffuse {
            true => FirstBounce::DIFFUSE,
            false => FirstBounce::of(bsdf, [scattering_normal(*ns, *ng, *wo), *ng], *wo, *wi),
        };
        let [a, b] = self.layers.pass_fractions(PathClass::Indirect(first));
        let group = self.layers.of_group(usize::from(self.scene.light_groups.of_light(light)));
        Some([a, b, (group, Rgb::ONE)])
    }

    /// Tests the visibility of connections and splats the unoccluded ones.
    fn splat(
        &self,
        connections: &[CameraConnection],
        w: &mut Workspace,
        splats: &mut Vec<Splat>,
    ) -> CausticStats {
        let segments: Vec<Ray> = connections.iter().map(|c| c.segment).collect();
        let salts: Vec<u32> = connections.iter().map(|c| c.salt).collect();
        let blocked = self.blocked(&segments, &salts, true, w);
        let mut stats = CausticStats::default();
        for (connection, _) in connections.iter().zip(&blocked).filter(|(_, blocked)| !**blocked) {
            let [x, y] = connection.film;
            let is_inside = x >= 0.0 && y >= 0.0 && x < self.view.width as f32 && y < self.view.height as f32;
            if is_inside {
                stats.add(connection.value.luminance(), connection.value_from_camera);
            }
            for film in self.view.camera.equivalent_film_points(connection.film) {
                self.splat_one(connection, film, splats);
            }
        }
        stats
    }

    /// Splats a connection to the pixels whose filter covers a film point, or to one of them: pixels that share a light path have
    /// correlated noise, which denoisers mistake for detail, but a pixel's own noise is lower.
    fn splat_one(&self, connection: &CameraConnection, [film_x, film_y]: [f32; 2], splats: &mut Vec<Splat>) {
        let filter = self.options.filter;
        let (width, height) = (self.view.width, self.view.height);
        let mut splat = |x: u32, y: u32, weight: f32| {
            let value = connection.value * weight;
            let of_layer = |(layer, fraction): (Option<usize>, Rgb)| match layer {
                Some(layer) => SplatPart { layer: layer as u16, rgb: connection.rgb(value * fraction) },
                None => SplatPart::NONE,
            };
            let parts = connection.parts.map(|parts| Box::new(parts.map(of_layer)));
            splats.push(Splat { x, y, rgb: connection.rgb(value), parts });
        };
        if self.options.single_pixel_splats {
            let hash = hash32(connection.salt ^ SPLAT_SEED);
            let (x, of_column) = filter.choose_pixel(film_x, unit(hash));
            let (y, of_row) = filter.choose_pixel(film_y, unit(hash32(hash)));
            if x >= 0.0 && y >= 0.0 && x < width as f32 && y < height as f32 {
                splat(x as u32, y as u32, of_row * of_column);
            }
            return;
        }
        let is_within = |pixel: f32, size: u32| pixel >= 0.0 && pixel < size as f32;
        for (y, of_row) in filter.covered_pixels(film_y).filter(|(y, _)| is_within(*y, height)) {
            for (x, of_column) in filter.covered_pixels(film_x).filter(|(x, _)| is_within(*x, width)) {
                if of_row * of_column > 0.0 {
                    splat(x as u32, y as u32, of_row * of_column);
                }
            }
        }
    }
}
