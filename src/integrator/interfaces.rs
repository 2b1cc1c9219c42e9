//! Interfaces of solids: refraction and absorption with nested and coincident dielectrics.
//!
//! Each path has a list of the solids around it ([`Interior`]). The solid of the highest priority absorbs and refracts; among equals
//! the one entered last (Schmidt, Budge 2002, "Simple Nested Dielectrics in Ray Traced Images"). Without priorities, a solid inside
//! another displaces it, two overlapping bodies of the same material act as one, and where a liquid overlaps its glass the interface
//! hit first refracts. Media without a surface add up instead, with each other and with the medium around the scene: see
//! [`super::volumes`].
//!
//! Coincident surfaces, such as a liquid filling its glass: rounding decides which surface a ray hits first, and the continued ray
//! starts behind the other. So hits of solids search for coincident surfaces and treat them as an overlap of zero thickness: the path
//! crosses all of them, refracts once, from the near medium to the far one, and is multiplied by the tints of all solids that begin or
//! end there. The surface of the solid of the higher priority refracts; among equals the denser one, for reciprocity.

use super::Integrator;
use super::interior::Interior;
use super::sampling::RandomChoice;
use super::shading_geometry::{EvaluatedMaterial, HitPoint};
use super::shading_groups::SortedVertices;
use super::wave::{PathState, Paths, Vertices, Wave, get, get_rgb, scale_rgb, set_rgb};
use super::workspace::{SampleTimes, Workspace};
use crate::bsdf::{Bsdf, Dielectric, Refraction};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::CompiledMaterial;
use crate::math::{Ray, Vec3, gamma};
use crate::scene::FresnelModel;

/// The interface of a solid at a hit.
pub(super) struct InterfaceHit {
    /// BSDF with the index of refraction relative to the outer medium.
    pub bsdf: Bsdf,
    /// The outer medium is denser: `bsdf` is to be evaluated with flipped normals.
    pub is_inverted: bool,
    /// Solids on the far side.
    pub far_interior: Interior,
}

/// The BSDF of an index-matched interface: tint only.
pub(super) fn index_matched_interface(tint: Rgb) -> Bsdf {
    let refraction = Refraction::Scales;
    Bsdf::Dielectric(Dielectric {
        ior: 1.0,
        refraction,
        tint,
        fresnel: FresnelModel::Exact,
        is_beckmann: false,
    })
}

