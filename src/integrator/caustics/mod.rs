//! Caustics by light tracing (Arvo 1986, "Backward Ray Tracing"; Dutre, Lafortune, Willems 1993): light paths over smooth glass,
//! mirrors and polished metal to other surfaces, connected to the camera. Camera paths rarely hit the lights of such paths, and
//! never point and directional lights.
//!
//! With E the camera, D a receiver ([`CausticRole::Receiver`](crate::compile::CausticRole)), S a caster
//! ([`CausticRole::Caster`](crate::compile::CausticRole)) and L a light, light paths sample exactly the paths `E D (D|S)* S L`: they
//! connect to the camera at each receiver, and continue there. Camera paths exclude exactly these: each stores whether its first
//! surface was a D and all others were D or S (its *chain*), and whether the last one was an S. The caustic role is a property of the
//! material, independent of the side. The environment emits no light paths: camera paths sample it.
//!
//! At some receivers, light paths use only the diffuse lobes ([`CausticRole::DiffuseReceiver`](crate::compile::CausticRole)): the other
//! lobes are (or, with textures, may be) so narrow that connections to the camera are rarely within them. Light paths contribute the
//! product of the diffuse lobes' fractions of the BSDF over such vertices, camera paths the complement to 1.
//!
//! No camera path samples light from a point or directional light to a perfectly specular first surface. Such light paths continue at
//! every surface and connect to the camera at each that isn't specular.
//!
//! A light path carries flux: radiance times the cosine over the pdf of its start, times BSDFs. BSDFs are evaluated with the direction
//! towards the camera as `wo`, so that light and camera paths agree for BSDFs that aren't symmetric. Shading normals change measures
//! as in Veach 1997, "Robust Monte Carlo Methods for Light Transport Simulation", section 5.3. Perfectly specular BSDFs can't be
//! evaluated with another normal: where the shading normal would be bent for the camera path's direction, the path is left to camera
//! paths. Textures along light paths are unfiltered, since the footprint of the camera path is unknown.
//!
//! Path reuse between pixels ([`reuse`](super::reuse)) connects only prefixes that exclude the same light: see
//! [`Prefixes::ends`](super::reuse::Prefixes::ends).

mod light_paths;
mod plan;

pub use plan::{CausticPlan, CausticStats};

use super::Integrator;
use super::mis::LightPdf;
use super::shading_geometry::{PathOrigin, bent_normal};
use super::shading_groups::SortedVertices;
use super::wave::{Vertices, Wave, get, get_rgb, scale_rgb, set_rgb};
use super::workspace::Workspace;
use crate::color::Rgb;
use crate::compile::{CausticRole, SurfaceVisibility};
use crate::math::{Hit, Ray, Vec3};
use crate::sampling::hash::{hash32, unit};
use crate::scene::RayKinds;
use crate::shape::Surface;

// Camera paths exclude paths that light tracing samples. Bits of a camera path's chain: the two lowest are for the vertices before the
// current one, the next two for all vertices including the current one.

/// The vertices before the current one match `D (D|S)*`: the first was a receiver, all others receivers or casters.
const MATCHED: u32 = 1;
/// [`MATCHED`], and the last of these vertices was a caster.
const ENDED_IN_CASTER: u32 = 2;
/// Number of these bits.
const BITS: u32 = 2;
/// [`MATCHED`] and [`ENDED_IN_CASTER`] of the vertices up to and including the current one.
const MATCHES: u32 = MATCHED << BITS;
const ENDS_IN_CASTER: u32 = ENDED_IN_CASTER << BITS;
/// The current vertex is a receiver with its diffuse lobes only ([`CausticRole::DiffuseReceiver`]).
const IS_DIFFUSE_RECEIVER: u32 = 1 << (2 * BITS);

