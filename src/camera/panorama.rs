//! Panoramic projections: film points to directions, and directions to film points.

use crate::math::{Vec3, poly};
use crate::scene;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// A compiled panoramic projection. Directions are in (right, up, forward) of the camera.
///
/// Film points map to projection coordinates that grow to the right and up: longitude and latitude, or the offset from the
/// center of a fisheye image in units of its focal length (near the center, radians).
#[derive(Clone, Copy, Debug)]
pub(super) struct Panorama {
    mapping: Mapping,
    /// Projection coordinates of the film's top left corner.
    corner: [f32; 2],
    /// Change of the projection coordinates per pixel: of the first to the right, of the second downwards.
    step: [f32; 2],
    /// Half the angle of view, radians.
    max_angle_rad: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mapping {
    /// Longitude and latitude, radians.
    Equirectangular,
    /// r = angle to the axis.
    Equidistant,
    /// r = 2 sin(angle / 2).
    Equisolid,
}

impl Panorama {
    /// For a film of `width` x `height` pixels; `shift` is the lens shift in picture heights.
    pub fn new(panorama: &scene::Panorama, width: u32, height: u32, shift: [f64; 2]) -> Panorama {
        use scene::Panorama as P;
        let size = [f64::from(width), f64::from(height)];
        let (mapping, left_top, right_bottom, max_angle_rad) = match *panorama {
            P::Equirectangular { longitude_rad: [left, right], latitude_rad: [low, high] } => {
                (Mapping::Equirectangular, [left, high], [right, low], f64::from(PI))
            }
            P::FisheyeEquidistant { fov_rad } => {
                let half = fov_rad / 2.0;
                (Mapping::Equidistant, [-half, half], [half, -half], half)
            }
            P::FisheyeEquisolid { fov_rad, focal_length, sensor } => {
                let [x, y] = sensor.map(|size| size / (2.0 * focal_length));
                (Mapping::Equisolid, [-x, y], [x, -y], fov_rad / 2.0)
            }
        };
        let step = [0, 1].map(|c| (right_bottom[c] - left_top[c]) / size[c]);
        let moved = [shift[0] * size[1], -shift[1] * size[1]];
        let corner = [0, 1].map(|c| (left_top[c] + step[c] * moved[c]) as f32);
        Panorama { mapping, corner, step: step.map(|s| s as f32), max_angle_rad: max_angle_rad as f32 }
    }

    /// Square root of the solid angle of a pixel in the center of the picture, radians.
    pub fn pixel_rad(&self) -> f32 {
        (self.step[0] * self.step[1]).abs().sqrt()
    }

    /// The unit direction of a film point; `None` outside the angle of view.
    pub fn direction(&self, x: f32, y: f32) -> Option<Vec3> {
        let a = self.corner[0] + self.step[0] * x;
        let b = self.corner[1] + self.step[1] * y;
        if self.mapping == Mapping::Equirectangular {
            let ((sin_a, cos_a), (sin_b, cos_b)) = (poly::sin_cos(a), poly::sin_cos(b));
            return Some(Vec3::new(cos_b * sin_a, sin_b, cos_b * cos_a));
        }
        let r = (a * a + b * b).sqrt();
        let angle = match self.mapping {
            Mapping::Equisolid if r > 2.0 => return None,
            Mapping::Equisolid => 2.0 * poly::asin(0.5 * r),
            _ => r,
        };
        if angle > self.max_angle_rad {
            return None;
        }
        let (sin, cos) = poly::sin_cos(angle);
        // The limit of sin(angle) / r at the center is 1.
        let out = if r > 1e-6 { sin / r } else { 1.0 };
        Some(Vec3::new(a * out, b * out, cos))
    }

    /// The film point of a direction of any length; also defined outside the angle of view and the picture.
    pub fn film_point(&self, d: Vec3) -> [f32; 2] {
        let [a, b] = match self.mapping {
            Mapping::Equirectangular => {
                [poly::atan2(d.x, d.z), poly::atan2(d.y, (d.x * d.x + d.z * d.z).sqrt())]
            }
            mapping => {
                let sideways = (d.x * d.x + d.y * d.y).sqrt();
                let angle = poly::atan2(sideways, d.z);
                let r =
                    if mapping == Mapping::Equisolid { 2.0 * poly::sin_cos(0.5 * angle).0 } else { angle };
                // The azimuth of the optical axis is undefined.
                let out = if sideways > 0.0 { r / sideways } else { 0.0 };
                [d.x * out, d.y * out]
            }
        };
        [(a - self.corner[0]) / self.step[0], (b - self.corner[1]) / self.step[1]]
    }

