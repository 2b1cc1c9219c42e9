//! `[camera]`: a place and what it looks at, or a camera of a mesh file.
//!
//! | Key | Meaning | Default |
//! |---|---|---|
//! | `look_from`, `look_at` | position and target | required |
//! | `view_up` | which way is up | `[0, 1, 0]` |
//! | `vfov` | full vertical angle of view, degrees, above 0 and below 180 | 40 |
//! | `aspect_ratio` | width over height | of the picture, or of all that a panorama shows |
//! | `pixel_aspect` | width over height of a pixel, 0.001 to 1000, for television and anamorphic pictures; `vfov` is kept; 1 for panoramas | 1 |
//! | `width`, `height` | picture in pixels; `[render]` has precedence | |
//! | `defocus_angle` | full angle of the cone from a point in focus to the lens's edge, degrees; 0 is a pinhole | 0 |
//! | `f_stop` | instead: focal length over the diameter of the lens, with `focal_length` in millimetres (50) | |
//! | `focus_distance` | distance of the plane in focus | distance of `look_at` |
//! | `focus_at` | instead: a point of that plane | |
//! | `blades`, `blade_rotation` | instead of a round lens a polygon of 3 to 256 sides; how far it is turned counter-clockwise, degrees | round, 0 |
//! | `aperture_ratio` | height over width of the lens: 2 for the tall discs of wide screens | 1 |
//! | `shift` | lens shift `[x, y]`: the frame moves right and up by these multiples of the picture's height, its content left and down, as in Blender; vertical lines stay parallel | `[0, 0]` |
//! | `clip` | `[near, far]`: the camera sees only what lies between these distances from its plane (of panoramas from itself), metres, as in Blender; the rest still casts shadows and stands in mirrors | all |
//! | `shutter` | how long the shutter is open, frames, 0 to 1000: what moves in that time is blurred; `--shutter` has precedence | 0 |
//! | `shutter_position` | `"centre"`: around the picture's time; `"start"`: from it on; `"end"`: up to it | `"centre"` |
//! | `motion` | how the camera moves on, see `motion` | none |
//!
//! or `camera = { from = "file.glb", name = "..." }`; without a name the file's first camera. The keys of the lens,
//! `shift`, `clip`, `pixel_aspect` and `motion` may follow; `focus_distance` or `focus_at` is then required with `defocus_angle` and `f_stop`.
//!
//! How a camera sees:
//!
//! | Projection | Meaning | Default |
//! |---|---|---|
//! | `type` | `"perspective"`; `"orthographic"`: parallel rays; `"panorama"`: around itself | `"perspective"`, or as the model has it |
//! | `view_height` | orthographic: visible height, metres | required |
//! | `projection` | panorama: `"equirectangular"`: longitude and latitude along the edges; `"fisheye_equidistant"`: an ellipse that fits into the picture, where angles with the axis grow evenly; `"fisheye_equisolid"`: all parts of the picture see equal solid angles | `"equirectangular"` |
//! | `longitude`, `latitude` | equirectangular: angles at the left and right, and at the lower and upper edge, degrees; 0 is ahead, above it lies what is to the right and above | `[-180, 180]`, `[-90, 90]` |
//! | `fov` | fisheye: full angle of view, degrees, up to 360; beyond it the picture is black | 180 |
//! | `fisheye_lens`, `sensor` | fisheye_equisolid: focal length, and width and height of the sensor, millimetres | 10.5, `[36, 24]` |
//!
//! Panoramas have lenses that face every point of the picture, whose `focus_distance` is that of a sphere; they are round (no `blades`,
//! no `aperture_ratio`). Depth is the distance from the camera there.

use super::assets::Assets;
use super::builder::SceneFileBuilder;
use super::fields::{Fields, nearest, number};
use super::transform;
use crate::load::{LONGEST_SHUTTER, ShutterOptions, ShutterPosition};
use crate::math::{DAffine3, DVec3};
use crate::scene::{Aperture, Camera, Panorama, Projection, ThinLens, looking_at};
use std::ops::Range;

/// Reads the camera of a scene file.
pub(super) fn read(build: &mut SceneFileBuilder, fields: &Fields, assets: &mut Assets) {
    let camera = moved(build, fields, assets);
    finish(build, fields);
    build.loaded.scene.cameras = camera.into_iter().collect();
}

