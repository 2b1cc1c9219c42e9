//! Media that scatter or shine, ready for rendering.

use super::density::DensityGrid;
use super::glow::Glow;
use super::scattering_spectra::ScatteringSpectra;
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::math::{Vec3, poly};
use crate::sampling::hash::hash32;
use crate::scene;
use std::borrow::Cow;
use std::sync::Arc;

/// A medium that scatters or shines.
#[derive(Clone, Debug, PartialEq)]
pub struct Scattering {
    /// Extinction coefficient, per metre.
    pub extinction: Rgb,
    /// The part of it that is scattered.
    pub scattered: Rgb,
    /// Radiance that each metre adds.
    pub emission: Rgb,
    /// Mean cosine of the scattering angle.
    pub anisotropy: f32,
    /// Where it ends, if not at the surfaces of solids.
    pub ball: Option<Ball>,
    /// Factors on the coefficients, the same for all channels; `None` where it is homogeneous.
    pub grid: Option<Arc<DensityGrid>>,
    /// What the emission is taken times in place of that grid; `None` where it is not known apart.
    pub glow: Option<Arc<Glow>>,
    /// What it scatters counts as bounces. Walks within solids that have a surface don't.
    pub counts: bool,
    /// The coefficients by wavelength; where pictures are rendered by wavelength and they are coloured.
    pub spectra: Option<Arc<ScatteringSpectra>>,
}

/// A ball that fog fills.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Its middle, in the compiled scene's coordinates.
    pub center: Vec3,
    /// Its radius, metres.
    pub radius: f32,
}

impl Scattering {
    /// Distances beyond this are infinite: nothing of a scene is as far away.
    pub const FARTHEST: f32 = 1e18;

    /// What scatters in a medium; `None` where it only absorbs, the same everywhere.
    pub(super) fn of(medium: &scene::Medium, absorption: Option<Rgb>) -> Option<Scattering> {
        let extinction = Rgb::from_array(medium.extinction);
        let scattered = extinction * Rgb::from_array(medium.albedo);
        let emission = Rgb::from_array(medium.emission);
        let extinction = extinction + absorption.unwrap_or(Rgb::ZERO);
        let shines = emission.max_element() > 0.0;
        let does_anything = scattered.max_element() > 0.0 || shines || medium.grid.is_some();
        let anisotropy = medium.anisotropy;
        let (ball, grid, glow) = (None, None, None);
        let (counts, spectra) = (true, None);
        let medium =
            Scattering { extinction, scattered, emission, anisotropy, ball, grid, glow, counts, spectra };
        does_anything.then_some(medium)
    }

