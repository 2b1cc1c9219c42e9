//! Ray kinds, light linking and holdouts: visibility of objects and lights by ray kind and receiver.
//!
//! The lobe that scatters a path determines the kind of its next ray. At surfaces with several lobes, a kind is sampled in proportion to
//! its fraction of the BSDF's value. Where visibility or materials depend on the kind, throughput is that of the lobes of this kind, so
//! that each kind alone is unbiased. If the kind only counts for bounce limits, throughput is that of all lobes, as in Cycles: that has
//! less noise, since paths differ by kind only where a limit ends them.
//!
//! The occlusion of sampled lights is determined by the same set of objects for light sampling and BSDF sampling: for diffuse reflection
//! and media the objects visible to shadow rays, for glossy reflection and transmission those visible to glossy and transmission rays. So
//! a diffuse ray that passed an object visible to shadow rays adds no sampled light behind it, and a light sample that passed an object
//! visible to diffuse rays has MIS weight 1, since diffuse rays can't reach the light. For environments without light sampling, the
//! visibility to the scattered ray counts.
//!
//! Light linking: the receiver is the last vertex of a path, for light samples and for hits of the next ray. Lights are selected among
//! those linked to the receiver's class. If blockers of a light are named, its shadow rays pass all other objects. Scattered rays would
//! be occluded differently, so they don't add such light; camera and specular rays do.

use super::Integrator;
use super::radiance_buffer::PathClass;
use super::sampling::RandomChoice;
use super::shading_geometry::{PathOrigin, local_viewer};
use super::shading_groups::{
    Closure, GeneralClass, LambertClass, MediumClass, MetalRoughClass, SortedVertices, VertexClass,
};
use super::wave::{FirstBounce, LightLanes, Paths, Vertices, WAVE, Wave, get, get_rgb, set_rgb};
use super::workspace::Workspace;
use crate::bsdf::Bsdf;
use crate::color::Rgb;
use crate::compile::CompiledMaterial;
use crate::math::{Frame, Hit, Vec3};
use crate::scene::{LightLinks, Link, RayKinds};
use crate::simd::{Kernel, dispatch};
use std::ops::Range;

/// Pdf of a path's direction, 1/sr, below which bevels are left out, as in Cycles, where all directions of a path count.
const MIN_PDF_OF_BEVELS: f32 = 8.0;

/// Ray kinds of light samples: shadow rays end at objects visible to all of these kinds.
pub(super) const LIGHT_SAMPLE_KINDS: RayKinds =
    RayKinds::SHADOW.with(RayKinds::GLOSSY).with(RayKinds::TRANSMISSION);

/// Light samples scattered by lobes of ray kind `kind` are occluded by objects visible to the returned kind.
fn occluder_kind(kind: RayKinds) -> RayKinds {
    if kind == RayKinds::DIFFUSE || kind == RayKinds::VOLUME { RayKinds::SHADOW } else { kind }
}

