//! Segments of paths through participating media: sampling of the distance to the next scattering event, and weights.
//!
//! A distance is drawn from a mixture of densities: for each channel an exponential with its extinction, selected in proportion
//! to the throughput; and, where a light guides, with probability 1/2 a density that is uniform over the angle at which the
//! light sees the ray (equiangular sampling: Kulla, Fajardo 2012, "Importance Sampling Techniques for Path Tracing in
//! Participating Media", section 3.1). The weight is the value over the density of the whole mixture (one-sample balance
//! heuristic, Veach 1997): at most one over a channel's share, or two where a light guides. The guiding light is drawn
//! independently and contributes nothing by this.
//!
//! On density grids segments end at collisions (delta tracking), which need no weight where all channels have the same
//! extinction. Else collisions follow the channel of the largest extinction, a random number decides between scattering and a
//! null collision, and weights correct each channel (Kutz, Habel, Li, Novak 2017, "Spectral and Decomposition Tracking for
//! Rendering Heterogeneous Volumes", section 4).

use super::interior::Interior;
use crate::color::Rgb;
use crate::compile::{DensityGrid, GridRay, Scattering};
use crate::math::{Ray, Vec3, poly};
use crate::sampling::hash::hash32;
use crate::simd::map_each;

/// One way of a path from a point to the next in one medium.
#[derive(Clone, Copy, Debug)]
pub(super) struct MediumSegment {
    /// Number of the medium.
    pub medium: u16,
    /// Where the flights through the media that fill the same place lie in the list of them (see [`super::beside`]): from this to
    /// that. This flight ends first then.
    pub beside: [u32; 2],
    /// Where on the ray the medium begins and ends, metres.
    pub extent: [f32; 2],
    /// Shares of the channels in the choice; all 0 where there is none.
    shares: [f32; 3],
    guide: Option<Guide>,
    /// Where it scatters; infinite if nowhere.
    pub until: f32,
    /// It met nothing before.
    pub scatters: bool,
    /// Found by collisions on a grid.
    tracked: Option<DeltaTracking>,
    /// The boundary without a surface where it begins.
    pub crossed: Option<BoundaryCrossing>,
}

/// Where a path crossed a boundary without a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoundaryCrossing {
    /// Where on the ray.
    pub at: f32,
    /// The solids in front of it.
    pub before: Interior,
}

/// What a shadow ray has crossed so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShadowSegment {
    /// The solids around it.
    pub interior: Interior,
    /// Where on it the light that is left was last reckoned.
    pub from: f32,
}

/// What a flight follows on a grid.
#[derive(Clone, Copy, Debug)]
struct DeltaTracking {
    /// The numbers that decide it: the first in 0..1.
    first: f32,
    salt: u32,
    /// What it is taken times where it ends.
    weight: Rgb,
}

/// How often a lamp guides, where one is.
const EQUIANGULAR_PROBABILITY: f32 = 0.5;

/// What channels that are only absorbed count: they too must be met by some.
const MIN_ALBEDO: f32 = 0.1;

impl MediumSegment {
    /// Through a medium without a place where it scatters.
    pub fn straight(medium: u16, extent: [f32; 2]) -> MediumSegment {
        MediumSegment {
            medium,
            beside: [0; 2],
            extent,
            shares: [0.0; 3],
            guide: None,
            until: f32::INFINITY,
            scatters: false,
            tracked: None,
            crossed: None,
        }
    }

