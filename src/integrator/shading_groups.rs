//! Shading groups: which vertices are shaded by the same loop, their order, and the closure of each group.

use super::shading_geometry::bent_normal;
use super::wave::{
    MetalRoughClosures, MetalRoughMaterials, PerPath, Vertices, WAVE, Wave, get, get_rgb, set, set_rgb,
};
use crate::bsdf::phase::{henyey_greenstein, sample_henyey_greenstein};
use crate::bsdf::{
    Bsdf, BsdfClass, BsdfEval, BsdfSample, DielectricCurve, DirectionalAlbedo, Facets, Isotropic,
    LayerFresnel, MetalRough, MetalRoughClosure, ShadingModel, above, mean_cosine,
};
use crate::color::Rgb;
use crate::compile::{CompiledMaterial, CompiledScene};
use crate::math::{Frame, Vec3};
use crate::sampling::warp;
use crate::scene::{EnergyCompensation, FresnelModel};
use crate::simd::{Kernel, dispatch};
use std::f32::consts::FRAC_1_PI;
use std::ops::Range;

/// Which loops shade a vertex. The order is that of the sorted vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ShadingGroup {
    /// Lambertian, of constant albedo, on a triangle or quad: a vectorised loop makes the vertex.
    Plain,
    /// Other Lambertian ones.
    Lambert,
    /// Opaque glTF materials, the same everywhere, on a triangle or quad: a vectorised loop makes the vertex.
    PlainMetalRough,
    /// Opaque glTF materials with textures on triangles: vectorised loops make the vertices.
    Textured,
    /// Other opaque glTF materials.
    MetalRough,
    /// Points of media that scatter.
    Medium,
    /// Others that light sampling may reach.
    Rough,
    /// It can't.
    Specular,
    /// The path ends here.
    None,
}

const GROUPS: usize = 9;

impl ShadingGroup {
    /// The group of the same materials on shapes of other kinds.
    pub fn of_any_shape(self) -> ShadingGroup {
        match self {
            ShadingGroup::Plain => ShadingGroup::Lambert,
            ShadingGroup::PlainMetalRough => ShadingGroup::MetalRough,
            group => group,
        }
    }
}

/// How many hits there are of each group.
pub struct ShadingGroupCounts([usize; GROUPS]);

impl ShadingGroupCounts {
    /// Of no hit.
    pub fn new() -> ShadingGroupCounts {
        ShadingGroupCounts([0; GROUPS])
    }

    /// Counts a hit.
    #[inline(always)]
    pub fn add(&mut self, group: ShadingGroup) {
        self.0[group as usize] += 1;
    }

    /// Where the vertices of each group lie.
    pub fn sorted(&self) -> SortedVertices {
        let mut sum = 0;
        let starts = self.0.map(|count| {
            sum += count;
            sum - count
        });
        SortedVertices { starts }
    }
}

/// Where the sorted vertices of each group lie.
#[derive(Clone, Copy, Debug)]
pub struct SortedVertices {
    starts: [usize; GROUPS],
}

impl SortedVertices {
    /// The same with each vertex several times.
    pub fn times(mut self, times: usize) -> SortedVertices {
        for start in &mut self.starts {
            *start *= times;
        }
        self
    }

    /// The first place of each group.
    pub fn starts(&self) -> [usize; GROUPS] {
        self.starts
    }

    fn from(&self, first: ShadingGroup, behind: ShadingGroup) -> Range<usize> {
        self.starts[first as usize]..self.starts[behind as usize]
    }

    /// The first ones: a loop makes them of their corners alone.
    pub fn plain(&self) -> Range<usize> {
        self.from(ShadingGroup::Plain, ShadingGroup::Lambert)
    }

    /// Those and the other Lambertian ones.
    pub fn lambert(&self) -> Range<usize> {
        self.from(ShadingGroup::Plain, ShadingGroup::PlainMetalRough)
    }

    /// The next: loops make them of their corners alone, too.
    pub fn plain_metal_rough(&self) -> Range<usize> {
        self.from(ShadingGroup::PlainMetalRough, ShadingGroup::Textured)
    }