impl Integrator<'_> {
    /// Shifts the chain bits at the start of a bounce: the current vertex becomes the previous one.
    pub(super) fn shift_chains(&self, w: &mut Workspace) {
        if self.optional.caustic_chains {
            let arrive = |chain: &mut u32| *chain = *chain >> BITS & (MATCHED | ENDED_IN_CASTER);
            w.arriving.caustic_chains[..w.rays.len()].iter_mut().for_each(arrive);
        }
    }

    /// Updates the chains with the caustic roles of the hit materials.
    pub(super) fn update_chains(&self, bounce: u32, w: &mut Workspace) {
        let Some(plan) = self.options.caustics else { return };
        for (i, hit) in w.hits.iter().enumerate() {
            let role = if hit.is_hit() { plan.role(w.materials[i]) } else { CausticRole::Neither };
            let chain = &mut w.arriving.caustic_chains[i];
            let before = *chain & (MATCHED | ENDED_IN_CASTER);
            let continues = bounce == 0 || before != 0;
            *chain = match role {
                CausticRole::Receiver if continues => before | MATCHES,
                CausticRole::DiffuseReceiver if continues => before | MATCHES | IS_DIFFUSE_RECEIVER,
                CausticRole::Caster if before != 0 => before | MATCHES | ENDS_IN_CASTER,
                _ => before,
            };
        }
    }

    /// Ends a chain where the shading normal was bent for the camera path's direction, which light paths can't reproduce.
    pub(super) fn end_chain_if_bent(
        &self,
        bounce: u32,
        i: usize,
        surface: &Surface,
        wo: Vec3,
        chains: &mut [u32],
    ) {
        if bounce >= 1
            && self.scene.features.bent_normals
            && chains[i] & ENDS_IN_CASTER != 0
            && bent_normal(surface.ns, surface.ng, wo).1
        {
            chains[i] &= !(MATCHES | ENDS_IN_CASTER);
        }
    }

    /// Ends chains at sorted vertices whose shading normals were bent on evaluation.
    pub(super) fn end_bent_chains(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        if bounce >= 1 && self.optional.caustic_chains && self.scene.features.bent_normals {
            for i in sorted.metal_rough() {
                let chain = &mut w.wave.paths.caustic_chains[i];
                if w.wave.vertices.is_bent[i] != 0.0 && *chain & ENDS_IN_CASTER != 0 {
                    *chain &= !(MATCHES | ENDS_IN_CASTER);
                }
            }
        }
    }

    /// Ends chains where light paths exclude the sampled direction (see [`shading_normal_correction`]).
    pub(super) fn end_chains_of_large_correction(
        &self,
        bounce: u32,
        sorted: &SortedVertices,
        w: &mut Workspace,
    ) {
        if bounce >= 1 && self.optional.caustic_chains && self.scene.features.bent_normals {
            for i in sorted.all() {
                let is_by_caster = w.wave.paths.caustic_chains[i] & ENDS_IN_CASTER != 0;
                if is_by_caster
                    && has_large_correction_at(&w.wave.vertices, i, get(&w.wave.vertices.next_direction, i))
                {
                    w.wave.paths.caustic_chains[i] &= !(MATCHES | ENDS_IN_CASTER);
                }
            }
        }
    }

    /// Fraction of the emission of `light`, hit by arriving path `i`, that light paths don't sample.
    #[inline(always)]
    pub(super) fn camera_path_fraction(
        &self,
        bounce: u32,
        i: usize,
        light: Option<u32>,
        w: &Workspace,
    ) -> Rgb {
        let Some(plan) = self.options.caustics else { return Rgb::ONE };
        let is_caustic = bounce >= 2
            && w.arriving.caustic_chains[i] & ENDED_IN_CASTER != 0
            && light.is_some_and(|light| plan.emits_from(&self.scene.lights, light));
        if is_caustic { Rgb::ONE - get_rgb(&w.arriving.caustic_chain_fraction, i) } else { Rgb::ONE }
    }

    /// At diffuse receivers, multiplies a path's `caustic_chain_fraction` by the diffuse lobes' fraction of the BSDF in the sampled direction.
    pub(super) fn update_chain_fractions(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let Workspace { wave, bsdfs, .. } = w;
        for i in sorted.all() {
            let Wave { paths, vertices: v, .. } = &mut **wave;
            if paths.caustic_chains[i] & IS_DIFFUSE_RECEIVER == 0 || !paths.state.pdf[i].is_alive() {
                continue;
            }
            let diffuse = match paths.state.pdf[i].is_specular() {
                true => Rgb::ZERO,
                false => self.scattering(sorted, v, bsdfs, i, get(&v.next_direction, i)).diffuse,
            };
            let fraction = get_rgb(&paths.caustic_chain_fraction, i) * diffuse;
            set_rgb(&mut paths.caustic_chain_fraction, i, fraction);
        }
    }

    /// Removes the fraction of light samples that light paths sample.
    pub(super) fn exclude_caustic_light_samples(
        &self,
        bounce: u32,
        sorted: &SortedVertices,
        w: &mut Workspace,
    ) {
        let Some(plan) = self.options.caustics.filter(|_| bounce >= 1) else { return };
        let Wave { paths, vertices: v, .. } = &mut *w.wave;
        let chains = &paths.caustic_chains;
        for i in sorted.lit() {
            let is_caustic = chains[i] & ENDS_IN_CASTER != 0
                && plan.emits_from(&self.scene.lights, self.only_light.unwrap_or(v.light.index[i]));
            if is_caustic && !has_large_correction_at(v, i, get(&v.light.wi, i)) {
                let kept = Rgb::ONE - get_rgb(&paths.caustic_chain_fraction, i);
                if kept == Rgb::ZERO {
                    v.light.pdf[i] = LightPdf::NONE;
                }
                scale_rgb(&mut v.light.radiance, i, kept);
            }
        }
    }
}

/// Does a path with this chain exclude light that its next vertex scatters?
#[inline(always)]
pub(super) fn excludes_light(chain: u32) -> bool {
    chain & MATCHES != 0
}

/// Does a path with this chain and `caustic_chain_fraction` exclude only the diffuse lobes' fraction of such light?
#[inline(always)]
pub(super) fn excludes_diffuse_light(chain: u32, fraction: Rgb) -> bool {
    chain & IS_DIFFUSE_RECEIVER != 0 || excludes_light(chain) && fraction != Rgb::ONE
}

