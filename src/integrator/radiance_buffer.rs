//! Radiance of the samples of a wave, and its layers: light passes and light groups.
//!
//! All light passes sum to the picture, and so do all light groups. The first scattering event of a path decides its
//! pass: its diffuse fraction, by channel, follows from the values of the BSDF's lobes for the two directions (as in
//! Cycles); the rest is glossy, or transmitted. Light is direct where the path found it with one scattering event.

use super::wave::{FirstBounce, FirstBounces, WAVE};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::film::{Aov, AovSet, CATCHER_PARTS, Source};
use crate::scene::Clamp;

/// Path classes of light passes.
#[derive(Clone, Copy, Debug)]
pub enum PathClass {
    /// Emission that the camera sees directly.
    Emission,
    /// The environment that the camera sees directly.
    Environment,
    /// One scattering event.
    Direct(FirstBounce),
    /// Several scattering events.
    Indirect(FirstBounce),
}

/// Path class and light group of a contribution.
#[derive(Clone, Copy, Debug)]
pub struct RadianceOrigin {
    /// The class of its path.
    pub class: PathClass,
    /// The light group of its light.
    pub group: u16,
}

/// The layers that are recorded: light passes, then light groups, then those of shadow catchers.
#[derive(Clone, Copy, Debug, Default)]
pub struct Layers {
    passes: AovSet,
    groups: usize,
    count: usize,
    /// Are layers of shadow catchers recorded?
    catchers: bool,
    /// Number of light passes.
    pass_count: usize,
    /// The layer of each of [`PASSES`].
    places: [Option<u8>; 2 + 2 * 3],
}

/// Light passes in this order.
const PASSES: [Aov; 8] = [
    Aov::Emission,
    Aov::Environment,
    Aov::DiffuseDirect,
    Aov::GlossyDirect,
    Aov::TransmissionDirect,
    Aov::DiffuseIndirect,
    Aov::GlossyIndirect,
    Aov::TransmissionIndirect,
];

impl Layers {
    /// The light passes among AOVs, the first light groups, and shadow catchers.
    pub fn new(aovs: AovSet, groups: usize, catchers: bool) -> Layers {
        let passes = aovs.of(Source::PartOfColor);
        let of_catchers = if catchers { CATCHER_PARTS } else { 0 };
        let place = |aov| passes.iter().position(|other| other == aov).map(|place| place as u8);
        let pass_count = passes.iter().count();
        Layers {
            passes,
            groups,
            count: pass_count + groups + of_catchers,
            catchers,
            pass_count,
            places: PASSES.map(place),
        }
    }

    /// Number of layers.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Are there light passes?
    pub fn has_passes(&self) -> bool {
        self.passes.any()
    }

    /// Number of light groups.
    pub fn groups(&self) -> usize {
        self.groups
    }

    /// The layer of a light group.
    pub fn of_group(&self, group: usize) -> Option<usize> {
        (group < self.groups).then_some(self.pass_count + group)
    }

    /// The first layer of shadow catchers.
    pub fn of_catchers(&self) -> Option<usize> {
        self.catchers.then(|| self.count - CATCHER_PARTS)
    }

    /// The layers of the light passes of a path class, and its fractions there.
    pub fn shares(&self, class: PathClass) -> [(Option<usize>, Rgb); 2] {
        let place = |pass: usize| self.places[pass].map(usize::from);
        let (first, diffuse) = match class {
            PathClass::Emission => return [(place(0), Rgb::ONE), (None, Rgb::ZERO)],
            PathClass::Environment => return [(place(1), Rgb::ONE), (None, Rgb::ZERO)],
            PathClass::Direct(first) => (first, 2),
            PathClass::Indirect(first) => (first, 5),
        };
        let rest = diffuse + if first.crosses { 2 } else { 1 };
        [(place(diffuse), first.diffuse), (place(rest), Rgb::ONE - first.diffuse)]
    }
}

/// The class of light that path `i` hit after `bounce` scattering events.
pub fn class_of_path(bounce: u32, seen: PathClass, first_bounces: &FirstBounces, i: usize) -> PathClass {
    match bounce {
        0 => seen,
        1 => PathClass::Direct(first_bounces.get(i)),
        _ => PathClass::Indirect(first_bounces.get(i)),
    }
}

/// Alphas are multiples of one over this: coarse enough that f32 is exact, and sums in f64 of 2^31
/// of them, too.
const ALPHA_GRID: f32 = 1_048_576.0;

