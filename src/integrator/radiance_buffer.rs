//! Radiance of the samples of a wave, and its layers: light passes and light groups.
//!
//! All light passes sum to the picture, and so do all light groups. The first scattering event of a path decides its pass: its
//! diffuse fraction, by channel, follows from the values of the BSDF's lobes for the two directions (as in Cycles); the rest is
//! glossy, or transmitted. Light is direct where the path found it with one scattering event.

use super::wave::{FirstBounce, FirstBounces, WAVE};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::film::{Aov, AovSet, CATCHER_PARTS, Source};

/// The way of light to the camera.
#[derive(Clone, Copy, Debug)]
pub enum PathClass {
    /// From an emitting surface that the camera sees.
    Emission,
    /// From the environment that it sees.
    Environment,
    /// By one scattering.
    Direct(FirstBounce),
    /// By several.
    Indirect(FirstBounce),
}

/// Where light came from.
#[derive(Clone, Copy, Debug)]
pub struct RadianceOrigin {
    /// Its way to the camera.
    pub way: PathClass,
    /// Group of its light.
    pub group: u16,
}

/// Which layers are kept, and where: passes first, then groups.
#[derive(Clone, Copy, Debug, Default)]
pub struct Layers {
    passes: AovSet,
    groups: usize,
    count: usize,
    /// Behind the groups are those of shadow catchers.
    catchers: bool,
    /// How many passes there are, and the places of each: of emission, of the environment, and of diffuse, glossy and transmitted
    /// light, direct and indirect.
    pass_count: usize,
    places: [Option<u8>; 2 + 2 * 3],
}

/// The passes in the order of their places.
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
    /// The light passes among AOVs, the first groups of lights, and what catchers catch.
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

    /// How many there are.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Are there light passes?
    pub fn has_passes(&self) -> bool {
        self.passes.any()
    }

    /// How many groups of lights there are.
    pub fn groups(&self) -> usize {
        self.groups
    }

    /// The place of a group.
    pub fn of_group(&self, group: usize) -> Option<usize> {
        (group < self.groups).then_some(self.pass_count + group)
    }

    /// The first place of what catchers catch.
    pub fn of_catchers(&self) -> Option<usize> {
        self.catchers.then(|| self.count - CATCHER_PARTS)
    }

    /// The places of the passes that light of a way belongs to, and its shares there.
    pub fn shares(&self, way: PathClass) -> [(Option<usize>, Rgb); 2] {
        let place = |pass: usize| self.places[pass].map(usize::from);
        let (first, diffuse) = match way {
            PathClass::Emission => return [(place(0), Rgb::ONE), (None, Rgb::ZERO)],
            PathClass::Environment => return [(place(1), Rgb::ONE), (None, Rgb::ZERO)],
            PathClass::Direct(first) => (first, 2),
            PathClass::Indirect(first) => (first, 5),
        };
        let rest = diffuse + if first.crosses { 2 } else { 1 };
        [(place(diffuse), first.diffuse), (place(rest), Rgb::ONE - first.diffuse)]
    }
}

/// The way of light that a path found at its end, after so many scatterings.
pub fn class_of_path(bounce: u32, seen: PathClass, first_bounces: &FirstBounces, i: usize) -> PathClass {
    match bounce {
        0 => seen,
        1 => PathClass::Direct(first_bounces.get(i)),
        _ => PathClass::Indirect(first_bounces.get(i)),
    }
}

/// Alphas are multiples of one over this: coarse enough that single floats hold all that occur, and sums in doubles of 2^31
/// of them are exact.
const ALPHA_GRID: f32 = 1_048_576.0;

