//! Segments of paths through participating media: sampling of the distance to the next scattering event, and weights.
//!
//! Distances are sampled from a mixture: for each channel an exponential with its extinction, selected in proportion to throughput;
//! and, with a light selected for it, with probability 1/2 equiangular sampling towards a point of that light (Kulla, Fajardo 2012,
//! "Importance Sampling Techniques for Path Tracing in Participating Media", section 3.1). The weight is the value over the pdf of the
//! whole mixture (one-sample balance heuristic, Veach 1997): at most the reciprocal of the channel's selection probability, twice that
//! with equiangular sampling. The light for equiangular sampling is selected independently of light samples. Steps of random walks are
//! sampled together with their directions, from a mixture with guiding to the surface ([`WalkGuide`]).
//!
//! On density grids, delta tracking samples collisions, with weight 1 if all channels have the same extinction. Else the majorant is
//! that of the channel of largest extinction, a random number selects between scattering and a null collision, and weights correct each
//! channel (Kutz, Habel, Li, Novak 2017, "Spectral and Decomposition Tracking for Rendering Heterogeneous Volumes", section 4).

use super::interior::Interior;
use super::walk_guide::WalkGuide;
use crate::bsdf::phase::{direction_around, henyey_greenstein, sample_henyey_greenstein};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::{GridMedium, GridRay, Scattering};
use crate::math::{Ray, Vec3, poly};
use crate::sampling::hash::{hash32, unit};
use crate::simd::map_each;

/// A segment of a path's ray in one medium.
#[derive(Clone, Copy, Debug)]
pub(super) struct MediumSegment {
    /// Index of the medium.
    pub medium: u16,
    /// Range of the segments in overlapping media (see [`super::volumes`]); this segment is then the one that ends first.
    pub overlapping: [u32; 2],
    /// Start and end of the medium along the ray, metres.
    pub extent: [f32; 2],
    /// Mixture weights of the channels' exponentials; all 0 if no distance is sampled.
    probabilities: [f32; 3],
    equiangular: Option<EquiangularSampling>,
    /// Guided part of the mixture, for steps of random walks.
    guided: Option<GuidedPart>,
    /// Distance of the scattering event along the ray, metres; infinite without one.
    pub scatter_t: f32,
    /// Does the path scatter there, before any hit?
    pub scatters: bool,
    /// On density grids.
    tracked: Option<DeltaTracking>,
    /// Boundary without a surface at the start of the segment.
    pub crossed: Option<BoundaryCrossing>,
}

/// A crossing of a boundary without a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoundaryCrossing {
    /// Distance along the ray, metres.
    pub at: f32,
    /// The solids before the boundary.
    pub before: Interior,
}

/// The current segment of a shadow ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShadowSegment {
    /// The solids around the segment.
    pub interior: Interior,
    /// Ray parameter up to which transmittance has been applied.
    pub from: f32,
}

/// State of delta tracking on a grid.
#[derive(Clone, Copy, Debug)]
struct DeltaTracking {
    /// First random number, 0..1.
    first: f32,
    /// Seed of the other random numbers.
    salt: u32,
    /// Weight at the scattering event.
    weight: Rgb,
}

/// A medium, its grids, and the wavelengths of a path.
type InGrid<'a> = (&'a Scattering, &'a GridMedium, Option<&'a Wavelengths>);

/// Probability of equiangular sampling, where available.
const EQUIANGULAR_PROBABILITY: f32 = 0.5;

/// Added to the albedo for channel selection: the transmittance of absorbing channels needs samples, too.
const MIN_ALBEDO: f32 = 0.1;

impl MediumSegment {
    /// A segment without a scattering event.
    pub fn unscattered(medium: u16, extent: [f32; 2]) -> MediumSegment {
        MediumSegment {
            medium,
            overlapping: [0; 2],
            extent,
            probabilities: [0.0; 3],
            equiangular: None,
            guided: None,
            scatter_t: f32::INFINITY,
            scatters: false,
            tracked: None,
            crossed: None,
        }
    }