    /// Draws a way through a medium from `from` on; the ray's direction has unit length. Of the numbers in 0..1 the first chooses
    /// the distance, the second what it is drawn from.
    #[inline]
    pub fn draw(
        (index, medium): (u16, &Scattering),
        (origin, direction): (Vec3, Vec3),
        from: f32,
        throughput: Rgb,
        lamp: Option<Vec3>,
        u: [f32; 2],
    ) -> MediumSegment {
        let extent = medium.extent(origin, direction, from);
        let mut segment = MediumSegment::straight(index, extent);
        if let Some(grid) = &medium.grid {
            let salt = hash32(u[0].to_bits() ^ hash32(u[1].to_bits()));
            let tracked = DeltaTracking { first: u[0], salt, weight: Rgb::ZERO };
            let (until, weight) = tracked.follow((medium, grid), (origin, direction), [from, f32::INFINITY]);
            (segment.until, segment.tracked) = (until, Some(DeltaTracking { weight, ..tracked }));
            return segment;
        }
        if extent[1] <= extent[0] || medium.scattered.max_element() <= 0.0 {
            return segment;
        }
        segment.shares = shares(medium, throughput);
        segment.guide = lamp.and_then(|lamp| Guide::new(origin, direction, extent, lamp));
        let (guided, mut choice) = match segment.guide {
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
        let until = match segment.guide.filter(|_| guided) {
            Some(guide) => guide.sample(u[0]),
            None => {
                let mut channel = 0;
                while channel < 2 && choice >= segment.shares[channel] {
                    choice -= segment.shares[channel];
                    channel += 1;
                }
                extent[0] - poly::ln(1.0 - u[0]) / medium.extinction.to_array()[channel]
            }
        };
        segment.until = if until < extent[1] { until } else { f32::INFINITY };
        segment
    }

    /// Is it through one medium alone?
    #[inline(always)]
    pub fn is_alone(&self) -> bool {
        self.beside[0] == self.beside[1]
    }

    /// Is what paths are taken times 1 wherever they arrive without having scattered?
    pub fn is_unweighted(&self, medium: &Scattering) -> bool {
        let ends_by_chance = self.tracked.is_some() || self.draws() && self.guide.is_none();
        medium.is_grey() && (ends_by_chance || medium.extinction.r == 0.0)
    }

    /// What the path's throughput is taken times where it arrives at a point of the flight's ray without having scattered.
    #[inline]
    pub fn weight_of_passing(&self, medium: &Scattering, ray: &Ray, to: f32) -> Rgb {
        match (&self.tracked, &medium.grid) {
            (Some(tracked), Some(grid)) => {
                tracked.weight_of_passing((medium, grid), ray, [self.extent[0], to])
            }
            _ => self.ungridded_passing_weight(medium, to),
        }
    }

    /// The same in a medium without a grid.
    #[inline]
    fn ungridded_passing_weight(&self, medium: &Scattering, to: f32) -> Rgb {
        let left = self.left(medium, to);
        if self.draws() { over(left, self.mixed(left, |guide| guide.beyond(to))) } else { left }
    }

    /// What it is taken times where the path scatters.
    #[inline]
    pub fn weight_of_scattering(&self, medium: &Scattering) -> Rgb {
        if let Some(tracked) = &self.tracked {
            return tracked.weight;
        }
        let left = self.left(medium, self.until);
        let density = self.mixed(left * medium.extinction, |guide| guide.density(self.until));
        over(left * medium.scattered, density)
    }

    /// The radiance that the medium's own light adds to a path of a throughput on its way to a point: an estimate by one point
    /// of the way, which a number in 0..1 chooses.
    #[inline]
    pub fn glow(&self, medium: &Scattering, throughput: Rgb, to: f32, u: f32) -> Rgb {
        if !self.draws() {
            let way = self.way_before(to);
            return throughput * medium.emission * medium.mean_transmittance(way) * way;
        }
        self.overlapping_emission(medium, throughput, to, u, |_| Rgb::ONE)
    }

    /// The same of a flight beside others, which take what shines at a point of the ray times something.
    #[inline]
    pub fn overlapping_emission(
        &self,
        medium: &Scattering,
        throughput: Rgb,
        to: f32,
        u: f32,
        others: impl Fn(f32) -> Rgb,
    ) -> Rgb {
        let way = self.way_before(to);
        let shines = throughput * medium.emission;
        if way <= 0.0 || shines.max_element() <= 0.0 {
            return Rgb::ZERO;
        }
        let (x, density) = self.emission_point(medium, shines, way, u);
        let at = self.extent[0] + x;
        over(shines * self.ungridded_passing_weight(medium, at) * others(at), density)
    }

    /// How long the way in the medium is that lies before a point, and before the flight's end.
    #[inline(always)]
    fn way_before(&self, to: f32) -> f32 {
        let [begin, end] = self.extent;
        (to.min(self.until).min(end) - begin).clamp(0.0, Scattering::FARTHEST)
    }

    /// A point of a way of some length and its density per metre, for light that shines everywhere alike in its medium.
    ///
    /// What arrives from there falls off, channel by channel, with the extinction less that of the channel which flies
    /// farthest: so far do flights reach that make up for it. Where nothing ends flights, or a guide does so farther away than
    /// exponentials, it falls off with the extinction itself. Each channel has its share of the points by what shines there.
    #[inline]
    fn emission_point(&self, medium: &Scattering, shines: Rgb, way: f32, u: f32) -> (f32, f32) {
        let (extinction, shines) = (medium.extinction.to_array(), shines.to_array());
        let mut least = f32::INFINITY;
        for (share, &extinction) in self.shares.iter().zip(&extinction) {
            if *share > 0.0 {
                least = least.min(extinction);
            }
        }
        if self.guide.is_some() || !self.draws() {
            least = 0.0;
        }
        let sum = shines[0] + shines[1] + shines[2];
        let (mut channel, mut rest) = (0, u * sum);
        while channel < 2 && rest >= shines[channel] {
            rest -= shines[channel];
            channel += 1;
        }
        let u = (rest / shines[channel].max(f32::MIN_POSITIVE)).clamp(0.0, 1.0f32.next_down());
        let rates = map_each(extinction, |x| (x - least).max(0.0));
        let x = TruncatedExponential::new(rates[channel], way).sample(u);
        let mut density = 0.0;
        for c in 0..3 {
            density += shines[c] / sum * TruncatedExponential::new(rates[c], way).density(x);
        }
        (x, density)
    }

    /// Does the flight choose where it ends? Media that scatter nothing are flown through, and what is beside them.
    #[inline(always)]
    fn draws(&self) -> bool {
        self.shares != [0.0; 3]
    }

    /// What is left of light at a point.
    #[inline(always)]
    fn left(&self, medium: &Scattering, to: f32) -> Rgb {
        let [begin, end] = self.extent;
        let way = to.min(end) - begin;
        if way > 0.0 { medium.transmittance(way) } else { Rgb::ONE }
    }

    /// The mixture of what each channel would have, and the lamp's.
    #[inline(always)]
    fn mixed(&self, of_channels: Rgb, of_guide: impl Fn(&Guide) -> f32) -> f32 {
        let [r, g, b] = of_channels.to_array();
        let sum = self.shares[0] * r + self.shares[1] * g + self.shares[2] * b;
        match &self.guide {
            Some(guide) => EQUIANGULAR_PROBABILITY * of_guide(guide) + (1.0 - EQUIANGULAR_PROBABILITY) * sum,
            None => sum,
        }
    }
}

impl DeltaTracking {
    /// Where light scatters between two points of a ray, infinite if nowhere; and what it is taken times.
    #[inline]
    fn follow(
        &self,
        (medium, grid): (&Scattering, &DensityGrid),
        (origin, direction): (Vec3, Vec3),
        way: [f32; 2],
    ) -> (f32, Rgb) {
        let ray = grid.ray(origin, direction, medium.extinction.max_element());
        if medium.is_grey() {
            let until = grid.collision(&ray, way, self.first, self.salt, |_| true);
            return (until, medium.scattered / medium.extinction.r);
        }
        self.follow_channels(medium, grid, &ray, way)
    }

