//! Directions towards small lights behind bodies that refract their light: frosted glass, water with waves, single sheets of glass.
//!
//! Light samples don't pass these bodies, and directions sampled by a BSDF hardly ever lead to a sun behind them. So vertices mix the
//! BSDF's density with lobes towards where the light arrives. A lobe is only a guess of the direction: the path that it starts is
//! traced and weighted as any other, by the density of the mixture, so that the picture's expected value does not depend on it.
//!
//! Which lobes a vertex has depends on its place alone, by test rays: the first surface towards the light must be a side of
//! such a body. Frosted bodies bend light by some angle to all sides: the lobe is around the straight direction, as wide as the
//! facets of both faces spread light. Where one face alone refracts, since the vertex is within the body or the body is an open sheet, the
//! direction follows by Snell's law, and by two further steps from where it hits a wavy side (the fixed point is the path
//! of manifold next event estimation; Hanika et al. 2015); a wider lobe finds the other ones that waves focus there.
//!
//! Weights of multiple importance sampling against light samples are functions of the direction, with the BSDF's own density: they add up
//! to 1 whichever density sampled it.

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
use crate::light::{LightPlace, SmallLight};
use crate::math::{Bounds3, Ray, Vec3, offset_along};
use crate::sampling::sampler::SobolPoint;

/// Share of directions that lobes sample where there are some.
const SHARE: f32 = 0.5;

/// Roughness that the glossy filter gives what paths hit after diffuse scattering, GGX alpha.
const FILTERED_ALPHA: f32 = 0.4;

/// Where a test ray hit a refracting face.
struct Face {
    p: Vec3,
    distance: f32,
    /// Shading normal.
    normal: Vec3,
    ior: f32,
    alpha: f32,
    /// The ray comes from within.
    is_back: bool,
    is_sheet: bool,
}

/// A value of a BSDF.
struct Value {
    f_cos: Rgb,
    pdf_solid_angle: f32,
}