    /// Film area, square pixels, per solid angle around a unit direction; 0 outside the angle of view.
    pub fn pixels_per_steradian(&self, d: Vec3) -> f32 {
        let sideways = (d.x * d.x + d.y * d.y).sqrt();
        let angle = poly::atan2(sideways, d.z);
        let stretched = match self.mapping {
            Mapping::Equirectangular => 1.0 / (d.x * d.x + d.z * d.z).sqrt(),
            _ if angle > self.max_angle_rad => 0.0,
            // Film area r dr dphi over solid angle sin(a) da dphi, with r = a.
            Mapping::Equidistant if sideways > 1e-6 => angle / sideways,
            Mapping::Equidistant if d.z < 0.0 => f32::INFINITY,
            Mapping::Equidistant | Mapping::Equisolid => 1.0,
        };
        stretched / (self.step[0] * self.step[1]).abs()
    }

    /// All film points, at most 360 degrees outside the picture, with the direction of a film point: equirectangular pictures
    /// wrap around in longitude and mirror over the poles.
    pub fn equivalent_film_points(&self, film: [f32; 2]) -> impl Iterator<Item = [f32; 2]> + use<> {
        let [turn, half_turn] = [TAU / self.step[0].abs(), PI / self.step[0].abs()];
        // Film rows of the poles.
        let poles = [FRAC_PI_2, -FRAC_PI_2].map(|b| (b - self.corner[1]) / self.step[1]);
        let [x, y] = film;
        let own = [(x, y), (x + half_turn, 2.0 * poles[0] - y), (x + half_turn, 2.0 * poles[1] - y)];
        let count = if self.mapping == Mapping::Equirectangular { own.len() } else { 1 };
        let turns = if self.mapping == Mapping::Equirectangular { 1 } else { 0 };
        own.into_iter()
            .take(count)
            .flat_map(move |(x, y)| (-turns..=turns).map(move |k| [x + k as f32 * turn, y]))
    }

    /// The offset from one film point to another, pixels, the shorter way around in longitude.
    pub fn film_offset(&self, from: [f32; 2], to: [f32; 2]) -> [f32; 2] {
        let [mut x, y] = [to[0] - from[0], to[1] - from[1]];
        if self.mapping == Mapping::Equirectangular {
            let turn = TAU / self.step[0].abs();
            x -= turn * (x / turn).round();
        }
        [x, y]
    }
}

#[cfg(test)]
mod tests {
    use super::super::Camera;
    use super::*;
    use crate::math::{DAffine3, DVec3};
    use crate::sampling::hash::r2_sequence;
    use crate::scene::{Aperture, Panorama as P, Projection, ThinLens};

    const SIZE: (u32, u32) = (60, 40);

    fn camera(panorama: P, lens: Option<ThinLens>) -> Camera {
        let camera = scene::Camera {
            world_from_camera: DAffine3::from_translation(DVec3::new(0.5, 0.2, -0.1))
                * DAffine3::from_rotation_y(0.4)
                * DAffine3::from_rotation_x(0.3),
            projection: Projection::Panorama(panorama),
            lens,
            shift: [0.05, -0.02],
            clip: None,
            ..scene::Camera::look_at([0.0; 3], [0.0, 0.0, -1.0], 30.0)
        };
        Camera::new(&camera, SIZE.0, SIZE.1, DVec3::ZERO)
    }

    fn all() -> [P; 5] {
        [
            P::ALL_AROUND,
            P::Equirectangular { longitude_rad: [-1.0, 2.0], latitude_rad: [-0.4, 1.2] },
            P::FisheyeEquidistant { fov_rad: 4.0 },
            P::FisheyeEquisolid { fov_rad: 3.0, focal_length: 10.5, sensor: [36.0, 24.0] },
            P::FisheyeEquisolid { fov_rad: 6.2, focal_length: 0.5, sensor: [2.0, 2.0] },
        ]
    }

    fn numbers(i: u32) -> [f32; 2] {
        r2_sequence(i).map(|bits| (bits >> 8) as f32 / (1 << 24) as f32)
    }

    fn film(i: u32) -> [f32; 2] {
        let [u, v] = numbers(i);
        [u * SIZE.0 as f32, v * SIZE.1 as f32]
    }

