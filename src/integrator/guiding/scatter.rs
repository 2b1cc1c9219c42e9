//! Guided scattering, and adjoint-driven Russian roulette.

use super::super::mis::DirectionPdf;
use super::bin_index;
use super::guide::{Guide, NO_MEAN};
use crate::integrator::Integrator;
use crate::integrator::sampling::{FIRST_ROULETTE, ScatterParams, survival};
use crate::integrator::shading_geometry::TerminatorCorrection;
use crate::integrator::shading_groups::{Closure, MetalRoughClass, VertexClass, sample_with_bump_terminator};
use crate::integrator::wave::{Vertices, WAVE, Wave, get, get_rgb, set, set_rgb};
use crate::math::{Frame, offset_along};
use crate::sampling::warp;
use crate::simd::{Kernel, Table, dispatch};
use std::f32::consts::{FRAC_1_PI, PI};
use std::ops::Range;

/// First bounce with adjoint-driven Russian roulette.
const FIRST_ADJOINT_ROULETTE: u32 = 1;

/// Minimum survival probability.
const MIN_SURVIVAL: f32 = 0.05;

/// Fraction of the reference contribution from which on paths survive with probability 1.
const CERTAIN_SURVIVAL: f32 = 0.5;

/// A vertex class with guiding.
#[derive(Clone, Copy)]
pub(in super::super) struct Guided<C>(pub C);

impl<C: VertexClass> VertexClass for Guided<C> {
    type Closure = C::Closure;

    #[inline(always)]
    fn closure(&self, v: &Vertices, i: usize) -> C::Closure {
        self.0.closure(v, i)
    }

    #[inline(always)]
    fn light_pdf_factor(&self, v: &Vertices, i: usize) -> f32 {
        v.guided.light_pdf_factor[i]
    }
}

impl Integrator<'_> {
    /// Does adjoint-driven Russian roulette apply at a bounce? With path reuse, not within prefixes.
    pub(in super::super) fn uses_adjoint_roulette(&self, bounce: u32) -> bool {
        let first = if self.options.reuse.is_some() { FIRST_ROULETTE } else { FIRST_ADJOINT_ROULETTE };
        bounce >= first
    }
}

/// Scatters at Lambertian vertices.
pub(in super::super) fn scatter<T: TerminatorCorrection>(
    correction: T,
    params: ScatterParams<'_>,
    uses_adjoint_roulette: bool,
    guide: &Guide,
    range: Range<usize>,
    wave: &mut Wave,
) {
    dispatch(SampleLambert { params, guide, range: range.clone(), wave });
    let roulette = AdjointRoulette { min_reference: guide.min_reference, uses_adjoint_roulette };
    dispatch(ScatterLambert { correction, params, roulette, range, wave });
}

/// Scatters at vertices of opaque glTF materials; the diffuse lobe is guided.
pub(in super::super) fn scatter_metal_rough<T: TerminatorCorrection>(
    correction: T,
    params: ScatterParams<'_>,
    uses_adjoint_roulette: bool,
    guide: &Guide,
    range: Range<usize>,
    wave: &mut Wave,
) {
    if range.is_empty() {
        return;
    }
    let roulette = AdjointRoulette { min_reference: guide.min_reference, uses_adjoint_roulette };
    dispatch(SampleMetalRough { params, guide, range: range.clone(), wave });
    dispatch(ScatterMetalRough { correction, params, roulette, densities: guide.densities(), range, wave });
}

/// Adjoint-driven Russian roulette.
#[derive(Clone, Copy)]
struct AdjointRoulette {
    /// Minimum of the reference luminance.
    min_reference: f32,
    /// May paths end? Else only the reference is stored.
    uses_adjoint_roulette: bool,
}

