//! Prefixes against suffixes: what every prefix of a group would get from one suffix, in vectorised loops.

use super::super::guiding;
use super::super::shading_geometry::terminator;
use super::super::shading_groups::{Closure, MetalRoughClass, VertexClass};
use super::super::wave::{RgbLanes, WAVE, get, get_rgb, set_rgb};
use super::state::{LAMBERT, METAL_ROUGH, Pairs, Prefixes, Suffixes};
use super::tiling::GroupShape;
use crate::color::Rgb;
use crate::simd::{Kernel, Table, dispatch};
use std::ops::Range;

/// Places that loops take together: of one group or of several.
pub const RUN: usize = 16;
const _: () = assert!(WAVE.is_multiple_of(RUN) && WAVE.is_multiple_of(GroupShape::MOST_PIXELS as usize));

/// Fills density and value of the prefixes of a class at runs of places.
pub struct Connect<'a, C, const SOFT: bool> {
    pub class: C,
    /// The class in [`Prefixes::class`].
    pub class_id: u32,
    pub runs: &'a [u16],
    pub prefixes: &'a Prefixes,
    pub pairs: &'a mut Pairs,
}

impl<C: VertexClass, const SOFT: bool> Kernel for Connect<'_, C, SOFT> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Connect { class, class_id, runs, prefixes, pairs } = self;
        let v = &prefixes.vertices;
        for &run in runs {
            // The bound is for the compiler, which then needs no check in the loop.
            let first = (usize::from(run) * RUN).min(WAVE - RUN);
            for i in first..first + RUN {
                let way = get(&pairs.y, i) - get(&v.next_origin, i);
                let squared = way.dot(way);
                let wi = way / squared.sqrt();
                let (ng, ns) = (get(&v.ng, i), get(&v.ns, i));
                let eval = class.closure(v, i).eval(wi);
                let cosine = -wi.dot(get(&pairs.ng, i));
                let geometry = cosine / squared;
                let mut value = get_rgb(&prefixes.throughput, i) * eval.f_cos;
                if SOFT {
                    value *= terminator(ns, ng, wi);
                }
                let faces = (cosine > 0.0) & (wi.dot(ng) > 0.0) & (eval.pdf_solid_angle > 0.0);
                // Paths without throughput end: a prefix can't have found what it gets nothing from.
                let [r, g, b] = value.to_array();
                let has_value = (r > 0.0) | (g > 0.0) | (b > 0.0);
                let has_ended_there = prefixes.ends[i] == pairs.ends[i];
                let connects = faces & has_value & has_ended_there;
                let is_own_class = prefixes.class[i] == class_id;
                let density = if connects { eval.pdf_solid_angle * geometry } else { 0.0 };
                pairs.density[i] = if is_own_class { density } else { pairs.density[i] };
                let value = value * geometry;
                let other = get_rgb(&pairs.value, i);
                let chosen = Rgb::select(is_own_class, value, other);
                set_rgb(&mut pairs.value, i, chosen);
            }
        }
    }
}

/// Makes the densities of prefixes at runs of places those of guided ones.
pub struct GuidePairs<'a> {
    pub runs: &'a [u16],
    pub densities: Table<'a, f32>,
    pub prefixes: &'a Prefixes,
    pub pairs: &'a mut Pairs,
}

impl Kernel for GuidePairs<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let GuidePairs { runs, densities, prefixes, pairs } = self;
        let v = &prefixes.vertices;
        for &run in runs {
            let first = (usize::from(run) * RUN).min(WAVE - RUN);
            for i in first..first + RUN {
                let way = get(&pairs.y, i) - get(&v.next_origin, i);
                let wi = way / way.dot(way).sqrt();
                let is_lambert = prefixes.class[i] == LAMBERT;
                let is_metal_rough = prefixes.class[i] == METAL_ROUGH;
                // Others have no cell.
                let cell = v.guided.cell[i] * u32::from(is_lambert | is_metal_rough);
                let density = densities.at(guiding::place(cell, get(&v.ns, i), wi));
                let factor = MetalRoughClass.closure(v, i).guided(wi, density);
                let factor = if is_metal_rough { factor } else { 1.0 };
                pairs.density[i] *= if is_lambert { density } else { factor };
            }
        }
    }
}

/// The places of the group of `group` places that a place belongs to.
#[inline(always)]
pub fn group_of(place: usize, group: usize) -> Range<usize> {
    let first = place - place % group;
    first..(first + group).min(WAVE)
}

/// The suffixes of a round and the prefixes that get something from them.
#[derive(Clone, Copy)]
pub struct Exchange<'a> {
    /// Places of the suffixes.
    pub senders: &'a [u16],
    /// Places of a group.
    pub group: usize,
    pub prefixes: &'a Prefixes,
    pub suffixes: &'a Suffixes,
    pub pairs: &'a Pairs,
}

impl Exchange<'_> {
    /// Adds to what the prefixes gained, by place. `radiance` leaves the suffixes; by `throughput` their owners get it, by
    /// `value` others (see [`Pairs::value`]).
    pub fn receive(
        self,
        radiance: &RgbLanes,
        throughput: &RgbLanes,
        value: &RgbLanes,
        gained: &mut RgbLanes,
    ) {
        dispatch(Receive { exchange: self, radiance, throughput, value, gained });
    }
}

/// The work of [`Exchange::receive`]. (The sum runs in an order that does not depend on the CPU.)
struct Receive<'a> {
    exchange: Exchange<'a>,
    radiance: &'a RgbLanes,
    throughput: &'a RgbLanes,
    value: &'a RgbLanes,
    gained: &'a mut RgbLanes,
}

impl Kernel for Receive<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Exchange { senders, group, prefixes, suffixes: s, pairs } = self.exchange;
        let gained = self.gained;
        for &sender in senders {
            let sender = usize::from(sender).min(WAVE - 1);
            let places = group_of(sender, group);
            let mut sums = [0.0; 4];
            let (fours, rest) = pairs.density[places.clone()].as_chunks::<4>();
            for four in fours {
                for k in 0..4 {
                    sums[k] += four[k];
                }
            }
            for (sum, density) in sums.iter_mut().zip(rest) {
                *sum += density;
            }
            let own = s.own_density(sender, prefixes);
            let sum = own + ((sums[0] + sums[1]) + (sums[2] + sums[3]));
            let radiance = get_rgb(self.radiance, sender);
            // Points next to each other have densities beyond all numbers.
            let is_finite = own > 0.0 && sum < f32::INFINITY;
            let share = if is_finite { own / sum } else { 1.0 };
            let value = get_rgb(self.throughput, sender) * radiance * (s.rest[sender] * share);
            let total = get_rgb(gained, sender) + value;
            set_rgb(gained, sender, total);
            if is_finite {
                let is_layered = s.class[sender] == METAL_ROUGH;
                let scaled = (radiance * (1.0 / sum)).to_array();
                for c in 0..3 {
                    for i in places.clone() {
                        let rest = if is_layered { pairs.rest[i] } else { 1.0 };
                        let value = self.value[c][i] * (scaled[c] * rest);
                        gained[c][i] += if pairs.density[i] > 0.0 { value } else { 0.0 };
                    }
                }
            }
        }
    }
}

impl Suffixes {
    /// Density per area with which the owner found its suffix.
    #[inline(always)]
    fn own_density(&self, k: usize, prefixes: &Prefixes) -> f32 {
        let way = get(&self.p, k) - get(&prefixes.vertices.next_origin, k);
        let cosine = get(&self.wo, k).dot(get(&self.ng, k));
        self.pdf[k] * cosine / way.dot(way)
    }
}
