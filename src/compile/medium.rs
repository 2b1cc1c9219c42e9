//! Compiled participating media: indices of refraction, absorption, scattering and emission, and their spectra.

use super::density_grid::{CompiledEmissionGrid, DensityGrid};
use crate::bsdf::BsdfClass;
use crate::color::Rgb;
use crate::color::spectral::{Spectrum, Wavelengths};
use crate::math::{Vec3, poly};
use crate::sampling::hash::hash32;
use crate::scene;
use crate::scene::{Model, PbrMaterial, Transmission};
use std::borrow::Cow;
use std::sync::Arc;

/// The interior of a transmissive solid, or the medium around the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Medium {
    /// Index of refraction per channel, relative to air; `None` if the surface's reflectance doesn't depend on the adjacent
    /// medium (total or no reflection).
    pub iors: Option<[f32; 3]>,
    /// Absorption coefficient per channel, per metre, of purely absorbing media; `None` for clear and scattering ones.
    pub absorption: Option<Rgb>,
    /// Scattering and emission.
    pub scattering: Option<Scattering>,
    /// Index-matched boundary, without reflection and refraction.
    pub is_boundary: bool,
    /// Do coefficients add to those of other such media at a point? Solids with a surface, and clear index-matched media, replace
    /// the media that they overlap.
    pub is_additive: bool,
    /// A solid with a surface within which overlapping additive media of the same priority continue. Not for scattering solids,
    /// as their random walks ignore other media.
    pub keeps_overlapping_media: bool,
    /// Nested dielectrics: where solids overlap, the highest priority applies.
    pub priority: i32,
    /// Wavelength-dependent coefficients, in spectral rendering.
    pub spectra: Option<MediumSpectra>,
}

/// Wavelength-dependent coefficients of a medium.
#[derive(Clone, Debug, PartialEq)]
pub struct MediumSpectra {
    /// Index of refraction of a dispersive medium: A and B of Cauchy's equation A + B / l^2, l in micrometres.
    cauchy: Option<[f32; 2]>,
    /// Transmittance over a distance, metres.
    transmittance: Option<(Spectrum, f32)>,
}

impl Medium {
    pub const AIR: Medium = Medium {
        iors: Some([1.0; 3]),
        absorption: None,
        scattering: None,
        is_boundary: false,
        is_additive: false,
        keeps_overlapping_media: false,
        priority: 0,
        spectra: None,
    };

    /// The medium inside a material's solids; `None` for opaque and thin-walled materials.
    pub(super) fn of(
        model: &Model,
        class: BsdfClass,
        interior_medium: Option<&scene::Medium>,
    ) -> Option<Medium> {
        let medium = Medium::of_model(model, class)?;
        let Some(interior_medium) = interior_medium else { return Some(medium) };
        let extinction = Rgb::from_array(interior_medium.extinction);
        Some(match Scattering::of(interior_medium, medium.absorption) {
            Some(scattering) => {
                let is_subsurface = model.pbr().is_some_and(is_subsurface);
                let scattering = Some(Scattering { is_subsurface, ..scattering });
                Medium { absorption: None, scattering, ..medium }
            }
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
                let has_inside = class.refracts() && pbr.has_volume && is_transmissive_interface(pbr);
                let iors = dispersion(pbr).unwrap_or([pbr.ior; 3]);
                let clear = clear(relative_to_air(iors));
                has_inside.then(|| Medium {
                    absorption: absorption(pbr),
                    keeps_overlapping_media: pbr.keeps_radiance,
                    ..clear
                })
            }
        }
    }