impl Integrator<'_> {
    #[inline(always)]
    pub(super) fn kind(&self, bounce: u32, i: usize, arriving: &Paths) -> RayKinds {
        match bounce {
            0 => RayKinds::CAMERA,
            _ if self.optional.visibility => arriving.visibility[i].kind(),
            // Without this state, visibility differs for camera rays only.
            _ => RayKinds::DIFFUSE,
        }
    }

    /// Properties of arriving path `i` for node graphs.
    pub(super) fn path_origin(&self, bounce: u32, i: usize, arriving: &Paths) -> PathOrigin {
        let path = &arriving.state;
        PathOrigin {
            kinds: self.kind(bounce, i, arriving),
            is_singular: bounce > 0 && !path.pdf[i].competes(),
            bounces: bounce.min(u32::from(u16::MAX)) as u16,
            sample: Some(path.sobol_point(i)),
            is_sharp: !path.pdf[i].competes() || path.pdf[i].value() >= MIN_PDF_OF_BEVELS,
        }
    }

    /// Records that an arriving path passed an object visible to the ray kinds `visible_to` only.
    pub(super) fn record_invisible(&self, i: usize, visible_to: RayKinds, arriving: &mut Paths) {
        if self.optional.visibility && visible_to.contains(occluder_kind(arriving.visibility[i].kind())) {
            arriving.visibility[i] = arriving.visibility[i].shadowed();
        }
    }

    /// Has arriving path `i` passed an object that occludes the competing light samples?
    #[inline(always)]
    pub(super) fn is_shadowed(&self, i: usize, arriving: &Paths) -> bool {
        self.optional.visibility && arriving.visibility[i].is_shadowed() && arriving.state.pdf[i].competes()
    }

    /// Is light `index` visible to the ray of arriving path `i`?
    pub(super) fn sees_light(&self, bounce: u32, i: usize, index: u32, arriving: &Paths) -> bool {
        let kinds = self.scene.ray_kinds_of_light(index);
        let links = self.scene.links.of_light(index);
        kinds.contains(self.kind(bounce, i, arriving))
            && !self.is_shadowed(i, arriving)
            && self.is_linked_emission(bounce, i, links, arriving)
    }

    /// Samples the kinds of the next rays of paths.
    pub(super) fn choose_ray_kinds(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        let Workspace { wave, bsdfs, .. } = w;
        dispatch(DiffuseFractions { wave, range: sorted.metal_rough() });
        for i in sorted.all() {
            if sorted.medium().contains(&i) {
                let visibility = &mut wave.paths.visibility[i];
                *visibility = visibility.with_kind(RayKinds::VOLUME);
                continue;
            }
            let first = self.next_scattering(sorted, wave, bsdfs, i);
            let paths = &mut wave.paths;
            let separates_lobes = self.scene.features.ray_kinds;
            let is_diffuse = select_diffuse(first, (bounce, i), paths, separates_lobes);
            let kind = match (first.is_transmission, is_diffuse) {
                (true, _) => RayKinds::TRANSMISSION,
                (false, true) => RayKinds::DIFFUSE,
                (false, false) => RayKinds::GLOSSY,
            };
            paths.visibility[i] = paths.visibility[i].with_kind(kind);
            if bounce == 0 && self.optional.first_bounces && !first.is_transmission && separates_lobes {
                let diffuse = if is_diffuse { Rgb::ONE } else { Rgb::ZERO };
                paths.first_bounces.set(i, FirstBounce { diffuse, ..first });
            }
        }
    }

    /// Factor on the unoccluded light sample of vertex `i`: the fraction of the BSDF value of lobes to which the light is visible. `passed`
    /// are the ray kinds to which objects passed by the shadow ray are visible.
    pub(super) fn visible_fraction(
        &self,
        (bounce, i): (u32, usize),
        passed: RayKinds,
        sorted: &SortedVertices,
        wave: &Wave,
        bsdfs: &[Bsdf],
    ) -> Rgb {
        let v = &wave.vertices;
        let light = self.only_light.unwrap_or(v.light.index[i]);
        let (kinds, links) = (self.scene.ray_kinds_of_light(light), self.scene.links.of_light(light));
        if passed == RayKinds::NONE && kinds == RayKinds::ALL && links.blockers.is_all() {
            return Rgb::ONE;
        }
        // Undoes the MIS weight, where scattered rays can't reach the light.
        let without_mis = match passed {
            RayKinds::NONE if links.blockers.is_all() => 1.0,
            _ => 1.0 / self.light_sample_mis_weight(bounce, sorted, wave, bsdfs, i).max(f32::MIN_POSITIVE),
        };
        let of = |kind: RayKinds, fraction: Rgb| {
            let is_light_sampled_only = passed.contains(kind) || !links.blockers.is_all();
            let weight = if is_light_sampled_only { without_mis } else { 1.0 };
            let arrives = kinds.contains(kind) && !passed.contains(occluder_kind(kind));
            if arrives { fraction * weight } else { Rgb::ZERO }
        };
        if sorted.medium().contains(&i) {
            return of(RayKinds::VOLUME, Rgb::ONE);
        }
        let found = self.scattering(sorted, v, bsdfs, i, get(&v.light.wi, i));
        match found.is_transmission {
            true => of(RayKinds::TRANSMISSION, Rgb::ONE),
            false => of(RayKinds::DIFFUSE, found.diffuse) + of(RayKinds::GLOSSY, Rgb::ONE - found.diffuse),
        }
    }

    /// The MIS weight of the light sample of a vertex.
    pub(super) fn light_sample_mis_weight(
        &self,
        bounce: u32,
        sorted: &SortedVertices,
        wave: &Wave,
        bsdfs: &[Bsdf],
        i: usize,
    ) -> f32 {
        let v = &wave.vertices;
        let (wi, light_pdf) = (get(&v.light.wi, i), v.light.pdf[i]);
        if light_pdf.is_delta() {
            return 1.0;
        }
        let pdf = if sorted.lambert().contains(&i) {
            LambertClass.closure(v, i).eval(wi).pdf_solid_angle * self.light_pdf_factor(v, i)
        } else if sorted.metal_rough().contains(&i) {
            MetalRoughClass.closure(v, i).eval(wi).pdf_solid_angle * self.light_pdf_factor(v, i)
        } else if sorted.medium().contains(&i) {
            MediumClass.closure(v, i).eval(wi).pdf_solid_angle
        } else {
            let class = GeneralClass { bsdfs, first: sorted.general().start };
            class.closure(v, i).eval(wi).pdf_solid_angle
        };
        light_pdf.mis_weight(pdf * self.bsdf_samples_per_light_sample(bounce))
    }

    /// Removes escaped paths to whose rays the environment is not visible.
    pub(super) fn keep_visible_escapes(&self, bounce: u32, w: &mut Workspace) {
        let Workspace { escaped, arriving, .. } = w;
        let seen = self.scene.features.environment_visible_to;
        let is_sampled = self.scene.lights.samples_environment();
        escaped.retain(|&i| {
            let i = i as usize;
            let is_shadowed = is_sampled && self.is_shadowed(i, arriving);
            seen.contains(self.kind(bounce, i, arriving)) && !is_shadowed
        });
    }

    /// Finds camera rays that hit holdouts or shadow catchers; holdouts end paths.
    pub(super) fn find_holdouts_and_catchers(&self, w: &mut Workspace) {
        w.holdout_samples.clear();
        if self.scene.features.holdouts {
            self.cut_out_holdouts(w);
        }
        if self.has_shadow_catchers() && !w.excludes_casters {
            self.find_catchers(w);
        }
    }

    /// Ends the paths of camera rays that hit holdouts.
    fn cut_out_holdouts(&self, w: &mut Workspace) {
        for i in 0..w.hits.len() {
            let material = &self.scene.materials[w.materials[i] as usize];
            if w.hits[i].is_hit() && material.surface_visibility.is_some_and(|p| p.is_holdout) {
                if self.scene.features.scattering {
                    // Adds the emission of media in front of the holdout.
                    self.pass_media(0, i, w.hits[i].t, w);
                }
                w.holdout_samples.push(w.arriving.state.radiance_index[i]);
                w.hits[i] = Hit::MISS;
                w.materials[i] = 0;
                set_rgb(&mut w.arriving.state.throughput, i, Rgb::ZERO);
            }
        }
    }

    /// Sets the alpha of samples that hit holdouts and shadow catchers to 0.
    pub(super) fn clear_alpha(&self, w: &mut Workspace) {
        for &sample in &w.holdout_samples {
            w.radiance_buffer.set_transparent(sample);
        }
    }
}

