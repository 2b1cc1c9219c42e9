//! Media that scatter: paths fly through them until they scatter or meet a surface, shadow rays lose light in them, and
//! both cross the boundaries of media where no surface is. Several media in one place are in [`super::beside`].
//!
//! How far a path flies is drawn before its ray is traced, and the ray ends there: what it would meet behind is not
//! looked for. A boundary without a surface ends a flight, and another begins; the path stays what it was, with its origin and its
//! density, so that lights behind are weighted as any others.

use super::Integrator;
use super::Purpose;
use super::flight::{Crossed, Flight, ShadowWay};
use super::group::{Group, GroupCounts, Sorted};
use super::interior::Interior;
use super::lanes::{get_rgb, set, set_rgb};
use super::layers::{Origin, Way, way_of_path};
use super::wave::{LightLanes, Wave};
use super::workspace::Workspace;
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
    pub(super) fn start_flights(&self, bounce: u32, w: &mut Workspace) {
        let dimensions = &self.dimensions(bounce, Purpose::Flight);
        let Workspace { flights, flights_beside, rays, arriving, times, .. } = w;
        flights.clear();
        flights_beside.clear();
        for (i, ray) in rays.iter_mut().enumerate() {
            let interior = arriving.interior[i];
            let medium = interior.medium();
            let scatters = self.scene.media[usize::from(medium)].scattering.is_some();
            if !scatters && !self.has_beside(interior) {
                flights.push(Flight::straight(medium, [0.0, f32::INFINITY]));
                continue;
            }
            let path = &arriving.carried;
            let point = SobolPoint::from_parts(path.seed[i], path.shuffled[i]);
            let [distance, kind, lamp0, lamp1] = point.sample_4d(dimensions);
            let lamp = self.guiding_lamp(medium, ray.origin, [lamp0, lamp1]);
            let throughput = get_rgb(&path.throughput, i);
            let waves = times.waves(path.sample[i]);
            let carried = (interior, waves);
            let flight = self.fly(carried, (ray, 0.0), throughput, lamp, [distance, kind], flights_beside);
            // Where cameras see surfaces up to a distance only, rays end there; what scatters beyond is seen.
            ray.t_max = flight.until.min(ray.t_max);
            flights.push(flight);
        }
    }

    /// The lamp that guides a flight. Within solids there is none: what bounds them hides lamps.
    fn guiding_lamp(&self, medium: u16, origin: Vec3, u: [f32; 2]) -> Option<Vec3> {
        let lights = &self.scene.lights;
        if medium != 0 || lights.is_empty() {
            return None;
        }
        let selected = lights.select(0, &Receiver { p: origin, normal: Vec3::ZERO }, u);
        if selected.pdf_discrete > 0.0 { lights.middle(selected.index) } else { None }
    }

    /// Ends all flights: where a surface was hit, where the path scatters, or nowhere. Weighs the paths by it and adds what
    /// media emit.
    pub(super) fn end_flights(&self, bounce: u32, w: &mut Workspace) {
        for i in 0..w.rays.len() {
            let hit = w.hits[i];
            let mut weight = self.passed(bounce, i, hit.t, w);
            let time = w.times.of(w.arriving.carried.sample[i]);
            let flight = &w.flights[i];
            if let Some(crossed) = flight.crossed.filter(|c| self.bounds_at(c, &w.rays[i], (&hit, time))) {
                w.arriving.interior[i] = crossed.before;
            }
            if !hit.is_hit() && flight.until.is_finite() {
                let medium = &self.scene.media[usize::from(flight.medium)];
                let waves = w.times.waves(w.arriving.carried.sample[i]);
                let weigh = |s: &Scattering| flight.weight_of_scattering(&s.in_lanes(waves));
                weight = medium.scattering.as_ref().map_or(Rgb::ZERO, weigh);
                if !flight.is_alone() {
                    weight *= self.passed_beside(i, flight.until, w);
                }
                w.hits[i].t = flight.until;
                w.flights[i].scatters = true;
            }
            let throughput = get_rgb(&w.arriving.carried.throughput, i);
            set_rgb(&mut w.arriving.carried.throughput, i, throughput * weight);
        }
    }

    /// Does a surface lie where a boundary without one was crossed, nearer than the offset of rays that start there? They
    /// will not cross it back: the surface is on the boundary's near side then.
    fn bounds_at(&self, crossed: &Crossed, ray: &Ray, (hit, time): (&Hit, f32)) -> bool {
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
        if !w.flights[i].is_alone() {
            return self.passed_together(bounce, i, to, w);
        }
        let flight = &w.flights[i];
        let medium = &self.scene.media[usize::from(flight.medium)];
        if let Some(scattering) = &medium.scattering
            && scattering.emission.max_element() > 0.0
        {
            let scattering = &scattering.in_lanes(w.times.waves(w.arriving.carried.sample[i]));
            let salt = self.glow_salt(bounce, i, w) ^ GLOW;
            let value = self.glow(flight, scattering, i, to, salt, w);
            self.add_glow(bounce, i, value, w);
        }
        self.weight_of_passing(&w.flights[i], i, to, w)
    }

    /// What path `i` is taken times by one of its flights at a point of its ray, where it arrives without having scattered. What ends
    /// nowhere in a solid was not closed, and absorbs nothing.
    #[inline(always)]
    pub(super) fn weight_of_passing(&self, flight: &Flight, i: usize, to: f32, w: &Workspace) -> Rgb {
        let medium = &self.scene.media[usize::from(flight.medium)];
        let waves = w.times.waves(w.arriving.carried.sample[i]);
        match &medium.scattering {
            Some(scattering) => flight.weight_of_passing(&scattering.in_lanes(waves), &w.rays[i], to),
            None if medium.absorption.is_some() && to.is_finite() => {
                medium.transmittance_at(to - flight.extent[0], waves)
            }
            None => Rgb::ONE,
        }
    }

    /// What the choices follow by which path `i` finds what shines on its way.
    #[inline]
    pub(super) fn glow_salt(&self, bounce: u32, i: usize, w: &Workspace) -> u32 {
        let path = &w.arriving.carried;
        hash32(path.seed[i] ^ hash32(path.shuffled[i]) ^ (bounce << 16))
    }

    /// What the medium of a flight adds to path `i` on its way to a point.
    pub(super) fn glow(
        &self,
        flight: &Flight,
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
        let way = [flight.extent[0], to.min(flight.until)];
        match (&scattering.glow, &scattering.grid) {
            (Some(glow), Some(_)) => throughput * scattering.emission * glow.integral(ray, way, salt, waves),
            (None, Some(grid)) => {
                let ray = grid.ray(ray.0, ray.1, 1.0);
                throughput * scattering.emission * grid.integral(&ray, way[0], way[1], salt)
            }
            (_, None) => flight.glow(scattering, throughput, to, unit(hash32(salt ^ to.to_bits()))),
        }
    }

    /// Adds light of a medium to what path `i` has found.
    pub(super) fn add_glow(&self, bounce: u32, i: usize, value: Rgb, w: &mut Workspace) {
        let first_bounces = &w.arriving.first_bounces;
        w.sink.contribute(w.arriving.carried.sample[i], value, || Origin {
            way: way_of_path(bounce, Way::Emission, first_bounces, i),
            group: 0,
        });
    }

    /// What arriving path `i` is taken times at a point of its ray, which it reached.
    pub(super) fn left_on_the_way(&self, i: usize, to: f32, w: &Workspace) -> Rgb {
        if self.scene.features.scattering {
            return self.weight_of_passing(&w.flights[i], i, to, w) * self.passed_beside(i, to, w);
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
        let ends = self.scene.features.scattering && w.flights[i].scatters;
        if ends && bounce == 0 {
            w.sink.cover(w.arriving.carried.sample[i]);
        }
        ends
    }

    /// Ends the paths that have had all their bounces, and counts what is left of each group.
    pub(super) fn end_deep_paths(&self, w: &mut Workspace) -> GroupCounts {
        let mut counts = GroupCounts::new();
        for (group, &depth) in w.groups.iter_mut().zip(&w.arriving.depth) {
            if depth >= self.options.max_depth {
                *group = Group::None;
            }
            counts.add(*group);
        }
        counts
    }

    /// Counts a bounce for all sorted vertices but those of walks within solids.
    pub(super) fn count_bounces(&self, sorted: &Sorted, w: &mut Workspace) {
        let (paths, in_media) = (&mut w.wave.paths, sorted.medium());
        for k in sorted.all() {
            let medium = &self.scene.media[usize::from(paths.interior[k].medium())];
            let is_walk = in_media.contains(&k) && medium.scattering.as_ref().is_some_and(|s| !s.counts);
            paths.depth[k] += u32::from(!is_walk);
        }
    }

    /// Makes vertex `k` of the point where arriving path `i` scatters.
    pub(super) fn place_in_medium(&self, i: usize, k: usize, w: &mut Workspace) {
        let (flight, ray, v) = (&w.flights[i], &w.rays[i], &mut w.wave.vertices);
        set(&mut v.p, k, ray.at(flight.until));
        set(&mut v.wo, k, -ray.direction);
        set(&mut v.ng, k, Vec3::ZERO);
        set(&mut v.ns, k, Vec3::ZERO);
        v.offset[k] = 0.0;
        let medium = &self.scene.media[usize::from(flight.medium)];
        v.anisotropy[k] = medium.scattering.as_ref().map_or(0.0, |s| s.anisotropy);
    }

    /// Takes the pending paths that hit boundaries without a surface to the media behind.
    pub(super) fn cross_boundaries(&self, bounce: u32, pass: u32, w: &mut Workspace) {
        let is_clipped = bounce == 0 && self.view.camera.is_clipped();
        for at in 0..w.pending.len() {
            let i = w.pending[at] as usize;
            let (hit, time) = (w.hits[i], w.times.of(w.arriving.carried.sample[i]));
            if self.is_left_out(w.without, &hit) {
                continue;
            }
            let (here, last) = (w.arriving.interior[i], w.flights[i].crossed.map_or(0.0, |c| c.at));
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
            let flight = self.fly((beyond, waves), start, throughput, None, u, &mut w.flights_beside);
            let far = if is_clipped { self.reach(w, i) } else { f32::INFINITY };
            w.rays[i].t_max = flight.until.min(far);
            w.flights[i] = flight;
            w.flights[i].crossed = Some(Crossed { at: hit.t, before: here });
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
    pub(super) fn start_shadow_ways(&self, sorted: &Sorted, w: &mut Workspace) {
        let Workspace { wave, shadow_ways, shadow_vertices, .. } = w;
        let Wave { paths, vertices: v, .. } = &**wave;
        shadow_ways.clear();
        shadow_ways.extend(
            shadow_vertices.iter().map(|&i| ShadowWay {
                interior: self.towards_light(sorted, paths, v, i as usize),
                from: 0.0,
            }),
        );
    }

    /// Takes a shadow ray past a surface that isn't there: behind a boundary another medium begins.
    pub(super) fn cross_with_light(
        &self,
        i: usize,
        ray: &Ray,
        (hit, time): (&Hit, f32),
        way: Option<&mut ShadowWay>,
        light: &mut LightLanes,
        waves: Option<&Wavelengths>,
    ) {
        let Some(way) = way else { return };
        if let Some(beyond) = self.beyond_boundary(ray, (hit, time), way.interior, way.from) {
            let stretch = [way.from, hit.t];
            let left = self.left_between(way.interior, (ray.origin, ray.direction), stretch, waves);
            let contribution = get_rgb(&light.contribution, i);
            set_rgb(&mut light.contribution, i, contribution * left);
            *way = ShadowWay { interior: beyond, from: hit.t };
        }
    }

    /// Ends the ways of all shadow rays at their lights.
    pub(super) fn end_shadow_ways(&self, w: &mut Workspace) {
        let Workspace { wave, shadow_ways, shadow_vertices, shadow_rays, occluded, times, .. } = w;
        let (light, path) = (&mut wave.vertices.light, &wave.paths.carried);
        for (k, way) in shadow_ways.iter().enumerate().filter(|&(k, _)| !occluded[k]) {
            let (ray, i) = (&shadow_rays[k], shadow_vertices[k] as usize);
            let (stretch, waves) = ([way.from, ray.t_max], times.waves(path.sample[i]));
            let left = self.left_between(way.interior, (ray.origin, ray.direction), stretch, waves);
            let contribution = get_rgb(&light.contribution, i);
            set_rgb(&mut light.contribution, i, contribution * left);
        }
        shadow_ways.clear();
    }
}
