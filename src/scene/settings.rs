//! What a scene may say about rendering; `None` leaves it to the defaults.

/// Reconstruction filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// One pixel wide, constant.
    Box,
    /// Truncated Gaussian, sigma 0.5 pixels, radius 1.5.
    Gaussian,
    /// Blackman-Harris window, radius 1.5.
    #[default]
    BlackmanHarris,
}

/// Treatment of light that bounces more than once between microfacets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Microfacet {
    /// The energy that single scattering loses is given back: scaled up (Turquin 2019), in solid glass sent where walks among
    /// facets lead (see [`crate::bsdf::RoughDielectric`]).
    #[default]
    Multi,
    /// Single scattering only, for comparison with renderers that do so.
    Single,
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
    /// Largest number of scattering events; 0 shows emission only.
    pub depth: Option<u32>,
    /// Seed of all randomness.
    pub seed: Option<u32>,
    /// Reconstruction filter.
    pub filter: Option<Filter>,
    /// Microfacet model.
    pub microfacet: Option<Microfacet>,
    /// Exposure of the PNG, stops.
    pub exposure: Option<f32>,
}