/// Selects the diffuse or the other lobes of path `i`; true for diffuse. With `separates_lobes`, throughput becomes that of the selected
/// lobes over the probability.
fn select_diffuse(
    first: FirstBounce,
    (bounce, i): (u32, usize),
    paths: &mut Paths,
    separates_lobes: bool,
) -> bool {
    let throughput = get_rgb(&paths.state.throughput, i);
    let part = throughput * first.diffuse;
    let (part_sum, sum) = (part.r + part.g + part.b, throughput.r + throughput.g + throughput.b);
    let probability = if sum > 0.0 { part_sum / sum } else { 1.0 };
    if first.is_transmission || probability <= 0.0 {
        return false;
    }
    if probability >= 1.0 {
        return true;
    }
    let path = &mut paths.state;
    let is_diffuse = RandomChoice::RayKind.uniform(path, i, bounce) < probability;
    if !separates_lobes {
        return is_diffuse;
    }
    let rest = match is_diffuse {
        true => part / probability,
        false => (throughput - part) / (1.0 - probability),
    };
    set_rgb(&mut path.throughput, i, rest);
    is_diffuse
}

/// The receiver class of the last vertex of path `i`.
#[inline(always)]
pub(super) fn receiver_class(i: usize, paths: &Paths, are_linked: bool) -> u32 {
    if are_linked { paths.visibility[i].receiver_class() } else { 0 }
}

