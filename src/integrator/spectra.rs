//! Paths that carry wavelengths instead of red, green and blue (hero wavelength sampling: Wilkie et al. 2014).
//!
//! Everything that a path carries by channel is by wavelength then: throughput, BSDFs, what media absorb and what lights send. The
//! choices that a path takes treat its wavelengths alike, which weighs them against each other as the balance heuristic does; where
//! one direction is that of one wavelength only (dispersion), the path goes on with one of them, drawn in proportion to what it
//! carries. Colours come in as spectra where they are read; [`Sink::to_rgb`](super::sink::Sink::to_rgb) makes colours of
//! what arrived.

use super::group::Sorted;
use super::hit_point::HitPoint;
use super::lanes::{get_rgb, set_rgb};
use super::workspace::Workspace;
use super::{Integrator, Purpose};
use crate::bsdf::{Bsdf, Slots};
use crate::color::Rgb;
use crate::color::spectral::{Spectrum, Wavelengths, uplifted_light};
use crate::math::Vec3;
use crate::sampling::sampler::SobolPoint;

/// The spectrum of light whose spectrum looks like a colour, but for its strength.
fn scaled(spectrum: &Spectrum, rgb: Rgb, waves: &Wavelengths) -> Rgb {
    let look = spectrum.rgb().max(Rgb::ZERO).mean();
    let strength = if look > 0.0 { rgb.mean() / look } else { 0.0 };
    spectrum.at(waves) * strength
}

impl Integrator<'_> {
    /// Do paths carry wavelengths?
    #[inline(always)]
    pub(super) fn is_spectral(&self) -> bool {
        self.scene.shading.spectral
    }

    /// Draws the wavelengths of each new path.
    #[cold]
    pub(super) fn start_waves(&self, w: &mut Workspace) {
        let Workspace { times, arriving, pixels, .. } = w;
        let dimensions = self.dimensions(0, Purpose::Wavelength);
        let path = &arriving.carried;
        let draw = |i: usize| {
            let [u, ..] = SobolPoint::from_parts(path.seed[i], path.shuffled[i]).sample_4d(&dimensions);
            Wavelengths::draw(u)
        };
        times.start_waves((0..pixels.len()).map(draw), self.options.branches);
    }

    /// What light of a colour is in the lanes of a path; `light` is the light that it comes from, if its spectrum may be known.
    #[inline]
    pub(super) fn lanes_of_light(&self, rgb: Rgb, light: Option<u32>, waves: Option<&Wavelengths>) -> Rgb {
        let Some(waves) = waves else { return rgb };
        match light.and_then(|light| self.scene.spectrum_of_light(light)) {
            Some(spectrum) => scaled(spectrum, rgb, waves),
            None => uplifted_light(rgb, waves),
        }
    }

    /// From colours of light samples to what they are in the lanes of paths.
    #[cold]
    pub(super) fn take_lights_apart(&self, sorted: &Sorted, w: &mut Workspace) {
        let Workspace { wave, times, .. } = w;
        let light = &mut wave.vertices.light;
        for i in sorted.lit() {
            let rgb = get_rgb(&light.radiance, i);
            if rgb.max_element() > 0.0 {
                let index = self.only_light.unwrap_or(light.index[i]);
                let waves = times.waves(wave.paths.carried.sample[i]);
                set_rgb(&mut light.radiance, i, self.lanes_of_light(rgb, Some(index), waves));
            }
        }
    }

    /// The radiance that a surface emits towards `wo`, everywhere alike or at a point by its texture, in the lanes of a path.
    pub(super) fn emitted(&self, at: &HitPoint<'_>, wo: Vec3, waves: Option<&Wavelengths>) -> Rgb {
        let HitPoint { surface, hit, material, time, .. } = at;
        let Some(emission) = material.emission else { return Rgb::ZERO };
        let rgb = match emission.radiance.texture {
            None => Rgb::from_array(emission.radiance.factor),
            Some(_) => {
                // A point: light sampling, which this is weighted against, uses points too.
                let at = self.scene.geometries.coordinates(surface, hit, false, *time);
                self.slots(&at, surface, wo, 0.0).color(&emission.radiance)
            }
        };
        match (waves, &material.light_spectrum) {
            (None, _) => rgb,
            (Some(waves), Some(spectrum)) => scaled(spectrum, rgb, waves),
            (Some(waves), None) => uplifted_light(rgb, waves),
        }
    }

    /// The BSDF that outputs show of a surface, which are by red, green and blue.
    #[cold]
    pub(super) fn shown_bsdf(&self, at: &HitPoint<'_>, wo: Vec3) -> Bsdf {
        self.read_material(at, 0.0, wo, None).0
    }
}
