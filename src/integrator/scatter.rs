//! Paths go on: scattering, Russian roulette, the next rays.

use super::metal_rough;
use super::normals::terminator;
use super::surface::Sorted;
use super::wave::{WAVE, Wave, Workspace, get, get_rgb, set, set_rgb};
use super::{Integrator, Purpose};
use crate::bsdf::Bsdf;
use crate::color::Rgb;
use crate::math::{Frame, Ray, Vec3, offset_along};
use crate::sampling::sampler::{Dimensions, SobolPoint};
use crate::sampling::warp;
use crate::simd::{Kernel, dispatch};
use std::f32::consts::FRAC_1_PI;

/// The first bounce after which a path may be ended by chance.
const FIRST_ROULETTE: u32 = 3;

impl Integrator<'_> {
    /// Scatters each path at its vertex and ends some by chance; the rest become the arriving paths of the next bounce.
    pub(super) fn scatter(&self, bounce: u32, sorted: &Sorted, w: &mut Workspace) {
        let dimensions = self.dimensions(bounce, Purpose::Scatter);
        let roulette = bounce >= FIRST_ROULETTE;
        let softens = self.softens_terminator();
        let (wave, count) = (&mut *w.wave, sorted.lambert);
        if softens {
            dispatch(LambertScatter::<true> { wave, count, dimensions: &dimensions, roulette });
        } else {
            dispatch(LambertScatter::<false> { wave, count, dimensions: &dimensions, roulette });
        }
        let range = sorted.lambert..sorted.metal_rough;
        metal_rough::scatter(&mut w.wave, range, &dimensions, roulette, softens);
        let how = Scatter { dimensions: &dimensions, roulette, softens_terminator: softens };
        for i in sorted.metal_rough..sorted.total {
            generic_scatter(&mut w.wave, i, &w.bsdfs[i - sorted.metal_rough], &how);
        }
        let uses_tree = self.scene.lights.use_tree();
        w.rays.clear();
        let Wave { paths, vertices: v } = &*w.wave;
        for i in 0..sorted.total {
            if v.next_pdf[i] >= 0.0 {
                let k = w.rays.len();
                paths.copy_to(i, &mut w.arriving, k);
                w.arriving.pdf[k] = v.next_pdf[i];
                if uses_tree {
                    // No light was chosen at specular vertices.
                    let normal = if i < sorted.lit { get(&paths.receiver_normal, i) } else { Vec3::ZERO };
                    set(&mut w.arriving.receiver_normal, k, normal);
                }
                if self.scene.features.footprints {
                    widen(&mut w.arriving.cone_spread[k], v.next_pdf[i]);
                }
                let ray = Ray::new(get(&v.origin, i), get(&v.direction, i));
                w.rays.push(Ray { origin_primitive: v.departures[i], ..ray });
            }
        }
    }
}

/// A scattered ray stands for a share of the directions that it might have taken: as if this many others filled the
/// rest. After a diffuse bounce it sees a width of a fifth of the distance; after a mirror, what it saw before.
const RAYS_OF_A_LOBE: f32 = 64.0;

#[inline(always)]
fn widen(spread: &mut f32, pdf_solid_angle: f32) {
    if pdf_solid_angle > 0.0 {
        let own = 1.0 / (RAYS_OF_A_LOBE * pdf_solid_angle).sqrt();
        *spread = if own > *spread { own } else { *spread };
    }
}

/// Scatters at Lambertian vertices; with softened shadow terminators or without.
struct LambertScatter<'a, const SOFT: bool> {
    wave: &'a mut Wave,
    count: usize,
    dimensions: &'a Dimensions,
    roulette: bool,
}

impl<const SOFT: bool> Kernel for LambertScatter<'_, SOFT> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v } = self.wave;
        for i in 0..self.count.min(WAVE) {
            let point = SobolPoint::from_parts(paths.seed[i], paths.shuffled[i]);
            let [a, b, _, chance] = point.sample_4d(self.dimensions);
            let (ng, ns) = (get(&v.ng, i), get(&v.ns, i));
            let local = warp::cosine_hemisphere([a, b]);
            let wi = Frame::from_normal(ns).to_world(local);
            let mut throughput = get_rgb(&paths.throughput, i) * get_rgb(&v.albedo, i);
            if SOFT {
                throughput *= terminator(ns, ng, wi);
            }
            let (survives, scale) = survival(throughput, paths.eta_squared[i], chance, self.roulette);
            set_rgb(&mut paths.throughput, i, throughput * scale);
            set(&mut v.origin, i, offset_along(get(&v.p, i), ng, v.offset[i]));
            set(&mut v.direction, i, wi);
            let goes_on = survives & (wi.dot(ng) > 0.0);
            v.next_pdf[i] = if goes_on { local.z * FRAC_1_PI } else { -1.0 };
        }
    }
}

/// Russian roulette by the square root of the throughput (between the two extremes of never ending a path and of making
/// all survivors equally bright, and better than both): does the path go on, and the factor that makes up for those that
/// don't.
#[inline(always)]
pub(super) fn survival(throughput: Rgb, eta_squared: f32, chance: f32, roulette: bool) -> (bool, f32) {
    let brightest = throughput.r.max(throughput.g).max(throughput.b);
    let q = if roulette { (brightest * eta_squared).sqrt() } else { 1.0 };
    let q = if q < 1.0 { q } else { 1.0 };
    ((chance < q) & (brightest > 0.0), 1.0 / if q > 0.0 { q } else { 1.0 })
}

/// How a bounce scatters at all its vertices.
struct Scatter<'a> {
    dimensions: &'a Dimensions,
    roulette: bool,
    softens_terminator: bool,
}

/// Scatters at a vertex with any BSDF.
fn generic_scatter(wave: &mut Wave, i: usize, bsdf: &Bsdf, how: &Scatter<'_>) {
    let Wave { paths, vertices: v } = wave;
    let point = SobolPoint::from_parts(paths.seed[i], paths.shuffled[i]);
    let [a, b, lobe, chance] = point.sample_4d(how.dimensions);
    let (wo, ng, ns) = (get(&v.wo, i), get(&v.ng, i), get(&v.ns, i));
    let frame = Frame::from_normal(ns);
    let s = bsdf.sample(frame.to_local(wo), [a, b, lobe]);
    let wi = frame.to_world(s.wi);
    let side = wi.dot(ng);
    let mut throughput = get_rgb(&paths.throughput, i) * s.weight;
    if how.softens_terminator && !s.is_transmission && !s.is_specular {
        let flip = if side < 0.0 { -1.0 } else { 1.0 };
        throughput *= terminator(ns * flip, ng * flip, wi);
    }
    paths.eta_squared[i] *= s.eta * s.eta;
    if s.is_transmission {
        paths.interior[i] = v.beyond[i];
    }
    let (survives, scale) = survival(throughput, paths.eta_squared[i], chance, how.roulette);
    // A direction that shading normals lead to the wrong side of the surface carries nothing.
    let crosses = side * wo.dot(ng) < 0.0;
    let goes_on = survives && s.pdf_solid_angle > 0.0 && crosses == s.is_transmission && side != 0.0;
    set_rgb(&mut paths.throughput, i, throughput * scale);
    set(&mut v.origin, i, offset_along(get(&v.p, i), if side < 0.0 { -ng } else { ng }, v.offset[i]));
    set(&mut v.direction, i, wi);
    let pdf = if s.is_specular { 0.0 } else { s.pdf_solid_angle };
    v.next_pdf[i] = if goes_on { pdf } else { -1.0 };
}