/// Reads what the file next to a model says about its cameras.
pub(super) fn adjust(build: &mut SceneFileBuilder, fields: &Fields, assets: &mut Assets) {
    if fields.has("look_from") || fields.has("from") {
        let camera = moved(build, fields, assets);
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
        // Its problems are the same for every camera: once is enough.
        let Some(lens) = lens(fields, &camera.world_from_camera, None) else { break };
        camera.lens = lens.or(camera.lens);
        frame.apply_to(camera);
        change_projection(camera, projection);
    }
    if !found {
        match name {
            Some(name) => {
                let message = format!("the model has no camera '{}'", name.value);
                let help = match nearest(name.value, cameras.iter().map(|c| c.name.as_str())) {
                    Some(near) => format!("did you mean '{near}'?"),
                    None => format!("it has {} cameras", cameras.len()),
                };
                fields.problems.push_help(name.span, message, help);
            }
            None => fields.problems.push_help(
                fields.span(),
                "the model has no camera to adjust",
                "place one by 'look_from' and 'look_at'",
            ),
        }
        // The keys are known all the same.
        lens(fields, &DAffine3::IDENTITY, Some(1.0));
    }
    finish(build, fields);
}

/// Reads the picture's size and ends the table.
fn finish(build: &mut SceneFileBuilder, fields: &Fields) {
    let settings = &mut build.loaded.scene.settings;
    let (width, height) = (fields.integer("width", 1, 65_536), fields.integer("height", 1, 65_536));
    settings.width = settings.width.or(width);
    settings.height = settings.height.or(height);
    check_shutter(fields);
    fields.finish();
}

/// The camera at the picture's time, and its motion.
fn moved(build: &mut SceneFileBuilder, fields: &Fields, assets: &mut Assets) -> Option<Camera> {
    let camera = chosen(build, fields, assets);
    let Some(moved) = transform::rigid_motion(build, fields, "the camera") else { return camera };
    let mut camera = camera?;
    if camera.motion.is_some() {
        let message = "this camera is moved by its file: leave 'motion' out";
        fields.problems.push(fields.span(), message);
    }
    let world_from_camera = moved.at_time * camera.world_from_camera;
    camera.world_from_camera = world_from_camera;
    camera.motion = moved.onwards.map(|onwards| onwards.map(|by| *by * world_from_camera));
    Some(camera)
}

/// The camera of a file, or the one that the table places.
fn chosen(build: &mut SceneFileBuilder, fields: &Fields, assets: &mut Assets) -> Option<Camera> {
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
                        let help = match nearest(name.value, cameras.iter().map(|c| c.name.as_str())) {
                            Some(near) => format!("did you mean '{near}'?"),
                            None => format!("the file has {} cameras", cameras.len()),
                        };
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
        None => return placed(fields),
    }?;
    Frame::read(fields).apply_to(&mut camera);
    change_projection(&mut camera, read_projection(fields));
    camera.lens = lens(fields, &camera.world_from_camera, None)?.or(camera.lens);
    Some(camera)
}

/// Shift, clipping and size; unset keys leave the camera as it is.
struct Frame {
    pixel_aspect: Option<f64>,
    shift: Option<[f64; 2]>,
    clip: Option<[f64; 2]>,
}

impl Frame {
    fn read(fields: &Fields) -> Frame {
        let is_said = fields.has("pixel_aspect");
        Frame {
            pixel_aspect: is_said.then(|| fields.number_in("pixel_aspect", 1e-3..1e3, 1.0)),
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
        fields
            .problems
            .push(clip.span, "'clip' must be two distances, the first from 0 and the second beyond it");
        return None;
    }
    Some(clip.value)
}

/// Lens shift in image heights.
fn shift(fields: &Fields) -> Option<[f64; 2]> {
    let shift = fields.numbers::<2>("shift")?;
    if shift.value.iter().any(|s| s.abs() > 1e3) {
        fields.problems.push(shift.span, "'shift' must be at most 1000 heights of the picture");
        return None;
    }
    Some(shift.value)
}

/// The keys of the lens; `None` if they have a problem, and none inside for a pinhole. `focus` is the distance of the
/// plane in focus where the table doesn't say.
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
    let complain = |message: &str| {
        fields.problems.push(fields.span(), message);
        None
    };
    if point.is_some() && distance.is_some() {
        return complain("'focus_distance' and 'focus_at' say the same: leave one out");
    }
    if angle.is_some() && f_stop.is_some() {
        return complain("'defocus_angle' and 'f_stop' say the same: leave one out");
    }
    if f_stop.is_none() && fields.has("focal_length") {
        return complain("'focal_length' needs 'f_stop'");
    }
    if angle.is_none() && f_stop.is_none() && (distance.is_some() || point.is_some()) {
        return complain("a plane in focus needs the size of the lens: add 'defocus_angle' or 'f_stop'");
    }
    let shaped = ["blades", "blade_rotation", "aperture_ratio"].into_iter().find(|key| fields.has(key));
    if let (None, None, Some(key)) = (angle, f_stop, shaped) {
        return complain(&format!("'{key}' needs the size of the lens: add 'defocus_angle' or 'f_stop'"));
    }
    if angle.is_none() && f_stop.is_none() || angle == Some(0.0) {
        return Some(None);
    }
    let Some(focus_distance) = distance.or(to_point).or(focus) else {
        return complain("depth of field needs 'focus_distance' or 'focus_at'");
    };
    let defocus_angle_rad = match f_stop {
        Some(stop) => 2.0 * (focal_length / (2.0 * stop) / focus_distance).atan(),
        None => angle.unwrap_or(0.0).to_radians(),
    };
    Some(Some(ThinLens { defocus_angle_rad, focus_distance, aperture }))
}

