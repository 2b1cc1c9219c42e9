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

use super::fields::Fields;
use crate::scene::{Camera, Panorama, Projection};
use std::ops::Range;

/// The kinds of panoramas, by what they are with the other keys of a table.
#[derive(Clone, Copy)]
enum Kind {
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

/// What a table says about the projection, if it says something; else the keys of a perspective are unread. Tells problems.
pub(super) fn read(fields: &Fields) -> Option<Projection> {
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

/// What `vfov` says.
pub(super) fn perspective(fields: &Fields) -> Projection {
    Projection::Perspective { vfov_rad: fields.number_in("vfov", 1e-3..179.999, 40.0).to_radians() }
}

/// Gives a camera of a model the projection that a table says.
pub(super) fn change(camera: &mut Camera, projection: Option<Projection>) {
    let Some(projection) = projection else { return };
    camera.projection = projection;
    camera.aspect_ratio = aspect_ratio(&projection).or(camera.aspect_ratio);
}

/// Width over height of pictures of a projection, if that says it.
pub(super) fn aspect_ratio(projection: &Projection) -> Option<f64> {
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
        ("equirectangular", Kind::Equirectangular),
        ("fisheye_equidistant", Kind::Equidistant),
        ("fisheye_equisolid", Kind::Equisolid),
    ];
    let kind = match fields.has("projection") {
        true => fields.choice("projection", &kinds)?,
        false => Kind::Equirectangular,
    };
    Some(match kind {
        Kind::Equirectangular => Panorama::Equirectangular {
            longitude_rad: limits(fields, "longitude", 180.0)?,
            latitude_rad: limits(fields, "latitude", 90.0)?,
        },
        Kind::Equidistant => Panorama::FisheyeEquidistant { fov_rad: fov(fields) },
        Kind::Equisolid => {
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
const LEAST: f64 = 1e-3;

/// Two angles that grow, radians; all that there are without the key.
fn limits(fields: &Fields, key: &'static str, most: f64) -> Option<[f64; 2]> {
    let Some(limits) = fields.numbers::<2>(key) else {
        return (!fields.has(key)).then_some([-most, most].map(f64::to_radians));
    };
    let [from, to] = limits.value;
    if !(-most <= from && to <= most && to - from >= LEAST) {
        let message = format!("'{key}' must be two angles that grow, from -{most} to {most} degrees");
        fields.problems.push(limits.span, message);
        return None;
    }
    Some([from, to].map(f64::to_radians))
}
