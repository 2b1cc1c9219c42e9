//! Participating media: path segments, shadow rays and crossings of boundaries without a surface, one medium or several.
//!
//! The distance to the next scattering event is drawn before the ray is traced, and the ray ends there. A boundary without a
//! surface ends a segment and begins another; the path keeps its origin and its pdf, so that lights behind are weighted as any
//! others.
//!
//! Overlapping media add up: those without a surface, and the medium around the scene. A distance is drawn in each of them
//! independently, and the path scatters at the shortest: denser media win more often. The throughput is multiplied by the
//! weights of all segments: scattering in one medium, passing the others. This is unbiased, since the mean of each factor is
//! the transmittance of its medium, whatever the others are, coloured or on grids. Emission of one medium is attenuated by the
//! others likewise, point by point.

use super::interior::Interior;
use super::medium_segment::{BoundaryCrossing, MediumSegment, ShadowSegment};
use super::radiance_buffer::{PathClass, RadianceOrigin, class_of_path};
use super::shading_groups::{ShadingGroup, ShadingGroupCounts, SortedVertices};
use super::wave::{LightLanes, Wave, get_rgb, set, set_rgb};
use super::workspace::Workspace;
use super::{Integrator, Purpose};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::Scattering;
use crate::light::Receiver;
use crate::math::{Hit, Ray, Vec3};
use crate::sampling::hash::{hash32, unit};
use crate::sampling::sampler::SobolPoint;

/// Keeps choices apart from others with the same salt.
const GLOW: u32 = 0x3c6e_f372;
const BOUNDARY: u32 = 0x1f83_d9ab;

