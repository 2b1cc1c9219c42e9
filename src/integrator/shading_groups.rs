//! Shading groups: vertices shaded by the same loop, their sort order, and the closures of each group.

use super::shading_geometry::{
    NO_BUMP_SHADOWING, SharpBumps, Soft, SoftBumps, Terminator, TerminatorCorrection, UNMAPPED, bent_normal,
    local_viewer, shadow_diffuse,
};
use super::wave::{
    MetalRoughClosures, MetalRoughMaterials, PerPath, Vertices, WAVE, Wave, get, get_rgb, set, set_rgb,
};
use crate::bsdf::phase::{henyey_greenstein, sample_henyey_greenstein};
use crate::bsdf::{
    Bsdf, BsdfClass, BsdfEval, BsdfSample, DielectricCurve, DirectionalAlbedo, Facets, Isotropic,
    LayerFresnel, MetalRough, MetalRoughClosure, mean_cosine, to_upper_side,
};
use crate::color::Rgb;
use crate::compile::{CompiledMaterial, CompiledScene};
use crate::math::{Frame, Vec3, select};
use crate::sampling::warp;
use crate::scene::{EnergyCompensation, FresnelModel};
use crate::simd::{Kernel, dispatch};
use std::f32::consts::FRAC_1_PI;
use std::ops::Range;

/// Evaluates an expression with the [`VertexClass`] of sorted vertex `i`, guided or not.
macro_rules! with_vertex_class {
    ($sorted:expr, $i:expr, $is_guided:expr, $bsdfs:expr, |$class:ident| $value:expr) => {{
        let (sorted, i) = ($sorted, $i);
        if sorted.lambert().contains(&i) && $is_guided {
            let $class = Guided(LambertClass);
            $value
        } else if sorted.lambert().contains(&i) {
            let $class = LambertClass;
            $value
        } else if sorted.metal_rough().contains(&i) && $is_guided {
            let $class = Guided(MetalRoughClass);
            $value
        } else if sorted.metal_rough().contains(&i) {
            let $class = MetalRoughClass;
            $value
        } else if sorted.medium().contains(&i) {
            let $class = MediumClass;
            $value
        } else {
            let $class = GeneralClass { bsdfs: $bsdfs, first: sorted.rough().start };
            $value
        }
    }};
}
pub(super) use with_vertex_class;

/// The loop that shades a vertex. Vertices are sorted in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ShadingGroup {
    /// Lambertian with constant albedo on a triangle or quad: vertices are built by a vectorised loop.
    FlatLambert,
    /// Other Lambertian vertices.
    Lambert,
    /// Opaque glTF materials without textures on a triangle or quad: vertices are built by a vectorised loop.
    FlatMetalRough,
    /// Opaque glTF materials with textures on triangles: vertices are built by vectorised loops.
    Textured,
    /// Other opaque glTF materials.
    MetalRough,
    /// Scattering events in media.
    Medium,
    /// Other BSDFs that are not specular.
    Rough,
    /// Specular BSDFs, which are not light-sampled.
    Specular,
    /// The path ends.
    None,
}

const GROUPS: usize = 9;

impl ShadingGroup {
    /// The group of the same material on any shape.
    pub fn of_any_shape(self) -> ShadingGroup {
        match self {
            ShadingGroup::FlatLambert => ShadingGroup::Lambert,
            ShadingGroup::FlatMetalRough => ShadingGroup::MetalRough,
            group => group,
        }
    }
}

/// Number of hits of each shading group.
pub struct ShadingGroupCounts([usize; GROUPS]);

impl ShadingGroupCounts {
    /// No hits.
    pub fn new() -> ShadingGroupCounts {
        ShadingGroupCounts([0; GROUPS])
    }

    /// Counts a hit.
    #[inline(always)]
    pub fn add(&mut self, group: ShadingGroup) {
        self.0[group as usize] += 1;
    }

    /// The ranges of the groups in sorted order.
    pub fn sorted(&self) -> SortedVertices {
        let mut sum = 0;
        let starts = self.0.map(|count| {
            sum += count;
            sum - count
        });
        SortedVertices { starts }
    }
}

/// Ranges of the shading groups in the sorted vertices.
#[derive(Clone, Copy, Debug)]
pub struct SortedVertices {
    starts: [usize; GROUPS],
}

impl SortedVertices {
    /// The ranges after each vertex was repeated `times` times.
    pub fn times(mut self, times: usize) -> SortedVertices {
        for start in &mut self.starts {
            *start *= times;
        }
        self
    }

