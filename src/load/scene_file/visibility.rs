//! Which rays see objects and lights: `visible_to`, a list of kinds of rays, among `camera`, `diffuse`, `glossy`,
//! `transmission`, `volume` and `shadow`; by default all. Rays of other kinds pass as if nothing was there, and get no light
//! of it. `visible_to_camera = false` leaves the camera out of them. What `shadow` rays don't see casts no shadow. With
//! `holdout = true` the picture is transparent where the camera sees the object; with `shadow_catcher = true` it shows there only
//! what other objects change.

use super::build::Build;
use super::fields::Fields;
use super::linking;
use crate::scene::{LightLinks, ObjectTraits, RayKinds};

/// The rays that see something; `own` where nothing is said.
pub(super) fn visible_to(fields: &Fields, own: RayKinds) -> RayKinds {
    let listed = fields.list("visible_to").map(|list| {
        list.iter().fold(RayKinds::NONE, |sum, value| {
            let named = |name: &str| RayKinds::NAMED.iter().find(|(other, _)| *other == name);
            match value.get_ref().as_str().and_then(named) {
                Some((_, kind)) => sum.with(*kind),
                None => {
                    let help = format!("one of: {}", RayKinds::NAMED.map(|(name, _)| name).join(", "));
                    fields.problems.push_help(value.span(), "'visible_to' must hold kinds of rays", help);
                    sum
                }
            }
        })
    });
    let kinds = listed.unwrap_or(own);
    let by_camera = fields.flag("visible_to_camera", kinds.contains(RayKinds::CAMERA));
    kinds.set(RayKinds::CAMERA, by_camera)
}

/// What a table says of an object's traits.
pub(super) struct GivenTraits {
    /// What the object is to rays and pictures.
    pub own: Option<ObjectTraits>,
    /// What the light that it emits is linked to.
    pub links: Option<LightLinks>,
}

impl GivenTraits {
    /// Reads them.
    pub fn read(build: &mut Build, fields: &Fields) -> GivenTraits {
        GivenTraits { own: traits(fields), links: linking::read(build, fields) }
    }

    /// Changes what is said; the rest stays.
    pub fn apply(&self, traits: &mut ObjectTraits) {
        if let Some(own) = self.own {
            *traits = ObjectTraits { links: traits.links, ..own };
        }
        traits.links = self.links.unwrap_or(traits.links);
    }
}

/// What an object is to rays and pictures; `None` where nothing is said.
pub(super) fn traits(fields: &Fields) -> Option<ObjectTraits> {
    // All keys are asked for, so that all are known.
    let given = ["visible_to", "visible_to_camera", "holdout", "shadow_catcher"].map(|key| fields.has(key));
    let visible_to = visible_to(fields, RayKinds::ALL);
    let is_holdout = fields.flag("holdout", false);
    let is_shadow_catcher = fields.flag("shadow_catcher", false);
    let traits = ObjectTraits { visible_to, is_holdout, is_shadow_catcher, ..ObjectTraits::default() };
    given.contains(&true).then_some(traits)
}
