//! Surfaces of solids: refraction and absorption among nested and coincident dielectrics.
//!
//! Each path has a list of the solids that it is within ([`Interior`]). The solid of the highest priority absorbs and refracts;
//! among equals the one entered last (Schmidt, Budge 2002, "Simple Nested Dielectrics in Ray Traced Images"). So, without
//! priorities, a solid inside another displaces it, two overlapping bodies of one material are one, and where a liquid overlaps
//! its glass the interface that is hit first counts. Media without a surface add up instead, with each other and with the
//! medium around the scene: see [`super::volumes`].
//!
//! Coincident surfaces: where the surface of one solid lies on that of another, as that of a liquid on its glass, rounding
//! decides which one a ray hits first, and a path that continues from there starts behind the other. So coincident surfaces are
//! searched for where a solid is hit, and treated as an overlap of zero thickness: all of them are crossed, light is refracted
//! once, from the near medium to the far one, and multiplied by the tints of all whose edges these are. The surface of the
//! solid of the higher priority refracts; among equals that of the denser one, so that the result is reciprocal.

use super::Integrator;
use super::interior::Interior;
use super::shading_geometry::HitPoint;
use super::shading_groups::SortedVertices;
use super::wave::{PathState, Paths, Vertices, Wave, get, get_rgb, set_rgb};
use super::workspace::{SampleTimes, Workspace};
use crate::bsdf::{Bsdf, Dielectric, Refraction};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::CompiledMaterial;
use crate::math::{Ray, Vec3, gamma};
use crate::sampling::hash::{hash32, unit};
use crate::scene::FresnelModel;

/// The surface of a solid where a path arrives.
pub(super) struct InterfaceHit {
    /// How it scatters, with the index of refraction relative to what is on the outer side.
    pub bsdf: Bsdf,
    /// Its outer side is the denser one: `bsdf` is for the surface turned around.
    pub is_inverted: bool,
    /// The solids on its other side.
    pub beyond: Interior,
}

/// A surface that isn't there, but for the colour that it gives to light.
pub(super) fn hidden(tint: Rgb) -> Bsdf {
    let refraction = Refraction::Scales;
    Bsdf::Dielectric(Dielectric { ior: 1.0, refraction, tint, fresnel: FresnelModel::Exact })
}

