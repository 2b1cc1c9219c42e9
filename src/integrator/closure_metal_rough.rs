//! The class of opaque glTF materials: their closures, many at a time.

use super::closure::{Closure, VertexClass};
use super::lanes::{PerPath, WAVE, get, get_rgb, set, set_rgb};
use super::normals::bent_normal;
use super::wave::{MetalRoughClosures, MetalRoughMaterials, Vertices, Wave};
use crate::bsdf::{
    BsdfEval, BsdfSample, DielectricCurve, DirectionalAlbedo, Facets, Isotropic, LayerFresnel, MetalRough,
    MetalRoughClosure, ShadingModel, above, mean_cosine,
};
use crate::color::Rgb;
use crate::math::{Frame, Vec3};
use crate::scene::{EnergyCompensation, FresnelModel};
use crate::simd::{Kernel, dispatch};
use std::f32::consts::FRAC_1_PI;
use std::ops::Range;

/// Keeps the material of a vertex.
#[inline(always)]
pub(super) fn store_material(m: &mut MetalRoughMaterials, k: usize, material: &MetalRough) {
    set_rgb(&mut m.diffuse, k, material.diffuse);
    set_rgb(&mut m.layer_f0, k, material.layer_f0);
    m.layer_f90[k] = material.layer_f90;
    set_rgb(&mut m.metal_f0, k, material.metal_f0);
    m.metallic[k] = material.metallic;
    m.alpha[k] = material.surface.alpha;
    m.curve[k] = match material.layer_fresnel {
        LayerFresnel::Schlick => 0.0,
        LayerFresnel::Exact(curve) => curve.amplitude,
    };
}

/// The material of a vertex.
#[inline(always)]
pub(super) fn load_material(m: &MetalRoughMaterials, k: usize, shading: ShadingModel) -> MetalRough {
    MetalRough {
        diffuse: get_rgb(&m.diffuse, k),
        layer_f0: get_rgb(&m.layer_f0, k),
        layer_f90: m.layer_f90[k],
        layer_fresnel: match shading.fresnel {
            FresnelModel::Schlick => LayerFresnel::Schlick,
            FresnelModel::Exact => LayerFresnel::Exact(DielectricCurve { amplitude: m.curve[k] }),
        },
        metal_f0: get_rgb(&m.metal_f0, k),
        metallic: m.metallic[k],
        surface: Isotropic { alpha: m.alpha[k] },
        energy_compensation: shading.energy_compensation,
    }
}

#[inline(always)]
fn store_closure(m: &mut MetalRoughClosures, k: usize, closure: &MetalRoughClosure) {
    set_rgb(&mut m.diffuse, k, closure.diffuse);
    set_rgb(&mut m.f0, k, closure.f0);
    set_rgb(&mut m.schlick_rise, k, closure.schlick_rise);
    set_rgb(&mut m.exact_rise, k, closure.exact_rise);
    m.probability_specular[k] = closure.probability_specular;
    m.probability_diffuse[k] = closure.probability_diffuse;
    m.albedo[k] = closure.albedo;
}

#[inline(always)]
fn load_closure(m: &MetalRoughClosures, curve: f32, k: usize) -> MetalRoughClosure {
    MetalRoughClosure {
        diffuse: get_rgb(&m.diffuse, k),
        rest: 0.0,
        f0: get_rgb(&m.f0, k),
        schlick_rise: get_rgb(&m.schlick_rise, k),
        exact_rise: get_rgb(&m.exact_rise, k),
        curve: DielectricCurve { amplitude: curve },
        albedo: m.albedo[k],
        probability_specular: m.probability_specular[k],
        probability_diffuse: m.probability_diffuse[k],
    }
}

/// Copies what the closure of vertex `i` is made of to vertex `k` of others.
#[inline(always)]
pub(super) fn copy_metal_rough(from: &Vertices, i: usize, to: &mut Vertices, k: usize) {
    from.metal_rough_closures.copy_to(i, &mut to.metal_rough_closures, k);
    to.metal_rough.alpha[k] = from.metal_rough.alpha[i];
    to.metal_rough.curve[k] = from.metal_rough.curve[i];
}

/// Makes normals usable for scattering, and closures of materials and viewers.
pub(super) fn prepare(wave: &mut Wave, range: Range<usize>, shading: ShadingModel) {
    match (shading.energy_compensation, shading.fresnel) {
        (EnergyCompensation::On, FresnelModel::Exact) => dispatch(Prepare::<true, true> { wave, range }),
        (EnergyCompensation::On, FresnelModel::Schlick) => dispatch(Prepare::<true, false> { wave, range }),
        (EnergyCompensation::Off, FresnelModel::Exact) => dispatch(Prepare::<false, true> { wave, range }),
        (EnergyCompensation::Off, FresnelModel::Schlick) => dispatch(Prepare::<false, false> { wave, range }),
    }
}

struct Prepare<'a, const COMPENSATES: bool, const EXACT: bool> {
    wave: &'a mut Wave,
    range: Range<usize>,
}

