//! Compiled cameras: rays from samples of film and lens, and connections of scene points to the film for light tracing.

use crate::math::{DMat4, DVec3, DVec4, Ray, Vec3, poly, segment};
use crate::scene;
use crate::scene::Projection;
use panorama::Panorama;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

mod panorama;

/// A camera ready to generate rays. Coordinates are relative to the compiled scene's anchor.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    origin: Vec3,
    /// Unnormalized ray direction (perspective) or offset of the ray origin (orthographic) at the film's top left corner, world space.
    corner: Vec3,
    /// Change of `corner` per pixel along a row.
    step_x: Vec3,
    /// Change of `corner` per row.
    step_y: Vec3,
    forward: Vec3,
    right: Vec3,
    up: Vec3,
    aperture: Aperture,
    focus_distance: f32,
    is_perspective: bool,
    panorama: Option<Panorama>,
    clip: Option<[f32; 2]>,
}

impl Camera {
    /// Compiles a camera for a film of `width` x `height` pixels; coordinates are relative to `anchor`, a point in world
    /// space. The vertical field of view does not depend on the aspect ratios of film and pixels.
    pub fn new(camera: &scene::Camera, width: u32, height: u32, anchor: DVec3) -> Camera {
        let m = camera.world_from_camera.matrix3;
        let (right, up, back) = (m.x_axis.normalize(), m.y_axis.normalize(), m.z_axis.normalize());
        let panorama = match &camera.projection {
            Projection::Panorama(own) => Some(Panorama::new(own, width, height, camera.shift)),
            _ => None,
        };
        let half_height = match camera.projection {
            Projection::Perspective { vfov_rad } => (vfov_rad * 0.5).tan(),
            Projection::Orthographic { half_height } => half_height,
            // For the pixel size only.
            Projection::Panorama(_) => {
                0.5 * f64::from(height) * f64::from(panorama.map_or(0.0, |p| p.pixel_rad()))
            }
        };
        let pixel = 2.0 * half_height / f64::from(height);
        let pixel_width = pixel * camera.pixel_aspect;
        let [shift_x, shift_y] = camera.shift.map(|s| s * 2.0 * half_height);
        let to_corner =
            right * (shift_x - pixel_width * 0.5 * f64::from(width)) + up * (half_height + shift_y);
        let is_perspective = !matches!(camera.projection, Projection::Orthographic { .. });
        let corner = if is_perspective { to_corner - back } else { to_corner };
        Camera {
            origin: (camera.world_from_camera.translation - anchor).as_vec3(),
            corner: corner.as_vec3(),
            step_x: (right * pixel_width).as_vec3(),
            step_y: (up * -pixel).as_vec3(),
            forward: (-back).as_vec3(),
            right: right.as_vec3(),
            up: up.as_vec3(),
            aperture: Aperture::new(camera.lens),
            focus_distance: camera.lens.map_or(1.0, |lens| lens.focus_distance) as f32,
            is_perspective,
            panorama,
            clip: camera.clip.map(|clip| clip.map(|distance| distance as f32)),
        }
    }

    /// Does the camera have clip planes?
    #[inline(always)]
    pub fn is_clipped(&self) -> bool {
        self.clip.is_some()
    }

    /// Range of distances between the clip planes along a unit direction in world space, metres.
    pub fn range(&self, direction: Vec3) -> [f32; 2] {
        let Some(clip) = self.clip else { return [0.0, f32::INFINITY] };
        let cosine = if self.panorama.is_some() { 1.0 } else { direction.dot(self.forward) };
        clip.map(|distance| (distance / cosine).max(0.0))
    }

    /// Is a point between the clip planes?
    pub fn is_in_clip_range(&self, p: Vec3) -> bool {
        self.clip.is_none_or(|[near, far]| (near..=far).contains(&self.depth(p)))
    }

    /// A direction in camera space: right, up, back.
    pub fn to_camera_space(&self, direction: Vec3) -> Vec3 {
        Vec3::new(direction.dot(self.right), direction.dot(self.up), -direction.dot(self.forward))
    }

    /// A point in camera space, relative to its position.
    pub fn point_in_camera_space(&self, p: Vec3) -> Vec3 {
        self.to_camera_space(p - self.origin)
    }

