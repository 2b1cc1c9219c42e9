//! Points that shine as a measured profile says.

use super::beam::Cone;
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
    world_from_profile: Quat,
    profile: Option<Arc<LightProfile>>,
    cone: Option<Cone>,
}

impl Profiled {
    /// That of a light at a place.
    pub fn new(light: &scene::Light, position: Vec3, rotation: DQuat, cone: Option<[f64; 2]>) -> Profiled {
        let axis = rotation * DVec3::NEG_Z;
        let cone = cone.map(|[inner, outer]| Cone::new(axis, inner, outer, SpotFade::Smooth));
        let profile = light.profile.clone();
        let mean = profile.as_ref().map_or(1.0, |profile| profile.mean(STEPS));
        // What a narrow beam between the heights sends is not nothing.
        let mean = mean.max(1e-4 * profile.as_ref().map_or(1.0, |profile| profile.peak()));
        Profiled { position, mean, world_from_profile: rotation.as_quat(), profile, cone }
    }

    /// On its way to another.
    pub fn towards(&self, other: &Profiled, share: f32) -> Profiled {
        let world_from_profile = self.world_from_profile.slerp(other.world_from_profile, share);
        let axis = world_from_profile * Vec3::NEG_Z;
        Profiled {
            position: self.position + (other.position - self.position) * share,
            world_from_profile,
            cone: self.cone.map(|cone| cone.about(axis)),
            ..self.clone()
        }
    }

    /// The share of its intensity in a direction of unit length.
    pub fn share(&self, direction: Vec3) -> f32 {
        let of_cone = self.cone.map_or(1.0, |cone| cone.attenuation(direction.dot(cone.axis)));
        let Some(profile) = &self.profile else { return of_cone };
        let local = self.world_from_profile.inverse() * direction;
        let vertical_deg = poly::acos((-local.z).clamp(-1.0, 1.0)).to_degrees();
        let horizontal_deg = poly::atan2(local.y, local.x).to_degrees().rem_euclid(360.0);
        of_cone * profile.at(vertical_deg, horizontal_deg)
    }
}
