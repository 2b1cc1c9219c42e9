//! Lights with a position as seen from rays through media: their centres and the cones that bound their light.

use super::LightBounds;
use crate::math::Vec3;
use crate::sampling::AliasTable;
use std::f32::consts::PI;

/// The centre of a light, and a cone that contains all points to which it shines.
#[derive(Clone, Copy, Debug)]
pub struct LightBeam {
    /// Centre of the light, metres.
    pub center: Vec3,
    /// Apex of the cone, behind the centre of lights that are not points.
    apex: Vec3,
    /// Unit direction.
    axis: Vec3,
    /// Cosine of the half angle; -1 if the light shines in all directions.
    cos_half_angle: f32,
}

/// Half angle, radians, above which a cone counts as all directions.
const MAX_HALF_ANGLE: f32 = 0.48 * PI;

impl LightBeam {
    /// The beam of a light with these bounds.
    pub fn new(bounds: &LightBounds) -> LightBeam {
        let (center, half_angle) = (bounds.bounds.center(), bounds.normals_rad + bounds.emission_rad);
        if half_angle >= MAX_HALF_ANGLE {
            return LightBeam { center, apex: center, axis: bounds.axis, cos_half_angle: -1.0 };
        }
        let radius = 0.5 * bounds.bounds.extent().length();
        let (sine, cosine) = crate::math::poly::sin_cos(half_angle);
        let apex = center - bounds.axis * (radius / sine.max(1e-6));
        LightBeam { center, apex, axis: bounds.axis, cos_half_angle: cosine }
    }

    /// The part of a ray within the cone, as an interval of distances; `None` if the ray misses it. The direction has unit length.
    pub fn interval(&self, origin: Vec3, direction: Vec3) -> Option<[f32; 2]> {
        const ALL: [f32; 2] = [f32::NEG_INFINITY, f32::INFINITY];
        if self.cos_half_angle < 0.0 {
            return Some(ALL);
        }
        // The points where (v . axis)^2 = cos^2 v . v, with v from the apex, relative to the point nearest to the apex.
        let nearest = (self.apex - origin).dot(direction);
        let v = origin + direction * nearest - self.apex;
        let squared = self.cos_half_angle * self.cos_half_angle;
        let (along, start) = (direction.dot(self.axis), v.dot(self.axis));
        let (a, b, c) =
            (along * along - squared, start * along, start * start - squared * v.length_squared());
        let discriminant = b * b - a * c;
        if discriminant < 0.0 || a == 0.0 {
            return (a >= 0.0 && along > 0.0).then_some(ALL);
        }
        // Without cancellation.
        let q = -(b + discriminant.sqrt().copysign(b));
        let roots = [q / a, if q != 0.0 { c / q } else { 0.0 }];
        let [first, last] = [roots[0].min(roots[1]), roots[0].max(roots[1])];
        let is_ahead = |t: f32| start + along * t > 0.0;
        let within = match a < 0.0 {
            true if is_ahead(0.5 * (first + last)) => [first, last],
            true => return None,
            // The other half of the line is in the cone behind the apex.
            false if along > 0.0 => [last, f32::INFINITY],
            false => [f32::NEG_INFINITY, first],
        };
        Some(within.map(|t| t + nearest))
    }
}

/// The beams of a scene's lights.
#[derive(Clone, Debug)]
pub struct LightBeams {
    /// By index of the light; `None` for dark lights.
    beams: Vec<Option<LightBeam>>,
    /// Lights in proportion to their intensity.
    table: AliasTable,
}

impl LightBeams {
    /// The beams of lights with these bounds; `None` if all are dark.
    pub fn new(bounds: &[LightBounds]) -> Option<LightBeams> {
        let weights: Vec<f32> = bounds.iter().map(|light| light.weight).collect();
        let beam = |light: &LightBounds| (light.weight > 0.0).then(|| LightBeam::new(light));
        let beams: Vec<Option<LightBeam>> = bounds.iter().map(beam).collect();
        let has_any = beams.iter().any(Option::is_some);
        has_any.then(|| LightBeams { beams, table: AliasTable::new(&weights) })
    }

    /// The beam of a light; `None` for lights at infinity.
    pub fn of_light(&self, light: u32) -> Option<LightBeam> {
        self.beams.get(light as usize).copied().flatten()
    }

    /// Selects a light in proportion to its intensity by a random number in 0..1.
    pub fn select(&self, u: f32) -> Option<LightBeam> {
        self.of_light(self.table.sample(u).index as u32)
    }

    /// Memory, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.beams[..]) + self.table.len() * size_of::<[f32; 3]>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Bounds3;
    use crate::sampling::chi2::Random;

    /// Points of a ray are within the interval if and only if they are in the cone.
    #[test]
    fn intervals_are_the_points_in_the_cone() {
        let mut random = Random::new(5);
        let (mut inside, mut missed) = (0, 0);
        for _ in 0..20_000 {
            let position = 4.0 * random.direction();
            let (axis, half_angle) = (random.direction(), 0.05 + 1.3 * random.next());
            let bounds = Bounds3::of([position]);
            let beam = LightBeam::new(&LightBounds {
                bounds,
                weight: 1.0,
                axis,
                normals_rad: 0.0,
                emission_rad: half_angle,
            });
            let (origin, direction) = (6.0 * random.direction(), random.direction());
            let interval = beam.interval(origin, direction);
            missed += usize::from(interval.is_none());
            for _ in 0..20 {
                let t = 40.0 * random.next() - 20.0;
                let v = origin + direction * t - position;
                let excess = v.dot(axis) - half_angle.cos() * v.length();
                if excess.abs() < 1e-3 * v.length() {
                    continue;
                }
                let is_within = interval.is_some_and(|[first, last]| first < t && t < last);
                assert_eq!(is_within, excess > 0.0, "{origin} {direction} {t}: {interval:?}");
                inside += usize::from(is_within);
            }
        }
        assert!(inside > 10_000 && missed > 1_000, "{inside} {missed}");
    }
}
