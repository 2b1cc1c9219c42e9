//! Participating media ready for rendering: indices of refraction, absorption, scattering and emission, and their spectra.

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
    /// Index of refraction of the red, green and blue channel, relative to air; `None` where the surface reflects all
    /// light or none, whatever is beside it.
    pub iors: Option<[f32; 3]>,
    /// Extinction coefficient by channel, per metre, of media that only absorb; `None` for clear ones and those that
    /// scatter.
    pub absorption: Option<Rgb>,
    /// Scattering and emission.
    pub scattering: Option<Scattering>,
    /// Its boundary is index-matched: no surface reflects or refracts there.
    pub is_boundary: bool,
    /// Its coefficients add to those of other such media at the same point. Solids with a surface displace what they overlap, and so do
    /// index-matched media that are clear.
    pub adds_up: bool,
    /// Nested dielectrics: where solids overlap, the highest priority counts.
    pub priority: i32,
    /// Its coefficients by wavelength; in spectral rendering, where they depend on the wavelength.
    pub spectra: Option<MediumSpectra>,
}

/// A medium by wavelength.
#[derive(Clone, Debug, PartialEq)]
pub struct MediumSpectra {
    /// Index of refraction of a dispersive one: these are A and B, with wavelengths in micrometres, of Cauchy's A + B / l^2.
    cauchy: Option<[f32; 2]>,
    /// Transmittance after a distance in metres.
    left: Option<(Spectrum, f32)>,
}

impl Medium {
    /// The surroundings of the scene.
    pub const AIR: Medium = Medium {
        iors: Some([1.0; 3]),
        absorption: None,
        scattering: None,
        is_boundary: false,
        adds_up: false,
        priority: 0,
        spectra: None,
    };

    /// The medium of a material's solids; `None` for opaque and thin-walled ones.
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
                let has_inside = class.refracts() && pbr.has_volume && is_transmissive_interface(pbr);
                let iors = dispersion(pbr).unwrap_or([pbr.ior; 3]);
                has_inside.then(|| Medium { absorption: absorption(pbr), ..clear(relative_to_air(iors)) })
            }
        }
    }

    /// The medium for spectral rendering.
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
            (Spectrum::of_reflectance((absorption * -way).map(poly::exp)), way)
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

    /// Its indices of refraction at a path's wavelengths.
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
        let left = self.spectra.as_ref().and_then(|spectra| spectra.left.as_ref());
        match (waves, left) {
            (Some(waves), Some((spectrum, way))) => {
                let depth = spectrum.at(waves).map(|left| poly::ln(left.max(f32::MIN_POSITIVE)));
                (depth * (distance / way)).map(|depth| if depth > -87.0 { poly::exp(depth) } else { 0.0 })
            }
            _ => self.transmittance(distance),
        }
    }

    /// Does it absorb, scatter or emit?
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

    /// Transmittance over a distance in metres (Beer's law).
    #[inline]
    pub fn transmittance(&self, distance: f32) -> Rgb {
        let Some(absorption) = self.absorption else { return Rgb::ONE };
        let optical = absorption * -distance;
        optical.map(poly::exp)
    }
}

/// `None` for an index of 0, which is total reflection in KHR_materials_ior.
fn relative_to_air(iors: [f32; 3]) -> Option<[f32; 3]> {
    iors.iter().all(|&ior| ior >= 1.0).then_some(iors)
}

/// Absorption coefficient of a glTF material.
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
pub(super) fn is_transmissive_interface(pbr: &PbrMaterial) -> bool {
    pbr.transmission.factor > 0.0 || pbr.diffuse_transmission.is_some()
}

/// A medium that scatters or emits.
#[derive(Clone, Debug, PartialEq)]
pub struct Scattering {
    /// Extinction coefficient, per metre.
    pub extinction: Rgb,
    /// Scattering coefficient, per metre.
    pub scattered: Rgb,
    /// Emitted radiance per metre.
    pub emission: Rgb,
    /// Mean cosine of the scattering angle.
    pub anisotropy: f32,
    /// Where these coefficients hold.
    pub density: Density,
    /// Scattering counts as bounces; false for subsurface scattering.
    pub counts: bool,
    /// Light samples from outside never reach it: surfaces that scatter or refract enclose it.
    pub is_enclosed: bool,
    /// The coefficients by wavelength; where pictures are rendered by wavelength and they are coloured.
    pub spectra: Option<Arc<ScatteringSpectra>>,
}

/// The kinds of media: where their coefficients hold, and how they vary there. The interface of a medium has four methods, each of
/// which covers all kinds: [`Scattering::extent`] and [`Scattering::transmittance_between`] here, sampling a distance (`draw`) and
/// emission in `integrator/medium_segment.rs`. Sums of media are lists of segments (`integrator/volumes.rs`).
#[derive(Clone, Debug, PartialEq)]
pub enum Density {
    /// Homogeneous, in a solid or in all space.
    Homogeneous,
    /// Homogeneous within a ball, nothing outside.
    Ball(Ball),
    /// Heterogeneous: the coefficients times a grid's values.
    Grid(GridMedium),
}