    /// The next.
    pub fn textured(&self) -> Range<usize> {
        self.from(ShadingGroup::Textured, ShadingGroup::MetalRough)
    }

    /// Those two and the other ones of opaque glTF materials.
    pub fn metal_rough(&self) -> Range<usize> {
        self.from(ShadingGroup::PlainMetalRough, ShadingGroup::Medium)
    }

    /// All that a guide may guide: these and the Lambertian ones.
    pub fn guided(&self) -> Range<usize> {
        self.from(ShadingGroup::Plain, ShadingGroup::Medium)
    }

    /// The points of media.
    pub fn medium(&self) -> Range<usize> {
        self.from(ShadingGroup::Medium, ShadingGroup::Rough)
    }

    /// All others that light sampling can reach.
    pub fn rough(&self) -> Range<usize> {
        self.from(ShadingGroup::Rough, ShadingGroup::Specular)
    }

    /// Those and the specular ones: all without a vectorised class.
    pub fn general(&self) -> Range<usize> {
        self.from(ShadingGroup::Rough, ShadingGroup::None)
    }

    /// All that light sampling can reach, Lambertian ones included.
    pub fn lit(&self) -> Range<usize> {
        self.from(ShadingGroup::Plain, ShadingGroup::Specular)
    }

    /// All.
    pub fn all(&self) -> Range<usize> {
        self.from(ShadingGroup::Plain, ShadingGroup::None)
    }
}

/// The groups of all materials of a scene.
pub fn groups_of(scene: &CompiledScene) -> Vec<ShadingGroup> {
    let own = scene.materials.iter().map(|m| group_of(m, scene.shading.spectral));
    let mut groups: Vec<ShadingGroup> = own.collect();
    let is_rough =
        |(group, m): (&ShadingGroup, &CompiledMaterial)| *group == ShadingGroup::Rough && m.medium_index != 0;
    if scene.features.coincident_surfaces && groups.iter().zip(&scene.materials).any(is_rough) {
        // Where a smooth solid touches a rough one, the surface that counts may be the other's.
        for (group, material) in groups.iter_mut().zip(&scene.materials) {
            if *group == ShadingGroup::Specular && material.medium_index != 0 {
                *group = ShadingGroup::Rough;
            }
        }
    }
    groups
}

/// The group of a material's vertices, on shapes that don't demand another.
fn group_of(material: &CompiledMaterial, by_wavelength: bool) -> ShadingGroup {
    let is_plain = material.constant.is_some() && !material.uses_uv && material.emission.is_none();
    match material.class {
        BsdfClass::Black => ShadingGroup::None,
        // Neighbouring pixels don't share what it reflects, as they do in the groups below.
        BsdfClass::Lambert | BsdfClass::MetalRough if material.depends_on_viewer => ShadingGroup::Rough,
        BsdfClass::Lambert => {
            if is_plain {
                ShadingGroup::Plain
            } else {
                ShadingGroup::Lambert
            }
        }
        _ if material.is_smooth_glass() => ShadingGroup::Specular,
        _ => {
            // What is smooth in air need not be within another solid.
            let stays_smooth = |b: Bsdf| material.medium_index == 0 || b.with_ior(2.0).is_specular();
            let is_specular = material.alike().is_some_and(|b| b.is_specular() && stays_smooth(b));
            match material.class {
                _ if is_specular => ShadingGroup::Specular,
                BsdfClass::MetalRough if by_wavelength && material.constant.is_none() => {
                    ShadingGroup::MetalRough
                }
                BsdfClass::MetalRough if material.uses_uv && !material.uses_vertex_colors => {
                    ShadingGroup::Textured
                }
                BsdfClass::MetalRough if is_plain && material.medium_index == 0 => {
                    ShadingGroup::PlainMetalRough
                }
                BsdfClass::MetalRough => ShadingGroup::MetalRough,
                _ => ShadingGroup::Rough,
            }
        }
    }
}

