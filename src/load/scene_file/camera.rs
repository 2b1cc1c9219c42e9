//! `[camera]`: position, target and lens, a transform and lens, or a camera of a mesh file. Several cameras are tables
//! `[[camera]]`, each with a name; the first is rendered, or that of `--camera NAME`.
//!
//! | Key | Meaning | Default |
//! |---|---|---|
//! | `name` | its name | `"camera"` |
//! | `look_from`, `look_at` | position and target | required |
//! | `view_up` | up vector | `[0, 1, 0]` |
//! | `transform` | instead of these three: steps as for objects (see `transform`), applied to a camera at the origin that looks along -z, with y up; scale has no effect | |
//! | `vfov` | full vertical angle of view, degrees, above 0 and below 180 | 40 |
//! | `aspect_ratio` | width over height | of the picture, or of the panorama's angles |
//! | `pixel_aspect` | width over height of a pixel, 0.001 to 1000, for television and anamorphic pictures; `vfov` is kept; 1 for panoramas | 1 |
//! | `width`, `height` | resolution, pixels; `[render]` has precedence | |
//! | `defocus_angle` | depth of field: full angle of the cone from a point in focus to the lens's edge, degrees; 0 is a pinhole | 0 |
//! | `f_stop` | instead: focal length over the diameter of the lens, with `focal_length` in millimetres (50) | |
//! | `focus_distance` | distance of the plane of focus | distance of `look_at` |
//! | `focus_at` | instead: a point of the plane of focus | |
//! | `blades`, `blade_rotation` | bokeh: a polygon of 3 to 256 sides, and its counter-clockwise rotation, degrees | round, 0 |
//! | `aperture_ratio` | anamorphic bokeh: height over width of the aperture | 1 |
//! | `shift` | lens shift `[x, y]`: the frame moves right and up by these multiples of the picture's height, its content left and down, as in Blender; vertical lines stay parallel | `[0, 0]` |
//! | `clip` | `[near, far]` clipping distances for camera rays, from the camera's plane (panoramas: from the camera), metres, as in Blender; clipped objects still cast shadows and appear in mirrors | none |
//! | `shutter` | shutter time for motion blur, frames, 0 to 1000; `--shutter` has precedence | 0 |
//! | `shutter_position` | `"centre"`: centred on the frame; `"start"`: opens at the frame; `"end"`: closes at the frame | `"centre"` |
//! | `motion` | animation of the camera, see `motion` | none |
//!
//! or `camera = { from = "file.glb", name = "..." }`: a camera of a mesh file, without `name` its first. It may also have the lens keys,
//! `shift`, `clip`, `pixel_aspect` and `motion`; `defocus_angle` and `f_stop` then need `focus_distance` or `focus_at`.
//!
//! Projections:
//!
//! | Projection | Meaning | Default |
//! |---|---|---|
//! | `type` | `"perspective"`; `"orthographic"`: parallel rays; `"panorama"`: see `projection` | `"perspective"`, or the model's |
//! | `view_height` | orthographic: visible height, metres | required |
//! | `projection` | panorama: `"equirectangular"`: longitude and latitude along the edges; `"fisheye_equidistant"`: an ellipse that fits into the picture, with radius proportional to the angle from the axis; `"fisheye_equisolid"`: each pixel covers the same solid angle | `"equirectangular"` |
//! | `longitude`, `latitude` | equirectangular: angles at the left and right, and at the lower and upper edge, degrees; 0 is ahead, positive is right and up | `[-180, 180]`, `[-90, 90]` |
//! | `fov` | fisheye: full angle of view, degrees, up to 360; beyond it the picture is black | 180 |
//! | `fisheye_lens`, `sensor` | fisheye_equisolid: focal length, and width and height of the sensor, millimetres | 10.5, `[36, 24]` |
//!
//! The lens of a panorama faces the direction of each pixel: points at `focus_distance` from the camera are in focus, and the
//! aperture is round (no `blades`, no `aperture_ratio`). Depth is the distance from the camera.

