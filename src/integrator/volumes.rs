//! Participating media: path segments, shadow rays, boundaries of media and overlapping media.
//!
//! The distance to the next scattering event is sampled before the ray is traced, and the ray ends there. A boundary without a surface
//! ends a segment and begins another; the path keeps its origin and its pdf, for the usual MIS weights of lights behind.
//!
//! Overlapping media (those without a surface, and the medium around the scene) add up. A distance is sampled in each independently, and
//! the path scatters at the shortest. Throughput is multiplied by the weights of all segments: of scattering in one medium, of passing the
//! others. This is unbiased, since the expectation of each factor is the medium's transmittance, independently of the other media. The
//! emission of a medium is attenuated by the others in the same way, point by point.
//!
//! Emissive media on grids are also lights ([`VolumeLight`](crate::light::VolumeLight)): their emission along scattered rays is weighted
//! against light samples by MIS, point by point.

use super::Integrator;
use super::interior::Interior;
use super::medium_segment::{BoundaryCrossing, MediumSegment, ShadowSegment};
use super::radiance_buffer::{PathClass, RadianceOrigin, class_of_path};
use super::sampling::{Purpose, RandomChoice};
use super::shading_groups::SortedVertices;
use super::visibility::receiver_class;
use super::wave::{LightLanes, PathState, Wave, get, get_rgb, scale_rgb, set, set_rgb};
use super::workspace::Workspace;
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::Scattering;
use crate::light::LightSource;
use crate::math::{Hit, Ray, Vec3};
use crate::sampling::hash::{hash32, unit};

