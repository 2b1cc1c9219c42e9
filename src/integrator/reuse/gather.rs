//! The paths of a group are shared: each prefix is connected to each suffix.

use super::super::Integrator;
use super::super::closure::LambertClass;
use super::super::closure_metal_rough::MetalRoughClass;
use super::super::lanes::{WAVE, get, get_rgb, set_rgb};
use super::super::normals::bent_normal;
use super::super::workspace::Workspace;
use super::Tiling;
use super::layer::{LEAST_REST, layer_rest};
use super::pairs::{Connect, RUN};
use super::state::{DIRECT, LAMBERT, METAL_ROUGH, NONE, Prefixes, Reuse, SCATTERED, Suffixes};
use crate::color::Rgb;
use crate::math::Ray;
use crate::simd::dispatch;

/// Bounce of prefixes for a suffix that isn't there.
const NO_BOUNCE: u32 = u32::MAX;

impl Integrator<'_> {
    /// Brings to every prefix what the suffixes of its group found.
    pub(in super::super) fn share_paths(&self, tiling: &Tiling, w: &mut Workspace) {
        let Some(mut reuse) = w.reuse.take() else { return };
        self.finish_suffixes(&mut reuse, w);
        let has = |class| reuse.prefixes.class[..WAVE].contains(&class);
        let classes = [LAMBERT, METAL_ROUGH].map(has);
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
            self.test_visibility(&round, &mut reuse, w);
            self.add_round(&round, &reuse, w);
        }
        w.reuse = Some(reuse);
    }

    /// Sums up what leaves each suffix. What is not shared goes to its owner.
    fn finish_suffixes(&self, reuse: &mut Reuse, w: &mut Workspace) {
        if self.options.keeps_unshared {
            w.sink.keep_unshared();
        }
        let Reuse { suffixes: s, samples, .. } = reuse;
        for (k, &sample) in samples[..WAVE].iter().enumerate() {
            if s.class[k] == NONE {
                continue;
            }
            let sample = u32::from(sample);
            let (direct, scattered) = (w.sink.radiance(sample + DIRECT), w.sink.radiance(sample + SCATTERED));
            let throughput = get_rgb(&s.throughput, k);
            if self.options.keeps_unshared {
                w.sink.add_unshared(sample, throughput * (direct + scattered));
            }
            let (mut radiance, mut own) = (direct + scattered, Rgb::ZERO);
            if s.class[k] == METAL_ROUGH {
                let shares = [get_rgb(&s.direct_share, k), get_rgb(&s.scattered_share, k)];
                let diffuse = [direct * shares[0], scattered * shares[1]];
                own = radiance - (diffuse[0] + diffuse[1]) * s.rest[k];
                radiance = diffuse[0] + diffuse[1];
            }
            let is_usable = radiance.is_finite() && radiance.max_element() > 0.0;
            if !is_usable {
                own = direct + scattered;
                s.class[k] = NONE;
            }
            set_rgb(&mut s.radiance, k, radiance);
            w.sink.contribute(sample, None, throughput * own);
        }
    }

    /// Prefixes that can't reach the suffix of their turn get no density.
    fn test_visibility(&self, round: &Round, reuse: &mut Reuse, w: &mut Workspace) {
        let Reuse { prefixes, suffixes, pairs, .. } = reuse;
        w.shadow_rays.clear();
        w.shadow_vertices.clear();
        for i in round.places() {
            let sender = round.sender(i);
            if i == sender || pairs.density[i] <= 0.0 {
                continue;
            }
            let origin = get(&prefixes.vertices.next_origin, i);
            if suffixes.class[sender] == METAL_ROUGH {
                let wo = (origin - get(&suffixes.p, sender)).normalize();
                let ns = get(&suffixes.ns, sender);
                pairs.rest[i] = layer_rest(&suffixes.material, sender, ns, wo, self.scene.shading);
                let (_, is_bent) = bent_normal(ns, get(&suffixes.ng, sender), wo);
                // As for the owner.
                if is_bent || pairs.rest[i] < LEAST_REST {
                    pairs.density[i] = 0.0;
                    continue;
                }
            }
            let ray = Ray::segment(origin, get(&suffixes.target, sender) - origin);
            let origin_primitive = prefixes.vertices.origin_primitives[i];
            w.shadow_rays.push(Ray { origin_primitive, ..ray });
            w.shadow_vertices.push(i as u32);
        }
        let before = w.ray_count;
        // Whatever the bounce: surfaces that are absent at random, whose random numbers differ by it, are in no scene that is
        // shared; lamps that stop no light may be.
        self.test_shadow_rays(1, w);
        w.connection_count += w.ray_count - before;
        for (&i, &occluded) in w.shadow_vertices.iter().zip(&w.occluded) {
            if occluded {
                pairs.density[i as usize] = 0.0;
            }
        }
    }

    /// Adds what the prefixes get from the suffixes of their turn.
    fn add_round(&self, round: &Round, reuse: &Reuse, w: &mut Workspace) {
        let Reuse { suffixes: s, pairs, samples, prefixes, .. } = reuse;
        for &sender in &round.senders {
            let sender = usize::from(sender);
            let first = sender - sender % round.group;
            let own = s.own_density(sender, prefixes);
            let others = (first..first + round.group).filter(|&i| i != sender && pairs.density[i] > 0.0);
            let sum = own + others.clone().map(|i| pairs.density[i]).sum::<f32>();
            let is_layered = s.class[sender] == METAL_ROUGH;
            let radiance = get_rgb(&s.radiance, sender);
            // Points next to each other have densities beyond all numbers.
            let is_finite = own > 0.0 && sum < f32::INFINITY;
            let share = if is_finite { own / sum } else { 1.0 };
            let value = get_rgb(&s.throughput, sender) * radiance * (s.rest[sender] * share);
            w.sink.contribute(u32::from(samples[sender]), None, value);
            if is_finite {
                let scaled = radiance * (1.0 / sum);
                for i in others {
                    let rest = if is_layered { pairs.rest[i] } else { 1.0 };
                    let value = get_rgb(&pairs.value, i) * (scaled * rest);
                    w.sink.contribute(u32::from(samples[i]), None, value);
                }
            }
        }
    }
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
                pairs.bounce[places].fill(NO_BOUNCE);
                continue;
            }
            pairs.bounce[places.clone()].fill(prefixes.bounce[sender]);
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

    /// The suffix that a place is connected to.
    fn sender(&self, place: usize) -> usize {
        place - place % self.group + self.turn
    }

    /// All places of the runs.
    fn places(&self) -> impl Iterator<Item = usize> {
        self.runs.iter().flat_map(|&run| usize::from(run) * RUN..(usize::from(run) + 1) * RUN)
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

impl Suffixes {
    /// Density per area with which the owner found its suffix.
    fn own_density(&self, k: usize, prefixes: &Prefixes) -> f32 {
        let way = get(&self.p, k) - get(&prefixes.vertices.next_origin, k);
        let cosine = get(&self.wo, k).dot(get(&self.ng, k));
        self.pdf[k] * cosine / way.dot(way)
    }
}