    /// The medium for spectral rendering.
    pub(super) fn by_wavelength(mut self, model: &Model, interior_medium: Option<&scene::Medium>) -> Medium {
        let pbr = model.pbr();
        let cauchy = pbr.filter(|_| self.iors.is_some()).and_then(|pbr| {
            let b = cauchy_b(pbr)?;
            Some([(f64::from(pbr.ior) - b * inverse_square(D_LINE_NM)) as f32, b as f32])
        });
        let transmittance = |absorption: Rgb| {
            // Over the attenuation distance of the material, else over the mean free path.
            let attenuation_distance = pbr.map_or(0.0, |pbr| pbr.attenuation_distance);
            let distance = if attenuation_distance > 0.0 && attenuation_distance.is_finite() {
                attenuation_distance
            } else {
                1.0 / absorption.mean()
            };
            (Spectrum::of_reflectance((absorption * -distance).map(poly::exp)), distance)
        };
        if let (Some(scattering), Some(interior_medium)) = (&mut self.scattering, interior_medium) {
            let absorption = pbr.filter(|pbr| pbr.has_volume).and_then(absorption);
            let absorption = absorption.map(transmittance);
            scattering.spectra =
                ScatteringSpectra::of(interior_medium, absorption, !self.is_boundary).map(Arc::new);
        }
        let transmittance = self.absorption.filter(|a| a.max_element() > a.min_element()).map(transmittance);
        let spectra =
            (cauchy.is_some() || transmittance.is_some()).then_some(MediumSpectra { cauchy, transmittance });
        Medium { spectra, ..self }
    }

    /// Indices of refraction at a path's wavelengths.
    #[inline]
    pub fn iors_at(&self, waves: Option<&Wavelengths>) -> Option<[f32; 3]> {
        let cauchy = self.spectra.as_ref().and_then(|spectra| spectra.cauchy);
        match (waves, cauchy) {
            (Some(waves), Some([a, b])) => Some(waves.nm.map(|nm| (a + b * 1e6 / (nm * nm)).max(1.0))),
            _ => self.iors,
        }
    }

    /// Transmittance at a path's wavelengths over a distance in metres.
    #[inline]
    pub fn transmittance_at(&self, distance: f32, waves: Option<&Wavelengths>) -> Rgb {
        let transmittance = self.spectra.as_ref().and_then(|spectra| spectra.transmittance.as_ref());
        match (waves, transmittance) {
            (Some(waves), Some((spectrum, reference))) => {
                let depth = spectrum.at(waves).map(|t| poly::ln(t.max(f32::MIN_POSITIVE)));
                (depth * (distance / reference))
                    .map(|depth| if depth > -87.0 { poly::exp(depth) } else { 0.0 })
            }
            _ => self.transmittance(distance),
        }
    }

    /// Rank among the solids around a point: the highest one refracts. At equal priority, solids that keep overlapping media rank
    /// above additive media.
    #[inline]
    pub fn rank(&self) -> (i32, bool) {
        (self.priority, self.keeps_overlapping_media)
    }

    /// Does the medium absorb, scatter or emit?
    pub fn has_effect(&self) -> bool {
        let scatters = |s: &Scattering| s.extinction.max_element() > 0.0 || s.emission.max_element() > 0.0;
        self.absorption.is_some_and(|a| a.max_element() > 0.0)
            || self.scattering.as_ref().is_some_and(scatters)
    }

    /// Does the density vary by a grid?
    #[inline(always)]
    pub fn is_on_grid(&self) -> bool {
        self.scattering.as_ref().is_some_and(|s| s.grid().is_some())
    }

    /// Does the index of refraction differ between channels?
    #[inline]
    pub fn is_dispersive(&self) -> bool {
        self.iors.is_some_and(|[r, g, b]| r != g || g != b)
    }

    /// Transmittance over a distance in metres (Beer's law).
    #[inline]
    pub fn transmittance(&self, distance: f32) -> Rgb {
        let Some(absorption) = self.absorption else { return Rgb::ONE };
        let optical = absorption * -distance;
        optical.map(poly::exp)
    }
}

/// Indices of refraction; `None` for 0, which means a reflectance of 1 (KHR_materials_ior).
fn relative_to_air(iors: [f32; 3]) -> Option<[f32; 3]> {
    iors.iter().all(|&ior| ior >= 1.0).then_some(iors)
}