    /// The ray, with unit direction, through film point (x, y), in pixels from the top left corner, and lens sample `lens` in
    /// 0..1 squared. Film points outside a panorama's image circle return the ray along the optical axis.
    pub fn ray(&self, x: f32, y: f32, lens: [f32; 2]) -> Ray {
        match &self.panorama {
            Some(_) => self.panoramic_ray(x, y, lens).unwrap_or(Ray::new(self.origin, self.forward)),
            None => self.lens_ray(x, y, lens),
        }
    }

    /// [`Camera::ray`] for cameras other than panoramas.
    #[inline(always)]
    pub fn lens_ray(&self, x: f32, y: f32, lens: [f32; 2]) -> Ray {
        if self.has_lens() {
            let (origin, direction) = self.unnormalized_ray(x, y);
            // The focus distance is measured along the optical axis, not along the ray.
            let focus = origin + direction * (self.focus_distance / direction.dot(self.forward));
            let (x, y) = self.aperture.point(lens);
            let origin = origin + self.right * x + self.up * y;
            // Far from the anchor, rounding may make two close points coincide.
            let direction = (focus - origin).try_normalize().unwrap_or_else(|| direction.normalize());
            return Ray::new(origin, direction);
        }
        self.pinhole_ray(x, y)
    }

    /// The ray through film point (x, y) and the center of the lens, of a camera other than a panorama.
    #[inline(always)]
    pub fn pinhole_ray(&self, x: f32, y: f32) -> Ray {
        let (origin, direction) = self.unnormalized_ray(x, y);
        Ray::new(origin, direction.normalize())
    }

    /// Origin and unnormalized direction of the ray through a film point and the center of the lens.
    #[inline(always)]
    fn unnormalized_ray(&self, x: f32, y: f32) -> (Vec3, Vec3) {
        let film = self.corner + self.step_x * x + self.step_y * y;
        if self.is_perspective { (self.origin, film) } else { (self.origin + film, self.forward) }
    }

    /// The ray of a panorama; `None` outside its image circle, and for other cameras.
    ///
    /// The aperture is perpendicular to the direction of the film point, and the focus surface is a sphere (as in Cycles).
    pub fn panoramic_ray(&self, x: f32, y: f32, lens: [f32; 2]) -> Option<Ray> {
        let ahead = self.to_world(self.panorama.as_ref()?.direction(x, y)?);
        if !self.has_lens() {
            return Some(Ray::new(self.origin, ahead));
        }
        let (x, y) = self.aperture.point(lens);
        let (u, v) = ahead.any_orthonormal_pair();
        let offset = u * x + v * y;
        let direction = (ahead * self.focus_distance - offset).try_normalize().unwrap_or(ahead);
        Some(Ray::new(self.origin + offset, direction))
    }

    /// A unit direction in world space from one along right, up and forward. Normalized because the interpolated axes of a moving
    /// camera are not orthonormal.
    fn to_world(self, d: Vec3) -> Vec3 {
        (self.right * d.x + self.up * d.y + self.forward * d.z).normalize_or(self.forward)
    }

    /// Is the projection panoramic?
    #[inline(always)]
    pub fn is_panorama(&self) -> bool {
        self.panorama.is_some()
    }

    /// Do rays depend on the point on the lens?
    #[inline(always)]
    pub fn has_lens(&self) -> bool {
        self.aperture.radius > 0.0
    }

    /// Projects a point through the center of the lens to the film, in pixels. Infinite or NaN for points in the lens plane of
    /// a perspective camera.
    pub fn film_point(&self, p: Vec3) -> [f32; 2] {
        if let Some(panorama) = &self.panorama {
            let [x, y, back] = self.point_in_camera_space(p).to_array();
            return panorama.film_point(Vec3::new(x, y, -back));
        }
        let from = p - self.origin;
        let film = if self.is_perspective { from / from.dot(self.forward) } else { from };
        let offset = film - self.corner;
        [self.step_x, self.step_y].map(|step| offset.dot(step) / step.length_squared())
    }

    /// The offset on the film from one point to another, pixels; in a full panorama modulo 360 degrees, the shorter way around.
    pub fn film_offset(&self, from: [f32; 2], to: [f32; 2]) -> [f32; 2] {
        match &self.panorama {
            Some(panorama) => panorama.film_offset(from, to),
            None => [to[0] - from[0], to[1] - from[1]],
        }
    }

    /// The center of the lens, relative to the anchor.
    pub fn position(&self) -> Vec3 {
        self.origin
    }

