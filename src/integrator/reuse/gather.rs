//! The paths of a group are shared: each prefix is connected to each suffix.

use super::super::Integrator;
use super::super::shading_geometry::bent_normal;
use super::super::shading_groups::{LambertClass, MetalRoughClass};
use super::super::wave::{WAVE, get, get_rgb, set_rgb};
use super::super::workspace::Workspace;
use super::Tiling;
use super::layer::{LEAST_REST, layer_rest};
use super::pairs::{Connect, Exchange, GuidePairs, RUN, group_of};
use super::state::{DIRECT, LAMBERT, METAL_ROUGH, NONE, Reuse, SCATTERED};
use crate::accel::{Bits, Fan, FanHits};
use crate::math::{Hit, Ray};
use crate::simd::dispatch;

/// Groups from this size on test visibility together: fewer rays are sooner tested one by one.
const FAN: usize = 16;

/// So do sets of at least this many rays.
const LEAST_RAYS: u32 = 5;

/// How prefixes end for a suffix that isn't there.
const NO_END: u32 = u32::MAX;

impl Integrator<'_> {
    /// Brings to every prefix what the suffixes of its group found.
    pub(in super::super) fn share_paths(&self, tiling: &Tiling, w: &mut Workspace) {
        let Some(mut reuse) = w.reuse.take() else { return };
        self.finish_suffixes(&mut reuse, w);
        let has = |class| reuse.prefixes.class[..WAVE].contains(&class);
        let classes = [LAMBERT, METAL_ROUGH].map(has);
        reuse.gained.as_flattened_mut().fill(0.0);
        let mut round = Round { group: tiling.group(), ..Round::default() };
        for turn in 0..tiling.group() {
            round.take_turn(turn, &mut reuse);
            if round.runs.is_empty() {
                continue;
            }
            if self.softens_terminator() {
                connect::<true>(classes, &round.runs, &mut reuse);
            } else {
                connect::<false>(classes, &round.runs, &mut reuse);
            }
            self.guide_pairs(&round, &mut reuse);
            self.test_visibility(&round, &mut reuse, w);
            let Reuse { prefixes, suffixes, pairs, gained, layers, .. } = &mut *reuse;
            let exchange =
                Exchange { senders: &round.senders, group: round.group, prefixes, suffixes, pairs };
            exchange.receive(&suffixes.radiance, &suffixes.throughput, &pairs.value, gained);
            layers.receive(exchange);
        }
        reuse.deliver(&mut w.sink);
        w.reuse = Some(reuse);
    }

    /// Sums up what leaves each suffix. What is not shared goes to its owner.
    fn finish_suffixes(&self, reuse: &mut Reuse, w: &mut Workspace) {
        if self.options.keeps_plain {
            w.sink.keep_plain();
        }
        let Reuse { suffixes: s, samples, layers, .. } = reuse;
        for (k, &sample) in samples[..WAVE].iter().enumerate() {
            if s.class[k] == NONE {
                continue;
            }
            let sample = u32::from(sample);
            let (direct, scattered) = (w.sink.radiance(sample + DIRECT), w.sink.radiance(sample + SCATTERED));
            let throughput = get_rgb(&s.throughput, k);
            if self.options.keeps_plain {
                w.sink.add_plain(sample, throughput * (direct + scattered));
            }
            let (radiance, mut own) = s.divide(k, direct, scattered);
            let is_usable = radiance.is_finite() && radiance.max_element() > 0.0;
            if !is_usable {
                own = direct + scattered;
            }
            w.sink.add(sample, throughput * own);
            layers.finish_suffix(k, sample, s, own, is_usable, &mut w.sink);
            if !is_usable {
                s.class[k] = NONE;
            }
            set_rgb(&mut s.radiance, k, radiance);
        }
    }

    /// Makes the densities those of prefixes that are guided.
    fn guide_pairs(&self, round: &Round, reuse: &mut Reuse) {
        if let Some(guide) = self.options.guide {
            let Reuse { prefixes, pairs, .. } = reuse;
            let densities = guide.densities();
            dispatch(GuidePairs { runs: &round.runs, densities, prefixes, pairs });
        }
    }

    /// Prefixes that can't reach the suffix of their turn get no density; neither does the owner, which needs no test.
    fn test_visibility(&self, round: &Round, reuse: &mut Reuse, w: &mut Workspace) {
        for &sender in &round.senders {
            reuse.pairs.density[usize::from(sender)] = 0.0;
        }
        self.test_layers(round, reuse);
        w.shadow_rays.clear();
        w.shadow_vertices.clear();
        for &sender in &round.senders {
            let sender = usize::from(sender);
            let places = group_of(sender, round.group);
            let mut asked = positive(&reuse.pairs.density[places.clone()]);
            if round.group >= FAN && reuse.fans.are_worth_it() {
                asked = self.test_fan(sender, round.group, asked, reuse, w);
            }
            let Reuse { prefixes, suffixes, .. } = &*reuse;
            let target = get(&suffixes.target, sender);
            for k in Bits(asked) {
                let i = places.start + k;
                let origin = get(&prefixes.vertices.next_origin, i);
                let origin_primitive = prefixes.vertices.origin_primitives[i];
                w.shadow_rays.push(Ray { origin_primitive, ..Ray::segment(origin, target - origin) });
                w.shadow_vertices.push(i as u32);
            }
        }
        let before = w.ray_counts.all;
        // Whatever the bounce: surfaces that are absent at random, whose random numbers differ by it, are in no scene that is
        // shared; lamps that stop no light may be.
        self.test_shadow_rays(1, w);
        w.ray_counts.single += w.ray_counts.all - before;
        for (&i, &occluded) in w.shadow_vertices.iter().zip(&w.occluded) {
            if occluded {
                reuse.pairs.density[i as usize] = 0.0;
            }
        }
    }

    /// The prefixes of a group together against a suffix. Returns those that must be tested one by one.
    fn test_fan(&self, sender: usize, group: usize, asked: u64, reuse: &mut Reuse, w: &mut Workspace) -> u64 {
        if asked.count_ones() < LEAST_RAYS {
            return asked;
        }
        let Reuse { prefixes, suffixes, pairs, fans, .. } = reuse;
        let places = group_of(sender, group);
        let vertices = &prefixes.vertices;
        let fan = Fan {
            target: get(&suffixes.target, sender),
            origins: vertices.next_origin.each_ref().map(|lanes| &lanes[places.clone()]),
            origin_primitives: &vertices.origin_primitives[places.clone()],
            rays: asked,
        };
        let accel = &self.scene.accel;
        let FanHits { stopped, unknown } = match self.scene.features.alpha {
            true => accel
                .occluded_fan(&fan, |prim| self.may_be_absent_at(&Hit { prim, instance: 0, ..Hit::MISS })),
            false => accel.occluded_fan(&fan, |_| false),
        };
        fans.count(2 * unknown.count_ones() > asked.count_ones());
        for k in Bits(stopped) {
            pairs.density[places.start + k] = 0.0;
        }
        let known = u64::from((asked & !unknown).count_ones());
        w.ray_counts.all += known;
        w.ray_counts.in_fans += known;
        unknown
    }

    /// What the layers of glTF materials at the suffixes leave towards the prefixes; too little is as good as hidden.
    fn test_layers(&self, round: &Round, reuse: &mut Reuse) {
        let Reuse { prefixes, suffixes, pairs, .. } = reuse;
        for &sender in &round.senders {
            let sender = usize::from(sender);
            if suffixes.class[sender] != METAL_ROUGH {
                continue;
            }
            let (p, ns, ng) =
                (get(&suffixes.p, sender), get(&suffixes.ns, sender), get(&suffixes.ng, sender));
            for i in group_of(sender, round.group) {
                if pairs.density[i] <= 0.0 {
                    continue;
                }
                let wo = (get(&prefixes.vertices.next_origin, i) - p).normalize();
                pairs.rest[i] = layer_rest(&suffixes.material, sender, ns, wo, self.scene.shading);
                let (_, is_bent) = bent_normal(ns, ng, wo);
                // As for the owner.
                if is_bent || pairs.rest[i] < LEAST_REST {
                    pairs.density[i] = 0.0;
                }
            }
        }
    }
}

