//! Solids that light passes: which of them a path is inside of, what they absorb, and what lies on either side of their
//! surfaces.
//!
//! A path carries a list of the solids that it has entered and not left. Light is absorbed, and refracted, by the one of the
//! highest priority, and among equals by the one entered last (Schmidt, Budge 2002, "Simple Nested Dielectrics in Ray Traced
//! Images"). So, without priorities, a solid inside another displaces it, two bodies of one material that overlap are one, and
//! where a liquid overlaps its glass the boundary that is hit first counts. Media without a surface add up instead, with each other
//! and with the fog around the scene, as long as they lie on top of each other in the list: see [`super::beside`].

use super::Integrator;
use super::group::Sorted;
use super::interior::Interior;
use super::lanes::{get, get_rgb, set_rgb};
use super::times::Times;
use super::wave::{Carried, Paths, Vertices, Wave};
use super::workspace::Workspace;
use crate::bsdf::{Bsdf, Dielectric, Refraction};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::CompiledMaterial;
use crate::math::Vec3;
use crate::sampling::hash::{hash32, unit};
use crate::scene::FresnelModel;

/// The surface of a solid where a path arrives.
pub(super) struct Boundary {
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
    pub(super) fn absorb_light(&self, sorted: &Sorted, wave: &mut Wave, times: &Times) {
        let Wave { paths, vertices: v, .. } = wave;
        for i in sorted.lit() {
            if get_rgb(&v.light.contribution, i).max_element() <= 0.0 {
                continue;
            }
            let ray = (get(&v.light.origin, i), get(&v.light.direction, i));
            let end = if v.light.is_infinite[i] > 0.0 { f32::INFINITY } else { 1.0 };
            let waves = times.waves(paths.carried.sample[i]);
            let left = self.left_between(self.towards_light(sorted, paths, v, i), ray, [0.0, end], waves);
            if left != Rgb::ONE {
                let contribution = get_rgb(&v.light.contribution, i);
                set_rgb(&mut v.light.contribution, i, contribution * left);
            }
        }
    }

    /// The solids that the light sample of vertex `i` comes through.
    pub(super) fn towards_light(&self, sorted: &Sorted, paths: &Paths, v: &Vertices, i: usize) -> Interior {
        if i >= sorted.rough().start {
            let ng = get(&v.ng, i);
            if ng.dot(get(&v.wo, i)) * ng.dot(get(&v.light.wi, i)) < 0.0 {
                return v.beyond[i];
            }
        }
        paths.interior[i]
    }

    /// What is left of light on a ray between two of its points, within the same solids.
    pub(super) fn left_between(
        &self,
        interior: Interior,
        ray: (Vec3, Vec3),
        way: [f32; 2],
        waves: Option<&Wavelengths>,
    ) -> Rgb {
        let left = self.left_in(interior.medium(), ray, way, waves, 0);
        if self.scene.features.overlaps { left * self.left_beside(interior, ray, way, waves) } else { left }
    }

    /// The same of one medium; `apart` keeps estimates of several apart. What ends nowhere in a solid was not closed, and absorbs
    /// nothing.
    #[inline]
    pub(super) fn left_in(
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
    ) -> Boundary {
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
            return Boundary { bsdf: hidden(tint), is_inverted: false, beyond };
        }
        let is_alone = outer == Interior::AIR && medium == own;
        let (bsdf, is_inverted) =
            self.interface(bsdf, ([medium, outer.medium()], is_alone), (bounce, i), paths, waves);
        Boundary { bsdf, is_inverted, beyond }
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
fn choose_channel(bounce: u32, i: usize, path: &mut Carried) {
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
