//! Path reuse: recording the vertices where paths are cut, and connecting the prefixes of each group to its suffixes.

use super::{
    DIRECT, Diffuse, GroupLanes, GroupShape, LAMBERT, METAL_ROUGH, MIN_LAYER_TRANSMITTANCE, NONE, Pairs,
    PointVisibilityStats, Prefixes, Reuse, SCATTERED, SharedLayers, Suffixes, Tiling, layer_transmittance,
};
use crate::accel::{PointVisibility, PointVisibilityQuery, SetBits};
use crate::color::Rgb;
use crate::integrator::caustics::{excludes_diffuse_light, excludes_light};
use crate::integrator::interior::Interior;
use crate::integrator::radiance_buffer::{PathClass, RadianceBuffer};
use crate::integrator::sampling::FIRST_ROULETTE;
use crate::integrator::shading_geometry::{
    Sharp, SharpBumps, Soft, SoftBumps, Terminator, TerminatorCorrection, UNMAPPED, bent_normal,
};
use crate::integrator::shading_groups::{
    Closure, LambertClass, MetalRoughClass, SortedVertices, VertexClass, copy_metal_rough,
};
use crate::integrator::wave::{
    FirstBounce, Paths, PerPath, RgbLanes, Vertices, WAVE, Wave, get, get_rgb, set, set_rgb,
};
use crate::integrator::workspace::Workspace;
use crate::integrator::{Block, Integrator, guiding};
use crate::math::{Ray, offset_along, select};
use crate::simd::{Kernel, Table, dispatch};
use std::f32::consts::FRAC_1_PI;
use std::ops::Range;

// Recording: vertices that end prefixes or start suffixes.

/// The last bounce at which a prefix may end: before Russian roulette begins.
const LAST_BOUNCE: u32 = 2;
const _: () = assert!(LAST_BOUNCE < FIRST_ROULETTE);

/// Minimum GGX alpha of surfaces without a diffuse part for connections to other suffixes: below, these gain nothing.
const MIN_ALPHA: f32 = 0.1;

