//! Surfaces that rays pass unscattered: alpha, one-sided surfaces, invisible objects, thin glass, clear glass and shadow catchers.
//!
//! Alpha is stochastic for paths, which is unbiased, and attenuates shadow rays. All rays pass emitters that cast no shadow, and add their emission.
//! Rays from behind pass one-sided surfaces; shadow rays start on the path's side, so that they and scattered rays hit the same surfaces.
//!
//! Thin glass: smooth thin sheets transmit light without deviation, so shadow rays pass them, attenuated. To count no light twice, a
//! scattered ray that competes with light sampling (pdf above 0) passes the sheet with a probability and keeps its origin and pdf, for
//! the usual MIS weights of lights behind; else it scatters by the BSDF without the straight transmission. Rays that don't compete (camera
//! rays, specular directions) scatter at sheets as at all surfaces.

use super::Integrator;
use super::interior::CameraInterior;
use super::pane_refraction::{ShadowCrossings, behind_pane};
use super::sampling::{Purpose, RandomChoice};
use super::shading_geometry::{EvaluatedMaterial, HitPoint, PathOrigin, scattering_normal};
use super::shading_groups::SortedVertices;
use super::stages::Stages;
use super::visibility::LIGHT_SAMPLE_KINDS;
use super::wave::{
    LightLanes, OptionalState, PathState, Paths, Vertices, Wave, get, get_rgb, scale_rgb, set_rgb,
};
use super::workspace::{SampleTimes, Workspace};
use crate::bsdf::Bsdf;
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::{Alpha, CompiledMaterial, color_at_wavelengths};
use crate::math::{Frame, Hit, Ray, Vec3};
use crate::sampling::sampler::Dimensions;
use crate::scene::RayKinds;
use crate::shape::Surface;
use crate::texture::PointReader;

/// Maximum number of surfaces that a ray passes.
const MAX_PASSED_SURFACES: u32 = 4096;

/// Transmittance, by alpha, below which surfaces stop some shadow rays instead of attenuating all.
const MIN_TRANSMITTANCE: f32 = 0.1;

/// The random number that is compared with the alpha of a surface on the ray of path `i`: stratified for the first two surfaces.
fn alpha_number(surface: u32, (path, i): (&PathState, usize), bounce: u32, dimensions: &Dimensions) -> f32 {
    if surface > 1 {
        return RandomChoice::Alpha { surface }.uniform(path, i, bounce);
    }
    let [_, _, first, second] = path.sobol_point(i).sample_4d(dimensions);
    if surface == 0 { first } else { second }
}