impl Integrator<'_> {
    /// Are there lights behind refracting bodies that paths look for?
    pub(super) fn samples_refracted_lights(&self) -> bool {
        // A guide is trained with the densities of its own samples.
        !self.scene.refracted_lights.is_empty() && !self.options.records_training && !self.scene.is_moving()
    }

    /// Finds the lobes of the vertices.
    pub(super) fn find_light_lobes(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        w.light_lobes.clear();
        let (rough, from_outside) = (sorted.rough(), self.scene.refracted_lights.from_outside);
        for i in sorted.lit() {
            let is_outside = !self.optional.interior || w.wave.paths.interior[i] == Interior::AIR;
            if is_outside && !from_outside {
                continue;
            }
            // Light that is refracted at this vertex itself would have another direction.
            let is_glass = |bsdf: &Bsdf| matches!(bsdf, Bsdf::Dielectric(_) | Bsdf::RoughDielectric(_));
            if rough.contains(&i) && is_glass(&w.bsdfs[i - rough.start]) {
                continue;
            }
            let lobes = self.lobes_of(i, sorted, w);
            if !lobes.is_empty() {
                w.light_lobes.push(lobes);
                if let (Some(_), Some(reuse)) = (&self.options.reuse, &mut w.reuse) {
                    reuse.leave_out(bounce, w.wave.paths.state.radiance_index[i]);
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
        let may_arrive = |d: Vec3| !is_opaque || d.dot(ng) > 0.0;
        let refracted = &self.scene.refracted_lights;
        for light in &refracted.lights {
            for body in &refracted.bodies {
                if body.medium == 0 || found.interior.contains(body.medium) {
                    for side in &body.sides {
                        self.add_lobes_of_side(i, (light, body, side), &may_arrive, &mut found, w);
                    }
                } else if body.is_rough {
                    let to_light = direction(light, p);
                    if may_arrive(to_light) && is_hit(&body.bounds, p, to_light) {
                        self.add_lobe_of_frosted(i, light, to_light, &mut found, w);
                    }
                }
            }
        }
        found
    }

    /// Adds the lobe of a body with two rough faces, if it is what a ray towards a light hits.
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
        let Some((share, size)) = seen_from(light, get(&w.wave.vertices.p, i), face.distance) else { return };
        found.add(to_light, (spread * share).hypot(size));
    }

    /// Adds the lobes of one face between a vertex and a light.
    fn add_lobes_of_side(
        &self,
        i: usize,
        (light, body, side): (&SmallLight, &Refractor, &Side),
        may_arrive: &impl Fn(Vec3) -> bool,
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
            if !may_arrive(axis) || step == 0 && !is_hit(&body.bounds, p, axis) {
                return;
            }
            let Some(face) = self.face_towards(i, axis, w) else { return };
            if face.is_back != is_within || face.is_sheet != (body.medium == 0) {
                return;
            }
            let to_light = direction(light, face.p);
            let next = refract(to_light, face.normal, ratio);
            let Some(next) = next.filter(|_| face.normal.dot(side.normal).abs() > 0.0) else { break };
            let is_still = (next - axis).length_squared() < 1e-8;
            (axis, last) = (next, Some(face));
            if is_still {
                break;
            }
        }
        let Some(face) = last.filter(|_| may_arrive(axis)) else { return };
        let Some((share, size)) = seen_from(light, p, face.distance) else { return };
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

    /// The refracting face that a ray from a vertex hits first.
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
        let (ior, alpha) = material.face_of_refractor()?;
        let at = self.point_of(&ray, hit, index, 0.0);
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

    /// Samples the lobes of vertices in place of their BSDFs, or weights the directions that these have sampled.
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
            if choice >= SHARE {
                self.weigh_scattered(i, &lobes, sorted, w);
                continue;
            }
            let state = &w.wave.paths.state;
            let point = SobolPoint::from_parts(state.seed[i], state.shuffled[i]);
            let [a, b, _, roulette] = point.sample_4d(&dimensions);
            let wi = lobes.sample(choice / SHARE, [a, b]);
            let value = self.value_towards(i, wi, sorted, w);
            let (paths, v) = (&mut w.wave.paths, &mut w.wave.vertices);
            if self.optional.interior {
                paths.interior[i] = lobes.interior;
            }
            let Some(value) = value.filter(|value| value.pdf_solid_angle > 0.0) else {
                paths.state.pdf[i] = DirectionPdf::after_roulette(0.0, false);
                continue;
            };
            let pdf = (1.0 - SHARE) * value.pdf_solid_angle + SHARE * lobes.pdf_solid_angle(wi);
            let throughput = lobes.throughput * value.f_cos * (1.0 / pdf);
            // Roulette takes the path for one of many that the BSDF sampled.
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

    /// Weights a direction that the BSDF has sampled by the density of the mixture.
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
            of_lobes.map_or(0.0, |pdf| SHARE * lobes.pdf_solid_angle(wi) / pdf.max(f32::MIN_POSITIVE));
        let throughput = &mut w.wave.paths.state.throughput;
        let value = get_rgb(throughput, i);
        set_rgb(throughput, i, value * (1.0 / (1.0 - SHARE + share)));
    }

    /// The BSDF of vertex `i` for light from a direction; `None` where it crosses the surface or is behind it.
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
        let height = wi.dot(get(&v.ng, i));
        if C::Closure::OPAQUE && height <= 0.0 || !C::Closure::IN_MEDIUM && closure.crosses(wi) {
            return None;
        }
        let (eval, kept) = eval_at_horizon(&closure, self.terminator(), (v, i), wi);
        let pdf_solid_angle = eval.pdf_solid_angle * class.light_density(v, i);
        Some(Value { f_cos: eval.f_cos * kept, pdf_solid_angle })
    }
}

/// The unit direction to a light.
fn direction(light: &SmallLight, p: Vec3) -> Vec3 {
    match light.place {
        LightPlace::Far(to) => to,
        LightPlace::Near(middle) => (middle - p).normalize_or_zero(),
    }
}

/// By how much of the angle at a face in some distance the direction at a point changes, and half the angle of the light, radians.
/// `None` if the light is in front of the face.
fn seen_from(light: &SmallLight, p: Vec3, distance: f32) -> Option<(f32, f32)> {
    match light.place {
        LightPlace::Far(_) => Some((1.0, light.size)),
        LightPlace::Near(middle) => {
            let all = (middle - p).length();
            (all > distance).then_some((1.0 - distance / all, light.size / all))
        }
    }
}

/// The direction in a medium that a face with a normal refracts to `to_light`; `ratio` is the index on the light's side over that of
/// the medium. `None` if there is none.
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
