//! What solids are filled with: indices of refraction and absorption.

use super::scattering::Scattering;
use super::scattering_spectra::ScatteringSpectra;
use crate::bsdf::BsdfClass;
use crate::color::Rgb;
use crate::color::spectral::{Spectrum, Wavelengths};
use crate::math::poly;
use crate::scene::{self, Model, PbrMaterial, Transmission};
use std::sync::Arc;

/// The inside of a solid that light passes.
#[derive(Clone, Debug, PartialEq)]
pub struct Medium {
    /// Index of refraction of the red, green and blue channel, relative to air; `None` where the surface reflects all
    /// light or none, whatever is beside it.
    pub iors: Option<[f32; 3]>,
    /// Extinction coefficient by channel, per metre, of media that only absorb; `None` for clear ones and those that
    /// scatter.
    pub absorption: Option<Rgb>,
    /// What scatters or shines.
    pub scattering: Option<Scattering>,
    /// It is bounded by no surface.
    pub is_boundary: bool,
    /// It adds to others that fill the same place and do so, too. Solids with a surface displace what they overlap, and so does
    /// what has no surface and does nothing.
    pub adds_up: bool,
    /// Where solids overlap the one of the highest priority counts.
    pub priority: i32,
    /// What it does to each wavelength; where pictures are rendered by wavelength and it does not treat all alike.
    pub spectra: Option<MediumSpectra>,
}

/// A medium by wavelength.
#[derive(Clone, Debug, PartialEq)]
pub struct MediumSpectra {
    /// Index of refraction of a dispersive one: these are A and B, with wavelengths in micrometres, of Cauchy's A + B / l^2.
    cauchy: Option<[f32; 2]>,
    /// What of light is left after a way of so many metres.
    left: Option<(Spectrum, f32)>,
}

impl Medium {
    /// What surrounds the scene.
    pub const AIR: Medium = Medium {
        iors: Some([1.0; 3]),
        absorption: None,
        scattering: None,
        is_boundary: false,
        adds_up: false,
        priority: 0,
        spectra: None,
    };

    /// What a material's solids are filled with; `None` for opaque and thin-walled ones.
    pub(super) fn of(model: &Model, class: BsdfClass, filling: Option<&scene::Medium>) -> Option<Medium> {
        let medium = Medium::of_model(model, class)?;
        let Some(filling) = filling else { return Some(medium) };
        let extinction = Rgb::from_array(filling.extinction);
        Some(match Scattering::of(filling, medium.absorption) {
            Some(scattering) => Medium { absorption: None, scattering: Some(scattering), ..medium },
            None if extinction.max_element() > 0.0 => {
                let absorption = Some(medium.absorption.unwrap_or(Rgb::ZERO) + extinction);
                Medium { absorption, ..medium }
            }
            None => medium,
        })
    }

    fn of_model(model: &Model, class: BsdfClass) -> Option<Medium> {
        let is_boundary = matches!(model, Model::Boundary {});
        let clear = |iors| Medium { iors, is_boundary, ..Medium::AIR };
        match model.transmission() {
            Transmission::None | Transmission::Thin => None,
            Transmission::Clear(ior) => Some(clear(relative_to_air([ior; 3]))),
            Transmission::Pbr(pbr) => {
                let has_inside = class.refracts() && pbr.has_volume && lets_light_in(pbr);
                let iors = dispersion(pbr).unwrap_or([pbr.ior; 3]);
                has_inside.then(|| Medium { absorption: absorption(pbr), ..clear(relative_to_air(iors)) })
            }
        }
    }

    /// The same for pictures that are rendered by wavelength.
    pub(super) fn by_wavelength(mut self, model: &Model, filling: Option<&scene::Medium>) -> Medium {
        let pbr = model.pbr();
        let cauchy = pbr.filter(|_| self.iors.is_some()).and_then(|pbr| {
            let b = spread(pbr)?;
            Some([(f64::from(pbr.ior) - b * inverse_square(D_LINE_NM)) as f32, b as f32])
        });
        let left = |absorption: Rgb| {
            // The way whose colour the file gives; else that after which some third is left.
            let given = pbr.map_or(0.0, |pbr| pbr.attenuation_distance);
            let way = if given > 0.0 && given.is_finite() { given } else { 1.0 / absorption.mean() };
            (Spectrum::of_share((absorption * -way).map(poly::exp)), way)
        };
        if let (Some(scattering), Some(filling)) = (&mut self.scattering, filling) {
            let absorption = pbr.filter(|pbr| pbr.has_volume).and_then(absorption);
            let left = absorption.map(left);
            scattering.spectra = ScatteringSpectra::of(filling, left, !self.is_boundary).map(Arc::new);
        }
        let left = self.absorption.filter(|a| a.max_element() > a.min_element()).map(left);
        let spectra = (cauchy.is_some() || left.is_some()).then_some(MediumSpectra { cauchy, left });
        Medium { spectra, ..self }
    }

