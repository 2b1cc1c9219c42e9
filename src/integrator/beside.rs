//! Several media in one place: those without a surface, and the fog around a scene, add up.
//!
//! A path flies through each of them for itself, by numbers of its own, and scatters where the first of these flights ends: what
//! is thicker ends more of them. The path is taken times the product of what all flights say, of scattering in one medium and
//! of passing the others. That is right on average, since the mean of each factor is what its medium leaves of light whatever the
//! others do, be they coloured or on grids. What shines in one is seen through the others likewise, point by point.

use super::Integrator;
use super::flight::Flight;
use super::interior::Interior;
use super::lanes::get_rgb;
use super::workspace::Workspace;
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::Scattering;
use crate::math::{Ray, Vec3};
use crate::sampling::hash::{hash32, unit};

/// A ray and where on it a flight begins.
pub(super) type Start<'a> = (&'a Ray, f32);

impl Integrator<'_> {
    /// Do other media fill the place of the one that a path is in?
    #[inline(always)]
    pub(super) fn has_beside(&self, interior: Interior) -> bool {
        self.scene.features.overlaps && interior.beside(&self.scene.media).next().is_some()
    }

    /// Draws the flight of a path, by two numbers in 0..1; `list` gets those through the other media in the place.
    #[inline(always)]
    pub(super) fn fly(
        &self,
        (interior, waves): (Interior, Option<&Wavelengths>),
        start: Start<'_>,
        throughput: Rgb,
        lamp: Option<Vec3>,
        u: [f32; 2],
        list: &mut Vec<Flight>,
    ) -> Flight {
        let mut flight = self.fly_in((interior.medium(), waves), start, throughput, lamp, u);
        if self.scene.features.overlaps {
            self.fly_beside(&mut flight, (interior, waves), start, throughput, u, list);
        }
        flight
    }

    #[inline]
    fn fly_in(
        &self,
        (medium, waves): (u16, Option<&Wavelengths>),
        (ray, from): Start<'_>,
        throughput: Rgb,
        lamp: Option<Vec3>,
        u: [f32; 2],
    ) -> Flight {
        match &self.scene.media[usize::from(medium)].scattering {
            Some(s) => {
                let scattering = (medium, &*s.in_lanes(waves));
                Flight::draw(scattering, (ray.origin, ray.direction), from, throughput, lamp, u)
            }
            None => Flight::straight(medium, [from, f32::INFINITY]),
        }
    }

    /// Takes the flight that ends first in place of the one through the first medium: that, or one through those in the same place.
    /// All end there.
    #[cold]
    fn fly_beside(
        &self,
        soonest: &mut Flight,
        (interior, waves): (Interior, Option<&Wavelengths>),
        start: Start<'_>,
        throughput: Rgb,
        u: [f32; 2],
        list: &mut Vec<Flight>,
    ) {
        let first = list.len();
        for medium in interior.beside(&self.scene.media) {
            let other = self.fly_in((medium, waves), start, throughput, None, numbers_of(medium, u));
            let later = if other.until < soonest.until { std::mem::replace(soonest, other) } else { other };
            list.push(later);
        }
        for later in &mut list[first..] {
            later.until = soonest.until;
        }
        soonest.beside = [first as u32, list.len() as u32];
    }

    /// What path `i` is taken times at a point of its ray by the flights beside its own.
    #[inline]
    pub(super) fn passed_beside(&self, i: usize, to: f32, w: &Workspace) -> Rgb {
        if w.flights[i].is_alone() { Rgb::ONE } else { self.passed_by(beside(&w.flights[i], w), i, to, w) }
    }

    /// What path `i` is taken times at a point of its ray by some of its flights.
    #[cold]
    fn passed_by<'a>(
        &self,
        flights: impl Iterator<Item = &'a Flight>,
        i: usize,
        to: f32,
        w: &Workspace,
    ) -> Rgb {
        flights.fold(Rgb::ONE, |weight, flight| weight * self.weight_of_passing(flight, i, to, w))
    }

    /// What a path that flies through several media is taken times at a point of its ray. Adds what they emit on the way.
    #[cold]
    pub(super) fn passed_together(&self, bounce: u32, i: usize, to: f32, w: &mut Workspace) -> Rgb {
        let whole = [w.flights[i]].into_iter().chain(beside(&w.flights[i], w).copied());
        let whole: Vec<Flight> = whole.collect();
        for k in 0..whole.len() {
            if let Some(scattering) = &self.scene.media[usize::from(whole[k].medium)].scattering
                && scattering.emission.max_element() > 0.0
            {
                let value = self.glow_beside(scattering, (&whole, k), (bounce, i), to, w);
                self.add_glow(bounce, i, value, w);
            }
        }
        self.passed_by(whole.iter(), i, to, w)
    }

    /// The light of the medium of one of a path's flights, seen through those of the others.
    fn glow_beside(
        &self,
        scattering: &Scattering,
        (whole, k): (&[Flight], usize),
        (bounce, i): (u32, usize),
        to: f32,
        w: &Workspace,
    ) -> Rgb {
        let waves = w.times.waves(w.arriving.carried.sample[i]);
        let scattering = &*scattering.in_lanes(waves);
        let (flight, salt) = (&whole[k], hash32(self.glow_salt(bounce, i, w) ^ k as u32));
        let others = || whole.iter().enumerate().filter(|&(other, _)| other != k).map(|(_, flight)| flight);
        let is_clear = |other: &Flight| {
            let medium = &self.scene.media[usize::from(other.medium)];
            medium.scattering.as_ref().is_some_and(|s| other.passes_whole(&s.in_lanes(waves)))
        };
        if others().all(is_clear) {
            return self.glow(flight, scattering, i, to, salt, w);
        }
        let factor = |t: f32| self.passed_by(others(), i, t, w);
        let throughput = get_rgb(&w.arriving.carried.throughput, i);
        let ray = (w.rays[i].origin, w.rays[i].direction);
        let way = [flight.extent[0], to.min(flight.until)];
        throughput
            * match (&scattering.glow, &scattering.grid) {
                (Some(glow), Some(_)) => {
                    scattering.emission * glow.integral_times(ray, way, salt, waves, factor)
                }
                (None, Some(grid)) => {
                    let ray = grid.ray(ray.0, ray.1, 1.0);
                    scattering.emission * grid.integral_times(&ray, way, salt, factor)
                }
                (_, None) => return flight.glow_beside(scattering, throughput, to, unit(salt), factor),
            }
    }

    /// What other media in the place leave of light between two points of a ray.
    #[cold]
    pub(super) fn left_beside(
        &self,
        interior: Interior,
        ray: (Vec3, Vec3),
        way: [f32; 2],
        waves: Option<&Wavelengths>,
    ) -> Rgb {
        interior.beside(&self.scene.media).fold(Rgb::ONE, |left, medium| {
            // Those around the scene are on no grid, and need nothing to be kept apart by.
            left * self.left_in(medium, ray, way, waves, u32::from(medium))
        })
    }
}

/// The flights beside one.
fn beside<'a>(flight: &Flight, w: &'a Workspace) -> impl Iterator<Item = &'a Flight> + use<'a> {
    w.flights_beside[flight.beside[0] as usize..flight.beside[1] as usize].iter()
}

/// The numbers that decide a flight through a medium beside another.
fn numbers_of(medium: u16, [distance, kind]: [f32; 2]) -> [f32; 2] {
    let salt = hash32(u32::from(medium) ^ hash32(distance.to_bits() ^ hash32(kind.to_bits())));
    [unit(salt), unit(hash32(salt))]
}