impl AdjointRoulette {
    /// Whether a path of this expected contribution survives, and the factor on throughput if so. Without a known mean of the cell or a
    /// reference, the result is `plain`. `reference` is the expected contribution at the path's first guided vertex, 0 before it.
    #[inline(always)]
    fn survival(
        self,
        expected: f32,
        mean: f32,
        reference: &mut f32,
        chance: f32,
        plain: (bool, f32),
    ) -> (bool, f32) {
        let is_known = mean >= 0.0;
        let is_first = *reference == 0.0;
        let target = if is_first & is_known { expected + self.min_reference } else { *reference };
        *reference = target;
        let has_target = is_known & (target > 0.0);
        let ratio = expected / if has_target { target * CERTAIN_SURVIVAL } else { 1.0 };
        let q = (if ratio < 1.0 { ratio } else { 1.0 }).sqrt();
        let q = if q > MIN_SURVIVAL { q } else { MIN_SURVIVAL };
        let q = if self.uses_adjoint_roulette { q } else { 1.0 };
        let survives = if has_target { chance < q } else { plain.0 };
        (survives, if has_target { 1.0 / q } else { plain.1 })
    }
}

/// Samples points of the unit square by the guide. First four scratch arrays: the point (two), the random number for Russian roulette,
/// the mean of the cell.
struct SampleLambert<'a> {
    params: ScatterParams<'a>,
    guide: &'a Guide,
    range: Range<usize>,
    wave: &'a mut Wave,
}

impl Kernel for SampleLambert<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v, scratch: [us, vs, chances, means, ..] } = self.wave;
        let range = self.range.start..self.range.end.min(WAVE);
        for i in range.clone() {
            let point = paths.state.sobol_point(i);
            [us[i], vs[i], _, chances[i]] = point.sample_4d(self.params.dimensions);
        }
        for i in range {
            let histogram = &self.guide.histograms[v.guided.cell[i] as usize];
            ([us[i], vs[i]], v.guided.pdf_factor[i]) = histogram.sample([us[i], vs[i]]);
            means[i] = histogram.mean;
        }
    }
}

/// Scatters into the directions of the sampled points of the unit square, with Russian roulette.
struct ScatterLambert<'a, T> {
    correction: T,
    params: ScatterParams<'a>,
    roulette: AdjointRoulette,
    range: Range<usize>,
    wave: &'a mut Wave,
}

impl<T: TerminatorCorrection> Kernel for ScatterLambert<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v, scratch: [us, vs, chances, means, ..] } = self.wave;
        let path = &mut paths.state;
        for i in self.range.start..self.range.end.min(WAVE) {
            let (ng, ns) = (get(&v.ng, i), get(&v.ns, i));
            let local = warp::cosine_hemisphere([us[i], vs[i]]);
            let wi = Frame::from_normal(ns).to_world(local);
            let before = get_rgb(&path.throughput, i) * get_rgb(&v.albedo, i);
            let throughput_luminance = before.luminance();
            v.guided.throughput_luminance[i] = throughput_luminance;
            let pdf_factor = v.guided.pdf_factor[i];
            let kept = self.correction.light_factor(v, i, [ns, ng], 1.0, wi)
                * self.correction.bump_factor(v, i, ns, 1.0, wi);
            let throughput = before * (1.0 / pdf_factor) * kept;
            let roulette_scale = path.roulette_scale[i];
            let plain = survival(throughput, roulette_scale, chances[i], self.params.roulette);
            let expected = throughput_luminance * roulette_scale * means[i];
            let (survives, scale) = self.roulette.survival(
                expected,
                means[i],
                &mut paths.roulette_reference[i],
                chances[i],
                plain,
            );
            set_rgb(&mut path.throughput, i, throughput * scale);
            set(&mut v.next_origin, i, offset_along(get(&v.p, i), ng, v.offset[i]));
            set(&mut v.next_direction, i, wi);
            let continues = survives & (throughput_luminance > 0.0) & (wi.dot(ng) > 0.0);
            let pdf = local.z * FRAC_1_PI * pdf_factor * self.params.branches;
            path.pdf[i] = DirectionPdf::after_roulette(pdf, continues);
        }
    }
}

/// As [`SampleLambert`], for opaque glTF materials: only points for the diffuse lobe are guided. Fifth scratch array: the random number
/// for the lobe.
struct SampleMetalRough<'a> {
    params: ScatterParams<'a>,
    guide: &'a Guide,
    range: Range<usize>,
    wave: &'a mut Wave,
}

