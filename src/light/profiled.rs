//! Points that shine as a measured profile says.

use super::cone::Cone;
use crate::math::{DQuat, DVec3, Quat, Vec3, poly};
use crate::scene::{self, LightProfile, SpotFade};
use std::sync::Arc;

/// Heights at which the mean of a profile is taken, which light is chosen by.
const STEPS: u32 = 32;

/// A point with a profile, ready for rendering.
#[derive(Clone, Debug)]
pub(super) struct Profiled {
    /// Where it is.
    pub position: Vec3,
    /// Mean share over all directions.
    pub mean: f32,
    aim: Aim,
    profile: Option<Arc<LightProfile>>,
}

/// How a profile is turned, and the cone that cuts it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    world_from_profile: Quat,
    cone: Option<Cone>,
}

impl Aim {
    /// A cone is given by its half angles, radians.
    pub fn new(rotation: DQuat, cone: Option<[f64; 2]>) -> Aim {
        let axis = rotation * DVec3::NEG_Z;
        let cone = cone.map(|[inner, outer]| Cone::new(axis, inner, outer, SpotFade::Smooth));
        Aim { world_from_profile: rotation.as_quat(), cone }
    }

    /// The axis of the cone and the half angle at which it ends, radians.
    pub fn cone(&self) -> Option<(Vec3, f32)> {
        self.cone.map(|cone| (cone.axis, cone.angles_rad()[1]))
    }

    /// The share of a profile's intensity in a direction of unit length.
    pub fn share(&self, profile: Option<&LightProfile>, direction: Vec3) -> f32 {
        let of_cone = self.cone.map_or(1.0, |cone| cone.attenuation(direction.dot(cone.axis)));
        let Some(profile) = profile else { return of_cone };
        let local = self.world_from_profile.inverse() * direction;
        let vertical_deg = poly::acos((-local.z).clamp(-1.0, 1.0)).to_degrees();
        let horizontal_deg = poly::atan2(local.y, local.x).to_degrees().rem_euclid(360.0);
        of_cone * profile.at(vertical_deg, horizontal_deg)
    }
}

/// The mean share of a profile over all directions, which lights are chosen by.
pub(super) fn mean_share(profile: &LightProfile) -> f32 {
    // What a narrow beam between the heights sends is not nothing.
    profile.mean(STEPS).max(1e-4 * profile.peak())
}

impl Profiled {
    /// That of a light at a place.
    pub fn new(light: &scene::Light, position: Vec3, rotation: DQuat, cone: Option<[f64; 2]>) -> Profiled {
        let profile = light.profile.clone();
        let mean = profile.as_ref().map_or(1.0, |profile| mean_share(profile));
        Profiled { position, mean, aim: Aim::new(rotation, cone), profile }
    }

    /// On its way to another.
    pub fn towards(&self, other: &Profiled, share: f32) -> Profiled {
        let world_from_profile = self.aim.world_from_profile.slerp(other.aim.world_from_profile, share);
        let axis = world_from_profile * Vec3::NEG_Z;
        let cone = self.aim.cone.map(|cone| cone.about(axis));
        Profiled {
            position: self.position + (other.position - self.position) * share,
            aim: Aim { world_from_profile, cone },
            ..self.clone()
        }
    }

    /// The share of its intensity in a direction of unit length.
    pub fn share(&self, direction: Vec3) -> f32 {
        self.aim.share(self.profile.as_deref(), direction)
    }
}