use super::assets::Assets;
use super::builder::SceneFileBuilder;
use super::fields::{Fields, number, suggestion};
use super::transform;
use crate::load::{MAX_SHUTTER_FRAMES, ShutterOptions, ShutterPosition};
use crate::math::{DAffine3, DVec3};
use crate::scene::{Aperture, Camera, Panorama, Projection, ThinLens, looking_at, without_scale};
use std::ops::Range;

/// Reads the camera of a scene file.
pub(super) fn read(build: &mut SceneFileBuilder, fields: &Fields, assets: &mut Assets) {
    let camera = read_with_motion(build, fields, assets);
    finish(build, fields);
    build.loaded.scene.cameras.extend(camera);
}

/// Reads a `[camera]` of a sidecar: a new camera, or changes to the model's cameras.
pub(super) fn adjust(build: &mut SceneFileBuilder, fields: &Fields, assets: &mut Assets) {
    if ["look_from", "transform", "from"].into_iter().any(|key| fields.has(key)) {
        let camera = read_with_motion(build, fields, assets);
        finish(build, fields);
        build.loaded.scene.cameras.splice(0..0, camera);
        return;
    }
    let name = fields.string("name");
    let cameras = &mut build.loaded.scene.cameras;
    let mut found = false;
    let (frame, projection) = (Frame::read(fields), read_projection(fields));
    if fields.flag("default", false)
        && let Some(at) = cameras.iter().position(|c| name.as_ref().is_none_or(|n| n.value == c.name))
    {
        cameras[..=at].rotate_right(1);
    }
    for camera in cameras.iter_mut().filter(|c| name.as_ref().is_none_or(|n| n.value == c.name)) {
        found = true;
        // Lens problems are the same for every camera: report them once.
        let Some(lens) = lens(fields, &camera.world_from_camera, None) else { break };
        camera.lens = lens.or(camera.lens);
        frame.apply_to(camera);
        change_projection(camera, projection);
    }
    if !found {
        match name {
            Some(name) => {
                let message = format!("the model has no camera '{}'", name.value);
                let names = cameras.iter().map(|c| c.name.as_str());
                let help = suggestion(name.value, names, format!("it has {} cameras", cameras.len()));
                fields.problems.push_help(name.span, message, help);
            }
            None => fields
                .report_help("the model has no camera to adjust", "place one by 'look_from' and 'look_at'"),
        }
        // Marks the lens keys as known.
        lens(fields, &DAffine3::IDENTITY, Some(1.0));
    }
    finish(build, fields);
}

/// Reads the picture's size and ends the table.
fn finish(build: &mut SceneFileBuilder, fields: &Fields) {
    let settings = &mut build.loaded.scene.settings;
    let (width, height) = (fields.unsigned("width", 1, 65_536), fields.unsigned("height", 1, 65_536));
    settings.width = settings.width.or(width);
    settings.height = settings.height.or(height);
    check_shutter(fields);
    fields.finish();
}

/// The camera with its motion.
fn read_with_motion(build: &mut SceneFileBuilder, fields: &Fields, assets: &mut Assets) -> Option<Camera> {
    let camera = read_camera(build, fields, assets);
    let may_scale = fields.has("transform");
    let motion = match may_scale {
        true => transform::read_motion(build, fields, "the camera"),
        false => transform::rigid_motion(build, fields, "the camera"),
    };
    let (Some(motion), Some(mut camera)) = (&motion, camera.clone()) else { return camera };
    if camera.motion.is_some() {
        fields.report("this camera is animated in its file: leave 'motion' out");
    }
    let (now, keyframes) = transform::with_motion(camera.world_from_camera, Some(motion));
    camera.world_from_camera = if may_scale { without_scale(&now).unwrap_or(now) } else { now };
    camera.motion = keyframes.map(|keys| match may_scale {
        true => keys.map(|key| without_scale(key).unwrap_or(now)),
        false => keys,
    });
    Some(camera)
}