impl Density {
    /// Is it dense infinitely far away in all directions, so that nothing there is seen through it?
    pub fn is_endless(&self) -> bool {
        match self {
            Density::Homogeneous => true,
            Density::Ball(_) | Density::Grid(_) => false,
        }
    }
}

/// The grids of a heterogeneous medium.
#[derive(Clone, Debug, PartialEq)]
pub struct GridMedium {
    /// Factors on the coefficients of all channels; upper bounds where channels have their own.
    pub density: Arc<DensityGrid>,
    /// Factors on the extinction by channel, where they aren't those of the density. All grids but that of the emission have the same voxels.
    pub extinction: Option<Arc<[Arc<DensityGrid>; 3]>>,
    /// Factors on scattering by channel, likewise.
    pub scattering: Option<Arc<[Arc<DensityGrid>; 3]>>,
    /// Factors on the emission.
    pub emission: Arc<CompiledEmissionGrid>,
}

/// A ball that fog fills.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Its middle, in the compiled scene's coordinates.
    pub center: Vec3,
    /// Its radius, metres.
    pub radius: f32,
}

impl GridMedium {
    /// The factors on the extinction over those of the density, at a point in voxels; 0 where nothing is. In pictures by wavelength all are
    /// their mean.
    #[inline]
    pub fn relative_extinction(&self, p: Vec3, waves: Option<&Wavelengths>) -> Rgb {
        let Some(channels) = &self.extinction else { return Rgb::ONE };
        let relative = self.relative(channels, p);
        if waves.is_some() { Rgb::splat(relative.mean()) } else { relative }
    }

    /// The factors on scattering, likewise.
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
    /// Distances beyond this are infinite: nothing of a scene is as far away.
    pub const FARTHEST: f32 = 1e18;

    /// The scattering part of a medium; `None` where it only absorbs, the same everywhere.
    pub(super) fn of(medium: &scene::Medium, absorption: Option<Rgb>) -> Option<Scattering> {
        let extinction = Rgb::from_array(medium.extinction);
        let scattered = extinction * Rgb::from_array(medium.albedo);
        let emission = Rgb::from_array(medium.emission);
        let extinction = extinction + absorption.unwrap_or(Rgb::ZERO);
        let is_emissive = emission.max_element() > 0.0;
        let does_anything = scattered.max_element() > 0.0 || is_emissive || medium.grid.is_some();
        does_anything.then_some(Scattering {
            extinction,
            scattered,
            emission,
            anisotropy: medium.anisotropy,
            density: Density::Homogeneous,
            counts: true,
            is_enclosed: false,
            spectra: None,
        })
    }

    /// The medium with its coefficients at a path's wavelengths.
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