    /// Samples a segment in a medium from distance `from` on; the ray's direction has unit length. `u[0]` selects the distance, `u[1]`
    /// the strategy of the mixture.
    #[inline]
    pub fn sample(
        (index, medium, waves): (u16, &Scattering, Option<&Wavelengths>),
        (origin, direction): (Vec3, Vec3),
        from: f32,
        throughput: Rgb,
        light_position: Option<Vec3>,
        u: [f32; 2],
    ) -> MediumSegment {
        let extent = medium.extent(origin, direction, from);
        let mut segment = MediumSegment::unscattered(index, extent);
        if let Some(grid) = medium.grid() {
            let salt = hash32(u[0].to_bits() ^ hash32(u[1].to_bits()));
            let tracked = DeltaTracking { first: u[0], salt, weight: Rgb::ZERO };
            let (scatter_t, weight) =
                tracked.follow((medium, grid, waves), (origin, direction), [from, f32::INFINITY]);
            (segment.scatter_t, segment.tracked) = (scatter_t, Some(DeltaTracking { weight, ..tracked }));
            return segment;
        }
        if extent[1] <= extent[0] || medium.scattering_coefficient.max_element() <= 0.0 {
            return segment;
        }
        segment.probabilities = selection_probabilities(medium, throughput);
        segment.equiangular = light_position
            .and_then(|light_position| EquiangularSampling::new(origin, direction, extent, light_position));
        let (is_equiangular, mut choice) = match segment.equiangular {
            Some(_) => (
                u[1] < EQUIANGULAR_PROBABILITY,
                if u[1] < EQUIANGULAR_PROBABILITY {
                    0.0
                } else {
                    (u[1] - EQUIANGULAR_PROBABILITY) / (1.0 - EQUIANGULAR_PROBABILITY)
                },
            ),
            None => (false, u[1]),
        };
        let scatter_t = match segment.equiangular.filter(|_| is_equiangular) {
            Some(equiangular) => equiangular.sample(u[0]),
            None => {
                let mut channel = 0;
                while channel < 2 && choice >= segment.probabilities[channel] {
                    choice -= segment.probabilities[channel];
                    channel += 1;
                }
                extent[0] - poly::ln(1.0 - u[0]) / medium.extinction.to_array()[channel]
            }
        };
        segment.scatter_t = if scatter_t < extent[1] { scatter_t } else { f32::INFINITY };
        segment
    }

    /// Is there no overlapping medium?
    #[inline(always)]
    pub fn is_alone(&self) -> bool {
        self.overlapping[0] == self.overlapping[1]
    }

    /// Was the segment made without random numbers?
    pub fn is_deterministic(&self) -> bool {
        !self.samples_distance() && self.tracked.is_none() && self.is_alone()
    }

    /// Is [`Self::weight_of_passing`] always 1?
    pub fn is_unweighted(&self, medium: &Scattering) -> bool {
        let is_guided = self.equiangular.is_some() || self.guided.is_some();
        let samples_transmittance = self.tracked.is_some() || self.samples_distance() && !is_guided;
        medium.is_grey() && (samples_transmittance || medium.extinction.r == 0.0)
    }

    /// Weight of a path that arrives at distance `to` without scattering.
    #[inline]
    pub fn weight_of_passing(
        &self,
        (medium, waves): (&Scattering, Option<&Wavelengths>),
        ray: &Ray,
        to: f32,
    ) -> Rgb {
        match (&self.tracked, medium.grid()) {
            (Some(tracked), Some(grid)) => {
                tracked.weight_of_passing((medium, grid, waves), ray, [self.extent[0], to])
            }
            _ => self.ungridded_passing_weight(medium, to),
        }
    }

    /// [`Self::weight_of_passing`] for media without a grid.
    #[inline]
    fn ungridded_passing_weight(&self, medium: &Scattering, to: f32) -> Rgb {
        let transmittance = self.transmittance(medium, to);
        if let Some(guided) = &self.guided {
            return over(transmittance, self.of_channels(transmittance) + guided.probability_beyond(to));
        }
        match self.samples_distance() {
            true => over(
                transmittance,
                self.mixed(transmittance, |equiangular| equiangular.probability_beyond(to)),
            ),
            false => transmittance,
        }
    }

