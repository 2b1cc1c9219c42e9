//! Panes: light sampling through closed bodies of smooth glass with flat parallel faces.
//!
//! A pane shifts light sideways without changing the direction, so lights behind it can be sampled. Shadow rays pass with the
//! transmittance of all orders of internal reflection, t = T^2 a / (1 - R^2 a^2) with the reflectance R and transmittance T of a face and
//! the transmittance a of one crossing of the glass. For lights at infinity the direction doesn't change; for others, Newton's method
//! finds the connection refracted at both faces, with its Jacobian determinant in place of the inverse squared distance (the specular
//! manifold of Jakob, Marschner 2012, "Manifold Exploration", here parametrized by the direction alone).
//!
//! To count no light twice, rays that compete with light samples pass with the same transmittance, and MIS weights use the same pdfs. A
//! ray that does not pass is reflected, with the reflectance of the pane, r = R + T^2 R a^2 / (1 - R^2 a^2). Rays that don't compete
//! (camera rays, specular directions) treat the two faces like those of any other solid.
//!
//! Neglected: light reflected 2 k times within the pane exits shifted by another 2 k d tan(theta'), with the thickness d: in glass about
//! 0.2 % of the light by about two thicknesses. For lights not at infinity, occluders between a vertex and a pane are tested along the
//! unrefracted connection: shadow edges move by less than the thickness. Interreflection between two panes is left to scattered rays.

use super::Integrator;
use super::guiding::Guided;
use super::interior::Interior;
use super::mis::LightPdf;
use super::pane_refraction::{MAX_PANES, Pane, PaneList, RayCrossings, ShadowCrossings};
use super::sampling::RandomChoice;
use super::shading_geometry::HitPoint;
use super::shading_groups::{
    Closure, GeneralClass, LambertClass, MediumClass, MetalRoughClass, SortedVertices, VertexClass,
    eval_with_terminator, with_vertex_class,
};
use super::wave::{LightLanes, PathState, Wave, get, get_rgb, scale_rgb, set, set_rgb};
use super::workspace::Workspace;
use crate::bsdf::{Bsdf, SchlickMetal};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::math::{Hit, Ray, Vec3, offset_along};
use crate::scene::EnergyCompensation;

/// Maximum sine of the angle between the two faces.
const MAX_WEDGE: f32 = 1e-3;

/// Effect of a pane on a ray that hits it.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    pane: Pane,
    /// Transmittance and reflectance of the pane.
    transmittance: Rgb,
    reflectance: Rgb,
    /// Sideways shift of the ray.
    offset: Vec3,
    /// Exit point.
    exit: Vec3,
    exit_hit: Hit,
    /// Distance along the ray from the hit to where the ray continues, metres.
    advance: f32,
}