impl Integrator<'_> {
    /// Replaces hits of surfaces that rays pass by the next hit where the ray stops, and finds the materials of all hits.
    pub(super) fn pass_through_surfaces(&self, bounce: u32, w: &mut Workspace) {
        self.find_materials(w);
        for pass in 0..MAX_PASSED_SURFACES {
            self.find_passing(bounce, pass, w);
            if w.pending.is_empty() {
                return;
            }
            self.add_passed_emission(bounce, w);
            if self.scene.features.boundaries {
                self.cross_boundaries(bounce, pass, w);
            }
            let Workspace {
                pending,
                pending_rays,
                pending_hits,
                rays,
                hits,
                materials,
                arriving,
                times,
                crossings,
                ..
            } = &mut *w;
            let sample = |&i: &u32| arriving.state.radiance_index[i as usize];
            let mut coincident = Vec::new();
            pending_rays.clear();
            pending_rays.extend(pending.iter().enumerate().map(|(k, &i)| {
                let time = times.of(sample(&i));
                let i = i as usize;
                if let Some(next) = behind_pane(i, crossings) {
                    rays[i] = next;
                } else if self.advance_past(&mut rays[i], &hits[i], time) {
                    coincident.push((k, hits[i], time));
                }
                rays[i]
            }));
            self.intersect_past(
                (times, pending.iter().map(sample)),
                pending_rays,
                &mut coincident,
                pending_hits,
            );
            for (&i, &hit) in pending.iter().zip(&*pending_hits) {
                hits[i as usize] = hit;
                materials[i as usize] = if hit.is_hit() { self.scene.geometries.material(&hit) } else { 0 };
            }
            w.ray_counts.all += w.pending.len() as u64;
        }
    }

    /// Retains the pending rays that pass the surface they hit.
    fn find_passing(&self, bounce: u32, pass: u32, w: &mut Workspace) {
        let Workspace { pending, rays, hits, arriving, excludes_casters, times, crossings, .. } = w;
        let dimensions = self.dimensions(bounce, Purpose::Mix);
        pending.retain(|&i| {
            let i = i as usize;
            if self.is_excluded(*excludes_casters, &hits[i]) {
                return true;
            }
            let path = &arriving.state;
            let time = times.of(path.radiance_index[i]);
            let is_present =
                |_: &CompiledMaterial, opacity| alpha_number(pass, (path, i), bounce, &dimensions) < opacity;
            let origin = self.path_origin(bounce, i, arriving);
            match self.response(&rays[i], &hits[i], time, origin, is_present) {
                HitResponse::Stops => {
                    let (at, crossing) = ((bounce, i), (&rays[i], &hits[i], time));
                    let waves = times.wavelengths(arriving.state.radiance_index[i]);
                    let interior = arriving.interior[i];
                    let path = &mut arriving.state;
                    self.passes_thin_glass(at, crossing, pass, waves, path)
                        || self.passes_pane(at, crossing, pass, (path, interior), (crossings, waves))
                }
                HitResponse::Passes => {
                    if self.counts_as_transparent(&hits[i]) {
                        if arriving.transparent_count[i] >= self.options.bounces.transparent {
                            set_rgb(&mut arriving.state.throughput, i, Rgb::ZERO);
                            return false;
                        }
                        arriving.transparent_count[i] += 1;
                    }
                    let path = &arriving.state;
                    let waves = times.wavelengths(path.radiance_index[i]);
                    if let Some(color) = self.transparent_color((&rays[i], &hits[i], time), origin, waves) {
                        scale_rgb(&mut arriving.state.throughput, i, color);
                    }
                    true
                }
                HitResponse::PassesInvisible(visible_to) => {
                    self.record_invisible(i, visible_to, arriving);
                    true
                }
            }
        });
    }

    /// Does passing this surface count towards the limit of transparent surfaces, if there is a limit?
    #[inline(always)]
    fn counts_as_transparent(&self, hit: &Hit) -> bool {
        self.optional.transparent_count
            && self.scene.materials[self.scene.geometries.material(hit) as usize].is_transparent()
    }

    /// Finds the materials of all hits; hits that rays may pass become pending.
    fn find_materials(&self, w: &mut Workspace) {
        let pass_through_materials = self.pass_through_materials(w.excludes_casters);
        w.pending.clear();
        w.materials.clear();
        for (i, hit) in w.hits.iter().enumerate() {
            let mut material = 0;
            if hit.is_hit() {
                material = self.scene.geometries.material(hit);
                if pass_through_materials[material as usize] {
                    w.pending.push(i as u32);
                }
            }
            w.materials.push(material);
        }
    }

    /// Adds the emission of surfaces that pending rays pass.
    fn add_passed_emission(&self, bounce: u32, w: &mut Workspace) {
        for k in 0..w.pending.len() {
            let i = w.pending[k] as usize;
            let hit = w.hits[i];
            if self.is_excluded(w.excludes_casters, &hit) {
                continue;
            }
            let material = &self.scene.materials[self.scene.geometries.material(&hit) as usize];
            let kind = self.kind(bounce, i, &w.arriving);
            if material.emission.is_none()
                || !material.surface_visibility.is_some_and(|p| !p.is_obstacle && p.visible_to.contains(kind))
            {
                continue;
            }
            let time = w.time(i);
            let surface = self.scene.geometries.surface(&w.rays[i], &hit, time);
            let is_back = surface.ng.dot(w.rays[i].direction) > 0.0;
            let throughput = get_rgb(&w.arriving.state.throughput, i);
            let transmittance = self.transmittance_to_hit(i, hit.t, w);
            set_rgb(&mut w.arriving.state.throughput, i, throughput * transmittance);
            let path = self.path_origin(bounce, i, &w.arriving);
            self.emit(bounce, i, &HitPoint { surface, hit, material, is_back, time, path }, w);
            set_rgb(&mut w.arriving.state.throughput, i, throughput);
        }
    }

    /// Tests the occlusion of shadow rays in scenes with surfaces that rays may pass.
    pub(super) fn test_shadow_rays_with_alpha(&self, bounce: u32, w: &mut Workspace) {
        self.find_possible_occluders(w);
        let Workspace { wave, shadow_rays, shadow_vertices, occluded, excludes_casters, times, .. } = w;
        let (pending, rays, pending_hits) = (&mut w.pending, &mut w.pending_rays, &mut w.pending_hits);
        let (shadow_segments, passed_kinds) = (&mut w.shadow_segments, &mut w.passed_kinds);
        let shadow_crossings = &mut w.shadow_crossings;
        let Wave { paths, vertices: Vertices { light, .. }, .. } = &mut **wave;
        let mut coincident: Vec<(usize, Hit, f32)> = Vec::new();
        let mut passes = 0..MAX_PASSED_SURFACES;
        let mut counts = vec![0; if self.optional.transparent_count { shadow_rays.len() } else { 0 }];
        while let Some(pass) = passes.next().filter(|_| !pending.is_empty()) {
            rays.clear();
            rays.extend(pending.iter().map(|&k| shadow_rays[k as usize]));
            let samples =
                pending.iter().map(|&k| paths.state.radiance_index[shadow_vertices[k as usize] as usize]);
            self.intersect_past((times, samples), rays, &mut coincident, pending_hits);
            w.ray_counts.all += pending.len() as u64;
            let (mut at, mut kept) = (0, 0);
            let mut advance_past = |ray: &mut Ray, hit: Hit, time: f32, behind_pane: Option<Ray>| {
                match behind_pane {
                    Some(next) => *ray = next,
                    None if self.advance_past(ray, &hit, time) => coincident.push((kept, hit, time)),
                    None => {}
                }
                kept += 1;
            };
            pending.retain(|&k| {
                let (hit, k) = (pending_hits[at], k as usize);
                at += 1;
                if !hit.is_hit() {
                    return false;
                }
                let i = shadow_vertices[k] as usize;
                let (path, time) = (&paths.state, times.of(paths.state.radiance_index[i]));
                if self.is_excluded(*excludes_casters, &hit) || self.is_not_a_blocker(i as u32, &hit, light) {
                    advance_past(&mut shadow_rays[k], hit, time, None);
                    return true;
                }
                let waves = times.wavelengths(path.radiance_index[i]);
                let (crossing, mut next) = ((&shadow_rays[k], &hit, time), None);
                let (response, transmittance) =
                    self.shadow_response(crossing, (bounce, pass, i), paths, counts.get_mut(k));
                if let HitResponse::Passes = response {
                    let color =
                        self.transparent_color(crossing, PathOrigin::of_kinds(LIGHT_SAMPLE_KINDS), waves);
                    scale_rgb(&mut light.contribution, i, color.unwrap_or(Rgb::ONE) * transmittance);
                }
                let passed = shadow_crossings.get_mut(k);
                let passes = || self.shadow_ray_passes_glass(i, crossing, (passed, &mut next), light, waves);
                if response.blocks(passes, passed_kinds.get_mut(k)) {
                    occluded[k] = true;
                    return false;
                }
                let segment = shadow_segments.get_mut(k);
                self.cross_with_shadow_ray(i, &shadow_rays[k], (&hit, time), segment, light, waves);
                advance_past(&mut shadow_rays[k], hit, time, next);
                true
            });
        }
    }

    /// The response of the shadow ray of vertex `i` to a hit, and the transmittance of a passed surface by its alpha. Counts transparent
    /// surfaces; the ray stops at the limit.
    fn shadow_response(
        &self,
        (ray, hit, time): (&Ray, &Hit, f32),
        (bounce, surface, i): (u32, u32, usize),
        paths: &Paths,
        count: Option<&mut u32>,
    ) -> (HitResponse, f32) {
        let mut transmittance = 1.0;
        let is_present = |material: &CompiledMaterial, opacity: f32| {
            let clear = 1.0 - opacity;
            // Opaque by chance: instead of a tiny transmittance, so that rays don't pass many surfaces in vain, and where only some kinds
            // of rays see the surface.
            let is_chance = clear <= 0.0 || material.surface_visibility.is_some();
            transmittance = if is_chance { 1.0 } else { clear.max(MIN_TRANSMITTANCE) };
            let probability = clear / transmittance;
            probability < 1.0
                && RandomChoice::ShadowAlpha { surface }.uniform(&paths.state, i, bounce) >= probability
        };
        let response = self.response(ray, hit, time, PathOrigin::of_kinds(LIGHT_SAMPLE_KINDS), is_present);
        if let (HitResponse::Passes, Some(count)) = (&response, count)
            && self.counts_as_transparent(hit)
        {
            *count += 1;
            if paths.transparent_count[i] + *count >= self.options.bounces.transparent {
                return (HitResponse::Stops, 1.0);
            }
        }
        (response, transmittance)
    }

    /// Tests shadow rays; those whose hit they may pass become pending.
    fn find_possible_occluders(&self, w: &mut Workspace) {
        let Workspace {
            wave,
            shadow_rays,
            shadow_vertices,
            occluded,
            ray_counts,
            excludes_casters,
            times,
            ..
        } = w;
        let (pending, pending_hits) = (&mut w.pending, &mut w.pending_hits);
        let sample = |&vertex: &u32| wave.paths.state.radiance_index[vertex as usize];
        if pending_hits.len() < shadow_rays.len() {
            pending_hits.resize(shadow_rays.len(), Hit::MISS);
        }
        times.any(&self.scene.accel, shadow_rays, shadow_vertices.iter().map(sample), pending_hits);
        ray_counts.all += shadow_rays.len() as u64;
        let pass_through_materials = self.pass_through_materials(*excludes_casters);
        // The common cases: no hit, or an opaque surface.
        pending.clear();
        for (k, (hit, occluded)) in pending_hits.iter().zip(&mut **occluded).enumerate() {
            let vertex = shadow_vertices[k];
            let is_front = || self.is_surely_front(&shadow_rays[k], hit, times.of(sample(&vertex)));
            let may_pass_through = || {
                pass_through_materials[self.scene.geometries.material(hit) as usize]
                    && (*excludes_casters || !is_front())
            };
            // A ray shifted by a pane may miss occluders behind it.
            let may_pass_through_at = hit.is_hit()
                && (self.scene.features.panes
                    || may_pass_through()
                    || self.is_not_a_blocker(vertex, hit, &wave.vertices.light));
            *occluded = hit.is_hit() && !may_pass_through_at;
            if may_pass_through_at {
                pending.push(k as u32);
            }
        }
    }

    /// Is this a front hit of a flat primitive that rays pass only from behind?
    #[inline(always)]
    fn is_surely_front(&self, ray: &Ray, hit: &Hit, time: f32) -> bool {
        let material = &self.scene.materials[self.scene.geometries.material(hit) as usize];
        material.alpha.is_none()
            && material.surface_visibility.is_none()
            && !material.is_transparent_to_shadow_rays
            && material.pane_thickness <= 0.0
            && !material.is_boundary
            && self.scene.geometries.is_back_of_flat(ray, hit, time) == Some(false)
    }

    /// Advances `t_min` of a ray past a surface; the origin, to which pdfs refer, stays. Returns whether there may be another surface at
    /// the same distance that only [`Integrator::intersect_past`] finds.
    ///
    /// Coincident surfaces behind the passed one must be hit: a sheet with different materials on its sides is often modelled as two
    /// one-sided surfaces, volumes of fog touch each other and stand on floors, and coincident surfaces may be visible to other ray kinds.
    /// Excluding the passed primitive finds two of many coincident surfaces; curved boundaries are not excluded.
    fn advance_past(&self, ray: &mut Ray, hit: &Hit, time: f32) -> bool {
        let material = &self.scene.materials[self.scene.geometries.material(hit) as usize];
        let is_for_some = material.visible_to() != RayKinds::ALL;
        let may_have_neighbours = material.is_boundary || material.is_single_sided || is_for_some;
        let is_back =
            if may_have_neighbours { self.scene.geometries.is_back_of_flat(ray, hit, time) } else { None };
        let has_neighbours = is_back.is_some_and(|is_back| is_back || material.is_boundary || is_for_some);
        let is_farther = hit.t > ray.t_min.next_up();
        if has_neighbours && is_farther {
            (ray.t_min, ray.origin_primitive) = (hit.t.next_down(), hit.into());
            return false;
        }
        let may_coincide = material.is_boundary && (has_neighbours || self.scene.features.overlaps);
        ray.t_min = hit.t;
        may_coincide
    }

    /// Finds the nearest hits of rays with the given samples; for the rays in `coincident` (index, last hit, time), the next of several
    /// coincident surfaces. Clears `coincident`.
    fn intersect_past(
        &self,
        (times, samples): (&mut SampleTimes, impl Iterator<Item = u32>),
        rays: &[Ray],
        coincident: &mut Vec<(usize, Hit, f32)>,
        hits: &mut Vec<Hit>,
    ) {
        hits.clear();
        hits.resize(rays.len(), Hit::MISS);
        times.closest(&self.scene.accel, rays, samples, hits);
        for (k, hit, time) in coincident.drain(..) {
            hits[k] = self.scene.accel.closest_after(&rays[k], &hit, time);
        }
    }

    /// The response of a ray to its hit; rays stop at misses. `is_present` decides by an alpha whether the surface is there.
    #[inline(always)]
    fn response(
        &self,
        ray: &Ray,
        hit: &Hit,
        time: f32,
        path: PathOrigin,
        is_present: impl FnMut(&CompiledMaterial, f32) -> bool,
    ) -> HitResponse {
        if !hit.is_hit() {
            return HitResponse::Stops;
        }
        let material = &self.scene.materials[self.scene.geometries.material(hit) as usize];
        let passes_through =
            material.is_boundary || material.is_single_sided && self.scene.geometries.is_back(ray, hit, time);
        let is_present = !passes_through && self.is_present(material, ray, hit, (time, path), is_present);
        match material.surface_visibility {
            _ if !is_present => HitResponse::Passes,
            None => HitResponse::Stops,
            Some(visibility) if !visibility.is_obstacle => HitResponse::Passes,
            Some(visibility) if visibility.visible_to.contains(path.kinds) => HitResponse::Stops,
            Some(visibility) => HitResponse::PassesInvisible(visibility.visible_to),
        }
    }

    /// Is the surface opaque for this ray, by its alpha?
    #[inline(always)]
    fn is_present(
        &self,
        material: &CompiledMaterial,
        ray: &Ray,
        hit: &Hit,
        (time, path): (f32, PathOrigin),
        mut is_present: impl FnMut(&CompiledMaterial, f32) -> bool,
    ) -> bool {
        material.alpha.is_none() || is_present(material, self.opacity(ray, hit, time, material, path))
    }

    /// The alpha of a surface at a hit of a ray.
    pub(super) fn opacity(
        &self,
        ray: &Ray,
        hit: &Hit,
        time: f32,
        material: &CompiledMaterial,
        path: PathOrigin,
    ) -> f32 {
        let read = |alpha: &Alpha, slots: &PointReader<'_>, of_vertex| alpha.opacity(slots, of_vertex);
        self.read_alpha((ray, hit, time), material, path, read).unwrap_or(1.0)
    }

    /// Transmission colour of rays that pass a surface by its alpha; `None` for white.
    fn transparent_color(
        &self,
        (ray, hit, time): (&Ray, &Hit, f32),
        path: PathOrigin,
        wavelengths: Option<&Wavelengths>,
    ) -> Option<Rgb> {
        let material = &self.scene.materials[self.scene.geometries.material(hit) as usize];
        let color = material.alpha.and_then(|alpha| alpha.transparent_color)?;
        let read = |_: &Alpha, slots: &PointReader<'_>, _| color_at_wavelengths(slots, &color, wavelengths);
        self.read_alpha((ray, hit, time), material, path, read)
    }

    /// Evaluates `read` with the alpha of a material, a texture reader at the hit, and the vertex alpha; `None` without alpha.
    fn read_alpha<R>(
        &self,
        (ray, hit, time): (&Ray, &Hit, f32),
        material: &CompiledMaterial,
        path: PathOrigin,
        read: impl FnOnce(&Alpha, &PointReader<'_>, f32) -> R,
    ) -> Option<R> {
        let alpha = material.alpha?;
        let surface: Surface = self.scene.geometries.surface(ray, hit, time);
        let at = self.scene.geometries.coordinates(&surface, hit, false, time);
        let vertex_alpha = if material.uses_vertex_colors { at.color[3] } else { 1.0 };
        // Directions of shadow rays have the length of the segment.
        let wo = if alpha.depends_on_viewer { -ray.direction.normalize() } else { Vec3::ZERO };
        let is_back = surface.ng.dot(ray.direction) > 0.0;
        let hit_point = HitPoint { surface, hit: *hit, material, is_back, time, path };
        let hit_data = self.hit_data(&hit_point, &at, wo);
        Some(read(&alpha, &self.slots(&at, &surface, wo, 0.0, hit_data.as_ref()), vertex_alpha))
    }
}

