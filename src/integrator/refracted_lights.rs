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
use super::light_lobes::LightLobes;
use super::mis::DirectionPdf;
use super::sampling::{FIRST_ROULETTE, Purpose, RandomChoice, survival};
use super::shading_groups::{
    Closure, GeneralClass, LambertClass, MediumClass, MetalRoughClass, SortedVertices, VertexClass,
    eval_with_terminator, with_vertex_class,
};
use super::wave::{Vertices, Wave, get, get_rgb, scale_rgb, set, set_rgb};
use super::workspace::Workspace;
use crate::bsdf::Bsdf;
use crate::color::Rgb;
use crate::compile::{Refractor, Side};
use crate::light::{LightPosition, SmallLight};
use crate::math::{Bounds3, Hit, Ray, Vec3, offset_along};
use std::f32::consts::PI;

/// Maximum probability of sampling a lobe instead of the BSDF.
const MAX_LOBE_PROBABILITY: f32 = 0.5;

/// GGX alpha assumed for surfaces roughened by the glossy filter after diffuse scattering.
const FILTERED_ALPHA: f32 = 0.4;

/// A test ray's hit of a refractive face.
#[derive(Clone, Copy)]
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

/// Maximum number of directions tried for a refracted connection.
const STEPS: u32 = 3;

/// A search for the direction in which a vertex sees a light through a face.
#[derive(Clone, Copy)]
struct Search {
    /// Index of the vertex's lobes.
    lobes: usize,
    vertex: usize,
    /// The current direction.
    axis: Vec3,
    /// The face that the last direction hit.
    face: Option<Face>,
}

/// The vertices that receive light.
#[derive(Clone, Copy)]
struct Receivers<'a> {
    vertices: &'a Vertices,
    /// Number of vertices, the first ones, that are lit from the side of the normal only.
    opaque: usize,
}