/// Absorption coefficient of a glTF material.
fn absorption(pbr: &PbrMaterial) -> Option<Rgb> {
    scene::coefficients(pbr.attenuation_color, pbr.attenuation_distance).map(Rgb::from_array)
}

/// Indices of refraction per channel of a dispersive solid (KHR_materials_dispersion).
///
/// Cauchy's n(l) = A + B / l^2 has the index `ior` at the d line (587.6 nm) and the Abbe number 20 / dispersion between the
/// F and C lines (486.1 and 656.3 nm). Channels are evaluated at the dominant wavelengths of the Rec. 709 primaries: 611.4,
/// 549.1 and 464.2 nm.
fn dispersion(pbr: &PbrMaterial) -> Option<[f32; 3]> {
    let b = cauchy_b(pbr)?;
    let at = |nm: f64| f64::from(pbr.ior) + b * (inverse_square(nm) - inverse_square(D_LINE_NM));
    Some([611.4, 549.1, 464.2].map(|nm| at(nm).max(1.0) as f32))
}

/// Wavelength of nominal indices of refraction (d line), nanometres.
const D_LINE_NM: f64 = 587.6;

/// 1 / l^2, per square micrometre.
fn inverse_square(nm: f64) -> f64 {
    1e6 / (nm * nm)
}

/// B of Cauchy's equation, square micrometres; `None` without dispersion.
fn cauchy_b(pbr: &PbrMaterial) -> Option<f64> {
    if pbr.transmission.factor <= 0.0 || pbr.dispersion <= 0.0 || pbr.ior <= 0.0 {
        return None;
    }
    let spread = (f64::from(pbr.ior) - 1.0) * f64::from(pbr.dispersion) / 20.0;
    Some(spread / (inverse_square(486.1) - inverse_square(656.3)))
}

/// Does the surface transmit light?
pub(super) fn is_transmissive_interface(pbr: &PbrMaterial) -> bool {
    pbr.transmission.factor > 0.0 || pbr.diffuse_transmission.is_some()
}

/// Does the medium stand for subsurface scattering, instead of filling a solid that refracts?
fn is_subsurface(pbr: &PbrMaterial) -> bool {
    pbr.transmission.factor <= 0.0
        || pbr.diffuse_transmission.is_some_and(|through| through.subsurface.is_some())
}

/// A medium that scatters or emits.
#[derive(Clone, Debug, PartialEq)]
pub struct Scattering {
    /// Extinction coefficient, per metre.
    pub extinction: Rgb,
    /// Scattering coefficient, per metre.
    pub scattering_coefficient: Rgb,
    /// Emitted radiance per metre.
    pub emission: Rgb,
    /// Mean cosine g of the phase function.
    pub anisotropy: f32,
    /// Spatial distribution of the coefficients.
    pub density: Density,
    /// Do scattering events count as bounces? Not those of subsurface scattering.
    pub counts_as_bounces: bool,
    /// Subsurface scattering: a part of the surface's reflection, with a limit of its own.
    pub is_subsurface: bool,
    /// Shadow rays never reach lights outside: surfaces that scatter or refract enclose the medium.
    pub is_enclosed: bool,
    /// Spectral coefficients, in spectral rendering of coloured media.
    pub spectra: Option<Arc<ScatteringSpectra>>,
}

/// Spatial distribution of a medium's coefficients. A new kind needs four methods: [`Scattering::extent`] and
/// [`Scattering::transmittance_between`] here, sampling a distance (`draw`) and emission in `integrator/medium_segment.rs`.
/// Overlapping media are lists of segments (`integrator/volumes.rs`).
#[derive(Clone, Debug, PartialEq)]
pub enum Density {
    /// Homogeneous, in a solid or unbounded.
    Homogeneous,
    /// Homogeneous inside a ball, empty outside.
    Ball(Ball),
    /// Heterogeneous: the coefficients times a grid's values.
    Grid(GridMedium),
}

impl Density {
    /// Does the medium extend to infinity in all directions?
    pub fn is_unbounded(&self) -> bool {
        match self {
            Density::Homogeneous => true,
            Density::Ball(_) | Density::Grid(_) => false,
        }
    }
}