impl Integrator<'_> {
    /// Draws how far each path flies through the medium that it is in, and lets its ray end there.
    pub(super) fn start_medium_segments(&self, bounce: u32, w: &mut Workspace) {
        let dimensions = &self.dimensions(bounce, Purpose::MediumSegment);
        let Workspace { medium_segments, overlapping_segments, rays, arriving, times, .. } = w;
        medium_segments.clear();
        overlapping_segments.clear();
        for (i, ray) in rays.iter_mut().enumerate() {
            let interior = arriving.interior[i];
            let medium = interior.medium();
            let scatters = self.scene.media[usize::from(medium)].scattering.is_some();
            if !scatters && !self.has_overlapping_media(interior) {
                medium_segments.push(MediumSegment::straight(medium, [0.0, f32::INFINITY]));
                continue;
            }
            let path = &arriving.carried;
            let point = SobolPoint::from_parts(path.seed[i], path.shuffled[i]);
            let [distance, kind, lamp0, lamp1] = point.sample_4d(dimensions);
            let lamp = self.equiangular_light(medium, ray.origin, [lamp0, lamp1]);
            let throughput = get_rgb(&path.throughput, i);
            let waves = times.waves(path.sample[i]);
            let carried = (interior, waves);
            let segment = self.sample_segment(
                carried,
                (ray, 0.0),
                throughput,
                lamp,
                [distance, kind],
                overlapping_segments,
            );
            // Where cameras see surfaces up to a distance only, rays end there; what scatters beyond is seen.
            ray.t_max = segment.until.min(ray.t_max);
            medium_segments.push(segment);
        }
    }

    /// The lamp that guides a flight. Within solids there is none: what bounds them hides lamps.
    fn equiangular_light(&self, medium: u16, origin: Vec3, u: [f32; 2]) -> Option<Vec3> {
        let lights = &self.scene.lights;
        if medium != 0 || lights.is_empty() {
            return None;
        }
        let selected = lights.select(0, &Receiver { p: origin, normal: Vec3::ZERO }, u);
        if selected.pdf_discrete > 0.0 { lights.middle(selected.index) } else { None }
    }

    /// Ends all flights: where a surface was hit, where the path scatters, or nowhere. Weighs the paths by it and adds what
    /// media emit.
    pub(super) fn end_medium_segments(&self, bounce: u32, w: &mut Workspace) {
        for i in 0..w.rays.len() {
            let hit = w.hits[i];
            let mut weight = self.passed(bounce, i, hit.t, w);
            let time = w.times.of(w.arriving.carried.sample[i]);
            let segment = &w.medium_segments[i];
            if let Some(crossed) = segment.crossed.filter(|c| self.bounds_at(c, &w.rays[i], (&hit, time))) {
                w.arriving.interior[i] = crossed.before;
            }
            if !hit.is_hit() && segment.until.is_finite() {
                let medium = &self.scene.media[usize::from(segment.medium)];
                let waves = w.times.waves(w.arriving.carried.sample[i]);
                let weigh = |s: &Scattering| segment.weight_of_scattering(&s.in_lanes(waves));
                weight = medium.scattering.as_ref().map_or(Rgb::ZERO, weigh);
                if !segment.is_alone() {
                    weight *= self.overlapping_passing_weight(i, segment.until, w);
                }
                w.hits[i].t = segment.until;
                w.medium_segments[i].scatters = true;
            }
            let throughput = get_rgb(&w.arriving.carried.throughput, i);
            set_rgb(&mut w.arriving.carried.throughput, i, throughput * weight);
        }
    }

    /// Does a surface lie where a boundary without one was crossed, nearer than the offset of rays that start there? They
    /// will not cross it back: the surface is on the boundary's near side then.
    fn bounds_at(&self, crossed: &BoundaryCrossing, ray: &Ray, (hit, time): (&Hit, f32)) -> bool {
        /// Farther apart, in proportion, nothing is near by rounding.
        const NEAR: f32 = 1e-3;
        let way = hit.t - crossed.at;
        if !hit.is_hit() || way > NEAR * hit.t {
            return false;
        }
        let surface = self.scene.geometries.surface(ray, hit, time);
        way * ray.direction.dot(surface.ng).abs() <= surface.ng.abs().dot(surface.p_error)
    }

    /// The weight of path `i` where it arrives at a point of its flight without having scattered. Adds what media emit on the
    /// way.
    pub(super) fn passed(&self, bounce: u32, i: usize, to: f32, w: &mut Workspace) -> Rgb {
        if !w.medium_segments[i].is_alone() {
            return self.pass_overlapping_media(bounce, i, to, w);
        }
        let segment = &w.medium_segments[i];
        let medium = &self.scene.media[usize::from(segment.medium)];
        if let Some(scattering) = &medium.scattering
            && scattering.emission.max_element() > 0.0
        {
            let scattering = &scattering.in_lanes(w.times.waves(w.arriving.carried.sample[i]));
            let salt = self.emission_salt(bounce, i, w) ^ GLOW;
            let value = self.glow(segment, scattering, i, to, salt, w);
            self.add_medium_emission(bounce, i, value, w);
        }
        self.weight_of_passing(&w.medium_segments[i], i, to, w)
    }

    /// What path `i` is taken times by one of its flights at a point of its ray, where it arrives without having scattered. What ends
    /// nowhere in a solid was not closed, and absorbs nothing.
    #[inline(always)]
    pub(super) fn weight_of_passing(&self, segment: &MediumSegment, i: usize, to: f32, w: &Workspace) -> Rgb {
        let medium = &self.scene.media[usize::from(segment.medium)];
        let waves = w.times.waves(w.arriving.carried.sample[i]);
        match &medium.scattering {
            Some(scattering) => segment.weight_of_passing(&scattering.in_lanes(waves), &w.rays[i], to),
            None if medium.absorption.is_some() && to.is_finite() => {
                medium.transmittance_at(to - segment.extent[0], waves)
            }
            None => Rgb::ONE,
        }
    }

    /// What the choices follow by which path `i` finds what shines on its way.
    #[inline]
    pub(super) fn emission_salt(&self, bounce: u32, i: usize, w: &Workspace) -> u32 {
        let path = &w.arriving.carried;
        hash32(path.seed[i] ^ hash32(path.shuffled[i]) ^ (bounce << 16))
    }

    /// What the medium of a flight adds to path `i` on its way to a point.
    pub(super) fn glow(
        &self,
        segment: &MediumSegment,
        scattering: &Scattering,
        i: usize,
        to: f32,
        salt: u32,
        w: &Workspace,
    ) -> Rgb {
        let path = &w.arriving.carried;
        let (throughput, waves) = (get_rgb(&path.throughput, i), w.times.waves(path.sample[i]));
        let ray = (w.rays[i].origin, w.rays[i].direction);
        // Where light would collide, the way ends: what lies before it shines whole.
        let way = [segment.extent[0], to.min(segment.until)];
        match (&scattering.glow, &scattering.grid) {
            (Some(glow), Some(_)) => throughput * scattering.emission * glow.integral(ray, way, salt, waves),
            (None, Some(grid)) => {
                let ray = grid.ray(ray.0, ray.1, 1.0);
                throughput * scattering.emission * grid.integral(&ray, way[0], way[1], salt)
            }
            (_, None) => segment.glow(scattering, throughput, to, unit(hash32(salt ^ to.to_bits()))),
        }
    }

    /// Adds light of a medium to what path `i` has found.
    pub(super) fn add_medium_emission(&self, bounce: u32, i: usize, value: Rgb, w: &mut Workspace) {
        let first_bounces = &w.arriving.first_bounces;
        w.sink.contribute(w.arriving.carried.sample[i], value, || RadianceOrigin {
            way: class_of_path(bounce, PathClass::Emission, first_bounces, i),
            group: 0,
        });
    }

    /// What arriving path `i` is taken times at a point of its ray, which it reached.
    pub(super) fn transmittance_to_hit(&self, i: usize, to: f32, w: &Workspace) -> Rgb {
        if self.scene.features.scattering {
            return self.weight_of_passing(&w.medium_segments[i], i, to, w)
                * self.overlapping_passing_weight(i, to, w);
        }
        match self.scene.features.absorption {
            true => {
                let waves = w.times.waves(w.arriving.carried.sample[i]);
                let medium = &self.scene.media[usize::from(w.arriving.interior[i].medium())];
                medium.transmittance_at(to, waves)
            }
            false => Rgb::ONE,
        }
    }

    /// Does a path that hit nothing end in a medium, because this is its last bounce?
    pub(super) fn ends_in_medium(&self, bounce: u32, i: usize, w: &mut Workspace) -> bool {
        let ends = self.scene.features.scattering && w.medium_segments[i].scatters;
        if ends && bounce == 0 {
            w.sink.cover(w.arriving.carried.sample[i]);
        }
        ends
    }

    /// Ends the paths that have had all their bounces, and counts what is left of each group.
    pub(super) fn end_deep_paths(&self, w: &mut Workspace) -> ShadingGroupCounts {
        let mut counts = ShadingGroupCounts::new();
        for (group, &depth) in w.groups.iter_mut().zip(&w.arriving.depth) {
            if depth >= self.options.max_depth {
                *group = ShadingGroup::None;
            }
            counts.add(*group);
        }
        counts
    }

    /// Counts a bounce for all sorted vertices but those of walks within solids.
    pub(super) fn count_bounces(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let (paths, in_media) = (&mut w.wave.paths, sorted.medium());
        for k in sorted.all() {
            let medium = &self.scene.media[usize::from(paths.interior[k].medium())];
            let is_walk = in_media.contains(&k) && medium.scattering.as_ref().is_some_and(|s| !s.counts);
            paths.depth[k] += u32::from(!is_walk);
        }
    }

    /// Makes vertex `k` of the point where arriving path `i` scatters.
    pub(super) fn make_medium_vertex(&self, i: usize, k: usize, w: &mut Workspace) {
        let (segment, ray, v) = (&w.medium_segments[i], &w.rays[i], &mut w.wave.vertices);
        set(&mut v.p, k, ray.at(segment.until));
        set(&mut v.wo, k, -ray.direction);
        set(&mut v.ng, k, Vec3::ZERO);
        set(&mut v.ns, k, Vec3::ZERO);
        v.offset[k] = 0.0;
        let medium = &self.scene.media[usize::from(segment.medium)];
        v.anisotropy[k] = medium.scattering.as_ref().map_or(0.0, |s| s.anisotropy);
    }

    /// Takes the pending paths that hit boundaries without a surface to the media behind.
    pub(super) fn cross_boundaries(&self, bounce: u32, pass: u32, w: &mut Workspace) {
        let is_clipped = bounce == 0 && self.view.camera.is_clipped();
        for at in 0..w.pending.len() {
            let i = w.pending[at] as usize;
            let (hit, time) = (w.hits[i], w.times.of(w.arriving.carried.sample[i]));
            if self.is_excluded(w.without, &hit) {
                continue;
            }
            let (here, last) = (w.arriving.interior[i], w.medium_segments[i].crossed.map_or(0.0, |c| c.at));
            let crossing = (&hit, time);
            let Some(beyond) = self.beyond_boundary(&w.rays[i], crossing, here, last) else { continue };
            let throughput = get_rgb(&w.arriving.carried.throughput, i);
            let throughput = throughput * self.passed(bounce, i, hit.t, w);
            let path = &mut w.arriving.carried;
            set_rgb(&mut path.throughput, i, throughput);
            w.arriving.interior[i] = beyond;
            let salt = hash32(path.seed[i] ^ hash32(path.shuffled[i]) ^ (bounce << 16));
            let salt = hash32(salt.wrapping_add(pass) ^ BOUNDARY);
            let u = [unit(salt), unit(hash32(salt))];
            let waves = w.times.waves(w.arriving.carried.sample[i]);
            let start = (&w.rays[i], hit.t);
            let segment =
                self.sample_segment((beyond, waves), start, throughput, None, u, &mut w.overlapping_segments);
            let far = if is_clipped { self.reach(w, i) } else { f32::INFINITY };
            w.rays[i].t_max = segment.until.min(far);
            w.medium_segments[i] = segment;
            w.medium_segments[i].crossed = Some(BoundaryCrossing { at: hit.t, before: here });
        }
    }

    /// The solids behind a hit on a boundary without a surface, where the one before was crossed at `last`; `None` at all
    /// other hits.
    fn beyond_boundary(
        &self,
        ray: &Ray,
        (hit, time): (&Hit, f32),
        here: Interior,
        last: f32,
    ) -> Option<Interior> {
        /// In proportion, how far apart rounding takes the hits of two triangles at their common edge.
        const ROUNDING: f32 = 4.0 * f32::EPSILON;
        let material = &self.scene.materials[self.scene.geometries.material(hit) as usize];
        if !material.is_boundary || material.medium_index == 0 {
            return None;
        }
        let own = material.medium_index;
        let is_at_last = hit.t - last <= ROUNDING * hit.t;
        Some(match self.scene.geometries.is_back(ray, hit, time) {
            true if here.contains(own) => here.left(own),
            // A body may have several materials, one where it is entered and another where it is left.
            true if self.scene.media[usize::from(here.medium())].is_boundary => here.left(here.medium()),
            true => here,
            false if is_at_last && here.medium() == own => here,
            false => self.entered(here, own),
        })
    }

    /// Starts the ways of all shadow rays.
    pub(super) fn start_shadow_segments(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let Workspace { wave, shadow_segments, shadow_vertices, .. } = w;
        let Wave { paths, vertices: v, .. } = &**wave;
        shadow_segments.clear();
        shadow_segments.extend(shadow_vertices.iter().map(|&i| ShadowSegment {
            interior: self.interior_towards_light(sorted, paths, v, i as usize),
            from: 0.0,
        }));
    }

    /// Takes a shadow ray past a surface that isn't there: behind a boundary another medium begins.
    pub(super) fn cross_with_shadow_ray(
        &self,
        i: usize,
        ray: &Ray,
        (hit, time): (&Hit, f32),
        way: Option<&mut ShadowSegment>,
        light: &mut LightLanes,
        waves: Option<&Wavelengths>,
    ) {
        let Some(way) = way else { return };
        if let Some(beyond) = self.beyond_boundary(ray, (hit, time), way.interior, way.from) {
            let stretch = [way.from, hit.t];
            let left = self.transmittance_between(way.interior, (ray.origin, ray.direction), stretch, waves);
            let contribution = get_rgb(&light.contribution, i);
            set_rgb(&mut light.contribution, i, contribution * left);
            *way = ShadowSegment { interior: beyond, from: hit.t };
        }
    }

    /// Ends the ways of all shadow rays at their lights.
    pub(super) fn end_shadow_segments(&self, w: &mut Workspace) {
        let Workspace { wave, shadow_segments, shadow_vertices, shadow_rays, occluded, times, .. } = w;
        let (light, path) = (&mut wave.vertices.light, &wave.paths.carried);
        for (k, way) in shadow_segments.iter().enumerate().filter(|&(k, _)| !occluded[k]) {
            let (ray, i) = (&shadow_rays[k], shadow_vertices[k] as usize);
            let (stretch, waves) = ([way.from, ray.t_max], times.waves(path.sample[i]));
            let left = self.transmittance_between(way.interior, (ray.origin, ray.direction), stretch, waves);
            let contribution = get_rgb(&light.contribution, i);
            set_rgb(&mut light.contribution, i, contribution * left);
        }
        shadow_segments.clear();
    }
}