/// The shape of the lens.
fn aperture(fields: &Fields) -> Aperture {
    Aperture {
        blades: fields.integer("blades", 3, 256).unwrap_or(0),
        rotation_rad: fields.number_in("blade_rotation", -1e6..1e6, 0.0).to_radians(),
        ratio: fields.number_in("aperture_ratio", 1e-3..1e3, 1.0),
    }
}

/// The keys of [`lens`] and [`aperture`].
const KEYS_OF_LENS: [&str; 8] = [
    "focus_distance",
    "focus_at",
    "defocus_angle",
    "f_stop",
    "focal_length",
    "blades",
    "blade_rotation",
    "aperture_ratio",
];

fn placed(fields: &Fields) -> Option<Camera> {
    fields.know(&KEYS_OF_LENS);
    let eye = fields.require("look_from", fields.vector("look_from"));
    let target = fields.require("look_at", fields.vector("look_at"));
    let up = fields.vector("view_up").map(|v| v.value);
    let projection = match fields.has("type") {
        true => read_projection(fields),
        false => Some(perspective(fields)),
    };
    let aspect_ratio = fields.has("aspect_ratio").then(|| fields.number_in("aspect_ratio", 1e-4..1e4, 1.0));
    let frame = Frame::read(fields);
    let (eye, target, projection) = (eye?, target?.value, projection?);
    // A camera that looks straight up or down has y along the view: the picture's top is where -z is then.
    let ups = up.map_or([DVec3::Y, DVec3::NEG_Z], |up| [up; 2]);
    let Some(placement) = ups.into_iter().find_map(|up| looking_at(eye.value, target, up)) else {
        let message = match eye.value == target {
            true => "the camera has no direction: 'look_from' and 'look_at' coincide",
            false => "the camera has no upright: 'view_up' is parallel to the view direction",
        };
        fields.problems.push(eye.span, message);
        return None;
    };
    let lens = lens(fields, &placement, Some(eye.value.distance(target)))?;
    let mut camera = Camera {
        name: "camera".to_string(),
        world_from_camera: placement,
        projection,
        aspect_ratio: aspect_ratio.or(projection_aspect_ratio(&projection)),
        pixel_aspect: 1.0,
        lens,
        shift: [0.0; 2],
        clip: None,
        motion: None,
    };
    frame.apply_to(&mut camera);
    Some(camera)
}

/// The kinds of panoramas, by what they are with the other keys of a table.
#[derive(Clone, Copy)]
enum CameraType {
    Equirectangular,
    Equidistant,
    Equisolid,
}

#[derive(Clone, Copy, PartialEq)]
enum Type {
    Perspective,
    Orthographic,
    Panorama,
}

/// The projection of a table, if it has one; else the keys of a perspective are unread.
fn read_projection(fields: &Fields) -> Option<Projection> {
    let types = [
        ("perspective", Type::Perspective),
        ("orthographic", Type::Orthographic),
        ("panorama", Type::Panorama),
    ];
    match fields.choice("type", &types)? {
        Type::Perspective => Some(perspective(fields)),
        Type::Orthographic => {
            fields.require("view_height", fields.number("view_height"))?;
            Some(Projection::Orthographic {
                half_height: 0.5 * fields.number_in("view_height", 1e-6..1e12, 1.0),
            })
        }
        Type::Panorama => {
            let panorama = panorama(fields)?;
            is_round(fields).then_some(Projection::Panorama(panorama))
        }
    }
}