    /// Weight of a path at its scattering event.
    #[inline]
    pub fn weight_of_scattering(&self, medium: &Scattering) -> Rgb {
        if let Some(tracked) = &self.tracked {
            return tracked.weight;
        }
        let transmittance = self.transmittance(medium, self.scatter_t);
        if let Some(guided) = &self.guided {
            let pdf = self.of_channels(transmittance * medium.extinction) + guided.density(self.scatter_t);
            return over(transmittance * medium.scattering_coefficient, pdf);
        }
        let equiangular = |equiangular: &EquiangularSampling| equiangular.density(self.scatter_t);
        let pdf = self.mixed(transmittance * medium.extinction, equiangular);
        over(transmittance * medium.scattering_coefficient, pdf)
    }

    /// Estimate of the radiance that the medium's emission adds to a path up to distance `to`; random numbers are hashed from `salt`.
    /// `others` is the transmittance of overlapping media at a distance.
    pub fn emission(
        &self,
        (medium, waves): (&Scattering, Option<&Wavelengths>),
        ray: &Ray,
        throughput: Rgb,
        (to, salt): (f32, u32),
        others: Option<&dyn Fn(f32) -> Rgb>,
    ) -> Rgb {
        let Some(grid) = medium.grid() else {
            return match others {
                Some(others) => self.attenuated_emission(medium, throughput, to, unit(salt), others),
                None => self.own_emission(medium, throughput, to, unit(hash32(salt ^ to.to_bits()))),
            };
        };
        let (line, span) = ((ray.origin, ray.direction), [self.extent[0], to.min(self.scatter_t)]);
        let own = |t: f32| self.weight_of_passing((medium, waves), ray, t);
        match (others, medium.is_grey()) {
            // Delta tracking samples transmittance: emission before the collision is not attenuated.
            (None, true) => throughput * medium.emission * grid.emission.integral(line, span, salt, waves),
            (None, false) => {
                throughput * medium.emission * grid.emission.integral_times(line, span, salt, waves, own)
            }
            (Some(others), true) => {
                throughput * (medium.emission * grid.emission.integral_times(line, span, salt, waves, others))
            }
            (Some(others), false) => {
                let both = |t: f32| own(t) * others(t);
                throughput * (medium.emission * grid.emission.integral_times(line, span, salt, waves, both))
            }
        }
    }

    /// Emission of a medium without a grid, estimated at a point of the segment sampled by `u`.
    #[inline]
    fn own_emission(&self, medium: &Scattering, throughput: Rgb, to: f32, u: f32) -> Rgb {
        if !self.samples_distance() {
            let span = self.span_before(to);
            return throughput * medium.emission * medium.mean_transmittance(span) * span;
        }
        self.attenuated_emission(medium, throughput, to, u, |_| Rgb::ONE)
    }

    /// Emission of a medium without a grid, with the transmittance `others` of overlapping media at a distance.
    #[inline]
    fn attenuated_emission(
        &self,
        medium: &Scattering,
        throughput: Rgb,
        to: f32,
        u: f32,
        others: impl Fn(f32) -> Rgb,
    ) -> Rgb {
        let span = self.span_before(to);
        let emission = throughput * medium.emission;
        if span <= 0.0 || emission.max_element() <= 0.0 {
            return Rgb::ZERO;
        }
        let (x, density) = self.emission_point(medium, emission, span, u);
        let at = self.extent[0] + x;
        over(emission * self.ungridded_passing_weight(medium, at) * others(at), density)
    }

    /// Length of the segment within the medium up to distance `to`, metres.
    #[inline(always)]
    fn span_before(&self, to: f32) -> f32 {
        let [begin, end] = self.extent;
        (to.min(self.scatter_t).min(end) - begin).clamp(0.0, Scattering::MAX_DISTANCE)
    }