/// The camera of the file `from`, or one placed by the other keys.
fn read_camera(build: &mut SceneFileBuilder, fields: &Fields, assets: &mut Assets) -> Option<Camera> {
    let mut camera = match fields.string("from") {
        Some(file) => {
            let name = fields.string("name");
            let cameras = assets.cameras(build, file.value, file.span.clone());
            match name {
                _ if cameras.is_none() => None,
                Some(name) => {
                    let cameras = cameras.unwrap_or_default();
                    let found = cameras.iter().find(|c| c.name == name.value).cloned();
                    if found.is_none() {
                        let names = cameras.iter().map(|c| c.name.as_str());
                        let default = format!("the file has {} cameras", cameras.len());
                        let help = suggestion(name.value, names, default);
                        let message = format!("'{}' has no camera '{}'", file.value, name.value);
                        fields.problems.push_help(name.span, message, help);
                    }
                    found
                }
                None => {
                    let first = cameras.unwrap_or_default().into_iter().next();
                    if first.is_none() {
                        fields.problems.push(file.span, format!("'{}' has no camera", file.value));
                    }
                    first
                }
            }
        }
        None => return placed_camera(fields),
    }?;
    Frame::read(fields).apply_to(&mut camera);
    change_projection(&mut camera, read_projection(fields));
    camera.lens = lens(fields, &camera.world_from_camera, None)?.or(camera.lens);
    Some(camera)
}

/// Pixel aspect, lens shift and clipping; unset keys keep the camera's values.
struct Frame {
    pixel_aspect: Option<f64>,
    shift: Option<[f64; 2]>,
    clip: Option<[f64; 2]>,
}

impl Frame {
    fn read(fields: &Fields) -> Frame {
        let has_aspect = fields.has("pixel_aspect");
        Frame {
            pixel_aspect: has_aspect.then(|| fields.number_in("pixel_aspect", 1e-3..1e3, 1.0)),
            shift: shift(fields),
            clip: clip(fields),
        }
    }

    fn apply_to(&self, camera: &mut Camera) {
        camera.pixel_aspect = self.pixel_aspect.unwrap_or(camera.pixel_aspect);
        camera.shift = self.shift.unwrap_or(camera.shift);
        camera.clip = self.clip.or(camera.clip);
    }
}

/// Clipping distances.
fn clip(fields: &Fields) -> Option<[f64; 2]> {
    let clip = fields.numbers::<2>("clip")?;
    let [near, far] = clip.value;
    if !(near >= 0.0 && far > near && far <= 1e18) {
        fields.problems.push(clip.span, "'clip' must be two distances, metres: 0 <= near < far");
        return None;
    }
    Some(clip.value)
}

/// Lens shift in image heights.
fn shift(fields: &Fields) -> Option<[f64; 2]> {
    let shift = fields.numbers::<2>("shift")?;
    if shift.value.iter().any(|s| s.abs() > 1e3) {
        fields.problems.push(shift.span, "'shift' must be at most 1000 picture heights");
        return None;
    }
    Some(shift.value)
}