impl Integrator<'_> {
    /// Resets the buffers for a block, which is one wave.
    pub(in super::super) fn begin_reuse(
        &self,
        tiling: &Tiling,
        block: &Block,
        count: usize,
        w: &mut Workspace,
    ) {
        debug_assert!(count <= WAVE, "a block is one wave");
        let reuse = w.reuse.get_or_insert_with(|| Box::new(Reuse::new()));
        tiling.assign_slots(block, count, &mut reuse.slots);
        for (sample, &slot) in reuse.slots[..count].iter().enumerate() {
            reuse.samples[usize::from(slot)] = sample as u16;
        }
        reuse.visibility_stats = PointVisibilityStats::default();
        reuse.prefixes.class.fill(NONE);
        reuse.suffixes.class.fill(NONE);
        reuse.layers.reset(self.layers);
        w.radiance_buffer.extend(3 * WAVE);
    }

    /// Records the vertices where paths are cut into prefix and suffix. The suffix continues with throughput 1 and a separate entry of
    /// the radiance buffer.
    pub(in super::super) fn cut_paths(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        if bounce > LAST_BOUNCE + 1 {
            return;
        }
        let Workspace { wave, reuse: Some(reuse), radiance_buffer, .. } = w else { return };
        for i in sorted.lambert() {
            self.cut(bounce, i, LAMBERT, wave, reuse, radiance_buffer);
        }
        for i in sorted.metal_rough() {
            self.cut(bounce, i, METAL_ROUGH, wave, reuse, radiance_buffer);
        }
    }

    /// The key of a prefix that ends at vertex `i`: all path state that affects its suffixes. This is the number of bounces, whether
    /// suffixes exclude light that light tracing samples, and, if in use, the counts of bounces without random walks, of bounces by kind
    /// and of transparent surfaces. Bounce limits by kind and disabled caustics depend on the kind of the suffix's first ray, whose
    /// probabilities depend on the vertex class: with these, only prefixes of the same class share suffixes.
    fn prefix_key(&self, bounce: u32, i: usize, class: u32, paths: &Paths) -> u32 {
        let mut key =
            bounce << 1 | u32::from(self.optional.caustic_chains && excludes_light(paths.caustic_chains[i]));
        if self.optional.depth {
            key = key << 3 | paths.depth[i].min(7);
        }
        if self.optional.bounce_counts {
            key = key << 8 | paths.bounce_counts[i].bits();
        }
        if self.optional.transparent_count {
            key = key << 8 | paths.transparent_count[i].min(255);
        }
        if self.optional.visibility {
            key = key << 2 | class;
        }
        key
    }

    #[inline(always)]
    fn cut(
        &self,
        bounce: u32,
        i: usize,
        class: u32,
        wave: &mut Wave,
        reuse: &mut Reuse,
        radiance_buffer: &mut RadianceBuffer,
    ) {
        let Wave { paths, vertices: v, .. } = wave;
        let k = reuse.slot(paths.state.radiance_index[i]);
        let Reuse { prefixes, suffixes, .. } = reuse;
        if self.optional.caustic_chains
            && excludes_diffuse_light(paths.caustic_chains[i], get_rgb(&paths.caustic_chain_fraction, i))
        {
            return;
        }
        if prefixes.class[k] == NONE {
            let is_in_air = !self.optional.interior || paths.interior[i] == Interior::AIR;
            if bounce <= LAST_BOUNCE && is_in_air && is_connectible(v, i, class) {
                prefixes.keep(k, class, bounce, v, i, get_rgb(&paths.state.throughput, i));
                prefixes.keys[k] = self.prefix_key(bounce, i, class, paths);
                if self.optional.first_bounces {
                    let is_first = bounce == 0;
                    let first = if is_first { FirstBounce::DIFFUSE } else { paths.first_bounces.get(i) };
                    prefixes.first_bounces.set(k, first);
                }
            }
        } else if prefixes.bounce[k] + 1 == bounce && paths.state.pdf[i].competes() {
            let Some(rest) = self.shared_part(v, i, class) else { return };
            let path = &mut paths.state;
            let mut throughput = get_rgb(&path.throughput, i);
            let mut begin = Rgb::ONE;
            if self.optional.component_weight {
                // The weight of a mix's selected component belongs to the suffix.
                begin = get_rgb(&paths.component_weight, i);
                throughput = throughput.zip(begin, |t, weight| if weight > 0.0 { t / weight } else { 0.0 });
            }
            suffixes.keep(k, class, v, i, throughput, path.pdf[i].value());
            suffixes.layer_transmittance[k] = rest;
            if self.optional.first_bounces {
                paths.first_bounces.copy_to(i, &mut suffixes.first_bounces, k);
            }
            // Russian roulette uses the throughput of the whole path.
            path.roulette_scale[i] *= throughput.max_element();
            set_rgb(&mut path.throughput, i, begin);
            let sample = path.radiance_index[i];
            radiance_buffer.scale_clamp([sample + DIRECT, sample + SCATTERED], throughput);
            path.radiance_index[i] += DIRECT;
        }
    }

    /// Computes the diffuse fraction of the radiance of suffixes at glTF materials, after scattering.
    pub(in super::super) fn divide_lobes(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        if bounce > LAST_BOUNCE + 1 {
            return;
        }
        let Workspace { wave, reuse: Some(reuse), .. } = w else { return };
        let Wave { paths, vertices: v, .. } = &mut **wave;
        for i in sorted.metal_rough() {
            let sample = &mut paths.state.radiance_index[i];
            let k = reuse.slot(*sample);
            let is_new = (DIRECT..SCATTERED).contains(sample) && reuse.prefixes.bounce[k] + 1 == bounce;
            if !is_new {
                continue;
            }
            *sample += SCATTERED - DIRECT;
            let closure = MetalRoughClass.closure(v, i);
            let material = get_rgb(&v.metal_rough.diffuse, i);
            let fraction = |wi| closure.diffuse_fraction_of(material * FRAC_1_PI, wi);
            set_rgb(&mut reuse.suffixes.direct_fraction, k, fraction(get(&v.light.wi, i)));
            let is_mirrored = paths.state.pdf[i].is_specular();
            let scattered = if is_mirrored { Rgb::ZERO } else { fraction(get(&v.next_direction, i)) };
            set_rgb(&mut reuse.suffixes.scattered_fraction, k, scattered);
        }
    }

    /// Transmittance of the layer above the diffuse base of vertex `i`, whose radiance is shared; `None` if nothing is shared.
    #[inline(always)]
    fn shared_part(&self, v: &Vertices, i: usize, class: u32) -> Option<f32> {
        if class == LAMBERT {
            return Some(1.0);
        }
        if get_rgb(&v.metal_rough.diffuse, i) == Rgb::ZERO || v.is_bent[i] > 0.0 {
            return None;
        }
        let rest = layer_transmittance(&v.metal_rough, i, get(&v.ns, i), get(&v.wo, i), self.scene.shading);
        (rest >= MIN_LAYER_TRANSMITTANCE).then_some(rest)
    }
}