impl Integrator<'_> {
    /// Applies absorption to the ways to the hits. What ends nowhere in a solid was not closed, and absorbs nothing.
    pub(super) fn absorb(&self, w: &mut Workspace) {
        let (paths, times) = (&mut *w.arriving, &w.times);
        for (i, hit) in w.hits.iter().enumerate() {
            let medium = &self.scene.media[usize::from(paths.interior[i].medium())];
            if medium.absorption.is_some() && hit.is_hit() {
                let throughput = get_rgb(&paths.carried.throughput, i);
                let left = medium.transmittance_at(hit.t, times.waves(paths.carried.sample[i]));
                set_rgb(&mut paths.carried.throughput, i, throughput * left);
            }
        }
    }

    /// Applies absorption to the ways from vertices to the lights that were sampled.
    pub(super) fn absorb_light_samples(&self, sorted: &SortedVertices, wave: &mut Wave, times: &SampleTimes) {
        let Wave { paths, vertices: v, .. } = wave;
        for i in sorted.lit() {
            if get_rgb(&v.light.contribution, i).max_element() <= 0.0 {
                continue;
            }
            let ray = (get(&v.light.origin, i), get(&v.light.direction, i));
            let end = if v.light.is_infinite[i] > 0.0 { f32::INFINITY } else { 1.0 };
            let waves = times.waves(paths.carried.sample[i]);
            let left = self.transmittance_between(
                self.interior_towards_light(sorted, paths, v, i),
                ray,
                [0.0, end],
                waves,
            );
            if left != Rgb::ONE {
                let contribution = get_rgb(&v.light.contribution, i);
                set_rgb(&mut v.light.contribution, i, contribution * left);
            }
        }
    }

    /// The solids that the light sample of vertex `i` comes through.
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
                return v.beyond[i];
            }
        }
        paths.interior[i]
    }

    /// What is left of light on a ray between two of its points, within the same solids.
    pub(super) fn transmittance_between(
        &self,
        interior: Interior,
        ray: (Vec3, Vec3),
        way: [f32; 2],
        waves: Option<&Wavelengths>,
    ) -> Rgb {
        let left = self.transmittance_in(interior.medium(), ray, way, waves, 0);
        if self.scene.features.overlaps {
            left * self.overlapping_transmittance(interior, ray, way, waves)
        } else {
            left
        }
    }

    /// The same of one medium; `apart` keeps estimates of several apart. What ends nowhere in a solid was not closed, and absorbs
    /// nothing.
    #[inline]
    pub(super) fn transmittance_in(
        &self,
        medium: u16,
        ray: (Vec3, Vec3),
        way: [f32; 2],
        waves: Option<&Wavelengths>,
        apart: u32,
    ) -> Rgb {
        let medium = &self.scene.media[usize::from(medium)];
        match &medium.scattering {
            Some(scattering) => scattering.in_lanes(waves).transmittance_between(ray, way, apart),
            None if medium.absorption.is_some() && way[1].is_finite() => {
                medium.transmittance_at((way[1] - way[0]) * ray.1.length(), waves)
            }
            None => Rgb::ONE,
        }
    }

    /// A path that knows of no solid hits one from behind: it must have been inside, and absorption applies.
    pub(super) fn assume_inside(
        &self,
        material: &CompiledMaterial,
        way: f32,
        i: usize,
        paths: &mut Paths,
        waves: Option<&Wavelengths>,
    ) {
        if paths.interior[i] == Interior::AIR {
            let medium = material.medium_index;
            paths.interior[i] = Interior::AIR.entered(medium);
            let left = self.scene.media[usize::from(medium)].transmittance_at(way, waves);
            let throughput = get_rgb(&paths.carried.throughput, i);
            set_rgb(&mut paths.carried.throughput, i, throughput * left);
        }
    }

    /// What a path is inside of after entering a solid.
    pub(super) fn entered(&self, here: Interior, medium: u16) -> Interior {
        match self.scene.features.priorities {
            true => here.entered_by_priority(medium, &self.scene.media),
            false => here.entered(medium),
        }
    }

    /// What a path finds at the surface of a solid of this material.
    pub(super) fn boundary(
        &self,
        bsdf: Bsdf,
        material: &CompiledMaterial,
        is_back: bool,
        (bounce, i): (u32, usize),
        paths: &mut Paths,
        waves: Option<&Wavelengths>,
    ) -> InterfaceHit {
        let (here, own) = (paths.interior[i], material.medium_index);
        // A body may have several materials, one where it is entered and another where it is left: then what was entered
        // last is left.
        let medium = if is_back && !here.contains(own) { here.medium() } else { own };
        let beyond = if is_back { here.left(medium) } else { self.entered(here, medium) };
        let (inner, outer) = if is_back { (here, beyond) } else { (beyond, here) };
        let is_displaced = inner.medium() != medium;
        // Within other solids of the same medium nothing is there. Within one that displaces it a solid begins and ends unseen,
        // but its colour is that of the light that has been in it.
        if is_displaced || outer.medium() == medium {
            let is_edge = is_displaced && !outer.contains(medium);
            let tint = if is_edge { bsdf.crossing_tint() } else { Rgb::ONE };
            return InterfaceHit { bsdf: hidden(tint), is_inverted: false, beyond };
        }
        let is_alone = outer == Interior::AIR && medium == own;
        let (bsdf, is_inverted) =
            self.interface(bsdf, ([medium, outer.medium()], is_alone), (bounce, i), paths, waves);
        InterfaceHit { bsdf, is_inverted, beyond }
    }

    /// What a surface between two media scatters, the inner one first, and whether that is for the surface turned around. Where
    /// nothing but air is outside of a solid, its own BSDF knows the index already.
    pub(super) fn interface(
        &self,
        bsdf: Bsdf,
        ([inner, outer], is_alone): ([u16; 2], bool),
        (bounce, i): (u32, usize),
        paths: &mut Paths,
        waves: Option<&Wavelengths>,
    ) -> (Bsdf, bool) {
        let media = &self.scene.media;
        let (inside, outside) = (&media[usize::from(inner)], &media[usize::from(outer)]);
        let (Some(inner_iors), Some(outer_iors)) = (inside.iors_at(waves), outside.iors_at(waves)) else {
            return (bsdf, false);
        };
        if inside.is_dispersive() || outside.is_dispersive() {
            choose_channel(bounce, i, &mut paths.carried);
        } else if is_alone {
            return (bsdf, false);
        }
        let channel = channel_of(get_rgb(&paths.carried.throughput, i));
        let ior = inner_iors[channel] / outer_iors[channel];
        if ior >= 1.0 {
            return (bsdf.with_ior(ior), false);
        }
        if bsdf.turns_over() {
            return (bsdf.with_ior(1.0 / ior), true);
        }
        // Its glass takes the nearest index that it can have.
        (bsdf.with_ior(1.0), false)
    }
}

