//! Rays by kind, where objects or lights are visible to some kinds only.
//!
//! What scatters a path decides the kind of its next ray. Of surfaces with several lobes, one kind is drawn by its share of
//! what the surface scatters there, and the path goes on with that share: so each kind alone is unbiased.
//!
//! Whether light of what is sampled arrives is decided by one set of objects, however it is found: for diffuse reflection
//! and media by those that shadow rays see, for gloss and transmission by those that their own rays see, as in mirrors.
//! Light samples and scattered rays therefore agree also where an object is there for one of them only: a diffuse ray
//! that passed what casts shadows brings nothing of a sampled light from behind, and a light sample that passed what
//! stops such rays counts in full, since they can't find it. Of an environment that no samples are taken of, the rays that find it
//! decide by what they see.

use super::Integrator;
use super::closure::{Closure, GeneralClass, LambertClass, VertexClass};
use super::closure_metal_rough::MetalRoughClass;
use super::group::Sorted;
use super::lanes::{get, get_rgb, set_rgb};
use super::layers::FirstBounce;
use super::linking::with_class_of;
use super::phase::MediumClass;
use super::wave::{Paths, Wave};
use super::workspace::Workspace;
use crate::bsdf::Bsdf;
use crate::color::Rgb;
use crate::sampling::hash::{hash32, unit};
use crate::sampling::power_heuristic;
use crate::scene::RayKinds;

/// Keeps the choice of a kind apart from others with the same salt.
const KIND: u32 = 0x27d4_eb2f;

/// Kinds of rays that a light sample stands for: it ends at what all of them see.
pub(super) const OF_LIGHT_SAMPLES: RayKinds =
    RayKinds::SHADOW.with(RayKinds::GLOSSY).with(RayKinds::TRANSMISSION);

/// The kind of rays whose objects decide whether a light sample arrives at what scatters light by rays of a kind.
fn decider(kind: RayKinds) -> RayKinds {
    if kind == RayKinds::DIFFUSE || kind == RayKinds::VOLUME { RayKinds::SHADOW } else { kind }
}

/// Behind the bits of the kind: the ray passed something that shadow rays see.
const SHADOWED: u32 = 1 << 16;

