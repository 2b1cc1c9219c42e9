//! Solids that light passes: which of them a path is inside of, what they absorb, and what lies on either side of their
//! surfaces.
//!
//! A path carries a list of the solids that it has entered and not left. Light is absorbed, and refracted, by the one
//! entered last. So a solid inside another displaces it, two bodies of one material that overlap are one, and where a
//! liquid overlaps its glass the boundary met first counts (Schmidt, Budge 2002 settle such overlaps by priorities,
//! which scene formats don't have).

use super::Integrator;
use super::surface::Sorted;
use super::wave::{Paths, Wave, Workspace, get, get_rgb, set_rgb};
use crate::bsdf::{Bsdf, Dielectric};
use crate::color::Rgb;
use crate::compile::{CompiledMaterial, CompiledScene};
use crate::math::{Ray, Vec3};
use crate::sampling::hash::{hash32, unit};
use crate::scene::FresnelModel;
use bytemuck::Zeroable;

/// The solids that a path is inside of, by the numbers of their media: up to four, those entered last. Sixteen bits
/// each, the last one lowest; 0 is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Zeroable)]
pub struct Interior(u64);

const BITS: u32 = 16;

impl Interior {
    const AIR: Interior = Interior(0);

    /// The medium around; 0 is that of the environment.
    #[inline(always)]
    fn medium(self) -> u16 {
        self.0 as u16
    }

    #[inline(always)]
    fn entered(self, medium: u16) -> Interior {
        Interior(self.0 << BITS | u64::from(medium))
    }

    /// Without the solid of that medium entered last, if there is one.
    #[inline]
    fn left(self, medium: u16) -> Interior {
        let Some(shift) = self.position(medium) else { return self };
        let inner = self.0 & ((1 << shift) - 1);
        let outer = self.0 >> shift >> BITS << shift;
        Interior(outer | inner)
    }

    #[inline]
    fn contains(self, medium: u16) -> bool {
        self.position(medium).is_some()
    }

    /// The lowest bit of the last entry of a medium.
    #[inline]
    fn position(self, medium: u16) -> Option<u32> {
        (0..u64::BITS).step_by(BITS as usize).find(|&shift| (self.0 >> shift) as u16 == medium)
    }

    /// The solids around a scene's camera: a ray that leaves it meets their surfaces from behind once more often than
    /// from the front. Three rays vote, as models have holes.
    pub(super) fn of_camera(scene: &CompiledScene) -> Interior {
        // Rays of an orthographic camera start all over its plane: each learns where it is from what it meets.
        if !scene.features.media || !scene.camera.is_perspective() {
            return Interior::AIR;
        }
        let ways =
            [Vec3::new(0.31, 0.89, 0.34), Vec3::new(-0.83, -0.27, 0.49), Vec3::new(0.42, -0.37, -0.83)];
        let around = ways.map(|way| solids_around(scene, scene.camera.position(), way.normalize()));
        let is_around = |m: &u16| around.iter().filter(|list| list.contains(m)).count() >= 2;
        let first = around.iter().find(|list| list.iter().any(is_around));
        let solids = first.into_iter().flatten().filter(|m| is_around(m));
        solids.fold(Interior::AIR, |interior, &m| interior.entered(m))
    }
}

/// Media of the solids around a point, by their number, the one that a ray leaves first at the end.
fn solids_around(scene: &CompiledScene, p: Vec3, direction: Vec3) -> Vec<u16> {
    const MOST_SURFACES: u32 = 256;
    let mut ray = Ray::new(p, direction);
    let (mut entered, mut left): (Vec<u16>, Vec<u16>) = (Vec::new(), Vec::new());
    for _ in 0..MOST_SURFACES {
        let hit = scene.accel.closest_one(&ray);
        if !hit.is_hit() {
            break;
        }
        ray.t_min = hit.t;
        let medium = scene.materials[scene.geometries.material(&hit) as usize].medium_index;
        let is_front = scene.geometries.surface(&ray, &hit).ng.dot(direction) < 0.0;
        if medium == 0 {
            continue;
        }
        if is_front {
            entered.push(medium);
        } else if let Some(at) = entered.iter().rposition(|&m| m == medium) {
            entered.remove(at);
        } else if entered.pop().is_none() {
            left.push(medium);
        }
    }
    left.reverse();
    left
}

/// The surface of a solid as a path meets it.
pub(super) struct Boundary {
    /// How it scatters, with the index of refraction relative to what is on the outer side.
    pub bsdf: Bsdf,
    /// Its outer side is the denser one: `bsdf` is for the surface turned around.
    pub is_inverted: bool,
    /// The solids on its other side.
    pub beyond: Interior,
}

/// A surface that isn't there: within other solids of the same medium, or within one that displaces it.
const HIDDEN: Bsdf = Bsdf::Dielectric(Dielectric { ior: 1.0, tint: Rgb::ONE, fresnel: FresnelModel::Exact });

