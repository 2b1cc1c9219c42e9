//! The opening of a lens: a disk, or a regular polygon of blades.

use crate::math::poly;
use crate::scene;
use std::f64::consts::{PI, TAU};

/// An opening ready to choose points in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Aperture {
    /// Radius of the disk, and of the circle through the polygon's corners, metres; 0 is a pinhole.
    pub radius: f32,
    /// Number of the polygon's corners; 0 is a disk.
    blades: f32,
    /// Cosine and sine of half the angle between two corners.
    half_sector: (f32, f32),
    /// Turns from the right to the middle of the first side, counter-clockwise.
    rotation_turns: f32,
    /// Width over height.
    width: f32,
}

impl Aperture {
    /// The opening of a lens.
    pub fn new(lens: Option<scene::ThinLens>) -> Aperture {
        let radius = lens.map_or(0.0, |l| (l.defocus_angle_rad * 0.5).tan() * l.focus_distance) as f32;
        let aperture = lens.map_or(scene::Aperture::default(), |l| l.aperture);
        let half = PI / f64::from(aperture.blades.max(1));
        Aperture {
            radius,
            blades: aperture.blades as f32,
            half_sector: (half.cos() as f32, half.sin() as f32),
            rotation_turns: (aperture.rotation_rad / TAU).rem_euclid(1.0) as f32,
            width: (1.0 / aperture.ratio) as f32,
        }
    }

    /// The point for `u` in 0..1 squared, to the right and up, metres; all points of the opening are as likely.
    ///
    /// A polygon is a fan of triangles: `u[0]` chooses one, and its rest with `u[1]` a point in it (Shirley and Chiu, "A low
    /// distortion map between disk and square", 1997, for the disk; Turk, "Generating random points in triangles", 1990,
    /// for triangles).
    #[inline(always)]
    pub fn point(&self, u: [f32; 2]) -> (f32, f32) {
        if self.blades == 0.0 {
            let radius = self.radius * u[0].sqrt();
            let (sin, cos) = poly::sin_cos_turns(u[1]);
            return (radius * cos * self.width, radius * sin);
        }
        let scaled = u[0] * self.blades;
        let sector = scaled.floor().min(self.blades - 1.0);
        // From the middle to the side, and along it from one corner to the next.
        let outwards = (scaled - sector).sqrt();
        let along = outwards * (2.0 * u[1] - 1.0);
        let (x, y) = (outwards * self.half_sector.0, along * self.half_sector.1);
        let (sin, cos) = poly::sin_cos_turns(sector / self.blades + self.rotation_turns);
        let (x, y) = (x * cos - y * sin, x * sin + y * cos);
        (self.radius * x * self.width, self.radius * y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash::r2_sequence;

    fn points(aperture: scene::Aperture) -> Vec<(f32, f32)> {
        let lens = scene::ThinLens { defocus_angle_rad: PI / 2.0, focus_distance: 1.0, aperture };
        let aperture = Aperture::new(Some(lens));
        assert!((aperture.radius - 1.0).abs() < 1e-6);
        let unit = |bits: u32| (bits >> 8) as f32 / (1 << 24) as f32;
        (0..40_000).map(|i| aperture.point(r2_sequence(i).map(unit))).collect()
    }

    #[test]
    fn points_fill_a_polygon_evenly() {
        for blades in [3, 5, 6, 9] {
            let rotation_rad = 0.3;
            let all = points(scene::Aperture { blades, rotation_rad, ratio: 1.0 });
            let half = PI / f64::from(blades);
            let mut squares = 0.0;
            for &(x, y) in &all {
                let (x, y) = (f64::from(x), f64::from(y));
                // Within every side.
                for k in 0..blades {
                    let angle = rotation_rad + 2.0 * half * f64::from(k);
                    assert!(x * angle.cos() + y * angle.sin() <= half.cos() + 1e-5, "{blades}: {x} {y}");
                }
                squares += x * x + y * y;
            }
            let mean = |f: fn(&(f32, f32)) -> f32| {
                all.iter().map(|p| f64::from(f(p))).sum::<f64>() / all.len() as f64
            };
            assert!(mean(|p| p.0).abs() < 2e-3 && mean(|p| p.1).abs() < 2e-3);
            // Polar moment of a regular polygon over its area, for corners at distance 1.
            let expected = (2.0 + (2.0 * half).cos()) / 6.0;
            assert!((squares / all.len() as f64 - expected).abs() < 2e-3, "{blades}");
        }
    }

    #[test]
    fn a_ratio_makes_the_opening_narrow() {
        for blades in [0, 6] {
            let all = points(scene::Aperture { blades, rotation_rad: 0.0, ratio: 2.0 });
            let most = |f: fn(&(f32, f32)) -> f32| all.iter().map(f).fold(0.0f32, f32::max);
            assert!(most(|p| p.0.abs()) < 0.5 + 1e-5 && most(|p| p.1.abs()) > 0.85, "{blades}");
        }
    }
}