impl Integrator<'_> {
    /// Samples the distance to the next scattering event of each path, and ends its ray there.
    pub(super) fn start_medium_segments(&self, bounce: u32, w: &mut Workspace) {
        let dimensions = &self.dimensions(bounce, Purpose::Medium);
        let Workspace { medium_segments, overlapping_segments, rays, arriving, times, .. } = w;
        medium_segments.clear();
        overlapping_segments.clear();
        let ends = bounce == 0 && self.view.camera.is_clipped();
        for (i, ray) in rays.iter_mut().enumerate() {
            if ends
                && self.is_open_ended(ray, arriving.interior[i], times.of(arriving.state.radiance_index[i]))
            {
                arriving.interior[i] = Interior::AIR;
            }
            let interior = arriving.interior[i];
            let medium = interior.medium();
            let scatters = self.scene.media[usize::from(medium)].scattering.is_some();
            if !scatters && !self.has_overlapping_media(interior) {
                medium_segments.push(MediumSegment::unscattered(medium, [0.0, f32::INFINITY]));
                continue;
            }
            let path = &arriving.state;
            let point = path.sobol_point(i);
            let [distance, kind, select0, select1] = point.sample_4d(dimensions);
            let light_position = self.equiangular_light(medium, ray.origin, [select0, select1]);
            let throughput = get_rgb(&path.throughput, i);
            let wavelengths = times.wavelengths(path.radiance_index[i]);
            let inside = (interior, wavelengths);
            let segment = self.sample_segment(
                inside,
                (ray, 0.0),
                throughput,
                light_position,
                [distance, kind],
                overlapping_segments,
            );
            // Far clipping applies to surfaces only: a scattering event may lie beyond `t_max`.
            ray.t_max = segment.scatter_t.min(ray.t_max);
            medium_segments.push(segment);
        }
    }

    /// Does a clipped camera ray start in a medium without a surface, and hit no end of it?
    fn is_open_ended(&self, ray: &Ray, interior: Interior, time: f32) -> bool {
        self.scene.media[usize::from(interior.medium())].is_boundary
            && !self.scene.accel.closest_one_in_time(ray, time).is_hit()
    }

    /// Selects a light for equiangular sampling; returns its position. `None` within solids, whose surfaces occlude lights, and on grids.
    fn equiangular_light(&self, medium: u16, origin: Vec3, u: [f32; 2]) -> Option<Vec3> {
        let (lights, of_index) = (&self.scene.lights, &self.scene.media[usize::from(medium)]);
        let is_open = medium == 0 || of_index.is_boundary;
        if !is_open || of_index.is_on_grid() || lights.is_empty() {
            return None;
        }
        let selected = lights.select(0, &self.light_receiver(origin, Vec3::ZERO), u);
        if selected.pdf_discrete > 0.0 { lights.center(selected.index) } else { None }
    }

    /// Ends all segments at a hit, a scattering event, or infinity. Weights the paths and adds the emission of media.
    pub(super) fn end_medium_segments(&self, bounce: u32, w: &mut Workspace) {
        for i in 0..w.rays.len() {
            let hit = w.hits[i];
            let mut weight = self.pass_media(bounce, i, hit.t, w);
            let time = w.time(i);
            let segment = &w.medium_segments[i];
            if let Some(crossed) =
                segment.crossed.filter(|c| self.counts_as_before(c, &w.rays[i], (&hit, time)))
            {
                w.arriving.interior[i] = crossed.before;
            }
            if !hit.is_hit() && segment.scatter_t.is_finite() {
                let medium = &self.scene.media[usize::from(segment.medium)];
                let wavelengths = w.wavelengths(i);
                let weigh = |s: &Scattering| segment.weight_of_scattering(&s.at_wavelengths(wavelengths));
                weight = medium.scattering.as_ref().map_or(Rgb::ZERO, weigh);
                if !segment.is_alone() {
                    weight *= self.overlapping_passing_weight(i, segment.scatter_t, w);
                }
                w.hits[i].t = segment.scatter_t;
                w.medium_segments[i].scatters = true;
            }
            scale_rgb(&mut w.arriving.state.throughput, i, weight);
        }
    }

    /// Is the hit closer to a crossed boundary than the offset of ray origins? Then rays from the hit would not cross the boundary back,
    /// and the hit counts as before it.
    fn counts_as_before(&self, crossed: &BoundaryCrossing, ray: &Ray, (hit, time): (&Hit, f32)) -> bool {
        /// Maximum distance relative to the hit's, above which rounding errors are excluded.
        const NEAR: f32 = 1e-3;
        let span = hit.t - crossed.at;
        if !hit.is_hit() || span > NEAR * hit.t {
            return false;
        }
        let surface = self.scene.geometries.surface(ray, hit, time);
        span * ray.direction.dot(surface.ng).abs() <= surface.ng.abs().dot(surface.p_error)
    }

    /// The weight of path `i` for reaching a distance without scattering. Adds the emission of media up to there.
    pub(super) fn pass_media(&self, bounce: u32, i: usize, to: f32, w: &mut Workspace) -> Rgb {
        if !w.medium_segments[i].is_alone() {
            return self.pass_overlapping_media(bounce, i, to, w);
        }
        let segment = &w.medium_segments[i];
        let medium = &self.scene.media[usize::from(segment.medium)];
        if let Some(scattering) = &medium.scattering
            && scattering.emission.max_element() > 0.0
        {
            let scattering = &scattering.at_wavelengths(w.wavelengths(i));
            let salt = RandomChoice::MediumEmission.hash(&w.arriving.state, i, bounce);
            let value = self.segment_emission(segment, scattering, i, (to, salt), None, w);
            self.add_medium_emission(bounce, i, value, w);
        }
        self.weight_of_passing(&w.medium_segments[i], i, to, w)
    }

    /// The weight of one segment of path `i` for reaching a distance without scattering. Rays that escape within an open solid are not
    /// absorbed.
    #[inline(always)]
    pub(super) fn weight_of_passing(&self, segment: &MediumSegment, i: usize, to: f32, w: &Workspace) -> Rgb {
        let medium = &self.scene.media[usize::from(segment.medium)];
        let wavelengths = w.wavelengths(i);
        match &medium.scattering {
            Some(scattering) => segment.weight_of_passing(
                (&scattering.at_wavelengths(wavelengths), wavelengths),
                &w.rays[i],
                to,
            ),
            None if medium.absorption.is_some() && to.is_finite() => {
                medium.transmittance_at(to - segment.extent[0], wavelengths)
            }
            None => Rgb::ONE,
        }
    }

    /// The emission of a segment's medium along path `i` up to a distance.
    pub(super) fn segment_emission(
        &self,
        segment: &MediumSegment,
        scattering: &Scattering,
        i: usize,
        (to, salt): (f32, u32),
        others: Option<&dyn Fn(f32) -> Rgb>,
        w: &Workspace,
    ) -> Rgb {
        let path = &w.arriving.state;
        let throughput = get_rgb(&path.throughput, i);
        let medium = (scattering, w.times.wavelengths(path.radiance_index[i]));
        let emission = |factor: Option<&dyn Fn(f32) -> Rgb>| {
            segment.emission(medium, &w.rays[i], throughput, (to, salt), factor)
        };
        match (others, self.medium_emission_weight(segment.medium, i, w)) {
            (others, None) => emission(others),
            (None, Some(weight)) => emission(Some(&|t| Rgb::splat(weight(t)))),
            (Some(others), Some(weight)) => emission(Some(&|t| others(t) * weight(t))),
        }
    }

    /// MIS weight of a medium's emission along the ray of path `i`, by distance; `None` if the medium is not light-sampled.
    fn medium_emission_weight<'w>(
        &'w self,
        medium: u16,
        i: usize,
        w: &'w Workspace,
    ) -> Option<impl Fn(f32) -> f32 + use<'w>> {
        let pdf = w.arriving.state.pdf[i];
        let (index, volume) = self.scene.lights.volume_of_medium(medium).filter(|_| pdf.competes())?;
        let p = self.start_of_ray(i, w);
        let receiver = self.light_receiver(p, get(&w.arriving.receiver_normal, i));
        let class = receiver_class(i, &w.arriving, self.scene.features.links);
        let pdf_discrete = self.scene.lights.pdf_discrete(class, &receiver, index);
        let is_shadowed = self.is_shadowed(i, &w.arriving);
        Some(move |t: f32| {
            let to = w.rays[i].at(t);
            let through_panes = || self.pane_density_ratio(i, (p, to), Vec3::ZERO, w);
            let light_pdf = || volume.pdf_solid_angle(p, to) * pdf_discrete * through_panes();
            if is_shadowed { 0.0 } else { pdf.mis_weight(light_pdf) }
        })
    }

    /// Evaluates the emission of media at the targets of light samples.
    pub(super) fn evaluate_volume_lights(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let Workspace { wave, times, .. } = w;
        let (light, path) = (&mut wave.vertices.light, &wave.paths.state);
        for i in sorted.lit().filter(|&i| !light.pdf[i].is_none()) {
            let Some(volume) = self.scene.lights.volume(light.index[i]) else { continue };
            let medium = self.scene.media[usize::from(volume.medium())].scattering.as_ref();
            let wavelengths = times.wavelengths(path.radiance_index[i]);
            let emission = medium.map_or(Rgb::ZERO, |s| s.emission_at(get(&light.target, i), wavelengths));
            set_rgb(&mut light.radiance, i, emission * volume.depth());
        }
    }

    /// Is a medium effective within these solids, as the top of the list or overlapping?
    fn is_effective_in(&self, interior: Interior, medium: u16) -> bool {
        interior.medium() == medium
            || self.scene.features.overlaps && interior.overlapping(&self.scene.media).any(|m| m == medium)
    }

    /// Adds the emission of a medium to the radiance of path `i`.
    pub(super) fn add_medium_emission(&self, bounce: u32, i: usize, value: Rgb, w: &mut Workspace) {
        let first_bounces = &w.arriving.first_bounces;
        w.radiance_buffer.contribute(w.arriving.state.radiance_index[i], bounce, value, || RadianceOrigin {
            class: class_of_path(bounce, PathClass::Emission, first_bounces, i),
            group: 0,
        });
    }

    /// The weight of arriving path `i` for reaching a distance, by scattering or absorbing media.
    pub(super) fn transmittance_to_hit(&self, i: usize, to: f32, w: &Workspace) -> Rgb {
        if self.scene.features.scattering {
            return self.weight_of_passing(&w.medium_segments[i], i, to, w)
                * self.overlapping_passing_weight(i, to, w);
        }
        match self.scene.features.absorption {
            true => {
                let wavelengths = w.wavelengths(i);
                let medium = &self.scene.media[usize::from(w.arriving.interior[i].medium())];
                medium.transmittance_at(to, wavelengths)
            }
            false => Rgb::ONE,
        }
    }

    /// Does a path without a hit scatter in a medium? Called where paths end; at the first bounce, sets the alpha to 1.
    pub(super) fn ends_in_medium(&self, bounce: u32, i: usize, w: &mut Workspace) -> bool {
        let ends = self.scene.features.scattering && w.medium_segments[i].scatters;
        if ends && bounce == 0 {
            w.radiance_buffer.set_opaque(w.arriving.state.radiance_index[i]);
        }
        ends
    }

    /// Builds vertex `k` at the scattering event of arriving path `i`.
    pub(super) fn make_medium_vertex(&self, i: usize, k: usize, w: &mut Workspace) {
        let (segment, ray, v) = (&w.medium_segments[i], &w.rays[i], &mut w.wave.vertices);
        set(&mut v.p, k, ray.at(segment.scatter_t));
        set(&mut v.wo, k, -ray.direction);
        set(&mut v.ng, k, Vec3::ZERO);
        set(&mut v.ns, k, Vec3::ZERO);
        v.offset[k] = 0.0;
        let medium = &self.scene.media[usize::from(segment.medium)];
        v.anisotropy[k] = medium.scattering.as_ref().map_or(0.0, |s| s.anisotropy);
        if self.optional.only_mirrors {
            w.arriving.only_mirrors[i] = 0;
        }
    }

    /// Continues pending paths behind boundaries without a surface. Clipped camera rays that hit no end of the entered medium continue
    /// outside all solids, as in Cycles.
    pub(super) fn cross_boundaries(&self, bounce: u32, pass: u32, w: &mut Workspace) {
        let is_clipped = bounce == 0 && self.view.camera.is_clipped();
        for at in 0..w.pending.len() {
            let i = w.pending[at] as usize;
            let (hit, time) = (w.hits[i], w.time(i));
            if self.is_excluded(w.excludes_casters, &hit) {
                continue;
            }
            let (here, last) = (w.arriving.interior[i], w.medium_segments[i].crossed.map_or(0.0, |c| c.at));
            let crossing = (&hit, time);
            let Some(mut far_interior) = self.interior_past_boundary(&w.rays[i], crossing, here, last) else {
                continue;
            };
            let far = if is_clipped { self.clip_length(w, i) } else { f32::INFINITY };
            if is_clipped
                && !self.scene.accel.closest_after(&Ray { t_max: far, ..w.rays[i] }, &hit, time).is_hit()
            {
                far_interior = Interior::AIR;
            }
            let throughput = get_rgb(&w.arriving.state.throughput, i);
            let throughput = throughput * self.pass_media(bounce, i, hit.t, w);
            let path = &mut w.arriving.state;
            set_rgb(&mut path.throughput, i, throughput);
            w.arriving.interior[i] = far_interior;
            let is_first = pass == 0 && w.medium_segments[i].is_deterministic();
            let [distance, kind, select0, select1] =
                self.boundary_random_numbers(bounce, pass, is_first, (path, i));
            let wavelengths = w.times.wavelengths(w.arriving.state.radiance_index[i]);
            let start = (&w.rays[i], hit.t);
            let light_position =
                self.equiangular_light(far_interior.medium(), w.rays[i].at(hit.t), [select0, select1]);
            let segment = self.sample_segment(
                (far_interior, wavelengths),
                start,
                throughput,
                light_position,
                [distance, kind],
                &mut w.overlapping_segments,
            );
            w.rays[i].t_max = segment.scatter_t.min(far);
            w.medium_segments[i] = segment;
            w.medium_segments[i].crossed = Some(BoundaryCrossing { at: hit.t, before: here });
        }
    }

    /// Random numbers for the segment of path `i` behind a boundary: for the first segment of a ray (`is_first`) those that
    /// [`Integrator::start_medium_segments`] has not used.
    fn boundary_random_numbers(
        &self,
        bounce: u32,
        pass: u32,
        is_first: bool,
        (path, i): (&PathState, usize),
    ) -> [f32; 4] {
        if is_first {
            let dimensions = self.dimensions(bounce, Purpose::Medium);
            return path.sobol_point(i).sample_4d(&dimensions);
        }
        let mut salt = RandomChoice::MediumBoundary { surface: pass }.hash(path, i, bounce);
        std::array::from_fn(|_| {
            salt = hash32(salt);
            unit(salt)
        })
    }

    /// The solids behind a hit of a boundary without a surface; `last` is the distance of the previous boundary. `None` at other hits.
    fn interior_past_boundary(
        &self,
        ray: &Ray,
        (hit, time): (&Hit, f32),
        here: Interior,
        last: f32,
    ) -> Option<Interior> {
        /// Maximum relative distance, by rounding, between hits of two triangles at their common edge.
        const ROUNDING: f32 = 4.0 * f32::EPSILON;
        let material = &self.scene.materials[self.scene.geometries.material(hit) as usize];
        if !material.bounds_medium {
            return None;
        }
        let own = material.medium_index;
        let is_at_last = hit.t - last <= ROUNDING * hit.t;
        Some(match self.scene.geometries.is_back(ray, hit, time) {
            true if here.contains(own) => here.leave(own),
            // A body may have different materials where the ray enters and exits.
            true if self.scene.media[usize::from(here.medium())].is_boundary => here.leave(here.medium()),
            true => here,
            false if is_at_last && here.contains(own) => here,
            false => self.enter(here, own),
        })
    }

    /// Starts the segments of all shadow rays.
    pub(super) fn start_shadow_segments(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let Workspace { wave, shadow_segments, shadow_vertices, .. } = w;
        let Wave { paths, vertices: v, .. } = &**wave;
        shadow_segments.clear();
        shadow_segments.extend(shadow_vertices.iter().map(|&i| ShadowSegment {
            interior: self.interior_towards_light(sorted, paths, v, i as usize),
            from: 0.0,
        }));
    }

    /// If a shadow ray hits a boundary without a surface: applies transmittance up to there, and enters the medium behind.
    pub(super) fn cross_with_shadow_ray(
        &self,
        i: usize,
        ray: &Ray,
        (hit, time): (&Hit, f32),
        span: Option<&mut ShadowSegment>,
        light: &mut LightLanes,
        wavelengths: Option<&Wavelengths>,
    ) {
        let Some(span) = span else { return };
        if let Some(far_interior) = self.interior_past_boundary(ray, (hit, time), span.interior, span.from) {
            let range = [span.from, hit.t];
            let transmittance =
                self.transmittance_between(span.interior, (ray.origin, ray.direction), range, wavelengths);
            scale_rgb(&mut light.contribution, i, transmittance);
            *span = ShadowSegment { interior: far_interior, from: hit.t };
        }
    }

    /// Applies the transmittance of the last segments of all shadow rays.
    pub(super) fn end_shadow_segments(&self, w: &mut Workspace) {
        let Workspace { wave, shadow_segments, shadow_vertices, shadow_rays, occluded, times, .. } = w;
        let (light, path) = (&mut wave.vertices.light, &wave.paths.state);
        for (k, span) in shadow_segments.iter().enumerate().filter(|&(k, _)| !occluded[k]) {
            let (ray, i) = (&shadow_rays[k], shadow_vertices[k] as usize);
            // A medium emits nothing outside its boundary.
            let volume = self.scene.lights.volume(light.index[i]);
            if volume.is_some_and(|volume| !self.is_effective_in(span.interior, volume.medium())) {
                set_rgb(&mut light.contribution, i, Rgb::ZERO);
                continue;
            }
            let (range, wavelengths) = ([span.from, ray.t_max], times.wavelengths(path.radiance_index[i]));
            let transmittance =
                self.transmittance_between(span.interior, (ray.origin, ray.direction), range, wavelengths);
            scale_rgb(&mut light.contribution, i, transmittance);
        }
        shadow_segments.clear();
    }
}