impl Integrator<'_> {
    /// Sets the receiver class of vertex `k` of arriving path `i`.
    pub(super) fn record_receiver_class(&self, i: usize, k: usize, w: &mut Workspace) {
        let class = if w.hits[i].is_hit() { self.scene.links.class_of(w.materials[i]) } else { 0 };
        let visibility = &mut w.wave.paths.visibility[k];
        *visibility = visibility.with_receiver_class(class);
    }

    /// Do these links let emission hit by arriving path `i` light the path's last vertex?
    pub(super) fn is_linked_emission(
        &self,
        bounce: u32,
        i: usize,
        links: LightLinks,
        arriving: &Paths,
    ) -> bool {
        if bounce == 0 || links == LightLinks::ALL {
            return true;
        }
        let is_left_to_samples = !links.blockers.is_all() && arriving.state.pdf[i].competes();
        !is_left_to_samples && self.scene.links.reach(links, receiver_class(i, arriving, true))
    }

    /// The light links of a material's emission. Blockers apply to light-sampled emission only.
    pub(super) fn links_of(&self, material: &CompiledMaterial, is_sampled: bool) -> LightLinks {
        match (self.scene.features.links, is_sampled) {
            (false, _) => LightLinks::ALL,
            (true, true) => material.links(),
            (true, false) => LightLinks { blockers: Link::All, ..material.links() },
        }
    }

    /// Is the sampled light of vertex `i` linked to the vertex, and not excluded as a shadow caster?
    pub(super) fn is_linked_to_light(&self, i: usize, w: &Workspace) -> bool {
        let index = self.only_light.unwrap_or(w.wave.vertices.light.index[i]);
        let is_excluded = w.excludes_casters && self.scene.is_caster_light(index);
        let class = receiver_class(i, &w.wave.paths, self.scene.features.links);
        !is_excluded && self.scene.links.reach(self.scene.links.of_light(index), class)
    }

    /// Does light linking exclude the object hit by a vertex's shadow ray from the blockers of the sampled light?
    #[inline(always)]
    pub(super) fn is_not_a_blocker(&self, vertex: u32, hit: &Hit, light: &LightLanes) -> bool {
        self.scene.features.links && {
            let index = self.only_light.unwrap_or_else(|| light.index[vertex as usize]);
            let links = self.scene.links.of_light(index);
            !self.scene.links.block(links, self.scene.geometries.material(hit))
        }
    }
}

/// `part` over `whole` per channel, clamped to 0..1.
fn clamped_ratio(part: Rgb, whole: Rgb) -> Rgb {
    let (part, whole) = (part.to_array(), whole.to_array());
    let of = |c: usize| {
        let ratio = part[c] / whole[c];
        // 0 / 0 is NaN.
        if ratio > 0.0 { ratio.min(1.0) } else { 0.0 }
    };
    Rgb::from_array([of(0), of(1), of(2)])
}