impl Integrator<'_> {
    /// Applies absorption to the ways to the hits. What ends nowhere in a solid was not closed, and absorbs nothing.
    pub(super) fn absorb(&self, w: &mut Workspace) {
        let paths = &mut w.arriving;
        for (i, hit) in w.hits.iter().enumerate() {
            let medium = &self.scene.media[usize::from(paths.interior[i].medium())];
            if medium.absorption.is_some() && hit.is_hit() {
                let throughput = get_rgb(&paths.throughput, i);
                set_rgb(&mut paths.throughput, i, throughput * medium.transmittance(hit.t));
            }
        }
    }

    /// Applies absorption to the ways from vertices to the lights that were sampled.
    pub(super) fn absorb_light(&self, sorted: &Sorted, wave: &mut Wave) {
        let Wave { paths, vertices: v } = wave;
        for i in 0..sorted.lit {
            let mut interior = paths.interior[i];
            if i >= sorted.metal_rough {
                let ng = get(&v.ng, i);
                if ng.dot(get(&v.wo, i)) * ng.dot(get(&v.wi, i)) < 0.0 {
                    interior = v.beyond[i];
                }
            }
            let medium = &self.scene.media[usize::from(interior.medium())];
            if medium.absorption.is_some() && v.is_infinite[i] == 0.0 {
                let contribution = get_rgb(&v.contribution, i);
                let left = medium.transmittance(get(&v.direction, i).length());
                set_rgb(&mut v.contribution, i, contribution * left);
            }
        }
    }

    /// A path that knows of no solid meets one from behind: it must have been inside, and absorption applies.
    pub(super) fn enter_unnoticed(&self, material: &CompiledMaterial, way: f32, i: usize, paths: &mut Paths) {
        if paths.interior[i] == Interior::AIR {
            let medium = material.medium_index;
            paths.interior[i] = Interior::AIR.entered(medium);
            let left = self.scene.media[usize::from(medium)].transmittance(way);
            let throughput = get_rgb(&paths.throughput, i);
            set_rgb(&mut paths.throughput, i, throughput * left);
        }
    }

    /// What a path meets at the surface of a solid of this material.
    pub(super) fn boundary(
        &self,
        bsdf: Bsdf,
        material: &CompiledMaterial,
        is_back: bool,
        bounce: u32,
        i: usize,
        paths: &mut Paths,
    ) -> Boundary {
        let (here, own) = (paths.interior[i], material.medium_index);
        // A body may have several materials, one where it is entered and another where it is left: then what was entered
        // last is left.
        let medium = if is_back && !here.contains(own) { here.medium() } else { own };
        let beyond = if is_back { here.left(medium) } else { here.entered(medium) };
        let outer = if is_back { beyond } else { here };
        let is_displaced = is_back && here.medium() != medium;
        if is_displaced || outer.medium() == medium {
            return Boundary { bsdf: HIDDEN, is_inverted: false, beyond };
        }
        let media = &self.scene.media;
        let (inside, outside) = (&media[usize::from(medium)], &media[usize::from(outer.medium())]);
        let (Some(inner_iors), Some(outer_iors)) = (inside.iors, outside.iors) else {
            return Boundary { bsdf, is_inverted: false, beyond };
        };
        if inside.is_dispersive() || outside.is_dispersive() {
            choose_channel(bounce, i, paths);
        } else if outer == Interior::AIR && medium == own {
            return Boundary { bsdf, is_inverted: false, beyond };
        }
        let channel = channel_of(get_rgb(&paths.throughput, i));
        let ior = inner_iors[channel] / outer_iors[channel];
        if ior >= 1.0 {
            return Boundary { bsdf: bsdf.with_ior(ior), is_inverted: false, beyond };
        }
        match bsdf {
            // Layers stay on the outside; their glass takes the nearest index that it can have.
            Bsdf::Layered(_) => Boundary { bsdf: bsdf.with_ior(1.0), is_inverted: false, beyond },
            _ => Boundary { bsdf: bsdf.with_ior(1.0 / ior), is_inverted: true, beyond },
        }
    }
}

/// The path goes on with one channel, chosen by its throughput.
fn choose_channel(bounce: u32, i: usize, paths: &mut Paths) {
    let throughput = get_rgb(&paths.throughput, i).to_array();
    let total: f32 = throughput.iter().sum();
    let salt = hash32(paths.seed[i] ^ hash32(paths.shuffled[i]).rotate_left(7) ^ (bounce << 20));
    let mut at = unit(hash32(salt)) * total;
    let last = (0..3).rev().find(|&c| throughput[c] > 0.0).unwrap_or(0);
    let mut channel = 0;
    while channel < last && at >= throughput[channel] {
        at -= throughput[channel];
        channel += 1;
    }
    let mut single = [0.0; 3];
    single[channel] = total;
    set_rgb(&mut paths.throughput, i, Rgb::from_array(single));
}

/// The channel of a path that carries one; green, the middle of the spectrum, of others.
fn channel_of(throughput: Rgb) -> usize {
    match throughput.to_array().map(|c| c > 0.0) {
        [true, false, false] => 0,
        [false, false, true] => 2,
        _ => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solids_are_left_in_any_order() {
        let three = Interior::AIR.entered(7).entered(9).entered(7);
        assert_eq!(three.medium(), 7);
        assert_eq!(three.left(7), Interior::AIR.entered(7).entered(9));
        assert_eq!(three.left(9), Interior::AIR.entered(7).entered(7));
        assert_eq!(three.left(8), three);
        assert_eq!(three.left(7).left(9).left(7), Interior::AIR);
    }

    #[test]
    fn the_outermost_of_many_is_forgotten() {
        let five = (1..=5).fold(Interior::AIR, Interior::entered);
        let left = [5, 4, 3, 2].into_iter().fold(five, Interior::left);
        assert_eq!(left, Interior::AIR);
    }
}