/// Response of a ray to a hit.
enum HitResponse {
    /// The ray stops.
    Stops,
    /// The ray passes the surface.
    Passes,
    /// The ray passes the surface, which is visible to other kinds of rays: these.
    PassesInvisible(RayKinds),
}

impl HitResponse {
    /// Does the surface occlude a light sample? For surfaces invisible to light samples, which don't, adds the kinds of rays to which they
    /// are visible to `passed`.
    fn blocks(self, passes_thin_glass: impl FnOnce() -> bool, passed: Option<&mut RayKinds>) -> bool {
        match self {
            HitResponse::Stops => !passes_thin_glass(),
            HitResponse::Passes => false,
            HitResponse::PassesInvisible(visible_to) => {
                if let Some(passed) = passed {
                    *passed = passed.with(visible_to);
                }
                false
            }
        }
    }
}

impl Integrator<'_> {
    /// Decides whether the ray of arriving path `i` passes thin glass at a hit, and if so weights the throughput; false at other surfaces.
    pub(super) fn passes_thin_glass(
        &self,
        (bounce, i): (u32, usize),
        (ray, hit, time): (&Ray, &Hit, f32),
        surface: u32,
        wavelengths: Option<&Wavelengths>,
        path: &mut PathState,
    ) -> bool {
        if !path.pdf[i].competes() {
            return false;
        }
        let passing = self.straight_transmittance((ray, hit, time), wavelengths);
        let probability = passing.max_element().min(1.0);
        // Zero at surfaces other than thin glass.
        let passes =
            probability > 0.0 && RandomChoice::ThinGlass { surface }.uniform(path, i, bounce) < probability;
        if passes {
            let throughput = get_rgb(&path.throughput, i);
            set_rgb(&mut path.throughput, i, throughput * passing / probability);
        }
        passes
    }

    /// The BSDF of thin glass for arriving path `i`, which did not pass: without straight transmission. Weights the throughput.
    pub(super) fn scatter_at_thin_glass(&self, bsdf: Bsdf, i: usize, w: &mut Workspace) -> Bsdf {
        let sample = w.arriving.state.radiance_index[i];
        let crossing = (&w.rays[i], &w.hits[i], w.times.of(sample));
        let stops = 1.0 - self.straight_transmittance(crossing, w.times.wavelengths(sample)).max_element();
        let throughput = &mut w.arriving.state.throughput;
        let value = get_rgb(throughput, i);
        set_rgb(throughput, i, if stops > 0.0 { value / stops } else { Rgb::ZERO });
        bsdf.without_straight()
    }

    /// Does the shadow ray of vertex `i` pass thin glass at a hit? If so, attenuates the contribution; false at other surfaces.
    pub(super) fn shadow_ray_passes_thin_glass(
        &self,
        i: usize,
        crossing: (&Ray, &Hit, f32),
        light: &mut LightLanes,
        wavelengths: Option<&Wavelengths>,
    ) -> bool {
        let contribution =
            get_rgb(&light.contribution, i) * self.straight_transmittance(crossing, wavelengths);
        let passes = contribution.max_element() > 0.0;
        if passes {
            set_rgb(&mut light.contribution, i, contribution);
        }
        passes
    }

    /// Does a shadow ray pass thin glass or a pane? Behind a pane, `next` is the continued ray.
    fn shadow_ray_passes_glass(
        &self,
        i: usize,
        crossing: (&Ray, &Hit, f32),
        (passed, next): (Option<&mut ShadowCrossings>, &mut Option<Ray>),
        light: &mut LightLanes,
        wavelengths: Option<&Wavelengths>,
    ) -> bool {
        *next = self.shadow_ray_passes_pane(i, crossing, passed, light, wavelengths);
        next.is_some() || self.shadow_ray_passes_thin_glass(i, crossing, light, wavelengths)
    }

    /// Straight transmittance of thin glass at a hit; 0 at other surfaces.
    fn straight_transmittance(
        &self,
        (ray, hit, time): (&Ray, &Hit, f32),
        wavelengths: Option<&Wavelengths>,
    ) -> Rgb {
        if !hit.is_hit() {
            return Rgb::ZERO;
        }
        let index = self.scene.geometries.material(hit);
        if !self.scene.materials[index as usize].is_transparent_to_shadow_rays {
            return Rgb::ZERO;
        }
        let wo = -ray.direction.normalize();
        let at = self.ray_hit_point(ray, *hit, index, time);
        // Unfiltered, as in light sampling.
        let EvaluatedMaterial { bsdf, ns, .. } = self.read_material(&at, 0.0, wo, wavelengths);
        let ns = scattering_normal(ns, at.surface.ng, wo);
        bsdf.straight(Frame::from_normal(ns).to_local(wo))
    }

    /// Sets the alpha of samples that hit holdouts and shadow catchers, and initialises the state of clear paths.
    pub(super) fn set_alpha(&self, sorted: &SortedVertices, w: &mut Workspace) {
        if !w.holdout_samples.is_empty() {
            self.clear_alpha(w);
        }
        if self.optional.only_clear_glass {
            self.start_clear(sorted, w);
        }
    }

    /// Marks the paths of opaque samples as clear: samples at holdouts and shadow catchers have an alpha already.
    fn start_clear(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let paths = &mut w.wave.paths;
        for i in sorted.all() {
            paths.only_clear_glass[i] =
                u32::from(w.radiance_buffer.is_covered(paths.state.radiance_index[i]));
        }
    }

    /// 1 / ior^2 of the medium around the camera, to undo the scaling of radiance by ior^2, which is not part of transmittance.
    fn outside_radiance_scale(&self) -> Rgb {
        let CameraInterior::Constant(interior) = self.camera_interior else { return Rgb::ONE };
        let iors = self.scene.media[usize::from(interior.medium())].iors.unwrap_or([1.0; 3]);
        Rgb::from_array(iors.map(|ior| 1.0 / (ior * ior)))
    }

    /// Updates which paths have passed only smooth transmission so far.
    pub(super) fn update_clear_paths(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let (paths, v) = (&mut w.wave.paths, &w.wave.vertices);
        let general = sorted.general();
        for i in sorted.all() {
            let (wo, wi, ng) = (get(&v.wo, i), get(&v.next_direction, i), get(&v.ng, i));
            let passes =
                general.contains(&i) && paths.state.pdf[i].is_specular() && wo.dot(ng) * wi.dot(ng) < 0.0;
            paths.only_clear_glass[i] &= u32::from(passes);
        }
    }

    /// Replaces the environment behind clear paths by transparency of the sample.
    pub(super) fn add_clear_background(&self, w: &mut Workspace) {
        let Workspace { escaped, arriving, radiance_buffer, .. } = w;
        let scale = self.outside_radiance_scale();
        escaped.retain(|&i| {
            let i = i as usize;
            let is_clear = arriving.only_clear_glass[i] != 0;
            if is_clear {
                let passed = get_rgb(&arriving.state.throughput, i) * scale;
                radiance_buffer.make_transparent(
                    arriving.state.radiance_index[i],
                    (passed.r + passed.g + passed.b) / 3.0,
                );
            }
            !is_clear
        });
    }

    /// Does the scene have shadow catchers, and are they rendered as such?
    pub(super) fn has_shadow_catchers(&self) -> bool {
        self.options.catchers && self.scene.features.catchers
    }

    /// Is the object at a hit excluded from the pass without shadow casters?
    #[inline(always)]
    pub(super) fn is_excluded(&self, excludes_casters: bool, hit: &Hit) -> bool {
        excludes_casters && hit.is_hit() && self.excluded[self.scene.geometries.material(hit) as usize]
    }

    /// By material: may rays pass surfaces in the current pass?
    #[inline(always)]
    pub(super) fn pass_through_materials(&self, excludes_casters: bool) -> &[bool] {
        if excludes_casters { &self.pass_through_or_excluded } else { &self.may_pass_through }
    }

    /// Saves the camera paths of a wave, for the pass without shadow casters.
    pub(super) fn save_camera_paths(&self, w: &mut Workspace) {
        let count = w.rays.len();
        let starts = w.camera_paths.get_or_insert_with(bytemuck::zeroed_box);
        for i in 0..count {
            w.arriving.copy_to(i, starts, i, OptionalState::ALL);
        }
        w.camera_rays.clone_from(&w.rays);
    }

    /// Finds the samples whose camera rays hit shadow catchers.
    pub(super) fn find_catchers(&self, w: &mut Workspace) {
        w.catcher_samples.clear();
        for (i, hit) in w.hits.iter().enumerate() {
            let material = &self.scene.materials[w.materials[i] as usize];
            if hit.is_hit() && material.surface_visibility.is_some_and(|p| p.is_catcher && !p.is_holdout) {
                w.catcher_samples.push(w.arriving.state.radiance_index[i]);
            }
        }
        w.holdout_samples.extend_from_slice(&w.catcher_samples);
    }

    /// Traces the samples at shadow catchers again without shadow casters, and records both radiances. False if `stop` interrupted it.
    pub(super) fn trace_without_casters(
        &self,
        stages: &Stages,
        w: &mut Workspace,
        stop: &dyn Fn() -> bool,
    ) -> bool {
        if w.catcher_samples.is_empty() {
            return true;
        }
        let samples = std::mem::take(&mut w.catcher_samples);
        let count = w.pixels.len();
        w.radiance_buffer.extend(2 * count);
        w.times.repeat();
        w.rays.clear();
        if let Some(starts) = &w.camera_paths {
            for (k, &sample) in samples.iter().enumerate() {
                starts.copy_to(sample as usize, &mut w.arriving, k, OptionalState::ALL);
                w.arriving.state.radiance_index[k] = sample + count as u32;
                w.rays.push(w.camera_rays[sample as usize]);
            }
        }
        w.excludes_casters = true;
        let is_done = self.trace_paths(stages, w, stop);
        w.excludes_casters = false;
        for &sample in &samples {
            let (with, without) =
                (w.radiance_buffer.radiance(sample), w.radiance_buffer.radiance(sample + count as u32));
            w.radiance_buffer.set_catcher(sample, with, without);
        }
        w.catcher_samples = samples;
        is_done
    }
}
