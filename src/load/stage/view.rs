//! The camera that frames a model.

use super::options::StageOptions;
use super::outline::{Outline, on_grid};
use crate::math::{DAffine3, DVec3};
use crate::scene::{Camera, Projection, Settings};

/// Share of the picture's shorter side that stays free on each side of the model.
const MARGIN: f64 = 0.1;

/// A camera and where it looks, relative to the outline's coordinates.
pub(super) struct Framed {
    pub camera: Camera,
    /// The middle of the model.
    pub target: DVec3,
}

/// Half the picture that the model may fill, as tangents, across and up.
fn tangents(options: &StageOptions, settings: &Settings) -> [f64; 2] {
    let of_scene = match (settings.width, settings.height) {
        (Some(w), Some(h)) if w > 0 && h > 0 => f64::from(w) / f64::from(h),
        _ => 16.0 / 9.0,
    };
    let aspect = options.aspect.unwrap_or(of_scene).clamp(1e-3, 1e3);
    let half = (options.vfov_degrees.to_radians() / 2.0).tan();
    let shorter = aspect.min(1.0);
    [half * (aspect - 2.0 * MARGIN * shorter), half * (1.0 - 2.0 * MARGIN * shorter)]
}

/// The nearest camera in the wanted direction that sees the whole model with even margins.
pub(super) fn frame(outline: &Outline, options: &StageOptions, settings: &Settings) -> Framed {
    let axes = options.view.axes();
    let center = outline.center();
    let points: Vec<DVec3> = match options.is_orbit {
        false => outline.points.iter().map(|&p| axes.transpose() * (p - center)).collect(),
        true => swept(outline).into_iter().map(|p| axes.transpose() * p).collect(),
    };
    let size = outline.radius();
    let local = fit(&points, tangents(options, settings), size);
    let eye = on_grid(center + axes * local, size);
    let vfov_rad = 2.0 * ((options.vfov_degrees.to_radians() / 2.0).tan() / options.zoom).atan();
    let world_from_camera = DAffine3::from_mat3_translation(axes, eye);
    let camera = Camera {
        name: "default".to_string(),
        world_from_camera,
        projection: Projection::Perspective { vfov_rad },
        aspect_ratio: None,
        pixel_aspect: 1.0,
        lens: None,
        shift: [0.0; 2],
        clip: None,
        motion: None,
    };
    Framed { camera, target: on_grid(center, size) }
}

/// The outline's points, turned about the vertical axis through its middle in 48 steps.
fn swept(outline: &Outline) -> Vec<DVec3> {
    let center = outline.center();
    // All that counts is how far points are from the axis, at each height.
    const HEIGHTS: usize = 128;
    let height = (outline.max.y - outline.min.y).max(1e-300);
    let mut rings: Vec<Option<DVec3>> = vec![None; HEIGHTS];
    let away = |p: DVec3| p.x.hypot(p.z);
    for p in outline.points.iter().map(|&p| p - center) {
        let at = (((p.y / height + 0.5) * HEIGHTS as f64) as usize).min(HEIGHTS - 1);
        if rings[at].is_none_or(|before| away(p) > away(before)) {
            rings[at] = Some(p);
        }
    }
    let turned = |p: DVec3| {
        (0..48).map(move |i| {
            let (s, c) = (f64::from(i) / 48.0 * std::f64::consts::TAU).sin_cos();
            DVec3::new(away(p) * c, p.y, away(p) * s)
        })
    };
    rings.into_iter().flatten().flat_map(turned).collect()
}

/// The eye from which points, given by right, up and back, fill a picture of half these tangents.
///
/// For an eye (x, y, z) a point p is within the tangent t if p.x - x and x - p.x are at most t (z - p.z): four planes, each
/// of which bounds a sum of the eye's coordinates by a maximum over all points. The direction that binds decides z; in the
/// other the model is moved to the middle.
fn fit(points: &[DVec3], [tan_x, tan_y]: [f64; 2], size: f64) -> DVec3 {
    let most = |value: &dyn Fn(&DVec3) -> f64| points.iter().map(value).fold(f64::NEG_INFINITY, f64::max);
    let bound = |axis: usize, tan: f64| {
        let high = most(&|p| p[axis] + tan * p.z);
        let low = most(&|p| -p[axis] + tan * p.z);
        (high + low) / (2.0 * tan)
    };
    let nearest = most(&|p| p.z) + 0.05 * size;
    let z = bound(0, tan_x).max(bound(1, tan_y)).max(nearest);
    DVec3::new(middle(points, 0, z), middle(points, 1, z), z)
}

/// Where the eye must be along an axis for the picture of the points to lie in the middle.
fn middle(points: &[DVec3], axis: usize, z: f64) -> f64 {
    let off_middle = |eye: f64| {
        let slopes = points.iter().map(|p| (p[axis] - eye) / (z - p.z));
        let (low, high) =
            slopes.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), s| (low.min(s), high.max(s)));
        low + high
    };
    let ends = points.iter().map(|p| p[axis]);
    let (mut low, mut high) =
        ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    for _ in 0..60 {
        let eye = 0.5 * (low + high);
        if off_middle(eye) > 0.0 { low = eye } else { high = eye }
    }
    0.5 * (low + high)
}