/// A ray and where on it a flight begins.
pub(super) type Start<'a> = (&'a Ray, f32);

impl Integrator<'_> {
    /// Do other media fill the place of the one that a path is in?
    #[inline(always)]
    pub(super) fn has_overlapping_media(&self, interior: Interior) -> bool {
        self.scene.features.overlaps && interior.beside(&self.scene.media).next().is_some()
    }

    /// Draws the flight of a path, by two numbers in 0..1; `list` gets those through the other media in the place.
    #[inline(always)]
    pub(super) fn sample_segment(
        &self,
        (interior, waves): (Interior, Option<&Wavelengths>),
        start: Start<'_>,
        throughput: Rgb,
        lamp: Option<Vec3>,
        u: [f32; 2],
        list: &mut Vec<MediumSegment>,
    ) -> MediumSegment {
        let mut segment = self.sample_segment_in((interior.medium(), waves), start, throughput, lamp, u);
        if self.scene.features.overlaps {
            self.sample_overlapping_segments(&mut segment, (interior, waves), start, throughput, u, list);
        }
        segment
    }

    #[inline]
    fn sample_segment_in(
        &self,
        (medium, waves): (u16, Option<&Wavelengths>),
        (ray, from): Start<'_>,
        throughput: Rgb,
        lamp: Option<Vec3>,
        u: [f32; 2],
    ) -> MediumSegment {
        match &self.scene.media[usize::from(medium)].scattering {
            Some(s) => {
                let scattering = (medium, &*s.in_lanes(waves));
                MediumSegment::draw(scattering, (ray.origin, ray.direction), from, throughput, lamp, u)
            }
            None => MediumSegment::straight(medium, [from, f32::INFINITY]),
        }
    }

    /// Takes the flight that ends first in place of the one through the first medium: that, or one through those in the same place.
    /// All end there.
    #[cold]
    fn sample_overlapping_segments(
        &self,
        soonest: &mut MediumSegment,
        (interior, waves): (Interior, Option<&Wavelengths>),
        start: Start<'_>,
        throughput: Rgb,
        u: [f32; 2],
        list: &mut Vec<MediumSegment>,
    ) {
        let first = list.len();
        for medium in interior.beside(&self.scene.media) {
            let other =
                self.sample_segment_in((medium, waves), start, throughput, None, numbers_of(medium, u));
            let later = if other.until < soonest.until { std::mem::replace(soonest, other) } else { other };
            list.push(later);
        }
        for later in &mut list[first..] {
            later.until = soonest.until;
        }
        soonest.beside = [first as u32, list.len() as u32];
    }

    /// What path `i` is taken times at a point of its ray by the flights beside its own.
    #[inline]
    pub(super) fn overlapping_passing_weight(&self, i: usize, to: f32, w: &Workspace) -> Rgb {
        if w.medium_segments[i].is_alone() {
            Rgb::ONE
        } else {
            self.product_of_passing_weights(beside(&w.medium_segments[i], w), i, to, w)
        }
    }

    /// What path `i` is taken times at a point of its ray by some of its flights.
    #[cold]
    fn product_of_passing_weights<'a>(
        &self,
        medium_segments: impl Iterator<Item = &'a MediumSegment>,
        i: usize,
        to: f32,
        w: &Workspace,
    ) -> Rgb {
        medium_segments.fold(Rgb::ONE, |weight, segment| weight * self.weight_of_passing(segment, i, to, w))
    }

    /// What a path that flies through several media is taken times at a point of its ray. Adds what they emit on the way.
    #[cold]
    pub(super) fn pass_overlapping_media(&self, bounce: u32, i: usize, to: f32, w: &mut Workspace) -> Rgb {
        let whole = [w.medium_segments[i]].into_iter().chain(beside(&w.medium_segments[i], w).copied());
        let whole: Vec<MediumSegment> = whole.collect();
        for k in 0..whole.len() {
            if let Some(scattering) = &self.scene.media[usize::from(whole[k].medium)].scattering
                && scattering.emission.max_element() > 0.0
            {
                let value = self.overlapping_emission(scattering, (&whole, k), (bounce, i), to, w);
                self.add_medium_emission(bounce, i, value, w);
            }
        }
        self.product_of_passing_weights(whole.iter(), i, to, w)
    }

    /// The light of the medium of one of a path's flights, seen through those of the others.
    fn overlapping_emission(
        &self,
        scattering: &Scattering,
        (whole, k): (&[MediumSegment], usize),
        (bounce, i): (u32, usize),
        to: f32,
        w: &Workspace,
    ) -> Rgb {
        let waves = w.times.waves(w.arriving.carried.sample[i]);
        let scattering = &*scattering.in_lanes(waves);
        let (segment, salt) = (&whole[k], hash32(self.emission_salt(bounce, i, w) ^ k as u32));
        let others = || whole.iter().enumerate().filter(|&(other, _)| other != k).map(|(_, segment)| segment);
        let is_clear = |other: &MediumSegment| {
            let medium = &self.scene.media[usize::from(other.medium)];
            medium.scattering.as_ref().is_some_and(|s| other.is_unweighted(&s.in_lanes(waves)))
        };
        if others().all(is_clear) {
            return self.glow(segment, scattering, i, to, salt, w);
        }
        let factor = |t: f32| self.product_of_passing_weights(others(), i, t, w);
        let throughput = get_rgb(&w.arriving.carried.throughput, i);
        let ray = (w.rays[i].origin, w.rays[i].direction);
        let way = [segment.extent[0], to.min(segment.until)];
        throughput
            * match (&scattering.glow, &scattering.grid) {
                (Some(glow), Some(_)) => {
                    scattering.emission * glow.integral_times(ray, way, salt, waves, factor)
                }
                (None, Some(grid)) => {
                    let ray = grid.ray(ray.0, ray.1, 1.0);
                    scattering.emission * grid.integral_times(&ray, way, salt, factor)
                }
                (_, None) => {
                    return segment.overlapping_emission(scattering, throughput, to, unit(salt), factor);
                }
            }
    }

    /// What other media in the place leave of light between two points of a ray.
    #[cold]
    pub(super) fn overlapping_transmittance(
        &self,
        interior: Interior,
        ray: (Vec3, Vec3),
        way: [f32; 2],
        waves: Option<&Wavelengths>,
    ) -> Rgb {
        interior.beside(&self.scene.media).fold(Rgb::ONE, |left, medium| {
            // Those around the scene are on no grid, and need nothing to be kept apart by.
            left * self.transmittance_in(medium, ray, way, waves, u32::from(medium))
        })
    }
}

/// The flights beside one.
fn beside<'a>(
    segment: &MediumSegment,
    w: &'a Workspace,
) -> impl Iterator<Item = &'a MediumSegment> + use<'a> {
    w.overlapping_segments[segment.beside[0] as usize..segment.beside[1] as usize].iter()
}

/// The numbers that decide a flight through a medium beside another.
fn numbers_of(medium: u16, [distance, kind]: [f32; 2]) -> [f32; 2] {
    let salt = hash32(u32::from(medium) ^ hash32(distance.to_bits() ^ hash32(kind.to_bits())));
    [unit(salt), unit(hash32(salt))]
}
