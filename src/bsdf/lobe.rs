//! What every way of scattering offers.

use super::{BsdfEval, BsdfSample};
use crate::color::Rgb;
use crate::math::Vec3;

/// A way of scattering light: the parameters of one BSDF at a point. Directions as in [`super::Bsdf`], with a z of 0
/// instead of -0.
pub trait Lobe: Copy {
    /// Chooses a direction. `u[2]` chooses among lobes, the others the direction in it.
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample;

    /// Value and density for two directions; specular lobes count as zero.
    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval;

    /// Are all its samples specular, so that light sampling is in vain?
    fn is_specular(&self) -> bool;

    /// With its base colour multiplied (by the colour of vertices).
    fn tinted(self, color: Rgb) -> Self;

    /// A plain colour for the albedo output: reflectance at normal incidence, white for clear glass.
    fn albedo(&self) -> Rgb;
}

/// A [`Lobe`] that light may pass.
pub trait Transmissive: Lobe {
    /// May light from the other side of the surface reach the viewer by a lobe of finite width?
    const SCATTERS_THROUGH: bool;

    /// May it be the surface of a solid, which bends light?
    const REFRACTS: bool;

    /// May its sides change places, so that glass of a lower index than what surrounds it is glass of the inverse index
    /// that is seen from within? What has layers on its outside may not.
    const TURNS_OVER: bool;

    /// With another index of refraction of its glass, for one wavelength of a dispersive material.
    fn with_ior(self, ior: f32) -> Self;

    /// Factor on the light that crosses the surface, whatever is reflected.
    fn crossing_tint(&self) -> Rgb;

    /// Share of the light that passes straight on, as if nothing but a filter was there; zero for what bends or blurs it.
    #[inline(always)]
    fn straight(&self, _wo: Vec3) -> Rgb {
        Rgb::ZERO
    }
}