    #[test]
    fn directions_match_the_angle_limits() {
        let plain = |panorama, shift| Panorama::new(&panorama, 200, 100, shift);
        let near = |a: Option<Vec3>, b: [f32; 3]| {
            assert!((a.expect("shown") - Vec3::from(b)).length() < 1e-5, "{a:?} {b:?}");
        };
        let around = plain(P::ALL_AROUND, [0.0; 2]);
        near(around.direction(100.0, 50.0), [0.0, 0.0, 1.0]);
        near(around.direction(150.0, 50.0), [1.0, 0.0, 0.0]);
        near(around.direction(200.0, 50.0), [0.0, 0.0, -1.0]);
        near(around.direction(30.0, 0.0), [0.0, 1.0, 0.0]);
        // A quarter of the height to the right.
        near(plain(P::ALL_AROUND, [0.25, 0.0]).direction(75.0, 50.0), [0.0, 0.0, 1.0]);
        // Picture edges are at half the angle of view, so that the image circle of an oblong film is an ellipse.
        let fisheye = plain(P::FisheyeEquidistant { fov_rad: f64::from(PI) }, [0.0; 2]);
        near(fisheye.direction(200.0, 50.0), [1.0, 0.0, 0.0]);
        near(fisheye.direction(100.0, 25.0), [0.0, 0.5f32.sqrt(), 0.5f32.sqrt()]);
        assert!(fisheye.direction(199.0, 20.0).is_none());
        // r = 2 f sin(angle / 2): 90 degrees at 14.85 mm of 18 mm.
        let lens = P::FisheyeEquisolid { fov_rad: 3.2, focal_length: 10.5, sensor: [36.0, 18.0] };
        near(plain(lens, [0.0; 2]).direction(100.0 + 14.849_242 / 36.0 * 200.0, 50.0), [1.0, 0.0, 0.0]);
    }

    #[test]
    fn connections_invert_camera_rays() {
        let lens = ThinLens { defocus_angle_rad: 0.3, focus_distance: 2.0, aperture: Aperture::default() };
        for (k, camera) in
            all().into_iter().flat_map(|p| [camera(p, None), camera(p, Some(lens))]).enumerate()
        {
            let mut count = 0;
            for i in 1..400 {
                let ([x, y], lens) = (film(i), numbers(7 * i + 3));
                let Some(ray) = camera.panoramic_ray(x, y, lens) else { continue };
                count += 1;
                let p = ray.at(0.5 + 0.02 * i as f32);
                if !camera.has_lens() {
                    // Rows beyond a pole are mirrored.
                    let near = |[fx, fy]: [f32; 2]| (fx - x).abs() + (fy - y).abs() < 4e-3;
                    let found = camera.film_point(p);
                    assert!(camera.equivalent_film_points(found).any(near), "{k}: {x} {y} {found:?}");
                }
                // The connection is a camera ray through the point.
                let Some(connection) = camera.connect(p, lens) else {
                    // Another lens point was sampled, so near a fisheye's rim the direction may be outside the angle of view.
                    let defocus =
                        (1.0 / (p - camera.position()).length() - 1.0 / camera.focus_distance).abs();
                    let max_angle_rad = camera.panorama.expect("a panorama").max_angle_rad;
                    let angle = ray.direction.angle_between(camera.forward);
                    assert!(
                        angle + 2.5 * camera.aperture.radius * defocus > max_angle_rad,
                        "{k}: {angle} {max_angle_rad}"
                    );
                    continue;
                };
                assert!(
                    (connection.lens + -connection.direction * connection.distance - p).length() < 1e-4,
                    "{k}"
                );
                let [sx, sy] = connection.film;
                let Some(middle) = camera.panoramic_ray(sx, sy, [0.0; 2]) else { continue };
                let focus = middle.at(camera.focus_distance);
                let off = (focus - connection.lens).normalize() + connection.direction;
                assert!(!camera.has_lens() || off.length() < 2e-3, "{k}: {off}");
                assert!((connection.lens - camera.position()).dot(middle.direction).abs() < 1e-3, "{k}");
            }
            assert!(count > 150, "{k}");
        }
    }