impl Kernel for SampleMetalRough<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v, scratch: [us, vs, chances, means, lobes, ..] } = self.wave;
        let range = self.range.start..self.range.end.min(WAVE);
        for i in range.clone() {
            let point = paths.state.sobol_point(i);
            [us[i], vs[i], lobes[i], chances[i]] = point.sample_4d(self.params.dimensions);
        }
        for i in range {
            let histogram = &self.guide.histograms[v.guided.cell[i] as usize];
            let ([x, y], _) = histogram.sample([us[i], vs[i]]);
            let is_diffuse = lobes[i] >= v.metal_rough_closures.probability_specular[i];
            us[i] = if is_diffuse { x } else { us[i] };
            vs[i] = if is_diffuse { y } else { vs[i] };
            means[i] = histogram.mean;
        }
    }
}

/// Scatters into the directions of the sampled points and lobes, with Russian roulette.
struct ScatterMetalRough<'a, T> {
    correction: T,
    params: ScatterParams<'a>,
    roulette: AdjointRoulette,
    densities: Table<'a, f32>,
    range: Range<usize>,
    wave: &'a mut Wave,
}

impl<T: TerminatorCorrection> Kernel for ScatterMetalRough<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v, scratch: [us, vs, chances, means, lobes, ..] } = self.wave;
        let path = &mut paths.state;
        for i in self.range.start..self.range.end.min(WAVE) {
            let (ng, ns) = (get(&v.ng, i), get(&v.ns, i));
            let closure = MetalRoughClass.closure(v, i);
            let s = closure.sample([us[i], vs[i], lobes[i]]);
            let base = closure.base_normal(ns);
            let density = self.densities.at(bin_index(v.guided.cell[i], base, s.wi));
            let factor = closure.guided(s.wi, density);
            let factor = if s.is_specular { 1.0 } else { factor };
            v.guided.pdf_factor[i] = factor;
            let before = get_rgb(&path.throughput, i);
            // Ratio of f_cos to the cosine lobe's pdf: relates the contribution to the mean of the cell.
            let over_cosine = s.pdf_solid_angle * PI / s.wi.dot(base);
            v.guided.throughput_luminance[i] = (before * s.weight).luminance() * over_cosine;
            let kept =
                if s.is_specular { 1.0 } else { self.correction.light_factor(v, i, [ns, ng], 1.0, s.wi) };
            let weight = match T::HAS_BUMPS && !s.is_specular {
                true => sample_with_bump_terminator(&closure, self.correction, (v, i), (ns, 1.0), &s),
                false => s.weight,
            };
            let throughput = before * weight * (1.0 / factor) * kept;
            let roulette_scale = path.roulette_scale[i];
            let plain = survival(throughput, roulette_scale, chances[i], self.params.roulette);
            // Glossy lobes may reflect radiance far above the cell's mean.
            let is_diffuse = closure.is_diffuse(lobes[i]);
            let mean = if is_diffuse { means[i] } else { NO_MEAN };
            let expected = (before * closure.diffuse_weight()).luminance() * roulette_scale * mean;
            let mut reference = paths.roulette_reference[i];
            let (survives, scale) = self.roulette.survival(expected, mean, &mut reference, chances[i], plain);
            paths.roulette_reference[i] = if is_diffuse { reference } else { paths.roulette_reference[i] };
            set_rgb(&mut path.throughput, i, throughput * scale);
            set(&mut v.next_origin, i, offset_along(get(&v.p, i), ng, v.offset[i]));
            set(&mut v.next_direction, i, s.wi);
            let continues = survives & (s.pdf_solid_angle > 0.0) & (s.wi.dot(ng) > 0.0);
            let pdf = if s.is_specular { 0.0 } else { s.pdf_solid_angle * factor * self.params.branches };
            path.pdf[i] = DirectionPdf::after_roulette(pdf, continues);
        }
    }
}