/// Computes the diffuse fraction of opaque glTF materials for the sampled direction: first three scratch arrays.
struct DiffuseFractions<'a> {
    wave: &'a mut Wave,
    range: Range<usize>,
}

impl Kernel for DiffuseFractions<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { vertices: v, scratch: [r, g, b, ..], .. } = self.wave;
        for i in self.range.start..self.range.end.min(WAVE) {
            let fraction = MetalRoughClass.closure(v, i).diffuse_fraction(get(&v.next_direction, i));
            [r[i], g[i], b[i]] = fraction.to_array();
        }
    }
}

impl FirstBounce {
    /// For a BSDF with shading normal `ns` and geometric normal `ng`, without specular lobes.
    pub fn of(bsdf: &Bsdf, [ns, ng]: [Vec3; 2], wo: Vec3, wi: Vec3) -> FirstBounce {
        let frame = Frame::from_normal(ns);
        // Subsurface scattering is diffuse reflection on the whole.
        let is_transmission = wi.dot(ng) * wo.dot(ng) < 0.0 && !bsdf.has_subsurface();
        let (wo, wi) = (local_viewer(&frame, wo, ng), frame.to_local(wi));
        FirstBounce {
            diffuse: clamped_ratio(bsdf.diffuse_part(wo, wi), bsdf.eval(wo, wi).f_cos),
            is_transmission,
        }
    }
}

impl Integrator<'_> {
    /// Diffuse fraction of the BSDF of vertex `i` for light from `wi`, without specular lobes, and whether `wi` crosses the surface.
    pub(super) fn scattering(
        &self,
        sorted: &SortedVertices,
        v: &Vertices,
        bsdfs: &[Bsdf],
        i: usize,
        wi: Vec3,
    ) -> FirstBounce {
        // Media count as diffuse.
        if sorted.lambert().contains(&i) || sorted.medium().contains(&i) {
            return FirstBounce::DIFFUSE;
        }
        if sorted.metal_rough().contains(&i) {
            let diffuse = MetalRoughClass.closure(v, i).diffuse_fraction(wi);
            return FirstBounce { diffuse, is_transmission: false };
        }
        let bsdf = &bsdfs[i - sorted.general().start];
        FirstBounce::of(bsdf, [get(&v.ns, i), get(&v.ng, i)], get(&v.wo, i), wi)
    }

    /// The path class, for light passes, of the light sample of vertex `i`.
    pub(super) fn class_of_light_sample(
        &self,
        bounce: u32,
        sorted: &SortedVertices,
        wave: &Wave,
        bsdfs: &[Bsdf],
        i: usize,
    ) -> PathClass {
        let Wave { paths, vertices: v, .. } = wave;
        if bounce > 0 {
            return PathClass::Indirect(paths.first_bounces.get(i));
        }
        PathClass::Direct(self.scattering(sorted, v, bsdfs, i, get(&v.light.wi, i)))
    }

    /// Records the first bounces of paths.
    pub(super) fn record_first_bounces(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let Workspace { wave, bsdfs, .. } = w;
        dispatch(DiffuseFractions { wave, range: sorted.metal_rough() });
        for i in sorted.all() {
            let first = self.next_scattering(sorted, wave, bsdfs, i);
            wave.paths.first_bounces.set(i, first);
        }
    }

    /// [`Integrator::scattering`] for the sampled direction, after [`DiffuseFractions`]; specular lobes included, which are not diffuse.
    fn next_scattering(&self, sorted: &SortedVertices, wave: &Wave, bsdfs: &[Bsdf], i: usize) -> FirstBounce {
        let Wave { paths, vertices: v, scratch: [r, g, b, ..] } = wave;
        let first = match sorted.metal_rough().contains(&i) {
            true => FirstBounce { diffuse: Rgb::new(r[i], g[i], b[i]), is_transmission: false },
            false => self.scattering(sorted, v, bsdfs, i, get(&v.next_direction, i)),
        };
        match paths.state.pdf[i].is_specular() {
            true => FirstBounce { diffuse: Rgb::ZERO, ..first },
            false => first,
        }
    }
}
