//! Paths are cut: vertices that end prefixes or start suffixes are kept.

use super::super::Integrator;
use super::super::caustics::leaves_light;
use super::super::interior::Interior;
use super::super::sampling::FIRST_ROULETTE;
use super::super::shading_groups::{MetalRoughClass, SortedVertices, VertexClass, copy_metal_rough};
use super::super::wave::{FirstBounce, PerPath, Vertices, Wave, get, get_rgb, set, set_rgb};
use super::super::workspace::Workspace;
use super::layer::{LEAST_REST, layer_rest};
use super::state::{DIRECT, LAMBERT, METAL_ROUGH, NONE, Prefixes, Reuse, SCATTERED, Suffixes};
use crate::color::Rgb;
use crate::math::offset_along;
use std::f32::consts::FRAC_1_PI;

/// The last bounce at which a prefix may end: before roulette begins.
const LAST_BOUNCE: u32 = 2;
const _: () = assert!(LAST_BOUNCE < FIRST_ROULETTE);

/// Smallest alpha of facets for which connections to other suffixes are worth their rays, if there is no diffuse part.
const LEAST_ALPHA: f32 = 0.1;

impl Integrator<'_> {
    /// Keeps the vertices where paths are cut. What suffixes bring from now on arrives on its own, as if their
    /// throughput was 1.
    pub(in super::super) fn cut_paths(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        if bounce > LAST_BOUNCE + 1 {
            return;
        }
        let Workspace { wave, reuse: Some(reuse), .. } = w else { return };
        for i in sorted.lambert() {
            self.cut(bounce, i, LAMBERT, wave, reuse);
        }
        for i in sorted.metal_rough() {
            self.cut(bounce, i, METAL_ROUGH, wave, reuse);
        }
    }

    #[inline(always)]
    fn cut(&self, bounce: u32, i: usize, class: u32, wave: &mut Wave, reuse: &mut Reuse) {
        let Wave { paths, vertices: v, .. } = wave;
        let path = &mut paths.carried;
        let k = reuse.place(path.sample[i]);
        let Reuse { prefixes, suffixes, .. } = reuse;
        if prefixes.class[k] == NONE {
            let is_in_air = !self.parts.interiors || paths.interior[i] == Interior::AIR;
            if bounce <= LAST_BOUNCE && is_in_air && spreads(v, i, class) {
                prefixes.keep(k, class, bounce, v, i, get_rgb(&path.throughput, i));
                let leaves = self.parts.chains && leaves_light(paths.chains[i]);
                prefixes.ends[k] = if leaves { bounce + LAST_BOUNCE + 1 } else { bounce };
                if self.parts.first_bounces {
                    let is_first = bounce == 0;
                    let first = if is_first { FirstBounce::DIFFUSE } else { paths.first_bounces.get(i) };
                    prefixes.first_bounces.set(k, first);
                }
            }
        } else if prefixes.bounce[k] + 1 == bounce && path.pdf[i] > 0.0 {
            let Some(rest) = self.shared_part(v, i, class) else { return };
            let throughput = get_rgb(&path.throughput, i);
            suffixes.keep(k, class, v, i, throughput, path.pdf[i]);
            suffixes.rest[k] = rest;
            if self.parts.first_bounces {
                paths.first_bounces.copy_to(i, &mut suffixes.first_bounces, k);
            }
            // The roulette judges paths by all of their throughput.
            path.eta_squared[i] *= throughput.max_element();
            set_rgb(&mut path.throughput, i, Rgb::ONE);
            path.sample[i] += DIRECT;
        }
    }

    /// Finds the diffuse share of what suffixes at glTF materials bring, after they were scattered.
    pub(in super::super) fn divide_lobes(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        if bounce > LAST_BOUNCE + 1 {
            return;
        }
        let Workspace { wave, reuse: Some(reuse), .. } = w else { return };
        let Wave { paths, vertices: v, .. } = &mut **wave;
        for i in sorted.metal_rough() {
            let sample = &mut paths.carried.sample[i];
            let k = reuse.place(*sample);
            let is_new = (DIRECT..SCATTERED).contains(sample) && reuse.prefixes.bounce[k] + 1 == bounce;
            if !is_new {
                continue;
            }
            *sample += SCATTERED - DIRECT;
            let closure = MetalRoughClass.closure(v, i);
            let material = get_rgb(&v.metal_rough.diffuse, i);
            let share = |wi| closure.share_of(material * FRAC_1_PI, wi);
            set_rgb(&mut reuse.suffixes.direct_share, k, share(get(&v.light.wi, i)));
            let is_mirrored = paths.carried.pdf[i] == 0.0;
            let scattered = if is_mirrored { Rgb::ZERO } else { share(get(&v.next_direction, i)) };
            set_rgb(&mut reuse.suffixes.scattered_share, k, scattered);
        }
    }
}