    /// Samples a point of a segment with constant emission; returns distance, metres, and pdf, 1/m.
    ///
    /// With distance sampling, [`Self::weight_of_passing`] decays, per channel, with the extinction minus the smallest extinction of the
    /// mixture; without, or with equiangular sampling (whose pdf decays more slowly than exponentials), with the extinction itself.
    /// Channels are selected in proportion to emission.
    #[inline]
    fn emission_point(&self, medium: &Scattering, emission: Rgb, span: f32, u: f32) -> (f32, f32) {
        let (extinction, emission) = (medium.extinction.to_array(), emission.to_array());
        let mut least = f32::INFINITY;
        for (probability, &extinction) in self.probabilities.iter().zip(&extinction) {
            if *probability > 0.0 {
                least = least.min(extinction);
            }
        }
        if self.equiangular.is_some() || !self.samples_distance() {
            least = 0.0;
        }
        let sum = emission[0] + emission[1] + emission[2];
        let (mut channel, mut rest) = (0, u * sum);
        while channel < 2 && rest >= emission[channel] {
            rest -= emission[channel];
            channel += 1;
        }
        let u = (rest / emission[channel].max(f32::MIN_POSITIVE)).clamp(0.0, 1.0f32.next_down());
        let rates = map_each(extinction, |x| (x - least).max(0.0));
        let x = TruncatedExponential::new(rates[channel], span).sample(u);
        let mut density = 0.0;
        for c in 0..3 {
            density += emission[c] / sum * TruncatedExponential::new(rates[c], span).density(x);
        }
        (x, density)
    }

    /// Is a distance sampled? Not in media that only absorb.
    #[inline(always)]
    fn samples_distance(&self) -> bool {
        self.probabilities != [0.0; 3]
    }

    /// Transmittance up to distance `to`.
    #[inline(always)]
    fn transmittance(&self, medium: &Scattering, to: f32) -> Rgb {
        let [begin, end] = self.extent;
        let span = to.min(end) - begin;
        if span > 0.0 { medium.transmittance(span) } else { Rgb::ONE }
    }

    /// Mixture of per-channel pdfs.
    #[inline(always)]
    fn of_channels(&self, densities: Rgb) -> f32 {
        let [r, g, b] = densities.to_array();
        self.probabilities[0] * r + self.probabilities[1] * g + self.probabilities[2] * b
    }

    /// Mixture of per-channel pdfs and the equiangular pdf.
    #[inline(always)]
    fn mixed(&self, of_channels: Rgb, of_guide: impl Fn(&EquiangularSampling) -> f32) -> f32 {
        let sum = self.of_channels(of_channels);
        match &self.equiangular {
            Some(equiangular) => {
                EQUIANGULAR_PROBABILITY * of_guide(equiangular) + (1.0 - EQUIANGULAR_PROBABILITY) * sum
            }
            None => sum,
        }
    }
}

/// The guided part of a random walk step's mixture over direction and distance, relative to the pdf of the phase function.
#[derive(Clone, Copy, Debug)]
struct GuidedPart {
    /// Mixture weights by channel, times the ratio of the directional pdfs.
    weights: [f32; 3],
    /// Exponential rates of the distances, 1/m.
    rates: [f32; 3],
}

impl GuidedPart {
    /// Pdf of a distance, 1/m.
    #[inline(always)]
    fn density(&self, t: f32) -> f32 {
        (0..3).map(|c| self.weights[c] * self.rates[c] * exp_neg(self.rates[c] * t)).sum()
    }

    /// The probability of larger distances.
    #[inline(always)]
    fn probability_beyond(&self, t: f32) -> f32 {
        (0..3).map(|c| self.weights[c] * exp_neg(self.rates[c] * t)).sum()
    }
}