/// A ray, and the distance at which a segment starts, metres.
pub(super) type Start<'a> = (&'a Ray, f32);

impl Integrator<'_> {
    /// Do other media overlap the path's medium?
    #[inline(always)]
    pub(super) fn has_overlapping_media(&self, interior: Interior) -> bool {
        self.scene.features.overlaps && interior.overlapping(&self.scene.media).next().is_some()
    }

    /// Samples the segment of a path by two random numbers; appends segments in overlapping media to `list`.
    #[inline(always)]
    pub(super) fn sample_segment(
        &self,
        (interior, wavelengths): (Interior, Option<&Wavelengths>),
        start: Start<'_>,
        throughput: Rgb,
        light_position: Option<Vec3>,
        u: [f32; 2],
        list: &mut Vec<MediumSegment>,
    ) -> MediumSegment {
        let mut segment =
            self.sample_segment_in((interior.medium(), wavelengths), start, throughput, light_position, u);
        if self.scene.features.overlaps {
            self.sample_overlapping_segments(
                &mut segment,
                (interior, wavelengths),
                start,
                throughput,
                u,
                list,
            );
        }
        segment
    }

    #[inline]
    fn sample_segment_in(
        &self,
        (medium, wavelengths): (u16, Option<&Wavelengths>),
        (ray, from): Start<'_>,
        throughput: Rgb,
        light_position: Option<Vec3>,
        u: [f32; 2],
    ) -> MediumSegment {
        match &self.scene.media[usize::from(medium)].scattering {
            Some(s) => {
                let scattering = (medium, &*s.at_wavelengths(wavelengths), wavelengths);
                MediumSegment::sample(
                    scattering,
                    (ray.origin, ray.direction),
                    from,
                    throughput,
                    light_position,
                    u,
                )
            }
            None => MediumSegment::unscattered(medium, [from, f32::INFINITY]),
        }
    }

    /// Samples segments in overlapping media and swaps `nearest` for the one that ends first, where all others end too.
    #[cold]
    fn sample_overlapping_segments(
        &self,
        nearest: &mut MediumSegment,
        (interior, wavelengths): (Interior, Option<&Wavelengths>),
        start: Start<'_>,
        throughput: Rgb,
        u: [f32; 2],
        list: &mut Vec<MediumSegment>,
    ) {
        let first = list.len();
        for medium in interior.overlapping(&self.scene.media) {
            let other = self.sample_segment_in(
                (medium, wavelengths),
                start,
                throughput,
                None,
                random_numbers_of(medium, u),
            );
            let farther =
                if other.scatter_t < nearest.scatter_t { std::mem::replace(nearest, other) } else { other };
            list.push(farther);
        }
        for farther in &mut list[first..] {
            farther.scatter_t = nearest.scatter_t;
        }
        nearest.overlapping = [first as u32, list.len() as u32];
    }

    /// The weight of passing of path `i`'s segments in overlapping media.
    #[inline]
    pub(super) fn overlapping_passing_weight(&self, i: usize, to: f32, w: &Workspace) -> Rgb {
        if w.medium_segments[i].is_alone() {
            Rgb::ONE
        } else {
            self.product_of_passing_weights(overlapping(&w.medium_segments[i], w), i, to, w)
        }
    }

    /// The product of the weights of passing of some segments of path `i`.
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

    /// [`Integrator::pass_media`] in overlapping media.
    #[cold]
    pub(super) fn pass_overlapping_media(&self, bounce: u32, i: usize, to: f32, w: &mut Workspace) -> Rgb {
        let segments =
            [w.medium_segments[i]].into_iter().chain(overlapping(&w.medium_segments[i], w).copied());
        let segments: Vec<MediumSegment> = segments.collect();
        for k in 0..segments.len() {
            if let Some(scattering) = &self.scene.media[usize::from(segments[k].medium)].scattering
                && scattering.emission.max_element() > 0.0
            {
                let value = self.overlapping_emission(scattering, (&segments, k), (bounce, i), to, w);
                self.add_medium_emission(bounce, i, value, w);
            }
        }
        self.product_of_passing_weights(segments.iter(), i, to, w)
    }

    /// The emission of one of several overlapping media, attenuated by the others.
    fn overlapping_emission(
        &self,
        scattering: &Scattering,
        (segments, k): (&[MediumSegment], usize),
        (bounce, i): (u32, usize),
        to: f32,
        w: &Workspace,
    ) -> Rgb {
        let wavelengths = w.wavelengths(i);
        let scattering = &*scattering.at_wavelengths(wavelengths);
        let (segment, salt) = (
            &segments[k],
            hash32(RandomChoice::OverlappingEmission { medium: k as u32 }.hash(&w.arriving.state, i, bounce)),
        );
        let others =
            || segments.iter().enumerate().filter(|&(other, _)| other != k).map(|(_, segment)| segment);
        let is_clear = |other: &MediumSegment| {
            let medium = &self.scene.media[usize::from(other.medium)];
            medium.scattering.as_ref().is_some_and(|s| other.is_unweighted(&s.at_wavelengths(wavelengths)))
        };
        if others().all(is_clear) {
            return self.segment_emission(segment, scattering, i, (to, salt), None, w);
        }
        let factor = |t: f32| self.product_of_passing_weights(others(), i, t, w);
        self.segment_emission(segment, scattering, i, (to, salt), Some(&factor), w)
    }

    /// Transmittance of overlapping media between two points of a ray.
    #[cold]
    pub(super) fn overlapping_transmittance(
        &self,
        interior: Interior,
        ray: (Vec3, Vec3),
        span: [f32; 2],
        wavelengths: Option<&Wavelengths>,
    ) -> Rgb {
        interior.overlapping(&self.scene.media).fold(Rgb::ONE, |left, medium| {
            // The salt is 0 for the medium around the scene, which has no grid and needs no random numbers.
            left * self.transmittance_in(medium, ray, span, wavelengths, u32::from(medium))
        })
    }
}

/// The segments in media that overlap a segment's.
fn overlapping<'a>(
    segment: &MediumSegment,
    w: &'a Workspace,
) -> impl Iterator<Item = &'a MediumSegment> + use<'a> {
    w.overlapping_segments[segment.overlapping[0] as usize..segment.overlapping[1] as usize].iter()
}

/// Random numbers for a segment in an overlapping medium.
fn random_numbers_of(medium: u16, [distance, kind]: [f32; 2]) -> [f32; 2] {
    let salt = hash32(u32::from(medium) ^ hash32(distance.to_bits() ^ hash32(kind.to_bits())));
    [unit(salt), unit(hash32(salt))]
}