impl Integrator<'_> {
    /// What a layer leaves of the part of what leaves vertex `i` that is shared with others; `None` if none is.
    #[inline(always)]
    fn shared_part(&self, v: &Vertices, i: usize, class: u32) -> Option<f32> {
        if class == LAMBERT {
            return Some(1.0);
        }
        if get_rgb(&v.metal_rough.diffuse, i) == Rgb::ZERO || v.is_bent[i] > 0.0 {
            return None;
        }
        let rest = layer_rest(&v.metal_rough, i, get(&v.ns, i), get(&v.wo, i), self.scene.shading);
        (rest >= LEAST_REST).then_some(rest)
    }
}

/// Does a surface spread light enough for its viewers to be connected to other suffixes?
#[inline(always)]
fn spreads(v: &Vertices, i: usize, class: u32) -> bool {
    class == LAMBERT
        || v.metal_rough.alpha[i] >= LEAST_ALPHA
        || v.metal_rough_closures.probability_diffuse[i] > 0.1
}

impl Prefixes {
    /// Keeps vertex `i` of a wave as the end of the prefix at place `k`.
    #[inline(always)]
    fn keep(&mut self, k: usize, class: u32, bounce: u32, from: &Vertices, i: usize, throughput: Rgb) {
        let to = &mut self.vertices;
        let ng = get(&from.ng, i);
        set(&mut to.next_origin, k, offset_along(get(&from.p, i), ng, from.offset[i]));
        to.origin_primitives[k] = from.origin_primitives[i];
        set(&mut to.ng, k, ng);
        from.ns.copy_to(i, &mut to.ns, k);
        match class {
            LAMBERT => from.albedo.copy_to(i, &mut to.albedo, k),
            _ => {
                from.wo.copy_to(i, &mut to.wo, k);
                copy_metal_rough(from, i, to, k);
            }
        }
        from.guided.cell.copy_to(i, &mut to.guided.cell, k);
        set_rgb(&mut self.throughput, k, throughput);
        self.class[k] = class;
        self.bounce[k] = bounce;
    }
}

impl Suffixes {
    /// Keeps vertex `i` of a wave as the start of the suffix at place `k`.
    #[inline(always)]
    fn keep(&mut self, k: usize, class: u32, from: &Vertices, i: usize, throughput: Rgb, pdf: f32) {
        let (p, ng) = (get(&from.p, i), get(&from.ng, i));
        set(&mut self.p, k, p);
        set(&mut self.ng, k, ng);
        from.ns.copy_to(i, &mut self.ns, k);
        from.wo.copy_to(i, &mut self.wo, k);
        set(&mut self.target, k, offset_along(p, ng, from.offset[i]));
        set_rgb(&mut self.throughput, k, throughput);
        self.pdf[k] = pdf;
        self.class[k] = class;
        if class == METAL_ROUGH {
            from.metal_rough.copy_to(i, &mut self.material, k);
        }
    }
}
