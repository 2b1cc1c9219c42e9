//! Render settings that a scene file may carry; `None` is the default.

use super::model::FresnelModel;
use crate::color::ViewTransform;

/// Reconstruction filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Filter {
    /// One pixel wide, constant.
    Box,
    /// Truncated Gaussian, sigma 0.5 pixels, radius 1.5.
    Gaussian,
    /// Blackman-Harris window, radius 1.5.
    #[default]
    BlackmanHarris,
}

/// Compensation for the energy that single scattering between microfacets loses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EnergyCompensation {
    /// The lost energy is given back: by a factor (Turquin 2019); in solid glass, sent where walks among facets lead
    /// (see [`crate::bsdf::RoughDielectric`]).
    #[default]
    On,
    /// Single scattering only, for comparison with renderers that do so.
    Off,
}

/// What shadow catchers contribute to the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CatcherOutput {
    /// Shadows as alpha, and the light and colours that other objects bring besides: laid over a plate of what the catcher stands
    /// for, the picture shows the catcher as it would be among them.
    #[default]
    All,
    /// Alpha alone, by the mean of the channels, as Cycles has it.
    Shadows,
}

/// Choices among models of scattering that are the same for all materials of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShadingModel {
    /// Whether the energy that single scattering loses is given back.
    pub energy_compensation: EnergyCompensation,
    /// Fresnel term of the dielectric layers of glTF materials.
    pub fresnel: FresnelModel,
    /// Paths carry wavelengths instead of red, green and blue.
    pub spectral: bool,
}

/// Rendering settings that a scene file may carry.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// Picture width in pixels.
    pub width: Option<u32>,
    /// Picture height in pixels.
    pub height: Option<u32>,
    /// Samples a pixel.
    pub samples: Option<u32>,
    /// Maximum number of bounces; 0 shows emission only.
    pub depth: Option<u32>,
    /// Seed of all randomness.
    pub seed: Option<u32>,
    /// Reconstruction filter.
    pub filter: Option<Filter>,
    /// Energy compensation of rough surfaces; `microfacet` in scene files.
    pub energy_compensation: Option<EnergyCompensation>,
    /// Fresnel term of the dielectric layers of glTF materials.
    pub fresnel: Option<FresnelModel>,
    /// Whether paths carry wavelengths instead of red, green and blue.
    pub spectral: Option<bool>,
    /// Exposure of the PNG, stops.
    pub exposure: Option<f32>,
    /// How pictures to look at are encoded.
    pub view: Option<ViewTransform>,
    /// Temperature of the light that looks white in them, kelvin.
    pub white_balance: Option<f32>,
    /// Relative error at which the picture is done, percent; `samples` are the most of a pixel then.
    pub noise: Option<f32>,
    /// Whether noise is taken out of the finished picture.
    pub denoise: Option<bool>,
    /// The pixels to render: the first column and row, and those after the last.
    pub crop: Option<[u32; 4]>,
    /// Names of further channels to record.
    pub aovs: Option<Vec<String>>,
    /// What is shown of shadow catchers.
    pub caught: Option<CatcherOutput>,
}

impl Settings {
    /// These where they say something, else `other`.
    #[must_use]
    pub fn or(&self, other: &Settings) -> Settings {
        Settings {
            width: self.width.or(other.width),
            height: self.height.or(other.height),
            samples: self.samples.or(other.samples),
            depth: self.depth.or(other.depth),
            seed: self.seed.or(other.seed),
            filter: self.filter.or(other.filter),
            energy_compensation: self.energy_compensation.or(other.energy_compensation),
            fresnel: self.fresnel.or(other.fresnel),
            spectral: self.spectral.or(other.spectral),
            exposure: self.exposure.or(other.exposure),
            view: self.view.clone().or_else(|| other.view.clone()),
            white_balance: self.white_balance.or(other.white_balance),
            noise: self.noise.or(other.noise),
            denoise: self.denoise.or(other.denoise),
            crop: self.crop.or(other.crop),
            aovs: self.aovs.clone().or_else(|| other.aovs.clone()),
            caught: self.caught.or(other.caught),
        }
    }

    /// The models of scattering, the default ones where nothing is said.
    pub fn shading(&self) -> ShadingModel {
        ShadingModel {
            energy_compensation: self.energy_compensation.unwrap_or_default(),
            fresnel: self.fresnel.unwrap_or_default(),
            spectral: self.spectral.unwrap_or_default(),
        }
    }
}
