//! Where light is to go that has to meet certain things first: balls around them.

use crate::math::{Frame, Vec3};
use crate::sampling::warp;
use std::f32::consts::PI;

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Its middle.
    pub center: Vec3,
    /// Its radius.
    pub radius: f32,
}

/// Balls that light is sent to.
#[derive(Clone, Debug, Default)]
pub struct Targets {
    balls: Vec<Ball>,
}

/// What a point sees of a ball: a cone of directions.
struct Cone {
    axis: Vec3,
    /// 1 - cosine of the half angle; 2 for all directions.
    one_minus_cos: f32,
}

/// A chosen direction, or place of a ray.
#[derive(Clone, Copy, Debug)]
pub struct Chosen {
    /// The direction, or a point of the ray.
    pub at: Vec3,
    /// Its density: per solid angle, or per area across the ray.
    pub pdf: f32,
}

impl Ball {
    /// What points around `p`, as far away as `around`, see of it together.
    fn cone_from(&self, p: Vec3, around: f32) -> Cone {
        let (way, radius) = (self.center - p, self.radius + around);
        let (squared, r2) = (way.length_squared(), radius * radius);
        if squared <= r2 {
            return Cone { axis: Vec3::Z, one_minus_cos: 2.0 };
        }
        let sin2 = r2 / squared;
        Cone { axis: way / squared.sqrt(), one_minus_cos: warp::one_minus_cos(sin2, 1.0 - sin2) }
    }
}

impl Cone {
    fn contains(&self, direction: Vec3) -> bool {
        // A chord's squared length is twice that; a little wider, for rounding.
        self.one_minus_cos >= 2.0
            || (direction - self.axis).length_squared() <= 2.0 * self.one_minus_cos * (1.0 + 1e-5)
    }

    fn sample(&self, u: [f32; 2]) -> Vec3 {
        if self.one_minus_cos >= 2.0 {
            return warp::uniform_sphere(u);
        }
        // Nearly in the middle of its edge, so that rounding can't lead outside.
        Frame::from_normal(self.axis).to_world(warp::uniform_cone(u, self.one_minus_cos))
    }
}

impl Targets {
    /// Those with a radius above 0.
    pub fn new(balls: impl IntoIterator<Item = Ball>) -> Targets {
        let is_usable = |ball: &Ball| ball.radius > 0.0 && ball.radius.is_finite() && ball.center.is_finite();
        Targets { balls: balls.into_iter().filter(is_usable).collect() }
    }

    /// Is there none?
    pub fn is_empty(&self) -> bool {
        self.balls.is_empty()
    }

    /// The balls.
    pub fn balls(&self) -> &[Ball] {
        &self.balls
    }

    /// Is the largest ball more than so many of its radii away from a point?
    pub fn is_farther(&self, p: Vec3, radii: f32) -> bool {
        let largest = self.balls.iter().max_by(|a, b| a.radius.total_cmp(&b.radius));
        largest.is_some_and(|ball| (ball.center - p).length() > radii * ball.radius)
    }

    /// Solid angle of all balls from a point, each for itself.
    pub fn solid_angle(&self, p: Vec3) -> f32 {
        self.solid_angle_around(p, 0.0)
    }

    fn solid_angle_around(&self, p: Vec3, around: f32) -> f32 {
        self.balls.iter().map(|ball| 2.0 * PI * ball.cone_from(p, around).one_minus_cos).sum()
    }

    /// A direction from a point, or from any point as near to it as `around`, to one of the balls: each by its solid angle, and there
    /// evenly, so that the density counts the balls in a direction. `u[2]` chooses the ball.
    pub fn direction(&self, p: Vec3, around: f32, u: [f32; 3]) -> Option<Chosen> {
        let total = self.solid_angle_around(p, around);
        let mut rest = u[2] * total;
        let mut chosen = None;
        for ball in &self.balls {
            let cone = ball.cone_from(p, around);
            rest -= 2.0 * PI * cone.one_minus_cos;
            chosen = Some(cone);
            if rest < 0.0 {
                break;
            }
        }
        let at = chosen?.sample([u[0], u[1]]);
        let count = self.balls.iter().filter(|ball| ball.cone_from(p, around).contains(at)).count();
        Some(Chosen { at, pdf: count.max(1) as f32 / total })
    }