/// The grids of a heterogeneous medium.
#[derive(Clone, Debug, PartialEq)]
pub struct GridMedium {
    /// Factors on the coefficients of all channels; upper bounds of factors per channel.
    pub density: Arc<DensityGrid>,
    /// Factors on the extinction per channel, if they differ. All grids but the emission's have the same voxels.
    pub extinction: Option<Arc<[Arc<DensityGrid>; 3]>>,
    /// Factors on scattering per channel, if they differ.
    pub scattering: Option<Arc<[Arc<DensityGrid>; 3]>>,
    /// Factors on the emission.
    pub emission: Arc<CompiledEmissionGrid>,
}

/// A ball of fog.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre, relative to the anchor.
    pub center: Vec3,
    /// Radius, metres.
    pub radius: f32,
}

impl GridMedium {
    /// Extinction factors per channel relative to the density at a point in voxel coordinates; 0 for density 0. In spectral
    /// rendering all are the mean of the channels.
    #[inline]
    pub fn relative_extinction(&self, p: Vec3, waves: Option<&Wavelengths>) -> Rgb {
        let Some(channels) = &self.extinction else { return Rgb::ONE };
        let relative = self.relative(channels, p);
        if waves.is_some() { Rgb::splat(relative.mean()) } else { relative }
    }

    /// Scattering factors per channel (or wavelength) relative to the density at a point in voxel coordinates.
    #[inline]
    pub fn relative_scattering(&self, p: Vec3, waves: Option<&Wavelengths>) -> Rgb {
        let Some(channels) = &self.scattering else { return self.relative_extinction(p, waves) };
        let relative = self.relative(channels, p);
        waves.map_or(relative, |waves| Spectrum::of_reflectance(relative).at(waves))
    }

    fn relative(&self, channels: &[Arc<DensityGrid>; 3], p: Vec3) -> Rgb {
        let density = self.density.density(p);
        if density <= 0.0 {
            return Rgb::ZERO;
        }
        Rgb::from_array([0, 1, 2].map(|c| (channels[c].density(p) / density).clamp(0.0, 1.0)))
    }
}

impl Scattering {
    /// Larger distances count as infinite, metres.
    pub const MAX_DISTANCE: f32 = 1e18;

    /// The scattering part of a medium; `None` for homogeneous, purely absorbing media.
    pub(super) fn of(medium: &scene::Medium, absorption: Option<Rgb>) -> Option<Scattering> {
        let extinction = Rgb::from_array(medium.extinction);
        let scattering_coefficient = extinction * Rgb::from_array(medium.albedo);
        let emission = Rgb::from_array(medium.emission);
        let extinction = extinction + absorption.unwrap_or(Rgb::ZERO);
        let is_emissive = emission.max_element() > 0.0;
        let has_effect = scattering_coefficient.max_element() > 0.0 || is_emissive || medium.grid.is_some();
        has_effect.then_some(Scattering {
            extinction,
            scattering_coefficient,
            emission,
            anisotropy: medium.anisotropy,
            density: Density::Homogeneous,
            counts_as_bounces: true,
            is_subsurface: false,
            is_enclosed: false,
            spectra: None,
        })
    }