    /// Do all rays start on the lens? True for panoramas too.
    pub fn is_perspective(&self) -> bool {
        self.is_perspective
    }

    /// Width of a ray's footprint at its origin, metres, and its growth per metre: half a pixel, since many samples of a
    /// pixel resolve finer detail than one. The shorter side of pixels that aren't square.
    pub fn pixel_cone(&self) -> (f32, f32) {
        let half_pixel = 0.5 * self.step_x.length().min(self.step_y.length());
        if self.is_perspective { (0.0, half_pixel) } else { (half_pixel, 0.0) }
    }

    /// Z depth as in compositing, metres: distance of a point from the lens plane, or from the lens center for panoramas.
    #[inline(always)]
    pub fn depth(&self, p: Vec3) -> f32 {
        if self.panorama.is_some() {
            return (p - self.origin).length();
        }
        (p - self.origin).dot(self.forward)
    }

    /// Connects a point of the scene to the lens point sampled by `lens` in 0..1 squared, as in [`Camera::ray`]; `None` behind the
    /// camera and outside its clip range.
    ///
    /// For a pinhole, a solid angle `dw` at an angle with cosine `c` to the axis covers the area `dw / c^3` on the plane at distance 1
    /// (Pharr, Jakob, Humphreys 2016, "Physically Based Rendering", section 16.1.1). The same holds for each point of a lens, since
    /// the film is a scaled image of the focus plane.
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
        // Depth of the point relative to the focus plane.
        let ratio = depth / self.focus_distance;
        // `on_film`: the film point, on the plane at distance 1 or, orthographic, on the camera plane.
        let (start, on_film) = if self.is_perspective {
            let start = self.origin + offset;
            let focus = start + (p - start) / ratio;
            (start, (focus - self.origin) / self.focus_distance)
        } else {
            let axis = self.forward * self.focus_distance;
            let start = p - (axis - offset) * ratio;
            (start, start - offset - self.origin)
        };
        let to_lens = start - p;
        let distance = to_lens.length();
        let direction = to_lens / distance;
        let film = on_film - self.corner;
        let (width_squared, height_squared) = (self.step_x.length_squared(), self.step_y.length_squared());
        let cosine = -direction.dot(self.forward);
        let on_plane = match self.is_perspective {
            true => 1.0 / (distance * distance * cosine * cosine * cosine),
            false => 1.0 / cosine,
        };
        let connection = FilmConnection {
            film: [film.dot(self.step_x) / width_squared, film.dot(self.step_y) / height_squared],
            lens: start,
            direction,
            distance,
            pixels_per_area: on_plane / (width_squared * height_squared).sqrt(),
        };
        connection.pixels_per_area.is_finite().then_some(connection)
    }

    /// Connects a point of the scene to a panorama.
    ///
    /// The aperture is perpendicular to the direction in focus, which is unknown before the lens point is chosen. It is sampled
    /// perpendicular to the direction of the scene point instead, with the same pdf: the rays of one lens radius differ by rotations
    /// about the lens center, and the measure of rotations is the same whether it is split into direction in focus and angle on the
    /// aperture, or into direction of the scene point and that angle. The film density is that of the direction in focus.
    fn connect_panorama(&self, panorama: &Panorama, p: Vec3, lens: [f32; 2]) -> Option<FilmConnection> {
        let to = p - self.origin;
        let center_distance = to.length();
        let (towards, focus) = (to / center_distance, self.focus_distance);
        let (x, y) = if self.has_lens() { self.aperture.point(lens) } else { (0.0, 0.0) };
        let radius_squared = x * x + y * y;
        // Ray parameter of the point: 0 on the lens, 1 on the focus sphere. Points within the lens radius have no connection.
        let excess = center_distance * center_distance - radius_squared;
        if excess.is_nan() || excess <= 0.0 {
            return None;
        }
        let sum = radius_squared + focus * focus;
        let fraction = (radius_squared + (radius_squared * radius_squared + sum * excess).sqrt()) / sum;
        // Rotates the direction of the point into the direction in focus, by an angle that is positive (towards the lens point) if the
        // focus sphere lies behind the point.
        let ((u, v), radius) = (towards.any_orthonormal_pair(), radius_squared.sqrt());
        let side = if radius > 0.0 { (u * x + v * y) / radius } else { Vec3::ZERO };
        let (cosine, sine) =
            (fraction * focus / center_distance, (1.0 - fraction) * radius / center_distance);
        let ahead = towards * cosine - side * sine;
        let start = self.origin + (towards * sine + side * cosine) * radius;
        let to_lens = start - p;
        let distance = to_lens.length();
        let direction = to_lens / distance;
        let [x, y, back] = self.to_camera_space(ahead).to_array();
        let local = Vec3::new(x, y, -back);
        let connection = FilmConnection {
            film: panorama.film_point(local),
            lens: start,
            direction,
            distance,
            pixels_per_area: panorama.pixels_per_steradian(local)
                / (center_distance * center_distance * -direction.dot(towards)),
        };
        (connection.pixels_per_area > 0.0 && connection.pixels_per_area.is_finite()).then_some(connection)
    }

    /// All film points within one turn of the picture with the same direction as a film point.
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
    /// Origin of the camera ray on the lens, or on the plane of an orthographic camera.
    pub lens: Vec3,
    /// Unit vector from the scene point to `lens`.
    pub direction: Vec3,
    /// Distance from the scene point to `lens`, metres.
    pub distance: f32,
    /// Film area, square pixels, per square metre of a surface at the point that faces the ray. Camera importance is this times
    /// the pixel filter.
    pub pixels_per_area: f32,
}

