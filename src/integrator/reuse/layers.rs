//! Shared paths by layers. What a prefix gets from a suffix is light that scattered at both, so all of it is indirect. Which
//! of its passes it belongs to, the first scattering of the prefix says; where the prefix ends at it, the direction to the
//! suffix does. What groups of lights bring is radiance at the suffix, shared with the same weights as all.

use super::super::radiance_buffer::{PathClass, RadianceBuffer};
use super::super::shading_groups::{MetalRoughClass, VertexClass};
use super::super::wave::{RgbLanes, WAVE, get, get_rgb, set_rgb};
use super::layer_lanes::{Diffuse, GroupLanes, SharedLayers};
use super::pairs::{Exchange, group_of};
use super::state::{DIRECT, METAL_ROUGH, Pairs, Prefixes, Reuse, SCATTERED, Suffixes};
use crate::color::Rgb;

impl SharedLayers {
    /// Takes what leaves suffix `k` of each group of lights, and gives what of its light stays with it to its owner.
    pub fn finish_suffix(
        &mut self,
        k: usize,
        sample: u32,
        s: &Suffixes,
        own: Rgb,
        is_usable: bool,
        sink: &mut RadianceBuffer,
    ) {
        let throughput = get_rgb(&s.throughput, k);
        if let Some(diffuse) = &mut self.diffuse {
            let first = s.first_bounces.get(k);
            set_rgb(&mut diffuse.throughput, k, throughput * first.diffuse);
            sink.add_to_passes(sample, throughput * own, PathClass::Indirect(first));
        }
        for (g, group) in self.groups.iter_mut().enumerate() {
            let direct = sink.radiance_of(sample + DIRECT, g);
            let scattered = sink.radiance_of(sample + SCATTERED, g);
            let (radiance, own) = match is_usable {
                true => s.divide(k, direct, scattered),
                false => (Rgb::ZERO, direct + scattered),
            };
            set_rgb(&mut group.radiance, k, radiance);
            sink.add_to_group(sample, throughput * own, g as u16);
        }
    }

    /// Adds what the prefixes get from the suffixes of a round.
    pub fn receive(&mut self, exchange: Exchange<'_>) {
        let Exchange { senders, group, prefixes, suffixes: s, pairs } = exchange;
        if let Some(diffuse) = &mut self.diffuse {
            let Diffuse { value, throughput, gained } = &mut **diffuse;
            fill_diffuse(senders, group, prefixes, pairs, value);
            exchange.receive(&s.radiance, throughput, value, gained);
        }
        for group_lanes in &mut self.groups {
            let GroupLanes { radiance, gained } = &mut **group_lanes;
            exchange.receive(radiance, &s.throughput, &pairs.value, gained);
        }
    }

    /// Brings what prefixes got, of all `total`, to the layers of a sample.
    pub fn deliver(&self, k: usize, sample: u32, total: Rgb, prefixes: &Prefixes, sink: &mut RadianceBuffer) {
        if let Some(diffuse) = &self.diffuse {
            let mut first = prefixes.first_bounces.get(k);
            let of_diffuse = get_rgb(&diffuse.gained, k).min(total);
            first.diffuse = Rgb::ONE;
            sink.add_to_passes(sample, of_diffuse, PathClass::Indirect(first));
            first.diffuse = Rgb::ZERO;
            sink.add_to_passes(sample, total - of_diffuse, PathClass::Indirect(first));
        }
        for (g, group) in self.groups.iter().enumerate() {
            sink.add_to_group(sample, get_rgb(&group.gained, k), g as u16);
        }
    }
}

/// The diffuse part of what prefixes would get from the suffixes of their turn.
fn fill_diffuse(senders: &[u16], group: usize, prefixes: &Prefixes, pairs: &Pairs, value: &mut RgbLanes) {
    let v = &prefixes.vertices;
    for &sender in senders {
        for i in group_of(usize::from(sender), group).filter(|&i| pairs.density[i] > 0.0) {
            let is_first = prefixes.bounce[i] == 0 && prefixes.class[i] == METAL_ROUGH;
            let share = match is_first {
                true => {
                    let wi = (get(&pairs.y, i) - get(&v.next_origin, i)).normalize();
                    MetalRoughClass.closure(v, i).diffuse_share(wi)
                }
                false => prefixes.first_bounces.get(i).diffuse,
            };
            set_rgb(value, i, get_rgb(&pairs.value, i) * share);
        }
    }
}

impl Reuse {
    /// Brings what all prefixes got to their samples.
    pub fn deliver(&self, sink: &mut RadianceBuffer) {
        for (k, &sample) in self.samples[..WAVE].iter().enumerate() {
            let (sample, gained) = (u32::from(sample), get_rgb(&self.gained, k));
            sink.add(sample, gained);
            self.layers.deliver(k, sample, gained, &self.prefixes, sink);
        }
    }
}