    /// The start of each group.
    pub fn starts(&self) -> [usize; GROUPS] {
        self.starts
    }

    fn from(&self, first: ShadingGroup, behind: ShadingGroup) -> Range<usize> {
        self.starts[first as usize]..self.starts[behind as usize]
    }

    /// [`ShadingGroup::FlatLambert`].
    pub fn flat_lambert(&self) -> Range<usize> {
        self.from(ShadingGroup::FlatLambert, ShadingGroup::Lambert)
    }

    /// All Lambertian groups.
    pub fn lambert(&self) -> Range<usize> {
        self.from(ShadingGroup::FlatLambert, ShadingGroup::FlatMetalRough)
    }

    /// [`ShadingGroup::FlatMetalRough`].
    pub fn flat_metal_rough(&self) -> Range<usize> {
        self.from(ShadingGroup::FlatMetalRough, ShadingGroup::Textured)
    }

    /// [`ShadingGroup::Textured`].
    pub fn textured(&self) -> Range<usize> {
        self.from(ShadingGroup::Textured, ShadingGroup::MetalRough)
    }

    /// All groups of opaque glTF materials.
    pub fn metal_rough(&self) -> Range<usize> {
        self.from(ShadingGroup::FlatMetalRough, ShadingGroup::Medium)
    }

    /// Vertices with path guiding: Lambertian and opaque glTF materials.
    pub fn guided(&self) -> Range<usize> {
        self.from(ShadingGroup::FlatLambert, ShadingGroup::Medium)
    }

    /// [`ShadingGroup::Medium`].
    pub fn medium(&self) -> Range<usize> {
        self.from(ShadingGroup::Medium, ShadingGroup::Rough)
    }

    /// [`ShadingGroup::Rough`].
    pub fn rough(&self) -> Range<usize> {
        self.from(ShadingGroup::Rough, ShadingGroup::Specular)
    }

    /// Vertices with an entry in `Workspace::bsdfs`: rough and specular.
    pub fn general(&self) -> Range<usize> {
        self.from(ShadingGroup::Rough, ShadingGroup::None)
    }

    /// Light-sampled vertices: all but specular ones.
    pub fn lit(&self) -> Range<usize> {
        self.from(ShadingGroup::FlatLambert, ShadingGroup::Specular)
    }

    /// All vertices.
    pub fn all(&self) -> Range<usize> {
        self.from(ShadingGroup::FlatLambert, ShadingGroup::None)
    }
}

/// The shading group of each material; `filters_glossy`: the glossy filter is on.
pub fn groups_of(scene: &CompiledScene, filters_glossy: bool) -> Vec<ShadingGroup> {
    let own = scene.materials.iter().map(|m| group_of(m, scene.shading.spectral));
    let mut groups: Vec<ShadingGroup> = own.collect();
    let is_rough =
        |(group, m): (&ShadingGroup, &CompiledMaterial)| *group == ShadingGroup::Rough && m.medium_index != 0;
    if scene.features.coincident_surfaces && groups.iter().zip(&scene.materials).any(is_rough) {
        // Where a smooth solid coincides with a rough one, the rough surface may refract.
        for (group, material) in groups.iter_mut().zip(&scene.materials) {
            if *group == ShadingGroup::Specular && material.medium_index != 0 {
                *group = ShadingGroup::Rough;
            }
        }
    }
    if filters_glossy {
        // The glossy filter may turn specular BSDFs into rough ones.
        for group in groups.iter_mut().filter(|group| **group == ShadingGroup::Specular) {
            *group = ShadingGroup::Rough;
        }
    }
    groups
}

