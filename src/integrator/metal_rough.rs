//! Opaque glTF materials, many vertices at a time.

use super::direct::light_factor;
use super::normals::{scattering_normal, terminator};
use super::scatter::survival;
use super::wave::{MetalRoughs, WAVE, Wave, get, get_rgb, set, set_rgb};
use crate::bsdf::{
    DielectricCurve, DirectionalAlbedo, Facets, Isotropic, LayerFresnel, MetalRough, MetalRoughClosure,
    ShadingModel, above, mean_cosine,
};
use crate::math::{Frame, offset_along};
use crate::sampling::sampler::{Dimensions, SobolPoint};
use crate::scene::{EnergyCompensation, FresnelModel};
use crate::simd::{Kernel, dispatch};
use std::ops::Range;

/// Keeps the material of a vertex.
#[inline(always)]
pub(super) fn store(m: &mut MetalRoughs, k: usize, material: &MetalRough) {
    set_rgb(&mut m.diffuse, k, material.diffuse);
    set_rgb(&mut m.f0, k, material.layer_f0);
    set_rgb(&mut m.schlick_rise, k, material.metal_f0);
    m.probability_specular[k] = material.layer_f90;
    m.probability_diffuse[k] = material.metallic;
    m.alpha[k] = material.surface.alpha;
    m.curve[k] = match material.layer_fresnel {
        LayerFresnel::Schlick => 0.0,
        LayerFresnel::Exact(curve) => curve.amplitude,
    };
}

#[inline(always)]
fn material(m: &MetalRoughs, k: usize, shading: ShadingModel) -> MetalRough {
    MetalRough {
        layer_fresnel: match shading.fresnel {
            FresnelModel::Schlick => LayerFresnel::Schlick,
            FresnelModel::Exact => LayerFresnel::Exact(DielectricCurve { amplitude: m.curve[k] }),
        },
        diffuse: get_rgb(&m.diffuse, k),
        layer_f0: get_rgb(&m.f0, k),
        layer_f90: m.probability_specular[k],
        metal_f0: get_rgb(&m.schlick_rise, k),
        metallic: m.probability_diffuse[k],
        surface: Isotropic { alpha: m.alpha[k] },
        energy_compensation: shading.energy_compensation,
    }
}

#[inline(always)]
fn store_view(m: &mut MetalRoughs, k: usize, view: &MetalRoughClosure) {
    set_rgb(&mut m.diffuse, k, view.diffuse);
    set_rgb(&mut m.f0, k, view.f0);
    set_rgb(&mut m.schlick_rise, k, view.schlick_rise);
    set_rgb(&mut m.exact_rise, k, view.exact_rise);
    m.probability_specular[k] = view.probability_specular;
    m.probability_diffuse[k] = view.probability_diffuse;
    m.albedo[k] = view.albedo;
}

#[inline(always)]
fn view(m: &MetalRoughs, k: usize) -> MetalRoughClosure {
    MetalRoughClosure {
        diffuse: get_rgb(&m.diffuse, k),
        rest: 0.0,
        f0: get_rgb(&m.f0, k),
        schlick_rise: get_rgb(&m.schlick_rise, k),
        exact_rise: get_rgb(&m.exact_rise, k),
        curve: DielectricCurve { amplitude: m.curve[k] },
        albedo: m.albedo[k],
        probability_specular: m.probability_specular[k],
        probability_diffuse: m.probability_diffuse[k],
    }
}

/// Makes normals usable for scattering, and materials what their viewers see of them.
pub(super) fn see(wave: &mut Wave, range: Range<usize>, shading: ShadingModel) {
    match (shading.energy_compensation, shading.fresnel) {
        (EnergyCompensation::On, FresnelModel::Exact) => dispatch(See::<true, true> { wave, range }),
        (EnergyCompensation::On, FresnelModel::Schlick) => dispatch(See::<true, false> { wave, range }),
        (EnergyCompensation::Off, FresnelModel::Exact) => dispatch(See::<false, true> { wave, range }),
        (EnergyCompensation::Off, FresnelModel::Schlick) => dispatch(See::<false, false> { wave, range }),
    }
}

struct See<'a, const MULTI: bool, const EXACT: bool> {
    wave: &'a mut Wave,
    range: Range<usize>,
}