/// Radiance and alpha of the samples of a wave, and the recorded layers of the radiance. Indices after the samples hold
/// radiance that is shared or joined later.
pub struct RadianceBuffer {
    samples: Vec<[f32; 4]>,
    /// Number of samples of the wave.
    count: usize,
    /// Number of indices with light passes.
    with_passes: usize,
    /// Radiance of the samples without path sharing and splitting; empty where it is not recorded.
    plain: Vec<[f32; 3]>,
    layers: Layers,
    clamp: Clamp,
    /// By index: factor from its radiance to that of the picture, for the clamp; where there is one.
    clamp_scales: Vec<Rgb>,
    /// There are neither layers nor a clamp.
    is_plain: bool,
    /// Layers by index.
    parts: Vec<[f32; 3]>,
}

impl RadianceBuffer {
    /// Without samples.
    pub fn new() -> RadianceBuffer {
        RadianceBuffer {
            samples: Vec::with_capacity(WAVE),
            count: 0,
            with_passes: 0,
            plain: Vec::new(),
            layers: Layers::default(),
            clamp: Clamp::NONE,
            clamp_scales: Vec::new(),
            is_plain: true,
            parts: Vec::new(),
        }
    }

    /// Begins a wave of `count` samples: black and transparent.
    pub fn begin(&mut self, count: usize, layers: Layers, clamp: Clamp) {
        self.is_plain = layers.count() == 0 && clamp == Clamp::NONE;
        self.clamp = clamp;
        self.samples.clear();
        self.parts.clear();
        self.clamp_scales.clear();
        (self.count, self.with_passes, self.layers) = (count, count, layers);
        self.extend(count);
        self.plain.clear();
    }

    /// Extends the indices to `count`, for radiance that is shared or joined later.
    pub fn extend(&mut self, count: usize) {
        self.samples.resize(count, [0.0; 4]);
        self.parts.resize(count * self.layers.count(), [0.0; 3]);
        if self.clamp != Clamp::NONE {
            self.clamp_scales.resize(count, Rgb::ONE);
        }
    }

    /// The radiance of these indices reaches the picture times `throughput`.
    pub fn scale_clamp(&mut self, indices: [u32; 2], throughput: Rgb) {
        if self.clamp != Clamp::NONE {
            indices.into_iter().for_each(|index| self.clamp_scales[index as usize] = throughput);
        }
    }

    /// Extends the indices to `count`, for branches of samples: see [`RadianceBuffer::join`].
    pub fn extend_with_passes(&mut self, count: usize) {
        self.with_passes = count;
        self.extend(count);
    }

    /// Adds the radiance, alpha and layers of another index to a sample.
    pub fn join(&mut self, sample: u32, other: u32) {
        self.add(sample, self.radiance(other));
        // Transparency that branches found behind glass.
        self.samples[sample as usize][3] += self.samples[other as usize][3];
        for layer in 0..self.layers.count() {
            let value = self.parts[other as usize * self.layers.count() + layer];
            self.add_to_layer(sample, Some(layer), Rgb::from_array(value));
        }
    }

    /// Copies the radiance of the samples to that without sharing and splitting; [`RadianceBuffer::add_plain`] adds more.
    pub fn keep_plain(&mut self) {
        self.plain.clear();
        self.plain.extend(self.samples[..self.count].iter().map(|&[r, g, b, _]| [r, g, b]));
    }

    /// Adds to the radiance of a sample without sharing and splitting.
    pub fn add_plain(&mut self, sample: u32, value: Rgb) {
        let sum = &mut self.plain[sample as usize];
        *sum = (Rgb::from_array(*sum) + value).to_array();
    }

    /// The radiance of a sample without sharing and splitting.
    pub fn plain(&self, sample: usize) -> [f32; 3] {
        self.plain.get(sample).copied().unwrap_or_default()
    }

    /// The radiance of an index so far.
    pub fn radiance(&self, index: u32) -> Rgb {
        let [r, g, b, _] = self.samples[index as usize];
        Rgb::new(r, g, b)
    }

    /// The radiance of an index from a light group so far.
    pub fn radiance_of(&self, index: u32, group: usize) -> Rgb {
        let layer = self.layers.of_group(group);
        layer.map_or(Rgb::ZERO, |at| Rgb::from_array(self.parts[index as usize * self.layers.count() + at]))
    }

    /// Adds weighted radiance of light that reaches the camera after `bounces` scattering events to an index: all light of the
    /// picture goes through here. `origin` is called where layers are recorded.
    #[inline(always)]
    pub fn contribute(
        &mut self,
        index: u32,
        bounces: u32,
        value: Rgb,
        origin: impl FnOnce() -> RadianceOrigin,
    ) {
        if self.is_plain {
            return self.add(index, value);
        }
        let value = self.clamped(index, bounces, value);
        self.add(index, value);
        if self.has_layers() {
            self.divide(index, value, origin);
        }
    }