    /// The same where channels differ.
    #[cold]
    fn follow_channels(
        &self,
        medium: &Scattering,
        grid: &DensityGrid,
        ray: &GridRay,
        way: [f32; 2],
    ) -> (f32, Rgb) {
        let most = medium.extinction.max_element();
        let (scattered, passing) = (medium.scattered / most, Rgb::ONE - medium.extinction / most);
        let sum = |rgb: Rgb| rgb.r + rgb.g + rgb.b;
        let mut weight = Rgb::ONE;
        let until = grid.collision(ray, way, self.first, self.salt, |number| {
            let (ends, goes_on) = (weight * scattered, weight * passing);
            let share = sum(ends) / (sum(ends) + sum(goes_on));
            // Where all is absorbed the share is no number, and nothing goes on.
            let is_end = share.is_nan() || number < share;
            weight = if is_end { ends / share } else { goes_on / (1.0 - share) };
            if share.is_nan() {
                weight = Rgb::ZERO;
            }
            is_end
        });
        (until, weight)
    }

    /// What a path is taken times that arrives at a point before it scatters.
    #[inline]
    fn weight_of_passing(&self, in_medium: (&Scattering, &DensityGrid), ray: &Ray, way: [f32; 2]) -> Rgb {
        if in_medium.0.is_grey() {
            return Rgb::ONE;
        }
        self.follow(in_medium, (ray.origin, ray.direction), way).1
    }
}

/// A value over a density; nothing where the density has vanished.
#[inline(always)]
fn over(value: Rgb, density: f32) -> Rgb {
    if density > f32::MIN_POSITIVE { value / density } else { Rgb::ZERO }
}

/// The channels' shares in the choice of a distance: what the path carries on if it scatters, and a little of what it
/// carries.
#[inline]
fn shares(medium: &Scattering, throughput: Rgb) -> [f32; 3] {
    let (carried, scattered) = (throughput.to_array(), medium.scattered.to_array());
    let extinction = medium.extinction.to_array();
    let mut shares = [0.0; 3];
    for c in 0..3 {
        let albedo = if extinction[c] > 0.0 { scattered[c] / extinction[c] } else { 0.0 };
        shares[c] = carried[c] * (albedo + MIN_ALBEDO);
    }
    let sum = shares[0] + shares[1] + shares[2];
    if sum > f32::MIN_POSITIVE { map_each(shares, |s| s / sum) } else { [1.0 / 3.0; 3] }
}

/// Angles in which a point sees a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guide {
    /// Where on the ray the point is closest.
    closest: f32,
    /// How far it is from there.
    distance: f32,
    /// The angles between the way there and those to the ray's first and last point.
    angles: [f32; 2],
}