    /// The integral of film area per solid angle over the sphere is the area of the image on the film.
    #[test]
    fn pixels_per_steradian_integrate_to_the_film_area() {
        for (k, panorama) in all().into_iter().enumerate() {
            let own = Panorama::new(&panorama, SIZE.0, SIZE.1, [0.0; 2]);
            let (count, mut sum) = (400_000, 0.0f64);
            for i in 0..count {
                let [u, v] = numbers(i);
                let ((sin, cos), z) = (poly::sin_cos_turns(u), 2.0 * v - 1.0);
                let r = (1.0 - z * z).max(0.0).sqrt();
                let d = Vec3::new(r * cos, z, r * sin);
                let [x, y] = own.film_point(d);
                let is_on = x >= 0.0 && y >= 0.0 && x < SIZE.0 as f32 && y < SIZE.1 as f32;
                sum += if is_on { f64::from(own.pixels_per_steradian(d)) } else { 0.0 };
            }
            let found = sum / f64::from(count) * f64::from(2.0 * TAU);
            // Fraction of the film inside the image circle.
            let shown = (0..count).filter(|&i| own.direction(film(i)[0], film(i)[1]).is_some()).count();
            let expected = shown as f64 / f64::from(count) * f64::from(SIZE.0 * SIZE.1);
            assert!((found / expected - 1.0).abs() < 4e-3, "{k}: {found} {expected}");
        }
    }

    /// The number of camera rays through a spherical cap around the camera is the integral of `pixels_per_area` over the cap, with
    /// a lens radius of a third of the sphere's radius.
    #[test]
    fn pixels_per_area_integrate_to_the_hit_count_with_a_lens() {
        let lens = ThinLens { defocus_angle_rad: 0.6, focus_distance: 2.0, aperture: Aperture::default() };
        for (k, panorama) in all().into_iter().enumerate() {
            let camera = camera(panorama, Some(lens));
            let (distance, cap) = (1.9f32, 0.8f32);
            let axis = camera.panoramic_ray(33.0, 17.0, [0.0; 2]).expect("shown").direction;
            let count = 400_000;
            let mut hits = 0u32;
            for i in 0..count {
                let [x, y] = film(i);
                let Some(ray) = camera.panoramic_ray(x, y, numbers(i.wrapping_mul(2_654_435_761))) else {
                    continue;
                };
                let o = ray.origin - camera.position();
                let b = o.dot(ray.direction);
                let t = -b + (b * b - o.length_squared() + distance * distance).sqrt();
                hits += u32::from((o + ray.direction * t).dot(axis) > cap * distance);
            }
            let rays = f64::from(hits) / f64::from(count) * f64::from(SIZE.0 * SIZE.1);
            let (u, v) = axis.any_orthonormal_pair();
            let mut sum = 0.0f64;
            for i in 0..count {
                let [a, b] = numbers(i);
                let ((sin, cos), z) = (poly::sin_cos_turns(a), cap + (1.0 - cap) * b);
                let r = (1.0 - z * z).sqrt();
                let outwards = axis * z + (u * cos + v * sin) * r;
                let p = camera.position() + outwards * distance;
                let Some(connection) = camera.connect(p, numbers(i.wrapping_mul(2_246_822_519))) else {
                    continue;
                };
                let on = |[x, y]: [f32; 2]| x >= 0.0 && y >= 0.0 && x < SIZE.0 as f32 && y < SIZE.1 as f32;
                let times = camera.equivalent_film_points(connection.film).filter(|&f| on(f)).count() as f32;
                sum += f64::from(times * connection.pixels_per_area * -connection.direction.dot(outwards));
            }
            let area = TAU * (1.0 - cap) * distance * distance;
            let expected = sum / f64::from(count) * f64::from(area);
            assert!((rays / expected - 1.0).abs() < 1.5e-2, "{k}: {rays} {expected}");
        }
    }

    #[test]
    fn equirectangular_pictures_wrap_around() {
        let around = Panorama::new(&P::ALL_AROUND, SIZE.0, SIZE.1, [0.0; 2]);
        for i in 0..50 {
            let [x, y] = film(i);
            let d = around.direction(x, y).expect("shown");
            let equivalent: Vec<[f32; 2]> = around.equivalent_film_points([x, y]).collect();
            assert_eq!(equivalent.len(), 9);
            for [x, y] in equivalent {
                let other = around.direction(x, y).expect("shown");
                assert!((other - d).length() < 2e-4, "{other} {d}");
            }
        }
        // The shorter way is across the edge.
        let [right, down] = around.film_offset([59.0, 20.0], [1.0, 21.0]);
        assert!((right - 2.0).abs() < 1e-3 && (down - 1.0).abs() < 1e-6, "{right} {down}");
    }
}
