//! Caustics from the lamp: light that leaves lamps by way of smooth glass, mirrors and polished metal is found by paths that
//! start there, and connected to the camera ("light tracing", Arvo 1986, "Backward Ray Tracing"; Dutre, Lafortune, Willems 1993).
//! Paths from the camera find it by chance only, and never where lamps have no size.
//!
//! With E the camera, D a surface that catches light ([`Role::Catches`](crate::compile::Role)), S one that sends it on
//! ([`Role::Sends`](crate::compile::Role)) and L a lamp, these paths take all of `E D (D|S)* S L`, and nothing else: at each surface
//! that catches light it shows to the camera, and goes on. Paths from the camera leave out just that: each carries along whether it
//! has met a D first, and then D and S only, and whether the last was an S. What a surface is follows from its material and so is
//! the same from both sides. The environment is no lamp here: what it sends is found from the camera.
//!
//! From lamps without a size (points, spots, suns without an angle) light that a perfectly smooth surface sends first is found by no
//! path from the camera, and so goes on at every surface, and is taken at each that scatters it to the camera.
//!
//! The measure of what a path from a lamp brings is flux: radiance, times the cosine over the density of its start, times what
//! BSDFs leave of it. BSDFs are evaluated for the viewer on the camera's side, so that values are those of paths from the camera,
//! also where a BSDF isn't symmetric; what shading normals change in measures is Veach 1997, "Robust Monte Carlo Methods for
//! Light Transport Simulation", section 5.3. Perfect reflection and refraction can't be asked for a viewer: there, light is
//! left to paths from the camera where the normal would be bent for their viewer. Textures of surfaces that scatter light on its way are
//! looked up at points: which width a path from the camera would cover there is not known.
//!
//! Where neighbouring pixels share suffixes of paths, only prefixes do so that leave the same light: see
//! [`Prefixes::ends`](super::reuse::state::Prefixes::ends).

mod connect_to_camera;
mod emit_light_path;
mod plan;

pub use plan::{CausticPlan, CausticTally};

use super::Integrator;
use super::shading_geometry::bent_normal;
use super::shading_groups::SortedVertices;
use super::wave::Vertices;
use super::wave::get;
use super::workspace::Workspace;
use crate::compile::{Presence, Role};
use crate::math::{Hit, Ray, Vec3};
use crate::sampling::hash::{hash32, unit};
use crate::scene::RayKinds;
use crate::shape::Surface;

// Paths from the camera leave to those from lamps what these take.

// What a path's chain tells of where it came from, and in higher bits of where it goes on.

/// It came by a surface that catches light, the first that it met, and then by such ones and by ones that send it on.
const CAME: u32 = 1;
/// And the last of them sends light on.
const CAME_BY_SENDER: u32 = 2;
/// ScatterParams many bits these are.
const BITS: u32 = 2;
/// The same with the surface where it is.
const GOES: u32 = CAME << BITS;
const GOES_BY_SENDER: u32 = CAME_BY_SENDER << BITS;

impl Integrator<'_> {
    /// Paths arrive: what held where they are going holds where they came.
    pub(super) fn arrive_in_chains(&self, w: &mut Workspace) {
        if self.parts.chains {
            w.arriving.chains[..w.rays.len()].iter_mut().for_each(|chain| *chain >>= BITS);
        }
    }

    /// Goes on with what paths carry along, by the materials that they hit.
    pub(super) fn follow_chains(&self, bounce: u32, w: &mut Workspace) {
        let Some(plan) = self.options.caustics else { return };
        for (i, hit) in w.hits.iter().enumerate() {
            let role = if hit.is_hit() { plan.role(w.materials[i]) } else { Role::Neither };
            let chain = &mut w.arriving.chains[i];
            let came = *chain & (CAME | CAME_BY_SENDER);
            let is_taken = bounce == 0 || came != 0;
            *chain = match role {
                Role::Catches if is_taken => came | GOES,
                Role::Sends if came != 0 => came | GOES | GOES_BY_SENDER,
                _ => came,
            };
        }
    }

    /// Where the normal of a surface was bent for the viewer, paths from lamps don't know it.
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
            && chains[i] & GOES_BY_SENDER != 0
            && bent_normal(surface.ns, surface.ng, wo).1
        {
            chains[i] &= !(GOES | GOES_BY_SENDER);
        }
    }

    /// The same for sorted vertices whose normals are bent already.
    pub(super) fn end_bent_chains(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        if bounce >= 1 && self.parts.chains && self.scene.features.bent_normals {
            for i in sorted.metal_rough() {
                let chain = &mut w.wave.paths.chains[i];
                if w.wave.vertices.is_bent[i] != 0.0 && *chain & GOES_BY_SENDER != 0 {
                    *chain &= !(GOES | GOES_BY_SENDER);
                }
            }
        }
    }

    /// Where paths went on in ways that those from lamps don't take.
    pub(super) fn end_stretched_chains(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        if bounce >= 1 && self.parts.chains && self.scene.features.bent_normals {
            for i in sorted.all() {
                let is_sender = w.wave.paths.chains[i] & GOES_BY_SENDER != 0;
                if is_sender && is_stretched_at(&w.wave.vertices, i, get(&w.wave.vertices.next_direction, i))
                {
                    w.wave.paths.chains[i] &= !(GOES | GOES_BY_SENDER);
                }
            }
        }
    }

    /// Is light of a lamp that arriving path `i` has found left to paths from lamps?
    #[inline(always)]
    pub(super) fn is_left_to_lamps(&self, bounce: u32, i: usize, light: Option<u32>, w: &Workspace) -> bool {
        let Some(plan) = self.options.caustics else { return false };
        bounce >= 2
            && w.arriving.chains[i] & CAME_BY_SENDER != 0
            && light.is_some_and(|light| plan.takes(light))
    }

    /// Takes back the light samples that are left to paths from lamps.
    pub(super) fn leave_light_samples(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        let Some(plan) = self.options.caustics.filter(|_| bounce >= 1) else { return };
        let (chains, v) = (&w.wave.paths.chains, &mut w.wave.vertices);
        for i in sorted.lit() {
            let is_left =
                chains[i] & GOES_BY_SENDER != 0 && plan.takes(self.only_light.unwrap_or(v.light.index[i]));
            if is_left && !is_stretched_at(v, i, get(&v.light.wi, i)) {
                v.light.pdf[i] = 0.0;
            }
        }
    }
}