/// Is a surface rough enough to connect prefixes that end there to other suffixes?
#[inline(always)]
fn is_connectible(v: &Vertices, i: usize, class: u32) -> bool {
    class == LAMBERT
        || v.metal_rough.alpha[i] >= MIN_ALPHA
        || v.metal_rough_closures.probability_diffuse[i] > 0.1
}

impl Prefixes {
    /// Records vertex `i` of a wave as the end of the prefix in slot `k`.
    #[inline(always)]
    fn keep(&mut self, k: usize, class: u32, bounce: u32, from: &Vertices, i: usize, throughput: Rgb) {
        let to = &mut self.vertices;
        let ng = get(&from.ng, i);
        set(&mut to.next_origin, k, offset_along(get(&from.p, i), ng, from.offset[i]));
        to.origin_primitives[k] = from.origin_primitives[i];
        set(&mut to.ng, k, ng);
        from.ns.copy_to(i, &mut to.ns, k);
        to.bump_mode[k] = from.bump_mode[i];
        if from.bump_mode[i] != UNMAPPED {
            from.smooth_normal.copy_to(i, &mut to.smooth_normal, k);
        }
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
    /// Records vertex `i` of a wave as the start of the suffix in slot `k`.
    #[inline(always)]
    fn keep(&mut self, k: usize, class: u32, from: &Vertices, i: usize, throughput: Rgb, pdf: f32) {
        let (p, ng) = (get(&from.p, i), get(&from.ng, i));
        set(&mut self.p, k, p);
        set(&mut self.ng, k, ng);
        from.ns.copy_to(i, &mut self.ns, k);
        from.wo.copy_to(i, &mut self.wo, k);
        set(&mut self.target, k, offset_along(p, ng, from.offset[i]));
        set_rgb(&mut self.throughput, k, throughput);
        self.pdf_solid_angle[k] = pdf;
        self.class[k] = class;
        if class == METAL_ROUGH {
            from.metal_rough.copy_to(i, &mut self.material, k);
        }
    }
}

// Evaluation: contribution of one suffix to every prefix of a group, in vectorised loops.

/// Slots per vectorised loop: part of a group, or several groups.
pub const RUN: usize = 16;
const _: () = assert!(WAVE.is_multiple_of(RUN) && WAVE.is_multiple_of(GroupShape::MAX_PIXELS as usize));

/// Computes pdf and value of the connections of a class's prefixes in runs of slots.
pub struct Connect<'a, C, T> {
    pub correction: T,
    pub class: C,
    /// The class in [`Prefixes::class`].
    pub class_id: u32,
    pub runs: &'a [u16],
    pub prefixes: &'a Prefixes,
    pub pairs: &'a mut Pairs,
}