impl Guide {
    /// `None` where the numbers give no angle.
    #[inline]
    pub(super) fn new(origin: Vec3, direction: Vec3, extent: [f32; 2], lamp: Vec3) -> Option<Guide> {
        let to_lamp = lamp - origin;
        let closest = to_lamp.dot(direction);
        // A ray through the lamp itself would see nothing but its point.
        let least = 1e-3 * to_lamp.length();
        let distance = (to_lamp - direction * closest).length().max(least);
        let angle = |t: f32| {
            if t.is_finite() { poly::atan2(t - closest, distance) } else { 0.5 * std::f32::consts::PI }
        };
        let angles = map_each(extent, angle);
        let is_usable = distance > 0.0 && distance.is_finite() && angles[1] > angles[0];
        is_usable.then_some(Guide { closest, distance, angles })
    }

    /// A point of the ray.
    #[inline]
    pub(super) fn sample(&self, u: f32) -> f32 {
        let [first, last] = self.angles;
        let (sine, cosine) = poly::sin_cos(first + (last - first) * u);
        if cosine > 0.0 { self.closest + self.distance * sine / cosine } else { f32::INFINITY }
    }

    /// Density of its points, per metre.
    #[inline]
    pub(super) fn density(&self, t: f32) -> f32 {
        let [first, last] = self.angles;
        let along = t - self.closest;
        self.distance / ((last - first) * (self.distance * self.distance + along * along))
    }

    /// The probability of a point behind this one.
    #[inline]
    pub(super) fn beyond(&self, t: f32) -> f32 {
        let [first, last] = self.angles;
        if t == f32::INFINITY {
            return 0.0;
        }
        ((last - poly::atan2(t - self.closest, self.distance)) / (last - first)).clamp(0.0, 1.0)
    }
}

/// An exponential density on a way of finite length.
pub(super) struct TruncatedExponential {
    /// Per metre; 0 where it is even.
    rate: f32,
    length: f32,
    /// What lies on the way of the density without an end.
    whole: f32,
}

impl TruncatedExponential {
    #[inline(always)]
    pub(super) fn new(rate: f32, length: f32) -> TruncatedExponential {
        let depth = rate * length;
        // Hardly a slope, and differences of numbers near 1.
        if depth < 1e-3 {
            return TruncatedExponential { rate: 0.0, length, whole: 1.0 };
        }
        TruncatedExponential { rate, length, whole: 1.0 - falling(depth) }
    }

    #[inline(always)]
    pub(super) fn sample(&self, u: f32) -> f32 {
        let x = if self.rate > 0.0 { -poly::ln(1.0 - u * self.whole) / self.rate } else { u * self.length };
        x.clamp(0.0, self.length)
    }

    #[inline(always)]
    pub(super) fn density(&self, x: f32) -> f32 {
        if self.rate > 0.0 { self.rate * falling(self.rate * x) / self.whole } else { 1.0 / self.length }
    }
}

/// The exponential of minus a depth; the polynomial ends at the least normal number.
#[inline(always)]
fn falling(depth: f32) -> f32 {
    if depth < 87.0 { poly::exp(-depth) } else { 0.0 }
}