    /// The medium as the lanes of a path meet it.
    #[inline(always)]
    pub fn in_lanes(&self, waves: Option<&Wavelengths>) -> Cow<'_, Scattering> {
        match (&self.spectra, waves) {
            (Some(spectra), Some(waves)) => Cow::Owned(self.at(spectra, waves)),
            _ => Cow::Borrowed(self),
        }
    }

    #[cold]
    fn at(&self, spectra: &ScatteringSpectra, waves: &Wavelengths) -> Scattering {
        let [extinction, scattered, emission] = spectra.at(waves);
        Scattering { extinction, scattered, emission, spectra: None, ..self.clone() }
    }

    /// Where a ray enters and leaves the medium, behind `from`; empty where the second is not above the first.
    #[inline]
    pub fn extent(&self, origin: Vec3, direction: Vec3, from: f32) -> [f32; 2] {
        let Some(Ball { center, radius }) = self.ball else { return [from, f32::INFINITY] };
        // The closest point of the ray's line first: far away from the ball the square of the distance would drown it.
        let squared = direction.length_squared();
        let closest = (center - origin).dot(direction) / squared;
        let beside = origin + direction * closest - center;
        let chord = (radius * radius - beside.length_squared()) / squared;
        if chord > 0.0 {
            let half = chord.sqrt();
            [from.max(closest - half), from.max(closest + half)]
        } else {
            [from, from]
        }
    }

    /// Does light of all channels go as far?
    #[inline]
    pub fn is_grey(&self) -> bool {
        let Rgb { r, g, b } = self.extinction;
        r == g && g == b
    }

    /// What is left of light after a way in the medium, metres.
    #[inline]
    pub fn transmittance(&self, distance: f32) -> Rgb {
        // Far away an extinction of 0 would be no number.
        let distance = distance.min(Scattering::FARTHEST);
        // The polynomial ends at the least normal number, but nothing is seen through fog without an end.
        (self.extinction * distance).map(|depth| if depth < 87.0 { poly::exp(-depth) } else { 0.0 })
    }

    /// The mean of what is left over a way in the medium, metres.
    #[inline]
    pub fn mean_transmittance(&self, distance: f32) -> Rgb {
        let distance = distance.min(Scattering::FARTHEST);
        (self.extinction * distance).map(|depth| match depth {
            // The series is closer there.
            thin if thin < 1e-3 => 1.0 - 0.5 * thin,
            depth => (1.0 - poly::exp(-depth)) / depth,
        })
    }

    /// What is left of light on a ray from one of its points to another; where there is a grid, an estimate by numbers that follow
    /// from the ray and `apart`, which keeps media in the same place apart.
    #[inline]
    pub fn transmittance_between(
        &self,
        (origin, direction): (Vec3, Vec3),
        [from, to]: [f32; 2],
        apart: u32,
    ) -> Rgb {
        if let Some(grid) = &self.grid {
            let bits = [origin.x, origin.y, origin.z, direction.x, direction.y, direction.z, from];
            let salt = bits.into_iter().fold(apart, |salt, x| hash32(salt ^ x.to_bits()));
            let most = self.extinction.max_element();
            let ray = grid.ray(origin, direction, most);
            return match self.is_grey() {
                true => Rgb::ONE * grid.left(&ray, from, to, salt),
                false => grid.left_by_channel(&ray, [from, to], salt, self.extinction / most),
            };
        }
        let [begin, end] = self.extent(origin, direction, from);
        let to = to.min(end);
        if to > begin { self.transmittance((to - begin) * direction.length()) } else { Rgb::ONE }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(radius: f32) -> Scattering {
        let extinction = Rgb::new(0.5, 1.0, 0.0);
        let ball = Some(Ball { center: Vec3::new(0.0, 0.0, 10.0), radius });
        Scattering {
            extinction,
            scattered: extinction,
            emission: Rgb::ZERO,
            anisotropy: 0.0,
            ball,
            grid: None,
            glow: None,
            counts: true,
            spectra: None,
        }
    }

    #[test]
    fn rays_cross_a_ball_of_fog() {
        let medium = ball(2.0);
        let along = |origin: Vec3, to: f32| medium.transmittance_between((origin, Vec3::Z), [0.0, to], 0);
        let close = |a: Rgb, way: f32| {
            let b = Rgb::new((-0.5 * way).exp(), (-way).exp(), 1.0);
            assert!((a - b).to_array().iter().all(|d| d.abs() < 1e-5), "{a:?} {b:?}");
        };
        close(along(Vec3::ZERO, f32::INFINITY), 4.0);
        close(along(Vec3::ZERO, 9.0), 1.0);
        close(along(Vec3::ZERO, 7.0), 0.0);
        close(along(Vec3::new(0.0, 0.0, 11.0), f32::INFINITY), 1.0);
        close(along(Vec3::new(0.0, 0.0, 20.0), f32::INFINITY), 0.0);
        close(along(Vec3::new(0.0, 3.0, 0.0), f32::INFINITY), 0.0);
        close(along(Vec3::new(0.0, 3f32.sqrt(), 0.0), f32::INFINITY), 2.0);
    }

    #[test]
    fn nothing_is_seen_through_fog_without_an_end() {
        let medium = Scattering { ball: None, ..ball(1.0) };
        let left = medium.transmittance_between((Vec3::ZERO, Vec3::Z), [0.0, f32::INFINITY], 0);
        assert_eq!(left, Rgb::new(0.0, 0.0, 1.0));
    }
}