impl Integrator<'_> {
    /// The crossing of a pane that a ray in air enters at a hit; `None` if the hit is no pane.
    fn crossing(
        &self,
        (ray, hit, time): (&Ray, &Hit, f32),
        interior: Interior,
        wavelengths: Option<&Wavelengths>,
    ) -> Option<Crossing> {
        let at = self.front_of_pane((ray, hit, time)).filter(|_| self.is_air(interior))?;
        let (material, normal) = (at.material, at.surface.ng);
        let direction = ray.direction.normalize();
        let cosine = -direction.dot(normal);
        let evaluated = self.read_material(&at, 0.0, -direction, wavelengths);
        let (ior, front) = evaluated.bsdf.specular_interface(cosine, false)?;
        let within = direction / ior + normal * (cosine / ior - front.cos_transmitted);
        let origin = offset_along(at.surface.p, -normal, normal.abs().dot(at.surface.p_error));
        let inner = Ray { origin_primitive: hit.into(), ..Ray::new(origin, within) };
        let exit_hit = self.scene.accel.closest_one_in_time(&inner, time);
        if !exit_hit.is_hit() {
            return None;
        }
        let exit_index = self.scene.geometries.material(&exit_hit);
        let exit = self.ray_hit_point(&inner, exit_hit, exit_index, time);
        let thickness = exit_hit.t * front.cos_transmitted;
        let is_pane = exit.is_back
            && exit.material.medium_index == material.medium_index
            && exit.material.pane_thickness > 0.0
            && exit.surface.ng.cross(normal).length() <= MAX_WEDGE
            && exit.surface.ns.cross(normal).length() <= MAX_WEDGE
            && thickness <= material.pane_thickness;
        if !is_pane
            || self.coincident_surfaces(ray, &at).is_some()
            || self.coincident_surfaces(&inner, &exit).is_some()
        {
            return None;
        }
        let exit_material = self.read_material(&exit, 0.0, -within, wavelengths);
        let (_, back) = exit_material.bsdf.specular_interface(front.cos_transmitted, true)?;
        let medium = &self.scene.media[usize::from(material.medium_index)];
        let absorbed = medium.transmittance_at(exit_hit.t, wavelengths);
        // Geometric series over the orders of reflection between the faces.
        let orders = (back.reflected * back.reflected * absorbed * absorbed)
            .map(|ratio| 1.0 / (1.0 - ratio).max(1e-6));
        let entering = front.transmitted * absorbed * orders;
        let advance = thickness / cosine;
        // Skips the exit face of adjacent triangles.
        let margin = 2.0 * normal.abs().dot(exit.surface.p_error) / cosine;
        Some(Crossing {
            pane: Pane { normal, thickness, ior },
            transmittance: entering * back.transmitted,
            reflectance: front.reflected + entering * back.reflected * absorbed * back.transmitted,
            offset: within * exit_hit.t - direction * advance,
            exit: exit.surface.p,
            exit_hit,
            advance: advance + margin,
        })
    }

    /// The hit point, if it may be the front of a pane.
    fn front_of_pane(&self, (ray, hit, time): (&Ray, &Hit, f32)) -> Option<HitPoint<'_>> {
        if !hit.is_hit() {
            return None;
        }
        let index = self.scene.geometries.material(hit);
        if self.scene.materials[index as usize].pane_thickness <= 0.0 {
            return None;
        }
        // Only flat primitives.
        self.scene.geometries.is_back_of_flat(ray, hit, time)?;
        let at = self.ray_hit_point(ray, *hit, index, time);
        let (ng, ns) = (at.surface.ng, at.surface.ns);
        let is_front = !at.is_back && ray.direction.dot(ng) < 0.0 && ns.cross(ng).length() <= MAX_WEDGE;
        is_front.then_some(at)
    }

    /// Does a ray enter a pane, which shadow rays pass, at a hit?
    pub(super) fn enters_pane(
        &self,
        at: (&Ray, &Hit, f32),
        interior: Interior,
        wavelengths: Option<&Wavelengths>,
    ) -> bool {
        self.crossing(at, interior, wavelengths).is_some()
    }

    /// Is a path outside all solids? Media without a surface are allowed.
    fn is_air(&self, interior: Interior) -> bool {
        interior == Interior::AIR || self.scene.media[usize::from(interior.medium())].is_additive
    }

    /// Clears the panes passed by the rays of the previous bounce.
    pub(super) fn start_crossings(&self, w: &mut Workspace) {
        w.crossings.clear();
        if self.scene.features.panes {
            w.crossings.resize(w.rays.len(), RayCrossings::NONE);
        }
    }

    /// Decides whether the ray of arriving path `i` passes a pane at a hit, and if so weights the throughput; false if the hit is no pane.
    pub(super) fn passes_pane(
        &self,
        (bounce, i): (u32, usize),
        (ray, hit, time): (&Ray, &Hit, f32),
        surface: u32,
        (path, interior): (&mut PathState, Interior),
        (crossings, wavelengths): (&mut [RayCrossings], Option<&Wavelengths>),
    ) -> bool {
        let Some(passed) = crossings.get_mut(i).filter(|passed| passed.panes.has_room()) else {
            return false;
        };
        if !path.pdf[i].competes() {
            return false;
        }
        let Some(crossing) = self.crossing((ray, hit, time), interior, wavelengths) else { return false };
        let probability = crossing.transmittance.max_element().min(1.0);
        let passes = RandomChoice::ThinGlass { surface }.uniform(path, i, bounce) < probability;
        if passes {
            let throughput = get_rgb(&path.throughput, i);
            set_rgb(&mut path.throughput, i, throughput * crossing.transmittance / probability);
            passed.panes.push(crossing.pane);
            passed.offset += crossing.offset;
            passed.next = Some(Ray {
                origin: ray.origin + crossing.offset,
                t_min: hit.t + crossing.advance,
                origin_primitive: (&crossing.exit_hit).into(),
                ..*ray
            });
        }
        passes
    }

    /// Resets the origins of escaped rays to their vertices, for the pdfs of light sampling.
    pub(super) fn end_crossings(&self, w: &mut Workspace) {
        for ((passed, ray), hit) in w.crossings.iter_mut().zip(&mut w.rays).zip(&w.hits) {
            if !hit.is_hit() {
                ray.origin -= passed.offset;
            }
        }
    }

    /// The vertex from which the ray of arriving path `i` started, without shifts by panes.
    #[inline(always)]
    pub(super) fn start_of_ray(&self, i: usize, w: &Workspace) -> Vec3 {
        w.rays[i].origin - w.crossings.get(i).map_or(Vec3::ZERO, |passed| passed.offset)
    }

    /// Factor on the light sampling pdf at `target`, a point with `normal` on a light, by the panes that arriving path `i` passed.
    #[inline]
    pub(super) fn pane_density_ratio(
        &self,
        i: usize,
        (origin, target): (Vec3, Vec3),
        normal: Vec3,
        w: &Workspace,
    ) -> f32 {
        match w.crossings.get(i) {
            Some(passed) if !passed.panes.is_empty() => {
                passed.panes.density_ratio(w.rays[i].direction, origin, target, normal)
            }
            _ => 1.0,
        }
    }

    /// The BSDF of a pane for arriving path `i`, which competes with light samples and did not pass: a mirror. Weights the throughput.
    pub(super) fn reflect_at_pane(&self, thickness: f32, i: usize, w: &mut Workspace) -> Option<Bsdf> {
        let passed = w.crossings.get(i).filter(|_| thickness > 0.0)?;
        let state = &w.arriving.state;
        if !state.pdf[i].competes() || !passed.panes.has_room() {
            return None;
        }
        let (sample, interior) = (state.radiance_index[i], w.arriving.interior[i]);
        let at = (&w.rays[i], &w.hits[i], w.times.of(sample));
        let crossing = self.crossing(at, interior, w.times.wavelengths(sample))?;
        let stops = 1.0 - crossing.transmittance.max_element().min(1.0);
        let weight = if stops > 0.0 { crossing.reflectance / stops } else { Rgb::ZERO };
        let throughput = &mut w.arriving.state.throughput;
        scale_rgb(throughput, i, weight);
        let energy_compensation = EnergyCompensation::Off;
        Some(Bsdf::SchlickMetal(SchlickMetal { f0: Rgb::ONE, alpha: 0.0, energy_compensation }))
    }

    /// Saves the light samples of shadow rays before panes refract them.
    pub(super) fn start_shadow_crossings(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let Wave { paths, vertices: v, .. } = &*w.wave;
        w.shadow_crossings.clear();
        w.shadow_crossings.extend(w.shadow_vertices.iter().map(|&i| {
            let i = i as usize;
            ShadowCrossings {
                panes: PaneList::NONE,
                hits: [Hit::MISS; MAX_PANES],
                transmittance: Rgb::ONE,
                interior: self.interior_towards_light(sorted, paths, v, i),
                wi: get(&v.light.wi, i),
                pdf: v.light.pdf[i],
            }
        }));
    }

    /// Continues the shadow ray of vertex `i` behind a pane; `None` if the hit is no pane. Light samples at a finite distance are replaced
    /// by the refracted connection.
    pub(super) fn shadow_ray_passes_pane(
        &self,
        i: usize,
        (ray, hit, time): (&Ray, &Hit, f32),
        passed: Option<&mut ShadowCrossings>,
        light: &mut LightLanes,
        wavelengths: Option<&Wavelengths>,
    ) -> Option<Ray> {
        let passed = passed.filter(|passed| passed.panes.has_room())?;
        let crossing = self.crossing((ray, hit, time), passed.interior, wavelengths)?;
        passed.push(crossing.pane, *hit);
        let origin_primitive = (&crossing.exit_hit).into();
        if light.is_infinite[i] > 0.0 {
            passed.transmittance *= crossing.transmittance;
            let advance = crossing.advance / ray.direction.length();
            let origin = ray.origin + crossing.offset;
            return Some(Ray { origin, t_min: hit.t + advance, origin_primitive, ..*ray });
        }
        let (origin, target) = (get(&light.origin, i), get(&light.target, i));
        let w = passed.panes.connect(origin, target)?;
        set(&mut light.wi, i, w);
        // Each further pane changes the connection's angle: evaluate all Fresnel terms again.
        let refracted = Ray { direction: w, ..*ray };
        let of = |hit: &Hit| self.crossing((&refracted, hit, time), passed.interior, wavelengths);
        let product = |all: Option<Rgb>, hit: &Hit| Some(all? * of(hit)?.transmittance);
        passed.transmittance = passed.hits().iter().fold(Some(Rgb::ONE), product)?;
        let s = passed.panes.length(w, origin, target);
        // The ray restarts at the exit face.
        let normal = crossing.pane.normal;
        let rest = (target - crossing.exit).dot(normal) / w.dot(normal);
        let margin = crossing.advance - crossing.pane.thickness / w.dot(normal).abs();
        let t_min = 1.0 - (rest - margin.max(0.0)) / s;
        let origin = target - w * s;
        (0.0..1.0).contains(&t_min).then_some(Ray {
            origin,
            direction: w * s,
            t_min,
            t_max: 1.0,
            origin_primitive,
        })
    }

    /// Attenuates the light samples whose shadow rays passed panes; refracted ones are evaluated again with their new direction and pdf.
    pub(super) fn refract_light_samples(&self, branches: f32, sorted: &SortedVertices, w: &mut Workspace) {
        for k in 0..w.shadow_crossings.len() {
            let (passed, i) = (w.shadow_crossings[k], w.shadow_vertices[k] as usize);
            let Workspace { wave, bsdfs, occluded, .. } = &mut *w;
            if occluded[k] || passed.panes.is_empty() {
                continue;
            }
            let attenuated = get_rgb(&wave.vertices.light.contribution, i) * passed.transmittance;
            set_rgb(&mut wave.vertices.light.contribution, i, attenuated);
            if wave.vertices.light.is_infinite[i] > 0.0 {
                continue;
            }
            let before = self.light_sample_value((i, passed.wi, passed.pdf), branches, sorted, wave, bsdfs);
            let light = &mut wave.vertices.light;
            let (wi, origin, target) = (get(&light.wi, i), get(&light.origin, i), get(&light.target, i));
            let index = self.only_light.unwrap_or(light.index[i]);
            let area = self.scene.lights.area().get(index as usize);
            let normal = area.map_or(Vec3::ZERO, |area| area.normal_at(target, origin));
            let pdf = passed.pdf.scaled(passed.panes.density_ratio(wi, origin, target, normal));
            light.pdf[i] = pdf;
            self.guide_light_sample(i, sorted, wave);
            let after = self.light_sample_value((i, wi, pdf), branches, sorted, wave, bsdfs);
            let contribution = get_rgb(&wave.vertices.light.contribution, i) * quotient(after, before);
            set_rgb(&mut wave.vertices.light.contribution, i, contribution);
        }
    }

    /// The contribution of a light sample (vertex, direction, pdf), without transmittance.
    fn light_sample_value(
        &self,
        sample: (usize, Vec3, LightPdf),
        branches: f32,
        sorted: &SortedVertices,
        wave: &Wave,
        bsdfs: &[Bsdf],
    ) -> Rgb {
        let (i, guided) = (sample.0, self.options.guide.is_some());
        with_vertex_class!(sorted, i, guided, bsdfs, |class| self.value_of(&class, sample, branches, wave))
    }

    fn value_of<C: VertexClass>(
        &self,
        class: &C,
        (i, wi, pdf): (usize, Vec3, LightPdf),
        branches: f32,
        wave: &Wave,
    ) -> Rgb {
        let Wave { paths, vertices: v, .. } = wave;
        let closure = class.closure(v, i);
        let (eval, kept) = eval_with_terminator(&closure, self.terminator(), (v, i), wi);
        let density = eval.pdf_solid_angle * branches * class.light_pdf_factor(v, i);
        let weight = pdf.mis_weight_over_pdf(density) * kept;
        if C::Closure::OPAQUE && wi.dot(get(&v.ng, i)) <= 0.0 {
            return Rgb::ZERO;
        }
        closure.scattered(eval, weight, get_rgb(&paths.state.throughput, i), get_rgb(&v.light.radiance, i))
    }
}

/// `a / b` per channel; 0 where `b` is 0.
fn quotient(a: Rgb, b: Rgb) -> Rgb {
    let (a, b) = (a.to_array(), b.to_array());
    let of = |c: usize| if b[c] > 0.0 { a[c] / b[c] } else { 0.0 };
    Rgb::from_array([of(0), of(1), of(2)])
}
