//! Multiple importance sampling: the densities of light sampling and of scattering, and their weights.
//!
//! Light sampling and scattered rays both find direct light. The power heuristic weights them (Veach 1997, "Robust
//! Monte Carlo Methods for Light Transport Simulation", section 9.2). Specular scattering and lights of zero size can
//! be sampled in one way only, which then has weight 1.

use crate::sampling::power_heuristic;
use bytemuck::Zeroable;

/// How the last direction of a path was sampled: with a solid-angle density in 1/sr, or by a specular lobe; or that the
/// path has ended. Camera rays count as specular.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
#[repr(transparent)]
pub struct DirectionPdf(f32);

impl DirectionPdf {
    /// Camera rays and specular lobes: light sampling finds nothing in their directions.
    pub const SPECULAR: DirectionPdf = DirectionPdf(0.0);

    /// The density of a scattered direction, 1/sr, 0 for specular lobes; or the path's end.
    #[inline(always)]
    pub fn after_roulette(pdf_solid_angle: f32, survives: bool) -> DirectionPdf {
        DirectionPdf(if survives { pdf_solid_angle } else { -1.0 })
    }

    /// Has the path ended?
    #[inline(always)]
    pub fn has_ended(self) -> bool {
        self.0 < 0.0
    }

    /// Does the path continue?
    #[inline(always)]
    pub fn is_alive(self) -> bool {
        self.0 >= 0.0
    }

    /// Was the direction that of a specular lobe or of a camera ray?
    #[inline(always)]
    pub fn is_specular(self) -> bool {
        self.0 == 0.0
    }

    /// Could light sampling have found the direction, too?
    #[inline(always)]
    pub fn competes(self) -> bool {
        self.0 > 0.0
    }

    /// The density, 1/sr; 0 for specular lobes.
    #[inline(always)]
    pub fn value(self) -> f32 {
        self.0
    }

    /// The MIS weight of emission that the path's ray hits, where light sampling finds its direction with a density in 1/sr.
    #[inline(always)]
    pub fn mis_weight(self, light_pdf: impl FnOnce() -> f32) -> f32 {
        if self.competes() { power_heuristic(self.0, light_pdf()) } else { 1.0 }
    }
}

/// The density of a light sample, 1/sr, with the probability of selecting the light; the probability alone for lights of zero
/// size.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
#[repr(transparent)]
pub struct LightPdf(f32);

impl LightPdf {
    /// No sample.
    pub const NONE: LightPdf = LightPdf(0.0);

    /// The density of a sample of a light with a size, 1/sr; 0 is no sample.
    #[inline(always)]
    pub fn new(pdf_solid_angle: f32) -> LightPdf {
        LightPdf(pdf_solid_angle)
    }

    /// The selection probability of a light of zero size.
    #[inline(always)]
    pub fn delta(probability: f32) -> LightPdf {
        LightPdf(-probability)
    }

    /// Is there no sample?
    #[inline(always)]
    pub fn is_none(self) -> bool {
        self.0 == 0.0
    }

    /// Is the light of zero size?
    #[inline(always)]
    pub fn is_delta(self) -> bool {
        self.0 < 0.0
    }

    /// The density, 1/sr, or the probability of a light of zero size.
    #[inline(always)]
    pub fn value(self) -> f32 {
        self.0.abs()
    }

    /// The MIS weight of the sample, where scattering finds its direction with a density in 1/sr.
    #[inline(always)]
    pub fn mis_weight(self, scatter_pdf: f32) -> f32 {
        power_heuristic(self.value(), if self.is_delta() { 0.0 } else { scatter_pdf })
    }

    /// With a density times a factor; for lights of zero size it scales the radiance.
    #[inline(always)]
    pub fn scaled(self, factor: f32) -> LightPdf {
        LightPdf(self.0 * factor)
    }

    /// The MIS weight over the sample's density; 0 for no sample.
    #[inline(always)]
    pub fn mis_weight_over_pdf(self, scatter_pdf: f32) -> f32 {
        let pdf = self.value();
        self.mis_weight(scatter_pdf) / if pdf > 0.0 { pdf } else { 1.0 }
    }
}