/// The shading group of a material, on shapes that support all groups.
fn group_of(material: &CompiledMaterial, by_wavelength: bool) -> ShadingGroup {
    let is_constant = material.constant.is_some() && !material.uses_uv && material.emission.is_none();
    match material.class {
        BsdfClass::Black => ShadingGroup::None,
        // Path reuse requires that the other groups don't depend on the viewer or the path.
        BsdfClass::Lambert | BsdfClass::MetalRough if material.depends_on_path() => ShadingGroup::Rough,
        BsdfClass::Lambert => {
            if is_constant {
                ShadingGroup::FlatLambert
            } else {
                ShadingGroup::Lambert
            }
        }
        _ if material.is_smooth_glass() => ShadingGroup::Specular,
        _ => {
            // A smooth surface in air need not be smooth within another solid.
            let stays_smooth = |b: Bsdf| material.medium_index == 0 || b.with_ior(2.0).is_specular();
            let is_specular = material.uniform_bsdf().is_some_and(|b| b.is_specular() && stays_smooth(b));
            match material.class {
                _ if is_specular => ShadingGroup::Specular,
                BsdfClass::MetalRough if by_wavelength && material.constant.is_none() => {
                    ShadingGroup::MetalRough
                }
                // The vectorised texture loops support the most common inputs only.
                BsdfClass::MetalRough
                    if material.uses_uv
                        && material.graphs.is_none()
                        && !material.uses_vertex_colors
                        && !material.reads_hit
                        && material.normal.is_none() =>
                {
                    ShadingGroup::Textured
                }
                BsdfClass::MetalRough if is_constant && material.medium_index == 0 => {
                    ShadingGroup::FlatMetalRough
                }
                BsdfClass::MetalRough => ShadingGroup::MetalRough,
                _ => ShadingGroup::Rough,
            }
        }
    }
}

/// A BSDF or phase function at a vertex, for a given direction to the viewer. All directions are in world space.
pub trait Closure {
    /// All lobes reflect, and normals are on the viewer's side.
    const OPAQUE: bool;

    /// This is a phase function.
    const IN_MEDIUM: bool = false;

    /// All lobes are diffuse.
    const IS_DIFFUSE: bool = false;

    /// Evaluation branches; else it is branch-free, so that loops vectorise.
    const BRANCHES: bool;

    /// Value and pdf for light from `wi`, without specular lobes.
    fn eval(&self, wi: Vec3) -> BsdfEval;

    /// Samples a direction by three random numbers in 0..1; the last selects the lobe.
    fn sample(&self, u: [f32; 3]) -> BsdfSample;

    /// The diffuse part of the value for light from `wi`, if not all lobes are diffuse.
    #[inline(always)]
    fn diffuse(&self, _wi: Vec3) -> Rgb {
        Rgb::ZERO
    }

    /// The normal of the diffuse part, at a vertex with shading normal `ns`.
    #[inline(always)]
    fn base_normal(&self, ns: Vec3) -> Vec3 {
        ns
    }

    /// Applies the bump terminator of vertex `i`: returns value and pdf, and a factor on the value.
    #[inline(always)]
    fn apply_bump_terminator<T: TerminatorCorrection>(
        &self,
        correction: T,
        (v, i): (&Vertices, usize),
        (ns, side): (Vec3, f32),
        (wi, eval): (Vec3, BsdfEval),
    ) -> (BsdfEval, f32) {
        if !T::HAS_BUMPS || Self::IN_MEDIUM {
            return (eval, 1.0);
        }
        let bump_factor = correction.bump_factor(v, i, self.base_normal(ns), side, wi);
        match Self::IS_DIFFUSE {
            true => (eval, bump_factor),
            false if Self::BRANCHES && bump_factor == 1.0 => (eval, 1.0),
            false => {
                (BsdfEval { f_cos: shadow_diffuse(eval.f_cos, self.diffuse(wi), bump_factor), ..eval }, 1.0)
            }
        }
    }

    /// Are `wi` and the viewer on different sides of the surface?
    #[inline(always)]
    fn crosses(&self, _wi: Vec3) -> bool {
        false
    }

    /// Contribution of a light sample: throughput times value times weight times radiance. The order of multiplication, and so the
    /// rounding, differs between closures.
    #[inline(always)]
    fn scattered(&self, eval: BsdfEval, weight: f32, throughput: Rgb, radiance: Rgb) -> Rgb {
        throughput * eval.f_cos * radiance * weight
    }
}

/// Value of a closure at vertex `i` for light from `wi`, and the factor of the shadow terminator: for loops over few vertices.
pub(super) fn eval_with_terminator<C: Closure>(
    closure: &C,
    terminator: Terminator,
    (v, i): (&Vertices, usize),
    wi: Vec3,
) -> (BsdfEval, f32) {
    let eval = closure.eval(wi);
    if C::IN_MEDIUM || closure.crosses(wi) {
        return (eval, 1.0);
    }
    let (ng, ns) = (get(&v.ng, i), get(&v.ns, i));
    let side = if !C::OPAQUE && wi.dot(ng) < 0.0 { -1.0 } else { 1.0 };
    let normals = [ns * side, ng * side];
    match terminator {
        Terminator::Sharp => (eval, 1.0),
        Terminator::Soft => (eval, Soft.light_factor(v, i, normals, side, wi)),
        Terminator::SoftBumps => {
            let (eval, bump_factor) =
                closure.apply_bump_terminator(SoftBumps, (v, i), (ns * side, side), (wi, eval));
            (eval, SoftBumps.light_factor(v, i, normals, side, wi) * bump_factor)
        }
        Terminator::SharpBumps => {
            closure.apply_bump_terminator(SharpBumps, (v, i), (ns * side, side), (wi, eval))
        }
    }
}

