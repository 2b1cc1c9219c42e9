//! Multiple importance sampling of direct light: pdfs of light sampling and BSDF sampling, and MIS weights.
//!
//! The power heuristic weights both strategies (Veach 1997, "Robust Monte Carlo Methods for Light Transport Simulation", section
//! 9.2). For specular BSDFs and delta lights only one strategy is possible, with weight 1.

use crate::sampling::power_heuristic;
use bytemuck::Zeroable;

/// Pdf of a path's current direction: a solid-angle pdf in 1/sr, or specular; or a mark that the path has ended. Camera rays count as
/// specular.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
#[repr(transparent)]
pub struct DirectionPdf(f32);

impl DirectionPdf {
    /// Camera rays and specular lobes: no competing light sampling.
    pub const SPECULAR: DirectionPdf = DirectionPdf(0.0);

    /// The pdf of a scattered direction, 1/sr, 0 for specular lobes; or the end of the path if it doesn't survive.
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

    /// Is this a specular direction or a camera ray?
    #[inline(always)]
    pub fn is_specular(self) -> bool {
        self.0 == 0.0
    }

    /// Could light sampling have sampled the direction, too?
    #[inline(always)]
    pub fn competes(self) -> bool {
        self.0 > 0.0
    }

    /// The pdf, 1/sr; 0 for specular lobes.
    #[inline(always)]
    pub fn value(self) -> f32 {
        self.0
    }

    /// MIS weight of emission hit by the path; `light_pdf` is the pdf of light sampling for its direction, 1/sr.
    #[inline(always)]
    pub fn mis_weight(self, light_pdf: impl FnOnce() -> f32) -> f32 {
        if self.competes() { power_heuristic(self.0, light_pdf()) } else { 1.0 }
    }
}

/// Pdf of a light sample, 1/sr, including the light's selection probability; for delta lights that probability alone.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
#[repr(transparent)]
pub struct LightPdf(f32);

impl LightPdf {
    /// No sample.
    pub const NONE: LightPdf = LightPdf(0.0);

    /// The pdf of a sample of a non-delta light, 1/sr; 0 is no sample.
    #[inline(always)]
    pub fn new(pdf_solid_angle: f32) -> LightPdf {
        LightPdf(pdf_solid_angle)
    }

    /// The selection probability of a delta light.
    #[inline(always)]
    pub fn delta(probability: f32) -> LightPdf {
        LightPdf(-probability)
    }

    /// Is there no sample?
    #[inline(always)]
    pub fn is_none(self) -> bool {
        self.0 == 0.0
    }

    /// Is the light a delta light?
    #[inline(always)]
    pub fn is_delta(self) -> bool {
        self.0 < 0.0
    }

    /// The pdf, 1/sr, or the selection probability of a delta light.
    #[inline(always)]
    pub fn value(self) -> f32 {
        self.0.abs()
    }

    /// MIS weight of the sample; `scatter_pdf` is the pdf of BSDF sampling for its direction, 1/sr.
    #[inline(always)]
    pub fn mis_weight(self, scatter_pdf: f32) -> f32 {
        power_heuristic(self.value(), if self.is_delta() { 0.0 } else { scatter_pdf })
    }

    /// The pdf times a factor; for delta lights this divides the contribution by it.
    #[inline(always)]
    pub fn scaled(self, factor: f32) -> LightPdf {
        LightPdf(self.0 * factor)
    }

    /// MIS weight over the sample's pdf; 0 for no sample.
    #[inline(always)]
    pub fn mis_weight_over_pdf(self, scatter_pdf: f32) -> f32 {
        let pdf = self.value();
        self.mis_weight(scatter_pdf) / if pdf > 0.0 { pdf } else { 1.0 }
    }
}