/// The matrix, for column vectors, from world space to the normalized device coordinates of OpenEXR's attribute `worldToNDC`
/// (after RenderMan): x from 0 at the left edge of a picture of `width` x `height` pixels to 1 at the right, y from 0 at the top
/// to 1 at the bottom; z is the reciprocal depth (perspective) or the depth (orthographic). `None` for panoramas, which are not
/// projective maps.
pub fn ndc_from_world(camera: &scene::Camera, width: u32, height: u32) -> Option<DMat4> {
    let world_from_camera = camera.world_from_camera;
    let m = world_from_camera.matrix3;
    let (right, up, back) = (m.x_axis.normalize(), m.y_axis.normalize(), m.z_axis.normalize());
    let eye = world_from_camera.translation;
    // Matrix row for a point's coordinate along an axis, relative to the camera.
    let along = |axis: DVec3| axis.extend(-axis.dot(eye));
    let (x, y, depth, one) = (along(right), along(up), -along(back), DVec4::W);
    let (half_height, weight) = match camera.projection {
        Projection::Perspective { vfov_rad } => ((0.5 * vfov_rad).tan(), depth),
        Projection::Orthographic { half_height } => (half_height, one),
        Projection::Panorama(_) => return None,
    };
    let half_width = half_height * camera.pixel_aspect * f64::from(width) / f64::from(height);
    let [shift_x, shift_y] = camera.shift.map(|shift| shift * 2.0 * half_height);
    let ndc_x = (x + weight * (half_width - shift_x)) / (2.0 * half_width);
    let ndc_y = (weight * (half_height + shift_y) - y) / (2.0 * half_height);
    let z = if weight == one { depth } else { one };
    Some(DMat4::from_cols(ndc_x, ndc_y, z, weight).transpose())
}

/// Camera keyframes at equal time steps; position, axes and film corners are interpolated linearly.
#[derive(Clone, Debug)]
pub struct MovingCamera(Arc<[Camera]>);

impl MovingCamera {
    /// From the camera at each keyframe, two or more.
    pub fn new(keys: impl Iterator<Item = Camera>) -> MovingCamera {
        MovingCamera(keys.collect())
    }

    /// The camera at a time in 0..1.
    #[inline]
    pub fn at(&self, time: f32) -> Camera {
        let (key, t) = segment(self.0.len(), time);
        let (from, to) = (&self.0[key], &self.0[(key + 1).min(self.0.len() - 1)]);
        let mix = |a: Vec3, b: Vec3| a + (b - a) * t;
        Camera {
            origin: mix(from.origin, to.origin),
            corner: mix(from.corner, to.corner),
            step_x: mix(from.step_x, to.step_x),
            step_y: mix(from.step_y, to.step_y),
            forward: mix(from.forward, to.forward),
            right: mix(from.right, to.right),
            up: mix(from.up, to.up),
            ..*from
        }
    }
}