    /// Its indices of refraction in the lanes of a path.
    #[inline]
    pub fn iors_at(&self, waves: Option<&Wavelengths>) -> Option<[f32; 3]> {
        let cauchy = self.spectra.as_ref().and_then(|spectra| spectra.cauchy);
        match (waves, cauchy) {
            (Some(waves), Some([a, b])) => Some(waves.nm.map(|nm| (a + b * 1e6 / (nm * nm)).max(1.0))),
            _ => self.iors,
        }
    }

    /// What is left of light in the lanes of a path after a way through the medium, in metres.
    #[inline]
    pub fn transmittance_at(&self, distance: f32, waves: Option<&Wavelengths>) -> Rgb {
        let left = self.spectra.as_ref().and_then(|spectra| spectra.left.as_ref());
        match (waves, left) {
            (Some(waves), Some((spectrum, way))) => {
                let depth = spectrum.at(waves).map(|left| poly::ln(left.max(f32::MIN_POSITIVE)));
                (depth * (distance / way)).map(|depth| if depth > -87.0 { poly::exp(depth) } else { 0.0 })
            }
            _ => self.transmittance(distance),
        }
    }

    /// Does light lose or gain anything in it?
    pub fn does_anything(&self) -> bool {
        let scatters = |s: &Scattering| s.extinction.max_element() > 0.0 || s.emission.max_element() > 0.0;
        self.absorption.is_some_and(|a| a.max_element() > 0.0)
            || self.scattering.as_ref().is_some_and(scatters)
    }

    /// Does its index of refraction differ between channels?
    #[inline]
    pub fn is_dispersive(&self) -> bool {
        self.iors.is_some_and(|[r, g, b]| r != g || g != b)
    }

    /// What is left of light after a way through the medium, in metres.
    #[inline]
    pub fn transmittance(&self, distance: f32) -> Rgb {
        let Some(absorption) = self.absorption else { return Rgb::ONE };
        let optical = absorption * -distance;
        optical.map(poly::exp)
    }
}

/// An index of 0 stands for total reflection in KHR_materials_ior: it relates to no other.
fn relative_to_air(iors: [f32; 3]) -> Option<[f32; 3]> {
    iors.iter().all(|&ior| ior >= 1.0).then_some(iors)
}

/// What the solid of a glTF material absorbs.
fn absorption(pbr: &PbrMaterial) -> Option<Rgb> {
    scene::coefficients(pbr.attenuation_color, pbr.attenuation_distance).map(Rgb::from_array)
}

/// Indices of refraction by channel of a dispersive solid (KHR_materials_dispersion).
///
/// Cauchy's n(l) = A + B / l^2 has index `ior` at the d line (587.6 nm) and the Abbe number 20 / dispersion between the
/// F and C lines (486.1 and 656.3 nm). The channels stand for the wavelengths at which the primaries of
/// Rec.709 dominate: 611.4, 549.1 and 464.2 nm.
fn dispersion(pbr: &PbrMaterial) -> Option<[f32; 3]> {
    let b = spread(pbr)?;
    let at = |nm: f64| f64::from(pbr.ior) + b * (inverse_square(nm) - inverse_square(D_LINE_NM));
    Some([611.4, 549.1, 464.2].map(|nm| at(nm).max(1.0) as f32))
}

/// At which indices of refraction are given.
const D_LINE_NM: f64 = 587.6;

/// Per square micrometre.
fn inverse_square(nm: f64) -> f64 {
    1e6 / (nm * nm)
}

/// Its B.
fn spread(pbr: &PbrMaterial) -> Option<f64> {
    if pbr.transmission.factor <= 0.0 || pbr.dispersion <= 0.0 || pbr.ior <= 0.0 {
        return None;
    }
    let spread = (f64::from(pbr.ior) - 1.0) * f64::from(pbr.dispersion) / 20.0;
    Some(spread / (inverse_square(486.1) - inverse_square(656.3)))
}

/// Does light pass the surface?
pub(super) fn lets_light_in(pbr: &PbrMaterial) -> bool {
    pbr.transmission.factor > 0.0 || pbr.diffuse_transmission.is_some()
}