impl Integrator<'_> {
    /// The kind of the ray of arriving path `i`.
    #[inline(always)]
    pub(super) fn kind(&self, bounce: u32, i: usize, arriving: &Paths) -> RayKinds {
        match bounce {
            0 => RayKinds::CAMERA,
            _ if self.parts.kinds => RayKinds::from_bits(arriving.kinds[i]),
            // Objects differ for the camera only.
            _ => RayKinds::DIFFUSE,
        }
    }

    /// Takes down that an arriving path passed something that is there for other kinds of rays.
    pub(super) fn pass_unseen(&self, i: usize, others: RayKinds, arriving: &mut Paths) {
        if self.parts.kinds && others.contains(decider(RayKinds::from_bits(arriving.kinds[i]))) {
            arriving.kinds[i] |= SHADOWED;
        }
    }

    /// Does light sampling decide whether light that arriving path `i` found arrives, and has it that it doesn't?
    #[inline(always)]
    pub(super) fn is_shadowed(&self, i: usize, arriving: &Paths) -> bool {
        self.parts.kinds && arriving.kinds[i] & SHADOWED != 0 && arriving.carried.pdf[i] > 0.0
    }

    /// Is light `index` visible to the ray of arriving path `i`, and not shadowed?
    pub(super) fn brings_light(&self, bounce: u32, i: usize, index: u32, arriving: &Paths) -> bool {
        let kinds = self.scene.kinds_of_light(index);
        let links = self.scene.links.of_light(index);
        kinds.contains(self.kind(bounce, i, arriving))
            && !self.is_shadowed(i, arriving)
            && self.finds_linked(bounce, i, links, arriving)
    }

    /// Decides of which kind the next rays of the paths are.
    pub(super) fn choose_kinds(&self, bounce: u32, sorted: &Sorted, w: &mut Workspace) {
        let Workspace { wave, bsdfs, .. } = w;
        for i in sorted.all() {
            let Wave { paths, vertices: v, .. } = &mut **wave;
            if sorted.medium().contains(&i) {
                paths.kinds[i] = with_class_of(RayKinds::VOLUME.bits(), paths.kinds[i]);
                continue;
            }
            let mut first = self.scattering(sorted, v, bsdfs, i, get(&v.next_direction, i));
            if paths.carried.pdf[i] == 0.0 {
                first.diffuse = Rgb::ZERO;
            }
            let is_diffuse = draw_diffuse(first, bounce, i, paths);
            let kind = match (first.crosses, is_diffuse) {
                (true, _) => RayKinds::TRANSMISSION,
                (false, true) => RayKinds::DIFFUSE,
                (false, false) => RayKinds::GLOSSY,
            };
            paths.kinds[i] = with_class_of(kind.bits(), paths.kinds[i]);
            if bounce == 0 && self.parts.first_bounces && !first.crosses {
                let diffuse = if is_diffuse { Rgb::ONE } else { Rgb::ZERO };
                paths.first_bounces.set(i, FirstBounce { diffuse, ..first });
            }
        }
    }

    /// What the light sample of vertex `i`, which arrives, is taken times: the share of what the vertex scatters that the
    /// light is visible to, and from which nothing hides it. On its way it passed what is there for some kinds of rays.
    pub(super) fn visible_share(
        &self,
        (bounce, i): (u32, usize),
        passed: RayKinds,
        sorted: &Sorted,
        wave: &Wave,
        bsdfs: &[Bsdf],
    ) -> Rgb {
        let v = &wave.vertices;
        let light = self.only_light.unwrap_or(v.light.index[i]);
        let (kinds, links) = (self.scene.kinds_of_light(light), self.scene.links.of_light(light));
        if passed == RayKinds::NONE && kinds == RayKinds::ALL && links.blockers.is_all() {
            return Rgb::ONE;
        }
        let alone = match passed {
            RayKinds::NONE if links.blockers.is_all() => 1.0,
            _ => 1.0 / self.weight_of_sample(bounce, sorted, wave, bsdfs, i).max(f32::MIN_POSITIVE),
        };
        let of = |kind: RayKinds, share: Rgb| {
            let is_alone = passed.contains(kind) || !links.blockers.is_all();
            let weight = if is_alone { alone } else { 1.0 };
            let arrives = kinds.contains(kind) && !passed.contains(decider(kind));
            if arrives { share * weight } else { Rgb::ZERO }
        };
        if sorted.medium().contains(&i) {
            return of(RayKinds::VOLUME, Rgb::ONE);
        }
        let found = self.scattering(sorted, v, bsdfs, i, get(&v.light.wi, i));
        match found.crosses {
            true => of(RayKinds::TRANSMISSION, Rgb::ONE),
            false => of(RayKinds::DIFFUSE, found.diffuse) + of(RayKinds::GLOSSY, Rgb::ONE - found.diffuse),
        }
    }

    /// The weight that the light sample of a vertex has against scattering.
    pub(super) fn weight_of_sample(
        &self,
        bounce: u32,
        sorted: &Sorted,
        wave: &Wave,
        bsdfs: &[Bsdf],
        i: usize,
    ) -> f32 {
        let v = &wave.vertices;
        let (wi, light_pdf) = (get(&v.light.wi, i), v.light.pdf[i]);
        if light_pdf < 0.0 {
            return 1.0;
        }
        let pdf = if sorted.lambert().contains(&i) {
            LambertClass.closure(v, i).eval(wi).pdf_solid_angle * self.light_density(v, i)
        } else if sorted.metal_rough().contains(&i) {
            MetalRoughClass.closure(v, i).eval(wi).pdf_solid_angle * self.light_density(v, i)
        } else if sorted.medium().contains(&i) {
            MediumClass.closure(v, i).eval(wi).pdf_solid_angle
        } else {
            let class = GeneralClass { bsdfs, first: sorted.general().start };
            class.closure(v, i).eval(wi).pdf_solid_angle
        };
        power_heuristic(light_pdf, pdf * self.paths_per_light_sample(bounce))
    }

    /// Leaves out the paths that left the scene by rays that don't see the environment.
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

    /// Finds camera rays that hit what is special to pictures: holdouts, where their paths end, and shadow catchers.
    pub(super) fn find_special(&self, w: &mut Workspace) {
        w.uncovered.clear();
        if self.scene.features.holdouts {
            self.hold_out(w);
        }
        if self.catches() && !w.without {
            self.find_caught(w);
        }
    }

    /// Ends the paths of camera rays that hit objects which cut a hole into the picture.
    fn hold_out(&self, w: &mut Workspace) {
        for i in 0..w.hits.len() {
            let material = &self.scene.materials[w.materials[i] as usize];
            if w.hits[i].is_hit() && material.presence.is_some_and(|p| p.is_holdout) {
                if self.scene.features.scattering {
                    // What glows before it stays.
                    self.passed(0, i, w.hits[i].t, w);
                }
                w.uncovered.push(w.arriving.carried.sample[i]);
                w.hits[i] = crate::math::Hit::MISS;
                w.materials[i] = 0;
                set_rgb(&mut w.arriving.carried.throughput, i, Rgb::ZERO);
            }
        }
    }

    /// Makes the picture transparent where the camera sees what is special to it.
    pub(super) fn uncover(&self, w: &mut Workspace) {
        for &sample in &w.uncovered {
            w.sink.uncover(sample);
        }
    }
}

/// Is what path `i` goes on with diffuse reflection? It goes on with that share, or with the rest.
fn draw_diffuse(first: FirstBounce, bounce: u32, i: usize, paths: &mut Paths) -> bool {
    let throughput = get_rgb(&paths.carried.throughput, i);
    let part = throughput * first.diffuse;
    let (part_sum, sum) = (part.r + part.g + part.b, throughput.r + throughput.g + throughput.b);
    let probability = if sum > 0.0 { part_sum / sum } else { 1.0 };
    if first.crosses || probability <= 0.0 {
        return false;
    }
    if probability >= 1.0 {
        return true;
    }
    let path = &mut paths.carried;
    let salt = hash32(path.seed[i] ^ hash32(path.shuffled[i]) ^ (bounce << 16));
    let is_diffuse = unit(hash32(salt ^ KIND)) < probability;
    let rest = match is_diffuse {
        true => part / probability,
        false => (throughput - part) / (1.0 - probability),
    };
    set_rgb(&mut path.throughput, i, rest);
    is_diffuse
}
