//! Prefixes against suffixes: what every prefix of a group would get from one suffix, in vectorised loops.

use super::super::closure::{Closure, VertexClass};
use super::super::lanes::{WAVE, get, get_rgb, set_rgb};
use super::super::normals::terminator;
use super::state::{Pairs, Prefixes};
use super::tiling::GroupShape;
use crate::color::Rgb;
use crate::simd::Kernel;

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
                let has_ended_there = prefixes.bounce[i] == pairs.bounce[i];
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
