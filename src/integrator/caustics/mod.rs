//! Caustics by light tracing (Arvo 1986, "Backward Ray Tracing"; Dutre, Lafortune, Willems 1993): light that smooth glass, mirrors and
//! polished metal send from lights to other surfaces is found by paths that start at lights, and connected to the camera. Paths from
//! the camera find it by chance only, and never where the lights are points or directions.
//!
//! With E the camera, D a receiver ([`CausticRole::Receiver`](crate::compile::CausticRole)), S a caster ([`CausticRole::Caster`](crate::compile::CausticRole)) and
//! L a light, paths from lights find all of `E D (D|S)* S L` and nothing else: they are connected to the camera at each receiver, and
//! continue there. Paths from the camera leave out exactly these: each stores whether its first surface was a D and all others were D
//! or S (its *chain*), and whether the last one was an S. The role of a surface follows from its material, and so is the same from both
//! sides. The environment doesn't count as a light here: paths from the camera find its light.
//!
//! At some receivers, only the diffuse lobes take part ([`CausticRole::DiffuseReceiver`](crate::compile::CausticRole)): their other lobes are so smooth,
//! or may be by their textures, that paths from lights would seldom meet the camera in a direction where much is reflected. Paths from
//! lights find the product of the shares of the diffuse lobes at such vertices, paths from the camera what is missing from 1.
//!
//! Light that a point or directional light sends to a perfectly specular surface first is found by no path from the camera. Such light
//! paths continue at every surface and are connected to the camera at each that scatters.
//!
//! A path from a light carries flux: radiance times the cosine over the density of its start, times BSDFs. BSDFs are evaluated with
//! the direction towards the camera as `wo`, so that values are those of paths from the camera, also where a BSDF isn't symmetric.
//! Shading normals change measures as in Veach 1997, "Robust Monte Carlo Methods for Light Transport Simulation", section 5.3. Perfect
//! reflection and refraction can't be evaluated: where the shading normal would be bent for the direction of a path from the camera,
//! such a path finds the light. Textures of surfaces along the path are looked up at points, since the footprint of a path from
//! the camera is not known there.
//!
//! Where neighbouring pixels share suffixes of paths, only prefixes that leave out the same light take part: see
//! [`Prefixes::ends`](super::reuse::Prefixes::ends).

mod light_paths;
mod plan;

pub use plan::{CausticPlan, CausticTally};

use super::Integrator;
use super::mis::LightPdf;
use super::shading_geometry::bent_normal;
use super::shading_groups::SortedVertices;
use super::wave::{Vertices, Wave, get, get_rgb, set_rgb};
use super::workspace::Workspace;
use crate::color::Rgb;
use crate::compile::{CausticRole, SurfaceVisibility};
use crate::math::{Hit, Ray, Vec3};
use crate::sampling::hash::{hash32, unit};
use crate::scene::RayKinds;
use crate::shape::Surface;

// Paths from the camera leave out the light that paths from lights find. The bits of a path's chain: the two low ones are about the
// vertices before the current one, the next two include it.

/// The first surface was a receiver, all others were receivers or casters.
const ARRIVES: u32 = 1;
/// And the last one was a caster.
const ARRIVES_BY_CASTER: u32 = 2;
/// Number of these bits.
const BITS: u32 = 2;
/// [`ARRIVES`] of the chain that includes the current vertex.
const LEAVES: u32 = ARRIVES << BITS;
const LEAVES_BY_CASTER: u32 = ARRIVES_BY_CASTER << BITS;
/// The current vertex is a receiver by its diffuse lobes only ([`CausticRole::DiffuseReceiver`]).
const IS_DIFFUSE: u32 = 1 << (2 * BITS);

