//! Importance sampling of small lights behind refractive bodies: frosted glass, water with waves, single sheets of glass.
//!
//! Shadow rays don't pass these bodies, and BSDF samples rarely hit a sun behind them. So vertices sample a mixture of the BSDF and lobes
//! around the expected directions of the refracted light. The path is traced and weighted like any other, by the pdf of the mixture, so
//! that a bad guess costs variance only.
//!
//! The lobes of a vertex depend on its position alone. Test rays require that the first surface towards the light is a face of such a
//! body. Frosted bodies deflect light in all directions: the lobe is around the unrefracted direction, with the angular spread of the
//! microfacets of both faces. If only one face refracts, since the vertex is inside or the body is an open sheet, the direction follows
//! from Snell's law and two further iterations at the hit point on a wavy face (the fixed point is the connection of manifold next event
//! estimation; Hanika et al. 2015); a wider lobe samples the other connections focused by waves.
//!
//! MIS weights against light samples use the BSDF's own pdf, whichever part of the mixture sampled the direction, so they sum to 1.

use super::Integrator;
use super::guiding::Guided;
use super::interior::Interior;
use super::mis::DirectionPdf;
use super::sampling::{FIRST_ROULETTE, Purpose, RandomChoice, survival};
use super::shading_groups::{
    Closure, GeneralClass, LambertClass, MediumClass, MetalRoughClass, SortedVertices, VertexClass,
    eval_at_horizon, with_vertex_class,
};
use super::slabs::LightLobes;
use super::wave::{Wave, get, get_rgb, set, set_rgb};
use super::workspace::Workspace;
use crate::bsdf::Bsdf;
use crate::color::Rgb;
use crate::compile::{Refractor, Side};
use crate::light::{LightPosition, SmallLight};
use crate::math::{Bounds3, Ray, Vec3, offset_along};
use crate::sampling::sampler::SobolPoint;
use std::f32::consts::PI;

/// Maximum probability of sampling a lobe instead of the BSDF.
const MAX_SHARE: f32 = 0.5;

/// GGX alpha assumed for surfaces roughened by the glossy filter after diffuse scattering.
const FILTERED_ALPHA: f32 = 0.4;

/// A test ray's hit of a refractive face.
struct Face {
    p: Vec3,
    /// Metres.
    distance: f32,
    /// Shading normal.
    normal: Vec3,
    ior: f32,
    /// GGX alpha.
    alpha: f32,
    /// The ray comes from inside.
    is_back: bool,
    is_sheet: bool,
}

/// BSDF value and pdf, including the shadow terminator and guiding.
struct Value {
    f_cos: Rgb,
    pdf_solid_angle: f32,
}