impl<C: VertexClass, T: TerminatorCorrection> Kernel for Connect<'_, C, T> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Connect { correction, class, class_id, runs, prefixes, pairs } = self;
        let v = &prefixes.vertices;
        for &run in runs {
            // The bound lets the compiler drop bounds checks.
            let first = (usize::from(run) * RUN).min(WAVE - RUN);
            for i in first..first + RUN {
                let offset = get(&pairs.y, i) - get(&v.next_origin, i);
                let squared = offset.dot(offset);
                let wi = offset / squared.sqrt();
                let (ng, ns) = (get(&v.ng, i), get(&v.ns, i));
                let closure = class.closure(v, i);
                let eval = closure.eval(wi);
                let cosine = -wi.dot(get(&pairs.ng, i));
                let geometry = cosine / squared;
                let kept = correction.light_factor(v, i, [ns, ng], 1.0, wi);
                let (eval, bump_factor) =
                    closure.apply_bump_terminator(correction, (v, i), (ns, 1.0), (wi, eval));
                let value = get_rgb(&prefixes.throughput, i) * eval.f_cos * (kept * bump_factor);
                let faces = (cosine > 0.0) & (wi.dot(ng) > 0.0) & (eval.pdf_solid_angle > 0.0);
                // Paths without throughput end, so a connection with value 0 has pdf 0.
                let [r, g, b] = value.to_array();
                let has_value = (r > 0.0) | (g > 0.0) | (b > 0.0);
                let has_equal_key = prefixes.keys[i] == pairs.keys[i];
                let connects = faces & has_value & has_equal_key;
                let is_own_class = prefixes.class[i] == class_id;
                let density = if connects { eval.pdf_solid_angle * geometry } else { 0.0 };
                pairs.pdf_area[i] = if is_own_class { density } else { pairs.pdf_area[i] };
                let value = value * geometry;
                let other = get_rgb(&pairs.value, i);
                let chosen = Rgb::select(is_own_class, value, other);
                set_rgb(&mut pairs.value, i, chosen);
            }
        }
    }
}

/// Multiplies the pdfs of connections in runs of slots by the factor of guiding.
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
                let offset = get(&pairs.y, i) - get(&v.next_origin, i);
                let wi = offset / offset.dot(offset).sqrt();
                let is_lambert = prefixes.class[i] == LAMBERT;
                let is_metal_rough = prefixes.class[i] == METAL_ROUGH;
                // Other slots have no cell.
                let cell = v.guided.cell[i] * u32::from(is_lambert | is_metal_rough);
                let normal = select(is_metal_rough, get(&v.base_normal, i), get(&v.ns, i));
                let density = densities.at(guiding::bin_index(cell, normal, wi));
                let factor = MetalRoughClass.closure(v, i).guided(wi, density);
                let factor = if is_metal_rough { factor } else { 1.0 };
                pairs.pdf_area[i] *= if is_lambert { density } else { factor };
            }
        }
    }
}

/// The slots of the group, of `group` slots, that a slot belongs to.
#[inline(always)]
pub fn group_of(slot: usize, group: usize) -> Range<usize> {
    let first = slot - slot % group;
    first..(first + group).min(WAVE)
}

/// The suffixes of a round and the prefixes of their groups.
#[derive(Clone, Copy)]
pub struct Exchange<'a> {
    /// Slots of the suffixes.
    pub owners: &'a [u16],
    /// Number of slots of a group.
    pub group: usize,
    pub prefixes: &'a Prefixes,
    pub suffixes: &'a Suffixes,
    pub pairs: &'a Pairs,
}

impl Exchange<'_> {
    /// Adds `radiance` of the suffixes to the prefixes, by slot, with MIS weights: to the owners times `throughput`, to others times
    /// `value` (see [`Pairs::value`]).
    pub fn receive(
        self,
        radiance: &RgbLanes,
        throughput: &RgbLanes,
        value: &RgbLanes,
        received: &mut RgbLanes,
    ) {
        dispatch(Receive { exchange: self, radiance, throughput, value, received });
    }
}

/// Kernel of [`Exchange::receive`]. The order of summation does not depend on the CPU.
struct Receive<'a> {
    exchange: Exchange<'a>,
    radiance: &'a RgbLanes,
    throughput: &'a RgbLanes,
    value: &'a RgbLanes,
    received: &'a mut RgbLanes,
}

