//! Groups of lights: their names become names of channels.

use super::findings::Findings;
use crate::scene::{Scene, is_group_name};

/// More than a picture could hold apart.
const MOST_GROUPS: usize = 1 << 15;

pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let groups = scene.light_groups();
    for name in &groups {
        let allowed = "1 to 64 letters, digits, _ and -";
        findings.require(is_group_name(name), "light groups", "name", name, allowed);
    }
    findings.require(groups.len() <= MOST_GROUPS, "light groups", "number", groups.len(), "at most 32768");
}
