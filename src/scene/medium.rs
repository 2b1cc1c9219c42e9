//! What fills a space that light crosses: fog, smoke, milk.

use super::ids::GridId;
use super::slot::Parameters;
use crate::math::DVec3;

/// A medium that scatters, absorbs and shines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Extinction coefficient by channel, per metre: how often light meets something on its way.
    pub extinction: [f32; 3],
    /// The share of it that is scattered, 0..1; the rest is absorbed.
    pub albedo: [f32; 3],
    /// Mean cosine of the scattering angle, between -1 and 1 (Henyey, Greenstein 1941): 0 is the same to all sides, above it
    /// light goes on as it went.
    pub anisotropy: f32,
    /// Radiance that each metre adds.
    pub emission: [f32; 3],
    /// Factors on the extinction, and on the emission where nothing else is; media that shine have the same extinction in all
    /// channels then.
    pub grid: Option<GridId>,
    /// What the emission is taken times in place of that grid, where there is one.
    pub glow: Option<Glow>,
}

/// Where a medium with a grid shines, by another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glow {
    /// Factors on the emission, or temperatures.
    pub grid: GridId,
    /// Kelvins where the grid is 1: the medium shines as a black body, and its emission is the luminance that each metre of
    /// [`Glow::REFERENCE_KELVIN`] adds.
    pub kelvin: Option<f32>,
    /// The luminance goes by the fourth power of the temperature, as all that a black body sends does (Stefan, Boltzmann), not
    /// as what is seen of it (Planck's law).
    pub goes_by_power: bool,
}

impl Glow {
    /// The temperature at which black bodies have the emission that is given.
    pub const REFERENCE_KELVIN: f32 = 1500.0;
}

/// What fills the space around all solids.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fog {
    /// The medium.
    pub medium: Medium,
    /// Middle of the ball that it fills.
    pub center: DVec3,
    /// Radius of the ball, metres; infinite for fog without an end, through which nothing infinitely far away is seen.
    pub radius: f64,
}

impl Medium {
    /// A medium of an extinction coefficient that absorbs nothing and scatters evenly.
    pub fn scattering(extinction: [f32; 3]) -> Medium {
        Medium { extinction, albedo: [1.0; 3], anisotropy: 0.0, emission: [0.0; 3], grid: None, glow: None }
    }

    /// A medium of mean free paths `radius`, metres, of which a thick body under a surface that neither refracts nor reflects
    /// scatters a share `color` of the light back.
    ///
    /// The share of each event follows by van de Hulst's fit for a half space that is lit diffusely, as inverted by Kulla
    /// and Conty (2017, "Revisiting Physically Based Shading at Imageworks", equations 9 and 10).
    pub fn subsurface(color: [f32; 3], radius: [f32; 3], anisotropy: f32) -> Medium {
        Medium {
            extinction: radius.map(f32::recip),
            albedo: color.map(|c| Medium::albedo_of_color(c, anisotropy)),
            anisotropy,
            emission: [0.0; 3],
            grid: None,
            glow: None,
        }
    }

    /// One channel of that: the share of each event that is scattered.
    pub fn albedo_of_color(color: f32, anisotropy: f32) -> f32 {
        let (c, g) = (f64::from(color.clamp(0.0, 1.0)), f64::from(anisotropy));
        let s = 4.09712 + 4.20863 * c - (9.59217 + 41.6808 * c + 17.7126 * c * c).sqrt();
        ((1.0 - s * s) / (1.0 - g * s * s)).clamp(0.0, 1.0) as f32
    }
}

impl Medium {
    /// The share of diffuse light that a thick body of it scatters back under a surface that neither refracts nor reflects:
    /// the colour of [`Medium::subsurface`].
    pub fn color(&self) -> [f32; 3] {
        let g = f64::from(self.anisotropy);
        self.albedo.map(|albedo| {
            let albedo = f64::from(albedo.clamp(0.0, 1.0));
            let s = ((1.0 - albedo) / (1.0 - g * albedo)).sqrt();
            ((1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s)) as f32
        })
    }
}

impl Parameters for Medium {}

/// The extinction coefficients of Beer's law from what is left of white light after a distance (KHR_materials_volume); `None`
/// where nothing is lost.
pub fn coefficients(color: [f32; 3], distance: f32) -> Option<[f32; 3]> {
    let is_clear = color == [1.0; 3] || !distance.is_finite() || distance <= 0.0;
    // Black would be infinite; f32's smallest normal number is black enough.
    let sigma = |c: f32| -f64::from(c.clamp(f32::MIN_POSITIVE, 1.0)).ln() / f64::from(distance);
    (!is_clear).then(|| color.map(|c| sigma(c) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_have_the_color_that_they_were_made_for() {
        for (color, anisotropy) in [(0.0, 0.0), (0.1, 0.3), (0.5, -0.4), (0.9, 0.8), (1.0, 0.0)] {
            let [r, _, b] = Medium::subsurface([color, 0.5, color], [0.1; 3], anisotropy).color();
            assert!((r - color).abs() < 1e-4 && r == b, "{color} {anisotropy}: {r}");
        }
    }
}