impl Kernel for Receive<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Exchange { owners, group, prefixes, suffixes: s, pairs } = self.exchange;
        let received = self.received;
        for &owner in owners {
            let owner = usize::from(owner).min(WAVE - 1);
            let slots = group_of(owner, group);
            let mut sums = [0.0; 4];
            let (fours, rest) = pairs.pdf_area[slots.clone()].as_chunks::<4>();
            for four in fours {
                for k in 0..4 {
                    sums[k] += four[k];
                }
            }
            for (sum, density) in sums.iter_mut().zip(rest) {
                *sum += density;
            }
            let own = s.own_pdf_area(owner, prefixes);
            let sum = own + ((sums[0] + sums[1]) + (sums[2] + sums[3]));
            let radiance = get_rgb(self.radiance, owner);
            // The pdf overflows for points very close to each other.
            let is_finite = own > 0.0 && sum < f32::INFINITY;
            let mis_weight = if is_finite { own / sum } else { 1.0 };
            let value =
                get_rgb(self.throughput, owner) * radiance * (s.layer_transmittance[owner] * mis_weight);
            let total = get_rgb(received, owner) + value;
            set_rgb(received, owner, total);
            if is_finite {
                let is_layered = s.class[owner] == METAL_ROUGH;
                let scaled = (radiance * (1.0 / sum)).to_array();
                for c in 0..3 {
                    for i in slots.clone() {
                        let rest = if is_layered { pairs.layer_transmittance[i] } else { 1.0 };
                        let value = self.value[c][i] * (scaled[c] * rest);
                        received[c][i] += if pairs.pdf_area[i] > 0.0 { value } else { 0.0 };
                    }
                }
            }
        }
    }
}

impl Suffixes {
    /// Area pdf, 1/m^2, with which the owner sampled its suffix's start.
    #[inline(always)]
    fn own_pdf_area(&self, k: usize, prefixes: &Prefixes) -> f32 {
        let offset = get(&self.p, k) - get(&prefixes.vertices.next_origin, k);
        let cosine = get(&self.wo, k).dot(get(&self.ng, k));
        self.pdf_solid_angle[k] * cosine / offset.dot(offset)
    }
}

// Light passes and light groups of connected paths. They have at least two bounces, so they are indirect. The first bounce of the prefix
// selects the light pass; if the prefix ends there, the direction to the suffix does. Radiance of light groups uses the same weights.

impl SharedLayers {
    /// Stores the shared radiance of suffix `k` by light group, and adds the rest to its owner's layers.
    pub fn finish_suffix(
        &mut self,
        k: usize,
        sample: u32,
        s: &Suffixes,
        own: Rgb,
        is_usable: bool,
        radiance_buffer: &mut RadianceBuffer,
    ) {
        let throughput = get_rgb(&s.throughput, k);
        if let Some(diffuse) = &mut self.diffuse {
            let first = s.first_bounces.get(k);
            set_rgb(&mut diffuse.throughput, k, throughput * first.diffuse);
            radiance_buffer.add_to_passes(sample, throughput * own, PathClass::Indirect(first));
        }
        for (g, group) in self.groups.iter_mut().enumerate() {
            let direct = radiance_buffer.radiance_of(sample + DIRECT, g);
            let scattered = radiance_buffer.radiance_of(sample + SCATTERED, g);
            let (radiance, own) = match is_usable {
                true => s.divide(k, direct, scattered),
                false => (Rgb::ZERO, direct + scattered),
            };
            set_rgb(&mut group.radiance, k, radiance);
            radiance_buffer.add_to_group(sample, throughput * own, g as u16);
        }
    }

    /// Adds the layers of a round's suffixes to the prefixes.
    pub fn receive(&mut self, exchange: Exchange<'_>) {
        let Exchange { owners, group, prefixes, suffixes: s, pairs } = exchange;
        if let Some(diffuse) = &mut self.diffuse {
            let Diffuse { value, throughput, received } = &mut **diffuse;
            fill_diffuse(owners, group, prefixes, pairs, value);
            exchange.receive(&s.radiance, throughput, value, received);
        }
        for group_lanes in &mut self.groups {
            let GroupLanes { radiance, received } = &mut **group_lanes;
            exchange.receive(radiance, &s.throughput, &pairs.value, received);
        }
    }

    /// Adds the radiance received by prefix `k`, `total` in all, to the layers of its sample.
    pub fn deliver(
        &self,
        k: usize,
        sample: u32,
        total: Rgb,
        prefixes: &Prefixes,
        radiance_buffer: &mut RadianceBuffer,
    ) {
        if let Some(diffuse) = &self.diffuse {
            let mut first = prefixes.first_bounces.get(k);
            let of_diffuse = get_rgb(&diffuse.received, k).min(total);
            first.diffuse = Rgb::ONE;
            radiance_buffer.add_to_passes(sample, of_diffuse, PathClass::Indirect(first));
            first.diffuse = Rgb::ZERO;
            radiance_buffer.add_to_passes(sample, total - of_diffuse, PathClass::Indirect(first));
        }
        for (g, group) in self.groups.iter().enumerate() {
            radiance_buffer.add_to_group(sample, get_rgb(&group.received, k), g as u16);
        }
    }
}