impl Integrator<'_> {
    /// Shifts the chains of paths that arrive at their next vertex.
    pub(super) fn arrive_in_chains(&self, w: &mut Workspace) {
        if self.optional.chains {
            let arrive = |chain: &mut u32| *chain = *chain >> BITS & (ARRIVES | ARRIVES_BY_CASTER);
            w.arriving.chains[..w.rays.len()].iter_mut().for_each(arrive);
        }
    }

    /// Updates the chains by the roles of the materials hit.
    pub(super) fn follow_chains(&self, bounce: u32, w: &mut Workspace) {
        let Some(plan) = self.options.caustics else { return };
        for (i, hit) in w.hits.iter().enumerate() {
            let role = if hit.is_hit() { plan.role(w.materials[i]) } else { CausticRole::Neither };
            let chain = &mut w.arriving.chains[i];
            let came = *chain & (ARRIVES | ARRIVES_BY_CASTER);
            let is_taken = bounce == 0 || came != 0;
            *chain = match role {
                CausticRole::Receiver if is_taken => came | LEAVES,
                CausticRole::DiffuseReceiver if is_taken => came | LEAVES | IS_DIFFUSE,
                CausticRole::Caster if came != 0 => came | LEAVES | LEAVES_BY_CASTER,
                _ => came,
            };
        }
    }

    /// Ends a chain where the shading normal was bent for the path's direction: paths from lights don't know that direction.
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
            && chains[i] & LEAVES_BY_CASTER != 0
            && bent_normal(surface.ns, surface.ng, wo).1
        {
            chains[i] &= !(LEAVES | LEAVES_BY_CASTER);
        }
    }

    /// Ends chains at sorted vertices whose normals were bent before.
    pub(super) fn end_bent_chains(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        if bounce >= 1 && self.optional.chains && self.scene.features.bent_normals {
            for i in sorted.metal_rough() {
                let chain = &mut w.wave.paths.chains[i];
                if w.wave.vertices.is_bent[i] != 0.0 && *chain & LEAVES_BY_CASTER != 0 {
                    *chain &= !(LEAVES | LEAVES_BY_CASTER);
                }
            }
        }
    }

    /// Ends chains where paths from lights leave out the direction that the path took (see [`stretch`]).
    pub(super) fn end_stretched_chains(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        if bounce >= 1 && self.optional.chains && self.scene.features.bent_normals {
            for i in sorted.all() {
                let is_by_caster = w.wave.paths.chains[i] & LEAVES_BY_CASTER != 0;
                if is_by_caster
                    && is_stretched_at(&w.wave.vertices, i, get(&w.wave.vertices.next_direction, i))
                {
                    w.wave.paths.chains[i] &= !(LEAVES | LEAVES_BY_CASTER);
                }
            }
        }
    }

    /// The share of the light of this light at the end of arriving path `i` that paths from lights don't find.
    #[inline(always)]
    pub(super) fn share_of_camera_paths(
        &self,
        bounce: u32,
        i: usize,
        light: Option<u32>,
        w: &Workspace,
    ) -> Rgb {
        let Some(plan) = self.options.caustics else { return Rgb::ONE };
        let is_left = bounce >= 2
            && w.arriving.chains[i] & ARRIVES_BY_CASTER != 0
            && light.is_some_and(|light| plan.takes(&self.scene.lights, light));
        if is_left { Rgb::ONE - get_rgb(&w.arriving.chain_share, i) } else { Rgb::ONE }
    }

    /// Multiplies the shares of the light that paths from lights find by those of the diffuse lobes of vertices where only these
    /// receive caustics, in the directions that the paths took.
    pub(super) fn divide_chains(&self, sorted: &SortedVertices, w: &mut Workspace) {
        let Workspace { wave, bsdfs, .. } = w;
        for i in sorted.all() {
            let Wave { paths, vertices: v, .. } = &mut **wave;
            if paths.chains[i] & IS_DIFFUSE == 0 || !paths.state.pdf[i].is_alive() {
                continue;
            }
            let diffuse = match paths.state.pdf[i].is_specular() {
                true => Rgb::ZERO,
                false => self.scattering(sorted, v, bsdfs, i, get(&v.next_direction, i)).diffuse,
            };
            let share = get_rgb(&paths.chain_share, i) * diffuse;
            set_rgb(&mut paths.chain_share, i, share);
        }
    }

    /// Discards light samples that paths from lights find.
    pub(super) fn leave_light_samples(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        let Some(plan) = self.options.caustics.filter(|_| bounce >= 1) else { return };
        let Wave { paths, vertices: v, .. } = &mut *w.wave;
        let chains = &paths.chains;
        for i in sorted.lit() {
            let is_left = chains[i] & LEAVES_BY_CASTER != 0
                && plan.takes(&self.scene.lights, self.only_light.unwrap_or(v.light.index[i]));
            if is_left && !is_stretched_at(v, i, get(&v.light.wi, i)) {
                let kept = Rgb::ONE - get_rgb(&paths.chain_share, i);
                if kept == Rgb::ZERO {
                    v.light.pdf[i] = LightPdf::NONE;
                }
                let radiance = get_rgb(&v.light.radiance, i);
                set_rgb(&mut v.light.radiance, i, radiance * kept);
            }
        }
    }
}

