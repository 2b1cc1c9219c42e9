//! Camera importance: the film point of a point of the scene, for light paths that connect to the camera.

use super::Camera;
use super::panorama::Panorama;
use crate::math::Vec3;

impl Camera {
    /// Connects a point to the point of the lens that `lens` in 0..1 squared chooses, as in [`Camera::ray`]; `None` behind the camera and
    /// outside of its clip range.
    ///
    /// Of a pinhole, a solid angle `dw` at an angle with cosine `c` to the axis covers `dw / c^3` of the plane at distance 1
    /// (Pharr, Jakob, Humphreys 2016, "Physically Based Rendering", section 16.1.1). The same holds for each point of a lens:
    /// its image on the plane in focus is the film, scaled.
    pub fn connect(&self, p: Vec3, lens: [f32; 2]) -> Option<FilmConnection> {
        if !self.is_in_clip_range(p) {
            return None;
        }
        if let Some(panorama) = &self.panorama {
            return self.connect_panorama(panorama, p, lens);
        }
        let depth = self.depth(p);
        if depth.is_nan() || depth <= 0.0 {
            return None;
        }
        let offset = match self.aperture.radius > 0.0 {
            true => {
                let (x, y) = self.aperture.point(lens);
                self.right * x + self.up * y
            }
            false => Vec3::ZERO,
        };
        // The depth of the point relative to the plane in focus.
        let share = depth / self.focus_distance;
        let (start, place) = if self.is_perspective {
            let start = self.origin + offset;
            let focus = start + (p - start) / share;
            (start, (focus - self.origin) / self.focus_distance)
        } else {
            let axis = self.forward * self.focus_distance;
            let start = p - (axis - offset) * share;
            (start, start - offset - self.origin)
        };
        let way = start - p;
        let distance = way.length();
        let direction = way / distance;
        let film = place - self.corner;
        let (width, height) = (self.step_x.length_squared(), self.step_y.length_squared());
        let cosine = -direction.dot(self.forward);
        let on_plane = match self.is_perspective {
            true => 1.0 / (distance * distance * cosine * cosine * cosine),
            false => 1.0 / cosine,
        };
        let sight = FilmConnection {
            film: [film.dot(self.step_x) / width, film.dot(self.step_y) / height],
            lens: start,
            direction,
            distance,
            pixels_per_area: on_plane / (width * height).sqrt(),
        };
        sight.pixels_per_area.is_finite().then_some(sight)
    }

    /// Connects a point to a panorama.
    ///
    /// All directions of such a camera and all points of their round lenses together are as many as rotations, times the distance
    /// from the lens's center. Let a ray meet a sphere around the camera: to turn it so that its direction or so that the point which
    /// it intersects is a given one is the same to their measure. So the lens may as well be chosen around the point; only the
    /// density of the picture is that of the direction, which follows from where the ray is in focus.
    fn connect_panorama(&self, panorama: &Panorama, p: Vec3, lens: [f32; 2]) -> Option<FilmConnection> {
        let to = p - self.origin;
        let away = to.length();
        let (towards, focus) = (to / away, self.focus_distance);
        let (x, y) = if self.has_lens() { self.aperture.point(lens) } else { (0.0, 0.0) };
        let radius_squared = x * x + y * y;
        // The ray reaches the point at this share of its way from the lens to the focus. Points as near as the lens is wide
        // are on its glass.
        let behind = away * away - radius_squared;
        if behind.is_nan() || behind <= 0.0 {
            return None;
        }
        let sum = radius_squared + focus * focus;
        let share = (radius_squared + (radius_squared * radius_squared + sum * behind).sqrt()) / sum;
        // Seen from the camera the point is at this angle to the direction in focus, on the side of the point of the lens
        // where the focus lies behind it.
        let ((u, v), radius) = (towards.any_orthonormal_pair(), radius_squared.sqrt());
        let side = if radius > 0.0 { (u * x + v * y) / radius } else { Vec3::ZERO };
        let (along, across) = (share * focus / away, (1.0 - share) * radius / away);
        let ahead = towards * along - side * across;
        let start = self.origin + (towards * across + side * along) * radius;
        let way = start - p;
        let distance = way.length();
        let direction = way / distance;
        let [x, y, back] = self.to_camera_space(ahead).to_array();
        let local = Vec3::new(x, y, -back);
        let sight = FilmConnection {
            film: panorama.film_point(local),
            lens: start,
            direction,
            distance,
            pixels_per_area: panorama.pixels_per_steradian(local) / (away * away * -direction.dot(towards)),
        };
        (sight.pixels_per_area > 0.0 && sight.pixels_per_area.is_finite()).then_some(sight)
    }