impl Integrator<'_> {
    /// Are lights behind refractive bodies sampled?
    pub(super) fn samples_refracted_lights(&self) -> bool {
        // Training samples of a guide need the guide's own pdf.
        !self.scene.refracted_lights.is_empty() && !self.options.records_training && !self.scene.is_moving()
    }

    /// Finds the light lobes of the vertices.
    pub(super) fn find_light_lobes(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        w.light_lobes.clear();
        let (rough, from_outside) = (sorted.rough(), self.scene.refracted_lights.from_outside);
        for i in sorted.lit() {
            let is_outside = !self.optional.interior || w.wave.paths.interior[i] == Interior::AIR;
            if is_outside && !from_outside {
                continue;
            }
            // Lobes don't account for refraction at the vertex itself.
            let is_glass = |bsdf: &Bsdf| matches!(bsdf, Bsdf::Dielectric(_) | Bsdf::RoughDielectric(_));
            if rough.contains(&i) && is_glass(&w.bsdfs[i - rough.start]) {
                continue;
            }
            let lobes = self.lobes_of(i, sorted, w);
            if !lobes.is_empty() {
                w.light_lobes.push(lobes);
                if let (Some(_), Some(reuse)) = (&self.options.reuse, &mut w.reuse) {
                    reuse.discard_prefix(bounce, w.wave.paths.state.radiance_index[i]);
                }
            }
        }
    }

    fn lobes_of(&self, i: usize, sorted: &SortedVertices, w: &Workspace) -> LightLobes {
        let paths = &w.wave.paths;
        let interior = if self.optional.interior { paths.interior[i] } else { Interior::AIR };
        let throughput = get_rgb(&paths.state.throughput, i);
        let mut found = LightLobes::new(i, throughput, paths.state.roulette_scale[i], interior);
        let (p, ng) = (get(&w.wave.vertices.p, i), get(&w.wave.vertices.ng, i));
        let is_opaque = i < sorted.medium().start;
        let is_lit_from = |d: Vec3| !is_opaque || d.dot(ng) > 0.0;
        let refracted = &self.scene.refracted_lights;
        let mut irradiance = 0.0;
        for light in &refracted.lights {
            let count_before = found.count();
            for body in &refracted.bodies {
                if body.medium == 0 || found.interior.contains(body.medium) {
                    for side in &body.sides {
                        self.add_lobes_of_side(i, (light, body, side), &is_lit_from, &mut found, w);
                    }
                } else if body.is_rough {
                    let to_light = direction(light, p);
                    if is_lit_from(to_light) && is_hit(&body.bounds, p, to_light) {
                        self.add_lobe_of_frosted(i, light, to_light, &mut found, w);
                    }
                }
            }
            if found.count() > count_before {
                irradiance += light.irradiance_at(p);
            }
        }
        if !found.is_empty() {
            found.share = self.share_of_lobes(irradiance);
        }
        found
    }

    /// The probability of sampling a lobe, given the irradiance of the refracted lights: by the root of the irradiances of these lights and
    /// of the environment, which the BSDF samples alone may find.
    fn share_of_lobes(&self, irradiance: f32) -> f32 {
        let around = self.scene.lights.environment().map_or(0.0, |e| PI * e.mean_luminance());
        let (lobes, around) = (irradiance.sqrt(), around.sqrt());
        MAX_SHARE * lobes / (lobes + around)
    }

    /// Adds the lobe of a body with two rough faces, if a ray towards a light hits it first.
    fn add_lobe_of_frosted(
        &self,
        i: usize,
        light: &SmallLight,
        to_light: Vec3,
        found: &mut LightLobes,
        w: &Workspace,
    ) {
        let Some(face) = self.face_towards(i, to_light, w) else { return };
        if face.is_back || face.is_sheet || face.alpha <= 0.0 {
            return;
        }
        let spread = (face.ior - 1.0).abs() * face.alpha * std::f32::consts::SQRT_2;
        let Some((share, size)) = angular_scale(light, get(&w.wave.vertices.p, i), face.distance) else {
            return;
        };
        found.add(to_light, (spread * share).hypot(size));
    }

    /// Adds the lobes of one face between a vertex and a light.
    fn add_lobes_of_side(
        &self,
        i: usize,
        (light, body, side): (&SmallLight, &Refractor, &Side),
        is_lit_from: &impl Fn(Vec3) -> bool,
        found: &mut LightLobes,
        w: &Workspace,
    ) {
        let p = get(&w.wave.vertices.p, i);
        let to_light = direction(light, p);
        let is_within = side.normal.dot(to_light) > 0.0;
        if !is_within && body.medium != 0 {
            return;
        }
        let ratio = if is_within { 1.0 / body.ior } else { body.ior };
        let Some(mut axis) = refract(to_light, side.normal, ratio) else { return };
        let mut last = None;
        for step in 0..3 {
            if !is_lit_from(axis) || step == 0 && !is_hit(&body.bounds, p, axis) {
                return;
            }
            let Some(face) = self.face_towards(i, axis, w) else { return };
            if face.is_back != is_within || face.is_sheet != (body.medium == 0) {
                return;
            }
            let to_light = direction(light, face.p);
            let next = refract(to_light, face.normal, ratio);
            let Some(next) = next.filter(|_| face.normal.dot(side.normal).abs() > 0.0) else { break };
            let has_converged = (next - axis).length_squared() < 1e-8;
            (axis, last) = (next, Some(face));
            if has_converged {
                break;
            }
        }
        let Some(face) = last.filter(|_| is_lit_from(axis)) else { return };
        let Some((share, size)) = angular_scale(light, p, face.distance) else { return };
        let bend = (1.0 - ratio).abs();
        let narrow = (bend * face.alpha * share).hypot(size * ratio.min(1.0));
        if face.alpha > 0.0 || size > 0.0 {
            found.add(axis, narrow);
            let wide = bend * side.spread * share;
            if wide > narrow {
                found.add(refract(direction(light, face.p), side.normal, ratio).unwrap_or(axis), wide);
            }
        }
    }

    /// The first hit of a ray from vertex `i`, if it is a refractive face.
    fn face_towards(&self, i: usize, d: Vec3, w: &Workspace) -> Option<Face> {
        let v = &w.wave.vertices;
        let (p, ng) = (get(&v.p, i), get(&v.ng, i));
        let side = if d.dot(ng) < 0.0 { -1.0 } else { 1.0 };
        let ray = Ray {
            origin_primitive: v.origin_primitives[i],
            ..Ray::new(offset_along(p, ng * side, v.offset[i]), d)
        };
        let hit = self.scene.accel.closest_one(&ray);
        if !hit.is_hit() {
            return None;
        }
        let index = self.scene.geometries.material(&hit);
        let material = &self.scene.materials[index as usize];
        let (ior, alpha) = material.refractor_interface()?;
        let at = self.ray_hit_point(&ray, hit, index, 0.0);
        let is_filtered = self.options.filter_glossy > 0.0 && material.pane_thickness <= 0.0;
        let filtered = if is_filtered { FILTERED_ALPHA } else { 0.0 };
        Some(Face {
            p: at.surface.p,
            distance: hit.t,
            normal: at.surface.ns,
            ior,
            alpha: alpha.max(filtered),
            is_back: at.is_back,
            is_sheet: material.medium_index == 0,
        })
    }

    /// Replaces BSDF samples by lobe samples with the probability of the vertex, else reweights them by the pdf of the mixture.
    pub(super) fn scatter_to_refracted_lights(
        &self,
        bounce: u32,
        sorted: &SortedVertices,
        w: &mut Workspace,
    ) {
        let branches = self.bsdf_samples_per_light_sample(bounce);
        let dimensions = self.dimensions(bounce, Purpose::Scatter);
        for k in 0..w.light_lobes.len() {
            let lobes = w.light_lobes[k];
            let i = lobes.vertex as usize;
            let choice = RandomChoice::LightLobe.uniform(&w.wave.paths.state, i, bounce);
            if choice >= lobes.share {
                self.weigh_scattered(i, &lobes, sorted, w);
                continue;
            }
            let state = &w.wave.paths.state;
            let point = SobolPoint::from_parts(state.seed[i], state.shuffled[i]);
            let [a, b, _, roulette] = point.sample_4d(&dimensions);
            let wi = lobes.sample(choice / lobes.share, [a, b]);
            let value = self.value_towards(i, wi, sorted, w);
            let (paths, v) = (&mut w.wave.paths, &mut w.wave.vertices);
            if self.optional.interior {
                paths.interior[i] = lobes.interior;
            }
            let Some(value) = value.filter(|value| value.pdf_solid_angle > 0.0) else {
                paths.state.pdf[i] = DirectionPdf::after_roulette(0.0, false);
                continue;
            };
            let pdf = (1.0 - lobes.share) * value.pdf_solid_angle + lobes.share * lobes.pdf_solid_angle(wi);
            let throughput = lobes.throughput * value.f_cos * (1.0 / pdf);
            // Russian roulette as for a BSDF sample: higher pdfs must not lower the survival probability.
            let scale = lobes.roulette_scale * (pdf / value.pdf_solid_angle);
            let (survives, factor) = survival(throughput, scale, roulette, bounce >= FIRST_ROULETTE);
            paths.state.roulette_scale[i] = scale;
            set_rgb(&mut paths.state.throughput, i, throughput * factor);
            let ng = get(&v.ng, i);
            let side = if wi.dot(ng) < 0.0 { -1.0 } else { 1.0 };
            set(&mut v.next_origin, i, offset_along(get(&v.p, i), ng * side, v.offset[i]));
            set(&mut v.next_direction, i, wi);
            paths.state.pdf[i] = DirectionPdf::after_roulette(value.pdf_solid_angle * branches, survives);
        }
    }

    /// Reweights a BSDF sample by the pdf of the mixture.
    fn weigh_scattered(&self, i: usize, lobes: &LightLobes, sorted: &SortedVertices, w: &mut Workspace) {
        let pdf = w.wave.paths.state.pdf[i];
        if pdf.has_ended() {
            return;
        }
        let wi = get(&w.wave.vertices.next_direction, i);
        let of_lobes = match pdf.is_specular() {
            true => None,
            false => self.value_towards(i, wi, sorted, w).map(|value| value.pdf_solid_angle),
        };
        let share =
            of_lobes.map_or(0.0, |pdf| lobes.share * lobes.pdf_solid_angle(wi) / pdf.max(f32::MIN_POSITIVE));
        let throughput = &mut w.wave.paths.state.throughput;
        let value = get_rgb(throughput, i);
        set_rgb(throughput, i, value * (1.0 / (1.0 - lobes.share + share)));
    }

    /// BSDF value and pdf of vertex `i` for light from `wi`; `None` if `wi` crosses or is below the surface.
    fn value_towards(&self, i: usize, wi: Vec3, sorted: &SortedVertices, w: &mut Workspace) -> Option<Value> {
        let is_guided = self.options.guide.is_some() && sorted.guided().contains(&i);
        if is_guided {
            let before = get(&w.wave.vertices.light.wi, i);
            set(&mut w.wave.vertices.light.wi, i, wi);
            self.guide_light_sample(i, sorted, &mut w.wave);
            set(&mut w.wave.vertices.light.wi, i, before);
            let v = &mut w.wave.vertices;
            v.guided.density[i] = v.guided.light_density[i];
        }
        let Workspace { wave, bsdfs, .. } = &*w;
        with_vertex_class!(sorted, i, is_guided, bsdfs, |class| self.value_in(&class, i, wi, wave))
    }

    fn value_in<C: VertexClass>(&self, class: &C, i: usize, wi: Vec3, wave: &Wave) -> Option<Value> {
        let v = &wave.vertices;
        let closure = class.closure(v, i);
        let cosine = wi.dot(get(&v.ng, i));
        if C::Closure::OPAQUE && cosine <= 0.0 || !C::Closure::IN_MEDIUM && closure.crosses(wi) {
            return None;
        }
        let (eval, kept) = eval_at_horizon(&closure, self.terminator(), (v, i), wi);
        let pdf_solid_angle = eval.pdf_solid_angle * class.light_density(v, i);
        Some(Value { f_cos: eval.f_cos * kept, pdf_solid_angle })
    }
}