impl Integrator<'_> {
    /// Applies absorption along the rays. Rays that escape within an open solid are not absorbed.
    pub(super) fn absorb(&self, w: &mut Workspace) {
        let (paths, times) = (&mut *w.arriving, &w.times);
        for (i, hit) in w.hits.iter().enumerate() {
            let medium = &self.scene.media[usize::from(paths.interior[i].medium())];
            if medium.absorption.is_some() && hit.is_hit() {
                let throughput = get_rgb(&paths.state.throughput, i);
                let transmittance =
                    medium.transmittance_at(hit.t, times.wavelengths(paths.state.radiance_index[i]));
                set_rgb(&mut paths.state.throughput, i, throughput * transmittance);
            }
        }
    }

    /// Applies absorption along the shadow rays to the light samples' contributions.
    pub(super) fn absorb_light_samples(&self, sorted: &SortedVertices, wave: &mut Wave, times: &SampleTimes) {
        let Wave { paths, vertices: v, .. } = wave;
        for i in sorted.lit() {
            if get_rgb(&v.light.contribution, i).max_element() <= 0.0 {
                continue;
            }
            let ray = (get(&v.light.origin, i), get(&v.light.direction, i));
            let end = self.shadow_ray_end(i, &v.light);
            let wavelengths = times.wavelengths(paths.state.radiance_index[i]);
            let transmittance = self.transmittance_between(
                self.interior_towards_light(sorted, paths, v, i),
                ray,
                [0.0, end],
                wavelengths,
            );
            if transmittance != Rgb::ONE {
                scale_rgb(&mut v.light.contribution, i, transmittance);
            }
        }
    }

    /// The solids around vertex `i` on the side of its light sample.
    pub(super) fn interior_towards_light(
        &self,
        sorted: &SortedVertices,
        paths: &Paths,
        v: &Vertices,
        i: usize,
    ) -> Interior {
        if i >= sorted.rough().start {
            let ng = get(&v.ng, i);
            if ng.dot(get(&v.wo, i)) * ng.dot(get(&v.light.wi, i)) < 0.0 {
                return v.far_interior[i];
            }
        }
        paths.interior[i]
    }

    /// Transmittance along a ray (origin, direction) between two ray parameters, within the same solids.
    pub(super) fn transmittance_between(
        &self,
        interior: Interior,
        ray: (Vec3, Vec3),
        span: [f32; 2],
        wavelengths: Option<&Wavelengths>,
    ) -> Rgb {
        let transmittance = self.transmittance_in(interior.medium(), ray, span, wavelengths, 0);
        if self.scene.features.overlaps {
            transmittance * self.overlapping_transmittance(interior, ray, span, wavelengths)
        } else {
            transmittance
        }
    }

    /// Transmittance of one medium; `salt` decorrelates the estimates of overlapping media. Infinite spans in media that only absorb
    /// (open solids) have transmittance 1.
    #[inline]
    pub(super) fn transmittance_in(
        &self,
        medium: u16,
        ray: (Vec3, Vec3),
        span: [f32; 2],
        wavelengths: Option<&Wavelengths>,
        salt: u32,
    ) -> Rgb {
        let medium = &self.scene.media[usize::from(medium)];
        match &medium.scattering {
            Some(scattering) => {
                scattering.at_wavelengths(wavelengths).transmittance_between(ray, span, (salt, wavelengths))
            }
            None if medium.absorption.is_some() && span[1].is_finite() => {
                medium.transmittance_at((span[1] - span[0]) * ray.1.length(), wavelengths)
            }
            None => Rgb::ONE,
        }
    }

    /// A path in air that hits a solid from behind must have started inside: enters the solid and applies absorption.
    pub(super) fn assume_inside(
        &self,
        material: &CompiledMaterial,
        span: f32,
        i: usize,
        paths: &mut Paths,
        wavelengths: Option<&Wavelengths>,
    ) {
        if paths.interior[i] == Interior::AIR {
            let medium = material.medium_index;
            paths.interior[i] = Interior::AIR.enter(medium);
            let transmittance = self.scene.media[usize::from(medium)].transmittance_at(span, wavelengths);
            scale_rgb(&mut paths.state.throughput, i, transmittance);
        }
    }

    /// The solids around a path after it entered one.
    pub(super) fn enter(&self, here: Interior, medium: u16) -> Interior {
        match self.scene.features.priorities {
            true => here.enter_by_priority(medium, &self.scene.media),
            false => here.enter(medium),
        }
    }

    /// The interface at a hit of a solid with this material.
    pub(super) fn interface_hit(
        &self,
        bsdf: Bsdf,
        material: &CompiledMaterial,
        is_back: bool,
        (bounce, i): (u32, usize),
        paths: &mut Paths,
        wavelengths: Option<&Wavelengths>,
    ) -> InterfaceHit {
        let (here, own) = (paths.interior[i], material.medium_index);
        // A body may have different materials where the path enters and exits: then the solid entered last is exited.
        let medium = if is_back && !here.contains(own) { here.medium() } else { own };
        let far_interior = if is_back { here.leave(medium) } else { self.enter(here, medium) };
        let (inner, outer) = if is_back { (here, far_interior) } else { (far_interior, here) };
        let is_displaced = inner.medium() != medium;
        // Within another solid of the same medium there is no interface. Within a displacing solid the interface is index-matched.
        if is_displaced || outer.medium() == medium {
            let is_edge = is_displaced && !outer.contains(medium);
            let tint = if is_edge { bsdf.transmission_tint() } else { Rgb::ONE };
            return InterfaceHit { bsdf: index_matched_interface(tint), is_inverted: false, far_interior };
        }
        let is_outside = outer == Interior::AIR || self.scene.media[usize::from(outer.medium())].is_boundary;
        let is_alone = is_outside && medium == own;
        let (bsdf, is_inverted) =
            self.interface(bsdf, ([medium, outer.medium()], is_alone), (bounce, i), paths, wavelengths);
        InterfaceHit { bsdf, is_inverted, far_interior }
    }

    /// The BSDF of an interface between two media, the inner one first, and whether it is for flipped normals. `is_alone`: the BSDF's
    /// index of refraction is already right, since the outer medium is air.
    pub(super) fn interface(
        &self,
        bsdf: Bsdf,
        ([inner, outer], is_alone): ([u16; 2], bool),
        (bounce, i): (u32, usize),
        paths: &mut Paths,
        wavelengths: Option<&Wavelengths>,
    ) -> (Bsdf, bool) {
        let media = &self.scene.media;
        let (inside, outside) = (&media[usize::from(inner)], &media[usize::from(outer)]);
        let (Some(inner_iors), Some(outer_iors)) =
            (inside.iors_at(wavelengths), outside.iors_at(wavelengths))
        else {
            return (bsdf, false);
        };
        if inside.is_dispersive() || outside.is_dispersive() {
            choose_channel(bounce, i, &mut paths.state);
        } else if is_alone {
            return (bsdf, false);
        }
        let channel = channel_of(get_rgb(&paths.state.throughput, i));
        let ior = inner_iors[channel] / outer_iors[channel];
        if ior >= 1.0 {
            return (bsdf.with_ior(ior), false);
        }
        if bsdf.sides_may_swap() {
            return (bsdf.with_ior(1.0 / ior), true);
        }
        // This BSDF supports no index below 1.
        (bsdf.with_ior(1.0), false)
    }
}

