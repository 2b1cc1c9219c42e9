//! `ies` of points and spots: measured profiles of luminaires.

use super::build::Build;
use super::fields::Fields;
use super::light_traits::positive;
use super::placement::{Placement, direction};
use crate::error::Warning;
use crate::load::ies;
use crate::math::{DAffine3, DMat3, DQuat, DVec3};
use crate::scene::{LightKind, LightProfile, Moving};
use std::f64::consts::PI;
use std::sync::Arc;

/// Heights at which the mean of a profile is taken.
const STEPS: u32 = 256;

/// The profile of a light, with its largest value 1, and the intensity that this is, W/sr; `None` if it has problems.
pub(super) fn read(build: &Build, fields: &Fields) -> Option<(Arc<LightProfile>, f64)> {
    let file = fields.string("ies")?;
    let path = build.beside(file.value);
    build.options.files.note(&path);
    let bytes = std::fs::read(&path).map_err(|e| format!("can't be read: {e}"));
    let profile = match bytes.and_then(|bytes| ies::parse(&bytes)) {
        Ok(profile) => Some(profile),
        Err(message) => {
            fields.problems.push(file.span, format!("{}: {message}", path.display()));
            None
        }
    };
    // Read in any case: what is asked for is known.
    let told = (positive(fields, "power"), positive(fields, "intensity"));
    let strength = positive(fields, "strength");
    if strength.is_some() && told != (None, None) {
        let message =
            "'strength' is a factor on what the 'ies' file says, which 'power' and 'intensity' replace";
        fields.problems.push(fields.span(), message);
    }
    let is_clockwise = fields.flag("clockwise", false);
    let profile = if is_clockwise { profile.map(LightProfile::mirrored) } else { profile };
    let (profile, peak) = ies::relative(profile?);
    let intensity = match told {
        (None, None) => strength.unwrap_or(1.0) * peak / ies::LUMENS_PER_WATT,
        (Some(power), None) => power / (4.0 * PI * f64::from(profile.mean(STEPS)).max(1e-9)),
        (None, Some(intensity)) => intensity,
        (Some(_), Some(_)) => {
            let message = "the light takes either 'power' or 'intensity', or neither with 'ies'";
            fields.problems.push(fields.span(), message);
            return None;
        }
    };
    Some((Arc::new(profile), intensity))
}

/// The light as it shines along -z of its place. A spot's cone is given by its half angles.
pub(super) fn local(fields: &Fields, cone: Option<[f64; 2]>) -> LightKind {
    let turn_rad = fields.number_in("turn", -360.0..360.0, 0.0).to_radians();
    LightKind::Profiled { position: DVec3::ZERO, rotation: DQuat::from_rotation_z(turn_rad), cone }
}

/// How a ball with a profile moves on from where it is at the picture's moment. One that turns would have another beam at each
/// time: it is warned about.
pub(super) fn ball_motion(
    build: &mut Build,
    name: &str,
    now: &LightKind,
    moving: &Moving<LightKind>,
) -> Moving<DAffine3> {
    let place = |kind: &LightKind| match *kind {
        LightKind::Profiled { position, rotation, .. } => (position, rotation),
        _ => (DVec3::ZERO, DQuat::IDENTITY),
    };
    let (from, turn) = place(now);
    if moving.all().any(|then| place(then).1.dot(turn).abs() < 1.0 - 1e-9) {
        let message = "the profile of a light with a radius doesn't turn while the shutter is open: with radius = 0 it does";
        build.loaded.warnings.push(Warning::new(build.file, name, message));
    }
    moving.map(|then| DAffine3::from_translation(place(then).0 - from))
}

/// How a light at a position is turned that shines along an axis. Points shine down unless they say otherwise.
pub(super) fn aimed(fields: &Fields, position: DVec3, axis: Option<DVec3>) -> Option<DQuat> {
    let is_aimed = fields.has("target") || fields.has("direction");
    let axis = match axis {
        None if is_aimed => direction(fields, Some(position))?,
        axis => axis.unwrap_or(DVec3::NEG_Y),
    };
    Some(DQuat::from_rotation_arc(DVec3::NEG_Z, axis))
}

/// How a place turns what shines along -z.
pub(super) fn rotation(place: &Placement) -> DQuat {
    let back = -place.direction;
    DQuat::from_mat3(&DMat3::from_cols(place.right, back.cross(place.right), back)).normalize()
}