    /// The medium with its coefficients at a path's wavelengths.
    #[inline(always)]
    pub fn at_wavelengths(&self, waves: Option<&Wavelengths>) -> Cow<'_, Scattering> {
        match (&self.spectra, waves) {
            (Some(spectra), Some(waves)) => Cow::Owned(self.at(spectra, waves)),
            _ => Cow::Borrowed(self),
        }
    }

    #[cold]
    fn at(&self, spectra: &ScatteringSpectra, waves: &Wavelengths) -> Scattering {
        let [extinction, scattering_coefficient, emission] = spectra.at(waves);
        Scattering { extinction, scattering_coefficient, emission, spectra: None, ..self.clone() }
    }

    /// The range of ray parameters, at least `from`, inside the medium; empty unless the second is larger.
    #[inline]
    pub fn extent(&self, origin: Vec3, direction: Vec3, from: f32) -> [f32; 2] {
        let Ball { center, radius } = match self.density {
            Density::Homogeneous | Density::Grid(_) => return [from, f32::INFINITY],
            Density::Ball(ball) => ball,
        };
        // From the closest point of the line: the quadratic formula cancels far from the ball.
        let squared = direction.length_squared();
        let closest = (center - origin).dot(direction) / squared;
        let offset = origin + direction * closest - center;
        let chord = (radius * radius - offset.length_squared()) / squared;
        if chord > 0.0 {
            let half = chord.sqrt();
            [from.max(closest - half), from.max(closest + half)]
        } else {
            [from, from]
        }
    }

    /// The grids, of a heterogeneous medium.
    #[inline]
    pub fn grid(&self) -> Option<&GridMedium> {
        match &self.density {
            Density::Grid(grid) => Some(grid),
            Density::Homogeneous | Density::Ball(_) => None,
        }
    }

    /// The emitted radiance per metre at a point (world space) inside the medium, at a path's wavelengths.
    #[inline]
    pub fn emission_at(&self, p: Vec3, waves: Option<&Wavelengths>) -> Rgb {
        let factor = self.grid().map_or(Rgb::ONE, |grid| grid.emission.at(p, waves));
        self.at_wavelengths(waves).emission * factor
    }

    /// Is the extinction equal in all channels?
    #[inline]
    pub fn is_grey(&self) -> bool {
        let Rgb { r, g, b } = self.extinction;
        r == g && g == b && self.grid().is_none_or(|grid| grid.extinction.is_none())
    }

    /// Transmittance over a distance in metres.
    #[inline]
    pub fn transmittance(&self, distance: f32) -> Rgb {
        // 0 * infinity would be NaN.
        let distance = distance.min(Scattering::MAX_DISTANCE);
        // exp(-depth) would be below the smallest normal number; unbounded fog must be opaque.
        (self.extinction * distance).map(|depth| if depth < 87.0 { poly::exp(-depth) } else { 0.0 })
    }

    /// Mean transmittance over a distance in metres: (1 - exp(-depth)) / depth.
    #[inline]
    pub fn mean_transmittance(&self, distance: f32) -> Rgb {
        let distance = distance.min(Scattering::MAX_DISTANCE);
        (self.extinction * distance).map(|depth| match depth {
            // Taylor series, to avoid cancellation.
            thin if thin < 1e-3 => 1.0 - 0.5 * thin,
            depth => (1.0 - poly::exp(-depth)) / depth,
        })
    }

    /// Transmittance between two ray parameters; with a grid an unbiased estimate, with random numbers hashed from the ray and
    /// `seed`, which must differ between overlapping media.
    #[inline]
    pub fn transmittance_between(
        &self,
        (origin, direction): (Vec3, Vec3),
        [from, to]: [f32; 2],
        (seed, waves): (u32, Option<&Wavelengths>),
    ) -> Rgb {
        match &self.density {
            Density::Homogeneous | Density::Ball(_) => {
                let [begin, end] = self.extent(origin, direction, from);
                let to = to.min(end);
                if to > begin { self.transmittance((to - begin) * direction.length()) } else { Rgb::ONE }
            }
            Density::Grid(own @ GridMedium { density: grid, .. }) => {
                let bits = [origin.x, origin.y, origin.z, direction.x, direction.y, direction.z, from];
                let seed = bits.into_iter().fold(seed, |seed, x| hash32(seed ^ x.to_bits()));
                let max_extinction = self.extinction.max_element();
                let ray = grid.ray(origin, direction, max_extinction);
                match self.is_grey() {
                    true => Rgb::ONE * grid.transmittance(&ray, from, to, seed),
                    false => {
                        let share = self.extinction / max_extinction;
                        let relative = |t: f32| share * own.relative_extinction(ray.at(t), waves);
                        grid.transmittance_by_channel(&ray, [from, to], seed, relative)
                    }
                }
            }
        }
    }
}