/// A compiled aperture: a disk or a regular polygon, stretched by `width`.
#[derive(Clone, Copy, Debug)]
struct Aperture {
    /// Radius of the disk, or circumradius of the polygon, metres; 0 for a pinhole.
    pub radius: f32,
    /// Number of corners of the polygon; 0 for a disk.
    blades: f32,
    /// Cosine and sine of half the angle between two corners.
    half_sector: (f32, f32),
    /// Counter-clockwise angle from the camera's right axis to the middle of the first side, turns.
    rotation_turns: f32,
    /// Width over height.
    width: f32,
}

impl Aperture {
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

    /// Samples a point of the aperture uniformly by area from `u` in 0..1 squared: offsets to the right and up, metres.
    ///
    /// The disk is sampled in polar coordinates. A polygon is a triangle fan: `u[0]` selects a triangle, and its remainder with
    /// `u[1]` a point in the triangle (Turk 1990, "Generating random points in triangles").
    #[inline(always)]
    pub fn point(&self, u: [f32; 2]) -> (f32, f32) {
        if self.blades == 0.0 {
            let radius = self.radius * u[0].sqrt();
            let (sin, cos) = poly::sin_cos_turns(u[1]);
            return (radius * cos * self.width, radius * sin);
        }
        let scaled = u[0] * self.blades;
        let sector = scaled.floor().min(self.blades - 1.0);
        // Distance from the center over the apothem, and position along the side from corner to corner.
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
    use crate::math::{DAffine3, DVec3};
    use crate::sampling::hash::r2_sequence;
    use crate::scene;

    fn pinhole() -> scene::Camera {
        let vfov_rad = std::f64::consts::FRAC_PI_2;
        let place = DAffine3::from_translation(DVec3::new(10.0, 0.0, 0.0));
        scene::Camera::new(place, Projection::Perspective { vfov_rad })
    }

    #[test]
    fn edges_of_the_film_match_the_field_of_view() {
        let camera = Camera::new(&pinhole(), 200, 100, DVec3::new(10.0, 0.0, 0.0));
        let top = camera.ray(100.0, 0.0, [0.0; 2]).direction;
        assert!((top - Vec3::new(0.0, 1.0, -1.0).normalize()).length() < 1e-6);
        let left = camera.ray(0.0, 50.0, [0.0; 2]).direction;
        assert!((left - Vec3::new(-2.0, 0.0, -1.0).normalize()).length() < 1e-6);
        assert_eq!(camera.ray(1.0, 2.0, [0.0; 2]).origin, Vec3::ZERO);
    }

    #[test]
    fn lens_shift_is_in_picture_heights() {
        for (projection, top) in [
            (pinhole().projection, Vec3::new(0.0, 1.0, -1.0)),
            (Projection::Orthographic { half_height: 1.0 }, Vec3::NEG_Z),
        ] {
            let camera = scene::Camera { shift: [0.25, -0.5], projection, ..pinhole() };
            let camera = Camera::new(&camera, 200, 100, DVec3::ZERO);
            // Middle of the upper edge without the shift.
            let ray = camera.ray(75.0, -50.0, [0.0; 2]);
            assert!((ray.direction - top.normalize()).length() < 1e-6);
            let origin = if camera.is_perspective() { Vec3::ZERO } else { Vec3::Y };
            assert!((ray.origin - Vec3::new(10.0, 0.0, 0.0) - origin).length() < 1e-5);
        }
    }

    #[test]
    fn lens_rays_converge_on_the_focus_plane() {
        let lens = scene::ThinLens {
            defocus_angle_rad: 0.2,
            focus_distance: 5.0,
            aperture: scene::Aperture::default(),
        };
        let camera = Camera::new(&scene::Camera { lens: Some(lens), ..pinhole() }, 64, 64, DVec3::ZERO);
        let at_focus = |u: [f32; 2]| {
            let ray = camera.ray(10.0, 20.0, u);
            ray.at((-5.0 - ray.origin.z) / ray.direction.z)
        };
        let reference = at_focus([0.0, 0.0]);
        for u in [[0.9, 0.1], [0.5, 0.6], [1.0, 0.8]] {
            assert!((at_focus(u) - reference).length() < 1e-5);
        }
        let rim = camera.ray(32.0, 32.0, [1.0, 0.25]).origin - Vec3::new(10.0, 0.0, 0.0);
        assert!((rim.length() - 5.0 * 0.1f32.tan()).abs() < 1e-5);
    }

    fn cameras() -> Vec<Camera> {
        let lens = scene::ThinLens {
            defocus_angle_rad: 0.3,
            focus_distance: 5.0,
            aperture: scene::Aperture { blades: 6, rotation_rad: 0.2, ratio: 1.5 },
        };
        let projections =
            [Projection::Perspective { vfov_rad: 0.9 }, Projection::Orthographic { half_height: 2.0 }];
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
    fn connections_invert_camera_rays() {
        for (k, camera) in cameras().into_iter().enumerate() {
            for i in 1..200 {
                let ([x, y], lens) = (numbers(i), numbers(7 * i + 3));
                let (x, y) = (60.0 * x, 40.0 * y);
                let ray = camera.ray(x, y, lens);
                let p = ray.at(0.5 + 0.05 * i as f32);
                let connection = camera.connect(p, lens).expect("in front");
                assert!(
                    (connection.film[0] - x).abs() + (connection.film[1] - y).abs() < 2e-3,
                    "{k}: {x} {y} {connection:?}"
                );
                assert!((connection.lens - ray.origin).length() < 1e-4, "{k}");
                assert!((connection.direction + ray.direction).length() < 1e-4, "{k}");
                assert!(camera.connect(ray.at(-1.0), lens).is_none(), "{k}: behind");
            }
        }
    }

    /// By definition: the Jacobian of the film point over a small square perpendicular to the ray.
    #[test]
    fn pixels_per_area_is_the_jacobian_of_the_film_point() {
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

    #[test]
    fn ndc_matches_film_points() {
        let (width, height) = (40, 30);
        let mut camera = scene::Camera::look_at([1.0, 2.0, 5.0], [0.2, 0.1, -0.3], 35.0);
        camera.shift = [0.1, -0.2];
        camera.pixel_aspect = 1.4;
        let parallel = Projection::Orthographic { half_height: 1.5 };
        for camera in [camera.clone(), scene::Camera { projection: parallel, ..camera }] {
            let shown = Camera::new(&camera, width, height, DVec3::ZERO);
            let matrix = ndc_from_world(&camera, width, height).expect("no panorama");
            for p in [DVec3::ZERO, DVec3::new(0.7, -0.4, 1.0), DVec3::new(-1.0, 0.8, -3.0)] {
                let [x, y] = shown.film_point(p.as_vec3());
                let ndc = matrix.project_point3(p);
                let expected = [f64::from(x) / 40.0, f64::from(y) / 30.0];
                assert!((ndc.x - expected[0]).abs() < 1e-6 && (ndc.y - expected[1]).abs() < 1e-6, "{ndc}");
            }
        }
    }

    fn points(aperture: scene::Aperture) -> Vec<(f32, f32)> {
        let lens = scene::ThinLens { defocus_angle_rad: PI / 2.0, focus_distance: 1.0, aperture };
        let aperture = Aperture::new(Some(lens));
        assert!((aperture.radius - 1.0).abs() < 1e-6);
        let unit = |bits: u32| (bits >> 8) as f32 / (1 << 24) as f32;
        (0..40_000).map(|i| aperture.point(r2_sequence(i).map(unit))).collect()
    }

    #[test]
    fn polygon_samples_are_uniform_by_area() {
        for blades in [3, 5, 6, 9] {
            let rotation_rad = 0.3;
            let all = points(scene::Aperture { blades, rotation_rad, ratio: 1.0 });
            let half = PI / f64::from(blades);
            let mut squares = 0.0;
            for &(x, y) in &all {
                let (x, y) = (f64::from(x), f64::from(y));
                // Inside the half-plane of every side.
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
            // Polar moment of area of a regular polygon of circumradius 1, over its area.
            let expected = (2.0 + (2.0 * half).cos()) / 6.0;
            assert!((squares / all.len() as f64 - expected).abs() < 2e-3, "{blades}");
        }
    }

    #[test]
    fn anamorphic_ratio_narrows_the_aperture() {
        for blades in [0, 6] {
            let all = points(scene::Aperture { blades, rotation_rad: 0.0, ratio: 2.0 });
            let most = |f: fn(&(f32, f32)) -> f32| all.iter().map(f).fold(0.0f32, f32::max);
            assert!(most(|p| p.0.abs()) < 0.5 + 1e-5 && most(|p| p.1.abs()) > 0.85, "{blades}");
        }
    }
}