/// Radiance and alpha of the samples of a wave, and the layers of the radiance that are asked for.
pub struct RadianceBuffer {
    samples: Vec<[f32; 4]>,
    /// Samples of the wave; behind them are radiances that are shared or joined later.
    count: usize,
    /// So many indices keep light passes.
    with_passes: usize,
    /// What the samples have alone, without sharing and splitting; empty where that is not kept.
    plain: Vec<[f32; 3]>,
    layers: Layers,
    /// The layers of all indices, those of one after another.
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
            parts: Vec::new(),
        }
    }

    /// Begins a wave of `count` samples: black and transparent.
    pub fn begin(&mut self, count: usize, layers: Layers) {
        self.samples.clear();
        self.parts.clear();
        (self.count, self.with_passes, self.layers) = (count, count, layers);
        self.extend(count);
        self.plain.clear();
    }

    /// Takes further indices below `count` for radiances that are no sample.
    pub fn extend(&mut self, count: usize) {
        self.samples.resize(count, [0.0; 4]);
        self.parts.resize(count * self.layers.count(), [0.0; 3]);
    }

    /// Takes further indices below `count` for what branches of samples find: see [`RadianceBuffer::join`].
    pub fn extend_with_passes(&mut self, count: usize) {
        self.with_passes = count;
        self.extend(count);
    }

    /// Adds all that arrived at another index to a sample.
    pub fn join(&mut self, sample: u32, other: u32) {
        self.add(sample, self.radiance(other));
        // What branches see of nothing through glass.
        self.samples[sample as usize][3] += self.samples[other as usize][3];
        for layer in 0..self.layers.count() {
            let value = self.parts[other as usize * self.layers.count() + layer];
            self.add_to_layer(sample, Some(layer), Rgb::from_array(value));
        }
    }

    /// Remembers what the samples have alone; further radiances follow by [`RadianceBuffer::add_plain`].
    pub fn keep_plain(&mut self) {
        self.plain.clear();
        self.plain.extend(self.samples[..self.count].iter().map(|&[r, g, b, _]| [r, g, b]));
    }

    /// Adds to what a sample has alone.
    pub fn add_plain(&mut self, sample: u32, value: Rgb) {
        let sum = &mut self.plain[sample as usize];
        *sum = (Rgb::from_array(*sum) + value).to_array();
    }

    /// What a sample has alone.
    pub fn plain(&self, sample: usize) -> [f32; 3] {
        self.plain.get(sample).copied().unwrap_or_default()
    }

    /// The radiance that arrived at an index so far.
    pub fn radiance(&self, index: u32) -> Rgb {
        let [r, g, b, _] = self.samples[index as usize];
        Rgb::new(r, g, b)
    }

    /// The part of it from a group of lights.
    pub fn radiance_of(&self, index: u32, group: usize) -> Rgb {
        let layer = self.layers.of_group(group);
        layer.map_or(Rgb::ZERO, |at| Rgb::from_array(self.parts[index as usize * self.layers.count() + at]))
    }

    /// Adds light to an index, all weights included: the way for radiance into the picture. `origin` is asked where layers
    /// are kept.
    #[inline(always)]
    pub fn contribute(&mut self, index: u32, value: Rgb, origin: impl FnOnce() -> RadianceOrigin) {
        self.add(index, value);
        if self.has_layers() {
            self.divide(index, value, origin);
        }
    }

    /// Are there layers?
    #[inline(always)]
    pub fn has_layers(&self) -> bool {
        self.layers.count() > 0
    }

    /// Adds light to the layers of an index. Out of the way of those who keep none.
    #[cold]
    #[inline(never)]
    pub fn divide(&mut self, index: u32, value: Rgb, origin: impl FnOnce() -> RadianceOrigin) {
        let RadianceOrigin { way, group } = origin();
        self.add_to_passes(index, value, way);
        self.add_to_group(index, value, group);
    }

    /// Adds light to an index, but to none of its layers.
    #[inline(always)]
    pub fn add(&mut self, index: u32, value: Rgb) {
        let sum = &mut self.samples[index as usize];
        let [r, g, b] = value.to_array();
        sum[0] += r;
        sum[1] += g;
        sum[2] += b;
    }

    /// Adds light to the passes of a sample. Of radiances that are no sample, it is known when they are shared.
    pub fn add_to_passes(&mut self, index: u32, value: Rgb, way: PathClass) {
        if (index as usize) < self.with_passes && self.layers.has_passes() {
            for (layer, share) in self.layers.shares(way) {
                self.add_to_layer(index, layer, value * share);
            }
        }
    }

    /// Adds light to the group of its light.
    pub fn add_to_group(&mut self, index: u32, value: Rgb, group: u16) {
        self.add_to_layer(index, self.layers.of_group(usize::from(group)), value);
    }

    fn add_to_layer(&mut self, index: u32, layer: Option<usize>, value: Rgb) {
        if let Some(layer) = layer {
            let sum = &mut self.parts[index as usize * self.layers.count() + layer];
            *sum = (Rgb::from_array(*sum) + value).to_array();
        }
    }

    /// Makes a sample opaque: something is there.
    #[inline(always)]
    pub fn cover(&mut self, sample: u32) {
        self.samples[sample as usize][3] = 1.0;
    }

    /// Makes a sample transparent, whatever is there.
    pub fn uncover(&mut self, sample: u32) {
        self.samples[sample as usize][3] = 0.0;
    }

    /// Is a sample opaque?
    pub fn is_covered(&self, sample: u32) -> bool {
        self.samples[sample as usize][3] > 0.0
    }

    /// Makes a sample transparent by a share. It is rounded to a grid, on which sums of alpha are exact and so don't depend
    /// on their order.
    pub fn make_transparent(&mut self, sample: u32, share: f32) {
        self.samples[sample as usize][3] -= (share * ALPHA_GRID).round() / ALPHA_GRID;
    }

    /// Keeps what a sample found on a shadow catcher: with other objects, and without.
    pub fn set_catcher(&mut self, sample: u32, with: Rgb, without: Rgb) {
        if let Some(first) = self.layers.of_catchers() {
            let at = sample as usize * self.layers.count() + first;
            self.parts[at] = with.to_array();
            self.parts[at + 1] = without.to_array();
            self.parts[at + 2] = [1.0; 3];
        }
    }

    /// From what arrived in the lanes of paths to red, green and blue, by the wavelengths of the samples.
    pub fn convert_to_rgb(&mut self, waves: &[Wavelengths]) {
        let count = self.layers.count();
        // The last of what catchers catch is no light.
        let of_light = if self.layers.of_catchers().is_some() { count - 1 } else { count };
        for (i, waves) in waves.iter().enumerate().take(self.count) {
            let [a, b, c, alpha] = self.samples[i];
            let [red, green, blue] = waves.rgb([a, b, c]);
            self.samples[i] = [red, green, blue, alpha];
            self.plain.get_mut(i).into_iter().for_each(|plain| *plain = waves.rgb(*plain));
            self.parts[i * count..i * count + of_light].iter_mut().for_each(|part| *part = waves.rgb(*part));
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