/// Reads the lens: `Some(None)` is a pinhole, `None` follows a reported problem. `focus` is the default focus distance,
/// metres.
fn lens(fields: &Fields, world_from_camera: &DAffine3, focus: Option<f64>) -> Option<Option<ThinLens>> {
    let distance =
        fields.has("focus_distance").then(|| fields.number_in("focus_distance", 1e-9..f64::INFINITY, 1.0));
    let point = fields.vector("focus_at");
    let angle = fields.has("defocus_angle").then(|| fields.number_in("defocus_angle", 0.0..179.0, 0.0));
    let f_stop = fields.has("f_stop").then(|| fields.number_in("f_stop", 1e-3..1e6, 8.0));
    let focal_length = fields.number_in("focal_length", 1e-3..1e6, 50.0) / 1000.0;
    let aperture = aperture(fields);
    let to_point = match &point {
        Some(p) => {
            let depth = -world_from_camera.inverse().transform_point3(p.value).z;
            if depth <= 0.0 {
                fields.problems.push(p.span.clone(), "'focus_at' lies behind the camera");
                return None;
            }
            Some(depth)
        }
        None => None,
    };
    let fail = |message: &str| {
        fields.report(message);
        None
    };
    if !fields.exclusive(["focus_distance", "focus_at"]) || !fields.exclusive(["defocus_angle", "f_stop"]) {
        return None;
    }
    if f_stop.is_none() && fields.has("focal_length") {
        return fail("'focal_length' needs 'f_stop'");
    }
    if angle.is_none() && f_stop.is_none() && (distance.is_some() || point.is_some()) {
        return fail("a plane of focus needs a lens size: add 'defocus_angle' or 'f_stop'");
    }
    let aperture_key = ["blades", "blade_rotation", "aperture_ratio"].into_iter().find(|key| fields.has(key));
    if let (None, None, Some(key)) = (angle, f_stop, aperture_key) {
        return fail(&format!("'{key}' needs a lens size: add 'defocus_angle' or 'f_stop'"));
    }
    if angle.is_none() && f_stop.is_none() || angle == Some(0.0) {
        return Some(None);
    }
    let Some(focus_distance) = distance.or(to_point).or(focus) else {
        return fail("depth of field needs 'focus_distance' or 'focus_at'");
    };
    let defocus_angle_rad = match f_stop {
        Some(stop) => 2.0 * (focal_length / (2.0 * stop) / focus_distance).atan(),
        None => angle.unwrap_or(0.0).to_radians(),
    };
    Some(Some(ThinLens { defocus_angle_rad, focus_distance, aperture }))
}

/// The shape of the aperture.
fn aperture(fields: &Fields) -> Aperture {
    Aperture {
        blades: fields.unsigned("blades", 3, 256).unwrap_or(0),
        rotation_rad: fields.number_in("blade_rotation", -1e6..1e6, 0.0).to_radians(),
        ratio: fields.number_in("aperture_ratio", 1e-3..1e3, 1.0),
    }
}

/// The keys of [`lens`] and [`aperture`].
const LENS_KEYS: [&str; 8] = [
    "focus_distance",
    "focus_at",
    "defocus_angle",
    "f_stop",
    "focal_length",
    "blades",
    "blade_rotation",
    "aperture_ratio",
];

/// A camera placed by `transform`, or by `look_from` and `look_at`.
fn placed_camera(fields: &Fields) -> Option<Camera> {
    fields.mark_known(&LENS_KEYS);
    let placement =
        if fields.has("transform") { placement_by_transform(fields) } else { placement_by_target(fields) };
    let name = fields.string("name").map_or("camera", |name| name.value).to_string();
    let projection = match fields.has("type") {
        true => read_projection(fields),
        false => Some(perspective(fields)),
    };
    let aspect_ratio = fields.has("aspect_ratio").then(|| fields.number_in("aspect_ratio", 1e-4..1e4, 1.0));
    let frame = Frame::read(fields);
    let ((world_from_camera, focus), projection) = (placement?, projection?);
    let lens = lens(fields, &world_from_camera, focus)?;
    let aspect_ratio = aspect_ratio.or(projection_aspect_ratio(&projection));
    let mut camera = Camera { name, aspect_ratio, lens, ..Camera::new(world_from_camera, projection) };
    frame.apply_to(&mut camera);
    Some(camera)
}

/// The placement of a camera by `transform`, without a default focus distance.
fn placement_by_transform(fields: &Fields) -> Option<(DAffine3, Option<f64>)> {
    if let Some(key) = ["look_from", "look_at", "view_up"].into_iter().find(|key| fields.has(key)) {
        fields.report(format!("'transform' and '{key}' exclude each other: keep one"));
    }
    without_scale(&transform::read(fields)).map(|placement| (placement, None))
}