/// The path goes on with one channel, chosen by its throughput.
fn choose_channel(bounce: u32, i: usize, path: &mut PathState) {
    let throughput = get_rgb(&path.throughput, i).to_array();
    let total: f32 = throughput.iter().sum();
    let salt = hash32(path.seed[i] ^ hash32(path.shuffled[i]).rotate_left(7) ^ (bounce << 20));
    let mut at = unit(hash32(salt)) * total;
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

/// The channel of a path that carries one; green, the middle of the spectrum, of others.
fn channel_of(throughput: Rgb) -> usize {
    match throughput.to_array().map(|c| c > 0.0) {
        [true, false, false] => 0,
        [false, false, true] => 2,
        _ => 1,
    }
}

/// Surfaces in one place, beside the one that was hit.
const MOST: usize = 3;

/// How far apart surfaces in one place may be, in bounds on the rounding of both together.
const NEAR: f32 = 4.0;

/// Cosine between the normals of surfaces that lie on each other.
const PARALLEL: f32 = 0.9999;

/// Least cosine of a ray with a surface for which others are looked for as far along the ray as they may be.
const GRAZING: f32 = 0.01;

/// The surface of a solid that a path meets.
#[derive(Clone, Copy)]
pub(super) struct CoincidentHit<'a> {
    pub at: HitPoint<'a>,
    pub bsdf: Bsdf,
    /// Shading normal.
    pub ns: Vec3,
    /// What the path covers there.
    pub width: f32,
}

/// The surfaces that touch one.
pub(super) type CoincidentSurfaces<'a> = [Option<HitPoint<'a>>; MOST];

