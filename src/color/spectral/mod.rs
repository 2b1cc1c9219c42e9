//! Spectra for spectral rendering.
//!
//! Light is counted relative to daylight, the illuminant D65 of the CIE: what is 1 at all wavelengths is the white of Rec. 709.
//! A path carries [`LANES`] wavelengths side by side, where it carries red, green and blue otherwise (hero wavelength
//! sampling: Wilkie et al. 2014). What arrives at them becomes linear Rec. 709 by the observer of 1931 ([`Wavelengths::rgb`]).
//! Colours of Rec. 709 get smooth spectra by the method of Jakob and Hanika (2019, "A Low-Dimensional Function Space for
//! Efficient Spectral Upsampling"), of [`Sigmoid`]s.

mod metals;
mod uplift;
mod wavelengths;

pub use metals::Metal;
pub use uplift::{Sigmoid, Spectrum, uplifted_light, uplifted_share};
pub use wavelengths::{
    Curve, FIRST_NM, LANES, LAST_NM, SECOND_RADIATION_CONSTANT, Wavelengths, rgb_of, rgb_of_wavelength,
};