/// Maximum [`shading_normal_correction`] of light paths; above, camera paths sample the light.
const MAX_CORRECTION: f32 = 3.0;

/// Correction of a light path's flux for a shading normal `ns` on scattering from `wi` to `wo` (Veach 1997, section 5.3); 1 if the normals
/// are equal. Few light paths hit a surface at grazing angles, and each has a large factor unless the angle to `ns` is grazing too: the
/// variance is unbounded.
fn shading_normal_correction(ns: Vec3, ng: Vec3, wo: Vec3, wi: Vec3) -> f32 {
    ((wi.dot(ns) * wo.dot(ng)) / (wo.dot(ns) * wi.dot(ng))).abs()
}

/// Is the correction so large that scattering from `wi` to `wo` is left to camera paths?
fn has_large_correction(ns: Vec3, ng: Vec3, wo: Vec3, wi: Vec3) -> bool {
    ns != ng && shading_normal_correction(ns, ng, wo, wi) > MAX_CORRECTION
}

fn has_large_correction_at(v: &Vertices, i: usize, wi: Vec3) -> bool {
    has_large_correction(get(&v.ns, i), get(&v.ng, i), get(&v.wo, i), wi)
}

// Any-hit of light paths, the reverse of camera paths: a camera path that passes a one-sided surface from behind corresponds to a
// light path that passes its front. So at the front of a one-sided surface a light path both scatters and passes; at the back it ends.

/// Whether a light path passes a hit, scatters there, or both.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passage {
    /// The light path continues unscattered.
    pub passes: bool,
    /// The surface scatters.
    pub hits: bool,
}

/// Time of all hits: scenes with motion have no light tracing.
pub(super) const STATIC_TIME: f32 = 0.0;

impl Integrator<'_> {
    /// Whether a light path passes a hit. `salt` seeds the opacity test; `is_to_camera` is true on the segment to the camera.
    pub(super) fn passage(&self, ray: &Ray, hit: &Hit, salt: u32, is_to_camera: bool) -> Passage {
        let index = self.scene.geometries.material(hit) as usize;
        if !self.may_pass_through[index] {
            return Passage { passes: false, hits: true };
        }
        let material = &self.scene.materials[index];
        let is_visible = |visibility: SurfaceVisibility| {
            visibility.is_obstacle && (!is_to_camera || visibility.visible_to.contains(RayKinds::CAMERA))
        };
        let is_present = material.surface_visibility.is_none_or(is_visible)
            && unit(hash32(salt)) < self.opacity(ray, hit, STATIC_TIME, material, PathOrigin::UNKNOWN);
        if !material.is_single_sided {
            return Passage { passes: !is_present, hits: is_present };
        }
        let is_front = !self.scene.geometries.is_back(ray, hit, STATIC_TIME);
        Passage { passes: is_front || !is_present, hits: is_front && is_present }
    }

    /// Continues the ray after a hit. After the front of a one-sided surface, a coincident surface that faces the other way can still
    /// be hit.
    pub(super) fn past(&self, ray: &Ray, hit: &Hit) -> Ray {
        let is_farther = hit.t > ray.t_min.next_up();
        if is_farther && self.scene.geometries.is_back_of_flat(ray, hit, STATIC_TIME) == Some(false) {
            return Ray { t_min: hit.t.next_down(), origin_primitive: hit.into(), ..*ray };
        }
        Ray { t_min: hit.t, ..*ray }
    }

    /// Which segments are occluded. `salts` seed the opacity tests; `are_to_camera` is true for segments to the camera.
    pub(super) fn blocked(
        &self,
        segments: &[Ray],
        salts: &[u32],
        are_to_camera: bool,
        w: &mut Workspace,
    ) -> Vec<bool> {
        let mut blocked = vec![false; segments.len()];
        w.ray_counts.all += segments.len() as u64;
        if !self.scene.features.alpha {
            self.scene.accel.occluded(segments, &mut blocked);
            return blocked;
        }
        let mut pending: Vec<(usize, Ray)> = segments.iter().copied().enumerate().collect();
        let mut hits = Vec::new();
        for pass in 0..MAX_PASSES {
            let rays: Vec<Ray> = pending.iter().map(|(_, ray)| *ray).collect();
            hits.clear();
            hits.resize(rays.len(), Hit::MISS);
            self.scene.accel.closest(&rays, &mut hits);
            let mut next = Vec::new();
            for ((k, ray), hit) in pending.iter().zip(&hits).filter(|(_, hit)| hit.is_hit()) {
                let salt = hash32(salts[*k].wrapping_add(pass));
                match self.passage(ray, hit, salt, are_to_camera).passes {
                    true => next.push((*k, self.past(ray, hit))),
                    false => blocked[*k] = true,
                }
            }
            w.ray_counts.all += next.len() as u64;
            if next.is_empty() {
                break;
            }
            pending = next;
        }
        blocked
    }
}

/// Maximum number of surfaces that a ray passes unscattered, against endless stacks.
pub(super) const MAX_PASSES: u32 = 4096;