/// Does a path with this chain at a vertex leave out light that the next vertex scatters?
#[inline(always)]
pub(super) fn leaves_light(chain: u32) -> bool {
    chain & LEAVES != 0
}

/// Does a path with this chain at a vertex, and this share, leave out light of diffuse lobes only?
#[inline(always)]
pub(super) fn leaves_diffuse_light(chain: u32, share: Rgb) -> bool {
    chain & IS_DIFFUSE != 0 || leaves_light(chain) && share != Rgb::ONE
}

/// Largest [`stretch`] of light that paths from lights find.
const MAX_STRETCH: f32 = 3.0;

/// Factor of the flux of a path from a light, relative to the radiance of a path from the camera, behind a surface with shading normal
/// `ns` that scatters light from `wi` to `wo` (Veach 1997, section 5.3); 1 where the normals are equal. Few paths from lights hit a
/// surface at grazing angles, and each has a large factor if `ns` is not grazing: the variance has no bound.
fn stretch(ns: Vec3, ng: Vec3, wo: Vec3, wi: Vec3) -> f32 {
    ((wi.dot(ns) * wo.dot(ng)) / (wo.dot(ns) * wi.dot(ng))).abs()
}

/// Is scattering from `wi` to `wo` left to paths from the camera?
fn is_stretched(ns: Vec3, ng: Vec3, wo: Vec3, wi: Vec3) -> bool {
    ns != ng && stretch(ns, ng, wo, wi) > MAX_STRETCH
}

fn is_stretched_at(v: &Vertices, i: usize, wi: Vec3) -> bool {
    is_stretched(get(&v.ns, i), get(&v.ng, i), get(&v.wo, i), wi)
}

// Any-hit of paths from lights. They follow rays from the camera in the opposite direction: those hit the back of a surface where
// light hits the front. So light both arrives at the front of a one-sided surface and continues behind it, where rays from the
// camera come from behind; it ends at the back.

/// Whether light passes a hit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passage {
    /// It continues as if the surface was absent.
    pub passes: bool,
    /// The surface scatters it.
    pub hits: bool,
}

/// Time of all hits: nothing moves where light is traced.
pub(super) const STILL: f32 = 0.0;

impl Integrator<'_> {
    /// Whether light passes a hit; `salt` decides whether partly transparent surfaces are present. `is_seen`: on the segment to the camera.
    pub(super) fn passage(&self, ray: &Ray, hit: &Hit, salt: u32, is_seen: bool) -> Passage {
        let index = self.scene.geometries.material(hit) as usize;
        if !self.may_be_absent[index] {
            return Passage { passes: false, hits: true };
        }
        let material = &self.scene.materials[index];
        let is_seen_as_such = |visibility: SurfaceVisibility| {
            visibility.is_obstacle && (!is_seen || visibility.visible_to.contains(RayKinds::CAMERA))
        };
        let is_present = material.surface_visibility.is_none_or(is_seen_as_such)
            && unit(hash32(salt)) < self.opacity(ray, hit, STILL, material, RayKinds::NONE);
        if !material.is_absent_from_behind {
            return Passage { passes: !is_present, hits: is_present };
        }
        let is_front = !self.scene.geometries.is_back(ray, hit, STILL);
        Passage { passes: is_front || !is_present, hits: is_front && is_present }
    }

    /// The ray behind a hit. Behind the front of a one-sided surface, another one at the same distance that faces the other way still
    /// counts.
    pub(super) fn past(&self, ray: &Ray, hit: &Hit) -> Ray {
        let is_another = hit.t > ray.t_min.next_up();
        if is_another && self.scene.geometries.is_back_of_flat(ray, hit, STILL) == Some(false) {
            return Ray { t_min: hit.t.next_down(), origin_primitive: hit.into(), ..*ray };
        }
        Ray { t_min: hit.t, ..*ray }
    }

    /// Which of some segments are occluded; `are_seen`: they end at the camera. `salts` decide about partly transparent surfaces.
    pub(super) fn blocked(
        &self,
        segments: &[Ray],
        salts: &[u32],
        are_seen: bool,
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
                match self.passage(ray, hit, salt, are_seen).passes {
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

/// Bound on the number of surfaces that light passes, against endless stacks.
pub(super) const MAX_PASSES: u32 = 4096;