impl<const COMPENSATES: bool, const EXACT: bool> Kernel for Prepare<'_, COMPENSATES, EXACT> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { vertices: v, scratch, .. } = self.wave;
        let [x, y, z, full, grazing, mean_cosines, ..] = scratch;
        let shading = ShadingModel {
            energy_compensation: if COMPENSATES { EnergyCompensation::On } else { EnergyCompensation::Off },
            fresnel: if EXACT { FresnelModel::Exact } else { FresnelModel::Schlick },
            spectral: false,
        };
        let range = self.range.start..self.range.end.min(WAVE);
        // The second loop looks up tables, and has nothing else in it because that does not vectorise.
        for i in range.clone() {
            let (ns, wo) = (get(&v.ns, i), get(&v.wo, i));
            let (ns, is_bent) = bent_normal(ns, get(&v.ng, i), wo);
            v.is_bent[i] = if is_bent { 1.0 } else { 0.0 };
            set(&mut v.ns, i, ns);
            [x[i], y[i], z[i]] = above(Frame::from_normal(ns).to_local(wo)).to_array();
        }
        for i in range.clone() {
            let surface = Isotropic { alpha: v.metal_rough.alpha[i] };
            let albedo = surface.directional_albedo(Vec3::new(x[i], y[i], z[i]));
            (full[i], grazing[i]) = (albedo.full, albedo.grazing);
            if EXACT {
                let curve = DielectricCurve { amplitude: v.metal_rough.curve[i] };
                mean_cosines[i] = mean_cosine(z[i], surface.alpha, curve);
            }
        }
        for i in range {
            let albedo = DirectionalAlbedo { full: full[i], grazing: grazing[i] };
            let wo = Vec3::new(x[i], y[i], z[i]);
            let material = load_material(&v.metal_rough, i, shading);
            let layer_grazing = match material.layer_fresnel {
                LayerFresnel::Schlick => albedo.grazing,
                LayerFresnel::Exact(curve) => albedo.full * curve.weight(mean_cosines[i]),
            };
            let closure = material.closure_by(albedo, layer_grazing, wo);
            store_closure(&mut v.metal_rough_closures, i, &closure);
        }
    }
}

/// Vertices of opaque glTF materials, after [`prepare`].
#[derive(Clone, Copy)]
pub(super) struct MetalRoughClass;

/// An opaque glTF material for its viewer.
pub(super) struct MetalRoughVertex {
    lobes: MetalRoughClosure,
    surface: Isotropic,
    frame: Frame,
    /// Towards the viewer in the frame, above the surface.
    wo: Vec3,
}

impl VertexClass for MetalRoughClass {
    type Closure = MetalRoughVertex;

    #[inline(always)]
    fn closure(&self, v: &Vertices, i: usize) -> MetalRoughVertex {
        let frame = Frame::from_normal(get(&v.ns, i));
        let wo = above(frame.to_local(get(&v.wo, i)));
        let surface = Isotropic { alpha: v.metal_rough.alpha[i] };
        MetalRoughVertex {
            lobes: load_closure(&v.metal_rough_closures, v.metal_rough.curve[i], i),
            surface,
            frame,
            wo,
        }
    }
}

impl MetalRoughVertex {
    /// The density of a direction over that of [`Closure::sample`], where the diffuse lobe is chosen from `density` times as densely
    /// there.
    #[inline(always)]
    pub fn guided(&self, wi: Vec3, density: f32) -> f32 {
        let local = self.frame.to_local(wi);
        let pdf = self.lobes.eval(&self.surface, self.wo, local).pdf_solid_angle;
        let diffuse = self.lobes.probability_diffuse * local.z * FRAC_1_PI;
        if (pdf > 0.0) & (diffuse > 0.0) { 1.0 + (density - 1.0) * (diffuse / pdf) } else { 1.0 }
    }

    /// Does a number choose the diffuse lobe?
    #[inline(always)]
    pub fn is_diffuse(&self, u: f32) -> bool {
        u >= self.lobes.probability_specular
    }

    /// What paths that the diffuse lobe scatters bring of the irradiance over pi.
    #[inline(always)]
    pub fn diffuse_weight(&self) -> Rgb {
        let probability = self.lobes.probability_diffuse;
        self.lobes.diffuse * (1.0 / if probability > 0.0 { probability } else { 1.0 })
    }

    /// The share of the light from `wi` that is reflected diffusely.
    pub fn diffuse_share(&self, wi: Vec3) -> Rgb {
        self.share_of(self.lobes.diffuse * FRAC_1_PI, wi).min(Rgb::ONE)
    }

    /// The share of the light from `wi` that is reflected by a diffuse lobe which is a part of the BSDF.
    pub fn share_of(&self, f: Rgb, wi: Vec3) -> Rgb {
        let local = self.frame.to_local(wi);
        let all = self.lobes.eval(&self.surface, self.wo, local).f_cos.to_array();
        let part = (f * local.z.max(0.0)).to_array();
        Rgb::from_array(std::array::from_fn(|c| if all[c] > 0.0 { part[c] / all[c] } else { 0.0 }))
    }
}

impl Closure for MetalRoughVertex {
    const OPAQUE: bool = true;
    const BRANCHES: bool = false;

    #[inline(always)]
    fn eval(&self, wi: Vec3) -> BsdfEval {
        self.lobes.eval(&self.surface, self.wo, self.frame.to_local(wi))
    }

    #[inline(always)]
    fn sample(&self, u: [f32; 3]) -> BsdfSample {
        let sample = self.lobes.sample(&self.surface, self.wo, self.wo, u);
        BsdfSample { wi: self.frame.to_world(sample.wi), ..sample }
    }

    #[inline(always)]
    fn scattered(&self, eval: BsdfEval, weight: f32, throughput: Rgb, radiance: Rgb) -> Rgb {
        eval.f_cos * (throughput * radiance) * weight
    }
}