/// The placement of a camera by `look_from`, `look_at` and `view_up`, and its default focus distance, metres.
fn placement_by_target(fields: &Fields) -> Option<(DAffine3, Option<f64>)> {
    let eye = fields.require("look_from", fields.vector("look_from"));
    let target = fields.require("look_at", fields.vector("look_at"));
    let up = fields.vector("view_up").map(|v| v.value);
    let (eye, target) = (eye?, target?.value);
    // Without 'view_up', cameras that look straight up or down have -z as up vector.
    let ups = up.map_or([DVec3::Y, DVec3::NEG_Z], |up| [up; 2]);
    let placement = ups.into_iter().find_map(|up| looking_at(eye.value, target, up));
    if placement.is_none() {
        let message = match eye.value == target {
            true => "the camera has no direction: 'look_from' and 'look_at' coincide",
            false => "'view_up' is parallel to the view direction",
        };
        fields.problems.push(eye.span, message);
    }
    Some((placement?, Some(eye.value.distance(target))))
}

#[derive(Clone, Copy)]
enum PanoramaType {
    Equirectangular,
    Equidistant,
    Equisolid,
}

#[derive(Clone, Copy, PartialEq)]
enum ProjectionType {
    Perspective,
    Orthographic,
    Panorama,
}

/// The projection of a table with `type`. Without `type` no key is read.
fn read_projection(fields: &Fields) -> Option<Projection> {
    let types = [
        ("perspective", ProjectionType::Perspective),
        ("orthographic", ProjectionType::Orthographic),
        ("panorama", ProjectionType::Panorama),
    ];
    match fields.choice("type", &types)? {
        ProjectionType::Perspective => Some(perspective(fields)),
        ProjectionType::Orthographic => {
            fields.require("view_height", fields.number("view_height"))?;
            Some(Projection::Orthographic {
                half_height: 0.5 * fields.number_in("view_height", 1e-6..1e12, 1.0),
            })
        }
        ProjectionType::Panorama => {
            let panorama = panorama(fields)?;
            has_round_aperture(fields).then_some(Projection::Panorama(panorama))
        }
    }
}

/// A perspective projection with the angle `vfov`.
pub(super) fn perspective(fields: &Fields) -> Projection {
    Projection::Perspective { vfov_rad: fields.number_in("vfov", 1e-3..179.999, 40.0).to_radians() }
}

/// Replaces the projection of a model's camera, if there is one.
pub(super) fn change_projection(camera: &mut Camera, projection: Option<Projection>) {
    let Some(projection) = projection else { return };
    camera.projection = projection;
    camera.aspect_ratio = projection_aspect_ratio(&projection).or(camera.aspect_ratio);
}

/// Width over height of a panorama; `None` for other projections.
pub(super) fn projection_aspect_ratio(projection: &Projection) -> Option<f64> {
    match projection {
        Projection::Panorama(panorama) => Some(panorama.aspect_ratio()),
        _ => None,
    }
}

/// Reports the keys of non-round apertures, which panoramas don't support.
fn has_round_aperture(fields: &Fields) -> bool {
    let Some(key) = ["blades", "blade_rotation", "aperture_ratio"].into_iter().find(|key| fields.has(key))
    else {
        return true;
    };
    fields.report_help(format!("panoramas have a round aperture: '{key}' has no effect"), "leave it out");
    false
}