impl<const MULTI: bool, const EXACT: bool> Kernel for See<'_, MULTI, EXACT> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = &mut self.wave.vertices;
        let shading = ShadingModel {
            energy_compensation: if MULTI { EnergyCompensation::On } else { EnergyCompensation::Off },
            fresnel: if EXACT { FresnelModel::Exact } else { FresnelModel::Schlick },
        };
        let range = self.range.start..self.range.end.min(WAVE);
        // The second loop looks up tables, and has nothing else in it because that does not vectorise.
        for i in range.clone() {
            let (ns, wo) = (get(&v.ns, i), get(&v.wo, i));
            let ns = scattering_normal(ns, get(&v.ng, i), wo);
            set(&mut v.ns, i, ns);
            set(&mut v.wi, i, above(Frame::from_normal(ns).to_local(wo)));
        }
        for i in range.clone() {
            let surface = Isotropic { alpha: v.metal_rough.alpha[i] };
            let albedo = surface.directional_albedo(get(&v.wi, i));
            (v.weights[0][i], v.weights[1][i]) = (albedo.full, albedo.grazing);
            if EXACT {
                let curve = DielectricCurve { amplitude: v.metal_rough.curve[i] };
                v.metal_rough.albedo[i] = mean_cosine(v.wi[2][i], surface.alpha, curve);
            }
        }
        for i in range {
            let albedo = DirectionalAlbedo { full: v.weights[0][i], grazing: v.weights[1][i] };
            let material = material(&v.metal_rough, i, shading);
            let layer_grazing = match material.layer_fresnel {
                LayerFresnel::Schlick => albedo.grazing,
                LayerFresnel::Exact(curve) => albedo.full * curve.weight(v.metal_rough.albedo[i]),
            };
            let seen = material.closure_by(albedo, layer_grazing, get(&v.wi, i));
            store_view(&mut v.metal_rough, i, &seen);
        }
    }
}

/// What the light samples bring to the vertices.
pub(super) fn direct(wave: &mut Wave, range: Range<usize>, softens_terminator: bool) {
    match softens_terminator {
        true => dispatch(Direct::<true> { wave, range }),
        false => dispatch(Direct::<false> { wave, range }),
    }
}

struct Direct<'a, const SOFT: bool> {
    wave: &'a mut Wave,
    range: Range<usize>,
}

impl<const SOFT: bool> Kernel for Direct<'_, SOFT> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v } = self.wave;
        for i in self.range.start..self.range.end.min(WAVE) {
            let (wi, ng, ns) = (get(&v.wi, i), get(&v.ng, i), get(&v.ns, i));
            let frame = Frame::from_normal(ns);
            let (local_o, local_i) = (above(frame.to_local(get(&v.wo, i))), frame.to_local(wi));
            let surface = Isotropic { alpha: v.metal_rough.alpha[i] };
            let eval = view(&v.metal_rough, i).eval(&surface, local_o, local_i);
            let mut factor = light_factor(v.light_pdf[i], eval.pdf_solid_angle);
            if SOFT {
                factor *= terminator(ns, ng, wi);
            }
            let is_lit = (wi.dot(ng) > 0.0) & (v.light_pdf[i] != 0.0);
            let factor = if is_lit { factor } else { 0.0 };
            let light = get_rgb(&paths.throughput, i) * get_rgb(&v.light, i);
            set_rgb(&mut v.contribution, i, eval.f_cos * light * factor);
            let origin = offset_along(get(&v.p, i), ng, v.offset[i]);
            set(&mut v.origin, i, origin);
            let to_light = get(&v.target, i) - origin;
            set(&mut v.direction, i, if v.is_infinite[i] > 0.0 { wi } else { to_light });
        }
    }
}

/// Scatters at the vertices.
pub(super) fn scatter(
    wave: &mut Wave,
    range: Range<usize>,
    dimensions: &Dimensions,
    roulette: bool,
    softens_terminator: bool,
) {
    match softens_terminator {
        true => dispatch(Scatter::<true> { wave, range, dimensions, roulette }),
        false => dispatch(Scatter::<false> { wave, range, dimensions, roulette }),
    }
}

struct Scatter<'a, const SOFT: bool> {
    wave: &'a mut Wave,
    range: Range<usize>,
    dimensions: &'a Dimensions,
    roulette: bool,
}

impl<const SOFT: bool> Kernel for Scatter<'_, SOFT> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v } = self.wave;
        for i in self.range.start..self.range.end.min(WAVE) {
            let point = SobolPoint::from_parts(paths.seed[i], paths.shuffled[i]);
            let [a, b, lobe, chance] = point.sample_4d(self.dimensions);
            let (ng, ns) = (get(&v.ng, i), get(&v.ns, i));
            let frame = Frame::from_normal(ns);
            let wo = above(frame.to_local(get(&v.wo, i)));
            let surface = Isotropic { alpha: v.metal_rough.alpha[i] };
            let s = view(&v.metal_rough, i).sample(&surface, wo, wo, [a, b, lobe]);
            let wi = frame.to_world(s.wi);
            let mut throughput = get_rgb(&paths.throughput, i) * s.weight;
            if SOFT {
                throughput *= if s.is_specular { 1.0 } else { terminator(ns, ng, wi) };
            }
            let (survives, scale) = survival(throughput, paths.eta_squared[i], chance, self.roulette);
            set_rgb(&mut paths.throughput, i, throughput * scale);
            set(&mut v.origin, i, offset_along(get(&v.p, i), ng, v.offset[i]));
            set(&mut v.direction, i, wi);
            // A direction that shading normals lead below the surface carries nothing.
            let goes_on = survives & (s.pdf_solid_angle > 0.0) & (wi.dot(ng) > 0.0);
            let pdf = if s.is_specular { 0.0 } else { s.pdf_solid_angle };
            v.next_pdf[i] = if goes_on { pdf } else { -1.0 };
        }
    }
}
