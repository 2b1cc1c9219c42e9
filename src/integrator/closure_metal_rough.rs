//! The class of opaque glTF materials: their closures, many at a time.

use super::closure::{Closure, VertexClass};
use super::lanes::{Rgb, WAVE, get, get_rgb, set, set_rgb};
use super::normals::scattering_normal;
use super::wave::{MetalRoughClosures, MetalRoughMaterials, Vertices, Wave};
use crate::bsdf::{BsdfEval, BsdfSample, DirectionalAlbedo, Facets, Isotropic, MetalRough, View, above};
use crate::math::{Frame, Vec3};
use crate::scene::Microfacet;
use crate::simd::{Kernel, dispatch};
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
}

#[inline(always)]
fn material(m: &MetalRoughMaterials, k: usize, microfacet: Microfacet) -> MetalRough {
    MetalRough {
        diffuse: get_rgb(&m.diffuse, k),
        layer_f0: get_rgb(&m.layer_f0, k),
        layer_f90: m.layer_f90[k],
        metal_f0: get_rgb(&m.metal_f0, k),
        metallic: m.metallic[k],
        surface: Isotropic { alpha: m.alpha[k] },
        microfacet,
    }
}

#[inline(always)]
fn store_view(m: &mut MetalRoughClosures, k: usize, view: &View) {
    set_rgb(&mut m.diffuse, k, view.diffuse);
    set_rgb(&mut m.f0, k, view.f0);
    set_rgb(&mut m.f90, k, view.f90);
    m.specular_probability[k] = view.p_specular;
    m.diffuse_probability[k] = view.p_diffuse;
    m.albedo[k] = view.albedo;
}

#[inline(always)]
fn view(m: &MetalRoughClosures, k: usize) -> View {
    View {
        diffuse: get_rgb(&m.diffuse, k),
        rest: 0.0,
        f0: get_rgb(&m.f0, k),
        f90: get_rgb(&m.f90, k),
        albedo: m.albedo[k],
        p_specular: m.specular_probability[k],
        p_diffuse: m.diffuse_probability[k],
    }
}

/// Makes normals usable for scattering, and closures of materials and viewers.
pub(super) fn prepare(wave: &mut Wave, range: Range<usize>, microfacet: Microfacet) {
    match microfacet {
        Microfacet::Multi => dispatch(Prepare::<true> { wave, range }),
        Microfacet::Single => dispatch(Prepare::<false> { wave, range }),
    }
}

struct Prepare<'a, const MULTI: bool> {
    wave: &'a mut Wave,
    range: Range<usize>,
}

impl<const MULTI: bool> Kernel for Prepare<'_, MULTI> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { vertices: v, scratch, .. } = self.wave;
        let [x, y, z, full, grazing, ..] = scratch;
        let microfacet = if MULTI { Microfacet::Multi } else { Microfacet::Single };
        let range = self.range.start..self.range.end.min(WAVE);
        // The second loop looks up a table, and has nothing else in it because that does not vectorise.
        for i in range.clone() {
            let (ns, wo) = (get(&v.ns, i), get(&v.wo, i));
            let ns = scattering_normal(ns, get(&v.ng, i), wo);
            set(&mut v.ns, i, ns);
            [x[i], y[i], z[i]] = above(Frame::from_normal(ns).to_local(wo)).to_array();
        }
        for i in range.clone() {
            let surface = Isotropic { alpha: v.metal_rough.alpha[i] };
            let albedo = surface.directional_albedo(Vec3::new(x[i], y[i], z[i]));
            (full[i], grazing[i]) = (albedo.full, albedo.grazing);
        }
        for i in range {
            let albedo = DirectionalAlbedo { full: full[i], grazing: grazing[i] };
            let wo = Vec3::new(x[i], y[i], z[i]);
            let view = material(&v.metal_rough, i, microfacet).view_by(albedo, wo);
            store_view(&mut v.metal_rough_closures, i, &view);
        }
    }
}

/// Vertices of opaque glTF materials, after [`prepare`].
pub(super) struct MetalRoughClass;

/// An opaque glTF material for its viewer.
pub(super) struct MetalRoughClosure {
    view: View,
    surface: Isotropic,
    frame: Frame,
    /// Towards the viewer in the frame, above the surface.
    wo: Vec3,
}

impl VertexClass for MetalRoughClass {
    type Closure = MetalRoughClosure;

    #[inline(always)]
    fn closure(&self, v: &Vertices, i: usize) -> MetalRoughClosure {
        let frame = Frame::from_normal(get(&v.ns, i));
        let wo = above(frame.to_local(get(&v.wo, i)));
        let surface = Isotropic { alpha: v.metal_rough.alpha[i] };
        MetalRoughClosure { view: view(&v.metal_rough_closures, i), surface, frame, wo }
    }
}

impl Closure for MetalRoughClosure {
    const OPAQUE: bool = true;
    const BRANCHES: bool = false;

    #[inline(always)]
    fn eval(&self, wi: Vec3) -> BsdfEval {
        self.view.eval(&self.surface, self.wo, self.frame.to_local(wi))
    }

    #[inline(always)]
    fn sample(&self, u: [f32; 3]) -> BsdfSample {
        let sample = self.view.sample(&self.surface, self.wo, self.wo, u);
        BsdfSample { wi: self.frame.to_world(sample.wi), ..sample }
    }

    #[inline(always)]
    fn scattered(&self, eval: BsdfEval, weight: f32, throughput: Rgb, radiance: Rgb) -> Rgb {
        eval.f_cos * (throughput * radiance) * weight
    }
}
