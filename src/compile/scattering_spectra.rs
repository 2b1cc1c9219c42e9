//! Coloured media that scatter or shine, by wavelength.

use crate::color::Rgb;
use crate::color::spectral::{Spectrum, Wavelengths};
use crate::math::poly;
use crate::scene;

/// The coefficients of a medium as spectra.
#[derive(Clone, Debug, PartialEq)]
pub struct ScatteringSpectra {
    /// Of what the medium says itself. Coefficients have no upper end: in the middle between 0 and twice the largest, spectra are the
    /// smoothest, as those of lights.
    extinction: Spectrum,
    /// What of light is left, but for that, after a way of so many metres.
    left: Option<(Spectrum, f32)>,
    albedo: Albedo,
    emission: Spectrum,
}

/// The share of extinction that is scattered.
#[derive(Clone, Debug, PartialEq)]
enum Albedo {
    Own(Spectrum),
    /// That of the colour of a thick body: what is seen of solids with a surface.
    OfBody(Spectrum, f32),
}

impl ScatteringSpectra {
    /// Of a medium of which solids with a surface (`is_body`) or spaces are full, and what light loses in it besides; `None` where it
    /// is grey.
    pub fn of(
        medium: &scene::Medium,
        left: Option<(Spectrum, f32)>,
        is_body: bool,
    ) -> Option<ScatteringSpectra> {
        let is_grey = |[r, g, b]: [f32; 3]| r == g && g == b;
        let own = [medium.extinction, medium.albedo, medium.emission];
        if left.is_none() && own.into_iter().all(is_grey) {
            return None;
        }
        let albedo = match is_body {
            true => Albedo::OfBody(Spectrum::of_share(Rgb::from_array(medium.color())), medium.anisotropy),
            false => Albedo::Own(Spectrum::of_share(Rgb::from_array(medium.albedo))),
        };
        let [extinction, _, emission] = own.map(|rgb| Spectrum::of_light(Rgb::from_array(rgb)));
        Some(ScatteringSpectra { extinction, left, albedo, emission })
    }

    /// Extinction, scattering and emission in the lanes of a path.
    pub fn at(&self, waves: &Wavelengths) -> [Rgb; 3] {
        let own = self.extinction.at(waves);
        let lost = self.left.as_ref().map_or(Rgb::ZERO, |(left, way)| {
            left.at(waves).map(|left| -poly::ln(left.clamp(f32::MIN_POSITIVE, 1.0)) / way)
        });
        let albedo = match &self.albedo {
            Albedo::Own(albedo) => albedo.at(waves).map(|share| share.min(1.0)),
            Albedo::OfBody(color, anisotropy) => {
                color.at(waves).map(|share| scene::Medium::albedo_of_color(share, *anisotropy))
            }
        };
        [own + lost, own * albedo, self.emission.at(waves)]
    }
}