    /// The ray parameters from `from` on at which a ray enters and leaves the medium; the range is empty unless the second is larger.
    #[inline]
    pub fn extent(&self, origin: Vec3, direction: Vec3, from: f32) -> [f32; 2] {
        let Ball { center, radius } = match self.density {
            Density::Homogeneous | Density::Grid(_) => return [from, f32::INFINITY],
            Density::Ball(ball) => ball,
        };
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

    /// The grids of a heterogeneous medium.
    #[inline]
    pub fn grid(&self) -> Option<&GridMedium> {
        match &self.density {
            Density::Grid(grid) => Some(grid),
            Density::Homogeneous | Density::Ball(_) => None,
        }
    }

    /// The emitted radiance per metre at a point of the world within the medium, at a path's wavelengths.
    #[inline]
    pub fn emission_at(&self, p: Vec3, waves: Option<&Wavelengths>) -> Rgb {
        let factor = self.grid().map_or(Rgb::ONE, |grid| grid.emission.at(p, waves));
        self.in_lanes(waves).emission * factor
    }

    /// Is the extinction the same in all channels?
    #[inline]
    pub fn is_grey(&self) -> bool {
        let Rgb { r, g, b } = self.extinction;
        r == g && g == b && self.grid().is_none_or(|grid| grid.extinction.is_none())
    }

    /// Transmittance over a distance in metres.
    #[inline]
    pub fn transmittance(&self, distance: f32) -> Rgb {
        // Far away an extinction of 0 would be no number.
        let distance = distance.min(Scattering::FARTHEST);
        // The polynomial ends at the least normal number, but nothing is seen through fog without an end.
        (self.extinction * distance).map(|depth| if depth < 87.0 { poly::exp(-depth) } else { 0.0 })
    }

    /// Mean transmittance over a distance in metres: the integral over the distance, divided by it.
    #[inline]
    pub fn mean_transmittance(&self, distance: f32) -> Rgb {
        let distance = distance.min(Scattering::FARTHEST);
        (self.extinction * distance).map(|depth| match depth {
            // The series is closer there.
            thin if thin < 1e-3 => 1.0 - 0.5 * thin,
            depth => (1.0 - poly::exp(-depth)) / depth,
        })
    }

    /// Transmittance between two points of a ray; with a grid an unbiased estimate, by random numbers hashed from the ray and `apart`, a
    /// salt that differs between overlapping media.
    #[inline]
    pub fn transmittance_between(
        &self,
        (origin, direction): (Vec3, Vec3),
        [from, to]: [f32; 2],
        (apart, waves): (u32, Option<&Wavelengths>),
    ) -> Rgb {
        match &self.density {
            Density::Homogeneous | Density::Ball(_) => {
                let [begin, end] = self.extent(origin, direction, from);
                let to = to.min(end);
                if to > begin { self.transmittance((to - begin) * direction.length()) } else { Rgb::ONE }
            }
            Density::Grid(own @ GridMedium { density: grid, .. }) => {
                let bits = [origin.x, origin.y, origin.z, direction.x, direction.y, direction.z, from];
                let salt = bits.into_iter().fold(apart, |salt, x| hash32(salt ^ x.to_bits()));
                let most = self.extinction.max_element();
                let ray = grid.ray(origin, direction, most);
                match self.is_grey() {
                    true => Rgb::ONE * grid.transmittance(&ray, from, to, salt),
                    false => {
                        let share = self.extinction / most;
                        let relative = |t: f32| share * own.relative_extinction(ray.at(t), waves);
                        grid.transmittance_by_channel(&ray, [from, to], salt, relative)
                    }
                }
            }
        }
    }
}

/// The coefficients of a medium as spectra.
#[derive(Clone, Debug, PartialEq)]
pub struct ScatteringSpectra {
    /// The extinction of the medium itself. Coefficients have no upper end: in the middle between 0 and twice the largest, spectra are the
    /// smoothest, as those of lights.
    extinction: Spectrum,
    /// Transmittance of the material's absorption over a distance, metres.
    left: Option<(Spectrum, f32)>,
    albedo: Albedo,
    emission: Spectrum,
}

/// The share of extinction that is scattered.
#[derive(Clone, Debug, PartialEq)]
enum Albedo {
    Own(Spectrum),
    /// By the colour that a thick body shows: for solids with a surface.
    OfBody(Spectrum, f32),
}

impl ScatteringSpectra {
    /// The spectra of a medium that fills solids with a surface (`is_body`) or spaces, with the absorption of the material; `None` where it
    /// is grey.
    pub fn of(
        medium: &scene::Medium,
        left: Option<(Spectrum, f32)>,
        is_body: bool,
    ) -> Option<ScatteringSpectra> {
        let is_grey = |[r, g, b]: [f32; 3]| r == g && g == b;
        let own = [medium.extinction, medium.albedo, medium.emission];
        if left.is_none() && own.into_iter().all(is_grey) {
            return None;
        }
        let albedo = match is_body {
            true => {
                Albedo::OfBody(Spectrum::of_reflectance(Rgb::from_array(medium.color())), medium.anisotropy)
            }
            false => Albedo::Own(Spectrum::of_reflectance(Rgb::from_array(medium.albedo))),
        };
        let [extinction, _, emission] = own.map(|rgb| Spectrum::of_light(Rgb::from_array(rgb)));
        Some(ScatteringSpectra { extinction, left, albedo, emission })
    }

    /// Extinction coefficient, scattering coefficient and emission at a path's wavelengths.
    pub fn at(&self, waves: &Wavelengths) -> [Rgb; 3] {
        let own = self.extinction.at(waves);
        let lost = self.left.as_ref().map_or(Rgb::ZERO, |(left, way)| {
            left.at(waves).map(|left| -poly::ln(left.clamp(f32::MIN_POSITIVE, 1.0)) / way)
        });
        let albedo = match &self.albedo {
            Albedo::Own(albedo) => albedo.at(waves).map(|share| share.min(1.0)),
            Albedo::OfBody(color, anisotropy) => {
                color.at(waves).map(|share| scene::Medium::albedo_of_color(share, *anisotropy))
            }
        };
        [own + lost, own * albedo, self.emission.at(waves)]
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
            scattered: extinction,
            emission: Rgb::ZERO,
            anisotropy: 0.0,
            density,
            counts: true,
            is_enclosed: false,
            spectra: None,
        }
    }

    #[test]
    fn rays_cross_a_ball_of_fog() {
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
    fn nothing_is_seen_through_fog_without_an_end() {
        let medium = Scattering { density: Density::Homogeneous, ..ball(1.0) };
        let left = medium.transmittance_between((Vec3::ZERO, Vec3::Z), [0.0, f32::INFINITY], (0, None));
        assert_eq!(left, Rgb::new(0.0, 0.0, 1.0));
    }
}