/// A BSDF at a vertex for its viewer. All directions are in world space.
pub trait Closure {
    /// All its lobes reflect, and the normals at its vertices are on the viewer's side.
    const OPAQUE: bool;

    /// It is a point of a medium, which has no sides.
    const IN_MEDIUM: bool = false;

    /// Evaluating costs more than a branch; otherwise it is free of branches, so that loops vectorise.
    const BRANCHES: bool;

    /// Value and density for light from `wi`; zero value where none can come from there. Specular lobes don't count.
    fn eval(&self, wi: Vec3) -> BsdfEval;

    /// Chooses a direction by three numbers in 0..1, of which the last chooses the lobe.
    fn sample(&self, u: [f32; 3]) -> BsdfSample;

    /// Is `wi` on the other side of the surface than the viewer?
    #[inline(always)]
    fn crosses(&self, _wi: Vec3) -> bool {
        false
    }

    /// The light of a light sample that goes on to the camera: value times weight times radiance. Products are rounded
    /// in the order that a class chooses.
    #[inline(always)]
    fn scattered(&self, eval: BsdfEval, weight: f32, throughput: Rgb, radiance: Rgb) -> Rgb {
        throughput * eval.f_cos * radiance * weight
    }
}

/// A class of vertices whose closures are loaded alike.
pub trait VertexClass {
    /// Their closure.
    type Closure: Closure;

    /// The closure of vertex `i`.
    fn closure(&self, v: &Vertices, i: usize) -> Self::Closure;

    /// The density with which vertex `i` might choose the direction of its light sample, over the closure's.
    #[inline(always)]
    fn light_density(&self, _v: &Vertices, _i: usize) -> f32 {
        1.0
    }
}

/// Lambertian vertices.
#[derive(Clone, Copy)]
pub struct LambertClass;

/// Ideal diffuse reflection around a normal.
pub struct LambertClosure {
    albedo: Rgb,
    ns: Vec3,
}

impl VertexClass for LambertClass {
    type Closure = LambertClosure;

    #[inline(always)]
    fn closure(&self, v: &Vertices, i: usize) -> LambertClosure {
        LambertClosure { albedo: get_rgb(&v.albedo, i), ns: get(&v.ns, i) }
    }
}

impl Closure for LambertClosure {
    const OPAQUE: bool = true;
    const BRANCHES: bool = false;

    #[inline(always)]
    fn eval(&self, wi: Vec3) -> BsdfEval {
        let cosine = wi.dot(self.ns);
        let pdf_solid_angle = if cosine > 0.0 { cosine * FRAC_1_PI } else { 0.0 };
        BsdfEval { f_cos: self.albedo * pdf_solid_angle, pdf_solid_angle }
    }

    #[inline(always)]
    fn sample(&self, u: [f32; 3]) -> BsdfSample {
        let local = warp::cosine_hemisphere([u[0], u[1]]);
        BsdfSample {
            wi: Frame::from_normal(self.ns).to_world(local),
            weight: self.albedo,
            pdf_solid_angle: local.z * FRAC_1_PI,
            ..BsdfSample::ABSORBED
        }
    }

    #[inline(always)]
    fn scattered(&self, eval: BsdfEval, weight: f32, throughput: Rgb, radiance: Rgb) -> Rgb {
        throughput * (self.albedo * (eval.pdf_solid_angle * weight)) * radiance
    }
}

/// Vertices with any BSDF.
pub struct GeneralClass<'a> {
    /// The BSDFs of these vertices, the first of which is number `first`.
    pub bsdfs: &'a [Bsdf],
    pub first: usize,
}

/// Any BSDF between a vertex's normals and its viewer.
pub struct GeneralClosure<'a> {
    bsdf: &'a Bsdf,
    wo: Vec3,
    ng: Vec3,
    ns: Vec3,
}

impl<'a> VertexClass for GeneralClass<'a> {
    type Closure = GeneralClosure<'a>;