impl MediumSegment {
    /// Samples the direction and the distance of a step of a random walk in a homogeneous medium. `axis` points to the surface. Random
    /// numbers: strategy, channel and distance; two for the direction.
    #[inline]
    pub fn sample_step(
        (index, medium): (u16, &Scattering),
        (wo, axis): (Vec3, Vec3),
        guide: &WalkGuide,
        throughput: Rgb,
        ([strategy, choice, distance], direction): ([f32; 3], [f32; 2]),
    ) -> (Vec3, MediumSegment) {
        let mut segment = MediumSegment::unscattered(index, [0.0, f32::INFINITY]);
        let probabilities = selection_probabilities(medium, throughput);
        let channel = usize::from(choice >= probabilities[0])
            + usize::from(choice >= probabilities[0] + probabilities[1]);
        let is_guided = strategy < guide.probability;
        let wi = if is_guided {
            direction_around(axis, guide.sample(channel, direction[0]), direction[1])
        } else {
            sample_henyey_greenstein(medium.anisotropy, wo, direction)
        };
        let extinction = medium.extinction.to_array();
        if guide.probability > 0.0 {
            let cosine = wi.dot(axis).clamp(-1.0, 1.0);
            let phase = henyey_greenstein(medium.anisotropy, -wo.dot(wi));
            let of = |c: usize| guide.probability * probabilities[c] * guide.density(c, cosine) / phase;
            segment.guided = Some(GuidedPart {
                weights: [of(0), of(1), of(2)],
                rates: [0, 1, 2].map(|c| extinction[c] * (1.0 - cosine / guide.lengths[c])),
            });
            segment.probabilities = map_each(probabilities, |s| s * (1.0 - guide.probability));
        } else {
            segment.probabilities = probabilities;
        }
        let rate = match &segment.guided {
            Some(guided) if is_guided => guided.rates[channel],
            _ => extinction[channel],
        };
        let scatter_t = -poly::ln(1.0 - distance) / rate;
        segment.scatter_t = if scatter_t < f32::INFINITY { scatter_t } else { f32::INFINITY };
        (wi, segment)
    }
}

impl DeltaTracking {
    /// Samples the scattering event between two distances along a ray: distance (infinite without one) and weight.
    #[inline]
    fn follow(
        &self,
        (medium, grid, waves): InGrid<'_>,
        (origin, direction): (Vec3, Vec3),
        span: [f32; 2],
    ) -> (f32, Rgb) {
        let ray = grid.density.ray(origin, direction, medium.extinction.max_element());
        if medium.is_grey() {
            let scatter_t = grid.density.collision(&ray, span, self.first, self.salt, |_, _| true);
            let is_end = scatter_t < f32::INFINITY;
            let scattered =
                if is_end { grid.relative_scattering(ray.at(scatter_t), waves) } else { Rgb::ONE };
            return (scatter_t, medium.scattering_coefficient / medium.extinction.r * scattered);
        }
        self.follow_channels((medium, grid, waves), &ray, span)
    }

    /// [`Self::follow`] where the extinction differs between channels.
    #[cold]
    fn follow_channels(
        &self,
        (medium, grid, waves): InGrid<'_>,
        ray: &GridRay,
        span: [f32; 2],
    ) -> (f32, Rgb) {
        let most = medium.extinction.max_element();
        let (scattered, extinction) = (medium.scattering_coefficient / most, medium.extinction / most);
        let sum = |rgb: Rgb| rgb.r + rgb.g + rgb.b;
        let mut weight = Rgb::ONE;
        let scatter_t = grid.density.collision(ray, span, self.first, self.salt, |t, number| {
            let p = ray.at(t);
            let ends = weight * scattered * grid.relative_scattering(p, waves);
            let continues = weight * (Rgb::ONE - extinction * grid.relative_extinction(p, waves));
            let all = sum(ends) + sum(continues);
            if all == 0.0 {
                // Everything is absorbed.
                weight = Rgb::ZERO;
                return true;
            }
            let end_probability = sum(ends) / all;
            let is_end = number < end_probability;
            weight = if is_end { ends / end_probability } else { continues / (1.0 - end_probability) };
            is_end
        });
        (scatter_t, weight)
    }

    /// Weight of a path that arrives at a distance without scattering.
    #[inline]
    fn weight_of_passing(&self, in_medium: InGrid<'_>, ray: &Ray, span: [f32; 2]) -> Rgb {
        if in_medium.0.is_grey() {
            return Rgb::ONE;
        }
        self.follow(in_medium, (ray.origin, ray.direction), span).1
    }
}

/// A value over a pdf; 0 if the pdf underflows.
#[inline(always)]
fn over(value: Rgb, density: f32) -> Rgb {
    if density > f32::MIN_POSITIVE { value / density } else { Rgb::ZERO }
}