/// The key `vfov`.
pub(super) fn perspective(fields: &Fields) -> Projection {
    Projection::Perspective { vfov_rad: fields.number_in("vfov", 1e-3..179.999, 40.0).to_radians() }
}

/// Sets the projection of a model's camera.
pub(super) fn change_projection(camera: &mut Camera, projection: Option<Projection>) {
    let Some(projection) = projection else { return };
    camera.projection = projection;
    camera.aspect_ratio = projection_aspect_ratio(&projection).or(camera.aspect_ratio);
}

/// Width over height of pictures of a projection, if that says it.
pub(super) fn projection_aspect_ratio(projection: &Projection) -> Option<f64> {
    match projection {
        Projection::Panorama(panorama) => Some(panorama.aspect_ratio()),
        _ => None,
    }
}

/// The lens of a panorama is round.
fn is_round(fields: &Fields) -> bool {
    let Some(key) = ["blades", "blade_rotation", "aperture_ratio"].into_iter().find(|key| fields.has(key))
    else {
        return true;
    };
    let message = format!("'{key}' has no meaning for panoramas, whose lenses are round");
    fields.problems.push_help(fields.span(), message, "leave it out");
    false
}

fn panorama(fields: &Fields) -> Option<Panorama> {
    let kinds = [
        ("equirectangular", CameraType::Equirectangular),
        ("fisheye_equidistant", CameraType::Equidistant),
        ("fisheye_equisolid", CameraType::Equisolid),
    ];
    let kind = match fields.has("projection") {
        true => fields.choice("projection", &kinds)?,
        false => CameraType::Equirectangular,
    };
    Some(match kind {
        CameraType::Equirectangular => Panorama::Equirectangular {
            longitude_rad: limits(fields, "longitude", 180.0)?,
            latitude_rad: limits(fields, "latitude", 90.0)?,
        },
        CameraType::Equidistant => Panorama::FisheyeEquidistant { fov_rad: fov(fields) },
        CameraType::Equisolid => {
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
    fields.number_in("fov", FOVS, 180.0).to_radians()
}

/// Angles of view of fisheyes, degrees.
const FOVS: Range<f64> = 1e-3..360.0;

/// Narrowest part of a panorama, degrees.
const MIN: f64 = 1e-3;

/// Two angles that grow, radians; all that there are without the key.
fn limits(fields: &Fields, key: &'static str, most: f64) -> Option<[f64; 2]> {
    let Some(limits) = fields.numbers::<2>(key) else {
        return (!fields.has(key)).then_some([-most, most].map(f64::to_radians));
    };
    let [from, to] = limits.value;
    if !(-most <= from && to <= most && to - from >= MIN) {
        let message = format!("'{key}' must be two angles that grow, from -{most} to {most} degrees");
        fields.problems.push(limits.span, message);
        return None;
    }
    Some([from, to].map(f64::to_radians))
}

/// The shutter options of the user, else of the camera's table. Needed before objects are read; problems are reported
/// where the camera is.
pub(super) fn shutter_options(options: ShutterOptions, root: &Fields) -> ShutterOptions {
    let options = ShutterOptions { vectors: options.vectors || asks_for_vectors(root), ..options };
    let Some(camera) = root.raw("camera").map(|v| v.get_ref()) else { return options };
    let list = camera.as_array().into_iter().flat_map(|list| list.iter().map(|v| v.get_ref()));
    let tables = [camera].into_iter().chain(list).filter_map(|v| v.as_table());
    tables.fold(options, |options, table| {
        let frames = table.get("shutter").and_then(|v| number(v.get_ref()));
        let position = table.get("shutter_position").and_then(|v| v.get_ref().as_str());
        let named = position.and_then(|name| ShutterPosition::ALL.iter().find(|(known, _)| *known == name));
        let frames = frames.filter(|f| (0.0..=LONGEST_SHUTTER).contains(f));
        options.or(frames, named.map(|(_, position)| *position))
    })
}

/// Are motion vectors among the channels that `[render]` asks for?
fn asks_for_vectors(root: &Fields) -> bool {
    let aovs = root.raw("render").and_then(|v| v.get_ref().as_table()?.get("aovs")?.get_ref().as_array());
    let mut names = aovs.into_iter().flat_map(|list| list.iter()).filter_map(|v| v.get_ref().as_str());
    names.any(|name| name == "motion" || name == "all")
}

/// Reports its problems.
fn check_shutter(camera: &Fields) {
    camera.number_in("shutter", 0.0..LONGEST_SHUTTER, 0.0);
    camera.choice("shutter_position", &ShutterPosition::ALL);
}