    #[inline(always)]
    fn closure(&self, v: &Vertices, i: usize) -> GeneralClosure<'a> {
        let bsdf = &self.bsdfs[i - self.first];
        GeneralClosure { bsdf, wo: get(&v.wo, i), ng: get(&v.ng, i), ns: get(&v.ns, i) }
    }
}

impl Closure for GeneralClosure<'_> {
    const OPAQUE: bool = false;
    const BRANCHES: bool = true;

    #[inline]
    fn eval(&self, wi: Vec3) -> BsdfEval {
        let crosses = self.crosses(wi);
        // Most lobes that light sampling can reach reflect.
        let is_possible = if crosses { self.bsdf.scatters_through() } else { wi.dot(self.ng) != 0.0 };
        if !is_possible || self.bsdf.is_specular() {
            return BsdfEval::ZERO;
        }
        let frame = Frame::from_normal(self.ns);
        let (wo, wi) = (frame.to_local(self.wo), frame.to_local(wi));
        // Both normals must agree on which side the light is.
        if crosses && wo.z * wi.z >= 0.0 {
            return BsdfEval::ZERO;
        }
        self.bsdf.eval(wo, wi)
    }

    #[inline]
    fn sample(&self, u: [f32; 3]) -> BsdfSample {
        let frame = Frame::from_normal(self.ns);
        let sample = self.bsdf.sample(frame.to_local(self.wo), u);
        BsdfSample { wi: frame.to_world(sample.wi), ..sample }
    }

    #[inline]
    fn crosses(&self, wi: Vec3) -> bool {
        wi.dot(self.ng) * self.wo.dot(self.ng) < 0.0
    }
}

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
        (EnergyCompensation::On, FresnelModel::Exact) => {
            dispatch(PrepareClosures::<true, true> { wave, range })
        }
        (EnergyCompensation::On, FresnelModel::Schlick) => {
            dispatch(PrepareClosures::<true, false> { wave, range })
        }
        (EnergyCompensation::Off, FresnelModel::Exact) => {
            dispatch(PrepareClosures::<false, true> { wave, range })
        }
        (EnergyCompensation::Off, FresnelModel::Schlick) => {
            dispatch(PrepareClosures::<false, false> { wave, range })
        }
    }
}

struct PrepareClosures<'a, const COMPENSATES: bool, const EXACT: bool> {
    wave: &'a mut Wave,
    range: Range<usize>,
}

impl<const COMPENSATES: bool, const EXACT: bool> Kernel for PrepareClosures<'_, COMPENSATES, EXACT> {
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

/// Points of media.
#[derive(Clone, Copy, Debug)]
pub struct MediumClass;

/// The phase function of Henyey and Greenstein. What the medium scatters of what arrives is part of the path's
/// throughput.
pub struct PhaseClosure {
    wo: Vec3,
    anisotropy: f32,
}

impl VertexClass for MediumClass {
    type Closure = PhaseClosure;

    #[inline(always)]
    fn closure(&self, v: &Vertices, i: usize) -> PhaseClosure {
        PhaseClosure { wo: get(&v.wo, i), anisotropy: v.anisotropy[i] }
    }
}

impl Closure for PhaseClosure {
    const OPAQUE: bool = false;
    const BRANCHES: bool = false;
    const IN_MEDIUM: bool = true;

    #[inline(always)]
    fn eval(&self, wi: Vec3) -> BsdfEval {
        let pdf_solid_angle = henyey_greenstein(self.anisotropy, -self.wo.dot(wi));
        BsdfEval { f_cos: Rgb::ONE * pdf_solid_angle, pdf_solid_angle }
    }

    #[inline(always)]
    fn sample(&self, u: [f32; 3]) -> BsdfSample {
        let wi = sample_henyey_greenstein(self.anisotropy, self.wo, [u[0], u[1]]);
        BsdfSample {
            wi,
            weight: Rgb::ONE,
            pdf_solid_angle: henyey_greenstein(self.anisotropy, -self.wo.dot(wi)),
            ..BsdfSample::ABSORBED
        }
    }
}
