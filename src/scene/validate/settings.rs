//! Settings of rendering.

use super::findings::Findings;
use crate::scene::Settings;

const PLACE: &str = "settings";

pub(super) fn check(settings: &Settings, findings: &mut Findings) {
    let counts = [("width", settings.width), ("height", settings.height), ("samples", settings.samples)];
    for (field, count) in counts {
        findings.require(count != Some(0), PLACE, field, count, "at least 1");
    }
    let is_met = settings.exposure.is_none_or(f32::is_finite);
    findings.require(is_met, PLACE, "exposure", settings.exposure, "a finite number");
}