/// Computes the diffuse part of the connections' values in a round.
fn fill_diffuse(owners: &[u16], group: usize, prefixes: &Prefixes, pairs: &Pairs, value: &mut RgbLanes) {
    let v = &prefixes.vertices;
    for &owner in owners {
        for i in group_of(usize::from(owner), group).filter(|&i| pairs.pdf_area[i] > 0.0) {
            let is_first = prefixes.bounce[i] == 0 && prefixes.class[i] == METAL_ROUGH;
            let fraction = match is_first {
                true => {
                    let wi = (get(&pairs.y, i) - get(&v.next_origin, i)).normalize();
                    MetalRoughClass.closure(v, i).diffuse_fraction(wi)
                }
                false => prefixes.first_bounces.get(i).diffuse,
            };
            set_rgb(value, i, get_rgb(&pairs.value, i) * fraction);
        }
    }
}

impl Reuse {
    /// Adds the radiance received by all prefixes to their samples.
    pub fn deliver(&self, radiance_buffer: &mut RadianceBuffer) {
        for (k, &sample) in self.samples[..WAVE].iter().enumerate() {
            let (sample, received) = (u32::from(sample), get_rgb(&self.received, k));
            radiance_buffer.add(sample, received);
            self.layers.deliver(k, sample, received, &self.prefixes, radiance_buffer);
        }
    }
}

// Connection of each prefix of a group to each suffix.

/// Minimum group size for testing the visibility of a point together: fewer shadow rays are faster one by one.
const MIN_GROUP: usize = 16;

/// Minimum number of shadow rays for testing together.
const MIN_RAYS: u32 = 5;

/// Key for a missing suffix, which no prefix has.
const NO_KEY: u32 = u32::MAX;