fn panorama(fields: &Fields) -> Option<Panorama> {
    let kinds = [
        ("equirectangular", PanoramaType::Equirectangular),
        ("fisheye_equidistant", PanoramaType::Equidistant),
        ("fisheye_equisolid", PanoramaType::Equisolid),
    ];
    let kind = match fields.has("projection") {
        true => fields.choice("projection", &kinds)?,
        false => PanoramaType::Equirectangular,
    };
    Some(match kind {
        PanoramaType::Equirectangular => Panorama::Equirectangular {
            longitude_rad: angle_range(fields, "longitude", 180.0)?,
            latitude_rad: angle_range(fields, "latitude", 90.0)?,
        },
        PanoramaType::Equidistant => Panorama::FisheyeEquidistant { fov_rad: fov(fields) },
        PanoramaType::Equisolid => {
            let size = 1e-3..1e6;
            let sensor = fields.numbers::<2>("sensor");
            if let Some(wrong) = sensor.as_ref().filter(|s| !s.value.iter().all(|v| size.contains(v))) {
                fields
                    .problems
                    .push(wrong.span.clone(), "'sensor' must be a width and a height, millimetres");
                return None;
            }
            Panorama::FisheyeEquisolid {
                fov_rad: fov(fields),
                focal_length: fields.number_in("fisheye_lens", size, 10.5),
                sensor: sensor.map_or([36.0, 24.0], |s| s.value),
            }
        }
    })
}

fn fov(fields: &Fields) -> f64 {
    fields.number_in("fov", FOV_DEGREES, 180.0).to_radians()
}

/// Range of a fisheye's angle of view, degrees.
const FOV_DEGREES: Range<f64> = 1e-3..360.0;

/// Minimum extent of an equirectangular panorama, degrees.
const MIN_EXTENT_DEGREES: f64 = 1e-3;

/// Two ascending angles within -`max` to `max` degrees, in radians; the whole range without the key.
fn angle_range(fields: &Fields, key: &'static str, max: f64) -> Option<[f64; 2]> {
    let Some(angles) = fields.numbers::<2>(key) else {
        return (!fields.has(key)).then_some([-max, max].map(f64::to_radians));
    };
    let [from, to] = angles.value;
    if !(-max <= from && to <= max && to - from >= MIN_EXTENT_DEGREES) {
        let message = format!("'{key}' must be two ascending angles from -{max} to {max} degrees");
        fields.problems.push(angles.span, message);
        return None;
    }
    Some([from, to].map(f64::to_radians))
}

/// The shutter options of the user, else of `[camera]`. Needed before objects are read; problems are reported when the
/// camera is read.
pub(super) fn shutter_options(options: ShutterOptions, root: &Fields) -> ShutterOptions {
    let options = ShutterOptions { vectors: options.vectors || requests_motion_vectors(root), ..options };
    let Some(camera) = root.raw("camera").map(|v| v.get_ref()) else { return options };
    let list = camera.as_array().into_iter().flat_map(|list| list.iter().map(|v| v.get_ref()));
    let tables = [camera].into_iter().chain(list).filter_map(|v| v.as_table());
    tables.fold(options, |options, table| {
        let frames = table.get("shutter").and_then(|v| number(v.get_ref()));
        let position = table.get("shutter_position").and_then(|v| v.get_ref().as_str());
        let position = position.and_then(ShutterPosition::from_name);
        let frames = frames.filter(|f| (0.0..=MAX_SHUTTER_FRAMES).contains(f));
        options.or(frames, position)
    })
}

/// Whether motion vectors are among the AOVs of `[render]`.
fn requests_motion_vectors(root: &Fields) -> bool {
    let aovs = root.raw("render").and_then(|v| v.get_ref().as_table()?.get("aovs")?.get_ref().as_array());
    let mut names = aovs.into_iter().flat_map(|list| list.iter()).filter_map(|v| v.get_ref().as_str());
    names.any(|name| name == "motion" || name == "all")
}

/// Reports problems of the shutter keys.
fn check_shutter(camera: &Fields) {
    camera.number_in("shutter", 0.0..MAX_SHUTTER_FRAMES, 0.0);
    camera.choice("shutter_position", &ShutterPosition::NAMED);
}