/// Continues the path with a single channel (dispersion), sampled in proportion to its throughput.
fn choose_channel(bounce: u32, i: usize, path: &mut PathState) {
    let throughput = get_rgb(&path.throughput, i).to_array();
    let total: f32 = throughput.iter().sum();
    let mut at = RandomChoice::DispersionChannel.uniform(path, i, bounce) * total;
    let last = (0..3).rev().find(|&c| throughput[c] > 0.0).unwrap_or(0);
    let mut channel = 0;
    while channel < last && at >= throughput[channel] {
        at -= throughput[channel];
        channel += 1;
    }
    let mut single = [0.0; 3];
    single[channel] = total;
    set_rgb(&mut path.throughput, i, Rgb::from_array(single));
}

/// Red or blue if throughput is non-zero only there; else green, the middle of the spectrum.
fn channel_of(throughput: Rgb) -> usize {
    match throughput.to_array().map(|c| c > 0.0) {
        [true, false, false] => 0,
        [false, false, true] => 2,
        _ => 1,
    }
}

/// Maximum number of coincident surfaces besides the hit one.
const MAX: usize = 3;

/// Maximum distance between coincident surfaces, in units of the sum of their rounding error bounds.
const NEAR: f32 = 4.0;

/// Minimum cosine between the normals of coincident surfaces.
const PARALLEL: f32 = 0.9999;

/// Minimum cosine between ray and normal that the length of the search assumes.
const GRAZING: f32 = 0.01;

/// One of several coincident surfaces at a hit.
#[derive(Clone, Copy)]
pub(super) struct CoincidentHit<'a> {
    pub at: HitPoint<'a>,
    pub evaluated: EvaluatedMaterial,
    /// Filter width, metres.
    pub width: f32,
}

/// The coincident surfaces besides the hit one.
pub(super) type CoincidentSurfaces<'a> = [Option<HitPoint<'a>>; MAX];