impl Receivers<'_> {
    fn p(&self, i: usize) -> Vec3 {
        get(&self.vertices.p, i)
    }

    /// May light from this direction contribute?
    fn is_lit(&self, i: usize, direction: Vec3) -> bool {
        i >= self.opaque || direction.dot(get(&self.vertices.ng, i)) > 0.0
    }
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

    /// Finds the lobes of the vertices towards refracted lights, and the probabilities of sampling them.
    pub(super) fn find_light_lobes(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        let mut lobes = std::mem::take(&mut w.light_lobes);
        self.start_light_lobes(sorted, &mut lobes, w);
        let (refracted, vertices) = (&self.scene.refracted_lights, &w.wave.vertices);
        let mut irradiances = vec![0.0; lobes.len()];
        let mut counts = Vec::with_capacity(lobes.len());
        let receivers = Receivers { vertices, opaque: sorted.medium().start };
        for light in &refracted.lights {
            counts.clear();
            counts.extend(lobes.iter().map(LightLobes::count));
            for body in &refracted.bodies {
                for side in &body.sides {
                    self.add_lobes_of_side((light, body, side), receivers, &mut lobes);
                }
                if body.medium != 0 && body.is_rough {
                    self.add_lobes_of_frosted((light, body), receivers, &mut lobes);
                }
            }
            for ((found, before), irradiance) in lobes.iter().zip(&counts).zip(&mut irradiances) {
                if found.count() > *before {
                    *irradiance += light.irradiance_at(get(&vertices.p, found.vertex as usize));
                }
            }
        }
        for (found, irradiance) in lobes.iter_mut().zip(irradiances) {
            found.probability = self.lobe_probability(irradiance);
        }
        lobes.retain(|found| !found.is_empty());
        w.light_lobes = lobes;
        if let (Some(_), Some(reuse)) = (&self.options.reuse, &mut w.reuse) {
            for found in &w.light_lobes {
                reuse.discard_prefix(bounce, w.wave.paths.state.radiance_index[found.vertex as usize]);
            }
        }
    }

    /// Replaces `lobes` by empty ones for the vertices at which lobes are sampled.
    fn start_light_lobes(&self, sorted: &SortedVertices, lobes: &mut Vec<LightLobes>, w: &Workspace) {
        lobes.clear();
        let (rough, from_outside) = (sorted.rough(), self.scene.refracted_lights.from_outside);
        let paths = &w.wave.paths;
        for i in sorted.lit() {
            let interior = if self.optional.interior { paths.interior[i] } else { Interior::AIR };
            if interior == Interior::AIR && !from_outside {
                continue;
            }
            // Lobes don't account for refraction at the vertex itself.
            let is_glass = |bsdf: &Bsdf| matches!(bsdf, Bsdf::Dielectric(_) | Bsdf::RoughDielectric(_));
            if rough.contains(&i) && is_glass(&w.bsdfs[i - rough.start]) {
                continue;
            }
            let throughput = get_rgb(&paths.state.throughput, i);
            lobes.push(LightLobes::new(i, throughput, paths.state.roulette_scale[i], interior));
        }
    }

    /// The probability of sampling a lobe: the ratio of the square roots of irradiance by the refracted lights, and by these and the
    /// environment, which BSDF samples find.
    fn lobe_probability(&self, irradiance: f32) -> f32 {
        let around = self.scene.lights.environment().map_or(0.0, |e| PI * e.mean_luminance());
        let (lobes, around) = (irradiance.sqrt(), around.sqrt());
        MAX_LOBE_PROBABILITY * lobes / (lobes + around)
    }

    /// Adds the lobes of a body with two rough faces, where a ray towards a light hits it first.
    fn add_lobes_of_frosted(
        &self,
        (light, body): (&SmallLight, &Refractor),
        receivers: Receivers<'_>,
        lobes: &mut [LightLobes],
    ) {
        let search = |(k, found): (usize, &LightLobes)| {
            let (i, is_inside) = (found.vertex as usize, found.interior.contains(body.medium));
            let (p, axis) = (receivers.p(i), direction(light, receivers.p(i)));
            let is_possible = !is_inside && receivers.is_lit(i, axis) && is_hit(&body.bounds, p, axis);
            is_possible.then_some(Search { lobes: k, vertex: i, axis, face: None })
        };
        let searches: Vec<Search> = lobes.iter().enumerate().filter_map(search).collect();
        for (search, face) in searches.iter().zip(self.faces_towards(&searches, receivers)) {
            let Some(face) = face.filter(|face| !face.is_back && !face.is_sheet && face.alpha > 0.0) else {
                continue;
            };
            let spread = (face.ior - 1.0).abs() * face.alpha * std::f32::consts::SQRT_2;
            if let Some((scale, size)) = angular_scale(light, receivers.p(search.vertex), face.distance) {
                lobes[search.lobes].add(search.axis, (spread * scale).hypot(size));
            }
        }
    }

    /// Adds the lobes of one face between the vertices and a light.
    fn add_lobes_of_side(
        &self,
        (light, body, side): (&SmallLight, &Refractor, &Side),
        receivers: Receivers<'_>,
        lobes: &mut [LightLobes],
    ) {
        let first = |(k, found): (usize, &LightLobes)| {
            if body.medium != 0 && !found.interior.contains(body.medium) {
                return None;
            }
            let i = found.vertex as usize;
            let (p, to_light) = (receivers.p(i), direction(light, receivers.p(i)));
            let is_within = side.normal.dot(to_light) > 0.0;
            if !is_within && body.medium != 0 {
                return None;
            }
            let axis = refract(to_light, side.normal, ratio(body, is_within))?;
            let is_possible = is_hit(&body.bounds, p, axis);
            is_possible.then_some(Search { lobes: k, vertex: i, axis, face: None })
        };
        let mut searches: Vec<Search> = lobes.iter().enumerate().filter_map(first).collect();
        let mut found = Vec::new();
        for _ in 0..STEPS {
            searches.retain(|search| receivers.is_lit(search.vertex, search.axis));
            let faces = self.faces_towards(&searches, receivers);
            let mut continued = Vec::new();
            for (search, face) in searches.drain(..).zip(faces) {
                let is_within = side.normal.dot(direction(light, receivers.p(search.vertex))) > 0.0;
                let fits = |face: &Face| face.is_back == is_within && face.is_sheet == (body.medium == 0);
                let Some(face) = face.filter(fits) else { continue };
                let next = refract(direction(light, face.p), face.normal, ratio(body, is_within));
                let Some(next) = next.filter(|_| face.normal.dot(side.normal).abs() > 0.0) else {
                    found.push(search);
                    continue;
                };
                let has_converged = (next - search.axis).length_squared() < 1e-8;
                let search = Search { axis: next, face: Some(face), ..search };
                if has_converged { found.push(search) } else { continued.push(search) }
            }
            searches = continued;
        }
        found.extend(searches);
        for search in found {
            add_lobes_of_face(&search, (light, body, side), receivers, &mut lobes[search.lobes]);
        }
    }

    /// The first hits of the rays of searches, where they are refractive faces.
    fn faces_towards(&self, searches: &[Search], receivers: Receivers<'_>) -> Vec<Option<Face>> {
        if searches.is_empty() {
            return Vec::new();
        }
        let v = receivers.vertices;
        let ray = |&Search { vertex: i, axis, .. }: &Search| {
            let ng = get(&v.ng, i);
            let side = if axis.dot(ng) < 0.0 { -1.0 } else { 1.0 };
            let origin = offset_along(receivers.p(i), ng * side, v.offset[i]);
            Ray { origin_primitive: v.origin_primitives[i], ..Ray::new(origin, axis) }
        };
        let rays: Vec<Ray> = searches.iter().map(ray).collect();
        let mut hits = vec![Hit::MISS; rays.len()];
        self.scene.accel.closest(&rays, &mut hits);
        rays.iter().zip(hits).map(|(ray, hit)| self.refractive_face(ray, hit)).collect()
    }

    /// The face at a hit; `None` if it is not refractive.
    fn refractive_face(&self, ray: &Ray, hit: Hit) -> Option<Face> {
        if !hit.is_hit() {
            return None;
        }
        let index = self.scene.geometries.material(&hit);
        let material = &self.scene.materials[index as usize];
        let (ior, alpha) = material.refractor_interface()?;
        let at = self.ray_hit_point(ray, hit, index, 0.0);
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
            if choice >= lobes.probability {
                self.weigh_scattered(i, &lobes, sorted, w);
                continue;
            }
            let state = &w.wave.paths.state;
            let point = state.sobol_point(i);
            let [a, b, _, roulette] = point.sample_4d(&dimensions);
            let wi = lobes.sample(choice / lobes.probability, [a, b]);
            let value = self.value_towards(i, wi, sorted, w);
            let (paths, v) = (&mut w.wave.paths, &mut w.wave.vertices);
            if self.optional.interior {
                paths.interior[i] = lobes.interior;
            }
            let Some(value) = value.filter(|value| value.pdf_solid_angle > 0.0) else {
                paths.state.pdf[i] = DirectionPdf::after_roulette(0.0, false);
                continue;
            };
            let pdf = (1.0 - lobes.probability) * value.pdf_solid_angle
                + lobes.probability * lobes.pdf_solid_angle(wi);
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
        let ratio = of_lobes
            .map_or(0.0, |pdf| lobes.probability * lobes.pdf_solid_angle(wi) / pdf.max(f32::MIN_POSITIVE));
        let throughput = &mut w.wave.paths.state.throughput;
        scale_rgb(throughput, i, 1.0 / (1.0 - lobes.probability + ratio));
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
            v.guided.pdf_factor[i] = v.guided.light_pdf_factor[i];
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
        let (eval, kept) = eval_with_terminator(&closure, self.terminator(), (v, i), wi);
        let pdf_solid_angle = eval.pdf_solid_angle * class.light_pdf_factor(v, i);
        Some(Value { f_cos: eval.f_cos * kept, pdf_solid_angle })
    }
}

/// Adds the lobes of the face that a search found.
fn add_lobes_of_face(
    search: &Search,
    (light, body, side): (&SmallLight, &Refractor, &Side),
    receivers: Receivers<'_>,
    lobes: &mut LightLobes,
) {
    let (p, axis) = (receivers.p(search.vertex), search.axis);
    let Some(face) = search.face.filter(|_| receivers.is_lit(search.vertex, axis)) else { return };
    let Some((scale, size)) = angular_scale(light, p, face.distance) else { return };
    let ratio = ratio(body, side.normal.dot(direction(light, p)) > 0.0);
    let bend = (1.0 - ratio).abs();
    let narrow = (bend * face.alpha * scale).hypot(size * ratio.min(1.0));
    if face.alpha > 0.0 || size > 0.0 {
        lobes.add(axis, narrow);
        let wide = bend * side.spread * scale;
        if wide > narrow {
            lobes.add(refract(direction(light, face.p), side.normal, ratio).unwrap_or(axis), wide);
        }
    }
}

/// Index of refraction on the light's side of a face over that on the vertex's; `is_within`: the vertex is on the body's side.
fn ratio(body: &Refractor, is_within: bool) -> f32 {
    if is_within { 1.0 / body.ior } else { body.ior }
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