/// The weight of a BSDF sample under the bump terminator.
#[inline(always)]
pub(super) fn sample_with_bump_terminator<C: Closure, T: TerminatorCorrection>(
    closure: &C,
    correction: T,
    at: (&Vertices, usize),
    (ns, side): (Vec3, f32),
    sample: &BsdfSample,
) -> Rgb {
    let pdf_solid_angle = sample.pdf_solid_angle;
    let eval = BsdfEval { f_cos: sample.weight * pdf_solid_angle, pdf_solid_angle };
    let (dimmed, bump_factor) = closure.apply_bump_terminator(correction, at, (ns, side), (sample.wi, eval));
    let inverse = 1.0 / if pdf_solid_angle > 0.0 { pdf_solid_angle } else { 1.0 };
    // For purely diffuse closures the factor is `bump_factor`.
    (if C::IS_DIFFUSE { sample.weight } else { dimmed.f_cos * inverse }) * bump_factor
}

/// A class of vertices with the same type of closure.
pub trait VertexClass {
    type Closure: Closure;

    /// The closure of vertex `i`.
    fn closure(&self, v: &Vertices, i: usize) -> Self::Closure;

    /// Factor of guiding on the pdf of the light sample's direction at vertex `i`.
    #[inline(always)]
    fn light_pdf_factor(&self, _v: &Vertices, _i: usize) -> f32 {
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
    const IS_DIFFUSE: bool = true;
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
    /// BSDFs of the vertices from `first` on.
    pub bsdfs: &'a [Bsdf],
    pub first: usize,
}

/// A general BSDF with the vertex's normals and direction to the viewer.
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
        // An early exit, since most BSDFs only reflect.
        let is_possible =
            if crosses { self.bsdf.has_scattered_transmission() } else { wi.dot(self.ng) != 0.0 };
        if !is_possible || self.bsdf.is_specular() {
            return BsdfEval::ZERO;
        }
        let frame = Frame::from_normal(self.ns);
        let (wo, wi) = (local_viewer(&frame, self.wo, self.ng), frame.to_local(wi));
        // The light must be on the same side of both normals.
        if crosses && wo.z * wi.z >= 0.0 {
            return BsdfEval::ZERO;
        }
        self.bsdf.eval(wo, wi)
    }

    #[inline]
    fn sample(&self, u: [f32; 3]) -> BsdfSample {
        let frame = Frame::from_normal(self.ns);
        let sample = self.bsdf.sample(local_viewer(&frame, self.wo, self.ng), u);
        BsdfSample { wi: frame.to_world(sample.wi), ..sample }
    }

    #[inline]
    fn crosses(&self, wi: Vec3) -> bool {
        wi.dot(self.ng) * self.wo.dot(self.ng) < 0.0
    }

    fn diffuse(&self, wi: Vec3) -> Rgb {
        let frame = Frame::from_normal(self.ns);
        self.bsdf.diffuse_part(local_viewer(&frame, self.wo, self.ng), frame.to_local(wi))
    }
}

/// Stores the material of a vertex.
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
    m.compensates[k] = f32::from(u8::from(material.energy_compensation == EnergyCompensation::On));
}

/// Loads the material of a vertex.
#[inline(always)]
pub(super) fn load_material(m: &MetalRoughMaterials, k: usize, fresnel: FresnelModel) -> MetalRough {
    MetalRough {
        diffuse: get_rgb(&m.diffuse, k),
        layer_f0: get_rgb(&m.layer_f0, k),
        layer_f90: m.layer_f90[k],
        layer_fresnel: match fresnel {
            FresnelModel::Schlick => LayerFresnel::Schlick,
            FresnelModel::Exact => LayerFresnel::Exact(DielectricCurve { amplitude: m.curve[k] }),
        },
        metal_f0: get_rgb(&m.metal_f0, k),
        metallic: m.metallic[k],
        surface: Isotropic { alpha: m.alpha[k] },
        energy_compensation: match m.compensates[k] > 0.0 {
            true => EnergyCompensation::On,
            false => EnergyCompensation::Off,
        },
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
        layer_transmittance: 0.0,
        f0: get_rgb(&m.f0, k),
        schlick_rise: get_rgb(&m.schlick_rise, k),
        exact_rise: get_rgb(&m.exact_rise, k),
        curve: DielectricCurve { amplitude: curve },
        albedo: m.albedo[k],
        probability_specular: m.probability_specular[k],
        probability_diffuse: m.probability_diffuse[k],
    }
}