/// Which numbers are positive, one bit each.
fn positive(densities: &[f32]) -> u64 {
    densities.iter().enumerate().fold(0, |set, (k, density)| set | u64::from(*density > 0.0) << k)
}

/// Which suffixes are connected at a time: one of each group.
#[derive(Default)]
struct Round {
    /// Places of a group.
    group: usize,
    /// Which member of each group.
    turn: usize,
    /// Runs of places with a suffix.
    runs: Vec<u16>,
    /// Places of the suffixes.
    senders: Vec<u16>,
}

impl Round {
    /// Hands the suffixes of a member of each group to the members.
    fn take_turn(&mut self, turn: usize, reuse: &mut Reuse) {
        let Reuse { prefixes, suffixes: s, pairs, .. } = reuse;
        self.turn = turn;
        self.senders.clear();
        self.runs.clear();
        for first in (0..WAVE).step_by(self.group) {
            let sender = first + turn;
            let places = first..first + self.group;
            if s.class[sender] == NONE {
                pairs.ends[places].fill(NO_END);
                continue;
            }
            pairs.ends[places.clone()].fill(prefixes.ends[sender]);
            for c in 0..3 {
                pairs.y[c][places.clone()].fill(s.p[c][sender]);
                pairs.ng[c][places.clone()].fill(s.ng[c][sender]);
            }
            self.senders.push(sender as u16);
            for run in first / RUN..(first + self.group).div_ceil(RUN) {
                if self.runs.last() != Some(&(run as u16)) {
                    self.runs.push(run as u16);
                }
            }
        }
    }
}

/// Fills the pairs of a round, by the loops of the classes that there are.
fn connect<const SOFT: bool>([lambert, metal_rough]: [bool; 2], runs: &[u16], reuse: &mut Reuse) {
    let Reuse { prefixes, pairs, .. } = reuse;
    for &run in runs {
        let places = usize::from(run) * RUN..(usize::from(run) + 1) * RUN;
        pairs.density[places].fill(0.0);
    }
    if lambert {
        let (class, class_id) = (LambertClass, LAMBERT);
        dispatch(Connect::<_, SOFT> { class, class_id, runs, prefixes, pairs });
    }
    if metal_rough {
        let (class, class_id) = (MetalRoughClass, METAL_ROUGH);
        dispatch(Connect::<_, SOFT> { class, class_id, runs, prefixes, pairs });
    }
}