impl Integrator<'_> {
    /// Connects every prefix to all suffixes of its group.
    pub(in super::super) fn reuse_paths(&self, tiling: &Tiling, w: &mut Workspace) {
        let Some(mut reuse) = w.reuse.take() else { return };
        self.finish_suffixes(&mut reuse, w);
        let has = |class| reuse.prefixes.class[..WAVE].contains(&class);
        let classes = [LAMBERT, METAL_ROUGH].map(has);
        reuse.received.as_flattened_mut().fill(0.0);
        let mut round = Round { group: tiling.group(), ..Round::default() };
        for member in 0..tiling.group() {
            round.copy_suffixes(member, &mut reuse);
            if round.runs.is_empty() {
                continue;
            }
            match self.terminator() {
                Terminator::Sharp => connect(Sharp, classes, &round.runs, &mut reuse),
                Terminator::Soft => connect(Soft, classes, &round.runs, &mut reuse),
                Terminator::SoftBumps => connect(SoftBumps, classes, &round.runs, &mut reuse),
                Terminator::SharpBumps => connect(SharpBumps, classes, &round.runs, &mut reuse),
            }
            self.guide_pairs(&round, &mut reuse);
            self.test_visibility(&round, &mut reuse, w);
            let Reuse { prefixes, suffixes, pairs, received, layers, .. } = &mut *reuse;
            let exchange = Exchange { owners: &round.owners, group: round.group, prefixes, suffixes, pairs };
            exchange.receive(&suffixes.radiance, &suffixes.throughput, &pairs.value, received);
            layers.receive(exchange);
        }
        reuse.deliver(&mut w.radiance_buffer);
        w.reuse = Some(reuse);
    }

    /// Sums the radiance of each suffix, and adds the part that is not shared to its owner.
    fn finish_suffixes(&self, reuse: &mut Reuse, w: &mut Workspace) {
        if self.options.records_baseline {
            w.radiance_buffer.copy_to_baseline();
        }
        let Reuse { suffixes: s, samples, layers, .. } = reuse;
        for (k, &sample) in samples[..WAVE].iter().enumerate() {
            if s.class[k] == NONE {
                continue;
            }
            let sample = u32::from(sample);
            let (direct, scattered) =
                (w.radiance_buffer.radiance(sample + DIRECT), w.radiance_buffer.radiance(sample + SCATTERED));
            let throughput = get_rgb(&s.throughput, k);
            if self.options.records_baseline {
                w.radiance_buffer.add_to_baseline(sample, throughput * (direct + scattered));
            }
            let (radiance, mut own) = s.divide(k, direct, scattered);
            let is_usable = radiance.is_finite() && radiance.max_element() > 0.0;
            if !is_usable {
                own = direct + scattered;
            }
            w.radiance_buffer.add(sample, throughput * own);
            layers.finish_suffix(k, sample, s, own, is_usable, &mut w.radiance_buffer);
            if !is_usable {
                s.class[k] = NONE;
            }
            set_rgb(&mut s.radiance, k, radiance);
        }
    }

    /// Applies path guiding to the pdfs.
    fn guide_pairs(&self, round: &Round, reuse: &mut Reuse) {
        if let Some(guide) = self.options.guide {
            let Reuse { prefixes, pairs, .. } = reuse;
            let densities = guide.densities();
            dispatch(GuidePairs { runs: &round.runs, densities, prefixes, pairs });
        }
    }

    /// Sets the pdf of occluded connections to 0.
    ///
    /// Surfaces with stochastic transparency or refraction count as opaque: the balance heuristic needs the exact visibility, not an
    /// estimate. Suffixes sampled through them are not shared: in scenes with such surfaces, the owner's connection is tested too.
    fn test_visibility(&self, round: &Round, reuse: &mut Reuse, w: &mut Workspace) {
        let tests_owner = self.scene.features.alpha;
        for &owner in &round.owners {
            reuse.pairs.pdf_area[usize::from(owner)] = if tests_owner { 1.0 } else { 0.0 };
        }
        self.test_layers(round, reuse);
        w.shadow_rays.clear();
        w.shadow_vertices.clear();
        for &owner in &round.owners {
            let owner = usize::from(owner);
            let slots = group_of(owner, round.group);
            let mut tested = positive(&reuse.pairs.pdf_area[slots.clone()]);
            if round.group >= MIN_GROUP && reuse.visibility_stats.are_worthwhile() {
                tested = self.test_point_visibility(owner, round.group, tested, reuse, w);
            }
            let Reuse { prefixes, suffixes, .. } = &*reuse;
            let target = get(&suffixes.target, owner);
            for k in SetBits(tested) {
                let i = slots.start + k;
                let origin = get(&prefixes.vertices.next_origin, i);
                let origin_primitive = prefixes.vertices.origin_primitives[i];
                w.shadow_rays.push(Ray { origin_primitive, ..Ray::segment(origin, target - origin) });
                w.shadow_vertices.push(i as u32);
            }
        }
        w.occluded.clear();
        w.occluded.resize(w.shadow_rays.len(), false);
        self.scene.accel.occluded(&w.shadow_rays, &mut w.occluded);
        w.ray_counts.all += w.shadow_rays.len() as u64;
        w.ray_counts.single += w.shadow_rays.len() as u64;
        for (&i, &occluded) in w.shadow_vertices.iter().zip(&w.occluded) {
            if occluded {
                reuse.pairs.pdf_area[i as usize] = 0.0;
            }
        }
        if tests_owner {
            for &owner in &round.owners {
                let owner = usize::from(owner);
                let is_owner_blocked = reuse.pairs.pdf_area[owner] == 0.0;
                let none = if is_owner_blocked { group_of(owner, round.group) } else { owner..owner + 1 };
                reuse.pairs.pdf_area[none].fill(0.0);
            }
        }
    }

    /// Tests the connections of a group's prefixes to a suffix together; `tested` is a bit set. Returns those that must be tested one by
    /// one.
    fn test_point_visibility(
        &self,
        owner: usize,
        group: usize,
        tested: u64,
        reuse: &mut Reuse,
        w: &mut Workspace,
    ) -> u64 {
        if tested.count_ones() < MIN_RAYS {
            return tested;
        }
        let Reuse { prefixes, suffixes, pairs, visibility_stats, .. } = reuse;
        let slots = group_of(owner, group);
        let vertices = &prefixes.vertices;
        let query = PointVisibilityQuery {
            target: get(&suffixes.target, owner),
            origins: vertices.next_origin.each_ref().map(|lanes| &lanes[slots.clone()]),
            origin_primitives: &vertices.origin_primitives[slots.clone()],
            rays: tested,
        };
        let accel = &self.scene.accel;
        let PointVisibility { occluded_rays, unknown } = accel.point_visibility(&query, |_| false);
        visibility_stats.count(2 * unknown.count_ones() > tested.count_ones());
        for k in SetBits(occluded_rays) {
            pairs.pdf_area[slots.start + k] = 0.0;
        }
        let known = u64::from((tested & !unknown).count_ones());
        w.ray_counts.all += known;
        w.ray_counts.point_visibility += known;
        unknown
    }

    /// Computes layer transmittances at the suffixes towards the prefixes; connections below [`MIN_LAYER_TRANSMITTANCE`] count as occluded.
    fn test_layers(&self, round: &Round, reuse: &mut Reuse) {
        let Reuse { prefixes, suffixes, pairs, .. } = reuse;
        for &owner in &round.owners {
            let owner = usize::from(owner);
            if suffixes.class[owner] != METAL_ROUGH {
                continue;
            }
            let (p, ns, ng) = (get(&suffixes.p, owner), get(&suffixes.ns, owner), get(&suffixes.ng, owner));
            for i in group_of(owner, round.group) {
                if pairs.pdf_area[i] <= 0.0 {
                    continue;
                }
                let wo = (get(&prefixes.vertices.next_origin, i) - p).normalize();
                pairs.layer_transmittance[i] =
                    layer_transmittance(&suffixes.material, owner, ns, wo, self.scene.shading);
                let (_, is_bent) = bent_normal(ns, ng, wo);
                // The same conditions as in `shared_part`.
                if is_bent || pairs.layer_transmittance[i] < MIN_LAYER_TRANSMITTANCE {
                    pairs.pdf_area[i] = 0.0;
                }
            }
        }
    }
}