/// Copies the closure of vertex `i` of `from` to vertex `k` of `to`.
#[inline(always)]
pub(super) fn copy_metal_rough(from: &Vertices, i: usize, to: &mut Vertices, k: usize) {
    from.metal_rough_closures.copy_to(i, &mut to.metal_rough_closures, k);
    from.base_normal.copy_to(i, &mut to.base_normal, k);
    to.metal_rough.alpha[k] = from.metal_rough.alpha[i];
    to.metal_rough.curve[k] = from.metal_rough.curve[i];
}

/// Bends shading normals for the viewer and computes the closures of opaque glTF materials.
pub(super) fn prepare(wave: &mut Wave, range: Range<usize>, fresnel: FresnelModel) {
    match fresnel {
        FresnelModel::Exact => dispatch(PrepareClosures::<true> { wave, range }),
        FresnelModel::Schlick => dispatch(PrepareClosures::<false> { wave, range }),
    }
}

struct PrepareClosures<'a, const EXACT: bool> {
    wave: &'a mut Wave,
    range: Range<usize>,
}

impl<const EXACT: bool> Kernel for PrepareClosures<'_, EXACT> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { vertices: v, scratch, .. } = self.wave;
        let [x, y, z, full, grazing, mean_cosines, ..] = scratch;
        let fresnel = if EXACT { FresnelModel::Exact } else { FresnelModel::Schlick };
        let range = self.range.start..self.range.end.min(WAVE);
        // The second loop looks up tables, which does not vectorise.
        for i in range.clone() {
            let (ns, wo) = (get(&v.ns, i), get(&v.wo, i));
            let (bent, is_bent) = bent_normal(ns, get(&v.ng, i), wo);
            v.is_bent[i] = if is_bent { 1.0 } else { 0.0 };
            set(&mut v.base_normal, i, select(v.bump_mode[i] != UNMAPPED, ns, bent));
            let ns = bent;
            set(&mut v.ns, i, ns);
            [x[i], y[i], z[i]] = to_upper_side(Frame::from_normal(ns).to_local(wo)).to_array();
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
            let material = load_material(&v.metal_rough, i, fresnel);
            let layer_grazing = match material.layer_fresnel {
                LayerFresnel::Schlick => albedo.grazing,
                LayerFresnel::Exact(curve) => albedo.full * curve.weight(mean_cosines[i]),
            };
            let closure = material.closure_by(albedo, layer_grazing, wo);
            store_closure(&mut v.metal_rough_closures, i, &closure);
            let is_shadowed = (v.bump_mode[i] == UNMAPPED) | (closure.probability_diffuse > 0.0);
            v.bump_mode[i] = if is_shadowed { v.bump_mode[i] } else { NO_BUMP_SHADOWING };
        }
    }
}

/// Vertices of opaque glTF materials, after [`prepare`].
///
/// Where mapped normals face away from the viewer, glossy lobes are evaluated with a normal bent towards the viewer
/// ([`super::shading_geometry::bent_normal`]); the diffuse base, whose BSDF doesn't depend on the viewer, keeps the mapped normal, as in
/// Cycles 5.0.
#[derive(Clone, Copy)]
pub(super) struct MetalRoughClass;

/// The closure of an opaque glTF material.
pub(super) struct MetalRoughVertex {
    lobes: MetalRoughClosure,
    surface: Isotropic,
    frame: Frame,
    /// Direction to the viewer in the frame, above the surface.
    wo: Vec3,
    /// Normal of the diffuse base.
    base: Vec3,
    /// Is that another normal than the frame's?
    has_own_base: bool,
}

impl VertexClass for MetalRoughClass {
    type Closure = MetalRoughVertex;

    #[inline(always)]
    fn closure(&self, v: &Vertices, i: usize) -> MetalRoughVertex {
        let (ns, base) = (get(&v.ns, i), get(&v.base_normal, i));
        let frame = Frame::from_normal(ns);
        let wo = to_upper_side(frame.to_local(get(&v.wo, i)));
        let surface = Isotropic { alpha: v.metal_rough.alpha[i] };
        MetalRoughVertex {
            lobes: load_closure(&v.metal_rough_closures, v.metal_rough.curve[i], i),
            surface,
            frame,
            wo,
            base,
            has_own_base: (base.x != ns.x) | (base.y != ns.y) | (base.z != ns.z),
        }
    }
}