/// Does a path with this chain at a surface leave light to paths from lamps that the next surface scatters?
#[inline(always)]
pub(super) fn leaves_light(chain: u32) -> bool {
    chain & GOES != 0
}

/// Largest [`stretch`] of the light that paths from lamps take.
const MOST_STRETCH: f32 = 3.0;

/// By how much more a path from a lamp counts, beside one from the camera, behind a surface that is shaded with `ns` and sends
/// light from `wi` to `wo` (Veach 1997, section 5.3). 1 where the normals are the same. Few paths from lamps meet a surface
/// at grazing angles, and each counts much where `ns` does not lie so: the variance of that has no bound.
fn stretch(ns: Vec3, ng: Vec3, wo: Vec3, wi: Vec3) -> f32 {
    ((wi.dot(ns) * wo.dot(ng)) / (wo.dot(ns) * wi.dot(ng))).abs()
}

/// Is light from `wi` to `wo` left to paths from the camera?
fn is_stretched(ns: Vec3, ng: Vec3, wo: Vec3, wi: Vec3) -> bool {
    ns != ng && stretch(ns, ng, wo, wi) > MOST_STRETCH
}

fn is_stretched_at(v: &Vertices, i: usize, wi: Vec3) -> bool {
    is_stretched(get(&v.ns, i), get(&v.ng, i), get(&v.wo, i), wi)
}

// Light from lamps among surfaces that may be absent. A ray of light goes the way of a ray from the camera, in the other
// direction: what that one meets from behind, light meets from the front. So it both arrives at the front of a one-sided
// surface and goes on behind it, where paths from the camera come from behind; it ends at the back.

/// What light does at a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passage {
    /// It goes on as if nothing was there.
    pub passes: bool,
    /// It meets the surface.
    pub meets: bool,
}

/// Nothing moves where light is followed from lamps.
pub(super) const STILL: f32 = 0.0;

impl Integrator<'_> {
    /// What light does where its ray hit; `salt` decides whether partly transparent surfaces are there.
    pub(super) fn passage(&self, ray: &Ray, hit: &Hit, salt: u32, is_seen: bool) -> Passage {
        let index = self.scene.geometries.material(hit) as usize;
        if !self.may_be_absent[index] {
            return Passage { passes: false, meets: true };
        }
        let material = &self.scene.materials[index];
        let is_seen_as_such = |presence: Presence| {
            presence.is_obstacle && (!is_seen || presence.visible_to.contains(RayKinds::CAMERA))
        };
        let is_present = material.presence.is_none_or(is_seen_as_such)
            && unit(hash32(salt)) < self.presence(ray, hit, STILL, material);
        if !material.is_absent_from_behind {
            return Passage { passes: !is_present, meets: is_present };
        }
        let is_front = !self.scene.geometries.is_back(ray, hit, STILL);
        Passage { passes: is_front || !is_present, meets: is_front && is_present }
    }

    /// Takes a ray of light past a surface. Behind the front of a one-sided sheet, what lies at the same place still counts:
    /// another sheet that is turned away from it.
    pub(super) fn past(&self, ray: &Ray, hit: &Hit) -> Ray {
        let is_another = hit.t > ray.t_min.next_up();
        if is_another && self.scene.geometries.is_back_of_flat(ray, hit, STILL) == Some(false) {
            return Ray { t_min: hit.t.next_down(), origin_primitive: hit.into(), ..*ray };
        }
        Ray { t_min: hit.t, ..*ray }
    }

    /// Which of some segments intersect something, with `are_seen` on their way to the camera; `salts` decide about partly
    /// transparent surfaces.
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
        for pass in 0..MOST_PASSES {
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

/// Surfaces in a row that light may pass; a guard against endless stacks.
pub(super) const MOST_PASSES: u32 = 4096;
