//! Direct light: one light sample a vertex, weighted against scattering, and its shadow ray.

use super::environment::SampleEnvironment;
use super::metal_rough;
use super::normals::terminator;
use super::surface::{Sorted, add};
use super::wave::{Vertices, WAVE, Wave, Workspace, get, get_rgb, set, set_rgb};
use super::{Integrator, Purpose};
use crate::bsdf::Bsdf;
use crate::color::Rgb;
use crate::light::{AreaLight, AreaShape, Edges, LightSample, Lights, Radiance, Receiver};
use crate::math::{Frame, Ray, Vec3, offset_along, offset_ray_origin};
use crate::sampling::sampler::{Dimensions, SobolPoint};
use crate::sampling::{SphericalRectangle, power_heuristic};
use crate::simd::{Kernel, dispatch};
use std::f32::consts::FRAC_1_PI;

impl Integrator<'_> {
    /// Chooses a point of a light for each vertex that light can reach.
    pub(super) fn sample_lights(&self, bounce: u32, sorted: &Sorted, w: &mut Workspace) {
        let dimensions = self.dimensions(bounce, Purpose::Light);
        let (wave, count) = (&mut *w.wave, sorted.lit);
        if let Some((light, edges, radiance)) = self.only_rectangle() {
            dispatch(SampleRectangle { wave, count, dimensions: &dimensions, light, edges, radiance });
            return;
        }
        if let Some(map) = self.only_environment() {
            dispatch(SampleEnvironment { wave, count, dimensions: &dimensions, map });
            return;
        }
        let (lights, opaque) = (&self.scene.lights, sorted.metal_rough);
        dispatch(SelectLights { wave, count, opaque, lights, dimensions: &dimensions });
        for i in 0..count {
            let v = &wave.vertices;
            let (p, u, chance) = (get(&v.p, i), get(&v.light, i), v.light_chance[i]);
            let sample = match chance > 0.0 {
                true => lights.sample(&self.scene.textures, v.light_index[i], p, [u.x, u.y]),
                false => LightSample::NONE,
            };
            store(&mut wave.vertices, i, &sample, chance);
        }
    }

    /// The scene's light, if it has just one that is a rectangle of constant radiance.
    fn only_rectangle(&self) -> Option<(&AreaLight, Edges, Rgb)> {
        match self.scene.lights.area() {
            [light] if self.scene.lights.len() == 1 => match (light.shape, light.radiance) {
                (AreaShape::Rectangle(edges), Radiance::Constant(radiance)) => Some((light, edges, radiance)),
                _ => None,
            },
            _ => None,
        }
    }

    /// Adds the light that reaches the vertices from their light samples.
    pub(super) fn trace_shadows(&self, bounce: u32, sorted: &Sorted, w: &mut Workspace) {
        let softens = self.softens_terminator();
        if softens {
            dispatch(LambertDirect::<true> { wave: &mut w.wave, count: sorted.lambert });
        } else {
            dispatch(LambertDirect::<false> { wave: &mut w.wave, count: sorted.lambert });
        }
        metal_rough::direct(&mut w.wave, sorted.lambert..sorted.metal_rough, softens);
        for i in sorted.metal_rough..sorted.lit {
            generic_direct(&mut w.wave, i, &w.bsdfs[i - sorted.metal_rough], softens);
        }
        if self.scene.features.absorption {
            self.absorb_light(sorted, &mut w.wave);
        }
        w.shadow_rays.clear();
        w.shadow_vertices.clear();
        let v = &w.wave.vertices;
        for i in 0..sorted.lit {
            let brightest = v.contribution[0][i].max(v.contribution[1][i]).max(v.contribution[2][i]);
            if brightest > 0.0 {
                let t_max = if v.is_infinite[i] > 0.0 { f32::INFINITY } else { 1.0 };
                let (origin, direction) = (get(&v.origin, i), get(&v.direction, i));
                w.shadow_rays.push(Ray {
                    t_max,
                    origin_primitive: v.departures[i],
                    ..Ray::new(origin, direction)
                });
                w.shadow_vertices.push(i as u32);
            }
        }
        w.occluded.clear();
        w.occluded.resize(w.shadow_rays.len(), false);
        if self.scene.features.alpha {
            self.occluded_by_present_surfaces(bounce, w);
        } else {
            self.scene.accel.occluded(&w.shadow_rays, &mut w.occluded);
            w.ray_count += w.shadow_rays.len() as u64;
        }
        for (&i, &occluded) in w.shadow_vertices.iter().zip(&w.occluded) {
            if !occluded {
                let sample = w.wave.paths.sample[i as usize] as usize;
                add(&mut w.radiance[sample], get_rgb(&w.wave.vertices.contribution, i as usize));
            }
        }
    }
}