    /// All film points near the picture that show the same direction as a film point.
    pub fn equivalent_film_points(&self, film: [f32; 2]) -> impl Iterator<Item = [f32; 2]> + use<> {
        let around = self.panorama.map(|panorama| panorama.equivalent_film_points(film));
        let own = around.is_none().then_some(film);
        around.into_iter().flatten().chain(own)
    }
}

/// The connection of a point of the scene to the camera through a point of the lens.
#[derive(Clone, Copy, Debug)]
pub struct FilmConnection {
    /// Film point, in pixels from the top left corner.
    pub film: [f32; 2],
    /// The point of the lens, or of an orthographic camera's plane: where the ray of the camera starts.
    pub lens: Vec3,
    /// Unit vector from the point to there.
    pub direction: Vec3,
    /// Distance to there, metres.
    pub distance: f32,
    /// Film area, in square pixels, that a surface of one square metre at the point covers if it faces the ray. Times the
    /// filter of a pixel and the radiance along the ray it is the density per area of what the pixel shows.
    pub pixels_per_area: f32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{DAffine3, DVec3};
    use crate::sampling::hash::r2_sequence;
    use crate::scene;

    fn cameras() -> Vec<Camera> {
        let lens = scene::ThinLens {
            defocus_angle_rad: 0.3,
            focus_distance: 5.0,
            aperture: scene::Aperture { blades: 6, rotation_rad: 0.2, ratio: 1.5 },
        };
        let projections = [
            scene::Projection::Perspective { vfov_rad: 0.9 },
            scene::Projection::Orthographic { half_height: 2.0 },
        ];
        let of = |(projection, lens)| scene::Camera {
            name: String::new(),
            world_from_camera: DAffine3::from_rotation_y(0.4) * DAffine3::from_rotation_x(0.3),
            projection,
            aspect_ratio: None,
            pixel_aspect: 1.3,
            lens,
            shift: [0.1, -0.05],
            clip: None,
            motion: None,
        };
        let all = projections.into_iter().flat_map(|p| [(p, None), (p, Some(lens))]);
        all.map(|camera| Camera::new(&of(camera), 60, 40, DVec3::ZERO)).collect()
    }

    fn numbers(i: u32) -> [f32; 2] {
        r2_sequence(i).map(|bits| (bits >> 8) as f32 / (1 << 24) as f32)
    }

    #[test]
    fn points_are_seen_where_rays_hit_them() {
        for (k, camera) in cameras().into_iter().enumerate() {
            for i in 1..200 {
                let ([x, y], lens) = (numbers(i), numbers(7 * i + 3));
                let (x, y) = (60.0 * x, 40.0 * y);
                let ray = camera.ray(x, y, lens);
                let p = ray.at(0.5 + 0.05 * i as f32);
                let sight = camera.connect(p, lens).expect("in front");
                assert!(
                    (sight.film[0] - x).abs() + (sight.film[1] - y).abs() < 2e-3,
                    "{k}: {x} {y} {sight:?}"
                );
                assert!((sight.lens - ray.origin).length() < 1e-4, "{k}");
                assert!((sight.direction + ray.direction).length() < 1e-4, "{k}");
                assert!(camera.connect(ray.at(-1.0), lens).is_none(), "{k}: behind");
            }
        }
    }

    /// By the definition: how the place on the film changes over a small square that faces the ray.
    #[test]
    fn areas_are_the_change_of_places() {
        for (k, camera) in cameras().into_iter().enumerate() {
            for i in 1..50 {
                let lens = numbers(3 * i + 1);
                let ray = camera.ray(60.0 * numbers(i)[0], 40.0 * numbers(i)[1], lens);
                let p = ray.at(4.0);
                let (a, b) = ray.direction.any_orthonormal_pair();
                let step = 0.02;
                let at = |v: Vec3| camera.connect(p + v, lens).expect("in front").film;
                let change = |v: Vec3| {
                    let (to, from) = (at(v * step), at(v * -step));
                    [0, 1].map(|c| (to[c] - from[c]) / (2.0 * step))
                };
                let ([ax, ay], [bx, by]) = (change(a), change(b));
                let area = camera.connect(p, lens).expect("in front").pixels_per_area;
                let expected = (ax * by - ay * bx).abs();
                assert!((area / expected - 1.0).abs() < 5e-3, "{k} {i}: {area} {expected}");
            }
        }
    }
}