/// Selection probabilities of channels, in proportion to throughput times (albedo + [`MIN_ALBEDO`]).
#[inline]
fn selection_probabilities(medium: &Scattering, throughput: Rgb) -> [f32; 3] {
    let (throughput, scattered) = (throughput.to_array(), medium.scattering_coefficient.to_array());
    let extinction = medium.extinction.to_array();
    let mut probabilities = [0.0; 3];
    for c in 0..3 {
        let albedo = if extinction[c] > 0.0 { scattered[c] / extinction[c] } else { 0.0 };
        probabilities[c] = throughput[c] * (albedo + MIN_ALBEDO);
    }
    let sum = probabilities[0] + probabilities[1] + probabilities[2];
    if sum > f32::MIN_POSITIVE { map_each(probabilities, |s| s / sum) } else { [1.0 / 3.0; 3] }
}

/// Equiangular sampling: distances along a ray with a pdf uniform in the angle at the light (Kulla, Fajardo 2012).
#[derive(Clone, Copy, Debug)]
pub(super) struct EquiangularSampling {
    /// Ray distance of the point closest to the light, metres.
    closest: f32,
    /// Distance of the light from that point, metres.
    distance: f32,
    /// Angles at the light from the closest point to the start and the end of the segment, radians.
    angles: [f32; 2],
}

impl EquiangularSampling {
    /// `None` if the angle is empty.
    #[inline]
    pub(super) fn new(
        origin: Vec3,
        direction: Vec3,
        extent: [f32; 2],
        light_position: Vec3,
    ) -> Option<EquiangularSampling> {
        let to_light = light_position - origin;
        let closest = to_light.dot(direction);
        // For rays through the light.
        let least = 1e-3 * to_light.length();
        let distance = (to_light - direction * closest).length().max(least);
        let angle = |t: f32| {
            if t.is_finite() { poly::atan2(t - closest, distance) } else { 0.5 * std::f32::consts::PI }
        };
        let angles = map_each(extent, angle);
        let is_usable = distance > 0.0 && distance.is_finite() && angles[1] > angles[0];
        is_usable.then_some(EquiangularSampling { closest, distance, angles })
    }

    /// Samples a distance, metres.
    #[inline]
    pub(super) fn sample(&self, u: f32) -> f32 {
        let [first, last] = self.angles;
        let (sine, cosine) = poly::sin_cos(first + (last - first) * u);
        if cosine > 0.0 { self.closest + self.distance * sine / cosine } else { f32::INFINITY }
    }

    /// Pdf of a distance, 1/m.
    #[inline]
    pub(super) fn density(&self, t: f32) -> f32 {
        let [first, last] = self.angles;
        let along = t - self.closest;
        self.distance / ((last - first) * (self.distance * self.distance + along * along))
    }

    /// The probability of larger distances.
    #[inline]
    pub(super) fn probability_beyond(&self, t: f32) -> f32 {
        let [first, last] = self.angles;
        if t == f32::INFINITY {
            return 0.0;
        }
        ((last - poly::atan2(t - self.closest, self.distance)) / (last - first)).clamp(0.0, 1.0)
    }
}

/// An exponential distribution truncated to 0..`length`.
pub(super) struct TruncatedExponential {
    /// Rate, 1/m; 0 for a uniform distribution.
    rate: f32,
    /// Metres.
    length: f32,
    /// Integral of the untruncated pdf up to `length`.
    whole: f32,
}

impl TruncatedExponential {
    #[inline(always)]
    pub(super) fn new(rate: f32, length: f32) -> TruncatedExponential {
        let depth = rate * length;
        // Avoids cancellation for nearly uniform distributions.
        if depth < 1e-3 {
            return TruncatedExponential { rate: 0.0, length, whole: 1.0 };
        }
        TruncatedExponential { rate, length, whole: 1.0 - exp_neg(depth) }
    }

    #[inline(always)]
    pub(super) fn sample(&self, u: f32) -> f32 {
        let x = if self.rate > 0.0 { -poly::ln(1.0 - u * self.whole) / self.rate } else { u * self.length };
        x.clamp(0.0, self.length)
    }

    #[inline(always)]
    pub(super) fn density(&self, x: f32) -> f32 {
        if self.rate > 0.0 { self.rate * exp_neg(self.rate * x) / self.whole } else { 1.0 / self.length }
    }
}

/// exp(-depth) of an optical depth; 0 below the smallest normal number, where the polynomial ends.
#[inline(always)]
fn exp_neg(depth: f32) -> f32 {
    if depth < 87.0 { poly::exp(-depth) } else { 0.0 }
}