/// Keeps a light sample. Lights without size have a negative density.
fn store(v: &mut Vertices, i: usize, sample: &LightSample, pdf_discrete: f32) {
    set(&mut v.wi, i, sample.wi);
    set(&mut v.target, i, sample.target);
    set_rgb(&mut v.light, i, sample.radiance);
    v.is_infinite[i] = f32::from(u8::from(sample.is_infinite));
    let pdf = sample.pdf_solid_angle * pdf_discrete;
    v.light_pdf[i] = if sample.is_delta { -pdf } else { pdf };
}

/// Chooses a light for each vertex. Two random numbers for a point on it go to `vertices.light`.
struct SelectLights<'a> {
    wave: &'a mut Wave,
    count: usize,
    /// So many opaque vertices come first: light from behind does nothing there.
    opaque: usize,
    lights: &'a Lights,
    dimensions: &'a Dimensions,
}

impl Kernel for SelectLights<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v } = self.wave;
        let count = self.count.min(WAVE);
        for i in 0..count {
            let point = SobolPoint::from_parts(paths.seed[i], paths.shuffled[i]);
            let [a, b, c, d] = point.sample_4d(self.dimensions);
            set(&mut v.light, i, Vec3::new(a, b, c));
            v.light_chance[i] = d;
        }
        for i in 0..count {
            let normal = if i < self.opaque { get(&v.ns, i) } else { Vec3::ZERO };
            set(&mut paths.receiver_normal, i, normal);
            let receiver = Receiver { p: get(&v.p, i), normal };
            let chosen = self.lights.select(&receiver, [v.light[2][i], v.light_chance[i]]);
            (v.light_index[i], v.light_chance[i]) = (chosen.index, chosen.pdf_discrete);
        }
    }
}

/// Light samples of a scene whose only light is a rectangle.
struct SampleRectangle<'a> {
    wave: &'a mut Wave,
    count: usize,
    dimensions: &'a Dimensions,
    light: &'a AreaLight,
    edges: Edges,
    radiance: Rgb,
}

impl Kernel for SampleRectangle<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v } = self.wave;
        let Edges { corner, edge_u, edge_v } = self.edges;
        let (normal, error) = (self.light.normal, self.light.point_error());
        let two_sided = self.light.two_sided;
        for i in 0..self.count.min(WAVE) {
            let point = SobolPoint::from_parts(paths.seed[i], paths.shuffled[i]);
            let [a, b, ..] = point.sample_4d(self.dimensions);
            let p = get(&v.p, i);
            let s = SphericalRectangle::new(corner, edge_u, edge_v, p).sample([a, b]);
            let to_light = s.point - p;
            let distance = to_light.length();
            let is_lit = (two_sided | (to_light.dot(normal) < 0.0)) & !self.light.is_level_with(p);
            let pdf = if is_lit & (distance > 0.0) { s.pdf_solid_angle } else { 0.0 };
            set(&mut v.wi, i, to_light / if distance > 0.0 { distance } else { 1.0 });
            set(&mut v.target, i, offset_ray_origin(s.point, error, normal, -to_light));
            set_rgb(&mut v.light, i, self.radiance);
            v.is_infinite[i] = 0.0;
            v.light_pdf[i] = pdf;
        }
    }
}