impl Integrator<'_> {
    /// Finds surfaces of other solids that coincide with the hit one.
    #[inline]
    pub(super) fn coincident_surfaces(&self, ray: &Ray, at: &HitPoint<'_>) -> Option<CoincidentSurfaces<'_>> {
        if self.scene.features.coincident_surfaces { self.find_coincident_surfaces(ray, at) } else { None }
    }

    fn find_coincident_surfaces(&self, ray: &Ray, at: &HitPoint<'_>) -> Option<CoincidentSurfaces<'_>> {
        let mut list = [None; MAX];
        let rounding = |at: &HitPoint<'_>| at.surface.ng.abs().dot(at.surface.p_error);
        // Rounding errors of object-to-world transforms far from the origin.
        let transform_error = (self.scene.anchor.as_vec3() + at.surface.p).abs().max_element() * gamma(4);
        let reach = |own: f32| NEAR * own + transform_error;
        let cosine = at.surface.ng.dot(ray.direction).abs().max(GRAZING);
        let hit = at.hit;
        let mut next = Ray {
            t_min: hit.t.next_down(),
            t_max: hit.t + reach(2.0 * rounding(at)) / cosine,
            origin_primitive: (&hit).into(),
            ..*ray
        };
        let mut count = 0;
        // Several triangles around an edge or a vertex are one crossing, hence more iterations than `MAX`.
        for _ in 0..4 * MAX {
            let hit = self.scene.accel.closest_one_in_time(&next, at.time);
            if !hit.is_hit() || count == MAX {
                break;
            }
            (next.t_min, next.origin_primitive) = (hit.t, (&hit).into());
            let other = self.ray_hit_point(ray, hit, self.scene.geometries.material(&hit), at.time);
            let span = other.surface.p - at.surface.p;
            let is_coincident = other.surface.ng.dot(at.surface.ng).abs() >= PARALLEL
                && span.dot(at.surface.ng).abs() <= reach(rounding(at) + rounding(&other));
            let is_solid = other.material.medium_index != 0 && !other.material.is_boundary;
            let known = || list.iter().flatten().chain([at]);
            let is_known = || known().any(|k| is_same_crossing(k, &other));
            if is_coincident && is_solid && !is_known() {
                list[count] = Some(other);
                count += 1;
            }
        }
        (count > 0).then_some(list)
    }

    /// The combined interface of coincident surfaces: the refracting surface, its position error enlarged to include all others.
    pub(super) fn coincident_interface<'a>(
        &'a self,
        first: CoincidentHit<'a>,
        coincident: CoincidentSurfaces<'a>,
        wo: Vec3,
        (bounce, i): (u32, usize),
        paths: &mut Paths,
        wavelengths: Option<&Wavelengths>,
    ) -> (CoincidentHit<'a>, InterfaceHit) {
        let width = first.width;
        let others = coincident.iter().flatten().map(|at| {
            let evaluated = self.read_material(at, width, wo, wavelengths);
            CoincidentHit { at: *at, evaluated, width }
        });
        let all = || std::iter::once(first).chain(others.clone());
        if let Some(exited) = all().find(|candidate| candidate.at.is_back) {
            self.assume_inside(exited.at.material, first.at.hit.t, i, paths, wavelengths);
        }
        let here = paths.interior[i];
        let mut far_interior = here;
        for own in
            all().filter(|candidate| candidate.at.is_back).map(|candidate| candidate.at.material.medium_index)
        {
            far_interior =
                far_interior.leave(if far_interior.contains(own) { own } else { far_interior.medium() });
        }
        for entered in all().filter(|candidate| !candidate.at.is_back) {
            far_interior = self.enter(far_interior, entered.at.material.medium_index);
        }
        let (near, far) = (here.medium(), far_interior.medium());
        let is_interface = |candidate: &CoincidentHit<'_>| {
            near != far && candidate.at.material.medium_index == if candidate.at.is_back { near } else { far }
        };
        let best = all()
            .filter(is_interface)
            .reduce(|a, b| if self.rank(b.at.material) > self.rank(a.at.material) { b } else { a });
        // Tints of solids that begin or end here, except the refracting one.
        let refracting = best.map(|candidate| candidate.at.material.medium_index);
        let is_edge = |medium: u16| here.contains(medium) != far_interior.contains(medium);
        let tint = all()
            .filter(|candidate| Some(candidate.at.material.medium_index) != refracting)
            .filter(|candidate| is_edge(candidate.at.material.medium_index))
            .fold(Rgb::ONE, |tint, candidate| tint * candidate.evaluated.bsdf.transmission_tint());
        let mut candidate = best.unwrap_or(first);
        for other in all() {
            let span = (other.at.surface.p - candidate.at.surface.p).abs();
            candidate.at.surface.p_error = candidate.at.surface.p_error.max(span + other.at.surface.p_error);
        }
        let Some(best) = best else {
            return (
                candidate,
                InterfaceHit { bsdf: index_matched_interface(tint), is_inverted: false, far_interior },
            );
        };
        let sides = if best.at.is_back { [near, far] } else { [far, near] };
        let (bsdf, is_inverted) =
            self.interface(best.evaluated.bsdf, (sides, false), (bounce, i), paths, wavelengths);
        let bsdf = if tint == Rgb::ONE { bsdf } else { bsdf.tinted(tint) };
        (candidate, InterfaceHit { bsdf, is_inverted, far_interior })
    }

    /// Rank of a solid among coincident ones; the highest refracts: priority, index of refraction, then medium index.
    fn rank(&self, material: &CompiledMaterial) -> (i32, f32, u16) {
        let medium = &self.scene.media[usize::from(material.medium_index)];
        let ior = medium.iors.map_or(f32::INFINITY, |[_, green, _]| green);
        (medium.priority, ior, material.medium_index)
    }
}

/// Are two hits the same crossing of the same solid?
fn is_same_crossing(a: &HitPoint<'_>, b: &HitPoint<'_>) -> bool {
    a.material.medium_index == b.material.medium_index && a.is_back == b.is_back
}