    /// Scales the light of a path down to the clamp, as Cycles does.
    fn clamped(&self, index: u32, bounces: u32, value: Rgb) -> Rgb {
        let most = 3.0 * if bounces > 1 { self.clamp.indirect } else { self.clamp.direct };
        let seen = value * self.clamp_scales.get(index as usize).copied().unwrap_or(Rgb::ONE);
        let sum = seen.r.abs() + seen.g.abs() + seen.b.abs();
        if sum > most { value * (most / sum) } else { value }
    }

    /// Are there layers?
    #[inline(always)]
    pub fn has_layers(&self) -> bool {
        self.layers.count() > 0
    }

    /// Adds radiance to the layers of an index. Not inlined, as most pictures have none.
    #[cold]
    #[inline(never)]
    fn divide(&mut self, index: u32, value: Rgb, origin: impl FnOnce() -> RadianceOrigin) {
        let RadianceOrigin { class, group } = origin();
        self.add_to_passes(index, value, class);
        self.add_to_group(index, value, group);
    }

    /// Adds radiance to an index, but not to its layers.
    #[inline(always)]
    pub fn add(&mut self, index: u32, value: Rgb) {
        let sum = &mut self.samples[index as usize];
        let [r, g, b] = value.to_array();
        sum[0] += r;
        sum[1] += g;
        sum[2] += b;
    }

    /// Adds radiance to the light passes of an index that has some; path sharing decides the passes of others later.
    pub fn add_to_passes(&mut self, index: u32, value: Rgb, class: PathClass) {
        if (index as usize) < self.with_passes && self.layers.has_passes() {
            for (layer, share) in self.layers.shares(class) {
                self.add_to_layer(index, layer, value * share);
            }
        }
    }

    /// Adds radiance to a light group.
    pub fn add_to_group(&mut self, index: u32, value: Rgb, group: u16) {
        self.add_to_layer(index, self.layers.of_group(usize::from(group)), value);
    }

    fn add_to_layer(&mut self, index: u32, layer: Option<usize>, value: Rgb) {
        if let Some(layer) = layer {
            let sum = &mut self.parts[index as usize * self.layers.count() + layer];
            *sum = (Rgb::from_array(*sum) + value).to_array();
        }
    }

    /// Makes a sample opaque.
    #[inline(always)]
    pub fn cover(&mut self, sample: u32) {
        self.samples[sample as usize][3] = 1.0;
    }

    /// Makes a sample transparent.
    pub fn uncover(&mut self, sample: u32) {
        self.samples[sample as usize][3] = 0.0;
    }

    /// Is a sample opaque?
    pub fn is_covered(&self, sample: u32) -> bool {
        self.samples[sample as usize][3] > 0.0
    }

    /// Reduces the alpha of a sample by a transmittance, rounded to a grid on which sums are exact and so don't depend
    /// on the order.
    pub fn make_transparent(&mut self, sample: u32, share: f32) {
        self.samples[sample as usize][3] -= (share * ALPHA_GRID).round() / ALPHA_GRID;
    }

    /// Records the radiance of a sample on a shadow catcher with and without casters.
    pub fn set_catcher(&mut self, sample: u32, with: Rgb, without: Rgb) {
        if let Some(first) = self.layers.of_catchers() {
            let at = sample as usize * self.layers.count() + first;
            self.parts[at] = with.to_array();
            self.parts[at + 1] = without.to_array();
            self.parts[at + 2] = [1.0; 3];
        }
    }

    /// Converts spectral radiance to RGB, by the wavelengths of the samples.
    pub fn convert_to_rgb(&mut self, wavelengths: &[Wavelengths]) {
        let count = self.layers.count();
        // The last layer of shadow catchers is a weight.
        let of_light = if self.layers.of_catchers().is_some() { count - 1 } else { count };
        for (i, wavelengths) in wavelengths.iter().enumerate().take(self.count) {
            let [a, b, c, alpha] = self.samples[i];
            let [red, green, blue] = wavelengths.rgb([a, b, c]);
            self.samples[i] = [red, green, blue, alpha];
            self.plain.get_mut(i).into_iter().for_each(|plain| *plain = wavelengths.rgb(*plain));
            self.parts[i * count..i * count + of_light]
                .iter_mut()
                .for_each(|part| *part = wavelengths.rgb(*part));
        }
    }

    /// Red, green, blue and alpha of all samples.
    pub fn samples(&self) -> &[[f32; 4]] {
        &self.samples[..self.count]
    }

    /// The layers of a sample.
    pub fn parts(&self, sample: usize) -> &[[f32; 3]] {
        let count = self.layers.count();
        &self.parts[sample * count..(sample + 1) * count]
    }
}