impl Integrator<'_> {
    /// The surfaces of other solids that lie on the one that a ray hit, if there are any.
    #[inline]
    pub(super) fn touching(&self, ray: &Ray, at: &HitPoint<'_>) -> Option<CoincidentSurfaces<'_>> {
        if self.scene.features.coincident_surfaces { self.find_coincident_surfaces(ray, at) } else { None }
    }

    fn find_coincident_surfaces(&self, ray: &Ray, at: &HitPoint<'_>) -> Option<CoincidentSurfaces<'_>> {
        let mut list = [None; MOST];
        let rounding = |at: &HitPoint<'_>| at.surface.ng.abs().dot(at.surface.p_error);
        // Objects are placed in the world, whose origin may be far away.
        let place = (self.scene.anchor.as_vec3() + at.surface.p).abs().max_element() * gamma(4);
        let reach = |own: f32| NEAR * own + place;
        let cosine = at.surface.ng.dot(ray.direction).abs().max(GRAZING);
        let hit = at.hit;
        let mut next = Ray {
            t_min: hit.t.next_down(),
            t_max: hit.t + reach(2.0 * rounding(at)) / cosine,
            origin_primitive: (&hit).into(),
            ..*ray
        };
        let mut count = 0;
        // The triangles around an edge or a corner count once, and may be many.
        for _ in 0..4 * MOST {
            let hit = self.scene.accel.closest_one_in_time(&next, at.time);
            if !hit.is_hit() || count == MOST {
                break;
            }
            (next.t_min, next.origin_primitive) = (hit.t, (&hit).into());
            let other = self.point_of(ray, hit, self.scene.geometries.material(&hit), at.time);
            let way = other.surface.p - at.surface.p;
            let lies_there = other.surface.ng.dot(at.surface.ng).abs() >= PARALLEL
                && way.dot(at.surface.ng).abs() <= reach(rounding(at) + rounding(&other));
            let is_solid = other.material.medium_index != 0 && !other.material.is_boundary;
            let known = || list.iter().flatten().chain([at]);
            let is_known = || known().any(|k| is_same_crossing(k, &other));
            if lies_there && is_solid && !is_known() {
                list[count] = Some(other);
                count += 1;
            }
        }
        (count > 0).then_some(list)
    }

    /// What a path finds where the surfaces of several solids lie on each other, as one surface: the one that counts, with all
    /// of them within its error.
    pub(super) fn coincident_interface<'a>(
        &'a self,
        first: CoincidentHit<'a>,
        touching: CoincidentSurfaces<'a>,
        wo: Vec3,
        (bounce, i): (u32, usize),
        paths: &mut Paths,
        waves: Option<&Wavelengths>,
    ) -> (CoincidentHit<'a>, InterfaceHit) {
        let width = first.width;
        let others = touching.iter().flatten().map(|at| {
            let (bsdf, ns) = self.read_material(at, width, wo, waves);
            CoincidentHit { at: *at, bsdf, ns, width }
        });
        let all = || std::iter::once(first).chain(others.clone());
        if let Some(left) = all().find(|met| met.at.is_back) {
            self.assume_inside(left.at.material, first.at.hit.t, i, paths, waves);
        }
        let here = paths.interior[i];
        let mut beyond = here;
        for own in all().filter(|met| met.at.is_back).map(|met| met.at.material.medium_index) {
            beyond = beyond.left(if beyond.contains(own) { own } else { beyond.medium() });
        }
        for entered in all().filter(|met| !met.at.is_back) {
            beyond = self.entered(beyond, entered.at.material.medium_index);
        }
        let (near, far) = (here.medium(), beyond.medium());
        let counts = |met: &CoincidentHit<'_>| {
            near != far && met.at.material.medium_index == if met.at.is_back { near } else { far }
        };
        let best = all()
            .filter(counts)
            .reduce(|a, b| if self.rank(b.at.material) > self.rank(a.at.material) { b } else { a });
        // Those that end or begin here, unless the surface that counts is theirs.
        let counted = best.map(|met| met.at.material.medium_index);
        let is_edge = |medium: u16| here.contains(medium) != beyond.contains(medium);
        let tint = all()
            .filter(|met| Some(met.at.material.medium_index) != counted)
            .filter(|met| is_edge(met.at.material.medium_index))
            .fold(Rgb::ONE, |tint, met| tint * met.bsdf.crossing_tint());
        let mut met = best.unwrap_or(first);
        for other in all() {
            let way = (other.at.surface.p - met.at.surface.p).abs();
            met.at.surface.p_error = met.at.surface.p_error.max(way + other.at.surface.p_error);
        }
        let Some(best) = best else {
            return (met, InterfaceHit { bsdf: hidden(tint), is_inverted: false, beyond });
        };
        let sides = if best.at.is_back { [near, far] } else { [far, near] };
        let (bsdf, is_inverted) = self.interface(best.bsdf, (sides, false), (bounce, i), paths, waves);
        let bsdf = if tint == Rgb::ONE { bsdf } else { bsdf.tinted(tint) };
        (met, InterfaceHit { bsdf, is_inverted, beyond })
    }

    /// Which of two solids that touch has the surface that counts: the one of the higher rank.
    fn rank(&self, material: &CompiledMaterial) -> (i32, f32, u16) {
        let medium = &self.scene.media[usize::from(material.medium_index)];
        let ior = medium.iors.map_or(f32::INFINITY, |[_, green, _]| green);
        (medium.priority, ior, material.medium_index)
    }
}

/// Do two points lie on the surface of one body, which is crossed once there?
fn is_same_crossing(a: &HitPoint<'_>, b: &HitPoint<'_>) -> bool {
    a.material.medium_index == b.material.medium_index && a.is_back == b.is_back
}