/// What the light samples bring to Lambertian vertices; with softened shadow terminators or without.
struct LambertDirect<'a, const SOFT: bool> {
    wave: &'a mut Wave,
    count: usize,
}

impl<const SOFT: bool> Kernel for LambertDirect<'_, SOFT> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v } = self.wave;
        for i in 0..self.count.min(WAVE) {
            let (wi, ng, ns) = (get(&v.wi, i), get(&v.ng, i), get(&v.ns, i));
            let cosine = wi.dot(ns);
            let is_lit = (cosine > 0.0) & (wi.dot(ng) > 0.0);
            let pdf = cosine * FRAC_1_PI;
            let mut factor = light_factor(v.light_pdf[i], pdf);
            if SOFT {
                factor *= terminator(ns, ng, wi);
            }
            let f_cos = get_rgb(&v.albedo, i) * if is_lit { pdf * factor } else { 0.0 };
            set_rgb(&mut v.contribution, i, get_rgb(&paths.throughput, i) * f_cos * get_rgb(&v.light, i));
            let origin = offset_along(get(&v.p, i), ng, v.offset[i]);
            set(&mut v.origin, i, origin);
            let to_light = get(&v.target, i) - origin;
            set(&mut v.direction, i, if v.is_infinite[i] > 0.0 { wi } else { to_light });
        }
    }
}

/// What a light sample brings to a vertex with any BSDF.
fn generic_direct(wave: &mut Wave, i: usize, bsdf: &Bsdf, softens_terminator: bool) {
    let v = &mut wave.vertices;
    set_rgb(&mut v.contribution, i, Rgb::ZERO);
    let (wi, wo, ng) = (get(&v.wi, i), get(&v.wo, i), get(&v.ng, i));
    let (side_o, side_i) = (wo.dot(ng), wi.dot(ng));
    // Most lobes that light sampling can reach reflect.
    let crosses = side_o * side_i < 0.0;
    let is_possible = if crosses { bsdf.scatters_through() } else { side_i != 0.0 };
    if v.light_pdf[i] == 0.0 || !is_possible || bsdf.is_specular() {
        return;
    }
    let ns = get(&v.ns, i);
    let frame = Frame::from_normal(ns);
    let (local_o, local_i) = (frame.to_local(wo), frame.to_local(wi));
    // Both normals must agree on which side the light is.
    if crosses && local_o.z * local_i.z >= 0.0 {
        return;
    }
    let eval = bsdf.eval(local_o, local_i);
    let mut factor = light_factor(v.light_pdf[i], eval.pdf_solid_angle);
    if softens_terminator && !crosses {
        let side = if side_i < 0.0 { -1.0 } else { 1.0 };
        factor *= terminator(ns * side, ng * side, wi);
    }
    let contribution = get_rgb(&wave.paths.throughput, i) * eval.f_cos * get_rgb(&v.light, i) * factor;
    set_rgb(&mut v.contribution, i, contribution);
    let origin = offset_along(get(&v.p, i), if side_i < 0.0 { -ng } else { ng }, v.offset[i]);
    set(&mut v.origin, i, origin);
    let to_light = get(&v.target, i) - origin;
    set(&mut v.direction, i, if v.is_infinite[i] > 0.0 { wi } else { to_light });
}

/// Weight over density of a light sample; lights without size (negative density) have no competitor.
#[inline(always)]
pub(super) fn light_factor(light_pdf: f32, bsdf_pdf: f32) -> f32 {
    let is_delta = light_pdf < 0.0;
    let pdf = light_pdf.abs();
    let weight = power_heuristic(pdf, if is_delta { 0.0 } else { bsdf_pdf });
    weight / if pdf > 0.0 { pdf } else { 1.0 }
}
