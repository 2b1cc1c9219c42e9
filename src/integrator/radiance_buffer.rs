//! Radiance of the samples of a wave, split into layers: light passes and light groups.
//!
//! The light passes sum to the picture, and so do the light groups. The first bounce of a path selects the passes: the diffuse
//! fraction, per channel, is that of the BSDF's lobes for the two directions (as in Cycles); the rest is glossy or transmission.
//! Contributions after one bounce are direct, after several indirect.

use super::wave::{FirstBounce, FirstBounces, WAVE};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::film::{Aov, AovSet, CATCHER_PARTS, Source};
use crate::scene::Clamp;

/// Classes of paths that light passes distinguish.
#[derive(Clone, Copy, Debug)]
pub enum PathClass {
    /// Emission hit by camera rays.
    Emission,
    /// Environment hit by camera rays.
    Environment,
    /// One bounce.
    Direct(FirstBounce),
    /// Several bounces.
    Indirect(FirstBounce),
}

/// Path class and light group of a contribution.
#[derive(Clone, Copy, Debug)]
pub struct RadianceOrigin {
    pub class: PathClass,
    pub group: u16,
}

/// The recorded layers: light passes, then light groups, then those of shadow catchers.
#[derive(Clone, Copy, Debug, Default)]
pub struct Layers {
    passes: AovSet,
    groups: usize,
    count: usize,
    /// Are layers of shadow catchers recorded?
    catchers: bool,
    /// Number of light passes.
    pass_count: usize,
    /// Layer of each of [`PASSES`], if recorded.
    pass_layers: [Option<u8>; 2 + 2 * 3],
}