impl MetalRoughVertex {
    /// Value and pdf for light from `wi`.
    #[inline(always)]
    fn value(&self, wi: Vec3) -> BsdfEval {
        self.lobes.eval_around(&self.surface, self.wo, self.frame.to_local(wi), self.base.dot(wi))
    }

    /// Factor on the pdf of [`Closure::sample`] if guiding multiplies the pdf of the diffuse lobe by `density`.
    #[inline(always)]
    pub fn guided(&self, wi: Vec3, density: f32) -> f32 {
        let pdf = self.value(wi).pdf_solid_angle;
        let diffuse = self.lobes.probability_diffuse * self.base.dot(wi) * FRAC_1_PI;
        if (pdf > 0.0) & (diffuse > 0.0) { 1.0 + (density - 1.0) * (diffuse / pdf) } else { 1.0 }
    }

    /// Does a random number select the diffuse lobe?
    #[inline(always)]
    pub fn is_diffuse(&self, u: f32) -> bool {
        u >= self.lobes.probability_specular
    }

    /// Albedo of the diffuse lobe over its selection probability.
    #[inline(always)]
    pub fn diffuse_weight(&self) -> Rgb {
        let probability = self.lobes.probability_diffuse;
        self.lobes.diffuse * (1.0 / if probability > 0.0 { probability } else { 1.0 })
    }

    /// Diffuse fraction of the BSDF value for light from `wi`.
    #[inline(always)]
    pub fn diffuse_fraction(&self, wi: Vec3) -> Rgb {
        self.diffuse_fraction_of(self.lobes.diffuse * FRAC_1_PI, wi).min(Rgb::ONE)
    }

    /// Fraction of the BSDF value for light from `wi` that a diffuse lobe with BSDF `f` has.
    #[inline(always)]
    pub fn diffuse_fraction_of(&self, f: Rgb, wi: Vec3) -> Rgb {
        let (all, cosine) = (self.value(wi).f_cos, self.base.dot(wi));
        let part = f * if cosine > 0.0 { cosine } else { 0.0 };
        let ratio = |part: f32, all: f32| {
            let ratio = part / if all > 0.0 { all } else { 1.0 };
            if all > 0.0 { ratio } else { 0.0 }
        };
        Rgb::new(ratio(part.r, all.r), ratio(part.g, all.g), ratio(part.b, all.b))
    }
}

impl Closure for MetalRoughVertex {
    const OPAQUE: bool = true;
    const BRANCHES: bool = false;

    #[inline(always)]
    fn eval(&self, wi: Vec3) -> BsdfEval {
        self.value(wi)
    }

    #[inline(always)]
    fn diffuse(&self, wi: Vec3) -> Rgb {
        let cosine = self.base.dot(wi);
        self.lobes.diffuse * (FRAC_1_PI * if cosine > 0.0 { cosine } else { 0.0 })
    }

    #[inline(always)]
    fn sample(&self, u: [f32; 3]) -> BsdfSample {
        let lobe = self.lobes.sample_lobe(&self.surface, self.wo, u);
        let around_base = Frame::from_normal(self.base).to_world(lobe.wi);
        let wi = select(lobe.is_specular, self.frame.to_world(lobe.wi), around_base);
        // Without rounding where both normals are equal.
        let is_local = lobe.is_specular | !self.has_own_base;
        let local = select(is_local, lobe.wi, self.frame.to_local(wi));
        let is_of_base = !lobe.is_specular | !self.has_own_base;
        let base_cosine = if is_of_base { lobe.wi.z } else { self.base.dot(wi) };
        let sample = self.lobes.sample_of(&self.surface, self.wo, &lobe, (local, base_cosine));
        BsdfSample { wi, ..sample }
    }

    #[inline(always)]
    fn base_normal(&self, _ns: Vec3) -> Vec3 {
        self.base
    }

    #[inline(always)]
    fn scattered(&self, eval: BsdfEval, weight: f32, throughput: Rgb, radiance: Rgb) -> Rgb {
        eval.f_cos * (throughput * radiance) * weight
    }
}

/// Scattering events in media.
#[derive(Clone, Copy, Debug)]
pub struct MediumClass;

/// The Henyey-Greenstein phase function. Path throughput includes the single-scattering albedo.
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