/// Unit direction from `p` to the center of a light.
fn direction(light: &SmallLight, p: Vec3) -> Vec3 {
    match light.position {
        LightPosition::Far(to) => to,
        LightPosition::Near(middle) => (middle - p).normalize_or_zero(),
    }
}

/// Ratio of the angular change at `p` to the deflection at a face at `distance`, and the angular radius of the light, radians. `None` if
/// the light is in front of the face.
fn angular_scale(light: &SmallLight, p: Vec3, distance: f32) -> Option<(f32, f32)> {
    match light.position {
        LightPosition::Far(_) => Some((1.0, light.size)),
        LightPosition::Near(middle) => {
            let all = (middle - p).length();
            (all > distance).then_some((1.0 - distance / all, light.size / all))
        }
    }
}

/// The direction on the vertex's side of a face that refracts into `to_light` (Snell's law); `ratio` is the index of refraction on the
/// light's side over that on the vertex's. `None` for total reflection.
fn refract(to_light: Vec3, normal: Vec3, ratio: f32) -> Option<Vec3> {
    let cosine = to_light.dot(normal);
    let tangent = (to_light - normal * cosine) * ratio;
    let rest = 1.0 - tangent.length_squared();
    (rest > 0.0).then(|| tangent + normal * rest.sqrt().copysign(cosine))
}

/// Does a ray hit a box?
fn is_hit(bounds: &Bounds3, p: Vec3, d: Vec3) -> bool {
    let inverse = d.recip();
    let (a, b) = ((bounds.min - p) * inverse, (bounds.max - p) * inverse);
    let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
    far >= near.max(0.0)
}