/// The coefficients of a medium as spectra.
#[derive(Clone, Debug, PartialEq)]
pub struct ScatteringSpectra {
    /// The extinction of the medium. As coefficients are unbounded, it is uplifted like a light, relative to twice its maximum,
    /// where spectra are smoothest.
    extinction: Spectrum,
    /// Transmittance of the material's absorption over a distance, metres.
    absorption: Option<(Spectrum, f32)>,
    albedo: Albedo,
    emission: Spectrum,
}

/// Single-scattering albedo.
#[derive(Clone, Debug, PartialEq)]
enum Albedo {
    Single(Spectrum),
    /// By the diffuse reflectance of a semi-infinite medium and g: for solids with a surface.
    OfReflectance(Spectrum, f32),
}

impl ScatteringSpectra {
    /// The spectra of a medium, with the transmittance of the material's absorption over a distance; `None` for grey media.
    /// `is_body`: the medium of solids with a surface.
    pub fn of(
        medium: &scene::Medium,
        absorption: Option<(Spectrum, f32)>,
        is_body: bool,
    ) -> Option<ScatteringSpectra> {
        let is_grey = |[r, g, b]: [f32; 3]| r == g && g == b;
        let coefficients = [medium.extinction, medium.albedo, medium.emission];
        if absorption.is_none() && coefficients.into_iter().all(is_grey) {
            return None;
        }
        let albedo = match is_body {
            true => Albedo::OfReflectance(
                Spectrum::of_reflectance(Rgb::from_array(medium.color())),
                medium.anisotropy,
            ),
            false => Albedo::Single(Spectrum::of_reflectance(Rgb::from_array(medium.albedo))),
        };
        let [extinction, _, emission] = coefficients.map(|rgb| Spectrum::of_light(Rgb::from_array(rgb)));
        Some(ScatteringSpectra { extinction, absorption, albedo, emission })
    }

    /// Extinction coefficient, scattering coefficient and emission at a path's wavelengths.
    pub fn at(&self, waves: &Wavelengths) -> [Rgb; 3] {
        let own_extinction = self.extinction.at(waves);
        let absorbed = self.absorption.as_ref().map_or(Rgb::ZERO, |(transmittance, distance)| {
            transmittance.at(waves).map(|t| -poly::ln(t.clamp(f32::MIN_POSITIVE, 1.0)) / distance)
        });
        let albedo = match &self.albedo {
            Albedo::Single(albedo) => albedo.at(waves).map(|share| share.min(1.0)),
            Albedo::OfReflectance(color, anisotropy) => {
                color.at(waves).map(|share| scene::Medium::albedo_of_color(share, *anisotropy))
            }
        };
        [own_extinction + absorbed, own_extinction * albedo, self.emission.at(waves)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(radius: f32) -> Scattering {
        let extinction = Rgb::new(0.5, 1.0, 0.0);
        let density = Density::Ball(Ball { center: Vec3::new(0.0, 0.0, 10.0), radius });
        Scattering {
            extinction,
            scattering_coefficient: extinction,
            emission: Rgb::ZERO,
            anisotropy: 0.0,
            density,
            counts_as_bounces: true,
            is_subsurface: false,
            is_enclosed: false,
            spectra: None,
        }
    }

    #[test]
    fn transmittance_through_a_ball_of_fog() {
        let medium = ball(2.0);
        let along =
            |origin: Vec3, to: f32| medium.transmittance_between((origin, Vec3::Z), [0.0, to], (0, None));
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
    fn unbounded_fog_is_opaque() {
        let medium = Scattering { density: Density::Homogeneous, ..ball(1.0) };
        let transmittance =
            medium.transmittance_between((Vec3::ZERO, Vec3::Z), [0.0, f32::INFINITY], (0, None));
        assert_eq!(transmittance, Rgb::new(0.0, 0.0, 1.0));
    }
}