/// Light passes in the order of [`Layers::pass_fractions`].
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
    /// Layers for the light passes among `aovs`, the first `groups` light groups, and shadow catchers.
    pub fn new(aovs: AovSet, groups: usize, catchers: bool) -> Layers {
        let passes = aovs.of(Source::PartOfColor);
        let of_catchers = if catchers { CATCHER_PARTS } else { 0 };
        let layer = |aov| passes.iter().position(|other| other == aov).map(|layer| layer as u8);
        let pass_count = passes.iter().count();
        Layers {
            passes,
            groups,
            count: pass_count + groups + of_catchers,
            catchers,
            pass_count,
            pass_layers: PASSES.map(layer),
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

    /// The layers of a path class's light passes, with the fraction for each.
    pub fn pass_fractions(&self, class: PathClass) -> [(Option<usize>, Rgb); 2] {
        let layer = |pass: usize| self.pass_layers[pass].map(usize::from);
        let (first, diffuse) = match class {
            PathClass::Emission => return [(layer(0), Rgb::ONE), (None, Rgb::ZERO)],
            PathClass::Environment => return [(layer(1), Rgb::ONE), (None, Rgb::ZERO)],
            PathClass::Direct(first) => (first, 2),
            PathClass::Indirect(first) => (first, 5),
        };
        let rest = diffuse + if first.is_transmission { 2 } else { 1 };
        [(layer(diffuse), first.diffuse), (layer(rest), Rgb::ONE - first.diffuse)]
    }
}

/// The class of emission hit by path `i` after `bounce` bounces; `unscattered` is the class for camera rays.
pub fn class_of_path(
    bounce: u32,
    unscattered: PathClass,
    first_bounces: &FirstBounces,
    i: usize,
) -> PathClass {
    match bounce {
        0 => unscattered,
        1 => PathClass::Direct(first_bounces.get(i)),
        _ => PathClass::Indirect(first_bounces.get(i)),
    }
}

/// Alphas are multiples of the reciprocal: exact in f32, and sums of 2^31 alphas are exact in f64.
const ALPHA_GRID: f32 = 1_048_576.0;

/// Radiance, alpha and layers of the samples of a wave. Entries after the samples hold radiance of suffixes (path reuse) or branches
/// (path splitting), which is added to samples later.
pub struct RadianceBuffer {
    /// Red, green, blue (or three wavelengths), alpha.
    samples: Vec<[f32; 4]>,
    /// Number of samples of the wave.
    count: usize,
    /// Number of entries with light passes.
    with_passes: usize,
    /// Radiance of the samples without path reuse and splitting; empty if not recorded.
    baseline: Vec<[f32; 3]>,
    layers: Layers,
    clamp: Clamp,
    /// With a clamp, per entry: factor from its radiance to the picture's.
    clamp_scales: Vec<Rgb>,
    /// Neither layers nor a clamp are in use.
    is_color_only: bool,
    /// Layers per entry.
    layer_values: Vec<[f32; 3]>,
}

impl RadianceBuffer {
    /// An empty buffer.
    pub fn new() -> RadianceBuffer {
        RadianceBuffer {
            samples: Vec::with_capacity(WAVE),
            count: 0,
            with_passes: 0,
            baseline: Vec::new(),
            layers: Layers::default(),
            clamp: Clamp::NONE,
            clamp_scales: Vec::new(),
            is_color_only: true,
            layer_values: Vec::new(),
        }
    }

    /// Resets the buffer to `count` samples, black and transparent.
    pub fn begin(&mut self, count: usize, layers: Layers, clamp: Clamp) {
        self.is_color_only = layers.count() == 0 && clamp == Clamp::NONE;
        self.clamp = clamp;
        self.samples.clear();
        self.layer_values.clear();
        self.clamp_scales.clear();
        (self.count, self.with_passes, self.layers) = (count, count, layers);
        self.extend(count);
        self.baseline.clear();
    }

    /// Extends the buffer to `count` entries, without light passes.
    pub fn extend(&mut self, count: usize) {
        self.samples.resize(count, [0.0; 4]);
        self.layer_values.resize(count * self.layers.count(), [0.0; 3]);
        if self.clamp != Clamp::NONE {
            self.clamp_scales.resize(count, Rgb::ONE);
        }
    }

    /// Sets the factor for the clamp: radiance of these entries is added to the picture times `throughput`.
    pub fn scale_clamp(&mut self, indices: [u32; 2], throughput: Rgb) {
        if self.clamp != Clamp::NONE {
            indices.into_iter().for_each(|index| self.clamp_scales[index as usize] = throughput);
        }
    }

    /// Extends the buffer to `count` entries with light passes, for branches of samples: see [`RadianceBuffer::merge`].
    pub fn extend_with_passes(&mut self, count: usize) {
        self.with_passes = count;
        self.extend(count);
    }

    /// Adds the radiance, alpha and layers of another entry to a sample.
    pub fn merge(&mut self, sample: u32, other: u32) {
        self.add(sample, self.radiance(other));
        // Branches behind clear glass reduce alpha.
        self.samples[sample as usize][3] += self.samples[other as usize][3];
        for layer in 0..self.layers.count() {
            let value = self.layer_values[other as usize * self.layers.count() + layer];
            self.add_to_layer(sample, Some(layer), Rgb::from_array(value));
        }
    }

    /// Copies the samples' radiance so far to the estimates without reuse and splitting; see [`RadianceBuffer::add_to_baseline`].
    pub fn copy_to_baseline(&mut self) {
        self.baseline.clear();
        self.baseline.extend(self.samples[..self.count].iter().map(|&[r, g, b, _]| [r, g, b]));
    }

    /// Adds to a sample's estimate without reuse and splitting.
    pub fn add_to_baseline(&mut self, sample: u32, value: Rgb) {
        let sum = &mut self.baseline[sample as usize];
        *sum = (Rgb::from_array(*sum) + value).to_array();
    }

    /// A sample's estimate without reuse and splitting.
    pub fn baseline(&self, sample: usize) -> [f32; 3] {
        self.baseline.get(sample).copied().unwrap_or_default()
    }

    /// The radiance of an entry so far.
    pub fn radiance(&self, index: u32) -> Rgb {
        let [r, g, b, _] = self.samples[index as usize];
        Rgb::new(r, g, b)
    }

    /// The radiance of an entry from a light group so far.
    pub fn radiance_of(&self, index: u32, group: usize) -> Rgb {
        let layer = self.layers.of_group(group);
        layer.map_or(Rgb::ZERO, |at| {
            Rgb::from_array(self.layer_values[index as usize * self.layers.count() + at])
        })
    }

    /// Adds a contribution after `bounces` bounces to an entry: clamps it and splits it into layers. `origin` is only called if layers
    /// are recorded.
    #[inline(always)]
    pub fn contribute(
        &mut self,
        index: u32,
        bounces: u32,
        value: Rgb,
        origin: impl FnOnce() -> RadianceOrigin,
    ) {
        if self.is_color_only {
            return self.add(index, value);
        }
        let value = self.clamped(index, bounces, value);
        self.add(index, value);
        if self.has_layers() {
            self.add_to_layers(index, value, origin);
        }
    }

    /// Scales a contribution down to the clamp, by the sum of the channels as in Cycles.
    fn clamped(&self, index: u32, bounces: u32, value: Rgb) -> Rgb {
        let most = 3.0 * if bounces > 1 { self.clamp.indirect } else { self.clamp.direct };
        let scaled = value * self.clamp_scales.get(index as usize).copied().unwrap_or(Rgb::ONE);
        let sum = scaled.r.abs() + scaled.g.abs() + scaled.b.abs();
        if sum > most { value * (most / sum) } else { value }
    }

    /// Are layers recorded?
    #[inline(always)]
    pub fn has_layers(&self) -> bool {
        self.layers.count() > 0
    }

    /// Adds radiance to the layers of an entry. Not inlined, since most pictures have none.
    #[cold]
    #[inline(never)]
    fn add_to_layers(&mut self, index: u32, value: Rgb, origin: impl FnOnce() -> RadianceOrigin) {
        let RadianceOrigin { class, group } = origin();
        self.add_to_passes(index, value, class);
        self.add_to_group(index, value, group);
    }

    /// Adds radiance to an entry, but not to its layers.
    #[inline(always)]
    pub fn add(&mut self, index: u32, value: Rgb) {
        let sum = &mut self.samples[index as usize];
        let [r, g, b] = value.to_array();
        sum[0] += r;
        sum[1] += g;
        sum[2] += b;
    }

    /// Adds radiance to the light passes of an entry, if it has any; for others, path reuse selects the passes later.
    pub fn add_to_passes(&mut self, index: u32, value: Rgb, class: PathClass) {
        if (index as usize) < self.with_passes && self.layers.has_passes() {
            for (layer, fraction) in self.layers.pass_fractions(class) {
                self.add_to_layer(index, layer, value * fraction);
            }
        }
    }

    /// Adds radiance to a light group.
    pub fn add_to_group(&mut self, index: u32, value: Rgb, group: u16) {
        self.add_to_layer(index, self.layers.of_group(usize::from(group)), value);
    }

    fn add_to_layer(&mut self, index: u32, layer: Option<usize>, value: Rgb) {
        if let Some(layer) = layer {
            let sum = &mut self.layer_values[index as usize * self.layers.count() + layer];
            *sum = (Rgb::from_array(*sum) + value).to_array();
        }
    }

    /// Sets the alpha of a sample to 1.
    #[inline(always)]
    pub fn set_opaque(&mut self, sample: u32) {
        self.samples[sample as usize][3] = 1.0;
    }

    /// Sets the alpha of a sample to 0.
    pub fn set_transparent(&mut self, sample: u32) {
        self.samples[sample as usize][3] = 0.0;
    }

    /// Is the alpha of a sample above 0?
    pub fn is_covered(&self, sample: u32) -> bool {
        self.samples[sample as usize][3] > 0.0
    }

    /// Reduces the alpha of a sample by a transmittance, rounded to [`ALPHA_GRID`] so that sums are exact and independent of the order.
    pub fn make_transparent(&mut self, sample: u32, transmittance: f32) {
        self.samples[sample as usize][3] -= (transmittance * ALPHA_GRID).round() / ALPHA_GRID;
    }

    /// Records the radiance of a sample on a shadow catcher with and without shadow casters.
    pub fn set_catcher(&mut self, sample: u32, with: Rgb, without: Rgb) {
        if let Some(first) = self.layers.of_catchers() {
            let at = sample as usize * self.layers.count() + first;
            self.layer_values[at] = with.to_array();
            self.layer_values[at + 1] = without.to_array();
            self.layer_values[at + 2] = [1.0; 3];
        }
    }

    /// Converts spectral radiance to RGB by the samples' wavelengths.
    pub fn convert_to_rgb(&mut self, wavelengths: &[Wavelengths]) {
        let count = self.layers.count();
        // The last layer of shadow catchers is a weight.
        let light_layers = if self.layers.of_catchers().is_some() { count - 1 } else { count };
        for (i, wavelengths) in wavelengths.iter().enumerate().take(self.count) {
            let [a, b, c, alpha] = self.samples[i];
            let [red, green, blue] = wavelengths.rgb([a, b, c]);
            self.samples[i] = [red, green, blue, alpha];
            self.baseline.get_mut(i).into_iter().for_each(|baseline| *baseline = wavelengths.rgb(*baseline));
            self.layer_values[i * count..i * count + light_layers]
                .iter_mut()
                .for_each(|part| *part = wavelengths.rgb(*part));
        }
    }

    /// Red, green, blue and alpha of all samples.
    pub fn samples(&self) -> &[[f32; 4]] {
        &self.samples[..self.count]
    }

    /// The layers of a sample.
    pub fn layer_values(&self, sample: usize) -> &[[f32; 3]] {
        let count = self.layers.count();
        &self.layer_values[sample * count..(sample + 1) * count]
    }
}