/// The bit set of positive numbers.
fn positive(densities: &[f32]) -> u64 {
    densities.iter().enumerate().fold(0, |set, (k, density)| set | u64::from(*density > 0.0) << k)
}

/// A round of connections: one suffix of each group.
#[derive(Default)]
struct Round {
    /// Number of slots of a group.
    group: usize,
    /// Runs of slots with a suffix.
    runs: Vec<u16>,
    /// Slots of the suffixes.
    owners: Vec<u16>,
}

impl Round {
    /// Copies the suffix with index `member` of each group to all slots of its group.
    fn copy_suffixes(&mut self, member: usize, reuse: &mut Reuse) {
        let Reuse { prefixes, suffixes: s, pairs, .. } = reuse;
        self.owners.clear();
        self.runs.clear();
        for first in (0..WAVE).step_by(self.group) {
            let owner = first + member;
            let slots = first..first + self.group;
            if s.class[owner] == NONE {
                pairs.keys[slots].fill(NO_KEY);
                continue;
            }
            pairs.keys[slots.clone()].fill(prefixes.keys[owner]);
            for c in 0..3 {
                pairs.y[c][slots.clone()].fill(s.p[c][owner]);
                pairs.ng[c][slots.clone()].fill(s.ng[c][owner]);
            }
            self.owners.push(owner as u16);
            for run in first / RUN..(first + self.group).div_ceil(RUN) {
                if self.runs.last() != Some(&(run as u16)) {
                    self.runs.push(run as u16);
                }
            }
        }
    }
}

/// Computes the connections of a round, with a loop per class of prefixes.
fn connect<T: TerminatorCorrection>(
    correction: T,
    [lambert, metal_rough]: [bool; 2],
    runs: &[u16],
    reuse: &mut Reuse,
) {
    let Reuse { prefixes, pairs, .. } = reuse;
    for &run in runs {
        let slots = usize::from(run) * RUN..(usize::from(run) + 1) * RUN;
        pairs.pdf_area[slots].fill(0.0);
    }
    if lambert {
        let (class, class_id) = (LambertClass, LAMBERT);
        dispatch(Connect { correction, class, class_id, runs, prefixes, pairs });
    }
    if metal_rough {
        let (class, class_id) = (MetalRoughClass, METAL_ROUGH);
        dispatch(Connect { correction, class, class_id, runs, prefixes, pairs });
    }
}