    /// A point of a ray of this direction that meets one of the balls: each by its area across, and there evenly.
    pub fn place(&self, direction: Vec3, u: [f32; 3]) -> Option<Chosen> {
        let total: f32 = self.balls.iter().map(|ball| ball.radius * ball.radius).sum();
        let mut rest = u[2] * total;
        let mut chosen = None;
        for ball in &self.balls {
            rest -= ball.radius * ball.radius;
            chosen = Some(ball);
            if rest < 0.0 {
                break;
            }
        }
        let ball = chosen?;
        let disk = warp::uniform_disk([u[0], u[1]]) * ball.radius;
        let at = ball.center + Frame::from_normal(direction).to_world(Vec3::new(disk.x, disk.y, 0.0));
        let beside = |ball: &Ball| {
            let way = at - ball.center;
            way.length_squared() - way.dot(direction).powi(2)
        };
        let is_met = |ball: &&Ball| beside(ball) <= ball.radius * ball.radius * (1.0 + 1e-5);
        let count = self.balls.iter().filter(is_met).count();
        Some(Chosen { at, pdf: count.max(1) as f32 / (PI * total) })
    }

    /// How far from the origin the balls reach.
    pub fn reach(&self) -> f32 {
        self.balls.iter().map(|ball| ball.center.length() + ball.radius).fold(0.0, f32::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::{Chi2, Square};

    fn targets() -> Targets {
        let ball = |x: f32, y: f32, radius| Ball { center: Vec3::new(x, y, 3.0), radius };
        Targets::new([ball(0.0, 0.0, 1.0), ball(0.7, 0.2, 0.9), ball(-3.0, 1.0, 0.5), ball(0.0, 0.0, 0.0)])
    }

    #[test]
    fn the_largest_ball_tells_what_is_far() {
        let targets = targets();
        assert!(!targets.is_farther(Vec3::ZERO, 3.1));
        assert!(targets.is_farther(Vec3::ZERO, 2.9));
        assert!(!Targets::default().is_farther(Vec3::ZERO, 1.0));
    }

    #[test]
    fn directions_have_their_density() {
        let targets = targets();
        assert_eq!(targets.balls().len(), 3);
        let places = [Vec3::ZERO, Vec3::new(-1.0, 0.3, 2.0), Vec3::new(0.1, 0.0, 2.9)];
        for (p, around) in places.into_iter().flat_map(|p| [(p, 0.0), (p, 0.6)]) {
            let total = targets.solid_angle_around(p, around);
            let mut sums = [0.0f64; 2];
            let n = 40_000u32;
            for i in 0..n {
                let u =
                    [i.wrapping_mul(0xd1b5_4a33), i.wrapping_mul(0xab98_3a35), i.wrapping_mul(0x8f9d_1c75)];
                let chosen = targets.direction(p, around, u.map(crate::sampling::hash::unit)).expect("balls");
                // The measure of the union of the cones, against an even count over all directions.
                sums[0] += 1.0 / f64::from(chosen.pdf) / f64::from(n);
                let [a, b, _] = u.map(crate::sampling::hash::unit);
                let even = warp::uniform_sphere([a, b]);
                let is_in_one = targets.balls().iter().any(|ball| ball.cone_from(p, around).contains(even));
                sums[1] += f64::from(u8::from(is_in_one)) * 4.0 * std::f64::consts::PI / f64::from(n);
            }
            assert!((sums[0] / sums[1] - 1.0).abs() < 0.02, "{p} {around}: {sums:?} of {total}");
        }
    }

    #[test]
    fn a_single_ball_is_met_evenly() {
        let targets = Targets::new([Ball { center: Vec3::new(0.0, 2.0, 0.0), radius: 1.0 }]);
        Chi2::new("targets", 1).assert_directions(
            &Square::sphere(),
            |u| targets.direction(Vec3::ZERO, 0.0, [u[0], u[1], 0.5]).map(|chosen| chosen.at),
            |w| if w.y > 0.75f32.sqrt() { 1.0 / targets.solid_angle(Vec3::ZERO) } else { 0.0 },
        );
    }

    #[test]
    fn places_have_their_density() {
        let targets = targets();
        let n = 40_000u32;
        let mut area = 0.0;
        for i in 0..n {
            let u = [i.wrapping_mul(0xd1b5_4a33), i.wrapping_mul(0xab98_3a35), i.wrapping_mul(0x8f9d_1c75)];
            let chosen = targets.place(Vec3::Z, u.map(crate::sampling::hash::unit)).expect("balls");
            area += 1.0 / f64::from(chosen.pdf) / f64::from(n);
        }
        // Two circles that overlap, and one beside.
        let (r, s, d) = (1.0f64, 0.9f64, (0.7f64 * 0.7 + 0.04).sqrt());
        let a = r * r * ((d * d + r * r - s * s) / (2.0 * d * r)).acos();
        let b = s * s * ((d * d + s * s - r * r) / (2.0 * d * s)).acos();
        let c = 0.5 * ((-d + r + s) * (d + r - s) * (d - r + s) * (d + r + s)).sqrt();
        let expected = std::f64::consts::PI * (r * r + s * s + 0.25) - (a + b - c);
        assert!((area / expected - 1.0).abs() < 0.01, "{area} {expected}");
    }
}
