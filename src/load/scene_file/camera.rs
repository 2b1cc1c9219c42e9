//! `[camera]`: the thesis's camera, or one of a mesh file.
//!
//! | Key | Meaning | Default |
//! |---|---|---|
//! | `look_from`, `look_at` | position and target | required |
//! | `view_up` | which way is up | `[0, 1, 0]` |
//! | `vfov` | full vertical angle of view, degrees, above 0 and below 180 | 40 |
//! | `aspect_ratio` | width over height | of the picture |
//! | `width`, `height` | picture in pixels; `[render]` has precedence | |
//! | `defocus_angle` | full angle of the cone from a point in focus to the lens's edge, degrees; 0 is a pinhole | 0 |
//! | `focus_distance` | distance of the plane in focus | distance of `look_at` |
//!
//! or `camera = { from = "file.glb", name = "..." }`; without a name the file's first camera.

use super::Build;
use super::assets::Assets;
use super::fields::{Fields, nearest};
use crate::load::framing::looking_at;
use crate::math::DVec3;
use crate::scene::{Camera, Projection, ThinLens};

pub(super) fn read(build: &mut Build, fields: &Fields, assets: &mut Assets) {
    let camera = match fields.string("from") {
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
        None => placed(fields),
    };
    let settings = &mut build.loaded.scene.settings;
    let (width, height) = (fields.integer("width", 1, 65_536), fields.integer("height", 1, 65_536));
    settings.width = settings.width.or(width);
    settings.height = settings.height.or(height);
    fields.finish();
    build.loaded.scene.cameras = camera.into_iter().collect();
}

fn placed(fields: &Fields) -> Option<Camera> {
    let eye = fields.require("look_from", fields.vector("look_from"));
    let target = fields.require("look_at", fields.vector("look_at"));
    let up = fields.vector("view_up").map_or(DVec3::Y, |v| v.value);
    let vfov = fields.number_in("vfov", 1e-3..179.999, 40.0);
    let aspect_ratio = fields.has("aspect_ratio").then(|| fields.number_in("aspect_ratio", 1e-4..1e4, 1.0));
    let defocus_angle = fields.number_in("defocus_angle", 0.0..179.0, 0.0);
    let focus =
        fields.has("focus_distance").then(|| fields.number_in("focus_distance", 1e-9..f64::INFINITY, 1.0));
    let (eye, target) = (eye?, target?.value);
    let placement = looking_at(eye.value, target, up);
    if !placement.is_finite() {
        let message = "the camera has no direction: 'look_from' and 'look_at' coincide, or 'view_up' points along the view";
        fields.problems.push(eye.span, message);
        return None;
    }
    let focus_distance = focus.unwrap_or_else(|| eye.value.distance(target));
    let lens = ThinLens { defocus_angle_rad: defocus_angle.to_radians(), focus_distance };
    Some(Camera {
        name: "camera".to_string(),
        world_from_camera: placement,
        projection: Projection::Perspective { vfov_rad: vfov.to_radians() },
        aspect_ratio,
        lens: (defocus_angle > 0.0).then_some(lens),
    })
}
