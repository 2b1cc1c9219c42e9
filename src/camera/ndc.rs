//! Where points of the world appear in the picture, as a matrix.

use crate::math::{DMat4, DVec3, DVec4};
use crate::scene::{Camera, Projection};

/// From the world to normalized device coordinates as OpenEXR defines them for its attribute `worldToNDC` (after RenderMan):
/// what is seen has x from 0 at the left edge of a picture of `width` x `height` pixels to 1 at the right one, and y from 0 at
/// the top to 1 at the bottom. z is one over the depth with perspective, the depth with parallel rays. Column vectors. No matrix says it of a panorama.
pub fn ndc_from_world(camera: &Camera, width: u32, height: u32) -> Option<DMat4> {
    let world_from_camera = camera.world_from_camera;
    let m = world_from_camera.matrix3;
    let (right, up, back) = (m.x_axis.normalize(), m.y_axis.normalize(), m.z_axis.normalize());
    let eye = world_from_camera.translation;
    // Rows that give a point's place along an axis, from where the camera stands.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_where_the_picture_shows_them() {
        let (width, height) = (40, 30);
        let mut camera = Camera::look_at([1.0, 2.0, 5.0], [0.2, 0.1, -0.3], 35.0);
        camera.shift = [0.1, -0.2];
        camera.pixel_aspect = 1.4;
        let parallel = Projection::Orthographic { half_height: 1.5 };
        for camera in [camera.clone(), Camera { projection: parallel, ..camera }] {
            let shown = crate::camera::Camera::new(&camera, width, height, DVec3::ZERO);
            let matrix = ndc_from_world(&camera, width, height).expect("no panorama");
            for p in [DVec3::ZERO, DVec3::new(0.7, -0.4, 1.0), DVec3::new(-1.0, 0.8, -3.0)] {
                let [x, y] = shown.film_point(p.as_vec3());
                let ndc = matrix.project_point3(p);
                let expected = [f64::from(x) / 40.0, f64::from(y) / 30.0];
                assert!((ndc.x - expected[0]).abs() < 1e-6 && (ndc.y - expected[1]).abs() < 1e-6, "{ndc}");
            }
        }
    }
}
